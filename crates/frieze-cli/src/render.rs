//! `frieze render`: a model or a scene to a picture.

use crate::args::{Common, Later, Maps, Model, Plane, Render, Shading, did_you_mean};
use crate::bench::{self, Bench};
use crate::talk::{self, Talk};
use crate::{preview, source, version, view};
use frieze::error::Finding;
use frieze::image::{Encoding, Image, Pixels};
use frieze::load::LoadOptions;
use frieze::prepare::{Needs, Prepared};
use frieze::render::{Format, Overlay, Overlays, RenderOptions, Report, frame, light_depth};
use frieze::scene::{Material, NormalMap, Scene, Texture};
use frieze::write::WriteOptions;
use frieze::{Error, Frame, Result};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Where the picture goes.
#[derive(Debug, PartialEq)]
enum Target {
    Stdout,
    File(PathBuf),
}

/// What `--json` prints.
#[derive(Serialize)]
struct Document<'a> {
    scene: &'a str,
    outputs: Vec<String>,
    size: [u32; 2],
    simd: &'static str,
    threads: usize,
    seed: u64,
    time_ms: BTreeMap<&'static str, f64>,
    stages: BTreeMap<&'static str, f64>,
    counters: BTreeMap<&'static str, u64>,
    peak_bytes: u64,
    findings: &'a [Finding],
    #[serde(skip_serializing_if = "Option::is_none")]
    bench: Option<Bench>,
}

