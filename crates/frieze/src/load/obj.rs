//! OBJ (Wavefront, "Advanced Visualizer", appendix B1): polygons with their own indices for positions, texture
//! coordinates and normals. v runs down here, so it is flipped. Free-form curves, lines and points are left out.
//!
//! A file with several `o` becomes one mesh per object, in the file's order; a file with none or one keeps every
//! vertex in one mesh. Where a file has normals for some faces only, the others get the face's own normal; where
//! it has none but smoothing groups (`s`), normals are averaged within the groups, weighted by area.
//! Vertex colours (three or four more numbers after `v`) are linear.

mod lines;

use super::files::Blob;
use super::mtl::{self, Description};
use super::triangulate::polygons;
use super::{Context, Findings, Materials};
use crate::error::{Error, Finding, Result};
use crate::math::vec::{Mat4, Vec3};
use crate::mesh::{Attribute, Mesh};
use crate::scene::{Object, Scene};
use lines::{Event, NONE, Piece};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// A whole file, merged.
#[derive(Default)]
struct File {
    all: Piece,
    /// Material of each face, index into `names`; empty when there is none.
    materials: Vec<u32>,
    names: Vec<String>,
    /// Smoothing group of each face; empty when the file says nothing.
    smooth: Vec<u32>,
    /// Name of each object and its first face.
    objects: Vec<(String, u32)>,
    files: Vec<String>,
    group: String,
}

/// Reads a file.
pub(super) fn read(blob: &Blob<'_>, context: &Context<'_>, findings: &mut Findings) -> Result<Scene> {
    let mut kept = None;
    let bytes = blob.bytes(context.job, &mut kept)?;
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut file = merge(bytes, context, findings)?;
    let mut scene = Scene::default();
    let spans = spans(&mut file, context);
    let several = spans.len() > 1;
    let mut renumbered = several.then(|| Renumbered::new(&file));
    let mut used: Vec<(usize, Vec<u32>)> = Vec::new();
    let mut first_corner = 0;
    for (name, faces) in spans {
        context.job.check()?;
        let corners = file.all.sizes[faces.clone()].iter().map(|&s| s as usize).sum::<usize>();
        let corners = first_corner..first_corner + corners;
        first_corner = corners.end;
        let mut part = Part {
            sizes: if several { file.all.sizes[faces.clone()].to_vec() } else { std::mem::take(&mut file.all.sizes) },
            ..Part::default()
        };
        match &mut renumbered {
            Some(renumbered) => renumbered.take(&file, corners, &mut part, context)?,
            None => {
                part.corners = std::mem::take(&mut file.all.corners);
                part.positions = std::mem::take(&mut file.all.positions);
                part.colors = std::mem::take(&mut file.all.colors);
                part.uv = std::mem::take(&mut file.all.uv);
                part.normals = std::mem::take(&mut file.all.normals);
            }
        }
        let smooth = if file.smooth.is_empty() { &[][..] } else { &file.smooth[faces.clone()] };
        let mut mesh = part.mesh(name.clone(), smooth, context, findings)?;
        let mut slots = Vec::new();
        if file.materials.is_empty() {
            slots.push(NONE);
        } else {
            // Slots in the order of their first face.
            let mut slot_of: BTreeMap<u32, u32> = BTreeMap::new();
            mesh.materials = file.materials[faces]
                .iter()
                .map(|&m| {
                    *slot_of.entry(m).or_insert_with(|| {
                        slots.push(m);
                        slots.len() as u32 - 1
                    })
                })
                .collect();
            if slots.len() < 2 {
                mesh.materials = Vec::new();
            }
        }
        used.push((scene.meshes.len(), slots));
        let object = Object { name, mesh: scene.meshes.len(), transform: Mat4::IDENTITY, materials: Vec::new() };
        scene.objects.push(object);
        scene.meshes.push(mesh);
    }
    if context.wanted == Materials::Own {
        materials(&file, &used, &mut scene, context, findings)?;
    }
    Ok(scene)
}

