//! sin, pow, exp and their like with the same bits everywhere.
//!
//! The functions of the platform's C library differ in their last bits from machine to machine (law 6).
//! These are written over [`Num`] with `+ - * /`, square root, comparisons and bit casts only, in one
//! fixed order, so a lane has the same bits at every SIMD level. Polynomials and reductions follow Cephes
//! (S. Moshier) and fdlibm (Sun Microsystems); each function states its error, held by a test.
//!
//! Where a result is NaN, only that it is NaN is the same everywhere: the payload may differ.

use super::lane::{Int, Num};

/// `c[0] + x (c[1] + x (c[2] + ...))`, Horner's order.
#[inline(always)]
fn horner<N: Num, const K: usize>(x: N, c: [f32; K]) -> N {
    let mut y = x.lift(c[K - 1]);
    let mut k = K - 1;
    while k > 0 {
        k -= 1;
        y = y * x + c[k];
    }
    y
}

/// Where `x` is NaN, NaN; elsewhere `y`.
#[inline(always)]
fn keep_nan<N: Num>(x: N, y: N) -> N {
    y.or_else(x.eq(x), x)
}

/// The upper 12 bits of the significand, so that products of two of them are exact.
#[inline(always)]
fn upper<N: Num>(x: N) -> N {
    (x.to_bits() & 0xffff_f000_u32 as i32).from_bits()
}

/// The quadrant of `x` (an integer) and what is left, within ±π/4.
#[inline(always)]
fn quadrant<N: Num>(x: N) -> (N::Int, N) {
    // Cody and Waite: π/2 in parts of 8 bits, so that products with quadrants below 2^16 are exact.
    const P1: f32 = 1.5703125; // 201 / 2^7
    const P2: f32 = 4.825_592e-4; // 253 / 2^19
    const P3: f32 = 1.266_598_7e-6; // 170 / 2^27
    const P4: f32 = 9.920_935e-10; // the rest
    let q = (x * core::f32::consts::FRAC_2_PI + 0.5).floor().clamp(-16_777_216.0, 16_777_216.0);
    let r = x - q * P1 - q * P2 - q * P3 - q * P4;
    // Beyond the promised range r may be anything; infinities and NaN become NaN.
    (q.to_int(), r.clamp(-0.8, 0.8) * ((x - x) + 1.0))
}

/// Sine and cosine of `x` radians. Error below 1.3e-7 (about one unit in the last place of 1) for
/// |x| <= 1e5; beyond, still within ±1 but meaningless. Infinities and NaN give NaN.
#[inline(always)]
pub fn sin_cos<N: Num>(x: N) -> (N, N) {
    let (q, r) = quadrant(x);
    let z = r * r;
    let s = r + r * z * horner(z, [-1.666_665_5e-1, 8.332_161e-3, -1.951_529_6e-4]);
    let c = (z.lift(1.0) - z * 0.5) + z * z * horner(z, [4.166_664_6e-2, -1.388_731_6e-3, 2.443_315_7e-5]);
    let swap = (q & 1).eq(q.lift(1));
    let (s, c) = (c.or_else(swap, s), s.or_else(swap, c));
    // Quadrants 2 and 3 flip the sine, 1 and 2 the cosine: bit 1 becomes the sign.
    #[inline(always)]
    fn flip<N: Num>(v: N, q: N::Int) -> N {
        (v.to_bits() ^ ((q & 2) << 30)).from_bits()
    }
    (flip(s, q), flip(c, q + 1))
}

/// Sine of `x` radians; see [`sin_cos`].
#[inline(always)]
pub fn sin<N: Num>(x: N) -> N {
    sin_cos(x).0
}

/// Cosine of `x` radians; see [`sin_cos`].
#[inline(always)]
pub fn cos<N: Num>(x: N) -> N {
    sin_cos(x).1
}

/// Tangent of `x` radians, within 4 units in the last place where |x| <= 1e3; see [`sin_cos`].
#[inline(always)]
pub fn tan<N: Num>(x: N) -> N {
    let (s, c) = sin_cos(x);
    s / c
}

/// Arc sine of `0 ..= 1/2` by its square: `x + x z P(z)`.
#[inline(always)]
fn asin_core<N: Num>(x: N, z: N) -> N {
    x + x * z * horner(z, [1.666_675_2e-1, 7.495_300_3e-2, 4.547_002_6e-2, 2.418_131_1e-2, 4.216_32e-2])
}

