//! Normal maps in whole pictures (rows 49 to 64): spaces, conventions, transforms, the two ways of document 001, what
//! does not fit, and seams that must not be seen.

#[path = "pictures/exact.rs"]
mod exact;

use exact::{bare, floats, rgba, shoot};
use frieze::Frame;
use frieze::image::{Encoding, Image, Pixels};
use frieze::job::Job;
use frieze::map::normal;
use frieze::map::{Filter, Wrap};
use frieze::math::vec::{Mat4, Vec3};
use frieze::mesh::{Mesh, shape};
use frieze::prepare::Prepared;
use frieze::render::Aov;
use frieze::samples;
use frieze::scene::{
    Camera, Light, Material, NormalMap, NormalSpace, NormalZero, Projection, Scene, TangentFrame, TbnPath, Texture,
};

const UP: Vec3 = Vec3::new(0.0, 1.0, 0.0);

/// A quarter turn about x, y or z, and others: turns by `degrees` about an axis.
fn turn(axis: Vec3, degrees: f32) -> Mat4 {
    let half = degrees.to_radians() * 0.5;
    let a = axis.normalize() * frieze::math::exact::sin(half);
    Mat4::rotation([a.x, a.y, a.z, frieze::math::exact::cos(half)])
}

/// An 8-bit RGB image of `f(x, y)`, each 0 ..= 1 from the upper left corner.
fn rgb(n: usize, f: impl Fn(f32, f32) -> [f32; 3]) -> Image {
    let at = |k: usize| (k as f32 + 0.5) / n as f32;
    let texel = |k: usize| f(at(k % n), at(k / n)).map(|v| normal::quantize(v, 255) as u8);
    Image::new(n as u32, n as u32, 3, Pixels::U8((0..n * n).flat_map(texel).collect()), Encoding::Linear).unwrap()
}

/// A +Y map with slopes on both axes that no symmetry hides.
fn waves() -> Image {
    let wave = |x: f32| frieze::math::exact::sin(x * std::f32::consts::TAU);
    rgb(64, |u, v| {
        let n = Vec3::new(0.5 * wave(u) + 0.2, 0.4 * wave(v + 0.1) - 0.15, 1.0).normalize();
        normal::encode(n, false).array()
    })
}

/// A mesh with a normal map, one light, orthographic from +Z.
fn shown(mesh: Mesh, transform: Mat4, map: Image, change: impl Fn(&mut Material)) -> Scene {
    let eye = Vec3::new(0.0, 0.0, 5.0);
    let camera = Camera::look_at(eye, Vec3::splat(0.0), UP, 30.0);
    let mut scene = bare(Camera { projection: Projection::Orthographic { height: 2.2 }, ..camera });
    let image = scene.add_image(map);
    let mut material = Material {
        albedo: [0.7, 0.6, 0.5],
        normal_map: Some(NormalMap { texture: Texture::new(image), scale: 1.0, y_down: false, channels: 3 }),
        ..Material::default()
    };
    change(&mut material);
    let material = scene.add_material(material);
    scene.add(mesh, transform, material);
    scene.lights.push(Light { shadow: None, ..Light::directional(Vec3::new(1.0, 2.0, 3.0), Vec3::splat(0.0)) });
    scene
}

/// Turns camera, lights and, when asked, objects.
fn turned(scene: &Scene, by: &Mat4, objects: bool) -> Scene {
    let mut scene = scene.clone();
    scene.cameras[0].transform = by.times(&scene.cameras[0].transform);
    for light in &mut scene.lights {
        light.direction = by.direction(light.direction);
        light.position = by.point(light.position);
    }
    for object in scene.objects.iter_mut().filter(|_| objects) {
        object.transform = by.times(&object.transform);
    }
    scene
}

/// A quarter of the picture's pixels at least, and the 99th percentile of the difference of their colours: outlines may
/// gain or lose a pixel when everything turns.
fn difference(a: &Frame, b: &Frame) -> f32 {
    let pairs = rgba(a).iter().zip(rgba(b)).filter(|(a, b)| a[3] == 1.0 && b[3] == 1.0);
    let mut d: Vec<f32> = pairs.map(|(a, b)| (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max)).collect();
    assert!(d.len() * 4 > rgba(a).len() && d.iter().all(|v| v.is_finite()));
    d.sort_by(f32::total_cmp);
    d[d.len() * 99 / 100]
}

