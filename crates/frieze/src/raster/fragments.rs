//! A closure per fragment: the scalar rasteriser behind custom shaders, baking in UV space and lessons.
//!
//! It has the coverage rule and the depth rule of the tile rasteriser:
//! - pixel (x, y) has its centre at (x + 0.5, y + 0.5), y runs down the picture;
//! - positions are snapped to 1/256 of a pixel, `floor(256 v + 0.5)`; edge functions are integers; a sample on an
//!   edge belongs to the triangle whose top or left edge it is. So triangles that share an edge cover each
//!   sample exactly once (row 23);
//! - depth is reversed, 1 near, 0 far: `z / w`, affine on the screen; the larger wins, and of equals the
//!   lower source id (row 27).
//!
//! Attributes come from the triangle as it was before snapping and clipping, by planes in homogeneous
//! coordinates (Olano and Greer 1997, "Triangle Scan Conversion using 2D Homogeneous Coordinates"), so they
//! are perspective-correct (row 26). An orthographic identity (w = 1) makes it a rasteriser of UV space.

use crate::math::vec::Vec4;

/// Sub-pixel units per pixel.
const UNITS: f64 = 256.0;

/// One sample in the middle of the pixel.
pub const CENTER: [[u8; 2]; 1] = [[128, 128]];

/// Four samples on the grid of row 24.
pub const GRID4: [[u8; 2]; 4] = [[64, 64], [192, 64], [64, 192], [192, 192]];

/// Where a triangle covers a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fragment {
    /// Column.
    pub x: u32,
    /// Row from the top.
    pub y: u32,
    /// Bit k: sample k is covered. Never 0.
    pub mask: u32,
    /// Whether the corners run counter-clockwise on the screen.
    pub front: bool,
    /// Perspective-correct weights of the three corners, at the pixel's centre or, if that is not covered (it
    /// is looked for among the samples), at the first sample that is (centroid sampling).
    pub weights: [f32; 3],
    /// Change of the weights from one pixel to the next along x.
    pub weights_dx: [f32; 3],
    /// The same along y.
    pub weights_dy: [f32; 3],
    depth: [f64; 3],
}

impl Fragment {
    /// Reversed depth at a sample given in 1/256 of a pixel: 1 at the near plane, 0 at the far plane.
    pub fn depth_at(&self, sample: [u8; 2]) -> f32 {
        let (x, y) = at_sample(self.x, self.y, sample);
        (self.depth[0] * x + self.depth[1] * y + self.depth[2]) as f32
    }
}

/// Pixel coordinates of a sample.
fn at_sample(x: u32, y: u32, [dx, dy]: [u8; 2]) -> (f64, f64) {
    (f64::from(x) + f64::from(dx) / UNITS, f64::from(y) + f64::from(dy) / UNITS)
}

/// Calls `f` for every pixel of a `width` x `height` picture in which the triangle covers one of the `samples`
/// (1 to 32, in 1/256 of a pixel from its upper left corner), row after row. Sides of up to 2^20 pixels. `corners` are clip coordinates:
/// x right and y up in -w ..= w, z in 0 (far) ..= w (near).
///
/// A triangle without area on the screen, or with a coordinate that is not finite, covers nothing.
pub fn triangle(corners: [Vec4; 3], width: u32, height: u32, samples: &[[u8; 2]], mut f: impl FnMut(&Fragment)) {
    let Some(planes) = Planes::new(corners, width, height) else { return };
    let polygon = clip(corners, width, height);
    if polygon.len() < 3 {
        return;
    }
    let snapped: Vec<[i64; 2]> = polygon
        .iter()
        .map(|p| {
            let [x, y] = to_pixels(*p, width, height);
            [x / p[3], y / p[3]].map(|v| (v * UNITS + 0.5).floor() as i64)
        })
        .collect();
    for k in 2..snapped.len() {
        cover([snapped[0], snapped[k - 1], snapped[k]], width, height, samples, |x, y, mask| {
            f(&planes.fragment(x, y, mask, samples));
        });
    }
}

/// Homogeneous pixel coordinates.
fn to_pixels(p: [f64; 4], width: u32, height: u32) -> [f64; 2] {
    [(p[0] + p[3]) * 0.5 * f64::from(width), (p[3] - p[1]) * 0.5 * f64::from(height)]
}

