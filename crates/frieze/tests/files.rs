//! Pictures into files and back, and the pixels of every format that is read.

use frieze::error::Fault;
use frieze::frame::{Plane, Values};
use frieze::image::{Encoding, Image, Pixels};
use frieze::load::decode;
use frieze::write::{self, WriteOptions};
use frieze::{Frame, Job};
use half::f16;
use image::ExtendedColorType as Color;
use std::fs;
use std::path::{Path, PathBuf};

struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Folder {
        let folder = std::env::temp_dir().join(format!("frieze-files-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        Folder(folder)
    }
    fn names(&self) -> Vec<String> {
        let mut all: Vec<_> =
            fs::read_dir(&self.0).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        all.sort();
        all
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Smooth areas, edges and noise.
fn bytes(width: u32, height: u32, channels: u32) -> Vec<u8> {
    let mut seed = 1u32;
    (0..width * height * channels)
        .map(|k| {
            let (x, y, c) = (k / channels % width, k / channels / width, k % channels);
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            match (x / 16 + y / 16) % 3 {
                0 => (x * 3 + y * 5 + c * 40) as u8,
                1 => (seed >> 24) as u8,
                _ => 200,
            }
        })
        .collect()
}

fn eight(width: u32, height: u32, channels: u8) -> Image {
    let v = bytes(width, height, channels.into());
    Image::new(width, height, channels, Pixels::U8(v), Encoding::Srgb).unwrap()
}

fn sixteen(width: u32, height: u32, channels: u8) -> Image {
    let v = bytes(width, height, channels.into()).iter().map(|&v| u16::from(v) * 251 + 7).collect();
    Image::new(width, height, channels, Pixels::U16(v), Encoding::Srgb).unwrap()
}

fn floats(width: u32, height: u32, channels: u8) -> Image {
    let v: Vec<u8> = bytes(width, height, channels.into());
    let n = usize::from(channels);
    // Alpha of 1 comes back exactly; others are multiplied in and divided out.
    let v =
        v.iter().enumerate().map(|(k, &v)| if n % 2 == 0 && k % n == n - 1 { 1.0 } else { f32::from(v) * 0.37 - 3.0 });
    Image::new(width, height, channels, Pixels::F32(v.collect()), Encoding::Linear).unwrap()
}

fn halves(width: u32, height: u32, channels: u8) -> Image {
    let Pixels::F32(v) = floats(width, height, channels).into_pixels() else { unreachable!() };
    let v = v.into_iter().map(f16::from_f32).collect();
    Image::new(width, height, channels, Pixels::F16(v), Encoding::Linear).unwrap()
}

fn read(path: &Path) -> Image {
    let (image, findings) = decode::image(&fs::read(path).unwrap(), path, &Job::default()).unwrap();
    assert!(findings.is_empty(), "{findings:?}");
    image
}

#[test]
fn lossless_formats_come_back() {
    let folder = Folder::new("lossless");
    let options = WriteOptions { force: true, ..Default::default() };
    for (w, h) in [(1, 1), (7, 3), (257, 130), (5, 1000)] {
        for channels in 1..=4 {
            let all = [
                ("a.png", eight(w, h, channels)),
                ("b.png", sixteen(w, h, channels)),
                ("c.exr", floats(w, h, channels)),
                ("d.exr", halves(w, h, channels)),
                ("e.webp", eight(w, h, channels)),
            ];
            for (name, image) in all {
                let path = folder.0.join(name);
                write::image(&image, &path, &options).unwrap();
                let back = read(&path);
                // WebP knows no grey: it comes back as RGB.
                if !(name.ends_with("webp") && channels < 3) {
                    // An alpha that happens to be opaque is not written.
                    let opaque = image.channels() != back.channels();
                    assert!(opaque || back == image, "{name} {w}x{h}x{channels}");
                }
                for (x, y) in [(0, 0), (w - 1, h - 1), (w / 2, h / 3)] {
                    assert_eq!(back.rgba(x, y), image.rgba(x, y), "{name} {w}x{h}x{channels}");
                }
            }
        }
    }
}

#[test]
fn an_opaque_alpha_is_left_out() {
    let folder = Folder::new("opaque");
    let mut v = bytes(40, 30, 4);
    v.iter_mut().skip(3).step_by(4).for_each(|a| *a = 255);
    let image = Image::new(40, 30, 4, Pixels::U8(v), Encoding::Srgb).unwrap();
    let path = folder.0.join("a.png");
    write::image(&image, &path, &WriteOptions::default()).unwrap();
    let back = read(&path);
    assert_eq!(back.channels(), 3);
    assert!((0..40).all(|x| back.rgba(x, 7) == image.rgba(x, 7)));
}

#[test]
fn radiance_files_come_back_within_their_precision() {
    let folder = Folder::new("hdr");
    for w in [3, 100] {
        let v = bytes(w, 20, 3).iter().map(|&v| f32::from(v) * f32::from(v) * 0.013).collect();
        let image = Image::new(w, 20, 3, Pixels::F32(v), Encoding::Linear).unwrap();
        let path = folder.0.join(format!("{w}.hdr"));
        write::image(&image, &path, &WriteOptions::default()).unwrap();
        let back = read(&path);
        for (x, y) in (0..w).flat_map(|x| (0..20).map(move |y| (x, y))) {
            let (a, b) = (image.rgba(x, y), back.rgba(x, y));
            let most = a[0].max(a[1]).max(a[2]);
            // Half a step of 8 bits, the largest mantissa being at least 128.
            assert!((0..3).all(|c| (a[c] - b[c]).abs() <= most / 256.0 + 1e-12), "{a:?} {b:?}");
        }
    }
}

#[test]
fn jpeg_comes_back_nearly() {
    let folder = Folder::new("jpeg");
    let v = (0..64 * 48 * 3u32).map(|k| (k / 3 % 64 * 2 + k / 192 * 2 + k % 3 * 9) as u8).collect();
    let image = Image::new(64, 48, 3, Pixels::U8(v), Encoding::Srgb).unwrap();
    let path = folder.0.join("a.jpg");
    write::image(&image, &path, &WriteOptions::default()).unwrap();
    let back = read(&path);
    for (x, y) in (0..64).flat_map(|x| (0..48).map(move |y| (x, y))) {
        // A smooth ramp at quality 92: a few codes.
        assert!((image.value(x, y, 1) - back.value(x, y, 1)).abs() < 6.0 / 255.0);
    }
}

fn frame(color: Image) -> Frame {
    let n = (color.width() * color.height()) as usize;
    let mut depth: Vec<f32> = (0..n).map(|k| k as f32).collect();
    (depth[0], depth[1]) = (f32::INFINITY, -0.0);
    let mut normal: Vec<f32> = (0..3 * n).map(|k| k as f32 * -0.5).collect();
    normal[4] = f32::from_bits(0xffc1_2345); // a NaN with a payload
    let mut ids: Vec<u32> = (0..n as u32).collect();
    ids[0] = u32::MAX;
    let plane = |name, channels, unit, space, values| Plane { name, channels, unit, space, values };
    Frame {
        color,
        planes: vec![
            plane("depth", &["Z"], "metres", "view", Values::F32(depth)),
            plane("normal", &["X", "Y", "Z"], "unit vector", "world", Values::F32(normal)),
            plane("object", &["id"], "index", "scene", Values::U32(ids)),
        ],
    }
}

#[test]
fn one_exr_holds_all_planes_with_unit_and_space() {
    use exr::prelude::{AttributeValue, ReadChannels, ReadLayers, Sample, Text};
    let folder = Folder::new("layers");
    let path = folder.0.join("a.exr");
    let mut v = floats(37, 35, 4).into_pixels();
    if let Pixels::F32(v) = &mut v {
        v[..4].copy_from_slice(&[0.5, 1.0, 2.0, 0.25]);
    }
    let f = frame(Image::new(37, 35, 4, v, Encoding::Linear).unwrap());
    assert_eq!(write::frame(&f, &path, &WriteOptions::default()).unwrap(), std::slice::from_ref(&path));
    // Read by a reader that is not ours, and strict.
    let reader = exr::prelude::read().no_deep_data().largest_resolution_level();
    let image = reader.all_channels().all_layers().all_attributes().pedantic().from_file(&path).unwrap();
    let layer = &image.layer_data[0];
    let names: Vec<_> = layer.channel_data.list.iter().map(|c| c.name.to_string()).collect();
    assert_eq!(names, ["A", "B", "G", "R", "depth.Z", "normal.X", "normal.Y", "normal.Z", "object.id"]);
    let sample = |c: usize, k: usize| layer.channel_data.list[c].sample_data.value_by_flat_index(k);
    // Premultiplied.
    let f = Sample::F32;
    assert_eq!([sample(3, 0), sample(2, 0), sample(1, 0), sample(0, 0)], [f(0.125), f(0.25), f(0.5), f(0.25)]);
    assert_eq!((sample(4, 0), sample(4, 7)), (f(f32::INFINITY), f(7.0)));
    assert_eq!((sample(8, 0), sample(8, 9)), (Sample::U32(u32::MAX), Sample::U32(9)));
    let bits = |s| if let Sample::F32(v) = s { v.to_bits() } else { panic!("no float") };
    assert_eq!(bits(sample(6, 1)), 0x7fc0_0000, "one NaN");
    assert_eq!(bits(sample(4, 1)), 0, "no -0");
    let text = |key: &str| {
        let key = Text::new_or_none(key).unwrap();
        match layer.attributes.other.get(&key).or(image.attributes.other.get(&key)) {
            Some(AttributeValue::Text(t)) => t.to_string(),
            other => panic!("{key}: {other:?}"),
        }
    };
    assert_eq!([text("depth.unit"), text("depth.space")], ["metres", "view"]);
    assert_eq!([text("normal.unit"), text("normal.space")], ["unit vector", "world"]);
}

#[test]
fn planes_of_a_png_have_a_file_each() {
    let folder = Folder::new("planes");
    let path = folder.0.join("out.png");
    let files = write::frame(&frame(eight(20, 33, 4)), &path, &WriteOptions::default()).unwrap();
    let names: Vec<_> = files.iter().map(|f| f.file_name().unwrap().to_str().unwrap()).collect();
    assert_eq!(names, ["out.png", "out.depth.exr", "out.normal.exr", "out.object.exr"]);
    let back = decode::image(&fs::read(&files[2]).unwrap(), &files[2], &Job::default()).unwrap();
    assert_eq!((back.0.channels(), back.0.value(3, 0, 1)), (3, -5.0));
    assert_eq!(back.1[0].code, "image.not-finite");
    assert_eq!(folder.names().len(), 4, "nothing else is left");
}

#[test]
fn a_file_that_is_there_is_kept() {
    let folder = Folder::new("exists");
    let path = folder.0.join("a.png");
    fs::write(&path, b"mine").unwrap();
    let image = eight(4, 4, 3);
    let e = write::image(&image, &path, &WriteOptions::default()).unwrap_err();
    assert_eq!((e.fault, e.code), (Fault::Arguments, "write.exists"));
    assert_eq!(fs::read(&path).unwrap(), b"mine");
    // A plane's file counts too, and nothing is written then.
    let other = folder.0.join("b.png");
    fs::write(folder.0.join("b.depth.exr"), b"mine").unwrap();
    let e = write::frame(&frame(eight(4, 4, 4)), &other, &WriteOptions::default()).unwrap_err();
    assert_eq!(e.code, "write.exists");
    assert!(!other.exists());
    write::image(&image, &path, &WriteOptions { force: true, ..Default::default() }).unwrap();
    Frame { color: image, planes: vec![] }.save(&path).unwrap();
    assert_eq!(read(&path).width(), 4);
}

#[test]
fn what_cannot_be_written_says_why_and_leaves_nothing() {
    let folder = Folder::new("cannot");
    let at = |name: &str| folder.0.join(name);
    let code = |image: &Image, name: &str| {
        let e = write::image(image, &at(name), &WriteOptions::default()).unwrap_err();
        assert!(e.remedy.is_some() && e.file.is_some(), "{e}");
        (e.fault, e.code)
    };
    assert_eq!(code(&eight(4, 4, 3), "a.gif"), (Fault::Arguments, "write.format"));
    assert_eq!(code(&eight(4, 4, 3), "a"), (Fault::Arguments, "write.format"));
    assert_eq!(code(&floats(4, 4, 3), "a.png"), (Fault::Arguments, "write.float"));
    assert_eq!(code(&floats(4, 4, 3), "a.jpg"), (Fault::Arguments, "write.float"));
    assert_eq!(code(&sixteen(4, 4, 3), "a.webp"), (Fault::Arguments, "write.bits"));
    assert_eq!(code(&eight(4, 4, 3), "a.exr"), (Fault::Arguments, "write.bits"));
    assert_eq!(code(&eight(4, 4, 3), "a.hdr"), (Fault::Arguments, "write.bits"));
    assert_eq!(code(&eight(4, 4, 3), "none/a.png"), (Fault::Output, "write.failed"));
    let job = Job::default();
    job.cancel();
    let e = write::image(&eight(4, 4, 3), &at("a.png"), &WriteOptions { job, force: true }).unwrap_err();
    assert_eq!(e.fault, Fault::Interrupted);
    assert!(folder.names().is_empty());
}

/// FNV-1a of the pixels' bytes.
fn hash(image: &Image) -> u64 {
    let b: Vec<u8> = match image.pixels() {
        Pixels::U8(v) => v.clone(),
        Pixels::U16(v) => v.iter().flat_map(|v| v.to_le_bytes()).collect(),
        Pixels::F16(v) => v.iter().flat_map(|v| v.to_le_bytes()).collect(),
        Pixels::F32(v) => v.iter().flat_map(|v| v.to_le_bytes()).collect(),
    };
    b.iter().fold(0xcbf2_9ce4_8422_2325, |h, &b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3))
}

/// One file of each format that is read.
fn samples(folder: &Folder) -> Vec<(&'static str, Vec<u8>)> {
    use image::ImageEncoder;
    use image::codecs as c;
    let (rgb, rgba, grey) = (bytes(61, 47, 3), bytes(61, 47, 4), bytes(61, 47, 1));
    let ours = |name: &str, image: Image| {
        let path = folder.0.join(name);
        write::image(&image, &path, &WriteOptions { force: true, ..Default::default() }).unwrap();
        fs::read(path).unwrap()
    };
    let hdr = Image::new(61, 47, 3, floats(61, 47, 3).into_pixels(), Encoding::Linear).unwrap();
    let mut all = vec![
        ("8.png", ours("a.png", eight(61, 47, 4))),
        ("16.png", ours("a.png", sixteen(61, 47, 3))),
        ("f32.exr", ours("a.exr", floats(61, 47, 4))),
        ("f16.exr", ours("a.exr", halves(61, 47, 3))),
        ("a.hdr", ours("a.hdr", hdr)),
    ];
    let mut add = |name, write: &dyn Fn(&mut std::io::Cursor<Vec<u8>>)| {
        let mut out = std::io::Cursor::new(Vec::new());
        write(&mut out);
        all.push((name, out.into_inner()));
    };
    add("rgb.jpg", &|o| c::jpeg::JpegEncoder::new_with_quality(o, 75).encode(&rgb, 61, 47, Color::Rgb8).unwrap());
    add("grey.jpg", &|o| c::jpeg::JpegEncoder::new_with_quality(o, 60).encode(&grey, 61, 47, Color::L8).unwrap());
    add("a.webp", &|o| c::webp::WebPEncoder::new_lossless(o).encode(&rgba, 61, 47, Color::Rgba8).unwrap());
    add("a.tga", &|o| c::tga::TgaEncoder::new(o).encode(&rgba, 61, 47, Color::Rgba8).unwrap());
    add("a.bmp", &|o| c::bmp::BmpEncoder::new(o).encode(&rgb, 61, 47, Color::Rgb8).unwrap());
    add("8.tiff", &|o| c::tiff::TiffEncoder::new(o).write_image(&rgb, 61, 47, Color::Rgb8).unwrap());
    let heights: Vec<f32> = grey.iter().map(|&v| f32::from(v) * 0.25 - 9.0).collect();
    add("f32.tiff", &|o| {
        let mut tiff = tiff::encoder::TiffEncoder::new(o).unwrap();
        tiff.write_image::<tiff::encoder::colortype::Gray32Float>(61, 47, &heights).unwrap();
    });
    all
}

/// Law 6: the same pixels on every machine. CI repeats this test on emulated CPUs.
#[test]
fn every_format_decodes_to_the_same_pixels_everywhere() {
    let got: Vec<String> = samples(&Folder::new("hash"))
        .iter()
        .map(|(name, bytes)| {
            let image = decode::image(bytes, Path::new(name), &Job::default()).unwrap().0;
            format!("{name} {:016x}", hash(&image))
        })
        .collect();
    let want = [
        "8.png 1da91c4358f545ed",
        "16.png 141b5910e6e37221",
        "f32.exr 3bfb924052e2485e",
        "f16.exr 869e169ac1c959b6",
        "a.hdr ee357638fb880966",
        "rgb.jpg bae3f12f34368194",
        "grey.jpg 8f48f49957f97efe",
        "a.webp 1da91c4358f545ed",
        "a.tga 1da91c4358f545ed",
        "a.bmp ee727dfdd3b2f316",
        "8.tiff ee727dfdd3b2f316",
        "f32.tiff aae1ede7f3c8f4e1",
    ];
    assert_eq!(got, want, "{got:#?}");
}

#[test]
fn damaged_pictures_are_errors() {
    for (name, bytes) in samples(&Folder::new("damaged")) {
        let path = Path::new(name);
        let job = Job::default();
        let mut refused = 0;
        let step = (bytes.len() / 40).max(1);
        for k in (0..bytes.len() - step).step_by(step) {
            refused += usize::from(decode::image(&bytes[..k], path, &job).is_err());
            // One wrong byte: anything but a panic.
            let mut wrong = bytes.clone();
            wrong[k] ^= 0x55;
            let _ = decode::image(&wrong, path, &job);
        }
        assert!(refused >= 39, "{name}: {refused}");
    }
    let error = |b: &[u8], name: &str| decode::image(b, Path::new(name), &Job::default()).unwrap_err();
    assert_eq!(error(b"", "a.png").code, "image.unknown-format");
    assert_eq!(error(b"hello", "a.png").code, "image.unknown-format");
    let e = error(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 0 +X 5\n", "a.hdr");
    assert_eq!((e.code, e.fault), ("image.empty", Fault::Input));
    assert_eq!(error(b"#?RADIANCE\n\n-Y 65536 +X 65536\n", "a.hdr").code, "image.too-large");
    assert_eq!(error(b"#?RADIANCE\n\n-Y 30000 +X 30000\n", "a.hdr").code, "image.corrupt");
}

#[test]
fn a_bomb_is_refused_before_it_is_unpacked() {
    // A PNG header that says 60000x17000 with no data to speak of.
    let folder = Folder::new("bomb");
    let path = folder.0.join("a.png");
    write::image(&eight(3, 2, 3), &path, &WriteOptions::default()).unwrap();
    let png = fs::read(&path).unwrap();
    let sized = |w: u32, h: u32| {
        let mut png = png.clone();
        png[16..20].copy_from_slice(&w.to_be_bytes());
        png[20..24].copy_from_slice(&h.to_be_bytes());
        let crc = crc32fast::hash(&png[12..29]);
        png[29..33].copy_from_slice(&crc.to_be_bytes());
        png
    };
    let e = decode::image(&sized(60000, 17000), &path, &Job::builder().memory(100 << 20).build()).unwrap_err();
    assert_eq!((e.fault, e.code), (Fault::Memory, "job.memory"));
    assert_eq!(decode::image(&sized(60000, 70000), &path, &Job::default()).unwrap_err().code, "image.too-large");
    assert_eq!(decode::image(&sized(0, 7), &path, &Job::default()).unwrap_err().fault, Fault::Input);
}

#[test]
fn kinds_of_png_keep_their_depth_and_say_what_is_odd() {
    let encode = |set: &dyn Fn(&mut png::Encoder<&mut Vec<u8>>), data: &[u8]| {
        let mut out = Vec::new();
        let mut e = png::Encoder::new(&mut out, 2, 2);
        set(&mut e);
        e.write_header().unwrap().write_image_data(data).unwrap();
        decode::image(&out, Path::new("a.png"), &Job::default()).unwrap()
    };
    let (palette, _) = encode(
        &|e| {
            e.set_color(png::ColorType::Indexed);
            e.set_depth(png::BitDepth::One);
            e.set_palette(vec![1, 2, 3, 250, 251, 252]);
            e.set_trns(vec![255, 128]);
        },
        &[0b0100_0000, 0b1000_0000],
    );
    let want = vec![1, 2, 3, 255, 250, 251, 252, 128, 250, 251, 252, 128, 1, 2, 3, 255];
    assert_eq!(*palette.pixels(), Pixels::U8(want));
    let (bits, _) = encode(&|e| e.set_depth(png::BitDepth::Two), &[0b0001_0000, 0b1011_0000]);
    assert_eq!(*bits.pixels(), Pixels::U8(vec![0, 85, 170, 255]));
    let (deep, _) = encode(&|e| e.set_depth(png::BitDepth::Sixteen), &[1, 2, 3, 4, 5, 6, 7, 8]);
    assert_eq!(*deep.pixels(), Pixels::U16(vec![0x102, 0x304, 0x506, 0x708]));
    let gamma = |g: f32| encode(&|e| e.set_source_gamma(png::ScaledFloat::new(g)), &[0; 4]);
    let (linear, f) = gamma(1.0);
    assert_eq!((linear.encoding, f[0].code), (Encoding::Linear, "image.linear"));
    assert_eq!(gamma(0.6).1[0].code, "image.gamma-ignored");
    assert!(gamma(0.45455).1.is_empty());
}