/// Reads all pieces in parallel and joins them in order.
fn merge(bytes: &[u8], context: &Context<'_>, findings: &mut Findings) -> Result<File> {
    let pieces = lines::pieces(bytes);
    let read = |piece: &&[u8]| {
        context.job.check()?;
        let read = lines::read(piece)?;
        // Pieces are small; so asking after reading one exceeds the budget by little.
        let held = context.job.reserve(read.bytes(), "the model")?;
        Ok((read, held))
    };
    let all: Vec<Result<_>> = pieces.par_iter().map(read).collect();
    let mut line = 0;
    let mut done = Vec::with_capacity(all.len());
    for (piece, one) in pieces.iter().zip(all) {
        let one = one.map_err(|mut e| {
            if let Some(within) = e.place.as_ref().and_then(|p| p.parse::<usize>().ok()) {
                e.place = Some(format!("line {}", line + within));
            }
            e
        })?;
        done.push((one.0, one.1, line));
        line += piece.iter().filter(|&&b| b == b'\n').count();
    }
    let total = |f: &dyn Fn(&Piece) -> usize| done.iter().map(|d| f(&d.0)).sum::<usize>();
    let counts = [total(&|p| p.positions.len()), total(&|p| p.uv.len()), total(&|p| p.normals.len())];
    let (corners, faces) = (total(&|p| p.corners[0].len()), total(&|p| p.sizes.len()));
    if counts.iter().any(|&c| c >= NONE as usize) || corners >= NONE as usize {
        return Err(Error::input("obj.too-large", "over 2^32 vertices or corners"));
    }
    let colored = done.iter().any(|d| !d.0.colors.is_empty());
    let bytes_of =
        counts[0] * if colored { 28 } else { 12 } + counts[1] * 8 + counts[2] * 12 + corners * 12 + faces * 4;
    context.reserve(bytes_of as u64, "the model")?;

    let mut file = File::default();
    let a = &mut file.all;
    a.positions.reserve_exact(counts[0]);
    a.uv.reserve_exact(counts[1]);
    a.normals.reserve_exact(counts[2]);
    a.corners.iter_mut().for_each(|c| c.reserve_exact(corners));
    a.sizes.reserve_exact(faces);
    let mut material = None;
    let mut smooth = None;
    let mut known: BTreeMap<String, u32> = BTreeMap::new();
    let mut short = 0;
    let mut lost = [0u64; 3];
    for (k, (mut piece, _held, line)) in done.into_iter().enumerate() {
        let a = &mut file.all;
        let before = [a.positions.len(), a.uv.len(), a.normals.len()];
        for &(corner, which, relative) in &piece.relative {
            let value = relative + before[usize::from(which)] as i64;
            piece.corners[usize::from(which)][corner as usize] = u32::try_from(value).unwrap_or(NONE - 1).min(NONE - 1);
        }
        let wrong = piece.corners[0].iter().position(|&v| v as usize >= counts[0]);
        if let Some(at) = wrong {
            let mut end = 0;
            let face = piece.sizes.iter().position(|&s| {
                end += s as usize;
                at < end
            });
            let message =
                format!("the face has index {}, but there are {} vertices", piece.corners[0][at] + 1, counts[0]);
            let place = format!("line {}", line + lines::line_of_face(pieces[k], face.unwrap_or_default()));
            return Err(Error::input("obj.index-out-of-range", message).at(place));
        }
        for which in 1..3 {
            for v in &mut piece.corners[which] {
                if *v != NONE && *v as usize >= counts[which] {
                    *v = NONE;
                    lost[which] += 1;
                }
            }
        }
        short += u64::from(piece.short);
        let first_face = a.sizes.len() as u32;
        if colored {
            a.colors.extend_from_slice(&piece.colors);
            a.colors.resize(before[0] + piece.positions.len(), [1.0; 4]);
        }
        a.positions.extend_from_slice(&piece.positions);
        a.uv.extend_from_slice(&piece.uv);
        a.normals.extend_from_slice(&piece.normals);
        for (to, from) in a.corners.iter_mut().zip(&piece.corners) {
            to.extend_from_slice(from);
        }
        a.sizes.extend_from_slice(&piece.sizes);
        for (at, event) in piece.events {
            let face = (first_face + at) as usize;
            match event {
                Event::Object(name) => file.objects.push((name, face as u32)),
                Event::Group(name) => file.group = name,
                Event::MaterialFiles(names) => {
                    if file.files.len() < 64 && !file.files.contains(&names) {
                        file.files.push(names);
                    }
                }
                Event::UseMaterial(name) => {
                    fill(&mut file.materials, face, material, NONE);
                    let names = &mut file.names;
                    let index = *known.entry(name).or_insert_with_key(|name| {
                        names.push(name.clone());
                        names.len() as u32 - 1
                    });
                    material = Some(index);
                }
                Event::Smooth(group) => {
                    fill(&mut file.smooth, face, smooth, 1);
                    smooth = Some(group);
                }
                Event::Ignored(word, at) => {
                    let (what, code) = match &word[..] {
                        "l" | "p" => ("lines and points are not rendered".to_owned(), "obj.lines-ignored"),
                        _ => (format!("the statement {word:?} is not supported"), "obj.ignored"),
                    };
                    findings.push(Finding::note(code, what, "left out").at(format!("line {}", line + at)));
                }
            }
        }
    }
    let faces = file.all.sizes.len();
    if material.is_some() {
        fill(&mut file.materials, faces, material, NONE);
    }
    if smooth.is_some() {
        fill(&mut file.smooth, faces, smooth, 1);
    }
    if short > 0 {
        let message = format!("{short} faces have fewer than three corners");
        findings.push(Finding::warning("obj.face-short", message, "they were left out"));
    }
    for (which, name) in [(1, "texture coordinates (vt)"), (2, "normals (vn)")] {
        if lost[which] > 0 {
            let message = format!("{} corners ask for {name} that do not exist", lost[which]);
            findings.push(Finding::warning("obj.attribute-index", message, "taken as if they had none"));
        }
    }
    Ok(file)
}

