//! A head whose halves share one texture: u runs from the middle of the face to the middle of the back on both sides, so
//! one half is mirrored. One normal map, with hair, brows and carved spirals, serves both.

use super::{noise, texture, view};
use crate::image::{Encoding, Image};
use crate::map::{Wrap, normal};
use crate::math::exact::{exp_f64, sin_cos_f64};
use crate::math::vec::{Mat4, Vec3};
use crate::mesh::Mesh;
use crate::mesh::shape::{Point, grid};
use crate::scene::{Background, Light, Material, NormalMap, Output, Scene, Texture, ToneMap};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Height, half width, depth of the front and of the back, from the crown to the shoulders.
const RINGS: [[f64; 4]; 15] = [
    [1.03, 0.00, 0.00, 0.00],
    [1.00, 0.22, 0.20, 0.26],
    [0.86, 0.46, 0.45, 0.56],
    [0.60, 0.60, 0.60, 0.76],
    [0.36, 0.635, 0.655, 0.80],
    [0.16, 0.63, 0.665, 0.77],
    [-0.06, 0.60, 0.665, 0.68],
    [-0.28, 0.545, 0.65, 0.545],
    [-0.48, 0.46, 0.615, 0.44],
    [-0.63, 0.37, 0.52, 0.385],
    [-0.73, 0.335, 0.36, 0.37],
    [-0.90, 0.325, 0.29, 0.37],
    [-1.06, 0.37, 0.30, 0.41],
    [-1.20, 0.56, 0.36, 0.48],
    [-1.34, 0.74, 0.42, 0.54],
];

/// `RINGS` at 0 (crown) ..= 1, by cubics through the rings (Catmull and Rom 1974).
fn ring(s: f64) -> [f64; 4] {
    let last = RINGS.len() - 1;
    let at = s.clamp(0.0, 1.0) * last as f64;
    let k = (at as usize).min(last - 1);
    let t = at - k as f64;
    let p = |k: usize, c: usize| RINGS[k.min(last)][c];
    core::array::from_fn(|c| {
        // The crown's other side mirrors the widths, so that it is round.
        let before = if k > 0 {
            p(k - 1, c)
        } else if c == 0 {
            p(1, c)
        } else {
            -p(1, c)
        };
        let (a, b, after) = (p(k, c), p(k + 1, c), p(k + 2, c));
        let (m0, m1) = ((b - before) * 0.5, (after - a) * 0.5);
        let (t2, t3) = (t * t, t * t * t);
        a * (2.0 * t3 - 3.0 * t2 + 1.0) + m0 * (t3 - 2.0 * t2 + t) + b * (3.0 * t2 - 2.0 * t3) + m1 * (t3 - t2)
    })
}

/// What stands out of the rings: angle from the face's middle, height, widths of both, and how far, in metres.
const FEATURES: [[f64; 5]; 17] = [
    [0.0, -0.13, 0.13, 0.085, 0.145],   // tip of the nose
    [0.0, 0.02, 0.10, 0.13, 0.075],     // its bridge
    [0.17, -0.17, 0.08, 0.05, 0.045],   // nostrils
    [0.40, 0.125, 0.19, 0.085, -0.095], // sockets
    [0.42, 0.115, 0.115, 0.058, 0.055], // eyes
    [0.36, 0.245, 0.26, 0.05, 0.045],   // brows
    [0.0, 0.55, 0.5, 0.2, 0.02],        // forehead
    [0.62, -0.10, 0.24, 0.13, 0.04],    // cheeks
    [0.55, -0.34, 0.20, 0.12, -0.035],  // hollows
    [0.0, -0.255, 0.05, 0.04, -0.012],  // philtrum
    [0.0, -0.315, 0.20, 0.033, 0.05],   // upper lip
    [0.0, -0.365, 0.22, 0.016, -0.03],  // mouth
    [0.0, -0.41, 0.17, 0.035, 0.052],   // lower lip
    [0.0, -0.465, 0.2, 0.03, -0.02],    // below it
    [0.0, -0.56, 0.20, 0.075, 0.055],   // chin
    [1.62, 0.06, 0.13, 0.17, 0.13],     // ears
    [1.66, 0.07, 0.07, 0.10, -0.07],    // their shells
];

