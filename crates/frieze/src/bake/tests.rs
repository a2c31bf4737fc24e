use super::convert::{Converted, Kind, Normals, Options, convert, reoriented};
use super::poisson::integrate;
use super::slope::{Edges, Kernel, normal};
use super::texels::Depth;
use crate::image::{Encoding, Image, Pixels};
use crate::job::Job;
use crate::map::normal::decode;
use crate::math::exact::sin_cos_f64;
use crate::math::lane::Level;
use crate::math::vec::{Vec3, Vec4};
use crate::scene::material::Channel;

fn floats(w: usize, h: usize, channels: u8, f: impl Fn(usize, usize) -> Vec<f32>) -> Image {
    let v = (0..h).flat_map(|y| (0..w).map(move |x| (x, y))).flat_map(|(x, y)| f(x, y)).collect();
    Image::new(w as u32, h as u32, channels, Pixels::F32(v), Encoding::Linear).unwrap()
}

fn grey(w: usize, h: usize, f: impl Fn(usize, usize) -> f32) -> Image {
    floats(w, h, 1, |x, y| vec![f(x, y)])
}

fn from_height(image: &Image, options: Options) -> Converted {
    let options = Options { from: Some(Kind::Height), strength: options.strength.or(Some(1.0)), ..options };
    convert(image, Kind::Normal, &options).unwrap()
}

fn normal_at(image: &Image, x: usize, y: usize, y_down: bool) -> Vec3 {
    decode(Vec4::from(image.rgba(x as u32, y as u32)), 1.0, y_down, 3)
}

/// Degrees between unit vectors.
fn angle(a: Vec3, b: Vec3) -> f64 {
    let d = a - b;
    // 2 asin(d / 2), for small d.
    f64::from(d.length()).to_degrees()
}

/// Waves that are periodic in n: the height and its slopes along x and down y, in texels.
fn waves(n: usize, x: usize, y: usize) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (a, b, slope, phase) in [(3.0, 2.0, 0.3, 0.2), (5.0, -8.0, 0.2, 1.0), (1.0, 11.0, 0.1, 2.1)] {
        let k = std::f64::consts::TAU / n as f64;
        let (s, c) = sin_cos_f64(k * (a * x as f64 + b * y as f64) + phase);
        let amplitude = slope / (k * f64::sqrt(a * a + b * b));
        sum = [sum[0] + amplitude * s, sum[1] + amplitude * a * k * c, sum[2] + amplitude * b * k * c];
    }
    sum
}

fn wave_normal(n: usize, x: usize, y: usize) -> Vec3 {
    let [_, gx, gy] = waves(n, x, y);
    normal(gx as f32, gy as f32)
}

const KERNELS: [Kernel; 5] = [Kernel::Sobel, Kernel::Central, Kernel::Bicubic, Kernel::Forward, Kernel::Spline];

#[test]
fn row_70_and_71_a_ramp_has_the_analytic_normal_up_to_the_edges() {
    let (a, b) = (0.75, -0.5);
    let ramp = grey(21, 18, |x, y| a * x as f32 + b * y as f32 - 3.0);
    // (-dp/du, -dp/dv, 1) with v up: rows run down.
    let want = Vec3::new(-a, b, 1.0).normalize();
    for kernel in KERNELS {
        let made = from_height(&ramp, Options { kernel, depth: Depth::F32, ..Default::default() }).image;
        for (x, y) in (0..18).flat_map(|y| (0..21).map(move |x| (x, y))) {
            // The spline sums 24 products of heights up to 12: some roundings of 1e-6.
            assert!((normal_at(&made, x, y, false) - want).length() < 8e-6, "{kernel:?} {x} {y}");
        }
    }
    // Row 70, one dimension less: (-dp, 1).
    let n = normal(0.75f32, 0.0);
    assert!((n - Vec3::new(-0.6, 0.0, 0.8)).length() < 1e-7);
    // Strength is the height of the full range in texels: c1 = c2 of row 71.
    let made = from_height(&ramp, Options { strength: Some(2.0), depth: Depth::F32, ..Default::default() }).image;
    assert!((normal_at(&made, 9, 9, false) - Vec3::new(-2.0 * a, 2.0 * b, 1.0).normalize()).length() < 1e-6);
}

#[test]
fn row_74_the_cross_product_of_the_tangents_is_the_same_normal() {
    for (du, dv) in [(0.0f32, 0.0), (1.0, 0.0), (0.3, -0.7), (-20.0, 4.0)] {
        // Slopes along u and v; v is up, `normal` takes the slope down the picture.
        let cross = Vec3::new(1.0, 0.0, du).cross(Vec3::new(0.0, 1.0, dv)).normalize();
        assert!((cross - normal(du, -dv)).length() < 3e-7, "{du} {dv}");
    }
}

