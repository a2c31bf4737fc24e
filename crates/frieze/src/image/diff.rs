//! Two pictures compared: max, RMSE, PSNR, FLIP, and the angle between normals.

pub mod flip;
pub mod magma;

use super::{Encoding, Image, Pixels};
use crate::error::{Error, Result};
use crate::job::Job;
use crate::math::exact::{atan2_f64, log_f64, pow};
use rayon::prelude::*;

/// What is measured beside max, RMSE and PSNR.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Threads, memory, cancellation.
    pub job: Job,
    /// LDR-FLIP; HDR-FLIP when both pictures hold linear floats.
    pub flip: bool,
    /// The pictures are normal maps: the angle between them.
    pub normals: bool,
}

/// How two pictures differ.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Whether every value of every channel is the same.
    pub identical: bool,
    /// Pixels in which a value of one picture is no finite number and that of the other is not the same.
    /// They are left out of `rmse` and `psnr`, and make `max` infinite.
    pub not_finite: u64,
    /// Largest difference of two values; 1 is the full range of an integer channel. Values are compared as
    /// they are stored, or as linear light when only one of the two pictures is sRGB.
    pub max: f64,
    /// Root of the mean squared difference, all channels alike.
    pub rmse: f64,
    /// Peak signal to noise ratio in dB for a peak of 1; infinite for identical pictures.
    pub psnr: f64,
    /// Mean FLIP, 0 (the same) to 1.
    pub flip: Option<f64>,
    /// Whether `flip` is HDR-FLIP.
    pub hdr: bool,
    /// The angle between normals, degrees.
    pub angle: Option<Angle>,
    /// Per pixel: FLIP, or the angle (30 degrees and more is 1) when the pictures are normal maps. One
    /// channel of floats, 0 to 1.
    pub map: Option<Image>,
}

/// The angle between normals, degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Angle {
    /// Mean over all pixels.
    pub mean: f64,
    /// Largest.
    pub max: f64,
}

/// The angle that is drawn brightest, degrees.
pub const BRIGHTEST_ANGLE: f64 = 30.0;

/// Compares `b` with the reference `a`.
///
/// # Errors
/// `compare.size` for pictures of different sizes, `compare.normals` for a normal map of less than two
/// channels, and those of the job.
pub fn compare(a: &Image, b: &Image, options: &Options) -> Result<Report> {
    let (w, h) = (a.width(), a.height());
    if (w, h) != (b.width(), b.height()) {
        return Err(Error::input(
            "compare.size",
            format!("the pictures have different sizes: {w}x{h} and {}x{}", b.width(), b.height()),
        )
        .remedy("compare pictures of the same size; `frieze render --size` chooses it"));
    }
    if options.normals && a.channels().min(b.channels()) < 2 {
        return Err(Error::input("compare.normals", "a normal map has two or three channels, this is a grey picture"));
    }
    let (identical, not_finite, max, mse) = values(a, b, &options.job)?;
    let mut report = Report {
        identical,
        not_finite,
        max,
        rmse: mse.sqrt(),
        psnr: if mse > 0.0 { -10.0 * log_f64(mse) / std::f64::consts::LN_10 } else { f64::INFINITY },
        flip: None,
        hdr: false,
        angle: None,
        map: None,
    };
    if options.flip {
        let (map, hdr) = flip::map(a, b, &options.job)?;
        report.flip = Some(mean(&map, w));
        report.hdr = hdr;
        report.map = Some(Image::new(w, h, 1, Pixels::F32(map), Encoding::Linear)?);
    }
    if options.normals {
        let map = angles(a, b, &options.job)?;
        let max = map.iter().fold(0.0, |m, v| f64::max(m, f64::from(*v)));
        report.angle = Some(Angle { mean: mean(&map, w), max });
        let scaled = map.iter().map(|v| (v / BRIGHTEST_ANGLE as f32).min(1.0)).collect();
        report.map = Some(Image::new(w, h, 1, Pixels::F32(scaled), Encoding::Linear)?);
    }
    Ok(report)
}

/// A map of 0 to 1 as a picture in the colours of magma: black, purple, orange, pale yellow.
pub fn heat(map: &Image) -> Image {
    let (w, h) = (map.width(), map.height());
    let mut pixels = Vec::with_capacity(w as usize * h as usize * 3);
    for y in 0..h {
        for x in 0..w {
            pixels.extend(magma::color(map.value(x, y, 0)));
        }
    }
    Image::new(w, h, 3, Pixels::U8(pixels), Encoding::Srgb).expect("three channels of the size of a picture")
}

