//! Built-in shapes, made by code.
//!
//! Triangles are counter-clockwise from outside, u runs to the right and v down as seen from outside, so that a
//! picture on any of them is not mirrored. Positions are shared across seams; texture coordinates (and the
//! normals of the cube) have an index of their own. Everything is computed in f64 with the functions of
//! [`exact`] and rounded once: same bits on all machines.

use super::teapot::{HEIGHT, Mirrors, PATCHES, POINTS};
use super::{Attribute, Mesh};
use crate::math::exact;
use std::collections::HashMap;
use std::f64::consts::TAU;

/// Most segments that a shape is made of; more are taken as this many, so that no argument asks for more memory
/// than a few hundred megabytes.
pub const MAX_SEGMENTS: u32 = 1024;

fn single<const N: usize>(v: [f64; N]) -> [f32; N] {
    // `+ 0.0` turns -0 into 0, so that equal positions have equal bits.
    v.map(|x| x as f32 + 0.0)
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let l = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    if l > 0.0 { v.map(|x| x / l) } else { v }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// A point of a parametric surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Position, metres.
    pub position: [f32; 3],
    /// Unit normal.
    pub normal: [f32; 3],
    /// Texture coordinates, v down.
    pub uv: [f32; 2],
}

/// A grid of `cells[0]` times `cells[1]` quads, each cut into two triangles along its `(i, j)`-`(i+1, j+1)`
/// diagonal. `point(i, j)` is asked once for each `0 <= i <= cells[0]`, `0 <= j <= cells[1]`, j outermost, and
/// `d/di x d/dj` must point outward. Along a `wrap`ped direction the last point takes position and normal of
/// the first and keeps its own uv. A quad edge without length (a pole) makes no triangle.
pub fn grid(cells: [usize; 2], wrap: [bool; 2], mut point: impl FnMut(usize, usize) -> Point) -> Mesh {
    let [nu, nv] = cells;
    let (pu, pv) = (nu + usize::from(!wrap[0]), nv + usize::from(!wrap[1]));
    let mut positions = Vec::with_capacity(pu * pv);
    let mut normals = Vec::with_capacity(pu * pv);
    let mut uv = Vec::with_capacity((nu + 1) * (nv + 1));
    for j in 0..=nv {
        for i in 0..=nu {
            let p = point(i, j);
            uv.push(p.uv);
            if i < pu && j < pv {
                positions.push(p.position);
                normals.push(p.normal);
            }
        }
    }
    let mut corners = Vec::with_capacity(nu * nv * 6);
    let mut uv_index = Vec::with_capacity(nu * nv * 6);
    for j in 0..nv {
        for i in 0..nu {
            let quad = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
            for t in [[0, 1, 2], [0, 2, 3]] {
                let at = t.map(|k: usize| ((quad[k].1 % pv) * pu + quad[k].0 % pu) as u32);
                let [a, b, c] = at.map(|k| positions[k as usize]);
                if a != b && b != c && c != a {
                    corners.extend(at);
                    uv_index.extend(t.map(|k: usize| (quad[k].1 * (nu + 1) + quad[k].0) as u32));
                }
            }
        }
    }
    Mesh {
        positions,
        corners,
        normals: Some(Attribute::per_position(normals)),
        uv: [Some(Attribute { values: uv, index: Some(uv_index) }), None],
        ..Default::default()
    }
}