/// Fills a list per face up to `face` with the value that held so far, if one ever did: until the first
/// statement the list stays empty, and `before` is what faces before it have.
fn fill(list: &mut Vec<u32>, face: usize, value: Option<u32>, before: u32) {
    list.resize(face, value.unwrap_or(before));
}

/// The objects of the file as ranges of faces; a single one when it has no more than one `o`.
fn spans(file: &mut File, context: &Context<'_>) -> Vec<(String, std::ops::Range<usize>)> {
    let faces = file.all.sizes.len();
    let mut objects = std::mem::take(&mut file.objects);
    if objects.first().is_none_or(|o| o.1 > 0) {
        let name = if objects.is_empty() { file.group.clone() } else { String::new() };
        objects.insert(0, (name, 0));
    }
    let ends: Vec<usize> = objects.iter().skip(1).map(|o| o.1 as usize).chain([faces]).collect();
    let mut spans: Vec<_> =
        objects.into_iter().zip(ends).map(|((name, begin), end)| (name, begin as usize..end)).collect();
    spans.retain(|s| !s.1.is_empty());
    for span in &mut spans {
        if span.0.is_empty() {
            span.0 = context.stem();
        }
    }
    spans
}

/// The indexed data of one object.
#[derive(Default)]
struct Part {
    positions: Vec<[f32; 3]>,
    colors: Vec<[f32; 4]>,
    uv: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    corners: [Vec<u32>; 3],
    sizes: Vec<u32>,
}

/// Gives each object its own vertices, in the file's order. One table for all objects: a file of many objects
/// costs no more than one of few.
struct Renumbered {
    tables: [Vec<u32>; 3],
}

impl Renumbered {
    fn new(file: &File) -> Self {
        let a = &file.all;
        Renumbered { tables: [a.positions.len(), a.uv.len(), a.normals.len()].map(|n| vec![0; n]) }
    }
    fn take(
        &mut self,
        file: &File,
        corners: std::ops::Range<usize>,
        part: &mut Part,
        context: &Context<'_>,
    ) -> Result<()> {
        context.reserve(corners.len() as u64 * 40, "an object")?;
        for which in 0..3 {
            let list = &file.all.corners[which][corners.clone()];
            let mut used: Vec<u32> = list.iter().copied().filter(|&v| v != NONE).collect();
            used.sort_unstable();
            used.dedup();
            let table = &mut self.tables[which];
            for (new, &old) in (0u32..).zip(&used) {
                table[old as usize] = new;
            }
            part.corners[which] = list.iter().map(|&v| if v == NONE { NONE } else { table[v as usize] }).collect();
            let used = used.iter().map(|&v| v as usize);
            match which {
                0 => {
                    part.positions = used.clone().map(|v| file.all.positions[v]).collect();
                    if !file.all.colors.is_empty() {
                        part.colors = used.map(|v| file.all.colors[v]).collect();
                    }
                }
                1 => part.uv = used.map(|v| file.all.uv[v]).collect(),
                _ => part.normals = used.map(|v| file.all.normals[v]).collect(),
            }
        }
        Ok(())
    }
}

