//! The program as a user or a script meets it: exit codes, what goes to stdout, JSON against the schema.

#[path = "program/schema.rs"]
mod schema;

use frieze::image::{Encoding, Image, Pixels};
use frieze::write::{WriteOptions, image};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A folder of its own for a test, empty at first.
fn folder(name: &str) -> PathBuf {
    let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&dir);
    std::fs::create_dir_all(&dir).unwrap();
    dir
}

fn frieze_with(dir: &Path, args: &[&str], env: &[(&str, &str)]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_frieze"))
        .args(args)
        .current_dir(dir)
        .env_remove("FRIEZE_SIMD")
        .envs(env.iter().copied())
        .output()
        .unwrap()
}

fn frieze(dir: &Path, args: &[&str]) -> Output {
    frieze_with(dir, args, &[])
}

fn here() -> &'static Path {
    Path::new(env!("CARGO_TARGET_TMPDIR"))
}

fn code(o: &Output) -> i32 {
    o.status.code().expect("the program was not killed")
}

fn err(o: &Output) -> String {
    String::from_utf8_lossy(&o.stderr).into_owned()
}

fn out(o: &Output) -> String {
    String::from_utf8(o.stdout.clone()).expect("stdout is text")
}

/// The one document on stdout, checked against the committed schema.
fn json(o: &Output) -> Value {
    let text = out(o);
    let document: Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
    let schema: Value = serde_json::from_str(include_str!("../schema.json")).unwrap();
    schema::check(&schema, &schema, &document, "").unwrap_or_else(|e| panic!("{e}\n{text}"));
    document
}

/// A picture of `f(x, y)` grey, 32x24.
fn picture(dir: &Path, name: &str, f: impl Fn(u32, u32) -> u8) -> PathBuf {
    let pixels = (0..24).flat_map(|y| (0..32).map(move |x| (x, y))).flat_map(|(x, y)| [f(x, y); 3]).collect();
    let path = dir.join(name);
    let options = WriteOptions { force: true, ..WriteOptions::default() };
    image(&Image::new(32, 24, 3, Pixels::U8(pixels), Encoding::Srgb).unwrap(), &path, &options).unwrap();
    path
}

/// A model of one textured triangle.
fn triangle(dir: &Path) -> PathBuf {
    let path = dir.join("one.obj");
    std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n").unwrap();
    path
}

// ---- words and exit codes -------------------------------------------------------------------------------

#[test]
fn bad_arguments_are_exit_2() {
    let wrong: &[&[&str]] = &[
        &["nonsense"],
        &["view"],
        &["batch"],
        &["render", "--backend", "gpu"],
        &["render", "--size", "0"],
        &["render", "--size", "10xx"],
        &["render", "--samples", "3"],
        &["render", "--bits", "12"],
        &["render", "--threads", "0"],
        &["render", "--max-memory", "lots"],
        &["render", "--aov", "depth,nromal"],
        &["render", "--camera", "eye=1,2 target=0,0,0"],
        &["render", "--turntable", "0"],
        &["render", "--normal-map-scale", "2"],
        &["render", "a", "b"],
        &["render", "sample:nothing"],
        &["render", "-o", "picture.gif"],
        &["render", "-o", "picture.jpg", "--bits", "16"],
        &["render", "-o", "-", "--json"],
        &["render", "-o", "-", "--turntable", "3"],
        &["render", "-o", "-", "--aov", "depth"],
        &["compare", "a.png"],
        &["compare", "a.png", "b.png", "--fail-above", "psnr=3"],
        &["compare", "a.png", "b.png", "--fail-below", "flip=3"],
        &["compare", "a.png", "b.png", "--fail-above", "flip=-1"],
        &["explain", "sample:teapot", "--pixel", "3"],
        &["explain", "sample:wall", "--pixel", "64,3", "--size", "64x48"],
        &["explain", "sample:wall", "--pixel", "3,48", "--size", "64x48"],
        &["games101", "phong"],
        &["games101", "texture", "--mesh", "a.obj", "-o", "a.png"],
        &["games101", "normal", "--mesh", "a.obj", "-o", "-"],
        &["completions", "fsh"],
    ];
    let dir = folder("arguments");
    for args in wrong {
        let o = frieze(&dir, args);
        assert_eq!(code(&o), 2, "{args:?}: {}", err(&o));
        assert!(o.stdout.is_empty() || args.contains(&"--json"), "{args:?} talks on stdout");
        assert!(err(&o).starts_with("error: "), "{args:?}: {}", err(&o));
    }
    assert_eq!(std::fs::read_dir(&dir).unwrap().count(), 0, "nothing was written");
}

