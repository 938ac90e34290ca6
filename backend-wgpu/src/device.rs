//! The device.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use airlight_core::device::{
    Binding, Buf, Device, DeviceError, DeviceInfo, DeviceKind, FieldFormat, FieldKinds, FieldSpec, Limits, ResourceId,
    ResourceSpec, StageTime, Usage,
};
use airlight_core::host;
use airlight_core::stage::{Stage, Sweep};
use wgpu::{QuerySet, Sampler};

use crate::adapter;
use crate::clock::Clock;
use crate::cut::{BindingLimits, Cut};
use crate::engine::Engine;
use crate::filter::{self, Filter};
use crate::gpu::Gpu;
use crate::groups::Groups;
use crate::launch::{self, Launches, Shot};
use crate::memory::{Resource, texture_format};
use crate::part::{Key, Part, Steady};
use crate::pipeline::Pipeline;
use crate::source::{self, Fetched, PublishParams, Variant};
use crate::store::{Bound, Store};
use crate::vulkan;

/// A graphics processor as a device.
#[derive(Debug)]
pub struct WgpuDevice {
    pub(crate) info: DeviceInfo,
    pub(crate) gpu: Gpu,
    pub(crate) limits: wgpu::Limits,
    pub(crate) store: Store,
    /// Kernels.
    pub(crate) pipelines: HashMap<Key, Arc<Pipeline>>,
    publishers: HashMap<(FieldFormat, bool), Arc<Pipeline>>,
    pub(crate) groups: Groups,
    pub(crate) engine: Engine,
    /// Where texture units interpolate.
    pub(crate) sampler: Option<Sampler>,
    steady: Steady,
    /// Invocations of a workgroup, where they do not work together.
    pub(crate) units: u32,
    /// Whether kernels read fields, and copies of buffers, as storage textures.
    pub(crate) texels: bool,
    /// Whether kernels write two words at once.
    pairs: bool,
    /// Whether they read storage textures of four words that they write.
    pub(crate) rewrites: bool,
    /// The sweep that was dispatched last, and how far.
    pub(crate) swept: Option<(Sweep, u32)>,
    clock: Clock,
}

impl WgpuDevice {
    /// What `gpu` is, ready to work.
    pub(crate) fn new(mut info: DeviceInfo, gpu: Gpu) -> Result<Self, DeviceError> {
        let stamps = gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        let tick = stamps.then(|| f64::from(gpu.queue.get_timestamp_period()));
        let limits = gpu.device.limits();
        let sampler = filter::sampler(&gpu, &mut info, Filter::default());
        let adapter = gpu.device.adapter_info();
        let texels = adapter::fetches(&adapter);
        let pairs = texels && gpu.device.features().contains(wgpu::Features::SHADER_INT64);
        let formats = wgpu::Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES;
        let rewrites = texels && gpu.device.features().contains(formats);
        Ok(Self {
            store: Store::new(&gpu, &info.limits)?,
            info,
            units: adapter::units_for(&adapter, &limits),
            limits,
            gpu,
            pipelines: HashMap::new(),
            publishers: HashMap::new(),
            groups: Groups::default(),
            engine: Engine::default(),
            sampler,
            steady: Steady::default(),
            texels,
            pairs,
            rewrites,
            swept: None,
            clock: Clock::new(tick),
        })
    }

    /// Chooses who interpolates; kernels of another choice are dropped.
    pub(crate) fn set_filter(&mut self, filter: Filter) {
        self.sampler = filter::sampler(&self.gpu, &mut self.info, filter);
        self.pipelines.clear();
        self.groups.clear();
    }

    /// Drops a resource, if it exists.
    pub(crate) fn remove(&mut self, id: ResourceId) {
        if let Some(gone) = self.store.remove(id) {
            self.groups.forget(&gone);
        }
    }

    /// Makes memory of our own hold so many bytes at least.
    pub(crate) fn reserve(&mut self, id: ResourceId, bytes: u64) -> Result<(), DeviceError> {
        if self.store.buffer(id).is_ok_and(|memory| memory.bytes >= bytes) {
            return Ok(());
        }
        self.remove(id);
        let spec = ResourceSpec::Buffer { bytes, usage: Usage::Work };
        self.store.add(id, || Resource::new(&self.gpu, &spec, &self.info.limits))
    }