/// Clamped to ±1; NaN stays.
#[inline(always)]
fn unit<N: Num>(x: N) -> N {
    let one = x.lift(1.0);
    let x = one.or_else(x.gt(one), x);
    (-one).or_else(x.lt(-one), x)
}

/// Arc sine in radians, within 3 units in the last place. Arguments beyond ±1, as rounding makes them,
/// count as ±1; NaN gives NaN.
#[inline(always)]
pub fn asin<N: Num>(x: N) -> N {
    let x = unit(x);
    let a = x.abs();
    let big = a.gt(x.lift(0.5));
    let z = ((x.lift(1.0) - a) * 0.5).or_else(big, a * a);
    let p = asin_core(z.sqrt().or_else(big, a), z);
    let y = (x.lift(core::f32::consts::FRAC_PI_2) - p * 2.0).or_else(big, p);
    (y.to_bits() | (x.to_bits() & i32::MIN)).from_bits()
}

/// Arc cosine in radians, error below 3e-7. Arguments beyond ±1, as rounding makes them, count as ±1;
/// NaN gives NaN.
#[inline(always)]
pub fn acos<N: Num>(x: N) -> N {
    let x = unit(x);
    let a = x.abs();
    let big = a.gt(x.lift(0.5));
    let z = ((x.lift(1.0) - a) * 0.5).or_else(big, a * a);
    let p = asin_core(z.sqrt().or_else(big, x), z);
    let far = (x.lift(core::f32::consts::PI) - p * 2.0).or_else(x.lt(x.lift(0.0)), p * 2.0);
    far.or_else(big, x.lift(core::f32::consts::FRAC_PI_2) - p)
}

/// Arc tangent in radians, within 3 units in the last place; ±infinity gives ±π/2.
#[inline(always)]
pub fn atan<N: Num>(x: N) -> N {
    atan2(x, x.lift(1.0))
}

/// The angle of the point `(x, y)` in radians, -π ..= π, within 4 units in the last place (below 1e38).
/// `atan2(0, 0)` is 0; -0 counts as 0 for `x`; NaN in either gives NaN.
#[inline(always)]
pub fn atan2<N: Num>(y: N, x: N) -> N {
    let zero = x.lift(0.0);
    let (ax, ay) = (x.abs(), y.abs());
    let steep = ay.gt(ax);
    let (n, d) = (ax.or_else(steep, ay), ay.or_else(steep, ax));
    // atan(n/d) = π/4 + atan((n - d) / (n + d)); equal ones first, because infinities have no difference.
    let upper = n.gt(d * 0.414_213_57) | (n.eq(d) & n.gt(zero));
    let top = zero.or_else(n.eq(d), n - d).or_else(upper, n);
    let bottom = (n + d).or_else(upper, x.lift(1.0).or_else(d.eq(zero), d));
    let t = top / bottom;
    let z = t * t;
    let p = t + t * z * horner(z, [-3.333_295e-1, 1.997_771_1e-1, -1.387_768_6e-1, 8.053_745e-2]);
    let a = (p + core::f32::consts::FRAC_PI_4).or_else(upper, p);
    let a = (x.lift(core::f32::consts::FRAC_PI_2) - a).or_else(steep, a);
    let a = (x.lift(core::f32::consts::PI) - a).or_else(x.lt(zero), a);
    let a = (a.to_bits() | (y.to_bits() & i32::MIN)).from_bits();
    keep_nan(x, keep_nan(y, a))
}

/// `y * 2^n` for whole `n` within ±300; subnormal results are rounded once, large ones become infinity.
#[inline(always)]
fn scale<N: Num>(y: N, n: N) -> N {
    let n = n.to_int();
    let half = n >> 1;
    #[inline(always)]
    fn power<N: Num>(n: N::Int) -> N {
        ((n + 127) << 23).from_bits()
    }
    y * power::<N>(half) * power::<N>(n - half)
}

/// `2^f` for f within ±1/2 and a little more: Taylor's series to the seventh power (the next term is below 6e-9).
#[inline(always)]
fn exp2_core<N: Num>(f: N) -> N {
    let p = horner(
        f,
        [6.931_472e-1, 2.402_265e-1, 5.550_410_9e-2, 9.618_129e-3, 1.333_355_8e-3, 1.540_353e-4, 1.525_273_4e-5],
    );
    f * p + 1.0
}

