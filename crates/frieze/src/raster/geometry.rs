//! Cull clusters, transform their vertices, drop triangles that no sample can see, and bin the rest.

use super::clip::{self, Clip};
use super::{GUARD, TILE, Target, sample_positions};
use crate::math::lane::{Int, Kernel, Lane, Mask, Num, three};
use crate::math::vec::{Mat4, Vec3};
use crate::mesh::meshlet::{Meshlets, TRIANGLES, VERTICES};

/// One cooked mesh placed in a view.
#[derive(Clone, Debug)]
pub struct Draw<'a> {
    /// The clusters.
    pub mesh: &'a Meshlets,
    /// Object to homogeneous picture coordinates.
    pub matrix: Mat4,
    /// Whether the object's transform mirrors: its front faces wind the other way.
    pub mirrored: bool,
    /// The eye in object space, or the direction of parallel rays (w = 0).
    pub eye: [f32; 4],
    /// Where the draw comes in the order of sources: decides ties of depth.
    pub order: u32,
    /// Per material slot (the last stands for those beyond).
    pub slots: Vec<Slot>,
}

/// How the triangles of a material slot are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot {
    /// Whether back faces are dropped.
    pub cull_back: bool,
    /// Whether they are drawn at all in this pass.
    pub class: Class,
    /// What shading calls it.
    pub look: u32,
}

/// What the samples of a triangle need.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// Depth and id.
    Solid,
    /// A coverage function is asked per sample.
    Cut,
    /// Composed over what is behind.
    Layered,
    /// Not drawn in this pass.
    Hidden,
}

/// A cluster that survived culling.
#[derive(Clone, Copy, Debug)]
pub struct Record {
    /// Which [`Draw`].
    pub draw: u32,
    /// Which cluster of it.
    pub meshlet: u32,
    /// Which [`Geometry`] holds its vertices (filled in by [`Bins`](super::Bins)).
    pub part: u32,
    /// Where its vertices begin there.
    pub vertices: u32,
    /// What shading calls its material.
    pub look: u32,
    /// See [`Class`].
    pub class: Class,
    /// Reversed depth of its nearest vertex; 1 where some cannot be projected.
    pub near: f32,
    /// Vertices are homogeneous `[x w, y w, z w, w]` instead of `[x, y, z, w]`: some of them cannot be projected.
    pub homogeneous: bool,
}

/// A piece of a clipped triangle.
#[derive(Clone, Copy, Debug)]
pub struct Piece {
    /// Record of this geometry.
    pub record: u32,
    /// Triangle of its cluster.
    pub triangle: u8,
    /// Projected corners: x, y in pixels, reversed depth, and a 1.
    pub corners: [[f32; 4]; 3],
}

/// Triangles of one record (or one piece) that may touch a tile.
#[derive(Clone, Copy, Debug)]
pub struct Bin {
    /// Row-major number of the tile.
    pub tile: u32,
    /// Record, or piece.
    pub what: u32,
    /// Triangles as bits; 0: `what` is a piece.
    pub mask: u128,
}

/// What comes of a run of clusters.
#[derive(Debug, Default)]
pub struct Geometry {
    /// The clusters that survived.
    pub records: Vec<Record>,
    /// Their vertices.
    pub vertices: Vec<[f32; 4]>,
    /// Pieces of clipped triangles.
    pub pieces: Vec<Piece>,
    /// What goes where.
    pub bins: Vec<Bin>,
    /// Vertices that were transformed.
    pub transformed: u64,
    /// Triangles of clusters that were not culled.
    pub examined: u64,
    /// Triangles that went into some bin.
    pub binned: u64,
}

impl Geometry {
    /// Forgets everything but keeps the memory.
    pub fn clear(&mut self) {
        self.records.clear();
        self.vertices.clear();
        self.pieces.clear();
        self.bins.clear();
        (self.transformed, self.examined, self.binned) = (0, 0, 0);
    }
}

