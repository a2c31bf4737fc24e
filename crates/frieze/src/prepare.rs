//! `Scene -> Prepared`: meshlets, instances, tangents, mip levels. `Prepared -> View`: one camera's transforms.

use crate::error::{Error, Finding, Result};
use crate::image::pyramid::{Pyramid, Rule};
use crate::image::{Encoding, Image};
use crate::job::{Job, Reservation};
use crate::map::{Filter, Map};
use crate::math::vec::{Mat4, Vec3};
use crate::mesh::meshlet::{Meshlets, Sources};
use crate::mesh::topology::{self, Weight};
use crate::mesh::{Attribute, Mesh, tangent};
use crate::raster::{MAX_SIZE, Target};
use crate::scene::camera::Lens;
use crate::scene::{
    Ambient, Camera, Light, Material, NormalSpace, Normals, Output, Scene, TangentFrame, Texture, View as Choice,
};
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::Arc;

/// A scene made ready for any number of frames. Whatever depends on a camera, a light or a transform is not in
/// here.
#[derive(Debug)]
pub struct Prepared {
    /// The cooked meshes.
    pub meshes: Vec<Meshlets>,
    /// What stands where.
    pub instances: Vec<Instance>,
    /// The materials; the last is the default one.
    pub materials: Vec<Material>,
    /// The lights.
    pub lights: Vec<Light>,
    /// Light from everywhere.
    pub ambient: Ambient,
    /// How the picture is made of light.
    pub output: Output,
    /// The scene's camera; `None`: fitted.
    pub camera: Option<Camera>,
    /// World bounds; `None` for an empty scene.
    pub bounds: Option<(Vec3, Vec3)>,
    /// What is odd about how meshes, transforms and normal maps fit together.
    pub findings: Vec<Finding>,
    pyramids: Vec<(Key, Arc<Pyramid>)>,
    encodings: Vec<Encoding>,
    _held: Reservation,
}

/// A placed mesh.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Index of the object in the scene.
    pub object: usize,
    /// Index into [`Prepared::meshes`].
    pub mesh: usize,
    /// Object to world.
    pub transform: Mat4,
    /// For normals; scaled so that unit normals stay of unit length when the transform is a similarity.
    pub normals: Mat4,
    /// For tangents; scaled likewise.
    pub tangents: Mat4,
    /// Whether angles are kept: unit vectors stay of one length.
    pub similarity: bool,
    /// Whether the transform mirrors.
    pub mirrored: bool,
    /// The material of each slot, indices into [`Prepared::materials`]; never empty.
    pub materials: Vec<usize>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Key {
    image: usize,
    rule: Rule,
}

fn key(scene_encoding: Encoding, texture: &Texture, color: bool) -> Key {
    Key {
        image: texture.image,
        rule: Rule {
            srgb: texture.srgb.unwrap_or(color && scene_encoding == Encoding::Srgb),
            weigh_by_alpha: color,
            ripmap: texture.filter == Filter::Ripmap,
        },
    }
}

/// What the vertices of a mesh are cooked from: meshes that are shown in several ways are cooked for each.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Recipe {
    mesh: usize,
    normals: Normals,
    tangents: Option<(TangentFrame, usize)>,
}

/// What is to be cooked beside what shading reads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Needs {
    /// Tangents of every mesh, even where no normal map reads them: for overlays.
    pub tangents: bool,
}

impl Prepared {
    /// [`Prepared::with`] what shading reads.
    ///
    /// # Errors
    /// `job.memory` over the budget, `job.interrupted` when cancelled, `scene.index` for an index that leads
    /// nowhere.
    pub fn new(scene: &Scene, job: &Job) -> Result<Self> {
        Self::cook(scene, Cow::Borrowed(&scene.images), &Needs::default(), job)
    }

    /// As [`Prepared::new`], with what more is needed.
    ///
    /// # Errors
    /// As [`Prepared::new`].
    pub fn with(scene: &Scene, needs: &Needs, job: &Job) -> Result<Self> {
        Self::cook(scene, Cow::Borrowed(&scene.images), needs, job)
    }

