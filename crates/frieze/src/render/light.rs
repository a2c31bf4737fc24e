//! Shadow maps: the scene as a light sees it, drawn anew for every frame.

use super::Pass;
use super::tile::Holes;
use crate::error::Result;
use crate::map::shadow::{Offset, ShadowMap};
use crate::math::lane::{Kernel, Lane};
use crate::math::vec::{Mat4, Vec3};
use crate::prepare::{View, world_to_picture};
use crate::raster::geometry::Class;
use crate::raster::tile::{self, PIXELS, Place};
use crate::raster::{Bins, TILE, Target};
use crate::scene::camera::Lens;
use crate::scene::{Bias, Light, LightKind, Shadow, ShadowFilter, ShadowWrap};
use rayon::prelude::*;

/// Where a light's shadow map looks.
#[derive(Clone, Copy, Debug)]
struct Frustum {
    eye: Vec3,
    /// Right, up, back.
    axes: [Vec3; 3],
    extent: f64,
    near: f64,
    far: f64,
}

impl Frustum {
    /// As the scene says it, the rest fitted to the scene's bounds.
    fn new(light: &Light, shadow: &Shadow, corners: &[Vec3]) -> Self {
        let back = -light.direction.normalize();
        let up = if back.x.abs() < 1e-3 && back.z.abs() < 1e-3 {
            Vec3::new(0.0, 0.0, -1.0)
        } else {
            Vec3::new(0.0, 1.0, 0.0)
        };
        let right = up.cross(back).normalize();
        let axes = [right, back.cross(right), back];
        let center = corners.iter().fold(Vec3::splat(0.0), |sum, &p| sum + p * (1.0 / corners.len().max(1) as f32));
        // What is given is measured from the light's position; a wholly fitted frustum is centred on the scene.
        let given = shadow.extent.is_some() || shadow.near.is_some() || shadow.far.is_some();
        let mut eye = if given { light.position } else { center };
        let range = |axis: Vec3, eye: Vec3| {
            let at = |p: &Vec3| f64::from((*p - eye).dot(axis));
            corners.iter().map(at).fold((f64::MAX, f64::MIN), |(lo, hi), v| (lo.min(v), hi.max(v)))
        };
        let half = |axis: Vec3, eye: Vec3| {
            let (lo, hi) = range(axis, eye);
            lo.abs().max(hi.abs())
        };
        if corners.is_empty() {
            return Frustum { eye, axes, extent: 1.0, near: 0.0, far: 1.0 };
        }
        if !given {
            let middle = |axis: Vec3| {
                let (lo, hi) = range(axis, center);
                axis * ((lo + hi) * 0.5) as f32
            };
            eye = center + middle(axes[0]) + middle(axes[1]);
        }
        let (lo, hi) = range(-back, eye);
        let slack = (hi - lo).abs() * 0.01 + 1e-6;
        let near = shadow.near.map_or(lo - slack, f64::from);
        let far = shadow.far.map_or(hi + slack, f64::from).max(near + 1e-6);
        let fitted = half(axes[0], eye).max(half(axes[1], eye)) * 1.01 + 1e-6;
        Frustum { eye, axes, extent: shadow.extent.map_or(fitted, f64::from), near, far }
    }
}

/// The corners of the box that a directional light's shadow map sees, world space; bits 1, 2 and 4 of a corner's number
/// tell right, up and far. `None` for lights that have no map.
pub(super) fn frustum(light: &Light, pass: &Pass<'_>) -> Option<[Vec3; 8]> {
    let shadow = light.shadow.as_ref().filter(|_| light.kind == LightKind::Directional)?;
    let f = Frustum::new(light, shadow, &pass.prepared.corners());
    let [right, up, back] = f.axes;
    Some(core::array::from_fn(|k| {
        let pick = |bit: usize, lo: f64, hi: f64| (if k & bit == 0 { lo } else { hi }) as f32;
        let across = right * pick(1, -f.extent, f.extent) + up * pick(2, -f.extent, f.extent);
        f.eye + across - back * pick(4, f.near, f.far)
    }))
}

