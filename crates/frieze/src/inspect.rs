//! What is in a scene or a picture: counts, bounds, texture coordinates, texel density, tangents, and which
//! way the green channel of a normal map points.

pub mod basis;
pub mod normal;

pub use normal::NormalReport;

use crate::error::{Finding, Result};
use crate::image::{Encoding, Image, Pixels};
use crate::job::Job;
use crate::mesh::Mesh;
use crate::scene::{Background, LightKind, Material, Model, Object, Projection, Scene, Texture};
use serde::Serialize;

/// What is in a scene.
#[derive(Clone, Debug, Serialize)]
pub struct SceneReport {
    /// Its name.
    pub name: String,
    /// Sums over all objects.
    pub totals: Totals,
    /// Smallest and largest world coordinates, metres; null when empty.
    pub bounds: Option<[[f32; 3]; 2]>,
    /// The shapes.
    pub meshes: Vec<MeshReport>,
    /// What stands where.
    pub objects: Vec<ObjectReport>,
    /// The materials.
    pub materials: Vec<MaterialReport>,
    /// The pictures.
    pub images: Vec<ImageReport>,
    /// The lights.
    pub lights: Vec<LightReport>,
    /// The cameras.
    pub cameras: Vec<CameraReport>,
    /// Pixels of a render that asks for no other size.
    pub size: [u32; 2],
    /// Whether the background is transparent.
    pub transparent: bool,
    /// What is odd.
    #[serde(skip)]
    pub findings: Vec<Finding>,
}

/// Sums over all objects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Totals {
    /// Triangles of all objects; a mesh that stands in two places counts twice.
    pub triangles: u64,
    /// Positions of all meshes.
    pub vertices: u64,
    /// Bytes of the meshes in memory.
    pub mesh_bytes: u64,
    /// Bytes of the pictures in memory, decoded.
    pub image_bytes: u64,
}

/// What is in a mesh.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeshReport {
    /// Its name in the file, or empty.
    pub name: String,
    /// Faces; more than triangles are polygons.
    pub faces: usize,
    /// Triangles.
    pub triangles: usize,
    /// Positions in the file.
    pub vertices: usize,
    /// Bytes in memory.
    pub bytes: u64,
    /// Triangles without area.
    pub degenerate: usize,
    /// Whether the file gives normals.
    pub normals: bool,
    /// Whether the file gives tangents.
    pub tangents: bool,
    /// Whether the file gives vertex colours.
    pub colors: bool,
    /// Both sets of texture coordinates.
    pub uv: [Option<UvReport>; 2],
}

/// What is in a set of texture coordinates.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UvReport {
    /// Smallest u and v.
    pub min: [f32; 2],
    /// Largest u and v.
    pub max: [f32; 2],
    /// Triangles with area in space and none in the texture: no tangent, one texel.
    pub degenerate: usize,
    /// Triangles that show the texture mirrored (their tangent frame is left-handed).
    pub mirrored: usize,
    /// Triangles that leave 0 to 1.
    pub outside: usize,
    /// Corners whose coordinates are no finite numbers.
    pub not_finite: usize,
}

/// What is in an object.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ObjectReport {
    /// Its name in the file, or empty.
    pub name: String,
    /// Index of its mesh.
    pub mesh: usize,
    /// Indices of its materials.
    pub materials: Vec<usize>,
    /// Whether its transform mirrors.
    pub mirrored: bool,
    /// Texels per metre of the first map of its materials; null without map or coordinates.
    pub texel_density: Option<Density>,
}

/// Texels per metre along one axis (the root of the ratio of areas).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Density {
    /// Of the triangle with the fewest.
    pub min: f32,
    /// Half of the area has fewer.
    pub median: f32,
    /// Of the triangle with the most.
    pub max: f32,
}

