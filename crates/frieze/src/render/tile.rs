//! One tile from its bins to its final pixels.

use super::point::{Corners, Group, Lanes, Triangle};
use super::{Pass, layer};
use crate::image::Encoding;
use crate::image::color;
use crate::math::lane::{Int, Kernel, Lane, Mask, Num};
use crate::math::vec::{Vec3, Vec4};
use crate::prepare::View;
use crate::raster::geometry::Class;
use crate::raster::tile::{self, Cut, Fragment, NOTHING, PIXELS, Place};
use crate::raster::{Bins, sample_positions};
use crate::render::Format;
use crate::scene::{Alpha, Background, ToneMap};
use crate::shade::{self, Lights, Silent};

/// Asks the alpha of masked materials while coverage is found.
pub(super) struct Holes<'a> {
    pub place: Place<'a>,
    pub pass: &'a Pass<'a>,
    pub view: &'a View,
}

impl<L: Lane> Cut<L> for Holes<'_> {
    #[inline(always)]
    fn keep(&mut self, l: L, ids: &[u32], px: L::F, py: L::F, mask: L::M) -> L::M {
        let group = group(self.pass, self.view, &self.place, ids[0]);
        let Alpha::Mask(cutoff) = group.look.alpha else { return mask };
        l.enter(
            #[inline(always)]
            || {
                let lanes = Lanes { ids, px, py, active: mask };
                let surface =
                    Corners::new(l, &group, &lanes, &mut [Triangle::NONE; MOST]).surface(l, &group, None, &lanes);
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
        planes: !pass.aovs.is_empty(),
    }
}

/// Something to shade: a triangle in a pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub id: u32,
    /// Pixel of the tile, see [`tile::index`].
    pub at: u16,
    /// Samples of the pixel that it covers, as bits.
    pub samples: u16,
    /// Where in the pixel it is shaded.
    pub offset: [f32; 2],
    /// Whether planes (AOVs) are its: it has the pixel's first covered sample.
    pub first: bool,
}

/// What is seen of one draw and one look.
#[derive(Debug, Default)]
pub(super) struct Batch {
    key: (u32, u32),
    /// Triangles of pixels that one triangle fills, the pixels, and how many they are. The rest is room, so that
    /// whole vectors can be read and written.
    ids: Vec<u32>,
    at: Vec<i32>,
    pub whole: usize,
    /// The others: edges and layers.
    pub entries: Vec<Entry>,
}

impl Batch {
    fn new(key: (u32, u32)) -> Self {
        Batch { key, ids: vec![0; PIXELS + MOST], at: vec![0; PIXELS + MOST], whole: 0, entries: Vec::new() }
    }
    #[inline(always)]
    fn push(&mut self, id: u32, at: usize) {
        self.ids[self.whole] = id;
        self.at[self.whole] = at as i32;
        self.whole += 1;
    }
    /// The pixels that one triangle fills, as entries.
    pub fn filled(&self) -> impl Iterator<Item = Entry> + '_ {
        let both = self.ids.iter().zip(&self.at).take(self.whole);
        both.map(|(&id, &at)| Entry { id, at: at as u16, samples: u16::MAX, offset: [0.5; 2], first: true })
    }
    /// How many surfaces it has.
    fn len(&self) -> usize {
        self.whole + self.entries.len()
    }
}

/// Most lanes of any level.
const MOST: usize = 16;

