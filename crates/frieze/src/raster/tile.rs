//! One tile: which triangle, at which depth, each sample sees.

use super::bin::{Bins, Entry};
use super::geometry::{Class, Draw, snap1};
use super::{TILE, Target, sample_positions};
use crate::math::lane::{Int, Lane, Mask, Num, three};

/// Pixels of a tile.
pub const PIXELS: usize = (TILE * TILE) as usize;
/// The id of a sample that sees nothing.
pub const NOTHING: u32 = u32::MAX;

/// Asked for every sample of a triangle of class [`Cut`](Class::Cut) that would be visible.
pub trait Cut<L: Lane> {
    /// The lanes of `mask` where the triangle is there. `px`, `py`: the samples' places in the picture.
    fn keep(&mut self, l: L, id: u32, px: L::F, py: L::F, mask: L::M) -> L::M;
}

/// For views without such triangles.
pub struct Uncut;

impl<L: Lane> Cut<L> for Uncut {
    #[inline(always)]
    fn keep(&mut self, _: L, _: u32, _: L::F, _: L::F, mask: L::M) -> L::M {
        mask
    }
}

/// A view and where in it we are.
#[derive(Clone, Copy, Debug)]
pub struct Place<'a> {
    /// The view.
    pub target: &'a Target,
    /// Its geometry.
    pub bins: &'a Bins,
    /// Its draws.
    pub draws: &'a [Draw<'a>],
    /// Row-major number of the tile.
    pub tile: u32,
}

impl Place<'_> {
    /// Where a triangle comes in the order of sources: draw, then source triangle.
    fn order(&self, id: u32) -> u64 {
        let r = &self.bins.records[(id >> 7) as usize];
        let draw = &self.draws[r.draw as usize];
        let m = &draw.mesh.meshlets[r.meshlet as usize];
        u64::from(draw.order) << 32 | u64::from(draw.mesh.source[m.triangles as usize + (id & 127) as usize])
    }
    /// Whether the triangle with id `a` comes before `b` in the order of sources.
    pub fn comes_before(&self, a: u32, b: u32) -> bool {
        b == NOTHING || self.order(a) < self.order(b)
    }
}

/// A triangle set up for a tile.
struct Setup {
    a: [i32; 3],
    b: [i32; 3],
    /// Edge values at the tile's corner pixel, per edge, in 1/256² pixel, before the sample's offset.
    c: [i64; 3],
    /// Pixels of the tile: x0, y0, x1, y1, inclusive.
    area: [i32; 4],
    /// Place and depth of the first corner.
    origin: [f32; 3],
    slope: [f32; 2],
    range: [f32; 2],
}

impl Setup {
    #[inline(always)]
    fn new(corners: [[f32; 3]; 3], origin: (i32, i32), size: (i32, i32), range: (i32, i32)) -> Option<Setup> {
        let x = [snap1(corners[0][0]), snap1(corners[1][0]), snap1(corners[2][0])];
        let y = [snap1(corners[0][1]), snap1(corners[1][1]), snap1(corners[2][1])];
        let doubled = i64::from(x[1] - x[0]) * i64::from(y[2] - y[0]) - i64::from(x[2] - x[0]) * i64::from(y[1] - y[0]);
        if doubled == 0 {
            return None;
        }
        let area = [
            (((x[0].min(x[1]).min(x[2]) - range.1 + 255) >> 8) - origin.0).max(0),
            (((y[0].min(y[1]).min(y[2]) - range.1 + 255) >> 8) - origin.1).max(0),
            (((x[0].max(x[1]).max(x[2]) - range.0) >> 8) - origin.0).min(size.0 - 1),
            (((y[0].max(y[1]).max(y[2]) - range.0) >> 8) - origin.1).min(size.1 - 1),
        ];
        if area[0] > area[2] || area[1] > area[3] {
            return None;
        }
        let order = if doubled > 0 { [0, 1, 2] } else { [0, 2, 1] };
        let (mut a, mut b, mut c) = ([0; 3], [0; 3], [0; 3]);
        for k in 0..3 {
            let (p, q) = (order[k], order[(k + 1) % 3]);
            a[k] = y[p] - y[q];
            b[k] = x[q] - x[p];
            // Top-left rule: a sample on a left edge (x grows inward) or a top edge (y grows inward) is in.
            let inclusive = a[k] > 0 || (a[k] == 0 && b[k] > 0);
            c[k] = i64::from(a[k]) * i64::from(256 * origin.0 - x[p])
                + i64::from(b[k]) * i64::from(256 * origin.1 - y[p])
                - i64::from(!inclusive);
        }
        let [p, q, r] = corners;
        let (dx1, dy1, dz1) = (q[0] - p[0], q[1] - p[1], q[2] - p[2]);
        let (dx2, dy2, dz2) = (r[0] - p[0], r[1] - p[1], r[2] - p[2]);
        let inverse = 1.0 / (dx1 * dy2 - dx2 * dy1);
        Some(Setup {
            a,
            b,
            c,
            area,
            origin: p,
            slope: [finite((dz1 * dy2 - dz2 * dy1) * inverse), finite((dx1 * dz2 - dx2 * dz1) * inverse)],
            range: [p[2].min(q[2]).min(r[2]), p[2].max(q[2]).max(r[2])],
        })
    }
}

