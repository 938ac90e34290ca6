//! OpenVDB files of its own library, and files that it would not write.

use crate::common::{at, dense, fixture, message, parse};
use airlight_core::media::{Grid, IndexBox, Storage};
use airlight_formats::volume::{self, GridInfo};
use glam::{DVec3, IVec3, UVec3};

fn grid(file: &str, name: Option<&str>) -> Grid {
    volume::read(fixture(file), name).unwrap_or_else(|e| panic!("{e}")).grid
}

fn infos(file: &str) -> Vec<GridInfo> {
    volume::inspect(fixture(file)).unwrap().grids
}

/// The value that the ramps of the fixtures have at voxel (i, j, k) of theirs.
fn ramp(i: i32, j: i32, k: i32) -> f32 {
    (1 + i + 10 * j + 100 * k) as f32 / 8.0
}

/// Checks a ramp of `shape` voxels from `first` on and the border of background about it.
fn check_ramp(grid: &Grid, shape: IVec3, first: IVec3) {
    assert_eq!(grid.bounds(), IndexBox { min: first - 1, dims: (shape + 2).as_uvec3() });
    for k in -1..=shape.z {
        for j in -1..=shape.y {
            for i in -1..=shape.x {
                let p = first + IVec3::new(i, j, k);
                let inside = i >= 0 && j >= 0 && k >= 0 && i < shape.x && j < shape.y && k < shape.z;
                let truth = if inside { ramp(i, j, k) } else { 0.0 };
                assert_eq!(at(grid, p.x, p.y, p.z), truth, "voxel {p}");
            }
        }
    }
}

#[test]
fn bricks_lie_where_their_voxels_are() {
    check_ramp(&grid("affine.vdb", None), IVec3::new(7, 5, 9), IVec3::new(-3, 2, 4));
    check_ramp(&grid("half-blosc.vdb", None), IVec3::new(17, 9, 6), IVec3::new(-3, 2, 4));
}

#[test]
fn an_affine_map_turns_scales_and_shifts() {
    let map = grid("affine.vdb", None).index_to_world();
    let (sin, cos) = 30f64.to_radians().sin_cos();
    let turned = |p: DVec3| DVec3::new(p.x * cos - p.y * sin, p.x * sin + p.y * cos, p.z);
    for p in [DVec3::ZERO, DVec3::new(3.0, -5.0, 7.0)] {
        let truth = turned(p) * DVec3::new(0.5, 0.25, 1.0) + DVec3::new(1.0, -2.0, 3.0);
        assert!(map.transform_point3(p).distance(truth) < 1e-12, "{p}: {} against {truth}", map.transform_point3(p));
    }
}

#[test]
fn every_linear_map_is_read() {
    let p = DVec3::new(3.0, 5.0, 7.0);
    for (name, truth) in [
        ("uniform-scale", DVec3::new(1.5, 2.5, 3.5)),
        ("scale", DVec3::new(1.5, 1.25, 14.0)),
        ("uniform-scale-translate", DVec3::new(2.5, 4.5, 6.5)),
        ("scale-translate", DVec3::new(2.5, 0.75, 17.0)),
        ("translation", DVec3::new(4.0, 7.0, 10.0)),
        // Turned by a quarter about z.
        ("unitary", DVec3::new(-5.0, 3.0, 7.0)),
        // x (0, 2, 0) + y (-1, 0, 0) + z (0, 0.5, 3) + (7, 8, 9)
        ("affine", DVec3::new(2.0, 17.5, 30.0)),
    ] {
        let grid = grid("maps.vdb", Some(name));
        let found = grid.index_to_world().transform_point3(p);
        assert!(found.distance(truth) < 1e-12, "{name}: {found} against {truth}");
        assert_eq!(at(&grid, 2, 1, -1), 13.0, "{name}");
    }
}

