//! glTF 2.0 and GLB (Khronos glTF 2.0 specification, 2021), with own structures for its JSON: they cost less
//! memory than a general document and every index in them is checked where it is used.

mod accessor;
mod geometry;
mod json;
mod material;
mod node;

use super::files::{self, Blob};
use super::{Context, Findings, Materials};
use crate::error::{Error, Finding, Result};
use crate::scene::Scene;
use accessor::Data;
use json::Document;

/// Extensions that are honoured, so that a file may require them.
const HONOURED: [&str; 8] = [
    "KHR_lights_punctual",
    "KHR_texture_transform",
    "KHR_materials_unlit",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_mesh_quantization",
    "EXT_texture_webp",
];

/// What to do about extensions that are not.
fn remedy(extension: &str) -> &'static str {
    match extension {
        "KHR_draco_mesh_compression" => "export without Draco compression, or run `gltf-transform copy IN OUT`",
        "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
            "export without meshopt compression, or run `gltf-transform copy IN OUT`"
        }
        "KHR_texture_basisu" => "export with PNG, JPEG or WebP textures, or convert the KTX2 files to PNG",
        _ => "export the model without this extension",
    }
}

/// Reads a binary container (4.4).
pub(super) fn read_glb(blob: &Blob<'_>, context: &Context<'_>, findings: &mut Findings) -> Result<Scene> {
    let mut header = [0; 12];
    blob.read_at(0, &mut header)?;
    let [magic, version, len] = words(header);
    if magic != u32::from_le_bytes(*b"glTF") {
        return Err(Error::input("glb.magic", "the file does not begin with \"glTF\"").at("byte 0"));
    }
    if version != 2 {
        return Err(Error::input("gltf.version", format!("the container has version {version}; 2 is readable"))
            .at("byte 4")
            .remedy("export as glTF 2.0"));
    }
    let len = u64::from(len);
    if len > blob.len() {
        let message = format!("the header promises {len} bytes, the file has {}", blob.len());
        return Err(Error::input("glb.truncated", message).at("byte 8").remedy("copy or download the file again"));
    }
    if len < blob.len() {
        findings.push(Finding::note(
            "glb.trailing",
            format!("{} bytes follow after the end of the container", blob.len() - len),
            "they were ignored",
        ));
    }
    let (mut text, mut binary) = (None, None);
    let mut at = 12;
    while at + 8 <= len {
        let mut header = [0; 8];
        blob.read_at(at, &mut header)?;
        let [size, kind] = words(header);
        let chunk = (at + 8 + u64::from(size) <= len).then(|| blob.slice(at + 8, u64::from(size))).flatten();
        let chunk = chunk.ok_or_else(|| {
            Error::input("glb.chunk", format!("the chunk of {size} bytes passes the end of the container"))
                .at(format!("byte {at}"))
        })?;
        match &kind.to_le_bytes() {
            b"JSON" if text.is_none() => text = Some(chunk),
            b"BIN\0" if binary.is_none() => binary = Some(chunk),
            _ => {}
        }
        at += 8 + u64::from(size);
    }
    let text = text.ok_or_else(|| Error::input("glb.no-json", "the container has no JSON chunk"))?;
    read_document(&text, binary, context, findings)
}

fn words<const N: usize, const M: usize>(bytes: [u8; M]) -> [u32; N] {
    core::array::from_fn(|k| u32::from_le_bytes(core::array::from_fn(|b| bytes[4 * k + b])))
}

/// Reads a JSON document whose buffers lie in other files or in data URIs.
pub(super) fn read_gltf(blob: &Blob<'_>, context: &Context<'_>, findings: &mut Findings) -> Result<Scene> {
    read_document(blob, None, context, findings)
}

fn read_document(
    text: &Blob<'_>,
    binary: Option<Blob<'_>>,
    context: &Context<'_>,
    findings: &mut Findings,
) -> Result<Scene> {
    let mut kept = None;
    let text = text.bytes(context.job, &mut kept)?;
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    context.reserve(json::bytes_in_memory(text), "the JSON document")?;
    let document: Document = serde_json::from_slice(text).map_err(|e| {
        let message = e.to_string();
        let message = message.split(" at line ").next().unwrap_or_default();
        Error::input("gltf.json", format!("the JSON is not that of a glTF 2.0 file: {message:.300}")).at(format!(
            "line {}, column {}",
            e.line(),
            e.column()
        ))
    })?;
    drop(kept);
    check_version(&document)?;
    check_extensions(&document, findings)?;
    for (what, is) in [("skins", !document.skins.is_empty()), ("animations", !document.animations.is_empty())] {
        if is {
            let (code, action) = if what == "skins" {
                ("gltf.skin-ignored", "meshes are shown undeformed, in their bind pose")
            } else {
                ("gltf.animation-ignored", "nodes are shown where they stand")
            };
            findings.push(Finding::note(code, format!("the file has {what}"), action).at(format!("/{what}")));
        }
    }
    let buffers = buffers(&document, binary, context)?;
    let data = Data { document: &document, buffers, context };

    let mut scene = Scene::default();
    let layout = node::walk(&data, &mut scene, findings)?;
    let geometry = geometry::Plan::new(&data, &layout, findings)?;
    let materials = match context.wanted {
        Materials::Own => material::Plan::new(&data, &geometry, findings)?,
        Materials::Replaced => material::Plan::default(),
    };
    // Pictures take as long as geometry, and neither needs the other.
    let (meshes, images) = rayon::join(|| geometry.read(&data), || materials.decode(&data));
    let (meshes, mesh_findings) = meshes?;
    findings.extend(mesh_findings);
    scene.meshes = meshes;
    materials.finish(images?, &mut scene, findings);
    let names = |node: u32| document.nodes[node as usize].name.as_deref().unwrap_or_default();
    geometry.place(&layout, &mut scene, context, &names)?;
    node::aim(&mut scene);
    Ok(scene)
}

