//! Who touches whom; normals of triangles and vertices.

use super::{Attribute, Mesh};
use crate::math::exact;
use rayon::prelude::*;

/// How much each adjoining triangle counts in a vertex normal (row 18).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weight {
    /// By its area.
    Area,
    /// By its angle at the vertex: does not depend on how polygons are cut into triangles.
    Angle,
    /// All alike.
    Uniform,
}

/// The twin of a half-edge that has none.
pub const NONE: u32 = u32::MAX;

/// For each position the first position of equal value (0 and -0 are equal). Files split vertices where
/// texture coordinates or normals part; this undoes it for questions of shape.
pub fn weld(positions: &[[f32; 3]]) -> Vec<u32> {
    // `+ 0.0` turns -0 into 0. Keys are distinct because the index is part of them, so the order is unique.
    let mut order: Vec<([u32; 3], u32)> =
        positions.par_iter().enumerate().map(|(k, p)| (p.map(|x| (x + 0.0).to_bits()), k as u32)).collect();
    order.par_sort_unstable();
    let mut first = vec![0; positions.len()];
    let mut run = 0;
    for k in 0..order.len() {
        if order[k].0 != order[run].0 {
            run = k;
        }
        first[order[k].1 as usize] = order[run].1;
    }
    first
}

/// For each half-edge `3 t + k` (of triangle `t`, from its corner `k` to the next) the half-edge of another
/// triangle that runs the opposite way between the same welded positions, or [`NONE`] at a border and where
/// more than two triangles meet. `weld` is [`weld`] of the mesh's positions.
pub fn twins(mesh: &Mesh, weld: &[u32]) -> Vec<u32> {
    let mut edges: Vec<(u32, u32, u32)> = (0..mesh.triangle_count())
        .into_par_iter()
        .flat_map_iter(|t| {
            let p = mesh.triangle(t).map(|c| weld[mesh.corners[c] as usize]);
            (0..3).map(move |k| {
                let (a, b) = (p[k], p[(k + 1) % 3]);
                (a.min(b), a.max(b), (3 * t + k) as u32)
            })
        })
        .collect();
    edges.par_sort_unstable();
    let mut twin = vec![NONE; edges.len()];
    for run in edges.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
        let &[(a, b, e), (_, _, f)] = run else { continue };
        let start = |h: u32| weld[mesh.corners[mesh.triangle(h as usize / 3)[h as usize % 3]] as usize];
        if a != b && start(e) != start(f) {
            (twin[e as usize], twin[f as usize]) = (f, e);
        }
    }
    twin
}

