//! The built-in scenes, all made by code: `sample:NAME` at every door. Tests, benchmarks and docs share them.

mod frieze;
mod head;
mod noise;
mod stress;
mod texture;

use crate::math::exact;
use crate::math::vec::{Mat4, Vec3};
use crate::mesh::{Mesh, shape};
use crate::scene::{
    Ambient, Background, Bias, Camera, Falloff, Light, Material, Model, NormalMap, Object, Output, Scene, Shading,
    Shadow, ShadowFilter, Texture, ToneMap, View,
};

/// Every built-in scene with one line about it.
pub const NAMES: [(&str, &str); 11] = [
    ("frieze", "the showpiece: a carved stone relief with a gilded meander, in raking light"),
    ("teapot", "Newell's teapot from its Bezier patches, glazed, on a wooden table"),
    ("wall", "a brick wall that is one quad with a normal map"),
    ("mirrored-head", "a head whose halves share one normal map: half of the texture coordinates are mirrored"),
    ("cubes", "plane and cubes under one directional light with a shadow map"),
    ("ground", "a checkered plane to the horizon, to compare texture filters"),
    ("spheres", "materials: metals and dielectrics by roughness, and Blinn-Phong by shininess"),
    ("cup", "a cup four times: its ambient, diffuse and specular light apart, and their sum"),
    ("flat-gouraud-phong", "one sphere lit per triangle, per vertex and per pixel"),
    ("stress-250k", "251 392 triangles, normal-mapped, with a shadow map"),
    ("stress-5m", "4 982 784 triangles, normal-mapped, with a shadow map"),
];

/// The built-in scene of that name (without `sample:`); `None` when there is none.
pub fn scene(name: &str) -> Option<Scene> {
    scaled(name, 1.0)
}

/// [`scene`] with about `fraction` (0 .. 1) of its triangles and texels where that is what it is about: the stress
/// scenes, of the same structure. Other scenes stay as they are.
pub fn scaled(name: &str, fraction: f32) -> Option<Scene> {
    let side = fraction.clamp(1e-4, 1.0).sqrt();
    let cells = |n: usize| ((n as f32 * side).round() as usize).max(3);
    // Textures keep a power of two.
    let texels = (cells(2048) as u32).next_power_of_two() as usize;
    let scene = match name {
        "frieze" => frieze::scene(),
        "teapot" => teapot(),
        "wall" => wall(),
        "mirrored-head" => head::scene(),
        "cubes" => cubes(),
        "ground" => ground(),
        "spheres" => spheres(),
        "cup" => cup(),
        "flat-gouraud-phong" => shading(),
        "stress-250k" => stress::scene(cells(152), cells(50), cells(64), texels),
        "stress-5m" => stress::scene(cells(694), cells(224), cells(64), texels),
        _ => return None,
    };
    Some(Scene { name: name.into(), ..scene })
}

const UP: Vec3 = Vec3::new(0.0, 1.0, 0.0);
const ORIGIN: Vec3 = Vec3::new(0.0, 0.0, 0.0);

/// Rotation by degrees about an axis, counter-clockwise when it points at the viewer.
fn rotation(axis: Vec3, degrees: f64) -> Mat4 {
    let (s, c) = exact::sin_cos_f64(degrees.to_radians() * 0.5);
    let a = axis.normalize() * s as f32;
    Mat4::rotation([a.x, a.y, a.z, c as f32])
}

fn at(x: f32, y: f32, z: f32) -> Mat4 {
    Mat4::translation(Vec3::new(x, y, z))
}

fn view(scene: &mut Scene, eye: Vec3, target: Vec3, fov_y: f32) {
    scene.cameras.push(Camera::look_at(eye, target, UP, fov_y));
    scene.view = View::Camera(0);
}

/// Shows a mesh of the scene once more.
fn again(scene: &mut Scene, mesh: usize, transform: Mat4, material: usize) {
    let name = scene.meshes[mesh].name.clone();
    scene.objects.push(Object { name, mesh, transform, materials: vec![material] });
}

fn wood(scene: &mut Scene, uv_scale: f32) -> usize {
    let image = scene.add_image(texture::wood());
    scene.add_material(Material {
        name: "wood".into(),
        specular: [0.12; 3],
        shininess: 32.0,
        albedo_map: Some(Texture { scale: [uv_scale; 2], ..Texture::new(image) }),
        ..Default::default()
    })
}

