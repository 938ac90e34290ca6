//! Decompression that never makes more bytes than its input can hold.

use std::io::Read;

use super::fault::{Fault, room};

/// Deflate spends at least two bits on 258 bytes, so that nothing grows by more than this.
const MAX_RATIO: u64 = 1032;

/// The first bytes of a gzip stream.
pub(super) fn is_gzip(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x1f, 0x8b])
}

/// The first `wanted` bytes of a gzip or zlib stream. Where the stream ends there, its checksum is checked.
///
/// # Errors
/// More wanted than `packed` can hold (found before anything is allocated), a stream that is damaged or ends early.
pub(super) fn inflate(packed: &[u8], wanted: u64) -> Result<Vec<u8>, Fault> {
    if wanted > (packed.len() as u64).saturating_mul(MAX_RATIO) {
        return Err(Fault::new(format!(
            "{wanted} bytes are to come out of {} compressed ones; deflate packs at most {MAX_RATIO} to 1, so the \
             header or the data is wrong",
            packed.len()
        )));
    }
    let mut stream: Box<dyn Read + '_> = if is_gzip(packed) {
        Box::new(flate2::read::MultiGzDecoder::new(packed))
    } else {
        Box::new(flate2::read::ZlibDecoder::new(packed))
    };
    let damaged = |e: std::io::Error| Fault::new(format!("the compressed data is damaged or cut short: {e}"));
    let mut out = room(wanted as usize)?;
    stream.by_ref().take(wanted).read_to_end(&mut out).map_err(damaged)?;
    if (out.len() as u64) < wanted {
        return Err(Fault::new(format!("the compressed data ends after {} of {wanted} bytes", out.len())));
    }
    stream.read(&mut [0]).map_err(damaged)?;
    Ok(out)
}
