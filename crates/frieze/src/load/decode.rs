//! Image files -> [`Image`]: PNG, JPEG, WebP, TGA, BMP, TIFF, Radiance HDR, EXR.
//!
//! 8-bit files stay 8 bits, 16-bit files 16 bits, floats floats; nothing is expanded but palettes and bits.
//! Sizes are known, checked and reserved before pixels are allocated. Law 6: every decoder here works in
//! integers; EXR's DWA compressions, which need the
//! platform's cosines, are refused.

use crate::error::{Error, Finding, Result};
use crate::image::{Encoding, Image, Pixels};
use crate::job::{Job, Reservation};
use half::f16;
use std::cell::Cell;
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

mod exr;
mod hdr;

/// Most pixels along a side.
const MOST_SIDE: u64 = 65_536;
/// Most pixels of an image.
const MOST_PIXELS: u64 = 1 << 30;

/// What the first bytes, or failing these the ending, say that a file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Png,
    Jpeg,
    WebP,
    Tga,
    Bmp,
    Tiff,
    Hdr,
    Exr,
}

impl Kind {
    fn of(bytes: &[u8], name: &Path) -> Option<Kind> {
        const MAGIC: [(&[u8], Kind); 9] = [
            (b"\x89PNG\r\n\x1a\n", Kind::Png),
            (b"\xff\xd8\xff", Kind::Jpeg),
            (b"BM", Kind::Bmp),
            (b"II*\0", Kind::Tiff),
            (b"MM\0*", Kind::Tiff),
            (b"II+\0", Kind::Tiff),
            (b"MM\0+", Kind::Tiff),
            (b"#?", Kind::Hdr),
            (b"\x76\x2f\x31\x01", Kind::Exr),
        ];
        let ending = name.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
        // TGA has no magic; its own footer or its ending comes before the two letters of BMP.
        if ending == "tga" || bytes.ends_with(b"TRUEVISION-XFILE.\0") {
            return Some(Kind::Tga);
        }
        if bytes.len() >= 12 && bytes.starts_with(b"RIFF") && &bytes[8..12] == b"WEBP" {
            return Some(Kind::WebP);
        }
        MAGIC.iter().find(|(m, _)| bytes.starts_with(m)).map(|&(_, k)| k)
    }
}

/// The name of the picture format that a file has, by its first bytes.
pub(super) fn picture(head: &[u8], name: &Path) -> Option<&'static str> {
    Some(match Kind::of(head, name)? {
        Kind::Png => "PNG",
        Kind::Jpeg => "JPEG",
        Kind::WebP => "WebP",
        Kind::Tga => "TGA",
        // Two letters prove little; four bytes of the header are reserved and 0.
        Kind::Bmp => head.get(6..10).filter(|b| *b == [0; 4]).map(|_| "BMP")?,
        Kind::Tiff => "TIFF",
        Kind::Hdr => "Radiance HDR",
        Kind::Exr => "OpenEXR",
    })
}

/// Decodes an image file. `name` is for messages and, where the bytes do not tell, for the format.
///
/// # Errors
/// Input faults: `image.unknown-format`, `image.corrupt`, `image.unsupported`, `image.empty`,
/// `image.too-large`; `job.memory` when the pixels do not fit the budget; `job.interrupted`.
pub fn image(bytes: &[u8], name: &Path, job: &Job) -> Result<(Image, Vec<Finding>)> {
    job.check()?;
    let mut findings = Vec::new();
    let kind = Kind::of(bytes, name).ok_or_else(|| {
        let message = if bytes.is_empty() { "the file is empty" } else { "this is no image that we know" };
        Error::input("image.unknown-format", message)
            .remedy("use PNG, JPEG, WebP, TGA, BMP, TIFF, Radiance HDR or EXR")
            .in_file(name)
    })?;
    let image = guarded(|| match kind {
        Kind::Png => png(bytes, job, &mut findings),
        Kind::Jpeg => jpeg(bytes, job, &mut findings),
        Kind::WebP => webp(bytes, job, &mut findings),
        Kind::Tga => by_image_crate(Cursor::new(bytes), job, &mut findings, ::image::codecs::tga::TgaDecoder::new),
        Kind::Bmp => by_image_crate(Cursor::new(bytes), job, &mut findings, ::image::codecs::bmp::BmpDecoder::new),
        Kind::Tiff => tiff(bytes, job, &mut findings),
        Kind::Hdr => hdr::decode(bytes, job),
        Kind::Exr => exr::decode(bytes, job, &mut findings),
    });
    let image = image.and_then(|i| finite(i, &mut findings)).map_err(|e| e.in_file(name))?;
    Ok((image, findings.into_iter().map(|f| f.in_file(name)).collect()))
}

