//! What neighbouring texels tell: which way green points, and whether opposite edges meet.

use super::survey::{Reading, says};
use super::{Green, Tiles, ramp};
use crate::error::Result;
use crate::image::{Image, Pixels};
use crate::job::Job;
use rayon::prelude::*;

/// Steepest slope that counts: 76 degrees. Beyond, rounding speaks, not the surface.
const STEEPEST: f32 = 4.0;

/// The slope of the height to the right, and downwards if green points up.
fn slope(v: [f32; 3]) -> [f32; 2] {
    if !says(v) || v[2] <= -0.2 {
        return [0.0; 2];
    }
    let r = 1.0 / v[2].max(0.1);
    [(-v[0] * r).clamp(-STEEPEST, STEEPEST), (v[1] * r).clamp(-STEEPEST, STEEPEST)]
}

/// Cells of 4x4 places are taken for independent of one another.
const CELL: usize = 4;
/// Rows of a strip that one thread takes; a multiple of [`CELL`].
const STRIP: usize = 32;

/// Blocks along each side of a map: what happens in one says little about the next.
const BLOCKS: usize = 8;

/// Sums over the places of a level between four texels each: `a = dp/dy`, `b = dq/dx`.
#[derive(Clone, Debug)]
struct Sums {
    aa: f64,
    bb: f64,
    /// Sum of `a b` of each block.
    ab: [f64; BLOCKS * BLOCKS],
    /// Sum of the votes, from -1 to 1 each, of the cells of each block that move by more than rounding does.
    votes: [f64; BLOCKS * BLOCKS],
    /// The weights of these votes, all together.
    weights: f64,
}

impl Sums {
    fn new() -> Sums {
        Sums { aa: 0.0, bb: 0.0, ab: [0.0; BLOCKS * BLOCKS], votes: [0.0; BLOCKS * BLOCKS], weights: 0.0 }
    }
    fn add(&mut self, o: &Sums) {
        self.aa += o.aa;
        self.bb += o.bb;
        self.weights += o.weights;
        for k in 0..BLOCKS * BLOCKS {
            self.ab[k] += o.ab[k];
            self.votes[k] += o.votes[k];
        }
    }
    /// The correlation of `a` and `b`, and its distance from 0 in standard deviations between blocks.
    fn correlation(&self) -> (f64, f64) {
        mean(&self.ab, (self.aa * self.bb).sqrt())
    }
    /// The same of the votes.
    fn vote(&self) -> (f64, f64) {
        mean(&self.votes, self.weights)
    }
}

fn mean(blocks: &[f64], weight: f64) -> (f64, f64) {
    let (sum, squares) = blocks.iter().fold((0.0, 0.0), |(s, q), v| (s + v, q + v * v));
    if weight > 0.0 && squares > 0.0 { (sum / weight, sum / squares.sqrt()) } else { (0.0, 0.0) }
}

/// A level as it is cut into blocks: its size, and the first row of a strip.
#[derive(Clone, Copy)]
struct Level {
    w: usize,
    h: usize,
    first: usize,
    /// The square of what rounding adds to `a` or `b`.
    floor: f32,
}

/// The sums of a strip: `places` rows, each with one below it in `rows`.
fn strip(rows: &[[f32; 2]], places: usize, level: Level) -> Sums {
    let Level { w, h, first, floor } = level;
    let mut s = Sums::new();
    let cells = (w - 1).div_ceil(CELL);
    let mut sums = vec![[0.0f32; 3]; cells];
    for y0 in (0..places).step_by(CELL) {
        sums.fill([0.0; 3]);
        let y1 = (y0 + CELL).min(places);
        for y in y0..y1 {
            let (up, low) = (&rows[y * w..(y + 1) * w], &rows[(y + 1) * w..(y + 2) * w]);
            for (c, sum) in sums.iter_mut().enumerate() {
                for x in c * CELL..((c + 1) * CELL).min(w - 1) {
                    let a = (low[x][0] - up[x][0]) + (low[x + 1][0] - up[x + 1][0]);
                    let b = (up[x + 1][1] - up[x][1]) + (low[x + 1][1] - low[x][1]);
                    *sum = [sum[0] + a * a, sum[1] + b * b, sum[2] + a * b];
                }
            }
        }
        let row = (first + y0) * BLOCKS / h * BLOCKS;
        for (c, &[aa, bb, ab]) in sums.iter().enumerate() {
            let n = ((y1 - y0) * (((c + 1) * CELL).min(w - 1) - c * CELL)) as f32;
            let least = aa.min(bb) / n;
            if least <= floor {
                continue;
            }
            let block = row + c * CELL * BLOCKS / w;
            s.aa += f64::from(aa);
            s.bb += f64::from(bb);
            s.ab[block] += f64::from(ab);
            let weight = f64::from(least / (least + 4.0 * floor));
            s.votes[block] += weight * f64::from(ab / (aa * bb).sqrt());
            s.weights += weight;
        }
    }
    s
}

