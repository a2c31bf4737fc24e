//! What each stage of a frame costs: `cargo bench --bench stages`. With `count STAGE ROUNDS` one stage runs that often
//! and says nothing: `cargo xtask counts` counts its instructions.
#![allow(clippy::print_stdout)]

use frieze::image::pyramid::Pyramid;
use frieze::map::{Footprint, Map};
use frieze::math::lane::{Int, Kernel, Lane, Level, Num};
use frieze::math::vec::{Mat4, Vec2, Vec3, Vec4};
use frieze::mesh::meshlet::{Meshlets, Sources};
use frieze::prepare::{self, Prepared, View};
use frieze::raster::geometry::{Class, Slot};
use frieze::raster::tile::{self, NOTHING, PIXELS, Place, Uncut};
use frieze::raster::{Bins, Draw};
use frieze::render::{Format, frame};
use frieze::scene::{Camera, Material};
use frieze::shade::{Lamp, Lights, Look, Silent, Surface, shade};
use frieze::{Frame, Job, RenderOptions, Scene, samples, write};
use std::hint::black_box;
use std::sync::{Arc, Mutex};
use std::time::Instant;

const NAMES: [&str; 9] =
    ["cook", "cull", "transform-bin", "raster", "raster-4-samples", "lookup", "shade", "encode", "frame"];
/// Pixels that `lookup` and `shade` ask.
const ASKED: usize = 1 << 16;
const SIZE: (u32, u32) = (960, 540);

/// What all stages work on: an eighth of the 250k scene.
struct Bench {
    level: Level,
    /// One thread, which all stages run in.
    job: Job,
    scene: Scene,
    prepared: Prepared,
    camera: Camera,
    picture: Frame,
    look: Look,
    lamps: Vec<Lamp>,
    map: Map,
}

impl Bench {
    fn new() -> Self {
        let level = match std::env::var("FRIEZE_SIMD") {
            Ok(name) => Level::named(&name).expect("this CPU has the level that FRIEZE_SIMD names"),
            Err(_) => Level::best(),
        };
        let scene = samples::scaled("stress-250k", 0.125).expect("it is built in");
        let prepared = Prepared::new(&scene, &Job::default()).expect("it has no holes");
        let camera = prepared.camera(None, SIZE.0 as f32 / SIZE.1 as f32);
        let options = RenderOptions { level, size: SIZE, ..RenderOptions::default() };
        let picture = frame(&prepared, &options).expect("it can be drawn").0;
        let material: &Material = &scene.materials[0];
        let pyramid = |image: usize| Arc::new(Pyramid::new(&scene.images[image], false));
        let look = Look::new(material, |t, _| Map { pyramid: pyramid(t.image), filter: t.filter, wrap: t.wrap });
        let albedo = material.albedo_map.as_ref().expect("the scene is textured");
        let map = Map { pyramid: pyramid(albedo.image), filter: albedo.filter, wrap: albedo.wrap };
        let lamps = scene.lights.iter().map(|l| Lamp::new(l, None)).collect();
        let job = Job::builder().threads(1).build();
        Bench { level, job, prepared, camera, picture, look, lamps, map, scene }
    }

    fn view(&self, camera: &Camera, samples: u32) -> View {
        prepare::view(&self.prepared, camera, SIZE.0, SIZE.1, samples).expect("the camera sees something")
    }

    fn draws(&self, view: &View) -> Vec<Draw<'_>> {
        let slots = vec![Slot { cull_back: true, class: Class::Solid, look: 0 }];
        let instances = self.prepared.instances.iter().enumerate();
        instances
            .map(|(k, i)| Draw {
                mesh: &self.prepared.meshes[i.mesh],
                matrix: view.target.matrix.times(&i.transform),
                mirrored: i.mirrored,
                eye: i.transform.inverse().map_or([0.0; 4], |m| m.apply(view.eye.extend(1.0)).array()),
                order: k as u32,
                slots: slots.clone(),
            })
            .collect()
    }

    fn bins(&self, view: &View) -> Bins {
        Bins::new(self.level, &view.target, &self.draws(view), &Mutex::new(Vec::new()))
    }

    fn tiles(&self, view: &View, draws: &[Draw<'_>], bins: &Bins) {
        let (across, down) = view.target.tiles();
        for tile in 0..across * down {
            let place = Place { target: &view.target, bins, draws, tile };
            black_box(self.level.run(Raster(place)));
        }
    }

    /// Makes what a stage needs and returns the stage.
    fn stage<'a>(&'a self, name: &str) -> Box<dyn FnMut() + 'a> {
        match name {
            "cook" => Box::new(|| {
                for mesh in &self.scene.meshes {
                    let uv = [mesh.uv[0].as_ref(), mesh.uv[1].as_ref()];
                    let (normals, tangents) = (mesh.normals.as_ref(), mesh.tangents.as_ref());
                    let sources = Sources { normals, tangents, uv, colors: mesh.colors.as_ref() };
                    black_box(Meshlets::new(mesh, &sources));
                }
            }),
            "cull" => {
                // Looking away: all clusters are examined, none is drawn.
                let mut camera = self.camera.clone();
                let behind = camera.transform.column(2).xyz() * 1e4;
                for k in 0..3 {
                    camera.transform.0[3][k] += behind.array()[k];
                }
                let flip = Mat4::from_axes(
                    Vec3::new(-1.0, 0.0, 0.0),
                    Vec3::new(0.0, 1.0, 0.0),
                    Vec3::new(0.0, 0.0, -1.0),
                    Vec3::new(0.0, 0.0, 0.0),
                );
                camera.transform = camera.transform.times(&flip);
                let view = self.view(&camera, 1);
                Box::new(move || drop(black_box(self.bins(&view))))
            }
            "transform-bin" => {
                let view = self.view(&self.camera, 1);
                Box::new(move || drop(black_box(self.bins(&view))))
            }
            "raster" | "raster-4-samples" => {
                let view = self.view(&self.camera, if name == "raster" { 1 } else { 4 });
                let bins = self.bins(&view);
                Box::new(move || self.tiles(&view, &self.draws(&view), &bins))
            }
            "lookup" => Box::new(|| _ = black_box(self.level.run(Lookup(self)))),
            "shade" => Box::new(|| _ = black_box(self.level.run(Shade(self)))),
            "encode" => Box::new(|| {
                let mut bytes = Vec::new();
                write::png_to(&mut bytes, &self.picture, &self.job).expect("memory takes everything");
                black_box(bytes);
            }),
            "frame" => {
                let options = RenderOptions {
                    level: self.level,
                    size: SIZE,
                    format: Format::U8,
                    job: self.job.clone(),
                    ..RenderOptions::default()
                };
                Box::new(move || drop(black_box(frame(&self.prepared, &options).expect("it can be drawn"))))
            }
            _ => panic!("stages are {NAMES:?}"),
        }
    }
}

