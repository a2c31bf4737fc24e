//! One tile from its bins to its final pixels.

use super::Pass;
use super::point::{Corners, Group, Lanes, Triangle};
use crate::image::Encoding;
use crate::image::color;
use crate::math::lane::{Int, Kernel, Lane, Num};
use crate::math::vec::{Vec3, Vec4};
use crate::prepare::View;
use crate::raster::geometry::Class;
use crate::raster::tile::{self, Cut, Fragment, NOTHING, PIXELS, Place};
use crate::raster::{Bins, TILE, sample_positions};
use crate::render::Format;
use crate::scene::{Alpha, Background, ToneMap};
use crate::shade::{self, Lights, Silent};

/// Fragments of layered triangles that a tile holds at once; more are taken in depth ranges.
const LAYERS: usize = 1 << 19;

/// Asks the alpha of masked materials while coverage is found.
pub(super) struct Holes<'a> {
    pub place: Place<'a>,
    pub pass: &'a Pass<'a>,
    pub view: &'a View,
}

impl<L: Lane> Cut<L> for Holes<'_> {
    #[inline(always)]
    fn keep(&mut self, l: L, id: u32, px: L::F, py: L::F, mask: L::M) -> L::M {
        let group = group(self.pass, self.view, &self.place, id);
        let Alpha::Mask(cutoff) = group.look.alpha else { return mask };
        l.enter(
            #[inline(always)]
            || {
                let ids = [id; 16];
                let lanes = Lanes { ids: &ids, px, py, active: mask };
                let surface =
                    Corners::new(l, &group, &lanes, &mut [Triangle::NONE; 16]).surface(l, &group, None, &lanes);
                mask & shade::alpha(l, group.look, &surface).ge(l.f(cutoff))
            },
        )
    }
}

#[inline(always)]
pub(super) fn group<'a>(pass: &'a Pass<'a>, view: &'a View, place: &Place<'a>, id: u32) -> Group<'a> {
    let r = &place.bins.records[(id >> 7) as usize];
    Group {
        view,
        bins: place.bins,
        draw: &place.draws[r.draw as usize],
        instance: &pass.prepared.instances[r.draw as usize],
        look: &pass.looks[r.look as usize],
    }
}

/// Something to shade: a triangle in a pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub id: u32,
    /// Pixel of the tile.
    pub at: u16,
    /// Samples of the pixel that it covers, as bits.
    pub samples: u16,
    /// Where in the pixel it is shaded.
    pub offset: [f32; 2],
    /// Whether planes (AOVs) are its: it has the pixel's first covered sample.
    pub first: bool,
}

/// Entries of one draw and one look.
#[derive(Debug, Default)]
pub(super) struct Batch {
    key: (u32, u32),
    pub entries: Vec<Entry>,
}

/// Memory of a tile, used again for the next.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    pub depth: Vec<f32>,
    pub id: Vec<u32>,
    pub batches: Vec<Batch>,
    pub used: usize,
    /// Premultiplied light and coverage per pixel, or per sample while layers are composed.
    pub color: Vec<[f32; 4]>,
    shaded: [Vec<f32>; 4],
    fragments: Vec<Fragment>,
    planes: Vec<Vec<f32>>,
}

/// What a tile counts.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Count {
    /// Surfaces that were shaded.
    pub shaded: u64,
}

/// Where a tile's pixels go.
pub(super) struct Out<'b> {
    /// Its rows of the picture.
    pub rows: Vec<&'b mut [u8]>,
    /// Its rows of each plane.
    pub planes: Vec<Vec<&'b mut [u8]>>,
}

/// Draws and shades a tile.
pub(super) struct Tile<'a, 'b> {
    pub pass: &'a Pass<'a>,
    pub view: &'a View,
    pub lights: Lights<'a>,
    pub place: Place<'a>,
    pub out: Out<'b>,
    pub scratch: &'a mut Scratch,
}

