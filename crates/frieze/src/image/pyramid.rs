//! Mip levels and ripmaps.
//!
//! Level k+1 has `max(1, floor(n / 2))` texels a side where level k has `n`, and each of its texels is the
//! *area average* of exactly the span it covers: two texels where n is even, three with weights where n is
//! odd, so the mean is kept for every size (row 41). Averages are taken of linear light, kept in single
//! precision from level to level and rounded once per level.

use super::image::{Image, Pixels};
use crate::math::exact;
use rayon::prelude::*;
use std::sync::OnceLock;

/// Where one level lies among the texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Texels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Index of the texel (0, 0).
    pub offset: u32,
    /// Texels from one row to the next: `width + 1`. The texel after a row's last repeats its first, and
    /// the row after the last repeats row 0, so that a repeating bilinear lookup finds its four texels at
    /// `i`, `i + 1`, `i + pitch` and `i + pitch + 1`.
    pub pitch: u32,
}

/// The texels of all levels, as they are held for speed: always four channels, linear.
#[derive(Clone, Debug)]
pub enum Texels {
    /// 8 bits a channel, R in the lowest: what 8-bit linear images become.
    Rgba8(Vec<u32>),
    /// 16 bits a channel, R and B in the lower halves: sRGB 8-bit images, decoded, and 16-bit images.
    Rgba16(Vec<[u32; 2]>),
    /// Floats: NaN became 0, magnitudes beyond 1e30 were clamped, so that no filter makes an infinity.
    F32(Vec<[f32; 4]>),
}

/// How texels are averaged, and which levels are made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rule {
    /// The colour channels are sRGB (alpha never is).
    pub srgb: bool,
    /// Colour counts by its alpha, so that the hidden colour of transparent texels does not bleed. Right for
    /// colour, wrong for data whose fourth channel is just one more number.
    pub weigh_by_alpha: bool,
    /// Also levels that are smaller along one axis only ([`Filter::Ripmap`](crate::map::Filter::Ripmap)):
    /// four times the memory instead of a third more.
    pub ripmap: bool,
}

/// The levels of an image, from the finest to one texel.
#[derive(Clone, Debug)]
pub struct Pyramid {
    texels: Texels,
    mips: Vec<Shape>,
    /// Level (i, j) at `j * across + i`; empty without ripmap.
    rips: Vec<Shape>,
    opaque: bool,
}

/// Something per texel while levels are made: the numbers of the store (0 ..= 255, 0 ..= 65535 or floats).
type Wide = [f32; 4];

fn halved(n: u32) -> u32 {
    (n / 2).max(1)
}

/// How many times `n` can be halved until 1, plus one.
fn depth(n: u32) -> u32 {
    32 - n.leading_zeros()
}

/// The first of up to three source texels under coarse texel `i` of `to`, and their weights.
fn span(from: usize, to: usize, i: usize) -> (usize, [f32; 3]) {
    if from == to {
        (i, [1.0, 0.0, 0.0])
    } else if from == 2 * to {
        (2 * i, [0.5, 0.5, 0.0])
    } else {
        // from = 2 to + 1: the span reaches from 2i + i/to to 2i + 2 + (i + 1)/to.
        let n = from as f32;
        (2 * i, [(to - i) as f32 / n, to as f32 / n, (i + 1) as f32 / n])
    }
}

/// Calls `f(y, row)` for every row, in parallel inside of a job's pool (never on rayon's global one).
fn rows<T: Send>(data: &mut [T], pitch: usize, f: impl Fn(usize, &mut [T]) + Sync) {
    if rayon::current_thread_index().is_some() && data.len() > 1 << 12 {
        data.par_chunks_mut(pitch).enumerate().for_each(|(y, row)| f(y, row));
    } else {
        data.chunks_mut(pitch).enumerate().for_each(|(y, row)| f(y, row));
    }
}

