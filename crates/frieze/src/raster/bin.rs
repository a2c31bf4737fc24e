//! What touches which tile.

use super::geometry::{Class, Draw, Geometry, Process, Record};
use super::{TILE, Target};
use crate::math::lane::Level;
use rayon::prelude::*;

/// Clusters per independent run: fixed, so that threads don't matter.
const RUN: usize = 128;

/// All geometry of a view, sorted into tiles.
#[derive(Debug)]
pub struct Bins {
    /// The runs.
    pub parts: Vec<Geometry>,
    /// All records; an id is `record * 128 + triangle`.
    pub records: Vec<Record>,
    /// For each tile, where its entries begin.
    starts: Vec<u32>,
    entries: Vec<Entry>,
    /// First record of each part.
    bases: Vec<u32>,
}

/// Triangles that may touch a tile.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Which part, for pieces.
    pub part: u32,
    /// Record of [`Bins::records`], or piece of the part when the mask is 0.
    pub what: u32,
    /// Triangles as bits.
    pub mask: u128,
}

impl Bins {
    /// Processes all draws of a view. `spare` gives memory of earlier views back.
    pub fn new(level: Level, target: &Target, draws: &[Draw<'_>], spare: &std::sync::Mutex<Vec<Geometry>>) -> Self {
        let mut runs = Vec::new();
        for (number, draw) in draws.iter().enumerate() {
            let count = draw.mesh.meshlets.len();
            if draw.slots.iter().any(|s| s.class != Class::Hidden) {
                runs.extend((0..count).step_by(RUN).map(|k| (number as u32, k..(k + RUN).min(count))));
            }
        }
        let mut parts: Vec<Geometry> = runs
            .into_par_iter()
            .with_max_len(1)
            .map(|(number, range)| {
                let mut out = spare.lock().ok().and_then(|mut s| s.pop()).unwrap_or_default();
                out.clear();
                let draw = &draws[number as usize];
                level.run(Process { target, draw, number, range, out: &mut out });
                out
            })
            .collect();
        let (across, down) = target.tiles();
        let mut starts = vec![0u32; (across * down + 1) as usize];
        let mut records = Vec::with_capacity(parts.iter().map(|p| p.records.len()).sum());
        let mut bases = Vec::with_capacity(parts.len());
        for (k, part) in parts.iter_mut().enumerate() {
            bases.push(records.len() as u32);
            records.extend(part.records.iter().map(|r| Record { part: k as u32, ..*r }));
            for bin in &part.bins {
                starts[bin.tile as usize + 1] += 1;
            }
        }
        for k in 1..starts.len() {
            starts[k] += starts[k - 1];
        }
        let empty = Entry { part: 0, what: 0, mask: 0 };
        let mut entries = vec![empty; starts.last().map_or(0, |&n| n as usize)];
        let mut next = starts.clone();
        for (k, part) in parts.iter().enumerate() {
            for bin in &part.bins {
                let what = if bin.mask == 0 { bin.what } else { bin.what + bases[k] };
                let at = &mut next[bin.tile as usize];
                entries[*at as usize] = Entry { part: k as u32, what, mask: bin.mask };
                *at += 1;
            }
        }
        Bins { parts, records, starts, entries, bases }
    }
    /// What may touch a tile, in source order of runs.
    pub fn tile(&self, tile: u32) -> &[Entry] {
        &self.entries[self.starts[tile as usize] as usize..self.starts[tile as usize + 1] as usize]
    }
    /// First record of a part.
    pub fn base(&self, part: u32) -> u32 {
        self.bases[part as usize]
    }
    /// A counter, summed.
    pub fn sum(&self, f: impl Fn(&Geometry) -> u64) -> u64 {
        self.parts.iter().map(f).sum()
    }
    /// Upper left pixel of a tile.
    pub fn origin(target: &Target, tile: u32) -> (u32, u32) {
        let across = target.tiles().0;
        (tile % across * TILE, tile / across * TILE)
    }
}
