//! Normals into heights: the height field whose slopes come nearest to those of a normal map, in the sense of least
//! squares (a Poisson equation), found without iteration. Tiles by the Hartley transform (periodic), others by the cosine
//! transform (no flow across the edges): both make the equation diagonal.
//!
//! The slope between two texels is found from the slopes at four of them, with an error of `11/720 k^4` for a wave of k
//! radians per texel; the mean of two (as T. Simchony, R. Chellappa and M. Shao 1990 have it) is off by `k^2 / 12`.

use super::convert::Normals;
use super::fft::{Real, get, put};
use super::slope::Edges;
use crate::error::Result;
use crate::job::{Job, Reservation};
use crate::math::exact::sin_cos_f64;
use crate::math::lane::{Kernel, Lane, Level, Num};
use rayon::prelude::*;
use std::f64::consts::PI;

/// The steepest slope that a normal may stand for: one that lies in the surface has no slope at all.
const STEEPEST: f32 = 100.0;

/// Heights in texels, row after row; their mean is 0.
pub struct Heights {
    /// `height` rows of `pitch` numbers, of which the first `width` count.
    pub values: Vec<f32>,
    /// Numbers from one row to the next.
    pub pitch: usize,
    /// Texels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The memory of the values.
    _held: Reservation,
}

impl Heights {
    /// Row `y`.
    pub fn row(&self, y: usize) -> &[f32] {
        &self.values[y * self.pitch..y * self.pitch + self.width]
    }
}

/// Everything that the passes share.
struct Solver<'a> {
    normals: &'a Normals<'a>,
    edges: Edges,
    width: usize,
    height: usize,
    /// Half of them, rounded up: sequence k goes with k + half.
    halves: [usize; 2],
    pitch: usize,
    along_x: Real,
    along_y: Real,
    /// Eigenvalues of the second difference, per column and per row.
    lambda: [Vec<f32>; 2],
}

/// The eigenvalues `2 - 2 cos` of the second difference.
fn eigenvalues(n: usize, periodic: bool, room: usize) -> Vec<f32> {
    let mut all: Vec<f32> = (0..n)
        .map(|k| {
            let s = sin_cos_f64(PI * k as f64 / n as f64 / if periodic { 1.0 } else { 2.0 }).0;
            (4.0 * s * s) as f32
        })
        .collect();
    all.resize(room, 1.0);
    all
}

/// The height field of a normal map.
///
/// # Errors
/// `job.memory`, `job.interrupted`.
pub fn integrate(normals: &Normals, edges: Edges, job: &Job, level: Level) -> Result<Heights> {
    let (width, height) = normals.size();
    let halves = [width.div_ceil(2), height.div_ceil(2)];
    // Whole vectors are read from each half and written to the end.
    let pitch = (halves[0] + halves[0].next_multiple_of(16)).max(width.next_multiple_of(16));
    let periodic = edges == Edges::Wrap;
    let lanes = level.run(Lanes);
    let strips = halves[0].div_ceil(lanes);
    let equations = format_args!("the equations of a map of {width}x{height}");
    let held = job.reserve(4 * (pitch * height) as u64, equations)?;
    let _held = job.reserve(4 * (strips * 2 * lanes * height) as u64, equations)?;
    let solver = Solver {
        normals,
        edges,
        width,
        height,
        halves,
        pitch,
        along_x: Real::new(width, periodic),
        along_y: Real::new(height, periodic),
        lambda: [eigenvalues(width, periodic, pitch), eigenvalues(height, periodic, height)],
    };
    let buffers = |r: &Real| (vec![0.0f32; r.buffer(lanes)], vec![0.0f32; r.buffer(lanes)]);
    let mut first = vec![0.0f32; pitch * height];
    let mut second = vec![0.0f32; strips * 2 * lanes * height];
    // Rows there.
    job.run(|| {
        let (upper, lower) = first.split_at_mut(halves[1] * pitch);
        // The lower half may be one row shorter.
        let mut low: Vec<&mut [f32]> = lower.chunks_mut(lanes * pitch).collect();
        low.resize_with(halves[1].div_ceil(lanes), || &mut []);
        upper.par_chunks_mut(lanes * pitch).zip(low).enumerate().for_each_init(
            || (buffers(&solver.along_x), Lines::default()),
            |((x, other), lines), (g, (upper, lower))| {
                if !job.is_cancelled() {
                    level.run(There { solver: &solver, y: g * lanes, upper, lower, x, other, lines });
                }
            },
        );
    });
    job.check()?;
    job.progress("integrate", 1, 3);
    // Columns there, divided, and back.
    job.run(|| {
        second.par_chunks_mut(2 * lanes * height).enumerate().for_each_init(
            || buffers(&solver.along_y),
            |(x, other), (s, out)| {
                if !job.is_cancelled() {
                    level.run(Columns { solver: &solver, column: s * lanes, rows: &first, out, x, other });
                }
            },
        );
    });
    job.check()?;
    job.progress("integrate", 2, 3);
    // Rows back.
    job.run(|| {
        let (upper, lower) = first.split_at_mut(halves[1] * pitch);
        let mut low: Vec<&mut [f32]> = lower.chunks_mut(lanes * pitch).collect();
        low.resize_with(halves[1].div_ceil(lanes), || &mut []);
        upper.par_chunks_mut(lanes * pitch).zip(low).enumerate().for_each_init(
            || buffers(&solver.along_x),
            |(x, other), (g, (upper, lower))| {
                if !job.is_cancelled() {
                    level.run(Back { solver: &solver, y: g * lanes, strips: &second, upper, lower, x, other });
                }
            },
        );
    });
    job.check()?;
    job.progress("integrate", 3, 3);
    Ok(Heights { values: first, pitch, width, height, _held: held })
}

