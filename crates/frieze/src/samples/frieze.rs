//! The showpiece: a fragment of a carved and painted architrave. Palmettes and lotus flowers on running scrolls
//! between an egg-and-dart moulding and a gilded meander, in raking light from the upper left.
//!
//! The relief is a height field: strokes (leaves, scrolls) of one period are drawn into a raster once, mouldings
//! are functions of place, and both are sampled by a grid that the broken ends bend back into the wall. Paint,
//! dirt in hollows and stains are vertex colours; tooling marks and pores are a normal map.

use super::{UP, noise, rotation, texture};
use crate::image::Encoding;
use crate::math::exact;
use crate::math::vec::{Mat4, Vec3, basis};
use crate::mesh::{Attribute, Mesh, shape, tangent};
use crate::scene::{
    Ambient, Background, Camera, Light, Material, Model, NormalMap, Object, Output, Scene, Shadow, Texture, ToneMap,
    View,
};
use rayon::prelude::*;

/// Height of the slab, metres.
const HEIGHT: f32 = 1.5;
/// Palmette to palmette.
const PERIOD: f32 = 1.0;
/// How far the slab reaches to the left and right of the middle.
const REACH: f32 = 2.02;
/// How deep the slab is.
const DEPTH: f32 = 0.4;
/// The carved band, and the band of the meander.
const BAND: [f32; 2] = [0.54, 1.22];
const KEY: [f32; 2] = [0.235, 0.485];

