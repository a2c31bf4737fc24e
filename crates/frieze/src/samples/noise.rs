//! Value noise from integer hashes: the same bits everywhere. For textures of the built-in scenes.

use rayon::prelude::*;

/// A well mixed 32-bit hash of a lattice point (Wellons' `lowbias32`, twice).
pub(super) fn hash(x: u32, y: u32, seed: u32) -> u32 {
    fn mix(mut h: u32) -> u32 {
        h = (h ^ (h >> 16)).wrapping_mul(0x7feb_352d);
        h = (h ^ (h >> 15)).wrapping_mul(0x846c_a68b);
        h ^ (h >> 16)
    }
    mix(x ^ mix(y ^ mix(seed ^ 0x9e37_79b9)))
}

/// [`hash`] as a number in 0 .. 1.
pub(super) fn random(x: u32, y: u32, seed: u32) -> f32 {
    (hash(x, y, seed) >> 8) as f32 / (1 << 24) as f32
}

/// Smoothed value noise in 0 .. 1 at any place; the lattice has unit cells and repeats after `period` cells.
pub(super) fn value(x: f32, y: f32, period: u32, seed: u32) -> f32 {
    let (fx, fy) = (x.floor(), y.floor());
    let smooth = |t: f32| t * t * (3.0 - 2.0 * t);
    let (tx, ty) = (smooth(x - fx), smooth(y - fy));
    let wrap = |v: f32| (v as i32).rem_euclid(period as i32) as u32;
    let (x0, y0) = (wrap(fx), wrap(fy));
    let (x1, y1) = ((x0 + 1) % period, (y0 + 1) % period);
    let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
    mix(mix(random(x0, y0, seed), random(x1, y0, seed), tx), mix(random(x0, y1, seed), random(x1, y1, seed), tx), ty)
}

/// Octaves of [`value`], each of twice the frequency and 0.55 times the amplitude of the one before; 0 .. 1,
/// repeating after `period` units.
pub(super) fn fbm(x: f32, y: f32, period: u32, octaves: u32, seed: u32) -> f32 {
    let (mut sum, mut total, mut amplitude, mut scale) = (0.0, 0.0, 1.0, 1u32);
    for o in 0..octaves {
        sum += amplitude * value(x * scale as f32, y * scale as f32, period * scale, seed + o);
        total += amplitude;
        amplitude *= 0.55;
        scale *= 2;
    }
    sum / total
}

/// `n`² texels of tileable fractal noise in 0 .. 1, lattices of `base`, `2 base`, ... cells.
pub(super) fn fractal(n: usize, seed: u32, octaves: u32, base: usize) -> Vec<f32> {
    let mut lattices = Vec::new();
    for o in 0..octaves {
        let g = base << o;
        if g > n {
            break;
        }
        let lattice: Vec<f32> = (0..g * g).map(|k| random((k % g) as u32, (k / g) as u32, seed * 16 + o)).collect();
        // Where along the lattice each texel is, and the smoothed weight of the next lattice point.
        let at: Vec<(usize, f32)> = (0..n)
            .map(|k| {
                let t = (k * g) as f32 / n as f32;
                let f = t - t.floor();
                (t as usize % g, f * f * (3.0 - 2.0 * f))
            })
            .collect();
        lattices.push((g, lattice, at));
    }
    let mut out = vec![0.0f32; n * n];
    out.par_chunks_mut(n).enumerate().for_each(|(y, row)| {
        let (mut amplitude, mut total) = (1.0f32, 0.0f32);
        for (g, lattice, at) in &lattices {
            let (j, w) = at[y];
            let (a, b) = (&lattice[j * g..][..*g], &lattice[(j + 1) % g * g..][..*g]);
            let line: Vec<f32> = a.iter().zip(b).map(|(a, b)| a + (b - a) * w).collect();
            for (texel, &(i, t)) in row.iter_mut().zip(at) {
                let (a, b) = (line[i], line[if i + 1 == *g { 0 } else { i + 1 }]);
                *texel += amplitude * (a + (b - a) * t);
            }
            total += amplitude;
            amplitude *= 0.55;
        }
        row.iter_mut().for_each(|v| *v /= total);
    });
    out
}
