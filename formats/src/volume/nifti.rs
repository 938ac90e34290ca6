//! NIfTI-1 in one file (`.nii`, `.nii.gz`).
//!
//! Source: the NIfTI-1.1 header `nifti1.h` of the NIMH, with its three methods of placement.

use glam::{DMat3, DVec3};

use super::dense::{self, Data, Encoding, Header};
use super::fault::Fault;
use super::inflate::{inflate, is_gzip};
use super::sample::Sample;

/// Bytes of the header, and the number that it begins with.
const SIZE: usize = 348;

/// The number that a header of NIfTI-2 begins with.
const SIZE_2: i32 = 540;

/// The bytes of the header, out of a gzip stream where the file is one.
fn head(bytes: &[u8]) -> Result<[u8; SIZE], Fault> {
    let cut = || Fault::new(format!("the file is cut short: a NIfTI-1 header has {SIZE} bytes"));
    let unpacked;
    let plain = if is_gzip(bytes) {
        unpacked = inflate(bytes, SIZE as u64)?;
        &unpacked[..]
    } else {
        bytes
    };
    plain.first_chunk::<SIZE>().copied().ok_or_else(cut)
}

/// Whether a file that begins so is a NIfTI file, of version 2 too (which [`header`] refuses by name).
pub(super) fn is_nifti(bytes: &[u8]) -> bool {
    let head = match head(bytes) {
        Ok(head) => head,
        Err(_) => return false,
    };
    let size = [head[0], head[1], head[2], head[3]];
    let is = |n: i32| i32::from_le_bytes(size) == n || i32::from_be_bytes(size) == n;
    (is(SIZE as i32) && (&head[344..347] == b"n+1" || &head[344..347] == b"ni1"))
        || (is(SIZE_2) && &head[4..6] == b"n+")
}

/// A header's numbers at their offsets, in the file's byte order.
struct Fields {
    head: [u8; SIZE],
    big_endian: bool,
}

impl Fields {
    fn at<const N: usize>(&self, offset: usize) -> [u8; N] {
        let mut bytes: [u8; N] = std::array::from_fn(|i| self.head[offset + i]);
        if self.big_endian {
            bytes.reverse();
        }
        bytes
    }

    fn i32(&self, offset: usize) -> i32 {
        i32::from_le_bytes(self.at(offset))
    }

    fn i16(&self, offset: usize) -> i16 {
        i16::from_le_bytes(self.at(offset))
    }

    fn f32(&self, offset: usize) -> f64 {
        f32::from_le_bytes(self.at(offset)).into()
    }

    fn vec3(&self, offset: usize) -> DVec3 {
        DVec3::new(self.f32(offset), self.f32(offset + 4), self.f32(offset + 8))
    }
}

/// Reads the header.
pub(super) fn header(bytes: &[u8]) -> Result<Header, Fault> {
    let mut fields = Fields { head: head(bytes)?, big_endian: false };
    if fields.i32(0) != SIZE as i32 {
        fields.big_endian = true;
    }
    match fields.i32(0) {
        n if n == SIZE as i32 => {}
        _ if i32::from_le_bytes(fields.at(0)) == SIZE_2 || i32::from_be_bytes(fields.at(0)) == SIZE_2 => {
            return Err(Fault::Unsupported("a NIfTI-2 file; airlight reads NIfTI-1".into()));
        }
        n => return Err(Fault::at("header field 'sizeof_hdr'", format!("{n}, where {SIZE} belongs"))),
    }
    if &fields.head[344..348] == b"ni1\0" {
        return Err(Fault::Unsupported(
            "a NIfTI header whose data is in an .img file; airlight reads NIfTI-1 in one file (.nii)".into(),
        ));
    }
    let dims = sides(&fields).map_err(|f| f.within("header field 'dim'"))?;
    let sample = sample(fields.i16(70))?;
    let offset = match fields.f32(108) {
        0.0 => 352.0,
        n => n,
    };
    if !(offset >= SIZE as f64 && offset < 1e15 && offset.fract() == 0.0) {
        return Err(Fault::at(
            "header field 'vox_offset'",
            format!("{offset}; the data begins at a whole byte, mostly 352"),
        ));
    }
    let (slope, intercept) = (fields.f32(112), fields.f32(116));
    let scaled = slope != 0.0 && slope.is_finite() && intercept.is_finite();
    let rescale = (scaled && (slope, intercept) != (1.0, 0.0)).then_some((slope, intercept));
    let data = Data { file: None, offset: 0, lines: 0, skip: Some(offset as u64) };
    let encoding = if is_gzip(bytes) { Encoding::Deflate } else { Encoding::Raw };
    let index_to_world = placement(&fields)?;
    Ok(Header { dims, sample, big_endian: fields.big_endian, rescale, index_to_world, encoding, data })
}

