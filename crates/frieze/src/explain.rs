//! One pixel traced: why it has its colour.
//!
//! The renderer's own code runs at one lane with a probe that listens, so the colour here has the frame's bits.
//! Nothing is computed a second way: what is shown are the values that shading passed through.

use crate::error::Result;
use crate::image::Encoding;
use crate::map::shadow::ShadowTrace;
use crate::map::{Filter, Wrap};
use crate::math::lane::One;
use crate::math::vec::{Vec2, Vec3};
use crate::mesh::{Mesh, tangent};
use crate::prepare::Prepared;
use crate::raster::geometry::Class;
use crate::render::{Format, Piece, RenderOptions, Trace, trace};
use crate::scene::{
    Alpha, Background, LightKind, Material, Model, NormalSpace, Normals, Scene, Shading, TangentFrame, TbnPath,
    Texture, ToneMap,
};
use crate::shade::Note;
use serde::Serialize;
use std::collections::BTreeMap;

/// Why a pixel has its colour. Colours are linear RGB and directions are unit vectors in world space unless a
/// field says otherwise.
#[derive(Clone, Debug, Serialize)]
pub struct Explanation {
    /// Column from the left and row from the top, from 0.
    pub pixel: [u32; 2],
    /// Pixels of the picture.
    pub size: [u32; 2],
    /// Coverage samples per pixel that is averaged (MSAA).
    pub samples_per_pixel: u32,
    /// Pixels that are averaged, along each axis.
    pub supersample: u32,
    /// The eye, metres; for parallel rays where they begin.
    pub eye: [f32; 3],
    /// Whether nothing is seen but the background.
    pub background_only: bool,
    /// Every triangle that adds to the pixel: solid ones in the order of their sum, then layers.
    pub fragments: Vec<Fragment>,
    /// Every coverage sample.
    pub samples: Vec<Sample>,
    /// From the sum to the frame's number.
    pub color: Color,
}

/// Something of the scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Named {
    /// Its index in the scene.
    pub index: usize,
    /// Its name in the file, or empty.
    pub name: String,
}

/// A triangle in a pixel.
#[derive(Clone, Debug, Serialize)]
pub struct Fragment {
    /// The placed mesh.
    pub object: Named,
    /// Its shape.
    pub mesh: Named,
    /// Its material; null for the default material.
    pub material: Option<Named>,
    /// `blinn-phong`, `pbr` or `unlit`.
    pub model: &'static str,
    /// `flat`, `gouraud` or `phong`.
    pub shading: &'static str,
    /// Source triangle of the mesh.
    pub triangle: usize,
    /// The face that it is part of.
    pub face: usize,
    /// Whether its front is seen.
    pub front: bool,
    /// `solid`, `cut` (alpha mask) or `layer` (alpha blend).
    pub kind: &'static str,
    /// Coverage samples in which it is seen (a layer: in which nothing solid hides it).
    pub samples: u32,
    /// The same as a share of the pixel.
    pub share: f32,
    /// Where in the picture it is shaded, pixels from the left and from the top.
    pub place: [f32; 2],
    /// Perspective-correct weights of its corners.
    pub barycentric: [f32; 3],
    /// Metres along the camera's axis.
    pub depth: f32,
    /// World, metres.
    pub position: [f32; 3],
    /// Towards the eye.
    pub view: [f32; 3],
    /// Vertex colour, linear RGBA; 1 if there is none.
    pub vertex_color: [f32; 4],
    /// The maps that were asked, in order.
    pub maps: Vec<Lookup>,
    /// Albedo with its map and the vertex colour.
    pub albedo: [f32; 3],
    /// The normals.
    pub normal: Normal,
    /// What each light adds.
    pub lights: Vec<LightTerm>,
    /// Ambient light that is added, all factors included.
    pub ambient: [f32; 3],
    /// Diffuse and specular light that is reflected, all factors included: the rest of the sum.
    pub reflected: [f32; 3],
    /// Emitted light.
    pub emissive: [f32; 3],
    /// The sum.
    pub color: [f32; 3],
    /// Opacity with its maps and the vertex colour; only counts for `cut` and `layer`.
    pub alpha: f32,
    /// Below this alpha nothing is there; null unless `cut`.
    pub cutoff: Option<f32>,
}

