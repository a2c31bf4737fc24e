//! Mends normal maps: what is asked for, or what [`crate::map::evidence`] is sure of.

use crate::error::{Error, Finding, Result};
use crate::image::{Encoding, Image, Pixels};
use crate::job::Job;
use crate::map::evidence::{self, CurveKind, Evidence, Reading, THRESHOLD, says};
use half::f16;
use rayon::prelude::*;
use serde::Serialize;

/// What can be mended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fix {
    /// Green turned: +Y into -Y and back. Flat texels stay the same code.
    FlipY,
    /// A colour curve undone.
    Srgb,
    /// Vectors made of unit length.
    Normalize,
    /// The flat code made 128 (8 bits), 32768 (16 bits).
    Neutral,
    /// Z made from x and y, which lie in red and green or in alpha and green.
    RebuildZ,
    /// Opposite edges made to meet: what they differ by is spread over a band at both.
    Seams,
}

impl Fix {
    /// All, with their words.
    pub const ALL: [(&'static str, Fix); 6] = [
        ("flip-y", Fix::FlipY),
        ("srgb", Fix::Srgb),
        ("normalize", Fix::Normalize),
        ("neutral", Fix::Neutral),
        ("rebuild-z", Fix::RebuildZ),
        ("seams", Fix::Seams),
    ];
    /// Its word.
    pub fn name(self) -> &'static str {
        Fix::ALL.iter().find(|(_, f)| *f == self).map_or("", |(name, _)| name)
    }
}

/// What to mend.
#[derive(Clone, Debug)]
pub struct Options {
    /// These, whatever the map looks like.
    pub fixes: Vec<Fix>,
    /// And whatever is found wrong with at least `threshold` confidence. The result is +Y.
    pub auto: bool,
    /// From 0 to 1; [`THRESHOLD`] by default.
    pub threshold: f32,
    /// Threads, memory, cancelling.
    pub job: Job,
}

impl Default for Options {
    fn default() -> Self {
        Options { fixes: Vec::new(), auto: false, threshold: THRESHOLD, job: Job::default() }
    }
}

/// One thing that was mended, and why.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Step {
    /// As in [`Fix::ALL`].
    pub fix: &'static str,
    /// How sure it was that this was wrong, 0 to 1.
    pub confidence: f32,
    /// Asked for, or found.
    pub asked: bool,
    /// The numbers.
    pub why: String,
}

/// A mended map.
#[derive(Clone, Debug)]
pub struct Repaired {
    /// The map, as deep as it was. Vectors have three channels, and alpha if it held none of them.
    pub image: Image,
    /// What was done; empty when nothing was wrong.
    pub steps: Vec<Step>,
    /// What was left alone for want of certainty, or done against the evidence.
    pub findings: Vec<Finding>,
    /// What the map looked like before.
    pub before: Evidence,
}

/// How sure the evidence is that this needs to be mended (0 when it speaks against it), and its numbers.
fn need(fix: Fix, e: &Evidence) -> (f32, String) {
    match fix {
        Fix::FlipY => {
            let why = format!(
                "green points {}: dp/dy and dq/dx agree by {:.2}, {:.1} deviations",
                e.green.value, e.green.correlation, e.green.significance
            );
            (if e.green.value == "down" { e.green.confidence } else { 0.0 }, why)
        }
        Fix::Srgb => {
            let why = format!("{}: red and green have their middle at {:?} of 1", e.curve.value, e.curve.median);
            (if e.curve.value.starts_with("srgb") { e.curve.confidence } else { 0.0 }, why)
        }
        Fix::Normalize => {
            let why = format!(
                "{:.0} % of the vectors are more than 0.03 off unit length, median {:.3}",
                e.length.off_share * 100.0,
                e.length.median
            );
            (if e.length.value == "off" { e.length.confidence } else { 0.0 }, why)
        }
        Fix::Neutral => {
            let why = format!("flat ground has the codes {:?}", e.neutral.codes);
            (if matches!(e.neutral.value, "127" | "mixed") { e.neutral.confidence } else { 0.0 }, why)
        }
        Fix::RebuildZ => {
            let why = format!(
                "layout {}: z moves by {:.4}, x and y ask for {:.4}",
                e.layout.value, e.layout.z_spread, e.layout.rebuilt_spread
            );
            (if e.layout.value == "xyz" { 0.0 } else { e.layout.confidence }, why)
        }
        Fix::Seams => {
            let why = format!("{}: the step across is {:?} of the largest inside", e.tiles.value, e.tiles.step);
            (if e.tiles.value.starts_with("seam") { e.tiles.confidence } else { 0.0 }, why)
        }
    }
}