/// Memory of a tile, used again for the next.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    pub depth: Vec<f32>,
    pub id: Vec<u32>,
    pub batches: Vec<Batch>,
    pub used: usize,
    /// Premultiplied light and coverage per pixel, or per sample while layers are composed.
    pub color: Vec<[f32; 4]>,
    /// Pixels that several triangles share, or that none fills.
    edges: Vec<u16>,
    /// Final pixels, where nothing has to be averaged or composed.
    packed: Vec<u32>,
    pub shaded: [Vec<f32>; 4],
    pub fragments: Vec<Fragment>,
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
        let Contents { cuts, layers, single } = contents(&place);
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
        scratch.planes.resize_with(pass.aovs.len(), Vec::new);
        for (plane, aov) in scratch.planes.iter_mut().zip(pass.aovs) {
            plane.clear();
            plane.resize(PIXELS * aov.channels().len(), aov.nothing());
        }
        collect(l, &place, scratch, samples, single);
        let kept = if layers { samples } else { 1 };
        // Most pictures are made of bytes, and most of their pixels of one triangle: those are final once shaded.
        let direct = pass.format == Format::U8 && pass.supersample == 1 && !layers;
        if direct {
            let nothing = l.f(0.0);
            let empty = pixel8(l, pass, Vec3::splat(nothing), nothing).lane(0) as u32;
            scratch.packed.clear();
            scratch.packed.resize(PIXELS, empty);
            scratch.color.resize(PIXELS, [0.0; 4]);
            for &at in &scratch.edges {
                scratch.color[usize::from(at)] = [0.0; 4];
            }
        } else {
            scratch.color.clear();
            scratch.color.resize(PIXELS * kept, [0.0; 4]);
        }
        for k in 0..scratch.used {
            let batch = std::mem::take(&mut scratch.batches[k]);
            count.shaded += batch.len() as u64;
            let mut sink = Sink {
                shaded: &mut scratch.shaded,
                packed: direct.then_some(&mut scratch.packed),
                planes: Some(&mut scratch.planes),
            };
            let start = shade_batch(l, pass, view, &lights, &place, &batch, &mut sink);
            if !direct {
                fill(&batch, &scratch.shaded, &mut scratch.color, samples, kept);
            }
            spread(&batch, &scratch.shaded, start, &mut scratch.color, samples, kept);
            scratch.batches[k] = batch;
        }
        if layers {
            l.enter(
                #[inline(always)]
                || layer::compose(l, pass, view, &lights, &place, scratch, samples, &mut count),
            );
        }
        l.enter(
            #[inline(always)]
            || {
                if direct {
                    finish_direct(l, pass, scratch, &mut out);
                } else {
                    finish(l, pass, scratch, kept, &mut out);
                }
            },
        );
        finish_planes(pass, scratch, &mut out);
        count
    }
}

/// What kinds of triangles a tile has.
pub(super) struct Contents {
    pub cuts: bool,
    pub layers: bool,
    /// All solid ones are of one draw and one look.
    pub single: bool,
}

/// Looks through a tile's bins.
pub(super) fn contents(place: &Place<'_>) -> Contents {
    let mut found = Contents { cuts: false, layers: false, single: true };
    let mut key = None;
    for e in place.bins.tile(place.tile) {
        let record = if e.mask == 0 {
            place.bins.base(e.part) + place.bins.parts[e.part as usize].pieces[e.what as usize].record
        } else {
            e.what
        };
        let r = &place.bins.records[record as usize];
        match r.class {
            Class::Cut => found.cuts = true,
            Class::Layered => found.layers = true,
            _ => {}
        }
        found.single &= *key.get_or_insert((r.draw, r.look)) == (r.draw, r.look);
    }
    found
}

