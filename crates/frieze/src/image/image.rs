//! Pixels in rows: u8, u16, f16 or f32, 1 to 4 channels.

use crate::error::{Error, Result};
use half::f16;

/// Pixel values, row after row from the top, channels interleaved.
#[derive(Clone, Debug, PartialEq)]
pub enum Pixels {
    /// 8-bit unsigned normalised: 0 ..= 255 means 0 ..= 1.
    U8(Vec<u8>),
    /// 16-bit unsigned normalised: 0 ..= 65535 means 0 ..= 1.
    U16(Vec<u16>),
    /// Half precision floats.
    F16(Vec<f16>),
    /// Single precision floats.
    F32(Vec<f32>),
}

/// How the numbers of the colour channels relate to light. Alpha is always linear.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// The sRGB transfer curve (IEC 61966-2-1).
    Srgb,
    /// Proportional to light, or data that is no colour at all.
    Linear,
}

/// A picture: 1 = grey, 2 = grey and alpha, 3 = RGB, 4 = RGBA; alpha is straight (not premultiplied).
/// Neither side is 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    width: u32,
    height: u32,
    channels: u8,
    pixels: Pixels,
    /// How the file says its colour is encoded. A map slot may override it.
    pub encoding: Encoding,
}

impl Image {
    /// A picture of `width * height * channels` values.
    ///
    /// # Errors
    /// `image.empty` for a side of 0, `image.channels` for other than 1 to 4 channels, `image.size` when
    /// the number of values does not fit.
    pub fn new(width: u32, height: u32, channels: u8, pixels: Pixels, encoding: Encoding) -> Result<Self> {
        if width == 0 || height == 0 {
            return Err(Error::input("image.empty", format!("the image is {width}x{height}: it has no pixel")));
        }
        if !(1..=4).contains(&channels) {
            return Err(Error::input("image.channels", format!("{channels} channels; 1 to 4 are possible")));
        }
        let len = match &pixels {
            Pixels::U8(v) => v.len(),
            Pixels::U16(v) => v.len(),
            Pixels::F16(v) => v.len(),
            Pixels::F32(v) => v.len(),
        };
        let want = u64::from(width) * u64::from(height) * u64::from(channels);
        if len as u64 != want {
            return Err(Error::input("image.size", format!("{len} values for {width}x{height}x{channels} = {want}")));
        }
        Ok(Image { width, height, channels, pixels, encoding })
    }
    /// Pixels per row.
    pub fn width(&self) -> u32 {
        self.width
    }
    /// Rows.
    pub fn height(&self) -> u32 {
        self.height
    }
    /// Values per pixel, 1 to 4.
    pub fn channels(&self) -> usize {
        usize::from(self.channels)
    }
    /// The values.
    pub fn pixels(&self) -> &Pixels {
        &self.pixels
    }
    /// The values, taken out.
    pub fn into_pixels(self) -> Pixels {
        self.pixels
    }
    /// Bytes that the values take.
    pub fn bytes(&self) -> u64 {
        let each = match self.pixels {
            Pixels::U8(_) => 1,
            Pixels::U16(_) | Pixels::F16(_) => 2,
            Pixels::F32(_) => 4,
        };
        u64::from(self.width) * u64::from(self.height) * u64::from(self.channels) * each
    }
    /// One value as it is stored, normalised integers as 0 ..= 1. Panics outside of the picture.
    #[inline]
    pub fn value(&self, x: u32, y: u32, c: usize) -> f32 {
        assert!(x < self.width && c < self.channels());
        let k = (y as usize * self.width as usize + x as usize) * self.channels() + c;
        match &self.pixels {
            Pixels::U8(v) => f32::from(v[k]) / 255.0,
            Pixels::U16(v) => f32::from(v[k]) / 65535.0,
            Pixels::F16(v) => v[k].to_f32(),
            Pixels::F32(v) => v[k],
        }
    }
    /// One pixel as stored, as RGBA: grey is repeated, a missing alpha is 1.
    pub fn rgba(&self, x: u32, y: u32) -> [f32; 4] {
        let v = |c| self.value(x, y, c);
        match self.channels {
            1 => [v(0), v(0), v(0), 1.0],
            2 => [v(0), v(0), v(0), v(1)],
            3 => [v(0), v(1), v(2), 1.0],
            _ => [v(0), v(1), v(2), v(3)],
        }
    }
}
