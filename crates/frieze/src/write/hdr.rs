//! Radiance HDR: RGBE, run-length coded rows.

use super::failed;
use crate::error::{Error, Result};
use crate::image::{Image, Pixels};
use std::io::Write;

/// Linear RGB with one exponent: the mantissas that come nearest. Negative numbers and NaN become 0.
fn rgbe(c: [f32; 3]) -> [u8; 4] {
    let c = c.map(|v| if v > 0.0 { v.min(1.6e38) } else { 0.0 });
    let most = c[0].max(c[1]).max(c[2]);
    let mut e = ((most.to_bits() >> 23) as i32) - 126; // most < 2^e
    loop {
        if e < -127 {
            return [0; 4];
        }
        // 2^(8 - e) in f64 is exact.
        let scale = f64::from_bits(((1023 + 8 - e) as u64) << 52);
        let m = c.map(|v| (f64::from(v) * scale + 0.5) as u32);
        if m.iter().all(|&m| m < 256) {
            return [m[0] as u8, m[1] as u8, m[2] as u8, (e + 128) as u8];
        }
        e += 1;
    }
}

pub(super) fn write(out: &mut dyn Write, image: &Image) -> Result<()> {
    if matches!(image.pixels(), Pixels::U8(_) | Pixels::U16(_)) {
        return Err(Error::arguments("write.bits", "Radiance HDR holds linear light, and the picture is encoded")
            .remedy("render with floats, or write .png"));
    }
    let (w, h) = (image.width(), image.height());
    write!(out, "#?RADIANCE\nSOFTWARE=frieze {}\nFORMAT=32-bit_rle_rgbe\n\n-Y {h} +X {w}\n", env!("CARGO_PKG_VERSION"))
        .map_err(failed)?;
    let mut line = Vec::new();
    for y in 0..h {
        let row: Vec<[u8; 4]> = (0..w)
            .map(|x| {
                let [r, g, b, _] = image.rgba(x, y);
                rgbe([r, g, b])
            })
            .collect();
        line.clear();
        if (8..32768).contains(&w) {
            line.extend([2, 2, (w >> 8) as u8, w as u8]);
            (0..4).for_each(|c| runs(&row.iter().map(|p| p[c]).collect::<Vec<_>>(), &mut line));
        } else {
            line.extend(row.iter().flatten());
        }
        out.write_all(&line).map_err(failed)?;
    }
    Ok(())
}

/// Runs of 4 and more bytes as 128 + count and the byte; others as count and the bytes.
fn runs(bytes: &[u8], out: &mut Vec<u8>) {
    let run_at = |k: usize| bytes[k..].iter().take(127).take_while(|&&b| b == bytes[k]).count();
    let mut k = 0;
    while k < bytes.len() {
        let run = run_at(k);
        if run >= 4 {
            out.extend([128 + run as u8, bytes[k]]);
            k += run;
        } else {
            let begin = k;
            while k < bytes.len() && k - begin < 128 && run_at(k) < 4 {
                k += 1;
            }
            out.push((k - begin) as u8);
            out.extend(&bytes[begin..k]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shared_exponent_comes_nearest() {
        assert_eq!(rgbe([1.0, 0.5, 0.25]), [128, 64, 32, 129]);
        assert_eq!(rgbe([0.0, -1.0, f32::NAN]), [0; 4]);
        // 0.999 would round to 256 / 256: the exponent rises.
        assert_eq!(rgbe([0.999, 0.0, 0.0]), [128, 0, 0, 129]);
        assert_eq!(rgbe([f32::INFINITY, 0.0, 0.0])[3], 255);
        assert_eq!(rgbe([1e-42, 0.0, 0.0]), [0; 4]);
    }
}
