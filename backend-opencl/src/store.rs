//! What a device holds: buffers, and fields as slabs of slices.

use std::collections::HashMap;

use airlight_core::device::{
    Binding, BindingAccess, BrickLayout, DeviceError, FieldSpec, Layout, Limits, ResourceId, ResourceSpec, Slabs, Usage,
};
use ocl::core::Mem;

use crate::cl::{Arg, Cl};
use crate::source::{MAX_SLABS, Shape};

/// A resource.
#[derive(Debug)]
pub(crate) enum Resource {
    Buffer(Memory),
    Field(Volume),
}

/// Bytes behind the last texel of a slab: what is beside it, or in lanes of a run behind it, has no weight, but is read
/// with it.
pub(crate) const ROOM: u64 = 64;

/// A buffer and the bytes that were asked for, which it may exceed.
#[derive(Debug)]
pub(crate) struct Memory {
    pub(crate) mem: Mem,
    pub(crate) bytes: u64,
}

/// A field: whole z-slices of all layers, as the host writes them, cut into slabs that fit a buffer each; or an index and
/// bricks, which are cut likewise.
#[derive(Debug)]
pub(crate) struct Volume {
    pub(crate) spec: FieldSpec,
    pub(crate) slabs: Slabs,
    index: Option<Mem>,
    parts: Vec<Mem>,
}

/// Memory that the work-items of a dispatch share, of no meaning behind it. It grows and is kept.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    mem: Option<(Mem, u64)>,
}

impl Scratch {
    /// So many bytes at the least.
    pub(crate) fn of(&mut self, cl: &mut Cl, bytes: u64) -> Result<&Mem, DeviceError> {
        if self.mem.as_ref().is_none_or(|(_, has)| *has < bytes) {
            // The old goes first, so that there need not be room for both.
            self.mem = None;
            self.mem = Some((cl.zeros(bytes)?, bytes));
        }
        let made = self.mem.as_ref().map(|(mem, _)| mem);
        made.ok_or_else(|| DeviceError::Invalid("there is no scratch memory".into()))
    }

    /// Bytes that it has.
    pub(crate) fn bytes(&self) -> u64 {
        self.mem.as_ref().map_or(0, |(_, bytes)| *bytes)
    }
}

/// The resources under their ids.
#[derive(Debug, Default)]
pub(crate) struct Store {
    resources: HashMap<ResourceId, Resource>,
}

impl Resource {
    /// Makes what is asked for, filled with zeros.
    pub(crate) fn new(cl: &mut Cl, spec: &ResourceSpec, limits: &Limits) -> Result<Self, DeviceError> {
        match spec {
            &ResourceSpec::Buffer { bytes, .. } => {
                if bytes > limits.buffer_bytes {
                    let (what, limit) = ("a buffer", limits.buffer_bytes);
                    return Err(DeviceError::Limit { what, requested: bytes, limit });
                }
                Ok(Self::Buffer(Memory { mem: cl.zeros(bytes)?, bytes }))
            }
            ResourceSpec::Field(spec) => Volume::new(cl, *spec, limits).map(Self::Field),
        }
    }

    /// What was asked for.
    pub(crate) fn spec(&self) -> ResourceSpec {
        match self {
            Self::Buffer(memory) => ResourceSpec::Buffer { bytes: memory.bytes, usage: Usage::Work },
            Self::Field(volume) => ResourceSpec::Field(volume.spec),
        }
    }
}

