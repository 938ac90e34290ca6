//! What a case finds on a device.

use std::collections::HashMap;

use airlight::device::DeviceInfo;
use airlight::scene::Film;
use libtest_mimic::Failed;
use serde::{Deserialize, Serialize};

use crate::case::{Axis, Case};
use crate::compare::compare;
use crate::sidecar::{float, pairs, pixels};
use crate::tolerance::{self, Tolerance};

/// How many values that do not fit are kept of a set.
pub const MISMATCHES: usize = 8;

/// Where in its axes a case stood: axis and label, from the outermost.
pub type Place = Vec<(String, String)>;

/// One number that must not exceed another.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// What was measured: `radiance`.
    pub name: String,
    /// As what: `relative L2`.
    pub measure: String,
    /// Where in the axes.
    #[serde(with = "pairs")]
    pub at: Place,
    /// The number.
    #[serde(with = "float")]
    pub value: f64,
    /// The most it may be.
    #[serde(with = "float")]
    pub threshold: f64,
    /// Name of the tolerance that the threshold is of.
    pub tolerance: Option<String>,
}

impl Score {
    /// Whether the value is within the threshold; what is not a number is not.
    pub fn holds(&self) -> bool {
        self.value <= self.threshold
    }
}

/// One value that is not what it should be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mismatch {
    /// Its place in the set.
    pub index: usize,
    /// What the device gave.
    #[serde(with = "float")]
    pub found: f64,
    /// The truth.
    #[serde(with = "float")]
    pub expected: f64,
}

/// The first values of a set that are not what they should be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mismatches {
    /// The set.
    pub name: String,
    /// Where in the axes.
    #[serde(with = "pairs")]
    pub at: Place,
    /// At most [`MISMATCHES`].
    pub values: Vec<Mismatch>,
}

/// A picture, as the device gave it and as it should be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Picture {
    /// What it shows.
    pub name: String,
    /// Where in the axes.
    #[serde(with = "pairs")]
    pub at: Place,
    /// Columns and rows.
    pub size: [u32; 2],
    /// Linear RGB, rows from the top.
    #[serde(with = "pixels")]
    pub found: Vec<[f32; 3]>,
    /// The same of the truth.
    #[serde(with = "pixels")]
    pub expected: Vec<[f32; 3]>,
}

/// Takes down what a case finds: scores, pictures, and the first values that do not fit.
///
/// Booking never ends a case; a case that has booked a score above its threshold fails when it ends. Relative L2
/// errors and largest errors are booked by [`Record::hold`] and [`Record::picture`], equality of bits by
/// [`Record::same`] and [`Record::steady`], all else by [`Record::score`].
pub struct Record {
    info: DeviceInfo,
    tolerance: Tolerance,
    declared: Vec<&'static str>,
    at: Place,
    tried: Vec<(String, String)>,
    /// The values of the first variant, by name and permutation.
    first: HashMap<String, Vec<f32>>,
    variants: Vec<&'static str>,
    pub(crate) used: Vec<Tolerance>,
    pub(crate) scores: Vec<Score>,
    pub(crate) mismatches: Vec<Mismatches>,
    pub(crate) pictures: Vec<Picture>,
}

impl Record {
    pub(crate) fn new(case: &Case, info: DeviceInfo) -> Self {
        let names = |labels: &[crate::case::Labels]| labels.iter().map(|l| l.axis).collect::<Vec<_>>();
        let variants = names(&case.variants);
        Self {
            info,
            tolerance: *case.tolerance,
            declared: [names(&case.permutations), variants.clone()].concat(),
            at: Place::new(),
            tried: Vec::new(),
            first: HashMap::new(),
            variants,
            used: Vec::new(),
            scores: Vec::new(),
            mismatches: Vec::new(),
            pictures: Vec::new(),
        }
    }

    /// The device.
    pub fn info(&self) -> &DeviceInfo {
        &self.info
    }

    /// What [`Record::hold`] and [`Record::picture`] hold to: the case's tolerance.
    pub fn tolerance(&self) -> Tolerance {
        self.tolerance
    }

    /// Goes through the choices of an axis that the case declares; what `body` books bears the choice's label.
    ///
    /// # Errors
    /// The first of `body`, with the choice before it; an axis that the case does not declare.
    pub fn each<T>(
        &mut self,
        axis: &Axis<T>,
        mut body: impl FnMut(&mut Self, &T) -> Result<(), Failed>,
    ) -> Result<(), Failed> {
        if !self.declared.contains(&axis.name()) {
            return Err(format!("the case does not declare its axis \"{}\"", axis.name()).into());
        }
        for (label, value) in axis.values() {
            let choice = (axis.name().to_owned(), label.clone());
            self.tried.push(choice.clone());
            self.at.push(choice);
            let done = body(self, value);
            self.at.pop();
            done.map_err(|failed| format!("{} {label}: {}", axis.name(), crate::case::message(&failed)))?;
        }
        Ok(())
    }

