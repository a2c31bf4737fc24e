//! Many triangles: sixteen torus knots on a ground, one mesh, two 2048² maps, a 2048² shadow map. In kind the
//! frames W2 (250 k triangles) and W3 (5 M) of the benchmark.

use super::texture;
use crate::math::exact;
use crate::math::vec::Vec3;
use crate::mesh::{Attribute, Mesh};
use crate::scene::{Ambient, Background, Camera, Light, Material, NormalMap, Output, Scene, Shadow, Texture, View};
use rayon::prelude::*;
use std::f64::consts::TAU;

type V3 = [f64; 3];

fn add(a: V3, b: V3, s: f64) -> V3 {
    core::array::from_fn(|k| a[k] + b[k] * s)
}
fn cross(a: V3, b: V3) -> V3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
fn unit(a: V3) -> V3 {
    let l = (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt().max(1e-12);
    a.map(|x| x / l)
}

/// A grid of vertices, all its own, with normals and tangents from central differences.
struct Grid {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    tangents: Vec<[f32; 4]>,
    uv: Vec<[f32; 2]>,
    corners: Vec<u32>,
}

/// `wrap`: both directions close. `repeat`: how often the texture repeats. `flip`: `dp/du x dp/dv` points inward.
fn grid(nu: usize, nv: usize, wrap: bool, repeat: [f64; 2], flip: bool, p: impl Fn(usize, usize) -> V3) -> Grid {
    let at: Vec<V3> = (0..(nu + 1) * (nv + 1)).map(|k| p(k / (nv + 1), k % (nv + 1))).collect();
    let point = |i: usize, j: usize| at[i * (nv + 1) + j];
    let around = |k: usize, n: usize| {
        if wrap {
            (if k == 0 { n - 1 } else { k - 1 }, if k == n { 1 } else { k + 1 })
        } else {
            (k.saturating_sub(1), (k + 1).min(n))
        }
    };
    let mut g = Grid {
        positions: Vec::with_capacity(at.len()),
        normals: Vec::with_capacity(at.len()),
        tangents: Vec::with_capacity(at.len()),
        uv: Vec::with_capacity(at.len()),
        corners: Vec::with_capacity(nu * nv * 6),
    };
    for i in 0..=nu {
        for j in 0..=nv {
            let ((i0, i1), (j0, j1)) = (around(i, nu), around(j, nv));
            let du = add(point(i1, j), point(i0, j), -1.0);
            let dv = add(point(i, j1), point(i, j0), -1.0);
            let n = unit(cross(du, dv));
            let t = unit(add(du, n, -(du[0] * n[0] + du[1] * n[1] + du[2] * n[2])));
            // The bitangent points to smaller v, which is -dv.
            let (n, w) = if flip { (n.map(|x| -x), 1.0) } else { (n, -1.0) };
            g.positions.push(point(i, j).map(|x| x as f32));
            g.normals.push(n.map(|x| x as f32));
            g.tangents.push([t[0] as f32, t[1] as f32, t[2] as f32, w]);
            g.uv.push([(repeat[0] * i as f64 / nu as f64) as f32, (repeat[1] * j as f64 / nv as f64) as f32]);
        }
    }
    for i in 0..nu {
        for j in 0..nv {
            let k = (i * (nv + 1) + j) as u32;
            let m = k + nv as u32 + 1;
            g.corners.extend(if flip { [m + 1, m, k, k + 1, m + 1, k] } else { [k, m, m + 1, k, m + 1, k + 1] });
        }
    }
    g
}

/// A torus knot with a rippled tube, turned by `angle` about Y, at `origin`.
fn knot(nu: usize, nv: usize, phase: f64, angle: f64, origin: V3) -> Grid {
    let sc = exact::sin_cos_f64;
    let curve = |t: f64| {
        let r = 1.0 + 0.42 * sc(3.0 * t).1;
        let (s, c) = sc(2.0 * t);
        [r * c, 0.45 * sc(3.0 * t).0, r * s]
    };
    let (sin, cos) = sc(angle);
    let around: Vec<(f64, f64, f64, f64)> = (0..=nv)
        .map(|j| {
            let a = TAU * j as f64 / nv as f64;
            let (s, c) = sc(a);
            (s, c, sc(3.0 * a).1, sc(7.0 * a).0)
        })
        .collect();
    let rings: Vec<(V3, V3, V3, f64)> = (0..=nu)
        .map(|i| {
            let t = TAU * i as f64 / nu as f64;
            let e = 1e-4;
            let d = unit(add(curve(t + e), curve(t - e), -1.0));
            let (s, c) = sc(2.0 * t);
            let b = unit(cross(d, [c, 0.0, s]));
            (curve(t), cross(b, d), b, sc(40.0 * t + phase).0)
        })
        .collect();
    // The tube's parameters turn so that du x dv points inward.
    grid(nu, nv, true, [8.0, 1.0], true, |i, j| {
        let (p, n, b, ripple) = rings[i];
        let (s, c, c3, s7) = around[j];
        let radius = 0.26 * (1.0 + 0.10 * ripple * c3 + 0.05 * s7);
        let q = add(add(p, n, radius * c), b, radius * s);
        add([q[0] * cos + q[2] * sin, q[1], -q[0] * sin + q[2] * cos], origin, 1.0)
    })
}

/// The scene of `nu` x `nv` quads per knot, maps of `texels`², a ground of `ground`² quads.
pub(super) fn scene(nu: usize, nv: usize, ground: usize, texels: usize) -> Scene {
    let mut parts: Vec<Grid> = (0..16usize)
        .into_par_iter()
        .map(|k| {
            let (r, c) = ((k / 4) as f64, (k % 4) as f64);
            let angle = 0.35 * (r - 1.5) + 0.5 * c;
            knot(nu, nv, k as f64, angle, [(c - 1.5) * 3.0, 0.0, (r - 1.5) * 3.0])
        })
        .collect();
    parts.push(grid(ground, ground, false, [8.0, 8.0], false, |i, j| {
        let at = |k: usize| 24.0 * k as f64 / ground as f64 - 12.0;
        [at(i), -0.95, -at(j)]
    }));
    let mut mesh = Mesh { name: "knots".into(), ..Default::default() };
    let (mut normals, mut tangents, mut uv) = (Vec::new(), Vec::new(), Vec::new());
    for mut part in parts {
        let base = mesh.positions.len() as u32;
        mesh.positions.append(&mut part.positions);
        normals.append(&mut part.normals);
        tangents.append(&mut part.tangents);
        uv.append(&mut part.uv);
        mesh.corners.extend(part.corners.iter().map(|k| k + base));
    }
    mesh.normals = Some(Attribute::per_position(normals));
    mesh.tangents = Some(Attribute::per_position(tangents));
    mesh.uv[0] = Some(Attribute::per_position(uv));

    let (albedo, normal) = texture::stress(texels);
    let mut scene = Scene::default();
    let albedo = Texture { srgb: Some(false), ..Texture::new(scene.add_image(albedo)) };
    let normal = Texture::new(scene.add_image(normal));
    let material = scene.add_material(Material {
        name: "knots".into(),
        specular: [0.3; 3],
        shininess: 32.0,
        albedo_map: Some(albedo),
        normal_map: Some(NormalMap { texture: normal, scale: 1.0, y_down: false, channels: 3 }),
        ..Default::default()
    });
    scene.add(mesh, Default::default(), material);
    let eye = Vec3::new(0.0, 5.6, 8.6);
    let camera = Camera::look_at(eye, Vec3::new(0.0, -0.9, 0.4), Vec3::new(0.0, 1.0, 0.0), 45.0);
    scene.cameras.push(Camera { near: 0.5, far: 40.0, ..camera });
    scene.view = View::Camera(0);
    let towards = Vec3::new(0.5, 1.0, 0.35).normalize();
    scene.lights.push(Light {
        shadow: Some(Shadow { size: 2048, near: Some(0.0), far: Some(40.0), extent: Some(9.5), ..Default::default() }),
        ..Light::directional(towards * 18.0, Vec3::splat(0.0))
    });
    scene.ambient = Ambient { color: [0.12; 3], per_light: false };
    scene.output =
        Output { size: [1920, 1080], background: Background::Color([0.0; 3]), samples: 1, ..Default::default() };
    scene
}