/// Renders.
pub fn run(a: &Render, common: &Common, talk: &Talk) -> Result<()> {
    not_yet(&a.later)?;
    let level = version::level()?;
    let word = a.scene.clone().unwrap_or_else(|| "sample:frieze".into());
    let target = target(a, &word)?;
    let format = match &target {
        Target::Stdout => Format::U8,
        Target::File(path) => format(path, a.bits)?,
    };
    if target == Target::Stdout {
        refuse_on_stdout(a, common)?;
    }
    // The showpiece may overwrite its own picture, so that the first command can be typed twice.
    let force = common.force || a.scene.is_none() && a.out.is_none();
    let paths: Vec<PathBuf> = match (&target, a.turntable) {
        (Target::Stdout, _) => Vec::new(),
        (Target::File(path), None) => vec![path.clone()],
        (Target::File(path), Some(n)) => (0..n).map(|k| numbered(path, k, n)).collect(),
    };
    // Before any work: nobody wants to hear this after ten minutes.
    let job = talk.job(common);
    let write = WriteOptions { force, job: job.clone() };
    let planes: Vec<&str> = frieze::render::Aov::ALL
        .iter()
        .filter(|(_, aov)| a.aov.contains(&Plane::Extra(*aov)) || a.aov.contains(&Plane::All))
        .map(|(name, _)| *name)
        .collect();
    for path in &paths {
        frieze::write::check(path, &planes, &write)?;
    }

    let mut clock = Clock::new();
    let options = LoadOptions { job: job.clone(), allow_outside: a.allow_outside };
    let mut loaded = source::open(&word, &options)?;
    apply(&mut loaded.scene, a, &options, &mut loaded.findings)?;
    clock.lap("load");
    talk.findings(&loaded.findings);
    let scene = &loaded.scene;
    let [w, h] = scene.output.size;
    let size = a.size.unwrap_or((w, h));
    // Left to the library where nothing asks for another.
    let camera = match (&a.camera, a.turntable, a.bench) {
        (None, None, None) => None,
        (choice, _, _) => Some(view::camera(scene, choice.as_ref(), size)?),
    };
    let extra = |p: &Plane| if let Plane::Extra(aov) = p { Some(*aov) } else { None };
    let aovs = if a.aov.contains(&Plane::All) {
        frieze::render::Aov::ALL.map(|(_, aov)| aov).to_vec()
    } else {
        a.aov.iter().filter_map(extra).collect()
    };
    let overlays = Overlays {
        list: a.overlay.clone(),
        length: a.overlay_length,
        width: a.overlay_width,
        spacing: a.overlay_spacing,
    };
    let needs = Needs { tangents: a.overlay.contains(&Overlay::Tbn) };
    let samples = a.samples.unwrap_or(0);
    let options = RenderOptions { job: job.clone(), level, size, samples, camera, format, aovs, overlays };
    let light = a.light_depth.as_deref().map(|word| light(scene, word)).transpose()?;
    let name = scene.name.clone();
    // From here on frames are made of what was prepared; large scenes need not be held twice.
    let prepared = Prepared::consume(std::mem::take(&mut loaded.scene), &needs, &options.job)?;
    talk.findings(&prepared.findings);
    loaded.findings.extend(prepared.findings.iter().cloned());
    job.check()?;
    clock.lap("prepare");

    let mut written = Vec::new();
    let (mut shown, mut report): (Option<Frame>, _) = (None, Report::default());
    for k in 0..a.turntable.unwrap_or(1) {
        let camera = match (&options.camera, a.turntable) {
            (Some(c), Some(n)) => Some(view::turned(c, f64::from(k) / f64::from(n))),
            (c, _) => c.clone(),
        };
        let picture;
        (picture, report) = match light {
            None => frame(&prepared, &RenderOptions { camera, ..options.clone() })?,
            Some(number) => (depth_map(&prepared, number, &options)?, Report::default()),
        };
        job.check()?;
        clock.lap("render");
        match &target {
            Target::Stdout => {
                // Encoded whole before the first byte leaves, so that a failure leaves nothing behind.
                let mut png = Vec::new();
                frieze::write::png_to(&mut png, &picture, &job)?;
                job.check()?;
                talk.finish();
                talk::data(&png)?;
            }
            Target::File(_) => written.extend(frieze::write::frame(&picture, &paths[k as usize], &write)?),
        }
        clock.lap("write");
        if shown.is_none() {
            shown = Some(picture);
        }
    }
    talk.findings(&report.findings);
    loaded.findings.append(&mut report.findings);
    talk.finish();
    let size = shown.as_ref().map_or(size, |p| (p.color.width(), p.color.height()));
    if let Some(picture) = shown.as_ref().filter(|_| a.preview) {
        let (columns, lines) = terminal_size::terminal_size_of(std::io::stderr())
            .map_or((80, 40), |(w, h)| (u32::from(w.0), u32::from(h.0).saturating_sub(2)));
        let color = std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty());
        talk.show(&preview::blocks(&picture.color, columns, lines, color));
    }
    let total = clock.total();
    say_what_was_written(talk, &target, &written, size, total, &loaded.findings);
    let bench = match a.bench {
        None => None,
        Some(n) => {
            let base = options.camera.clone().expect("a benchmark has a camera");
            let options = RenderOptions { format: Format::U8, aovs: Vec::new(), ..options.clone() };
            let bench = bench::run(&prepared, &options, &base, n)?;
            talk.finish();
            talk.say(bench.to_string());
            Some(bench)
        }
    };
    if talk.json {
        talk.document(
            "render",
            Document {
                scene: &name,
                outputs: written.iter().map(|p| p.display().to_string()).collect(),
                size: size.into(),
                simd: level.name(),
                threads: job.threads(),
                seed: common.seed,
                time_ms: clock.finish(total),
                stages: bench::sums(&report.stages),
                counters: report.counters.iter().copied().collect(),
                peak_bytes: job.peak(),
                findings: &loaded.findings,
                bench,
            },
        )?;
    }
    Ok(())
}