    /// As [`Record::hold`], to another tolerance than the case's: what `body` books within is held to `tolerance`.
    pub fn within<R>(&mut self, tolerance: Tolerance, body: impl FnOnce(&mut Self) -> R) -> R {
        let usual = std::mem::replace(&mut self.tolerance, tolerance);
        let result = body(self);
        self.tolerance = usual;
        result
    }

    /// Holds values to the truth, value by value.
    pub fn hold(
        &mut self,
        name: &str,
        found: impl IntoIterator<Item: Into<f64>>,
        expected: impl IntoIterator<Item: Into<f64>>,
    ) {
        let found: Vec<f64> = found.into_iter().map(Into::into).collect();
        let expected: Vec<f64> = expected.into_iter().map(Into::into).collect();
        let tolerance = self.tolerance;
        let difference = compare(found.iter().copied(), expected.iter().copied());
        let before = self.scores.len();
        self.book(name, "relative L2 error", difference.relative_l2, tolerance.relative_l2, Some(tolerance));
        if tolerance.peak.is_finite() {
            let share = if difference.max_abs == 0.0 { 0.0 } else { difference.max_abs / difference.peak };
            self.book(name, "largest error / largest value", share, tolerance.peak, Some(tolerance));
        }
        if self.scores[before..].iter().all(Score::holds) {
            return;
        }
        if found.len() != expected.len() {
            self.book(name, "values too few or too many", found.len().abs_diff(expected.len()) as f64, 0.0, None);
        }
        // What the worse of the two bounds would not let pass; where the L2 error alone is too large, at least one
        // value is off by more than its share.
        let rms = (expected.iter().filter(|v| v.is_finite()).map(|v| v * v).sum::<f64>()
            / expected.len().max(1) as f64)
            .sqrt();
        let bounds = [tolerance.peak * difference.peak, tolerance.relative_l2 * rms];
        let wrong = |bound: f64| {
            let pairs = found.iter().zip(&expected).enumerate();
            // What is not a number is off by more than any bound.
            let off = pairs.filter(|(_, (f, e))| f != e && (**f - **e).abs().total_cmp(&bound).is_gt());
            let kept = off.map(|(index, (&found, &expected))| Mismatch { index, found, expected });
            kept.take(MISMATCHES).collect::<Vec<_>>()
        };
        let values = bounds.into_iter().map(wrong).find(|values| !values.is_empty()).unwrap_or_default();
        self.differ(name, values);
    }

    /// Holds a picture's RGB to the truth, and keeps both.
    pub fn picture(
        &mut self,
        name: &str,
        size: [u32; 2],
        found: impl IntoIterator<Item = [f32; 3]>,
        expected: impl IntoIterator<Item = [f64; 3]>,
    ) {
        let found: Vec<[f32; 3]> = found.into_iter().collect();
        let expected: Vec<[f64; 3]> = expected.into_iter().collect();
        self.hold(name, found.iter().flatten().copied(), expected.iter().flatten().copied());
        self.show(name, size, found, expected.iter().map(|p| p.map(|v| v as f32)).collect());
    }

    /// As [`Record::picture`], of a film's beauty.
    pub fn film(&mut self, name: &str, film: &Film, expected: impl IntoIterator<Item = [f64; 3]>) {
        self.picture(name, [film.width, film.height], rgb(film), expected);
    }

    /// Keeps a picture and its truth without holding one to the other. A picture of another size than `size` is left
    /// out: its scores tell of it. One that is kept already, of another variant, is not kept twice.
    pub fn show(&mut self, name: &str, size: [u32; 2], found: Vec<[f32; 3]>, expected: Vec<[f32; 3]>) {
        let pixels = size[0] as usize * size[1] as usize;
        let bits = |picture: &[[f32; 3]]| picture.as_flattened().iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let kept =
            |p: &Picture| p.name == name && bits(&p.found) == bits(&found) && bits(&p.expected) == bits(&expected);
        if found.len() == pixels && expected.len() == pixels && !self.pictures.iter().any(kept) {
            self.pictures.push(Picture { name: name.to_owned(), at: self.at.clone(), size, found, expected });
        }
    }

    /// Holds values to others, bit for bit.
    pub fn same(&mut self, name: &str, found: &[f32], expected: &[f32]) {
        let differ = |(f, e): &(&f32, &f32)| f.to_bits() != e.to_bits();
        let wrong = found.iter().zip(expected).filter(differ).count() + found.len().abs_diff(expected.len());
        self.book(name, "values that differ in a bit", wrong as f64, 0.0, Some(tolerance::EXACT));
        let pairs = found.iter().zip(expected).enumerate().filter(|(_, pair)| differ(pair));
        let values =
            pairs.map(|(index, (&f, &e))| Mismatch { index, found: f.into(), expected: e.into() }).take(MISMATCHES);
        self.differ(name, values.collect());
    }

