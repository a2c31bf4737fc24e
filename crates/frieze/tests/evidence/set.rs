//! A labelled set of normal maps, made by code: families of surfaces, ways to take slopes, conventions, damages.
//! Thresholds were chosen with the families that are not `held_out`; those that are only judge.

use frieze::image::{Encoding, Image, Pixels};
use frieze::math::exact;
use frieze::math::sample::hash;

/// What is wrong with a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Damage {
    None,
    Srgb,
    Decoded,
    TwoChannels,
    Neutral127,
    Short,
    Steep,
    Averaged,
    Lossy,
    Cropped,
}

pub const DAMAGES: [Damage; 10] = [
    Damage::None,
    Damage::Srgb,
    Damage::Decoded,
    Damage::TwoChannels,
    Damage::Neutral127,
    Damage::Short,
    Damage::Steep,
    Damage::Averaged,
    Damage::Lossy,
    Damage::Cropped,
];

/// How slopes are taken from heights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kernel {
    Central,
    Sobel,
    Forward,
    /// Of the function, not of the texels.
    Analytic,
}

/// A family of surfaces.
#[derive(Clone, Copy, Debug)]
pub struct Family {
    pub name: &'static str,
    pub held_out: bool,
    /// Whether the texels can tell which way green points.
    pub decidable: bool,
    height: fn(f64, f64, u32) -> f64,
}

pub const FAMILIES: [Family; 16] = [
    Family { name: "brick", held_out: false, decidable: true, height: brick },
    Family { name: "noise", held_out: false, decidable: true, height: noise },
    Family { name: "dents", held_out: false, decidable: true, height: dents },
    Family { name: "weave", held_out: false, decidable: true, height: weave },
    Family { name: "sparse", held_out: false, decidable: true, height: sparse },
    Family { name: "grooves-x", held_out: false, decidable: false, height: grooves_x },
    Family { name: "ripple-sum", held_out: false, decidable: false, height: ripple_sum },
    Family { name: "panels", held_out: true, decidable: true, height: panels },
    Family { name: "sculpt", held_out: true, decidable: true, height: sculpt },
    Family { name: "roof", held_out: true, decidable: true, height: roof },
    Family { name: "diagonal", held_out: true, decidable: true, height: diagonal },
    Family { name: "cells", held_out: true, decidable: true, height: cells },
    Family { name: "grain", held_out: true, decidable: true, height: grain },
    Family { name: "rivet", held_out: true, decidable: true, height: rivet },
    Family { name: "text", held_out: true, decidable: true, height: text },
    Family { name: "grooves-y", held_out: true, decidable: false, height: grooves_y },
];

/// A map and what is true of it.
#[derive(Clone, Debug)]
pub struct Case {
    pub family: Family,
    pub kernel: Kernel,
    pub damage: Damage,
    pub y_down: bool,
    pub bits: u8,
    pub size: (u32, u32),
    pub seed: u32,
    pub image: Image,
}

fn unit(seed: u32) -> f64 {
    f64::from(hash(seed) >> 8) / f64::from(1u32 << 24)
}

fn fract(x: f64) -> f64 {
    x - x.floor()
}

