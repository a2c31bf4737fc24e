//! One tile: which triangle, at which depth, each sample sees.

use super::bin::{Bins, Entry};
use super::geometry::{Class, Draw, Piece, snap, snap1};
use super::{TILE, Target, sample_positions};
use crate::math::lane::{Int, Lane, Mask, Num, three};

/// Pixels of a tile.
pub const PIXELS: usize = (TILE * TILE) as usize;
/// The id of a sample that sees nothing.
pub const NOTHING: u32 = u32::MAX;

/// Asked for samples of triangles of class [`Cut`](Class::Cut) that would be visible.
pub trait Cut<L: Lane> {
    /// Whether there may be such triangles.
    const ANY: bool = true;
    /// The lanes of `mask` where triangle `ids[k]` is there; all are of one draw and one look. `px`, `py`: the
    /// samples' places in the picture.
    fn keep(&mut self, l: L, ids: &[u32], px: L::F, py: L::F, mask: L::M) -> L::M;
}

/// For views without such triangles.
pub struct Uncut;

impl<L: Lane> Cut<L> for Uncut {
    const ANY: bool = false;
    #[inline(always)]
    fn keep(&mut self, _: L, _: &[u32], _: L::F, _: L::F, mask: L::M) -> L::M {
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

/// Pixels along each side of a block. A tile's samples are stored block by block, row by row of blocks: what lies
/// side by side in a vector then lies close in the picture, and small triangles touch few blocks.
pub const BLOCK: u32 = 4;

/// Where the pixel in column `x` and row `y` of a tile is stored.
#[inline(always)]
pub fn index(x: u32, y: u32) -> usize {
    ((y / BLOCK * (TILE / BLOCK) + x / BLOCK) * BLOCK * BLOCK + y % BLOCK * BLOCK + x % BLOCK) as usize
}

/// Column and row in the tile of the pixel stored at `at`.
#[inline(always)]
pub fn pixel<I: Int>(at: I) -> (I, I) {
    (((at >> 4) & 15) * BLOCK as i32 + (at & 3), (at >> 8) * BLOCK as i32 + ((at >> 2) & 3))
}

/// Copies row `y` of a tile, 4 bytes a pixel, to a row of a picture, which may end sooner.
pub fn copy_row(from: &[u8], y: u32, to: &mut [u8]) {
    let from = &from.as_chunks::<16>().0[index(0, y) / 4..];
    let (fours, rest) = to.as_chunks_mut::<16>();
    for (to, from) in fours.iter_mut().zip(from.iter().step_by(4)) {
        *to = *from;
    }
    if !rest.is_empty() {
        rest.copy_from_slice(&from[4 * fours.len()][..rest.len()]);
    }
}

/// A triangle set up for a tile. Coverage is relative to the tile's upper left corner.
#[derive(Clone, Copy)]
struct Setup {
    a: [i32; 3],
    b: [i32; 3],
    /// Edge values at the tile's corner, per edge, in 1/256² pixel, before the sample's offset.
    c: [i64; 3],
    /// Pixels of the tile: x0, y0, x1, y1, inclusive.
    area: [i32; 4],
    /// Place in the picture and depth of the first corner.
    origin: [f32; 3],
    slope: [f32; 2],
    range: [f32; 2],
}

/// A tile, as set-up needs it.
#[derive(Clone, Copy)]
struct Frame {
    /// Upper left pixel.
    origin: (i32, i32),
    /// Pixels that are in the picture.
    size: (i32, i32),
    /// Smallest and largest offset of a sample in its pixel.
    range: (i32, i32),
}

impl Frame {
    fn new(place: &Place<'_>) -> Self {
        let (ox, oy) = Bins::origin(place.target, place.tile);
        let all = sample_positions(place.target.samples).iter().flatten();
        Frame {
            origin: (ox as i32, oy as i32),
            size: ((place.target.width - ox).min(TILE) as i32, (place.target.height - oy).min(TILE) as i32),
            range: all.fold((255, 0), |(lo, hi), &v| (lo.min(v), hi.max(v))),
        }
    }
}

impl Setup {
    /// Any triangle, in 64-bit integers.
    #[cold]
    fn new(corners: &[[f32; 3]; 3], f: &Frame) -> Option<Setup> {
        let (ox, oy) = (f.origin.0 << 8, f.origin.1 << 8);
        let x = [snap1(corners[0][0]) - ox, snap1(corners[1][0]) - ox, snap1(corners[2][0]) - ox];
        let y = [snap1(corners[0][1]) - oy, snap1(corners[1][1]) - oy, snap1(corners[2][1]) - oy];
        let doubled = i64::from(x[1] - x[0]) * i64::from(y[2] - y[0]) - i64::from(x[2] - x[0]) * i64::from(y[1] - y[0]);
        if doubled == 0 {
            return None;
        }
        let area = [
            ((x[0].min(x[1]).min(x[2]) - f.range.1 + 255) >> 8).max(0),
            ((y[0].min(y[1]).min(y[2]) - f.range.1 + 255) >> 8).max(0),
            ((x[0].max(x[1]).max(x[2]) - f.range.0) >> 8).min(f.size.0 - 1),
            ((y[0].max(y[1]).max(y[2]) - f.range.0) >> 8).min(f.size.1 - 1),
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
            c[k] = -(i64::from(a[k]) * i64::from(x[p]) + i64::from(b[k]) * i64::from(y[p]) + i64::from(!inclusive));
        }
        let [p, q, r] = *corners;
        let slope = slope([q[0] - p[0], q[1] - p[1], q[2] - p[2]], [r[0] - p[0], r[1] - p[1], r[2] - p[2]]);
        let range = [Num::min(Num::min(p[2], q[2]), r[2]), Num::max(Num::max(p[2], q[2]), r[2])];
        Some(Setup { a, b, c, area, origin: p, slope, range })
    }
}

/// Change of depth along x and y in the plane of two edges; 0 where it is not finite.
#[inline(always)]
fn slope<N: Num>(d1: [N; 3], d2: [N; 3]) -> [N; 2] {
    #[inline(always)]
    fn finite<N: Num>(v: N) -> N {
        v.or_else(v.abs().lt(v.lift(f32::INFINITY)), v.lift(0.0))
    }
    let inverse = (d1[0] * d2[1] - d2[0] * d1[1]).recip();
    [finite((d1[2] * d2[1] - d2[2] * d1[1]) * inverse), finite((d1[0] * d2[2] - d2[0] * d1[2]) * inverse)]
}

/// Most lanes of any level.
const MOST: usize = 16;

/// Where the corners of up to [`MOST`] triangles are found.
struct Corners<'a> {
    piece: Option<&'a Piece>,
    vertices: &'a [[f32; 4]],
    triangles: &'a [[u8; 4]],
    numbers: [u8; MOST],
}

impl Corners<'_> {
    /// x, y and depth of corner `c` of triangle `k`.
    #[inline(always)]
    fn get(&self, k: usize, c: usize) -> &[f32] {
        match self.piece {
            Some(piece) => &piece.corners[c],
            None => &self.vertices[usize::from(self.triangles[usize::from(self.numbers[k & (MOST - 1)])][c])],
        }
    }
}

