//! Small valid files of every model format, made by code. The seeds of the fuzz targets are made of them too.

use serde_json::{Value, json};

/// RFC 4648, section 4.
pub fn base64(bytes: &[u8]) -> String {
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

/// Two triangles with everything that a glTF file of ours can have, and its buffer.
pub fn document() -> (Value, Vec<u8>) {
    let mut bin = Vec::new();
    let mut views = Vec::new();
    let mut add = |bytes: &[u8], stride: Option<u32>| {
        bin.resize(bin.len().next_multiple_of(4), 0);
        let mut view = json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len()});
        if let Some(stride) = stride {
            view["byteStride"] = json!(stride);
        }
        bin.extend_from_slice(bytes);
        views.push(view);
    };
    let floats = |v: &[f32]| v.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    add(&floats(&[0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0.]), None);
    add(&[0, 1, 2, 2, 1, 3], None);
    add(&floats(&[0., 0., 1., 0., 0., 0., 0., 1., 1., 0., 0., 0., 1., 0., 1., 0., 0., 1., 1., 1.]), Some(20));
    add(&[2, 0], None);
    add(&floats(&[0., 1., 0.25]), None);
    let mut png = Vec::new();
    png::Encoder::new(&mut png, 2, 2).write_header().unwrap().write_image_data(&[1, 2, 3, 4]).unwrap();
    add(&png, None);
    let json = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 2]}],
        "extensionsUsed": ["KHR_lights_punctual", "KHR_texture_transform"],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "spot", "spot": {"outerConeAngle": 0.5}}]}},
        "nodes": [
            {"children": [1], "translation": [1, 2, 3], "extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"mesh": 0, "rotation": [0, 0, 0, 1], "scale": [1, -1, 1]},
            {"camera": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]},
        ],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}],
        "meshes": [{"primitives": [
            {"attributes": {"POSITION": 0, "NORMAL": 2, "TEXCOORD_0": 3}, "indices": 1, "material": 0},
            {"attributes": {"POSITION": 0, "NORMAL": 2, "TEXCOORD_0": 3}, "indices": 1, "mode": 5},
        ]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 4, "sparse": {"count": 1,
                "indices": {"bufferView": 3, "componentType": 5123}, "values": {"bufferView": 4}}},
            {"bufferView": 1, "componentType": 5121, "type": "SCALAR", "count": 6},
            {"bufferView": 2, "componentType": 5126, "type": "VEC3", "count": 4},
            {"bufferView": 2, "byteOffset": 12, "componentType": 5126, "type": "VEC2", "count": 4},
        ],
        "bufferViews": views, "buffers": [{"byteLength": bin.len()}],
        "images": [{"bufferView": 5, "mimeType": "image/png"}], "samplers": [{"wrapS": 33071}],
        "textures": [{"source": 0, "sampler": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "extensions":
            {"KHR_texture_transform": {"scale": [2, 2]}}}}, "normalTexture": {"index": 0, "scale": 0.5}}],
    });
    (json, bin)
}

/// A GLB file of a document and its buffer.
pub fn glb(json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend(((28 + text.len() + bin.len()) as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &text[..]), (b"BIN\0", bin)] {
        out.extend((chunk.len() as u32).to_le_bytes());
        out.extend(kind);
        out.extend(chunk);
    }
    out
}

/// A valid file of every kind.
pub fn corpus() -> Vec<(&'static str, Vec<u8>)> {
    let (mut json, bin) = document();
    let glb = glb(&json, &bin);
    json["buffers"][0]["uri"] = json!(format!("data:application/octet-stream;base64,{}", base64(&bin)));
    let gltf = json.to_string().into_bytes();
    let obj = "mtllib a.mtl\no first\nv 0 0 0 1 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv .5 .5 .1\nvt 0 0\nvt 1 0\nvn 0 0 1\ns 1\n\
               usemtl a\nf 1/1/1 2/2/1 3/1/1 4/2/1\ng x\nf -1//-1 -2//-1 \\\n -3//-1\no second\nusemtl b\nf 1 2 3\n\
               f 1 2 5 3 4\n";
    let head = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
             property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 2\n\
             property list uchar int vertex_indices\nproperty list uchar float texcoord\nelement other 1\n\
             property list int short a\nproperty double b\nend_header\n"
        )
        .into_bytes()
    };
    let mut ascii = head("ascii");
    ascii.extend(b"0 0 0 1 2 3\n1 0 0 1 2 3\n1 1 0 1 2 3\n0 1 0 1 2 3\n4 0 1 2 3 2 0 0\n3 0 1 2 0\n1 7 2.5\n");
    let mut ply = vec![("ply", ascii)];
    for big in [false, true] {
        let mut out = head(if big { "binary_big_endian" } else { "binary_little_endian" });
        let float = |v: f32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
        let int = |v: i32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
        for p in [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]] {
            p.iter().for_each(|&v: &f32| out.extend(float(v)));
            out.extend([1, 2, 3]);
        }
        for face in [&[0, 1, 2, 3][..], &[0, 2, 1]] {
            out.push(face.len() as u8);
            face.iter().for_each(|&v| out.extend(int(v)));
            out.push(2);
            out.extend([float(0.5), float(0.5)].as_flattened());
        }
        out.extend(int(0));
        out.extend([0; 8]);
        ply.push(("ply", out));
    }
    let plain = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
                  property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
    let mut plain = plain.to_vec();
    plain.extend([0f32, 0., 0., 1., 0., 0., 0., 1., 0.].iter().flat_map(|v| v.to_le_bytes()));
    plain.push(3);
    plain.extend([0i32, 1, 2].iter().flat_map(|v| v.to_le_bytes()));
    ply.push(("ply", plain));
    let mut stl = b"solid in name only".to_vec();
    stl.resize(80, 0);
    stl.extend(2u32.to_le_bytes());
    for k in 0..2 {
        let facet = [0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1., k as f32];
        stl.extend(facet.iter().flat_map(|v| v.to_le_bytes()));
        stl.extend([0; 2]);
    }
    let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
    let text = format!("solid a\n{facet}{facet}endsolid a\n").into_bytes();
    let mut all = vec![("glb", glb), ("gltf", gltf), ("obj", obj.as_bytes().to_vec()), ("stl", stl), ("stl", text)];
    all.extend(ply);
    all
}
