//! Microfacet reflection: distribution D, masking-shadowing G, Fresnel F, and sampling. For shading, baking
//! and path tracing alike.
//!
//! GGX / Trowbridge-Reitz with height-correlated Smith masking (Heitz 2014, "Understanding the
//! Masking-Shadowing Function"), Schlick's Fresnel. `alpha` is the square of perceptual roughness (glTF).
//! Cosines are between unit vectors: n normal, v view, l light, h = (l + v)/|l + v|.

use super::exact;
use super::lane::{Lane, Num};
use super::vec::{Vec2, Vec3};
use core::f32::consts::PI;

/// The least perceptual roughness. Below it, the peak of D (1 / (pi alpha²), 8e4 here) would be narrower than
/// the rounding of a cosine in single precision, and a highlight would sparkle.
pub const MIN_ROUGHNESS: f32 = 0.045;

/// `alpha` of a perceptual roughness, clamped to [`MIN_ROUGHNESS`] ..= 1.
#[inline(always)]
pub fn alpha<N: Num>(roughness: N) -> N {
    let r = roughness.clamp(MIN_ROUGHNESS, 1.0);
    r * r
}

/// Density of facets that face h, per steradian: `alpha² / (pi ((n.h)² (alpha² - 1) + 1)²)`.
#[inline(always)]
pub fn d_ggx<N: Num>(n_h: N, alpha: N) -> N {
    let one = n_h.lift(1.0);
    let c = n_h.saturate();
    let a2 = alpha * alpha;
    // 1 - c² as a product, and a2 added last: no cancellation near the peak.
    let d = (one - c) * (one + c) + a2 * (c * c);
    a2 / (d * d * PI)
}

/// Smith's masking of one direction: the share of facets that it sees.
#[inline(always)]
pub fn g1<N: Num>(n_v: N, alpha: N) -> N {
    let a2 = alpha * alpha;
    n_v * 2.0 / (n_v + (a2 + (n_v.lift(1.0) - a2) * (n_v * n_v)).sqrt())
}

/// Height-correlated Smith masking-shadowing over `4 (n.l) (n.v)`: a specular BRDF is `D * V * F`.
#[inline(always)]
pub fn v_smith<N: Num>(n_l: N, n_v: N, alpha: N) -> N {
    let one = n_l.lift(1.0);
    let a2 = alpha * alpha;
    let v = n_l * (a2 + (one - a2) * (n_v * n_v)).sqrt();
    let l = n_v * (a2 + (one - a2) * (n_l * n_l)).sqrt();
    // Both cosines 0: the product with n.l is 0 all the same.
    one * 0.5 / (v + l).max(n_l.lift(1e-7))
}

/// `(1 - cos)^5`
#[inline(always)]
pub fn schlick<N: Num>(cos: N) -> N {
    let m = (cos.lift(1.0) - cos).saturate();
    let m2 = m * m;
    m2 * m2 * m
}

/// Schlick's Fresnel: `f0` facing, `f90` grazing.
#[inline(always)]
pub fn f_schlick<N: Num>(v_h: N, f0: Vec3<N>, f90: N) -> Vec3<N> {
    let s = schlick(v_h);
    f0.map(|f0| f0 + (f90 - f0) * s)
}

/// A facet's normal as seen from `v` (unit, in a frame with n = +Z, v.z > 0), distributed with the density of
/// visible normals. `u` in 0 ..= 1. Heitz 2018, "Sampling the GGX Distribution of Visible Normals".
#[inline(always)]
pub fn sample_visible<N: Num>(v: Vec3<N>, alpha: N, u: Vec2<N>) -> Vec3<N> {
    let (zero, one) = (alpha.lift(0.0), alpha.lift(1.0));
    let stretched = Vec3::new(v.x * alpha, v.y * alpha, v.z).normalize();
    let length2 = stretched.x * stretched.x + stretched.y * stretched.y;
    let upright = length2.le(alpha.lift(1e-14));
    let r = one.or_else(upright, length2).sqrt().recip();
    let t1 = Vec3::new(one.or_else(upright, -stretched.y * r), zero.or_else(upright, stretched.x * r), zero);
    let t2 = stretched.cross(t1);
    let radius = u.x.saturate().sqrt();
    let (sin, cos) = exact::sin_cos(u.y * (2.0 * PI));
    let (p1, p2) = (radius * cos, radius * sin);
    let s = (one + stretched.z) * 0.5;
    let p2 = (one - s) * (one - p1 * p1).max(zero).sqrt() + s * p2;
    let p3 = (one - p1 * p1 - p2 * p2).max(zero).sqrt();
    let h = t1 * p1 + t2 * p2 + stretched * p3;
    Vec3::new(h.x * alpha, h.y * alpha, h.z.max(zero)).normalize()
}

