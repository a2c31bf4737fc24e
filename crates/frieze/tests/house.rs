//! The laws of the house that no lint holds: which room may import which, who touches files, where `unsafe` and SIMD
//! may stand, how long a file may be. Sources are read as tokens, so that comments and strings say what they like.

#[path = "house/tokens.rs"]
mod tokens;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use tokens::{Module, Token, tokens};

/// Rooms from the ground up. A room imports lower floors only; rooms of one floor never import one another.
const FLOORS: [&[&str]; 10] = [
    // The ground that even `job` stands on.
    &["error"],
    &["job", "math"],
    &["image", "mesh"],
    &["map", "raster", "trace"],
    &["scene", "frame"],
    &["load", "write", "samples", "prepare"],
    &["shade", "bake"],
    &["render", "truth", "games101", "inspect"],
    &["explain", "proof", "gallery"],
    &["lib"],
];

/// The short names that `lib.rs` gives at `crate::`, with the room that each comes from.
const DOOR: [(&str, &str); 7] = [
    ("Error", "error"),
    ("Finding", "error"),
    ("Result", "error"),
    ("Frame", "frame"),
    ("Job", "job"),
    ("RenderOptions", "render"),
    ("Scene", "scene"),
];

/// Longest source file, lines.
const LONGEST: usize = 900;

fn floor(room: &str) -> usize {
    FLOORS
        .iter()
        .position(|rooms| rooms.contains(&room))
        .unwrap_or_else(|| panic!("room `{room}` has no floor: add it to the table, above whatever it imports"))
}

fn packages() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

/// Every source file below a folder, sorted.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut all = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                all.push(path);
            }
        }
    }
    all.sort();
    all
}

/// The library's modules without what is only compiled for tests.
fn library() -> Vec<Module> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut modules = Vec::new();
    let mut tests = BTreeSet::new();
    for path in sources(&root) {
        let relative = path.strip_prefix(&root).unwrap().with_extension("");
        let mut place: Vec<String> = relative.iter().map(|p| p.to_str().unwrap().to_owned()).collect();
        if place == ["lib"] {
            place.clear();
        }
        let mut module = Module::new(place, tokens(&std::fs::read_to_string(&path).unwrap()));
        tests.append(&mut module.test_files);
        modules.push(module);
    }
    modules.retain(|m| !tests.iter().any(|t| m.place.starts_with(t)));
    // Or the walk found nothing and every law below holds of it.
    assert!(modules.len() > 50, "{} modules", modules.len());
    modules
}

/// The room that a path leads to, seen from the crate's root.
fn room_of(path: &[String]) -> Option<&str> {
    let first = path.first()?.as_str();
    let named = DOOR.iter().find(|(name, _)| *name == first).map(|(_, room)| *room);
    named.or_else(|| first.starts_with(|c: char| c.is_lowercase()).then_some(first))
}

/// Arrows from the room of `module` that do not go down.
fn wrong_arrows(module: &Module) -> Vec<String> {
    let Some(room) = module.place.first() else { return Vec::new() };
    let mut wrong = Vec::new();
    for path in module.paths() {
        let Some(to) = room_of(&path) else {
            wrong.push(format!("{}: crate::{} leads to no room", module.name(), path.join("::")));
            continue;
        };
        if to != room && floor(to) >= floor(room) {
            wrong.push(format!(
                "{} (floor {}) imports crate::{} (floor {})",
                module.name(),
                floor(room),
                path.join("::"),
                floor(to)
            ));
        }
    }
    wrong
}

#[test]
fn law_1_arrows_only_go_down() {
    let modules = library();
    let wrong: Vec<String> = modules.iter().flat_map(wrong_arrows).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    // The reading of paths works: these arrows are known to exist.
    let arrows = |place: &[&str]| -> BTreeSet<String> {
        let module = modules.iter().find(|m| m.place == place).unwrap();
        module.paths().iter().filter_map(|p| room_of(p)).map(str::to_owned).collect()
    };
    assert!(arrows(&["render"]).is_superset(&["shade", "raster", "prepare"].map(str::to_owned).into()));
    assert!(arrows(&["load", "gltf", "node"]).contains("scene"));
}