const SIZE: (u32, u32) = (96, 96);

fn picture(scene: &Scene) -> Frame {
    shoot(scene, SIZE, 1, &[Aov::Normal, Aov::Position, Aov::Uv])
}

/// Directions are turned in f32, and a highlight's exponent multiplies their error.
const TURNED: f32 = 2e-4;

/// The rainbow: the unit normals of a lat-long sphere, as an object-space map.
fn rainbow() -> Image {
    rgb(128, |u, v| {
        let (s, c) = frieze::math::exact::sin_cos_f64(f64::from(u) * std::f64::consts::TAU);
        let (sv, cv) = frieze::math::exact::sin_cos_f64(f64::from(v) * std::f64::consts::PI);
        // u = 0 at -Z, 1/4 at -X, 1/2 at +Z.
        normal::encode(Vec3::new((-s * sv) as f32, cv as f32, (-c * sv) as f32), false).array()
    })
}

#[test]
fn row_50_an_object_space_map_turns_with_the_object() {
    let object = |m: &mut Material| m.normal_space = NormalSpace::Object;
    // On a coarse ball the map says what the round ball would.
    let still = shown(shape::sphere(2.0, 12), Mat4::IDENTITY, rainbow(), object);
    let plain = picture(&still);
    let mut seen = 0;
    for (n, uv) in floats::<3>(&plain, 0).iter().zip(floats::<2>(&plain, 2)) {
        if n == &[0.0; 3] || uv[1] < 0.1 || uv[1] > 0.9 {
            continue;
        }
        let (s, c) = frieze::math::exact::sin_cos_f64(f64::from(uv[0]) * std::f64::consts::TAU);
        let (sv, cv) = frieze::math::exact::sin_cos_f64(f64::from(uv[1]) * std::f64::consts::PI);
        let want = Vec3::new((-s * sv) as f32, cv as f32, (-c * sv) as f32);
        if want.z < 0.4 {
            continue;
        }
        // Half a code, and a texel of 1/128 turn seen through its neighbours.
        assert!((Vec3::from(*n) - want).length() < 0.012, "{n:?} {want:?}");
        seen += 1;
    }
    assert!(seen > 2000);
    // Turned with camera and light nothing changes; turned alone it is as if the light had turned back.
    for (axis, degrees) in [(UP, 90.0), (Vec3::new(1.0, 2.0, -0.5), 77.0)] {
        let by = turn(axis, degrees);
        assert!(difference(&plain, &picture(&turned(&still, &by, true))) < TURNED);
        let back = turned(&still, &by.inverse().unwrap(), false);
        let mut alone = still.clone();
        alone.objects[0].transform = by;
        assert!(difference(&picture(&alone), &picture(&back)) < TURNED);
    }
    // A mirror image has mirrored normals; scaling takes the normal matrix (row 64).
    for scale in [Vec3::new(-1.0, 1.0, 1.0), Vec3::new(1.0, 0.5, 2.0)] {
        let mut other = still.clone();
        other.objects[0].transform = Mat4::scale(scale);
        let frame = picture(&other);
        for (n, p) in floats::<3>(&frame, 0).iter().zip(floats::<3>(&frame, 1)).filter(|(n, _)| **n != [0.0; 3]) {
            let p = Vec3::from(*p).zip(scale, |p, s| p / s);
            if p.y.abs() < 0.85 * p.length() {
                let want = p.normalize().zip(scale, |p, s| p / s).normalize();
                // The coarse ball lies up to 0.07 below the round one, so places differ from directions.
                assert!(want.z < 0.3 || Vec3::from(*n).dot(want) > 0.97, "{n:?} {want:?}");
            }
        }
    }
}

/// Whether codes are among the findings of a scene.
fn codes(scene: &Scene) -> Vec<&'static str> {
    let prepared = Prepared::new(scene, &Job::default()).unwrap();
    prepared.findings.iter().map(|f| f.code).collect()
}

