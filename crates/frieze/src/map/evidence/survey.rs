//! What single texels tell: curve, layout, space, lengths, the flat code, levels.

use super::{Banding, Curve, Layout, Length, Neutral, Space, most, ramp};
use crate::error::Result;
use crate::image::color::{linear_to_srgb, srgb_to_linear};
use crate::image::diff::is_signed;
use crate::image::{Image, Pixels};
use crate::job::Job;

/// Which curve lies over the numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CurveKind {
    Linear,
    Encoded,
    Decoded,
}

const CURVES: [(CurveKind, &str); 3] =
    [(CurveKind::Linear, "linear"), (CurveKind::Encoded, "srgb-encoded"), (CurveKind::Decoded, "srgb-decoded")];

impl CurveKind {
    fn undo(self, v: f32) -> f32 {
        match self {
            CurveKind::Linear => v,
            CurveKind::Encoded => srgb_to_linear(v),
            CurveKind::Decoded => linear_to_srgb(v),
        }
    }
}

/// How texels are read as vectors.
#[derive(Clone, Debug)]
pub struct Reading {
    /// Which channels hold x and y; and z, unless it is to be rebuilt.
    pub(crate) channels: ([usize; 2], Option<usize>),
    pub(crate) curve: CurveKind,
    /// Floats that hold x, y and z as they are.
    pub(crate) signed: bool,
    /// The component `-1 ..= 1` of each code of the file, for integers.
    table: Vec<f32>,
}

impl Reading {
    pub(crate) fn new(image: &Image, channels: ([usize; 2], Option<usize>), curve: CurveKind, signed: bool) -> Reading {
        let most = match image.pixels() {
            Pixels::U8(_) => 255,
            Pixels::U16(_) => 65535,
            _ => 0,
        };
        let table = (0..=most).map(|k| curve.undo(k as f32 / most.max(1) as f32) * 2.0 - 1.0).collect();
        Reading { channels, curve, signed, table }
    }
    /// The component that a stored value `0 ..= 1` means.
    pub(crate) fn component(&self, v: f32) -> f32 {
        if self.signed { v } else { self.curve.undo(v) * 2.0 - 1.0 }
    }
    /// The vectors of a row, as stored, not of unit length. Green as it is. What is no number becomes 0.
    pub(crate) fn row(&self, image: &Image, y: u32, out: &mut Vec<[f32; 3]>) {
        out.clear();
        let (w, n) = (image.width() as usize, image.channels());
        let at = y as usize * w * n;
        let ([cx, cy], cz) = self.channels;
        fn fill<T: Copy>(
            row: &[T],
            n: usize,
            c: [usize; 3],
            rebuild: bool,
            out: &mut Vec<[f32; 3]>,
            f: impl Fn(T) -> f32,
        ) {
            out.extend(row.chunks_exact(n).map(|t| {
                let (x, y) = (f(t[c[0]]), f(t[c[1]]));
                let z = if rebuild { (1.0 - x * x - y * y).max(0.0).sqrt() } else { f(t[c[2]]) };
                [x, y, z]
            }));
        }
        let (c, rebuild) = ([cx, cy, cz.unwrap_or(0)], cz.is_none());
        let float = |v: f32| if v.is_finite() { self.component(v).clamp(-16.0, 16.0) } else { 0.0 };
        match image.pixels() {
            Pixels::U8(v) => fill(&v[at..at + w * n], n, c, rebuild, out, |v| self.table[v as usize]),
            Pixels::U16(v) => fill(&v[at..at + w * n], n, c, rebuild, out, |v| self.table[v as usize]),
            Pixels::F16(v) => fill(&v[at..at + w * n], n, c, rebuild, out, |v| float(v.to_f32())),
            Pixels::F32(v) => fill(&v[at..at + w * n], n, c, rebuild, out, float),
        }
    }
}

/// Whether a vector says anything: not the zero vector or black, as bakes leave them outside of their charts.
pub(crate) fn says(v: [f32; 3]) -> bool {
    let black = v[0] <= -0.98 && v[1] <= -0.98 && v[2] <= -0.98;
    !black && v[0] * v[0] + v[1] * v[1] + v[2] * v[2] > 0.04
}

/// Texels of a grid over the whole picture, as they are stored.
pub(crate) struct Survey<'a> {
    image: &'a Image,
    signed: bool,
    /// Values `0 ..= 1` as [`Image::rgba`] gives them, with what has no alpha or no numbers left out.
    texels: Vec<[f32; 4]>,
    layout: Layout,
    channels: ([usize; 2], Option<usize>),
}

