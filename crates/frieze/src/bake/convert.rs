//! Maps into maps: heights, normals, slopes and curvature.
//!
//! Heights and slopes are measured in texels. Images are read as data: no sRGB curve is undone.

use super::poisson::{Heights, integrate};
use super::slope::{Edges, Kernel, Slopes, Window, normal};
use super::texels::{Depth, Field, Rows, Store, make};
use crate::error::{Error, Finding, Result};
use crate::image::{Image, Pixels};
use crate::job::Job;
use crate::map::normal as normal_map;
use crate::math::lane::{self, Lane, Level, Num};
use crate::math::vec::{Vec3, Vec4};
use crate::scene::material::Channel;

/// What a map holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Heights.
    Height,
    /// Tangent-space normals.
    Normal,
    /// Slopes: the derivatives of the height along u and v (v up).
    Derivative,
    /// Mean curvature, positive where the surface bulges out, in 1 / texel.
    Curvature,
}

/// How maps become maps.
#[derive(Clone, Debug)]
pub struct Options {
    /// Threads, memory, progress, cancellation.
    pub job: Job,
    /// The SIMD level; it changes the time only.
    pub level: Level,
    /// What the input holds; `None` guesses.
    pub from: Option<Kind>,
    /// Which number of a texel is its height.
    pub channel: Channel,
    /// How many texels high the full range of a height map is (a height of 1 for floats); `None` is 2 % of the width.
    pub strength: Option<f32>,
    /// How slopes are found.
    pub kernel: Kernel,
    /// What lies beyond the edges.
    pub edges: Edges,
    /// Green points down the image in a normal map that is read.
    pub from_y_down: bool,
    /// Green points down the image in a normal map that is made.
    pub y_down: bool,
    /// Channels of a normal map that is read: with 2, z is rebuilt from x and y.
    pub channels: u8,
    /// A second normal map, of the same conventions as the first, whose detail is put on it.
    pub detail: Option<Image>,
    /// What the new map is stored in.
    pub depth: Depth,
    /// Whether 8 bits are dithered.
    pub dither: bool,
    /// Of the dither.
    pub seed: u64,
    /// The slope or curvature that is the end of an integer's range; `None` is 1 for slopes and 0.5 for curvature.
    pub range: Option<f32>,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            job: Job::default(),
            level: Level::default(),
            from: None,
            channel: Channel::R,
            strength: None,
            kernel: Kernel::Sobel,
            edges: Edges::Extend,
            from_y_down: false,
            y_down: false,
            channels: 3,
            detail: None,
            depth: Depth::U16,
            dither: true,
            seed: 0,
            range: None,
        }
    }
}

/// A new map.
#[derive(Clone, Debug)]
pub struct Converted {
    /// The map, linear.
    pub image: Image,
    /// What the input was taken for.
    pub from: Kind,
    /// What was odd.
    pub findings: Vec<Finding>,
    /// Figures that a reader of the map may need, by name.
    pub figures: Vec<(&'static str, f64)>,
}

/// Makes a map of the kind `to` from another.
///
/// # Errors
/// `convert.pair` for kinds that cannot be made from one another, `convert.channel`, `convert.normal-channels`,
/// `convert.size` for a detail map of another size, and those of the job.
pub fn convert(image: &Image, to: Kind, options: &Options) -> Result<Converted> {
    let mut out = Report::default();
    let from = options.from.unwrap_or_else(|| guess(image, to, &mut out));
    let pair = |message: &str| Err(Error::arguments("convert.pair", message).remedy("choose --from and --to"));
    let source = match from {
        Kind::Height => Source::Height(heights(image, options, &mut out)?),
        Kind::Normal => Source::Normal(normals(image, options, &mut out)?),
        Kind::Derivative | Kind::Curvature => return pair("slopes and curvature cannot be converted into other maps"),
    };
    let (signed, channels) = match to {
        Kind::Height => match source {
            Source::Normal(n) => return to_height(&n, options, out),
            Source::Height(_) => return pair("heights are there already"),
        },
        Kind::Normal => (Signed::Normal { y_down: options.y_down }, 3),
        Kind::Derivative => (Signed::Slope { range: options.range.unwrap_or(1.0), y_down: options.y_down }, 2),
        Kind::Curvature => (Signed::Curvature { range: options.range.unwrap_or(0.5), edges: options.edges }, 1),
    };
    if let Signed::Slope { range, .. } | Signed::Curvature { range, .. } = signed {
        out.figures.push(("range", if options.depth.is_float() { 1.0 } else { range.into() }));
    }
    // A picture of two channels would be grey with alpha: blue stays empty.
    let store = Store {
        width: image.width(),
        height: image.height(),
        channels: if channels == 2 { 3 } else { channels },
        depth: options.depth,
        dither: options.dither,
        seed: options.seed,
    };
    let rows = Encode { source, signed, float: options.depth.is_float(), size: (store.width, store.height) };
    let (made, clamped) = make(&rows, &store, &options.job, options.level)?;
    // Normals of unit length never leave the range, but for rounding.
    if clamped > 0 && to != Kind::Normal {
        out.findings.push(clamping(clamped, "--range"));
    }
    Ok(Converted { image: made, from, findings: out.findings, figures: out.figures })
}

/// Rows of heights, scaled and moved.
struct Lift<'a> {
    heights: &'a Heights,
    scale: f32,
    offset: f32,
}