/// Area average of a `from`-sized level, whose row `y` is put into a buffer by `read`.
fn shrink(from: (u32, u32), to: (u32, u32), weigh: bool, read: impl Fn(usize, &mut [Wide]) + Sync) -> Vec<Wide> {
    let (fw, fh) = (from.0 as usize, from.1 as usize);
    let (tw, th) = (to.0 as usize, to.1 as usize);
    let mut out = vec![[0.0; 4]; tw * th];
    rows(&mut out, tw, |y, out| {
        let (y0, wy) = span(fh, th, y);
        let mut lines: [Vec<Wide>; 3] = Default::default();
        for (k, line) in lines.iter_mut().enumerate() {
            line.resize(fw, [0.0; 4]);
            if wy[k] > 0.0 {
                read(y0 + k, line);
            }
        }
        for (x, out) in out.iter_mut().enumerate() {
            let (x0, wx) = span(fw, tw, x);
            let (mut plain, mut heavy) = ([0.0f32; 4], [0.0f32; 3]);
            for (line, wy) in lines.iter().zip(wy) {
                for k in 0..3 {
                    let w = wx[k] * wy;
                    if w > 0.0 {
                        let v = line[x0 + k];
                        for c in 0..4 {
                            plain[c] += v[c] * w;
                        }
                        if weigh {
                            for c in 0..3 {
                                heavy[c] += v[c] * (v[3] * w);
                            }
                        }
                    }
                }
            }
            if weigh && plain[3] > 0.0 {
                for c in 0..3 {
                    plain[c] = heavy[c] / plain[3];
                }
            }
            *out = plain;
        }
    });
    out
}

/// IEC 61966-2-1, decoded.
fn decode(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { exact::pow_f64((v + 0.055) / 1.055, 2.4) }
}

/// The linear value, 0 ..= 65535 but not rounded, of each sRGB code.
fn decode_table(codes: usize) -> &'static [f32] {
    static EIGHT: OnceLock<Vec<f32>> = OnceLock::new();
    static SIXTEEN: OnceLock<Vec<f32>> = OnceLock::new();
    let make = || (0..codes).map(|k| (decode(k as f64 / (codes - 1) as f64) * 65535.0) as f32).collect();
    if codes == 256 { EIGHT.get_or_init(make) } else { SIXTEEN.get_or_init(make) }
}

/// Row `y` of an image in the numbers of its store.
struct Reader<'a> {
    image: &'a Image,
    /// The decoded value of each code of an integer image.
    table: Option<&'a [f32]>,
    srgb: bool,
}

impl Reader<'_> {
    fn row(&self, y: usize, out: &mut [Wide]) {
        let n = self.image.channels();
        let at = y * self.image.width() as usize * n;
        let len = self.image.width() as usize * n;
        let full = match self.image.pixels() {
            Pixels::U8(_) if self.table.is_none() => 255.0,
            Pixels::U8(_) | Pixels::U16(_) => 65535.0,
            _ => 1.0,
        };
        let alpha = if n % 2 == 0 { n - 1 } else { n };
        match self.image.pixels() {
            Pixels::U8(v) => match self.table {
                None => spread(&v[at..at + len], n, full, out, |v, _| f32::from(v)),
                Some(t) => spread(&v[at..at + len], n, full, out, |v, c| {
                    if c == alpha { f32::from(v) * 257.0 } else { t[usize::from(v)] }
                }),
            },
            Pixels::U16(v) => {
                match self.table {
                    None => spread(&v[at..at + len], n, full, out, |v, _| f32::from(v)),
                    Some(t) => spread(&v[at..at + len], n, full, out, |v, c| {
                        if c == alpha { f32::from(v) } else { t[usize::from(v)] }
                    }),
                }
            }
            Pixels::F16(v) => spread(&v[at..at + len], n, full, out, |v, c| self.float(v.to_f32(), c == alpha)),
            Pixels::F32(v) => spread(&v[at..at + len], n, full, out, |v, c| self.float(v, c == alpha)),
        }
    }
    fn float(&self, v: f32, alpha: bool) -> f32 {
        let v = if v.is_nan() { 0.0 } else { v.clamp(-1e30, 1e30) };
        if self.srgb && !alpha { decode(f64::from(v)) as f32 } else { v }
    }
}

/// 1 to 4 values a pixel made RGBA: grey is repeated, a missing alpha is `full`.
#[inline(always)]
fn spread<T: Copy>(row: &[T], channels: usize, full: f32, out: &mut [Wide], get: impl Fn(T, usize) -> f32) {
    let pixels = out.iter_mut().zip(row.chunks_exact(channels));
    match channels {
        1 => pixels.for_each(|(o, v)| *o = [get(v[0], 0), get(v[0], 0), get(v[0], 0), full]),
        2 => pixels.for_each(|(o, v)| *o = [get(v[0], 0), get(v[0], 0), get(v[0], 0), get(v[1], 1)]),
        3 => pixels.for_each(|(o, v)| *o = [get(v[0], 0), get(v[1], 1), get(v[2], 2), full]),
        _ => pixels.for_each(|(o, v)| *o = [get(v[0], 0), get(v[1], 1), get(v[2], 2), get(v[3], 3)]),
    }
}

