use crate::error::{Fault, Result};
use crate::job::Job;
use crate::load::{LoadOptions, Loaded, load, load_bytes};
use crate::map::{Filter, Wrap};
use crate::math::vec::Vec3;
use crate::scene::{Alpha, Channel, Falloff, LightKind, Model, Projection, ToneMap};
use serde_json::{Value, json};

/// A document with one triangle per primitive, and its binary chunk.
struct Maker {
    json: Value,
    bin: Vec<u8>,
}

impl Maker {
    fn new() -> Maker {
        let json = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
            "accessors": [], "bufferViews": [],
        });
        let mut maker = Maker { json, bin: Vec::new() };
        maker.floats("VEC3", &[0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0.]);
        maker.accessor(5125, "SCALAR", 3, bytemuck::cast_slice(&[0u32, 1, 2]), json!({}));
        maker
    }
    fn push(list: &mut Value, item: Value) -> usize {
        let list = list.as_array_mut().unwrap();
        list.push(item);
        list.len() - 1
    }
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let view = json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()});
        self.bin.extend_from_slice(bytes);
        Self::push(&mut self.json["bufferViews"], view)
    }
    fn accessor(&mut self, component: u32, kind: &str, count: usize, bytes: &[u8], more: Value) -> usize {
        let view = self.view(bytes);
        let mut accessor = json!({"bufferView": view, "componentType": component, "type": kind, "count": count});
        for (k, v) in more.as_object().unwrap() {
            accessor[k] = v.clone();
        }
        Self::push(&mut self.json["accessors"], accessor)
    }
    fn floats(&mut self, kind: &str, v: &[f32]) -> usize {
        let width = if kind == "SCALAR" { 1 } else { usize::from(kind.as_bytes()[3] - b'0') };
        self.accessor(5126, kind, v.len() / width, bytemuck::cast_slice(v), json!({}))
    }
    fn primitive(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]
    }
    fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"] = json!([{"byteLength": self.bin.len()}]);
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut bin = self.bin.clone();
        bin.resize(bin.len().next_multiple_of(4), 0);
        let mut out = b"glTF\x02\0\0\0".to_vec();
        out.extend(((28 + text.len() + bin.len()) as u32).to_le_bytes());
        for (kind, chunk) in [(b"JSON", text), (b"BIN\0", bin)] {
            out.extend((chunk.len() as u32).to_le_bytes());
            out.extend(kind);
            out.extend(chunk);
        }
        out
    }
    fn load(&self) -> Result<Loaded> {
        load_bytes("glb", &self.glb(), &LoadOptions::default())
    }
    fn code(&self) -> &'static str {
        self.load().map_or_else(|e| e.code, |_| "loaded")
    }
}

/// A PNG of one pixel.
fn png(rgb: [u8; 3]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, 1, 1);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(&rgb).unwrap();
    out
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::new();
    for group in bytes.chunks(3) {
        let word = group.iter().enumerate().fold(0u32, |w, (k, &b)| w | u32::from(b) << (16 - 8 * k));
        for k in 0..4 {
            out.push(if k <= group.len() { DIGITS[(word >> (18 - 6 * k) & 63) as usize] as char } else { '=' });
        }
    }
    out
}