/// What a map was asked and what it answered.
#[derive(Clone, Debug, Serialize)]
pub struct Lookup {
    /// What for: `albedo`, `normal`, ...
    pub slot: &'static str,
    /// Index of the image in the scene; null if it is not known.
    pub image: Option<usize>,
    /// Texels of the finest level.
    pub size: [u32; 2],
    /// Which UV set.
    pub uv_set: usize,
    /// Texture coordinates after the slot's transform, v down.
    pub uv: [f32; 2],
    /// How they change from one (supersampled) pixel to the next.
    pub footprint: Footprint,
    /// `nearest`, `trilinear`, ...
    pub filter: &'static str,
    /// `repeat`, `mirror`, `clamp` or `border`, along u and v.
    pub wrap: [&'static str; 2],
    /// log2 of the longer side of the footprint in texels of the finest level; below 0 the map is magnified.
    pub mip_level: f32,
    /// What was read.
    pub texels: Vec<Texel>,
    /// The answer, linear RGBA.
    pub value: [f32; 4],
}

/// Derivatives of texture coordinates, texture widths (heights) per pixel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Footprint {
    /// One pixel to the right.
    pub du_dx: f32,
    /// One pixel to the right.
    pub dv_dx: f32,
    /// One pixel down.
    pub du_dy: f32,
    /// One pixel down.
    pub dv_dy: f32,
}

/// A texel that was read.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Texel {
    /// Mip level, 0 the finest; null for a level of a ripmap that is none.
    pub level: Option<u32>,
    /// Texels of its level.
    pub size: [u32; 2],
    /// From the left.
    pub x: u32,
    /// From the top.
    pub y: u32,
    /// How much it counts. The weights of a texel that was read more than once are added up.
    pub weight: f32,
    /// Linear RGBA.
    pub value: [f32; 4],
}

/// The normals of a point.
#[derive(Clone, Debug, Serialize)]
pub struct Normal {
    /// Interpolated between the vertices, made of unit length, turned to the viewer.
    pub interpolated: [f32; 3],
    /// The frame that the map's normal is given in; null without a normal map.
    pub frame: Option<Frame>,
    /// The space of the normal map: `tangent`, `object` or `world`; null without one.
    pub map_space: Option<&'static str>,
    /// As the map says it, in that space; null without a normal map.
    pub mapped: Option<[f32; 3]>,
    /// What was shaded with; null where no normal per pixel was.
    pub shading: Option<[f32; 3]>,
    /// The space of `shading` and of the lights' directions: `world`, or `tangent` (the second way of document 001).
    pub space: &'static str,
}

/// A tangent frame, world space, as it was used: not always of unit length.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Frame {
    /// Towards +u.
    pub tangent: [f32; 3],
    /// Towards the top of the image.
    pub bitangent: [f32; 3],
    /// Away from the surface.
    pub normal: [f32; 3],
    /// What made the tangent: `file`, `mikktspace`, `average`, `per-triangle`, `from-normal` or `games101`.
    pub rule: &'static str,
    /// Why it is `from-normal` where the material asks for another rule: `no-uv` (the mesh has no such set); or why
    /// corners of this triangle alone may have it: `no-uv-area` (its texture coordinates say no direction).
    pub fallback: Option<&'static str>,
    /// Whether the bitangent is mirrored: the tangent's w is -1, in the object as it stands.
    pub mirrored: bool,
}