/// Texels that a level is written into.
trait Store: Copy + Default + Send + Sync {
    fn pack(v: Wide) -> Self;
}

impl Store for u32 {
    #[inline(always)]
    fn pack(v: Wide) -> u32 {
        let q = |v: f32| (v + 0.5) as u32 & 255;
        q(v[0]) | q(v[1]) << 8 | q(v[2]) << 16 | q(v[3]) << 24
    }
}

impl Store for [u32; 2] {
    #[inline(always)]
    fn pack(v: Wide) -> [u32; 2] {
        let q = |v: f32| (v + 0.5) as u32 & 65535;
        [q(v[0]) | q(v[1]) << 16, q(v[2]) | q(v[3]) << 16]
    }
}

impl Store for [f32; 4] {
    #[inline(always)]
    fn pack(v: Wide) -> [f32; 4] {
        v
    }
}

/// Writes a level with its padding.
fn put<T: Store>(texels: &mut [T], s: Shape, read: impl Fn(usize, &mut [Wide]) + Sync) {
    let (w, h, p) = (s.width as usize, s.height as usize, s.pitch as usize);
    let level = &mut texels[s.offset as usize..][..p * (h + 1)];
    rows(level, p, |y, out| {
        let mut line = vec![[0.0; 4]; w];
        read(if y == h { 0 } else { y }, &mut line);
        for (o, v) in out.iter_mut().zip(&line) {
            *o = T::pack(*v);
        }
        out[w] = out[0];
    });
}

fn fill<T: Store>(mips: &[Shape], rips: &[Shape], weigh: bool, source: &Reader<'_>) -> Vec<T> {
    let end = |s: &Shape| s.offset as usize + s.pitch as usize * (s.height as usize + 1);
    let mut texels = vec![T::default(); mips.iter().chain(rips).map(end).max().unwrap_or(0)];
    let size = |s: Shape| (s.width, s.height);
    put(&mut texels, mips[0], |y, out| source.row(y, out));
    let mut held: Option<Vec<Wide>> = None; // the level above, unrounded
    for pair in mips.windows(2) {
        let (from, to) = (size(pair[0]), size(pair[1]));
        let next = match &held {
            None => shrink(from, to, weigh, |y, out| source.row(y, out)),
            Some(v) => shrink(from, to, weigh, |y, out| copy_row(v, from.0, y, out)),
        };
        put(&mut texels, pair[1], |y, out| copy_row(&next, to.0, y, out));
        held = Some(next);
    }
    // Ripmap: along a row of the grid from the column's head, which is made from the head above.
    let across = depth(mips[0].width) as usize;
    let mut head: Option<Vec<Wide>> = None;
    for (j, line) in rips.chunks(across).enumerate() {
        if j > 0 {
            let (from, to) = (size(rips[(j - 1) * across]), size(line[0]));
            let next = match &head {
                None => shrink(from, to, weigh, |y, out| source.row(y, out)),
                Some(v) => shrink(from, to, weigh, |y, out| copy_row(v, from.0, y, out)),
            };
            if !mips.contains(&line[0]) {
                put(&mut texels, line[0], |y, out| copy_row(&next, to.0, y, out));
            }
            head = Some(next);
        }
        let mut held: Option<Vec<Wide>> = None;
        for pair in line.windows(2) {
            let (from, to) = (size(pair[0]), size(pair[1]));
            let next = match held.as_ref().or(head.as_ref()) {
                None => shrink(from, to, weigh, |y, out| source.row(y, out)),
                Some(v) => shrink(from, to, weigh, |y, out| copy_row(v, from.0, y, out)),
            };
            if !mips.contains(&pair[1]) {
                put(&mut texels, pair[1], |y, out| copy_row(&next, to.0, y, out));
            }
            held = Some(next);
        }
    }
    texels
}

fn copy_row(level: &[Wide], width: u32, y: usize, out: &mut [Wide]) {
    let w = width as usize;
    out.copy_from_slice(&level[y * w..][..w]);
}