#[test]
fn a_glb_with_all_attributes_keeps_them() {
    let mut m = Maker::new();
    let n = m.floats("VEC3", &[0., 0., 1., 0., 0., 1., 0., 0., 1., 0., 1., 0.]);
    let t = m.floats("VEC4", &[1., 0., 0., -1.].repeat(4));
    let uv = m.floats("VEC2", &[0., 0., 1., 0., 0., 1., 0.25, 0.75]);
    let uv1 = m.accessor(
        5123,
        "VEC2",
        4,
        bytemuck::cast_slice(&[65535u16, 0, 0, 0, 0, 0, 0, 0]),
        json!({"normalized": true}),
    );
    let c = m.accessor(5121, "VEC3", 4, &[255, 0, 51, 0, 0, 0, 0, 0, 0, 0, 0, 0], json!({"normalized": true}));
    m.primitive()["attributes"] =
        json!({"POSITION": 0, "NORMAL": n, "TANGENT": t, "TEXCOORD_0": uv, "TEXCOORD_1": uv1, "COLOR_0": c});
    let loaded = m.load().unwrap();
    assert!(loaded.findings.is_empty(), "{:?}", loaded.findings);
    let mesh = &loaded.scene.meshes[0];
    assert_eq!(mesh.positions[3], [1.0, 1.0, 0.0]);
    assert_eq!(mesh.corners, [0, 1, 2]);
    assert_eq!(mesh.normals.as_ref().unwrap().values[3], [0.0, 1.0, 0.0]);
    assert_eq!(mesh.tangents.as_ref().unwrap().values[0], [1.0, 0.0, 0.0, -1.0]);
    assert_eq!(mesh.uv[0].as_ref().unwrap().values[3], [0.25, 0.75]);
    assert_eq!(mesh.uv[1].as_ref().unwrap().values[0], [1.0, 0.0]);
    assert_eq!(mesh.colors.as_ref().unwrap().values[0], [1.0, 0.0, 0.2, 1.0]);
    assert!(mesh.normals.as_ref().unwrap().index.is_none());
    assert_eq!(loaded.scene.output.tone_map, ToneMap::KhronosNeutral);
    // glTF's default material: a rough white metal.
    let material = &loaded.scene.materials[loaded.scene.objects[0].materials[0]];
    assert_eq!((material.model, material.metallic, material.roughness), (Model::Pbr, 1.0, 1.0));
    assert!(!material.double_sided);
}

#[test]
fn interleaved_and_quantised_vertices_are_unpacked() {
    let mut m = Maker::new();
    // 12 bytes per vertex: i8 x 3 normalised normal, padding, then u16 x 2 uv, then u8 x 4 colour.
    let mut bytes = Vec::new();
    for k in 0..4u8 {
        bytes.extend([0, 0x81, 127, 0]);
        bytes.extend(u16::from(k).to_le_bytes());
        bytes.extend(100u16.to_le_bytes());
        bytes.extend([255, 0, 0, k]);
    }
    let view = m.view(&bytes);
    m.json["bufferViews"][view]["byteStride"] = json!(12);
    let list = &mut m.json["accessors"];
    let n = Maker::push(
        list,
        json!({"bufferView": view, "componentType": 5120, "type": "VEC3", "count": 4, "normalized": true}),
    );
    let uv = Maker::push(
        list,
        json!({"bufferView": view, "byteOffset": 4, "componentType": 5123, "type": "VEC2", "count": 4}),
    );
    let c = Maker::push(
        list,
        json!({"bufferView": view, "byteOffset": 8, "componentType": 5121, "type": "VEC4", "count": 4, "normalized": true}),
    );
    m.primitive()["attributes"] = json!({"POSITION": 0, "NORMAL": n, "TEXCOORD_0": uv, "COLOR_0": c});
    m.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let mesh = m.load().unwrap().scene.meshes.remove(0);
    assert_eq!(mesh.normals.unwrap().values[3], [0.0, -1.0, 1.0]);
    assert_eq!(mesh.uv[0].as_ref().unwrap().values[3], [3.0, 100.0]);
    assert_eq!(mesh.colors.unwrap().values[3], [1.0, 0.0, 0.0, 3.0 / 255.0]);
    // The last element ends with its view: one byte less must be noticed.
    let mut short = Maker::new();
    short.json["bufferViews"][0]["byteLength"] = json!(47);
    assert_eq!(short.code(), "gltf.accessor-out-of-range");
}

