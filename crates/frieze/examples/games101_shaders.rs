//! Document 004: the five fragment shaders of GAMES101's assignment 3 on the shader hook, with `payload`'s fields
//! under their own names (rows 29, 33 to 37). Here perspective, coverage and the tangent are right; `frieze
//! games101` computes what the course's framework does, oddities included. Writes `games101_NAME.png`.

use frieze::image::pyramid::Pyramid;
use frieze::image::{Encoding, Image, Pixels};
use frieze::map::{Filter, Map, Wrap};
use frieze::math::exact;
use frieze::math::vec::{Mat4, Vec2, Vec3, Vec4};
use frieze::mesh::shape;
use frieze::shade::shader::{Canvas, Fragment, Payload, Shader, Vertex, draw, perspective, texture};
use std::sync::Arc;

struct Uniforms {
    view_model: Mat4,
    projection: Mat4,
    /// In view space, where the points are.
    lights: [Vec3; 2],
    texture: Map,
    size: f32,
}

/// One of the five: what it does with a payload.
struct Games101(fn(&Payload, &Uniforms) -> Vec3);

impl Shader for Games101 {
    type Uniforms = Uniforms;
    type Varying = Payload;
    fn vertex(&self, u: &Uniforms, v: &Vertex) -> (Vec4, Payload) {
        let payload = Payload::new(v, &u.view_model);
        (u.projection.project(payload.view_pos), payload)
    }
    fn fragment(&self, u: &Uniforms, f: &Fragment<Payload>) -> Option<[f32; 4]> {
        let payload = Payload { normal: f.varying.normal.normalize(), ..f.varying };
        Some((self.0)(&payload, u).extend(1.0).array())
    }
}

fn get_color(u: &Uniforms, uv: Vec2) -> Vec3 {
    let still = Vec2::default();
    texture(&u.texture, uv, still, still).xyz()
}

fn normal_fragment_shader(payload: &Payload, _: &Uniforms) -> Vec3 {
    (payload.normal + Vec3::splat(1.0)) / 2.0
}

fn blinn_phong(kd: Vec3, point: Vec3, normal: Vec3, u: &Uniforms) -> Vec3 {
    let (ka, ks, p) = (0.005, 0.7937, 150.0);
    let mut result_color = Vec3::splat(ka * 10.0);
    for light in u.lights {
        let l = (light - point).normalize();
        let v = (-point).normalize();
        let h = (l + v).normalize();
        let r2 = (light - point).length2();
        let ld = kd * (500.0 / r2) * f32::max(0.0, normal.dot(l));
        let ls = ks * (500.0 / r2) * exact::pow(f32::max(0.0, normal.dot(h)), p);
        // += and not =: there are two lights (row 12).
        result_color = result_color + ld + Vec3::splat(ls);
    }
    result_color
}

fn phong_fragment_shader(payload: &Payload, u: &Uniforms) -> Vec3 {
    blinn_phong(payload.color.xyz(), payload.view_pos, payload.normal, u)
}

fn texture_fragment_shader(payload: &Payload, u: &Uniforms) -> Vec3 {
    blinn_phong(get_color(u, payload.uv), payload.view_pos, payload.normal, u)
}

/// The bumped normal and the height.
fn bumped(payload: &Payload, u: &Uniforms) -> (Vec3, f32) {
    let (kh, kn) = (0.2, 0.1);
    let n = payload.normal;
    let s = f32::max((n.x * n.x + n.z * n.z).sqrt(), 1e-6);
    // The hint has no minus signs, and then t is not orthogonal to n.
    let t = Vec3::new(-n.x * n.y / s, s, -n.z * n.y / s);
    let b = n.cross(t);
    let h = |uv: Vec2| (get_color(u, uv) * 255.0).length();
    let here = h(payload.uv);
    let du = kh * kn * (h(payload.uv + Vec2::new(1.0 / u.size, 0.0)) - here);
    let dv = kh * kn * (h(payload.uv + Vec2::new(0.0, 1.0 / u.size)) - here);
    ((t * -du + b * -dv + n).normalize(), here)
}

fn bump_fragment_shader(payload: &Payload, u: &Uniforms) -> Vec3 {
    bumped(payload, u).0
}

fn displacement_fragment_shader(payload: &Payload, u: &Uniforms) -> Vec3 {
    let (normal, height) = bumped(payload, u);
    let point = payload.view_pos + payload.normal * (0.1 * height / 255.0);
    blinn_phong(payload.color.xyz(), point, normal, u)
}

fn main() -> Result<(), frieze::Error> {
    // A texture of soft checks.
    let size = 128;
    let wave = |v: u32| exact::sin(v as f32 / size as f32 * 8.0 * std::f32::consts::TAU);
    let texels = (0..size * size)
        .flat_map(|k| {
            let h = 0.5 + 0.5 * wave(k % size) * wave(k / size);
            [0.35 + 0.6 * h, 0.3 + 0.4 * h, 0.25 + 0.2 * h].map(|v| (v * 255.0).round() as u8)
        })
        .collect();
    let image = Image::new(size, size, 3, Pixels::U8(texels), Encoding::Linear)?;
    let mut mesh = shape::teapot(3.0, 8);
    mesh.colors = None;
    let (lo, hi) = mesh.bounds().unwrap_or_default();
    let (lo, hi) = (Vec3::from(lo), Vec3::from(hi));
    let (center, size_of) = ((lo + hi) * 0.5, (hi - lo).length());
    let eye = center + Vec3::new(0.0, 0.5, 1.2) * size_of;
    let view_model = Mat4::look_at(eye, center, Vec3::new(0.0, 1.0, 0.0));
    let uniforms = Uniforms {
        projection: perspective(45.0, 1.0, 0.1),
        lights: [Vec3::new(20.0, 20.0, 20.0), Vec3::new(-20.0, 20.0, 0.0)].map(|p| view_model.point(p)),
        view_model,
        texture: Map {
            pyramid: Arc::new(Pyramid::new(&image, false)),
            filter: Filter::Bilinear,
            wrap: [Wrap::Repeat; 2],
        },
        size: size as f32,
    };
    for (name, shader) in [
        ("normal", normal_fragment_shader as fn(&Payload, &Uniforms) -> Vec3),
        ("phong", phong_fragment_shader),
        ("texture", texture_fragment_shader),
        ("bump", bump_fragment_shader),
        ("displacement", displacement_fragment_shader),
    ] {
        let mut canvas = Canvas::new(240, 240, 4, [0.0, 0.0, 0.0, 1.0])?;
        draw(&Games101(shader), &uniforms, &mesh, &mut canvas);
        canvas.frame()?.save(format!("games101_{name}.png"))?;
    }
    Ok(())
}
