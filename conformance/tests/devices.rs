//! The suite on the devices that `AIRLIGHT_DEVICES` lists, separated by commas; without it, on `cpu`. A device that
//! `AIRLIGHT_REQUIRE` names fails where it cannot be had, the others are skipped. `AIRLIGHT_RESULTS` names a folder
//! that results are written into.

use airlight_conformance::{arguments, listed, run};

fn main() {
    let mut devices = listed("AIRLIGHT_DEVICES");
    if devices.is_empty() {
        devices.push("cpu".to_owned());
    }
    let results = std::env::var_os("AIRLIGHT_RESULTS").map(Into::into);
    run(&arguments(), &devices, &listed("AIRLIGHT_REQUIRE"), results).exit();
}
