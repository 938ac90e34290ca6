//! The device.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::ops::Range;
use std::time::Duration;

use airlight_core::device::{
    Device, DeviceError, DeviceInfo, DeviceKind, FieldKinds, Limits, ResourceId, ResourceSpec, StageTime, Unavailable,
};
use airlight_core::host;
use airlight_core::stage::Stage;

use crate::cl::{Arg, Built, Cl};
use crate::clock::Clock;
use crate::platform;
use crate::source::{self, Lanes, Shape};
use crate::store::{Resource, Scratch, Store};

/// An OpenCL device.
#[derive(Debug)]
pub struct OpenclDevice {
    pub(crate) info: DeviceInfo,
    pub(crate) cl: Cl,
    /// What kernels are built with.
    pub(crate) options: &'static str,
    /// Of the packets of kernels.
    pub(crate) lanes: Lanes,
    pub(crate) store: Store,
    /// What work-items of a dispatch share.
    pub(crate) scratch: Scratch,
    /// Kernels by stage and the shapes of its bindings.
    kernels: HashMap<(&'static str, Vec<Shape>), Built>,
    clock: Clock,
}

impl OpenclDevice {
    /// Opens the device of an index, with packets of so many lanes in place of as many as suit it: how fast it is, and how its
    /// results are rounded, is all that differs.
    ///
    /// # Errors
    /// There is no such device.
    pub fn with_lanes(index: usize, lanes: Lanes) -> Result<Self, Unavailable> {
        platform::open(index, Some(lanes))
    }

    /// An opened device.
    pub(crate) fn new(info: DeviceInfo, cl: Cl, options: &'static str, lanes: Lanes) -> Self {
        let (store, scratch) = (Store::default(), Scratch::default());
        Self { info, cl, options, lanes, store, scratch, kernels: HashMap::new(), clock: Clock::default() }
    }

    /// Bytes of resources and of scratch memory.
    pub(crate) fn held(&self) -> u64 {
        self.store.bytes() + self.scratch.bytes()
    }

    fn run_stage(&mut self, stage: &Stage, range: Range<u32>) -> Result<(), DeviceError> {
        let source = source::of(stage, self.lanes);
        let (shapes, args) = self.store.bind(&stage.bindings())?;
        let key = (source.name, shapes);
        let kernel = match self.kernels.entry(key) {
            Entry::Occupied(kernel) => kernel.into_mut(),
            Entry::Vacant(place) => {
                let text = source.text(&place.key().1);
                place.insert(self.cl.build(source.name, &text, self.options, source.width)?)
            }
        };
        let (mut events, mut left, mut begun) = (Vec::new(), range.clone(), false);
        while !left.is_empty() {
            let mut next = source.next(stage, left.clone())?;
            if !begun && let Some(before) = source.before(stage, &next) {
                (next, begun) = (before, true);
            }
            let constants = [stage.params(), bytemuck::bytes_of(&next.launch)].concat();
            let scratch = source.shares().then(|| self.scratch.of(&mut self.cl, next.scratch)).transpose()?;
            let args: Vec<_> = args.iter().copied().chain(scratch.map(Arg::Mem)).collect();
            events.push(self.cl.run(kernel, &constants, &args, next.items, next.team)?);
            left.start += next.units;
        }
        self.clock.book(stage.name(), range, events);
        Ok(())
    }
}

impl Device for OpenclDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    /// OpenCL does not tell: the device's memory less what this one holds, scratch memory included, and no more than the host
    /// has where the device is not a card of its own.
    fn free_memory(&self) -> Option<u64> {
        let free = self.info.memory_bytes?.saturating_sub(self.held());
        let shared = self.info.kind != DeviceKind::DiscreteGpu;
        let host = if shared { host::free_memory() } else { None };
        Some(host.map_or(free, |host| host.min(free)))
    }

    fn scratch(&self, stage: &Stage) -> u64 {
        let Stage::Sweep(_) = stage else { return 0 };
        source::of(stage, self.lanes).next(stage, 0..stage.axis()).map_or(0, |dispatch| dispatch.scratch)
    }

    fn field_kinds(&self) -> FieldKinds {
        FieldKinds::ALL
    }

    fn create(&mut self, id: ResourceId, spec: &ResourceSpec) -> Result<(), DeviceError> {
        self.cl.check()?;
        spec.check_kind(self.field_kinds())?;
        self.store.add(id, || Resource::new(&mut self.cl, spec, &self.info.limits))
    }

    fn destroy(&mut self, id: ResourceId) {
        self.store.remove(id);
    }

    fn write(&mut self, id: ResourceId, offset: u64, data: &[u8]) -> Result<(), DeviceError> {
        self.cl.check()?;
        let resource = self.store.get(id)?;
        resource.spec().check_write(offset, data)?;
        match resource {
            Resource::Buffer(memory) => self.cl.write(&memory.mem, offset, data),
            Resource::Field(volume) => volume.write(&mut self.cl, offset, data),
        }
    }

    fn read(&mut self, id: ResourceId, offset: u64, out: &mut [u8]) -> Result<(), DeviceError> {
        self.cl.check()?;
        self.store.get(id)?.spec().check_read(offset, out.len())?;
        self.cl.read(&self.store.buffer(id)?.mem, offset, out)
    }

    fn view(&self, id: ResourceId) -> Option<&[u8]> {
        let shared = self.info.kind != DeviceKind::DiscreteGpu;
        let memory = self.store.buffer(id).ok().filter(|_| shared)?;
        self.cl.view(&memory.mem, memory.bytes)
    }

    fn publish(&mut self, from: ResourceId, to: ResourceId) -> Result<(), DeviceError> {
        self.cl.check()?;
        self.store.get(from)?.spec().check_publish(&self.store.get(to)?.spec())?;
        // Texels of a field lie as stages write them, so that no kernel is needed.
        self.store.field(to)?.publish(&mut self.cl, &self.store.buffer(from)?.mem)
    }

    fn dispatch(&mut self, stage: &Stage, range: Range<u32>) -> Result<(), DeviceError> {
        self.cl.check()?;
        stage.check(&range, |id| self.store.get(id).ok().map(Resource::spec))?;
        if range.is_empty() {
            self.clock.book(stage.name(), range, Vec::new());
            return Ok(());
        }
        self.run_stage(stage, range)
    }

    fn finish(&mut self) -> Result<Vec<StageTime>, DeviceError> {
        self.clock.finish(&mut self.cl)
    }

    fn set_patience(&mut self, patience: Option<Duration>) {
        self.cl.set_patience(patience);
    }

    fn narrow(&mut self, limits: &Limits) -> bool {
        // Sides of fields are cut nowhere.
        let Limits { field_side, .. } = self.info.limits;
        self.info.limits = Limits { field_side, ..self.info.limits.min(limits) };
        true
    }
}