#[test]
fn law_1_finds_arrows_of_every_spelling() {
    let wrong = |text: &str| {
        let place = ["map", "map"].map(str::to_owned).to_vec();
        wrong_arrows(&Module::new(place, tokens(text))).len()
    };
    assert_eq!(wrong("use crate::math::{vec::Vec3, lane};"), 0);
    assert_eq!(wrong("use super::filter::Filter; use super::super::image::Image;"), 0);
    assert_eq!(wrong("use crate::{math::vec, scene::{Light, Camera}, Scene};"), 3);
    assert_eq!(wrong("fn f(x: &crate::shade::Look) -> crate::raster::Target { super::super::render::render() }"), 3);
    assert_eq!(wrong("mod inner { use super::super::super::render; fn f() { super::super::map::f() } }"), 1);
    assert_eq!(wrong("// crate::render\nconst A: &str = \"crate::render\"; /* crate::render */"), 0);
    assert_eq!(wrong("#[cfg(test)] mod tests { use crate::render; } use crate::render;"), 1);
    assert_eq!(wrong("macro_rules! m { () => { $crate::render::render() } }"), 1);
    assert_eq!(wrong("pub(crate) fn f<'a>(x: &'a str) -> char { '\"' } pub(super) use crate::render;"), 1);
}

#[test]
fn law_2_bake_and_shade_never_meet() {
    for module in library() {
        for (from, to) in [("bake", "shade"), ("shade", "bake")] {
            if module.place.first().is_some_and(|room| room == from) {
                assert!(module.paths().iter().all(|p| room_of(p) != Some(to)), "{} imports {to}", module.name());
            }
        }
    }
}

#[test]
fn the_lesson_is_whole_in_one_file() {
    for module in library().iter().filter(|m| m.place.first().is_some_and(|room| room == "games101")) {
        for path in module.paths() {
            let room = room_of(&path).unwrap();
            let allowed = ["error", "job", "math", "image", "mesh", "frame", "games101"];
            assert!(allowed.contains(&room), "{} imports {room}", module.name());
        }
    }
}

#[test]
fn law_3_only_load_reads_only_write_writes_and_nobody_prints() {
    let print = ["println", "eprintln", "print", "eprint", "dbg", "stdin", "stdout", "stderr"];
    let outside = ["process", "net", "env"];
    let read = ["read", "read_dir", "read_to_string", "read_link", "open", "canonicalize", "symlink_metadata"];
    let write = ["write", "create", "create_new", "create_dir", "create_dir_all", "rename", "copy", "remove_file"];
    // (`File` alone is a word of scenes too; std's comes by way of `fs`.)
    let files = ["fs", "OpenOptions", "read_dir", "canonicalize", "is_file", "is_dir", "exists", "metadata"];
    let mut wrong = Vec::new();
    for module in library() {
        let room = module.place.first().map_or("lib", String::as_str);
        let found = |wanted: &[&str]| module.idents().find(|i| wanted.contains(i)).map(str::to_owned);
        let after = |before: &[&str], wanted: &[&str]| module.path_ends(before, wanted);
        // Macros, and the streams of std::io.
        wrong.extend(found(&print).map(|i| format!("{}: {i}: the library never prints", module.name())));
        // The process id makes the names of temporary files.
        let outside = if room == "write" { &outside[1..] } else { &outside };
        wrong.extend(after(&["std"], outside).map(|i| format!("{}: std::{i}", module.name())));
        let fault = match room {
            "load" => after(&["fs", "File", "OpenOptions"], &write).map(|i| format!("{i}: only write writes")),
            "write" => after(&["fs", "File", "OpenOptions"], &read).map(|i| format!("{i}: only load reads")),
            _ => found(&files).map(|i| format!("{i}: only load and write touch files")),
        };
        wrong.extend(fault.map(|f| format!("{}: {f}", module.name())));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn laws_4_and_5_no_unsafe_and_one_door_to_simd() {
    let mut wrong = Vec::new();
    for module in library() {
        let simd = module.idents().find(|i| *i == "fearless_simd" || i.starts_with("is_x86_feature"));
        let arch = module.path_ends(&["core", "std"], &["arch", "simd"]);
        if let Some(word) = simd.map(str::to_owned).or(arch).filter(|_| module.place != ["math", "lane"]) {
            wrong.push(format!("{}: {word}: only math/lane.rs names it", module.name()));
        }
    }
    // In every package, tests included.
    let mut folders: Vec<PathBuf> = std::fs::read_dir(packages()).unwrap().map(|e| e.unwrap().path()).collect();
    folders.push(packages().with_file_name("xtask"));
    for path in folders.iter().flat_map(|f| sources(f)) {
        let text = std::fs::read_to_string(&path).unwrap();
        if tokens(&text).contains(&Token::Ident("unsafe".into())) {
            wrong.push(format!("{}: unsafe", path.display()));
        }
        let lines = text.lines().count();
        if lines > LONGEST {
            wrong.push(format!("{}: {lines} lines, more than {LONGEST}: make it a folder", path.display()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