/// The part of a triangle between near and far, and within a guard band that keeps edge functions in 64 bits.
/// A cut goes from the inner to the outer end of an edge, whichever triangle asks, so neighbours agree on it.
fn clip(corners: [Vec4; 3], width: u32, height: u32) -> Vec<[f64; 4]> {
    let mut polygon: Vec<[f64; 4]> = corners.iter().map(|c| c.array().map(f64::from)).collect();
    // 2^20 pixels: 2^28 units, products below 2^59.
    let (gx, gy) = (f64::from(1 << 20) / f64::from(width), f64::from(1 << 20) / f64::from(height));
    let inside: [&dyn Fn(&[f64; 4]) -> f64; 7] = [
        &|p| p[3] - p[2],
        &|p| p[2],
        &|p| p[3] - 1e-30,
        &|p| p[3] * gx - p[0],
        &|p| p[3] * gx + p[0],
        &|p| p[3] * gy - p[1],
        &|p| p[3] * gy + p[1],
    ];
    for distance in inside {
        if polygon.iter().all(|p| distance(p) >= 0.0) {
            continue;
        }
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for (k, b) in polygon.iter().enumerate() {
            let a = &polygon[(k + polygon.len() - 1) % polygon.len()];
            let (da, db) = (distance(a), distance(b));
            let cut = |i: &[f64; 4], o: &[f64; 4], di: f64, d_o: f64| {
                let t = di / (di - d_o);
                core::array::from_fn(|c| i[c] + (o[c] - i[c]) * t)
            };
            if da >= 0.0 && db < 0.0 {
                kept.push(cut(a, b, da, db));
            } else if da < 0.0 && db >= 0.0 {
                kept.push(cut(b, a, db, da));
            }
            if db >= 0.0 {
                kept.push(*b);
            }
        }
        polygon = kept;
    }
    polygon
}

/// Calls `f` with the mask of samples for every pixel that a triangle of snapped positions covers.
fn cover(mut p: [[i64; 2]; 3], width: u32, height: u32, samples: &[[u8; 2]], mut f: impl FnMut(u32, u32, u32)) {
    let side = |a: [i64; 2], b: [i64; 2], q: [i64; 2]| (b[0] - a[0]) * (q[1] - a[1]) - (b[1] - a[1]) * (q[0] - a[0]);
    match side(p[0], p[1], p[2]) {
        0 => return,
        area if area < 0 => p.swap(1, 2),
        _ => {}
    }
    // Clockwise on the screen now: top edges run right, left edges run up.
    let edges = [(p[0], p[1]), (p[1], p[2]), (p[2], p[0])].map(|(a, b)| {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let top_left = dy < 0 || dy == 0 && dx > 0;
        (a, b, if top_left { 0 } else { 1 })
    });
    let range = |k: usize, size: u32| {
        let (lo, hi) = (p[0][k].min(p[1][k]).min(p[2][k]), p[0][k].max(p[1][k]).max(p[2][k]));
        (lo >> 8).clamp(0, i64::from(size))..((hi >> 8) + 1).clamp(0, i64::from(size))
    };
    for y in range(1, height) {
        for x in range(0, width) {
            let mut mask = 0;
            for (k, s) in samples.iter().enumerate() {
                let q = [x * 256 + i64::from(s[0]), y * 256 + i64::from(s[1])];
                if edges.iter().all(|&(a, b, least)| side(a, b, q) >= least) {
                    mask |= 1 << k;
                }
            }
            if mask != 0 {
                f(x as u32, y as u32, mask);
            }
        }
    }
}

/// For each corner the plane, over pixel coordinates, of its weight divided by w.
struct Planes {
    weight: [[f64; 3]; 3],
    depth: [f64; 3],
    front: bool,
}

