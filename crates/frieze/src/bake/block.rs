//! Normal maps in blocks of 4x4 texels, as graphics hardware reads them: BC5 (two channels, z rebuilt by the shader) and BC7
//! (mode 6 only: one line of colours with 16 steps through each block). Khronos Data Format specification 1.3, chapters 19
//! and 20.

use crate::error::{Error, Result};
use crate::image::Image;
use crate::job::Job;
use crate::map::normal::decode;
use crate::math::exact::atan2_f64;
use crate::math::vec::{Vec3, Vec4};
use rayon::prelude::*;

/// A block format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// x and y, 8 steps of 8 bits each.
    Bc5,
    /// x, y and z together, 16 steps.
    Bc7,
}

/// A compressed map and what compression cost.
#[derive(Clone, Debug)]
pub struct Blocks {
    /// 16 bytes per block, row after row from the top. Blocks beyond the edge repeat its texels.
    pub bytes: Vec<u8>,
    /// Mean angle between the normals before and after, degrees.
    pub mean: f64,
    /// Largest angle, degrees.
    pub max: f64,
}

type Texels = [[f32; 3]; 16];

/// Compresses a normal map of three channels.
///
/// # Errors
/// `convert.normal-channels`, `job.memory`, `job.interrupted`.
pub fn compress(image: &Image, format: Format, job: &Job) -> Result<Blocks> {
    if image.channels() < 3 {
        return Err(Error::input("convert.normal-channels", "a normal map of three channels is needed"));
    }
    let (w, h) = (image.width(), image.height());
    let (across, down) = (w.div_ceil(4) as usize, h.div_ceil(4) as usize);
    let _held = job.reserve((across * down * 16) as u64, "the blocks")?;
    let mut bytes = vec![0u8; across * down * 16];
    let rows: Vec<(f64, f64)> = job.run(|| {
        bytes
            .par_chunks_mut(across * 16)
            .enumerate()
            .map(|(by, row)| {
                let (mut sum, mut max) = (0.0, 0.0f64);
                if job.is_cancelled() {
                    return (sum, max);
                }
                for (bx, out) in row.chunks_exact_mut(16).enumerate() {
                    let at = |k: usize| ((4 * bx + k % 4) as u32, (4 * by + k / 4) as u32);
                    let texels: Texels = std::array::from_fn(|k| {
                        let (x, y) = at(k);
                        let c = image.rgba(x.min(w - 1), y.min(h - 1));
                        [c[0], c[1], c[2]].map(|v| if v.is_nan() { 0.0 } else { v.clamp(0.0, 1.0) })
                    });
                    let block = match format {
                        Format::Bc5 => bc5(&texels),
                        Format::Bc7 => bc7(&texels),
                    };
                    out.copy_from_slice(&block);
                    let back = unpack(format, &block);
                    for k in (0..16).filter(|&k| at(k).0 < w && at(k).1 < h) {
                        let n = |c: [f32; 3], channels| decode(Vec3::from(c).extend(1.0), 1.0, false, channels);
                        let angle = angle(n(texels[k], 3), n(back[k], if format == Format::Bc5 { 2 } else { 3 }));
                        sum += angle;
                        max = max.max(angle);
                    }
                }
                (sum, max)
            })
            .collect()
    });
    job.check()?;
    let sum: f64 = rows.iter().map(|r| r.0).sum();
    let max = rows.iter().map(|r| r.1).fold(0.0, f64::max);
    Ok(Blocks { bytes, mean: sum / (f64::from(w) * f64::from(h)), max })
}

/// Degrees between unit vectors.
fn angle(a: Vec3, b: Vec3) -> f64 {
    atan2_f64(f64::from(a.cross(b).length()), f64::from(a.dot(b))).to_degrees()
}