/// What is in a material.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MaterialReport {
    /// Its name in the file, or empty.
    pub name: String,
    /// `blinn-phong`, `pbr` or `unlit`.
    pub model: &'static str,
    /// The maps: what for, and the index of the picture.
    pub maps: Vec<(&'static str, usize)>,
}

/// What is in a picture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ImageReport {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Values per pixel.
    pub channels: usize,
    /// What a value is: `u8`, `u16`, `f16` or `f32`.
    pub kind: &'static str,
    /// `srgb` or `linear`.
    pub encoding: &'static str,
    /// Bytes in memory.
    pub bytes: u64,
    /// What materials use it for.
    pub used_as: Vec<&'static str>,
    /// What it holds if it is a tangent-space normal map.
    pub normal_map: Option<NormalReport>,
}

/// What is in a light.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LightReport {
    /// Its name in the file, or empty.
    pub name: String,
    /// `directional`, `point` or `spot`.
    pub kind: &'static str,
    /// Whether it casts shadows.
    pub shadow: bool,
}

/// What is in a camera.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CameraReport {
    /// Its name in the file, or empty.
    pub name: String,
    /// `perspective`, `orthographic` or `intrinsics`.
    pub projection: &'static str,
}

/// Looks at a scene.
///
/// # Errors
/// `job.interrupted`.
pub fn scene(scene: &Scene, job: &Job) -> Result<SceneReport> {
    let mut findings = Vec::new();
    let mut meshes = Vec::new();
    for (k, m) in scene.meshes.iter().enumerate() {
        job.check()?;
        job.progress("inspect", k as u64, scene.meshes.len() as u64);
        meshes.push(mesh(m, &mut findings));
    }
    let materials: Vec<MaterialReport> = scene
        .materials
        .iter()
        .map(|m| MaterialReport {
            name: m.name.clone(),
            model: match m.model {
                Model::BlinnPhong => "blinn-phong",
                Model::Pbr => "pbr",
                Model::Unlit => "unlit",
            },
            maps: maps(m).into_iter().map(|(name, t)| (name, t.image)).collect(),
        })
        .collect();
    let mut images = Vec::new();
    for (k, i) in scene.images.iter().enumerate() {
        job.check()?;
        let mut used_as: Vec<&'static str> =
            materials.iter().flat_map(|m| &m.maps).filter(|(_, i)| *i == k).map(|(name, _)| *name).collect();
        used_as.sort_unstable();
        used_as.dedup();
        let report = image(i, used_as, job)?;
        check_normal_map(scene, k, &report, &mut findings);
        images.push(report);
    }
    let mut objects = Vec::new();
    for o in &scene.objects {
        job.check()?;
        objects.push(object(scene, o, &mut findings));
    }
    let totals = Totals {
        triangles: scene.objects.iter().map(|o| scene.meshes[o.mesh].triangle_count() as u64).sum(),
        vertices: meshes.iter().map(|m| m.vertices as u64).sum(),
        mesh_bytes: meshes.iter().map(|m| m.bytes).sum(),
        image_bytes: images.iter().map(|i| i.bytes).sum(),
    };
    Ok(SceneReport {
        name: scene.name.clone(),
        totals,
        bounds: scene.bounds().map(|(lo, hi)| [lo.array(), hi.array()]),
        meshes,
        objects,
        materials,
        images,
        lights: scene
            .lights
            .iter()
            .map(|l| LightReport {
                name: l.name.clone(),
                kind: match l.kind {
                    LightKind::Directional => "directional",
                    LightKind::Point => "point",
                    LightKind::Spot { .. } => "spot",
                },
                shadow: l.shadow.is_some(),
            })
            .collect(),
        cameras: scene
            .cameras
            .iter()
            .map(|c| CameraReport {
                name: c.name.clone(),
                projection: match c.projection {
                    Projection::Perspective { .. } => "perspective",
                    Projection::Orthographic { .. } => "orthographic",
                    Projection::Intrinsics { .. } => "intrinsics",
                },
            })
            .collect(),
        size: scene.output.size,
        transparent: scene.output.background == Background::Transparent,
        findings,
    })
}

