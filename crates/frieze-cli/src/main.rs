//! The program `frieze`: what was typed, what was meant, a verb of the library, an exit code.
//!
//! stdout is data, stderr is talk. Exit codes: 0 done; 1 the check that was asked for failed; 2 bad
//! arguments; 3 bad input file; 4 over the memory that was allowed; 5 cannot write; 130 interrupted; and
//! 70 (`EX_SOFTWARE`) for a bug of ours, so that a script never takes one for a broken file.

mod args;
mod bench;
mod compare;
mod convert;
mod convert_fix;
mod explain;
mod games101;
mod inspect;
mod manual;
mod preview;
mod render;
mod samples;
mod source;
mod talk;
mod version;
mod view;

use args::{Cli, Verb};
use clap::{ColorChoice, CommandFactory, FromArgMatches};
use frieze::error::Fault;
use frieze::{Error, Result};
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;
use talk::Talk;

/// The exit code of a bug: `EX_SOFTWARE` of sysexits.h.
const BUG: u8 = 70;

fn main() -> ExitCode {
    std::panic::set_hook(Box::new(talk::report_bug));
    let words: Vec<OsString> = std::env::args_os().collect();
    ExitCode::from(catch_unwind(AssertUnwindSafe(|| run(&words))).unwrap_or_else(|_| {
        if said(&words, "--json") {
            talk::print_json_bug(BUG);
        }
        BUG
    }))
}

/// Does what was typed and returns the exit code.
fn run(words: &[OsString]) -> u8 {
    // Wanted before clap has spoken, because its own errors obey them too.
    let json = said(words, "--json");
    let color = color_choice(words);
    let matches = match Cli::command().color(color).try_get_matches_from(words) {
        Ok(matches) => matches,
        Err(e) if !e.use_stderr() => {
            // Help. A reader that went away is not an error.
            let _ = e.print();
            return 0;
        }
        Err(e) => {
            let _ = e.print();
            if json {
                let text = e.render().to_string();
                let message = text.lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned();
                let error = Error::arguments("arguments.usage", message).remedy("see `frieze --help`");
                talk::print_json_error(None, &error);
            }
            return Fault::Arguments.exit_code();
        }
    };
    let cli = match Cli::from_arg_matches(&matches) {
        Ok(cli) => cli,
        Err(e) => e.exit(),
    };
    let talk = Talk::new(&cli.common, color);
    let name = matches.subcommand_name();
    match dispatch(cli, &talk) {
        Ok(()) => 0,
        Err(e) => {
            talk.finish();
            talk.error(name, &e);
            e.fault.exit_code()
        }
    }
}

fn dispatch(cli: Cli, talk: &Talk) -> Result<()> {
    if cli.version {
        return version::run(talk);
    }
    let common = &cli.common;
    match cli.verb {
        None => Err(Error::arguments("arguments.usage", "no command was given").remedy("see `frieze --help`")),
        Some(Verb::Render(a)) => render::run(&a, common, talk),
        Some(Verb::Compare(a)) => compare::run(&a, common, talk),
        Some(Verb::Convert(a)) => convert::run(&a, common, talk),
        Some(Verb::Inspect(a)) => inspect::run(&a, common, talk),
        Some(Verb::Explain(a)) => explain::run(&a, common, talk),
        Some(Verb::Games101(a)) => games101::run(&a, common, talk),
        Some(Verb::Samples) => samples::run(talk),
        Some(Verb::Completions { shell }) => manual::completions(shell),
        Some(Verb::Man { out }) => manual::man(&out, common, talk),
        Some(Verb::Schema) => manual::schema(),
    }
}

/// Whether a flag was typed.
fn said(words: &[OsString], flag: &str) -> bool {
    words.iter().skip(1).take_while(|w| *w != "--").any(|w| w == flag)
}

/// `--color` as typed, or what the environment asks for (`NO_COLOR`, `CLICOLOR_FORCE`, a dumb terminal).
fn color_choice(words: &[OsString]) -> ColorChoice {
    let mut typed = None;
    let mut words = words.iter().skip(1).take_while(|w| *w != "--").filter_map(|w| w.to_str());
    while let Some(word) = words.next() {
        match word.strip_prefix("--color") {
            Some("") => typed = words.next(),
            Some(rest) => typed = rest.strip_prefix('='),
            None => {}
        }
    }
    match typed {
        Some("always") => ColorChoice::Always,
        Some("never") => ColorChoice::Never,
        _ => ColorChoice::Auto,
    }
}
