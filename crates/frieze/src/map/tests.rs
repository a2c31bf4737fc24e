//! What each filter promises.

use super::area::catmull_rom;
use super::{Filter, Footprint, Map, Wrap};
use crate::image::pyramid::{Pyramid, Rule};
use crate::image::{Encoding, Image, Pixels};
use crate::math::lane::{Kernel, Lane, Level, Num, One};
use crate::math::vec::{Vec2, Vec4};
use std::sync::Arc;

const FILTERS: [Filter; 9] = [
    Filter::Nearest,
    Filter::Bilinear,
    Filter::Bicubic,
    Filter::MipNearest,
    Filter::Trilinear,
    Filter::Ripmap,
    Filter::Anisotropic { max: 16 },
    Filter::Ewa { radius: Filter::EWA_RADIUS },
    Filter::Supersample { taps: 16 },
];
const WRAPS: [Wrap; 4] = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp, Wrap::Border];

/// A fixed sequence of numbers from 0 to 1 without pattern.
struct Noise(u32);
impl Noise {
    fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(1664525).wrapping_add(1013904223);
        self.0 >> 8
    }
    fn next(&mut self) -> f32 {
        self.bits() as f32 / 16_777_216.0
    }
}

fn gray(w: u32, h: u32, f: impl Fn(u32, u32) -> f32) -> Image {
    let v = (0..h).flat_map(|y| (0..w).map(move |x| (x, y))).map(|(x, y)| f(x, y)).collect();
    Image::new(w, h, 1, Pixels::F32(v), Encoding::Linear).unwrap()
}

fn bytes(w: u32, h: u32, channels: u8) -> Image {
    let mut n = Noise(7);
    let v = (0..w * h * u32::from(channels)).map(|_| n.bits() as u8).collect();
    Image::new(w, h, channels, Pixels::U8(v), Encoding::Linear).unwrap()
}

fn map(image: &Image, filter: Filter, wrap: Wrap) -> Map {
    let rule = Rule { ripmap: filter == Filter::Ripmap, ..Rule::default() };
    Map { pyramid: Arc::new(Pyramid::with(image, rule)), filter, wrap: [wrap; 2] }
}

/// A round footprint of `d` (in units of the texture).
fn round(d: f32) -> Footprint<f32> {
    Footprint { dudx: d, dvdx: 0.0, dudy: 0.0, dvdy: d }
}

fn ask(m: &Map, u: f32, v: f32, f: Footprint<f32>) -> Vec4 {
    m.at(One, Vec2::new(u, v), f, true)
}

// Rows 2 and 38: texel i of n is found from i/n to (i+1)/n, its centre is at (i + 1/2)/n (erratum E15).
#[test]
fn row_38_nearest_is_piecewise_constant_with_half_texel_centres() {
    let image = bytes(5, 3, 3);
    let m = map(&image, Filter::Nearest, Wrap::Clamp);
    for (x, y) in (0..3).flat_map(|y| (0..5).map(move |x| (x, y))) {
        let want = Vec4::from(image.rgba(x, y));
        for (dx, dy) in [(0.01, 0.01), (0.5, 0.5), (0.99, 0.3)] {
            let (u, v) = ((x as f32 + dx) / 5.0, (y as f32 + dy) / 3.0);
            assert_eq!(ask(&m, u, v, round(0.1)), want, "{x} {y}");
        }
    }
}

// Row 2: where pixels and texels coincide, every pixel centre returns its own texel exactly.
#[test]
fn row_02_texel_centres_return_the_texel_exactly() {
    let image = bytes(16, 8, 4);
    for filter in [Filter::Nearest, Filter::Bilinear, Filter::Bicubic, Filter::Trilinear, Filter::MipNearest] {
        for wrap in WRAPS {
            let m = map(&image, filter, wrap);
            for (x, y) in (0..8).flat_map(|y| (0..16).map(move |x| (x, y))) {
                let f = Footprint { dudx: 1.0 / 16.0, dvdy: 1.0 / 8.0, ..Footprint::default() };
                let got = ask(&m, (x as f32 + 0.5) / 16.0, (y as f32 + 0.5) / 8.0, f);
                assert_eq!(got, Vec4::from(image.rgba(x, y)), "{filter:?} {wrap:?} {x} {y}");
            }
        }
    }
}