#[test]
fn sparse_accessors_replace_elements() {
    let mut m = Maker::new();
    let (at, values) = (m.view(&[1, 3]), m.view(bytemuck::cast_slice(&[5f32, 6., 7., 8., 9., 10.])));
    m.json["accessors"][0]["sparse"] = json!({
        "count": 2, "indices": {"bufferView": at, "componentType": 5121}, "values": {"bufferView": values}
    });
    let mesh = m.load().unwrap().scene.meshes.remove(0);
    assert_eq!(mesh.positions, [[0.0, 0.0, 0.0], [5.0, 6.0, 7.0], [0.0, 1.0, 0.0], [8.0, 9.0, 10.0]]);
    // Without a view the rest is zero.
    m.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert_eq!(m.load().unwrap().scene.meshes[0].positions[2], [0.0; 3]);
    m.json["accessors"][0]["count"] = json!(4_000_000_000u64);
    assert_eq!(m.code(), "gltf.accessor-out-of-range");
    m.json["accessors"][0]["count"] = json!(3);
    assert_eq!(m.code(), "gltf.sparse");
    m.json["accessors"][0]["count"] = json!(1);
    assert_eq!(m.code(), "gltf.index-out-of-range");
}

#[test]
fn strips_and_fans_keep_their_winding() {
    for (mode, want) in [(5, vec![0, 1, 2, 1, 3, 2]), (6, vec![1, 2, 0, 2, 3, 0])] {
        let mut m = Maker::new();
        m.primitive().as_object_mut().unwrap().remove("indices");
        m.primitive()["mode"] = json!(mode);
        assert_eq!(m.load().unwrap().scene.meshes[0].corners, want);
    }
    let mut m = Maker::new();
    m.primitive()["mode"] = json!(1);
    let error = m.load().unwrap_err();
    assert_eq!(error.code, "mesh.empty");
    assert!(error.message.contains("points and lines"), "{}", error.message);
}

#[test]
fn primitives_with_shared_vertices_become_slots_of_one_mesh() {
    let mut m = Maker::new();
    let other = m.accessor(5121, "SCALAR", 3, &[1, 3, 2], json!({}));
    m.json["materials"] = json!([{"name": "a"}, {"name": "b", "doubleSided": true}]);
    let p = |indices, material| json!({"attributes": {"POSITION": 0}, "indices": indices, "material": material});
    m.json["meshes"] = json!([{"primitives": [p(1, 1), p(other, 0)]}, {"primitives": [p(1, 0), p(other, 1)]}]);
    m.json["nodes"] = json!([{"children": [1, 2]}, {"mesh": 0, "name": "left"}, {"mesh": 1}]);
    let scene = m.load().unwrap().scene;
    assert_eq!(scene.meshes.len(), 1);
    assert_eq!(scene.meshes[0].corners, [0, 1, 2, 1, 3, 2]);
    assert_eq!(scene.meshes[0].materials, [0, 1]);
    assert_eq!(scene.objects[0].materials, [1, 0]);
    assert_eq!(scene.objects[1].materials, [0, 1]);
    assert_eq!(scene.objects[0].name, "left");
    assert!(scene.materials[1].double_sided);
}

#[test]
fn meshes_that_share_a_vertex_list_take_the_part_they_use() {
    let mut m = Maker::new();
    let other = m.accessor(5121, "SCALAR", 3, &[1, 3, 2], json!({}));
    m.json["meshes"] = json!([
        {"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]},
        {"primitives": [{"attributes": {"POSITION": 0}, "indices": other}]},
    ]);
    m.json["nodes"] = json!([{"mesh": 0, "children": [1]}, {"mesh": 1}]);
    let scene = m.load().unwrap().scene;
    assert_eq!(scene.meshes[0].positions.len(), 3);
    assert_eq!(scene.meshes[1].positions, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]);
    assert_eq!(scene.meshes[1].corners, [0, 2, 1]);
}