/// A place of the head: angle from the middle of the face (towards +X), and 0 (crown) ..= 1.
fn place(angle: f64, s: f64) -> [f64; 3] {
    let [y, x, front, back] = ring(s);
    let (sin, cos) = sin_cos_f64(angle);
    let bump = |f: &[f64; 5]| {
        let (a, b) = ((angle.abs() - f[0]) / f[2], (y - f[1]) / f[3]);
        f[4] * exp_f64(-(a * a + b * b))
    };
    // Features fade out at the crown, where all angles meet.
    let out: f64 = FEATURES.iter().map(bump).sum::<f64>() * (x / 0.3).min(1.0);
    let depth = if cos > 0.0 { front } else { back };
    [(x + out) * sin, y, (depth + out) * cos]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The head, about 2.4 m high, centred, looking along +Z. `segments` around it.
pub(super) fn mesh(segments: usize) -> Mesh {
    let (nu, nv) = (segments.max(8) & !1, segments.max(8) * 5 / 4);
    let mesh = grid([nu, nv], [true, false], |i, j| {
        // From the back of the head over -X to the face, +X and the back again, and from the shoulders up.
        let angle = (2.0 * i as f64 / nu as f64 - 1.0) * PI;
        let s = 1.0 - j as f64 / nv as f64;
        let step = 1e-4;
        let slope = |a: [f64; 3], b: [f64; 3]| core::array::from_fn(|k| b[k] - a[k]);
        let along: [f64; 3] = slope(place(angle - step, s), place(angle + step, s));
        let down: [f64; 3] = slope(place(angle, (s - step).max(0.0)), place(angle, (s + step).min(1.0)));
        let n = cross(down, along);
        let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
        let normal = if j == nv { [0.0, 1.0, 0.0] } else { n.map(|v| (v / length) as f32) };
        Point { position: place(angle, s).map(|v| v as f32), normal, uv: [(angle.abs() / PI) as f32, s as f32] }
    });
    Mesh { name: "head".into(), ..mesh }
}

/// Height of the shared map in texels, at u (0 the face, 1 the back) and v (0 the crown): the same on both sides of both
/// seams, so its slope there is 0.
fn height(u: f32, v: f32) -> f32 {
    let (_, cos) = sin_cos_f64(f64::from(u) * PI);
    // Even about u = 0 and u = 1.
    let w = (0.5 - 0.5 * cos) as f32;
    let smooth = |lo: f32, hi: f32, x: f32| {
        let t = ((x - lo) / (hi - lo)).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    };
    let wave = |x: f32| sin_cos_f64(f64::from(x)).0 as f32;
    // Hair: locks that run down and back, below a line that sinks from the forehead to the neck.
    let line = 0.235 + 0.44 * smooth(0.12, 0.75, w) + 0.012 * wave(w * 40.0);
    let hair = 1.0 - smooth(line - 0.012, line + 0.004, v);
    let bend = noise::value(w * 5.0, v * 7.0, 64, 31) * 2.2;
    let lock = wave((w * 9.0 - v * 4.0 + bend) * 6.0);
    let strand = wave((w * 9.0 - v * 4.0 + bend) * 42.0);
    // Brows.
    let arch = v - 0.352 + 0.05 * smooth(0.0, 0.06, w) * (1.0 - smooth(0.06, 0.17, w));
    let brow = (1.0 - smooth(0.006, 0.018, arch.abs())) * smooth(0.006, 0.012, w) * (1.0 - smooth(0.10, 0.14, w));
    // A spiral on each cheek and a band around the neck.
    let (du, dv) = ((u - 0.30) * 2.0, (v - 0.555) * 2.6);
    let r = (du * du + dv * dv).sqrt();
    let turn = crate::math::exact::atan2_f64(f64::from(dv), f64::from(du)) as f32;
    let spiral = wave(r * 75.0 - turn) * (1.0 - smooth(0.13, 0.17, r));
    let band = smooth(0.795, 0.80, v) * (1.0 - smooth(0.855, 0.86, v));
    let meander = wave(w * 60.0) * wave((v - 0.8275) * 190.0);
    let skin = noise::fbm(w * 48.0, v * 64.0, 4096, 3, 5) * 0.8;
    hair * (6.0 + 3.0 * lock + 1.1 * strand) + brow * (2.5 + 0.8 * strand) - 2.0 * spiral.max(0.0) * (1.0 - hair)
        + band * (2.0 + 1.4 * meander)
        + skin * (1.0 - hair)
}

/// Albedo and normal map, 512 x 768: a texel is about 4 mm on both axes.
fn maps() -> (Image, Image) {
    let (w, h) = (512usize, 768usize);
    let heights: Vec<f32> = (0..w * h)
        .into_par_iter()
        .map(|k| height(((k % w) as f32 + 0.5) / w as f32, ((k / w) as f32 + 0.5) / h as f32))
        .collect();
    // Beyond the seams the picture is its own mirror image, beyond crown and shoulders it goes on as it is.
    let at = |x: isize, y: isize| {
        let x = if x < 0 {
            -x - 1
        } else if x >= w as isize {
            2 * w as isize - 1 - x
        } else {
            x
        };
        heights[y.clamp(0, h as isize - 1) as usize * w + x as usize]
    };
    let normals = texture::rgb(w, h, Encoding::Linear, |x, y| {
        let (x, y) = (x as isize, y as isize);
        let across = (at(x + 1, y) - at(x - 1, y)) * 0.5;
        let down = (at(x, y + 1) - at(x, y - 1)) * 0.5;
        normal::encode(Vec3::new(-across, down, 1.0).normalize(), false).array()
    });
    let albedo = texture::rgb(w, h, Encoding::Srgb, |x, y| {
        let high = heights[y * w + x];
        // Patina in what lies low, polish on what stands out.
        let t = ((high - 0.2) / 9.0).clamp(0.0, 1.0);
        let stain = noise::fbm(x as f32 / 64.0, y as f32 / 64.0, 64, 4, 9);
        let mix = |low: f32, top: f32| (low + (top - low) * t) * (0.86 + 0.28 * stain);
        [mix(0.58, 0.80), mix(0.43, 0.58), mix(0.33, 0.36)]
    });
    (albedo, normals)
}

pub(super) fn scene() -> Scene {
    let mut scene = Scene::default();
    let (albedo, normals) = maps();
    let wrap = [Wrap::Mirror, Wrap::Clamp];
    let map = |image| Texture { wrap, ..Texture::new(image) };
    let (albedo, normals) = (map(scene.add_image(albedo)), map(scene.add_image(normals)));
    let clay = scene.add_material(Material {
        name: "terracotta".into(),
        specular: [0.16, 0.15, 0.14],
        shininess: 28.0,
        albedo_map: Some(albedo),
        normal_map: Some(NormalMap { texture: normals, scale: 1.0, y_down: false, channels: 3 }),
        ..Default::default()
    });
    scene.add(mesh(128), Mat4::IDENTITY, clay);
    view(&mut scene, Vec3::new(-1.7, 0.55, 4.6), Vec3::new(0.0, -0.13, 0.0), 31.0);
    let key = Light::directional(Vec3::new(-3.5, 3.2, 3.0), Vec3::splat(0.0));
    scene.lights.push(Light { color: [1.0, 0.92, 0.80], intensity: 1.25, ..key });
    for (from, color, intensity) in
        [(Vec3::new(4.0, 1.5, 2.0), [0.55, 0.68, 1.0], 0.30), (Vec3::new(1.0, 2.0, -4.0), [0.8, 0.9, 1.0], 0.55)]
    {
        let light = Light::directional(from, Vec3::splat(0.0));
        scene.lights.push(Light { color, intensity, shadow: None, ..light });
    }
    scene.ambient.color = [0.13, 0.14, 0.17];
    scene.output = Output {
        size: [900, 1024],
        background: Background::Color([0.025, 0.028, 0.034]),
        tone_map: ToneMap::KhronosNeutral,
        ..Default::default()
    };
    scene
}
