//! Materials, textures, samplers and images.

use super::accessor::{Data, item};
use super::geometry;
use super::json::{self, TextureReference};
use super::{data_uri, file_uri};
use crate::error::{Error, Fault, Finding, Result};
use crate::image::Image;
use crate::load::{Findings, decode, files};
use crate::map::{Filter, Wrap};
use crate::scene::{Alpha, Channel, Material, Model, NormalMap, Scene, Texture};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// The materials, and the images that those of them need which are shown.
#[derive(Default)]
pub struct Plan {
    materials: Vec<Material>,
    /// Indices into the document's images. The textures of `materials` index this list.
    images: Vec<u32>,
}

struct Maker<'a> {
    document: &'a json::Document,
    geometry: &'a geometry::Plan,
    findings: &'a mut Findings,
    /// Document's image to index in `images`.
    known: BTreeMap<u32, usize>,
    images: Vec<u32>,
}

impl Plan {
    /// Translates every material; only those that are shown get textures.
    pub fn new(data: &Data<'_>, geometry: &geometry::Plan, findings: &mut Findings) -> Result<Plan> {
        let document = data.document;
        let shown = geometry.materials();
        let mut maker = Maker { document, geometry, findings, known: BTreeMap::new(), images: Vec::new() };
        data.context.reserve((document.materials.len() * size_of::<Material>()) as u64, "materials")?;
        let mut materials = Vec::with_capacity(document.materials.len() + 1);
        for (k, material) in (0u32..).zip(&document.materials) {
            let made = maker.material(material, shown.contains(&k));
            materials.push(made.map_err(|e| e.at(format!("/materials/{k}")))?);
        }
        if shown.contains(&(document.materials.len() as u32)) {
            materials.push(maker.material(&json::Material::default(), true)?);
        }
        Ok(Plan { materials, images: maker.images })
    }

    /// Decodes the images, in parallel. One that cannot be decoded is a finding.
    pub fn decode(&self, data: &Data<'_>) -> Result<Vec<(Option<Image>, Vec<Finding>)>> {
        let decode = |&index: &u32| -> Result<(Option<Image>, Vec<Finding>)> {
            let mut findings = Vec::new();
            match image(data, index, &mut findings) {
                Ok(image) => Ok((Some(image), findings)),
                Err(e) if matches!(e.fault, Fault::Memory | Fault::Interrupted) => Err(e),
                Err(e) => {
                    let code = if e.code.starts_with("file.") { "texture.missing" } else { "texture.unreadable" };
                    let finding = Finding::warning(code, e.message, "the surface is shown without it");
                    let finding = finding.at(format!("/images/{index}"));
                    findings.push(match e.file {
                        Some(file) => finding.in_file(file),
                        None => finding,
                    });
                    Ok((None, findings))
                }
            }
        };
        let all: Vec<Result<_>> = self.images.par_iter().map(decode).collect();
        all.into_iter().collect()
    }

    /// Moves materials and images into the scene. Textures without an image are dropped.
    pub fn finish(self, images: Vec<(Option<Image>, Vec<Finding>)>, scene: &mut Scene, findings: &mut Findings) {
        let mut places = Vec::with_capacity(images.len());
        for (image, of_image) in images {
            findings.extend(of_image);
            places.push(image.map(|image| {
                scene.images.push(Arc::new(image));
                scene.images.len() - 1
            }));
        }
        scene.materials = self.materials;
        for material in &mut scene.materials {
            let maps = [
                &mut material.albedo_map,
                &mut material.metallic_map,
                &mut material.roughness_map,
                &mut material.emissive_map,
                &mut material.occlusion_map,
                &mut material.specular_map,
                &mut material.specular_factor_map,
            ];
            for map in maps {
                *map = map.take().and_then(|t| Some(Texture { image: places[t.image]?, ..t }));
            }
            let normal = material.normal_map.take();
            material.normal_map = normal.and_then(|n| {
                let image = places[n.texture.image]?;
                Some(NormalMap { texture: Texture { image, ..n.texture }, ..n })
            });
        }
    }
}

