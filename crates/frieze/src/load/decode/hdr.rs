//! Radiance HDR (`.hdr`, `.pic`): RGBE with either run-length code, in any of the eight orders of pixels.

use super::{corrupt, reserve, unsupported};
use crate::error::{Error, Result};
use crate::image::{Encoding, Image, Pixels};
use crate::job::Job;

/// A mantissa times the shared exponent, as G. Ward's `color.c` without its half step: `m * 2^(e - 136)`.
fn value(mantissa: u8, exponent: u8) -> f32 {
    // 2^(e - 136) in f64 is always a normal number; the product rounds once.
    let scale = f64::from_bits((u64::from(exponent) + 1023 - 136) << 52);
    if exponent == 0 { 0.0 } else { (f64::from(mantissa) * scale) as f32 }
}

struct Input<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Input<'_> {
    fn take<const K: usize>(&mut self) -> Result<[u8; K]> {
        let part = self.bytes.get(self.at..self.at + K).ok_or_else(|| cut_off(self.at))?;
        self.at += K;
        Ok(part.try_into().expect("K bytes"))
    }
    fn line(&mut self) -> Result<&str> {
        let rest = &self.bytes[self.at.min(self.bytes.len())..];
        let end = rest.iter().take(4096).position(|&b| b == b'\n').ok_or_else(|| corrupt("its header does not end"))?;
        self.at += end + 1;
        std::str::from_utf8(&rest[..end]).map_err(|_| corrupt("its header is no text"))
    }
}

fn cut_off(at: usize) -> Error {
    corrupt("it is cut off").at(format!("byte {at}"))
}

pub(super) fn decode(bytes: &[u8], job: &Job) -> Result<Image> {
    let mut input = Input { bytes, at: 0 };
    loop {
        let line = input.line()?.trim_end();
        if line.is_empty() {
            break;
        }
        if let Some(format) = line.strip_prefix("FORMAT=")
            && format.trim() != "32-bit_rle_rgbe"
        {
            return Err(unsupported(format_args!("a Radiance picture of the format {}", format.trim())));
        }
    }
    let size = input.line()?.to_owned();
    let words: Vec<&str> = size.split_ascii_whitespace().collect();
    let bad = || corrupt(format_args!("its size is `{}`", size.chars().take(40).collect::<String>()));
    let [first, outer, second, inner] = words[..] else { return Err(bad()) };
    let (outer, inner): (u32, u32) = (outer.parse().map_err(|_| bad())?, inner.parse().map_err(|_| bad())?);
    // `-Y h +X w` is the usual order: rows from the top, each from the left.
    let swapped = match (first.as_bytes(), second.as_bytes()) {
        ([b'+' | b'-', b'Y'], [b'+' | b'-', b'X']) => false,
        ([b'+' | b'-', b'X'], [b'+' | b'-', b'Y']) => true,
        _ => return Err(bad()),
    };
    let (width, height) = if swapped { (outer, inner) } else { (inner, outer) };
    let _held = reserve(job, width.into(), height.into(), 12)?;
    // Four bytes describe at most 127 pixels of a channel: a small file cannot ask for a large picture.
    if u64::from(width) * u64::from(height) > (bytes.len() as u64).saturating_mul(127) {
        return Err(cut_off(bytes.len()));
    }
    let from_left = if swapped { first } else { second }.starts_with('+');
    let from_top = if swapped { second } else { first }.starts_with('-');
    let (w, h) = (width as usize, height as usize);
    let mut out = vec![0.0f32; w * h * 3];
    let mut row = vec![[0u8; 4]; inner as usize];
    for o in 0..outer as usize {
        if o % 256 == 0 {
            job.check()?;
        }
        scanline(&mut input, &mut row)?;
        for (i, p) in row.iter().enumerate() {
            let (x, y) = if swapped { (o, i) } else { (i, o) };
            let (x, y) = (if from_left { x } else { w - 1 - x }, if from_top { y } else { h - 1 - y });
            let k = 3 * (y * w + x);
            for c in 0..3 {
                out[k + c] = value(p[c], p[3]);
            }
        }
    }
    Image::new(width, height, 3, Pixels::F32(out), Encoding::Linear)
}

/// One row: the newer code (four runs of bytes), or pixels with the older repeat marks.
fn scanline(input: &mut Input, row: &mut [[u8; 4]]) -> Result<()> {
    let length = row.len();
    let head: [u8; 4] = input.take()?;
    if (8..32768).contains(&length) && head[..2] == [2, 2] && head[2] < 128 {
        if usize::from(head[2]) << 8 | usize::from(head[3]) != length {
            return Err(corrupt("a row states another width than the header").at(format!("byte {}", input.at)));
        }
        for c in 0..4 {
            let mut x = 0;
            while x < length {
                let [count] = input.take()?;
                let (run, count) = if count > 128 { (true, count - 128) } else { (false, count) };
                if count == 0 || x + usize::from(count) > length {
                    return Err(corrupt("a run leaves its row").at(format!("byte {}", input.at)));
                }
                let mut byte = 0;
                for k in 0..count {
                    if !run || k == 0 {
                        [byte] = input.take()?;
                    }
                    row[x][c] = byte;
                    x += 1;
                }
            }
        }
        return Ok(());
    }
    let (mut x, mut pixel, mut shift) = (0, head, 0);
    loop {
        if pixel[..3] == [1, 1, 1] && x > 0 {
            let count = usize::from(pixel[3]).checked_shl(shift).filter(|&n| n <= length - x);
            let count = count.ok_or_else(|| corrupt("a run leaves its row").at(format!("byte {}", input.at)))?;
            let last = row[x - 1];
            row[x..x + count].fill(last);
            x += count;
            shift = (shift + 8).min(24);
        } else {
            row[x] = pixel;
            x += 1;
            shift = 0;
        }
        if x == length {
            return Ok(());
        }
        pixel = input.take()?;
    }
}
