//! Lines over pictures (rows 54, 55 and 121): where they are, what they cover, and what hides them.

#[path = "pictures/exact.rs"]
mod exact;

use exact::{bare, flat_camera, floats, plain, rgba, shoot, soup};
use frieze::job::Job;
use frieze::math::lane::Level;
use frieze::math::vec::{Mat4, Vec3};
use frieze::mesh::{Attribute, Mesh, shape};
use frieze::prepare::{Needs, Prepared};
use frieze::render::{Aov, Format, Overlay, Overlays, RenderOptions, frame, render};
use frieze::scene::{Light, Material, NormalMap, Scene, Shadow, Texture};
use frieze::{Frame, samples};

const CYAN: [f32; 3] = [0.0, 0.5, 0.7];

fn drawn(scene: &Scene, size: (u32, u32), overlays: Overlays) -> Frame {
    let options = RenderOptions { size, samples: 1, format: Format::F32, overlays, ..Default::default() };
    render(scene, &options).unwrap()
}

fn just(list: &[Overlay]) -> Overlays {
    Overlays { list: list.to_vec(), ..Default::default() }
}

/// Pixels that differ from the picture without overlays.
fn touched(scene: &Scene, size: (u32, u32), overlays: Overlays) -> Vec<bool> {
    let (a, b) = (shoot(scene, size, 1, &[]), drawn(scene, size, overlays));
    rgba(&a).iter().zip(rgba(&b)).map(|(a, b)| a != b).collect()
}

/// A rectangle that faces +Z in the picture of `flat_camera`, whose rows run down from `h`.
fn card([x0, y0, x1, y1]: [f32; 4], z: f32, h: f32) -> [[[f32; 3]; 3]; 2] {
    let p = |x: f32, y: f32| [x, h - y, z];
    [[p(x0, y1), p(x1, y1), p(x1, y0)], [p(x0, y1), p(x1, y0), p(x0, y0)]]
}

#[test]
fn row_121_lines_cover_what_their_distance_says() {
    let mut scene = bare(flat_camera(32, 32));
    let material = scene.add_material(plain());
    // Edges at x = 4 (between pixels) and 20.5 (through centres), y = 6 and 25.5.
    scene.add(soup(&card([4.0, 6.0, 20.5, 25.5], 10.0, 32.0)), Mat4::IDENTITY, material);
    let overlays = Overlays { width: Some(2.0), ..just(&[Overlay::Wire]) };
    let f = drawn(&scene, (32, 32), overlays);
    let at = |x: usize, y: usize| rgba(&f)[y * 32 + x];
    // A capsule of radius 1 with a border of a pixel: full within half a pixel of the line, a half at one pixel.
    assert_eq!(at(20, 12), [CYAN[0], CYAN[1], CYAN[2], 1.0], "through the centre");
    assert_eq!(at(4, 12), [CYAN[0], CYAN[1], CYAN[2], 1.0], "half a pixel beside");
    assert_eq!(at(3, 12), [CYAN[0], CYAN[1], CYAN[2], 1.0], "on the other side, over nothing");
    let half = at(21, 12);
    // Over nothing: straight alpha. Over the white card: mixed.
    assert!((half[3] - 0.5).abs() < 1e-6 && half[1] == CYAN[1], "{half:?}");
    let half = at(19, 12);
    assert!((half[1] - (0.5 * CYAN[1] + 0.5)).abs() < 1e-6 && half[3] == 1.0, "{half:?}");
    // The rest is as it was, the diagonal aside.
    assert_eq!((at(8, 9), at(28, 3)), ([1.0; 4], [0.0; 4]));
}

#[test]
fn row_121_what_lies_behind_is_hidden_and_what_lies_on_it_is_not() {
    let mut scene = bare(flat_camera(48, 48));
    let material = scene.add_material(plain());
    scene.add(soup(&card([4.0, 4.0, 44.0, 44.0], 10.0, 48.0)), Mat4::IDENTITY, material);
    scene.add(soup(&card([16.0, 16.0, 32.0, 32.0], 60.0, 48.0)), Mat4::IDENTITY, material);
    let overlays = || Overlays { width: Some(1.0), ..just(&[Overlay::Wire]) };
    let hit = touched(&scene, (48, 48), overlays());
    // The far card's diagonal runs from the lower left to the upper right: seen outside of the near card alone.
    let at = |x: usize, y: usize| hit[y * 48 + x];
    assert!(at(8, 39) && at(39, 8));
    // The near card has its own diagonal there; turn it away by making it one triangle's place.
    assert!(at(24, 23), "the near card's own diagonal");
    let mut one = bare(flat_camera(48, 48));
    let material = one.add_material(plain());
    one.add(soup(&card([4.0, 4.0, 44.0, 44.0], 10.0, 48.0)), Mat4::IDENTITY, material);
    one.add(soup(&[[[-40.0, 20.0, 60.0], [100.0, 20.0, 60.0], [24.0, 130.0, 60.0]]]), Mat4::IDENTITY, material);
    let hit = touched(&one, (48, 48), overlays());
    let at = |x: usize, y: usize| hit[y * 48 + x];
    assert!(at(8, 39), "below the triangle");
    assert!(!at(30, 17) && !at(36, 11), "behind the triangle");
    // On a ball half of all edges are on the far side: a picture without depth would be full of lines.
    let ball = |segments| {
        let mut scene = bare(flat_camera(64, 64));
        let material = scene.add_material(plain());
        let place = Mat4::translation(Vec3::new(32.0, 32.0, 60.0));
        scene.add(shape::sphere(50.0, segments), place, material);
        scene
    };
    let hit = touched(&ball(12), (64, 64), overlays());
    let count = hit.iter().filter(|h| **h).count();
    // Every visible edge is a whole line: between two rings a row crosses 6 meridians and their diagonals.
    let middle = (8..56).filter(|x| hit[28 * 64 + x]).count();
    assert!((600..2200).contains(&count) && (6..46).contains(&middle), "{count} {middle}");
}

