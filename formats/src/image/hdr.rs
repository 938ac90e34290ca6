//! Radiance RGBE pictures (`.hdr`, `.pic`): the reader.
//!
//! After Ward, "Real Pixels" (Graphics Gems II) and the format's description in the Radiance manual: a text header that
//! ends with an empty line, a line that gives the axes and sizes, then scanlines of four bytes a pixel, plain or run-length
//! coded in the old or the new way.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use airlight_core::light::Image;

use super::check_size;
use crate::FormatError;

/// The longest line of a header.
const LINE: u64 = 4096;
/// The most lines of a header.
const LINES: usize = 1000;
/// The pixels that any file may claim before the claim is held against its size.
const SMALL: u64 = 1 << 20;

pub(super) fn read(path: &Path, mut file: BufReader<File>) -> Result<Image, FormatError> {
    let bytes = file.get_ref().metadata().map_err(FormatError::io(path))?.len();
    decode(path, &mut file, bytes)
}

/// How the picture's rows and columns lie in the file.
#[derive(Debug, PartialEq)]
struct Axes {
    /// The file's scanlines run along x.
    by_rows: bool,
    /// Scanlines (outer) and the pixels in them (inner) come in falling order of x or rising order of height.
    outer_reversed: bool,
    inner_reversed: bool,
    outer: u32,
    inner: u32,
}

fn decode(path: &Path, file: &mut impl BufRead, bytes: u64) -> Result<Image, FormatError> {
    let mut number = 0;
    let mut exposure = 1.0f64;
    let axes = loop {
        number += 1;
        let line = read_line(path, file, number)?;
        let place = || format!("line {number}");
        if let Some(format) = line.strip_prefix("FORMAT=") {
            if format.trim() != "32-bit_rle_rgbe" {
                let what = format!("FORMAT={} is not read; 32-bit_rle_rgbe is", format.trim());
                return Err(FormatError::unsupported(path, what));
            }
        } else if let Some(value) = line.strip_prefix("EXPOSURE=") {
            // Several are multiplied together; pixels were multiplied by all of them.
            match value.trim().parse::<f64>() {
                Ok(v) if v.is_finite() && v > 0.0 => exposure *= v,
                _ => {
                    let what = format!("EXPOSURE={} is not a number above 0", value.trim());
                    return Err(FormatError::content(path, place(), what));
                }
            }
        } else if line.trim().is_empty() {
            number += 1;
            let line = read_line(path, file, number)?;
            break parse_axes(&line).ok_or_else(|| {
                let what = format!("{line:?} does not give the size; \"-Y 512 +X 1024\" would");
                FormatError::content(path, format!("line {number}"), what)
            })?;
        }
        if number > LINES {
            return Err(FormatError::content(path, None, format!("the header does not end within {LINES} lines")));
        }
    };
    let (width, height) = if axes.by_rows { (axes.inner, axes.outer) } else { (axes.outer, axes.inner) };
    check_size(path, width.into(), height.into())?;
    // The new coding covers at most 16 pixels with a byte; the old one could cover more, but what is still to be
    // believed beyond a small picture is a matter of judgement.
    if u64::from(width) * u64::from(height) > SMALL.max(bytes.saturating_mul(1 << 10)) {
        let what = format!("claims {width} × {height} pixels, more than {bytes} bytes can hold");
        return Err(FormatError::content(path, format!("line {number}"), what));
    }

    let mut texels = vec![[0.0f32; 3]; width as usize * height as usize];
    let mut scanline = vec![[0u8; 4]; axes.inner as usize];
    let scale = 1.0 / exposure;
    for i in 0..axes.outer as usize {
        read_scanline(file, &mut scanline).map_err(|e| match e {
            Fault::Io(e) if e.kind() != std::io::ErrorKind::UnexpectedEof => FormatError::io(path)(e),
            Fault::Io(_) => FormatError::content(path, format!("scanline {i}"), "the file ends here"),
            Fault::Runs => FormatError::content(path, format!("scanline {i}"), "runs of pixels leave the scanline"),
        })?;
        for (j, pixel) in scanline.iter().enumerate() {
            let i = if axes.outer_reversed { axes.outer as usize - 1 - i } else { i };
            let j = if axes.inner_reversed { axes.inner as usize - 1 - j } else { j };
            let (x, y) = if axes.by_rows { (j, i) } else { (i, j) };
            texels[y * width as usize + x] = to_rgb(*pixel, scale);
        }
    }
    Ok(Image { width, height, texels })
}