#[test]
fn row_51_and_55_a_world_space_map_is_right_facing_z_and_wrong_facing_y() {
    let upright = turn(Vec3::new(1.0, 0.0, 0.0), 90.0);
    let world = |m: &mut Material| m.normal_space = NormalSpace::World;
    // Facing +z the frame is the world's axes: both readings of the map agree.
    let tangent_z = shown(shape::plane(2.0, 1), upright, waves(), |_| ());
    let world_z = shown(shape::plane(2.0, 1), upright, waves(), world);
    let (a, b) = (picture(&tangent_z), picture(&world_z));
    assert!(difference(&a, &b) < TURNED);
    // Facing +y, camera and light turned likewise: the tangent-space map gives the same picture, the other does not.
    let to_y = turn(Vec3::new(1.0, 0.0, 0.0), -90.0);
    let (tangent_y, world_y) = (turned(&tangent_z, &to_y, true), turned(&world_z, &to_y, true));
    assert!(difference(&a, &picture(&tangent_y)) < TURNED);
    assert!(difference(&b, &picture(&world_y)) > 0.2);
    // A plane lies when it is not turned; what is turned is told.
    assert_eq!(codes(&world_y), [""; 0]);
    assert_eq!(codes(&world_z), ["normal.world-space-turned"]);
    assert_eq!(codes(&tangent_y), [""; 0]);
}

#[test]
fn row_54_a_wall_has_relief_only_with_its_map() {
    let with = samples::scene("wall").unwrap();
    let mut without = with.clone();
    without.materials[0].normal_map = None;
    let (a, b) = (shoot(&with, SIZE, 1, &[Aov::Normal]), shoot(&without, SIZE, 1, &[Aov::Normal]));
    let turned = |f: &Frame| floats::<3>(f, 0).iter().filter(|n| n[2] < 0.99).count();
    assert!(turned(&b) == 0 && turned(&a) > 1000);
    assert!(difference(&a, &b) > 0.05);
}

#[test]
fn row_52_and_49_a_constant_flat_map_is_no_map() {
    let flat = || rgb(4, |_, _| [128.0 / 255.0, 128.0 / 255.0, 1.0]);
    let scene = |change: &dyn Fn(&mut Material)| shown(shape::sphere(2.0, 24), Mat4::IDENTITY, flat(), change);
    let without = picture(&scene(&|m| m.normal_map = None));
    for frame in [TangentFrame::Mikktspace, TangentFrame::Average, TangentFrame::PerTriangle, TangentFrame::FromNormal]
    {
        // With the exact zero bit for bit the same normal; the usual zero leans by 0.32 degrees.
        let with = |zero| {
            picture(&scene(&|m| {
                m.tangent_frame = frame;
                m.normal_zero = zero;
            }))
        };
        let (exact, half) = (with(NormalZero::Exact), with(NormalZero::Half));
        let angle = |f: &Frame| {
            let pairs = floats::<3>(f, 0).iter().zip(floats::<3>(&without, 0));
            pairs.map(|(a, b)| (Vec3::from(*a) - Vec3::from(*b)).length()).fold(0.0, f32::max)
        };
        // Two roundings of a unit vector.
        assert!(angle(&exact) < 3e-7, "{frame:?} {}", angle(&exact));
        assert!((0.004..0.0065).contains(&angle(&half)), "{frame:?} {}", angle(&half));
    }
    // Row 52's other half: the mean of a tangent-space map is blue.
    let bricks = samples::scene("wall").unwrap();
    let map = &bricks.images[1];
    let mut mean = [0.0f64; 3];
    for y in (0..map.height()).step_by(7) {
        for x in (0..map.width()).step_by(7) {
            (0..3).for_each(|c| mean[c] += f64::from(map.value(x, y, c)));
        }
    }
    assert!(mean[2] > 1.6 * mean[0] && mean[2] > 1.6 * mean[1], "{mean:?}");
}

/// The six views of a cube's faces: where the camera stands and its up, as `shape::cube` orients its pictures.
const FACES: [[[f32; 3]; 2]; 6] = [
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
    [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
    [[0.0, 1.0, 0.0], [0.0, 0.0, -1.0]],
    [[0.0, -1.0, 0.0], [0.0, 0.0, 1.0]],
    [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]],
    [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0]],
];

