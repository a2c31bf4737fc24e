//! Clusters of at most 64 vertices and 128 triangles, for culling and vertex reuse.
//!
//! Triangles are sorted along a Morton curve through their centroids and packed by one linear scan, chunk by
//! chunk. All decisions are integer ones on the source data, so the clusters are the same for any number of
//! threads and any SIMD level.

use super::Mesh;
use rayon::prelude::*;
use std::collections::HashMap;

/// Most vertices of a meshlet.
pub const VERTICES: usize = 64;
/// Most triangles of a meshlet.
pub const TRIANGLES: usize = 128;
/// Positions of a meshlet are padded to this many, so that every SIMD width loads whole vectors.
const PAD: usize = 16;
/// Triangles per independent run of the scan: fixed, so that threads don't matter.
const CHUNK: usize = 1 << 14;
/// Runs per thread that are done before they are put together: all at once would hold the mesh twice.
const WAVE: usize = 4;

/// A cluster of triangles of one material slot.
#[derive(Clone, Debug, PartialEq)]
pub struct Meshlet {
    /// Centre of the bounding sphere, object space.
    pub center: [f32; 3],
    /// Radius of the bounding sphere.
    pub radius: f32,
    /// Axis of the cone of triangle normals.
    pub axis: [f32; 3],
    /// Sine of the cone's half angle; 2 when normals point everywhere, which no view culls.
    pub spread: f32,
    /// Where its padded positions begin in [`Meshlets::x`].
    pub positions: u32,
    /// Where its vertices begin in [`Meshlets::vertices`] and the optional streams.
    pub vertices: u32,
    /// Where its triangles begin in [`Meshlets::triangles`].
    pub triangles: u32,
    /// How many vertices it has.
    pub vertex_count: u8,
    /// How many triangles it has.
    pub triangle_count: u8,
    /// Bit `k`: the bitangent of vertex `k` is mirrored (tangent sign -1).
    pub mirrored: u64,
    /// The material slot.
    pub slot: u32,
}

/// A mesh in clusters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Meshlets {
    /// The clusters, slot after slot.
    pub meshlets: Vec<Meshlet>,
    /// Positions, x; padded per meshlet by repeating its last vertex.
    pub x: Vec<f32>,
    /// Positions, y.
    pub y: Vec<f32>,
    /// Positions, z.
    pub z: Vec<f32>,
    /// Three local vertices per triangle, and 0.
    pub triangles: Vec<[u8; 4]>,
    /// The source triangle of each triangle.
    pub source: Vec<u32>,
    /// Per vertex: normal, tangent, first UV set.
    pub vertices: Vec<[f32; 8]>,
    /// Second UV set, if any.
    pub uv1: Vec<[f32; 2]>,
    /// Colours, if any.
    pub colors: Vec<[f32; 4]>,
}

/// The attributes that vertices are cooked from: as the mesh has them, or computed for it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sources<'a> {
    /// Shading normals.
    pub normals: Option<&'a super::Attribute<[f32; 3]>>,
    /// Tangents with sign.
    pub tangents: Option<&'a super::Attribute<[f32; 4]>>,
    /// UV sets.
    pub uv: [Option<&'a super::Attribute<[f32; 2]>>; 2],
    /// Colours.
    pub colors: Option<&'a super::Attribute<[f32; 4]>>,
}

