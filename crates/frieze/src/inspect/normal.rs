//! What is in a normal map, and what is wrong with it: the evidence of [`crate::map::evidence`] in words.

use crate::error::{Finding, Result};
use crate::image::Image;
use crate::job::Job;
use crate::map::evidence::{self, Evidence};
use serde::Serialize;

/// What is in a normal map.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NormalReport {
    /// `up` (+Y, OpenGL, glTF), `down` (-Y, DirectX) or `unknown`.
    pub green: &'static str,
    /// How sure `green` is, 0 to 1.
    pub confidence: f32,
    /// Mean distance of the vectors' lengths from 1.
    pub length_error: f32,
    /// Every answer with its confidence and its numbers.
    pub evidence: Evidence,
}

/// From this likeness on, a picture of unknown use is taken for a normal map.
pub(super) const LIKE: f32 = 0.5;
/// Below this likeness, a picture that is used as a normal map is called odd.
pub(super) const ODD: f32 = 0.3;

/// Looks at a picture as a normal map.
///
/// # Errors
/// `job.interrupted`, `job.memory`.
pub fn normals(image: &Image, job: &Job) -> Result<NormalReport> {
    let evidence = evidence::gather(image, job)?;
    Ok(NormalReport {
        green: evidence.green.value,
        confidence: evidence.green.confidence,
        length_error: evidence.length.mean_error,
        evidence,
    })
}

/// What is wrong with a normal map, as far as that is more likely than not. Which way green points is no fault;
/// neither are edges that don't meet, as nobody knows whether they should.
pub fn findings(report: &NormalReport) -> Vec<Finding> {
    let e = &report.evidence;
    let sure = |c: f32| format!("confidence {:.0} %", c * 100.0);
    let mut out = Vec::new();
    if e.curve.value.starts_with("srgb") && e.curve.confidence >= 0.6 {
        let how = if e.curve.value == "srgb-encoded" { "encoded as sRGB" } else { "decoded as if it were sRGB" };
        let [r, g] = e.curve.median.map(|m| m * 255.0);
        out.push(Finding::warning(
            "normal.srgb",
            format!(
                "the map was {how}: the middle of red and green is ({r:.0}, {g:.0}), not 128 ({})",
                sure(e.curve.confidence)
            ),
            "every normal leans; export it as non-colour data, or mend it with `frieze convert --fix srgb`",
        ));
    }
    if e.layout.value != "xyz" && e.layout.confidence >= 0.6 {
        let what = if e.layout.value == "ag" { "x in alpha and y in green" } else { "x and y only" };
        out.push(Finding::note(
            "normal.two-channel",
            format!("the map holds {what} ({})", sure(e.layout.confidence)),
            "z must be rebuilt: set channels = 2 in a scene file, or `frieze convert --fix rebuild-z`",
        ));
    }
    if e.length.value == "off" && e.length.confidence >= 0.6 {
        out.push(Finding::note(
            "normal.length",
            format!(
                "{:.0} % of the vectors are not of unit length (median {:.3}, one of twenty is {:.3} off; {})",
                e.length.off_share * 100.0,
                e.length.median,
                e.length.p95_error,
                sure(e.length.confidence)
            ),
            "lighting differs between programs that normalise and those that don't: `frieze convert --fix normalize`",
        ));
    }
    if matches!(e.neutral.value, "127" | "mixed") && e.neutral.confidence >= 0.6 {
        let [r, g] = e.neutral.codes;
        out.push(Finding::note(
            "normal.neutral",
            format!("flat ground is ({r}, {g}), one code below the usual one ({})", sure(e.neutral.confidence)),
            "it meets maps with the usual code in a faint seam: `frieze convert --fix neutral`",
        ));
    }
    if e.banding.value == "8-in-16" && e.banding.confidence >= 0.6 {
        let levels = e.banding.levels[0].max(e.banding.levels[1]);
        out.push(Finding::note(
            "normal.banding",
            format!("the file has 16 bits and its numbers 8: {levels} values ({})", sure(e.banding.confidence)),
            "gradients show steps; export again with 16 bits from the source",
        ));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Encoding, Pixels};

    #[test]
    fn flat_maps_and_tiny_ones_are_undecided_and_nothing_is_said_against_them() {
        for (w, h) in [(1, 1), (2, 3), (8, 8), (64, 1)] {
            let pixels = Pixels::U8([128, 128, 255].repeat(w * h));
            let flat = Image::new(w as u32, h as u32, 3, pixels, Encoding::Linear).unwrap();
            let r = normals(&flat, &Job::default()).unwrap();
            assert_eq!(r.green, "unknown", "{r:?}");
            assert!(findings(&r).is_empty(), "{:?}", findings(&r));
        }
        // No number at all.
        let none = Image::new(9, 9, 3, Pixels::F32(vec![f32::NAN; 243]), Encoding::Linear).unwrap();
        let r = normals(&none, &Job::default()).unwrap();
        assert!(r.green == "unknown" && r.evidence.likeness == 0.0 && r.length_error == 0.0, "{r:?}");
    }
}
