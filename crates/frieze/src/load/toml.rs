//! Our scene files (`.toml`): cameras, lights, objects, materials, output, with every key checked. What this
//! version understands but does not draw is a finding `scene.not-yet`, never an error.
//!
//! Nothing is added to a scene that the file does not say: no lights, no tone map; only where `[camera]` is
//! missing, a camera is fitted.

use super::files::{self, Root};
use super::{LoadOptions, Loaded, Materials, decode};
use crate::error::{Error, Finding, Result};
use crate::image::{Encoding, Image, Pixels};
use crate::job::{Job, Reservation};
use crate::math::exact;
use crate::math::vec::{Mat4, Vec3};
use crate::mesh::{Mesh, shape};
use crate::scene::{
    Ambient, Background, Bias, Camera, Falloff, Light, LightKind, Material, Model, Object, Output, Projection, Scene,
    Shadow, ShadowFilter, ShadowProjection, ShadowWrap, ToneMap, View,
};
use rayon::prelude::*;
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use table::{Source, Table, Value};

mod material;
mod table;

/// Most bytes of a scene file.
const LIMIT: u64 = 64 << 20;

/// Loads a scene file.
///
/// # Errors
/// Input faults that name the line: `scene.syntax`, `scene.unknown-key`, `scene.missing-key`, `scene.type`,
/// `scene.range`, `scene.version`, `scene.unknown-material`; those of the models and images that it names.
pub(crate) fn load(path: &Path, options: &LoadOptions) -> Result<Loaded> {
    let bytes = files::read_path(path, LIMIT, &options.job)?;
    // A value of one letter becomes an entry of some 60 bytes.
    let _held = options.job.reserve(bytes.len() as u64 * 64, "the scene file")?;
    let text = std::str::from_utf8(&bytes).map_err(|e| {
        Error::input("scene.syntax", "the file is no UTF-8 text")
            .in_file(path)
            .at(format!("byte {}", e.valid_up_to()))
            .remedy("save it as UTF-8")
    })?;
    let root = Root::of(path, options.allow_outside)?;
    let (mut scene, findings) = read(text, path, &root, options)?;
    scene.name = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    Ok(Loaded { scene, findings })
}

fn read(text: &str, path: &Path, root: &Root, options: &LoadOptions) -> Result<(Scene, Vec<Finding>)> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let source = Source { text, path, findings: RefCell::default() };
    let document = ::toml::de::DeTable::parse(text).map_err(|e| {
        let at = e.span().map_or(0, |s| s.start);
        source.error("scene.syntax", at, e.message().lines().next().unwrap_or("this is no TOML").to_owned())
    })?;
    let top = Table::new(&source, String::new(), 0, document.get_ref());
    if let Some(v) = top.get("version")
        && v.u32(0..=u32::MAX)? != 1
    {
        return Err(source
            .error("scene.version", v.at, "this version of the scene file is not known")
            .remedy("write version = 1, or use a newer frieze"));
    }
    let mut scene = Scene::default();
    if let Some(t) = top.table("output")? {
        scene.output = output(&t)?;
    }
    for t in top.tables("camera")? {
        scene.cameras.push(camera(&t)?);
        scene.view = View::Camera(0);
    }
    if let Some(t) = top.table("ambient")? {
        scene.ambient = ambient(&t)?;
    }
    for t in top.tables("light")? {
        scene.lights.push(light(&t)?);
    }
    let materials = top.table("material")?;
    let objects = top.tables("object")?;
    later(&top)?;
    top.finish()?;
    let mut held = Vec::new();
    let wanted = objects.iter().map(|t| object(t, &options.job, &mut held)).collect::<Result<Vec<_>>>()?;
    things(&mut scene, &source, materials.as_ref(), wanted, root, options, &mut held)?;
    if scene.view == View::Auto {
        super::within_reach(&scene).map_err(|e| e.in_file(path))?;
    }
    let dark = |c: [f32; 3]| c.iter().all(|&v| v <= 0.0);
    let lit = |m: &Material| !dark(m.emissive) || m.model == Model::Unlit;
    if !scene.objects.is_empty()
        && scene.lights.is_empty()
        && top.get("ambient").is_none()
        && !scene.materials.iter().any(lit)
    {
        let message = "the scene has no light: only the default ambient light, 0.2, shows it";
        let action = "a scene file gets the lights that it says: add [[light]], or [ambient] if this is meant";
        source.findings.borrow_mut().push(Finding::note("scene.no-light", message, action).in_file(path));
    }
    let findings = source.findings.take();
    Ok((scene, findings))
}

