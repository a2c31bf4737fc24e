//! `frieze inspect`: what is in a model, a scene or a picture.

use crate::args::{Common, Inspect};
use crate::talk::{self, Talk};
use crate::{source, version};
use frieze::Result;
use frieze::error::Finding;
use frieze::image::Image;
use frieze::inspect::basis::BasisReport;
use frieze::inspect::{self, ImageReport, NormalReport, SceneReport};
use frieze::load::LoadOptions;
use serde_json::json;
use std::fmt::Write;
use std::path::Path;

/// Endings of pictures.
const PICTURES: [&str; 11] = ["png", "jpg", "jpeg", "webp", "tga", "bmp", "tif", "tiff", "hdr", "exr", "pic"];

/// Looks.
pub fn run(a: &Inspect, common: &Common, talk: &Talk) -> Result<()> {
    // Nothing here depends on it, but a wrong word is told about by every verb.
    version::level()?;
    let job = talk.job(common);
    let options = LoadOptions { job: job.clone(), allow_outside: a.allow_outside };
    let ending = a.file.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let name = a.file.display().to_string();
    if PICTURES.contains(&&*ending) {
        let (image, mut findings) = frieze::load::image(&a.file, &options)?;
        // With a mesh, the user says that it is one.
        let used = if a.mesh.is_some() { vec!["normal"] } else { Vec::new() };
        let mut report = inspect::image(&image, used, &job)?;
        report.used_as.clear();
        if let Some(n) = &report.normal_map {
            findings.extend(inspect::normal::findings(n).into_iter().map(|f| f.in_file(&a.file)));
        }
        let basis = match (&a.mesh, &report.normal_map) {
            (Some(mesh), Some(n)) => Some(basis(mesh, &image, n, &options, &mut findings)?),
            (Some(_), None) => {
                return Err(frieze::Error::input("inspect.not-normals", "a picture of one channel is no normal map")
                    .in_file(&a.file)
                    .remedy("leave out --mesh"));
            }
            _ => None,
        };
        talk.finish();
        if talk.json {
            let mut document = json!({ "file": name, "image": report, "findings": findings });
            if let Some(b) = &basis {
                document["basis"] = json!(b);
            }
            return talk.document("inspect", document);
        }
        let more = basis.as_ref().map_or_else(String::new, basis_text);
        talk::data(format!("{name}\n{}{more}", image_text(&report)).as_bytes())?;
        talk.findings(&findings);
        return Ok(());
    }
    if a.mesh.is_some() {
        return Err(frieze::Error::arguments("inspect.mesh", "--mesh goes with a picture, and this is none")
            .in_file(&a.file)
            .remedy("name the normal map first: frieze inspect MAP --mesh MODEL"));
    }
    let mut loaded = source::open(&a.file, &options)?;
    let mut report = inspect::scene(&loaded.scene, &job)?;
    talk.finish();
    loaded.findings.append(&mut report.findings);
    let findings: &[Finding] = &loaded.findings;
    if talk.json {
        return talk.document("inspect", json!({ "file": name, "scene": report, "findings": findings }));
    }
    talk::data(scene_text(&name, &report).as_bytes())?;
    talk.findings(findings);
    Ok(())
}

/// Which basis of the model's largest mesh the map fits.
fn basis(
    model: &Path,
    image: &Image,
    report: &NormalReport,
    options: &LoadOptions,
    findings: &mut Vec<Finding>,
) -> Result<BasisReport> {
    let loaded = source::open(model, options)?;
    let meshes = loaded.scene.meshes.iter();
    // The first of the largest.
    let Some(mesh) = meshes.rev().max_by_key(|m| (m.uv[0].is_some(), m.triangle_count())) else {
        return Err(frieze::Error::input("inspect.no-mesh", "there is no mesh in it").in_file(model));
    };
    let r = inspect::basis::fit(mesh, image, &report.evidence, &options.job).map_err(|e| e.in_file(model))?;
    findings.extend(loaded.findings);
    findings.extend(inspect::basis::findings(&r).into_iter().map(|f| f.in_file(model)));
    Ok(r)
}

fn basis_text(r: &BasisReport) -> String {
    let mut t = format!(
        "tangent basis: {}, green {} ({:.0} % sure); {} edges, {} of them seams\n",
        r.basis,
        r.green,
        r.confidence * 100.0,
        r.edges[0],
        r.edges[1]
    );
    for f in &r.fits {
        let _ = writeln!(
            t,
            "  {:<13} green {:<5} sides of edges differ by {:.2} degrees, of seams by {:.2}",
            f.basis, f.green, f.angle, f.seam_angle
        );
    }
    let _ = writeln!(t, "  as object space: {:.1} degrees from the mesh's own normals", r.object_angle);
    let _ = writeln!(
        t,
        "  texture coordinates: {} triangles, {} mirrored, {} without area, {:.1} % of the texture used twice",
        r.uv.triangles,
        r.uv.mirrored,
        r.uv.degenerate,
        r.uv.overlap * 100.0
    );
    t
}

