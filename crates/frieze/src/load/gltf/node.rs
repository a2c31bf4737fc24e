//! Nodes, cameras and lights: where everything stands.

use super::accessor::{Data, item};
use super::json;
use crate::error::{Error, Finding, Result};
use crate::load::Findings;
use crate::math::vec::{Mat4, Vec3};
use crate::scene::{Camera, Falloff, Light, LightKind, Projection, Scene, Shadow};

/// A mesh of the document, placed.
pub struct Placed {
    /// The node.
    pub node: u32,
    /// Index into the document's meshes; in range.
    pub mesh: u32,
    /// To world.
    pub transform: Mat4,
}

fn not_finite(place: String) -> Error {
    Error::input("gltf.not-finite", "a number is infinite, or becomes so with the transforms above it").at(place)
}

/// Walks the default scene's nodes, parents first, children in order. Adds cameras and lights to `scene`.
pub fn walk(data: &Data<'_>, scene: &mut Scene, findings: &mut Findings) -> Result<Vec<Placed>> {
    let document = data.document;
    let mut placed = Vec::new();
    let mut seen = vec![false; document.nodes.len()];
    let mut stack: Vec<(u32, Mat4)> = roots(document, findings)?.iter().rev().map(|&r| (r, Mat4::IDENTITY)).collect();
    while let Some((index, above)) = stack.pop() {
        let node = item(&document.nodes, "nodes", index)?;
        let place = || format!("/nodes/{index}");
        if std::mem::replace(&mut seen[index as usize], true) {
            return Err(
                Error::input("gltf.node-twice", "the node is reached twice: nodes must form a tree").at(place())
            );
        }
        data.context.job.check()?;
        let transform = above.times(&local(node));
        if !transform.0.iter().flatten().all(|v| v.is_finite()) {
            return Err(not_finite(place()));
        }
        let name = || node.name.clone().unwrap_or_default();
        if let Some(mesh) = node.mesh {
            item(&document.meshes, "meshes", mesh).map_err(|e| e.at(place()))?;
            placed.push(Placed { node: index, mesh, transform });
        }
        if let Some(camera) = node.camera {
            let camera = item(&document.cameras, "cameras", camera).map_err(|e| e.at(place()))?;
            match self::camera(camera, &transform, name()) {
                Some(camera) => scene.cameras.push(camera),
                None => findings.push(
                    Finding::warning("gltf.camera-ignored", "the camera has no usable lens", "it was left out")
                        .at(format!("/cameras/{}", node.camera.unwrap_or_default())),
                ),
            }
        }
        if let Some(reference) = &node.extensions.light {
            let lights = &document.extensions.lights.lights;
            let light = item(lights, "extensions/KHR_lights_punctual/lights", reference.light);
            let light = self::light(light.map_err(|e| e.at(place()))?, &transform, name());
            match light {
                Some(light) => scene.lights.push(light),
                None => findings.push(
                    Finding::warning("gltf.light-ignored", "the light's kind or cone is unknown", "it was left out")
                        .at(format!("/extensions/KHR_lights_punctual/lights/{}", reference.light)),
                ),
            }
        }
        for &child in node.children.iter().rev() {
            stack.push((child, transform));
        }
        if stack.len() > document.nodes.len() {
            // Each node is a child once in a tree, so the list of those to come cannot be longer than all.
            return Err(Error::input("gltf.node-twice", "a node is a child twice: nodes must form a tree").at(place()));
        }
    }
    Ok(placed)
}

/// The nodes that the default scene begins with; without scenes, those that are no other's child.
fn roots(document: &json::Document, findings: &mut Findings) -> Result<Vec<u32>> {
    if document.scenes.is_empty() {
        let mut child = vec![false; document.nodes.len()];
        for &c in document.nodes.iter().flat_map(|n| &n.children) {
            if let Some(child) = child.get_mut(c as usize) {
                *child = true;
            }
        }
        return Ok((0u32..).zip(child).filter_map(|(k, child)| (!child).then_some(k)).collect());
    }
    let shown = document.scene.unwrap_or(0);
    let scene = item(&document.scenes, "scenes", shown).map_err(|e| e.at("/scene"))?;
    if document.scenes.len() > 1 {
        findings.push(
            Finding::note(
                "gltf.scenes",
                format!("the file has {} scenes", document.scenes.len()),
                format!("scene {shown} is shown"),
            )
            .at("/scenes"),
        );
    }
    if scene.nodes.len() > document.nodes.len() {
        return Err(Error::input("gltf.node-twice", "the scene names a node twice").at(format!("/scenes/{shown}")));
    }
    Ok(scene.nodes.clone())
}

