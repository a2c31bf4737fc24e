//! Meshes: what they are, who touches whom, tangents, clusters for culling, built-in shapes.

#[allow(clippy::module_inception)]
pub mod mesh;
pub mod meshlet;
pub mod shape;
pub mod tangent;
mod teapot;
pub mod topology;

pub use mesh::{Attribute, Bounds, Mesh, Polygons};
