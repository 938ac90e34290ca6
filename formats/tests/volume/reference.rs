//! The reference density in every format that it exists in.

use crate::common::{dense, reference};
use airlight_formats::volume::{self, Format};
use glam::{DVec3, IVec3, UVec3};
use serde_json::Value;

/// (i, j, k) in units of a voxel from the centre of the first voxel of the grid's bounds.
struct Field {
    values: Vec<f32>,
    dims: UVec3,
    centers: Box<dyn Fn(usize) -> DVec3>,
}

fn field(file: &str) -> Field {
    let volume = volume::read(reference(file), None).unwrap();
    assert_eq!(volume.name, "density", "{file}");
    assert!(volume.placed, "{file}");
    let (bounds, map) = (volume.grid.bounds(), volume.grid.index_to_world());
    assert_eq!(bounds.min, IVec3::ZERO, "{file}");
    let centers = move |n: usize| {
        let (n, d) = (n as u32, bounds.dims);
        map.transform_point3(UVec3::new(n % d.x, n / d.x % d.y, n / (d.x * d.y)).as_dvec3())
    };
    Field { values: dense(&volume.grid), dims: bounds.dims, centers: Box::new(centers) }
}

fn facts() -> Value {
    serde_json::from_str(&std::fs::read_to_string(reference("density.json")).unwrap()).unwrap()
}

fn vec3(value: &Value) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|i| value[i].as_f64().unwrap()))
}

/// The file, and how far a value may be from the field's, relative to it: half rounds to 11 bits.
const FILES: [(&str, f32); 8] = [
    ("density.vdb", 0.0),
    ("density_zip.vdb", 0.0),
    ("density_blosc.vdb", 0.0),
    ("density_half.vdb", 1.0 / 2048.0),
    ("density_half_zip.vdb", 1.0 / 2048.0),
    ("density_half_none.vdb", 1.0 / 2048.0),
    ("density.nrrd", 0.0),
    ("density.vol", 0.0),
];

#[test]
fn every_file_holds_the_same_field() {
    let truth = field("density.vol");
    for (file, tolerance) in FILES {
        let found = field(file);
        assert_eq!(found.dims, UVec3::new(72, 48, 60), "{file}");
        for (n, (a, b)) in found.values.iter().zip(&truth.values).enumerate() {
            assert!((a - b).abs() <= tolerance * b.abs(), "{file}: voxel {n}: {a} against {b}");
            // The box of a .vol is stored as f32, whose step at 0.6 m is 6e-8.
            let (here, there) = ((found.centers)(n), (truth.centers)(n));
            assert!(here.distance(there) < 1e-7, "{file}: voxel {n} at {here} against {there}");
        }
    }
}

#[test]
fn the_field_is_the_one_that_the_facts_describe() {
    let facts = facts();
    let first = vec3(&facts["first_voxel_centre"]);
    for (file, half) in FILES {
        let found = field(file);
        let index = |ijk: &Value| {
            let [i, j, k] = [0, 1, 2].map(|n| ijk[n].as_u64().unwrap());
            ((k * 48 + j) * 72 + i) as usize
        };
        for sample in facts["samples"].as_array().unwrap() {
            let (value, truth) = (found.values[index(&sample["ijk"])], sample["value"].as_f64().unwrap() as f32);
            assert!((value - truth).abs() <= half * truth, "{file}: {value} against {sample}");
        }
        assert_eq!(found.values[index(&facts["argmax_ijk"])], 1.0, "{file}");
        assert_eq!(found.values.iter().filter(|v| **v != 0.0).count() as u64, facts["nonzero"].as_u64().unwrap());
        // Half's rounding errors have either sign: their sum is far below the bound of one.
        let tolerance = if half > 0.0 { 1e-5 } else { 1e-12 };
        let sum: f64 = found.values.iter().map(|v| f64::from(*v)).sum();
        assert!((sum / facts["sum"].as_f64().unwrap() - 1.0).abs() < tolerance, "{file}: sum {sum}");
        let mass: DVec3 = found.values.iter().enumerate().map(|(n, v)| (found.centers)(n) * f64::from(*v)).sum();
        let (center, truth) = (mass / sum, vec3(&facts["centre_of_mass"]));
        // 1e-6 m for half; for the rest the f32 box of the .vol.
        assert!(center.distance(truth) < if half > 0.0 { 1e-6 } else { 1e-7 }, "{file}: {center} against {truth}");
        assert!((found.centers)(0).distance(first) < 1e-7, "{file}");
    }
}

#[test]
fn what_is_said_without_reading_is_what_is_read() {
    for (file, half) in FILES {
        let told = volume::inspect(reference(file)).unwrap();
        let [grid] = &told.grids[..] else { panic!("{file}: {told:?}") };
        let read = volume::read(reference(file), Some("density")).unwrap();
        assert_eq!(grid.name, "density");
        assert_eq!(grid.usable, Ok(()), "{file}");
        assert_eq!(grid.bounds, Some(read.grid.bounds()), "{file}");
        assert_eq!(grid.index_to_world, Some(read.grid.index_to_world()), "{file}");
        let (min, max) = grid.world_bounds().unwrap();
        assert!(min.distance(DVec3::new(-0.6, 0.0, -0.5)) < 1e-7, "{file}: {min}");
        assert!(max.distance(DVec3::new(0.6, 0.8, 0.5)) < 1e-7, "{file}: {max}");
        match told.format {
            Format::Vdb => {
                assert_eq!(grid.active_voxels, Some(132_059), "{file}");
                assert_eq!(grid.value_type, if half > 0.0 { "half" } else { "float" }, "{file}");
            }
            _ => assert_eq!((grid.active_voxels, grid.value_type.as_str()), (None, "f32"), "{file}"),
        }
    }
    let encoding = |file: &str| volume::inspect(reference(file)).unwrap().grids[0].encoding.clone();
    assert_eq!(encoding("density.vdb"), "raw + active mask");
    assert_eq!(encoding("density_blosc.vdb"), "blosc + active mask");
    assert_eq!(encoding("density_half_zip.vdb"), "zip + active mask");
    assert_eq!(encoding("density_half_none.vdb"), "raw");
    assert_eq!(encoding("density.nrrd"), "deflate");
}