/// Planes that a cluster is tested against, in object space: unit normals pointing inside.
struct Frustum {
    /// Outside of one of them: culled.
    cull: [[f32; 4]; 6],
    /// Inside all of them: nothing needs clipping.
    safe: [[f32; 4]; 6],
}

impl Frustum {
    fn new(m: &Mat4, width: u32, height: u32) -> Self {
        let row = |r: usize| m.row(r).array().map(f64::from);
        let (x, y, z, w) = (row(0), row(1), row(2), row(3));
        let plane = |a: f64, p: [f64; 4], b: f64, q: [f64; 4]| -> [f32; 4] {
            let v: [f64; 4] = core::array::from_fn(|k| a * p[k] + b * q[k]);
            let l = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
            // Parallel to nothing (an infinite far plane, or w of an orthographic view): always inside.
            if l > 0.0 { v.map(|c| (c / l) as f32) } else { [0.0, 0.0, 0.0, f32::MAX] }
        };
        let (width, height, g) = (f64::from(width), f64::from(height), f64::from(GUARD));
        Frustum {
            cull: [
                plane(1.0, x, 0.0, w),
                plane(-1.0, x, width, w),
                plane(1.0, y, 0.0, w),
                plane(-1.0, y, height, w),
                plane(-1.0, z, 1.0, w),
                plane(1.0, z, 0.0, w),
            ],
            safe: [
                plane(1.0, x, g, w),
                plane(-1.0, x, g, w),
                plane(1.0, y, g, w),
                plane(-1.0, y, g, w),
                plane(-1.0, z, 1.0, w),
                plane(0.0, z, 1.0, w),
            ],
        }
    }
    fn side(p: &[f32; 4], c: [f32; 3]) -> f32 {
        p[0] * c[0] + p[1] * c[1] + p[2] * c[2] + p[3]
    }
    /// How far rounding may move a plane or a point, as a share of the sizes at hand.
    fn slack(p: &[f32; 4], c: [f32; 3], radius: f32) -> f32 {
        radius * 1.0001 + 1e-5 * (c[0].abs() + c[1].abs() + c[2].abs() + p[3].abs().min(1e30))
    }
    fn is_outside(&self, c: [f32; 3], radius: f32) -> bool {
        self.cull.iter().any(|p| Self::side(p, c) < -Self::slack(p, c, radius))
    }
    fn is_safe(&self, c: [f32; 3], radius: f32) -> bool {
        self.safe.iter().all(|p| p[3] == f32::MAX || Self::side(p, c) > Self::slack(p, c, radius))
    }
}

/// Whether every triangle of a cluster shows its back.
fn faces_away(eye: [f32; 4], center: [f32; 3], radius: f32, axis: [f32; 3], spread: f32) -> bool {
    let (axis, e) = (Vec3::from(axis), Vec3::new(eye[0], eye[1], eye[2]));
    if spread > 1.0 {
        false
    } else if eye[3] == 0.0 {
        e.dot(axis) >= spread
    } else {
        // Meshoptimizer's bound: the cone widened by the sphere.
        let to = Vec3::from(center) - e;
        to.dot(axis) >= spread * to.length() + radius
    }
}

/// Runs clusters `range` of a draw through culling, transform, set-up and binning.
pub struct Process<'a> {
    /// The view.
    pub target: &'a Target,
    /// The draw.
    pub draw: &'a Draw<'a>,
    /// Its number.
    pub number: u32,
    /// Clusters of it.
    pub range: std::ops::Range<usize>,
    /// What comes of it.
    pub out: &'a mut Geometry,
}

