//! Handles of what a device holds.

use std::marker::PhantomData;

use half::f16;

use super::kernel::{BufferElement, KernelElement, KernelScalar};
use super::layout::{BrickLayout, Layout};

/// Identity of a resource on a device; the executor chooses it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ResourceId(pub u32);

/// What a buffer is for, so that a device may place it well.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Usage {
    /// The host writes, stages read.
    Input,
    /// Stages write and read.
    Work,
    /// Stages write, the host reads.
    Output,
}

/// What a texel of a field holds. Kernels see 32-bit floats.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FieldFormat {
    /// One value, a 32-bit float.
    Scalar,
    /// One value, a 16-bit float of IEEE 754 (binary16) times 2^`exponent`.
    Half {
        /// From [`FieldFormat::LEAST_EXPONENT`] to [`FieldFormat::MOST_EXPONENT`]. Kernels are built for it.
        exponent: i8,
    },
    /// Red, green, blue and one more, 32-bit floats.
    Rgba,
}

impl FieldFormat {
    /// The least exponent of halves: the smallest of them is still a normal number as a 32-bit float.
    pub const LEAST_EXPONENT: i8 = -96;
    /// The largest exponent of halves, by far enough for [`LARGEST`](crate::media::LARGEST).
    pub const MOST_EXPONENT: i8 = 48;

    /// Halves for values from 0 to `most`. The exponent is a multiple of 8, so that few differ, and puts `most` between
    /// 2^7 and 2^15: what is 2^21 times smaller still has all bits of a half.
    pub fn half(most: f32) -> Self {
        // f32's own exponent; that of zero and of subnormal numbers is below all others.
        let log2 = (most.to_bits() >> 23 & 0xff) as i32 - 127;
        let exponent = (log2 - 7).div_euclid(8) * 8;
        let exponent = exponent.clamp(Self::LEAST_EXPONENT.into(), Self::MOST_EXPONENT.into());
        Self::Half { exponent: exponent as i8 }
    }

    /// What a texel's number is multiplied by.
    pub fn factor(self) -> f32 {
        match self {
            Self::Scalar | Self::Rgba => 1.0,
            Self::Half { exponent } => f32::from_bits(((127 + i32::from(exponent)) as u32) << 23),
        }
    }

    /// Bytes of a texel.
    pub fn bytes(self) -> u64 {
        match self {
            Self::Scalar => 4,
            Self::Half { .. } => 2,
            Self::Rgba => 16,
        }
    }

    /// What a texel is in kernels.
    pub fn element(self) -> KernelElement {
        match self {
            Self::Scalar | Self::Half { .. } => KernelElement::Scalar(KernelScalar::F32),
            Self::Rgba => KernelElement::Scalar(KernelScalar::F32x4),
        }
    }

    /// Writes the bytes of as many texels as there are values, one each, as the host writes them to a device; `out` may be
    /// longer. Values past the largest half become it.
    pub fn encode(self, values: &[f32], out: &mut [u8]) {
        if let Self::Half { .. } = self {
            let by = 1.0 / self.factor();
            for (&v, to) in values.iter().zip(out.chunks_exact_mut(2)) {
                to.copy_from_slice(&f16::from_f32((v * by).min(f16::MAX.to_f32())).to_le_bytes());
            }
        } else {
            out[..size_of_val(values)].copy_from_slice(bytemuck::cast_slice(values));
        }
    }
}

/// Shape of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FieldSpec {
    /// Texels along x, y and z.
    pub dims: [u32; 3],
    /// 3-D arrays of that size, side by side; a lookup never mixes two.
    pub layers: u32,
    /// What a texel holds.
    pub format: FieldFormat,
    /// How texels are held.
    pub layout: Layout,
}

impl FieldSpec {
    /// A dense field.
    pub const fn dense(dims: [u32; 3], layers: u32, format: FieldFormat) -> Self {
        Self { dims, layers, format, layout: Layout::Dense }
    }

    /// The same field in bricks.
    pub const fn in_bricks(self, layout: BrickLayout) -> Self {
        Self { layout: Layout::Bricks(layout), ..self }
    }

    /// Texels of all layers; the largest number there is where they are more.
    pub fn texels(&self) -> u64 {
        self.dims.iter().fold(u64::from(self.layers), |n, &d| n.saturating_mul(d.into()))
    }

    /// Bytes of one z-slice of all layers. The host writes dense fields in whole slices: layer fastest, then x, y and z.
    pub fn slice_bytes(&self) -> u64 {
        let texels = u64::from(self.dims[0]).saturating_mul(self.dims[1].into()).saturating_mul(self.layers.into());
        texels.saturating_mul(self.format.bytes())
    }

    /// Bytes of all layers, or of the index and all bricks.
    pub fn bytes(&self) -> u64 {
        match self.layout {
            Layout::Dense => self.texels().saturating_mul(self.format.bytes()),
            Layout::Bricks(layout) => {
                let bricks = u64::from(layout.bricks).saturating_mul(BrickLayout::brick_bytes(self.format));
                BrickLayout::index_bytes(self.dims).saturating_add(bricks)
            }
        }
    }
}

/// What to create.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ResourceSpec {
    /// Memory that stages index.
    Buffer {
        /// Its size.
        bytes: u64,
        /// What it is for.
        usage: Usage,
    },
    /// A 3-D array that stages sample.
    Field(FieldSpec),
}