#[test]
fn later_words_say_so() {
    for (word, value) in [
        ("--bump", Some("x")),
        ("--displacement", Some("x")),
        ("--parallax", Some("x")),
        ("--environment", Some("x")),
        ("--method", Some("path")),
        ("--export-mesh", Some("x")),
        ("--exact", None),
    ] {
        let mut args = vec!["render", "sample:teapot", word];
        args.extend(value);
        let o = frieze(here(), &args);
        assert_eq!(code(&o), 2, "{word}");
        assert!(err(&o).contains(word) && err(&o).contains("later version"), "{word}: {}", err(&o));
    }
}

#[test]
fn typos_are_answered_with_the_nearest_word() {
    for (args, word) in [
        (&["render", "--aov", "dpeth"][..], "`depth`"),
        (&["render", "sample:teapto"], "`teapot`"),
        (&["render", "--camera", "eey=1,2,3"], "`eye`"),
        (&["compare", "a", "b", "--fail-above", "flp=1"], "`flip`"),
        (&["rnder"], "'render'"),
    ] {
        let o = frieze(here(), args);
        assert!(code(&o) == 2 && err(&o).contains(word), "{args:?}: {}", err(&o));
    }
}

#[test]
fn broken_and_missing_files_are_exit_3() {
    let dir = folder("broken");
    std::fs::write(dir.join("broken.glb"), b"glTF but not really").unwrap();
    std::fs::write(dir.join("bad.png"), b"\x89PNG and then nothing").unwrap();
    for args in [
        &["render", "missing.glb"][..],
        &["render", "broken.glb"],
        &["inspect", "broken.glb"],
        &["inspect", "bad.png"],
        &["compare", "bad.png", "bad.png"],
        &["inspect", "missing.png"],
    ] {
        let o = frieze(&dir, args);
        assert_eq!(code(&o), 3, "{args:?}: {}", err(&o));
        let name = args[1];
        assert!(err(&o).contains(name), "{args:?} does not name the file: {}", err(&o));
        assert!(o.stdout.is_empty());
    }
}

#[test]
fn errors_are_documents_too() {
    let o = frieze(here(), &["render", "missing.glb", "--json"]);
    let d = json(&o);
    assert_eq!(d["ok"], false);
    assert_eq!(d["error"]["exit"], 3);
    assert_eq!(code(&o), 3);
    assert!(err(&o).starts_with("error: "), "people read stderr: {}", err(&o));
    let d = json(&frieze(here(), &["render", "--no-such-option", "--json"]));
    assert_eq!((&d["error"]["code"], &d["error"]["exit"]), (&"arguments.usage".into(), &2.into()));
}

#[test]
fn an_existing_file_is_kept() {
    let dir = folder("keep");
    let model = triangle(&dir);
    std::fs::write(dir.join("one.png"), b"precious").unwrap();
    let o = frieze(&dir, &["render", model.to_str().unwrap(), "--json"]);
    assert_eq!(code(&o), 2, "{}", err(&o));
    assert_eq!(json(&o)["error"]["code"], "write.exists");
    assert_eq!(std::fs::read(dir.join("one.png")).unwrap(), b"precious");
    // A folder that is not there cannot be written to.
    let o = frieze(&dir, &["render", model.to_str().unwrap(), "-o", "no/such/folder.png"]);
    assert_eq!(code(&o), 5, "{}", err(&o));
}

// ---- version, SIMD, help --------------------------------------------------------------------------------

#[test]
fn version_lists_simd_levels() {
    let o = frieze(here(), &["--version"]);
    assert_eq!((code(&o), out(&o)), (0, format!("frieze {}\n", env!("CARGO_PKG_VERSION"))));
    let d = json(&frieze(here(), &["--version", "--json"]));
    let levels = d["simd"]["available"].as_array().unwrap();
    assert_eq!(levels[0], "scalar");
    assert_eq!(levels.last(), Some(&d["simd"]["chosen"]));
}