fn output(t: &Table) -> Result<Output> {
    let d = Output::default();
    let size = match t.get("size") {
        None => d.size,
        Some(v) if v.is_list() => match &v.list()?[..] {
            [w, h] => [w.u32(1..=65536)?, h.u32(1..=65536)?],
            other => return Err(v.out_of_range(format_args!("has {} entries; it must have 2", other.len()))),
        },
        Some(v) => [v.u32(1..=65536)?; 2],
    };
    let background = match t.get("background") {
        None => d.background,
        Some(v) if v.is_str() => {
            if v.word(&[("environment", true), ("transparent", false)])? {
                v.not_yet("the default colour is used");
                d.background
            } else {
                Background::Transparent
            }
        }
        Some(v) => Background::Color(v.color()?),
    };
    let curves = [
        ("none", ToneMap::None),
        ("aces", ToneMap::Aces),
        ("agx", ToneMap::Agx),
        ("reinhard", ToneMap::Reinhard),
        ("khronos-neutral", ToneMap::KhronosNeutral),
    ];
    let samples = match t.get("samples") {
        None => d.samples,
        Some(v) => match v.u32(1..=16)? {
            n @ (1 | 4 | 8 | 16) => n,
            n => return Err(v.out_of_range(format_args!("is {n}; it must be 1, 4, 8 or 16"))),
        },
    };
    let made = Output {
        size,
        background,
        tone_map: t.word("tone_map", &curves)?.unwrap_or_default(),
        encode: t.word("encode", &[("srgb", Encoding::Srgb), ("linear", Encoding::Linear)])?.unwrap_or(d.encode),
        samples,
        supersample: t.u32("supersample", 1..=16)?.unwrap_or(1),
    };
    t.finish()?;
    Ok(made)
}

/// The eye is needed (or a matrix); target: the origin; up: +Y; 45 degrees; near: a hundredth of the distance
/// to the target; far: infinite.
fn camera(t: &Table) -> Result<Camera> {
    let matrix = t.get("matrix");
    let eye = if matrix.is_some() { t.get("eye") } else { Some(t.need("eye")?) };
    let (target, up) = (t.get("target"), t.get("up"));
    let mut made = match (matrix, eye) {
        (Some(v), None) if target.is_none() && up.is_none() => {
            let m = matrix_of(&v)?;
            let axes = [0, 1, 2].map(|k| m.column(k).xyz().normalize());
            let eye = m.column(3).xyz();
            // Orbits turn about the point of the view's axis that is nearest to the origin, if it is in front.
            let distance = axes[2].dot(eye);
            let distance = if distance > 0.0 { distance } else { eye.length().max(1.0) };
            Camera {
                transform: Mat4::from_axes(axes[0], axes[1], axes[2], eye),
                near: (distance * 0.01).max(1e-6),
                ..Camera::look_at(eye, eye - axes[2] * distance, axes[1], 45.0)
            }
        }
        (Some(v), _) => return Err(v.out_of_range("excludes `eye`, `target` and `up`")),
        (None, eye) => {
            let v3 = |v: Option<&Value>, d: [f32; 3]| v.map_or(Ok(d), Value::floats::<3>).map(Vec3::from);
            let (e, look) = (v3(eye.as_ref(), [0.0; 3])?, v3(target.as_ref(), [0.0; 3])?);
            if (look - e).length2() <= 0.0 {
                let v = target.as_ref().or(eye.as_ref()).expect("an eye is needed");
                return Err(v.out_of_range("is where the camera is: it looks nowhere"));
            }
            let u = v3(up.as_ref(), [0.0, 1.0, 0.0])?;
            if u.length2() <= 0.0 {
                return Err(up.as_ref().expect("the default is no zero").out_of_range("must not be zero"));
            }
            Camera::look_at(e, look, u, 45.0)
        }
    };
    made.name = t.str("name")?.unwrap_or_default().to_owned();
    let (fov, height, intrinsics) = (t.get("fov_y"), t.get("height"), t.get("intrinsics"));
    let orthographic = t.word("projection", &[("perspective", false), ("orthographic", true)])?;
    made.projection = match (orthographic, &height, &intrinsics) {
        (Some(true), _, None) => {
            Projection::Orthographic { height: t.need("height")?.within(f32::MIN_POSITIVE..=f32::MAX)? }
        }
        (_, Some(h), _) => return Err(h.out_of_range("needs projection = \"orthographic\"")),
        (Some(true), _, Some(i)) => return Err(i.out_of_range("does not go with an orthographic projection")),
        (_, None, Some(i)) => {
            if let Some(f) = &fov {
                return Err(f.out_of_range("does not go with `intrinsics`"));
            }
            let t = i.table()?;
            let focal = |key| t.need(key)?.within(f32::MIN_POSITIVE..=f32::MAX);
            let (fx, fy, cx, cy) = (focal("fx")?, focal("fy")?, t.need("cx")?.f32()?, t.need("cy")?.f32()?);
            t.finish()?;
            Projection::Intrinsics { fx, fy, cx, cy }
        }
        (_, None, None) => {
            Projection::Perspective { fov_y: fov.as_ref().map_or(Ok(45.0), |f| f.within(0.01..=179.0))? }
        }
    };
    made.near = t.above_zero("near")?.unwrap_or(made.near);
    if let Some(v) = t.get("far") {
        made.far = v.above_zero_or_infinite()?;
        if made.far <= made.near {
            return Err(v.out_of_range(format_args!("is {}; it must be beyond near, {}", made.far, made.near)));
        }
    }
    t.finish()?;
    Ok(made)
}

