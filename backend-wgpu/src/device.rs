//! The device.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use airlight_core::device::{
    Binding, Buf, Device, DeviceError, DeviceInfo, FieldFormat, Limits, ResourceId, ResourceSpec, StageTime,
};
use airlight_core::stage::Stage;
use wgpu::QuerySet;

use crate::clock::Clock;
use crate::cut::{BindingLimits, Cut};
use crate::gpu::{Gpu, STAGING};
use crate::launch::{Launches, Shot};
use crate::memory::{Resource, texture_format};
use crate::pipeline::Pipeline;
use crate::source::{self, PublishParams, Shape};
use crate::store::{Bound, Store};

/// A graphics processor as a device.
#[derive(Debug)]
pub struct WgpuDevice {
    pub(crate) info: DeviceInfo,
    pub(crate) gpu: Gpu,
    pub(crate) limits: wgpu::Limits,
    store: Store,
    /// Kernels by stage and the shapes of its bindings.
    pipelines: HashMap<(&'static str, Vec<Shape>), Arc<Pipeline>>,
    publishers: HashMap<FieldFormat, Arc<Pipeline>>,
    clock: Clock,
}

/// Whether `len` bytes from `offset` on are whole words within `bytes` bytes.
fn span(offset: u64, len: usize, bytes: u64) -> Result<(), DeviceError> {
    if !offset.is_multiple_of(4) || !len.is_multiple_of(4) {
        return Err(DeviceError::Invalid(format!("{len} bytes from {offset} on are not whole words of 4 bytes")));
    }
    match offset.checked_add(len as u64) {
        Some(end) if end <= bytes => Ok(()),
        _ => Err(DeviceError::Invalid(format!("{len} bytes from {offset} on leave a resource of {bytes} bytes"))),
    }
}

impl WgpuDevice {
    /// An opened adapter.
    pub(crate) fn new(info: DeviceInfo, device: wgpu::Device, queue: wgpu::Queue) -> Result<Self, DeviceError> {
        let stamps = device.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        let tick = stamps.then(|| f64::from(queue.get_timestamp_period()));
        let (limits, gpu) = (device.limits(), Gpu::new(device, queue));
        Ok(Self {
            store: Store::new(&gpu, &info.limits)?,
            info,
            limits,
            gpu,
            pipelines: HashMap::new(),
            publishers: HashMap::new(),
            clock: Clock::new(tick),
        })
    }

    fn binding_limits(&self) -> BindingLimits {
        let align = u64::from(self.limits.min_storage_buffer_offset_alignment).max(4);
        BindingLimits { bytes: self.info.limits.binding_bytes, align }
    }

    fn pipeline(&mut self, stage: &Stage, shapes: Vec<Shape>) -> Result<Arc<Pipeline>, DeviceError> {
        let source = source::of(stage);
        let key = (source.name, shapes);
        if let Some(pipeline) = self.pipelines.get(&key) {
            return Ok(Arc::clone(pipeline));
        }
        let built = Pipeline::of_stage(&self.gpu, source.name, &source.text(&key.1), &key.1)?;
        Ok(Arc::clone(self.pipelines.entry(key).or_insert(Arc::new(built))))
    }

    fn publisher(&mut self, format: FieldFormat) -> Result<Arc<Pipeline>, DeviceError> {
        if let Some(pipeline) = self.publishers.get(&format) {
            return Ok(Arc::clone(pipeline));
        }
        let built = Pipeline::of_publish(&self.gpu, &source::publish_text(format), texture_format(format))?;
        Ok(Arc::clone(self.publishers.entry(format).or_insert(Arc::new(built))))
    }

    fn run_stage(&mut self, stage: &Stage, range: Range<u32>) -> Result<(), DeviceError> {
        let bindings = stage.bindings();
        let cut = Cut::new(stage.axis(), stage.group(), &bindings, self.binding_limits())?;
        let shapes = self.store.shapes(&bindings, self.limits.max_sampled_textures_per_shader_stage)?;
        let pipeline = self.pipeline(stage, shapes)?;
        let shots = cut.pieces(range.clone()).map(|piece| {
            let bound = self.store.bound(&bindings, |binding| piece.window(binding))?;
            Ok(Shot { range: piece.range, first: piece.groups.start, bound })
        });
        let shots = shots.collect::<Result<Vec<_>, DeviceError>>()?;
        let units = source::of(stage).units;
        let launches = Launches { params: stage.params(), units, shots, limits: &self.limits };
        let stamps: Option<(&QuerySet, u32)> = self.clock.start(&self.gpu, stage.name(), range)?;
        let run = launches.run(&self.gpu, &pipeline, stamps);
        if run.is_err() {
            // A dispatch that failed has no time.
            self.clock.take_back();
        }
        run
    }
}

impl Device for WgpuDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn create(&mut self, id: ResourceId, spec: &ResourceSpec) -> Result<(), DeviceError> {
        self.gpu.enter()?;
        self.store.add(id, || Resource::new(&self.gpu, spec, &self.info.limits))
    }

