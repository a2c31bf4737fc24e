//! MikkTSpace against the algorithm of Morten Mikkelsen's `mikktspace.c`, written down again here from its description
//! ("Simulation of Wrinkled Surfaces Revisited", 2008) and its order of operations, in the plainest way: no hashing, no
//! sorting of edges, no quads. Both must give the same bits.

use frieze::math::exact;
use frieze::math::vec::{Mat4, Vec2, Vec3};
use frieze::mesh::{Attribute, Mesh, shape, tangent};

/// `NotZero` of the original.
fn some(x: f32) -> bool {
    x.abs() > f32::MIN_POSITIVE
}

fn unit(v: Vec3) -> Vec3 {
    if v.array().into_iter().any(some) { v * (1.0 / v.length2().sqrt()) } else { v }
}

/// `v` without its part along `n`, of unit length.
fn flat(v: Vec3, n: Vec3) -> Vec3 {
    unit(v - n * n.dot(v))
}

struct Triangle {
    vertices: [usize; 3],
    os: Vec3,
    ot: Vec3,
    keeps: bool,
    neighbors: [Option<usize>; 3],
}

/// Tangents and signs of triangle corners.
fn reference(mesh: &Mesh) -> Vec<[f32; 4]> {
    let (normals, uv) = (mesh.normals.as_ref().unwrap(), mesh.uv[0].as_ref().unwrap());
    // Corners with equal position, normal and coordinates are one vertex; v runs up.
    let mut vertices: Vec<(Vec3, Vec3, Vec2)> = Vec::new();
    let mut weld = |c: usize| {
        let [u, v] = uv.at(mesh, c);
        let key = (Vec3::from(mesh.position(c)), Vec3::from(normals.at(mesh, c)).normalize(), Vec2::new(u, -v));
        vertices.iter().position(|k| *k == key).unwrap_or_else(|| {
            vertices.push(key);
            vertices.len() - 1
        })
    };
    let corners: Vec<[usize; 3]> = (0..mesh.triangle_count()).map(|t| mesh.triangle(t).map(&mut weld)).collect();
    let mut triangles: Vec<Triangle> = corners
        .iter()
        .map(|&v| {
            let [(p1, _, t1), (p2, _, t2), (p3, _, t3)] = v.map(|k| vertices[k]);
            let (t21, t31) = (t2 - t1, t3 - t1);
            let (d1, d2) = (p2 - p1, p3 - p1);
            let area = t21.x * t31.y - t21.y * t31.x;
            let os = d1 * t31.y - d2 * t21.y;
            let ot = d1 * -t31.x + d2 * t21.x;
            let sign = if area > 0.0 { 1.0 } else { -1.0 };
            let scaled = |v: Vec3| if some(v.length()) { v * (sign / v.length()) } else { v };
            assert!(some(area), "the reference is for triangles with an area");
            Triangle { vertices: v, os: scaled(os), ot: scaled(ot), keeps: area > 0.0, neighbors: [None; 3] }
        })
        .collect();
    // Two triangles that run along an edge in opposite directions are neighbours; each edge has one.
    for a in 0..triangles.len() {
        for e in 0..3 {
            let edge = |t: &Triangle, e: usize| [t.vertices[e], t.vertices[(e + 1) % 3]];
            let [from, to] = edge(&triangles[a], e);
            if triangles[a].neighbors[e].is_some() {
                continue;
            }
            let found = (a + 1..triangles.len())
                .flat_map(|b| (0..3).map(move |f| (b, f)))
                .find(|&(b, f)| triangles[b].neighbors[f].is_none() && edge(&triangles[b], f) == [to, from]);
            if let Some((b, f)) = found {
                triangles[a].neighbors[e] = Some(b);
                triangles[b].neighbors[f] = Some(a);
            }
        }
    }
    // Around a vertex, triangles of one handedness that share edges are a group.
    let mut group_of = vec![[usize::MAX; 3]; triangles.len()];
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for t in 0..triangles.len() {
        for corner in 0..3 {
            if group_of[t][corner] != usize::MAX {
                continue;
            }
            let (vertex, keeps) = (triangles[t].vertices[corner], triangles[t].keeps);
            let mut members = Vec::new();
            let mut waiting = vec![t];
            while let Some(f) = waiting.pop() {
                let k = triangles[f].vertices.iter().position(|v| *v == vertex).unwrap();
                if triangles[f].keeps != keeps || group_of[f][k] != usize::MAX {
                    continue;
                }
                group_of[f][k] = groups.len();
                members.push(f);
                waiting.extend([triangles[f].neighbors[k], triangles[f].neighbors[(k + 2) % 3]].into_iter().flatten());
            }
            members.sort_unstable();
            groups.push(members);
        }
    }
    // Tangents, weighted by the angle at the vertex, in the order of triangles.
    let mut out = Vec::new();
    for (t, triangle) in triangles.iter().enumerate() {
        for corner in 0..3 {
            let vertex = triangle.vertices[corner];
            let n = vertices[vertex].1;
            let (own_s, own_t) = (flat(triangle.os, n), flat(triangle.ot, n));
            let mut sum = Vec3::splat(0.0);
            for &f in &groups[group_of[t][corner]] {
                let face = &triangles[f];
                let (os, ot) = (flat(face.os, n), flat(face.ot, n));
                // The default angular threshold of 180 degrees leaves out what is exactly opposed.
                if f != t && !(own_s.dot(os) > -1.0 && own_t.dot(ot) > -1.0) {
                    continue;
                }
                let k = face.vertices.iter().position(|v| *v == vertex).unwrap();
                let p = |k: usize| vertices[face.vertices[k % 3]].0;
                let (v1, v2) = (flat(p(k + 2) - p(k), n), flat(p(k + 1) - p(k), n));
                let cos = v1.dot(v2).clamp(-1.0, 1.0);
                sum = sum + os * exact::acos_f64(f64::from(cos)) as f32;
            }
            out.push(unit(sum).extend(if triangle.keeps { 1.0 } else { -1.0 }).array());
        }
    }
    out
}

