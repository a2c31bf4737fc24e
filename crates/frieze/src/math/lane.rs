//! The only door to SIMD.
//!
//! Shading, sampling and rasterising are written once, over [`Num`]: a plain `f32`, or `WIDTH` pixels
//! side by side. A [`Level`] is chosen once at run time and [`Level::run`] enters a [`Kernel`] compiled
//! for it. Every operation here is an IEEE-754 single operation per lane, no lane ever sees another, and
//! nothing is fused or approximated; so a value has the same bits at every level and width (law 6).
//!
//! Rules for kernels: every function on the hot path is `#[inline(always)]` (a lane operation that is
//! not inlined into the dispatched kernel becomes a call, some 15 times slower); constants are made with
//! [`Num::lift`] from a value at hand, or by the [`Lane`] token.

mod one;

pub use one::I1;

use core::fmt::Debug;
use core::ops::{Add, BitAnd, BitOr, BitXor, Div, Mul, Neg, Not, Shl, Shr, Sub};
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
use fearless_simd::{Avx2, Avx512, Sse2};
use fearless_simd::{
    Bytes, ExtractToken, Level as CpuLevel, Select, Simd, SimdBase, SimdFloat, SimdInt, SimdMask, f32x4, f32x8, f32x16,
    i32x8, i32x16, mask32x8, mask32x16, u64x4, u64x8,
};

/// A truth value per lane.
pub trait Mask: Copy + Debug + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self> {
    /// Lane `k` as bit `k`.
    fn bits(self) -> u32;
    /// Whether any lane is true.
    #[inline(always)]
    fn any(self) -> bool {
        self.bits() != 0
    }
    /// Whether all lanes are true.
    fn all(self) -> bool;
}

