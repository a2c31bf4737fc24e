//! The one shading definition: surface + maps + lights -> colour.
//!
//! Everything here is written once over [`Lane`]: a renderer calls it for a batch of pixels, `explain` for a
//! single one with a [`Probe`] that listens. Features are branches on the [`Look`], the same for the whole
//! batch; lanes never branch on their own. Sums run over the lights in their order.
//!
//! Units. Colours are linear RGB. Blinn-Phong follows rows 5 to 14: a light of colour and intensity 1 makes
//! a white diffuse surface that faces it 1 (there is no 1/pi). PBR follows glTF and its viewers: lights give
//! irradiance (directional: lux-like, point and spot: intensity / d²), the diffuse BRDF is albedo / pi, so the
//! same light makes a white PBR surface 1/pi; default rigs are about pi times stronger for it.

pub mod brdf;
pub mod lamp;
pub mod probe;
pub mod shader;
pub mod surface;

pub use lamp::{Lamp, Lights};
pub use probe::{Note, Probe, Silent};
pub use surface::{Lit, Look, Slot, Surface};

use crate::math::lane::Lane;
use crate::math::vec::{Vec3, Vec4};
use crate::scene::{Alpha, Model};

/// The light that leaves a surface towards the eye, linear RGB, and its alpha, before any tone curve.
/// Alpha is 1 unless the material blends. Lanes that are not active hold anything.
#[inline(always)]
pub fn shade<L: Lane, P: Probe<L>>(
    l: L,
    look: &Look,
    lights: &Lights<'_>,
    s: &Surface<L>,
    probe: &mut P,
) -> Vec4<L::F> {
    let [texel, normal] = match look.texels(l, s, probe) {
        Some([a, n]) => [Some(a), Some(n)],
        None => [None, None],
    };
    let (albedo, alpha) = look.albedo(l, s, texel, probe);
    let alpha = match look.alpha {
        Alpha::Blend => alpha * look.alpha_factor(l, s, probe),
        Alpha::Opaque | Alpha::Mask(_) => l.f(1.0),
    };
    let color = match look.model {
        Model::Unlit => albedo,
        Model::BlinnPhong => brdf::blinn_phong(l, look, lights, s, albedo, normal, probe),
        // Entered, not inlined: two models in one function take minutes to compile.
        Model::Pbr => l.enter(
            #[inline(always)]
            || brdf::pbr(l, look, lights, s, albedo, normal, probe),
        ),
    };
    color.extend(alpha)
}

/// The alpha of a surface, whatever the material does with it: opacity, maps and vertex colour. Asks no other
/// map.
#[inline(always)]
pub fn alpha<L: Lane>(l: L, look: &Look, s: &Surface<L>) -> L::F {
    let (_, alpha) = look.albedo(l, s, None, &mut Silent);
    alpha * look.alpha_factor(l, s, &mut Silent)
}

/// The light at a vertex (Gouraud, row 16) or at a triangle's centroid (flat, row 15), shadows included,
/// without any albedo: what [`Surface::lit`] takes, interpolated. `normal` need not be of unit length,
/// `view` points to the eye and is.
///
/// Maps cannot be asked at a vertex, so exponent (Blinn-Phong), roughness, metalness and the reflectance at
/// normal incidence (PBR) are the material's factors.
#[inline(always)]
pub fn light_vertex<L: Lane>(
    l: L,
    look: &Look,
    lights: &Lights<'_>,
    position: Vec3<L::F>,
    normal: Vec3<L::F>,
    view: Vec3<L::F>,
    active: L::M,
) -> Lit<L> {
    let n = normal.normalize();
    let at = brdf::Place { position, view, normal: n, geometric: n, active, turn: None };
    match look.model {
        Model::Unlit => Lit::dark(l),
        Model::BlinnPhong => brdf::light_blinn_phong(l, lights, &at, l.f(look.shininess), look.exponent, &mut Silent),
        Model::Pbr => {
            let m = brdf::Metal::of_factors(l, look);
            brdf::light_pbr(l, lights, &at, &m, &mut Silent)
        }
    }
}

