//! What a dispatch of a stage is on this device: of most a kernel of its own; of `sweep` kernels that share its steps.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use airlight_core::device::{Binding, BindingAccess, Buf, DeviceError, ResourceId, ResourceSpec, Usage};
use airlight_core::stage::{Kernel as _, Stage, Sweep, SweepParams};

use crate::WgpuDevice;
use crate::memory::Resource;
use crate::source::sweep::{ABREAST, Kernel as Kind};
use crate::source::{self, Fetched, Numbers, Place, Shape, Text, Variant};
use crate::texels;

/// Memory of our own, for what kernels of a stage hand to each other. Executors count ids from 0.
const SCRATCH: ResourceId = ResourceId(u32::MAX);

/// What decides a kernel.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Key {
    pub(crate) name: &'static str,
    pub(crate) shapes: Vec<Shape>,
    pub(crate) fetched: Fetched,
    pub(crate) gathers: bool,
    /// What it was built to know of the parameters, where kernels copy them.
    pub(crate) known: Option<Numbers>,
}

/// What kernels are built to know of their parameters, where that pays: integers, and which floats are zero or grey.
///
/// Mesa's software driver runs both sides of every condition; and it rebuilds kernels for uniforms that conditions depend on,
/// with every dispatch. Kernels that are built for the numbers have no such conditions. Building takes as long as many
/// dispatches, so that it is done for numbers that stand over two waits: not in a first frame, which waits to learn how long
/// each stage takes. What had more values than a few is left a uniform for good, and the rest is built in.
#[derive(Debug, Default)]
pub(crate) struct Steady {
    /// Waits so far.
    waits: u64,
    habits: HashMap<Key, Habit>,
}

/// The parameters of a kernel's dispatches.
#[derive(Debug)]
struct Habit {
    /// What kernels may know.
    places: Vec<Place>,
    /// What was dispatched, with nothing where it had too many values, and the wait before.
    seen: Vec<(Numbers, u64)>,
    loose: Vec<bool>,
}

impl Habit {
    /// The most values of a place that kernels are built for: one each of two uses in a frame.
    const VALUES: usize = 2;
    /// The most numbers that are remembered.
    const SEEN: usize = 16;

    fn new(places: Vec<Place>) -> Self {
        Self { loose: vec![false; places.len()], places, seen: Vec::new() }
    }

    /// The numbers of a dispatch, as kernels may be built for them, and the wait since which they stand.
    fn note(&mut self, params: &[u32], wait: u64) -> (Numbers, u64) {
        let values = self.places.iter().zip(&self.loose);
        let mut numbers: Numbers = values.map(|(place, loose)| (!loose).then(|| place.fact(params))).collect();
        if let Some(known) = self.seen.iter().find(|(seen, _)| *seen == numbers) {
            return known.clone();
        }
        if self.seen.len() >= Self::SEEN {
            self.seen.remove(0);
        }
        self.seen.push((numbers.clone(), wait));
        for n in 0..numbers.len() {
            let values: HashSet<_> = self.seen.iter().map(|(seen, _)| &seen[n]).collect();
            if values.len() > Self::VALUES {
                self.loose[n] = true;
                self.seen.iter_mut().for_each(|(seen, _)| seen[n] = None);
                numbers[n] = None;
            }
        }
        // What is the same now stands since the first of it.
        let first = self.seen.iter().find(|(seen, _)| *seen == numbers).map_or(wait, |(_, since)| *since);
        (numbers, first)
    }
}

impl Steady {
    /// The most kernels that there may be for one to be built for numbers.
    const MOST: usize = 256;
    /// Waits over which numbers stand that kernels are built for.
    const WAITS: u64 = 2;

    /// Books a wait.
    pub(crate) fn waited(&mut self) {
        self.waits += 1;
    }

