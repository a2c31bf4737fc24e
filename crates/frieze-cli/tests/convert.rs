//! `frieze convert` as a user or a script meets it.

#[path = "program/schema.rs"]
mod schema;

use frieze::image::{Encoding, Image, Pixels};
use frieze::load::{LoadOptions, image as read};
use frieze::write::{WriteOptions, image as write};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn folder(name: &str) -> PathBuf {
    let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("convert-{name}"));
    let _ = std::fs::remove_dir_all(&dir);
    std::fs::create_dir_all(&dir).unwrap();
    dir
}

fn frieze(dir: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_frieze"));
    command.arg("convert").args(args).current_dir(dir).env_remove("FRIEZE_SIMD").output().unwrap()
}

fn code(o: &Output) -> i32 {
    o.status.code().expect("the program was not killed")
}

fn err(o: &Output) -> String {
    String::from_utf8_lossy(&o.stderr).into_owned()
}

/// The document of a run that went well, checked against the committed schema.
fn json(dir: &Path, args: &[&str]) -> Value {
    let mut args = args.to_vec();
    args.push("--json");
    let o = frieze(dir, &args);
    assert_eq!(code(&o), 0, "{args:?}: {}", err(&o));
    let document: Value = serde_json::from_slice(&o.stdout).unwrap();
    let schema: Value = serde_json::from_str(include_str!("../schema.json")).unwrap();
    schema::check(&schema, &schema, &document, "").unwrap_or_else(|e| panic!("{e}"));
    document
}

fn map(dir: &Path, name: &str) -> Image {
    read(&dir.join(name), &LoadOptions { allow_outside: true, ..Default::default() }).unwrap().0
}

/// A ramp of 16 bits that climbs by 64 codes per texel to the right.
fn ramp(dir: &Path) {
    let codes = (0..24 * 32u32).map(|k| (k % 32 * 64) as u16).collect();
    let image = Image::new(32, 24, 1, Pixels::U16(codes), Encoding::Linear).unwrap();
    write(&image, &dir.join("height.png"), &WriteOptions::default()).unwrap();
}

