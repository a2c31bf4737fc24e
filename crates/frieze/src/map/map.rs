//! The question that all maps answer: `at(place, footprint)`.

use super::area;
use super::fetch::{self, At, Listen, Quiet, Raw, Store, bilinear, fold, half_log2, two_levels};
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
        // Entered, not inlined: a material asks several maps, and each lookup is a few hundred instructions.
        if self.is_wide() {
            match self.pyramid.texels() {
                Texels::Rgba8(t) => l.enter(
                    #[inline(always)]
                    || self.wide(l, t, place, footprint, active, &mut Quiet),
                ),
                Texels::Rgba16(t) => l.enter(
                    #[inline(always)]
                    || self.wide(l, t, place, footprint, active, &mut Quiet),
                ),
                Texels::F32(t) => l.enter(
                    #[inline(always)]
                    || self.wide(l, t, place, footprint, active, &mut Quiet),
                ),
            }
        } else {
            l.enter(
                #[inline(always)]
                || {
                    let mut out = [[0.0f32; 16]; 4];
                    let bits = active.bits();
                    for k in 0..L::WIDTH {
                        if bits >> k & 1 != 0 {
                            let v = self.single(fetch::lane2(place, k), footprint.lane(k), &mut Quiet);
                            for (out, v) in out.iter_mut().zip(v.array()) {
                                out[k] = v;
                            }
                        }
                    }
                    Vec4::from(out.map(|v| l.load(&v)))
                },
            )
        }
    }

    /// As [`Map::at`] for one lane, and what was read: the weighted values of `taps` sum to the result, to
    /// within the rounding of the sum.
    pub fn at_traced(&self, place: Vec2, footprint: Footprint<f32>, taps: &mut Vec<Tap>) -> Vec4 {
        let mut ear = Ear { pyramid: &self.pyramid, taps };
        if self.is_wide() {
            match self.pyramid.texels() {
                Texels::Rgba8(t) => self.wide(One, t, place, footprint, true, &mut ear),
                Texels::Rgba16(t) => self.wide(One, t, place, footprint, true, &mut ear),
                Texels::F32(t) => self.wide(One, t, place, footprint, true, &mut ear),
            }
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
    fn is_wide(&self) -> bool {
        let border = self.wrap[0] == Wrap::Border || self.wrap[1] == Wrap::Border;
        let rare =
            matches!(self.filter, Filter::Bicubic | Filter::Ripmap | Filter::Ewa { .. } | Filter::Supersample { .. });
        !border && !rare
    }

    #[inline(always)]
    fn wide<L: Lane, S: Store, H: Listen>(
        &self,
        l: L,
        texels: &[S],
        place: Vec2<L::F>,
        footprint: Footprint<L::F>,
        active: L::M,
        listen: &mut H,
    ) -> Vec4<L::F> {
        let mips = self.pyramid.mips();
        let one = l.f(1.0);
        let place = Vec2::new(fold(self.wrap[0], place.x), fold(self.wrap[1], place.y));
        S::finish(match self.filter {
            Filter::Nearest => {
                // The texel under the place; its neighbours are fetched along and not used.
                let s = mips[0];
                let x = (place.x * s.width as f32).floor().min(l.f((s.width - 1) as f32));
                let y = (place.y * s.height as f32).floor().min(l.f((s.height - 1) as f32));
                let center = Vec2::new((x + 0.5) / s.width as f32, (y + 0.5) / s.height as f32);
                let _ = center;
                let i = y.to_int() * (s.pitch as i32) + x.to_int() + (s.offset as i32);
                if H::ON {
                    listen.tap(s, x.lane(0) as u32, y.lane(0) as u32, 1.0);
                }
                S::four(l, texels, i, i)[0]
            }
            Filter::Bilinear => bilinear(l, texels, At::uniform(l, mips[0]), self.wrap, place, one, listen),
            Filter::MipNearest => {
                let last = (mips.len() - 1) as f32;
                let d = (self.level_of(l, footprint) + 0.5).floor().clamp(0.0, last);
                let [at, _] = two_levels(l, mips, d.to_int(), active);
                bilinear(l, texels, at, self.wrap, place, one, listen)
            }
            _ => self.trilinear(l, texels, place, self.level_of(l, footprint), one, active, listen),
        })
    }

    /// Between the two levels around `lod` (row 44). `place` is folded.
    #[inline(always)]
    fn trilinear<L: Lane, S: Store, H: Listen>(
        &self,
        l: L,
        texels: &[S],
        place: Vec2<L::F>,
        lod: L::F,
        weight: L::F,
        active: L::M,
        listen: &mut H,
    ) -> Raw<L> {
        let mips = self.pyramid.mips();
        let lod = lod.clamp(0.0, (mips.len() - 1) as f32);
        if (lod.le(l.f(0.0)) | !active).all() {
            // Magnified: the finest level alone, as every lane would find it with a fraction of 0.
            return bilinear(l, texels, At::uniform(l, mips[0]), self.wrap, place, weight, listen);
        }
        let d = lod.floor();
        let t = lod - d;
        let [fine, coarse] = two_levels(l, mips, d.to_int(), active);
        let a = bilinear(l, texels, fine, self.wrap, place, weight * (l.f(1.0) - t), listen);
        let b = bilinear(l, texels, coarse, self.wrap, place, weight * t, listen);
        fetch::mix4(t, a, b)
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
