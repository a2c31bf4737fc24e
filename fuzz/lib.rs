//! What the fuzz targets share: options with a small budget, a folder for what a file may name, and what is done
//! with a scene that could be loaded.

use frieze::job::Job;
use frieze::load::{LoadOptions, Loaded, load, load_bytes};
use frieze::render::{RenderOptions, render};
use frieze::{Error, Result, Scene};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

#[path = "../crates/frieze/tests/hostile/promises.rs"]
pub mod promises;

/// What loading, and then rendering, may hold.
const BUDGET: u64 = 64 << 20;

/// One thread, so that an execution is the same each time, and a small budget.
fn options() -> &'static LoadOptions {
    static OPTIONS: OnceLock<LoadOptions> = OnceLock::new();
    OPTIONS.get_or_init(|| {
        hook();
        LoadOptions { job: Job::builder().threads(1).memory(BUDGET).build(), allow_outside: false }
    })
}

/// libFuzzer's hook aborts at every panic, but those of other crates' decoders are turned into errors; when they are
/// not, the target's own frame sees them and aborts.
fn hook() {
    let abort = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        let foreign = info.location().is_some_and(|l| l.file().contains("/registry/"));
        if !(foreign && frieze::load::decode::is_guarded()) {
            abort(info);
        }
    }));
}

/// A folder of this process, in memory where the system has such a place.
pub struct Folder(PathBuf);

impl Folder {
    /// With pictures (`a.png`, `b.png` of 16 bits, `h.exr`), a buffer (`a.bin`) and a model (`model.obj`) in it.
    pub fn new() -> Folder {
        let shm = Path::new("/dev/shm");
        let base = if shm.is_dir() { shm.to_owned() } else { std::env::temp_dir() };
        let folder = Folder(base.join(format!("frieze-fuzz-{}", std::process::id())));
        fs::create_dir_all(&folder.0).expect("a folder can be made");
        let png = |depth, color, data: &[u8]| {
            let mut out = Vec::new();
            let mut png = png::Encoder::new(&mut out, 2, 2);
            png.set_depth(depth);
            png.set_color(color);
            png.write_header().and_then(|mut w| w.write_image_data(data)).expect("memory can be written");
            out
        };
        let pixels: Vec<u8> = (0..48).map(|k| k * 5).collect();
        folder.put("a.png", &png(png::BitDepth::Eight, png::ColorType::Rgba, &pixels[..16]));
        folder.put("b.png", &png(png::BitDepth::Sixteen, png::ColorType::Rgb, &pixels[..24]));
        use exr::prelude::{Image, SpecificChannels, WritableImage};
        let height = SpecificChannels::build().with_channel("Y").with_pixel_fn(|p| (p.x() as f32 * 0.25 - 0.5,));
        let mut exr = std::io::Cursor::new(Vec::new());
        Image::from_channels((3, 2), height).write().to_buffered(&mut exr).expect("memory can be written");
        folder.put("h.exr", &exr.into_inner());
        folder.put("a.bin", &(0..64u8).flat_map(|k| f32::from(k % 7).to_le_bytes()).collect::<Vec<_>>());
        folder.put("model.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n");
        folder
    }
    /// Writes a file.
    pub fn put(&self, name: &str, bytes: &[u8]) {
        fs::write(self.0.join(name), bytes).expect("the folder can be written");
    }
    /// Loads a file and goes on with what it holds.
    pub fn load(&self, name: &str) {
        within(|| load(&self.0.join(name), options()));
    }
    /// The folder of the process.
    pub fn get() -> &'static Folder {
        static FOLDER: OnceLock<Folder> = OnceLock::new();
        FOLDER.get_or_init(Folder::new)
    }
}

impl Default for Folder {
    fn default() -> Self {
        Folder::new()
    }
}

/// Loads a model from memory and goes on with what it holds.
pub fn model(kind: &str, data: &[u8]) {
    within(|| load_bytes(kind, data, options()));
}

/// All of it on the job's thread: to pass work from thread to thread takes long on a busy machine.
fn within(load: impl FnOnce() -> Result<Loaded> + Send) {
    options().job.run(|| follow(load()));
}

/// Checks an error's promises, or those of a scene; small scenes are rendered.
fn follow(result: Result<Loaded>) {
    match result {
        Ok(loaded) => {
            promises::check(&loaded.scene);
            assert!(loaded.findings.iter().all(|f| f.code.contains('.') && !f.message.is_empty()));
            if small(&loaded.scene) {
                draw(loaded.scene);
            }
        }
        Err(e) => told(&e),
    }
}

/// An error has a code and a message.
fn told(e: &Error) {
    assert!(e.code.contains('.') && !e.message.is_empty(), "{e:?}");
}

/// Whether a scene is rendered within a millisecond or so.
fn small(scene: &Scene) -> bool {
    let triangles: usize = scene.objects.iter().map(|o| scene.meshes[o.mesh].triangle_count()).sum();
    let texels: u64 = scene.images.iter().map(|i| u64::from(i.width()) * u64::from(i.height())).sum();
    triangles <= 1000 && texels <= 1 << 14 && scene.objects.len() <= 16 && scene.lights.len() <= 4
}

fn draw(mut scene: Scene) {
    scene.output.supersample = 1;
    for shadow in scene.lights.iter_mut().filter_map(|l| l.shadow.as_mut()) {
        shadow.size = shadow.size.min(16);
    }
    let options = RenderOptions { job: options().job.clone(), size: (16, 12), samples: 4, ..Default::default() };
    match render(&scene, &options) {
        Ok(frame) => assert_eq!((frame.color.width(), frame.color.height()), (16, 12)),
        Err(e) => told(&e),
    }
}

/// Decodes a picture; small ones get their mip levels. What has no first bytes that tell is read as TGA.
pub fn picture(bytes: &[u8]) {
    let job = &options().job;
    let name = if nameless(bytes) { "a.tga" } else { "a.png" };
    match frieze::load::decode::image(bytes, Path::new(name), job) {
        Ok((image, _)) => {
            assert!(image.width() > 0 && image.height() > 0 && (1..=4).contains(&image.channels()));
            if u64::from(image.width()) * u64::from(image.height()) <= 1 << 12 {
                let rgba = image.rgba(image.width() - 1, image.height() - 1);
                assert!(rgba.iter().all(|v| v.is_finite()), "{rgba:?}");
                frieze::image::pyramid::Pyramid::new(&image, true);
            }
        }
        Err(e) => told(&e),
    }
}

/// Whether no format that has first bytes of its own begins so.
fn nameless(bytes: &[u8]) -> bool {
    const OTHERS: [&[u8]; 8] = [b"\x89PNG", b"\xff\xd8", b"RIFF", b"BM", b"II", b"MM", b"#?", b"\x76\x2f\x31\x01"];
    !OTHERS.iter().any(|m| bytes.starts_with(m))
}

/// The two parts of an input that stands for two files: before and after the first zero byte.
pub fn halves(data: &[u8]) -> (&[u8], &[u8]) {
    match data.iter().position(|&b| b == 0) {
        Some(at) => (&data[..at], &data[at + 1..]),
        None => (data, &[]),
    }
}
