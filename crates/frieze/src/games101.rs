//! Assignment 3 of GAMES101, whole: loop, buffers and the five fragment shaders in one file, the way the
//! course's framework computes them (rows 20 to 37), oddities included. It shares nothing with the renderer:
//! a learner can read it beside the assignment.
//!
//! What the framework does that one would not expect, and [`Options::corrected`] mends (numbers of the errata
//! in brackets):
//! - t of the bump and displacement shaders is not orthogonal to n \[E1\];
//! - the projection takes near and far with mixed signs, so depth is nearly constant \[E7\];
//! - attributes are interpolated without perspective, as w was set to 1 \[E8\];
//! - pixels are truncated towards zero and not clipped \[E9\] (here writes outside are always dropped);
//! - a pixel's colour is multiplied with its coverage and overwrites what was there, which darkens every
//!   edge, inner ones too \[E10\];
//! - points are in view space but lights and eye are not \[E12c\];
//! - a bump's slopes are differences per texel, whatever the size of mesh and texture, along a frame that has nothing to
//!   do with u and v \[E13\]; mended, they are slopes of the surface, and any frame gives the same normal;
//! - a height is the length of the RGB vector, 0 to 441, which displaces by up to 44 units with the camera 10 away
//!   \[E14\]; mended, it is the mean of the channels, -1/2 to 1/2, in units of kn, for both shaders;
//! - the picture sits one row too low and its lowest row is lost.
//!
//! That displacement moves only the point that is shaded (E17) is the assignment's method; it stays.

use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::image::{Encoding, Image, Pixels};
use crate::job::Job;
use crate::math::exact;
use crate::math::vec::{Mat4, Vec2, Vec3};
use crate::mesh::Mesh;

/// The picture's side in pixels.
pub const SIZE: usize = 700;
const SIDE: f32 = SIZE as f32;

/// The five fragment shaders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shader {
    /// The normal as a colour (row 33).
    Normal,
    /// Blinn-Phong with the vertex colour (row 34).
    Phong,
    /// Blinn-Phong with the texture's colour (row 35).
    Texture,
    /// The bumped normal as a colour (row 36).
    Bump,
    /// Blinn-Phong at the displaced point with the bumped normal (row 37).
    Displacement,
}

impl Shader {
    /// Every shader with its word on the command line.
    pub const ALL: [(&'static str, Shader); 5] = [
        ("normal", Shader::Normal),
        ("phong", Shader::Phong),
        ("texture", Shader::Texture),
        ("bump", Shader::Bump),
        ("displacement", Shader::Displacement),
    ];
    /// Whether it reads the texture.
    pub fn needs_texture(self) -> bool {
        matches!(self, Shader::Texture | Shader::Bump | Shader::Displacement)
    }
}

/// How the four sub-samples of a pixel are tested.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Coverage {
    /// Each where it is: `--coverage 4`, what the document intends.
    #[default]
    Four,
    /// All at the pixel's corner: `--coverage int`. The framework's `insideTriangle(int x, int y)` truncates
    /// them, so a pixel is covered by all four or by none.
    Int,
}

/// How the assignment is rendered.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// How sub-samples are tested.
    pub coverage: Coverage,
    /// Mends the errata above.
    pub corrected: bool,
    /// Memory and cancellation.
    pub job: Job,
}

/// Renders `mesh` as the assignment does: 700x700 pixels, RGB, background 0. Normals and texture coordinates are
/// the file's; where it has none, a triangle gets its geometric normal and (0, 0), as by the framework's loader.
///
/// # Errors
/// `games101.texture` when the shader reads a texture and there is none; `job.memory`, `job.interrupted`.
pub fn render(shader: Shader, mesh: &Mesh, texture: Option<&Image>, options: &Options) -> Result<Frame> {
    if shader.needs_texture() && texture.is_none() {
        return Err(
            Error::arguments("games101.texture", "this shader reads a texture").remedy("give one with --texture FILE")
        );
    }
    let _memory = options.job.reserve((SIZE * SIZE * 4 * 20) as u64, "the picture")?;
    let stage = VertexStage::new(options.corrected);
    let mut target = Target::new(options.corrected);
    let texture = texture.map(Texels);
    for k in 0..mesh.triangle_count() {
        if k % 4096 == 0 {
            options.job.check()?;
            options.job.progress("games101", k as u64, mesh.triangle_count() as u64);
        }
        if let Some(triangle) = stage.triangle(mesh, k) {
            rasterize(&triangle, options, &mut target, |payload| match shader {
                Shader::Normal => normal_fragment_shader(payload),
                Shader::Phong => phong_fragment_shader(payload, &stage.lighting),
                Shader::Texture => texture_fragment_shader(payload, &stage.lighting, texture.as_ref()),
                Shader::Bump => bump_fragment_shader(payload, texture.as_ref(), options.corrected),
                Shader::Displacement => {
                    displacement_fragment_shader(payload, &stage.lighting, texture.as_ref(), options.corrected)
                }
            });
        }
    }
    Ok(Frame { color: target.image()?, planes: Vec::new() })
}

// ---------------------------------------------------------------------------------------------- vertices

/// Model, view, projection and viewport.
struct VertexStage {
    view_model: Mat4,
    normals: Mat4,
    mvp: Mat4,
    lighting: Lighting,
    corrected: bool,
}

const NEAR: f32 = 0.1;
const FAR: f32 = 50.0;

