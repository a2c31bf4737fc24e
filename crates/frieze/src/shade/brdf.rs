//! Blinn-Phong and metallic-roughness: light at a point, and what the surface makes of it.

use super::lamp::Lights;
use super::probe::{Note, Probe};
use super::surface::{Factors, Lit, Look, Surface};
use crate::math::lane::{Lane, Mask, Num};
use crate::math::vec::{Vec3, Vec4};
use crate::math::{exact, microfacet};
use core::f32::consts::FRAC_1_PI;

/// Where light is gathered.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place<L: Lane> {
    pub position: Vec3<L::F>,
    /// Unit, towards the eye, world space.
    pub view: Vec3<L::F>,
    /// Unit, what is shaded with; in the space of `turn` if there is one.
    pub normal: Vec3<L::F>,
    /// Unit, of the triangle's plane: what a shadow's bias is made from.
    pub geometric: Vec3<L::F>,
    pub active: L::M,
    /// Tangent, bitangent and normal that directions are turned into before they meet `normal`: the transposed
    /// TBN of document 001.
    pub turn: Option<[Vec3<L::F>; 3]>,
}

impl<L: Lane> Place<L> {
    #[inline(always)]
    fn new<P: Probe<L>>(
        l: L,
        look: &Look,
        lights: &Lights<'_>,
        s: &Surface<L>,
        texel: Option<Vec4<L::F>>,
        probe: &mut P,
    ) -> Self {
        let facing = look.facing(l, s, texel, probe);
        let geometric = if lights.any_shadow() { s.plane } else { facing.normal };
        Place {
            position: s.position,
            view: s.view,
            normal: facing.normal,
            geometric,
            active: s.active,
            turn: facing.turn,
        }
    }
    /// A world direction in the space of `normal`.
    #[inline(always)]
    fn turned(&self, d: Vec3<L::F>) -> Vec3<L::F> {
        match self.turn {
            Some([t, b, n]) => Vec3::new(t.dot(d), b.dot(d), n.dot(d)),
            None => d,
        }
    }
}

/// Diffuse and specular light by rows 5, 6 and 14: sums over the lights of `a v max(0, n.l)` and
/// `a v max(0, n.h)^p`, with attenuation a and visibility v. As in the row, the specular term does not ask for
/// n.l > 0.
#[inline(always)]
pub(super) fn light_blinn_phong<L: Lane, P: Probe<L>>(
    l: L,
    lights: &Lights<'_>,
    at: &Place<L>,
    shininess: L::F,
    exponent: Option<u32>,
    probe: &mut P,
) -> Lit<L> {
    let zero = l.f(0.0);
    let mut lit = Lit { ambient: lights.ambient().lift(zero), ..Lit::dark(l) };
    let view = at.turned(at.view);
    for (k, lamp) in lights.lamps.iter().enumerate() {
        let light = lamp.incoming(l, at.position);
        let direction = at.turned(light.direction);
        let n_l = at.normal.dot(direction).max(zero);
        let n_h = at.normal.dot((direction + view).normalize()).max(zero);
        let lobe = match exponent {
            Some(n) => exact::pow_int(n_h, n),
            None => l.enter(
                #[inline(always)]
                || exact::pow(n_h, shininess),
            ),
        };
        let mut share = light.attenuation;
        let mut visibility = l.f(1.0);
        if lamp.casts() {
            let needed = at.active & (n_l.gt(zero) | lobe.gt(zero)) & light.attenuation.gt(zero);
            if needed.any() {
                // Lanes that asked for nothing are multiplied by 0 below, whatever they got.
                visibility = lamp.visibility(l, at.position, at.geometric, needed);
                share = share * visibility;
            }
        }
        let color = lamp.color();
        let diffuse = color.lift(zero) * (n_l * share);
        let specular = color.lift(zero) * (lobe * share);
        lit.diffuse = lit.diffuse + diffuse;
        lit.specular = lit.specular + specular;
        probe.note(|| Note::Light {
            light: k,
            direction,
            n_l,
            n_h,
            attenuation: light.attenuation,
            visibility,
            diffuse,
            specular,
        });
    }
    lit
}