thread_local! {
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Whether this thread is within a decoder whose panics become errors. For panic hooks, which are called before:
/// they may stay silent then.
pub fn is_guarded() -> bool {
    GUARDED.get()
}

/// Decoders of other crates panic on some broken files (arithmetic that overflows, mostly, in builds that check it).
fn guarded(decode: impl FnOnce() -> Result<Image>) -> Result<Image> {
    let before = GUARDED.replace(true);
    let result = catch_unwind(AssertUnwindSafe(decode));
    GUARDED.set(before);
    result.unwrap_or_else(|_| Err(corrupt("its decoder gave up")))
}

fn corrupt(e: impl std::fmt::Display) -> Error {
    Error::input("image.corrupt", format!("the image cannot be decoded: {e}"))
        .remedy("the file may be cut off or damaged; export it again")
}

fn unsupported(what: impl std::fmt::Display) -> Error {
    Error::input("image.unsupported", format!("{what} cannot be read")).remedy("convert it to PNG or EXR")
}

/// Checks a size that a header states, and asks for the memory of the pixels (`each` bytes per pixel).
fn reserve(job: &Job, width: u64, height: u64, each: u64) -> Result<Reservation> {
    if width == 0 || height == 0 {
        return Err(Error::input("image.empty", format!("the image is {width}x{height}: it has no pixel"))
            .remedy("export it again"));
    }
    if width > MOST_SIDE || height > MOST_SIDE || width * height > MOST_PIXELS {
        return Err(Error::input(
            "image.too-large",
            format!("the image says that it is {width}x{height}; at most {MOST_SIDE} along a side and 2^30 in all"),
        )
        .remedy("make it smaller, or cut it into tiles"));
    }
    job.reserve(width * height * each, format_args!("an image of {width}x{height}"))
}

/// A warning that a colour profile is not honoured, unless it is sRGB's own.
fn profile(icc: Option<&[u8]>, findings: &mut Vec<Finding>) {
    if icc.is_some_and(|p| !p.windows(4).any(|w| w == b"sRGB") && !p.windows(7).any(|w| w == b"s\0R\0G\0B")) {
        findings.push(Finding::warning(
            "image.profile-ignored",
            "the image has a colour profile other than sRGB",
            "it is read as sRGB; convert it to sRGB if its colours look wrong",
        ));
    }
}

fn png(bytes: &[u8], job: &Job, findings: &mut Vec<Finding>) -> Result<Image> {
    let bad = |e: ::png::DecodingError| match e {
        ::png::DecodingError::LimitsExceeded => corrupt("a chunk of it unpacks to more than 256 MiB"),
        e => corrupt(e),
    };
    let mut decoder = ::png::Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(::png::Transformations::EXPAND);
    decoder.set_ignore_text_chunk(true);
    decoder.set_limits(::png::Limits { bytes: 256 << 20 });
    let info = decoder.read_header_info().map_err(bad)?;
    let (width, height) = (info.width, info.height);
    // At most 4 channels of the file's depth, those of 16 bits twice: as bytes and as numbers.
    let deep = info.bit_depth == ::png::BitDepth::Sixteen;
    let _held = reserve(job, width.into(), height.into(), if deep { 16 } else { 4 })?;
    let mut reader = decoder.read_info().map_err(bad)?;
    let info = reader.info();
    let mut encoding = Encoding::Srgb;
    if info.srgb.is_none() {
        profile(info.icc_profile.as_deref(), findings);
        match info.gama_chunk.map(|g| g.into_value()).filter(|_| info.icc_profile.is_none()) {
            Some(g) if (g - 1.0).abs() < 1e-3 => {
                encoding = Encoding::Linear;
                findings.push(Finding::note(
                    "image.linear",
                    "the file says that its values are linear light (gAMA 1.0)",
                    "a colour map with srgb = false follows it",
                ));
            }
            Some(g) if (g - 0.45455).abs() > 0.02 => findings.push(Finding::warning(
                "image.gamma-ignored",
                format!("the file says gamma {g:.5}"),
                "it is read as sRGB; convert it if its colours look wrong",
            )),
            _ => {}
        }
    }
    if info.animation_control.is_some() {
        findings.push(Finding::note("image.animated", "the image is animated", "its first frame is used"));
    }
    let size = reader.output_buffer_size().ok_or_else(|| corrupt("its size does not fit this machine"))?;
    let mut data = vec![0; size];
    reader.next_frame(&mut data).map_err(bad)?;
    let (color, depth) = reader.output_color_type();
    let pixels = match depth {
        ::png::BitDepth::Sixteen => {
            Pixels::U16(data.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect())
        }
        _ => Pixels::U8(data),
    };
    Image::new(width, height, color.samples() as u8, pixels, encoding)
}

/// The JPEG decoder's options. Its transforms and colour conversion work in integers, in scalar and vector code;
/// which of them runs cannot be chosen here (zune-core 0.5 joins its switches with "or", and all are on), so
/// the hash test on emulated CPUs is what holds them to the same pixels. Builds of zune-jpeg 0.5.15 with and
/// without its x86 feature gave the same pixels for 121 files (4:4:4, 4:2:2, 4:2:0, baseline and progressive,
/// quality 10 to 95, odd sizes).
fn jpeg_options() -> zune_core::options::DecoderOptions {
    zune_core::options::DecoderOptions::new_safe()
        .set_max_width(MOST_SIDE as usize)
        .set_max_height(MOST_SIDE as usize)
        .set_strict_mode(true)
}

fn jpeg(bytes: &[u8], job: &Job, findings: &mut Vec<Finding>) -> Result<Image> {
    use zune_core::colorspace::ColorSpace;
    let read = || zune_core::bytestream::ZCursor::new(bytes);
    let mut decoder = zune_jpeg::JpegDecoder::new_with_options(read(), jpeg_options());
    decoder.decode_headers().map_err(corrupt)?;
    let info = decoder.info().ok_or_else(|| corrupt("it has no header"))?;
    let grey = decoder.input_colorspace() == Some(ColorSpace::Luma);
    let channels = if grey { 1 } else { 3 };
    // Progressive files also hold their coefficients, 2 bytes each.
    let _held = reserve(job, info.width.into(), info.height.into(), channels * 3)?;
    let out = if grey { ColorSpace::Luma } else { ColorSpace::RGB };
    let mut decoder = zune_jpeg::JpegDecoder::new_with_options(read(), jpeg_options().jpeg_set_out_colorspace(out));
    let data = decoder.decode().map_err(corrupt)?;
    profile(decoder.icc_profile().as_deref(), findings);
    Image::new(info.width.into(), info.height.into(), channels as u8, Pixels::U8(data), Encoding::Srgb)
}

fn webp(bytes: &[u8], job: &Job, findings: &mut Vec<Finding>) -> Result<Image> {
    let pixels = webp_chunks(bytes, 12, true)?;
    let _held = job.reserve(pixels * 2, "a frame of an image")?;
    by_image_crate(Cursor::new(bytes), job, findings, ::image::codecs::webp::WebPDecoder::new)
}

/// Looks at the chunks from `at` on before the decoder does: it allocates what a colour profile says to have before
/// it sees that the file is shorter, and what a lossy frame says to measure before it compares that with the canvas.
/// The result is the number of pixels of the largest lossy frame.
fn webp_chunks(bytes: &[u8], mut at: usize, whole: bool) -> Result<u64> {
    let mut most = 0;
    while let Some(head) = bytes.get(at..at + 8) {
        let size = u32::from_le_bytes([head[4], head[5], head[6], head[7]]) as usize;
        let end = (at + 8).saturating_add(size).min(bytes.len());
        match &head[..4] {
            b"ICCP" if size > bytes.len() - at - 8 => {
                return Err(corrupt("its colour profile is cut off").at(format!("byte {at}")));
            }
            // 14 bits each, after the frame's tag and the start code (RFC 6386, 9.1).
            b"VP8 " => {
                if let Some(&[w0, w1, h0, h1]) = bytes.get(at + 14..at + 18) {
                    let side = |low: u8, high: u8| u64::from(u16::from_le_bytes([low, high]) & 0x3fff);
                    most = most.max(side(w0, w1) * side(h0, h1));
                }
            }
            // A frame of an animation holds chunks itself, after its place and times.
            b"ANMF" if whole => most = most.max(webp_chunks(&bytes[..end], at + 24, false)?),
            _ => {}
        }
        at = end.saturating_add(size % 2);
    }
    Ok(most)
}

/// WebP, TGA and BMP: integers in, 8 bits out.
fn by_image_crate<'a, D: ::image::ImageDecoder>(
    bytes: Cursor<&'a [u8]>,
    job: &Job,
    findings: &mut Vec<Finding>,
    new: impl FnOnce(Cursor<&'a [u8]>) -> ::image::ImageResult<D>,
) -> Result<Image> {
    let mut decoder = new(bytes).map_err(corrupt)?;
    let (width, height) = decoder.dimensions();
    let color = decoder.color_type();
    let _held = reserve(job, width.into(), height.into(), 2 * u64::from(color.bytes_per_pixel()))?;
    profile(decoder.icc_profile().ok().flatten().as_deref(), findings);
    let (channels, wide) = match color {
        ::image::ColorType::L8 => (1, false),
        ::image::ColorType::La8 => (2, false),
        ::image::ColorType::Rgb8 => (3, false),
        ::image::ColorType::Rgba8 => (4, false),
        ::image::ColorType::L16 => (1, true),
        ::image::ColorType::La16 => (2, true),
        ::image::ColorType::Rgb16 => (3, true),
        ::image::ColorType::Rgba16 => (4, true),
        other => return Err(unsupported(format_args!("pixels of the type {other:?}"))),
    };
    let mut data = vec![0; usize::try_from(decoder.total_bytes()).map_err(corrupt)?];
    decoder.read_image(&mut data).map_err(corrupt)?;
    let pixels = if wide {
        Pixels::U16(data.chunks_exact(2).map(|b| u16::from_ne_bytes([b[0], b[1]])).collect())
    } else {
        Pixels::U8(data)
    };
    Image::new(width, height, channels, pixels, Encoding::Srgb)
}

fn tiff(bytes: &[u8], job: &Job, findings: &mut Vec<Finding>) -> Result<Image> {
    use ::tiff::ColorType as C;
    use ::tiff::decoder::{Decoder, DecodingResult as D, Limits};
    use ::tiff::tags::Tag;
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(corrupt)?;
    let (width, height) = decoder.dimensions().map_err(corrupt)?;
    let color = decoder.colortype().map_err(corrupt)?;
    let (channels, depth) = match color {
        C::Gray(d) => (1u8, d),
        C::GrayA(d) => (2, d),
        C::RGB(d) => (3, d),
        C::RGBA(d) => (4, d),
        C::Multiband { bit_depth, num_samples: n @ 1..=4 } => (n as u8, bit_depth),
        other => return Err(unsupported(format_args!("a TIFF of the type {other:?}"))),
    };
    let number = |d: &mut Decoder<_>, tag, default: u16| {
        Ok::<u16, Error>(d.find_tag_unsigned(tag).map_err(corrupt)?.unwrap_or(default))
    };
    // The decoder of JPEG inside TIFF would choose vector code that is not proven to give the same pixels.
    if matches!(number(&mut decoder, Tag::Compression, 1)?, 6 | 7 | 34892) {
        return Err(unsupported("JPEG inside TIFF"));
    }
    if number(&mut decoder, Tag::PlanarConfiguration, 1)? != 1 && channels > 1 {
        return Err(unsupported("a TIFF with separate planes"));
    }
    let premultiplied = channels % 2 == 0 && number(&mut decoder, Tag::ExtraSamples, 0)? == 1;
    let size = u64::from(channels) * u64::from(depth).div_ceil(8);
    let _held = reserve(job, width.into(), height.into(), size * 2)?;
    let most = usize::try_from(u64::from(width) * u64::from(height) * size).map_err(corrupt)?.max(1 << 20);
    let mut limits = Limits::default();
    limits.decoding_buffer_size = most;
    limits.intermediate_buffer_size = most.saturating_mul(2);
    limits.ifd_value_size = bytes.len().max(1 << 16);
    let mut decoder = decoder.with_limits(limits);
    if decoder.more_images() {
        findings.push(Finding::note("image.pages", "the TIFF has several pages", "the first is used"));
    }
    let (pixels, encoding) = match decoder.read_image().map_err(corrupt)? {
        D::U8(v) if depth == 8 => (Pixels::U8(v), Encoding::Srgb),
        D::U8(v) if depth == 1 => (Pixels::U8(unpack_bits(&v, width, height)?), Encoding::Srgb),
        D::U16(v) => (Pixels::U16(v), Encoding::Srgb),
        D::F16(v) => (Pixels::F16(v), Encoding::Linear),
        D::F32(v) => (Pixels::F32(v), Encoding::Linear),
        D::F64(v) => (Pixels::F32(v.into_iter().map(|v| v as f32).collect()), Encoding::Linear),
        D::U32(v) => (
            Pixels::U16(v.into_iter().map(|v| ((u64::from(v) * 65535 + (1 << 31)) >> 32) as u16).collect()),
            Encoding::Srgb,
        ),
        _ => return Err(unsupported(format_args!("a TIFF with {depth} bits per sample of this kind"))),
    };
    let image = Image::new(width, height, channels, pixels, encoding)?;
    Ok(if premultiplied { straight(image) } else { image })
}

/// One bit per pixel, rows padded to bytes, to one byte per pixel.
fn unpack_bits(bits: &[u8], width: u32, height: u32) -> Result<Vec<u8>> {
    let (width, height) = (width as usize, height as usize);
    if bits.len() == width * height {
        return Ok(bits.iter().map(|&b| if b > 0 { 255 } else { 0 }).collect());
    }
    let row = width.div_ceil(8);
    if bits.len() < row * height {
        return Err(corrupt("it is cut off"));
    }
    Ok((0..height)
        .flat_map(|y| (0..width).map(move |x| if bits[y * row + x / 8] >> (7 - x % 8) & 1 > 0 { 255 } else { 0 }))
        .collect())
}

/// Takes the alpha out of premultiplied colour.
fn straight(image: Image) -> Image {
    let (width, height, channels, encoding) = (image.width(), image.height(), image.channels(), image.encoding);
    fn each<T: Copy>(v: &mut [T], channels: usize, get: impl Fn(T) -> f32, put: impl Fn(f32) -> T) {
        for pixel in v.chunks_exact_mut(channels) {
            let (color, alpha) = pixel.split_at_mut(channels - 1);
            let a = get(alpha[0]);
            if a > 0.0 && a != 1.0 {
                color.iter_mut().for_each(|c| *c = put(get(*c) / a));
            }
        }
    }
    let mut pixels = image.into_pixels();
    match &mut pixels {
        Pixels::U8(v) => each(v, channels, |v| f32::from(v) / 255.0, |v| (v.min(1.0) * 255.0 + 0.5) as u8),
        Pixels::U16(v) => each(v, channels, |v| f32::from(v) / 65535.0, |v| (v.min(1.0) * 65535.0 + 0.5) as u16),
        Pixels::F16(v) => each(v, channels, f16::to_f32, f16::from_f32),
        Pixels::F32(v) => each(v, channels, |v| v, |v| v),
    }
    Image::new(width, height, channels as u8, pixels, encoding).expect("the same shape as before")
}

/// Replaces what no filter could average: NaN by 0, infinities by the largest number.
fn finite(image: Image, findings: &mut Vec<Finding>) -> Result<Image> {
    let (width, height, channels, encoding) = (image.width(), image.height(), image.channels(), image.encoding);
    let mut pixels = image.into_pixels();
    let mut count = 0u64;
    match &mut pixels {
        Pixels::F32(v) => v.iter_mut().filter(|v| !v.is_finite()).for_each(|v| {
            count += 1;
            *v = if v.is_nan() { 0.0 } else { f32::MAX.copysign(*v) };
        }),
        Pixels::F16(v) => v.iter_mut().filter(|v| !v.is_finite()).for_each(|v| {
            count += 1;
            *v = if v.is_nan() { f16::ZERO } else { f16::MAX.copysign(*v) };
        }),
        _ => {}
    }
    if count > 0 {
        findings.push(Finding::warning(
            "image.not-finite",
            format!("{count} values of the image are infinite or not a number"),
            "infinities became the largest number, the others 0",
        ));
    }
    Image::new(width, height, channels as u8, pixels, encoding)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_tell_the_format_before_the_name() {
        let kind = |b: &[u8], n: &str| Kind::of(b, Path::new(n));
        assert_eq!(kind(b"\xff\xd8\xff\xe0", "a.png"), Some(Kind::Jpeg));
        assert_eq!(kind(b"RIFF....WEBPVP8 ", "a.jpg"), Some(Kind::WebP));
        assert_eq!(kind(b"\0\0\x02", "a.TGA"), Some(Kind::Tga));
        assert_eq!(kind(b"\0\0\x02", "a.png"), None);
    }

    #[test]
    fn a_decoder_that_panics_gives_an_error() {
        let error = guarded(|| {
            assert!(is_guarded());
            panic!("as other crates do")
        });
        assert_eq!(error.unwrap_err().code, "image.corrupt");
        assert!(!is_guarded());
    }
}
