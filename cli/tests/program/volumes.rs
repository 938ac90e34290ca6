//! Volumes whose content cannot be a medium, or claims what its file cannot hold.

use std::sync::Arc;

use airlight::glam::{DAffine3, IVec3, UVec3};
use airlight::media::{Brick, Grid, GridMedium, IndexBox, Storage};
use airlight_formats::volume::{VdbWriteOptions, write_vdb};

use crate::workbench::{Workbench, fixture, nifti, nrrd, ramp};

const DIMS: [usize; 3] = [5, 3, 4];

#[test]
fn small_volumes_of_each_kind_are_rendered() {
    let bench = Workbench::new();
    let raw: Vec<u8> = ramp(DIMS).iter().flat_map(|v| v.to_le_bytes()).collect();
    bench.write("a.raw", raw);
    let header = "ObjectType = Image\nNDims = 3\nDimSize = 5 3 4\nElementType = MET_FLOAT\nElementByteOrderMSB = False\n\
                  ElementSpacing = 0.2 0.3 0.25\nOffset = 0 0 0\nElementDataFile = a.raw\n";
    for volume in [
        bench.write("a.nrrd", nrrd(DIMS, &ramp(DIMS))),
        bench.write("a.nii", nifti([5, 3, 4], &ramp(DIMS))),
        bench.write("a.mhd", header),
        fixture("half-blosc.vdb"),
    ] {
        bench.run(["render".as_ref(), bench.grid_scene("a", &volume).as_os_str()]).well();
        assert_eq!(bench.outputs(), ["a.exr", "a.png"]);
    }
}

#[test]
fn densities_that_no_medium_has_are_told_with_their_voxel() {
    let bench = Workbench::new();
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.25, -f32::MIN_POSITIVE, f32::MAX] {
        let mut values = ramp(DIMS);
        values[3 + 5 * (1 + 3 * 2)] = bad;
        let raw: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        bench.write("b.raw", raw);
        let header = "ObjectType = Image\nNDims = 3\nDimSize = 5 3 4\nElementType = MET_FLOAT\n\
                      ElementSpacing = 1 1 1\nElementDataFile = b.raw\n";
        for volume in [
            bench.write("b.nrrd", nrrd(DIMS, &values)),
            bench.write("b.nii", nifti([5, 3, 4], &values)),
            bench.write("b.mhd", header),
        ] {
            let scene = bench.grid_scene("b", &volume);
            bench.refused(["render".as_ref(), scene.as_os_str()], 2, &["b.toml:10:8", "density", "voxel (3, 1, 2)"]);
            // The file itself may still be asked about.
            let told = bench.json(["info".as_ref(), volume.as_os_str(), "--json".as_ref()]);
            assert!(told["grid"][0]["not_a_density"].is_string(), "{told}");
        }
    }
}

#[test]
fn values_are_told_and_classified() {
    let bench = Workbench::new();
    let values = "type: short\ndimension: 3\nsizes: 2 2 2\nencoding: ascii\nspacings: 1 1 1\naxis mins: 0 0 0\n\n\
                  -1000 -90 0 40 150 500 1200 3000\n";
    let volume = bench.write("ct.nrrd", format!("NRRD0004\n{values}"));
    let told = bench.json(["info".as_ref(), volume.as_os_str(), "--json".as_ref()]);
    assert_eq!(told["grid"][0]["range"], serde_json::json!([-1000.0, 3000.0]), "{told}");
    let scene = bench.grid_scene("ct", &volume);
    let function =
        ["--set", "medium.transfer_function=[{ value = 0 }, { value = 1e3, density = 2, tint = [1, 0.5, 0] }]"];
    let rendered = bench.run([["render", scene.to_str().unwrap()], function].concat());
    rendered.well();
    let text = std::fs::read_to_string(&scene).unwrap();
    let text = text.replacen("[medium]", "[medium]\ntransfer_function = { preset = \"ct-bone\", density = 0.5 }", 1);
    let scene = bench.write("bone.toml", text);
    let told = bench.json(["info".as_ref(), scene.as_os_str(), "--json".as_ref()]);
    assert_eq!(told["transfer_function"]["values"], serde_json::json!([-1000.0, 3000.0]), "{told}");
    assert_eq!(told["transfer_function"]["point"][4]["density"], 0.5, "{told}");
    assert_eq!(told["medium"]["range"], serde_json::json!([0.0, 0.5]), "{told}");
    assert!(told["optics"]["fields"]["seen"][0].as_f64().unwrap() > 0.4, "{told}");
}

