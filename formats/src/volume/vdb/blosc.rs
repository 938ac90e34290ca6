//! The container of Blosc 1: blocks of shuffled bytes, packed by another codec.
//!
//! Source: the description of the chunk format in c-blosc's `README_CHUNK_FORMAT.rst`.

use std::io::Read;

use super::super::fault::Fault;

/// Bytes of the header.
const HEADER: usize = 16;

/// Bits of the header's flags; the codec is in the three bits from 5 on.
const SHUFFLED: u8 = 1;
const STORED: u8 = 2;
const BIT_SHUFFLED: u8 = 4;
const NOT_SPLIT: u8 = 16;

/// A block is split into one stream for each byte of a value only up to this size of value, and down to this many values.
const MAX_SPLITS: usize = 16;
const MIN_SPLIT: usize = 128;

/// OpenVDB pads short buffers before it packs them.
const PADDED: usize = 128;
const UNPADDED: usize = 48;

fn u32_at(bytes: &[u8], at: usize) -> Result<usize, Fault> {
    let four = at.checked_add(4).and_then(|end| bytes.get(at..end)).and_then(|b| b.first_chunk::<4>());
    four.map(|b| u32::from_le_bytes(*b) as usize).ok_or_else(|| Fault::new("the Blosc data is cut short"))
}

/// Unpacks `packed` into `out`, which gets `wanted` bytes.
pub(super) fn unpack(packed: &[u8], wanted: usize, out: &mut Vec<u8>) -> Result<(), Fault> {
    let cut = || Fault::new("the Blosc data is cut short");
    let (flags, value) = match packed.get(..HEADER) {
        Some(header) => (header[2], usize::from(header[3])),
        None => return Err(cut()),
    };
    let (bytes, block) = (u32_at(packed, 4)?, u32_at(packed, 8)?);
    let padded = (UNPADDED + 1..PADDED).contains(&wanted) && bytes == PADDED;
    if bytes != wanted && !padded {
        return Err(Fault::new(format!("{bytes} bytes in Blosc data, where {wanted} belong")));
    }
    out.clear();
    out.resize(bytes, 0);
    if flags & STORED != 0 {
        out.copy_from_slice(packed.get(HEADER..HEADER + bytes).ok_or_else(cut)?);
        out.truncate(wanted);
        return Ok(());
    }
    if flags & BIT_SHUFFLED != 0 {
        return Err(Fault::Unsupported("has Blosc data with shuffled bits, which OpenVDB does not write".into()));
    }
    if block == 0 {
        return Err(Fault::new("the Blosc data has blocks of 0 bytes"));
    }
    let shuffled = flags & SHUFFLED != 0 && value > 1;
    let mut streams = vec![0; if shuffled { block.min(bytes) } else { 0 }];
    for (n, target) in out.chunks_mut(block).enumerate() {
        let mut at = u32_at(packed, HEADER + 4 * n)?;
        let leftover = target.len() < block;
        let split =
            flags & NOT_SPLIT == 0 && !leftover && (1..=MAX_SPLITS).contains(&value) && block / value >= MIN_SPLIT;
        let parts = if split { value } else { 1 };
        let length = target.len();
        let unpacked = if shuffled { &mut streams[..length] } else { &mut *target };
        for part in unpacked.chunks_exact_mut(length / parts) {
            let size = u32_at(packed, at)?;
            let source = at.checked_add(4 + size).and_then(|end| packed.get(at + 4..end)).ok_or_else(cut)?;
            at += 4 + size;
            if size == part.len() {
                part.copy_from_slice(source);
            } else {
                decode(flags >> 5, source, part)?;
            }
        }
        if shuffled {
            unshuffle(&streams[..length], value, target);
        }
    }
    out.truncate(wanted);
    Ok(())
}

/// One stream of codec number `codec`, which must fill `out`.
fn decode(codec: u8, source: &[u8], out: &mut [u8]) -> Result<(), Fault> {
    let damaged = |why: String| Fault::new(format!("the Blosc data is damaged: {why}"));
    match codec {
        1 => {
            let count = lz4_flex::block::decompress_into(source, out).map_err(|e| damaged(e.to_string()))?;
            if count == out.len() { Ok(()) } else { Err(damaged(format!("{count} bytes of {}", out.len()))) }
        }
        3 => flate2::read::ZlibDecoder::new(source).read_exact(out).map_err(|e| damaged(e.to_string())),
        _ => {
            let name = ["BloscLZ", "LZ4", "Snappy", "zlib", "Zstandard"].get(usize::from(codec)).unwrap_or(&"unknown");
            Err(Fault::Unsupported(format!(
                "has Blosc data of codec {codec} ({name}); airlight reads LZ4, which OpenVDB writes, and zlib"
            )))
        }
    }
}

/// Puts the bytes of each value together again; what is left past the last whole value is not shuffled.
fn unshuffle(streams: &[u8], value: usize, out: &mut [u8]) {
    let count = out.len() / value;
    for (i, bytes) in out.chunks_exact_mut(value).enumerate() {
        for (j, byte) in bytes.iter_mut().enumerate() {
            *byte = streams[j * count + i];
        }
    }
    out[count * value..].copy_from_slice(&streams[count * value..]);
}