/// Texels along each side of a map that is asked to have `size`.
pub(super) fn side(size: u32) -> u32 {
    size.clamp(1, 8192)
}

/// Draws the shadow map of a directional light; `None` for lights whose shadows need another projection.
pub(super) fn shadow_map(light: &Light, pass: &Pass<'_>) -> Result<Option<(ShadowMap, Bins)>> {
    let (Some(shadow), LightKind::Directional) = (&light.shadow, light.kind) else { return Ok(None) };
    let frustum = Frustum::new(light, shadow, &pass.prepared.corners());
    let size = side(shadow.size);
    let radius = match shadow.filter {
        ShadowFilter::Hard => 0,
        ShadowFilter::Pcf { radius } => radius.min(16),
    };
    let e = frustum.extent;
    let step = 2.0 * e / f64::from(size);
    let lens = Lens { a: [step, -step], b: [-e, e], parallel: true, near: frustum.near, far: frustum.far };
    let matrix = world_to_picture(&lens, frustum.eye, frustum.axes);
    let target = Target { width: size, height: size, samples: 1, matrix };
    let [right, up, back] = frustum.axes;
    let view = View { target, eye: frustum.eye, axes: [right, up, -back], lens, turn: Mat4::IDENTITY };
    let draws = pass.draws(&view, true);
    let bins = Bins::new(pass.level, &view.target, &draws, pass.spare);
    let (stride, rows) = (ShadowMap::stride(size, radius) as usize, ShadowMap::rows(size, radius) as usize);
    let margin = ShadowMap::margin(radius) as usize;
    let mut texels = vec![0.0f32; stride * rows];
    // The rows of each tile, so that tiles write side by side.
    let (across, _) = view.target.tiles();
    let mut tiles: Vec<Vec<&mut [f32]>> = Vec::new();
    let inner = &mut texels[margin * stride..(margin + size as usize) * stride];
    for band in inner.chunks_mut(TILE as usize * stride) {
        let first = tiles.len();
        tiles.extend((0..across).map(|_| Vec::with_capacity(TILE as usize)));
        for row in band.chunks_mut(stride) {
            let row = &mut row[margin..margin + size as usize];
            for (k, part) in row.chunks_mut(TILE as usize).enumerate() {
                tiles[first + k].push(part);
            }
        }
    }
    tiles.into_par_iter().enumerate().with_max_len(1).for_each(|(k, rows)| {
        if !bins.tile(k as u32).is_empty() && !pass.job.is_cancelled() {
            let place = Place { target: &view.target, bins: &bins, draws: &draws, tile: k as u32 };
            pass.level.run(Draw { place, rows, pass, view: &view });
        }
    });
    let offset = match shadow.bias {
        Bias::Value(b) => Offset::Constant(b),
        Bias::Auto => Offset::Slope { axes: frustum.axes, texel: (step / (frustum.far - frustum.near)) as f32 },
    };
    let repeat = shadow.wrap == ShadowWrap::Repeat;
    Ok(Some((ShadowMap { matrix, size, texels, radius, offset, repeat }, bins)))
}

struct Draw<'a, 'b> {
    place: Place<'a>,
    rows: Vec<&'b mut [f32]>,
    pass: &'a Pass<'a>,
    view: &'a View,
}

impl Kernel for Draw<'_, '_> {
    type Out = ();
    #[inline(always)]
    fn run<L: Lane>(self, l: L) {
        let mut depth = [0.0f32; PIXELS];
        let cuts = self
            .place
            .bins
            .tile(self.place.tile)
            .iter()
            .any(|e| e.mask != 0 && self.place.bins.records[e.what as usize].class == Class::Cut);
        if cuts {
            let mut cut = Holes { place: self.place, pass: self.pass, view: self.view };
            tile::solid::<L, _, false>(l, &self.place, &mut cut, &mut depth, &mut []);
        } else {
            tile::solid::<L, _, false>(l, &self.place, &mut tile::Uncut, &mut depth, &mut []);
        }
        for (y, row) in self.rows.into_iter().enumerate() {
            tile::copy_row(bytemuck::cast_slice(&depth), y as u32, bytemuck::cast_slice_mut(row));
        }
    }
}