impl Rows for Lift<'_> {
    type Scratch = ();
    fn scratch(&self) {}
    fn fill(&self, _: Level, (): &mut (), y: usize, out: &mut [Vec<f32>]) {
        for (o, v) in out[0].iter_mut().zip(self.heights.row(y)) {
            *o = *v * self.scale + self.offset;
        }
    }
}

fn to_height(normals: &Normals, options: &Options, mut out: Report) -> Result<Converted> {
    let away = normals.facing_away();
    if away > 0.0 {
        out.findings.push(Finding::warning(
            "convert.steep",
            format!("{:.2} % of the normals lie in the surface or point away from it", away * 100.0),
            "no height has their slope; they count as a slope of 100",
        ));
    }
    let heights = integrate(normals, options.edges, &options.job, options.level)?;
    let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
    for v in (0..heights.height).flat_map(|y| heights.row(y)) {
        low = if *v < low { *v } else { low };
        high = if *v > high { *v } else { high };
    }
    if low == high {
        out.findings.push(Finding::warning(
            "convert.flat",
            "all normals point up: the surface is flat",
            "every height is the same",
        ));
    }
    let float = options.depth.is_float();
    let (strength, offset) = match options.strength {
        Some(s) if s != 0.0 => (s, if float { 0.0 } else { 0.5 }),
        _ if float => (1.0, 0.0),
        _ if low == high => (1.0, 0.5),
        // The whole range of the integers.
        _ => (high - low, -low / (high - low)),
    };
    out.figures.extend([
        ("strength", strength.into()),
        ("midlevel", offset.into()),
        ("lowest_texels", low.into()),
        ("highest_texels", high.into()),
    ]);
    let (width, height) = (heights.width as u32, heights.height as u32);
    let store = Store { width, height, channels: 1, depth: options.depth, dither: options.dither, seed: options.seed };
    let rows = Lift { heights: &heights, scale: 1.0 / strength, offset };
    let (image, clamped) = make(&rows, &store, &options.job, options.level)?;
    // The ends of the range are reached exactly, but for rounding.
    if clamped > 0 && options.strength.is_some() {
        out.findings.push(clamping(clamped, "--strength"));
    }
    Ok(Converted { image, from: Kind::Normal, findings: out.findings, figures: out.figures })
}

fn clamping(count: u64, option: &str) -> Finding {
    Finding::warning(
        "convert.clamped",
        format!("{count} values lie outside of the range of the file"),
        format!("they became its ends; give a larger {option}, or write .exr"),
    )
}

