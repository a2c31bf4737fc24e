//! FLIP: how different two pictures look when they alternate in place. Andersson et al., "FLIP: A
//! Difference Evaluator for Alternating Images", HPG 2020; for floats Andersson et al., "Visualizing Errors
//! in Rendered High Dynamic Range Images", Eurographics 2021. Symbols are theirs.
//!
//! All filters are sums of separable Gaussians, so a band of rows is filtered along rows first and then
//! along columns. Sums run in one order whatever the threads, so the map has the same bits everywhere.

use super::from_srgb;
use crate::error::Result;
use crate::image::{Encoding, Image, Pixels};
use crate::job::Job;
use crate::math::exact::{exp_f64, exp2, log2, pow};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Pixels per degree of the observer: 0.7 m away from a screen 0.7 m and 3840 pixels wide.
pub const PIXELS_PER_DEGREE: f64 = 3840.0 * PI / 180.0;

/// Rows that one task filters.
const BAND: usize = 64;

/// D65, as the papers round it.
const WHITE: [f32; 3] = [0.950_428_55, 1.0, 1.088_900_4];

/// FLIP per pixel, 0 to 1, and whether it is HDR-FLIP (both pictures hold linear floats). `a` is the
/// reference. Transparent pixels are seen on middle grey.
///
/// # Errors
/// Those of the job.
pub fn map(a: &Image, b: &Image, job: &Job) -> Result<(Vec<f32>, bool)> {
    let float = |i: &Image| matches!(i.pixels(), Pixels::F16(_) | Pixels::F32(_)) && i.encoding == Encoding::Linear;
    let hdr = float(a) && float(b);
    let len = a.width() as usize * a.height() as usize;
    let _room = job.reserve(len as u64 * if hdr { 12 } else { 4 }, "the FLIP map")?;
    let filters = Filters::new();
    if !hdr {
        return Ok((ldr(a, b, None, &filters, job)?, false));
    }
    let (start, stop) = exposures(a);
    // Steps of about one stop.
    let count = ((stop - start).ceil() as u32).max(2);
    let step = (stop - start) / (count - 1) as f32;
    let mut worst = vec![0.0f32; len];
    for k in 0..count {
        job.progress("compare", u64::from(k), u64::from(count));
        let map = ldr(a, b, Some(exp2(start + step * k as f32)), &filters, job)?;
        for (worst, v) in worst.iter_mut().zip(map) {
            *worst = worst.max(v);
        }
    }
    Ok((worst, true))
}

/// The shortest and the longest exposure (log2) of the reference: those that take its maximum and its
/// median luminance to 0.85 under the ACES curve.
pub fn exposures(reference: &Image) -> (f32, f32) {
    let [a, b, c, d, e, f] = ACES;
    let t = 0.85;
    let (a, b, c) = (a - t * d, b - t * e, c - t * f);
    let half = -0.5 * (b / a);
    let x = half + (half * half - c / a).sqrt();
    let mut luminance = Vec::new();
    for y in 0..reference.height() {
        for px in 0..reference.width() {
            let [r, g, b] = light(reference, px, y);
            luminance.push(0.2126 * r + 0.7152 * g + 0.0722 * b);
        }
    }
    let middle = luminance.len() / 2;
    let (_, median, above) = luminance.select_nth_unstable_by(middle, f32::total_cmp);
    let median = median.max(f32::EPSILON);
    let max = above.iter().fold(median, |m, v| m.max(*v));
    (log2(x / max), log2(x / median))
}

/// Knarkowicz's fit of ACES without its pre-exposure: `(a x² + b x + c) / (d x² + e x + f)`.
const ACES: [f32; 6] = [0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.0, 0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14];

/// A pixel as linear light, finite and not negative.
fn light(image: &Image, x: u32, y: u32) -> [f32; 3] {
    let [r, g, b, alpha] = image.rgba(x, y);
    let alpha = if alpha.is_nan() { 0.0 } else { alpha.clamp(0.0, 1.0) };
    [r, g, b].map(|v| {
        let v = if image.encoding == Encoding::Srgb { from_srgb(v) } else { v };
        // A NaN is black; an infinity is brighter than any exposure shows. 1e15: its square is an f32.
        let v = if v.is_nan() { 0.0 } else { v.clamp(0.0, 1e15) };
        if alpha < 1.0 { v * alpha + 0.18 * (1.0 - alpha) } else { v }
    })
}