impl Volume {
    fn new(cl: &mut Cl, spec: FieldSpec, limits: &Limits) -> Result<Self, DeviceError> {
        let [x, y, z] = spec.dims;
        if x == 0 || y == 0 || z == 0 || spec.layers == 0 {
            return Err(DeviceError::Invalid(format!("a field of {spec:?}")));
        }
        let side = limits.field_side;
        if let Some(&longest) = spec.dims.iter().find(|&&d| d > side) {
            let what = "the side of a field";
            return Err(DeviceError::Limit { what, requested: longest.into(), limit: side.into() });
        }
        if let Layout::Bricks(layout) = spec.layout {
            return Self::of_bricks(cl, spec, layout, limits);
        }
        // Two sides of 31 bits and layers of 32 may exceed 64 bits.
        let slice = [x, y, spec.layers].map(u128::from).iter().product::<u128>() * u128::from(spec.format.bytes());
        // A kernel counts the texels of a slab with 31 bits.
        let limit = limits.binding_bytes.min(i32::MAX as u64 * spec.format.bytes());
        let slabs = u64::try_from(slice).ok().and_then(|slice| Slabs::new(z, slice, limit, z));
        let Some(slabs) = slabs else {
            let requested = u64::try_from(slice).unwrap_or(u64::MAX);
            return Err(DeviceError::Limit { what: "a slice of a field", requested, limit });
        };
        if slabs.count() > MAX_SLABS {
            let (what, limit) = ("a field", slabs.per_slab as u64 * slice as u64 * u64::from(MAX_SLABS));
            return Err(DeviceError::Limit { what, requested: spec.bytes(), limit });
        }
        let bytes = |slab| slabs.range(slab).len() as u64 * spec.slice_bytes() + ROOM;
        let parts = (0..slabs.count()).map(|slab| cl.zeros(bytes(slab)));
        let parts = parts.collect::<Result<_, DeviceError>>()?;
        Ok(Self { spec, slabs, index: None, parts })
    }

    fn of_bricks(cl: &mut Cl, spec: FieldSpec, layout: BrickLayout, limits: &Limits) -> Result<Self, DeviceError> {
        let (index, brick) = (BrickLayout::index_bytes(spec.dims), BrickLayout::brick_bytes(spec.format));
        let exceeds = |what, requested, limit| Err(DeviceError::Limit { what, requested, limit });
        // A kernel counts blocks, bricks and the texels of a slab with 31 bits.
        let limit = limits.binding_bytes.min(i32::MAX as u64 * 4);
        if index > limit {
            return exceeds("the index of a field", index, limit);
        }
        let limit = limits.binding_bytes.min(i32::MAX as u64 * spec.format.bytes());
        let Some(slabs) = Slabs::new(layout.bricks, brick, limit, i32::MAX as u32) else {
            return exceeds("a brick", brick, limit);
        };
        if slabs.count() > MAX_SLABS {
            let most = u64::from(slabs.per_slab) * brick * u64::from(MAX_SLABS);
            return exceeds("the bricks of a field", spec.bytes() - index, most);
        }
        let index = Some(cl.zeros(index)?);
        let parts = (0..slabs.count()).map(|slab| cl.zeros(slabs.range(slab).len() as u64 * brick));
        let parts = parts.collect::<Result<_, DeviceError>>()?;
        Ok(Self { spec, slabs, index, parts })
    }

    /// The slabs that hold the slices from `first` to `end`: each one's buffer, the first of the slices in it, and how
    /// many come before it.
    fn spread(&self, first: u32, end: u32) -> impl Iterator<Item = (&Mem, u32, std::ops::Range<u32>)> {
        (0..).zip(&self.parts).filter_map(move |(slab, mem)| {
            let range = self.slabs.range(slab);
            let (start, stop) = (range.start.max(first), range.end.min(end));
            (start < stop).then(|| (mem, start - range.start, start - first..stop - first))
        })
    }

    /// Writes whole slices, words of the index or whole bricks at `offset`.
    pub(crate) fn write(&self, cl: &mut Cl, offset: u64, data: &[u8]) -> Result<(), DeviceError> {
        let (index, slice) = match self.spec.layout {
            Layout::Dense => (0, self.spec.slice_bytes()),
            Layout::Bricks(_) => (BrickLayout::index_bytes(self.spec.dims), BrickLayout::brick_bytes(self.spec.format)),
        };
        if let Some(mem) = self.index.as_ref().filter(|_| offset < index) {
            return cl.write(mem, offset, data);
        }
        let first = ((offset - index) / slice) as u32;
        let end = first + (data.len() as u64 / slice) as u32;
        for (mem, place, part) in self.spread(first, end) {
            let bytes = (u64::from(part.start) * slice) as usize..(u64::from(part.end) * slice) as usize;
            cl.write(mem, u64::from(place) * slice, &data[bytes])?;
        }
        Ok(())
    }

