//! Triangles for polygons: a fan where the polygon is convex, ear clipping where it is not (Eberly,
//! "Triangulation by Ear Clipping").

use crate::error::Result;
use crate::load::Context;
use crate::mesh::Polygons;
use rayon::prelude::*;

/// Faces that one task triangulates.
const CHUNK: usize = 4096;

/// Most points that ear clipping looks at per corner; what is left of the polygon then becomes a fan. Keeps
/// polygons of a hundred thousand corners from taking hours.
const MOST_LOOKS: usize = 4096;

/// The triangulation of faces of `sizes` corners each (3 or more). `None` when all are triangles.
///
/// # Errors
/// [`crate::error::Fault::Memory`] over the budget.
pub(super) fn polygons(
    positions: &[[f32; 3]],
    corners: &[u32],
    sizes: &[u32],
    context: &Context<'_>,
) -> Result<Option<Polygons>> {
    if sizes.iter().all(|&s| s == 3) {
        return Ok(None);
    }
    let count = corners.len() - 2 * sizes.len();
    context.reserve(4 * sizes.len() as u64 + 16 * count as u64, "the triangulation")?;
    let mut starts = Vec::with_capacity(sizes.len() + 1);
    let mut at = 0u32;
    starts.push(at);
    for &size in sizes {
        at += size;
        starts.push(at);
    }
    let mut triangles = vec![[0u32; 3]; count];
    let mut face_of = vec![0u32; count];
    // A polygon of n corners has n - 2 triangles, so each task knows its place.
    let mut tasks = Vec::with_capacity(sizes.len() / CHUNK + 1);
    let (mut rest, mut rest_of) = (&mut triangles[..], &mut face_of[..]);
    for (k, chunk) in sizes.chunks(CHUNK).enumerate() {
        let n = chunk.iter().map(|&s| s as usize - 2).sum();
        let (mine, others) = rest.split_at_mut(n);
        let (mine_of, others_of) = rest_of.split_at_mut(n);
        (rest, rest_of) = (others, others_of);
        tasks.push((k * CHUNK, chunk, mine, mine_of));
    }
    tasks.into_par_iter().for_each(|(first, chunk, triangles, face_of)| {
        let mut at = 0;
        let mut clipper = Clipper::default();
        for (k, &size) in chunk.iter().enumerate() {
            let face = first + k;
            let start = starts[face];
            let n = size as usize - 2;
            let out = &mut triangles[at..at + n];
            clipper.face(out, start, |c| positions[corners[(start + c) as usize] as usize]);
            face_of[at..at + n].fill(face as u32);
            at += n;
        }
    });
    Ok(Some(Polygons { starts, triangles, face_of }))
}

#[derive(Default)]
struct Clipper {
    points: Vec<[f64; 2]>,
    left: Vec<u32>,
}