#[derive(Default)]
struct Report {
    findings: Vec<Finding>,
    figures: Vec<(&'static str, f64)>,
}

/// Whether a picture looks like tangent-space normals: of unit length, and mostly facing up. Looks at a grid of texels.
pub fn looks_like_normals(image: &Image) -> bool {
    if image.channels() < 3 {
        return false;
    }
    let signed = is_signed(image);
    let (mut unit, mut up, mut count) = (0, 0, 0);
    for c in grid(image, 64) {
        let c = c.map(|v| if signed { v } else { v * 2.0 - 1.0 });
        let length = (c[0] * c[0] + c[1] * c[1] + c[2] * c[2]).sqrt();
        unit += u32::from((0.85..1.15).contains(&length));
        up += u32::from(c[2] > 0.0);
        count += 1;
    }
    10 * unit >= 9 * count && 10 * up >= 9 * count
}

fn guess(image: &Image, to: Kind, out: &mut Report) -> Kind {
    let normal = to == Kind::Height || looks_like_normals(image);
    let (kind, word) = if normal { (Kind::Normal, "a normal map") } else { (Kind::Height, "heights") };
    if image.channels() >= 3 && to != Kind::Height {
        out.findings.push(Finding::note(
            "convert.guessed",
            format!("the picture is taken for {word}"),
            "say --from height or --from normal if it is not",
        ));
    }
    kind
}

/// A height field with its findings.
fn heights<'a>(image: &'a Image, options: &Options, out: &mut Report) -> Result<Slopes<'a>> {
    let field = Field::new(image, options.channel)?;
    let (flat, bad) = field.survey(&options.job)?;
    if bad > 0 {
        out.findings.push(Finding::warning(
            "convert.not-finite",
            format!("{bad} heights are no numbers, or too large to be heights"),
            "those count as 0, or as the largest",
        ));
    }
    if flat {
        out.findings.push(Finding::warning(
            "convert.flat",
            "all heights are the same: the surface is flat",
            "every normal points up; choose another --channel if the heights are in another one",
        ));
    }
    if matches!(image.pixels(), Pixels::U8(_)) && !flat {
        out.findings.push(Finding::warning(
            "convert.eight-bits",
            "the heights have 8 bits: slow slopes come out in steps",
            "use a height map of 16 bits or floats",
        ));
    }
    let strength = options.strength.unwrap_or_else(|| {
        let s = image.width() as f32 * 0.02;
        out.findings.push(Finding::note(
            "convert.strength",
            format!("no height was given: the full range is taken for {s} texels (2 % of the width)"),
            "say --strength TEXELS, or --texel-size and --amplitude",
        ));
        s
    });
    out.figures.push(("strength", strength.into()));
    Ok(Slopes { field, kernel: options.kernel, edges: options.edges, strength })
}

/// A normal map that is read.
#[derive(Clone, Copy, Debug)]
pub struct Normals<'a> {
    image: &'a Image,
    channels: u8,
    y_down: bool,
    signed: bool,
    detail: Option<&'a Image>,
}

/// Whether a float picture holds -1 ..= 1 and not 0 ..= 1, by a grid of texels.
fn is_signed(image: &Image) -> bool {
    let float = matches!(image.pixels(), Pixels::F16(_) | Pixels::F32(_));
    float && grid(image, 256).any(|c| c[..3].iter().any(|v| *v < 0.0))
}

/// The texels of a grid of about `n` x `n` places.
fn grid(image: &Image, n: u32) -> impl Iterator<Item = [f32; 4]> + '_ {
    let step = move |size: u32| (size / n).max(1) as usize;
    let xs = move || (0..image.width()).step_by(step(image.width()));
    (0..image.height()).step_by(step(image.height())).flat_map(move |y| xs().map(move |x| image.rgba(x, y)))
}

fn normals<'a>(image: &'a Image, options: &'a Options, out: &mut Report) -> Result<Normals<'a>> {
    let normals = Normals::new(image, options.channels, options.from_y_down, options.detail.as_ref())?;
    let (bad, share) = normals.unnormalized();
    if share > 0.0 {
        out.figures.push(("unnormalized", share));
    }
    if normals.signed {
        out.findings.push(Finding::note(
            "convert.signed",
            "the normal map has negative numbers",
            "it is read as -1 to 1, not as 0 to 1",
        ));
    }
    if bad > 0.0 {
        out.findings.push(Finding::warning(
            "convert.no-direction",
            format!("{:.2} % of the texels hold no direction", bad * 100.0),
            "they became flat",
        ));
    }
    Ok(normals)
}