#[test]
fn nodes_compose_matrices_and_trs() {
    let mut m = Maker::new();
    let h = core::f32::consts::FRAC_1_SQRT_2;
    m.json["nodes"] = json!([
        {"translation": [1, 2, 3], "children": [1]},
        {"rotation": [0, 0, h, h], "scale": [2, -2, 2], "mesh": 0},
    ]);
    let scene = m.load().unwrap().scene;
    let p = scene.objects[0].transform.point(Vec3::new(1.0, 1.0, 0.0));
    // Scaled to (2, -2), turned by 90 degrees to (2, 2), moved. One rounding of sqrt(1/2).
    assert!((p - Vec3::new(3.0, 4.0, 3.0)).length() < 1e-6, "{p:?}");
    assert!(scene.objects[0].transform.determinant3() < 0.0);
    m.json["nodes"] = json!([{"matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 7, 8, 9, 1], "mesh": 0}]);
    assert_eq!(m.load().unwrap().scene.objects[0].transform.column(3).xyz(), Vec3::new(7.0, 8.0, 9.0));
    m.json["nodes"] = json!([{"scale": [1e30, 1, 1], "children": [1]}, {"scale": [1e30, 1, 1], "mesh": 0}]);
    assert_eq!(m.code(), "gltf.not-finite");
}

#[test]
fn cycles_and_shared_nodes_are_refused() {
    let mut m = Maker::new();
    m.json["nodes"] = json!([{"children": [1]}, {"children": [0], "mesh": 0}]);
    assert_eq!(m.code(), "gltf.node-twice");
    m.json["nodes"] = json!([{"children": [1, 2]}, {"children": [3]}, {"children": [3]}, {"mesh": 0}]);
    assert_eq!(m.code(), "gltf.node-twice");
    m.json["nodes"] = json!([{"children": [0]}]);
    assert_eq!(m.code(), "gltf.node-twice");
    m.json["nodes"] = json!([{"children": [9]}]);
    assert_eq!(m.code(), "gltf.no-such-item");
    // A chain of 20000 nodes is deep but a tree.
    let mut nodes: Vec<Value> = (1..20000).map(|k| json!({"children": [k]})).collect();
    nodes.push(json!({"mesh": 0}));
    m.json["nodes"] = json!(nodes);
    assert_eq!(m.code(), "loaded");
}

#[test]
fn the_default_scene_is_shown() {
    let mut m = Maker::new();
    m.json["nodes"] = json!([{"mesh": 0, "name": "a"}, {"mesh": 0, "name": "b"}]);
    m.json["scenes"] = json!([{"nodes": [0]}, {"nodes": [1]}]);
    m.json["scene"] = json!(1);
    let loaded = m.load().unwrap();
    assert_eq!(loaded.scene.objects.len(), 1);
    assert_eq!(loaded.scene.objects[0].name, "b");
    assert_eq!(loaded.findings[0].code, "gltf.scenes");
    let root = m.json.as_object_mut().unwrap();
    root.remove("scenes");
    root.remove("scene");
    assert_eq!(m.load().unwrap().scene.objects.len(), 2);
}

#[test]
fn cameras_and_lights_stand_where_their_nodes_do() {
    let mut m = Maker::new();
    m.json["cameras"] = json!([
        {"type": "perspective", "name": "lens", "perspective": {"yfov": core::f32::consts::FRAC_PI_2, "znear": 0.1}},
        {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 2, "znear": 0, "zfar": 9}},
        {"type": "perspective", "perspective": {"yfov": -1, "znear": 0.1}},
    ]);
    m.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "spot", "color": [1, 0, 0], "intensity": 20, "range": 5, "spot": {"outerConeAngle": 0.5}},
        {"type": "directional"}, {"type": "point"}, {"type": "laser"},
    ]}});
    m.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    let light = |k| json!({"KHR_lights_punctual": {"light": k}});
    m.json["nodes"] = json!([
        {"mesh": 0, "children": [1, 2, 3, 4, 5, 6, 7]},
        {"camera": 0, "translation": [0, 0, 5], "scale": [3, 3, 3]}, {"camera": 1, "name": "top"}, {"camera": 2},
        {"extensions": light(0), "translation": [0, 4, 0], "rotation": [-core::f32::consts::FRAC_1_SQRT_2, 0, 0, core::f32::consts::FRAC_1_SQRT_2]},
        {"extensions": light(1)}, {"extensions": light(2)}, {"extensions": light(3)},
    ]);
    let Loaded { scene, findings } = m.load().unwrap();
    assert_eq!(scene.cameras.len(), 2);
    let camera = &scene.cameras[0];
    assert_eq!((&camera.name[..], camera.projection), ("lens", Projection::Perspective { fov_y: 90.0 }));
    assert_eq!((camera.near, camera.far, camera.eye()), (0.1, f32::INFINITY, Vec3::new(0.0, 0.0, 5.0)));
    assert_eq!(camera.target, Vec3::new(0.0, 0.0, 0.0));
    assert_eq!(scene.cameras[1].projection, Projection::Orthographic { height: 4.0 });
    assert_eq!(scene.cameras[1].name, "top");
    assert_eq!(scene.lights.len(), 3);
    let spot = &scene.lights[0];
    // -Z turned by -90 degrees about X: downwards. One rounding of sqrt(1/2).
    assert!((spot.direction - Vec3::new(0.0, -1.0, 0.0)).length() < 1e-6, "{:?}", spot.direction);
    assert_eq!((spot.intensity, spot.range, spot.falloff), (20.0, Some(5.0), Falloff::InverseSquare));
    assert!(spot.shadow.is_some());
    let LightKind::Spot { inner, outer } = spot.kind else { panic!("{:?}", spot.kind) };
    // 0.5 radians in degrees, one rounding.
    assert!(inner == 0.0 && (outer - 28.647_89).abs() < 1e-4);
    assert_eq!((scene.lights[1].kind, scene.lights[1].falloff), (LightKind::Directional, Falloff::None));
    assert_eq!((scene.lights[2].kind, scene.lights[2].shadow), (LightKind::Point, None));
    let codes: Vec<_> = findings.iter().map(|f| f.code).collect();
    assert_eq!(codes, ["gltf.camera-ignored", "gltf.light-ignored"]);
}

