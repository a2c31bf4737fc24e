//! Row 48: a checkered ground to the horizon, seen through four filters: the far field is moiré without mip levels, grey
//! with them, and neither with an anisotropic filter, which the reference shows. Writes `ground_filters.png`.

use frieze::image::{Encoding, Image, Pixels};
use frieze::map::Filter;
use frieze::render::{RenderOptions, render};
use frieze::{Error, Frame, samples};

/// The four filters, left to right and top to bottom.
pub const FILTERS: [(&str, Filter); 4] = [
    ("nearest", Filter::Nearest),
    ("trilinear", Filter::Trilinear),
    ("anisotropic", Filter::Anisotropic { max: 16 }),
    ("supersampled reference", Filter::Supersample { taps: 256 }),
];

/// Pixels between the pictures of the sheet.
pub const GAP: u32 = 4;

/// The built-in scene `ground` through a filter, one sample per pixel, so that nothing but the filter smooths it.
pub fn picture(filter: Filter, options: &RenderOptions) -> Result<Frame, Error> {
    let mut scene = samples::scene("ground").expect("it is built in");
    for texture in scene.materials.iter_mut().filter_map(|m| m.albedo_map.as_mut()) {
        texture.filter = filter;
    }
    render(&scene, &RenderOptions { samples: 1, ..options.clone() })
}

/// Four pictures of one size as one, white between them.
pub fn sheet(pictures: &[Image; 4]) -> Result<Image, Error> {
    let (w, h) = (pictures[0].width(), pictures[0].height());
    let mut bytes = Vec::new();
    for y in 0..2 * h + GAP {
        for x in 0..2 * w + GAP {
            let (column, row) = (usize::from(x >= w + GAP), usize::from(y >= h + GAP));
            let (x, y) = (x - column as u32 * (w + GAP), y - row as u32 * (h + GAP));
            let color = if x < w && y < h { pictures[2 * row + column].rgba(x, y) } else { [1.0; 4] };
            bytes.extend(color[..3].iter().map(|v| (v * 255.0).round() as u8));
        }
    }
    Image::new(2 * w + GAP, 2 * h + GAP, 3, Pixels::U8(bytes), Encoding::Srgb)
}

#[allow(dead_code, reason = "a test uses the rest of this file")]
fn main() -> Result<(), Error> {
    let options = RenderOptions { size: (400, 220), ..RenderOptions::default() };
    let mut pictures = Vec::new();
    for (_, filter) in FILTERS {
        pictures.push(picture(filter, &options)?.color);
    }
    let pictures = pictures.try_into().expect("there are four filters");
    Frame { color: sheet(&pictures)?, planes: Vec::new() }.save("ground_filters.png")
}
