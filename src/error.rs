//! One error type for the library: whose fault it is, where, what was found and expected, and what to do about it.
//!
//! The variant says whose fault it is, and so fixes the exit code of the command line (`Error::exit_code`).

use std::path::{Path, PathBuf};

pub type Result<T> = std::result::Result<T, Error>;

#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The command line was used wrongly. Exit code 2.
    #[error("{message}")]
    Usage { message: String, help: String },

    /// The graph is wrong; all its problems at once, each with its place in the text. Exit code 2.
    #[error("{}", crate::graph::problem::summary(.problems))]
    Graph { path: PathBuf, source_text: String, problems: Vec<crate::graph::problem::Problem> },

    /// An input file is missing, damaged, or of a kind that is not read. Exit code 3.
    #[error("{}: {message}", .path.display())]
    File { path: PathBuf, message: String, help: String },

    /// A node cannot compute what it is asked for from the inputs that it got. Exit code 1.
    #[error("{message}")]
    Compute { message: String, help: String },

    /// A device that was asked for is not there, or failed. Exit code 4.
    #[error("{message}")]
    Device { message: String, help: String },

    /// An output cannot be written; what was there before is untouched. Exit code 1.
    #[error("cannot write {}: {message}", .path.display())]
    Output { path: PathBuf, message: String, help: String },

    /// The user or the caller stopped the work. Exit code 1.
    #[error("cancelled")]
    Cancelled,

    /// Any of the above, with the node that met it.
    #[error("node \"{node}\" ({kind}): {error}")]
    AtNode { node: String, kind: String, error: Box<Error> },
}

impl Error {
    pub fn usage(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Usage { message: message.into(), help: help.into() }
    }

    pub fn file(path: &Path, message: impl Into<String>, help: impl Into<String>) -> Self {
        Self::File { path: path.to_owned(), message: message.into(), help: help.into() }
    }

    pub fn compute(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Compute { message: message.into(), help: help.into() }
    }

    pub fn device(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Device { message: message.into(), help: help.into() }
    }

    pub fn output(path: &Path, message: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Output { path: path.to_owned(), message: message.into(), help: help.into() }
    }

    pub fn at_node(self, node: &str, kind: &str) -> Self {
        match self {
            Self::Cancelled | Self::AtNode { .. } => self,
            error => Self::AtNode { node: node.to_owned(), kind: kind.to_owned(), error: Box::new(error) },
        }
    }

    /// What the user can do about it; empty when nothing useful can be said.
    pub fn help(&self) -> &str {
        match self {
            Self::Usage { help, .. }
            | Self::File { help, .. }
            | Self::Compute { help, .. }
            | Self::Device { help, .. }
            | Self::Output { help, .. } => help,
            Self::AtNode { error, .. } => error.help(),
            Self::Graph { .. } | Self::Cancelled => "",
        }
    }

    /// The process exit code (DESIGN section 4; README, "Exit codes").
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Compute { .. } | Self::Output { .. } | Self::Cancelled => 1,
            Self::Usage { .. } | Self::Graph { .. } => 2,
            Self::File { .. } => 3,
            Self::Device { .. } => 4,
            Self::AtNode { error, .. } => error.exit_code(),
        }
    }
}
