//! `Scene -> Prepared`: meshlets, instances, tangents, mip levels.

use crate::error::Result;
use crate::render::RenderOptions;
use crate::scene::Scene;

/// A scene made ready for any number of frames.
#[derive(Debug)]
pub struct Prepared {}

impl Prepared {
    /// Cooks every mesh and map that an object shows.
    ///
    /// # Errors
    /// `job.memory` over the budget, `job.interrupted` when cancelled.
    pub fn new(_scene: &Scene, _options: &RenderOptions) -> Result<Self> {
        unimplemented!("lands with the renderer")
    }
}
