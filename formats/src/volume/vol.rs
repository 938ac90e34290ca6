//! Mitsuba's grid volume (`.vol`), version 3: a header of 48 bytes with a box, then f32, x fastest.
//!
//! Source: the documentation of Mitsuba 3's `gridvolume` plugin.

use glam::{DVec3, UVec3};

use super::bytes::Reader;
use super::dense::{self, Data, Encoding, Header};
use super::fault::Fault;
use super::sample::Sample;

/// The tag and the version that follows it.
const MAGIC: &[u8] = b"VOL";

/// Whether a file that begins so is a .vol of any version.
pub(super) fn is_vol(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC) && bytes.get(3).is_some_and(|version| *version < 32)
}

/// Reads the header.
pub(super) fn header(bytes: &[u8]) -> Result<Header, Fault> {
    let mut r = Reader::new(bytes);
    r.take(MAGIC.len())?;
    let version = r.u8()?;
    if version != 3 {
        return Err(Fault::Unsupported(format!("a VOL file of version {version}; airlight reads version 3")));
    }
    let kind = r.i32()?;
    if kind != 1 {
        let name = match kind {
            2 => " (half float)",
            3 => " (8-bit integers)",
            4 => " (quantised directions)",
            _ => "",
        };
        return Err(Fault::Unsupported(format!("VOL values of type {kind}{name}; airlight reads type 1 (float32)")));
    }
    let claimed = [r.i32()?, r.i32()?, r.i32()?].map(i64::from);
    let dims: UVec3 = dense::dims(claimed).map_err(|f| f.within("header field 'resolution'"))?;
    let channels = r.i32()?;
    if channels != 1 {
        return Err(Fault::Unsupported(format!("a VOL file of {channels} channels; a density has 1")));
    }
    let mut corner = || Ok::<_, Fault>(DVec3::new(r.f32()?.into(), r.f32()?.into(), r.f32()?.into()));
    let (min, max) = (corner()?, corner()?);
    let size = max - min;
    if !(size.is_finite() && size.min_element() > 0.0) {
        return Err(Fault::at(
            "header field 'bounding box'",
            format!("{min} to {max} encloses no volume; each maximum must be above its minimum"),
        ));
    }
    let edge = size / dims.as_dvec3();
    let map = dense::affine(DVec3::X * edge.x, DVec3::Y * edge.y, DVec3::Z * edge.z, min + 0.5 * edge);
    Ok(Header {
        dims,
        sample: Sample::F32,
        big_endian: false,
        rescale: None,
        index_to_world: Some(map),
        encoding: Encoding::Raw,
        data: Data { file: None, offset: r.at() as u64, lines: 0, skip: Some(0) },
    })
}