/// The kernels, each normalised, from -radius to radius.
struct Filters {
    /// Contrast sensitivity: achromatic, red-green, and the two Gaussians of blue-yellow.
    sensitivity: [Vec<f32>; 4],
    /// Of a feature: the Gaussian, its first derivative (edges) and its second (points).
    feature: [Vec<f32>; 3],
}

impl Filters {
    fn new() -> Self {
        let ppd = PIXELS_PER_DEGREE;
        // Radius: three standard deviations of the widest Gaussian.
        let radius = (3.0 * (0.04 / (2.0 * PI * PI)).sqrt() * ppd).ceil() as i32;
        let gauss = |b: f64| -> Vec<f64> {
            (-radius..=radius)
                .map(|x| {
                    let x = f64::from(x) / ppd;
                    exp_f64(-PI * PI * x * x / b)
                })
                .collect()
        };
        // Both passes of Gaussian k together weigh a_k sqrt(pi / b_k) S_k² / total.
        let sensitivity = |terms: &[(f64, f64)]| -> Vec<Vec<f32>> {
            let kernels: Vec<(f64, Vec<f64>)> = terms.iter().map(|(a, b)| (a * (PI / b).sqrt(), gauss(*b))).collect();
            let total: f64 = kernels.iter().map(|(a, g)| a * g.iter().sum::<f64>() * g.iter().sum::<f64>()).sum();
            kernels.iter().map(|(a, g)| g.iter().map(|v| (v * (a / total).sqrt()) as f32).collect()).collect()
        };
        let mut all = sensitivity(&[(1.0, 0.0047)]);
        all.extend(sensitivity(&[(1.0, 0.0053)]));
        all.extend(sensitivity(&[(34.1, 0.04), (13.5, 0.025)]));

        // Standard deviation: half of the 0.082 degrees between peak and trough.
        let sd = 0.5 * 0.082 * ppd;
        let radius = (3.0 * sd).ceil() as i32;
        let weights = |f: &dyn Fn(f64) -> f64| -> Vec<f32> {
            let w: Vec<f64> = (-radius..=radius)
                .map(|x| {
                    let x = f64::from(x);
                    f(x) * exp_f64(-x * x / (2.0 * sd * sd))
                })
                .collect();
            // Positive weights sum to 1, negative ones to -1.
            let positive: f64 = w.iter().filter(|v| **v > 0.0).sum();
            let negative: f64 = -w.iter().filter(|v| **v < 0.0).sum::<f64>();
            w.iter()
                .map(|v| (if *v > 0.0 { v / positive } else { v / negative.max(f64::MIN_POSITIVE) }) as f32)
                .collect()
        };
        Filters {
            sensitivity: all.try_into().expect("four Gaussians"),
            feature: [weights(&|_| 1.0), weights(&|x| -x), weights(&|x| x * x / (sd * sd) - 1.0)],
        }
    }
}

/// LDR-FLIP of two pictures, or of two floats pictures at an exposure (a factor).
fn ldr(a: &Image, b: &Image, exposure: Option<f32>, filters: &Filters, job: &Job) -> Result<Vec<f32>> {
    let (w, h) = (a.width() as usize, a.height() as usize);
    let mut map = vec![0.0f32; w * h];
    let scale = Scale::new();
    job.run(|| {
        map.par_chunks_mut(w * BAND).enumerate().for_each(|(k, out)| {
            if job.is_cancelled() {
                return;
            }
            let first = k * BAND;
            let rows = out.len() / w;
            let [a, b] = [a, b].map(|image| Band::new(image, exposure, filters, first, rows));
            let mut columns = [Columns::new(w), Columns::new(w)];
            for (y, out) in out.chunks_exact_mut(w).enumerate() {
                a.columns(y, filters, &mut columns[0]);
                b.columns(y, filters, &mut columns[1]);
                for (x, out) in out.iter_mut().enumerate() {
                    *out = scale.error(&columns[0], &columns[1], x);
                }
            }
        });
    });
    job.check()?;
    Ok(map)
}

/// Some rows of a picture and those around them, filtered along rows.
struct Band {
    /// Rows above the first one asked for.
    above: usize,
    /// Seven planes of `rows + 2 above` rows: Y, Cx, Cz (twice) of contrast sensitivity, and Y of features
    /// under the Gaussian and its derivatives.
    planes: [Vec<f32>; 7],
    w: usize,
}

