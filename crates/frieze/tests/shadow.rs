//! Rows 100 to 115: both passes of shadow mapping against rays and closed forms.

#[path = "pictures/exact.rs"]
mod exact;

use exact::{Random, bare, floats, ids, rgba, shoot, shoot_and_count};
use frieze::Frame;
use frieze::error::Fault;
use frieze::image::{Image, Pixels};
use frieze::math::vec::{Mat4, Vec3};
use frieze::mesh::shape;
use frieze::prepare::Prepared;
use frieze::render::{Aov, RenderOptions, light_depth};
use frieze::samples;
use frieze::scene::{Bias, Camera, Light, LightKind, Material, Projection, Scene, Shadow, ShadowFilter, ShadowWrap};

const UP: Vec3 = Vec3::new(0.0, 1.0, 0.0);
const ORIGIN: Vec3 = Vec3::new(0.0, 0.0, 0.0);

/// White that shows nothing but the cosine to the light.
fn chalk() -> Material {
    Material { specular: [0.0; 3], ambient: Some([0.0; 3]), double_sided: true, ..Material::default() }
}

/// A floor at y = 0 (object 0) under one light with that shadow; no other light.
fn floor(side: f32, from: Vec3, shadow: Shadow) -> Scene {
    let mut scene = bare(Camera::look_at(Vec3::new(0.5, 6.0, 4.0), ORIGIN, UP, 40.0));
    scene.ambient.color = [0.0; 3];
    scene.lights.push(Light { shadow: Some(shadow), ..Light::directional(from, ORIGIN) });
    let look = scene.add_material(chalk());
    scene.add(shape::plane(side, 1), Mat4::IDENTITY, look);
    scene
}

/// For every pixel that shows the floor: where, and the share of light that arrives there.
fn floor_light(scene: &Scene, size: (u32, u32)) -> Vec<(Vec3, f32)> {
    let frame: Frame = shoot(scene, size, 1, &[Aov::Object, Aov::Position]);
    let cosine = -scene.lights[0].direction.y;
    let pixels = rgba(&frame).iter().zip(ids(&frame, 0)).zip(floats::<3>(&frame, 1));
    pixels.filter(|((_, id), _)| **id == 0).map(|((c, _), p)| (Vec3::from(*p), c[0] / cosine)).collect()
}