fn matrix_of(v: &Value) -> Result<Mat4> {
    let m = Mat4::from_columns(v.floats()?);
    if [0, 1, 2].iter().any(|&c| m.0[c][3] != 0.0) || m.0[3][3] != 1.0 {
        return Err(v.out_of_range("must be 16 numbers, column by column, with the last row 0, 0, 0, 1"));
    }
    if m.determinant3() == 0.0 {
        return Err(v.out_of_range("flattens space: its determinant is 0"));
    }
    Ok(m)
}

fn ambient(t: &Table) -> Result<Ambient> {
    let made =
        Ambient { color: t.color("color")?.unwrap_or([0.2; 3]), per_light: t.bool("per_light")?.unwrap_or(false) };
    if let Some(v) = t.get("environment") {
        let e = v.table()?;
        e.str("file")?;
        e.word("projection", &[("latlong", ()), ("cube", ()), ("cross", ()), ("octahedral", ())])?;
        e.f32("rotation")?;
        e.within("intensity", 0.0..=f32::MAX)?;
        e.bool("sun")?;
        e.word("procedural", &[("studio", ()), ("sky", ())])?;
        if let Some(f) = e.get("faces") {
            let faces = f.list()?;
            if faces.len() != 6 {
                return Err(f.out_of_range(format_args!("has {} entries; it must have 6", faces.len())));
            }
            faces.iter().try_for_each(|f| f.str().map(|_| ()))?;
        }
        e.finish()?;
        v.not_yet("the colour of [ambient] is used");
    }
    t.finish()?;
    Ok(made)
}