impl Kernel for Tile<'_, '_> {
    type Out = Count;
    #[inline(always)]
    fn run<L: Lane>(self, l: L) -> Count {
        let Tile { pass, view, lights, place, mut out, scratch } = self;
        let samples = place.target.samples as usize;
        let mut count = Count::default();
        let (cuts, layers) = classes(&place);
        scratch.depth.clear();
        scratch.depth.resize(PIXELS * samples, 0.0);
        scratch.id.clear();
        scratch.id.resize(PIXELS * samples, NOTHING);
        if cuts {
            let mut holes = Holes { place, pass, view };
            tile::solid::<L, _, true>(l, &place, &mut holes, &mut scratch.depth, &mut scratch.id);
        } else {
            tile::solid::<L, _, true>(l, &place, &mut tile::Uncut, &mut scratch.depth, &mut scratch.id);
        }
        let kept = if layers { samples } else { 1 };
        scratch.color.clear();
        scratch.color.resize(PIXELS * kept, [0.0; 4]);
        let pixels = pass.aovs.len();
        scratch.planes.resize_with(pixels, Vec::new);
        for (plane, aov) in scratch.planes.iter_mut().zip(pass.aovs) {
            plane.clear();
            plane.resize(PIXELS * aov.channels().len(), aov.nothing());
        }
        collect(&place, scratch, samples);
        for k in 0..scratch.used {
            let batch = std::mem::take(&mut scratch.batches[k]);
            count.shaded += batch.entries.len() as u64;
            shade_batch(l, pass, view, &lights, &place, &batch, &mut scratch.shaded, Some(&mut scratch.planes));
            spread(&batch, &scratch.shaded, &mut scratch.color, samples, kept);
            scratch.batches[k] = batch;
        }
        if layers {
            l.enter(
                #[inline(always)]
                || compose(l, pass, view, &lights, &place, scratch, samples, &mut count),
            );
        }
        l.enter(
            #[inline(always)]
            || finish(l, pass, scratch, kept, &mut out),
        );
        count
    }
}

/// Whether a tile has cut triangles, and whether it has layered ones.
pub(super) fn classes(place: &Place<'_>) -> (bool, bool) {
    let (mut cuts, mut layers) = (false, false);
    for e in place.bins.tile(place.tile) {
        let record = if e.mask == 0 {
            place.bins.base(e.part) + place.bins.parts[e.part as usize].pieces[e.what as usize].record
        } else {
            e.what
        };
        match place.bins.records[record as usize].class {
            Class::Cut => cuts = true,
            Class::Layered => layers = true,
            _ => {}
        }
    }
    (cuts, layers)
}

/// Sorts the visible samples of a tile by draw and look.
pub(super) fn collect(place: &Place<'_>, scratch: &mut Scratch, samples: usize) {
    scratch.used = 0;
    let positions = sample_positions(samples as u32);
    let mut memo = (u32::MAX, 0usize);
    if samples == 1 {
        let ids = std::mem::take(&mut scratch.id);
        for (at, &id) in ids.iter().enumerate() {
            if id != NOTHING {
                if memo.0 != id >> 7 {
                    memo = (id >> 7, scratch.batch_of(place, id));
                }
                let entry = Entry { id, at: at as u16, samples: 1, offset: [0.5; 2], first: true };
                scratch.batches[memo.1].entries.push(entry);
            }
        }
        scratch.id = ids;
        return;
    }
    for at in 0..PIXELS {
        let ids = &scratch.id;
        let one = ids[at];
        // Most pixels are inside of one triangle.
        if (1..samples).all(|s| ids[s * PIXELS + at] == one) {
            if one != NOTHING {
                if memo.0 != one >> 7 {
                    memo = (one >> 7, scratch.batch_of(place, one));
                }
                let whole = ((1u32 << samples) - 1) as u16;
                let entry = Entry { id: one, at: at as u16, samples: whole, offset: [0.5; 2], first: true };
                scratch.batches[memo.1].entries.push(entry);
            }
            continue;
        }
        let mut left = (0..samples).fold(0u32, |m, s| m | u32::from(ids[s * PIXELS + at] != NOTHING) << s);
        let mut first = true;
        while left != 0 {
            let ids = &scratch.id;
            let id = ids[left.trailing_zeros() as usize * PIXELS + at];
            let mask = (0..samples).fold(0u32, |m, s| m | u32::from(ids[s * PIXELS + at] == id) << s);
            left &= !mask;
            if memo.0 != id >> 7 {
                memo = (id >> 7, scratch.batch_of(place, id));
            }
            let entry = Entry { id, at: at as u16, samples: mask as u16, offset: center(mask, positions), first };
            scratch.batches[memo.1].entries.push(entry);
            first = false;
        }
    }
}

