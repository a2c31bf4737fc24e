//! `[material.NAME]` and its maps.

use super::table::{Table, Value};
use crate::error::{Error, Result};
use crate::map::{Filter, Wrap};
use crate::scene::{
    Alpha, Channel, HeightMap, Material, Model, NormalMap, NormalSpace, NormalZero, Normals, Shading, TangentFrame,
    TbnPath, Texture,
};

/// Turns the name of an image file into its index; called for every map, in the order of the slots.
pub(super) type Register<'r> = &'r mut dyn FnMut(&str, &Value) -> Result<usize>;

/// Marks a middle height that the image decides: 0.5 for integers, 0 for floats.
pub(super) const BY_IMAGE: f32 = f32::NAN;

const WRAPS: [(&str, Wrap); 4] =
    [("repeat", Wrap::Repeat), ("mirror", Wrap::Mirror), ("clamp", Wrap::Clamp), ("border", Wrap::Border)];
const KEPT: &str = "the map is loaded, the surface is drawn without it";

/// Reads a material. `double_sided` holds where the file does not say.
pub(super) fn read(t: &Table, name: &str, double_sided: bool, register: Register) -> Result<Material> {
    let d = Material::default();
    let model = t
        .word("model", &[("blinn-phong", Model::BlinnPhong), ("pbr", Model::Pbr), ("unlit", Model::Unlit)])?
        .unwrap_or_default();
    let shading = t
        .word("shading", &[("flat", Shading::Flat), ("gouraud", Shading::Gouraud), ("phong", Shading::Phong)])?
        .unwrap_or_default();
    let normals =
        [("file", Normals::File), ("area", Normals::Area), ("angle", Normals::Angle), ("uniform", Normals::Uniform)];
    let frames = [
        ("mikktspace", TangentFrame::Mikktspace),
        ("average", TangentFrame::Average),
        ("per-triangle", TangentFrame::PerTriangle),
        ("from-normal", TangentFrame::FromNormal),
        ("games101", TangentFrame::Games101),
    ];
    let cutoff = t.within("cutoff", 0.0..=1.0)?;
    let alpha = t.word(
        "alpha",
        &[("opaque", Alpha::Opaque), ("mask", Alpha::Mask(cutoff.unwrap_or(0.5))), ("blend", Alpha::Blend)],
    )?;
    if let Some(v) = t.get("specular_aa").filter(|v| !matches!(v.bool(), Ok(false))) {
        v.bool()?;
        v.not_yet("specular highlights are not filtered");
    }
    let mut m = Material {
        name: name.to_owned(),
        model,
        shading,
        albedo: one_of(t, ["diffuse", "base_color", "albedo"], Value::color)?.unwrap_or(d.albedo),
        opacity: t.within("opacity", 0.0..=1.0)?.unwrap_or(d.opacity),
        ambient: t.color("ambient")?,
        specular: t.color("specular")?.unwrap_or(d.specular),
        shininess: t.within("shininess", 0.0..=1e6)?.unwrap_or(d.shininess),
        reflection: t.within("reflection", 0.0..=1.0)?.unwrap_or(d.reflection),
        metallic: t.within("metallic", 0.0..=1.0)?.unwrap_or(d.metallic),
        roughness: t.within("roughness", 0.0..=1.0)?.unwrap_or(d.roughness),
        ior: t.within("ior", 1.0..=100.0)?.unwrap_or(d.ior),
        specular_factor: t.within("specular_factor", 0.0..=1.0)?.unwrap_or(d.specular_factor),
        specular_color: t.color("specular_color")?.unwrap_or(d.specular_color),
        emissive: t.color("emissive")?.unwrap_or(d.emissive),
        multi_scatter: t.bool("multi_scatter")?.unwrap_or(d.multi_scatter),
        alpha: alpha.unwrap_or_default(),
        double_sided: t.bool("double_sided")?.unwrap_or(double_sided),
        normals: t.word("normals", &normals)?.unwrap_or_default(),
        tangent_frame: t.word("tangent_frame", &frames)?.unwrap_or_default(),
        tbn_path: t.word("tbn_path", &[("world", TbnPath::World), ("tangent", TbnPath::Tangent)])?.unwrap_or_default(),
        vertex_colors: t.bool("vertex_colors")?.unwrap_or(d.vertex_colors),
        occlusion_strength: t.within("occlusion_strength", 0.0..=1.0)?.unwrap_or(d.occlusion_strength),
        ..d
    };
    m.albedo_map = one_of(t, ["diffuse_map", "base_color_map", "albedo_map"], |v| plain(v, register))?.flatten();
    for (key, slot) in [
        ("ambient_map", &mut m.ambient_map),
        ("specular_map", &mut m.specular_map),
        ("specular_factor_map", &mut m.specular_factor_map),
        ("shininess_map", &mut m.shininess_map),
        ("alpha_map", &mut m.alpha_map),
        ("metallic_map", &mut m.metallic_map),
        ("roughness_map", &mut m.roughness_map),
        ("emissive_map", &mut m.emissive_map),
    ] {
        *slot = t.get(key).map(|v| plain(&v, register)).transpose()?.flatten();
    }
    if let Some(v) = one_of(t, ["occlusion_map", "ao_map"], |v| Ok(v.clone()))? {
        let (texture, table) = texture(&v, register)?;
        m.occlusion_map = texture;
        if let Some(t) = table {
            m.occlusion_strength = t.within("strength", 0.0..=1.0)?.unwrap_or(m.occlusion_strength);
            t.finish()?;
        }
    }
    if let Some(v) = t.get("normal_map") {
        (m.normal_map, m.normal_space, m.normal_zero) = normal(&v, register)?;
    }
    m.bump_map = t.get("bump_map").map(|v| height(&v, register, bump)).transpose()?.flatten();
    m.displacement_map = t.get("displacement_map").map(|v| height(&v, register, displacement)).transpose()?.flatten();
    m.parallax_map = t.get("parallax_map").map(|v| height(&v, register, parallax)).transpose()?.flatten();
    t.finish()?;
    Ok(m)
}