/// Density, per steradian of h, of [`sample_visible`]: `G1(v) D (v.h) / (n.v)`. Divide by `4 (v.h)` for the
/// density of the mirrored direction.
#[inline(always)]
pub fn pdf_visible<N: Num>(n_v: N, n_h: N, v_h: N, alpha: N) -> N {
    g1(n_v, alpha) * d_ggx(n_h, alpha) * v_h.max(n_v.lift(0.0)) / n_v.max(n_v.lift(1e-7))
}

/// Points per side of [`ALBEDO`].
const SIDE: usize = 16;

/// Directional albedo of the lobe: `(a, b)` with `f0 a + f90 b` = the integral over l of `D V F 4 (n.l)`, i.e. what
/// a constant environment of radiance 1 gives (the "DFG" term of image-based lighting). From a table,
/// bilinear in √(n.v) and roughness; within 0.01, and within 0.04 where both are below 0.1.
#[inline(always)]
pub fn albedo<L: Lane>(l: L, n_v: L::F, roughness: L::F) -> (L::F, L::F) {
    let last = (SIDE - 1) as f32;
    let x = n_v.max(l.f(0.0)).sqrt().saturate() * last;
    let y = roughness.saturate() * last;
    let (kx, ky) = (x.floor().min(l.f(last - 1.0)), y.floor().min(l.f(last - 1.0)));
    let (tx, ty) = (x - kx, y - ky);
    let k = ky.to_int() * SIDE as i32 + kx.to_int();
    let (whole, grazing) = (bilinear(l, &ALBEDO, k, tx, ty), bilinear(l, &GRAZING, k, tx, ty));
    (whole - grazing, grazing)
}

#[inline(always)]
fn bilinear<L: Lane>(l: L, table: &[f32; SIDE * SIDE], k: L::I, tx: L::F, ty: L::F) -> L::F {
    let side = SIDE as i32;
    let above = tx.mix(l.gather(table, k), l.gather(table, k + 1));
    let below = tx.mix(l.gather(table, k + side), l.gather(table, k + (side + 1)));
    ty.mix(above, below)
}

/// `a + b` of [`albedo`]: rows of roughness 0 ..= 1, columns of √(n.v) 0 ..= 1. The test beside integrates it anew.
#[rustfmt::skip]
const ALBEDO: [f32; SIDE * SIDE] = [
    0.9525, 0.9953, 0.9997, 0.9999, 0.9999, 0.9999, 0.9999, 1.0000, 1.0000, 1.0000, 1.0000, 1.0000, 1.0000, 1.0000, 1.0000, 1.0000,
    0.9952, 0.8920, 0.9645, 0.9927, 0.9978, 0.9991, 0.9995, 0.9997, 0.9998, 0.9999, 0.9999, 0.9999, 0.9999, 0.9999, 0.9999, 0.9999,
    0.9988, 0.9524, 0.8917, 0.9219, 0.9643, 0.9844, 0.9925, 0.9960, 0.9976, 0.9984, 0.9989, 0.9992, 0.9994, 0.9995, 0.9996, 0.9996,
    0.9994, 0.9769, 0.9239, 0.8906, 0.9045, 0.9373, 0.9633, 0.9787, 0.9871, 0.9917, 0.9944, 0.9959, 0.9969, 0.9976, 0.9980, 0.9983,
    0.9996, 0.9859, 0.9498, 0.9090, 0.8876, 0.8946, 0.9177, 0.9420, 0.9607, 0.9732, 0.9813, 0.9864, 0.9897, 0.9918, 0.9933, 0.9943,
    0.9997, 0.9896, 0.9631, 0.9281, 0.8969, 0.8814, 0.8848, 0.9010, 0.9214, 0.9402, 0.9550, 0.9658, 0.9734, 0.9788, 0.9825, 0.9851,
    0.9997, 0.9910, 0.9691, 0.9392, 0.9079, 0.8829, 0.8703, 0.8713, 0.8827, 0.8993, 0.9167, 0.9322, 0.9449, 0.9547, 0.9622, 0.9678,
    0.9997, 0.9912, 0.9709, 0.9434, 0.9132, 0.8850, 0.8636, 0.8522, 0.8514, 0.8592, 0.8722, 0.8875, 0.9027, 0.9163, 0.9278, 0.9371,
    0.9996, 0.9906, 0.9699, 0.9427, 0.9124, 0.8825, 0.8562, 0.8366, 0.8253, 0.8225, 0.8270, 0.8368, 0.8496, 0.8636, 0.8773, 0.8899,
    0.9996, 0.9895, 0.9670, 0.9382, 0.9064, 0.8742, 0.8443, 0.8189, 0.7995, 0.7872, 0.7820, 0.7833, 0.7896, 0.7995, 0.8115, 0.8246,
    0.9995, 0.9879, 0.9628, 0.9310, 0.8961, 0.8608, 0.8270, 0.7965, 0.7706, 0.7503, 0.7361, 0.7279, 0.7254, 0.7277, 0.7339, 0.7427,
    0.9994, 0.9860, 0.9573, 0.9215, 0.8825, 0.8429, 0.8047, 0.7691, 0.7373, 0.7101, 0.6878, 0.6708, 0.6589, 0.6520, 0.6494, 0.6507,
    0.9993, 0.9838, 0.9510, 0.9104, 0.8663, 0.8216, 0.7781, 0.7372, 0.6997, 0.6661, 0.6368, 0.6119, 0.5915, 0.5753, 0.5633, 0.5551,
    0.9992, 0.9813, 0.9439, 0.8978, 0.8480, 0.7976, 0.7484, 0.7019, 0.6586, 0.6192, 0.5836, 0.5521, 0.5244, 0.5004, 0.4801, 0.4630,
    0.9991, 0.9787, 0.9362, 0.8842, 0.8281, 0.7715, 0.7164, 0.6641, 0.6154, 0.5705, 0.5296, 0.4926, 0.4593, 0.4295, 0.4029, 0.3792,
    0.9990, 0.9759, 0.9280, 0.8696, 0.8071, 0.7441, 0.6830, 0.6251, 0.5711, 0.5214, 0.4761, 0.4349, 0.3976, 0.3641, 0.3339, 0.3068,
];