#[test]
fn inactive_values_are_as_stored_in_all_seven_ways() {
    let inactive = [[2, 2, 2], [-2, -2, -2], [5, 5, 5], [2, -2, 2], [2, 5, 2], [5, 7, 5], [5, 7, 9]];
    for packing in ["zip", "blosc", "mask", "zip-mask", "blosc-mask"] {
        for half in ["", "-half"] {
            let file = format!("inactive-{packing}{half}.vdb");
            let grid = grid(&file, None);
            let Storage::Sparse { background, bricks, tiles } = grid.storage() else { panic!("{file} became dense") };
            assert_eq!((*background, bricks.len(), tiles.len()), (2.0, 7, 0), "{file}");
            for (case, brick) in bricks.iter().enumerate() {
                assert_eq!(brick.origin, IVec3::new(8 * case as i32, -16, 0), "{file}");
                for (n, value) in brick.values.iter().enumerate() {
                    let truth = if n % 3 == 0 { n as f32 / 4.0 } else { inactive[case][n / 5 % 3] as f32 };
                    assert_eq!(*value, truth, "{file}, leaf {case}, voxel {n}");
                }
            }
        }
    }
}

#[test]
fn tiles_stay_tiles() {
    let grid = grid("tiles.vdb", None);
    let Storage::Sparse { bricks, tiles, .. } = grid.storage() else { panic!("the tiles became dense") };
    let mut found: Vec<_> = tiles.iter().map(|t| (t.side, t.origin.to_array(), t.value)).collect();
    found.sort_by_key(|t| t.0);
    assert_eq!(found, [(8, [-8, -8, 16], 0.125), (128, [-3968, 0, 0], 0.25), (4096, [0, 0, 0], 0.5)]);
    assert_eq!(bricks.len(), 1);
    assert_eq!(at(&grid, -5000, 7, 9), 3.0);
    assert_eq!(at(&grid, -5000, 7, 8), 0.0);
    // From the voxel and the small tile to the far corner of the large one, and one more on each side.
    let (min, max) = (IVec3::new(-5000, -8, 0), IVec3::splat(4095));
    assert_eq!(grid.bounds(), IndexBox { min: min - 1, dims: (max - min + 3).as_uvec3() });
    let told = &infos("tiles.vdb")[0];
    assert_eq!(told.bounds, Some(grid.bounds()));
    assert_eq!(told.active_voxels, Some(4096u64.pow(3) + 128u64.pow(3) + 512 + 1));
}

#[test]
fn a_grid_is_chosen_by_name_or_because_it_is_the_only_one() {
    let read = volume::read(fixture("several.vdb"), None).unwrap();
    assert_eq!(read.name, "density");
    check_ramp(&read.grid, IVec3::new(7, 5, 9), IVec3::new(-3, 2, 4));
    check_ramp(&grid("several.vdb", Some("temperature")), IVec3::new(3, 4, 2), IVec3::new(10, -20, 30));
    check_ramp(&grid("several.vdb", Some("twin[0]")), IVec3::new(1, 2, 3), IVec3::new(-3, 2, 4));
    check_ramp(&grid("several.vdb", Some("twin[1]")), IVec3::new(2, 2, 2), IVec3::new(-3, 2, 4));
    let read = volume::read(fixture("levelset-and-fog.vdb"), None).unwrap();
    assert_eq!(read.name, "smoke");
    let told: Vec<_> =
        infos("several.vdb").into_iter().map(|g| (g.name, g.value_type, g.class, g.usable.is_ok())).collect();
    let entry = |name: &str, kind: &str, class: &str, usable| (name.into(), kind.into(), class.into(), usable);
    for truth in [
        entry("velocity", "vec3s", "", false),
        entry("mask", "bool", "", false),
        entry("temperature", "float", "unknown", true),
        entry("density", "float", "fog volume", true),
        entry("twin[0]", "float", "fog volume", true),
        entry("twin[1]", "float", "fog volume", true),
    ] {
        assert!(told.contains(&truth), "{truth:?} is not in {told:?}");
    }
}