impl Scratch {
    /// The batch of a triangle's draw and look.
    fn batch_of(&mut self, place: &Place<'_>, id: u32) -> usize {
        let r = &place.bins.records[(id >> 7) as usize];
        let key = (r.draw, r.look);
        if let Some(k) = self.batches[..self.used].iter().position(|b| b.key == key) {
            return k;
        }
        if self.batches.len() == self.used {
            self.batches.push(Batch { key, entries: Vec::with_capacity(PIXELS) });
        }
        let batch = &mut self.batches[self.used];
        batch.key = key;
        batch.entries.clear();
        self.used += 1;
        self.used - 1
    }
}

/// Where a triangle that covers these samples is shaded: the pixel's centre when it covers all, else the middle
/// of the samples that it does cover, which cannot lie outside of it.
#[inline(always)]
fn center(mask: u32, positions: &[[i32; 2]]) -> [f32; 2] {
    if mask.count_ones() as usize == positions.len() {
        return [0.5; 2];
    }
    let mut sum = [0i32; 2];
    let mut left = mask;
    while left != 0 {
        let p = positions[left.trailing_zeros() as usize];
        left &= left - 1;
        sum = [sum[0] + p[0], sum[1] + p[1]];
    }
    let n = (mask.count_ones() * 256) as f32;
    [sum[0] as f32 / n, sum[1] as f32 / n]
}

/// Shades all entries of a batch into `shaded`, in their order. Entered once per level, from wherever it is
/// called: what is inlined below it is the largest part of the program.
#[inline(never)]
fn shade_batch<L: Lane>(
    l: L,
    pass: &Pass<'_>,
    view: &View,
    lights: &Lights<'_>,
    place: &Place<'_>,
    batch: &Batch,
    shaded: &mut [Vec<f32>; 4],
    planes: Option<&mut Vec<Vec<f32>>>,
) {
    l.enter(
        #[inline(always)]
        || shade_entries(l, pass, view, lights, place, batch, shaded, planes),
    );
}

#[inline(always)]
fn shade_entries<L: Lane>(
    l: L,
    pass: &Pass<'_>,
    view: &View,
    lights: &Lights<'_>,
    place: &Place<'_>,
    batch: &Batch,
    shaded: &mut [Vec<f32>; 4],
    mut planes: Option<&mut Vec<Vec<f32>>>,
) {
    let n = batch.entries.len();
    for s in shaded.iter_mut() {
        s.clear();
        s.resize(n.next_multiple_of(16), 0.0);
    }
    let Some(first) = batch.entries.first() else { return };
    let group = group(pass, view, place, first.id);
    let (ox, oy) = Bins::origin(place.target, place.tile);
    let mut triangles = [Triangle::NONE; 16];
    let mut from = 0;
    while from < n {
        let entries = &batch.entries[from..(from + L::WIDTH).min(n)];
        let (mut ids, mut at) = ([0u32; 16], [0i32; 16]);
        for k in 0..L::WIDTH {
            let e = &entries[k.min(entries.len() - 1)];
            ids[k] = e.id;
            at[k] = i32::from(e.at);
        }
        let at = l.load_i(&at);
        let (px, py) = if place.target.samples == 1 {
            (l.f(0.5), l.f(0.5))
        } else {
            let offset = |axis: usize, k: usize| entries[k.min(entries.len() - 1)].offset[axis];
            (
                l.f_from(
                    #[inline(always)]
                    |k| offset(0, k),
                ),
                l.f_from(
                    #[inline(always)]
                    |k| offset(1, k),
                ),
            )
        };
        let px = ((at & (TILE as i32 - 1)) + ox as i32).to_num() + px;
        let py = ((at >> TILE.trailing_zeros()) + oy as i32).to_num() + py;
        let active = l.mask(((1u64 << entries.len()) - 1) as u32);
        let lanes = Lanes { ids: &ids, px, py, active };
        let corners = Corners::new(l, &group, &lanes, &mut triangles);
        let surface = corners.surface(l, &group, Some(lights), &lanes);
        // Entered by itself: one function of both would take minutes to compile, and the surface that passes
        // through memory is a few per cent of what shading touches.
        let color = l.enter(
            #[inline(always)]
            || shade::shade(l, group.look, lights, &surface, &mut Silent),
        );
        for (out, c) in shaded.iter_mut().zip(color.array()) {
            c.store(&mut out[from..]);
        }
        if let Some(planes) = planes.as_deref_mut()
            && !planes.is_empty()
        {
            l.enter(
                #[inline(always)]
                || {
                    super::aov::write(l, pass, &group, place, &lanes, &corners, &surface, planes, |k| {
                        (k < entries.len() && entries[k].first).then(|| usize::from(entries[k].at))
                    });
                },
            );
        }
        from += L::WIDTH;
    }
}

