//! What can go wrong, sorted by who can mend it, and what is odd but can be shown anyway.

use std::fmt;
use std::path::{Path, PathBuf};

/// The result of every verb.
pub type Result<T> = std::result::Result<T, Error>;

/// Who can mend it; decides the exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// A check that was asked for failed (exit 1).
    Check,
    /// The caller asked for something that does not exist or does not fit together (exit 2).
    Arguments,
    /// A file that we read is broken or unsupported (exit 3).
    Input,
    /// The work needs more memory than was allowed (exit 4).
    Memory,
    /// We cannot write the result (exit 5).
    Output,
    /// The caller cancelled (exit 130).
    Interrupted,
}

impl Fault {
    /// The exit code of the program.
    pub fn exit_code(self) -> u8 {
        match self {
            Fault::Check => 1,
            Fault::Arguments => 2,
            Fault::Input => 3,
            Fault::Memory => 4,
            Fault::Output => 5,
            Fault::Interrupted => 130,
        }
    }
}

/// An error that ends the work: what happened, where, and what to do about it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error {
    /// Who can mend it.
    pub fault: Fault,
    /// A stable, dotted code for programs, such as `gltf.index-out-of-range`.
    pub code: &'static str,
    /// What happened, one line, no file name.
    pub message: String,
    /// The file it happened in.
    pub file: Option<PathBuf>,
    /// Where in the file: a line, a JSON pointer, a byte offset, a chunk.
    pub place: Option<String>,
    /// What the reader can do.
    pub remedy: Option<String>,
}

impl Error {
    /// An error of the given fault and code.
    pub fn new(fault: Fault, code: &'static str, message: impl Into<String>) -> Self {
        Error { fault, code, message: message.into(), file: None, place: None, remedy: None }
    }
    /// The caller's arguments are wrong.
    pub fn arguments(code: &'static str, message: impl Into<String>) -> Self {
        Self::new(Fault::Arguments, code, message)
    }
    /// A file that was read is wrong.
    pub fn input(code: &'static str, message: impl Into<String>) -> Self {
        Self::new(Fault::Input, code, message)
    }
    /// Something cannot be written.
    pub fn output(code: &'static str, message: impl Into<String>) -> Self {
        Self::new(Fault::Output, code, message)
    }
    /// Adds the file, unless an inner room has already named one.
    pub fn in_file(mut self, file: impl AsRef<Path>) -> Self {
        self.file.get_or_insert_with(|| file.as_ref().to_owned());
        self
    }
    /// Adds the place in the file, unless already named.
    pub fn at(mut self, place: impl Into<String>) -> Self {
        self.place.get_or_insert_with(|| place.into());
        self
    }
    /// Adds what to do.
    pub fn remedy(mut self, remedy: impl Into<String>) -> Self {
        self.remedy = Some(remedy.into());
        self
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{}: ", file.display())?;
        }
        if let Some(place) = &self.place {
            write!(f, "{place}: ")?;
        }
        f.write_str(&self.message)?;
        if let Some(remedy) = &self.remedy {
            write!(f, "\n  {remedy}")?;
        }
        Ok(())
    }
}

impl std::error::Error for Error {}

/// How much a finding matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Worth knowing; the picture is as meant.
    Note,
    /// Something was left out or guessed; the picture may differ from what was meant.
    Warning,
}

/// Something odd about an asset that could be shown anyway.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Finding {
    /// A stable, dotted code for programs, such as `gltf.extension-ignored`.
    pub code: &'static str,
    /// How much it matters.
    pub severity: Severity,
    /// What was found, one line.
    pub message: String,
    /// The file.
    pub file: Option<PathBuf>,
    /// Where in the file.
    pub place: Option<String>,
    /// What was done about it, and what the reader can do.
    pub action: String,
}

impl Finding {
    /// A warning: something was left out or guessed.
    pub fn warning(code: &'static str, message: impl Into<String>, action: impl Into<String>) -> Self {
        Finding {
            code,
            severity: Severity::Warning,
            message: message.into(),
            file: None,
            place: None,
            action: action.into(),
        }
    }
    /// A note: worth knowing, nothing lost.
    pub fn note(code: &'static str, message: impl Into<String>, action: impl Into<String>) -> Self {
        Finding { severity: Severity::Note, ..Self::warning(code, message, action) }
    }
    /// Adds the file, unless already named.
    pub fn in_file(mut self, file: impl AsRef<Path>) -> Self {
        self.file.get_or_insert_with(|| file.as_ref().to_owned());
        self
    }
    /// Adds the place, unless already named.
    pub fn at(mut self, place: impl Into<String>) -> Self {
        self.place.get_or_insert_with(|| place.into());
        self
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{}: ", file.display())?;
        }
        if let Some(place) = &self.place {
            write!(f, "{place}: ")?;
        }
        write!(f, "{}; {} [{}]", self.message, self.action, self.code)
    }
}
