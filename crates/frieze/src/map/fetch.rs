//! Texels of one or two levels, for many lanes at once.
//!
//! There is no gather instruction behind [`Lane`]: addresses are computed side by side, texels loaded lane
//! by lane, and unpacked side by side again.

use super::filter::Wrap;
use crate::image::pyramid::Shape;
use crate::math::lane::{Int, Lane, Mask, Num};
use crate::math::vec::{Vec2, Vec4};

/// Most lanes of any level.
const MOST: usize = 16;

/// Four channels, not yet scaled to 0 ..= 1 (see [`Store::finish`]).
pub(super) type Raw<L> = [<L as Lane>::F; 4];

/// A format of texels: how they are loaded and unpacked.
pub(super) trait Store: Copy + 'static {
    /// Loads and unpacks `texels[i]`, `texels[i + 1]`, `texels[j]`, `texels[j + 1]`.
    fn four<L: Lane>(l: L, texels: &[Self], i: L::I, j: L::I) -> [Raw<L>; 4];
    /// Unpacks one texel.
    fn one(self) -> [f32; 4];
    /// Scales to 0 ..= 1. Full code gives 1 exactly, and every code `c` the same bits as `c / full`.
    fn finish<N: Num>(raw: [N; 4]) -> Vec4<N>;
}

/// The lanes of an index vector, as places in a slice.
#[inline(always)]
fn places<L: Lane>(i: L::I) -> [i32; MOST] {
    let mut out = [0; MOST];
    i.store(&mut out);
    out
}

impl Store for u32 {
    #[inline(always)]
    fn four<L: Lane>(l: L, texels: &[u32], i: L::I, j: L::I) -> [Raw<L>; 4] {
        // Channels stay where they are in the word: interpolation does not mind powers of two.
        #[inline(always)]
        fn unpack<I: Int>(t: I) -> [I::Num; 4] {
            [(t & 0xff).to_num(), (t & 0xff00).to_num(), (t & 0xff_0000).to_num(), ((t >> 8) & 0xff_0000).to_num()]
        }
        #[inline(always)]
        fn two(texels: &[u32], i: i32) -> u64 {
            let p = &texels[i as u32 as usize..][..2];
            u64::from(p[0]) | u64::from(p[1]) << 32
        }
        let (i, j) = (places::<L>(i), places::<L>(j));
        let [a, b] = l.pairs(
            #[inline(always)]
            |k| two(texels, i[k]),
        );
        let [c, d] = l.pairs(
            #[inline(always)]
            |k| two(texels, j[k]),
        );
        [unpack(a), unpack(b), unpack(c), unpack(d)]
    }
    #[inline(always)]
    fn one(self) -> [f32; 4] {
        let t = self;
        [t & 0xff, t & 0xff00, t & 0xff_0000, (t >> 8) & 0xff_0000].map(|v| v as f32)
    }
    #[inline(always)]
    fn finish<N: Num>([r, g, b, a]: [N; 4]) -> Vec4<N> {
        // c/255 = c/256 + c/256/255, which rounds as the division does.
        const S: [f32; 3] = [1.0 / 256.0, 1.0 / 65536.0, 1.0 / 16_777_216.0];
        #[inline(always)]
        fn full<N: Num>(v: N, s: f32) -> N {
            v * s + v * s * (1.0 / 255.0)
        }
        Vec4::new(full(r, S[0]), full(g, S[1]), full(b, S[2]), full(a, S[2]))
    }
}

impl Store for [u32; 2] {
    #[inline(always)]
    fn four<L: Lane>(l: L, texels: &[[u32; 2]], i: L::I, j: L::I) -> [Raw<L>; 4] {
        #[inline(always)]
        fn unpack<I: Int>(t: I, u: I) -> [I::Num; 4] {
            [(t & 0xffff).to_num(), ((t >> 16) & 0xffff).to_num(), (u & 0xffff).to_num(), ((u >> 16) & 0xffff).to_num()]
        }
        let (i, j) = (places::<L>(i), places::<L>(j));
        let numbers: &[f32] = bytemuck::cast_slice(texels);
        let [a, b, c, d] = l.transpose4_from(
            #[inline(always)]
            |k| &numbers[2 * i[k] as u32 as usize..],
        );
        let [e, f, g, h] = l.transpose4_from(
            #[inline(always)]
            |k| &numbers[2 * j[k] as u32 as usize..],
        );
        let (a, b, c, d) = (a.to_bits(), b.to_bits(), c.to_bits(), d.to_bits());
        let (e, f, g, h) = (e.to_bits(), f.to_bits(), g.to_bits(), h.to_bits());
        [unpack(a, b), unpack(c, d), unpack(e, f), unpack(g, h)]
    }
    #[inline(always)]
    fn one(self) -> [f32; 4] {
        [self[0] & 0xffff, self[0] >> 16, self[1] & 0xffff, self[1] >> 16].map(|v| v as f32)
    }
    #[inline(always)]
    fn finish<N: Num>(raw: [N; 4]) -> Vec4<N> {
        // c/65535 = c/65536 + c/65536/65535, which rounds as the division does.
        #[inline(always)]
        fn full<N: Num>(v: N) -> N {
            v * (1.0 / 65536.0) + v * (1.0 / 65536.0) * (1.0 / 65535.0)
        }
        Vec4::new(full(raw[0]), full(raw[1]), full(raw[2]), full(raw[3]))
    }
}