fn is_opaque(image: &Image) -> bool {
    let n = image.channels();
    if n % 2 == 1 {
        return true;
    }
    match image.pixels() {
        Pixels::U8(v) => v.iter().skip(n - 1).step_by(n).all(|&a| a == 255),
        Pixels::U16(v) => v.iter().skip(n - 1).step_by(n).all(|&a| a == 65535),
        Pixels::F16(v) => v.iter().skip(n - 1).step_by(n).all(|a| a.to_f32() == 1.0),
        Pixels::F32(v) => v.iter().skip(n - 1).step_by(n).all(|&a| a == 1.0),
    }
}

impl Pyramid {
    /// The levels of `image`. `srgb` says that it holds sRGB colour: it is decoded first, averaged in linear
    /// light, and weighted by alpha. Otherwise the four channels are data, averaged each for itself.
    /// Inside of [`Job::run`](crate::Job::run) the work is shared out to the job's threads.
    pub fn new(image: &Image, srgb: bool) -> Self {
        Self::with(image, Rule { srgb, weigh_by_alpha: srgb, ripmap: false })
    }

    /// As [`Pyramid::new`], with a ripmap too.
    pub fn with_ripmap(image: &Image, srgb: bool) -> Self {
        Self::with(image, Rule { srgb, weigh_by_alpha: srgb, ripmap: true })
    }

    /// The levels of `image` by `rule`.
    pub fn with(image: &Image, rule: Rule) -> Self {
        let (mut w, mut h) = (image.width(), image.height());
        let mut end = 0u64;
        let mut place = |width: u32, height: u32| {
            let s = Shape { width, height, offset: end as u32, pitch: width + 1 };
            end += u64::from(s.pitch) * (u64::from(height) + 1);
            s
        };
        let mut mips = vec![place(w, h)];
        while w > 1 || h > 1 {
            (w, h) = (halved(w), halved(h));
            mips.push(place(w, h));
        }
        let mut rips = Vec::new();
        if rule.ripmap {
            for j in 0..depth(image.height()) {
                for i in 0..depth(image.width()) {
                    let (w, h) = ((image.width() >> i).max(1), (image.height() >> j).max(1));
                    rips.push(
                        mips.iter().copied().find(|m| (m.width, m.height) == (w, h)).unwrap_or_else(|| place(w, h)),
                    );
                }
            }
        }
        assert!(end <= 1 << 32, "at most 2^32 texels, which the loader's memory check keeps far away");
        let opaque = is_opaque(image);
        let weigh = rule.weigh_by_alpha && !opaque;
        let table = match image.pixels() {
            Pixels::U8(_) if rule.srgb => Some(decode_table(256)),
            Pixels::U16(_) if rule.srgb => Some(decode_table(65536)),
            _ => None,
        };
        let source = Reader { image, table, srgb: rule.srgb };
        let texels = match image.pixels() {
            Pixels::U8(_) if !rule.srgb => Texels::Rgba8(fill(&mips, &rips, weigh, &source)),
            Pixels::U8(_) | Pixels::U16(_) => Texels::Rgba16(fill(&mips, &rips, weigh, &source)),
            Pixels::F16(_) | Pixels::F32(_) => Texels::F32(fill(&mips, &rips, weigh, &source)),
        };
        Pyramid { texels, mips, rips, opaque }
    }

    /// Bytes that [`Pyramid::with`] will hold for an image of this size, and at most half as much again while
    /// it works: what to reserve first.
    pub fn bytes_for(image: &Image, rule: Rule) -> u64 {
        let each = match image.pixels() {
            Pixels::U8(_) if !rule.srgb => 4,
            Pixels::U8(_) | Pixels::U16(_) => 8,
            Pixels::F16(_) | Pixels::F32(_) => 16,
        };
        let (w, h) = (u64::from(image.width()) + 1, u64::from(image.height()) + 1);
        let factor = if rule.ripmap { 4 } else { 2 };
        each * (w + 32) * (h + 32) * factor
    }