/// The value of a key that has other names too; at most one may be given.
fn one_of<'a, T, const K: usize>(
    t: &Table<'a>,
    keys: [&'static str; K],
    mut read: impl FnMut(&Value<'a>) -> Result<T>,
) -> Result<Option<T>> {
    let given: Vec<_> = keys.iter().filter_map(|k| t.get(k)).collect();
    match &given[..] {
        [] => Ok(None),
        [v] => read(v).map(Some),
        [first, second, ..] => Err(second.out_of_range(format_args!("is another name of `{}`", first.name))),
    }
}

/// A map with the common keys only.
fn plain(v: &Value, register: Register) -> Result<Option<Texture>> {
    let (texture, table) = texture(v, register)?;
    table.map_or(Ok(()), |t| t.finish())?;
    Ok(texture)
}

/// The keys that all maps have. `None` for a procedural map, which comes later. The table is handed back for
/// the slot's own keys.
fn texture<'a>(v: &Value<'a>, register: Register) -> Result<(Option<Texture>, Option<Table<'a>>)> {
    if v.is_str() {
        return Ok((Some(Texture::new(register(v.str()?, v)?)), None));
    }
    let t = v.table()?;
    let file = t.get("file");
    let noise = t.word(
        "noise",
        &[
            ("fbm", ()),
            ("perlin", ()),
            ("simplex", ()),
            ("value", ()),
            ("worley", ()),
            ("ridged", ()),
            ("turbulence", ()),
        ],
    )?;
    t.u32("octaves", 1..=32)?;
    t.u32("seed", 0..=u32::MAX)?;
    for key in ["frequency", "lacunarity", "gain"] {
        t.above_zero(key)?;
    }
    let image = match (&file, noise) {
        (Some(f), None) => Some(register(f.str()?, f)?),
        (None, Some(())) => {
            t.get("noise").inspect(|n| n.not_yet("the map is left out"));
            None
        }
        (Some(_), Some(())) => return Err(v.out_of_range("has both `file` and `noise`")),
        (None, None) => return Err(t.need("file").err().expect("there is none")),
    };
    let max = t.u32("max_anisotropy", 2..=16)?;
    let taps = t.u32("taps", 1..=65536)?;
    let radius = t.within("ewa_radius", 0.1..=8.0)?;
    let filter = t.word(
        "filter",
        &[
            ("nearest", Filter::Nearest),
            ("bilinear", Filter::Bilinear),
            ("bicubic", Filter::Bicubic),
            ("mip-nearest", Filter::MipNearest),
            ("trilinear", Filter::Trilinear),
            ("ripmap", Filter::Ripmap),
            ("anisotropic", Filter::Anisotropic { max: max.unwrap_or(16) }),
            // An ellipse whose second moment is that of a box pixel: radius^2 / 4 = 1 / 12.
            ("ewa", Filter::Ewa { radius: radius.unwrap_or(0.577_350_26) }),
            ("supersample", Filter::Supersample { taps: taps.unwrap_or(256) }),
        ],
    )?;
    let wrap = match t.get("wrap") {
        None => [Wrap::Repeat; 2],
        Some(w) if w.is_list() => match &w.list()?[..] {
            [u, v] => [u.word(&WRAPS)?, v.word(&WRAPS)?],
            other => return Err(w.out_of_range(format_args!("has {} entries; it must have 2", other.len()))),
        },
        Some(w) => [w.word(&WRAPS)?; 2],
    };
    let channels = [
        ("r", Channel::R),
        ("g", Channel::G),
        ("b", Channel::B),
        ("a", Channel::A),
        ("luminance", Channel::Luminance),
        ("rgb-norm", Channel::RgbNorm),
    ];
    let made = Texture {
        image: image.unwrap_or(0),
        uv: t.u32("uv", 0..=1)?.unwrap_or(0) as u8,
        offset: t.floats("offset")?.unwrap_or([0.0; 2]),
        rotate: t.f32("rotate")?.unwrap_or(0.0),
        scale: match t.get("uv_scale") {
            Some(s) if !s.is_list() => [s.f32()?; 2],
            Some(s) => s.floats()?,
            None => [1.0; 2],
        },
        filter: filter.unwrap_or_default(),
        wrap,
        srgb: t.bool("srgb")?,
        channel: t.word("channel", &channels)?,
    };
    Ok((image.map(|_| made), Some(t)))
}