/// `2^x`, within 2 units in the last place (results below 2^-126: half a subnormal step more).
/// Above 128 infinity, below -150 zero, NaN gives NaN.
#[inline(always)]
pub fn exp2<N: Num>(x: N) -> N {
    let c = x.clamp(-160.0, 160.0);
    let n = (c + 0.5).floor();
    keep_nan(x, scale(exp2_core(c - n), n))
}

/// `e^x`, within 2 units in the last place (results below 2^-126: half a subnormal step more).
/// Above 88.73 infinity, below -104 zero, NaN gives NaN.
#[inline(always)]
pub fn exp<N: Num>(x: N) -> N {
    let c = x.clamp(-110.0, 110.0);
    let n = (c * core::f32::consts::LOG2_E + 0.5).floor();
    let r = c - n * 0.693_359_375 - n * -2.121_944_4e-4;
    let p = horner(r, [0.5, 1.666_666_5e-1, 4.166_579_6e-2, 8.333_452e-3, 1.398_2e-3, 1.987_569_2e-4]);
    keep_nan(x, scale(r * r * p + r + 1.0, n))
}

/// `x = 2^e m` with `m` in `[√½, √2)`, for positive finite `x`; anything for others.
#[inline(always)]
fn split<N: Num>(x: N) -> (N, N) {
    let tiny = x.lt(x.lift(f32::MIN_POSITIVE));
    let bits = (x * 16_777_216.0).or_else(tiny, x).to_bits();
    let e = (bits - 0x3f35_04f3) >> 23;
    let m = (bits - (e << 23)).from_bits();
    (e.to_num() - x.lift(24.0).or_else(tiny, x.lift(0.0)), m)
}

/// What every logarithm says to 0, negative numbers, infinity and NaN; elsewhere `y`.
#[inline(always)]
fn log_rules<N: Num>(x: N, y: N) -> N {
    let inf = x.lift(f32::INFINITY);
    let y = y.or_else(x.lt(inf), x);
    let y = (-inf).or_else(x.eq(x.lift(0.0)), y);
    x.lift(f32::NAN).or_else(x.lt(x.lift(0.0)), y)
}

/// Natural logarithm, within 2 units in the last place. 0 gives -infinity, negative numbers and NaN give NaN.
#[inline(always)]
pub fn log<N: Num>(x: N) -> N {
    let (e, m) = split(x);
    let f = m - 1.0;
    let s = f / (f + 2.0);
    let z = s * s;
    let r = z * horner(z, [0.666_666_6, 0.400_009_72, 0.284_987_87, 0.242_790_79]);
    let h = f * f * 0.5;
    log_rules(x, e * 0.693_138_1 - ((h - (s * (h + r) + e * 9.058_001e-6)) - f))
}

/// The binary logarithm as a sum of two, the first with 12 bits to spare for exact products:
/// relative error about 2^-30. For positive finite `x`.
#[inline(always)]
fn log2_parts<N: Num>(x: N) -> (N, N) {
    let (e, m) = split(x);
    // log2 m = 2/ln 2 (s + s^3/3 + s^5/5 + ...) with s = (m - 1)/(m + 1), the quotient in two parts.
    let f = m - 1.0;
    let d = m + 1.0;
    let d_rest = m - (d - 1.0);
    let s_hi = upper(f / d);
    let d_hi = upper(d);
    let rest = (f - s_hi * d_hi) - s_hi * (d - d_hi) - s_hi * d_rest;
    let s_lo = rest / d;
    let s = s_hi + s_lo;
    let z = s * s;
    let tail = s_lo + s * z * horner(z, [0.333_333_34, 0.2, 0.142_857_15, 0.111_111_11, 0.090_909_09]);
    const C: f32 = 2.885_39; // 2 / ln 2
    const C_HI: f32 = 2.884_765_6; // 2954 / 1024, 12 bits
    const C_LO: f32 = 6.244_567_8e-4;
    let p = s_hi * C_HI;
    let q = s_hi * C_LO + tail * C;
    let hi = e + p;
    let lo = (p - (hi - e)) + q;
    let top = hi + lo;
    (top, lo - (top - hi))
}

/// Binary logarithm, within 1 unit in the last place. 0 gives -infinity, negative numbers and NaN give NaN.
#[inline(always)]
pub fn log2<N: Num>(x: N) -> N {
    log_rules(x, log2_parts(x).0)
}

