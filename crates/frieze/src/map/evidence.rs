//! What a picture of normals says about itself: which space, which way green points, how many channels, which
//! curve, which flat code, unit lengths, whether it tiles, banding. Every answer comes with a confidence and the
//! numbers behind it (rows 49 and 53).
//!
//! A confidence is meant as a share: of a hundred answers given with 0.9, some ninety are right. Below
//! [`THRESHOLD`] nothing should be changed without a person's word.

mod curl;
mod survey;

use crate::error::Result;
use crate::image::{Image, Pixels};
use crate::job::Job;
use serde::Serialize;

pub(crate) use survey::{CurveKind, Reading, says};

/// From this confidence on, a repair may be made without asking.
pub const THRESHOLD: f32 = 0.9;

/// Everything that can be told from the texels alone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Evidence {
    /// How sure it is that this is a normal map at all, 0 to 1.
    pub likeness: f32,
    /// Which space the vectors live in.
    pub space: Space,
    /// Which way green points.
    pub green: Green,
    /// Where x, y and z are.
    pub layout: Layout,
    /// Whether a colour curve was put over the numbers.
    pub curve: Curve,
    /// Which code means zero.
    pub neutral: Neutral,
    /// Whether the vectors have length 1.
    pub length: Length,
    /// Whether opposite edges meet.
    pub tiles: Tiles,
    /// Whether there are fewer steps than the file could hold.
    pub banding: Banding,
}

/// Which space the vectors live in.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Space {
    /// `tangent`, `object` (or world: without the model's pose they look the same) or `unknown`.
    pub value: &'static str,
    /// 0 to 1.
    pub confidence: f32,
    /// Share of the vectors that point into the surface, of those that lean.
    pub behind: f32,
    /// Mean vector: long and along +z in tangent space, short or along any axis in object space.
    pub mean: [f32; 3],
}

/// Which way green points, by integrability: slopes (p, q) of a height have `dp/dy = dq/dx` (Frankot and Chellappa
/// 1988), and the wrong reading of green turns the sign of one side.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Green {
    /// `up` (+Y, OpenGL, glTF), `down` (-Y, DirectX) or `unknown`: flat, grooves along one axis, noise, not in
    /// tangent space.
    pub value: &'static str,
    /// 0 to 1.
    pub confidence: f32,
    /// Correlation of `dp/dy` with `dq/dx` if green points up: 1 for the slopes of a surface, -1 for the same
    /// with green turned, 0 for noise.
    pub correlation: f32,
    /// How many standard deviations this is from no correlation, over independent places of the map.
    pub significance: f32,
    /// Pixels of the map that one value of the scale that told most covers along an edge: 1, 2, 4, ...
    pub scale: u32,
}

/// Where x, y and z are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Layout {
    /// `xyz`, `xy` (blue is missing or constant) or `ag` (x in alpha, y in green: DXT5nm).
    pub value: &'static str,
    /// 0 to 1.
    pub confidence: f32,
    /// Standard deviation of the stored z.
    pub z_spread: f32,
    /// Standard deviation of the z that x and y ask for.
    pub rebuilt_spread: f32,
}

/// Whether a colour curve was put over the numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Curve {
    /// `linear` (as it should be), `srgb-encoded` (flat is 188, as if the numbers were light) or `srgb-decoded`
    /// (flat is 55: the numbers were taken for sRGB and made linear), or `unknown`.
    pub value: &'static str,
    /// 0 to 1.
    pub confidence: f32,
    /// Median of red and green, 0 to 1: 0.502 when linear, 0.737 encoded, 0.216 decoded.
    pub median: [f32; 2],
    /// Median distance of lengths from 1, read as linear, with the encoding undone, with the decoding undone.
    pub length_error: [f32; 3],
}

/// Which code means zero: n bits have none in the middle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Neutral {
    /// `128` (rounded up), `127` (rounded down), `mixed` (red and green differ, as after `255 - green`), `exact`
    /// (floats at 0.5 or 0), or `unknown` (nothing is flat).
    pub value: &'static str,
    /// 0 to 1.
    pub confidence: f32,
    /// The flat code of red and green in the file's own steps (8 bits: 127 or 128); 0 when unknown.
    pub codes: [u32; 2],
    /// Share of the texels that have it, for red and green.
    pub share: [f32; 2],
}

