//! What the program says: progress and messages on stderr, one JSON document on stdout.

use crate::args::{Color, Common};
use clap::ColorChoice;
use frieze::error::{Finding, Severity};
use frieze::job::{Job, Progress};
use frieze::{Error, Result};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::io::{IsTerminal, Write};
use std::panic::PanicHookInfo;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// The code of an error about which everything has been said: only its exit code is left.
pub const SAID: &str = "said";

/// The voice of one run.
pub struct Talk {
    /// Whether stdout gets a JSON document.
    pub json: bool,
    /// Whether only errors are wanted.
    pub quiet: bool,
    color: bool,
    bar: ProgressBar,
    cancelled: Arc<AtomicBool>,
}

impl Talk {
    /// As typed.
    pub fn new(common: &Common, choice: ColorChoice) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let set = |name: &str| std::env::var_os(name).is_some_and(|v| !v.is_empty());
        let dumb = std::env::var_os("TERM").is_some_and(|t| t == "dumb");
        let color = match (common.color, choice) {
            (Color::Always, _) | (_, ColorChoice::Always) => true,
            (Color::Never, _) | (_, ColorChoice::Never) => false,
            _ => !set("NO_COLOR") && (set("CLICOLOR_FORCE") || terminal && !dumb),
        };
        let bar = if terminal && !common.quiet && !dumb {
            let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr_with_hz(15));
            // Work that is over at once shows no bar: the first stage draws it.
            bar.set_style(spinner());
            bar
        } else {
            ProgressBar::hidden()
        };
        Talk { json: common.json, quiet: common.quiet, color, bar, cancelled: Arc::default() }
    }

    /// The job of this run: its threads, its memory, its progress bar, and Ctrl-C.
    pub fn job(&self, common: &Common) -> Job {
        let flag = self.cancelled.clone();
        // The second Ctrl-C ends the process at once. Files are written beside their place and renamed,
        // so that leaves no partial picture either. Only one handler can be set; there is only one run.
        let _ = ctrlc::set_handler(move || {
            if flag.swap(true, Relaxed) {
                std::process::exit(130);
            }
        });
        let mut job = Job::builder()
            .threads(common.threads.map_or(0, usize::from))
            .cancel_flag(self.cancelled.clone())
            .on_progress(self.progress());
        if let Some(bytes) = common.max_memory {
            job = job.memory(bytes);
        }
        job.build()
    }

    fn progress(&self) -> impl Fn(Progress) + Send + Sync + use<> {
        let bar = self.bar.clone();
        let stage = Mutex::new(("", 0));
        move |p| {
            if bar.is_hidden() {
                return;
            }
            {
                let mut now = stage.lock().unwrap_or_else(|e| e.into_inner());
                if *now != (p.stage, p.total) {
                    *now = (p.stage, p.total);
                    if p.total == 0 {
                        bar.set_style(spinner());
                        bar.enable_steady_tick(Duration::from_millis(100));
                    } else {
                        bar.disable_steady_tick();
                        bar.set_style(bar_style());
                        bar.set_length(p.total);
                        bar.reset_eta();
                    }
                    bar.set_message(p.stage);
                }
            }
            bar.set_position(p.done);
        }
    }

    /// Takes the progress bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn paint(&self, code: &str, text: &str) -> String {
        if self.color { format!("\x1b[{code}m{text}\x1b[0m") } else { text.to_owned() }
    }

    /// A line of talk, unless quiet.
    pub fn say(&self, text: impl AsRef<str>) {
        if !self.quiet {
            self.bar.suspend(|| to_stderr(text.as_ref()));
        }
    }

    /// Text that was asked for and is no data: shown on stderr even when quiet.
    pub fn show(&self, text: &str) {
        self.bar.suspend(|| to_stderr(text));
    }

    /// What was odd about the files, one paragraph each, unless quiet.
    pub fn findings(&self, findings: &[Finding]) {
        // A broken asset may have thousands; the JSON document has them all.
        const MOST: usize = 20;
        for f in findings.iter().take(MOST) {
            let (word, code) = match f.severity {
                Severity::Note => ("note", "36"),
                Severity::Warning => ("warning", "33;1"),
            };
            let mut text = format!("{}: {} [{}]", self.paint(code, word), f.message, f.code);
            if let Some(place) = place(f.file.as_deref(), f.place.as_deref()) {
                text += &format!("\n  in: {place}");
            }
            if !f.action.is_empty() {
                text += &format!("\n  {}", f.action);
            }
            self.say(text);
        }
        if findings.len() > MOST {
            self.say(format!("... and {} more findings; --json lists them all", findings.len() - MOST));
        }
    }

    /// The error that ended the run: the cause first, then where, then what to do.
    pub fn error(&self, command: Option<&str>, e: &Error) {
        if e.code == SAID {
            return;
        }
        to_stderr(&self.error_text(e));
        if self.json {
            print_json_error(command, e);
        }
    }

    /// A check that failed, on stderr only: its document is that of the verb.
    pub fn failed_check(&self, e: &Error) {
        self.show(&self.error_text(e));
    }

    fn error_text(&self, e: &Error) -> String {
        let mut text = format!("{}: {} [{}]", self.paint("31;1", "error"), e.message, e.code);
        if let Some(place) = place(e.file.as_deref(), e.place.as_deref()) {
            text += &format!("\n  in: {place}");
        }
        if let Some(remedy) = &e.remedy {
            text += &format!("\n  {}: {remedy}", self.paint("36", "help"));
        }
        text
    }

    /// The one JSON document of a run that went well.
    ///
    /// # Errors
    /// As [`data`].
    pub fn document(&self, command: &str, body: impl Serialize) -> Result<()> {
        self.verdict(command, true, body)
    }

    /// The one JSON document of a run that asked for checks: `ok` when all of them passed.
    ///
    /// # Errors
    /// As [`data`].
    pub fn verdict(&self, command: &str, ok: bool, body: impl Serialize) -> Result<()> {
        let body = serde_json::to_value(body).map_err(|e| Error::output("output.json", e.to_string()))?;
        print_json(command, ok, body)
    }
}

