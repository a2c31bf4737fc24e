//! STL, binary and text (3D Systems, 1989). Facet normals are left out: they say no more than the corners do.
//! The material is a light grey Blinn-Phong, shown from both sides.

use super::files::Blob;
use super::text::{Cursor, float, line_of, text};
use super::{Context, Findings, Materials, mtl};
use crate::error::{Error, Finding, Result};
use crate::math::vec::Mat4;
use crate::mesh::Mesh;
use crate::scene::{Object, Scene};
use rayon::prelude::*;

/// Header of 80 bytes and a count of triangles of 50 bytes each.
const HEADER: u64 = 84;
const FACET: u64 = 50;

/// Whether a file of `len` bytes that begins with `head` has just the length that its count of triangles asks for.
pub(super) fn length_fits(head: &[u8], len: u64) -> bool {
    head.get(80..84).is_some_and(|count| {
        let count = u32::from_le_bytes(count.try_into().unwrap_or_default());
        len == HEADER + FACET * u64::from(count)
    })
}

/// Whether a file of `len` bytes that begins with `head` is binary. "solid" at the beginning proves nothing: many
/// programs write it into binary headers. The count does, and so do bytes that no text has.
pub(super) fn is_binary(head: &[u8], len: u64) -> bool {
    if length_fits(head, len) {
        return true;
    }
    if !head.trim_ascii_start().starts_with(b"solid") {
        return len >= HEADER;
    }
    // A binary file whose length does not fit: zeros and the like in what would be text.
    head.iter().take(512).any(|&b| b < 9)
}

/// Reads a file.
pub(super) fn read(blob: &Blob<'_>, context: &Context<'_>, findings: &mut Findings) -> Result<Scene> {
    let mut kept = None;
    let bytes = blob.bytes(context.job, &mut kept)?;
    let binary = is_binary(bytes, bytes.len() as u64);
    let (name, positions) =
        if binary { (String::new(), facets(bytes, context, findings)?) } else { solids(bytes, context, findings)? };
    if positions.len() > u32::MAX as usize - 2 {
        return Err(Error::input("stl.too-large", "the STL file has over 2^32 corners"));
    }
    context.reserve(4 * positions.len() as u64, "vertex indices")?;
    let corners = (0..positions.len() as u32).collect();
    Ok(scene(Mesh { name, positions, corners, ..Mesh::default() }, context))
}

/// A scene of one mesh in plain grey.
pub(super) fn scene(mesh: Mesh, context: &Context<'_>) -> Scene {
    let name = if mesh.name.is_empty() { context.stem() } else { mesh.name.clone() };
    let own = context.wanted == Materials::Own;
    Scene {
        objects: vec![Object {
            name,
            mesh: 0,
            transform: Mat4::IDENTITY,
            materials: if own { vec![0] } else { Vec::new() },
        }],
        materials: if own { vec![mtl::plain("")] } else { Vec::new() },
        meshes: vec![mesh],
        ..Scene::default()
    }
}

fn facets(bytes: &[u8], context: &Context<'_>, findings: &mut Findings) -> Result<Vec<[f32; 3]>> {
    let Some((header, body)) = bytes.split_at_checked(HEADER as usize) else {
        let message = format!("the STL file has {} bytes; its header alone takes {HEADER}", bytes.len());
        return Err(Error::input("stl.truncated", message).remedy("copy or download the file again"));
    };
    let said = u64::from(u32::from_le_bytes(header[80..84].try_into().unwrap_or_default()));
    let there = body.len() as u64 / FACET;
    if said > there {
        return Err(Error::input(
            "stl.truncated",
            format!("the STL header promises {said} triangles, there are {there}"),
        )
        .at("byte 80")
        .remedy("copy or download the file again"));
    }
    if bytes.len() as u64 > HEADER + FACET * said {
        let extra = bytes.len() as u64 - HEADER - FACET * said;
        let message = format!("{extra} bytes follow after the last triangle of the STL file");
        findings.push(Finding::note("stl.trailing", message, "they were ignored"));
    }
    context.reserve(36 * said, "vertex positions")?;
    let mut positions = vec![[0.0f32; 3]; 3 * said as usize];
    let body = &bytes[HEADER as usize..][..(FACET * said) as usize];
    let bad = positions
        .par_chunks_mut(3)
        .zip(body.par_chunks(FACET as usize))
        .with_min_len(4096)
        .enumerate()
        .map(|(k, (out, facet))| {
            for (c, out) in out.iter_mut().enumerate() {
                let number = |a| {
                    let at = 12 + 12 * c + 4 * a;
                    f32::from_le_bytes([facet[at], facet[at + 1], facet[at + 2], facet[at + 3]])
                };
                *out = core::array::from_fn(number);
            }
            if out.iter().flatten().all(|v| v.is_finite()) { usize::MAX } else { k }
        })
        .reduce(|| usize::MAX, usize::min);
    if bad != usize::MAX {
        return Err(Error::input("mesh.not-finite", format!("a corner of triangle {bad} is not finite"))
            .at(format!("byte {}", HEADER + FACET * bad as u64)));
    }
    Ok(positions)
}

