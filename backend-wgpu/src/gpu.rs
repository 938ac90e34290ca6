//! wgpu's device and queue, with every fault turned into an error of ours.

use std::collections::VecDeque;
use std::mem;
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::time::Duration;

use airlight_core::device::DeviceError;
use wgpu::{Buffer, BufferDescriptor, BufferUsages, ErrorFilter, PollError, PollType, SubmissionIndex};

/// Bytes that are read back, or written, at a time: staging memory is bounded by it.
pub(crate) const STAGING: u64 = 32 << 20;

/// Faults that arrive outside the call that caused them.
#[derive(Debug, Default)]
struct Faults {
    /// Why the device is gone.
    lost: Option<String>,
    /// The first fault that nobody has heard of yet.
    late: Option<DeviceError>,
}

/// A device and its queue.
#[derive(Debug)]
pub(crate) struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    faults: Arc<Mutex<Faults>>,
    /// Bytes written since the last submission.
    written: u64,
    /// Whether nobody else uses the device.
    own: bool,
    /// How long a submission may take.
    patience: Option<Duration>,
    /// Submissions that nobody has waited for, with what they are.
    under_way: VecDeque<(SubmissionIndex, &'static str)>,
}

/// For the owner of a device that is shared: tells of its loss, of which wgpu informs only one.
#[derive(Clone, Debug)]
pub struct LossNotice(Arc<Mutex<Faults>>);

impl LossNotice {
    /// From now on every call of the device of ours fails with [`DeviceError::Lost`] and this reason.
    pub fn tell(&self, reason: impl Into<String>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).lost.get_or_insert(reason.into());
    }
}

fn of(error: wgpu::Error, requested: u64) -> DeviceError {
    match error {
        wgpu::Error::OutOfMemory { .. } => DeviceError::OutOfMemory { requested, available: None },
        wgpu::Error::Validation { description, .. } | wgpu::Error::Internal { description, .. } => {
            DeviceError::Backend(description)
        }
    }
}

impl Gpu {
    /// A device that is ours alone: what it says is for us.
    pub(crate) fn own(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let faults = Arc::new(Mutex::new(Faults::default()));
        let heard = Arc::clone(&faults);
        device.on_uncaptured_error(Arc::new(move |error| {
            let mut faults = heard.lock().unwrap_or_else(PoisonError::into_inner);
            faults.late.get_or_insert(of(error, 0));
        }));
        let heard = Arc::clone(&faults);
        device.set_device_lost_callback(move |reason, text| {
            let mut faults = heard.lock().unwrap_or_else(PoisonError::into_inner);
            let text = if text.is_empty() { format!("{reason:?}") } else { text };
            faults.lost.get_or_insert(text);
        });
        Self { own: true, ..Self::with(device, queue, faults) }
    }

    /// A device that others use too. wgpu has one listener each for uncaptured errors and for the loss of the device,
    /// and they are the others': errors of ours are all caught where they arise ([`Gpu::guarded`]).
    pub(crate) fn shared(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        Self::with(device, queue, Arc::default())
    }

    fn with(device: wgpu::Device, queue: wgpu::Queue, faults: Arc<Mutex<Faults>>) -> Self {
        Self { device, queue, faults, written: 0, own: false, patience: None, under_way: VecDeque::new() }
    }

    /// What tells of the loss of a device that is shared.
    pub(crate) fn loss_notice(&self) -> LossNotice {
        LossNotice(Arc::clone(&self.faults))
    }

    /// Fails where the device is gone, for good; or where a fault arrived late, once.
    pub(crate) fn check(&self) -> Result<(), DeviceError> {
        let mut faults = self.faults.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(text) = &faults.lost {
            return Err(DeviceError::Lost(text.clone()));
        }
        faults.late.take().map_or(Ok(()), Err)
    }

    /// As [`Gpu::check`], after hearing of what happened since the last call: a lost device says nothing by itself.
    pub(crate) fn enter(&self) -> Result<(), DeviceError> {
        // What polling says besides is heard when something is waited for. On a device of others it would call what
        // they wait for in the middle of our work.
        if self.own {
            let _ = self.device.poll(PollType::Poll);
        }
        self.check()
    }

