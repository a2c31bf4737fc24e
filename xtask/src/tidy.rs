//! Tidiness that no lint holds: file lengths, words that must not be committed, documents that are named, mutants
//! that no longer fit.

use std::fs;
use std::path::{Path, PathBuf};

/// Longest source file, lines; longer ones become folders.
const LONGEST: usize = 900;

/// Checks all committed text.
pub fn run(root: &Path) -> Result<(), String> {
    let mut faults = Vec::new();
    let files = text_files(root)?;
    for path in &files {
        let Ok(text) = fs::read_to_string(path) else { continue };
        let name = path.strip_prefix(root).unwrap_or(path);
        check(name, &text, &mut faults);
        if name.extension().is_some_and(|e| e == "md") {
            for link in links(&text) {
                if !path.with_file_name(&link).exists() {
                    faults.push(format!("{}: names {link}, which does not exist", name.display()));
                }
            }
        }
    }
    for room in ["utils.rs", "common.rs", "helpers.rs", "mod.rs"] {
        for path in files.iter().filter(|p| p.file_name().is_some_and(|n| n == room)) {
            faults.push(format!("{}: name the room after what it holds", path.display()));
        }
    }
    faults.extend(crate::mutants::check(root)?);
    if faults.is_empty() {
        println!("{} files are tidy", files.len());
        return Ok(());
    }
    Err(faults.join("\n"))
}

fn check(name: &Path, text: &str, faults: &mut Vec<String>) {
    let source = name.extension().is_some_and(|e| e == "rs");
    let lines = text.lines().count();
    if source && lines > LONGEST {
        faults.push(format!("{}: {lines} lines, more than {LONGEST}: make it a folder", name.display()));
    }
    // In pieces, so that this file is tidy itself.
    let forbidden = [
        ["todo", "!("].concat(),
        ["unimplemented", "!("].concat(),
        ["dbg", "!("].concat(),
        ["FIX", "ME"].concat(),
        ["XX", "X:"].concat(),
        ["/ho", "me/"].concat(),
        ["/wo", "rk/"].concat(),
        ["/ro", "ot/"].concat(),
        ["sha", "red/mission"].concat(),
        ["sha", "red/design"].concat(),
    ];
    for (k, line) in text.lines().enumerate() {
        for word in forbidden.iter().filter(|w| line.contains(w.as_str())) {
            faults.push(format!("{}:{}: `{word}` has no place in a commit", name.display(), k + 1));
        }
        if source && line.trim_end() != line {
            faults.push(format!("{}:{}: space at the end of the line", name.display(), k + 1));
        }
    }
}

/// Relative links of a Markdown text, without anchors.
fn links(text: &str) -> Vec<String> {
    let ends = text.match_indices("](").map(|(k, _)| &text[k + 2..]);
    ends.filter_map(|rest| rest.split([')', ' ', '#']).next())
        .filter(|l| !l.is_empty() && !l.contains("://") && !l.starts_with("mailto:"))
        .map(str::to_owned)
        .collect()
}

/// Source, manifests and documents, without what is built, in order.
fn text_files(root: &Path) -> Result<Vec<PathBuf>, String> {
    let mut all = Vec::new();
    let mut folders = vec![root.to_owned()];
    while let Some(dir) = folders.pop() {
        for entry in fs::read_dir(&dir).map_err(|e| format!("{}: {e}", dir.display()))? {
            let path = entry.map_err(|e| e.to_string())?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if path.is_symlink() || name == "target" || name == "shared" || name == ".git" {
                continue;
            }
            let ending = path.extension().unwrap_or_default().to_string_lossy().into_owned();
            if path.is_dir() {
                folders.push(path);
            } else if ["rs", "md", "toml", "json", "py", "sh"].contains(&&*ending) {
                all.push(path);
            }
        }
    }
    all.sort();
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_files_and_forbidden_words_are_found() {
        let mut faults = Vec::new();
        check(Path::new("a.rs"), &"\n".repeat(901), &mut faults);
        check(Path::new("b.rs"), &["let x = to", "do!(); "].concat(), &mut faults);
        assert_eq!(faults.len(), 3, "{faults:?}");
        faults.clear();
        check(Path::new("a.md"), &"fine\n".repeat(2000), &mut faults);
        assert!(faults.is_empty());
    }

    #[test]
    fn links_are_found() {
        assert_eq!(links("[a](b.md) [c](https://x) ![d](e/f.png#g) [h](#i)"), ["b.md", "e/f.png"]);
    }
}