#[test]
fn every_code_is_divided_as_exactly_as_a_division_does() {
    let all8 = Image::new(256, 1, 1, Pixels::U8((0..=255).collect()), Encoding::Linear).unwrap();
    let all16 = Image::new(65536, 1, 1, Pixels::U16((0..=65535).collect()), Encoding::Linear).unwrap();
    for image in [all8, all16] {
        let m = map(&image, Filter::Nearest, Wrap::Clamp);
        for x in 0..image.width() {
            let got = ask(&m, (x as f32 + 0.5) / image.width() as f32, 0.5, round(0.0));
            assert_eq!(got.x, x as f32 / (image.width() - 1) as f32);
            assert_eq!((got.y, got.z, got.w), (got.x, got.x, 1.0));
        }
    }
}

// Row 1: asked about all of itself, a map answers with its mean.
#[test]
fn row_01_a_range_over_the_whole_image_is_its_mean() {
    for (w, h) in [(8, 8), (16, 4), (1, 32)] {
        let image = gray(w, h, |x, y| Noise(x * 131 + y * 1733 + 9).next());
        let Pixels::F32(values) = image.pixels() else { panic!("floats") };
        let mean = values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64;
        let whole = round(1.0);
        for filter in [
            Filter::MipNearest,
            Filter::Trilinear,
            Filter::Ripmap,
            Filter::Anisotropic { max: 16 },
            Filter::Supersample { taps: 4096 },
        ] {
            let m = map(&image, filter, Wrap::Repeat);
            // From anywhere: the range wraps.
            for (u, v) in [(0.5, 0.5), (0.1, 0.8), (0.0, 0.0)] {
                let got = f64::from(ask(&m, u, v, whole).x);
                // Row 1 asks for 1e-6; 4096 points on a texture of at most 64 texels fall on a grid that divides it.
                assert!((got - mean).abs() < 1e-6, "{filter:?} of {w}x{h} at {u} {v}: {got} {mean}");
            }
        }
    }
}

// Row 39.
#[test]
fn row_39_bilinear_is_exact_on_ramps_and_needs_no_order_of_axes() {
    let m = map(&gray(8, 8, |x, y| 3.0 * x as f32 - 2.0 * y as f32), Filter::Bilinear, Wrap::Clamp);
    let noise = |x: u32, y: u32| Noise(x * 97 + y * 1009 + 5).next();
    let plain = map(&gray(8, 8, noise), Filter::Bilinear, Wrap::Repeat);
    let turned = map(&gray(8, 8, |x, y| noise(y, x)), Filter::Bilinear, Wrap::Repeat);
    let mut n = Noise(1);
    for _ in 0..1000 {
        let (u, v) = (0.0625 + 0.875 * n.next(), 0.0625 + 0.875 * n.next());
        let want = 3.0 * (8.0 * u - 0.5) - 2.0 * (8.0 * v - 0.5);
        // Values up to 21: a few roundings of 2^-20.
        assert!((ask(&m, u, v, round(0.0)).x - want).abs() < 8e-6);
        let (a, b) = (ask(&plain, u, v, round(0.0)).x, ask(&turned, v, u, round(0.0)).x);
        // One unit in the last place of the largest texel, 1.
        assert!((a - b).abs() <= f32::EPSILON, "{a} {b}");
    }
}

