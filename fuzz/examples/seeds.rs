//! Writes the first inputs of every fuzz target into `fuzz/corpus`: small valid files of each format, made by code.

#[path = "../../crates/frieze/tests/hostile/corpus.rs"]
mod corpus;

use frieze::image::{Encoding, Image, Pixels};
use frieze::write::{self, WriteOptions};
use image::ImageEncoder;
use image::{ExtendedColorType as Color, codecs};
use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

struct Out(PathBuf);

impl Out {
    fn put(&self, target: &str, name: &str, bytes: &[u8]) {
        let folder = self.0.join(target);
        fs::create_dir_all(&folder).expect("a folder can be made");
        fs::write(folder.join(name), bytes).expect("the folder can be written");
    }
}

fn main() {
    let out = Out(Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus"));
    models(&out);
    out.put("toml", "whole", SCENE.as_bytes());
    out.put("toml", "least", b"[camera]\neye=[0,1,5]\n[[object]]\nmesh=\"model.obj\"\n");
    for kind in ["cube", "plane", "sphere", "torus", "teapot"] {
        let scene =
            format!("[[object]]\nmesh = {{ primitive = \"{kind}\", segments = 3 }}\n[[light]]\nkind = \"point\"\n");
        out.put("toml", kind, (scene + "position = [1, 2, 3]\n").as_bytes());
    }
    pictures(&out);
    deep(&out);
}

fn models(out: &Out) {
    for (k, (kind, bytes)) in corpus::corpus().into_iter().enumerate() {
        out.put(kind, &format!("hostile-{k}"), &bytes);
    }
    let (mut document, bin) = corpus::document();
    let mut split = document.to_string().into_bytes();
    split.push(0);
    split.extend(&bin);
    out.put("glb", "split", &split);
    document["buffers"][0] = serde_json::json!({"uri": "a.bin", "byteLength": 256});
    document["images"] = serde_json::json!([{"uri": "a.png"}, {"uri": "b.png"}]);
    for view in document["bufferViews"].as_array_mut().expect("it is a list").iter_mut() {
        view["byteLength"] = (view["byteLength"].as_u64().unwrap_or(0).min(80)).into();
    }
    out.put("gltf", "files", document.to_string().as_bytes());
    let textured = "mtllib a.mtl\nv 0 0 0\nv 1 0 0 1 0 0\nv 1 1 0\nv 0 1 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n\
                    usemtl a\ns off\nf 1/1/1 2/2/1 3/3/1 4/4/1\ng b\nusemtl b\nf 4//1 3//1 1//1\nusemtl c\nf 1 -2 -1\n";
    let materials = "newmtl a\nKa .1 .1 .1\nKd 1 1 1\nKs .5\nNs 32\nd .5\nillum 2\nmap_Kd -s 2 2 -o .5 0 a.png\n\
                     map_Bump -bm 0.5 a.png\nmap_Ka a.png\nmap_Ks -imfchan l a.png\nmap_Ns a.png\nmap_d a.png\n\
                     newmtl b\nPr .5\nPm 1\nmap_Pr a.png\nmap_Pm -clamp on b.png\nnorm b.png\ndisp -mm 0 0.2 h.exr\n\
                     Ke 1 0 0\nmap_Ke A.PNG\nnewmtl c\nTr 0.5\nNi 1.5\nmap_Kd C:\\x\\a.png\n";
    out.put("obj", "textured", format!("{textured}\0{materials}").as_bytes());
}

/// What a scene file can say.
const SCENE: &str = r#"
version = 1
[output]
size = [8, 6]
background = "transparent"
tone_map = "aces"
encode = "linear"
samples = 8
supersample = 2
[[camera]]
eye = [0, 1, 5]
target = [0, 0, 0]
up = [0, 1, 0]
fov_y = 45.0
near = 0.1
far = 100.0
[[camera]]
name = "o"
matrix = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]
projection = "orthographic"
height = 4.0
[[camera]]
eye = [1, 2, 3]
intrinsics = { fx = 500, fy = 500, cx = 4, cy = 3 }
[ambient]
color = [0.2, 0.2, 0.2]
per_light = true
environment = { file = "sky.hdr", projection = "latlong" }
[[light]]
kind = "directional"
position = [-2, 4, -1]
target = [0, 0, 0]
color = "\#ff8000"
shadow = { size = 16, filter = "pcf", radius = 1, bias = 0.005, projection = "orthographic", near = 1.0, far = 7.5, extent = 10.0, wrap = "repeat", cascades = 1 }
[[light]]
kind = "spot"
position = [1, 2, 3]
direction = [-1, -1, -1]
inner_angle = 10
outer_angle = 20
falloff = "inverse-square"
range = 20
intensity = 40.0
[[object]]
mesh = "model.obj"
translate = [0, 0.5, 0]
rotate = [0, 30, 0]
scale = [0.5, 0.5, -0.5]
material = "wood"
instances = [[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]]
[[object]]
mesh = { primitive = "cube", size = 1.0, uv_scale = [2, 1] }
rotate_axis = [1, 0, 1]
rotate_angle = 60.0
material = "metal"
[material.wood]
model = "blinn-phong"
shading = "gouraud"
diffuse = [1, 1, 1]
specular = [0.3, 0.3, 0.3]
shininess = 64.0
alpha = "mask"
cutoff = 0.4
normals = "angle"
tangent_frame = "games101"
tbn_path = "tangent"
diffuse_map = { file = "a.png", filter = "trilinear", wrap = ["repeat", "border"], srgb = true, uv_scale = [2, 2], rotate = 30 }
bump_map = { file = "b.png", strength = 0.5 }
[material.metal]
model = "pbr"
alpha = "blend"
opacity = 0.5
base_color_map = { file = "a.png", filter = "ewa" }
normal_map = { file = "b.png", filter = "anisotropic", max_anisotropy = 16, y = "down" }
metallic = 1.0
roughness_map = { file = "a.png", channel = "luminance", filter = "bicubic" }
displacement_map = { file = "h.exr", scale = 0.1 }
occlusion_map = { file = "a.png", filter = "supersample", taps = 16, strength = 0.5 }
"#;

