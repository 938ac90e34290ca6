//! What the tests of volumes share.

use std::path::{Path, PathBuf};

use airlight_core::media::{Grid, IndexBox};
use airlight_formats::error::FormatError;
use airlight_formats::volume::{self, Volume};
use glam::{IVec3, UVec3};

/// A file of `tests/data`.
pub(crate) fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

/// A file of the reference scene.
pub(crate) fn reference(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../conformance/data/reference").join(name)
}

/// All values within a grid's bounds, x fastest.
pub(crate) fn dense(grid: &Grid) -> Vec<f32> {
    let IndexBox { min, dims } = grid.bounds();
    let mut values = vec![0.0; dims.element_product() as usize];
    for (k, slice) in values.chunks_exact_mut((dims.x * dims.y) as usize).enumerate() {
        grid.write_slice(grid.bounds(), min.z + k as i32, slice);
    }
    values
}

/// The value at one index.
pub(crate) fn at(grid: &Grid, x: i32, y: i32, z: i32) -> f32 {
    let mut value = [f32::NAN];
    grid.write_slice(IndexBox { min: IVec3::new(x, y, z), dims: UVec3::ONE }, z, &mut value);
    value[0]
}

/// Reads a file in memory that must not point to another one.
pub(crate) fn parse(name: &str, bytes: &[u8]) -> Result<Volume, FormatError> {
    let path = Path::new(name);
    let format = volume::detect(path, bytes)?;
    volume::parse(format, path, bytes, None, &|file| Err(FormatError::content(path, None, format!("asks for {file}"))))
}

/// The message of an error that must be there.
pub(crate) fn message<T>(result: Result<T, FormatError>) -> String {
    match result {
        Ok(_) => panic!("an error was expected"),
        Err(error) => error.to_string(),
    }
}
