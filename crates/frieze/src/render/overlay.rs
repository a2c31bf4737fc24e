//! Lines over a finished picture: normals, mapped normals, tangent frames, edges, UV seams and light frusta (rows 54, 55
//! and 121).
//!
//! What lines show is what was shaded with: vertices and frames are those of the frame's own draws, mapped normals are
//! read from the planes of the frame. Lines are tested against the frame's depth, cover pixels by their distance from the
//! line (a capsule, one pixel wide at its border), and are mixed in linear light. A kind of line covers a pixel once,
//! however many of its lines cross there, so neither the order of triangles nor the number of threads changes a bit.

use super::{Aov, Pass, RenderOptions, Report, light};
use crate::error::{Finding, Result};
use crate::frame::{Frame, Values};
use crate::image::{Encoding, Image, Pixels, color};
use crate::math::lane::Int;
use crate::math::vec::Vec3;
use crate::mesh::meshlet::{Meshlet, Meshlets};
use crate::prepare::View;
use crate::raster::geometry::Draw;
use rayon::prelude::*;

/// What can be drawn over a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Overlay {
    /// The normal of every vertex, blue.
    Normals,
    /// The normal that is shaded with, map included, on a grid of pixels, red as in document 001.
    MapNormals,
    /// Tangent (red), bitangent (green) and normal (blue) of every vertex, as shading uses them.
    Tbn,
    /// The edges of all triangles, cyan.
    Wire,
    /// Edges where the first UV set is cut or ends, orange.
    UvSeams,
    /// The box that a directional light's shadow map sees, yellow.
    LightFrustum,
}

impl Overlay {
    /// Every overlay with its word on the command line.
    pub const ALL: [(&'static str, Overlay); 6] = [
        ("normals", Overlay::Normals),
        ("map-normals", Overlay::MapNormals),
        ("tbn", Overlay::Tbn),
        ("wire", Overlay::Wire),
        ("uv-seams", Overlay::UvSeams),
        ("light-frustum", Overlay::LightFrustum),
    ];
}

/// What is drawn over a picture, and how.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overlays {
    /// What, the last on top.
    pub list: Vec<Overlay>,
    /// Length of arrows in metres; `None`: 1/20 of the picture's height where they stand.
    pub length: Option<f32>,
    /// Width of lines in pixels; `None`: 1/400 of the picture's shorter side, at least 1.25.
    pub width: Option<f32>,
    /// Pixels between the arrows of [`Overlay::MapNormals`]; `None`: 1/20 of the picture's shorter side, at least 8.
    pub spacing: Option<u32>,
}

const RED: [f32; 3] = [0.9, 0.03, 0.02];
const GREEN: [f32; 3] = [0.05, 0.65, 0.05];
const BLUE: [f32; 3] = [0.04, 0.12, 1.0];
const CYAN: [f32; 3] = [0.0, 0.5, 0.7];
const ORANGE: [f32; 3] = [1.0, 0.3, 0.0];
const YELLOW: [f32; 3] = [1.0, 0.75, 0.05];

/// Most arrows of an overlay, and most edges: with more nothing could be told apart.
const ARROWS: usize = 200_000;
const EDGES: usize = 6_000_000;

/// Rows of pixels that are drawn at a time.
const BAND: usize = 32;

/// The planes that the overlays read, beside those that are asked for.
pub(super) fn with_planes(options: &RenderOptions) -> RenderOptions {
    let mut all = options.clone();
    let mut add = |aov| {
        if !all.aovs.contains(&aov) {
            all.aovs.push(aov);
        }
    };
    add(Aov::Depth);
    if options.overlays.list.contains(&Overlay::MapNormals) {
        add(Aov::Position);
        add(Aov::Normal);
    }
    all
}

/// A line of the picture: pixels, and what depth is affine in along it on the screen (its reciprocal in perspective).
#[derive(Clone, Copy, Debug)]
struct Line {
    from: [f64; 3],
    to: [f64; 3],
}

/// Lines of one colour.
struct Layer {
    color: [f32; 3],
    lines: Vec<Line>,
}