impl VertexStage {
    fn new(corrected: bool) -> Self {
        #[allow(clippy::approx_constant)] // The framework's own.
        let pi = 3.141_592_6_f64;
        let angle = f64::from((140.0 * pi / 180.0) as f32);
        let (s, c) = exact::sin_cos_f64(angle);
        let (s, c) = (s as f32, c as f32);
        let rotation = Mat4([[c, 0.0, -s, 0.0], [0.0, 1.0, 0.0, 0.0], [s, 0.0, c, 0.0], [0.0, 0.0, 0.0, 1.0]]);
        let model = product(&rotation, &Mat4::scale(Vec3::splat(2.5)));
        let eye = Vec3::new(0.0, 0.0, 10.0);
        let view = Mat4::translation(-eye);
        let view_model = product(&view, &model);
        let fov = f64::from((45.0 / 180.0 * pi) as f32);
        let top = exact::tan_f64(fov / 2.0) as f32 * NEAR;
        // E7: far should be negative too.
        let (near, far) = (-NEAR, if corrected { -FAR } else { FAR });
        let scale = Mat4::scale(Vec3::new(1.0 / top, 1.0 / top, 2.0 / (near - far)));
        let middle = Mat4::translation(Vec3::new(0.0, 0.0, -(near + far) / 2.0));
        let squeeze = Mat4([
            [near, 0.0, 0.0, 0.0],
            [0.0, near, 0.0, 0.0],
            [0.0, 0.0, near + far, 1.0],
            [0.0, 0.0, -near * far, 0.0],
        ]);
        let projection = product(&product(&scale, &middle), &squeeze);
        let lighting = Lighting {
            lights: [Vec3::new(20.0, 20.0, 20.0), Vec3::new(-20.0, 20.0, 0.0)].map(|p| {
                // E12c: lights and eye belong into the space of the points.
                if corrected { view.point(p) } else { p }
            }),
            eye: if corrected { view.point(eye) } else { eye },
        };
        VertexStage {
            view_model,
            normals: view_model.inverse().unwrap_or_default().transpose(),
            mvp: product(&projection, &view_model),
            lighting,
            corrected,
        }
    }
    fn triangle(&self, mesh: &Mesh, k: usize) -> Option<Triangle> {
        let corners = mesh.triangle(k);
        let p = corners.map(|c| Vec3::from(mesh.position(c)));
        let geometric = (p[0] - p[1]).cross(p[2] - p[1]);
        let vertices: [Vertex; 3] = core::array::from_fn(|i| {
            let c = corners[i];
            let normal = mesh.normals.as_ref().map_or(geometric, |a| a.at(mesh, c).into());
            let uv = mesh.uv[0].as_ref().map_or([0.0, 1.0], |a| a.at(mesh, c));
            let clip = self.mvp.project(p[i]);
            let ndc = Vec3::new(clip.x / clip.w, clip.y / clip.w, clip.z / clip.w);
            Vertex {
                screen: Vec3::new(
                    (0.5 * f64::from(SIDE) * (f64::from(ndc.x) + 1.0)) as f32,
                    (0.5 * f64::from(SIDE) * (f64::from(ndc.y) + 1.0)) as f32,
                    ndc.z * ((FAR - NEAR) / 2.0) + (FAR + NEAR) / 2.0,
                ),
                w: clip.w,
                view: self.view_model.point(p[i]),
                normal: self.normals.direction(normal),
                // Our meshes count v down the image, the framework up.
                uv: Vec2::new(uv[0], 1.0 - uv[1]),
            }
        });
        // The framework clips nothing; corrected, what reaches before the near plane is left out.
        let finite = vertices.iter().all(|v| v.screen.is_finite());
        let clipped = self.corrected && vertices.iter().any(|v| v.view.z > -NEAR);
        (finite && !clipped).then_some(Triangle(vertices))
    }
}

/// The product in single precision, columns summed from the first to the last, as the framework's library does.
fn product(a: &Mat4, b: &Mat4) -> Mat4 {
    Mat4(b.0.map(|c| {
        core::array::from_fn(|r| ((a.0[0][r] * c[0] + a.0[1][r] * c[1]) + a.0[2][r] * c[2]) + a.0[3][r] * c[3])
    }))
}

struct Vertex {
    /// Pixels, y up; z between near and far, larger is nearer.
    screen: Vec3,
    w: f32,
    view: Vec3,
    normal: Vec3,
    uv: Vec2,
}

struct Triangle([Vertex; 3]);

