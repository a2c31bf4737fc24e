//! OpenEXR, by hand: one part, scan lines in ZIP blocks of 16, channels named `R`, `G`, `B`, `A` for the colour
//! (linear light, premultiplied, as the format wants it) and `layer.X` for every plane. Blocks compress side
//! by side; attributes have a fixed order, so the same picture gives the same bytes.
//!
//! Layout: "OpenEXR File Layout" (openexr.com), version 2.

use super::{deflate, failed, plain};
use crate::error::{Error, Result};
use crate::frame::{Plane, Values};
use crate::image::{Image, Pixels};
use crate::job::Job;
use half::f16;
use rayon::prelude::*;
use std::io::Write;

/// Lines per ZIP block; the format's number.
const LINES: usize = 16;

/// Where a channel's numbers come from.
enum Source<'a> {
    /// Channel of the colour.
    Color(&'a Image, usize),
    /// Every `stride`th float from the `offset`th on.
    Floats { values: &'a [f32], stride: usize, offset: usize },
    /// Ids.
    Ids(&'a [u32]),
}

struct Channel<'a> {
    name: String,
    source: Source<'a>,
}

impl Channel<'_> {
    /// The format's number of the pixel type.
    fn kind(&self) -> i32 {
        match &self.source {
            Source::Ids(_) => 0,
            Source::Color(image, _) if matches!(image.pixels(), Pixels::F16(_)) => 1,
            _ => 2,
        }
    }
    /// Appends line `y` in little endian.
    fn line(&self, y: usize, width: usize, out: &mut Vec<u8>) {
        match self.source {
            Source::Ids(ids) => ids[y * width..(y + 1) * width].iter().for_each(|v| out.extend(v.to_le_bytes())),
            Source::Floats { values, stride, offset } => values[y * width * stride..(y + 1) * width * stride]
                .iter()
                .skip(offset)
                .step_by(stride)
                .for_each(|&v| out.extend(plain(v).to_le_bytes())),
            Source::Color(image, c) => {
                let alpha = image.channels() % 2 == 0 && c + 1 < image.channels();
                for x in 0..width as u32 {
                    let mut v = image.value(x, y as u32, c);
                    if alpha {
                        v *= image.value(x, y as u32, image.channels() - 1);
                    }
                    match image.pixels() {
                        Pixels::F16(_) => out.extend(f16::from_f32(plain(v)).to_le_bytes()),
                        _ => out.extend(plain(v).to_le_bytes()),
                    }
                }
            }
        }
    }
}

