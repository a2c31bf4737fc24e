//! The sRGB transfer curve both ways, luminance, tone curves.
//!
//! Everything here is made of single IEEE operations, so it gives the same bits at every width: powers
//! with the curve's few exponents are roots by Newton's method, not calls of a general `pow`.

use crate::math::exact;
use crate::math::lane::{Int, Lane, Num};
use crate::math::vec::Vec3;

/// Light above this counts as this much in the tone curves, so that no product overflows.
const MOST: f32 = 1e6;

/// sRGB to linear light (IEC 61966-2-1, piecewise): `c / 12.92` up to 0.04045, `((c + 0.055) / 1.055)^2.4`
/// above. Expects 0 ..= 1; values outside are continued (below by the line, above by the power). The
/// relative error is below 5e-7.
#[inline(always)]
pub fn srgb_to_linear<N: Num>(c: N) -> N {
    let a = (c.max(c.lift(0.0)) + 0.055) / 1.055;
    let square = a * a;
    // a^2.4 = a^2 * (a^2)^(1/5)
    let power = square * fifth_root(square);
    (c / 12.92).or_else(c.le(c.lift(0.04045)), power)
}

/// Linear light to sRGB (IEC 61966-2-1, piecewise): `12.92 c` up to 0.0031308, `1.055 c^(1/2.4) - 0.055`
/// above. Expects 0 ..= 1. Fine enough that all 8- and 16-bit codes survive the round trip.
#[inline(always)]
pub fn linear_to_srgb<N: Num>(c: N) -> N {
    // c^(5/12) = c^(1/4) * c^(1/6) = sqrt(r) * cbrt(r) with r = sqrt(c)
    let r = c.max(c.lift(0.0)).sqrt();
    let power = r.sqrt() * cube_root(r);
    (c * 12.92).or_else(c.le(c.lift(0.003_130_8)), power * 1.055 - 0.055)
}

/// `a^(1/5)` for `a >= 0` (0 gives a number below 1e-7): a guess from the exponent, then Newton.
#[inline(always)]
fn fifth_root<N: Num>(a: N) -> N {
    let a = a.max(a.lift(1e-37));
    // The bits of a float are its logarithm, scaled: a fifth of them, and 4/5 of the exponent's bias.
    let mut y = ((a.to_bits().to_num() * 0.2).to_int() + 0x32cc_cccc).from_bits();
    for _ in 0..4 {
        let y2 = y * y;
        y = (y * 4.0 + a / (y2 * y2)) * 0.2;
    }
    y
}

/// `a^(1/3)` for `a >= 0` (0 gives a number below 1e-12).
#[inline(always)]
fn cube_root<N: Num>(a: N) -> N {
    let a = a.max(a.lift(1e-37));
    let mut y = ((a.to_bits().to_num() * (1.0 / 3.0)).to_int() + 0x2a55_5555).from_bits();
    for _ in 0..3 {
        y = (y + y + a / (y * y)) * (1.0 / 3.0);
    }
    y
}

/// [`srgb_to_linear`] of all 8-bit codes, each rounded once from f64.
pub static SRGB8_TO_LINEAR: [f32; 256] = {
    let mut table = [0.0; 256];
    let mut k = 0;
    while k < 256 {
        table[k] = decode_f64(k as f64 / 255.0) as f32;
        k += 1;
    }
    table
};

/// The curve in f64, for the tables.
const fn decode_f64(c: f64) -> f64 {
    if c <= 0.04045 {
        return c / 12.92;
    }
    let a = (c + 0.055) / 1.055;
    let square = a * a;
    // Newton for the fifth root, from above: every step comes closer until nothing changes.
    let mut y = 1.0;
    let mut k = 0;
    while k < 60 {
        y = (y * 4.0 + square / (y * y * y * y)) / 5.0;
        k += 1;
    }
    square * y
}

/// Bits of the mantissa that choose a bucket of [`LINEAR_TO_SRGB8`].
const BUCKET: u32 = 7;
/// The lowest bucket: all numbers below 2^-13 have code 0.
const FIRST: i32 = (127 - 13) << BUCKET;
/// The largest number below 1.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

/// The table of [`linear_to_srgb8`]: per bucket (exponent and 7 bits of mantissa, from 2^-13 up to 1) a
/// number that, added to the 16 bits below, carries the 8-bit code into bit 16. A bucket holds at most one
/// step from a code to the next: near 1 a code is 0.9 % of light wide, a bucket 0.4 to 0.8 %.
pub static LINEAR_TO_SRGB8: [i32; 13 << BUCKET] = {
    let mut table = [0; 13 << BUCKET];
    let mut code: i32 = 0;
    let mut next = step(code);
    let mut k = 0;
    while k < table.len() {
        let first = ((FIRST + k as i32) as u32) << (23 - BUCKET);
        let last = first + (1 << (23 - BUCKET)) - 1;
        if code < 255 && next <= last {
            table[k] = (code << 16) + 0x10000 - (next - first) as i32;
            code += 1;
            next = step(code);
            assert!(code == 255 || next > last, "a bucket holds one step");
        } else {
            table[k] = code << 16;
        }
        k += 1;
    }
    assert!(code == 255);
    table
};