/// Smooth areas and noise.
fn bytes(n: u32) -> Vec<u8> {
    (0..n).map(|k| if k / 20 % 2 == 0 { (k * 3) as u8 } else { (k.wrapping_mul(2_654_435_761) >> 24) as u8 }).collect()
}

fn file(write: &dyn Fn(&mut Cursor<Vec<u8>>)) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    write(&mut out);
    out.into_inner()
}

fn pictures(out: &Out) {
    let (w, h) = (19, 9);
    let colors = [(Color::L8, 1), (Color::La8, 2), (Color::Rgb8, 3), (Color::Rgba8, 4)];
    for (color, n) in colors {
        let data = bytes(w * h * n);
        let put = |name: &str, write: &dyn Fn(&mut Cursor<Vec<u8>>)| {
            out.put("picture", &format!("{name}-{n}"), &file(write));
        };
        put("png", &|o| codecs::png::PngEncoder::new(o).write_image(&data, w, h, color).expect("PNG"));
        put("tga", &|o| codecs::tga::TgaEncoder::new(o).encode(&data, w, h, color).expect("TGA"));
        put("tga-raw", &|o| {
            codecs::tga::TgaEncoder::new(o).disable_rle().encode(&data, w, h, color).expect("TGA");
        });
        put("bmp", &|o| codecs::bmp::BmpEncoder::new(o).encode(&data, w, h, color).expect("BMP"));
        put("webp", &|o| codecs::webp::WebPEncoder::new_lossless(o).encode(&data, w, h, color).expect("WebP"));
        if n % 2 == 1 {
            put("jpeg", &|o| {
                codecs::jpeg::JpegEncoder::new_with_quality(o, 60).encode(&data, w, h, color).expect("JPEG");
            });
        }
    }
    for (depth, n) in [(png::BitDepth::One, 1), (png::BitDepth::Two, 2), (png::BitDepth::Four, 4)] {
        for palette in [false, true] {
            let mut data = Vec::new();
            let mut png = png::Encoder::new(&mut data, 16, 3);
            png.set_depth(depth);
            if palette {
                png.set_color(png::ColorType::Indexed);
                png.set_palette(bytes(48));
                png.set_trns(vec![0, 128]);
            }
            png.write_header().and_then(|mut w| w.write_image_data(&bytes(2 * n * 3))).expect("PNG");
            out.put("picture", &format!("png-{n}-bits-{palette}"), &data);
        }
    }
    let wide = Image::new(5, 3, 4, Pixels::U16((0..60).map(|k| k * 1000).collect()), Encoding::Srgb);
    out.put("picture", "png-16", &ours("a.png", wide.expect("it fits")));
    for (name, text) in WEBP {
        out.put("picture", name, &from_base64(text));
    }
}

/// Pictures of one pixel with features that no encoder written in Rust has.
const WEBP: [(&str, &str); 3] = [
    ("webp-lossy", "UklGRiIAAABXRUJQVlA4IBYAAAAwAQCdASoBAAEADsD+JaQAA3AAAAAA"),
    (
        "webp-alpha",
        "UklGRkoAAABXRUJQVlA4WAoAAAAQAAAAAAAAAAAAQUxQSAwAAAARBxAR/Q9ERP8DAABWUDggGAAAABQBAJ0BKgEAAQAAAP4AAA3AAP7mtQAAAA==",
    ),
    (
        "webp-animated",
        "UklGRlIAAABXRUJQVlA4WAoAAAASAAAAAAAAAAAAQU5JTQYAAAD/////AABBTk1GJgAAAAAAAAAAAAAAAAAAAGQAAABWUDhMDQAAAC8AAAAQBxAREYiI/gcA",
    ),
];