/// Rows 4 to 8 and 13: `ka La + kd D + ks S`, emission, and a share of the mirrored environment (row 96;
/// the environment is the ambient light). `normal` is the normal map's texel, if it was asked already.
#[inline(always)]
pub(super) fn blinn_phong<L: Lane, P: Probe<L>>(
    l: L,
    look: &Look,
    lights: &Lights<'_>,
    s: &Surface<L>,
    albedo: Vec3<L::F>,
    normal: Option<Vec4<L::F>>,
    probe: &mut P,
) -> Vec3<L::F> {
    let one = l.f(1.0);
    let f = look.factors(l, s, probe);
    let lit = match s.lit {
        Some(lit) => lit,
        None => {
            let at = Place::new(l, look, lights, s, normal, probe);
            let shininess = f.shininess * look.shininess;
            light_blinn_phong(l, lights, &at, shininess, look.exponent, probe)
        }
    };
    let ka = match look.ambient {
        Some(ka) => Vec3::from(ka).lift(one),
        None => albedo,
    };
    let ambient = ka * f.ambient * look.ambient_light(l, lights, s) * f.occlusion;
    let ks = f.specular * Vec3::from(look.specular).lift(one);
    let mut color = ambient + albedo * lit.diffuse + ks * lit.specular;
    if look.reflection > 0.0 {
        color = color.mix(lights.ambient().lift(one), l.f(look.reflection));
    }
    finish(look, &f, ambient, color, probe)
}

#[inline(always)]
fn finish<L: Lane, P: Probe<L>>(
    look: &Look,
    f: &Factors<L::F>,
    ambient: Vec3<L::F>,
    color: Vec3<L::F>,
    probe: &mut P,
) -> Vec3<L::F> {
    let emissive = look.emissive(f);
    let color = color + emissive;
    probe.note(|| Note::Ambient(ambient));
    probe.note(|| Note::Emissive(emissive));
    probe.note(|| Note::Color(color));
    color
}

/// What metallic-roughness makes of its parameters (glTF 2.0, appendix B; KHR_materials_ior and _specular).
#[derive(Clone, Copy, Debug)]
pub(super) struct Metal<N> {
    /// Albedo of the diffuse lobe.
    diffuse: Vec3<N>,
    roughness: N,
    alpha: N,
    f0: Vec3<N>,
    f90: N,
}

impl<N: Num> Metal<N> {
    #[inline(always)]
    fn new(look: &Look, albedo: Vec3<N>, f: &Factors<N>) -> Self {
        let one = albedo.x.lift(1.0);
        let metallic = (f.metallic * look.metallic).saturate();
        let strength = f.specular_factor * look.specular_factor;
        let tint = f.specular * Vec3::from(look.specular_color).lift(one);
        let bare = tint.map(|t| (t * look.dielectric).min(one) * strength);
        let roughness = (f.roughness * look.roughness).clamp(microfacet::MIN_ROUGHNESS, 1.0);
        Metal {
            diffuse: albedo * (one - metallic),
            roughness,
            alpha: microfacet::alpha(roughness),
            f0: bare.mix(albedo, metallic),
            f90: metallic.mix(strength, one),
        }
    }
    /// Without maps.
    #[inline(always)]
    pub(super) fn of_factors<L: Lane<F = N>>(l: L, look: &Look) -> Self {
        Self::new(look, Vec3::from(look.albedo).lift(l.f(1.0)), &Factors::ones(l))
    }
}

/// The larger of a colour's components.
#[inline(always)]
fn largest<N: Num>(c: Vec3<N>) -> N {
    c.x.max(c.y).max(c.z)
}

/// How far a shading normal may turn from the viewer: a cosine of 0 would divide by 0.
const LEAST_N_V: f32 = 1e-4;

