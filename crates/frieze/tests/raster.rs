//! The fast path to the samples, seen from outside: which triangle each sample of a picture sees, against rules that
//! are written down here once more in another way. Random shapes come from a fixed sequence.

#[path = "pictures/exact.rs"]
mod exact;

use exact::{Random, bare, flat_camera, floats, ids, painted, plain, rgba, shoot, soup};
use frieze::image::{Encoding, Image, Pixels};
use frieze::math::vec::{Mat4, Vec3, Vec4};
use frieze::mesh::{Mesh, shape};
use frieze::raster::fragments;
use frieze::render::Aov;
use frieze::scene::{Alpha, Camera, Material, Object, Scene, Texture};

/// Samples of a pixel in 1/16 pixel: the standard patterns of Direct3D 11 (`D3D11_STANDARD_MULTISAMPLE_PATTERN`) and
/// Vulkan ("Standard sample locations"), as they are printed there, from the upper left corner.
fn pattern(samples: u32) -> Vec<[i64; 2]> {
    // From the centre, in 1/16 pixel.
    let from_center: &[[i64; 2]] = match samples {
        1 => &[[0, 0]],
        4 => &[[-2, -6], [6, -2], [-6, 2], [2, 6]],
        8 => &[[1, -3], [-1, 3], [5, 1], [-3, -5], [-5, 5], [-7, -1], [3, 7], [7, -7]],
        16 => &[
            [1, 1],
            [-1, -3],
            [-3, 2],
            [4, -1],
            [-5, -2],
            [2, 5],
            [5, 3],
            [3, -5],
            [-2, 6],
            [0, -7],
            [-4, -6],
            [-6, 4],
            [-8, 0],
            [7, -4],
            [6, 7],
            [-7, -8],
        ],
        n => panic!("no pattern of {n}"),
    };
    from_center.iter().map(|p| p.map(|v| v + 8)).collect()
}

/// 1/256 pixel, halves up.
fn snapped(v: f32) -> i64 {
    (f64::from(v) * 256.0 + 0.5).floor() as i64
}

/// Whether a triangle of snapped corners covers a point (both in 1/256 pixel). The fill rule is taken at its meaning:
/// the point, moved right by next to nothing and down by far less than that, lies strictly inside.
fn covers(mut t: [[i64; 2]; 3], q: [i64; 2]) -> bool {
    let area = (t[1][0] - t[0][0]) * (t[2][1] - t[0][1]) - (t[1][1] - t[0][1]) * (t[2][0] - t[0][0]);
    if area < 0 {
        t.swap(1, 2);
    }
    area != 0
        && (0..3).all(|k| {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            let (dx, dy) = (i128::from(b[0] - a[0]), i128::from(b[1] - a[1]));
            let side = dx * i128::from(q[1] - a[1]) - dy * i128::from(q[0] - a[0]);
            // A whole unit of `side` is 2^60; right by 2^30 and down by 1, edges being shorter than 2^29.
            (side << 60) + dx - (dy << 30) > 0
        })
}

/// A triangle in pixels, y down, at a whole depth of 1 (far) to 255 (near).
type Flat = [[f32; 3]; 3];

/// As [`flat_camera`] shows it.
fn stood_up(t: &Flat, height: u32) -> [[f32; 3]; 3] {
    t.map(|[x, y, z]| [x, height as f32 - y, z])
}

/// Small and large triangles, many with corners and edges on samples, many at one depth.
fn random_triangle(r: &mut Random, (w, h): (u32, u32), depths: u64) -> Flat {
    let z = 1.0 + r.below(depths) as f32;
    let reach = [2.0, 9.0, 70.0, 700.0][r.below(4) as usize];
    let grid = [1.0, 2.0, 16.0, 512.0][r.below(4) as usize];
    let at = [r.within(-20.0, w as f32 + 20.0), r.within(-20.0, h as f32 + 20.0)];
    // Corners on pixel centres where the grid is one of pixels.
    let shift = if grid == 1.0 { 0.5 } else { 0.0 };
    let mut corner = || {
        let p = at.map(|v| ((v + r.within(-reach, reach)) * grid).floor() / grid + shift);
        [p[0], p[1], z]
    };
    [corner(), corner(), corner()]
}