#[test]
fn materials_textures_and_samplers_are_translated() {
    let mut m = Maker::new();
    let uv = m.floats("VEC2", &[0.0; 8]);
    m.primitive()["attributes"]["TEXCOORD_0"] = json!(uv);
    m.primitive()["attributes"]["TEXCOORD_1"] = json!(uv);
    m.primitive()["material"] = json!(0);
    let view = m.view(&png([1, 2, 3]));
    m.json["images"] = json!([
        {"bufferView": view, "mimeType": "image/png"},
        {"uri": format!("data:image/png;base64,{}", base64(&png([4, 5, 6])))},
        {"uri": "never-read.png"},
    ]);
    m.json["samplers"] =
        json!([{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728, "minFilter": 9728}, {"minFilter": 9729}]);
    m.json["textures"] =
        json!([{"source": 0, "sampler": 0}, {"source": 1, "sampler": 1}, {"source": 0}, {"source": 2}]);
    m.json["materials"] = json!([{
        "name": "all", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.25,
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1, 0.75], "metallicFactor": 0.1, "roughnessFactor": 0.2,
            "baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform":
                {"offset": [0.5, 0.25], "rotation": core::f32::consts::PI, "scale": [2, 3], "texCoord": 1}}},
            "metallicRoughnessTexture": {"index": 1}},
        "normalTexture": {"index": 2, "scale": 0.5}, "occlusionTexture": {"index": 2, "strength": 0.5, "texCoord": 1},
        "emissiveFactor": [1, 0.5, 0], "emissiveTexture": {"index": 1},
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4}, "KHR_materials_ior": {"ior": 1.3},
            "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [1, 0, 0],
                "specularTexture": {"index": 1}, "specularColorTexture": {"index": 0}}},
    }, {"pbrMetallicRoughness": {"baseColorTexture": {"index": 3}}, "extensions": {"KHR_materials_unlit": {}}}]);
    let Loaded { scene, findings } = m.load().unwrap();
    assert!(findings.is_empty(), "{findings:?}");
    assert_eq!(scene.images.len(), 2, "the image of a material that nothing shows is not read");
    let rgba = |t: usize| scene.images[t].rgba(0, 0).map(|v| (v * 255.0) as u8);
    let a = &scene.materials[0];
    assert_eq!((a.albedo, a.opacity, a.metallic, a.roughness), ([0.5, 0.25, 1.0], 0.75, 0.1, 0.2));
    assert_eq!((a.alpha, a.double_sided, a.ior), (Alpha::Mask(0.25), true, 1.3));
    assert_eq!((a.emissive, a.specular_factor, a.specular_color), ([4.0, 2.0, 0.0], 0.5, [1.0, 0.0, 0.0]));
    let albedo = a.albedo_map.as_ref().unwrap();
    assert_eq!((albedo.filter, albedo.wrap, albedo.uv), (Filter::Nearest, [Wrap::Clamp, Wrap::Mirror], 1));
    assert_eq!((albedo.offset, albedo.rotate, albedo.scale), ([0.5, 0.25], 180.0, [2.0, 3.0]));
    assert_eq!(rgba(albedo.image)[0], 1);
    let rough = a.roughness_map.as_ref().unwrap();
    assert_eq!((rough.channel, rough.filter), (Some(Channel::G), Filter::Bilinear));
    assert_eq!(a.metallic_map.as_ref().unwrap().channel, Some(Channel::B));
    assert_eq!(rgba(rough.image)[0], 4);
    let occlusion = a.occlusion_map.as_ref().unwrap();
    assert_eq!((occlusion.channel, occlusion.uv, a.occlusion_strength), (Some(Channel::R), 1, 0.5));
    let normal = a.normal_map.as_ref().unwrap();
    assert_eq!((normal.scale, normal.y_down, normal.texture.filter), (0.5, false, Filter::Trilinear));
    assert_eq!(a.specular_factor_map.as_ref().unwrap().channel, Some(Channel::A));
    assert!(a.specular_map.is_some() && a.emissive_map.is_some());
    assert_eq!(scene.materials[1].model, Model::Unlit);
}

