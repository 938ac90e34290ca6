//! Times of dispatches, by the device's own clock.

use std::ops::Range;
use std::time::Duration;

use airlight_core::device::{DeviceError, StageTime};
use ocl::core::Event;

use crate::cl::Cl;

/// The dispatches since the last time they were asked for.
#[derive(Debug, Default)]
pub(crate) struct Clock {
    dispatches: Vec<Dispatched>,
}

#[derive(Debug)]
struct Dispatched {
    stage: &'static str,
    range: Range<u32>,
    /// The kernel's runs; none where there was nothing to run.
    events: Vec<Event>,
}

impl Clock {
    /// Books a dispatch.
    pub(crate) fn book(&mut self, stage: &'static str, range: Range<u32>, events: Vec<Event>) {
        self.dispatches.push(Dispatched { stage, range, events });
    }

    /// Waits for all work, and gives the time of each dispatch in order.
    pub(crate) fn finish(&mut self, cl: &mut Cl) -> Result<Vec<StageTime>, DeviceError> {
        let dispatches = std::mem::take(&mut self.dispatches);
        cl.finish()?;
        let time = |d: Dispatched| {
            let nanos = d.events.iter().try_fold(0, |sum, event| cl.time(event).map(|time| sum + time))?;
            Ok(StageTime { stage: d.stage, range: d.range, time: Duration::from_nanos(nanos) })
        };
        dispatches.into_iter().map(time).collect()
    }
}