// Row 40. The row says "exact on cubics"; Catmull-Rom's spline (Keys' a = -1/2) is exact on quadratics, its
// error on x^3 is t (1 - t) (1 - 2 t).
#[test]
fn row_40_bicubic_is_a_partition_of_unity_and_exact_on_quadratics() {
    for k in 0..=100 {
        let t = k as f32 / 100.0;
        let w = catmull_rom(t);
        // Four numbers of at most 1, each rounded a few times.
        assert!((w.iter().sum::<f32>() - 1.0).abs() < 3e-7);
        let power = |p: i32| (0..4).map(|i| w[i] * [-1.0f32, 0.0, 1.0, 2.0][i].powi_exact(p)).sum::<f32>();
        assert!((power(1) - t).abs() < 1e-6 && (power(2) - t * t).abs() < 1e-6);
        assert!((power(3) - t * t * t - t * (1.0 - t) * (1.0 - 2.0 * t)).abs() < 2e-6);
    }
    let f = |x: f32, y: f32| 0.3 + 0.2 * x - 0.1 * y + 0.05 * x * x + 0.02 * x * y - 0.03 * y * y;
    let m = map(&gray(9, 9, |x, y| f(x as f32, y as f32)), Filter::Bicubic, Wrap::Clamp);
    let mut n = Noise(3);
    for _ in 0..500 {
        let (x, y) = (1.0 + 6.0 * n.next(), 1.0 + 6.0 * n.next());
        let got = ask(&m, (x + 0.5) / 9.0, (y + 0.5) / 9.0, round(0.0)).x;
        // Values up to 5, sixteen products.
        assert!((got - f(x, y)).abs() < 1e-5, "{got}");
    }
}

trait PowiExact {
    fn powi_exact(self, p: i32) -> f32;
}
impl PowiExact for f32 {
    fn powi_exact(self, p: i32) -> f32 {
        (0..p).fold(1.0, |y, _| y * self)
    }
}

// Row 42: on a scaled plane the level is log2 of the scale, whatever way the plane is turned, and the longer
// side decides.
#[test]
fn row_42_the_level_is_the_binary_logarithm_of_the_scale() {
    let m = map(&gray(256, 128, |_, _| 0.0), Filter::Trilinear, Wrap::Repeat);
    for k in 0..400 {
        let scale = 0.3 + k as f32 * 0.171;
        let want = crate::math::exact::log2(scale);
        for turn in [0.0, 0.4, 1.2] {
            let (s, c) = crate::math::exact::sin_cos(turn);
            let f = Footprint {
                dudx: c * scale / 256.0,
                dvdx: s * scale / 128.0,
                dudy: -s * scale / 256.0 * 0.9,
                dvdy: c * scale / 128.0 * 0.9,
            };
            // The row asks for 0.01; the polynomial has 3e-5.
            assert!((m.level_of(One, f) - want).abs() < 1e-4, "{scale}");
        }
    }
}

/// Values along a zoom from 1 to 16 texels a pixel, at one place.
fn zoom(filter: Filter) -> Vec<f32> {
    let image = gray(64, 64, |x, y| Noise(x * 131 + y * 7001).next());
    let m = map(&image, filter, Wrap::Repeat);
    (0..4000).map(|k| ask(&m, 0.37, 0.61, round((1.0 + 15.0 * k as f32 / 4000.0) / 64.0)).x).collect()
}

fn largest_step(v: &[f32]) -> f32 {
    v.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max)
}

// Rows 43 and 44.
#[test]
fn row_43_rounded_levels_step_and_row_44_trilinear_is_continuous() {
    let (rounded, blended) = (zoom(Filter::MipNearest), zoom(Filter::Trilinear));
    // A step of the sweep is 15/4000 texel, at most 0.0055 of a level; levels differ by less than 0.5.
    assert!(largest_step(&blended) < 0.003, "{}", largest_step(&blended));
    assert!(largest_step(&rounded) > 0.03, "{}", largest_step(&rounded));
}