/// Diffuse and specular light: sums over the lights of `(1 - F) a v max(0, n.l) / pi` and
/// `F D V a v max(0, n.l)`.
#[inline(always)]
pub(super) fn light_pbr<L: Lane, P: Probe<L>>(
    l: L,
    lights: &Lights<'_>,
    at: &Place<L>,
    m: &Metal<L::F>,
    probe: &mut P,
) -> Lit<L> {
    let (zero, one) = (l.f(0.0), l.f(1.0));
    let mut lit = Lit { ambient: lights.ambient().lift(zero), ..Lit::dark(l) };
    let view = at.turned(at.view);
    let n_v = at.normal.dot(view).max(l.f(LEAST_N_V));
    for (k, lamp) in lights.lamps.iter().enumerate() {
        let light = lamp.incoming(l, at.position);
        let direction = at.turned(light.direction);
        let n_l = at.normal.dot(direction).max(zero);
        let needed = at.active & n_l.gt(zero) & light.attenuation.gt(zero);
        let h = (direction + view).normalize();
        let n_h = at.normal.dot(h).max(zero);
        let v_h = view.dot(h).max(zero);
        let mut share = light.attenuation * n_l;
        let mut visibility = one;
        if lamp.casts() && needed.any() {
            visibility = lamp.visibility(l, at.position, at.geometric, needed);
            share = share * visibility;
        }
        let fresnel = microfacet::f_schlick(v_h, m.f0, m.f90);
        let lobe = microfacet::d_ggx(n_h, m.alpha) * microfacet::v_smith(n_l, n_v, m.alpha);
        let color = lamp.color().lift(one);
        let diffuse = color * ((one - largest(fresnel)) * share * FRAC_1_PI);
        let specular = color * fresnel * (lobe * share);
        lit.diffuse = lit.diffuse + diffuse;
        lit.specular = lit.specular + specular;
        probe.note(|| Note::Light {
            light: k,
            direction,
            n_l,
            n_h,
            attenuation: light.attenuation,
            visibility,
            diffuse,
            specular,
        });
    }
    lit
}

/// Metallic-roughness. Ambient light is a constant environment of that radiance: its integral over the specular
/// lobe is [`microfacet::albedo`], what is left goes to the diffuse lobe. `normal` as for [`blinn_phong`].
#[inline(always)]
pub(super) fn pbr<L: Lane, P: Probe<L>>(
    l: L,
    look: &Look,
    lights: &Lights<'_>,
    s: &Surface<L>,
    albedo: Vec3<L::F>,
    normal: Option<Vec4<L::F>>,
    probe: &mut P,
) -> Vec3<L::F> {
    let one = l.f(1.0);
    let f = look.factors(l, s, probe);
    let m = Metal::new(look, albedo, &f);
    let (lit, n_v) = match s.lit {
        Some(lit) => (lit, s.normal.normalize().dot(s.view)),
        None => {
            let at = Place::new(l, look, lights, s, normal, probe);
            (light_pbr(l, lights, &at, &m, probe), at.normal.dot(at.turned(s.view)))
        }
    };
    let n_v = n_v.max(l.f(LEAST_N_V));
    let (a, b) = microfacet::albedo(l, n_v, m.roughness);
    let mut mirrored = m.f0 * a + Vec3::splat(m.f90 * b);
    let mut specular = lit.specular;
    if look.multi_scatter {
        // Turquin 2019, "Practical multiple scattering compensation for microfacet models".
        // The albedo is 1 % high on purpose: with the table's error the furnace still never gains energy.
        let lost = ((a + b) * 1.01).min(one).recip() - 1.0;
        let gain = m.f0.map(|f0| f0 * lost + 1.0);
        mirrored = mirrored * gain;
        specular = specular * gain;
    }
    let rest = m.diffuse * (one - largest(mirrored)).max(l.f(0.0));
    let ambient = (rest + mirrored) * look.ambient_light(l, lights, s) * f.occlusion;
    let color = ambient + m.diffuse * lit.diffuse + specular;
    finish(look, &f, ambient, color, probe)
}
