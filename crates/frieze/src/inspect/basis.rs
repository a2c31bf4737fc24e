//! Which tangent basis a normal map was made for (row 67: any basis will do, if baking and shading agree).
//!
//! A surface has one normal at an edge, whichever triangle it is seen from. So the map is read on both sides of each
//! edge with each candidate basis; under the right one the two world normals agree best. Texture seams and mirrored
//! charts tell most, as there the frames differ most.

use crate::error::{Error, Finding, Result};
use crate::image::Image;
use crate::job::Job;
use crate::map::evidence::{self, Evidence};
use crate::map::normal::to_world;
use crate::math::exact::acos_f64;
use crate::math::vec::Vec3;
use crate::mesh::topology::{self, Weight};
use crate::mesh::{Attribute, Mesh, tangent};
use serde::Serialize;

/// How a map and a mesh fit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BasisReport {
    /// `mikktspace`, `average`, `per-triangle`, `from-normal` or `unknown`. Of several that the map cannot tell apart,
    /// the first of these.
    pub basis: &'static str,
    /// `up` or `down`, or `unknown`.
    pub green: &'static str,
    /// That both are right, 0 to 1.
    pub confidence: f32,
    /// Every hypothesis, the best first.
    pub fits: Vec<Fit>,
    /// Mean angle in degrees between the map read as object-space normals and the mesh's own.
    pub object_angle: f32,
    /// Edges that were looked at, and how many of them are texture seams or mirror lines.
    pub edges: [usize; 2],
    /// The texture coordinates.
    pub uv: UvFacts,
}

/// How well a hypothesis fits.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Fit {
    /// `mikktspace`, `average`, `per-triangle` or `from-normal`.
    pub basis: &'static str,
    /// `up` or `down`.
    pub green: &'static str,
    /// Mean angle between the world normals of both sides of an edge, degrees.
    pub angle: f32,
    /// The same at seams and mirror lines only; 0 when there are none.
    pub seam_angle: f32,
}

/// What texture coordinates do.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct UvFacts {
    /// Triangles.
    pub triangles: usize,
    /// Triangles that show the texture mirrored.
    pub mirrored: usize,
    /// Triangles without area in the texture.
    pub degenerate: usize,
    /// Share of the covered texture that two triangles or more show.
    pub overlap: f32,
}

const BASES: [&str; 4] = ["mikktspace", "average", "per-triangle", "from-normal"];
const GREENS: [&str; 2] = ["up", "down"];