#[inline(always)]
fn finite(v: f32) -> f32 {
    if v.is_finite() { v } else { 0.0 }
}

/// Calls `each(sample, first pixel, mask, depth, px, py)` for every run of covered samples of a triangle, in
/// one fixed order.
#[inline(always)]
fn scan<L: Lane>(
    l: L,
    s: &Setup,
    origin: (i32, i32),
    samples: &[[i32; 2]],
    mut each: impl FnMut(usize, usize, L::M, L::F, L::F, f32),
) {
    let ramp = l.ramp();
    let rise: [L::I; 3] = [ramp * s.a[0], ramp * s.a[1], ramp * s.a[2]];
    let [x0, y0, x1, y1] = s.area;
    let first = x0 & !(L::WIDTH as i32 - 1);
    for (number, offset) in samples.iter().enumerate() {
        // At pixel centres the low 8 bits of an edge value never change, so they may go: values of a tile
        // then fit 32 bits. What is out of reach for the whole tile is clamped.
        let corner: [i32; 3] = three(
            #[inline(always)]
            |k| {
                let c = s.c[k] + i64::from(s.a[k]) * i64::from(offset[0]) + i64::from(s.b[k]) * i64::from(offset[1]);
                (c >> 8).clamp(-(1 << 30), 1 << 30) as i32
            },
        );
        let (fx, fy) = (offset[0] as f32 / 256.0, offset[1] as f32 / 256.0);
        for y in y0..=y1 {
            let py = (origin.1 + y) as f32 + fy;
            let row = s.origin[2] + s.slope[1] * (py - s.origin[1]);
            let mut e: [i32; 3] = three(
                #[inline(always)]
                |k| corner[k] + s.b[k] * y + s.a[k] * first,
            );
            let mut x = first;
            while x <= x1 {
                let inside = (rise[0] + e[0]) | (rise[1] + e[1]) | (rise[2] + e[2]);
                let mask = inside.gt(l.i(-1));
                if mask.any() {
                    let px = (ramp + (origin.0 + x)).to_num() + fx;
                    let z = (px - s.origin[0]) * s.slope[0] + row;
                    let z = z.max(l.f(s.range[0])).min(l.f(s.range[1]));
                    each(number, (y * TILE as i32 + x) as usize, mask, z, px, py);
                }
                for k in 0..3 {
                    e[k] += s.a[k] * L::WIDTH as i32;
                }
                x += L::WIDTH as i32;
            }
        }
    }
}

/// Calls `each(setup, id, class)` for every triangle of a tile.
#[inline(always)]
fn triangles(place: &Place<'_>, wanted: impl Fn(Class) -> bool, mut each: impl FnMut(&Setup, u32, Class)) {
    let (ox, oy) = Bins::origin(place.target, place.tile);
    let origin = (ox as i32, oy as i32);
    let size = ((place.target.width - ox).min(TILE) as i32, (place.target.height - oy).min(TILE) as i32);
    let all = sample_positions(place.target.samples).iter().flatten();
    let range = all.fold((255, 0), |(lo, hi), &v| (lo.min(v), hi.max(v)));
    for &Entry { part, what, mask } in place.bins.tile(place.tile) {
        // A piece of a clipped triangle goes the same way as the triangles of a cluster: one loop for both keeps
        // what is inlined into it small.
        let piece = (mask == 0).then(|| &place.bins.parts[part as usize].pieces[what as usize]);
        let record = piece.map_or(what, |p| place.bins.base(part) + p.record);
        let r = &place.bins.records[record as usize];
        if !wanted(r.class) {
            continue;
        }
        let mesh = place.draws[r.draw as usize].mesh;
        let m = &mesh.meshlets[r.meshlet as usize];
        let vertices = &place.bins.parts[r.part as usize].vertices[r.vertices as usize..];
        let vertices = &vertices[..m.vertex_count as usize];
        let triangles = &mesh.triangles[m.triangles as usize..][..m.triangle_count as usize];
        let mut rest = piece.map_or(mask, |p| 1 << p.triangle);
        while rest != 0 {
            let t = rest.trailing_zeros();
            rest &= rest - 1;
            let corners = match piece {
                Some(piece) => piece.corners,
                None => {
                    let ids = triangles[t as usize];
                    three(
                        #[inline(always)]
                        |k| {
                            let v = vertices[usize::from(ids[k])];
                            [v[0], v[1], v[2]]
                        },
                    )
                }
            };
            if let Some(setup) = Setup::new(corners, origin, size, range) {
                each(&setup, record << 7 | t, r.class);
            }
        }
    }
}