fn light(t: &Table) -> Result<Light> {
    #[derive(Clone, Copy, PartialEq)]
    enum Kind {
        Directional,
        Point,
        Spot,
        Area,
    }
    let kind_value = t.need("kind")?;
    let kind = kind_value.word(&[
        ("directional", Kind::Directional),
        ("point", Kind::Point),
        ("spot", Kind::Spot),
        ("area", Kind::Area),
    ])?;
    let aimed = matches!(kind, Kind::Directional | Kind::Spot);
    let (target, direction) = (t.get("target"), t.get("direction"));
    let position = match (t.get("position"), &direction) {
        (Some(v), _) => Some(v.floats()?.into()),
        (None, Some(_)) if kind == Kind::Directional => None,
        (None, _) => Some(t.need("position")?.floats()?.into()),
    };
    let travels = match (&direction, position) {
        (Some(v), _) if target.is_some() => return Err(v.out_of_range("does not go with `target`")),
        (Some(v), _) => Vec3::from(v.floats()?),
        (None, Some(p)) => Vec3::from(target.as_ref().map_or(Ok([0.0; 3]), |v| v.floats())?) - p,
        (None, None) => unreachable!("without a direction a position is needed"),
    };
    if aimed && travels.length2() <= 0.0 {
        let v = direction.as_ref().or(target.as_ref()).unwrap_or(&kind_value);
        return Err(v.out_of_range("gives the light no direction: position and target are the same"));
    }
    let travels = if travels.length2() > 0.0 { travels.normalize() } else { Vec3::new(0.0, -1.0, 0.0) };
    let position = position.unwrap_or_else(|| Vec3::splat(0.0) - travels);
    let (inner, outer) = (t.get("inner_angle"), t.get("outer_angle"));
    let (shape, extent, radius) = (
        t.word("shape", &[("disk", ()), ("rect", ()), ("sphere", ())])?,
        t.floats::<2>("extent")?,
        t.above_zero("radius")?,
    );
    for (key, given, owner) in [
        ("inner_angle", inner.is_some(), Kind::Spot),
        ("outer_angle", outer.is_some(), Kind::Spot),
        ("shape", shape.is_some(), Kind::Area),
        ("extent", extent.is_some(), Kind::Area),
        ("radius", radius.is_some(), Kind::Area),
    ] {
        if given && kind != owner {
            let v = t.need(key)?;
            let word = if owner == Kind::Spot { "spot" } else { "area" };
            return Err(v.out_of_range(format_args!("belongs to kind = \"{word}\"")));
        }
    }
    let kind = match kind {
        Kind::Directional => LightKind::Directional,
        Kind::Point => LightKind::Point,
        Kind::Area => {
            kind_value.not_yet("it shines as a point light");
            LightKind::Point
        }
        Kind::Spot => {
            let outer_angle = outer.as_ref().map_or(Ok(45.0), |v| v.within(0.01..=90.0))?;
            let inner_angle = inner.as_ref().map_or(Ok(0.0), |v| v.within(0.0..=90.0))?;
            if inner_angle >= outer_angle {
                let v = inner.as_ref().or(outer.as_ref()).expect("the defaults are in order");
                return Err(v.out_of_range(format_args!(
                    "does not fit: the inner angle, {inner_angle}, must be below the outer, {outer_angle}"
                )));
            }
            LightKind::Spot { inner: inner_angle, outer: outer_angle }
        }
    };
    let made = Light {
        name: t.str("name")?.unwrap_or_default().to_owned(),
        kind,
        position,
        direction: travels,
        color: t.color("color")?.unwrap_or([1.0; 3]),
        intensity: t.within("intensity", 0.0..=f32::MAX)?.unwrap_or(1.0),
        falloff: t
            .word("falloff", &[("none", Falloff::None), ("inverse-square", Falloff::InverseSquare)])?
            .unwrap_or_default(),
        range: t.above_zero("range")?,
        shadow: shadow(t, &kind_value, kind)?,
    };
    t.finish()?;
    Ok(made)
}

/// Directional and spot lights cast by default; point lights when they are told to and given a projection that
/// is not a cube.
fn shadow(light: &Table, kind_value: &Value, kind: LightKind) -> Result<Option<Shadow>> {
    let mut made = Shadow::default();
    let value = light.get("shadow");
    let mut cube = kind == LightKind::Point;
    match &value {
        None if cube => return Ok(None),
        None => {}
        Some(v) if v.is_bool() && !v.bool()? => return Ok(None),
        Some(v) if v.is_bool() => {}
        Some(v) => {
            let t = v.table()?;
            made.size = t.u32("size", 1..=16384)?.unwrap_or(made.size);
            let radius = t.u32("radius", 0..=16)?.unwrap_or(1);
            let pcf = ShadowFilter::Pcf { radius };
            let filters = [
                ("hard", (ShadowFilter::Hard, true)),
                ("none", (ShadowFilter::Hard, true)),
                ("pcf", (pcf, true)),
                ("pcss", (pcf, false)),
                ("moment", (pcf, false)),
                ("ray", (pcf, false)),
            ];
            let (filter, built) = t.word("filter", &filters)?.unwrap_or((pcf, true));
            made.filter = filter;
            if !built {
                t.get("filter").inspect(|v| v.not_yet("the shadow is filtered with pcf"));
            }
            made.bias = match t.get("bias") {
                None => Bias::Auto,
                Some(b) if b.is_str() => b.word(&[("auto", Bias::Auto)])?,
                Some(b) => Bias::Value(b.within(-1.0..=1.0)?),
            };
            let projections = [
                ("orthographic", Some(ShadowProjection::Orthographic)),
                ("perspective", Some(ShadowProjection::Perspective)),
                ("cube", None),
            ];
            if let Some(p) = t.word("projection", &projections)? {
                made.projection = p;
                cube = p.is_none();
            }
            made.near = t.within("near", 0.0..=f32::MAX)?;
            made.far = t.above_zero("far")?;
            if let (Some(near), Some(far)) = (made.near, made.far)
                && near >= far
            {
                return Err(t.need("far")?.out_of_range(format_args!("is {far}; it must be beyond near, {near}")));
            }
            made.extent = t.above_zero("extent")?;
            made.wrap =
                t.word("wrap", &[("border", ShadowWrap::Border), ("repeat", ShadowWrap::Repeat)])?.unwrap_or(made.wrap);
            if t.u32("cascades", 1..=8)?.unwrap_or(1) > 1 {
                t.get("cascades").inspect(|v| v.not_yet("one map is used"));
            }
            t.finish()?;
        }
    }
    if cube {
        value.as_ref().unwrap_or(kind_value).not_yet("cube shadows: the light casts none");
        return Ok(None);
    }
    let perspective = made.projection == Some(ShadowProjection::Perspective)
        || (made.projection.is_none() && matches!(kind, LightKind::Spot { .. }));
    match &value {
        Some(v) if perspective => v.not_yet("perspective shadow maps: the light casts no shadow"),
        // Spot lights cast by default; nobody asked for it.
        None if perspective => kind_value.default_not_yet(
            format!("`{}`, a spot light, casts no shadow yet", light.name),
            "its light is drawn; shadow = false says that none is wanted",
        ),
        _ => {}
    }
    Ok(Some(made))
}

