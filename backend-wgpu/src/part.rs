//! What a dispatch of a stage is on this device: of most a kernel of its own; of `sweep` kernels that share its steps.

use std::collections::HashMap;
use std::ops::Range;

use airlight_core::device::{Binding, Buf, DeviceError, ResourceId, ResourceSpec, Usage};
use airlight_core::stage::{Stage, Sweep};

use crate::WgpuDevice;
use crate::memory::Resource;
use crate::source::{self, Fetched, Shape, Text, Variant};

/// Memory of our own, for what kernels of a stage hand to each other. Executors count ids from 0.
const SCRATCH: ResourceId = ResourceId(u32::MAX);
/// Coefficients that an invocation of `sweep` adds.
const GATHERED: u32 = 4;

/// What decides a kernel.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Key {
    pub(crate) name: &'static str,
    pub(crate) shapes: Vec<Shape>,
    pub(crate) fetched: Fetched,
    pub(crate) gathers: bool,
    /// Integers of the parameters that it was built for.
    pub(crate) known: Option<Vec<u32>>,
}

/// Which kernels are built for the integers of their parameters, where that pays.
///
/// Mesa's software driver runs both sides of every condition; and it rebuilds kernels for uniforms that conditions depend on,
/// with every dispatch. Kernels that are built for the numbers have no such conditions. Building takes as long as many
/// dispatches, so that it is done for numbers that stood since before the last wait.
#[derive(Debug, Default)]
pub(crate) struct Steady {
    /// Waits so far.
    waits: u64,
    /// Of each kernel the numbers of its last dispatch, and the wait since which they stand.
    last: HashMap<Key, (Vec<u32>, u64)>,
}

impl Steady {
    /// The most kernels that there may be for one to be built for numbers.
    const MOST: usize = 256;

    /// Books a wait.
    pub(crate) fn waited(&mut self) {
        self.waits += 1;
    }

    /// Whether a kernel had better be built for these numbers, where so many kernels are `built`.
    pub(crate) fn is(&mut self, key: &Key, numbers: &[u32], built: usize) -> bool {
        match self.last.get_mut(key) {
            Some((last, since)) if last == numbers => *since < self.waits && built < Self::MOST,
            Some(last) => {
                *last = (numbers.to_vec(), self.waits);
                false
            }
            None => {
                self.last.insert(key.clone(), (numbers.to_vec(), self.waits));
                false
            }
        }
    }
}

/// A part of a dispatch that one kernel runs.
#[derive(Debug)]
pub(crate) struct Part {
    /// Name of the entry point.
    pub(crate) name: &'static str,
    pub(crate) bindings: Vec<Binding>,
    pub(crate) axis: u32,
    pub(crate) group: u32,
    pub(crate) range: Range<u32>,
    /// Units that a workgroup takes, or items of a unit.
    pub(crate) units: u32,
    /// Where units run in order, one a dispatch: the items of a unit.
    pub(crate) sequential: Option<u32>,
    /// In place of the first group of the buffers that are bound in parts.
    pub(crate) first: Option<u32>,
    pub(crate) gathers: bool,
    /// None for `sources_toward`.
    source: Option<source::Source>,
}

impl Part {
    /// All of a stage's range.
    pub(crate) fn of(stage: &Stage, range: Range<u32>) -> Self {
        let source = source::of(stage);
        Self {
            name: source.name,
            bindings: stage.bindings(),
            axis: stage.axis(),
            group: stage.group(),
            range,
            units: source.units,
            sequential: stage.sequential(),
            first: None,
            gathers: false,
            source: Some(source),
        }
    }

    /// The integers of the parameters.
    pub(crate) fn numbers(&self, params: &[u8]) -> Vec<u32> {
        let words: &[u32] = bytemuck::cast_slice(params);
        source::integers(self.source.as_ref()).into_iter().flat_map(|at| &words[at]).copied().collect()
    }

    /// The kernel's text.
    pub(crate) fn text(&self, shapes: &[Shape], variant: Variant<'_>) -> Text {
        match &self.source {
            Some(source) => source.text(shapes, variant),
            None => source::sources_text(shapes, variant),
        }
    }
}

impl WgpuDevice {
    /// The parts of a range of `sweep`: for each batch its sources, its planes, and its moments.
    pub(crate) fn sweep_parts(
        &mut self,
        stage: &Stage,
        sweep: &Sweep,
        range: Range<u32>,
    ) -> Result<Vec<Part>, DeviceError> {
        let p = &sweep.params;
        let toward: Buf<f32> = Buf::new(SCRATCH, u64::from(p.batch) * u64::from(p.channels) * u64::from(p.count()));
        if sweep.sources.is_some() {
            self.reserve_scratch(toward.bytes())?;
        }
        let (steps, planes) = (p.batch_steps(), p.cells[3]);
        let mut parts = Vec::new();
        let mut next = range.start;
        while next < range.end {
            let batch = next / steps;
            let gather = batch * steps + planes;
            let (begin, end) = (next, range.end.min(gather));
            if begin < end {
                let mut part = Part { range: begin..end, ..Part::of(stage, range.clone()) };
                if let (Some(sources), Some(weights)) = (sweep.sources, sweep.source_weights) {
                    let first = batch * p.batch;
                    let items = p.batch.min(p.directions - first) * p.count();
                    let bindings = vec![
                        Binding::read("optics", Some(sweep.optics)),
                        Binding::read("sources", Some(sources)),
                        Binding::read("source_weights", Some(weights)),
                        Binding::write("toward", Some(toward)),
                    ];
                    parts.push(Part {
                        name: "sources_toward",
                        bindings,
                        axis: items,
                        group: 1,
                        range: 0..items,
                        sequential: None,
                        units: 64,
                        first: Some(first),
                        gathers: false,
                        source: None,
                    });
                    let places = part.bindings.iter_mut().filter(|binding| binding.name == "sources");
                    places.for_each(|binding| *binding = Binding::read("sources", Some(toward)));
                }
                part.sequential = Some(p.batch * p.plane);
                parts.push(part);
            }
            if gather < range.end {
                let items = p.count() * p.coefficients.div_ceil(GATHERED);
                let range = gather..gather + 1;
                parts.push(Part { gathers: true, sequential: Some(items), ..Part::of(stage, range) });
            }
            next = gather + 1;
        }
        Ok(parts)
    }

    /// Makes the memory of our own hold so many bytes at least.
    fn reserve_scratch(&mut self, bytes: u64) -> Result<(), DeviceError> {
        if self.store.buffer(SCRATCH).is_ok_and(|memory| memory.bytes >= bytes) {
            return Ok(());
        }
        self.store.remove(SCRATCH);
        let spec = ResourceSpec::Buffer { bytes, usage: Usage::Work };
        self.store.add(SCRATCH, || Resource::new(&self.gpu, &spec, &self.info.limits))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_stood_since_before_the_last_wait_are_steady() {
        let key = Key { name: "a", shapes: Vec::new(), fetched: Fetched::default(), gathers: false, known: None };
        let mut steady = Steady::default();
        assert!(!steady.is(&key, &[1, 2], 0));
        assert!(!steady.is(&key, &[1, 2], 0), "a piece of the same dispatch");
        steady.waited();
        assert!(steady.is(&key, &[1, 2], 0));
        assert!(!steady.is(&key, &[1, 2], Steady::MOST));
        assert!(!steady.is(&key, &[1, 3], 0));
        assert!(!steady.is(&key, &[1, 2], 0));
        steady.waited();
        assert!(steady.is(&key, &[1, 2], 0));
    }
}