/// Small numbers without pattern.
fn random(seed: &mut u32) -> f32 {
    *seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    (*seed >> 8) as f32 / (1 << 24) as f32
}

#[test]
fn row_60_mikktspace_has_the_bits_of_the_original_algorithm() {
    let mut seed = 3;
    // A hilly sheet with jittered places and coordinates, part of it mirrored, normals of their own.
    let mut sheet = shape::plane(2.0, 9);
    for p in &mut sheet.positions {
        *p = [p[0] + 0.05 * random(&mut seed), 0.3 * random(&mut seed), p[2] + 0.05 * random(&mut seed)];
    }
    for n in &mut sheet.normals.as_mut().unwrap().values {
        *n = [random(&mut seed) - 0.5, 1.0, random(&mut seed) - 0.5];
    }
    for uv in &mut sheet.uv[0].as_mut().unwrap().values {
        *uv = [(uv[0] - 0.45).abs() + 0.02 * random(&mut seed), uv[1] + 0.02 * random(&mut seed)];
    }
    let mut soup = shape::cube(1.0);
    let loose: Vec<[f32; 2]> = (0..soup.corners.len()).map(|_| [random(&mut seed), random(&mut seed)]).collect();
    soup.uv[0] = Some(Attribute { index: Some((0..loose.len() as u32).collect()), values: loose });
    let turned = Mat4::rotation([0.3, -0.2, 0.5, 0.8]);
    let mut torus = shape::torus(2.0, 16);
    torus.positions.iter_mut().for_each(|p| *p = turned.point(Vec3::from(*p)).array());
    let shapes = [
        ("cube", shape::cube(1.0)),
        ("sphere", shape::sphere(2.0, 14)),
        ("torus", torus),
        ("teapot", shape::teapot(1.5, 24)),
        ("sheet", sheet),
        ("soup", soup),
    ];
    for (name, mesh) in shapes {
        let (n, uv) = (mesh.normals.as_ref().unwrap(), mesh.uv[0].as_ref().unwrap());
        if (0..mesh.triangle_count()).any(|t| tangent::is_without_area(&mesh, uv, t)) {
            panic!("{name} has triangles without area");
        }
        let got = tangent::mikktspace(&mesh, n, uv);
        let (mut differ, mut mirrored) = (0, 0);
        for (c, want) in reference(&mesh).into_iter().enumerate() {
            let got = got.at(&mesh, mesh.triangle(c / 3)[c % 3]);
            differ += usize::from(got.map(f32::to_bits) != want.map(f32::to_bits));
            mirrored += usize::from(want[3] < 0.0);
        }
        assert_eq!(differ, 0, "{name}: corners of {}", 3 * mesh.triangle_count());
        assert_eq!(mirrored > 0, name == "sheet" || name == "soup", "{name}");
    }
}