    fn destroy(&mut self, id: ResourceId) {
        self.store.remove(id);
    }

    fn write(&mut self, id: ResourceId, offset: u64, data: &[u8]) -> Result<(), DeviceError> {
        self.gpu.enter()?;
        match self.store.get(id)? {
            Resource::Buffer(memory) => {
                span(offset, data.len(), memory.bytes)?;
                let mut at = offset;
                for chunk in data.chunks(STAGING as usize) {
                    let bytes = chunk.len() as u64;
                    self.gpu.guarded(bytes, || self.gpu.queue.write_buffer(&memory.buffer, at, chunk))?;
                    self.gpu.wrote(bytes)?;
                    at += bytes;
                }
                Ok(())
            }
            Resource::Field(volume) => {
                let slice = volume.spec.slice_bytes();
                if !offset.is_multiple_of(slice) || !(data.len() as u64).is_multiple_of(slice) {
                    return Err(DeviceError::Invalid(format!("fields are written in whole slices of {slice} bytes")));
                }
                span(offset, data.len(), volume.spec.bytes())?;
                volume.write(&mut self.gpu, (offset / slice) as u32, data)
            }
        }
    }

    fn read(&mut self, id: ResourceId, offset: u64, out: &mut [u8]) -> Result<(), DeviceError> {
        self.gpu.enter()?;
        let memory = self.store.buffer(id)?;
        span(offset, out.len(), memory.bytes)?;
        self.gpu.read(&memory.buffer, offset, out)
    }

    fn publish(&mut self, from: ResourceId, to: ResourceId) -> Result<(), DeviceError> {
        self.gpu.enter()?;
        let spec = self.store.field(to)?.spec;
        let held = self.store.buffer(from)?.bytes;
        if held != spec.bytes() {
            let text = format!("a field of {} bytes is not published from a buffer of {held}", spec.bytes());
            return Err(DeviceError::Invalid(text));
        }
        let pipeline = self.publisher(spec.format)?;
        let volume = self.store.field(to)?;
        // The work axis is the texels of a layer; each is a part of the buffer, with all its layers.
        let Ok(texels) = u32::try_from(spec.texels() / u64::from(spec.layers)) else {
            let requested = spec.texels() / u64::from(spec.layers);
            return Err(DeviceError::Limit { what: "the texels of a layer", requested, limit: u32::MAX.into() });
        };
        let words = spec.format.bytes() / 4 * u64::from(spec.layers);
        let source: Buf<f32> = Buf::new(from, held / 4);
        let binding = [Binding::read("buffer", Some(source)).in_parts::<f32>(words)];
        let cut = Cut::new(texels, 1, &binding, self.binding_limits())?;
        for (slab, (_, view)) in volume.textures.iter().enumerate() {
            let slices = volume.slabs.range(slab as u32);
            let [x, y, z] = spec.dims;
            let params = PublishParams { dims: [x, y, z, spec.layers], slices: [slices.start, slices.end, 0, 0] };
            let shots = cut.pieces(0..texels).map(|piece| {
                let bound = self.store.bound(&binding, |binding| piece.window(binding))?;
                let bound = Bound { textures: vec![(0, view)], ..bound };
                Ok(Shot { range: piece.range, first: piece.groups.start, bound })
            });
            let shots = shots.collect::<Result<Vec<_>, DeviceError>>()?;
            let (params, units) = (bytemuck::bytes_of(&params), source::PUBLISH_UNITS);
            Launches { params, units, shots, limits: &self.limits }.run(&self.gpu, &pipeline, None)?;
        }
        Ok(())
    }

    fn dispatch(&mut self, stage: &Stage, range: Range<u32>) -> Result<(), DeviceError> {
        self.gpu.enter()?;
        stage.validate().map_err(DeviceError::Invalid)?;
        if range.start > range.end || range.end > stage.axis() {
            return Err(DeviceError::Invalid(format!("{range:?} is not a part of {}", stage.axis())));
        }
        if range.is_empty() {
            self.clock.idle(stage.name(), range);
            return Ok(());
        }
        self.run_stage(stage, range)
    }

    fn finish(&mut self) -> Result<Vec<StageTime>, DeviceError> {
        self.clock.finish(&mut self.gpu)
    }

    fn narrow(&mut self, limits: &Limits) -> bool {
        self.info.limits = self.info.limits.min(limits);
        true
    }
}
