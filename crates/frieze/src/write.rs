//! The only room that writes files.

use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::job::Job;
use std::io::Write;
use std::path::{Path, PathBuf};

/// How files are written.
#[derive(Clone, Debug, Default)]
pub struct WriteOptions {
    /// Whether an existing file is overwritten.
    pub force: bool,
    /// Cancellation.
    pub job: Job,
}

/// Writes a frame; returns the files.
///
/// # Errors
/// `write.*`
pub fn frame(_frame: &Frame, path: &Path, _options: &WriteOptions) -> Result<Vec<PathBuf>> {
    Err(Error::output("write.stub", "lands with the writers").in_file(path))
}

/// Writes the colour as PNG.
///
/// # Errors
/// `write.*`
pub fn png_to(_to: &mut dyn Write, _frame: &Frame) -> Result<()> {
    Err(Error::output("write.stub", "lands with the writers"))
}
