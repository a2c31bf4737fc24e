//! `--version`, and which SIMD level is used.

use crate::talk::{self, Talk};
use frieze::math::lane::Level;
use frieze::{Error, Result};
use serde_json::json;

/// The SIMD level that `FRIEZE_SIMD` asks for, or the best of this processor.
///
/// # Errors
/// `simd.unknown`, `simd.unavailable`: a word that names no level, or one that this processor lacks.
pub fn level() -> Result<Level> {
    let Some(word) = std::env::var_os("FRIEZE_SIMD").filter(|w| !w.is_empty()) else { return Ok(Level::best()) };
    let word = word.to_string_lossy();
    if let Some(level) = Level::named(&word) {
        return Ok(level);
    }
    let has = names().join(", ");
    let error = if Level::NAMES.contains(&&*word) {
        Error::arguments("simd.unavailable", format!("FRIEZE_SIMD asks for {word}, which this processor lacks"))
    } else {
        let near = crate::args::did_you_mean(&word, &Level::NAMES);
        Error::arguments("simd.unknown", format!("FRIEZE_SIMD names no SIMD level: `{word}`{near}"))
    };
    Err(error.remedy(format!("this processor has {has}; without FRIEZE_SIMD the last of them is used")))
}

fn names() -> Vec<&'static str> {
    Level::available().iter().map(|l| l.name()).collect()
}

/// Prints the version.
pub fn run(talk: &Talk) -> Result<()> {
    if talk.json {
        let body = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "target": { "arch": std::env::consts::ARCH, "os": std::env::consts::OS },
            "simd": { "available": names(), "chosen": level()?.name() },
        });
        return talk.document("version", body);
    }
    talk::data(format!("frieze {}\n", env!("CARGO_PKG_VERSION")).as_bytes())
}
