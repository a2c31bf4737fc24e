//! Blinn-Phong and metallic-roughness: light at a point, and what the surface makes of it.

use super::lamp::Lights;
use super::probe::{Note, Probe};
use super::surface::{Factors, Lit, Look, Surface};
use crate::math::lane::{Lane, Mask, Num};
use crate::math::vec::Vec3;

/// Where light is gathered.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place<L: Lane> {
    pub position: Vec3<L::F>,
    /// Unit, towards the eye, world space.
    pub view: Vec3<L::F>,
    /// Unit, what is shaded with; in the space of `turn` if there is one.
    pub normal: Vec3<L::F>,
    /// Unit, without any map: what a shadow's bias is chosen by.
    pub geometric: Vec3<L::F>,
    pub active: L::M,
    /// Tangent, bitangent and normal that directions are turned into before they meet `normal`: the transposed
    /// TBN of document 001.
    pub turn: Option<[Vec3<L::F>; 3]>,
}

impl<L: Lane> Place<L> {
    #[inline(always)]
    fn new<P: Probe<L>>(l: L, look: &Look, lights: &Lights<'_>, s: &Surface<L>, probe: &mut P) -> Self {
        let facing = look.facing(l, s, probe);
        let geometric = if lights.any_shadow() { s.normal.normalize() } else { facing.normal };
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

/// `x` to the power of a whole number, by repeated squaring from the lowest bit.
#[inline(always)]
fn pow_int<N: Num>(x: N, n: u32) -> N {
    let (mut n, mut square) = (n, x);
    let mut product: Option<N> = None;
    while n > 0 {
        if n & 1 == 1 {
            product = Some(match product {
                Some(p) => p * square,
                None => square,
            });
        }
        n >>= 1;
        if n > 0 {
            square = square * square;
        }
    }
    product.unwrap_or(x.lift(1.0))
}

/// Diffuse and specular light by rows 5, 6 and 14: sums over the lights of `a v max(0, n.l)` and
/// `a v max(0, n.h)^p`, with attenuation a and visibility v. As in the row, the specular term does not ask for
/// n.l > 0.
#[inline(always)]
pub(super) fn light_blinn_phong<L: Lane, P: Probe<L>>(
    l: L,
    look: &Look,
    lights: &Lights<'_>,
    at: &Place<L>,
    shininess: L::F,
    exponent: Option<u32>,
    probe: &mut P,
) -> Lit<L> {
    let _ = look;
    let zero = l.f(0.0);
    let mut lit = Lit { ambient: lights.ambient().lift(zero), ..Lit::dark(l) };
    let view = at.turned(at.view);
    for (k, lamp) in lights.lamps.iter().enumerate() {
        let light = lamp.incoming(l, at.position);
        let direction = at.turned(light.direction);
        let n_l = at.normal.dot(direction).max(zero);
        let n_h = at.normal.dot((direction + view).normalize()).max(zero);
        let lobe = match exponent {
            Some(n) => pow_int(n_h, n),
            None => pow(n_h, shininess),
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
/// the environment is the ambient light).
#[inline(always)]
pub(super) fn blinn_phong<L: Lane, P: Probe<L>>(
    l: L,
    look: &Look,
    lights: &Lights<'_>,
    s: &Surface<L>,
    albedo: Vec3<L::F>,
    probe: &mut P,
) -> Vec3<L::F> {
    let one = l.f(1.0);
    let f = look.factors(l, s, probe);
    let lit = match s.lit {
        Some(lit) => lit,
        None => {
            let at = Place::new(l, look, lights, s, probe);
            let shininess = f.shininess * look.shininess;
            light_blinn_phong(l, look, lights, &at, shininess, look.exponent, probe)
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

/// Until `math::exact` has it.
#[inline(always)]
fn pow<N: Num>(x: N, _y: N) -> N {
    pow_int(x, 64)
}

/// What metallic-roughness makes of its parameters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Metal<N> {
    one: N,
}

impl<N: Num> Metal<N> {
    #[inline(always)]
    pub(super) fn of_factors<L: Lane<F = N>>(l: L, _look: &Look) -> Self {
        Metal { one: l.f(1.0) }
    }
}

/// Not yet.
#[inline(always)]
pub(super) fn light_pbr<L: Lane, P: Probe<L>>(
    l: L,
    lights: &Lights<'_>,
    _at: &Place<L>,
    m: &Metal<L::F>,
    _probe: &mut P,
) -> Lit<L> {
    Lit { ambient: lights.ambient().lift(m.one), ..Lit::dark(l) }
}

/// Not yet.
#[inline(always)]
pub(super) fn pbr<L: Lane, P: Probe<L>>(
    l: L,
    look: &Look,
    lights: &Lights<'_>,
    s: &Surface<L>,
    albedo: Vec3<L::F>,
    probe: &mut P,
) -> Vec3<L::F> {
    blinn_phong(l, look, lights, s, albedo, probe)
}
