//! Nearest ... EWA.

/// How texels are combined.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Filter {
    /// The nearest texel of the finest level.
    Nearest,
    /// Four texels of the finest level.
    Bilinear,
    /// Sixteen texels of the finest level, Catmull-Rom.
    Bicubic,
    /// Bilinear in the nearest mip level.
    MipNearest,
    /// Bilinear in two mip levels.
    #[default]
    Trilinear,
    /// Levels scaled apart along u and v.
    Ripmap,
    /// Trilinear probes along the footprint's longer axis.
    Anisotropic {
        /// Most probes, 2 to 16.
        max: u32,
    },
    /// Elliptical weighted average.
    Ewa {
        /// Radius of the ellipse in units of a pixel; the default has a box pixel's second moment.
        radius: f32,
    },
    /// Averages points over the footprint in the finest level: the reference.
    Supersample {
        /// How many points.
        taps: u32,
    },
}

/// What a lookup outside of `0 ..= 1` answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Wrap {
    /// The map repeats.
    #[default]
    Repeat,
    /// The map repeats, every second time mirrored.
    Mirror,
    /// The edge texel goes on.
    Clamp,
    /// The border colour (transparent black).
    Border,
}