/// A number per lane: `f32` alone, or several side by side. IEEE single precision, round to nearest even.
pub trait Num:
    Copy
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Add<f32, Output = Self>
    + Sub<f32, Output = Self>
    + Mul<f32, Output = Self>
    + Div<f32, Output = Self>
{
    /// The result of a comparison.
    type Mask: Mask;
    /// The 32-bit integers of the same width.
    type Int: Int<Num = Self, Mask = Self::Mask>;
    /// How many lanes there are.
    const WIDTH: usize;
    /// The same constant in every lane (of the width and level of `self`).
    fn lift(self, v: f32) -> Self;
    /// A constant mask of the width of `self`.
    fn lift_mask(self, v: bool) -> Self::Mask;
    /// The number in lane `k`.
    fn lane(self, k: usize) -> f32;
    /// Writes the lanes to the front of `out`.
    fn store(self, out: &mut [f32]);
    /// Square root, correctly rounded.
    fn sqrt(self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
    /// Largest integer not above.
    fn floor(self) -> Self;
    /// Truncates towards zero. The caller keeps the value within ±2^31: outside, and for NaN, the result
    /// differs between levels, so clamp first (`max` then `min` also removes NaN).
    fn to_int(self) -> Self::Int;
    /// The bit pattern.
    fn to_bits(self) -> Self::Int;
    /// `self < o`; false for NaN.
    fn lt(self, o: Self) -> Self::Mask;
    /// `self <= o`; false for NaN.
    fn le(self, o: Self) -> Self::Mask;
    /// `self == o`; false for NaN.
    fn eq(self, o: Self) -> Self::Mask;
    /// `m ? self : o`, lane by lane.
    fn or_else(self, m: Self::Mask, o: Self) -> Self;
    /// `self > o`; false for NaN.
    #[inline(always)]
    fn gt(self, o: Self) -> Self::Mask {
        o.lt(self)
    }
    /// `self >= o`; false for NaN.
    #[inline(always)]
    fn ge(self, o: Self) -> Self::Mask {
        o.le(self)
    }
    /// `self < o ? self : o`: a NaN in either gives `o`.
    #[inline(always)]
    fn min(self, o: Self) -> Self {
        self.or_else(self.lt(o), o)
    }
    /// `self > o ? self : o`: a NaN in either gives `o`.
    #[inline(always)]
    fn max(self, o: Self) -> Self {
        self.or_else(o.lt(self), o)
    }
    /// Clamped to `lo ..= hi`; NaN becomes `lo`.
    #[inline(always)]
    fn clamp(self, lo: f32, hi: f32) -> Self {
        self.max(self.lift(lo)).min(self.lift(hi))
    }
    /// Clamped to `0 ..= 1`; NaN becomes 0.
    #[inline(always)]
    fn saturate(self) -> Self {
        self.clamp(0.0, 1.0)
    }
    /// `1 / self`, a true division.
    #[inline(always)]
    fn recip(self) -> Self {
        self.lift(1.0) / self
    }
    /// `a + (b - a) * t` with `t = self`.
    #[inline(always)]
    fn mix(self, a: Self, b: Self) -> Self {
        a + (b - a) * self
    }
}

/// A 32-bit signed integer per lane. Arithmetic wraps; `>>` is arithmetic.
pub trait Int:
    Copy
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + BitAnd<Output = Self>
    + BitOr<Output = Self>
    + BitXor<Output = Self>
    + Add<i32, Output = Self>
    + Sub<i32, Output = Self>
    + Mul<i32, Output = Self>
    + BitAnd<i32, Output = Self>
    + BitOr<i32, Output = Self>
    + Shl<u32, Output = Self>
    + Shr<u32, Output = Self>
{
    /// The numbers of the same width.
    type Num: Num<Int = Self, Mask = Self::Mask>;
    /// The result of a comparison.
    type Mask: Mask;
    /// The same constant in every lane.
    fn lift(self, v: i32) -> Self;
    /// The integer in lane `k`.
    fn lane(self, k: usize) -> i32;
    /// Writes the lanes to the front of `out`.
    fn store(self, out: &mut [i32]);
    /// Nearest float (ties to even).
    fn to_num(self) -> Self::Num;
    /// The float with this bit pattern.
    #[allow(clippy::wrong_self_convention, reason = "the name that f32 gives it")]
    fn from_bits(self) -> Self::Num;
    /// `self < o`.
    fn lt(self, o: Self) -> Self::Mask;
    /// `self == o`.
    fn eq(self, o: Self) -> Self::Mask;
    /// `m ? self : o`, lane by lane.
    fn or_else(self, m: Self::Mask, o: Self) -> Self;
    /// `self > o`.
    #[inline(always)]
    fn gt(self, o: Self) -> Self::Mask {
        o.lt(self)
    }
    /// The smaller.
    #[inline(always)]
    fn min(self, o: Self) -> Self {
        self.or_else(self.lt(o), o)
    }
    /// The larger.
    #[inline(always)]
    fn max(self, o: Self) -> Self {
        self.or_else(o.lt(self), o)
    }
    /// Looks every lane up in `table`. The caller keeps lanes within the table: others panic.
    #[inline(always)]
    fn gather<T: Copy>(self, table: &[T], mut each: impl FnMut(usize, T)) {
        for k in 0..Self::Num::WIDTH {
            each(k, table[self.lane(k) as usize]);
        }
    }
}

/// The token of a level: makes numbers, integers and masks of its width.
pub trait Lane: Copy + Send + Sync + Debug + 'static {
    /// Numbers.
    type F: Num<Mask = Self::M, Int = Self::I>;
    /// Integers.
    type I: Int<Num = Self::F, Mask = Self::M>;
    /// Masks.
    type M: Mask;
    /// How many lanes there are: 1, 8 or 16.
    const WIDTH: usize;
    /// A constant.
    fn f(self, v: f32) -> Self::F;
    /// A constant integer.
    fn i(self, v: i32) -> Self::I;
    /// `WIDTH` numbers from the front of a slice (panics if it is shorter).
    fn load(self, s: &[f32]) -> Self::F;
    /// `WIDTH` integers from the front of a slice (panics if it is shorter).
    fn load_i(self, s: &[i32]) -> Self::I;
    /// Number `k` comes from `f(k)`.
    fn f_from(self, f: impl FnMut(usize) -> f32) -> Self::F;
    /// Integer `k` comes from `f(k)`.
    fn i_from(self, f: impl FnMut(usize) -> i32) -> Self::I;
    /// Lane `k` is bit `k`.
    fn mask(self, bits: u32) -> Self::M;
    /// 0, 1, 2, ...
    #[inline(always)]
    fn ramp(self) -> Self::I {
        self.i_from(
            #[inline(always)]
            |k| k as i32,
        )
    }
    /// `table[index[k]]` in lane `k`. Lanes outside the table panic.
    #[inline(always)]
    fn gather(self, table: &[f32], index: Self::I) -> Self::F {
        self.f_from(
            #[inline(always)]
            |k| table[index.lane(k) as usize],
        )
    }
    /// `table[index[k]]` in lane `k`. Lanes outside the table panic.
    #[inline(always)]
    fn gather_i(self, table: &[i32], index: Self::I) -> Self::I {
        self.i_from(
            #[inline(always)]
            |k| table[index.lane(k) as usize],
        )
    }
    /// Turns `WIDTH` rows of 8 numbers into 8 numbers of `WIDTH` lanes: `out[c]` lane `k` = `rows[k][c]`.
    fn transpose8(self, rows: &[[f32; 8]]) -> [Self::F; 8];
    /// As [`Lane::transpose8`], with row `k` at the front of `row(k)` (panics if that is shorter than 8).
    fn transpose_from<'a>(self, row: impl FnMut(usize) -> &'a [f32]) -> [Self::F; 8];
    /// As [`Lane::transpose_from`] for rows of 4 numbers.
    fn transpose4_from<'a>(self, row: impl FnMut(usize) -> &'a [f32]) -> [Self::F; 4];
    /// The lower and the upper halves of `pair(k)` in lane `k`: one load for two neighbours.
    fn pairs(self, pair: impl FnMut(usize) -> u64) -> [Self::I; 2];
    /// Runs `f` compiled for this level, without forcing it to be inlined into the caller.
    fn enter<R>(self, f: impl FnOnce() -> R) -> R;
}