/// The texels of a block, 0 ..= 1; BC5 has no third channel.
pub fn unpack(format: Format, block: &[u8; 16]) -> Texels {
    let bits = u128::from_le_bytes(*block);
    let mut out = [[0.0; 3]; 16];
    match format {
        Format::Bc5 => {
            for c in 0..2 {
                let half = (bits >> (64 * c)) as u64;
                let palette = steps([half as u8, (half >> 8) as u8]);
                for (k, out) in out.iter_mut().enumerate() {
                    out[c] = palette[(half >> (16 + 3 * k) & 7) as usize];
                }
            }
        }
        Format::Bc7 => {
            let field = |at: u32, n: u32| (bits >> at) as u32 & ((1 << n) - 1);
            let end = |c: u32, e: u32| field(7 + 14 * c + 7 * e, 7) << 1 | field(63 + e, 1);
            for (k, out) in out.iter_mut().enumerate() {
                // The first index has three bits: its highest is 0.
                let index = if k == 0 { field(65, 3) } else { field(64 + 4 * k as u32, 4) };
                for (c, out) in out.iter_mut().enumerate() {
                    *out = between(end(c as u32, 0), end(c as u32, 1), index as usize) as f32 / 255.0;
                }
            }
        }
    }
    out
}

/// The eight values between two ends of BC4, the first the larger; 0 ..= 1. Index 1 is the second end.
fn steps(ends: [u8; 2]) -> [f32; 8] {
    let [a, b] = ends.map(f32::from);
    std::array::from_fn(|k| match k {
        0 => a / 255.0,
        1 => b / 255.0,
        // (Six values, 0 and 1 when the first is not the larger.)
        _ if ends[0] > ends[1] => (a * (8 - k) as f32 + b * (k - 1) as f32) / (7.0 * 255.0),
        6 => 0.0,
        7 => 1.0,
        _ => (a * (6 - k) as f32 + b * (k - 1) as f32) / (5.0 * 255.0),
    })
}

fn bc5(texels: &Texels) -> [u8; 16] {
    let mut out = [0; 16];
    for c in 0..2 {
        let values = texels.map(|t| t[c]);
        out[8 * c..8 * c + 8].copy_from_slice(&bc4(&values).to_le_bytes());
    }
    out
}

/// One channel: of the ends around the smallest and largest value, the pair with the least squared error.
fn bc4(values: &[f32; 16]) -> u64 {
    let low = values.iter().copied().fold(1.0, f32::min) * 255.0;
    let high = values.iter().copied().fold(0.0, f32::max) * 255.0;
    let (low, high) = (low.floor() as i32, high.ceil() as i32);
    let mut best = (f32::INFINITY, 0u64);
    for a in [high, high - 1, high - 2, high + 1] {
        for b in [low, low + 1, low + 2, low - 1] {
            if a <= b || a > 255 || b < 0 {
                continue;
            }
            let palette = steps([a as u8, b as u8]);
            let (mut error, mut bits) = (0.0, a as u64 | (b as u64) << 8);
            for (k, v) in values.iter().enumerate() {
                let mut near = (f32::INFINITY, 0);
                for (i, p) in palette.iter().enumerate() {
                    let d = (v - p) * (v - p);
                    if d < near.0 {
                        near = (d, i as u64);
                    }
                }
                error += near.0;
                bits |= near.1 << (16 + 3 * k);
            }
            if error < best.0 {
                best = (error, bits);
            }
        }
    }
    if best.0.is_finite() {
        return best.1;
    }
    // One value at the end of the range: both ends are it, and every index is 0.
    let v = high.clamp(0, 255) as u64;
    v | v << 8
}

/// Weights of BC7's 16 steps, in 64ths.
const WEIGHTS: [u32; 16] = [0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64];

fn between(a: u32, b: u32, index: usize) -> u32 {
    (a * (64 - WEIGHTS[index]) + b * WEIGHTS[index] + 32) >> 6
}

