//! The picture in the terminal: two pixels per character, the upper half block `▀` in 24-bit colour.

use frieze::image::{Encoding, Image};
use frieze::math::exact;

/// A picture as terminal lines, `columns` wide at most and `lines` high at most.
pub fn blocks(image: &Image, columns: u32, lines: u32, color: bool) -> String {
    let (w, h) = (image.width(), image.height());
    let width = columns.min(w).max(1);
    // A character is two pixels high, so the pixels are about square.
    let mut height = (u64::from(width) * u64::from(h)).div_ceil(u64::from(w)) as u32;
    let mut width = width;
    if height > 2 * lines.max(1) {
        height = 2 * lines.max(1);
        width = ((u64::from(height) * u64::from(w)) / u64::from(h)).max(1) as u32;
    }
    let height = height.max(1);
    // The average of the pixels that fall into a cell, on grey checks where the picture is transparent.
    let cell = |x: u32, y: u32| -> [u8; 3] {
        let range = |k: u32, n: u32, all: u32| {
            let at = |k: u32| (u64::from(k) * u64::from(all) / u64::from(n)) as u32;
            at(k)..at(k + 1).max(at(k) + 1).min(all)
        };
        let mut sum = [0.0f32; 3];
        let mut n = 0.0;
        for py in range(y, height, h) {
            for px in range(x, width, w) {
                let [r, g, b, a] = image.rgba(px, py);
                let check = if (x / 4 + y / 4) % 2 == 0 { 0.4 } else { 0.6 };
                for (s, v) in sum.iter_mut().zip([r, g, b]) {
                    *s += shown(v, image) * a + check * (1.0 - a);
                }
                n += 1.0;
            }
        }
        sum.map(|s| (s / n * 255.0 + 0.5).clamp(0.0, 255.0) as u8)
    };
    let mut text = String::new();
    for row in 0..height.div_ceil(2) {
        for x in 0..width {
            let top = cell(x, 2 * row);
            let below = if 2 * row + 1 < height { cell(x, 2 * row + 1) } else { [0; 3] };
            if color {
                let [r, g, b] = top;
                let [r2, g2, b2] = below;
                text += &format!("\x1b[38;2;{r};{g};{b};48;2;{r2};{g2};{b2}m▀");
            } else {
                const INK: &[u8] = b" .:-=+*#%@";
                let grey = |c: [u8; 3]| (u32::from(c[0]) * 2 + u32::from(c[1]) * 5 + u32::from(c[2])) / 8;
                text.push(char::from(INK[((grey(top) + grey(below)) / 2 * 10 / 256) as usize]));
            }
        }
        text += if color { "\x1b[0m\n" } else { "\n" };
    }
    text.pop();
    text
}

/// What a screen wants: sRGB, 0 to 1.
fn shown(v: f32, image: &Image) -> f32 {
    let float = matches!(image.pixels(), frieze::image::Pixels::F32(_) | frieze::image::Pixels::F16(_));
    if float && image.encoding == Encoding::Linear {
        let v = v.clamp(0.0, 1.0);
        return if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * exact::pow(v, 1.0 / 2.4) - 0.055 };
    }
    v
}

#[cfg(test)]
mod tests {
    use super::*;
    use frieze::image::Pixels;

    #[test]
    fn a_picture_keeps_its_shape() {
        let image = Image::new(40, 20, 3, Pixels::U8([255, 0, 0].repeat(800)), Encoding::Srgb).unwrap();
        let text = blocks(&image, 20, 100, true);
        assert_eq!(text.lines().count(), 5);
        assert_eq!(text.lines().next().unwrap().matches('▀').count(), 20);
        assert!(text.contains("38;2;255;0;0"));
        assert_eq!(blocks(&image, 20, 2, false).lines().count(), 2);
        assert_eq!(blocks(&image, 1, 1, true).matches('▀').count(), 1);
    }
}
