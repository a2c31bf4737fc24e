//! Files that are broken or mean harm: each gives a scene that keeps its promises, or an error; never a panic,
//! never more memory than was allowed. Law 9.

use frieze::load::{LoadOptions, Loaded, load, load_bytes};
use frieze::{Job, Result, Scene};
use serde_json::{Value, json};

const BUDGET: u64 = 64 << 20;

fn options() -> LoadOptions {
    LoadOptions { job: Job::builder().threads(2).memory(BUDGET).build(), ..LoadOptions::default() }
}

/// What loaders promise of every scene.
fn check(scene: &Scene) {
    for mesh in &scene.meshes {
        assert!(mesh.positions.iter().flatten().all(|v| v.is_finite()));
        assert!(mesh.corners.iter().all(|&c| (c as usize) < mesh.positions.len()));
        match &mesh.polygons {
            None => assert_eq!(mesh.corners.len() % 3, 0),
            Some(p) => {
                assert_eq!(*p.starts.last().unwrap() as usize, mesh.corners.len());
                assert!(p.starts.windows(2).all(|w| w[0] + 3 <= w[1]));
                assert_eq!(p.triangles.len(), p.face_of.len());
                for (t, &f) in p.triangles.iter().zip(&p.face_of) {
                    let face = p.starts[f as usize]..p.starts[f as usize + 1];
                    assert!(t.iter().all(|c| face.contains(c)));
                }
            }
        }
        let corners = mesh.corners.len();
        let attribute = |index: Option<&Vec<u32>>, len: usize| match index {
            Some(index) => assert!(index.len() == corners && index.iter().all(|&k| (k as usize) < len)),
            None => assert_eq!(len, mesh.positions.len()),
        };
        mesh.normals.iter().for_each(|a| attribute(a.index.as_ref(), a.values.len()));
        mesh.uv.iter().flatten().for_each(|a| attribute(a.index.as_ref(), a.values.len()));
        mesh.colors.iter().for_each(|a| attribute(a.index.as_ref(), a.values.len()));
        mesh.tangents.iter().for_each(|a| attribute(a.index.as_ref(), a.values.len()));
        assert!(mesh.normals.iter().flat_map(|a| &a.values).flatten().all(|v| v.is_finite()));
        assert!(mesh.uv.iter().flatten().flat_map(|a| &a.values).flatten().all(|v| v.is_finite()));
        assert!(mesh.materials.is_empty() || mesh.materials.len() == mesh.face_count());
    }
    for object in &scene.objects {
        let mesh = &scene.meshes[object.mesh];
        assert!(object.materials.iter().all(|&m| m < scene.materials.len()));
        let slots = mesh.materials.iter().max().map_or(1, |&m| m as usize + 1);
        assert!(object.materials.len() >= slots);
        assert!(object.transform.0.iter().flatten().all(|v| v.is_finite()));
    }
    for (texture, _) in scene.materials.iter().flat_map(|m| m.textures()) {
        assert!(texture.image < scene.images.len() && texture.uv < 2);
    }
}

/// Loads; says which case it was when that panics or breaks a promise.
fn attempt(kind: &str, bytes: &[u8], options: &LoadOptions, case: impl Fn() -> String) -> Result<Loaded> {
    let run = || {
        let result = load_bytes(kind, bytes, options);
        match &result {
            Ok(loaded) => check(&loaded.scene),
            Err(e) => assert!(e.code.contains('.') && !e.message.is_empty()),
        }
        result
    };
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(run)).unwrap_or_else(|_| panic!("{kind}: {}", case()))
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

/// Two triangles with everything that a glTF file of ours can have, and its buffer.
fn document() -> (Value, Vec<u8>) {
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

fn glb(json: &Value, bin: &[u8]) -> Vec<u8> {
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
fn corpus() -> Vec<(&'static str, Vec<u8>)> {
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

struct Random(u64);
impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 33) as usize) % n
    }
}

/// The process never held much more than the budgets of the tests that run side by side, if the system tells.
fn memory_was_kept() {
    let Ok(status) = std::fs::read_to_string("/proc/self/status") else { return };
    let line = status.lines().find(|l| l.starts_with("VmHWM:")).unwrap_or_default();
    let Some(Ok(peak)) = line.split_ascii_whitespace().nth(1).map(str::parse::<u64>) else { return };
    assert!(peak << 10 < 6 * BUDGET, "{} MiB", peak >> 10);
}

#[test]
fn the_corpus_itself_loads() {
    for (kind, bytes) in corpus() {
        let loaded = attempt(kind, &bytes, &options(), || "whole".into()).unwrap();
        assert!(loaded.scene.bounds().is_some(), "{kind}");
    }
}

