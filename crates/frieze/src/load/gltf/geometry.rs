//! Primitives become meshes. Primitives of one mesh that share their vertices share a mesh here too, with one
//! material slot each; primitives that are equal in all but material are read once.

use super::accessor::{Data, item};
use super::node::Placed;
use crate::error::{Error, Finding, Result};
use crate::load::{Context, Findings};
use crate::mesh::{Attribute, Mesh, topology};
use crate::scene::{Object, Scene};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Most objects of a scene; a small file can ask for (nodes x primitives) of them.
const MOST_OBJECTS: u64 = 1 << 22;

/// How many times its bytes a file may grow by sharing one accessor between meshes.
const MOST_GROWTH: u64 = 64;

type Attributes = BTreeMap<String, u32>;

/// Triangles of one material.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Part {
    indices: Option<u32>,
    mode: u32,
}

/// Primitives that share their vertices.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Group {
    attributes: Attributes,
    parts: Vec<Part>,
}

/// A group with the materials that one mesh of the document gives its parts.
struct Use {
    group: usize,
    materials: Vec<Option<u32>>,
}

/// Which meshes are to be made.
pub struct Plan {
    groups: Vec<Group>,
    /// Name and place in the document of the first use of each group.
    first: Vec<(String, String)>,
    /// Per mesh of the document.
    uses: Vec<Vec<Use>>,
    /// Position accessors that more than one group has.
    shared: BTreeSet<u32>,
    default_material: u32,
}

impl Plan {
    /// Groups the primitives of the meshes that are shown.
    pub fn new(data: &Data<'_>, layout: &[Placed], findings: &mut Findings) -> Result<Plan> {
        let document = data.document;
        let mut shown = vec![false; document.meshes.len()];
        layout.iter().for_each(|p| shown[p.mesh as usize] = true);
        let mut known: BTreeMap<Group, usize> = BTreeMap::new();
        let (mut groups, mut first, mut uses) = (Vec::new(), Vec::new(), Vec::new());
        for (m, mesh) in document.meshes.iter().enumerate() {
            let mut of_mesh: Vec<(Group, Vec<Option<u32>>, usize)> = Vec::new();
            for (p, primitive) in mesh.primitives.iter().enumerate().filter(|_| shown[m]) {
                let place = || format!("/meshes/{m}/primitives/{p}");
                let skip = |code, message: String| Finding::warning(code, message, "it was left out").at(place());
                if !primitive.targets.is_empty() {
                    let message = "the primitive has morph targets";
                    let action = "the shape without them is shown";
                    findings.push(Finding::note("gltf.morph-ignored", message, action).at(place()));
                }
                if primitive.mode < 4 {
                    findings.push(skip("gltf.mode-ignored", "points and lines are not rendered".into()));
                    continue;
                }
                if primitive.mode > 6 {
                    findings.push(skip("gltf.mode-ignored", format!("there is no mode {}", primitive.mode)));
                    continue;
                }
                if !primitive.attributes.contains_key("POSITION") {
                    findings.push(skip("gltf.no-position", "the primitive has no positions".into()));
                    continue;
                }
                if let Some(material) = primitive.material {
                    item(&document.materials, "materials", material).map_err(|e| e.at(place()))?;
                }
                let part = Part { indices: primitive.indices, mode: primitive.mode };
                match of_mesh.last_mut() {
                    Some((group, materials, _)) if group.attributes == primitive.attributes => {
                        group.parts.push(part);
                        materials.push(primitive.material);
                    }
                    _ => {
                        let group = Group { attributes: primitive.attributes.clone(), parts: vec![part] };
                        of_mesh.push((group, vec![primitive.material], p));
                    }
                }
            }
            let name = mesh.name.as_deref().unwrap_or_default();
            uses.push(
                of_mesh
                    .into_iter()
                    .map(|(group, materials, p)| {
                        let group = *known.entry(group).or_insert_with_key(|group| {
                            groups.push(group.clone());
                            first.push((name.to_owned(), format!("/meshes/{m}/primitives/{p}")));
                            groups.len() - 1
                        });
                        Use { group, materials }
                    })
                    .collect(),
            );
        }
        let (mut once, mut shared) = (BTreeSet::new(), BTreeSet::new());
        for group in &groups {
            let position = group.attributes["POSITION"];
            if !once.insert(position) {
                shared.insert(position);
            }
        }
        let default_material = document.materials.len() as u32;
        Ok(Plan { groups, first, uses, shared, default_material })
    }

