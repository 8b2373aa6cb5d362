//! The one error type: every message is a sentence that says where, what is wrong and what to do.

use std::fmt;
use std::path::{Path, PathBuf};

/// What went wrong, by who has to act.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorKind {
    /// The command line, a scene or a mesh is wrong; the user mends it. Exit code 2.
    Input,
    /// A file cannot be read or written. Exit code 2.
    Io,
    /// The memory budget is too small for what must be resident. Exit code 2.
    Budget,
    /// A check that the user asked for did not hold (leaks, images differ). Exit code 1.
    Check,
    /// The user interrupted; what was done has been written. Exit code 130.
    Interrupted,
}

/// An error whose [`fmt::Display`] is one clear sentence.
#[derive(Debug)]
pub struct Error {
    kind: ErrorKind,
    place: Option<(PathBuf, Option<usize>)>,
    message: String,
    source: Option<Box<dyn std::error::Error + Send + Sync>>,
}

/// Shorthand for results of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// Wrong input: `message` says what is wrong and what to do.
    pub fn input(message: impl Into<String>) -> Self {
        Self::new(ErrorKind::Input, message)
    }

    /// An error of any kind.
    pub fn new(kind: ErrorKind, message: impl Into<String>) -> Self {
        Self { kind, place: None, message: message.into(), source: None }
    }

    /// A file could not be used: "cannot read FILE: no such file".
    pub fn io(action: &str, path: &Path, source: std::io::Error) -> Self {
        let message = format!("cannot {action} {}: {source}", path.display());
        Self { kind: ErrorKind::Io, place: None, message, source: Some(Box::new(source)) }
    }

    /// The same error with the file, and if known the line (from 1), it is about.
    pub fn at(mut self, path: &Path, line: Option<usize>) -> Self {
        self.place = Some((path.to_owned(), line));
        self
    }

    /// Who has to act.
    pub fn kind(&self) -> ErrorKind {
        self.kind
    }

    /// The process exit code that stands for this error.
    pub fn exit_code(&self) -> u8 {
        match self.kind {
            ErrorKind::Input | ErrorKind::Io | ErrorKind::Budget => 2,
            ErrorKind::Check => 1,
            ErrorKind::Interrupted => 130,
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.place {
            Some((path, Some(line))) => write!(f, "{}:{line}: {}", path.display(), self.message),
            Some((path, None)) => write!(f, "{}: {}", path.display(), self.message),
            None => f.write_str(&self.message),
        }
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.source.as_deref().map(|e| e as _)
    }
}