/// Mode 6 with opaque alpha: ends along the principal axis, then twice the least-squares ends of the chosen steps.
fn bc7(texels: &Texels) -> [u8; 16] {
    let points = texels.map(|t| Vec3::from(t) * 255.0);
    let mean = points.iter().fold(Vec3::splat(0.0), |a, b| a + *b) / 16.0;
    // The principal axis, by the power method from the widest channel's direction.
    let mut covariance = [[0.0f32; 3]; 3];
    for p in &points {
        let d = (*p - mean).array();
        (0..9).for_each(|k| covariance[k / 3][k % 3] += d[k / 3] * d[k % 3]);
    }
    let widest = (0..3).fold(0, |a, b| if covariance[b][b] > covariance[a][a] { b } else { a });
    let mut axis = Vec3::from(covariance[widest]);
    for _ in 0..8 {
        let length = axis.length();
        if length <= 1e-6 {
            axis = Vec3::splat(0.0);
            break;
        }
        axis = axis / length;
        axis = Vec3::from(covariance.map(|row| Vec3::from(row).dot(axis)));
    }
    let axis = if axis.length() > 1e-6 { axis.normalize() } else { axis };
    let along = points.map(|p| (p - mean).dot(axis));
    let (low, high) = along.iter().fold((0.0f32, 0.0f32), |(a, b), v| (a.min(*v), b.max(*v)));
    let mut ends = [mean + axis * low, mean + axis * high];
    let mut best = (f32::INFINITY, [0u8; 16]);
    for _ in 0..3 {
        let mut chosen = [0usize; 16];
        let mut least = f32::INFINITY;
        for parity in 0..4u32 {
            // Seven bits and one that all channels share; alpha is 255, or 254 where that bit is 0.
            let quantized: [[u32; 4]; 2] = std::array::from_fn(|e| {
                let p = parity >> e & 1;
                let c = ends[e].array().map(|v| (((v - p as f32) * 0.5 + 0.5).clamp(0.0, 127.0) as u32) << 1 | p);
                [c[0], c[1], c[2], 254 | p]
            });
            let palette: [[f32; 3]; 16] =
                std::array::from_fn(|i| std::array::from_fn(|c| between(quantized[0][c], quantized[1][c], i) as f32));
            let (mut error, mut indices) = (0.0, [0usize; 16]);
            for (k, p) in points.iter().enumerate() {
                let mut near = f32::INFINITY;
                for (i, c) in palette.iter().enumerate() {
                    let d = *p - Vec3::from(*c);
                    let d = d.dot(d);
                    if d < near {
                        (near, indices[k]) = (d, i);
                    }
                }
                error += near;
            }
            if error < least {
                (least, chosen) = (error, indices);
            }
            if error < best.0 {
                best = (error, pack(quantized, indices));
            }
        }
        // Of e0 (1 - w) + e1 w.
        let (mut aa, mut ab, mut bb) = (0.0f32, 0.0f32, 0.0f32);
        let (mut ap, mut bp) = (Vec3::splat(0.0f32), Vec3::splat(0.0f32));
        for (p, i) in points.iter().zip(chosen) {
            let w = WEIGHTS[i] as f32 / 64.0;
            let v = 1.0 - w;
            (aa, ab, bb) = (aa + v * v, ab + v * w, bb + w * w);
            (ap, bp) = (ap + *p * v, bp + *p * w);
        }
        let det = aa * bb - ab * ab;
        if det.abs() < 1e-6 {
            break;
        }
        ends = [(ap * bb - bp * ab) / det, (bp * aa - ap * ab) / det];
    }
    best.1
}

/// The bits of mode 6.
fn pack(mut ends: [[u32; 4]; 2], mut indices: [usize; 16]) -> [u8; 16] {
    if indices[0] >= 8 {
        // The first index has no highest bit: the line runs the other way.
        ends.swap(0, 1);
        indices = indices.map(|i| 15 - i);
    }
    let mut bits = 1u128 << 6;
    for c in 0..4 {
        bits |= u128::from(ends[0][c] >> 1) << (7 + 14 * c);
        bits |= u128::from(ends[1][c] >> 1) << (14 + 14 * c);
    }
    bits |= u128::from(ends[0][0] & 1) << 63 | u128::from(ends[1][0] & 1) << 64;
    bits |= (indices[0] as u128) << 65;
    for (k, i) in indices.iter().enumerate().skip(1) {
        bits |= (*i as u128) << (64 + 4 * k);
    }
    bits.to_le_bytes()
}