/// A line of the header, without its end.
fn read_line(path: &Path, file: &mut impl BufRead, number: usize) -> Result<String, FormatError> {
    let mut line = Vec::new();
    file.by_ref().take(LINE).read_until(b'\n', &mut line).map_err(FormatError::io(path))?;
    if line.pop() != Some(b'\n') {
        let what = "the header ends without its lines of size, or holds a line of over 4096 bytes";
        return Err(FormatError::content(path, format!("line {number}"), what));
    }
    Ok(String::from_utf8_lossy(&line).into_owned())
}

/// `-Y 512 +X 1024` and its seven relatives.
fn parse_axes(line: &str) -> Option<Axes> {
    let words: Vec<_> = line.split_whitespace().collect();
    let [outer_axis, outer, inner_axis, inner] = words[..] else { return None };
    // Height falls along picture rows, so "-Y" is the usual order from the top.
    let reversed = |axis| match axis {
        "+X" | "-Y" => Some(false),
        "-X" | "+Y" => Some(true),
        _ => None,
    };
    let by_rows = outer_axis.ends_with('Y');
    if by_rows == inner_axis.ends_with('Y') {
        return None;
    }
    Some(Axes {
        by_rows,
        outer_reversed: reversed(outer_axis)?,
        inner_reversed: reversed(inner_axis)?,
        outer: outer.parse().ok()?,
        inner: inner.parse().ok()?,
    })
}

enum Fault {
    Io(std::io::Error),
    Runs,
}

impl From<std::io::Error> for Fault {
    fn from(e: std::io::Error) -> Self {
        Self::Io(e)
    }
}

fn read_scanline(file: &mut impl Read, line: &mut [[u8; 4]]) -> Result<(), Fault> {
    let mut first = [0u8; 4];
    file.read_exact(&mut first)?;
    let claimed = usize::from(first[2]) << 8 | usize::from(first[3]);
    if first[0] == 2 && first[1] == 2 && first[2] < 128 && (8..=0x7fff).contains(&line.len()) {
        if claimed != line.len() {
            return Err(Fault::Runs);
        }
        (0..4).try_for_each(|component| read_component(file, line, component))
    } else {
        read_flat(file, line, first)
    }
}

/// The new coding: each component of a scanline for itself; a count above 128 is a run, else so many bytes follow.
fn read_component(file: &mut impl Read, line: &mut [[u8; 4]], component: usize) -> Result<(), Fault> {
    let mut x = 0;
    while x < line.len() {
        let mut count = [0u8];
        file.read_exact(&mut count)?;
        let (n, run) = if count[0] > 128 { (count[0] - 128, true) } else { (count[0], false) };
        let pixels = line.get_mut(x..x + usize::from(n)).filter(|p| !p.is_empty()).ok_or(Fault::Runs)?;
        let mut values = [0u8; 128];
        if run {
            let mut value = [0u8];
            file.read_exact(&mut value)?;
            values.fill(value[0]);
        } else {
            file.read_exact(&mut values[..usize::from(n)])?;
        }
        for (pixel, value) in pixels.iter_mut().zip(values) {
            pixel[component] = value;
        }
        x += usize::from(n);
    }
    Ok(())
}

/// Plain pixels and the old coding: (1, 1, 1, n) repeats the pixel before n times; further ones in a row count in
/// units of 256, 65536 and so on.
fn read_flat(file: &mut impl Read, line: &mut [[u8; 4]], first: [u8; 4]) -> Result<(), Fault> {
    let (mut x, mut shift, mut pixel) = (0, 0u32, first);
    loop {
        if pixel[..3] == [1, 1, 1] {
            let n = usize::from(pixel[3]).checked_shl(shift).filter(|_| shift <= 24).ok_or(Fault::Runs)?;
            if x == 0 || n > line.len() - x {
                return Err(Fault::Runs);
            }
            let before = line[x - 1];
            line[x..x + n].fill(before);
            x += n;
            shift += 8;
        } else {
            line[x] = pixel;
            x += 1;
            shift = 0;
        }
        if x == line.len() {
            return Ok(());
        }
        file.read_exact(&mut pixel)?;
    }
}

