//! What a frame is, seen from outside: how often light is computed (rows 15 to 17), what is counted (row 20), what
//! filters do to a ground (row 48), that memory is asked for, work can be stopped and progress is told, and what is odd.

#[path = "pictures/exact.rs"]
mod exact;
#[path = "../examples/ground_filters.rs"]
mod ground_filters;

use exact::{Random, bare, flat_camera, floats, ids, plain, rgba, shoot, shoot_and_count, soup};
use frieze::error::Fault;
use frieze::image::{Encoding, Image, Pixels};
use frieze::job::Job;
use frieze::math::vec::{Mat4, Vec3};
use frieze::mesh::{Mesh, shape};
use frieze::prepare::Prepared;
use frieze::render::{Aov, Format, RenderOptions, frame, light_depth};
use frieze::scene::{Camera, Light, Material, Scene, Shading, Shadow, Texture};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex};

const UP: Vec3 = Vec3::new(0.0, 1.0, 0.0);
const ORIGIN: Vec3 = Vec3::new(0.0, 0.0, 0.0);

// ---- how often light is computed --------------------------------------------------------------------------

/// A coarse ball under one light.
fn ball(shading: Shading) -> Scene {
    let mut scene = bare(Camera::look_at(Vec3::new(0.4, 0.7, 3.0), ORIGIN, UP, 45.0));
    scene.ambient.color = [0.1, 0.2, 0.3];
    let light = Light::directional(Vec3::new(-2.0, 3.0, 4.0), ORIGIN);
    scene.lights.push(Light { intensity: 0.9, shadow: None, ..light });
    let look = scene.add_material(Material {
        shading,
        albedo: [0.2, 0.4, 0.6],
        specular: [0.7; 3],
        shininess: 40.0,
        ..Material::default()
    });
    scene.add(shape::sphere(2.0, 14), Mat4::IDENTITY, look);
    scene
}

/// Rows 5 to 8 in double precision, at a point with a unit normal.
fn blinn_phong(scene: &Scene, point: [f64; 3], normal: [f64; 3]) -> [f64; 3] {
    let m = &scene.materials[0];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let unit = |v: [f64; 3]| v.map(|c| c / dot(v, v).sqrt());
    let light = &scene.lights[0];
    let l = light.direction.array().map(|c| -f64::from(c));
    let eye = scene.cameras[0].eye().array().map(f64::from);
    let v = unit(core::array::from_fn(|k| eye[k] - point[k]));
    let h = unit(core::array::from_fn(|k| l[k] + v[k]));
    let power = frieze::math::exact::pow_f64(dot(normal, h).max(0.0), f64::from(m.shininess));
    let diffuse = dot(normal, l).max(0.0);
    let specular = if diffuse > 0.0 { power } else { 0.0 };
    core::array::from_fn(|k| {
        let (kd, ks) = (f64::from(m.albedo[k]), f64::from(m.specular[k]));
        kd * f64::from(scene.ambient.color[k]) + f64::from(light.intensity) * (kd * diffuse + ks * specular)
    })
}

fn near(got: [f32; 4], want: [f64; 3], slack: f64) -> bool {
    got[..3].iter().zip(want).all(|(g, w)| (f64::from(*g) - w).abs() < slack)
}

// Row 15, on the picture: one colour per triangle, that of its centroid with its own normal.
#[test]
fn row_15_a_flat_triangle_has_one_color_in_the_picture() {
    let scene = ball(Shading::Flat);
    let frame = shoot(&scene, (160, 140), 1, &[Aov::Triangle]);
    let mut seen: BTreeMap<u32, ([u32; 3], usize)> = BTreeMap::new();
    for (c, id) in rgba(&frame).iter().zip(ids(&frame, 0)).filter(|(_, id)| **id != u32::MAX) {
        let bits = [c[0], c[1], c[2]].map(f32::to_bits);
        let entry = seen.entry(*id).or_insert((bits, 0));
        assert_eq!(entry.0, bits, "triangle {id}");
        entry.1 += 1;
    }
    assert!(seen.len() > 50 && seen.values().any(|(_, n)| *n > 100), "{seen:?}");
    let mesh = &scene.meshes[0];
    for (id, (bits, _)) in &seen {
        let p = mesh.triangle(*id as usize).map(|c| Vec3::from(mesh.position(c)));
        let n = (p[1] - p[0]).cross(p[2] - p[0]).normalize().array().map(f64::from);
        let middle = ((p[0] + p[1] + p[2]) / 3.0).array().map(f64::from);
        let [r, g, b] = bits.map(f32::from_bits);
        let want = blinn_phong(&scene, middle, n);
        // The 40th power of a cosine in single precision.
        assert!(near([r, g, b, 1.0], want, 2e-5), "triangle {id}: {r} {g} {b} {want:?}");
    }
    let colors: std::collections::BTreeSet<_> = seen.values().map(|(bits, _)| *bits).collect();
    assert!(colors.len() > seen.len() / 2, "triangles differ from one another");
}

