//! The question that all maps answer: `at(place, footprint)`.

use super::area;
use super::fetch::{self, At, Listen, Quiet, Store, Taps, bilinear, fold, half_log2, two_levels};
use super::filter::{Filter, Wrap};
use crate::image::pyramid::{Pyramid, Shape, Texels};
use crate::math::lane::{Lane, Mask, Num, One};
use crate::math::vec::{Vec2, Vec4};
use std::sync::Arc;

/// How a texture coordinate changes from one pixel to the next, in units of the texture (not texels):
/// the analytic derivatives along the picture's x (right) and y (down).
#[derive(Clone, Copy, Debug, Default)]
pub struct Footprint<N> {
    /// du/dx
    pub dudx: N,
    /// dv/dx
    pub dvdx: N,
    /// du/dy
    pub dudy: N,
    /// dv/dy
    pub dvdy: N,
}

impl<N: Num> Footprint<N> {
    /// The footprint of lane `k`.
    #[inline(always)]
    pub fn lane(&self, k: usize) -> Footprint<f32> {
        Footprint { dudx: self.dudx.lane(k), dvdx: self.dvdx.lane(k), dudy: self.dudy.lane(k), dvdy: self.dvdy.lane(k) }
    }
    /// In texels of a level of this size.
    #[inline(always)]
    pub(super) fn texels(&self, width: f32, height: f32) -> Self {
        Footprint {
            dudx: self.dudx * width,
            dvdx: self.dvdx * height,
            dudy: self.dudy * width,
            dvdy: self.dvdy * height,
        }
    }
}

/// One texel that a lookup read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tap {
    /// Width and height of its level in texels (the mip level where `level` says so).
    pub size: (u32, u32),
    /// Mip level, 0 the finest; `None` for a level of a ripmap that is no mip level.
    pub level: Option<u32>,
    /// Texels from the left.
    pub x: u32,
    /// Texels from the top.
    pub y: u32,
    /// How much it counts. All weights sum to 1, short of what fell on the border; bicubic ones may be negative.
    pub weight: f32,
    /// Its value, linear RGBA.
    pub value: [f32; 4],
}

/// A map made from an image: mip levels, a filter and wrapping.
#[derive(Clone, Debug)]
pub struct Map {
    /// The texels.
    pub pyramid: Arc<Pyramid>,
    /// How texels are combined.
    pub filter: Filter,
    /// Outside of 0 ..= 1, along u and v.
    pub wrap: [Wrap; 2],
}

impl Map {
    /// The value at `place` (u right, v down, 0 ..= 1 across the image), averaged over `footprint`.
    /// Colour is linear light with straight alpha. Lanes that are not `active` may hold anything finite.
    ///
    /// A lane's value depends on that lane alone and has the same bits at every SIMD level. NaN, infinite and
    /// huge coordinates read some texel of the map.
    #[inline(always)]
    pub fn at<L: Lane>(&self, l: L, place: Vec2<L::F>, footprint: Footprint<L::F>, active: L::M) -> Vec4<L::F> {
        if self.is_wide() {
            return self.wide::<L, Quiet, false>(l, place, footprint, active, &mut Quiet);
        }
        if self.filter == Filter::Bicubic && !self.wrap.contains(&Wrap::Border) {
            return self.bicubic(l, place);
        }
        let (mut q, mut out) = ([[0.0f32; 16]; 6], [[0.0f32; 16]; 4]);
        let f = footprint;
        for (q, v) in q.iter_mut().zip([place.x, place.y, f.dudx, f.dvdx, f.dudy, f.dvdy]) {
            v.store(q);
        }
        self.singles(&q, active.bits(), &mut out);
        Vec4::new(l.load(&out[0]), l.load(&out[1]), l.load(&out[2]), l.load(&out[3]))
    }

    /// Whether [`Map::both`] may ask this map and another one.
    pub fn is_twin_of(&self, other: &Map) -> bool {
        let alike = self.filter == other.filter && self.wrap == other.wrap;
        let formats = matches!(
            (self.pyramid.texels(), other.pyramid.texels()),
            (Texels::Rgba8(_) | Texels::Rgba16(_), Texels::Rgba8(_))
        );
        let simple = matches!(self.filter, Filter::Bilinear | Filter::MipNearest | Filter::Trilinear);
        alike && formats && simple && self.is_wide() && self.pyramid.mips() == other.pyramid.mips()
    }