/// `x^y` for `x >= 0`, relative error below 4e-7 wherever the result is a normal number, for exponents of
/// any size (the logarithm is kept in two parts, as fdlibm does). `pow(x, 0)` is 1 for every `x`; `pow(0, y)` is 0 for positive
/// and infinity for negative `y`; infinite `x` and `y` go to their limits; negative `x` gives NaN (-0 is
/// 0), and so does NaN in either, but for the first rule.
#[inline(always)]
pub fn pow<N: Num>(x: N, y: N) -> N {
    let (zero, one, inf) = (x.lift(0.0), x.lift(1.0), x.lift(f32::INFINITY));
    let (h, l) = log2_parts(x);
    let w = y.clamp(-3e38, 3e38);
    let (w_hi, h_hi) = (upper(w), upper(h));
    let (w_lo, h_lo) = (w - w_hi, (h - h_hi) + l);
    let p = w_hi * h_hi;
    let q = w_lo * h_hi + w_hi * h_lo + w_lo * h_lo;
    let tame = p.abs().lt(x.lift(200.0));
    let p = p.clamp(-200.0, 200.0);
    let q = q.or_else(tame, zero);
    let n = (p + q + 0.5).floor();
    let r = scale(exp2_core((p - n) + q), n);
    let up = inf.or_else(y.gt(zero), zero); // of infinity
    let down = zero.or_else(y.gt(zero), inf); // of 0
    let r = up.or_else(x.eq(inf), r);
    let r = down.or_else(x.eq(zero), r);
    let r = r.or_else(x.ge(zero) & y.eq(y), x.lift(f32::NAN));
    one.or_else(y.eq(zero), r)
}

/// `x^n` by repeated squaring, from the lowest bit of `n` on: the fast way for whole exponents. Every
/// rounding is squared with the rest, so the relative error grows to about `n 2^-24`, no more than that of
/// a rounded `x`. `pow_int(x, 0)` is 1 for every `x`.
#[inline(always)]
pub fn pow_int<N: Num>(x: N, n: u32) -> N {
    let (mut y, mut b, mut n) = (x.lift(1.0), x, n);
    while n > 0 {
        if n & 1 != 0 {
            y = y * b;
        }
        n >>= 1;
        if n > 0 {
            b = b * b;
        }
    }
    y
}

/// `c[0] + x (c[1] + ...)` in double precision.
fn horner_f64(x: f64, c: &[f64]) -> f64 {
    c.iter().rev().fold(0.0, |y, c| y * x + c)
}

/// Sine and cosine of `x` radians in double precision, error below 3e-16 for |x| <= 1e5.
pub fn sin_cos_f64(x: f64) -> (f64, f64) {
    let q = (x * core::f64::consts::FRAC_2_PI + 0.5).floor();
    // fdlibm's π/2 in parts of 33 bits.
    let r = x
        - q * 1.570_796_326_734_125_614_17
        - q * 6.077_100_506_303_965_976_60e-11
        - q * 2.022_266_248_795_950_631_54e-21;
    let r = if r.abs() <= 0.8 { r } else { r * 0.0 };
    let z = r * r;
    let s = r + r
        * z
        * horner_f64(
            z,
            &[
                -1.666_666_666_666_663_243_48e-1,
                8.333_333_333_322_489_461_24e-3,
                -1.984_126_982_985_794_931_34e-4,
                2.755_731_370_707_006_767_89e-6,
                -2.505_076_025_340_686_341_95e-8,
                1.589_690_995_211_550_102_21e-10,
            ],
        );
    let c = (1.0 - 0.5 * z)
        + z * z
            * horner_f64(
                z,
                &[
                    4.166_666_666_666_660_190_37e-2,
                    -1.388_888_888_887_410_957_49e-3,
                    2.480_158_728_947_672_941_78e-5,
                    -2.755_731_435_139_066_330_35e-7,
                    2.087_572_321_298_174_827_90e-9,
                    -1.135_964_755_778_819_482_65e-11,
                ],
            );
    match (q as i64) & 3 {
        0 => (s, c),
        1 => (c, -s),
        2 => (-s, -c),
        _ => (-c, s),
    }
}

/// Sine of `x` radians in double precision; see [`sin_cos_f64`].
pub fn sin_f64(x: f64) -> f64 {
    sin_cos_f64(x).0
}

/// Cosine of `x` radians in double precision; see [`sin_cos_f64`].
pub fn cos_f64(x: f64) -> f64 {
    sin_cos_f64(x).1
}

/// Tangent of `x` radians in double precision; see [`sin_cos_f64`].
pub fn tan_f64(x: f64) -> f64 {
    let (s, c) = sin_cos_f64(x);
    s / c
}