#[test]
fn row_75_heights_may_be_negative_and_rgb_may_be_a_vector() {
    let height = |x: usize, y: usize| waves(32, x, y)[0] as f32;
    let options = || Options { depth: Depth::F32, edges: Edges::Wrap, ..Default::default() };
    let signed = from_height(&grey(32, 32, height), options()).image;
    // A midlevel moves all heights alike. Adding 64 rounds them to 4e-6.
    let lifted = from_height(&grey(32, 32, |x, y| height(x, y) + 64.0), options()).image;
    // The length of the vector of colour, 13 times the height.
    let rgb = floats(32, 32, 3, |x, y| [3.0, 4.0, 12.0].map(|c| (height(x, y) + 8.0) * c).to_vec());
    let rgb = from_height(&rgb, Options { channel: Channel::RgbNorm, strength: Some(1.0 / 13.0), ..options() }).image;
    let negative = from_height(&grey(32, 32, |x, y| -height(x, y)), options()).image;
    for (x, y) in (0..32).flat_map(|y| (0..32).map(move |x| (x, y))) {
        let n = normal_at(&signed, x, y, false);
        assert!((normal_at(&lifted, x, y, false) - n).length() < 1e-5);
        assert!((normal_at(&rgb, x, y, false) - n).length() < 1e-5);
        let m = normal_at(&negative, x, y, false);
        assert!((Vec3::new(-m.x, -m.y, m.z) - n).length() < 1e-6);
    }
}

#[test]
fn row_76_normals_of_analytic_heights_by_kernel() {
    const N: usize = 128;
    let [mut low, mut high] = [f64::INFINITY, f64::NEG_INFINITY];
    for (x, y) in (0..N).flat_map(|y| (0..N).map(move |x| (x, y))) {
        (low, high) = (low.min(waves(N, x, y)[0]), high.max(waves(N, x, y)[0]));
    }
    let codes = (0..N * N).map(|k| ((waves(N, k % N, k / N)[0] - low) / (high - low) * 65535.0 + 0.5) as u16).collect();
    let image = Image::new(N as u32, N as u32, 1, Pixels::U16(codes), Encoding::Linear).unwrap();
    let error = |kernel, edges| {
        let options = Options { strength: Some((high - low) as f32), kernel, edges, ..Default::default() };
        let made = from_height(&image, options).image;
        let all = (0..N).flat_map(|y| (0..N).map(move |x| (x, y)));
        let angles: Vec<f64> = all.map(|(x, y)| angle(normal_at(&made, x, y, false), wave_normal(N, x, y))).collect();
        (angles.iter().sum::<f64>() / (N * N) as f64, angles.iter().copied().fold(0.0, f64::max))
    };
    let table = KERNELS.map(|k| error(k, Edges::Wrap));
    let [sobel, central, bicubic, forward, spline] = table;
    // The steepest wave has 0.54 radians per texel: central keeps sin(k) / k = 95 % of a slope of 0.1, a third of a degree;
    // Sobel loses as much again; forward is half a texel aside; the spline is off by k^4 / 180 and the codes' rounding.
    assert!(sobel.0 < 0.9 && sobel.1 < 2.0 && sobel.0 > 1.3 * central.0, "{table:?}");
    assert!(central.0 < 0.5 && central.1 < 1.2, "{table:?}");
    assert_eq!(central, bicubic);
    assert!(forward.0 > 4.0 * central.0, "{table:?}");
    assert!(spline.0 < 0.02 && spline.1 < 0.06, "{table:?}");
    // As a tile it is no worse at the edges; not as a tile, it is.
    assert!(error(Kernel::Spline, Edges::Extend).1 > 4.0 * spline.1);
}

#[test]
fn row_49_flipped_and_made_of_unit_length() {
    let long = floats(16, 16, 3, |x, y| {
        let n = wave_normal(16, x, y) * 0.7;
        vec![n.x * 0.5 + 0.5, n.y * 0.5 + 0.5, n.z * 0.5 + 0.5]
    });
    let options = Options { from: Some(Kind::Normal), y_down: true, ..Default::default() };
    let made = convert(&long, Kind::Normal, &options).unwrap();
    assert!(made.figures.iter().any(|(name, share)| *name == "unnormalized" && *share == 1.0));
    for (x, y) in (0..16).flat_map(|y| (0..16).map(move |x| (x, y))) {
        let stored = made.image.rgba(x as u32, y as u32).map(|v| v * 2.0 - 1.0);
        let length = (stored[0] * stored[0] + stored[1] * stored[1] + stored[2] * stored[2]).sqrt();
        // Half a code of 16 bits in each of three channels.
        assert!((length - 1.0).abs() < 3e-5, "{length}");
        assert!((normal_at(&made.image, x, y, true) - wave_normal(16, x, y)).length() < 6e-5);
    }
}

