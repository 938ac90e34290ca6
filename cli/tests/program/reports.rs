//! `info`, `devices` and the reports for programs.

use serde_json::Value;

use crate::workbench::{Workbench, fixture, nifti, nrrd, ramp, reference};

/// Every one of `keys` must be there.
#[track_caller]
fn holds(value: &Value, keys: &[&str]) {
    for key in keys {
        assert!(value.get(key).is_some(), "{key} is not in {value:#}");
    }
}

#[test]
fn the_processor_is_among_the_devices() {
    let bench = Workbench::new();
    let told = bench.json(["devices", "--json"]);
    holds(&told, &["version", "backends"]);
    let backends = told["backends"].as_array().unwrap();
    let cpu = &backends.iter().find(|b| b["backend"] == "cpu").unwrap()["devices"][0];
    holds(cpu, &["id", "name", "kind", "memory_bytes", "limits", "features", "filter_bits", "contracts"]);
    holds(&cpu["limits"], &["buffer_bytes", "binding_bytes", "field_side", "loop_turns"]);
    assert_eq!((&cpu["id"], &cpu["kind"]), (&"cpu:0".into(), &"cpu".into()));
    for backend in backends {
        let devices = backend["devices"].as_array().unwrap();
        assert!(!devices.is_empty() || backend["reason"].as_str().is_some_and(|r| !r.is_empty()), "{backend}");
    }
    let text = bench.run(["devices"]);
    text.well();
    assert!(text.stdout.lines().any(|line| line.starts_with("cpu:0 ")), "{text:?}");
}

#[test]
fn a_render_says_what_was_done() {
    let bench = Workbench::new();
    let scene = bench.path("fog.toml");
    let told =
        bench.json(["render", scene.to_str().unwrap(), "-o", "a.exr", "-o", "b.png", "--json", "--samples", "2"]);
    holds(&told, &["version", "device", "estimators", "warnings", "device_bytes"]);
    assert_eq!(told["size"], serde_json::json!([24, 16]));
    assert_eq!(told["samples"], 2);
    assert_eq!(told["outputs"], serde_json::json!(["a.exr", "b.png"]));
    assert_eq!(told["device"]["id"], "cpu:0");
    for part in ["load", "render", "write"] {
        assert!(told["seconds"][part].as_f64().unwrap() >= 0.0);
    }
    let stages: Vec<_> = told["stages"].as_array().unwrap().iter().map(|s| s["stage"].as_str().unwrap()).collect();
    assert_eq!(stages.last(), Some(&"march"), "{stages:?}");
    assert!(told["stages"].as_array().unwrap().iter().all(|s| s["ran"] == true && s["seconds"].is_number()));
    assert!(told["device_bytes"].as_u64().unwrap() >= 24 * 16 * 32);
}

#[test]
fn info_tells_of_scenes() {
    let bench = Workbench::new();
    let scene = bench.path("fog.toml");
    let told = bench.json(["info", scene.to_str().unwrap(), "--json"]);
    let keys =
        ["scene", "camera", "medium", "optics", "environment", "light", "estimate", "quality", "files", "warnings"];
    holds(&told, &keys);
    assert_eq!(told["camera"]["size"], serde_json::json!([24, 16]));
    // Depth across a metre of the fog, along each axis; f32 products of whole numbers are exact.
    assert_eq!(told["medium"]["optical_depth"], serde_json::json!([3.0, 3.0, 3.0]));
    assert_eq!(told["optics"]["albedo"], serde_json::json!([0.9, 0.9, 0.9]));
}

#[test]
fn info_tells_of_every_volume_and_environment() {
    let bench = Workbench::new();
    let dims = [5, 3, 4];
    let mut files: Vec<_> = [fixture(""), reference("")]
        .iter()
        .flat_map(|folder| std::fs::read_dir(folder).unwrap())
        .map(|entry| entry.unwrap().path())
        .filter(|path| {
            let ending = path.extension().unwrap_or_default().to_str().unwrap().to_owned();
            ["vdb", "nrrd", "vol", "exr"].contains(&ending.as_str())
        })
        .collect();
    assert!(files.len() > 20, "{files:?}");
    files.push(bench.write("a.nrrd", nrrd(dims, &ramp(dims))));
    files.push(bench.write("a.nii", nifti([5, 3, 4], &ramp(dims))));
    for path in files {
        let told = bench.json(["info".as_ref(), path.as_os_str(), "--json".as_ref()]);
        if path.extension().is_some_and(|e| e == "exr") {
            holds(&told, &["environment", "size", "mean_radiance", "max_radiance", "warnings"]);
        } else {
            holds(&told, &["volume", "format", "grid"]);
            for grid in told["grid"].as_array().unwrap() {
                holds(grid, &["name"]);
                // Values, or why there are none.
                assert!(grid.get("range").is_some() || grid.get("not_usable").is_some(), "{grid:#}");
            }
        }
        let text = bench.run(["info".as_ref(), path.as_os_str()]);
        text.well();
        assert!(text.stdout.lines().count() >= 3, "{text:?}");
    }
}

#[test]
fn info_of_a_ramp_is_that_ramp() {
    let bench = Workbench::new();
    let dims = [5, 3, 4];
    let values = ramp(dims);
    let path = bench.write("a.nrrd", nrrd(dims, &values));
    let told = bench.json(["info".as_ref(), path.as_os_str(), "--json".as_ref()]);
    let grid = &told["grid"][0];
    assert_eq!(grid["dims"], serde_json::json!([5, 3, 4]));
    let (low, high) = (values[0], *values.last().unwrap());
    let range: Vec<_> = grid["range"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap() as f32).collect();
    assert_eq!(range, [low, high]);
    let mean = values.iter().map(|v| f64::from(*v)).sum::<f64>() / 60.0;
    // Sums of f64 in another order.
    assert!((grid["mean"].as_f64().unwrap() - mean).abs() < 1e-12, "{grid:#}");
}

/// The sunset's sun is half a degree of a fortieth of the light: `auto` says why it leaves it there.
#[test]
fn info_tells_of_the_sun() {
    let bench = Workbench::new();
    let scenes = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let told = |name: &str| bench.json(["info".as_ref(), scenes.join(name).as_os_str(), "--json".as_ref()]);
    let file = told("sunset.exr");
    let number = |key: &str| file["sun"][key].as_f64().unwrap();
    assert!((0.2..0.7).contains(&number("angular_radius")) && (0.01..0.05).contains(&number("share")), "{file:#}");
    let scene = told("fog.toml")["environment"].clone();
    assert_eq!(scene["sun"]["extracted"], false);
    assert!(scene["sun"]["why"].as_str().unwrap().contains("truncation costs"), "{scene:#}");
    assert_eq!(scene["sun"]["cost"].as_array().unwrap().len(), 2);
    assert_eq!(scene["negative"]["of"], 3072);
    let even = bench.json(["info", "../fog.toml", "--json"])["environment"].clone();
    let below = &even["negative"]["without_window"];
    assert_eq!(
        (&even["sun"], below),
        (&serde_json::Value::Null, &serde_json::json!({ "directions": 0, "depth": 0.0 }))
    );
}