/// The bits of the smallest float whose code is above `code`, when rounded to nearest.
const fn step(code: i32) -> u32 {
    let edge = decode_f64((code as f64 + 0.5) / 255.0);
    let near = edge as f32;
    if (near as f64) < edge { near.to_bits() + 1 } else { near.to_bits() }
}

/// Linear light to an 8-bit sRGB code in every lane, the nearest code of the exact curve (ties up). Below 0
/// and NaN give 0, above 1 gives 255. Costs one lookup in a table of 6.5 KB (after F. Giesen,
/// "Float->sRGB8 using just a table lookup", but with one exact step per bucket instead of an interpolated
/// line).
#[inline(always)]
pub fn linear_to_srgb8<L: Lane>(l: L, c: L::F) -> L::I {
    let bits = c.clamp(1.0 / 8192.0, BELOW_ONE).to_bits();
    let base = l.gather_i(&LINEAR_TO_SRGB8, (bits >> (23 - BUCKET)) + -FIRST);
    (base + (bits & 0xffff)) >> 16
}

/// A number 0 ..= 1 as an integer code 0 ..= `most` (255 or 65535) in every lane, rounded to nearest (ties
/// up). Below 0 and NaN give 0, above 1 gives `most`.
#[inline(always)]
pub fn to_code<N: Num>(c: N, most: f32) -> N::Int {
    (c.saturate() * most + 0.5).to_int()
}

/// Luminance of linear RGB with the primaries of sRGB (ITU-R BT.709).
#[inline(always)]
pub fn luminance<N: Num>(c: Vec3<N>) -> N {
    c.x * 0.2126 + c.y * 0.7152 + c.z * 0.0722
}

/// Light that a tone curve can work with: neither negative nor NaN nor beyond [`MOST`].
#[inline(always)]
fn tame<N: Num>(c: Vec3<N>) -> Vec3<N> {
    c.map(|v| v.clamp(0.0, MOST))
}

/// No curve: each channel clamped to 0 ..= 1.
#[inline(always)]
pub fn clamp<N: Num>(c: Vec3<N>) -> Vec3<N> {
    c.map(N::saturate)
}

/// `c / (1 + c)` per channel (Reinhard et al. 2002, equation 3). Linear light to linear display light.
#[inline(always)]
pub fn reinhard<N: Num>(c: Vec3<N>) -> Vec3<N> {
    tame(c).map(
        #[inline(always)]
        |v| v / (v + 1.0),
    )
}

/// Rows of a matrix times a colour.
#[inline(always)]
fn rows<N: Num>(m: &[[f32; 3]; 3], c: Vec3<N>) -> Vec3<N> {
    Vec3::new(row(&m[0], c), row(&m[1], c), row(&m[2], c))
}

#[inline(always)]
fn row<N: Num>(r: &[f32; 3], c: Vec3<N>) -> N {
    c.x * r[0] + c.y * r[1] + c.z * r[2]
}

/// S. Hill's fit of the ACES reference rendering and sRGB output transforms (BakingLab, `ACES.hlsl`), without
/// an exposure factor. Linear light to linear display light.
#[inline(always)]
pub fn aces<N: Num>(c: Vec3<N>) -> Vec3<N> {
    // sRGB -> XYZ -> D65_2_D60 -> AP1 -> RRT_SAT
    let input = [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]];
    // ODT_SAT -> XYZ -> D60_2_D65 -> sRGB
    let output = [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]];
    let fitted = rows(&input, tame(c)).map(
        #[inline(always)]
        |v| (v * (v + 0.024_578_6) - 0.000_090_537) / (v * (v * 0.983_729 + 0.432_951) + 0.238_081),
    );
    clamp(rows(&output, fitted))
}

/// AgX, base look: T. Sobotka's inset and log curve with B. Wrensch's polynomial of the default contrast
/// ("Minimal AgX Implementation"). Linear light to linear display light (the curve's 2.2 power is undone).
#[inline(always)]
pub fn agx<N: Num>(c: Vec3<N>) -> Vec3<N> {
    let inset = [
        [0.842_479_06, 0.078_433_6, 0.079_223_745],
        [0.042_328_242, 0.878_468_6, 0.079_166_13],
        [0.042_375_655, 0.078_433_6, 0.879_143],
    ];
    let outset = [
        [1.196_879, -0.098_020_88, -0.099_029_74],
        [-0.052_896_85, 1.151_903_1, -0.098_961_18],
        [-0.052_971_635, -0.098_043_45, 1.151_073_7],
    ];
    let shaped = rows(&inset, tame(c)).map(
        #[inline(always)]
        |v| agx_curve(v),
    );
    // v^2.2 = v^2 * v^(1/5)
    clamp(rows(&outset, shaped)).map(
        #[inline(always)]
        |v| v * v * fifth_root(v),
    )
}