struct Lanes;
impl Kernel for Lanes {
    type Out = usize;
    #[inline(always)]
    fn run<L: Lane>(self, _: L) -> usize {
        L::WIDTH
    }
}

/// Slopes and divergences of the rows that a group of lanes works on.
#[derive(Default)]
struct Lines {
    normals: [Vec<f32>; 3],
    /// Along x and down y, of the rows of a group and two on each side.
    slopes: Vec<[Vec<f32>; 2]>,
    /// Of the upper, then of the lower rows.
    divergence: Vec<Vec<f32>>,
}

/// What lies between two of `n` texels in a line, `i` and `i + 1`: the weights of the slopes around it and where they lie
/// (relative to `i`). None flows across the edges of what is no tile.
fn between(i: isize, n: usize, edges: Edges) -> ([f32; 4], isize) {
    const FOUR: [f32; 4] = [-1.0 / 24.0, 13.0 / 24.0, 13.0 / 24.0, -1.0 / 24.0];
    let last = n as isize - 2;
    match edges {
        Edges::Wrap => (FOUR, -1),
        Edges::Extend if i < 0 || i > last => ([0.0; 4], 0),
        Edges::Extend if n == 2 => ([0.5, 0.5, 0.0, 0.0], 0),
        Edges::Extend if i == 0 => ([5.0 / 12.0, 8.0 / 12.0, -1.0 / 12.0, 0.0], 0),
        Edges::Extend if i == last => ([0.0, -1.0 / 12.0, 8.0 / 12.0, 5.0 / 12.0], -2),
        Edges::Extend => (FOUR, -1),
    }
}

