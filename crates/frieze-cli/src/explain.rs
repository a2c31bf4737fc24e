//! `frieze explain`: why a pixel has its colour.

use crate::args::{Common, Explain};
use crate::talk::{self, Talk};
use crate::{source, version, view};
use frieze::explain::{Color, Encoded, Explanation, Fragment, LightTerm, Lookup, Named, Shadow};
use frieze::load::LoadOptions;
use frieze::render::RenderOptions;
use frieze::{Error, Result};
use serde_json::json;
use std::fmt::Write;

/// Explains.
pub fn run(a: &Explain, common: &Common, talk: &Talk) -> Result<()> {
    let level = version::level()?;
    let job = talk.job(common);
    let options = LoadOptions { job: job.clone(), allow_outside: a.allow_outside };
    let loaded = source::open(&a.scene, &options)?;
    let [w, h] = loaded.scene.output.size;
    let size = a.size.unwrap_or((w, h));
    let (x, y) = a.pixel;
    if x >= size.0 || y >= size.1 {
        return Err(Error::arguments(
            "explain.pixel",
            format!("the picture is {}x{}; it has no pixel {x},{y}", size.0, size.1),
        )
        .remedy("columns count from the left and rows from the top, both from 0; --size makes the picture larger"));
    }
    // Left to the library where nothing asks for another, as `render` does: the same picture.
    let camera = match &a.camera {
        None => None,
        choice => Some(view::camera(&loaded.scene, choice.as_ref(), size)?),
    };
    let options = RenderOptions { job, level, size, camera, ..RenderOptions::default() };
    let e = frieze::explain(&loaded.scene, &options, x, y)?;
    talk.finish();
    let name = a.scene.display().to_string();
    if talk.json {
        return talk.document("explain", json!({ "scene": name, "explanation": e, "findings": loaded.findings }));
    }
    talk::data(text(&name, &e).as_bytes())?;
    talk.findings(&loaded.findings);
    Ok(())
}

/// The text. Writing to a string does not fail.
struct Page(String);

impl Page {
    fn title(&mut self, text: &str) {
        let _ = writeln!(self.0, "\n{text}");
    }
    /// `  name            value   remark`
    fn row(&mut self, name: &str, value: impl AsRef<str>, remark: &str) {
        let line = format!("  {name:<16}{:<44}  {remark}", value.as_ref());
        let _ = writeln!(self.0, "{}", line.trim_end());
    }
    fn line(&mut self, text: impl AsRef<str>) {
        let _ = writeln!(self.0, "{}", text.as_ref());
    }
}

/// Numbers in columns of ten.
fn numbers(values: &[f32]) -> String {
    let each: Vec<String> = values.iter().map(|v| number(*v)).collect();
    each.join(" ")
}

fn number(v: f32) -> String {
    let size = v.abs();
    if size != 0.0 && !(1e-4..1e5).contains(&size) { format!("{v:>10.3e}") } else { format!("{v:>10.5}") }
}

fn named(n: &Named) -> String {
    if n.name.is_empty() { format!("{} (no name)", n.index) } else { format!("{} \"{}\"", n.index, n.name) }
}

fn text(scene: &str, e: &Explanation) -> String {
    let mut p = Page(String::new());
    let [x, y] = e.pixel;
    p.line(format!("{scene}, pixel {x},{y} of {}x{} (from the upper left corner, from 0)", e.size[0], e.size[1]));
    let n = e.samples.len();
    let super_ = if e.supersample > 1 { format!(" in {0}x{0} averaged pixels", e.supersample) } else { String::new() };
    p.line(format!("{n} coverage samples{super_}, eye at {} m (world)", numbers(&e.eye).trim_start()));
    if e.background_only {
        p.title("Nothing is seen here: no triangle covers a sample of the pixel, it is background");
    } else {
        coverage(&mut p, e);
    }
    for (k, f) in e.fragments.iter().enumerate() {
        fragment(&mut p, k, f, n);
    }
    color(&mut p, &e.color);
    p.0
}

fn coverage(p: &mut Page, e: &Explanation) {
    p.title("Coverage: what each sample sees");
    p.line("  sample   x, y in the pixel        reversed depth   sees (depth is 1 at the near plane, 0 at the far)");
    /// Lines per list; --json has all of them.
    const MOST: usize = 16;
    for (k, s) in e.samples.iter().enumerate().take(MOST) {
        let mut sees = s.fragment.map_or("background".to_owned(), |f| format!("[{f}]"));
        for layer in &s.layers {
            sees += &format!(" under [{layer}]");
        }
        p.line(format!("  {k:>6}  {}  {:>15}   {sees}", numbers(&s.place), number(s.depth)));
    }
    more(p, e.samples.len(), MOST);
}