    /// Holds what each variant gives to what the first one gave, bit for bit.
    pub fn steady(&mut self, name: &str, found: &[f32]) {
        self.against_first(name, found, Self::same);
    }

    /// The same for what kernels of several builds give: within the tolerance where a device may round a product and a sum
    /// as one, which its compilers do in one build and not in another, and where texture units interpolate, which are told places
    /// as shares of textures of several sizes; elsewhere bit for bit.
    pub fn steady_but_contracted(&mut self, name: &str, found: &[f32]) {
        self.steady_unless(self.info.contracts || self.filters(), name, found);
    }

    /// The same for what depends on texels beside those that a lookup is for: within the tolerance where texture units weigh them,
    /// which give what weighs nothing a weight of their last bit; elsewhere bit for bit.
    pub fn steady_but_filtered(&mut self, name: &str, found: &[f32]) {
        self.steady_unless(self.filters(), name, found);
    }

    /// Whether texture units interpolate, in place of kernels.
    fn filters(&self) -> bool {
        self.info.filter_bits < 24
    }

    fn steady_unless(&mut self, differs: bool, name: &str, found: &[f32]) {
        if differs {
            let hold = |record: &mut Self, name: &str, found: &[f32], first: &[f32]| {
                record.hold(name, found.iter().copied(), first.iter().copied());
            };
            self.against_first(name, found, hold);
        } else {
            self.against_first(name, found, Self::same);
        }
    }

    fn against_first(&mut self, name: &str, found: &[f32], hold: impl FnOnce(&mut Self, &str, &[f32], &[f32])) {
        let permutation: Vec<_> = self.at.iter().filter(|(axis, _)| !self.variants.contains(&&axis[..])).collect();
        let key = format!("{name} {permutation:?}");
        match self.first.remove(&key) {
            None => {
                self.first.insert(key, found.to_vec());
            }
            Some(first) => {
                hold(self, &format!("{name}, against the first variant"), found, &first);
                self.first.insert(key, first);
            }
        }
    }

    /// Books a number that must not exceed `threshold`.
    pub fn score(&mut self, name: &str, measure: &str, value: f64, threshold: f64) {
        self.book(name, measure, value, threshold, None);
    }

    fn book(&mut self, name: &str, measure: &str, value: f64, threshold: f64, tolerance: Option<Tolerance>) {
        if let Some(tolerance) = tolerance.filter(|t| !self.used.contains(t)) {
            self.used.push(tolerance);
        }
        let tolerance = tolerance.map(|t| t.name.to_owned());
        let (name, measure, at) = (name.to_owned(), measure.to_owned(), self.at.clone());
        self.scores.push(Score { name, measure, at, value, threshold, tolerance });
    }

    fn differ(&mut self, name: &str, values: Vec<Mismatch>) {
        if !values.is_empty() {
            self.mismatches.push(Mismatches { name: name.to_owned(), at: self.at.clone(), values });
        }
    }

    /// An error where the case declares a choice that it did not try.
    pub(crate) fn left_out(&self, case: &Case) -> Result<(), Failed> {
        for labels in case.permutations.iter().chain(&case.variants) {
            let tried = |label: &&String| !self.tried.iter().any(|(a, l)| a == labels.axis && l == *label);
            if let Some(label) = labels.values.iter().find(tried) {
                return Err(format!("the case declares {} {label} and does not try it", labels.axis).into());
            }
        }
        Ok(())
    }

    /// The scores above their thresholds in words; none where all hold.
    pub(crate) fn exceeded(&self) -> Option<String> {
        let mut wrong = self.scores.iter().filter(|s| !s.holds());
        let first = wrong.next()?;
        let Score { name, measure, at, value, threshold, .. } = first;
        let places: String = at.iter().map(|(axis, label)| format!(", {axis} {label}")).collect();
        let more = match wrong.count() {
            0 => String::new(),
            n => format!("; {n} more scores are above their thresholds"),
        };
        let mismatches = self.mismatches.iter().find(|m| m.at == *at && m.name == *name);
        let worst = mismatches.and_then(|m| m.values.first()).map_or(String::new(), |m| {
            format!("; value {} is {} and should be {}", m.index, short(m.found), short(m.expected))
        });
        Some(format!("{name}{places}: {measure} {value:.3e}, at most {threshold:.1e}{worst}{more}"))
    }
}

/// A value rounded to nine digits, as many as tell any two f32 apart.
pub(crate) fn short(value: f64) -> f64 {
    format!("{value:.8e}").parse().unwrap_or(value)
}

/// The colour of a film's beauty.
pub fn rgb(film: &Film) -> impl Iterator<Item = [f32; 3]> + use<'_> {
    film.beauty.iter().map(|p| [p[0], p[1], p[2]])
}