/// From the world to the picture.
struct Screen<'a> {
    view: &'a View,
    /// Pixels of the view along each side of a pixel of the picture.
    step: f64,
    size: [usize; 2],
    width: f64,
    length: Option<f32>,
}

impl Screen<'_> {
    /// Pixel and distance along the camera's axis.
    fn place(&self, p: Vec3) -> [f64; 3] {
        let v = self.view.target.matrix.project(p);
        let lens = &self.view.lens;
        let depth = if lens.parallel { f64::from(v.z) * (lens.near - lens.far) + lens.far } else { f64::from(v.w) };
        [f64::from(v.x), f64::from(v.y), depth]
    }
    /// The line between two points of the world, what lies before the near plane cut off; `None` when nothing is left.
    fn line(&self, a: Vec3, b: Vec3) -> Option<Line> {
        let (mut p, mut q) = (self.place(a), self.place(b));
        let near = self.view.lens.near;
        if !p.iter().chain(&q).all(|v| v.is_finite()) || p[2].max(q[2]) < near {
            return None;
        }
        let cut = |p: [f64; 3], q: [f64; 3]| {
            let t = (near - p[2]) / (q[2] - p[2]);
            core::array::from_fn(|k| p[k] + (q[k] - p[k]) * t)
        };
        if p[2] < near {
            p = cut(p, q);
        } else if q[2] < near {
            q = cut(q, p);
        }
        let end = |p: [f64; 3]| {
            let (w, z) = if self.view.lens.parallel { (1.0, p[2]) } else { (p[2], 1.0 / p[2]) };
            [p[0] / (w * self.step), p[1] / (w * self.step), z]
        };
        self.clipped(Line { from: end(p), to: end(q) })
    }
    /// What is in the picture, or so near that it may touch it (Liang and Barsky 1984).
    fn clipped(&self, line: Line) -> Option<Line> {
        let margin = self.width + 1.0;
        let d: [f64; 3] = core::array::from_fn(|k| line.to[k] - line.from[k]);
        let (mut start, mut end) = (0.0f64, 1.0f64);
        for k in 0..2 {
            let (lo, hi) = (-margin - line.from[k], self.size[k] as f64 + margin - line.from[k]);
            if d[k] == 0.0 {
                if lo > 0.0 || hi < 0.0 {
                    return None;
                }
                continue;
            }
            let (a, b) = (lo / d[k], hi / d[k]);
            start = start.max(a.min(b));
            end = end.min(a.max(b));
        }
        if start > end {
            return None;
        }
        let at = |t: f64| core::array::from_fn(|k| line.from[k] + d[k] * t);
        Some(Line { from: at(start), to: if end == 1.0 { line.to } else { at(end) } })
    }
    /// An arrow from a point along a unit vector.
    fn arrow(&self, from: Vec3, along: Vec3, lines: &mut Vec<Line>) {
        let depth = self.place(from)[2];
        let lens = &self.view.lens;
        let auto = || {
            // Metres per pixel of the picture at the point's depth.
            let pixel = lens.a[1].abs() * self.step * if lens.parallel { 1.0 } else { depth.max(lens.near) };
            (pixel * self.size[1] as f64 / 20.0) as f32
        };
        let Some(line) = self.line(from, from + along * self.length.unwrap_or_else(auto)) else { return };
        lines.push(line);
        let d = [line.to[0] - line.from[0], line.to[1] - line.from[1]];
        let length = (d[0] * d[0] + d[1] * d[1]).sqrt();
        if length < 1.0 {
            return;
        }
        let head = (length * 0.35).min(3.0 + 3.0 * self.width) / length;
        for side in [-0.5, 0.5] {
            let back = [line.to[0] - head * (d[0] - side * d[1]), line.to[1] - head * (d[1] + side * d[0]), line.to[2]];
            lines.extend(self.clipped(Line { from: line.to, to: back }));
        }
    }
}

/// Every `step`th of `count` things, so that no more than `most` are left; says so.
fn thinned(count: usize, most: usize, what: &str, report: &mut Report) -> usize {
    let step = count.div_ceil(most).max(1);
    if step > 1 {
        report.findings.push(Finding::note(
            "overlay.thinned",
            format!("the scene has {count} {what}"),
            format!("one of {step} is drawn over the picture"),
        ));
    }
    step
}