/// The light of that name or number.
///
/// # Errors
/// `light.unknown`.
fn light(scene: &Scene, word: &str) -> Result<usize> {
    let by_name = scene.lights.iter().position(|l| l.name == word);
    let by_number = || word.parse().ok().filter(|k| *k < scene.lights.len());
    by_name.or_else(by_number).ok_or_else(|| {
        let names: Vec<&str> = scene.lights.iter().map(|l| &l.name[..]).filter(|n| !n.is_empty()).collect();
        let error = Error::arguments("light.unknown", format!("no light is `{word}`{}", did_you_mean(word, &names)));
        error.remedy(match (scene.lights.len(), names.is_empty()) {
            (0, _) => "the scene has no lights".to_owned(),
            (n, true) => format!("its lights have the numbers 0 to {}", n - 1),
            (n, false) => format!("its lights have the numbers 0 to {}; names are {}", n - 1, names.join(", ")),
        })
    })
}

/// The depth map of a light in the kind of numbers that the file holds, never encoded: a code of 8 bits is
/// `round(255 depth)`.
fn depth_map(prepared: &Prepared, number: usize, options: &RenderOptions) -> Result<Frame> {
    let map = light_depth(prepared, number, options)?;
    let (width, height) = (map.width(), map.height());
    let pixels = match (map.into_pixels(), options.format) {
        (Pixels::F32(v), Format::U8) => Pixels::U8(v.iter().map(|d| (d * 255.0).round() as u8).collect()),
        (Pixels::F32(v), Format::U16) => Pixels::U16(v.iter().map(|d| (d * 65535.0).round() as u16).collect()),
        (pixels, _) => pixels,
    };
    Ok(Frame { color: Image::new(width, height, 1, pixels, Encoding::Linear)?, planes: Vec::new() })
}

/// Tells where the picture is.
fn say_what_was_written(
    talk: &Talk,
    target: &Target,
    written: &[PathBuf],
    (w, h): (u32, u32),
    total: Duration,
    findings: &[Finding],
) {
    let took = if total.as_secs_f64() < 1.0 {
        format!("{} ms", total.as_millis())
    } else {
        format!("{:.2} s", total.as_secs_f64())
    };
    let odd = match findings.len() {
        0 => String::new(),
        1 => ", 1 finding (above)".to_owned(),
        n => format!(", {n} findings (above)"),
    };
    let place = match (target, written) {
        (Target::Stdout, _) => "stdout".to_owned(),
        (_, [one]) => {
            let full = one.canonicalize().unwrap_or_else(|_| one.clone());
            let bytes = std::fs::metadata(one).map_or(0, |m| m.len());
            talk.say(format!("{}  ({w}x{h}, {} KB, {took}{odd})", full.display(), bytes.div_ceil(1000)));
            return;
        }
        (_, [first, .., last]) => {
            format!("{} files, from {} to {}", written.len(), first.display(), last.display())
        }
        (_, []) => return,
    };
    talk.say(format!("{place}  ({w}x{h}, {took}{odd})"));
}

/// Where the picture goes; a folder takes the default name.
fn target(a: &Render, word: &Path) -> Result<Target> {
    let name = || {
        let stem = source::sample(word).map(Into::into).or_else(|| word.file_stem().map(ToOwned::to_owned));
        let mut name = stem.unwrap_or_else(|| "frieze".into());
        name.push(".png");
        PathBuf::from(name)
    };
    Ok(match &a.out {
        None => Target::File(name()),
        Some(out) if out.as_os_str() == "-" => Target::Stdout,
        Some(out) if out.is_dir() => Target::File(out.join(name())),
        Some(out) => Target::File(out.clone()),
    })
}

/// What the file that `path` names holds.
fn format(path: &Path, bits: u8) -> Result<Format> {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let wrong = |message: String| {
        Err(Error::arguments("write.format", message).in_file(path).remedy("use .png, .exr, .hdr, .jpg or .webp"))
    };
    match (&*ending, bits) {
        ("png", 16) => Ok(Format::U16),
        ("png", _) | ("jpg" | "jpeg" | "webp", 8) => Ok(Format::U8),
        ("exr" | "hdr", _) => Ok(Format::F32),
        ("jpg" | "jpeg" | "webp", _) => wrong(format!(".{ending} has 8 bits per channel, not {bits}")),
        ("", _) => wrong("the output has no ending that says what to write".into()),
        _ => wrong(format!("pictures cannot be written as .{ending}")),
    }
}

