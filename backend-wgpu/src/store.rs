//! The resources of a device, and what of them a stage binds.

use std::collections::HashMap;

use airlight_core::device::{Binding, BindingAccess, DeviceError, FieldFormat, FieldSpec, Layout, Limits, ResourceId};
use wgpu::{Buffer, BufferUsages, TextureView};

use crate::gpu::Gpu;
use crate::groups::Entry;
use crate::memory::{Memory, Resource, Volume};
use crate::source::{Fetched, Shape, ShapeKind, index_binding, slab_binding, words};
use crate::texels::{self, Copy, Texels};

/// Resources of our own, for what kernels of a stage hand to each other. Executors count ids from 0.
pub(crate) mod own {
    use airlight_core::device::ResourceId;

    /// What cells scatter toward a batch of directions of `sweep`, where it lies in memory.
    pub(crate) const TOWARD: ResourceId = ResourceId(u32::MAX);
    /// The same in a texture.
    pub(crate) const TOWARD_TEXELS: ResourceId = ResourceId(u32::MAX - 1);
    /// Radiance of a batch.
    pub(crate) const RADIANCE: ResourceId = ResourceId(u32::MAX - 2);
    /// What its cells do to light, in rows along x and again in rows along y.
    pub(crate) const OPTICS: ResourceId = ResourceId(u32::MAX - 3);
    /// The order in which `project` takes the cells of a dispatch.
    pub(crate) const ORDER: ResourceId = ResourceId(u32::MAX - 4);
}

/// The resources under their ids, and what stands where a stage runs without one.
#[derive(Debug)]
pub(crate) struct Store {
    resources: HashMap<ResourceId, Resource>,
    dummies: Dummies,
}

#[derive(Debug)]
struct Dummies {
    read: Buffer,
    /// A part for each binding of a stage, so that no two that are written overlap.
    write: Buffer,
    scalar: Volume,
    rgba: Volume,
}

/// Bytes of a dummy: any offset may be a multiple of it, and no element is larger.
const DUMMY: u64 = 256;
/// The most bindings of a stage.
const BINDINGS: u64 = 32;

/// What a kernel binds: number, buffer, offset and bytes; number and texture.
#[derive(Debug, Default)]
pub(crate) struct Bound<'s> {
    pub(crate) buffers: Vec<(u32, &'s Buffer, u64, u64)>,
    pub(crate) textures: Vec<(u32, &'s TextureView)>,
}

impl Bound<'_> {
    /// The entries of the bind groups of buffers and of textures.
    pub(crate) fn entries(&self) -> [Vec<Entry>; 2] {
        let buffers = self.buffers.iter();
        let buffers =
            buffers.map(|&(number, buffer, offset, bytes)| Entry::Buffer(number, buffer.clone(), offset, bytes));
        let textures = self.textures.iter().map(|&(number, view)| Entry::Texture(number, view.clone()));
        [buffers.collect(), textures.collect()]
    }
}

impl Store {
    /// A store without resources.
    pub(crate) fn new(gpu: &Gpu, limits: &Limits) -> Result<Self, DeviceError> {
        let volume = |format| Volume::new(gpu, FieldSpec::dense([1; 3], 1, format), limits);
        let dummies = Dummies {
            read: gpu.buffer("nothing to read", DUMMY, BufferUsages::STORAGE)?,
            write: gpu.buffer("nothing to write", DUMMY * BINDINGS, BufferUsages::STORAGE)?,
            scalar: volume(FieldFormat::Scalar)?,
            rgba: volume(FieldFormat::Rgba)?,
        };
        Ok(Self { resources: HashMap::new(), dummies })
    }

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

    /// Takes a resource away, if it exists. wgpu frees it when neither work nor a bind group needs it any more.
    pub(crate) fn remove(&mut self, id: ResourceId) -> Option<Resource> {
        self.resources.remove(&id)
    }

    /// A resource.
    pub(crate) fn get(&self, id: ResourceId) -> Result<&Resource, DeviceError> {
        self.resources.get(&id).ok_or_else(|| DeviceError::Invalid(format!("resource {} does not exist", id.0)))
    }

