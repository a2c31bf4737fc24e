//! `Prepared -> Frame` on the CPU: shadow maps, then tiles from their triangles to their final bytes.

mod aov;
mod depth;
mod layer;
mod light;
pub mod overlay;
mod point;
mod tile;
mod trace;

pub use depth::light_depth;
pub use overlay::{Overlay, Overlays};
pub(crate) use trace::{Piece, Trace, trace};

use crate::error::{Error, Finding, Result};
use crate::frame::{Frame, Plane, Values};
use crate::image::{Encoding, Image, Pixels};
use crate::job::Job;
use crate::math::lane::Level;
use crate::prepare::{self, Needs, Prepared, View};
use crate::raster::geometry::{Class, Draw, Geometry, Slot};
use crate::raster::tile::Place;
use crate::raster::{Bins, TILE};
use crate::scene::{Alpha, Camera, Output, Scene};
use crate::shade::{Lamp, Lights, Look};
use rayon::prelude::*;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// What the colour of a frame is stored in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Format {
    /// 8 bits, tone mapped and encoded.
    #[default]
    U8,
    /// 16 bits, tone mapped and encoded.
    U16,
    /// Linear light.
    F32,
}

/// An extra plane of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aov {
    /// Distance along the camera's axis, metres; infinite where nothing is.
    Depth,
    /// Shading normal, world space, unit length.
    Normal,
    /// Shading normal, view space, unit length.
    ViewNormal,
    /// Tangent, world space, unit length; 0 where the material has no normal map (nothing makes tangents then).
    Tangent,
    /// First UV set.
    Uv,
    /// World position, metres.
    Position,
    /// Index of the object.
    Object,
    /// Index of the material.
    Material,
    /// Index of the source triangle in its mesh.
    Triangle,
    /// Weights of the triangle's corners.
    Barycentric,
    /// Mip level of the albedo map (of a 1x1 texture without one).
    MipLevel,
    /// Texels of the albedo map per pixel, along one axis (square root of the area ratio).
    TexelDensity,
}

