//! MTL, the material files of OBJ ("Wavefront MTL", Bourke), with the PBR extension (`Pr`, `Pm`, `norm`).
//!
//! What the format leaves open is read as files in circulation mean it:
//! - `Ka` counts only where it says something: with `map_Ka`, or when it is neither black nor white and there is
//!   no `map_Kd`. Else ambient light meets the albedo.
//! - `map_Bump` of an RGB normal map is one (`norm`), with a finding.
//! - The height of `map_Bump` has no unit: `-bm 1` is 1/200 of the diagonal of the model's box.
//! - `map_d` of an image with alpha takes the alpha; alpha of only 0 and 1 cuts out instead of blending.

use super::text::{Cursor, text};
use super::{Context, Findings, decode, files};
use crate::error::{Fault, Finding, Result};
use crate::image::Image;
use crate::map::Wrap;
use crate::scene::{Alpha, Channel, HeightMap, Material, Model, NormalMap, Scene, Texture};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Most bytes of a material file.
pub const LIMIT: u64 = 1 << 28;

/// Share of the diagonal of the model's box that is the height of a bump map of `-bm 1`.
const BUMP: f32 = 0.005;

/// The material of faces that name none, or one that is missing: light grey, a little glossy, both sides shown.
pub fn plain(name: &str) -> Material {
    Material {
        name: name.to_owned(),
        albedo: [0.8; 3],
        specular: [0.1; 3],
        shininess: 32.0,
        double_sided: true,
        ..Material::default()
    }
}

/// A texture statement.
#[derive(Clone, Debug, PartialEq)]
struct MapLine {
    file: String,
    offset: [f32; 2],
    scale: [f32; 2],
    clamp: bool,
    multiplier: Option<f32>,
    gain: f32,
    channel: Option<Channel>,
    line: usize,
}

/// What a material of a file says, before its textures are known.
#[derive(Clone, Debug, Default)]
pub struct Description {
    name: String,
    ambient: Option<[f32; 3]>,
    diffuse: Option<[f32; 3]>,
    specular: Option<[f32; 3]>,
    emissive: Option<[f32; 3]>,
    shininess: Option<f32>,
    dissolve: Option<f32>,
    transparency: Option<f32>,
    ior: Option<f32>,
    illum: Option<i64>,
    roughness: Option<f32>,
    metallic: Option<f32>,
    maps: BTreeMap<&'static str, MapLine>,
}

/// Texture statements: word in lower case, slot.
const MAPS: [(&str, &str); 19] = [
    ("map_kd", "kd"),
    ("map_ka", "ka"),
    ("map_ks", "ks"),
    ("map_ke", "ke"),
    ("map_ns", "ns"),
    ("map_d", "d"),
    ("map_tr", "d"),
    ("map_pr", "pr"),
    ("map_pm", "pm"),
    ("map_bump", "bump"),
    ("bump", "bump"),
    ("norm", "norm"),
    ("map_norm", "norm"),
    ("map_normal", "norm"),
    ("map_kn", "norm"),
    ("kn", "norm"),
    ("disp", "disp"),
    ("map_disp", "disp"),
    ("map_emissive", "ke"),
];

