//! Frames and pictures into files: `.png` (8 and 16 bits), `.exr`, `.hdr`, `.jpg`, `.webp`. The only room
//! that writes files.
//!
//! A file appears whole or not at all: it is written beside its place under another name and then renamed.
//! The same picture gives the same bytes: no time stamps, and float files hold one pattern of NaN and no -0.

use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::image::{Encoding, Image, Pixels};
use crate::job::Job;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

mod deflate;
mod exr;
mod hdr;
mod ktx2;
mod png;

pub use ktx2::{Ktx2, Ktx2Format};

/// How files are written.
#[derive(Clone, Debug, Default)]
pub struct WriteOptions {
    /// Threads, progress, cancellation.
    pub job: Job,
    /// Whether a file that is there is replaced.
    pub force: bool,
}

/// The formats that can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// 8 or 16 bits, lossless.
    Png,
    /// Linear light, half or single floats, with all planes in one file.
    Exr,
    /// Linear light, a shared exponent of 8 bits, no alpha.
    Hdr,
    /// 8 bits, lossy, no alpha (transparent pixels are put on black).
    Jpeg,
    /// 8 bits, lossless.
    WebP,
}

impl FileKind {
    /// The format of a path, by its ending.
    ///
    /// # Errors
    /// `write.format` for an ending that is not written.
    pub fn of(path: &Path) -> Result<FileKind> {
        match path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase().as_str() {
            "png" => Ok(FileKind::Png),
            "exr" => Ok(FileKind::Exr),
            "hdr" => Ok(FileKind::Hdr),
            "jpg" | "jpeg" => Ok(FileKind::Jpeg),
            "webp" => Ok(FileKind::WebP),
            _ => Err(Error::arguments("write.format", "a picture of this ending cannot be written")
                .in_file(path)
                .remedy("end the name in .png, .exr, .hdr, .jpg or .webp")),
        }
    }
    /// Whether it holds linear light in floats, as a frame of [`Format::F32`](crate::render::Format) does.
    pub fn is_float(self) -> bool {
        matches!(self, FileKind::Exr | FileKind::Hdr)
    }
}

impl Frame {
    /// Writes the frame, replacing a file that is there; with planes as [`frame`] says.
    ///
    /// # Errors
    /// Those of [`frame`].
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        frame(self, path.as_ref(), &WriteOptions { force: true, ..Default::default() }).map(|_| ())
    }
}

/// The files that a frame with planes of these names becomes: one `.exr` with everything in it, or the
/// picture and an `.exr` per plane: `out.png`, `out.depth.exr`, ...
pub fn files(target: &Path, planes: &[&str]) -> Result<Vec<PathBuf>> {
    let one = FileKind::of(target)? == FileKind::Exr;
    let mut all = vec![target.to_owned()];
    if !one {
        all.extend(planes.iter().map(|p| target.with_extension(format!("{p}.exr"))));
    }
    Ok(all)
}

/// Whether [`frame`] would be let to write: to be asked before a long render.
///
/// # Errors
/// `write.format`, `write.exists`, `write.failed` as [`frame`].
pub fn check(target: &Path, planes: &[&str], options: &WriteOptions) -> Result<()> {
    for file in files(target, planes)? {
        may_write(&file, options.force)?;
    }
    Ok(())
}

fn may_write(path: &Path, force: bool) -> Result<()> {
    match fs::metadata(path) {
        Ok(m) if m.is_dir() => Err(Error::output("write.failed", "this is a folder").in_file(path)),
        Ok(_) if !force => Err(Error::arguments("write.exists", "the file is already there")
            .in_file(path)
            .remedy("give another name, or --force to replace it")),
        _ => match folder(path).metadata() {
            Ok(m) if m.is_dir() => Ok(()),
            _ => Err(Error::output("write.failed", "its folder does not exist")
                .in_file(path)
                .remedy("make the folder first, or give another name")),
        },
    }
}