/// Tables whose techniques come later: checked, told about, left out.
fn later(top: &Table) -> Result<()> {
    for (t, v) in top.tables("volume")?.iter().zip(top.get("volume").iter().cycle()) {
        t.str("file")?;
        t.str("noise")?;
        t.get("size")
            .map(|v| if v.is_list() { v.floats::<3>().map(|_| ()) } else { v.f32().map(|_| ()) })
            .transpose()?;
        if let Some(rows) = t.get("transfer") {
            rows.list()?.iter().try_for_each(|r| r.floats::<5>().map(|_| ()))?;
        }
        t.f32("iso")?;
        t.u32("steps", 1..=1 << 20)?;
        t.get("scattering")
            .map(|v| if v.is_list() { v.color().map(|_| ()) } else { v.f32().map(|_| ()) })
            .transpose()?;
        for key in ["octaves", "seed"] {
            t.u32(key, 0..=u32::MAX)?;
        }
        t.above_zero("frequency")?;
        t.floats::<3>("translate")?;
        t.finish()?;
        v.not_yet("the volume is left out");
    }
    for (t, v) in top.tables("animation")?.iter().zip(top.get("animation").iter().cycle()) {
        if let Some(v) = t.get("object")
            && !v.is_str()
        {
            v.u32(0..=u32::MAX)?;
        }
        t.str("key")?;
        let numbers =
            |v: Value| v.list()?.iter().try_for_each(|x| if x.is_list() { Ok(()) } else { x.f32().map(|_| ()) });
        t.get("times").map(numbers).transpose()?;
        t.get("values").map(numbers).transpose()?;
        t.finish()?;
        v.not_yet("the scene stands still");
    }
    Ok(())
}

/// What an `[[object]]` asks for.
struct Wanted<'a> {
    /// Where in the file.
    at: usize,
    name: String,
    shape: Shape<'a>,
    transforms: Vec<Mat4>,
    material: Option<Value<'a>>,
}

enum Shape<'a> {
    File(Value<'a>),
    Made(Box<Mesh>),
}