/// Most texels of the grid.
const MOST: u64 = 1 << 18;

fn length(v: [f32; 3]) -> f64 {
    let v = v.map(f64::from);
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

fn median(values: &mut [f32], q: f64) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let k = ((values.len() - 1) as f64 * q) as usize;
    // Equal values are the same to whoever asks for one.
    *values.select_nth_unstable_by(k, f32::total_cmp).1
}

/// Mean and standard deviation.
fn spread(values: impl Iterator<Item = f32>) -> (f64, f64) {
    let (mut n, mut sum, mut square) = (0.0f64, 0.0, 0.0);
    for v in values {
        let v = f64::from(v);
        n += 1.0;
        sum += v;
        square += v * v;
    }
    let mean = sum / n.max(1.0);
    (mean, (square / n.max(1.0) - mean * mean).max(0.0).sqrt())
}

impl<'a> Survey<'a> {
    pub fn of(image: &'a Image, job: &Job) -> Result<Survey<'a>> {
        job.check()?;
        let (w, h) = (image.width(), image.height());
        let _room = job.reserve(2 * MOST * 16, "a survey of the normal map")?;
        let mut step = 1u32;
        while u64::from(w.div_ceil(step)) * u64::from(h.div_ceil(step)) > MOST {
            step += 1;
        }
        let mut texels = Vec::new();
        for (k, y) in (0..h).step_by(step as usize).enumerate() {
            // Each row begins elsewhere, so that a pattern of the grid's period is not missed.
            let first = (k as u32 * 7) % step;
            for x in (first.min(w - 1)..w).step_by(step as usize) {
                let t = if image.channels() == 2 {
                    // Red and green, not grey and alpha.
                    [image.value(x, y, 0), image.value(x, y, 1), 1.0, 1.0]
                } else {
                    image.rgba(x, y)
                };
                if t.iter().all(|v| v.is_finite()) {
                    texels.push(t);
                }
            }
        }
        let mut survey = Survey {
            image,
            signed: is_signed(image),
            texels,
            layout: Layout { value: "xyz", confidence: 0.0, z_spread: 0.0, rebuilt_spread: 0.0 },
            channels: ([0, 1], Some(2)),
        };
        survey.find_layout();
        Ok(survey)
    }

    fn vectors<'s>(&'s self, reading: &'s Reading) -> impl Iterator<Item = [f32; 3]> + 's {
        let ([cx, cy], cz) = reading.channels;
        self.texels.iter().map(move |t| {
            let (x, y) = (reading.component(t[cx]), reading.component(t[cy]));
            let z = cz.map_or_else(|| (1.0 - x * x - y * y).max(0.0).sqrt(), |c| reading.component(t[c]));
            [x, y, z]
        })
    }

    /// Which channels vary, before it is known by which curve.
    fn find_layout(&mut self) {
        let of = |c: usize| spread(self.texels.iter().map(move |t| t[c])).1;
        let [r, g, b, a] = [0, 1, 2, 3].map(of);
        // A code of 8 bits.
        let code = 1.0 / 255.0;
        let channels = self.image.channels();
        let decode = |v: f32| if self.signed { v } else { 2.0 * v - 1.0 };
        // As they are, and about their medians, so that a curve over all numbers does not pass for a slope.
        let middle: [f32; 4] =
            [0, 1, 2, 3].map(|c| decode(median(&mut self.texels.iter().map(|t| t[c]).collect::<Vec<_>>(), 0.5)));
        let rebuilt = |mx: f32, my: f32| {
            let z = |t: &[f32; 4]| {
                let (x, y) = (decode(t[0]) - mx, decode(t[1]) - my);
                (1.0 - x * x - y * y).max(0.0).sqrt()
            };
            spread(self.texels.iter().map(z)).1
        };
        let wanted = rebuilt(0.0, 0.0).min(rebuilt(middle[0], middle[1]));
        self.layout.rebuilt_spread = wanted as f32;
        self.layout.z_spread = if channels == 2 { 0.0 } else { (2.0 * b) as f32 };
        if channels == 2 {
            (self.layout.value, self.layout.confidence, self.channels) = ("xy", 0.99, ([0, 1], None));
        } else if channels == 4 && r < 0.3 * code && a > 2.0 * code && g > 2.0 * code {
            // DXT5nm: x was moved to alpha. Red is constant, blue is constant or a copy of green.
            (self.layout.value, self.layout.confidence, self.channels) = ("ag", 0.95, ([3, 1], None));
        } else if channels >= 3 && b < 0.3 * code && wanted > 2.0 * code {
            // Blue does not move where red and green ask for it. A z of 255 alone is no sign: it is right for
            // whatever leans by less than 5 degrees, and then `wanted` is small.
            let sure = 0.5 + 0.5 * ramp(wanted / code, 2.0, 6.0);
            (self.layout.value, self.layout.confidence, self.channels) = ("xy", sure as f32, ([0, 1], None));
        } else if channels >= 3 && b < 0.3 * code && r.max(g) > 0.3 * code {
            let z = middle[2];
            if z < -0.95 || z.abs() < 0.05 {
                // Constant, and what tools write where nothing is: black, or the middle.
                (self.layout.value, self.layout.confidence, self.channels) = ("xy", 0.95, ([0, 1], None));
            } else {
                self.layout.confidence = 0.7;
            }
        } else {
            self.layout.confidence = (0.6 + 0.4 * ramp(b / code, 0.3, 1.5)) as f32;
        }
    }

    pub fn layout(&self, _: &Reading) -> Layout {
        self.layout
    }

    /// The curve with the least cost: how far lengths are off, and how far the middle of red and green is off zero.
    pub fn curve(&self) -> (Curve, Reading) {
        let mut medians = [0.0; 2];
        for (k, m) in medians.iter_mut().enumerate() {
            let c = self.channels.0[k];
            // Black is where nothing is.
            let said = self.texels.iter().filter(|t| self.signed || t[0] + t[1] + t[2] > 0.03);
            *m = median(&mut said.map(|t| t[c]).collect::<Vec<_>>(), 0.5);
        }
        let mut errors = [0.0f32; 3];
        let mut costs = [0.0f64; 3];
        let mut readings = Vec::new();
        for (k, (curve, _)) in CURVES.into_iter().enumerate() {
            let reading = Reading::new(self.image, self.channels, curve, self.signed);
            if self.signed && k > 0 {
                (errors[k], costs[k]) = (errors[0], f64::INFINITY);
                readings.push(reading);
                continue;
            }
            // A table, as the curves are slow: 1024 steps move a length by less than 0.003.
            let table: Vec<f32> = (0..=1024).map(|j| reading.component(j as f32 / 1024.0)).collect();
            let of = |v: f32| if self.signed { v } else { table[((v.clamp(0.0, 1.0) * 1024.0) + 0.5) as usize] };
            let ([cx, cy], cz) = self.channels;
            let mut off = Vec::with_capacity(self.texels.len());
            let mut beyond = 0usize;
            for t in &self.texels {
                let (x, y) = (of(t[cx]), of(t[cy]));
                beyond += usize::from(x * x + y * y > 1.05);
                if let Some(c) = cz {
                    let v = [x, y, of(t[c])];
                    if says(v) {
                        off.push((length(v) - 1.0).abs() as f32);
                    }
                }
            }
            errors[k] = median(&mut off, 0.5);
            let lateral = medians.map(|m| f64::from(reading.component(m)).abs());
            costs[k] =
                f64::from(errors[k]) + lateral[0].max(lateral[1]) + beyond as f64 / self.texels.len().max(1) as f64;
            readings.push(reading);
        }
        let best = (0..3).fold(0, |b, k| if costs[k] < costs[b] { k } else { b });
        let second = (0..3).filter(|k| *k != best).map(|k| costs[k]).fold(f64::INFINITY, f64::min);
        let margin = if second.is_finite() { (second - costs[best]) / (second + costs[best] + 0.05) } else { 1.0 };
        let mut confidence = ramp(margin, 0.0, 0.6);
        if best > 0 {
            // Damage is only claimed where red and green sit where it puts them.
            let at = [0.737, 0.216][best - 1];
            let far = medians.iter().map(|m| (f64::from(*m) - at).abs()).fold(0.0, f64::max);
            confidence *= 1.0 - ramp(far, 0.04, 0.12);
        }
        let value = if confidence < 0.3 { "unknown" } else { CURVES[best].1 };
        let curve = Curve { value, confidence: confidence as f32, median: medians, length_error: errors };
        // A weak claim of damage is no ground to read the texels otherwise.
        let read_as = if confidence < 0.3 { 0 } else { best };
        (curve, readings.swap_remove(read_as))
    }

    pub fn space(&self, reading: &Reading) -> Space {
        let (mut sum, mut n, mut leaning, mut behind) = ([0.0f64; 3], 0.0f64, 0.0f64, 0.0f64);
        for v in self.vectors(reading).filter(|v| says(*v)) {
            let r = 1.0 / length(v);
            let u = v.map(|x| f64::from(x) * r);
            (0..3).for_each(|k| sum[k] += u[k]);
            n += 1.0;
            if u[2] < 0.98 {
                leaning += 1.0;
                behind += f64::from(u8::from(u[2] < -0.05));
            }
        }
        let mean = sum.map(|s| s / n.max(1.0));
        let size = (mean[0] * mean[0] + mean[1] * mean[1] + mean[2] * mean[2]).sqrt();
        let behind = behind / leaning.max(1.0);
        let out = if size > 0.0 { mean[2] / size } else { 0.0 };
        let tangent = (1.0 - ramp(behind, 0.005, 0.06)) * ramp(mean[2], 0.4, 0.75) * ramp(out, 0.75, 0.92);
        let object = ramp(behind, 0.03, 0.12).max(1.0 - ramp(mean[2], 0.2, 0.5)).max(1.0 - ramp(out, 0.5, 0.8));
        let (value, confidence) = match (tangent, object) {
            _ if n == 0.0 => ("unknown", 0.0),
            _ if reading.channels.1.is_none() => ("tangent", 0.95),
            (t, o) if t >= o => ("tangent", t),
            (_, o) => ("object", o),
        };
        let value = if confidence < 0.25 { "unknown" } else { value };
        Space { value, confidence: confidence as f32, behind: behind as f32, mean: mean.map(|m| m as f32) }
    }

    pub fn likeness(&self, reading: &Reading, space: &Space) -> f32 {
        if self.texels.is_empty() || self.image.channels() == 1 {
            return 0.0;
        }
        let n = self.texels.len() as f64;
        let near = |a: f32, b: f32| (a - b).abs() < 1.5 / 255.0;
        let grey = self.texels.iter().filter(|t| near(t[0], t[1]) && near(t[1], t[2])).count() as f64 / n;
        let (mut unit, mut said, mut out, mut inside) = (0.0, 0.0f64, 0.0, 0.0);
        for v in self.vectors(reading) {
            inside += f64::from(u8::from(v[0] * v[0] + v[1] * v[1] <= 1.02));
            if says(v) {
                said += 1.0;
                let l = length(v);
                unit += f64::from(u8::from((l - 1.0).abs() < 0.1));
                out += f64::from(v[2]) / l;
            }
        }
        let (unit, out) = (unit / said.max(1.0), out / said.max(1.0));
        let said = said / n;
        let lateral = space.mean[0].abs().max(space.mean[1].abs());
        let like = if reading.channels.1.is_none() {
            // z says nothing: x and y within the circle, about zero.
            0.8 * ramp(inside / n, 0.97, 0.999) * (1.0 - ramp(f64::from(lateral), 0.15, 0.4))
        } else if space.value == "object" {
            // Vectors of unit length that point everywhere; a light grey has unit length too, about (1, 1, 1).
            let spread = 1.0 - ramp(f64::from(space.mean[0].min(space.mean[1]).min(space.mean[2])), 0.3, 0.5);
            ramp(unit, 0.8, 0.97) * spread * ramp(said, 0.02, 0.1)
        } else {
            let unit = ramp(unit, 0.8, 0.95) * ramp(out, 0.5, 0.7);
            // Bluish about (0, 0, 1), though not of unit length.
            let blue = 0.7 * ramp(out, 0.55, 0.75) * (1.0 - ramp(f64::from(lateral), 0.1, 0.3));
            unit.max(blue) * ramp(said, 0.02, 0.1)
        };
        (like * (1.0 - ramp(grey, 0.85, 0.95))) as f32
    }

    pub fn length(&self, reading: &Reading) -> Length {
        let mut lengths: Vec<f32> = self.vectors(reading).filter(|v| says(*v)).map(|v| length(v) as f32).collect();
        let n = lengths.len().max(1) as f64;
        let off = lengths.iter().filter(|l| (**l - 1.0).abs() > 0.03).count() as f64 / n;
        let mean = lengths.iter().map(|l| f64::from((l - 1.0).abs())).sum::<f64>() / n;
        let middle = median(&mut lengths, 0.5);
        lengths.iter_mut().for_each(|l| *l = (*l - 1.0).abs());
        let p95 = median(&mut lengths, 0.95);
        let (value, confidence) = match () {
            () if reading.channels.1.is_none() || lengths.is_empty() => ("unknown", 0.0),
            // Rounding to 8 bits moves a length by up to 0.007, lossy compression by some hundredths.
            () if p95 <= 0.03 => ("unit", 1.0 - 0.5 * ramp(f64::from(p95), 0.008, 0.03)),
            () => ("off", 0.5 + 0.5 * ramp(f64::from(p95), 0.03, 0.08)),
        };
        Length {
            value,
            confidence: confidence as f32,
            off_share: off as f32,
            mean_error: mean as f32,
            p95_error: p95,
            median: middle,
        }
    }

    pub fn neutral(&self, reading: &Reading) -> Neutral {
        let mut out = Neutral { value: "unknown", confidence: 0.0, codes: [0; 2], share: [0.0; 2] };
        if reading.curve != CurveKind::Linear {
            // The curve has been rounded over whatever the code was.
            return out;
        }
        let n = self.texels.len().max(1) as f64;
        let float = matches!(self.image.pixels(), Pixels::F16(_) | Pixels::F32(_));
        if float {
            let zero = if self.signed { 0.0 } else { 0.5 };
            for k in 0..2 {
                let c = reading.channels.0[k];
                out.share[k] = (self.texels.iter().filter(|t| t[c] == zero).count() as f64 / n) as f32;
            }
            if out.share[0].min(out.share[1]) > 0.01 {
                (out.value, out.confidence) = ("exact", 0.95);
            }
            return out;
        }
        let most = most(self.image);
        // The two codes beside the middle; of a map under a curve, those that the curve makes of them.
        let target = {
            // Where `component` crosses zero.
            let (mut lo, mut hi) = (0u32, most as u32);
            while hi - lo > 1 {
                let mid = (lo + hi) / 2;
                if reading.component(mid as f32 / most) < 0.0 { lo = mid } else { hi = mid }
            }
            [lo, hi]
        };
        let mut kinds = [0usize; 2];
        let mut sure = 1.0f64;
        for k in 0..2 {
            let c = reading.channels.0[k];
            // Codes around the middle: [lo - 1, lo, hi, hi + 1].
            let mut counts = [0.0f64; 4];
            for t in &self.texels {
                let code = (t[c] * most + 0.5) as i64 - i64::from(target[0]) + 1;
                if (0..4).contains(&code) {
                    counts[code as usize] += 1.0;
                }
            }
            let at = if counts[1] > counts[2] { 1 } else { 2 };
            let beside = counts[3 - at].max(counts[if at == 1 { 0 } else { 3 }]);
            kinds[k] = at;
            out.codes[k] = target[at - 1];
            out.share[k] = (counts[at] / n) as f32;
            // A peak at one code: flat ground. A slope passes all four codes alike.
            sure = sure.min(ramp(counts[at] / n, 0.01, 0.05) * ramp(counts[at] / (beside + 1.0), 1.5, 4.0));
        }
        if sure < 0.3 {
            return Neutral { codes: [0; 2], ..out };
        }
        out.value = match kinds {
            [1, 1] => "127",
            [2, 2] => "128",
            _ => "mixed",
        };
        out.confidence = sure as f32;
        out
    }

    pub fn banding(&self) -> Banding {
        let mut out = Banding { value: "unknown", confidence: 0.0, levels: [0; 2], span: [0.0; 2] };
        let [cx, cy] = self.channels.0;
        let most = most(self.image);
        let mut eights = [true; 2];
        for (k, c) in [cx, cy].into_iter().enumerate() {
            let mut codes: Vec<u32> =
                self.texels.iter().map(|t| (t[c].clamp(0.0, 1.0) * 65535.0 + 0.5) as u32).collect();
            codes.sort_unstable();
            codes.dedup();
            out.levels[k] = codes.len() as u32;
            out.span[k] = (codes.last().copied().unwrap_or(0) - codes.first().copied().unwrap_or(0)) as f32 / 257.0;
            // All are 8-bit codes, repeated (257 k) or shifted (256 k).
            eights[k] = codes.iter().all(|v| v % 257 == 0) || codes.iter().all(|v| v % 256 == 0);
        }
        let deep = most > 255.0;
        let levels = out.levels[0].max(out.levels[1]);
        let span = out.span[0].max(out.span[1]);
        (out.value, out.confidence) = match () {
            () if levels < 4 => ("unknown", 0.0),
            () if deep && eights == [true; 2] => ("8-in-16", ramp(f64::from(levels), 4.0, 24.0) as f32),
            // With thousands of texels and a wide range, every 8-bit code between is used, unless slopes come in steps.
            () if span >= 24.0 && self.texels.len() > 4000 && f64::from(levels) < 0.3 * f64::from(span) => {
                // Bevels of one slope look the same, so this is never sure.
                ("steps", (0.7 - 0.3 * ramp(f64::from(levels) / f64::from(span), 0.1, 0.3)) as f32)
            }
            () => ("none", ramp(f64::from(levels) / f64::from(span.max(1.0)), 0.3, 0.9) as f32),
        };
        out
    }
}