#[test]
fn dither_keeps_the_mean_of_a_slow_ramp_and_plain_rounding_does_not() {
    // Slopes that climb by a third of an 8-bit code over the whole map.
    let field = grey(256, 64, |x, _| 0.5 * x as f32 * x as f32 * 1e-5);
    let made = |dither| {
        from_height(&field, Options { dither, depth: Depth::U8, kernel: Kernel::Central, ..Default::default() }).image
    };
    let mean = |image: &Image, from: u32| {
        let all = (0..64u32).flat_map(|y| (from..from + 32).map(move |x| (x, y)));
        all.map(|(x, y)| f64::from(image.value(x, y, 0)) * 255.0).sum::<f64>() / 2048.0
    };
    let want = |from: u32| {
        (from..from + 32).map(|x| f64::from(normal(x as f32 * 1e-5, 0.0).x) * 127.5 + 127.5).sum::<f64>() / 32.0
    };
    let (dithered, plain) = (made(true), made(false));
    for from in [32, 96, 160, 208] {
        // The noise has a variance of 1/6 + 1/12 and no low frequencies: the mean of 64 rows of 32 is within 0.03.
        assert!((mean(&dithered, from) - want(from)).abs() < 0.03, "{from}");
        assert!((mean(&plain, from) - want(from)).abs() > 0.2, "{from}");
    }
    assert_eq!(dithered, made(true));
}

#[test]
fn nothing_that_is_read_makes_a_nan() {
    let codes: Vec<&str> = Vec::new();
    let check = |image: &Image, to: Kind, from: Kind, want: &[&str]| {
        for edges in [Edges::Wrap, Edges::Extend] {
            for depth in [Depth::U8, Depth::F32] {
                let options = Options { from: Some(from), edges, depth, strength: Some(1.0), ..Default::default() };
                let made = convert(image, to, &options).unwrap();
                let Pixels::F32(v) = made.image.pixels() else { continue };
                assert!(v.iter().all(|v| v.is_finite()), "{to:?} from {from:?} {edges:?}");
                let found: Vec<&str> = made.findings.iter().map(|f| f.code).collect();
                assert!(want.iter().all(|w| found.contains(w)), "{to:?} from {from:?}: {found:?}");
            }
        }
    };
    let wild = grey(9, 7, |x, y| [f32::NAN, f32::INFINITY, -3e38, 1e20, 0.0, -1.0][(x + 3 * y) % 6]);
    let wild_rgb = floats(9, 7, 3, |x, y| {
        [f32::NAN, 0.5, -3e38, 1e20][(x + y) % 4..].iter().chain(&[0.5; 3]).take(3).copied().collect()
    });
    for to in [Kind::Normal, Kind::Derivative, Kind::Curvature] {
        check(&wild, to, Kind::Height, &["convert.not-finite"]);
        for (w, h) in [(1, 1), (1, 5), (5, 1), (2, 2), (3, 17)] {
            check(&grey(w, h, |_, _| 0.25), to, Kind::Height, &["convert.flat"]);
            check(&grey(w, h, |x, y| (x * 3 + y) as f32), to, Kind::Height, &codes);
        }
    }
    for to in [Kind::Normal, Kind::Derivative, Kind::Curvature, Kind::Height] {
        check(&wild_rgb, to, Kind::Normal, &["convert.no-direction"]);
        for (w, h) in [(1, 1), (1, 5), (5, 1), (2, 2), (3, 17)] {
            check(&floats(w, h, 3, |_, _| vec![0.5; 3]), to, Kind::Normal, &["convert.no-direction"]);
        }
    }
}

#[test]
fn a_sphere_has_its_curvature_and_slopes() {
    // A cap of radius 100 texels: 1 / 100, positive as it bulges out.
    let cap = grey(41, 41, |x, y| {
        let (x, y) = (x as f64 - 20.0, y as f64 - 20.0);
        f64::sqrt(1e4 - x * x - y * y) as f32
    });
    let options = |depth, range| Options {
        from: Some(Kind::Height),
        strength: Some(1.0),
        kernel: Kernel::Spline,
        depth,
        range,
        ..Default::default()
    };
    let curvature = convert(&cap, Kind::Curvature, &options(Depth::F32, None)).unwrap().image;
    for (x, y) in [(20, 20), (10, 25), (30, 12)] {
        // Central differences of the normal are off by k^2 / 6 of a wave of that size: below 0.1 %.
        assert!((curvature.value(x, y, 0) - 0.01).abs() < 2e-5, "{}", curvature.value(x, y, 0));
    }
    let stored = convert(&cap, Kind::Curvature, &options(Depth::U16, Some(0.04))).unwrap().image;
    assert!((stored.value(20, 20, 0) - 0.625).abs() < 3e-4);
    let slopes = convert(&cap, Kind::Derivative, &options(Depth::F32, None)).unwrap().image;
    // Right of the middle it falls to the right; above it, it falls upwards: both derivatives are negative.
    let want = -10.0 / f64::sqrt(1e4 - 100.0) as f32;
    assert!((slopes.value(30, 20, 0) - want).abs() < 1e-5 && (slopes.value(20, 10, 1) - want).abs() < 1e-5);
}

