//! What must hold on every device.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::{Instant, SystemTime};

use airlight::device::DeviceInfo;
use libtest_mimic::Failed;

use crate::Subject;
use crate::record::Record;
use crate::sidecar::{Outcome, Sidecar};
use crate::tolerance::{self, Tolerance};

/// A named list of choices that a case goes through.
#[derive(Clone, Debug)]
pub struct Axis<T> {
    name: &'static str,
    values: Vec<(String, T)>,
}

impl<T> Axis<T> {
    /// The choices `values`, each with its label.
    pub fn new(name: &'static str, values: impl IntoIterator<Item = (impl Into<String>, T)>) -> Self {
        Self { name, values: values.into_iter().map(|(label, value)| (label.into(), value)).collect() }
    }

    /// Choices that label themselves, by their `Debug` text in lower case.
    pub fn of(name: &'static str, values: impl IntoIterator<Item = T>) -> Self
    where
        T: std::fmt::Debug,
    {
        Self::new(name, values.into_iter().map(|value| (format!("{value:?}").to_lowercase(), value)))
    }

    /// Its name.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Its choices with their labels.
    pub fn values(&self) -> &[(String, T)] {
        &self.values
    }

    fn labels(&self) -> Labels {
        Labels { axis: self.name, values: self.values.iter().map(|(label, _)| label.clone()).collect() }
    }
}

/// The labels of an [`Axis`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Labels {
    /// The axis's name.
    pub axis: &'static str,
    /// The labels of its choices, in their order.
    pub values: Vec<String>,
}

/// What a device must have for a case to mean anything on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// Fields of at least so many texels along a side ([`airlight::device::Limits::field_side`]).
    FieldSide(u32),
    /// Buffers of at least so many bytes ([`airlight::device::Limits::buffer_bytes`]).
    BufferBytes(u64),
    /// A filter of at least so many bits between two texels ([`DeviceInfo::filter_bits`]).
    FilterBits(u32),
    /// A feature that [`DeviceInfo::features`] lists.
    Feature(&'static str),
}

impl Need {
    /// Why `info` falls short of it; none where it does not.
    pub fn lacking(self, info: &DeviceInfo) -> Option<String> {
        let limits = info.limits;
        match self {
            Self::FieldSide(n) if limits.field_side < n => {
                Some(format!("needs fields of {n} texels a side, and the device has {}", limits.field_side))
            }
            Self::BufferBytes(n) if limits.buffer_bytes < n => {
                Some(format!("needs buffers of {n} bytes, and the device has {}", limits.buffer_bytes))
            }
            Self::FilterBits(n) if info.filter_bits < n => {
                Some(format!("needs a filter of {n} bits, and the device has {}", info.filter_bits))
            }
            Self::Feature(name) if !info.features.iter().any(|f| f == name) => {
                Some(format!("needs \"{name}\", which the device does not list"))
            }
            _ => None,
        }
    }
}

impl std::fmt::Display for Need {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::FieldSide(n) => write!(f, "fields of {n} texels a side"),
            Self::BufferBytes(n) => write!(f, "buffers of {n} bytes"),
            Self::FilterBits(n) => write!(f, "a filter of {n} bits"),
            Self::Feature(name) => write!(f, "the feature \"{name}\""),
        }
    }
}

type Try = dyn Fn(&Subject, &mut Record) -> Result<(), Failed> + Send + Sync;

/// One thing that must hold on every device: data that lists and reports show, and a function that tries it.
///
/// *Permutations* are choices that change the truth; the function works each one's truth out. *Variants* must change
/// nothing: one truth, and each variant is run and held to it. The function goes through both with [`Record::each`],
/// and a case that leaves a declared choice out fails.
///
/// ```
/// use airlight_conformance::{Axis, Case, tolerance};
///
/// let sizes = Axis::of("values", [1usize, 17, 1000]);
/// let case = Case::new("mine::zeros", "A buffer that nobody wrote holds zeros.", {
///     let sizes = sizes.clone();
///     move |subject, record| {
///         record.each(&sizes, |record, &n| {
///             # let _ = subject;
///             // A device of one's own would be asked here.
///             record.hold("values", vec![0.0f32; n], vec![0.0; n]);
///             Ok(())
///         })
///     }
/// })
/// .within(&tolerance::EXACT)
/// .permutes(&sizes);
/// assert!(case.run(&airlight_conformance::Subject::of_choice("cpu")).outcome.passed());
/// ```
#[derive(Clone)]
pub struct Case {
    pub(crate) name: String,
    pub(crate) checks: String,
    pub(crate) parameters: Vec<(&'static str, String)>,
    pub(crate) permutations: Vec<Labels>,
    pub(crate) variants: Vec<Labels>,
    pub(crate) needs: Vec<Need>,
    pub(crate) tolerance: &'static Tolerance,
    run: Arc<Try>,
}

impl Case {
    /// A case named `group::case`, which checks what the sentence `checks` says. Its tolerance is
    /// [`tolerance::EXACT`] until [`Case::within`] names another.
    pub fn new(
        name: impl Into<String>,
        checks: impl Into<String>,
        run: impl Fn(&Subject, &mut Record) -> Result<(), Failed> + Send + Sync + 'static,
    ) -> Self {
        Self {
            name: name.into(),
            checks: checks.into(),
            parameters: Vec::new(),
            permutations: Vec::new(),
            variants: Vec::new(),
            needs: Vec::new(),
            tolerance: &tolerance::EXACT,
            run: Arc::new(run),
        }
    }

