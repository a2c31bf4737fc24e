//! PNG, fast: bands of rows are filtered and compressed side by side, each a chunk of its own, together one
//! zlib stream. Bands have a fixed height, so the bytes do not depend on the number of threads.

use super::deflate;
use crate::error::{Error, Result};
use crate::image::{Encoding, Image, Pixels};
use crate::job::Job;
use rayon::prelude::*;
use std::io::{self, Write};

/// About how many bytes of pixels a band has.
const BAND: usize = 192 << 10;

/// The bytes of a picture, row by row as PNG wants them.
struct Rows<'a> {
    image: &'a Image,
    /// Channels that are written: without alpha when all is opaque.
    channels: usize,
    depth: usize,
}

impl Rows<'_> {
    fn bytes_per_row(&self) -> usize {
        self.image.width() as usize * self.channels * self.depth
    }
    /// Row `y` as big-endian bytes.
    fn fill(&self, y: usize, out: &mut [u8]) {
        let (n, m) = (self.image.channels(), self.channels);
        let row = self.image.width() as usize * n;
        match self.image.pixels() {
            Pixels::U8(v) => {
                let v = &v[y * row..(y + 1) * row];
                match (n, m) {
                    (4, 3) => {
                        v.chunks_exact(4).zip(out.chunks_exact_mut(3)).for_each(|(p, o)| o.copy_from_slice(&p[..3]))
                    }
                    (2, 1) => v.chunks_exact(2).zip(out).for_each(|(p, o)| *o = p[0]),
                    _ => out.copy_from_slice(v),
                }
            }
            Pixels::U16(v) => {
                let v = &v[y * row..(y + 1) * row];
                let put = |(v, o): (&u16, &mut [u8])| o.copy_from_slice(&v.to_be_bytes());
                if n == m {
                    v.iter().zip(out.chunks_exact_mut(2)).for_each(put);
                } else {
                    v.chunks_exact(n).flat_map(|p| &p[..m]).zip(out.chunks_exact_mut(2)).for_each(put);
                }
            }
            _ => unreachable!("floats were refused before"),
        }
    }
}

fn all_opaque(image: &Image) -> bool {
    match (image.pixels(), image.channels()) {
        (Pixels::U8(v), n @ (2 | 4)) => v.chunks_exact(n).all(|p| p[n - 1] == 255),
        (Pixels::U16(v), n @ (2 | 4)) => v.chunks_exact(n).all(|p| p[n - 1] == 65535),
        _ => false,
    }
}

/// Writes an 8- or 16-bit picture. An opaque alpha channel is left out.
pub(super) fn write(out: &mut dyn Write, image: &Image, job: &Job) -> Result<()> {
    let depth = match image.pixels() {
        Pixels::U8(_) => 1,
        Pixels::U16(_) => 2,
        _ => {
            return Err(Error::arguments("write.float", "PNG holds 8 or 16 bits, not floats")
                .remedy("write .exr or .hdr, or render with 8 or 16 bits"));
        }
    };
    let channels = image.channels() - usize::from(image.channels().is_multiple_of(2) && all_opaque(image));
    let rows = Rows { image, channels, depth };
    let height = image.height() as usize;
    let per_band = (BAND / (rows.bytes_per_row() + 1)).max(1);
    let bands = height.div_ceil(per_band);
    let failed = |e: io::Error| Error::output("write.failed", e.to_string());

    out.write_all(b"\x89PNG\r\n\x1a\n").map_err(failed)?;
    let mut head = Vec::with_capacity(13);
    head.extend(image.width().to_be_bytes());
    head.extend(image.height().to_be_bytes());
    head.extend([8 * depth as u8, [0, 4, 2, 6][channels - 1], 0, 0, 0]);
    chunk(out, b"IHDR", &head).map_err(failed)?;
    if image.encoding == Encoding::Srgb {
        chunk(out, b"sRGB", &[0]).map_err(failed)?;
    }
    chunk(out, b"tEXt", concat!("Software\0frieze ", env!("CARGO_PKG_VERSION")).as_bytes()).map_err(failed)?;
    // So many bands at a time that memory stays small for pictures of any size.
    let (mut sum, mut first) = (1u32, true);
    for group in (0..bands).collect::<Vec<_>>().chunks(64) {
        job.check()?;
        let coded: Vec<(Vec<u8>, u32, usize)> = job.run(|| {
            group
                .par_iter()
                .map(|&b| {
                    let raw = filter(&rows, b * per_band, ((b + 1) * per_band).min(height));
                    (deflate::blocks(&raw), simd_adler32::adler32(&&raw[..]), raw.len())
                })
                .collect()
        });
        for (mut bytes, adler, length) in coded {
            if first {
                bytes.splice(0..0, [0x78, 0x01]); // zlib: Deflate, 32 KiB, fastest
                first = false;
            }
            chunk(out, b"IDAT", &bytes).map_err(failed)?;
            sum = combine(sum, adler, length as u64);
        }
        job.progress("encode", (group[group.len() - 1] + 1) as u64, bands as u64);
    }
    let mut end = vec![0x03, 0x00]; // the final block, empty
    end.extend(sum.to_be_bytes());
    chunk(out, b"IDAT", &end).map_err(failed)?;
    chunk(out, b"IEND", &[]).map_err(failed)
}

