//! Small pictures in rows.

use std::error::Error;
use std::path::Path;

use airlight_formats::image::{ToneMap, write_png_rgb8};

/// Pictures side by side, white where there is none.
pub(super) fn sheet(
    path: &Path,
    [width, height]: [u32; 2],
    rows: &[Vec<Vec<[f32; 3]>>],
    tone: ToneMap,
) -> Result<(), Box<dyn Error>> {
    let gap = 4;
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0) as u32;
    let (across, down) = (columns * (width + gap) - gap, rows.len() as u32 * (height + gap) - gap);
    let mut bytes = vec![255; 3 * (across * down) as usize];
    for (j, row) in (0..).zip(rows) {
        for (i, tile) in (0..).zip(row) {
            for (k, pixel) in (0..).zip(tile) {
                let (x, y) = (i * (width + gap) + k % width, j * (height + gap) + k / width);
                let at = 3 * (y * across + x) as usize;
                bytes[at..at + 3].copy_from_slice(&tone.encode(*pixel).map(|v| (v * 255.0).round() as u8));
            }
        }
    }
    Ok(write_png_rgb8(path, across, down, &bytes)?)
}