#[test]
fn row_121_tangent_bitangent_and_normal_are_red_green_and_blue() {
    // A wall that faces +Z with its picture upright: tangent right, bitangent up; seen a little from the right.
    let mut scene = bare(flat_camera(64, 64));
    let material = scene.add_material(plain());
    let mut wall = shape::plane(8.0, 1);
    wall.positions.iter_mut().for_each(|p| *p = [p[0], -p[2], 0.0]);
    wall.normals = Some(Attribute { values: vec![[0.0, 0.0, 1.0]], index: Some(vec![0; 6]) });
    scene.add(wall, Mat4::translation(Vec3::new(32.5, 32.5, 40.0)), material);
    let f = drawn(&scene, (64, 64), Overlays { length: Some(12.0), width: Some(1.5), ..just(&[Overlay::Tbn]) });
    let at = |x: usize, y: usize| rgba(&f)[y * 64 + x];
    let is = |c: [f32; 4], k: usize| c[3] > 0.9 && (0..3).all(|j| j == k || c[j] < 0.5 * c[k]);
    // From the lower right corner (36.5, y 35.5): 12 to the right, and 12 up.
    assert!(is(at(44, 35), 0), "red to the right: {:?}", at(44, 35));
    assert!(is(at(36, 22), 1), "green up: {:?}", at(36, 22));
    assert!(is(at(36, 35), 2), "blue towards us: {:?}", at(36, 35));
    // Without tangents in the scene they are made for the overlay; `Prepared::new` would have none.
    let f = drawn(&scene, (64, 64), Overlays { length: Some(12.0), width: Some(1.5), ..just(&[Overlay::Normals]) });
    let at = |x: usize, y: usize| rgba(&f)[y * 64 + x];
    assert!(is(at(36, 35), 2) && at(44, 35) == [0.0; 4]);
}

#[test]
fn row_54_arrows_are_the_normals_that_are_shaded_with() {
    // A constant map that leans to the right and up by 45 degrees each way in the picture's plane.
    let mut scene = bare(flat_camera(64, 64));
    let lean = Vec3::new(1.0, 1.0, 0.5).normalize();
    let texel = frieze::map::normal::encode(lean, false);
    let image = frieze::image::Image::new(
        1,
        1,
        3,
        frieze::image::Pixels::F32(texel.array().to_vec()),
        frieze::image::Encoding::Linear,
    );
    let image = scene.add_image(image.unwrap());
    let material = scene.add_material(Material {
        normal_map: Some(NormalMap { texture: Texture::new(image), scale: 1.0, y_down: false, channels: 3 }),
        ..Material::default()
    });
    let h = std::f32::consts::FRAC_1_SQRT_2;
    let stand = Mat4::translation(Vec3::new(32.0, 32.0, 20.0)).times(&Mat4::rotation([h, 0.0, 0.0, h]));
    scene.add(shape::plane(40.0, 1), stand, material);
    let size = (64, 64);
    let normal = floats::<3>(&shoot(&scene, size, 1, &[Aov::Normal]), 0)[32 * 64 + 32];
    assert!((Vec3::from(normal) - lean).length() < 1e-6);
    let overlays = Overlays { length: Some(15.0), width: Some(1.0), spacing: Some(64), ..just(&[Overlay::MapNormals]) };
    let hit = touched(&scene, size, overlays);
    // One arrow, from the pixel in the middle to 15 lean.
    for t in [0.1, 0.5, 0.9] {
        let (x, y) = (32.5 + 15.0 * t * lean.x, 32.5 - 15.0 * t * lean.y);
        assert!(hit[y as usize * 64 + x as usize], "{t}");
    }
    let columns: Vec<usize> = (0..64 * 64).filter(|k| hit[*k]).map(|k| k % 64).collect();
    assert!(columns.iter().all(|x| (30..=45).contains(x)), "{columns:?}");
}