fn object<'a>(t: &Table<'a>, job: &Job, held: &mut Vec<Reservation>) -> Result<Wanted<'a>> {
    let mesh = t.need("mesh")?;
    let shape = if mesh.is_table() {
        Shape::Made(Box::new(primitive(&mesh.table()?, job, held)?))
    } else {
        mesh.str()?;
        Shape::File(mesh)
    };
    let (axis, angle, euler) = (t.get("rotate_axis"), t.get("rotate_angle"), t.get("rotate"));
    let rotation = match (axis, angle, euler) {
        (None, None, euler) => euler_of(euler.map_or(Ok([0.0; 3]), |v| v.floats())?),
        (Some(a), Some(d), None) => {
            let v: [f32; 3] = a.floats()?;
            axis_angle(v, d.f32()?).ok_or_else(|| a.out_of_range("must not be zero"))?
        }
        (_, _, Some(v)) => return Err(v.out_of_range("does not go with `rotate_axis` and `rotate_angle`")),
        (Some(v), None, None) => return Err(v.out_of_range("needs `rotate_angle`")),
        (None, Some(v), None) => return Err(v.out_of_range("needs `rotate_axis`")),
    };
    let scale = match t.get("scale") {
        None => [1.0; 3],
        Some(v) if v.is_list() => v.floats()?,
        Some(v) => [v.f32()?; 3],
    };
    let move_by: [f32; 3] = t.floats("translate")?.unwrap_or([0.0; 3]);
    // T * R * S: the columns of R, each scaled, and the translation. Rounded once.
    let mut own = Mat4::translation(move_by.into());
    for ((column, turned), s) in own.0.iter_mut().zip(rotation).zip(scale) {
        column.iter_mut().zip(turned).for_each(|(m, v)| *m = (v * f64::from(s)) as f32);
    }
    let transforms = match t.get("instances") {
        None => vec![own],
        Some(v) => v
            .list()?
            .iter()
            .map(|m| {
                let placed = own.times(&Mat4::from_columns(m.floats()?));
                let finite = placed.0.iter().flatten().all(|v| v.is_finite());
                if finite { Ok(placed) } else { Err(m.out_of_range("leaves the range of numbers")) }
            })
            .collect::<Result<_>>()?,
    };
    if let Some(v) = t.get("time") {
        v.f32()?;
        v.not_yet("the object stands still");
    }
    let material = t.get("material");
    if let Some(m) = &material {
        m.str()?;
    }
    let name = t.str("name")?.unwrap_or_default().to_owned();
    t.finish()?;
    Ok(Wanted { at: t.at, name, shape, transforms, material })
}

/// Sine and cosine of degrees, exact at multiples of 90.
fn sin_cos(degrees: f32) -> (f64, f64) {
    let d = f64::from(degrees) % 360.0;
    let d = if d < 0.0 { d + 360.0 } else { d };
    match d {
        0.0 | 360.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        _ => exact::sin_cos_f64(d * core::f64::consts::PI / 180.0),
    }
}

/// Rz * Ry * Rx, as columns.
fn euler_of(degrees: [f32; 3]) -> [[f64; 3]; 3] {
    let [(sx, cx), (sy, cy), (sz, cz)] = degrees.map(sin_cos);
    [
        [cz * cy, sz * cy, -sy],
        [cz * sy * sx - sz * cx, sz * sy * sx + cz * cx, cy * sx],
        [cz * sy * cx + sz * sx, sz * sy * cx - cz * sx, cy * cx],
    ]
}

/// The rotation about an axis, as columns (Rodrigues); `None` for the zero axis.
fn axis_angle(axis: [f32; 3], degrees: f32) -> Option<[[f64; 3]; 3]> {
    let [x, y, z] = axis.map(f64::from);
    let length = (x * x + y * y + z * z).sqrt();
    if length <= 0.0 {
        return None;
    }
    let (x, y, z) = (x / length, y / length, z / length);
    let (s, c) = sin_cos(degrees);
    let t = 1.0 - c;
    Some([
        [t * x * x + c, t * x * y + s * z, t * x * z - s * y],
        [t * x * y - s * z, t * y * y + c, t * y * z + s * x],
        [t * x * z + s * y, t * y * z - s * x, t * z * z + c],
    ])
}

fn primitive(t: &Table, job: &Job, held: &mut Vec<Reservation>) -> Result<Mesh> {
    #[derive(Clone, Copy)]
    enum Kind {
        Cube,
        Plane,
        Sphere,
        Torus,
        Teapot,
    }
    let kinds = [
        ("cube", Kind::Cube),
        ("plane", Kind::Plane),
        ("sphere", Kind::Sphere),
        ("torus", Kind::Torus),
        ("teapot", Kind::Teapot),
    ];
    let kind = t.need("primitive")?.word(&kinds)?;
    let size = t.above_zero("size")?.unwrap_or(2.0);
    let segments = t.u32("segments", 1..=shape::MAX_SEGMENTS)?;
    let scale = match t.get("uv_scale") {
        None => [1.0; 2],
        Some(v) if v.is_list() => v.floats()?,
        Some(v) => [v.f32()?; 2],
    };
    t.finish()?;
    // A quad has 112 bytes of indices and triangles, and about one vertex of 32 bytes.
    let n = u64::from(segments.unwrap_or(if matches!(kind, Kind::Plane) { 1 } else { 64 })).max(8);
    let quads = match kind {
        Kind::Cube => 24, // for the vertices, which are not shared
        Kind::Plane | Kind::Sphere | Kind::Torus => n * n,
        Kind::Teapot => n * n * 2, // 32 patches, each side a quarter of the segments
    };
    held.push(job.reserve(quads * 144, "a primitive")?);
    let mut mesh = match kind {
        Kind::Cube => shape::cube(size),
        Kind::Plane => shape::plane(size, segments.unwrap_or(1)),
        Kind::Sphere => shape::sphere(size, segments.unwrap_or(64)),
        Kind::Torus => shape::torus(size, segments.unwrap_or(64)),
        Kind::Teapot => shape::teapot(size, segments.unwrap_or(64)),
    };
    for uv in mesh.uv.iter_mut().flatten() {
        uv.values.iter_mut().for_each(|v| *v = [v[0] * scale[0], v[1] * scale[1]]);
    }
    Ok(mesh)
}

