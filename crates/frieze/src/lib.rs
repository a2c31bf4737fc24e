//! Render textured 3D assets on any machine: no GPU, no driver, no display, and the same bits everywhere.
//! (Baking and repairing come later.)
//!
//! ```
//! # fn main() -> frieze::Result<()> {
//! let scene = frieze::samples::scene("teapot").expect("it is built in");
//! let options = frieze::RenderOptions { size: (96, 64), ..Default::default() };
//! let frame = frieze::render(&scene, &options)?;
//! frame.save(std::env::temp_dir().join("teapot.png"))?;
//! # Ok(())
//! # }
//! ```

pub mod bake;
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

use std::path::Path;

/// Loads a model, a scene file or, as `sample:NAME`, a built-in scene, with default options.
///
/// # Errors
/// As [`load::load`]; `load.no-sample` for a name that is not built in.
pub fn load(source: impl AsRef<Path>) -> Result<load::Loaded> {
    let path = source.as_ref();
    let options = load::LoadOptions::default();
    match path.to_str().and_then(|s| s.strip_prefix("sample:")) {
        Some(name) => match options.job.run(|| samples::scene(name)) {
            Some(scene) => Ok(load::Loaded { scene, findings: Vec::new() }),
            None => Err(Error::arguments("load.no-sample", format!("there is no built-in scene `{name}`"))
                .remedy("built in are: ".to_owned() + &samples::NAMES.map(|(name, _)| name).join(", "))),
        },
        None => load::load(path, &options),
    }
}