impl Aov {
    /// Every plane with its word on the command line.
    pub const ALL: [(&'static str, Aov); 12] = [
        ("depth", Aov::Depth),
        ("normal", Aov::Normal),
        ("view-normal", Aov::ViewNormal),
        ("tangent", Aov::Tangent),
        ("uv", Aov::Uv),
        ("position", Aov::Position),
        ("object", Aov::Object),
        ("material", Aov::Material),
        ("triangle", Aov::Triangle),
        ("barycentric", Aov::Barycentric),
        ("mip-level", Aov::MipLevel),
        ("texel-density", Aov::TexelDensity),
    ];
}

/// How a scene is rendered. Whatever is left at its default comes from the scene.
#[derive(Clone, Debug, Default)]
pub struct RenderOptions {
    /// Threads, memory, progress, cancellation.
    pub job: Job,
    /// The SIMD level; changes the speed, never the picture.
    pub level: Level,
    /// Width and height in pixels; `(0, 0)`: the scene's.
    pub size: (u32, u32),
    /// Coverage samples per pixel: 1, 4, 8 or 16; 0: the scene's.
    pub samples: u32,
    /// The camera; `None`: the scene's.
    pub camera: Option<Camera>,
    /// What the colour is stored in.
    pub format: Format,
    /// Extra planes.
    pub aovs: Vec<Aov>,
    /// Lines that are drawn over the picture.
    pub overlays: Overlays,
}

/// What a frame took; shows that nothing was kept from the frame before.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Wall time per stage, in order: `transform`, `shadow`, `raster`, ...
    pub stages: Vec<(&'static str, Duration)>,
    /// What was counted: `vertices_transformed`, `triangles_binned`, `shadow_samples`, `pixels_shaded`, ...
    pub counters: Vec<(&'static str, u64)>,
    /// What could not be shown as it was asked for.
    pub findings: Vec<Finding>,
}

impl Format {
    /// Bytes of an RGBA pixel.
    pub fn bytes(self) -> usize {
        match self {
            Format::U8 => 4,
            Format::U16 => 8,
            Format::F32 => 16,
        }
    }
}

/// Renders one picture.
///
/// # Errors
/// `render.size`, `render.samples`, `render.camera` for what is not possible; those of [`Prepared::new`].
pub fn render(scene: &Scene, options: &RenderOptions) -> Result<Frame> {
    let tangents = options.overlays.list.contains(&Overlay::Tbn);
    Ok(frame(&Prepared::with(scene, &Needs { tangents }, &options.job)?, options)?.0)
}

/// What all passes of a frame share.
struct Pass<'a> {
    prepared: &'a Prepared,
    level: Level,
    job: &'a Job,
    looks: &'a [Look],
    format: Format,
    output: Output,
    supersample: u32,
    aovs: &'a [Aov],
    spare: &'a Mutex<Vec<Geometry>>,
}

impl<'a> Pass<'a> {
    /// The draws of a view. For shadow maps (`casts`) what blends is left out.
    fn draws(&self, view: &View, casts: bool) -> Vec<Draw<'a>> {
        let prepared = self.prepared;
        let eye = if view.lens.parallel { view.axes[2].extend(0.0) } else { view.eye.extend(1.0) };
        prepared
            .instances
            .iter()
            .enumerate()
            .map(|(k, instance)| {
                let inverse = instance.transform.inverse();
                let colored = !prepared.meshes[instance.mesh].colors.is_empty();
                let slots = instance.materials.iter().map(|&m| {
                    let look = &self.looks[m];
                    let class = match look.alpha {
                        Alpha::Opaque => Class::Solid,
                        Alpha::Mask(cutoff) if look.is_solid_at(cutoff, colored) => Class::Solid,
                        Alpha::Mask(_) => Class::Cut,
                        Alpha::Blend if casts => Class::Hidden,
                        Alpha::Blend => Class::Layered,
                    };
                    // A flattened object has no inside, so no cluster of it faces away for certain.
                    Slot { cull_back: !look.double_sided, class, look: m as u32 }
                });
                let local = inverse.map_or([0.0, 0.0, 0.0, 1.0], |m| m.apply(eye).array());
                let direction = |v: [f32; 4]| {
                    let l = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
                    [v[0] / l, v[1] / l, v[2] / l, 0.0]
                };
                Draw {
                    mesh: &prepared.meshes[instance.mesh],
                    matrix: view.target.matrix.times(&instance.transform),
                    mirrored: instance.mirrored,
                    eye: match (inverse, view.lens.parallel) {
                        // No cone holds a direction of no length: nothing is culled.
                        (None, _) => [0.0; 4],
                        (Some(_), true) => direction(local),
                        (Some(_), false) => local,
                    },
                    order: k as u32,
                    slots: slots.collect(),
                }
            })
            .collect()
    }
}

/// Bytes that the tiles of one thread use at most.
fn scratch_bytes(samples: u32) -> u64 {
    u64::from(TILE * TILE) * (u64::from(samples) * 24 + 96)
}

/// Splits rows of `pixel` bytes per pixel into the rows of each tile of `side` pixels.
fn split(bytes: &mut [u8], width: usize, pixel: usize, side: usize) -> Vec<Vec<&mut [u8]>> {
    let across = width.div_ceil(side);
    let mut tiles: Vec<Vec<&mut [u8]>> = Vec::new();
    for band in bytes.chunks_mut(width * pixel * side) {
        let first = tiles.len();
        tiles.extend((0..across).map(|_| Vec::with_capacity(side)));
        for row in band.chunks_mut(width * pixel) {
            for (k, part) in row.chunks_mut(side * pixel).enumerate() {
                tiles[first + k].push(part);
            }
        }
    }
    tiles
}

/// Renders one picture of a prepared scene. Nothing is kept in `prepared`: each frame transforms, culls,
/// draws shadows and shades anew.
///
/// # Errors
/// As [`render`].
pub fn frame(prepared: &Prepared, options: &RenderOptions) -> Result<(Frame, Report)> {
    if !options.overlays.list.is_empty() {
        let mut drawn = frame_of(prepared, &overlay::with_planes(options))?;
        drawn.0.planes.truncate(options.aovs.len());
        return Ok(drawn);
    }
    frame_of(prepared, options)
}

