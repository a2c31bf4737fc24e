//! Depth <-> texel, bias, hard lookup and percentage closer filtering (rows 100 to 111).
//!
//! Texels hold reversed depth, 1 at the light's near plane and 0 at its far plane (or where nothing is), as the
//! rasteriser makes it; what is told to users and taken from them (`bias`) is forward depth, 0 at near.

use crate::math::lane::{Int, Lane, Num};
use crate::math::vec::{Mat4, Vec3};

/// What keeps a surface from shadowing itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Offset {
    /// In forward light depth.
    Constant(f32),
    /// From texel size, slope and filter radius: what the receiver's plane gains in depth over the farthest tap.
    Slope {
        /// World axes of the map: right, up, and against the light.
        axes: [Vec3; 3],
        /// Depth of one texel's width, in light depth.
        texel: f32,
    },
}

/// A shadow map.
#[derive(Clone, Debug)]
pub struct ShadowMap {
    /// World to texels (x right, y down, texel centres at +0.5) and reversed depth; affine.
    pub matrix: Mat4,
    /// Texels along each side.
    pub size: u32,
    /// Rows of `stride` texels, framed by `margin` empty ones.
    pub texels: Vec<f32>,
    /// 0: one nearest lookup; 1: 3x3; ...
    pub radius: u32,
    /// Subtracted before the comparison.
    pub offset: Offset,
    /// The map repeats and depth beyond far is compared as it is (document 002), instead of lit outside.
    pub repeat: bool,
}

/// Planes that turn further away from the light get the bias of this cosine: they are dark, whatever a shading normal
/// says, by a hundredth at most.
const LEAST_COSINE: f32 = 0.01;

/// Reading a row of taps loads this many texels at once.
const WIDE: u32 = 8;

impl ShadowMap {
    /// Empty texels around the map: taps beyond the edge see nothing.
    pub fn margin(radius: u32) -> u32 {
        2 * radius + 1
    }
    /// Texels from one row to the next.
    pub fn stride(size: u32, radius: u32) -> u32 {
        size + 2 * Self::margin(radius) + WIDE
    }
    /// Rows, margins included.
    pub fn rows(size: u32, radius: u32) -> u32 {
        size + 2 * Self::margin(radius)
    }
    /// Reversed depth of a texel.
    pub fn texel(&self, x: u32, y: u32) -> f32 {
        let margin = Self::margin(self.radius);
        self.texels[((y + margin) * Self::stride(self.size, self.radius) + x + margin) as usize]
    }

    /// The share of light that arrives at `position` (world), 0 in shadow, 1 lit.
    /// `normal` is the unit normal of the surface's plane (not a shading normal), for the automatic bias.
    #[inline(always)]
    pub fn visibility<L: Lane>(&self, l: L, position: Vec3<L::F>, normal: Vec3<L::F>, _active: L::M) -> L::F {
        let p = self.matrix.point(position);
        let bias = match &self.offset {
            Offset::Constant(b) => l.f(*b),
            Offset::Slope { axes, texel } => {
                let one = l.f(1.0);
                let n = [normal.dot(axes[0].lift(one)), normal.dot(axes[1].lift(one)), normal.dot(axes[2].lift(one))];
                // The plane's slope along both axes, over the farthest tap and the half texel that nearest
                // lookups are off; a grazing plane is dark anyway.
                let slope = (n[0].abs() + n[1].abs()) / n[2].max(l.f(LEAST_COSINE));
                (slope * (self.radius as f32 + 0.5) + 0.5) * *texel
            }
        };
        let depth = p.z + bias;
        if self.repeat { self.repeated(l, p, depth) } else { self.framed(l, p, depth) }
    }

    /// Lit outside of the map and beyond its far plane.
    #[inline(always)]
    fn framed<L: Lane>(&self, l: L, p: Vec3<L::F>, depth: L::F) -> L::F {
        let (stride, margin) = (Self::stride(self.size, self.radius) as i32, Self::margin(self.radius) as i32);
        let depth = depth.max(l.f(0.0));
        // Beyond far nothing can be in front: no texel is nearer than 1.
        let depth = l.f(1.0).or_else(p.z.lt(l.f(0.0)), depth);
        let (low, high) = (-(self.radius as f32) - 1.0, (self.size + self.radius) as f32);
        let (x, y) = (p.x.floor().clamp(low, high).to_int(), p.y.floor().clamp(low, high).to_int());
        let r = self.radius as i32;
        let first = (y + (margin - r)) * stride + x + (margin - r);
        let mut lit = l.f(0.0);
        let (one, none) = (l.f(1.0), l.f(0.0));
        if self.radius == 1 {
            let mut at = [0i32; 16];
            first.store(&mut at);
            for row in 0..3 {
                let taps = l.transpose4_from(
                    #[inline(always)]
                    |k| {
                        let at = at[k] as usize + row * stride as usize;
                        &self.texels[at..at + 4]
                    },
                );
                for tap in &taps[..3] {
                    lit = lit + one.or_else(depth.ge(*tap), none);
                }
            }
            return lit / 9.0;
        }
        let side = 2 * self.radius + 1;
        for row in 0..side as i32 {
            for column in 0..side as i32 {
                let tap = l.gather(&self.texels, first + (row * stride + column));
                lit = lit + one.or_else(depth.ge(tap), none);
            }
        }
        lit / (side * side) as f32
    }

