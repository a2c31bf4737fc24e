//! PLY (Turk 1994): text and binary of both byte orders, properties in any order and of any type, polygons.
//!
//! Vertices: `x y z`, `nx ny nz`, `s t` (or `u v`, `texture_u texture_v`; v runs up in the file and down here),
//! `red green blue alpha`. Colours of integer types are taken for sRGB, as scanners write them, and made linear;
//! colours of floats are linear. Elements and properties of other names are passed over. The material is a light
//! grey Blinn-Phong, shown from both sides.

use super::files::{self, Blob};
use super::text::{float, text};
use super::triangulate::polygons;
use super::{Context, Findings, stl};
use crate::error::{Error, Finding, Result};
use crate::image::color::{SRGB8_TO_LINEAR, srgb_to_linear};
use crate::mesh::{Attribute, Mesh};
use crate::scene::Scene;
use rayon::prelude::*;

/// A number type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    fn named(word: &[u8]) -> Option<Kind> {
        Some(match word {
            b"char" | b"int8" => Kind::I8,
            b"uchar" | b"uint8" => Kind::U8,
            b"short" | b"int16" => Kind::I16,
            b"ushort" | b"uint16" => Kind::U16,
            b"int" | b"int32" => Kind::I32,
            b"uint" | b"uint32" => Kind::U32,
            b"float" | b"float32" => Kind::F32,
            b"double" | b"float64" => Kind::F64,
            _ => return None,
        })
    }
    fn size(self) -> usize {
        match self {
            Kind::I8 | Kind::U8 => 1,
            Kind::I16 | Kind::U16 => 2,
            Kind::I32 | Kind::U32 | Kind::F32 => 4,
            Kind::F64 => 8,
        }
    }
    /// A number of a binary file. f64 holds every type exactly.
    #[inline(always)]
    fn number(self, b: &[u8], big: bool) -> f64 {
        macro_rules! read {
            ($t:ty, $n:literal) => {{
                let mut bytes = [0; $n];
                bytes.copy_from_slice(&b[..$n]);
                f64::from(if big { <$t>::from_be_bytes(bytes) } else { <$t>::from_le_bytes(bytes) })
            }};
        }
        match self {
            Kind::I8 => f64::from(b[0] as i8),
            Kind::U8 => f64::from(b[0]),
            Kind::I16 => read!(i16, 2),
            Kind::U16 => read!(u16, 2),
            Kind::I32 => read!(i32, 4),
            Kind::U32 => read!(u32, 4),
            Kind::F32 => read!(f32, 4),
            Kind::F64 => read!(f64, 8),
        }
    }
    /// What 1.0 is as a colour, if this is an integer type.
    fn whole(self) -> Option<f64> {
        match self {
            Kind::I8 => Some(127.0),
            Kind::U8 => Some(255.0),
            Kind::I16 => Some(32767.0),
            Kind::U16 => Some(65535.0),
            Kind::I32 => Some(2147483647.0),
            Kind::U32 => Some(4294967295.0),
            Kind::F32 | Kind::F64 => None,
        }
    }
}

#[derive(Debug)]
struct Property {
    name: String,
    kind: Kind,
    /// The type of the count, for lists.
    count: Option<Kind>,
}

#[derive(Debug)]
struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Text,
    Little,
    Big,
}

struct Header {
    format: Format,
    elements: Vec<Element>,
    /// Where the data begin.
    end: usize,
}