fn check_version(document: &Document) -> Result<()> {
    let major = |v: &str| v.split('.').next().and_then(|v| v.parse::<u32>().ok());
    let version = &document.asset.version;
    let least = document.asset.min_version.as_deref();
    if major(version) == Some(2) && least.is_none_or(|v| v == "2.0") {
        return Ok(());
    }
    let version = least.unwrap_or(version);
    Err(Error::input("gltf.version", format!("the document needs glTF {version:.20?}; 2.0 is readable"))
        .at("/asset/version")
        .remedy("export as glTF 2.0"))
}

fn check_extensions(document: &Document, findings: &mut Findings) -> Result<()> {
    for (k, name) in document.extensions_required.iter().enumerate() {
        if !HONOURED.contains(&&name[..]) {
            return Err(Error::input(
                "gltf.extension-required",
                format!("the model cannot be read without the extension {name:.60}, which is not supported"),
            )
            .at(format!("/extensionsRequired/{k}"))
            .remedy(remedy(name)));
        }
    }
    for (k, name) in document.extensions_used.iter().enumerate() {
        if !HONOURED.contains(&&name[..]) {
            findings.push(
                Finding::warning(
                    "gltf.extension-ignored",
                    format!("the extension {name:.60} is not supported"),
                    "what it says was left out",
                )
                .at(format!("/extensionsUsed/{k}")),
            );
        }
    }
    Ok(())
}

/// Opens or decodes every buffer, and proves that each is as long as it should be.
fn buffers<'a>(document: &Document, binary: Option<Blob<'a>>, context: &Context<'_>) -> Result<Vec<Blob<'a>>> {
    let open = |(k, buffer): (usize, &json::Buffer)| -> Result<Blob<'a>> {
        let blob = match &buffer.uri {
            None if k == 0 => binary.clone().ok_or_else(|| {
                Error::input("gltf.buffer-missing", "the buffer has no address, and there is no binary chunk")
            })?,
            None => return Err(Error::input("gltf.buffer-missing", "the buffer has no address")),
            Some(uri) if uri.starts_with("data:") => Blob::from(data_uri(uri, context)?),
            Some(uri) => context.root.open(&file_uri(uri)?, files::LIMIT)?,
        };
        blob.slice(0, buffer.byte_length).ok_or_else(|| {
            let message = format!("the buffer should have {} bytes and has {}", buffer.byte_length, blob.len());
            Error::input("gltf.buffer-truncated", message).remedy("copy or download the file again")
        })
    };
    document.buffers.iter().enumerate().map(|b| open(b).map_err(|e| e.at(format!("/buffers/{}", b.0)))).collect()
}

/// The relative path that an address of a glTF file means.
fn file_uri(uri: &str) -> Result<String> {
    files::percent_decoded(uri)
        .ok_or_else(|| Error::input("gltf.uri", "the address is no UTF-8 once its percent signs are decoded"))
}

/// The bytes of `data:[<type>];base64,...` (RFC 2397, RFC 4648).
fn data_uri(uri: &str, context: &Context<'_>) -> Result<Vec<u8>> {
    let bad = |message: &str| Error::input("gltf.data-uri", message);
    let (head, body) = uri.split_once(',').ok_or_else(|| bad("the data URI has no comma"))?;
    if !head.ends_with(";base64") {
        return Err(bad("the data URI is not in base64"));
    }
    let body = body.trim_end_matches('=').as_bytes();
    context.reserve(body.len() as u64 / 4 * 3 + 3, "an embedded buffer or picture")?;
    let mut out = Vec::with_capacity(body.len() / 4 * 3 + 3);
    for group in body.chunks(4) {
        let mut word = 0u32;
        for &c in group {
            let six = match c {
                b'A'..=b'Z' => c - b'A',
                b'a'..=b'z' => c - b'a' + 26,
                b'0'..=b'9' => c - b'0' + 52,
                b'+' | b'-' => 62,
                b'/' | b'_' => 63,
                _ => return Err(bad("the data URI is not in base64")),
            };
            word = word << 6 | u32::from(six);
        }
        match group.len() {
            4 => out.extend_from_slice(&word.to_be_bytes()[1..]),
            3 => out.extend_from_slice(&(word << 6).to_be_bytes()[1..3]),
            2 => out.push((word >> 4) as u8),
            _ => return Err(bad("the base64 data end in the middle of a byte")),
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests;