/// Mean squared error to the area average, over a ground plane with a checker, turned by `turn` radians.
fn plane_error(filter: Filter, turn: f32, lens: f32, dense: f32) -> f64 {
    let image = gray(64, 64, |x, y| ((x / 8 + y / 8) % 2) as f32);
    let m = map(&image, filter, Wrap::Repeat);
    let truth = map(&image, Filter::Supersample { taps: 1024 }, Wrap::Repeat);
    let (s, c) = crate::math::exact::sin_cos(turn);
    let (mut sum, mut n) = (0.0, 0);
    for y in 4..28 {
        for x in 0..48 {
            // The plane's distance is 14/Y, seen through a lens that is `lens` pixels long: the longer, the less shear.
            let (px, py) = (x as f32 - 23.5, y as f32 + 0.5);
            let z = dense * 14.0 / py;
            let k = 1.0 / lens;
            let (u, v) = (px * z * k, z);
            let (ux, uy, vy) = (z * k, -px * z * k / py, -z / py);
            let f = Footprint { dudx: c * ux, dvdx: s * ux, dudy: c * uy - s * vy, dvdy: s * uy + c * vy };
            let (u, v) = (c * u - s * v + 0.123, s * u + c * v + 0.456);
            sum += f64::from(ask(&m, u, v, f).x - ask(&truth, u, v, f).x).powi_square();
            n += 1;
        }
    }
    sum / f64::from(n)
}

trait Square {
    fn powi_square(self) -> Self;
}
impl Square for f64 {
    fn powi_square(self) -> f64 {
        self * self
    }
}

const DIAGONAL: f32 = core::f32::consts::FRAC_PI_4;

// Row 45.
#[test]
fn row_45_ripmaps_win_along_the_axes_and_fail_at_45_degrees() {
    let straight = (plane_error(Filter::Ripmap, 0.0, 300.0, 1.0), plane_error(Filter::Trilinear, 0.0, 300.0, 1.0));
    let skew = (
        plane_error(Filter::Ripmap, DIAGONAL, 300.0, 1.0),
        plane_error(Filter::Anisotropic { max: 16 }, DIAGONAL, 300.0, 1.0),
    );
    assert!(straight.0 < 0.5 * straight.1, "{straight:?}");
    assert!(skew.0 > 2.0 * skew.1, "{skew:?}");
}

// Row 46: where footprints are longer than 16 to 1. (While 16 probes suffice, they are a box along the longer
// axis, nearer to the reference's box than any ellipse.)
#[test]
fn row_46_ewa_beats_16x_anisotropic_at_45_degrees() {
    let error = |filter| plane_error(filter, DIAGONAL, 300.0, 4.0);
    let ewa = error(Filter::Ewa { radius: Filter::EWA_RADIUS });
    let aniso = error(Filter::Anisotropic { max: 16 });
    let trilinear = error(Filter::Trilinear);
    assert!(ewa < aniso && aniso < 0.1 * trilinear, "{ewa} {aniso} {trilinear}");
}

// Row 47: n^2 points converge to the area average. Multisampling would not help: it shades once (erratum E11).
#[test]
fn row_47_supersampling_converges() {
    let e: Vec<f64> = [4, 16, 64, 256].map(|taps| plane_error(Filter::Supersample { taps }, 0.3, 300.0, 1.0)).to_vec();
    // A regular grid's error falls about as 1/n in each axis: the mean square by more than 2 per doubling of n.
    assert!(e.windows(2).all(|w| w[1] < 0.5 * w[0]), "{e:?}");
    let all = plane_error(Filter::Supersample { taps: 1024 }, 0.3, 300.0, 1.0);
    assert_eq!(all, 0.0);
    // What it converges to: the mean of x y, which bilinear reconstruction keeps exactly, over a skew footprint is
    // the product at its centre plus the covariance of x and y, 1/12 of the box's (n^2 - 1)/n^2 for n x n points.
    let m = map(&gray(16, 16, |x, y| x as f32 * y as f32), Filter::Supersample { taps: 64 }, Wrap::Clamp);
    let f = Footprint { dudx: 3.0 / 16.0, dvdx: 1.0 / 16.0, dudy: -1.0 / 16.0, dvdy: 2.0 / 16.0 };
    let (x, y) = (7.3, 6.9);
    let want = x * y + (3.0 * 1.0 - 1.0 * 2.0) / 12.0 * (63.0 / 64.0);
    let got = ask(&m, (x + 0.5) / 16.0, (y + 0.5) / 16.0, f).x;
    // Places rounded to 1e-6 of a texel, values up to 100.
    assert!((got - want).abs() < 5e-5, "{got} {want}");
}