/// Adds what was shaded to the pixels (or to their samples).
pub(super) fn spread(batch: &Batch, shaded: &[Vec<f32>; 4], color: &mut [[f32; 4]], samples: usize, kept: usize) {
    let share = 1.0 / samples as f32;
    for (k, e) in batch.entries.iter().enumerate() {
        // A layer may not have alpha; what is solid is opaque.
        let c = [shaded[0][k], shaded[1][k], shaded[2][k], 1.0];
        if samples == 1 {
            color[usize::from(e.at)] = c;
        } else if kept == 1 {
            let weight = e.samples.count_ones() as f32 * share;
            let to = &mut color[usize::from(e.at)];
            for i in 0..4 {
                to[i] += c[i] * weight;
            }
        } else {
            for s in 0..samples {
                if e.samples >> s & 1 != 0 {
                    color[s * PIXELS + usize::from(e.at)] = c;
                }
            }
        }
    }
}

/// Layered fragments of a tile, ready to be shaded and composed.
#[derive(Default)]
pub(super) struct Layers {
    /// One per triangle and pixel.
    pub entries: Vec<Entry>,
    /// Place, bits of the depth, triangle, entry.
    pub order: Vec<(u32, u32, u32, u32)>,
}

impl Layers {
    pub fn new(fragments: &mut [Fragment], positions: &[[i32; 2]]) -> Self {
        fragments.sort_unstable_by_key(|f| (f.at as usize % PIXELS, f.id, f.at));
        let mut layers = Layers::default();
        let mut k = 0;
        while k < fragments.len() {
            let (at, id) = (fragments[k].at as usize % PIXELS, fragments[k].id);
            let mut mask = 0u32;
            while k < fragments.len() && fragments[k].at as usize % PIXELS == at && fragments[k].id == id {
                let f = &fragments[k];
                mask |= 1 << (f.at as usize / PIXELS);
                layers.order.push((f.at, f.depth.to_bits(), id, layers.entries.len() as u32));
                k += 1;
            }
            let offset = center(mask, positions);
            layers.entries.push(Entry { id, at: at as u16, samples: mask as u16, offset, first: false });
        }
        layers
    }
    /// By draw and look; where each entry of a batch came from.
    fn batches(&self, place: &Place<'_>) -> Vec<(Batch, Vec<u32>)> {
        let mut groups: std::collections::BTreeMap<(u32, u32), (Batch, Vec<u32>)> = Default::default();
        for (k, e) in self.entries.iter().enumerate() {
            let r = &place.bins.records[(e.id >> 7) as usize];
            let (batch, members) = groups.entry((r.draw, r.look)).or_default();
            batch.entries.push(*e);
            members.push(k as u32);
        }
        groups.into_values().collect()
    }
    /// Far to near; at equal depth the lower source lies on top.
    pub fn sort(&mut self, place: &Place<'_>) {
        self.order.sort_by(|a, b| {
            (a.0, a.1).cmp(&(b.0, b.1)).then_with(|| place.comes_before(a.2, b.2).cmp(&place.comes_before(b.2, a.2)))
        });
    }
    /// Each layer over what is behind, in the order in which [`Layers::sort`] put them.
    pub fn compose(self, colors: &[[f32; 4]], to: &mut [[f32; 4]]) {
        for (at, _, _, k) in self.order {
            let c = colors[k as usize];
            let a = c[3].clamp(0.0, 1.0);
            let to = &mut to[at as usize];
            for i in 0..3 {
                to[i] = c[i] * a + to[i] * (1.0 - a);
            }
            to[3] = a + to[3] * (1.0 - a);
        }
    }
}

