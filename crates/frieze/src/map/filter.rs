//! Nearest ... EWA: which filters there are, and what each computes.

/// How texels are combined.
///
/// Texel `i` of `n` has its centre at `(i + 1/2) / n`; the nearest texel of `u` is `floor(u n)`, not "the
/// rounded coordinate" (row 38, erratum E15). Levels are those of [`Pyramid`](crate::image::pyramid::Pyramid).
/// Multisampling is no cure for texture minification: it shades once per pixel (erratum E11); these are.
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
        /// Radius of the ellipse in units of a pixel; the default, [`Filter::EWA_RADIUS`], has a box pixel's
        /// second moment.
        radius: f32,
    },
    /// Averages points over the footprint in the finest level: the reference.
    Supersample {
        /// How many points.
        taps: u32,
    },
}

impl Filter {
    /// The radius in pixels of the disk that has the second moment of a box pixel: r^2/4 = 1/12.
    pub const EWA_RADIUS: f32 = 0.577_350_26;
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