/// Whether the vectors have length 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Length {
    /// `unit`, `off`, or `unknown` where z is rebuilt.
    pub value: &'static str,
    /// 0 to 1.
    pub confidence: f32,
    /// Share of the texels that are more than 0.03 off.
    pub off_share: f32,
    /// Mean distance from 1.
    pub mean_error: f32,
    /// Nineteen of twenty texels are nearer to 1.
    pub p95_error: f32,
    /// Median length.
    pub median: f32,
}

/// Whether opposite edges meet. Whether they are meant to, no picture tells.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tiles {
    /// `tiles`, `seam-x` (left and right don't meet), `seam-y`, `seam-xy` or `unknown`.
    pub value: &'static str,
    /// 0 to 1.
    pub confidence: f32,
    /// Squared step from the last column to the first over the most that neighbouring columns differ inside; and of
    /// rows.
    pub step: [f32; 2],
}

/// Whether there are fewer steps than the file could hold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Banding {
    /// `none`, `8-in-16` (sixteen bits that hold eight), `steps` (slopes take few values, as from heights of 8
    /// bits, or bevels of one slope) or `unknown`.
    pub value: &'static str,
    /// 0 to 1.
    pub confidence: f32,
    /// Different values of red and of green among those looked at.
    pub levels: [u32; 2],
    /// How many codes of 8 bits they span.
    pub span: [f32; 2],
}

/// Looks at a picture as a normal map. Only the first three or four channels count.
///
/// # Errors
/// `job.interrupted`, `job.memory`.
pub fn gather(image: &Image, job: &Job) -> Result<Evidence> {
    let survey = survey::Survey::of(image, job)?;
    let (curve, reading) = survey.curve();
    let space = survey.space(&reading);
    let layout = survey.layout(&reading);
    let tangent = space.value != "object";
    let green = if tangent { curl::green(image, &reading, job)? } else { Green::unknown() };
    Ok(Evidence {
        likeness: survey.likeness(&reading, &space),
        space,
        green,
        layout,
        curve,
        neutral: survey.neutral(&reading),
        length: survey.length(&reading),
        tiles: curl::tiles(image, &reading, job)?,
        banding: survey.banding(),
    })
}

/// The vectors of a map, row after row, of unit length where they have one, read as the evidence says; green as it is.
pub(crate) fn vectors(image: &Image, e: &Evidence) -> Vec<[f32; 3]> {
    let curve = match e.curve.value {
        "srgb-encoded" => CurveKind::Encoded,
        "srgb-decoded" => CurveKind::Decoded,
        _ => CurveKind::Linear,
    };
    let (xy, z) = match e.layout.value {
        "ag" => ([3, 1], None),
        "xy" => ([0, 1], None),
        _ => ([0, 1], Some(2)),
    };
    let reading = Reading::new(image, (xy, z), curve, crate::image::diff::is_signed(image));
    let mut all = Vec::with_capacity(image.width() as usize * image.height() as usize);
    let mut row = Vec::new();
    for y in 0..image.height() {
        reading.row(image, y, &mut row);
        all.extend(row.iter().map(|v| {
            let l = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
            if l > 1e-6 { v.map(|x| x / l) } else { [0.0, 0.0, 1.0] }
        }));
    }
    all
}

impl Green {
    pub(crate) fn unknown() -> Green {
        Green { value: "unknown", confidence: 0.0, correlation: 0.0, significance: 0.0, scale: 1 }
    }
}

/// The largest code of integers, 255 for floats.
pub(crate) fn most(image: &Image) -> f32 {
    if matches!(image.pixels(), Pixels::U16(_)) { 65535.0 } else { 255.0 }
}

/// 0 below `a`, 1 above `b`, straight between.
pub(crate) fn ramp(x: f64, a: f64, b: f64) -> f64 {
    let t = (x - a) / (b - a);
    if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) }
}