/// Draws over a frame that holds the planes of [`with_planes`].
pub(super) fn draw(
    pass: &Pass<'_>,
    view: &View,
    draws: &[Draw<'_>],
    overlays: &Overlays,
    frame: Frame,
    report: &mut Report,
) -> Result<Frame> {
    let Frame { color, planes } = frame;
    let size = [color.width() as usize, color.height() as usize];
    let shorter = size[0].min(size[1]) as f32;
    let sane = |v: f32| if v.is_finite() { v.clamp(0.1, 256.0) } else { 1.0 };
    let screen = Screen {
        view,
        step: f64::from(pass.supersample),
        size,
        width: f64::from(overlays.width.map_or((shorter / 400.0).max(1.25), sane)),
        length: overlays.length.filter(|l| l.is_finite()),
    };
    let plane = |aov: Aov| match planes.iter().find(|p| p.name == aov.name()).map(|p| &p.values) {
        Some(Values::F32(v)) => &v[..],
        _ => &[],
    };
    let depth = plane(Aov::Depth);
    let mut layers: Vec<Layer> = Vec::new();
    for overlay in &overlays.list {
        pass.job.check()?;
        match overlay {
            Overlay::Normals | Overlay::Tbn => {
                let which = if *overlay == Overlay::Tbn { 0..3 } else { 2..3 };
                let colors = [RED, GREEN, BLUE];
                let from = layers.len();
                layers.extend(which.clone().map(|k| Layer { color: colors[k], lines: Vec::new() }));
                frames(pass, draws, report, |place, axes| {
                    for (layer, k) in layers[from..].iter_mut().zip(which.clone()) {
                        screen.arrow(place, axes[k], &mut layer.lines);
                    }
                });
            }
            Overlay::MapNormals => {
                let (positions, normals) = (plane(Aov::Position), plane(Aov::Normal));
                let spacing = overlays.spacing.map_or(((shorter / 20.0) as usize).max(8), |n| (n as usize).max(1));
                let least = (size[0] * size[1] / ARROWS) as f64;
                let spacing = spacing.max(least.sqrt().ceil() as usize);
                let mut lines = Vec::new();
                for y in (spacing / 2..size[1]).step_by(spacing) {
                    for x in (spacing / 2..size[0]).step_by(spacing) {
                        let at = y * size[0] + x;
                        if depth[at].is_finite() {
                            let vector = |v: &[f32]| Vec3::new(v[3 * at], v[3 * at + 1], v[3 * at + 2]);
                            screen.arrow(vector(positions), vector(normals), &mut lines);
                        }
                    }
                }
                layers.push(Layer { color: RED, lines });
            }
            Overlay::Wire => layers.push(Layer { color: CYAN, lines: wire(draws, pass, &screen, report) }),
            Overlay::UvSeams => layers.push(Layer { color: ORANGE, lines: seams(draws, pass, &screen, report)? }),
            Overlay::LightFrustum => {
                let lines = pass.prepared.lights.iter().filter_map(|l| light::frustum(l, pass)).flat_map(|c| {
                    // Corners that differ in one bit share an edge.
                    let edges = (0..8usize).flat_map(|k| [1, 2, 4].map(|bit| (k, k | bit))).filter(|(a, b)| a != b);
                    edges.filter_map(|(a, b)| screen.line(c[a], c[b])).collect::<Vec<_>>()
                });
                layers.push(Layer { color: YELLOW, lines: lines.collect() });
            }
        }
    }
    let paint =
        Paint { screen: &screen, depth, layers: &layers, bands: layers.iter().map(|l| l.bands(&screen)).collect() };
    let (width, height, encoding) = (color.width(), color.height(), color.encoding);
    let srgb = encoding == Encoding::Srgb;
    let pixels = match color.into_pixels() {
        Pixels::U8(mut v) => {
            paint.over(
                &mut v,
                |c| c.map(|c| f32::from(c) / 255.0),
                |c| c.map(|c| color::to_code(c, 255.0).lane(0) as u8),
                srgb,
            );
            Pixels::U8(v)
        }
        Pixels::U16(mut v) => {
            let code = |c: f32| color::to_code(c, 65535.0).lane(0) as u16;
            paint.over(&mut v, |c| c.map(|c| f32::from(c) / 65535.0), |c| c.map(code), srgb);
            Pixels::U16(v)
        }
        Pixels::F32(mut v) => {
            paint.over(&mut v, |c| c, |c| c, false);
            Pixels::F32(v)
        }
        other => other,
    };
    Ok(Frame { color: Image::new(width, height, 4, pixels, encoding)?, planes })
}

/// Every vertex of every draw: its place and its frame, unit vectors in world space.
fn frames(pass: &Pass<'_>, draws: &[Draw<'_>], report: &mut Report, mut each: impl FnMut(Vec3, [Vec3; 3])) {
    let count = draws.iter().map(|d| d.mesh.vertices.len()).sum();
    let step = thinned(count, ARROWS, "vertices", report);
    let mut number = 0;
    for draw in draws {
        let instance = &pass.prepared.instances[draw.order as usize];
        for m in &draw.mesh.meshlets {
            let look = &pass.looks[draw.slots[(m.slot as usize).min(draw.slots.len() - 1)].look as usize];
            for k in 0..u32::from(m.vertex_count) {
                number += 1;
                if (number - 1) % step != 0 {
                    continue;
                }
                let [nx, ny, nz, tx, ty, tz, ..] = draw.mesh.vertices[(m.vertices + k) as usize];
                let normal = instance.normals.direction(Vec3::new(nx, ny, nz)).normalize();
                let tangent = instance.tangents.direction(Vec3::new(tx, ty, tz)).normalize();
                let mirrored = (m.mirrored >> k & 1 == 1) != instance.mirrored;
                let axes = look.frame(normal, tangent, if mirrored { -1.0 } else { 1.0 });
                each(instance.transform.point(position(draw.mesh, m, k)), axes.map(|a| a.normalize()));
            }
        }
    }
}

