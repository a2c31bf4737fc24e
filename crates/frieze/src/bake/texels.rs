//! Rows of numbers out of a picture, and into one of any depth.

use crate::error::{Error, Result};
use crate::image::{Encoding, Image, Pixels};
use crate::job::Job;
use crate::math::lane::{Int, Kernel, Lane, Level, Mask, Num};
use crate::scene::material::Channel;
use half::f16;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Largest magnitude of a number that is read: slopes and their squares stay finite.
const MOST: f32 = 1e18;

/// What the texels of a new map are stored in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// 8 bits, dithered unless that is switched off.
    U8,
    /// 16 bits, rounded.
    U16,
    /// Half floats.
    F16,
    /// Single floats.
    F32,
}

impl Depth {
    /// Bytes per value.
    pub fn bytes(self) -> u64 {
        match self {
            Depth::U8 => 1,
            Depth::U16 | Depth::F16 => 2,
            Depth::F32 => 4,
        }
    }
    /// Whether numbers are stored as they are, and not as shares of a range.
    pub fn is_float(self) -> bool {
        matches!(self, Depth::F16 | Depth::F32)
    }
}

/// One number per texel of a picture, as a field that is read row by row.
#[derive(Clone, Copy, Debug)]
pub struct Field<'a> {
    image: &'a Image,
    channel: Channel,
}

impl<'a> Field<'a> {
    /// One channel of a picture, its luminance or the length of its RGB (row 75), read as data: no sRGB curve is
    /// undone.
    ///
    /// # Errors
    /// `convert.channel` for a channel that the picture lacks.
    pub fn new(image: &'a Image, channel: Channel) -> Result<Self> {
        let has = match channel {
            Channel::A => image.channels().is_multiple_of(2),
            _ => true,
        };
        if !has {
            return Err(Error::arguments("convert.channel", "the picture has no alpha channel")
                .remedy("choose another --channel"));
        }
        Ok(Field { image, channel })
    }
    /// The picture.
    pub fn image(&self) -> &'a Image {
        self.image
    }
    /// What [`Field::codes`] are multiplied with to be values, full range 1 (1 for floats).
    pub fn unit(&self) -> f32 {
        match self.image.pixels() {
            Pixels::U8(_) => 1.0 / 255.0,
            Pixels::U16(_) => 1.0 / 65535.0,
            Pixels::F16(_) | Pixels::F32(_) => 1.0,
        }
    }
    /// Row `y` as it is stored: integers as whole numbers, so that their differences are exact. `out` has the
    /// picture's width. NaN becomes 0, and magnitudes end at 1e18; the number of such texels is returned.
    #[inline(always)]
    pub fn codes(&self, y: usize, out: &mut [f32]) -> u64 {
        let (w, n) = (self.image.width() as usize, self.image.channels());
        let row = y * w * n..(y + 1) * w * n;
        let out = &mut out[..w];
        match self.image.pixels() {
            Pixels::U8(v) => self.take(&v[row], n, out, f32::from),
            Pixels::U16(v) => self.take(&v[row], n, out, f32::from),
            Pixels::F16(v) => self.take(&v[row], n, out, f16::to_f32),
            Pixels::F32(v) => self.take(&v[row], n, out, |v| v),
        }
        if matches!(self.image.pixels(), Pixels::U8(_) | Pixels::U16(_)) {
            return 0;
        }
        let mut bad = 0;
        for v in out {
            if v.is_nan() || v.abs() > MOST {
                bad += 1;
                *v = if v.is_nan() { 0.0 } else { MOST.copysign(*v) };
            }
        }
        bad
    }
    #[inline(always)]
    fn take<T: Copy>(&self, row: &[T], n: usize, out: &mut [f32], number: impl Fn(T) -> f32) {
        let color = n >= 3;
        let c = match self.channel {
            Channel::R => 0,
            // Grey stands for all three.
            Channel::G => usize::from(color),
            Channel::B => 2 * usize::from(color),
            Channel::A => n - 1,
            Channel::Luminance if color => {
                for (o, p) in out.iter_mut().zip(row.chunks_exact(n)) {
                    *o = number(p[0]) * 0.2126 + number(p[1]) * 0.7152 + number(p[2]) * 0.0722;
                }
                return;
            }
            Channel::RgbNorm => {
                for (o, p) in out.iter_mut().zip(row.chunks_exact(n)) {
                    let k = usize::from(color);
                    let [r, g, b] = [number(p[0]), number(p[k]), number(p[2 * k])];
                    *o = (r * r + g * g + b * b).sqrt();
                }
                return;
            }
            Channel::Luminance => 0,
        };
        if n == 1 {
            out.iter_mut().zip(row).for_each(|(o, v)| *o = number(*v));
        } else {
            out.iter_mut().zip(row.chunks_exact(n)).for_each(|(o, p)| *o = number(p[c]));
        }
    }
    /// Whether all values are the same, and how many are no numbers. Integers are looked at until two differ.
    ///
    /// # Errors
    /// `job.interrupted`.
    pub fn survey(&self, job: &Job) -> Result<(bool, u64)> {
        let w = self.image.width() as usize;
        let integers = matches!(self.image.pixels(), Pixels::U8(_) | Pixels::U16(_));
        let mut row = vec![0.0f32; w];
        let (mut first, mut flat, mut bad) = (None, true, 0);
        for y in 0..self.image.height() as usize {
            job.check()?;
            bad += self.codes(y, &mut row);
            let first = *first.get_or_insert(row[0]);
            flat = flat && row.iter().all(|v| *v == first);
            if integers && !flat {
                break;
            }
        }
        Ok((flat, bad))
    }
}

