//! What a surface is made of, and the maps it asks.

use crate::map::{Filter, Wrap};

/// The reflection model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Model {
    /// Ambient + diffuse + specular lobes (rows 5 to 14).
    #[default]
    BlinnPhong,
    /// Metallic-roughness: GGX, height-correlated Smith, Schlick.
    Pbr,
    /// The albedo as it is.
    Unlit,
}

/// Where lighting is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Shading {
    /// Once per triangle, at its centroid, with its geometric normal.
    Flat,
    /// Once per vertex; albedo still per pixel.
    Gouraud,
    /// Per pixel.
    #[default]
    Phong,
}

/// What alpha does.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Alpha {
    /// Nothing.
    #[default]
    Opaque,
    /// Cuts the surface away where it is below the cutoff.
    Mask(f32),
    /// Blends with what is behind.
    Blend,
}

/// Where shading normals come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Normals {
    /// The file; where it has none as [`Normals::Angle`], but sharp where triangles meet at 60 degrees or more.
    #[default]
    File,
    /// Averages of the adjoining triangles, weighted by area.
    Area,
    /// Weighted by the angle at the vertex.
    Angle,
    /// Not weighted.
    Uniform,
}

/// Where tangent frames come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum TangentFrame {
    /// The file, or MikkTSpace where it has none.
    #[default]
    Mikktspace,
    /// Per-triangle solve averaged at the vertices (document 001).
    Average,
    /// Per-triangle solve.
    PerTriangle,
    /// From the normal alone.
    FromNormal,
    /// From the normal alone, as GAMES101's assignment 3 prints it.
    Games101,
}

/// The two ways of document 001.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum TbnPath {
    /// The mapped normal goes to world space, per fragment.
    #[default]
    World,
    /// Light and view go to tangent space. Document 001 turns them at the vertices, which on curved surfaces is not the
    /// same (erratum E4b); here they are turned into the frame of each fragment.
    Tangent,
}

/// What the vectors of a normal map are relative to (rows 50 to 52).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum NormalSpace {
    /// The surface: the map bends with it and serves any mesh.
    #[default]
    Tangent,
    /// The object: the map turns and moves with it, but is wrong once the object bends, and belongs to one mesh.
    Object,
    /// The world: the map is wrong as soon as the object turns.
    World,
}

/// Which value of a normal map's integer texels is zero (row 49): an even number of codes has no middle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum NormalZero {
    /// Half of the largest code, which no texel can hold: `2 c - 1`, as glTF, OpenGL and most bakers have it. The flat
    /// texel (128, 128, 255) leans by 0.32 degrees.
    #[default]
    Half,
    /// 128 of 255 (32768 of 65535): (128, 128, 255) is flat. The code 0 counts as 1.
    Exact,
}

/// Which number of a texel a scalar slot takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Channel {
    R,
    G,
    B,
    A,
    /// Rec. 709 luminance of the linear colour.
    Luminance,
    /// Length of the RGB vector (GAMES101's bump and displacement).
    RgbNorm,
}

/// An image and how it is asked.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Index into [`Scene::images`](super::Scene::images).
    pub image: usize,
    /// UV set, 0 or 1.
    pub uv: u8,
    /// `uv' = T(offset) R(rotate) S(scale) uv`, KHR_texture_transform's order.
    pub offset: [f32; 2],
    /// Degrees, counter-clockwise.
    pub rotate: f32,
    /// See `offset`.
    pub scale: [f32; 2],
    /// How texels are combined.
    pub filter: Filter,
    /// Outside of 0 ..= 1, along u and v.
    pub wrap: [Wrap; 2],
    /// Whether the numbers are sRGB; `None`: what the slot means (colour: sRGB unless the image is linear
    /// floats; data: linear).
    pub srgb: Option<bool>,
    /// For scalar slots; `None`: the slot's own (R; G for roughness and B for metallic of glTF).
    pub channel: Option<Channel>,
}

impl Texture {
    /// Image `image` with UV set 0, trilinear, repeated.
    pub fn new(image: usize) -> Self {
        Texture {
            image,
            uv: 0,
            offset: [0.0; 2],
            rotate: 0.0,
            scale: [1.0; 2],
            filter: Filter::Trilinear,
            wrap: [Wrap::Repeat; 2],
            srgb: None,
            channel: None,
        }
    }
}

/// A normal map; [`Material::normal_space`] and [`Material::normal_zero`] say what its numbers mean.
#[derive(Clone, Debug, PartialEq)]
pub struct NormalMap {
    /// The image.
    pub texture: Texture,
    /// Multiplies x and y of a tangent-space map before the normal is made of unit length.
    pub scale: f32,
    /// Whether green points down the image's v (DirectX) instead of up (OpenGL, glTF). In object and world space: down
    /// the axis.
    pub y_down: bool,
    /// 3, or 2 when z (never below 0) is to be rebuilt from x and y.
    pub channels: u8,
}

/// A height map: bump, displacement, parallax.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightMap {
    /// The image.
    pub texture: Texture,
    /// Metres from height 0 to height 1.
    pub scale: f32,
    /// The height that means no change.
    pub midlevel: f32,
}