impl<'a> Normals<'a> {
    /// A normal map of 3 channels (or more; the others are not looked at), or of 2, whose z is rebuilt.
    ///
    /// # Errors
    /// `convert.normal-channels`, `convert.size`.
    pub fn new(image: &'a Image, channels: u8, y_down: bool, detail: Option<&'a Image>) -> Result<Self> {
        for map in [Some(image), detail].into_iter().flatten() {
            if map.channels() < usize::from(channels.clamp(2, 3)) {
                return Err(Error::input(
                    "convert.normal-channels",
                    format!("a normal map has {} channels, this picture has {}", channels.clamp(2, 3), map.channels()),
                )
                .remedy("say --channels 2 for a map without blue, or --from height for heights"));
            }
            if (map.width(), map.height()) != (image.width(), image.height()) {
                return Err(Error::input(
                    "convert.size",
                    format!(
                        "the maps have different sizes: {}x{} and {}x{}",
                        image.width(),
                        image.height(),
                        map.width(),
                        map.height()
                    ),
                )
                .remedy("bring them to the same size first"));
            }
        }
        Ok(Normals { image, channels, y_down, signed: is_signed(image), detail })
    }
    /// The shares, of a grid of texels, that hold no direction and that are off unit length by more than 2 %.
    fn unnormalized(&self) -> (f64, f64) {
        let (mut none, mut off, mut count) = (0, 0, 0);
        for c in grid(self.image, 256) {
            let c = c.map(|v| if self.signed { v } else { v * 2.0 - 1.0 });
            let length = (c[0] * c[0] + c[1] * c[1] + c[2] * c[2]).sqrt();
            count += 1;
            if self.channels != 2 {
                // The middle of an integer's range is no direction, and neither is NaN.
                none += u32::from(length.is_nan() || length < 0.01);
                off += u32::from(length.is_nan() || (length - 1.0).abs() > 0.02);
            }
        }
        (f64::from(none) / f64::from(count), f64::from(off) / f64::from(count))
    }
    /// The share, of a grid of texels, that has no slope.
    fn facing_away(&self) -> f64 {
        let (mut away, mut count) = (0, 0);
        for c in grid(self.image, 256) {
            let z = if self.signed { c[2] } else { c[2] * 2.0 - 1.0 };
            away += u32::from(self.channels != 2 && z < 0.01);
            count += 1;
        }
        f64::from(away) / f64::from(count)
    }
    /// Texels per row, and rows.
    pub fn size(&self) -> (usize, usize) {
        (self.image.width() as usize, self.image.height() as usize)
    }
    /// As [`Normals::row`], within a kernel.
    #[inline(always)]
    pub(super) fn fill<L: Lane>(&self, l: L, y: usize, out: &mut [Vec<f32>; 3]) {
        lane::Kernel::run(NormalRow { normals: self, y, out }, l);
    }
    /// Row `y`: unit normals, green up, into slices at least as long as the map is wide, rounded up to 16.
    pub fn row(&self, level: Level, y: usize, out: &mut [Vec<f32>; 3]) {
        level.run(NormalRow { normals: self, y, out });
    }
    /// The channels of row `y` as they are stored, as 0 ..= 1 where floats hold -1 ..= 1.
    #[inline(always)]
    fn read(&self, image: &Image, y: usize, out: &mut [Vec<f32>; 3]) {
        let (scale, offset) = if self.signed { (0.5, 0.5) } else { (1.0, 0.0) };
        let (w, n) = (image.width() as usize, image.channels());
        let row = y * w * n..(y + 1) * w * n;
        let used = usize::from(self.channels.clamp(2, 3));
        #[inline(always)]
        fn split<T: Copy>(row: &[T], n: usize, used: usize, out: &mut [Vec<f32>; 3], number: impl Fn(T) -> f32) {
            if n == 3 && used == 3 {
                let [r, g, b] = out;
                for (((p, r), g), b) in row.chunks_exact(3).zip(r).zip(g).zip(b) {
                    (*r, *g, *b) = (number(p[0]), number(p[1]), number(p[2]));
                }
                return;
            }
            for (c, out) in out.iter_mut().enumerate().take(used) {
                row.chunks_exact(n).zip(out).for_each(|(p, o)| *o = number(p[c]));
            }
        }
        match image.pixels() {
            Pixels::U8(v) => split(&v[row], n, used, out, |v| f32::from(v) * (1.0 / 255.0)),
            Pixels::U16(v) => split(&v[row], n, used, out, |v| f32::from(v) * (1.0 / 65535.0)),
            Pixels::F16(v) => split(&v[row], n, used, out, |v| v.to_f32() * scale + offset),
            Pixels::F32(v) => split(&v[row], n, used, out, |v| v * scale + offset),
        }
    }
}

