//! The same program on a machine that has neither Vulkan nor OpenCL.

#![cfg(all(target_os = "linux", target_env = "gnu", feature = "opencl", feature = "wgpu"))]

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use airlight_benches::quick;
use serde_json::Value;

use crate::workbench::{Ended, Workbench};

/// These runs take some hundredths of a second. What would wait for a platform waits for ten.
const LITTLE_TIME: Duration = Duration::from_secs(5);

const VULKAN: &str = "libvulkan.so.1 not found";
const OPENCL: &str = "libOpenCL.so.1 not found";

/// The example `hide`, which `cargo test` builds, but not for a choice of tests alone.
fn hide() -> PathBuf {
    let file = Path::new(env!("CARGO_BIN_EXE_airlight")).with_file_name("examples").join("libhide.so");
    assert!(file.exists(), "{} is missing; `cargo test` without a choice of tests builds it", file.display());
    file
}

/// The program with `arguments`, which finds neither library.
fn bare(bench: &Workbench, arguments: &[&str]) -> Command {
    let mut command = bench.command(arguments);
    command.env("LD_AUDIT", hide()).env_remove("AIRLIGHT_OPENCL_LIBRARY");
    command
}

fn run(bench: &Workbench, arguments: &[&str]) -> Ended {
    let begin = Instant::now();
    let ended = bench.end(bare(bench, arguments));
    assert!(begin.elapsed() < LITTLE_TIME, "{:?}: {ended:?}", begin.elapsed());
    ended
}

#[test]
fn devices_says_why_each_backend_has_none() {
    let bench = Workbench::new();
    let ended = run(&bench, &["devices"]);
    ended.well();
    assert_eq!(ended.stderr, "");
    let line = |start: &str| ended.stdout.lines().find(|line| line.starts_with(start)).unwrap_or_default();
    assert!(line("wgpu: none: ").contains(VULKAN), "{ended:?}");
    assert!(line("opencl: none: ").contains(OPENCL), "{ended:?}");
    assert!(line("cpu:0 ").len() > "cpu:0 ".len(), "{ended:?}");

    let ended = run(&bench, &["devices", "--json"]);
    ended.well();
    let told: Value = serde_json::from_str(&ended.stdout).unwrap();
    let backend = |name: &str| told["backends"].as_array().unwrap().iter().find(|b| b["backend"] == name).unwrap();
    for (name, reason) in [("wgpu", VULKAN), ("opencl", OPENCL)] {
        let backend = backend(name);
        assert_eq!(backend["devices"], Value::Array(Vec::new()));
        assert!(backend["reason"].as_str().unwrap().contains(reason), "{backend:#}");
    }
    assert_eq!(backend("cpu")["devices"][0]["id"], "cpu:0");
}

#[test]
fn scenes_are_rendered_on_the_processor() {
    let bench = Workbench::new();
    let scene = bench.path("fog.toml");
    let scene = scene.to_str().unwrap();
    for (device, output) in [("auto", "auto.exr"), ("cpu", "cpu.exr")] {
        let ended = run(&bench, &["render", scene, "--device", device, "-o", output]);
        ended.well();
        assert!(ended.stdout.contains(" cpu:0 "), "{ended:?}");
        assert_eq!(ended.stderr, "", "a machine without a graphics card is no reason for a warning");
    }
    assert_eq!(bench.outputs(), ["auto.exr", "cpu.exr"]);
    let compared = bench.json(["compare", "auto.exr", "cpu.exr", "--json"]);
    assert_eq!(compared["max_abs"], 0.0);
}

#[test]
fn a_backend_that_is_asked_for_is_one_clear_error() {
    let bench = Workbench::new();
    let scene = bench.path("fog.toml");
    let scene = scene.to_str().unwrap();
    for (device, reason) in [("wgpu", VULKAN), ("opencl", OPENCL), ("wgpu:0", VULKAN), ("opencl:1", OPENCL)] {
        let ended = run(&bench, &["render", scene, "--device", device, "-o", "a.exr"]);
        ended.failed(2, &[&format!("no device \"{device}\": {reason}")]);
        assert_eq!(ended.stderr.lines().count(), 1, "{ended:?}");
    }
    assert_eq!(bench.outputs(), Vec::<String>::new());
}

#[test]
fn bench_says_what_is_absent_and_measures_the_processor() {
    let bench = Workbench::new();
    let ended = bench.end(bare(&bench, &["bench"]));
    assert_eq!(ended.code, Some(0), "{ended:?}");
    let said: Vec<_> = ended.stderr.lines().collect();
    assert_eq!(said.len(), 2, "{ended:?}");
    for (line, backend, reason) in [(said[0], "wgpu", VULKAN), (said[1], "opencl", OPENCL)] {
        assert!(line.starts_with(&format!("{backend} has no device: {reason}")), "{ended:?}");
    }
    // A row an entry, with a time and nothing to compare it with.
    for name in quick::names() {
        let row = ended.stdout.lines().find(|line| line.starts_with(&name)).unwrap_or_default();
        assert!(row.ends_with('s') && !row.contains('×'), "{name} in {ended:?}");
    }
}

#[test]
fn conformance_skips_aloud_what_is_absent() {
    let bench = Workbench::new();
    for devices in [&[][..], &["--device", "wgpu", "--device", "opencl", "--device", "cpu"]] {
        let arguments = [&["conformance", "--filter", "device::info"], devices].concat();
        let ended = run(&bench, &arguments);
        assert_eq!(ended.code, Some(0), "{ended:?}");
        for (line, reason) in ended.stderr.lines().zip([VULKAN, OPENCL]) {
            assert!(line.starts_with("skipped: ") && line.contains(reason), "{ended:?}");
        }
        assert_eq!(ended.stderr.lines().count(), 2, "{ended:?}");
        assert!(ended.stdout.ends_with("1 passed, 0 failed, 0 skipped\n"), "{ended:?}");
    }
    run(&bench, &["conformance", "--require", "wgpu"]).failed(2, &["required", VULKAN]);
    // A run that tried nothing has not passed.
    let ended = run(&bench, &["conformance", "--device", "opencl"]);
    assert_eq!((ended.code, &ended.stdout[..]), (Some(2), ""), "{ended:?}");
    assert!(ended.stderr.contains(OPENCL) && ended.stderr.contains("no device to try"), "{ended:?}");
}
