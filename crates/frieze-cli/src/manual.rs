//! Completions, man pages and the JSON schema.

use crate::args::{Cli, Common};
use crate::talk::{self, Talk};
use clap::CommandFactory;
use frieze::{Error, Result};
use serde_json::json;
use std::path::Path;

/// Prints the completion script of a shell.
pub fn completions(shell: clap_complete::Shell) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "frieze", &mut script);
    talk::data(&script)
}

/// Prints the schema of what `--json` prints.
pub fn schema() -> Result<()> {
    talk::data(include_bytes!("../schema.json"))
}

/// Writes a man page per command.
pub fn man(dir: &Path, common: &Common, talk: &Talk) -> Result<()> {
    let mut command = Cli::command();
    command.build();
    let mut pages = vec![(dir.join("frieze.1"), page(command.clone())?)];
    for sub in command.get_subcommands().filter(|s| !s.is_hide_set() && s.get_name() != "help") {
        let name = format!("frieze-{}", sub.get_name());
        let path = dir.join(format!("{name}.1"));
        pages.push((path, page(sub.clone().name(name))?));
    }
    if !common.force {
        if let Some((path, _)) = pages.iter().find(|(p, _)| p.exists()) {
            return Err(Error::arguments("write.exists", "the file is already there")
                .in_file(path)
                .remedy("use --force to overwrite it"));
        }
    }
    let failed =
        |path: &Path, e: std::io::Error| Error::output("write.failed", format!("cannot be written: {e}")).in_file(path);
    std::fs::create_dir_all(dir).map_err(|e| failed(dir, e))?;
    for (path, text) in &pages {
        std::fs::write(path, text).map_err(|e| failed(path, e))?;
    }
    let list: Vec<String> = pages.iter().map(|(p, _)| p.display().to_string()).collect();
    if talk.json {
        return talk.document("man", json!({ "outputs": list }));
    }
    talk.say(format!("{} man pages in {}", list.len(), dir.display()));
    Ok(())
}

fn page(command: clap::Command) -> Result<Vec<u8>> {
    let mut text = Vec::new();
    clap_mangen::Man::new(command)
        .render(&mut text)
        .map_err(|e| Error::output("output.man", format!("cannot make a man page: {e}")))?;
    Ok(text)
}