/// `[f(0), f(1), f(2)]`. Unlike [`core::array::from_fn`] it is always inlined; pass closures with
/// `#[inline(always)]`, or their lane operations become calls.
#[inline(always)]
pub fn three<T>(f: impl Fn(usize) -> T) -> [T; 3] {
    [f(0), f(1), f(2)]
}

/// Something to run at a [`Level`]. `run` must be `#[inline(always)]`.
pub trait Kernel {
    /// What it returns.
    type Out;
    /// The work, generic over the level.
    fn run<L: Lane>(self, lane: L) -> Self::Out;
}

/// A SIMD level that this CPU has. The level changes the speed of a result, never its bits.
#[derive(Clone, Copy, Debug)]
pub struct Level(Which);

#[derive(Clone, Copy, Debug)]
enum Which {
    Scalar,
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    Sse(Sse2),
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    Avx2(Avx2),
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    Avx512(Avx512),
    #[cfg(target_arch = "aarch64")]
    Neon(fearless_simd::Neon),
    #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
    Wasm(fearless_simd::WasmSimd128),
}

impl Level {
    /// The names of all levels of all machines, in the words of `FRIEZE_SIMD`.
    pub const NAMES: [&str; 6] = ["scalar", "sse", "avx2", "avx512", "neon", "simd128"];

    /// The levels that this CPU has, slowest first.
    pub fn available() -> Vec<Level> {
        #[allow(unused_mut)]
        let mut all = vec![Level(Which::Scalar)];
        #[cfg(any(target_arch = "x86", target_arch = "x86_64", target_arch = "aarch64", target_arch = "wasm32"))]
        let cpu = CpuLevel::new();
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        {
            all.extend(cpu.as_sse2().map(|t| Level(Which::Sse(t))));
            all.extend(cpu.as_avx2().map(|t| Level(Which::Avx2(t))));
            all.extend(cpu.as_avx512().map(|t| Level(Which::Avx512(t))));
        }
        #[cfg(target_arch = "aarch64")]
        all.extend(cpu.as_neon().map(|t| Level(Which::Neon(t))));
        #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
        all.extend(cpu.as_wasm_simd128().map(|t| Level(Which::Wasm(t))));
        all
    }