    #[inline(always)]
    fn repeated<L: Lane>(&self, l: L, p: Vec3<L::F>, depth: L::F) -> L::F {
        let size = self.size as i64;
        let (x, y) = (p.x.floor().clamp(-1e9, 1e9).to_int(), p.y.floor().clamp(-1e9, 1e9).to_int());
        let r = self.radius as i64;
        let side = (2 * self.radius + 1) as f32;
        let mut lit = l.f(0.0);
        for dy in -r..=r {
            for dx in -r..=r {
                let tap = l.f_from(|k| {
                    let wrap = |v: i32, d: i64| (i64::from(v) + d).rem_euclid(size) as u32;
                    self.texel(wrap(x.lane(k), dx), wrap(y.lane(k), dy))
                });
                lit = lit + l.f(1.0).or_else(depth.ge(tap), l.f(0.0));
            }
        }
        lit / (side * side)
    }
}

/// One texel that a shadow lookup compared with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadowTap {
    /// Texels from the left; outside of the map (where nothing is) below 0 or from `size` on.
    pub x: i64,
    /// Texels from the top.
    pub y: i64,
    /// Forward light depth of what the light sees there: 0 at near, 1 at far or where nothing is.
    pub depth: f32,
    /// Whether light arrives.
    pub lit: bool,
}

/// What a shadow lookup did.
#[derive(Clone, Debug, PartialEq)]
pub struct ShadowTrace {
    /// The point in the map, texels from the left and from the top.
    pub place: [f32; 2],
    /// Its forward light depth: 0 at near, 1 at far.
    pub depth: f32,
    /// Taken from the depth before it is compared.
    pub bias: f32,
    /// The comparisons, row after row; the share that is lit is the visibility.
    pub taps: Vec<ShadowTap>,
}