/// The mean of a map: rows first, then their sums, in f64.
fn mean(map: &[f32], w: u32) -> f64 {
    let rows = map.chunks_exact(w as usize).map(|row| row.iter().map(|v| f64::from(*v)).sum::<f64>());
    rows.sum::<f64>() / map.len() as f64
}

/// Whether all values are the same, pixels with odd values, the largest difference, the mean squared one.
fn values(a: &Image, b: &Image, job: &Job) -> Result<(bool, u64, f64, f64)> {
    let same_kind = a.channels() == b.channels();
    let channels = if same_kind { a.channels() } else { 4 };
    let light = a.encoding != b.encoding;
    let read = |image: &Image, x, y| -> [f32; 4] {
        let mut v = if same_kind {
            core::array::from_fn(|c| if c < channels { image.value(x, y, c) } else { 0.0 })
        } else {
            image.rgba(x, y)
        };
        if light && image.encoding == Encoding::Srgb {
            let colors = if channels % 2 == 0 { channels - 1 } else { channels };
            v[..colors].iter_mut().for_each(|v| *v = from_srgb(*v));
        }
        v
    };
    let rows: Vec<(u64, f64, f64)> = job.run(|| {
        (0..a.height())
            .into_par_iter()
            .map(|y| {
                let (mut odd, mut max, mut sum) = (0, 0.0f64, 0.0);
                for x in 0..a.width() {
                    let (p, q) = (read(a, x, y), read(b, x, y));
                    let mut pixel_is_odd = false;
                    for (p, q) in p.into_iter().zip(q).take(channels) {
                        if p.is_finite() && q.is_finite() {
                            let d = f64::from(p) - f64::from(q);
                            max = max.max(d.abs());
                            sum += d * d;
                        } else if p != q && !(p.is_nan() && q.is_nan()) {
                            pixel_is_odd = true;
                        }
                    }
                    odd += u64::from(pixel_is_odd);
                }
                (odd, max, sum)
            })
            .collect()
    });
    job.check()?;
    let (mut odd, mut max, mut sum) = (0, 0.0f64, 0.0);
    for (o, m, s) in rows {
        odd += o;
        max = max.max(m);
        sum += s;
    }
    let count = (f64::from(a.width()) * f64::from(a.height()) - odd as f64) * channels as f64;
    let mse = if sum > 0.0 { sum / count } else { 0.0 };
    Ok((odd == 0 && max == 0.0, odd, if odd > 0 { f64::INFINITY } else { max }, mse))
}

/// sRGB to linear (IEC 61966-2-1).
fn from_srgb(v: f32) -> f32 {
    if v <= 0.04045 { v / 12.92 } else { pow((v + 0.055) / 1.055, 2.4) }
}

/// The angle between the normals of each pixel, degrees.
fn angles(a: &Image, b: &Image, job: &Job) -> Result<Vec<f32>> {
    let signed = [is_signed(a), is_signed(b)];
    let w = a.width() as usize;
    let _room = job.reserve(w as u64 * u64::from(a.height()) * 4, "the angles")?;
    let mut map = vec![0.0f32; w * a.height() as usize];
    job.run(|| {
        map.par_chunks_exact_mut(w).enumerate().for_each(|(y, row)| {
            for (x, out) in row.iter_mut().enumerate() {
                let n = normal(a, x as u32, y as u32, signed[0]);
                let m = normal(b, x as u32, y as u32, signed[1]);
                *out = angle(n, m) as f32;
            }
        });
    });
    job.check()?;
    Ok(map)
}

/// Floats with a negative value hold x, y, z as they are; all else holds (n + 1) / 2.
pub(crate) fn is_signed(image: &Image) -> bool {
    match image.pixels() {
        Pixels::F32(v) => v.iter().any(|v| *v < 0.0),
        Pixels::F16(v) => v.iter().any(|v| v.to_f32() < 0.0),
        _ => false,
    }
}

/// The normal of a texel, not of unit length; z is rebuilt where there are two channels.
pub(crate) fn normal(image: &Image, x: u32, y: u32, signed: bool) -> [f64; 3] {
    let read = |c| {
        let v = f64::from(image.value(x, y, c));
        if signed { v } else { 2.0 * v - 1.0 }
    };
    let (nx, ny) = (read(0), read(1));
    let nz = if image.channels() == 2 { (1.0 - nx * nx - ny * ny).max(0.0).sqrt() } else { read(2) };
    [nx, ny, nz]
}

