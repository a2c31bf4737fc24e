//! Models, images and scene files: path in, scene and findings out. The only room that reads files.
//!
//! Every size is asked from the [`Job`] before it is allocated, every index is checked before it leaves, and
//! no file outside of the asset's folder is opened unless [`LoadOptions::allow_outside`] says so.

pub mod decode;
pub mod files;
pub mod gltf;
pub mod mtl;
pub mod obj;
pub mod ply;
pub mod stl;
mod text;
pub mod toml;
mod triangulate;

use crate::error::{Error, Finding, Result};
use crate::job::{Job, Reservation};
use crate::math::vec::Vec3;
use crate::scene::light::default_rig;
use crate::scene::{Material, Model, Scene, ToneMap};
use files::{Blob, Root};
use std::path::Path;
use std::sync::Mutex;

/// How files are read.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// Threads, memory, progress, cancellation.
    pub job: Job,
    /// Whether files outside of the folder of the model or scene may be read.
    pub allow_outside: bool,
}

/// A scene and what was odd about its files.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// What could not be used, or was guessed.
    pub findings: Vec<Finding>,
}

/// Whether a model's own materials are wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Materials {
    /// As the file says.
    Own,
    /// Others take their place: none are made, and no image is opened.
    Replaced,
}

/// A model format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Glb,
    Gltf,
    Obj,
    Ply,
    Stl,
}

const FORMATS: &str = "readable are .glb, .gltf, .obj, .ply and .stl models, and .toml scenes";

impl Format {
    /// By a file's ending or a word, in any case.
    fn named(word: &str) -> Option<Format> {
        [("glb", Format::Glb), ("gltf", Format::Gltf), ("obj", Format::Obj), ("ply", Format::Ply), ("stl", Format::Stl)]
            .into_iter()
            .find_map(|(name, format)| word.eq_ignore_ascii_case(name).then_some(format))
    }
    /// By the first bytes.
    fn guessed(head: &[u8], len: u64) -> Option<Format> {
        let text = head.trim_ascii_start();
        if head.starts_with(b"glTF") {
            Some(Format::Glb)
        } else if head.starts_with(b"ply\n") || head.starts_with(b"ply\r") {
            Some(Format::Ply)
        } else if text.starts_with(b"{") {
            Some(Format::Gltf)
        } else if text.starts_with(b"solid") || stl::length_fits(head, len) {
            Some(Format::Stl)
        } else {
            let starts = |line: &[u8]| [&b"v "[..], b"mtllib ", b"o ", b"g "].iter().any(|w| line.starts_with(w));
            text.split(|&b| b == b'\n').take(50).any(starts).then_some(Format::Obj)
        }
    }
}

/// What a file that is no model is, as far as its first bytes tell.
fn unknown(head: &[u8], path: &Path) -> Error {
    const OTHERS: [(&[u8], &str); 8] = [
        (b"Kaydara FBX Binary", "an FBX model"),
        (b"BLENDER", "a Blender file"),
        (b"PXR-USDC", "a USD scene"),
        (b"#usda", "a USD scene"),
        (b"PK\x03\x04", "a ZIP archive"),
        (b"\x1f\x8b", "a gzip archive"),
        (b"%PDF", "a PDF document"),
        (b"\x28\xb5\x2f\xfd", "a zstd archive"),
    ];
    let (message, remedy) = if let Some(kind) = decode::picture(head, path) {
        let remedy = "pictures are maps of a model: --albedo and its like, or a material of a scene file";
        (format!("this is a {kind} picture, not a model"), format!("{remedy}; {FORMATS}"))
    } else if let Some((_, what)) = OTHERS.iter().find(|(magic, _)| head.starts_with(magic)) {
        (format!("this is {what}, which frieze does not read"), FORMATS.to_owned())
    } else if head.is_empty() {
        ("the file is empty".to_owned(), FORMATS.to_owned())
    } else {
        ("this is not a model that frieze knows".to_owned(), FORMATS.to_owned())
    };
    Error::input("load.unknown-format", message).in_file(path).remedy(remedy)
}

/// What a loader works with: the file, its neighbours, the budget, and what it found.
pub(crate) struct Context<'a> {
    /// The file's name, for findings and errors.
    pub name: &'a Path,
    /// Where the files that it names are looked for.
    pub root: &'a Root,
    /// Threads, memory, cancellation.
    pub job: &'a Job,
    /// Whether materials are wanted.
    pub wanted: Materials,
    held: Mutex<Vec<Reservation>>,
}

impl<'a> Context<'a> {
    fn new(name: &'a Path, root: &'a Root, job: &'a Job, wanted: Materials) -> Self {
        Context { name, root, job, wanted, held: Mutex::default() }
    }
    /// Asks for `bytes` until loading ends; see [`Job::reserve`].
    pub fn reserve(&self, bytes: u64, what: &str) -> Result<()> {
        let held = self.job.reserve(bytes, what)?;
        self.held.lock().expect("no thread panics while it holds the list").push(held);
        Ok(())
    }
    /// The file's name without folder and ending.
    pub fn stem(&self) -> String {
        self.name.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned())
    }
}