/// `b` of [`albedo`].
#[rustfmt::skip]
const GRAZING: [f32; SIDE * SIDE] = [
    0.9417, 0.9725, 0.9137, 0.8152, 0.6915, 0.5549, 0.4182, 0.2928, 0.1876, 0.1074, 0.0529, 0.0211, 0.0060, 0.0010, 0.0000, 0.0000,
    0.9072, 0.8282, 0.8658, 0.8024, 0.6865, 0.5527, 0.4172, 0.2924, 0.1875, 0.1074, 0.0530, 0.0211, 0.0061, 0.0010, 0.0000, 0.0000,
    0.7616, 0.7358, 0.6969, 0.6855, 0.6305, 0.5269, 0.4053, 0.2873, 0.1857, 0.1071, 0.0532, 0.0214, 0.0063, 0.0010, 0.0000, 0.0000,
    0.6115, 0.6015, 0.5741, 0.5436, 0.5101, 0.4516, 0.3655, 0.2687, 0.1783, 0.1052, 0.0535, 0.0222, 0.0068, 0.0012, 0.0001, 0.0000,
    0.4790, 0.4732, 0.4557, 0.4290, 0.3964, 0.3552, 0.2995, 0.2314, 0.1609, 0.0990, 0.0525, 0.0229, 0.0075, 0.0016, 0.0002, 0.0000,
    0.3701, 0.3658, 0.3530, 0.3323, 0.3048, 0.2714, 0.2314, 0.1847, 0.1345, 0.0873, 0.0491, 0.0229, 0.0083, 0.0020, 0.0003, 0.0000,
    0.2845, 0.2810, 0.2707, 0.2542, 0.2321, 0.2054, 0.1749, 0.1412, 0.1059, 0.0719, 0.0429, 0.0216, 0.0086, 0.0024, 0.0004, 0.0000,
    0.2192, 0.2161, 0.2075, 0.1939, 0.1761, 0.1549, 0.1313, 0.1061, 0.0807, 0.0564, 0.0352, 0.0189, 0.0083, 0.0027, 0.0005, 0.0000,
    0.1702, 0.1675, 0.1600, 0.1486, 0.1341, 0.1171, 0.0986, 0.0794, 0.0606, 0.0430, 0.0277, 0.0157, 0.0074, 0.0027, 0.0006, 0.0000,
    0.1338, 0.1313, 0.1248, 0.1150, 0.1029, 0.0891, 0.0744, 0.0596, 0.0454, 0.0324, 0.0213, 0.0125, 0.0062, 0.0024, 0.0006, 0.0000,
    0.1070, 0.1046, 0.0987, 0.0902, 0.0799, 0.0685, 0.0567, 0.0450, 0.0341, 0.0244, 0.0161, 0.0097, 0.0050, 0.0021, 0.0006, 0.0000,
    0.0872, 0.0849, 0.0795, 0.0719, 0.0629, 0.0533, 0.0436, 0.0343, 0.0258, 0.0183, 0.0122, 0.0074, 0.0039, 0.0017, 0.0005, 0.0000,
    0.0726, 0.0703, 0.0651, 0.0582, 0.0503, 0.0421, 0.0340, 0.0264, 0.0196, 0.0139, 0.0092, 0.0056, 0.0030, 0.0014, 0.0004, 0.0000,
    0.0617, 0.0595, 0.0544, 0.0480, 0.0409, 0.0337, 0.0268, 0.0205, 0.0151, 0.0105, 0.0069, 0.0042, 0.0023, 0.0011, 0.0004, 0.0000,
    0.0536, 0.0513, 0.0463, 0.0402, 0.0337, 0.0273, 0.0214, 0.0161, 0.0117, 0.0081, 0.0053, 0.0032, 0.0018, 0.0008, 0.0003, 0.0000,
    0.0475, 0.0451, 0.0401, 0.0342, 0.0282, 0.0224, 0.0173, 0.0128, 0.0091, 0.0062, 0.0040, 0.0024, 0.0013, 0.0006, 0.0002, 0.0000,
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::lane::One;

    const ALPHAS: [f32; 5] = [0.0625, 0.16, 0.36, 0.64, 1.0];
    const COSINES: [f32; 5] = [0.05, 0.2, 0.5, 0.8, 1.0];

    fn view(n_v: f32) -> Vec3 {
        Vec3::new(f32::sqrt(1.0 - n_v * n_v), 0.0, n_v)
    }

    /// Sums `f(h, weight)` over the hemisphere of h: midpoints, with the polar angle warped to where D is.
    fn over_h(alpha: f32, mut f: impl FnMut(Vec3, f64)) {
        let (n, m) = (512, 128);
        for i in 0..n {
            // tan θ = alpha √(u/(1-u)) spreads D evenly over u; the power packs points where u nears 1 and θ π/2,
            // which is where masking and grazing views matter.
            let x = 1.0 - (f64::from(i) + 0.5) / f64::from(n);
            let u = 1.0 - x * x * x * x;
            let a2 = f64::from(alpha) * f64::from(alpha);
            let rest = x * x * x * x;
            let cos2 = rest / (rest + a2 * u);
            let (cos, sin) = (cos2.sqrt(), (1.0 - cos2).sqrt());
            // dω = dφ dcosθ;  D cosθ dω = du dφ / 2π
            let d = a2 / (core::f64::consts::PI * ((a2 - 1.0) * cos2 + 1.0) * ((a2 - 1.0) * cos2 + 1.0));
            for k in 0..m {
                let phi = 2.0 * core::f64::consts::PI * (f64::from(k) + 0.5) / f64::from(m);
                let (s, c) = exact::sin_cos_f64(phi);
                let weight = 4.0 * x * x * x / (f64::from(n) * f64::from(m) * d * cos);
                f(Vec3::new((sin * c) as f32, (sin * s) as f32, cos as f32), weight);
            }
        }
    }

    /// The directional albedo for F = 1, and its share of Schlick's (1 - v.h)^5.
    fn integrated(n_v: f32, alpha: f32) -> (f64, f64) {
        let v = view(n_v);
        let (mut whole, mut grazing) = (0.0, 0.0);
        over_h(alpha, |h, weight| {
            let v_h = v.dot(h);
            let n_l = 2.0 * v_h * h.z - v.z;
            if v_h > 0.0 && n_l > 0.0 {
                // dl = 4 (v.h) dh
                let f = d_ggx(h.z, alpha) * v_smith(n_l, n_v, alpha) * n_l * 4.0 * v_h;
                whole += f64::from(f) * weight;
                grazing += f64::from(f * schlick(v_h)) * weight;
            }
        });
        (whole, grazing)
    }

    #[test]
    fn the_distribution_covers_the_plane_once() {
        for alpha in ALPHAS {
            let mut sum = 0.0;
            over_h(alpha, |h, weight| sum += f64::from(d_ggx(h.z, alpha) * h.z) * weight);
            // f32 rounding of D near its peak, averaged over 65536 points.
            assert!((sum - 1.0).abs() < 1e-5, "alpha {alpha}: {sum}");
        }
    }

    #[test]
    fn white_furnace_never_gains_energy() {
        for alpha in ALPHAS {
            for n_v in COSINES {
                let (e, _) = integrated(n_v, alpha);
                // The bound of the requirement; quadrature noise is below it.
                assert!(e <= 1.0 + 1e-3 && e > 0.1, "alpha {alpha} n.v {n_v}: {e}");
            }
        }
    }

    #[test]
    fn weak_white_furnace_is_one() {
        // Heitz 2014, section 5: with G1 alone, no energy leaves through multiple scattering:
        // integral of D G1(v) / (4 n.v) over all l, above and below the horizon, is exactly 1.
        for alpha in ALPHAS {
            for n_v in COSINES {
                let v = view(n_v);
                let mut sum = 0.0;
                over_h(alpha, |h, weight| {
                    let v_h = v.dot(h);
                    if v_h > 0.0 {
                        sum += f64::from(d_ggx(h.z, alpha) * g1(n_v, alpha) / n_v * v_h) * weight;
                    }
                });
                // The bound of the requirement.
                assert!((sum - 1.0).abs() < 1e-3, "alpha {alpha} n.v {n_v}: {sum}");
            }
        }
    }

    #[test]
    fn light_and_view_may_change_places() {
        for alpha in ALPHAS {
            for a in COSINES {
                for b in COSINES {
                    // The two products are summed in the other order: rounding only.
                    let (x, y) = (v_smith(a, b, alpha), v_smith(b, a, alpha));
                    assert!((x - y).abs() <= 1e-6 * x);
                }
            }
        }
    }

    #[test]
    fn masking_is_the_limit_of_masking_and_shadowing() {
        // G2(l = n) = G1(v) as nothing shadows a light that stands above.
        for alpha in ALPHAS {
            for n_v in COSINES {
                let g2 = v_smith(1.0, n_v, alpha) * 4.0 * n_v;
                let lambda = |c: f32| (f32::sqrt(1.0 + alpha * alpha * (1.0 / (c * c) - 1.0)) - 1.0) / 2.0;
                // Rounding of 1 - c² for small cosines.
                assert!((g2 - 1.0 / (1.0 + lambda(n_v))).abs() < 1e-5);
                assert!((g1(n_v, alpha) - 1.0 / (1.0 + lambda(n_v))).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn samples_have_the_density_that_is_claimed() {
        // Mean of any function over the samples = its integral against the density. First moments of h do.
        for alpha in ALPHAS {
            for n_v in [0.1, 0.5, 1.0] {
                let v = view(n_v);
                let n = 128;
                let mut mean = [0.0f64; 3];
                for i in 0..n {
                    for k in 0..n {
                        let u = Vec2::new((i as f32 + 0.5) / n as f32, (k as f32 + 0.5) / n as f32);
                        let h = sample_visible(v, alpha, u);
                        assert!(h.is_finite() && v.dot(h) > -1e-6);
                        for (m, c) in mean.iter_mut().zip(h.array()) {
                            *m += f64::from(c) / f64::from(n * n);
                        }
                    }
                }
                let mut want = [0.0f64; 3];
                let mut total = 0.0;
                over_h(alpha, |h, weight| {
                    let p = f64::from(pdf_visible(n_v, h.z, v.dot(h), alpha)) * weight;
                    total += p;
                    for (w, c) in want.iter_mut().zip(h.array()) {
                        *w += f64::from(c) * p;
                    }
                });
                assert!((total - 1.0).abs() < 1e-3, "{total}");
                for (m, w) in mean.iter().zip(want) {
                    // Midpoints of the warped square converge as 1/128 at its rim.
                    assert!((m - w).abs() < 4e-3, "alpha {alpha} n.v {n_v}: {mean:?} {want:?}");
                }
            }
        }
    }

    #[test]
    fn the_table_is_the_integral() {
        for roughness in [0.2f32, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0] {
            for n_v in COSINES {
                let (a, b) = albedo(One, n_v, roughness);
                let (whole, grazing) = integrated(n_v, roughness * roughness);
                // Bilinear interpolation of 16x16 points, as the doc comment says.
                assert!((f64::from(a + b) - whole).abs() < 1e-2, "r {roughness} n.v {n_v}: {} {whole}", a + b);
                assert!((f64::from(b) - grazing).abs() < 1e-2, "r {roughness} n.v {n_v}: {b} {grazing}");
                // What multi-scatter makes of it (shade) stays below 1.
                let gained = whole / f64::from(f32::min((a + b) * 1.01, 1.0));
                assert!(gained < 1.0 + 1e-3, "r {roughness} n.v {n_v}: {gained}");
            }
        }
    }
}