#[test]
fn row_56_one_tangent_map_serves_six_faces_of_a_cube() {
    let view = |space: NormalSpace, frame: TangentFrame, face: usize| {
        let mut scene = shown(shape::cube(2.0), Mat4::IDENTITY, waves(), |m| {
            m.normal_space = space;
            m.tangent_frame = frame;
        });
        let [eye, up] = FACES[face].map(Vec3::from);
        let camera = Camera::look_at(eye * 5.0, Vec3::splat(0.0), up, 30.0);
        scene.cameras[0] = Camera { projection: Projection::Orthographic { height: 2.2 }, ..camera };
        // The light stands with the camera.
        let from = up.cross(eye) + up * 2.0 + eye * 3.0;
        scene.lights[0] = Light { shadow: None, ..Light::directional(from, Vec3::splat(0.0)) };
        picture(&scene)
    };
    for frame in [TangentFrame::Mikktspace, TangentFrame::Average, TangentFrame::PerTriangle] {
        let first = view(NormalSpace::Tangent, frame, 0);
        for face in 1..6 {
            assert!(difference(&first, &view(NormalSpace::Tangent, frame, face)) < TURNED, "{frame:?} {face}");
        }
    }
    // In world space one face alone is right: the one that faces +Z.
    let right = view(NormalSpace::Tangent, TangentFrame::Mikktspace, 4);
    for face in 0..6 {
        let d = difference(&right, &view(NormalSpace::World, TangentFrame::Mikktspace, face));
        assert!(if face == 4 { d < TURNED } else { d > 0.1 }, "{face}: {d}");
    }
}

#[test]
fn row_62_both_ways_of_document_001_give_the_same_picture_and_e4_translation_counts() {
    for frame in [TangentFrame::PerTriangle, TangentFrame::Average, TangentFrame::FromNormal, TangentFrame::Mikktspace]
    {
        // A cube seen at an angle, moved: its frames are constant on each triangle. Erratum E4 loses the translation,
        // which a point light shows.
        let place = Mat4::translation(Vec3::new(0.3, -0.2, 0.5)).times(&turn(Vec3::new(1.0, 1.0, 0.0), 40.0));
        let with = |path| {
            let mut scene = shown(shape::cube(1.2), place, waves(), |m| {
                m.tangent_frame = frame;
                m.tbn_path = path;
            });
            scene.lights.push(Light { shadow: None, ..Light::point(Vec3::new(-0.5, 0.5, 2.0)) });
            picture(&scene)
        };
        let (world, tangent) = (with(TbnPath::World), with(TbnPath::Tangent));
        let worst = rgba(&world).iter().zip(rgba(&tangent)).flat_map(|(a, b)| (0..3).map(move |c| (a[c] - b[c]).abs()));
        // The row's own bound.
        assert!(worst.fold(0.0, f32::max) <= 1e-5, "{frame:?}");
    }
}

#[test]
fn row_53_green_down_and_two_channels_are_the_same_map_told_otherwise() {
    let scene = |map, change: &dyn Fn(&mut NormalMap)| {
        shown(shape::sphere(2.0, 24), Mat4::IDENTITY, map, |m| change(m.normal_map.as_mut().unwrap()))
    };
    let texel = |map: &Image, u: f32, v: f32| map.rgba((u * 64.0) as u32, (v * 64.0) as u32);
    let up = waves();
    // Codes k and 255 - k are exact negatives of one another.
    let down = rgb(64, |u, v| {
        let [r, g, b, _] = texel(&up, u, v);
        [r, 1.0 - g, b]
    });
    let two = rgb(64, |u, v| {
        let [r, g, _, _] = texel(&up, u, v);
        [r, g, 0.0]
    });
    let plain = picture(&scene(waves(), &|_| ()));
    // Mip levels round halves up, so they may be a code apart: 1/255, and what light makes of it.
    assert!(difference(&plain, &picture(&scene(down.clone(), &|n| n.y_down = true))) < 0.02);
    assert!(difference(&plain, &picture(&scene(down, &|_| ()))) > 0.1);
    // z is rebuilt from rounded x and y, where the full map has a rounded z.
    assert!(difference(&plain, &picture(&scene(two.clone(), &|n| n.channels = 2))) < 0.05);
    assert!(difference(&plain, &picture(&scene(two, &|_| ()))) > 0.1);
}