/// For each sample of a picture the triangle that it sees: the nearest, of equals the first.
fn seen(triangles: &[Flat], (w, h): (u32, u32), samples: u32) -> Vec<Option<usize>> {
    let pattern = pattern(samples);
    let mut all = vec![None; (w * h * samples) as usize];
    let mut depth = vec![0.0; all.len()];
    for (k, t) in triangles.iter().enumerate() {
        let snap = t.map(|p| [snapped(p[0]), snapped(p[1])]);
        let range = |c: usize, size: u32| {
            let (lo, hi) = (snap.iter().map(|p| p[c]).min().unwrap(), snap.iter().map(|p| p[c]).max().unwrap());
            (lo >> 8).clamp(0, i64::from(size))..((hi >> 8) + 1).clamp(0, i64::from(size))
        };
        for (y, x) in range(1, h).flat_map(|y| range(0, w).map(move |x| (y, x))) {
            for (s, p) in pattern.iter().enumerate() {
                let at = ((y * i64::from(w) + x) * i64::from(samples)) as usize + s;
                if t[0][2] > depth[at] && covers(snap, [256 * x + 16 * p[0], 256 * y + 16 * p[1]]) {
                    (all[at], depth[at]) = (Some(k), t[0][2]);
                }
            }
        }
    }
    all
}

/// Pictures of one tile, of several, and with sides that are one beside a tile's.
const SIZES: [(u32, u32); 6] = [(150, 100), (64, 64), (65, 63), (1, 130), (129, 1), (40, 200)];

// Rows 22, 23 and 27: whole tiles, whole bins, the fill rule, the nearest, and the first of equals.
#[test]
fn row_23_and_27_each_pixel_sees_the_nearest_first_triangle_that_covers_its_centre() {
    let mut r = Random(1);
    for (round, size) in SIZES.into_iter().cycle().take(18).enumerate() {
        let count = [300, 40, 1000][round % 3];
        let triangles: Vec<Flat> = (0..count).map(|_| random_triangle(&mut r, size, 6)).collect();
        // Three objects: the order of sources is that of objects, then of triangles.
        let mut scene = bare(flat_camera(size.0, size.1));
        let look = scene.add_material(plain());
        let mut rest = &triangles[..];
        for part in [count / 5, count / 2, count - count / 5 - count / 2] {
            let mesh = soup(&rest[..part].iter().map(|t| stood_up(t, size.1)).collect::<Vec<_>>());
            scene.add(mesh, Mat4::IDENTITY, look);
            rest = &rest[part..];
        }
        let frame = shoot(&scene, size, 1, &[Aov::Object, Aov::Triangle]);
        let first = [0, count / 5, count / 5 + count / 2];
        let want = seen(&triangles, size, 1);
        for (k, want) in want.iter().enumerate() {
            let object = ids(&frame, 0)[k];
            let got = (object != u32::MAX).then(|| first[object as usize] + ids(&frame, 1)[k] as usize);
            let (x, y) = (k as u32 % size.0, k as u32 / size.0);
            assert_eq!(got, *want, "round {round}, pixel {x},{y} of {size:?}");
        }
        assert!(want.iter().flatten().count() * 4 > want.len(), "round {round} shows something");
    }
}

// Rows 23, 24 and 52: the patterns, coverage per sample, and the mean of a pixel's samples.
#[test]
fn row_24_pixels_are_the_mean_of_their_samples_at_the_standard_places() {
    let mut r = Random(2);
    for samples in [4, 8, 16] {
        let own: Vec<[i32; 2]> = pattern(samples).iter().map(|p| p.map(|v| v as i32 * 16)).collect();
        assert_eq!(frieze::raster::sample_positions(samples), own);
        for size in [(70, 40), (30, 90)] {
            let triangles: Vec<Flat> = (0..120).map(|_| random_triangle(&mut r, size, 250)).collect();
            // Colours are whole sixteenths, so that they tell triangles apart and sums are nearly exact.
            let mut color = || [1 + r.below(15), 1 + r.below(15), 1 + r.below(15), 16].map(|v| v as f32 / 16.0);
            let colors: Vec<[f32; 4]> = triangles.iter().map(|_| color()).collect();
            let mut scene = bare(flat_camera(size.0, size.1));
            let look = scene.add_material(plain());
            let mesh = soup(&triangles.iter().map(|t| stood_up(t, size.1)).collect::<Vec<_>>());
            scene.add(painted(mesh, colors.clone()), Mat4::IDENTITY, look);
            let frame = shoot(&scene, size, samples, &[]);
            let want = seen(&triangles, size, samples);
            for (k, (got, want)) in rgba(&frame).iter().zip(want.chunks(samples as usize)).enumerate() {
                let covered = want.iter().flatten().count();
                let place = format!("{samples} samples, pixel {},{}", k as u32 % size.0, k as u32 / size.0);
                assert_eq!(got[3], covered as f32 / samples as f32, "{place}");
                for c in 0..3 {
                    let sum: f32 = want.iter().flatten().map(|t| colors[*t][c]).sum();
                    // Interpolated constants and 16 terms: a few roundings of 2^-24.
                    assert!((got[c] * got[3] - sum / samples as f32).abs() < 2e-6, "{place}: {got:?}");
                }
            }
        }
    }
}

