//! How a device holds the texels of a field.

use super::{DeviceError, FieldFormat, FieldSpec, ResourceSpec};

/// How a device holds the texels of a field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Layout {
    /// Every texel, in whole z-slices: layer fastest, then x, y and z.
    #[default]
    Dense,
    /// Bricks behind an index.
    Bricks(BrickLayout),
}

/// Bricks of a field of one layer of scalars, for what is the same almost everywhere.
///
/// The texels are cut into *blocks* of 8³ from the first one on. A word of the index, one for each block, x fastest, names
/// the brick that holds the block's texels. A brick has 9³: the block's, and one more along each axis, so that a trilinear
/// lookup finds all that it needs in one brick. What would lie past the last texel repeats it. Blocks may share a brick,
/// and those of one value do.
///
/// In memory, as the host writes it, the index comes first, and then brick after brick, texels x fastest; one of
/// [`FieldFormat::Half`] ends with a half that is not looked at, so that bricks are whole words. The host writes words of
/// the index or whole bricks, never both at once. A device refuses words that name no brick, and kernels need not look.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BrickLayout {
    /// Bricks.
    pub bricks: u32,
    /// The first so many bricks each hold one value throughout.
    pub constants: u32,
}

impl BrickLayout {
    /// Texels of a block along each axis.
    pub const BLOCK: u32 = 8;
    /// Texels of a brick along each axis.
    pub const SIDE: u32 = Self::BLOCK + 1;
    /// The most blocks of a cell of which kernels ask whether they are the same.
    pub const SAME: u32 = 128;
    /// Texels of a brick.
    pub const TEXELS: usize = Self::SIDE.pow(3) as usize;

    /// Blocks along x, y and z of so many texels.
    pub fn blocks(dims: [u32; 3]) -> [u32; 3] {
        dims.map(|d| d.div_ceil(Self::BLOCK))
    }

    /// Bytes of the index of so many texels along x, y and z.
    pub fn index_bytes(dims: [u32; 3]) -> u64 {
        Self::blocks(dims).iter().fold(4, |n: u64, &b| n.saturating_mul(b.into()))
    }

    /// Bytes from one brick to the next.
    pub fn brick_bytes(format: FieldFormat) -> u64 {
        (Self::TEXELS as u64 * format.bytes()).next_multiple_of(4)
    }
}

/// What a device holds beside dense fields of 32-bit floats ([`Device::field_kinds`](super::Device::field_kinds)).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FieldKinds {
    /// Fields of [`FieldFormat::Half`].
    pub halves: bool,
    /// Fields in [`Layout::Bricks`].
    pub bricks: bool,
}

impl FieldKinds {
    /// All there are.
    pub const ALL: Self = Self { halves: true, bricks: true };
}

impl ResourceSpec {
    /// Whether a device that holds fields of these kinds may make such a resource, whatever its size.
    ///
    /// # Errors
    /// Halves or bricks where the device has none; of several layers; bricks of colours, of none, or of more values than
    /// bricks.
    pub fn check_kind(&self, kinds: FieldKinds) -> Result<(), DeviceError> {
        let Self::Field(spec) = self else { return Ok(()) };
        let invalid = |text: String| Err(DeviceError::Invalid(text));
        let (half, bricks) = (matches!(spec.format, FieldFormat::Half { .. }), spec.layout != Layout::Dense);
        if half && !kinds.halves {
            return invalid("the device holds no fields of 16-bit floats, only of 32-bit ones".into());
        }
        if bricks && !kinds.bricks {
            return invalid("the device holds no fields in bricks, only dense ones".into());
        }
        if let FieldFormat::Half { exponent } = spec.format
            && !(FieldFormat::LEAST_EXPONENT..=FieldFormat::MOST_EXPONENT).contains(&exponent)
        {
            return invalid(format!("halves times 2^{exponent}, which 32-bit floats do not hold"));
        }
        if (half || bricks) && (spec.layers != 1 || spec.format == FieldFormat::Rgba) {
            return invalid(format!("halves and bricks are of one layer of scalars, not {spec:?}"));
        }
        match spec.layout {
            Layout::Bricks(BrickLayout { bricks, constants }) if bricks == 0 || constants > bricks => {
                invalid(format!("{bricks} bricks, of which {constants} hold one value"))
            }
            _ => Ok(()),
        }
    }
}

/// Whether `data` may be written at `offset` of a field in bricks that has the room.
pub(super) fn check_bricks(spec: &FieldSpec, layout: BrickLayout, offset: u64, data: &[u8]) -> Result<(), DeviceError> {
    let (index, brick) = (BrickLayout::index_bytes(spec.dims), BrickLayout::brick_bytes(spec.format));
    let invalid = |text: String| Err(DeviceError::Invalid(text));
    if offset >= index {
        let whole = (offset - index).is_multiple_of(brick) && (data.len() as u64).is_multiple_of(brick);
        return if whole { Ok(()) } else { invalid(format!("bricks are written whole, {brick} bytes each")) };
    }
    if offset + data.len() as u64 > index {
        return invalid(format!("an index of {index} bytes is written by itself, and bricks in another call"));
    }
    let word = |bytes: &[u8]| bytes.iter().rev().fold(0, |word, &byte| word << 8 | u32::from(byte));
    match data.chunks_exact(4).map(word).zip(offset / 4..).find(|(word, _)| *word >= layout.bricks) {
        Some((word, block)) => invalid(format!("block {block} names brick {word} of {}", layout.bricks)),
        None => Ok(()),
    }
}
