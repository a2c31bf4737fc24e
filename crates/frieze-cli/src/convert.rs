//! `frieze convert`: maps into maps.

use crate::args::{Common, Convert, Holds, MapDepth, Number, SlopeKernel, Target, Way};
use crate::bench::cpu_time;
use crate::convert_fix;
use crate::talk::Talk;
use crate::version;
use clap::ValueEnum;
use frieze::bake::block;
use frieze::bake::convert::{Converted, Kind, Options, convert};
use frieze::bake::slope::{Edges, Kernel};
use frieze::bake::space::{Space, change_space};
use frieze::bake::texels::Depth;
use frieze::error::{Fault, Finding};
use frieze::job::Job;
use frieze::load::{self, LoadOptions};
use frieze::scene::material::Channel;
use frieze::write::{self, FileKind, Ktx2, Ktx2Format, WriteOptions};
use frieze::{Error, Result};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

/// The document of `--json`.
#[derive(Serialize)]
struct Document<'a> {
    map: String,
    from: &'static str,
    to: String,
    outputs: Vec<String>,
    size: [u32; 2],
    depth: &'static str,
    simd: &'static str,
    threads: usize,
    figures: BTreeMap<&'static str, f64>,
    /// Wall time per stage, milliseconds.
    time_ms: BTreeMap<&'static str, f64>,
    /// Processor time per stage, milliseconds; null where the system has no such clock.
    cpu_ms: Option<BTreeMap<&'static str, f64>>,
    peak_bytes: u64,
    findings: &'a [Finding],
}

/// Wall and processor time per stage.
struct Clock {
    last: (Instant, Option<Duration>),
    wall: BTreeMap<&'static str, f64>,
    cpu: Option<BTreeMap<&'static str, f64>>,
}

impl Clock {
    fn new() -> Self {
        let cpu = cpu_time();
        Clock { last: (Instant::now(), cpu), wall: BTreeMap::new(), cpu: cpu.map(|_| BTreeMap::new()) }
    }
    /// The time since the last lap counts for `stage`.
    fn lap(&mut self, stage: &'static str) {
        let now = (Instant::now(), cpu_time());
        self.wall.insert(stage, (now.0 - self.last.0).as_secs_f64() * 1e3);
        if let (Some(all), Some(from), Some(to)) = (&mut self.cpu, self.last.1, now.1) {
            all.insert(stage, to.saturating_sub(from).as_secs_f64() * 1e3);
        }
        self.last = now;
    }
    fn finish(&mut self) {
        for all in [Some(&mut self.wall), self.cpu.as_mut()].into_iter().flatten() {
            let total = all.values().sum();
            all.insert("total", total);
        }
    }
}

/// Converts.
pub fn run(a: &Convert, common: &Common, talk: &Talk) -> Result<()> {
    let Some(to) = a.to else { return convert_fix::fix(&a.map, &a.out, &a.fix, common, talk) };
    not_yet(to)?;
    let level = version::level()?;
    let job = talk.job(common);
    let write = WriteOptions { force: common.force, job: job.clone() };
    let hardware = matches!(to, Target::Bc5 | Target::Bc7 | Target::Ktx2);
    let depth = if hardware {
        write::check_ktx2(&a.out, &write)?;
        hardware_depth(a, to)?
    } else {
        let depth = depth(&a.out, a.depth)?;
        write::check(&a.out, &[], &write)?;
        depth
    };
    let mut clock = Clock::new();
    // The user has named the files: they may lie anywhere.
    let load = LoadOptions { job: job.clone(), allow_outside: true };
    let (image, mut findings) = load::image(&a.map, &load)?;
    let _held = job.reserve(image.bytes(), "the map")?;
    let detail = match &a.with {
        None => None,
        Some(path) => {
            let (image, more) = load::image(path, &load)?;
            findings.extend(more);
            Some(image)
        }
    };
    clock.lap("load");
    let options = Options { level, detail, depth, seed: common.seed, ..options(a, &job) };
    let space = match to {
        Target::Object => Some(Space::Object),
        Target::Tangent => Some(Space::Tangent),
        _ => None,
    };
    let made = match (space, &a.mesh) {
        (None, None) => convert(&image, kind(to), &options),
        (None, Some(_)) => Err(Error::arguments("arguments.usage", "--mesh goes with --to object and --to tangent")),
        (Some(_), None) => {
            Err(Error::arguments("arguments.usage", "the mesh that wears the map is needed")
                .remedy("give it with --mesh"))
        }
        (Some(space), Some(mesh)) => {
            let loaded = load::load(mesh, &load)?;
            findings.extend(loaded.findings);
            clock.lap("mesh");
            change_space(&image, &loaded.scene.meshes, space, &options)
                .map_err(|e| if e.code == "convert.mesh-uv" { e.in_file(mesh) } else { e })
        }
    };
    let made = made.map_err(|e| if e.fault == Fault::Input { e.in_file(&a.map) } else { e })?;
    drop(image);
    clock.lap("convert");
    let Converted { image, from, findings: more, mut figures } = made;
    findings.extend(more.into_iter().map(|f| f.in_file(&a.map)));
    if hardware {
        let (bytes, format) = match to {
            Target::Ktx2 => {
                let wide = depth == Depth::U16;
                let _held = job.reserve(image.bytes() * 4 / 3, "the texture")?;
                (block::rgba(&image, wide), if wide { Ktx2Format::Rgba16 } else { Ktx2Format::Rgba8 })
            }
            _ => {
                let (format, ktx2) = match to {
                    Target::Bc5 => (block::Format::Bc5, Ktx2Format::Bc5),
                    _ => (block::Format::Bc7, Ktx2Format::Bc7),
                };
                let blocks = block::compress(&image, format, &job)?;
                talk.say(format!("compressed: {:.3} degrees off on average, {:.3} at most", blocks.mean, blocks.max));
                figures.extend([("angle_mean", blocks.mean), ("angle_max", blocks.max)]);
                clock.lap("compress");
                (blocks.bytes, ktx2)
            }
        };
        write::ktx2(&Ktx2 { width: image.width(), height: image.height(), format, bytes: &bytes }, &a.out, &write)?;
    } else {
        write::image(&image, &a.out, &write)?;
    }
    clock.lap("write");
    clock.finish();
    talk.finish();
    talk.findings(&findings);
    talk.say(format!("{} {}x{}", a.out.display(), image.width(), image.height()));
    if talk.json {
        talk.document(
            "convert",
            Document {
                map: a.map.display().to_string(),
                from: name(from),
                to: to.to_possible_value().map_or_else(String::new, |v| v.get_name().to_owned()),
                outputs: vec![a.out.display().to_string()],
                size: [image.width(), image.height()],
                depth: match depth {
                    Depth::U8 => "8",
                    Depth::U16 => "16",
                    Depth::F16 => "f16",
                    Depth::F32 => "f32",
                },
                simd: level.name(),
                threads: job.threads(),
                figures: figures.into_iter().collect(),
                time_ms: clock.wall,
                cpu_ms: clock.cpu,
                peak_bytes: job.peak(),
                findings: &findings,
            },
        )?;
    }
    Ok(())
}