/// Findings with a limit per code, so that a broken file of a million lines is told about once.
#[derive(Debug, Default)]
pub(crate) struct Findings {
    list: Vec<Finding>,
    counts: Vec<(&'static str, u64)>,
}

impl Findings {
    /// Most findings that are told apart per code.
    const EACH: u64 = 8;

    /// Adds a finding, or counts it when its code is known well enough.
    pub fn push(&mut self, finding: Finding) {
        let k = self.counts.iter().position(|c| c.0 == finding.code).unwrap_or_else(|| {
            self.counts.push((finding.code, 0));
            self.counts.len() - 1
        });
        self.counts[k].1 += 1;
        if self.counts[k].1 <= Self::EACH {
            self.list.push(finding);
        }
    }
    /// Adds all.
    pub fn extend(&mut self, findings: impl IntoIterator<Item = Finding>) {
        findings.into_iter().for_each(|f| self.push(f));
    }
    /// The list; the last of a code that was found too often says how often.
    pub fn finish(mut self, file: &Path) -> Vec<Finding> {
        for (code, count) in self.counts {
            if count > Self::EACH
                && let Some(last) = self.list.iter_mut().rfind(|f| f.code == code)
            {
                last.message += &format!(" (and {} more like it)", count - Self::EACH);
            }
        }
        self.list.into_iter().map(|f| f.in_file(file)).collect()
    }
}

/// Loads a model (`.glb .gltf .obj .ply .stl`) or a scene (`.toml`).
///
/// A bare model gets a fitted camera, the Khronos PBR Neutral tone map and, if it has no lights, a default rig.
/// Materials of glTF are metallic-roughness and take the file's word on double-sidedness; those of OBJ are
/// Blinn-Phong (metallic-roughness when the MTL has `Pr` or `Pm`), those of PLY and STL a light grey
/// Blinn-Phong, all of them double-sided. Cameras of the file are in [`Scene::cameras`] by name.
///
/// # Errors
/// Input faults name the file, the place in it and a remedy; [`crate::error::Fault::Memory`] over the budget.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Loaded> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        return toml::load(path, options);
    }
    let root = Root::of(path, options.allow_outside)?;
    let (mut scene, findings) = model(path, &root, options, Materials::Own)?;
    dress(&mut scene);
    Ok(Loaded { scene, findings })
}

/// Loads a model from memory. `kind` is `glb`, `gltf`, `obj`, `ply` or `stl`. No file is opened: what the model
/// keeps elsewhere is missing (a finding for images and materials, an error for geometry).
///
/// # Errors
/// As [`load`]; `load.unknown-format` for another `kind`.
pub fn load_bytes(kind: &str, bytes: &[u8], options: &LoadOptions) -> Result<Loaded> {
    let Some(format) = Format::named(kind) else {
        return Err(Error::arguments("load.unknown-format", format!("`{kind}` is no model format")).remedy(FORMATS));
    };
    let root = Root::nowhere();
    let name = Path::new("memory").with_extension(kind);
    let (mut scene, findings) = read(format, Blob::from(bytes), &name, &root, options, Materials::Own)?;
    dress(&mut scene);
    Ok(Loaded { scene, findings })
}

/// Reads a model as it is: no default lights, no tone map. `path` is a path that [`Root::resolve`] gave or that
/// the user named; files that the model names are looked for beside it and stay within `root`.
pub(crate) fn model(
    path: &Path,
    root: &Root,
    options: &LoadOptions,
    wanted: Materials,
) -> Result<(Scene, Vec<Finding>)> {
    let blob = Blob::open(path)?;
    let extension = path.extension().map(|e| e.to_string_lossy().into_owned()).unwrap_or_default();
    let format = match Format::named(&extension) {
        Some(format) => format,
        None => {
            let mut head = vec![0; blob.len().min(4096) as usize];
            blob.read_at(0, &mut head).map_err(|e| e.in_file(path))?;
            Format::guessed(&head, blob.len()).ok_or_else(|| unknown(&head, path))?
        }
    };
    read(format, blob, path, &root.beside(path)?, options, wanted)
}

fn read(
    format: Format,
    blob: Blob<'_>,
    name: &Path,
    root: &Root,
    options: &LoadOptions,
    wanted: Materials,
) -> Result<(Scene, Vec<Finding>)> {
    let job = &options.job;
    let context = Context::new(name, root, job, wanted);
    let mut findings = Findings::default();
    job.progress("load", 0, 1);
    let result = job.run(|| match format {
        Format::Glb => gltf::read_glb(&blob, &context, &mut findings),
        Format::Gltf => gltf::read_gltf(&blob, &context, &mut findings),
        Format::Obj => obj::read(&blob, &context, &mut findings),
        Format::Ply => ply::read(&blob, &context, &mut findings),
        Format::Stl => stl::read(&blob, &context, &mut findings),
    });
    let mut scene = result.map_err(|e| e.in_file(name))?;
    job.check()?;
    let findings = findings.finish(name);
    if scene.objects.iter().all(|o| scene.meshes[o.mesh].triangle_count() == 0) {
        let why = findings.first().map_or_else(String::new, |f| format!(": {}", f.message));
        return Err(Error::input("mesh.empty", format!("the file holds no triangle{why}"))
            .in_file(name)
            .remedy("points, lines and empty scenes cannot be rendered; export the surface as triangles"));
    }
    within_reach(&scene).map_err(|e| e.in_file(name))?;
    scene.name = context.stem();
    job.progress("load", 1, 1);
    Ok((scene, findings))
}