/// Mends a normal map.
///
/// `auto` never touches seams, as no picture tells whether it is meant to tile, and turns only maps that are in
/// tangent space. What seems wrong below the threshold becomes a `repair.unsure` finding.
///
/// # Errors
/// `repair.not-normals` when `auto` is asked for a picture that does not look like a normal map,
/// `repair.channels` for one channel, `job.memory`, `job.interrupted`.
pub fn repair(image: &Image, options: &Options) -> Result<Repaired> {
    if image.channels() == 1 {
        return Err(Error::input("repair.channels", "the picture has one channel, a normal map two at least")
            .remedy("for heights use `frieze convert --to normal`"));
    }
    let e = evidence::gather(image, &options.job)?;
    if options.auto && e.likeness < 0.5 {
        return Err(Error::input(
            "repair.not-normals",
            format!("this does not look like a normal map (likeness {:.2}), so nothing is mended unasked", e.likeness),
        )
        .remedy("name what is to be mended: --fix flip-y,srgb,normalize,neutral,rebuild-z,seams"));
    }
    let mut steps = Vec::new();
    let mut findings = Vec::new();
    let mut wanted = Vec::new();
    for (name, fix) in Fix::ALL {
        let (confidence, why) = need(fix, &e);
        let asked = options.fixes.contains(&fix);
        let sure = confidence >= options.threshold && fix != Fix::Seams;
        if asked || options.auto && sure {
            if asked
                && confidence == 0.0
                && matches!(fix, Fix::FlipY | Fix::Srgb | Fix::RebuildZ)
                && contradicts(fix, &e)
            {
                findings.push(Finding::warning(
                    "repair.doubtful",
                    format!("{name} was asked for, and the map did not seem to need it: {why}"),
                    "done as asked; `frieze inspect` shows the evidence",
                ));
            }
            wanted.push(fix);
            steps.push(Step { fix: name, confidence, asked, why });
        } else if options.auto && confidence >= 0.5 {
            let reason = if fix == Fix::Seams { "whether it should tile is not known" } else { "not sure enough" };
            findings.push(Finding::note(
                "repair.unsure",
                format!("{name} may be needed, confidence {:.0} %: {why}", confidence * 100.0),
                format!("left alone, {reason}; ask for it with --fix {name}"),
            ));
        }
    }
    if options.auto && e.green.value == "unknown" && e.space.value != "object" {
        findings.push(Finding::note(
            "repair.undecided",
            "which way green points cannot be told from this map: flat, or grooves along one axis, or noise",
            "left as it is; if bumps look like dents, --fix flip-y",
        ));
    }
    let image = apply(image, &wanted, &e, &options.job)?;
    Ok(Repaired { image, steps, findings, before: e })
}

/// Whether the evidence is sure of the opposite.
fn contradicts(fix: Fix, e: &Evidence) -> bool {
    match fix {
        Fix::FlipY => e.green.value == "up" && e.green.confidence >= THRESHOLD,
        Fix::Srgb => e.curve.value == "linear" && e.curve.confidence >= THRESHOLD,
        _ => e.layout.value == "xyz" && e.layout.confidence >= THRESHOLD,
    }
}

