//! Lights and the shadow maps they ask for.

use crate::math::vec::Vec3;

/// What a light is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Parallel light from infinitely far.
    Directional,
    /// From a point into all directions.
    Point,
    /// From a point into a cone.
    Spot {
        /// Half angle of full light, degrees.
        inner: f32,
        /// Half angle where light ends, degrees; `inner < outer <= 90`.
        outer: f32,
    },
}

/// How light fades with distance (point and spot).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Falloff {
    /// Not at all.
    #[default]
    None,
    /// `1 / d²` (row 5).
    InverseSquare,
}

/// How a shadow map is asked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShadowFilter {
    /// One nearest lookup.
    Hard,
    /// Percentage closer filtering over `(2 radius + 1)²` texels.
    Pcf {
        /// 1 = 3x3.
        radius: u32,
    },
}

/// What is taken from a lookup's depth before it is compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bias {
    /// Chosen from texel size, slope and filter radius.
    Auto,
    /// In forward light depth, 0 at near, 1 at far.
    Value(f32),
}

/// What a lookup outside of the shadow map answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShadowWrap {
    /// Lit, beyond far too.
    Border,
    /// The map repeats and depth beyond 1 is compared as it is (document 002).
    Repeat,
}

/// The projection of a shadow map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShadowProjection {
    /// Parallel rays along the light's direction.
    Orthographic,
    /// A pinhole at the light.
    Perspective,
}

/// The shadow map of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shadow {
    /// Texels along each side.
    pub size: u32,
    /// How it is asked.
    pub filter: ShadowFilter,
    /// What keeps a surface from shadowing itself.
    pub bias: Bias,
    /// By default what the kind of light needs.
    pub projection: Option<ShadowProjection>,
    /// Nearest depth, metres from the light; fitted by default.
    pub near: Option<f32>,
    /// Farthest depth, metres from the light; fitted by default.
    pub far: Option<f32>,
    /// Half width of an orthographic frustum, metres; fitted by default.
    pub extent: Option<f32>,
    /// Outside of the map.
    pub wrap: ShadowWrap,
}

impl Default for Shadow {
    fn default() -> Self {
        Shadow {
            size: 1024,
            filter: ShadowFilter::Pcf { radius: 1 },
            bias: Bias::Auto,
            projection: None,
            near: None,
            far: None,
            extent: None,
            wrap: ShadowWrap::Border,
        }
    }
}

/// A light.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Its name in the file, or empty.
    pub name: String,
    /// What it is.
    pub kind: LightKind,
    /// Where it is. A directional light's shadow frustum begins here unless it is fitted.
    pub position: Vec3,
    /// The unit direction in which light travels.
    pub direction: Vec3,
    /// Linear RGB.
    pub color: [f32; 3],
    /// Multiplies the colour.
    pub intensity: f32,
    /// How it fades.
    pub falloff: Falloff,
    /// Where a point or spot light ends, metres (KHR_lights_punctual's window).
    pub range: Option<f32>,
    /// Its shadow map, if it casts shadows.
    pub shadow: Option<Shadow>,
}

impl Light {
    /// A white directional light from `position` towards `target`, with default shadows.
    pub fn directional(position: Vec3, target: Vec3) -> Self {
        Light {
            name: String::new(),
            kind: LightKind::Directional,
            position,
            direction: (target - position).normalize(),
            color: [1.0; 3],
            intensity: 1.0,
            falloff: Falloff::None,
            range: None,
            shadow: Some(Shadow::default()),
        }
    }
    /// A white point light without shadows.
    pub fn point(position: Vec3) -> Self {
        Light {
            kind: LightKind::Point,
            shadow: None,
            direction: Vec3::new(0.0, -1.0, 0.0),
            ..Self::directional(position, position + Vec3::new(0.0, -1.0, 0.0))
        }
    }
}

/// The lights of a scene that has none: a key light from above, to the left of the camera that is fitted to
/// `bounds` (smallest and largest world coordinates), with a shadow, and a dimmer fill light from the right
/// without. They go with the ambient light that a scene has by default.
pub fn default_rig((lo, hi): (Vec3, Vec3)) -> Vec<Light> {
    let center = (lo + hi) * 0.5;
    let radius = ((hi - lo).length() * 0.5).max(1e-6);
    // The fitted camera looks from azimuth 30 degrees: from (0.5, ., 0.87).
    let light = |name: &str, from: [f32; 3], intensity: f32, shadow: Option<Shadow>| Light {
        name: name.to_owned(),
        intensity,
        shadow,
        ..Light::directional(center + Vec3::from(from).normalize() * (2.0 * radius), center)
    };
    vec![light("key", [-0.25, 1.1, 1.0], 0.8, Some(Shadow::default())), light("fill", [1.0, 0.4, 0.3], 0.3, None)]
}
