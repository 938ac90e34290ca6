//! Pictures for a browser.

use airlight_formats::image::ToneMap;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use crate::record::Picture;

/// What is no number is shown in a colour that no scale here has.
const NO_NUMBER: [u8; 3] = [255, 0, 255];

/// A picture, its truth and their difference as addresses with the PNG in them, and how they are shown.
pub(super) struct Shown {
    pub(super) found: String,
    pub(super) expected: String,
    pub(super) difference: String,
    /// Radiance is multiplied by this before it is encoded.
    pub(super) exposure: f32,
    /// The difference that is white.
    pub(super) scale: f32,
    /// The same as a share of the largest expected value.
    pub(super) share: f32,
}

impl Shown {
    pub(super) fn new(picture: &Picture) -> Self {
        let values = || picture.expected.as_flattened().iter().copied().filter(|v| v.is_finite());
        let largest = values().fold(0.0f32, f32::max);
        let white = percentile(values().collect());
        let exposure = if white > 0.0 { 1.0 / white } else { 1.0 };
        let seen = |pixels: &[[f32; 3]]| {
            address(
                picture.size,
                pixels.iter().map(|p| {
                    if p.iter().all(|v| v.is_finite()) {
                        ToneMap::LINEAR.encode(p.map(|v| v * exposure)).map(|v| (v * 255.0).round() as u8)
                    } else {
                        NO_NUMBER
                    }
                }),
            )
        };
        let off: Vec<f32> = picture
            .found
            .iter()
            .zip(&picture.expected)
            // An infinity that should be one is no difference; NaN must not be lost in a maximum.
            .map(|(f, e)| [0, 1, 2].map(|c| if f[c] == e[c] { 0.0 } else { (f[c] - e[c]).abs() }))
            .map(|d| d.into_iter().fold(0.0, |a: f32, b| if a.is_nan() || b.is_nan() { f32::NAN } else { a.max(b) }))
            .collect();
        let scale = off.iter().copied().filter(|v| v.is_finite()).fold(0.0f32, f32::max);
        let heat = |v: f32| {
            let v = if scale > 0.0 { v / scale } else { 0.0 };
            [0.0, 1.0, 2.0].map(|from| ((3.0 * v - from).clamp(0.0, 1.0) * 255.0).round() as u8)
        };
        let difference = address(picture.size, off.iter().map(|&v| if v.is_finite() { heat(v) } else { NO_NUMBER }));
        let share = if largest > 0.0 { scale / largest } else { f32::INFINITY };
        let (found, expected) = (seen(&picture.found), seen(&picture.expected));
        Self { found, expected, difference, exposure, scale, share }
    }
}

/// The value that a hundredth of all values exceed.
fn percentile(mut values: Vec<f32>) -> f32 {
    values.sort_by(f32::total_cmp);
    values.get(values.len().saturating_sub(1) * 99 / 100).copied().unwrap_or(0.0)
}

/// A PNG as an address. Writing to memory fails for sizes alone, and those were checked when the picture was read.
fn address([width, height]: [u32; 2], pixels: impl Iterator<Item = [u8; 3]>) -> String {
    let bytes: Vec<u8> = pixels.flatten().collect();
    let mut png = Vec::new();
    match PngEncoder::new(&mut png).write_image(&bytes, width, height, ExtendedColorType::Rgb8) {
        Ok(()) => format!("data:image/png;base64,{}", STANDARD.encode(png)),
        Err(_) => String::new(),
    }
}
