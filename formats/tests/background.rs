//! `[background]`: pictures of colours and distances behind the medium.

use std::path::Path;

use airlight_core::scene::Background;
use airlight_formats::image::{Exr, read_depth, write_exr_channels};
use airlight_formats::scene::{LoadedScene, load_scene};

const SIZE: [u32; 2] = [3, 2];

fn write(path: &Path, [width, height]: [u32; 2], channels: &[(&str, &[f32])]) {
    let channels = channels.iter().map(|(name, values)| ((*name).to_owned(), values.to_vec())).collect();
    write_exr_channels(path, Exr { width, height, channels, metadata: Vec::new() }).unwrap();
}

fn load(folder: &Path, background: &str) -> Result<LoadedScene, String> {
    let text = format!(
        "[camera]\norigin = [0, 0, 3]\ntarget = [0, 0, 0]\nsize = [3, 2]\n[medium]\nkind = \"homogeneous\"\nbounds = \
         [[0, 0, 0], [1, 2, 3]]\n[environment]\nradiance = 1\n[background]\n{background}\n"
    );
    let path = folder.join("a.toml");
    std::fs::write(&path, text).unwrap();
    load_scene(&path, &[]).map_err(|e| e.to_string().replace(&folder.display().to_string(), "DIR"))
}

#[test]
fn colours_and_distances_arrive_and_what_is_odd_is_counted() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let [r, g, b] = [[0.0, 1.0, 2.0, -3.0, 4.0, f32::NAN], [0.5; 6], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]];
    write(&at("beauty.exr"), SIZE, &[("B", &b), ("G", &g), ("R", &r)]);
    let z = [1.5, f32::INFINITY, -1.0, f32::NAN, 0.0, 1e10];
    write(&at("depth.exr"), SIZE, &[("Z", &z)]);
    let loaded = load(folder.path(), "color = \"beauty.exr\"\ndepth = \"depth.exr\"").unwrap();
    let background = loaded.scene.background.unwrap();
    let far = Background::FAR;
    let expected = [
        [0.0, 0.5, 1.0, 1.5],
        [1.0, 0.5, 2.0, far],
        [2.0, 0.5, 3.0, far],
        [0.0, 0.5, 4.0, far],
        [4.0, 0.5, 5.0, 0.0],
        [0.0, 0.5, 6.0, 1e10],
    ];
    assert_eq!(background.surfaces().collect::<Vec<_>>(), expected);
    assert_eq!(loaded.files, [at("a.toml"), at("beauty.exr"), at("depth.exr")]);
    let [color, depth] = &loaded.warnings[..] else { panic!("{:?}", loaded.warnings) };
    assert!(
        color.ends_with("beauty.exr: 2 of 6 pixels hold negative or non-finite values, which count as 0"),
        "{color}"
    );
    let text = "depth.exr: 2 of 6 distances are negative or not numbers, which count as no surface";
    assert!(depth.ends_with(text), "{depth}");

    // Either alone.
    let held = load(folder.path(), "depth = \"depth.exr\"").unwrap().scene.background.unwrap();
    assert!(held.color().is_none() && held.depth().is_some());
    let backdrop = load(folder.path(), "color = \"beauty.exr\"\ndepth = \"none\"").unwrap().scene.background.unwrap();
    assert!(backdrop.color().is_some() && backdrop.depth().is_none());
}

#[test]
fn the_channel_of_depth_is_found_or_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("depth.exr");
    let values: Vec<[f32; 6]> = (0..4).map(|k| [0, 1, 2, 3, 4, 5].map(|i| (10 * k + i) as f32)).collect();
    let taken = |names: &[&str]| {
        let channels: Vec<_> = names.iter().zip(&values).map(|(name, v)| (*name, &v[..])).collect();
        write(&path, SIZE, &channels);
        read_depth(&path).map(|image| image.values[0] / 10.0).map_err(|e| e.to_string())
    };
    assert_eq!(taken(&["A", "View.Depth.Z", "Z"]), Ok(2.0));
    assert_eq!(taken(&["A", "Y", "depth.Z"]), Ok(2.0));
    assert_eq!(taken(&["A", "Y"]), Ok(1.0));
    assert_eq!(taken(&["distance"]), Ok(0.0));
    for names in [&["B", "G", "R"][..], &["a.Z", "b.Z"], &["a.Z", "b.Z", "c"]] {
        let error = taken(names).unwrap_err();
        assert!(error.contains(&format!("has the channels {}", names.join(", "))), "{error}");
    }
}

#[test]
fn what_does_not_fit_is_told_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write(&at("small.exr"), [2, 3], &[("Z", &[1.0; 6])]);
    write(&at("rgb.exr"), SIZE, &[("B", &[1.0; 6]), ("G", &[1.0; 6]), ("R", &[1.0; 6])]);
    std::fs::write(at("sky.hdr"), "#?RADIANCE\n").unwrap();
    for (text, expected) in [
        ("color = \"none\"", "DIR/a.toml:10:1: background needs color"),
        (
            "depth = \"small.exr\"",
            "DIR/a.toml:11:9: background.depth: DIR/small.exr has 2 × 3 pixels and camera.size is 3 × 2; both must be",
        ),
        ("color = \"gone.exr\"", "DIR/a.toml:11:9: background.color: DIR/gone.exr"),
        ("depth = \"rgb.exr\"", "has the channels B, G, R"),
        ("depth = \"sky.hdr\"", "is not an OpenEXR (.exr) picture, which depth must be"),
        ("color = 3", "DIR/a.toml:11:9: background.color must be a string"),
        ("colour = \"a.exr\"", "did you mean `color`?"),
    ] {
        let error = load(folder.path(), text).map(|_| ()).unwrap_err();
        assert!(error.contains(expected), "{text}: {error}");
    }
}