impl Maker<'_> {
    fn material(&mut self, m: &json::Material, shown: bool) -> Result<Material> {
        let pbr = &m.pbr_metallic_roughness;
        let extensions = &m.extensions;
        let strength = extensions.emissive_strength.as_ref().map_or(1.0, |e| e.emissive_strength);
        let specular = extensions.specular.clone().unwrap_or_default();
        let [r, g, b, a] = pbr.base_color_factor;
        let mut material = Material {
            name: m.name.clone().unwrap_or_default(),
            model: if extensions.unlit.is_some() { Model::Unlit } else { Model::Pbr },
            albedo: [r, g, b],
            opacity: a,
            metallic: pbr.metallic_factor,
            roughness: pbr.roughness_factor,
            ior: extensions.ior.as_ref().map_or(1.5, |e| e.ior),
            specular_factor: specular.specular_factor,
            specular_color: specular.specular_color_factor,
            emissive: m.emissive_factor.map(|v| v * strength),
            alpha: match m.alpha_mode.as_deref() {
                Some("MASK") => Alpha::Mask(m.alpha_cutoff),
                Some("BLEND") => Alpha::Blend,
                _ => Alpha::Opaque,
            },
            double_sided: m.double_sided,
            ..Material::default()
        };
        let numbers = [
            &material.albedo[..],
            &[a, material.metallic, material.roughness, material.ior, material.specular_factor, m.alpha_cutoff],
            &material.specular_color,
            &material.emissive,
        ];
        if !numbers.iter().copied().flatten().all(|v| v.is_finite()) {
            return Err(Error::input("gltf.not-finite", "a number of the material is infinite"));
        }
        for v in [&mut material.metallic, &mut material.roughness, &mut material.specular_factor, &mut material.opacity]
        {
            *v = v.clamp(0.0, 1.0);
        }
        for v in material.albedo.iter_mut().chain(&mut material.specular_color).chain(&mut material.emissive) {
            *v = v.max(0.0);
        }
        if !shown {
            return Ok(material);
        }
        let with = |texture: Option<Texture>, channel| texture.map(|t| Texture { channel: Some(channel), ..t });
        let rough = self.texture(pbr.metallic_roughness_texture.as_ref())?;
        material.albedo_map = self.texture(pbr.base_color_texture.as_ref())?;
        material.roughness_map = with(rough.clone(), Channel::G);
        material.metallic_map = with(rough, Channel::B);
        material.emissive_map = self.texture(m.emissive_texture.as_ref())?;
        material.specular_factor_map = with(self.texture(specular.specular_texture.as_ref())?, Channel::A);
        material.specular_map = self.texture(specular.specular_color_texture.as_ref())?;
        if let Some(occlusion) = &m.occlusion_texture {
            material.occlusion_map = with(self.texture(Some(occlusion))?, Channel::R);
            material.occlusion_strength = finite(occlusion.strength)?.clamp(0.0, 1.0);
        }
        if let Some(normal) = &m.normal_texture {
            let scale = finite(normal.scale)?;
            material.normal_map =
                self.texture(Some(normal))?.map(|texture| NormalMap { texture, scale, y_down: false, channels: 3 });
        }
        Ok(material)
    }

    fn texture(&mut self, reference: Option<&TextureReference>) -> Result<Option<Texture>> {
        let Some(reference) = reference else { return Ok(None) };
        let document = self.document;
        let texture = item(&document.textures, "textures", reference.index)?;
        let source = texture.extensions.webp.as_ref().and_then(|w| w.source).or(texture.source);
        let Some(source) = source else {
            let finding = Finding::warning(
                "texture.missing",
                "the texture has no image in a format that is supported",
                "the surface is shown without it",
            );
            self.findings.push(finding.at(format!("/textures/{}", reference.index)));
            return Ok(None);
        };
        item(&document.images, "images", source)?;
        let images = &mut self.images;
        let image = *self.known.entry(source).or_insert_with(|| {
            images.push(source);
            images.len() - 1
        });
        let mut made = Texture::new(image);
        if let Some(sampler) = texture.sampler {
            let sampler = item(&document.samplers, "samplers", sampler)?;
            made.wrap = [wrap(sampler.wrap_s), wrap(sampler.wrap_t)];
            made.filter = filter(sampler);
        }
        let mut set = reference.tex_coord;
        if let Some(transform) = &reference.extensions.transform {
            set = transform.tex_coord.unwrap_or(set);
            for v in transform.offset.iter().chain(&transform.scale) {
                finite(*v)?;
            }
            made.offset = transform.offset;
            made.rotate = finite(transform.rotation)?.to_degrees();
            made.scale = transform.scale;
        }
        if set > 1 {
            let finding = Finding::warning(
                "gltf.uv-set",
                format!("the texture asks for TEXCOORD_{set}; sets 0 and 1 are supported"),
                "set 0 was used",
            );
            self.findings.push(finding.at(format!("/textures/{}", reference.index)));
            set = 0;
        } else if !self.geometry.has_uv(set) {
            let finding = Finding::warning(
                "gltf.uv-set",
                format!("the texture asks for TEXCOORD_{set}, which no shown primitive has"),
                "the texture shows its corner only",
            );
            self.findings.push(finding.at(format!("/textures/{}", reference.index)));
        }
        made.uv = set as u8;
        Ok(Some(made))
    }
}