    /// A buffer.
    pub(crate) fn buffer(&self, id: ResourceId) -> Result<&Memory, DeviceError> {
        match self.get(id)? {
            Resource::Buffer(memory) => Ok(memory),
            Resource::Field(_) | Resource::Texels(_) => {
                Err(DeviceError::Invalid(format!("resource {} is of texels, not a buffer", id.0)))
            }
        }
    }

    /// A field.
    pub(crate) fn field(&self, id: ResourceId) -> Result<&Volume, DeviceError> {
        match self.get(id)? {
            Resource::Field(volume) => Ok(volume),
            Resource::Buffer(_) | Resource::Texels(_) => {
                Err(DeviceError::Invalid(format!("resource {} is a buffer, not a field", id.0)))
            }
        }
    }

    /// The shapes of a stage's bindings, which decide its kernel.
    ///
    /// # Errors
    /// Resources that do not exist; fields in more slabs than a kernel has textures.
    pub(crate) fn shapes(&self, bindings: &[Binding], most_textures: u32) -> Result<Vec<Shape>, DeviceError> {
        let mut textures = 0;
        let shape = |binding: &Binding| {
            let slabs = match (binding.access, binding.id) {
                (BindingAccess::Sample(_), Some(id)) => self.field(id)?.slabs.count(),
                _ => 1,
            };
            if let BindingAccess::Sample(spec) = binding.access {
                textures += u64::from(slabs) + u64::from(spec.layout != Layout::Dense);
            }
            Ok(Shape::new(binding, slabs))
        };
        let shapes = bindings.iter().map(shape).collect::<Result<_, DeviceError>>()?;
        if textures > most_textures.into() {
            let what = "the slabs of all fields of a stage";
            return Err(DeviceError::Limit { what, requested: textures, limit: most_textures.into() });
        }
        Ok(shapes)
    }

    /// What a stage reads as storage textures, as many as there may be: fields, unless they are one texture that is `sampled`,
    /// then buffers that are there and fit a texture, four words at a time those of `fours`, and the one that is `held` there while
    /// it is written; and textures of our own.
    pub(crate) fn fetched(
        &self,
        shapes: &[Shape],
        bindings: &[Binding],
        (sampled, fours, held): (impl Fn(&str) -> bool, &[&str], Option<&str>),
        limits: &wgpu::Limits,
    ) -> Fetched {
        let mut left = limits.max_storage_textures_per_shader_stage;
        let mut fetched = Fetched::default();
        let mut take = |index, textures, fours| {
            if textures <= left {
                left -= textures;
                fetched = if fours { fetched.with_fours(index) } else { fetched.with(index) };
            }
        };
        for (index, shape) in shapes.iter().enumerate() {
            match shape.kind {
                // Not every device reads halves as storage textures.
                ShapeKind::Field { format: FieldFormat::Half { .. }, .. } => {}
                ShapeKind::Field { slabs, bricks, .. } if slabs > 1 || !sampled(shape.name) => {
                    take(index, slabs + u32::from(bricks), false);
                }
                _ => {}
            }
        }
        for (index, binding) in bindings.iter().enumerate() {
            let ours = |id| matches!(self.resources.get(&id), Some(Resource::Texels(_)));
            let bytes = match (binding.access, binding.id) {
                (BindingAccess::Read(bytes), Some(_)) => bytes,
                (BindingAccess::Write(bytes), Some(id)) if ours(id) || held == Some(binding.name) => bytes,
                _ => continue,
            };
            let fours = fours.contains(&binding.name);
            let words = if fours { 4 } else { words(binding.element) };
            if texels::fits(bytes, words, limits) {
                take(index, 1, fours);
            }
        }
        fetched
    }

    /// Makes room for the copies that a stage reads.
    pub(crate) fn reserve(&mut self, gpu: &Gpu, bindings: &[Binding], fetched: Fetched) -> Result<(), DeviceError> {
        for (index, binding) in bindings.iter().enumerate().filter(|(index, _)| fetched.has(*index)) {
            let Some(Resource::Buffer(memory)) = binding.id.and_then(|id| self.resources.get_mut(&id)) else {
                continue;
            };
            let words = fetched.words(index, binding.element);
            if !memory.texels.iter().any(|texels| texels.of(words)) {
                memory.texels.push(Texels::new(gpu, memory.bytes, words)?);
            }
        }
        Ok(())
    }

