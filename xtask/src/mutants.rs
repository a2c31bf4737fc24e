//! Mutants: small mistakes, each of which the tests of a technique must notice.
//!
//! `xtask/mutants.toml` lists them. A mutant is put into a copy of the workspace, what its tests live in is built,
//! and every one of its tests must fail there (and pass without it). What does not build proves nothing. The working
//! tree is only read. `docs/techniques.md` says which tests belong to which row; [`check`] holds the two together.

use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

const LIST: &str = "xtask/mutants.toml";
const TABLE: &str = "docs/techniques.md";
/// A test that runs longer hangs.
const PATIENCE: Duration = Duration::from_secs(600);

/// `mutants.toml`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct List {
    mutant: Vec<Mutant>,
    #[serde(default)]
    exempt: Vec<Exempt>,
}

/// A mistake, and who must notice.
#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Mutant {
    /// Rows of `docs/techniques.md`.
    rows: Vec<u32>,
    /// The mistake in words.
    what: String,
    /// Relative to the workspace.
    file: String,
    /// Stands in the file exactly once.
    find: String,
    /// Stands there instead.
    replace: String,
    /// Each of them must fail.
    tests: Vec<String>,
}

/// A test of the table without a mutant.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Exempt {
    test: String,
    why: String,
}

fn list(root: &Path) -> Result<List, String> {
    let text = fs::read_to_string(root.join(LIST)).map_err(|e| format!("{LIST}: {e}"))?;
    toml::from_str(&text).map_err(|e| format!("{LIST}: {e}"))
}

/// What `cargo test` builds to run a test.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Home {
    /// The library's unit tests.
    Library,
    /// An integration test of a package.
    File { package: &'static str, stem: String },
    /// Documentation tests.
    Docs,
}

impl Home {
    /// Of a test as the table writes it: `room::tests::name`, `file::name`, or `doc::module`.
    fn of(root: &Path, test: &str) -> Result<Home, String> {
        let first = test.split("::").next().unwrap_or_default();
        if test.contains("::tests::") {
            return Ok(Home::Library);
        }
        if first == "doc" {
            return Ok(Home::Docs);
        }
        ["frieze", "frieze-cli"]
            .into_iter()
            .find(|package| root.join(format!("crates/{package}/tests/{first}.rs")).exists())
            .map(|package| Home::File { package, stem: first.into() })
            .ok_or_else(|| format!("`{test}` is in no file of tests"))
    }
    fn arguments(&self) -> Vec<&str> {
        match self {
            Home::Library => vec!["-p", "frieze", "--lib"],
            Home::File { package, stem } => vec!["-p", package, "--test", stem],
            Home::Docs => vec!["-p", "frieze", "--doc"],
        }
    }
    fn package(&self) -> &str {
        match self {
            Home::File { package, .. } => package,
            _ => "frieze",
        }
    }
}

/// A test's name as its harness knows it.
fn inner<'a>(home: &Home, test: &'a str) -> &'a str {
    match home {
        Home::Library => test,
        _ => test.split_once("::").map_or(test, |t| t.1),
    }
}

// ------------------------------------------------------------------------------------------- list and table

/// A row of the table and the tests it names.
struct Row {
    number: u32,
    tests: Vec<String>,
    /// "the same" as the row before, or tests of its own.
    tested: bool,
}

/// The rows of `docs/techniques.md`: `| number | technique | room | test | see |`.
fn table(text: &str) -> Vec<Row> {
    let mut rows = Vec::new();
    for line in text.lines().filter(|l| l.starts_with('|')) {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let (Some(number), Some(cell)) = (cells.get(1).and_then(|c| c.parse().ok()), cells.get(4)) else { continue };
        let mut tests = Vec::new();
        let mut rest = *cell;
        while let Some((before, after)) = rest.split_once('`') {
            let Some((code, after)) = after.split_once('`') else { break };
            if before.ends_with("documentation test of ") {
                tests.push(format!("doc::{code}"));
            } else if is_test(code) {
                tests.push(code.to_owned());
            }
            rest = after;
        }
        let tested = !tests.is_empty() || *cell == "the same";
        rows.push(Row { number, tests, tested });
    }
    rows
}

/// `room::tests::name` or `file::name`.
fn is_test(code: &str) -> bool {
    let plain = code.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_' || b == b':');
    plain && code.contains("::")
}

/// What is wrong with the list: mutants that no longer fit their files, rows and tests of the table without a
/// mutant, tests that are not there.
pub fn check(root: &Path) -> Result<Vec<String>, String> {
    let list = list(root)?;
    let text = fs::read_to_string(root.join(TABLE)).map_err(|e| format!("{TABLE}: {e}"))?;
    Ok(faults(root, &list, &table(&text)))
}

