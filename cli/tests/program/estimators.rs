//! `estimators`: what it says of which estimator, and the sheet that it writes. No time is asserted.

use serde_json::Value;

use crate::workbench::Workbench;

/// The estimators of each row.
fn names(told: &Value) -> Vec<[&str; 2]> {
    let rows = told["entries"].as_array().unwrap().iter();
    rows.map(|row| ["environment", "lights"].map(|key| row[key].as_str().unwrap())).collect()
}

const FAST: [&str; 6] = ["--device", "cpu", "--size", "12x8", "--samples", "256"];
const SINGLE: [&str; 2] = ["--set", "estimate.scattering=none"];

#[test]
fn every_estimator_that_fits_is_held_to_the_truth() {
    let bench = Workbench::new();
    // A sun that is stronger than the sky, so that its shadow counts.
    let sun = ["--set", "light.0.irradiance=20", "--set", "camera.samples=4"];
    let arguments = [&["estimators", "../fog.toml", "--json", "-o", "sheet.html"], &FAST[..], &SINGLE, &sun].concat();
    let told = bench.json(arguments);
    let lights = ["opacity", "direct, march", "direct, propagated", "direct, none"];
    let mut expected = lights.map(|lights| ["records, radiance, sweep", lights]).to_vec();
    let records = ["radiance, march", "transmittance, sweep", "transmittance, march", "phase, march"];
    let records = records.map(|content| format!("records, {content}"));
    expected.extend(records.iter().map(|records| [records, "opacity"]));
    assert_eq!(names(&told), expected);
    assert_eq!((&told["size"], &told["left_out"]), (&serde_json::json!([12, 8]), &serde_json::json!([])));
    let truth = &told["truth"];
    assert_eq!([&truth["estimator"], &truth["device"]], ["path", "cpu:0"]);
    assert_eq!([&truth["max_depth"], &truth["samples"]], [1, 256]);
    let noise = truth["noise"].as_f64().unwrap();
    for row in told["entries"].as_array().unwrap() {
        let number = |key: &str| row[key].as_f64().unwrap_or_else(|| panic!("{key} of {row:#}"));
        assert!(row["fault"].is_null() && number("device_bytes") > 0.0, "{row:#}");
        assert!(row["seconds"]["prepare"].as_f64().is_some() && row["seconds"]["frame"].as_f64().is_some(), "{row:#}");
        let shadowed = row["lights"] != "direct, none";
        // The truth's own noise, and what four sub-pixel positions and cells of a sixth of the box leave: a few per
        // cent. A light without a shadow is off by half.
        assert_eq!(number("relative_l2") < 0.05 + 2.0 * noise, shadowed, "{row:#}");
        assert!((0.0..=1.0).contains(&number("flip")), "{row:#}");
        assert!(number("relative_l2_of_blocks") < number("relative_l2"), "{row:#}");
    }
    let sheet = std::fs::read_to_string(bench.out().join("sheet.html")).unwrap();
    // The truth once, and two pictures a row.
    assert_eq!(sheet.matches("data:image/png;base64,").count(), 1 + 2 * expected.len());
    assert!(!sheet.contains("http") && sheet.contains("records, transmittance, sweep + opacity + none on cpu:0"));
}

#[test]
fn what_does_not_fit_is_told_and_what_is_left_out_is_no_light() {
    let bench = Workbench::new();
    let of = |set: &[&str]| {
        let sets: Vec<_> = set.iter().flat_map(|set| ["--set", set]).collect();
        bench.json([&["estimators", "../fog.toml", "--json"], &FAST[..], &SINGLE, &sets[..]].concat())
    };
    let told = of(&["medium.anisotropy=0.5", "estimate.lights=none"]);
    let records = ["radiance, sweep", "radiance, march", "phase, march"].map(|content| format!("records, {content}"));
    assert_eq!(names(&told), [[&records[0], "none"], [&records[1], "none"], [&records[2], "none"]]);
    let [left_out, _] = told["left_out"].as_array().unwrap().as_slice() else { panic!("{told:#}") };
    assert_eq!(left_out["estimators"], "records, transmittance, sweep + none + none");
    assert!(left_out["reason"].as_str().unwrap().contains("isotropic"), "{told:#}");
    // The sky is all that lights both.
    assert!(told["entries"][0]["relative_l2"].as_f64().unwrap() < 0.1, "{told:#}");
    let all = of(&["estimate.all=path", "estimate.environment=none"]);
    // Those of single scattering, 192 directions, and no further orders.
    assert_eq!((names(&all).len(), &all["truth"]["max_depth"]), (10, &Value::Null));
}

#[test]
fn a_table_is_for_people() {
    let bench = Workbench::new();
    let text = bench.end(bench.command([&["estimators", "../fog.toml"], &FAST[..], &SINGLE].concat()));
    assert_eq!(text.code, Some(0), "{text:?}");
    let first = text.stdout.lines().next().unwrap();
    assert!(first.starts_with("truth: path, single scattering, 256 paths a pixel, noise "), "{first}");
    assert_eq!(text.stdout.lines().filter(|line| line.starts_with("cpu:0 ")).count(), 8, "{text:?}");
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let bench = Workbench::new();
    bench.refused(["estimators", "../fog.toml", "-o", "sheet.png"], 2, &["sheet.png", ".html"]);
    bench.refused(["estimators", "no.toml"], 2, &["no.toml"]);
    bench.refused(["estimators", "../fog.toml", "--samples", "0"], 2, &["samples"]);
    bench.refused(["estimators", "../fog.toml", "--time-limit=-1"], 2, &["time_limit", "above 0"]);
    bench.refused(["estimators", "../fog.toml", "--device", "no such device"], 2, &["no device \"no such device\""]);
}