/// The position of a vertex of a cluster, object space.
fn position(mesh: &Meshlets, m: &Meshlet, k: u32) -> Vec3 {
    let at = (m.positions + k) as usize;
    Vec3::new(mesh.x[at], mesh.y[at], mesh.z[at])
}

/// Triangles of a cluster as vertices of the cluster.
fn triangles<'a>(mesh: &'a Meshlets, m: &Meshlet) -> impl Iterator<Item = [u32; 3]> + 'a {
    let first = m.triangles as usize;
    mesh.triangles[first..first + usize::from(m.triangle_count)].iter().map(|t| [t[0], t[1], t[2]].map(u32::from))
}

fn wire(draws: &[Draw<'_>], pass: &Pass<'_>, screen: &Screen<'_>, report: &mut Report) -> Vec<Line> {
    let step = thinned(draws.iter().map(|d| d.mesh.triangles.len()).sum(), EDGES / 3, "triangles", report);
    let (mut lines, mut number) = (Vec::new(), 0);
    for draw in draws {
        let transform = &pass.prepared.instances[draw.order as usize].transform;
        for m in &draw.mesh.meshlets {
            for t in triangles(draw.mesh, m) {
                number += 1;
                if (number - 1) % step == 0 {
                    let p = t.map(|k| transform.point(position(draw.mesh, m, k)));
                    lines.extend([(0, 1), (1, 2), (2, 0)].into_iter().filter_map(|(a, b)| screen.line(p[a], p[b])));
                }
            }
        }
    }
    lines
}

/// Edges whose sides have other texture coordinates, or that have one side.
fn seams(draws: &[Draw<'_>], pass: &Pass<'_>, screen: &Screen<'_>, report: &mut Report) -> Result<Vec<Line>> {
    let mut lines = Vec::new();
    let mut known: Vec<(*const Meshlets, Vec<[Vec3; 2]>)> = Vec::new();
    for draw in draws {
        let transform = &pass.prepared.instances[draw.order as usize].transform;
        let k = match known.iter().position(|(mesh, _)| std::ptr::eq(*mesh, draw.mesh)) {
            Some(k) => k,
            None => {
                let count = 3 * draw.mesh.triangles.len();
                let found = if count > EDGES {
                    report.findings.push(Finding::note(
                        "overlay.too-many",
                        format!("object {} has {count} edges", draw.order),
                        format!("its UV seams are not drawn; at most {EDGES} edges are searched"),
                    ));
                    Vec::new()
                } else {
                    let _held = pass.job.reserve(count as u64 * 64, "the search for UV seams")?;
                    cuts(draw.mesh)
                };
                known.push((draw.mesh, found));
                known.len() - 1
            }
        };
        lines.extend(known[k].1.iter().filter_map(|e| screen.line(transform.point(e[0]), transform.point(e[1]))));
    }
    Ok(lines)
}

/// The edges of a mesh where its first UV set is cut or ends. Edges meet where their ends have the same positions.
fn cuts(mesh: &Meshlets) -> Vec<[Vec3; 2]> {
    // Numbers as bits, zero without a sign.
    let bits = |v: f32| (v + 0.0).to_bits();
    let mut edges: Vec<([[u32; 3]; 2], [[u32; 2]; 2])> = Vec::with_capacity(3 * mesh.triangles.len());
    for m in &mesh.meshlets {
        for t in triangles(mesh, m) {
            let corner = t.map(|k| {
                let v = &mesh.vertices[(m.vertices + k) as usize];
                (position(mesh, m, k).array().map(bits), [v[6], v[7]].map(bits))
            });
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                let (mut a, mut b) = (corner[a], corner[b]);
                if b.0 < a.0 {
                    std::mem::swap(&mut a, &mut b);
                }
                edges.push(([a.0, b.0], [a.1, b.1]));
            }
        }
    }
    // Equal keys are equal in all that counts, so an unstable sort has one result.
    edges.par_sort_unstable();
    let cut = |side: &&[([[u32; 3]; 2], [[u32; 2]; 2])]| side.len() == 1 || side.iter().any(|e| e.1 != side[0].1);
    let ends = |e: &([[u32; 3]; 2], [[u32; 2]; 2])| e.0.map(|p| Vec3::from(p.map(f32::from_bits)));
    edges.chunk_by(|a, b| a.0 == b.0).filter(cut).map(|side| ends(&side[0])).collect()
}

impl Layer {
    /// The lines that touch each band of rows.
    fn bands(&self, screen: &Screen<'_>) -> Vec<Vec<u32>> {
        let mut bands = vec![Vec::new(); screen.size[1].div_ceil(BAND)];
        for (k, line) in self.lines.iter().enumerate() {
            let reach = screen.width * 0.5 + 1.0;
            let (lo, hi) = (line.from[1].min(line.to[1]) - reach, line.from[1].max(line.to[1]) + reach);
            let band = |y: f64| (y.max(0.0) as usize / BAND).min(bands.len());
            let (first, last) = (band(lo), band(hi));
            for band in bands.iter_mut().take(last + 1).skip(first) {
                band.push(k as u32);
            }
        }
        bands
    }
}

/// Everything that is drawn.
struct Paint<'a> {
    screen: &'a Screen<'a>,
    depth: &'a [f32],
    layers: &'a [Layer],
    bands: Vec<Vec<Vec<u32>>>,
}