/// How a new map is stored.
#[derive(Clone, Copy, Debug)]
pub struct Store {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Values per texel, 1 to 4.
    pub channels: u8,
    /// What a value is stored in.
    pub depth: Depth,
    /// Integers of 8 bits get noise before they are rounded, so that slow ramps keep their mean instead of stepping.
    pub dither: bool,
    /// Of the noise.
    pub seed: u64,
}

/// Rows of numbers that a map is made of.
pub trait Rows: Sync {
    /// What one thread keeps from row to row.
    type Scratch;
    /// Empty.
    fn scratch(&self) -> Self::Scratch;
    /// Row `y`, one slice per channel, each at least as long as the map is wide, rounded up to 16. For integers 0 ..= 1
    /// is the full range; what lies outside is clamped.
    fn fill(&self, level: Level, scratch: &mut Self::Scratch, y: usize, out: &mut [Vec<f32>]);
}

/// Rows per band.
const BAND: usize = 32;

/// Makes a picture of rows, bands side by side; the result depends on neither threads nor level. Returns the number of
/// values that did not fit an integer's range too.
///
/// # Errors
/// `job.memory`, `job.interrupted`.
pub fn make(rows: &impl Rows, store: &Store, job: &Job, level: Level) -> Result<(Image, u64)> {
    let (w, h, n) = (store.width as usize, store.height as usize, usize::from(store.channels));
    let bytes = (w * h * n) as u64 * store.depth.bytes();
    let _held = job.reserve(bytes, format_args!("a map of {w}x{h}"))?;
    let clamped = AtomicU64::new(0);
    let done = AtomicU64::new(0);
    let counts = [&clamped, &done];
    let pixels = match store.depth {
        Depth::U8 if store.dither => Pixels::U8(bands(rows, store, job, level, counts, Dithered(store.seed))),
        Depth::U8 => Pixels::U8(bands(rows, store, job, level, counts, Rounded)),
        Depth::U16 => Pixels::U16(bands(rows, store, job, level, counts, Rounded)),
        Depth::F16 => Pixels::F16(bands(rows, store, job, level, counts, Rounded)),
        Depth::F32 => Pixels::F32(bands(rows, store, job, level, counts, Rounded)),
    };
    job.check()?;
    Ok((Image::new(store.width, store.height, store.channels, pixels, Encoding::Linear)?, clamped.load(Relaxed)))
}

fn bands<T: Default + Copy + Send, P: Put<T>>(
    rows: &impl Rows,
    store: &Store,
    job: &Job,
    level: Level,
    [clamped, done]: [&AtomicU64; 2],
    put: P,
) -> Vec<T> {
    let (w, n) = (store.width as usize, usize::from(store.channels));
    let mut out = vec![T::default(); w * n * store.height as usize];
    job.run(|| {
        out.par_chunks_mut(w * n * BAND).enumerate().for_each(|(k, band)| {
            if job.is_cancelled() {
                return;
            }
            let mut scratch = rows.scratch();
            let mut planes = vec![vec![0.0f32; w.next_multiple_of(16)]; n];
            for (y, out) in (k * BAND..).zip(band.chunks_exact_mut(w * n)) {
                rows.fill(level, &mut scratch, y, &mut planes);
                clamped.fetch_add(level.run(PutRow { put, y, planes: &planes, out }), Relaxed);
            }
            let done = done.fetch_add(1, Relaxed) + 1;
            job.progress("convert", (done * BAND as u64).min(store.height.into()), store.height.into());
        });
    });
    out
}

struct PutRow<'a, T, P> {
    put: P,
    y: usize,
    planes: &'a [Vec<f32>],
    out: &'a mut [T],
}

impl<T, P: Put<T>> Kernel for PutRow<'_, T, P> {
    type Out = u64;
    #[inline(always)]
    fn run<L: Lane>(self, l: L) -> u64 {
        self.put.row(l, self.y, self.planes, self.planes.len(), self.out)
    }
}

/// How numbers become what is stored.
trait Put<T>: Copy + Sync + Send {
    /// A row; returns how many values were clamped.
    fn row<L: Lane>(self, l: L, y: usize, planes: &[Vec<f32>], n: usize, out: &mut [T]) -> u64;
}

#[derive(Clone, Copy)]
struct Rounded;

#[derive(Clone, Copy)]
struct Dithered(u64);