impl Meshlets {
    /// Cooks a mesh. Runs in parallel inside of a job's pool.
    pub fn new(mesh: &Mesh, from: &Sources<'_>) -> Self {
        let identity = Identity::new(mesh, from);
        let mut orders = Vec::new();
        for (slot, triangles) in by_slot(mesh) {
            orders.push((slot, along_a_curve(mesh, triangles)));
        }
        let chunks: Vec<(u32, &[u32])> =
            orders.iter().flat_map(|(slot, order)| order.chunks(CHUNK).map(move |c| (*slot, c))).collect();
        let mut all = Meshlets::default();
        let wave = WAVE * rayon::current_num_threads();
        let waves = chunks.len().div_ceil(wave);
        for (k, wave) in chunks.chunks(wave).enumerate() {
            let parts: Vec<Meshlets> = wave
                .into_par_iter()
                .map(|&(slot, order)| {
                    let mut part = Meshlets::default();
                    part.pack(mesh, from, &identity, slot, order);
                    part
                })
                .collect();
            if k == 0 && waves > 1 {
                // Growing would leave holes: the rest is like the first wave, or a little more.
                let sum = |f: fn(&Meshlets) -> usize| parts.iter().map(f).sum::<usize>() * waves * 17 / 16;
                all.meshlets.reserve_exact(sum(|p| p.meshlets.len()));
                let positions = sum(|p| p.x.len());
                all.x.reserve_exact(positions);
                all.y.reserve_exact(positions);
                all.z.reserve_exact(positions);
                all.triangles.reserve_exact(mesh.triangle_count());
                all.source.reserve_exact(mesh.triangle_count());
                all.vertices.reserve_exact(sum(|p| p.vertices.len()));
                all.uv1.reserve_exact(sum(|p| p.uv1.len()));
                all.colors.reserve_exact(sum(|p| p.colors.len()));
            }
            parts.into_iter().for_each(|part| all.append(part));
        }
        all
    }

    /// Bytes that it takes.
    pub fn bytes(&self) -> u64 {
        (size_of_val(&self.meshlets[..])
            + size_of_val(&self.x[..]) * 3
            + size_of_val(&self.triangles[..])
            + size_of_val(&self.source[..])
            + size_of_val(&self.vertices[..])
            + size_of_val(&self.uv1[..])
            + size_of_val(&self.colors[..])) as u64
    }

    fn append(&mut self, part: Meshlets) {
        let (p, v, t) = (self.x.len() as u32, self.vertices.len() as u32, self.triangles.len() as u32);
        self.meshlets.extend(part.meshlets.into_iter().map(|m| Meshlet {
            positions: m.positions + p,
            vertices: m.vertices + v,
            triangles: m.triangles + t,
            ..m
        }));
        self.x.extend_from_slice(&part.x);
        self.y.extend_from_slice(&part.y);
        self.z.extend_from_slice(&part.z);
        self.triangles.extend_from_slice(&part.triangles);
        self.source.extend_from_slice(&part.source);
        self.vertices.extend_from_slice(&part.vertices);
        self.uv1.extend_from_slice(&part.uv1);
        self.colors.extend_from_slice(&part.colors);
    }

    fn pack(&mut self, mesh: &Mesh, from: &Sources<'_>, identity: &Identity, slot: u32, order: &[u32]) {
        let mut open = Open::new();
        for &t in order {
            let corners = mesh.triangle(t as usize);
            let ids = corners.map(|c| identity.of(mesh, c));
            if !open.fits(ids) {
                self.close(mesh, from, slot, &mut open);
            }
            let local = core::array::from_fn(|k| open.local(ids[k], corners[k]));
            let [a, b, c]: [u8; 3] = local;
            open.triangles.push([a, b, c, 0]);
            open.source.push(t);
        }
        self.close(mesh, from, slot, &mut open);
    }

