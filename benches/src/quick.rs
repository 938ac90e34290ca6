//! The benchmarks in a few seconds: medians of a few runs in place of criterion's statistics.

use std::time::{Duration, Instant};

use airlight::Renderer;
use airlight::device::Device;
use airlight::stage::Stage;

use crate::{Frame, Lookups, Rig, STAGES, View, density, lattice, scene, settled};

/// What ends a measurement.
pub type Fault = Box<dyn std::error::Error>;

/// What was measured, and how long a run takes.
#[derive(Clone, Debug, PartialEq)]
pub struct Timing {
    /// The name among criterion's groups, such as `stage/march`. `prepare/compile` is of this run alone: what the first
    /// run of each stage on a fresh device takes beyond a later one, added up.
    pub name: String,
    /// What each run took, from the fastest to the slowest; at least one.
    runs: Vec<Duration>,
    /// What a run works through: how many, and of what, in the plural.
    pub elements: Option<(u64, &'static str)>,
}

impl Timing {
    /// Median of the runs.
    pub fn median(&self) -> Duration {
        self.runs[self.runs.len() / 2]
    }

    /// The fastest run.
    pub fn fastest(&self) -> Duration {
        self.runs[0]
    }

    /// The slowest run.
    pub fn slowest(&self) -> Duration {
        self.runs[self.runs.len() - 1]
    }

    /// Number of runs.
    pub fn runs(&self) -> usize {
        self.runs.len()
    }

    /// Elements a second, by the median.
    pub fn rate(&self) -> Option<f64> {
        self.elements.map(|(n, _)| n as f64 / self.median().as_secs_f64())
    }

    /// Adds the runs of another round of the same entry.
    pub fn pool(&mut self, other: Self) {
        debug_assert_eq!(self.name, other.name);
        self.runs.extend(other.runs);
        self.runs.sort();
    }