fn more(p: &mut Page, n: usize, most: usize) {
    if n > most {
        p.line(format!("    ... and {} more; --json lists them all", n - most));
    }
}

fn fragment(p: &mut Page, k: usize, f: &Fragment, samples: usize) {
    p.title(&format!(
        "[{k}] {} triangle in {} of {samples} samples, {:.2} % of the pixel",
        f.kind,
        f.samples,
        f.share * 100.0
    ));
    p.row("object", named(&f.object), "");
    p.row("mesh", named(&f.mesh), "");
    p.row("material", f.material.as_ref().map_or("the default".to_owned(), named), "");
    p.row("model", format!("{}, {} shading", f.model, f.shading), "");
    p.row("triangle", format!("{} of face {}", f.triangle, f.face), "of the mesh, in the file's order, from 0");
    p.row("side", if f.front { "front" } else { "back" }, "");
    p.row("shaded at", numbers(&f.place), "pixels, x right, y down");
    p.row("barycentrics", numbers(&f.barycentric), "weights of its corners, perspective-correct");
    p.row("position", numbers(&f.position), "metres, world space");
    p.row("depth", number(f.depth), "metres along the camera's axis");
    p.row("to the eye", numbers(&f.view), "unit vector, world space");
    for map in &f.maps {
        lookup(p, map);
    }
    p.title(&format!("  [{k}] Normals (world space)"));
    let normal = &f.normal;
    p.row("interpolated", numbers(&normal.interpolated), "between the vertices, unit length");
    if let Some(frame) = &normal.frame {
        p.row("tangent", numbers(&frame.tangent), "towards +u");
        p.row("bitangent", numbers(&frame.bitangent), "towards the top of the image");
        p.row("frame normal", numbers(&frame.normal), "");
        let rule = match frame.fallback {
            Some("no-uv") => "from-normal: the mesh has no such texture coordinates".to_owned(),
            Some(_) => format!("{}, but this triangle's texture coordinates have no area: from-normal", frame.rule),
            None => frame.rule.to_owned(),
        };
        p.row("made by", rule + if frame.mirrored { ", mirrored (w = -1)" } else { "" }, "");
    }
    if let Some(mapped) = &normal.mapped {
        let space = normal.map_space.unwrap_or("tangent");
        p.row("mapped", numbers(mapped), &format!("as the map says it, {space} space"));
    }
    match &normal.shading {
        Some(n) if normal.space == "tangent" => p.row("shaded with", numbers(n), "tangent space"),
        Some(n) => p.row("shaded with", numbers(n), ""),
        None if f.model == "unlit" => p.line("  unlit: no normal is asked"),
        None => p.line(format!("  {} shading: the normals of {} are asked", f.shading, place(f))),
    }
    p.title(&format!("  [{k}] Light (linear RGB)"));
    for light in &f.lights {
        term(p, light, f);
    }
    p.row("albedo", numbers(&f.albedo), "material x map x vertex colour");
    let formula = match f.model {
        "pbr" => "diffuse albedo x diffuse light + specular light",
        "unlit" => "the albedo as it is",
        _ => "albedo x diffuse light + specular x specular light",
    };
    p.row("ambient", numbers(&f.ambient), "all factors included");
    p.row("reflected", numbers(&f.reflected), formula);
    p.row("emissive", numbers(&f.emissive), "");
    p.row("colour", numbers(&f.color), "= ambient + reflected + emissive");
    match (f.kind, f.cutoff) {
        ("cut", Some(cutoff)) => p.row("alpha", number(f.alpha), &format!("at least {cutoff}: the surface is there")),
        ("layer", _) => p.row("alpha", number(f.alpha), "colour x alpha + what is behind x (1 - alpha)"),
        _ => {}
    }
}

fn place(f: &Fragment) -> &'static str {
    if f.shading == "flat" { "the triangle" } else { "the vertices" }
}