    /// The materials that shown primitives use, by index; one past the last is glTF's default material.
    pub fn materials(&self) -> BTreeSet<u32> {
        let used = self.uses.iter().flatten().flat_map(|u| &u.materials);
        used.map(|m| m.unwrap_or(self.default_material)).collect()
    }

    /// Whether textures can ask for a UV set that the document has nowhere.
    pub fn has_uv(&self, set: u32) -> bool {
        let name = format!("TEXCOORD_{set}");
        self.groups.iter().any(|g| g.attributes.contains_key(&name))
    }

    /// Reads all meshes, in parallel, in the document's order.
    pub fn read(&self, data: &Data<'_>) -> Result<(Vec<Mesh>, Vec<Finding>)> {
        let held: u64 = data.buffers.iter().map(|b| b.len()).sum();
        let growth =
            Growth { most: held.saturating_mul(MOST_GROWTH).saturating_add(1 << 26), used: Default::default() };
        let read = |(group, (name, place)): (&Group, &(String, String))| {
            let mut findings = Vec::new();
            let mesh = self.mesh(data, group, name, &growth, &mut findings).map_err(|e| e.at(place))?;
            Ok((mesh, findings.into_iter().map(|f: Finding| f.at(place)).collect::<Vec<_>>()))
        };
        let all: Vec<Result<(Mesh, Vec<Finding>)>> = self.groups.par_iter().zip(&self.first).map(read).collect();
        let (mut meshes, mut findings) = (Vec::with_capacity(all.len()), Vec::new());
        for one in all {
            let (mesh, of_mesh) = one?;
            meshes.push(mesh);
            findings.extend(of_mesh);
        }
        Ok((meshes, findings))
    }

    fn mesh(
        &self,
        data: &Data<'_>,
        group: &Group,
        name: &str,
        growth: &Growth,
        findings: &mut Vec<Finding>,
    ) -> Result<Mesh> {
        let context = data.context;
        context.job.check()?;
        let position = group.attributes["POSITION"];
        let count = data.count(position, 3)?;
        if count > u64::from(u32::MAX) {
            return Err(Error::input("gltf.too-many-vertices", format!("{count} vertices; 2^32 - 1 are possible")));
        }
        let mut mesh = Mesh { name: name.to_owned(), ..Mesh::default() };
        let mut used: Option<(u32, u32)> = None;
        for (slot, part) in (0u32..).zip(&group.parts) {
            let corners = corners(data, part, count, growth, &mut used, findings)?;
            if mesh.corners.len() as u64 + corners.len() as u64 > u64::from(u32::MAX) {
                return Err(Error::input("gltf.too-many-vertices", "the mesh has over 2^32 - 1 corners"));
            }
            if group.parts.len() > 1 {
                context.reserve(corners.len() as u64 / 3 * 4, "material slots")?;
                mesh.materials.resize(mesh.materials.len() + corners.len() / 3, slot);
            }
            if mesh.corners.is_empty() {
                mesh.corners = corners;
            } else {
                context.reserve(4 * corners.len() as u64, "vertex indices")?;
                mesh.corners.extend_from_slice(&corners);
            }
        }
        // Many meshes may share one long list of vertices: each takes the part that it uses.
        let mut range = 0..count;
        if self.shared.contains(&position) {
            range = used.map_or(0..0, |(lo, hi)| u64::from(lo)..u64::from(hi) + 1);
            let first = range.start as u32;
            if first > 0 {
                mesh.corners.par_iter_mut().for_each(|c| *c -= first);
            }
        }
        let mut vertices = Vertices { data, group, range, count, growth, findings };
        let (positions, bad) = vertices.read::<3>("POSITION")?.unwrap_or_default();
        if let Some(bad) = bad {
            let vertex = vertices.range.start + bad as u64;
            return Err(Error::input("mesh.not-finite", format!("the position of vertex {vertex} is not finite"))
                .at(format!("/accessors/{position}"))
                .remedy("the model is broken there; remove or move the vertex"));
        }
        mesh.positions = positions;
        mesh.normals = vertices.attribute::<3>("NORMAL")?;
        mesh.tangents = match mesh.normals {
            Some(_) => vertices.attribute::<4>("TANGENT")?,
            None => None,
        };
        if mesh.normals.is_none() {
            context.reserve(4 * mesh.triangle_count() as u64 * 6, "normals")?;
            mesh.normals = Some(topology::flat_normals(&mesh));
        }
        mesh.uv = [vertices.attribute::<2>("TEXCOORD_0")?, vertices.attribute::<2>("TEXCOORD_1")?];
        mesh.colors = vertices.colors()?;
        Ok(mesh)
    }

