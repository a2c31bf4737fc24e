//! The shader hook as document 004 and 002 use it: what a fragment is given (row 29), and two passes of different sizes
//! (row 115).

use frieze::image::pyramid::Pyramid;
use frieze::image::{Encoding, Image, Pixels};
use frieze::map::{Filter, Map, Wrap};
use frieze::math::vec::{Mat4, Vec2, Vec3, Vec4};
use frieze::mesh::{Attribute, Mesh, shape};
use frieze::shade::shader::{Canvas, Fragment, Payload, Shader, Vertex, draw, orthographic, perspective, texture};
use std::cell::RefCell;
use std::sync::Arc;

/// Writes down what each fragment is given.
struct Listen(RefCell<Vec<Fragment<Payload>>>);

struct Uniforms {
    view_model: Mat4,
    projection: Mat4,
    texture: Map,
}

impl Shader for Listen {
    type Uniforms = Uniforms;
    type Varying = Payload;
    fn vertex(&self, u: &Uniforms, v: &Vertex) -> (Vec4, Payload) {
        let payload = Payload::new(v, &u.view_model);
        (u.projection.project(payload.view_pos), payload)
    }
    fn fragment(&self, u: &Uniforms, f: &Fragment<Payload>) -> Option<[f32; 4]> {
        self.0.borrow_mut().push(*f);
        Some(texture(&u.texture, f.varying.uv, f.dx.uv, f.dy.uv).array())
    }
}

// Row 29: view_pos, color, normal, tex_coords and texture of the course's payload, in view space and in perspective, with
// the tangent beside them.
#[test]
fn row_29_a_fragment_is_given_the_fields_of_the_payload() {
    let per = |values: Vec<[f32; 3]>| Some(Attribute::per_position(values));
    let mesh = Mesh {
        positions: vec![[-1.0, -0.6, 0.5], [1.2, -0.5, -1.5], [0.1, 1.1, 0.2]],
        corners: vec![0, 1, 2],
        normals: per(vec![[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.8, 0.6]]),
        tangents: Some(Attribute::per_position(vec![
            [1.0, 0.0, 0.0, -1.0],
            [0.8, 0.0, -0.6, -1.0],
            [1.0, 0.0, 0.0, -1.0],
        ])),
        uv: [Some(Attribute::per_position(vec![[0.0, 1.0], [1.0, 0.9], [0.4, 0.0]])), None],
        colors: Some(Attribute::per_position(vec![[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.5], [0.0, 0.0, 1.0, 0.25]])),
        ..Mesh::default()
    };
    // Turned, scaled and moved: 30 degrees about y, twice as large, 5 m in front of the eye.
    let view_model = Mat4::translation(Vec3::new(0.1, -0.2, -5.0))
        .times(&Mat4::rotation([0.0, 0.258_819_05, 0.0, 0.965_925_8]))
        .times(&Mat4::scale(Vec3::splat(2.0)));
    let texels: Vec<u8> = (0..16 * 16 * 4).map(|k| (k * 53 % 251) as u8).collect();
    let image = Image::new(16, 16, 4, Pixels::U8(texels), Encoding::Linear).unwrap();
    let pyramid = Arc::new(Pyramid::new(&image, false));
    let map = Map { pyramid, filter: Filter::Nearest, wrap: [Wrap::Clamp; 2] };
    let uniforms = Uniforms { view_model, projection: perspective(45.0, 1.5, 0.1), texture: map };
    let shader = Listen(RefCell::new(Vec::new()));
    let mut canvas = Canvas::new(90, 60, 1, [0.0; 4]).unwrap();
    draw(&shader, &uniforms, &mesh, &mut canvas);
    let fragments = shader.0.into_inner();
    assert!(fragments.len() > 500, "{}", fragments.len());

    // The triangle in view space, in double precision.
    let corner = |k: usize| {
        let at = |v: Vec3| view_model.point(v).array().map(f64::from);
        at(mesh.positions[k].into())
    };
    let p = [corner(0), corner(1), corner(2)];
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let minus = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let plane = cross(minus(p[1], p[0]), minus(p[2], p[0]));
    let turned = |v: [f32; 3]| {
        // The rotation alone: for normals the scale goes.
        let (s, c) = (0.5f64, 0.75f64.sqrt());
        let v = v.map(f64::from);
        [c * v[0] + s * v[2], v[1], c * v[2] - s * v[0]]
    };
    let half = frieze::math::exact::tan_f64(22.5f64.to_radians());
    for f in &fragments {
        // The ray of the pixel's centre.
        let (x, y) = ((f64::from(f.x) + 0.5) / 45.0 - 1.0, 1.0 - (f64::from(f.y) + 0.5) / 30.0);
        let ray = [x * half * 1.5, y * half, -1.0];
        let t = dot(plane, p[0]) / dot(plane, ray);
        let hit = ray.map(|v| v * t);
        let weight = |k: usize| {
            let (a, b) = (p[(k + 1) % 3], p[(k + 2) % 3]);
            dot(plane, cross(minus(b, a), minus(hit, a))) / dot(plane, plane)
        };
        let w = [weight(0), weight(1), weight(2)];
        let mixed = |v: [[f64; 4]; 3], c: usize| w[0] * v[0][c] + w[1] * v[1][c] + w[2] * v[2][c];
        let check = |name: &str, got: &[f32], corners: [[f64; 4]; 3]| {
            for (c, got) in got.iter().enumerate() {
                let want = mixed(corners, c);
                // Single precision over values up to 7.
                assert!((f64::from(*got) - want).abs() < 1e-5, "{name} at {},{}: {got} {want}", f.x, f.y);
            }
        };
        let v = &f.varying;
        check("view_pos", &v.view_pos.array(), p.map(|p| [p[0], p[1], p[2], 0.0]));
        let four = |v: [f64; 3]| [v[0], v[1], v[2], 0.0];
        check("normal", &v.normal.array(), [0, 1, 2].map(|k| four(turned(mesh.normals.as_ref().unwrap().values[k]))));
        let tangents = &mesh.tangents.as_ref().unwrap().values;
        check(
            "tangent",
            &v.tangent.array(),
            [0, 1, 2].map(|k| {
                let [x, y, z, s] = tangents[k];
                let t = turned([x, y, z]);
                [t[0], t[1], t[2], f64::from(s)]
            }),
        );
        let uv = &mesh.uv[0].as_ref().unwrap().values;
        check("tex_coords", &v.uv.array(), [0, 1, 2].map(|k| [f64::from(uv[k][0]), f64::from(uv[k][1]), 0.0, 0.0]));
        let colors = &mesh.colors.as_ref().unwrap().values;
        check("color", &v.color.array(), [0, 1, 2].map(|k| colors[k].map(f64::from)));
        // The texture is a uniform, and the colour is what was returned.
        let texel = |v: f32| ((v * 16.0) as u32).min(15);
        assert_eq!(canvas.color(f.x, f.y), image.rgba(texel(v.uv.x), texel(v.uv.y)), "{},{}", f.x, f.y);
    }
}