impl Band {
    fn new(image: &Image, exposure: Option<f32>, filters: &Filters, first: usize, rows: usize) -> Self {
        let (w, h) = (image.width() as usize, image.height() as usize);
        let above = filters.sensitivity[0].len().max(filters.feature[0].len()) / 2;
        let count = rows + 2 * above;
        let mut planes: [Vec<f32>; 7] = core::array::from_fn(|_| vec![0.0; count * w]);
        // One row of Y, Cx, Cz with its edge values repeated to both sides.
        let mut padded: [Vec<f32>; 3] = core::array::from_fn(|_| vec![0.0; w + 2 * above]);
        let mut luminance = vec![0.0; w + 2 * above];
        for k in 0..count {
            let y = (first + k).saturating_sub(above).min(h - 1);
            if (first + k > above) && first + k - above < h || k == 0 {
                for x in 0..w {
                    let mut c = light(image, x as u32, y as u32);
                    if let Some(e) = exposure {
                        c = c.map(|v| tone_map(v * e));
                    }
                    let [py, cx, cz] = opponent(c);
                    padded[0][above + x] = py;
                    padded[1][above + x] = cx;
                    padded[2][above + x] = cz;
                    luminance[above + x] = (py + 16.0) / 116.0;
                }
                for row in padded.iter_mut().chain([&mut luminance]) {
                    let (l, r) = (row[above], row[above + w - 1]);
                    row[..above].fill(l);
                    row[above + w..].fill(r);
                }
            }
            let at = k * w..(k + 1) * w;
            for (p, (source, kernel)) in [(0, 0), (1, 1), (2, 2), (2, 3)].into_iter().enumerate() {
                along_row(&padded[source], &filters.sensitivity[kernel], above, &mut planes[p][at.clone()]);
            }
            for (p, kernel) in filters.feature.iter().enumerate() {
                along_row(&luminance, kernel, above, &mut planes[4 + p][at.clone()]);
            }
        }
        Band { above, planes, w }
    }

    /// Filters along columns to the finished row `y` of the band.
    fn columns(&self, y: usize, filters: &Filters, out: &mut Columns) {
        out.0.iter_mut().for_each(|row| row.fill(0.0));
        let [by0, by1] = [2, 3];
        for (plane, kernel, to) in [(0, 0, 0), (1, 1, 1), (by0, 2, 2), (by1, 3, 2)] {
            self.along_column(plane, y, &filters.sensitivity[kernel], &mut out.0[to]);
        }
        let [smooth, edge, point] = &filters.feature;
        for (plane, kernel, to) in [(5, smooth, 3), (4, edge, 4), (6, smooth, 5), (4, point, 6)] {
            self.along_column(plane, y, kernel, &mut out.0[to]);
        }
    }

    fn along_column(&self, plane: usize, y: usize, kernel: &[f32], out: &mut [f32]) {
        let top = self.above - kernel.len() / 2 + y;
        for (k, weight) in kernel.iter().enumerate() {
            let row = &self.planes[plane][(top + k) * self.w..][..self.w];
            for (out, v) in out.iter_mut().zip(row) {
                *out += v * weight;
            }
        }
    }
}

fn along_row(padded: &[f32], kernel: &[f32], above: usize, out: &mut [f32]) {
    let left = above - kernel.len() / 2;
    for (k, weight) in kernel.iter().enumerate() {
        for (out, v) in out.iter_mut().zip(&padded[left + k..]) {
            *out += v * weight;
        }
    }
}

/// A finished row: Y, Cx, Cz, edges along x and y, points along x and y.
struct Columns([Vec<f32>; 7]);

impl Columns {
    fn new(w: usize) -> Self {
        Columns(core::array::from_fn(|_| vec![0.0; w]))
    }
    /// The filtered colour, within the gamut, in Hunt-adjusted L*a*b*.
    fn color(&self, x: usize) -> [f32; 3] {
        let [y, cx, cz] = [self.0[0][x], self.0[1][x], self.0[2][x]];
        let fy = (y + 16.0) / 116.0;
        let xyz = [fy + cx / 500.0, fy, fy - cz / 200.0];
        hunt(lab(to_rgb([xyz[0] * WHITE[0], xyz[1] * WHITE[1], xyz[2] * WHITE[2]]).map(|v| v.clamp(0.0, 1.0))))
    }
    fn edge(&self, x: usize) -> f32 {
        let (a, b) = (self.0[3][x], self.0[4][x]);
        (a * a + b * b).sqrt()
    }
    fn point(&self, x: usize) -> f32 {
        let (a, b) = (self.0[5][x], self.0[6][x]);
        (a * a + b * b).sqrt()
    }
}

/// The largest colour difference, which scales all others.
struct Scale {
    max: f32,
}

