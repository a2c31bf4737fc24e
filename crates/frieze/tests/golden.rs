//! Golden pictures, exact: each file of `golden/` is a scene or a lesson, each of them has a file. They change through
//! `cargo xtask golden` only (law 10).

#[path = "pictures/lessons.rs"]
mod lessons;
#[path = "pictures/scenes.rs"]
mod scenes;

use frieze::image::Image;
use frieze::load::LoadOptions;
use frieze::render::{RenderOptions, render};
use std::path::Path;

/// Most pixels along a side, and most bytes of all pictures together.
const MOST: (u32, u64) = (128, 2 << 20);

fn pixels(image: &Image) -> Vec<[u32; 4]> {
    (0..image.height()).flat_map(|y| (0..image.width()).map(move |x| image.rgba(x, y).map(f32::to_bits))).collect()
}

#[test]
fn pictures_are_as_they_were() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    let mut missing = [scenes::names(), lessons::NAMES.to_vec(), scenes::DRAWN_OVER.map(|o| o.0).to_vec()].concat();
    let mut changed = Vec::new();
    let mut bytes = 0;
    let mut paths: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|e| e.unwrap().path()).collect();
    paths.sort();
    for path in paths {
        bytes += std::fs::metadata(&path).unwrap().len();
        let name = path.file_stem().unwrap().to_str().unwrap();
        assert_eq!(path.extension().unwrap(), "png", "{}", path.display());
        assert!(missing.contains(&name), "{}: no scene is called so", path.display());
        missing.retain(|n| *n != name);
        let (expected, _) = frieze::load::image(&path, &LoadOptions::default()).unwrap();
        let size = (expected.width(), expected.height());
        assert!(size.0.max(size.1) <= MOST.0, "{}: {size:?} is large", path.display());
        let actual = if lessons::NAMES.contains(&name) {
            lessons::picture(name)
        } else {
            let (scene, overlays) = scenes::scene_with_overlays(name);
            render(&scene, &RenderOptions { size, overlays, ..Default::default() }).unwrap().color
        };
        assert_eq!(size, (actual.width(), actual.height()), "{}", path.display());
        let (a, b) = (pixels(&expected), pixels(&actual));
        let count = a.iter().zip(&b).filter(|(a, b)| a != b).count();
        if count > 0 {
            changed.push(format!("{name}: {count} of {} pixels", a.len()));
        }
    }
    assert!(missing.is_empty(), "no picture of {missing:?}: cargo xtask golden");
    assert!(changed.is_empty(), "changed: {changed:#?}\ncargo xtask golden shows how");
    assert!(bytes <= MOST.1, "{bytes} bytes of pictures");
}
