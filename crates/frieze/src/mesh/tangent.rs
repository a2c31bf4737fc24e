//! Tangent frames: MikkTSpace, averaged, per triangle, from the normal alone.
//!
//! A tangent is a unit vector `t` along growing u and a sign `w`; the bitangent is `cross(n, t) * w` (rows 19
//! and 60). It points *up* the image, to smaller v (our v runs down, as glTF's), so that a +Y (OpenGL, glTF)
//! normal map is read as it is: green leans to the side that is up in the picture.

use super::{Attribute, Mesh};
use crate::math::exact;
use crate::math::vec::{Vec2, Vec3, basis};
use bevy_mikktspace::{Geometry, Ops, TangentSpace};

/// Tangents of triangle corners `(triangle, 0 ..= 2)` as an attribute: equal bits at one position are stored once.
/// A polygon's corner takes the value of its first triangle.
fn per_corner(mesh: &Mesh, mut tangent: impl FnMut(usize, usize) -> [f32; 4]) -> Attribute<[f32; 4]> {
    let mut values: Vec<[f32; 4]> = Vec::with_capacity(mesh.positions.len());
    let mut index = vec![u32::MAX; mesh.corners.len()];
    // The distinct values of each position, as a list threaded through `next`.
    let mut head = vec![u32::MAX; mesh.positions.len()];
    let mut next: Vec<u32> = Vec::new();
    for t in 0..mesh.triangle_count() {
        for (k, c) in mesh.triangle(t).into_iter().enumerate() {
            if index[c] != u32::MAX {
                continue;
            }
            let value = tangent(t, k);
            let position = mesh.corners[c] as usize;
            let mut at = head[position];
            while at != u32::MAX && values[at as usize].map(f32::to_bits) != value.map(f32::to_bits) {
                at = next[at as usize];
            }
            if at == u32::MAX {
                at = values.len() as u32;
                values.push(value);
                next.push(head[position]);
                head[position] = at;
            }
            index[c] = at;
        }
    }
    // Corners that no triangle uses (of polygons without area).
    if index.contains(&u32::MAX) {
        values.push([1.0, 0.0, 0.0, 1.0]);
        let last = values.len() as u32 - 1;
        index.iter_mut().filter(|k| **k == u32::MAX).for_each(|k| *k = last);
    }
    Attribute { values, index: Some(index) }
}

fn unit_normal(n: [f32; 3]) -> Vec3 {
    let n = Vec3::from(n).normalize();
    if n.is_finite() && n.length2() > 0.5 { n } else { Vec3::new(0.0, 0.0, 1.0) }
}

fn finite(uv: [f32; 2]) -> Vec2 {
    Vec2::from(uv.map(|x| if x.is_finite() { x } else { 0.0 }))
}

/// Row 59: `t` made perpendicular to the unit vector `n` and of unit length; `None` when nothing is left.
pub fn gram_schmidt(t: Vec3, n: Vec3) -> Option<Vec3> {
    let scale = t.length();
    if scale.is_nan() || scale <= 0.0 || scale.is_infinite() {
        return None;
    }
    // Of unit length first, so that what is left can be judged; twice, because a small rest carries n's rounding.
    let t = t / scale;
    let p = t - n * t.dot(n);
    if p.length2() <= 1e-10 {
        return None;
    }
    let p = p.normalize();
    Some((p - n * p.dot(n)).normalize())
}

/// Row 58: solves `e1 = du1 T + dv1 B`, `e2 = du2 T + dv2 B` for `(T, B)`, the derivatives of position by u
/// and by v (the way v runs: down the image). `None` when the texture coordinates span no area. In f64.
pub fn solve(e1: Vec3, e2: Vec3, d1: Vec2, d2: Vec2) -> Option<(Vec3, Vec3)> {
    let [u1, v1, u2, v2] = [d1.x, d1.y, d2.x, d2.y].map(f64::from);
    let det = u1 * v2 - u2 * v1;
    if det == 0.0 || !det.is_finite() {
        return None;
    }
    let t = e1.zip(e2, |a, b| ((v2 * f64::from(a) - v1 * f64::from(b)) / det) as f32);
    let b = e1.zip(e2, |a, b| ((u1 * f64::from(b) - u2 * f64::from(a)) / det) as f32);
    (t.is_finite() && b.is_finite()).then_some((t, b))
}