    fn close(&mut self, mesh: &Mesh, from: &Sources<'_>, slot: u32, open: &mut Open) {
        if open.triangles.is_empty() {
            return;
        }
        let positions: Vec<[f32; 3]> = open.corners.iter().map(|&c| mesh.position(c)).collect();
        let (center, radius) = sphere(&positions);
        let (axis, spread) = cone(&positions, &open.triangles);
        let mut mirrored = 0u64;
        let first = (self.x.len() as u32, self.vertices.len() as u32, self.triangles.len() as u32);
        for (k, &c) in open.corners.iter().enumerate() {
            let n = from.normals.map_or([0.0, 0.0, 1.0], |a| a.at(mesh, c));
            let n = unit(n);
            let t = from.tangents.map_or([0.0; 4], |a| a.at(mesh, c));
            let uv = from.uv[0].map_or([0.0; 2], |a| a.at(mesh, c));
            if t[3] < 0.0 {
                mirrored |= 1 << k;
            }
            self.vertices.push([n[0], n[1], n[2], t[0], t[1], t[2], uv[0], uv[1]]);
            if let Some(a) = from.uv[1] {
                self.uv1.push(a.at(mesh, c));
            }
            if let Some(a) = from.colors {
                self.colors.push(a.at(mesh, c));
            }
        }
        let padded = positions.len().next_multiple_of(PAD);
        let last = positions[positions.len() - 1];
        for p in positions.iter().copied().chain(std::iter::repeat_n(last, padded - positions.len())) {
            self.x.push(p[0]);
            self.y.push(p[1]);
            self.z.push(p[2]);
        }
        self.triangles.extend_from_slice(&open.triangles);
        self.source.extend_from_slice(&open.source);
        self.meshlets.push(Meshlet {
            center,
            radius,
            axis,
            spread,
            positions: first.0,
            vertices: first.1,
            triangles: first.2,
            vertex_count: open.corners.len() as u8,
            triangle_count: open.triangles.len() as u8,
            mirrored,
            slot,
        });
        open.clear();
    }
}

/// Unit length; what has no length points up.
fn unit(v: [f32; 3]) -> [f32; 3] {
    let l = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    if l > 1e-30 && l.is_finite() { v.map(|c| c / l) } else { [0.0, 1.0, 0.0] }
}

/// The meshlet that is being filled.
struct Open {
    corners: Vec<usize>,
    triangles: Vec<[u8; 4]>,
    source: Vec<u32>,
    /// Vertex id + 1 and local index, open addressing; 256 places for at most 64 vertices.
    table: [(u32, u8); 256],
}

impl Open {
    fn new() -> Self {
        Open {
            corners: Vec::with_capacity(VERTICES),
            triangles: Vec::with_capacity(TRIANGLES),
            source: Vec::with_capacity(TRIANGLES),
            table: [(0, 0); 256],
        }
    }
    fn clear(&mut self) {
        self.corners.clear();
        self.triangles.clear();
        self.source.clear();
        self.table.fill((0, 0));
    }
    fn find(&self, id: u32) -> usize {
        let mut k = (id.wrapping_mul(0x9e37_79b1) >> 24) as usize;
        while self.table[k].0 != 0 && self.table[k].0 != id + 1 {
            k = (k + 1) & 255;
        }
        k
    }
    fn fits(&self, ids: [u32; 3]) -> bool {
        self.triangles.len() < TRIANGLES
            && (self.corners.len() + 3 <= VERTICES
                || self.corners.len() + ids.iter().filter(|&&id| self.table[self.find(id)].0 == 0).count() <= VERTICES)
    }
    fn local(&mut self, id: u32, corner: usize) -> u8 {
        let k = self.find(id);
        if self.table[k].0 == 0 {
            self.table[k] = (id + 1, self.corners.len() as u8);
            self.corners.push(corner);
        }
        self.table[k].1
    }
}

/// Which corners are the same vertex.
struct Identity(Option<Vec<u32>>);

impl Identity {
    fn new(mesh: &Mesh, from: &Sources<'_>) -> Self {
        fn own<T>(a: Option<&super::Attribute<T>>) -> Option<&[u32]> {
            a.and_then(|a| a.index.as_deref())
        }
        let indices: Vec<&[u32]> =
            [own(from.normals), own(from.tangents), own(from.uv[0]), own(from.uv[1]), own(from.colors)]
                .into_iter()
                .flatten()
                .collect();
        if indices.is_empty() {
            return Identity(None);
        }
        let mut seen: HashMap<[u32; 6], u32> = HashMap::with_capacity(mesh.positions.len() * 2);
        Identity(Some(
            (0..mesh.corners.len())
                .map(|c| {
                    let mut key = [mesh.corners[c], 0, 0, 0, 0, 0];
                    for (k, index) in indices.iter().enumerate() {
                        key[k + 1] = index[c];
                    }
                    let next = seen.len() as u32;
                    *seen.entry(key).or_insert(next)
                })
                .collect(),
        ))
    }
    #[inline(always)]
    fn of(&self, mesh: &Mesh, corner: usize) -> u32 {
        match &self.0 {
            Some(ids) => ids[corner],
            None => mesh.corners[corner],
        }
    }
}