#[test]
fn frieze_simd_forces_a_level_or_is_exit_2() {
    let d = json(&frieze_with(here(), &["--version", "--json"], &[("FRIEZE_SIMD", "scalar")]));
    assert_eq!(d["simd"]["chosen"], "scalar");
    let o = frieze_with(here(), &["render"], &[("FRIEZE_SIMD", "avx3")]);
    assert_eq!(code(&o), 2);
    assert!(err(&o).contains("`avx3`") && err(&o).contains("scalar"), "{}", err(&o));
    let foreign = if cfg!(target_arch = "aarch64") { "avx2" } else { "neon" };
    let o = frieze_with(here(), &["inspect", "sample:teapot"], &[("FRIEZE_SIMD", foreign)]);
    assert!(code(&o) == 2 && err(&o).contains("lacks") && err(&o).contains("scalar"), "{}", err(&o));
}

#[test]
fn help_has_examples_and_goes_to_stdout() {
    for verb in ["render", "compare", "convert", "inspect", "explain", "games101", "completions", "man"] {
        let o = frieze(here(), &[verb, "--help"]);
        assert!(code(&o) == 0 && out(&o).contains("Examples:") && o.stderr.is_empty(), "{verb}");
        let short = frieze(here(), &[verb, "-h"]);
        assert!(!out(&short).contains("Examples:") && out(&short).len() < out(&o).len(), "{verb} -h");
        assert!(!out(&o).contains('\x1b'), "no colour where there is no terminal");
    }
}

#[test]
fn color_obeys_flag_and_environment() {
    let red = "\x1b[31;1m";
    assert!(!err(&frieze(here(), &["render", "sample:x"])).contains(red));
    assert!(err(&frieze(here(), &["render", "sample:x", "--color", "always"])).contains(red));
    let o = frieze_with(here(), &["render", "sample:x"], &[("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")]);
    assert!(!err(&o).contains(red));
}

#[test]
fn completions_man_pages_and_schema() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let o = frieze(here(), &["completions", shell]);
        assert!(code(&o) == 0 && out(&o).contains("turntable"), "{shell}");
    }
    let dir = folder("man");
    let d = json(&frieze(&dir, &["man", "-o", "pages", "--json"]));
    assert!(d["outputs"].as_array().unwrap().len() >= 9);
    let page = std::fs::read_to_string(dir.join("pages/frieze-render.1")).unwrap();
    assert!(page.contains(".TH") && page.contains("turntable"));
    assert_eq!(code(&frieze(&dir, &["man", "-o", "pages"])), 2, "pages are kept");
    assert_eq!(code(&frieze(&dir, &["man", "-o", "pages", "--force", "--quiet"])), 0);
    let schema: Value = serde_json::from_str(&out(&frieze(here(), &["schema"]))).unwrap();
    assert!(schema["$defs"]["render"]["properties"]["bench"].is_object());
}

#[test]
fn samples_are_listed() {
    let text = out(&frieze(here(), &["samples"]));
    let d = json(&frieze(here(), &["samples", "--json"]));
    for name in
        "frieze teapot wall mirrored-head cubes ground spheres cup flat-gouraud-phong stress-250k stress-5m".split(' ')
    {
        let name = format!("sample:{name}");
        assert!(text.contains(&name), "{name}");
        assert!(d["samples"].as_array().unwrap().iter().any(|s| s["name"] == *name), "{name}");
    }
}