/// Reads a file.
pub(super) fn read(blob: &Blob<'_>, context: &Context<'_>, findings: &mut Findings) -> Result<Scene> {
    let mut kept = None;
    let bytes = blob.bytes(context.job, &mut kept)?;
    let header = header(bytes)?;
    let mut body = Body { bytes: &bytes[header.end..], at: 0, format: header.format, offset: header.end };
    let mut mesh = Mesh::default();
    let mut sizes = Vec::new();
    let mut lines = false;
    for element in &header.elements {
        context.job.check()?;
        // Each item of an element takes at least a byte, so no count can ask for more than there is.
        let least = body.least(element);
        let left = (body.bytes.len() - body.at) as u64;
        if element.count.checked_mul(least).is_none_or(|need| need > left) {
            let message = format!(
                "{} items of {:?} need {} bytes or more, there are {left}",
                element.count,
                element.name,
                element.count.saturating_mul(least)
            );
            return Err(Error::input("ply.truncated", message)
                .at(format!("byte {}", body.offset + body.at))
                .remedy("copy or download the file again"));
        }
        match &element.name[..] {
            "vertex" if mesh.positions.is_empty() => vertices(element, &mut body, &mut mesh, context, findings)?,
            "face" if sizes.is_empty() && mesh.corners.is_empty() => {
                faces(element, &mut body, &mut mesh, &mut sizes, context, findings)?
            }
            name => {
                lines |= matches!(name, "edge" | "tristrips");
                if name == "tristrips" || (name == "face" && element.count > 0) {
                    let message = format!("the element {name:?} is not supported here");
                    findings.push(Finding::warning("ply.element-ignored", message, "it was left out"));
                }
                let mut numbers = Vec::new();
                for _ in 0..element.count {
                    body.item(element, &mut numbers, &mut |_, _| Ok(()))?;
                }
            }
        }
    }
    if mesh.corners.is_empty() {
        let what = if lines { "points, lines or strips" } else { "points" };
        findings.push(Finding::warning(
            "ply.no-faces",
            format!("the file holds {what} but no faces"),
            "nothing to show",
        ));
    }
    if let Some(at) = mesh.corners.iter().position(|&c| c as usize >= mesh.positions.len()) {
        let mut end = 0;
        let face = sizes.iter().position(|&s| {
            end += s as usize;
            at < end
        });
        let face = face.unwrap_or(at / 3);
        let message =
            format!("face {face} has index {}, but there are {} vertices", mesh.corners[at], mesh.positions.len());
        return Err(Error::input("ply.index-out-of-range", message));
    }
    if !sizes.is_empty() {
        mesh.polygons = polygons(&mesh.positions, &mesh.corners, &sizes, context)?;
    }
    Ok(stl::scene(mesh, context))
}

fn header(bytes: &[u8]) -> Result<Header> {
    let mut elements: Vec<Element> = Vec::new();
    let mut format = None;
    let mut at = 0;
    let mut number = 0;
    loop {
        number += 1;
        let bad = |message: &str| Error::input("ply.header", message).at(format!("line {number}"));
        let rest = &bytes[at..];
        let Some(end) = rest.iter().take(4096).position(|&b| b == b'\n' || b == b'\r') else {
            return Err(bad("the header has no end"));
        };
        let line = &rest[..end];
        at += end + if rest[end..].starts_with(b"\r\n") { 2 } else { 1 };
        let mut words = line.split(|b| b.is_ascii_whitespace()).filter(|w| !w.is_empty());
        let mut word = || words.next().unwrap_or_default();
        if number == 1 {
            if word() != b"ply" {
                return Err(bad("the file does not begin with \"ply\""));
            }
            continue;
        }
        match word() {
            b"format" => {
                format = Some(match word() {
                    b"ascii" => Format::Text,
                    b"binary_little_endian" => Format::Little,
                    b"binary_big_endian" => Format::Big,
                    _ => return Err(bad("the format is unknown")),
                })
            }
            b"element" => {
                if elements.len() == 256 {
                    return Err(bad("over 256 elements"));
                }
                let name = text(word());
                let count = std::str::from_utf8(word()).ok().and_then(|w| w.parse().ok());
                let count = count.ok_or_else(|| bad("the element has no count"))?;
                elements.push(Element { name, count, properties: Vec::new() });
            }
            b"property" => {
                let element = elements.last_mut().ok_or_else(|| bad("a property before any element"))?;
                if element.properties.len() == 1024 {
                    return Err(bad("over 1024 properties"));
                }
                let first = word();
                let unknown = || bad("the type of the property is unknown");
                let (kind, count) = if first == b"list" {
                    let count = Kind::named(word()).filter(|k| k.whole().is_some()).ok_or_else(unknown)?;
                    (Kind::named(word()).ok_or_else(unknown)?, Some(count))
                } else {
                    (Kind::named(first).ok_or_else(unknown)?, None)
                };
                element.properties.push(Property { name: text(word()), kind, count });
            }
            b"end_header" => break,
            // Comments, and what later writers may add.
            _ => {}
        }
    }
    let format = format.ok_or_else(|| Error::input("ply.header", "the header names no format"))?;
    if let Some(empty) = elements.iter().find(|e| e.properties.is_empty() && e.count > 0) {
        return Err(Error::input("ply.header", format!("the element {:?} has no properties", empty.name)));
    }
    Ok(Header { format, elements, end: at })
}

