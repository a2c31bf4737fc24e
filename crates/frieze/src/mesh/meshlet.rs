//! Clusters of at most 64 vertices and 128 triangles, for culling and vertex reuse.
//!
//! Triangles are sorted along a Morton curve through their centroids and packed by one linear scan, run by
//! run. All decisions are integer ones on the source data, so the clusters are the same for any number of
//! threads and any SIMD level.

use super::{Bounds, Mesh};
use rayon::prelude::*;
use std::collections::HashMap;

/// Most vertices of a meshlet.
pub const VERTICES: usize = 64;
/// Most triangles of a meshlet.
pub const TRIANGLES: usize = 128;
/// Positions of a meshlet are padded to this many, so that every SIMD width loads whole vectors.
const PAD: usize = 16;
/// Triangles per independent run of the scan: fixed, so that threads don't matter. A [`Draft`] counts them in 14 bits.
const RUN: usize = 1 << 14;

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
    /// [`Mesh::bounds`] of what it was cooked from.
    pub bounds: Option<Bounds>,
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
    ///
    /// First every run of triangles is parted into clusters; then all sizes are known, and the vertices are written
    /// where they stay.
    pub fn new(mesh: &Mesh, from: &Sources<'_>) -> Self {
        let identity = Identity::new(mesh, from);
        let mut all = Meshlets { bounds: mesh.bounds(), ..Meshlets::default() };
        let mut lengths = Vec::new();
        for (slot, triangles) in by_slot(mesh) {
            let order = along_a_curve(mesh, all.bounds, triangles);
            lengths.extend(order.chunks(RUN).map(|run| (slot, run.len())));
            if all.source.is_empty() { all.source = order } else { all.source.extend(order) }
        }
        all.triangles = vec![[0; 4]; all.source.len()];
        let (mut source, mut triangles) = (&all.source[..], &mut all.triangles[..]);
        let mut runs = Vec::with_capacity(lengths.len());
        for (slot, n) in lengths {
            runs.push((slot, source.split_off(..n).expect("cut from it"), split(&mut triangles, n)));
        }
        let drafts: Vec<Draft<'_>> = runs
            .into_par_iter()
            .map(|(slot, source, triangles)| Draft::new(mesh, &identity, slot, source, triangles))
            .collect();
        let vertices: usize = drafts.iter().map(|d| d.corners.len()).sum();
        let padded: usize = drafts.iter().map(|d| d.padded).sum();
        all.x = vec![0.0; padded];
        all.y = vec![0.0; padded];
        all.z = vec![0.0; padded];
        all.vertices = vec![[0.0; 8]; vertices];
        all.uv1 = vec![[0.0; 2]; from.uv[1].map_or(0, |_| vertices)];
        all.colors = vec![[0.0; 4]; from.colors.map_or(0, |_| vertices)];
        let (mut x, mut y, mut z) = (&mut all.x[..], &mut all.y[..], &mut all.z[..]);
        let (mut own, mut uv1, mut colors) = (&mut all.vertices[..], &mut all.uv1[..], &mut all.colors[..]);
        let mut first = First::default();
        let mut parts = Vec::with_capacity(drafts.len());
        for draft in drafts {
            let n = draft.corners.len();
            let part = Part {
                first,
                x: split(&mut x, draft.padded),
                y: split(&mut y, draft.padded),
                z: split(&mut z, draft.padded),
                vertices: split(&mut own, n),
                uv1: split(&mut uv1, from.uv[1].map_or(0, |_| n)),
                colors: split(&mut colors, from.colors.map_or(0, |_| n)),
            };
            first.positions += draft.padded as u32;
            first.vertices += n as u32;
            first.triangles += draft.source.len() as u32;
            parts.push((draft, part));
        }
        let made: Vec<Vec<Meshlet>> =
            parts.into_par_iter().map(|(draft, part)| part.fill(mesh, from, &draft)).collect();
        all.meshlets = made.concat();
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
}

/// The first `n` of a slice, which begins behind them then.
fn split<'a, T>(rest: &mut &'a mut [T], n: usize) -> &'a mut [T] {
    rest.split_off_mut(..n).expect("as long as all parts together")
}

/// A run of triangles of one slot, parted into clusters.
struct Draft<'a> {
    slot: u32,
    source: &'a [u32],
    /// Three local vertices per triangle, and 0.
    triangles: &'a [[u8; 4]],
    /// Vertices and triangles of each cluster.
    clusters: Vec<(u8, u8)>,
    /// A corner of each vertex: four times the triangle's place in `source`, and which of its three.
    corners: Vec<u16>,
    /// Vertices, each cluster's padded to whole vectors.
    padded: usize,
}

