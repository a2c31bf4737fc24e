//! The small pictures that are compared bit for bit: the built-in scenes, and scenes that between them take every
//! path through the renderer. Shared by `bits.rs`, `golden.rs` and the chore that renews the golden pictures.

use frieze::image::{Encoding, Image, Pixels};
use frieze::map::{Filter, Wrap};
use frieze::math::vec::{Mat4, Vec3};
use frieze::mesh::{Attribute, Mesh, shape};
use frieze::render::{Overlay, Overlays};
use frieze::samples;
use frieze::scene::{
    Alpha, Background, Bias, Camera, Falloff, Light, LightKind, Material, Model, NormalMap, NormalSpace, NormalZero,
    Object, Output, Projection, Scene, Shading, Shadow, ShadowFilter, ShadowProjection, ShadowWrap, TangentFrame,
    TbnPath, Texture, ToneMap, View,
};

/// Names of all scenes: built in, then made here.
pub fn names() -> Vec<&'static str> {
    let built_in = samples::NAMES.iter().map(|(name, _)| *name);
    built_in.chain(["filters", "alpha", "lights", "materials", "parallel", "normal-spaces"]).collect()
}

/// Names of the scenes that are drawn with overlays as well: the golden picture alone has them.
#[allow(dead_code, reason = "bits.rs has tests of its own")]
pub const DRAWN_OVER: [(&str, &str, &[Overlay]); 3] = [
    ("overlay-tbn", "mirrored-head", &[Overlay::UvSeams, Overlay::Tbn]),
    ("overlay-map-normals", "wall", &[Overlay::MapNormals]),
    ("overlay-wire", "teapot", &[Overlay::Wire, Overlay::LightFrustum]),
];

/// The scene of that name with what is drawn over it.
#[allow(dead_code, reason = "the same")]
pub fn scene_with_overlays(name: &str) -> (Scene, Overlays) {
    let drawn = DRAWN_OVER.iter().find(|(n, ..)| *n == name);
    drawn.map_or_else(
        || (scene(name), Overlays::default()),
        |(_, below, list)| (scene(below), Overlays { list: list.to_vec(), ..Overlays::default() }),
    )
}

/// The scene of that name; stress scenes have a hundredth of their triangles.
pub fn scene(name: &str) -> Scene {
    let scene = match name {
        "filters" => filters(),
        "alpha" => alpha(),
        "lights" => lights(),
        "materials" => materials(),
        "parallel" => parallel(),
        "normal-spaces" => normal_spaces(),
        _ => return samples::scaled(name, 0.01).unwrap_or_else(|| panic!("no scene is called {name}")),
    };
    Scene { name: name.into(), ..scene }
}

const UP: Vec3 = Vec3::new(0.0, 1.0, 0.0);

fn at(x: f32, y: f32, z: f32) -> Mat4 {
    Mat4::translation(Vec3::new(x, y, z))
}

fn scale(x: f32, y: f32, z: f32) -> Mat4 {
    Mat4::scale(Vec3::new(x, y, z))
}

/// A quarter turn about x: what lies, stands, and faces +Z.
fn upright() -> Mat4 {
    let h = std::f32::consts::FRAC_1_SQRT_2;
    Mat4::rotation([h, 0.0, 0.0, h])
}

/// Leans back from upright by an eighth of a turn.
fn leaning() -> Mat4 {
    Mat4::rotation([0.382_683_43, 0.0, 0.0, 0.923_879_5])
}

fn look(scene: &mut Scene, eye: [f32; 3], target: [f32; 3], fov_y: f32) {
    scene.cameras.push(Camera::look_at(eye.into(), target.into(), UP, fov_y));
    scene.view = View::Camera(0);
}

/// Coloured cells with an odd texel here and there; sizes that are no powers of two. Alpha falls to the right.
fn picture(width: u32, height: u32, kind: usize) -> Image {
    let mut values = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let cell = (x / 5 + y / 4) % 3;
            let odd = (x * 7 + y * 13) % 11 == 5;
            let rgb = match cell {
                0 => [230, 40 + 3 * y, 30],
                1 => [20, 90, 200 - 4 * x.min(40)],
                _ => [240, 230, 190],
            };
            let alpha = 255 - 180 * x / width;
            values.extend(if odd { [10, 10, 10, alpha] } else { [rgb[0], rgb[1], rgb[2], alpha] });
        }
    }
    let (channels, pixels, encoding) = match kind {
        0 => (4, Pixels::U8(values.iter().map(|&v| v as u8).collect()), Encoding::Srgb),
        1 => (4, Pixels::U16(values.iter().map(|&v| (v * 257) as u16).collect()), Encoding::Srgb),
        2 => (4, Pixels::F32(values.iter().map(|&v| v as f32 / 200.0).collect()), Encoding::Linear),
        _ => (1, Pixels::U8(values.iter().step_by(4).map(|&v| v as u8).collect()), Encoding::Srgb),
    };
    Image::new(width, height, channels, pixels, encoding).expect("the size of its values")
}

