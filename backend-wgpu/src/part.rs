//! What a dispatch of a stage is on this device: of most a kernel of its own; of `sweep` kernels that share its steps.

use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::time::Duration;

use airlight_core::device::{Binding, StageTime};
use airlight_core::stage::Stage;

use crate::propagate::{IN_ORDER, PIECES};
use crate::source::sweep::Kernel as Kind;
use crate::source::{self, ABREAST, Fact, Fetched, Numbers, Place, Shape, Sums, Text, Variant, order};

/// What decides a kernel.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Key {
    pub(crate) name: &'static str,
    pub(crate) shapes: Vec<Shape>,
    pub(crate) fetched: Fetched,
    pub(crate) gathers: bool,
    pub(crate) sums: Sums,
    /// What it was built to know of the parameters, where kernels copy them.
    pub(crate) known: Option<Numbers>,
}

/// What kernels are built to know of their parameters, where that pays: integers, and which floats are zero or grey.
///
/// Mesa's software driver runs both sides of every condition; and it rebuilds kernels for uniforms that conditions depend on,
/// with every dispatch. Kernels that are built for the numbers have no such conditions. Building takes as long as many
/// dispatches, so that it is done for numbers that stand for long: until the stage has worked for a tenth of a second, or over some
/// waits, as those of frames do, or some dispatches. What had more values than a few is left a uniform until it stands for longer, and
/// the rest is built in.
#[derive(Debug, Default)]
pub(crate) struct Steady {
    waits: u64,
    habits: HashMap<Key, Habit>,
    /// How long each stage has worked, without dispatches whose kernels were being built.
    worked: HashMap<&'static str, Duration>,
    /// Stages for which kernels were built since the last wait: their times are the compiler's.
    building: HashSet<&'static str>,
}

/// A point of time of a stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Moment {
    /// Waits before.
    waits: u64,
    /// How long the stage has worked.
    worked: Duration,
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
    /// When it came to have that value.
    since: Moment,
    /// Whether it had too many values to build kernels for them.
    loose: bool,
    /// Over how many waits it has to stand to be built in again: each time for longer.
    patience: u64,
}

