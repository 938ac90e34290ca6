//! Writing.

use std::io::{Seek, Write};
use std::path::Path;

use airlight_core::scene::Film;
use exr::compression::Compression;
use exr::error::Error;
use exr::image::write::WritableImage;
use exr::image::{AnyChannel, AnyChannels, Blocks, Encoding, FlatSamples, Image, Layer};
use exr::meta::attribute::{AttributeValue, LineOrder, Text};
use exr::meta::header::{LayerAttributes, standard_names};

use super::Exr;
use crate::FormatError;
use crate::image::check_film;
use crate::output::write_atomically;

/// Writes a film as one part of 32-bit floats, ZIP: `R`, `G`, `B`, `A` are the beauty (linear, premultiplied), then
/// `transmittance.R`, `.G`, `.B` and `depth.Z`. `metadata` become text attributes.
///
/// # Errors
/// As [`write_exr_channels`].
pub fn write_exr(path: &Path, film: &Film, metadata: &[(String, String)]) -> Result<(), FormatError> {
    check_film(path, film)?;
    let mut channels = Vec::with_capacity(8);
    for (c, name) in ["R", "G", "B", "A"].into_iter().enumerate() {
        channels.push((name.to_owned(), film.beauty.iter().map(|p| p[c]).collect()));
    }
    for (c, name) in ["transmittance.R", "transmittance.G", "transmittance.B"].into_iter().enumerate() {
        channels.push((name.to_owned(), film.transmittance.iter().map(|p| p[c]).collect()));
    }
    channels.push(("depth.Z".to_owned(), film.depth.clone()));
    let exr = Exr { width: film.width, height: film.height, channels, metadata: metadata.to_vec() };
    write_exr_channels(path, exr)
}

/// Writes any channels as one part of 32-bit floats, ZIP. The file appears whole or not at all.
///
/// # Errors
/// Channels of another size than the picture, or that share a name; metadata under a name that OpenEXR keeps for
/// itself, is empty or longer than 255 bytes; a file that cannot be written.
pub fn write_exr_channels(path: &Path, exr: Exr) -> Result<(), FormatError> {
    let image = encode(path, exr)?;
    write_atomically(path, |file| write_to(path, &image, file))
}

type Flat = Image<Layer<AnyChannels<FlatSamples>>>;

fn encode(path: &Path, exr: Exr) -> Result<Flat, FormatError> {
    let size = (exr.width as usize, exr.height as usize);
    let refuse = |what: String| FormatError::content(path, None, what);
    let mut attributes = LayerAttributes::default();
    for (name, value) in exr.metadata {
        if name.is_empty() || name.len() > 255 || name.contains('\0') {
            return Err(refuse(format!("{name:?} is no name of an attribute; from 1 to 255 bytes are")));
        }
        // `name` and `type` would make a part of a multi-part file of it.
        if standard_names::ALL.contains(&name.as_bytes()) {
            return Err(refuse(format!("the attribute {name} is one that OpenEXR keeps for itself")));
        }
        attributes.other.insert(text(&name), AttributeValue::Text(text(&value)));
    }
    let mut list: Vec<_> = exr.channels;
    list.sort_by(|a, b| a.0.cmp(&b.0));
    if let Some(twice) = list.windows(2).find(|w| w[0].0 == w[1].0) {
        return Err(refuse(format!("two channels are named {}", twice[0].0)));
    }
    if let Some((name, values)) = list.iter().find(|(_, values)| values.len() != size.0 * size.1) {
        let (n, expected) = (values.len(), size.0 * size.1);
        return Err(refuse(format!("channel {name} holds {n} values for {expected} pixels")));
    }
    let list = list.into_iter().map(|(name, values)| AnyChannel::new(text(&name), FlatSamples::F32(values)));
    let channels = AnyChannels::sort(list.collect());
    let encoding =
        Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    Ok(Image::from_layer(Layer::new(size, attributes, encoding, channels)))
}

/// UTF-8, as OpenEXR has it since version 2; the crate's own conversion would be Latin-1.
fn text(s: &str) -> Text {
    Text::from_bytes_unchecked(s.bytes().collect())
}

fn write_to(path: &Path, image: &Flat, file: impl Write + Seek) -> Result<(), FormatError> {
    image.write().to_buffered(file).map_err(|error| match error {
        Error::Io(source) => FormatError::io(path)(source),
        other => FormatError::content(path, None, format!("cannot be written: {other}")),
    })
}

#[cfg(test)]
mod tests {
    use std::io::{self, Cursor, SeekFrom};

    use super::*;

    /// A file on a disk that holds `room` bytes.
    struct SmallDisk {
        file: Cursor<Vec<u8>>,
        room: u64,
    }

    impl Write for SmallDisk {
        fn write(&mut self, buf: &[u8]) -> io::Result<usize> {
            if self.file.position() + buf.len() as u64 > self.room {
                return Err(io::ErrorKind::StorageFull.into());
            }
            self.file.write(buf)
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Seek for SmallDisk {
        fn seek(&mut self, pos: SeekFrom) -> io::Result<u64> {
            self.file.seek(pos)
        }
    }

    #[test]
    fn a_full_disk_is_an_error_wherever_it_fills() {
        let path = Path::new("out.exr");
        // Values that do not compress, so that the chunks have a length.
        let values = (0..40 * 33u32).map(|i| f32::from_bits(0x3f00_0000 | i.wrapping_mul(2_654_435_761) >> 9));
        let exr = Exr {
            width: 40,
            height: 33,
            channels: vec![("Y".into(), values.collect())],
            metadata: vec![("device".into(), "cpu".into())],
        };
        let image = encode(path, exr).unwrap();
        let mut whole = SmallDisk { file: Cursor::new(Vec::new()), room: u64::MAX };
        write_to(path, &image, &mut whole).unwrap();
        let size = whole.file.into_inner().len() as u64;
        for room in (0..size).step_by(37) {
            let disk = SmallDisk { file: Cursor::new(Vec::new()), room };
            let error = write_to(path, &image, disk).unwrap_err();
            assert!(matches!(error, FormatError::Io { .. }), "{room} of {size}: {error}");
        }
    }
}
