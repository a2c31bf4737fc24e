//! Golden pictures: small renders of every built-in scene and of the tests' own, kept in
//! `crates/frieze/tests/golden`. They change through this chore only (law 10), which shows
//! expected | difference | actual first.

#[path = "../../crates/frieze/tests/pictures/lessons.rs"]
mod lessons;
#[path = "../../crates/frieze/tests/pictures/scenes.rs"]
mod scenes;

use frieze::Error;
use frieze::image::{Encoding, Image, Pixels, diff};
use frieze::load::LoadOptions;
use frieze::render::{RenderOptions, render};
use frieze::write::WriteOptions;
use std::fs;
use std::path::Path;

/// Pixels along the longer side of a golden picture.
const LONGER: u32 = 128;

/// The size of a scene's golden picture, of the same shape as its own.
fn size([width, height]: [u32; 2]) -> (u32, u32) {
    let longest = width.max(height);
    (width * LONGER / longest, height * LONGER / longest)
}

/// Renders all pictures anew; without `accept`, changes are an error.
pub fn run(root: &Path, accept: bool) -> Result<(), String> {
    let said = |e: Error| e.to_string();
    let dir = root.join("crates/frieze/tests/golden");
    let review = root.join("target/golden");
    for folder in [&dir, &review] {
        fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    }
    let force = WriteOptions { force: true, ..WriteOptions::default() };
    let mut changed = Vec::new();
    for name in [scenes::names(), lessons::NAMES.to_vec(), scenes::DRAWN_OVER.map(|o| o.0).to_vec()].concat() {
        let actual = if lessons::NAMES.contains(&name) {
            lessons::picture(name)
        } else {
            let (scene, overlays) = scenes::scene_with_overlays(name);
            let options = RenderOptions { size: size(scene.output.size), overlays, ..RenderOptions::default() };
            render(&scene, &options).map_err(said)?.color
        };
        let size = (actual.width(), actual.height());
        let path = dir.join(format!("{name}.png"));
        let expected = if path.exists() {
            let (image, _) = frieze::load::image(&path, &LoadOptions::default()).map_err(said)?;
            // Bit for bit: tolerance 0.
            if same(&image, &actual) {
                println!("same     {name}");
                continue;
            }
            image
        } else {
            blank(size)
        };
        let shown = review.join(format!("{name}.png"));
        frieze::write::image(&triptych(&expected, &actual).map_err(said)?, &shown, &force).map_err(said)?;
        println!("changed  {name}: expected | difference | actual in {}", shown.display());
        if accept {
            frieze::write::image(&actual, &path, &force).map_err(said)?;
        }
        changed.push(name);
    }
    match (changed.len(), accept) {
        (0, _) => Ok(()),
        (n, true) => {
            println!("{n} golden pictures are new: look at them once more before the commit");
            Ok(())
        }
        (n, false) => Err(format!("{n} golden pictures changed; look at target/golden, then run with --accept")),
    }
}

/// Whether two pictures have the same pixels. A PNG without transparency may come back without alpha.
fn same(a: &Image, b: &Image) -> bool {
    let size = |i: &Image| (i.width(), i.height());
    size(a) == size(b) && (0..a.height()).all(|y| (0..a.width()).all(|x| a.rgba(x, y) == b.rgba(x, y)))
}

/// A grey picture, where there is no expected one.
fn blank((w, h): (u32, u32)) -> Image {
    let pixels = vec![128; w as usize * h as usize * 4];
    Image::new(w, h, 4, Pixels::U8(pixels), Encoding::Srgb).expect("four channels of that size")
}

/// Expected | difference | actual. The difference is the largest of a pixel's channels, stretched so that
/// one step of 255 can be seen.
fn triptych(expected: &Image, actual: &Image) -> Result<Image, Error> {
    let (w, h) = (actual.width(), actual.height());
    let inside = |x, y| x < expected.width() && y < expected.height();
    let mut difference = Vec::with_capacity(w as usize * h as usize);
    for y in 0..h {
        for x in 0..w {
            let worst = if inside(x, y) {
                let (a, b) = (expected.rgba(x, y), actual.rgba(x, y));
                (0..4).fold(0.0, |m: f32, c| m.max((a[c] - b[c]).abs()))
            } else {
                1.0
            };
            difference.push(if worst > 0.0 { 0.25 + 0.75 * worst.sqrt() } else { 0.0 });
        }
    }
    let heat = diff::heat(&Image::new(w, h, 1, Pixels::F32(difference), Encoding::Linear)?);
    let gap = 4;
    let mut pixels = Vec::with_capacity((3 * w + 2 * gap) as usize * h as usize * 3);
    for y in 0..h {
        for (k, image) in [expected, &heat, actual].into_iter().enumerate() {
            if k > 0 {
                pixels.extend(std::iter::repeat_n(255, 3 * gap as usize));
            }
            for x in 0..w {
                let c = if x < image.width() && y < image.height() { image.rgba(x, y) } else { [0.0; 4] };
                pixels.extend(c[..3].iter().map(|v| (v * 255.0 + 0.5) as u8));
            }
        }
    }
    Image::new(3 * w + 2 * gap, h, 3, Pixels::U8(pixels), Encoding::Srgb)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_of_one_is_a_change_and_is_seen() {
        let a = blank((8, 4));
        let mut v = vec![128; 128];
        v[0] = 129;
        let b = Image::new(8, 4, 4, Pixels::U8(v), Encoding::Srgb).unwrap();
        assert!(same(&a, &a) && !same(&a, &b));
        let t = triptych(&a, &b).unwrap();
        assert_eq!((t.width(), t.height()), (32, 4));
        assert!(t.rgba(12, 0)[0] > 0.1 && t.rgba(13, 0)[0] < 0.01);
    }
}
