//! What a texture lookup costs: `cargo bench --bench floor3_map`.
#![allow(clippy::print_stdout)]

use frieze::image::pyramid::Pyramid;
use frieze::image::{Encoding, Image, Pixels};
use frieze::map::{Filter, Footprint, Map, Wrap};
use frieze::math::lane::{Int, Kernel, Lane, Level, Num};
use frieze::math::vec::Vec2;
use std::sync::Arc;
use std::time::Instant;

const SIZE: u32 = 2048;
/// Lookups per round: one 1080p frame.
const COUNT: usize = 1920 * 1080;

/// A frame of lookups, in rows of blocks as a renderer makes them.
struct Frame<'a> {
    map: &'a Map,
    /// Texels per pixel.
    zoom: f32,
    /// How much the level varies within a block.
    spread: f32,
}

impl Kernel for Frame<'_> {
    type Out = f32;
    #[inline(always)]
    fn run<L: Lane>(self, l: L) -> f32 {
        let mut sum = l.f(0.0);
        let step = self.zoom / SIZE as f32;
        // Tiles of 64x64, rows of blocks within.
        let (tile, across) = (64 * 64 / L::WIDTH, 64 / L::WIDTH);
        for b in 0..COUNT / L::WIDTH {
            let (t, k) = (b / tile, b % tile);
            let x = (l.ramp() + (t % 30 * 64 + k % across * L::WIDTH) as i32).to_num();
            let y = (t / 30 * 64 + k / across) as f32;
            // Turned by some 17 degrees, so that no axis is favoured.
            let place = Vec2::new(x * (step * 0.96) - y * step * 0.28 + 7.0, x * (step * 0.28) + y * step * 0.96);
            let wobble = (x * 0.371 - (x * 0.371).floor()) * self.spread + 1.0;
            let f = Footprint {
                dudx: wobble * (step * 0.96),
                dvdx: wobble * (step * 0.28),
                dudy: wobble * (step * -0.28),
                dvdy: wobble * (step * 0.96),
            };
            let c = self.map.at(l, place, f, l.mask(u32::MAX >> (32 - L::WIDTH)));
            sum = sum + (c.x + c.y + c.z + c.w);
        }
        (0..L::WIDTH).map(|k| sum.lane(k)).sum()
    }
}

fn main() {
    let mut s = 1u32;
    let v = (0..SIZE * SIZE * 3).map(|_| {
        s = s.wrapping_mul(1664525).wrapping_add(1013904223);
        (s >> 24) as u8
    });
    let v: Vec<u8> = v.collect();
    let image = Image::new(SIZE, SIZE, 3, Pixels::U8(v), Encoding::Linear).expect("it has a size");
    let start = Instant::now();
    let data = Arc::new(Pyramid::new(&image, false));
    println!("pyramid rgba8   {:8.1} ms", start.elapsed().as_secs_f64() * 1e3);
    let start = Instant::now();
    let color = Arc::new(Pyramid::new(&image, true));
    println!("pyramid srgb    {:8.1} ms", start.elapsed().as_secs_f64() * 1e3);
    let only = std::env::var("FRIEZE_SIMD").ok();
    for level in Level::available().into_iter().filter(|l| only.as_deref().is_none_or(|o| o == l.name())) {
        for (name, filter, pyramid, zoom, spread) in [
            ("trilinear rgba8, one level pair", Filter::Trilinear, &data, 1.45, 0.0),
            ("trilinear rgba8, mixed levels", Filter::Trilinear, &data, 1.3, 1.5),
            ("trilinear rgba8, all levels", Filter::Trilinear, &data, 1.3, 9.0),
            ("trilinear rgba8, magnified", Filter::Trilinear, &data, 0.4, 0.0),
            ("trilinear rgba8, far", Filter::Trilinear, &data, 6.3, 0.0),
            ("trilinear rgba16, one level pair", Filter::Trilinear, &color, 1.45, 0.0),
            ("bilinear rgba8", Filter::Bilinear, &data, 0.9, 0.0),
            ("nearest rgba8", Filter::Nearest, &data, 0.9, 0.0),
        ] {
            let map = Map { pyramid: pyramid.clone(), filter, wrap: [Wrap::Repeat; 2] };
            let mut best = f64::INFINITY;
            let mut sum = 0.0;
            for _ in 0..5 {
                let start = Instant::now();
                sum += level.run(Frame { map: &map, zoom, spread });
                best = best.min(start.elapsed().as_secs_f64());
            }
            println!("{:7} {name:36} {:6.2} ns a pixel  ({sum:.0})", level.name(), best * 1e9 / COUNT as f64);
        }
    }
}
