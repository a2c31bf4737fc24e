//! `explain` shows the frame's own numbers: its colours have the frame's bits, and what it lists adds up to them.

use frieze::explain::{Encoded, Explanation, Fragment, pixels};
use frieze::image::{Encoding, Image, Pixels};
use frieze::job::Job;
use frieze::map::{Filter, Wrap};
use frieze::math::lane::Level;
use frieze::math::vec::{Mat4, Vec3};
use frieze::mesh::shape;
use frieze::prepare::Prepared;
use frieze::render::{Format, RenderOptions, frame};
use frieze::scene::{
    Alpha, Background, Camera, Light, LightKind, Material, Model, NormalMap, NormalSpace, Scene, Shading, TangentFrame,
    TbnPath, Texture, ToneMap, View,
};
use frieze::{explain, samples};

const SIZE: (u32, u32) = (84, 70);

/// Every seventh pixel or so: all tiles, all kinds of edges.
fn some() -> Vec<(u32, u32)> {
    (0..SIZE.0 * SIZE.1).step_by(97).map(|k| (k % SIZE.0, k / SIZE.0)).collect()
}

fn sum(t: impl Iterator<Item = [f32; 3]>) -> [f64; 3] {
    t.fold([0.0; 3], |s, c| core::array::from_fn(|k| s[k] + f64::from(c[k])))
}

/// What the fragment lists is consistent in itself.
fn check(f: &Fragment) {
    for map in &f.maps {
        let mut got = [0.0f64; 4];
        for t in &map.texels {
            (0..4).for_each(|c| got[c] += f64::from(t.weight) * f64::from(t.value[c]));
        }
        for c in 0..4 {
            // Roundings of a few hundred single-precision terms at most.
            assert!((got[c] - f64::from(map.value[c])).abs() < 1e-5, "{got:?} {map:?}");
        }
    }
    let b: f32 = f.barycentric.iter().sum();
    // Three quotients of one determinant.
    assert!((b - 1.0).abs() < 1e-5, "{b}");
    for light in &f.lights {
        if let (Some(shadow), Some(terms)) = (&light.shadow, &light.terms) {
            let lit = shadow.taps.iter().filter(|t| t.lit).count() as f32;
            assert_eq!(lit / shadow.taps.len() as f32, terms.visibility, "{shadow:?}");
        }
    }
    let total = sum([f.ambient, f.reflected, f.emissive].into_iter());
    for (total, color) in total.iter().zip(f.color) {
        // `reflected` is a difference of the others.
        assert!((total - f64::from(color)).abs() < 1e-5 * total.abs().max(1.0), "{f:?}");
    }
}

/// Explains many pixels of a scene in both formats with 1 and 4 samples and compares them with the frame.
fn same_bits(scene: &Scene, level: Level, asked: &[(u32, u32)]) -> Vec<Explanation> {
    let prepared = Prepared::new(scene, &Job::default()).unwrap();
    let mut all = Vec::new();
    for samples in [1, 4] {
        for format in [Format::U8, Format::U16, Format::F32] {
            let options = RenderOptions { level, size: SIZE, samples, format, ..Default::default() };
            let (picture, _) = frame(&prepared, &options).unwrap();
            for e in pixels(scene, &prepared, &options, asked).unwrap() {
                let at = 4 * (e.pixel[1] * SIZE.0 + e.pixel[0]) as usize;
                let what = format!("{} {:?} {samples} {format:?} {}", scene.name, e.pixel, level.name());
                match (picture.color.pixels(), e.color.encoded) {
                    (Pixels::U8(v), Encoded::U8(got)) => assert_eq!(v[at..at + 4], got, "{what}"),
                    (Pixels::U16(v), Encoded::U16(got)) => assert_eq!(v[at..at + 4], got, "{what}"),
                    (Pixels::F32(v), Encoded::F32(got)) => {
                        assert_eq!(
                            v[at..at + 4].iter().map(|v| v.to_bits()).collect::<Vec<_>>(),
                            got.map(f32::to_bits),
                            "{what}"
                        );
                        assert_eq!(got, e.color.linear, "{what}");
                    }
                    (p, e) => panic!("{what}: {p:?} {e:?}"),
                }
                e.fragments.iter().for_each(check);
                let seen: u32 = e.fragments.iter().filter(|f| f.kind != "layer").map(|f| f.samples).sum();
                assert_eq!(seen as usize, e.samples.iter().filter(|s| s.fragment.is_some()).count(), "{what}");
                assert_eq!(e.samples.len() as u32, samples * e.supersample * e.supersample, "{what}");
                assert_eq!(e.background_only, e.fragments.is_empty(), "{what}");
                all.push(e);
            }
        }
    }
    all
}