impl Scale {
    fn new() -> Self {
        let of = |c| hunt(lab(c));
        Scale { max: pow(hyab(of([0.0, 1.0, 0.0]), of([0.0, 0.0, 1.0])), 0.7) }
    }
    /// The error of a pixel: colour difference to the power of 1 - feature difference.
    fn error(&self, a: &Columns, b: &Columns, x: usize) -> f32 {
        // Differences below 0.4 of the largest fill 95 % of the range.
        let d = pow(hyab(a.color(x), b.color(x)), 0.7);
        let knee = 0.4 * self.max;
        let color = if d < knee { 0.95 / knee * d } else { 0.95 + (d - knee) / (self.max - knee) * 0.05 };
        let f = (a.edge(x) - b.edge(x)).abs().max((a.point(x) - b.point(x)).abs());
        let feature = (f * std::f32::consts::FRAC_1_SQRT_2).sqrt();
        pow(color, 1.0 - feature).clamp(0.0, 1.0)
    }
}

fn tone_map(x: f32) -> f32 {
    // Beyond 1e15 the curve is flat at more than 1.
    let x = x.min(1e15);
    let [a, b, c, d, e, f] = ACES;
    (((a * x + b) * x + c) / ((d * x + e) * x + f)).clamp(0.0, 1.0)
}

