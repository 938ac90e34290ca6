//! The toy in the suite that every device must pass.

use airlight_conformance::{Subject, cases, trials};
use libtest_mimic::{Arguments, Trial};

/// Groups of cases that take minutes in f64 without a thought for speed.
const SLOW: [&str; 4] = ["limits", "frames", "estimators", "pictures"];

fn main() {
    let toy = Subject::new("toy", || airlight::open_among(&[airlight_toy::PROVIDER], "toy").map_err(|e| e.to_string()));
    let (slow, quick): (Vec<_>, Vec<_>) = cases().into_iter().partition(|case| SLOW.contains(&case.group()));
    let slow = trials(&toy, slow, None).into_iter().map(|trial| trial.with_ignored_flag(true));
    let all: Vec<Trial> = trials(&toy, quick, None).into_iter().chain(slow).collect();
    libtest_mimic::run(&Arguments::from_args(), all).exit();
}