#[test]
fn row_64_normals_under_rigid_uniform_stretched_and_mirrored_transforms() {
    let rigid = turn(Vec3::new(1.0, -2.0, 0.7), 130.0);
    let scale = |x, y, z| Mat4::scale(Vec3::new(x, y, z));
    for (name, s) in [
        ("rigid", Vec3::splat(1.0)),
        ("uniform", Vec3::splat(2.5)),
        ("stretched", Vec3::new(1.0, 2.0, 3.0)),
        ("mirrored", Vec3::new(-1.0, 1.0, 1.0)),
        ("mirrored and stretched", Vec3::new(1.0, -2.0, 3.0)),
        ("point reflection", Vec3::splat(-1.0)),
    ] {
        let transform = rigid.times(&scale(s.x, s.y, s.z));
        let scene = shown(shape::sphere(2.0, 32), transform, waves(), |_| ());
        let prepared = Prepared::new(&scene, &Job::default()).unwrap();
        let (instance, mesh) = (&prepared.instances[0], &prepared.meshes[0]);
        for m in &mesh.meshlets {
            for k in 0..u32::from(m.vertex_count) {
                let at = (m.positions + k) as usize;
                let p = Vec3::new(mesh.x[at], mesh.y[at], mesh.z[at]);
                let v = mesh.vertices[(m.vertices + k) as usize];
                let got = instance.normals.direction(Vec3::new(v[0], v[1], v[2])).normalize();
                // The gradient of the ellipsoid |S⁻¹ R⁻¹ q| = 1 at q = R S p.
                let want = rigid.direction(p.zip(s, |p, s| p / s)).normalize();
                // The row's bound.
                assert!((got - want).length() <= 1e-6, "{name}: {got:?} {want:?}");
                if name == "rigid" || name == "uniform" {
                    assert!((got - transform.direction(p).normalize()).length() <= 1e-6, "{name}");
                }
                // Tangents stay in the surface.
                let t = instance.tangents.direction(Vec3::new(v[3], v[4], v[5])).normalize();
                assert!(t.dot(got).abs() < 1e-5, "{name} {}", t.dot(got));
            }
        }
        assert_eq!(instance.mirrored, s.x * s.y * s.z < 0.0);
    }
}

#[test]
fn row_60_mirrored_transforms_keep_the_relief() {
    // A wall mirrored by its transform shows the mirror image of the picture, lit by a mirrored light.
    let upright = turn(Vec3::new(1.0, 0.0, 0.0), 90.0);
    let scene = shown(shape::plane(2.0, 1), upright, waves(), |_| ());
    let mut mirrored = scene.clone();
    mirrored.objects[0].transform = Mat4::scale(Vec3::new(-1.0, 1.0, 1.0)).times(&upright);
    mirrored.lights[0].direction.x *= -1.0;
    let (a, b) = (picture(&scene), picture(&mirrored));
    let (a, b) = (rgba(&a), rgba(&b));
    for y in 0..96 {
        for x in 0..96 {
            let (p, q) = (a[y * 96 + x], b[y * 96 + 95 - x]);
            assert!((0..3).all(|c| (p[c] - q[c]).abs() < 1e-4), "{x} {y} {p:?} {q:?}");
        }
    }
}

#[test]
fn missing_and_degenerate_coordinates_are_findings_and_never_nan() {
    let finite = |scene: &Scene| {
        for (frame, path) in [
            (TangentFrame::Mikktspace, TbnPath::World),
            (TangentFrame::Average, TbnPath::Tangent),
            (TangentFrame::PerTriangle, TbnPath::World),
            (TangentFrame::FromNormal, TbnPath::Tangent),
            (TangentFrame::Games101, TbnPath::World),
        ] {
            let mut scene = scene.clone();
            (scene.materials[0].tangent_frame, scene.materials[0].tbn_path) = (frame, path);
            let f = picture(&scene);
            assert!(rgba(&f).iter().flatten().all(|v| v.is_finite()), "{frame:?}");
            assert!(floats::<3>(&f, 0).iter().flatten().all(|v| v.is_finite()), "{frame:?}");
        }
    };
    let ball = || shape::sphere(2.0, 12);
    let scene = |mesh| shown(mesh, Mat4::IDENTITY, waves(), |_| ());
    let without = scene(Mesh { uv: [None, None], ..ball() });
    assert_eq!(codes(&without), ["tangent.no-uv"]);
    finite(&without);
    for value in [[0.5, 0.5], [f32::NAN, 0.25]] {
        let mut mesh = ball();
        mesh.uv[0].as_mut().unwrap().values.fill(value);
        let flat = scene(mesh);
        assert_eq!(codes(&flat), ["tangent.no-uv-area"]);
        finite(&flat);
    }
    // One triangle of many.
    let mut mesh = ball();
    let uv = mesh.uv[0].as_mut().unwrap();
    let index = uv.index.as_mut().unwrap();
    (index[31], index[32]) = (index[30], index[30]);
    let one = scene(mesh);
    let prepared = Prepared::new(&one, &Job::default()).unwrap();
    assert_eq!(prepared.findings.len(), 1);
    assert!(prepared.findings[0].message.starts_with("1 of "), "{}", prepared.findings[0].message);
    finite(&one);
    // Neither without a map, nor with one in object space.
    let mut free = without.clone();
    free.materials[0].normal_space = NormalSpace::Object;
    assert_eq!(codes(&free), [""; 0]);
    free.materials[0].normal_map = None;
    assert_eq!(codes(&free), [""; 0]);
}

