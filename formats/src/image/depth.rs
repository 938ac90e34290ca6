//! Distances, from OpenEXR files.

use std::path::Path;

use super::exr::{Exr, MAGIC, read_exr_channels};
use crate::FormatError;

/// A picture of distances.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthImage {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Metres, row 0 at the top; infinite where nothing is.
    pub values: Vec<f32>,
    /// How many values were negative or not numbers, and became infinite.
    pub odd: usize,
}

/// Reads distances from the first part of an OpenEXR file: its channel `Z`, else the only one whose name ends in `.Z`,
/// else `Y`, else the only channel there is. What is negative or not a number becomes infinite.
///
/// # Errors
/// As [`read_exr_channels`]; a file that is not OpenEXR; channels of which none or several could be meant.
pub fn read_depth(path: &Path) -> Result<DepthImage, FormatError> {
    let exr = read_exr_channels(path).map_err(|error| match starts_as_exr(path) {
        Some(false) => FormatError::unsupported(path, "is not an OpenEXR (.exr) picture, which depth must be"),
        _ => error,
    })?;
    let Some(at) = channel(&exr) else {
        let names: Vec<_> = exr.channels.iter().map(|(name, _)| name.as_str()).collect();
        let what = format!(
            "has the channels {}; depth is read from Z, the only one that ends in .Z, Y, or a single channel",
            names.join(", ")
        );
        return Err(FormatError::content(path, None, what));
    };
    let Exr { width, height, mut channels, .. } = exr;
    let mut values = channels.swap_remove(at).1;
    let mut odd = 0;
    for value in &mut values {
        if value.is_nan() || *value < 0.0 {
            *value = f32::INFINITY;
            odd += 1;
        }
    }
    Ok(DepthImage { width, height, values, odd })
}

fn starts_as_exr(path: &Path) -> Option<bool> {
    use std::io::Read;
    let mut magic = [0; MAGIC.len()];
    super::open(path).ok()?.read_exact(&mut magic).ok()?;
    Some(magic == MAGIC)
}

/// The channel that holds the depth.
fn channel(exr: &Exr) -> Option<usize> {
    let place = |test: &dyn Fn(&str) -> bool| {
        let mut found = exr.channels.iter().enumerate().filter(|(_, (name, _))| test(name)).map(|(at, _)| at);
        (found.next(), found.next())
    };
    let exact = |wanted: &'static str| place(&move |name| name == wanted).0;
    exact("Z")
        .or_else(|| match place(&|name| name.ends_with(".Z")) {
            (only, None) => only,
            _ => None,
        })
        .or_else(|| exact("Y"))
        .or((exr.channels.len() == 1).then_some(0))
}