    /// As [`Prepared::with`], for a scene that is needed no longer: its images are dropped as soon as their mip levels
    /// are made, so that they don't stand beside the cooked meshes.
    ///
    /// # Errors
    /// Those of [`Prepared::new`].
    pub fn consume(mut scene: Scene, needs: &Needs, job: &Job) -> Result<Self> {
        let images = std::mem::take(&mut scene.images);
        Self::cook(&scene, Cow::Owned(images), needs, job)
    }

    fn cook(scene: &Scene, images: Cow<'_, [Arc<Image>]>, needs: &Needs, job: &Job) -> Result<Self> {
        check(scene, images.len())?;
        job.progress("prepare", 0, 1);
        let mut materials = scene.materials.clone();
        materials.push(Material { albedo: [0.8; 3], double_sided: true, ..Material::default() });
        let mut recipes: Vec<Recipe> = Vec::new();
        let mut instances = Vec::new();
        let mut used = vec![false; materials.len()];
        for (number, object) in scene.objects.iter().enumerate() {
            let slots = if object.materials.is_empty() { vec![materials.len() - 1] } else { object.materials.clone() };
            slots.iter().for_each(|&m| used[m] = true);
            let all = slots.iter().map(|&m| &materials[m]);
            let tilted = all.clone().find(|m| m.needs_tangent()).or(all.clone().next().filter(|_| needs.tangents));
            let recipe = Recipe {
                mesh: object.mesh,
                normals: materials[slots[0]].normals,
                tangents: tilted
                    .map(|m| (m.tangent_frame, m.normal_map.as_ref().map_or(0, |n| usize::from(n.texture.uv.min(1))))),
            };
            let mesh = recipes.iter().position(|r| *r == recipe).unwrap_or_else(|| {
                recipes.push(recipe);
                recipes.len() - 1
            });
            instances.push(Instance::new(number, mesh, object.transform, slots));
        }
        let mut keys: Vec<Key> = Vec::new();
        for (material, _) in materials.iter().zip(&used).filter(|(_, used)| **used) {
            for (texture, color) in material.textures() {
                let key = key(images[texture.image].encoding, texture, color);
                if !keys.contains(&key) {
                    keys.push(key);
                }
            }
        }
        let geometry: u64 = recipes.iter().map(|r| cooked_bytes(&scene.meshes[r.mesh])).sum();
        let texels: u64 = keys.iter().map(|k| Pyramid::bytes_for(&images[k.image], k.rule)).sum();
        let held = job.reserve(geometry + texels, "the scene's geometry and textures")?;
        let encodings = images.iter().map(|i| i.encoding).collect();
        let (pyramids, (meshes, without_area)) = job.run(|| {
            rayon::join(
                move || {
                    let make = |k: &Key| (*k, Arc::new(Pyramid::with(&images[k.image], k.rule)));
                    keys.par_iter().map(make).collect::<Vec<_>>()
                },
                || recipes.par_iter().map(|r| cook(&scene.meshes[r.mesh], r)).collect::<(Vec<Meshlets>, Vec<_>)>(),
            )
        });
        job.check()?;
        job.progress("prepare", 1, 1);
        let cooked = |mesh| recipes.iter().position(|r| r.mesh == mesh).and_then(|k| meshes[k].bounds);
        let bounds = scene.bounds_of(cooked);
        let mut findings = misfits(scene, &instances, &materials);
        for (recipe, count) in recipes.iter().zip(without_area).filter(|(_, count)| *count > 0) {
            let (mesh, set) = (&scene.meshes[recipe.mesh], recipe.tangents.map_or(0, |t| t.1));
            findings.push(Finding::note(
                "tangent.no-uv-area",
                format!(
                    "{count} of {} triangles of {} have no area in UV set {set}",
                    mesh.triangle_count(),
                    mesh_name(scene, recipe.mesh)
                ),
                "normal maps have no direction there; tangents are made from the normals. Unwrap these triangles",
            ));
        }
        Ok(Prepared {
            meshes,
            findings,
            instances,
            materials,
            lights: scene.lights.clone(),
            ambient: scene.ambient,
            output: scene.output,
            camera: match scene.view {
                Choice::Auto => None,
                Choice::Camera(k) => Some(scene.cameras[k].clone()),
            },
            bounds,
            pyramids,
            encodings,
            _held: held,
        })
    }