/// Draws the solid and cut triangles of a tile. `depth` and `id` hold [`PIXELS`] per sample, sample after
/// sample, and were filled with 0 and [`NOTHING`] (or with what was drawn before). Nearest wins, then the
/// lower source order. With `IDS` false only depth is kept (shadow maps).
#[inline(always)]
pub fn solid<L: Lane, C: Cut<L>, const IDS: bool>(
    l: L,
    place: &Place<'_>,
    cut: &mut C,
    depth: &mut [f32],
    id: &mut [u32],
) {
    let samples = sample_positions(place.target.samples);
    let depth = &mut depth[..PIXELS * samples.len()];
    let id = if IDS { &mut id[..PIXELS * samples.len()] } else { id };
    let origin = Bins::origin(place.target, place.tile);
    let origin = (origin.0 as i32, origin.1 as i32);
    triangles(
        place,
        |class| matches!(class, Class::Solid | Class::Cut),
        #[inline(always)]
        |setup, new, class| {
            scan(
                l,
                setup,
                origin,
                samples,
                #[inline(always)]
                |sample, first, mask, z, px, py| {
                    let at = sample * PIXELS + first;
                    let depths = &mut depth[at..at + L::WIDTH];
                    let old = l.load(depths);
                    let mut pass = mask & z.gt(old);
                    if class == Class::Cut {
                        let see = mask & (z.gt(old) | z.eq(old));
                        if !see.any() {
                            return;
                        }
                        let kept = cut.keep(l, new, px, l.f(py), see);
                        pass = pass & kept;
                        if IDS {
                            ties(l, place, new, kept & z.eq(old) & z.gt(l.f(0.0)), &mut id[at..at + L::WIDTH]);
                        }
                    } else if IDS {
                        ties(l, place, new, mask & z.eq(old) & z.gt(l.f(0.0)), &mut id[at..at + L::WIDTH]);
                    }
                    if pass.any() {
                        z.or_else(pass, old).store(depths);
                        if IDS {
                            store_ids(l, pass, new, &mut id[at..at + L::WIDTH]);
                        }
                    }
                },
            );
        },
    );
}

#[inline(always)]
fn store_ids<L: Lane>(l: L, pass: L::M, new: u32, ids: &mut [u32]) {
    let ids: &mut [i32] = bytemuck::cast_slice_mut(ids);
    l.i(new as i32).or_else(pass, l.load_i(ids)).store(ids);
}

/// Samples at equal depth: the triangle that comes first in the sources keeps them.
#[inline(always)]
fn ties<L: Lane>(_: L, place: &Place<'_>, new: u32, tie: L::M, ids: &mut [u32]) {
    let mut bits = tie.bits();
    while bits != 0 {
        let k = bits.trailing_zeros() as usize;
        bits &= bits - 1;
        if place.comes_before(new, ids[k]) {
            ids[k] = new;
        }
    }
}

/// A sample of a layered triangle in front of everything solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fragment {
    /// `sample * PIXELS + pixel`.
    pub at: u32,
    /// Triangle.
    pub id: u32,
    /// Reversed depth.
    pub depth: f32,
}

/// Collects the layered fragments of a tile with `range.0 <= depth < range.1` in front of `solid`. Returns
/// false, with an incomplete list, when there are more than `limit`.
#[inline(always)]
pub fn layered<L: Lane>(
    l: L,
    place: &Place<'_>,
    solid: &[f32],
    range: (f32, f32),
    limit: usize,
    out: &mut Vec<Fragment>,
) -> bool {
    let samples = sample_positions(place.target.samples);
    let origin = Bins::origin(place.target, place.tile);
    let origin = (origin.0 as i32, origin.1 as i32);
    out.clear();
    triangles(
        place,
        |class| class == Class::Layered,
        #[inline(always)]
        |setup, id, _| {
            if out.len() > limit {
                return;
            }
            scan(
                l,
                setup,
                origin,
                samples,
                #[inline(always)]
                |sample, first, mask, z, _, _| {
                    let at = sample * PIXELS + first;
                    let old = l.load(&solid[at..at + L::WIDTH]);
                    // At equal depth the layer lies on the solid surface: it is seen.
                    let see = mask & z.ge(old) & z.gt(l.f(0.0)) & z.ge(l.f(range.0)) & z.lt(l.f(range.1));
                    let mut bits = see.bits();
                    while bits != 0 {
                        let k = bits.trailing_zeros();
                        bits &= bits - 1;
                        out.push(Fragment { at: at as u32 + k, id, depth: z.lane(k as usize) });
                    }
                },
            );
        },
    );
    out.len() <= limit
}
