//! `bench`: what it says of which device. No time is asserted.

use airlight_benches::quick;
use serde_json::Value;

use crate::workbench::Workbench;

#[test]
fn every_entry_is_measured_on_a_device_that_is_named() {
    let bench = Workbench::new();
    // The same device twice is one device.
    let told = bench.json(["bench", "--device", "cpu", "--device", "cpu:0", "--json"]);
    let [device] = told["devices"].as_array().unwrap().as_slice() else { panic!("{told:#}") };
    assert_eq!((&device["device"]["id"], &device["fault"]), (&"cpu:0".into(), &Value::Null));
    let entries = device["entries"].as_array().unwrap();
    assert_eq!(entries.iter().map(|e| e["name"].as_str().unwrap()).collect::<Vec<_>>(), quick::names());
    for entry in entries {
        let number = |key: &str| entry[key].as_f64().unwrap_or_else(|| panic!("{key} of {entry:#}"));
        assert!(number("fastest") <= number("seconds") && number("seconds") <= number("slowest"), "{entry:#}");
        assert!(number("runs") >= 1.0, "{entry:#}");
        // The first device is what ratios are to; a compilation of no time has none.
        assert!(entry["ratio"] == 1.0 || number("seconds") == 0.0, "{entry:#}");
        if !entry["elements"].is_null() {
            // A quotient of the two, in f64.
            let product = number("per_second") * number("seconds");
            assert!((product / number("elements") - 1.0).abs() < 1e-9, "{entry:#}");
            assert!(["voxels", "cells", "samples", "pixels"].contains(&entry["unit"].as_str().unwrap()), "{entry:#}");
        }
    }
}

#[test]
fn what_cannot_be_measured_is_refused() {
    let bench = Workbench::new();
    bench.refused(["bench", "--device", "no such device"], 2, &["no device \"no such device\"", "cpu:0"]);
    bench.refused(["bench", "--papers"], 2, &["--papers", "not built yet"]);
}
