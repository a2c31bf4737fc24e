//! Instructions of six kernels, counted by valgrind: the same on every machine, so a change is seen at once.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// Stages of `benches/stages.rs`.
const KERNELS: [&str; 6] = ["cook", "transform-bin", "raster", "lookup", "shade", "encode"];
/// A later change of more than this share needs its reason.
const ALLOWED: f64 = 0.03;

/// Counts and compares with `xtask/counts.txt`, or writes it anew.
pub fn run(root: &Path, accept: bool) -> Result<(), String> {
    let table = root.join("xtask/counts.txt");
    let old = std::fs::read_to_string(&table).unwrap_or_default();
    let old: BTreeMap<&str, u64> =
        old.lines().filter_map(|l| l.split_once(' ')).filter_map(|(k, n)| Some((k, n.trim().parse().ok()?))).collect();
    let program = program(root)?;
    let (mut text, mut far) = (String::new(), Vec::new());
    for name in KERNELS {
        let new = count(&root.join(&program), name)?;
        text += &format!("{name} {new}\n");
        let share = old.get(name).map(|&n| new as f64 / n as f64 - 1.0);
        println!("{name:16}{new:14} instructions  {}", share.map_or("new".into(), |s| format!("{:+.2} %", s * 100.0)));
        if share.is_none_or(|s| s.abs() > ALLOWED) {
            far.push(name);
        }
    }
    if accept {
        return std::fs::write(&table, text).map_err(|e| format!("{}: {e}", table.display()));
    }
    match far[..] {
        [] => Ok(()),
        _ => Err(format!(
            "{}: more than {} % from xtask/counts.txt; if that is meant, run with --accept and say why in the commit",
            far.join(", "),
            ALLOWED * 100.0
        )),
    }
}

/// Builds the bench; where it lies.
fn program(root: &Path) -> Result<String, String> {
    let built = Command::new("cargo")
        .args(["bench", "--package", "frieze", "--bench", "stages", "--no-run"])
        .current_dir(root)
        .output()
        .map_err(|e| format!("cargo: {e}"))?;
    let said = String::from_utf8_lossy(&built.stderr).into_owned();
    let path = said.rsplit_once("benches/stages.rs (").and_then(|(_, rest)| rest.split_once(')'));
    path.map(|(path, _)| path.to_owned()).ok_or(said)
}

fn count(program: &Path, kernel: &str) -> Result<u64, String> {
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null", "--collect-atstart=no"])
        .arg("--toggle-collect=stages::counted*")
        .arg(program)
        .args(["count", kernel, "1"])
        // What valgrind knows, and what most machines have.
        .env("FRIEZE_SIMD", "avx2")
        .output()
        .map_err(|e| format!("valgrind: {e} (Debian: apt-get install valgrind)"))?;
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let found = said.lines().find_map(|l| l.split_once("Collected :")).and_then(|(_, n)| n.trim().parse().ok());
    found.filter(|&n| n > 0).ok_or(format!("{kernel} was not counted: {said}"))
}