    /// Makes calls of wgpu and catches what they report; `bytes` is what they ask for.
    pub(crate) fn guarded<R>(&self, bytes: u64, calls: impl FnOnce() -> R) -> Result<R, DeviceError> {
        self.check()?;
        let filters = [ErrorFilter::OutOfMemory, ErrorFilter::Internal, ErrorFilter::Validation];
        let scopes = filters.map(|filter| self.device.push_error_scope(filter));
        let result = calls();
        let mut fault = None;
        // Scopes close in the reverse order.
        for scope in scopes.into_iter().rev() {
            fault = pollster::block_on(scope.pop()).or(fault);
        }
        // What a lost device reports of single calls says less than that it is lost.
        self.check()?;
        fault.map_or(Ok(result), |error| Err(of(error, bytes)))
    }

    /// Makes a buffer, filled with zeros.
    pub(crate) fn buffer(&self, label: &str, size: u64, usage: BufferUsages) -> Result<Buffer, DeviceError> {
        let description = BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        self.guarded(size, || self.device.create_buffer(&description))
    }

    /// Counts bytes handed to the queue, and lets it send them before too many are held.
    pub(crate) fn wrote(&mut self, bytes: u64) -> Result<(), DeviceError> {
        self.written += bytes;
        if self.written >= 2 * STAGING {
            self.guarded(self.written, || self.queue.submit([]))?;
            self.wait()?;
        }
        Ok(())
    }

    /// Sends what was written on its way.
    pub(crate) fn flush(&mut self) -> Result<(), DeviceError> {
        self.under_way.clear();
        if self.written > 0 {
            self.written = 0;
            self.guarded(0, || self.queue.submit([]))?;
        }
        self.check()
    }

    /// Sets how long a submission may take from now on.
    pub(crate) fn set_patience(&mut self, patience: Option<Duration>) {
        self.patience = patience;
    }

    /// Books a submission that will be waited for.
    pub(crate) fn sent(&mut self, what: &'static str, submission: SubmissionIndex) {
        self.under_way.push_back((submission, what));
    }

    /// Waits for all work so far, or until something of it takes too long.
    pub(crate) fn wait(&mut self) -> Result<(), DeviceError> {
        self.written = 0;
        while let Some((submission, stage)) = self.under_way.pop_front() {
            let Some(patience) = self.patience else { continue };
            // The queue runs in order, so that this one runs since the last one ended.
            let wait = PollType::Wait { submission_index: Some(submission), timeout: Some(patience) };
            match self.guarded(0, || self.device.poll(wait))? {
                Err(PollError::Timeout) => return Err(self.give_up(stage, patience)),
                waited => waited.map_err(|error| DeviceError::Backend(error.to_string()))?,
            };
        }
        let waited = self.guarded(0, || self.device.poll(PollType::wait_indefinitely()))?;
        waited.map_err(|error| DeviceError::Backend(error.to_string()))?;
        self.check()
    }

    /// Leaves what does not end to itself. Device and queue are never released, because that waits.
    fn give_up(&mut self, stage: &'static str, patience: Duration) -> DeviceError {
        let error = DeviceError::Timeout { stage, patience };
        let mut faults = self.faults.lock().unwrap_or_else(PoisonError::into_inner);
        faults.lost.get_or_insert(error.to_string());
        mem::forget((self.device.clone(), self.queue.clone()));
        error
    }

    /// Reads from `offset` of a buffer on, after all work so far.
    pub(crate) fn read(&mut self, from: &Buffer, offset: u64, out: &mut [u8]) -> Result<(), DeviceError> {
        let size = STAGING.min(out.len() as u64);
        if size == 0 {
            return self.check();
        }
        let staging = self.buffer("read back", size, BufferUsages::MAP_READ | BufferUsages::COPY_DST)?;
        let mut at = offset;
        for chunk in out.chunks_mut(size as usize) {
            let bytes = chunk.len() as u64;
            self.guarded(bytes, || {
                let mut encoder = self.device.create_command_encoder(&Default::default());
                encoder.copy_buffer_to_buffer(from, at, &staging, 0, bytes);
                self.queue.submit([encoder.finish()])
            })?;
            let (sender, mapped) = mpsc::channel();
            self.guarded(bytes, || {
                staging.slice(..bytes).map_async(wgpu::MapMode::Read, move |result| {
                    // Nobody listens any more only where waiting failed, which is reported there.
                    let _ = sender.send(result);
                });
            })?;
            self.wait()?;
            let failed = |text: String| DeviceError::Backend(format!("reading back: {text}"));
            mapped.try_recv().map_err(|e| failed(e.to_string()))?.map_err(|e| failed(e.to_string()))?;
            let view = staging.slice(..bytes).get_mapped_range().map_err(|e| failed(e.to_string()))?;
            chunk.copy_from_slice(&view);
            drop(view);
            staging.unmap();
            at += bytes;
        }
        self.check()
    }
}
