//! Mip levels and ripmaps.

use super::Image;

/// The levels of an image, from the finest to one texel.
#[derive(Clone, Debug)]
pub struct Pyramid {}

impl Pyramid {
    /// Averages in linear light; `srgb` says that the colour channels are sRGB (alpha never is).
    pub fn new(_image: &Image, _srgb: bool) -> Self {
        Pyramid {}
    }
}