/// Arc tangent in double precision, relative error below 5e-16.
pub fn atan_f64(x: f64) -> f64 {
    let a = x.abs();
    let (t, base) = if a < 0.4375 {
        (a, 0.0)
    } else if a < 0.6875 {
        ((2.0 * a - 1.0) / (2.0 + a), 4.636_476_090_008_060_935_15e-1)
    } else if a < 1.1875 {
        ((a - 1.0) / (a + 1.0), core::f64::consts::FRAC_PI_4)
    } else if a < 2.4375 {
        ((a - 1.5) / (1.0 + 1.5 * a), 9.827_937_232_473_290_540_82e-1)
    } else {
        (-1.0 / a, core::f64::consts::FRAC_PI_2)
    };
    let z = t * t;
    let p = horner_f64(
        z,
        &[
            3.333_333_333_333_293_180_27e-1,
            -1.999_999_999_987_648_324_76e-1,
            1.428_571_427_250_346_637_11e-1,
            -1.111_111_040_546_235_578_80e-1,
            9.090_887_133_436_506_561_96e-2,
            -7.691_876_205_044_829_994_95e-2,
            6.661_073_137_387_531_206_69e-2,
            -5.833_570_133_790_573_486_45e-2,
            4.976_877_994_615_932_360_17e-2,
            -3.653_157_274_421_691_552_70e-2,
            1.628_582_011_536_578_236_23e-2,
        ],
    );
    let y = base + (t - t * z * p);
    if x.is_sign_negative() { -y } else { y }
}

/// The angle of the point `(x, y)` in radians, -π ..= π, in double precision. `atan2_f64(0, 0)` is 0.
pub fn atan2_f64(y: f64, x: f64) -> f64 {
    use core::f64::consts::{FRAC_PI_2, PI};
    let (ax, ay) = (x.abs(), y.abs());
    let a = if ax == ay {
        if ax == 0.0 { 0.0 } else { atan_f64(1.0) }
    } else if ay > ax {
        FRAC_PI_2 - atan_f64(ax / ay)
    } else {
        atan_f64(ay / ax)
    };
    let a = if x < 0.0 { PI - a } else { a };
    if y.is_sign_negative() { -a } else { a }
}

/// Arc cosine in radians in double precision, error below 1e-15; arguments beyond ±1 count as ±1.
pub fn acos_f64(x: f64) -> f64 {
    let x = if x > 1.0 {
        1.0
    } else if x < -1.0 {
        -1.0
    } else {
        x
    };
    2.0 * atan2_f64((1.0 - x).sqrt(), (1.0 + x).sqrt())
}

/// Arc sine in radians in double precision, error below 1e-15; arguments beyond ±1 count as ±1.
pub fn asin_f64(x: f64) -> f64 {
    let x = if x > 1.0 {
        1.0
    } else if x < -1.0 {
        -1.0
    } else {
        x
    };
    atan2_f64(x, ((1.0 - x) * (1.0 + x)).sqrt())
}

/// `e^x` in double precision, relative error below 5e-16 for |x| <= 700; beyond, 0 or infinity.
pub fn exp_f64(x: f64) -> f64 {
    if x.is_nan() {
        return x;
    }
    if x > 709.7 {
        return f64::INFINITY;
    }
    if x < -708.3 {
        return 0.0;
    }
    let n = (x * core::f64::consts::LOG2_E + 0.5).floor();
    let (hi, lo) = (x - n * 6.931_471_803_691_238_164_90e-1, n * 1.908_214_929_270_587_700_02e-10);
    let r = hi - lo;
    let z = r * r;
    let c = r - z * horner_f64(
        z,
        &[
            1.666_666_666_666_660_190_37e-1,
            -2.777_777_777_701_559_338_42e-3,
            6.613_756_321_437_934_361_17e-5,
            -1.653_390_220_546_525_153_90e-6,
            4.138_136_797_057_238_460_39e-8,
        ],
    );
    let y = 1.0 - ((lo - (r * c) / (2.0 - c)) - hi);
    y * f64::from_bits(((n as i64 + 1023) as u64) << 52)
}

