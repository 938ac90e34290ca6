//! PNG: 8 bits a channel, sRGB.

use std::io::{self, Write};
use std::path::Path;

use airlight_core::scene::Film;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageError};

use super::{ToneMap, check_film};
use crate::FormatError;
use crate::output::write_atomically;

/// Writes a film's beauty over black, through `tone`, as 8-bit sRGB.
///
/// # Errors
/// As [`write_png_rgb8`].
pub fn write_png(path: &Path, film: &Film, tone: ToneMap) -> Result<(), FormatError> {
    check_film(path, film)?;
    let mut pixels = Vec::with_capacity(film.pixels() * 3);
    for (i, &[r, g, b, _]) in film.beauty.iter().enumerate() {
        let (x, y) = (i as u32 % film.width, i as u32 / film.width);
        // Premultiplied colour is what shows over black.
        pixels.extend(tone.quantize([r, g, b], x, y));
    }
    write_png_rgb8(path, film.width, film.height, &pixels)
}

/// Writes `width · height` pixels of three bytes, encoded as sRGB, row 0 at the top. The file appears whole or not at
/// all.
///
/// # Errors
/// A number of bytes that is not the picture's; a file that cannot be written.
pub fn write_png_rgb8(path: &Path, width: u32, height: u32, pixels: &[u8]) -> Result<(), FormatError> {
    write_atomically(path, |file| encode(path, width, height, pixels, file))
}

fn encode(path: &Path, width: u32, height: u32, pixels: &[u8], file: impl Write) -> Result<(), FormatError> {
    let size = u64::from(width) * u64::from(height) * 3;
    if pixels.len() as u64 != size {
        let what = format!("{} bytes are not the {size} of {width} × {height} pixels", pixels.len());
        return Err(FormatError::content(path, None, what));
    }
    let mut file = Remembering { file, failed: None };
    let done = PngEncoder::new(&mut file).write_image(pixels, width, height, ExtendedColorType::Rgb8);
    if let Some(source) = file.failed {
        return Err(FormatError::io(path)(source));
    }
    done.map_err(|error| match error {
        ImageError::IoError(source) => FormatError::io(path)(source),
        other => FormatError::content(path, None, format!("cannot be written: {other}")),
    })
}

/// Keeps the first error: the encoder writes the last chunk when it is dropped, and says nothing of its failure.
struct Remembering<W> {
    file: W,
    failed: Option<io::Error>,
}

impl<W> Remembering<W> {
    fn note<T>(&mut self, result: io::Result<T>) -> io::Result<T> {
        result.map_err(|error| {
            let kind = error.kind();
            if kind != io::ErrorKind::Interrupted {
                self.failed.get_or_insert(error);
            }
            kind.into()
        })
    }
}

impl<W: Write> Write for Remembering<W> {
    fn write(&mut self, buf: &[u8]) -> io::Result<usize> {
        let result = self.file.write(buf);
        self.note(result)
    }

    fn flush(&mut self) -> io::Result<()> {
        let result = self.file.flush();
        self.note(result)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Full(usize);

    impl Write for Full {
        fn write(&mut self, buf: &[u8]) -> io::Result<usize> {
            self.0 = self.0.checked_sub(buf.len()).ok_or(io::ErrorKind::StorageFull)?;
            Ok(buf.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_full_disk_is_an_error_wherever_it_fills() {
        let path = Path::new("out.png");
        let pixels: Vec<u8> = (0..30 * 20 * 3u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        let mut whole = Vec::new();
        encode(path, 30, 20, &pixels, &mut whole).unwrap();
        for room in (0..whole.len()).step_by(13).chain(whole.len() - 12..whole.len()) {
            let error = encode(path, 30, 20, &pixels, Full(room)).unwrap_err();
            assert!(matches!(error, FormatError::Io { .. }), "{room}: {error}");
        }
        assert!(encode(path, 30, 21, &pixels, &mut whole).unwrap_err().to_string().contains("1800 bytes"));
    }
}