impl Planes {
    /// `None` when the triangle is seen edge-on.
    fn new(corners: [Vec4; 3], width: u32, height: u32) -> Option<Self> {
        let rows = corners.map(|c| {
            let p = c.array().map(f64::from);
            let [x, y] = to_pixels(p, width, height);
            [x, y, p[3]]
        });
        let cross = |a: [f64; 3], b: [f64; 3]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        // The inverse of the matrix of rows, transposed.
        let c = [cross(rows[1], rows[2]), cross(rows[2], rows[0]), cross(rows[0], rows[1])];
        let det = rows[0][0] * c[0][0] + rows[0][1] * c[0][1] + rows[0][2] * c[0][2];
        let weight = c.map(|c| c.map(|v| v / det));
        if det == 0.0 || weight.iter().flatten().any(|v| !v.is_finite()) {
            return None;
        }
        let z = corners.map(|c| f64::from(c.z));
        let depth = core::array::from_fn(|k| z[0] * weight[0][k] + z[1] * weight[1][k] + z[2] * weight[2][k]);
        // y runs down: counter-clockwise is negative.
        Some(Planes { weight, depth, front: det < 0.0 })
    }
    fn fragment(&self, x: u32, y: u32, mask: u32, samples: &[[u8; 2]]) -> Fragment {
        let first = samples[mask.trailing_zeros() as usize];
        // All samples covered: so is the middle of them.
        let in_middle = mask.count_ones() as usize == samples.len()
            || samples.iter().enumerate().any(|(k, s)| *s == CENTER[0] && mask >> k & 1 == 1);
        let (px, py) = at_sample(x, y, if in_middle { CENTER[0] } else { first });
        let l = self.weight.map(|p| p[0] * px + p[1] * py + p[2]);
        // 1 / w
        let s = l[0] + l[1] + l[2];
        let [sx, sy] = [0, 1].map(|c| self.weight[0][c] + self.weight[1][c] + self.weight[2][c]);
        let change = |c: usize, sc: f64| core::array::from_fn(|k| ((self.weight[k][c] - l[k] / s * sc) / s) as f32);
        Fragment {
            x,
            y,
            mask,
            front: self.front,
            weights: l.map(|v| (v / s) as f32),
            weights_dx: change(0, sx),
            weights_dy: change(1, sy),
            depth: self.depth,
        }
    }
}

/// A depth buffer: the larger depth wins, of equals the lower source id.
#[derive(Clone, Debug)]
pub struct DepthBuffer {
    width: u32,
    samples: Vec<[u8; 2]>,
    depth: Vec<f32>,
    id: Vec<u32>,
}