/// Natural logarithm in double precision, relative error below 5e-16. 0 gives -infinity, negative NaN.
pub fn log_f64(x: f64) -> f64 {
    if x.is_nan() || x == f64::INFINITY {
        return x;
    }
    if x <= 0.0 {
        return if x == 0.0 { f64::NEG_INFINITY } else { f64::NAN };
    }
    let (x, shift) = if x < f64::MIN_POSITIVE { (x * 18_014_398_509_481_984.0, 54.0) } else { (x, 0.0) };
    let bits = x.to_bits() as i64;
    let e = (bits - 0x3fe6_a09e_667f_3bcd) >> 52;
    let f = f64::from_bits((bits - (e << 52)) as u64) - 1.0;
    let e = e as f64 - shift;
    let s = f / (2.0 + f);
    let z = s * s;
    let r = z * horner_f64(
        z,
        &[
            6.666_666_666_666_735_130e-1,
            3.999_999_999_940_941_908e-1,
            2.857_142_874_366_239_149e-1,
            2.222_219_843_214_978_396e-1,
            1.818_357_216_161_805_012e-1,
            1.531_383_769_920_937_332e-1,
            1.479_819_860_511_658_591e-1,
        ],
    );
    let h = 0.5 * f * f;
    e * 6.931_471_803_691_238_164_90e-1 - ((h - (s * (h + r) + e * 1.908_214_929_270_587_700_02e-10)) - f)
}

/// `x^y` for `x >= 0` in double precision, relative error about `1e-16 (1 + |y log x|)`: for tables (sRGB),
/// not for exponents in the thousands. `pow_f64(x, 0)` is 1, `pow_f64(0, y > 0)` is 0, negative `x` NaN.
pub fn pow_f64(x: f64, y: f64) -> f64 {
    if y == 0.0 { 1.0 } else { exp_f64(y * log_f64(x)) }
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)] // The platform's f64 functions are the truth to compare with.
mod tests {
    use super::super::lane::{Kernel, Lane, Level, One};
    use super::*;

    /// Numbers of every magnitude and sign, from a fixed sequence, within `lo ..= hi`.
    fn sweep(lo: f32, hi: f32, n: u32) -> impl Iterator<Item = f32> {
        (0..=n).map(move |k| lo + (hi - lo) * (k as f32 / n as f32))
    }
    /// As many per octave from `2^a` to `2^b`.
    fn octaves(a: i32, b: i32) -> impl Iterator<Item = f32> {
        (a..b).flat_map(|e| (0..331).map(move |k| (2.0f64.powi(e) * (1.0 + f64::from(k) / 331.0)) as f32))
    }
    /// Distance in units in the last place of the exact value.
    fn ulps(got: f32, want: f64) -> f64 {
        if got.is_nan() && want.is_nan() {
            return 0.0;
        }
        if f64::from(got) == want || (got.is_infinite() && want.abs() > f64::from(f32::MAX)) {
            return 0.0;
        }
        let e = (want.abs().log2().floor() as i32).max(-126);
        (f64::from(got) - want).abs() / 2.0f64.powi(e - 23)
    }
    fn worst(name: &str, limit: f64, each: impl Iterator<Item = (f32, f64)>) {
        let mut most = (0.0f64, 0.0, 0.0);
        for (got, want) in each {
            let u = ulps(got, want);
            if u.is_nan() || u > most.0 {
                most = (u, got, want);
            }
        }
        assert!(most.0 <= limit, "{name}: {} ulp: {} for {}", most.0, most.1, most.2);
    }
    /// Largest absolute difference.
    fn near(name: &str, limit: f64, each: impl Iterator<Item = (f32, f64)>) {
        let most = each.map(|(a, b)| (f64::from(a) - b).abs()).fold(0.0, |m: f64, d| if d <= m { m } else { d });
        assert!(most <= limit, "{name}: {most:e}");
    }

    // The limits below are the bounds that the doc comments promise.

    #[test]
    fn trigonometry_keeps_its_promised_errors() {
        for (lo, hi) in [(-4.0, 4.0), (-100.0, 100.0), (-1e5, 1e5)] {
            near("sin", 1.3e-7, sweep(lo, hi, 40_000).map(|x| (sin(x), f64::from(x).sin())));
            near("cos", 1.3e-7, sweep(lo, hi, 40_000).map(|x| (cos(x), f64::from(x).cos())));
        }
        worst("tan", 4.0, sweep(-1e3, 1e3, 40_000).map(|x| (tan(x), f64::from(x).tan())));
        worst("asin", 3.0, sweep(-1.0, 1.0, 40_000).map(|x| (asin(x), f64::from(x).asin())));
        near("acos", 3e-7, sweep(-1.0, 1.0, 40_000).map(|x| (acos(x), f64::from(x).acos())));
        worst("atan", 3.0, octaves(-40, 40).map(|x| (atan(x), f64::from(x).atan())));
        for a in [-1e5f32, -3.0, -0.5, 1e-20, 0.3, 1.0, 2e8] {
            let turn = |x: f32| (atan2(x, a), f64::from(x).atan2(f64::from(a)));
            worst("atan2", 4.0, octaves(-30, 30).flat_map(|x| [turn(x), turn(-x)]));
        }
    }