    /// Held to `tolerance`, an entry of [`crate::tolerance`] (or one of the caller's own).
    #[must_use]
    pub fn within(mut self, tolerance: &'static Tolerance) -> Self {
        self.tolerance = tolerance;
        self
    }

    /// Stands at one choice of an axis that several cases share.
    #[must_use]
    pub fn at(mut self, axis: &'static str, choice: impl Into<String>) -> Self {
        self.parameters.push((axis, choice.into()));
        self
    }

    /// Goes through choices that change the truth.
    #[must_use]
    pub fn permutes<T>(mut self, axis: &Axis<T>) -> Self {
        self.permutations.push(axis.labels());
        self
    }

    /// Goes through choices that must not change it.
    #[must_use]
    pub fn varies<T>(mut self, axis: &Axis<T>) -> Self {
        self.variants.push(axis.labels());
        self
    }

    /// Means nothing on a device without `need`.
    #[must_use]
    pub fn needs(mut self, need: Need) -> Self {
        self.needs.push(need);
        self
    }

    /// The same of a device that has run each stage often before: backends build kernels for what stays the same.
    pub(crate) fn settled(&self) -> Self {
        let run = Arc::clone(&self.run);
        let settled =
            move |subject: &Subject, record: &mut Record| run(&Subject { settled: true, ..subject.clone() }, record);
        Self {
            name: format!("{}_settled", self.name),
            checks: format!("{} And the same bits, however often it ran before.", self.checks),
            run: Arc::new(settled),
            ..self.clone()
        }
    }

    /// Its name: `group::case`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// All of its name before the last `::`.
    pub fn group(&self) -> &str {
        group_of(&self.name)
    }

    /// What it checks, a sentence.
    pub fn checks(&self) -> &str {
        &self.checks
    }

    /// Where it stands on axes that it shares with other cases.
    pub fn parameters(&self) -> &[(&'static str, String)] {
        &self.parameters
    }

    /// Choices that change the truth.
    pub fn permutations(&self) -> &[Labels] {
        &self.permutations
    }

    /// Choices that must not.
    pub fn variants(&self) -> &[Labels] {
        &self.variants
    }

    /// What a device must have.
    pub fn needed(&self) -> &[Need] {
        &self.needs
    }

    /// What it is held to where it does not say otherwise.
    pub fn tolerance(&self) -> &'static Tolerance {
        self.tolerance
    }

    /// Why the case means nothing on a device; none where it does.
    pub fn lacking(&self, info: &DeviceInfo) -> Option<String> {
        self.needs.iter().find_map(|need| need.lacking(info))
    }

    /// Tries a device. A device that cannot be opened, and a panic of whatever takes part, are failures.
    pub fn run(&self, subject: &Subject) -> Sidecar {
        let (begin, when) = (Instant::now(), SystemTime::now());
        let (record, outcome) = match subject.info() {
            Err(failed) => (None, Outcome::Failed(message(&failed))),
            Ok(info) => match self.lacking(&info) {
                Some(reason) => (Some(Record::new(self, info)), Outcome::Skipped(reason)),
                None => {
                    let mut record = Record::new(self, info);
                    let done = catch_unwind(AssertUnwindSafe(|| (self.run)(subject, &mut record)));
                    let done = done.unwrap_or_else(|panic| Err(format!("panicked: {}", said(&*panic)).into()));
                    let outcome = match done.and_then(|()| record.left_out(self)).map_err(|f| message(&f)) {
                        Err(reason) => Outcome::Failed(reason),
                        Ok(()) => record.exceeded().map_or(Outcome::Passed, Outcome::Failed),
                    };
                    (Some(record), outcome)
                }
            },
        };
        Sidecar::new(self, subject, record, outcome, when, begin.elapsed())
    }
}

/// All of a case's name before the last `::`.
pub(crate) fn group_of(case: &str) -> &str {
    case.rsplit_once("::").map_or(case, |(group, _)| group)
}

/// The text of a failure.
pub(crate) fn message(failed: &Failed) -> String {
    failed.message().unwrap_or("no reason given").to_owned()
}

fn said(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("without a text")
}