/// What follows the header.
struct Body<'a> {
    bytes: &'a [u8],
    at: usize,
    format: Format,
    /// Where it begins in the file.
    offset: usize,
}

impl<'a> Body<'a> {
    /// Bytes that an item takes at least.
    fn least(&self, element: &Element) -> u64 {
        match self.format {
            // A digit and a blank per property; the very last may lack the blank.
            Format::Text => element.properties.len() as u64,
            _ => element.properties.iter().map(|p| p.count.unwrap_or(p.kind).size() as u64).sum(),
        }
    }
    fn error(&self, code: &'static str, message: &str) -> Error {
        Error::input(code, message).at(format!("byte {}", self.offset + self.at))
    }
    #[inline(always)]
    fn number(&mut self, kind: Kind) -> Result<f64> {
        if self.format == Format::Text {
            while self.at < self.bytes.len() && self.bytes[self.at].is_ascii_whitespace() {
                self.at += 1;
            }
            let rest = &self.bytes[self.at..];
            let end = rest.iter().position(|b| b.is_ascii_whitespace()).unwrap_or(rest.len());
            let word = &rest[..end];
            let value = match kind {
                // All digits of an index are needed; a f32 has 24 bits only.
                Kind::F32 => float(word).map(f64::from),
                _ => std::str::from_utf8(word).ok().and_then(|w| w.parse().ok()),
            };
            let value = value.ok_or_else(|| match word {
                [] => self.error("ply.truncated", "the file ends too early").remedy(files::CUT_OFF),
                _ => self.error("ply.number", "this is no number"),
            })?;
            self.at += end;
            return Ok(value);
        }
        let size = kind.size();
        let Some(b) = self.bytes.get(self.at..self.at + size) else {
            return Err(self.error("ply.truncated", "the file ends too early").remedy(files::CUT_OFF));
        };
        self.at += size;
        Ok(kind.number(b, self.format == Format::Big))
    }
    /// Reads an item: plain properties into `numbers` (0 for lists), lists to `list` number by number.
    #[inline(always)]
    fn item(
        &mut self,
        element: &Element,
        numbers: &mut Vec<f64>,
        list: &mut impl FnMut(usize, f64) -> Result<()>,
    ) -> Result<()> {
        numbers.clear();
        for (k, property) in element.properties.iter().enumerate() {
            let Some(count) = property.count else {
                let value = self.number(property.kind)?;
                numbers.push(value);
                continue;
            };
            let n = self.number(count)?;
            if n < 0.0 || n.fract() != 0.0 || n > 4294967295.0 {
                return Err(self.error("ply.list", "a list has a negative or broken length"));
            }
            numbers.push(n);
            for _ in 0..n as u32 {
                let value = self.number(property.kind)?;
                list(k, value)?;
            }
        }
        Ok(())
    }
}

/// The first property of one of these names, if it is no list.
fn find(element: &Element, names: &[&str]) -> Option<usize> {
    element.properties.iter().position(|p| p.count.is_none() && names.contains(&&p.name[..]))
}
fn find_all<const N: usize>(element: &Element, names: [&[&str]; N]) -> Option<[usize; N]> {
    let found = names.map(|n| find(element, n));
    found.iter().all(Option::is_some).then(|| found.map(Option::unwrap_or_default))
}

