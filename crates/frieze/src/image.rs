//! Pixels, colour, mip levels, and the comparison of two pictures.

pub mod color;
pub mod diff;
#[allow(clippy::module_inception)]
pub mod image;
pub mod pyramid;

pub use image::{Encoding, Image, Pixels};
