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
    let (albedo, alpha) = look.albedo(l, s, probe);
    let alpha = match look.alpha {
        Alpha::Blend => alpha * look.alpha_factor(l, s),
        Alpha::Opaque | Alpha::Mask(_) => l.f(1.0),
    };
    let color = match look.model {
        Model::Unlit => albedo,
        Model::BlinnPhong => brdf::blinn_phong(l, look, lights, s, albedo, probe),
        Model::Pbr => brdf::pbr(l, look, lights, s, albedo, probe),
    };
    color.extend(alpha)
}

/// The alpha of a surface, whatever the material does with it: opacity, maps and vertex colour. Asks no other
/// map.
#[inline(always)]
pub fn alpha<L: Lane>(l: L, look: &Look, s: &Surface<L>) -> L::F {
    let (_, alpha) = look.albedo(l, s, &mut Silent);
    alpha * look.alpha_factor(l, s)
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
