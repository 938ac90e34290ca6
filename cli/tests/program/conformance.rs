//! `conformance`

use std::fs;

use serde_json::Value;

use crate::workbench::{Ended, Workbench, names};

/// The suite on the processor, whatever else the machine has.
fn on_cpu<'a>(arguments: &'a [&'a str]) -> impl Iterator<Item = &'a &'a str> {
    ["conformance", "--device", "cpu"].iter().chain(arguments)
}

/// Runs it where the truth is missing, so that every case that needs it fails.
fn without_truth(bench: &Workbench, arguments: &[&str]) -> Ended {
    let mut command = bench.command(on_cpu(arguments));
    command.env("AIRLIGHT_CONFORMANCE_DATA", bench.path("nowhere"));
    bench.end(command)
}

#[test]
fn a_whole_device_ends_with_0() {
    let bench = Workbench::new();
    let ended = bench.run(on_cpu(&["--filter", "cpu:0::device::"]));
    assert_eq!(ended.code, Some(0), "{ended:?}");
    let lines: Vec<_> = ended.stdout.lines().collect();
    assert!(lines.len() > 5 && lines[..lines.len() - 1].iter().all(|l| l.starts_with("passed  cpu:0::device::")));
    assert_eq!(*lines.last().unwrap(), format!("{} passed, 0 failed, 0 skipped", lines.len() - 1));
    assert!(bench.outputs().is_empty());
}

#[test]
fn a_failed_case_ends_with_3() {
    let bench = Workbench::new();
    let ended = without_truth(&bench, &["--filter", "pictures::environment_coefficients"]);
    assert_eq!(ended.code, Some(3), "{ended:?}");
    assert_eq!(ended.stderr, "error: 1 of 1 cases failed\n");
    assert!(ended.stdout.starts_with("failed  cpu:0::pictures::environment_coefficients"), "{ended:?}");
    assert!(ended.stdout.contains("sh_env.json: No such file"), "{ended:?}");
    assert!(ended.stdout.ends_with("0 passed, 1 failed, 0 skipped\n"), "{ended:?}");
}

#[test]
fn results_accumulate_in_the_report() {
    let bench = Workbench::new();
    let ended = without_truth(&bench, &["--filter", "environment_coefficients", "--report", "results"]);
    assert_eq!(ended.code, Some(3), "{ended:?}");
    bench.run(on_cpu(&["--filter", "stage::relight::emission", "--report", "results"])).well();
    let results = bench.out().join("results");
    let [device, index] = &names(&results)[..] else { panic!("{:?}", names(&results)) };
    assert_eq!(index, "index.html");
    assert!(device.starts_with("cpu-0-"), "{device}");
    let files = ["pictures.environment_coefficients.json", "stage.relight.emission.json"];
    assert_eq!(names(&results.join(device)), files);
    let result: Value = serde_json::from_slice(&fs::read(results.join(device).join(files[1])).unwrap()).unwrap();
    assert_eq!((&result["outcome"], &result["format_version"]), (&"passed".into(), &1.into()));
    let page = fs::read_to_string(results.join("index.html")).unwrap();
    for text in ["stage::relight::emission", "sh_env.json: No such file", "1 failed", "1 passed"] {
        assert!(page.contains(text), "{text} is not in {page}");
    }

    // Another machine's results, and a damaged one.
    let other = results.join("other");
    fs::create_dir(&other).unwrap();
    let text = fs::read_to_string(results.join(device).join(files[1])).unwrap();
    fs::write(other.join(files[1]), text.replace("\"cpu:0\"", "\"gpu:3\"")).unwrap();
    fs::write(other.join("cut.json"), &text[..99]).unwrap();
    let ended = bench.run(["conformance", "--no-run", "--report", "results"]);
    assert_eq!(ended.code, Some(0), "{ended:?}");
    assert!(ended.stderr.starts_with("warning: ") && ended.stderr.contains("cut.json"), "{ended:?}");
    let page = fs::read_to_string(results.join("index.html")).unwrap();
    assert!(page.contains("on 2 devices") && page.contains("gpu:3") && page.contains("cut.json"), "{page}");
}

#[test]
fn json_holds_the_results() {
    let bench = Workbench::new();
    let told = bench.json(on_cpu(&["--filter", "stage::reduce::margin", "--json"]));
    assert_eq!((&told["passed"], &told["failed"], &told["skipped"]), (&1.into(), &0.into(), &0.into()));
    let result = &told["results"][0];
    assert_eq!((&result["case"], &result["outcome"]), (&"stage::reduce::margin".into(), &"passed".into()));
    assert_eq!(result["device"]["id"], "cpu:0");
    assert!(result["scores"].as_array().is_some_and(|s| !s.is_empty() && s.iter().all(|s| s["threshold"].is_number())));
    assert!(result["tolerances"][0]["reason"].is_string());

    let told = bench.json(on_cpu(&["--list", "--filter", "stage::reduce::margin", "--json"]));
    let [case] = &told["cases"].as_array().unwrap()[..] else { panic!("{told}") };
    assert_eq!(case["variants"][0]["axis"], "cut");
    assert_eq!(case["tolerance"]["name"], "MEAN");
    assert!(bench.outputs().is_empty());
}

#[test]
fn cases_are_listed() {
    let bench = Workbench::new();
    let ended = bench.run(on_cpu(&["--list"]));
    ended.well();
    assert!(ended.stdout.lines().count() > 100 && ended.stdout.lines().all(|l| l.starts_with("cpu:0::")), "{ended:?}");
}

#[test]
fn bad_usage_ends_with_2() {
    let bench = Workbench::new();
    fs::write(bench.out().join("file"), "").unwrap();
    let refused = |arguments: &[&str], words: &[&str]| {
        bench.run(["conformance"].iter().chain(arguments)).failed(2, words);
        assert_eq!(bench.outputs(), ["file"], "{arguments:?}");
    };
    refused(&["--device", "no such device"], &["no such device", "cpu:0"]);
    refused(&["--device", "cpu:7"], &["cpu:7", "cpu:0"]);
    refused(&["--require", "no such device"], &["required", "no such device"]);
    refused(&["--device", "cpu", "--filter", "no such case"], &["no such case", "--list"]);
    refused(&["--report", "file"], &["file: is not a folder"]);
    refused(&["--report", "none", "--no-run"], &["none: the folder does not exist"]);
    refused(&["--no-run"], &["--report"]);
    refused(&["--pictures", "march"], &["--report"]);
    let mut command = bench.command(on_cpu(&["--filter", "device::info"]));
    bench
        .end({
            command.env("AIRLIGHT_REQUIRE", "cpu, no such device");
            command
        })
        .failed(2, &["required", "no such device"]);
}
