//! `Prepared -> Frame` on the CPU.

use crate::error::Result;
use crate::frame::Frame;
use crate::job::Job;
use crate::math::lane::Level;
use crate::prepare::Prepared;
use crate::scene::{Camera, Scene};
use std::time::Duration;

/// What the colour of a frame is stored in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Format {
    /// 8 bits, tone mapped and encoded.
    #[default]
    U8,
    /// 16 bits, tone mapped and encoded.
    U16,
    /// Linear light.
    F32,
}

/// An extra plane of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aov {
    /// Distance along the camera's axis, metres; infinite where nothing is.
    Depth,
    /// Shading normal, world space, unit length.
    Normal,
    /// Shading normal, view space, unit length.
    ViewNormal,
    /// Tangent, world space, unit length.
    Tangent,
    /// First UV set.
    Uv,
    /// World position, metres.
    Position,
    /// Index of the object.
    Object,
    /// Index of the material.
    Material,
    /// Index of the source triangle in its mesh.
    Triangle,
    /// Weights of the triangle's corners.
    Barycentric,
    /// Mip level of the albedo map (of a 1x1 texture without one).
    MipLevel,
    /// Texels of the albedo map per pixel, along one axis (square root of the area ratio).
    TexelDensity,
}

impl Aov {
    /// Every plane with its word on the command line.
    pub const ALL: [(&'static str, Aov); 12] = [
        ("depth", Aov::Depth),
        ("normal", Aov::Normal),
        ("view-normal", Aov::ViewNormal),
        ("tangent", Aov::Tangent),
        ("uv", Aov::Uv),
        ("position", Aov::Position),
        ("object", Aov::Object),
        ("material", Aov::Material),
        ("triangle", Aov::Triangle),
        ("barycentric", Aov::Barycentric),
        ("mip-level", Aov::MipLevel),
        ("texel-density", Aov::TexelDensity),
    ];
}

/// How a scene is rendered. Whatever is left at its default comes from the scene.
#[derive(Clone, Debug, Default)]
pub struct RenderOptions {
    /// Threads, memory, progress, cancellation.
    pub job: Job,
    /// The SIMD level; changes the speed, never the picture.
    pub level: Level,
    /// Width and height in pixels; `(0, 0)`: the scene's.
    pub size: (u32, u32),
    /// Coverage samples per pixel: 1, 4, 8 or 16; 0: the scene's.
    pub samples: u32,
    /// The camera; `None`: the scene's.
    pub camera: Option<Camera>,
    /// What the colour is stored in.
    pub format: Format,
    /// Extra planes.
    pub aovs: Vec<Aov>,
}

/// What a frame took; shows that nothing was kept from the frame before.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Wall time per stage, in order: `transform`, `shadow`, `raster`, ...
    pub stages: Vec<(&'static str, Duration)>,
    /// What was counted: `vertices_transformed`, `triangles_binned`, `shadow_samples`, `pixels_shaded`, ...
    pub counters: Vec<(&'static str, u64)>,
}

/// Renders one picture.
///
/// # Errors
/// `render.size`, `render.samples` for what is not possible; those of [`Prepared::new`].
pub fn render(scene: &Scene, options: &RenderOptions) -> Result<Frame> {
    Ok(frame(&Prepared::new(scene, options)?, options)?.0)
}

/// Renders one picture of a prepared scene. Nothing is kept in `prepared`: each frame transforms, culls,
/// draws shadows and shades anew.
///
/// # Errors
/// As [`render`].
pub fn frame(_prepared: &Prepared, _options: &RenderOptions) -> Result<(Frame, Report)> {
    unimplemented!("lands with the renderer")
}