fn solids(bytes: &[u8], context: &Context<'_>, findings: &mut Findings) -> Result<(String, Vec<[f32; 3]>)> {
    // A vertex takes at least "vertex 0 0 0" and a line end.
    context.reserve(bytes.len() as u64 / 13 * 24, "vertex positions")?;
    let mut positions: Vec<[f32; 3]> = Vec::new();
    let (mut name, mut outer) = (None, 0usize);
    let mut c = Cursor::new(bytes);
    let place = |at: usize| format!("line {}", line_of(bytes, at));
    while !c.is_done() {
        c.skip_space();
        let at = c.at;
        let word = c.word();
        if word.eq_ignore_ascii_case(b"vertex") {
            let mut p = [0.0; 3];
            for v in &mut p {
                c.skip_space();
                let word = c.word();
                *v = float(word).ok_or_else(|| {
                    let word = text(&word[..word.len().min(40)]);
                    Error::input("stl.number", format!("{word:?} is no coordinate of an STL vertex")).at(place(at))
                })?;
            }
            if !p.iter().all(|v| v.is_finite()) {
                let message = format!("vertex {} is not finite", positions.len());
                return Err(Error::input("mesh.not-finite", message).at(place(at)));
            }
            positions.push(p);
        } else if [&b"outer"[..], b"endloop", b"endfacet"].iter().any(|w| word.eq_ignore_ascii_case(w)) {
            // A facet whose end is missing ends where the next begins.
            let n = positions.len() - outer;
            if n > 3 {
                // Not allowed, but written by some: a fan.
                let face = positions.split_off(outer);
                context.reserve(36 * (n as u64 - 2), "vertex positions")?;
                positions.extend((1..n - 1).flat_map(|k| [face[0], face[k], face[k + 1]]));
            } else if n == 1 || n == 2 {
                findings.push(
                    Finding::warning("stl.face-short", "a facet has fewer than three corners", "it was left out")
                        .at(place(at)),
                );
                positions.truncate(outer);
            }
            outer = positions.len();
        } else if word.eq_ignore_ascii_case(b"solid") {
            let rest = c.rest();
            name.get_or_insert_with(|| text(&rest[..rest.len().min(200)]));
            context.job.check()?;
        }
    }
    if positions.len() > outer {
        findings.push(Finding::warning("stl.truncated", "the last facet has no end", "it was left out"));
        positions.truncate(outer);
    }
    Ok((name.unwrap_or_default(), positions))
}

#[cfg(test)]
mod tests {
    use crate::load::{LoadOptions, Loaded, load_bytes};

    fn binary(header: &str, facets: &[[f32; 9]]) -> Vec<u8> {
        let mut out = header.as_bytes().to_vec();
        out.resize(80, b' ');
        out.extend((facets.len() as u32).to_le_bytes());
        for f in facets {
            out.extend([0; 12]);
            f.iter().for_each(|v| out.extend(v.to_le_bytes()));
            out.extend([0; 2]);
        }
        out
    }
    fn read(bytes: &[u8]) -> crate::Result<Loaded> {
        load_bytes("stl", bytes, &LoadOptions::default())
    }

    #[test]
    fn binary_and_text_are_told_apart_even_with_solid_in_a_binary_header() {
        let facet = [0., 0., 0., 1., 0., 0., 0., 1., 0.5];
        for header in ["", "solid of steel"] {
            let Loaded { scene, findings } = read(&binary(header, &[facet; 2])).unwrap();
            assert!(findings.is_empty());
            assert_eq!(scene.meshes[0].positions.len(), 6);
            assert_eq!(scene.meshes[0].positions[5], [0.0, 1.0, 0.5]);
            assert_eq!(scene.meshes[0].corners, [0, 1, 2, 3, 4, 5]);
            assert!(scene.meshes[0].normals.is_none() && scene.materials[0].double_sided);
        }
        let text = "solid a cube\r\n facet normal 0 0 1\n outer loop\n vertex 0 0 0\n vertex 1e0 0 0\n VERTEX 0 1 -.5\n\
                    endloop\nendfacet\nendsolid a cube\n";
        let scene = read(text.as_bytes()).unwrap().scene;
        assert_eq!((scene.meshes[0].positions[2], &scene.objects[0].name[..]), ([0.0, 1.0, -0.5], "a cube"));
    }

    #[test]
    fn broken_files_say_where() {
        let facet = [0., 0., 0., 1., 0., 0., 0., 1., 0.5];
        let good = binary("", &[facet; 3]);
        let code = |bytes: &[u8]| read(bytes).map_or_else(|e| e.code, |_| "loaded");
        assert_eq!(code(&good[..good.len() - 1]), "stl.truncated");
        let missing_end = "solid\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 1\nendloop";
        let loaded = read(missing_end.as_bytes()).unwrap();
        assert_eq!((loaded.scene.meshes[0].positions.len(), loaded.findings[0].code), (3, "stl.face-short"));
        let mut bad = facet;
        bad[4] = f32::NAN;
        let error = read(&binary("", &[facet, bad])).unwrap_err();
        assert_eq!((error.code, error.place.as_deref()), ("mesh.not-finite", Some("byte 134")));
        let error = read(b"solid\nouter loop\nvertex 0 0 0\nvertex 0 x 0\n").unwrap_err();
        assert_eq!((error.code, error.place.as_deref()), ("stl.number", Some("line 4")));
        assert_eq!(code(b"solid\nendsolid\n"), "mesh.empty");
        let mut long = good.clone();
        long.push(0);
        assert_eq!(read(&long).unwrap().findings[0].code, "stl.trailing");
    }
}
