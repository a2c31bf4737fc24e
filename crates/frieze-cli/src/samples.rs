//! `frieze samples`: the built-in scenes.

use crate::talk::{self, Talk};
use frieze::{Result, samples};
use serde_json::{Value, json};

/// Lists them.
pub fn run(talk: &Talk) -> Result<()> {
    if talk.json {
        let list: Vec<Value> = samples::NAMES
            .iter()
            .map(|(name, about)| json!({ "name": format!("sample:{name}"), "about": about }))
            .collect();
        return talk.document("samples", json!({ "samples": list }));
    }
    let width = samples::NAMES.iter().map(|(n, _)| n.len()).max().unwrap_or(0);
    let text: String = samples::NAMES.iter().map(|(n, about)| format!("sample:{n:width$}  {about}\n")).collect();
    talk::data(text.as_bytes())
}