    /// The fastest level of this CPU.
    pub fn best() -> Level {
        Self::available().pop().expect("the scalar level is always there")
    }

    /// The level called `name`, if this CPU has it.
    pub fn named(name: &str) -> Option<Level> {
        Self::available().into_iter().find(|l| l.name() == name)
    }

    /// `scalar`, `sse`, `avx2`, `avx512`, `neon` or `simd128`.
    pub fn name(self) -> &'static str {
        match self.0 {
            Which::Scalar => "scalar",
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Which::Sse(_) => "sse",
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Which::Avx2(_) => "avx2",
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Which::Avx512(_) => "avx512",
            #[cfg(target_arch = "aarch64")]
            Which::Neon(_) => "neon",
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Which::Wasm(_) => "simd128",
        }
    }

    /// Runs `kernel` compiled for this level.
    #[inline]
    pub fn run<K: Kernel>(self, kernel: K) -> K::Out {
        match self.0 {
            Which::Scalar => kernel.run(One),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Which::Sse(t) => t.vectorize(
                #[inline(always)]
                || kernel.run(By8(t)),
            ),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Which::Avx2(t) => t.vectorize(
                #[inline(always)]
                || kernel.run(By8(t)),
            ),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Which::Avx512(t) => t.vectorize(
                #[inline(always)]
                || kernel.run(By16(t)),
            ),
            #[cfg(target_arch = "aarch64")]
            Which::Neon(t) => t.vectorize(
                #[inline(always)]
                || kernel.run(By8(t)),
            ),
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Which::Wasm(t) => t.vectorize(
                #[inline(always)]
                || kernel.run(By8(t)),
            ),
        }
    }
}

impl Default for Level {
    fn default() -> Self {
        Self::best()
    }
}

/// One lane: the same code at `f32`, for one pixel, one texel or a test.
#[derive(Clone, Copy, Debug)]
pub struct One;

/// Eight lanes.
#[derive(Clone, Copy, Debug)]
pub struct By8<S>(S);

/// Sixteen lanes.
#[derive(Clone, Copy, Debug)]
pub struct By16<S>(S);

