//! OpenEXR: scan lines or tiles, half, float or 32-bit ids; the first layer that names R, G, B, or X, Y, Z,
//! or Y, or else the first channel. Colour is linear; premultiplied alpha is taken out.

use super::{corrupt, reserve, straight, unsupported};
use crate::error::{Finding, Result};
use crate::image::{Encoding, Image, Pixels};
use crate::job::Job;
use ::exr::meta::MetaData;
use ::exr::prelude::{Compression, FlatSamples, ReadChannels, ReadLayers, read};
use half::f16;
use std::io::Cursor;

/// Most channels of a part: names are compared with one another below.
const MOST_CHANNELS: usize = 4096;

/// Which channels of a list of names make a picture: their indices, and whether the last is alpha.
fn choose(names: &[String]) -> Option<(Vec<usize>, bool)> {
    let find = |prefix: &str, name: &str| {
        names.iter().position(|n| {
            n.len() == prefix.len() + name.len()
                && n.starts_with(prefix)
                && n[prefix.len()..].eq_ignore_ascii_case(name)
        })
    };
    // The unnamed layer first, then the named ones in the file's (alphabetical) order.
    let prefixes = std::iter::once("").chain(names.iter().filter_map(|n| n.rfind('.').map(|k| &n[..=k])));
    let mut grey = None;
    for p in prefixes {
        let all = |set: [&str; 3]| set.iter().map(|n| find(p, n)).collect::<Option<Vec<_>>>();
        let alpha = find(p, "A");
        if let Some(mut rgb) = all(["R", "G", "B"]) {
            rgb.extend(alpha);
            return Some((rgb, alpha.is_some()));
        }
        if let Some(xyz) = all(["X", "Y", "Z"]) {
            return Some((xyz, false));
        }
        if let (None, Some(y)) = (&grey, find(p, "Y")) {
            grey = Some((std::iter::once(y).chain(alpha).collect(), alpha.is_some()));
        }
    }
    grey.or_else(|| (!names.is_empty()).then(|| (vec![0], false)))
}

pub(super) fn decode(bytes: &[u8], job: &Job, findings: &mut Vec<Finding>) -> Result<Image> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(corrupt)?;
    let mut held = Vec::new();
    for header in &meta.headers {
        if header.deep {
            return Err(unsupported("deep data"));
        }
        if matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
            // It needs cosines and powers of the platform: other bits on other machines.
            return Err(unsupported("EXR with DWAA or DWAB compression").remedy("save it with ZIP or PIZ compression"));
        }
        if matches!(header.compression, Compression::HTJ2K32 | Compression::HTJ2K256) {
            return Err(unsupported("EXR with HTJ2K compression").remedy("save it with ZIP or PIZ compression"));
        }
        if header.channels.list.len() > MOST_CHANNELS {
            return Err(unsupported(format_args!("EXR with more than {MOST_CHANNELS} channels")));
        }
        let each: usize = header.channels.list.iter().map(|c| c.sample_type.bytes_per_sample()).sum();
        let size = header.layer_size;
        held.push(reserve(job, size.x() as u64, size.y() as u64, each as u64 * 2)?);
    }
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(corrupt)?;
    // In files of several parts the name of the part is the layer's.
    let mut best: Option<(usize, Vec<usize>, bool)> = None;
    for (k, layer) in image.layer_data.iter().enumerate() {
        let names: Vec<String> = layer.channel_data.list.iter().map(|c| c.name.to_string()).collect();
        if let Some((channels, alpha)) = choose(&names)
            && best.as_ref().is_none_or(|b| b.1.len() < 3 && channels.len() >= 3)
        {
            best = Some((k, channels, alpha));
        }
    }
    let (layer, channels, alpha) = best.ok_or_else(|| corrupt("it has no channel"))?;
    let layer = &image.layer_data[layer];
    let all: usize = image.layer_data.iter().map(|l| l.channel_data.list.len()).sum();
    if all > channels.len() {
        let used: Vec<_> = channels.iter().map(|&c| layer.channel_data.list[c].name.to_string()).collect();
        findings.push(Finding::note(
            "image.exr-layers",
            format!("the file has {all} channels"),
            format!("{} are used", used.join(", ")),
        ));
    }
    let (width, height) = (layer.size.x(), layer.size.y());
    let window = image.attributes.display_window;
    if (window.size.x(), window.size.y()) != (width, height) {
        findings.push(Finding::note(
            "image.exr-window",
            "data window and display window differ",
            format!("the data window ({width}x{height}) is used"),
        ));
    }
    let chosen: Vec<_> = channels.iter().map(|&c| &layer.channel_data.list[c]).collect();
    if chosen.iter().any(|c| c.sampling.x() != 1 || c.sampling.y() != 1) {
        return Err(unsupported("EXR with subsampled channels"));
    }
    let n = chosen.len();
    let half = chosen.iter().all(|c| matches!(c.sample_data, FlatSamples::F16(_)));
    let pixels = if half {
        let mut out = vec![f16::ZERO; width * height * n];
        for (c, channel) in chosen.iter().enumerate() {
            if let FlatSamples::F16(v) = &channel.sample_data {
                out.iter_mut().skip(c).step_by(n).zip(v).for_each(|(o, v)| *o = *v);
            }
        }
        Pixels::F16(out)
    } else {
        let mut out = vec![0.0; width * height * n];
        for (c, channel) in chosen.iter().enumerate() {
            let o = out.iter_mut().skip(c).step_by(n);
            match &channel.sample_data {
                FlatSamples::F16(v) => o.zip(v).for_each(|(o, v)| *o = v.to_f32()),
                FlatSamples::F32(v) => o.zip(v).for_each(|(o, v)| *o = *v),
                FlatSamples::U32(v) => o.zip(v).for_each(|(o, v)| *o = *v as f32),
            }
        }
        Pixels::F32(out)
    };
    let image = Image::new(width as u32, height as u32, n as u8, pixels, Encoding::Linear)?;
    Ok(if alpha { straight(image) } else { image })
}