/// Four channels of a picture as the bytes of a KTX2 level, grey repeated, alpha 1 where there is none.
pub fn rgba(image: &Image, wide: bool) -> Vec<u8> {
    let mut out = Vec::with_capacity(image.width() as usize * image.height() as usize * if wide { 8 } else { 4 });
    for (x, y) in (0..image.height()).flat_map(|y| (0..image.width()).map(move |x| (x, y))) {
        for v in Vec4::from(image.rgba(x, y)).array() {
            if wide {
                out.extend((crate::map::normal::quantize(v, 65535) as u16).to_le_bytes());
            } else {
                out.push(crate::map::normal::quantize(v, 255) as u8);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Encoding, Pixels};

    fn map(w: u32, h: u32, f: impl Fn(u32, u32) -> [f32; 2]) -> Image {
        let texels = (0..h).flat_map(|y| (0..w).map(move |x| (x, y)));
        let v = texels.flat_map(|(x, y)| {
            let [a, b] = f(x, y);
            Vec3::new(-a, -b, 1.0).normalize().array().map(|v| v * 0.5 + 0.5)
        });
        Image::new(w, h, 3, Pixels::F32(v.collect()), Encoding::Linear).unwrap()
    }

    #[test]
    fn a_block_by_hand_is_read_as_the_specification_says() {
        // Mode 6, ends (0, 0, 0) and (255, 255, 255) with their shared bits 0 and 1, index 8 of texel 1: 34/64.
        let mut bits = 1u128 << 6 | 1 << 64;
        (0..4).for_each(|c| bits |= 127u128 << (14 + 14 * c));
        bits |= 8 << 68;
        let t = unpack(Format::Bc7, &bits.to_le_bytes());
        assert_eq!((t[0], t[1]), ([0.0; 3], [((255 * 34 + 32) >> 6) as f32 / 255.0; 3]));
        // BC4: ends 200 and 60, index 2 of texel 0 is six sevenths of the first.
        let red = 200u128 | 60 << 8 | 2 << 16 | 1 << 19;
        let t = unpack(Format::Bc5, &red.to_le_bytes());
        assert!((t[0][0] * 255.0 - 180.0).abs() < 1e-4 && (t[1][0] * 255.0 - 60.0).abs() < 1e-4);
    }

    #[test]
    fn the_angle_is_small_and_its_report_true() {
        let wave = map(62, 45, |x, y| [(x as f32 * 0.05).min(2.0) * 0.4, y as f32 * 0.01 - 0.2]);
        let job = Job::default();
        for (format, mean, max) in [(Format::Bc5, 0.12, 0.5), (Format::Bc7, 0.6, 1.6)] {
            let made = compress(&wave, format, &job).unwrap();
            assert_eq!(made.bytes.len(), 16 * 12 * 16);
            // An 8-bit code is 0.45 degrees of a flat normal; a slow ramp uses a seventh of the ends' difference. BC7's one
            // line follows the steeper way, and lacks up to two codes of the other.
            assert!(made.mean < mean && made.max < max, "{format:?} {} {}", made.mean, made.max);
            let block: [u8; 16] = made.bytes[16..32].try_into().unwrap();
            let back = unpack(format, &block)[5];
            let want = wave.rgba(4 + 1, 1);
            assert!((back[0] - want[0]).abs() < 0.01 && (back[1] - want[1]).abs() < 0.01);
        }
        let flat = map(4, 4, |_, _| [0.0; 2]);
        for format in [Format::Bc5, Format::Bc7] {
            let made = compress(&flat, format, &job).unwrap();
            assert!(made.max < 0.5, "{}", made.max);
        }
        // One value at both ends of the range.
        for v in [0.0, 1.0, 0.3] {
            let t = unpack(Format::Bc5, &bc5(&[[v; 3]; 16]));
            assert!((t[7][0] - v).abs() < 0.003, "{v}");
        }
    }

    #[test]
    fn blocks_do_not_depend_on_threads() {
        let noise = map(40, 40, |x, y| [((x * 7919 + y * 104_729) % 97) as f32 / 97.0, ((x * y) % 13) as f32 / 13.0]);
        for format in [Format::Bc5, Format::Bc7] {
            let made = |n| compress(&noise, format, &Job::builder().threads(n).build()).unwrap();
            assert_eq!(made(1).bytes, made(3).bytes);
            assert_eq!(made(1).mean, made(7).mean);
        }
    }
}
