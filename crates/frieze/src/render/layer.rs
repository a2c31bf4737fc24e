//! What blends: fragments in front of the solid surfaces, shaded, sorted and composed over them.

use super::Pass;
use super::tile::{Batch, Count, Entry, Scratch, Sink, center, shade_batch};
use crate::math::lane::Lane;
use crate::prepare::View;
use crate::raster::sample_positions;
use crate::raster::tile::{self, Fragment, PIXELS, Place};
use crate::shade::Lights;

/// Fragments of layered triangles that a tile holds at once; more are taken in depth ranges.
const LAYERS: usize = 1 << 19;

/// Layered fragments of a tile, ready to be shaded and composed.
#[derive(Default)]
pub(super) struct Layers {
    /// One per triangle and pixel.
    pub entries: Vec<Entry>,
    /// Place, bits of the depth, triangle, entry.
    pub order: Vec<(u32, u32, u32, u32)>,
}

impl Layers {
    pub fn new(fragments: &[Fragment], positions: &[[i32; 2]]) -> Self {
        let mut layers = Layers::default();
        if positions.len() == 1 {
            // Left in the order of triangles, so that neighbours have vertices and texels in common.
            let entry = |f: &Fragment| Entry { id: f.id, at: f.at as u16, samples: 1, offset: [0.5; 2], first: false };
            layers.entries.extend(fragments.iter().map(entry));
            layers.order.extend(fragments.iter().zip(0..).map(|(f, k)| (f.at, f.depth.to_bits(), f.id, k)));
            return layers;
        }
        let (mut sorted, starts) = by_place(fragments, PIXELS, |f| f.at as usize % PIXELS);
        for at in 0..PIXELS {
            let own = &mut sorted[starts[at] as usize..starts[at + 1] as usize];
            own.sort_unstable_by_key(|f| (f.id, f.at));
            for same in own.chunk_by(|a, b| a.id == b.id) {
                let mask = same.iter().fold(0u32, |m, f| m | 1 << (f.at as usize / PIXELS));
                let entry = layers.entries.len() as u32;
                layers.order.extend(same.iter().map(|f| (f.at, f.depth.to_bits(), f.id, entry)));
                let offset = center(mask, positions);
                layers.entries.push(Entry {
                    id: same[0].id,
                    at: at as u16,
                    samples: mask as u16,
                    offset,
                    first: false,
                });
            }
        }
        layers
    }
    /// The entries by draw and look; where each entry of a batch came from, unless they are all of one.
    fn batches(&mut self, place: &Place<'_>) -> Vec<(Batch, Option<Vec<u32>>)> {
        let key = |e: &Entry| {
            let r = &place.bins.records[(e.id >> 7) as usize];
            (r.draw, r.look)
        };
        let alike = |a: &Entry, b: &Entry| a.id >> 7 == b.id >> 7 || key(a) == key(b);
        if self.entries.is_sorted_by(alike) {
            let mut all = Batch::default();
            all.entries = std::mem::take(&mut self.entries);
            return vec![(all, None)];
        }
        let mut groups: std::collections::BTreeMap<(u32, u32), (Batch, Vec<u32>)> = Default::default();
        let mut first = 0;
        for run in self.entries.chunk_by(alike) {
            let (batch, members) = groups.entry(key(&run[0])).or_default();
            batch.entries.extend_from_slice(run);
            members.extend(first..first + run.len() as u32);
            first += run.len() as u32;
        }
        groups.into_values().map(|(batch, members)| (batch, Some(members))).collect()
    }
    /// Far to near; at equal depth the lower source lies on top.
    pub fn sort(&mut self, place: &Place<'_>) {
        let places = PIXELS * place.target.samples as usize;
        let (mut sorted, starts) = by_place(&self.order, places, |o| o.0 as usize);
        for pair in starts.windows(2) {
            sorted[pair[0] as usize..pair[1] as usize].sort_unstable_by(|a, b| {
                a.1.cmp(&b.1).then_with(|| place.comes_before(a.2, b.2).cmp(&place.comes_before(b.2, a.2)))
            });
        }
        self.order = sorted;
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

/// Sorts by a place below `places`, keeping the order of equal ones; where each place begins, and the end.
fn by_place<T: Copy>(items: &[T], places: usize, place: impl Fn(&T) -> usize) -> (Vec<T>, Vec<u32>) {
    let mut starts = vec![0u32; places + 1];
    items.iter().for_each(|item| starts[place(item) + 1] += 1);
    for k in 0..places {
        starts[k + 1] += starts[k];
    }
    let mut next = starts.clone();
    let mut sorted = items.to_vec();
    for item in items {
        let at = &mut next[place(item)];
        sorted[*at as usize] = *item;
        *at += 1;
    }
    (sorted, starts)
}

/// Composes layered fragments over what is solid. When there are too many at once, the far half of the depth
/// range goes first.
#[inline(always)]
pub(super) fn compose<L: Lane>(
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
        let mut layers = Layers::new(&fragments, sample_positions(samples as u32));
        count.shaded += layers.entries.len() as u64;
        let mut colors = vec![[0.0f32; 4]; layers.entries.len()];
        for (batch, members) in layers.batches(place) {
            let mut sink = Sink { shaded: &mut scratch.shaded, packed: None, planes: None };
            shade_batch(l, pass, view, lights, place, &batch, &mut sink);
            let [r, g, b, a] = &scratch.shaded;
            for k in 0..batch.entries.len() {
                let to = members.as_ref().map_or(k, |m| m[k] as usize);
                colors[to] = [r[k], g[k], b[k], a[k]];
            }
        }
        layers.sort(place);
        layers.compose(&colors, &mut scratch.color);
    }
    scratch.fragments = fragments;
}