/// Ranks the bases a tangent-space map may have been made for.
///
/// # Errors
/// `inspect.no-uv` for a mesh without texture coordinates, `job.memory`, `job.interrupted`.
pub fn fit(mesh: &Mesh, image: &Image, e: &Evidence, job: &Job) -> Result<BasisReport> {
    let Some(uv) = &mesh.uv[0] else {
        return Err(Error::input("inspect.no-uv", "the mesh has no texture coordinates, so no map fits it")
            .remedy("unwrap it first"));
    };
    job.check()?;
    let (w, h) = (image.width() as usize, image.height() as usize);
    let _room = job.reserve(w as u64 * h as u64 * 12 + mesh.corners.len() as u64 * 100, "the map and its frames")?;
    let vectors = evidence::vectors(image, e);
    let texel = |uv: [f32; 2]| -> Vec3 {
        let at = |t: f32, n: usize| {
            let t = if t.is_finite() { t - t.floor() } else { 0.0 };
            ((t * n as f32) as usize).min(n - 1)
        };
        Vec3::from(vectors[at(uv[1], h) * w + at(uv[0], w)])
    };
    let made;
    let normals = match &mesh.normals {
        Some(n) => n,
        None => {
            made = topology::vertex_normals(mesh, Weight::Angle);
            &made
        }
    };
    let frames: Vec<Attribute<[f32; 4]>> = vec![
        tangent::mikktspace(mesh, normals, uv),
        tangent::average(mesh, normals, uv),
        tangent::per_triangle(mesh, normals, uv),
        tangent::from_normal(mesh, normals),
    ];
    job.check()?;
    let samples = edges(mesh, uv, [w, h]);
    // Per hypothesis and edge, the mean angle.
    let mut angles: [Vec<_>; 8] = core::array::from_fn(|_| Vec::with_capacity(samples.len()));
    for s in &samples {
        for (b, frame) in frames.iter().enumerate() {
            for g in 0..2 {
                let mut sum = 0.0;
                for k in 0..PLACES {
                    let [n, m] = [0, 1].map(|side| {
                        let (corners, weights) = &s.sides[side];
                        let mix = |f: &dyn Fn(usize) -> Vec3| {
                            (0..3).fold(Vec3::splat(0.0), |v, c| v + f(corners[c]) * weights[k][c])
                        };
                        let normal = mix(&|c| Vec3::from(normals.at(mesh, c)).normalize());
                        let t = mix(&|c| {
                            let [x, y, z, _] = frame.at(mesh, c);
                            Vec3::new(x, y, z)
                        });
                        let place = [0, 1].map(|j| (0..3).map(|c| uv.at(mesh, corners[c])[j] * weights[k][c]).sum());
                        let v = texel(place);
                        let v = if g == 1 { Vec3::new(v.x, -v.y, v.z) } else { v };
                        to_world(v, t, frame.at(mesh, corners[0])[3], normal)
                    });
                    let dot = f64::from(n.dot(m));
                    sum += if dot.is_finite() { acos_f64(dot.clamp(-1.0, 1.0)).to_degrees() } else { 90.0 };
                }
                angles[2 * b + g].push(sum / PLACES as f64);
            }
        }
    }
    let mean = |of: &[f64], seams: bool| {
        let list: Vec<f64> = of.iter().zip(&samples).filter(|(_, s)| !seams || s.seam).map(|(a, _)| *a).collect();
        if list.is_empty() { 0.0 } else { list.iter().sum::<f64>() / list.len() as f64 }
    };
    let mut order: Vec<(usize, f64)> = (0..8).map(|k| (k, mean(&angles[k], false))).collect();
    order.sort_by(|a, b| a.1.total_cmp(&b.1));
    let fits: Vec<Fit> = order
        .iter()
        .map(|&(k, angle)| Fit {
            basis: BASES[k / 2],
            green: GREENS[k % 2],
            angle: angle as f32,
            seam_angle: mean(&angles[k], true) as f32,
        })
        .collect();
    // How steadily `a` is better than `b`, edge by edge, in standard deviations; and by which share of `b`'s angle.
    let better = |a: usize, b: usize, seams: bool| {
        let of = |k: usize| angles[k].iter().zip(&samples).filter(move |(_, s)| !seams || s.seam).map(|(a, _)| *a);
        let gains: Vec<f64> = of(a).zip(of(b)).map(|(a, b)| b - a).collect();
        let n = gains.len().max(1) as f64;
        let gain = gains.iter().sum::<f64>() / n;
        let spread = (gains.iter().map(|g| (g - gain) * (g - gain)).sum::<f64>() / n).sqrt();
        (if spread > 0.0 { gain / spread * n.sqrt() } else { 0.0 }, gain / mean(&angles[b], seams).max(1e-6))
    };
    let best = order[0].0;
    // Bases that this map cannot tell from the best, with the same green: MikkTSpace and averaging often agree.
    let tied: Vec<usize> = order
        .iter()
        .map(|o| o.0)
        .filter(|&k| {
            let (steady, share) = better(best, k, false);
            k % 2 == best % 2 && (k == best || steady < 2.0 || share < 0.02)
        })
        .collect();
    // The one that most programs use comes first in the list.
    let chosen = tied.iter().copied().min().unwrap_or(best);
    let confidence = order.iter().find(|o| !tied.contains(&o.0)).map_or(0.0, |other| {
        // All edges together, or the seams alone, where frames differ most.
        [false, true]
            .map(|seams| {
                let (steady, share) = better(best, other.0, seams);
                evidence::ramp(steady, 1.0, 5.0) * evidence::ramp(share, 0.01, 0.1)
            })
            .into_iter()
            .fold(0.0, f64::max)
    });
    let named = confidence >= 0.5 && e.space.value != "object";
    Ok(BasisReport {
        basis: if named { BASES[chosen / 2] } else { "unknown" },
        green: if named { fits[0].green } else { "unknown" },
        confidence: confidence as f32,
        fits,
        object_angle: object_angle(mesh, uv, normals, texel),
        edges: [samples.len(), samples.iter().filter(|s| s.seam).count()],
        uv: facts(mesh, uv, job)?,
    })
}