impl Store for [f32; 4] {
    #[inline(always)]
    fn four<L: Lane>(l: L, texels: &[[f32; 4]], i: L::I, j: L::I) -> [Raw<L>; 4] {
        #[inline(always)]
        fn pair<L: Lane>(l: L, texels: &[[f32; 4]], i: L::I) -> [Raw<L>; 2] {
            let i = places::<L>(i);
            let numbers: &[f32] = bytemuck::cast_slice(texels);
            let [a, b, c, d, e, f, g, h] = l.transpose_from(
                #[inline(always)]
                |k| &numbers[4 * i[k] as u32 as usize..],
            );
            [[a, b, c, d], [e, f, g, h]]
        }
        let ([a, b], [c, d]) = (pair(l, texels, i), pair(l, texels, j));
        [a, b, c, d]
    }
    #[inline(always)]
    fn one(self) -> [f32; 4] {
        self
    }
    #[inline(always)]
    fn finish<N: Num>(raw: [N; 4]) -> Vec4<N> {
        Vec4::from(raw)
    }
}

/// Told what every lookup reads, and with which weight; says nothing by default.
pub(super) trait Listen {
    /// Whether to tell at all.
    const ON: bool = false;
    /// Texel (x, y) of a level counts `weight`.
    fn tap(&mut self, _level: Shape, _x: u32, _y: u32, _weight: f32) {}
}

/// Nobody listens.
pub(super) struct Quiet;
impl Listen for Quiet {}

/// A level of detail per lane.
#[derive(Clone, Copy)]
pub(super) struct At<L: Lane> {
    width: L::F,
    height: L::F,
    pitch: L::I,
    offset: L::I,
}

impl<L: Lane> At<L> {
    /// The same level in all lanes.
    #[inline(always)]
    pub fn uniform(l: L, s: Shape) -> Self {
        At {
            width: l.f(s.width as f32),
            height: l.f(s.height as f32),
            pitch: l.i(s.pitch as i32),
            offset: l.i(s.offset as i32),
        }
    }
    /// `m ? self : o`
    #[inline(always)]
    fn or_else(self, m: L::M, o: Self) -> Self {
        At {
            width: self.width.or_else(m, o.width),
            height: self.height.or_else(m, o.height),
            pitch: self.pitch.or_else(m, o.pitch),
            offset: self.offset.or_else(m, o.offset),
        }
    }
    /// Each lane its own.
    #[inline(always)]
    fn gather(l: L, shapes: &[Shape], level: L::I) -> Self {
        let at = places::<L>(level);
        let last = shapes.len() - 1;
        let (mut size, mut step) = ([[0.0; MOST]; 2], [[0; MOST]; 2]);
        for k in 0..L::WIDTH {
            let s = shapes[(at[k] as u32 as usize).min(last)];
            (size[0][k], size[1][k]) = (s.width as f32, s.height as f32);
            (step[0][k], step[1][k]) = (s.pitch as i32, s.offset as i32);
        }
        At { width: l.load(&size[0]), height: l.load(&size[1]), pitch: l.load_i(&step[0]), offset: l.load_i(&step[1]) }
    }
    /// The level of a single lane, for a listener.
    fn shape(&self) -> Shape {
        Shape {
            width: self.width.lane(0) as u32,
            height: self.height.lane(0) as u32,
            pitch: self.pitch.lane(0) as u32,
            offset: self.offset.lane(0) as u32,
        }
    }
}

/// Level `k` in all lanes; the nearest there is.
#[inline(always)]
fn nearest<L: Lane>(l: L, mips: &[Shape], k: i32) -> At<L> {
    At::uniform(l, mips[(k.max(0) as usize).min(mips.len() - 1)])
}