fn edge(a: [f32; 3], b: [f32; 3]) -> [f64; 3] {
    core::array::from_fn(|k| f64::from(b[k]) - f64::from(a[k]))
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn single(v: [f64; 3]) -> [f32; 3] {
    // `+ 0.0` turns -0 into 0.
    v.map(|x| x as f32 + 0.0)
}

/// Unit normal of a triangle (counter-clockwise from the front) and its length before, twice the area; `None`
/// when it has no area. In f64, so that neither tiny nor huge triangles under- or overflow.
fn face_normal([a, b, c]: [[f32; 3]; 3]) -> Option<([f64; 3], f64)> {
    let n = cross(edge(a, b), edge(a, c));
    let length = dot(n, n).sqrt();
    (length > 0.0 && length.is_finite()).then(|| (n.map(|x| x / length), length))
}

/// The geometric unit normal of each triangle; zero where it has no area.
pub fn geometric_normals(mesh: &Mesh) -> Vec<[f32; 3]> {
    (0..mesh.triangle_count())
        .into_par_iter()
        .map(|t| face_normal(mesh.triangle(t).map(|c| mesh.position(c))).map_or([0.0; 3], |(n, _)| single(n)))
        .collect()
}

/// Unit normals for each position: the weighted mean of the geometric normals of the triangles there (row 18).
///
/// Positions of equal value share one normal, even when the file lists them apart, so that texture seams do not
/// show in the shading. Triangles without area do not count. Where normals cancel out (a sheet with two sides)
/// the first triangle decides; a position that no triangle uses gets +Y. Sums run in the order of triangles, in
/// f64, whatever the number of threads.
pub fn vertex_normals(mesh: &Mesh, weight: Weight) -> Attribute<[f32; 3]> {
    let weld = weld(&mesh.positions);
    let fans = Fans::new(mesh, &weld);
    let sums: Vec<[f32; 3]> =
        (0..mesh.positions.len()).into_par_iter().map(|v| mean(mesh, fans.at(v), weight, |_| true)).collect();
    let values = weld.par_iter().map(|&first| sums[first as usize]).collect();
    Attribute::per_position(values)
}

/// The cosine of the angle between two triangles from which on their common edge is sharp: 60 degrees.
const CREASE: f64 = 0.5;

/// Unit normals for models that have none: as [`vertex_normals`] by angle, but at each corner only of the triangles
/// that differ from the corner's own by less than 60 degrees, so that a box has edges and a cylinder is round.
/// Per position where nothing is sharp, else per corner.
pub fn creased_normals(mesh: &Mesh) -> Attribute<[f32; 3]> {
    let weld = weld(&mesh.positions);
    let fans = Fans::new(mesh, &weld);
    let faces: Vec<Option<[f64; 3]>> = (0..mesh.triangle_count())
        .into_par_iter()
        .map(|t| face_normal(mesh.triangle(t).map(|c| mesh.position(c))).map(|(n, _)| n))
        .collect();
    let near = |a: u32, b: u32| match (faces[a as usize / 3], faces[b as usize / 3]) {
        (Some(a), Some(b)) => dot(a, b) > CREASE,
        _ => true,
    };
    let sharp = |v: &usize| {
        let fan = fans.at(*v);
        fan.iter().any(|&a| fan.iter().any(|&b| !near(a, b)))
    };
    if !(0..mesh.positions.len()).into_par_iter().any(|v| sharp(&v)) {
        return vertex_normals(mesh, Weight::Angle);
    }
    let own: Vec<Vec<[f32; 3]>> = (0..mesh.positions.len())
        .into_par_iter()
        .map(|v| {
            let fan = fans.at(v);
            if sharp(&v) {
                fan.iter().map(|&h| mean(mesh, fan, Weight::Angle, |other| near(h, other))).collect()
            } else {
                vec![mean(mesh, fan, Weight::Angle, |_| true)]
            }
        })
        .collect();
    let mut values: Vec<[f32; 3]> = Vec::with_capacity(mesh.positions.len());
    let mut index = vec![0u32; mesh.corners.len()];
    for (v, own) in own.iter().enumerate() {
        let first = values.len();
        for (k, &h) in fans.at(v).iter().enumerate() {
            let n = own[k.min(own.len() - 1)];
            let at = values[first..].iter().position(|known| *known == n).unwrap_or_else(|| {
                values.push(n);
                values.len() - 1 - first
            });
            index[mesh.triangle(h as usize / 3)[h as usize % 3]] = (first + at) as u32;
        }
    }
    Attribute { values, index: Some(index) }
}

/// The geometric normal of each triangle at its three corners: what glTF asks for where a file has no normals (3.7.2.1).
pub fn flat_normals(mesh: &Mesh) -> Attribute<[f32; 3]> {
    let mut values = geometric_normals(mesh);
    // Without area it is not seen; a zero would still be found fault with.
    values.par_iter_mut().filter(|n| **n == [0.0; 3]).for_each(|n| *n = [0.0, 1.0, 0.0]);
    let mut index = vec![0u32; mesh.corners.len()];
    for t in 0..mesh.triangle_count() {
        for c in mesh.triangle(t) {
            index[c] = t as u32;
        }
    }
    Attribute { values, index: Some(index) }
}

/// The corners of triangles around each welded position, as `3 t + k`, in the order of triangles.
struct Fans {
    starts: Vec<u32>,
    corners: Vec<u32>,
}

impl Fans {
    /// A counting sort.
    fn new(mesh: &Mesh, weld: &[u32]) -> Self {
        let count = mesh.triangle_count();
        let mut starts = vec![0u32; mesh.positions.len() + 1];
        for t in 0..count {
            for c in mesh.triangle(t) {
                starts[weld[mesh.corners[c] as usize] as usize + 1] += 1;
            }
        }
        for k in 1..starts.len() {
            starts[k] += starts[k - 1];
        }
        let mut next = starts.clone();
        let mut corners = vec![0u32; 3 * count];
        for t in 0..count {
            for (k, c) in mesh.triangle(t).into_iter().enumerate() {
                let at = &mut next[weld[mesh.corners[c] as usize] as usize];
                corners[*at as usize] = (3 * t + k) as u32;
                *at += 1;
            }
        }
        Fans { starts, corners }
    }
    fn at(&self, v: usize) -> &[u32] {
        &self.corners[self.starts[v] as usize..self.starts[v + 1] as usize]
    }
}

/// The mean normal of those triangles around a position that count.
fn mean(mesh: &Mesh, fan: &[u32], weight: Weight, counts: impl Fn(u32) -> bool) -> [f32; 3] {
    let mut sum = [0.0f64; 3];
    let mut first = None;
    let mut largest = 0.0f64;
    for &h in fan.iter().filter(|&&h| counts(h)) {
        let (t, k) = (h as usize / 3, h as usize % 3);
        let p = mesh.triangle(t).map(|c| mesh.position(c));
        let Some((n, twice_area)) = face_normal(p) else { continue };
        first = first.or(Some(n));
        largest = largest.max(twice_area);
        let w = match weight {
            Weight::Area => twice_area,
            Weight::Uniform => 1.0,
            Weight::Angle => {
                // |e x f| = twice the area at every corner.
                let (e, f) = (edge(p[k], p[(k + 1) % 3]), edge(p[k], p[(k + 2) % 3]));
                exact::atan2_f64(twice_area, dot(e, f))
            }
        };
        for a in 0..3 {
            sum[a] += n[a] * w;
        }
    }
    let length = dot(sum, sum).sqrt();
    // Cancelled means: shorter than what rounding leaves of the summands.
    let scale = if weight == Weight::Area { largest } else { 1.0 };
    match first {
        Some(_) if length > 1e-9 * scale => single(sum.map(|x| x / length)),
        Some(n) => single(n),
        None => [0.0, 1.0, 0.0],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shape;

    #[test]
    fn row_18_angle_weights_do_not_depend_on_the_diagonals() {
        let mut cube = shape::cube(2.0);
        // Eight ways to turn diagonals (of faces 0, 2 and 5) against those that the shape has.
        for turned in 0..8 {
            let mut corners = cube.corners.clone();
            for (bit, face) in [0, 2, 5].into_iter().enumerate() {
                if turned >> bit & 1 == 1 {
                    let f = &mut corners[6 * face..][..6];
                    let [a, b, c, d] = [f[0], f[1], f[2], f[5]];
                    f.copy_from_slice(&[b, c, d, b, d, a]);
                }
            }
            let mesh = Mesh { corners, ..shape::cube(2.0) };
            let normals = vertex_normals(&mesh, Weight::Angle);
            for (p, n) in mesh.positions.iter().zip(&normals.values) {
                for a in 0..3 {
                    // One rounding to f32 of a number in 0.5 .. 1, and angles of 15 digits.
                    assert!((n[a] - p[a] * (1.0f32 / 3.0).sqrt()).abs() < 1e-7, "{p:?} {n:?}");
                }
            }
        }
        // Other weights do depend on them: two triangles of a face meet at one end of its diagonal.
        cube.corners[..6].copy_from_slice(&[1, 3, 7, 1, 7, 5]);
        let other = vertex_normals(&cube, Weight::Area).values;
        assert!(other.iter().any(|n| (n[0].abs() - n[1].abs()).abs() > 0.1));
    }

    #[test]
    fn row_18_weights() {
        // Two triangles at the origin: one of area 2 and a right angle facing +Z, one of area 0.5, 45 degrees,
        // facing +Y.
        let mesh = Mesh {
            positions: vec![[0.0; 3], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [1.0, 0.0, 1.0], [1.0, 0.0, 0.0]],
            corners: vec![0, 1, 2, 0, 3, 4],
            ..Default::default()
        };
        for (weight, z_to_y) in [(Weight::Area, 4.0), (Weight::Angle, 2.0), (Weight::Uniform, 1.0)] {
            let n = vertex_normals(&mesh, weight).values[0];
            // A division of two numbers rounded to f32.
            assert!((n[2] / n[1] - z_to_y).abs() < 1e-6 && n[0] == 0.0, "{weight:?} {n:?}");
        }
    }

    #[test]
    fn seams_of_split_vertices_do_not_show_and_zero_has_no_sign() {
        let mesh = Mesh {
            positions: vec![
                [0.0; 3],
                [1.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [-0.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [0.0, 0.0, 1.0],
            ],
            corners: vec![0, 1, 2, 3, 4, 5],
            ..Default::default()
        };
        assert_eq!(weld(&mesh.positions), [0, 1, 2, 0, 2, 5]);
        let n = vertex_normals(&mesh, Weight::Angle).values;
        assert_eq!(n[0], n[3]);
        assert_eq!(n[2], n[4]);
        assert_ne!(n[1], n[0]);
    }

    #[test]
    fn degenerate_and_cancelling_triangles_leave_unit_normals() {
        let mesh = Mesh {
            positions: vec![[0.0; 3], [1e-20, 0.0, 0.0], [0.0, 1e-20, 0.0], [5.0, 5.0, 5.0], [3e38, 0.0, 0.0]],
            // A tiny triangle and its back, one without area, one whose edges are close to overflow.
            corners: vec![0, 1, 2, 2, 1, 0, 0, 0, 3, 0, 4, 2],
            ..Default::default()
        };
        for weight in [Weight::Area, Weight::Angle, Weight::Uniform] {
            for n in vertex_normals(&mesh, weight).values {
                let l2 = n.iter().map(|x| x * x).sum::<f32>();
                assert!((l2 - 1.0).abs() < 1e-6, "{n:?}");
            }
        }
        assert_eq!(vertex_normals(&mesh, Weight::Uniform).values[3], [0.0, 1.0, 0.0]);
        assert_eq!(geometric_normals(&mesh)[2], [0.0; 3]);
    }

    #[test]
    fn sphere_normals_are_radial_and_threads_do_not_matter() {
        let mesh = shape::sphere(2.0, 48);
        let run = |n| crate::job::Job::builder().threads(n).build().run(|| vertex_normals(&mesh, Weight::Angle));
        let one = run(1);
        assert_eq!(one, run(3));
        for (p, n) in mesh.positions.iter().zip(&one.values) {
            // The angle-weighted normal of a mesh of 7.5 degree cells is within a fraction of a degree.
            assert!((0..3).map(|a| p[a] * n[a]).sum::<f32>() > 0.9999, "{p:?} {n:?}");
        }
    }

    #[test]
    fn twins_pair_every_edge_of_a_closed_mesh() {
        for (mesh, open) in [(shape::cube(1.0), 0), (shape::torus(1.0, 12), 0), (shape::plane(1.0, 4), 16)] {
            let weld = weld(&mesh.positions);
            let twin = twins(&mesh, &weld);
            assert_eq!(twin.iter().filter(|&&t| t == NONE).count(), open, "{}", mesh.name);
            assert!((0..twin.len()).all(|e| twin[e] == NONE || twin[twin[e] as usize] == e as u32));
        }
    }

    #[test]
    fn a_box_without_normals_has_edges_and_a_sphere_has_none() {
        let cube = Mesh { normals: None, ..shape::cube(2.0) };
        let made = creased_normals(&cube);
        let flat = geometric_normals(&cube);
        for t in 0..cube.triangle_count() {
            for c in cube.triangle(t) {
                // Sums of one direction, rounded once.
                assert!(
                    (0..3).all(|a| (made.at(&cube, c)[a] - flat[t][a]).abs() < 1e-7),
                    "{t}: {:?}",
                    made.at(&cube, c)
                );
            }
        }
        assert_eq!(made.values.len(), 24);
        let sphere = Mesh { normals: None, ..shape::sphere(1.0, 24) };
        let made = creased_normals(&sphere);
        assert_eq!((made.index.is_none(), &made.values), (true, &vertex_normals(&sphere, Weight::Angle).values));
        // A prism of five sides turns by 72 degrees at each, one of seven by 51.
        for (sides, sharp) in [(5, true), (7, false)] {
            let at = |k: usize, z: f32| {
                let turn = (k % sides) as f32 * core::f32::consts::TAU / sides as f32;
                [exact::cos(turn), exact::sin(turn), z]
            };
            let positions: Vec<_> = (0..2 * sides).map(|k| at(k, if k < sides { 0.0 } else { 3.0 })).collect();
            let s = sides as u32;
            let corners = (0..s).flat_map(|k| [k, (k + 1) % s, s + (k + 1) % s, k, s + (k + 1) % s, s + k]).collect();
            let made = creased_normals(&Mesh { positions, corners, ..Mesh::default() });
            assert_eq!(made.index.is_some(), sharp, "{sides}");
        }
    }
}