fn local(node: &json::Node) -> Mat4 {
    if let Some(matrix) = &node.matrix {
        return Mat4::from_columns(**matrix);
    }
    Mat4::translation(node.translation.unwrap_or([0.0; 3]).into())
        .times(&Mat4::rotation(node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0])))
        .times(&Mat4::scale(node.scale.unwrap_or([1.0; 3]).into()))
}

/// The rigid part of a transform: axes made perpendicular and of unit length, -Z kept.
fn rigid(m: &Mat4) -> Mat4 {
    let z = m.column(2).xyz().normalize();
    let origin = m.column(3).xyz();
    if z.length2() <= 0.0 {
        return Mat4::translation(origin);
    }
    Mat4::look_at(origin, origin - z, m.column(1).xyz()).inverse().unwrap_or_else(|| Mat4::translation(origin))
}

fn camera(camera: &json::Camera, transform: &Mat4, node: String) -> Option<Camera> {
    let (projection, near, far) = match (camera.kind.as_str(), &camera.perspective, &camera.orthographic) {
        ("perspective", Some(p), _) if p.yfov > 0.0 && p.yfov < core::f32::consts::PI && p.znear > 0.0 => {
            (Projection::Perspective { fov_y: p.yfov.to_degrees() }, p.znear, p.zfar.unwrap_or(f32::INFINITY))
        }
        ("orthographic", _, Some(o)) if o.ymag.abs() > 0.0 && o.ymag.is_finite() && o.znear >= 0.0 => {
            (Projection::Orthographic { height: 2.0 * o.ymag.abs() }, o.znear, o.zfar)
        }
        _ => return None,
    };
    if !(near.is_finite() && far > near) {
        return None;
    }
    let transform = rigid(transform);
    let name = if node.is_empty() { camera.name.clone().unwrap_or_default() } else { node };
    Some(Camera { name, transform, target: Vec3::splat(0.0), projection, near, far })
}

/// KHR_lights_punctual. Intensities (lux, candela) pass as they are.
fn light(light: &json::Light, transform: &Mat4, node: String) -> Option<Light> {
    let kind = match (light.kind.as_str(), &light.spot) {
        ("directional", _) => LightKind::Directional,
        ("point", _) => LightKind::Point,
        ("spot", spot) => {
            let spot = spot.clone().unwrap_or_default();
            let (inner, outer) = (spot.inner_cone_angle.to_degrees(), spot.outer_cone_angle.to_degrees());
            // f32 holds pi/2 a little above 90 degrees.
            let outer = outer.min(90.0);
            if !(inner >= 0.0 && outer > 0.0 && inner <= outer) {
                return None;
            }
            LightKind::Spot { inner: inner.min(outer * 0.9999), outer }
        }
        _ => return None,
    };
    let numbers = [light.color[0], light.color[1], light.color[2], light.intensity];
    if !numbers.iter().all(|v| v.is_finite()) {
        return None;
    }
    let rigid = rigid(transform);
    let name = if node.is_empty() { light.name.clone().unwrap_or_default() } else { node };
    let directional = kind == LightKind::Directional;
    Some(Light {
        name,
        kind,
        position: rigid.column(3).xyz(),
        direction: -rigid.column(2).xyz(),
        color: light.color,
        intensity: light.intensity,
        falloff: if directional { Falloff::None } else { Falloff::InverseSquare },
        range: light.range.filter(|&r| r.is_finite() && r > 0.0 && !directional),
        shadow: (kind != LightKind::Point).then(Shadow::default),
    })
}

/// Gives cameras a target: the point on their axis that is nearest to the middle of the scene.
pub fn aim(scene: &mut Scene) {
    if scene.cameras.is_empty() {
        return;
    }
    let middle = scene.bounds().map_or(Vec3::splat(0.0), |(lo, hi)| lo * 0.5 + hi * 0.5);
    for camera in &mut scene.cameras {
        let forward = -camera.transform.column(2).xyz();
        let along = (middle - camera.eye()).dot(forward);
        let along = if along > camera.near { along } else { (2.0 * camera.near).max(1.0) };
        camera.target = camera.eye() + forward * along;
    }
}