/// Up to [`MOST`] triangles, set up side by side.
struct Setups {
    /// a, b, c of three edges, area, and what tiny ones cover.
    ints: [[i32; MOST]; 14],
    /// Origin, slope, range.
    nums: [[f32; MOST]; 7],
}

impl Setups {
    #[inline(always)]
    fn get(&self, k: usize) -> Setup {
        let (i, n) = (&self.ints, &self.nums);
        Setup {
            a: [i[0][k], i[1][k], i[2][k]],
            b: [i[3][k], i[4][k], i[5][k]],
            c: [i64::from(i[6][k]), i64::from(i[7][k]), i64::from(i[8][k])],
            area: [i[9][k], i[10][k], i[11][k], i[12][k]],
            origin: [n[0][k], n[1][k], n[2][k]],
            slope: [n[3][k], n[4][k]],
            range: [n[5][k], n[6][k]],
        }
    }

    /// Depth of triangle `k` at a sample in column `x` and row `y` of the tile, as [`scan`] finds it.
    #[inline(always)]
    fn depth(&self, k: usize, px: f32, py: f32) -> f32 {
        let n = &self.nums;
        let z = (px - n[0][k]) * n[3][k] + ((py - n[1][k]) * n[4][k] + n[2][k]);
        Num::min(Num::max(z, n[5][k]), n[6][k])
    }

