//! What a render hands back.

use crate::image::Image;

/// The numbers of an extra plane of a frame, one pixel after the other.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// `channels` floats per pixel.
    F32(Vec<f32>),
    /// One id per pixel; `u32::MAX` where nothing is.
    U32(Vec<u32>),
}

/// An arbitrary output variable (AOV): depth, normal, ids, ...
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// Its name on the command line: `depth`, `normal`, ...
    pub name: &'static str,
    /// One letter or word per channel: `Z`, or `X`, `Y`, `Z`, ...
    pub channels: &'static [&'static str],
    /// The unit of its numbers, written into files: `metres`, `unit vector`, `index`, ...
    pub unit: &'static str,
    /// The space of its numbers, written into files: `world`, `view`, `texture`, ...
    pub space: &'static str,
    /// The numbers, row after row from the top.
    pub values: Values,
}

/// A finished picture. Row 0 is the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// RGBA with straight alpha. 8 and 16 bits: tone mapped and encoded as the scene's output says. F32:
    /// linear light.
    pub color: Image,
    /// The extra planes, in the order they were asked for.
    pub planes: Vec<Plane>,
}