impl Triangle {
    /// The framework's `insideTriangle`: points on an edge are outside.
    fn contains(&self, x: f32, y: f32) -> bool {
        let v = [0, 1, 2].map(|k| Vec3::new(self.0[k].screen.x, self.0[k].screen.y, 1.0));
        let f = [v[1].cross(v[0]), v[2].cross(v[1]), v[0].cross(v[2])];
        let p = Vec3::new(x, y, 1.0);
        (0..3).all(|k| dot(p, f[k]) * dot(f[k], v[(k + 2) % 3]) > 0.0)
    }
    /// Corrected: exact signs, edges belong to both triangles (depth decides), so nothing shows through.
    fn covers(&self, x: f32, y: f32) -> bool {
        let v = [0, 1, 2].map(|k| [f64::from(self.0[k].screen.x), f64::from(self.0[k].screen.y)]);
        let p = [f64::from(x), f64::from(y)];
        let side = |a: [f64; 2], b: [f64; 2]| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
        let s = [side(v[0], v[1]), side(v[1], v[2]), side(v[2], v[0])];
        let area = (v[1][0] - v[0][0]) * (v[2][1] - v[0][1]) - (v[1][1] - v[0][1]) * (v[2][0] - v[0][0]);
        area != 0.0 && (s.iter().all(|s| *s >= 0.0) || s.iter().all(|s| *s <= 0.0))
    }
    /// The framework's `computeBarycentric2D` (row 25).
    fn barycentric(&self, x: f32, y: f32) -> [f32; 3] {
        let v = [0, 1, 2].map(|k| self.0[k].screen);
        let line = |a: Vec3, b: Vec3, x: f32, y: f32| x * (a.y - b.y) + (b.x - a.x) * y + a.x * b.y - b.x * a.y;
        [
            line(v[1], v[2], x, y) / line(v[1], v[2], v[0].x, v[0].y),
            line(v[2], v[0], x, y) / line(v[2], v[0], v[1].x, v[1].y),
            line(v[0], v[1], x, y) / line(v[0], v[1], v[2].x, v[2].y),
        ]
    }
    fn payload(&self, [a, b, c]: [f32; 3]) -> Payload {
        let [u, v, w] = &self.0;
        // `normalized()` twice, as the framework's loop and payload do.
        let normal = normalized(normalized(u.normal * a + v.normal * b + w.normal * c));
        Payload {
            view_pos: u.view * a + v.view * b + w.view * c,
            color: Vec3::new(148.0, 121.0, 92.0) / 255.0,
            normal,
            tex_coords: u.uv * a + v.uv * b + w.uv * c,
            slopes: [Vec3::default(); 2],
        }
    }
    /// How u and v grow on the triangle, per unit of view space; 0 for a triangle without area.
    fn slopes(&self) -> [Vec3; 2] {
        let [a, b, c] = &self.0;
        let (e1, e2) = (b.view - a.view, c.view - a.view);
        let n = e1.cross(e2);
        let area2 = dot(n, n);
        if area2.is_nan() || area2 <= 0.0 {
            return [Vec3::default(); 2];
        }
        // What has these slopes along e1 and e2, and none along n.
        let slope = |d1: f32, d2: f32| (e2.cross(n) * d1 + n.cross(e1) * d2) / area2;
        let (d1, d2) = (b.uv - a.uv, c.uv - a.uv);
        [slope(d1.x, d2.x), slope(d1.y, d2.y)]
    }
}

/// Inner product in the order of the framework's library.
fn dot(a: Vec3, b: Vec3) -> f32 {
    a.x * b.x + (a.y * b.y + a.z * b.z)
}

fn norm(v: Vec3) -> f32 {
    dot(v, v).sqrt()
}

fn normalized(v: Vec3) -> Vec3 {
    let l = norm(v);
    if l > 0.0 { v / l } else { v }
}

// ------------------------------------------------------------------------------------------------ pixels

/// The four sub-samples of a pixel (row 24).
const SAMPLES: [[f32; 2]; 4] = [[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]];

/// Frame buffer and depth buffer: one entry per pixel, or one per sample when corrected (E10).
struct Target {
    per: usize,
    /// Row from the top of pixel row 0, which is the lowest.
    top: i64,
    color: Vec<[f32; 3]>,
    depth: Vec<f32>,
}

impl Target {
    fn new(corrected: bool) -> Self {
        let per = if corrected { 4 } else { 1 };
        Target {
            per,
            // `(height - y) * width + x`: off by one, so row 0 falls off the buffer.
            top: if corrected { SIZE as i64 - 1 } else { SIZE as i64 },
            color: vec![[0.0; 3]; SIZE * SIZE * per],
            depth: vec![f32::INFINITY; SIZE * SIZE * per],
        }
    }
    /// The buffers' index of a pixel; `None` outside.
    fn index(&self, i: i64, j: i64) -> Option<usize> {
        let row = self.top - j;
        let range = 0..SIZE as i64;
        (range.contains(&i) && range.contains(&row)).then(|| (row as usize * SIZE + i as usize) * self.per)
    }
    fn image(self) -> Result<Image> {
        let n = self.per;
        let mean = |p: &[[f32; 3]], c: usize| p.iter().map(|p| p[c]).sum::<f32>() / n as f32;
        let pixels = self.color.chunks_exact(n).flat_map(|p| [0, 1, 2].map(|c| to_u8(mean(p, c)))).collect();
        Image::new(SIZE as u32, SIZE as u32, 3, Pixels::U8(pixels), Encoding::Srgb)
    }
}

/// Half to even, then clamped (row 30): what OpenCV's saturating conversion does.
fn to_u8(v: f32) -> u8 {
    v.round_ties_even() as u8
}

