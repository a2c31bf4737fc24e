//! Files that are broken or mean harm: each gives a scene that keeps its promises, or an error; never a panic,
//! never more memory than was allowed. Law 9.

#[path = "hostile/corpus.rs"]
mod corpus;
#[path = "hostile/promises.rs"]
mod promises;

use corpus::{corpus, document, glb};
use frieze::load::{LoadOptions, Loaded, decode, load, load_bytes};
use frieze::{Job, Result};
use promises::check;
use serde_json::{Value, json};
use std::path::Path;

const BUDGET: u64 = 64 << 20;

fn options() -> LoadOptions {
    LoadOptions { job: Job::builder().threads(2).memory(BUDGET).build(), ..LoadOptions::default() }
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
fn small_files_that_ask_for_much() {
    // One picture of 16 MiB that packs to a few KiB, in a buffer that eight images share.
    let (mut json, mut bin) = document();
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, 2048, 2048);
    encoder.set_color(png::ColorType::Rgba);
    encoder.write_header().unwrap().write_image_data(&vec![7; 2048 * 2048 * 4]).unwrap();
    bin.resize(bin.len().next_multiple_of(4), 0);
    let view = json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": png.len()});
    bin.extend(&png);
    json["buffers"][0]["byteLength"] = json!(bin.len());
    json["bufferViews"].as_array_mut().unwrap().push(view);
    let list = |one: &dyn Fn(usize) -> Value| (0..8).map(one).collect::<Vec<_>>();
    json["images"] = json!(list(&|_| json!({"bufferView": 6})));
    json["textures"] = json!(list(&|k| json!({"source": k})));
    json["materials"] = json!(list(&|k| json!({"emissiveTexture": {"index": k}})));
    json["meshes"] = json!([{"primitives": list(&|k| json!({"attributes": {"POSITION": 0}, "material": k}))}]);
    let error = attempt("glb", &glb(&json, &bin), &options(), || "pictures".into()).unwrap_err();
    assert_eq!(error.code, "job.memory");

    let folder = std::env::temp_dir().join(format!("frieze-hostile-much-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("a.png"), &png).unwrap();
    let code = |name: &str, text: &str| {
        std::fs::write(folder.join(name), text).unwrap();
        load(&folder.join(name), &options()).map_or_else(|e| e.code, |_| "loaded")
    };
    let spellings = |line: &dyn Fn(usize, &str) -> String| -> String {
        (0..8).map(|k| line(k, &format!("{}a.png", "./".repeat(k)))).collect()
    };
    let maps = spellings(&|k, file| format!("newmtl m{k}\nmap_Kd {file}\n"));
    std::fs::write(folder.join("a.mtl"), maps).unwrap();
    let faces: String = (0..8).map(|k| format!("usemtl m{k}\nf 1 2 3\n")).collect();
    assert_eq!(code("a.obj", &format!("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n{faces}")), "job.memory");
    let teapot = "[[object]]\nmesh = { primitive = \"teapot\", segments = 512 }\n";
    assert_eq!(code("a.toml", teapot), "job.memory");
    let many = |kind: &str| format!("[[object]]\nmesh = {{ primitive = \"{kind}\" }}\n").repeat(500);
    assert_eq!(code("b.toml", &many("sphere")), "job.memory");
    assert_eq!(code("c.toml", &many("cube")), "loaded");
    std::fs::remove_dir_all(&folder).unwrap();
    memory_was_kept();
}

#[test]
fn pictures_that_say_to_be_more_than_they_are() {
    use exr::prelude::{AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer};
    use exr::prelude::{LayerAttributes, LineOrder, SpecificChannels, Vec2, WritableImage};
    let code = |bytes: &[u8], name: &str| {
        decode::image(bytes, Path::new(name), &options().job).map_or_else(|e| e.code, |_| "decoded")
    };
    let riff = |chunks: &[(&[u8; 4], u32, &[u8])]| {
        let mut out = b"WEBP".to_vec();
        for (kind, size, data) in chunks {
            out.extend(*kind);
            out.extend(size.to_le_bytes());
            out.extend(*data);
        }
        [&b"RIFF"[..], &(out.len() as u32).to_le_bytes(), &out].concat()
    };
    // A canvas of one pixel.
    let head = |flags: u8| [flags, 0, 0, 0, 0, 0, 0, 0, 0, 0];
    // A colour profile of 1.2 GiB in a file of 100 bytes.
    let profile = riff(&[(b"VP8X", 10, &head(0x20)), (b"ICCP", 1_278_758_998, &[0; 50])]);
    assert_eq!(code(&profile, "a.webp"), "image.corrupt");
    // A lossy frame of 16383x16383, alone and in an animation.
    let frame = [0x30, 1, 0, 0x9d, 1, 0x2a, 0xff, 0x3f, 0xff, 0x3f, 0, 0, 0, 0];
    assert_eq!(code(&riff(&[(b"VP8X", 10, &head(0)), (b"VP8 ", 14, &frame)]), "a.webp"), "job.memory");
    let inner = [&[0; 16][..], b"VP8 ", &14u32.to_le_bytes(), &frame].concat();
    let animation = riff(&[(b"VP8X", 10, &head(2)), (b"ANIM", 6, &[0; 6]), (b"ANMF", inner.len() as u32, &inner)]);
    assert_eq!(code(&animation, "a.webp"), "job.memory");
    // So many channels that comparing their names would take minutes.
    let channel = |k: u32| AnyChannel::new(format!("{k}.Z").as_str(), FlatSamples::U32(vec![k]));
    let channels = AnyChannels::sort((0..5000).map(channel).collect());
    let mut exr = std::io::Cursor::new(Vec::new());
    Image::from_channels((1, 1), channels).write().to_buffered(&mut exr).unwrap();
    assert_eq!(code(&exr.into_inner(), "a.exr"), "image.unsupported");
    // Blocks of B44 with wrong shifts overflow in the decoder's arithmetic, which panics where that is checked.
    let b44 = Encoding { compression: Compression::B44, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let grey = |p: Vec2<usize>| (half::f16::from_f32((p.x() * 7 % 5 + p.y()) as f32),);
    let channels = SpecificChannels::build().with_channel("Y").with_pixel_fn(grey);
    let mut exr = std::io::Cursor::new(Vec::new());
    let layer = Layer::new((9, 5), LayerAttributes::named("a"), b44, channels);
    Image::from_layer(layer).write().to_buffered(&mut exr).unwrap();
    let exr = exr.into_inner();
    for at in 0..exr.len() {
        for change in [0xff, 0x55, 0x80] {
            let mut bad = exr.clone();
            bad[at] ^= change;
            code(&bad, "a.exr");
        }
    }
    memory_was_kept();
}

#[test]
fn scenes_that_leave_the_range_of_numbers() {
    let folder = std::env::temp_dir().join(format!("frieze-hostile-range-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let (mut json, bin) = document();
    let path = folder.join("a.toml");
    std::fs::write(&path, "[[object]]\nmesh = \"a.glb\"\nscale = 1e30\n").unwrap();
    // The model itself is out of reach, or only what the scene makes of it.
    for (scale, code, place) in [(1e30, "mesh.too-far", None), (1e15, "scene.range", Some("line 1"))] {
        json["nodes"][1]["scale"] = json!([scale, scale, scale]);
        std::fs::write(folder.join("a.glb"), glb(&json, &bin)).unwrap();
        let error = load(&path, &options()).unwrap_err();
        assert_eq!((error.code, error.place.as_deref()), (code, place), "{scale}");
    }
    std::fs::remove_dir_all(&folder).unwrap();
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