/// `12 345 678`
fn spaced(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (k, c) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(c);
    }
    text
}

/// `12.3 MiB`, or KiB where that would be next to nothing.
fn size_text(bytes: u64) -> String {
    if bytes < 1 << 20 {
        format!("{:.1} KiB", bytes as f64 / 1024.0)
    } else {
        format!("{:.1} MiB", bytes as f64 / 1_048_576.0)
    }
}

/// `1 object`, `2 objects`
fn number(n: usize, one: &str, many: &str) -> String {
    format!("{} {}", spaced(n as u64), if n == 1 { one } else { many })
}

fn named(name: &str) -> &str {
    if name.is_empty() { "(no name)" } else { name }
}

fn scene_text(file: &str, r: &SceneReport) -> String {
    /// Lines per list; --json has all of them.
    const MOST: usize = 20;
    let mut t = format!("{file}\n");
    // Writing to a string does not fail.
    let _ = writeln!(
        t,
        "  {} in {} of {}, {}, {}",
        number(r.totals.triangles as usize, "triangle", "triangles"),
        number(r.objects.len(), "object", "objects"),
        number(r.meshes.len(), "mesh", "meshes"),
        number(r.totals.vertices as usize, "vertex", "vertices"),
        size_text(r.totals.mesh_bytes)
    );
    let _ = writeln!(
        t,
        "  {}, {} ({}), {}, {}",
        number(r.materials.len(), "material", "materials"),
        number(r.images.len(), "image", "images"),
        size_text(r.totals.image_bytes),
        number(r.lights.len(), "light", "lights"),
        number(r.cameras.len(), "camera", "cameras")
    );
    if let Some([lo, hi]) = r.bounds {
        let size: [f32; 3] = core::array::from_fn(|k| hi[k] - lo[k]);
        let _ = writeln!(t, "  bounds {} to {} m, size {} m", short(&lo), short(&hi), short(&size));
    }
    let more = |t: &mut String, n: usize| {
        if n > MOST {
            let _ = writeln!(t, "  ... and {} more; --json lists them all", n - MOST);
        }
    };
    let _ = writeln!(t, "meshes");
    for m in r.meshes.iter().take(MOST) {
        let has = [("normals", m.normals), ("tangents", m.tangents), ("colors", m.colors)];
        let has: Vec<&str> = has.into_iter().filter(|h| h.1).map(|h| h.0).collect();
        let _ = write!(t, "  {}: {} triangles, {} vertices", named(&m.name), m.triangles, m.vertices);
        let _ = write!(t, "{}", if m.faces == m.triangles { String::new() } else { format!(", {} polygons", m.faces) });
        let _ = writeln!(t, "; {}", if has.is_empty() { "positions only".to_owned() } else { has.join(", ") });
        for (set, uv) in m.uv.iter().enumerate() {
            let Some(uv) = uv else { continue };
            let _ = write!(t, "    uv{set} {} to {}", short(&uv.min), short(&uv.max));
            for (n, what) in [
                (uv.mirrored, "mirrored"),
                (uv.degenerate, "degenerate"),
                (uv.outside, "outside 0..1"),
                (uv.not_finite, "not finite"),
            ] {
                if n > 0 {
                    let _ = write!(t, ", {n} {what}");
                }
            }
            t.push('\n');
        }
    }
    more(&mut t, r.meshes.len());
    let dense: Vec<_> = r.objects.iter().filter_map(|o| Some((o, o.texel_density?))).collect();
    if !dense.is_empty() {
        let _ = writeln!(t, "texels per metre (smallest, median, largest)");
        for (o, d) in dense.iter().take(MOST) {
            let _ = writeln!(t, "  {}: {:.1}, {:.1}, {:.1}", named(&o.name), d.min, d.median, d.max);
        }
        more(&mut t, dense.len());
    }
    if !r.materials.is_empty() {
        let _ = writeln!(t, "materials");
        for m in r.materials.iter().take(MOST) {
            let maps: Vec<String> = m.maps.iter().map(|(name, k)| format!("{name} = image {k}")).collect();
            let _ = writeln!(
                t,
                "  {}: {}{}{}",
                named(&m.name),
                m.model,
                if maps.is_empty() { "" } else { "; " },
                maps.join(", ")
            );
        }
        more(&mut t, r.materials.len());
    }
    if !r.images.is_empty() {
        let _ = writeln!(t, "images");
        for (k, i) in r.images.iter().enumerate().take(MOST) {
            let _ = write!(t, "  {k}: {}", image_text(i).trim_start());
        }
        more(&mut t, r.images.len());
    }
    for (title, list) in [
        (
            "lights",
            r.lights
                .iter()
                .map(|l| (&l.name, format!("{}{}", l.kind, if l.shadow { ", casts shadows" } else { "" })))
                .collect::<Vec<_>>(),
        ),
        ("cameras", r.cameras.iter().map(|c| (&c.name, c.projection.to_owned())).collect()),
    ] {
        if !list.is_empty() {
            let _ = writeln!(t, "{title}");
        }
        for (name, about) in list.iter().take(MOST) {
            let _ = writeln!(t, "  {}: {about}", named(name));
        }
        more(&mut t, list.len());
    }
    t
}