fn from_base64(text: &str) -> Vec<u8> {
    const DIGITS: &str = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let digits: Vec<u8> = text.chars().filter_map(|c| DIGITS.find(c)).map(|d| d as u8).collect();
    let bits = digits.chunks(4).flat_map(|c| {
        let word = c.iter().enumerate().fold(0u32, |w, (k, &d)| w | u32::from(d) << (18 - 6 * k));
        word.to_be_bytes().into_iter().skip(1).take(c.len() - 1)
    });
    bits.collect()
}

/// As our own encoders write it.
fn ours(name: &str, image: Image) -> Vec<u8> {
    let path = std::env::temp_dir().join(format!("frieze-seed-{}-{name}", std::process::id()));
    write::image(&image, &path, &WriteOptions { force: true, ..Default::default() }).expect("the file can be written");
    let bytes = fs::read(&path).expect("it was written");
    fs::remove_file(&path).expect("it was written");
    bytes
}

fn deep(out: &Out) {
    use exr::prelude as e;
    use exr::prelude::WritableImage;
    use tiff::encoder::{Compression, TiffEncoder, colortype as t};
    let values: Vec<f32> = (0..57u16).map(|k| f32::from(k) * 0.37 - 3.0).collect();
    for width in [19, 3] {
        let data = values[..width as usize * 3].to_vec();
        let image = Image::new(width, 1, 3, Pixels::F32(data), Encoding::Linear).expect("it fits");
        out.put("picture", &format!("hdr-{width}"), &ours("a.hdr", image));
    }
    let methods = [
        ("raw", Compression::Uncompressed),
        ("lzw", Compression::Lzw),
        ("deflate", Compression::Deflate(Default::default())),
        ("packbits", Compression::Packbits),
    ];
    for (name, method) in methods {
        let put = |kind: &str, write: &dyn Fn(&mut TiffEncoder<&mut Cursor<Vec<u8>>>)| {
            let bytes = file(&|o| write(&mut TiffEncoder::new(o).expect("TIFF").with_compression(method)));
            out.put("picture", &format!("tiff-{kind}-{name}"), &bytes);
        };
        let (b, s) = (bytes(57 * 4), (0..228u16).map(|k| k * 200).collect::<Vec<_>>());
        put("1", &|o| o.write_image::<t::Gray8>(19, 3, &b[..57]).expect("TIFF"));
        put("3", &|o| o.write_image::<t::RGB8>(19, 3, &b[..171]).expect("TIFF"));
        put("4x16", &|o| o.write_image::<t::RGBA16>(19, 3, &s).expect("TIFF"));
        put("float", &|o| o.write_image::<t::Gray32Float>(19, 3, &values).expect("TIFF"));
        put("rgb-float", &|o| o.write_image::<t::RGB32Float>(19, 1, &values).expect("TIFF"));
    }
    let methods = [
        ("raw", e::Compression::Uncompressed),
        ("rle", e::Compression::RLE),
        ("zip1", e::Compression::ZIP1),
        ("zip16", e::Compression::ZIP16),
        ("piz", e::Compression::PIZ),
        ("pxr24", e::Compression::PXR24),
        ("b44", e::Compression::B44),
        ("b44a", e::Compression::B44A),
    ];
    for (name, compression) in methods {
        for tiles in [false, true] {
            let blocks = if tiles { e::Blocks::Tiles(e::Vec2(4, 4)) } else { e::Blocks::ScanLines };
            let encoding = e::Encoding { compression, blocks, line_order: e::LineOrder::Increasing };
            let channels = e::SpecificChannels::rgba(|p: e::Vec2<usize>| {
                (p.x() as f32 * 0.3, half::f16::from_f32(p.y() as f32), p.x() as u32, 0.5f32)
            });
            let layer = e::Layer::new((9, 5), e::LayerAttributes::named("x"), encoding, channels);
            let bytes = file(&|o| e::Image::from_layer(layer.clone()).write().to_buffered(o).expect("EXR"));
            out.put("picture", &format!("exr-{name}-{tiles}"), &bytes);
        }
    }
    for n in [1, 4] {
        let data = (0..6 * 2 * u16::from(n)).map(|k| half::f16::from_f32(f32::from(k) * 0.1)).collect();
        let image = Image::new(6, 2, n, Pixels::F16(data), Encoding::Linear).expect("it fits");
        out.put("picture", &format!("exr-half-{n}"), &ours("a.exr", image));
    }
}