#[test]
fn uv_seams_are_where_coordinates_are_cut_or_end() {
    let count = |mesh: Mesh| {
        let mut scene = bare(flat_camera(64, 64));
        let material = scene.add_material(plain());
        let place = Mat4::translation(Vec3::new(32.0, 32.0, 100.0));
        let turned = place.times(&Mat4::rotation([0.2, 0.3, 0.0, 0.9]));
        scene.add(mesh, turned, material);
        let hit = |o| touched(&scene, (64, 64), Overlays { width: Some(1.0), ..just(&[o]) });
        let (seams, wire) = (hit(Overlay::UvSeams), hit(Overlay::Wire));
        assert!(seams.iter().zip(&wire).all(|(s, w)| !s || *w), "seams are edges");
        let n = |v: &[bool]| v.iter().filter(|h| **h).count();
        (n(&seams), n(&wire))
    };
    // A plane ends at its border only; its inner edges are many more.
    let (seams, wire) = count(shape::plane(40.0, 6));
    assert!(seams > 60 && wire > seams + 200, "{seams} {wire}");
    // A cube is cut along each edge, not along its diagonals.
    let (seams, wire) = count(shape::cube(30.0));
    assert!(seams > 60 && wire > seams + 30, "{seams} {wire}");
    // A sheet whose triangles are each on their own is all seams.
    let mut loose = shape::plane(40.0, 6);
    let uv = loose.uv[0].as_mut().unwrap();
    let values: Vec<[f32; 2]> = (0..loose.corners.len()).map(|c| [c as f32, 0.5]).collect();
    *uv = Attribute { index: Some((0..values.len() as u32).collect()), values };
    let (seams, wire) = count(loose);
    // The ends of an edge may come in another order.
    assert!(wire - seams < 4, "{seams} {wire}");
}

#[test]
fn a_light_frustum_is_a_box_of_twelve_edges() {
    let mut scene = bare(flat_camera(64, 64));
    let material = scene.add_material(plain());
    scene.add(shape::cube(4.0), Mat4::translation(Vec3::new(32.0, 32.0, 50.0)), material);
    // Straight down: seen from the side the box is a rectangle, 20 wide, from 5 to 45 below the light.
    let from = Vec3::new(32.0, 60.0, 50.0);
    let shadow = Shadow { near: Some(5.0), far: Some(45.0), extent: Some(10.0), ..Shadow::default() };
    let light = Light::directional(from, from - Vec3::new(0.0, 1.0, 0.0));
    scene.lights.push(Light { position: from, shadow: Some(shadow), ..light });
    let hit = touched(&scene, (64, 64), Overlays { width: Some(1.0), ..just(&[Overlay::LightFrustum]) });
    let at = |x: usize, y: usize| hit[y * 64 + x];
    // Rows run down from 64: y = 55 is row 9, y = 15 row 49.
    assert!(at(22, 30) && at(42, 30) && at(30, 9) && at(30, 49));
    assert!(!at(26, 20) && !at(10, 30) && !at(32, 4) && !at(32, 56));
    scene.lights[0].shadow = None;
    assert!(!touched(&scene, (64, 64), just(&[Overlay::LightFrustum])).contains(&true));
}

#[test]
fn overlays_have_the_same_bits_everywhere_and_leave_no_planes_behind() {
    let scene = samples::scene("mirrored-head").unwrap();
    let list = [Overlay::Wire, Overlay::UvSeams, Overlay::Tbn, Overlay::MapNormals, Overlay::LightFrustum];
    for format in [Format::U8, Format::F32] {
        let mut first: Option<Frame> = None;
        for threads in [1, 3] {
            let job = Job::builder().threads(threads).build();
            let prepared = Prepared::with(&scene, &Needs { tangents: true }, &job).unwrap();
            for level in Level::available() {
                let options = RenderOptions {
                    job: job.clone(),
                    level,
                    size: (72, 80),
                    format,
                    aovs: vec![Aov::Uv, Aov::Depth],
                    overlays: just(&list),
                    ..Default::default()
                };
                let (drawn, _) = frame(&prepared, &options).unwrap();
                assert_eq!(drawn.planes.iter().map(|p| p.name).collect::<Vec<_>>(), ["uv", "depth"]);
                assert!(*first.get_or_insert_with(|| drawn.clone()) == drawn, "{threads} threads, {}", level.name());
            }
        }
        let bare = RenderOptions { size: (72, 80), format, ..Default::default() };
        let without = render(&scene, &bare).unwrap();
        assert!(without.color != first.unwrap().color);
    }
}

#[test]
fn hostile_lengths_and_places_draw_nothing_odd() {
    let mut scene = bare(flat_camera(16, 16));
    let material = scene.add_material(plain());
    scene.add(shape::cube(1e30), Mat4::IDENTITY, material);
    scene.add(shape::sphere(1e-30, 8), Mat4::scale(Vec3::splat(0.0)), material);
    let list = Overlay::ALL.map(|(_, o)| o);
    for length in [None, Some(1e38), Some(f32::NAN), Some(0.0), Some(-1.0)] {
        for width in [None, Some(f32::NAN), Some(1e9), Some(-3.0)] {
            let overlays = Overlays { length, width, spacing: Some(0), ..just(&list) };
            let f = drawn(&scene, (16, 16), overlays);
            assert!(rgba(&f).iter().flatten().all(|v| v.is_finite()));
        }
    }
}
