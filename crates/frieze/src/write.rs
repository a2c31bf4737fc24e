//! The only room that writes files.

use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::image::{Image, Pixels};
use crate::job::Job;
use std::io::Write;
use std::path::{Path, PathBuf};

/// How files are written.
#[derive(Clone, Debug, Default)]
pub struct WriteOptions {
    /// Threads, progress, cancellation.
    pub job: Job,
    /// Whether a file that is there is replaced.
    pub force: bool,
}

/// Whether [`frame`] would be let to write.
///
/// # Errors
/// `write.exists`, `write.failed`
pub fn check(target: &Path, _planes: &[&str], options: &WriteOptions) -> Result<()> {
    let folder = target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !folder.is_dir() {
        return Err(Error::output("write.failed", "its folder does not exist").in_file(target));
    }
    if target.exists() && !options.force {
        return Err(Error::arguments("write.exists", "the file is already there").in_file(target));
    }
    Ok(())
}

/// Writes a frame; returns the files.
///
/// # Errors
/// `write.*`
pub fn frame(frame: &Frame, target: &Path, options: &WriteOptions) -> Result<Vec<PathBuf>> {
    image(&frame.color, target, options)?;
    Ok(vec![target.to_owned()])
}

/// Writes a picture.
///
/// # Errors
/// `write.*`
pub fn image(image: &Image, target: &Path, options: &WriteOptions) -> Result<()> {
    check(target, &[], options)?;
    let mut png = Vec::new();
    picture(&mut png, image)?;
    std::fs::write(target, png).map_err(|e| Error::output("write.failed", e.to_string()).in_file(target))
}

/// Writes the colour as PNG.
///
/// # Errors
/// `write.*`
pub fn png_to(to: &mut dyn Write, frame: &Frame, _job: &Job) -> Result<()> {
    picture(to, &frame.color)
}

fn picture(to: &mut dyn Write, image: &Image) -> Result<()> {
    use ::image::{ExtendedColorType, ImageEncoder};
    let Pixels::U8(v) = image.pixels() else { return Err(Error::output("write.failed", "8 bits only")) };
    let kind = [ExtendedColorType::L8, ExtendedColorType::La8, ExtendedColorType::Rgb8, ExtendedColorType::Rgba8];
    ::image::codecs::png::PngEncoder::new(to)
        .write_image(v, image.width(), image.height(), kind[image.channels() - 1])
        .map_err(|e| Error::output("write.failed", e.to_string()))
}