fn vertices(
    element: &Element,
    body: &mut Body<'_>,
    mesh: &mut Mesh,
    context: &Context<'_>,
    findings: &mut Findings,
) -> Result<()> {
    let missing = || Error::input("ply.no-position", "the vertices have no x, y and z");
    let position = find_all(element, [&["x"], &["y"], &["z"]]).ok_or_else(missing)?;
    let normal = find_all(element, [&["nx", "normal_x"], &["ny", "normal_y"], &["nz", "normal_z"]]);
    let uv = find_all(element, [&["s", "u", "texture_u", "texture_s"], &["t", "v", "texture_v", "texture_t"]]);
    let color = find_all(
        element,
        [&["red", "r", "diffuse_red"], &["green", "g", "diffuse_green"], &["blue", "b", "diffuse_blue"]],
    );
    let alpha = color.and_then(|_| find(element, &["alpha", "a"]));
    let each = 12 + 12 * normal.is_some() as u64 + 8 * uv.is_some() as u64 + 16 * color.is_some() as u64;
    if element.count > u64::from(u32::MAX) {
        return Err(Error::input("ply.too-large", "over 2^32 vertices"));
    }
    context.reserve(element.count * each, "vertices")?;
    let n = element.count as usize;
    let part = |has: bool| if has { n } else { 0 };
    let mut positions = vec![[0.0f32; 3]; n];
    let mut normals = vec![[0.0f32; 3]; part(normal.is_some())];
    let mut uvs = vec![[0.0f32; 2]; part(uv.is_some())];
    let mut colors = vec![[0.0f32; 4]; part(color.is_some())];

    let light = |kind: Kind, v: f64| match kind.whole() {
        _ if kind == Kind::U8 => SRGB8_TO_LINEAR[v.clamp(0.0, 255.0) as usize],
        Some(whole) => srgb_to_linear((v / whole).clamp(0.0, 1.0) as f32),
        None if v.is_finite() => v.max(0.0) as f32,
        None => 0.0,
    };
    let kind = |k: usize| element.properties[k].kind;
    let rgba = |number: &dyn Fn(usize) -> f64, rgb: [usize; 3]| {
        let [r, g, b] = rgb.map(|k| light(kind(k), number(k)));
        let a = alpha.map_or(1.0, |k| number(k) / kind(k).whole().unwrap_or(1.0));
        [r, g, b, if a.is_finite() { a.clamp(0.0, 1.0) as f32 } else { 1.0 }]
    };

    let fixed = element.properties.iter().all(|p| p.count.is_none()) && body.format != Format::Text;
    if fixed {
        // All vertices have one size: they are read where they lie, in parallel.
        let size = body.least(element) as usize;
        let bytes = &body.bytes[body.at..body.at + n * size];
        body.at += n * size;
        let big = body.format == Format::Big;
        let mut offsets = Vec::with_capacity(element.properties.len());
        let mut at = 0;
        for p in &element.properties {
            offsets.push(at);
            at += p.kind.size();
        }
        let plain = !big && position.iter().all(|&k| kind(k) == Kind::F32);
        let value = |item: &[u8], k: usize| kind(k).number(&item[offsets[k]..], big);
        let little = |item: &[u8], k: usize| {
            let b = &item[offsets[k]..offsets[k] + 4];
            f32::from_le_bytes([b[0], b[1], b[2], b[3]])
        };
        let items = || bytes.par_chunks_exact(size).with_min_len(4096);
        if plain {
            positions.par_iter_mut().zip(items()).for_each(|(p, item)| *p = position.map(|k| little(item, k)));
        } else {
            positions.par_iter_mut().zip(items()).for_each(|(p, item)| *p = position.map(|k| value(item, k) as f32));
        }
        if let Some(normal) = normal {
            normals.par_iter_mut().zip(items()).for_each(|(p, item)| *p = normal.map(|k| value(item, k) as f32));
        }
        if let Some(uv) = uv {
            uvs.par_iter_mut().zip(items()).for_each(|(p, item)| *p = uv.map(|k| value(item, k) as f32));
        }
        if let Some(color) = color {
            colors.par_iter_mut().zip(items()).for_each(|(p, item)| *p = rgba(&|k| value(item, k), color));
        }
    } else {
        let mut numbers = Vec::new();
        for k in 0..n {
            if k % 65536 == 0 {
                context.job.check()?;
            }
            body.item(element, &mut numbers, &mut |_, _| Ok(()))?;
            positions[k] = position.map(|p| numbers[p] as f32);
            if let Some(normal) = normal {
                normals[k] = normal.map(|p| numbers[p] as f32);
            }
            if let Some(uv) = uv {
                uvs[k] = uv.map(|p| numbers[p] as f32);
            }
            if let Some(color) = color {
                colors[k] = rgba(&|p| numbers[p], color);
            }
        }
    }
    if let Some(bad) = positions.iter().position(|p| !p.iter().all(|v| v.is_finite())) {
        return Err(Error::input("mesh.not-finite", format!("the position of vertex {bad} is not finite"))
            .remedy("the model is broken there; remove or move the vertex"));
    }
    uvs.iter_mut().for_each(|uv| uv[1] = 1.0 - uv[1]);
    let numbers = normals.iter_mut().flatten().chain(uvs.iter_mut().flatten());
    let bad = numbers.filter(|v| !v.is_finite()).map(|v| *v = 0.0).count();
    if bad > 0 {
        let message = format!("{bad} numbers of normals or texture coordinates are not finite");
        findings.push(Finding::warning("mesh.attribute-not-finite", message, "they were taken for 0"));
    }
    mesh.positions = positions;
    mesh.normals = normal.map(|_| Attribute::per_position(normals));
    mesh.uv[0] = uv.map(|_| Attribute::per_position(uvs));
    mesh.colors = color.map(|_| Attribute::per_position(colors));
    Ok(())
}