/// What a light adds.
#[derive(Clone, Debug, Serialize)]
pub struct LightTerm {
    /// The light.
    pub light: Named,
    /// `directional`, `point` or `spot`.
    pub kind: &'static str,
    /// Terms of the point; null where light is computed at vertices (`gouraud`) or centroids (`flat`).
    pub terms: Option<Terms>,
    /// Diffuse light: to be multiplied with the albedo.
    pub diffuse: [f32; 3],
    /// Specular light: to be multiplied with the specular reflectance (Blinn-Phong); with all factors (PBR).
    pub specular: [f32; 3],
    /// The shadow lookup; null if there was none.
    pub shadow: Option<Shadow>,
}

/// The terms of a light at a point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Terms {
    /// Towards the light, in the space of the shading normal.
    pub direction: [f32; 3],
    /// Cosine between normal and direction, not below 0.
    pub n_l: f32,
    /// Cosine between normal and half vector, not below 0.
    pub n_h: f32,
    /// Falloff, cone and range.
    pub attenuation: f32,
    /// The share that no occluder takes.
    pub visibility: f32,
}

/// A shadow lookup. Depths are the light's: 0 at its near plane, 1 at its far plane.
#[derive(Clone, Debug, Serialize)]
pub struct Shadow {
    /// Texels along each side of the map.
    pub size: u32,
    /// 0: one lookup; 1: 3x3; ...
    pub radius: u32,
    /// The point in the map, texels from the left and from the top.
    pub place: [f32; 2],
    /// Its depth.
    pub depth: f32,
    /// Taken from the depth before it is compared.
    pub bias: f32,
    /// The comparisons, row after row.
    pub taps: Vec<Tap>,
}

/// A comparison with a texel of a shadow map.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tap {
    /// Texels from the left.
    pub x: i64,
    /// Texels from the top.
    pub y: i64,
    /// Depth of what the light sees there.
    pub depth: f32,
    /// Whether light arrives.
    pub lit: bool,
}

/// A coverage sample.
#[derive(Clone, Debug, Serialize)]
pub struct Sample {
    /// In the pixel, 0 ..= 1 from its upper left corner.
    pub place: [f32; 2],
    /// Index of the solid fragment that it sees; null: none.
    pub fragment: Option<usize>,
    /// Reversed depth there: 1 at the near plane, 0 at the far plane or where nothing is.
    pub depth: f32,
    /// Indices of the layers in front, far to near.
    pub layers: Vec<usize>,
}

/// From the sum of the fragments to the number in the frame.
#[derive(Clone, Debug, Serialize)]
pub struct Color {
    /// Share of the pixel that is covered, layers by their alpha.
    pub coverage: f32,
    /// Mean of what covers it.
    pub light: [f32; 3],
    /// `none`, `aces`, `agx`, `reinhard` or `khronos-neutral`.
    pub tone_map: &'static str,
    /// `light` after the tone curve.
    pub tone_mapped: [f32; 3],
    /// Linear RGB of the background; null: transparent.
    pub background: Option<[f32; 3]>,
    /// Over the background without a tone curve: the RGBA of a float picture.
    pub linear: [f32; 4],
    /// `srgb` or `linear`: what the numbers of 8- and 16-bit pictures hold.
    pub encode: &'static str,
    /// `u8`, `u16` or `f32`.
    pub format: &'static str,
    /// RGBA of the frame, exactly.
    pub encoded: Encoded,
}

/// The numbers of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Encoded {
    /// 0 ..= 255.
    U8([u8; 4]),
    /// 0 ..= 65535.
    U16([u16; 4]),
    /// Linear light.
    F32([f32; 4]),
}

/// Explains pixel `x` (column from the left), `y` (row from the top) of the frame that
/// [`render`](crate::render()) makes of the same scene and options. Extra planes are left out.
///
/// # Errors
/// `explain.pixel` for a pixel outside of the picture; those of [`render`](crate::render()).
pub fn explain(scene: &Scene, options: &RenderOptions, x: u32, y: u32) -> Result<Explanation> {
    let prepared = Prepared::new(scene, &options.job)?;
    let mut all = pixels(scene, &prepared, options, &[(x, y)])?;
    Ok(all.remove(0))
}

