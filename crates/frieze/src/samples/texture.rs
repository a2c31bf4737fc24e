//! Images made by code.

use super::noise;
use crate::image::{Encoding, Image, Pixels};
use crate::map::normal;
use crate::math::vec::Vec3;
use rayon::prelude::*;

/// An RGB image of `f(x, y)`, values 0 ..= 1 as they are to be stored.
pub(super) fn rgb(
    width: usize,
    height: usize,
    encoding: Encoding,
    f: impl Fn(usize, usize) -> [f32; 3] + Sync,
) -> Image {
    let mut pixels = vec![0u8; width * height * 3];
    pixels.par_chunks_mut(width * 3).enumerate().for_each(|(y, row)| {
        for (x, texel) in row.chunks_exact_mut(3).enumerate() {
            texel.copy_from_slice(&f(x, y).map(|v| normal::quantize(v, 255) as u8));
        }
    });
    Image::new(width as u32, height as u32, 3, Pixels::U8(pixels), encoding).expect("the sizes fit")
}

/// A +Y normal map from tileable heights, row 0 at the top: `n = (-dh/dx, -dh/dy, 1)` with y up the image, by
/// central differences. `strength` is texels of height per unit.
pub(super) fn normal_map(width: usize, height: usize, heights: &[f32], strength: f32) -> Image {
    rgb(width, height, Encoding::Linear, |x, y| {
        let at = |x: usize, y: usize| heights[y % height * width + x % width];
        let dx = (at(x + 1, y) - at(x + width - 1, y)) * 0.5 * strength;
        let down = (at(x, y + 1) - at(x, y + height - 1)) * 0.5 * strength;
        normal::encode(Vec3::new(-dx, down, 1.0).normalize(), false).array()
    })
}

/// The albedo and normal map of the stress scenes.
pub(super) fn stress(n: usize) -> (Image, Image) {
    let h = noise::fractal(n, 2, 6, 8);
    let k = noise::fractal(n, 3, 4, 4);
    let albedo = rgb(n, n, Encoding::Linear, |x, y| {
        let a = ((h[y * n + x] - 0.3) * 2.5).clamp(0.0, 1.0);
        let b = ((k[y * n + x] - 0.4) * 4.0).clamp(0.0, 1.0);
        let checker = 0.85 + 0.15 * ((x * 16 / n + y * 16 / n) & 1) as f32;
        let mix = |c0: f32, c1: f32, c2: f32| ((c0 * (1.0 - a) + c1 * a) * (1.0 - 0.5 * b) + c2 * 0.5 * b) * checker;
        [mix(0.75, 0.25, 0.88), mix(0.52, 0.32, 0.84), mix(0.30, 0.42, 0.74)]
    });
    // Twice the slope of a central difference, as the benchmark's generator has it.
    (albedo, normal_map(n, n, &h, n as f32 / 20.0))
}

/// Planed wood, 512 x 512: growth rings cut lengthwise, along v.
pub(super) fn wood() -> Image {
    let n = 512;
    rgb(n, n, Encoding::Srgb, |x, y| {
        let (u, v) = (x as f32 / n as f32, y as f32 / n as f32);
        let bend = noise::fbm(u * 4.0, v * 4.0, 4, 3, 11);
        let across = u * 9.0 + bend * 3.2;
        let ring = across - across.floor();
        // A ring darkens slowly and ends at once.
        let late = ring * ring * ring;
        let fibre = noise::value(u * 256.0, v * 8.0, 256, 5) * 0.5 + noise::value(u * 64.0, v * 4.0, 64, 6) * 0.5;
        let t = (late * 0.75 + fibre * 0.3).min(1.0);
        [0.74 - 0.30 * t, 0.52 - 0.27 * t, 0.31 - 0.19 * t]
    })
}

/// A checkerboard of `cells`² cells of two sRGB greys.
pub(super) fn checker(n: usize, cells: usize, dark: f32, light: f32) -> Image {
    rgb(n, n, Encoding::Srgb, |x, y| [if (x * cells / n + y * cells / n) & 1 == 0 { light } else { dark }; 3])
}

/// Albedo and normal map of a brick wall, 8 x 16 bricks in running bond, both tileable.
pub(super) fn bricks() -> (Image, Image) {
    let n = 1024usize;
    let grain = noise::fractal(n, 21, 6, 16);
    let (columns, rows) = (8usize, 16usize);
    // Of a texel: the brick's number, and how far inside of it, in texels.
    let brick = |x: usize, y: usize| {
        let (bw, bh) = (n / columns, n / rows);
        let row = y / bh;
        let x = x + if row % 2 == 1 { bw / 2 } else { 0 };
        let column = x / bw % columns;
        let (dx, dy) = (x % bw, y % bh);
        let wobble = (grain[(y * n) + (x % n)] - 0.5) * 6.0;
        let inside = dx.min(bw - 1 - dx).min(dy.min(bh - 1 - dy)) as f32 - 4.0 + wobble;
        ((row * columns + column) as u32, inside)
    };
    let heights: Vec<f32> = (0..n * n)
        .into_par_iter()
        .map(|k| {
            let (id, inside) = brick(k % n, k / n);
            let t = (inside / 7.0).clamp(0.0, 1.0);
            // Bricks stand 9 texels out of the joint, each a little more or less, with rounded edges.
            t * (2.0 - t) * (9.0 + noise::random(id, 0, 3) * 3.0) + grain[k] * (3.0 + 5.0 * t)
        })
        .collect();
    let albedo = rgb(n, n, Encoding::Srgb, |x, y| {
        let (id, inside) = brick(x, y);
        let g = grain[y * n + x];
        let t = (inside / 4.0).clamp(0.0, 1.0);
        let tone = 0.8 + 0.3 * noise::random(id, 1, 3) + 0.5 * (g - 0.5);
        let warm = noise::random(id, 2, 3) * 0.06;
        let mix = |joint: f32, stone: f32| (joint * (0.75 + 0.5 * g)) * (1.0 - t) + stone * tone * t;
        [mix(0.62, 0.60 + warm), mix(0.60, 0.31), mix(0.56, 0.24 - warm * 0.5)]
    });
    (albedo, normal_map(n, n, &heights, 1.0))
}
