//! The parts of a glTF 2.0 document that are rendered, as serde reads them. Names are the specification's.
//! Unknown members are skipped; every index is still unchecked.

use serde::Deserialize;
use serde::de::IgnoredAny;
use std::collections::BTreeMap;

macro_rules! objects {
    ($($(#[$doc:meta])* $name:ident { $($(#[$attr:meta])* $field:ident: $type:ty = $default:expr,)* })*) => {
        $(
            $(#[$doc])*
            #[derive(Clone, Debug, Deserialize)]
            #[serde(rename_all = "camelCase", default)]
            #[allow(missing_docs)]
            pub struct $name { $($(#[$attr])* pub $field: $type,)* }
            impl Default for $name {
                fn default() -> Self {
                    $name { $($field: $default,)* }
                }
            }
        )*
    };
}

objects! {
    /// The root.
    Document {
        asset: Asset = Asset::default(),
        extensions_used: Vec<String> = Vec::new(),
        extensions_required: Vec<String> = Vec::new(),
        scene: Option<u32> = None,
        scenes: Vec<Scene> = Vec::new(),
        nodes: Vec<Node> = Vec::new(),
        meshes: Vec<Mesh> = Vec::new(),
        accessors: Vec<Accessor> = Vec::new(),
        buffer_views: Vec<BufferView> = Vec::new(),
        buffers: Vec<Buffer> = Vec::new(),
        materials: Vec<Material> = Vec::new(),
        textures: Vec<Texture> = Vec::new(),
        images: Vec<Image> = Vec::new(),
        samplers: Vec<Sampler> = Vec::new(),
        cameras: Vec<Camera> = Vec::new(),
        skins: Vec<IgnoredAny> = Vec::new(),
        animations: Vec<IgnoredAny> = Vec::new(),
        extensions: DocumentExtensions = DocumentExtensions::default(),
    }
    Asset { version: String = String::new(), min_version: Option<String> = None, }
    DocumentExtensions {
        #[serde(rename = "KHR_lights_punctual")]
        lights: Lights = Lights::default(),
    }
    Lights { lights: Vec<Light> = Vec::new(), }
    Light {
        name: Option<String> = None,
        color: [f32; 3] = [1.0; 3],
        intensity: f32 = 1.0,
        #[serde(rename = "type")]
        kind: String = String::new(),
        range: Option<f32> = None,
        spot: Option<Spot> = None,
    }
    Spot { inner_cone_angle: f32 = 0.0, outer_cone_angle: f32 = core::f32::consts::FRAC_PI_4, }
    Scene { nodes: Vec<u32> = Vec::new(), }
    Node {
        name: Option<String> = None,
        children: Vec<u32> = Vec::new(),
        matrix: Option<Box<[f32; 16]>> = None,
        translation: Option<[f32; 3]> = None,
        rotation: Option<[f32; 4]> = None,
        scale: Option<[f32; 3]> = None,
        mesh: Option<u32> = None,
        camera: Option<u32> = None,
        skin: Option<u32> = None,
        extensions: NodeExtensions = NodeExtensions::default(),
    }
    NodeExtensions {
        #[serde(rename = "KHR_lights_punctual")]
        light: Option<LightReference> = None,
    }
    LightReference { light: u32 = u32::MAX, }
    Mesh { name: Option<String> = None, primitives: Vec<Primitive> = Vec::new(), }
    Primitive {
        attributes: BTreeMap<String, u32> = BTreeMap::new(),
        indices: Option<u32> = None,
        material: Option<u32> = None,
        mode: u32 = 4,
        targets: Vec<IgnoredAny> = Vec::new(),
    }
    Accessor {
        buffer_view: Option<u32> = None,
        byte_offset: u64 = 0,
        component_type: u32 = 0,
        normalized: bool = false,
        count: u64 = 0,
        #[serde(rename = "type")]
        kind: String = String::new(),
        sparse: Option<Box<Sparse>> = None,
    }
    Sparse { count: u64 = 0, indices: SparsePart = SparsePart::default(), values: SparsePart = SparsePart::default(), }
    SparsePart { buffer_view: u32 = u32::MAX, byte_offset: u64 = 0, component_type: u32 = 0, }
    BufferView { buffer: u32 = u32::MAX, byte_offset: u64 = 0, byte_length: u64 = 0, byte_stride: Option<u64> = None, }
    Buffer { uri: Option<String> = None, byte_length: u64 = 0, }
    Material {
        name: Option<String> = None,
        pbr_metallic_roughness: MetallicRoughness = MetallicRoughness::default(),
        normal_texture: Option<TextureReference> = None,
        occlusion_texture: Option<TextureReference> = None,
        emissive_texture: Option<TextureReference> = None,
        emissive_factor: [f32; 3] = [0.0; 3],
        alpha_mode: Option<String> = None,
        alpha_cutoff: f32 = 0.5,
        double_sided: bool = false,
        extensions: MaterialExtensions = MaterialExtensions::default(),
    }
    MetallicRoughness {
        base_color_factor: [f32; 4] = [1.0; 4],
        base_color_texture: Option<TextureReference> = None,
        metallic_factor: f32 = 1.0,
        roughness_factor: f32 = 1.0,
        metallic_roughness_texture: Option<TextureReference> = None,
    }
    MaterialExtensions {
        #[serde(rename = "KHR_materials_unlit")]
        unlit: Option<IgnoredAny> = None,
        #[serde(rename = "KHR_materials_emissive_strength")]
        emissive_strength: Option<EmissiveStrength> = None,
        #[serde(rename = "KHR_materials_ior")]
        ior: Option<Ior> = None,
        #[serde(rename = "KHR_materials_specular")]
        specular: Option<Specular> = None,
    }
    EmissiveStrength { emissive_strength: f32 = 1.0, }
    Ior { ior: f32 = 1.5, }
    Specular {
        specular_factor: f32 = 1.0,
        specular_texture: Option<TextureReference> = None,
        specular_color_factor: [f32; 3] = [1.0; 3],
        specular_color_texture: Option<TextureReference> = None,
    }
    /// `textureInfo`, and its kin of normal and occlusion maps.
    TextureReference {
        index: u32 = u32::MAX,
        tex_coord: u32 = 0,
        scale: f32 = 1.0,
        strength: f32 = 1.0,
        extensions: TextureReferenceExtensions = TextureReferenceExtensions::default(),
    }
    TextureReferenceExtensions {
        #[serde(rename = "KHR_texture_transform")]
        transform: Option<TextureTransform> = None,
    }
    TextureTransform {
        offset: [f32; 2] = [0.0; 2],
        rotation: f32 = 0.0,
        scale: [f32; 2] = [1.0; 2],
        tex_coord: Option<u32> = None,
    }
    Texture { sampler: Option<u32> = None, source: Option<u32> = None, extensions: TextureExtensions = TextureExtensions::default(), }
    TextureExtensions {
        #[serde(rename = "EXT_texture_webp")]
        webp: Option<TextureSource> = None,
    }
    TextureSource { source: Option<u32> = None, }
    Image { name: Option<String> = None, uri: Option<String> = None, buffer_view: Option<u32> = None, mime_type: Option<String> = None, }
    Sampler { mag_filter: Option<u32> = None, min_filter: Option<u32> = None, wrap_s: u32 = 10497, wrap_t: u32 = 10497, }
    Camera {
        name: Option<String> = None,
        #[serde(rename = "type")]
        kind: String = String::new(),
        perspective: Option<Perspective> = None,
        orthographic: Option<Orthographic> = None,
    }
    Perspective { yfov: f32 = 0.0, znear: f32 = 0.0, zfar: Option<f32> = None, }
    Orthographic { ymag: f32 = 0.0, znear: f32 = 0.0, zfar: f32 = 0.0, }
}

/// Bytes that a document of this text may take in memory: objects, numbers and strings.
pub fn bytes_in_memory(text: &[u8]) -> u64 {
    let count = |b| text.iter().filter(|&&t| t == b).count() as u64;
    text.len() as u64 + count(b'{') * 400 + count(b',') * 16
}
