//! What can be overheard while a pixel is shaded.

use crate::map::Footprint;
use crate::math::lane::Lane;
use crate::math::vec::{Vec2, Vec3, Vec4};

/// One step of shading, in the order in which it happens.
#[derive(Clone, Copy, Debug)]
pub enum Note<L: Lane> {
    /// A map was asked.
    Tap {
        /// Which slot: `albedo`, `normal`, ...
        slot: &'static str,
        /// Which UV set.
        set: usize,
        /// Where, after the slot's transform.
        uv: Vec2<L::F>,
        /// Over which area, after the slot's transform.
        footprint: Footprint<L::F>,
        /// The answer.
        value: Vec4<L::F>,
    },
    /// Reflectance of the diffuse term with all its factors, linear RGB.
    Albedo(Vec3<L::F>),
    /// The frame that a mapped normal is given in, world space.
    Frame {
        /// Towards +u.
        tangent: Vec3<L::F>,
        /// Towards the top of the image.
        bitangent: Vec3<L::F>,
        /// Away from the surface.
        normal: Vec3<L::F>,
    },
    /// The normal that is shaded with.
    Normal {
        /// As the map says it, in the map's space; (0, 0, 1) without a map.
        mapped: Vec3<L::F>,
        /// World space (tangent space on the tangent path of document 001), unit length.
        shading: Vec3<L::F>,
    },
    /// What a light does.
    Light {
        /// Its index.
        light: usize,
        /// Unit vector towards it, in the space of the shading normal.
        direction: Vec3<L::F>,
        /// max(0, n . l)
        n_l: L::F,
        /// max(0, n . h)
        n_h: L::F,
        /// Falloff, cone and range.
        attenuation: L::F,
        /// The share that no occluder takes.
        visibility: L::F,
        /// Diffuse light: to be multiplied with the albedo.
        diffuse: Vec3<L::F>,
        /// Specular light: Blinn-Phong's to be multiplied with the specular reflectance, PBR's with the
        /// multi-scatter gain.
        specular: Vec3<L::F>,
    },
    /// What ambient light adds to the colour, all factors included.
    Ambient(Vec3<L::F>),
    /// What emission adds.
    Emissive(Vec3<L::F>),
    /// The sum, linear RGB.
    Color(Vec3<L::F>),
}

/// Somebody who may listen.
pub trait Probe<L: Lane> {
    /// Whether anybody does: maps are then asked one by one.
    const LISTENS: bool;
    /// Called at every step; `note` is only made when it is asked for, so silence costs nothing.
    #[inline(always)]
    fn note(&mut self, note: impl FnOnce() -> Note<L>) {
        let _ = note;
    }
}

/// Nobody listens.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl<L: Lane> Probe<L> for Silent {
    const LISTENS: bool = false;
}

/// Keeps every note.
#[derive(Clone, Debug)]
pub struct Recorder<L: Lane>(pub Vec<Note<L>>);

impl<L: Lane> Default for Recorder<L> {
    fn default() -> Self {
        Recorder(Vec::new())
    }
}

impl<L: Lane> Probe<L> for Recorder<L> {
    const LISTENS: bool = true;

    fn note(&mut self, note: impl FnOnce() -> Note<L>) {
        self.0.push(note());
    }
}