/// How much normals turn across a seam, and beside it: mean lengths of differences between neighbouring pixels, and the
/// largest. `crosses` tells of two neighbours (their planes' indices) whether the seam runs between them.
struct Steps {
    across: (f64, f32),
    beside: (f64, f32),
    count: usize,
}

fn steps(frame: &Frame, (width, height): (u32, u32), crosses: impl Fn(usize, usize) -> bool) -> Steps {
    let normals = floats::<3>(frame, 0);
    let (w, h) = (width as usize, height as usize);
    let (mut across, mut beside) = ((0.0, 0.0f32), (0.0, 0.0f32));
    let (mut count, mut others) = (0usize, 0usize);
    let length = |a: usize, b: usize| (Vec3::from(normals[a]) - Vec3::from(normals[b])).length();
    for y in 1..h - 1 {
        for x in 2..w - 2 {
            let at = y * w + x;
            if [at - 1, at, at + 1, at + 2].iter().any(|&k| normals[k] == [0.0; 3]) || !crosses(at, at + 1) {
                continue;
            }
            count += 1;
            let d = length(at, at + 1);
            across = (across.0 + f64::from(d), across.1.max(d));
            for (a, b) in [(at - 1, at), (at + 1, at + 2)] {
                let d = length(a, b);
                beside = (beside.0 + f64::from(d), beside.1.max(d));
                others += 1;
            }
        }
    }
    Steps {
        across: (across.0 / count.max(1) as f64, across.1),
        beside: (beside.0 / others.max(1) as f64, beside.1),
        count,
    }
}

#[test]
fn a_mirrored_head_shows_no_seam() {
    let size = (256, 288);
    let scene = samples::scene("mirrored-head").unwrap();
    for (eye, least) in
        [(Vec3::new(0.0, 0.0, 5.0), 150), (Vec3::new(0.0, 0.3, -5.0), 150), (Vec3::new(0.3, 5.0, 0.0), 20)]
    {
        let mut scene = scene.clone();
        let target = Vec3::new(0.0, -0.15, 0.0);
        scene.cameras[0] = Camera::look_at(eye, target, if eye.y > 2.0 { Vec3::new(0.0, 0.0, -1.0) } else { UP }, 30.0);
        let frame = shoot(&scene, size, 1, &[Aov::Normal, Aov::Position]);
        let p = floats::<3>(&frame, 1);
        let s = steps(&frame, size, |a, b| (p[a][0] < 0.0) != (p[b][0] < 0.0) && (p[a][2] - p[b][2]).abs() < 0.1);
        assert!(s.count >= least, "{eye:?}: {} pixels of seam", s.count);
        // The map's own gradient, as the pixels beside the seam show it. Noise: a third.
        assert!(s.across.0 <= 1.33 * s.beside.0, "{eye:?}: mean {} beside {}", s.across.0, s.beside.0);
        assert!(s.across.1 <= 1.33 * s.beside.1, "{eye:?}: most {} beside {}", s.across.1, s.beside.1);
    }
}

