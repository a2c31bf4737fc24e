//! Normal <-> texel (rows 49 and 52): tangent space, +Y or -Y, three or two channels.
//!
//! A normal map holds unit vectors `n` about the surface: x along the tangent (growing u), y along the bitangent
//! (up the image for +Y maps, as OpenGL, glTF and Blender write them; down for -Y maps, as DirectX), z along the
//! surface's normal. A texel of `b` bits holds `round((2^b - 1) (n/2 + 1/2))`, so a component comes back with an
//! error of at most `1 / (2^b - 1)` before the vector is made of unit length again: 0.0039 for 8 bits. Zero lies
//! between two codes: the flat texel (128, 128, 255) leans by 0.32 degrees, at full depth of 16 bits by 0.0012.
//! Maps that were written with another zero, the code 128 (32768), are read through [`exact_zero`]: then that texel is
//! flat and a component's error is at most `1 / (2^b - 2)`.

use crate::math::lane::Num;
use crate::math::vec::{Vec3, Vec4};

/// The values `0 ..= 1` of a texel that holds the tangent-space unit normal `n`; [`quantize`] makes integers of
/// them.
#[inline(always)]
pub fn encode<N: Num>(n: Vec3<N>, y_down: bool) -> Vec3<N> {
    let y = if y_down { -n.y } else { n.y };
    Vec3::new(n.x, y, n.z).map(|v| v * 0.5 + 0.5)
}

/// The integer `0 ..= max` of a texel value `0 ..= 1`: rounded, halves up; NaN becomes 0.
pub fn quantize(value: f32, max: u32) -> u32 {
    (value.saturate() * max as f32 + 0.5).floor() as u32
}

/// The 8-bit texel of a tangent-space unit normal.
pub fn encode_u8(n: Vec3, y_down: bool) -> [u8; 3] {
    encode(n, y_down).array().map(|v| quantize(v, 255) as u8)
}

/// A texel value `0 ..= 1` of `v` in -1 ..= 1 with the exact zero: the code `(max + 1) / 2 + v (max - 1) / 2`, such as
/// 128 + 127 v. [`quantize`] makes the integer of it.
pub fn encode_exact(v: f32, max: u32) -> f32 {
    let (middle, half) = (max.div_ceil(2) as f32, (max / 2) as f32);
    (middle + half * v) / max as f32
}

/// Moves a texel's values so that [`decode`] finds 0 exactly where the code `(max + 1) / 2` stands, -1 at the code 1
/// (and at 0) and 1 at `max`.
#[inline(always)]
pub fn exact_zero<N: Num>(texel: Vec4<N>, max: u32) -> Vec4<N> {
    let (middle, half) = (max.div_ceil(2) as f32, (max / 2) as f32);
    let move_to = |c: N| {
        let v = (c * max as f32 - middle) * (0.5 / half);
        v.max(c.lift(-0.5)) + 0.5
    };
    Vec4::new(move_to(texel.x), move_to(texel.y), move_to(texel.z), texel.w)
}

/// The tangent-space unit normal that a texel of values `0 ..= 1` holds: `2 c - 1`, y turned when it points down
/// the image, x and y times `scale`, then made of unit length.
///
/// With `channels` 2, z is rebuilt from x and y as they were stored. What has no direction (all zero, NaN)
/// becomes `(0, 0, 1)`.
#[inline(always)]
pub fn decode<N: Num>(texel: Vec4<N>, scale: f32, y_down: bool, channels: u8) -> Vec3<N> {
    let zero = texel.x.lift(0.0);
    let one = texel.x.lift(1.0);
    let x = texel.x * 2.0 - 1.0;
    let y = texel.y * 2.0 - 1.0;
    let y = if y_down { -y } else { y };
    let z = if channels == 2 { (one - x * x - y * y).max(zero).sqrt() } else { texel.z * 2.0 - 1.0 };
    let (x, y) = (x * scale, y * scale);
    let length = (x * x + y * y + z * z).sqrt();
    // A comparison with NaN is false, so NaN takes the guard's value too.
    let valid = length.gt(one * 1e-8);
    let r = one / length.or_else(valid, one);
    Vec3::new((x * r).or_else(valid, zero), (y * r).or_else(valid, zero), (z * r).or_else(valid, one))
}