/// The levels `level` and `level + 1` of each lane (the last stays the last). `level` is within the mips.
/// Mostly all lanes need the same or neighbouring levels: those are made from constants.
#[inline(always)]
pub(super) fn two_levels<L: Lane>(l: L, mips: &[Shape], level: L::I, active: L::M) -> [At<L>; 2] {
    let idle = !active;
    let first = level.lane((active.bits() | 1 << (L::WIDTH - 1)).trailing_zeros() as usize);
    let same = level.eq(l.i(first));
    if (same | idle).all() {
        return [nearest(l, mips, first), nearest(l, mips, first + 1)];
    }
    let low = if (level.lt(l.i(first)) & active).any() { first - 1 } else { first };
    let above = level.eq(l.i(low + 1));
    if (above | level.eq(l.i(low)) | idle).all() {
        let (a, b, c) = (nearest(l, mips, low), nearest(l, mips, low + 1), nearest(l, mips, low + 2));
        return [b.or_else(above, a), c.or_else(above, b)];
    }
    [At::gather(l, mips, level), At::gather(l, mips, level + 1)]
}

/// Texture coordinates brought into 0 ..= 1 (`Border`: -1 ..= 2, which is as far outside as any).
/// NaN and infinities become something inside.
#[inline(always)]
pub(super) fn fold<N: Num>(wrap: Wrap, u: N) -> N {
    match wrap {
        Wrap::Repeat => (u - u.floor()).saturate(),
        Wrap::Mirror => {
            let t = u * 0.5;
            let t = (t - t.floor()) * 2.0;
            (t.lift(2.0) - t).min(t).saturate()
        }
        Wrap::Clamp => u.saturate(),
        Wrap::Border => u.clamp(-1.0, 2.0),
    }
}

/// `a + (b - a) t`, channel by channel. Spelt out: closures given to `core::array` are not inlined.
#[inline(always)]
pub(super) fn mix4<N: Num>(t: N, a: [N; 4], b: [N; 4]) -> [N; 4] {
    [t.mix(a[0], b[0]), t.mix(a[1], b[1]), t.mix(a[2], b[2]), t.mix(a[3], b[3])]
}

/// The left one of the two texels around folded `u`, and how far right of its centre `u` lies.
#[inline(always)]
fn between<L: Lane>(l: L, wrap: Wrap, u: L::F, size: L::F) -> (L::F, L::F) {
    let x = u * size - 0.5; // centres are at (i + 1/2) / size (row 38, E15)
    let x = if wrap == Wrap::Repeat { (x + size).or_else(x.lt(l.f(0.0)), x) } else { x.max(l.f(0.0)).min(size - 1.0) };
    let left = x.floor().min(size - 1.0);
    (left, x - left)
}

/// Bilinear: four texels around `place` (folded), first along u, then along v (row 39). With
/// `BORDER` (one lane only) an axis may have one. `weight` is what a listener hears the whole lookup counts.
#[inline(always)]
pub(super) fn bilinear<L: Lane, S: Store, H: Listen, const BORDER: bool>(
    l: L,
    texels: &[S],
    at: At<L>,
    wrap: [Wrap; 2],
    place: Vec2<L::F>,
    weight: L::F,
    listen: &mut H,
) -> Raw<L> {
    if BORDER {
        let v = bilinear_border(texels, at.shape(), wrap, lane2(place, 0), weight.lane(0), listen);
        return [l.f(v[0]), l.f(v[1]), l.f(v[2]), l.f(v[3])];
    }
    let taps = Taps::new(l, at, wrap, place);
    if H::ON {
        let shape = at.shape();
        let (x, y) = (taps.x.lane(0) as u32, taps.y.lane(0) as u32);
        let (s, t, w) = (taps.s.lane(0), taps.t.lane(0), weight.lane(0));
        // The padding repeats texel 0; with other wraps it only ever counts 0.
        let (x1, y1) = (if x + 1 < shape.width { x + 1 } else { 0 }, if y + 1 < shape.height { y + 1 } else { 0 });
        for (x, y, k) in
            [(x, y, (1.0 - s) * (1.0 - t)), (x1, y, s * (1.0 - t)), (x, y1, (1.0 - s) * t), (x1, y1, s * t)]
        {
            listen.tap(shape, x, y, k * w);
        }
    }
    taps.blend(l, texels)
}