fn smooth(x: f64) -> f64 {
    let t = x.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn sin(turns: f64) -> f64 {
    exact::sin_f64(fract(turns) * std::f64::consts::TAU)
}

/// How high a box of half sides `(a, b)` with a bevel is at a place relative to its middle.
fn bevel(x: f64, y: f64, a: f64, b: f64, width: f64) -> f64 {
    let edge = (a - x.abs()).min(b - y.abs());
    (edge / width).clamp(0.0, 1.0)
}

fn brick(u: f64, v: f64, seed: u32) -> f64 {
    let rows = 4.0 + 2.0 * f64::from(hash(seed) % 3);
    let y = v * rows;
    let x = u * rows / 2.0 + 0.5 * (y.floor() % 2.0);
    bevel(fract(x) * 2.0 - 1.0, fract(y) - 0.5, 0.94, 0.44, 0.08)
}

fn lattice(x: i64, y: i64, n: i64, seed: u32) -> f64 {
    unit(seed ^ hash((x.rem_euclid(n) * 8191 + y.rem_euclid(n)) as u32))
}

fn value_noise(u: f64, v: f64, n: i64, seed: u32) -> f64 {
    let (x, y) = (u * n as f64, v * n as f64);
    let (i, j) = (x.floor() as i64, y.floor() as i64);
    let (s, t) = (smooth(x - x.floor()), smooth(y - y.floor()));
    let at = |di, dj| lattice(i + di, j + dj, n, seed);
    let low = at(0, 0) + (at(1, 0) - at(0, 0)) * s;
    let high = at(0, 1) + (at(1, 1) - at(0, 1)) * s;
    low + (high - low) * t
}

fn noise(u: f64, v: f64, seed: u32) -> f64 {
    (0..4).map(|k| value_noise(u, v, 4 << k, seed + k) / f64::from(1u32 << k)).sum()
}

fn nearest(u: f64, v: f64, n: i64, seed: u32, f: impl Fn(f64, f64, f64) -> f64) -> f64 {
    let (i, j) = ((u * n as f64).floor() as i64, (v * n as f64).floor() as i64);
    let mut best = f64::INFINITY;
    for dj in -1..=1 {
        for di in -1..=1 {
            let cx = (i + di) as f64 + 0.2 + 0.6 * lattice(i + di, j + dj, n, seed);
            let cy = (j + dj) as f64 + 0.2 + 0.6 * lattice(i + di, j + dj, n, seed + 77);
            best = best.min(f(u * n as f64 - cx, v * n as f64 - cy, lattice(i + di, j + dj, n, seed + 99)));
        }
    }
    best
}

fn dents(u: f64, v: f64, seed: u32) -> f64 {
    nearest(u, v, 6, seed, |x, y, r| -smooth(1.0 - (x * x + y * y).sqrt() / (0.3 + 0.3 * r)))
}

fn weave(u: f64, v: f64, seed: u32) -> f64 {
    let n = 3.0 + f64::from(hash(seed) % 3);
    // Round threads along both axes that swing over and under one another; what lies on top is seen.
    let thread = |x: f64, y: f64| {
        let side = if (x * 2.0).floor() % 2.0 == 0.0 { 1.0 } else { -1.0 };
        let round = 1.0 - exact::pow_f64((fract(x * 2.0) * 2.0 - 1.0).abs(), 2.0);
        0.6 * round.max(0.0).sqrt() + 0.3 * side * sin(y)
    };
    thread(u * n, v * n + 0.25).max(-thread(0.0, 0.0).abs()).max(thread(v * n, u * n - 0.25))
}

fn sparse(u: f64, v: f64, seed: u32) -> f64 {
    let (cx, cy) = (0.2 + 0.6 * unit(seed), 0.2 + 0.6 * unit(seed + 1));
    smooth(1.0 - ((u - cx) * (u - cx) + (v - cy) * (v - cy)).sqrt() / 0.12)
}

fn grooves_x(u: f64, _: f64, seed: u32) -> f64 {
    sin(u * (5.0 + f64::from(hash(seed) % 9))) + 0.4 * sin(u * 13.0 + 0.2)
}

fn grooves_y(_: f64, v: f64, seed: u32) -> f64 {
    (fract(v * (4.0 + f64::from(hash(seed) % 5))) - 0.5).abs()
}

fn ripple_sum(u: f64, v: f64, seed: u32) -> f64 {
    sin(u * (3.0 + f64::from(hash(seed) % 5))) + sin(v * (4.0 + f64::from(hash(seed + 1) % 5)))
}

fn panels(u: f64, v: f64, seed: u32) -> f64 {
    let n = 3.0 + f64::from(hash(seed) % 3);
    let (x, y) = (u * n, v * n);
    let up = lattice(x.floor() as i64, y.floor() as i64, n as i64, seed);
    up * bevel(fract(x) - 0.5, fract(y) - 0.5, 0.47, 0.47, 0.05)
}

fn sculpt(u: f64, v: f64, seed: u32) -> f64 {
    let (du, dv) = (0.1 * sin(v + unit(seed)), 0.1 * sin(u + unit(seed + 1)));
    let a = value_noise(fract(u + du), fract(v + dv), 3, seed);
    1.2 * a + 0.3 * sin(2.0 * a + value_noise(u, v, 5, seed + 5))
}

fn roof(u: f64, v: f64, seed: u32) -> f64 {
    let n = 5.0 + f64::from(hash(seed) % 3);
    let y = v * n;
    let x = fract(u * n + 0.5 * (y.floor() % 2.0)) - 0.5;
    // A scale rises towards its rounded lower end.
    let edge = 0.75 + 0.25 * (1.0 - 4.0 * x * x).max(0.0).sqrt();
    let t = fract(y);
    if t < edge { t / edge } else { 0.0 }
}

fn diagonal(u: f64, v: f64, seed: u32) -> f64 {
    sin(u * 4.0 + v * (3.0 + f64::from(hash(seed) % 4)))
}

fn cells(u: f64, v: f64, seed: u32) -> f64 {
    nearest(u, v, 7, seed, |x, y, _| (x * x + y * y).sqrt()).min(0.9)
}

/// Many octaves, as light and dark of a photograph taken for a height.
fn grain(u: f64, v: f64, seed: u32) -> f64 {
    (0..6).map(|k| value_noise(u, v, 3 << k, seed + 31 * k) * exact::pow_f64(0.72, f64::from(k))).sum::<f64>()
        + 0.3 * smooth((value_noise(u, v, 9, seed + 7) - 0.5) * 4.0)
}

fn rivet(u: f64, v: f64, seed: u32) -> f64 {
    let n = 3.0 + f64::from(hash(seed) % 3);
    let (x, y) = (fract(u * n) - 0.5, fract(v * n) - 0.5);
    let r = (x * x + y * y).sqrt();
    (0.0225 - r * r).max(0.0).sqrt() * 4.0
}

/// Strokes of random letters.
fn text(u: f64, v: f64, seed: u32) -> f64 {
    let (x, y) = ((u * 40.0).floor() as i64, (v * 40.0).floor() as i64);
    let on = |x: i64, y: i64| f64::from(u8::from(lattice(x, y, 40, seed) > 0.6 && x % 5 != 0 && y % 7 > 1));
    let (s, t) = (smooth(fract(u * 40.0) * 2.0), smooth(fract(v * 40.0) * 2.0));
    let low = on(x - 1, y - 1) + (on(x, y - 1) - on(x - 1, y - 1)) * s;
    let high = on(x - 1, y) + (on(x, y) - on(x - 1, y)) * s;
    low + (high - low) * t
}

type Slopes = Vec<[f64; 2]>;

/// Slopes to the right and down, scaled to a root mean square of `rms`.
fn slopes(f: &Family, kernel: Kernel, (w, h): (u32, u32), window: f64, seed: u32, rms: f64) -> Slopes {
    let at = |x: f64, y: f64| {
        let (u, v) = (fract((x + 0.5) / f64::from(w) * window), fract((y + 0.5) / f64::from(h) * window));
        (f.height)(u, v, seed)
    };
    let mut out = Vec::new();
    for y in 0..h {
        for x in 0..w {
            let g = |dx: f64, dy: f64| at(f64::from(x) + dx, f64::from(y) + dy);
            out.push(match kernel {
                Kernel::Central => [(g(1.0, 0.0) - g(-1.0, 0.0)) / 2.0, (g(0.0, 1.0) - g(0.0, -1.0)) / 2.0],
                Kernel::Forward => [g(1.0, 0.0) - g(0.0, 0.0), g(0.0, 1.0) - g(0.0, 0.0)],
                Kernel::Analytic => {
                    let e = 0.01;
                    [(g(e, 0.0) - g(-e, 0.0)) / (2.0 * e), (g(0.0, e) - g(0.0, -e)) / (2.0 * e)]
                }
                Kernel::Sobel => {
                    let side = |a: fn(f64, f64) -> (f64, f64)| {
                        [(-1.0, 1.0), (0.0, 2.0), (1.0, 1.0)]
                            .map(|(k, m)| {
                                let ((px, py), (nx, ny)) = (a(1.0, k), a(-1.0, k));
                                m * (g(px, py) - g(nx, ny))
                            })
                            .iter()
                            .sum::<f64>()
                            / 8.0
                    };
                    [side(|s, k| (s, k)), side(|s, k| (k, s))]
                }
            });
        }
    }
    let all = out.iter().map(|s| s[0] * s[0] + s[1] * s[1]).sum::<f64>() / out.len() as f64;
    // What lies on a flat ground counts with the ground: its own slopes would be cliffs otherwise.
    let steepest = out.iter().map(|s| s[0].abs().max(s[1].abs())).fold(0.0, f64::max);
    let k = (rms / all.sqrt()).min(3.0 / steepest);
    out.iter_mut().for_each(|s| *s = s.map(|v| v * k));
    out
}

fn to_srgb(c: f64) -> f64 {
    if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * exact::pow_f64(c, 1.0 / 2.4) - 0.055 }
}