    /// As [`Map::at`] of this map and of another [twin](Map::is_twin_of): what depends on the size alone is found
    /// once for both.
    #[inline(always)]
    pub fn both<L: Lane>(
        &self,
        other: &Map,
        l: L,
        place: Vec2<L::F>,
        footprint: Footprint<L::F>,
        active: L::M,
    ) -> [Vec4<L::F>; 2] {
        let lod = self.lod(l, footprint);
        let Texels::Rgba8(b) = other.pyramid.texels() else { return self.apart(other, l, place, footprint, active) };
        match self.pyramid.texels() {
            Texels::Rgba8(a) => l.enter(
                #[inline(always)]
                || self.trilinear_both::<L, u32>(l, a, b, place, lod, active),
            ),
            Texels::Rgba16(a) => l.enter(
                #[inline(always)]
                || self.trilinear_both::<L, [u32; 2]>(l, a, b, place, lod, active),
            ),
            Texels::F32(_) => self.apart(other, l, place, footprint, active),
        }
    }

    #[cold]
    fn apart<L: Lane>(
        &self,
        other: &Map,
        l: L,
        place: Vec2<L::F>,
        footprint: Footprint<L::F>,
        active: L::M,
    ) -> [Vec4<L::F>; 2] {
        [self.at(l, place, footprint, active), other.at(l, place, footprint, active)]
    }

    #[inline(always)]
    fn trilinear_both<L: Lane, S: Store>(
        &self,
        l: L,
        a: &[S],
        b: &[u32],
        place: Vec2<L::F>,
        lod: L::F,
        active: L::M,
    ) -> [Vec4<L::F>; 2] {
        let levels = Levels::new(l, self, place, lod, active);
        let mut found = [([l.f(0.0); 4], [l.f(0.0); 4]); 2];
        for k in 0..levels.count {
            let taps = Taps::new(l, levels.at[k], self.wrap, levels.place);
            found[k] = (taps.blend(l, a), taps.blend(l, b));
        }
        let [(a, b), (c, d)] = found;
        if levels.count == 1 {
            return [S::finish(a), u32::finish(b)];
        }
        [S::finish(fetch::mix4(levels.t, a, c)), u32::finish(fetch::mix4(levels.t, b, d))]
    }

    #[inline(always)]
    fn bicubic<L: Lane>(&self, l: L, place: Vec2<L::F>) -> Vec4<L::F> {
        let (s, wrap) = (self.pyramid.mips()[0], self.wrap);
        match self.pyramid.texels() {
            Texels::Rgba8(t) => l.enter(
                #[inline(always)]
                || u32::finish(area::bicubic(l, t, s, wrap, place)),
            ),
            Texels::Rgba16(t) => l.enter(
                #[inline(always)]
                || <[u32; 2]>::finish(area::bicubic(l, t, s, wrap, place)),
            ),
            Texels::F32(t) => l.enter(
                #[inline(always)]
                || <[f32; 4]>::finish(area::bicubic(l, t, s, wrap, place)),
            ),
        }
    }

    /// Lane by lane.
    #[inline(never)]
    fn singles(&self, q: &[[f32; 16]; 6], active: u32, out: &mut [[f32; 16]; 4]) {
        for k in (0..16).filter(|k| active >> k & 1 != 0) {
            let f = Footprint { dudx: q[2][k], dvdx: q[3][k], dudy: q[4][k], dvdy: q[5][k] };
            let v = self.single(Vec2::new(q[0][k], q[1][k]), f, &mut Quiet);
            (out[0][k], out[1][k], out[2][k], out[3][k]) = (v.x, v.y, v.z, v.w);
        }
    }

    /// As [`Map::at`] for one lane, and what was read: the weighted values of `taps` sum to the result, to
    /// within the rounding of the sum.
    pub fn at_traced(&self, place: Vec2, footprint: Footprint<f32>, taps: &mut Vec<Tap>) -> Vec4 {
        let mut ear = Ear { pyramid: &self.pyramid, taps };
        if self.is_wide() {
            self.wide::<One, Ear<'_>, false>(One, place, footprint, true, &mut ear)
        } else {
            self.single(place, footprint, &mut ear)
        }
    }