    /// Sets up one triangle per lane. Returns the lanes that may cover a sample of the tile, those among others
    /// whose numbers need 64 bits ([`Setup::new`] takes them), and those among the first that are tiny: the
    /// samples that they cover, of the 2x2 from the corner of their area on, are known.
    #[inline(always)]
    fn fill<L: Lane>(&mut self, l: L, corners: &Corners<'_>, f: &Frame) -> (u32, u32, u32) {
        let [px, py, pz, _] = l.transpose4_from(
            #[inline(always)]
            |k| corners.get(k, 0),
        );
        let [qx, qy, qz, _] = l.transpose4_from(
            #[inline(always)]
            |k| corners.get(k, 1),
        );
        let [rx, ry, rz, _] = l.transpose4_from(
            #[inline(always)]
            |k| corners.get(k, 2),
        );
        let (ox, oy) = (f.origin.0 << 8, f.origin.1 << 8);
        let (x0, x1, x2) = (snap(px) - ox, snap(qx) - ox, snap(rx) - ox);
        let (y0, y1, y2) = (snap(py) - oy, snap(qy) - oy, snap(ry) - oy);
        let (left, right) = (x0.min(x1).min(x2), x0.max(x1).max(x2));
        let (top, bottom) = (y0.min(y1).min(y2), y0.max(y1).max(y2));
        let ax0 = ((left - f.range.1 + 255) >> 8).max(l.i(0));
        let ay0 = ((top - f.range.1 + 255) >> 8).max(l.i(0));
        let ax1 = ((right - f.range.0) >> 8).min(l.i(f.size.0 - 1));
        let ay1 = ((bottom - f.range.0) >> 8).min(l.i(f.size.1 - 1));
        let touches = !(ax0.gt(ax1) | ay0.gt(ay1));
        // Within 64 pixels of the tile's middle on both axes every product stays below 2^30.
        let middle = l.i(32 << 8);
        let reach = (right.max(bottom) - middle).max(middle - left.min(top));
        let large = touches & reach.gt(l.i(64 << 8));
        let doubled = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0);
        let seen = touches & !doubled.eq(l.i(0)) & !large;
        let turned = doubled.lt(l.i(0));
        let x = [x0, x2.or_else(turned, x1), x1.or_else(turned, x2)];
        let y = [y0, y2.or_else(turned, y1), y1.or_else(turned, y2)];
        let (zero, one) = (l.i(0), l.i(1));
        let mut least = [l.i(i32::MAX); 4];
        for k in 0..3 {
            let n = (k + 1) % 3;
            let (a, b) = (y[k] - y[n], x[n] - x[k]);
            // Top-left rule: see Setup::new.
            let inclusive = a.gt(zero) | (a.eq(zero) & b.gt(zero));
            let c = zero - (a * x[k] + b * y[k]) - zero.or_else(inclusive, one);
            a.store(&mut self.ints[k]);
            b.store(&mut self.ints[3 + k]);
            c.store(&mut self.ints[6 + k]);
            let e = c + a * ((ax0 << 8) + f.range.0) + b * ((ay0 << 8) + f.range.0);
            let (right, below) = (a << 8, b << 8);
            least[0] = least[0].min(e);
            least[1] = least[1].min(e + right);
            least[2] = least[2].min(e + below);
            least[3] = least[3].min(e + right + below);
        }
        // Edge values of samples that close are exact, whatever overflowed on the way.
        let tiny = seen & (ax1 - ax0).lt(l.i(2)) & (ay1 - ay0).lt(l.i(2));
        let (two, tall) = (ax1.gt(ax0), ay1.gt(ay0));
        let inside = [
            least[0].gt(l.i(-1)),
            least[1].gt(l.i(-1)) & two,
            least[2].gt(l.i(-1)) & tall,
            least[3].gt(l.i(-1)) & two & tall,
        ];
        let mut covered = zero;
        for (k, m) in inside.into_iter().enumerate() {
            covered = covered | l.i(1 << k).or_else(m, zero);
        }
        covered.store(&mut self.ints[13]);
        let tiny = if f.range.0 == f.range.1 { tiny.bits() } else { 0 };
        let seen = seen.bits() & (!tiny | covered.gt(zero).bits());
        ax0.store(&mut self.ints[9]);
        ay0.store(&mut self.ints[10]);
        ax1.store(&mut self.ints[11]);
        ay1.store(&mut self.ints[12]);
        let [sx, sy] = slope([qx - px, qy - py, qz - pz], [rx - px, ry - py, rz - pz]);
        px.store(&mut self.nums[0]);
        py.store(&mut self.nums[1]);
        pz.store(&mut self.nums[2]);
        sx.store(&mut self.nums[3]);
        sy.store(&mut self.nums[4]);
        pz.min(qz).min(rz).store(&mut self.nums[5]);
        pz.max(qz).max(rz).store(&mut self.nums[6]);
        (seen, large.bits(), tiny)
    }
}