fn from_srgb(c: f64) -> f64 {
    if c <= 0.040_45 { c / 12.92 } else { exact::pow_f64((c + 0.055) / 1.055, 2.4) }
}

/// Makes a map.
pub fn make(
    family: Family,
    kernel: Kernel,
    damage: Damage,
    y_down: bool,
    bits: u8,
    size: (u32, u32),
    seed: u32,
) -> Case {
    let rms = [0.08, 0.2, 0.5][seed as usize % 3];
    // A bump alone must stay in the picture.
    let window = match damage {
        Damage::Cropped if family.name == "sparse" => 0.95,
        Damage::Cropped => 0.37,
        _ => 1.0,
    };
    let s = slopes(&family, kernel, size, window, seed, rms);
    let (w, h) = (size.0 as usize, size.1 as usize);
    let mut normals: Vec<[f64; 3]> = s
        .iter()
        .map(|[p, q]| {
            let l = 1.0 / (p * p + q * q + 1.0).sqrt();
            [-p * l, if y_down { -q * l } else { q * l }, l]
        })
        .collect();
    match damage {
        Damage::Short => normals.iter_mut().for_each(|n| *n = n.map(|v| v * 0.8)),
        Damage::Steep => normals
            .iter_mut()
            .for_each(|n| (n[0], n[1]) = ((n[0] * 2.0).clamp(-1.0, 1.0), (n[1] * 2.0).clamp(-1.0, 1.0))),
        Damage::Averaged => {
            let old = normals.clone();
            for y in 0..h {
                for x in 0..w {
                    let mut sum = [0.0; 3];
                    for k in 0..25 {
                        let n = old[((y + k / 5 + h - 2) % h) * w + (x + k % 5 + w - 2) % w];
                        (0..3).for_each(|c| sum[c] += n[c] / 25.0);
                    }
                    normals[y * w + x] = sum;
                }
            }
        }
        _ => {}
    }
    let most = if bits == 8 { 255.0 } else { 65535.0 };
    let mut codes: Vec<f64> = normals.iter().flatten().map(|v| v * 0.5 + 0.5).collect();
    match damage {
        Damage::Srgb => codes.iter_mut().for_each(|c| *c = to_srgb(*c)),
        Damage::Decoded => codes.iter_mut().for_each(|c| *c = from_srgb(*c)),
        Damage::TwoChannels => {
            codes.chunks_exact_mut(3).for_each(|c| c[2] = [0.0, 1.0, 0.5][seed as usize / 3 % 3]);
        }
        Damage::Lossy => lossy(&mut codes, w, h, seed),
        _ => {}
    }
    let round = |c: f64| {
        if damage == Damage::Neutral127 {
            ((c * 2.0 - 1.0) * ((most - 1.0) / 2.0) + (most - 1.0) / 2.0 + 0.5).floor().clamp(0.0, most)
        } else {
            (c * most + 0.5).floor().clamp(0.0, most)
        }
    };
    let pixels = if bits == 8 {
        Pixels::U8(codes.iter().map(|c| round(*c) as u8).collect())
    } else {
        Pixels::U16(codes.iter().map(|c| round(*c) as u16).collect())
    };
    let image = Image::new(size.0, size.1, 3, pixels, Encoding::Linear).unwrap();
    Case { family, kernel, damage, y_down, bits, size, seed, image }
}