// Rows 16 and 17, on the picture: Gouraud interpolates the colours of the corners, Phong computes them at each pixel, and
// the highlight that lies between corners is lost to Gouraud.
#[test]
fn row_16_and_17_gouraud_interpolates_what_phong_computes() {
    let scene = ball(Shading::Gouraud);
    let mesh = &scene.meshes[0];
    let normals = mesh.normals.as_ref().unwrap();
    let frame = shoot(&scene, (160, 140), 1, &[Aov::Triangle, Aov::Barycentric]);
    let mut brightest = [0.0f32; 2];
    for (k, c) in rgba(&frame).iter().enumerate().filter(|(_, c)| c[3] > 0.0) {
        let triangle = ids(&frame, 0)[k] as usize;
        let weights = floats::<3>(&frame, 1)[k].map(f64::from);
        let mut want = [0.0; 3];
        for (corner, w) in mesh.triangle(triangle).into_iter().zip(weights) {
            let n = Vec3::from(normals.at(mesh, corner)).normalize().array().map(f64::from);
            let at = blinn_phong(&scene, mesh.position(corner).map(f64::from), n);
            (0..3).for_each(|i| want[i] += w * at[i]);
        }
        assert!(near(*c, want, 2e-5), "pixel {k}: {c:?} {want:?}");
        brightest[0] = brightest[0].max(c[0]);
    }
    let scene = ball(Shading::Phong);
    let frame = shoot(&scene, (160, 140), 1, &[Aov::Position, Aov::Normal]);
    for (k, c) in rgba(&frame).iter().enumerate().filter(|(_, c)| c[3] > 0.0) {
        let (p, n) = (floats::<3>(&frame, 0)[k], floats::<3>(&frame, 1)[k]);
        let want = blinn_phong(&scene, p.map(f64::from), n.map(f64::from));
        assert!(near(*c, want, 2e-5), "pixel {k}: {c:?} {want:?}");
        brightest[1] = brightest[1].max(c[0]);
    }
    assert!(brightest[0] < brightest[1] * 0.95, "{brightest:?}");
}

// ---- what is counted ---------------------------------------------------------------------------------------

/// A sheet of 7 x 7 quads that fills a picture of 56 x 56 pixels, 8 pixels each: 64 vertices and 98 triangles are one
/// cluster.
fn counted() -> Scene {
    let mut mesh = Mesh::default();
    for (j, i) in (0..8).flat_map(|j| (0..8).map(move |i| (j, i))) {
        mesh.positions.push([i as f32 * 8.0, j as f32 * 8.0, 100.0]);
    }
    for (j, i) in (0..7u32).flat_map(|j| (0..7u32).map(move |i| (j, i))) {
        mesh.corners.extend([[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]].map(|[a, b]| (j + b) * 8 + i + a));
    }
    let mut scene = bare(flat_camera(56, 56));
    let look = scene.add_material(plain());
    scene.add(mesh, Mat4::IDENTITY, look);
    scene
}

fn counters(scene: &Scene, samples: u32) -> BTreeMap<&'static str, u64> {
    shoot_and_count(scene, (56, 56), samples, &[]).1.counters.into_iter().collect()
}