fn finite(v: f32) -> Result<f32> {
    if v.is_finite() { Ok(v) } else { Err(Error::input("gltf.not-finite", "a number of the material is infinite")) }
}

fn wrap(code: u32) -> Wrap {
    match code {
        33071 => Wrap::Clamp,
        33648 => Wrap::Mirror,
        _ => Wrap::Repeat,
    }
}

/// OpenGL's filters. Pixel art (magnified by the nearest texel and not blended when minified) stays nearest;
/// without mip levels four texels of the finest level are blended.
fn filter(sampler: &json::Sampler) -> Filter {
    const NEAREST: u32 = 9728;
    const LINEAR: u32 = 9729;
    match (sampler.mag_filter, sampler.min_filter) {
        (Some(NEAREST), None | Some(NEAREST | 9984 | 9986)) => Filter::Nearest,
        (_, Some(LINEAR)) => Filter::Bilinear,
        (_, Some(9985)) => Filter::MipNearest,
        _ => Filter::Trilinear,
    }
}

fn image(data: &Data<'_>, index: u32, findings: &mut Vec<Finding>) -> Result<Image> {
    let job = data.context.job;
    job.check()?;
    let image = item(&data.document.images, "images", index)?;
    let named = |extra: String| Path::new(data.context.name).join(extra);
    let (decoded, more) = match (&image.uri, image.buffer_view) {
        (Some(uri), _) if uri.starts_with("data:") => {
            decode::image(&data_uri(uri, data.context)?, &named(format!("images/{index}")), job)?
        }
        (Some(uri), _) => {
            let (bytes, finding) = data.context.root.read_or_beside(&file_uri(uri)?, files::LIMIT, job)?;
            findings.extend(finding);
            decode::image(&bytes, &bytes.path, job)?
        }
        (None, Some(view)) => {
            let (blob, _) = data.view(view)?;
            let mut kept = None;
            decode::image(blob.bytes(job, &mut kept)?, &named(format!("images/{index}")), job)?
        }
        (None, None) => return Err(Error::input("gltf.image", "the image has neither an address nor a buffer view")),
    };
    // Held from here on: many images may be decoded from one small buffer.
    data.context.reserve(decoded.bytes(), "a picture")?;
    findings.extend(more.into_iter().map(|f| f.at(format!("/images/{index}"))));
    Ok(decoded)
}