/// Materials, images, meshes and objects.
fn things(
    scene: &mut Scene,
    source: &Source,
    materials: Option<&Table>,
    wanted: Vec<Wanted>,
    root: &Root,
    options: &LoadOptions,
    held: &mut Vec<Reservation>,
) -> Result<()> {
    let named = materials.map_or_else(Vec::new, Table::all);
    // Images that some used material asks, each file once, in the order of the slots.
    let mut images: Vec<PathBuf> = Vec::new();
    // Where the file says nothing, primitives and files that know no sides are double-sided: so a name may
    // become two materials.
    let mut made: Vec<(&str, bool)> = Vec::new();
    let sided = |w: &Wanted| match &w.shape {
        Shape::File(v) => !v.str().is_ok_and(|f| {
            let ending = f.rsplit('.').next().unwrap_or_default();
            ending.eq_ignore_ascii_case("glb") || ending.eq_ignore_ascii_case("gltf")
        }),
        Shape::Made(_) => true,
    };
    let mut chosen = Vec::new();
    for w in &wanted {
        let Some(value) = &w.material else {
            chosen.push(None);
            continue;
        };
        let name = value.str()?;
        let Some((_, table)) = named.iter().find(|(n, _)| *n == name) else {
            return Err(material::unknown(value, name, named.iter().map(|n| n.0)));
        };
        let told = table.table()?.get("double_sided").and_then(|v| v.bool().ok());
        let key = (name, told.unwrap_or_else(|| sided(w)));
        let at = match made.iter().position(|m| *m == key) {
            Some(at) => at,
            None => {
                let told = source.findings.borrow().len();
                let mut register = |file: &str, v: &Value| {
                    let path = root
                        .resolve(file)
                        .map_err(|e| if e.file.is_some() { e } else { e.in_file(source.path).at(source.line(v.at)) })?;
                    Ok(images.iter().position(|p| *p == path).unwrap_or_else(|| {
                        images.push(path);
                        images.len() - 1
                    }))
                };
                scene.materials.push(material::read(&table.table()?, name, key.1, &mut register)?);
                if made.iter().any(|m| m.0 == name) {
                    source.findings.borrow_mut().truncate(told); // told about already
                }
                made.push(key);
                made.len() - 1
            }
        };
        chosen.push(Some(at));
    }
    // Materials that nothing uses are checked, but their images stay where they are.
    for (name, table) in &named {
        if !made.iter().any(|m| m.0 == *name) {
            let told = source.findings.borrow().len();
            material::read(&table.table()?, name, false, &mut |_, _| Ok(0))?;
            source.findings.borrow_mut().truncate(told);
        }
    }
    for (image, findings) in decode_all(&images, options)? {
        held.push(options.job.reserve(image.bytes(), "a picture")?);
        scene.images.push(Arc::new(image));
        source.findings.borrow_mut().extend(findings);
    }
    for m in &mut scene.materials {
        let images = &scene.images;
        material::settle(m, |k| matches!(images[k].pixels(), Pixels::F16(_) | Pixels::F32(_)));
    }

    let mut models: Vec<(PathBuf, bool, Placed)> = Vec::new();
    let mut plain = None;
    for (w, chosen) in wanted.into_iter().zip(chosen) {
        options.job.check()?;
        let parts = match w.shape {
            Shape::Made(mesh) => {
                let material = chosen.unwrap_or_else(|| {
                    *plain.get_or_insert_with(|| {
                        scene.add_material(Material { double_sided: true, ..Default::default() })
                    })
                });
                let name = mesh.name.clone();
                scene.meshes.push(*mesh);
                Arc::new(vec![Object {
                    name,
                    mesh: scene.meshes.len() - 1,
                    transform: Mat4::IDENTITY,
                    materials: vec![material],
                }])
            }
            Shape::File(value) => {
                let here = |e: Error| {
                    if e.file.is_some() { e } else { e.in_file(source.path).at(source.line(value.at)) }
                };
                let path = root.resolve(value.str()?).map_err(here)?;
                let own = chosen.is_none();
                match models.iter().find(|m| m.0 == path && m.1 == own) {
                    Some((_, _, parts)) => parts.clone(),
                    None => {
                        let (meshes, images) = (scene.meshes.len(), scene.images.len());
                        let parts = Arc::new(model(scene, source, &path, root, options, own).map_err(here)?);
                        let bytes = scene.meshes[meshes..].iter().map(Mesh::bytes).sum::<u64>()
                            + scene.images[images..].iter().map(|i| i.bytes()).sum::<u64>();
                        held.push(options.job.reserve(bytes, "a model")?);
                        models.push((path, own, parts.clone()));
                        parts
                    }
                }
            }
        };
        let name = |part: &Object| if w.name.is_empty() { part.name.clone() } else { w.name.clone() };
        // Every instance of every part: a short file may ask for very many.
        let each = |p: &Object| (size_of::<Object>() + 8 * p.materials.len() + name(p).len()) as u64;
        let bytes = parts.iter().map(each).sum::<u64>().saturating_mul(w.transforms.len() as u64);
        held.push(options.job.reserve(bytes, "instances")?);
        for transform in &w.transforms {
            for part in parts.iter() {
                let placed = transform.times(&part.transform);
                if !placed.0.iter().flatten().all(|v| v.is_finite()) {
                    let message = format!("an object of `{}` is placed beyond the range of numbers", part.name);
                    return Err(source.error("scene.range", w.at, message).remedy("make its scale smaller"));
                }
                scene.objects.push(Object {
                    name: name(part),
                    mesh: part.mesh,
                    transform: placed,
                    materials: chosen.map_or_else(|| part.materials.clone(), |m| vec![m]),
                });
            }
        }
    }
    Ok(())
}

