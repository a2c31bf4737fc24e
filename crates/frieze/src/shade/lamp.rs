//! Lights, resolved for shading.

use super::surface::cos_degrees;
use crate::map::shadow::ShadowMap;
use crate::math::lane::{Lane, Num};
use crate::math::vec::Vec3;
use crate::scene::{Falloff, Light, LightKind};

/// A light with its shadow map.
#[derive(Clone, Debug)]
pub struct Lamp {
    kind: LightKind,
    position: Vec3,
    towards: Vec3,
    color: [f32; 3],
    square: bool,
    /// 1 / range², 0 without a range.
    window: f32,
    /// Scale and offset of the cosine for a spot's cone.
    cone: [f32; 2],
    shadow: Option<ShadowMap>,
    /// What every lookup answers, for tests of what shading makes of it.
    #[cfg(test)]
    pub(super) fixed: Option<f32>,
}

/// All light that a surface receives.
#[derive(Clone, Copy, Debug)]
pub struct Lights<'a> {
    /// The lights, summed in this order.
    pub lamps: &'a [Lamp],
    /// Light from everywhere, linear RGB.
    pub ambient: [f32; 3],
    /// Adds the ambient light once for every lamp instead of once (row 13).
    pub per_light: bool,
}

impl Lights<'_> {
    /// The ambient light, counted as often as row 13 says.
    #[inline(always)]
    pub(super) fn ambient(&self) -> Vec3 {
        let times = if self.per_light { self.lamps.len() as f32 } else { 1.0 };
        Vec3::from(self.ambient) * times
    }
    /// Whether any of them asks a shadow map.
    #[inline(always)]
    pub fn any_shadow(&self) -> bool {
        self.lamps.iter().any(Lamp::casts)
    }
}

/// Light that comes in from one lamp.
#[derive(Clone, Copy, Debug)]
pub(super) struct Incoming<N> {
    /// Unit vector towards the lamp.
    pub direction: Vec3<N>,
    /// Falloff, cone and range.
    pub attenuation: N,
}

impl Lamp {
    /// Resolves a light. `shadow` is its map of this frame, if it casts shadows.
    pub fn new(light: &Light, shadow: Option<ShadowMap>) -> Self {
        let cone = match light.kind {
            LightKind::Spot { inner, outer } => {
                // KHR_lights_punctual: a smooth step on the cosine.
                let (inner, outer) = (cos_degrees(inner), cos_degrees(outer));
                let scale = 1.0 / f32::max(inner - outer, 1e-3);
                [scale, -outer * scale]
            }
            _ => [0.0, 1.0],
        };
        Lamp {
            kind: light.kind,
            position: light.position,
            towards: -light.direction.normalize(),
            color: light.color.map(|c| c * light.intensity),
            square: light.falloff == Falloff::InverseSquare,
            window: light.range.map_or(0.0, |r| if r > 0.0 { 1.0 / (r * r) } else { f32::MAX }),
            cone,
            shadow,
            #[cfg(test)]
            fixed: None,
        }
    }
    /// Colour times intensity, linear RGB.
    #[inline(always)]
    pub fn color(&self) -> Vec3 {
        self.color.into()
    }
    /// The shadow map of this frame, if it casts shadows.
    pub fn shadow(&self) -> Option<&ShadowMap> {
        self.shadow.as_ref()
    }
    /// Where light comes from, and how much of it arrives without occluders.
    #[inline(always)]
    pub(super) fn incoming<L: Lane>(&self, l: L, position: Vec3<L::F>) -> Incoming<L::F> {
        let one = l.f(1.0);
        if matches!(self.kind, LightKind::Directional) {
            return Incoming { direction: self.towards.lift(one), attenuation: one };
        }
        let to = self.position.lift(one) - position;
        // A lamp on the surface: 0.1 mm is as near as it gets, so that nothing becomes infinite.
        let d2 = to.length2().max(l.f(1e-8));
        let direction = to * d2.sqrt().recip();
        let mut attenuation = if self.square { d2.recip() } else { one };
        if self.window > 0.0 {
            let q = d2 * self.window;
            attenuation = attenuation * (one - q * q).max(l.f(0.0));
        }
        if matches!(self.kind, LightKind::Spot { .. }) {
            let cos = direction.dot(self.towards.lift(one));
            let cone = (cos * self.cone[0] + self.cone[1]).saturate();
            attenuation = attenuation * (cone * cone);
        }
        Incoming { direction, attenuation }
    }
    /// The share of light that arrives at `position`. `normal` is of unit length.
    #[inline(always)]
    pub(super) fn visibility<L: Lane>(&self, l: L, position: Vec3<L::F>, normal: Vec3<L::F>, active: L::M) -> L::F {
        #[cfg(test)]
        if let Some(v) = self.fixed {
            return l.f(v);
        }
        match &self.shadow {
            Some(map) => map.visibility(l, position, normal, active),
            None => l.f(1.0),
        }
    }
    #[inline(always)]
    pub(super) fn casts(&self) -> bool {
        #[cfg(test)]
        if self.fixed.is_some() {
            return true;
        }
        self.shadow.is_some()
    }
}
