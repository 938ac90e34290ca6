//! Media that a scene describes.

use airlight_core::media::{DensitySource, Medium};

use super::*;

/// The medium of a scene whose `[medium]` is of a kind and has the box of the other tests.
fn medium(kind: &str, rest: &str) -> Scene {
    load(&format!("{}{BOX}{rest}", BASE.replace("homogeneous", kind)), &[]).unwrap().scene
}

#[test]
fn gaussians_stand_in_the_scene() {
    let blobs = "cells = 30\nblobs = [{ center = [0.5, 1, 2], a = 9, c = 2 }, { center = [0, 0, 0], a = 1.5, c = 0 }]";
    let scene = medium("gaussians", blobs);
    let DensitySource::Gaussians(gaussians) = scene.medium.source() else { panic!("{:?}", scene.medium) };
    assert_eq!(gaussians.blobs().len(), 2);
    assert_eq!((gaussians.blobs()[0].center, gaussians.blobs()[1].a), (DVec3::new(0.5, 1.0, 2.0), 1.5));
    assert_eq!(scene.medium.lattice().dims(), UVec3::new(10, 20, 30));
    let none = medium("gaussians", "blobs = []");
    assert_eq!(none.medium.lattice().dims(), UVec3::new(21, 43, 64));
}

#[test]
fn gaussians_stand_in_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("blobs.json");
    let scene = folder.path().join("a.toml");
    let text = format!("{}{BOX}file = \"blobs.json\"", BASE.replace("homogeneous", "gaussians"));
    let parse = |json: &str| {
        std::fs::write(&path, json).unwrap();
        parse_scene(&text, &scene, &[])
    };
    let json = r#"[{"center": [0, 1, 2], "a": 9, "c": 2}, {"b": [0.5, 1, 2.5], "a": 3.5, "c": 1e-3}]"#;
    let loaded = parse(json).unwrap();
    let DensitySource::Gaussians(gaussians) = loaded.scene.medium.source() else { panic!() };
    assert_eq!((gaussians.blobs()[1].center.z, gaussians.blobs()[1].c), (2.5, 1e-3));
    assert_eq!(loaded.files, std::slice::from_ref(&path));
    assert!(parse("[]").is_ok());
    for (json, place, what) in [
        (r#"{"blobs": []}"#, ":1:", "expected a sequence"),
        ("[\n{\"center\": [0, 1], \"a\": 9, \"c\": 2}]", ":2:", "expected an array of length 3"),
        (r#"[{"center": [0, 1, 2], "a": 9}]"#, ":1:30", "missing field `c`"),
        (r#"[{"center": [0, 1, 2], "a": 9, "c": 2, "d": 1}]"#, ":1:42", "unknown field `d`"),
        (r#"[{"center": [0, 1, 2], "a": 9, "c": 1e999}]"#, ":1:", "number out of range"),
        (r#"[{"center": [0, 1, 2], "a": -9, "c": 1}]"#, ": Gaussian 0: a -9", "from 1e-15 to 1e15"),
        ("[", ":1:1", "EOF while parsing"),
    ] {
        let error = parse(json).unwrap_err().to_string();
        assert!(error.contains(&format!("a.toml:7:8: medium.file: {}{place}", path.display())), "{error}");
        assert!(error.contains(what), "{error}");
    }
}

#[test]
fn fog_and_noise_have_defaults() {
    let fog = medium("height-fog", "falloff = 2\ndensity = 0.5");
    let DensitySource::HeightFog(fog) = fog.medium.source() else { panic!() };
    // The base is the floor of the box.
    assert_eq!((fog.density(), fog.falloff(), fog.base()), (0.5, 2.0, 0.0));
    let noise = medium("noise", "scale = 0.5\nseed = 7\ncontrast = 2");
    let DensitySource::Noise(noise) = noise.medium.source() else { panic!() };
    assert_eq!((noise.density(), noise.noise().scale(), noise.noise().octaves()), (1.0, 0.5, 4));
    assert_eq!((noise.noise().seed(), noise.noise().contrast()), (7, 2.0));
}

#[test]
fn a_grid_takes_noise_for_detail() {
    let scene = medium("grid", "file = \"cloud.vdb\"\nnoise = { scale = 0.5, octaves = 2 }");
    let DensitySource::Detailed(detailed) = scene.medium.source() else { panic!() };
    assert_eq!((detailed.noise().octaves(), detailed.grid().lattice().dims()), (2, UVec3::new(2, 3, 4)));
    let plain = medium("grid", "file = \"cloud.vdb\"\nnoise = false");
    assert!(matches!(plain.medium.source(), DensitySource::Slices));
}
