//! Render, bake and repair textured 3D assets on any machine: no GPU, no driver, no display, and the same
//! bits everywhere.

pub mod error;
pub mod explain;
pub mod frame;
pub mod games101;
pub mod image;
pub mod inspect;
pub mod job;
pub mod load;
pub mod map;
pub mod math;
pub mod mesh;
pub mod prepare;
pub mod raster;
pub mod render;
pub mod samples;
pub mod scene;
pub mod shade;
pub mod write;

pub use error::{Error, Finding, Result};
pub use explain::explain;
pub use frame::Frame;
pub use job::Job;
pub use render::{RenderOptions, render};
pub use scene::Scene;