// Row 24: no seams where triangles of one colour meet, at any number of samples.
#[test]
fn row_24_a_mesh_of_one_color_shows_none_of_its_edges() {
    let mut r = Random(3);
    for samples in [1, 4, 8, 16] {
        let (mesh, _) = jittered(&mut r, 12, 80.0);
        let mut scene = bare(flat_camera(80, 80));
        scene.output.background = frieze::scene::Background::Color([0.0; 3]);
        let look = scene.add_material(Material { albedo: [0.25, 0.5, 0.75], ..plain() });
        scene.add(mesh, Mat4::IDENTITY, look);
        let frame = shoot(&scene, (80, 80), samples, &[]);
        for (k, c) in rgba(&frame).iter().enumerate() {
            for (got, want) in c.iter().zip([0.25, 0.5, 0.75, 1.0]) {
                // Weights of up to 16 samples sum to 1 within a rounding of each.
                assert!((got - want).abs() < 2e-6, "{samples} samples, pixel {k}: {c:?}");
            }
        }
    }
}

/// A sheet of `n` x `n` quads over `side` x `side` in the plane z = 100, inner points moved about (so little that
/// nothing folds), every second time onto eighths; and the number of its triangles.
fn jittered(r: &mut Random, n: usize, side: f32) -> (Mesh, usize) {
    let step = side / n as f32;
    let on_grid = r.below(2) == 0;
    let mut mesh = Mesh::default();
    for (j, i) in (0..=n).flat_map(|j| (0..=n).map(move |i| (j, i))) {
        let p = [i, j].map(|k| {
            let v = k as f32 * step + if k > 0 && k < n { r.within(-0.2, 0.2) * step } else { 0.0 };
            if on_grid { (v * 8.0).round() / 8.0 } else { v }
        });
        mesh.positions.push([p[0], p[1], 100.0]);
    }
    for (j, i) in (0..n).flat_map(|j| (0..n).map(move |i| (j, i))) {
        let at = |i: usize, j: usize| (j * (n + 1) + i) as u32;
        let q = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        let order = if r.below(2) == 0 { [0, 1, 2, 0, 2, 3] } else { [1, 2, 3, 1, 3, 0] };
        mesh.corners.extend(order.map(|k| q[k]));
    }
    let count = mesh.triangle_count();
    (mesh, count)
}

/// Glass that halves what is behind: alpha tells how many layers a sample has.
fn glass() -> Material {
    Material { alpha: Alpha::Blend, opacity: 0.5, ..plain() }
}

// Row 23 by itself: what lies on a shared edge is drawn once. Drawn twice it would be darker, drawn never a hole.
#[test]
fn row_23_a_sheet_of_glass_covers_each_sample_exactly_once() {
    let mut r = Random(4);
    for round in 0..16 {
        let samples = [1, 4, 8, 16][round % 4];
        // The sheet reaches beyond the picture, so that every sample is inside.
        let (mesh, _) = jittered(&mut r, 3 + round * 2, 140.0);
        let mut scene = bare(flat_camera(130, 70));
        let look = scene.add_material(glass());
        // Now and then not on the grid of 1/512 either.
        let turn = if round % 2 == 0 { Mat4::IDENTITY } else { Mat4::translation(Vec3::new(-3.3, -5.7, 0.0)) };
        scene.add(mesh, turn, look);
        let frame = shoot(&scene, (130, 70), samples, &[]);
        let wrong = rgba(&frame).iter().position(|c| c[3] != 0.5);
        assert_eq!(wrong.map(|k| (k % 130, k / 130, rgba(&frame)[k])), None, "round {round}, {samples} samples");
    }
}