/// Means of 2x2 slopes: the slopes of the mean heights, so what has no curl keeps having none.
fn halve(rows: &[[f32; 2]], w: usize, h: usize) -> Vec<[f32; 2]> {
    let mut out = Vec::with_capacity((w / 2) * (h / 2));
    for y in 0..h / 2 {
        let (up, low) = (&rows[2 * y * w..(2 * y + 1) * w], &rows[(2 * y + 1) * w..(2 * y + 2) * w]);
        for x in 0..w / 2 {
            out.push([0, 1].map(|k| 0.25 * (up[2 * x][k] + up[2 * x + 1][k] + low[2 * x][k] + low[2 * x + 1][k])));
        }
    }
    out
}

/// The sums of all levels, the finest first.
fn levels(image: &Image, reading: &Reading, job: &Job) -> Result<Vec<Sums>> {
    // Rounding to codes of this size moves a slope by up to half of it, and four slopes make a difference.
    let step = match image.pixels() {
        Pixels::U8(_) => 2.0f32 / 255.0,
        Pixels::U16(_) => 2.0 / 65535.0,
        Pixels::F16(_) => 1.0 / 1024.0,
        Pixels::F32(_) => 2.0 / 65535.0,
    };
    let floor = |level: usize| step * step * [0.7, 0.5, 0.35, 0.25, 0.18, 0.12][level];
    let (w, h) = (image.width() as usize, image.height() as usize);
    if w < 4 || h < 4 {
        return Ok(Vec::new());
    }
    // The half-size level and its like.
    let _room = job.reserve(w as u64 * h as u64 * 4, "slopes of the normal map")?;
    let parts: Vec<(Sums, Vec<[f32; 2]>)> = job.run(|| {
        (0..h.div_ceil(STRIP))
            .into_par_iter()
            .map(|k| {
                let (first, last) = (k * STRIP, ((k + 1) * STRIP).min(h));
                let below = (last + 1).min(h);
                let mut slopes = Vec::with_capacity((below - first) * w);
                let mut row = Vec::new();
                for y in first..below {
                    reading.row(image, y as u32, &mut row);
                    slopes.extend(row.iter().map(|v| slope(*v)));
                }
                (
                    strip(&slopes, below - first - 1, Level { w, h, first, floor: floor(0) }),
                    halve(&slopes, w, last - first),
                )
            })
            .collect()
    });
    job.check()?;
    let mut all = vec![Sums::new()];
    let mut next = Vec::with_capacity((w / 2) * (h / 2));
    for (sums, half) in parts {
        all[0].add(&sums);
        next.extend(half);
    }
    let (mut w, mut h) = (w / 2, h / 2);
    while w >= 8 && h >= 8 && all.len() < 6 {
        all.push(strip(&next, h - 1, Level { w, h, first: 0, floor: floor(all.len()) }));
        next = halve(&next, w, h);
        (w, h) = (w / 2, h / 2);
    }
    Ok(all)
}