/// The maps of a material by the words of the scene file, without `_map`.
fn maps(m: &Material) -> Vec<(&'static str, &Texture)> {
    let plain = [
        ("albedo", &m.albedo_map),
        ("ambient", &m.ambient_map),
        ("specular", &m.specular_map),
        ("specular-factor", &m.specular_factor_map),
        ("shininess", &m.shininess_map),
        ("alpha", &m.alpha_map),
        ("metallic", &m.metallic_map),
        ("roughness", &m.roughness_map),
        ("emissive", &m.emissive_map),
        ("occlusion", &m.occlusion_map),
    ];
    let heights = [("bump", &m.bump_map), ("displacement", &m.displacement_map), ("parallax", &m.parallax_map)];
    plain
        .into_iter()
        .filter_map(|(name, t)| Some((name, t.as_ref()?)))
        .chain(m.normal_map.iter().map(|n| ("normal", &n.texture)))
        .chain(heights.into_iter().filter_map(|(name, h)| Some((name, &h.as_ref()?.texture))))
        .collect()
}

fn mesh(m: &Mesh, findings: &mut Vec<Finding>) -> MeshReport {
    let mut report = MeshReport {
        name: m.name.clone(),
        faces: m.face_count(),
        triangles: m.triangle_count(),
        vertices: m.positions.len(),
        bytes: m.bytes(),
        degenerate: 0,
        normals: m.normals.is_some(),
        tangents: m.tangents.is_some(),
        colors: m.colors.is_some(),
        uv: [None, None],
    };
    let areas: Vec<f64> = (0..m.triangle_count()).map(|t| area(m.triangle(t).map(|c| m.position(c)))).collect();
    report.degenerate = areas.iter().filter(|a| **a <= 0.0).count();
    let place = || format!("mesh {:?}", m.name);
    if report.degenerate > 0 {
        findings.push(
            Finding::note(
                "mesh.degenerate",
                format!("{} of {} triangles have no area", report.degenerate, report.triangles),
                "they are not drawn",
            )
            .at(place()),
        );
    }
    for set in 0..2 {
        report.uv[set] = uv(m, set, &areas);
        if let Some(uv) = report.uv[set].as_ref().filter(|uv| uv.degenerate > 0) {
            findings.push(
                Finding::note(
                    "uv.degenerate",
                    format!("{} triangles have no area in UV set {set}", uv.degenerate),
                    "each shows one line of the texture, and has no tangent of its own",
                )
                .at(place()),
            );
        }
    }
    report
}

fn uv(m: &Mesh, set: usize, areas: &[f64]) -> Option<UvReport> {
    let values = m.uv[set].as_ref()?;
    let mut r = UvReport {
        min: [f32::INFINITY; 2],
        max: [f32::NEG_INFINITY; 2],
        degenerate: 0,
        mirrored: 0,
        outside: 0,
        not_finite: 0,
    };
    for (t, area) in areas.iter().enumerate() {
        let corners = m.triangle(t).map(|c| values.at(m, c));
        let odd = corners.iter().filter(|c| !c.iter().all(|v| v.is_finite())).count();
        r.not_finite += odd;
        if odd > 0 {
            continue;
        }
        for k in 0..2 {
            for c in corners {
                r.min[k] = r.min[k].min(c[k]);
                r.max[k] = r.max[k].max(c[k]);
            }
        }
        let signed = signed_uv_area(corners);
        if signed == 0.0 && *area > 0.0 {
            r.degenerate += 1;
        }
        // v runs down, so a texture that is not mirrored has a negative area here.
        r.mirrored += usize::from(signed > 0.0);
        r.outside += usize::from(corners.iter().flatten().any(|v| !(0.0..=1.0).contains(v)));
    }
    if r.min[0] > r.max[0] {
        (r.min, r.max) = ([0.0; 2], [0.0; 2]);
    }
    Some(r)
}