impl DepthBuffer {
    /// Far away and nobody's everywhere. `samples` as for [`triangle`].
    pub fn new(width: u32, height: u32, samples: &[[u8; 2]]) -> Self {
        let len = width as usize * height as usize * samples.len();
        DepthBuffer { width, samples: samples.to_vec(), depth: vec![0.0; len], id: vec![u32::MAX; len] }
    }
    /// Index of a pixel's first sample.
    pub fn index(&self, x: u32, y: u32) -> usize {
        (y as usize * self.width as usize + x as usize) * self.samples.len()
    }
    /// Depth of sample `k` of a pixel, 0 where nothing is.
    pub fn depth(&self, x: u32, y: u32, k: usize) -> f32 {
        self.depth[self.index(x, y) + k]
    }
    /// Source id of sample `k` of a pixel, `u32::MAX` where nothing is.
    pub fn id(&self, x: u32, y: u32, k: usize) -> u32 {
        self.id[self.index(x, y) + k]
    }
    /// The samples of the fragment that triangle `id` would win; changes nothing.
    pub fn test(&self, fragment: &Fragment, id: u32) -> u32 {
        let base = self.index(fragment.x, fragment.y);
        let mut mask = 0;
        for (k, s) in self.samples.iter().enumerate().filter(|(k, _)| fragment.mask >> k & 1 == 1) {
            let (z, old) = (fragment.depth_at(*s), self.depth[base + k]);
            if z > old || z == old && id < self.id[base + k] {
                mask |= 1 << k;
            }
        }
        mask
    }
    /// Gives the samples of `mask` to triangle `id`.
    pub fn write(&mut self, fragment: &Fragment, mask: u32, id: u32) {
        let base = self.index(fragment.x, fragment.y);
        for (k, s) in self.samples.iter().enumerate().filter(|(k, _)| mask >> k & 1 == 1) {
            self.depth[base + k] = fragment.depth_at(*s);
            self.id[base + k] = id;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec::{Mat4, Vec3};

    /// Pixel coordinates -> clip coordinates with w = 1.
    fn flat(x: f32, y: f32, size: u32) -> Vec4 {
        let s = size as f32;
        Vec4::new(x / s * 2.0 - 1.0, 1.0 - y / s * 2.0, 0.5, 1.0)
    }
    /// A small generator for test points.
    fn next(seed: &mut u64) -> f32 {
        *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (*seed >> 40) as f32 / (1 << 24) as f32
    }

    #[test]
    fn row_23_a_mesh_covers_each_sample_exactly_once() {
        const N: u32 = 32;
        let mut seed = 7;
        for samples in [&CENTER[..], &GRID4[..]] {
            for round in 0..20 {
                // A jittered grid over the whole picture; some rounds with points exactly on sample positions.
                let k = 6;
                let mut point = vec![];
                for j in 0..=k {
                    for i in 0..=k {
                        let mut v = [i, j].map(|c| {
                            let step = N as f32 / k as f32;
                            let inner = c > 0 && c < k;
                            c as f32 * step + if inner { (next(&mut seed) - 0.5) * step * 0.4 } else { 0.0 }
                        });
                        if round % 2 == 0 && i > 0 && j > 0 && i < k && j < k {
                            v = v.map(|v| (v * 4.0).floor() / 4.0);
                        }
                        point.push(flat(v[0], v[1], N));
                    }
                }
                let mut count = vec![0u32; (N * N) as usize * samples.len()];
                let at = |i: usize, j: usize| point[j * (k + 1) + i];
                for j in 0..k {
                    for i in 0..k {
                        let q = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                        for t in [[q[0], q[1], q[2]], [q[2], q[0], q[3]]] {
                            triangle(t, N, N, samples, |f| {
                                for s in 0..samples.len() {
                                    count[(f.y * N + f.x) as usize * samples.len() + s] += f.mask >> s & 1;
                                }
                            });
                        }
                    }
                }
                assert!(count.iter().all(|c| *c == 1), "round {round}");
            }
        }
    }

    #[test]
    fn row_23_edges_through_centres_belong_to_the_upper_left() {
        let covered = |t: [[f32; 2]; 3]| {
            let mut all = vec![];
            triangle(t.map(|p| flat(p[0], p[1], 8)), 8, 8, &CENTER, |f| all.push((f.x, f.y)));
            all
        };
        // Corners on the centres of pixels 1 and 3: left and top edge are in, the slope is out.
        assert_eq!(covered([[1.5, 1.5], [3.5, 1.5], [1.5, 3.5]]), [(1, 1), (2, 1), (1, 2)]);
        assert_eq!(covered([[3.5, 3.5], [3.5, 1.5], [1.5, 3.5]]), [(2, 2)]);
        // Either winding covers the same.
        assert_eq!(covered([[1.5, 1.5], [1.5, 3.5], [3.5, 1.5]]).len(), 3);
        assert_eq!(covered([[1.0, 1.0], [2.0, 2.0], [3.0, 3.0]]), []);
        assert_eq!(covered([[f32::NAN, 1.0], [2.0, 2.0], [3.0, 5.0]]), []);
    }

    /// A camera at the origin with the near plane at 0.1, reversed depth 0.1 / distance.
    fn camera() -> Mat4 {
        Mat4([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, -1.0], [0.0, 0.0, 0.1, 0.0]])
    }

    #[test]
    fn row_26_attributes_match_a_ray_cast_at_80_degrees() {
        const N: u32 = 64;
        // A plane whose normal leans 80 degrees away, partly behind the eye.
        let (s, c) = (0.984_807_8_f32, 0.173_648_18_f32);
        let v = |u: f32, d: f32| Vec3::new(u, -0.5 + c * d, -1.0 - s * d);
        let p = [v(-5.0, -3.0), v(5.0, -3.0), v(0.0, 40.0)];
        let mut seen = 0;
        triangle(p.map(|p| camera().project(p)), N, N, &CENTER, |f| {
            seen += 1;
            let got = p[0] * f.weights[0] + p[1] * f.weights[1] + p[2] * f.weights[2];
            let ray = [(f64::from(f.x) + 0.5) / 32.0 - 1.0, 1.0 - (f64::from(f.y) + 0.5) / 32.0, -1.0];
            // Plane: y c' - ... through (0, -0.5, -1) with direction (0, c, -s): normal (0, s, c).
            let (s, c) = (f64::from(s), f64::from(c));
            let t = (s * -0.5 - c) / (ray[1] * s + ray[2] * c);
            for (got, ray) in got.array().iter().zip(ray) {
                // Row 26 asks for 1e-5, relative to the distance.
                assert!((f64::from(*got) - ray * t).abs() < 1e-5 * t.max(1.0), "{got} {} {f:?}", ray * t);
            }
            let depth = f64::from(f.depth_at(CENTER[0]));
            assert!((depth - 0.1 / t).abs() < 1e-6, "{depth} {}", 0.1 / t);
            assert!((f.weights.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        });
        assert!(seen > 500, "{seen}");
    }

    #[test]
    fn derivatives_are_differences_of_neighbours() {
        let p = [Vec3::new(-3.0, -1.0, -2.0), Vec3::new(4.0, -1.5, -3.0), Vec3::new(0.0, 5.0, -6.0)];
        let mut all = std::collections::BTreeMap::new();
        triangle(p.map(|p| camera().project(p)), 256, 256, &CENTER, |f| {
            all.insert((f.x, f.y), *f);
        });
        let f = all[&(128, 128)];
        for (a, b, d) in [((127, 128), (129, 128), f.weights_dx), ((128, 127), (128, 129), f.weights_dy)] {
            for k in 0..3 {
                let difference = (all[&b].weights[k] - all[&a].weights[k]) / 2.0;
                // Central differences of weights of size 1 in single precision, and their third order.
                assert!((difference - d[k]).abs() < 2e-6, "{difference} {}", d[k]);
            }
        }
    }

    #[test]
    fn row_27_depth_is_independent_of_order() {
        let t = |z: f32| [[-1.0, -1.0, z, 1.0], [3.0, -1.0, z, 1.0], [-1.0, 3.0, z, 1.0]].map(Vec4::from);
        let tilted = [[-1.0, -1.0, 0.9, 1.0], [3.0, -1.0, 0.1, 1.0], [-1.0, 3.0, 0.5, 1.0]].map(Vec4::from);
        let all = [t(0.3), tilted, t(0.5), t(0.5), t(0.0)];
        let draw = |order: [usize; 5]| {
            let mut buffer = DepthBuffer::new(16, 16, &GRID4);
            for k in order {
                triangle(all[k], 16, 16, &GRID4, |f| {
                    let mask = buffer.test(f, k as u32);
                    buffer.write(f, mask, k as u32);
                });
            }
            buffer.id
        };
        let want = draw([0, 1, 2, 3, 4]);
        assert!(want.contains(&1) && want.contains(&2) && !want.contains(&3));
        for order in [[4, 3, 2, 1, 0], [2, 3, 1, 0, 4], [3, 2, 4, 0, 1]] {
            assert_eq!(draw(order), want);
        }
    }

    #[test]
    fn near_and_far_are_clipped_and_huge_triangles_are_exact() {
        let mut n = 0;
        let mut count = |t: [[f32; 4]; 3]| {
            n = 0;
            triangle(t.map(Vec4::from), 8, 8, &CENTER, |_| n += 1);
            n
        };
        assert_eq!(count([[-1.0, -1.0, 2.0, 1.0], [3.0, -1.0, 2.0, 1.0], [-1.0, 3.0, 2.0, 1.0]]), 0);
        assert_eq!(count([[-1.0, -1.0, -0.1, 1.0], [3.0, -1.0, -0.1, 1.0], [-1.0, 3.0, -0.1, 1.0]]), 0);
        assert_eq!(count([[-1e9, -1e9, 0.5, 1.0], [1e9, -1e9, 0.5, 1.0], [0.0, 1e9, 0.5, 1.0]]), 64);
        assert_eq!(count([[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]]), 0);
        // Half of it nearer than the near plane: depth runs from 2 on the left to 0 on the right.
        assert_eq!(count([[-1.0, -1.0, 2.0, 1.0], [3.0, -1.0, -2.0, 1.0], [-1.0, 3.0, 2.0, 1.0]]), 32);
    }

    #[test]
    fn centroid_sampling_stays_inside() {
        // A sliver that covers samples but no centre: weights never leave 0 ..= 1.
        let t = [[0.0f32, 0.1], [8.0, 0.1], [8.0, 0.4]].map(|p| flat(p[0], p[1], 8));
        let mut seen = 0;
        triangle(t, 8, 8, &GRID4, |f| {
            seen += 1;
            assert!(f.weights.iter().all(|w| (-1e-3..=1.001).contains(w)), "{f:?}");
        });
        assert!(seen > 0);
    }
}
