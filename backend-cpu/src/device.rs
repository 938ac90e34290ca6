//! The device: memory and dispatch.

use std::collections::HashMap;
use std::ops::Range;
use std::time::Instant;

use airlight_core::device::{
    Buf, Device, DeviceError, DeviceInfo, DeviceKind, Field, FieldFormat, FieldKinds, FieldSpec, Layout, Limits,
    ResourceId, ResourceSpec, StageTime,
};
use airlight_core::host;
use airlight_core::stage::Stage;
use bytemuck::Pod;

use crate::kernels::field::Scalars;
use crate::{Isa, kernels, tiles};

/// The processor's cores as a device.
pub struct CpuDevice {
    info: DeviceInfo,
    isa: Isa,
    resources: HashMap<ResourceId, Resource>,
    times: Vec<StageTime>,
}

/// Bytes of a resource for which the system is asked what it has free.
const LARGE: u64 = 16 << 20;

/// Sixteen bytes at a multiple of sixteen, so that every element type is aligned.
#[repr(C, align(16))]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Unit([u32; 4]);

struct Resource {
    memory: Vec<Unit>,
    spec: ResourceSpec,
}

impl Resource {
    fn bytes(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.memory)[..self.spec.bytes() as usize]
    }

    fn bytes_mut(&mut self) -> &mut [u8] {
        &mut bytemuck::cast_slice_mut(&mut self.memory)[..self.spec.bytes() as usize]
    }
}

impl Default for CpuDevice {
    fn default() -> Self {
        Self::new()
    }
}

impl CpuDevice {
    /// The device with the best instruction set of this machine.
    pub fn new() -> Self {
        Self::of(Isa::best())
    }

    /// The device with an instruction set of one's choice, where the machine has it.
    pub fn with_isa(isa: Isa) -> Option<Self> {
        Isa::available().contains(&isa).then(|| Self::of(isa))
    }

    fn of(isa: Isa) -> Self {
        let cores = rayon::current_num_threads();
        let memory_bytes = host::memory();
        let info = DeviceInfo {
            backend: "cpu",
            index: 0,
            name: processor(),
            kind: DeviceKind::Cpu,
            memory_bytes,
            limits: Limits {
                buffer_bytes: memory_bytes.unwrap_or(isize::MAX as u64),
                binding_bytes: memory_bytes.unwrap_or(isize::MAX as u64),
                // Kernels index the texels of a layer with 31 bits; `create` checks the product.
                field_side: i32::MAX as u32,
                loop_turns: None,
            },
            features: vec![format!("{cores} threads"), isa.name().to_owned()],
            filter_bits: 24,
            contracts: false,
            unusable: None,
        };
        Self { info, isa, resources: HashMap::new(), times: Vec::new() }
    }

    fn get(&self, id: ResourceId) -> Result<&Resource, DeviceError> {
        self.resources.get(&id).ok_or_else(|| DeviceError::Invalid(format!("resource {} does not exist", id.0)))
    }

    fn get_mut(&mut self, id: ResourceId) -> Result<&mut Resource, DeviceError> {
        self.resources.get_mut(&id).ok_or_else(|| DeviceError::Invalid(format!("resource {} does not exist", id.0)))
    }
}