/// Wraps one width of the SIMD crate's vectors, so that no other file names them.
macro_rules! wide {
    ($By:ident, $F:ident, $I:ident, $M:ident, $f:ident, $i:ident, $m:ident, $n:tt) => {
        #[doc = concat!(stringify!($n), " numbers.")]
        #[derive(Clone, Copy, Debug)]
        pub struct $F<S: Simd>($f<S>);
        #[doc = concat!(stringify!($n), " integers.")]
        #[derive(Clone, Copy, Debug)]
        pub struct $I<S: Simd>($i<S>);
        #[doc = concat!(stringify!($n), " truth values.")]
        #[derive(Clone, Copy, Debug)]
        pub struct $M<S: Simd>($m<S>);

        wide!(@ops $F, f32, Add add +, Sub sub -, Mul mul *, Div div /);
        wide!(@ops $I, i32, Add add +, Sub sub -, Mul mul *, BitAnd bitand &, BitOr bitor |, BitXor bitxor ^);

        impl<S: Simd> Neg for $F<S> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self(-self.0)
            }
        }
        impl<S: Simd> Shl<u32> for $I<S> {
            type Output = Self;
            #[inline(always)]
            fn shl(self, n: u32) -> Self {
                Self(self.0 << n)
            }
        }
        impl<S: Simd> Shr<u32> for $I<S> {
            type Output = Self;
            #[inline(always)]
            fn shr(self, n: u32) -> Self {
                Self(self.0 >> n)
            }
        }
        impl<S: Simd> BitAnd for $M<S> {
            type Output = Self;
            #[inline(always)]
            fn bitand(self, o: Self) -> Self {
                Self(self.0 & o.0)
            }
        }
        impl<S: Simd> BitOr for $M<S> {
            type Output = Self;
            #[inline(always)]
            fn bitor(self, o: Self) -> Self {
                Self(self.0 | o.0)
            }
        }
        impl<S: Simd> Not for $M<S> {
            type Output = Self;
            #[inline(always)]
            fn not(self) -> Self {
                Self(!self.0)
            }
        }
        impl<S: Simd> Mask for $M<S> {
            #[inline(always)]
            fn bits(self) -> u32 {
                self.0.to_bitmask() as u32
            }
            #[inline(always)]
            fn any(self) -> bool {
                self.0.any_true()
            }
            #[inline(always)]
            fn all(self) -> bool {
                self.0.all_true()
            }
        }
        impl<S: Simd> Num for $F<S> {
            type Mask = $M<S>;
            type Int = $I<S>;
            const WIDTH: usize = $n;
            #[inline(always)]
            fn lift(self, v: f32) -> Self {
                Self($f::splat(self.0.token(), v))
            }
            #[inline(always)]
            fn lift_mask(self, v: bool) -> $M<S> {
                $M($m::splat(self.0.token(), v))
            }
            #[inline(always)]
            fn lane(self, k: usize) -> f32 {
                self.0.as_array()[k]
            }
            #[inline(always)]
            fn store(self, out: &mut [f32]) {
                self.0.store_slice(&mut out[..$n]);
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                Self(self.0.sqrt())
            }
            #[inline(always)]
            fn abs(self) -> Self {
                Self(self.0.abs())
            }
            #[inline(always)]
            fn floor(self) -> Self {
                Self(self.0.floor())
            }
            #[inline(always)]
            fn to_int(self) -> $I<S> {
                $I(self.0.to_int())
            }
            #[inline(always)]
            fn to_bits(self) -> $I<S> {
                $I(self.0.bitcast())
            }
            #[inline(always)]
            fn lt(self, o: Self) -> $M<S> {
                $M(self.0.simd_lt(o.0))
            }
            #[inline(always)]
            fn le(self, o: Self) -> $M<S> {
                $M(self.0.simd_le(o.0))
            }
            #[inline(always)]
            fn eq(self, o: Self) -> $M<S> {
                $M(self.0.simd_eq(o.0))
            }
            #[inline(always)]
            fn or_else(self, m: $M<S>, o: Self) -> Self {
                Self(m.0.select(self.0, o.0))
            }
        }
        impl<S: Simd> Int for $I<S> {
            type Num = $F<S>;
            type Mask = $M<S>;
            #[inline(always)]
            fn lift(self, v: i32) -> Self {
                Self($i::splat(self.0.token(), v))
            }
            #[inline(always)]
            fn lane(self, k: usize) -> i32 {
                self.0.as_array()[k]
            }
            #[inline(always)]
            fn store(self, out: &mut [i32]) {
                self.0.store_slice(&mut out[..$n]);
            }
            #[inline(always)]
            fn to_num(self) -> $F<S> {
                $F(self.0.to_float())
            }
            #[inline(always)]
            fn from_bits(self) -> $F<S> {
                $F(self.0.bitcast())
            }
            #[inline(always)]
            fn lt(self, o: Self) -> $M<S> {
                $M(self.0.simd_lt(o.0))
            }
            #[inline(always)]
            fn eq(self, o: Self) -> $M<S> {
                $M(self.0.simd_eq(o.0))
            }
            #[inline(always)]
            fn or_else(self, m: $M<S>, o: Self) -> Self {
                Self(m.0.select(self.0, o.0))
            }
        }
        impl<S: Simd> Lane for $By<S> {
            type F = $F<S>;
            type I = $I<S>;
            type M = $M<S>;
            const WIDTH: usize = $n;
            #[inline(always)]
            fn f(self, v: f32) -> $F<S> {
                $F($f::splat(self.0, v))
            }
            #[inline(always)]
            fn i(self, v: i32) -> $I<S> {
                $I($i::splat(self.0, v))
            }
            #[inline(always)]
            fn load(self, s: &[f32]) -> $F<S> {
                $F($f::from_slice(self.0, &s[..$n]))
            }
            #[inline(always)]
            fn load_i(self, s: &[i32]) -> $I<S> {
                $I($i::from_slice(self.0, &s[..$n]))
            }
            #[inline(always)]
            fn f_from(self, f: impl FnMut(usize) -> f32) -> $F<S> {
                $F($f::from_fn(self.0, f))
            }
            #[inline(always)]
            fn i_from(self, f: impl FnMut(usize) -> i32) -> $I<S> {
                $I($i::from_fn(self.0, f))
            }
            #[inline(always)]
            fn mask(self, bits: u32) -> $M<S> {
                $M($m::from_bitmask(self.0, bits as u64))
            }
            #[inline(always)]
            fn transpose8(self, rows: &[[f32; 8]]) -> [$F<S>; 8] {
                self.transpose_from(
                    #[inline(always)]
                    |k| &rows[k],
                )
            }
            #[inline(always)]
            fn transpose_from<'a>(self, mut row: impl FnMut(usize) -> &'a [f32]) -> [$F<S>; 8] {
                wide!(@transpose $n self row $F)
            }
            #[inline(always)]
            fn transpose4_from<'a>(self, mut row: impl FnMut(usize) -> &'a [f32]) -> [$F<S>; 4] {
                wide!(@transpose4 $n self row $F)
            }
            #[inline(always)]
            fn pairs(self, mut pair: impl FnMut(usize) -> u64) -> [$I<S>; 2] {
                wide!(@pairs $n self pair $I)
            }
            #[inline(always)]
            fn enter<R>(self, f: impl FnOnce() -> R) -> R {
                self.0.vectorize(f)
            }
        }
    };
    (@ops $T:ident, $e:ty, $($trait:ident $fn:ident $op:tt),*) => {$(
        impl<S: Simd> $trait for $T<S> {
            type Output = Self;
            #[inline(always)]
            fn $fn(self, o: Self) -> Self {
                Self(self.0 $op o.0)
            }
        }
        impl<S: Simd> $trait<$e> for $T<S> {
            type Output = Self;
            #[inline(always)]
            fn $fn(self, o: $e) -> Self {
                Self(self.0 $op o)
            }
        }
    )*};
    (@transpose 8 $self:ident $row:ident $F:ident) => {{
        let s = $self.0;
        let t = transpose8x8([
            row8(s, $row(0)), row8(s, $row(1)), row8(s, $row(2)), row8(s, $row(3)),
            row8(s, $row(4)), row8(s, $row(5)), row8(s, $row(6)), row8(s, $row(7)),
        ]);
        [$F(t[0]), $F(t[1]), $F(t[2]), $F(t[3]), $F(t[4]), $F(t[5]), $F(t[6]), $F(t[7])]
    }};
    (@transpose 16 $self:ident $row:ident $F:ident) => {{
        let s = $self.0;
        let t = transpose8x8([
            row8(s, $row(0)), row8(s, $row(1)), row8(s, $row(2)), row8(s, $row(3)),
            row8(s, $row(4)), row8(s, $row(5)), row8(s, $row(6)), row8(s, $row(7)),
        ]);
        let u = transpose8x8([
            row8(s, $row(8)), row8(s, $row(9)), row8(s, $row(10)), row8(s, $row(11)),
            row8(s, $row(12)), row8(s, $row(13)), row8(s, $row(14)), row8(s, $row(15)),
        ]);
        [
            $F(s.combine_f32x8(t[0], u[0])), $F(s.combine_f32x8(t[1], u[1])),
            $F(s.combine_f32x8(t[2], u[2])), $F(s.combine_f32x8(t[3], u[3])),
            $F(s.combine_f32x8(t[4], u[4])), $F(s.combine_f32x8(t[5], u[5])),
            $F(s.combine_f32x8(t[6], u[6])), $F(s.combine_f32x8(t[7], u[7])),
        ]
    }};
    (@transpose4 8 $self:ident $row:ident $F:ident) => {{
        let s = $self.0;
        let (a, b) = (rows4(s, $row(0), $row(1)), rows4(s, $row(2), $row(3)));
        let (c, d) = (rows4(s, $row(4), $row(5)), rows4(s, $row(6), $row(7)));
        let (even, odd) = (s.unzip_low_f32x8(a, b), s.unzip_high_f32x8(a, b));
        let (even2, odd2) = (s.unzip_low_f32x8(c, d), s.unzip_high_f32x8(c, d));
        [
            $F(s.unzip_low_f32x8(even, even2)), $F(s.unzip_low_f32x8(odd, odd2)),
            $F(s.unzip_high_f32x8(even, even2)), $F(s.unzip_high_f32x8(odd, odd2)),
        ]
    }};
    (@transpose4 16 $self:ident $row:ident $F:ident) => {{
        let s = $self.0;
        let a = s.combine_f32x8(rows4(s, $row(0), $row(1)), rows4(s, $row(2), $row(3)));
        let b = s.combine_f32x8(rows4(s, $row(4), $row(5)), rows4(s, $row(6), $row(7)));
        let c = s.combine_f32x8(rows4(s, $row(8), $row(9)), rows4(s, $row(10), $row(11)));
        let d = s.combine_f32x8(rows4(s, $row(12), $row(13)), rows4(s, $row(14), $row(15)));
        let (even, odd) = (s.unzip_low_f32x16(a, b), s.unzip_high_f32x16(a, b));
        let (even2, odd2) = (s.unzip_low_f32x16(c, d), s.unzip_high_f32x16(c, d));
        [
            $F(s.unzip_low_f32x16(even, even2)), $F(s.unzip_low_f32x16(odd, odd2)),
            $F(s.unzip_high_f32x16(even, even2)), $F(s.unzip_high_f32x16(odd, odd2)),
        ]
    }};
    (@pairs 8 $self:ident $pair:ident $I:ident) => {{
        let s = $self.0;
        let a: i32x8<S> = u64x4::from_fn(s, #[inline(always)] |k| $pair(k)).bitcast();
        let b: i32x8<S> = u64x4::from_fn(s, #[inline(always)] |k| $pair(k + 4)).bitcast();
        [$I(s.unzip_low_i32x8(a, b)), $I(s.unzip_high_i32x8(a, b))]
    }};
    (@pairs 16 $self:ident $pair:ident $I:ident) => {{
        let s = $self.0;
        let a: i32x16<S> = u64x8::from_fn(s, #[inline(always)] |k| $pair(k)).bitcast();
        let b: i32x16<S> = u64x8::from_fn(s, #[inline(always)] |k| $pair(k + 8)).bitcast();
        [$I(s.unzip_low_i32x16(a, b)), $I(s.unzip_high_i32x16(a, b))]
    }};
}
wide!(By8, F8, I8, M8, f32x8, i32x8, mask32x8, 8);
wide!(By16, F16, I16, M16, f32x16, i32x16, mask32x16, 16);

#[inline(always)]
fn row8<S: Simd>(s: S, row: &[f32]) -> f32x8<S> {
    f32x8::from_slice(s, &row[..8])
}

/// Two rows of 4 side by side.
#[inline(always)]
fn rows4<S: Simd>(s: S, a: &[f32], b: &[f32]) -> f32x8<S> {
    s.combine_f32x4(f32x4::from_slice(s, &a[..4]), f32x4::from_slice(s, &b[..4]))
}

/// Three rounds of riffling rows that lie four apart.
#[inline(always)]
fn transpose8x8<S: Simd>(r: [f32x8<S>; 8]) -> [f32x8<S>; 8] {
    riffle(riffle(riffle(r)))
}

#[inline(always)]
fn riffle<S: Simd>(r: [f32x8<S>; 8]) -> [f32x8<S>; 8] {
    let s = r[0].token();
    [
        s.zip_low_f32x8(r[0], r[4]),
        s.zip_high_f32x8(r[0], r[4]),
        s.zip_low_f32x8(r[1], r[5]),
        s.zip_high_f32x8(r[1], r[5]),
        s.zip_low_f32x8(r[2], r[6]),
        s.zip_high_f32x8(r[2], r[6]),
        s.zip_low_f32x8(r[3], r[7]),
        s.zip_high_f32x8(r[3], r[7]),
    ]
}

#[cfg(test)]
mod tests;