fn refuse_on_stdout(a: &Render, common: &Common) -> Result<()> {
    let clash = |what: &str| {
        Err(Error::arguments("arguments.stdout", format!("`-o -` and {what} exclude each other: stdout takes one PNG"))
            .remedy("write to a file with -o FILE"))
    };
    match () {
        () if common.json => clash("--json"),
        () if a.turntable.is_some() => clash("--turntable"),
        () if a.aov.iter().any(|p| *p != Plane::Color) => clash("--aov"),
        () if a.bits != 8 => clash("--bits 16"),
        () => Ok(()),
    }
}

/// `out.png` of the `k`th of `n`: `out.000.png`.
fn numbered(path: &Path, k: u32, n: u32) -> PathBuf {
    let digits = (n - 1).to_string().len().max(3);
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(format!(".{k:0digits$}."));
    name.push(path.extension().unwrap_or_default());
    path.with_file_name(name)
}

/// The options that change the scene.
fn apply(scene: &mut Scene, a: &Render, options: &LoadOptions, findings: &mut Vec<Finding>) -> Result<()> {
    let maps = &a.maps;
    let changes = a.shading.is_some() || a.material.is_some();
    if !changes && [&maps.albedo, &maps.normal_map, &maps.occlusion].iter().all(|m| m.is_none()) {
        return Ok(());
    }
    // Objects without a material get one that can be changed.
    if scene.objects.iter().any(|o| o.materials.is_empty()) {
        let plain = scene.add_material(Material::default());
        for object in scene.objects.iter_mut().filter(|o| o.materials.is_empty()) {
            object.materials.push(plain);
        }
    }
    for material in &mut scene.materials {
        if let Some(shading) = a.shading {
            material.shading = match shading {
                Shading::Flat => frieze::scene::Shading::Flat,
                Shading::Gouraud => frieze::scene::Shading::Gouraud,
                Shading::Phong => frieze::scene::Shading::Phong,
            };
        }
        if let Some(model) = a.material {
            change_model(material, model);
        }
    }
    apply_maps(scene, maps, options, findings)
}

fn apply_maps(scene: &mut Scene, maps: &Maps, options: &LoadOptions, findings: &mut Vec<Finding>) -> Result<()> {
    let mut add = |file: &Option<PathBuf>| -> Result<Option<usize>> {
        let Some(file) = file else { return Ok(None) };
        // The user has named this file: it may lie anywhere.
        let (image, found) = frieze::load::image(file, &LoadOptions { allow_outside: true, ..options.clone() })?;
        findings.extend(found);
        Ok(Some(scene.add_image(image)))
    };
    let (albedo, normal, occlusion) = (add(&maps.albedo)?, add(&maps.normal_map)?, add(&maps.occlusion)?);
    for material in &mut scene.materials {
        if let Some(k) = albedo {
            material.albedo_map = Some(Texture::new(k));
            material.albedo = [maps.albedo_scale.unwrap_or(1.0); 3];
        }
        if let Some(k) = normal {
            material.normal_map = Some(NormalMap {
                texture: Texture::new(k),
                scale: maps.normal_map_scale.unwrap_or(1.0),
                y_down: false,
                channels: 3,
            });
        }
        if let Some(k) = occlusion {
            material.occlusion_map = Some(Texture::new(k));
            material.occlusion_strength = maps.occlusion_scale.unwrap_or(1.0);
        }
    }
    Ok(())
}

