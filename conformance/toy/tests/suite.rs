//! The toy in the suite that every device must pass.

use airlight_conformance::{Subject, cases, trials};
use libtest_mimic::{Arguments, Trial};

/// Groups of cases that take minutes in f64 without a thought for speed.
const SLOW: [&str; 11] = [
    "columns",
    "limits",
    "frames",
    "estimators",
    "paths",
    "photons",
    "pictures",
    "scattering",
    "sequence",
    "suns",
    "transfer",
];

fn main() {
    let toy = Subject::new("toy", || airlight::open_among(&[airlight_toy::PROVIDER], "toy").map_err(|e| e.to_string()));
    let results = std::env::var_os("AIRLIGHT_RESULTS").map(std::path::PathBuf::from);
    let all = cases().into_iter().flat_map(|case| {
        // What runs often is no faster here for it.
        let slow = SLOW.contains(&case.group()) || case.name().ends_with("_settled");
        trials(&toy, vec![case], results.as_deref()).into_iter().map(move |trial| trial.with_ignored_flag(slow))
    });
    libtest_mimic::run(&Arguments::from_args(), all.collect::<Vec<Trial>>()).exit();
}
