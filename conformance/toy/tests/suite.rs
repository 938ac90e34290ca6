//! The toy in the suite that every device must pass.

use airlight_conformance::{Subject, trials};
use libtest_mimic::Arguments;

fn main() {
    let toy = Subject::new("toy", || airlight::open_among(&[airlight_toy::PROVIDER], "toy").map_err(|e| e.to_string()));
    libtest_mimic::run(&Arguments::from_args(), trials(&toy)).exit();
}