/// Reads the materials of a file in its order; the first of a name counts.
pub(super) fn parse(bytes: &[u8], findings: &mut Findings) -> Vec<Description> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut list: Vec<Description> = Vec::new();
    let mut c = Cursor::new(bytes);
    let mut number = 0;
    while !c.is_done() {
        number += 1;
        if c.is_line_end() {
            c.next_line();
            continue;
        }
        let word = c.word().to_ascii_lowercase();
        let word = std::str::from_utf8(&word).unwrap_or_default();
        if word == "newmtl" {
            list.push(Description { name: text(c.rest()), ..Description::default() });
            continue;
        }
        let mut finding = |code, message: String, action: &str| {
            findings.push(Finding::warning(code, message, action).at(format!("line {number}")));
        };
        let Some(m) = list.last_mut() else {
            finding("mtl.no-material", "a statement before any newmtl".into(), "it was ignored");
            c.next_line();
            continue;
        };
        if let Some(&(_, slot)) = MAPS.iter().find(|m| m.0 == word) {
            match map_line(c.rest(), number) {
                Some((map, ignored)) => {
                    if let Some(option) = ignored {
                        let message = format!("the option {option} of {word} is not supported");
                        finding("mtl.option-ignored", message, "it was ignored");
                    }
                    m.maps.insert(slot, map);
                }
                None => finding("mtl.map", format!("{word} names no file"), "it was ignored"),
            }
            continue;
        }
        let mut ok = true;
        let mut rgb = |c: &mut Cursor<'_>, to: &mut Option<[f32; 3]>| match color(c) {
            Some(rgb) => *to = Some(rgb),
            None => ok = false,
        };
        let mut one = None;
        match word {
            "ka" => rgb(&mut c, &mut m.ambient),
            "kd" => rgb(&mut c, &mut m.diffuse),
            "ks" => rgb(&mut c, &mut m.specular),
            "ke" => rgb(&mut c, &mut m.emissive),
            "ns" => one = Some(&mut m.shininess),
            "tr" => one = Some(&mut m.transparency),
            "ni" => one = Some(&mut m.ior),
            "pr" => one = Some(&mut m.roughness),
            "pm" => one = Some(&mut m.metallic),
            "d" => {
                let mut ahead = c;
                if ahead.word() == b"-halo" {
                    c = ahead;
                }
                one = Some(&mut m.dissolve);
            }
            "illum" => {
                c.skip_blanks();
                m.illum = c.integer();
                ok = m.illum.is_some();
            }
            // Transmission filters and sharpness change nothing without refraction.
            "tf" | "sharpness" | "ps" | "pc" | "pcr" | "aniso" | "anisor" => {}
            _ => {
                let word: String = word.chars().take(30).collect();
                finding("mtl.ignored", format!("the statement {word:?} is not supported"), "it was ignored");
            }
        }
        if let Some(one) = one {
            match c.float().filter(|v| v.is_finite()) {
                Some(value) => *one = Some(value),
                None => ok = false,
            }
        }
        if !ok {
            finding("mtl.number", format!("{word} is not followed by its numbers"), "it was ignored");
        }
        c.next_line();
    }
    list
}

/// `r [g b]`; one number is grey.
fn color(c: &mut Cursor<'_>) -> Option<[f32; 3]> {
    let r = c.float()?;
    let g = c.float().unwrap_or(r);
    let rgb = [r, g, c.float().unwrap_or(g)];
    rgb.iter().all(|v| v.is_finite()).then(|| rgb.map(|v| v.max(0.0)))
}

/// Options and file name of a texture statement, and an option that was ignored.
fn map_line(rest: &[u8], line: usize) -> Option<(MapLine, Option<String>)> {
    let mut map = MapLine {
        file: String::new(),
        offset: [0.0; 2],
        scale: [1.0; 2],
        clamp: false,
        multiplier: None,
        gain: 1.0,
        channel: None,
        line,
    };
    let mut ignored = None;
    let mut c = Cursor::new(rest);
    loop {
        let mut ahead = c;
        let option = ahead.word();
        // Up to three numbers, of which a last one that is the file name is none.
        let numbers = |ahead: &mut Cursor<'_>| {
            let mut n = [None; 3];
            for v in &mut n {
                let mut further = *ahead;
                *v = further.float().filter(|v| v.is_finite() && !further.is_line_end());
                match v {
                    Some(_) => *ahead = further,
                    None => break,
                }
            }
            n
        };
        match option.to_ascii_lowercase().as_slice() {
            b"-o" => {
                let n = numbers(&mut ahead);
                map.offset = [n[0].unwrap_or(0.0), n[1].unwrap_or(0.0)];
            }
            b"-s" => {
                let n = numbers(&mut ahead);
                map.scale = [n[0].unwrap_or(1.0), n[1].unwrap_or(1.0)];
            }
            b"-t" => {
                if numbers(&mut ahead).iter().flatten().any(|&v| v != 0.0) {
                    ignored = Some("-t".to_owned());
                }
            }
            b"-mm" => {
                let n = numbers(&mut ahead);
                map.gain = n[1].unwrap_or(1.0);
                if n[0].is_some_and(|base| base != 0.0) {
                    ignored = Some("-mm (its base)".to_owned());
                }
            }
            b"-bm" => map.multiplier = numbers(&mut ahead)[0].or(map.multiplier),
            b"-clamp" => map.clamp = ahead.word().eq_ignore_ascii_case(b"on"),
            b"-imfchan" => {
                map.channel = match ahead.word() {
                    b"r" => Some(Channel::R),
                    b"g" => Some(Channel::G),
                    b"b" => Some(Channel::B),
                    b"m" => Some(Channel::A),
                    b"l" => Some(Channel::Luminance),
                    _ => None,
                }
            }
            b"-blendu" | b"-blendv" | b"-cc" => {
                ahead.word();
            }
            b"-boost" | b"-texres" | b"-type" => {
                ignored = Some(text(option));
                ahead.word();
            }
            _ => break,
        }
        c = ahead;
    }
    let file = c.rest();
    let file = file.strip_prefix(b"\"").and_then(|f| f.strip_suffix(b"\"")).unwrap_or(file);
    map.file = text(file);
    (!file.is_empty()).then_some((map, ignored))
}