    pub(crate) fn new(name: impl Into<String>, mut runs: Vec<Duration>, elements: Option<(u64, &'static str)>) -> Self {
        runs.sort();
        Self { name: name.into(), runs, elements }
    }
}

/// The names that [`measure`] gives, in its order.
pub fn names() -> Vec<String> {
    let stages = STAGES.iter().map(|stage| format!("stage/{stage}"));
    let frames = Frame::ALL.iter().map(|frame| format!("frame/{}", frame.name()));
    let first = [OPEN, UPLOAD, DISPATCH, LOOKUPS].map(str::to_owned).into_iter().chain(stages);
    first.chain([COMPILE, FIRST_FRAME].map(str::to_owned)).chain(frames).collect()
}

/// Of the processor, whatever the device.
const LOOKUPS: &str = "baseline/packets";
const OPEN: &str = "prepare/open";
const UPLOAD: &str = "prepare/upload";
/// `relight` of one cell.
const DISPATCH: &str = "prepare/dispatch";
/// What the first runs of all stages take longer than later ones, on a device just opened.
pub const COMPILE: &str = "prepare/compile";
const FIRST_FRAME: &str = "prepare/first-frame";

/// Runs are repeated until they have taken this long together,
const ENOUGH: Duration = Duration::from_millis(200);
/// but at least so often that one slow run does not move the median,
const FEWEST: usize = 3;
/// unless that takes this long,
const TOO_LONG: Duration = Duration::from_secs(1);
/// and at most this often.
const MOST: usize = 15;

/// Measures the entries of [`names`] that are `chosen` on a device that `open` opens anew, and gives each timing to
/// `tell` as soon as it is there.
///
/// # Errors
/// The device cannot be opened, or a fault of it; nothing more is measured then.
pub fn measure(
    open: impl Fn() -> Result<Box<dyn Device>, Fault>,
    chosen: impl Fn(&str) -> bool,
    mut tell: impl FnMut(Timing),
) -> Result<(), Fault> {
    // Loads the driver, which the process keeps.
    let device = open()?;
    if chosen(OPEN) {
        tell(Timing::new(OPEN, repeat(|| Ok(()), |()| open())?, None));
    }
    measure_stages(device, &chosen, &mut tell)?;

    let still = scene(Frame::RecordsStatic);
    let camera = &still.camera;
    let pixels = Some((u64::from(camera.width) * u64::from(camera.height), "pixels"));
    if chosen(FIRST_FRAME) {
        let render = |mut renderer: Renderer| {
            renderer.render(&still)?;
            Ok(renderer)
        };
        tell(Timing::new(FIRST_FRAME, repeat(|| Ok(Renderer::new(open()?)), render)?, pixels));
    }
    for frame in Frame::ALL {
        let name = format!("frame/{}", frame.name());
        if chosen(&name) {
            // The first frame, which this renders, warms up.
            let mut next = frame.start(open()?)?;
            settle(|| Ok(next().map(drop)?))?;
            tell(Timing::new(name, repeat(|| Ok(()), |()| Ok(next()?))?, pixels));
        }
    }
    Ok(())
}

/// The entries from the upload to the compilation, which share what they work on.
fn measure_stages(
    device: Box<dyn Device>,
    chosen: impl Fn(&str) -> bool,
    tell: &mut impl FnMut(Timing),
) -> Result<(), Fault> {
    let stages: Vec<_> = STAGES.iter().map(|stage| (*stage, format!("stage/{stage}"))).collect();
    let compiles = chosen(COMPILE);
    if ![UPLOAD, DISPATCH, LOOKUPS].iter().any(|name| chosen(name))
        && !compiles
        && !stages.iter().any(|(_, name)| chosen(name))
    {
        return Ok(());
    }
    let mut rig = Rig::new(device)?;
    if chosen(UPLOAD) {
        let values = density();
        let runs = repeat(|| Ok(()), |()| Ok(rig.upload(&values)?))?;
        tell(Timing::new(UPLOAD, runs, Some((lattice().voxels(), "voxels"))));
    }
    if chosen(DISPATCH) {
        let (least, _) = rig.relight([1; 3])?;
        tell(Timing::new(DISPATCH, timed(&mut rig, &least)?.1, None));
    }
    let view = View::new(256, 192);
    if chosen(LOOKUPS) {
        let lookups = Lookups::new(&view);
        let runs = repeat(|| Ok(()), |()| Ok(std::hint::black_box(lookups.sum())))?;
        tell(Timing::new(LOOKUPS, runs, Some((view.samples(), "samples"))));
    }
    let mut compiling = Duration::ZERO;
    for (stage, name) in stages {
        // Every stage has a part in the compilation.
        if compiles || chosen(&name) {
            let (stage, elements, unit) = rig.stage(stage, &view)?;
            let (first, runs) = if chosen(&name) { timed(&mut rig, &stage)? } else { compiled(&mut rig, &stage)? };
            let timing = Timing::new(name, runs, Some((elements, unit)));
            compiling += first.saturating_sub(timing.median());
            if chosen(&timing.name) {
                tell(timing);
            }
        }
    }
    if compiles {
        tell(Timing::new(COMPILE, vec![compiling], None));
    }
    Ok(())
}

/// The times of a stage's first run and, once it has settled, of more.
fn timed(rig: &mut Rig, stage: &Stage) -> Result<(Duration, Vec<Duration>), Fault> {
    let begin = Instant::now();
    rig.run(stage)?;
    let first = begin.elapsed();
    settle(|| Ok(rig.run(stage)?))?;
    Ok((first, repeat(|| Ok(()), |()| Ok(rig.run(stage)?))?))
}

/// The times of a stage's first run and of a few more, which tell what compiling it takes.
fn compiled(rig: &mut Rig, stage: &Stage) -> Result<(Duration, Vec<Duration>), Fault> {
    let mut run = || -> Result<Duration, Fault> {
        let begin = Instant::now();
        rig.run(stage)?;
        Ok(begin.elapsed())
    };
    let first = run()?;
    Ok((first, (0..FEWEST).map(|_| run()).collect::<Result<_, _>>()?))
}

/// Repeats `run` until it has settled.
fn settle(mut run: impl FnMut() -> Result<(), Fault>) -> Result<(), Fault> {
    let (mut runs, begin) = (0, Instant::now());
    while !settled(runs, begin.elapsed()) {
        run()?;
        runs += 1;
    }
    Ok(())
}

/// The times of `run`, without what `prepare` takes before it and what dropping its result takes after.
fn repeat<P, R>(
    prepare: impl Fn() -> Result<P, Fault>,
    mut run: impl FnMut(P) -> Result<R, Fault>,
) -> Result<Vec<Duration>, Fault> {
    let (mut runs, mut total) = (Vec::new(), Duration::ZERO);
    while runs.len() < MOST && (total < ENOUGH || runs.len() < FEWEST && total < TOO_LONG) {
        let input = prepare()?;
        let begin = Instant::now();
        let result = run(input)?;
        let time = begin.elapsed();
        drop(result);
        runs.push(time);
        total += time;
    }
    Ok(runs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_measured_is_what_is_named() {
        let mut timings = Vec::new();
        measure(|| Ok(airlight::open("cpu")?), |_| true, |timing| timings.push(timing)).unwrap();
        assert_eq!(timings.iter().map(|t| t.name.clone()).collect::<Vec<_>>(), names());
        for t in &timings {
            assert!(t.fastest() <= t.median() && t.median() <= t.slowest(), "{t:?}");
            assert!((1..=MOST).contains(&t.runs()), "{t:?}");
            assert_eq!(t.elements.is_none(), [OPEN, DISPATCH, COMPILE].contains(&t.name.as_str()), "{t:?}");
        }
    }

    #[test]
    fn a_median_is_the_run_in_the_middle_and_elements_are_per_second() {
        let runs = [4, 1, 2, 9, 3].map(Duration::from_millis).to_vec();
        let timing = Timing::new("a", runs, Some((6000, "cells")));
        let figures = |t: &Timing| [t.fastest(), t.median(), t.slowest()];
        assert_eq!(figures(&timing), [1, 3, 9].map(Duration::from_millis));
        // Two numbers of f64, of which one is a thousandth's rounding.
        assert!((timing.rate().unwrap() - 2e6).abs() < 1e-3);
        let mut pooled = timing.clone();
        pooled.pool(Timing::new("a", [5, 6, 20, 7].map(Duration::from_millis).to_vec(), timing.elements));
        assert_eq!((figures(&pooled), pooled.runs()), ([1, 5, 20].map(Duration::from_millis), 9));
    }

    #[test]
    fn what_is_not_chosen_is_not_measured() {
        for (part, expected) in [
            ("stage/re", &["stage/reduce", "stage/relight", "stage/reconstruct"][..]),
            (COMPILE, &[COMPILE]),
            ("frame/records-static", &["frame/records-static"]),
            ("nothing", &[]),
        ] {
            let mut told = Vec::new();
            let open = || Ok(airlight::open("cpu")?);
            measure(open, |name| name.starts_with(part), |timing| told.push(timing.name)).unwrap();
            assert_eq!(told, expected);
        }
    }

    #[test]
    fn a_fault_ends_what_is_measured_and_keeps_what_was() {
        let open = || {
            let inner = airlight::open("cpu")?;
            let broken = airlight::device::Faulty::new(inner, "project", airlight::device::Fault::Fail);
            Ok(Box::new(broken) as Box<dyn Device>)
        };
        let mut told = Vec::new();
        let error = measure(open, |_| true, |timing| told.push(timing.name)).unwrap_err();
        assert!(error.to_string().contains("project was broken"), "{error}");
        let before: Vec<_> = names().into_iter().take_while(|name| name != "stage/project").collect();
        assert_eq!(told, before);
    }

    #[test]
    fn a_device_that_cannot_be_opened_is_an_error() {
        assert!(measure(|| Err("it is gone".into()), |_| true, |_| panic!("there is nothing to tell")).is_err());
    }
}