#[test]
fn missing_and_broken_images_are_findings() {
    let mut m = Maker::new();
    m.primitive()["material"] = json!(0);
    let view = m.view(b"no picture");
    m.json["images"] = json!([{"uri": "missing.png"}, {"bufferView": view}, {"uri": "../../etc/passwd"}]);
    m.json["textures"] = json!([{"source": 0}, {"source": 1}, {"source": 2}, {}]);
    m.json["materials"] = json!([{
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 2}},
        "normalTexture": {"index": 1}, "emissiveTexture": {"index": 3}}]);
    let Loaded { scene, findings } = m.load().unwrap();
    let material = &scene.materials[0];
    assert!(material.albedo_map.is_none() && material.normal_map.is_none() && material.emissive_map.is_none());
    let count = |code| findings.iter().filter(|f| f.code == code).count();
    assert_eq!((count("texture.missing"), count("texture.unreadable")), (3, 1), "{findings:?}");
}

#[test]
fn extensions_are_told_about_or_refused() {
    let mut m = Maker::new();
    m.json["extensionsUsed"] = json!(["KHR_materials_clearcoat", "KHR_materials_ior"]);
    m.json["skins"] = json!([{"joints": [0]}]);
    m.json["animations"] = json!([{}]);
    m.primitive()["targets"] = json!([{"POSITION": 0}]);
    let codes: Vec<_> = m.load().unwrap().findings.iter().map(|f| f.code).collect();
    let want = ["gltf.extension-ignored", "gltf.skin-ignored", "gltf.animation-ignored", "gltf.morph-ignored"];
    assert_eq!(codes, want);
    m.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    let error = m.load().unwrap_err();
    assert_eq!((error.code, error.fault), ("gltf.extension-required", Fault::Input));
    assert!(error.message.contains("draco") && error.remedy.unwrap().contains("Draco"));
    m.json["extensionsRequired"] = json!([]);
    m.json["asset"]["version"] = json!("1.0");
    assert_eq!(m.code(), "gltf.version");
}