impl Description {
    /// The name that `usemtl` uses.
    pub fn name(&self) -> &str {
        &self.name
    }
}

/// The pictures that materials of a model use, each once.
#[derive(Default)]
struct Pictures {
    /// File name in the MTL, and index into the scene's images, if it could be read.
    known: BTreeMap<String, Option<usize>>,
}

/// Adds `wanted` materials to the scene: their pictures are decoded in parallel, each once. `diagonal` is that of
/// the model's box.
///
/// # Errors
/// [`Fault::Memory`] and [`Fault::Interrupted`]; pictures that cannot be read are findings.
pub(super) fn make(
    wanted: &[Description],
    diagonal: f32,
    scene: &mut Scene,
    context: &Context<'_>,
    findings: &mut Findings,
) -> Result<()> {
    let mut files: Vec<&MapLine> = Vec::new();
    let mut known: BTreeMap<&str, usize> = BTreeMap::new();
    for map in wanted.iter().flat_map(|m| m.maps.values()) {
        known.entry(&map.file).or_insert_with(|| {
            files.push(map);
            files.len() - 1
        });
    }
    type Read = (Option<Image>, Vec<Finding>);
    let read = |map: &&MapLine| -> Result<Read> {
        context.job.check()?;
        let read = context.root.read_or_beside(&map.file, files::LIMIT, context.job).and_then(|(bytes, finding)| {
            let (image, mut more) = decode::image(&bytes, &bytes.path, context.job)?;
            more.extend(finding);
            // Held from here on: many maps may be decoded from one small file.
            context.reserve(image.bytes(), "a picture")?;
            Ok((Some(image), more))
        });
        match read {
            Err(e) if matches!(e.fault, Fault::Memory | Fault::Interrupted) => Err(e),
            Err(e) => {
                let code = if e.code.starts_with("file.") { "texture.missing" } else { "texture.unreadable" };
                let finding = Finding::warning(code, e.message, "the surface is shown without it");
                Ok((None, vec![finding.at(format!("material file, line {}", map.line))]))
            }
            ok => ok,
        }
    };
    let all: Vec<Result<Read>> = files.par_iter().map(read).collect();
    let mut pictures = Pictures::default();
    for (map, one) in files.iter().zip(all) {
        let (image, of_image) = one?;
        findings.extend(of_image);
        let index = image.map(|image| {
            scene.images.push(Arc::new(image));
            scene.images.len() - 1
        });
        pictures.known.insert(map.file.clone(), index);
    }
    for m in wanted {
        let material = material(m, diagonal, &pictures, scene, findings);
        scene.materials.push(material);
    }
    Ok(())
}

/// A texture in our convention: v runs down, so `v' = s v + o` of OBJ becomes `v' = s v + (1 - s - o)`.
fn texture(map: &MapLine, pictures: &Pictures) -> Option<Texture> {
    let mut t = Texture::new(pictures.known.get(&map.file).copied().flatten()?);
    t.scale = map.scale;
    t.offset = [map.offset[0], 1.0 - map.scale[1] - map.offset[1]];
    t.channel = map.channel;
    if map.clamp {
        t.wrap = [Wrap::Clamp; 2];
    }
    Some(t)
}

