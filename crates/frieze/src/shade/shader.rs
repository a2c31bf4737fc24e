//! The public shader hook: a vertex and a fragment function with typed uniforms, run scalar through the same
//! coverage and depth rules as the renderer (rows 29, 32, 113).
//!
//! ```
//! use frieze::math::vec::{Mat4, Vec3, Vec4};
//! use frieze::mesh::Mesh;
//! use frieze::shade::shader::{Canvas, Fragment, Shader, Vertex, draw};
//!
//! struct Flat;
//! struct Uniforms {
//!     mvp: Mat4,
//!     color: Vec3,
//! }
//! impl Shader for Flat {
//!     type Uniforms = Uniforms;
//!     type Varying = ();
//!     fn vertex(&self, u: &Uniforms, v: &Vertex) -> (Vec4, ()) {
//!         (u.mvp.project(v.position), ())
//!     }
//!     fn fragment(&self, u: &Uniforms, _: &Fragment<()>) -> Option<[f32; 4]> {
//!         Some(u.color.extend(1.0).array())
//!     }
//! }
//! let mesh = Mesh {
//!     positions: vec![[-1.0, -1.0, 0.5], [3.0, -1.0, 0.5], [-1.0, 3.0, 0.5]],
//!     corners: vec![0, 1, 2],
//!     ..Mesh::default()
//! };
//! let mut canvas = Canvas::new(4, 4, 1, [0.0; 4])?;
//! draw(&Flat, &Uniforms { mvp: Mat4::IDENTITY, color: Vec3::new(1.0, 0.5, 0.0) }, &mesh, &mut canvas);
//! assert_eq!(canvas.color(2, 2), [1.0, 0.5, 0.0, 1.0]);
//! # Ok::<(), frieze::Error>(())
//! ```

use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::image::{Encoding, Image, Pixels};
use crate::map::{Footprint, Map};
use crate::math::exact;
use crate::math::lane::One;
use crate::math::vec::{Mat4, Vec2, Vec3, Vec4};
use crate::mesh::Mesh;
use crate::raster::fragments::{self, CENTER, DepthBuffer, GRID4};

/// A program in two functions. Uniforms are any type: what a vertex or a fragment reads besides its own.
pub trait Shader {
    /// What all vertices and fragments share: matrices, lights, textures ([`Map`]), shadow maps ([`Canvas`]).
    type Uniforms;
    /// What is interpolated from the vertices to the fragments.
    type Varying: Varying;
    /// Clip coordinates (x right and y up in -w ..= w, z from 0 at the far to w at the near plane) and what is
    /// to be interpolated.
    fn vertex(&self, uniforms: &Self::Uniforms, vertex: &Vertex) -> (Vec4, Self::Varying);
    /// The colour of a fragment, or `None` to discard it.
    fn fragment(&self, uniforms: &Self::Uniforms, fragment: &Fragment<Self::Varying>) -> Option<[f32; 4]>;
    /// Whether triangles that run clockwise on the screen are drawn.
    fn back_faces(&self) -> bool {
        true
    }
}

/// A corner of a mesh, object space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// Position.
    pub position: Vec3,
    /// The mesh's normal; the triangle's if it has none.
    pub normal: Vec3,
    /// The mesh's tangent with the bitangent's sign, or (1, 0, 0, 1).
    pub tangent: Vec4,
    /// First texture coordinates, v down, or (0, 0).
    pub uv: Vec2,
    /// Vertex colour, or white.
    pub color: Vec4,
}

/// Something that can be interpolated: sums and multiples of it make sense. [`varying!`](crate::varying)
/// implements it for a struct.
pub trait Varying: Copy {
    /// `a w[0] + b w[1] + c w[2]`
    fn weigh(corners: [&Self; 3], w: [f32; 3]) -> Self;
}

impl Varying for () {
    fn weigh(_: [&(); 3], _: [f32; 3]) {}
}
impl Varying for f32 {
    fn weigh([a, b, c]: [&f32; 3], w: [f32; 3]) -> f32 {
        a * w[0] + b * w[1] + c * w[2]
    }
}
macro_rules! vectors {
    ($($V:ty),*) => {$(
        impl Varying for $V {
            fn weigh([a, b, c]: [&Self; 3], w: [f32; 3]) -> Self {
                *a * w[0] + *b * w[1] + *c * w[2]
            }
        }
    )*};
}
vectors!(Vec2, Vec3, Vec4);
impl<V: Varying, const N: usize> Varying for [V; N] {
    fn weigh([a, b, c]: [&Self; 3], w: [f32; 3]) -> Self {
        core::array::from_fn(|k| V::weigh([&a[k], &b[k], &c[k]], w))
    }
}