#[inline(always)]
fn agx_curve<N: Num>(v: N) -> N {
    let (low, high) = (-12.473_93, 4.026_069);
    // The clamp of the logarithm, done before it: 2^low and 2^high.
    let x = (exact::log2(v.clamp(1.0e-4, 20.0)).clamp(low, high) - low) / (high - low);
    let x2 = x * x;
    let x4 = x2 * x2;
    x4 * x2 * 15.5 - x4 * x * 40.14 + x4 * 31.96 - x2 * x * 6.868 + x2 * 0.4298 + x * 0.1191 - 0.00232
}

/// Khronos PBR Neutral (Khronos ToneMapping repository, 2024): exact below 0.76 but for the Fresnel offset,
/// compressed and desaturated above. Linear light to linear display light.
#[inline(always)]
pub fn khronos_neutral<N: Num>(c: Vec3<N>) -> Vec3<N> {
    const START: f32 = 0.8 - 0.04;
    const DESATURATION: f32 = 0.15;
    const D: f32 = 1.0 - START;
    let c = tame(c);
    let x = c.x.min(c.y).min(c.z);
    let offset = (x - x * x * 6.25).or_else(x.lt(x.lift(0.08)), x.lift(0.04));
    let c = c.map(|v| v - offset);
    let peak = c.x.max(c.y).max(c.z);
    let new_peak = peak.lift(1.0) - (peak + D - START).recip() * (D * D);
    let g = peak.lift(1.0) - ((peak - new_peak) * DESATURATION + 1.0).recip();
    // Below the start `new_peak / peak` may be anything, division by zero included; it is not taken.
    let scale = new_peak / peak;
    let compressed = c.map(|v| g.mix(v * scale, new_peak));
    c.or_else(peak.lt(peak.lift(START)), compressed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::lane::{Kernel, Level, One};

    #[test]
    fn all_codes_survive_the_round_trip() {
        for k in 0..256u32 {
            assert_eq!(to_code(linear_to_srgb(srgb_to_linear(k as f32 / 255.0)), 255.0).0, k as i32);
            assert_eq!(linear_to_srgb8(One, SRGB8_TO_LINEAR[k as usize]).0, k as i32);
        }
        for k in 0..65536u32 {
            assert_eq!(to_code(linear_to_srgb(srgb_to_linear(k as f32 / 65535.0)), 65535.0).0, k as i32);
        }
    }

    #[test]
    fn the_curve_has_the_standards_values() {
        // Published: 0.5 -> 0.21404114 (IEC 61966-2-1), 0.18 -> 0.46135613, and the knee.
        assert!((srgb_to_linear(0.5f32) - 0.214_041_14).abs() < 1e-7);
        assert!((linear_to_srgb(0.18f32) - 0.461_356_13).abs() < 1e-7);
        assert!((srgb_to_linear(0.04045f32) - 0.003_130_805).abs() < 1e-9);
        assert_eq!((srgb_to_linear(0.0f32), linear_to_srgb(0.0f32)), (0.0, 0.0));
        // 1.055 - 0.055 in f32 is one unit in the last place below 1.
        assert_eq!((srgb_to_linear(1.0f32), linear_to_srgb(1.0f32)), (1.0, BELOW_ONE));
        for (k, &v) in SRGB8_TO_LINEAR.iter().enumerate() {
            let x = k as f64 / 255.0;
            #[allow(clippy::disallowed_methods)]
            let want = if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) };
            assert_eq!(v, want as f32, "{k}");
            // The generic function is within the error that it states.
            assert!((f64::from(srgb_to_linear(x as f32)) - want).abs() <= 5e-7 * want, "{k}");
        }
    }

    #[test]
    fn the_table_rounds_exactly_at_every_step() {
        for code in 0..255 {
            let bits = step(code);
            assert_eq!(linear_to_srgb8(One, f32::from_bits(bits)).0, code + 1);
            assert_eq!(linear_to_srgb8(One, f32::from_bits(bits - 1)).0, code);
        }
        for (v, want) in [(0.0, 0), (-1.0, 0), (f32::NAN, 0), (1e-20, 0), (1.0, 255), (7.0, 255), (f32::INFINITY, 255)]
        {
            assert_eq!(linear_to_srgb8(One, v).0, want, "{v}");
        }
    }

    struct All<'a>(&'a [f32]);
    impl Kernel for All<'_> {
        type Out = Vec<u32>;
        #[inline(always)]
        fn run<L: Lane>(self, l: L) -> Vec<u32> {
            let mut out = Vec::new();
            for c in self.0.chunks_exact(16).flat_map(|c| c.chunks_exact(L::WIDTH)) {
                let v = l.load(c);
                let rgb = Vec3::new(v, v * 0.5, v * v);
                let mut all = vec![srgb_to_linear(v), linear_to_srgb(v), luminance(rgb)];
                for f in [clamp, reinhard, aces, agx, khronos_neutral] {
                    all.extend(f(rgb).array());
                }
                for k in 0..L::WIDTH {
                    out.extend(all.iter().map(|v| v.lane(k).to_bits()));
                    out.push(linear_to_srgb8(l, v).lane(k) as u32);
                }
            }
            out
        }
    }

    #[test]
    fn the_same_bits_at_every_level() {
        let values: Vec<f32> = (0..4096).map(|k| (k as f32 - 40.0) * (k as f32) / 1e5).collect();
        let levels = Level::available();
        let want = levels[0].run(All(&values));
        for level in levels {
            assert!(level.run(All(&values)) == want, "{}", level.name());
        }
    }

    fn close(a: Vec3, b: [f32; 3], tolerance: f32) {
        let d = (a - Vec3::from(b)).map(f32::abs);
        assert!(d.x.max(d.y).max(d.z) <= tolerance, "{a:?} is not {b:?}");
    }

    #[test]
    fn tone_curves_have_their_published_values() {
        close(clamp(Vec3::new(-1.0, 0.5, 2.0)), [0.0, 0.5, 1.0], 0.0);
        close(reinhard(Vec3::new(0.0, 1.0, 3.0)), [0.0, 0.5, 0.75], 0.0);
        // Khronos PBR Neutral: below the start only the offset of 0.04 is taken; a base colour under F0 = 0.04
        // comes back: 0.04 + c -> c.
        close(khronos_neutral(Vec3::new(0.54, 0.24, 0.14)), [0.5, 0.2, 0.1], 1e-6);
        // x < 0.08: offset x - 6.25 x^2, so grey 0.04 becomes 6.25 * 0.04^2 = 0.01.
        close(khronos_neutral(Vec3::splat(0.04)), [0.01; 3], 1e-6);
        // Grey 1.04: peak 1, d = 0.24, new peak 1 - 0.0576 / 0.48 = 0.88.
        close(khronos_neutral(Vec3::splat(1.04)), [0.88; 3], 1e-6);
        // Red 2: no offset (the least channel is 0), peak 2, new 1 - 0.0576 / 1.48, mixed towards white.
        let (p, g) = (1.0 - 0.0576 / 1.48, 1.0 - 1.0 / (0.15 * (2.0 - (1.0 - 0.0576 / 1.48)) + 1.0));
        close(khronos_neutral(Vec3::new(2.0, 0.0, 0.0)), [p, p * g, p * g], 1e-6);
        // Hill's fit at grey 1: the rows of the input matrix sum to 1, (1.0245786 - 0.000090537) /
        // (0.983729 + 0.432951 + 0.238081) = 0.619115, and the output rows sum to 1 within 1e-5.
        close(aces(Vec3::splat(1.0)), [0.619_115; 3], 1e-5);
        // AgX puts middle grey 0.18 at half of the display's range before the power of 2.2: 0.5^2.2 = 0.2176; the
        // polynomial is within 0.004 of the curve.
        close(agx(Vec3::splat(0.18)), [0.2176; 3], 0.004);
    }

    #[test]
    fn tone_curves_rise_from_black_to_white_and_stay_within() {
        for f in [clamp::<f32>, reinhard, aces, agx, khronos_neutral] {
            let mut last = -1.0;
            for k in 0..2000 {
                let v = f(Vec3::splat(k as f32 * k as f32 * 1e-5));
                assert!(v.x >= last - 1e-6 && v.x >= 0.0 && v.x <= 1.0, "{k} {v:?}"); // 1e-6: rounding
                last = v.x;
            }
            close(f(Vec3::splat(0.0)), [0.0; 3], 1e-6);
            for hostile in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -0.0] {
                let v = f(Vec3::new(hostile, 0.5, 0.0));
                assert!(v.array().iter().all(|v| (0.0..=1.0).contains(v)), "{hostile} {v:?}");
            }
        }
    }

    #[test]
    fn luminance_of_white_is_one() {
        assert!((luminance(Vec3::splat(1.0f32)) - 1.0).abs() < 1e-6);
        assert_eq!(luminance(Vec3::new(0.0f32, 1.0, 0.0)), 0.7152);
    }
}