#[test]
fn a_grid_that_cannot_be_used_is_refused_with_those_that_can() {
    let several = message(volume::read(fixture("several.vdb"), Some("velocity")));
    for part in
        ["several.vdb", "grid 'velocity' is of type Tree_vec3s_5_4_3", "'density'", "'temperature'", "'twin[0]'"]
    {
        assert!(several.contains(part), "{several}");
    }
    let absent = message(volume::read(fixture("several.vdb"), Some("heat")));
    assert!(absent.contains("no grid 'heat'") && absent.contains("'temperature'"), "{absent}");
    let surface = message(volume::read(fixture("levelset-and-fog.vdb"), Some("surface")));
    assert!(surface.contains("level set") && surface.contains("'smoke'"), "{surface}");
    let vec3 = message(volume::read(fixture("vec3.vdb"), None));
    assert!(vec3.contains("'velocity' is of type Tree_vec3s_5_4_3"), "{vec3}");
    let frustum = message(volume::read(fixture("frustum.vdb"), None));
    assert!(frustum.contains("frustum"), "{frustum}");
    let maps = message(volume::read(fixture("maps.vdb"), None));
    assert!(maps.contains("which grid?") && maps.contains("'unitary'"), "{maps}");
}

#[test]
fn instances_share_the_tree_and_have_maps_of_their_own() {
    let (own, shared) = (grid("instance.vdb", Some("density")), grid("instance.vdb", Some("shifted")));
    assert_eq!(own.storage(), shared.storage());
    assert_eq!(at(&shared, 2, 1, -1), 13.0);
    assert_eq!(own.index_to_world().translation, DVec3::ZERO);
    assert_eq!(shared.index_to_world().translation, DVec3::new(1.0, 2.0, 3.0));
}

#[test]
fn a_stream_is_read_as_far_as_its_grids_can_be_found() {
    assert_eq!(at(&grid("stream.vdb", Some("first")), 2, 1, -1), 13.0);
    assert_eq!(at(&grid("stream.vdb", Some("second")), 2, 1, -1), 13.0);
    let names: Vec<_> = infos("stream.vdb").into_iter().map(|g| g.name).collect();
    assert_eq!(names, ["first", "second", "velocity"]);
}

#[test]
fn an_empty_grid_is_background() {
    let grid = grid("empty.vdb", None);
    assert_eq!(grid.bounds(), IndexBox { min: IVec3::splat(-1), dims: UVec3::splat(3) });
    assert_eq!(dense(&grid), [0.0; 27]);
}

/// A file of version `version` (220 or 221) with one leaf of n / 4 at (0, 8, -8) in the old layout: no flags a grid,
/// no byte before a node's values, an origin and a count of buffers before a leaf's.
fn old_file(version: u32, zipped: bool, buffers: u8) -> Vec<u8> {
    let mut out = vec![0x20, 0x42, 0x44, 0x56, 0, 0, 0, 0];
    let string = |out: &mut Vec<u8>, text: &str| {
        out.extend((text.len() as u32).to_le_bytes());
        out.extend(text.as_bytes());
    };
    let array = |out: &mut Vec<u8>, values: &[f32]| {
        let raw: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        if !zipped {
            out.extend(raw);
            return;
        }
        let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
        std::io::Write::write_all(&mut encoder, &raw).unwrap();
        let packed = encoder.finish().unwrap();
        out.extend((packed.len() as i64).to_le_bytes());
        out.extend(packed);
    };
    out.extend(version.to_le_bytes());
    out.extend([3, 0, 0, 0, 0, 0, 0, 0, 1, zipped.into()]);
    out.extend([b'0'; 36]);
    out.extend([0; 4]);
    out.extend(1u32.to_le_bytes());
    string(&mut out, "smoke");
    string(&mut out, "Tree_float_5_4_3");
    string(&mut out, "");
    let start = out.len() as i64 + 24;
    [start, start, i64::MAX].iter().for_each(|n| out.extend(n.to_le_bytes()));
    out.extend([0; 4]);
    string(&mut out, "TranslationMap");
    [1.0, 2.0, 3.0].iter().for_each(|x: &f64| out.extend(x.to_le_bytes()));
    // One buffer, background 0, no tile, one child.
    [1, 0, 0, 1].iter().for_each(|n: &u32| out.extend(n.to_le_bytes()));
    [0, 0, -4096].iter().for_each(|n: &i32| out.extend(n.to_le_bytes()));
    for (count, child) in [(32768usize, 31), (4096, (1 << 4) + 15)] {
        let mut children = vec![0u8; count / 8];
        children[child / 8] = 1 << (child % 8);
        out.extend(children);
        out.extend(vec![0; count / 8]);
        array(&mut out, &vec![0.0; count]);
    }
    let mask = [[0xffu8; 64]; 2];
    out.extend(mask[0]);
    out.extend(mask[1]);
    [0, 8, -8].iter().for_each(|n: &i32| out.extend(n.to_le_bytes()));
    out.push(buffers);
    for copy in 0..buffers {
        let values: Vec<f32> = (0..512).map(|n| n as f32 / 4.0 + 1000.0 * f32::from(copy)).collect();
        array(&mut out, &values);
    }
    out
}

