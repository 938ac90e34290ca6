//! Times of dispatches: the device's own time stamps where it has them, else shares of the time waited.

use std::ops::Range;
use std::time::{Duration, Instant};

use airlight_core::device::{DeviceError, StageTime};
use wgpu::{Buffer, BufferUsages, QuerySet};

use crate::gpu::Gpu;

/// Dispatches of one set of queries.
const SET: u32 = 256;
/// Bytes of their time stamps.
const SET_BYTES: u64 = SET as u64 * 16;

/// Times of the dispatches since the last time they were asked for.
#[derive(Debug, Default)]
pub(crate) struct Clock {
    /// Nanoseconds of a tick, where the device has time stamps.
    tick: Option<f64>,
    sets: Vec<QuerySet>,
    /// The time stamps of all sets.
    stamps: Option<Buffer>,
    /// Query sets are used up to this dispatch.
    stamped: u32,
    dispatches: Vec<Dispatched>,
    began: Option<Instant>,
}

#[derive(Debug)]
struct Dispatched {
    stage: &'static str,
    range: Range<u32>,
    /// Where its two time stamps stand.
    stamp: Option<u32>,
}

impl Clock {
    /// A clock of a device whose time stamps, if it has them, come every so many nanoseconds.
    pub(crate) fn new(tick: Option<f64>) -> Self {
        Self { tick, ..Self::default() }
    }

    /// Books a dispatch that does nothing.
    pub(crate) fn idle(&mut self, stage: &'static str, range: Range<u32>) {
        self.dispatches.push(Dispatched { stage, range, stamp: None });
    }

    /// Books a dispatch, and gives the set of queries and the number in it of the first of its two time stamps.
    pub(crate) fn start(
        &mut self,
        gpu: &Gpu,
        stage: &'static str,
        range: Range<u32>,
    ) -> Result<Option<(&QuerySet, u32)>, DeviceError> {
        self.began.get_or_insert_with(Instant::now);
        if self.tick.is_none() {
            self.dispatches.push(Dispatched { stage, range, stamp: None });
            return Ok(None);
        }
        let set = (self.stamped / SET) as usize;
        if set == self.sets.len() {
            let description =
                wgpu::QuerySetDescriptor { label: Some("times"), ty: wgpu::QueryType::Timestamp, count: 2 * SET };
            let queries = gpu.guarded(0, || gpu.device.create_query_set(&description))?;
            let usage = BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC;
            self.stamps = Some(gpu.buffer("times", (set as u64 + 1) * SET_BYTES, usage)?);
            self.sets.push(queries);
        }
        self.dispatches.push(Dispatched { stage, range, stamp: Some(self.stamped) });
        let place = self.stamped % SET * 2;
        self.stamped += 1;
        Ok(Some((&self.sets[set], place)))
    }

    /// Forgets the last dispatch that was booked.
    pub(crate) fn take_back(&mut self) {
        if let Some(Dispatched { stamp: Some(stamp), .. }) = self.dispatches.pop() {
            self.stamped = stamp;
        }
    }

    /// Forgets every dispatch.
    pub(crate) fn forget(&mut self) {
        self.dispatches.clear();
        (self.began, self.stamped) = (None, 0);
    }

    /// Waits for all work, and gives the time of each dispatch in order.
    pub(crate) fn finish(&mut self, gpu: &mut Gpu) -> Result<Vec<StageTime>, DeviceError> {
        let dispatches = std::mem::take(&mut self.dispatches);
        let began = self.began.take();
        let stamped = std::mem::take(&mut self.stamped);
        // Lavapipe takes the copy of time stamps only when what they stand behind is done.
        gpu.wait_with_patience()?;
        let mut stamps = vec![0u64; 2 * stamped as usize];
        match &self.stamps {
            Some(buffer) if stamped > 0 => {
                let sets = self.sets.iter().zip(stamps.chunks(2 * SET as usize)).zip(0..);
                for ((queries, stamps), set) in sets {
                    gpu.copies()?.resolve_query_set(queries, 0..stamps.len() as u32, buffer, set * SET_BYTES);
                }
                gpu.read(buffer, 0, bytemuck::cast_slice_mut(&mut stamps))?;
            }
            _ => gpu.wait()?,
        }
        let Some(tick) = self.tick else {
            let waited = began.map_or(Duration::ZERO, |began| began.elapsed());
            return Ok(share(dispatches, waited));
        };
        let time = |stamp: Option<u32>| {
            let ticks = stamp.map_or(0, |at| stamps[2 * at as usize + 1].saturating_sub(stamps[2 * at as usize]));
            Duration::from_nanos((ticks as f64 * tick) as u64)
        };
        Ok(dispatches.into_iter().map(|d| StageTime { stage: d.stage, time: time(d.stamp), range: d.range }).collect())
    }
}

/// Shares of the time waited, in proportion to the units of work.
fn share(dispatches: Vec<Dispatched>, waited: Duration) -> Vec<StageTime> {
    let units = |range: &Range<u32>| range.len() as f64;
    let all: f64 = dispatches.iter().map(|d| units(&d.range)).sum();
    let time = |range: &Range<u32>| waited.mul_f64(units(range) / all.max(1.0));
    dispatches.into_iter().map(|d| StageTime { stage: d.stage, time: time(&d.range), range: d.range }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_time_stamps_the_time_waited_is_shared_by_units() {
        let dispatched = |stage, range| Dispatched { stage, range, stamp: None };
        let times = share(
            vec![dispatched("a", 0..10), dispatched("b", 10..40), dispatched("a", 3..3)],
            Duration::from_millis(8),
        );
        let millis: Vec<_> = times.iter().map(|t| t.time.as_millis()).collect();
        assert_eq!(millis, [2, 6, 0]);
        assert!(share(Vec::new(), Duration::ZERO).is_empty());
        assert_eq!(share(vec![dispatched("a", 1..1)], Duration::ZERO)[0].time, Duration::ZERO);
    }
}
