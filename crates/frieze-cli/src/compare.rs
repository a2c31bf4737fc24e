//! `frieze compare`: how two pictures or maps differ, and whether that is too much.

use crate::args::{Common, Compare, did_you_mean};
use crate::talk::{self, Talk};
use clap::ValueEnum;
use frieze::error::{Fault, Finding};
use frieze::image::diff::{self, Options, Report};
use frieze::load::LoadOptions;
use frieze::write::{self, WriteOptions};
use frieze::{Error, Result};
use serde_json::{Map, Value, json};
use std::path::Path;

/// A figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Metric {
    /// Largest difference of two values
    Max,
    /// Root of the mean squared difference
    Rmse,
    /// Peak signal to noise ratio, dB
    Psnr,
    /// Mean FLIP
    Flip,
    /// Mean angle between normals, degrees
    Angle,
}

impl Metric {
    const ALL: [(&str, Metric); 5] = [
        ("max", Metric::Max),
        ("rmse", Metric::Rmse),
        ("psnr", Metric::Psnr),
        ("flip", Metric::Flip),
        ("angle", Metric::Angle),
    ];
    fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, m)| *m == self).map_or("", |(n, _)| n)
    }
}

/// A limit of `--fail-above` or `--fail-below`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limit {
    metric: Metric,
    value: f64,
}

/// Reads the argument of `--fail-above`.
pub fn above(s: &str) -> core::result::Result<Limit, String> {
    let l = limit(s)?;
    if l.metric == Metric::Psnr { Err("more psnr is better: use --fail-below psnr=X".into()) } else { Ok(l) }
}

/// Reads the argument of `--fail-below`.
pub fn below(s: &str) -> core::result::Result<Limit, String> {
    let l = limit(s)?;
    if l.metric == Metric::Psnr {
        Ok(l)
    } else {
        Err(format!("less {0} is better: use --fail-above {0}=X", l.metric.name()))
    }
}

fn limit(s: &str) -> core::result::Result<Limit, String> {
    let (name, value) = s.split_once('=').ok_or("write METRIC=X, such as flip=0.01")?;
    let metric = Metric::ALL.iter().find(|(n, _)| *n == name).map(|(_, m)| *m).ok_or_else(|| {
        let names = Metric::ALL.map(|(n, _)| n);
        format!("there is no metric `{name}`{}; there are {}", did_you_mean(name, &names), names.join(", "))
    })?;
    match value.parse::<f64>() {
        Ok(value) if value < 0.0 && metric != Metric::Psnr => {
            Err(format!("no {name} is below 0: `{value}` would always fail"))
        }
        Ok(value) if value.is_finite() => Ok(Limit { metric, value }),
        _ => Err(format!("`{value}` is not a number")),
    }
}

/// Compares.
pub fn run(a: &Compare, common: &Common, talk: &Talk) -> Result<()> {
    let limits = || a.fail_above.iter().chain(&a.fail_below);
    let asked = |m: Metric| a.metrics.contains(&m) || limits().any(|l| l.metric == m);
    let wanted = |m: Metric| asked(m) || a.metrics.is_empty() && m != Metric::Angle;
    // A limit on the angle means that the maps hold normals; otherwise their names say so.
    let normals = a.normals || asked(Metric::Angle) || (names_normals(&a.a) && names_normals(&a.b));
    let job = talk.job(common);
    let out = WriteOptions { force: common.force, job: job.clone() };
    if let Some(path) = &a.out {
        write::check(path, &[], &out)?;
    }
    // The user has named both files: they may lie anywhere.
    let load = LoadOptions { job: job.clone(), allow_outside: true };
    let (reference, mut findings) = frieze::load::image(&a.a, &load)?;
    let (test, more) = frieze::load::image(&a.b, &load)?;
    findings.extend(more);
    if reference.encoding != test.encoding {
        findings.push(
            Finding::note(
                "compare.encoding",
                "one picture is sRGB and the other linear",
                "max, rmse and psnr are those of linear light",
            )
            .in_file(&a.b),
        );
    }
    let heat_of_flip = a.out.is_some() && !normals;
    let options = Options { job, flip: wanted(Metric::Flip) || heat_of_flip, normals };
    let report = diff::compare(&reference, &test, &options).map_err(|e| match e.code {
        "compare.size" => e.in_file(&a.b),
        _ => e,
    })?;
    talk.finish();
    talk.findings(&findings);
    if let (Some(path), Some(map)) = (&a.out, &report.map) {
        write::image(&diff::heat(map), path, &out)?;
        talk.say(path.display().to_string());
    }
    let shown = |m: Metric| wanted(m) || m == Metric::Angle && normals;
    let checks: Vec<Check> = a
        .fail_above
        .iter()
        .map(|l| Check::new(*l, &report, false))
        .chain(a.fail_below.iter().map(|l| Check::new(*l, &report, true)))
        .collect();
    if talk.json {
        let passed = checks.iter().all(|c| c.passed);
        talk.verdict("compare", passed, document(a, &report, &findings, &checks, shown))?;
    } else if !talk.quiet {
        talk::data(text(&report, &checks, shown).as_bytes())?;
    }
    let failed: Vec<String> = checks.iter().filter(|c| !c.passed).map(Check::sentence).collect();
    if failed.is_empty() {
        return Ok(());
    }
    // The document on stdout already says which checks failed: it is the only one.
    talk.failed_check(&Error::new(Fault::Check, "compare.differs", failed.join("; ")).in_file(&a.b));
    Err(Error::new(Fault::Check, talk::SAID, ""))
}