/// Four neighbouring texels and how much each counts: the same for all maps of one size.
#[derive(Clone, Copy)]
pub(super) struct Taps<L: Lane> {
    /// Column and row of the upper left one.
    x: L::F,
    y: L::F,
    /// Where it is, and where the one below is.
    i: L::I,
    j: L::I,
    /// The share of the right and of the lower ones.
    s: L::F,
    t: L::F,
}

impl<L: Lane> Taps<L> {
    #[inline(always)]
    pub fn new(l: L, at: At<L>, wrap: [Wrap; 2], place: Vec2<L::F>) -> Self {
        let (x, s) = between(l, wrap[0], place.x, at.width);
        let (y, t) = between(l, wrap[1], place.y, at.height);
        let i = at.offset + y.to_int() * at.pitch + x.to_int();
        Taps { x, y, i, j: i + at.pitch, s, t }
    }
    #[inline(always)]
    pub fn blend<S: Store>(&self, l: L, texels: &[S]) -> Raw<L> {
        let [a, b, c, d] = S::four(l, texels, self.i, self.j);
        mix4(self.t, mix4(self.s, a, b), mix4(self.s, c, d))
    }
}

/// The texel with index `i` of `n` under a wrap; `None` outside of a border.
#[inline(always)]
pub(super) fn wrapped(wrap: Wrap, i: i64, n: u32) -> Option<u32> {
    let n = i64::from(n);
    let k = match wrap {
        Wrap::Repeat => i.rem_euclid(n),
        Wrap::Mirror => {
            let k = i.rem_euclid(2 * n);
            if k < n { k } else { 2 * n - 1 - k }
        }
        Wrap::Clamp => i.clamp(0, n - 1),
        Wrap::Border if (0..n).contains(&i) => i,
        Wrap::Border => return None,
    };
    Some(k as u32)
}

/// One texel of a level under a wrap; the border is transparent black.
#[inline(always)]
pub(super) fn texel<S: Store, H: Listen>(
    texels: &[S],
    s: Shape,
    wrap: [Wrap; 2],
    x: i64,
    y: i64,
    weight: f32,
    listen: &mut H,
) -> [f32; 4] {
    match (wrapped(wrap[0], x, s.width), wrapped(wrap[1], y, s.height)) {
        (Some(x), Some(y)) => {
            if H::ON {
                listen.tap(s, x, y, weight);
            }
            texels[s.offset as usize + y as usize * s.pitch as usize + x as usize].one()
        }
        _ => [0.0; 4],
    }
}

/// [`bilinear`] for one lane where an axis has a border: texel by texel.
fn bilinear_border<S: Store, H: Listen>(
    texels: &[S],
    shape: Shape,
    wrap: [Wrap; 2],
    place: Vec2,
    weight: f32,
    listen: &mut H,
) -> [f32; 4] {
    let (x, y) = (place.x * shape.width as f32 - 0.5, place.y * shape.height as f32 - 0.5);
    let (x0, y0) = (x.floor(), y.floor());
    let (s, t) = (x - x0, y - y0);
    let (x0, y0) = (x0 as i64, y0 as i64);
    let mut get = |dx, dy, k: f32| texel(texels, shape, wrap, x0 + dx, y0 + dy, k * weight, listen);
    let (a, b) = (get(0, 0, (1.0 - s) * (1.0 - t)), get(1, 0, s * (1.0 - t)));
    let (c, d) = (get(0, 1, (1.0 - s) * t), get(1, 1, s * t));
    mix4(t, mix4(s, a, b), mix4(s, c, d))
}

/// `log2(x) / 2` for x within 2^-60 ..= 2^60 (others and NaN are clamped), error below 3e-5: the exponent,
/// and a polynomial of the significand that is exact at both ends, so that levels have no seam.
#[inline(always)]
pub(super) fn half_log2<N: Num>(x: N) -> N {
    let bits = x.clamp(8.673_617_4e-19, 1.152_921_5e18).to_bits();
    let e = ((bits >> 23) - 127).to_num();
    let f = ((bits & 0x7f_ffff) | 0x3f80_0000).from_bits() - 1.0;
    let q = ((f * -0.044_873_955 + 0.150_533_2) * f + -0.269_578) * f + 0.442_418_58;
    (e + (f + (f - f * f) * q)) * 0.5
}

/// A lane of a kernel's arguments.
#[inline(always)]
pub(super) fn lane2<N: Num>(v: Vec2<N>, k: usize) -> Vec2 {
    Vec2::new(v.x.lane(k), v.y.lane(k))
}
