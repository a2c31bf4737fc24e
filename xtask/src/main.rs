//! Chores of the workspace; `cargo xtask help` lists them.
//!
//! (`cargo xtask` is `cargo run --package xtask --`, see `.cargo/config.toml`.)
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that talks")]

mod counts;
mod golden;
mod mutants;
mod sweep;
mod tidy;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

const HELP: &str = "\
cargo xtask golden            render the golden pictures anew and show what changed
cargo xtask golden --accept   the same, and put the changed ones in place: only after a look at them
cargo xtask mutants           put small mistakes into a copy of the sources: the tests of each technique must notice
cargo xtask mutants --row 23  those of one row (may be given again); --list only shows them
cargo xtask counts            count the instructions of six kernels (valgrind) and compare with xtask/counts.txt
cargo xtask counts --accept   the same, and write the table anew: say why in the commit
cargo xtask sweep             every scene in full size at every SIMD level and thread count: the same bytes (long)
cargo xtask tidy              short files, no forbidden words, every document and link that is named exists";

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let result = match words[..] {
        ["golden"] => golden::run(&root(), false),
        ["golden", "--accept"] => golden::run(&root(), true),
        ["mutants", ref rest @ ..] => mutants::run(&root(), rest),
        ["counts"] => counts::run(&root(), false),
        ["counts", "--accept"] => counts::run(&root(), true),
        ["sweep"] => sweep::run(),
        ["tidy"] => tidy::run(&root()),
        ["help" | "--help" | "-h"] => {
            println!("{HELP}");
            return ExitCode::SUCCESS;
        }
        _ => {
            eprintln!("{HELP}");
            return ExitCode::from(2);
        }
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("{e}");
            ExitCode::FAILURE
        }
    }
}

/// The workspace.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask lies in the workspace").to_owned()
}
