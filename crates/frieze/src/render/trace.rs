//! One pixel with everything that was seen on the way: the renderer's own code at one lane, with a probe that
//! listens.

use super::layer::Layers;
use super::point::{Corners, Lanes, Triangle};
use super::tile::{self, Contents, Entry, Holes, Out, Scratch, group};
use super::{Format, Pass, RenderOptions, lamps, looks, plan, scratch_bytes, shadow_bytes};
use crate::error::{Error, Result};
use crate::math::lane::{I1, One};
use crate::math::vec::Vec3;
use crate::prepare::{Instance, Prepared, View};
use crate::raster::geometry::Class;
use crate::raster::tile::{self as raster, NOTHING, PIXELS, Place, Uncut};
use crate::raster::{Bins, TILE, sample_positions};
use crate::scene::{Background, Output};
use crate::shade::probe::Recorder;
use crate::shade::{self, Lamp, Lights, Lit, Look, Note, Surface};
use std::sync::Mutex;

/// A triangle in a pixel, shaded.
pub(crate) struct Piece<'a> {
    pub instance: &'a Instance,
    /// Index into [`Prepared::materials`].
    pub material: usize,
    pub look: &'a Look,
    /// Source triangle of its mesh.
    pub triangle: usize,
    pub class: Class,
    /// Samples that it covers.
    pub samples: u32,
    /// Where it is shaded, pixels of the picture.
    pub place: [f32; 2],
    pub weights: [f32; 3],
    /// Metres along the camera's axis.
    pub depth: f32,
    pub front: bool,
    pub surface: Surface<One>,
    /// Of each lamp alone, where light is computed at vertices or centroids.
    pub early: Vec<Lit<One>>,
    pub notes: Vec<Note<One>>,
    /// Linear light; alpha is 1 unless the material blends.
    pub color: [f32; 4],
    /// Opacity, maps and vertex colour.
    pub alpha: f32,
}

/// A coverage sample of a pixel.
pub(crate) struct Sample {
    /// In the pixel, 0 ..= 1 from its upper left corner.
    pub place: [f32; 2],
    /// Reversed depth of what is solid, 0 where nothing is.
    pub depth: f32,
    /// The solid piece that it sees.
    pub solid: Option<usize>,
    /// Layered pieces in front of it and their reversed depths, far to near.
    pub layers: Vec<(usize, f32)>,
}

/// A pixel.
pub(crate) struct Trace<'a> {
    pub pixel: [u32; 2],
    pub size: [u32; 2],
    pub view: &'a View,
    pub supersample: u32,
    pub lamps: &'a [Lamp],
    pub pieces: Vec<Piece<'a>>,
    /// Row by row of the pixels that are averaged; of each, sample by sample.
    pub samples: Vec<Sample>,
    /// Mean light of what is covered and its share of the pixel.
    pub light: [f32; 4],
    /// The same after the tone curve.
    pub toned: [f32; 3],
    /// The bytes of the frame's pixel as linear floats, and in the format that was asked for.
    pub linear: Vec<u8>,
    pub bytes: Vec<u8>,
}

/// What all pixels of a trace share.
struct Scene<'a> {
    pass: &'a Pass<'a>,
    view: &'a View,
    lights: Lights<'a>,
    /// The light of each lamp alone.
    single: &'a [Lights<'a>],
    bins: &'a Bins,
    draws: &'a [crate::raster::Draw<'a>],
    size: (u32, u32),
}