/// Another reflection model with a highlight of about the same width: alpha² = 2 / (n + 2), the usual match
/// of a Blinn-Phong exponent n and a microfacet distribution (Walter et al. 2007), roughness = sqrt(alpha).
fn change_model(m: &mut Material, to: Model) {
    match (to, m.model) {
        (Model::Pbr, frieze::scene::Model::BlinnPhong) => {
            m.roughness = (2.0 / (m.shininess.max(0.0) + 2.0)).sqrt().sqrt();
            m.model = frieze::scene::Model::Pbr;
        }
        (Model::BlinnPhong, frieze::scene::Model::Pbr) => {
            let alpha = (m.roughness * m.roughness).clamp(0.01, 1.0);
            m.shininess = 2.0 / (alpha * alpha) - 2.0;
            m.specular = m.albedo.map(|c| 0.04 + (c - 0.04) * m.metallic);
            m.model = frieze::scene::Model::BlinnPhong;
        }
        (Model::Pbr, _) => m.model = frieze::scene::Model::Pbr,
        (Model::BlinnPhong, _) => m.model = frieze::scene::Model::BlinnPhong,
    }
}

/// The words of the contract that this version cannot honour.
fn not_yet(a: &Later) -> Result<()> {
    let words = [
        ("--bump", a.bump.is_some() || a.bump_scale.is_some()),
        ("--displacement", a.displacement.is_some() || a.displacement_scale.is_some()),
        ("--parallax", a.parallax.is_some() || a.parallax_scale.is_some()),
        ("--environment", a.environment.is_some() || a.environment_scale.is_some()),
        ("--method", a.method.as_deref().is_some_and(|m| m != "raster")),
        ("--export-mesh", a.export_mesh.is_some()),
        ("--exact", a.exact),
    ];
    match words.iter().find(|(_, typed)| *typed) {
        None => Ok(()),
        Some((word, _)) => Err(Error::arguments(
            "arguments.not-yet",
            format!("{word} comes with a later version of frieze; {} has it not yet", env!("CARGO_PKG_VERSION")),
        )
        .remedy("`frieze render --help` lists what this version can do")),
    }
}

/// Wall time per step.
struct Clock {
    start: Instant,
    last: Instant,
    laps: BTreeMap<&'static str, f64>,
}

impl Clock {
    fn new() -> Self {
        let now = Instant::now();
        Clock { start: now, last: now, laps: BTreeMap::new() }
    }
    /// The time since the last lap counts for `what`.
    fn lap(&mut self, what: &'static str) {
        let now = Instant::now();
        *self.laps.entry(what).or_default() += (now - self.last).as_secs_f64() * 1e3;
        self.last = now;
    }
    fn total(&self) -> Duration {
        self.start.elapsed()
    }
    fn finish(mut self, total: Duration) -> BTreeMap<&'static str, f64> {
        self.laps.insert("total", total.as_secs_f64() * 1e3);
        self.laps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turntable_names() {
        assert_eq!(numbered(Path::new("d/out.png"), 7, 36), Path::new("d/out.007.png"));
        assert_eq!(numbered(Path::new("a.b.exr"), 0, 1), Path::new("a.b.000.exr"));
        assert_eq!(numbered(Path::new("o.png"), 12, 10001), Path::new("o.00012.png"));
    }

    #[test]
    fn endings_decide_the_format() {
        assert_eq!(format(Path::new("a.PNG"), 8).unwrap(), Format::U8);
        assert_eq!(format(Path::new("a.png"), 16).unwrap(), Format::U16);
        assert_eq!(format(Path::new("a.exr"), 8).unwrap(), Format::F32);
        for (name, bits) in [("a.jpg", 16), ("a.gif", 8), ("a", 8)] {
            assert_eq!(format(Path::new(name), bits).unwrap_err().fault.exit_code(), 2, "{name}");
        }
    }

    #[test]
    fn changing_the_model_there_and_back_keeps_the_highlight() {
        let mut m = Material { shininess: 64.0, ..Material::default() };
        change_model(&mut m, Model::Pbr);
        change_model(&mut m, Model::BlinnPhong);
        // Two square roots and two squares of an f32.
        assert!((m.shininess - 64.0).abs() < 1e-3, "{}", m.shininess);
    }
}