#[test]
fn grids_of_no_voxels_and_of_too_many_are_refused_by_their_header() {
    let bench = Workbench::new();
    let raw = |sizes: &str| format!("NRRD0004\ntype: float\ndimension: 3\nsizes: {sizes}\nencoding: raw\n\n");
    let meta = |sizes: &str| {
        format!("ObjectType = Image\nNDims = 3\nDimSize = {sizes}\nElementType = MET_FLOAT\nElementDataFile = LOCAL\n")
    };
    for sizes in ["0 3 4", "1000000 1000000 1000000", "4294967295 4294967295 4294967295", "-1 3 4", "5 3", "a b c"] {
        let gzip = raw(sizes).replace("raw", "gzip");
        for (name, text) in [("c.nrrd", raw(sizes)), ("c.nrrd", gzip), ("c.mha", meta(sizes))] {
            let volume = bench.write(name, text + "some values");
            let scene = bench.grid_scene("c", &volume);
            bench.refused(["render".as_ref(), scene.as_os_str()], 2, &["c.toml:10:8", name]);
            bench.refused(["render".as_ref(), scene.as_os_str(), "--json".as_ref()], 2, &[name]);
        }
    }
    for dims in [[0, 3, 4], [-5, 3, 4], [i16::MAX; 3]] {
        let scene = bench.grid_scene("c", &bench.write("c.nii", nifti(dims, &ramp(DIMS))));
        bench.refused(["render".as_ref(), scene.as_os_str()], 2, &["c.toml:10:8", "c.nii"]);
    }
}

#[test]
fn a_gigantic_tile_is_refused_with_the_numbers() {
    let bench = Workbench::new();
    let scene = bench.grid_scene("tiles", &fixture("tiles.vdb"));
    let words = ["570.3 GiB", "may be used", "9098 × 4106 × 4098", "fewer voxels"];
    bench.refused(["render".as_ref(), scene.as_os_str()], 2, &words);
    for path in [scene, fixture("tiles.vdb")] {
        let told = bench.run(["info".as_ref(), path.as_os_str(), "--json".as_ref()]);
        told.well();
        assert!(told.stdout.contains("\"range\": null"), "{told:?}");
    }
}

/// A .vdb of one voxel in each of the bricks at `places`.
fn scattered(bench: &Workbench, places: &[IVec3]) -> std::path::PathBuf {
    let mut values = Box::new([0.0f32; 512]);
    values[0] = 1.0;
    let bricks: Vec<_> = places.iter().map(|p| Brick { origin: *p * 8, values: values.clone() }).collect();
    let first = bricks.iter().fold(IVec3::MAX, |a, b| a.min(b.origin));
    let last = bricks.iter().fold(IVec3::MIN, |a, b| a.max(b.origin));
    let dims = (last.as_i64vec3() - first.as_i64vec3() + 8).as_uvec3();
    let storage = Storage::Sparse { background: 0.0, bricks, tiles: vec![] };
    let grid = Grid::new(IndexBox { min: first, dims }, DAffine3::IDENTITY, storage).unwrap();
    let path = bench.path("scattered.vdb");
    write_vdb(&path, &[("density", &grid)], VdbWriteOptions::default()).unwrap();
    path
}

#[test]
fn voxels_far_apart_cost_no_memory_and_no_overflow() {
    let bench = Workbench::new();
    let far = 1 << 27;
    for places in [
        // 2^31 voxels along one axis, two, and all three: more than 64 bits count.
        [IVec3::ZERO, IVec3::new(far - 4, 0, 0)],
        [IVec3::ZERO, IVec3::new(far - 4, far - 4, 0)],
        [IVec3::splat(-far / 2), IVec3::splat(far / 2 - 4)],
        // A slice of 2^34 bytes.
        [IVec3::ZERO, IVec3::new(1 << 13, 1 << 13, 0)],
    ] {
        let volume = scattered(&bench, &places);
        let scene = bench.grid_scene("far", &volume);
        bench.refused(["render".as_ref(), scene.as_os_str()], 2, &[]);
        for path in [&volume, &scene] {
            // A scene's step is judged before its medium is described.
            let ended = bench.run(["info".as_ref(), path.as_os_str()]);
            assert!(ended.code == Some(0) || ended.stderr.starts_with("error: "), "{ended:?}");
        }
    }
}