    /// Copies all of a buffer of the field's size.
    pub(crate) fn publish(&self, cl: &mut Cl, from: &Mem) -> Result<(), DeviceError> {
        let slice = self.spec.slice_bytes();
        for (mem, _, part) in self.spread(0, self.spec.dims[2]) {
            cl.copy(from, u64::from(part.start) * slice, mem, part.len() as u64 * slice)?;
        }
        Ok(())
    }
}

impl Store {
    /// Adds a resource that `make` makes.
    pub(crate) fn add(
        &mut self,
        id: ResourceId,
        make: impl FnOnce() -> Result<Resource, DeviceError>,
    ) -> Result<(), DeviceError> {
        if self.resources.contains_key(&id) {
            return Err(DeviceError::Invalid(format!("resource {} exists", id.0)));
        }
        self.resources.insert(id, make()?);
        Ok(())
    }

    /// Drops a resource, if it exists. OpenCL frees it when no work needs it any more.
    pub(crate) fn remove(&mut self, id: ResourceId) {
        self.resources.remove(&id);
    }

    /// Bytes of all resources.
    pub(crate) fn bytes(&self) -> u64 {
        self.resources.values().map(|resource| resource.spec().bytes()).sum()
    }

    /// A resource.
    pub(crate) fn get(&self, id: ResourceId) -> Result<&Resource, DeviceError> {
        self.resources.get(&id).ok_or_else(|| DeviceError::Invalid(format!("resource {} does not exist", id.0)))
    }

    /// A buffer.
    pub(crate) fn buffer(&self, id: ResourceId) -> Result<&Memory, DeviceError> {
        match self.get(id)? {
            Resource::Buffer(memory) => Ok(memory),
            Resource::Field(_) => Err(DeviceError::Invalid(format!("resource {} is a field, not a buffer", id.0))),
        }
    }

    /// A field.
    pub(crate) fn field(&self, id: ResourceId) -> Result<&Volume, DeviceError> {
        match self.get(id)? {
            Resource::Field(volume) => Ok(volume),
            Resource::Buffer(_) => Err(DeviceError::Invalid(format!("resource {} is a buffer, not a field", id.0))),
        }
    }

    /// The shapes of a stage's bindings, which decide its kernel, and the kernel's arguments, in the order of
    /// [`Source::text`](crate::source::Source::text), of a stage that passed
    /// [`Stage::check`](airlight_core::stage::Stage::check).
    ///
    /// # Errors
    /// Resources that do not exist.
    pub(crate) fn bind(&self, bindings: &[Binding]) -> Result<(Vec<Shape>, Vec<Arg<'_>>), DeviceError> {
        let (mut shapes, mut args) = (Vec::new(), Vec::new());
        for binding in bindings {
            let mut slabs = 1;
            match (binding.access, binding.id) {
                (BindingAccess::Sample(spec), Some(id)) => {
                    let volume = self.field(id)?;
                    slabs = volume.slabs.count();
                    args.extend(volume.index.iter().chain(&volume.parts).map(Arg::Mem));
                    if let Layout::Bricks(layout) = spec.layout {
                        args.push(Arg::Int(layout.constants as i32));
                    }
                    args.extend((spec.layers > 1).then_some(Arg::Int(spec.layers as i32)));
                    args.extend((slabs > 1).then_some(Arg::Int(volume.slabs.per_slab as i32)));
                }
                (BindingAccess::Read(bytes) | BindingAccess::Write(bytes), Some(id)) => {
                    let memory = self.buffer(id)?;
                    args.push(Arg::Mem(&memory.mem));
                    if matches!(binding.access, BindingAccess::Read(_)) {
                        args.push(Arg::Uint(u32::try_from(bytes / 4).unwrap_or(u32::MAX)));
                    }
                }
                (_, None) => {}
            }
            shapes.push(Shape::new(binding, slabs));
        }
        Ok((shapes, args))
    }
}