fn options(a: &Convert, job: &Job) -> Options {
    Options {
        job: job.clone(),
        from: a.from.map(|f| match f {
            Holds::Height => Kind::Height,
            Holds::Normal => Kind::Normal,
        }),
        channel: match a.channel {
            Number::R => Channel::R,
            Number::G => Channel::G,
            Number::B => Channel::B,
            Number::A => Channel::A,
            Number::Luminance => Channel::Luminance,
            Number::RgbNorm => Channel::RgbNorm,
        },
        strength: a.strength.or_else(|| a.texel_size.map(|t| a.amplitude.unwrap_or(1.0) / t)),
        kernel: match a.kernel {
            SlopeKernel::Sobel => Kernel::Sobel,
            SlopeKernel::Central => Kernel::Central,
            SlopeKernel::Bicubic => Kernel::Bicubic,
            SlopeKernel::Forward => Kernel::Forward,
            SlopeKernel::Spline => Kernel::Spline,
        },
        edges: if a.tile { Edges::Wrap } else { Edges::Extend },
        from_y_down: a.from_y == Way::Down,
        y_down: a.y == Way::Down,
        channels: a.channels,
        dither: !a.no_dither,
        range: a.range,
        ..Options::default()
    }
}

fn kind(to: Target) -> Kind {
    match to {
        Target::Height => Kind::Height,
        Target::Derivative => Kind::Derivative,
        Target::Curvature => Kind::Curvature,
        _ => Kind::Normal,
    }
}

fn name(kind: Kind) -> &'static str {
    match kind {
        Kind::Height => "height",
        Kind::Normal => "normal",
        Kind::Derivative => "derivative",
        Kind::Curvature => "curvature",
    }
}

/// Words of the contract that this version cannot honour yet.
fn not_yet(to: Target) -> Result<()> {
    let word = match to {
        Target::Normal | Target::Height | Target::Derivative | Target::Curvature => return Ok(()),
        Target::Object | Target::Tangent | Target::Bc5 | Target::Bc7 | Target::Ktx2 => return Ok(()),
        Target::Cone => "cone",
        Target::Mesh => "mesh",
    };
    Err(Error::arguments(
        "arguments.not-yet",
        format!("--to {word} comes with a later version of frieze; {} has it not yet", env!("CARGO_PKG_VERSION")),
    ))
}

/// Blocks are made of 16 bits; uncompressed textures have 8 unless 16 are asked for.
fn hardware_depth(a: &Convert, to: Target) -> Result<Depth> {
    match (to, a.depth) {
        (Target::Ktx2, None | Some(MapDepth::Eight)) => Ok(Depth::U8),
        (Target::Ktx2, Some(MapDepth::Sixteen)) | (_, None) => Ok(Depth::U16),
        (Target::Ktx2, _) => Err(Error::arguments("write.depth", "a .ktx2 is written with 8 or 16 bits")),
        _ => Err(Error::arguments("write.depth", "blocks have a depth of their own: leave --depth out")),
    }
}

/// What the numbers are stored in: what was typed, if the file can hold it.
fn depth(out: &Path, typed: Option<MapDepth>) -> Result<Depth> {
    let kind = FileKind::of(out)?;
    let (usual, possible): (Depth, &[Depth]) = match kind {
        FileKind::Png => (Depth::U16, &[Depth::U8, Depth::U16]),
        FileKind::Exr => (Depth::F32, &[Depth::F16, Depth::F32]),
        FileKind::WebP => (Depth::U8, &[Depth::U8]),
        FileKind::Hdr | FileKind::Jpeg => {
            return Err(Error::arguments("write.format", "a map is not written to a lossy format")
                .in_file(out)
                .remedy("end the name in .png or .exr"));
        }
    };
    let depth = match typed {
        None => usual,
        Some(MapDepth::Eight) => Depth::U8,
        Some(MapDepth::Sixteen) => Depth::U16,
        Some(MapDepth::F16) => Depth::F16,
        Some(MapDepth::F32) => Depth::F32,
    };
    if possible.contains(&depth) {
        return Ok(depth);
    }
    Err(Error::arguments("write.depth", "a file of this ending does not hold numbers of this --depth")
        .in_file(out)
        .remedy("a .png holds 8 or 16 bits, an .exr f16 or f32, a .webp 8 bits"))
}