// Row 23 where edge functions take 64 bits: large triangles that meet in a row and in a column of pixel centres.
#[test]
fn row_23_large_triangles_that_meet_on_pixel_centres_cover_each_once() {
    for (x, y) in [(64.5, 34.5), (10.5, 60.5)] {
        let mut all = Vec::new();
        for (x0, x1) in [(-300.0, x), (x, 400.0)] {
            for (y0, y1) in [(-300.0, y), (y, 400.0)] {
                let [a, b, c, d] = [[x0, y0, 100.0], [x1, y0, 100.0], [x1, y1, 100.0], [x0, y1, 100.0]];
                all.extend([[a, b, c], [a, c, d]]);
            }
        }
        let mut scene = bare(flat_camera(130, 70));
        let look = scene.add_material(glass());
        scene.add(soup(&all), Mat4::IDENTITY, look);
        let frame = shoot(&scene, (130, 70), 1, &[]);
        let wrong = rgba(&frame).iter().position(|c| c[3] != 0.5);
        assert_eq!(wrong.map(|k| (k % 130, k / 130, rgba(&frame)[k])), None, "{x} {y}");
    }
}

/// A camera somewhere around the origin.
fn around(r: &mut Random, distance: f32) -> Camera {
    let eye = r.direction() * distance;
    let up = if eye.x.abs() + eye.z.abs() < 0.1 * distance { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let target = Vec3::new(r.within(-0.2, 0.2), r.within(-0.2, 0.2), r.within(-0.2, 0.2));
    Camera::look_at(eye, target, up.into(), r.within(30.0, 70.0))
}

/// A turn, an uneven scale, now and then a mirror.
fn random_transform(r: &mut Random) -> Mat4 {
    let mirror = if r.below(2) == 0 { -1.0 } else { 1.0 };
    let scale = Vec3::new(r.within(0.5, 1.3) * mirror, r.within(0.5, 1.3), r.within(0.5, 1.3));
    Mat4::rotation(r.turn()).times(&Mat4::scale(scale))
}

// Row 23 in perspective: a closed surface has as many fronts as backs, so an even number of layers over each sample.
#[test]
fn row_23_a_closed_surface_of_glass_has_an_even_number_of_layers_everywhere() {
    let mut r = Random(5);
    for round in 0..24 {
        let mesh = [shape::sphere(2.0, 40), shape::torus(2.0, 40), shape::cube(1.4)][round % 3].clone();
        let mut scene = bare(around(&mut r, 3.0));
        let look = scene.add_material(glass());
        scene.add(mesh, random_transform(&mut r), look);
        let frame = shoot(&scene, (140, 90), 1, &[]);
        let mut inside = 0;
        for (k, c) in rgba(&frame).iter().enumerate() {
            // 1 - alpha is 2^-layers.
            let layers = (0..20).find(|n| (1.0 - c[3]) * (1 << n) as f32 == 1.0);
            assert!(layers.is_some_and(|n| n % 2 == 0), "round {round}, pixel {k}: {layers:?} layers, {c:?}");
            inside += usize::from(layers > Some(0));
        }
        assert!(inside > 500, "round {round}: {inside}");
    }
}

// Culling of clusters and of back faces: what is seen of a closed surface are its fronts, so leaving out the backs
// uncovers nothing, and the order in which winding, mirroring and cones of normals are combined does not matter.
#[test]
fn a_closed_surface_covers_the_same_samples_without_its_back_faces() {
    let mut r = Random(6);
    for round in 0..24 {
        let mesh = [shape::sphere(2.0, 64), shape::torus(2.0, 64), shape::cube(1.4)][round % 3].clone();
        let mut scene = bare(around(&mut r, 3.2));
        let look = scene.add_material(plain());
        let transform = random_transform(&mut r);
        scene.add(mesh, transform, look);
        if round % 4 == 3 {
            scene.cameras[0].projection = frieze::scene::Projection::Orthographic { height: 3.0 };
        }
        let both = shoot(&scene, (140, 90), 4, &[]);
        scene.materials[look].double_sided = false;
        let front = shoot(&scene, (140, 90), 4, &[]);
        let cover = |f: &frieze::Frame| rgba(f).iter().map(|c| c[3]).collect::<Vec<_>>();
        assert_eq!(cover(&both), cover(&front), "round {round}");
        // The other way round there is no outside: seen from out there nothing is left but what lies behind.
        scene.objects[0].transform = transform.times(&Mat4::scale(Vec3::splat(-1.0)));
        let mirrored = shoot(&scene, (140, 90), 4, &[]);
        assert!(rgba(&mirrored).iter().filter(|c| c[3] == 1.0).count() > 500, "round {round}: mirroring shows fronts");
    }
}

// Row 27: what is nearest does not depend on who comes first, solid or layered.
#[test]
fn row_27_the_order_of_triangles_and_objects_changes_nothing() {
    let mut r = Random(7);
    for material in [plain(), Material { opacity: 0.4, ..glass() }] {
        // Triangles that lean and cross: no two samples have equal depths.
        let triangles: Vec<([[f32; 3]; 3], [f32; 4])> = (0..200)
            .map(|_| {
                let t = stood_up(&random_triangle(&mut r, (100, 80), 200), 80);
                let t = t.map(|p| [p[0], p[1], p[2] + r.within(0.0, 50.0)]);
                (t, [r.unit(), r.unit(), r.unit(), 1.0])
            })
            .collect();
        let picture = |order: &[usize], parts: usize| {
            let mut scene = bare(flat_camera(100, 80));
            let look = scene.add_material(material.clone());
            for part in order.chunks(order.len().div_ceil(parts)) {
                let mesh = soup(&part.iter().map(|k| triangles[*k].0).collect::<Vec<_>>());
                let colors = part.iter().map(|k| triangles[*k].1).collect();
                scene.add(painted(mesh, colors), Mat4::IDENTITY, look);
            }
            let frame = shoot(&scene, (100, 80), 4, &[]);
            rgba(&frame).iter().map(|c| c.map(f32::to_bits)).collect::<Vec<_>>()
        };
        let mut order: Vec<usize> = (0..triangles.len()).collect();
        let first = picture(&order, 1);
        for round in 0..6 {
            r.shuffle(&mut order);
            // Sums over the triangles of a pixel are made in their order; their last bits may differ.
            let other = picture(&order, 1 + round);
            for (k, (a, b)) in first.iter().zip(&other).enumerate() {
                let near = a.iter().zip(b).all(|(a, b)| (f32::from_bits(*a) - f32::from_bits(*b)).abs() < 1e-6);
                assert!(near, "round {round}, pixel {},{}: {a:?} {b:?}", k % 100, k / 100);
            }
        }
    }
}

/// Where the ray of a pixel's centre meets the plane y = `height`: the distance along the camera's axis and the point.
fn ray_cast(camera: &Camera, (w, h): (u32, u32), k: usize, height: f64) -> Option<(f64, [f64; 3])> {
    let frieze::scene::Projection::Perspective { fov_y } = camera.projection else { panic!("a pinhole") };
    let half = frieze::math::exact::tan_f64(f64::from(fov_y).to_radians() / 2.0);
    let (px, py) = ((k % w as usize) as f64 + 0.5, (k / w as usize) as f64 + 0.5);
    let x = (2.0 * px / f64::from(w) - 1.0) * half * f64::from(w) / f64::from(h);
    let y = (1.0 - 2.0 * py / f64::from(h)) * half;
    let axis = |c: usize| camera.transform.column(c).array().map(f64::from);
    let (right, up, back, eye) = (axis(0), axis(1), axis(2), axis(3));
    let ray: [f64; 3] = core::array::from_fn(|c| right[c] * x + up[c] * y - back[c]);
    let t = (height - eye[1]) / ray[1];
    (t > 0.0 && t.is_finite()).then(|| (t, core::array::from_fn(|c| eye[c] + ray[c] * t)))
}

/// Against the plane y = 0 from -`half` to `half`: coverage, but for a band of `margin` at its rim and the near plane,
/// and place, depth and uv of what is covered.
fn against_the_plane(scene: &Scene, size: (u32, u32), half: f64, margin: f64, what: &str) -> usize {
    let camera = &scene.cameras[0];
    let frame = shoot(scene, size, 1, &[Aov::Position, Aov::Depth, Aov::Uv]);
    let (mut hits, mut misses) = (0, 0);
    for (k, color) in rgba(&frame).iter().enumerate() {
        let hit = ray_cast(camera, size, k, 0.0);
        let hit = hit.filter(|(t, _)| *t > f64::from(camera.near) * (1.0 + margin));
        let rim = |p: &[f64; 3]| half - p[0].abs().max(p[2].abs());
        let at = format!("{what}: pixel {},{}", k % size.0 as usize, k / size.0 as usize);
        match hit {
            Some((t, p)) if rim(&p) > margin * t => {
                hits += 1;
                assert_eq!(color[3], 1.0, "{at} has a hole");
                for (got, want) in floats::<3>(&frame, 0)[k].into_iter().zip(p) {
                    // Row 26 asks for 1e-5, relative to the distance.
                    assert!((f64::from(got) - want).abs() < 1e-5 * t.max(1.0), "{at}: {got} {want}");
                }
                let depth = f64::from(floats::<1>(&frame, 1)[k][0]);
                assert!((depth - t).abs() < 1e-5 * t, "{at}: depth {depth} {t}");
                let uv = floats::<2>(&frame, 2)[k].map(f64::from);
                for (got, want) in uv.into_iter().zip([p[0] / (2.0 * half) + 0.5, p[2] / (2.0 * half) + 0.5]) {
                    // The same in widths of the plane.
                    assert!((got - want).abs() < 1e-5 * (t / half).max(1.0), "{at}: {got} {want}");
                }
            }
            Some((t, p)) if rim(&p) > -margin * t => {}
            _ => {
                // Nearer than the near plane or beside the plane.
                let near = ray_cast(camera, size, k, 0.0).is_some_and(|(t, _)| t > f64::from(camera.near));
                if !near || hit.is_some() {
                    misses += 1;
                    assert_eq!(color[3], 0.0, "{at} is covered");
                }
            }
        }
    }
    assert!(misses > 0 || hits == rgba(&frame).len(), "{what}");
    hits
}

// Row 26 on the fast path, through the near plane: a ground that begins behind the eye.
#[test]
fn row_26_a_plane_at_80_degrees_through_the_near_plane_is_as_rays_find_it() {
    let mut r = Random(8);
    for round in 0..12 {
        let segments = [1, 3, 40][round % 3];
        let height = r.within(0.3, 2.0);
        let eye = Vec3::new(r.within(-2.0, 2.0), height, r.within(-2.0, 2.0));
        let angle = r.within(0.0, 6.0);
        let (s, c) = (frieze::math::exact::sin(angle), frieze::math::exact::cos(angle));
        // The plane's normal leans 80 degrees from the viewing direction.
        let target = eye + Vec3::new(s, -0.176_327, c);
        let mut camera = Camera::look_at(eye, target, Vec3::new(0.0, 1.0, 0.0), 60.0);
        // On odd rounds the near plane cuts the visible ground.
        camera.near = if round % 2 == 0 { 0.05 } else { height * 2.2 };
        let mut scene = bare(camera);
        let white = Image::new(1, 1, 1, Pixels::U8(vec![255]), Encoding::Linear).unwrap();
        let white = scene.add_image(white);
        let look = scene.add_material(Material { albedo_map: Some(Texture::new(white)), ..plain() });
        scene.add(shape::plane(40.0, segments), Mat4::IDENTITY, look);
        let hits = against_the_plane(&scene, (130, 100), 20.0, 2e-3, &format!("round {round}"));
        assert!(hits > 1000, "round {round}: {hits}");
    }
}

// Triangles far beyond the guard band of 16384 pixels are cut, and neither leak nor move.
#[test]
fn huge_triangles_are_cut_at_the_guard_band_and_stay_where_they_are() {
    let mut r = Random(9);
    for (round, size) in [3e3, 1e5, 1e6].into_iter().cycle().take(12).enumerate() {
        // The rim of the plane runs through the picture.
        let eye = Vec3::new(size * 0.5 + r.within(-1.0, 0.5), 1.5, r.within(-1.0, 1.0));
        let target = eye + Vec3::new(r.within(-0.9, 0.3), -1.2, r.within(-1.0, 1.0));
        let mut camera = Camera::look_at(eye, target, Vec3::new(0.0, 1.0, 0.0), 50.0);
        camera.near = 0.01;
        let mut scene = bare(camera);
        let look = scene.add_material(plain());
        scene.add(shape::plane(1.0, 2), Mat4::scale(Vec3::splat(size)), look);
        let frame = shoot(&scene, (90, 70), 1, &[]);
        let mut hits = 0;
        for (k, color) in rgba(&frame).iter().enumerate() {
            let Some((t, p)) = ray_cast(&scene.cameras[0], (90, 70), k, 0.0) else {
                assert_eq!(color[3], 0.0, "round {round}, pixel {k} looks up");
                continue;
            };
            // The way from world to picture is rounded to single precision, and the eye stands at size / 2. Cut
            // corners are snapped 16384 pixels away, which moves an edge by less than that here.
            let rim = f64::from(size) * 0.5 - p[0];
            let slack = 0.02 * t + f64::from(size) * 2e-7;
            if rim.abs() > slack {
                hits += usize::from(rim > 0.0);
                assert_eq!(color[3], if rim > 0.0 { 1.0 } else { 0.0 }, "round {round}, pixel {k}: {p:?}");
            }
        }
        assert!(hits > 100, "round {round}: {hits}");
    }
    // And neighbours that are cut still share their edges.
    for round in 0..8 {
        let eye = Vec3::new(r.within(-0.1, 0.1), 0.002, r.within(-0.1, 0.1));
        let target = eye + Vec3::new(r.within(-1.0, 1.0), -0.6, 0.7);
        let mut camera = Camera::look_at(eye, target, Vec3::new(0.0, 1.0, 0.0), 80.0);
        camera.near = 1e-5;
        let mut scene = bare(camera);
        let look = scene.add_material(glass());
        scene.add(shape::plane(50.0, 6 + round), Mat4::IDENTITY, look);
        let frame = shoot(&scene, (120, 90), 4, &[]);
        for (k, c) in rgba(&frame).iter().enumerate() {
            let below = ray_cast(&scene.cameras[0], (120, 90), k, 0.0).is_some_and(|(t, _)| t < 0.1);
            assert!(!below || c[3] == 0.5, "round {round}, pixel {},{}: {c:?}", k % 120, k / 120);
        }
    }
}

// The scalar path behind custom shaders has the same rule.
#[test]
fn row_23_the_scalar_rasteriser_covers_what_the_tiles_cover() {
    let mut r = Random(10);
    let size = (64, 64);
    for _ in 0..200 {
        let t = random_triangle(&mut r, size, 100);
        // With w = 64 the way to pixels and back is exact.
        let clip = t.map(|[x, y, z]| Vec4::new(2.0 * x - 64.0, 64.0 - 2.0 * y, z / 4.0, 64.0));
        let mut got = Vec::new();
        fragments::triangle(clip, size.0, size.1, &fragments::CENTER, |f| got.push(f.y * 64 + f.x));
        let all = seen(&[t], size, 1);
        let want: Vec<u32> = (0..64 * 64).filter(|k| all[*k as usize].is_some()).collect();
        assert_eq!(got, want, "{t:?}");
    }
}

// Objects that only repeat a mesh, and one that has nothing to draw.
#[test]
fn many_objects_of_one_mesh_are_each_where_they_stand() {
    let mut scene = bare(flat_camera(96, 96));
    let look = scene.add_material(plain());
    scene.meshes.push(soup(&[[[0.0, 0.0, 9.0], [8.0, 0.0, 9.0], [0.0, 8.0, 9.0]]]));
    scene.meshes.push(Mesh::default());
    for k in 0..144u32 {
        let place = Mat4::translation(Vec3::new((k % 12 * 8) as f32, (k / 12 * 8) as f32, 0.0));
        let mesh = usize::from(k % 7 == 6);
        scene.objects.push(Object { name: String::new(), mesh, transform: place, materials: vec![look] });
    }
    let frame = shoot(&scene, (96, 96), 1, &[Aov::Object]);
    for (k, id) in ids(&frame, 0).iter().enumerate() {
        let (x, y) = (k as u32 % 96, 95 - k as u32 / 96);
        let (object, inside) = (y / 8 * 12 + x / 8, x % 8 + y % 8 < 7);
        let maybe = x % 8 + y % 8 == 7;
        let want = if inside && object % 7 != 6 { object } else { u32::MAX };
        assert!(maybe || *id == want, "{x} {y}: {id} {want}");
    }
}