/// Composes layered fragments over what is solid. When there are too many at once, the far half of the depth
/// range goes first.
#[inline(always)]
fn compose<L: Lane>(
    l: L,
    pass: &Pass<'_>,
    view: &View,
    lights: &Lights<'_>,
    place: &Place<'_>,
    scratch: &mut Scratch,
    samples: usize,
    count: &mut Count,
) {
    let mut fragments = std::mem::take(&mut scratch.fragments);
    // The nearest range at the bottom.
    let mut ranges = vec![(f32::MIN_POSITIVE, f32::MAX)];
    while let Some((far, near)) = ranges.pop() {
        let (low, high) = (far.to_bits(), near.to_bits());
        let limit = if high - low <= 1 { usize::MAX } else { LAYERS };
        if !tile::layered(l, place, &scratch.depth, (far, near), limit, &mut fragments) {
            let middle = f32::from_bits(low + (high - low) / 2);
            ranges.push((middle, near));
            ranges.push((far, middle));
            continue;
        }
        let mut layers = Layers::new(&mut fragments, sample_positions(samples as u32));
        count.shaded += layers.entries.len() as u64;
        let mut colors = vec![[0.0f32; 4]; layers.entries.len()];
        for (batch, members) in layers.batches(place) {
            shade_batch(l, pass, view, lights, place, &batch, &mut scratch.shaded, None);
            for (k, &to) in members.iter().enumerate() {
                for (i, channel) in scratch.shaded.iter().enumerate() {
                    colors[to as usize][i] = channel[k];
                }
            }
        }
        layers.sort(place);
        layers.compose(&colors, &mut scratch.color);
    }
    scratch.fragments = fragments;
}

/// Averages samples, tone maps, encodes and writes the tile's pixels.
#[inline(always)]
pub(super) fn finish<L: Lane>(l: L, pass: &Pass<'_>, scratch: &mut Scratch, kept: usize, out: &mut Out<'_>) {
    let step = pass.supersample as usize;
    let side = TILE as usize / step;
    let one = l.f(1.0);
    // Rows of eight floats are read of which four count; one pixel of padding keeps the last in reach.
    scratch.color.push([0.0; 4]);
    let flat: &[f32] = bytemuck::cast_slice(&scratch.color);
    let mut sums = [[0.0f32; 8]; 16];
    for (y, row) in out.rows.iter_mut().enumerate() {
        let width = row.len() / pass.format.bytes();
        let mut x = 0;
        while x < width {
            let n = (width - x).min(L::WIDTH);
            let [r, g, b, a, ..] = if kept * step == 1 {
                l.transpose_from(
                    #[inline(always)]
                    |k| &flat[(y * side + x + k.min(n - 1)) * 4..],
                )
            } else {
                for k in 0..n {
                    sums[k] = averaged(&scratch.color, kept, step, x + k, y);
                }
                l.transpose8(&sums)
            };
            let light = Vec3::new(r, g, b);
            // Sums of sample weights may end a hair beside 1.
            let cover = a;
            let cover = one.or_else(cover.gt(l.f(1.0 - 1e-6)), cover);
            let none = cover.le(l.f(0.0));
            let light = light / one.or_else(none, cover);
            let color = if pass.format == Format::F32 { light } else { tone(pass.output.tone_map, light) };
            let (color, alpha) = match pass.output.background {
                Background::Transparent => (color.or_else(!none, Vec3::splat(l.f(0.0))), cover),
                Background::Color(b) => {
                    let behind = Vec3::from(b).lift(one);
                    let mixed = color * cover + behind * (one - cover);
                    (mixed.or_else(!none, behind), one)
                }
            };
            encode(l, pass, color.extend(alpha), &mut row[x * pass.format.bytes()..], n);
            x += L::WIDTH;
        }
    }
    for ((plane, rows), aov) in scratch.planes.iter().zip(&mut out.planes).zip(pass.aovs) {
        let channels = aov.channels().len();
        for (y, row) in rows.iter_mut().enumerate() {
            let width = row.len() / (4 * channels);
            for x in 0..width {
                // The sample in the middle of the pixel, or just right and below of it.
                let at = (y * step + step / 2) * TILE as usize + x * step + step / 2;
                for c in 0..channels {
                    let v = plane[at * channels + c];
                    row[(x * channels + c) * 4..][..4].copy_from_slice(&v.to_bits().to_ne_bytes());
                }
            }
        }
    }
}