    pub(crate) fn binding_limits(&self) -> BindingLimits {
        let align = u64::from(self.limits.min_storage_buffer_offset_alignment).max(4);
        BindingLimits { bytes: self.info.limits.binding_bytes, align }
    }

    /// What a kernel of these bindings is built for, once there is room for the copies that it reads.
    fn prepared(&mut self, part: &Part, cut: Cut, stage: &Stage) -> Result<(Arc<Pipeline>, Fetched), DeviceError> {
        let bindings = &part.bindings;
        let shapes = self.store.shapes(bindings, self.limits.max_sampled_textures_per_shader_stage)?;
        let mut variant = Variant {
            units: part.invocations(self.units),
            filtered: self.sampler.is_some(),
            gathers: part.gathers,
            ..Variant::default()
        };
        // Where a buffer is bound in parts, kernels count from the part that they see.
        if self.texels && cut.whole() {
            let held = part.held().filter(|_| self.rewrites);
            let sampled = |field: &str| variant.filtered && part.interpolates(field);
            variant.fetched = self.store.fetched(&shapes, bindings, (sampled, part.fours(), held), &self.limits);
        }
        if self.pairs {
            for index in (0..bindings.len()).filter(|&index| part.pairs().contains(&bindings[index].name)) {
                variant.fetched = variant.fetched.with_pairs(index);
            }
        }
        self.store.reserve(&self.gpu, bindings, variant.fetched)?;
        let (gathers, sums) = (part.gathers, part.sums());
        let mut key = Key { name: part.name, shapes, fetched: variant.fetched, gathers, sums, known: None };
        if self.texels {
            let words = bytemuck::cast_slice(stage.params());
            let built = self.pipelines.len();
            key.known = Some(self.steady.known((stage.name(), &key), words, || part.places(), built));
        }
        if let Some(pipeline) = self.pipelines.get(&key) {
            return Ok((Arc::clone(pipeline), variant.fetched));
        }
        variant.known = key.known.as_ref();
        let build = |variant| {
            let (text, shapes) = (part.text(&key.shapes, variant), (&key.shapes[..], variant.fetched));
            Pipeline::of_stage(&self.gpu, part.name, &text, shapes, self.sampler.as_ref())
        };
        let (built, fetched) = (Arc::new(build(variant)?), variant.fetched);
        self.pipelines.insert(key, Arc::clone(&built));
        self.steady.built(stage.name());
        Ok((built, fetched))
    }

    fn publisher(&mut self, spec: FieldSpec) -> Result<Arc<Pipeline>, DeviceError> {
        let FieldSpec { format, dims: [_, y, z], .. } = spec;
        let few = self.texels && u64::from(y) * u64::from(z) < source::FEW_ROWS.into();
        if let Some(pipeline) = self.publishers.get(&(format, few)) {
            return Ok(Arc::clone(pipeline));
        }
        let text = source::publish_text(format, self.units, few);
        let built = Pipeline::of_publish(&self.gpu, &text, texture_format(format))?;
        Ok(Arc::clone(self.publishers.entry((format, few)).or_insert(Arc::new(built))))
    }