fn faces(
    element: &Element,
    body: &mut Body<'_>,
    mesh: &mut Mesh,
    sizes: &mut Vec<u32>,
    context: &Context<'_>,
    findings: &mut Findings,
) -> Result<()> {
    let list =
        |names: &[&str]| element.properties.iter().position(|p| p.count.is_some() && names.contains(&&p.name[..]));
    let Some(indices) = list(&["vertex_indices", "vertex_index"]) else {
        return Err(Error::input("ply.no-indices", "the faces have no list vertex_indices"));
    };
    let p = &element.properties[indices];
    if element.properties.len() == 1
        && body.format != Format::Text
        && p.count == Some(Kind::U8)
        && matches!(p.kind, Kind::I32 | Kind::U32)
        && triangles(element.count, body, mesh, context)?
    {
        return Ok(());
    }
    // Texture coordinates of corners, as MeshLab writes them.
    let wedge = list(&["texcoord"]);
    let mut uvs: Vec<[f32; 2]> = Vec::new();
    // A corner takes at least a byte of the file (with its blank, two of text).
    let left = (body.bytes.len() - body.at) as u64;
    let most = if body.format == Format::Text { left.div_ceil(2) } else { left / p.kind.size() as u64 };
    context.reserve(most.min(u64::from(u32::MAX)) * 4 + element.count * 4, "faces")?;
    let corners = &mut mesh.corners;
    let (mut numbers, mut face, mut of_face) = (Vec::new(), Vec::new(), Vec::new());
    let mut short = 0;
    for k in 0..element.count {
        if k % 65536 == 0 {
            context.job.check()?;
        }
        face.clear();
        of_face.clear();
        let at = body.at;
        body.item(element, &mut numbers, &mut |property, value| {
            if property == indices {
                // What is no index becomes one that is out of range.
                let whole = (0.0..4294967295.0).contains(&value) && value.fract() == 0.0;
                face.push(if whole { value as u32 } else { u32::MAX });
            } else if Some(property) == wedge {
                of_face.push(value as f32);
            }
            Ok(())
        })?;
        if face.len() < 3 {
            short += 1;
            continue;
        }
        if corners.len() + face.len() >= u32::MAX as usize {
            return Err(Error::input("ply.too-large", "over 2^32 corners").at(format!("byte {}", body.offset + at)));
        }
        sizes.push(face.len() as u32);
        corners.extend_from_slice(&face);
        if wedge.is_some() {
            context.reserve(face.len() as u64 * 12, "texture coordinates")?;
            let pair = |k: usize| [of_face.get(2 * k), of_face.get(2 * k + 1)].map(|v| v.copied().unwrap_or(0.0));
            uvs.extend((0..face.len()).map(|k| {
                let uv = pair(k).map(|v| if v.is_finite() { v } else { 0.0 });
                [uv[0], 1.0 - uv[1]]
            }));
        }
    }
    if wedge.is_some() && !uvs.is_empty() {
        let index = Some((0..uvs.len() as u32).collect());
        mesh.uv[0] = Some(Attribute { values: uvs, index });
    }
    if short > 0 {
        let message = format!("{short} faces have fewer than three corners");
        findings.push(Finding::warning("ply.face-short", message, "they were left out"));
    }
    Ok(())
}

