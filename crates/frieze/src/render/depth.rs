//! The depth map of a light, as a picture (row 111).

use super::{Pass, RenderOptions, light, looks, shadow_bytes};
use crate::error::{Error, Result};
use crate::image::{Encoding, Image, Pixels};
use crate::prepare::Prepared;
use rayon::prelude::*;
use std::sync::Mutex;

/// What light `number` of the scene sees: its shadow map as a picture of one channel, linear, 0 (black) at the light's
/// near plane, 1 (white) at its far plane and where nothing is. This is forward light depth, the metric of a shadow's
/// `bias`; the map of a directional light is parallel, so it is linear in the distance along the light:
/// `near + depth (far - near)` metres. +Y of the map is up, and the picture has the map's size: size, samples, camera
/// and planes of the options change nothing (row 115).
///
/// # Errors
/// `render.light` when there is no such light, `render.no-shadow-map` when it has none; those of
/// [`frame`](super::frame).
pub fn light_depth(prepared: &Prepared, number: usize, options: &RenderOptions) -> Result<Image> {
    let Some(lamp) = prepared.lights.get(number) else {
        let count = prepared.lights.len();
        return Err(Error::arguments("render.light", format!("there is no light {number}; the scene has {count}")));
    };
    let job = &options.job;
    job.check()?;
    // The map, and the picture beside it.
    let _held = job.reserve(shadow_bytes(prepared).saturating_mul(2), "the depth map of a light")?;
    let map = job.run(|| {
        let looks = looks(prepared);
        let spare = Mutex::new(Vec::new());
        let pass = Pass {
            prepared,
            level: options.level,
            job,
            looks: &looks,
            format: options.format,
            output: prepared.output,
            supersample: 1,
            aovs: &[],
            spare: &spare,
        };
        light::shadow_map(lamp, &pass)
    })?;
    job.check()?;
    let Some((map, _)) = map else {
        return Err(Error::arguments("render.no-shadow-map", format!("light {number} has no shadow map"))
            .remedy("directional lights have one unless the scene says `shadow = false`"));
    };
    let mut values = vec![0.0f32; map.size as usize * map.size as usize];
    job.run(|| {
        values.par_chunks_mut(map.size as usize).enumerate().for_each(|(y, row)| {
            for (x, v) in row.iter_mut().enumerate() {
                *v = 1.0 - map.texel(x as u32, y as u32);
            }
        });
    });
    Image::new(map.size, map.size, 1, Pixels::F32(values), Encoding::Linear)
}