fn material(m: &Description, diagonal: f32, pictures: &Pictures, scene: &Scene, findings: &mut Findings) -> Material {
    let map = |slot: &str| m.maps.get(slot).and_then(|line| texture(line, pictures));
    let pbr = m.roughness.is_some() || m.metallic.is_some() || m.maps.contains_key("pr") || m.maps.contains_key("pm");
    let albedo_map = map("kd");
    let black = |c: Option<[f32; 3]>| c.is_none_or(|c| c == [0.0; 3]);
    // A black colour under a texture is an exporter's "not set"; literally it would hide the texture.
    let under = |c: Option<[f32; 3]>, map: bool, default: f32| match c {
        _ if map && black(c) => [1.0; 3],
        c => c.unwrap_or([default; 3]),
    };
    let mut made = Material {
        albedo: under(m.diffuse, albedo_map.is_some(), 0.8),
        emissive: under(m.emissive, m.maps.contains_key("ke") && map("ke").is_some(), 0.0),
        specular: under(m.specular, map("ks").is_some(), 0.0),
        shininess: m.shininess.unwrap_or(32.0).max(1.0),
        model: if pbr { Model::Pbr } else { Model::BlinnPhong },
        roughness: m.roughness.unwrap_or(if m.maps.contains_key("pr") { 1.0 } else { 0.5 }).clamp(0.0, 1.0),
        metallic: m.metallic.unwrap_or(if m.maps.contains_key("pm") { 1.0 } else { 0.0 }).clamp(0.0, 1.0),
        ior: m.ior.filter(|&v| v >= 1.0).unwrap_or(1.5),
        ambient_map: map("ka"),
        emissive_map: map("ke"),
        shininess_map: map("ns"),
        roughness_map: map("pr"),
        metallic_map: map("pm"),
        ..plain(&m.name)
    };
    match m.illum {
        Some(0) => made.model = Model::Unlit,
        Some(1) if !pbr => made.specular = [0.0; 3],
        _ => {}
    }
    if !pbr {
        made.specular_map = map("ks");
    }
    let ambient = m.ambient.filter(|&a| a != [0.0; 3] && a != [1.0; 3] && albedo_map.is_none());
    made.ambient = if made.ambient_map.is_some() { m.ambient.or(Some([1.0; 3])) } else { ambient };
    made.albedo_map = albedo_map;

    made.opacity = m.dissolve.or(m.transparency.map(|t| 1.0 - t)).unwrap_or(1.0).clamp(0.0, 1.0);
    made.alpha_map = map("d");
    if made.opacity <= 0.0 && made.alpha_map.is_none() {
        findings.push(Finding::warning(
            "mtl.invisible",
            format!("material {:?} is fully transparent", m.name),
            "taken for opaque: exporters disagree on what d and Tr mean",
        ));
        made.opacity = 1.0;
    }
    if made.opacity < 1.0 {
        made.alpha = Alpha::Blend;
    }
    if let Some(alpha) = &mut made.alpha_map {
        let image = &scene.images[alpha.image];
        if alpha.channel.is_none() {
            let last = image.channels() - 1;
            let has_alpha =
                image.channels().is_multiple_of(2) && samples(image).any(|(x, y)| image.value(x, y, last) < 1.0);
            alpha.channel = Some(if has_alpha { Channel::A } else { Channel::R });
        }
        let c = if alpha.channel == Some(Channel::A) && image.channels().is_multiple_of(2) {
            image.channels() - 1
        } else {
            0
        };
        let sharp = samples(image).filter(|&(x, y)| (image.value(x, y, c) - 0.5).abs() > 0.45).count();
        let cut = made.opacity >= 1.0 && sharp * 10 >= samples(image).count() * 9;
        made.alpha = if cut { Alpha::Mask(0.5) } else { Alpha::Blend };
    }

    let normal = |texture: Texture, scale: f32| NormalMap { texture, scale, y_down: false, channels: 3 };
    made.normal_map = map("norm").map(|t| normal(t, m.maps["norm"].multiplier.unwrap_or(1.0)));
    let tall = if diagonal > 0.0 { diagonal } else { 1.0 };
    if let Some(mut t) = map("bump") {
        let line = &m.maps["bump"];
        if looks_like_normals(&scene.images[t.image]) {
            findings.push(
                Finding::warning(
                    "mtl.bump-is-normal",
                    format!("map_Bump of material {:?} names {:?}, which is a normal map", m.name, line.file),
                    "used as a tangent-space normal map, as `norm` would be",
                )
                .at(format!("material file, line {}", line.line)),
            );
            made.normal_map.get_or_insert(normal(t, 1.0));
        } else {
            let scale = line.multiplier.unwrap_or(1.0) * line.gain * BUMP * tall;
            findings.push(Finding::note(
                "mtl.bump-height",
                format!("the height of the bump map of material {:?} has no unit", m.name),
                format!("taken for {scale} metres"),
            ));
            t.channel = t.channel.or(Some(Channel::Luminance));
            made.bump_map = Some(HeightMap { texture: t, scale, midlevel: 0.5 });
        }
    }
    if let Some(mut t) = map("disp") {
        let line = &m.maps["disp"];
        let given = line.multiplier.or((line.gain != 1.0).then_some(1.0));
        let scale = given.map_or(BUMP * tall, |g| g * line.gain);
        if given.is_none() {
            findings.push(Finding::note(
                "mtl.bump-height",
                format!("the height of the displacement map of material {:?} is not given", m.name),
                format!("taken for {scale} metres; -mm or -bm of the MTL, or --displacement-scale, change it"),
            ));
        }
        t.channel = t.channel.or(Some(Channel::Luminance));
        let float =
            matches!(scene.images[t.image].pixels(), crate::image::Pixels::F16(_) | crate::image::Pixels::F32(_));
        made.displacement_map = Some(HeightMap { texture: t, scale, midlevel: if float { 0.0 } else { 0.5 } });
    }
    made
}