/// The triangles of each material slot, in file order.
fn by_slot(mesh: &Mesh) -> Vec<(u32, Option<Vec<u32>>)> {
    let count = mesh.triangle_count();
    if count == 0 {
        return Vec::new();
    }
    let first = mesh.material_of(0);
    if mesh.materials.is_empty() || mesh.materials.iter().all(|&m| m as usize == first) {
        return vec![(first as u32, None)];
    }
    let mut groups: std::collections::BTreeMap<u32, Vec<u32>> = Default::default();
    for t in 0..count {
        groups.entry(mesh.material_of(t) as u32).or_default().push(t as u32);
    }
    groups.into_iter().map(|(slot, triangles)| (slot, Some(triangles))).collect()
}

/// Triangles along a Morton curve through their centroids.
fn along_a_curve(mesh: &Mesh, triangles: Option<Vec<u32>>) -> Vec<u32> {
    let all = mesh.triangle_count();
    let low = (usize::BITS - all.leading_zeros()).min(32);
    let bits = ((64 - low) / 3).min(16);
    let (lo, hi) = mesh.bounds().unwrap_or_default();
    let top = ((1u32 << bits) - 1) as f32;
    // One scale for all axes, so that cells are cubes.
    let size = (0..3).map(|k| hi[k] - lo[k]).fold(0.0f32, f32::max);
    let scale = if size > 0.0 && size.is_finite() { top / size } else { 0.0 };
    // The triangle's number in the low bits, the curve above.
    let key = |t: u32| {
        let p = mesh.triangle(t as usize).map(|c| mesh.position(c));
        let mut code = 0u64;
        for k in 0..3 {
            let c = ((p[0][k] - lo[k]) + (p[1][k] - lo[k]) + (p[2][k] - lo[k])) * (scale / 3.0);
            code |= spread(c.clamp(0.0, top) as u64) << k;
        }
        code << low | u64::from(t)
    };
    let mut keys: Vec<u64> = match triangles {
        Some(list) => list.into_par_iter().map(key).collect(),
        None => (0..all as u32).into_par_iter().with_min_len(4096).map(key).collect(),
    };
    keys.par_sort_unstable();
    let mask = ((1u64 << low) - 1) as u32;
    keys.iter().map(|&k| k as u32 & mask).collect()
}