fn folder(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Writes a frame and its planes, by the target's ending, and returns the files: see [`files`]. Nothing is
/// left behind when any of them fails.
///
/// # Errors
/// Arguments faults: `write.format`, `write.exists` (without `force`), `write.float` and `write.bits` when the
/// colour's kind does not fit the format. Output faults: `write.failed`. `job.interrupted`.
pub fn frame(frame: &Frame, target: &Path, options: &WriteOptions) -> Result<Vec<PathBuf>> {
    let names: Vec<&str> = frame.planes.iter().map(|p| p.name).collect();
    check(target, &names, options)?;
    let size = (frame.color.width(), frame.color.height());
    let mut parts = Vec::new();
    if FileKind::of(target)? == FileKind::Exr {
        parts.push(Part::new(target, |out| exr::write(out, Some(&frame.color), &frame.planes, size, &options.job))?);
    } else {
        parts.push(Part::new(target, |out| picture(out, &frame.color, FileKind::of(target)?, options))?);
        for (plane, file) in frame.planes.iter().zip(&files(target, &names)?[1..]) {
            parts.push(Part::new(file, |out| exr::write(out, None, std::slice::from_ref(plane), size, &options.job))?);
        }
    }
    options.job.check()?;
    parts.into_iter().map(|p| p.publish(options.force)).collect()
}

/// Writes a plain picture (a map, a heat map), by the ending of its name.
///
/// # Errors
/// Those of [`frame`].
pub fn image(image: &Image, target: &Path, options: &WriteOptions) -> Result<()> {
    check(target, &[], options)?;
    let kind = FileKind::of(target)?;
    let part = Part::new(target, |out| picture(out, image, kind, options))?;
    options.job.check()?;
    part.publish(options.force).map(|_| ())
}

/// Writes a texture for graphics hardware, `.ktx2`.
///
/// # Errors
/// `write.exists`, `write.failed` as [`frame`]; `write.format` for another ending.
pub fn ktx2(texture: &Ktx2, target: &Path, options: &WriteOptions) -> Result<()> {
    check_ktx2(target, options)?;
    let part = Part::new(target, |out| ktx2::write(out, texture))?;
    options.job.check()?;
    part.publish(options.force).map(|_| ())
}

/// Whether [`ktx2()`] would be let to write.
///
/// # Errors
/// Those of [`ktx2()`].
pub fn check_ktx2(target: &Path, options: &WriteOptions) -> Result<()> {
    if !target.extension().is_some_and(|e| e.eq_ignore_ascii_case("ktx2")) {
        return Err(Error::arguments("write.format", "blocks are written to .ktx2 files only")
            .in_file(target)
            .remedy("end the name in .ktx2"));
    }
    may_write(target, options.force)
}

/// Writes the colour of a frame as PNG into any writer, such as standard output.
///
/// # Errors
/// `write.float` for a frame of floats, `write.failed` when the writer fails, `job.interrupted`.
pub fn png_to(writer: &mut dyn Write, frame: &Frame, job: &Job) -> Result<()> {
    png::write(writer, &frame.color, job)?;
    writer.flush().map_err(|e| Error::output("write.failed", e.to_string()))
}

fn picture(out: &mut dyn Write, image: &Image, kind: FileKind, options: &WriteOptions) -> Result<()> {
    if kind.is_float() && matches!(image.pixels(), Pixels::U8(_) | Pixels::U16(_)) && image.encoding == Encoding::Srgb {
        return Err(Error::arguments("write.bits", "this format holds linear light, and the picture is encoded")
            .remedy("render with floats, or write .png"));
    }
    match kind {
        FileKind::Png => png::write(out, image, &options.job),
        FileKind::Exr => exr::write(out, Some(image), &[], (image.width(), image.height()), &options.job),
        FileKind::Hdr => hdr::write(out, image),
        FileKind::Jpeg => {
            let rgb = eight_bits(image)?;
            // The encoder's transform works in integers, and its colour conversion in single f32 operations.
            let mut jpeg = ::image::codecs::jpeg::JpegEncoder::new_with_quality(out, 92);
            let (kind, data) = match image.channels() {
                1 | 2 => (::image::ExtendedColorType::L8, on_black(rgb, image.channels())),
                n => (::image::ExtendedColorType::Rgb8, on_black(rgb, n)),
            };
            jpeg.encode(&data, image.width(), image.height(), kind).map_err(failed)
        }
        FileKind::WebP => {
            let kind = match image.channels() {
                1 => ::image::ExtendedColorType::L8,
                2 => ::image::ExtendedColorType::La8,
                3 => ::image::ExtendedColorType::Rgb8,
                _ => ::image::ExtendedColorType::Rgba8,
            };
            if image.width() > 16384 || image.height() > 16384 {
                return Err(
                    Error::arguments("write.size", "WebP holds at most 16384 pixels along a side").remedy("write .png")
                );
            }
            ::image::codecs::webp::WebPEncoder::new_lossless(out)
                .encode(eight_bits(image)?, image.width(), image.height(), kind)
                .map_err(failed)
        }
    }
}

fn failed(e: impl std::fmt::Display) -> Error {
    Error::output("write.failed", e.to_string())
}

fn eight_bits(image: &Image) -> Result<&[u8]> {
    match image.pixels() {
        Pixels::U8(v) => Ok(v),
        Pixels::U16(_) => Err(Error::arguments("write.bits", "this format holds 8 bits, and the picture has 16")
            .remedy("write .png, or render with 8 bits")),
        _ => Err(Error::arguments("write.float", "this format holds 8 bits, not floats")
            .remedy("write .exr or .hdr, or render with 8 bits")),
    }
}

/// Pixels without their alpha, multiplied with it.
fn on_black(pixels: &[u8], channels: usize) -> Vec<u8> {
    if channels % 2 == 1 {
        return pixels.to_vec();
    }
    let over = |c: u8, a: u8| ((u32::from(c) * u32::from(a) + 127) / 255) as u8;
    let colors = pixels.chunks_exact(channels);
    colors.flat_map(|p| p[..channels - 1].iter().map(|&c| over(c, p[channels - 1])).collect::<Vec<_>>()).collect()
}

/// One pattern of NaN, and 0 for -0 (law 6).
fn plain(v: f32) -> f32 {
    if v.is_nan() { f32::from_bits(0x7fc0_0000) } else { v + 0.0 }
}

/// A finished file under a temporary name; removed unless it is published.
struct Part {
    temporary: PathBuf,
    target: PathBuf,
}

impl Part {
    fn new(target: &Path, write: impl FnOnce(&mut dyn Write) -> Result<()>) -> Result<Part> {
        let mut name = OsString::from(".");
        name.push(target.file_name().unwrap_or_default());
        name.push(format!(".{}.part", std::process::id()));
        let temporary = folder(target).join(name);
        let bad = |e: std::io::Error| {
            Error::output("write.failed", e.to_string()).remedy("choose a folder that can be written").in_file(target)
        };
        let file = File::create(&temporary).map_err(bad)?;
        let part = Part { temporary, target: target.to_owned() };
        let mut out = BufWriter::with_capacity(1 << 18, file);
        write(&mut out).map_err(|e| e.in_file(target))?;
        out.into_inner().map_err(|e| bad(e.into_error()))?;
        Ok(part)
    }
    fn publish(self, force: bool) -> Result<PathBuf> {
        may_write(&self.target, force)?;
        fs::rename(&self.temporary, &self.target).map_err(|e| failed(e).in_file(&self.target))?;
        Ok(self.target.clone())
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        // Renamed already, or to be forgotten; there is no one to tell when that fails.
        let _ = fs::remove_file(&self.temporary);
    }
}