impl ShadowMap {
    /// What [`ShadowMap::visibility`] compares at `position` (world), with the unit normal for the bias.
    pub fn traced(&self, position: Vec3, normal: Vec3) -> ShadowTrace {
        let p = self.matrix.point(position);
        let bias = match &self.offset {
            Offset::Constant(b) => *b,
            Offset::Slope { axes, texel } => {
                let n = axes.map(|a| normal.dot(a));
                let slope = (n[0].abs() + n[1].abs()) / Num::max(n[2], LEAST_COSINE);
                (slope * (self.radius as f32 + 0.5) + 0.5) * *texel
            }
        };
        let (size, r) = (i64::from(self.size), i64::from(self.radius));
        // As far outside as any.
        let (low, high) = if self.repeat { (-1e9, 1e9) } else { (-(r as f32) - 1.0, (size + r) as f32) };
        let texel = |v: f32| Num::clamp(v.floor(), low, high) as i64;
        let (x, y) = (texel(p.x), texel(p.y));
        let asked = p.z + bias;
        let asked = if self.repeat || asked > 0.0 { asked } else { 0.0 };
        let beyond = !self.repeat && p.z < 0.0;
        let mut taps = Vec::new();
        for (dy, dx) in (-r..=r).flat_map(|dy| (-r..=r).map(move |dx| (dy, dx))) {
            let wrap = |v: i64| if self.repeat { v.rem_euclid(size) } else { v };
            let (x, y) = (wrap(x + dx), wrap(y + dy));
            let inside = (0..size).contains(&x) && (0..size).contains(&y);
            let depth = if inside { self.texel(x as u32, y as u32) } else { 0.0 };
            taps.push(ShadowTap { x, y, depth: 1.0 - depth, lit: beyond || asked >= depth });
        }
        ShadowTrace { place: [p.x, p.y], depth: 1.0 - p.z, bias, taps }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::lane::{Kernel, Level, One};

    /// A wall at reversed depth 0.5 over the left half of a 4x4 map.
    fn half(radius: u32) -> ShadowMap {
        let (size, margin) = (4, ShadowMap::margin(radius));
        let stride = ShadowMap::stride(size, radius);
        let mut texels = vec![0.0; (stride * ShadowMap::rows(size, radius)) as usize];
        for y in 0..4 {
            for x in 0..2 {
                texels[((y + margin) * stride + x + margin) as usize] = 0.5;
            }
        }
        ShadowMap { matrix: Mat4::IDENTITY, size, texels, radius, offset: Offset::Constant(0.0), repeat: false }
    }

    fn ask(map: &ShadowMap, x: f32, y: f32, z: f32) -> f32 {
        map.visibility(One, Vec3::new(x, y, z), Vec3::new(0.0, 0.0, 1.0), true)
    }

    #[test]
    fn row_103_a_hard_lookup_compares_with_the_nearest_texel() {
        let map = half(0);
        assert_eq!([ask(&map, 1.9, 2.0, 0.4), ask(&map, 2.1, 2.0, 0.4)], [0.0, 1.0]);
        assert_eq!(ask(&map, 1.9, 2.0, 0.6), 1.0, "in front of the wall");
    }

    #[test]
    fn row_106_pcf_is_the_mean_of_comparisons_not_of_depths() {
        let map = half(1);
        // Taps of columns 0, 1, 2 and 1, 2, 3: two and one of three columns in shadow.
        assert_eq!([ask(&map, 1.5, 1.5, 0.4), ask(&map, 2.5, 1.5, 0.4)], [3.0 / 9.0, 6.0 / 9.0]);
    }

    #[test]
    fn row_104_outside_and_beyond_far_is_lit() {
        let map = half(1);
        for (x, y, z) in [(-9.0, 2.0, 0.4), (1.0, 99.0, 0.4), (3.9, 2.0, -0.3), (f32::NAN, 2.0, 0.4)] {
            assert_eq!(ask(&map, x, y, z), 1.0, "{x} {y} {z}");
        }
        assert_eq!(ask(&map, -2.0, 2.0, 0.4), 1.0);
        assert_eq!(ask(&map, 1.0, 2.0, -0.3), 1.0, "beyond far, behind the wall");
    }

    #[test]
    fn the_trace_of_a_lookup_is_the_lookup() {
        let axes = [Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 0.0, 1.0)];
        for (radius, repeat, auto) in
            (0..3).flat_map(|r| [(r, false, false), (r, false, true), (r, true, false), (r, true, true)])
        {
            let offset = if auto { Offset::Slope { axes, texel: 0.01 } } else { Offset::Constant(0.02) };
            let map = ShadowMap { offset, repeat, ..half(radius) };
            for k in 0..200 {
                let k = k as f32;
                let n = Vec3::new(k * 0.01, k * 0.003, 0.8).normalize();
                let p = Vec3::new(k * 0.063 - 4.0, k * 0.037 - 2.0, k * 0.007 - 0.2);
                let trace = map.traced(p, n);
                let lit = trace.taps.iter().filter(|t| t.lit).count() as f32;
                assert_eq!(lit / trace.taps.len() as f32, map.visibility(One, p, n, true), "{map:?} {p:?}");
            }
        }
    }

    #[test]
    fn every_width_answers_the_same_bits() {
        struct Ask<'a>(&'a ShadowMap);
        impl Kernel for Ask<'_> {
            type Out = Vec<u32>;
            #[inline(always)]
            fn run<L: Lane>(self, l: L) -> Vec<u32> {
                let mut out = Vec::new();
                for block in 0..64 / L::WIDTH {
                    let k = (l.ramp() + (block * L::WIDTH) as i32).to_num();
                    let n = Vec3::new(k * 0.01, k * 0.003, l.f(0.8)).normalize();
                    let p = Vec3::new(k * 0.13 - 2.0, k * 0.07, k * 0.013);
                    let v = self.0.visibility(l, p, n, l.mask(u32::MAX));
                    out.extend((0..L::WIDTH).map(|k| v.lane(k).to_bits()));
                }
                out
            }
        }
        for radius in 0..3 {
            for repeat in [false, true] {
                let axes = [Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 0.0, 1.0)];
                let map = ShadowMap { offset: Offset::Slope { axes, texel: 0.01 }, repeat, ..half(radius) };
                let want = Ask(&map).run(One);
                for level in Level::available() {
                    assert_eq!(level.run(Ask(&map)), want, "{} radius {radius} repeat {repeat}", level.name());
                }
            }
        }
    }
}
