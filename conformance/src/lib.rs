//! The suite that every airlight device must pass.
//!
//! It holds a device to the contract of [`Device`], each stage to its f64 twin in [`airlight::reference`], whole
//! pictures to closed forms and brute force, and those of the reference scene to pictures that another renderer
//! checked. Who brings a device makes a [`Subject`] of it and runs [`trials`]:
//!
//! ```no_run
//! use airlight_conformance::{Subject, trials};
//!
//! let subject = Subject::new("mine", || airlight::open("cpu").map_err(|e| e.to_string()));
//! let args = libtest_mimic::Arguments::from_args();
//! libtest_mimic::run(&args, trials(&subject)).exit();
//! ```
//!
//! Cases are named `device::group::case`, so that a filter picks any part: `stage::march`, `pictures`. Truth is read
//! from `data/` in this crate's folder, or from the folder that `AIRLIGHT_CONFORMANCE_DATA` names; a missing file is
//! a failure.

mod bench;
mod closed;
mod compare;
mod contract;
mod estimators;
mod fixtures;
mod keys;
pub mod pictures;
mod stages;
pub mod tolerance;

use std::sync::{Arc, Mutex, PoisonError};

use airlight::Renderer;
use airlight::device::Device;
use libtest_mimic::{Arguments, Conclusion, Failed, Trial};

pub use compare::{Difference, compare};

type Open = dyn Fn() -> Result<Box<dyn Device>, String> + Send + Sync;

/// A device to be tried, under the name that its cases bear.
#[derive(Clone)]
pub struct Subject {
    name: String,
    open: Arc<Open>,
}

impl Subject {
    /// A device that `open` opens anew for every case.
    pub fn new(
        name: impl Into<String>,
        open: impl Fn() -> Result<Box<dyn Device>, String> + Send + Sync + 'static,
    ) -> Self {
        Self { name: name.into(), open: Arc::new(open) }
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

    /// Opens the device.
    ///
    /// # Errors
    /// What the device's maker says.
    pub fn open(&self) -> Result<Box<dyn Device>, Failed> {
        // The first use of some runtimes is not safe on two threads at once.
        static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
        let _guard = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
        (self.open)().map_err(Failed::from)
    }

    /// Opens the device under a renderer.
    ///
    /// # Errors
    /// As [`Subject::open`].
    pub fn renderer(&self) -> Result<Renderer, Failed> {
        Ok(Renderer::new(self.open()?))
    }
}

type Try = dyn Fn(&Subject) -> Result<(), Failed> + Send + Sync;

/// One thing that must hold on every device.
#[derive(Clone)]
pub struct Case {
    name: String,
    run: Arc<Try>,
}

impl Case {
    fn new(name: impl Into<String>, run: impl Fn(&Subject) -> Result<(), Failed> + Send + Sync + 'static) -> Self {
        Self { name: name.into(), run: Arc::new(run) }
    }

    /// Its name: `group::case`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Tries a device.
    ///
    /// # Errors
    /// What does not hold.
    pub fn run(&self, subject: &Subject) -> Result<(), Failed> {
        (self.run)(subject)
    }
}

/// Every case, in the order of the groups above.
pub fn cases() -> Vec<Case> {
    let groups =
        [contract::cases(), stages::cases(), closed::cases(), estimators::cases(), keys::cases(), pictures::cases()];
    groups.into_iter().flatten().collect()
}

/// Every case as a trial of one device.
pub fn trials(subject: &Subject) -> Vec<Trial> {
    let trial = |case: Case| {
        let subject = subject.clone();
        Trial::test(format!("{}::{}", subject.name(), case.name()), move || case.run(&subject))
    };
    cases().into_iter().map(trial).collect()
}

/// Tries the devices of `choices`. One that cannot be had is said on stderr and left out, or fails where `required`
/// names it.
pub fn run(args: &Arguments, choices: &[String], required: &[String]) -> Conclusion {
    let mut all = Vec::new();
    let extra = required.iter().filter(|r| !choices.contains(r));
    for choice in choices.iter().chain(extra) {
        let subject = Subject::of_choice(choice);
        match subject.open() {
            Ok(_) => all.extend(trials(&subject)),
            Err(reason) => {
                let reason = reason.message().unwrap_or("no reason given").to_owned();
                let needed = required.contains(choice);
                eprintln!("{} {choice}: {reason}", if needed { "MISSING" } else { "SKIPPED" });
                let trial = Trial::test(format!("{choice}::available"), move || Err(reason.into()));
                all.push(trial.with_ignored_flag(!needed));
            }
        }
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