/// Two zero bits after each of the low 16 bits.
fn spread(v: u64) -> u64 {
    let v = (v | v << 32) & 0x001f_0000_0000_ffff;
    let v = (v | v << 16) & 0x001f_0000_ff00_00ff;
    let v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    let v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

/// A sphere around points: the centre of their box.
fn sphere(points: &[[f32; 3]]) -> ([f32; 3], f32) {
    let (mut lo, mut hi) = (points[0], points[0]);
    for p in points {
        for k in 0..3 {
            lo[k] = lo[k].min(p[k]);
            hi[k] = hi[k].max(p[k]);
        }
    }
    let center: [f32; 3] = core::array::from_fn(|k| lo[k] * 0.5 + hi[k] * 0.5);
    let r2 = points.iter().fold(0.0f32, |r, p| {
        let d: [f32; 3] = core::array::from_fn(|k| p[k] - center[k]);
        r.max(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    });
    // Rounding of the squares and the root: a few units in the last place.
    (center, r2.sqrt() * 1.000_001)
}

/// Axis and sine of the half angle of the cone that holds all triangle normals.
fn cone(points: &[[f32; 3]], triangles: &[[u8; 4]]) -> ([f32; 3], f32) {
    let everywhere = ([0.0, 0.0, 1.0], 2.0);
    let mut normals = [[0.0f32; 3]; TRIANGLES];
    let mut count = 0;
    let mut sum = [0.0f32; 3];
    for t in triangles {
        let [a, b, c] = [points[t[0] as usize], points[t[1] as usize], points[t[2] as usize]];
        let (u, v): ([f32; 3], [f32; 3]) =
            (core::array::from_fn(|k| b[k] - a[k]), core::array::from_fn(|k| c[k] - a[k]));
        let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        let l = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
        if l == 0.0 {
            continue; // No area: drawn from no side.
        }
        if !(1e-30..1e30).contains(&l) {
            return everywhere;
        }
        let n = n.map(|c| c / l);
        (0..3).for_each(|k| sum[k] += n[k]);
        normals[count] = n;
        count += 1;
    }
    let l = (sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]).sqrt();
    if l < 1e-6 {
        return everywhere;
    }
    let axis = sum.map(|c| c / l);
    let cos = normals[..count].iter().fold(1.0f32, |m, n| m.min(n[0] * axis[0] + n[1] * axis[1] + n[2] * axis[2]));
    // Normals of slivers are only as exact as their edges: a margin of 1e-3 keeps the test conservative.
    let cos = cos - 1e-3;
    if cos <= 0.05 { everywhere } else { (axis, (1.0 - cos * cos).sqrt()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shape;

    fn cook(mesh: &Mesh) -> Meshlets {
        let from = Sources { normals: mesh.normals.as_ref(), uv: [mesh.uv[0].as_ref(), None], ..Sources::default() };
        Meshlets::new(mesh, &from)
    }

    #[test]
    fn every_source_triangle_is_in_exactly_one_meshlet_with_its_positions() {
        for mesh in [shape::sphere(1.0, 64), shape::torus(1.0, 48), shape::cube(2.0)] {
            let cooked = cook(&mesh);
            let mut seen = vec![0; mesh.triangle_count()];
            for m in &cooked.meshlets {
                assert!(usize::from(m.vertex_count) <= VERTICES && usize::from(m.triangle_count) <= TRIANGLES);
                for t in 0..m.triangle_count as usize {
                    let at = m.triangles as usize + t;
                    let source = cooked.source[at] as usize;
                    seen[source] += 1;
                    for (k, c) in mesh.triangle(source).into_iter().enumerate() {
                        let v = m.positions as usize + cooked.triangles[at][k] as usize;
                        assert_eq!([cooked.x[v], cooked.y[v], cooked.z[v]], mesh.position(c));
                    }
                }
            }
            assert!(seen.iter().all(|&n| n == 1));
        }
    }

    #[test]
    fn spheres_hold_their_points_and_cones_their_normals() {
        let mesh = shape::torus(1.0, 160);
        let cooked = cook(&mesh);
        for m in &cooked.meshlets {
            for k in 0..m.vertex_count as usize {
                let v = m.positions as usize + k;
                let d = [cooked.x[v] - m.center[0], cooked.y[v] - m.center[1], cooked.z[v] - m.center[2]];
                assert!((d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt() <= m.radius);
            }
        }
        // Most clusters of a finely tessellated surface can be culled from behind.
        let narrow = cooked.meshlets.iter().filter(|m| m.spread < 1.0).count();
        assert!(narrow * 10 >= cooked.meshlets.len() * 9, "{narrow} of {}", cooked.meshlets.len());
    }

    #[test]
    fn clusters_do_not_depend_on_threads() {
        let mesh = shape::sphere(1.0, 200);
        let one = crate::Job::builder().threads(1).build().run(|| cook(&mesh));
        let three = crate::Job::builder().threads(3).build().run(|| cook(&mesh));
        assert_eq!(one, three);
    }

    #[test]
    fn morton_bits_do_not_meet() {
        for k in 0..16 {
            assert_eq!(spread(1 << k), 1 << (3 * k));
        }
        assert_eq!(spread(0xffff).count_ones(), 16);
    }
}