#[test]
fn a_cube_with_one_shared_map_shows_no_diagonals() {
    let size = (200, 200);
    for frame in [TangentFrame::Mikktspace, TangentFrame::Average, TangentFrame::PerTriangle] {
        let scene = shown(shape::cube(2.0), turn(Vec3::new(1.0, 1.0, 0.2), 35.0), waves(), |m| m.tangent_frame = frame);
        let f = shoot(&scene, size, 1, &[Aov::Normal, Aov::Uv, Aov::Triangle]);
        let (uv, ids) = (floats::<2>(&f, 1), exact::ids(&f, 2));
        let s =
            steps(&f, size, |a, b| ids[a] / 2 == ids[b] / 2 && ids[a] != ids[b] && (uv[a][0] - uv[b][0]).abs() < 0.1);
        assert!(s.count > 100);
        // A face is flat: its normals step as the map does.
        assert!(
            s.across.0 <= 1.1 * s.beside.0 && s.across.1 <= 1.1 * s.beside.1,
            "{frame:?}: {:?} {:?}",
            s.across,
            s.beside
        );
    }
}

#[test]
fn a_sphere_shows_neither_its_meridian_nor_a_fan_at_its_pole() {
    let size = (200, 200);
    // The map has no tilt at the poles, where every direction meets, and fits together at u = 0 and 1.
    let wave = |x: f32| frieze::math::exact::sin(x * std::f32::consts::TAU);
    let map = rgb(256, |u, v| {
        let fade = 4.0 * v * (1.0 - v);
        let n = Vec3::new(0.5 * wave(3.0 * u) * fade * fade, 0.5 * wave(4.0 * v + u) * fade * fade, 1.0);
        normal::encode(n.normalize(), false).array()
    });
    let mut scene = shown(shape::sphere(2.0, 48), turn(UP, 180.0), map, |m| {
        m.normal_map.as_mut().unwrap().texture.wrap = [Wrap::Repeat, Wrap::Clamp];
        m.normal_map.as_mut().unwrap().texture.filter = Filter::Bilinear;
    });
    let f = shoot(&scene, size, 1, &[Aov::Normal, Aov::Uv]);
    let uv = floats::<2>(&f, 1);
    // Away from the poles, which come below.
    let s = steps(&f, size, |a, b| (uv[a][0] - uv[b][0]).abs() > 0.5 && (0.1..0.9).contains(&uv[a][1]));
    assert!(s.count > 100);
    assert!(s.across.0 <= 1.33 * s.beside.0 && s.across.1 <= 2.0 * s.beside.1, "{:?} {:?}", s.across, s.beside);
    // From above: from pixel to pixel normals turn no more near the pole than anywhere in the picture's middle.
    let camera = Camera::look_at(UP * 5.0, Vec3::splat(0.0), Vec3::new(0.0, 0.0, -1.0), 30.0);
    scene.cameras[0] = Camera { projection: Projection::Orthographic { height: 0.8 }, ..camera };
    let f = shoot(&scene, size, 1, &[Aov::Normal, Aov::Position]);
    let (n, p) = (floats::<3>(&f, 0), floats::<3>(&f, 1));
    let (mut pole, mut rest) = (0.0f32, 0.0f32);
    for at in 0..200 * 199 {
        if at % 200 == 199 {
            continue;
        }
        let step = [at + 1, at + 200].map(|b| (Vec3::from(n[at]) - Vec3::from(n[b])).length());
        let step = step[0].max(step[1]);
        let r = (p[at][0] * p[at][0] + p[at][2] * p[at][2]).sqrt();
        if r < 0.12 { pole = pole.max(step) } else { rest = rest.max(step) }
    }
    // 8 bits and no mip levels: noise of a code, as large as the ball's own step.
    assert!(pole > 0.0 && pole <= 1.5 * rest, "{pole} {rest}");
}