fn teapot() -> Scene {
    let mut scene = Scene::default();
    let glaze = scene.add_material(Material {
        name: "glaze".into(),
        model: Model::Pbr,
        albedo: [0.62, 0.16, 0.07],
        roughness: 0.22,
        double_sided: true,
        ..Default::default()
    });
    let table = wood(&mut scene, 4.0);
    scene.add(shape::teapot(1.5, 96), rotation(UP, 20.0), glaze);
    scene.add(shape::plane(12.0, 1), rotation(UP, 65.0), table);
    view(&mut scene, Vec3::new(0.4, 2.1, 5.0), Vec3::new(0.1, 0.62, 0.0), 30.0);
    let key = Light::directional(Vec3::new(-3.0, 5.0, 3.0), ORIGIN);
    scene.lights.push(Light { color: [1.0, 0.93, 0.82], intensity: 2.6, ..key });
    let fill = Light::directional(Vec3::new(4.0, 2.0, 1.5), ORIGIN);
    scene.lights.push(Light { color: [0.7, 0.82, 1.0], intensity: 0.7, shadow: None, ..fill });
    scene.ambient.color = [0.10, 0.11, 0.13];
    scene.output = Output { tone_map: ToneMap::KhronosNeutral, ..Default::default() };
    scene
}

/// A plane that faces +Z, upright.
fn upright(size: f32) -> (Mesh, Mat4) {
    (shape::plane(size, 1), rotation(Vec3::new(1.0, 0.0, 0.0), 90.0))
}

/// Row 54.
fn wall() -> Scene {
    let mut scene = Scene::default();
    let (albedo, normal) = texture::bricks();
    let (albedo, normal) = (scene.add_image(albedo), scene.add_image(normal));
    let twice = |image| Texture { scale: [2.0; 2], ..Texture::new(image) };
    let brick = scene.add_material(Material {
        name: "brick".into(),
        specular: [0.06; 3],
        shininess: 16.0,
        albedo_map: Some(twice(albedo)),
        normal_map: Some(NormalMap { texture: twice(normal), scale: 1.0, y_down: false, channels: 3 }),
        ..Default::default()
    });
    let (mesh, turn) = upright(4.0);
    scene.add(mesh, turn, brick);
    view(&mut scene, Vec3::new(-0.9, 0.1, 2.3), Vec3::new(-0.05, 0.0, 0.0), 38.0);
    scene.lights.push(Light {
        color: [1.0, 0.94, 0.85],
        falloff: Falloff::InverseSquare,
        intensity: 2.4,
        ..Light::point(Vec3::new(-0.8, 1.2, 0.9))
    });
    scene.ambient.color = [0.10, 0.11, 0.14];
    scene
}

/// The scene of document 002 (rows 102 and 112), its light and frustum as given there; the map's border is lit.
fn cubes() -> Scene {
    let mut scene = Scene::default();
    let wood = wood(&mut scene, 1.0);
    let floor = scene.materials[wood].clone();
    let floor = scene.add_material(Material {
        name: "floor".into(),
        albedo_map: floor.albedo_map.as_ref().map(|t| Texture { scale: [25.0; 2], ..t.clone() }),
        ..floor
    });
    scene.add(shape::plane(50.0, 1), at(0.0, -0.5, 0.0), floor);
    let half = Mat4::scale(Vec3::splat(0.5));
    scene.add(shape::cube(2.0), at(0.0, 1.5, 0.0).times(&half), wood);
    again(&mut scene, 1, at(2.0, 0.0, 1.0).times(&half), wood);
    let turned = rotation(Vec3::new(1.0, 0.0, 1.0), 60.0).times(&Mat4::scale(Vec3::splat(0.25)));
    again(&mut scene, 1, at(-1.0, 0.0, 2.0).times(&turned), wood);
    view(&mut scene, Vec3::new(0.6, 2.3, 6.4), Vec3::new(0.4, 0.35, 0.0), 42.0);
    scene.lights.push(Light {
        intensity: 0.8,
        shadow: Some(Shadow {
            size: 1024,
            filter: ShadowFilter::Pcf { radius: 1 },
            bias: Bias::Value(0.005),
            near: Some(1.0),
            far: Some(7.5),
            extent: Some(10.0),
            ..Default::default()
        }),
        ..Light::directional(Vec3::new(-2.0, 4.0, -1.0), ORIGIN)
    });
    scene.ambient.color = [0.3; 3];
    scene
}

