//! Positions in file order, faces in file order, and attributes at corners, each with its own index.
//! Welding, splitting and dropping are views derived from this; source ids never change.

/// A value per corner of a mesh, shared where it is equal.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Attribute<T> {
    /// The distinct values, in file order.
    pub values: Vec<T>,
    /// Which value each corner has; `None` when the corner's position index also selects the value.
    pub index: Option<Vec<u32>>,
}

impl<T: Copy> Attribute<T> {
    /// One value per position.
    pub fn per_position(values: Vec<T>) -> Self {
        Attribute { values, index: None }
    }
    /// The index of the value that a corner of `mesh` has.
    #[inline(always)]
    pub fn index_at(&self, mesh: &Mesh, corner: usize) -> usize {
        match &self.index {
            Some(index) => index[corner] as usize,
            None => mesh.corners[corner] as usize,
        }
    }
    /// The value that a corner of `mesh` has.
    #[inline(always)]
    pub fn at(&self, mesh: &Mesh, corner: usize) -> T {
        self.values[self.index_at(mesh, corner)]
    }
}

/// Faces that are not all triangles.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Polygons {
    /// Where each face begins in `corners`, and one past the end.
    pub starts: Vec<u32>,
    /// The triangulation: three corners each, face after face.
    pub triangles: Vec<[u32; 3]>,
    /// The face that each triangle belongs to.
    pub face_of: Vec<u32>,
}

/// A mesh. Loaders hold these for every mesh that leaves them: each index is in range, each position is
/// finite, `corners` has three entries per face when `polygons` is `None`.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Mesh {
    /// Its name in the file, or empty.
    pub name: String,
    /// Positions in metres (the file's units), right-handed, +Y up. In file order, never merged.
    pub positions: Vec<[f32; 3]>,
    /// The position of each corner, face after face, counter-clockwise from the front.
    pub corners: Vec<u32>,
    /// The faces, when they are not all triangles.
    pub polygons: Option<Polygons>,
    /// Shading normals as the file gives them (not always of unit length).
    pub normals: Option<Attribute<[f32; 3]>>,
    /// Texture coordinates, two sets; v runs down the image.
    pub uv: [Option<Attribute<[f32; 2]>>; 2],
    /// Linear colour and alpha.
    pub colors: Option<Attribute<[f32; 4]>>,
    /// Tangent and, in the fourth number, the sign of the bitangent `cross(n, t) * w`.
    pub tangents: Option<Attribute<[f32; 4]>>,
    /// The material slot of each face; empty when all have slot 0.
    pub materials: Vec<u32>,
}

/// Smallest and largest coordinates.
pub type Bounds = ([f32; 3], [f32; 3]);

impl Mesh {
    /// Number of faces.
    pub fn face_count(&self) -> usize {
        self.polygons.as_ref().map_or(self.corners.len() / 3, |p| p.starts.len() - 1)
    }
    /// Number of triangles.
    pub fn triangle_count(&self) -> usize {
        self.polygons.as_ref().map_or(self.corners.len() / 3, |p| p.triangles.len())
    }
    /// The corners of a triangle.
    #[inline(always)]
    pub fn triangle(&self, t: usize) -> [usize; 3] {
        match &self.polygons {
            Some(p) => p.triangles[t].map(|c| c as usize),
            None => [3 * t, 3 * t + 1, 3 * t + 2],
        }
    }
    /// The face that a triangle belongs to.
    #[inline(always)]
    pub fn face_of(&self, t: usize) -> usize {
        self.polygons.as_ref().map_or(t, |p| p.face_of[t] as usize)
    }
    /// The material slot of a triangle.
    #[inline(always)]
    pub fn material_of(&self, t: usize) -> usize {
        if self.materials.is_empty() { 0 } else { self.materials[self.face_of(t)] as usize }
    }
    /// The position of a corner.
    #[inline(always)]
    pub fn position(&self, corner: usize) -> [f32; 3] {
        self.positions[self.corners[corner] as usize]
    }
    /// Smallest and largest coordinates of the positions that a face uses; `None` without faces.
    pub fn bounds(&self) -> Option<Bounds> {
        let mut used = vec![false; self.positions.len()];
        for &c in &self.corners {
            used[c as usize] = true;
        }
        let mut lo = [f32::INFINITY; 3];
        let mut hi = [f32::NEG_INFINITY; 3];
        for (p, _) in self.positions.iter().zip(used).filter(|(_, used)| *used) {
            for k in 0..3 {
                lo[k] = lo[k].min(p[k]);
                hi[k] = hi[k].max(p[k]);
            }
        }
        (!self.corners.is_empty()).then_some((lo, hi))
    }
    /// Bytes of positions, indices and attributes.
    pub fn bytes(&self) -> u64 {
        fn attribute<T>(a: &Option<Attribute<T>>) -> usize {
            a.as_ref().map_or(0, |a| size_of_val(&a.values[..]) + a.index.as_ref().map_or(0, |i| size_of_val(&i[..])))
        }
        let polygons = self
            .polygons
            .as_ref()
            .map_or(0, |p| size_of_val(&p.starts[..]) + size_of_val(&p.triangles[..]) + size_of_val(&p.face_of[..]));
        (size_of_val(&self.positions[..])
            + size_of_val(&self.corners[..])
            + size_of_val(&self.materials[..])
            + polygons
            + attribute(&self.normals)
            + attribute(&self.uv[0])
            + attribute(&self.uv[1])
            + attribute(&self.colors)
            + attribute(&self.tangents)) as u64
    }
}
