//! Volume files.

use std::path::Path;

use airlight_core::media::Grid;

use crate::FormatError;

/// A grid of a volume file.
#[derive(Clone, Debug)]
pub struct Volume {
    /// The grid's name in its file.
    pub name: String,
    /// Its values.
    pub grid: Grid,
    /// Whether the file says where the grid lies in the world.
    pub placed: bool,
}

/// Reads one grid of a volume file.
///
/// # Errors
/// A file that cannot be used.
pub fn read(path: &Path, _grid: Option<&str>) -> Result<Volume, FormatError> {
    Err(FormatError::unsupported(path, "no reader of volumes is part of this build"))
}
