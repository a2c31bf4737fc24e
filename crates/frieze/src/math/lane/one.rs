//! One lane: plain numbers, integers and truth values.

use super::{Int, Lane, Mask, Num, One};
use core::ops::{Add, BitAnd, BitOr, BitXor, Mul, Shl, Shr, Sub};

impl Mask for bool {
    #[inline(always)]
    fn bits(self) -> u32 {
        self as u32
    }
    #[inline(always)]
    fn all(self) -> bool {
        self
    }
}

impl Num for f32 {
    type Mask = bool;
    type Int = I1;
    const WIDTH: usize = 1;
    #[inline(always)]
    fn lift(self, v: f32) -> Self {
        v
    }
    #[inline(always)]
    fn lift_mask(self, v: bool) -> bool {
        v
    }
    #[inline(always)]
    fn lane(self, _: usize) -> f32 {
        self
    }
    #[inline(always)]
    fn store(self, out: &mut [f32]) {
        out[0] = self;
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f32::sqrt(self)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        f32::abs(self)
    }
    #[inline(always)]
    fn floor(self) -> Self {
        f32::floor(self)
    }
    #[inline(always)]
    fn to_int(self) -> I1 {
        I1(self as i32)
    }
    #[inline(always)]
    fn to_bits(self) -> I1 {
        I1(f32::to_bits(self) as i32)
    }
    #[inline(always)]
    fn lt(self, o: Self) -> bool {
        self < o
    }
    #[inline(always)]
    fn le(self, o: Self) -> bool {
        self <= o
    }
    #[inline(always)]
    fn eq(self, o: Self) -> bool {
        self == o
    }
    #[inline(always)]
    fn or_else(self, m: bool, o: Self) -> Self {
        if m { self } else { o }
    }
}

/// One integer lane, with the wrapping arithmetic of the wide ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct I1(pub i32);

macro_rules! wrapping {
    ($($trait:ident $fn:ident $do:ident),*) => {$(
        impl $trait for I1 {
            type Output = I1;
            #[inline(always)]
            fn $fn(self, o: I1) -> I1 {
                I1(self.0.$do(o.0))
            }
        }
        impl $trait<i32> for I1 {
            type Output = I1;
            #[inline(always)]
            fn $fn(self, o: i32) -> I1 {
                I1(self.0.$do(o))
            }
        }
    )*};
}
wrapping!(Add add wrapping_add, Sub sub wrapping_sub, Mul mul wrapping_mul, BitAnd bitand bitand, BitOr bitor bitor, BitXor bitxor bitxor);

impl Shl<u32> for I1 {
    type Output = I1;
    #[inline(always)]
    fn shl(self, n: u32) -> I1 {
        I1(self.0.wrapping_shl(n))
    }
}

impl Shr<u32> for I1 {
    type Output = I1;
    #[inline(always)]
    fn shr(self, n: u32) -> I1 {
        I1(self.0.wrapping_shr(n))
    }
}

impl Int for I1 {
    type Num = f32;
    type Mask = bool;
    #[inline(always)]
    fn lift(self, v: i32) -> Self {
        I1(v)
    }
    #[inline(always)]
    fn lane(self, _: usize) -> i32 {
        self.0
    }
    #[inline(always)]
    fn store(self, out: &mut [i32]) {
        out[0] = self.0;
    }
    #[inline(always)]
    fn to_num(self) -> f32 {
        self.0 as f32
    }
    #[inline(always)]
    fn from_bits(self) -> f32 {
        f32::from_bits(self.0 as u32)
    }
    #[inline(always)]
    fn lt(self, o: Self) -> bool {
        self.0 < o.0
    }
    #[inline(always)]
    fn eq(self, o: Self) -> bool {
        self.0 == o.0
    }
    #[inline(always)]
    fn or_else(self, m: bool, o: Self) -> Self {
        if m { self } else { o }
    }
}

impl Lane for One {
    type F = f32;
    type I = I1;
    type M = bool;
    const WIDTH: usize = 1;
    #[inline(always)]
    fn f(self, v: f32) -> f32 {
        v
    }
    #[inline(always)]
    fn i(self, v: i32) -> I1 {
        I1(v)
    }
    #[inline(always)]
    fn load(self, s: &[f32]) -> f32 {
        s[0]
    }
    #[inline(always)]
    fn load_i(self, s: &[i32]) -> I1 {
        I1(s[0])
    }
    #[inline(always)]
    fn f_from(self, mut f: impl FnMut(usize) -> f32) -> f32 {
        f(0)
    }
    #[inline(always)]
    fn i_from(self, mut f: impl FnMut(usize) -> i32) -> I1 {
        I1(f(0))
    }
    #[inline(always)]
    fn mask(self, bits: u32) -> bool {
        bits & 1 != 0
    }
    #[inline(always)]
    fn transpose8(self, rows: &[[f32; 8]]) -> [f32; 8] {
        rows[0]
    }
    #[inline(always)]
    fn transpose_from<'a>(self, mut row: impl FnMut(usize) -> &'a [f32]) -> [f32; 8] {
        core::array::from_fn(|c| row(0)[c])
    }
    #[inline(always)]
    fn transpose4_from<'a>(self, mut row: impl FnMut(usize) -> &'a [f32]) -> [f32; 4] {
        let r = &row(0)[..4];
        [r[0], r[1], r[2], r[3]]
    }
    #[inline(always)]
    fn pairs(self, mut pair: impl FnMut(usize) -> u64) -> [I1; 2] {
        let p = pair(0);
        [I1(p as u32 as i32), I1((p >> 32) as u32 as i32)]
    }
    #[inline(always)]
    fn enter<R>(self, f: impl FnOnce() -> R) -> R {
        f()
    }
}
