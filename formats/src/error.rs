//! What can be wrong with a file.

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
        source: std::io::Error,
    },
    /// The file's content is wrong.
    #[error("{}: {}{what}", path.display(), place.as_ref().map(|p| format!("{p}: ")).unwrap_or_default())]
    Content {
        /// The file.
        path: PathBuf,
        /// Where, when known: "line 12", "header field 'sizes'", "byte 4096", "grid 'density'".
        place: Option<String>,
        /// What is wrong, and what would be right.
        what: String,
    },
    /// The file is of a kind, or uses a feature, that airlight does not read.
    #[error("{}: {what}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// The kind or feature, and what would be read instead.
        what: String,
    },
}

impl FormatError {
    /// Makes [`FormatError::Io`] of an I/O error: `fs::read(path).map_err(FormatError::io(path))`.
    pub fn io(path: impl AsRef<Path>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.as_ref().to_owned();
        move |source| Self::Io { path, source }
    }

    /// [`FormatError::Content`] at `place`.
    pub fn content(path: impl AsRef<Path>, place: impl Into<Option<String>>, what: impl Into<String>) -> Self {
        Self::Content { path: path.as_ref().to_owned(), place: place.into(), what: what.into() }
    }

    /// [`FormatError::Unsupported`].
    pub fn unsupported(path: impl AsRef<Path>, what: impl Into<String>) -> Self {
        Self::Unsupported { path: path.as_ref().to_owned(), what: what.into() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_say_file_place_and_fault() {
        let e = FormatError::content("a.nrrd", Some("line 3".into()), "no such type");
        assert_eq!(e.to_string(), "a.nrrd: line 3: no such type");
        assert_eq!(FormatError::content("a.nrrd", None, "empty").to_string(), "a.nrrd: empty");
        assert_eq!(FormatError::unsupported("a.vdb", "points").to_string(), "a.vdb: points");
        let io = std::io::Error::other("gone");
        assert_eq!(FormatError::io("x")(io).to_string(), "x: gone");
    }
}