#[test]
fn the_colour_has_the_frames_bits_at_every_level() {
    for name in ["cubes", "wall", "spheres"] {
        let scene = samples::scene(name).unwrap();
        let asked = some();
        let all: Vec<_> = Level::available().into_iter().map(|l| same_bits(&scene, l, &asked)).collect();
        let text = |e: &Vec<Explanation>| serde_json::to_string(e).unwrap();
        // Not the colour alone: everything that is said is the same at every level.
        assert!(all.iter().all(|e| text(e) == text(&all[0])), "{name}");
        assert!(all[0].iter().any(|e| !e.background_only), "{name}");
    }
}

#[test]
fn every_way_of_lighting_is_explained() {
    for name in ["ground", "cup", "flat-gouraud-phong"] {
        let mut scene = samples::scene(name).unwrap();
        if name == "flat-gouraud-phong" {
            // The sample's picture is wide; all three spheres are to be seen.
            let up = Vec3::new(0.0, 1.0, 0.0);
            scene.cameras[0] = Camera::look_at(Vec3::new(0.0, 0.5, 8.0), Vec3::default(), up, 40.0);
        }
        let all = same_bits(&scene, Level::best(), &some());
        if name == "flat-gouraud-phong" {
            let fragments: Vec<_> = all.iter().flat_map(|e| &e.fragments).collect();
            for word in ["flat", "gouraud", "phong"] {
                let f = fragments.iter().find(|f| f.shading == word && f.color[2] > 0.1).expect(word);
                assert_eq!(f.lights.len(), scene.lights.len(), "{word}");
                assert_eq!(f.lights[0].terms.is_some(), word == "phong");
                assert!(f.lights[0].diffuse[0] >= 0.0);
            }
        }
    }
}

/// Three panes of glass, one of them cut out, over a mapped floor, supersampled.
fn panes() -> Scene {
    let mut scene = Scene { name: "panes".into(), ..Scene::default() };
    let texels = (0..16 * 16).flat_map(|k: u32| {
        let (x, y) = (k % 16, k / 16);
        [(x * 16) as u8, (y * 16) as u8, 200, if (x / 2 + y / 2) % 2 == 0 { 230 } else { 40 }]
    });
    let image = scene.add_image(Image::new(16, 16, 4, Pixels::U8(texels.collect()), Encoding::Srgb).unwrap());
    let texture = |filter, wrap| Texture { filter, wrap: [wrap; 2], scale: [3.0, 2.0], ..Texture::new(image) };
    let bumpy = NormalMap { texture: texture(Filter::Trilinear, Wrap::Mirror), scale: 0.4, y_down: false, channels: 3 };
    let kinds = [
        (Alpha::Opaque, Filter::Ewa { radius: Filter::EWA_RADIUS }, Model::Pbr, TbnPath::World),
        (Alpha::Blend, Filter::Bicubic, Model::BlinnPhong, TbnPath::Tangent),
        (Alpha::Mask(0.5), Filter::Anisotropic { max: 8 }, Model::BlinnPhong, TbnPath::World),
        (Alpha::Blend, Filter::Nearest, Model::Unlit, TbnPath::World),
    ];
    for (k, (alpha, filter, model, tbn_path)) in kinds.into_iter().enumerate() {
        let material = scene.add_material(Material {
            name: format!("pane {k}"),
            model,
            alpha,
            tbn_path,
            double_sided: true,
            opacity: 0.6,
            emissive: [0.01, 0.0, 0.02],
            albedo_map: Some(texture(filter, if k == 3 { Wrap::Border } else { Wrap::Repeat })),
            normal_map: (k < 2).then(|| bumpy.clone()),
            ..Material::default()
        });
        // The last one is seen from behind.
        let turn = Mat4::rotation(if k == 3 { [1.0, 0.0, 0.2, 0.1] } else { [0.2, 0.3 * k as f32, 0.1, 1.0] });
        let at = Mat4::translation(Vec3::new(0.1 * k as f32, 0.4 * k as f32, 0.0));
        scene.add(shape::plane(if k == 0 { 3.0 } else { 2.0 }, 2), at.times(&turn), material);
    }
    scene.lights.push(Light::directional(Vec3::new(1.0, 3.0, 1.0), Vec3::default()));
    scene.lights.push(Light {
        kind: LightKind::Spot { inner: 10.0, outer: 60.0 },
        range: Some(20.0),
        direction: Vec3::new(0.0, -1.0, 0.0),
        shadow: None,
        ..Light::point(Vec3::new(0.0, 4.0, 0.0))
    });
    scene.cameras.push(Camera::look_at(Vec3::new(2.0, 4.0, 3.0), Vec3::default(), Vec3::new(0.0, 1.0, 0.0), 40.0));
    scene.view = View::Camera(0);
    scene.output.tone_map = ToneMap::Agx;
    scene
}

