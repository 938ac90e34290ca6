//! `bench`: what it says of which device. No time is asserted.

use airlight_benches::{curves, papers, quick};
use serde_json::Value;

use crate::workbench::Workbench;

/// An object must have these fields and no others.
#[track_caller]
fn has(object: &Value, fields: &str) {
    let mut expected: Vec<_> = fields.split_whitespace().collect();
    expected.sort_unstable();
    let mut found: Vec<_> = object.as_object().unwrap().keys().map(String::as_str).collect();
    found.sort_unstable();
    assert_eq!(found, expected);
}

/// Fields of a device.
const DEVICE: &str = "id name kind memory_bytes limits features unusable filter_bits contracts";

#[test]
fn every_entry_is_measured_on_a_device_that_is_named() {
    let bench = Workbench::new();
    // The same device twice is one device.
    let told = bench.json(["bench", "--device", "cpu", "--device", "cpu:0", "--json"]);
    let [device] = told["devices"].as_array().unwrap().as_slice() else { panic!("{told:#}") };
    assert_eq!((&device["device"]["id"], &device["fault"]), (&"cpu:0".into(), &Value::Null));
    has(&told, "version devices absent");
    has(device, "device entries fault");
    has(&device["device"], DEVICE);
    let entries = device["entries"].as_array().unwrap();
    assert_eq!(entries.iter().map(|e| e["name"].as_str().unwrap()).collect::<Vec<_>>(), quick::names());
    for entry in entries {
        has(entry, "name seconds fastest slowest runs elements unit per_second ratio");
        let number = |key: &str| entry[key].as_f64().unwrap_or_else(|| panic!("{key} of {entry:#}"));
        assert!(number("fastest") <= number("seconds") && number("seconds") <= number("slowest"), "{entry:#}");
        assert!(number("runs") >= 1.0, "{entry:#}");
        // The first device is what ratios are to; a compilation of no time has none.
        assert!(entry["ratio"] == 1.0 || number("seconds") == 0.0, "{entry:#}");
        if !entry["elements"].is_null() {
            // A quotient of the two, in f64.
            let product = number("per_second") * number("seconds");
            assert!((product / number("elements") - 1.0).abs() < 1e-9, "{entry:#}");
            let units =
                ["voxels", "cells", "samples", "pixels", "rays", "hits", "texels", "paths", "products", "photons"];
            assert!(units.contains(&entry["unit"].as_str().unwrap()), "{entry:#}");
        }
    }
}

#[test]
fn entries_are_chosen_and_rounds_are_pooled() {
    let bench = Workbench::new();
    let runs = |rounds: &str| {
        let told = bench.json(["bench", "relight", "prepare/dis", "--device", "cpu", "--rounds", rounds, "--json"]);
        let entries = told["devices"][0]["entries"].as_array().unwrap();
        let of = |entry: &Value| (entry["name"].as_str().unwrap().to_owned(), entry["runs"].as_u64().unwrap());
        entries.iter().map(of).collect::<Vec<_>>()
    };
    let [once, thrice] = ["1", "3"].map(runs);
    for ((name, once), (again, thrice)) in once.iter().zip(&thrice) {
        // A round ends once it has taken long enough, or after so many runs, which these reach.
        assert_eq!((name, *thrice), (again, 3 * once));
    }
    assert_eq!(once.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["prepare/dispatch", "stage/relight"]);
}

#[test]
fn tables_of_papers_are_told_whole() {
    let bench = Workbench::new();
    // No time at all: every entry is skipped, and none is left out.
    let arguments = ["bench", "--device", "cpu", "--papers", "001-table-3", "--time-limit", "0"];
    let told = bench.json([&arguments[..], &["--json"]].concat());
    assert_eq!((&told["devices"][0]["id"], &told["absent"]), (&"cpu:0".into(), &serde_json::json!([])));
    let [table] = told["tables"].as_array().unwrap().as_slice() else { panic!("{told:#}") };
    has(&told, "version devices tables absent");
    has(&told["devices"][0], DEVICE);
    has(table, "name title paper hardware ours rows");
    assert_eq!(table["name"], "001-table-3");
    assert!(["title", "paper", "hardware", "ours"].iter().all(|key| table[key].is_string()), "{table:#}");
    let expected = papers::tables().into_iter().find(|t| t.name == "001-table-3").unwrap();
    let rows = table["rows"].as_array().unwrap();
    assert_eq!(rows.len(), expected.rows.len());
    for (row, expected) in rows.iter().zip(&expected.rows) {
        has(row, "at unit paper entries");
        assert_eq!(row["unit"], "frames/s");
        for (axis, at) in expected_axes(&expected.at) {
            assert_eq!(row["at"][axis], at, "{row:#}");
        }
        assert_eq!(row["paper"].as_f64(), expected.paper);
        let entries = row["entries"].as_array().unwrap();
        assert_eq!(entries.iter().map(|e| e["form"].as_str().unwrap()).collect::<Vec<_>>(), ["ours", "published"]);
        for entry in entries {
            has(entry, "device form seconds fastest slowest runs frames_per_second stages error skipped fault");
            assert_eq!((&entry["device"], &entry["runs"]), (&"cpu:0".into(), &0.into()));
            assert!(entry["skipped"].as_str().unwrap().contains("more than 0 s"), "{entry:#}");
            let empty = ["seconds", "fastest", "slowest", "frames_per_second", "stages", "error", "fault"];
            assert!(empty.iter().all(|key| entry[key].is_null()), "{entry:#}");
        }
    }
    // As Markdown: the paper's figure, and a note that stands once.
    let text = bench.end(bench.command(arguments));
    assert_eq!(text.code, Some(0), "{text:?}");
    let row = text.stdout.lines().find(|line| line.starts_with("| 20 ") && line.contains("| 27000 ")).unwrap();
    assert!(row.contains("| 9 ") && row.contains("| skipped (1) "), "{row}");
    assert_eq!(text.stdout.matches("more than 0 s").count(), 1, "{text:?}");
}