    /// How many mip levels there are, at least 1.
    pub fn levels(&self) -> u32 {
        self.mips.len() as u32
    }
    /// Width and height of mip level `level` in texels; levels beyond the last count as the last.
    pub fn size(&self, level: u32) -> (u32, u32) {
        let s = self.mips[(level as usize).min(self.mips.len() - 1)];
        (s.width, s.height)
    }
    /// The mip levels, finest first.
    #[inline(always)]
    pub fn mips(&self) -> &[Shape] {
        &self.mips
    }
    /// The levels of the ripmap: halved `i` times along u and `j` times along v at `j * across + i`, where
    /// `across` is [`Pyramid::rip_size`]`().0`. Empty without a ripmap.
    #[inline(always)]
    pub fn rips(&self) -> &[Shape] {
        &self.rips
    }
    /// How many levels the ripmap has along u and v.
    pub fn rip_size(&self) -> (u32, u32) {
        (depth(self.mips[0].width), depth(self.mips[0].height))
    }
    /// The store, for lookups.
    #[inline(always)]
    pub fn texels(&self) -> &Texels {
        &self.texels
    }
    /// Whether alpha is 1 everywhere.
    #[inline(always)]
    pub fn opaque(&self) -> bool {
        self.opaque
    }
    /// Bytes that the texels take.
    pub fn bytes(&self) -> u64 {
        let n = |len: usize, each: u64| len as u64 * each;
        match &self.texels {
            Texels::Rgba8(v) => n(v.len(), 4),
            Texels::Rgba16(v) => n(v.len(), 8),
            Texels::F32(v) => n(v.len(), 16),
        }
    }
    /// One texel of a mip level as linear RGBA. Levels and places outside count as the nearest inside.
    pub fn texel(&self, level: u32, x: u32, y: u32) -> [f32; 4] {
        self.texel_of(self.mips[(level as usize).min(self.mips.len() - 1)], x, y)
    }
    /// One texel of a level of this pyramid as linear RGBA. Places outside count as the nearest inside.
    pub fn texel_of(&self, s: Shape, x: u32, y: u32) -> [f32; 4] {
        let (x, y) = (x.min(s.width - 1), y.min(s.height - 1));
        let k = s.offset as usize + y as usize * s.pitch as usize + x as usize;
        match &self.texels {
            Texels::Rgba8(v) => v[k].to_le_bytes().map(|v| f32::from(v) / 255.0),
            Texels::Rgba16(v) => {
                let [a, b] = v[k];
                [a & 65535, a >> 16, b & 65535, b >> 16].map(|v| v as f32 / 65535.0)
            }
            Texels::F32(v) => v[k],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Encoding;
    use super::*;
    use crate::Job;

    /// A fixed sequence of bytes without pattern.
    fn bytes(n: usize) -> Vec<u8> {
        let mut s = 12345u32;
        (0..n)
            .map(|_| {
                s = s.wrapping_mul(1664525).wrapping_add(1013904223);
                (s >> 24) as u8
            })
            .collect()
    }
    fn image8(w: u32, h: u32, c: u8) -> Image {
        let v = bytes(w as usize * h as usize * usize::from(c));
        Image::new(w, h, c, Pixels::U8(v), Encoding::Linear).unwrap()
    }
    fn mean(p: &Pyramid, level: u32, c: usize) -> f64 {
        let (w, h) = p.size(level);
        let all = (0..h).flat_map(|y| (0..w).map(move |x| (x, y)));
        all.map(|(x, y)| f64::from(p.texel(level, x, y)[c])).sum::<f64>() / f64::from(w * h)
    }

    // Row 41: the mean is kept, for powers of two and odd sizes.
    #[test]
    fn row_41_every_level_keeps_the_mean() {
        for (w, h) in [(64, 64), (37, 53), (1, 9), (7, 1), (100, 3), (33, 32)] {
            let eight = image8(w, h, 4);
            let floats = bytes(eight.bytes() as usize).iter().map(|&v| f32::from(v) / 255.0).collect();
            let float = Image::new(w, h, 4, Pixels::F32(floats), Encoding::Linear).unwrap();
            for (image, ripmap) in [(&eight, false), (&float, true)] {
                let p = Pyramid::with(image, Rule { ripmap, ..Rule::default() });
                assert_eq!(p.size(p.levels()), (1, 1));
                for level in 1..p.levels() {
                    for c in 0..4 {
                        // 8 bits: a texel is rounded by half a step, and a mean of few texels by as much.
                        let limit = if ripmap { 1e-6 } else { 0.5001 / 255.0 };
                        let d = (mean(&p, level, c) - mean(&p, 0, c)).abs();
                        assert!(d < limit, "{w}x{h} level {level} channel {c}: {d}");
                    }
                }
                for s in p.rips() {
                    let all = (0..s.height).flat_map(|y| (0..s.width).map(move |x| (x, y)));
                    let sum: f64 = all.map(|(x, y)| f64::from(p.texel_of(*s, x, y)[0])).sum();
                    assert!((sum / f64::from(s.width * s.height) - mean(&p, 0, 0)).abs() < 1e-6, "{s:?}");
                }
            }
        }
    }

    // Row 41: each coarse texel is the area average of its own span.
    #[test]
    fn row_41_odd_sizes_average_exactly_what_they_cover() {
        let v: Vec<f32> = vec![1.0, 2.0, 4.0, 8.0, 16.0];
        let p = Pyramid::new(&Image::new(5, 1, 1, Pixels::F32(v), Encoding::Linear).unwrap(), false);
        // Texel 0 covers 0 ..= 2.5, texel 1 covers 2.5 ..= 5.
        for (x, want) in [(0, (1.0 + 2.0 + 0.5 * 4.0) / 2.5), (1, (0.5 * 4.0 + 8.0 + 16.0) / 2.5)] {
            // Three products and two sums, each rounded to f32.
            assert!((p.texel(1, x, 0)[0] - want).abs() < 1e-5, "{x}");
        }
        assert_eq!(p.levels(), 3);
    }

    // Row 41: sRGB is averaged in linear light.
    #[test]
    fn row_41_srgb_averages_light_not_codes() {
        let v = vec![0, 0, 0, 255, 255, 255];
        let p = Pyramid::new(&Image::new(2, 1, 3, Pixels::U8(v), Encoding::Srgb).unwrap(), true);
        // Half the light of white, rounded to 16 bits; the mean of the codes would be 0.214.
        assert!((p.texel(1, 0, 0)[0] - 0.5).abs() < 1.0 / 65535.0);
        assert!(p.opaque());
        let v = vec![188u8];
        let p = Pyramid::new(&Image::new(1, 1, 1, Pixels::U8(v), Encoding::Srgb).unwrap(), true);
        // ((188/255 + 0.055)/1.055)^2.4, rounded to 16 bits.
        assert!((p.texel(0, 0, 0)[1] - 0.502_886_5).abs() < 1.0 / 65535.0);
    }

    #[test]
    fn hidden_colour_does_not_bleed() {
        let v = vec![255, 0, 0, 255, 0, 255, 0, 0];
        let i = Image::new(2, 1, 4, Pixels::U8(v), Encoding::Srgb).unwrap();
        let t = Pyramid::new(&i, true).texel(1, 0, 0);
        assert_eq!(&t[..3], &[1.0, 0.0, 0.0]);
        assert!((t[3] - 0.5).abs() < 1e-5);
        // Data is not weighted.
        assert!((Pyramid::new(&i, false).texel(1, 0, 0)[1] - 128.0 / 255.0).abs() < 1e-6);
    }

    #[test]
    fn deep_levels_are_rounded_once() {
        // A ramp whose mean 127.5 would drift upwards if every level were rounded from the one above.
        let v = (0..256 * 256u32).map(|k| (k % 256) as u8).collect();
        let p = Pyramid::new(&Image::new(256, 256, 1, Pixels::U8(v), Encoding::Linear).unwrap(), false);
        let v: Vec<f32> = (0..4).map(|x| p.texel(6, x, 0)[0] * 255.0).collect();
        // Means 31.5, 95.5, ... exactly, then rounded half up.
        assert_eq!(v, [32.0, 96.0, 160.0, 224.0]);
    }

    #[test]
    fn formats_and_channels_agree() {
        for c in 1..=4 {
            let i = image8(9, 6, c);
            let p = Pyramid::new(&i, false);
            assert!(matches!(p.texels(), Texels::Rgba8(_)));
            for (x, y) in [(0, 0), (8, 5), (3, 2)] {
                assert_eq!(p.texel(0, x, y), i.rgba(x, y));
            }
            assert!(p.bytes() <= Pyramid::bytes_for(&i, Rule::default()));
        }
        let i = Image::new(1, 1, 2, Pixels::F32(vec![f32::NAN, f32::INFINITY]), Encoding::Linear).unwrap();
        assert_eq!(Pyramid::new(&i, false).texel(0, 0, 0), [0.0, 0.0, 0.0, 1e30]);
    }

    #[test]
    fn threads_do_not_change_a_bit() {
        let i = image8(201, 130, 4);
        let rule = Rule { srgb: true, weigh_by_alpha: true, ripmap: true };
        let want = format!("{:?}", Pyramid::with(&i, rule));
        for n in [1, 3] {
            let got = Job::builder().threads(n).build().run(|| Pyramid::with(&i, rule));
            assert_eq!(format!("{got:?}"), want, "{n} threads");
        }
    }
}
