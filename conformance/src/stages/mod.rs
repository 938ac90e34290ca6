//! Each stage against its twin.

mod march;
mod march_cases;
mod project;
mod reduce;
mod relight;

use crate::Case;

pub(crate) fn cases() -> Vec<Case> {
    [reduce::cases(), project::cases(), relight::cases(), march_cases::cases()].into_iter().flatten().collect()
}

/// Floats widened for comparison.
fn widen(values: &[f32]) -> impl Iterator<Item = f64> + use<'_> {
    values.iter().map(|&v| f64::from(v))
}