/// As JPEG does it: chroma of half size, coarse steps, noise that all channels share.
fn lossy(codes: &mut [f64], w: usize, h: usize, seed: u32) {
    let at = |x: usize, y: usize, c: usize| (y * w + x) * 3 + c;
    let mut ycc = vec![[0.0f64; 3]; w * h];
    for y in 0..h {
        for x in 0..w {
            let [r, g, b] = [0, 1, 2].map(|c| codes[at(x, y, c)]);
            let l = 0.299 * r + 0.587 * g + 0.114 * b;
            ycc[y * w + x] = [l, (b - l) * 0.564, (r - l) * 0.713];
        }
    }
    for y in (0..h).step_by(2) {
        for x in (0..w).step_by(2) {
            for c in 1..3 {
                let places = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| ((y + j) % h) * w + (x + i) % w);
                let mean = places.iter().map(|p| ycc[*p][c]).sum::<f64>() / 4.0;
                places.iter().for_each(|p| ycc[*p][c] = mean);
            }
        }
    }
    for (k, v) in ycc.iter_mut().enumerate() {
        v[0] += (unit(seed ^ (k as u32 * 3)) - 0.5) * 5.0 / 255.0;
        *v = v.map(|v| (v * 255.0 / 3.0).round() * 3.0 / 255.0);
        let r = v[0] + v[2] / 0.713;
        let b = v[0] + v[1] / 0.564;
        let g = (v[0] - 0.299 * r - 0.114 * b) / 0.587;
        [r, g, b].iter().enumerate().for_each(|(c, x)| codes[k * 3 + c] = x.clamp(0.0, 1.0));
    }
}