// Row 20: each stage says what it did.
#[test]
fn row_20_the_counters_of_a_frame_are_what_its_stages_did() {
    let mut scene = counted();
    let want = |pairs: [(&'static str, u64); 6]| BTreeMap::from(pairs);
    let plain_frame = want([
        ("vertices_transformed", 64),
        ("triangles_examined", 98),
        ("triangles_binned", 98),
        ("shadow_samples", 0),
        ("pixels_shaded", 56 * 56),
        ("samples", 56 * 56),
    ]);
    assert_eq!(counters(&scene, 1), plain_frame);
    // With four samples the pixels on the diagonals, eight per quad, are shaded for both triangles.
    let four = counters(&scene, 4);
    assert_eq!((four["pixels_shaded"], four["samples"]), (56 * 56 + 49 * 8, 4 * 56 * 56));
    // What no sample can see is examined, not binned: slivers between centres, beside a triangle that is seen.
    let mut few = vec![[[10.1, 9.7, 200.0], [20.0, 9.7, 200.0], [15.0, 9.9, 200.0]]; 5];
    few.push([[10.0, 10.0, 200.0], [20.0, 10.0, 200.0], [10.0, 20.0, 200.0]]);
    scene.add(soup(&few), Mat4::IDENTITY, 0);
    let slivers = counters(&scene, 1);
    assert_eq!((slivers["triangles_examined"], slivers["triangles_binned"]), (104, 99));
    assert_eq!(slivers["pixels_shaded"], 56 * 56);
    // What lies beside the picture is not even transformed.
    scene.objects[1].transform = Mat4::translation(Vec3::new(500.0, 0.0, 0.0));
    assert_eq!(counters(&scene, 1), plain_frame);
    // A shadow map is a second view, and costs what its texels are. The fitted light sees all from the side.
    scene.objects.truncate(1);
    let light = Light::directional(Vec3::new(0.3, 0.2, 1.0), ORIGIN);
    scene.lights.push(Light { shadow: Some(Shadow { size: 200, ..Shadow::default() }), ..light });
    let lit = counters(&scene, 1);
    assert_eq!((lit["vertices_transformed"], lit["triangles_examined"], lit["triangles_binned"]), (128, 196, 196));
    assert_eq!((lit["shadow_samples"], lit["pixels_shaded"]), (200 * 200, 56 * 56));
}

#[test]
fn row_20_nothing_of_a_frame_is_kept_for_the_next() {
    let mut scene = ball(Shading::Phong);
    scene.lights[0].shadow = Some(Shadow { size: 128, ..Shadow::default() });
    let options = RenderOptions { size: (70, 50), ..RenderOptions::default() };
    let prepared = Prepared::new(&scene, &options.job).unwrap();
    let (first, counted) = frame(&prepared, &options).unwrap();
    let elsewhere = Camera::look_at(Vec3::new(1.0, 0.2, 3.0), ORIGIN, UP, 45.0);
    let (other, _) = frame(&prepared, &RenderOptions { camera: Some(elsewhere), ..options.clone() }).unwrap();
    let (again, counted_again) = frame(&prepared, &options).unwrap();
    assert_eq!((&first, &counted.counters), (&again, &counted_again.counters));
    assert!(first != other);
    let stages: Vec<_> = counted.stages.iter().map(|(name, _)| *name).collect();
    assert_eq!(stages, counted_again.stages.iter().map(|(name, _)| *name).collect::<Vec<_>>());
    assert!(stages.len() >= 3, "{stages:?}");
}

// ---- filters on a ground -----------------------------------------------------------------------------------

// Row 48: moiré without mip levels, blur with them, and the sheet that shows it.
#[test]
fn row_48_the_far_field_is_moire_blur_or_right_and_a_sheet_shows_it() {
    let size = (120, 66);
    let options = RenderOptions { size, format: Format::F32, aovs: vec![Aov::Depth], ..RenderOptions::default() };
    let frames = ground_filters::FILTERS.map(|(_, filter)| ground_filters::picture(filter, &options).unwrap());
    let reference = rgba(&frames[3]);
    // Spread of a band of depths, and distance from the reference there.
    let band = |k: usize, from: f32, to: f32| {
        let depth = floats::<1>(&frames[k], 0);
        let here: Vec<usize> = (0..depth.len()).filter(|p| (from..to).contains(&depth[*p][0])).collect();
        assert!(here.len() > 300, "{from} to {to}: {}", here.len());
        let n = here.len() as f32;
        let mean = here.iter().map(|p| rgba(&frames[k])[*p][0]).sum::<f32>() / n;
        let root = |f: &dyn Fn(usize) -> f32| (here.iter().map(|p| f(*p) * f(*p)).sum::<f32>() / n).sqrt();
        let (spread, error) =
            (|p: usize| rgba(&frames[k])[p][0] - mean, |p: usize| rgba(&frames[k])[p][0] - reference[p][0]);
        (mean, root(&spread), root(&error))
    };
    let [far, middle] = [(50.0, 390.0), (12.0, 20.0)].map(|(a, b)| [0, 1, 2, 3].map(|k| band(k, a, b)));
    // Light and dark cells cover the same area; their spread is half of their difference.
    let cells = rgba(&frames[0]).iter().zip(floats::<1>(&frames[0], 0)).filter(|(_, d)| d[0] < 20.0).map(|(c, _)| c[0]);
    let (dark, light) = cells.fold((1.0f32, 0.0f32), |(lo, hi), v| (lo.min(v), hi.max(v)));
    let spread = (light - dark) / 2.0;
    for (k, (mean, ..)) in far.into_iter().enumerate().skip(1) {
        assert!((mean - (light + dark) / 2.0).abs() < 0.02, "{k}: {far:?}");
    }
    assert!(far[0].1 > 0.9 * spread && far[0].2 > 0.9 * spread, "nearest is moiré far away: {far:?}");
    assert!(far[1].1 < 0.05 * spread && far[3].1 < 0.3 * spread, "mip levels are grey far away: {far:?}");
    assert!(middle[1].1 < 0.5 * middle[3].1, "trilinear blurs too early: {middle:?}");
    assert!(middle[2].1 > 0.9 * middle[3].1, "anisotropic does not: {middle:?}");
    assert!(middle[2].2 < 0.2 * middle[1].2 && middle[2].2 < 0.2 * middle[0].2, "{middle:?}");

    let options = RenderOptions { size, ..RenderOptions::default() };
    let small = ground_filters::FILTERS.map(|(_, filter)| ground_filters::picture(filter, &options).unwrap().color);
    let sheet = ground_filters::sheet(&small).unwrap();
    assert_eq!((sheet.width(), sheet.height()), (2 * 120 + 4, 2 * 66 + 4));
    for (k, picture) in small.iter().enumerate() {
        let (x0, y0) = (k as u32 % 2 * 124, k as u32 / 2 * 70);
        for (y, x) in (0..66).flat_map(|y| (0..120).map(move |x| (y, x))) {
            assert_eq!(sheet.rgba(x0 + x, y0 + y)[..3], picture.rgba(x, y)[..3], "{k}: {x},{y}");
        }
    }
}

// ---- memory, cancelling, progress --------------------------------------------------------------------------

/// A scene with everything that takes memory: geometry, a texture, a shadow map.
fn heavy() -> Scene {
    let mut scene = ball(Shading::Phong);
    let image = Image::new(64, 64, 4, Pixels::U8(vec![200; 64 * 64 * 4]), Encoding::Srgb).unwrap();
    let image = scene.add_image(image);
    scene.materials[0].albedo_map = Some(Texture::new(image));
    scene.lights[0].shadow = Some(Shadow { size: 128, ..Shadow::default() });
    scene
}

#[test]
fn what_a_frame_holds_is_reserved_and_given_back() {
    let scene = heavy();
    let job = Job::builder().threads(1).build();
    let prepared = Prepared::new(&scene, &job).unwrap();
    let cooked: u64 = prepared.meshes.iter().map(|m| m.bytes()).sum();
    let map = prepared.map(scene.materials[0].albedo_map.as_ref().unwrap(), true);
    assert!(job.peak() >= cooked + map.pyramid.bytes(), "{} for {cooked} and {}", job.peak(), map.pyramid.bytes());
    for (size, format, aovs) in [
        ((300, 200), Format::U8, vec![]),
        ((300, 200), Format::F32, vec![Aov::Normal, Aov::Depth, Aov::Object]),
        ((64, 64), Format::U16, vec![Aov::Barycentric]),
    ] {
        let own = Job::builder().threads(1).build();
        let options = RenderOptions { job: own.clone(), size, samples: 4, format, aovs, ..RenderOptions::default() };
        let (picture, _) = frame(&prepared, &options).unwrap();
        let floats: usize = options.aovs.iter().map(|a| a.channels().len()).sum();
        let pixels = u64::from(size.0) * u64::from(size.1);
        let held = picture.color.bytes() + pixels * floats as u64 * 4 + 128 * 128 * 4;
        assert!(own.peak() >= held, "{size:?}: {} for {held}", own.peak());
        // With exactly that much it works, with a byte less it is refused, and nothing stays reserved.
        for (memory, fits) in [(own.peak(), true), (own.peak() - 1, false)] {
            let job = Job::builder().threads(1).memory(memory).build();
            let result = frame(&prepared, &RenderOptions { job: job.clone(), ..options.clone() });
            assert_eq!(result.map(|_| ()).map_err(|e| e.fault), if fits { Ok(()) } else { Err(Fault::Memory) });
            assert!(job.reserve(memory, "all of it").is_ok());
        }
    }
    // What was prepared is held as long as it lives.
    let total = job.peak();
    let job = Job::builder().memory(total).build();
    let prepared = Prepared::new(&scene, &job).unwrap();
    assert!(job.reserve(1, "one byte more").is_err());
    drop(prepared);
    assert!(job.reserve(total, "all of it").is_ok());
    let refused = Prepared::new(&scene, &Job::builder().memory(total - 1).build()).unwrap_err();
    assert_eq!(refused.fault, Fault::Memory);
}

#[test]
fn cancelled_work_ends_soon_and_gives_its_memory_back() {
    let scene = heavy();
    let prepared = Prepared::new(&scene, &Job::default()).unwrap();
    // Before it begins.
    let job = Job::default();
    job.cancel();
    let options = RenderOptions { job: job.clone(), size: (40, 40), ..RenderOptions::default() };
    assert_eq!(Prepared::new(&scene, &job).map(|_| ()).unwrap_err().fault, Fault::Interrupted);
    assert_eq!(frame(&prepared, &options).unwrap_err().fault, Fault::Interrupted);
    assert_eq!(light_depth(&prepared, 0, &options).unwrap_err().fault, Fault::Interrupted);
    // Once the third of 64 tiles is done; each thread may end the tile that it is at.
    for threads in [1, 2, 5] {
        let (flag, told) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
        let (set, tell) = (flag.clone(), told.clone());
        let job = Job::builder().threads(threads).memory(1 << 30).cancel_flag(flag).on_progress(move |p| {
            if p.stage == "render" {
                tell.fetch_add(1, Relaxed);
                set.fetch_or(p.done >= 3, Relaxed);
            }
        });
        let job = job.build();
        let options = RenderOptions { job: job.clone(), size: (512, 512), ..RenderOptions::default() };
        assert_eq!(frame(&prepared, &options).unwrap_err().fault, Fault::Interrupted);
        let told = told.load(Relaxed);
        assert!(told >= 3 && told < 3 + threads as u64, "{told} tiles with {threads} threads");
        assert!(job.reserve(1 << 30, "all of it").is_ok());
    }
    // While it is prepared.
    let flag = Arc::new(AtomicBool::new(false));
    let set = flag.clone();
    let job = Job::builder().cancel_flag(flag).on_progress(move |p| set.store(p.stage == "prepare", Relaxed)).build();
    assert_eq!(Prepared::new(&scene, &job).map(|_| ()).unwrap_err().fault, Fault::Interrupted);
}

#[test]
fn progress_counts_each_tile_once() {
    let mut r = Random(31);
    let scene = counted();
    let prepared = Prepared::new(&scene, &Job::default()).unwrap();
    for size in [(56, 56), (129, 64), (200, 330)] {
        let told = Arc::new(Mutex::new(Vec::new()));
        let tell = told.clone();
        let job = Job::builder().threads(1 + r.below(4) as usize).on_progress(move |p| {
            if p.stage == "render" {
                tell.lock().unwrap().push((p.done, p.total));
            }
        });
        let options = RenderOptions { job: job.build(), size, ..RenderOptions::default() };
        frame(&prepared, &options).unwrap();
        let total = u64::from(size.0.div_ceil(64) * size.1.div_ceil(64));
        let mut told = told.lock().unwrap().clone();
        told.sort_unstable();
        assert_eq!(told, (1..=total).map(|k| (k, total)).collect::<Vec<_>>(), "{size:?}");
    }
}

// ---- what cannot be drawn, and what is odd --------------------------------------------------------------------

#[test]
fn what_cannot_be_drawn_is_an_error_with_a_code() {
    let code = |scene: &Scene, options: &RenderOptions| {
        let error = frieze::render(scene, options).map(|_| ()).expect_err("it cannot be drawn");
        assert_eq!(error.fault, Fault::Arguments, "{error}");
        error.code
    };
    let good = heavy();
    let usual = RenderOptions { size: (20, 20), ..RenderOptions::default() };
    let changed = |change: &dyn Fn(&mut Scene)| {
        let mut scene = good.clone();
        change(&mut scene);
        code(&scene, &usual)
    };
    for change in [
        &(|s: &mut Scene| s.objects[0].mesh = 1) as &dyn Fn(&mut Scene),
        &|s| s.objects[0].materials = vec![0, 1],
        &|s| s.materials[0].albedo_map.as_mut().unwrap().image = 1,
        &|s| s.view = frieze::scene::View::Camera(1),
    ] {
        assert_eq!(changed(change), "scene.index");
    }
    for supersample in [0, 3, 16] {
        assert_eq!(changed(&|s| s.output.supersample = supersample), "render.supersample");
    }
    for samples in [2, 3, 5, 32] {
        assert_eq!(code(&good, &RenderOptions { samples, ..usual.clone() }), "render.samples");
    }
    for size in [(0, 5), (5, 0), (16385, 1), (1, 16385)] {
        assert_eq!(code(&good, &RenderOptions { size, ..usual.clone() }), "render.size");
    }
    // Supersampling counts.
    let wide = RenderOptions { size: (2049, 1), ..usual.clone() };
    let mut scene = good.clone();
    scene.output.supersample = 8;
    assert_eq!(code(&scene, &wide), "render.size");
    for transform in [Mat4::scale(ORIGIN), Mat4::scale(Vec3::splat(f32::NAN))] {
        let camera = Camera { transform, ..good.cameras[0].clone() };
        assert_eq!(code(&good, &RenderOptions { camera: Some(camera), ..usual.clone() }), "render.camera");
    }
    for (near, far) in [(0.0, 10.0), (-1.0, 10.0), (2.0, 2.0), (3.0, 2.0), (f32::NAN, 10.0), (1.0, f32::NAN)] {
        let camera = Camera { near, far, ..good.cameras[0].clone() };
        assert_eq!(
            code(&good, &RenderOptions { camera: Some(camera), ..usual.clone() }),
            "render.camera",
            "{near} {far}"
        );
    }
}

// Whatever a caller puts into a scene, something is drawn and nothing panics.
#[test]
fn odd_numbers_in_a_scene_are_drawn_somehow() {
    let odd = [0.0f32, -0.0, 1e-38, 1e38, -1e38, f32::MAX, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 1.0, 3.0, -2.0];
    let mut r = Random(32);
    for round in 0..60 {
        let mut scene = ball(Shading::Phong);
        let mut number = |often: u64| if r.below(often) == 0 { odd[r.below(12) as usize] } else { r.within(-2.0, 2.0) };
        let mut mesh = soup(&(0..20).map(|_| [(); 3].map(|()| [(); 3].map(|()| number(6)))).collect::<Vec<_>>());
        if round % 3 == 0 {
            let values = (0..60).map(|_| [(); 3].map(|()| number(4))).collect();
            mesh.normals = Some(frieze::mesh::Attribute::per_position(values));
        }
        scene.add(mesh, Mat4::from_columns([(); 16].map(|()| number(12))), 0);
        let material = &mut scene.materials[0];
        material.double_sided = round % 2 == 0;
        material.shininess = number(3);
        if round % 5 == 0 {
            material.alpha = frieze::scene::Alpha::Blend;
            material.opacity = number(2);
        }
        scene.lights[0].shadow = Some(Shadow { size: 70, ..Shadow::default() });
        scene.lights[0].intensity = number(3);
        let options = RenderOptions {
            size: (70, 40),
            samples: [1, 4, 8, 16][round % 4],
            aovs: Aov::ALL.map(|(_, aov)| aov).to_vec(),
            format: [Format::U8, Format::F32][round % 2],
            ..RenderOptions::default()
        };
        let frame = frieze::render(&scene, &options).expect("odd, not wrong");
        assert_eq!((frame.color.width(), frame.planes.len()), (70, 12), "round {round}");
    }
}
