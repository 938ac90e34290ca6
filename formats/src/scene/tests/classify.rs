//! Transfer functions.

use std::cell::Cell;

use airlight_core::media::{Classified, DensitySource};

use super::*;

fn classified(scene: &Scene) -> &Classified {
    let DensitySource::Classified(medium) = scene.medium.source() else { panic!("{:?}", scene.medium) };
    medium
}

/// What a scene of the volume in "cloud.vdb" makes of a transfer function and more keys.
fn medium(function: &str) -> LoadedScene {
    grid(&format!("file = \"cloud.vdb\"\ngrid = \"heat\"\ntransfer_function = {function}\n")).unwrap()
}

fn told(function: &str) -> String {
    let text = format!("file = \"cloud.vdb\"\ntransfer_function = {function}\n");
    let error = grid(&text).map(|_| ()).expect_err(function);
    error.strip_prefix("scenes/a.toml:").unwrap().to_owned()
}

#[test]
fn points_say_what_values_mean() {
    let loaded = medium(
        "[{ value = -100 }, { value = 800, density = 1, albedo = 0.5, tint = [1, 0.5, 0] }, { value = 1e3, density = 3 }]",
    );
    let function = classified(&loaded.scene).function();
    assert_eq!(function.points().len(), 3);
    let point = function.at(900.0);
    assert_eq!((point.density, point.albedo, point.tint), (2.0, Vec3::splat(0.75), Vec3::new(1.0, 0.75, 0.5)));
    let mut density = [0.0; 6];
    loaded.scene.medium.density_slice(2, &mut density);
    assert_eq!(density, [2.0; 6]);
    let (low, high) = loaded.scene.medium.lattice().world_bounds();
    assert!((low - DVec3::new(0.75, -0.5, -1.0)).length() < 1e-12 && (high.z - 7.0).abs() < 1e-12);
    // Nothing is asked for.
    for none in ["[]", "\"none\"", "false"] {
        let plain = grid(&format!("file = \"cloud.vdb\"\ntransfer_function = {none}")).unwrap();
        assert!(matches!(plain.scene.medium.source(), DensitySource::Slices), "{none}");
    }
    // Values below zero are no densities, but they are values.
    let broken = grid("file = \"cloud.vdb\"\ngrid = \"broken\"\ntransfer_function = [{ value = 0, density = 2 }]");
    assert!(broken.is_ok());
    let loaded = grid(&format!("file = \"cloud.raw\"\ntransfer_function = \"ct-bone\"\n{BOX}")).unwrap();
    assert!((loaded.scene.medium.lattice().world_bounds().1 - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-12);
}

#[test]
fn presets_have_names_densities_and_ranges() {
    let plain = medium("\"ct-bone\"");
    let points = classified(&plain.scene).function().points().to_vec();
    let denser = medium("{ preset = \"ct-bone\", density = 2.5, range = [24, 2024] }");
    let placed = classified(&denser.scene).function().points().to_vec();
    for (a, b) in points.iter().zip(&placed) {
        assert!((b.value - a.value - 1024.0).abs() < 1e-3 && b.density == 2.5 * a.density && a.tint == b.tint);
    }
}

#[test]
fn what_is_wrong_is_told_at_its_point() {
    assert_eq!(
        told("[{ value = 1 }, { value = 0, density = 1 }]"),
        "7:37: medium.transfer_function[1]: point 1 has the value 0, below the 1 ahead of it; values must ascend"
    );
    assert_eq!(
        told("[{ value = 1, tint = [1, 2, 0] }]"),
        "7:42: medium.transfer_function[0].tint = [1, 2, 0]; it must be from 0 to 1"
    );
    assert!(told("[{ density = 1 }]").contains("medium.transfer_function[0].value is missing, as in { value = 300"));
    assert!(told("[{ value = 1, opacity = 1 }]").contains("unknown key `opacity` in medium.transfer_function[0]"));
    assert!(told("[{ value = 1, density = -1 }]").ends_with("density = -1; it must be from 0 to 1e15"));
    let many = format!("[{}]", "{ value = 1 }, ".repeat(257));
    assert!(told(&many).ends_with("medium.transfer_function: 257 points; there must be from 1 to 256"));
    assert_eq!(told("\"ct-bones\""), "7:21: medium.transfer_function = \"ct-bones\"; did you mean \"ct-bone\"?");
    assert!(told("\"granite\"").contains("the presets are \"ct-bone\", \"ct-soft-tissue\""));
    assert!(told("{ preset = \"ct-bone\", range = [1, 0] }").ends_with("the second value must be above the first"));
    assert!(told("{ density = 2 }").contains("preset is missing"));
    assert!(told("3").contains("the name of a preset, a table with one, or a list of control points"));
    let undefined = "file = \"cloud.vdb\"\ngrid = \"undefined\"\ntransfer_function = \"ct-bone\"";
    let undefined = grid(undefined).unwrap_err();
    assert!(undefined.contains("scenes/cloud.vdb: the value NaN at voxel (0, 0, 0) is not a finite"), "{undefined}");
}

#[test]
fn what_shines_needs_a_strength_and_a_place() {
    assert!(told("[{ value = 1, emission = 1 }]").contains("give emission = 1"));
    assert!(told("\"ct-bone\"\nemission = 2").contains("no point says where it shines"));
    assert!(told("\"ct-bone\"\nnoise = { scale = 1 }").contains("medium.noise: a transfer_function says by itself"));
    assert!(told("\"ct-bone\"\nalbedo_grid = \"share\"").contains("medium.albedo_grid: a transfer_function"));
    let loaded = medium("[{ value = 1, emission = [1, 0, 2] }]\nemission = [3, 2, 1]");
    assert_eq!(loaded.scene.optics.emission, Vec3::new(3.0, 2.0, 1.0));
    let homogeneous = load(&format!("{BASE}{BOX}transfer_function = \"ct-bone\""), &[]).unwrap_err().to_string();
    assert!(homogeneous.contains("it belongs to kind \"grid\""), "{homogeneous}");
}

#[test]
fn values_are_read_once_while_their_meaning_changes() {
    let text = format!(
        "{}file = \"cloud.vdb\"\ntransfer_function = [{{ value = 0 }}, {{ value = 9, density = 1, tint = 1 }}]\n\
         [animation]\nframes = [0, 9]\n[[animation.track]]\nkey = \"medium.transfer_function.1.tint\"\n\
         frames = [0, 4]\nvalues = [[1, 1, 1], [1, 0.5, 0]]\n",
        BASE.replace("homogeneous", "grid")
    );
    let mut file = SceneFile::parse(&text, Path::new("scenes/a.toml"), &[]).unwrap();
    let reads = Cell::new(0);
    let read = |path: &Path, grid: Option<&str>| {
        reads.set(reads.get() + 1);
        volumes(path, grid)
    };
    let mut frame = |n| file.frame_with(n, &read).unwrap().scene;
    let (a, b, c) = (frame(0), frame(4), frame(9));
    let seen = |s: &Scene| s.medium.optics_fields().seen.map(|field| field.version());
    assert_eq!(reads.get(), 1);
    assert_eq!(a.medium.version(), b.medium.version());
    assert!(seen(&a).is_none() && seen(&b).is_some());
    assert_eq!(seen(&b), seen(&c));
    assert_eq!(classified(&a).values_version(), classified(&c).values_version());
}
