//! `frieze convert --fix`: mends a normal map and says what it did and why.

use crate::args::{Common, did_you_mean};
use crate::talk::Talk;
use frieze::Result;
use frieze::bake::repair::{Fix, Options, repair};
use frieze::load::LoadOptions;
use frieze::write::{self, WriteOptions};
use serde_json::json;
use std::path::Path;

/// A word of `--fix`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Issue {
    /// Whatever is found wrong for certain.
    Auto,
    /// This, as asked.
    Fix(Fix),
}

/// Reads a word of `--fix`.
pub fn issue(s: &str) -> std::result::Result<Issue, String> {
    if s == "auto" {
        return Ok(Issue::Auto);
    }
    Fix::ALL.iter().find(|(name, _)| *name == s).map(|(_, f)| Issue::Fix(*f)).ok_or_else(|| {
        let names: Vec<&str> = ["auto"].into_iter().chain(Fix::ALL.iter().map(|(n, _)| *n)).collect();
        format!("`{s}` is nothing that can be mended{}; there are {}", did_you_mean(s, &names), names.join(", "))
    })
}

/// Mends `map` into `out`.
pub fn fix(map: &Path, out: &Path, issues: &[Issue], common: &Common, talk: &Talk) -> Result<()> {
    let job = talk.job(common);
    let options = WriteOptions { force: common.force, job: job.clone() };
    write::check(out, &[], &options)?;
    // The user has named the file: it may lie anywhere.
    let (image, mut findings) = frieze::load::image(map, &LoadOptions { job: job.clone(), allow_outside: true })?;
    let fixes = issues.iter().filter_map(|i| if let Issue::Fix(f) = i { Some(*f) } else { None }).collect();
    let auto = issues.contains(&Issue::Auto);
    let mended = repair(&image, &Options { fixes, auto, job, ..Options::default() }).map_err(|e| e.in_file(map))?;
    findings.extend(mended.findings.into_iter().map(|f| f.in_file(map)));
    write::image(&mended.image, out, &options)?;
    talk.finish();
    talk.findings(&findings);
    if talk.json {
        return talk.document(
            "convert",
            json!({
                "file": map.display().to_string(),
                "output": out.display().to_string(),
                "steps": mended.steps,
                "before": mended.before,
                "findings": findings,
            }),
        );
    }
    for s in &mended.steps {
        talk.say(format!("{}: {} (confidence {:.0} %)", s.fix, s.why, s.confidence * 100.0));
    }
    if mended.steps.is_empty() {
        talk.say("nothing was mended");
    }
    talk.say(out.display().to_string());
    Ok(())
}

#[test]
fn words_of_fix() {
    assert_eq!(issue("auto"), Ok(Issue::Auto));
    assert_eq!(issue("flip-y"), Ok(Issue::Fix(Fix::FlipY)));
    assert!(issue("flipy").unwrap_err().contains("flip-y"));
}