    /// Bytes of a row of a field that is copied from a buffer as it is, where drivers are faster at that than at a kernel that stores
    /// texels: of rows as the API takes them, of one layer.
    pub(crate) fn copied_rows(&self, spec: &FieldSpec) -> Option<u32> {
        let row = u64::from(spec.dims[0]) * spec.format.bytes();
        let whole = row.is_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT.into());
        u32::try_from(row).ok().filter(|_| self.texels && whole && spec.layers == 1)
    }

    /// Makes a field of a buffer by copies of its rows of so many bytes.
    fn publish_rows(&mut self, from: ResourceId, to: ResourceId, row: u32) -> Result<(), DeviceError> {
        let (memory, volume) = (self.store.buffer(from)?, self.store.field(to)?);
        let [width, height, _] = volume.spec.dims;
        let commands = self.gpu.guarded(0, || {
            let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
            for (slab, (texture, _)) in volume.textures.iter().enumerate() {
                let slices = volume.slabs.range(slab as u32);
                let layout = wgpu::TexelCopyBufferLayout {
                    offset: u64::from(slices.start) * u64::from(height) * u64::from(row),
                    bytes_per_row: Some(row),
                    rows_per_image: Some(height),
                };
                let size = wgpu::Extent3d { width, height, depth_or_array_layers: slices.end - slices.start };
                let memory = wgpu::TexelCopyBufferInfo { buffer: &memory.buffer, layout };
                encoder.copy_buffer_to_texture(memory, texture.as_image_copy(), size);
            }
            encoder.finish()
        })?;
        self.gpu.record("publishing", commands)
    }

    fn run_stage(&mut self, stage: &Stage, range: Range<u32>) -> Result<(), DeviceError> {
        let parts = match stage {
            Stage::Sweep(sweep) => self.sweep_parts(stage, sweep, range.clone())?,
            Stage::Project(project) => self.project_parts(stage, project, range.clone())?,
            Stage::Propagate(propagate) => self.propagate_parts(stage, &propagate.params, range.clone()),
            _ => vec![Part::of(stage, range.clone())],
        };
        let mut prepared = Vec::new();
        for part in &parts {
            let cut = Cut::new(part.axis, part.group, &part.bindings, self.binding_limits())?;
            let (pipeline, fetched) = self.prepared(part, cut, stage)?;
            prepared.push((part, cut, pipeline, fetched));
        }
        if self.gpu.batch.take_lost() {
            self.store.forget_copies();
        }
        let launches = prepared.iter().map(|(part, cut, pipeline, fetched)| {
            let copies = self.store.stale(&part.bindings, *fetched);
            self.store.wrote(&part.bindings);
            let written = self.store.written(&part.bindings, *fetched);
            let shots = cut.pieces(part.range.clone()).map(|piece| {
                let bound = self.store.bound(&part.bindings, *fetched, |binding| piece.window(binding))?;
                let Range { start: first, end: past } = part.steps.clone().unwrap_or(piece.groups);
                Ok(Shot { range: piece.range, first, past, bound })
            });
            let shots = shots.collect::<Result<_, DeviceError>>()?;
            let (units, aligned) = (part.taken(self.units, self.texels, *fetched), part.aligned(*fetched));
            let (params, sequential) = (stage.params(), part.sequential);
            Ok(Launches { pipeline, params, units, aligned, sequential, copies, written, shots })
        });
        let launches = launches.collect::<Result<Vec<_>, DeviceError>>();
        let recorded = launches.and_then(|launches| {
            let stamps: Option<(&QuerySet, u32)> = self.clock.start(&self.gpu, stage.name(), range)?;
            let (gpu, groups) = (&mut self.gpu, &mut self.groups);
            launch::record(gpu, groups, &self.limits, stage.name(), &launches, stamps).inspect_err(|_| {
                // A dispatch that failed has no time.
                self.clock.take_back();
            })
        });
        // Nor were copies made.
        recorded.inspect_err(|_| self.store.forget_copies())
    }
}