    #[test]
    fn exponentials_and_logarithms_keep_their_promised_errors() {
        worst("exp2", 2.0, sweep(-126.0, 128.0, 60_000).map(|x| (exp2(x), f64::from(x).exp2())));
        worst("exp2", 2.5, sweep(-152.0, -126.0, 9_000).map(|x| (exp2(x), f64::from(x).exp2())));
        worst("exp", 2.0, sweep(-87.0, 88.8, 60_000).map(|x| (exp(x), f64::from(x).exp())));
        worst("log", 2.0, octaves(-149, 128).map(|x| (log(x), f64::from(x).ln())));
        worst("log", 2.0, sweep(0.7, 1.5, 60_000).map(|x| (log(x), f64::from(x).ln())));
        worst("log2", 1.0, octaves(-149, 128).map(|x| (log2(x), f64::from(x).log2())));
        worst("log2", 1.0, sweep(0.7, 1.5, 60_000).map(|x| (log2(x), f64::from(x).log2())));
    }

    #[test]
    fn pow_stays_exact_for_exponents_in_the_thousands() {
        for y in [0.01f32, 0.5, 1.0, 2.2, 1.0 / 2.4, 10.0, 64.0, 150.0, 333.3, 1000.0, 4096.0, 1e6, -0.5, -3.0, -200.0]
        {
            let all = octaves(-20, 20).chain(sweep(0.0, 1.0, 5_000)).chain(sweep(0.999, 1.001, 5_000));
            let mut most = 0.0f64;
            for x in all {
                let want = f64::from(x).powf(f64::from(y));
                if want >= f64::from(f32::MIN_POSITIVE) && want < f64::from(f32::MAX) {
                    most = most.max((f64::from(pow(x, y)) / want - 1.0).abs());
                }
            }
            assert!(most < 4e-7, "y = {y}: {most:e}");
        }
    }

    #[test]
    fn pow_int_errs_no_more_than_a_rounded_base() {
        for n in [0u32, 1, 2, 3, 5, 64, 150, 1000, 4096] {
            for x in sweep(0.9, 1.05, 500) {
                let want = f64::from(x).powi(n as i32);
                if want < 1e38 && want > 1e-37 {
                    let e = (f64::from(pow_int(x, n)) / want - 1.0).abs();
                    assert!(e <= f64::from(n.max(1)) * 6e-8, "{x}^{n}: {e:e}");
                }
            }
        }
        assert_eq!(pow_int(0.0f32, 0), 1.0);
    }

    #[test]
    fn special_arguments_follow_the_rules() {
        let (inf, nan) = (f32::INFINITY, f32::NAN);
        assert_eq!((pow(0.0f32, 0.0), pow(nan, 0.0), pow(0.0, 2.0), pow(0.0, -2.0)), (1.0, 1.0, 0.0, inf));
        assert_eq!((pow(-0.0f32, 3.0), pow(1.0, inf), pow(0.5, inf), pow(2.0, -inf)), (0.0, 1.0, 0.0, 0.0));
        assert_eq!((pow(inf, 2.0f32), pow(inf, -2.0), pow(2.0, 1e9), pow(0.5, 1e9)), (inf, 0.0, inf, 0.0));
        assert!(pow(-2.0f32, 2.0).is_nan() && pow(nan, 1.0f32).is_nan() && pow(2.0f32, nan).is_nan());
        assert_eq!(
            (exp(inf), exp(-inf), exp2(inf), exp2(-inf), exp(0.0f32), exp2(3.0f32)),
            (inf, 0.0, inf, 0.0, 1.0, 8.0)
        );
        assert_eq!(
            (log(0.0f32), log2(0.0f32), log(inf), log2(inf), log2(8.0f32), log(1.0f32)),
            (-inf, -inf, inf, inf, 3.0, 0.0)
        );
        assert!(
            [sin(inf), cos(nan), tan(nan), exp(nan), exp2(nan), log(-1.0), log2(nan), log(nan)]
                .iter()
                .all(|v| v.is_nan())
        );
        assert!([asin(nan), acos(nan), atan(nan), atan2(nan, 1.0), atan2(1.0, nan)].iter().all(|v| v.is_nan()));
        assert_eq!((acos(1.5f32), asin(-7.0f32)), (0.0, -core::f32::consts::FRAC_PI_2));
        assert_eq!((atan2(0.0f32, 0.0), atan2(inf, inf)), (0.0, core::f32::consts::FRAC_PI_4));
        assert_eq!(
            (atan2(0.0f32, -1.0), atan2(1.0, inf), atan(inf)),
            (core::f32::consts::PI, 0.0, core::f32::consts::FRAC_PI_2)
        );
        for wild in [1e9f32, -3e38, 1e30] {
            assert!(sin(wild).abs() <= 1.0 && cos(wild).abs() <= 1.0);
        }
    }