    /// The map of a texture that some material of the scene has. `color`: whether the slot holds colour.
    pub fn map(&self, texture: &Texture, color: bool) -> Map {
        let key = key(self.encodings[texture.image], texture, color);
        let found = self.pyramids.iter().find(|(k, _)| *k == key).expect("every texture of a used material was cooked");
        Map { pyramid: Arc::clone(&found.1), filter: texture.filter, wrap: texture.wrap }
    }

    /// The camera for a picture of this shape: `asked`, or the scene's, or a fitted one.
    pub fn camera(&self, asked: Option<&Camera>, aspect: f32) -> Camera {
        asked.or(self.camera.as_ref()).cloned().unwrap_or_else(|| {
            let unit = (Vec3::splat(-1.0), Vec3::splat(1.0));
            Camera::fit(self.bounds.unwrap_or(unit), aspect)
        })
    }

    /// Corners of the world bounds.
    pub fn corners(&self) -> Vec<Vec3> {
        let Some((lo, hi)) = self.bounds else { return Vec::new() };
        (0..8)
            .map(|k| {
                let pick = |bit: usize, lo: f32, hi: f32| if k >> bit & 1 == 0 { lo } else { hi };
                Vec3::new(pick(0, lo.x, hi.x), pick(1, lo.y, hi.y), pick(2, lo.z, hi.z))
            })
            .collect()
    }
}

fn mesh_name(scene: &Scene, k: usize) -> String {
    match &scene.meshes[k].name[..] {
        "" => format!("mesh {k}"),
        name => format!("mesh `{}`", name.chars().take(60).collect::<String>()),
    }
}

/// Normal maps that do not fit the mesh or the transform of an object; each pair of mesh and material once.
fn misfits(scene: &Scene, instances: &[Instance], materials: &[Material]) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut seen: Vec<(usize, usize, bool)> = Vec::new();
    for instance in instances {
        let mesh = scene.objects[instance.object].mesh;
        for &m in &instance.materials {
            let material = &materials[m];
            let Some(map) = &material.normal_map else { continue };
            let turned = (0..3).any(|c| {
                let axis = instance.transform.column(c).xyz().normalize();
                (0..3).any(|r| (axis.array()[r] - f32::from(u8::from(r == c))).abs() > 1e-4)
            });
            let world = material.normal_space == NormalSpace::World && turned;
            let key = (mesh, m, world);
            if seen.contains(&key) {
                continue;
            }
            seen.push(key);
            let named = match &material.name[..] {
                "" => format!("material {m}"),
                name => format!("material `{}`", name.chars().take(60).collect::<String>()),
            };
            if world {
                // Row 51.
                findings.push(Finding::warning(
                    "normal.world-space-turned",
                    format!("the normal map of {named} holds world-space normals, but {} is turned", mesh_name(scene, mesh)),
                    "it is drawn as the map says, which is wrong unless the map was made for this place; use a tangent-space map",
                ));
            }
            let set = usize::from(map.texture.uv.min(1));
            if scene.meshes[mesh].uv[set].is_none() && material.needs_tangent() {
                findings.push(Finding::warning(
                    "tangent.no-uv",
                    format!("the normal map of {named} needs UV set {set}, which {} has not", mesh_name(scene, mesh)),
                    "one texel of it is shown everywhere, about axes made from the normals; unwrap the mesh",
                ));
            }
        }
    }
    findings
}

