//! What is on its way to the device, whose memory the host keeps meanwhile.

use std::collections::VecDeque;
use std::mem;

use ocl::core::{self, CommandExecutionStatus, Event, Mem};

/// Bytes of a write that is worth a copy, so that nobody waits for it: what is larger takes longer than waiting does.
const SMALL: usize = 1 << 20;

/// Bytes that are on their way at the most.
const MOST: usize = 16 << 20;

/// Bytes that writes behind each other are joined to: enough that few are sent, few enough that the device copies the first
/// ones while the host makes the next.
const JOINED: usize = 256 << 10;

/// Copies of what is being written, oldest first, and the one that is not sent yet.
#[derive(Debug, Default)]
pub(crate) struct Staged {
    under_way: VecDeque<(Event, Vec<u8>)>,
    bytes: usize,
    waiting: Option<Waiting>,
}

/// A write that what is written behind it may yet join.
#[derive(Debug)]
pub(crate) struct Waiting {
    pub(crate) mem: Mem,
    pub(crate) offset: u64,
    pub(crate) data: Vec<u8>,
}

impl Staged {
    /// Adds what is written behind the write that waits, if it is.
    pub(crate) fn join(&mut self, mem: &Mem, offset: u64, data: &[u8]) -> bool {
        let fits = |waiting: &&mut Waiting| {
            let end = waiting.offset + waiting.data.len() as u64;
            waiting.mem.as_ptr() == mem.as_ptr() && end == offset && waiting.data.len() + data.len() <= JOINED
        };
        let Some(waiting) = self.waiting.as_mut().filter(fits) else { return false };
        waiting.data.extend_from_slice(data);
        true
    }

    /// Takes a copy of what shall be written, which waits until it is sent; nothing where it is large, or too much is on its way.
    /// None may wait before.
    pub(crate) fn wait(&mut self, mem: &Mem, offset: u64, data: &[u8]) -> bool {
        while self.under_way.front().is_some_and(|(event, _)| is_done(event)) {
            self.bytes -= self.under_way.pop_front().map_or(0, |(_, copy)| copy.len());
        }
        let small = data.len() <= SMALL && self.bytes + data.len().max(JOINED) <= MOST;
        if small {
            self.waiting = Some(Waiting { mem: mem.clone(), offset, data: data.to_vec() });
        }
        small
    }

    /// What is to be sent before any other command.
    pub(crate) fn waiting(&mut self) -> Option<Waiting> {
        self.waiting.take()
    }

    /// Whether something is to be sent.
    pub(crate) fn waits(&self) -> bool {
        self.waiting.is_some()
    }

    /// Keeps a copy until its write is done.
    pub(crate) fn keep(&mut self, event: Event, copy: Vec<u8>) {
        self.bytes += copy.len();
        self.under_way.push_back((event, copy));
    }

    /// To be called when all work is done.
    pub(crate) fn clear(&mut self) {
        self.under_way.clear();
        self.bytes = 0;
    }
}

impl Drop for Staged {
    /// What a driver may still read is never freed: waiting for it may take forever.
    fn drop(&mut self) {
        for (event, copy) in self.under_way.drain(..) {
            if !is_done(&event) {
                mem::forget(copy);
            }
        }
    }
}

fn is_done(event: &Event) -> bool {
    matches!(core::event_status(event), Ok(CommandExecutionStatus::Complete))
}