/// The angle between two vectors in degrees, by way of sine and cosine, so that small ones are exact. A
/// vector without length stands at 90 degrees to every other.
fn angle(n: [f64; 3], m: [f64; 3]) -> f64 {
    if n == m {
        return 0.0;
    }
    let cross = [n[1] * m[2] - n[2] * m[1], n[2] * m[0] - n[0] * m[2], n[0] * m[1] - n[1] * m[0]];
    let dot = n[0] * m[0] + n[1] * m[1] + n[2] * m[2];
    let sine = (cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]).sqrt();
    if !(sine > 0.0 || dot != 0.0) {
        return 90.0;
    }
    atan2_f64(sine, dot) * (180.0 / std::f64::consts::PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(v: &[u8]) -> Image {
        Image::new(v.len() as u32, 1, 1, Pixels::U8(v.to_vec()), Encoding::Srgb).unwrap()
    }

    #[test]
    fn identical_pictures_have_no_noise() {
        let a = grey(&[0, 10, 255]);
        let r = compare(&a, &a, &Options { flip: true, ..Options::default() }).unwrap();
        assert!(r.identical && r.psnr == f64::INFINITY && r.max == 0.0 && r.rmse == 0.0 && r.flip == Some(0.0));
    }

    #[test]
    fn max_rmse_and_psnr_of_known_differences() {
        let r = compare(&grey(&[0, 0, 0, 0]), &grey(&[0, 51, 0, 0]), &Options::default()).unwrap();
        // 51 / 255 = 0.2; one of four pixels. The values are rounded to f32 once.
        assert!((r.max - 0.2).abs() < 1e-7 && (r.rmse - 0.1).abs() < 1e-7 && (r.psnr - 20.0).abs() < 1e-5);
        assert!(!r.identical);
    }

    #[test]
    fn sizes_must_agree() {
        let e = compare(&grey(&[0, 0]), &grey(&[0]), &Options::default()).unwrap_err();
        assert_eq!((e.code, e.fault.exit_code()), ("compare.size", 3));
    }

    #[test]
    fn a_nan_on_one_side_is_no_equality() {
        let image = |v: f32| Image::new(2, 1, 1, Pixels::F32(vec![v, 1.0]), Encoding::Linear).unwrap();
        let r = compare(&image(f32::NAN), &image(0.5), &Options { flip: true, ..Options::default() }).unwrap();
        assert!(!r.identical && r.not_finite == 1 && r.max == f64::INFINITY && r.rmse == 0.0);
        assert!(r.flip.unwrap().is_finite());
        assert!(compare(&image(f32::NAN), &image(f32::NAN), &Options::default()).unwrap().identical);
    }

    #[test]
    fn normals_are_compared_by_angle() {
        let image = |n: [f32; 3]| Image::new(1, 1, 3, Pixels::F32(n.to_vec()), Encoding::Linear).unwrap();
        let options = Options { normals: true, ..Options::default() };
        // A tenth of a degree, which an arc cosine of f32 could not see; signed floats, any length.
        let (s, c) = crate::math::exact::sin_cos_f64(0.1f64.to_radians());
        let r = compare(&image([-1e-9, 0.0, 1.0]), &image([-s as f32 * 2.0, 0.0, c as f32 * 2.0]), &options).unwrap();
        let angle = r.angle.unwrap();
        // The components are rounded to f32.
        assert!((angle.mean - 0.1).abs() < 1e-6 && (angle.max - 0.1).abs() < 1e-6, "{angle:?}");
        // Two channels: z is rebuilt.
        let two = Image::new(1, 1, 2, Pixels::F32(vec![0.5, 0.5]), Encoding::Linear).unwrap();
        let r = compare(&two, &image([0.5, 0.5, 1.0]), &options).unwrap();
        assert!(r.angle.unwrap().max < 1e-6);
        let grey = Image::new(1, 1, 1, Pixels::F32(vec![0.5]), Encoding::Linear).unwrap();
        assert_eq!(compare(&grey, &grey, &options).unwrap_err().code, "compare.normals");
    }

    #[test]
    fn one_srgb_and_one_linear_picture_are_compared_as_light() {
        let srgb = Image::new(1, 1, 1, Pixels::U8(vec![188]), Encoding::Srgb).unwrap();
        let light = Image::new(1, 1, 1, Pixels::F32(vec![from_srgb(188.0 / 255.0)]), Encoding::Linear).unwrap();
        assert_eq!(compare(&srgb, &light, &Options::default()).unwrap().max, 0.0);
    }
}