/// Which way green points.
///
/// Each cell of each level votes with the correlation of its own `dp/dy` and `dq/dx`, so that a cliff (where slopes
/// are clipped or missing) is one voice among many. The level that is most sure speaks; levels that say the opposite
/// take away from it.
pub(crate) fn green(image: &Image, reading: &Reading, job: &Job) -> Result<Green> {
    let mut best = Green::unknown();
    // The strongest word for up and for down.
    let mut strength = [0.0f64; 2];
    for (k, s) in levels(image, reading, job)?.iter().enumerate() {
        let (vote, t) = s.vote();
        let (rho, steady) = s.correlation();
        // Blocks that agree; or nearly all that moves agrees, be it in one place only.
        let votes = vote.abs() * t.abs() + NEARLY_ALL * ramp(vote.abs(), 0.7, 0.95);
        // One bump on noisy ground: few cells know, but they know it well.
        let energy = if vote * rho > 0.0 {
            0.6 * rho.abs() * steady.abs() + NEARLY_ALL * ramp(rho.abs(), 0.85, 0.98)
        } else {
            0.0
        };
        let score = votes.max(energy);
        let side = usize::from(vote < 0.0);
        if score > strength[0].max(strength[1]) {
            best = Green {
                value: ["up", "down"][side],
                correlation: vote as f32,
                significance: t as f32,
                scale: 1 << k,
                ..best
            };
        }
        strength[side] = strength[side].max(score);
    }
    let most = strength[0].max(strength[1]);
    if most == 0.0 {
        return Ok(best);
    }
    let net = (strength[0] - strength[1]).abs();
    best.confidence = (ramp(net, -0.5, 2.0) * (0.5 + 0.5 * ramp(net / most, 0.0, 0.6))).min(0.995) as f32;
    if best.confidence < UNDECIDED {
        best.value = "unknown";
    }
    Ok(best)
}

/// What it counts that nearly everything agrees.
const NEARLY_ALL: f64 = 3.0;
/// Below this confidence no direction is named.
const UNDECIDED: f32 = 0.55;

/// Whether opposite edges meet: the step across, against the steps between neighbours inside.
pub(crate) fn tiles(image: &Image, reading: &Reading, job: &Job) -> Result<Tiles> {
    job.check()?;
    let (w, h) = (image.width() as usize, image.height() as usize);
    let mut out = Tiles { value: "unknown", confidence: 0.0, step: [0.0; 2] };
    if w < 8 || h < 8 {
        return Ok(out);
    }
    let apart =
        |a: [f32; 3], b: [f32; 3]| -> f64 { (0..3).map(|k| f64::from(a[k] - b[k]) * f64::from(a[k] - b[k])).sum() };
    // A few hundred rows tell about columns, and a few hundred columns about rows.
    let (rows, columns) = (h.div_ceil(512), w.div_ceil(512));
    let mut across = vec![0.0f64; w];
    let mut down = vec![0.0f64; h];
    let (mut row, mut last, mut first) = (Vec::new(), Vec::new(), Vec::new());
    reading.row(image, h as u32 - 1, &mut last);
    for y in 0..h {
        reading.row(image, y as u32, &mut row);
        if y % rows == 0 {
            for x in 0..w {
                across[x] += apart(row[x], row[if x == 0 { w - 1 } else { x - 1 }]);
            }
        }
        for x in (0..w).step_by(columns) {
            down[y] += apart(row[x], last[x]);
        }
        if y == 0 {
            first.clone_from(&row);
        }
        std::mem::swap(&mut row, &mut last);
    }
    let mut seams = [0.0f64; 2];
    for (k, steps) in [&across, &down].into_iter().enumerate() {
        let inside = steps[1..].iter().fold(0.0, |m: f64, v| m.max(*v));
        // Steps below two codes of 8 bits per texel are no seam to anyone.
        let floor = 2.0
            * (2.0f64 / 255.0)
            * (2.0 / 255.0)
            * (if k == 0 { h.div_ceil(rows) } else { w.div_ceil(columns) }) as f64;
        out.step[k] = (steps[0] / inside.max(floor)) as f32;
        seams[k] = ramp(f64::from(out.step[k]), 0.9, 1.8);
    }
    let seam = seams.map(|s| s > 0.5);
    (out.value, out.confidence) = match seam {
        [true, true] => ("seam-xy", seams[0].min(seams[1]) as f32),
        [true, false] => ("seam-x", seams[0] as f32),
        [false, true] => ("seam-y", seams[1] as f32),
        _ => ("tiles", (1.0 - seams[0].max(seams[1])) as f32),
    };
    Ok(out)
}