    /// The level of detail, log2 of the longer of the footprint's two sides in texels of the finest level
    /// (OpenGL's rule, row 42): 0 where a texel is as large as a pixel, negative where it is larger. Not
    /// clamped to the levels that there are. Error below 1e-4.
    #[inline(always)]
    pub fn level_of<L: Lane>(&self, _l: L, footprint: Footprint<L::F>) -> L::F {
        let s = self.pyramid.mips()[0];
        let f = footprint.texels(s.width as f32, s.height as f32);
        let x = f.dudx * f.dudx + f.dvdx * f.dvdx;
        let y = f.dudy * f.dudy + f.dvdy * f.dvdy;
        half_log2(x.max(y))
    }

    /// Whether lanes are filtered side by side; the rest goes lane by lane.
    #[inline(always)]
    pub(crate) fn is_wide(&self) -> bool {
        let border = self.wrap[0] == Wrap::Border || self.wrap[1] == Wrap::Border;
        let wide = matches!(
            self.filter,
            Filter::Bilinear | Filter::MipNearest | Filter::Trilinear | Filter::Anisotropic { .. }
        );
        wide && !border
    }

    /// The filters that go side by side: all are probes at some level of detail. With `BORDER` (one lane
    /// only) an axis may have one.
    #[inline(always)]
    pub(super) fn wide<L: Lane, H: Listen, const BORDER: bool>(
        &self,
        l: L,
        place: Vec2<L::F>,
        footprint: Footprint<L::F>,
        active: L::M,
        listen: &mut H,
    ) -> Vec4<L::F> {
        if let Filter::Anisotropic { max } = self.filter {
            return l.enter(
                #[inline(always)]
                || self.anisotropic::<L, H, BORDER>(l, place, footprint, max, active, listen),
            );
        }
        self.probe::<L, H, BORDER>(l, place, self.lod(l, footprint), l.f(1.0), active, listen)
    }

    /// The level that is asked: between two, or on one.
    #[inline(always)]
    fn lod<L: Lane>(&self, l: L, footprint: Footprint<L::F>) -> L::F {
        match self.filter {
            Filter::Bilinear => l.f(0.0),
            Filter::MipNearest => (self.level_of(l, footprint) + 0.5).floor(),
            _ => self.level_of(l, footprint),
        }
    }

    /// A trilinear lookup. Entered, not inlined: a material asks several maps, an anisotropic lookup probes
    /// often, and compiling this code once for each level and format takes long enough.
    #[inline(always)]
    fn probe<L: Lane, H: Listen, const BORDER: bool>(
        &self,
        l: L,
        place: Vec2<L::F>,
        lod: L::F,
        weight: L::F,
        active: L::M,
        listen: &mut H,
    ) -> Vec4<L::F> {
        match self.pyramid.texels() {
            Texels::Rgba8(t) => l.enter(
                #[inline(always)]
                || self.trilinear::<L, u32, H, BORDER>(l, t, place, lod, weight, active, listen),
            ),
            Texels::Rgba16(t) => l.enter(
                #[inline(always)]
                || self.trilinear::<L, [u32; 2], H, BORDER>(l, t, place, lod, weight, active, listen),
            ),
            Texels::F32(t) => l.enter(
                #[inline(always)]
                || self.trilinear::<L, [f32; 4], H, BORDER>(l, t, place, lod, weight, active, listen),
            ),
        }
    }

    /// Between the two levels around `lod` (row 44).
    #[inline(always)]
    fn trilinear<L: Lane, S: Store, H: Listen, const BORDER: bool>(
        &self,
        l: L,
        texels: &[S],
        place: Vec2<L::F>,
        lod: L::F,
        weight: L::F,
        active: L::M,
        listen: &mut H,
    ) -> Vec4<L::F> {
        let Levels { at, place, t, count } = Levels::new(l, self, place, lod, active);
        let share = [weight * (l.f(1.0) - t), weight * t];
        let mut found = [[l.f(0.0); 4]; 2];
        // A loop, so that the body is compiled once.
        for k in 0..count {
            found[k] = bilinear::<L, S, H, BORDER>(l, texels, at[k], self.wrap, place, share[k], listen);
        }
        S::finish(if count == 2 { fetch::mix4(t, found[0], found[1]) } else { found[0] })
    }