    #[test]
    fn double_precision_keeps_its_promised_errors() {
        for k in -20_000..=20_000 {
            let x = f64::from(k) * 0.000_777 * if k % 2 == 0 { 1.0 } else { 6_000.0 };
            assert!((sin_f64(x) - x.sin()).abs() < 3e-16 && (cos_f64(x) - x.cos()).abs() < 3e-16, "{x}");
            assert!((atan_f64(x) / x.atan() - 1.0).abs() < 5e-16 || x == 0.0, "{x}");
            let u = f64::from(k) / 20_000.0;
            assert!((acos_f64(u) - u.acos()).abs() < 1e-15 && (asin_f64(u) - u.asin()).abs() < 1e-15, "{u}");
            assert!((exp_f64(u * 700.0) / (u * 700.0).exp() - 1.0).abs() < 5e-16, "{u}");
            let v = (u * 700.0).exp();
            assert!((log_f64(v) - v.ln()).abs() <= 5e-16 * v.ln().abs(), "{v}");
            assert!((atan2_f64(x, u) - x.atan2(u)).abs() < 1e-15, "{x} {u}");
            assert!((pow_f64(u.abs(), 2.4) - u.abs().powf(2.4)).abs() < 1e-15, "{u}");
        }
        assert!((tan_f64(1.2) - 1.2f64.tan()).abs() < 1e-15);
    }

    struct All<'a>(&'a [f32]);
    impl Kernel for All<'_> {
        type Out = Vec<u32>;
        #[inline(always)]
        fn run<L: Lane>(self, l: L) -> Vec<u32> {
            let mut out = vec![0; self.0.len() * 14];
            for (b, block) in self.0.chunks_exact(L::WIDTH).enumerate() {
                let x = l.load(block);
                let y = l.f(1.7) - x;
                // Entered one by one, to keep the compiler's functions small.
                macro_rules! each {
                    ($($e:expr),*) => { [$(l.enter(#[inline(always)] || $e)),*] };
                }
                let all = each![
                    sin(x),
                    cos(x),
                    tan(x),
                    asin(x),
                    acos(x),
                    atan(x),
                    atan2(x, y),
                    exp(x),
                    exp2(x),
                    log(x),
                    log2(x),
                    pow(x.abs(), y),
                    pow(x, l.f(150.5)),
                    pow_int(x, 150)
                ];
                for k in 0..L::WIDTH {
                    for (f, v) in all.iter().enumerate() {
                        let v = v.lane(k);
                        // Law 6 promises that a NaN is a NaN, not which one.
                        out[(b * L::WIDTH + k) * all.len() + f] = if v.is_nan() { 0x7fc0_0000 } else { v.to_bits() };
                    }
                }
            }
            out
        }
    }

    #[test]
    fn every_level_gives_the_same_bits() {
        let mut x: Vec<f32> = octaves(-149, 128).step_by(7).flat_map(|x| [x, -x]).collect();
        x.extend(sweep(-3.0, 3.0, 999));
        x.extend([0.0, -0.0, 1.0, -1.0, f32::INFINITY, -f32::INFINITY, f32::NAN, f32::MAX]);
        x.resize(x.len().next_multiple_of(16), 0.5);
        let want = All(&x).run(One);
        for level in Level::available() {
            let got = level.run(All(&x));
            for (k, (a, b)) in got.iter().zip(&want).enumerate() {
                assert_eq!(a, b, "{}: function {} of {}", level.name(), k % 14, x[k / 14]);
            }
        }
    }
}