pub(super) fn write(
    out: &mut dyn Write,
    color: Option<&Image>,
    planes: &[Plane],
    (width, height): (u32, u32),
    job: &Job,
) -> Result<()> {
    let (width, height) = (width as usize, height as usize);
    let mut channels = Vec::new();
    let mut notes = vec![("software".to_owned(), concat!("frieze ", env!("CARGO_PKG_VERSION")).to_owned())];
    if let Some(image) = color {
        if matches!(image.pixels(), Pixels::U8(_) | Pixels::U16(_)) && image.encoding == crate::image::Encoding::Srgb {
            return Err(Error::arguments("write.bits", "EXR holds linear light, and the picture is encoded")
                .remedy("render with floats, or write .png"));
        }
        let names: &[&str] = [&["Y"][..], &["Y", "A"], &["R", "G", "B"], &["R", "G", "B", "A"]][image.channels() - 1];
        channels.extend(
            names.iter().enumerate().map(|(c, n)| Channel { name: (*n).to_owned(), source: Source::Color(image, c) }),
        );
    }
    for plane in planes {
        notes.push((format!("{}.space", plane.name), plane.space.to_owned()));
        notes.push((format!("{}.unit", plane.name), plane.unit.to_owned()));
        for (offset, name) in plane.channels.iter().enumerate() {
            let source = match &plane.values {
                Values::F32(values) => Source::Floats { values, stride: plane.channels.len(), offset },
                Values::U32(ids) => Source::Ids(ids),
            };
            channels.push(Channel { name: format!("{}.{name}", plane.name), source });
        }
    }
    for plane in planes {
        let values = match &plane.values {
            Values::F32(v) => v.len() / plane.channels.len().max(1),
            Values::U32(v) => v.len(),
        };
        if values != width * height {
            return Err(Error::arguments(
                "write.plane",
                format!("plane {} has {values} pixels, the frame {}", plane.name, width * height),
            ));
        }
    }
    channels.sort_by(|a, b| a.name.cmp(&b.name));
    let mut head = header(&channels, width, height, &notes);

    let blocks = height.div_ceil(LINES);
    let coded: Vec<Vec<u8>> = job.run(|| {
        (0..blocks)
            .into_par_iter()
            .map(|b| {
                job.check()?;
                let mut raw = Vec::new();
                for y in b * LINES..((b + 1) * LINES).min(height) {
                    channels.iter().for_each(|c| c.line(y, width, &mut raw));
                }
                let packed = zip(&raw);
                Ok(if packed.len() < raw.len() { packed } else { raw })
            })
            .collect::<Result<_>>()
    })?;
    let mut offset = (head.len() + 8 * blocks) as u64;
    for block in &coded {
        head.extend(offset.to_le_bytes());
        offset += 8 + block.len() as u64;
    }
    out.write_all(&head).map_err(failed)?;
    for (b, block) in coded.iter().enumerate() {
        out.write_all(&((b * LINES) as i32).to_le_bytes()).map_err(failed)?;
        out.write_all(&(block.len() as i32).to_le_bytes()).map_err(failed)?;
        out.write_all(block).map_err(failed)?;
    }
    Ok(())
}

fn header(channels: &[Channel], width: usize, height: usize, notes: &[(String, String)]) -> Vec<u8> {
    let mut list = Vec::new();
    for c in channels {
        list.extend(c.name.as_bytes());
        list.push(0);
        list.extend(c.kind().to_le_bytes());
        list.extend([0; 4]);
        list.extend(1i32.to_le_bytes());
        list.extend(1i32.to_le_bytes());
    }
    list.push(0);
    let window: Vec<u8> = [0, 0, width as i32 - 1, height as i32 - 1].iter().flat_map(|v| v.to_le_bytes()).collect();
    let mut out = vec![0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0];
    let mut attribute = |name: &str, kind: &str, value: &[u8]| {
        out.extend(name.as_bytes());
        out.push(0);
        out.extend(kind.as_bytes());
        out.push(0);
        out.extend((value.len() as i32).to_le_bytes());
        out.extend(value);
    };
    attribute("channels", "chlist", &list);
    attribute("compression", "compression", &[3]); // ZIP, 16 lines
    attribute("dataWindow", "box2i", &window);
    attribute("displayWindow", "box2i", &window);
    attribute("lineOrder", "lineOrder", &[0]);
    attribute("pixelAspectRatio", "float", &1f32.to_le_bytes());
    attribute("screenWindowCenter", "v2f", &[0; 8]);
    attribute("screenWindowWidth", "float", &1f32.to_le_bytes());
    for (name, value) in notes {
        attribute(name, "string", value.as_bytes());
    }
    out.push(0);
    out
}

/// EXR's ZIP: even bytes, then odd bytes, each as the difference from the one before, in a zlib stream.
fn zip(raw: &[u8]) -> Vec<u8> {
    let split: Vec<u8> = raw.iter().step_by(2).chain(raw.iter().skip(1).step_by(2)).copied().collect();
    let mut delta = split.clone();
    for k in 1..split.len() {
        delta[k] = split[k].wrapping_sub(split[k - 1]).wrapping_add(128);
    }
    let mut out = vec![0x78, 0x01];
    out.extend(deflate::blocks(&delta));
    out.extend([0x03, 0x00]);
    out.extend(simd_adler32::adler32(&&delta[..]).to_be_bytes());
    out
}