/// [`explain`] for several pixels of a frame. `prepared` was made of `scene`.
///
/// # Errors
/// As [`explain`].
pub fn pixels(
    scene: &Scene,
    prepared: &Prepared,
    options: &RenderOptions,
    pixels: &[(u32, u32)],
) -> Result<Vec<Explanation>> {
    trace(prepared, options, pixels, |t| explanation(scene, prepared, options.format, &t))
}

fn explanation(scene: &Scene, prepared: &Prepared, format: Format, t: &Trace<'_>) -> Explanation {
    let output = prepared.output;
    let [r, g, b, coverage] = t.light;
    let encoded = match format {
        Format::U8 => Encoded::U8(bytemuck::pod_read_unaligned(&t.bytes)),
        Format::U16 => Encoded::U16(bytemuck::pod_read_unaligned(&t.bytes)),
        Format::F32 => Encoded::F32(bytemuck::pod_read_unaligned(&t.bytes)),
    };
    let samples = t.samples.iter().map(|s| Sample {
        place: s.place,
        fragment: s.solid,
        depth: s.depth,
        layers: s.layers.iter().map(|l| l.0).collect(),
    });
    Explanation {
        pixel: t.pixel,
        size: t.size,
        samples_per_pixel: t.view.target.samples,
        supersample: t.supersample,
        eye: t.view.eye.array(),
        background_only: t.pieces.is_empty(),
        fragments: t.pieces.iter().map(|p| fragment(scene, t, p)).collect(),
        samples: samples.collect(),
        color: Color {
            coverage,
            light: [r, g, b],
            tone_map: match output.tone_map {
                ToneMap::None => "none",
                ToneMap::Aces => "aces",
                ToneMap::Agx => "agx",
                ToneMap::Reinhard => "reinhard",
                ToneMap::KhronosNeutral => "khronos-neutral",
            },
            tone_mapped: t.toned,
            background: match output.background {
                Background::Color(c) => Some(c),
                Background::Transparent => None,
            },
            linear: bytemuck::pod_read_unaligned(&t.linear),
            encode: if output.encode == Encoding::Srgb { "srgb" } else { "linear" },
            format: match format {
                Format::U8 => "u8",
                Format::U16 => "u16",
                Format::F32 => "f32",
            },
            encoded,
        },
    }
}