#[test]
fn files_that_end_anywhere() {
    let options = options();
    for (kind, bytes) in corpus() {
        for end in 0..bytes.len() {
            let _ = attempt(kind, &bytes[..end], &options, || format!("the first {end} bytes"));
        }
    }
    memory_was_kept();
}

#[test]
fn files_with_flipped_bits() {
    let options = options();
    let mut random = Random(1);
    for (kind, bytes) in corpus() {
        for round in 0..1500 {
            let mut bad = bytes.clone();
            for _ in 0..1 + random.below(4) {
                let at = random.below(bad.len());
                match random.below(4) {
                    0 => bad[at] = [0, 0x7f, 0x80, 0xff][random.below(4)],
                    1 => bad[at] = b"0123456789-+.e/\\ \n{}[]\",:"[random.below(25)],
                    _ => bad[at] ^= 1 << random.below(8),
                }
            }
            let _ = attempt(kind, &bad, &options, || format!("round {round}"));
        }
    }
    memory_was_kept();
}

#[test]
fn numbers_that_are_too_large_too_small_or_none() {
    let options = options();
    let extremes = [
        "-1",
        "0",
        "3",
        "255",
        "65536",
        "4294967295",
        "4294967296",
        "9223372036854775807",
        "18446744073709551615",
        "99999999999999999999999",
        "1e30",
        "1e999",
        "-1e999",
        "nan",
        "0.5",
        "null",
        "[]",
        "\"x\"",
        "",
    ];
    for (kind, bytes) in corpus() {
        // Every number of the text, once with each extreme in its place.
        let text_len = match kind {
            "glb" => 20 + u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize,
            _ => bytes.len(),
        };
        let numeric = |b: u8| b.is_ascii_digit() || b == b'.' || b == b'-';
        let mut at = if kind == "glb" { 20 } else { 0 };
        while at < text_len {
            if !numeric(bytes[at]) || (at > 0 && bytes[at - 1].is_ascii_alphanumeric()) {
                at += 1;
                continue;
            }
            let end = (at..text_len).find(|&k| !numeric(bytes[k])).unwrap_or(text_len);
            for extreme in extremes {
                let mut bad = bytes[..at].to_vec();
                bad.extend(extreme.as_bytes());
                bad.extend(&bytes[end..]);
                if kind == "glb" {
                    // Lengths that fit, so that the document is what is tested.
                    let grown = |old: usize| (old + bad.len() - bytes.len()) as u32;
                    let (json, whole) = (grown(text_len - 20), grown(bytes.len()));
                    bad[12..16].copy_from_slice(&json.to_le_bytes());
                    bad[8..12].copy_from_slice(&whole.to_le_bytes());
                }
                let _ = attempt(kind, &bad, &options, || format!("{extreme} at byte {at}"));
            }
            at = end;
        }
    }
    memory_was_kept();
}

#[test]
fn documents_that_bite_their_tail_or_grow() {
    let options = options();
    let (json, bin) = document();
    let code = |change: &dyn Fn(&mut Value)| {
        let mut json = json.clone();
        change(&mut json);
        attempt("glb", &glb(&json, &bin), &options, || json.to_string()).map_or_else(|e| e.code, |_| "loaded")
    };
    assert_eq!(code(&|j| j["nodes"][1]["children"] = json!([0])), "gltf.node-twice");
    assert_eq!(code(&|j| j["scenes"][0]["nodes"] = json!([0, 0])), "gltf.node-twice");
    assert_eq!(code(&|j| j["accessors"][2]["count"] = json!(u64::MAX)), "gltf.accessor-out-of-range");
    assert_eq!(code(&|j| j["buffers"][0]["byteLength"] = json!(1u64 << 40)), "gltf.buffer-truncated");
    // Zeros without bytes: each accessor is allowed, all together are not.
    let zeros = code(&|j| {
        let mut primitives = Vec::new();
        for k in 0..200 {
            let accessor = json!({"componentType": 5126, "type": "VEC3", "count": 4_000_000});
            j["accessors"].as_array_mut().unwrap().push(accessor);
            primitives.push(json!({"attributes": {"POSITION": 4 + k}}));
        }
        j["meshes"] = json!([{"primitives": primitives}]);
    });
    assert!(["job.memory", "gltf.growth"].contains(&zeros), "{zeros}");
    // A deep document must not exhaust the stack.
    let deep = format!("{{\"extras\":{}{}}}", "[".repeat(500_000), "]".repeat(500_000));
    let error = attempt("gltf", deep.as_bytes(), &options, || "deep".into()).unwrap_err();
    assert_eq!(error.code, "gltf.version");
    let wide = format!("{{\"nodes\":[{}{{}}]}}", "{},".repeat(2_000_000));
    let error = attempt("gltf", wide.as_bytes(), &options, || "wide".into()).unwrap_err();
    assert_eq!(error.code, "job.memory");
    // One polygon of very many corners that crosses itself everywhere.
    let mut obj = String::new();
    let mut face = "f".to_owned();
    for k in 0..30_000u64 {
        obj += &format!("v {} {} 0\n", k * 7919 % 10_007, k * 104_729 % 9_973);
        face += &format!(" {}", k + 1);
    }
    attempt("obj", (obj + &face).as_bytes(), &options, || "polygon".into()).unwrap();
    let objects = "o x\nf 1 2 3\n".repeat(50_000);
    let obj = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{objects}");
    let _ = attempt("obj", obj.as_bytes(), &options, || "objects".into());
    memory_was_kept();
}