impl Device for CpuDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn free_memory(&self) -> Option<u64> {
        host::free_memory()
    }

    /// What is as large as the cells: a sweep's copies of which rows run along y, the means of `coarsen`.
    fn scratch(&self, stage: &Stage) -> u64 {
        match stage {
            Stage::Sweep(sweep) => sweep.optics.bytes() + sweep.sources.map_or(0, |sources| sources.bytes()),
            Stage::Coarsen(coarsen) => coarsen.out.bytes(),
            _ => 0,
        }
    }

    fn field_kinds(&self) -> FieldKinds {
        FieldKinds::ALL
    }

    fn create(&mut self, id: ResourceId, spec: &ResourceSpec) -> Result<(), DeviceError> {
        if self.resources.contains_key(&id) {
            return Err(DeviceError::Invalid(format!("resource {} exists", id.0)));
        }
        spec.check_kind(self.field_kinds())?;
        if let ResourceSpec::Field(field) = spec {
            let layer = match field.layout {
                Layout::Dense => field.texels() / u64::from(field.layers.max(1)),
                Layout::Bricks(_) => field.bytes() / field.format.bytes(),
            };
            if layer == 0 || layer > i32::MAX as u64 {
                let limit = i32::MAX as u64;
                return Err(DeviceError::Limit { what: "a field's layer", requested: layer, limit });
            }
        }
        let (requested, limit) = (spec.bytes(), self.info.limits.buffer_bytes);
        if requested > limit {
            return Err(DeviceError::Limit { what: "a resource", requested, limit });
        }
        let missing = || DeviceError::OutOfMemory { requested, available: host::free_memory() };
        // A system may promise memory that is not there, and end the process that fills it with zeros.
        if requested > LARGE && host::free_memory().is_some_and(|free| requested > free) {
            return Err(missing());
        }
        let bytes = usize::try_from(requested).map_err(|_| missing())?;
        let mut memory = Vec::new();
        // One more, so that there is a float behind the last texel of every field.
        let units = bytes / 16 + 1;
        memory.try_reserve_exact(units).map_err(|_| missing())?;
        memory.resize(units, Unit([0; 4]));
        self.resources.insert(id, Resource { memory, spec: *spec });
        Ok(())
    }

    fn destroy(&mut self, id: ResourceId) {
        self.resources.remove(&id);
    }

    fn write(&mut self, id: ResourceId, offset: u64, data: &[u8]) -> Result<(), DeviceError> {
        let resource = self.get_mut(id)?;
        resource.spec.check_write(offset, data)?;
        resource.bytes_mut()[offset as usize..][..data.len()].copy_from_slice(data);
        Ok(())
    }

    fn read(&mut self, id: ResourceId, offset: u64, out: &mut [u8]) -> Result<(), DeviceError> {
        let resource = self.get(id)?;
        resource.spec.check_read(offset, out.len())?;
        out.copy_from_slice(&resource.bytes()[offset as usize..][..out.len()]);
        Ok(())
    }

    fn view(&self, id: ResourceId) -> Option<&[u8]> {
        let resource = self.get(id).ok()?;
        matches!(resource.spec, ResourceSpec::Buffer { .. }).then(|| resource.bytes())
    }

    fn publish(&mut self, from: ResourceId, to: ResourceId) -> Result<(), DeviceError> {
        self.get(from)?.spec.check_publish(&self.get(to)?.spec)?;
        let Some(mut target) = self.resources.remove(&to) else { return Ok(()) };
        let done = self.get(from).map(|source| target.bytes_mut().copy_from_slice(source.bytes()));
        self.resources.insert(to, target);
        done
    }

    fn dispatch(&mut self, stage: &Stage, range: Range<u32>) -> Result<(), DeviceError> {
        stage.check(&range, |id| self.resources.get(&id).map(|resource| resource.spec))?;
        let begin = Instant::now();
        if range.is_empty() {
            self.times.push(StageTime { stage: stage.name(), range, time: begin.elapsed() });
            return Ok(());
        }
        let mut memory = Memory { device: self, taken: Vec::new() };
        let (isa, part) = (memory.device.isa, range.clone());
        let done = match stage {
            Stage::Inject(stage) => kernels::inject::run(stage, part, &mut memory, isa),
            Stage::Reduce(stage) => kernels::reduce::run(stage, part, &mut memory, isa),
            Stage::Project(stage) => kernels::project::run(stage, part, &mut memory, isa),
            Stage::Propagate(stage) => kernels::propagate::run(stage, part, &mut memory, isa),
            Stage::Relight(stage) => kernels::relight::run(stage, part, &mut memory, isa),
            Stage::March(stage) => tiles::run(stage, part, &mut memory, isa),
            Stage::Trace(stage) => kernels::trace::run(stage, part, &mut memory, isa),
            Stage::Shade(stage) => kernels::shade::run(stage, part, &mut memory, isa),
            Stage::Shadow(stage) => kernels::shadow::run(stage, part, &mut memory, isa),
            Stage::Upsample(stage) => kernels::upsample::run(stage, part, &mut memory, isa),
            Stage::Accumulate(stage) => kernels::accumulate::run(stage, part, &mut memory, isa),
            Stage::Coarsen(stage) => kernels::coarsen::run(stage, part, &mut memory, isa),
            Stage::Illuminate(stage) => kernels::illuminate::run(stage, part, &mut memory, isa),
            Stage::Sweep(stage) => kernels::sweep::run(stage, part, &mut memory, isa),
            Stage::Obstruct(stage) => kernels::obstruct::run(stage, part, &mut memory, isa),
            Stage::Path(stage) => kernels::path::run(stage, part, &mut memory, isa),
            Stage::Evaluate(stage) => kernels::evaluate::run(stage, part, &mut memory, isa),
            Stage::Reconstruct(stage) => kernels::reconstruct::run(stage, part, &mut memory, isa),
            Stage::Photons(stage) => kernels::photons::run(stage, part, &mut memory, isa),
            Stage::Classify(stage) => kernels::classify::run(stage, part, &mut memory, isa),
        };
        for (id, resource) in memory.taken {
            self.resources.insert(id, resource);
        }
        done?;
        self.times.push(StageTime { stage: stage.name(), range, time: begin.elapsed() });
        Ok(())
    }

    fn finish(&mut self) -> Result<Vec<StageTime>, DeviceError> {
        Ok(std::mem::take(&mut self.times))
    }
}

