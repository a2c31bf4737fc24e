//! Small pictures of assignment 3, as printed and corrected (rows 36, 37, 65 and 72 to 75), shared by `golden.rs` and the
//! chore that renews the golden pictures.

use frieze::games101::{self, Options, SIZE, Shader};
use frieze::image::{Encoding, Image, Pixels};
use frieze::mesh::shape;

/// Names of all pictures.
pub const NAMES: [&str; 4] =
    ["games101-bump", "games101-bump-corrected", "games101-displacement", "games101-displacement-corrected"];

/// A seventh of the assignment's 700 pixels.
const SIDE: usize = SIZE / 7;

/// Dimples and ridges, grey, tileable.
fn heights() -> Image {
    let n = 128;
    let texel = |k: usize| {
        let (x, y) = ((k % n) as i32, (k / n) as i32);
        let (dx, dy) = (x % 32 - 16, y % 32 - 16);
        let hole = (196 - dx * dx - dy * dy).max(0) / 4;
        [(60 + hole * 2 + 10 * ((x / 4 + y / 4) % 2)) as u8; 3]
    };
    Image::new(n as u32, n as u32, 3, Pixels::U8((0..n * n).flat_map(texel).collect()), Encoding::Srgb)
        .expect("the sizes fit")
}

/// The picture of that name.
pub fn picture(name: &str) -> Image {
    let shader = if name.starts_with("games101-bump") { Shader::Bump } else { Shader::Displacement };
    let options = Options { corrected: name.ends_with("-corrected"), ..Options::default() };
    let mut mesh = shape::teapot(1.65, 12);
    mesh.positions.iter_mut().for_each(|p| p[1] -= 0.5);
    let frame = games101::render(shader, &mesh, Some(&heights()), &options).expect("the assignment can be rendered");
    let Pixels::U8(pixels) = frame.color.pixels() else { panic!("the assignment has 8 bits") };
    let mean = |k: usize| {
        let (x, y, c) = (k / 3 % SIDE, k / 3 / SIDE, k % 3);
        let block = (0..49).map(|j| u32::from(pixels[((y * 7 + j / 7) * SIZE + x * 7 + j % 7) * 3 + c]));
        (block.sum::<u32>() / 49) as u8
    };
    let pixels = (0..SIDE * SIDE * 3).map(mean).collect();
    Image::new(SIDE as u32, SIDE as u32, 3, Pixels::U8(pixels), Encoding::Srgb).expect("the sizes fit")
}
