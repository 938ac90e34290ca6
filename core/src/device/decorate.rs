//! Devices that wrap a device.

use std::ops::Range;
use std::time::Duration;

use super::{Device, DeviceError, DeviceInfo, FieldKinds, Limits, ResourceId, ResourceSpec, StageTime};
use crate::device::{Binding, BindingAccess};
use crate::stage::Stage;

/// Forwards every call that a decorator leaves as it is.
macro_rules! forward {
    () => {
        fn info(&self) -> &DeviceInfo {
            self.inner.info()
        }

        fn free_memory(&self) -> Option<u64> {
            self.inner.free_memory()
        }

        fn scratch(&self, stage: &Stage) -> u64 {
            self.inner.scratch(stage)
        }

        fn field_kinds(&self) -> FieldKinds {
            self.inner.field_kinds()
        }

        fn create(&mut self, id: ResourceId, spec: &ResourceSpec) -> Result<(), DeviceError> {
            self.inner.create(id, spec)
        }

        fn destroy(&mut self, id: ResourceId) {
            self.inner.destroy(id);
        }

        fn write(&mut self, id: ResourceId, offset: u64, data: &[u8]) -> Result<(), DeviceError> {
            self.inner.write(id, offset, data)
        }

        fn read(&mut self, id: ResourceId, offset: u64, out: &mut [u8]) -> Result<(), DeviceError> {
            self.inner.read(id, offset, out)
        }

        fn publish(&mut self, from: ResourceId, to: ResourceId) -> Result<(), DeviceError> {
            self.inner.publish(from, to)
        }

        fn set_patience(&mut self, patience: Option<Duration>) {
            self.inner.set_patience(patience);
        }

        fn narrow(&mut self, limits: &Limits) -> bool {
            self.inner.narrow(limits)
        }
    };
}

/// Tells a listener the time of every dispatch.
pub struct Traced {
    inner: Box<dyn Device>,
    listener: Box<dyn FnMut(&StageTime) + Send>,
}

impl Traced {
    /// `inner`, with `listener` told of every dispatch when it is finished.
    pub fn new(inner: Box<dyn Device>, listener: Box<dyn FnMut(&StageTime) + Send>) -> Self {
        Self { inner, listener }
    }
}

impl Device for Traced {
    forward!();

    fn dispatch(&mut self, stage: &Stage, range: Range<u32>) -> Result<(), DeviceError> {
        self.inner.dispatch(stage, range)
    }

    fn finish(&mut self) -> Result<Vec<StageTime>, DeviceError> {
        let times = self.inner.finish()?;
        times.iter().for_each(&mut self.listener);
        Ok(times)
    }
}

/// How [`Faulty`] breaks a stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// The stage does not run, and its outputs stay as they were.
    Skip,
    /// The stage runs, and every value it wrote is then multiplied by this factor.
    Scale(f32),
    /// The dispatch fails.
    Fail,
    /// Every dispatch takes so much longer.
    Slow(Duration),
    /// The stage finds zeros in the buffer of that name that it reads.
    Blind(&'static str),
}

/// Breaks one stage on purpose, so that a suite can prove that it notices.
pub struct Faulty {
    inner: Box<dyn Device>,
    stage: &'static str,
    fault: Fault,
}

impl Faulty {
    /// `inner`, with the stage of that name broken.
    pub fn new(inner: Box<dyn Device>, stage: &'static str, fault: Fault) -> Self {
        Self { inner, stage, fault }
    }

    fn scale(&mut self, stage: &Stage, factor: f32) -> Result<(), DeviceError> {
        for binding in stage.bindings() {
            let Binding { id: Some(id), access: BindingAccess::Write(bytes), .. } = binding else { continue };
            let mut values = vec![0.0f32; bytes as usize / 4];
            self.inner.read(id, 0, bytemuck::cast_slice_mut(&mut values))?;
            values.iter_mut().for_each(|v| *v *= factor);
            self.inner.write(id, 0, bytemuck::cast_slice(&values))?;
        }
        Ok(())
    }

    fn blind(&mut self, stage: &Stage, range: Range<u32>, name: &str) -> Result<(), DeviceError> {
        let found = stage.bindings().into_iter().find(|binding| binding.name == name);
        let Some(Binding { id: Some(id), access: BindingAccess::Read(bytes), .. }) = found else {
            return Err(DeviceError::Invalid(format!("{} reads no {name}", stage.name())));
        };
        let mut held = vec![0; bytes as usize];
        self.inner.read(id, 0, &mut held)?;
        self.inner.write(id, 0, &vec![0; held.len()])?;
        self.inner.dispatch(stage, range)?;
        self.inner.write(id, 0, &held)
    }
}

impl Device for Faulty {
    forward!();

    fn dispatch(&mut self, stage: &Stage, range: Range<u32>) -> Result<(), DeviceError> {
        if stage.name() != self.stage {
            return self.inner.dispatch(stage, range);
        }
        match self.fault {
            // An empty range keeps the count of dispatches and their times right.
            Fault::Skip => self.inner.dispatch(stage, range.start..range.start),
            Fault::Fail => Err(DeviceError::Backend(format!("{} was broken on purpose", self.stage))),
            Fault::Slow(by) => {
                std::thread::sleep(by);
                self.inner.dispatch(stage, range)
            }
            Fault::Blind(name) => self.blind(stage, range, name),
            Fault::Scale(factor) => {
                let last = range.end == stage.axis();
                self.inner.dispatch(stage, range)?;
                // Once, after the last piece, so that each value is scaled one time.
                if last { self.scale(stage, factor) } else { Ok(()) }
            }
        }
    }

    fn finish(&mut self) -> Result<Vec<StageTime>, DeviceError> {
        let mut times = self.inner.finish()?;
        if let Fault::Slow(by) = self.fault {
            times.iter_mut().filter(|time| time.stage == self.stage).for_each(|time| time.time += by);
        }
        Ok(times)
    }

    fn flush(&mut self) -> Result<(), DeviceError> {
        self.inner.flush()
    }
}