/// A component is (byte + ½) / 256 · 2^(exponent - 128) in Radiance's own decoder, byte / 256 · 2^(exponent - 128) in
/// nearly every other program; we are with the many.
fn to_rgb([r, g, b, e]: [u8; 4], scale: f64) -> [f32; 3] {
    if e == 0 {
        return [0.0; 3];
    }
    let unit = 2f64.powi(i32::from(e) - 136) * scale;
    [r, g, b].map(|c| (f64::from(c) * unit) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PATH: &str = "a.hdr";

    fn file(header: &str, pixels: &[u8]) -> Vec<u8> {
        let mut bytes = format!("#?RGBE\n{header}\n").into_bytes();
        bytes.extend(pixels);
        bytes
    }

    fn parse(bytes: &[u8]) -> Result<Image, FormatError> {
        decode(Path::new(PATH), &mut &bytes[..], bytes.len() as u64)
    }

    #[test]
    fn plain_pixels_exposure_and_every_orientation() {
        // Two rows of three: reds 1 to 6 in units of 2^-8 · 2^(136-128) = 1.
        let pixels: Vec<u8> = (1..=6u8).flat_map(|r| [r, 0, 128, 136]).collect();
        let reds =
            |header: &str| -> Vec<f32> { parse(&file(header, &pixels)).unwrap().texels.iter().map(|t| t[0]).collect() };
        assert_eq!(reds("\n-Y 2 +X 3"), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(reds("EXPOSURE=4\nEXPOSURE= 0.5\n\n-Y 2 +X 3"), [0.5, 1.0, 1.5, 2.0, 2.5, 3.0]);
        assert_eq!(reds("\n+Y 2 +X 3"), [4.0, 5.0, 6.0, 1.0, 2.0, 3.0]);
        assert_eq!(reds("\n-Y 2 -X 3"), [3.0, 2.0, 1.0, 6.0, 5.0, 4.0]);
        assert_eq!(reds("\n+X 3 -Y 2"), [1.0, 3.0, 5.0, 2.0, 4.0, 6.0]);
        assert_eq!(reds("\n-X 3 +Y 2"), [6.0, 4.0, 2.0, 5.0, 3.0, 1.0]);
        assert_eq!(parse(&file("\n-Y 2 +X 3", &pixels)).unwrap().texels[0], [1.0, 0.0, 128.0]);
    }

    #[test]
    fn both_run_length_codings() {
        let mut new = vec![2, 2, 0, 9];
        for value in [10, 20, 30] {
            new.extend([128 + 7, value, 2, 1, 2]);
        }
        new.extend([128 + 9, 136]);
        let image = parse(&file("FORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 9", &new)).unwrap();
        assert_eq!(image.texels[6], [10.0, 20.0, 30.0]);
        assert_eq!((image.texels[7], image.texels[8]), ([1.0; 3], [2.0; 3]));

        // One pixel, repeated 3 + 1·256 times.
        let old = [[5, 6, 7, 136], [1, 1, 1, 3], [1, 1, 1, 1], [9, 9, 9, 136]].concat();
        let image = parse(&file("\n-Y 1 +X 261", &old)).unwrap();
        assert!(image.texels[..260].iter().all(|t| *t == [5.0, 6.0, 7.0]));
        assert_eq!(image.texels[260], [9.0; 3]);
    }

    #[test]
    fn damage_is_told_with_its_place() {
        let told = |header: &str, pixels: &[u8]| parse(&file(header, pixels)).unwrap_err().to_string();
        assert_eq!(told("EXPOSURE=0\n\n-Y 1 +X 1", &[]), "a.hdr: line 2: EXPOSURE=0 is not a number above 0");
        assert_eq!(told("\n-Y 2 +X 3", &[0; 13]), "a.hdr: scanline 1: the file ends here");
        assert_eq!(
            told("\n-Y 1000000 +X 1000000", &[]),
            "a.hdr: header: claims 1000000 × 1000000 pixels; from 1 to 268435456 are read"
        );
        assert!(told("\n-Y 16000 +X 16000", &[0; 100]).ends_with("more than 126 bytes can hold"));
        assert!(told("\n-Y 1 -Y 2", &[]).contains("line 3: \"-Y 1 -Y 2\" does not give the size"));
        assert_eq!(
            told("FORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1", &[]),
            "a.hdr: FORMAT=32-bit_rle_xyze is not read; 32-bit_rle_rgbe is"
        );
        for runs in [&[1, 1, 1, 9][..], &[7, 7, 7, 7, 1, 1, 1, 9], &[2, 2, 0, 8, 0], &[2, 2, 0, 8, 137, 5]] {
            assert!(told("\n-Y 1 +X 8", runs).ends_with("runs of pixels leave the scanline"), "{runs:?}");
        }
        // Runs of nothing, for ever more significant digits.
        let nothing = [[7, 7, 7, 7].as_slice(), &[1, 1, 1, 0].repeat(50)].concat();
        assert!(told("\n-Y 1 +X 8", &nothing).ends_with("runs of pixels leave the scanline"));
    }
}
