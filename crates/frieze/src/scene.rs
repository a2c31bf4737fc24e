//! What is to be rendered: plain public data, every reference an index, every default filled in.

pub mod camera;
pub mod light;
pub mod material;
#[allow(clippy::module_inception)]
pub mod scene;

pub use camera::{Camera, Projection};
pub use light::{Bias, Falloff, Light, LightKind, Shadow, ShadowFilter, ShadowProjection, ShadowWrap};
pub use material::{
    Alpha, Channel, HeightMap, Material, Model, NormalMap, NormalSpace, NormalZero, Normals, Shading, TangentFrame,
    TbnPath, Texture,
};
pub use scene::{Ambient, Background, Object, Output, Scene, ToneMap, View};