fn faults(root: &Path, list: &List, table: &[Row]) -> Vec<String> {
    let mut faults: Vec<String> = list.mutant.iter().filter_map(|m| fits(root, m).err()).collect();
    let killers: BTreeSet<&str> = list.mutant.iter().flat_map(|m| &m.tests).map(String::as_str).collect();
    let exempt: BTreeSet<&str> = list.exempt.iter().map(|e| e.test.as_str()).collect();
    for e in list.exempt.iter().filter(|e| e.why.is_empty() || killers.contains(e.test.as_str())) {
        faults.push(format!("{LIST}: `{}` is exempt without a reason, or has a mutant", e.test));
    }
    let rows: BTreeSet<u32> = list.mutant.iter().flat_map(|m| m.rows.iter().copied()).collect();
    for row in table.iter().filter(|r| r.tested) {
        let excused = row.tests.iter().any(|t| exempt.contains(t.as_str()));
        if !rows.contains(&row.number) && !excused {
            faults.push(format!("{TABLE}: row {} has no mutant in {LIST}", row.number));
        }
        for test in &row.tests {
            if !killers.contains(test.as_str()) && !exempt.contains(test.as_str()) {
                faults.push(format!("{TABLE}: `{test}` has no mutant in {LIST} that it must notice"));
            }
        }
    }
    let sources = sources(root);
    let named: BTreeSet<&str> = table.iter().flat_map(|r| &r.tests).map(String::as_str).collect();
    for test in killers.union(&named).filter(|t| !t.starts_with("doc::")) {
        let function = format!("fn {}()", test.rsplit("::").next().unwrap_or_default());
        if Home::of(root, test).is_err() || !sources.iter().any(|s| s.contains(&function)) {
            faults.push(format!("there is no test `{test}`"));
        }
    }
    faults
}

/// The mutant's file with the mutant in it.
fn fits(root: &Path, m: &Mutant) -> Result<String, String> {
    let text = fs::read_to_string(root.join(&m.file)).map_err(|e| format!("{LIST}: {}: {e}", m.file))?;
    let name = format!("{LIST}: {} ({})", m.what, m.file);
    if m.find == m.replace || m.tests.is_empty() || m.rows.is_empty() {
        return Err(format!("{name}: changes nothing, or has no test or row"));
    }
    match text.matches(&m.find).count() {
        1 => Ok(text.replacen(&m.find, &m.replace, 1)),
        n => Err(format!("{name}: `{}` stands there {n} times, not once", m.find)),
    }
}

/// The text of every Rust file of the packages.
fn sources(root: &Path) -> Vec<String> {
    let mut all = Vec::new();
    visit(&root.join("crates"), &mut |path| {
        if path.extension().is_some_and(|e| e == "rs") {
            all.extend(fs::read_to_string(path));
        }
    });
    all
}

/// Calls `f` for each file below a folder, without what is built or hidden history.
fn visit(dir: &Path, f: &mut dyn FnMut(&Path)) {
    let Ok(entries) = fs::read_dir(dir) else { return };
    let mut paths: Vec<PathBuf> = entries.filter_map(|e| Some(e.ok()?.path())).collect();
    paths.sort();
    for path in paths {
        let name = path.file_name().unwrap_or_default();
        if path.is_symlink() || name == "target" || name == ".git" || name == "shared" {
            continue;
        }
        if path.is_dir() {
            visit(&path, f);
        } else {
            f(&path);
        }
    }
}

// ---------------------------------------------------------------------------------------------------- words

/// `cargo xtask mutants [--list] [--row N]...`
pub fn run(root: &Path, words: &[&str]) -> Result<(), String> {
    let (mut only, mut show) = (Vec::new(), false);
    let mut words = words.iter();
    while let Some(word) = words.next() {
        match *word {
            "--list" => show = true,
            "--row" => only.push(words.next().and_then(|n| n.parse::<u32>().ok()).ok_or("--row takes a number")?),
            word => return Err(format!("mutants: `{word}` is not one of --list, --row N")),
        }
    }
    let faults = check(root)?;
    if !faults.is_empty() {
        return Err(faults.join("\n"));
    }
    let mut mutants = list(root)?.mutant;
    mutants.retain(|m| only.is_empty() || m.rows.iter().any(|r| only.contains(r)));
    if mutants.is_empty() {
        return Err("no mutant is chosen".into());
    }
    if show {
        for m in &mutants {
            println!("{:<8} {}\n         {}", rows_of(m), m.what, m.file);
            m.tests.iter().for_each(|t| println!("         - {t}"));
        }
        println!("{} mutants", mutants.len());
        return Ok(());
    }
    sweep(root, &mutants)
}