/// Rows 45 to 48.
fn ground() -> Scene {
    let mut scene = Scene::default();
    let image = scene.add_image(texture::checker(256, 8, 0.12, 0.9));
    let material = scene.add_material(Material {
        name: "checker".into(),
        model: Model::Unlit,
        double_sided: true,
        albedo_map: Some(Texture { scale: [100.0; 2], ..Texture::new(image) }),
        ..Default::default()
    });
    // 800 m of cells of 1 m, seen from eye height.
    scene.add(shape::plane(800.0, 1), rotation(UP, 18.0), material);
    view(&mut scene, Vec3::new(0.0, 1.6, 0.0), Vec3::new(0.0, 1.15, -4.0), 45.0);
    scene.output = Output { background: Background::Color([0.35, 0.52, 0.75]), ..Default::default() };
    scene
}

fn spheres() -> Scene {
    let mut scene = Scene::default();
    let columns = 6;
    scene.meshes.push(shape::sphere(0.9, 64));
    for row in 0..3 {
        for column in 0..columns {
            let t = column as f32 / (columns - 1) as f32;
            let pbr = Material { model: Model::Pbr, roughness: 0.08 + 0.92 * t, ..Default::default() };
            let material = match row {
                0 => Material { name: "metal".into(), albedo: [0.95, 0.64, 0.30], metallic: 1.0, ..pbr },
                1 => Material { name: "dielectric".into(), albedo: [0.10, 0.30, 0.55], ..pbr },
                _ => Material {
                    name: "blinn-phong".into(),
                    // Blinn-Phong does not divide by pi: a third of the albedo looks alike.
                    albedo: [0.09, 0.14, 0.07],
                    specular: [0.18; 3],
                    shininess: (512 >> (2 * column).min(9)) as f32,
                    ..Default::default()
                },
            };
            let material = scene.add_material(material);
            again(&mut scene, 0, at(column as f32 - 2.5, 1.0 - row as f32, 0.0), material);
        }
    }
    view(&mut scene, Vec3::new(0.0, 0.0, 9.0), ORIGIN, 24.0);
    for (position, color, intensity) in [
        (Vec3::new(-4.0, 5.0, 6.0), [1.0, 0.95, 0.88], 2.4),
        (Vec3::new(5.0, 1.0, 4.0), [0.75, 0.85, 1.0], 0.9),
        (Vec3::new(0.0, -4.0, 3.0), [1.0, 0.8, 0.7], 0.35),
    ] {
        scene.lights.push(Light { color, intensity, shadow: None, ..Light::directional(position, ORIGIN) });
    }
    scene.ambient.color = [0.06; 3];
    scene.output = Output {
        size: [1200, 640],
        background: Background::Color([0.02, 0.022, 0.026]),
        tone_map: ToneMap::KhronosNeutral,
        ..Default::default()
    };
    scene
}

/// A cup of 1 m height: outside, lip, inside, as one profile.
fn cup_mesh() -> Mesh {
    let mut profile = vec![[0.0, 0.0], [0.30, 0.0], [0.30, 0.0], [0.33, 0.015], [0.33, 0.05]];
    let belly = |t: f64| 0.33 + 0.14 * exact::sin_f64(t * std::f64::consts::FRAC_PI_2) as f32;
    profile.extend((1..=14).map(|k| [belly(f64::from(k) / 14.0), 0.05 + 0.93 * k as f32 / 14.0]));
    profile.extend([[0.465, 0.995], [0.455, 1.0], [0.445, 0.995], [0.44, 0.98]]);
    profile.extend((1..14).rev().map(|k| [belly(f64::from(k) / 14.0) - 0.03, 0.06 + 0.92 * k as f32 / 14.0]));
    profile.extend([[0.28, 0.07], [0.20, 0.05], [0.0, 0.045]]);
    Mesh { name: "cup".into(), ..shape::lathe(&profile, 64) }
}

