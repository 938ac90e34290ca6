//! Devices that are opened once and used by many cases: drivers load or compile every kernel anew for a device just opened, which is
//! most of what a case takes, and what runs pictures for a living runs many on one device.

use std::collections::HashSet;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use airlight::device::{Device, DeviceError, DeviceInfo, FieldKinds, Limits, ResourceId, ResourceSpec, StageTime};
use airlight::stage::Stage;

type Open = dyn Fn() -> Result<Box<dyn Device>, String> + Send + Sync;
/// Devices, and how often each was lent.
type Idle = Arc<Mutex<Vec<(Box<dyn Device>, u32)>>>;

/// How often a device is lent: it keeps every kernel that it has met, megabytes each, of which the next cases need a few.
const USES: u32 = 64;

/// Opens devices, and lends those that came back before it opens another. What comes back holds nothing and has no limit of time. A
/// device does not come back that was lent often, was lost or gave up, whose limits were narrowed, that fails when it is cleared, or
/// with which a case panicked.
#[derive(Clone)]
pub struct Lender {
    open: Arc<Open>,
    idle: Idle,
}

impl Lender {
    /// Lends what `open` opens.
    pub fn new(open: impl Fn() -> Result<Box<dyn Device>, String> + Send + Sync + 'static) -> Self {
        Self { open: Arc::new(open), idle: Idle::default() }
    }

    /// A device that may have been used before; it comes back when it is dropped.
    ///
    /// # Errors
    /// What `open` says.
    pub fn lend(&self) -> Result<Box<dyn Device>, String> {
        let idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let (inner, uses) = match idle {
            Some(idle) => idle,
            None => ((self.open)()?, 0),
        };
        let (held, spoilt, idle) = (HashSet::new(), uses + 1 == USES, self.idle.clone());
        Ok(Box::new(Lent { inner: Some(inner), uses: uses + 1, held, spoilt, idle }))
    }

    /// A device just opened, which does not come back.
    ///
    /// # Errors
    /// What `open` says.
    pub fn fresh(&self) -> Result<Box<dyn Device>, String> {
        (self.open)()
    }
}

/// A device that is lent.
struct Lent {
    /// There until it is dropped.
    inner: Option<Box<dyn Device>>,
    uses: u32,
    held: HashSet<ResourceId>,
    /// Whether it must not come back.
    spoilt: bool,
    idle: Idle,
}

impl Lent {
    fn device(&self) -> &dyn Device {
        self.inner.as_deref().expect("a device is lent until it is dropped")
    }

    /// What the device does, unless it is gone after that.
    fn done<R>(&mut self, run: impl FnOnce(&mut dyn Device) -> Result<R, DeviceError>) -> Result<R, DeviceError> {
        let inner = self.inner.as_deref_mut().expect("a device is lent until it is dropped");
        let result = run(inner);
        self.spoilt |= matches!(result, Err(DeviceError::Lost(_) | DeviceError::Timeout { .. }));
        result
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
        let Some(mut inner) = self.inner.take() else { return };
        if self.spoilt || thread::panicking() {
            return;
        }
        for id in self.held.drain() {
            inner.destroy(id);
        }
        inner.set_patience(None);
        if inner.finish().is_ok() {
            self.idle.lock().unwrap_or_else(PoisonError::into_inner).push((inner, self.uses));
        }
    }
}

impl Device for Lent {
    fn info(&self) -> &DeviceInfo {
        self.device().info()
    }

    fn free_memory(&self) -> Option<u64> {
        self.device().free_memory()
    }

    fn scratch(&self, stage: &Stage) -> u64 {
        self.device().scratch(stage)
    }

    fn field_kinds(&self) -> FieldKinds {
        self.device().field_kinds()
    }

    fn create(&mut self, id: ResourceId, spec: &ResourceSpec) -> Result<(), DeviceError> {
        self.done(|device| device.create(id, spec))?;
        self.held.insert(id);
        Ok(())
    }

    fn destroy(&mut self, id: ResourceId) {
        self.held.remove(&id);
        if let Some(inner) = &mut self.inner {
            inner.destroy(id);
        }
    }

    fn write(&mut self, id: ResourceId, offset: u64, data: &[u8]) -> Result<(), DeviceError> {
        self.done(|device| device.write(id, offset, data))
    }

    fn read(&mut self, id: ResourceId, offset: u64, out: &mut [u8]) -> Result<(), DeviceError> {
        self.done(|device| device.read(id, offset, out))
    }

    fn view(&self, id: ResourceId) -> Option<&[u8]> {
        self.device().view(id)
    }

    fn publish(&mut self, from: ResourceId, to: ResourceId) -> Result<(), DeviceError> {
        self.done(|device| device.publish(from, to))
    }

    fn dispatch(&mut self, stage: &Stage, range: Range<u32>) -> Result<(), DeviceError> {
        self.done(|device| device.dispatch(stage, range))
    }

    fn finish(&mut self) -> Result<Vec<StageTime>, DeviceError> {
        self.done(|device| device.finish())
    }

    fn flush(&mut self) -> Result<(), DeviceError> {
        self.done(|device| device.flush())
    }

    fn set_patience(&mut self, patience: Option<Duration>) {
        if let Some(inner) = &mut self.inner {
            inner.set_patience(patience);
        }
    }

    fn narrow(&mut self, limits: &Limits) -> bool {
        self.spoilt = true;
        self.inner.as_mut().is_some_and(|inner| inner.narrow(limits))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use airlight::device::Usage;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// A lender of processors, and how many it opened.
    fn lender() -> (Lender, Arc<AtomicU32>) {
        let opened = Arc::new(AtomicU32::new(0));
        let count = opened.clone();
        let open = move || {
            count.fetch_add(1, Ordering::Relaxed);
            airlight::open("cpu").map_err(|e| e.to_string())
        };
        (Lender::new(open), opened)
    }

    fn buffer(device: &mut dyn Device) -> Result<(), DeviceError> {
        device.create(ResourceId(7), &ResourceSpec::Buffer { bytes: 16, usage: Usage::Work })
    }

    #[test]
    fn what_comes_back_holds_nothing_and_is_lent_again() {
        let (lender, opened) = lender();
        for _ in 0..3 {
            let mut device = lender.lend().unwrap();
            buffer(&mut *device).unwrap();
            assert!(buffer(&mut *device).is_err(), "it is there");
        }
        assert_eq!(opened.load(Ordering::Relaxed), 1);
        // Two at the same time are two, and a fresh one is another.
        drop((lender.lend().unwrap(), lender.lend().unwrap(), lender.fresh().unwrap()));
        assert_eq!(opened.load(Ordering::Relaxed), 3);
        drop((lender.lend().unwrap(), lender.lend().unwrap()));
        assert_eq!(opened.load(Ordering::Relaxed), 3);
    }

    #[test]
    fn what_was_narrowed_or_panicked_with_or_lent_often_does_not_come_back() {
        let (lender, opened) = lender();
        let mut narrowed = lender.lend().unwrap();
        let limits = narrowed.info().limits;
        narrowed.narrow(&limits);
        drop(narrowed);
        let lent = lender.lend().unwrap();
        assert_eq!(opened.load(Ordering::Relaxed), 2);
        thread::spawn(move || {
            let _lent = lent;
            std::panic::resume_unwind(Box::new("a case that panics"));
        })
        .join()
        .unwrap_err();
        for _ in 0..USES {
            lender.lend().unwrap();
        }
        assert_eq!(opened.load(Ordering::Relaxed), 3);
        lender.lend().unwrap();
        assert_eq!(opened.load(Ordering::Relaxed), 4);
    }
}