/// Declares a struct whose fields are all interpolated.
///
/// ```
/// use frieze::math::vec::{Vec2, Vec3};
/// frieze::varying! {
///     /// What the fragment shader of document 001 is given.
///     pub struct FragShader { pub frag_pos: Vec3, pub tex_coords: Vec2 }
/// }
/// ```
#[macro_export]
macro_rules! varying {
    ($(#[$doc:meta])* $vis:vis struct $Name:ident { $($(#[$fdoc:meta])* $fvis:vis $field:ident : $Type:ty),* $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        $vis struct $Name { $($(#[$fdoc])* $fvis $field: $Type),* }
        impl $crate::shade::shader::Varying for $Name {
            fn weigh(v: [&Self; 3], w: [f32; 3]) -> Self {
                $Name {
                    $($field: <$Type as $crate::shade::shader::Varying>::weigh(v.map(|v| &v.$field), w)),*
                }
            }
        }
    };
}

varying! {
    /// The fields of the course's `fragment_shader_payload` (row 29), with the tangent beside them; textures are
    /// uniforms.
    pub struct Payload {
        /// Position in view space.
        pub view_pos: Vec3,
        /// Normal, not normalised after interpolation.
        pub normal: Vec3,
        /// Tangent and the bitangent's sign.
        pub tangent: Vec4,
        /// Texture coordinates, v down.
        pub uv: Vec2,
        /// Colour.
        pub color: Vec4,
    }
}

impl Payload {
    /// What most vertex functions pass on: positions by `view_model`, normals by its normal matrix.
    pub fn new(v: &Vertex, view_model: &Mat4) -> Self {
        Payload {
            view_pos: view_model.point(v.position),
            normal: view_model.normal_matrix().direction(v.normal).normalize(),
            tangent: view_model.direction(v.tangent.xyz()).normalize().extend(v.tangent.w),
            uv: v.uv,
            color: v.color,
        }
    }
}

/// A covered pixel.
#[derive(Clone, Copy, Debug)]
pub struct Fragment<V> {
    /// Column.
    pub x: u32,
    /// Row from the top.
    pub y: u32,
    /// Reversed depth at the pixel's centre: 1 near, 0 far.
    pub depth: f32,
    /// Whether the triangle runs counter-clockwise on the screen.
    pub front: bool,
    /// What the vertices passed on, with correct perspective.
    pub varying: V,
    /// Its change from one pixel to the next along x.
    pub dx: V,
    /// The same along y (down).
    pub dy: V,
}

/// View -> clip coordinates of a pinhole that looks along -Z: `fov_y` in degrees, reversed depth `near / distance`,
/// no far plane.
pub fn perspective(fov_y: f32, aspect: f32, near: f32) -> Mat4 {
    let tan = exact::tan_f64(f64::from(fov_y).to_radians() / 2.0) as f32;
    Mat4([
        [1.0 / (tan * aspect), 0.0, 0.0, 0.0],
        [0.0, 1.0 / tan, 0.0, 0.0],
        [0.0, 0.0, 0.0, -1.0],
        [0.0, 0.0, near, 0.0],
    ])
}

/// View -> clip coordinates of parallel rays along -Z: half width and height of the box, reversed depth 1 at `near`
/// and 0 at `far`.
pub fn orthographic(half_width: f32, half_height: f32, near: f32, far: f32) -> Mat4 {
    let depth = far - near;
    Mat4([
        [1.0 / half_width, 0.0, 0.0, 0.0],
        [0.0, 1.0 / half_height, 0.0, 0.0],
        [0.0, 0.0, 1.0 / depth, 0.0],
        [0.0, 0.0, far / depth, 1.0],
    ])
}

/// Asks a map at `uv` over the footprint that its derivatives span: what `texture()` does in other shading
/// languages.
pub fn texture(map: &Map, uv: Vec2, dx: Vec2, dy: Vec2) -> Vec4 {
    map.at(One, uv, Footprint { dudx: dx.x, dvdx: dx.y, dudy: dy.x, dvdy: dy.y }, true)
}

/// Colour and depth that shaders draw into. As a uniform of the next pass its depth is a shadow map; the two
/// have sizes of their own (row 115).
#[derive(Clone, Debug)]
pub struct Canvas {
    width: u32,
    height: u32,
    samples: &'static [[u8; 2]],
    color: Vec<[f32; 4]>,
    depth: DepthBuffer,
    drawn: u32,
}

impl Canvas {
    /// A picture of one colour with 1 or 4 `samples` per pixel.
    ///
    /// # Errors
    /// `shader.canvas` for a side of 0 or above 16384, or other numbers of samples.
    pub fn new(width: u32, height: u32, samples: u32, background: [f32; 4]) -> Result<Self> {
        let wrong = |what: String| Err(Error::arguments("shader.canvas", what));
        if !(1..=16384).contains(&width) || !(1..=16384).contains(&height) {
            return wrong(format!("a canvas of {width}x{height}; sides of 1 to 16384 pixels are possible"));
        }
        let samples: &'static [[u8; 2]] = match samples {
            1 => &CENTER,
            4 => &GRID4,
            n => return wrong(format!("{n} samples; 1 and 4 are possible")),
        };
        let len = width as usize * height as usize * samples.len();
        let depth = DepthBuffer::new(width, height, samples);
        Ok(Canvas { width, height, samples, color: vec![background; len], depth, drawn: 0 })
    }
    /// Pixels per row.
    pub fn width(&self) -> u32 {
        self.width
    }
    /// Rows.
    pub fn height(&self) -> u32 {
        self.height
    }
    /// The mean of a pixel's samples.
    pub fn color(&self, x: u32, y: u32) -> [f32; 4] {
        let k = self.depth.index(x, y);
        let n = self.samples.len();
        core::array::from_fn(|c| self.color[k..k + n].iter().map(|p| p[c]).sum::<f32>() / n as f32)
    }
    /// Reversed depth of a pixel's first sample: 1 near, 0 far or nothing.
    pub fn depth(&self, x: u32, y: u32) -> f32 {
        self.depth.depth(x, y, 0)
    }
    /// The picture in 8 bits as it is: 0 ..= 1 becomes 0 ..= 255, rounded half to even, no curve.
    ///
    /// # Errors
    /// None that can happen: a canvas is never empty.
    pub fn frame(&self) -> Result<Frame> {
        let mut pixels = Vec::with_capacity(self.width as usize * self.height as usize * 4);
        for y in 0..self.height {
            for x in 0..self.width {
                pixels.extend(self.color(x, y).map(|v| (v * 255.0).round_ties_even() as u8));
            }
        }
        let color = Image::new(self.width, self.height, 4, Pixels::U8(pixels), Encoding::Srgb)?;
        Ok(Frame { color, planes: Vec::new() })
    }
}