/// Farthest coordinate of a scene, metres: squares of distances stay within f32, so that a camera can be fitted.
const FARTHEST: f32 = 1e18;

/// Refuses what lies farther away than any camera can see.
///
/// # Errors
/// `mesh.too-far`
pub(crate) fn within_reach(scene: &Scene) -> Result<()> {
    let far = |v: [f32; 3]| v.iter().any(|c| c.abs() > FARTHEST);
    let Some((lo, hi)) = scene.bounds() else { return Ok(()) };
    if !far(lo.array()) && !far(hi.array()) {
        return Ok(());
    }
    let error = |what: &str| {
        Error::input("mesh.too-far", format!("{what} is more than {FARTHEST:e} m away from the origin"))
            .remedy("such numbers are mostly damage or a wrong unit: mend the file, or scale it down")
    };
    for (m, mesh) in scene.meshes.iter().enumerate() {
        if let Some(k) = mesh.positions.iter().position(|p| far(*p)) {
            return Err(error(&format!("a vertex, {:?},", mesh.positions[k])).at(format!("mesh {m}, vertex {k}")));
        }
    }
    Err(error("an object"))
}

/// Decodes an image file.
///
/// # Errors
/// Input faults name the file, the place in it and a remedy.
pub fn image(path: &Path, options: &LoadOptions) -> Result<(crate::image::Image, Vec<Finding>)> {
    let bytes = files::read_path(path, u64::MAX, &options.job)?;
    options.job.run(|| decode::image(&bytes, path, &options.job))
}

/// What a bare model gets: the tone map, and lights if it has none.
fn dress(scene: &mut Scene) {
    scene.output.tone_map = ToneMap::KhronosNeutral;
    if scene.lights.is_empty() {
        let zero = Vec3::splat(0.0);
        scene.lights = default_rig(scene.bounds().unwrap_or((zero, zero)));
        // A metallic-roughness surface reflects albedo / pi of a light, a Blinn-Phong surface the albedo.
        let pbr = |m: &Material| m.model == Model::Pbr;
        if scene.materials.iter().any(pbr) {
            scene.lights.iter_mut().for_each(|l| l.intensity *= core::f32::consts::PI);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::View;

    const TRIANGLE: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

    #[test]
    fn a_bare_model_gets_lights_a_tone_map_and_a_fitted_camera() {
        let scene = load_bytes("obj", TRIANGLE, &LoadOptions::default()).unwrap().scene;
        assert_eq!(scene.output.tone_map, ToneMap::KhronosNeutral);
        assert_eq!(scene.view, View::Auto);
        assert_eq!(scene.lights.len(), 2);
        assert!(scene.lights[0].shadow.is_some() && scene.lights[1].shadow.is_none());
        assert_eq!(scene.lights[0].intensity, 0.8);
    }

    #[test]
    fn a_model_without_triangles_is_an_error_that_says_so() {
        let error = load_bytes("obj", b"v 0 0 0\n", &LoadOptions::default()).unwrap_err();
        assert_eq!(error.code, "mesh.empty");
        assert_eq!(error.fault, crate::error::Fault::Input);
    }

    #[test]
    fn formats_are_told_by_their_first_bytes() {
        let guess = |b: &[u8]| Format::guessed(b, b.len() as u64);
        assert_eq!(guess(b"glTF\x02"), Some(Format::Glb));
        assert_eq!(guess(b" {\"asset\""), Some(Format::Gltf));
        assert_eq!(guess(b"ply\nformat"), Some(Format::Ply));
        assert_eq!(guess(b"solid x\n"), Some(Format::Stl));
        assert_eq!(guess(TRIANGLE), Some(Format::Obj));
        assert_eq!(guess(b"\x89PNG"), None);
        assert_eq!(guess(&[b'x'; 200]), None, "a header of STL that promises anything proves nothing");
        assert_eq!(load_bytes("fbx", b"", &LoadOptions::default()).unwrap_err().code, "load.unknown-format");
    }

    #[test]
    fn a_thousand_findings_of_a_kind_are_told_in_eight() {
        let mut findings = Findings::default();
        for k in 0..1000 {
            findings.push(Finding::note("a.b", format!("number {k}"), "nothing"));
        }
        let list = findings.finish(Path::new("f"));
        assert_eq!(list.len(), 8);
        assert!(list[7].message.ends_with("(and 992 more like it)"), "{}", list[7].message);
    }
}