#[test]
fn layers_cuts_and_supersampling_are_explained() {
    let mut scene = panes();
    for (supersample, background) in [(1, Background::Color([0.3, 0.1, 0.2])), (2, Background::Transparent)] {
        scene.output.supersample = supersample;
        scene.output.background = background;
        let all = same_bits(&scene, Level::best(), &some());
        let fragments: Vec<_> = all.iter().flat_map(|e| &e.fragments).collect();
        assert!(["solid", "cut", "layer"].iter().all(|kind| fragments.iter().any(|f| f.kind == *kind)));
        assert!(all.iter().any(|e| e.samples.iter().any(|s| s.layers.len() > 1)), "layers over layers");
        assert!(fragments.iter().any(|f| f.normal.space == "tangent") && fragments.iter().any(|f| !f.front));
        assert!(all.iter().any(|e| e.background_only && e.color.coverage == 0.0));
    }
}

#[test]
fn flat_and_gouraud_lights_sum_to_what_is_reflected() {
    let mut scene = samples::scene("flat-gouraud-phong").unwrap();
    for m in &mut scene.materials {
        (m.specular, m.ambient, m.emissive, m.reflection) = ([0.0; 3], Some([0.0; 3]), [0.0; 3], 0.0);
        m.model = Model::BlinnPhong;
    }
    let all = same_bits(&scene, Level::best(), &some());
    let mut seen = 0;
    for f in all.iter().flat_map(|e| &e.fragments).filter(|f| f.shading != "phong") {
        let diffuse = sum(f.lights.iter().map(|l| l.diffuse));
        for ((light, albedo), reflected) in diffuse.iter().zip(f.albedo).zip(f.reflected) {
            // A few roundings of numbers of size 1 to 10.
            assert!((light * f64::from(albedo) - f64::from(reflected)).abs() < 1e-5, "{f:?}");
        }
        seen += 1;
    }
    assert!(seen > 50 && scene.materials.iter().any(|m| m.shading == Shading::Flat));
}

#[test]
fn the_tangent_frame_says_what_made_it() {
    let head = samples::scene("mirrored-head").unwrap();
    let options = RenderOptions { size: (64, 72), samples: 1, ..Default::default() };
    let frame_at = |scene: &Scene, x, y| {
        let e = explain(scene, &options, x, y).unwrap();
        let normal = e.fragments[0].normal.clone();
        assert_eq!((normal.map_space, normal.mapped.is_some()), (Some("tangent"), true));
        normal.frame.unwrap()
    };
    // Seen from the front and a little from its right side, -X: u grows to the left on one cheek, to the right on the
    // other.
    let (left, right) = (frame_at(&head, 18, 36), frame_at(&head, 44, 36));
    assert!(left.tangent[0] < 0.0 && right.tangent[0] > 0.0);
    assert!(left.mirrored != right.mirrored && left.bitangent[1] > 0.0 && right.bitangent[1] > 0.0);
    assert_eq!((left.rule, left.fallback), ("mikktspace", None));
    let with = |change: &dyn Fn(&mut Scene)| {
        let mut scene = head.clone();
        change(&mut scene);
        let f = frame_at(&scene, 18, 36);
        (f.rule, f.fallback)
    };
    assert_eq!(with(&|s| s.materials[0].tangent_frame = TangentFrame::Average), ("average", None));
    assert_eq!(with(&|s| s.materials[0].tangent_frame = TangentFrame::PerTriangle), ("per-triangle", None));
    assert_eq!(with(&|s| s.materials[0].tangent_frame = TangentFrame::FromNormal), ("from-normal", None));
    assert_eq!(with(&|s| s.materials[0].tangent_frame = TangentFrame::Games101), ("games101", None));
    assert_eq!(with(&|s| s.meshes[0].uv = [None, None]), ("from-normal", Some("no-uv")));
    let flat = |s: &mut Scene| s.meshes[0].uv[0].as_mut().unwrap().values.fill([0.5; 2]);
    assert_eq!(with(&flat), ("mikktspace", Some("no-uv-area")));
    // Tangents of the file come first.
    let given = |s: &mut Scene| {
        let m = &s.meshes[0];
        let made = frieze::mesh::tangent::mikktspace(m, m.normals.as_ref().unwrap(), m.uv[0].as_ref().unwrap());
        s.meshes[0].tangents = Some(made);
    };
    assert_eq!(with(&given), ("file", None));
    // A map in object space has no frame.
    let mut object = head.clone();
    object.materials[0].normal_space = NormalSpace::Object;
    let normal = explain(&object, &options, 18, 36).unwrap().fragments[0].normal.clone();
    assert!(normal.frame.is_none() && normal.mapped.is_some() && normal.map_space == Some("object"));
}

#[test]
fn a_pixel_outside_is_told_about() {
    let scene = samples::scene("wall").unwrap();
    let options = RenderOptions { size: SIZE, ..Default::default() };
    let e = explain(&scene, &options, SIZE.0, 3).unwrap_err();
    assert_eq!((e.code, e.fault.exit_code()), ("explain.pixel", 2));
    assert!(e.remedy.is_some_and(|r| r.contains("83") && r.contains("69")));
    assert_eq!(explain(&scene, &options, SIZE.0 - 1, SIZE.1 - 1).unwrap().pixel, [83, 69]);
}