    /// What a kernel had better be built to know of `params`, where so many kernels are `built`; `places` tells what it may.
    pub(crate) fn known(
        &mut self,
        key: &Key,
        params: &[u32],
        places: impl FnOnce() -> Vec<Place>,
        built: usize,
    ) -> Numbers {
        let habit = self.habits.entry(key.clone()).or_insert_with(|| Habit::new(places()));
        let (numbers, since) = habit.note(params, self.waits);
        let stands = since + Self::WAITS <= self.waits && built < Self::MOST;
        if stands { numbers } else { vec![None; numbers.len()] }
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
    /// Where units run in order, one a dispatch: the items of a unit.
    pub(crate) sequential: Option<u32>,
    /// In place of the groups of the buffers that are bound in parts: steps of the stage that a workgroup takes in order, or the
    /// first direction of a batch.
    pub(crate) steps: Option<Range<u32>>,
    pub(crate) gathers: bool,
    /// What it writes as a storage texture, on drivers that read those.
    pub(crate) holds: Option<&'static str>,
    kernel: Kernel,
}

/// A stage's own kernel, or one of those that `sweep` is put together from.
#[derive(Debug)]
enum Kernel {
    Stage(source::Source),
    Sweep(Kind),
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
            sequential: stage.sequential(),
            steps: None,
            gathers: false,
            holds: None,
            kernel: Kernel::Stage(source),
        }
    }

    /// A kernel that `sweep` is put together from, of so many `items` in each of its steps `range`.
    fn of_sweep(
        kernel: Kind,
        bindings: Vec<Binding>,
        holds: Option<&'static str>,
        (range, items): (Range<u32>, u32),
    ) -> Self {
        Self {
            name: kernel.name(),
            bindings,
            axis: range.end,
            group: 1,
            range,
            sequential: Some(items),
            steps: None,
            gathers: false,
            holds,
            kernel: Kernel::Sweep(kernel),
        }
    }

    /// Units of the work axis, or items of a unit, that a workgroup takes, of so many invocations where those work alone; `known` is
    /// whether kernels know their parameters.
    pub(crate) fn taken(&self, units: u32, known: bool, fetched: Fetched) -> u32 {
        match &self.kernel {
            Kernel::Stage(source) => source.taken(units, known) * self.aligned(fetched),
            Kernel::Sweep(Kind::Rows) => 1,
            Kernel::Sweep(Kind::Toward | Kind::Moments) => units,
        }
    }

    /// What the first unit that an invocation takes is a multiple of, and how many it takes: those of a texel.
    pub(crate) fn aligned(&self, fetched: Fetched) -> u32 {
        let Kernel::Stage(source) = &self.kernel else { return 1 };
        let index = self.bindings.iter().position(|binding| Some(binding.name) == source.by_texels());
        if index.is_some_and(|index| fetched.has_fours(index)) { 4 } else { 1 }
    }

    /// Buffers of words that it reads by four that follow each other.
    pub(crate) fn fours(&self) -> &'static [&'static str] {
        match &self.kernel {
            Kernel::Stage(source) => source.fours,
            Kernel::Sweep(Kind::Toward) => &["sources"],
            Kernel::Sweep(Kind::Rows | Kind::Moments) => &[],
        }
    }

    /// Buffers of floats that may be written two at once.
    pub(crate) fn pairs(&self) -> &'static [&'static str] {
        match &self.kernel {
            Kernel::Stage(source) => source.pairs(),
            Kernel::Sweep(_) => &[],
        }
    }

    /// What the kernel may know of the parameters.
    pub(crate) fn places(&self) -> Vec<Place> {
        match &self.kernel {
            Kernel::Stage(source) => source.places(),
            Kernel::Sweep(kernel) => kernel.places(),
        }
    }

    /// The kernel's text.
    pub(crate) fn text(&self, shapes: &[Shape], variant: Variant<'_>) -> Text {
        match &self.kernel {
            Kernel::Stage(source) => source.text(shapes, variant),
            Kernel::Sweep(kernel) => kernel.text(shapes, variant),
        }
    }
}