impl Kernel for Process<'_> {
    type Out = ();
    #[inline(always)]
    fn run<L: Lane>(self, l: L) {
        let Process { target, draw, number, range, out } = self;
        let frustum = Frustum::new(&draw.matrix, target.width, target.height);
        let mut scratch = Scratch::default();
        for k in range {
            let m = &draw.mesh.meshlets[k];
            let slot = draw.slots[(m.slot as usize).min(draw.slots.len() - 1)];
            if slot.class == Class::Hidden
                || frustum.is_outside(m.center, m.radius)
                || (slot.cull_back && faces_away(draw.eye, m.center, m.radius, m.axis, m.spread))
            {
                continue;
            }
            let mut record = Record {
                draw: number,
                meshlet: k as u32,
                part: 0,
                vertices: out.vertices.len() as u32,
                look: slot.look,
                class: slot.class,
                near: 1.0,
                homogeneous: !frustum.is_safe(m.center, m.radius),
            };
            out.transformed += u64::from(m.vertex_count);
            out.examined += u64::from(m.triangle_count);
            let number = out.records.len() as u32;
            if record.homogeneous {
                homogeneous(draw, k, out);
                pieces(target, draw, slot, k, number, out);
                out.records.push(record);
            } else {
                record.near = project(l, draw, k, &mut scratch, out);
                if bin(l, target, draw, slot, k, number, &scratch, out) {
                    out.records.push(record);
                } else {
                    out.vertices.truncate(record.vertices as usize);
                }
            }
        }
    }
}

/// Snapped positions of a cluster.
struct Scratch {
    x: [i32; VERTICES],
    y: [i32; VERTICES],
}

impl Default for Scratch {
    fn default() -> Self {
        Scratch { x: [0; VERTICES], y: [0; VERTICES] }
    }
}

#[inline(always)]
fn project<L: Lane>(l: L, draw: &Draw<'_>, k: usize, scratch: &mut Scratch, out: &mut Geometry) -> f32 {
    let m = &draw.mesh.meshlets[k];
    let mut near = l.f(0.0);
    let count = m.vertex_count as usize;
    for v in (0..count).step_by(L::WIDTH) {
        let at = m.positions as usize + v;
        let p = Vec3::new(l.load(&draw.mesh.x[at..]), l.load(&draw.mesh.y[at..]), l.load(&draw.mesh.z[at..]));
        let h = draw.matrix.project(p);
        let r = h.w.recip();
        let (x, y, z) = (h.x * r, h.y * r, h.z * r);
        snap(x).store(&mut scratch.x[v..]);
        snap(y).store(&mut scratch.y[v..]);
        let mut rows = [[0.0f32; 16]; 4];
        x.store(&mut rows[0]);
        y.store(&mut rows[1]);
        z.store(&mut rows[2]);
        h.w.store(&mut rows[3]);
        let n = (count - v).min(L::WIDTH);
        out.vertices.extend((0..n).map(|k| [rows[0][k], rows[1][k], rows[2][k], rows[3][k]]));
        near = near.max(z);
    }
    (0..L::WIDTH).map(|k| near.lane(k)).fold(0.0, Num::max)
}

/// To 1/256 pixel, halves up.
#[inline(always)]
pub fn snap<N: Num>(v: N) -> N::Int {
    (v * 256.0 + 0.5).floor().to_int()
}

/// Fixed point of a pixel coordinate within the guard band.
#[inline(always)]
pub fn snap1(v: f32) -> i32 {
    (v * 256.0 + 0.5).floor() as i32
}

/// Smallest and largest sample offset along an axis.
fn sample_range(target: &Target) -> (i32, i32) {
    let all = sample_positions(target.samples).iter().flatten();
    all.fold((255, 0), |(lo, hi), &v| (lo.min(v), hi.max(v)))
}