#[test]
fn every_grid_that_a_file_holds_can_be_asked_for_and_no_other() {
    let bench = Workbench::new();
    let scene = bench.grid_scene("several", &fixture("several.vdb"));
    let scene = scene.to_str().unwrap();
    bench.refused(["render", scene, "--set", "medium.grid=smoke"], 2, &["no grid 'smoke'", "'density'"]);
    bench.refused(["render", scene, "--set", "medium.grid='twin'"], 2, &["twin[0]"]);
    let levels = bench.grid_scene("levels", &fixture("levelset-and-fog.vdb"));
    bench.run(["render".as_ref(), levels.as_os_str()]).well();
    let vectors = bench.grid_scene("vectors", &fixture("vec3.vdb"));
    let error = bench.run(["render".as_ref(), vectors.as_os_str()]);
    error.failed(2, &["vectors.toml:10:8", "vec3s"]);
    let frustum = bench.grid_scene("frustum", &fixture("frustum.vdb"));
    bench.run(["render".as_ref(), frustum.as_os_str()]).failed(2, &["frustum.toml:10:8", "frustum"]);
}

#[test]
fn grids_beside_the_density_are_asked_for_by_name() {
    let bench = Workbench::new();
    let grid = |value: f32| Grid::dense(UVec3::new(3, 4, 5), DAffine3::IDENTITY, vec![value; 60]).unwrap();
    let path = bench.path("several.vdb");
    let (density, soot, share, heat) = (grid(0.5), grid(0.25), grid(0.75), grid(1500.0));
    let grids = [("density", &density), ("soot", &soot), ("share", &share), ("heat", &heat)];
    write_vdb(&path, &grids, VdbWriteOptions::default()).unwrap();
    let scene = bench.grid_scene("several", &path);
    let scene = scene.to_str().unwrap();
    let set = |key: &str, name: &str| ["--set".to_owned(), format!("medium.{key}={name}")];
    for key in ["albedo_grid", "absorption_grid", "temperature_grid"] {
        let [set, to] = set(key, "smoke");
        let words = [key, "no grid 'smoke'", "'density', 'soot', 'share', 'heat'"];
        bench.refused(["render", scene, "--set", "medium.emission=1", &set, &to], 2, &words);
    }
    let [set_heat, heat] = set("albedo_grid", "heat");
    bench.refused(["render", scene, &set_heat, &heat], 2, &["albedo_grid", "albedo 1500 at voxel (0, 0, 0)", "0 to 1"]);
    // Formats of one grid hold no other.
    let single = bench.grid_scene("single", &bench.write("a.nrrd", nrrd(DIMS, &ramp(DIMS))));
    let [set_soot, soot] = set("absorption_grid", "soot");
    bench.refused(["render", single.to_str().unwrap(), &set_soot, &soot], 2, &["absorption_grid", "soot", "density"]);

    let mut text = std::fs::read_to_string(scene).unwrap();
    let keys = "emission = 2\nalbedo_grid = 'share'\nabsorption_grid = 'soot'\ntemperature_grid = 'heat'\n";
    text = text.replace("kind = \"grid\"", &format!("kind = \"grid\"\n{keys}"));
    let scene = bench.write("all.toml", text);
    let told = bench.json(["info".as_ref(), scene.as_os_str(), "--json".as_ref()]);
    let fields = &told["optics"]["fields"];
    assert_eq!(fields["scattering"], serde_json::json!([0.375, 0.375, 0.375]));
    // Luminance 1 at the reference, in the red of 1500 K.
    let glow = fields["emission_color"].as_array().unwrap();
    assert!(glow[0].as_f64().unwrap() > 1.0 && glow[2].as_f64().unwrap() == 0.0, "{told:#}");
    assert_eq!(told["medium"]["range"][1], 0.75);
    bench.run(["render".as_ref(), scene.as_os_str()]).well();
}

#[test]
fn a_grid_of_nothing_is_a_clear_sky() {
    let bench = Workbench::new();
    let scene = bench.grid_scene("empty", &fixture("empty.vdb"));
    bench.run(["render".as_ref(), scene.as_os_str(), "-o".as_ref(), "a.exr".as_ref()]).well();
    let exr = airlight_formats::image::read_exr_channels(&bench.out().join("a.exr")).unwrap();
    assert!(exr.channel("A").unwrap().iter().all(|a| *a == 0.0));
    assert!(exr.channel("G").unwrap().iter().all(|g| *g == 0.5));
}

#[test]
fn the_scattered_fixture_is_what_it_says() {
    let bench = Workbench::new();
    let path = scattered(&bench, &[IVec3::ZERO, IVec3::new(3, 0, 0)]);
    let volume = airlight_formats::volume::read(path, None).unwrap();
    // Its active bounds, 1 × 25 voxels, plus one of background on each side.
    assert_eq!(volume.grid.bounds().dims, UVec3::new(27, 3, 3));
    GridMedium::new(Arc::new(volume.grid), None).unwrap();
}