fn chunk(out: &mut dyn Write, kind: &[u8; 4], data: &[u8]) -> io::Result<()> {
    let mut crc = crc32fast::Hasher::new();
    crc.update(kind);
    crc.update(data);
    out.write_all(&(data.len() as u32).to_be_bytes())?;
    out.write_all(kind)?;
    out.write_all(data)?;
    out.write_all(&crc.finalize().to_be_bytes())
}

/// Adler-32 of two pieces, the second `length` bytes long.
fn combine(first: u32, second: u32, length: u64) -> u32 {
    const M: u64 = 65521;
    let (a1, b1) = (u64::from(first & 0xffff), u64::from(first >> 16));
    let (a2, b2) = (u64::from(second & 0xffff), u64::from(second >> 16));
    let a = (a1 + a2 + M - 1) % M;
    let b = (b1 + b2 + (length % M) * ((a1 + M - 1) % M)) % M;
    (b << 16 | a) as u32
}

/// The rows `from .. to`, each filtered with the one of Sub, Up and Paeth that leaves the least absolute sum
/// (the PNG specification's heuristic; the first of equals).
fn filter(rows: &Rows, from: usize, to: usize) -> Vec<u8> {
    let size = rows.bytes_per_row();
    let pixel = rows.channels * rows.depth;
    // One pixel of zeros to the left, as the filters see it.
    let (mut above, mut this) = (vec![0; pixel + size], vec![0; pixel + size]);
    let mut trial = vec![0; size];
    let mut out = vec![0; (size + 1) * (to - from)];
    if from > 0 {
        rows.fill(from - 1, &mut above[pixel..]);
    }
    for (y, line) in (from..to).zip(out.chunks_exact_mut(size + 1)) {
        rows.fill(y, &mut this[pixel..]);
        let (kind, line) = line.split_first_mut().expect("a row has its filter's byte");
        let (x, a, b, c) = (&this[pixel..], &this[..size], &above[pixel..], &above[..size]);
        line.iter_mut().zip(x.iter().zip(b)).for_each(|(o, (x, b))| *o = x.wrapping_sub(*b));
        *kind = 2;
        let mut best = cost(line);
        if best > 0 {
            trial.iter_mut().zip(x.iter().zip(a)).for_each(|(o, (x, a))| *o = x.wrapping_sub(*a));
            let sub = cost(&trial);
            if sub < best {
                line.copy_from_slice(&trial);
                (*kind, best) = (1, sub);
            }
            // Rows that one neighbour predicts well are left alone.
            if best > size as u64 / 8 {
                for ((o, x), ((a, b), c)) in trial.iter_mut().zip(x).zip(a.iter().zip(b).zip(c)) {
                    *o = x.wrapping_sub(paeth(*a, *b, *c));
                }
                if cost(&trial) < best {
                    line.copy_from_slice(&trial);
                    *kind = 4;
                }
            }
        }
        std::mem::swap(&mut above, &mut this);
    }
    out
}

/// The sum of the bytes as distances from 0.
fn cost(line: &[u8]) -> u64 {
    // Parts so short that their sums fit 16 bits.
    line.chunks(256).map(|part| u64::from(part.iter().map(|&b| u16::from((b as i8).unsigned_abs())).sum::<u16>())).sum()
}

/// PNG's predictor: of left, above and upper left, the one nearest to left + above - upper left.
#[inline(always)]
fn paeth(a: u8, b: u8, c: u8) -> u8 {
    let (p, q) = (i16::from(b) - i16::from(c), i16::from(a) - i16::from(c));
    let (pa, pb, pc) = (p.abs(), q.abs(), (p + q).abs());
    if pa <= pb && pa <= pc {
        a
    } else if pb <= pc {
        b
    } else {
        c
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adler_sums_combine() {
        let data: Vec<u8> = (0..100_000u32).map(|k| (k.wrapping_mul(k) >> 7) as u8).collect();
        let sum = |d: &[u8]| simd_adler32::adler32(&d);
        for cut in [0, 1, 777, 65521, 100_000] {
            let (a, b) = data.split_at(cut);
            assert_eq!(combine(sum(a), sum(b), b.len() as u64), sum(&data));
        }
    }

    #[test]
    fn the_bytes_do_not_depend_on_threads() {
        let pixels = (0..700 * 900 * 4u32).map(|k| (k.wrapping_mul(k) >> 9) as u8 | 1).collect();
        let image = Image::new(700, 900, 4, Pixels::U8(pixels), Encoding::Srgb).unwrap();
        let bytes = |threads| {
            let mut out = Vec::new();
            write(&mut out, &image, &Job::builder().threads(threads).build()).unwrap();
            out
        };
        let one = bytes(1);
        assert!(one == bytes(2) && one == bytes(7));
    }
}
