//! Points that fill a square evenly, and what is made from them: disks, hemispheres.
//!
//! All sequences are functions of an index, so that results depend on no state and no thread.

use super::exact;
use super::vec::{Vec2, Vec3};

/// The bits of `i` mirrored at the binary point: van der Corput's sequence, in 0 .. 1.
pub fn radical_inverse_2(i: u32) -> f32 {
    // 24 bits fit a float; more could round up to 1.
    (i.reverse_bits() >> 8) as f32 / 16_777_216.0
}

/// The digits of `i` in `base` (at least 2) mirrored at the point, in 0 .. 1. Base 2, 3, 5, ... make
/// Halton's sequence.
pub fn radical_inverse(base: u32, i: u32) -> f32 {
    let (mut i, base) = (i, base.max(2));
    let (mut v, mut scale) = (0.0f64, 1.0f64);
    while i > 0 {
        scale /= f64::from(base);
        v += f64::from(i % base) * scale;
        i /= base;
    }
    below_one(v)
}

/// To f32, kept below 1.
fn below_one(v: f64) -> f32 {
    (v as f32).min(0.999_999_94)
}

/// Point `i` of `n` of Hammersley's set: `((i + 1/2)/n, radical_inverse_2(i))`.
pub fn hammersley(i: u32, n: u32) -> Vec2 {
    Vec2::new(below_one((f64::from(i) + 0.5) / f64::from(n.max(1))), radical_inverse_2(i))
}

/// Point `i` of Roberts' R2 sequence: good for any number of points, without knowing how many.
pub fn r2(i: u32) -> Vec2 {
    // Fractional parts of multiples of 1/p and 1/p^2, p^3 = p + 1, in 32-bit fixed point: exact.
    let part = |step: u32| (i.wrapping_mul(step).wrapping_add(1 << 31) >> 8) as f32 / 16_777_216.0;
    Vec2::new(part(3_242_174_889), part(2_447_445_414))
}

/// A number without pattern from a number (O'Neill's PCG-RXS-M-XS, 32 bits).
pub fn hash(v: u32) -> u32 {
    let s = v.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let w = ((s >> ((s >> 28) + 4)) ^ s).wrapping_mul(277_803_737);
    (w >> 22) ^ w
}

/// `p` shifted by `shift` on the torus (Cranley-Patterson): other points, as evenly spread.
pub fn rotate(p: Vec2, shift: Vec2) -> Vec2 {
    let wrap = |v: f32| if v >= 1.0 { v - 1.0 } else { v };
    Vec2::new(wrap(p.x + shift.x), wrap(p.y + shift.y))
}

/// The unit square to the unit disk, equal areas to equal areas (Shirley and Chiu 1997).
pub fn disk(p: Vec2) -> Vec2 {
    let (a, b) = (2.0 * p.x - 1.0, 2.0 * p.y - 1.0);
    if a == 0.0 && b == 0.0 {
        return Vec2::new(0.0, 0.0);
    }
    const QUARTER: f32 = core::f32::consts::FRAC_PI_4;
    let (r, phi) =
        if a.abs() > b.abs() { (a, QUARTER * (b / a)) } else { (b, core::f32::consts::FRAC_PI_2 - QUARTER * (a / b)) };
    let (s, c) = exact::sin_cos(phi);
    Vec2::new(r * c, r * s)
}

/// The unit square to the hemisphere around +Z, density cosine / π (Malley's method).
pub fn cosine_hemisphere(p: Vec2) -> Vec3 {
    let d = disk(p);
    Vec3::new(d.x, d.y, (1.0 - d.x * d.x - d.y * d.y).max(0.0).sqrt())
}

/// The unit square to the hemisphere around +Z, density 1 / 2π.
pub fn uniform_hemisphere(p: Vec2) -> Vec3 {
    let d = disk(p);
    // Lambert's equal-area map: height 1 - r^2.
    let r2 = d.x * d.x + d.y * d.y;
    let k = (2.0 - r2).max(0.0).sqrt();
    Vec3::new(d.x * k, d.y * k, 1.0 - r2)
}

/// The unit square to the unit sphere, density 1 / 4π.
pub fn uniform_sphere(p: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * p.x;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (s, c) = exact::sin_cos(p.y * core::f32::consts::TAU);
    Vec3::new(r * c, r * s, z)
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: u32 = 4096;

    #[test]
    fn sequences_start_as_published() {
        assert_eq!([1, 2, 3, 4].map(radical_inverse_2), [0.5, 0.25, 0.75, 0.125]);
        assert_eq!([1, 2, 3].map(|i| radical_inverse(3, i)), [1.0 / 3.0, 2.0 / 3.0, 1.0 / 9.0]);
        assert_eq!(hammersley(3, 8), Vec2::new(0.4375, 0.75));
        // Roberts: 0.5 + 0.7548776662 and 0.5 + 0.5698402910, modulo 1; 24 bits.
        let p = r2(1);
        assert!((p.x - 0.254_877_7).abs() < 1e-6 && (p.y - 0.069_840_3).abs() < 1e-6, "{p:?}");
    }

    #[test]
    fn points_are_even_and_inside() {
        for f in [|i| hammersley(i, N), r2, |i| Vec2::new(radical_inverse(2, i), radical_inverse(3, i))] {
            let mut cells = [0u32; 256];
            for i in 0..N {
                let p = f(i);
                assert!((0.0..1.0).contains(&p.x) && (0.0..1.0).contains(&p.y));
                cells[(p.x * 16.0) as usize * 16 + (p.y * 16.0) as usize] += 1;
            }
            // 16 points a cell, within a few: random ones would miss by 12 somewhere.
            assert!(cells.iter().all(|&n| (11..=21).contains(&n)), "{cells:?}");
        }
        assert_eq!(rotate(Vec2::new(0.75, 0.25), Vec2::new(0.5, 0.5)), Vec2::new(0.25, 0.75));
        assert_ne!(hash(1), hash(2));
    }

    #[test]
    fn hemispheres_and_spheres_have_their_moments() {
        let mean = |f: fn(Vec2) -> Vec3| {
            let sum = (0..N).fold([0.0f64; 4], |s, i| {
                let v = f(hammersley(i, N));
                assert!((v.length2() - 1.0).abs() < 1e-5);
                [s[0] + f64::from(v.x), s[1] + f64::from(v.y), s[2] + f64::from(v.z), s[3] + f64::from(v.z * v.z)]
            });
            sum.map(|v| v / f64::from(N))
        };
        // Means of z and z^2: 2/3 and 1/2 by cosine, 1/2 and 1/3 uniform, 0 and 1/3 on the sphere. 4096 even
        // points err by about 1/4096 of the range.
        let all = [(mean(cosine_hemisphere), 2.0 / 3.0, 0.5), (mean(uniform_hemisphere), 0.5, 1.0 / 3.0)];
        for (m, z, z2) in all.into_iter().chain([(mean(uniform_sphere), 0.0, 1.0 / 3.0)]) {
            assert!(m[0].abs() < 2e-3 && m[1].abs() < 2e-3, "{m:?}");
            assert!((m[2] - z).abs() < 2e-3 && (m[3] - z2).abs() < 2e-3, "{m:?}");
        }
        assert_eq!(disk(Vec2::new(0.5, 0.5)), Vec2::new(0.0, 0.0));
        assert!((disk(Vec2::new(1.0, 0.5)).x - 1.0).abs() < 1e-6);
    }
}
