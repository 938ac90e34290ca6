//! The suite that every airlight device must pass.
//!
//! It holds a device to the contract of [`Device`], each stage to its f64 twin in [`airlight::reference`], whole
//! pictures to closed forms and brute force, and those of the reference scene to pictures that another renderer
//! checked. Who brings a device makes a [`Subject`] of it and runs [`trials`]:
//!
//! ```no_run
//! use airlight_conformance::{Subject, cases, trials};
//!
//! let subject = Subject::new("mine", || airlight::open("cpu").map_err(|e| e.to_string()));
//! let args = libtest_mimic::Arguments::from_args();
//! libtest_mimic::run(&args, trials(&subject, cases(), None)).exit();
//! ```
//!
//! A [`Case`] is data (a name, a sentence, axes, needs, a tolerance of [`tolerance`]) and a function that books what it
//! finds into a [`Record`]. What comes of it is a [`Sidecar`], which can be written into a folder of results; results
//! of several runs and machines are put together by copying. Cases are named `device::group::case` as tests, so that a
//! filter picks any part: `stage::march`, `pictures`.
//!
//! The truth is part of this crate; another folder of it takes its place where `AIRLIGHT_CONFORMANCE_DATA` names one,
//! and a file missing there is a failure.

mod bench;
mod case;
mod classification;
mod closed;
pub mod columns;
mod compare;
mod contract;
mod estimators;
mod faults;
mod fixtures;
mod frames;
mod keys;
mod layouts;
mod lender;
mod limits;
mod paths;
pub mod pictures;
mod record;
mod report;
mod rooms;
pub mod scattering;
pub mod sequences;
mod sidecar;
mod stages;
mod suite;
mod suns;
mod surfaces;
pub mod tolerance;
mod transfers;
mod truth;

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use airlight::Renderer;
use airlight::device::{Device, DeviceInfo};
use libtest_mimic::{Arguments, Completion, Conclusion, Trial};

pub use case::{Axis, Case, Labels, Need};
pub use compare::{Difference, compare};
pub use lender::Lender;
pub use libtest_mimic::Failed;
pub use record::{MISMATCHES, Mismatch, Mismatches, Picture, Place, Record, Score, rgb};
pub use report::{Reported, Sheet, SheetEntry, write_report, write_sheet};
pub use sidecar::{AxisRecord, DeviceRecord, FORMAT, FORMAT_VERSION, LimitsRecord, Outcome, Sidecar, ToleranceRecord};
pub use suite::try_all;
pub use tolerance::Tolerance;

/// A device to be tried, under the name that its cases bear.
#[derive(Clone)]
pub struct Subject {
    name: String,
    devices: Lender,
    info: Arc<OnceLock<DeviceInfo>>,
    /// Whether stages run often before what they give is looked at again.
    settled: bool,
}

impl Subject {
    /// A device that `open` opens as often as cases run at the same time, and anew after one that must not be used again ([`Lender`]).
    pub fn new(
        name: impl Into<String>,
        open: impl Fn() -> Result<Box<dyn Device>, String> + Send + Sync + 'static,
    ) -> Self {
        Self { name: name.into(), devices: Lender::new(open), info: Arc::default(), settled: false }
    }