/// Normals of round studs, OpenGL's green.
fn studs(side: u32) -> Image {
    let mut values = Vec::new();
    for y in 0..side {
        for x in 0..side {
            let [u, v] = [x, y].map(|k| (k % 16) as f32 / 8.0 - 1.0 + 1.0 / 16.0);
            let inside = u * u + v * v < 0.7;
            let n = if inside { [u * 0.7, -v * 0.7, (1.0 - 0.49 * (u * u + v * v)).sqrt()] } else { [0.0, 0.0, 1.0] };
            values.extend(n.map(|c| ((c * 0.5 + 0.5) * 255.0 + 0.5) as u8));
        }
    }
    Image::new(side, side, 3, Pixels::U8(values), Encoding::Linear).expect("the size of its values")
}

/// Every filter (columns) with every wrap (rows), each row with texels of another kind: leaning planes on which uv
/// runs from -1 to 2, near texels magnified, far ones minified.
fn filters() -> Scene {
    let mut scene = Scene::default();
    let filters = [
        Filter::Nearest,
        Filter::Bilinear,
        Filter::Bicubic,
        Filter::MipNearest,
        Filter::Trilinear,
        Filter::Ripmap,
        Filter::Anisotropic { max: 8 },
        Filter::Ewa { radius: Filter::EWA_RADIUS },
        Filter::Supersample { taps: 16 },
    ];
    let wraps = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp, Wrap::Border];
    scene.meshes.push(shape::plane(1.0, 1));
    for (row, wrap) in wraps.into_iter().enumerate() {
        let image = scene.add_image(picture(11, 7, row));
        for (column, filter) in filters.into_iter().enumerate() {
            let material = scene.add_material(Material {
                model: Model::Unlit,
                albedo_map: Some(Texture {
                    scale: [2.0; 2],
                    offset: [-0.5, -0.6],
                    rotate: if column % 2 == 0 { 0.0 } else { 11.0 },
                    filter,
                    wrap: [wrap, if row == 3 { Wrap::Mirror } else { wrap }],
                    ..Texture::new(image)
                }),
                ..Default::default()
            });
            let place = at(column as f32 - 4.0, 2.4 - 1.6 * row as f32, 0.0);
            let transform = place.times(&leaning()).times(&scale(0.94, 1.0, 1.9));
            scene.objects.push(Object { name: String::new(), mesh: 0, transform, materials: vec![material] });
        }
    }
    look(&mut scene, [0.0, 0.0, 11.0], [0.0, 0.0, 0.0], 34.0);
    scene
}

