//! What is on its way to the device, whose memory the host keeps meanwhile.

use std::collections::VecDeque;
use std::mem;

use ocl::core::{self, CommandExecutionStatus, Event};

/// Bytes of a write that is worth a copy, so that nobody waits for it: what is larger takes longer than waiting does.
const SMALL: usize = 1 << 20;

/// Bytes that are on their way at the most.
const MOST: usize = 16 << 20;

/// Copies of what is being written, oldest first.
#[derive(Debug, Default)]
pub(crate) struct Staged {
    under_way: VecDeque<(Event, Vec<u8>)>,
    bytes: usize,
}

impl Staged {
    /// A copy of what shall be written without waiting; none where it is large, or too much is on its way.
    pub(crate) fn copy(&mut self, data: &[u8]) -> Option<Vec<u8>> {
        while self.under_way.front().is_some_and(|(event, _)| is_done(event)) {
            self.bytes -= self.under_way.pop_front().map_or(0, |(_, copy)| copy.len());
        }
        (data.len() <= SMALL && self.bytes + data.len() <= MOST).then(|| data.to_vec())
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