impl Standing {
    /// Takes note of a value; whether it has stood for long enough to be built in again.
    fn note(&mut self, fact: Fact, now: Moment) -> bool {
        if self.fact.as_ref() != Some(&fact) {
            (self.fact, self.since) = (Some(fact), now);
        }
        let stands = self.loose && self.since.waits + self.patience <= now.waits;
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
    /// When first.
    since: Moment,
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
    const MOST_PATIENCE: u64 = 32;

    fn new(places: Vec<Place>) -> Self {
        let facts = vec![
            Standing { fact: None, since: Moment::default(), loose: false, patience: Self::PATIENCE };
            places.len()
        ];
        Self { facts, places, seen: Vec::new() }
    }

    /// The numbers of a dispatch, as kernels may be built for them, with the moment since which they stand.
    fn note(&mut self, params: &[u32], now: Moment) -> Seen {
        for (n, place) in self.places.iter().enumerate() {
            if self.facts[n].note(place.fact(params), now) {
                // As if it had always had that value, but what was counted before was of others as well.
                let Standing { since, .. } = self.facts[n];
                self.seen.iter_mut().for_each(|seen| {
                    seen.numbers[n] = self.facts[n].known();
                    (seen.since, seen.times) = (seen.since.max(since), 0);
                });
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
        self.seen.push(Seen { numbers: numbers.clone(), since: now, times: 1 });
        for n in 0..numbers.len() {
            let values: HashSet<_> = self.seen.iter().map(|seen| &seen.numbers[n]).collect();
            if values.len() > Self::VALUES {
                self.facts[n].loose = true;
                self.seen.iter_mut().for_each(|seen| seen.numbers[n] = None);
                numbers[n] = None;
            }
        }
        // What is the same now stands since the first of it.
        let first = self.seen.iter().find(|seen| seen.numbers == numbers).map_or(now, |seen| seen.since);
        Seen { numbers, since: first, times: 1 }
    }
}

impl Steady {
    /// The most kernels that there may be for one to be built for numbers.
    const MOST: usize = 256;
    /// What the stage has to work while numbers stand that kernels are built for: building takes that long and more,
    const WORK: Duration = Duration::from_millis(100);
    /// or waits over which they stand,
    pub(crate) const WAITS: u64 = 32;
    /// or dispatches before.
    const TIMES: u64 = 32;

    /// Takes note that a kernel of a stage was built.
    pub(crate) fn built(&mut self, stage: &'static str) {
        self.building.insert(stage);
    }

    /// Books a wait, and the times that were told after it, if any were.
    pub(crate) fn waited(&mut self, times: &[StageTime]) {
        self.waits += 1;
        for time in times.iter().filter(|time| !self.building.contains(time.stage)) {
            *self.worked.entry(time.stage).or_default() += time.time;
        }
        self.building.clear();
    }

    /// What a kernel of `stage` had better be built to know of `params`, where so many kernels are `built`; `places` tells what it may.
    pub(crate) fn known(
        &mut self,
        (stage, key): (&'static str, &Key),
        params: &[u32],
        places: impl FnOnce() -> Vec<Place>,
        built: usize,
    ) -> Numbers {
        let habit = self.habits.entry(key.clone()).or_insert_with(|| Habit::new(places()));
        let now = Moment { waits: self.waits, worked: self.worked.get(stage).copied().unwrap_or_default() };
        let Seen { numbers, since, times } = habit.note(params, now);
        let long = since.waits + Self::WAITS <= now.waits || since.worked + Self::WORK <= now.worked;
        let stands = (long || times > Self::TIMES) && built < Self::MOST;
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

    /// What it has sums for, of `project`.
    pub(crate) fn sums(&self) -> Sums {
        match &self.kernel {
            Kernel::Stage(source) => source.sums,
            Kernel::Sweep(_) | Kernel::Order => Sums::default(),
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
        let (shapes, fetched, sums) = Default::default();
        Key { name: "a", shapes, fetched, gathers: false, sums, known: None }
    }

    /// Of each dispatch two places, of which the second is of two words.
    fn places() -> Vec<Place> {
        vec![Place::Integers(0..1), Place::Integers(2..4)]
    }

    fn known(steady: &mut Steady, params: [u32; 4]) -> Numbers {
        steady.known(("march", &key()), &params, places, 0)
    }

    fn words(words: &[u32]) -> Option<Fact> {
        Some(Fact::Words(words.to_vec()))
    }

    fn worked(steady: &mut Steady, stage: &'static str, millis: u64) {
        steady.waited(&[StageTime { stage, range: 0..1, time: Duration::from_millis(millis) }]);
    }

    #[test]
    fn kernels_are_built_for_numbers_that_stood_over_many_waits() {
        let mut steady = Steady::default();
        let nothing = vec![None, None];
        let numbers = vec![words(&[1]), words(&[2, 3])];
        for wait in 0..Steady::WAITS as u32 {
            assert_eq!(known(&mut steady, [1, wait, 2, 3]), nothing);
            steady.waited(&[]);
        }
        assert_eq!(known(&mut steady, [1, 8, 2, 3]), numbers);
        assert_eq!(known(&mut steady, [1, 8, 2, 4]), nothing);
        assert_eq!(known(&mut steady, [1, 8, 2, 3]), numbers, "another use of the same frame");
        (0..Steady::WAITS).for_each(|_| steady.waited(&[]));
        assert_eq!(known(&mut steady, [1, 8, 2, 4]), [words(&[1]), words(&[2, 4])]);
        assert_eq!(steady.known(("march", &key()), &[1, 8, 2, 3], places, Steady::MOST), nothing);
    }

    #[test]
    fn kernels_are_built_for_numbers_that_take_long() {
        let mut steady = Steady::default();
        let known = |steady: &mut Steady| known(steady, [1, 8, 2, 3])[0].is_some();
        assert!(!known(&mut steady));
        steady.built("march");
        worked(&mut steady, "march", 500);
        assert!(!known(&mut steady), "the compiler's time");
        worked(&mut steady, "march", 99);
        worked(&mut steady, "project", 500);
        assert!(!known(&mut steady), "another stage's time");
        worked(&mut steady, "march", 1);
        assert!(known(&mut steady));
    }

    #[test]
    fn kernels_are_built_for_numbers_that_come_again_and_again() {
        let mut steady = Steady::default();
        for time in 0..2 * Steady::TIMES as u32 {
            let numbers = known(&mut steady, [1, time, 2, 3]);
            assert_eq!(numbers[0].is_some(), u64::from(time) >= Steady::TIMES, "{time}");
        }
    }

    #[test]
    fn numbers_of_a_scene_that_stays_are_built_in_again() {
        let mut steady = Steady::default();
        // The frames until kernels are built.
        let mut frames = |value, count: u64| {
            let frame = |_| {
                let numbers = known(&mut steady, [value, 0, 7, 7]);
                steady.waited(&[]);
                numbers[0].is_some()
            };
            let all: Vec<_> = (0..count).map(frame).collect();
            assert!(all.is_sorted(), "{all:?}");
            all.into_iter().position(|known| known).unwrap_or(usize::MAX) as u64
        };
        // Two scenes are built for. The third is one too many until it has stayed for a while, which is less than it takes anyway.
        for scene in 1..20 {
            assert_eq!(frames(scene, 2 * Steady::WAITS), Steady::WAITS, "{scene}");
        }
    }

    #[test]
    fn numbers_that_change_with_every_frame_are_left_out() {
        let mut steady = Steady::default();
        for frame in 0..2 * Steady::WAITS as u32 {
            let numbers = known(&mut steady, [frame, 0, 7, 7]);
            assert_eq!(numbers, [None, words(&[7, 7]).filter(|_| u64::from(frame) >= Steady::WAITS)], "{frame}");
            steady.waited(&[]);
        }
    }
}