fn normal(v: &Value, register: Register) -> Result<(Option<NormalMap>, NormalSpace, NormalZero)> {
    let (texture, t) = texture(v, register)?;
    let mut made = NormalMap { texture: Texture::new(0), scale: 1.0, y_down: false, channels: 3 };
    let (mut space, mut zero) = (NormalSpace::Tangent, NormalZero::Half);
    if let Some(t) = t {
        let spaces =
            [("tangent", NormalSpace::Tangent), ("object", NormalSpace::Object), ("world", NormalSpace::World)];
        space = t.word("space", &spaces)?.unwrap_or_default();
        zero = t.word("zero", &[("half", NormalZero::Half), ("exact", NormalZero::Exact)])?.unwrap_or_default();
        if t.word("variance", &[("none", true), ("toksvig", false), ("lean", false), ("vmf", false)])? == Some(false) {
            t.get("variance").inspect(|v| v.not_yet("roughness stays as it is"));
        }
        made.y_down = t.word("y", &[("up", false), ("down", true)])?.unwrap_or(false);
        made.scale = t.f32("scale")?.unwrap_or(1.0);
        made.channels = t.u32("channels", 2..=3)?.unwrap_or(3) as u8;
        if let Some(v) = t.get("channels").filter(|_| made.channels == 2 && space != NormalSpace::Tangent) {
            return Err(v.out_of_range("is 2, but only tangent-space maps have a z that two channels tell"));
        }
        t.finish()?;
    }
    Ok((texture.map(|texture| NormalMap { texture, ..made }), space, zero))
}

/// A height map; `own` reads the slot's own keys.
fn height(v: &Value, register: Register, own: impl FnOnce(&Table) -> Result<f32>) -> Result<Option<HeightMap>> {
    let (texture, t) = texture(v, register)?;
    let mut made = HeightMap { texture: Texture::new(0), scale: 1.0, midlevel: BY_IMAGE };
    if let Some(t) = t {
        let default = own(&t)?;
        made.scale = t.f32("scale")?.unwrap_or(default);
        made.midlevel = t.f32("midlevel")?.unwrap_or(BY_IMAGE);
        t.finish()?;
    }
    v.not_yet(KEPT);
    Ok(texture.map(|texture| HeightMap { texture, ..made }))
}

fn bump(t: &Table) -> Result<f32> {
    t.word("method", &[("gradient", ()), ("blinn", ()), ("games101", ())])?;
    Ok(1.0)
}

fn displacement(t: &Table) -> Result<f32> {
    t.bool("vector")?;
    if let Some(v) = t.get("tessellation") {
        if v.is_str() {
            v.word(&[("adaptive", ()), ("uniform", ()), ("none", ())])?;
        } else {
            v.u32(0..=64)?;
        }
    }
    t.within("edge_pixels", 0.1..=1000.0)?;
    Ok(1.0)
}

fn parallax(t: &Table) -> Result<f32> {
    t.word("method", &[("offset", ()), ("steep", ()), ("occlusion", ()), ("relief", ()), ("cone", ())])?;
    t.bool("self_shadow")?;
    t.bool("silhouette")?;
    Ok(1.0)
}

/// Fills in the middle heights that the images decide.
pub(super) fn settle(m: &mut Material, is_float: impl Fn(usize) -> bool) {
    for slot in [&mut m.bump_map, &mut m.displacement_map, &mut m.parallax_map] {
        if let Some(map) = slot.as_mut().filter(|m| m.midlevel.is_nan()) {
            map.midlevel = if is_float(map.texture.image) { 0.0 } else { 0.5 };
        }
    }
}

/// A material's name that no table defines.
pub(super) fn unknown<'k>(v: &Value, name: &str, known: impl Iterator<Item = &'k str>) -> Error {
    let shown: String = name.chars().take(60).collect();
    let error = v.source.error("scene.unknown-material", v.at, format!("there is no [material.{shown}]"));
    match super::table::nearest(name, known) {
        Some(near) => error.remedy(format!("did you mean \"{near}\"?")),
        None => error.remedy(format!("add a table [material.{shown}]")),
    }
}