/// A tangent-space normal in the space of `t` and `n`: `x t + y b + z n` with `b = cross(n, t) * sign`, made of
/// unit length; `n` where the sum vanishes.
///
/// As MikkTSpace wants it, the interpolated `t` and `n` come in as they are, not made of unit length, and the
/// bitangent is made here, per fragment (row 60 with its sign).
#[inline(always)]
pub fn to_world<N: Num>(n_ts: Vec3<N>, t: Vec3<N>, sign: N, n: Vec3<N>) -> Vec3<N> {
    let b = n.cross(t) * sign;
    let v = t * n_ts.x + b * n_ts.y + n * n_ts.z;
    let length = v.length();
    let valid = length.gt(length.lift(1e-12));
    (v * (length.lift(1.0) / length.or_else(valid, length.lift(1.0)))).or_else(valid, n.normalize())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::exact;
    use crate::math::lane::{Kernel, Lane, Level};
    use crate::math::vec::basis;

    /// Directions all over the upper half, the rim included.
    fn directions() -> impl Iterator<Item = Vec3> {
        (0..=40).flat_map(|i| {
            (0..64).map(move |j| {
                let (s, c) = exact::sin_cos_f64(f64::from(i) / 40.0 * std::f64::consts::FRAC_PI_2);
                let (sa, ca) = exact::sin_cos_f64(f64::from(j) / 64.0 * std::f64::consts::TAU);
                Vec3::new((s * ca) as f32, (s * sa) as f32, c as f32)
            })
        })
    }

    fn texel(v: [f32; 3]) -> Vec4 {
        Vec3::from(v).extend(1.0)
    }

    #[test]
    fn row_49_round_trip_error_is_bounded_by_the_bit_depth() {
        for max in [255u32, 65535] {
            let stored = |n: Vec3, y_down| encode(n, y_down).array().map(|v| quantize(v, max) as f32 / max as f32);
            for n in directions() {
                for y_down in [false, true] {
                    let d = decode(texel(stored(n, y_down)), 1.0, y_down, 3);
                    // Half a code is 1 / max in a component; normalising moves the vector by no more than that
                    // again. The rest is f32 rounding.
                    let bound = 2.0 * 3.0f32.sqrt() / max as f32 + 4e-7;
                    assert!((d - n).length() <= bound, "{n:?} {d:?} {max}");
                    assert!((d.length() - 1.0).abs() < 3e-7);
                    // Two channels: z is as good away from the rim, where dz = (x dx + y dy) / z.
                    let d = decode(texel(stored(n, y_down)), 1.0, y_down, 2);
                    if n.z > 0.3 {
                        assert!((d - n).length() <= bound * (1.0 + 1.0 / n.z), "{n:?} {d:?} {max}");
                    }
                    assert!(d.is_finite() && (d.length() - 1.0).abs() < 3e-7 && d.z >= 0.0);
                }
            }
            // Law 7, the other way: what was stored is stored again, whatever it was.
            for k in [0, 1, 100, max / 2, max / 2 + 1, max - 1, max] {
                let d = decode(Vec4::new(k as f32 / max as f32, 0.5, 0.5, 1.0), 1.0, false, 2).x;
                assert_eq!(quantize(encode(Vec3::new(d, 0.0, 0.0), false).x, max), k);
            }
        }
    }

    #[test]
    fn row_49_an_exact_zero_is_an_option() {
        for max in [255u32, 65535] {
            let store = |v: f32| quantize(encode_exact(v, max), max);
            let read = |n: [u32; 3]| {
                let texel = Vec3::from(n.map(|c| c as f32 / max as f32)).extend(1.0);
                decode(exact_zero(texel, max), 1.0, false, 3)
            };
            let middle = max.div_ceil(2);
            // Flat is flat, bit for bit, where half of the largest code leans.
            assert_eq!([store(0.0), store(1.0), store(-1.0)], [middle, max, 1]);
            assert_eq!(read([middle, middle, max]).array(), [0.0, 0.0, 1.0]);
            assert!(decode(Vec3::from([middle as f32 / max as f32; 3]).extend(1.0), 1.0, false, 3).x > 0.0);
            // Codes 0 and 1 are both -1; each axis is hit exactly.
            for (code, n) in [(0, -1.0), (1, -1.0), (max, 1.0)] {
                assert_eq!(read([code, middle, middle]).array(), [n, 0.0, 0.0]);
            }
            // As in the other policy: half a code per component, and as much again for the unit length.
            let bound = 2.0 * 3.0f32.sqrt() / (max - 1) as f32 + 4e-7;
            for n in directions() {
                assert!((read(n.array().map(store)) - n).length() <= bound, "{n:?} {max}");
            }
        }
    }

    #[test]
    fn row_52_flat_is_blue() {
        assert_eq!(encode_u8(Vec3::new(0.0, 0.0, 1.0), false), [128, 128, 255]);
        let d = decode(texel([128.0 / 255.0, 128.0 / 255.0, 1.0]), 1.0, false, 3);
        // Half a code of lean along x and y: atan(√2 / 255) = 0.32 degrees.
        assert!(d.z > 0.99998 && d.x > 0.0 && d.x < 1.0 / 254.0);
        // Where 0.5 can be stored exactly (in floats), flat is flat.
        assert_eq!(decode(texel([0.5, 0.5, 1.0]), 1.0, false, 3).array(), [0.0, 0.0, 1.0]);
    }

    #[test]
    fn row_53_green_is_up_unless_y_is_down() {
        let up = texel([0.5, 0.8, 0.9]);
        assert!(decode(up, 1.0, false, 3).y > 0.0 && decode(up, 1.0, true, 3).y < 0.0);
    }

    #[test]
    fn scale_tilts_and_zero_scale_is_flat() {
        let t = texel([0.8, 0.5, 0.8]);
        let (one, two) = (decode(t, 1.0, false, 3), decode(t, 2.0, false, 3));
        assert!((two.x / two.z - 2.0 * one.x / one.z).abs() < 1e-5);
        assert_eq!(decode(t, 0.0, false, 3).array(), [0.0, 0.0, 1.0]);
    }

    #[test]
    fn what_has_no_direction_becomes_flat() {
        for bad in [[0.5, 0.5, 0.5], [f32::NAN, 0.5, 1.0], [0.5, 0.5, f32::NAN]] {
            assert_eq!(decode(texel(bad), 1.0, false, 3).array(), [0.0, 0.0, 1.0]);
        }
        // Two channels outside of the circle: z is 0, not NaN.
        let d = decode(texel([1.0, 1.0, 0.0]), 1.0, false, 2);
        assert!(d.z == 0.0 && (d.length() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn to_world_turns_flat_to_the_normal_and_keeps_angles() {
        for n in directions() {
            let (t, b) = basis(n);
            let w = |v: Vec3, sign: f32| to_world(v, t, sign, n);
            assert!((w(Vec3::new(0.0, 0.0, 1.0), 1.0) - n).length() < 1e-6);
            assert!((w(Vec3::new(1.0, 0.0, 0.0), 1.0) - t).length() < 1e-6);
            assert!((w(Vec3::new(0.0, 1.0, 0.0), 1.0) - b).length() < 1e-6);
            assert!((w(Vec3::new(0.0, 1.0, 0.0), -1.0) + b).length() < 1e-6);
        }
        let n = Vec3::new(0.0, 2.0, 0.0);
        assert_eq!(to_world(Vec3::new(1.0, 0.0, 0.0), Vec3::splat(0.0), 1.0, n).array(), [0.0, 1.0, 0.0]);
    }

    #[test]
    fn every_width_gives_the_same_bits() {
        struct Wide;
        impl Kernel for Wide {
            type Out = Vec<u32>;
            #[inline(always)]
            fn run<L: Lane>(self, l: L) -> Vec<u32> {
                let mut out = Vec::new();
                for k in (0..256).step_by(L::WIDTH) {
                    let x = l.f_from(|j| (k + j) as f32 / 255.0);
                    let n = decode(Vec4::new(x, x * x, l.f(0.9), x), 1.3, true, 3);
                    let w = to_world(n, Vec3::new(x, l.f(0.1), l.f(0.5)), l.f(-1.0), Vec3::new(l.f(0.2), x, l.f(1.0)));
                    for j in 0..L::WIDTH {
                        out.extend(n.array().map(|v| v.lane(j).to_bits()));
                        out.extend(w.array().map(|v| v.lane(j).to_bits()));
                    }
                }
                out
            }
        }
        let all: Vec<_> = Level::available().into_iter().map(|l| l.run(Wide)).collect();
        assert!(all.iter().all(|v| *v == all[0]));
    }
}