impl<'a> Draft<'a> {
    fn new(mesh: &Mesh, identity: &Identity, slot: u32, source: &'a [u32], triangles: &'a mut [[u8; 4]]) -> Self {
        let (mut clusters, mut corners, mut padded) = (Vec::new(), Vec::new(), 0);
        let mut open = Open::new();
        for (at, &t) in source.iter().enumerate() {
            let [a, b, c] = mesh.triangle(t as usize);
            let ids = [identity.of(mesh, a), identity.of(mesh, b), identity.of(mesh, c)];
            if !open.fits(ids) {
                padded += open.vertices.next_multiple_of(PAD);
                clusters.push((open.vertices as u8, open.triangles as u8));
                open.clear();
            }
            for k in 0..3 {
                let (local, new) = open.local(ids[k]);
                triangles[at][k] = local;
                if new {
                    corners.push((at << 2 | k) as u16);
                }
            }
            open.triangles += 1;
        }
        padded += open.vertices.next_multiple_of(PAD);
        clusters.push((open.vertices as u8, open.triangles as u8));
        Draft { slot, source, triangles, clusters, corners, padded }
    }
}

/// Where the numbers of a part begin in the whole.
#[derive(Clone, Copy, Default)]
struct First {
    positions: u32,
    vertices: u32,
    triangles: u32,
}

/// The place of a draft's vertices in [`Meshlets`].
struct Part<'a> {
    first: First,
    x: &'a mut [f32],
    y: &'a mut [f32],
    z: &'a mut [f32],
    vertices: &'a mut [[f32; 8]],
    uv1: &'a mut [[f32; 2]],
    colors: &'a mut [[f32; 4]],
}

impl Part<'_> {
    fn fill(self, mesh: &Mesh, from: &Sources<'_>, draft: &Draft<'_>) -> Vec<Meshlet> {
        let mut points = [[0.0f32; 3]; VERTICES];
        let (mut p, mut v, mut t) = (0, 0, 0);
        let mut meshlets = Vec::with_capacity(draft.clusters.len());
        for &(vertices, triangles) in &draft.clusters {
            let (count, size) = (usize::from(vertices), usize::from(triangles));
            let mut mirrored = 0u64;
            for k in 0..count {
                let code = usize::from(draft.corners[v + k]);
                let c = mesh.triangle(draft.source[code >> 2] as usize)[code & 3];
                points[k] = mesh.position(c);
                let n = from.normals.map_or([0.0, 0.0, 1.0], |a| a.at(mesh, c));
                let n = unit(n);
                let t = from.tangents.map_or([0.0; 4], |a| a.at(mesh, c));
                let uv = from.uv[0].map_or([0.0; 2], |a| a.at(mesh, c));
                mirrored |= u64::from(t[3] < 0.0) << k;
                self.vertices[v + k] = [n[0], n[1], n[2], t[0], t[1], t[2], uv[0], uv[1]];
                if let Some(a) = from.uv[1] {
                    self.uv1[v + k] = a.at(mesh, c);
                }
                if let Some(a) = from.colors {
                    self.colors[v + k] = a.at(mesh, c);
                }
            }
            let padded = count.next_multiple_of(PAD);
            for k in 0..padded {
                let point = points[k.min(count - 1)];
                self.x[p + k] = point[0];
                self.y[p + k] = point[1];
                self.z[p + k] = point[2];
            }
            let (center, radius) = sphere(&points[..count]);
            let (axis, spread) = cone(&points, &draft.triangles[t..t + size]);
            meshlets.push(Meshlet {
                center,
                radius,
                axis,
                spread,
                positions: self.first.positions + p as u32,
                vertices: self.first.vertices + v as u32,
                triangles: self.first.triangles + t as u32,
                vertex_count: vertices,
                triangle_count: triangles,
                mirrored,
                slot: draft.slot,
            });
            p += padded;
            v += count;
            t += size;
        }
        meshlets
    }
}

/// Unit length; what has no length points up.
fn unit(v: [f32; 3]) -> [f32; 3] {
    let l = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    if l > 1e-30 && l.is_finite() { [v[0] / l, v[1] / l, v[2] / l] } else { [0.0, 1.0, 0.0] }
}

/// The cluster that is being filled.
struct Open {
    vertices: usize,
    triangles: usize,
    /// Vertex id + 1 and local index, open addressing; 256 places for at most 64 vertices.
    table: [(u32, u8); 256],
}