fn signed_uv_area([a, b, c]: [[f32; 2]; 3]) -> f64 {
    let d = |p: [f32; 2], k: usize| f64::from(p[k]) - f64::from(a[k]);
    0.5 * (d(b, 0) * d(c, 1) - d(c, 0) * d(b, 1))
}

fn area([a, b, c]: [[f32; 3]; 3]) -> f64 {
    let d = |p: [f32; 3]| -> [f64; 3] { core::array::from_fn(|k| f64::from(p[k]) - f64::from(a[k])) };
    let (u, v) = (d(b), d(c));
    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    0.5 * (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt()
}

/// Whether a triangle of this area is a line or a point to within the rounding of its corners: nothing of it is drawn.
fn is_degenerate(area: f64, corners: [[f32; 3]; 3]) -> bool {
    let largest = corners.iter().flatten().fold(0.0, |m: f64, v| m.max(f64::from(v.abs())));
    let side = |a: [f32; 3], b: [f32; 3]| (0..3).map(|k| (f64::from(a[k]) - f64::from(b[k])).abs()).fold(0.0, f64::max);
    let [a, b, c] = corners;
    let longest = side(a, b).max(side(b, c)).max(side(c, a));
    // A few units in the last place of the largest coordinate are the least that its height can mean.
    2.0 * area <= longest * largest * 4.0 * f64::from(f32::EPSILON)
}

fn object(scene: &Scene, o: &Object, findings: &mut Vec<Finding>) -> ObjectReport {
    let m = &scene.meshes[o.mesh];
    let mut densities: Vec<(f32, f64)> = Vec::new();
    let mut missing: Option<&'static str> = None;
    // The map that says how dense texels are, for each slot: the first of the material.
    let slots: Vec<Option<(&'static str, &Texture)>> =
        o.materials.iter().map(|k| maps(&scene.materials[*k]).first().copied()).collect();
    for t in 0..m.triangle_count() {
        let slot = m.material_of(t).min(slots.len().saturating_sub(1));
        let Some((name, texture)) = slots.get(slot).copied().flatten() else { continue };
        let Some(uv) = m.uv.get(usize::from(texture.uv)).and_then(Option::as_ref) else {
            missing = Some(name);
            continue;
        };
        let corners = m.triangle(t);
        let places = corners.map(|c| o.transform.point(m.position(c).into()).array());
        let world = area(places);
        let image = &scene.images[texture.image];
        let texels = f64::from(image.width()) * f64::from(image.height());
        let scale = f64::from(texture.scale[0]) * f64::from(texture.scale[1]);
        let flat = (signed_uv_area(corners.map(|c| uv.at(m, c))) * scale * texels).abs();
        let density = (flat / world).sqrt() as f32;
        if density.is_finite() && density > 0.0 && !is_degenerate(world, places) {
            densities.push((density, world));
        }
    }
    if let Some(name) = missing {
        findings.push(
            Finding::warning(
                "uv.missing",
                format!("the material has an {name} map, and the mesh has no texture coordinates for it"),
                "every point shows the texel at (0, 0)",
            )
            .at(format!("object {:?}", o.name)),
        );
    }
    densities.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = densities.iter().map(|d| d.1).sum::<f64>() / 2.0;
    let mut below = 0.0;
    let median = densities.iter().find(|d| {
        below += d.1;
        below >= half
    });
    let texel_density = match (densities.first(), median, densities.last()) {
        (Some(min), Some(median), Some(max)) => Some(Density { min: min.0, median: median.0, max: max.0 }),
        _ => None,
    };
    ObjectReport {
        name: o.name.clone(),
        mesh: o.mesh,
        materials: o.materials.clone(),
        mirrored: o.transform.determinant3() < 0.0,
        texel_density,
    }
}

/// Looks at a picture. `used_as` says what for, as far as is known; `normal` makes it a normal map, and one
/// that looks like a normal map is taken for one when nothing is known.
///
/// # Errors
/// `job.interrupted`.
pub fn image(image: &Image, used_as: Vec<&'static str>, job: &Job) -> Result<ImageReport> {
    job.check()?;
    let known = used_as.contains(&"normal");
    let normal_map = if image.channels() >= 2 && (known || used_as.is_empty()) {
        Some(normal::normals(image, job)?).filter(|n| known || n.evidence.likeness >= normal::LIKE)
    } else {
        None
    };
    Ok(ImageReport {
        width: image.width(),
        height: image.height(),
        channels: image.channels(),
        kind: match image.pixels() {
            Pixels::U8(_) => "u8",
            Pixels::U16(_) => "u16",
            Pixels::F16(_) => "f16",
            Pixels::F32(_) => "f32",
        },
        encoding: match image.encoding {
            Encoding::Srgb => "srgb",
            Encoding::Linear => "linear",
        },
        bytes: image.bytes(),
        used_as,
        normal_map,
    })
}

/// Whether the materials read a normal map as it seems to be meant.
fn check_normal_map(scene: &Scene, k: usize, report: &ImageReport, findings: &mut Vec<Finding>) {
    let uses = scene.materials.iter().filter_map(|m| m.normal_map.as_ref()).filter(|n| n.texture.image == k);
    let Some(guess) = report.normal_map else { return };
    let place = format!("image {k}");
    if report.used_as == ["normal"] && guess.evidence.likeness < normal::ODD {
        findings.push(
            Finding::warning(
                "normal.odd",
                "the picture is used as a normal map and does not look like one",
                "its vectors are not of unit length, or point into the surface; is it a height map?",
            )
            .at(place.clone()),
        );
    }
    for n in uses {
        let says = if n.y_down { "down" } else { "up" };
        // Below, it is not worth a word.
        if guess.green != "unknown" && guess.green != says && guess.confidence >= 0.8 {
            findings.push(
                Finding::warning(
                    "normal.convention",
                    format!("the green of this normal map seems to point {}, it is read as {says}", guess.green),
                    format!("if bumps look like dents, set y = \"{}\" in a scene file", guess.green),
                )
                .at(place.clone()),
            );
            break;
        }
    }
    if guess.evidence.likeness >= normal::LIKE {
        findings.extend(normal::findings(&guess).into_iter().map(|f| f.at(place.clone())));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec::{Mat4, Vec3};
    use crate::mesh::Attribute;
    use crate::scene::NormalMap;

    /// Normals of a field of bumps, 8 bits; green up or down.
    fn bumps(up: bool) -> Image {
        let (w, h) = (64i32, 48i32);
        let height = |x: i32, y: i32| {
            let (dx, dy) = ((x % 16) as f32 - 8.0, (y % 16) as f32 - 8.0);
            (50.0 - dx * dx - dy * dy).max(0.0) * 0.05
        };
        let mut pixels = Vec::new();
        for y in 0..h {
            for x in 0..w {
                let p = (height(x + 1, y) - height(x - 1, y)) / 2.0;
                let q = (height(x, y + 1) - height(x, y - 1)) / 2.0;
                let n = Vec3::new(-p, if up { q } else { -q }, 1.0).normalize();
                pixels.extend(n.array().map(|v| ((v * 0.5 + 0.5) * 255.0 + 0.5) as u8));
            }
        }
        Image::new(w as u32, h as u32, 3, Pixels::U8(pixels), Encoding::Linear).unwrap()
    }

    #[test]
    fn green_is_told_by_integrability() {
        for (up, word) in [(true, "up"), (false, "down")] {
            let r = image(&bumps(up), Vec::new(), &Job::default()).unwrap().normal_map.unwrap();
            assert_eq!(r.green, word);
            assert!(r.confidence > 0.5 && r.length_error < 0.01, "{r:?}");
        }
        let flat = Image::new(8, 8, 3, Pixels::U8([128, 128, 255].repeat(64)), Encoding::Linear).unwrap();
        let r = image(&flat, Vec::new(), &Job::default()).unwrap().normal_map.unwrap();
        assert_eq!((r.green, r.confidence), ("unknown", 0.0));
        for v in [0, 128, 200, 255] {
            let grey = Image::new(8, 8, 3, Pixels::U8(vec![v; 192]), Encoding::Srgb).unwrap();
            assert_eq!(image(&grey, Vec::new(), &Job::default()).unwrap().normal_map, None);
        }
    }

    /// A square metre of two triangles, with a texture of 100 texels along it.
    fn square(uv: [[f32; 2]; 4]) -> Scene {
        let mesh = Mesh {
            positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
            corners: vec![0, 1, 2, 0, 2, 3],
            uv: [Some(Attribute::per_position(uv.to_vec())), None],
            ..Mesh::default()
        };
        let mut scene = Scene::default();
        let pixels = Pixels::U8(vec![255; 100 * 100]);
        let image = scene.add_image(Image::new(100, 100, 1, pixels, Encoding::Srgb).unwrap());
        let material = scene.add_material(Material { albedo_map: Some(Texture::new(image)), ..Material::default() });
        scene.add(mesh, Mat4::scale(Vec3::new(2.0, 2.0, 2.0)), material);
        scene
    }

    #[test]
    fn density_is_texels_per_world_metre() {
        let upright = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
        let r = scene(&square(upright), &Job::default()).unwrap();
        // 100 texels on 2 metres; exact in f64.
        assert_eq!(r.objects[0].texel_density, Some(Density { min: 50.0, median: 50.0, max: 50.0 }));
        let uv = r.meshes[0].uv[0].clone().unwrap();
        assert_eq!((uv.mirrored, uv.degenerate, uv.outside), (0, 0, 0));
        assert!(r.findings.is_empty());
        assert_eq!(r.totals.triangles, 2);
    }

    #[test]
    fn mirrored_degenerate_and_outside_coordinates_are_counted() {
        let mirrored = [[1.0, 1.0], [0.0, 1.0], [0.0, 0.0], [1.0, 0.0]];
        let of = |uv| scene(&square(uv), &Job::default()).unwrap();
        assert_eq!(of(mirrored).meshes[0].uv[0].clone().unwrap().mirrored, 2);
        let r = of([[0.5; 2]; 4]);
        assert_eq!(r.meshes[0].uv[0].clone().unwrap().degenerate, 2);
        assert_eq!(r.findings[0].code, "uv.degenerate");
        assert_eq!(r.objects[0].texel_density, None);
        let r = of([[0.0, 2.0], [1.0, 2.0], [1.0, 0.0], [0.0, 0.0]]);
        assert_eq!(r.meshes[0].uv[0].clone().unwrap().outside, 2);
        assert_eq!(of([[f32::NAN; 2]; 4]).meshes[0].uv[0].clone().unwrap().not_finite, 6);
    }

    #[test]
    fn missing_coordinates_and_wrong_conventions_are_findings() {
        let mut scene = square([[0.0; 2]; 4]);
        scene.meshes[0].uv = [None, None];
        let image = scene.add_image(bumps(false));
        scene.materials[0].normal_map =
            Some(NormalMap { texture: Texture::new(image), scale: 1.0, y_down: false, channels: 3 });
        let codes: Vec<_> = super::scene(&scene, &Job::default()).unwrap().findings.iter().map(|f| f.code).collect();
        assert_eq!(codes, ["normal.convention", "uv.missing"]);
        scene.materials[0].normal_map.as_mut().unwrap().y_down = true;
        let r = super::scene(&scene, &Job::default()).unwrap();
        assert_eq!(r.findings.iter().map(|f| f.code).collect::<Vec<_>>(), ["uv.missing"]);
    }
}