/// Every index of the scene leads somewhere.
fn check(scene: &Scene, images: usize) -> Result<()> {
    let wrong =
        |what: &str, k: usize| Err(Error::arguments("scene.index", format!("there is no {what} {k} in the scene")));
    for object in &scene.objects {
        if object.mesh >= scene.meshes.len() {
            return wrong("mesh", object.mesh);
        }
        if let Some(&m) = object.materials.iter().find(|&&m| m >= scene.materials.len()) {
            return wrong("material", m);
        }
    }
    for material in &scene.materials {
        if let Some((t, _)) = material.textures().find(|(t, _)| t.image >= images) {
            return wrong("image", t.image);
        }
    }
    match scene.view {
        Choice::Camera(k) if k >= scene.cameras.len() => wrong("camera", k),
        _ => Ok(()),
    }
}

/// Bytes of a cooked mesh and of its sort keys, at most: clusters share few vertices of a mesh that shares many.
fn cooked_bytes(mesh: &Mesh) -> u64 {
    let triangles = mesh.triangle_count() as u64;
    // Attributes with an index of their own may part every corner.
    let own = |index: Option<bool>| index.unwrap_or(false);
    let apart = mesh.normals.as_ref().is_none_or(|a| a.index.is_some())
        || own(mesh.tangents.as_ref().map(|a| a.index.is_some()))
        || own(mesh.colors.as_ref().map(|a| a.index.is_some()))
        || mesh.uv.iter().flatten().any(|a| a.index.is_some());
    let most = if apart { 3 * triangles } else { (3 * triangles).min(2 * mesh.positions.len() as u64) };
    let vertex = 44 + if mesh.uv[1].is_some() { 8 } else { 0 } + if mesh.colors.is_some() { 16 } else { 0 };
    most * vertex + triangles * 20
}

/// The clusters of a mesh, and how many of its triangles have no area in the UV set that its tangents are made from.
fn cook(mesh: &Mesh, recipe: &Recipe) -> (Meshlets, usize) {
    let weigh = |weight| Some(topology::vertex_normals(mesh, weight));
    let made: Option<Attribute<[f32; 3]>> = match recipe.normals {
        Normals::File if mesh.normals.is_some() => None,
        Normals::File => Some(topology::creased_normals(mesh)),
        Normals::Angle => weigh(Weight::Angle),
        Normals::Area => weigh(Weight::Area),
        Normals::Uniform => weigh(Weight::Uniform),
    };
    let normals = made.as_ref().or(mesh.normals.as_ref());
    let mut without_area = 0;
    let mut solved = |uv| without_area = tangent::without_area(mesh, uv);
    let tangents = match (recipe.tangents, normals) {
        (Some((frame, set)), Some(normals)) => match (frame, mesh.uv[set].as_ref()) {
            (TangentFrame::Mikktspace, _) if mesh.tangents.is_some() && made.is_none() => {
                mesh.tangents.as_ref().map(Cow::Borrowed)
            }
            (TangentFrame::Mikktspace, Some(uv)) => {
                solved(uv);
                Some(Cow::Owned(tangent::mikktspace(mesh, normals, uv)))
            }
            (TangentFrame::Average, Some(uv)) => {
                solved(uv);
                Some(Cow::Owned(tangent::average(mesh, normals, uv)))
            }
            (TangentFrame::PerTriangle, Some(uv)) => {
                solved(uv);
                Some(Cow::Owned(tangent::per_triangle(mesh, normals, uv)))
            }
            _ => Some(Cow::Owned(tangent::from_normal(mesh, normals))),
        },
        _ => None,
    };
    let clusters = Meshlets::new(
        mesh,
        &Sources {
            normals,
            tangents: tangents.as_deref(),
            uv: [mesh.uv[0].as_ref(), mesh.uv[1].as_ref()],
            colors: mesh.colors.as_ref(),
        },
    );
    (clusters, without_area)
}