fn names_normals(path: &Path) -> bool {
    let stem = path.file_stem().map(|s| s.to_string_lossy().to_lowercase()).unwrap_or_default();
    ["normal", "nrm", "norm", "n"].iter().any(|w| stem == *w || stem.ends_with(&format!("_{w}")))
        || stem.contains("normal")
}

fn figure(m: Metric, r: &Report) -> Option<f64> {
    match m {
        Metric::Max => Some(r.max),
        Metric::Rmse => Some(r.rmse),
        Metric::Psnr => Some(r.psnr),
        Metric::Flip => r.flip,
        Metric::Angle => r.angle.map(|a| a.mean),
    }
}

struct Check {
    limit: Limit,
    below: bool,
    value: f64,
    passed: bool,
}

impl Check {
    fn new(limit: Limit, report: &Report, below: bool) -> Self {
        let value = figure(limit.metric, report).unwrap_or(f64::NAN);
        // A NaN passes nothing.
        let passed = if below { value >= limit.value } else { value <= limit.value };
        Check { limit, below, value, passed }
    }
    fn sentence(&self) -> String {
        let word = if self.below { "below" } else { "above" };
        format!("{} is {}, {word} {}", self.limit.metric.name(), short(self.value), short(self.limit.value))
    }
}

/// Six significant digits.
fn short(v: f64) -> String {
    if v != 0.0 && v.abs() < 1e-4 { format!("{v:.3e}") } else { format!("{v:.6}") }
}

fn text(r: &Report, checks: &[Check], shown: impl Fn(Metric) -> bool) -> String {
    let mut text = String::new();
    if r.identical {
        text += "identical\n";
    }
    for (name, m) in Metric::ALL.into_iter().filter(|(_, m)| shown(*m)) {
        let Some(v) = figure(m, r) else { continue };
        let value = if v.is_infinite() { "infinite".to_owned() } else { short(v) };
        let name = if m == Metric::Flip && r.hdr { "hdr-flip" } else { name };
        text += &format!("{name:<9} {value}");
        text += match m {
            Metric::Psnr if v.is_finite() => " dB",
            Metric::Angle => " degrees (mean)",
            _ => "",
        };
        text.push('\n');
        if let (Metric::Angle, Some(a)) = (m, r.angle) {
            text += &format!("{:<9} {} degrees (largest)\n", "", short(a.max));
        }
    }
    if r.not_finite > 0 {
        text += &format!("{} pixels are not finite in one picture only\n", r.not_finite);
    }
    for c in checks {
        text += &format!("{}: {}\n", if c.passed { "passed" } else { "failed" }, check_text(c));
    }
    text
}

fn check_text(c: &Check) -> String {
    format!("{} {} {}", c.limit.metric.name(), if c.below { ">=" } else { "<=" }, short(c.limit.value))
}

fn document(a: &Compare, r: &Report, findings: &[Finding], checks: &[Check], shown: impl Fn(Metric) -> bool) -> Value {
    // Infinities have no JSON number: null, with `identical` or `not_finite` telling why.
    let number = |v: f64| if v.is_finite() { json!(v) } else { Value::Null };
    let mut metrics = Map::new();
    for (name, m) in Metric::ALL.into_iter().filter(|(_, m)| shown(*m)) {
        match (m, r.angle) {
            (Metric::Angle, Some(angle)) => {
                metrics.insert(name.into(), json!({ "mean": angle.mean, "max": angle.max }));
            }
            _ => {
                let v = figure(m, r).map_or(Value::Null, number);
                metrics.insert(name.into(), v);
            }
        }
    }
    json!({
        "a": a.a.display().to_string(),
        "b": a.b.display().to_string(),
        "identical": r.identical,
        "not_finite": r.not_finite,
        "hdr": r.hdr,
        "metrics": metrics,
        "checks": checks.iter().map(|c| json!({
            "check": check_text(c), "metric": c.limit.metric.name(), "limit": c.limit.value,
            "value": number(c.value), "passed": c.passed,
        })).collect::<Vec<_>>(),
        "passed": checks.iter().all(|c| c.passed),
        "outputs": a.out.iter().map(|p| p.display().to_string()).collect::<Vec<_>>(),
        "findings": findings,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_read() {
        assert_eq!(above("flip=0.01"), Ok(Limit { metric: Metric::Flip, value: 0.01 }));
        assert!(below("psnr=40").is_ok());
        for wrong in ["psnr=40", "flip", "flip=", "flip=x", "fip=1", "flip=inf", "flip=-1"] {
            assert!(above(wrong).is_err(), "{wrong}");
        }
        assert!(below("rmse=1").is_err());
        assert!(above("fip=1").unwrap_err().contains("`flip`"));
    }

    #[test]
    fn normal_maps_are_known_by_name() {
        for (name, is) in [("normal.png", true), ("wood_n.png", true), ("wood_nrm.exr", true), ("WoodNormal.png", true)]
            .into_iter()
            .chain([("sun.png", false), ("a.png", false), ("n2.png", false)])
        {
            assert_eq!(names_normals(Path::new(name)), is, "{name}");
        }
    }
}