/// The resources of one dispatch. What is written is taken out of the device while the kernel runs, so that the rest
/// can be read beside it.
pub(crate) struct Memory<'d> {
    device: &'d mut CpuDevice,
    taken: Vec<(ResourceId, Resource)>,
}

impl Memory<'_> {
    /// Takes the buffers that a stage writes.
    pub(crate) fn take<T: Pod>(&mut self, buf: Buf<T>) -> Result<(), DeviceError> {
        let missing = || DeviceError::Invalid(format!("resource {} does not exist", buf.id.0));
        let resource = self.device.resources.remove(&buf.id).ok_or_else(missing)?;
        self.taken.push((buf.id, resource));
        Ok(())
    }

    /// What the taken buffers hold, in the order they were taken, and the rest of the device's memory.
    pub(crate) fn split(&mut self) -> (Vec<&mut [u8]>, Readable<'_>) {
        let taken = self.taken.iter_mut().map(|(_, r)| r.bytes_mut()).collect();
        (taken, Readable { device: self.device })
    }
}

/// Memory that a kernel reads.
#[derive(Clone, Copy)]
pub(crate) struct Readable<'d> {
    device: &'d CpuDevice,
}

impl<'d> Readable<'d> {
    /// The elements of a buffer.
    pub(crate) fn buf<T: Pod>(self, buf: Buf<T>) -> Result<&'d [T], DeviceError> {
        let all: &[T] = bytemuck::cast_slice(self.device.get(buf.id)?.bytes());
        all.get(..buf.len as usize)
            .ok_or_else(|| DeviceError::Invalid(format!("a buffer of {} elements holds {}", buf.len, all.len())))
    }

    /// The elements of a buffer, or none.
    pub(crate) fn opt<T: Pod>(self, buf: Option<Buf<T>>) -> Result<&'d [T], DeviceError> {
        buf.map_or(Ok(&[][..]), |buf| self.buf(buf))
    }

    fn held(self, field: Field) -> Result<&'d Resource, DeviceError> {
        let resource = self.device.get(field.id)?;
        if resource.spec != ResourceSpec::Field(field.spec) {
            return Err(DeviceError::Invalid(format!("resource {} is not the field {:?}", field.id.0, field.spec)));
        }
        Ok(resource)
    }

    /// The texels of a dense field of 32-bit floats.
    pub(crate) fn field(self, field: Field) -> Result<&'d [f32], DeviceError> {
        let FieldSpec { format, layout, .. } = field.spec;
        if layout != Layout::Dense || matches!(format, FieldFormat::Half { .. }) {
            return Err(DeviceError::Invalid(format!("{:?} is not dense and of 32-bit floats", field.spec)));
        }
        Ok(bytemuck::cast_slice(self.held(field)?.bytes()))
    }

    /// A field of scalars, for packets to look up.
    pub(crate) fn scalars(self, field: Field) -> Result<Scalars<'d>, DeviceError> {
        Ok(Scalars::new(bytemuck::cast_slice(&self.held(field)?.memory), &field.spec))
    }
}
/// The processor's name, where the system says.
fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|line| line.strip_prefix("model name")?.split(": ").nth(1));
    name.map_or_else(|| format!("{} processor", std::env::consts::ARCH), |name| name.trim().to_owned())
}