/// `round(most v)`, halves up, as [`quantize`](crate::map::normal::quantize) does, and how many values lay outside.
#[inline(always)]
fn quantized<L: Lane>(
    l: L,
    values: &[f32],
    most: f32,
    codes: &mut [[i32; 16]; 4],
    c: usize,
    dither: Option<&[f32; 16]>,
) -> u32 {
    let mut outside = 0;
    for k in (0..16).step_by(L::WIDTH) {
        let v = l.load(&values[k..]);
        let inside = v.ge(l.f(0.0)) & v.le(l.f(1.0));
        if !inside.all() {
            outside += (L::WIDTH as u32) - inside.bits().count_ones();
        }
        let v = v.saturate() * most + 0.5;
        let v = match dither {
            Some(d) => (v + l.load(&d[k..])).clamp(0.0, most),
            None => v,
        };
        v.to_int().store(&mut codes[c][k..]);
    }
    outside
}

macro_rules! put_integers {
    ($T:ty, $most:expr, $Put:ty, |$self:ident, $c:ident, $x:ident, $y:ident| $noise:expr) => {
        impl Put<$T> for $Put {
            #[inline(always)]
            fn row<L: Lane>(self, l: L, $y: usize, planes: &[Vec<f32>], n: usize, out: &mut [$T]) -> u64 {
                let $self = self;
                let mut codes = [[0i32; 16]; 4];
                let mut clamped = 0u64;
                for (k, part) in out.chunks_mut(16 * n).enumerate() {
                    for $c in 0..n {
                        let $x = 16 * k;
                        let noise: Option<[f32; 16]> = $noise;
                        clamped +=
                            u64::from(quantized(l, &planes[$c][16 * k..], $most, &mut codes, $c, noise.as_ref()));
                    }
                    match n {
                        1 => part.iter_mut().zip(&codes[0]).for_each(|(o, v)| *o = *v as $T),
                        3 => part
                            .chunks_exact_mut(3)
                            .zip(&codes[0])
                            .zip(&codes[1])
                            .zip(&codes[2])
                            .for_each(|(((o, r), g), b)| (o[0], o[1], o[2]) = (*r as $T, *g as $T, *b as $T)),
                        _ => part.chunks_exact_mut(n).enumerate().for_each(|(x, o)| {
                            o.iter_mut().zip(&codes).for_each(|(o, c)| *o = c[x] as $T);
                        }),
                    }
                }
                clamped
            }
        }
    };
}
put_integers!(u8, 255.0, Rounded, |_s, _c, _x, _y| None);
put_integers!(u16, 65535.0, Rounded, |_s, _c, _x, _y| None);
put_integers!(u8, 255.0, Dithered, |s, c, x, y| Some(noise(s.0, c, x, y)));

/// High-pass triangular noise for the texels from `x` on, between -1 and 1 of a code: the difference of two
/// neighbours of a hash, so that the noise has no low frequencies along a row (Lipshitz, Wannamaker and Vanderkooy 1992,
/// "Quantization and dither: a theoretical survey", section 6).
#[inline(always)]
fn noise(seed: u64, channel: usize, x: usize, y: usize) -> [f32; 16] {
    let key = (seed as u32) ^ ((seed >> 32) as u32).wrapping_mul(0x85eb_ca6b);
    let key = hash(key ^ (channel as u32).wrapping_mul(0x9e37_79b9) ^ hash(y as u32));
    let at = |x: u32| (hash(key ^ x) >> 8) as f32 * (1.0 / 16_777_216.0);
    let mut out = [0.0; 16];
    for (k, o) in out.iter_mut().enumerate() {
        let x = (x + k) as u32;
        *o = at(x + 1) - at(x);
    }
    out
}

/// A good mix of 32 bits (C. Wellons, "lowbias32").
#[inline(always)]
fn hash(mut x: u32) -> u32 {
    x = (x ^ x >> 16).wrapping_mul(0x7feb_352d);
    x = (x ^ x >> 15).wrapping_mul(0x846c_a68b);
    x ^ x >> 16
}

impl Put<f32> for Rounded {
    #[inline(always)]
    fn row<L: Lane>(self, _: L, _: usize, planes: &[Vec<f32>], n: usize, out: &mut [f32]) -> u64 {
        for (c, plane) in planes.iter().enumerate() {
            out.iter_mut().skip(c).step_by(n).zip(plane).for_each(|(o, v)| *o = *v + 0.0);
        }
        0
    }
}

impl Put<f16> for Rounded {
    #[inline(always)]
    fn row<L: Lane>(self, _: L, _: usize, planes: &[Vec<f32>], n: usize, out: &mut [f16]) -> u64 {
        for (c, plane) in planes.iter().enumerate() {
            out.iter_mut()
                .skip(c)
                .step_by(n)
                .zip(plane)
                .for_each(|(o, v)| *o = f16::from_f32(v.clamp(-65504.0, 65504.0) + 0.0));
        }
        0
    }
}