#[test]
fn wrong_numbers_are_errors_that_name_the_place() {
    let with = |change: &dyn Fn(&mut Maker)| {
        let mut m = Maker::new();
        change(&mut m);
        m.load().unwrap_err()
    };
    let error = with(&|m| m.primitive()["indices"] = json!(m.accessor_u8(&[0, 1, 4])));
    assert_eq!((error.code, error.place.as_deref()), ("gltf.index-out-of-range", Some("/accessors/2")));
    assert!(error.message.contains("index 2 is 4"), "{}", error.message);
    let error = with(&|m| m.bin[16..20].copy_from_slice(&f32::NAN.to_le_bytes()));
    assert_eq!(error.code, "mesh.not-finite");
    assert!(error.message.contains("vertex 1"), "{}", error.message);
    let code = |change: &dyn Fn(&mut Maker)| with(change).code;
    assert_eq!(code(&|m| m.json["accessors"][0]["count"] = json!(u64::MAX)), "gltf.accessor-out-of-range");
    assert_eq!(code(&|m| m.json["accessors"][0]["byteOffset"] = json!(u64::MAX)), "gltf.accessor-out-of-range");
    assert_eq!(code(&|m| m.json["bufferViews"][0]["byteOffset"] = json!(u64::MAX)), "gltf.view-out-of-range");
    assert_eq!(code(&|m| m.json["accessors"][0]["type"] = json!("VEC2")), "gltf.accessor-type");
    assert_eq!(code(&|m| m.json["accessors"][0]["componentType"] = json!(7)), "gltf.component-type");
    assert_eq!(code(&|m| m.json["accessors"][1]["componentType"] = json!(5126)), "gltf.component-type");
    assert_eq!(code(&|m| m.primitive()["attributes"]["NORMAL"] = json!(99)), "gltf.no-such-item");
    assert_eq!(code(&|m| m.primitive()["material"] = json!(0)), "gltf.no-such-item");
    assert_eq!(code(&|m| m.json["nodes"] = json!("many")), "gltf.json");
    assert_eq!(code(&|m| m.json["accessors"][0]["count"] = json!(-1)), "gltf.json");
}

impl Maker {
    fn accessor_u8(&mut self, list: &[u8]) -> usize {
        self.accessor(5121, "SCALAR", list.len(), list, json!({}))
    }
}

#[test]
fn non_finite_normals_are_mended_with_a_finding() {
    let mut m = Maker::new();
    let n = m.floats("VEC3", &[0., 0., 1., 0., f32::NAN, 1., 0., 0., f32::INFINITY, 0., 1., 0.]);
    m.primitive()["attributes"]["NORMAL"] = json!(n);
    let loaded = m.load().unwrap();
    assert_eq!(loaded.findings[0].code, "mesh.attribute-not-finite");
    assert_eq!(loaded.scene.meshes[0].normals.as_ref().unwrap().values[1], [0.0, 0.0, 1.0]);
}

#[test]
fn small_files_cannot_ask_for_much() {
    // Every mesh uses the first and the last of shared vertices: quadratic growth.
    let mut m = Maker::new();
    let many = m.floats("VEC3", &vec![0.5; 3 * 100_000]);
    let (mut meshes, mut nodes) = (Vec::new(), Vec::new());
    for k in 0..300u32 {
        let list = m.accessor(5125, "SCALAR", 3, bytemuck::cast_slice(&[0u32, k, 99_999]), json!({}));
        meshes.push(json!({"primitives": [{"attributes": {"POSITION": many}, "indices": list}]}));
        nodes.push(json!({"mesh": k}));
    }
    m.json["scenes"] = json!([{"nodes": (0..300).collect::<Vec<_>>()}]);
    (m.json["meshes"], m.json["nodes"]) = (json!(meshes), json!(nodes));
    assert_eq!(m.code(), "gltf.growth");
    // Many nodes times many primitives.
    let mut m = Maker::new();
    let uv = m.floats("VEC2", &[0.0; 8]);
    let part = |k: usize| {
        let attributes =
            if k.is_multiple_of(2) { json!({"POSITION": 0}) } else { json!({"POSITION": 0, "TEXCOORD_0": uv}) };
        json!({"attributes": attributes, "indices": 1})
    };
    m.json["meshes"] = json!([{"primitives": (0..3000).map(part).collect::<Vec<_>>()}]);
    m.json["nodes"] = json!(vec![json!({"mesh": 0}); 3000]);
    m.json["scenes"] = json!([{"nodes": (0..3000).collect::<Vec<_>>()}]);
    assert_eq!(m.code(), "gltf.too-many-objects");
}