/// All families, both directions of green, all damages; kernels, sizes, depths and strengths in turn. 640 maps.
pub fn all(seeds: u32) -> impl Iterator<Item = Case> {
    const KERNELS: [Kernel; 4] = [Kernel::Central, Kernel::Sobel, Kernel::Forward, Kernel::Analytic];
    const SIZES: [(u32, u32); 5] = [(64, 64), (128, 128), (96, 64), (256, 256), (100, 150)];
    let cases = move |f: usize, d: usize, y: bool, s: u32| {
        let seed = hash(s * 1009 + f as u32 * 97 + d as u32 * 13) % 100_000 + u32::from(y) * 7;
        let k = hash(seed + 5) as usize;
        let bits = if k.is_multiple_of(3) { 16 } else { 8 };
        make(FAMILIES[f], KERNELS[k / 3 % 4], DAMAGES[d], y, bits, SIZES[k / 12 % 5], seed)
    };
    (0..FAMILIES.len()).flat_map(move |f| {
        (0..DAMAGES.len())
            .flat_map(move |d| [false, true].into_iter().flat_map(move |y| (0..seeds).map(move |s| cases(f, d, y, s))))
    })
}

/// Pictures that are not in tangent space: what they are (`object` or `none`), and the picture.
pub fn others() -> Vec<(&'static str, &'static str, Image)> {
    fn picture(f: impl Fn(f64, f64, usize) -> [f64; 3]) -> Image {
        let (w, h) = (128usize, 96usize);
        let mut v = Vec::new();
        for k in 0..w * h {
            let c = f((k % w) as f64 / w as f64, (k / w) as f64 / h as f64, k);
            v.extend(c.map(|x| (x.clamp(0.0, 1.0) * 255.0 + 0.5) as u8));
        }
        Image::new(w as u32, h as u32, 3, Pixels::U8(v), Encoding::Srgb).unwrap()
    }
    fn normal(n: [f64; 3]) -> [f64; 3] {
        let l = 1.0 / (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
        n.map(|x| x * l * 0.5 + 0.5)
    }
    let ball = |u: f64, v: f64| {
        let (s, c) = (sin(v / 2.0), sin(v / 2.0 + 0.25));
        [sin(u) * s, c, sin(u + 0.25) * s]
    };
    let rough = |n: [f64; 3], u: f64, v: f64| {
        [n[0] + 0.4 * noise(u, v, 3) - 0.3, n[1] + 0.4 * noise(u, v, 9) - 0.3, n[2] + 0.4 * noise(u, v, 5) - 0.3]
    };
    let grey = |x: f64| [x; 3];
    vec![
        ("object", "ball", picture(|u, v, _| normal(ball(u, v)))),
        ("object", "rough ball", picture(|u, v, _| normal(rough(ball(u, v), u, v)))),
        ("object", "floor", picture(|u, v, _| normal(rough([0.0, 1.5, 0.0], u, v)))),
        (
            "object",
            "six sides",
            picture(|u, v, _| {
                let side = (u * 3.0) as usize + 3 * usize::from(v > 0.5);
                let mut n = [0.0; 3];
                n[side % 3] = if side < 3 { 1.0 } else { -1.0 };
                normal(rough([2.0 * n[0], 2.0 * n[1], 2.0 * n[2]], u, v))
            }),
        ),
        ("object", "ball on black", picture(|u, v, _| if v < 0.6 { normal(ball(u, v / 0.6)) } else { [0.0; 3] })),
        ("none", "height", picture(|u, v, _| grey(noise(u, v, 7) / 2.0))),
        ("none", "white noise", picture(|_, _, k| [0, 1, 2].map(|c| unit(k as u32 * 3 + c)))),
        (
            "none",
            "wood",
            picture(|u, v, _| {
                let t = 0.5 + 0.3 * sin(v * 9.0 + noise(u, v, 1));
                [0.6 * t + 0.2, 0.4 * t + 0.15, 0.25 * t + 0.1]
            }),
        ),
        (
            "none",
            "sky",
            picture(|u, v, _| {
                let t = noise(u, v, 4) / 2.0;
                [0.35 + 0.5 * t, 0.55 + 0.35 * t, 0.85 + 0.1 * t]
            }),
        ),
        (
            "none",
            "plaster",
            picture(|u, v, k| {
                let t = 0.72 + 0.1 * noise(u, v, 4);
                [t + 0.02 * unit(k as u32), t + 0.02 * unit(k as u32 + 7), t - 0.03]
            }),
        ),
        (
            "none",
            "leaves",
            picture(|u, v, _| {
                let t = noise(u, v, 4) / 2.0;
                [0.5 * t, 0.3 + 0.5 * t, 0.3 * t]
            }),
        ),
        ("none", "grey", picture(|_, _, _| grey(0.79))),
        (
            "none",
            "purple cloth",
            picture(|u, v, _| {
                let t = noise(u, v, 4) / 2.0;
                [0.35 + 0.3 * t, 0.2 + 0.3 * t, 0.4 + 0.4 * t]
            }),
        ),
    ]
}

/// Vectors that belong to no surface: their two slopes know nothing of one another.
pub fn chaos(seed: u32) -> Image {
    let n = [3, 6, 12, 30][seed as usize % 4];
    let octaves = 1 + hash(seed) % 3;
    let (w, h) = [(128u32, 128u32), (256, 192)][seed as usize / 4 % 2];
    let field = |u: f64, v: f64, s: u32| {
        (0..octaves).map(|k| (value_noise(u, v, n << k, s + k) - 0.5) / f64::from(1 << k)).sum::<f64>()
    };
    let mut pixels = Vec::new();
    for k in 0..w * h {
        let (u, v) = (f64::from(k % w) / f64::from(w), f64::from(k / w) / f64::from(h));
        let n = [field(u, v, seed * 64), field(u, v, seed * 64 + 32), 1.0];
        let l = 1.0 / (n[0] * n[0] + n[1] * n[1] + 1.0).sqrt();
        pixels.extend(n.map(|x| (x * l * 127.5 + 128.0) as u8));
    }
    Image::new(w, h, 3, Pixels::U8(pixels), Encoding::Linear).unwrap()
}