fn spinner() -> ProgressStyle {
    ProgressStyle::with_template("{spinner} {msg}").unwrap_or_else(|_| ProgressStyle::default_spinner())
}

fn bar_style() -> ProgressStyle {
    ProgressStyle::with_template("{spinner} {msg:<10} [{bar:32}] {percent:>3}% {eta}")
        .map(|s| s.progress_chars("=> "))
        .unwrap_or_else(|_| ProgressStyle::default_bar())
}

fn place(file: Option<&std::path::Path>, place: Option<&str>) -> Option<String> {
    match (file, place) {
        (Some(f), Some(p)) => Some(format!("{}, {p}", f.display())),
        (Some(f), None) => Some(f.display().to_string()),
        (None, p) => p.map(str::to_owned),
    }
}

/// Writes a line to stderr. When stderr is gone there is nobody left to tell.
fn to_stderr(text: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}

/// Writes data to stdout. A reader that went away (`| head`) has had what it wanted.
///
/// # Errors
/// `output.stdout` when stdout cannot be written.
pub fn data(bytes: &[u8]) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::output("output.stdout", format!("cannot write to stdout: {e}")))
        }
        _ => Ok(()),
    }
}

fn print_json(command: &str, ok: bool, body: Value) -> Result<()> {
    let mut document = Map::new();
    document.insert("frieze".into(), env!("CARGO_PKG_VERSION").into());
    document.insert("command".into(), command.into());
    document.insert("ok".into(), ok.into());
    match body {
        Value::Object(fields) => document.extend(fields),
        other => drop(document.insert("result".into(), other)),
    }
    let text = serde_json::to_string_pretty(&document).map_err(|e| Error::output("output.json", e.to_string()))?;
    data(format!("{text}\n").as_bytes())
}

/// An error as a JSON document on stdout.
pub fn print_json_error(command: Option<&str>, e: &Error) {
    let body = json!({
        "error": {
            "code": e.code,
            "exit": e.fault.exit_code(),
            "message": e.message,
            "file": e.file.as_ref().map(|f| f.display().to_string()),
            "place": e.place,
            "help": e.remedy,
        }
    });
    // Nothing can be said about an error of this one: stdout is gone, the exit code remains.
    let _ = print_json(command.unwrap_or("frieze"), false, body);
}

/// A bug as a JSON document on stdout; its text is on stderr.
pub fn print_json_bug(exit: u8) {
    let body = json!({ "error": {
        "code": "bug", "exit": exit, "message": "frieze has a bug; see stderr",
        "file": null, "place": null, "help": "please report it",
    } });
    let _ = print_json("frieze", false, body);
}

/// The panic hook: a panic is a bug of ours, never of the file, and the reader can help to mend it.
pub fn report_bug(info: &PanicHookInfo<'_>) {
    if frieze::load::decode::is_guarded() {
        return; // it becomes an error that names the file
    }
    let cause = info.payload();
    let cause = cause.downcast_ref::<&str>().copied().or(cause.downcast_ref::<String>().map(String::as_str));
    let at = info.location().map(|l| format!(" ({}:{})", l.file(), l.line())).unwrap_or_default();
    to_stderr(&format!(
        "bug: {}{at}\n  This is a fault of frieze {}, not of your files. Please report it with the command line\n  \
         and, if you can, the file that shows it.",
        cause.unwrap_or("panic without a message"),
        env!("CARGO_PKG_VERSION")
    ));
}