fn frame_of(prepared: &Prepared, options: &RenderOptions) -> Result<(Frame, Report)> {
    let Plan { view, size: (width, height), supersample } = plan(prepared, options)?;
    let job = &options.job;
    job.check()?;
    let pixels = u64::from(width) * u64::from(height);
    let plane_bytes: u64 = options.aovs.iter().map(|a| a.channels().len() as u64 * 4).sum();
    let _held = job.reserve(
        pixels * (options.format.bytes() as u64 + plane_bytes)
            + shadow_bytes(prepared)
            + scratch_bytes(view.target.samples) * job.threads() as u64,
        format_args!("a picture of {width}x{height}"),
    )?;
    job.run(|| draw(prepared, options, &view, (width, height), supersample))
}

/// What the options and the scene make of one another.
struct Plan {
    view: View,
    /// Pixels of the picture.
    size: (u32, u32),
    /// Pixels of the view along each side of a pixel of the picture.
    supersample: u32,
}

fn plan(prepared: &Prepared, options: &RenderOptions) -> Result<Plan> {
    let output = prepared.output;
    let (width, height) = if options.size == (0, 0) { output.size.into() } else { options.size };
    let samples = if options.samples == 0 { output.samples } else { options.samples };
    if ![1, 4, 8, 16].contains(&samples) {
        return Err(Error::arguments("render.samples", format!("{samples} samples per pixel are not possible"))
            .remedy("possible are 1, 4, 8 and 16; supersampling adds to them"));
    }
    let supersample = output.supersample;
    if ![1, 2, 4, 8].contains(&supersample) {
        return Err(Error::arguments("render.supersample", format!("supersampling by {supersample} is not possible"))
            .remedy("possible are 1, 2, 4 and 8 along each axis"));
    }
    let camera = prepared.camera(options.camera.as_ref(), width as f32 / height.max(1) as f32);
    let side = |n: u32| n.saturating_mul(supersample);
    let view = prepare::view(prepared, &camera, side(width), side(height), samples)?;
    Ok(Plan { view, size: (width, height), supersample })
}

/// Bytes of all shadow maps.
fn shadow_bytes(prepared: &Prepared) -> u64 {
    prepared.lights.iter().filter_map(|l| l.shadow).map(|s| u64::from(light::side(s.size)).pow(2) * 4).sum()
}

/// Every material that some object shows, with its maps.
fn looks(prepared: &Prepared) -> Vec<Look> {
    let used = |k: usize| prepared.instances.iter().any(|i| i.materials.contains(&k));
    let blank = crate::scene::Material::default();
    let materials = prepared.materials.iter().enumerate();
    materials
        .map(|(k, m)| Look::new(if used(k) { m } else { &blank }, |texture, color| prepared.map(texture, color)))
        .collect()
}

/// Every light with its shadow map, drawn for this frame.
fn lamps(pass: &Pass<'_>, counters: &mut [u64; 6]) -> Result<Vec<Lamp>> {
    let mut lamps = Vec::with_capacity(pass.prepared.lights.len());
    for light in &pass.prepared.lights {
        let map = light::shadow_map(light, pass)?;
        let map = map.map(|(map, bins)| {
            counters[0] += bins.sum(|g| g.transformed);
            counters[1] += bins.sum(|g| g.examined);
            counters[2] += bins.sum(|g| g.binned);
            counters[3] += u64::from(map.size).pow(2);
            // The memory of this view serves the next.
            if let Ok(mut spare) = pass.spare.lock() {
                spare.extend(bins.parts);
            }
            map
        });
        lamps.push(Lamp::new(light, map));
        pass.job.check()?;
    }
    Ok(lamps)
}