/// Rows 5 to 8, apart and together.
fn cup() -> Scene {
    let mut scene = Scene::default();
    let (color, gloss) = ([0.75, 0.20, 0.12], [0.55; 3]);
    let base = Material { shininess: 48.0, double_sided: true, ..Default::default() };
    let black = [0.0; 3];
    scene.meshes.push(cup_mesh());
    scene.meshes.push(Mesh { name: "handle".into(), ..shape::torus(0.56, 48) });
    for (k, (name, ambient, albedo, specular)) in [
        ("ambient", color, black, black),
        ("diffuse", black, color, black),
        ("specular", black, black, gloss),
        ("sum", color, color, gloss),
    ]
    .into_iter()
    .enumerate()
    {
        let material = Material { name: name.into(), ambient: Some(ambient), albedo, specular, ..base.clone() };
        let material = scene.add_material(material);
        let x = (k as f32 - 1.5) * 1.45 - 0.1;
        again(&mut scene, 0, at(x, -0.5, 0.0), material);
        // The handle is a ring that stands upright, half of it inside the wall.
        let ring = rotation(Vec3::new(1.0, 0.0, 0.0), 90.0).times(&Mat4::scale(Vec3::new(1.0, 0.8, 1.0)));
        again(&mut scene, 1, at(x + 0.46, 0.05, 0.0).times(&ring), material);
    }
    view(&mut scene, Vec3::new(0.0, 1.9, 7.0), Vec3::new(0.05, 0.0, 0.0), 16.5);
    scene.lights.push(Light { shadow: None, ..Light::directional(Vec3::new(-2.5, 3.0, 3.0), ORIGIN) });
    scene.ambient = Ambient { color: [0.25; 3], per_light: false };
    scene.output =
        Output { size: [1280, 480], background: Background::Color([0.015, 0.016, 0.02]), ..Default::default() };
    scene
}