/// Where a ray enters a box of -`half` to `half` that stands under `inverse`: its distance.
fn enters(inverse: &Mat4, half: f64, from: [f64; 3], along: [f64; 3]) -> Option<f64> {
    let turn = |v: [f64; 3], w: f64| -> [f64; 3] {
        core::array::from_fn(|r| {
            (0..3).map(|c| f64::from(inverse.0[c][r]) * v[c]).sum::<f64>() + w * f64::from(inverse.0[3][r])
        })
    };
    let (o, d) = (turn(from, 1.0), turn(along, 0.0));
    let (mut enter, mut leave) = (f64::MIN, f64::MAX);
    for k in 0..3 {
        let (a, b) = ((-half - o[k]) / d[k], (half - o[k]) / d[k]);
        (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
    }
    (enter < leave).then_some(enter)
}

// Row 100: the shadow of a cube on a plane, intersection over union with ray casting above 0.99.
#[test]
fn row_100_the_shadow_of_a_cube_is_that_of_rays() {
    let mut r = Random(21);
    for round in 0..6 {
        let from = Vec3::new(r.within(-3.0, 3.0), 4.0, r.within(-3.0, 3.0));
        let filter = if round % 2 == 0 { ShadowFilter::Hard } else { ShadowFilter::Pcf { radius: 1 } };
        let mut scene = floor(6.0, from, Shadow { size: 4096, filter, ..Shadow::default() });
        let place = Mat4::translation(Vec3::new(r.within(-0.5, 0.5), r.within(0.9, 1.2), r.within(-0.5, 0.5)))
            .times(&Mat4::rotation(r.turn()));
        scene.add(shape::cube(1.0), place, 0);
        let inverse = place.inverse().unwrap();
        let to_light = (-scene.lights[0].direction).array().map(f64::from);
        let (mut both, mut either, mut all) = (0.0, 0.0, 0);
        for (p, light) in floor_light(&scene, (240, 180)) {
            all += 1;
            let dark = enters(&inverse, 0.5, p.array().map(f64::from), to_light).is_some();
            both += f32::from(u8::from(dark && light < 0.5));
            either += f32::from(u8::from(dark || light < 0.5));
        }
        assert!(both > 200.0 && both < all as f32 * 0.5, "round {round}: {both} of {all}");
        assert!(both / either > 0.99, "round {round}: {both} / {either}");
    }
}

// Rows 101 and 104: beside the map and beyond its far plane is lit; document 002's own wrap repeats it (E21).
#[test]
fn row_101_and_104_beside_the_map_is_lit_and_repeated_only_where_asked() {
    let from = Vec3::new(0.0, 4.0, 0.001);
    let narrow = Shadow {
        size: 256,
        filter: ShadowFilter::Hard,
        near: Some(1.0),
        far: Some(6.0),
        extent: Some(0.6),
        ..Shadow::default()
    };
    let picture = |shadow: Shadow| {
        let mut scene = floor(6.0, from, shadow);
        // A lid over all of the map and more, hidden from the camera by its near plane.
        scene.add(shape::plane(2.4, 1), Mat4::translation(UP), 0);
        scene.cameras[0].projection = Projection::Orthographic { height: 4.0 };
        scene.cameras[0].transform = Camera::look_at(UP * 5.0, ORIGIN, Vec3::new(0.0, 0.0, -1.0), 45.0).transform;
        scene.cameras[0].near = 4.5;
        floor_light(&scene, (96, 96))
    };
    let count = |light: &[(Vec3, f32)], inside: bool, lit: bool| {
        let rim = |p: &Vec3| p.x.abs().max(p.z.abs()) - 0.6;
        let here = light.iter().filter(|(p, _)| if inside { rim(p) < -0.02 } else { rim(p) > 0.02 });
        here.filter(|(_, l)| (*l > 0.5) == lit).count()
    };
    let border = picture(narrow);
    assert!(count(&border, true, false) > 500 && count(&border, true, true) == 0);
    assert!(count(&border, false, true) > 500 && count(&border, false, false) == 0);
    let repeat = picture(Shadow { wrap: ShadowWrap::Repeat, ..narrow });
    assert!(count(&repeat, true, true) == 0 && count(&repeat, false, true) == 0);
    // The floor lies beyond far.
    let short = picture(Shadow { far: Some(3.5), ..narrow });
    assert_eq!(count(&short, true, false) + count(&short, false, false), 0);
}

fn depths(map: &Image) -> &[f32] {
    let Pixels::F32(v) = map.pixels() else { panic!("the depth map holds floats") };
    v
}

fn depth_map(scene: &Scene, light: usize) -> Image {
    let options = RenderOptions::default();
    light_depth(&Prepared::new(scene, &options.job).unwrap(), light, &options).unwrap()
}

// Rows 102 and 111: lookAt(lightPos, 0, up) and ortho(-10, 10, -10, 10, 1, 7.5) of document 002, as a picture: black near
// the light, white far, linear.
#[test]
fn row_102_and_111_the_depth_map_of_document_002_is_the_closed_form() {
    let scene = samples::scene("cubes").unwrap();
    let map = depth_map(&scene, 0);
    assert_eq!((map.width(), map.height(), map.channels()), (1024, 1024, 1));
    let eye = [-2.0f64, 4.0, -1.0];
    let unit = |v: [f64; 3]| v.map(|c| c / (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt());
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let back = unit(eye);
    let right = unit(cross([0.0, 1.0, 0.0], back));
    let up = cross(back, right);
    let ahead = back.map(|v| -v);
    let boxes: Vec<Mat4> = scene.objects[1..].iter().map(|o| o.transform.inverse().unwrap()).collect();
    let expected = |x: f64, y: f64| {
        let (x, y) = (x / 1024.0 * 20.0 - 10.0, 10.0 - y / 1024.0 * 20.0);
        let from: [f64; 3] = core::array::from_fn(|k| eye[k] + x * right[k] + y * up[k]);
        // The plane y = -0.5, and the cubes.
        let plane = (-0.5 - from[1]) / ahead[1];
        let nearest = boxes.iter().filter_map(|b| enters(b, 1.0, from, ahead)).fold(plane, f64::min);
        // What is nearer than near is cut off, what is beyond far is not there.
        if nearest > 7.5 { 1.0 } else { (nearest - 1.0) / 6.5 }
    };
    let (mut wrong, mut near, mut far, mut between) = (0, 0, 0, 0);
    for (y, x) in (0..1024).step_by(5).flat_map(|y| (0..1024).step_by(3).map(move |x| (y, x))) {
        let got = f64::from(depths(&map)[y * 1024 + x]);
        let want = expected(x as f64 + 0.5, y as f64 + 0.5);
        if want < 0.0 {
            continue; // cut by the near plane: what is behind shows
        }
        far += usize::from(want == 1.0);
        near += usize::from(want < 0.3);
        between += usize::from((0.3..1.0).contains(&want));
        // Depth of single precision over corners snapped to 1/256 texel.
        wrong += usize::from((got - want).abs() > 2e-5);
    }
    assert!(near > 100 && between > 1000 && far > 1000, "{near} {between} {far}");
    // Texels whose centre lies within 1/256 of an edge.
    assert!(wrong <= 20, "{wrong}");
}

#[test]
fn row_111_lights_without_a_map_say_so() {
    let mut scene = floor(2.0, UP, Shadow::default());
    scene.lights.push(Light { shadow: None, ..scene.lights[0].clone() });
    scene.lights.push(Light { kind: LightKind::Point, ..scene.lights[0].clone() });
    let options = RenderOptions::default();
    let prepared = Prepared::new(&scene, &options.job).unwrap();
    let code = |k| light_depth(&prepared, k, &options).map(|_| ()).map_err(|e| (e.fault, e.code));
    assert_eq!(code(0), Ok(()));
    assert_eq!([code(1), code(2)], [Err((Fault::Arguments, "render.no-shadow-map")); 2]);
    assert_eq!(code(3), Err((Fault::Arguments, "render.light")));
}

// Row 102, fitted: all that can cast is in the map and between near and far, with 1 % of room; from straight above too,
// where the up of document 002 fails (E22).
#[test]
fn row_102_a_fitted_frustum_holds_the_scene_and_little_more() {
    let mut r = Random(22);
    for round in 0..12 {
        let mut scene = bare(Camera::look_at(Vec3::new(0.0, 3.0, 9.0), ORIGIN, UP, 40.0));
        let look = scene.add_material(chalk());
        let (side, high) = (r.within(1.0, 3.0), r.within(0.5, 4.0));
        let offset = r.direction() * 20.0;
        let place = Mat4::translation(offset).times(&Mat4::scale(Vec3::new(side, high, side * 0.5)));
        scene.add(shape::cube(1.0), place, look);
        let from = if round % 3 == 0 { UP } else { r.direction() };
        scene.lights.push(Light {
            shadow: Some(Shadow { size: 200, ..Shadow::default() }),
            ..Light::directional(offset + from * 3.0, offset)
        });
        let map = depth_map(&scene, 0);
        let (mut lo, mut hi, mut least, mut most) = ([200; 2], [0; 2], 1.0f32, 0.0f32);
        for (k, d) in depths(&map).iter().enumerate().filter(|(_, d)| **d < 1.0) {
            let at = [k % 200, k / 200];
            (lo, hi) = ([lo[0].min(at[0]), lo[1].min(at[1])], [hi[0].max(at[0]), hi[1].max(at[1])]);
            (least, most) = (least.min(*d), most.max(*d));
        }
        // 1 % of 100 texels is 1.
        assert!(lo[0].min(lo[1]) >= 1 && hi[0].max(hi[1]) <= 198, "round {round}: {lo:?} {hi:?}");
        assert!(least > 0.005 && most < 0.995, "round {round}: {least} {most}");
        if round % 3 == 0 {
            // From above the box is seen as it is: its longer side fills the map, its top is near.
            assert!((hi[0] - lo[0]).max(hi[1] - lo[1]) >= 195, "round {round}: {lo:?} {hi:?}");
            // 0.01 of room before and behind: the top is at 0.01 / 1.02.
            assert!((least - 0.01 / 1.02).abs() < 1e-4 && (most - least) < 1e-4, "round {round}: {least} {most}");
        }
    }
}

// Row 105 (and the cause in row 107): depths of one surface are rarely equal; without a tolerance it shadows itself,
// with the automatic one no pixel does, whatever the slope and the filter.
#[test]
fn row_105_a_surface_shadows_itself_without_a_tolerance_and_never_with_it() {
    let mut r = Random(23);
    let filters = [ShadowFilter::Hard, ShadowFilter::Pcf { radius: 1 }, ShadowFilter::Pcf { radius: 3 }];
    for round in 0..12 {
        // Up to 78 degrees from the normal.
        let lean = r.within(0.3, 4.7);
        let turn = r.within(0.0, 6.3);
        let (s, c) = (frieze::math::exact::sin(turn), frieze::math::exact::cos(turn));
        let from = Vec3::new(lean * s, 1.0, lean * c) * 3.0;
        let shadow = Shadow { size: 300 + 61 * round, filter: filters[round as usize % 3], ..Shadow::default() };
        let count = |bias: Bias| {
            let scene = floor(6.0, from, Shadow { bias, ..shadow });
            let light = floor_light(&scene, (120, 90));
            // Light is 0 or a share of it, or all of it within rounding.
            (light.iter().filter(|(_, l)| *l < 0.999).count(), light.len())
        };
        let (dark, all) = count(Bias::Value(0.0));
        assert!(dark * 10 > all, "round {round}: acne on {dark} of {all}");
        assert_eq!(count(Bias::Auto).0, 0, "round {round}");
        // Half of the map's depth is tolerance enough for anything.
        assert_eq!(count(Bias::Value(0.5)).0, 0, "round {round}");
    }
    // Document 002's own: no acne on the floor that its light sees.
    let shadow =
        Shadow { bias: Bias::Value(0.005), near: Some(1.0), far: Some(7.5), extent: Some(10.0), ..Shadow::default() };
    let light = floor_light(&floor(6.0, Vec3::new(-2.0, 4.0, -1.0), shadow), (120, 90));
    assert!(light.iter().all(|(_, l)| *l > 0.999));
}

// Row 107: no acne where the shading normal says another slope than the triangles have.
#[test]
fn row_107_a_coarse_sphere_with_smooth_normals_has_no_acne() {
    for (segments, from) in [(16, Vec3::new(1.0, 2.0, 3.0)), (24, Vec3::new(-3.0, 1.0, 1.0)), (32, UP)] {
        for filter in [ShadowFilter::Hard, ShadowFilter::Pcf { radius: 1 }] {
            let mut scene = bare(Camera::look_at(Vec3::new(0.5, 2.0, 4.0), ORIGIN, UP, 35.0));
            scene.ambient.color = [0.0; 3];
            let shadow = Shadow { size: 1024, filter, ..Shadow::default() };
            scene.lights.push(Light { shadow: Some(shadow), ..Light::directional(from, ORIGIN) });
            let look = scene.add_material(chalk());
            scene.add(shape::sphere(1.0, segments), Mat4::IDENTITY, look);
            let frame = shoot(&scene, (240, 180), 1, &[Aov::Object, Aov::Normal]);
            let to_light = -scene.lights[0].direction;
            let mut lit = 0;
            for ((c, id), n) in rgba(&frame).iter().zip(ids(&frame, 0)).zip(floats::<3>(&frame, 1)) {
                let cosine = Vec3::from(*n).dot(to_light);
                // Facets turn away from the light up to half a segment before the normals do: sin(pi / 16) = 0.195.
                if *id == 0 && cosine > 0.2 {
                    lit += 1;
                    assert!(c[0] > 0.999 * cosine, "{segments} {filter:?}: {} of {cosine}", c[0]);
                }
            }
            assert!(lit > 500, "{lit}");
        }
    }
}

// Row 108: the bias is in forward light depth, so 0.005 of near to far. A lid nearer to the floor than that casts nothing.
#[test]
fn row_108_a_constant_bias_is_a_share_of_near_to_far() {
    for (near, far, bias) in [(1.0f32, 7.5, 0.005), (1.0, 14.0, 0.005), (2.0, 6.0, 0.02)] {
        // For document 002: 0.0325 (E23).
        let reach = bias * (far - near);
        for (gap, lit) in [(reach * 0.97, true), (reach * 1.03, false)] {
            for filter in [ShadowFilter::Hard, ShadowFilter::Pcf { radius: 1 }] {
                let shadow = Shadow {
                    size: 256,
                    filter,
                    bias: Bias::Value(bias),
                    near: Some(near),
                    far: Some(far),
                    extent: Some(3.0),
                    ..Shadow::default()
                };
                let mut scene = floor(4.0, UP * 4.5, shadow);
                scene.add(shape::plane(2.0, 1), Mat4::translation(UP * gap), 0);
                // From above; the near plane takes the lid away.
                let down = Camera::look_at(UP * 3.0, ORIGIN, Vec3::new(0.0, 0.0, -1.0), 45.0);
                let projection = Projection::Orthographic { height: 3.0 };
                scene.cameras[0] = Camera { projection, near: 3.0 - gap * 0.5, far: 4.0, ..down };
                let light = floor_light(&scene, (60, 60));
                let under = light.iter().filter(|(p, _)| p.x.abs().max(p.z.abs()) < 0.95);
                let under: Vec<f32> = under.map(|(_, l)| *l).collect();
                let want = if lit { 1.0 } else { 0.0 };
                let right = under.iter().all(|l| (l - want).abs() < 1e-5);
                assert!(under.len() > 1000 && right, "gap {gap} of {reach}, {filter:?}");
            }
        }
    }
}

// Row 109: nine comparisons, so ten values, and all of them occur.
#[test]
fn row_109_pcf_over_3x3_texels_has_ten_values() {
    let shadow = Shadow { size: 200, extent: Some(3.0), near: Some(0.5), far: Some(9.0), ..Shadow::default() };
    let mut scene = floor(4.0, Vec3::new(1.0, 4.0, 1.7), shadow);
    let turned = Mat4::translation(UP).times(&Mat4::rotation([0.2, 0.3, 0.4, 0.842_615]));
    scene.add(shape::cube(0.9), turned, 0);
    let mut count = [0; 10];
    for (p, light) in floor_light(&scene, (300, 220)) {
        let ninths = (light * 9.0).round();
        // Two roundings of a share of light.
        assert!((light * 9.0 - ninths).abs() < 1e-4, "{light} at {p:?}");
        count[ninths as usize] += 1;
    }
    assert!(count.iter().all(|n| *n > 0), "{count:?}");
}

// Row 115: the map has a size of its own. It does not depend on the picture's, nor the picture's on it.
#[test]
fn row_115_shadow_map_and_picture_have_sizes_of_their_own() {
    let with = |size: u32| {
        let mut scene = floor(3.0, Vec3::new(1.0, 4.0, 0.5), Shadow { size, ..Shadow::default() });
        scene.add(shape::cube(1.0), Mat4::translation(UP), 0);
        scene
    };
    let options = RenderOptions::default();
    let scene = with(333);
    let prepared = Prepared::new(&scene, &options.job).unwrap();
    let first = light_depth(&prepared, 0, &options).unwrap();
    assert_eq!((first.width(), first.height()), (333, 333));
    for (size, samples) in [((96, 64), 1), ((201, 50), 4), ((7, 300), 16)] {
        let (frame, report) = shoot_and_count(&scene, size, samples, &[]);
        assert_eq!((frame.color.width(), frame.color.height()), size);
        let texels = report.counters.iter().find(|(name, _)| *name == "shadow_samples").unwrap().1;
        assert_eq!(texels, 333 * 333);
        let asked = RenderOptions { size, samples, ..RenderOptions::default() };
        assert_eq!(light_depth(&prepared, 0, &asked).unwrap(), first);
    }
    // Maps of any size put the shadow of the cube's top at the same place: where rays say.
    for size in [64, 100, 1000, 2048] {
        let scene = with(size);
        let to_light = (-scene.lights[0].direction).array().map(f64::from);
        let inverse = Mat4::translation(-UP);
        // Fitted half width below 3.2: this many metres are a texel and a half.
        let texel = 6.4 / f64::from(size) * 1.5;
        for (p, light) in floor_light(&scene, (100, 80)) {
            let from = p.array().map(f64::from);
            let inner = enters(&inverse, 0.5 - texel * 1.5, from, to_light).is_some();
            let outer = enters(&inverse, 0.5 + texel * 1.5, from, to_light).is_some();
            assert!(!inner || light < 0.01, "{size}: {p:?} {light}");
            assert!(outer || light > 0.99, "{size}: {p:?} {light}");
        }
    }
}