    /// The mean of up to `max` trilinear probes, evenly along the longer axis of the footprint's ellipse, at
    /// the level of its shorter axis (of the probes' distance, where `max` is too few). The ellipse is the
    /// image of a disk, so turning the pixel grid does not matter.
    #[inline(always)]
    fn anisotropic<L: Lane, H: Listen, const BORDER: bool>(
        &self,
        l: L,
        place: Vec2<L::F>,
        footprint: Footprint<L::F>,
        max: u32,
        active: L::M,
        listen: &mut H,
    ) -> Vec4<L::F> {
        let s = self.pyramid.mips()[0];
        let max = max.clamp(1, 64);
        let f = footprint.texels(s.width as f32, s.height as f32);
        // J J^T = [a b; b c]; its eigenvalues are the squared axes.
        let (a, c) = (f.dudx * f.dudx + f.dudy * f.dudy, f.dvdx * f.dvdx + f.dvdy * f.dvdy);
        let b = f.dudx * f.dvdx + f.dudy * f.dvdy;
        let d = (a - c) * 0.5;
        let r = (d * d + b * b).sqrt();
        let long2 = (a + c) * 0.5 + r;
        let area = (f.dudx * f.dvdy - f.dudy * f.dvdx).abs();
        // A hundredth more than a whole number of probes is rounding. NaN (0/0) makes one probe.
        let count = -(-(long2 / area - 0.01)).floor();
        let count = count.clamp(1.0, max as f32);
        let flat = d.lt(l.f(0.0));
        let axis = Vec2::new(b.or_else(flat, d + r), (r - d).or_else(flat, b)).normalize() * long2.sqrt();
        let lod = half_log2((long2 / (count * count)).max(area * area / long2));
        let mut sum = Vec4::splat(l.f(0.0));
        let share = count.recip();
        for k in 0..max {
            let on = l.f(k as f32).lt(count) & active;
            if !on.any() {
                break;
            }
            let t = (l.f(k as f32) + 0.5) / count - 0.5;
            let p = Vec2::new(place.x + axis.x * t / s.width as f32, place.y + axis.y * t / s.height as f32);
            let v = self.probe::<L, H, BORDER>(l, p, lod, share, on, listen);
            sum = Vec4::new(sum.x + v.x, sum.y + v.y, sum.z + v.z, sum.w + v.w).or_else(on, sum);
        }
        Vec4::new(sum.x / count, sum.y / count, sum.z / count, sum.w / count)
    }

    /// Any filter and wrap, for one lane.
    fn single<H: Listen>(&self, place: Vec2, footprint: Footprint<f32>, listen: &mut H) -> Vec4 {
        match self.pyramid.texels() {
            Texels::Rgba8(t) => area::look(self, t, place, footprint, listen),
            Texels::Rgba16(t) => area::look(self, t, place, footprint, listen),
            Texels::F32(t) => area::look(self, t, place, footprint, listen),
        }
    }
}

/// The levels around a level of detail.
struct Levels<L: Lane> {
    at: [At<L>; 2],
    /// Brought into the map.
    place: Vec2<L::F>,
    /// The share of the second.
    t: L::F,
    /// 1 when all lanes are on a level (magnified, mostly): that one alone, as every lane would find it with a
    /// fraction of 0.
    count: usize,
}

impl<L: Lane> Levels<L> {
    #[inline(always)]
    fn new(l: L, map: &Map, place: Vec2<L::F>, lod: L::F, active: L::M) -> Self {
        let mips = map.pyramid.mips();
        let place = Vec2::new(fold(map.wrap[0], place.x), fold(map.wrap[1], place.y));
        let lod = lod.clamp(0.0, (mips.len() - 1) as f32);
        let d = lod.floor();
        let t = lod - d;
        let both = (t.gt(l.f(0.0)) & active).any();
        Levels { at: two_levels(l, mips, d.to_int(), active), place, t, count: 1 + usize::from(both) }
    }
}

/// Writes down what is read.
struct Ear<'a> {
    pyramid: &'a Pyramid,
    taps: &'a mut Vec<Tap>,
}

impl Listen for Ear<'_> {
    const ON: bool = true;
    fn tap(&mut self, s: Shape, x: u32, y: u32, weight: f32) {
        if weight != 0.0 {
            let level = self.pyramid.mips().iter().position(|m| *m == s).map(|k| k as u32);
            let value = self.pyramid.texel_of(s, x, y);
            self.taps.push(Tap { size: (s.width, s.height), level, x, y, weight, value });
        }
    }
}
