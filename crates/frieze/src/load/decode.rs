//! Pictures from bytes.

use crate::error::{Error, Finding, Result};
use crate::image::{Encoding, Image, Pixels};
use crate::job::Job;
use std::path::Path;

/// Decodes a picture.
///
/// # Errors
/// `image.broken` when the bytes are no picture.
pub fn image(bytes: &[u8], name: &Path, job: &Job) -> Result<(Image, Vec<Finding>)> {
    let broken = |e: image::ImageError| Error::input("image.broken", e.to_string()).in_file(name);
    let reader = image::ImageReader::new(std::io::Cursor::new(bytes)).with_guessed_format();
    let (w, h) = reader.map_err(|e| broken(e.into()))?.into_dimensions().map_err(broken)?;
    let _held = job.reserve(u64::from(w) * u64::from(h) * 4, "an image")?;
    let decoded = image::load_from_memory(bytes).map_err(broken)?;
    let (w, h) = (decoded.width(), decoded.height());
    Ok((Image::new(w, h, 4, Pixels::U8(decoded.into_rgba8().into_raw()), Encoding::Srgb)?, Vec::new()))
}