#[test]
fn every_frame_path_and_space_of_a_scene_file_reaches_the_picture() {
    let dir = std::env::temp_dir().join("frieze-normal-maps");
    std::fs::create_dir_all(&dir).unwrap();
    let force = frieze::write::WriteOptions { force: true, ..Default::default() };
    frieze::write::image(&waves(), &dir.join("n.png"), &force).unwrap();
    let mut pictures: Vec<(String, Frame)> = Vec::new();
    let load = |material: &str| {
        let text = format!(
            "[[object]]\nmesh = {{ primitive = \"sphere\", size = 2.0, segments = 24 }}\nmaterial = \"m\"\n\
             [[light]]\nkind = \"directional\"\nposition = [1, 2, 3]\nshadow = false\n\
             [camera]\neye = [0.5, 0.8, 4]\nfov_y = 30.0\n[material.m]\n{material}\n"
        );
        let path = dir.join("scene.toml");
        std::fs::write(&path, text).unwrap();
        frieze::load(&path)
    };
    for frame in ["mikktspace", "average", "per-triangle", "from-normal", "games101"] {
        let loaded = load(&format!("tangent_frame = \"{frame}\"\nnormal_map = {{ file = \"n.png\" }}")).unwrap();
        assert!(loaded.findings.is_empty(), "{:?}", loaded.findings);
        pictures.push((frame.into(), picture(&loaded.scene)));
        let tangent =
            load(&format!("tangent_frame = \"{frame}\"\ntbn_path = \"tangent\"\nnormal_map = {{ file = \"n.png\" }}"));
        let d = difference(&pictures.last().unwrap().1, &picture(&tangent.unwrap().scene));
        // Erratum E4b: equal where the frame is orthonormal. The hint of games101 is not; MikkTSpace's interpolated one is
        // nearly so.
        assert!(if frame == "games101" { d > 0.01 } else { d < 0.05 }, "{frame}: {d}");
    }
    for keys in
        ["space = \"object\"", "space = \"world\", y = \"down\"", "channels = 2, zero = \"exact\"", "y = \"down\""]
    {
        let loaded = load(&format!("normal_map = {{ file = \"n.png\", {keys} }}")).unwrap();
        assert!(loaded.findings.is_empty(), "{:?}", loaded.findings);
        pictures.push((keys.into(), picture(&loaded.scene)));
    }
    for (k, (a, one)) in pictures.iter().enumerate() {
        for (b, two) in &pictures[..k] {
            assert!(rgba(one) != rgba(two), "{a} and {b} are the same picture");
        }
    }
    for wrong in ["space = \"view\"", "space = \"object\", channels = 2", "zero = \"127\"", "channels = 4"] {
        assert!(load(&format!("normal_map = {{ file = \"n.png\", {wrong} }}")).is_err(), "{wrong}");
    }
    std::fs::remove_dir_all(&dir).unwrap();
}

#[test]
fn row_67_any_frame_will_do_if_baking_and_shading_agree() {
    // A map made for the frame from the normal, about one fixed world direction, shaded with that frame and another.
    let aim = Vec3::new(0.3, 0.5, 0.8).normalize();
    let mut scene = shown(shape::sphere(2.0, 64), Mat4::IDENTITY, rgb(4, |_, _| [0.5; 3]), |_| ());
    // Every place of the map holds `aim` in that place's frame.
    let map = rgb(256, |u, v| {
        let (s, c) = frieze::math::exact::sin_cos_f64(f64::from(u) * std::f64::consts::TAU);
        let (sv, cv) = frieze::math::exact::sin_cos_f64(f64::from(v) * std::f64::consts::PI);
        let n = Vec3::new((-s * sv) as f32, cv as f32, (-c * sv) as f32);
        let [t, b, n] = frieze::shade::surface::from_normal(n, -1.0);
        normal::encode(Vec3::new(t.dot(aim), b.dot(aim), n.dot(aim)), false).array()
    });
    scene.images[0] = map.into();
    let worst = |frame| {
        let mut scene = scene.clone();
        scene.materials[0].tangent_frame = frame;
        let f = picture(&scene);
        let (n, uv) = (floats::<3>(&f, 0), floats::<2>(&f, 2));
        let seen = n.iter().zip(uv).filter(|(n, uv)| **n != [0.0; 3] && (0.2..0.8).contains(&uv[1]));
        seen.map(|(n, _)| (Vec3::from(*n) - aim).length()).fold(0.0, f32::max)
    };
    // 8 bits, 1/256 of a turn per texel, and 64 cells around the ball.
    assert!(worst(TangentFrame::FromNormal) < 0.05, "{}", worst(TangentFrame::FromNormal));
    // The right frame of another rule: wrong by the angle between the tangents.
    assert!(worst(TangentFrame::Mikktspace) > 0.3);
}