fn rows_of(m: &Mutant) -> String {
    m.rows.iter().map(u32::to_string).collect::<Vec<_>>().join(", ")
}

// ---------------------------------------------------------------------------------------------------- sweep

fn sweep(root: &Path, mutants: &[Mutant]) -> Result<(), String> {
    let begin = Instant::now();
    let copy = Sandbox::of(root)?;
    // Without a mutant all must pass, or a failure means nothing.
    let all: BTreeSet<&String> = mutants.iter().flat_map(|m| &m.tests).collect();
    println!("{} tests without a mutant, in {}", all.len(), copy.tree.display());
    let sound = copy.run(&all.iter().map(|t| t.as_str()).collect::<Vec<_>>())?;
    let wrong: Vec<String> =
        sound.iter().filter(|(_, v)| *v != Verdict::Passed).map(|(t, v)| format!("{t}: {}", v.word())).collect();
    if !wrong.is_empty() {
        return Err(format!("these do not pass without a mutant:\n{}", wrong.join("\n")));
    }
    println!("all pass ({} s)\n\n{:<8} {:<10} mutant", begin.elapsed().as_secs(), "rows", "");
    let mut left = 0;
    for m in mutants {
        let start = Instant::now();
        let path = copy.tree.join(&m.file);
        let original = fs::read(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        fs::write(&path, fits(&copy.tree, m)?).map_err(|e| format!("{}: {e}", path.display()))?;
        let tests: Vec<&str> = m.tests.iter().map(String::as_str).collect();
        let verdicts = copy.run(&tests);
        fs::write(&path, original).map_err(|e| format!("{}: {e}", path.display()))?;
        let verdicts = match verdicts {
            Ok(v) => v,
            Err(e) => {
                left += 1;
                println!("{:<8} {:<10} {} ({}): {e}", rows_of(m), "NO BUILD", m.what, m.file);
                continue;
            }
        };
        let killed = verdicts.iter().all(|(_, v)| *v == Verdict::Failed);
        left += usize::from(!killed);
        let word = if killed { "killed" } else { "SURVIVED" };
        println!("{:<8} {word:<10} {} ({} s)", rows_of(m), m.what, start.elapsed().as_secs());
        for (test, verdict) in verdicts.iter().filter(|(_, v)| *v != Verdict::Failed) {
            println!("{:<19} {test}: {}", "", verdict.word());
        }
    }
    println!("\n{} mutants, {} killed ({} s)", mutants.len(), mutants.len() - left, begin.elapsed().as_secs());
    if left > 0 { Err(format!("{left} mutants were not noticed by each of their tests")) } else { Ok(()) }
}

/// What became of a test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    Passed,
    Failed,
    /// It did not end in time: no proof.
    Hung,
    /// The harness knows no such test.
    Missing,
}

impl Verdict {
    fn word(self) -> &'static str {
        match self {
            Verdict::Passed => "passed",
            Verdict::Failed => "failed",
            Verdict::Hung => "did not end",
            Verdict::Missing => "was not found",
        }
    }
    /// From what a harness printed and how it ended; a crash is a failure too.
    fn of(ended: Option<ExitStatus>, output: &str) -> Verdict {
        match ended {
            None => Verdict::Hung,
            Some(_) if output.contains("running 0 tests") => Verdict::Missing,
            Some(status) if status.success() => Verdict::Passed,
            Some(_) => Verdict::Failed,
        }
    }
}

/// The workspace once more, with a target folder of its own. Both stay in the target folder, so the next sweep
/// compiles no dependency.
struct Sandbox {
    tree: PathBuf,
    build: PathBuf,
}

