//! Pictures: OpenEXR and Radiance files in, OpenEXR and PNG files out.
//!
//! Pictures are linear RGB (Rec. 709), row 0 at the top. What a file is follows from its first bytes, never from its
//! name; what is written follows from the ending of the name.

mod depth;
mod exr;
mod hdr;
mod png;
mod tone;

use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

use airlight_core::light::{Environment, Image, clamp_texels};
use airlight_core::scene::Film;

pub use self::depth::{DepthImage, read_depth};
pub use self::exr::{Exr, parse_exr_channels, read_exr_channels, write_exr, write_exr_channels};
pub use self::png::{write_png, write_png_rgb8};
pub use self::tone::{Curve, ToneMap};

use crate::FormatError;

/// The most pixels of a picture that is read: 2²⁸, a square of 16384.
pub const MAX_PIXELS: u64 = 1 << 28;

/// The kinds of picture that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFormat {
    /// OpenEXR.
    Exr,
    /// Radiance RGBE, `.hdr` or `.pic`.
    Radiance,
}

/// A picture from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadedImage {
    /// The kind of its file.
    pub format: ImageFormat,
    /// Linear RGB.
    pub image: Image,
    /// The channel `A`, a value a pixel, where the file has one.
    pub alpha: Option<Vec<f32>>,
}

/// Reads linear RGB from an OpenEXR file (channels R, G and B, or Y alone, of its first part) or a Radiance file.
///
/// # Errors
/// A file that cannot be opened, is of another kind, is damaged, or claims more than [`MAX_PIXELS`] or more than its
/// size can hold.
pub fn read_image(path: &Path) -> Result<LoadedImage, FormatError> {
    let mut file = open(path)?;
    let mut magic = [0u8; 4];
    let mut got = 0;
    while got < magic.len() {
        match file.read(&mut magic[got..]).map_err(FormatError::io(path))? {
            0 => break,
            n => got += n,
        }
    }
    file.rewind().map_err(FormatError::io(path))?;
    if magic == exr::MAGIC {
        exr::read_rgb(path, file)
    } else if magic.starts_with(b"#?") {
        let image = hdr::read(path, file)?;
        Ok(LoadedImage { format: ImageFormat::Radiance, image, alpha: None })
    } else {
        Err(FormatError::unsupported(path, "is neither an OpenEXR (.exr) nor a Radiance (.hdr) picture"))
    }
}

/// Opens a regular file.
fn open(path: &Path) -> Result<BufReader<File>, FormatError> {
    // Before it is opened: opening a pipe waits for its other end.
    let kind = std::fs::metadata(path).map_err(FormatError::io(path))?;
    if kind.is_dir() {
        return Err(FormatError::unsupported(path, "is a folder; a picture is a file"));
    }
    if !kind.is_file() {
        return Err(FormatError::unsupported(path, "is not a regular file"));
    }
    let file = File::open(path).map_err(FormatError::io(path))?;
    Ok(BufReader::with_capacity(1 << 16, file))
}

/// Refuses a claim of `width` × `height` pixels that no picture may have.
fn check_size(path: &Path, width: u64, height: u64) -> Result<(), FormatError> {
    let pixels = width.checked_mul(height);
    if pixels.is_none_or(|n| n == 0 || n > MAX_PIXELS) {
        let what = format!("claims {width} × {height} pixels; from 1 to {MAX_PIXELS} are read");
        return Err(FormatError::content(path, "header".to_owned(), what));
    }
    Ok(())
}

/// Reads a latitude–longitude picture as an environment. Texels that no radiance can be are clamped to zero; a
/// warning counts them. Another warns of a picture that is not twice as wide as high.
///
/// # Errors
/// As [`read_image`].
pub fn load_environment(path: &Path) -> Result<(Environment, Vec<String>), FormatError> {
    let mut image = read_image(path)?.image;
    let mut warnings = Vec::new();
    let clamped = clamp_texels(&mut image.texels);
    if clamped > 0 {
        let (path, all) = (path.display(), image.texels.len());
        warnings
            .push(format!("{path}: {clamped} of {all} texels hold negative or non-finite values, which count as 0"));
    }
    let (width, height) = (image.width, image.height);
    if u64::from(width) != 2 * u64::from(height) && image.texels.len() > 1 {
        let path = path.display();
        warnings
            .push(format!("{path}: {width} × {height} texels; a latitude–longitude picture is twice as wide as high"));
    }
    let environment = Environment::new(image).map_err(|e| FormatError::content(path, None, e.to_string()))?;
    Ok((environment, warnings))
}

/// Whether [`write_film`] knows the ending of `path`.
///
/// # Errors
/// Another ending than `.exr` or `.png`.
pub fn check_ending(path: &Path) -> Result<(), FormatError> {
    match path.extension().map(|e| e.to_ascii_lowercase()) {
        Some(e) if e == "exr" || e == "png" => Ok(()),
        _ => Err(FormatError::unsupported(path, "the ending says the format of a picture; write .exr or .png")),
    }
}

/// Writes a film by the ending of `path`: `.exr` as [`write_exr`], `.png` as [`write_png`].
///
/// # Errors
/// Another ending; a file that cannot be written.
pub fn write_film(path: &Path, film: &Film, metadata: &[(String, String)], tone: ToneMap) -> Result<(), FormatError> {
    check_ending(path)?;
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr")) {
        write_exr(path, film, metadata)
    } else {
        write_png(path, film, tone)
    }
}

/// Checks that a film's vectors hold its pixels, so that writers may index them.
fn check_film(path: &Path, film: &Film) -> Result<(), FormatError> {
    let n = film.pixels();
    if n == 0 || film.beauty.len() != n || film.transmittance.len() != n || film.depth.len() != n {
        let what = format!(
            "a film of {} × {} pixels with {} colours, {} transmittances and {} depths cannot be written",
            film.width,
            film.height,
            film.beauty.len(),
            film.transmittance.len(),
            film.depth.len()
        );
        return Err(FormatError::content(path, None, what));
    }
    Ok(())
}