fn fragment(scene: &Scene, t: &Trace<'_>, p: &Piece<'_>) -> Fragment {
    let object = &scene.objects[p.instance.object];
    let mesh = &scene.meshes[object.mesh];
    let material = scene.materials.get(p.material);
    let named = |index: usize, name: &str| Named { index, name: name.into() };
    let (mut maps, mut lights) = (Vec::new(), Vec::new());
    let (mut albedo, mut ambient, mut emissive) = (Vec3::default(), Vec3::default(), Vec3::default());
    let mut normal = Normal {
        interpolated: p.surface.normal.normalize().array(),
        frame: None,
        map_space: material.filter(|m| m.normal_map.is_some()).map(|m| match m.normal_space {
            NormalSpace::Tangent => "tangent",
            NormalSpace::Object => "object",
            NormalSpace::World => "world",
        }),
        mapped: None,
        shading: None,
        space: "world",
    };
    let light = |k: usize| {
        let l = &scene.lights[k];
        let kind = match l.kind {
            LightKind::Directional => "directional",
            LightKind::Point => "point",
            LightKind::Spot { .. } => "spot",
        };
        (named(k, &l.name), kind)
    };
    for note in &p.notes {
        match *note {
            Note::Tap { slot, set, uv, footprint, value } => {
                maps.extend(lookup(p, material, (slot, set), uv, footprint, value.array()));
            }
            Note::Albedo(c) => albedo = c,
            Note::Frame { tangent, bitangent, normal: n } => {
                let (rule, fallback) = material.map_or(("from-normal", None), |m| rule(mesh, m, p.triangle));
                normal.frame = Some(Frame {
                    tangent: tangent.array(),
                    bitangent: bitangent.array(),
                    normal: n.array(),
                    rule,
                    fallback,
                    // On back faces the whole frame is turned to the viewer.
                    mirrored: (n.cross(tangent).dot(bitangent) < 0.0) == p.front,
                });
                if material.is_some_and(|m| m.tbn_path == TbnPath::Tangent) {
                    normal.space = "tangent";
                }
            }
            Note::Normal { mapped, shading } => {
                // Unlit and map-less surfaces have none.
                normal.mapped = p.look.slot("normal").map(|_| mapped.array());
                normal.shading = Some(shading.array());
            }
            Note::Light { light: k, direction, n_l, n_h, attenuation, visibility, diffuse, specular } => {
                // What the shading asked: not for lights that cannot arrive.
                let asked = attenuation > 0.0 && (n_l > 0.0 || p.look.model == Model::BlinnPhong && n_h > 0.0);
                let (name, kind) = light(k);
                lights.push(LightTerm {
                    light: name,
                    kind,
                    terms: Some(Terms { direction: direction.array(), n_l, n_h, attenuation, visibility }),
                    diffuse: diffuse.array(),
                    specular: specular.array(),
                    shadow: t.lamps[k].shadow().filter(|_| asked).map(|map| {
                        let trace = map.traced(p.surface.position, p.surface.plane);
                        shadow(map.size, map.radius, &trace)
                    }),
                });
            }
            Note::Ambient(c) => ambient = c,
            Note::Emissive(c) => emissive = c,
            Note::Color(_) => {}
        }
    }
    for (k, lit) in p.early.iter().enumerate() {
        let (name, kind) = light(k);
        lights.push(LightTerm {
            light: name,
            kind,
            terms: None,
            diffuse: lit.diffuse.array(),
            specular: lit.specular.array(),
            shadow: None,
        });
    }
    let [r, g, b, _] = p.color;
    let color = Vec3::new(r, g, b);
    let all = t.samples.len() as f32;
    Fragment {
        object: named(p.instance.object, &object.name),
        mesh: named(object.mesh, &mesh.name),
        material: material.map(|m| named(p.material, &m.name)),
        model: match p.look.model {
            Model::BlinnPhong => "blinn-phong",
            Model::Pbr => "pbr",
            Model::Unlit => "unlit",
        },
        shading: match p.look.shading {
            Shading::Flat => "flat",
            Shading::Gouraud => "gouraud",
            Shading::Phong => "phong",
        },
        triangle: p.triangle,
        face: mesh.face_of(p.triangle),
        front: p.front,
        kind: match p.class {
            Class::Cut => "cut",
            Class::Layered => "layer",
            Class::Solid | Class::Hidden => "solid",
        },
        samples: p.samples,
        share: p.samples as f32 / all,
        place: p.place,
        barycentric: p.weights,
        depth: p.depth,
        position: p.surface.position.array(),
        view: p.surface.view.array(),
        vertex_color: p.surface.color.array(),
        maps,
        albedo: albedo.array(),
        normal,
        lights,
        ambient: ambient.array(),
        reflected: if p.look.model == Model::Unlit { color } else { color - ambient - emissive }.array(),
        emissive: emissive.array(),
        color: color.array(),
        alpha: p.alpha,
        cutoff: match p.look.alpha {
            Alpha::Mask(cutoff) => Some(cutoff),
            Alpha::Opaque | Alpha::Blend => None,
        },
    }
}