impl Part {
    fn mesh(mut self, name: String, smooth: &[u32], context: &Context<'_>, findings: &mut Findings) -> Result<Mesh> {
        let [corners, uv, normals] = std::mem::take(&mut self.corners);
        let mut normals = attribute(std::mem::take(&mut self.normals), normals, &corners, self.positions.len());
        let mut uv = attribute(std::mem::take(&mut self.uv), uv, &corners, self.positions.len());
        let mut finding = |what: &str, count: usize, action: &str| {
            let message =
                format!("{count} corners of {:?} have no {what}, others do", name.chars().take(60).collect::<String>());
            findings.push(Finding::warning("obj.attribute-missing", message, action));
        };
        if let Some((list, missing)) = &mut uv {
            if *missing > 0 {
                finding("texture coordinates", *missing, "they were given (0, 0)");
                let zero = list.values.len() as u32;
                list.values.push([0.0; 2]);
                replace_none(list, |_| zero);
            }
            if list.values.iter().flatten().any(|v| !v.is_finite()) {
                finding("finite texture coordinates", 1, "such numbers were taken for 0");
                list.values.iter_mut().flatten().filter(|v| !v.is_finite()).for_each(|v| *v = 0.0);
            }
        }
        if let Some((list, missing)) = &mut normals {
            if *missing > 0 {
                finding("normals", *missing, "they were given the normal of their face");
                context.reserve(self.sizes.len() as u64 * 16, "normals")?;
                let first = list.values.len() as u32;
                let of_face = face_normals(&self.positions, &corners, &self.sizes);
                list.values.extend(of_face.iter().map(|n| n.normalize().array()));
                let face_of = faces_of_corners(&self.sizes);
                replace_none(list, |corner| first + face_of[corner]);
            }
            list.values.iter_mut().flatten().filter(|v| !v.is_finite()).for_each(|v| *v = 0.0);
        } else if smooth.iter().any(|&s| s != smooth[0]) || smooth.first() == Some(&0) {
            context.reserve(corners.len() as u64 * 40, "normals")?;
            normals = Some((smoothed(&self.positions, &corners, &self.sizes, smooth), 0));
        }
        let polygons = polygons(&self.positions, &corners, &self.sizes, context)?;
        Ok(Mesh {
            name,
            positions: self.positions,
            corners,
            polygons,
            normals: normals.map(|n| n.0),
            uv: [uv.map(|u| u.0), None],
            colors: (!self.colors.is_empty()).then(|| Attribute::per_position(self.colors)),
            tangents: None,
            materials: Vec::new(),
        })
    }
}

/// An attribute, unless no corner has it, and how many corners do not. Without an index of its own when that
/// equals the positions'.
fn attribute<T>(values: Vec<T>, index: Vec<u32>, corners: &[u32], positions: usize) -> Option<(Attribute<T>, usize)> {
    let missing = index.iter().filter(|&&v| v == NONE).count();
    if missing == index.len() {
        return None;
    }
    let same = values.len() == positions && index == corners;
    Some((Attribute { values, index: (!same).then_some(index) }, missing))
}

fn replace_none<T>(list: &mut Attribute<T>, with: impl Fn(usize) -> u32) {
    for (corner, v) in list.index.iter_mut().flatten().enumerate() {
        if *v == NONE {
            *v = with(corner);
        }
    }
}

/// Newell's normals: twice the area long.
fn face_normals(positions: &[[f32; 3]], corners: &[u32], sizes: &[u32]) -> Vec<Vec3> {
    let mut at = 0;
    let mut face = |&size: &u32| {
        let list = &corners[at..at + size as usize];
        at += size as usize;
        let p = |k: usize| Vec3::from(positions[list[k] as usize]);
        let origin = p(0);
        let fan = (1..list.len() - 1).map(|k| (p(k) - origin).cross(p(k + 1) - origin));
        let sum = fan.fold(Vec3::splat(0.0), |a, b| a + b);
        if sum.is_finite() { sum } else { Vec3::splat(0.0) }
    };
    sizes.iter().map(&mut face).collect()
}

fn faces_of_corners(sizes: &[u32]) -> Vec<u32> {
    (0u32..).zip(sizes).flat_map(|(f, &s)| std::iter::repeat_n(f, s as usize)).collect()
}