    /// The copies that must be made before a stage uses them. They count as made.
    pub(crate) fn stale(&self, bindings: &[Binding], fetched: Fetched) -> Vec<Copy<'_>> {
        let mut copies = Vec::new();
        for (index, binding) in bindings.iter().enumerate() {
            let Some(Resource::Buffer(memory)) = binding.id.and_then(|id| self.resources.get(&id)) else { continue };
            if fetched.has(index) {
                let words = fetched.words(index, binding.element);
                let stale = memory.texels.iter().filter(|texels| texels.of(words) && !texels.fresh.replace(true));
                let (buffer, bytes) = (&memory.buffer, memory.bytes);
                copies.extend(stale.map(|texels| Copy { buffer, bytes, texels }));
            }
        }
        copies
    }

    /// The copies that a stage writes in place of their buffers.
    pub(crate) fn written(&self, bindings: &[Binding], fetched: Fetched) -> Vec<Copy<'_>> {
        let mut copies = Vec::new();
        for (index, binding) in bindings.iter().enumerate().filter(|(index, _)| fetched.has(*index)) {
            let resource = binding.id.and_then(|id| self.resources.get(&id));
            if let (BindingAccess::Write(_), Some(Resource::Buffer(memory))) = (binding.access, resource) {
                let words = fetched.words(index, binding.element);
                let texels = memory.texels.iter().filter(|texels| texels.of(words));
                copies.extend(texels.map(|texels| Copy { buffer: &memory.buffer, bytes: memory.bytes, texels }));
            }
        }
        copies
    }

    /// Books that a stage writes what it binds to be written.
    pub(crate) fn wrote(&self, bindings: &[Binding]) {
        for binding in bindings {
            let memory = binding.id.and_then(|id| self.buffer(id).ok());
            if let (BindingAccess::Write(_), Some(memory)) = (binding.access, memory) {
                memory.changed();
            }
        }
    }

    /// Books that copies may not have been made.
    pub(crate) fn forget_copies(&self) {
        self.resources.values().for_each(|resource| {
            if let Resource::Buffer(memory) = resource {
                memory.changed();
            }
        });
    }

    /// What a stage binds where `window` gives offset and bytes of each buffer that is not `fetched`.
    pub(crate) fn bound(
        &self,
        bindings: &[Binding],
        fetched: Fetched,
        window: impl Fn(&Binding) -> (u64, u64),
    ) -> Result<Bound<'_>, DeviceError> {
        let mut bound = Bound::default();
        for (index, binding) in bindings.iter().enumerate() {
            let number = index as u32;
            match (binding.access, binding.id) {
                (BindingAccess::Sample(spec), id) => {
                    let volume = match (id, spec.format) {
                        (Some(id), _) => self.field(id)?,
                        (None, FieldFormat::Scalar | FieldFormat::Half { .. }) => &self.dummies.scalar,
                        (None, FieldFormat::Rgba) => &self.dummies.rgba,
                    };
                    let views = volume.textures.iter().zip(0..);
                    bound.textures.extend(views.map(|((_, view), slab)| (slab_binding(index, slab), view)));
                    let atlas = volume.atlas.as_ref();
                    bound.textures.extend(atlas.map(|atlas| (index_binding(index), &atlas.index_view)));
                }
                (BindingAccess::Read(_) | BindingAccess::Write(_), Some(id)) if fetched.has(index) => {
                    let words = fetched.words(index, binding.element);
                    let copies = match self.get(id)? {
                        Resource::Texels(texels) => std::slice::from_ref(texels),
                        _ => &self.buffer(id)?.texels,
                    };
                    let copies = copies.iter().filter(|texels| texels.of(words));
                    bound.textures.extend(copies.map(|texels| (slab_binding(index, 0), &texels.view)));
                }
                (BindingAccess::Read(_) | BindingAccess::Write(_), Some(id)) => {
                    let (offset, bytes) = window(binding);
                    bound.buffers.push((number, &self.buffer(id)?.buffer, offset, bytes.next_multiple_of(4)));
                }
                (BindingAccess::Read(_), None) => bound.buffers.push((number, &self.dummies.read, 0, DUMMY)),
                (BindingAccess::Write(_), None) => {
                    bound.buffers.push((number, &self.dummies.write, u64::from(number) * DUMMY, DUMMY));
                }
            }
        }
        Ok(bound)
    }
}
