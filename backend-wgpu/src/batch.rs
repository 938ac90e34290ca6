//! Work that was recorded and not yet sent: commands, and the parameters of the dispatches among them.

use std::mem;

use airlight_core::device::DeviceError;
use wgpu::{Buffer, BufferUsages, CommandBuffer, CommandEncoder};

use crate::gpu::Gpu;

/// Parameters begin at multiples of this; WebGPU lets no adapter ask for more.
pub(crate) const UNIFORM: usize = 256;
/// The fewest bytes of parameters that room is made for.
const LEAST: u64 = 1 << 16;
/// Dispatches that are sent together, where the device has something to do meanwhile.
const MOST: u32 = 8;

/// Work to be sent together.
#[derive(Debug, Default)]
pub(crate) struct Batch {
    commands: Vec<CommandBuffer>,
    /// Copies after these commands.
    copies: Option<CommandEncoder>,
    dispatches: u32,
    /// What was dispatched last.
    what: Option<&'static str>,
    /// Parameters of the dispatches.
    params: Vec<u8>,
    /// What holds them on the device. The queue runs in order, so that every batch has all of it.
    uniforms: Option<Buffer>,
    /// Whether work was lost since the last time somebody asked.
    lost: bool,
}

impl Batch {
    /// Takes the parameters of a dispatch, for which [`Gpu::make_room`] was called; gives where they stand.
    pub(crate) fn push_params(&mut self, params: &[u8]) -> u32 {
        let at = self.params.len();
        self.params.extend_from_slice(params);
        self.params.resize(self.params.len().next_multiple_of(UNIFORM), 0);
        at as u32
    }

    /// Whether work that was recorded never reached the device, since the last time this was asked.
    pub(crate) fn take_lost(&mut self) -> bool {
        mem::take(&mut self.lost)
    }
}

/// Where the parameters of a batch are, and the memory that was too small for them.
pub(crate) struct Room {
    pub(crate) uniforms: Buffer,
    pub(crate) outgrown: Option<Buffer>,
}

impl Gpu {
    /// Makes room for so many bytes of parameters, in whole multiples of [`UNIFORM`].
    pub(crate) fn make_room(&mut self, bytes: u64) -> Result<Room, DeviceError> {
        let has = self.batch.uniforms.as_ref().map_or(0, Buffer::size);
        if self.batch.params.len() as u64 + bytes > has {
            self.send()?;
        }
        match &self.batch.uniforms {
            Some(uniforms) if bytes <= has => Ok(Room { uniforms: uniforms.clone(), outgrown: None }),
            _ => {
                let size = bytes.next_power_of_two().max(LEAST);
                let uniforms = self.buffer("parameters", size, BufferUsages::UNIFORM | BufferUsages::COPY_DST)?;
                let outgrown = self.batch.uniforms.replace(uniforms.clone());
                Ok(Room { uniforms, outgrown })
            }
        }
    }

    /// What records copies after all that was recorded.
    pub(crate) fn copies(&mut self) -> Result<&mut CommandEncoder, DeviceError> {
        let copies = match self.batch.copies.take() {
            Some(copies) => copies,
            None => self.guarded(0, || self.device.create_command_encoder(&Default::default()))?,
        };
        Ok(self.batch.copies.insert(copies))
    }

    /// Records a dispatch after all that was recorded. It is sent at once where the device has nothing to do, and alone where
    /// something shall not take too long.
    pub(crate) fn record(&mut self, what: &'static str, dispatch: CommandBuffer) -> Result<(), DeviceError> {
        self.close_copies()?;
        self.batch.commands.push(dispatch);
        self.batch.dispatches += 1;
        self.batch.what = Some(what);
        let now = self.idle || self.patience.is_some() || self.batch.dispatches >= MOST;
        if now { self.send() } else { Ok(()) }
    }

    fn close_copies(&mut self) -> Result<(), DeviceError> {
        if let Some(copies) = self.batch.copies.take() {
            let closed = self.guarded(0, || copies.finish()).inspect_err(|_| self.batch.lost = true)?;
            self.batch.commands.push(closed);
        }
        Ok(())
    }

    /// Sends what was recorded.
    pub(crate) fn send(&mut self) -> Result<(), DeviceError> {
        let closed = self.close_copies();
        let batch = &mut self.batch;
        let (mut commands, mut params) = (mem::take(&mut batch.commands), mem::take(&mut batch.params));
        let what = batch.what.take().unwrap_or("copies");
        batch.dispatches = 0;
        if commands.is_empty() {
            return closed;
        }
        if let (false, Some(uniforms)) = (params.is_empty(), batch.uniforms.clone()) {
            let ahead = self.write_ahead(&uniforms, &params);
            commands.insert(0, ahead.inspect_err(|_| self.batch.lost = true)?);
        }
        params.clear();
        self.batch.params = params;
        let chunks = self.staging.close();
        let sent = self.guarded(0, || self.queue.submit(commands));
        let recalled = self.guarded(0, || self.staging.recall(&chunks));
        let sent = sent.inspect_err(|_| self.batch.lost = true)?;
        self.sent(what, sent);
        closed.and(recalled)
    }
}