#[test]
fn overlays_are_drawn_and_typos_are_answered() {
    let dir = folder("overlay");
    let run = |name: &str, more: &[&str]| {
        let args = [&["render", "sample:mirrored-head", "--size", "48x54", "-o", name, "--json"], more].concat();
        json(&frieze(&dir, &args));
        std::fs::read(dir.join(name)).unwrap()
    };
    let plain = run("plain.png", &[]);
    let mut seen = vec![plain];
    for (k, word) in ["normals", "map-normals", "tbn", "wire", "uv-seams"].iter().enumerate() {
        let bytes = run(&format!("{k}.png"), &["--overlay", word]);
        assert!(!seen.contains(&bytes) || *word == "uv-seams", "{word} shows nothing of its own");
        seen.push(bytes);
    }
    let long = run("long.png", &["--overlay", "tbn", "--overlay-length", "1", "--overlay-width", "3"]);
    assert!(!seen.contains(&long));
    let o = frieze(&dir, &["render", "sample:wall", "--overlay", "wiers", "-o", "x.png"]);
    assert!(code(&o) == 2 && err(&o).contains("`wire`"), "{}", err(&o));
    assert_eq!(code(&frieze(&dir, &["render", "sample:wall", "--overlay-length", "1", "-o", "x.png"])), 2);
    // What does not fit is told, and is in the document.
    std::fs::write(dir.join("ball.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let args = ["render", "ball.obj", "--normal-map", "plain.png", "--size", "16", "-o", "b.png", "--json"];
    let o = frieze(&dir, &args);
    let d = json(&o);
    assert!(d["findings"].as_array().unwrap().iter().any(|f| f["code"] == "tangent.no-uv"), "{d}");
    assert!(err(&o).contains("tangent.no-uv"));
}

// ---- compare --------------------------------------------------------------------------------------------

#[test]
fn compare_measures_and_checks() {
    let dir = folder("compare");
    picture(&dir, "a.png", |x, _| (x * 8) as u8);
    picture(&dir, "b.png", |x, y| (x * 8) as u8 + 5 * u8::from(x == 3 && y == 3));
    let d = json(&frieze(&dir, &["compare", "a.png", "a.png", "--json"]));
    assert_eq!(d["identical"], true);
    assert!(d["metrics"]["psnr"].is_null() && d["metrics"]["flip"] == 0.0);
    let d = json(&frieze(&dir, &["compare", "a.png", "b.png", "--json"]));
    assert_eq!(d["identical"], false);
    // 5 of 255, read as f32.
    assert!((d["metrics"]["max"].as_f64().unwrap() - 5.0 / 255.0).abs() < 1e-6);
    assert!(d["metrics"].get("angle").is_none());

    let o = frieze(&dir, &["compare", "a.png", "b.png", "--fail-above", "max=0", "--json"]);
    assert_eq!(code(&o), 1);
    let d = json(&o);
    assert_eq!((&d["ok"], &d["passed"], &d["checks"][0]["passed"]), (&false.into(), &false.into(), &false.into()));
    assert!(err(&o).contains("max is 0.0196"), "{}", err(&o));
    let pass = ["compare", "a.png", "b.png", "--fail-above", "max=0.02", "--fail-below", "psnr=30"];
    assert_eq!(code(&frieze(&dir, &pass)), 0);
    let fail = ["compare", "a.png", "b.png", "--fail-below", "psnr=99", "--quiet"];
    let o = frieze(&dir, &fail);
    assert_eq!((code(&o), out(&o)), (1, String::new()), "quiet prints nothing but the error");
    assert!(err(&o).starts_with("error: psnr is ") && err(&o).contains("compare.differs"), "{}", err(&o));
    let o = frieze(&dir, &["compare", "a.png", "b.png", "--quiet"]);
    assert_eq!((code(&o), out(&o), err(&o)), (0, String::new(), String::new()));
    let same = ["compare", "a.png", "a.png", "--fail-below", "psnr=99", "--fail-above", "flip=0"];
    assert_eq!(code(&frieze(&dir, &same)), 0);
    let one = json(&frieze(&dir, &["compare", "a.png", "b.png", "--metrics", "rmse", "--json"]));
    assert_eq!(one["metrics"].as_object().unwrap().keys().collect::<Vec<_>>(), ["rmse"]);
}

#[test]
fn compare_writes_a_heat_map_and_keeps_files() {
    let dir = folder("heat");
    picture(&dir, "a.png", |_, _| 0);
    picture(&dir, "b.png", |x, _| if x < 16 { 0 } else { 255 });
    let o = frieze(&dir, &["compare", "a.png", "b.png", "-o", "heat.png"]);
    assert_eq!(code(&o), 0, "{}", err(&o));
    let d = json(&frieze(&dir, &["inspect", "heat.png", "--json"]));
    assert_eq!((&d["image"]["width"], &d["image"]["height"]), (&32.into(), &24.into()));
    assert_eq!(code(&frieze(&dir, &["compare", "a.png", "b.png", "-o", "heat.png"])), 2);
    assert_eq!(code(&frieze(&dir, &["compare", "a.png", "b.png", "-o", "heat.png", "--force"])), 0);
}

#[test]
fn pictures_of_different_sizes_are_exit_3() {
    let dir = folder("sizes");
    picture(&dir, "a.png", |_, _| 0);
    let small = Image::new(1, 1, 1, Pixels::U8(vec![0]), Encoding::Srgb).unwrap();
    image(&small, &dir.join("b.png"), &WriteOptions::default()).unwrap();
    let o = frieze(&dir, &["compare", "a.png", "b.png", "--json"]);
    assert_eq!((code(&o), &json(&o)["error"]["code"]), (3, &"compare.size".into()));
}

#[test]
fn normal_maps_are_compared_by_angle_when_named_so() {
    let dir = folder("normals");
    picture(&dir, "a_normal.png", |x, _| (x * 8) as u8);
    picture(&dir, "b_normal.png", |x, y| (x * 8) as u8 + (y % 2) as u8);
    let d = json(&frieze(&dir, &["compare", "a_normal.png", "b_normal.png", "--json"]));
    assert!(d["metrics"]["angle"]["max"].is_number());
}

// ---- inspect --------------------------------------------------------------------------------------------

#[test]
fn inspect_counts() {
    let dir = folder("inspect");
    triangle(&dir);
    let d = json(&frieze(&dir, &["inspect", "one.obj", "--json"]));
    assert_eq!(d["scene"]["totals"]["triangles"], 1);
    assert_eq!(d["scene"]["meshes"][0]["vertices"], 3);
    let o = frieze(&dir, &["inspect", "one.obj"]);
    assert!(out(&o).contains("1 triangle in 1 object of 1 mesh, 3 vertices, 0."), "{}", out(&o));
    json(&frieze(&dir, &["inspect", "sample:teapot", "--json"]));
}

#[test]
fn normal_maps_are_inspected_and_mended() {
    let dir = folder("mend");
    // Dimples 16 pixels apart, green down.
    let mut texels = Vec::new();
    for k in 0..96 * 96 {
        let [x, y] = [k % 96, k / 96].map(|v| f32::from((v % 16) as u8) / 8.0 - 1.0);
        let k = if x * x + y * y < 0.8 { 0.6 } else { 0.0 };
        let (nx, ny) = (x * k, -y * k);
        texels.extend([nx, -ny, (1.0 - nx * nx - ny * ny).sqrt()].map(|v| (v * 127.5 + 128.0) as u8));
    }
    let map = Image::new(96, 96, 3, Pixels::U8(texels), Encoding::Linear).unwrap();
    image(&map, &dir.join("n.png"), &WriteOptions::default()).unwrap();
    let d = json(&frieze(&dir, &["inspect", "n.png", "--json"]));
    let e = &d["image"]["normal_map"]["evidence"];
    assert_eq!((e["green"]["value"].as_str(), e["space"]["value"].as_str()), (Some("down"), Some("tangent")));
    let o = frieze(&dir, &["inspect", "n.png"]);
    assert!(out(&o).contains("-Y, DirectX") && out(&o).contains("curl"), "{}", out(&o));
    let d = json(&frieze(&dir, &["convert", "n.png", "-o", "up.png", "--fix", "auto", "--json"]));
    assert_eq!(d["steps"][0]["fix"], "flip-y", "{d}");
    let d = json(&frieze(&dir, &["inspect", "up.png", "--json"]));
    assert_eq!(d["image"]["normal_map"]["green"], "up");
    // Nothing is left to do.
    let d = json(&frieze(&dir, &["convert", "up.png", "-o", "same.png", "--fix", "auto", "--json"]));
    assert_eq!(d["steps"].as_array().unwrap().len(), 0, "{d}");
    let o = frieze(&dir, &["convert", "n.png", "-o", "two.png", "--fix", "flip-y,normalize"]);
    assert!(code(&o) == 0 && err(&o).contains("flip-y"), "{}", err(&o));
    assert_eq!(code(&frieze(&dir, &["convert", "n.png", "-o", "two.png", "--fix", "flip-y"])), 2, "it is there");
    assert_eq!(code(&frieze(&dir, &["convert", "n.png", "-o", "3.png", "--fix", "flip"])), 2);
    picture(&dir, "grey.png", |x, _| x as u8);
    assert_eq!(code(&frieze(&dir, &["convert", "grey.png", "-o", "4.png", "--fix", "auto"])), 3);
    let d = json(&frieze(&dir, &["inspect", "n.png", "--mesh", "sample:spheres", "--json"]));
    assert_eq!(d["basis"]["fits"].as_array().unwrap().len(), 8);
    let o = frieze(&dir, &["inspect", "n.png", "--mesh", "sample:spheres"]);
    assert!(out(&o).contains("mikktspace"), "{}", out(&o));
}

#[test]
fn what_is_no_model_is_told_by_its_name() {
    let dir = folder("unknown-file");
    picture(&dir, "tex.png", |x, _| x as u8);
    std::fs::write(dir.join("notes.txt"), [b'x'; 300]).unwrap();
    std::fs::write(dir.join("cut.stl"), [b'x'; 300]).unwrap();
    std::fs::write(dir.join("far.obj"), "v 0 0 0\nv 1e30 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    for (file, word) in [
        ("tex.png", "this is a PNG picture, not a model"),
        ("notes.txt", "not a model that frieze knows"),
        ("cut.stl", "the STL header promises"),
        ("far.obj", "far.obj"),
        (".", "this is a folder"),
        ("-", "stdin is not read"),
    ] {
        let o = frieze(&dir, &["render", file, "--size", "8", "-o", "out.png"]);
        assert!(code(&o) == 3 && err(&o).contains(word), "{file}: {}", err(&o));
        assert!(!err(&o).contains("projection") && !dir.join("out.png").exists(), "{file}: {}", err(&o));
    }
    // What is far, but within reach, is shown.
    std::fs::write(dir.join("large.obj"), "v 0 0 0\nv 9e17 0 0\nv 0 9e17 0\nf 1 2 3\n").unwrap();
    let o = frieze(&dir, &["render", "large.obj", "--size", "8", "-o", "out.png"]);
    assert_eq!(code(&o), 0, "{}", err(&o));
}

#[test]
fn explain_tells_why_a_pixel_has_its_colour() {
    let dir = folder("explain");
    assert_eq!(code(&frieze(&dir, &["render", "sample:cubes", "--size", "64x48", "-o", "p.png"])), 0);
    let picture = frieze::load::image(&dir.join("p.png"), &Default::default()).unwrap().0;
    let Pixels::U8(bytes) = picture.pixels() else { panic!("8 bits") };
    let channels = picture.channels();
    for (x, y) in [(30, 24), (12, 40), (32, 20)] {
        let pixel = format!("{x},{y}");
        let args = ["explain", "sample:cubes", "--size", "64x48", "--pixel", &pixel];
        let d = json(&frieze(&dir, &[&args[..], &["--json"]].concat()));
        let encoded = d["explanation"]["color"]["encoded"].as_array().unwrap();
        for c in 0..3 {
            assert_eq!(encoded[c], bytes[(y * 64 + x) * channels + c], "{pixel}");
        }
        let o = frieze(&dir, &args);
        assert_eq!(code(&o), 0, "{}", err(&o));
        for word in ["barycentrics", "mip level", "texels read", "n.l", "shadow map", "tone mapped", "8-bit picture"] {
            assert!(out(&o).contains(word), "{word}: {}", out(&o));
        }
    }
    triangle(&dir);
    let o = frieze(&dir, &["explain", "one.obj", "--size", "64", "--pixel", "0,0"]);
    assert!(code(&o) == 0 && out(&o).contains("background"), "{}", out(&o));
    let d = json(&frieze(&dir, &["explain", "one.obj", "--size", "64", "--pixel", "0,0", "--json"]));
    assert_eq!(d["explanation"]["background_only"], true);
    let o = frieze(&dir, &["explain", "one.obj", "--size", "64", "--pixel", "64,0"]);
    assert!(code(&o) == 2 && err(&o).contains("64x64") && err(&o).contains("help"), "{}", err(&o));
}

#[test]
fn memory_limits_are_exit_4() {
    let dir = folder("memory");
    picture(&dir, "a.png", |_, _| 0);
    let o = frieze(&dir, &["compare", "a.png", "a.png", "--max-memory", "100"]);
    assert_eq!(code(&o), 4, "{}", err(&o));
    assert!(err(&o).contains("--max-memory"));
}

// ---- games101 -------------------------------------------------------------------------------------------

#[test]
fn games101_draws() {
    let dir = folder("games101");
    triangle(&dir);
    let d = json(&frieze(&dir, &["games101", "normal", "--mesh", "one.obj", "-o", "n.png", "--json"]));
    assert_eq!(d["size"], serde_json::json!([700, 700]));
    assert_eq!(json(&frieze(&dir, &["inspect", "n.png", "--json"]))["image"]["width"], 700);
    assert_eq!(code(&frieze(&dir, &["games101", "normal", "--mesh", "one.obj", "-o", "n.png"])), 2);
}

// ---- render: these need the renderer ----------------------------------------------------------------------

#[test]
fn render_writes_where_it_says() {
    let dir = folder("render");
    triangle(&dir);
    let o = frieze(&dir, &["render", "one.obj", "--size", "64x48", "--json"]);
    assert_eq!(code(&o), 0, "{}", err(&o));
    let d = json(&o);
    assert_eq!(d["outputs"], serde_json::json!(["one.png"]));
    assert_eq!(d["size"], serde_json::json!([64, 48]));
    assert!(d.get("bench").is_none());
    let again = frieze(&dir, &["render", "one.obj", "--size", "64x48"]);
    assert_eq!(code(&again), 2);
    let o = frieze(&dir, &["render", "one.obj", "--size", "64x48", "--force", "--quiet"]);
    assert_eq!((code(&o), o.stdout.len(), err(&o)), (0, 0, String::new()));
    let o = frieze(&dir, &["render", "one.obj", "--size", "8", "--force"]);
    assert!(err(&o).contains("one.png") && o.stdout.is_empty(), "{}", err(&o));
}

#[test]
fn stdout_takes_one_png_and_nothing_else() {
    let dir = folder("stdout");
    triangle(&dir);
    let o = frieze(&dir, &["render", "one.obj", "--size", "16", "-o", "-"]);
    assert_eq!(code(&o), 0, "{}", err(&o));
    assert!(o.stdout.starts_with(b"\x89PNG\r\n\x1a\n") && o.stdout.ends_with(b"IEND\xaeB`\x82"));
    assert_eq!(std::fs::read_dir(&dir).unwrap().count(), 1, "only the model is there");
    // The file has the same bytes.
    assert_eq!(code(&frieze(&dir, &["render", "one.obj", "--size", "16"])), 0);
    assert_eq!(std::fs::read(dir.join("one.png")).unwrap(), o.stdout);
}

#[test]
fn the_showpiece_may_overwrite_its_own_picture_only() {
    let dir = folder("showpiece");
    for _ in 0..2 {
        let o = frieze(&dir, &["render", "--size", "32"]);
        assert_eq!(code(&o), 0, "{}", err(&o));
    }
    assert_eq!(code(&frieze(&dir, &["render", "sample:frieze", "--size", "32"])), 2);
    assert_eq!(code(&frieze(&dir, &["render", "-o", "frieze.png", "--size", "32"])), 2);
}

#[test]
fn bench_reports_what_the_contract_says() {
    let dir = folder("bench");
    triangle(&dir);
    let o = frieze(&dir, &["render", "one.obj", "--size", "32", "--quiet", "--bench", "3", "--json"]);
    assert_eq!(code(&o), 0, "{}", err(&o));
    let b = &json(&o)["bench"];
    assert_eq!(b["frames"], 3);
    assert!(b["median_ms"].as_f64().unwrap() >= b["min_ms"].as_f64().unwrap());
    assert!(b["simd"].is_string() && (cfg!(not(unix)) || b["cpu_ms"].is_number()));
    assert!(!b["counters"].as_object().unwrap().is_empty());
}

// Row 111: black near the light, white far, linear codes, in every kind of file.
#[test]
fn the_depth_map_of_a_light_is_a_picture() {
    let dir = folder("light-depth");
    let scene = "version = 1\n[[light]]\nkind = \"directional\"\nposition = [0, 5, 0]\ntarget = [0, 0, 0]\n\
        shadow = { size = 50, near = 1.0, far = 6.0, extent = 2.0 }\n\
        [[light]]\nkind = \"directional\"\nposition = [1, 5, 0]\nshadow = false\n\
        [[object]]\nmesh = { primitive = \"plane\", size = 2.0 }\ntranslate = [0, 3, 0]\n";
    std::fs::write(dir.join("lid.toml"), scene).unwrap();
    for (name, bits, slack) in [("d.png", "8", 0.5 / 255.0), ("d16.png", "16", 0.5 / 65535.0), ("d.exr", "8", 0.0)] {
        let args = ["render", "lid.toml", "--light-depth", "0", "-o", name, "--bits", bits, "--json"];
        let o = frieze(&dir, &args);
        assert_eq!(code(&o), 0, "{}", err(&o));
        assert_eq!(json(&o)["size"], serde_json::json!([50, 50]));
        let map = frieze::load::image(&dir.join(name), &Default::default()).unwrap().0;
        assert_eq!((map.width(), map.height()), (50, 50), "{name}");
        // The lid, 2 m below the light, is the middle half of the map: (2 - 1) / (6 - 1).
        for (x, y, want) in [(25, 25, 0.2), (13, 36, 0.2), (5, 25, 1.0), (25, 44, 1.0)] {
            // Rounding to the file's codes, and of single precision.
            assert!((map.value(x, y, 0) - want).abs() <= slack + 1e-6, "{name} {x},{y}: {}", map.value(x, y, 0));
        }
    }
    let o = frieze(&dir, &["render", "lid.toml", "--light-depth", "0", "-o", "-"]);
    assert_eq!(o.stdout, std::fs::read(dir.join("d.png")).unwrap());
    for (light, word) in [("1", "no shadow map"), ("2", "0 to 1"), ("sun", "no light is `sun`")] {
        let o = frieze(&dir, &["render", "lid.toml", "--light-depth", light, "-o", "x.png"]);
        assert!(code(&o) == 2 && err(&o).contains(word), "{light}: {}", err(&o));
    }
    assert_eq!(code(&frieze(&dir, &["render", "lid.toml", "--light-depth", "0", "--size", "9"])), 2);
}

#[test]
fn turntables_are_numbered() {
    let dir = folder("turntable");
    triangle(&dir);
    let d = json(&frieze(&dir, &["render", "one.obj", "--size", "16", "--turntable", "3", "-o", "t.png", "--json"]));
    assert_eq!(d["outputs"], serde_json::json!(["t.000.png", "t.001.png", "t.002.png"]));
    assert_eq!(code(&frieze(&dir, &["render", "one.obj", "--size", "16", "--turntable", "2", "-o", "t.png"])), 2);
}

#[test]
fn threads_and_levels_do_not_change_the_picture() {
    let dir = folder("same");
    triangle(&dir);
    let png = |threads: &str, level: &str| {
        let args = ["render", "one.obj", "--size", "33x17", "-o", "-", "--threads", threads];
        let o = frieze_with(&dir, &args, &[("FRIEZE_SIMD", level)]);
        assert_eq!(code(&o), 0, "{}", err(&o));
        o.stdout
    };
    let one = png("1", "scalar");
    assert_eq!(one, png("3", ""));
}

#[test]
fn one_off_maps_and_preview() {
    let dir = folder("maps");
    triangle(&dir);
    picture(&dir, "red.png", |x, _| (x * 8) as u8);
    let args = ["render", "one.obj", "--size", "16", "--albedo", "red.png", "--albedo-scale", "0.5", "-o", "a.png"];
    assert_eq!(code(&frieze(&dir, &args)), 0);
    let o = frieze(&dir, &["render", "one.obj", "--size", "16", "--preview", "-o", "p.png"]);
    assert!(code(&o) == 0 && err(&o).contains('▀') && o.stdout.is_empty());
    assert_eq!(code(&frieze(&dir, &["render", "one.obj", "--normal-map", "gone.png", "-o", "b.png"])), 3);
}