/// What is cut out, what blends in layers that cross, vertex colours, both sides of a plane, no background.
fn alpha() -> Scene {
    let mut scene = Scene::default();
    let image = scene.add_image(picture(64, 64, 0));
    let cells = scene.add_image(picture(40, 40, 3));
    let map = |image| Some(Texture { scale: [1.5; 2], ..Texture::new(image) });
    let base = Material { double_sided: true, ..Default::default() };
    let cut = scene.add_material(Material {
        alpha: Alpha::Mask(0.6),
        alpha_map: map(cells),
        albedo: [0.9, 0.7, 0.2],
        ..base.clone()
    });
    let fading = scene.add_material(Material { alpha: Alpha::Mask(0.55), albedo_map: map(image), ..base.clone() });
    let glass = scene.add_material(Material {
        alpha: Alpha::Blend,
        opacity: 0.4,
        albedo: [0.1, 0.5, 0.9],
        specular: [0.8; 3],
        ..Default::default()
    });
    let film =
        scene.add_material(Material { alpha: Alpha::Blend, albedo_map: map(image), opacity: 0.8, ..base.clone() });
    let painted = scene.add_material(Material { alpha: Alpha::Blend, model: Model::Unlit, ..base.clone() });
    let floor = scene.add_material(base);
    scene.add(shape::sphere(1.4, 20), at(-1.3, 0.1, 0.0), cut);
    scene.add(shape::torus(1.5, 24), at(0.9, 0.0, -0.6).times(&leaning()), fading);
    scene.add(shape::sphere(1.2, 20), at(0.2, 0.0, 0.9), glass);
    let sheet = |x, z: f32| at(x, 0.1, z).times(&Mat4::rotation([0.0, 0.3 * z, 0.0, 1.0])).times(&upright());
    scene.add(shape::plane(1.3, 2), sheet(1.2, 0.7), film);
    scene.add(shape::plane(1.3, 2), sheet(1.3, -0.7), film);
    let mut corners = shape::plane(1.2, 1);
    corners.colors = Some(Attribute {
        values: vec![[1.0, 0.2, 0.1, 1.0], [0.1, 1.0, 0.2, 0.3], [0.1, 0.2, 1.0, 0.8]],
        index: Some((0..corners.corners.len() as u32).map(|c| c % 3).collect()),
    });
    scene.add(corners, at(-0.3, 0.8, -0.4).times(&upright()), painted);
    scene.add(shape::plane(5.0, 1), at(0.0, -0.8, 0.0), floor);
    look(&mut scene, [0.3, 1.4, 4.6], [0.0, 0.0, 0.0], 38.0);
    let light = Light::directional(Vec3::new(-2.0, 4.0, 2.0), Vec3::splat(0.0));
    scene.lights.push(Light { intensity: 0.5, ..light });
    scene.output = Output { background: Background::Transparent, samples: 8, ..Default::default() };
    scene
}

/// Every kind of light and shadow on every shading, mirrored, squeezed and flattened objects.
fn lights() -> Scene {
    let mut scene = Scene::default();
    let material = |shading, model| Material { shading, model, albedo: [0.7, 0.6, 0.5], ..Default::default() };
    let floor = scene.add_material(material(Shading::Phong, Model::BlinnPhong));
    scene.add(shape::plane(9.0, 3), at(0.0, -0.5, 0.0), floor);
    scene.meshes.push(shape::sphere(1.0, 12));
    scene.meshes.push(shape::teapot(1.0, 16));
    let shadings = [Shading::Flat, Shading::Gouraud, Shading::Phong];
    for (row, model) in [Model::BlinnPhong, Model::Pbr].into_iter().enumerate() {
        for (column, shading) in shadings.into_iter().enumerate() {
            let look = scene.add_material(Material {
                metallic: 0.5 * column as f32,
                roughness: 0.3,
                multi_scatter: column == 2,
                tbn_path: if row == 0 { TbnPath::World } else { TbnPath::Tangent },
                ..material(shading, model)
            });
            let place = at(column as f32 * 1.3 - 1.3, 0.0, row as f32 * 1.5 - 1.0);
            // Each second one is mirrored, one is squeezed.
            let shape = if (row + column) % 2 == 0 { scale(-1.0, 1.0, 1.0) } else { scale(1.0, 0.7, 1.2) };
            let mesh = 1 + (row + column) % 2;
            let transform = place.times(&shape);
            scene.objects.push(Object { name: String::new(), mesh, transform, materials: vec![look] });
        }
    }
    let unlit = scene.add_material(Material { albedo: [0.2, 0.5, 0.3], ..material(Shading::Phong, Model::Unlit) });
    let flattened = at(2.3, 0.0, -1.0).times(&scale(1.0, 1.0, 0.0));
    scene.objects.push(Object { name: String::new(), mesh: 1, transform: flattened, materials: vec![unlit] });
    let middle = Vec3::splat(0.0);
    let sun = Light::directional(Vec3::new(-3.0, 5.0, 2.0), middle);
    let soft = Shadow { size: 256, filter: ShadowFilter::Pcf { radius: 3 }, ..Default::default() };
    scene.lights.push(Light { intensity: 0.6, shadow: Some(soft), ..sun.clone() });
    let hard = Shadow {
        size: 200,
        filter: ShadowFilter::Hard,
        bias: Bias::Value(0.01),
        near: Some(1.0),
        far: Some(14.0),
        extent: Some(3.0),
        wrap: ShadowWrap::Repeat,
        ..Default::default()
    };
    let blue = Light::directional(Vec3::new(4.0, 5.0, -2.0), middle);
    scene.lights.push(Light { color: [0.5, 0.7, 1.0], intensity: 0.25, shadow: Some(hard), ..blue });
    let pinhole = Shadow { size: 300, projection: Some(ShadowProjection::Perspective), ..Default::default() };
    let spot = Light::directional(Vec3::new(1.5, 3.0, 3.0), Vec3::new(0.3, 0.0, 0.0));
    scene.lights.push(Light {
        kind: LightKind::Spot { inner: 12.0, outer: 22.0 },
        color: [1.0, 0.6, 0.3],
        intensity: 14.0,
        falloff: Falloff::InverseSquare,
        shadow: Some(pinhole),
        ..spot
    });
    scene.lights.push(Light {
        color: [1.0, 0.2, 0.6],
        intensity: 1.2,
        falloff: Falloff::InverseSquare,
        range: Some(3.5),
        ..Light::point(Vec3::new(-2.2, 0.6, 1.4))
    });
    scene.lights.push(Light { intensity: 0.1, ..Light::point(Vec3::new(0.0, 6.0, 6.0)) });
    scene.ambient.per_light = true;
    scene.ambient.color = [0.02, 0.02, 0.03];
    look(&mut scene, [0.6, 2.6, 5.6], [0.2, -0.2, 0.0], 36.0);
    scene.output.tone_map = ToneMap::Aces;
    scene
}