/// The objects of a model, with the scene's indices.
type Placed = Arc<Vec<Object>>;

/// Loads a model and moves what it holds into the scene; its own lights and cameras stay out.
fn model(
    scene: &mut Scene,
    source: &Source,
    path: &Path,
    root: &Root,
    options: &LoadOptions,
    own: bool,
) -> Result<Vec<Object>> {
    let wanted = if own { Materials::Own } else { Materials::Replaced };
    let (mut loaded, findings) = super::model(path, root, options, wanted)?;
    source.findings.borrow_mut().extend(findings);
    let (meshes, images, materials) = (scene.meshes.len(), scene.images.len(), scene.materials.len());
    scene.meshes.append(&mut loaded.meshes);
    if own {
        scene.images.append(&mut loaded.images);
        for mut m in loaded.materials {
            shift_images(&mut m, images);
            scene.materials.push(m);
        }
    }
    let objects = loaded.objects.into_iter();
    Ok(objects
        .map(|o| Object {
            mesh: o.mesh + meshes,
            materials: o.materials.into_iter().map(|m| m + materials).collect(),
            ..o
        })
        .collect())
}

/// Moves the indices of all textures of a material.
fn shift_images(m: &mut Material, by: usize) {
    let plain = [
        &mut m.albedo_map,
        &mut m.ambient_map,
        &mut m.specular_map,
        &mut m.specular_factor_map,
        &mut m.shininess_map,
        &mut m.alpha_map,
        &mut m.metallic_map,
        &mut m.roughness_map,
        &mut m.emissive_map,
        &mut m.occlusion_map,
    ];
    plain.into_iter().flatten().for_each(|t| t.image += by);
    let heights = [&mut m.bump_map, &mut m.displacement_map, &mut m.parallax_map];
    heights.into_iter().flatten().for_each(|h| h.texture.image += by);
    m.normal_map.iter_mut().for_each(|n| n.texture.image += by);
}

/// Decodes side by side; what comes first in the file is told first.
fn decode_all(paths: &[PathBuf], options: &LoadOptions) -> Result<Vec<(Image, Vec<Finding>)>> {
    let job = &options.job;
    let all: Vec<Result<_>> = job.run(|| {
        paths
            .par_iter()
            .map(|path| {
                let bytes = files::read_path(path, files::LIMIT, job)?;
                decode::image(&bytes, path, job)
            })
            .collect()
    });
    all.into_iter().collect()
}

#[cfg(test)]
mod tests;
