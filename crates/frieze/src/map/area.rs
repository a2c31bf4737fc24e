//! The rare filters, one lane at a time: bicubic, ripmap, EWA, supersampling, and everything with a border.

use super::fetch::{self, At, Listen, Raw, Store, bilinear, fold, half_log2, texel};
use super::filter::{Filter, Wrap};
use super::map::{Footprint, Map};
use crate::image::pyramid::Shape;
use crate::math::exact;
use crate::math::lane::{Lane, Num, One};
use crate::math::vec::{Vec2, Vec4};

/// A texture asked by one lane.
struct Asked<'a, S> {
    map: &'a Map,
    texels: &'a [S],
    border: bool,
}

/// Any filter and wrap.
pub(super) fn look<S: Store, H: Listen>(m: &Map, texels: &[S], place: Vec2, f: Footprint<f32>, listen: &mut H) -> Vec4 {
    let border = m.wrap[0] == Wrap::Border || m.wrap[1] == Wrap::Border;
    let a = Asked { map: m, texels, border };
    let s = m.pyramid.mips()[0];
    let f_texels = f.texels(s.width as f32, s.height as f32);
    match m.filter {
        Filter::Bicubic => S::finish(a.bicubic(place, listen)),
        Filter::Ripmap if !m.pyramid.rips().is_empty() => S::finish(a.ripmap(place, f_texels, listen)),
        Filter::Ewa { radius } => S::finish(a.ewa(place, f, radius, listen)),
        Filter::Supersample { taps } => S::finish(a.supersample(place, f, taps, listen)),
        Filter::Nearest => S::finish(a.nearest(place, listen)),
        _ if border => m.wide::<One, H, true>(One, place, f, true, listen),
        _ => m.wide::<One, H, false>(One, place, f, true, listen),
    }
}

/// Catmull-Rom's weights of the texels at -1, 0, 1 and 2 for a place `t` between 0 and 1. They sum to 1.
#[inline(always)]
pub(super) fn catmull_rom<N: Num>(t: N) -> [N; 4] {
    let two = t.lift(2.0);
    [
        ((two - t) * t - 1.0) * t * 0.5,
        ((t * 3.0 - 5.0) * t * t + 2.0) * 0.5,
        ((t.lift(4.0) - t * 3.0) * t + 1.0) * t * 0.5,
        (t - 1.0) * t * t * 0.5,
    ]
}

/// The whole number `i` of `-2 ..= n + 1` under a wrap without border: [`fetch::wrapped`] for many lanes.
#[inline(always)]
fn wrapped<N: Num>(wrap: Wrap, i: N, n: N) -> N {
    match wrap {
        Wrap::Repeat => i - (i / n).floor() * n,
        Wrap::Mirror => {
            let period = n * 2.0;
            let k = i - (i / period).floor() * period;
            k.min(period - 1.0 - k)
        }
        Wrap::Clamp | Wrap::Border => i.max(n.lift(0.0)).min(n - 1.0),
    }
}

/// Row 40 for many lanes: the operations of [`Asked::bicubic`] in their order.
#[inline(always)]
pub(super) fn bicubic<L: Lane, S: Store>(l: L, texels: &[S], s: Shape, wrap: [Wrap; 2], place: Vec2<L::F>) -> Raw<L> {
    let (width, height) = (l.f(s.width as f32), l.f(s.height as f32));
    let x = fold(wrap[0], place.x) * width - 0.5;
    let y = fold(wrap[1], place.y) * height - 0.5;
    let (x0, y0) = (x.floor(), y.floor());
    let (wx, wy) = (catmull_rom(x - x0), catmull_rom(y - y0));
    let mut columns = [l.i(0); 4];
    for (i, column) in columns.iter_mut().enumerate() {
        *column = wrapped(wrap[0], x0 + (i as f32 - 1.0), width).to_int();
    }
    let mut sum = [l.f(0.0); 4];
    for (j, wy) in wy.into_iter().enumerate() {
        let row = wrapped(wrap[1], y0 + (j as f32 - 1.0), height).to_int() * s.pitch as i32 + s.offset as i32;
        // Columns may lie apart; each comes with a neighbour that nobody asked for.
        let [a, _, b, _] = S::four(l, texels, row + columns[0], row + columns[1]);
        let [c, _, d, _] = S::four(l, texels, row + columns[2], row + columns[3]);
        for k in 0..4 {
            let line = l.f(0.0) + a[k] * wx[0] + b[k] * wx[1] + c[k] * wx[2] + d[k] * wx[3];
            sum[k] = sum[k] + line * wy;
        }
    }
    sum
}