/// Every map of every model, every tangent frame, channels and second uv set.
fn materials() -> Scene {
    let mut scene = Scene::default();
    let (color, deep, cells) =
        (scene.add_image(picture(32, 32, 0)), scene.add_image(picture(29, 31, 2)), scene.add_image(picture(24, 24, 3)));
    let studs = scene.add_image(studs(64));
    let map = |image| Some(Texture { scale: [2.0; 2], ..Texture::new(image) });
    let second = |image| Some(Texture { uv: 1, ..Texture::new(image) });
    let mut ball: Mesh = shape::sphere(1.0, 24);
    let uv1 = |p: &[f32; 3]| [p[0] + 0.5, 0.5 - p[1]];
    ball.uv[1] = Some(Attribute::per_position(ball.positions.iter().map(uv1).collect()));
    scene.meshes.push(ball);
    let frames = [
        TangentFrame::Mikktspace,
        TangentFrame::Average,
        TangentFrame::PerTriangle,
        TangentFrame::FromNormal,
        TangentFrame::Games101,
    ];
    for row in 0..3 {
        for (column, tangent_frame) in frames.into_iter().enumerate() {
            let normal_map = NormalMap {
                texture: Texture { scale: [3.0, 2.0], uv: u8::from(column == 4), ..Texture::new(studs) },
                scale: 0.5 + 0.25 * column as f32,
                y_down: column == 1,
                channels: if column == 2 { 2 } else { 3 },
            };
            let bumpy = Material { tangent_frame, normal_map: Some(normal_map), ..Default::default() };
            let material = match row {
                0 => Material {
                    tbn_path: if column % 2 == 0 { TbnPath::World } else { TbnPath::Tangent },
                    albedo: [0.6, 0.55, 0.5],
                    ..bumpy
                },
                1 => Material {
                    model: Model::Pbr,
                    albedo_map: map([color, deep][column % 2]),
                    metallic: 1.0,
                    metallic_map: map(cells),
                    roughness: 0.6,
                    roughness_map: second(cells),
                    specular_map: map(color),
                    specular_factor_map: map(color),
                    ior: 1.2 + 0.2 * column as f32,
                    occlusion_map: second(cells),
                    occlusion_strength: 0.7,
                    multi_scatter: column % 2 == 1,
                    ..bumpy
                },
                _ => Material {
                    albedo_map: second(color),
                    ambient: (column % 2 == 1).then_some([0.3, 0.5, 0.7]),
                    ambient_map: map(cells),
                    specular: [0.6; 3],
                    specular_map: map(color),
                    shininess: 20.0,
                    shininess_map: second(cells),
                    emissive: [0.0, 0.15, 0.0],
                    emissive_map: map(cells),
                    occlusion_map: map(cells),
                    ..Default::default()
                },
            };
            let material = scene.add_material(material);
            let transform = at(column as f32 * 1.1 - 2.2, 1.1 - 1.1 * row as f32, 0.0);
            scene.objects.push(Object { name: String::new(), mesh: 0, transform, materials: vec![material] });
        }
    }
    look(&mut scene, [0.0, 0.0, 8.5], [0.0, 0.0, 0.0], 27.0);
    let light = Light::directional(Vec3::new(-2.0, 3.0, 4.0), Vec3::splat(0.0));
    scene.lights.push(Light { intensity: 1.8, shadow: None, ..light });
    scene.output.tone_map = ToneMap::Agx;
    scene
}