#[test]
fn the_budget_holds() {
    let m = Maker::new();
    let options = LoadOptions { job: Job::builder().memory(1000).build(), ..LoadOptions::default() };
    let error = load_bytes("glb", &m.glb(), &options).unwrap_err();
    assert_eq!((error.code, error.fault), ("job.memory", Fault::Memory));
    let options = LoadOptions { job: Job::builder().memory(1 << 20).build(), ..LoadOptions::default() };
    load_bytes("glb", &m.glb(), &options).unwrap();
    assert!(options.job.peak() > 0);
    // All is given back.
    options.job.reserve(1 << 20, "everything").unwrap();
}

#[test]
fn files_are_read_the_same_as_memory_with_any_number_of_threads() {
    let folder = std::env::temp_dir().join(format!("frieze-gltf-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let mut m = Maker::new();
    let positions: Vec<f32> = (0..3 * 50_000).map(|k| (k % 977) as f32).collect();
    let p = m.floats("VEC3", &positions);
    let list: Vec<u32> = (0..150_000u32).map(|k| k * 7919 % 50_000).collect();
    let i = m.accessor(5125, "SCALAR", list.len(), bytemuck::cast_slice(&list), json!({}));
    *m.primitive() = json!({"attributes": {"POSITION": p}, "indices": i});
    let path = folder.join("Mod el.GLB");
    std::fs::write(&path, m.glb()).unwrap();
    let mut text = m.json.clone();
    text["buffers"] = json!([{"byteLength": m.bin.len(), "uri": "the%20data.bin"}]);
    std::fs::write(folder.join("the data.bin"), &m.bin).unwrap();
    std::fs::write(folder.join("model.gltf"), text.to_string()).unwrap();
    text["buffers"][0]["uri"] = json!(format!("data:application/octet-stream;base64,{}", base64(&m.bin)));
    std::fs::write(folder.join("embedded.gltf"), text.to_string()).unwrap();
    text["buffers"][0]["uri"] = json!("http://localhost/data.bin");
    std::fs::write(folder.join("url.gltf"), text.to_string()).unwrap();
    text["buffers"][0]["uri"] = json!("%2e%2e/data.bin");
    std::fs::write(folder.join("escape.gltf"), text.to_string()).unwrap();
    let want = m.load().unwrap().scene;
    assert_eq!(want.meshes[0].corners, list);
    assert_eq!(bytemuck::cast_slice::<_, f32>(&want.meshes[0].positions), &positions[..]);
    for threads in [1, 3] {
        let options = LoadOptions { job: Job::builder().threads(threads).build(), ..LoadOptions::default() };
        for name in ["Mod el.GLB", "model.gltf", "embedded.gltf"] {
            let scene = load(&folder.join(name), &options).unwrap().scene;
            assert_eq!(scene.meshes, want.meshes, "{name}");
            assert_eq!(scene.name, name.split('.').next().unwrap());
        }
        let code = |name: &str| load(&folder.join(name), &options).unwrap_err().code;
        assert_eq!(
            (code("url.gltf"), code("escape.gltf"), code("none.glb")),
            ("file.url", "file.outside", "file.missing")
        );
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn containers_are_checked() {
    let glb = Maker::new().glb();
    let code = |bytes: &[u8]| load_bytes("glb", bytes, &LoadOptions::default()).map_or_else(|e| e.code, |_| "loaded");
    assert_eq!(code(b""), "file.truncated");
    assert_eq!(code(b"glTX\x02\0\0\0\0\0\0\0"), "glb.magic");
    assert_eq!(code(b"glTF\x01\0\0\0\0\0\0\0"), "gltf.version");
    assert_eq!(code(&glb[..glb.len() - 1]), "glb.truncated");
    assert_eq!(code(b"glTF\x02\0\0\0\x0c\0\0\0"), "glb.no-json");
    assert_eq!(code(b"glTF\x02\0\0\0\x14\0\0\0\xff\xff\xff\xffJSON"), "glb.chunk");
    let mut longer = glb.clone();
    longer.extend(b"tail");
    let loaded = load_bytes("glb", &longer, &LoadOptions::default()).unwrap();
    assert_eq!(loaded.findings[0].code, "glb.trailing");
}