/// Rows 15 to 17.
fn shading() -> Scene {
    let mut scene = Scene::default();
    scene.meshes.push(shape::sphere(1.8, 20));
    for (k, (name, shading)) in
        [("flat", Shading::Flat), ("gouraud", Shading::Gouraud), ("phong", Shading::Phong)].into_iter().enumerate()
    {
        let material = scene.add_material(Material {
            name: name.into(),
            shading,
            albedo: [0.10, 0.32, 0.48],
            specular: [0.7; 3],
            shininess: 60.0,
            ..Default::default()
        });
        again(&mut scene, 0, at((k as f32 - 1.0) * 2.1, 0.0, 0.0), material);
    }
    view(&mut scene, Vec3::new(0.0, 0.5, 8.0), ORIGIN, 18.0);
    scene.lights.push(Light { shadow: None, ..Light::directional(Vec3::new(-2.0, 2.6, 4.0), ORIGIN) });
    scene.ambient.color = [0.12; 3];
    scene.output =
        Output { size: [1200, 440], background: Background::Color([0.02, 0.022, 0.026]), ..Default::default() };
    scene
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sample_is_whole_and_the_same_each_time() {
        for (name, line) in NAMES {
            let scene = scaled(name, 0.01).unwrap();
            assert_eq!(scene.name, name);
            assert!(!line.is_empty() && !scene.objects.is_empty() && !scene.cameras.is_empty(), "{name}");
            assert!(matches!(scene.view, View::Camera(0)), "{name}: the camera is fixed");
            for mesh in &scene.meshes {
                let count = mesh.positions.len() as u32;
                assert!(mesh.corners.iter().all(|&c| c < count), "{name}: {}", mesh.name);
                assert!(mesh.positions.iter().flatten().all(|x| x.is_finite()), "{name}: {}", mesh.name);
                assert!(mesh.triangle_count() > 0 && mesh.normals.is_some(), "{name}: {}", mesh.name);
                for c in 0..mesh.corners.len() {
                    let n = Vec3::from(mesh.normals.as_ref().unwrap().at(mesh, c));
                    assert!((n.length() - 1.0).abs() < 1e-5, "{name}: {}: {n:?}", mesh.name);
                    assert!(mesh.uv[0].as_ref().is_none_or(|a| a.at(mesh, c).iter().all(|x| x.is_finite())));
                    assert!(mesh.colors.as_ref().is_none_or(|a| a.at(mesh, c).iter().all(|x| x.is_finite())));
                }
            }
            for object in &scene.objects {
                assert!(object.mesh < scene.meshes.len());
                assert!(object.materials.iter().all(|&m| m < scene.materials.len()), "{name}");
            }
            for (texture, _) in scene.materials.iter().flat_map(Material::textures) {
                assert!(texture.image < scene.images.len(), "{name}");
            }
            assert_eq!(scaled(name, 0.01).unwrap(), scene, "{name}");
        }
        assert!(scene("frieze2").is_none());
    }

    #[test]
    fn row_112_cubes_is_the_scene_of_document_002() {
        let scene = scene("cubes").unwrap();
        let size = |k: usize| {
            let (lo, hi) = scene.meshes[scene.objects[k].mesh].bounds().unwrap();
            (Vec3::from(hi) - lo.into()) * scene.objects[k].transform.column(0).xyz().length()
        };
        let places = [[0.0, -0.5, 0.0], [0.0, 1.5, 0.0], [2.0, 0.0, 1.0], [-1.0, 0.0, 2.0]];
        let sizes = [[50.0, 0.0, 50.0], [1.0; 3], [1.0; 3], [0.5; 3]];
        assert_eq!(scene.objects.len(), 4);
        for (k, (place, wide)) in places.into_iter().zip(sizes).enumerate() {
            assert_eq!(scene.objects[k].transform.column(3).xyz().array(), place);
            // The turned cube's scale comes from a rounded rotation.
            assert!((size(k) - Vec3::from(wide)).length() < 1e-6, "{k}: {:?}", size(k));
        }
        // The small one is turned by 60 degrees about (1, 0, 1).
        let turned = scene.objects[3].transform.direction(Vec3::new(1.0, 0.0, 1.0));
        assert!((turned - Vec3::new(0.25, 0.0, 0.25)).length() < 1e-6, "{turned:?}");
        let cosine = scene.objects[3].transform.direction(UP).y / 0.25;
        assert!((cosine - 0.5).abs() < 1e-6, "{cosine}");
        // ortho(-10, 10, -10, 10, 1, 7.5), lookAt((-2, 4, -1), origin), 1024 x 1024, bias 0.005, 3x3.
        let (light, shadow) = (&scene.lights[0], scene.lights[0].shadow.as_ref().unwrap());
        assert_eq!(light.position.array(), [-2.0, 4.0, -1.0]);
        assert!((light.direction.normalize() + light.position.normalize()).length() < 1e-6);
        assert_eq!((shadow.size, shadow.near, shadow.far, shadow.extent), (1024, Some(1.0), Some(7.5), Some(10.0)));
        assert_eq!((shadow.bias, shadow.filter), (Bias::Value(0.005), ShadowFilter::Pcf { radius: 1 }));
    }

    #[test]
    fn stress_scenes_have_the_benchmarks_triangles_and_frames() {
        // Counts of the full scenes by their grids; structure by a small one.
        for (nu, nv, count) in [(152, 50, 251_392), (694, 224, 4_982_784)] {
            assert_eq!(16 * nu * nv * 2 + 64 * 64 * 2, count);
        }
        let scene = scaled("stress-250k", 0.04).unwrap();
        let mesh = &scene.meshes[0];
        let (n, t, uv) =
            (mesh.normals.as_ref().unwrap(), mesh.tangents.as_ref().unwrap(), mesh.uv[0].as_ref().unwrap());
        let mikk = crate::mesh::tangent::mikktspace(mesh, n, uv);
        let mut close = 0;
        for c in 0..mesh.corners.len() {
            let v = |a: [f32; 4]| Vec3::new(a[0], a[1], a[2]);
            let (a, b) = (t.at(mesh, c), mikk.at(mesh, c));
            assert_eq!(a[3], b[3]);
            close += usize::from(v(a).dot(v(b)) > 0.9);
        }
        // Central differences against MikkTSpace on a coarse mesh.
        assert!(close * 100 > mesh.corners.len() * 90, "{close} of {}", mesh.corners.len());
        // Front faces look outward: along the normals.
        for k in 0..mesh.triangle_count() {
            let [p, q, r] = mesh.triangle(k).map(|c| Vec3::from(mesh.position(c)));
            assert!((q - p).cross(r - p).dot(n.at(mesh, 3 * k).into()) > 0.0, "{k}");
        }
    }

    #[test]
    fn row_53_green_is_up_at_the_top_edge_of_a_brick() {
        let (_, map) = texture::bricks();
        // Rows of texels where bricks begin (top edges) are greener than flat, where they end less.
        let mean = |rows: std::ops::Range<u32>| {
            let n = rows.len() as f32 * 1024.0;
            rows.flat_map(|y| (0..1024).map(move |x| (x, y))).map(|(x, y)| map.value(x, y, 1)).sum::<f32>() / n
        };
        assert!(mean(256 + 3..256 + 10) > 0.55 && mean(256 - 10..256 - 3) < 0.45);
    }
}