impl Sandbox {
    fn of(root: &Path) -> Result<Sandbox, String> {
        let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), |t| root.join(t));
        let (tree, build) = (target.join("mutants/tree"), target.join("mutants/build"));
        let said = |path: &Path, e: std::io::Error| format!("{}: {e}", path.display());
        let mut wanted = BTreeMap::new();
        visit(root, &mut |path| {
            if let Ok(relative) = path.strip_prefix(root) {
                wanted.insert(tree.join(relative), path.to_owned());
            }
        });
        fs::create_dir_all(&tree).map_err(|e| said(&tree, e))?;
        let mut stale = Vec::new();
        visit(&tree, &mut |path| {
            if !wanted.contains_key(path) {
                stale.push(path.to_owned());
            }
        });
        for path in stale {
            fs::remove_file(&path).map_err(|e| said(&path, e))?;
        }
        for (to, from) in wanted {
            let bytes = fs::read(&from).map_err(|e| said(&from, e))?;
            // Untouched files keep their time, so that they are not built again.
            if fs::read(&to).ok().as_ref() != Some(&bytes) {
                let folder = to.parent().unwrap_or(&tree);
                fs::create_dir_all(folder).map_err(|e| said(folder, e))?;
                fs::write(&to, bytes).map_err(|e| said(&to, e))?;
            }
        }
        Ok(Sandbox { tree, build })
    }

    fn cargo(&self, arguments: &[&str]) -> Command {
        let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
        // Not optimised and without debug information, one change is built in seconds.
        cargo
            .args(arguments)
            .current_dir(&self.tree)
            .env("CARGO_TARGET_DIR", &self.build)
            .env("CARGO_PROFILE_DEV_OPT_LEVEL", "0")
            .env("CARGO_PROFILE_DEV_DEBUG", "0")
            .env("CARGO_INCREMENTAL", "1")
            .env("CARGO_TERM_COLOR", "never");
        quiet(&mut cargo);
        cargo
    }

    /// Builds what the tests live in and runs each by itself. An error says that something did not build.
    fn run<'a>(&self, tests: &[&'a str]) -> Result<Vec<(&'a str, Verdict)>, String> {
        let mut homes: BTreeMap<Home, Vec<&str>> = BTreeMap::new();
        for test in tests {
            homes.entry(Home::of(&self.tree, test)?).or_default().push(test);
        }
        let mut verdicts = Vec::new();
        for (home, tests) in homes {
            let program = if home == Home::Docs { None } else { Some(self.build(&home)?) };
            for test in tests {
                let name = inner(&home, test);
                let (ended, output) = match &program {
                    Some(program) => {
                        let mut harness = Command::new(program);
                        harness.args(["--exact", name]).current_dir(self.tree.join("crates").join(home.package()));
                        self.finish(quiet(&mut harness))?
                    }
                    None => {
                        let mut arguments = vec!["test"];
                        arguments.extend(home.arguments());
                        arguments.extend(["--", name]);
                        let done = self.finish(&mut self.cargo(&arguments))?;
                        if done.1.contains("could not compile") || done.1.contains("Couldn't compile") {
                            return Err(first_error(&done.1));
                        }
                        done
                    }
                };
                verdicts.push((test, Verdict::of(ended, &output)));
            }
        }
        Ok(verdicts)
    }

    /// The harness of a home, built.
    fn build(&self, home: &Home) -> Result<PathBuf, String> {
        let mut arguments = vec!["test", "--no-run", "--message-format=json"];
        arguments.extend(home.arguments());
        let output = self.cargo(&arguments).stdin(Stdio::null()).output().map_err(|e| format!("cargo: {e}"))?;
        let mut program = None;
        let mut error = None;
        for line in String::from_utf8_lossy(&output.stdout).lines() {
            let Ok(message) = serde_json::from_str::<serde_json::Value>(line) else { continue };
            if message["profile"]["test"] == true
                && let Some(path) = message["executable"].as_str()
            {
                program = Some(PathBuf::from(path));
            }
            if message["message"]["level"] == "error" && error.is_none() {
                error = message["message"]["message"].as_str().map(str::to_owned);
            }
        }
        let fault = || error.unwrap_or_else(|| first_error(&String::from_utf8_lossy(&output.stderr)));
        if output.status.success() { program.ok_or_else(|| "cargo built no test".into()) } else { Err(fault()) }
    }

    /// Runs a command to its end; `None` when that did not come in time. What it prints goes through a file: a full
    /// pipe would hang it.
    fn finish(&self, command: &mut Command) -> Result<(Option<ExitStatus>, String), String> {
        let log = self.build.join("output.txt");
        let said = |e: std::io::Error| format!("{}: {e}", log.display());
        let out = fs::File::create(&log).map_err(said)?;
        command.stdin(Stdio::null()).stderr(out.try_clone().map_err(said)?).stdout(out);
        let mut child = command.spawn().map_err(|e| format!("{:?}: {e}", command.get_program()))?;
        let begin = Instant::now();
        let ended = loop {
            if let Some(status) = child.try_wait().map_err(said)? {
                break Some(status);
            }
            if begin.elapsed() > PATIENCE {
                child.kill().and_then(|()| child.wait()).map_err(said)?;
                break None;
            }
            std::thread::sleep(Duration::from_millis(5));
        };
        let bytes = fs::read(&log).map_err(said)?;
        Ok((ended, String::from_utf8_lossy(&bytes).into_owned()))
    }
}