/// [`solve`] for a triangle of a mesh.
fn solve_triangle(mesh: &Mesh, uv: &Attribute<[f32; 2]>, t: usize) -> Option<(Vec3, Vec3)> {
    let c = mesh.triangle(t);
    let p = c.map(|c| Vec3::from(mesh.position(c)));
    let q = c.map(|c| finite(uv.at(mesh, c)));
    solve(p[1] - p[0], p[2] - p[0], q[1] - q[0], q[2] - q[0])
}

/// Whether the texture coordinates of a triangle say no direction: its corners get [`from_normal`]'s.
pub fn is_without_area(mesh: &Mesh, uv: &Attribute<[f32; 2]>, triangle: usize) -> bool {
    solve_triangle(mesh, uv, triangle).is_none()
}

/// How many triangles have no area in a UV set.
pub fn without_area(mesh: &Mesh, uv: &Attribute<[f32; 2]>) -> usize {
    (0..mesh.triangle_count()).filter(|&t| is_without_area(mesh, uv, t)).count()
}

/// The tangent of a corner from derivatives and the corner's unit normal; Duff's where that gives none.
fn frame(derivatives: Option<(Vec3, Vec3)>, n: Vec3) -> [f32; 4] {
    match derivatives.and_then(|(t, b)| Some((gram_schmidt(t, n)?, b))) {
        // b points down the image, the bitangent up.
        Some((t, b)) => t.extend(if n.cross(t).dot(b) > 0.0 { -1.0 } else { 1.0 }).array(),
        None => from_unit_normal(n),
    }
}

fn from_unit_normal(n: Vec3) -> [f32; 4] {
    basis(n).0.extend(1.0).array()
}

/// From the normal alone: the first vector of [`basis`], sign +1. For meshes without texture coordinates.
pub fn from_normal(mesh: &Mesh, normals: &Attribute<[f32; 3]>) -> Attribute<[f32; 4]> {
    per_normal(mesh, normals, from_unit_normal)
}

/// One tangent for each value of the normals, with their index.
fn per_normal(mesh: &Mesh, normals: &Attribute<[f32; 3]>, tangent: impl Fn(Vec3) -> [f32; 4]) -> Attribute<[f32; 4]> {
    debug_assert!(normals.index.as_ref().is_none_or(|i| i.len() == mesh.corners.len()));
    Attribute {
        values: normals.values.iter().map(|&n| tangent(unit_normal(n))).collect(),
        index: normals.index.clone(),
    }
}

/// The tangent that GAMES101's assignment 3 computes from the unit normal `n` (row 65): as its hint prints it,
/// `(xy/s, s, zy/s)` with `s = sqrt(x² + z²)`, which is not perpendicular to `n` (erratum E1: at y = 1/√2 it *is*
/// `n`), or `corrected`, `(-xy/s, s, -zy/s)`, which is. At the poles, where s = 0, it is +X.
pub fn games101_tangent(n: Vec3, corrected: bool) -> Vec3 {
    let s = (n.x * n.x + n.z * n.z).sqrt();
    if s == 0.0 {
        return Vec3::new(1.0, 0.0, 0.0);
    }
    let t = Vec3::new(n.x * n.y / s, s, n.z * n.y / s);
    if corrected { Vec3::new(-t.x, t.y, -t.z) } else { t }
}

/// [`games101_tangent`] at every corner, as the hint prints it, sign +1.
pub fn games101(mesh: &Mesh, normals: &Attribute<[f32; 3]>) -> Attribute<[f32; 4]> {
    per_normal(mesh, normals, |n| games101_tangent(n, false).extend(1.0).array())
}