#[test]
fn files_of_versions_before_222_are_read() {
    for (version, zipped, buffers) in [(220, false, 1), (221, true, 1), (221, true, 2), (221, false, 2)] {
        let volume = parse("old.vdb", &old_file(version, zipped, buffers)).unwrap();
        assert_eq!(volume.name, "smoke");
        let bounds = IndexBox { min: IVec3::new(-1, 7, -9), dims: UVec3::splat(10) };
        assert_eq!(volume.grid.bounds(), bounds);
        // z is fastest in the file.
        assert_eq!(at(&volume.grid, 3, 8 + 5, -8 + 7), (3 * 64 + 5 * 8 + 7) as f32 / 4.0);
        assert_eq!(volume.grid.index_to_world().translation, DVec3::new(1.0, 2.0, 3.0));
    }
    for version in [219, 225] {
        let error = message(parse("new.vdb", &old_file(version, false, 1)));
        assert!(error.contains(&format!("version {version}")) && error.contains("220 to 224"), "{error}");
    }
}

#[test]
fn wrong_offsets_are_told_with_the_grid() {
    let bytes = std::fs::read(fixture("affine.vdb")).unwrap();
    let at = bytes.windows(16).position(|w| w == b"Tree_float_5_4_3").unwrap() + 16 + 4;
    let with = |offset: usize, value: i64| {
        let mut bytes = bytes.clone();
        bytes[at + offset..][..8].copy_from_slice(&value.to_le_bytes());
        message(parse("wrong.vdb", &bytes))
    };
    for (offset, value) in [(0, 1i64 << 40), (0, -1), (16, 0), (16, i64::MIN)] {
        let error = with(offset, value);
        assert!(error.contains("wrong.vdb: grid 1 of 1: the offsets of 'density'"), "{error}");
        assert!(error.contains(&value.to_string()), "{error}");
    }
    // One byte of the grid is missing.
    let error = with(16, bytes.len() as i64 - 1);
    assert!(error.contains("grid 'density'") && error.contains("cut short"), "{error}");
}

#[test]
fn a_list_that_leads_back_to_itself_ends() {
    let mut bytes = std::fs::read(fixture("affine.vdb")).unwrap();
    let entry = bytes.windows(11).position(|w| w == b"\x07\0\0\0density").unwrap();
    let at = entry + 11 + 4 + 16 + 4;
    bytes[at + 16..][..8].copy_from_slice(&(entry as i64).to_le_bytes());
    bytes[entry - 4..entry].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(message(parse("loop.vdb", &bytes)).contains("after its entry"));
}