#[test]
fn paths_that_leave_the_folder() {
    let outer = std::env::temp_dir().join(format!("frieze-hostile-{}", std::process::id()));
    let folder = outer.join("asset");
    std::fs::create_dir_all(&folder).unwrap();
    let (mut json, bin) = document();
    std::fs::write(outer.join("secret.bin"), &bin).unwrap();
    std::fs::write(folder.join("fine.bin"), &bin).unwrap();
    let mut paths: Vec<(String, &str)> = vec![
        ("fine.bin".into(), "loaded"),
        ("./x/../fine.bin".into(), "loaded"),
        ("../secret.bin".into(), "file.outside"),
        ("..%2fsecret.bin".into(), "file.outside"),
        ("%2e%2e%5csecret.bin".into(), "file.outside"),
        ("..\\secret.bin".into(), "file.outside"),
        (outer.join("secret.bin").display().to_string(), "file.outside"),
        ("C:\\secret.bin".into(), "file.outside"),
        ("\\\\server\\secret.bin".into(), "file.outside"),
        ("//server/secret.bin".into(), "file.outside"),
        ("file:///etc/passwd".into(), "file.url"),
        ("http://localhost:1/secret.bin".into(), "file.url"),
        ("missing.bin".into(), "file.missing"),
        (".".into(), "file.unreadable"),
        ("a%00b".into(), "file.name"),
        ("data:;base64,AAA@".into(), "gltf.data-uri"),
        ("data:,text".into(), "gltf.data-uri"),
    ];
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("../secret.bin", folder.join("link.bin")).unwrap();
        std::os::unix::fs::symlink("loop.bin", folder.join("loop.bin")).unwrap();
        std::os::unix::fs::symlink("/dev/zero", folder.join("zero.bin")).unwrap();
        paths.push(("link.bin".into(), "file.outside"));
        paths.push(("zero.bin".into(), "file.outside"));
        paths.push(("loop.bin".into(), "file.unreadable"));
    }
    let model = folder.join("model.gltf");
    let code = |json: &Value, options: &LoadOptions| {
        std::fs::write(&model, json.to_string()).unwrap();
        load(&model, options).map_or_else(|e| e.code, |_| "loaded")
    };
    for (path, want) in &paths {
        json["buffers"][0]["uri"] = json!(path);
        assert_eq!(code(&json, &options()), *want, "{path}");
        let obj = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nmtllib {path}\nusemtl a\nf 1 2 3\n");
        std::fs::write(folder.join("model.obj"), obj).unwrap();
        let loaded = load(&folder.join("model.obj"), &options()).unwrap();
        // OBJ knows no percent signs; whatever the name, nothing from outside may be found.
        assert!(*want == "loaded" || loaded.findings.iter().any(|f| f.code == "mtl.missing"), "{path}");
    }
    json["buffers"][0]["uri"] = json!("../secret.bin");
    assert_eq!(code(&json, &LoadOptions { allow_outside: true, ..options() }), "loaded");
    #[cfg(unix)]
    {
        // A device has no length, so it is refused even then.
        json["buffers"][0]["uri"] = json!("zero.bin");
        assert_eq!(code(&json, &LoadOptions { allow_outside: true, ..options() }), "file.unreadable");
    }
    for text in ["not a model at all", ""] {
        let path = folder.join("what.ever");
        std::fs::write(&path, text).unwrap();
        assert_eq!(load(&path, &options()).unwrap_err().code, "load.unknown-format");
    }
    std::fs::remove_dir_all(&outer).unwrap();
}
