//! `precompute`, and pictures from what it makes: on the processor, of few cells and functions.

use std::fs;

use crate::workbench::{FOG, Workbench};

const FILE: &str = "../fog.transfer";

/// The fog, lit by a transfer of its file, as `lit.toml`.
fn bench() -> Workbench {
    let bench = Workbench::new();
    let estimate = FOG.find("[estimate]").unwrap();
    let transfer = "all = { kind = \"transfer\", file = \"fog.transfer\", cells = 6, functions = 12, solver = \"ordinates\", \
                    clusters = 8, components = 2 }";
    bench.write("lit.toml", format!("{}[estimate]\n{transfer}\n", &FOG[..estimate]));
    bench
}

fn precompute<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&["precompute", "../lit.toml", "--device", "cpu"], more].concat()
}

fn render<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&["render", "../lit.toml", "--device", "cpu", "-o", "a.exr"], more].concat()
}

#[test]
fn what_is_made_is_told_and_rendered_from() {
    let bench = bench();
    bench.refused(render(&[]), 2, &["lit.toml:", "estimate.all.file", "fog.transfer", "airlight precompute"]);
    let survey = bench.json(precompute(&["--survey", "--json"]));
    assert!(!bench.path("fog.transfer").exists() && bench.outputs().is_empty());
    let made = bench.json(precompute(&["--json"]));
    assert_eq!(made["survey"], survey["survey"]);
    assert_eq!(survey["survey"]["cells"], serde_json::json!([6, 6, 6]));
    // Isotropic and grey: one band and one channel, three functions at a time.
    let of = |key: &str| made["survey"][key].as_u64().unwrap();
    assert_eq!(["rows", "functions", "bands", "channels", "batches"].map(of), [216, 12, 1, 1, 4]);
    assert_eq!((&made["photons"], &made["truncated"], &made["device"]["id"]), (&0.into(), &0.into(), &"cpu:0".into()));
    assert_eq!((made["output"].as_str(), made["loss"].as_array().unwrap().len()), (Some("../fog.transfer"), 1));
    assert_eq!(made["bytes"].as_u64(), Some(fs::metadata(bench.path("fog.transfer")).unwrap().len()));
    assert!((0.0..1e-3).contains(&made["residual"].as_f64().unwrap()), "{made:#}");

    let told = bench.json(["info", FILE, "--json"]);
    let of = |key: &str| told[key].as_u64().unwrap();
    assert_eq!(["rows", "functions", "bands", "clusters", "components"].map(of), [216, 12, 1, 8, 2]);
    assert_eq!((&told["basis"], &told["channel"][0]["loss"]), (&"dsf 12".into(), &made["loss"][0]));

    let picture = bench.json(render(&["--json"]));
    let stages: Vec<_> = picture["stages"].as_array().unwrap().iter().map(|s| s["stage"].as_str().unwrap()).collect();
    assert!(
        stages.ends_with(&["march"]) && ["evaluate", "reconstruct"].iter().all(|s| stages.contains(s)),
        "{stages:?}"
    );
    // Another light and another eye ask for no other transfer; nor does one in memory differ.
    let moved = ["--set", "environment.radiance=1", "--set", "light.0.to_light=[1,0,0]", "--set", "camera.fov=50"];
    bench.run(render(&moved)).well();
    bench.run(render(&[])).well();
    let memory = ["render", "../lit.toml", "--device", "cpu", "-o", "b.exr", "--set", "estimate.all.file=none"];
    bench.run(memory).well();
    bench.run(["compare", "a.exr", "b.exr", "--max-rel-l2", "1e-5"]).well();
}

#[test]
fn stale_and_damaged_files_are_refused() {
    let bench = bench();
    bench.run(precompute(&[])).well();
    let refused = |set: &str, words: &[&str]| bench.refused(render(&["--set", set]), 2, words);
    refused("medium.density=2", &["made of another density", "make it again"]);
    refused("medium.extinction=2", &["another extinction, albedo or phase function"]);
    refused("medium.albedo=0.8", &["another extinction, albedo or phase function"]);
    refused("medium.bounds=[[0,0,0],[1,1,1.5]]", &["another lattice"]);
    refused("estimate.all.cells=7", &["estimate.all.cells asks for 7", "made with 6", "airlight precompute"]);
    refused("estimate.all.functions=42", &["asks for dsf 42", "made with dsf 12"]);
    let bytes = fs::read(bench.path("fog.transfer")).unwrap();
    let mut flipped = bytes.clone();
    let at = bytes.len() - 3;
    flipped[at] ^= 4;
    for (content, words) in [(&flipped[..], "checksum"), (&bytes[..at], "header"), (&b"no transfer"[..], "header")] {
        bench.write("fog.transfer", content);
        bench.refused(render(&[]), 2, &["fog.transfer", words]);
        bench.refused(["info", FILE], 2, &["fog.transfer", words]);
    }
}

#[test]
fn what_cannot_be_made_leaves_nothing() {
    let bench = bench();
    let refused = |more: &[&str], code: i32, words: &[&str]| {
        bench.refused(precompute(&[&["--json"], more].concat()), code, words);
        assert!(!bench.path("fog.transfer").exists());
    };
    refused(&["--memory", "1e-7"], 2, &["transfer of 216 cells", "may be used"]);
    refused(&["--memory", "0"], 2, &["--memory"]);
    refused(&["-o", "none/fog.transfer"], 1, &["none"]);
    refused(&["--set", "estimate.all.functions=13"], 2, &["estimate.all.functions", "12"]);
    refused(&["--set", "estimate.all.photons=3"], 2, &["estimate.all.photons", "solver = \"photons\""]);
    refused(&["--set", "estimate.all.clusters=0"], 2, &["estimate.all.clusters"]);
    let shining = ["--set", "medium.emission=1"];
    refused(&shining, 2, &["`transfer` carries light from far away", "emission"]);
}