/// Up to 64 x 64 pixels, spread over the image.
fn samples(image: &Image) -> impl Iterator<Item = (u32, u32)> {
    let (w, h) = (image.width(), image.height());
    let (nx, ny) = (w.min(64), h.min(64));
    let at = |k: u32, n: u32, size: u32| (u64::from(k) * u64::from(size) / u64::from(n)) as u32;
    (0..ny).flat_map(move |y| (0..nx).map(move |x| (at(x, nx, w), at(y, ny, h))))
}

/// Whether an image has the colours of a tangent-space normal map: blue high, red and green about one half.
fn looks_like_normals(image: &Image) -> bool {
    if image.channels() < 3 {
        return false;
    }
    let (mut sum, mut n) = ([0.0f64; 3], 0.0);
    for (x, y) in samples(image) {
        for (c, s) in sum.iter_mut().enumerate() {
            *s += f64::from(image.value(x, y, c));
        }
        n += 1.0;
    }
    let [r, g, b] = sum.map(|s| s / n);
    b > 0.7 && (r - 0.5).abs() < 0.12 && (g - 0.5).abs() < 0.12
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Encoding, Pixels};

    fn one(body: &str) -> (Description, Vec<&'static str>) {
        let mut findings = Findings::default();
        let list = parse(format!("# x\r\nnewmtl the name \r\n{body}").as_bytes(), &mut findings);
        let codes = findings.finish("f".as_ref()).iter().map(|f| f.code).collect();
        (list.into_iter().next().unwrap(), codes)
    }

    /// The material with images for its files: 0 grey, 1 a normal map, 2 RGBA with holes.
    fn made(body: &str) -> (Material, Vec<&'static str>) {
        let (m, mut codes) = one(body);
        let mut scene = Scene::default();
        let mut add = |channels, pixel: &[u8]| {
            let pixels = Pixels::U8(pixel.repeat(4));
            scene.add_image(Image::new(2, 2, channels, pixels, Encoding::Srgb).unwrap())
        };
        add(1, &[100]);
        add(3, &[127, 130, 250]);
        add(4, &[9, 9, 9, 0]);
        let known = [("g.png", Some(0)), ("n.png", Some(1)), ("a.png", Some(2)), ("missing.png", None)];
        let known = known.map(|(name, index)| (name.to_owned(), index)).into();
        let mut findings = Findings::default();
        let material = material(&m, 2.0, &Pictures { known }, &scene, &mut findings);
        codes.extend(findings.finish("f".as_ref()).iter().map(|f| f.code));
        (material, codes)
    }

    #[test]
    fn colours_and_numbers() {
        let (m, codes) =
            made("Ka 0.1 0.2 0.3\nKd .5 .25 1\n\tKs 0.5\nKe 1 2 3\nNs 96.5\nd 0.25\nNi 1.4\nillum 2\nTf 1 1 1\n");
        assert!(codes.is_empty(), "{codes:?}");
        assert_eq!((&m.name[..], m.model), ("the name", Model::BlinnPhong));
        assert_eq!((m.ambient, m.albedo, m.specular), (Some([0.1, 0.2, 0.3]), [0.5, 0.25, 1.0], [0.5; 3]));
        assert_eq!((m.emissive, m.shininess, m.opacity, m.ior), ([1.0, 2.0, 3.0], 96.5, 0.25, 1.4));
        assert_eq!((m.alpha, m.double_sided), (Alpha::Blend, true));
        assert_eq!(made("Tr 0.25").0.opacity, 0.75);
        assert_eq!(made("Ka 1 1 1\nKd 1 0 0").0.ambient, None);
        assert_eq!(made("Ka .5 .5 .5\nmap_Kd g.png").0.ambient, None);
        assert_eq!(made("Ks 1 1 1\nillum 1").0.specular, [0.0; 3]);
        assert_eq!(made("illum 0").0.model, Model::Unlit);
        let (m, codes) = made("d 0");
        assert_eq!((m.opacity, m.alpha, codes), (1.0, Alpha::Opaque, vec!["mtl.invisible"]));
    }

    #[test]
    fn broken_statements_are_findings() {
        let (m, codes) = made("Kd red\nNs\nfoo 1\nmap_Kd\nKd 1 nan 0\nmap_Kd missing.png");
        assert_eq!(codes, ["mtl.number", "mtl.number", "mtl.ignored", "mtl.map", "mtl.number"]);
        assert_eq!(m.albedo_map, None);
        let mut findings = Findings::default();
        assert!(parse(b"Kd 1 1 1\n\xff\xfe", &mut findings).is_empty());
    }

    #[test]
    fn texture_options() {
        let (m, codes) = made("map_Kd -s 2 3 1 -o 0.5 0.25 -clamp on -blendu off -imfchan g -texres 512 g.png");
        let t = m.albedo_map.unwrap();
        assert_eq!((t.scale, t.wrap, t.channel), ([2.0, 3.0], [Wrap::Clamp; 2], Some(Channel::G)));
        // OBJ's v' = 3 v + 0.25 at v = 0.5 is 1.75; from the top that is -0.75 = 3 (1 - 0.5) + offset.
        assert_eq!(t.offset, [0.5, 1.0 - 3.0 - 0.25]);
        assert_eq!(codes, ["mtl.option-ignored"]);
        assert_eq!(m.albedo, [1.0; 3]);
        let (line, _) = map_line(b"-o 1 2 my wood 2.png", 1).unwrap();
        assert_eq!((&line.file[..], line.offset), ("my wood 2.png", [1.0, 2.0]));
        // A file name that is a number.
        assert_eq!(map_line(b"-o 1 2 3", 1).unwrap().0.file, "3");
        assert_eq!(map_line(b"\"quoted name.png\"", 1).unwrap().0.file, "quoted name.png");
        assert!(map_line(b"-clamp on", 1).is_none());
    }

    #[test]
    fn bump_maps_that_are_normal_maps_are_used_as_such() {
        let (m, codes) = made("map_Bump -bm 0.5 n.png");
        assert_eq!((m.normal_map.unwrap().texture.image, codes), (1, vec!["mtl.bump-is-normal"]));
        assert!(m.bump_map.is_none());
        let (m, codes) = made("bump g.png -bm 0.5\nbump -bm 0.5 g.png\nnorm n.png");
        let bump = m.bump_map.unwrap();
        assert_eq!(
            (bump.scale, bump.texture.channel, codes),
            (0.5 * BUMP * 2.0, Some(Channel::Luminance), vec!["mtl.bump-height"])
        );
        assert_eq!(m.normal_map.unwrap().texture.image, 1);
        let (m, _) = made("map_Disp -mm 0 0.3 g.png");
        assert_eq!(m.displacement_map.map(|d| (d.scale, d.midlevel)), Some((0.3, 0.5)));
    }

    #[test]
    fn pbr_and_alpha_maps() {
        let (m, _) = made("Pr 0.3\nmap_Pm g.png\nKd 1 1 1");
        assert_eq!((m.model, m.roughness, m.metallic), (Model::Pbr, 0.3, 1.0));
        let (m, _) = made("map_d a.png");
        assert_eq!((m.alpha_map.unwrap().channel, m.alpha), (Some(Channel::A), Alpha::Mask(0.5)));
        let (m, _) = made("map_d g.png");
        assert_eq!((m.alpha_map.unwrap().channel, m.alpha), (Some(Channel::R), Alpha::Blend));
    }
}