impl<S: Store> Asked<'_, S> {
    fn bilinear<H: Listen>(&self, s: Shape, place: Vec2, weight: f32, listen: &mut H) -> [f32; 4] {
        let (wrap, at) = (self.map.wrap, At::uniform(One, s));
        let p = Vec2::new(fold(wrap[0], place.x), fold(wrap[1], place.y));
        if self.border {
            bilinear::<One, S, H, true>(One, self.texels, at, wrap, p, weight, listen)
        } else {
            bilinear::<One, S, H, false>(One, self.texels, at, wrap, p, weight, listen)
        }
    }

    /// The texel `floor(u n)` of the finest level (row 38).
    fn nearest<H: Listen>(&self, place: Vec2, listen: &mut H) -> [f32; 4] {
        let (s, wrap) = (self.map.pyramid.mips()[0], self.map.wrap);
        let index = |wrap, u: f32, n: u32| match ((fold(wrap, u) * n as f32).floor() as i64, wrap) {
            (i, Wrap::Border) => i,
            (i, _) => i.min(i64::from(n) - 1), // a folded 1 is still the last texel
        };
        let (x, y) = (index(wrap[0], place.x, s.width), index(wrap[1], place.y, s.height));
        texel(self.texels, s, wrap, x, y, 1.0, listen)
    }

    /// Row 40: sixteen texels, Catmull-Rom, first along u, then along v.
    fn bicubic<H: Listen>(&self, place: Vec2, listen: &mut H) -> [f32; 4] {
        let (s, wrap) = (self.map.pyramid.mips()[0], self.map.wrap);
        let x = fold(wrap[0], place.x) * s.width as f32 - 0.5;
        let y = fold(wrap[1], place.y) * s.height as f32 - 0.5;
        let (wx, wy) = (catmull_rom(x - x.floor()), catmull_rom(y - y.floor()));
        let (x, y) = (x.floor() as i64 - 1, y.floor() as i64 - 1);
        let mut sum = [0.0; 4];
        for (j, wy) in wy.into_iter().enumerate() {
            let mut row = [0.0; 4];
            for (i, wx) in wx.into_iter().enumerate() {
                let v = texel(self.texels, s, wrap, x + i as i64, y + j as i64, wx * wy, listen);
                for c in 0..4 {
                    row[c] += v[c] * wx;
                }
            }
            for c in 0..4 {
                sum[c] += row[c] * wy;
            }
        }
        sum
    }

    /// Row 45: bilinear in the four levels around (level along u, level along v). Each level of detail is that
    /// of the footprint's extent along its axis, the root of the sum of squares: skew footprints blur.
    fn ripmap<H: Listen>(&self, place: Vec2, f: Footprint<f32>, listen: &mut H) -> [f32; 4] {
        let (across, down) = self.map.pyramid.rip_size();
        let clamp = |v: f32, n: u32| v.max(0.0).min((n - 1) as f32);
        let i = clamp(half_log2(f.dudx * f.dudx + f.dudy * f.dudy), across);
        let j = clamp(half_log2(f.dvdx * f.dvdx + f.dvdy * f.dvdy), down);
        let (s, t) = (i - i.floor(), j - j.floor());
        let (i0, j0) = (i as u32, j as u32);
        let mut get = |di: u32, dj: u32, w: f32| {
            let (i, j) = ((i0 + di).min(across - 1), (j0 + dj).min(down - 1));
            self.bilinear(self.map.pyramid.rips()[(j * across + i) as usize], place, w, listen)
        };
        let (a, b) = (get(0, 0, (1.0 - s) * (1.0 - t)), get(1, 0, s * (1.0 - t)));
        let (c, d) = (get(0, 1, (1.0 - s) * t), get(1, 1, s * t));
        fetch::mix4(t, fetch::mix4(s, a, b), fetch::mix4(s, c, d))
    }

    /// Row 47: the mean of bilinear lookups in the finest level, on a regular grid of n x n points over the
    /// footprint's parallelogram, n^2 the first square not below `taps`. For growing n it converges to the
    /// area average of the bilinearly reconstructed texture, which is what the other filters are measured by.
    fn supersample<H: Listen>(&self, place: Vec2, f: Footprint<f32>, taps: u32, listen: &mut H) -> [f32; 4] {
        let n = (1..256).find(|n| n * n >= taps).unwrap_or(256);
        let s = self.map.pyramid.mips()[0];
        let weight = 1.0 / (n * n) as f32;
        let mut sum = [0.0f64; 4];
        for j in 0..n {
            let y = (j as f32 + 0.5) / n as f32 - 0.5;
            for i in 0..n {
                let x = (i as f32 + 0.5) / n as f32 - 0.5;
                let p = Vec2::new(place.x + f.dudx * x + f.dudy * y, place.y + f.dvdx * x + f.dvdy * y);
                let v = self.bilinear(s, p, weight, listen);
                for c in 0..4 {
                    sum[c] += f64::from(v[c]);
                }
            }
        }
        sum.map(|v| (v / f64::from(n * n)) as f32)
    }

    /// Row 46, after Heckbert 1989: texels under an ellipse, weighted by a squared Gaussian
    /// (boxier than a Gaussian). Its covariance is that of
    /// a pixel (a disk of `radius` has r^2/4 along each axis: 1/12, as a box pixel, by default), plus that of
    /// bilinear reconstruction, less that of the box by which the level's texels were already averaged. The
    /// level is the coarsest where the ellipse's shorter axis still spans three texels.
    fn ewa<H: Listen>(&self, place: Vec2, f: Footprint<f32>, radius: f32, listen: &mut H) -> [f32; 4] {
        const CUT: f32 = 3.0; // standard deviations
        const MOST: f32 = 64.0; // longer axis to shorter; the shorter one is widened beyond
        let mips = self.map.pyramid.mips();
        let last = mips.len() - 1;
        let scale = if radius.is_finite() { radius.abs().min(64.0) / Filter::EWA_RADIUS } else { 1.0 };
        let lengths = |s: Shape| {
            let f = f.texels(s.width as f32 * scale, s.height as f32 * scale);
            let (a, b, c) = (
                f.dudx * f.dudx + f.dudy * f.dudy,
                f.dudx * f.dvdx + f.dudy * f.dvdy,
                f.dvdx * f.dvdx + f.dvdy * f.dvdy,
            );
            let det = f.dudx * f.dvdy - f.dudy * f.dvdx;
            let major2 = (a + c) * 0.5 + ((a - c) * (a - c) * 0.25 + b * b).sqrt();
            (a, b, c, major2, if major2 > 0.0 { det * det / major2 } else { 0.0 })
        };
        let (_, _, _, major2, minor2) = lengths(mips[0]);
        let coarse = lengths(mips[last]).3;
        if !(major2 <= 1e24 && minor2 <= 1e24 && coarse <= 4096.0) {
            // So far away (or not a number) that only the mean is left.
            return self.bilinear(mips[last], place, 1.0, listen);
        }
        let wide2 = minor2.max(major2 / (MOST * MOST));
        let level = (half_log2(wide2 / 9.0).floor().max(0.0) as usize).min(last);
        let s = mips[level];
        let (a, b, c, major2, minor2) = lengths(s);
        let own = 1.0 / (1u64 << (2 * level.min(30))) as f32; // 4^-level
        let more = 0.25 * own - 1.0 / 12.0 + (major2 / (MOST * MOST) - minor2).max(0.0) / 12.0;
        let (a, b, c) = (a / 12.0 + more, b / 12.0, c / 12.0 + more);
        let det = (a * c - b * b).max(1e-6);
        // q(x, y) = (c x^2 - 2 b x y + a y^2) / det, the squared distance in standard deviations.
        let (qa, qb, qc) = (c / det, -2.0 * b / det, a / det);
        let wrap = self.map.wrap;
        let x0 = fold(wrap[0], place.x) * s.width as f32 - 0.5;
        let y0 = fold(wrap[1], place.y) * s.height as f32 - 0.5;
        // exp(-(q/q0)^2), whose second moment is that of the Gaussian exp(-q/2): nearer to a box, in error on
        // checkers as much as in shape. q0 = 2 sqrt(pi).
        let weigh = |q: f32| exact::exp(-(q / 3.544_907_7) * (q / 3.544_907_7));
        let reach = CUT * c.sqrt();
        let visit = |put: &mut dyn FnMut(i64, i64, f32)| {
            for y in (y0 - reach).ceil() as i64..=(y0 + reach).floor() as i64 {
                let dy = y as f32 - y0;
                // Along the row, q <= CUT^2 between two roots.
                let (half, rest) = (-0.5 * qb * dy / qa, qc * dy * dy - CUT * CUT);
                let width = (half * half - rest / qa).max(0.0).sqrt();
                for x in (x0 + half - width).ceil() as i64..=(x0 + half + width).floor() as i64 {
                    let dx = x as f32 - x0;
                    put(x, y, weigh((qa * dx + qb * dy) * dx + qc * dy * dy));
                }
            }
        };
        let mut total = 0.0f64;
        visit(&mut |_, _, w| total += f64::from(w));
        if total.is_nan() || total <= 0.0 {
            return self.bilinear(s, place, 1.0, listen);
        }
        let mut sum = [0.0f64; 4];
        visit(&mut |x, y, w| {
            let v = texel(self.texels, s, wrap, x, y, (f64::from(w) / total) as f32, listen);
            for c in 0..4 {
                sum[c] += f64::from(v[c]) * f64::from(w);
            }
        });
        sum.map(|v| (v / total) as f32)
    }
}