fn smoothstep(a: f32, b: f32, x: f32) -> f32 {
    let t = ((x - a) / (b - a)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn sin_cos(x: f32) -> (f32, f32) {
    let (s, c) = exact::sin_cos_f64(f64::from(x));
    (s as f32, c as f32)
}

/// A carved band along a line: points, and at each point half its width.
struct Stroke {
    points: Vec<([f32; 2], f32)>,
    /// Height above the ground along its crest.
    relief: f32,
    /// How deep its middle is gouged, 0 ..= 1.
    groove: f32,
}

/// A leaf that starts at `from` in direction `angle` (degrees from the vertical, to the right), `length` long, turns
/// by `bend` degrees on the way, and is at most `width` wide: `club`s are widest at their tips, others pointed.
fn leaf(from: [f32; 2], angle: f32, bend: f32, length: f32, width: f32, club: bool, relief: f32) -> Stroke {
    let n = 18;
    let mut p = from;
    let mut points = Vec::new();
    for k in 0..=n {
        let s = k as f32 / n as f32;
        let w = if club {
            0.22 + 0.78 * smoothstep(0.0, 0.92, s)
        } else {
            let (sin, _) = sin_cos(std::f32::consts::PI * (0.14 + 0.84 * s));
            sin.max(0.10)
        };
        points.push((p, width * w));
        let (dx, dy) = sin_cos((angle + bend * s * s).to_radians());
        p = [p[0] + dx * length / n as f32, p[1] + dy * length / n as f32];
    }
    Stroke { points, relief, groove: 0.55 }
}

/// An S of two volutes: out of `a` clockwise over its top, into `b` counter-clockwise from below.
fn scroll(a: [f32; 2], ra: f32, b: [f32; 2], rb: f32, width: f32) -> Stroke {
    let mut points = Vec::new();
    let turns = 2.1f32;
    let volute = |c: [f32; 2], r: f32, s: f32, up: f32| {
        // s runs from 0 at the eye to 1 where the scroll leaves, at the top (up = 1) or the bottom.
        let (sin, cos) = sin_cos((1.0 - s) * turns * std::f32::consts::TAU);
        let r = r * (0.20 + 0.80 * s);
        ([c[0] - up * sin * r, c[1] + up * cos * r], width * (0.55 + 0.45 * s))
    };
    let n = 56;
    points.extend((0..=n).map(|k| volute(a, ra, k as f32 / n as f32, 1.0)));
    let (p, q) = ([a[0], a[1] + ra], [b[0], b[1] - rb]);
    let reach = (q[0] - p[0]) * 0.55;
    for k in 1..16 {
        let t = k as f32 / 16.0;
        let s = 1.0 - t;
        let w = [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t];
        let x = w[0] * p[0] + w[1] * (p[0] + reach) + w[2] * (q[0] - reach) + w[3] * q[0];
        let y = (w[0] + w[1]) * p[1] + (w[2] + w[3]) * q[1];
        points.push(([x, y], width * 1.1));
    }
    points.extend((0..=n).rev().map(|k| volute(b, rb, k as f32 / n as f32, -1.0)));
    Stroke { points, relief: 0.046, groove: 0.5 }
}

const EYE_A: [f32; 2] = [0.125, 0.098];
const EYE_B: [f32; 2] = [0.375, 0.098];

/// The strokes of half a period: the palmette's axis at x = 0, the flower's at x = 0.5, y from the band's foot.
fn strokes() -> Vec<Stroke> {
    let mut all = vec![scroll(EYE_A, 0.075, EYE_B, 0.075, 0.0155)];
    // Palmette.
    let heart = [0.0, 0.175];
    for (angle, bend, length, width) in [
        (84.0, 52.0, 0.205, 0.033),
        (63.0, 50.0, 0.290, 0.038),
        (42.0, 42.0, 0.360, 0.044),
        (21.0, 28.0, 0.405, 0.048),
        (0.0, 0.0, 0.420, 0.050),
    ] {
        all.push(leaf(heart, angle, bend, length, width, true, 0.064));
    }
    all.push(Stroke { points: vec![([0.0, 0.165], 0.05), ([0.0, 0.185], 0.05)], relief: 0.068, groove: 0.25 });
    // Lotus.
    let cup = [0.5, 0.165];
    for (angle, bend, length, width) in
        [(-40.0, -70.0, 0.23, 0.036), (-30.0, -26.0, 0.33, 0.044), (-15.0, -6.0, 0.37, 0.036), (0.0, 0.0, 0.43, 0.054)]
    {
        all.push(leaf(cup, angle, bend, length, width, false, 0.060));
    }
    all.push(Stroke { points: vec![([0.5, 0.15], 0.045), ([0.5, 0.185], 0.034)], relief: 0.066, groove: 0.3 });
    // A tendril between, and a bud over it.
    all.push(leaf([0.250, 0.110], 14.0, -30.0, 0.20, 0.022, false, 0.040));
    let star = [0.268, 0.585];
    for k in 0..8 {
        let mut petal = leaf(star, k as f32 * 45.0, 0.0, 0.056, 0.017, true, 0.042);
        petal.groove = 0.3;
        all.push(petal);
    }
    all.push(Stroke { points: vec![(star, 0.019), ([star[0] + 0.001, star[1]], 0.019)], relief: 0.054, groove: 0.0 });
    all
}

/// Heights of one period, 0 where the ground is; texel (0, 0) at the palmette's axis and the band's foot.
struct Raster {
    width: usize,
    height: usize,
    texels: Vec<f32>,
}

impl Raster {
    const STEP: f32 = 0.002;

    fn new(strokes: &[Stroke]) -> Raster {
        let half = (PERIOD * 0.5 / Self::STEP) as usize;
        let height = ((BAND[1] - BAND[0]) / Self::STEP) as usize + 1;
        // Half a period; the other half is its mirror image. Row by row, each with the strokes that reach it.
        let mut texels = vec![0.0f32; (half + 1) * height];
        texels.par_chunks_mut(half + 1).enumerate().for_each(|(j, row)| {
            let y = j as f32 * Self::STEP;
            for s in strokes {
                let low = s.points.iter().map(|(p, w)| p[1] - w).fold(f32::MAX, f32::min);
                let high = s.points.iter().map(|(p, w)| p[1] + w).fold(f32::MIN, f32::max);
                if y < low || y > high {
                    continue;
                }
                // Distance in half widths, the least over all segments that this row can meet.
                let mut nearest = vec![1.0f32; half + 1];
                for pair in s.points.windows(2) {
                    let [(a, wa), (b, wb)] = [pair[0], pair[1]];
                    let w = wa.max(wb);
                    if y < a[1].min(b[1]) - w || y > a[1].max(b[1]) + w {
                        continue;
                    }
                    let from = ((a[0].min(b[0]) - w) / Self::STEP).floor().max(0.0) as usize;
                    let to = ((a[0].max(b[0]) + w) / Self::STEP).ceil().clamp(0.0, half as f32) as usize;
                    let d = [b[0] - a[0], b[1] - a[1]];
                    let l2 = (d[0] * d[0] + d[1] * d[1]).max(1e-12);
                    for i in from..=to.max(from).min(half) {
                        let q = [i as f32 * Self::STEP - a[0], y - a[1]];
                        let t = ((q[0] * d[0] + q[1] * d[1]) / l2).clamp(0.0, 1.0);
                        let e = [q[0] - d[0] * t, q[1] - d[1] * t];
                        let r = (e[0] * e[0] + e[1] * e[1]).sqrt() / (wa + (wb - wa) * t).max(1e-4);
                        nearest[i] = nearest[i].min(r);
                    }
                }
                for (h, r) in row.iter_mut().zip(nearest) {
                    if r < 1.0 {
                        // Round shoulders, and a gouge along the middle.
                        let dome = 1.0 - r * r * r * r;
                        let gouge = (1.0 - (r / 0.70) * (r / 0.70)).max(0.0);
                        *h = h.max(s.relief * (dome - s.groove * gouge * gouge));
                    }
                }
            }
        });
        Raster { width: half + 1, height, texels }
    }

    /// Bilinear; `x` in metres from any palmette's axis, `y` from the band's foot.
    fn at(&self, x: f32, y: f32) -> f32 {
        let x = x / PERIOD;
        let x = (x - (x + 0.5).floor()).abs() * PERIOD / Self::STEP;
        let y = (y / Self::STEP).clamp(0.0, (self.height - 1) as f32 - 1e-3);
        let x = x.min((self.width - 1) as f32 - 1e-3);
        let (i, j) = (x as usize, y as usize);
        let (fx, fy) = (x - i as f32, y - j as f32);
        let t = |i: usize, j: usize| self.texels[j * self.width + i];
        let low = t(i, j) + (t(i + 1, j) - t(i, j)) * fx;
        let high = t(i, j + 1) + (t(i + 1, j + 1) - t(i, j + 1)) * fx;
        low + (high - low) * fy
    }
}

/// Distance to the nearest multiple of `step`.
fn fold(x: f32, step: f32) -> f32 {
    let t = x / step;
    (t - (t + 0.5).floor()).abs() * step
}

/// The mouldings: how far the slab stands out at a place, without the carved band.
fn moulding(x: f32, y: f32) -> f32 {
    let round = |y: f32, c: f32, r: f32| (r * r - (y - c) * (y - c)).max(0.0).sqrt();
    let mut z: f32 = 0.0;
    // Foot: two fasciae and a bead-and-reel.
    z = z.max(0.085 * (1.0 - smoothstep(0.060, 0.068, y)));
    z = z.max(0.062 * (1.0 - smoothstep(0.125, 0.133, y)));
    if (0.13..0.205).contains(&y) {
        let c = 0.166;
        let u = fold(x, 0.1);
        let bead = 1.0 - (u / 0.033) * (u / 0.033) - ((y - c) / 0.028) * ((y - c) / 0.028);
        let v = (u - 0.0425).abs();
        let reel = if v < 0.0052 { round(y, c, 0.025) } else { round(y, c, 0.012) };
        z = z.max(0.018 + reel).max(0.018 + 0.030 * bead.max(0.0).sqrt());
    }
    for (low, high, out) in [(0.205, 0.230, 0.040), (0.490, 0.506, 0.030), (0.506, 0.540, 0.048), (1.220, 1.246, 0.055)]
    {
        z = z.max(out * smoothstep(low - 0.003, low + 0.003, y) * (1.0 - smoothstep(high - 0.003, high + 0.003, y)));
    }
    // Egg-and-dart on a quarter round.
    if y > 1.24 {
        let t = ((y - 1.246) / 0.120).clamp(0.0, 1.0);
        z = z.max(0.050 + 0.070 * (1.0 - (1.0 - t) * (1.0 - t)).sqrt());
        if y < 1.372 {
            let u = fold(x, 0.125);
            let e = ((u / 0.040) * (u / 0.040) + ((y - 1.322) / 0.058) * ((y - 1.322) / 0.058)).sqrt();
            let egg = (1.0 - e * e).max(0.0).sqrt() * 0.034;
            let shell = 0.016 * (1.0 - smoothstep(0.06, 0.15, (e - 1.30).abs()));
            let v = 0.0625 - u;
            let dart = 0.020 * (1.0 - smoothstep(0.004, 0.012, v + 0.010 * smoothstep(1.30, 1.25, y)));
            z += egg.max(shell).max(dart) - 0.012;
        }
    }
    // Crown.
    z = z.max(0.150 * smoothstep(1.368, 1.374, y));
    z.max(0.150 * smoothstep(1.368, 1.374, y) + 0.022 * smoothstep(1.425, 1.470, y))
}

/// Where the broken ends are, at a height.
fn ends(y: f32) -> [f32; 2] {
    let rough = |seed| 0.16 * (noise::fbm(y * 2.6 + 3.0, 0.5, 64, 5, seed) - 0.5);
    [-1.78 - 0.10 * y + rough(41), REACH - 0.22 * (y - 0.5) * (y - 0.2) + rough(43)]
}

/// The slab with its colours.
fn slab() -> Mesh {
    let raster = Raster::new(&strokes());
    // Columns and rows of the front, and of the sides that go back into the wall.
    let (nx, ny, back) = (820usize, 245usize, 7usize);
    let width = nx + 1 + 2 * back;
    struct Place {
        p: [f32; 3],
        relief: f32,
    }
    // The carved band has more rows for its height than the rest.
    let rows: Vec<f32> = (0..=ny)
        .map(|j| {
            let t = j as f32 / ny as f32;
            let knots = [(0.0, 0.0), (0.24, BAND[0]), (0.84, BAND[1]), (1.0, HEIGHT)];
            let k = knots.windows(2).position(|w| t <= w[1].0).unwrap_or(2);
            let ((a, y0), (b, y1)) = (knots[k], knots[k + 1]);
            y0 + (y1 - y0) * (t - a) / (b - a)
        })
        .collect();
    let place = |i: usize, j: usize| {
        let y = rows[j];
        let [left, right] = ends(y);
        let s = (i as f32 - back as f32) / nx as f32;
        let x = left + (right - left) * s.clamp(0.0, 1.0);
        let wear = noise::fbm(x * 3.0 + 40.0, y * 3.0, 256, 3, 51);
        // Where the surface has flaked off, relief is lower and rounder.
        let flaked = smoothstep(0.66, 0.80, noise::fbm(x * 1.6 + 17.0, y * 1.6 + 5.0, 128, 5, 53));
        let relief = if y > BAND[0] && y < BAND[1] { raster.at(x, y - BAND[0]) } else { 0.0 };
        let z = moulding(x, y).max(relief) * (1.0 - 0.55 * flaked);
        let fine = noise::fbm(x * 24.0 + 900.0, y * 24.0, 4096, 3, 57) - 0.5;
        let z = z + (wear - 0.5) * 0.008 + fine * 0.0035 - 0.006 * flaked;
        // How far behind the front: 0 on it, 1 at the wall.
        let behind = if s < 0.0 { -s } else { (s - 1.0).max(0.0) } * nx as f32 / back as f32;
        if behind > 0.0 {
            let lump = noise::fbm(y * 9.0, behind * 3.0 + 7.0, 64, 4, 61) - 0.5;
            let side = if s < 0.0 { -1.0 } else { 1.0 };
            let z = z + (-DEPTH - z) * behind;
            return Place { p: [x + side * (0.05 * behind + 0.10 * lump * (0.3 + behind)), y, z], relief: 0.0 };
        }
        Place { p: [x, y, z], relief }
    };
    let places: Vec<Place> = (0..width * (ny + 1)).into_par_iter().map(|k| place(k % width, k / width)).collect();

    // Hollows: how much lower a place is than its neighbourhood, by box means over rows and columns.
    let mean = |v: &[f32], stride: usize, n: usize, lines: usize, line: usize, r: usize| {
        let mut out = vec![0.0f32; v.len()];
        for l in 0..lines {
            let at = |k: usize| l * line + k * stride;
            let mut sum: f64 = (0..r.min(n)).map(|k| f64::from(v[at(k)])).sum();
            let mut count = r.min(n);
            for k in 0..n {
                if k + r < n {
                    sum += f64::from(v[at(k + r)]);
                    count += 1;
                }
                if k > r {
                    sum -= f64::from(v[at(k - r - 1)]);
                    count -= 1;
                }
                out[at(k)] = (sum / count as f64) as f32;
            }
        }
        out
    };
    let z: Vec<f32> = places.iter().map(|q| q.p[2].max(-0.05)).collect();
    let blur = |r: usize| mean(&mean(&z, 1, width, ny + 1, width, r), width, ny + 1, width, 1, r);
    let (near, far) = (blur(3), blur(10));

    let colors: Vec<[f32; 4]> = places
        .par_iter()
        .enumerate()
        .map(|(k, q)| {
            let [x, y, z] = q.p;
            let tone = noise::fbm(x * 2.2 + 30.0, y * 2.2, 256, 5, 71);
            let streak = noise::fbm(x * 9.0 + 200.0, y * 0.9, 1024, 4, 73);
            let mix = |a: [f32; 3], b: [f32; 3], t: f32| core::array::from_fn(|c| a[c] + (b[c] - a[c]) * t);
            let mut color: [f32; 3] = mix([0.70, 0.60, 0.46], [0.58, 0.47, 0.35], smoothstep(0.35, 0.7, tone));
            color = mix(color, [0.36, 0.31, 0.26], 0.5 * smoothstep(0.54, 0.80, streak));
            // Paint on the grounds, worn where the noise is high.
            let front = z > -0.03;
            let worn = smoothstep(0.50, 0.70, noise::fbm(x * 5.0 + 70.0, y * 5.0, 512, 5, 77));
            let paint = 0.92 - 0.55 * worn;
            if front && y > BAND[0] && y < BAND[1] {
                let ground = 1.0 - smoothstep(0.004, 0.016, q.relief);
                color = mix(color, [0.030, 0.085, 0.165], paint * ground);
            }
            if front && y > KEY[0] - 0.005 && y < KEY[1] + 0.005 {
                color = mix(color, [0.165, 0.030, 0.020], paint);
            }
            let hollow = ((near[k] - z) * 18.0).clamp(0.0, 0.55) + ((far[k] - z) * 6.0).clamp(0.0, 0.4);
            let polish = ((z - near[k]) * 10.0).clamp(0.0, 0.2);
            let shade = (1.0 - hollow).max(0.25) * (1.0 + polish);
            [color[0] * shade, color[1] * shade, color[2] * shade, 1.0]
        })
        .collect();

    // Rows and columns of the top and bottom: their edge again, back at the wall.
    let total = ny + 1 + 2;
    let index = |i: usize, j: usize| (j.clamp(1, total - 2) - 1) * width + i;
    let position = |i: usize, j: usize| {
        let mut p = places[index(i, j)].p;
        if j == 0 || j == total - 1 {
            p[2] = -DEPTH;
        }
        p
    };
    let mut mesh = shape::grid([width - 1, total - 1], [false; 2], |i, j| {
        let at = |i: usize, j: usize| Vec3::from(position(i, j));
        let du = at((i + 1).min(width - 1), j) - at(i.saturating_sub(1), j);
        let dv = at(i, (j + 1).min(total - 1)) - at(i, j.saturating_sub(1));
        let n = du.cross(dv).normalize();
        let n = if n.length2() > 0.5 { n } else { Vec3::new(0.0, 0.0, 1.0) };
        let p = position(i, j);
        let round = if i < back || i > width - 1 - back { p[2] } else { 0.0 };
        shape::Point {
            position: p,
            normal: n.array(),
            uv: [(p[0] + if i < back { round } else { -round }) / 0.8, (HEIGHT - p[1]) / 0.8],
        }
    });
    // Diagonals run along edges of the relief, not across them, or leaves would be notched.
    if let Some(uv) = mesh.uv[0].as_mut().and_then(|uv| uv.index.as_mut()) {
        let quads = mesh.corners.chunks_exact_mut(6).zip(uv.chunks_exact_mut(6));
        for (corners, uv) in quads {
            let [a, b, c, d] = [0, 1, 2, 5].map(|k| mesh.positions[corners[k] as usize][2]);
            if corners[0] == corners[3] && corners[2] == corners[4] && (a - c).abs() > (b - d).abs() {
                for q in [corners, uv] {
                    let [a, b, c, d] = [q[0], q[1], q[2], q[5]];
                    q.copy_from_slice(&[b, c, d, b, d, a]);
                }
            }
        }
    }
    let normals = mesh.normals.as_ref().expect("the grid has normals");
    let values = (0..width * total).map(|k| colors[index(k % width, k / width)]).collect();
    mesh.colors = Some(Attribute::per_position(values));
    // u grows along the rows.
    let tangents = (0..width * total).into_par_iter().map(|k| {
        let (i, j) = (k % width, k / width);
        let du = Vec3::from(position((i + 1).min(width - 1), j)) - position(i.saturating_sub(1), j).into();
        let n = Vec3::from(normals.values[k]);
        let t = tangent::gram_schmidt(du, n).unwrap_or_else(|| basis(n).0);
        t.extend(1.0).array()
    });
    mesh.tangents = Some(Attribute::per_position(tangents.collect()));
    mesh.name = "slab".into();
    mesh
}

/// The meander: bars of gilded bronze on axis-parallel lines, mitred.
fn meander() -> Mesh {
    let mut lines: Vec<Vec<[f32; 2]>> = Vec::new();
    let unit = PERIOD / 4.0;
    let (gx, gy) = (unit / 5.0, (KEY[1] - KEY[0] - 0.07) / 4.0);
    let y0 = KEY[0] + 0.035;
    let count = 15;
    let left = -(count as f32) * 0.5 * unit;
    for k in 0..count {
        let x = left + k as f32 * unit;
        let shape = [[0.0, 0.0], [0.0, 4.0], [3.85, 4.0], [3.85, 1.35], [1.35, 1.35], [1.35, 2.7], [2.5, 2.7]];
        lines.push(shape.map(|[a, b]| [x + a * gx, y0 + b * gy]).to_vec());
    }
    lines.push(vec![[left - 0.0095, y0], [left + count as f32 * unit + 0.04, y0]]);
    // Half of the section, from the foot to the crown: distance from the line, height.
    let section =
        [[-0.0125, -0.006], [-0.0110, 0.0105], [-0.0060, 0.0150], [0.0060, 0.0150], [0.0110, 0.0105], [0.0125, -0.006]];
    let facing = [[-0.98, 0.2], [-0.80, 0.60], [-0.25, 0.97], [0.25, 0.97], [0.80, 0.60], [0.98, 0.2]];
    let mut mesh = Mesh { name: "meander".into(), ..Default::default() };
    let (mut normals, mut uv) = (Vec::new(), Vec::new());
    for line in &lines {
        for k in 0..line.len() - 1 {
            let (a, b) = (Vec3::new(line[k][0], line[k][1], 0.0), Vec3::new(line[k + 1][0], line[k + 1][1], 0.0));
            let d = (b - a).normalize();
            let side = Vec3::new(d.y, -d.x, 0.0);
            let turn = |from: [f32; 2], at: [f32; 2], to: [f32; 2]| {
                // +1 for a right angle to the right, -1 to the left.
                let (p, q) = ([at[0] - from[0], at[1] - from[1]], [to[0] - at[0], to[1] - at[1]]);
                -(p[0] * q[1] - p[1] * q[0]).signum()
            };
            let before = if k > 0 { turn(line[k - 1], line[k], line[k + 1]) } else { 0.0 };
            let after = if k + 2 < line.len() { turn(line[k], line[k + 1], line[k + 2]) } else { 0.0 };
            let base = mesh.positions.len() as u32;
            for (end, mitre) in [(a, before), (b, -after)] {
                for (s, f) in section.iter().zip(facing) {
                    let p = end + side * s[0] + d * (s[0] * mitre) + Vec3::new(0.0, 0.0, s[1]);
                    mesh.positions.push(p.array());
                    normals.push((side * f[0] + Vec3::new(0.0, 0.0, f[1])).normalize().array());
                    uv.push([p.x / 0.8, (HEIGHT - p.y) / 0.8]);
                }
            }
            let n = section.len() as u32;
            for c in 0..n - 1 {
                let (p, q) = (base + c, base + n + c);
                mesh.corners.extend([p, p + 1, q + 1, p, q + 1, q]);
            }
            // Blunt ends.
            for (first, open) in [(base, before == 0.0), (base + n, after == 0.0)] {
                for c in 1..n - 1 {
                    if open {
                        let t = [first, first + c, first + c + 1];
                        mesh.corners.extend(if first == base { [t[0], t[2], t[1]] } else { t });
                    }
                }
            }
        }
    }
    mesh.normals = Some(Attribute::per_position(normals));
    mesh.uv[0] = Some(Attribute::per_position(uv));
    mesh
}

/// Pores and the marks of a toothed chisel, tileable; 0.8 m of stone.
fn stone(n: usize) -> (Vec<f32>, Vec<f32>) {
    let grain = noise::fractal(n, 81, 6, 16);
    let bend = noise::fractal(n, 83, 3, 6);
    let tooled = noise::fractal(n, 87, 3, 4);
    let pores = noise::fractal(n, 89, 2, 128);
    let porous = noise::fractal(n, 91, 3, 8);
    let heights = (0..n * n)
        .into_par_iter()
        .map(|k| {
            let (u, v) = ((k % n) as f32 / n as f32, (k / n) as f32 / n as f32);
            // Parallel scores, leaning; whole numbers of them fit the tile.
            let score = u * 52.0 + v * 37.0 + bend[k] * 3.0;
            let score = (score - score.floor() - 0.5).abs() * 2.0;
            let pore = smoothstep(0.66, 0.82, pores[k]) * smoothstep(0.45, 0.7, porous[k]);
            grain[k] * 4.0 + smoothstep(0.42, 0.66, tooled[k]) * score * 1.3 - pore * 2.0
        })
        .collect();
    (grain, heights)
}

pub(super) fn scene() -> Scene {
    let mut scene = Scene::default();
    let n = 1024;
    let (grain, heights) = stone(n);
    let albedo = texture::rgb(n, n, Encoding::Srgb, |x, y| {
        let g = 0.90 + 0.22 * (grain[y * n + x] - 0.5);
        [g, g * 0.995, g * 0.985]
    });
    let albedo = Texture::new(scene.add_image(albedo));
    let normal = Texture::new(scene.add_image(texture::normal_map(n, n, &heights, 1.0)));
    let relief = |scale: f32| NormalMap { texture: normal.clone(), scale, y_down: false, channels: 3 };
    let stone = scene.add_material(Material {
        name: "limestone".into(),
        model: Model::Pbr,
        roughness: 0.78,
        albedo_map: Some(albedo),
        normal_map: Some(relief(0.55)),
        ..Default::default()
    });
    let gilt = scene.add_material(Material {
        name: "gilded bronze".into(),
        model: Model::Pbr,
        albedo: [1.0, 0.63, 0.22],
        metallic: 1.0,
        roughness: 0.40,
        normal_map: Some(relief(0.12)),
        double_sided: true,
        ..Default::default()
    });
    let plaster = scene.add_material(Material {
        name: "wall".into(),
        model: Model::Pbr,
        albedo: [0.040, 0.038, 0.037],
        roughness: 0.9,
        normal_map: Some(relief(0.3)),
        ..Default::default()
    });
    scene.add(slab(), Mat4::IDENTITY, stone);
    scene.add(meander(), Mat4::IDENTITY, gilt);
    let wall = scene.add(
        shape::plane(14.0, 1),
        Mat4::translation(Vec3::new(0.0, HEIGHT * 0.5, -DEPTH)).times(&rotation(Vec3::new(1.0, 0.0, 0.0), 90.0)),
        plaster,
    );
    if let Some(uv) = &mut scene.meshes[scene.objects[wall].mesh].uv[0] {
        uv.values.iter_mut().for_each(|v| *v = v.map(|x| x * 8.0));
    }
    // Gilded eyes of the scrolls.
    let eye = scene.meshes.len();
    scene.meshes.push(Mesh { name: "eye".into(), ..shape::sphere(0.040, 24) });
    for k in -2i32..=2 {
        for x in [-EYE_B[0], -EYE_A[0], EYE_A[0], EYE_B[0]] {
            let x = k as f32 * PERIOD + x;
            if x.abs() < REACH - 0.12 {
                scene.objects.push(Object {
                    name: "eye".into(),
                    mesh: eye,
                    transform: Mat4::translation(Vec3::new(x, BAND[0] + EYE_A[1], 0.030)),
                    materials: vec![gilt],
                });
            }
        }
    }

    let camera = Camera::look_at(Vec3::new(-1.50, 0.60, 3.10), Vec3::new(-0.08, 0.735, 0.0), UP, 30.5);
    scene.cameras.push(Camera { near: 0.2, ..camera });
    scene.view = View::Camera(0);
    let middle = Vec3::new(0.0, 0.75, 0.0);
    scene.lights.push(Light {
        name: "key".into(),
        color: [1.0, 0.86, 0.66],
        intensity: 5.2,
        shadow: Some(Shadow { size: 4096, ..Default::default() }),
        ..Light::directional(middle + Vec3::new(-3.4, 3.0, 2.1), middle)
    });
    scene.lights.push(Light {
        name: "fill".into(),
        color: [0.55, 0.72, 1.0],
        intensity: 0.55,
        shadow: None,
        ..Light::directional(middle + Vec3::new(2.5, 0.4, 3.0), middle)
    });
    // Grazes the gilding from below, as the floor of a lit room would.
    scene.lights.push(Light {
        name: "bounce".into(),
        color: [1.0, 0.80, 0.55],
        intensity: 0.55,
        shadow: None,
        ..Light::directional(middle + Vec3::new(1.2, -2.4, 2.0), middle)
    });
    scene.ambient = Ambient { color: [0.075, 0.082, 0.10], per_light: false };
    scene.output = Output {
        size: [1600, 900],
        background: Background::Color([0.004, 0.004, 0.005]),
        tone_map: ToneMap::KhronosNeutral,
        ..Default::default()
    };
    scene
}
