//! The suite on the devices that `AIRLIGHT_DEVICES` lists, separated by commas; without it, on `cpu`. A device that
//! `AIRLIGHT_REQUIRE` names fails where it cannot be had, the others are skipped.

use airlight_conformance::run;
use libtest_mimic::Arguments;

fn main() {
    let list = |name: &str, default: &str| -> Vec<String> {
        let text = std::env::var(name).unwrap_or_else(|_| default.to_owned());
        text.split(',').map(str::trim).filter(|s| !s.is_empty()).map(str::to_owned).collect()
    };
    let (devices, required) = (list("AIRLIGHT_DEVICES", "cpu"), list("AIRLIGHT_REQUIRE", ""));
    run(&Arguments::from_args(), &devices, &required).exit();
}