/// Calls `each(sample, first place, mask, depth)` for every block of covered samples of a triangle, in
/// one fixed order.
#[inline(always)]
fn scan<L: Lane>(
    l: L,
    s: &Setup,
    origin: (i32, i32),
    samples: &[[i32; 2]],
    mut each: impl FnMut(usize, usize, L::M, L::F),
) {
    // A vector covers a block of 4x4, the half of one, or a pixel.
    let (wide, high) = if L::WIDTH >= 4 { (4, L::WIDTH as i32 / 4) } else { (1, 1) };
    let ramp = l.ramp();
    let (lx, ly) = (ramp & (wide - 1), ramp >> (wide as u32).trailing_zeros());
    let rise: [L::I; 3] = [lx * s.a[0] + ly * s.b[0], lx * s.a[1] + ly * s.b[1], lx * s.a[2] + ly * s.b[2]];
    let [x0, y0, x1, y1] = s.area;
    let (first_x, first_y) = (x0 & !(wide - 1), y0 & !(high - 1));
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
        let mut y = first_y;
        while y <= y1 {
            let py = (ly + (origin.1 + y)).to_num() + fy;
            let row = (py - s.origin[1]) * s.slope[1] + s.origin[2];
            let mut e: [i32; 3] = three(
                #[inline(always)]
                |k| corner[k] + s.b[k] * y + s.a[k] * first_x,
            );
            let mut x = first_x;
            let mut at = index(x as u32, y as u32);
            while x <= x1 {
                let inside = (rise[0] + e[0]) | (rise[1] + e[1]) | (rise[2] + e[2]);
                let mask = inside.gt(l.i(-1));
                if mask.any() {
                    let px = (lx + (origin.0 + x)).to_num() + fx;
                    let z = (px - s.origin[0]) * s.slope[0] + row;
                    let z = z.max(l.f(s.range[0])).min(l.f(s.range[1]));
                    each(number, at, mask, z);
                }
                for k in 0..3 {
                    // Values of the tile's own pixels fit; the step beyond the last may not.
                    e[k] = e[k].wrapping_add(s.a[k] * wide);
                }
                x += wide;
                // The next block; single pixels have to be looked up.
                at = if wide > 1 { at + (BLOCK * BLOCK) as usize } else { index(x as u32, y as u32) };
            }
            y += high;
        }
    }
}

/// What [`triangles`] finds.
enum Found<'a> {
    /// A triangle that may cover samples.
    Area(&'a Setup),
    /// A sample and its depth: small solid triangles, where a pixel has one sample.
    Sample(usize, f32),
}