/// Row 58 for each triangle, then rows 59 and 60 with the normal of each corner. A triangle whose texture
/// coordinates span no area takes [`from_normal`].
pub fn per_triangle(mesh: &Mesh, normals: &Attribute<[f32; 3]>, uv: &Attribute<[f32; 2]>) -> Attribute<[f32; 4]> {
    let mut solved = (usize::MAX, None);
    per_corner(mesh, |t, k| {
        if solved.0 != t {
            solved = (t, solve_triangle(mesh, uv, t));
        }
        frame(solved.1, unit_normal(normals.at(mesh, mesh.triangle(t)[k])))
    })
}

/// Row 19, as document 001 does it: the mean of the unit tangents of the triangles around a vertex, then rows 59
/// and 60. A vertex is what shares position, normal, texture coordinate and handedness, so mirrored halves
/// do not mix.
pub fn average(mesh: &Mesh, normals: &Attribute<[f32; 3]>, uv: &Attribute<[f32; 2]>) -> Attribute<[f32; 4]> {
    struct Vertex {
        key: (u32, u32, bool),
        sum: [Vec3; 2],
        next: u32,
    }
    let mut vertices: Vec<Vertex> = Vec::new();
    let mut head = vec![u32::MAX; mesh.positions.len()];
    let mut of = vec![u32::MAX; 3 * mesh.triangle_count()];
    let zero = Vec3::splat(0.0);
    for t in 0..mesh.triangle_count() {
        let solved = solve_triangle(mesh, uv, t);
        let corners = mesh.triangle(t);
        let p = corners.map(|c| Vec3::from(mesh.position(c)));
        let geometric = (p[1] - p[0]).cross(p[2] - p[0]);
        let mirrored = solved.is_some_and(|(t, b)| geometric.dot(t.cross(b)) > 0.0);
        for (k, c) in corners.into_iter().enumerate() {
            let key = (normals.index_at(mesh, c) as u32, uv.index_at(mesh, c) as u32, mirrored);
            let position = mesh.corners[c] as usize;
            let mut at = head[position];
            while at != u32::MAX && vertices[at as usize].key != key {
                at = vertices[at as usize].next;
            }
            if at == u32::MAX {
                at = vertices.len() as u32;
                vertices.push(Vertex { key, sum: [zero; 2], next: head[position] });
                head[position] = at;
            }
            of[3 * t + k] = at;
            if let Some((t, b)) = solved {
                let sum = &mut vertices[at as usize].sum;
                *sum = [sum[0] + t.normalize(), sum[1] + b.normalize()];
            }
        }
    }
    per_corner(mesh, |t, k| {
        let sum = vertices[of[3 * t + k] as usize].sum;
        frame(Some((sum[0], sum[1])), unit_normal(normals.at(mesh, mesh.triangle(t)[k])))
    })
}

/// Our square root and arc cosine for the MikkTSpace crate: its default asks the platform's C library, whose
/// last bits differ.
struct Exact;

impl Ops for Exact {
    fn sqrt(x: f32) -> f32 {
        x.sqrt()
    }
    fn acos(x: f32) -> f32 {
        exact::acos_f64(f64::from(x)) as f32
    }
}

struct Mikk<'a> {
    mesh: &'a Mesh,
    normals: &'a Attribute<[f32; 3]>,
    uv: &'a Attribute<[f32; 2]>,
    tangents: Vec<[f32; 4]>,
}

impl Mikk<'_> {
    fn corner(&self, face: usize, vert: usize) -> usize {
        self.mesh.triangle(face)[vert]
    }
}