fn codes(document: &Value) -> Vec<String> {
    let all = document["findings"].as_array().unwrap();
    all.iter().map(|f| f["code"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn heights_become_normals_and_heights_again() {
    let dir = folder("there-and-back");
    ramp(&dir);
    // 64 of 65535 codes are half a texel.
    let strength = (65535.0 / 128.0).to_string();
    let d = json(&dir, &["height.png", "-o", "n.png", "--to", "normal", "--strength", &strength]);
    assert_eq!((&d["from"], &d["to"], &d["depth"]), (&"height".into(), &"normal".into(), &"16".into()));
    let made = map(&dir, "n.png");
    let [x, y, z] = [0, 1, 2].map(|c| made.value(31, 12, c) * 2.0 - 1.0);
    // The slope is 1/2, one-sided at the edge; half a code of 16 bits.
    assert!((x + 0.5 / 1.25f32.sqrt()).abs() < 3e-5 && y.abs() < 3e-5 && (z - 1.0 / 1.25f32.sqrt()).abs() < 3e-5);
    let d = json(&dir, &["n.png", "-o", "h.exr", "--to", "height"]);
    assert_eq!(d["from"], "normal");
    let back = map(&dir, "h.exr");
    assert!((back.value(31, 3, 0) - back.value(0, 3, 0) - 15.5).abs() < 2e-3);
    // As 16 bits, the report says what the codes mean.
    let d = json(&dir, &["n.png", "-o", "h.png", "--to", "height"]);
    let (strength, midlevel) = (d["figures"]["strength"].as_f64().unwrap(), d["figures"]["midlevel"].as_f64().unwrap());
    assert!((strength - 15.5).abs() < 0.01 && (midlevel - 0.5).abs() < 0.01);
    // The same slope in metres: a texel of 2 mm, the full range of 1.024 m.
    json(&dir, &["height.png", "-o", "m.png", "--to", "normal", "--texel-size", "0.002", "--amplitude", "1.02398437"]);
    assert!((map(&dir, "m.png").value(9, 9, 0) - made.value(9, 9, 0)).abs() < 3e-5);
}

#[test]
fn conventions_depths_and_blocks() {
    let dir = folder("conventions");
    ramp(&dir);
    let to = |out: &str, more: &[&str]| json(&dir, &[&["height.png", "-o", out, "--to", "normal"], more].concat());
    assert!(codes(&to("n.png", &[])).contains(&"convert.strength".to_owned()));
    to("n8.png", &["--strength", "400", "--depth", "8"]);
    to("n8-plain.png", &["--strength", "400", "--depth", "8", "--no-dither"]);
    to("n.exr", &["--strength", "400", "--kernel", "spline"]);
    assert!(matches!(map(&dir, "n8.png").pixels(), Pixels::U8(_)));
    assert!(matches!(map(&dir, "n.exr").pixels(), Pixels::F32(_)));
    assert_ne!(map(&dir, "n8.png"), map(&dir, "n8-plain.png"));
    let d = json(&dir, &["n.exr", "-o", "down.exr", "--to", "normal", "--y", "down"]);
    assert_eq!(d["from"], "normal");
    let (up, down) = (map(&dir, "n.exr").value(5, 5, 1), map(&dir, "down.exr").value(5, 5, 1));
    assert!((up + down - 1.0).abs() < 1e-6);
    json(&dir, &["n.exr", "-o", "both.png", "--to", "normal", "--with", "n.exr"]);
    for kind in ["derivative", "curvature"] {
        assert_eq!(
            json(&dir, &["height.png", "-o", &format!("{kind}.png"), "--to", kind, "--strength", "4"])["to"],
            kind
        );
    }
    for kind in ["bc5", "bc7", "ktx2"] {
        let out = format!("{kind}.ktx2");
        let d = json(&dir, &["n.exr", "-o", &out, "--to", kind]);
        let bytes = std::fs::read(dir.join(&out)).unwrap();
        assert!(bytes.starts_with(b"\xabKTX 20\xbb\r\n\x1a\n") && bytes.len() > 8 * 6 * 16);
        assert!(kind == "ktx2" || d["figures"]["angle_max"].as_f64().unwrap() < 0.5, "{d}");
    }
}

#[test]
fn a_mesh_turns_a_map_to_object_space_and_back() {
    let dir = folder("space");
    ramp(&dir);
    // A square that faces +X; its u grows to -Z.
    let square = "v 0 0 1\nv 0 0 -1\nv 0 2 -1\nv 0 2 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";
    std::fs::write(dir.join("square.obj"), square).unwrap();
    std::fs::write(dir.join("bare.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    json(&dir, &["height.png", "-o", "n.exr", "--to", "normal", "--strength", "400"]);
    let d = json(&dir, &["n.exr", "-o", "object.exr", "--to", "object", "--mesh", "square.obj"]);
    assert_eq!((&d["to"], d["figures"]["covered"].as_f64()), (&"object".into(), Some(1.0)));
    let (n, object) = (map(&dir, "n.exr"), map(&dir, "object.exr"));
    assert!((object.value(9, 9, 0) - n.value(9, 9, 2)).abs() < 1e-5);
    assert!((object.value(9, 9, 2) - (1.0 - n.value(9, 9, 0))).abs() < 1e-5);
    json(&dir, &["object.exr", "-o", "back.exr", "--to", "tangent", "--mesh", "square.obj"]);
    assert!((map(&dir, "back.exr").value(9, 9, 0) - n.value(9, 9, 0)).abs() < 1e-5);
    for (args, exit, word) in [
        (&["n.exr", "-o", "o.png", "--to", "object"][..], 2, "--mesh"),
        (&["n.exr", "-o", "o.png", "--to", "normal", "--mesh", "square.obj"], 2, "--mesh"),
        (&["n.exr", "-o", "o.png", "--to", "object", "--mesh", "bare.obj"], 3, "convert.mesh-uv"),
        (&["n.exr", "-o", "o.png", "--to", "object", "--mesh", "missing.obj"], 3, "missing.obj"),
    ] {
        let o = frieze(&dir, args);
        assert!(code(&o) == exit && err(&o).contains(word), "{args:?}: {} {}", code(&o), err(&o));
    }
}

#[test]
fn what_cannot_be_done_is_said() {
    let dir = folder("errors");
    ramp(&dir);
    write(
        &Image::new(8, 8, 1, Pixels::U8(vec![7; 64]), Encoding::Linear).unwrap(),
        &dir.join("flat.png"),
        &WriteOptions::default(),
    )
    .unwrap();
    assert_eq!(codes(&json(&dir, &["flat.png", "-o", "f.png", "--to", "normal", "--strength", "1"])), ["convert.flat"]);
    std::fs::write(dir.join("broken.png"), b"\x89PNG and then nothing").unwrap();
    std::fs::write(dir.join("there.png"), b"precious").unwrap();
    for (args, exit, word) in [
        (&["height.png", "-o", "n.png", "--to", "nromal"][..], 2, "normal"),
        (&["height.png", "-o", "n.png", "--to", "normal", "--depth", "f32"], 2, "write.depth"),
        (&["height.png", "-o", "n.jpg", "--to", "normal"], 2, "write.format"),
        (&["height.png", "-o", "n.png", "--to", "bc5"], 2, "write.format"),
        (&["height.png", "-o", "n.png", "--to", "cone"], 2, "later version"),
        (&["height.png", "-o", "n.png", "--to", "normal", "--amplitude", "2"], 2, "--texel-size"),
        (&["height.png", "-o", "n.png", "--to", "normal", "--texel-size", "0"], 2, "above 0"),
        (&["height.png", "-o", "n.png", "--to", "normal", "--channel", "a"], 2, "convert.channel"),
        (&["height.png", "-o", "n.png", "--to", "normal", "--from", "normal"], 3, "convert.normal-channels"),
        (&["height.png", "-o", "there.png", "--to", "normal"], 2, "write.exists"),
        (&["height.png", "-o", "no/folder.png", "--to", "normal"], 5, "write.failed"),
        (&["broken.png", "-o", "n.png", "--to", "normal"], 3, "broken.png"),
        (&["height.png", "-o", "n.png", "--to", "normal", "--max-memory", "4k"], 4, "job.memory"),
    ] {
        let o = frieze(&dir, args);
        assert!(code(&o) == exit && err(&o).contains(word), "{args:?}: {} {}", code(&o), err(&o));
    }
    assert_eq!(std::fs::read(dir.join("there.png")).unwrap(), b"precious");
    assert!(!dir.join("n.png").exists());
}