/// Sorts the visible samples of a tile by draw and look; `single`: there is one of them.
#[inline(always)]
pub(super) fn collect<L: Lane>(l: L, place: &Place<'_>, scratch: &mut Scratch, samples: usize, single: bool) {
    scratch.used = 0;
    scratch.edges.clear();
    let positions = sample_positions(samples as u32);
    let mut memo = (u32::MAX, 0usize);
    let ids = std::mem::take(&mut scratch.id);
    let signed: &[i32] = bytemuck::cast_slice(&ids);
    for first in (0..PIXELS).step_by(L::WIDTH) {
        let v = l.load_i(&signed[first..]);
        let mut same = l.mask(u32::MAX);
        for s in 1..samples {
            same = same & v.eq(l.load_i(&signed[s * PIXELS + first..]));
        }
        let lanes = u32::MAX >> (32 - L::WIDTH as u32);
        let seen = (!v.eq(l.i(NOTHING as i32)) & same).bits() & lanes;
        if seen != 0 {
            let lead = ids[first + seen.trailing_zeros() as usize];
            if memo.0 != lead >> 7 && !(single && memo.0 != u32::MAX) {
                memo = (lead >> 7, scratch.batch_of(place, lead));
            }
            let alike = single || ((v >> 7).eq(l.i(lead as i32 >> 7))).bits() & seen == seen;
            if alike && seen == lanes {
                let batch = &mut scratch.batches[memo.1];
                v.store(bytemuck::cast_slice_mut(&mut batch.ids[batch.whole..]));
                (l.ramp() + first as i32).store(&mut batch.at[batch.whole..]);
                batch.whole += L::WIDTH;
            } else {
                let mut left = seen;
                while left != 0 {
                    let at = first + left.trailing_zeros() as usize;
                    left &= left - 1;
                    if !alike && memo.0 != ids[at] >> 7 {
                        memo = (ids[at] >> 7, scratch.batch_of(place, ids[at]));
                    }
                    scratch.batches[memo.1].push(ids[at], at);
                }
            }
        }
        let mut left = !same.bits() & lanes;
        while left != 0 {
            let at = first + left.trailing_zeros() as usize;
            left &= left - 1;
            scratch.edges.push(at as u16);
            scratch.edge(place, &ids, at, positions, single);
        }
    }
    scratch.id = ids;
    // Where several meet in a pixel their light is summed in this order, however the tile was walked through.
    scratch.batches[..scratch.used].sort_unstable_by_key(|b| b.key);
    for batch in &mut scratch.batches[..scratch.used] {
        // Lanes beyond the last repeat it.
        if batch.whole > 0 {
            let (id, at) = (batch.ids[batch.whole - 1], batch.at[batch.whole - 1]);
            batch.ids[batch.whole..][..MOST].fill(id);
            batch.at[batch.whole..][..MOST].fill(at);
        }
    }
}

impl Scratch {
    /// Adds the triangles of a pixel that has several.
    fn edge(&mut self, place: &Place<'_>, ids: &[u32], at: usize, positions: &[[i32; 2]], single: bool) {
        let samples = positions.len();
        let mut left = (0..samples).fold(0u32, |m, s| m | u32::from(ids[s * PIXELS + at] != NOTHING) << s);
        let mut first = true;
        while left != 0 {
            let id = ids[left.trailing_zeros() as usize * PIXELS + at];
            let mask = (0..samples).fold(0u32, |m, s| m | u32::from(ids[s * PIXELS + at] == id) << s);
            left &= !mask;
            let batch = if single && self.used == 1 { 0 } else { self.batch_of(place, id) };
            let offset = if samples == 4 { CENTERS[mask as usize & 15] } else { center(mask, positions) };
            let entry = Entry { id, at: at as u16, samples: mask as u16, offset, first };
            self.batches[batch].entries.push(entry);
            first = false;
        }
    }
    /// The batch of a triangle's draw and look.
    fn batch_of(&mut self, place: &Place<'_>, id: u32) -> usize {
        let r = &place.bins.records[(id >> 7) as usize];
        let key = (r.draw, r.look);
        if let Some(k) = self.batches[..self.used].iter().position(|b| b.key == key) {
            return k;
        }
        if self.batches.len() == self.used {
            self.batches.push(Batch::new(key));
        }
        let batch = &mut self.batches[self.used];
        batch.key = key;
        batch.whole = 0;
        batch.entries.clear();
        self.used += 1;
        self.used - 1
    }
}

