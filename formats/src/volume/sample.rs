//! The number types of dense volume files, and their way to f32.

use super::fault::{Fault, room};

/// How one voxel's value is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sample {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Sample {
    /// Bytes of one value.
    pub(super) fn size(self) -> u64 {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// The type's name in Rust, which every field understands.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::I8 => "i8",
            Self::U8 => "u8",
            Self::I16 => "i16",
            Self::U16 => "u16",
            Self::I32 => "i32",
            Self::U32 => "u32",
            Self::I64 => "i64",
            Self::U64 => "u64",
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }

    /// The values in `bytes` as f32, times `rescale.0` plus `rescale.1` where given (computed in f64).
    pub(super) fn decode(self, bytes: &[u8], big_endian: bool, rescale: Option<(f64, f64)>) -> Result<Vec<f32>, Fault> {
        let mut out = room(bytes.len() / self.size() as usize)?;
        macro_rules! convert {
            ($type:ty) => {{
                let (values, _) = bytes.as_chunks::<{ size_of::<$type>() }>();
                let number = |b: &[u8; size_of::<$type>()]| {
                    if big_endian { <$type>::from_be_bytes(*b) } else { <$type>::from_le_bytes(*b) }
                };
                match rescale {
                    None => out.extend(values.iter().map(|b| number(b) as f32)),
                    Some((slope, intercept)) => {
                        out.extend(values.iter().map(|b| (number(b) as f64 * slope + intercept) as f32));
                    }
                }
            }};
        }
        match self {
            Self::I8 => convert!(i8),
            Self::U8 => convert!(u8),
            Self::I16 => convert!(i16),
            Self::U16 => convert!(u16),
            Self::I32 => convert!(i32),
            Self::U32 => convert!(u32),
            Self::I64 => convert!(i64),
            Self::U64 => convert!(u64),
            Self::F32 => convert!(f32),
            Self::F64 => convert!(f64),
        }
        Ok(out)
    }
}
