//! What a user calls a scene: a file, or `sample:NAME`.

use crate::args::did_you_mean;
use frieze::load::{LoadOptions, Loaded};
use frieze::{Error, Result, samples};
use std::path::Path;

/// The scene that `word` names, and what was odd about its files.
///
/// # Errors
/// `samples.unknown`, and those of [`frieze::load::load`].
pub fn open(word: &Path, options: &LoadOptions) -> Result<Loaded> {
    match sample(word) {
        Some(name) => {
            let scene = samples::scene(name).ok_or_else(|| unknown(name))?;
            Ok(Loaded { scene, findings: Vec::new() })
        }
        None => frieze::load::load(word, options),
    }
}

/// The NAME of `sample:NAME`.
pub fn sample(word: &Path) -> Option<&str> {
    word.to_str()?.strip_prefix("sample:")
}

fn unknown(name: &str) -> Error {
    let names: Vec<&str> = samples::NAMES.iter().map(|(n, _)| *n).collect();
    Error::arguments("samples.unknown", format!("there is no built-in scene `{name}`{}", did_you_mean(name, &names)))
        .remedy(format!("there are {}", names.join(", ")))
}