/// A material. Colours are linear RGB.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Its name in the file, or empty.
    pub name: String,
    /// The reflection model.
    pub model: Model,
    /// Where lighting is computed.
    pub shading: Shading,
    /// Albedo: Blinn-Phong's diffuse and PBR's base colour.
    pub albedo: [f32; 3],
    /// Multiplies the albedo map's alpha and the vertex alpha.
    pub opacity: f32,
    /// Blinn-Phong's ambient reflectance; `None`: the albedo, maps included.
    pub ambient: Option<[f32; 3]>,
    /// Blinn-Phong's specular reflectance.
    pub specular: [f32; 3],
    /// Blinn-Phong's exponent.
    pub shininess: f32,
    /// Share of mirror reflection (Blinn-Phong, row 14).
    pub reflection: f32,
    /// PBR: 0 dielectric, 1 metal.
    pub metallic: f32,
    /// PBR: perceptual roughness; alpha is its square.
    pub roughness: f32,
    /// PBR: index of refraction (KHR_materials_ior).
    pub ior: f32,
    /// PBR: strength of the dielectric lobe (KHR_materials_specular).
    pub specular_factor: f32,
    /// PBR: tint of the dielectric lobe at normal incidence (KHR_materials_specular).
    pub specular_color: [f32; 3],
    /// Emitted light, strength included.
    pub emissive: [f32; 3],
    /// PBR: adds the energy that single scattering loses (Kulla-Conty / Turquin).
    pub multi_scatter: bool,
    /// What alpha does.
    pub alpha: Alpha,
    /// Whether back faces are drawn (with the normal turned to the viewer).
    pub double_sided: bool,
    /// Where shading normals come from.
    pub normals: Normals,
    /// Where tangent frames come from.
    pub tangent_frame: TangentFrame,
    /// How a mapped normal meets the light.
    pub tbn_path: TbnPath,
    /// Whether vertex colours multiply the albedo.
    pub vertex_colors: bool,
    /// Multiplies the albedo; alpha multiplies opacity.
    pub albedo_map: Option<Texture>,
    /// Multiplies `ambient`.
    pub ambient_map: Option<Texture>,
    /// Multiplies `specular` (Blinn-Phong), or `specular_color` (PBR).
    pub specular_map: Option<Texture>,
    /// Multiplies `specular_factor` (PBR; alpha by default).
    pub specular_factor_map: Option<Texture>,
    /// Multiplies `shininess`.
    pub shininess_map: Option<Texture>,
    /// Multiplies opacity.
    pub alpha_map: Option<Texture>,
    /// Multiplies `metallic`.
    pub metallic_map: Option<Texture>,
    /// Multiplies `roughness`.
    pub roughness_map: Option<Texture>,
    /// Multiplies `emissive`.
    pub emissive_map: Option<Texture>,
    /// Dims ambient light.
    pub occlusion_map: Option<Texture>,
    /// How much the occlusion map counts, 0 ..= 1.
    pub occlusion_strength: f32,
    /// Tilts the normal.
    pub normal_map: Option<NormalMap>,
    /// What the vectors of `normal_map` are relative to.
    pub normal_space: NormalSpace,
    /// Which texel of `normal_map` is zero.
    pub normal_zero: NormalZero,
    /// Height that tilts the normal.
    pub bump_map: Option<HeightMap>,
    /// Height that moves the surface.
    pub displacement_map: Option<HeightMap>,
    /// Height that moves the lookup.
    pub parallax_map: Option<HeightMap>,
}

impl Default for Material {
    /// White Blinn-Phong, as an empty `[material.x]` table of a scene file.
    fn default() -> Self {
        Material {
            name: String::new(),
            model: Model::BlinnPhong,
            shading: Shading::Phong,
            albedo: [1.0; 3],
            opacity: 1.0,
            ambient: None,
            specular: [0.3; 3],
            shininess: 64.0,
            reflection: 0.0,
            metallic: 0.0,
            roughness: 0.5,
            ior: 1.5,
            specular_factor: 1.0,
            specular_color: [1.0; 3],
            emissive: [0.0; 3],
            multi_scatter: false,
            alpha: Alpha::Opaque,
            double_sided: false,
            normals: Normals::File,
            tangent_frame: TangentFrame::Mikktspace,
            tbn_path: TbnPath::World,
            vertex_colors: true,
            albedo_map: None,
            ambient_map: None,
            specular_map: None,
            specular_factor_map: None,
            shininess_map: None,
            alpha_map: None,
            metallic_map: None,
            roughness_map: None,
            emissive_map: None,
            occlusion_map: None,
            occlusion_strength: 1.0,
            normal_map: None,
            normal_space: NormalSpace::Tangent,
            normal_zero: NormalZero::Half,
            bump_map: None,
            displacement_map: None,
            parallax_map: None,
        }
    }
}

impl Material {
    /// Whether shading reads tangents.
    pub fn needs_tangent(&self) -> bool {
        self.normal_map.is_some()
            && self.normal_space == NormalSpace::Tangent
            && self.shading == Shading::Phong
            && self.model != Model::Unlit
            && !matches!(self.tangent_frame, TangentFrame::FromNormal | TangentFrame::Games101)
    }
    /// Every texture that some slot holds, with whether the slot is colour.
    pub fn textures(&self) -> impl Iterator<Item = (&Texture, bool)> {
        let color = [&self.albedo_map, &self.ambient_map, &self.specular_map, &self.emissive_map];
        let data = [
            &self.specular_factor_map,
            &self.shininess_map,
            &self.alpha_map,
            &self.metallic_map,
            &self.roughness_map,
            &self.occlusion_map,
        ];
        let heights = [&self.bump_map, &self.displacement_map, &self.parallax_map];
        color
            .into_iter()
            .flatten()
            .map(|t| (t, true))
            .chain(data.into_iter().flatten().map(|t| (t, false)))
            .chain(self.normal_map.iter().map(|m| (&m.texture, false)))
            .chain(heights.into_iter().flatten().map(|m| (&m.texture, false)))
    }
}