/// The common case, in parallel: every face is `3 i j k` of 13 bytes. False, and nothing is read, when one is not.
fn triangles(count: u64, body: &mut Body<'_>, mesh: &mut Mesh, context: &Context<'_>) -> Result<bool> {
    let len = count.checked_mul(13).filter(|&l| l <= (body.bytes.len() - body.at) as u64);
    let Some(len) = len.filter(|_| count * 3 < u64::from(u32::MAX)) else { return Ok(false) };
    let bytes = &body.bytes[body.at..][..len as usize];
    if !bytes.par_chunks_exact(13).with_min_len(4096).all(|f| f[0] == 3) {
        return Ok(false);
    }
    context.reserve(12 * count, "faces")?;
    mesh.corners = vec![0; 3 * count as usize];
    let big = body.format == Format::Big;
    let out = mesh.corners.par_chunks_exact_mut(3).with_min_len(4096);
    out.zip(bytes.par_chunks_exact(13)).for_each(|(out, f)| {
        for (k, out) in out.iter_mut().enumerate() {
            let b = [f[1 + 4 * k], f[2 + 4 * k], f[3 + 4 * k], f[4 + 4 * k]];
            // A negative int is a huge u32, and out of range.
            *out = if big { u32::from_be_bytes(b) } else { u32::from_le_bytes(b) };
        }
    });
    body.at += len as usize;
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::{LoadOptions, Loaded, load_bytes};

    const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]];

    fn load(bytes: &[u8]) -> Result<Loaded> {
        load_bytes("ply", bytes, &LoadOptions::default())
    }
    fn mesh(bytes: &[u8]) -> Mesh {
        load(bytes).unwrap().scene.meshes.remove(0)
    }
    fn code(bytes: &[u8]) -> &'static str {
        load(bytes).map_or_else(|e| e.code, |_| "loaded")
    }
    fn text(vertex: &str, face: &str, body: &str) -> Vec<u8> {
        let [v, f] = [vertex, face].map(|p| p.split(',').map(|p| format!("property {p}\n")).collect::<String>());
        let faces = body.lines().count() - 3;
        format!("ply\nformat ascii 1.0\ncomment x\nelement vertex 3\n{v}element face {faces}\n{f}end_header\n{body}")
            .into_bytes()
    }
    /// The triangle with `uchar int` faces.
    fn binary(big: bool, faces: &[&[i32]]) -> Vec<u8> {
        let order = if big { "big" } else { "little" };
        let mut out = format!(
            "ply\nformat binary_{order}_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
             property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
            faces.len()
        )
        .into_bytes();
        for v in TRIANGLE.as_flattened() {
            out.extend(if big { v.to_be_bytes() } else { v.to_le_bytes() });
        }
        for face in faces {
            out.push(face.len() as u8);
            face.iter().for_each(|v| out.extend(if big { v.to_be_bytes() } else { v.to_le_bytes() }));
        }
        out
    }

    #[test]
    fn both_byte_orders_and_text_give_the_same_mesh() {
        let want = mesh(&binary(false, &[&[0, 1, 2]]));
        assert_eq!((&want.positions[..], &want.corners[..]), (&TRIANGLE[..], &[0, 1, 2][..]));
        assert!(want.polygons.is_none());
        assert_eq!(mesh(&binary(true, &[&[0, 1, 2]])), want);
        let list = "list uchar int vertex_index";
        assert_eq!(mesh(&text("float x,float y,double z", list, "0 0 0\n1 0 0\n0 1 .5\n3 0 1 2")), want);
        // Line ends of Windows.
        let windows = String::from_utf8(text("float x,float y,float z", list, "0 0 0\n1 0 0\n0 1 .5\n3 0 1 2"));
        assert_eq!(mesh(windows.unwrap().replace('\n', "\r\n").as_bytes()), want);
    }

    #[test]
    fn polygons_are_kept_and_short_faces_left_out() {
        let Loaded { scene, findings } = load(&binary(false, &[&[0, 1, 2, 0], &[0, 1], &[2, 1, 0]])).unwrap();
        let mesh = &scene.meshes[0];
        assert_eq!(mesh.corners, [0, 1, 2, 0, 2, 1, 0]);
        assert_eq!(mesh.polygons.as_ref().unwrap().starts, [0, 4, 7]);
        assert_eq!(findings[0].code, "ply.face-short");
    }

    #[test]
    fn attributes_in_any_order_and_type() {
        let vertex = "uchar red,float s,float z,uchar green,short ignored,float y,float t,list int int also,float x,\
                      uchar blue,double nx,float ny,float nz,uchar alpha";
        let face = "uchar flags,list uchar uint vertex_indices,list uchar float other";
        let row = "255 0.25 3 0 -7 2 0.75 2 5 6 1 128 0 0 1 51\n";
        let mesh = mesh(&text(vertex, face, &format!("{row}{row}{row}9 3 0 1 2 1 0.5")));
        assert_eq!(mesh.positions[1], [1.0, 2.0, 3.0]);
        assert_eq!(mesh.normals.unwrap().values[1], [0.0, 0.0, 1.0]);
        assert_eq!(mesh.uv[0].as_ref().unwrap().values[2], [0.25, 0.25]);
        let [r, g, b, a] = mesh.colors.unwrap().values[0];
        assert_eq!((r, g, a), (1.0, 0.0, 0.2));
        // IEC 61966-2-1: 128/255 is 0.2158605 of linear light; seven digits are given.
        assert!((b - 0.215_860_5).abs() < 1e-7, "{b}");
    }

    #[test]
    fn float_colours_are_linear_and_wedge_coordinates_belong_to_corners() {
        let vertex = "float x,float y,float z,float red,float green,float blue";
        let face = "list uchar int vertex_indices,list uchar float texcoord";
        let rows = "0 0 0 .5 0 0\n1 0 0 .5 0 0\n0 1 0 .5 0 0\n";
        let mesh = mesh(&text(vertex, face, &format!("{rows}3 0 1 2 6 0 0 1 0 0 1\n3 2 1 0 0")));
        assert_eq!(mesh.colors.as_ref().unwrap().values[0], [0.5, 0.0, 0.0, 1.0]);
        let uv = mesh.uv[0].as_ref().unwrap();
        assert_eq!((uv.at(&mesh, 1), uv.at(&mesh, 2), uv.at(&mesh, 3)), ([1.0, 1.0], [0.0, 0.0], [0.0, 1.0]));
    }

    #[test]
    fn broken_files_are_errors() {
        let good = binary(false, &[&[0, 1, 2]]);
        assert_eq!(code(&good[..good.len() - 1]), "ply.truncated");
        assert_eq!(code(&binary(true, &[&[0, 1, 3]])), "ply.index-out-of-range");
        assert_eq!(code(&binary(false, &[&[0, 1, -1], &[0, 1]])), "ply.index-out-of-range");
        let xyz = "float x,float y,float z";
        let list = "list uchar int vertex_indices";
        assert_eq!(code(&text(xyz, list, "0 0 0\n1 0 nan\n0 1 0\n3 0 1 2")), "mesh.not-finite");
        assert_eq!(code(&text(xyz, list, "0 0 0\n1 0 x\n0 1 0\n3 0 1 2")), "ply.number");
        assert_eq!(code(&text(xyz, list, "0 0 0\n1 0 0\n0 1 0\n-3 0 1 2")), "ply.list");
        assert_eq!(code(&text(xyz, list, "0 0 0\n1 0 0\n0 1 0\n3 0 1 0.5")), "ply.index-out-of-range");
        assert_eq!(code(&text("float x,float y", list, "0 0\n1 0\n0 1\n3 0 1 2")), "ply.no-position");
        assert_eq!(code(&text(xyz, "int a", "0 0 0\n1 0 0\n0 1 0\n3")), "ply.no-indices");
        assert_eq!(code(b"ply\n"), "ply.header");
        assert_eq!(code(b"plx\n"), "ply.header");
        let huge = "ply\nformat binary_little_endian 1.0\nelement vertex 18446744073709551615\nproperty float x\n\
                    property float y\nproperty float z\nend_header\n";
        assert_eq!(code(huge.as_bytes()), "ply.truncated");
        let points = "ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nproperty int y\nproperty int z\nend_header\n1 2 3\n";
        let error = load(points.as_bytes()).unwrap_err();
        assert_eq!(error.code, "mesh.empty");
        assert!(error.message.contains("points but no faces"), "{}", error.message);
    }
}