impl Geometry<Exact> for Mikk<'_> {
    fn num_faces(&self) -> usize {
        self.mesh.triangle_count()
    }
    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }
    fn position(&self, face: usize, vert: usize) -> [f32; 3] {
        self.mesh.position(self.corner(face, vert))
    }
    fn normal(&self, face: usize, vert: usize) -> [f32; 3] {
        unit_normal(self.normals.at(self.mesh, self.corner(face, vert))).array()
    }
    fn tex_coord(&self, face: usize, vert: usize) -> [f32; 2] {
        // MikkTSpace's v runs up. Only differences count, so -v does what 1 - v would, without rounding.
        let uv = finite(self.uv.at(self.mesh, self.corner(face, vert)));
        [uv.x, -uv.y]
    }
    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, vert: usize) {
        let n = Vec3::from(self.normal(face, vert));
        self.tangents[3 * face + vert] = match space.map(|s| s.tangent_encoded()) {
            Some([x, y, z, w]) if (x * x + y * y + z * z - 1.0).abs() < 1e-3 => [x, y, z, w],
            _ => from_unit_normal(n),
        };
    }
}

/// MikkTSpace (Mikkelsen 2008), which bakers and glTF agree on, over the triangles of the mesh. Where it finds no
/// tangent, [`from_normal`]'s.
///
/// The result has the same bits on every machine, and those of `mikktspace.c` (1.0, Mikkelsen) compiled without fused
/// operations, but where the C library's `acos` rounds otherwise: it weights triangles by an angle in single precision,
/// and ours is within half a unit of double precision before it is rounded to single, so that only an angle that
/// lies that near to the middle between two floats can differ (about one in 10^8). Not parallel within a mesh: call it for several at once.
pub fn mikktspace(mesh: &Mesh, normals: &Attribute<[f32; 3]>, uv: &Attribute<[f32; 2]>) -> Attribute<[f32; 4]> {
    let mut mikk = Mikk { mesh, normals, uv, tangents: vec![[0.0; 4]; 3 * mesh.triangle_count()] };
    for t in 0..mesh.triangle_count() {
        for k in 0..3 {
            mikk.set_tangent(None, t, k);
        }
    }
    // Its error type has no value.
    let _ = bevy_mikktspace::generate_tangents(&mut mikk);
    let Mikk { tangents, .. } = mikk;
    per_corner(mesh, |t, k| tangents[3 * t + k])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shape;

    /// Small pseudo-random numbers in -1 .. 1.
    fn random(seed: &mut u32) -> f32 {
        *seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (*seed >> 8) as f32 / (1 << 23) as f32 - 1.0
    }

    fn parts(mesh: &Mesh) -> (&Attribute<[f32; 3]>, &Attribute<[f32; 2]>) {
        (mesh.normals.as_ref().unwrap(), mesh.uv[0].as_ref().unwrap())
    }

    type Method = fn(&Mesh, &Attribute<[f32; 3]>, &Attribute<[f32; 2]>) -> Attribute<[f32; 4]>;
    const METHODS: [Method; 3] = [mikktspace, average, per_triangle];

    #[test]
    fn row_58_recovers_a_random_affine_map() {
        let mut seed = 1;
        for _ in 0..1000 {
            let mut r = || random(&mut seed);
            let (t, b) = (Vec3::new(r(), r(), r()), Vec3::new(r(), r(), r()));
            let (d1, d2) = (Vec2::new(r(), r()), Vec2::new(r(), r()));
            let det = d1.x * d2.y - d2.x * d1.y;
            if det.abs() < 0.1 {
                continue;
            }
            let (got_t, got_b) = solve(t * d1.x + b * d1.y, t * d2.x + b * d2.y, d1, d2).unwrap();
            // Edges are rounded to f32 (6e-8 of up to 2), and the solve multiplies that by at most 2 / det = 20.
            assert!((got_t - t).length() < 5e-6 && (got_b - b).length() < 5e-6);
        }
    }

    #[test]
    fn row_58_degenerate_texture_coordinates_give_a_frame_without_nan() {
        let mut mesh = shape::sphere(1.0, 8);
        for uv in [[0.5, 0.5], [f32::NAN, 0.0], [f32::INFINITY, 1.0]] {
            for value in &mut mesh.uv[0].as_mut().unwrap().values {
                *value = uv;
            }
            let (n, uv) = parts(&mesh);
            for method in METHODS {
                let tangents = method(&mesh, n, uv);
                for c in 0..mesh.corners.len() {
                    let [x, y, z, w] = tangents.at(&mesh, c);
                    let t = Vec3::new(x, y, z);
                    assert!((t.length() - 1.0).abs() < 1e-6 && w.abs() == 1.0, "{t:?} {w}");
                    assert!(t.dot(unit_normal(n.at(&mesh, c))).abs() < 1e-6);
                }
            }
        }
        assert!(solve(Vec3::splat(1.0), Vec3::splat(2.0), Vec2::new(1.0, 1.0), Vec2::new(2.0, 2.0)).is_none());
    }

    #[test]
    fn row_59_tangents_are_unit_and_perpendicular_to_the_normal() {
        for mesh in [shape::sphere(2.0, 16), shape::torus(2.0, 16), shape::teapot(2.0, 16), shape::cube(1.0)] {
            let (n, uv) = parts(&mesh);
            for method in METHODS {
                let tangents = method(&mesh, n, uv);
                for c in 0..mesh.corners.len() {
                    let [x, y, z, w] = tangents.at(&mesh, c);
                    let t = Vec3::new(x, y, z);
                    // Rounding of three products and a normalisation.
                    assert!((t.length() - 1.0).abs() < 1e-6 && w.abs() == 1.0, "{}", mesh.name);
                    assert!(t.dot(unit_normal(n.at(&mesh, c))).abs() < 1e-6, "{}", mesh.name);
                }
            }
        }
    }

    #[test]
    fn bitangent_points_up_the_image_on_every_shape() {
        // A +Y map's green leans to the side of smaller v. On a wall that faces +Z, with the picture upright, up
        // is +Y and right is +X.
        let wall = Mesh {
            positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
            corners: vec![0, 1, 2, 0, 2, 3],
            normals: Some(Attribute { values: vec![[0.0, 0.0, 1.0]], index: Some(vec![0; 6]) }),
            uv: [Some(Attribute::per_position(vec![[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]])), None],
            ..Default::default()
        };
        let (n, uv) = parts(&wall);
        for method in METHODS {
            let tangents = method(&wall, n, uv);
            for c in 0..6 {
                assert_eq!(tangents.at(&wall, c), [1.0, 0.0, 0.0, 1.0]);
            }
        }
        // None of the shapes mirrors its picture.
        for mesh in [shape::cube(1.0), shape::sphere(1.0, 12), shape::torus(1.0, 12)] {
            let (n, uv) = parts(&mesh);
            for method in METHODS {
                let tangents = method(&mesh, n, uv);
                assert!((0..mesh.corners.len()).all(|c| tangents.at(&mesh, c)[3] == 1.0), "{}", mesh.name);
            }
        }
    }

    #[test]
    fn row_60_mirrored_texture_coordinates_need_the_sign() {
        let mut mesh = shape::plane(1.0, 1);
        for uv in &mut mesh.uv[0].as_mut().unwrap().values {
            uv[0] = 1.0 - uv[0];
        }
        let (n, uv) = parts(&mesh);
        for method in METHODS {
            let tangents = method(&mesh, n, uv);
            for c in 0..mesh.corners.len() {
                let [x, y, z, w] = tangents.at(&mesh, c);
                assert_eq!([x, y, z, w], [-1.0, 0.0, 0.0, -1.0]);
                // Up the image is -Z here; without the sign (erratum E2) it would be +Z.
                let b = Vec3::new(0.0, 1.0, 0.0).cross(Vec3::new(x, y, z)) * w;
                assert_eq!(b.map(|x| x + 0.0).array(), [0.0, 0.0, -1.0]);
                // Row 60's other form agrees, signs included, when it starts from the solved bitangent.
                let (t, down) = solve_triangle(&mesh, uv, c / 3).unwrap();
                let t = gram_schmidt(t, Vec3::new(0.0, 1.0, 0.0)).unwrap();
                let up = gram_schmidt(-down, Vec3::new(0.0, 1.0, 0.0)).unwrap();
                assert!((up - t * up.dot(t) - b).length() < 1e-6);
            }
        }
    }

    #[test]
    fn row_19_shared_vertices_share_a_tangent() {
        let mesh = shape::sphere(1.0, 12);
        let (n, uv) = parts(&mesh);
        let tangents = average(&mesh, n, uv);
        let mut seen = std::collections::HashMap::new();
        for c in 0..mesh.corners.len() {
            let at = tangents.index_at(&mesh, c);
            assert_eq!(*seen.entry((mesh.corners[c], uv.index_at(&mesh, c))).or_insert(at), at);
        }
        // Far fewer values than corners: a tangent is stored once per vertex, three numbers and a sign.
        assert!(tangents.values.len() <= uv.values.len());
        assert_eq!(size_of_val(&tangents.values[0]), 16);
        // On a lat-long sphere the tangent runs along the parallels.
        for c in 0..mesh.corners.len() {
            let [x, y, z] = mesh.position(c);
            let t = tangents.at(&mesh, c);
            if y.abs() < 0.4 {
                let east = Vec3::new(z, 0.0, -x).normalize();
                let seam = [0.0, 1.0].contains(&uv.at(&mesh, c)[0]);
                // The mean of both sides; at the seam only one side is averaged: 15 degrees, and a Gram-Schmidt
                // step. The triangles of a cell lean by different amounts, which is what the rest is for.
                let least = if seam { 0.96 } else { 0.999 };
                assert!(east.dot(Vec3::new(t[0], t[1], t[2])) > least, "{:?} {t:?}", [x, y, z]);
            }
        }
        // A picture mirrored about x = 0: its halves share places, normals and texture coordinates there, but no
        // tangent.
        let mesh = Mesh {
            positions: vec![[-1.0, 0.0, 0.0], [0.0; 3], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]],
            corners: vec![0, 1, 2, 1, 3, 2],
            normals: Some(Attribute { values: vec![[0.0, 0.0, 1.0]], index: Some(vec![0; 6]) }),
            uv: [Some(Attribute::per_position(vec![[1.0, 1.0], [0.0, 1.0], [0.0, 0.0], [1.0, 1.0]])), None],
            ..Default::default()
        };
        let (n, uv) = parts(&mesh);
        let tangents = average(&mesh, n, uv);
        for c in 0..6 {
            let x = if c < 3 { -1.0 } else { 1.0 };
            assert_eq!(tangents.at(&mesh, c), [x, 0.0, 0.0, x]);
        }
    }

    #[test]
    fn row_65_the_hint_is_not_perpendicular_and_the_corrected_tangent_is() {
        let mut seed = 7;
        let mut worst = 0.0f32;
        for _ in 0..10_000 {
            let n = Vec3::new(random(&mut seed), random(&mut seed), random(&mut seed)).normalize();
            if n.length2() < 0.5 {
                continue;
            }
            let (hint, right) = (games101_tangent(n, false), games101_tangent(n, true));
            let s = (n.x * n.x + n.z * n.z).sqrt();
            // Erratum E1: t . n = 2 y s. A handful of roundings of numbers up to 1.
            assert!((hint.dot(n) - 2.0 * n.y * s).abs() < 1e-6);
            worst = worst.max(hint.dot(n).abs());
            assert!(right.dot(n).abs() < 1e-6 && (right.length() - 1.0).abs() < 1e-6);
        }
        assert!(worst > 0.999, "at y = 1/√2 the hint's tangent is the normal itself: {worst}");
        for y in [1.0, -1.0] {
            assert_eq!(games101_tangent(Vec3::new(0.0, y, 0.0), false).array(), [1.0, 0.0, 0.0]);
        }
    }

    #[test]
    fn from_normal_is_a_right_handed_basis() {
        let mesh = shape::sphere(1.0, 16);
        let n = mesh.normals.as_ref().unwrap();
        let t = from_normal(&mesh, n);
        for c in 0..mesh.corners.len() {
            let [x, y, z, w] = t.at(&mesh, c);
            assert!(Vec3::new(x, y, z).dot(n.at(&mesh, c).into()).abs() < 1e-6 && w == 1.0);
        }
    }
}