struct NormalRow<'a> {
    normals: &'a Normals<'a>,
    y: usize,
    out: &'a mut [Vec<f32>; 3],
}

impl lane::Kernel for NormalRow<'_> {
    type Out = ();
    #[inline(always)]
    fn run<L: Lane>(self, l: L) {
        let NormalRow { normals, y, out } = self;
        normals.read(normals.image, y, out);
        let w = normals.image.width() as usize;
        let (y_down, channels) = (normals.y_down, normals.channels);
        #[inline(always)]
        fn texel<L: Lane>(l: L, p: &[Vec<f32>; 3], x: usize) -> Vec4<L::F> {
            Vec4::new(l.load(&p[0][x..]), l.load(&p[1][x..]), l.load(&p[2][x..]), l.f(1.0))
        }
        let second = normals.detail.map(|d| {
            let mut rows = out.clone();
            normals.read(d, y, &mut rows);
            rows
        });
        for x in (0..w).step_by(L::WIDTH) {
            let mut n = normal_map::decode(texel(l, out, x), 1.0, y_down, channels);
            if let Some(second) = &second {
                n = reoriented(n, normal_map::decode(texel(l, second, x), 1.0, y_down, channels));
            }
            for (out, v) in out.iter_mut().zip(n.array()) {
                v.store(&mut out[x..]);
            }
        }
    }
}

/// The normal `detail` in the frame that the shortest turn from +Z to the unit normal `base` makes (C. Barré-Brisebois
/// and S. Hill 2012, "Blending in Detail"). Both flat in, flat out; a flat one gives the other.
#[inline(always)]
pub fn reoriented<N: Num>(base: Vec3<N>, detail: Vec3<N>) -> Vec3<N> {
    // t = base + (0, 0, 1), u = detail * (-1, -1, 1): r = t dot(t, u) / t.z - u.
    let t = Vec3::new(base.x, base.y, base.z + 1.0);
    let u = Vec3::new(-detail.x, -detail.y, detail.z);
    // Opposite to +Z there is no shortest turn: any will do.
    let safe = t.z.max(t.z.lift(1e-6));
    let r = t * (t.dot(u) / safe) - u;
    let length = r.length();
    let fine = length.gt(length.lift(1e-12));
    let r = r * (length.lift(1.0) / length.or_else(fine, length.lift(1.0)));
    Vec3::new(r.x.or_else(fine, base.x), r.y.or_else(fine, base.y), r.z.or_else(fine, base.z))
}

/// Where normals come from.
enum Source<'a> {
    Height(Slopes<'a>),
    Normal(Normals<'a>),
}

/// What is made of normals.
#[derive(Clone, Copy)]
enum Signed {
    Normal { y_down: bool },
    Slope { range: f32, y_down: bool },
    Curvature { range: f32, edges: Edges },
}

struct Encode<'a> {
    source: Source<'a>,
    signed: Signed,
    float: bool,
    size: (u32, u32),
}

/// Rows of normals around the one that is asked.
struct Around {
    window: Option<Window>,
    rows: [[Vec<f32>; 3]; 3],
    at: [Option<usize>; 3],
}

impl Encode<'_> {
    /// Unit normals of row `y`, green up.
    fn normals(&self, level: Level, window: &mut Option<Window>, y: usize, out: &mut [Vec<f32>; 3]) {
        match &self.source {
            Source::Normal(n) => n.row(level, y, out),
            Source::Height(s) => {
                let window = window.get_or_insert_with(|| s.window());
                let [x, down, _] = out;
                s.row(level, window, y, x, down);
                level.run(FromSlopes { out });
            }
        }
    }
}

struct FromSlopes<'a> {
    out: &'a mut [Vec<f32>; 3],
}

impl lane::Kernel for FromSlopes<'_> {
    type Out = ();
    #[inline(always)]
    fn run<L: Lane>(self, l: L) {
        let [a, b, c] = self.out;
        for ((a, b), c) in
            a.chunks_exact_mut(L::WIDTH).zip(b.chunks_exact_mut(L::WIDTH)).zip(c.chunks_exact_mut(L::WIDTH))
        {
            let n = normal(l.load(a), l.load(b));
            n.x.store(a);
            n.y.store(b);
            n.z.store(c);
        }
    }
}