impl Instance {
    fn new(object: usize, mesh: usize, transform: Mat4, materials: Vec<usize>) -> Self {
        let axes = [0, 1, 2].map(|c| transform.column(c).xyz());
        let length = axes.map(|a| a.length());
        let s = (length[0] + length[1] + length[2]) / 3.0;
        let close = |a: f32, b: f32| (a - b).abs() <= 1e-5 * s;
        let square = |a: Vec3, b: Vec3| a.dot(b).abs() <= 1e-5 * s * s;
        let similarity = length.iter().all(|&l| close(l, s))
            && square(axes[0], axes[1])
            && square(axes[1], axes[2])
            && square(axes[2], axes[0]);
        let scaled = |m: Mat4, f: f32| Mat4(m.0.map(|c| c.map(|v| v * f)));
        let f = if similarity && s > 0.0 { 1.0 / s } else { 1.0 };
        Instance {
            object,
            mesh,
            transform,
            normals: scaled(transform.normal_matrix(), f * f),
            tangents: scaled(transform, f),
            similarity,
            mirrored: transform.determinant3() < 0.0,
            materials,
        }
    }
}

/// One camera's transforms.
#[derive(Clone, Debug)]
pub struct View {
    /// What the rasteriser needs.
    pub target: Target,
    /// The eye, world space.
    pub eye: Vec3,
    /// Unit axes of the camera in world space: right, up, forward.
    pub axes: [Vec3; 3],
    /// The projection.
    pub lens: Lens,
    /// World to camera, directions.
    pub turn: Mat4,
}

/// Fits a camera to a picture of `width` x `height` pixels with `samples` samples each.
///
/// # Errors
/// `render.size` for a picture that is empty or too large, `render.camera` for a camera that sees nothing.
pub fn view(prepared: &Prepared, camera: &Camera, width: u32, height: u32, samples: u32) -> Result<View> {
    if width == 0 || height == 0 || width > MAX_SIZE || height > MAX_SIZE {
        return Err(Error::arguments("render.size", format!("{width}x{height} pixels are not possible"))
            .remedy(format!("each side (times the supersampling) may have 1 to {MAX_SIZE} pixels")));
    }
    let bad = |what: &str| Err(Error::arguments("render.camera", format!("the camera {what}")));
    let unit = |c: usize| camera.transform.column(c).xyz().normalize();
    let (right, up, back) = (unit(0), unit(1), unit(2));
    let eye = camera.eye();
    if ![right, up, back, eye].iter().all(|v| v.is_finite()) || right.cross(up).dot(back) < 0.5 {
        return bad("has no proper position and axes");
    }
    let mut lens = camera.lens(width, height);
    if lens.parallel && !lens.far.is_finite() {
        // Parallel depth needs an end: the farthest corner of the scene.
        let depth = |p: Vec3| f64::from((eye - p).dot(back));
        let farthest = prepared.corners().into_iter().map(depth).fold(lens.near, f64::max);
        lens.far = farthest + (farthest - lens.near).abs() * 0.01 + 1e-3;
    }
    let sane = lens.a.iter().chain(&lens.b).all(|v| v.is_finite()) && lens.a.iter().all(|v| *v != 0.0);
    if !(sane && lens.near.is_finite() && lens.far > lens.near) || (!lens.parallel && lens.near <= 0.0) {
        return bad("has no proper projection: 0 < fov < 180 and 0 < near < far");
    }
    let matrix = world_to_picture(&lens, eye, [right, up, back]);
    let turn = Mat4::from_axes(right, up, back, Vec3::splat(0.0)).transpose();
    let target = Target { width, height, samples, matrix };
    Ok(View { target, eye, axes: [right, up, -back], lens, turn })
}

/// The product of view and projection in f64, rounded once. `axes`: right, up, back.
pub fn world_to_picture(lens: &Lens, eye: Vec3, axes: [Vec3; 3]) -> Mat4 {
    let rows = lens.rows();
    let e = eye.array().map(f64::from);
    let axes = axes.map(|a| a.array().map(f64::from));
    let view: [[f64; 4]; 4] = core::array::from_fn(|r| {
        if r == 3 {
            return [0.0, 0.0, 0.0, 1.0];
        }
        let a = axes[r];
        [a[0], a[1], a[2], -(a[0] * e[0] + a[1] * e[1] + a[2] * e[2])]
    });
    Mat4(core::array::from_fn(|c| {
        core::array::from_fn(|r| {
            let row = rows[r];
            (row[0] * view[0][c] + row[1] * view[1][c] + row[2] * view[2][c] + row[3] * view[3][c]) as f32
        })
    }))
}
