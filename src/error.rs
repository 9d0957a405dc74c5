//! What can go wrong, told by who must act.

use std::path::{Path, PathBuf};

/// Every error of the library. `at` names the place in the artist's words: a file, an object, a material.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The disk or the operating system refused.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file that was read or written.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The input breaks the rules of its format; its author must act.
    #[error("{at}: {what}")]
    Invalid {
        /// What is wrong and what to do about it.
        what: String,
        /// Where.
        at: String,
    },
    /// The input is valid but uses something that is not supported.
    #[error("{at}: {what}")]
    Unsupported {
        /// What is not supported and what to do instead.
        what: String,
        /// Where.
        at: String,
    },
    /// The work would need more than was allowed (memory, pages).
    #[error("{at}: {what}")]
    TooLarge {
        /// What it wants, what it may have and what to change.
        what: String,
        /// Where.
        at: String,
    },
    /// The caller cancelled before there was anything to write.
    #[error("cancelled before there was a result to write")]
    Cancelled,
}

/// Result of the library.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// The input is broken at `at`.
    pub fn invalid(at: impl Into<String>, what: impl Into<String>) -> Self {
        Self::Invalid { what: what.into(), at: at.into() }
    }

    /// The input wants something unsupported at `at`.
    pub fn unsupported(at: impl Into<String>, what: impl Into<String>) -> Self {
        Self::Unsupported { what: what.into(), at: at.into() }
    }

    /// The same, told of what lies in `file`, unless its place names the file already.
    pub(crate) fn in_file(self, file: &Path) -> Self {
        let named = |at: String| {
            let file = file.display().to_string();
            match at.as_str() {
                "the file" => file,
                at_file if at_file.contains(&file) => at,
                _ => format!("{file}, {at}"),
            }
        };
        match self {
            Self::Invalid { what, at } => Self::Invalid { what, at: named(at) },
            Self::Unsupported { what, at } => Self::Unsupported { what, at: named(at) },
            Self::TooLarge { what, at } => Self::TooLarge { what, at: named(at) },
            Self::Io { .. } | Self::Cancelled => self,
        }
    }

    /// An operation on `path` failed.
    pub fn io(path: impl Into<PathBuf>, source: std::io::Error) -> Self {
        Self::Io { path: path.into(), source }
    }
}

/// Something that was dropped, approximated or looks wrong; the bake went on.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
pub struct Warning {
    /// The object, material or file, as the artist names it.
    pub at: String,
    /// What was found and what was done.
    pub what: String,
}

impl Warning {
    /// A warning about `at`.
    pub fn new(at: impl Into<String>, what: impl Into<String>) -> Self {
        Self { at: at.into(), what: what.into() }
    }
}