fn sides(fields: &Fields) -> Result<glam::UVec3, Fault> {
    let rank = fields.i16(40);
    if !(1..=7).contains(&rank) {
        return Err(Fault::new(format!("{rank} dimensions; NIfTI has from 1 to 7")));
    }
    let side = |n: i16| if n <= rank { i64::from(fields.i16(40 + 2 * n as usize)) } else { 1 };
    if rank < 3 {
        return Err(Fault::new(format!("{rank} dimensions; a volume has 3")));
    }
    if let Some(n) = (4..=7).find(|n| side(*n) != 1) {
        return Err(Fault::Unsupported(format!("{} values along dimension {n}; a volume has 3 dimensions", side(n))));
    }
    dense::dims([side(1), side(2), side(3)])
}

fn sample(code: i16) -> Result<Sample, Fault> {
    Ok(match code {
        2 => Sample::U8,
        4 => Sample::I16,
        8 => Sample::I32,
        16 => Sample::F32,
        64 => Sample::F64,
        256 => Sample::I8,
        512 => Sample::U16,
        768 => Sample::U32,
        1024 => Sample::I64,
        1280 => Sample::U64,
        _ => {
            let name = match code {
                1 => " (bits)",
                32 | 1792 | 2048 => " (complex numbers)",
                128 | 2304 => " (colours)",
                1536 => " (128-bit floats)",
                _ => "",
            };
            return Err(Fault::Unsupported(format!(
                "values of NIfTI datatype {code}{name}; airlight reads integers of 8 to 64 bits, float32 and float64"
            )));
        }
    })
}

/// The map from index to metres by the first of the three methods that the file gives, or none.
fn placement(fields: &Fields) -> Result<Option<glam::DAffine3>, Fault> {
    let metre = match fields.head[123] & 7 {
        1 => 1.0,
        3 => 1e-6,
        // Millimetres, which readers of the field also assume where the code is 0, unknown.
        0 | 2 => 1e-3,
        n => return Err(Fault::at("header field 'xyzt_units'", format!("{n} is no unit of length"))),
    };
    let spacing = fields.vec3(80);
    if fields.i16(254) > 0 {
        let row = |offset| (fields.vec3(offset), fields.f32(offset + 12));
        let ((x, tx), (y, ty), (z, tz)) = (row(280), row(296), row(312));
        let steps = DMat3::from_cols(x, y, z).transpose() * metre;
        return Ok(Some(glam::DAffine3::from_mat3_translation(steps, DVec3::new(tx, ty, tz) * metre)));
    }
    if fields.i16(252) > 0 {
        let q = fields.vec3(256);
        let length = q.length_squared();
        // The three parts are floats: a half turn is stored as a length a rounding step past 1.
        if length.is_nan() || length > 1.0 + 1e-5 {
            return Err(Fault::at("header fields 'quatern_b' to 'quatern_d'", format!("{q} is longer than 1")));
        }
        let turn = DMat3::from_quat(glam::DQuat::from_xyzw(q.x, q.y, q.z, (1.0 - length).max(0.0).sqrt()).normalize());
        let flip = if fields.f32(76) < 0.0 { -1.0 } else { 1.0 };
        let edge = spacing.abs() * DVec3::new(1.0, 1.0, flip) * metre;
        let [x, y, z] = [turn.x_axis * edge.x, turn.y_axis * edge.y, turn.z_axis * edge.z];
        return Ok(Some(dense::affine(x, y, z, fields.vec3(268) * metre)));
    }
    if spacing == DVec3::ZERO {
        return Ok(None);
    }
    let edge = spacing.abs() * metre;
    Ok(Some(dense::affine(DVec3::X * edge.x, DVec3::Y * edge.y, DVec3::Z * edge.z, DVec3::ZERO)))
}