impl Rows for Encode<'_> {
    type Scratch = Around;
    fn scratch(&self) -> Around {
        let row = vec![0.0f32; (self.size.0 as usize).next_multiple_of(16)];
        Around { window: None, rows: std::array::from_fn(|_| std::array::from_fn(|_| row.clone())), at: [None; 3] }
    }
    fn fill(&self, level: Level, around: &mut Around, y: usize, out: &mut [Vec<f32>]) {
        let float = self.float;
        match self.signed {
            Signed::Curvature { range, edges } => {
                let last = self.size.1 as usize - 1;
                let wanted = match edges {
                    Edges::Wrap => [if y == 0 { last } else { y - 1 }, y, if y == last { 0 } else { y + 1 }],
                    Edges::Extend => [y.saturating_sub(1), y, (y + 1).min(last)],
                };
                for k in 0..3 {
                    if around.at[k] == Some(wanted[k]) {
                        continue;
                    }
                    if let Some(have) = (k + 1..3).find(|&j| around.at[j] == Some(wanted[k])) {
                        around.rows.swap(k, have);
                        around.at.swap(k, have);
                        continue;
                    }
                    self.normals(level, &mut around.window, wanted[k], &mut around.rows[k]);
                    around.at[k] = Some(wanted[k]);
                }
                let rows = &around.rows;
                // One-sided at the edges of a map that is no tile.
                let down = if edges == Edges::Extend && (y == 0 || y == last) && last > 0 { 1.0 } else { 0.5 };
                let w = self.size.0 as usize;
                let scale = if float { 1.0 } else { 0.5 / range };
                let middle = if float { 0.0 } else { 0.5 };
                let nx = &rows[1][0];
                for (x, o) in out[0][..w].iter_mut().enumerate() {
                    let (left, right, share) = match edges {
                        Edges::Wrap => (if x == 0 { w - 1 } else { x - 1 }, if x + 1 == w { 0 } else { x + 1 }, 0.5),
                        Edges::Extend if x == 0 || x + 1 == w => (x.saturating_sub(1), (x + 1).min(w - 1), 1.0),
                        Edges::Extend => (x - 1, x + 1, 0.5),
                    };
                    // Half the divergence of the normal; its y points up, rows run down.
                    let along = (nx[right] - nx[left]) * share;
                    let across = (rows[0][1][x] - rows[2][1][x]) * down;
                    *o = (along + across) * 0.5 * scale + middle;
                }
            }
            Signed::Normal { y_down } => {
                let [n, ..] = &mut around.rows;
                self.normals(level, &mut around.window, y, n);
                level.run(EncodeRow { n, slope: None, y_down, float, out });
            }
            Signed::Slope { range, y_down } => {
                let [n, ..] = &mut around.rows;
                self.normals(level, &mut around.window, y, n);
                level.run(EncodeRow { n, slope: Some(range), y_down, float, out });
            }
        }
    }
}

struct EncodeRow<'a> {
    n: &'a [Vec<f32>; 3],
    /// Slopes are stored, with this end of the range.
    slope: Option<f32>,
    y_down: bool,
    float: bool,
    out: &'a mut [Vec<f32>],
}

impl lane::Kernel for EncodeRow<'_> {
    type Out = ();
    #[inline(always)]
    fn run<L: Lane>(self, l: L) {
        let [a, b, c] = self.n;
        for x in (0..a.len()).step_by(L::WIDTH) {
            let n = Vec3::new(l.load(&a[x..]), l.load(&b[x..]), l.load(&c[x..]));
            let v = match self.slope {
                None => normal_map::encode(n, self.y_down),
                Some(range) => {
                    // A normal that lies in the surface has no slope: the steepest stands for it.
                    let z = n.z.max(l.f(1e-6));
                    let (x, y) = (-n.x / z, -n.y / z);
                    let y = if self.y_down { -y } else { y };
                    if self.float {
                        Vec3::new(x, y, l.f(0.0))
                    } else {
                        let scale = 0.5 / range;
                        Vec3::new(x * scale + 0.5, y * scale + 0.5, l.f(0.0))
                    }
                }
            };
            for (out, v) in self.out.iter_mut().zip(v.array()) {
                v.store(&mut out[x..]);
            }
        }
    }
}