impl Paint<'_> {
    /// Draws over RGBA pixels with straight alpha. `get` and `put` turn a pixel to fractions and back.
    fn over<T: Copy + Send>(
        &self,
        pixels: &mut [T],
        get: impl Fn([T; 4]) -> [f32; 4] + Sync,
        put: impl Fn([f32; 4]) -> [T; 4] + Sync,
        srgb: bool,
    ) {
        let width = self.screen.size[0];
        pixels.par_chunks_mut(width * 4 * BAND).enumerate().for_each(|(band, rows)| {
            let mut cover = vec![0.0f32; rows.len() / 4];
            for (layer, bands) in self.layers.iter().zip(&self.bands) {
                if bands[band].is_empty() {
                    continue;
                }
                cover.fill(0.0);
                for &k in &bands[band] {
                    self.cover(&layer.lines[k as usize], band * BAND, &mut cover);
                }
                for (pixel, &c) in rows.as_chunks_mut::<4>().0.iter_mut().zip(&cover).filter(|(_, c)| **c > 0.0) {
                    let [r, g, b, a] = get(*pixel);
                    let below = a * (1.0 - c);
                    let alpha = c + below;
                    let mix = |ink: f32, v: f32| {
                        let v = if srgb { color::srgb_to_linear(v) } else { v };
                        let mixed = (ink * c + v * below) / alpha;
                        if srgb { color::linear_to_srgb(mixed) } else { mixed }
                    };
                    let [ir, ig, ib] = layer.color;
                    *pixel = put([mix(ir, r), mix(ig, g), mix(ib, b), alpha]);
                }
            }
        });
    }

    /// Marks what a line covers of the rows from `top` on.
    fn cover(&self, line: &Line, top: usize, cover: &mut [f32]) {
        let width = self.screen.size[0];
        let rows = cover.len() / width;
        let [ax, ay, _] = line.from;
        let (dx, dy) = (line.to[0] - ax, line.to[1] - ay);
        let length2 = dx * dx + dy * dy;
        // Thinner lines are as faint as they are thin.
        let (half, strength) = (self.screen.width.max(1.0) * 0.5, self.screen.width.min(1.0));
        let reach = half + 0.5;
        let clamp = |v: f64, most: usize| v.max(0.0).min(most as f64) as usize;
        let first = clamp((ay.min(ay + dy) - reach - top as f64).floor(), rows);
        let last = clamp((ay.max(ay + dy) + reach - top as f64).ceil(), rows);
        for y in first..last {
            let cy = (top + y) as f64 + 0.5;
            // The part of the line that is near enough to this row.
            let at = |y: f64| if dy == 0.0 { 0.0 } else { ((y - ay) / dy).clamp(0.0, 1.0) };
            let (t0, t1) = if dy == 0.0 { (0.0, 1.0) } else { (at(cy - reach), at(cy + reach)) };
            let (x0, x1) = (ax + dx * t0, ax + dx * t1);
            let from = clamp((x0.min(x1) - reach).floor(), width);
            let to = clamp((x0.max(x1) + reach).ceil(), width);
            for x in from..to {
                let cx = x as f64 + 0.5;
                let t = if length2 > 0.0 { (((cx - ax) * dx + (cy - ay) * dy) / length2).clamp(0.0, 1.0) } else { 0.0 };
                let (px, py) = (ax + dx * t, ay + dy * t);
                let distance = ((cx - px) * (cx - px) + (cy - py) * (cy - py)).sqrt();
                let c = ((reach - distance).clamp(0.0, 1.0) * strength) as f32;
                let known = &mut cover[y * width + x];
                if c > *known && self.is_seen(px, py, line.from[2] + (line.to[2] - line.from[2]) * t) {
                    *known = c;
                }
            }
        }
    }

    /// Whether a point of a line lies before what the frame shows there. A tolerance of what the surface rises within a
    /// pixel lets lines lie on surfaces.
    fn is_seen(&self, x: f64, y: f64, z: f64) -> bool {
        let [width, height] = self.screen.size;
        let z = if self.screen.view.lens.parallel { z } else { 1.0 / z };
        let (x, y) = ((x.max(0.0) as usize).min(width - 1), (y.max(0.0) as usize).min(height - 1));
        let at = |x: usize, y: usize| f64::from(self.depth[y * width + x]);
        let here = at(x, y);
        if here.is_infinite() {
            return true;
        }
        // The smaller of both sides: across an outline depth says nothing about the slope.
        let rise = |before: Option<f64>, after: Option<f64>| {
            let step = |d: Option<f64>| d.map_or(f64::INFINITY, |d| (d - here).abs());
            let least = step(before).min(step(after));
            if least.is_finite() { least } else { 0.0 }
        };
        let rises = rise((x > 0).then(|| at(x - 1, y)), (x + 1 < width).then(|| at(x + 1, y)))
            + rise((y > 0).then(|| at(x, y - 1)), (y + 1 < height).then(|| at(x, y + 1)));
        z <= here + rises + here.abs() * 1e-3
    }
}