    /// Adds an object per placed mesh and group, with materials by the document's index.
    pub fn place(&self, layout: &[Placed], scene: &mut Scene, context: &Context<'_>, nodes: &Names<'_>) -> Result<()> {
        let of = |p: &Placed| self.uses[p.mesh as usize].len() as u64;
        let slots: u64 =
            layout.iter().flat_map(|p| &self.uses[p.mesh as usize]).map(|u| u.materials.len() as u64).sum();
        let count: u64 = layout.iter().map(of).sum();
        if count.max(slots) > MOST_OBJECTS {
            let message = format!("the nodes show {} primitives; {MOST_OBJECTS} are possible", count.max(slots));
            return Err(Error::input("gltf.too-many-objects", message).at("/nodes"));
        }
        context.reserve(count * size_of::<Object>() as u64 + slots * 8, "objects")?;
        for placed in layout {
            for each in &self.uses[placed.mesh as usize] {
                let node = nodes(placed.node);
                let name = if node.is_empty() { scene.meshes[each.group].name.clone() } else { node.to_owned() };
                let material = |m: &Option<u32>| m.unwrap_or(self.default_material) as usize;
                let materials =
                    if scene.materials.is_empty() { Vec::new() } else { each.materials.iter().map(material).collect() };
                scene.objects.push(Object { name, mesh: each.group, transform: placed.transform, materials });
            }
        }
        Ok(())
    }
}

/// The name of a node.
pub type Names<'a> = dyn Fn(u32) -> &'a str + 'a;

/// What all meshes together have taken.
struct Growth {
    most: u64,
    used: std::sync::atomic::AtomicU64,
}

impl Growth {
    fn add(&self, bytes: u64) -> Result<()> {
        let before = self.used.fetch_add(bytes, std::sync::atomic::Ordering::Relaxed);
        if before.saturating_add(bytes) <= self.most {
            return Ok(());
        }
        Err(Error::input("gltf.growth", "meshes share their data so often that they would grow without measure")
            .remedy("export the model with one accessor per mesh"))
    }
}

