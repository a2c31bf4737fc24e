//! Triangles -> samples. Knows nothing of shading.
//!
//! The fast path: [`geometry`] culls clusters, transforms their vertices and bins their triangles; [`tile`]
//! turns the bins of one 64x64 tile into depth and id per sample. The picture's x runs right, y down, a
//! pixel's centre is at +0.5. Positions are snapped to 1/256 pixel; integer edge functions and the top-left
//! rule make shared edges watertight. Depth is reversed: 1 at the near plane, 0 at the far plane.

pub mod bin;
pub mod clip;
pub mod fragments;
pub mod geometry;
pub mod tile;

pub use bin::Bins;
pub use geometry::{Draw, Geometry, Record};

use crate::math::vec::Mat4;

/// Pixels along each side of a tile.
pub const TILE: u32 = 64;
/// Largest picture side: guard band and fixed point leave no room for more.
pub const MAX_SIZE: u32 = 16384;
/// The guard band: triangles that reach farther than this many pixels are clipped.
pub const GUARD: f32 = 16384.0;

/// Sub-pixel positions of samples in 1/256 pixel from the pixel's upper left corner: the standard patterns of
/// Direct3D and Vulkan (row 52). 1, 4, 8 or 16 samples.
pub const fn sample_positions(samples: u32) -> &'static [[i32; 2]] {
    match samples {
        4 => &[[96, 32], [224, 96], [32, 160], [160, 224]],
        8 => &[[144, 80], [112, 176], [208, 144], [80, 48], [48, 208], [16, 112], [176, 240], [240, 16]],
        16 => &[
            [144, 144],
            [112, 80],
            [80, 160],
            [192, 112],
            [48, 96],
            [160, 208],
            [208, 176],
            [176, 48],
            [96, 224],
            [128, 16],
            [64, 32],
            [32, 192],
            [0, 128],
            [240, 64],
            [224, 240],
            [16, 0],
        ],
        _ => &[[128, 128]],
    }
}

/// A view as the rasteriser needs it.
#[derive(Clone, Debug)]
pub struct Target {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Samples per pixel: 1, 4, 8 or 16.
    pub samples: u32,
    /// World to homogeneous picture coordinates: x and y in pixels times w, z / w is the reversed depth.
    pub matrix: Mat4,
}

impl Target {
    /// Tiles across and down.
    pub fn tiles(&self) -> (u32, u32) {
        (self.width.div_ceil(TILE), self.height.div_ceil(TILE))
    }
}