/// A cube of edge length `size`, centred. Each face shows the whole texture, upright when seen with +Y up (top
/// and bottom: with -Z up and +Z up).
pub fn cube(size: f32) -> Mesh {
    // Normal, right and up of each face as seen from outside.
    const FACES: [[[f32; 3]; 3]; 6] = [
        [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]],
        [[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]],
        [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]],
        [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
        [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        [[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
    ];
    let half = size * 0.5;
    // Position k has the signs of k's bits.
    let positions = (0..8).map(|k| [0, 1, 2].map(|a| if k >> a & 1 == 1 { half } else { -half })).collect();
    let (mut corners, mut normals, mut uv) = (Vec::new(), Vec::new(), Vec::new());
    for (f, [n, right, up]) in FACES.iter().enumerate() {
        for k in [0u32, 1, 2, 0, 2, 3] {
            let (x, y) = ([-1.0, 1.0, 1.0, -1.0][k as usize], [-1.0, -1.0, 1.0, 1.0][k as usize]);
            let p: [f32; 3] = core::array::from_fn(|a| n[a] + x * right[a] + y * up[a]);
            corners.push((0..3).map(|a| u32::from(p[a] > 0.0) << a).sum());
            normals.push(f as u32);
            uv.push(k);
        }
    }
    Mesh {
        name: "cube".into(),
        positions,
        corners,
        normals: Some(Attribute { values: FACES.map(|f| f[0]).to_vec(), index: Some(normals) }),
        uv: [Some(Attribute { values: vec![[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]], index: Some(uv) }), None],
        ..Default::default()
    }
}

/// A square of edge length `size` in the plane y = 0, centred, facing +Y, of `segments`² quads. u runs along
/// +X, v along +Z.
pub fn plane(size: f32, segments: u32) -> Mesh {
    let n = segments.clamp(1, MAX_SEGMENTS) as usize;
    let at = |k: usize| k as f64 / n as f64;
    let mesh = grid([n, n], [false; 2], |i, j| Point {
        position: single([f64::from(size) * (at(i) - 0.5), 0.0, f64::from(size) * (0.5 - at(j))]),
        normal: [0.0, 1.0, 0.0],
        uv: single([at(i), 1.0 - at(j)]),
    });
    Mesh { name: "plane".into(), ..mesh }
}

/// A sphere of diameter `size`, centred, of `segments` meridians and half as many rings. The texture's left edge
/// is at -Z and its middle at +Z (lat-long); at each pole a triangle has the u of its middle.
pub fn sphere(size: f32, segments: u32) -> Mesh {
    let nu = segments.clamp(3, MAX_SEGMENTS) as usize;
    let nv = (nu / 2).max(2);
    let r = f64::from(size) * 0.5;
    let at = |i: usize, j: usize| {
        let (s, c) = exact::sin_cos_f64(TAU * i as f64 / nu as f64);
        let (t, y) = exact::sin_cos_f64(TAU * 0.5 * j as f64 / nv as f64);
        // j counts from the south pole; the longitude grows to the right, from -Z over -X to +Z.
        [-s * t, -y, -c * t]
    };
    let mut positions = vec![[0.0, -r, 0.0]];
    let mut normals = vec![[0.0, -1.0, 0.0]];
    for j in 1..nv {
        for i in 0..nu {
            let n = at(i, j);
            positions.push(n.map(|x| x * r));
            normals.push(n);
        }
    }
    positions.push([0.0, r, 0.0]);
    normals.push([0.0, 1.0, 0.0]);
    let position = |i: usize, j: usize| match j {
        0 => 0,
        _ if j == nv => (1 + (nv - 1) * nu) as u32,
        _ => (1 + (j - 1) * nu + i % nu) as u32,
    };
    // At a pole the uv of column i is halfway between columns i and i + 1.
    let mut uv = Vec::with_capacity((nu + 1) * (nv + 1));
    for j in 0..=nv {
        let shift = if j == 0 || j == nv { 0.5 } else { 0.0 };
        uv.extend((0..=nu).map(|i| single([(i as f64 + shift) / nu as f64, 1.0 - j as f64 / nv as f64])));
    }
    let (mut corners, mut uv_index) = (Vec::new(), Vec::new());
    let mut corner = |i: usize, j: usize| {
        corners.push(position(i, j));
        uv_index.push((j * (nu + 1) + i) as u32);
    };
    for j in 0..nv {
        for i in 0..nu {
            if j > 0 {
                corner(i, j);
                corner(i + 1, j);
                if j + 1 == nv {
                    corner(i, nv);
                    continue;
                }
                corner(i + 1, j + 1);
                corner(i, j);
            } else {
                corner(i, 0);
            }
            corner(i + 1, j + 1);
            corner(i, j + 1);
        }
    }
    Mesh {
        name: "sphere".into(),
        positions: positions.into_iter().map(single).collect(),
        corners,
        normals: Some(Attribute::per_position(normals.into_iter().map(single).collect())),
        uv: [Some(Attribute { values: uv, index: Some(uv_index) }), None],
        ..Default::default()
    }
}

/// A torus about the Y axis, centred, of outer diameter `size`; its tube is 0.3 `size` thick. `segments` go
/// around the axis and half as many around the tube.
pub fn torus(size: f32, segments: u32) -> Mesh {
    let nu = segments.clamp(3, MAX_SEGMENTS) as usize;
    let nv = (nu / 2).max(3);
    let (major, minor) = (f64::from(size) * 0.35, f64::from(size) * 0.15);
    let mesh = grid([nu, nv], [true; 2], |i, j| {
        let (u, v) = (i as f64 / nu as f64, j as f64 / nv as f64);
        let (s, c) = exact::sin_cos_f64(TAU * u);
        // v = 0 is the seam at the inner equator; j climbs over the bottom, the outside, the top.
        let (h, o) = exact::sin_cos_f64(TAU * v);
        let n = [-s * -o, -h, -c * -o];
        let ring = [-s * major, 0.0, -c * major];
        Point {
            position: single([0, 1, 2].map(|a| ring[a] + n[a] * minor)),
            normal: single(n),
            uv: single([u, 1.0 - v]),
        }
    });
    Mesh { name: "torus".into(), ..mesh }
}

/// A profile turned about the Y axis into `segments` parts, with the profile's points from the *bottom* of the
/// outside to wherever it ends, walking so that outside is to the right: `(radius, height)` in metres. Normals
/// follow the profile smoothly, except at points given twice, where there is an edge. v runs down along the
/// profile's length, u around, from -Z over -X.
pub fn lathe(profile: &[[f32; 2]], segments: u32) -> Mesh {
    let n = segments.clamp(3, MAX_SEGMENTS) as usize;
    if profile.len() < 2 {
        return Mesh::default();
    }
    let p: Vec<[f64; 2]> = profile.iter().map(|q| q.map(f64::from)).collect();
    let chord = |a: [f64; 2], b: [f64; 2]| [b[0] - a[0], b[1] - a[1]];
    let length = |d: [f64; 2]| (d[0] * d[0] + d[1] * d[1]).sqrt();
    let mut along = vec![0.0];
    for w in p.windows(2) {
        along.push(along[along.len() - 1] + length(chord(w[0], w[1])));
    }
    let total = along[along.len() - 1].max(f64::MIN_POSITIVE);
    // Normal in the half plane: the mean direction of the chords at a point, turned to the outside.
    let normal: Vec<[f64; 2]> = (0..p.len())
        .map(|k| {
            let mut d = [0.0; 2];
            for (a, b) in [(k.wrapping_sub(1), k), (k, k + 1)] {
                if a < p.len() && b < p.len() {
                    let c = chord(p[a], p[b]);
                    let l = length(c);
                    if l > 0.0 {
                        d = [d[0] + c[0] / l, d[1] + c[1] / l];
                    }
                }
            }
            let l = length(d).max(f64::MIN_POSITIVE);
            [d[1] / l, -d[0] / l]
        })
        .collect();
    grid([n, p.len() - 1], [true, false], |i, j| {
        let (s, c) = exact::sin_cos_f64(TAU * i as f64 / n as f64);
        let [r, y] = p[j];
        let pole = r == 0.0;
        Point {
            position: single([-s * r, y, -c * r]),
            normal: if pole {
                single([0.0, if normal[j][1] < 0.0 { -1.0 } else { 1.0 }, 0.0])
            } else {
                single([-s * normal[j][0], normal[j][1], -c * normal[j][0]])
            },
            uv: single([i as f64 / n as f64, 1.0 - along[j] / total]),
        }
    })
}

/// Position and both derivatives of a bicubic Bezier patch: Bernstein polynomials, rows along `t`.
fn bezier(p: &[[f64; 3]; 16], s: f64, t: f64) -> [[f64; 3]; 3] {
    let b = |x: f64| {
        let y = 1.0 - x;
        [y * y * y, 3.0 * x * y * y, 3.0 * x * x * y, x * x * x]
    };
    let d = |x: f64| {
        let y = 1.0 - x;
        [-3.0 * y * y, 3.0 * y * y - 6.0 * x * y, 6.0 * x * y - 3.0 * x * x, 3.0 * x * x]
    };
    let sum = |ws: [f64; 4], wt: [f64; 4]| {
        let mut v = [0.0; 3];
        for r in 0..4 {
            for c in 0..4 {
                for a in 0..3 {
                    v[a] += wt[r] * ws[c] * p[4 * r + c][a];
                }
            }
        }
        v
    };
    [sum(b(s), b(t)), sum(d(s), b(t)), sum(b(s), d(t))]
}

/// Newell's teapot, `size` high, standing on y = 0, the spout at +X. A patch edge is cut into `segments / 4`
/// pieces (two at least), so that `segments` go around the body. It is open where lid and rim meet and inside the spout, as
/// the original: show it double-sided. The turned parts share one texture, u around from the handle, v down
/// from the knob; handle and spout take the whole texture each.
pub fn teapot(size: f32, segments: u32) -> Mesh {
    let n = (segments.min(MAX_SEGMENTS) / 4).max(2) as usize;
    let scale = f64::from(size) / HEIGHT;
    let mut mesh = Mesh { name: "teapot".into(), ..Default::default() };
    let (mut normals, mut normal_index) = (Vec::new(), Vec::new());
    let (mut uv, mut uv_index) = (Vec::new(), Vec::new());
    // Neighbours compute a shared border in opposite directions, so their last bits differ: points are the
    // same when they are within about 1e-9 of the pot. Only looked up, never iterated.
    let mut known: HashMap<[i64; 3], u32> = HashMap::new();
    for patch in &PATCHES {
        let images: &[([f64; 2], f64, f64)] = match patch.mirrors {
            // Signs of x and y; u at column 0, and how far u goes along the columns.
            Mirrors::Quadrant => &[
                ([1.0, 1.0], 0.5, -0.25),
                ([1.0, -1.0], 0.5, 0.25),
                ([-1.0, -1.0], 1.0, -0.25),
                ([-1.0, 1.0], 0.0, 0.25),
            ],
            Mirrors::Half => &[([1.0, 1.0], 0.5, -0.5), ([1.0, -1.0], 0.5, 0.5)],
        };
        for &(mirror, u0, du) in images {
            let control = patch.points.map(|k| {
                let [x, y, z] = POINTS[usize::from(k)];
                // From the data's axes (+z up) to ours.
                [x * mirror[0], z, -y * mirror[1]]
            });
            let flip = mirror[0] * mirror[1] < 0.0;
            let first = normals.len() as u32;
            let mut ids = Vec::with_capacity((n + 1) * (n + 1));
            for j in 0..=n {
                for i in 0..=n {
                    let (s, t) = (i as f64 / n as f64, j as f64 / n as f64);
                    let [p, _, _] = bezier(&control, s, t);
                    let key = p.map(|x| (x * 1e9).round() as i64);
                    ids.push(*known.entry(key).or_insert_with(|| {
                        mesh.positions.push(single(key.map(|x| x as f64 * 1e-9 * scale)));
                        mesh.positions.len() as u32 - 1
                    }));
                    // At a pole one derivative vanishes; a step inside it does not. 1e-3 of a patch is far
                    // below a pixel, and on the axis symmetry gives the exact answer.
                    let inside = |x: f64| x.clamp(1e-3, 1.0 - 1e-3);
                    let axis = patch.mirrors == Mirrors::Quadrant && key[0] == 0 && key[2] == 0;
                    let [_, mut ds, mut dt] = bezier(&control, s, t);
                    if axis {
                        [_, ds, dt] = bezier(&control, inside(s), inside(t));
                    }
                    let mut m = if flip { cross(dt, ds) } else { cross(ds, dt) };
                    if axis {
                        m = [0.0, m[1], 0.0];
                    }
                    normals.push(single(unit(m)));
                    let v = patch.v[0] + (patch.v[1] - patch.v[0]) * t;
                    uv.push(single([u0 + du * s, v]));
                }
            }
            for j in 0..n {
                for i in 0..n {
                    let at = |i: usize, j: usize| j * (n + 1) + i;
                    let mut quad = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                    if flip {
                        quad.reverse();
                    }
                    for t in [[0, 1, 2], [0, 2, 3]] {
                        let t = t.map(|k: usize| quad[k]);
                        let [a, b, c] = t.map(|k| ids[k]);
                        if a != b && b != c && c != a {
                            mesh.corners.extend([a, b, c]);
                            normal_index.extend(t.map(|k| first + k as u32));
                            uv_index.extend(t.map(|k| first + k as u32));
                        }
                    }
                }
            }
        }
    }
    mesh.normals = Some(Attribute { values: normals, index: Some(normal_index) });
    mesh.uv[0] = Some(Attribute { values: uv, index: Some(uv_index) });
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec::Vec3;

    fn all() -> Vec<(Mesh, bool)> {
        // Whether the shape is closed: every edge has two triangles that run along it in opposite directions.
        let cup = lathe(&[[0.0, 0.0], [0.5, 0.0], [0.5, 0.0], [0.6, 1.0], [0.5, 1.0], [0.0, 0.1]], 12);
        vec![
            (cube(2.0), true),
            (plane(2.0, 3), false),
            (sphere(2.0, 3), true),
            (sphere(2.0, 32), true),
            (torus(2.0, 24), true),
            (teapot(2.0, 32), false),
            (teapot(2.0, 1), false),
            (cup, false),
        ]
    }

    fn vector(p: [f32; 3]) -> Vec3 {
        p.into()
    }

    #[test]
    fn triangles_turn_counter_clockwise_and_normals_point_outward() {
        for (mesh, _) in all() {
            let normals = mesh.normals.as_ref().unwrap();
            for t in 0..mesh.triangle_count() {
                let c = mesh.triangle(t);
                let [p, q, r] = c.map(|c| vector(mesh.position(c)));
                let face = (q - p).cross(r - p);
                assert!(face.length() > 0.0, "{}: triangle {t} has no area", mesh.name);
                for c in c {
                    let n = vector(normals.at(&mesh, c));
                    // Unit length up to the rounding of three components.
                    assert!((n.length() - 1.0).abs() < 3e-7, "{}: {n:?}", mesh.name);
                    // Unless it is very coarse: even in the tightest fold, the lip of the spout, a triangle bends by less than a right angle.
                    if mesh.triangle_count() > 300 {
                        assert!(n.dot(face.normalize()) > 0.0, "{}: triangle {t}: {n:?} {face:?}", mesh.name);
                    }
                }
            }
        }
    }

    #[test]
    fn normals_point_away_from_the_middle() {
        for mesh in [cube(1.0), sphere(1.0, 16)] {
            for c in 0..mesh.corners.len() {
                assert!(vector(mesh.normals.as_ref().unwrap().at(&mesh, c)).dot(vector(mesh.position(c))) > 0.0);
            }
        }
        let pot = teapot(3.15, 32);
        for c in 0..pot.corners.len() {
            let [x, y, z] = pot.position(c);
            let n = pot.normals.as_ref().unwrap().at(&pot, c);
            // The belly between handle and spout.
            if (0.5..2.0).contains(&y) && x.abs() < 1.0 && z.abs() > 1.3 {
                assert!(n[0] * x + n[2] * z > 0.5, "{:?} {n:?}", [x, y, z]);
            }
        }
    }

    #[test]
    fn no_texture_is_mirrored_and_v_runs_down() {
        for (mesh, _) in all() {
            let uv = mesh.uv[0].as_ref().unwrap();
            for t in 0..mesh.triangle_count() {
                let [a, b, c] = mesh.triangle(t).map(|c| uv.at(&mesh, c).map(f64::from));
                // Counter-clockwise with v up means clockwise sign with v down.
                let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
                assert!(area < 0.0, "{}: triangle {t}: {a:?} {b:?} {c:?}", mesh.name);
            }
        }
    }

    #[test]
    fn closed_shapes_have_two_triangles_at_every_edge() {
        for (mesh, closed) in all() {
            let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
            for t in 0..mesh.triangle_count() {
                let c = mesh.triangle(t).map(|c| mesh.corners[c]);
                for k in 0..3 {
                    *edges.entry((c[k], c[(k + 1) % 3])).or_default() += 1;
                }
            }
            assert!(edges.values().all(|&n| n == 1), "{}: an edge runs the same way twice", mesh.name);
            let open = edges.keys().filter(|&&(a, b)| !edges.contains_key(&(b, a))).count();
            assert_eq!(open == 0, closed, "{}: {open} open edges", mesh.name);
        }
    }

    #[test]
    fn the_teapot_is_newells() {
        // 4 * 6 turned patches and 2 * 4 of handle and spout; 306 points, 290 of them distinct, in his list.
        let images = |m| if m == Mirrors::Quadrant { 4 } else { 2 };
        assert_eq!(PATCHES.iter().map(|p| images(p.mirrors)).sum::<i32>(), 32);
        let pot = teapot(3.15, 64);
        let (lo, hi) = pot.bounds().unwrap();
        // Knob to base; handle to the tip of the spout (3.4336 is where its lip bulges out most).
        assert_eq!((lo[1], hi[1]), (0.0, 3.15));
        // The extremes need not be grid points: a patch edge has 16 pieces.
        assert!((lo[0] + 3.0).abs() < 2e-3 && (hi[0] - 3.434).abs() < 5e-3, "{lo:?} {hi:?}");
        assert!((lo[2] + 2.0).abs() < 2e-2 && (hi[2] - 2.0).abs() < 2e-2, "{lo:?} {hi:?}");
        // 32 patches of 2 n² triangles, less one per column at the two poles.
        assert_eq!(pot.triangle_count(), 32 * 2 * 16 * 16 - 8 * 16);
        // Open are only: lid and rim where they meet, and both ends of handle and spout.
        let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
        for c in pot.corners.chunks_exact(3) {
            for k in 0..3 {
                *edges.entry((c[k].min(c[(k + 1) % 3]), c[k].max(c[(k + 1) % 3]))).or_default() += 1;
            }
        }
        assert_eq!(edges.values().filter(|&&n| n == 1).count(), 16 * (4 + 4 + 4 * 2));
    }

    #[test]
    fn any_number_of_segments_is_possible() {
        for n in [0, 1, 2, u32::MAX] {
            assert!(sphere(1.0, n).triangle_count() > 0);
        }
        assert!(plane(1.0, 0).triangle_count() == 2 && torus(1.0, 0).triangle_count() > 0);
    }
}
