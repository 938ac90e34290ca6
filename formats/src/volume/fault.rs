//! What a parser finds wrong, before the path of the file is put to it.

use std::path::Path;

use crate::error::FormatError;

/// A fault in bytes whose file the parser does not know.
#[derive(Debug)]
pub(super) enum Fault {
    /// Wrong content, and where.
    Content { place: Option<String>, what: String },
    /// Something that is not read.
    Unsupported(String),
    /// So many bytes of memory cannot be had.
    Memory(u64),
    /// A fault of another file that this one points to, or of this one's path.
    File(FormatError),
}

impl Fault {
    /// Wrong content at a place that is not known.
    pub(super) fn new(what: impl Into<String>) -> Self {
        Self::Content { place: None, what: what.into() }
    }

    /// Wrong content at `place`.
    pub(super) fn at(place: impl Into<String>, what: impl Into<String>) -> Self {
        Self::Content { place: Some(place.into()), what: what.into() }
    }

    /// The same fault, found inside `outer`.
    pub(super) fn within(self, outer: &str) -> Self {
        match self {
            Self::Content { place: None, what } => Self::at(outer, what),
            Self::Content { place: Some(place), what } => Self::at(format!("{outer}, {place}"), what),
            Self::Unsupported(what) => Self::Unsupported(format!("{outer}: {what}")),
            other => other,
        }
    }

    /// What is wrong, without the file.
    pub(super) fn text(&self) -> String {
        match self {
            Self::Content { place: Some(place), what } => format!("{place}: {what}"),
            Self::Content { place: None, what } | Self::Unsupported(what) => what.clone(),
            Self::Memory(bytes) => format!("{bytes} bytes of memory cannot be had"),
            Self::File(error) => error.to_string(),
        }
    }

    /// The public error for the file at `path`.
    pub(super) fn of(self, path: &Path) -> FormatError {
        match self {
            Self::Content { place, what } => FormatError::content(path, place, what),
            Self::Unsupported(what) => FormatError::unsupported(path, what),
            Self::Memory(_) => FormatError::io(path)(std::io::Error::new(std::io::ErrorKind::OutOfMemory, self.text())),
            Self::File(error) => error,
        }
    }
}

/// An empty vector with room for `count` items, or [`Fault::Memory`].
pub(super) fn room<T>(count: usize) -> Result<Vec<T>, Fault> {
    let mut items = Vec::new();
    items.try_reserve_exact(count).map_err(|_| Fault::Memory((count as u64).saturating_mul(size_of::<T>() as u64)))?;
    Ok(items)
}