impl ResourceSpec {
    /// Bytes of memory it takes.
    pub fn bytes(&self) -> u64 {
        match self {
            Self::Buffer { bytes, .. } => *bytes,
            Self::Field(field) => field.bytes(),
        }
    }
}

/// A typed handle of a buffer of `len` elements.
#[derive(Debug, PartialEq, Eq)]
pub struct Buf<T> {
    /// The buffer.
    pub id: ResourceId,
    /// Elements.
    pub len: u64,
    element: PhantomData<fn() -> T>,
}

impl<T> Buf<T> {
    /// A handle of the buffer `id` of `len` elements.
    pub fn new(id: ResourceId, len: u64) -> Self {
        Self { id, len, element: PhantomData }
    }

    /// Bytes of all elements; `u64::MAX` where there are more.
    pub fn bytes(&self) -> u64 {
        self.len.saturating_mul(size_of::<T>() as u64)
    }
}

impl<T> Clone for Buf<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Buf<T> {}

/// A handle of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// The field.
    pub id: ResourceId,
    /// Its shape.
    pub spec: FieldSpec,
}

/// How a stage uses a resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BindingAccess {
    /// Samples a field.
    Sample(FieldSpec),
    /// Reads a buffer of that many bytes.
    Read(u64),
    /// Writes (all of its range's part of) a buffer of that many bytes.
    Write(u64),
}

/// One resource of a stage, under the name that the kernels use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Binding {
    /// Name in the kernels.
    pub name: &'static str,
    /// The resource; none where the stage runs without it.
    pub id: Option<ResourceId>,
    /// How it is used.
    pub access: BindingAccess,
    /// What a buffer's element or a field's texel is in kernels.
    pub element: KernelElement,
    /// Bytes of a buffer that one group of the work axis ([`Kernel::group`](crate::stage::Kernel::group)) touches:
    /// group g touches bytes g · `part` to (g + 1) · `part`, the last one as far as the buffer reaches. A device may
    /// then bind only the part of its range. None where any unit may touch any byte.
    pub part: Option<u64>,
}

impl Binding {
    /// A field that is sampled. Its format is said also where the stage runs without it, because a kernel is typed.
    pub fn sample(name: &'static str, format: FieldFormat, field: Option<Field>) -> Self {
        let none = FieldSpec::dense([0; 3], 0, format);
        let access = BindingAccess::Sample(field.map_or(none, |f| f.spec));
        Self { name, id: field.map(|f| f.id), access, element: format.element(), part: None }
    }

    /// A buffer that is read.
    pub fn read<T: BufferElement>(name: &'static str, buf: Option<Buf<T>>) -> Self {
        let access = BindingAccess::Read(buf.map_or(0, |b| b.bytes()));
        Self { name, id: buf.map(|b| b.id), access, element: T::ELEMENT, part: None }
    }

    /// A buffer that is written.
    pub fn write<T: BufferElement>(name: &'static str, buf: Option<Buf<T>>) -> Self {
        let access = BindingAccess::Write(buf.map_or(0, |b| b.bytes()));
        Self { name, id: buf.map(|b| b.id), access, element: T::ELEMENT, part: None }
    }

    /// The same, of which each group of the work axis touches `elements` elements of its own, in order.
    pub fn in_parts<T>(self, elements: u64) -> Self {
        Self { part: Some(elements * size_of::<T>() as u64), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::media::LARGEST;

    #[test]
    fn exponents_put_the_largest_value_where_halves_have_all_bits() {
        for most in [1e-30, 6e-8, 0.01, 0.9999, 1.0, 2.0, 255.9, 32768.0, 1e9, LARGEST] {
            let format = FieldFormat::half(most);
            let FieldFormat::Half { exponent } = format else { panic!("{format:?}") };
            assert_eq!((exponent % 8, format.bytes(), format.factor()), (0, 2, 2f32.powi(exponent.into())));
            let scaled = most / format.factor();
            assert!((128.0..32768.0).contains(&scaled) || exponent == FieldFormat::LEAST_EXPONENT, "{most}: {scaled}");
        }
        for (most, least) in [(0.0, FieldFormat::LEAST_EXPONENT), (f32::MAX, FieldFormat::MOST_EXPONENT)] {
            assert_eq!(FieldFormat::half(most), FieldFormat::Half { exponent: least });
        }
    }

    #[test]
    fn halves_are_rounded_to_eleven_bits_and_end_at_the_largest() {
        let format = FieldFormat::half(3.0);
        let values = [0.0, 3.0, 1.0 + 2f32.powi(-11), 1.0 + 3.0 * 2f32.powi(-11), 3.0 * 2f32.powi(-21), 1e9];
        let mut bytes = [0; 14];
        format.encode(&values, &mut bytes);
        let found = bytes.chunks_exact(2).map(|b| f16::from_le_bytes([b[0], b[1]]).to_f32() * format.factor());
        let expected = [0.0, 3.0, 1.0, 1.0 + 2f32.powi(-9), 3.0 * 2f32.powi(-21), 65504.0 / 256.0, 0.0];
        assert_eq!(found.collect::<Vec<_>>(), expected);
        let mut words = [0; 4];
        FieldFormat::Scalar.encode(&[1.5], &mut words);
        assert_eq!(words, 1.5f32.to_le_bytes());
    }
}