/// Calls `each(found, id, class)` for the triangles of some entries of a tile, in their order.
#[inline(always)]
fn triangles<L: Lane>(
    l: L,
    place: &Place<'_>,
    entries: &[Entry],
    wanted: impl Fn(Class) -> bool,
    mut each: impl FnMut(Found<'_>, u32, Class),
) {
    let frame = Frame::new(place);
    let mut setups = Setups { ints: [[0; MOST]; 14], nums: [[0.0; MOST]; 7] };
    for &Entry { part, what, mask } in entries {
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
            let mut numbers = [0u8; MOST];
            let mut count = 0;
            while count < L::WIDTH && rest != 0 {
                numbers[count] = rest.trailing_zeros() as u8;
                rest &= rest - 1;
                count += 1;
            }
            let last = numbers[count - 1];
            numbers[count..].fill(last);
            let corners = Corners { piece, vertices, triangles, numbers };
            let (seen, large, tiny) = setups.fill(l, &corners, &frame);
            let tiny = if r.class == Class::Solid { tiny } else { 0 };
            let mut lanes = (seen | large) & ((1u64 << count) - 1) as u32;
            while lanes != 0 {
                let k = lanes.trailing_zeros() as usize & (MOST - 1);
                lanes &= lanes - 1;
                let id = record << 7 | u32::from(numbers[k]);
                if tiny >> k & 1 != 0 {
                    let mut covered = setups.ints[13][k];
                    while covered != 0 {
                        let n = covered.trailing_zeros();
                        covered &= covered - 1;
                        let (x, y) = (setups.ints[9][k] + (n & 1) as i32, setups.ints[10][k] + (n >> 1) as i32);
                        let center = frame.range.0 as f32 / 256.0;
                        let px = (frame.origin.0 + x) as f32 + center;
                        let py = (frame.origin.1 + y) as f32 + center;
                        let at = index(x as u32, y as u32) & (PIXELS - 1);
                        each(Found::Sample(at, setups.depth(k, px, py)), id, r.class);
                    }
                    continue;
                }
                let setup = if large >> k & 1 == 0 {
                    setups.get(k)
                } else {
                    let own = three(
                        #[inline(always)]
                        |c| {
                            let v = corners.get(k, c);
                            [v[0], v[1], v[2]]
                        },
                    );
                    let Some(setup) = Setup::new(&own, &frame) else { continue };
                    setup
                };
                each(Found::Area(&setup), id, r.class);
            }
        }
    }
}

