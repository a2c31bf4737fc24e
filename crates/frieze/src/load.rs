//! Models, images and scene files: path in, scene and findings out. The only room that reads files.

mod decode;

use crate::error::{Finding, Result};
use crate::job::Job;
use crate::scene::Scene;
use std::path::Path;

/// How files are read.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// Threads, memory, progress, cancellation.
    pub job: Job,
    /// Whether files outside of the folder of the model or scene may be read.
    pub allow_outside: bool,
}

/// A scene and what was odd about its files.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// What could not be used, or was guessed.
    pub findings: Vec<Finding>,
}

/// Loads a model (`.glb .gltf .obj .ply .stl`) or a scene (`.toml`).
///
/// # Errors
/// Input faults name the file, the place in it and a remedy.
pub fn load(_path: &Path, _options: &LoadOptions) -> Result<Loaded> {
    unimplemented!("lands with the loaders")
}