/// The unit normal that a surface is shaded with, world space, normal map included.
#[inline(always)]
pub fn shading_normal<L: Lane>(l: L, look: &Look, s: &Surface<L>) -> Vec3<L::F> {
    let facing = look.facing(l, s, None, &mut Silent);
    match facing.turn {
        None => facing.normal,
        Some([t, b, n]) => t * facing.normal.x + b * facing.normal.y + n * facing.normal.z,
    }
}

#[cfg(test)]
mod tests {
    use super::probe::Recorder;
    use super::*;
    use crate::image::pyramid::Pyramid;
    use crate::image::{Encoding, Image, Pixels};
    use crate::map::{Filter, Footprint, Map};
    use crate::math::lane::One;
    use crate::math::vec::{Mat4, Vec2};
    use crate::scene::{Falloff, Light, LightKind, Material, NormalMap, Shading, TangentFrame, TbnPath, Texture};
    use core::f32::consts::PI;
    use std::slice;
    use std::sync::Arc;

    const Z: Vec3 = Vec3::new(0.0, 0.0, 1.0);

    fn at<L: Lane>(l: L, normal: Vec3, view: Vec3) -> Surface<L> {
        let up = |v: Vec3| v.lift(l.f(0.0));
        let zero = l.f(0.0);
        let none = Footprint { dudx: zero, dvdx: zero, dudy: zero, dvdy: zero };
        Surface {
            active: l.mask(u32::MAX),
            position: up(Vec3::default()),
            view: up(view.normalize()),
            normal: up(normal),
            plane: up(normal.normalize()),
            tangent: up(Vec3::new(1.0, 0.0, 0.0)),
            sign: l.f(1.0),
            object: [Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 0.0, 1.0)],
            uv: [Vec2::splat(l.f(0.25)); 2],
            footprint: [none; 2],
            color: Vec4::splat(l.f(1.0)),
            lit: None,
        }
    }
    /// A map of one texel.
    fn texel(rgba: [f32; 4]) -> Map {
        let image = Image::new(1, 1, 4, Pixels::F32(rgba.to_vec()), Encoding::Linear).unwrap();
        Map { pyramid: Arc::new(Pyramid::new(&image, false)), filter: Filter::Bilinear, wrap: Default::default() }
    }
    /// The look of a material whose texture k is one texel of `texels[k]`.
    fn look(material: &Material, texels: &[[f32; 4]]) -> Look {
        Look::new(material, |t, _| texel(texels[t.image]))
    }
    fn sun(towards: Vec3) -> Lamp {
        Lamp::new(&Light::directional(towards, Vec3::default()), None)
    }
    fn bulb(position: Vec3) -> Lamp {
        Lamp::new(&Light { falloff: Falloff::InverseSquare, ..Light::point(position) }, None)
    }
    fn dark() -> Material {
        Material { specular: [0.0; 3], ..Material::default() }
    }
    fn color(m: &Material, texels: &[[f32; 4]], lamps: &[Lamp], ambient: f32, s: &Surface<One>) -> Vec3 {
        let lights = Lights { lamps, ambient: [ambient; 3], per_light: false };
        shade(One, &look(m, texels), &lights, s, &mut Silent).xyz()
    }
    fn near(a: f32, b: f32, tolerance: f32) {
        assert!((a - b).abs() <= tolerance, "{a} {b}");
    }
    fn all_near(a: Vec3, b: Vec3, tolerance: f32) {
        assert!((a - b).map(f32::abs).array().iter().all(|d| *d <= tolerance), "{a:?} {b:?}");
    }

    #[test]
    fn row_4_the_texel_multiplies_the_diffuse_term_only() {
        let m = Material { ambient: Some([0.3; 3]), albedo_map: Some(Texture::new(0)), ..Material::default() };
        let towards = Vec3::new(0.3, 0.2, 1.0);
        let lamps = [sun(towards)];
        let with = |t: f32| color(&m, &[[t, t, t, 1.0]], &lamps, 0.5, &at(One, Z, Z)).x;
        let (none, once, twice) = (with(0.0), with(0.25), with(0.5));
        let n_l = towards.normalize().z;
        // Sums of three terms below 2.
        near(once - none, 0.25 * n_l, 1e-6);
        near(twice - none, 0.5 * n_l, 1e-6);
        // Under a black texel there is ambient light, 0.3 of 0.5, and the highlight as it is without a texture.
        let highlight =
            color(&Material { albedo: [0.0; 3], ..Material::default() }, &[], &lamps, 0.0, &at(One, Z, Z)).x;
        assert!(highlight > 0.1, "{highlight}");
        near(none, 0.15 + highlight, 1e-6);
    }

    #[test]
    fn row_5_lambert() {
        let m = dark();
        let s = at(One, Z, Z);
        assert_eq!(color(&m, &[], &[sun(Vec3::new(0.1, 0.0, -1.0))], 0.0, &s), Vec3::default());
        let lit = |r: f32, view: Vec3| color(&m, &[], &[bulb(Vec3::new(0.6, 0.0, 0.8) * r)], 0.0, &at(One, Z, view)).x;
        near(lit(1.0, Z), 0.8, 1e-6);
        near(lit(2.0, Z), lit(1.0, Z) / 4.0, 1e-7);
        assert_eq!(lit(2.0, Z), lit(2.0, Vec3::new(0.9, 0.1, 0.2)));
    }

    #[test]
    fn row_6_the_highlight_is_largest_where_n_is_h() {
        let m = Material { albedo: [0.0; 3], specular: [0.7; 3], shininess: 50.0, ..Material::default() };
        let l = Vec3::new(0.5, 0.3, 1.0).normalize();
        let v = Vec3::new(-0.4, 0.2, 1.0).normalize();
        let h = (l + v).normalize();
        let value = |n: Vec3| color(&m, &[], &[bulb(l * 2.0)], 0.0, &at(One, n, v)).x;
        // ks I / r²; the cosine of 1 is rounded and raised to 50.
        near(value(h), 0.7 / 4.0, 1e-5);
        for k in 0..40 {
            let n = (h + Vec3::new((k % 7) as f32 - 3.0, (k % 5) as f32 - 2.0, 0.3) * 0.1).normalize();
            assert!((0.0..=0.175001).contains(&value(n)) && value(n) <= value(h) + 1e-6);
        }
    }

    #[test]
    fn row_7_ambient_does_not_depend_on_view_or_light() {
        let m = Material { albedo: [0.5, 0.25, 1.0], ..dark() };
        let want = Vec3::new(0.1, 0.05, 0.2);
        for v in [Z, Vec3::new(1.0, 0.0, 0.1)] {
            // Behind the surface: only ambient light is left.
            for l in [Vec3::new(0.0, 0.0, -1.0), Vec3::new(1.0, 0.0, -5.0)] {
                all_near(color(&m, &[], &[sun(l)], 0.2, &at(One, Z, v)), want, 1e-7);
            }
        }
        let own = Material { ambient: Some([1.0, 0.0, 0.0]), ..m };
        all_near(color(&own, &[], &[], 0.2, &at(One, Z, Z)), Vec3::new(0.2, 0.0, 0.0), 1e-7);
    }

    #[test]
    fn row_8_the_sum_is_the_closed_form() {
        let m = Material { albedo: [0.8, 0.5, 0.3], specular: [0.3; 3], shininess: 32.0, ..Material::default() };
        let (p, v) = (Vec3::new(1.0, -2.0, 3.0), Vec3::new(0.2, 0.4, 0.9));
        let got = color(&m, &[], &[bulb(p)], 0.12, &at(One, Z * 3.0, v));
        let unit = |v: Vec3| {
            let v = v.map(f64::from);
            v.map(|c| c / (v.x * v.x + v.y * v.y + v.z * v.z).sqrt())
        };
        let (l, v) = (unit(p), unit(v));
        let h = l.zip(v, |a, b| a + b);
        let n_h = h.z / (h.x * h.x + h.y * h.y + h.z * h.z).sqrt();
        let lobe = (0..5).fold(n_h, |x, _| x * x);
        for (got, kd) in got.array().iter().zip(m.albedo) {
            let want = 0.12 * f64::from(kd) + (f64::from(kd) * l.z + 0.3 * lobe) / 14.0;
            // A dozen roundings of values below 1.
            near(*got, want as f32, 1e-6);
        }
    }

    #[test]
    fn row_10_highlights_shrink_as_the_exponent_grows() {
        let mut last = f32::INFINITY;
        for p in [1.0, 2.0, 4.0, 10.0, 31.5, 100.0, 150.0, 1000.0] {
            let m = Material { albedo: [0.0; 3], specular: [1.0; 3], shininess: p, ..Material::default() };
            let radius = (0..900).find(|k| {
                let (s, c) = crate::math::exact::sin_cos_f64(f64::from(*k) / 900.0 * 1.5);
                let n = Vec3::new(s as f32, 0.0, c as f32);
                color(&m, &[], &[sun(Z)], 0.0, &at(One, n, Z)).x < 0.5
            });
            let radius = radius.unwrap_or(900) as f32;
            assert!(radius < last, "{p}");
            last = radius;
        }
    }

    #[test]
    fn row_11_turning_about_the_normal_changes_nothing() {
        let m = Material::default();
        let (n, l, v) = (Z, Vec3::new(0.5, 0.1, 0.8), Vec3::new(-0.2, 0.6, 0.9));
        let want = color(&m, &[], &[sun(l)], 0.1, &at(One, n, v));
        let pbr = Material { model: Model::Pbr, ..m.clone() };
        let want_pbr = color(&pbr, &[], &[sun(l)], 0.1, &at(One, n, v));
        for k in 1..8 {
            let turn = Mat4::rotation([0.0, 0.0, k as f32 * 0.3, 1.0]);
            let s = at(One, n, turn.direction(v));
            // The row's own bound.
            all_near(color(&m, &[], &[sun(turn.direction(l))], 0.1, &s), want, 1e-6);
            all_near(color(&pbr, &[], &[sun(turn.direction(l))], 0.1, &s), want_pbr, 1e-6);
        }
    }

    #[test]
    fn row_12_and_13_lights_add_up_and_ambient_is_counted_once_or_per_light() {
        let (a, b) = (sun(Vec3::new(1.0, 0.2, 1.0)), bulb(Vec3::new(-1.0, 1.0, 2.0)));
        let s = at(One, Z, Z);
        for model in [Model::BlinnPhong, Model::Pbr] {
            let m = Material { model, ..Material::default() };
            let one = color(&m, &[], slice::from_ref(&a), 0.0, &s) + color(&m, &[], slice::from_ref(&b), 0.0, &s);
            all_near(color(&m, &[], &[a.clone(), b.clone()], 0.0, &s), one, 1e-6);
            let lamps = [a.clone(), b.clone(), a.clone()];
            let with = |per_light| {
                let lights = Lights { lamps: &lamps, ambient: [0.05; 3], per_light };
                shade(One, &look(&m, &[]), &lights, &s, &mut Silent).xyz()
            };
            let ambient = color(&m, &[], &[], 0.05, &s);
            all_near(with(true), with(false) + ambient * 2.0, 1e-6);
        }
    }

    #[test]
    fn row_14_in_shadow_only_ambient_light_is_left() {
        for model in [Model::BlinnPhong, Model::Pbr] {
            let m = Material { model, ..Material::default() };
            let s = at(One, Z, Z);
            let with = |v: f32| {
                let mut lamp = sun(Z);
                lamp.fixed = Some(v);
                color(&m, &[], &[lamp], 0.3, &s)
            };
            assert_eq!(with(0.0), color(&m, &[], &[], 0.3, &s));
            let (lit, half) = (with(1.0), with(0.5));
            all_near(half * 2.0, lit + with(0.0), 1e-6);
            assert!(lit.x > with(0.0).x + 0.1);
        }
    }

    #[test]
    fn row_15_flat_shading_is_one_colour_per_triangle() {
        let m = Material { shading: Shading::Flat, ..Material::default() };
        let look = look(&m, &[]);
        assert!(look.needs_lit() && !look.needs_tangent());
        let lamps = [bulb(Vec3::new(0.3, 0.4, 0.5))];
        let lights = Lights { lamps: &lamps, ambient: [0.1; 3], per_light: false };
        let lit = light_vertex(One, &look, &lights, Vec3::default(), Z * 2.0, Z, true);
        let mut all = vec![];
        for p in [Vec3::default(), Vec3::new(0.3, 0.1, 0.0), Vec3::new(-0.2, 0.4, 0.0)] {
            // Fragments differ in everything but the light.
            let s = Surface { position: p, lit: Some(lit), ..at(One, Z + p, Z + p) };
            all.push(shade(One, &look, &lights, &s, &mut Silent));
        }
        assert!(all[0] == all[1] && all[1] == all[2]);
    }

    #[test]
    fn row_16_and_17_gouraud_meets_phong_at_vertices_and_loses_the_highlight_between() {
        for model in [Model::BlinnPhong, Model::Pbr] {
            let phong = Material { model, shininess: 100.0, roughness: 0.3, ..Material::default() };
            let gouraud = Material { shading: Shading::Gouraud, ..phong.clone() };
            let (phong, gouraud) = (look(&phong, &[]), look(&gouraud, &[]));
            let lamps = [sun(Z)];
            let lights = Lights { lamps: &lamps, ambient: [0.1; 3], per_light: false };
            // Two vertices of a coarse sphere, the highlight in the middle.
            let ends = [Vec3::new(0.5, 0.0, 0.866), Vec3::new(-0.5, 0.0, 0.866)];
            let lit = ends.map(|n| light_vertex(One, &gouraud, &lights, n, n, Z, true));
            let seen = |look: &Look, n: Vec3, lit: Option<Lit<One>>| {
                shade(One, look, &lights, &Surface { lit, ..at(One, n, Z) }, &mut Silent).xyz()
            };
            for (n, lit) in ends.iter().zip(lit) {
                all_near(seen(&gouraud, *n, Some(lit)), seen(&phong, *n, None), 1e-6);
            }
            let mean = |f: fn(&Lit<One>) -> Vec3| f(&lit[0]).mix(f(&lit[1]), 0.5);
            let between =
                Lit { ambient: mean(|l| l.ambient), diffuse: mean(|l| l.diffuse), specular: mean(|l| l.specular) };
            let g = seen(&gouraud, Z, Some(between));
            // Affine between vertices (the two ends are alike here), and without the peak.
            if model == Model::BlinnPhong {
                all_near(g, seen(&gouraud, ends[0], Some(lit[0])), 1e-6);
            }
            assert!(seen(&phong, Z, None).x > g.x + 0.25);
        }
    }

    fn normal_mapped(frame: TangentFrame, path: TbnPath) -> Material {
        Material {
            normal_map: Some(NormalMap { texture: Texture::new(0), scale: 1.0, y_down: false, channels: 3 }),
            tangent_frame: frame,
            tbn_path: path,
            ..Material::default()
        }
    }

    #[test]
    fn row_52_a_flat_normal_map_is_no_map() {
        let s = at(One, Z * 0.9, Vec3::new(0.3, 0.1, 1.0));
        let lamps = [sun(Vec3::new(0.4, 0.6, 1.0))];
        let want = color(&Material::default(), &[], &lamps, 0.1, &s);
        for frame in [TangentFrame::Mikktspace, TangentFrame::PerTriangle, TangentFrame::FromNormal] {
            let m = normal_mapped(frame, TbnPath::World);
            all_near(color(&m, &[[0.5, 0.5, 1.0, 1.0]], &lamps, 0.1, &s), want, 1e-6);
            // 8 bits cannot hold 1/2: at most half a step of 1/127.
            all_near(color(&m, &[[128.0 / 255.0, 128.0 / 255.0, 1.0, 1.0]], &lamps, 0.1, &s), want, 4e-3);
        }
    }

    #[test]
    fn row_61_the_frame_turns_the_mapped_normal() {
        // (0.6, 0, 0.8) with the tangent along +Y and sign -1 on a surface that faces +X.
        let m = normal_mapped(TangentFrame::Mikktspace, TbnPath::World);
        let s = Surface { tangent: Vec3::new(0.0, 1.0, 0.0), sign: -1.0, ..at(One, Vec3::new(1.0, 0.0, 0.0), Z) };
        let mut heard = Recorder::default();
        let l = look(&m, &[[0.8, 0.75, 0.9, 1.0]]);
        shade(One, &l, &Lights { lamps: &[], ambient: [1.0; 3], per_light: false }, &s, &mut heard);
        let shading = heard.0.iter().find_map(|n| match n {
            Note::Normal { shading, .. } => Some(*shading),
            _ => None,
        });
        // t = +Y, n = +X, b = -(X x Y) = -Z: 0.8 X + 0.6 Y - 0.5 Z, normalised.
        all_near(shading.unwrap(), Vec3::new(0.8, 0.6, -0.5).normalize(), 1e-6);
    }

    #[test]
    fn row_62_and_32_both_paths_of_document_001_agree() {
        let texels = [[0.7, 0.35, 0.8, 1.0]];
        let lamps = [sun(Vec3::new(0.4, 0.6, 1.0)), bulb(Vec3::new(-1.0, 0.5, 2.0))];
        for model in [Model::BlinnPhong, Model::Pbr] {
            for frame in [TangentFrame::PerTriangle, TangentFrame::Average, TangentFrame::FromNormal] {
                let n = Vec3::new(0.3, -0.2, 0.9);
                let s = Surface { tangent: Vec3::new(0.9, 0.3, 0.1), ..at(One, n, Vec3::new(0.3, 0.1, 1.0)) };
                let with = |path| color(&Material { model, ..normal_mapped(frame, path) }, &texels, &lamps, 0.1, &s);
                // The row's own bound.
                all_near(with(TbnPath::World), with(TbnPath::Tangent), 1e-5);
            }
        }
    }

    #[test]
    fn row_65_the_frame_from_the_normal() {
        for n in [Vec3::new(0.48, 0.6, 0.64), Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, -1.0, 0.0), Z] {
            let [t, b, _] = surface::from_normal(n, -1.0);
            near(t.dot(n), 0.0, 1e-7);
            near(t.length(), 1.0, 1e-6);
            near(b.length(), 1.0, 1e-6);
        }
        let n = Vec3::new(0.48, 0.6, 0.64);
        near(surface::from_normal(n, 1.0)[0].dot(n), 2.0 * 0.6 * 0.8, 1e-6);
    }

    #[test]
    fn a_white_pbr_surface_is_one_over_pi_and_never_gains_energy() {
        let m = Material { model: Model::Pbr, specular_factor: 0.0, ..Material::default() };
        near(color(&m, &[], &[sun(Z)], 0.0, &at(One, Z, Z)).x, 1.0 / PI, 1e-6);
        // Under a constant environment a white surface of any kind stays at or below 1.
        for metallic in [0.0, 0.5, 1.0] {
            for multi_scatter in [false, true] {
                for k in 0..20 {
                    let m = Material {
                        model: Model::Pbr,
                        metallic,
                        multi_scatter,
                        roughness: k as f32 / 19.0,
                        ..Material::default()
                    };
                    for c in [0.02, 0.1, 0.4, 0.9, 1.0] {
                        let v = Vec3::new(f32::sqrt(1.0 - c * c), 0.0, c);
                        let got = color(&m, &[], &[], 1.0, &at(One, Z, v)).x;
                        // Issue's bound; a rough metal loses up to 0.7 by single scattering.
                        assert!(got <= 1.001 && got > 0.25, "{metallic} {multi_scatter} {k} {c}: {got}");
                        if multi_scatter && metallic != 0.5 {
                            // Half metals lose more: glTF takes Fresnel of the mixed reflectance, and what it
                            // leaves to the diffuse lobe is halved again. The table is 1 % high on purpose and up to 4 % off near the horizon.
                            assert!(got > 0.95, "{metallic} {k} {c}: {got}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn the_dielectric_reflects_what_its_index_says() {
        // Facing light and eye at roughness 1: specular = f0 D V = 0.04 (1/pi) (1/4).
        let m = Material { model: Model::Pbr, albedo: [0.0; 3], roughness: 1.0, ..Material::default() };
        let got = color(&m, &[], &[sun(Z)], 0.0, &at(One, Z, Z)).x;
        near(got, 0.04 / PI / 4.0, 1e-7);
        let strong = Material { ior: 0.0, ..m };
        near(color(&strong, &[], &[sun(Z)], 0.0, &at(One, Z, Z)).x, 1.0 / PI / 4.0, 1e-6);
    }

    #[test]
    fn spots_fade_between_the_cones_and_ranges_end() {
        let spot = |degrees: f32| {
            let (s, c) = crate::math::exact::sin_cos_f64(f64::from(degrees).to_radians());
            let light = Light {
                kind: LightKind::Spot { inner: 20.0, outer: 40.0 },
                direction: -Vec3::new(s as f32, 0.0, c as f32),
                ..Light::point(Z * 2.0)
            };
            color(&dark(), &[], &[Lamp::new(&light, None)], 0.0, &at(One, Z, Z)).x
        };
        near(spot(0.0), 1.0, 1e-6);
        near(spot(19.9), 1.0, 1e-6);
        near(spot(40.1), 0.0, 1e-6);
        // KHR_lights_punctual: the square of the cosine's share.
        let cos = |d: f64| crate::math::exact::cos_f64(d.to_radians());
        let share = (cos(30.0) - cos(40.0)) / (cos(20.0) - cos(40.0));
        near(spot(30.0), (share * share) as f32, 1e-5);
        let range = |d: f32| {
            let light = Light { range: Some(4.0), ..Light::point(Z * d) };
            color(&dark(), &[], &[Lamp::new(&light, None)], 0.0, &at(One, Z, Z)).x
        };
        near(range(2.0), 1.0 - 1.0 / 16.0, 1e-6);
        assert_eq!(range(4.5), 0.0);
    }

    #[test]
    fn alpha_colour_and_channels_mean_what_they_say() {
        let m = Material {
            model: Model::Unlit,
            alpha: Alpha::Blend,
            opacity: 0.5,
            albedo_map: Some(Texture::new(0)),
            alpha_map: Some(Texture { channel: Some(crate::scene::Channel::G), ..Texture::new(1) }),
            ..Material::default()
        };
        let texels = [[0.2, 0.4, 0.6, 0.5], [1.0, 0.25, 1.0, 1.0]];
        let s = Surface { color: Vec4::new(1.0, 0.5, 1.0, 0.5), ..at(One, Z, Z) };
        let none = Lights { lamps: &[], ambient: [0.0; 3], per_light: false };
        let got = shade(One, &look(&m, &texels), &none, &s, &mut Silent);
        assert_eq!(got.array(), [0.2, 0.2, 0.6, 0.5 * 0.5 * 0.5 * 0.25]);
        assert_eq!(alpha(One, &look(&m, &texels), &s), got.w);
        let opaque = Material { alpha: Alpha::Opaque, vertex_colors: false, ..m };
        assert_eq!(shade(One, &look(&opaque, &texels), &none, &s, &mut Silent).array(), [0.2, 0.4, 0.6, 1.0]);
    }

    #[test]
    fn maps_that_share_a_texture_are_asked_once() {
        let m = Material {
            model: Model::Pbr,
            metallic: 1.0,
            roughness: 1.0,
            metallic_map: Some(Texture::new(0)),
            roughness_map: Some(Texture::new(0)),
            occlusion_map: Some(Texture::new(0)),
            ..Material::default()
        };
        let look = look(&m, &[[0.5, 0.25, 0.75, 1.0]]);
        let none = Lights { lamps: &[], ambient: [1.0; 3], per_light: false };
        let mut heard = Recorder::default();
        let got = shade(One, &look, &none, &at(One, Z, Z), &mut heard);
        assert_eq!(heard.0.iter().filter(|n| matches!(n, Note::Tap { .. })).count(), 1);
        let plain = Material {
            metallic: 0.75,
            roughness: 0.25,
            metallic_map: None,
            roughness_map: None,
            occlusion_map: None,
            ..m
        };
        let want = color(&plain, &[], &[], 0.5, &at(One, Z, Z));
        all_near(got.xyz(), want, 1e-6);
    }

    #[test]
    fn texture_transforms_follow_khr_texture_transform() {
        let t = Texture { offset: [0.5, 0.25], rotate: 90.0, scale: [2.0, 3.0], ..Texture::new(0) };
        let m = Material { albedo_map: Some(t), ..Material::default() };
        let look = look(&m, &[[1.0; 4]]);
        let mut s = at(One, Z, Z);
        s.uv[0] = Vec2::new(0.1, 0.2);
        s.footprint[0] = Footprint { dudx: 0.01, dvdx: 0.0, dudy: 0.0, dvdy: 0.02 };
        let (uv, f) = look.albedo_slot().unwrap().place(&s);
        // Scaled (0.2, 0.6), turned counter-clockwise as seen with v down: (v, -u).
        near(uv.x, 0.6 + 0.5, 1e-6);
        near(uv.y, -0.2 + 0.25, 1e-6);
        near(f.dvdx, -0.02, 1e-7);
        near(f.dudy, 0.06, 1e-7);
    }

    #[test]
    fn whole_and_broken_exponents_agree_and_odd_input_is_finite() {
        let whole = Material { shininess: 30.0, ..Material::default() };
        let mapped = Material { shininess_map: Some(Texture::new(0)), ..whole.clone() };
        let lamps = [sun(Vec3::new(0.2, 0.1, 1.0))];
        let s = at(One, Z, Vec3::new(0.1, 0.3, 1.0));
        // Repeated squaring against logarithm and exponential: 30 roundings.
        all_near(color(&whole, &[], &lamps, 0.0, &s), color(&mapped, &[[1.0; 4]], &lamps, 0.0, &s), 5e-6);
        for model in [Model::BlinnPhong, Model::Pbr] {
            let m = Material {
                model,
                shininess: 0.0,
                roughness: 0.0,
                ..normal_mapped(TangentFrame::Mikktspace, TbnPath::World)
            };
            for n in [Vec3::default(), Z, -Z, Vec3::new(1.0, 0.0, 0.0)] {
                // Lights on the surface, behind it, and opposite to the eye; a map of grey mud.
                let lamps = [bulb(Vec3::default()), sun(-Z), bulb(Z * -3.0)];
                for texel in [[0.5, 0.5, 0.5, 1.0], [0.5, 0.5, 0.0, 1.0], [0.0, 0.0, 0.0, 0.0]] {
                    let c = color(&m, &[texel], &lamps, 0.1, &at(One, n, Z));
                    assert!(c.is_finite() && c.array().iter().all(|v| *v >= 0.0), "{model:?} {n:?} {texel:?} {c:?}");
                }
            }
        }
    }
}
