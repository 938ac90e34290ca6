//! What is wrong with a file.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// A file that cannot be used: what, where, and what would be right.
#[derive(Debug, thiserror::Error)]
pub enum FormatError {
    /// The operating system's word.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// The file's content is wrong.
    #[error("{}: {}{what}", path.display(), Place(place))]
    Content {
        /// The file.
        path: PathBuf,
        /// Where, when known: "line 12", "header field 'sizes'", "byte 4096".
        place: Option<String>,
        /// What is wrong, and what would be right.
        what: String,
    },
    /// The file is of a kind, or uses a feature, that airlight does not read.
    #[error("{}: {what}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What it is, and what would be read instead.
        what: String,
    },
}

/// A place and the colon behind it, or nothing.
struct Place<'a>(&'a Option<String>);

impl fmt::Display for Place<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some(place) => write!(f, "{place}: "),
            None => Ok(()),
        }
    }
}

impl FormatError {
    /// For `map_err`: turns an error of the operating system at `path` into one that names it.
    pub fn io(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_path_buf();
        move |source| Self::Io { path, source }
    }

    /// Wrong content of `path`, at `place` where that is known.
    pub fn content(path: &Path, place: impl Into<Option<String>>, what: impl Into<String>) -> Self {
        Self::Content { path: path.to_path_buf(), place: place.into(), what: what.into() }
    }

    /// A kind of file, or a feature of it, that is not read.
    pub fn unsupported(path: &Path, what: impl Into<String>) -> Self {
        Self::Unsupported { path: path.to_path_buf(), what: what.into() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_say_what_and_where() {
        let path = Path::new("a/b.nrrd");
        let text = |e: FormatError| e.to_string();
        assert_eq!(text(FormatError::content(path, "line 3".to_owned(), "no size")), "a/b.nrrd: line 3: no size");
        assert_eq!(text(FormatError::content(path, None, "no size")), "a/b.nrrd: no size");
        assert_eq!(text(FormatError::unsupported(path, "deep")), "a/b.nrrd: deep");
        let io = FormatError::io(path)(io::Error::new(io::ErrorKind::NotFound, "no such file"));
        assert_eq!(text(io), "a/b.nrrd: no such file");
    }
}
