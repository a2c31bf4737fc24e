//! What makes maps from meshes and other maps.

pub mod repair;