#[test]
fn wraps_answer_outside() {
    let image = gray(4, 1, |x, _| x as f32 + 1.0);
    let at = |wrap, u| ask(&map(&image, Filter::Nearest, wrap), u, 0.5, round(0.0));
    let row = |wrap| [-0.9, -0.1, 0.1, 0.9, 1.1, 1.9, 2.1].map(|u| at(wrap, u).x);
    assert_eq!(row(Wrap::Repeat), [1.0, 4.0, 1.0, 4.0, 1.0, 4.0, 1.0]);
    assert_eq!(row(Wrap::Mirror), [4.0, 1.0, 1.0, 4.0, 4.0, 1.0, 1.0]);
    assert_eq!(row(Wrap::Clamp), [1.0, 1.0, 1.0, 4.0, 4.0, 4.0, 4.0]);
    assert_eq!(row(Wrap::Border), [0.0, 0.0, 1.0, 4.0, 0.0, 0.0, 0.0]);
    assert_eq!(at(Wrap::Border, 1.5), Vec4::splat(0.0));
    // Bilinear at the edge: half a texel outside counts half.
    let soft = |wrap| ask(&map(&image, Filter::Bilinear, wrap), 1.0, 0.5, round(0.0)).x;
    assert_eq!([soft(Wrap::Repeat), soft(Wrap::Mirror), soft(Wrap::Clamp), soft(Wrap::Border)], [2.5, 4.0, 4.0, 2.0]);
}

#[test]
fn a_constant_stays_constant_under_every_filter() {
    let v = vec![128u8; 3 * 37 * 21];
    let image = Image::new(37, 21, 3, Pixels::U8(v), Encoding::Linear).unwrap();
    let mut n = Noise(9);
    for filter in FILTERS {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            let m = map(&image, filter, wrap);
            for _ in 0..30 {
                let f = Footprint { dudx: n.next(), dvdx: n.next(), dudy: n.next(), dvdy: n.next() };
                let got = ask(&m, n.next() * 5.0 - 2.0, n.next(), f);
                // Bicubic's and the anisotropic mean's weights sum to 1 only to within rounding.
                assert!((got.x - 128.0 / 255.0).abs() < 3e-7 && (got.w - 1.0).abs() < 6e-7, "{filter:?} {got:?}");
            }
        }
    }
}

/// Places and footprints of all kinds, awkward ones included.
fn questions(n: usize) -> Vec<[f32; 6]> {
    let mut noise = Noise(77);
    let odd = [f32::NAN, f32::INFINITY, -f32::INFINITY, 1e30, -1e30, 0.0, -0.0, 1.0, -1.0, 0.999_999_94, -1e-9, 1e-40];
    (0..n)
        .map(|k| {
            let size = [0.001, 0.02, 0.3, 4.0][k % 4] * if k % 3 == 0 { 1.0 } else { noise.next() };
            let mut q = [noise.next() * 3.0 - 1.0, noise.next() * 3.0 - 1.0, 0.0, 0.0, 0.0, 0.0];
            for d in &mut q[2..] {
                *d = (noise.next() * 2.0 - 1.0) * size;
            }
            if k % 5 == 0 {
                q[k / 5 % 6] = odd[k / 30 % odd.len()];
            }
            q
        })
        .collect()
}