fn image_text(i: &ImageReport) -> String {
    let used = if i.used_as.is_empty() { String::new() } else { format!(", used as {}", i.used_as.join(", ")) };
    let mut t = format!(
        "  {}x{}, {} channels of {}, {}, {}{used}\n",
        i.width,
        i.height,
        i.channels,
        i.kind,
        i.encoding,
        size_text(i.bytes)
    );
    if let Some(n) = i.normal_map {
        normal_text(&mut t, &n);
    }
    t
}

fn normal_text(t: &mut String, n: &NormalReport) {
    let e = &n.evidence;
    let which = match n.green {
        "up" => "green points up (+Y, OpenGL, glTF)",
        "down" => "green points down (-Y, DirectX)",
        _ => "cannot tell whether green points up or down",
    };
    let _ = writeln!(t, "    normal map: likeness {:.0} %", e.likeness * 100.0);
    let mut line = |what: &str, sure: f32, evidence: String| {
        let sure = format!("{:.0} %", sure * 100.0);
        let _ = writeln!(t, "      {what:<46} {sure:>5}  {evidence}");
    };
    line(
        which,
        e.green.confidence,
        format!(
            "curl correlation {:.2}, {:.1} deviations, scale {} px",
            e.green.correlation, e.green.significance, e.green.scale
        ),
    );
    line(
        &format!("space: {}", e.space.value),
        e.space.confidence,
        format!("{:.1} % point inward, mean {}", e.space.behind * 100.0, short(&e.space.mean)),
    );
    line(
        &format!("layout: {}", e.layout.value),
        e.layout.confidence,
        format!("z moves by {:.4}, x and y ask for {:.4}", e.layout.z_spread, e.layout.rebuilt_spread),
    );
    line(
        &format!("curve: {}", e.curve.value),
        e.curve.confidence,
        format!("middle of red and green {}", short(&e.curve.median.map(|m| m * 255.0))),
    );
    line(
        &format!("flat code: {}", e.neutral.value),
        e.neutral.confidence,
        format!(
            "codes {:?}, {:.1} % and {:.1} % of the texels",
            e.neutral.codes,
            e.neutral.share[0] * 100.0,
            e.neutral.share[1] * 100.0
        ),
    );
    line(
        &format!("lengths: {}", e.length.value),
        e.length.confidence,
        format!(
            "{:.1} % off by over 0.03, mean {:.3}, 95th {:.3}",
            e.length.off_share * 100.0,
            e.length.mean_error,
            e.length.p95_error
        ),
    );
    line(
        &format!("edges: {}", e.tiles.value),
        e.tiles.confidence,
        format!("step across over the largest inside {}", short(&e.tiles.step)),
    );
    line(
        &format!("banding: {}", e.banding.value),
        e.banding.confidence,
        format!("{:?} values in {} codes of 8 bits", e.banding.levels, short(&e.banding.span)),
    );
}

#[test]
fn numbers_for_people_are_short() {
    assert_eq!(short(&[1.0714779, -0.0, 21489.9, 0.1, -1e-12, 2.5e8]), "[1.07148, -0, 21489.9, 0.1, -0, 250000000]");
}

/// Numbers for people: six significant digits; `--json` has them all.
fn short(numbers: &[f32]) -> String {
    let one = |v: &f32| {
        let exponent = format!("{v:.5e}").split_once('e').and_then(|(_, e)| e.parse::<i32>().ok()).unwrap_or(0);
        let text = format!("{v:.*}", (5 - exponent).clamp(0, 9) as usize);
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    };
    format!("[{}]", numbers.iter().map(one).collect::<Vec<_>>().join(", "))
}
