//! Handles of what a device holds.

use std::marker::PhantomData;

use super::kernel::{BufferElement, KernelElement, KernelScalar};

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

/// What a texel of a field holds, in 32-bit floats.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FieldFormat {
    /// One value.
    Scalar,
    /// Red, green, blue and one more.
    Rgba,
}

impl FieldFormat {
    /// Bytes of a texel.
    pub fn bytes(self) -> u64 {
        match self {
            Self::Scalar => 4,
            Self::Rgba => 16,
        }
    }

    /// What a texel is in kernels.
    pub fn element(self) -> KernelElement {
        match self {
            Self::Scalar => KernelElement::Scalar(KernelScalar::F32),
            Self::Rgba => KernelElement::Scalar(KernelScalar::F32x4),
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
}

impl FieldSpec {
    /// Texels of all layers; the largest number there is where they are more.
    pub fn texels(&self) -> u64 {
        self.dims.iter().fold(u64::from(self.layers), |n, &d| n.saturating_mul(d.into()))
    }

    /// Bytes of one z-slice of all layers. The host writes fields in whole slices: layer fastest, then x, y and z.
    pub fn slice_bytes(&self) -> u64 {
        let texels = u64::from(self.dims[0]).saturating_mul(self.dims[1].into()).saturating_mul(self.layers.into());
        texels.saturating_mul(self.format.bytes())
    }

    /// Bytes of all layers.
    pub fn bytes(&self) -> u64 {
        self.texels().saturating_mul(self.format.bytes())
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
        let none = FieldSpec { dims: [0; 3], layers: 0, format };
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