    /// The device of a choice as [`airlight::open`] takes it: `cpu`, `wgpu:1`.
    pub fn of_choice(choice: &str) -> Self {
        let wanted = choice.to_owned();
        Self::new(choice, move || airlight::open(&wanted).map_err(|e| e.to_string()))
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The device, which holds nothing and may have been used by other cases.
    ///
    /// # Errors
    /// What the device's maker says.
    pub fn device(&self) -> Result<Box<dyn Device>, Failed> {
        self.devices.lend().map_err(Failed::from)
    }

    /// What the device is.
    ///
    /// # Errors
    /// As [`Subject::device`].
    pub fn info(&self) -> Result<DeviceInfo, Failed> {
        if let Some(info) = self.info.get() {
            return Ok(info.clone());
        }
        let info = self.device()?.info().clone();
        Ok(self.info.get_or_init(|| info).clone())
    }

    /// The device under a renderer that has rendered nothing.
    ///
    /// # Errors
    /// As [`Subject::device`].
    pub fn renderer(&self) -> Result<Renderer, Failed> {
        Ok(Renderer::new(self.device()?))
    }

    /// The device, opened anew, under a renderer.
    ///
    /// # Errors
    /// As [`Subject::device`].
    pub fn fresh(&self) -> Result<Renderer, Failed> {
        Ok(Renderer::new(self.devices.fresh()?))
    }
}

/// The parts of an environment variable between commas: `AIRLIGHT_DEVICES`, `AIRLIGHT_REQUIRE`.
pub fn listed(variable: &str) -> Vec<String> {
    let text = std::env::var(variable).unwrap_or_default();
    text.split(',').map(str::trim).filter(|s| !s.is_empty()).map(str::to_owned).collect()
}

/// Every case, in the order of the groups above.
pub fn cases() -> Vec<Case> {
    let groups = [
        contract::cases(),
        limits::cases(),
        faults::cases(),
        stages::cases(),
        closed::cases(),
        columns::cases(),
        surfaces::cases(),
        rooms::cases(),
        frames::cases(),
        estimators::cases(),
        suns::cases(),
        paths::cases(),
        keys::cases(),
        layouts::cases(),
        sequences::cases(),
        pictures::cases(),
        scattering::cases(),
        transfers::cases(),
        classification::cases(),
    ];
    groups.into_iter().flatten().collect()
}

/// Cases as trials of one device; where there is a folder for results, each writes its own there. A case that means
/// nothing on the device is ignored with its reason.
pub fn trials(subject: &Subject, cases: Vec<Case>, results: Option<&Path>) -> Vec<Trial> {
    let trial = |case: Case| {
        let (subject, results) = (subject.clone(), results.map(Path::to_path_buf));
        Trial::ignorable_test(format!("{}::{}", subject.name(), case.name()), move || {
            let result = case.run(&subject);
            if let Some(folder) = &results {
                result.write(folder)?;
            }
            result.verdict()?;
            Ok(match result.outcome {
                Outcome::Skipped(reason) => {
                    eprintln!("SKIPPED {}::{}: {reason}", subject.name(), case.name());
                    Completion::ignored_with(reason)
                }
                _ => Completion::Completed,
            })
        })
    };
    cases.into_iter().map(trial).collect()
}

/// The arguments of a program of tests on devices; as many run at a time as [`try_all`] tries, unless they say otherwise.
pub fn arguments() -> Arguments {
    let mut arguments = Arguments::from_args();
    arguments.test_threads.get_or_insert_with(suite::threads);
    arguments
}

/// Tries the devices of `choices` as tests of libtest-mimic. One that cannot be had is said on stderr and left out,
/// or fails where `required` names it. Results are written into the folder `results`, where there is one. Each case is tried on
/// all devices before the next one: of some, kernels are compiled one at a time, which then leaves no core idle.
pub fn run(args: &Arguments, choices: &[String], required: &[String], results: Option<PathBuf>) -> Conclusion {
    let (mut all, mut subjects) = (Vec::new(), Vec::new());
    let extra = required.iter().filter(|r| !choices.contains(r));
    for choice in choices.iter().chain(extra) {
        let subject = Subject::of_choice(choice);
        match subject.info() {
            Ok(_) => subjects.push(subject),
            Err(reason) => {
                let reason = case::message(&reason);
                let needed = required.contains(choice);
                eprintln!("{} {choice}: {reason}", if needed { "MISSING" } else { "SKIPPED" });
                let trial = Trial::test(format!("{choice}::available"), move || Err(reason.into()));
                all.push(trial.with_ignored_flag(!needed));
            }
        }
    }
    for case in cases() {
        all.extend(subjects.iter().flat_map(|subject| trials(subject, vec![case.clone()], results.as_deref())));
    }
    libtest_mimic::run(args, all)
}

/// `Err` with the formatted text unless the condition holds.
macro_rules! check {
    ($condition:expr, $($text:tt)+) => {
        // What compares with a number that is none does not hold.
        let holds: bool = $condition;
        if !holds {
            return Err(libtest_mimic::Failed::from(format!($($text)+)));
        }
    };
}
pub(crate) use check;