/// Tests the triangles of a cluster side by side and bins those that may cover a sample.
#[inline(always)]
fn bin<L: Lane>(
    l: L,
    target: &Target,
    draw: &Draw<'_>,
    slot: Slot,
    k: usize,
    record: u32,
    scratch: &Scratch,
    out: &mut Geometry,
) -> bool {
    let m = &draw.mesh.meshlets[k];
    let first = m.triangles as usize;
    let count = m.triangle_count as usize;
    let triangles = &draw.mesh.triangles[first..first + count];
    let (lo, hi) = sample_range(target);
    let mut boxes = [[0i32; TRIANGLES]; 4];
    let mut keep = 0u128;
    // Pixels of all triangles that are kept.
    let (mut min, mut max) = ([l.i(i32::MAX); 2], [l.i(i32::MIN); 2]);
    for t in (0..count).step_by(L::WIDTH) {
        let x = three(
            #[inline(always)]
            |c| corner(l, triangles, t, c, &scratch.x),
        );
        let y = three(
            #[inline(always)]
            |c| corner(l, triangles, t, c, &scratch.y),
        );
        let (dx1, dy1) = ((x[1] - x[0]).to_num(), (y[1] - y[0]).to_num());
        let (dx2, dy2) = ((x[2] - x[0]).to_num(), (y[2] - y[0]).to_num());
        // Differences are below 2^24, so exact; each product is rounded once. What is not certainly zero or
        // turned away is kept: the tile decides in integers.
        let (p, q) = (dx1 * dy2, dx2 * dy1);
        let area = p - q;
        let doubt = (p.abs() + q.abs()) * 2.4e-7;
        // y runs down: counter-clockwise fronts have negative areas.
        let front = if draw.mirrored { area } else { -area };
        let mut ok = if slot.cull_back { front.ge(-doubt) } else { doubt.ge(l.f(0.0)) };
        // Zero for certain: both products exact (below 2^24) and equal.
        let exact = p.abs().max(q.abs()).lt(l.f(16_777_216.0));
        ok = ok & !(area.eq(l.f(0.0)) & exact);
        if slot.cull_back {
            ok = ok & !(front.lt(l.f(0.0)) & exact);
        }
        let x0 = ((x[0].min(x[1]).min(x[2]) - hi + 255) >> 8).max(l.i(0));
        let y0 = ((y[0].min(y[1]).min(y[2]) - hi + 255) >> 8).max(l.i(0));
        let x1 = ((x[0].max(x[1]).max(x[2]) - lo) >> 8).min(l.i(target.width as i32 - 1));
        let y1 = ((y[0].max(y[1]).max(y[2]) - lo) >> 8).min(l.i(target.height as i32 - 1));
        ok = ok & !(x0.gt(x1) | y0.gt(y1));
        let bits = ok.bits() & ((1u64 << (count - t).min(L::WIDTH)) - 1) as u32;
        if bits == 0 {
            continue;
        }
        keep |= u128::from(bits) << t;
        let ok = l.mask(bits);
        min = [min[0].min(x0.or_else(ok, min[0])), min[1].min(y0.or_else(ok, min[1]))];
        max = [max[0].max(x1.or_else(ok, max[0])), max[1].max(y1.or_else(ok, max[1]))];
        x0.store(&mut boxes[0][t..]);
        y0.store(&mut boxes[1][t..]);
        x1.store(&mut boxes[2][t..]);
        y1.store(&mut boxes[3][t..]);
    }
    if keep == 0 {
        return false;
    }
    out.binned += u64::from(keep.count_ones());
    let least = |v: L::I| (0..L::WIDTH).map(|k| v.lane(k)).fold(i32::MAX, i32::min) as u32 / TILE;
    let most = |v: L::I| (0..L::WIDTH).map(|k| v.lane(k)).fold(i32::MIN, i32::max) as u32 / TILE;
    let (tx0, ty0, tx1, ty1) = (least(min[0]), least(min[1]), most(max[0]), most(max[1]));
    let across = target.tiles().0;
    if tx0 == tx1 && ty0 == ty1 {
        out.bins.push(Bin { tile: ty0 * across + tx0, what: record, mask: keep });
        return true;
    }
    let (w, h) = ((tx1 - tx0 + 1) as usize, (ty1 - ty0 + 1) as usize);
    let mut small = [0u128; 64];
    let mut large = Vec::new();
    let masks: &mut [u128] = if w * h <= 64 {
        &mut small[..w * h]
    } else {
        large.resize(w * h, 0u128);
        &mut large
    };
    let mut rest = keep;
    while rest != 0 {
        let t = rest.trailing_zeros() as usize;
        rest &= rest - 1;
        let tile = |v: i32, first: u32| (v as u32 / TILE - first) as usize;
        for y in tile(boxes[1][t], ty0)..=tile(boxes[3][t], ty0) {
            for x in tile(boxes[0][t], tx0)..=tile(boxes[2][t], tx0) {
                masks[y * w + x] |= 1 << t;
            }
        }
    }
    for (k, &mask) in masks.iter().enumerate() {
        if mask != 0 {
            let tile = (ty0 + (k / w) as u32) * across + tx0 + (k % w) as u32;
            out.bins.push(Bin { tile, what: record, mask });
        }
    }
    true
}