fn rasterize(t: &Triangle, options: &Options, target: &mut Target, shader: impl Fn(Payload) -> Vec3) {
    let s = [0, 1, 2].map(|k| t.0[k].screen);
    let x = s.map(|s| s.x);
    let y = s.map(|s| s.y);
    let least = |v: [f32; 3]| v[0].min(v[1]).min(v[2]);
    let most = |v: [f32; 3]| v[0].max(v[1]).max(v[2]);
    // E9: the framework truncates towards zero and trusts the mesh to be on the screen.
    let round = |v: f32| if options.corrected { v.floor() as i64 } else { v as i64 };
    let (left, right) = (round(least(x)).max(0), round(most(x)).min(SIZE as i64));
    let (bottom, top) = (round(least(y)).max(0), round(most(y)).min(SIZE as i64));
    let slopes = if options.corrected { t.slopes() } else { [Vec3::default(); 2] };
    for i in left..=right {
        for j in bottom..=top {
            let Some(index) = target.index(i, j) else { continue };
            let (px, py) = (i as f32, j as f32);
            let covered = SAMPLES.map(|[dx, dy]| {
                let (dx, dy) = if options.coverage == Coverage::Int { (0.0, 0.0) } else { (dx, dy) };
                if options.corrected { t.covers(px + dx, py + dy) } else { t.contains(px + dx, py + dy) }
            });
            let count = covered.iter().filter(|c| **c).count();
            if count == 0 {
                continue;
            }
            let at = t.barycentric(px + 0.5, py + 0.5);
            if options.corrected {
                // Depth is affine on the screen and belongs to each sample; attributes are divided by w (E8).
                let w = [0, 1, 2].map(|k| at[k] / t.0[k].w);
                let payload = Payload { slopes, ..t.payload(w.map(|v| v / (w[0] + w[1] + w[2]))) };
                let mut color = None;
                for (k, [dx, dy]) in SAMPLES.iter().enumerate().filter(|(k, _)| covered[*k]) {
                    let b = t.barycentric(px + dx, py + dy);
                    let z = -(b[0] * s[0].z + b[1] * s[1].z + b[2] * s[2].z);
                    if target.depth[index + k] > z {
                        target.depth[index + k] = z;
                        target.color[index + k] = color.get_or_insert_with(|| shader(payload)).array();
                    }
                }
            } else {
                // Every w is 1 here, so Z is 1 up to rounding.
                let z = (1.0 / f64::from(at[0] + at[1] + at[2])) as f32;
                let zp = (at[0] * s[0].z + at[1] * s[1].z + at[2] * s[2].z) * z;
                if target.depth[index] > -zp {
                    target.depth[index] = -zp;
                    // E10: darkened by its coverage, and nothing of what was there is kept.
                    target.color[index] = (shader(t.payload(at)) * (count as f32 / 4.0)).array();
                }
            }
        }
    }
}

// ------------------------------------------------------------------------------------------- the shaders

/// What a fragment shader is given (rows 28, 29).
#[derive(Clone, Copy, Debug)]
struct Payload {
    view_pos: Vec3,
    color: Vec3,
    normal: Vec3,
    tex_coords: Vec2,
    /// How u and v grow in space; only corrected shaders read it.
    slopes: [Vec3; 2],
}

struct Lighting {
    lights: [Vec3; 2],
    eye: Vec3,
}

/// The texture: 0 ..= 255 per channel, v up.
struct Texels<'a>(&'a Image);

impl Texels<'_> {
    /// `getColor`: column trunc(u w), row trunc((1 - v) h), clamped to the image.
    fn color(&self, u: f32, v: f32) -> Vec3 {
        let (w, h) = (self.0.width(), self.0.height());
        let x = ((u * w as f32) as u32).min(w - 1);
        let y = (((1.0 - v) * h as f32) as u32).min(h - 1);
        let [r, g, b, _] = self.0.rgba(x, y);
        // Whole numbers for 8-bit images: v / 255 * 255 is within half of one.
        let back = |v: f32| if matches!(self.0.pixels(), Pixels::U8(_)) { (v * 255.0).round() } else { v * 255.0 };
        Vec3::new(back(r), back(g), back(b))
    }
}

fn normal_fragment_shader(payload: Payload) -> Vec3 {
    (normalized(payload.normal) + Vec3::splat(1.0)) / 2.0 * 255.0
}

/// Rows 5 to 9, shared by three of the five.
fn blinn_phong(kd: Vec3, point: Vec3, normal: Vec3, lighting: &Lighting) -> Vec3 {
    let (ka, ks, intensity, ambient, p) = (0.005_f32, 0.7937_f32, 500.0_f32, 10.0_f32, 150.0_f32);
    let mut result = Vec3::splat(0.0);
    for light in lighting.lights {
        let l = normalized(light - point);
        let v = normalized(lighting.eye - point);
        let h = normalized(l + v);
        let r2 = dot(light - point, light - point);
        let ld = kd * (intensity / r2) * f32::max(0.0, dot(normal, l));
        let ls = ks * (intensity / r2) * exact::pow(f32::max(0.0, dot(normal, h)), p);
        result = result + (Vec3::splat(ls) + ld);
    }
    (result + Vec3::splat(ka * ambient)) * 255.0
}

fn phong_fragment_shader(payload: Payload, lighting: &Lighting) -> Vec3 {
    blinn_phong(payload.color, payload.view_pos, payload.normal, lighting)
}

fn texture_fragment_shader(payload: Payload, lighting: &Lighting, texture: Option<&Texels<'_>>) -> Vec3 {
    let texel = texture.map_or(Vec3::splat(0.0), |t| t.color(payload.tex_coords.x, payload.tex_coords.y));
    blinn_phong(texel / 255.0, payload.view_pos, payload.normal, lighting)
}

const KH: f32 = 0.2;
const KN: f32 = 0.1;