fn lookup(p: &mut Page, m: &Lookup) {
    /// Lines per list; --json has all of them.
    const MOST: usize = 16;
    let image = m.image.map_or(String::new(), |k| format!(", image {k}"));
    p.title(&format!(
        "  Map \"{}\"{image}: {}x{} texels, {}, {} x {}",
        m.slot, m.size[0], m.size[1], m.filter, m.wrap[0], m.wrap[1]
    ));
    p.row("uv", numbers(&m.uv), &format!("set {}, v down, 0 to 1 across the image", m.uv_set));
    let texels = |du: f32, dv: f32| format!("{:.3} x {:.3} texels", du * m.size[0] as f32, dv * m.size[1] as f32);
    let f = &m.footprint;
    p.row("d(uv)/dx", numbers(&[f.du_dx, f.dv_dx]), &format!("one pixel right = {}", texels(f.du_dx, f.dv_dx)));
    p.row("d(uv)/dy", numbers(&[f.du_dy, f.dv_dy]), &format!("one pixel down = {}", texels(f.du_dy, f.dv_dy)));
    let about = if m.mip_level < 0.0 { "magnified: a texel is larger than a pixel" } else { "0 is the finest level" };
    p.row("mip level", number(m.mip_level), about);
    p.line("  texels read: level    x    y     weight   linear RGBA");
    for t in m.texels.iter().take(MOST) {
        let level = t.level.map_or(format!("{}x{}", t.size[0], t.size[1]), |l| l.to_string());
        p.line(format!("  {level:>18} {:>4} {:>4} {}  {}", t.x, t.y, number(t.weight), numbers(&t.value)));
    }
    more(p, m.texels.len(), MOST);
    p.row("value", numbers(&m.value), "weighted sum, linear RGBA");
}

fn term(p: &mut Page, l: &LightTerm, f: &Fragment) {
    p.line(format!("  light {}, {}", named(&l.light), l.kind));
    let row = |p: &mut Page, name: &str, value: String, remark: &str| p.row(&format!("  {name}"), value, remark);
    match &l.terms {
        Some(t) => {
            let space = if f.normal.space == "tangent" { "tangent space" } else { "world space" };
            row(p, "direction", numbers(&t.direction), &format!("towards the light, {space}"));
            row(p, "n.l", number(t.n_l), "normal . direction, not below 0");
            row(p, "n.h", number(t.n_h), "normal . half vector, not below 0");
            row(p, "attenuation", number(t.attenuation), "falloff, cone and range");
            row(p, "visibility", number(t.visibility), "share that no occluder takes");
        }
        None => {
            p.line(format!("    computed at {}", if f.shading == "flat" { "the centroid" } else { "the vertices" }))
        }
    }
    if let Some(s) = &l.shadow {
        shadow(p, s);
    }
    row(p, "diffuse", numbers(&l.diffuse), "light to be multiplied with the albedo");
    let with =
        if f.model == "pbr" { "light, reflectance included" } else { "light to be multiplied with the reflectance" };
    row(p, "specular", numbers(&l.specular), with);
}

fn shadow(p: &mut Page, s: &Shadow) {
    /// Lines per list; --json has all of them.
    const MOST: usize = 25;
    let side = 2 * s.radius + 1;
    p.line(format!(
        "    shadow map {0}x{0} at texel {1}, {side}x{side} comparisons; depths: 0 its near plane, 1 its far",
        s.size,
        numbers(&s.place).trim_start()
    ));
    p.line(format!(
        "    lit where the point's depth{} - bias{} is not beyond that of the texel:",
        number(s.depth),
        number(s.bias)
    ));
    p.line("           x     y      depth");
    for t in s.taps.iter().take(MOST) {
        p.line(format!("       {:>5} {:>5} {}  {}", t.x, t.y, number(t.depth), if t.lit { "lit" } else { "shadow" }));
    }
    more(p, s.taps.len(), MOST);
}

fn color(p: &mut Page, c: &Color) {
    p.title("Colour of the pixel");
    p.row("coverage", number(c.coverage), "share that is not background");
    p.row("light", numbers(&c.light), "mean of what is seen, linear RGB");
    p.row("tone mapped", numbers(&c.tone_mapped), &format!("tone curve: {}", c.tone_map));
    match &c.background {
        Some(b) => p.row("background", numbers(b), "linear RGB, not tone mapped"),
        None => p.row("background", "transparent", ""),
    }
    p.row("float picture", numbers(&c.linear), "linear RGBA, no tone curve");
    let codes: Vec<String> = match c.encoded {
        Encoded::U8(v) => v.iter().map(|v| format!("{v:>10}")).collect(),
        Encoded::U16(v) => v.iter().map(|v| format!("{v:>10}")).collect(),
        Encoded::F32(v) => v.iter().map(|v| number(*v)).collect(),
    };
    let bits = c.format.trim_start_matches(['u', 'f']);
    p.row(&format!("{bits}-bit picture"), codes.join(" "), &format!("RGBA, {}: the number in the file", c.encode));
}