#[test]
fn detail_is_turned_with_the_surface() {
    let flat = Vec3::new(0.0f32, 0.0, 1.0);
    let base = Vec3::new(0.6f32, 0.0, 0.8);
    assert!((reoriented(base, flat) - base).length() < 1e-6);
    assert!((reoriented(flat, base) - base).length() < 1e-6);
    // The base leans by atan2(0.6, 0.8) about y: so does the detail, on top of its own.
    let (s, c) = (0.28f32, 0.96f32);
    let want = Vec3::new(0.6 * c + 0.8 * s, 0.0, 0.8 * c - 0.6 * s);
    assert!((reoriented(base, Vec3::new(s, 0.0, c)) - want).length() < 1e-6);
    let sideways = reoriented(base, Vec3::new(0.0, s, c));
    assert!((sideways - Vec3::new(0.6 * c, s, 0.8 * c)).length() < 1e-6);
    assert!((reoriented(Vec3::new(0.0, 0.0, -1.0), flat)).is_finite());
}

#[test]
fn row_76_heights_come_back_from_their_normals() {
    // 100 has a factor 25, 93 = 3 * 31 goes through Bluestein's convolution.
    for (w, h, edges) in [(96, 96, Edges::Wrap), (100, 93, Edges::Extend), (64, 47, Edges::Extend)] {
        let n = 96;
        let map = floats(w, h, 3, |x, y| wave_normal(n, x, y).array().map(|v| v * 0.5 + 0.5).to_vec());
        let normals = Normals::new(&map, 3, false, None).unwrap();
        let job = Job::default();
        let made = integrate(&normals, edges, &job, Level::default()).unwrap();
        let (mut square, mut all, mut mean) = (0.0, 0.0, 0.0);
        let texels = || (0..h).flat_map(|y| (0..w).map(move |x| (x, y)));
        let count = (w * h) as f64;
        texels().for_each(|(x, y)| mean += (waves(n, x, y)[0]) / count);
        for (x, y) in texels() {
            let want = waves(n, x, y)[0] - mean;
            let off = f64::from(made.row(y)[x]) - want;
            square += off * off;
            all += want * want;
        }
        // Waves of up to 0.72 radians per texel: 11/720 k^4 is 0.4 % of the smallest, whose height is a tenth of all.
        assert!((square / all).sqrt() < 1.5e-3, "{w}x{h} {}", (square / all).sqrt());
    }
}

#[test]
fn the_bytes_depend_on_neither_threads_nor_level() {
    let height = grey(77, 61, |x, y| waves(64, x, y)[0] as f32);
    let map = floats(77, 61, 3, |x, y| wave_normal(64, x, y).array().map(|v| v * 0.5 + 0.5).to_vec());
    for (to, from) in [
        (Kind::Normal, Kind::Height),
        (Kind::Curvature, Kind::Height),
        (Kind::Derivative, Kind::Normal),
        (Kind::Normal, Kind::Normal),
        (Kind::Height, Kind::Normal),
    ] {
        for edges in [Edges::Wrap, Edges::Extend] {
            for (depth, kernel) in [(Depth::U8, Kernel::Sobel), (Depth::F32, Kernel::Spline)] {
                let mut all = Vec::new();
                for (k, level) in Level::available().into_iter().enumerate() {
                    let options = Options {
                        job: Job::builder().threads([1, 2, 3, 7][k % 4]).build(),
                        level,
                        from: Some(from),
                        strength: Some(3.0),
                        edges,
                        kernel,
                        depth,
                        detail: (from == Kind::Normal && to == Kind::Normal).then(|| map.clone()),
                        ..Default::default()
                    };
                    all.push(convert(if from == Kind::Height { &height } else { &map }, to, &options).unwrap().image);
                }
                assert!(all.iter().all(|i| *i == all[0]), "{to:?} from {from:?} {edges:?} {depth:?}");
            }
        }
    }
}

#[test]
fn memory_is_asked_before_it_is_taken() {
    let height = grey(256, 256, |_, _| 0.0);
    let map = floats(256, 256, 3, |_, _| vec![0.5, 0.5, 1.0]);
    for (image, to, from) in [(&height, Kind::Normal, Kind::Height), (&map, Kind::Height, Kind::Normal)] {
        let job = Job::builder().memory(1 << 17).build();
        let error = convert(image, to, &Options { job, from: Some(from), ..Default::default() }).unwrap_err();
        assert_eq!(error.code, "job.memory");
    }
}
