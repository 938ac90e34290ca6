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

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    /// Packs `data` by zlib in blocks of `block` bytes, shuffled over values of `value` bytes.
    fn pack(data: &[u8], block: usize, value: usize, split: bool) -> Vec<u8> {
        let flags = 3 << 5 | SHUFFLED | if split { 0 } else { NOT_SPLIT };
        let mut head = vec![2, 1, flags, value as u8];
        for n in [data.len(), block, 0] {
            head.extend((n as u32).to_le_bytes());
        }
        let starts = head.len() + 4 * data.len().div_ceil(block);
        let mut body = Vec::new();
        for bytes in data.chunks(block) {
            head.extend(((starts + body.len()) as u32).to_le_bytes());
            let mut streams = Vec::new();
            (0..value).for_each(|j| streams.extend(bytes.chunks_exact(value).map(|v| v[j])));
            streams.extend(&bytes[streams.len()..]);
            let parts = if split && bytes.len() == block { value } else { 1 };
            for stream in streams.chunks(bytes.len() / parts) {
                let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
                encoder.write_all(stream).unwrap();
                let mut packed = encoder.finish().unwrap();
                if packed.len() >= stream.len() {
                    packed = stream.to_vec();
                }
                body.extend((packed.len() as u32).to_le_bytes());
                body.extend(packed);
            }
        }
        [head, body].concat()
    }

    #[test]
    fn blocks_splits_and_what_is_left_over() {
        // Not a whole number of blocks, nor of values.
        let data: Vec<u8> = (0..4099u32).map(|n| (n * n / 7) as u8).collect();
        for (block, value, split) in [(1024, 4, true), (1024, 4, false), (512, 4, true), (4099, 3, false)] {
            let packed = pack(&data, block, value, split);
            let mut out = Vec::new();
            unpack(&packed, data.len(), &mut out).unwrap();
            assert!(out == data, "blocks of {block}, values of {value}, split: {split}");
            for cut in 0..packed.len() {
                unpack(&packed[..cut], data.len(), &mut out).unwrap_err();
            }
        }
    }

    #[test]
    fn stored_and_padded_bytes_and_codecs_that_are_not_read() {
        let data: Vec<u8> = (0..128).collect();
        let mut stored = vec![2, 1, STORED, 4, 128, 0, 0, 0, 128, 0, 0, 0, 144, 0, 0, 0];
        stored.extend(&data);
        let mut out = Vec::new();
        for (wanted, well) in [(128, true), (127, true), (49, true), (48, false), (129, false)] {
            assert_eq!(unpack(&stored, wanted, &mut out).is_ok(), well, "{wanted}");
            assert!(!well || out == data[..wanted]);
        }
        let mut other = pack(&[0; 1024], 1024, 4, true);
        other[2] = other[2] & 31 | 4 << 5;
        let fault = unpack(&other, 1024, &mut out).unwrap_err().text();
        assert!(fault.contains("Zstandard"), "{fault}");
    }
}