impl Solver<'_> {
    /// The divergence, negative, of rows `y ..  y + count`, into `lines.divergence[at ..]`.
    #[inline(always)]
    fn divergence<L: Lane>(&self, l: L, y: usize, count: usize, at: usize, lines: &mut Lines) {
        let (w, h) = (self.width, self.height);
        let room = w.next_multiple_of(16);
        // Two texels on each side along x, too.
        lines.normals.iter_mut().for_each(|n| n.resize(room, 0.0));
        if lines.slopes.len() < count + 4 {
            lines.slopes.resize_with(count + 4, || [vec![0.0; room + 4], vec![0.0; room]]);
        }
        for k in 0..count + 4 {
            let row = (y + k) as isize - 2;
            let row = if self.edges == Edges::Wrap {
                row.rem_euclid(h as isize) as usize
            } else {
                row.clamp(0, h as isize - 1) as usize
            };
            self.normals.fill(l, row, &mut lines.normals);
            let [x_slope, y_slope] = &mut lines.slopes[k];
            let [nx, ny, nz] = &lines.normals;
            for x in (0..room).step_by(L::WIDTH) {
                let z = l.load(&nz[x..]).max(l.f(1.0 / STEEPEST));
                // z falls along x where n leans to +x; green is up, rows run down.
                (-l.load(&nx[x..]) / z).store(&mut x_slope[2 + x..]);
                (l.load(&ny[x..]) / z).store(&mut y_slope[x..]);
            }
            if self.edges == Edges::Wrap {
                let at = |i: isize| x_slope[2 + i.rem_euclid(w as isize) as usize];
                let (a, b, c, d) = (at(-2), at(-1), at(w as isize), at(w as isize + 1));
                (x_slope[0], x_slope[1], x_slope[2 + w], x_slope[3 + w]) = (a, b, c, d);
            }
        }
        while lines.divergence.len() < at + count {
            lines.divergence.push(vec![0.0; room]);
        }
        for k in 0..count {
            let row = (y + k) as isize;
            let (below, from) = between(row, h, self.edges);
            let (above, from_above) = between(row - 1, h, self.edges);
            let slopes = &lines.slopes;
            // Rows around the edge below, and the one above; beyond the map a weight is 0, whatever is read.
            let line = |from: isize, j: usize| {
                &slopes[(k as isize + 2 + from + j as isize).clamp(0, count as isize + 3) as usize][1]
            };
            let out = &mut lines.divergence[at + k];
            let gx = &slopes[k + 2][0];
            for x in (0..room).step_by(L::WIDTH) {
                let mut f = l.f(0.0);
                for j in 0..4 {
                    f = f + l.load(&line(from_above - 1, j)[x..]) * above[j];
                }
                for j in 0..4 {
                    f = f - l.load(&line(from, j)[x..]) * below[j];
                }
                f.store(&mut out[x..]);
            }
            let flow = |i: isize| {
                let (weights, from) = between(i, w, self.edges);
                let mut sum = 0.0;
                for j in 0..4 {
                    let at = (2 + i + from + j as isize).clamp(0, gx.len() as isize - 1) as usize;
                    sum += gx[at] * weights[j];
                }
                sum
            };
            // Near the edges one by one, inside side by side.
            let inside = if w > 6 { 2..w - 3 } else { 0..0 };
            for x in (0..inside.start).chain(inside.end..w) {
                out[x] += flow(x as isize - 1) - flow(x as isize);
            }
            // F(x - 1/2) - F(x + 1/2) with four slopes each.
            const D: [f32; 5] = [-1.0 / 24.0, 14.0 / 24.0, 0.0, -14.0 / 24.0, 1.0 / 24.0];
            let mut x = inside.start;
            while x + L::WIDTH <= inside.end {
                let v = (l.load(&gx[x..]) - l.load(&gx[x + 4..])) * D[0]
                    + (l.load(&gx[x + 1..]) - l.load(&gx[x + 3..])) * D[1];
                (l.load(&out[x..]) + v).store(&mut out[x..]);
                x += L::WIDTH;
            }
            while x < inside.end {
                out[x] += (gx[x] - gx[x + 4]) * D[0] + (gx[x + 1] - gx[x + 3]) * D[1];
                x += 1;
            }
        }
    }
}

/// Copies numbers that come in vectors across rows, `WIDTH` of them, into the rows: `rows(k)` gets the numbers of lane k of
/// `values(0), values(1), ...`, side by side.
#[inline(always)]
fn scatter<L: Lane>(l: L, count: usize, rows: &mut [f32], pitch: usize, values: impl Fn(usize) -> L::F) {
    let mut block = [[0.0f32; 16]; 16];
    let there = rows.len() / pitch;
    for from in (0..count).step_by(L::WIDTH) {
        let n = L::WIDTH.min(count - from);
        if L::WIDTH == 1 {
            rows[from] = values(from).lane(0);
            continue;
        }
        for k in 0..n {
            values(from + k).store(&mut block[k]);
        }
        // What is written beyond a row's end may stand beside its last number as the other half of a pair.
        block[n..].fill([0.0; 16]);
        for c in (0..L::WIDTH).step_by(8) {
            let columns = l.transpose_from(
                #[inline(always)]
                |k| &block[k][c..],
            );
            for (k, v) in columns.into_iter().enumerate().filter(|(k, _)| c + k < there) {
                v.store(&mut rows[(c + k) * pitch + from..]);
            }
        }
    }
}

struct There<'a> {
    solver: &'a Solver<'a>,
    y: usize,
    upper: &'a mut [f32],
    lower: &'a mut [f32],
    x: &'a mut Vec<f32>,
    other: &'a mut Vec<f32>,
    lines: &'a mut Lines,
}

impl Kernel for There<'_> {
    type Out = ();
    #[inline(always)]
    fn run<L: Lane>(self, l: L) {
        let There { solver: s, y, upper, lower, x, other, lines } = self;
        let real = &s.along_x;
        let counts = [upper.len() / s.pitch, lower.len() / s.pitch];
        let room = s.width.next_multiple_of(16);
        lines.divergence.iter_mut().for_each(|d| d.fill(0.0));
        while lines.divergence.len() < 2 * L::WIDTH {
            lines.divergence.push(vec![0.0; room]);
        }
        for (half, count) in counts.into_iter().enumerate().filter(|(_, count)| *count > 0) {
            l.enter(
                #[inline(always)]
                || s.divergence(l, y + half * s.halves[1], count, half * L::WIDTH, lines),
            );
        }
        let (a, b) = lines.divergence.split_at(L::WIDTH);
        for from in (0..s.width).step_by(8) {
            let columns = [a, b].map(|rows| {
                l.transpose_from(
                    #[inline(always)]
                    |k| &rows[k][from..],
                )
            });
            for k in 0..8.min(s.width - from) {
                put::<L>(x, real.slot(from + k), (columns[0][k], columns[1][k]));
            }
        }
        l.enter(
            #[inline(always)]
            || real.plan().run(l, x, other),
        );
        real.after(l, x);
        scatter(l, s.width, upper, s.pitch, |k| get(l, x, k).0);
        if !lower.is_empty() {
            scatter(l, s.width, lower, s.pitch, |k| get(l, x, k).1);
        }
    }
}

