//! Scene files.

use super::{LoadOptions, Loaded};
use crate::error::{Error, Result};
use std::path::Path;

/// Loads a scene file.
///
/// # Errors
/// Always, until scene files land.
pub fn load(path: &Path, _options: &LoadOptions) -> Result<Loaded> {
    Err(Error::input("load.unknown-format", "scene files cannot be read yet").in_file(path))
}
