//! What a dispatch of a stage is on this device: of most a kernel of its own; of `sweep` kernels that share its steps.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use airlight_core::device::Binding;
use airlight_core::stage::Stage;

use crate::propagate::{IN_ORDER, PIECES};
use crate::source::sweep::Kernel as Kind;
use crate::source::{self, ABREAST, Fact, Fetched, Numbers, Place, Shape, Text, Variant, order};

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
/// dispatches, so that it is done for numbers that stand over two waits, as those of a stage do that is long or comes in every
/// frame, or over a few dispatches. What had more values than a few is left a uniform until it stands for longer, and the rest is
/// built in.
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
    /// Their values.
    facts: Vec<Standing>,
    seen: Vec<Seen>,
}

/// The value of a place, and for how long it has had it.
#[derive(Clone, Debug)]
struct Standing {
    fact: Option<Fact>,
    /// The wait before it had that value.
    since: u64,
    /// Whether it had too many values to build kernels for them.
    loose: bool,
    /// Over how many waits it has to stand to be built in again: each time for longer.
    patience: u64,
}

impl Standing {
    /// Takes note of a value; whether it has stood for long enough to be built in again.
    fn note(&mut self, fact: Fact, wait: u64) -> bool {
        if self.fact.as_ref() != Some(&fact) {
            (self.fact, self.since) = (Some(fact), wait);
        }
        let stands = self.loose && self.since + self.patience <= wait;
        if stands {
            (self.loose, self.patience) = (false, Habit::MOST_PATIENCE.min(2 * self.patience));
        }
        stands
    }

    /// Its value, if kernels may be built for that.
    fn known(&self) -> Option<Fact> {
        self.fact.clone().filter(|_| !self.loose)
    }
}

/// What was dispatched.
#[derive(Clone, Debug)]
struct Seen {
    /// With nothing where it had too many values.
    numbers: Numbers,
    /// The wait before.
    since: u64,
    /// How often.
    times: u64,
}

impl Habit {
    /// The most values of a place that kernels are built for: one each of two uses in a frame.
    const VALUES: usize = 2;
    /// The most numbers that are remembered.
    const SEEN: usize = 16;
    /// Waits over which what had more values has to stand at first, as after a new scene,
    const PATIENCE: u64 = 4;
    /// and at the most.
    const MOST_PATIENCE: u64 = 64;

    fn new(places: Vec<Place>) -> Self {
        let facts = vec![Standing { fact: None, since: 0, loose: false, patience: Self::PATIENCE }; places.len()];
        Self { facts, places, seen: Vec::new() }
    }

    /// The numbers of a dispatch, as kernels may be built for them, with the wait since which they stand.
    fn note(&mut self, params: &[u32], wait: u64) -> Seen {
        for (n, place) in self.places.iter().enumerate() {
            if self.facts[n].note(place.fact(params), wait) {
                // As if it had always had that value.
                self.seen.iter_mut().for_each(|seen| seen.numbers[n] = self.facts[n].known());
            }
        }
        let mut numbers: Numbers = self.facts.iter().map(Standing::known).collect();
        if let Some(known) = self.seen.iter_mut().find(|seen| seen.numbers == numbers) {
            known.times += 1;
            return known.clone();
        }
        if self.seen.len() >= Self::SEEN {
            self.seen.remove(0);
        }
        self.seen.push(Seen { numbers: numbers.clone(), since: wait, times: 1 });
        for n in 0..numbers.len() {
            let values: HashSet<_> = self.seen.iter().map(|seen| &seen.numbers[n]).collect();
            if values.len() > Self::VALUES {
                self.facts[n].loose = true;
                self.seen.iter_mut().for_each(|seen| seen.numbers[n] = None);
                numbers[n] = None;
            }
        }
        // What is the same now stands since the first of it.
        let first = self.seen.iter().find(|seen| seen.numbers == numbers).map_or(wait, |seen| seen.since);
        Seen { numbers, since: first, times: 1 }
    }
}

impl Steady {
    /// The most kernels that there may be for one to be built for numbers.
    const MOST: usize = 256;
    /// Waits over which numbers stand that kernels are built for,
    const WAITS: u64 = 2;
    /// or dispatches before.
    const TIMES: u64 = 3;

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
        let Seen { numbers, since, times } = habit.note(params, self.waits);
        let stands = (since + Self::WAITS <= self.waits || times > Self::TIMES) && built < Self::MOST;
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
    kernel: Kernel,
}