fn draw(
    prepared: &Prepared,
    options: &RenderOptions,
    view: &View,
    (width, height): (u32, u32),
    supersample: u32,
) -> Result<(Frame, Report)> {
    let mut report = Report::default();
    let mut clock = Instant::now();
    let mut lap = |report: &mut Report, stage| {
        let now = Instant::now();
        report.stages.push((stage, now - clock));
        clock = now;
    };
    let looks = looks(prepared);
    let spare = Mutex::new(Vec::new());
    let pass = Pass {
        prepared,
        level: options.level,
        job: &options.job,
        looks: &looks,
        format: options.format,
        output: prepared.output,
        supersample,
        aovs: &options.aovs,
        spare: &spare,
    };
    let mut counters = [0u64; 6];
    let lamps = lamps(&pass, &mut counters)?;
    lap(&mut report, "shadow");
    let lights = Lights { lamps: &lamps, ambient: prepared.ambient.color, per_light: prepared.ambient.per_light };
    let draws = pass.draws(view, false);
    let bins = Bins::new(pass.level, &view.target, &draws, &spare);
    counters[0] += bins.sum(|g| g.transformed);
    counters[1] += bins.sum(|g| g.examined);
    counters[2] += bins.sum(|g| g.binned);
    lap(&mut report, "geometry");
    options.job.check()?;

    let side = (TILE / supersample) as usize;
    let pixels = width as usize * height as usize;
    let mut bytes = vec![0u8; pixels * pass.format.bytes()];
    let mut planes: Vec<Vec<u8>> = pass.aovs.iter().map(|a| vec![0u8; pixels * a.channels().len() * 4]).collect();
    let mut outs: Vec<tile::Out<'_>> = split(&mut bytes, width as usize, pass.format.bytes(), side)
        .into_iter()
        .map(|rows| tile::Out { rows, planes: Vec::new() })
        .collect();
    for (plane, aov) in planes.iter_mut().zip(pass.aovs) {
        let rows = split(plane, width as usize, aov.channels().len() * 4, side);
        outs.iter_mut().zip(rows).for_each(|(out, rows)| out.planes.push(rows));
    }
    let scratches = Mutex::new(Vec::new());
    let total = outs.len() as u64;
    let (done, shaded) = (AtomicU64::new(0), AtomicU64::new(0));
    outs.into_par_iter().enumerate().with_max_len(1).for_each(|(k, out)| {
        if pass.job.is_cancelled() {
            return;
        }
        let mut scratch: tile::Scratch =
            scratches.lock().ok().and_then(|mut s: std::sync::MutexGuard<'_, Vec<_>>| s.pop()).unwrap_or_default();
        let place = Place { target: &view.target, bins: &bins, draws: &draws, tile: k as u32 };
        let count = pass.level.run(tile::Tile { pass: &pass, view, lights, place, out, scratch: &mut scratch });
        shaded.fetch_add(count.shaded, Relaxed);
        if let Ok(mut all) = scratches.lock() {
            all.push(scratch);
        }
        pass.job.progress("render", done.fetch_add(1, Relaxed) + 1, total);
    });
    options.job.check()?;
    counters[4] = shaded.into_inner();
    counters[5] = u64::from(view.target.width) * u64::from(view.target.height) * u64::from(view.target.samples);
    lap(&mut report, "tiles");
    let names = [
        "vertices_transformed",
        "triangles_examined",
        "triangles_binned",
        "shadow_samples",
        "pixels_shaded",
        "samples",
    ];
    report.counters = names.into_iter().zip(counters).collect();
    let (values, encoding) = match pass.format {
        Format::U8 => (Pixels::U8(bytes), pass.output.encode),
        Format::U16 => (Pixels::U16(bytemuck::pod_collect_to_vec(&bytes)), pass.output.encode),
        Format::F32 => (Pixels::F32(bytemuck::pod_collect_to_vec(&bytes)), Encoding::Linear),
    };
    let planes = planes
        .into_iter()
        .zip(pass.aovs)
        .map(|(bytes, aov)| Plane {
            name: aov.name(),
            channels: aov.channels(),
            unit: aov.unit(),
            space: aov.space(),
            values: if aov.is_id() {
                Values::U32(bytemuck::pod_collect_to_vec(&bytes))
            } else {
                Values::F32(bytemuck::pod_collect_to_vec(&bytes))
            },
        })
        .collect();
    let mut frame = Frame { color: Image::new(width, height, 4, values, encoding)?, planes };
    if !options.overlays.list.is_empty() {
        frame = overlay::draw(&pass, view, &draws, &options.overlays, frame, &mut report)?;
        lap(&mut report, "overlay");
    }
    Ok((frame, report))
}