/// Depth alone.
struct Depth;
impl Shader for Depth {
    type Uniforms = Mat4;
    type Varying = ();
    fn vertex(&self, light_space: &Mat4, v: &Vertex) -> (Vec4, ()) {
        (light_space.project(v.position), ())
    }
    fn fragment(&self, _: &Mat4, _: &Fragment<()>) -> Option<[f32; 4]> {
        Some([0.0; 4])
    }
}

/// White where light arrives.
struct Lit;
struct LitUniforms<'a> {
    camera: Mat4,
    light_space: Mat4,
    map: &'a Canvas,
}
frieze::varying! {
    struct FromLight { world: Vec3, light: Vec4 }
}
impl<'a> Shader for &'a Lit {
    type Uniforms = LitUniforms<'a>;
    type Varying = FromLight;
    fn vertex(&self, u: &LitUniforms<'a>, v: &Vertex) -> (Vec4, FromLight) {
        (u.camera.project(v.position), FromLight { world: v.position, light: u.light_space.project(v.position) })
    }
    fn fragment(&self, u: &LitUniforms<'a>, f: &Fragment<FromLight>) -> Option<[f32; 4]> {
        let p = f.varying.light.xyz() / f.varying.light.w;
        let place = Vec2::new(p.x * 0.5 + 0.5, 0.5 - p.y * 0.5);
        let texel = |v: f32, size: u32| ((v * size as f32) as u32).min(size - 1);
        let nearest = u.map.depth(texel(place.x, u.map.width()), texel(place.y, u.map.height()));
        let lit = p.z + 0.02 >= nearest;
        let w = f.varying.world;
        Some([w.x, w.y, w.z, if lit { 1.0 } else { 0.0 }])
    }
}

// Rows 101 and 115: a pass of depth alone, read by a pass of another size. The shadow is where geometry puts it.
#[test]
fn row_115_passes_have_sizes_of_their_own() {
    let plane = shape::plane(4.0, 1);
    let mut lid = shape::plane(1.0, 1);
    lid.positions.iter_mut().for_each(|p| p[1] = 1.0);
    // Light from (1, 1, 0): the lid's shadow lies 1 m beside it.
    let origin = Vec3::default();
    let light_view = Mat4::look_at(Vec3::new(2.0, 2.0, 0.0), origin, Vec3::new(0.0, 1.0, 0.0));
    let light_space = orthographic(3.0, 3.0, 0.1, 6.0).times(&light_view);
    // From straight below nothing hides the floor; the picture shows its lower side.
    let camera_view = Mat4::look_at(Vec3::new(0.0, -3.0, 0.0), origin, Vec3::new(0.0, 0.0, 1.0));
    let camera = orthographic(2.0, 1.5, 0.1, 3.5).times(&camera_view);
    for (map_size, size) in [((64, 200), (80, 60)), ((300, 120), (41, 97)), ((512, 512), (16, 16))] {
        let mut map = Canvas::new(map_size.0, map_size.1, 1, [0.0; 4]).unwrap();
        draw(&Depth, &light_space, &plane, &mut map);
        draw(&Depth, &light_space, &lid, &mut map);
        assert_eq!((map.width(), map.height()), map_size);
        let mut canvas = Canvas::new(size.0, size.1, 1, [f32::NAN; 4]).unwrap();
        draw(&&Lit, &LitUniforms { camera, light_space, map: &map }, &plane, &mut canvas);
        assert_eq!((canvas.width(), canvas.height()), size);
        let mut dark = 0;
        for (y, x) in (0..size.1).flat_map(|y| (0..size.0).map(move |x| (y, x))) {
            let [wx, _, wz, lit] = canvas.color(x, y);
            assert!(!wx.is_nan(), "the floor fills the picture");
            // The lid covers -0.5 to 0.5; along the light its shadow is at -1.5 to -0.5.
            let inside = (0.5 - (wx + 1.0).abs()).min(0.5 - wz.abs());
            // A texel is at most 6 / 64 wide, seen under 45 degrees.
            if inside.abs() > 0.14 {
                assert_eq!(lit, if inside > 0.0 { 0.0 } else { 1.0 }, "{map_size:?} {size:?}: {wx} {wz}");
            }
            dark += u32::from(lit == 0.0);
        }
        assert!(dark * 20 > size.0 * size.1, "{dark}");
    }
}