/// Does the fixes, in an order that makes sense whatever order they were asked in.
fn apply(image: &Image, fixes: &[Fix], e: &Evidence, job: &Job) -> Result<Image> {
    if fixes.is_empty() {
        return Ok(image.clone());
    }
    let has = |f| fixes.contains(&f);
    let curve = match (has(Fix::Srgb), e.curve.value) {
        (false, _) => CurveKind::Linear,
        (true, "srgb-decoded") => CurveKind::Decoded,
        (true, _) => CurveKind::Encoded,
    };
    let rebuild = has(Fix::RebuildZ) || image.channels() == 2;
    let ag = e.layout.value == "ag";
    let xy = if ag && rebuild { [3, 1] } else { [0, 1] };
    let signed = crate::image::diff::is_signed(image);
    let reading = Reading::new(image, (xy, if rebuild { None } else { Some(2) }), curve, signed);
    // The component that flat ground has, where it is known.
    let most = evidence::most(image);
    let float = matches!(image.pixels(), Pixels::F16(_) | Pixels::F32(_));
    let flat = |k: usize| {
        let known = e.neutral.value != "unknown" && !float && curve == CurveKind::Linear;
        if known { reading.component(e.neutral.codes[k] as f32 / most) } else { 0.0 }
    };
    let zero = [flat(0), flat(1)];
    let alpha = image.channels() == 4 && !ag;
    let channels = if alpha { 4 } else { 3 };
    let (w, h) = (image.width() as usize, image.height() as usize);
    let _room = job.reserve(w as u64 * h as u64 * 16, "the mended map")?;
    let mut out = vec![[0.0f32; 4]; w * h];
    job.run(|| {
        out.par_chunks_exact_mut(w).enumerate().for_each_init(Vec::new, |row, (y, out)| {
            reading.row(image, y as u32, row);
            for (x, (v, out)) in row.iter().zip(out).enumerate() {
                let raw = |c| image.value(x as u32, y as u32, c);
                let a = if alpha { raw(3) } else { 1.0 };
                let empty = !signed && !rebuild && raw(0) == 0.0 && raw(1) == 0.0 && raw(2) == 0.0;
                let mut n = if empty { [-1.0; 3] } else { *v };
                if !empty {
                    mend(&mut n, zero, &has);
                }
                *out = [n[0], n[1], n[2], a];
            }
        });
    });
    job.check()?;
    if has(Fix::Seams) {
        close(&mut out, w, h, e);
    }
    let code = |v: f32| if signed { v } else { v * 0.5 + 0.5 };
    let integer = |v: f32, most: f32| (v.clamp(0.0, 1.0) * most + 0.5).floor();
    let values = out.iter().flat_map(|t| {
        let t = [code(t[0]), code(t[1]), code(t[2]), t[3]];
        t.into_iter().take(channels)
    });
    let pixels = match image.pixels() {
        Pixels::U8(_) => Pixels::U8(values.map(|v| integer(v, 255.0) as u8).collect()),
        Pixels::U16(_) => Pixels::U16(values.map(|v| integer(v, 65535.0) as u16).collect()),
        Pixels::F16(_) => Pixels::F16(values.map(f16::from_f32).collect()),
        Pixels::F32(_) => Pixels::F32(values.collect()),
    };
    Image::new(image.width(), image.height(), channels as u8, pixels, Encoding::Linear)
}

/// The fixes that one texel suffices for.
fn mend(n: &mut [f32; 3], zero: [f32; 2], has: &impl Fn(Fix) -> bool) {
    let mut middle = zero[1];
    if has(Fix::Neutral) {
        *n = [n[0] - zero[0], n[1] - zero[1], n[2]];
        middle = 0.0;
    }
    if has(Fix::FlipY) {
        // About the flat code, so that flat ground stays the code it is: 255 - 128 would be 127.
        n[1] = 2.0 * middle - n[1];
    }
    if has(Fix::Normalize) {
        let l = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
        *n = if l > 1e-6 { n.map(|v| v / l) } else { [0.0, 0.0, 1.0] };
    }
}

/// Spreads half of what opposite edges differ by over a band at each, along x, then along y; the vectors keep their
/// lengths. Edges that meet stay as they are.
fn close(out: &mut [[f32; 4]], w: usize, h: usize, e: &Evidence) {
    let both = e.tiles.value == "unknown";
    for (axis, word) in [(0, "x"), (1, "y")] {
        let (along, lines) = if axis == 0 { (w, h) } else { (h, w) };
        if along < 4 || !both && !e.tiles.value.strip_prefix("seam-").is_some_and(|s| s.contains(word)) {
            continue;
        }
        let band = (along / 8).clamp(1, 64);
        let place = |i: usize, line: usize| if axis == 0 { line * w + i } else { i * w + line };
        for line in 0..lines {
            let (first, last) = (out[place(0, line)], out[place(along - 1, line)]);
            let half: [f32; 3] = core::array::from_fn(|k| (last[k] - first[k]) * 0.5);
            for i in 0..band {
                let t = 1.0 - i as f32 / band as f32;
                let ease = t * t * (3.0 - 2.0 * t);
                for (at, sign) in [(place(i, line), 1.0), (place(along - 1 - i, line), -1.0)] {
                    let v = [out[at][0], out[at][1], out[at][2]];
                    if !says(v) {
                        continue;
                    }
                    let moved: [f32; 3] = core::array::from_fn(|k| v[k] + sign * ease * half[k]);
                    let (old, new) = (size(v), size(moved));
                    if new > 1e-6 {
                        (0..3).for_each(|k| out[at][k] = moved[k] * (old / new));
                    }
                }
            }
        }
    }
}

