//! Vectors over [`Num`] (one point, or several side by side) and 4x4 matrices of `f32`.
//!
//! Sums run in one written order, left to right, so every width gives the same bits.

use super::lane::{Mask, Num};
use core::ops::{Add, Div, Mul, Neg, Sub};

macro_rules! vector {
    ($(#[$doc:meta])* $V:ident $n:literal { $($f:ident),* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Default)]
        #[repr(C)]
        pub struct $V<N = f32> { $(#[allow(missing_docs)] pub $f: N),* }

        impl<N> $V<N> {
            /// From components.
            #[inline(always)]
            pub const fn new($($f: N),*) -> Self { $V { $($f),* } }
        }
        impl<N: Copy> $V<N> {
            /// The same number in every component.
            #[inline(always)]
            pub fn splat(v: N) -> Self { $V { $($f: v),* } }
            /// `f` of every component.
            #[inline(always)]
            pub fn map<M>(self, mut f: impl FnMut(N) -> M) -> $V<M> { $V { $($f: f(self.$f)),* } }
            /// `f` of every pair of components.
            #[inline(always)]
            pub fn zip<M: Copy, R>(self, o: $V<M>, mut f: impl FnMut(N, M) -> R) -> $V<R> {
                $V { $($f: f(self.$f, o.$f)),* }
            }
            /// As an array.
            #[inline(always)]
            pub fn array(self) -> [N; $n] { [$(self.$f),*] }
        }
        impl<N> From<[N; $n]> for $V<N> {
            #[inline(always)]
            fn from([$($f),*]: [N; $n]) -> Self { $V { $($f),* } }
        }
        impl<N: Num> $V<N> {
            /// `m ? self : o`, lane by lane.
            #[inline(always)]
            pub fn or_else(self, m: N::Mask, o: Self) -> Self { $V { $($f: self.$f.or_else(m, o.$f)),* } }
            /// The smaller of each pair of components.
            #[inline(always)]
            pub fn min(self, o: Self) -> Self { $V { $($f: self.$f.min(o.$f)),* } }
            /// The larger of each pair of components.
            #[inline(always)]
            pub fn max(self, o: Self) -> Self { $V { $($f: self.$f.max(o.$f)),* } }
            /// Squared length.
            #[inline(always)]
            pub fn length2(self) -> N { self.dot(self) }
            /// Length.
            #[inline(always)]
            pub fn length(self) -> N { self.dot(self).sqrt() }
            /// Divided by its length; the zero vector stays zero.
            #[inline(always)]
            pub fn normalize(self) -> Self {
                let l = self.length();
                let zero = l.le(l.lift(0.0));
                let r = l.lift(1.0).or_else(zero, l).recip();
                self * r
            }
            /// Linear interpolation from `self` to `o`.
            #[inline(always)]
            pub fn mix(self, o: Self, t: N) -> Self { self + (o - self) * t }
        }
        impl $V<f32> {
            /// All components in all lanes of the width of `like`.
            #[inline(always)]
            pub fn lift<N: Num>(self, like: N) -> $V<N> { $V { $($f: like.lift(self.$f)),* } }
            /// Whether no component is NaN or infinite.
            pub fn is_finite(self) -> bool { true $(&& self.$f.is_finite())* }
        }
        impl<N: Num> Add for $V<N> {
            type Output = Self;
            #[inline(always)]
            fn add(self, o: Self) -> Self { $V { $($f: self.$f + o.$f),* } }
        }
        impl<N: Num> Sub for $V<N> {
            type Output = Self;
            #[inline(always)]
            fn sub(self, o: Self) -> Self { $V { $($f: self.$f - o.$f),* } }
        }
        impl<N: Num> Mul for $V<N> {
            type Output = Self;
            #[inline(always)]
            fn mul(self, o: Self) -> Self { $V { $($f: self.$f * o.$f),* } }
        }
        impl<N: Num> Mul<N> for $V<N> {
            type Output = Self;
            #[inline(always)]
            fn mul(self, o: N) -> Self { $V { $($f: self.$f * o),* } }
        }
        impl<N: Num> Div<N> for $V<N> {
            type Output = Self;
            #[inline(always)]
            fn div(self, o: N) -> Self { $V { $($f: self.$f / o),* } }
        }
        impl<N: Num> Neg for $V<N> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self { $V { $($f: -self.$f),* } }
        }
    };
}

vector!(
    /// Two numbers.
    Vec2 2 { x, y }
);
vector!(
    /// Three numbers: a point, a direction or a colour.
    Vec3 3 { x, y, z }
);
vector!(
    /// Four numbers: a homogeneous point, or a colour with alpha.
    Vec4 4 { x, y, z, w }
);

impl<N: Num> Vec2<N> {
    /// Inner product.
    #[inline(always)]
    pub fn dot(self, o: Self) -> N {
        self.x * o.x + self.y * o.y
    }
}

impl<N: Num> Vec3<N> {
    /// Inner product.
    #[inline(always)]
    pub fn dot(self, o: Self) -> N {
        self.x * o.x + self.y * o.y + self.z * o.z
    }
    /// Outer product, right-handed.
    #[inline(always)]
    pub fn cross(self, o: Self) -> Self {
        Vec3 { x: self.y * o.z - self.z * o.y, y: self.z * o.x - self.x * o.z, z: self.x * o.y - self.y * o.x }
    }
    /// Mirrored at a plane with unit normal `n`: GLSL's `reflect`, `v - 2 (n . v) n`.
    #[inline(always)]
    pub fn reflect(self, n: Self) -> Self {
        self - n * (self.dot(n) * 2.0)
    }
    /// With a fourth component.
    #[inline(always)]
    pub fn extend(self, w: N) -> Vec4<N> {
        Vec4 { x: self.x, y: self.y, z: self.z, w }
    }
}

impl<N: Num> Vec4<N> {
    /// Inner product.
    #[inline(always)]
    pub fn dot(self, o: Self) -> N {
        self.x * o.x + self.y * o.y + self.z * o.z + self.w * o.w
    }
    /// Without the fourth component.
    #[inline(always)]
    pub fn xyz(self) -> Vec3<N> {
        Vec3 { x: self.x, y: self.y, z: self.z }
    }
}

/// Two unit vectors that make a right-handed basis `(b1, b2, n)` with the unit vector `n`.
/// Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
#[inline(always)]
pub fn basis<N: Num>(n: Vec3<N>) -> (Vec3<N>, Vec3<N>) {
    let one = n.z.lift(1.0);
    let sign = (-one).or_else(n.z.lt(n.z.lift(0.0)), one);
    let a = (sign + n.z).recip() * -1.0;
    let b = n.x * n.y * a;
    (Vec3::new(one + sign * n.x * n.x * a, sign * b, -(sign * n.x)), Vec3::new(b, sign + n.y * n.y * a, -n.y))
}

/// Whether any lane of a mask is set (so that callers need not import [`Mask`]).
#[inline(always)]
pub fn any<M: Mask>(m: M) -> bool {
    m.any()
}

/// A 4x4 matrix of columns: `m.0[c][r]`. Points are columns, `M * p`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mat4(pub [[f32; 4]; 4]);

impl Default for Mat4 {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Mat4 {
    /// Leaves everything where it is.
    pub const IDENTITY: Mat4 =
        Mat4([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]);

    /// From 16 numbers, column by column (glTF's order).
    pub fn from_columns(m: [f32; 16]) -> Self {
        Mat4(core::array::from_fn(|c| core::array::from_fn(|r| m[4 * c + r])))
    }
    /// From three axes and an origin.
    pub fn from_axes(x: Vec3, y: Vec3, z: Vec3, origin: Vec3) -> Self {
        Mat4([x.extend(0.0).array(), y.extend(0.0).array(), z.extend(0.0).array(), origin.extend(1.0).array()])
    }
    /// Moves by `t`.
    pub fn translation(t: Vec3) -> Self {
        let mut m = Self::IDENTITY;
        m.0[3] = [t.x, t.y, t.z, 1.0];
        m
    }
    /// Scales along the axes.
    pub fn scale(s: Vec3) -> Self {
        Mat4([[s.x, 0.0, 0.0, 0.0], [0.0, s.y, 0.0, 0.0], [0.0, 0.0, s.z, 0.0], [0.0, 0.0, 0.0, 1.0]])
    }
    /// Rotation by a quaternion `(x, y, z, w)`, which is normalised first; the zero quaternion rotates nothing.
    pub fn rotation([x, y, z, w]: [f32; 4]) -> Self {
        let (x, y, z, w) = (f64::from(x), f64::from(y), f64::from(z), f64::from(w));
        let n = (x * x + y * y + z * z + w * w).sqrt();
        if n.is_nan() || n <= 0.0 {
            return Self::IDENTITY;
        }
        let (x, y, z, w) = (x / n, y / n, z / n, w / n);
        let m = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w), 0.0],
            [2.0 * (x * y - z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + x * w), 0.0],
            [2.0 * (x * z + y * w), 2.0 * (y * z - x * w), 1.0 - 2.0 * (x * x + y * y), 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ];
        Mat4(m.map(|c| c.map(|v| v as f32)))
    }
    /// Row `r`.
    pub fn row(&self, r: usize) -> Vec4 {
        Vec4::new(self.0[0][r], self.0[1][r], self.0[2][r], self.0[3][r])
    }
    /// Column `c`.
    pub fn column(&self, c: usize) -> Vec4 {
        self.0[c].into()
    }
    /// The product `self * o`: first `o`, then `self`. Summed in f64, rounded once.
    pub fn times(&self, o: &Mat4) -> Mat4 {
        Mat4(core::array::from_fn(|c| {
            core::array::from_fn(|r| (0..4).map(|k| f64::from(self.0[k][r]) * f64::from(o.0[c][k])).sum::<f64>() as f32)
        }))
    }
    /// A homogeneous point.
    #[inline(always)]
    pub fn apply<N: Num>(&self, p: Vec4<N>) -> Vec4<N> {
        Vec4::new(self.row4(0, p), self.row4(1, p), self.row4(2, p), self.row4(3, p))
    }
    /// A point (w = 1), with its homogeneous coordinate.
    #[inline(always)]
    pub fn project<N: Num>(&self, p: Vec3<N>) -> Vec4<N> {
        Vec4::new(self.row_point(0, p), self.row_point(1, p), self.row_point(2, p), self.row_point(3, p))
    }
    /// A point under an affine matrix.
    #[inline(always)]
    pub fn point<N: Num>(&self, p: Vec3<N>) -> Vec3<N> {
        Vec3::new(self.row_point(0, p), self.row_point(1, p), self.row_point(2, p))
    }
    /// A direction (w = 0).
    #[inline(always)]
    pub fn direction<N: Num>(&self, d: Vec3<N>) -> Vec3<N> {
        Vec3::new(self.row3(0, d), self.row3(1, d), self.row3(2, d))
    }
    // Functions, not closures: closures are not always inlined, and a lane operation that is not becomes a call.
    #[inline(always)]
    fn row4<N: Num>(&self, r: usize, p: Vec4<N>) -> N {
        let m = &self.0;
        p.x * m[0][r] + p.y * m[1][r] + p.z * m[2][r] + p.w * m[3][r]
    }
    #[inline(always)]
    fn row_point<N: Num>(&self, r: usize, p: Vec3<N>) -> N {
        let m = &self.0;
        p.x * m[0][r] + p.y * m[1][r] + p.z * m[2][r] + m[3][r]
    }
    #[inline(always)]
    fn row3<N: Num>(&self, r: usize, d: Vec3<N>) -> N {
        let m = &self.0;
        d.x * m[0][r] + d.y * m[1][r] + d.z * m[2][r]
    }
    /// The transpose.
    pub fn transpose(&self) -> Mat4 {
        Mat4(core::array::from_fn(|c| core::array::from_fn(|r| self.0[r][c])))
    }
    /// Determinant of the upper left 3x3: negative when the matrix mirrors.
    pub fn determinant3(&self) -> f64 {
        let m = self.0.map(|c| c.map(f64::from));
        m[0][0] * (m[1][1] * m[2][2] - m[2][1] * m[1][2]) - m[1][0] * (m[0][1] * m[2][2] - m[2][1] * m[0][2])
            + m[2][0] * (m[0][1] * m[1][2] - m[1][1] * m[0][2])
    }
    /// The inverse, computed in f64; `None` when there is none.
    pub fn inverse(&self) -> Option<Mat4> {
        // Gauss-Jordan with row pivoting on [self | I].
        let mut a = [[0.0f64; 8]; 4];
        for (r, row) in a.iter_mut().enumerate() {
            for c in 0..4 {
                row[c] = f64::from(self.0[c][r]);
            }
            row[4 + r] = 1.0;
        }
        for c in 0..4 {
            let p = (c..4).max_by(|&i, &j| a[i][c].abs().total_cmp(&a[j][c].abs()))?;
            if a[p][c] == 0.0 || !a[p][c].is_finite() {
                return None;
            }
            a.swap(c, p);
            let d = a[c][c];
            for v in &mut a[c] {
                *v /= d;
            }
            let pivot = a[c];
            for (r, row) in a.iter_mut().enumerate() {
                if r != c {
                    let f = row[c];
                    for (v, p) in row.iter_mut().zip(pivot) {
                        *v -= f * p;
                    }
                }
            }
        }
        let m = Mat4(core::array::from_fn(|c| core::array::from_fn(|r| a[r][4 + c] as f32)));
        m.0.iter().flatten().all(|v| v.is_finite()).then_some(m)
    }
    /// What normals are multiplied with: the cofactors of the upper left 3x3, i.e. det * inverse transpose
    /// (row 61; keeps its direction for mirrored and singular matrices alike, and needs no division).
    pub fn normal_matrix(&self) -> Mat4 {
        let m = self.0.map(|c| c.map(f64::from));
        let cross = |a: [f64; 4], b: [f64; 4]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0], 0.0].map(|v| v as f32)
        };
        let sign = if self.determinant3() < 0.0 { -1.0 } else { 1.0 };
        let c = [cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])].map(|c| c.map(|v| v * sign));
        Mat4([c[0], c[1], c[2], [0.0, 0.0, 0.0, 1.0]])
    }
    /// The view matrix of a camera at `eye` that looks at `target` along -Z (row 1). When `up` is parallel
    /// to the view, the axis it is least parallel to takes its place.
    pub fn look_at(eye: Vec3, target: Vec3, up: Vec3) -> Mat4 {
        let z = (eye - target).normalize();
        let z = if z.length2() > 0.0 { z } else { Vec3::new(0.0, 0.0, 1.0) };
        let mut x = up.cross(z);
        if x.length2() <= 1e-12 * up.length2() {
            let a = z.map(f32::abs);
            let other = if a.x <= a.y && a.x <= a.z {
                Vec3::new(1.0, 0.0, 0.0)
            } else if a.z <= a.y {
                Vec3::new(0.0, 0.0, 1.0)
            } else {
                Vec3::new(0.0, 1.0, 0.0)
            };
            x = other.cross(z);
        }
        let x = x.normalize();
        let y = z.cross(x);
        Mat4([
            [x.x, y.x, z.x, 0.0],
            [x.y, y.y, z.y, 0.0],
            [x.z, y.z, z.z, 0.0],
            [-x.dot(eye), -y.dot(eye), -z.dot(eye), 1.0],
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_times_self_is_identity() {
        let m = Mat4::translation(Vec3::new(1.0, -2.0, 3.0))
            .times(&Mat4::rotation([0.1, 0.7, -0.2, 0.5]))
            .times(&Mat4::scale(Vec3::new(2.0, -0.5, 3.0)));
        let i = m.inverse().unwrap().times(&m);
        for c in 0..4 {
            for r in 0..4 {
                // f32 rounding of entries up to 6: a few units in the last place.
                assert!((i.0[c][r] - Mat4::IDENTITY.0[c][r]).abs() < 2e-6);
            }
        }
        assert!(Mat4::scale(Vec3::new(0.0, 1.0, 1.0)).inverse().is_none());
    }

    #[test]
    fn normals_stay_perpendicular_under_any_transform() {
        let (t, n) = (Vec3::new(1.0, 1.0, 0.0), Vec3::new(1.0, -1.0, 0.5));
        for s in [Vec3::new(2.0, 2.0, 2.0), Vec3::new(3.0, 0.5, 1.0), Vec3::new(-1.0, 2.0, 0.7)] {
            let m = Mat4::rotation([0.3, -0.2, 0.5, 0.8]).times(&Mat4::scale(s));
            let d = m.normal_matrix().direction(n).normalize().dot(m.direction(t).normalize());
            // Both vectors are rounded to f32 once per component.
            assert!(d.abs() < 1e-6, "{d}");
        }
    }

    #[test]
    fn look_at_survives_up_along_the_view() {
        let m = Mat4::look_at(Vec3::new(0.0, 5.0, 0.0), Vec3::new(0.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0));
        let p = m.point(Vec3::new(0.0, 0.0, 0.0));
        assert_eq!(p, Vec3::new(0.0, 0.0, -5.0));
    }
}
