//! OpenEXR, by the crate `exr`.

mod read;
mod write;

pub(super) use read::{MAGIC, read_rgb};
pub use read::{parse_exr_channels, read_exr_channels};
pub use write::{write_exr, write_exr_channels};

/// The first part of an OpenEXR file: every channel as 32-bit floats.
#[derive(Clone, Debug, PartialEq)]
pub struct Exr {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Names and values in the order of the file (alphabetical); `width · height` values each, row 0 at the top.
    pub channels: Vec<(String, Vec<f32>)>,
    /// The text attributes of the header, sorted by name.
    pub metadata: Vec<(String, String)>,
}

impl Exr {
    /// The values of the channel of that exact name.
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|(n, _)| n == name).map(|(_, values)| values.as_slice())
    }
}