fn size(v: [f32; 3]) -> f32 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(fixes: &[Fix]) -> Options {
        Options { fixes: fixes.to_vec(), ..Options::default() }
    }

    fn map(channels: u8, texels: &[u8]) -> Image {
        let n = texels.len() / usize::from(channels);
        Image::new(n as u32, 1, channels, Pixels::U8(texels.to_vec()), Encoding::Linear).unwrap()
    }

    fn bytes(image: &Image) -> &[u8] {
        match image.pixels() {
            Pixels::U8(v) => v,
            _ => panic!("8 bits"),
        }
    }

    #[test]
    fn flip_keeps_flat_ground_flat_and_twice_is_once_less() {
        let mut texels = [128, 128, 255].repeat(60);
        texels.extend([100, 200, 200, 140, 20, 190]);
        let m = map(3, &texels);
        let once = repair(&m, &asked(&[Fix::FlipY])).unwrap().image;
        assert_eq!(&bytes(&once)[..3], [128, 128, 255]);
        // 256 - 200 and 256 - 20.
        assert_eq!(&bytes(&once)[180..], [100, 56, 200, 140, 236, 190]);
        assert_eq!(bytes(&repair(&once, &asked(&[Fix::FlipY])).unwrap().image), bytes(&m));
    }

    #[test]
    fn neutral_makes_127_128_and_z_is_rebuilt_and_lengths_are_one() {
        let m = map(3, &[127, 127, 255].repeat(64));
        let r = repair(&m, &asked(&[Fix::Neutral])).unwrap();
        assert_eq!(&bytes(&r.image)[..3], [128, 128, 255]);
        let m = map(3, &[204, 128, 0, 128, 128, 0]);
        // x = 0.6, so z = 0.8 and its code 229.5 or 230 by half a code of y.
        let r = repair(&m, &asked(&[Fix::RebuildZ])).unwrap();
        assert!(bytes(&r.image)[2].abs_diff(230) <= 1 && bytes(&r.image)[5] == 255, "{:?}", r.image);
        let m = map(3, &[204, 128, 255, 0, 0, 0]);
        let r = repair(&m, &asked(&[Fix::Normalize])).unwrap();
        let n: Vec<f32> = bytes(&r.image)[..3].iter().map(|c| f32::from(*c) / 127.5 - 1.0).collect();
        // A code is 0.008.
        assert!((size([n[0], n[1], n[2]]) - 1.0).abs() < 0.008, "{n:?}");
        assert_eq!(&bytes(&r.image)[3..], [0, 0, 0], "what is empty stays empty");
    }

    #[test]
    fn what_is_no_normal_map_is_refused_unless_asked() {
        let grey = map(3, &[90; 300]);
        let auto = Options { auto: true, ..Options::default() };
        assert_eq!(repair(&grey, &auto).unwrap_err().code, "repair.not-normals");
        assert_eq!(repair(&map(1, &[90; 30]), &auto).unwrap_err().code, "repair.channels");
        assert_eq!(repair(&grey, &asked(&[Fix::FlipY])).unwrap().steps.len(), 1);
        // Nothing asked, nothing done.
        assert_eq!(repair(&grey, &asked(&[])).unwrap().image, grey);
    }

    #[test]
    fn seams_close() {
        let (w, h) = (64u32, 48u32);
        let texels: Vec<u8> = (0..w * h).flat_map(|k| [96 + (k % w) as u8, 90 + (k / w) as u8, 240]).collect();
        let m = Image::new(w, h, 3, Pixels::U8(texels), Encoding::Linear).unwrap();
        let r = repair(&m, &asked(&[Fix::Seams])).unwrap();
        let v = bytes(&r.image);
        for y in 0..h {
            let (a, b) = ((y * w * 3) as usize, ((y * w + w - 1) * 3) as usize);
            // Both are the mean of what they were, made as long as before: a code or two apart.
            assert!(v[a].abs_diff(v[b]) <= 4, "{y}: {} {}", v[a], v[b]);
        }
        // The middle is untouched.
        let middle = ((h / 2 * w + w / 2) * 3) as usize;
        assert_eq!(v[middle], 96 + 32);
    }
}
