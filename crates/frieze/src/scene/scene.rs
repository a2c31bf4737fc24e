//! The whole scene.

use super::{Camera, Light, Material};
use crate::image::{Encoding, Image};
use crate::math::vec::{Mat4, Vec3};
use crate::mesh::{Bounds, Mesh};
use std::sync::Arc;

/// A placed mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// Its name in the file, or empty.
    pub name: String,
    /// Index into [`Scene::meshes`].
    pub mesh: usize,
    /// Object to world.
    pub transform: Mat4,
    /// The material of each slot of the mesh, indices into [`Scene::materials`]. A slot beyond the end
    /// takes the last; an empty list takes a default material.
    pub materials: Vec<usize>,
}

/// Which camera a scene is seen with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum View {
    /// A camera fitted to the scene's bounds: azimuth 30 degrees, elevation 20 degrees, 35 degrees of view.
    #[default]
    Auto,
    /// Index into [`Scene::cameras`].
    Camera(usize),
}

/// Light from everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ambient {
    /// Linear RGB.
    pub color: [f32; 3],
    /// Whether it is added once for every light (row 13) instead of once.
    pub per_light: bool,
}

/// What is where nothing is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Background {
    /// Linear RGB, not tone mapped.
    Color([f32; 3]),
    /// Alpha 0.
    Transparent,
}

/// How light becomes a displayable number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum ToneMap {
    /// Clamped to 0 ..= 1.
    #[default]
    None,
    /// Hill's fit of ACES.
    Aces,
    /// AgX, base look.
    Agx,
    /// `c / (1 + c)`.
    Reinhard,
    /// Khronos PBR Neutral.
    KhronosNeutral,
}

/// How the picture is made of light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Output {
    /// Pixels: width, height.
    pub size: [u32; 2],
    /// What is where nothing is.
    pub background: Background,
    /// The tone curve of 8- and 16-bit pictures; float pictures hold linear light.
    pub tone_map: ToneMap,
    /// What 8- and 16-bit pictures hold.
    pub encode: Encoding,
    /// Coverage samples per pixel (MSAA): 1, 4, 8 or 16.
    pub samples: u32,
    /// Shaded samples per pixel along each axis.
    pub supersample: u32,
}

impl Default for Output {
    /// The defaults of a scene file.
    fn default() -> Self {
        Output {
            size: [1024, 768],
            background: Background::Color([0.1; 3]),
            tone_map: ToneMap::None,
            encode: Encoding::Srgb,
            samples: 4,
            supersample: 1,
        }
    }
}

/// A scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Its name: the file's stem or the sample's name.
    pub name: String,
    /// The shapes.
    pub meshes: Vec<Mesh>,
    /// The decoded images that materials use.
    pub images: Vec<Arc<Image>>,
    /// The materials.
    pub materials: Vec<Material>,
    /// What stands where.
    pub objects: Vec<Object>,
    /// The lights.
    pub lights: Vec<Light>,
    /// The cameras.
    pub cameras: Vec<Camera>,
    /// The camera that is looked through.
    pub view: View,
    /// Light from everywhere.
    pub ambient: Ambient,
    /// How the picture is made of light.
    pub output: Output,
}

impl Default for Scene {
    fn default() -> Self {
        Scene {
            name: String::new(),
            meshes: Vec::new(),
            images: Vec::new(),
            materials: Vec::new(),
            objects: Vec::new(),
            lights: Vec::new(),
            cameras: Vec::new(),
            view: View::Auto,
            ambient: Ambient { color: [0.2; 3], per_light: false },
            output: Output::default(),
        }
    }
}

impl Scene {
    /// Adds an image and returns its index.
    pub fn add_image(&mut self, image: Image) -> usize {
        self.images.push(Arc::new(image));
        self.images.len() - 1
    }
    /// Adds a material and returns its index.
    pub fn add_material(&mut self, material: Material) -> usize {
        self.materials.push(material);
        self.materials.len() - 1
    }
    /// Adds a mesh with an object that shows it in one material; returns the object's index.
    pub fn add(&mut self, mesh: Mesh, transform: Mat4, material: usize) -> usize {
        self.objects.push(Object {
            name: mesh.name.clone(),
            mesh: self.meshes.len(),
            transform,
            materials: vec![material],
        });
        self.meshes.push(mesh);
        self.objects.len() - 1
    }
    /// Smallest and largest world coordinates of all objects (of their transformed boxes); `None` when empty.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let boxes: Vec<_> = self.meshes.iter().map(Mesh::bounds).collect();
        self.bounds_of(|mesh| boxes[mesh])
    }
    /// [`Self::bounds`] from those of the meshes.
    pub(crate) fn bounds_of(&self, mesh: impl Fn(usize) -> Option<Bounds>) -> Option<(Vec3, Vec3)> {
        let mut all: Option<(Vec3, Vec3)> = None;
        for object in &self.objects {
            let Some((lo, hi)) = mesh(object.mesh) else { continue };
            for k in 0..8 {
                let p: [f32; 3] = core::array::from_fn(|a| if k >> a & 1 == 0 { lo[a] } else { hi[a] });
                let p = object.transform.point(Vec3::from(p));
                let (lo, hi) = all.unwrap_or((p, p));
                all = Some((Vec3::min(lo, p), Vec3::max(hi, p)));
            }
        }
        all
    }
}
