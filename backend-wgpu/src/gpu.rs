//! wgpu's device and queue, with every fault turned into an error of ours.

use std::cell::Cell;
use std::collections::VecDeque;
use std::mem;
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::thread;
use std::time::{Duration, Instant};

use airlight_core::device::DeviceError;
use wgpu::{
    BindGroup, BindGroupDescriptor, Buffer, BufferDescriptor, BufferUsages, DeviceType, ErrorFilter, PollError,
    PollStatus, PollType, SubmissionIndex, Texture, TextureDescriptor,
};

use crate::batch::Batch;
use crate::staging::Staging;

/// The most bytes that are read back at a time.
const READ: u64 = 32 << 20;
/// The fewest that room is made for.
const LEAST_READ: u64 = 1 << 16;
/// How long a wait for a graphics card asks again and again before it sleeps. Waking up takes as long as a small stage: on an H100
/// this took 25 µs off every wait.
const AWAKE: Duration = Duration::from_micros(200);

/// How often things were made that a steady frame does not make, and how often it waited for a part of a buffer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Made {
    pub(crate) buffers: u64,
    pub(crate) textures: u64,
    pub(crate) groups: u64,
    pub(crate) pipelines: u64,
    pub(crate) reads: u64,
}

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
    /// Whether nobody else uses the device.
    own: bool,
    /// How long a wait asks again and again.
    awake: Duration,
    /// Threads of a driver that runs on processors.
    pub(crate) threads: u32,
    /// How long a submission may take.
    pub(crate) patience: Option<Duration>,
    /// Submissions that nobody has waited for, with what they are.
    under_way: VecDeque<(SubmissionIndex, &'static str)>,
    /// Whether all of them were done when the last call began.
    pub(crate) idle: bool,
    pub(crate) batch: Batch,
    pub(crate) staging: Staging,
    /// Where what is read back goes through.
    back: Option<Buffer>,
    made: Cell<Made>,
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
        // A software device needs the core that would ask; on a device of others, each question calls what they wait for.
        let awake = if device.adapter_info().device_type == DeviceType::Cpu { Duration::ZERO } else { AWAKE };
        Self { own: true, awake, ..Self::with(device, queue, faults) }
    }

    /// A device that others use too. wgpu has one listener each for uncaptured errors and for the loss of the device,
    /// and they are the others': errors of ours are all caught where they arise ([`Gpu::guarded`]).
    pub(crate) fn shared(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        Self::with(device, queue, Arc::default())
    }

    fn with(device: wgpu::Device, queue: wgpu::Queue, faults: Arc<Mutex<Faults>>) -> Self {
        let threads = thread::available_parallelism().map_or(1, |threads| threads.get() as u32);
        Self {
            device,
            queue,
            faults,
            own: false,
            awake: Duration::ZERO,
            threads,
            patience: None,
            under_way: VecDeque::new(),
            idle: true,
            batch: Batch::default(),
            staging: Staging::default(),
            back: None,
            made: Cell::default(),
        }
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

    /// As [`Gpu::check`], after hearing of what happened since the last call: a lost device says nothing by itself. A device
    /// that has nothing to do gets what was recorded.
    pub(crate) fn enter(&mut self) -> Result<(), DeviceError> {
        // What polling says besides is heard when something is waited for. On a device of others it would call what
        // they wait for in the middle of our work.
        self.idle = match self.own {
            true => matches!(self.device.poll(PollType::Poll), Ok(PollStatus::QueueEmpty)),
            false => self.under_way.is_empty(),
        };
        self.check()?;
        if self.idle { self.send() } else { Ok(()) }
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

    /// What was made so far.
    #[cfg(test)]
    pub(crate) fn made(&self) -> Made {
        self.made.get()
    }

    /// Counts something that is made.
    pub(crate) fn count(&self, what: impl FnOnce(&mut Made) -> &mut u64) {
        let mut made = self.made.get();
        *what(&mut made) += 1;
        self.made.set(made);
    }

    /// Makes a buffer, filled with zeros.
    pub(crate) fn buffer(&self, label: &str, size: u64, usage: BufferUsages) -> Result<Buffer, DeviceError> {
        self.count(|made| &mut made.buffers);
        let description = BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        self.guarded(size, || self.device.create_buffer(&description))
    }

    /// Makes a texture of so many bytes, filled with zeros.
    pub(crate) fn texture(&self, bytes: u64, description: &TextureDescriptor<'_>) -> Result<Texture, DeviceError> {
        self.count(|made| &mut made.textures);
        self.guarded(bytes, || self.device.create_texture(description))
    }

    /// Makes a bind group.
    pub(crate) fn group(&self, description: &BindGroupDescriptor<'_>) -> Result<BindGroup, DeviceError> {
        self.count(|made| &mut made.groups);
        self.guarded(0, || self.device.create_bind_group(description))
    }

    /// Sends what was recorded on its way.
    pub(crate) fn flush(&mut self) -> Result<(), DeviceError> {
        self.send()?;
        self.under_way.clear();
        self.check()
    }

    /// Sets how long a submission may take from now on.
    pub(crate) fn set_patience(&mut self, patience: Option<Duration>) {
        self.patience = patience;
    }

    /// Waits for all work so far where something of it may take too long.
    pub(crate) fn wait_with_patience(&mut self) -> Result<(), DeviceError> {
        if self.patience.is_some() { self.wait() } else { Ok(()) }
    }

    /// Books a submission that will be waited for.
    pub(crate) fn sent(&mut self, what: &'static str, submission: SubmissionIndex) {
        self.idle = false;
        self.under_way.push_back((submission, what));
    }

    /// Waits for all work so far, or until something of it takes too long.
    pub(crate) fn wait(&mut self) -> Result<(), DeviceError> {
        self.send()?;
        if self.patience.is_some() {
            while self.wait_next()? {}
        }
        self.under_way.clear();
        self.wait_for(None, None)?.map_err(|error| DeviceError::Backend(error.to_string()))?;
        self.check()
    }

    /// Waits for the submission that was sent first, of those that nobody has waited for, or else for all. Whether there was one.
    pub(crate) fn wait_next(&mut self) -> Result<bool, DeviceError> {
        let Some((submission, what)) = self.under_way.pop_front() else {
            self.wait_for(None, None)?.map_err(|error| DeviceError::Backend(error.to_string()))?;
            return Ok(false);
        };
        // The queue runs in order, so that this one runs since the last one ended.
        match (self.wait_for(Some(submission), self.patience)?, self.patience) {
            (Err(PollError::Timeout), Some(patience)) => Err(self.give_up(what, patience)),
            (waited, _) => waited.map(|_| true).map_err(|error| DeviceError::Backend(error.to_string())),
        }
    }

    fn wait_for(
        &self,
        submission_index: Option<SubmissionIndex>,
        timeout: Option<Duration>,
    ) -> Result<Result<PollStatus, PollError>, DeviceError> {
        let begin = Instant::now();
        while begin.elapsed() < self.awake && !matches!(self.device.poll(PollType::Poll), Ok(PollStatus::QueueEmpty)) {
            std::hint::spin_loop();
        }
        self.guarded(0, || self.device.poll(PollType::Wait { submission_index, timeout }))
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
        let size = READ.min(out.len() as u64);
        if size == 0 {
            return self.check();
        }
        let back = match self.back.take() {
            Some(back) if back.size() >= size => back,
            _ => {
                let room = size.next_power_of_two().max(LEAST_READ);
                self.buffer("read back", room, BufferUsages::MAP_READ | BufferUsages::COPY_DST)?
            }
        };
        let mut at = offset;
        for chunk in out.chunks_mut(size as usize) {
            let bytes = chunk.len() as u64;
            self.copies()?.copy_buffer_to_buffer(from, at, &back, 0, bytes);
            self.send()?;
            let (sender, mapped) = mpsc::channel();
            self.guarded(bytes, || {
                back.slice(..bytes).map_async(wgpu::MapMode::Read, move |result| {
                    // Nobody listens any more only where waiting failed, which is reported there.
                    let _ = sender.send(result);
                });
            })?;
            self.wait()?;
            let failed = |text: String| DeviceError::Backend(format!("reading back: {text}"));
            mapped.try_recv().map_err(|e| failed(e.to_string()))?.map_err(|e| failed(e.to_string()))?;
            let view = back.slice(..bytes).get_mapped_range().map_err(|e| failed(e.to_string()))?;
            chunk.copy_from_slice(&view);
            drop(view);
            back.unmap();
            at += bytes;
        }
        // After a fault another one is made.
        self.back = Some(back);
        self.check()
    }
}