/// The bumped normal and how far the point is moved along the normal: rows 65, 72, 73, 75.
fn bumped(payload: &Payload, texture: &Texels<'_>, corrected: bool) -> (Vec3, f32) {
    let n = payload.normal;
    let s = (n.x * n.x + n.z * n.z).sqrt();
    let t = if !corrected {
        Vec3::new(n.x * n.y / s, s, n.z * n.y / s)
    } else if s > 1e-6 {
        Vec3::new(-n.x * n.y / s, s, -n.z * n.y / s)
    } else {
        Vec3::new(1.0, 0.0, 0.0)
    };
    let b = n.cross(t);
    let (u, v) = (payload.tex_coords.x, payload.tex_coords.y);
    let (w, h) = (texture.0.width() as f32, texture.0.height() as f32);
    let (ln, offset) = if corrected {
        // E14: one number, signed (row 75). E13: its slope in space, then along t and b (row 67: whichever they are).
        let height = |u: f32, v: f32| KN * (dot(texture.color(u, v), Vec3::splat(1.0)) / (3.0 * 255.0) - 0.5);
        let here = height(u, v);
        let du = (height(u + 1.0 / w, v) - here) * w;
        let dv = (height(u, v + 1.0 / h) - here) * h;
        let slope = payload.slopes[0] * du + payload.slopes[1] * dv;
        (Vec3::new(-dot(slope, t), -dot(slope, b), 1.0), here)
    } else {
        let height = norm(texture.color(u, v));
        let du = KH * KN * (norm(texture.color(u + 1.0 / w, v)) - height);
        let dv = KH * KN * (norm(texture.color(u, v + 1.0 / h)) - height);
        (Vec3::new(-du, -dv, 1.0), KN * height)
    };
    let row = |t: f32, b: f32, n: f32| dot(Vec3::new(t, b, n), ln);
    (normalized(Vec3::new(row(t.x, b.x, n.x), row(t.y, b.y, n.y), row(t.z, b.z, n.z))), offset)
}

fn bump_fragment_shader(payload: Payload, texture: Option<&Texels<'_>>, corrected: bool) -> Vec3 {
    let Some(texture) = texture else { return payload.normal * 255.0 };
    bumped(&payload, texture, corrected).0 * 255.0
}