struct Ask<'a>(&'a Map, &'a [[f32; 6]]);
impl Kernel for Ask<'_> {
    type Out = Vec<[u32; 4]>;
    #[inline(always)]
    fn run<L: Lane>(self, l: L) -> Self::Out {
        let mut out = Vec::new();
        for (b, q) in self.1.chunks(L::WIDTH).enumerate() {
            let get = |c: usize| l.f_from(|k| q.get(k).map_or(f32::NAN, |q| q[c]));
            let f = Footprint { dudx: get(2), dvdx: get(3), dudy: get(4), dvdy: get(5) };
            // Every third block has a hole.
            let hole = if b % 3 == 2 { 1u32 << (b % L::WIDTH) } else { 0 };
            let here = (u32::MAX >> (32 - q.len())) & !hole;
            let v = self.0.at(l, Vec2::new(get(0), get(1)), f, l.mask(here));
            for k in 0..q.len() {
                let idle = hole >> k & 1 != 0;
                out.push(v.array().map(|v| if idle { u32::MAX } else { v.lane(k).to_bits() }));
            }
        }
        out
    }
}

// Law 6, and that a lane's value depends on that lane alone.
#[test]
fn every_filter_and_wrap_has_the_same_bits_at_every_level() {
    let q = questions(240);
    let eight = bytes(37, 16, 4);
    let sixteen =
        Image::new(16, 9, 3, Pixels::U16((0..16 * 9 * 3).map(|k| k * 149).collect()), Encoding::Linear).unwrap();
    let float = gray(32, 32, |x, y| Noise(x + 57 * y).next() * 9.0 - 4.0);
    for (image, filters) in [(&eight, &FILTERS[..]), (&sixteen, &FILTERS[1..8]), (&float, &FILTERS[..7])] {
        for &filter in filters {
            for wrap in WRAPS {
                let mut m = map(image, filter, wrap);
                m.wrap[1] = if wrap == Wrap::Clamp { Wrap::Repeat } else { wrap };
                let want: Vec<[u32; 4]> = q.chunks(1).flat_map(|q| Ask(&m, q).run(One)).collect();
                let finite = want.iter().flatten().all(|&v| f32::from_bits(v).is_finite() || v == u32::MAX);
                assert!(finite, "{filter:?} {wrap:?}");
                for level in Level::available() {
                    let got = level.run(Ask(&m, &q));
                    for (k, (got, want)) in got.iter().zip(&want).enumerate() {
                        let skip = got[0] == u32::MAX || want[0] == u32::MAX;
                        assert!(skip || got == want, "{} {filter:?} {wrap:?} {k}: {:?}", level.name(), q[k]);
                    }
                }
            }
        }
    }
}

#[test]
fn traced_lookups_tell_what_they_read() {
    let q = questions(60);
    for image in [bytes(37, 16, 4), gray(16, 16, |x, y| Noise(x + 99 * y).next())] {
        for filter in FILTERS {
            for wrap in WRAPS {
                let m = map(&image, filter, wrap);
                for q in &q {
                    let f = Footprint { dudx: q[2], dvdx: q[3], dudy: q[4], dvdy: q[5] };
                    let (u, v) = (q[0], q[1]);
                    let mut taps = Vec::new();
                    let got = m.at_traced(Vec2::new(u, v), f, &mut taps);
                    assert_eq!(got, ask(&m, u, v, f), "{filter:?}");
                    let total: f64 = taps.iter().map(|t| f64::from(t.weight)).sum();
                    // Up to some thousand weights, each rounded.
                    let whole = (total - 1.0).abs() < 1e-5;
                    // What falls on the border is missing (bicubic: may be missing negatively).
                    assert!(whole || (wrap == Wrap::Border && total < 1.2), "{filter:?} {wrap:?} {total}");
                    for (c, got) in got.array().into_iter().enumerate() {
                        let sum: f64 = taps.iter().map(|t| f64::from(t.weight) * f64::from(t.value[c])).sum();
                        assert!((sum - f64::from(got)).abs() < 1e-5, "{filter:?} {wrap:?}: {sum} for {got}");
                    }
                }
            }
        }
    }
}