/// Coordinate of corner `c` of the triangles from `t` on; lanes beyond the last repeat it.
#[inline(always)]
fn corner<L: Lane>(l: L, triangles: &[[u8; 4]], t: usize, c: usize, from: &[i32; VERTICES]) -> L::I {
    let last = triangles.len() - 1;
    l.i_from(
        #[inline(always)]
        |k| from[(triangles[(t + k).min(last)][c] & 63) as usize],
    )
}

/// Vertices of a cluster that needs clipping, not divided by w.
fn homogeneous(draw: &Draw<'_>, k: usize, out: &mut Geometry) {
    let m = &draw.mesh.meshlets[k];
    for v in 0..m.vertex_count as usize {
        let at = m.positions as usize + v;
        let h = draw.matrix.project(Vec3::new(draw.mesh.x[at], draw.mesh.y[at], draw.mesh.z[at]));
        out.vertices.push(h.array());
    }
}

/// Clips the triangles of a cluster and bins the pieces.
fn pieces(target: &Target, draw: &Draw<'_>, slot: Slot, k: usize, record: u32, out: &mut Geometry) {
    let m = &draw.mesh.meshlets[k];
    let vertices = out.vertices.len() - m.vertex_count as usize;
    let across = target.tiles().0;
    let (lo, hi) = sample_range(target);
    let mut polygon: Vec<Clip> = Vec::new();
    for t in 0..m.triangle_count {
        let ids = draw.mesh.triangles[m.triangles as usize + usize::from(t)];
        let corner = |c: usize| out.vertices[vertices + usize::from(ids[c])].map(f64::from);
        let corners = [corner(0), corner(1), corner(2)];
        clip::clip(corners, &mut polygon);
        if polygon.len() < 3 {
            continue;
        }
        let projected: Vec<[f32; 3]> =
            polygon.iter().map(|p| [p[0] / p[3], p[1] / p[3], p[2] / p[3]].map(|v| v as f32)).collect();
        let mut any = false;
        for k in 2..projected.len() {
            let corners = [projected[0], projected[k - 1], projected[k]].map(|[x, y, z]| [x, y, z, 1.0]);
            let x = corners.map(|c| snap1(c[0]));
            let y = corners.map(|c| snap1(c[1]));
            let area =
                i64::from(x[1] - x[0]) * i64::from(y[2] - y[0]) - i64::from(x[2] - x[0]) * i64::from(y[1] - y[0]);
            let front = if draw.mirrored { area > 0 } else { area < 0 };
            if area == 0 || (slot.cull_back && !front) {
                continue;
            }
            let low = |v: [i32; 3]| ((v[0].min(v[1]).min(v[2]) - hi + 255) >> 8).max(0);
            let high = |v: [i32; 3], size: u32| ((v[0].max(v[1]).max(v[2]) - lo) >> 8).min(size as i32 - 1);
            let (x0, x1, y0, y1) = (low(x), high(x, target.width), low(y), high(y, target.height));
            if x0 > x1 || y0 > y1 {
                continue;
            }
            any = true;
            let piece = out.pieces.len() as u32;
            out.pieces.push(Piece { record, triangle: t, corners });
            for ty in y0 as u32 / TILE..=y1 as u32 / TILE {
                for tx in x0 as u32 / TILE..=x1 as u32 / TILE {
                    out.bins.push(Bin { tile: ty * across + tx, what: piece, mask: 0 });
                }
            }
        }
        out.binned += u64::from(any);
    }
}
