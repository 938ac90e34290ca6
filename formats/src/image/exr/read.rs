//! Reading.

use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use airlight_core::light::Image;
use exr::compression::Compression;
use exr::error::Error;
use exr::image::{AnyChannels, FlatSamples, Layer};
use exr::math::Vec2;
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, IntegerBounds, Text};
use exr::meta::header::Header;
use exr::prelude::{ReadChannels, ReadLayers, read};

use super::Exr;
use crate::FormatError;
use crate::image::{ImageFormat, LoadedImage, check_size, open};

/// The first bytes of every OpenEXR file.
pub(in crate::image) const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// The most values of all channels of a picture together: 4 GiB of memory.
const MAX_SAMPLES: u64 = 1 << 30;

/// What any file may claim to unfold to, in bytes, before the claim is held against its size.
const SMALL: u64 = 1 << 24;

/// Reads every channel of the first part of an OpenEXR file.
///
/// The picture is the display window: pixels outside the data window are zero, data outside the display window is
/// left out. 16-bit floats and 32-bit integers become 32-bit floats.
///
/// # Errors
/// As [`read_image`](crate::image::read_image); deep data and subsampled channels, which are not read.
pub fn read_exr_channels(path: &Path) -> Result<Exr, FormatError> {
    let file = open(path)?;
    let bytes = size(path, &file)?;
    read_channels(path, file, bytes)
}

/// As [`read_exr_channels`], of a file in memory: `path` is only for messages.
///
/// # Errors
/// As [`read_exr_channels`].
pub fn parse_exr_channels(path: &Path, bytes: &[u8]) -> Result<Exr, FormatError> {
    read_channels(path, Cursor::new(bytes), bytes.len() as u64)
}

fn size(path: &Path, file: &BufReader<File>) -> Result<u64, FormatError> {
    Ok(file.get_ref().metadata().map_err(FormatError::io(path))?.len())
}

/// Reads RGB, or Y as grey, and alpha where there is one.
pub(in crate::image) fn read_rgb(path: &Path, file: BufReader<File>) -> Result<LoadedImage, FormatError> {
    let bytes = size(path, &file)?;
    let exr = read_channels(path, file, bytes)?;
    let rgb = match (exr.channel("R"), exr.channel("G"), exr.channel("B"), exr.channel("Y")) {
        (Some(r), Some(g), Some(b), _) => [r, g, b],
        (None, None, None, Some(y)) => [y; 3],
        _ => {
            let names: Vec<_> = exr.channels.iter().map(|(n, _)| n.as_str()).collect();
            let what = format!("has no channels R, G and B, nor Y; it has {}", names.join(", "));
            return Err(FormatError::unsupported(path, what));
        }
    };
    let texels = (0..rgb[0].len()).map(|i| [rgb[0][i], rgb[1][i], rgb[2][i]]).collect();
    let alpha = exr.channel("A").map(<[f32]>::to_vec);
    let image = Image { width: exr.width, height: exr.height, texels };
    Ok(LoadedImage { format: ImageFormat::Exr, image, alpha })
}

fn read_channels(path: &Path, file: impl Read + Seek, bytes: u64) -> Result<Exr, FormatError> {
    // The decoder asserts some of its invariants on what files say; a damaged file must stay an error.
    let decoded = catch_unwind(AssertUnwindSafe(|| decode(path, file, bytes)));
    decoded
        .unwrap_or_else(|_| Err(FormatError::content(path, None, "is damaged; the decoder of OpenEXR gave up on it")))
}

fn decode(path: &Path, mut file: impl Read + Seek, bytes: u64) -> Result<Exr, FormatError> {
    let meta = MetaData::read_from_buffered(&mut file, false).map_err(|e| wrong(path, e))?;
    for header in &meta.headers {
        check_claim(path, header, bytes)?;
    }
    let Some(header) = meta.headers.first() else {
        return Err(FormatError::content(path, "header".to_owned(), "holds no picture"));
    };
    let display = header.shared_attributes.display_window;
    let (width, height) = (display.size.width() as u64, display.size.height() as u64);
    check_size(path, width, height)?;
    check_samples(path, width * height * header.channels.list.len() as u64)?;
    let mut metadata = Vec::new();
    let own = &header.own_attributes;
    for (name, value) in [("owner", &own.owner), ("comments", &own.comments)] {
        metadata.extend(value.as_ref().map(|v| (name.to_owned(), string(v))));
    }
    for (name, value) in own.other.iter().chain(&header.shared_attributes.other) {
        if let AttributeValue::Text(text) = value {
            metadata.push((string(name), string(text)));
        }
    }
    metadata.sort();

    file.rewind().map_err(FormatError::io(path))?;
    // One thread: a panic on a thread of the decoder's own would abort the process.
    let reader = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
    let image = reader.non_parallel().from_buffered(file).map_err(|e| wrong(path, e))?;
    let Layer { channel_data: AnyChannels { list }, attributes, size, .. } = image.layer_data;
    let data = IntegerBounds::new(attributes.layer_position, size);
    let channels = list.into_iter().map(|c| (string(&c.name), window(floats(c.sample_data), data, display)));
    Ok(Exr { width: width as u32, height: height as u32, channels: channels.collect(), metadata })
}

