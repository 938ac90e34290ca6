//! `compare`

use std::path::PathBuf;

use airlight_formats::image::{Exr, write_exr_channels};

use crate::workbench::{Workbench, fixture};

/// A picture of `width` × 4 pixels of (v, 2v, 3v), `v` rising from pixel to pixel by `slope` from 1.
fn picture(bench: &Workbench, name: &str, width: u32, slope: f32) -> PathBuf {
    let values = |scale: f32| (0..width * 4).map(|i| scale * (1.0 + slope * i as f32)).collect();
    let channels = vec![("R".into(), values(1.0)), ("G".into(), values(2.0)), ("B".into(), values(3.0))];
    let path = bench.path(name);
    write_exr_channels(&path, Exr { width, height: 4, channels, metadata: vec![] }).unwrap();
    path
}

#[test]
fn equal_pictures_do_not_differ() {
    let bench = Workbench::new();
    let a = picture(&bench, "a.exr", 6, 0.1);
    let a = a.to_str().unwrap();
    let told = bench.json(["compare", a, a, "--max-rel-l2", "0", "--json"]);
    assert_eq!((told["relative_l2"].as_f64(), told["max_abs"].as_f64()), (Some(0.0), Some(0.0)));
    assert_eq!(told["flip"].as_f64(), Some(0.0));
    assert_eq!(told["size"], serde_json::json!([6, 4]));
    assert_eq!(told["mean_ratio"], serde_json::json!([1.0, 1.0, 1.0]));
    assert!(told["flip_tone_map"].is_string());
    assert!(bench.outputs().is_empty());
}

#[test]
fn a_difference_above_the_bound_ends_with_3() {
    let bench = Workbench::new();
    let (a, b) = (picture(&bench, "a.exr", 6, 0.0), picture(&bench, "b.exr", 6, 0.01));
    let (a, b) = (a.to_str().unwrap(), b.to_str().unwrap());
    let told = bench.json(["compare", a, b, "--json"]);
    // ‖a - b‖ / ‖b‖ of 1 against 1 + i/100, i from 0 to 23; f32 pixels.
    let (mut above, mut below) = (0.0f64, 0.0f64);
    for i in 0..24 {
        let i = f64::from(i) * 0.01;
        (above, below) = (above + i * i, below + (1.0 + i) * (1.0 + i));
    }
    let expected = (above / below).sqrt();
    let found = told["relative_l2"].as_f64().unwrap();
    assert!((found - expected).abs() < 1e-6, "{found} and not {expected}");

    bench.run(["compare", a, b]).well();
    bench.run(["compare", a, b, "--max-rel-l2", &(expected * 1.01).to_string()]).well();
    let ended = bench.run(["compare", a, b, "--max-rel-l2", &(expected * 0.99).to_string()]);
    assert_eq!(ended.code, Some(3), "{ended:?}");
    assert!(ended.stderr.starts_with("error: relative L2") && ended.stdout.contains("FLIP"), "{ended:?}");
}

#[test]
fn a_picture_of_the_difference_is_written() {
    let bench = Workbench::new();
    let (a, b) = (picture(&bench, "a.exr", 6, 0.0), picture(&bench, "b.exr", 6, 0.3));
    let (a, b) = (a.to_str().unwrap(), b.to_str().unwrap());
    bench.run(["compare", a, b, "-o", "d.png"]).well();
    assert_eq!(bench.outputs(), ["d.png"]);
    assert_eq!(&std::fs::read(bench.out().join("d.png")).unwrap()[16..24], [0, 0, 0, 6, 0, 0, 0, 4]);
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let bench = Workbench::new();
    let (a, b) = (picture(&bench, "a.exr", 6, 0.0), picture(&bench, "b.exr", 5, 0.0));
    let (a, b) = (a.to_str().unwrap(), b.to_str().unwrap());
    let fog = bench.path("fog.toml");
    bench.refused(["compare", a, b], 2, &["6 × 4", "5 × 4"]);
    bench.refused(["compare", a, "none.exr"], 2, &["none.exr", "No such file"]);
    bench.refused(["compare", a, "."], 2, &["folder"]);
    bench.refused(["compare", a, fog.to_str().unwrap()], 2, &["fog.toml", "neither"]);
    bench.refused(["compare", a, fixture("tiles.vdb").to_str().unwrap()], 2, &["tiles.vdb", "neither"]);
    bench.refused(["compare", a, a, "-o", "d.exr"], 2, &["d.exr", ".png"]);
    for bound in ["-1", "nan", "inf", "little"] {
        bench.refused(["compare", a, a, &format!("--max-rel-l2={bound}")], 2, &["at least 0"]);
    }
    bench.refused(["compare", a, a, "-o", "none/d.png"], 1, &["none/d.png", "does not exist"]);
}