/// Twice the area of a triangle, positive when counter-clockwise.
fn area(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

impl Clipper {
    /// Fills `out` with the triangles of a face of `out.len() + 2` corners, whose first corner is `start`.
    fn face(&mut self, out: &mut [[u32; 3]], start: u32, position: impl Fn(u32) -> [f32; 3]) {
        let n = out.len() as u32 + 2;
        if n > 3 && !self.flatten(n, position) {
            self.clip(out, start);
            return;
        }
        for (k, triangle) in (1..).zip(out) {
            *triangle = [start, start + k, start + k + 1];
        }
    }

    /// Projects along the axis that the polygon faces most; whether it is convex (or has no area at all).
    fn flatten(&mut self, n: u32, position: impl Fn(u32) -> [f32; 3]) -> bool {
        let p = |k: u32| position(k % n).map(f64::from);
        let mut normal = [0.0f64; 3];
        for k in 0..n {
            // Newell's method.
            let (a, b) = (p(k), p(k + 1));
            normal[0] += (a[1] - b[1]) * (a[2] + b[2]);
            normal[1] += (a[2] - b[2]) * (a[0] + b[0]);
            normal[2] += (a[0] - b[0]) * (a[1] + b[1]);
        }
        let size = normal.map(f64::abs);
        let axis = if size[0] > size[1] && size[0] > size[2] {
            0
        } else if size[1] > size[2] {
            1
        } else {
            2
        };
        if size[axis] <= 0.0 {
            return true;
        }
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let (u, v) = if normal[axis] < 0.0 { (v, u) } else { (u, v) };
        self.points.clear();
        self.points.extend((0..n).map(|k| [p(k)[u], p(k)[v]]));
        let q = &self.points;
        let n = n as usize;
        (0..n).all(|k| area(q[k], q[(k + 1) % n], q[(k + 2) % n]) >= 0.0)
    }

    fn clip(&mut self, out: &mut [[u32; 3]], start: u32) {
        let q = &self.points;
        let left = &mut self.left;
        left.clear();
        left.extend(0..q.len() as u32);
        let mut looks = q.len().saturating_mul(MOST_LOOKS);
        let mut done = 0;
        let mut at = 0;
        while left.len() > 3 {
            let n = left.len();
            let mut ear = None;
            for step in 0..n {
                let b = (at + step) % n;
                let (ia, ib, ic) = (left[(b + n - 1) % n], left[b], left[(b + 1) % n]);
                let (pa, pb, pc) = (q[ia as usize], q[ib as usize], q[ic as usize]);
                if area(pa, pb, pc) <= 0.0 {
                    continue;
                }
                looks = looks.saturating_sub(n);
                let blocked = left.iter().any(|&k| {
                    let p = q[k as usize];
                    let corner = p == pa || p == pb || p == pc;
                    !corner && area(pa, pb, p) >= 0.0 && area(pb, pc, p) >= 0.0 && area(pc, pa, p) >= 0.0
                });
                if !blocked {
                    ear = Some(b);
                    break;
                }
                if looks == 0 {
                    break;
                }
            }
            // A polygon that crosses itself may have no ear: any corner goes.
            let b = if looks == 0 { 1 } else { ear.unwrap_or(at % n) };
            let (ia, ib, ic) = (left[(b + n - 1) % n], left[b], left[(b + 1) % n]);
            out[done] = [ia, ib, ic].map(|k| start + k);
            done += 1;
            if looks == 0 {
                // The rest as a fan from the first corner that is left.
                left.remove(1);
                for k in 1..left.len() - 1 {
                    out[done] = [left[0], left[k], left[k + 1]].map(|k| start + k);
                    done += 1;
                }
                return;
            }
            left.remove(b);
            // Beginning behind the ear keeps the triangles from forming one long fan.
            at = b % left.len();
        }
        out[done] = [left[0], left[1], left[2]].map(|k| start + k);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangles(points: &[[f32; 2]]) -> Vec<[u32; 3]> {
        let mut out = vec![[0; 3]; points.len() - 2];
        // In the plane x = 3, seen from +x: u is y, v is z.
        Clipper::default().face(&mut out, 0, |k| [3.0, points[k as usize][0], points[k as usize][1]]);
        out
    }
    fn total(points: &[[f32; 2]], triangles: &[[u32; 3]]) -> (f64, bool) {
        let p = |k: u32| points[k as usize].map(f64::from);
        let areas: Vec<f64> = triangles.iter().map(|t| area(p(t[0]), p(t[1]), p(t[2]))).collect();
        (areas.iter().sum::<f64>() / 2.0, areas.iter().all(|&a| a >= 0.0))
    }

    #[test]
    fn convex_polygons_become_fans() {
        let square = [[0., 0.], [1., 0.], [1., 1.], [0., 1.]];
        assert_eq!(triangles(&square), [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn concave_polygons_are_covered_once() {
        let arrow = [[0., 0.], [2., 1.], [0., 2.], [1., 1.]];
        assert_eq!(total(&arrow, &triangles(&arrow)), (1.0, true));
        // A comb of 20 teeth, given clockwise and counter-clockwise: the winding is kept.
        let mut comb = vec![[0.0, -1.0], [40.0, -1.0]];
        for k in (0..20).rev() {
            comb.push([2.0 * k as f32 + 1.5, 10.0]);
            comb.push([2.0 * k as f32, 0.0]);
        }
        let whole: f64 = (0..comb.len())
            .map(|k| {
                let (a, b) = (comb[k].map(f64::from), comb[(k + 1) % comb.len()].map(f64::from));
                (a[0] * b[1] - a[1] * b[0]) / 2.0
            })
            .sum();
        assert_eq!(total(&comb, &triangles(&comb)), (whole, true));
    }

    #[test]
    fn broken_polygons_still_give_all_their_triangles() {
        for points in [
            &[[0., 0.]; 7][..],
            &[[0., 0.], [1., 0.], [2., 0.], [3., 0.]],
            &[[0., 0.], [1., 1.], [1., 0.], [0., 1.]],
            &[[0., 0.], [4., 0.], [4., 4.], [0., 4.], [0., 0.], [1., 1.], [1., 3.], [3., 3.], [3., 1.], [1., 1.]],
        ] {
            let list = triangles(points);
            assert!(list.iter().flatten().all(|&k| (k as usize) < points.len()));
        }
        // A huge zigzag ends in bounded time.
        let zigzag: Vec<[f32; 2]> =
            (0..20_000).map(|k| [(k * 7919 % 10_007) as f32, (k * 104_729 % 9973) as f32]).collect();
        assert_eq!(triangles(&zigzag).len(), zigzag.len() - 2);
    }
}