/// Textures that a sweep's planes read: all of its bindings.
const SWEEP_TEXTURES: u32 = 5;

/// What cells scatter toward a batch of directions, in memory of our own.
fn toward(p: &SweepParams) -> Buf<f32> {
    Buf::new(SCRATCH, u64::from(p.batch) * u64::from(p.channels) * u64::from(p.count()))
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
        let toward = toward(p);
        let sources = sweep.sources.zip(sweep.source_weights);
        if sources.is_some() {
            self.reserve_scratch(toward.bytes())?;
        }
        let held = self.texels && self.holds(sweep, toward.bytes());
        let (steps, planes) = (p.batch_steps(), p.cells[3]);
        let fours = p.count().div_ceil(4);
        let most = self.planes_at_once(p);
        let optics = Binding::read("optics", Some(sweep.optics));
        let mut parts = Vec::new();
        let mut next = range.start;
        while next < range.end {
            let batch = next / steps;
            let gather = batch * steps + planes;
            let (begin, end) = (next, range.end.min(gather));
            let first = batch * p.batch;
            let taken = p.batch.min(p.directions - first);
            if begin < end {
                if let Some((sources, weights)) = sources {
                    let items = taken.div_ceil(4) * fours;
                    let bindings = vec![
                        optics,
                        Binding::read("sources", Some(sources)),
                        Binding::read("source_weights", Some(weights)),
                        Binding::write("toward", Some(toward)),
                    ];
                    let part = Part::of_sweep(Kind::Toward, bindings, None, (0..1, items));
                    parts.push(Part { steps: Some(first..first + taken), ..part });
                }
                if held {
                    let bindings = vec![
                        optics,
                        Binding::read("directions", Some(sweep.directions)),
                        Binding::read("toward", sources.map(|_| toward)),
                        Binding::read("obstructed", sweep.obstructed),
                        Binding::write("radiance", Some(sweep.radiance)),
                    ];
                    for step in (begin..end).step_by(most as usize) {
                        let part = Part::of_sweep(Kind::Rows, bindings.clone(), Some("radiance"), (0..taken, 0));
                        let steps = Some(step..end.min(step + most));
                        parts.push(Part { steps, sequential: None, ..part });
                    }
                } else {
                    let mut part = Part { range: begin..end, ..Part::of(stage, range.clone()) };
                    let places = part.bindings.iter_mut().filter(|binding| binding.name == "sources");
                    places.for_each(|binding| *binding = Binding::read("sources", sources.map(|_| toward)));
                    part.sequential = Some(p.batch * p.plane);
                    parts.push(part);
                }
            }
            if gather < range.end {
                let (step, of_four) = (gather..gather + 1, p.coefficients.div_ceil(4));
                if held {
                    let bindings = vec![
                        Binding::read("weights", Some(sweep.weights)),
                        Binding::read("radiance", Some(sweep.radiance)),
                        Binding::write("moments", Some(sweep.moments)),
                    ];
                    parts.push(Part::of_sweep(
                        Kind::Moments,
                        bindings,
                        None,
                        (step, p.count().div_ceil(8).next_multiple_of(self.units) * of_four),
                    ));
                } else {
                    let sequential = Some(p.count() * of_four);
                    parts.push(Part { gathers: true, sequential, ..Part::of(stage, step) });
                }
            }
            next = gather + 1;
        }
        Ok(parts)
    }

    /// Planes of a direction that a workgroup may take one after the other, by how often its loops turn: once more than they
    /// have to, which is when they end.
    fn planes_at_once(&self, p: &SweepParams) -> u32 {
        let items = u64::from(p.plane / 8 + p.cells[3] + 1).div_ceil(ABREAST.into());
        let turns = 1 + (items + 1) * (2 + u64::from(p.channels));
        let most = self.info.limits.loop_turns.map_or(u64::MAX, |turns| turns.saturating_sub(1).into()) / turns;
        most.try_into().unwrap_or(u32::MAX)
    }

    /// Bytes of the memory of our own that a sweep takes, and of the textures that its radiance and that lie in.
    pub(crate) fn sweep_scratch(&self, sweep: &Sweep) -> u64 {
        let toward = toward(&sweep.params).bytes();
        let own = if sweep.sources.is_some() { toward } else { 0 };
        own + if self.texels && self.holds(sweep, toward) { own + sweep.radiance.bytes() } else { 0 }
    }

    /// Whether a sweep's radiance, and what its cells scatter toward a batch of directions, fit textures, of which there are enough,
    /// all else a binding, and a plane the turns of loops.
    fn holds(&self, sweep: &Sweep, toward: u64) -> bool {
        let bytes = |binding: Binding| match binding.access {
            BindingAccess::Read(bytes) | BindingAccess::Write(bytes) => bytes,
            BindingAccess::Sample(_) => 0,
        };
        let most = sweep.bindings().into_iter().map(bytes).fold(toward, u64::max);
        let whole = most <= self.info.limits.binding_bytes && self.planes_at_once(&sweep.params) > 0;
        let textures = self.limits.max_storage_textures_per_shader_stage >= SWEEP_TEXTURES;
        whole && textures && [sweep.radiance.bytes(), toward].iter().all(|&bytes| texels::fits(bytes, 1, &self.limits))
    }

    /// Makes the memory of our own hold so many bytes at least.
    fn reserve_scratch(&mut self, bytes: u64) -> Result<(), DeviceError> {
        if self.store.buffer(SCRATCH).is_ok_and(|memory| memory.bytes >= bytes) {
            return Ok(());
        }
        self.remove(SCRATCH);
        let spec = ResourceSpec::Buffer { bytes, usage: Usage::Work };
        self.store.add(SCRATCH, || Resource::new(&self.gpu, &spec, &self.info.limits))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::Fact;

    fn key() -> Key {
        Key { name: "a", shapes: Vec::new(), fetched: Fetched::default(), gathers: false, known: None }
    }

    /// Of each dispatch two places, of which the second is of two words.
    fn places() -> Vec<Place> {
        vec![Place::Integers(0..1), Place::Integers(2..4)]
    }

    fn known(steady: &mut Steady, params: [u32; 4]) -> Numbers {
        steady.known(&key(), &params, places, 0)
    }

    fn words(words: &[u32]) -> Option<Fact> {
        Some(Fact::Words(words.to_vec()))
    }

    #[test]
    fn kernels_are_built_for_numbers_that_stood_over_two_waits() {
        let mut steady = Steady::default();
        let nothing = vec![None, None];
        let numbers = vec![words(&[1]), words(&[2, 3])];
        assert_eq!(known(&mut steady, [1, 8, 2, 3]), nothing);
        steady.waited();
        assert_eq!(known(&mut steady, [1, 9, 2, 3]), nothing, "the rest of a first frame");
        steady.waited();
        assert_eq!(known(&mut steady, [1, 8, 2, 3]), numbers);
        assert_eq!(known(&mut steady, [1, 8, 2, 4]), nothing);
        assert_eq!(known(&mut steady, [1, 8, 2, 3]), numbers, "another use of the same frame");
        (0..2).for_each(|_| steady.waited());
        assert_eq!(known(&mut steady, [1, 8, 2, 4]), [words(&[1]), words(&[2, 4])]);
        assert_eq!(steady.known(&key(), &[1, 8, 2, 3], places, Steady::MOST), nothing);
    }

    #[test]
    fn numbers_that_change_with_every_frame_are_left_out_for_good() {
        let mut steady = Steady::default();
        for frame in 0..9 {
            let numbers = known(&mut steady, [frame, 0, 7, 7]);
            assert_eq!(numbers, [None, words(&[7, 7]).filter(|_| frame >= 2)], "{frame}");
            steady.waited();
        }
    }
}