struct Raster<'a>(Place<'a>);

impl Kernel for Raster<'_> {
    type Out = f32;
    #[inline(always)]
    fn run<L: Lane>(self, l: L) -> f32 {
        let samples = self.0.target.samples as usize;
        let (mut depth, mut id) = (vec![0.0; PIXELS * samples], vec![NOTHING; PIXELS * samples]);
        tile::solid::<L, _, true>(l, &self.0, &mut Uncut, &mut depth, &mut id);
        depth[0]
    }
}

/// Place and footprint of pixels `k ..`: a plane seen at an angle, about a texel a pixel.
#[inline(always)]
fn place<L: Lane>(l: L, k: usize) -> (Vec2<L::F>, Footprint<L::F>) {
    let x = (l.ramp() + (k % 256) as i32).to_num();
    let y = (k / 256) as f32;
    let step = 1.3 / 1024.0;
    let place = Vec2::new(x * (step * 0.96) - y * step * 0.28 + 7.0, x * (step * 0.28) + y * step * 0.96);
    let f = |v: f32| l.f(v);
    (place, Footprint { dudx: f(step * 0.96), dvdx: f(step * 0.28), dudy: f(step * -0.28), dvdy: f(step * 0.96) })
}

struct Lookup<'a>(&'a Bench);

impl Kernel for Lookup<'_> {
    type Out = f32;
    #[inline(always)]
    fn run<L: Lane>(self, l: L) -> f32 {
        let mut sum = l.f(0.0);
        for k in (0..ASKED).step_by(L::WIDTH) {
            let (uv, footprint) = place(l, k);
            sum = sum + self.0.map.at(l, uv, footprint, l.mask(u32::MAX)).x;
        }
        sum.lane(0)
    }
}

struct Shade<'a>(&'a Bench);

impl Kernel for Shade<'_> {
    type Out = f32;
    #[inline(always)]
    fn run<L: Lane>(self, l: L) -> f32 {
        let b = self.0;
        let lights = Lights { lamps: &b.lamps, ambient: b.scene.ambient.color, per_light: false };
        let mut sum = l.f(0.0);
        for k in (0..ASKED).step_by(L::WIDTH) {
            let (uv, footprint) = place(l, k);
            let surface = Surface {
                active: l.mask(u32::MAX),
                position: Vec3::new(uv.x, uv.y, l.f(0.0)),
                view: Vec3::new(0.0, 0.6, 0.8).lift(uv.x),
                normal: Vec3::new(0.0, 0.0, 1.0).lift(uv.x),
                plane: Vec3::new(0.0, 0.0, 1.0).lift(uv.x),
                tangent: Vec3::new(1.0, 0.0, 0.0).lift(uv.x),
                sign: l.f(1.0),
                object: [Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 0.0, 1.0)],
                uv: [uv; 2],
                footprint: [footprint; 2],
                color: Vec4::splat(l.f(1.0)),
                lit: None,
            };
            sum = sum + shade(l, &b.look, &lights, &surface, &mut Silent).x;
        }
        sum.lane(0)
    }
}

/// What is run inside of this function is counted.
#[inline(never)]
fn counted(stage: &mut dyn FnMut()) {
    stage();
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|w| w != "--bench").collect();
    let bench = Bench::new();
    bench.job.run(|| match &words.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["count", name, rounds] => {
            let mut stage = bench.stage(name);
            (0..rounds.parse().expect("ROUNDS is a number")).for_each(|_: u32| counted(&mut *stage));
        }
        chosen => {
            println!("{}, one thread, {}x{}; median of 15", bench.level.name(), SIZE.0, SIZE.1);
            for name in NAMES.into_iter().filter(|n| chosen.is_empty() || chosen.contains(n)) {
                let mut stage = bench.stage(name);
                stage();
                let mut times: Vec<f64> = (0..15)
                    .map(|_| {
                        let start = Instant::now();
                        stage();
                        start.elapsed().as_secs_f64() * 1e3
                    })
                    .collect();
                times.sort_by(f64::total_cmp);
                println!("{name:18}{:9.3} ms", times[7]);
            }
        }
    });
}