/// Holds what a part says of itself against what airlight reads and what its file can hold.
fn check_claim(path: &Path, header: &Header, bytes: u64) -> Result<(), FormatError> {
    if header.deep {
        return Err(FormatError::unsupported(path, "holds deep data; flat pictures are read"));
    }
    if let Some(c) = header.channels.list.iter().find(|c| c.sampling != Vec2(1, 1)) {
        let what = format!("channel {} is subsampled; pictures with a value a pixel in every channel are read", c.name);
        return Err(FormatError::unsupported(path, what));
    }
    let (width, height) = (header.layer_size.width() as u64, header.layer_size.height() as u64);
    check_size(path, width, height)?;
    let (pixels, channels) = (width * height, header.channels.list.len() as u64);
    check_samples(path, pixels.saturating_mul(channels))?;
    // The most that a byte of file unfolds to: nothing, deflate's bound of 1032 and runs of bytes, and for the
    // methods that code coefficients a bound on a picture of one colour.
    let unfolding = match header.compression {
        Compression::Uncompressed => 1,
        Compression::PIZ | Compression::DWAA(_) | Compression::DWAB(_) => 1 << 16,
        _ => 1 << 11,
    };
    let claim = pixels * header.channels.bytes_per_pixel as u64;
    // Every chunk has an entry of eight bytes in a table, and a head of eight bytes or more.
    let table = (header.chunk_count as u64).saturating_mul(16);
    if table > bytes || claim > SMALL.max(bytes.saturating_mul(unfolding)) {
        let what = format!("claims {width} × {height} pixels of {channels} channels, more than {bytes} bytes can hold");
        return Err(FormatError::content(path, "header".to_owned(), what));
    }
    Ok(())
}

fn check_samples(path: &Path, samples: u64) -> Result<(), FormatError> {
    if samples > MAX_SAMPLES {
        let what = format!("claims {samples} values in all channels; {MAX_SAMPLES} are read");
        return Err(FormatError::content(path, "header".to_owned(), what));
    }
    Ok(())
}

fn floats(samples: FlatSamples) -> Vec<f32> {
    match samples {
        FlatSamples::F16(v) => v.into_iter().map(|x| x.to_f32()).collect(),
        FlatSamples::F32(v) => v,
        FlatSamples::U32(v) => v.into_iter().map(|x| x as f32).collect(),
    }
}

/// Texts are UTF-8 since OpenEXR 2; what is not is taken for Latin-1, as the crate does.
fn string(text: &Text) -> String {
    std::str::from_utf8(text.bytes()).map_or_else(|_| text.to_string(), str::to_owned)
}

/// The values of the display window, cut from those of the data window.
fn window(values: Vec<f32>, data: IntegerBounds, display: IntegerBounds) -> Vec<f32> {
    if data == display {
        return values;
    }
    let mut out = vec![0.0; display.size.area()];
    // Where the data's columns and rows fall in the display window: (first there, first in the data, how many).
    let overlap = |data: i32, n: usize, display: i32, m: usize| {
        let shift = i64::from(data) - i64::from(display);
        let (to, from) = (shift.max(0), (-shift).max(0));
        let count = (n as i64 - from).min(m as i64 - to).max(0);
        (to as usize, from as usize, count as usize)
    };
    let (x, sx, columns) = overlap(data.position.0, data.size.0, display.position.0, display.size.0);
    let (y, sy, rows) = overlap(data.position.1, data.size.1, display.position.1, display.size.1);
    if columns > 0 {
        for row in 0..rows {
            let to = (y + row) * display.size.0 + x;
            let from = (sy + row) * data.size.0 + sx;
            out[to..to + columns].copy_from_slice(&values[from..from + columns]);
        }
    }
    out
}

/// The decoder's word on a file.
fn wrong(path: &Path, error: Error) -> FormatError {
    match error {
        Error::Io(source) => FormatError::io(path)(source),
        Error::NotSupported(what) => FormatError::unsupported(path, format!("not read: {what}")),
        Error::Invalid(what) => FormatError::content(path, None, format!("damaged OpenEXR file: {what}")),
        Error::Aborted => FormatError::content(path, None, "damaged OpenEXR file"),
    }
}