/// What is odd about the pair.
pub fn findings(r: &BasisReport) -> Vec<Finding> {
    let mut out = Vec::new();
    if r.uv.overlap > 0.01 {
        out.push(Finding::note(
            "uv.overlap",
            format!("{:.0} % of the used texture is shown by several triangles", r.uv.overlap * 100.0),
            "a baked map can serve one of them; fine for mirrored or repeated parts",
        ));
    }
    if r.uv.degenerate > 0 {
        out.push(Finding::note(
            "uv.degenerate",
            format!("{} of {} triangles have no area in the texture", r.uv.degenerate, r.uv.triangles),
            "they have no tangent of their own",
        ));
    }
    if !matches!(r.basis, "mikktspace" | "unknown") {
        out.push(Finding::warning(
            "normal.basis",
            format!(
                "the map fits a `{}` basis better than MikkTSpace, confidence {:.0} %",
                r.basis,
                r.confidence * 100.0
            ),
            format!("seams show in programs that use MikkTSpace; set tangent_frame = \"{}\" in a scene file", r.basis),
        ));
    }
    out
}

/// Places along an edge.
const PLACES: usize = 4;
/// Most edges that are looked at.
const MOST: usize = 20_000;

/// The two sides of an edge: corners of a triangle and, for each place, their weights, half a texel inside.
struct Sample {
    sides: [([usize; 3], [[f32; 3]; PLACES]); 2],
    seam: bool,
}

fn edges(mesh: &Mesh, uv: &Attribute<[f32; 2]>, size: [usize; 2]) -> Vec<Sample> {
    let weld = topology::weld(&mesh.positions);
    let twins = topology::twins(mesh, &weld);
    let pairs: Vec<(usize, usize)> = twins
        .iter()
        .enumerate()
        .filter(|(a, b)| **b != topology::NONE && (*a as u32) < **b)
        .map(|(a, b)| (a, *b as usize))
        .collect();
    let step = pairs.len().div_ceil(MOST).max(1);
    let mut out = Vec::new();
    for &(a, b) in pairs.iter().step_by(step) {
        let half = |e: usize, turned: bool| {
            let t = mesh.triangle(e / 3);
            let corners = [t[e % 3], t[(e + 1) % 3], t[(e + 2) % 3]];
            let q = corners.map(|c| uv.at(mesh, c));
            let area = (q[1][0] - q[0][0]) * (q[2][1] - q[0][1]) - (q[2][0] - q[0][0]) * (q[1][1] - q[0][1]);
            // From the edge to the third corner, in texels.
            let way = [0, 1].map(|k| (q[2][k] - (q[0][k] + q[1][k]) * 0.5) * size[k] as f32);
            let texels = (way[0] * way[0] + way[1] * way[1]).sqrt();
            let inside = (0.5 / texels.max(1e-6)).min(0.25);
            let weights = core::array::from_fn(|k| {
                let s = (k as f32 + 0.5) / PLACES as f32;
                let s = if turned { 1.0 - s } else { s };
                [(1.0 - s) * (1.0 - inside), s * (1.0 - inside), inside]
            });
            (corners, weights, q, area)
        };
        let (ca, wa, qa, area_a) = half(a, false);
        let (cb, wb, qb, area_b) = half(b, true);
        if !(area_a.abs() > 0.0 && area_b.abs() > 0.0) {
            continue;
        }
        let seam = qa[0] != qb[1] || qa[1] != qb[0] || (area_a > 0.0) != (area_b > 0.0);
        out.push(Sample { sides: [(ca, wa), (cb, wb)], seam });
    }
    out
}

fn object_angle(
    mesh: &Mesh,
    uv: &Attribute<[f32; 2]>,
    normals: &Attribute<[f32; 3]>,
    texel: impl Fn([f32; 2]) -> Vec3,
) -> f32 {
    let (mut sum, mut n) = (0.0f64, 0.0f64);
    for t in (0..mesh.triangle_count()).step_by(mesh.triangle_count().div_ceil(MOST).max(1)) {
        let c = mesh.triangle(t);
        let place = [0, 1].map(|k| c.iter().map(|c| uv.at(mesh, *c)[k]).sum::<f32>() / 3.0);
        let normal = c.iter().fold(Vec3::splat(0.0), |v, c| v + Vec3::from(normals.at(mesh, *c)).normalize());
        let dot = f64::from(normal.normalize().dot(texel(place)));
        if dot.is_finite() {
            sum += acos_f64(dot.clamp(-1.0, 1.0)).to_degrees();
            n += 1.0;
        }
    }
    (sum / n.max(1.0)) as f32
}

/// Side of the grid on which overlaps are counted.
const GRID: usize = 512;