/// Names of the axes of table 3 with a row's places on them.
fn expected_axes(at: &[String]) -> impl Iterator<Item = (&'static str, &str)> {
    ["cells a side", "Gaussians", "static"].into_iter().zip(at.iter().map(String::as_str))
}

#[test]
fn curves_are_told_whole() {
    let bench = Workbench::new();
    // No time at all: every point is skipped, and none is left out.
    let arguments = ["bench", "--device", "cpu", "--curves", "lights", "--time-limit", "0"];
    let told = bench.json([&arguments[..], &["--json"]].concat());
    has(&told, "version devices margin curves absent");
    has(&told["devices"][0], DEVICE);
    assert_eq!(told["margin"], curves::MARGIN);
    let [curve] = told["curves"].as_array().unwrap().as_slice() else { panic!("{told:#}") };
    has(curve, "name title series");
    let expected = curves::curves().into_iter().find(|curve| curve.name == "lights").unwrap();
    assert_eq!((&curve["name"], &curve["title"]), (&expected.name.into(), &expected.title.into()));
    let series = curve["series"].as_array().unwrap();
    assert_eq!(series.len(), expected.series.len());
    for (series, expected_series) in series.iter().zip(&expected.series) {
        has(series, "name device expected why exponent faster points");
        assert_eq!((&series["name"], &series["device"]), (&expected_series.name.into(), &"cpu:0".into()));
        assert_eq!(
            (&series["expected"], &series["why"]),
            (&expected_series.expected.into(), &expected_series.why.into())
        );
        assert!(series["exponent"].is_null() && series["faster"].is_null(), "{series:#}");
        let points = series["points"].as_array().unwrap();
        assert_eq!(points.len(), expected.points.len());
        for (point, expected) in points.iter().zip(&expected.points) {
            has(point, "at seconds fastest slowest runs skipped fault");
            assert_eq!((&point["at"], &point["runs"]), (&expected.at.into(), &0.into()));
            assert!(point["skipped"].as_str().unwrap().contains("more than 0 s"), "{point:#}");
            assert!(["seconds", "fastest", "slowest", "fault"].iter().all(|key| point[key].is_null()), "{point:#}");
        }
    }
    // As Markdown: a row a series, and a note that stands once.
    let text = bench.end(bench.command(arguments));
    assert_eq!(text.code, Some(0), "{text:?}");
    assert_eq!(text.stdout.matches("| cpu:0 ").count(), expected.series.len(), "{text:?}");
    assert_eq!(text.stdout.matches("more than 0 s").count(), 1, "{text:?}");
}

#[test]
fn what_cannot_be_measured_is_refused() {
    let bench = Workbench::new();
    bench.refused(["bench", "--device", "no such device"], 2, &["no device \"no such device\"", "cpu:0"]);
    bench.refused(["bench", "--device", ""], 2, &["no device \"\""]);
    bench.refused(["bench", "--device", "cpu:99"], 2, &["cpu:99"]);
    bench.refused(["bench", "--papers", "002"], 2, &["no such table", "001-table-2"]);
    bench.refused(["bench", "--papers", "001-table-2/4"], 2, &["no such row", "20/1/"]);
    bench.refused(["bench", "--curves", "time"], 2, &["no such curve", "basis-lights"]);
    bench.refused(["bench", "--curves", "cells", "--papers", "001"], 2, &["--papers", "cannot be used with"]);
    bench.refused(["bench", "--time-limit", "3"], 2, &["--papers"]);
    bench.refused(["bench", "march", "stage/swim"], 2, &["no entry contains \"stage/swim\"", "stage/march"]);
    bench.refused(["bench", "march", "--papers"], 2, &["cannot be used with"]);
    bench.refused(["bench", "--rounds", "0"], 2, &["--rounds"]);
    bench.refused(["bench", "--rounds", "2", "--curves"], 2, &["cannot be used with"]);
    for limit in ["-1", "NaN", "1e300"] {
        let limit = format!("--time-limit={limit}");
        bench.refused(["bench", "--papers", "001", &limit], 2, &["--time-limit", "number of seconds"]);
    }
}