fn lookup(
    p: &Piece<'_>,
    material: Option<&Material>,
    (slot, set): (&'static str, usize),
    uv: Vec2,
    f: crate::map::Footprint<f32>,
    value: [f32; 4],
) -> Option<Lookup> {
    let map = &p.look.slot(slot)?.map;
    let mut taps = Vec::new();
    map.at_traced(uv, f, &mut taps);
    let mut texels: Vec<Texel> = Vec::new();
    let mut known: BTreeMap<_, usize> = BTreeMap::new();
    for t in taps {
        let at = *known.entry((t.size, t.level, t.y, t.x)).or_insert(texels.len());
        if at == texels.len() {
            let size = [t.size.0, t.size.1];
            texels.push(Texel { level: t.level, size, x: t.x, y: t.y, weight: 0.0, value: t.value });
        }
        texels[at].weight += t.weight;
    }
    let finest = map.pyramid.mips()[0];
    Some(Lookup {
        slot,
        image: material.and_then(|m| texture(m, slot)).map(|t| t.image),
        size: [finest.width, finest.height],
        uv_set: set,
        uv: uv.array(),
        footprint: Footprint { du_dx: f.dudx, dv_dx: f.dvdx, du_dy: f.dudy, dv_dy: f.dvdy },
        filter: match map.filter {
            Filter::Nearest => "nearest",
            Filter::Bilinear => "bilinear",
            Filter::Bicubic => "bicubic",
            Filter::MipNearest => "mip-nearest",
            Filter::Trilinear => "trilinear",
            Filter::Ripmap => "ripmap",
            Filter::Anisotropic { .. } => "anisotropic",
            Filter::Ewa { .. } => "ewa",
            Filter::Supersample { .. } => "supersample",
        },
        wrap: map.wrap.map(|w| match w {
            Wrap::Repeat => "repeat",
            Wrap::Mirror => "mirror",
            Wrap::Clamp => "clamp",
            Wrap::Border => "border",
        }),
        mip_level: map.level_of(One, f),
        texels,
        value,
    })
}

/// What made the tangents of a triangle, and why it was not what the material asks for.
fn rule(mesh: &Mesh, m: &Material, triangle: usize) -> (&'static str, Option<&'static str>) {
    let set = m.normal_map.as_ref().map_or(0, |n| usize::from(n.texture.uv.min(1)));
    let word = match m.tangent_frame {
        TangentFrame::FromNormal => return ("from-normal", None),
        TangentFrame::Games101 => return ("games101", None),
        TangentFrame::Mikktspace if mesh.tangents.is_some() && m.normals == Normals::File && mesh.normals.is_some() => {
            return ("file", None);
        }
        TangentFrame::Mikktspace => "mikktspace",
        TangentFrame::Average => "average",
        TangentFrame::PerTriangle => "per-triangle",
    };
    match &mesh.uv[set] {
        None => ("from-normal", Some("no-uv")),
        Some(uv) => (word, tangent::is_without_area(mesh, uv, triangle).then_some("no-uv-area")),
    }
}

/// The texture in the slot that a note names.
fn texture<'a>(m: &'a Material, slot: &str) -> Option<&'a Texture> {
    match slot {
        "albedo" => m.albedo_map.as_ref(),
        "alpha" => m.alpha_map.as_ref(),
        "normal" => m.normal_map.as_ref().map(|n| &n.texture),
        "ambient" => m.ambient_map.as_ref(),
        "specular" => m.specular_map.as_ref(),
        "emissive" => m.emissive_map.as_ref(),
        "specular-factor" => m.specular_factor_map.as_ref(),
        "shininess" => m.shininess_map.as_ref(),
        "metallic" => m.metallic_map.as_ref(),
        "roughness" => m.roughness_map.as_ref(),
        "occlusion" => m.occlusion_map.as_ref(),
        _ => None,
    }
}

fn shadow(size: u32, radius: u32, t: &ShadowTrace) -> Shadow {
    Shadow {
        size,
        radius,
        place: t.place,
        depth: t.depth,
        bias: t.bias,
        taps: t.taps.iter().map(|t| Tap { x: t.x, y: t.y, depth: t.depth, lit: t.lit }).collect(),
    }
}