impl Device for WgpuDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn free_memory(&self) -> Option<u64> {
        if self.info.kind == DeviceKind::SoftwareGpu {
            return host::free_memory();
        }
        vulkan::free(&self.gpu.device)
    }

    fn scratch(&self, stage: &Stage) -> u64 {
        match stage {
            Stage::Sweep(sweep) => self.sweep_scratch(sweep),
            Stage::Project(project) => self.project_scratch(project),
            _ => 0,
        }
    }

    fn field_kinds(&self) -> FieldKinds {
        FieldKinds::ALL
    }

    fn create(&mut self, id: ResourceId, spec: &ResourceSpec) -> Result<(), DeviceError> {
        self.gpu.enter()?;
        spec.check_kind(self.field_kinds())?;
        self.store.add(id, || Resource::new(&self.gpu, spec, &self.info.limits))
    }

    fn destroy(&mut self, id: ResourceId) {
        self.remove(id);
    }

    fn write(&mut self, id: ResourceId, offset: u64, data: &[u8]) -> Result<(), DeviceError> {
        self.gpu.enter()?;
        let resource = self.store.get(id)?;
        resource.spec().check_write(offset, data)?;
        match resource {
            Resource::Buffer(memory) => {
                memory.changed();
                self.gpu.write_buffer(&memory.buffer, offset, data)
            }
            Resource::Field(volume) => volume.write(&mut self.gpu, offset, data),
            Resource::Texels(_) => Err(DeviceError::Invalid(format!("resource {} is the device's own", id.0))),
        }
    }

    fn read(&mut self, id: ResourceId, offset: u64, out: &mut [u8]) -> Result<(), DeviceError> {
        self.gpu.enter()?;
        self.store.get(id)?.spec().check_read(offset, out.len())?;
        self.gpu.count(|made| &mut made.reads);
        let memory = self.store.buffer(id)?;
        self.gpu.read(&memory.buffer, offset, out)
    }

    fn publish(&mut self, from: ResourceId, to: ResourceId) -> Result<(), DeviceError> {
        self.gpu.enter()?;
        let spec = self.store.get(from)?.spec().check_publish(&self.store.get(to)?.spec())?;
        if let Some(row) = self.copied_rows(&spec) {
            return self.publish_rows(from, to, row);
        }
        let pipeline = self.publisher(spec)?;
        let volume = self.store.field(to)?;
        // The work axis is the texels of a layer; each is a part of the buffer, with all its layers.
        let Ok(texels) = u32::try_from(spec.texels() / u64::from(spec.layers)) else {
            let requested = spec.texels() / u64::from(spec.layers);
            return Err(DeviceError::Limit { what: "the texels of a layer", requested, limit: u32::MAX.into() });
        };
        let words = spec.format.bytes() / 4 * u64::from(spec.layers);
        let source: Buf<f32> = Buf::new(from, spec.bytes() / 4);
        let binding = [Binding::read("buffer", Some(source)).in_parts::<f32>(words)];
        let cut = Cut::new(texels, 1, &binding, self.binding_limits())?;
        for (slab, (_, view)) in volume.textures.iter().enumerate() {
            let slices = volume.slabs.range(slab as u32);
            let [x, y, z] = spec.dims;
            let params = PublishParams { dims: [x, y, z, spec.layers], slices: [slices.start, slices.end, 0, 0] };
            let shots = cut.pieces(0..texels).map(|piece| {
                let bound = self.store.bound(&binding, Fetched::default(), |binding| piece.window(binding))?;
                let bound = Bound { textures: vec![(0, view)], ..bound };
                Ok(Shot { range: piece.range, first: piece.groups.start, past: piece.groups.end, bound })
            });
            let shots = shots.collect::<Result<Vec<_>, DeviceError>>()?;
            let (params, units) = (bytemuck::bytes_of(&params), self.units);
            let (pipeline, copies) = (&pipeline, Vec::new());
            let launches =
                Launches { pipeline, params, units, aligned: 1, sequential: None, copies, written: Vec::new(), shots };
            launch::record(&mut self.gpu, &mut self.groups, &self.limits, "publishing", &[launches], None)?;
        }
        Ok(())
    }

    fn dispatch(&mut self, stage: &Stage, range: Range<u32>) -> Result<(), DeviceError> {
        self.gpu.enter()?;
        stage.check(&range, |id| self.store.get(id).ok().map(Resource::spec))?;
        if range.is_empty() {
            self.clock.idle(stage.name(), range);
            return Ok(());
        }
        self.run_stage(stage, range)
    }

    fn finish(&mut self) -> Result<Vec<StageTime>, DeviceError> {
        let times = self.clock.finish(&mut self.gpu)?;
        self.steady.waited(&times);
        Ok(times)
    }

    fn flush(&mut self) -> Result<(), DeviceError> {
        self.steady.waited(&[]);
        self.clock.forget();
        self.gpu.flush()
    }

    fn set_patience(&mut self, patience: Option<Duration>) {
        self.gpu.set_patience(patience);
    }

    fn narrow(&mut self, limits: &Limits) -> bool {
        self.info.limits = self.info.limits.min(limits);
        true
    }
}