/// Where a triangle that covers these samples is shaded: the pixel's centre when it covers all, else the middle
/// of the samples that it does cover, which cannot lie outside of it.
pub(super) const fn center(mask: u32, positions: &[[i32; 2]]) -> [f32; 2] {
    if mask == 0 || mask.count_ones() as usize == positions.len() {
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

/// [`center`] of every mask of four samples.
static CENTERS: [[f32; 2]; 16] = {
    let mut all = [[0.5; 2]; 16];
    let mut mask = 0;
    while mask < 16 {
        all[mask] = center(mask as u32, sample_positions(4));
        mask += 1;
    }
    all
};

/// Where shaded surfaces go.
pub(super) struct Sink<'s> {
    /// Light and alpha: pixels that one triangle fills, then, from the next whole vector on, the entries.
    pub shaded: &'s mut [Vec<f32>; 4],
    /// Where pixels that one triangle fills go instead, encoded.
    pub packed: Option<&'s mut Vec<u32>>,
    pub planes: Option<&'s mut Vec<Vec<f32>>>,
}

/// Shades all of a batch. Returns where the entries begin in [`Sink::shaded`]. Entered once per level, from
/// wherever it is called: what is inlined below it is the largest part of the program.
#[inline(never)]
pub(super) fn shade_batch<L: Lane>(
    l: L,
    pass: &Pass<'_>,
    view: &View,
    lights: &Lights<'_>,
    place: &Place<'_>,
    batch: &Batch,
    sink: &mut Sink<'_>,
) -> usize {
    l.enter(
        #[inline(always)]
        || shade_vectors(l, pass, view, lights, place, batch, sink),
    )
}

#[inline(always)]
fn shade_vectors<L: Lane>(
    l: L,
    pass: &Pass<'_>,
    view: &View,
    lights: &Lights<'_>,
    place: &Place<'_>,
    batch: &Batch,
    sink: &mut Sink<'_>,
) -> usize {
    let start = batch.whole.next_multiple_of(L::WIDTH);
    let end = start + batch.entries.len();
    let kept = if sink.packed.is_some() { end - start } else { end };
    for s in sink.shaded.iter_mut() {
        if s.len() < kept.next_multiple_of(MOST) {
            s.resize(kept.next_multiple_of(MOST), 0.0);
        }
    }
    let base = if sink.packed.is_some() { start } else { 0 };
    if batch.len() == 0 {
        return start - base;
    }
    let group = group(pass, view, place, if batch.whole > 0 { batch.ids[0] } else { batch.entries[0].id });
    let (ox, oy) = Bins::origin(place.target, place.tile);
    let mut triangles = [Triangle::NONE; MOST];
    let mut own = ([0u32; MOST], [0i32; MOST]);
    let mut from = 0;
    while from < end {
        let entries = if from < start { &[][..] } else { &batch.entries[from - start..] };
        let entries = &entries[..entries.len().min(L::WIDTH)];
        let count = if from < start { (batch.whole - from).min(L::WIDTH) } else { entries.len() };
        let (ids, at) = if from < start {
            (&batch.ids[from..from + L::WIDTH], &batch.at[from..from + L::WIDTH])
        } else {
            for k in 0..L::WIDTH {
                let e = &entries[k.min(count - 1)];
                own.0[k] = e.id;
                own.1[k] = i32::from(e.at);
            }
            (&own.0[..L::WIDTH], &own.1[..L::WIDTH])
        };
        let (mut dx, mut dy) = (l.f(0.5), l.f(0.5));
        if from >= start {
            let offset = |axis: usize, k: usize| entries[k.min(entries.len() - 1)].offset[axis];
            dx = l.f_from(
                #[inline(always)]
                |k| offset(0, k),
            );
            dy = l.f_from(
                #[inline(always)]
                |k| offset(1, k),
            );
        }
        let (x, y) = tile::pixel(l.load_i(at));
        let px = (x + ox as i32).to_num() + dx;
        let py = (y + oy as i32).to_num() + dy;
        let active = l.mask(((1u64 << count) - 1) as u32);
        let lanes = Lanes { ids, px, py, active };
        let corners = Corners::new(l, &group, &lanes, &mut triangles);
        let surface = corners.surface(l, &group, Some(lights), &lanes);
        // Entered by itself: one function of both would take minutes to compile, and the surface that passes
        // through memory is a few per cent of what shading touches.
        let color = l.enter(
            #[inline(always)]
            || shade::shade(l, group.look, lights, &surface, &mut Silent),
        );
        if let Some(packed) = sink.packed.as_deref_mut().filter(|_| from < start) {
            let pixels = pixel8(l, pass, color.xyz(), l.f(1.0));
            if count == L::WIDTH && at[count - 1] - at[0] == count as i32 - 1 {
                pixels.store(bytemuck::cast_slice_mut(&mut packed[at[0] as usize..]));
            } else {
                for k in 0..count {
                    packed[at[k] as usize] = pixels.lane(k) as u32;
                }
            }
        } else {
            for (out, c) in sink.shaded.iter_mut().zip(color.array()) {
                c.store(&mut out[from - base..]);
            }
        }
        if let Some(planes) = sink.planes.as_deref_mut()
            && !planes.is_empty()
        {
            l.enter(
                #[inline(always)]
                || {
                    super::aov::write(l, pass, &group, place, &lanes, &corners, &surface, planes, |k| {
                        (k < count && entries.get(k).is_none_or(|e| e.first)).then(|| at[k] as usize)
                    });
                },
            );
        }
        from += L::WIDTH;
    }
    start - base
}

/// Writes what was shaded of pixels that one triangle fills.
fn fill(batch: &Batch, shaded: &[Vec<f32>; 4], color: &mut [[f32; 4]], samples: usize, kept: usize) {
    for (k, e) in batch.filled().enumerate() {
        add(&e, [shaded[0][k], shaded[1][k], shaded[2][k], shaded[3][k]], color, samples, kept);
    }
}

/// Adds shaded entries, which begin at `start`, to their pixels.
fn spread(batch: &Batch, shaded: &[Vec<f32>; 4], start: usize, color: &mut [[f32; 4]], samples: usize, kept: usize) {
    for (k, e) in batch.entries.iter().enumerate() {
        let k = start + k;
        add(e, [shaded[0][k], shaded[1][k], shaded[2][k], shaded[3][k]], color, samples, kept);
    }
}

/// Adds a shaded surface to its pixel, or writes it to the samples that it covers when each is `kept`.
#[inline(always)]
pub(super) fn add(e: &Entry, [r, g, b, _]: [f32; 4], color: &mut [[f32; 4]], samples: usize, kept: usize) {
    // A layer may not have alpha; what is solid is opaque.
    let c = [r, g, b, 1.0];
    let at = usize::from(e.at);
    let covered = e.samples.count_ones() as usize;
    if kept > 1 {
        for s in (0..kept).filter(|s| e.samples >> s & 1 != 0) {
            color[s * PIXELS + at] = c;
        }
    } else if covered >= samples {
        color[at] = c;
    } else {
        let weight = covered as f32 * (1.0 / samples as f32);
        for i in 0..4 {
            color[at][i] += c[i] * weight;
        }
    }
}

/// What a pixel shows: `light` is premultiplied by `cover`, the share of the pixel that anything covers.
#[inline(always)]
fn resolve<L: Lane>(l: L, pass: &Pass<'_>, light: Vec3<L::F>, cover: L::F) -> Vec4<L::F> {
    let one = l.f(1.0);
    // Sums of sample weights may end a hair beside 1.
    let cover = one.or_else(cover.gt(l.f(1.0 - 1e-6)), cover);
    let none = cover.le(l.f(0.0));
    let light = light / one.or_else(none, cover);
    let color = if pass.format == Format::F32 { light } else { tone(pass.output.tone_map, light) };
    match pass.output.background {
        Background::Transparent => color.or_else(!none, Vec3::splat(l.f(0.0))).extend(cover),
        Background::Color(b) => {
            let behind = Vec3::from(b).lift(one);
            let mixed = color * cover + behind * (one - cover);
            mixed.or_else(!none, behind).extend(one)
        }
    }
}

/// The four bytes of a pixel, red in the lowest.
#[inline(always)]
fn pixel8<L: Lane>(l: L, pass: &Pass<'_>, light: Vec3<L::F>, cover: L::F) -> L::I {
    let srgb = pass.output.encode == Encoding::Srgb;
    let c = resolve(l, pass, light, cover);
    let alpha = color::to_code(c.w, 255.0) << 24;
    code8(l, srgb, c.x) | code8(l, srgb, c.y) << 8 | code8(l, srgb, c.z) << 16 | alpha
}

/// Encodes pixels that several triangles share, and copies the tile to the picture.
#[inline(always)]
fn finish_direct<L: Lane>(l: L, pass: &Pass<'_>, scratch: &mut Scratch, out: &mut Out<'_>) {
    for edges in scratch.edges.chunks(L::WIDTH) {
        let [r, g, b, a] = l.transpose4_from(
            #[inline(always)]
            |k| &scratch.color[usize::from(edges[k.min(edges.len() - 1)])][..],
        );
        let pixels = pixel8(l, pass, Vec3::new(r, g, b), a);
        for (k, &at) in edges.iter().enumerate() {
            scratch.packed[usize::from(at)] = pixels.lane(k) as u32;
        }
    }
    if cfg!(target_endian = "big") {
        scratch.packed.iter_mut().for_each(|v| *v = v.swap_bytes());
    }
    for (y, row) in out.rows.iter_mut().enumerate() {
        tile::copy_row(bytemuck::cast_slice(&scratch.packed), y as u32, row);
    }
}

/// Averages samples, tone maps, encodes and writes the tile's pixels.
#[inline(always)]
pub(super) fn finish<L: Lane>(l: L, pass: &Pass<'_>, scratch: &mut Scratch, kept: usize, out: &mut Out<'_>) {
    let step = pass.supersample as usize;
    let mut sums = [[0.0f32; 4]; MOST];
    for (y, row) in out.rows.iter_mut().enumerate() {
        let width = row.len() / pass.format.bytes();
        let mut x = 0;
        while x < width {
            let n = (width - x).min(L::WIDTH);
            for k in 0..n {
                sums[k] = averaged(&scratch.color, kept, step, x + k, y);
            }
            let [r, g, b, a] = l.transpose4_from(
                #[inline(always)]
                |k| &sums[k][..],
            );
            let color = resolve(l, pass, Vec3::new(r, g, b), a);
            encode(l, pass, color, &mut row[x * pass.format.bytes()..], n);
            x += L::WIDTH;
        }
    }
}

fn finish_planes(pass: &Pass<'_>, scratch: &Scratch, out: &mut Out<'_>) {
    let step = pass.supersample as usize;
    for ((plane, rows), aov) in scratch.planes.iter().zip(&mut out.planes).zip(pass.aovs) {
        let channels = aov.channels().len();
        for (y, row) in rows.iter_mut().enumerate() {
            let width = row.len() / (4 * channels);
            for x in 0..width {
                // The sample in the middle of the pixel, or just right and below of it.
                let at = tile::index((x * step + step / 2) as u32, (y * step + step / 2) as u32);
                for c in 0..channels {
                    let v = plane[at * channels + c];
                    row[(x * channels + c) * 4..][..4].copy_from_slice(&v.to_bits().to_ne_bytes());
                }
            }
        }
    }
}

/// The mean of a pixel's samples (and of the pixels that supersampling makes it from).
fn averaged(color: &[[f32; 4]], kept: usize, step: usize, x: usize, y: usize) -> [f32; 4] {
    if kept * step == 1 {
        return color[tile::index(x as u32, y as u32)];
    }
    let mut sum = [0.0f32; 4];
    for s in 0..kept {
        for dy in 0..step {
            for dx in 0..step {
                let c = color[s * PIXELS + tile::index((x * step + dx) as u32, (y * step + dy) as u32)];
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