/// The mean of a pixel's samples (and of the pixels that supersampling makes it from).
fn averaged(color: &[[f32; 4]], kept: usize, step: usize, x: usize, y: usize) -> [f32; 8] {
    let mut sum = [0.0f32; 8];
    for s in 0..kept {
        for dy in 0..step {
            for dx in 0..step {
                let c = color[s * PIXELS + (y * step + dy) * TILE as usize + x * step + dx];
                (0..4).for_each(|i| sum[i] += c[i]);
            }
        }
    }
    let share = 1.0 / (kept * step * step) as f32;
    sum.map(|v| v * share)
}

#[inline(always)]
pub(super) fn tone<N: Num>(curve: ToneMap, c: Vec3<N>) -> Vec3<N> {
    match curve {
        ToneMap::None => color::clamp(c),
        ToneMap::Aces => color::aces(c),
        ToneMap::Agx => color::agx(c),
        ToneMap::Reinhard => color::reinhard(c),
        ToneMap::KhronosNeutral => color::khronos_neutral(c),
    }
}

#[inline(always)]
fn encode<L: Lane>(l: L, pass: &Pass<'_>, c: Vec4<L::F>, row: &mut [u8], n: usize) {
    let srgb = pass.output.encode == Encoding::Srgb;
    match pass.format {
        Format::U8 => {
            let alpha = color::to_code(c.w, 255.0) << 24;
            let packed = code8(l, srgb, c.x) | code8(l, srgb, c.y) << 8 | code8(l, srgb, c.z) << 16 | alpha;
            for (k, pixel) in row.chunks_exact_mut(4).take(n).enumerate() {
                pixel.copy_from_slice(&packed.lane(k).to_le_bytes());
            }
        }
        Format::U16 => {
            let codes = [code16(srgb, c.x), code16(srgb, c.y), code16(srgb, c.z), color::to_code(c.w, 65535.0)];
            for (k, pixel) in row.chunks_exact_mut(8).take(n).enumerate() {
                for (i, code) in codes.iter().enumerate() {
                    pixel[2 * i..2 * i + 2].copy_from_slice(&(code.lane(k) as u16).to_ne_bytes());
                }
            }
        }
        Format::F32 => {
            for (k, pixel) in row.chunks_exact_mut(16).take(n).enumerate() {
                for (i, v) in c.array().into_iter().enumerate() {
                    pixel[4 * i..4 * i + 4].copy_from_slice(&clean(v.lane(k)).to_ne_bytes());
                }
            }
        }
    }
}

#[inline(always)]
fn code8<L: Lane>(l: L, srgb: bool, v: L::F) -> L::I {
    if srgb { color::linear_to_srgb8(l, v.saturate()) } else { color::to_code(v, 255.0) }
}

#[inline(always)]
fn code16<N: Num>(srgb: bool, v: N) -> N::Int {
    color::to_code(if srgb { color::linear_to_srgb(v.saturate()) } else { v }, 65535.0)
}

/// One NaN, no negative zero: files compare equal when their numbers do.
pub(super) fn clean(v: f32) -> f32 {
    if v.is_nan() {
        f32::NAN
    } else if v == 0.0 {
        0.0
    } else {
        v
    }
}