fn facts(mesh: &Mesh, uv: &Attribute<[f32; 2]>, job: &Job) -> Result<UvFacts> {
    let mut f = UvFacts { triangles: mesh.triangle_count(), mirrored: 0, degenerate: 0, overlap: 0.0 };
    let mut counts = vec![0u8; GRID * GRID];
    // Enough for any sane mesh; triangles that all fill the whole texture end it early.
    let mut budget = 1i64 << 28;
    for t in 0..mesh.triangle_count() {
        if t % 4096 == 0 {
            job.check()?;
        }
        let q = mesh.triangle(t).map(|c| uv.at(mesh, c).map(f64::from));
        if q.iter().flatten().any(|v| !v.is_finite()) {
            continue;
        }
        let edge =
            |a: [f64; 2], b: [f64; 2], p: [f64; 2]| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
        let area = edge(q[0], q[1], q[2]);
        if area == 0.0 {
            f.degenerate += 1;
            continue;
        }
        // v runs down: a texture that is not mirrored turns the other way.
        f.mirrored += usize::from(area > 0.0);
        let range = |k: usize| {
            let lo = q.iter().map(|c| c[k]).fold(f64::INFINITY, f64::min) * GRID as f64;
            let hi = q.iter().map(|c| c[k]).fold(f64::NEG_INFINITY, f64::max) * GRID as f64;
            (lo.floor() as i64, hi.ceil() as i64)
        };
        let ((x0, x1), (y0, y1)) = (range(0), range(1));
        if x1 - x0 > GRID as i64 + 1 || y1 - y0 > GRID as i64 + 1 {
            // It repeats the texture: that is not what a baked map is for, and no overlap of charts.
            continue;
        }
        budget -= (x1 - x0) * (y1 - y0);
        if budget < 0 {
            break;
        }
        for y in y0..y1 {
            for x in x0..x1 {
                // Not at the middle of a cell, where the edges of regular charts run.
                let p = [(x as f64 + 0.513_7) / GRID as f64, (y as f64 + 0.507_1) / GRID as f64];
                let s = [edge(q[0], q[1], p), edge(q[1], q[2], p), edge(q[2], q[0], p)];
                if s.iter().all(|s| *s * area > 0.0) {
                    let at = y.rem_euclid(GRID as i64) as usize * GRID + x.rem_euclid(GRID as i64) as usize;
                    counts[at] = counts[at].saturating_add(1);
                }
            }
        }
    }
    let used = counts.iter().filter(|c| **c > 0).count();
    let twice = counts.iter().filter(|c| **c > 1).count();
    f.overlap = twice as f32 / used.max(1) as f32;
    Ok(f)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Encoding, Pixels};
    use crate::math::exact::sin;
    use crate::mesh::shape;

    /// A rough world normal for a smooth one.
    fn rough(p: Vec3, n: Vec3) -> Vec3 {
        let w = |a: f32, b: f32| 0.25 * sin(7.0 * a + 4.0 * b);
        (n + Vec3::new(w(p.x, p.y), w(p.y, p.z), w(p.z, p.x))).normalize()
    }

    /// Bakes that with a basis: the exact inverse of reading it, texel by texel.
    fn bake(mesh: &Mesh, frame: &Attribute<[f32; 4]>, down: bool, size: usize) -> Image {
        let (uv, normals) = (mesh.uv[0].as_ref().unwrap(), mesh.normals.as_ref().unwrap());
        let mut texels = [128u8, 128, 255].repeat(size * size);
        for t in 0..mesh.triangle_count() {
            let c = mesh.triangle(t);
            let q = c.map(|c| uv.at(mesh, c).map(|v| v * size as f32));
            let edge =
                |a: [f32; 2], b: [f32; 2], p: [f32; 2]| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
            let area = edge(q[0], q[1], q[2]);
            if area == 0.0 {
                continue;
            }
            let lo = |k: usize| (q.iter().map(|c| c[k]).fold(f32::MAX, f32::min).floor().max(0.0)) as usize;
            let hi = |k: usize| (q.iter().map(|c| c[k]).fold(0.0, f32::max).ceil() as usize).min(size);
            for y in lo(1)..hi(1) {
                for x in lo(0)..hi(0) {
                    let p = [x as f32 + 0.5, y as f32 + 0.5];
                    let b = [edge(q[1], q[2], p) / area, edge(q[2], q[0], p) / area, edge(q[0], q[1], p) / area];
                    if b.iter().any(|b| *b < -1e-4) {
                        continue;
                    }
                    let mix = |f: &dyn Fn(usize) -> Vec3| (0..3).fold(Vec3::splat(0.0), |v, k| v + f(c[k]) * b[k]);
                    let n = mix(&|c| Vec3::from(normals.at(mesh, c)));
                    let t = mix(&|c| Vec3::new(frame.at(mesh, c)[0], frame.at(mesh, c)[1], frame.at(mesh, c)[2]));
                    let bi = n.cross(t) * frame.at(mesh, c[0])[3];
                    let world = rough(mix(&|c| Vec3::from(mesh.position(c))), n.normalize());
                    // The inverse of the matrix (t, bi, n).
                    let det = t.dot(bi.cross(n));
                    let v = Vec3::new(
                        world.dot(bi.cross(n)) / det,
                        world.dot(n.cross(t)) / det,
                        world.dot(t.cross(bi)) / det,
                    );
                    let code = crate::map::normal::encode_u8(v.normalize(), down);
                    texels[(y * size + x) * 3..][..3].copy_from_slice(&code);
                }
            }
        }
        Image::new(size as u32, size as u32, 3, Pixels::U8(texels), Encoding::Linear).unwrap()
    }

    /// Row 67: baked with A and read with A, the sides agree; with B, they don't, and it is measured.
    #[test]
    fn row_67_the_basis_that_a_map_was_baked_with_fits_best() {
        let job = Job::default();
        // A torus whose texture is turned and stretched, so that frames differ from one another.
        let mut mesh = shape::torus(2.0, 14);
        for uv in &mut mesh.uv[0].as_mut().unwrap().values {
            *uv = [0.05 + 0.7 * uv[0] + 0.2 * uv[1] * uv[1], 0.05 + 0.7 * uv[1] + 0.2 * uv[0] * uv[0]];
        }
        let (uv, normals) = (mesh.uv[0].clone().unwrap(), mesh.normals.clone().unwrap());
        for (name, frame) in [
            ("mikktspace", tangent::mikktspace(&mesh, &normals, &uv)),
            ("per-triangle", tangent::per_triangle(&mesh, &normals, &uv)),
            ("from-normal", tangent::from_normal(&mesh, &normals)),
        ] {
            for (down, green) in [(false, "up"), (true, "down")] {
                let image = bake(&mesh, &frame, down, 512);
                let e = evidence::gather(&image, &job).unwrap();
                let r = fit(&mesh, &image, &e, &job).unwrap();
                let of = |basis, green| r.fits.iter().find(|f| f.basis == basis && f.green == green).unwrap().angle;
                let (right, other) = (of(name, green), if down { "up" } else { "down" });
                // MikkTSpace and averaging differ by less than 1 % on this torus.
                assert!(right <= 1.01 * r.fits[0].angle, "{name} {green}: {r:#?}");
                assert!(r.basis == name || r.basis == "unknown", "{name} {green}: {r:#?}");
                // Read with the other green or another basis, the sides disagree by more, and it is told by how much.
                let strange = if name == "per-triangle" { "mikktspace" } else { "per-triangle" };
                // A frame made from the normal alone has no seams, so either green is as smooth there.
                let green_matters = name == "from-normal" || of(name, other) > 1.02 * right;
                assert!(green_matters && of(strange, green) > 1.05 * right, "{name} {green}: {r:#?}");
            }
        }
    }

    #[test]
    fn overlaps_mirrors_and_points_are_counted() {
        let job = Job::default();
        // Each side of the cube shows the whole texture.
        let mesh = shape::cube(1.0);
        let f = facts(&mesh, mesh.uv[0].as_ref().unwrap(), &job).unwrap();
        assert!(f.overlap > 0.99 && f.mirrored == 0 && f.degenerate == 0, "{f:?}");
        let mut plane = shape::plane(1.0, 4);
        let f = facts(&plane, plane.uv[0].as_ref().unwrap(), &job).unwrap();
        assert_eq!((f.overlap, f.mirrored), (0.0, 0));
        plane.uv[0].as_mut().unwrap().values.iter_mut().for_each(|v| v[0] = 1.0 - v[0]);
        assert_eq!(facts(&plane, plane.uv[0].as_ref().unwrap(), &job).unwrap().mirrored, f.triangles);
        plane.uv[0].as_mut().unwrap().values.iter_mut().for_each(|v| *v = [0.5; 2]);
        assert_eq!(facts(&plane, plane.uv[0].as_ref().unwrap(), &job).unwrap().degenerate, f.triangles);
        plane.uv[0] = None;
        let flat = Image::new(4, 4, 3, Pixels::U8([128, 128, 255].repeat(16)), Encoding::Linear).unwrap();
        let e = evidence::gather(&flat, &job).unwrap();
        assert_eq!(fit(&plane, &flat, &e, &job).unwrap_err().code, "inspect.no-uv");
    }
}