fn displacement_fragment_shader(
    payload: Payload,
    lighting: &Lighting,
    texture: Option<&Texels<'_>>,
    corrected: bool,
) -> Vec3 {
    let Some(texture) = texture else { return phong_fragment_shader(payload, lighting) };
    let (normal, offset) = bumped(&payload, texture, corrected);
    let point = payload.view_pos + payload.normal * offset;
    blinn_phong(payload.color, point, normal, lighting)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Attribute;

    /// A mesh from triangles given in view space: position, unit normal, uv (v up, as in the file).
    fn mesh(triangles: &[[(Vec3, Vec3, [f32; 2]); 3]]) -> Mesh {
        let stage = VertexStage::new(false);
        let back = stage.view_model.inverse().unwrap();
        let turn = stage.view_model.transpose();
        let all: Vec<_> = triangles.iter().flatten().collect();
        Mesh {
            positions: all.iter().map(|v| back.point(v.0).array()).collect(),
            corners: (0..all.len() as u32).collect(),
            normals: Some(Attribute::per_position(all.iter().map(|v| turn.direction(v.1).array()).collect())),
            uv: [Some(Attribute::per_position(all.iter().map(|v| [v.2[0], 1.0 - v.2[1]]).collect())), None],
            ..Mesh::default()
        }
    }
    const Z: Vec3 = Vec3::new(0.0, 0.0, 1.0);

    /// A triangle that covers the whole screen at depth -10.
    fn wall(n: Vec3) -> Mesh {
        let v = |x: f32, y: f32| (Vec3::new(x, y, -10.0), n, [0.5, 0.5]);
        mesh(&[[v(-20.0, -20.0), v(20.0, -20.0), v(0.0, 30.0)]])
    }
    fn pixel(frame: &Frame, x: usize, y: usize) -> [u8; 3] {
        let Pixels::U8(p) = frame.color.pixels() else { panic!("8 bits") };
        let k = (y * SIZE + x) * 3;
        [p[k], p[k + 1], p[k + 2]]
    }
    fn solid(rgb: [u8; 3]) -> Image {
        Image::new(1, 1, 3, Pixels::U8(rgb.to_vec()), Encoding::Srgb).unwrap()
    }
    /// View position of the pixel's centre on the wall at -10: the inverse of the viewport and the projection.
    fn place(x: usize, row: usize) -> [f64; 3] {
        let tan = (core::f64::consts::PI / 8.0) as f32;
        let tan = exact::tan_f64(f64::from(tan));
        let ndc = |v: f64| v / 350.0 - 1.0;
        [ndc(x as f64 + 0.5) * 10.0 * tan, ndc((700 - row) as f64 + 0.5) * 10.0 * tan, -10.0]
    }
    /// Blinn-Phong in double precision, straight from the formula.
    fn closed_form(kd: [f64; 3], p: [f64; 3], n: [f64; 3]) -> [f64; 3] {
        let unit = |v: [f64; 3]| {
            let l = v.iter().map(|c| c * c).sum::<f64>().sqrt();
            v.map(|c| c / l)
        };
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let sub = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        let mut sum = [0.05; 3];
        for light in [[20.0, 20.0, 20.0], [-20.0, 20.0, 0.0]] {
            let to = sub(light, p);
            let (l, v) = (unit(to), unit(sub([0.0, 0.0, 10.0], p)));
            let h = unit([l[0] + v[0], l[1] + v[1], l[2] + v[2]]);
            let i = 500.0 / dot(to, to);
            let lobe = exact::pow_f64(dot(n, h).max(0.0), 150.0);
            for c in 0..3 {
                sum[c] += kd[c] * i * dot(n, l).max(0.0) + 0.7937 * i * lobe;
            }
        }
        sum.map(|v| v * 255.0)
    }
    fn close(got: [u8; 3], want: [f64; 3]) {
        for c in 0..3 {
            // Half a step of 8 bits, and a hundredth for single precision.
            let want = want[c].clamp(0.0, 255.0);
            assert!((f64::from(got[c]) - want).abs() <= 0.51, "{got:?} {want:?}");
        }
    }
    const KD: [f64; 3] = [148.0 / 255.0, 121.0 / 255.0, 92.0 / 255.0];

    #[test]
    fn row_21_projection_is_the_closed_form_with_mixed_signs() {
        for (corrected, n, f) in [(false, -0.1, 50.0), (true, -0.1, -50.0)] {
            let stage = VertexStage::new(corrected);
            let back = stage.view_model.inverse().unwrap();
            for p in [Vec3::new(1.0, -2.0, -10.0), Vec3::new(0.3, 0.4, -1.0), Vec3::new(-3.0, 5.0, -40.0)] {
                let clip = stage.mvp.project(back.point(p)).map(f64::from);
                let tan = exact::tan_f64(core::f64::consts::PI / 8.0);
                let z = f64::from(p.z);
                let want = [
                    f64::from(p.x) / (-z * tan),
                    f64::from(p.y) / (-z * tan),
                    ((n + f) / 2.0 - n * f / z) * 2.0 / (n - f),
                ];
                for (got, want) in [clip.x / clip.w, clip.y / clip.w, clip.z / clip.w].iter().zip(want) {
                    // Matrices of single precision with entries up to 50.
                    assert!((got - want).abs() < 3e-5, "{got} {want}");
                }
            }
        }
    }

    #[test]
    fn row_30_and_33_colours_round_half_to_even_and_saturate() {
        assert_eq!([126.5, 127.5, -3.0, 300.0, f32::NAN].map(to_u8), [126, 128, 0, 255, 0]);
        let frame = render(Shader::Normal, &wall(Z), None, &Options::default()).unwrap();
        assert_eq!(pixel(&frame, 350, 350), [128, 128, 255]);
        // The lowest pixel row is written below the picture: row 0 of the picture belongs to j = 700.
        assert_eq!(pixel(&frame, 10, 699), [128, 128, 255]);
    }

    #[test]
    fn row_24_coverage_darkens_every_edge_and_corrected_does_not() {
        // Two triangles that share the diagonal x = y, drawn over each other's edge.
        let v = |x: f32, y: f32| (Vec3::new(x, y, -10.0), Z, [0.0, 0.0]);
        let [a, b, c, d] = [v(-20.0, -20.0), v(20.0, -20.0), v(20.0, 20.0), v(-20.0, 20.0)];
        let m = mesh(&[[a, b, c], [a, c, d]]);
        let dark = |options: &Options| {
            let frame = render(Shader::Normal, &m, None, options).unwrap();
            (1..699).filter(|&x| pixel(&frame, x, 350)[2] < 255).count()
        };
        let corrected = Options { corrected: true, ..Options::default() };
        let int = Options { coverage: Coverage::Int, ..Options::default() };
        assert!(dark(&Options::default()) > 0, "the seam is the teaching example");
        assert_eq!(dark(&corrected), 0);
        // One test per pixel: covered or not, never darkened by a part.
        let frame = render(Shader::Normal, &m, None, &int).unwrap();
        let seam = (1..699).map(|x| pixel(&frame, x, 350)[2]).filter(|b| *b != 255 && *b != 0).count();
        assert_eq!(seam, 0);
    }

    #[test]
    fn row_24_a_pixel_is_darkened_by_the_samples_inside() {
        let v =
            |x: f32, y: f32| Vertex { screen: Vec3::new(x, y, 1.0), w: 1.0, view: Z, normal: Z, uv: Vec2::default() };
        // Left of x = 10.5: two of the four samples of pixel 10.
        let t = Triangle([v(10.5, -100.0), v(10.5, 300.0), v(-100.0, 100.0)]);
        for (coverage, want) in [(Coverage::Four, 127.5), (Coverage::Int, 255.0)] {
            let mut target = Target::new(false);
            let options = Options { coverage, ..Options::default() };
            rasterize(&t, &options, &mut target, |_| Vec3::splat(255.0));
            let k = target.index(10, 100).unwrap();
            assert_eq!(target.color[k], [want; 3]);
        }
    }

    #[test]
    fn row_22_a_mesh_beside_the_screen_writes_nothing_outside() {
        for z in [-10.0, 0.0] {
            let v = |x: f32, y: f32| (Vec3::new(x, y, z), Z, [7.0, -3.0]);
            let m = mesh(&[[v(-2000.0, -3000.0), v(30.0, 5.0), v(0.0, 3000.0)]]);
            for corrected in [false, true] {
                let options = Options { corrected, ..Options::default() };
                for (_, shader) in Shader::ALL {
                    render(shader, &m, Some(&solid([9, 9, 9])), &options).unwrap();
                }
            }
        }
    }

    #[test]
    fn row_25_barycentrics_sum_to_one_and_reproduce_positions() {
        let v =
            |x: f32, y: f32| Vertex { screen: Vec3::new(x, y, 1.0), w: 1.0, view: Z, normal: Z, uv: Vec2::default() };
        let t = Triangle([v(3.0, 7.0), v(640.0, 90.0), v(200.0, 555.0)]);
        let b = t.barycentric(250.5, 200.5);
        let at = |f: fn(&Vertex) -> f32| b[0] * f(&t.0[0]) + b[1] * f(&t.0[1]) + b[2] * f(&t.0[2]);
        // Products of 700 x 700 in single precision over an area of 1.5e5: 3e-7 each.
        assert!((b[0] + b[1] + b[2] - 1.0).abs() < 1e-6);
        assert!((at(|v| v.screen.x) - 250.5).abs() < 5e-4 && (at(|v| v.screen.y) - 200.5).abs() < 5e-4);
    }

    #[test]
    fn row_27_the_nearest_wins_in_any_order_and_the_first_wins_ties() {
        let t = |z: f32, n: Vec3| {
            let v = |x: f32, y: f32| (Vec3::new(x, y, z), n, [0.0, 0.0]);
            [v(-20.0, -20.0), v(20.0, -20.0), v(0.0, 30.0)]
        };
        let (near, far) = (t(-9.0, Z), t(-11.0, Vec3::new(1.0, 0.0, 0.0)));
        for corrected in [false, true] {
            let options = Options { corrected, ..Options::default() };
            let center = |m: &Mesh| pixel(&render(Shader::Normal, m, None, &options).unwrap(), 350, 350);
            assert_eq!(center(&mesh(&[near, far])), [128, 128, 255]);
            assert_eq!(center(&mesh(&[far, near])), [128, 128, 255]);
            let tie = t(-11.0, Z);
            assert_eq!(center(&mesh(&[far, tie])), [255, 128, 128]);
        }
    }

    #[test]
    fn row_28_attributes_are_affine_and_corrected_ones_are_not() {
        // A plane that recedes: u is 0 at the near and 1 at the far end.
        let v = |x: f32, y: f32, z: f32, u: f32| (Vec3::new(x, y, z), Z, [u, 0.5]);
        let near = [v(-20.0, -2.0, -5.0, 0.0), v(20.0, -2.0, -5.0, 0.0)];
        let far = [v(20.0, 2.0, -20.0, 1.0), v(-20.0, 2.0, -20.0, 1.0)];
        let m = mesh(&[[near[0], near[1], far[0]], [near[0], far[0], far[1]]]);
        let ramp: Vec<u8> = (0..=255).flat_map(|v| [v, 0, 0]).collect();
        let ramp = Image::new(256, 1, 3, Pixels::U8(ramp), Encoding::Srgb).unwrap();
        // The screen's centre sees y = 0, z = -12.5, u = 1/2; red is albedo / 255.
        let red = |corrected| {
            let stage = VertexStage::new(corrected);
            let seen = std::cell::Cell::new(0.0);
            let options = Options { corrected, ..Options::default() };
            for k in 0..2 {
                let t = stage.triangle(&m, k).unwrap();
                rasterize(&t, &options, &mut Target::new(corrected), |p| {
                    let place = (p.view_pos.x.abs() + p.view_pos.y.abs()) as f64;
                    if place < 0.05 {
                        seen.set(Texels(&ramp).color(p.tex_coords.x, p.tex_coords.y).x);
                    }
                    Z
                });
            }
            seen.get()
        };
        // One pixel is 0.015 high at this distance: two steps of the ramp.
        assert!((red(true) - 127.5).abs() < 3.0, "{}", red(true));
        let stage = VertexStage::new(false);
        let t = stage.triangle(&m, 0).unwrap();
        // Row 28, compat: the value in the middle of an edge on the screen is the mean of its ends.
        let p = t.payload([0.5, 0.0, 0.5]);
        assert_eq!(p.tex_coords.x, 0.5);
        // So in the picture: the near edge is seen at -4/10, the far one at 1/10 of the same length, and the middle row
        // lies 4/5 of the way, but half of the way in space.
        for (corrected, want) in [(false, 0.8), (true, 0.5)] {
            let stage = VertexStage::new(corrected);
            let options = Options { corrected, ..Options::default() };
            let mut target = Target::new(corrected);
            for k in 0..2 {
                let t = stage.triangle(&m, k).unwrap();
                rasterize(&t, &options, &mut target, |p| Vec3::splat(p.tex_coords.x));
            }
            let got = target.color[target.index(450, 350).unwrap()][0];
            // Half a pixel is 1/420 of the way.
            assert!((got - want).abs() < 0.003, "{corrected}: {got}");
        }
    }

    #[test]
    fn row_9_and_34_phong_is_the_closed_form() {
        let n = Vec3::new(0.1, 0.4, 0.9).normalize();
        let frame = render(Shader::Phong, &wall(n), None, &Options::default()).unwrap();
        for (x, y) in [(350, 350), (10, 20), (600, 100), (77, 680)] {
            close(pixel(&frame, x, y), closed_form(KD, place(x, y), n.map(f64::from).array()));
        }
    }

    #[test]
    fn row_35_texture_replaces_kd() {
        let frame = render(Shader::Texture, &wall(Z), Some(&solid([200, 40, 7])), &Options::default()).unwrap();
        let kd = [200.0, 40.0, 7.0].map(|v: f64| v / 255.0);
        close(pixel(&frame, 500, 123), closed_form(kd, place(500, 123), [0.0, 0.0, 1.0]));
        let lookup = Image::new(2, 2, 1, Pixels::U8(vec![10, 20, 30, 40]), Encoding::Srgb).unwrap();
        let at = |u, v| Texels(&lookup).color(u, v).x;
        // No half-texel offset, v up, clamped.
        assert_eq!(
            [at(0.49, 0.51), at(0.5, 0.51), at(0.0, 0.5), at(7.0, -7.0), at(-7.0, 7.0)],
            [10., 20., 30., 40., 10.]
        );
    }

    #[test]
    fn row_36_bump_shows_the_normal_without_bias() {
        let n = Vec3::new(-0.6, 0.48, 0.64);
        let frame = render(Shader::Bump, &wall(n), Some(&solid([90, 90, 90])), &Options::default()).unwrap();
        // A constant height changes nothing; negative components become 0.
        close(pixel(&frame, 350, 350), [0.0, 0.48 * 255.0, 0.64 * 255.0]);
    }

    #[test]
    fn row_36_and_65_the_corrected_tangent_is_orthogonal() {
        // h rises by 1 grey level = √3 per texel along u: dU = 0.02 √3, dV = 0.
        let ramp: Vec<u8> = (0..=255).flat_map(|v| [v, v, v]).collect();
        let ramp = Image::new(256, 1, 3, Pixels::U8(ramp), Encoding::Srgb).unwrap();
        let n = Vec3::new(0.48, 0.6, 0.64);
        let payload =
            Payload { view_pos: Z, color: Z, normal: n, tex_coords: Vec2::new(0.5, 0.5), slopes: [Vec3::default(); 2] };
        for corrected in [false, true] {
            let sign = if corrected { -1.0 } else { 1.0 };
            let t = Vec3::new(sign * 0.48 * 0.6 / 0.8, 0.8, sign * 0.64 * 0.6 / 0.8);
            // Corrected: u grows by 0.7 per unit along t, a grey level is KN / 255 high, and a texel 1/256 of u wide.
            let payload = Payload { slopes: [t * 0.7, n.cross(t) * 0.3], ..payload };
            let (got, offset) = bumped(&payload, &Texels(&ramp), corrected);
            let du = if corrected { 0.7 * 256.0 * 0.1 / 255.0 } else { 0.02 * 3f32.sqrt() };
            // Texel 128 of 255.
            let want = if corrected { 0.1 * (128.0 / 255.0 - 0.5) } else { 0.1 * 128.0 * 3f32.sqrt() };
            assert!((offset - want).abs() < 1e-5 * want.abs() + 1e-7, "{offset} {want}");
            let want = (n - t * du).normalize();
            assert!((got - want).length() < 1e-6, "{got:?} {want:?}");
            // Rounding only: t is unit and orthogonal; the hint's t . n is 2 y s.
            let leans = if corrected { 0.0 } else { 2.0 * 0.6 * 0.8 };
            assert!((t.dot(n) - leans).abs() < 1e-6);
        }
        let pole = Payload { normal: Vec3::new(0.0, 1.0, 0.0), ..payload };
        assert!(bumped(&pole, &Texels(&ramp), true).0.is_finite());
    }

    #[test]
    fn row_72_to_75_corrected_bumps_are_slopes_of_the_surface() {
        // A wall of 20 x 20 units whose picture of 256 columns rises from black to white along u, seen from the front:
        // the surface rises by KN on 20 units, whatever the frame.
        let v = |x: f32, y: f32| (Vec3::new(x, y, -10.0), Z, [x / 20.0 + 0.5, y / 20.0 + 0.5]);
        let m = mesh(&[[v(-10.0, -10.0), v(10.0, -10.0), v(0.0, 10.0)]]);
        let stage = VertexStage::new(true);
        let t = stage.triangle(&m, 0).unwrap();
        let [du, dv] = t.slopes();
        // 2.5 x model and a turn in f32.
        assert!((du - Vec3::new(0.05, 0.0, 0.0)).length() < 1e-6 && (dv - Vec3::new(0.0, 0.05, 0.0)).length() < 1e-6);
        for (width, tilt) in [(256u32, 1.0), (64, 1.0)] {
            let ramp: Vec<u8> = (0..width).flat_map(|v| [(v * 255 / (width - 1)) as u8; 3]).collect();
            let ramp = Image::new(width, 1, 3, Pixels::U8(ramp), Encoding::Srgb).unwrap();
            let payload = Payload { slopes: t.slopes(), ..t.payload([0.3, 0.3, 0.4]) };
            let (n, _) = bumped(&payload, &Texels(&ramp), true);
            // Steps of whole grey levels: at 64 columns of 4.05 levels. E13: the printed form depends on the width.
            let want = tilt * 0.1 / 20.0;
            assert!((-n.x / n.z - want).abs() < 0.02 * want && n.y.abs() < 1e-6, "{n:?}");
        }
        // E14 and row 75: black lies below the surface as far as white stands above it, and no farther than KN / 2.
        let offset = |rgb: [u8; 3]| bumped(&t.payload([0.3, 0.3, 0.4]), &Texels(&solid(rgb)), true).1;
        assert!((offset([0; 3]) + 0.05).abs() < 1e-7 && (offset([255; 3]) - 0.05).abs() < 1e-7);
        assert_eq!(offset([255, 0, 0]), offset([0, 0, 255]));
        let printed = bumped(&t.payload([0.3, 0.3, 0.4]), &Texels(&solid([255; 3])), false).1;
        assert!(printed > 44.0, "erratum E14: {printed}");
    }

    #[test]
    fn row_37_and_84_displacement_moves_the_shading_point() {
        let n = Vec3::new(0.1, 0.4, 0.9).normalize();
        let height = (30.0f64 * 30.0 + 20.0 * 20.0 + 10.0 * 10.0).sqrt();
        let frame = render(Shader::Displacement, &wall(n), Some(&solid([30, 20, 10])), &Options::default()).unwrap();
        for (x, y) in [(350, 350), (60, 500)] {
            let n = n.map(f64::from).array();
            let p = place(x, y);
            let moved = core::array::from_fn(|c| p[c] + 0.1 * n[c] * height);
            close(pixel(&frame, x, y), closed_form(KD, moved, n));
        }
    }

    #[test]
    fn a_missing_texture_is_an_error_and_missing_attributes_are_not() {
        let mut m = wall(Z);
        assert_eq!(render(Shader::Bump, &m, None, &Options::default()).unwrap_err().code, "games101.texture");
        m.normals = None;
        m.uv = [None, None];
        render(Shader::Texture, &m, Some(&solid([1, 2, 3])), &Options::default()).unwrap();
    }
}