/// Linear RGB (Rec. 709, D65) to XYZ relative to the white point.
fn xyz([r, g, b]: [f32; 3]) -> [f32; 3] {
    const M: [[f32; 3]; 3] = [
        [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
        [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
        [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
    ];
    core::array::from_fn(|k| (M[k][0] * r + M[k][1] * g + M[k][2] * b) / WHITE[k])
}

/// XYZ to linear RGB: the inverse of the matrix in [`xyz`].
fn to_rgb([x, y, z]: [f32; 3]) -> [f32; 3] {
    [
        3.241_003_3 * x - 1.537_399 * y - 0.498_615_86 * z,
        -0.969_224_3 * x + 1.875_930_1 * y + 0.041_554_224 * z,
        0.055_639_423 * x - 0.204_011_2 * y + 1.057_148_9 * z,
    ]
}

/// Linear RGB to YCxCz.
fn opponent(c: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = xyz(c);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Linear RGB to CIE L*a*b*.
fn lab(c: [f32; 3]) -> [f32; 3] {
    const DELTA: f32 = 6.0 / 29.0;
    let [x, y, z] = xyz(c)
        .map(|v| if v > DELTA * DELTA * DELTA { pow(v, 1.0 / 3.0) } else { v / (3.0 * DELTA * DELTA) + 4.0 / 29.0 });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// The Hunt effect: chroma counts less in the dark.
fn hunt([l, a, b]: [f32; 3]) -> [f32; 3] {
    [l, 0.01 * l * a, 0.01 * l * b]
}

/// Lightness by city block, chroma by Euclid.
fn hyab(p: [f32; 3], q: [f32; 3]) -> f32 {
    let (a, b) = (p[1] - q[1], p[2] - q[2]);
    (p[0] - q[0]).abs() + (a * a + b * b).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const W: u32 = 96;
    const H: u32 = 72;

    fn hash(n: u32) -> u32 {
        let n = (n ^ (n >> 16)).wrapping_mul(0x7feb_352d);
        let n = (n ^ (n >> 15)).wrapping_mul(0x846c_a68b);
        n ^ (n >> 16)
    }
    fn dice(x: u32, y: u32, c: u32) -> u32 {
        hash((y * W + x) * 3 + c)
    }
    fn ramp(x: u32, y: u32, c: u32) -> u32 {
        (x * (3 - c) + y * (c + 1)) * 255 / (3 * W + 3 * H)
    }
    fn checks(x: u32, y: u32, c: u32) -> u32 {
        if (x / 8 + y / 8).is_multiple_of(2) { 40 + 60 * c } else { 220 - 50 * c }
    }
    fn noisy(x: u32, y: u32, c: u32) -> u32 {
        (ramp(x, y, c) + dice(x, y, c) % 41).saturating_sub(20).min(255)
    }
    fn blurred(x: u32, y: u32, c: u32) -> u32 {
        let mut sum = 4;
        for dy in 0..3 {
            for dx in 0..3 {
                sum += checks((x + dx).saturating_sub(1).min(W - 1), (y + dy).saturating_sub(1).min(H - 1), c);
            }
        }
        sum / 9
    }
    fn values(f: impl Fn(u32, u32, u32) -> u32) -> Vec<u8> {
        (0..W * H * 3).map(|k| f(k / 3 % W, k / 3 / W, k % 3) as u8).collect()
    }
    fn ldr_image(f: impl Fn(u32, u32, u32) -> u32) -> Image {
        Image::new(W, H, 3, Pixels::U8(values(f)), Encoding::Srgb).unwrap()
    }
    fn mean(a: &Image, b: &Image) -> f64 {
        let (map, _) = map(a, b, &Job::default()).unwrap();
        super::super::mean(&map, a.width())
    }

    /// Means (in f64) of the maps that flip-evaluator 1.7 (PyPI) gives for the same pictures, made by the
    /// same integer formulas in NumPy: `evaluate(a, b, "LDR", applyMagma=False)[0].astype(float).mean()`. The
    /// tool's own mean is a running f32 sum: 7e-5 lower for black and white, whose map is constant.
    #[test]
    fn ldr_flip_is_that_of_the_reference_tool() {
        let pairs: [(&str, Image, Image, f64); 7] = [
            ("noise", ldr_image(ramp), ldr_image(noisy), 0.092_840_7),
            ("shift", ldr_image(checks), ldr_image(|x, y, c| checks((x + 1).min(W - 1), y, c)), 0.199_513_8),
            ("blur", ldr_image(checks), ldr_image(blurred), 0.184_842_9),
            ("gradient", ldr_image(ramp), ldr_image(|x, y, c| 255 - ramp(x, y, c)), 0.779_757_6),
            ("random", ldr_image(|x, y, c| dice(x, y, c) & 255), ldr_image(ramp), 0.724_306_5),
            ("black and white", ldr_image(|_, _, _| 0), ldr_image(|_, _, _| 255), 0.967_388_3),
            ("one step", ldr_image(ramp), ldr_image(|x, y, c| (ramp(x, y, c) + 1).min(255)), 0.035_010_7),
        ];
        for (name, a, b, expected) in pairs {
            let got = mean(&a, &b);
            // Both compute in f32 with sums of some hundred terms; the largest difference seen is 2.5e-6.
            assert!((got - expected).abs() < 1e-5, "{name}: {got} {expected}");
        }
    }

    /// As above with "HDR": three exposures, ACES.
    #[test]
    fn hdr_flip_is_that_of_the_reference_tool() {
        let bright = |scale: f32, f: &dyn Fn(u32, u32, u32) -> f32| {
            let v = |k| {
                let (x, y, c) = (k / 3 % W, k / 3 / W, k % 3);
                let v = ramp(x, y, c) as f32 / 255.0;
                (v * v * v * 50.0 + 0.01) * scale * f(x, y, c)
            };
            Image::new(W, H, 3, Pixels::F32((0..W * H * 3).map(v).collect()), Encoding::Linear).unwrap()
        };
        let noise = |x, y, c| 1.0 + (dice(x, y, c) % 41) as f32 / 100.0 - 0.2;
        let spot = |x, y, _| if (20..30).contains(&y) && (20..40).contains(&x) { 4.0 } else { 1.0 };
        let reference = bright(1.0, &|_, _, _| 1.0);
        let (start, stop) = exposures(&reference);
        // log2 of f32 luminances.
        assert!((start - -2.784_992_5).abs() < 1e-5 && (stop - 0.153_113_6).abs() < 1e-5, "{start} {stop}");
        let dark = bright(1e-3, &|_, _, _| 1.0);
        for (a, b, expected) in [
            (&reference, bright(1.0, &noise), 0.077_317_6),
            (&reference, bright(1.0, &spot), 0.036_214_0),
            (&dark, bright(1e-3, &noise), 0.077_317_6),
        ] {
            let got = mean(a, &b);
            // As for LDR.
            assert!((got - expected).abs() < 1e-5, "{got} {expected}");
        }
    }

    #[test]
    fn the_map_does_not_depend_on_threads() {
        let (a, b) = (ldr_image(ramp), ldr_image(noisy));
        let with = |n| map(&a, &b, &Job::builder().threads(n).build()).unwrap().0;
        let one = with(1);
        assert!([2, 3, 7].into_iter().all(|n| with(n) == one));
    }

    #[test]
    fn odd_pictures_have_a_flip() {
        // Smaller than any filter; black; infinite.
        for v in [0.0, f32::INFINITY, f32::MAX, -1.0] {
            let a = Image::new(1, 1, 3, Pixels::F32(vec![v; 3]), Encoding::Linear).unwrap();
            let b = Image::new(1, 1, 3, Pixels::F32(vec![0.5; 3]), Encoding::Linear).unwrap();
            let f = mean(&a, &b);
            assert!((0.0..=1.0).contains(&f) && mean(&a, &a) == 0.0, "{v}: {f}");
        }
    }
}