/// Normals from smoothing groups: corners of one position and one group share the sum of their faces' normals;
/// group 0 is flat.
fn smoothed(positions: &[[f32; 3]], corners: &[u32], sizes: &[u32], smooth: &[u32]) -> Attribute<[f32; 3]> {
    let of_face = face_normals(positions, corners, sizes);
    let face_of = faces_of_corners(sizes);
    // Sorted by position, group and (in group 0) face; ties keep the file's order.
    let key = |&c: &u32| {
        let face = face_of[c as usize];
        let group = smooth[face as usize];
        (corners[c as usize], group, if group == 0 { face } else { 0 })
    };
    let mut order: Vec<u32> = (0..corners.len() as u32).collect();
    order.par_sort_by_key(key);
    let mut index = vec![0; corners.len()];
    let mut values: Vec<Vec3> = Vec::new();
    for (k, c) in order.iter().enumerate() {
        if k == 0 || key(c) != key(&order[k - 1]) {
            values.push(Vec3::splat(0.0));
        }
        let last = values.len() - 1;
        values[last] = values[last] + of_face[face_of[*c as usize] as usize];
        index[*c as usize] = last as u32;
    }
    Attribute { values: values.into_iter().map(|n| n.normalize().array()).collect(), index: Some(index) }
}

/// Reads the material files and gives every object its materials.
fn materials(
    file: &File,
    used: &[(usize, Vec<u32>)],
    scene: &mut Scene,
    context: &Context<'_>,
    findings: &mut Findings,
) -> Result<()> {
    let mut known: BTreeMap<String, Description> = BTreeMap::new();
    for line in &file.files {
        // Several names, or one with spaces in it.
        let whole = context.root.read_or_beside(line, mtl::LIMIT, context.job).map(|r| vec![r]);
        let read = whole.or_else(|e| {
            let names: Vec<&str> = line.split_ascii_whitespace().take(64).collect();
            if names.len() < 2 || e.code == "job.memory" {
                return Err(e);
            }
            names.into_iter().map(|n| context.root.read_or_beside(n, mtl::LIMIT, context.job)).collect()
        });
        match read {
            Ok(list) => {
                for (bytes, finding) in list {
                    findings.extend(finding);
                    context.reserve(bytes.len() as u64 * 8, "materials")?;
                    let mut of_file = Findings::default();
                    for m in mtl::parse(&bytes, &mut of_file) {
                        known.entry(m.name().to_owned()).or_insert(m);
                    }
                    findings.extend(of_file.finish(&bytes.path));
                }
            }
            Err(e) if e.fault != crate::error::Fault::Input => return Err(e),
            Err(e) => findings.push(Finding::warning("mtl.missing", e.message, "its materials are shown grey")),
        }
    }
    let used_names: Vec<u32> = {
        let mut seen = vec![false; file.names.len()];
        let all = used.iter().flat_map(|u| &u.1).copied().filter(|&m| m != NONE);
        all.filter(|&m| !std::mem::replace(&mut seen[m as usize], true)).collect()
    };
    let mut place: BTreeMap<u32, usize> = BTreeMap::new();
    let mut wanted = Vec::new();
    for m in used_names {
        let name = &file.names[m as usize];
        match known.get(name) {
            Some(description) => {
                place.insert(m, wanted.len());
                wanted.push(description.clone());
            }
            None if file.files.is_empty() && known.is_empty() => {}
            None => findings.push(Finding::warning(
                "mtl.no-such-material",
                format!("there is no material {:?}", name.chars().take(60).collect::<String>()),
                "its faces are shown grey",
            )),
        }
    }
    context.reserve((file.names.len() * 1024) as u64, "materials")?;
    let diagonal = scene.bounds().map_or(0.0, |(lo, hi)| (hi - lo).length());
    let diagonal = if diagonal.is_finite() { diagonal } else { 0.0 };
    mtl::make(&wanted, diagonal, scene, context, findings)?;
    for (object, slots) in used {
        let of_slot = |&m: &u32| {
            *place.entry(m).or_insert_with(|| {
                let name = if m == NONE { "" } else { &file.names[m as usize] };
                scene.materials.push(mtl::plain(name));
                scene.materials.len() - 1
            })
        };
        scene.objects[*object].materials = slots.iter().map(of_slot).collect();
    }
    Ok(())
}

#[cfg(test)]
mod tests;