/// Draws every triangle of a mesh. Later calls draw into the same depth; of equal depths the first drawn stays.
/// The fragment function runs once per covered pixel in which a sample passes the depth test (MSAA).
pub fn draw<S: Shader>(shader: &S, uniforms: &S::Uniforms, mesh: &Mesh, canvas: &mut Canvas) {
    for k in 0..mesh.triangle_count() {
        let vertices = vertices(mesh, k);
        let shaded = vertices.map(|v| shader.vertex(uniforms, &v));
        let v = [&shaded[0].1, &shaded[1].1, &shaded[2].1];
        let id = canvas.drawn;
        canvas.drawn = canvas.drawn.saturating_add(1);
        fragments::triangle(shaded.map(|s| s.0), canvas.width, canvas.height, canvas.samples, |f| {
            let mask = canvas.depth.test(f, id);
            if mask == 0 || !(f.front || shader.back_faces()) {
                return;
            }
            let fragment = Fragment {
                x: f.x,
                y: f.y,
                depth: f.depth_at(CENTER[0]),
                front: f.front,
                varying: S::Varying::weigh(v, f.weights),
                dx: S::Varying::weigh(v, f.weights_dx),
                dy: S::Varying::weigh(v, f.weights_dy),
            };
            let Some(color) = shader.fragment(uniforms, &fragment) else { return };
            canvas.depth.write(f, mask, id);
            let base = canvas.depth.index(f.x, f.y);
            for k in (0..canvas.samples.len()).filter(|k| mask >> k & 1 == 1) {
                canvas.color[base + k] = color;
            }
        });
    }
}

fn vertices(mesh: &Mesh, triangle: usize) -> [Vertex; 3] {
    let corners = mesh.triangle(triangle);
    let p = corners.map(|c| Vec3::from(mesh.position(c)));
    let flat = (p[1] - p[0]).cross(p[2] - p[0]).normalize();
    core::array::from_fn(|k| {
        let c = corners[k];
        Vertex {
            position: p[k],
            normal: mesh.normals.as_ref().map_or(flat, |a| a.at(mesh, c).into()),
            tangent: mesh.tangents.as_ref().map_or(Vec4::new(1.0, 0.0, 0.0, 1.0), |a| a.at(mesh, c).into()),
            uv: mesh.uv[0].as_ref().map_or(Vec2::default(), |a| a.at(mesh, c).into()),
            color: mesh.colors.as_ref().map_or(Vec4::splat(1.0), |a| a.at(mesh, c).into()),
        }
    })
}