/// A stage's own kernel, one of those that `sweep` is put together from, or the one that orders the cells of `project`.
#[derive(Debug)]
enum Kernel {
    Stage(source::Source),
    Sweep(Kind),
    Order,
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
            kernel: Kernel::Stage(source),
        }
    }

    /// A kernel that `sweep` is put together from, of so many `items` in each of its steps `range`.
    pub(crate) fn of_sweep(kernel: Kind, bindings: Vec<Binding>, range: Range<u32>, items: u32) -> Self {
        Self {
            name: kernel.name(),
            bindings,
            axis: range.end,
            group: 1,
            range,
            sequential: Some(items),
            steps: None,
            gathers: false,
            kernel: Kernel::Sweep(kernel),
        }
    }

    /// The kernel that orders the units `range` of `project`.
    pub(crate) fn of_order(bindings: Vec<Binding>, range: Range<u32>) -> Self {
        Self {
            name: order::NAME,
            bindings,
            axis: range.end,
            group: 1,
            range,
            sequential: None,
            steps: None,
            gathers: false,
            kernel: Kernel::Order,
        }
    }

    /// Whether a workgroup takes steps of the stage in order, one after the other.
    fn in_order(&self) -> bool {
        self.name == IN_ORDER || matches!(self.kernel, Kernel::Sweep(Kind::Rows))
    }

    /// Invocations of a workgroup, where those are so many that work alone.
    pub(crate) fn invocations(&self, units: u32) -> u32 {
        if self.in_order() { ABREAST } else { units }
    }

    /// Units of the work axis, or items of a unit, that a workgroup takes, of so many invocations where those work alone; `known` is
    /// whether kernels know their parameters.
    pub(crate) fn taken(&self, units: u32, known: bool, fetched: Fetched) -> u32 {
        match &self.kernel {
            _ if self.in_order() => 1,
            Kernel::Stage(source) => source.taken(units, known) * self.aligned(fetched),
            Kernel::Sweep(_) => units,
            // One workgroup.
            Kernel::Order => u32::MAX,
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
            Kernel::Sweep(Kind::Scatter) => &["sources"],
            Kernel::Sweep(_) | Kernel::Order => &[],
        }
    }

    /// The buffer of floats that it reads and writes more often than it is worth to copy.
    pub(crate) fn held(&self) -> Option<&'static str> {
        match &self.kernel {
            Kernel::Stage(source) if self.name != PIECES => source.rewritten,
            _ => None,
        }
    }

    /// Whether it looks the field of that name up between texels.
    pub(crate) fn interpolates(&self, field: &str) -> bool {
        match &self.kernel {
            Kernel::Stage(source) => source.interpolates(field),
            Kernel::Sweep(_) | Kernel::Order => false,
        }
    }

    /// Buffers of floats that may be written two at once.
    pub(crate) fn pairs(&self) -> &'static [&'static str] {
        match &self.kernel {
            Kernel::Stage(source) => source.pairs(),
            Kernel::Sweep(_) | Kernel::Order => &[],
        }
    }

    /// What the kernel may know of the parameters.
    pub(crate) fn places(&self) -> Vec<Place> {
        match &self.kernel {
            Kernel::Stage(source) => source.places(),
            Kernel::Sweep(kernel) => kernel.places(),
            Kernel::Order => order::known_places(),
        }
    }

    /// The kernel's text.
    pub(crate) fn text(&self, shapes: &[Shape], variant: Variant<'_>) -> Text {
        match &self.kernel {
            Kernel::Stage(source) => source.text(shapes, variant),
            Kernel::Sweep(kernel) => kernel.text(shapes, variant),
            Kernel::Order => order::text(shapes, variant),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn kernels_are_built_for_numbers_that_come_again_and_again() {
        let mut steady = Steady::default();
        for time in 0..6 {
            let numbers = known(&mut steady, [1, time, 2, 3]);
            assert_eq!(numbers[0].is_some(), time >= 3, "{time}");
        }
    }

    #[test]
    fn numbers_of_a_scene_that_stays_are_built_in_again() {
        let mut steady = Steady::default();
        let mut frames = |value, count| -> Vec<bool> {
            let frame = |_| {
                let numbers = known(&mut steady, [value, 0, 7, 7]);
                steady.waited();
                numbers[0].is_some()
            };
            (0..count).map(frame).collect()
        };
        // Two scenes are built for, the third is one too many until it has stayed for a while, the next for twice as long.
        assert_eq!(frames(1, 3), [false, false, true]);
        assert_eq!(frames(2, 3), [false, false, true]);
        assert_eq!(frames(3, 6), [false, false, false, false, true, true]);
        assert_eq!(frames(4, 3), [false, false, true]);
        let next = frames(5, 10);
        assert_eq!(next.iter().position(|known| *known), Some(8), "{next:?}");
    }

    #[test]
    fn numbers_that_change_with_every_frame_are_left_out() {
        let mut steady = Steady::default();
        for frame in 0..9 {
            let numbers = known(&mut steady, [frame, 0, 7, 7]);
            assert_eq!(numbers, [None, words(&[7, 7]).filter(|_| frame >= 2)], "{frame}");
            steady.waited();
        }
    }
}
