//! Document 002: a plane and cubes in two passes; first depth as the light sees it, then the picture, which asks
//! whether each fragment is as far as that depth (rows 100 to 103, 108, 109, 112, 113, 115). Writes
//! `shadow_map.png`.

use frieze::math::exact;
use frieze::math::vec::{Mat4, Vec3, Vec4};
use frieze::mesh::{Mesh, shape};
use frieze::shade::shader::{Canvas, Fragment, Shader, Vertex, draw, orthographic, perspective};

/// Pass 1: nothing but depth.
struct Depth;

/// What `setShaderMat4` sets before each object.
struct DepthUniforms {
    light_space: Mat4,
    model: Mat4,
}

impl Shader for Depth {
    type Uniforms = DepthUniforms;
    type Varying = ();
    fn vertex(&self, u: &DepthUniforms, v: &Vertex) -> (Vec4, ()) {
        (u.light_space.apply(u.model.project(v.position)), ())
    }
    fn fragment(&self, _: &DepthUniforms, _: &Fragment<()>) -> Option<[f32; 4]> {
        Some([0.0; 4])
    }
}

/// Pass 2: Blinn-Phong with shadow.
struct Lit;

struct Uniforms<'a> {
    model: Mat4,
    view: Mat4,
    projection: Mat4,
    light_space: Mat4,
    light_pos: Vec3,
    view_pos: Vec3,
    color: Vec3,
    shadow_map: &'a Canvas,
}

frieze::varying! {
    struct VsOut { frag_pos: Vec3, normal: Vec3, frag_pos_light_space: Vec4 }
}

/// 1 in shadow, 0 lit, in ninths.
fn shadow_calculation(map: &Canvas, p: Vec4) -> f32 {
    // Perspective divide, then [-1, 1] -> [0, 1]; rows run down. Depth is reversed here, so forward depth,
    // which the document compares, is 1 - z.
    let proj = p.xyz() / p.w;
    let (x, y) = (proj.x * 0.5 + 0.5, 0.5 - proj.y * 0.5);
    let current_depth = 1.0 - proj.z;
    let bias = 0.005;
    let mut shadow = 0.0;
    for dy in -1..=1 {
        for dx in -1..=1 {
            // GL_NEAREST and GL_REPEAT.
            let texel = |v: f32, size: u32, d: i64| (f64::from(v) * f64::from(size)).floor() as i64 + d;
            let tx = texel(x, map.width(), dx).rem_euclid(i64::from(map.width()));
            let ty = texel(y, map.height(), dy).rem_euclid(i64::from(map.height()));
            let pcf_depth = 1.0 - map.depth(tx as u32, ty as u32);
            shadow += if current_depth - bias > pcf_depth { 1.0 } else { 0.0 };
        }
    }
    shadow / 9.0
}

impl<'a> Shader for &'a Lit {
    type Uniforms = Uniforms<'a>;
    type Varying = VsOut;
    fn vertex(&self, u: &Uniforms<'a>, v: &Vertex) -> (Vec4, VsOut) {
        let frag_pos = u.model.point(v.position);
        let out = VsOut {
            frag_pos,
            normal: u.model.normal_matrix().direction(v.normal),
            frag_pos_light_space: u.light_space.project(frag_pos),
        };
        (u.projection.apply(u.view.project(frag_pos)), out)
    }
    fn fragment(&self, u: &Uniforms<'a>, f: &Fragment<VsOut>) -> Option<[f32; 4]> {
        let fs_in = &f.varying;
        let normal = fs_in.normal.normalize();
        let light_dir = (u.light_pos - fs_in.frag_pos).normalize();
        let view_dir = (u.view_pos - fs_in.frag_pos).normalize();
        let halfway = (light_dir + view_dir).normalize();
        let ambient = 0.3;
        let diffuse = f32::max(light_dir.dot(normal), 0.0);
        let specular = 0.3 * exact::pow(f32::max(normal.dot(halfway), 0.0), 64.0);
        let shadow = shadow_calculation(u.shadow_map, fs_in.frag_pos_light_space);
        // lighting = (ambient + (1.0 - shadow) * (diffuse + specular)) * color
        Some((u.color * (ambient + (1.0 - shadow) * (diffuse + specular))).extend(1.0).array())
    }
}

/// The document's `renderScene`: calls `draw_one` for each object with its model matrix and colour.
fn render_scene(mut draw_one: impl FnMut(&Mesh, Mat4, Vec3)) {
    let (plane, cube) = (shape::plane(20.0, 1), shape::cube(2.0));
    let place = |x: f32, y: f32, z: f32, scale: f32| {
        Mat4::translation(Vec3::new(x, y, z)).times(&Mat4::scale(Vec3::splat(scale)))
    };
    draw_one(&plane, place(0.0, -0.5, 0.0, 1.0), Vec3::new(0.6, 0.55, 0.5));
    draw_one(&cube, place(0.0, 1.5, 0.0, 0.5), Vec3::new(0.8, 0.5, 0.3));
    draw_one(&cube, place(2.0, 0.0, 1.0, 0.5), Vec3::new(0.4, 0.6, 0.8));
    // 60 degrees about (1, 0, 1).
    let turn = Mat4::rotation([0.353_553_4, 0.0, 0.353_553_4, 0.866_025_4]);
    draw_one(&cube, place(-1.0, 0.0, 2.0, 0.25).times(&turn), Vec3::new(0.5, 0.8, 0.4));
}

fn main() -> Result<(), frieze::Error> {
    let up = Vec3::new(0.0, 1.0, 0.0);
    let light_pos = Vec3::new(-2.0, 4.0, -1.0);
    let light_view = Mat4::look_at(light_pos, Vec3::default(), up);
    let light_space = orthographic(10.0, 10.0, 1.0, 7.5).times(&light_view);

    let mut shadow_map = Canvas::new(1024, 1024, 1, [0.0; 4])?;
    render_scene(|mesh, model, _| draw(&Depth, &DepthUniforms { light_space, model }, mesh, &mut shadow_map));

    let view_pos = Vec3::new(1.0, 3.0, 6.5);
    let mut canvas = Canvas::new(320, 240, 4, [0.1, 0.1, 0.1, 1.0])?;
    render_scene(|mesh, model, color| {
        let uniforms = Uniforms {
            model,
            view: Mat4::look_at(view_pos, Vec3::new(0.0, 0.3, 0.0), up),
            projection: perspective(45.0, 4.0 / 3.0, 0.1),
            light_space,
            light_pos,
            view_pos,
            color,
            shadow_map: &shadow_map,
        };
        draw(&&Lit, &uniforms, mesh, &mut canvas);
    });
    canvas.frame()?.save("shadow_map.png")
}