/// Follows pixels (column from the left, row from the top) through the frame that `options` ask for and hands them
/// to `each`. Only their tiles are drawn; shadow maps are drawn whole.
///
/// # Errors
/// `explain.pixel` for a pixel outside of the picture; those of [`frame`](super::frame).
pub(crate) fn trace<R: Send>(
    prepared: &Prepared,
    options: &RenderOptions,
    pixels: &[(u32, u32)],
    mut each: impl FnMut(Trace<'_>) -> R + Send,
) -> Result<Vec<R>> {
    let plan = plan(prepared, options)?;
    let (width, height) = plan.size;
    if let Some((x, y)) = pixels.iter().find(|p| p.0 >= width || p.1 >= height) {
        return Err(Error::arguments(
            "explain.pixel",
            format!("the picture is {width}x{height}; it has no pixel {x},{y}"),
        )
        .remedy(format!(
            "columns run from 0 to {} from the left, rows from 0 to {} from the top",
            width - 1,
            height - 1
        )));
    }
    let job = &options.job;
    job.check()?;
    let held = shadow_bytes(prepared) + scratch_bytes(plan.view.target.samples);
    let _held = job.reserve(held, "the trace of a pixel")?;
    job.run(|| {
        let looks = looks(prepared);
        let spare = Mutex::new(Vec::new());
        let pass = Pass {
            prepared,
            level: options.level,
            job,
            looks: &looks,
            format: options.format,
            output: prepared.output,
            supersample: plan.supersample,
            aovs: &[],
            spare: &spare,
        };
        let lamps = lamps(&pass, &mut [0; 6])?;
        let lights = Lights { lamps: &lamps, ambient: prepared.ambient.color, per_light: prepared.ambient.per_light };
        let single: Vec<Lights<'_>> = lamps
            .iter()
            .map(|l| Lights { lamps: std::slice::from_ref(l), ambient: [0.0; 3], per_light: false })
            .collect();
        let draws = pass.draws(&plan.view, false);
        let bins = Bins::new(pass.level, &plan.view.target, &draws, &spare);
        job.check()?;
        let scene = Scene {
            pass: &pass,
            view: &plan.view,
            lights,
            single: &single,
            bins: &bins,
            draws: &draws,
            size: plan.size,
        };
        pixels
            .iter()
            .map(|&pixel| {
                job.check()?;
                Ok(each(scene.pixel(pixel)))
            })
            .collect()
    })
}

impl<'a> Scene<'a> {
    fn pixel(&self, (x, y): (u32, u32)) -> Trace<'a> {
        let (pass, step) = (self.pass, self.pass.supersample);
        let side = TILE / step;
        let tile = y / side * self.view.target.tiles().0 + x / side;
        let place = Place { target: &self.view.target, bins: self.bins, draws: self.draws, tile };
        let count = self.view.target.samples as usize;
        let positions = sample_positions(count as u32);
        let Contents { cuts, layers: layered, single } = tile::contents(&place);
        let kept = if layered { count } else { 1 };
        let mut scratch = Scratch::default();
        scratch.depth.resize(PIXELS * count, 0.0);
        scratch.id.resize(PIXELS * count, NOTHING);
        scratch.color.resize(PIXELS * kept, [0.0; 4]);
        if cuts {
            let mut holes = Holes { place, pass, view: self.view };
            raster::solid::<One, _, true>(One, &place, &mut holes, &mut scratch.depth, &mut scratch.id);
        } else {
            raster::solid::<One, _, true>(One, &place, &mut Uncut, &mut scratch.depth, &mut scratch.id);
        }
        // The whole tile is sorted, so that the pixel's triangles are summed in the order of the frame.
        tile::collect(One, &place, &mut scratch, count, single);
        let wanted: Vec<usize> =
            (0..step * step).map(|k| raster::index(x % side * step + k % step, y % side * step + k / step)).collect();
        let mut pieces: Vec<Piece<'a>> = Vec::new();
        let mut found: Vec<(usize, u32)> = Vec::new();
        for k in 0..scratch.used {
            let batch = std::mem::take(&mut scratch.batches[k]);
            for e in batch.filled().chain(batch.entries.iter().copied()).filter(|e| wanted.contains(&usize::from(e.at)))
            {
                found.push((usize::from(e.at), e.id));
                let piece = self.piece(&place, &e);
                tile::add(&e, piece.color, &mut scratch.color, count, kept);
                pieces.push(piece);
            }
        }
        let mut samples = Vec::with_capacity(wanted.len() * count);
        for (k, &at) in wanted.iter().enumerate() {
            for (s, p) in positions.iter().enumerate() {
                let id = scratch.id[s * PIXELS + at];
                let inside = |pixel: u32, offset: i32| (pixel as f32 + offset as f32 / 256.0) / step as f32;
                samples.push(Sample {
                    place: [inside(k as u32 % step, p[0]), inside(k as u32 / step, p[1])],
                    depth: scratch.depth[s * PIXELS + at],
                    solid: found.iter().position(|f| *f == (at, id)),
                    layers: Vec::new(),
                });
            }
        }
        if layered {
            // Elsewhere nothing lies in front of what is infinitely near.
            let mut depth = vec![f32::INFINITY; PIXELS * count];
            for at in wanted.iter().flat_map(|at| (0..count).map(move |s| s * PIXELS + at)) {
                depth[at] = scratch.depth[at];
            }
            let mut fragments = Vec::new();
            raster::layered(One, &place, &depth, (f32::MIN_POSITIVE, f32::MAX), usize::MAX, &mut fragments);
            let mut layers = Layers::new(&fragments, positions);
            let from = pieces.len();
            pieces.extend(layers.entries.iter().map(|e| self.piece(&place, e)));
            let colors: Vec<[f32; 4]> = pieces[from..].iter().map(|p| p.color).collect();
            layers.sort(&place);
            for &(at, depth, _, entry) in &layers.order {
                let (s, at) = (at as usize / PIXELS, at as usize % PIXELS);
                if let Some(k) = wanted.iter().position(|w| *w == at) {
                    samples[k * count + s].layers.push((from + entry as usize, f32::from_bits(depth)));
                }
            }
            layers.compose(&colors, &mut scratch.color);
        }
        let mut finish = |format: Format, output: Output| {
            let pass = Pass { format, output, ..*pass };
            let bytes = format.bytes();
            let (column, row) = ((x % side) as usize, (y % side) as usize);
            let mut own = vec![0u8; (column + 1) * bytes];
            let mut rows: Vec<&mut [u8]> = (0..row).map(|_| &mut [][..]).collect();
            rows.push(&mut own);
            tile::finish(One, &pass, &mut scratch, kept, &mut Out { rows, planes: Vec::new() });
            own.split_off(column * bytes)
        };
        let bare = finish(Format::F32, Output { background: Background::Transparent, ..pass.output });
        let linear = finish(Format::F32, pass.output);
        let bytes = finish(pass.format, pass.output);
        let light: [f32; 4] = bytemuck::pod_read_unaligned(&bare);
        let [r, g, b, _] = light;
        Trace {
            pixel: [x, y],
            size: self.size.into(),
            view: self.view,
            supersample: step,
            lamps: self.lights.lamps,
            pieces,
            samples,
            light,
            toned: tile::tone(pass.output.tone_map, Vec3::new(r, g, b)).array(),
            linear,
            bytes,
        }
    }

    fn piece(&self, place: &Place<'_>, e: &Entry) -> Piece<'a> {
        let record = &self.bins.records[(e.id >> 7) as usize];
        let draw = &self.draws[record.draw as usize];
        let meshlet = &draw.mesh.meshlets[record.meshlet as usize];
        let own = Place { target: &self.view.target, bins: self.bins, draws: self.draws, tile: place.tile };
        let group = group(self.pass, self.view, &own, e.id);
        let (ox, oy) = Bins::origin(place.target, place.tile);
        let at = |o: u32, k: u32, offset: f32| (o + k) as f32 + offset;
        let (I1(x), I1(y)) = raster::pixel(I1(i32::from(e.at)));
        let (px, py) = (at(ox, x as u32, e.offset[0]), at(oy, y as u32, e.offset[1]));
        let ids = [e.id; 16];
        let lanes = Lanes { ids: &ids, px, py, active: true };
        let mut triangles = [Triangle::NONE; 16];
        let corners = Corners::new(One, &group, &lanes, &mut triangles);
        let surface = corners.surface(One, &group, Some(&self.lights), &lanes);
        let mut recorder = Recorder::default();
        let color = shade::shade(One, group.look, &self.lights, &surface, &mut recorder).array();
        let early = if group.look.needs_lit() {
            self.single.iter().filter_map(|l| corners.surface(One, &group, Some(l), &lanes).lit).collect()
        } else {
            Vec::new()
        };
        let step = self.pass.supersample as f32;
        Piece {
            instance: group.instance,
            material: record.look as usize,
            look: group.look,
            triangle: draw.mesh.source[meshlet.triangles as usize + (e.id & 127) as usize] as usize,
            class: record.class,
            samples: u32::from(e.samples).count_ones().min(self.view.target.samples),
            place: [px / step, py / step],
            weights: corners.weights,
            depth: corners.depth,
            front: corners.front,
            alpha: shade::alpha(One, group.look, &surface),
            surface,
            early,
            notes: recorder.0,
            color,
        }
    }
}