/// The corners of a part, three per triangle.
fn corners(
    data: &Data<'_>,
    part: &Part,
    vertices: u64,
    growth: &Growth,
    used: &mut Option<(u32, u32)>,
    findings: &mut Vec<Finding>,
) -> Result<Vec<u32>> {
    let context = data.context;
    let list = match part.indices {
        Some(index) => {
            growth.add(4 * data.count(index, 1)?)?;
            let (list, ends) = data.indices(index)?;
            if let Some((lo, hi)) = ends {
                if u64::from(hi) >= vertices {
                    let at = list.iter().position(|&i| u64::from(i) >= vertices).unwrap_or_default();
                    let message = format!("index {at} is {}, but there are {vertices} vertices", list[at]);
                    return Err(Error::input("gltf.index-out-of-range", message).at(format!("/accessors/{index}")));
                }
                *used = Some(used.map_or((lo, hi), |u| (u.0.min(lo), u.1.max(hi))));
            }
            list
        }
        None => {
            growth.add(4 * vertices)?;
            context.reserve(4 * vertices, "vertex indices")?;
            if let Some(last) = (vertices as u32).checked_sub(1) {
                *used = Some((0, last));
            }
            (0..vertices as u32).collect()
        }
    };
    if part.mode == 4 {
        let mut list = list;
        let over = list.len() % 3;
        if over > 0 {
            let message = format!("{} indices do not make whole triangles", list.len());
            findings.push(Finding::warning("gltf.index-count", message, format!("the last {over} were left out")));
            list.truncate(list.len() - over);
        }
        return Ok(list);
    }
    let triangles = list.len().saturating_sub(2);
    growth.add(12 * triangles as u64)?;
    context.reserve(12 * triangles as u64, "vertex indices")?;
    let mut corners = Vec::with_capacity(3 * triangles);
    for k in 0..triangles {
        corners.extend(match part.mode {
            5 => [list[k], list[k + 1 + k % 2], list[k + 2 - k % 2]],
            _ => [list[k + 1], list[k + 2], list[0]],
        });
    }
    Ok(corners)
}

/// The vertices of a group.
struct Vertices<'a> {
    data: &'a Data<'a>,
    group: &'a Group,
    range: Range<u64>,
    count: u64,
    growth: &'a Growth,
    findings: &'a mut Vec<Finding>,
}

impl Vertices<'_> {
    fn read<const N: usize>(&mut self, name: &str) -> Result<Option<(Vec<[f32; N]>, Option<usize>)>>
    where
        [f32; N]: bytemuck::Pod,
    {
        let Some(&accessor) = self.group.attributes.get(name) else { return Ok(None) };
        let count = self.data.count(accessor, N)?;
        if count != self.count {
            let message = format!("{name} has {count} elements, POSITION has {}", self.count);
            return Err(Error::input("gltf.attribute-count", message).at(format!("/accessors/{accessor}")));
        }
        self.growth.add((self.range.end - self.range.start) * 4 * N as u64)?;
        self.data.floats::<N>(accessor, self.range.clone()).map(Some)
    }
    fn attribute<const N: usize>(&mut self, name: &str) -> Result<Option<Attribute<[f32; N]>>>
    where
        [f32; N]: bytemuck::Pod,
    {
        let Some((mut values, bad)) = self.read::<N>(name)? else { return Ok(None) };
        if let Some(bad) = bad {
            values[bad..].iter_mut().flatten().filter(|v| !v.is_finite()).for_each(|v| *v = 0.0);
            self.findings.push(Finding::warning(
                "mesh.attribute-not-finite",
                format!("{name} of vertex {} is not finite", self.range.start + bad as u64),
                "such numbers were taken for 0",
            ));
        }
        Ok(Some(Attribute::per_position(values)))
    }
    /// COLOR_0: linear RGB or RGBA.
    fn colors(&mut self) -> Result<Option<Attribute<[f32; 4]>>> {
        let Some(&accessor) = self.group.attributes.get("COLOR_0") else { return Ok(None) };
        let rgb = self.data.document.accessors.get(accessor as usize).is_some_and(|a| a.kind == "VEC3");
        if !rgb {
            return self.attribute::<4>("COLOR_0");
        }
        let Some(rgb) = self.attribute::<3>("COLOR_0")? else { return Ok(None) };
        self.data.context.reserve(16 * rgb.values.len() as u64, "vertex colours")?;
        Ok(Some(Attribute::per_position(rgb.values.iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect())))
    }
}