/// Parallel rays, supersampled; the near plane cuts a cube and a torus.
fn parallel() -> Scene {
    let mut scene = Scene::default();
    let image = scene.add_image(picture(32, 32, 1));
    let wrapped = Material { albedo_map: Some(Texture::new(image)), ..Default::default() };
    let one = scene.add_material(wrapped.clone());
    let both = scene.add_material(Material { double_sided: true, ..wrapped });
    scene.add(shape::cube(1.4), at(-1.1, 0.0, 0.0), one);
    scene.add(shape::torus(1.8, 32), at(1.1, 0.0, 0.0), both);
    scene.add(shape::plane(6.0, 2), at(0.0, -0.8, 0.0), both);
    look(&mut scene, [1.5, 2.2, 4.0], [0.0, 0.0, 0.0], 40.0);
    scene.cameras[0].projection = Projection::Orthographic { height: 3.6 };
    scene.cameras[0].near = 4.3;
    scene.lights.push(Light::directional(Vec3::new(2.0, 4.0, 1.0), Vec3::splat(0.0)));
    scene.output = Output { tone_map: ToneMap::Reinhard, supersample: 2, samples: 1, ..Default::default() };
    scene
}

/// Normal maps in object and world space, with the exact zero in 8 and 16 bits, on objects that are turned, stretched
/// and mirrored, from both sides.
fn normal_spaces() -> Scene {
    let mut scene = Scene::default();
    // A lean towards +X and +Y of the map's space, changing from texel to texel.
    let code = |k: usize| [(128 + (k * 37) % 90) as u8, (100 + (k * 53) % 100) as u8, (190 + (k * 29) % 65) as u8];
    let bytes: Vec<u8> = (0..16 * 12).flat_map(code).collect();
    let words = bytes.iter().map(|b| u16::from(*b) * 257).collect();
    let image = |pixels| Image::new(16, 12, 3, pixels, Encoding::Linear).expect("the sizes fit");
    let eight = scene.add_image(image(Pixels::U8(bytes)));
    let sixteen = scene.add_image(image(Pixels::U16(words)));
    scene.meshes.push(shape::torus(1.0, 24));
    let half = Mesh { corners: shape::sphere(0.9, 16).corners[..16 * 14 * 3 / 2].to_vec(), ..Mesh::default() };
    let mut bowl = shape::sphere(0.9, 16);
    bowl.uv[0].as_mut().expect("spheres have one").index.as_mut().expect("of its own").truncate(half.corners.len());
    scene.meshes.push(Mesh { corners: half.corners, ..bowl });
    for k in 0..8 {
        let material = scene.add_material(Material {
            model: if k % 2 == 0 { Model::BlinnPhong } else { Model::Pbr },
            roughness: 0.4,
            albedo: [0.6, 0.5, 0.45],
            double_sided: true,
            normal_map: Some(NormalMap {
                texture: Texture::new(if k % 4 < 2 { eight } else { sixteen }),
                scale: 1.3,
                y_down: k == 5,
                channels: 3,
            }),
            normal_space: [NormalSpace::Object, NormalSpace::World, NormalSpace::Tangent][k % 3],
            normal_zero: if k % 4 == 1 { NormalZero::Half } else { NormalZero::Exact },
            tbn_path: if k == 2 { TbnPath::Tangent } else { TbnPath::World },
            ..Default::default()
        });
        let stretch = [scale(1.0, 1.0, 1.0), scale(-1.0, 1.0, 1.0), scale(0.8, 1.6, 1.1), scale(1.0, -0.7, 1.3)][k % 4];
        let place = at((k % 4) as f32 * 1.15 - 1.7, 0.55 - 1.1 * (k / 4) as f32, 0.0);
        let transform = place.times(&leaning()).times(&stretch);
        scene.objects.push(Object { name: String::new(), mesh: k / 4, transform, materials: vec![material] });
    }
    look(&mut scene, [0.0, 0.6, 6.5], [0.0, 0.0, 0.0], 25.0);
    let light = Light::directional(Vec3::new(-2.0, 3.0, 4.0), Vec3::splat(0.0));
    scene.lights.push(Light { intensity: 2.0, shadow: None, ..light });
    scene
}