/// Draws the solid and cut triangles of a tile. `depth` and `id` hold [`PIXELS`] per sample (see [`index`]), sample
/// after sample, and were filled with 0 and [`NOTHING`] (or with what was drawn before). Nearest wins, then the
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
    let mut pending: Vec<Fragment> = Vec::new();
    let mut key = (u32::MAX, u32::MAX);
    let entries = if C::ANY { &near_to_far(place)[..] } else { place.bins.tile(place.tile) };
    triangles(
        l,
        place,
        entries,
        |class| matches!(class, Class::Solid | Class::Cut),
        #[inline(always)]
        |found, new, class| {
            let setup = match found {
                Found::Area(setup) => setup,
                Found::Sample(at, z) => {
                    put::<IDS>(place, at, z, new, depth, id);
                    return;
                }
            };
            if C::ANY && class == Class::Cut {
                let r = &place.bins.records[(new >> 7) as usize];
                if key != (r.draw, r.look) || pending.len() >= PENDING {
                    flush::<L, C, IDS>(l, place, cut, &mut pending, depth, id);
                    key = (r.draw, r.look);
                }
            }
            scan(
                l,
                setup,
                origin,
                samples,
                #[inline(always)]
                |sample, first, mask, z| {
                    let at = sample * PIXELS + first;
                    let depths = &mut depth[at..at + L::WIDTH];
                    let old = l.load(depths);
                    let see = mask & z.ge(old);
                    if !see.any() {
                        return;
                    }
                    if C::ANY && class == Class::Cut {
                        let mut depths = [0.0f32; MOST];
                        z.store(&mut depths);
                        let mut bits = see.bits();
                        while bits != 0 {
                            let k = bits.trailing_zeros() as usize & (MOST - 1);
                            bits &= bits - 1;
                            pending.push(Fragment { at: (at + k) as u32, id: new, depth: depths[k] });
                        }
                        return;
                    }
                    let pass = see & z.gt(old);
                    if IDS && see.bits() != pass.bits() {
                        ties(l, place, new, see & z.eq(old) & z.gt(l.f(0.0)), &mut id[at..at + L::WIDTH]);
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
    if C::ANY {
        flush::<L, C, IDS>(l, place, cut, &mut pending, depth, id);
    }
}

/// The entries of a tile, near ones first: what they hide is not asked whether it is there. Nothing else depends on
/// the order.
fn near_to_far(place: &Place<'_>) -> Vec<Entry> {
    // Depths are not negative, so their bits are ordered as they are. Pieces have corners near the eye.
    let near = |e: &Entry| if e.mask == 0 { u32::MAX } else { place.bins.records[e.what as usize].near.to_bits() };
    let mut entries = place.bins.tile(place.tile).to_vec();
    entries.sort_by_cached_key(|e| std::cmp::Reverse(near(e)));
    entries
}

/// Samples of cut triangles that wait for one another, so that whole vectors of them are asked.
const PENDING: usize = 1 << 8;

/// Asks for the samples that wait, and draws those that are there.
#[inline(always)]
fn flush<L: Lane, C: Cut<L>, const IDS: bool>(
    l: L,
    place: &Place<'_>,
    cut: &mut C,
    pending: &mut Vec<Fragment>,
    depth: &mut [f32],
    id: &mut [u32],
) {
    let samples = sample_positions(place.target.samples);
    let (ox, oy) = Bins::origin(place.target, place.tile);
    for run in pending.chunks(L::WIDTH) {
        let (mut ids, mut at) = ([0u32; MOST], [0i32; MOST]);
        let (mut dx, mut dy) = ([0.0f32; MOST], [0.0f32; MOST]);
        for k in 0..L::WIDTH {
            let f = &run[k.min(run.len() - 1)];
            let offset = samples[f.at as usize / PIXELS];
            ids[k] = f.id;
            at[k] = (f.at as usize % PIXELS) as i32;
            (dx[k], dy[k]) = (offset[0] as f32 / 256.0, offset[1] as f32 / 256.0);
        }
        let (x, y) = pixel(l.load_i(&at));
        let px = (x + ox as i32).to_num() + l.load(&dx);
        let py = (y + oy as i32).to_num() + l.load(&dy);
        let mask = l.mask(((1u64 << run.len()) - 1) as u32);
        let kept = cut.keep(l, &ids[..L::WIDTH], px, py, mask).bits();
        for (_, f) in run.iter().enumerate().filter(|(k, _)| kept >> k & 1 != 0) {
            put::<IDS>(place, f.at as usize, f.depth, f.id, depth, id);
        }
    }
    pending.clear();
}

/// Draws a sample: the nearest wins, then the lower source order.
#[inline(always)]
fn put<const IDS: bool>(place: &Place<'_>, at: usize, z: f32, new: u32, depth: &mut [f32], id: &mut [u32]) {
    if z > depth[at] || (IDS && z == depth[at] && z > 0.0 && place.comes_before(new, id[at])) {
        depth[at] = z;
        if IDS {
            id[at] = new;
        }
    }
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
    /// `sample * PIXELS +` [`index`] of the pixel.
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
        l,
        place,
        place.bins.tile(place.tile),
        |class| class == Class::Layered,
        #[inline(always)]
        |found, id, _| {
            let Found::Area(setup) = found else { return };
            if out.len() > limit {
                return;
            }
            scan(
                l,
                setup,
                origin,
                samples,
                #[inline(always)]
                |sample, first, mask, z| {
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