struct Columns<'a> {
    solver: &'a Solver<'a>,
    column: usize,
    rows: &'a [f32],
    out: &'a mut [f32],
    x: &'a mut Vec<f32>,
    other: &'a mut Vec<f32>,
}

impl Kernel for Columns<'_> {
    type Out = ();
    #[inline(always)]
    fn run<L: Lane>(self, l: L) {
        let Columns { solver: s, column, rows, out, x, other } = self;
        let real = &s.along_y;
        let second = column + s.halves[0];
        for y in 0..s.height {
            let row = &rows[y * s.pitch..(y + 1) * s.pitch];
            put::<L>(x, real.slot(y), (l.load(&row[column..]), l.load(&row[second..])));
        }
        let (a, b) = (l.load(&s.lambda[0][column..]), l.load(&s.lambda[0][second..]));
        // What both ways make larger.
        let norm = (1.0 / (s.width as f64 * s.height as f64)) as f32;
        for way in 0..2 {
            l.enter(
                #[inline(always)]
                || real.plan().run(l, x, other),
            );
            if way == 0 || s.edges == Edges::Wrap {
                real.after(l, x);
            }
            if way == 0 {
                for (k, lambda) in s.lambda[1].iter().enumerate() {
                    let (p, q) = get(l, x, k);
                    let (d, e) = (a + *lambda, b + *lambda);
                    // Only the mean has none: it stays 0.
                    let (fine, fine2) = (d.gt(l.f(0.0)), e.gt(l.f(0.0)));
                    let zero = l.f(0.0);
                    let p = (p * norm / d).or_else(fine, zero);
                    let q = (q * norm / e).or_else(fine2, zero);
                    put::<L>(x, k, (p, q));
                }
                real.before(l, x);
            }
        }
        for (y, out) in out.chunks_exact_mut(2 * L::WIDTH).enumerate() {
            let (p, q) = real.back(l, x, real.slot(y));
            p.store(out);
            q.store(&mut out[L::WIDTH..]);
        }
    }
}

struct Back<'a> {
    solver: &'a Solver<'a>,
    y: usize,
    strips: &'a [f32],
    upper: &'a mut [f32],
    lower: &'a mut [f32],
    x: &'a mut Vec<f32>,
    other: &'a mut Vec<f32>,
}

impl Kernel for Back<'_> {
    type Out = ();
    #[inline(always)]
    fn run<L: Lane>(self, l: L) {
        let Back { solver: s, y, strips, upper, lower, x, other } = self;
        let real = &s.along_x;
        let (half, last) = (s.halves[0], s.height - 1);
        let size = 2 * L::WIDTH;
        for (strip, numbers) in strips.chunks_exact(size * s.height).enumerate() {
            // Rows beyond the map stand in for nothing.
            let at = |row: usize| &numbers[row.min(last) * size..(row.min(last) + 1) * size];
            for part in 0..2 {
                let first = part * half + strip * L::WIDTH;
                let end = if part == 0 { half } else { s.width };
                for c in (0..L::WIDTH).step_by(8) {
                    let from = part * L::WIDTH + c;
                    let mut both = [[l.f(0.0); 8]; 2];
                    for (k, out) in both.iter_mut().enumerate() {
                        let y = y + k * s.halves[1];
                        if L::WIDTH == 1 {
                            out[0] = l.load(&at(y)[from..]);
                        } else {
                            *out = l.transpose_from(
                                #[inline(always)]
                                |k| &at(y + k)[from..],
                            );
                        }
                    }
                    for k in 0..8.min(L::WIDTH) {
                        let column = first + c + k;
                        if column < end {
                            put::<L>(x, column, (both[0][k], both[1][k]));
                        }
                    }
                }
            }
        }
        real.before(l, x);
        l.enter(
            #[inline(always)]
            || real.plan().run(l, x, other),
        );
        if s.edges == Edges::Wrap {
            real.after(l, x);
        }
        scatter(l, s.width, upper, s.pitch, |k| real.back(l, x, real.slot(k)).0);
        if !lower.is_empty() {
            scatter(l, s.width, lower, s.pitch, |k| real.back(l, x, real.slot(k)).1);
        }
    }
}