/// Without what would choose a SIMD level or a shorter test, and with room for kernels that are not optimised: all
/// that is inlined into them has a place of its own on the stack.
fn quiet(command: &mut Command) -> &mut Command {
    command.env_remove("FRIEZE_SIMD").env_remove("FRIEZE_BITS").env("RUST_MIN_STACK", "67108864")
}

/// The first line of a compiler's output that says `error`.
fn first_error(output: &str) -> String {
    output.lines().find(|l| l.starts_with("error")).unwrap_or("it does not build").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mutant(find: &str) -> Mutant {
        Mutant {
            rows: vec![5],
            what: "w".into(),
            file: "xtask/src/mutants.rs".into(),
            find: find.into(),
            replace: String::new(),
            tests: vec!["mutants::tests::rows_and_tests_of_the_table".into()],
        }
    }

    #[test]
    fn the_committed_list_fits_the_sources_and_the_table() {
        assert_eq!(check(&crate::root()).unwrap(), [""; 0]);
    }

    #[test]
    fn rows_and_tests_of_the_table() {
        let text = "| row | technique | room | test | see |\n|---|---|---|---|---|\n\
                    | 1 | a | `map/map.rs` | `map::tests::a`, `files::b` (and `Canvas::c`). No more | |\n\
                    | 2 | b | `x.rs` | the same | |\n| 3 | c | `x.rs` | no test yet | |\n\
                    | 4 | d | `x.rs` | the documentation test of `shade::shader` | |\n";
        let rows = table(text);
        let got: Vec<_> = rows.iter().map(|r| (r.number, r.tests.join(" "), r.tested)).collect();
        let want =
            [(1, "map::tests::a files::b", true), (2, "", true), (3, "", false), (4, "doc::shade::shader", true)];
        assert_eq!(got, want.map(|(n, t, b)| (n, t.to_owned(), b)));
    }

    #[test]
    fn what_rots_is_found() {
        let root = crate::root();
        let rows = |tests: &[&str]| {
            vec![Row { number: 6, tests: tests.iter().map(|t| (*t).to_owned()).collect(), tested: true }]
        };
        let list = |find: &str| List { mutant: vec![mutant(find)], exempt: Vec::new() };
        // In pieces, so that it stands in this file once.
        let once = ["Without what would choose", " a SIMD level"].concat();
        assert_eq!(faults(&root, &list(&once), &[]).len(), 1, "its test is none of frieze's");
        assert!(fits(&root, &mutant(&once)).is_ok());
        assert!(fits(&root, &mutant("fn ")).unwrap_err().contains("not once"));
        assert!(fits(&root, &mutant(&["no such", " formula"].concat())).unwrap_err().contains("0 times"));
        // Row 6 has no mutant, its test has none, and there is no such test.
        let all = faults(&root, &list(&once), &rows(&["shade::tests::row_6_nothing"]));
        assert_eq!(all.len(), 4, "{all:?}");
    }

    #[test]
    fn homes_and_names() {
        let root = crate::root();
        let of = |t| Home::of(&root, t).map(|h| (inner(&h, t).to_owned(), h.arguments().join(" ")));
        let want = |a: &str, b: &str| Ok((a.to_owned(), b.to_owned()));
        assert_eq!(of("map::tests::a"), want("map::tests::a", "-p frieze --lib"));
        assert_eq!(of("files::b"), want("b", "-p frieze --test files"));
        assert_eq!(of("program::c"), want("c", "-p frieze-cli --test program"));
        assert_eq!(of("doc::shade::shader"), want("shade::shader", "-p frieze --doc"));
        assert!(of("nowhere::d").is_err());
    }

    #[cfg(unix)]
    #[test]
    fn a_failure_is_told_from_a_missing_test_and_from_none() {
        use std::os::unix::process::ExitStatusExt;
        let status = |n| Some(ExitStatus::from_raw(n));
        assert_eq!(Verdict::of(status(0), "running 1 test\n"), Verdict::Passed);
        assert_eq!(Verdict::of(status(101 << 8), "running 1 test\n"), Verdict::Failed);
        assert_eq!(Verdict::of(status(6), ""), Verdict::Failed);
        assert_eq!(Verdict::of(status(0), "running 0 tests\n"), Verdict::Missing);
        assert_eq!(Verdict::of(None, ""), Verdict::Hung);
    }
}