impl Open {
    fn new() -> Self {
        Open { vertices: 0, triangles: 0, table: [(0, 0); 256] }
    }
    fn clear(&mut self) {
        *self = Self::new();
    }
    fn find(&self, id: u32) -> usize {
        let mut k = (id.wrapping_mul(0x9e37_79b1) >> 24) as usize;
        while self.table[k].0 != 0 && self.table[k].0 != id + 1 {
            k = (k + 1) & 255;
        }
        k
    }
    fn fits(&self, ids: [u32; 3]) -> bool {
        self.triangles < TRIANGLES
            && (self.vertices + 3 <= VERTICES
                || self.vertices + ids.iter().filter(|&&id| self.table[self.find(id)].0 == 0).count() <= VERTICES)
    }
    /// The local index of a vertex, and whether it is new.
    fn local(&mut self, id: u32) -> (u8, bool) {
        let k = self.find(id);
        let new = self.table[k].0 == 0;
        if new {
            self.table[k] = (id + 1, self.vertices as u8);
            self.vertices += 1;
        }
        (self.table[k].1, new)
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
fn along_a_curve(mesh: &Mesh, bounds: Option<Bounds>, triangles: Option<Vec<u32>>) -> Vec<u32> {
    let all = mesh.triangle_count();
    let low = (usize::BITS - all.leading_zeros()).min(32);
    let bits = ((64 - low) / 3).min(16);
    let (lo, hi) = bounds.unwrap_or_default();
    let top = ((1u32 << bits) - 1) as f32;
    // One scale for all axes, so that cells are cubes.
    let size = (0..3).map(|k| hi[k] - lo[k]).fold(0.0f32, f32::max);
    let scale = if size > 0.0 && size.is_finite() { top / size } else { 0.0 };
    // The triangle's number in the low bits, the curve above.
    let key = |t: u32| {
        let [a, b, c] = mesh.triangle(t as usize);
        let p = [mesh.position(a), mesh.position(b), mesh.position(c)];
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
    keys.par_iter().map(|&k| k as u32 & mask).collect()
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
    let center = [lo[0] * 0.5 + hi[0] * 0.5, lo[1] * 0.5 + hi[1] * 0.5, lo[2] * 0.5 + hi[2] * 0.5];
    let mut r2 = 0.0f32;
    for p in points {
        let d = [p[0] - center[0], p[1] - center[1], p[2] - center[2]];
        r2 = r2.max(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    }
    // Rounding of the squares and the root: a few units in the last place.
    (center, r2.sqrt() * 1.000_001)
}

/// Axis and sine of the half angle of the cone that holds all triangle normals.
fn cone(points: &[[f32; 3]; VERTICES], triangles: &[[u8; 4]]) -> ([f32; 3], f32) {
    let everywhere = ([0.0, 0.0, 1.0], 2.0);
    // One array per axis, so that the compiler works on several triangles at a time.
    let [mut x, mut y, mut z, mut length] = [[0.0f32; TRIANGLES]; 4];
    let count = triangles.len();
    for (k, t) in triangles.iter().enumerate() {
        // Local vertices are below 64.
        let [a, b, c] = [points[t[0] as usize & 63], points[t[1] as usize & 63], points[t[2] as usize & 63]];
        let u = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
        let v = [c[0] - a[0], c[1] - a[1], c[2] - a[2]];
        x[k] = u[1] * v[2] - u[2] * v[1];
        y[k] = u[2] * v[0] - u[0] * v[2];
        z[k] = u[0] * v[1] - u[1] * v[0];
    }
    let mut wrong = false;
    for k in 0..TRIANGLES {
        let l = (x[k] * x[k] + y[k] * y[k] + z[k] * z[k]).sqrt();
        // Without area it is drawn from no side, and has no say.
        wrong |= l != 0.0 && !(1e-30..1e30).contains(&l);
        length[k] = l;
        let by = if l == 0.0 { 1.0 } else { l };
        x[k] /= by;
        y[k] /= by;
        z[k] /= by;
    }
    if wrong {
        return everywhere;
    }
    let mut sum = [0.0f32; 3];
    for k in 0..count {
        sum[0] += x[k];
        sum[1] += y[k];
        sum[2] += z[k];
    }
    let l = (sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]).sqrt();
    if l < 1e-6 {
        return everywhere;
    }
    let axis = [sum[0] / l, sum[1] / l, sum[2] / l];
    for k in 0..TRIANGLES {
        let cos = x[k] * axis[0] + y[k] * axis[1] + z[k] * axis[2];
        length[k] = if length[k] == 0.0 { 1.0 } else { cos };
    }
    let cos = length[..count].iter().fold(1.0f32, |least, &cos| if cos < least { cos } else { least });
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
