//! Written OpenVDB files, read back.

use crate::common::{at, dense, fixture, message, reference};
use airlight_core::media::{Brick, Grid, IndexBox, Storage, Tile};
use airlight_formats::volume::{self, VdbWriteOptions, write_vdb};
use glam::{DAffine3, DMat3, DVec3, IVec3, UVec3};

const ALL: [VdbWriteOptions; 4] = [
    VdbWriteOptions { half: false, zip: false },
    VdbWriteOptions { half: false, zip: true },
    VdbWriteOptions { half: true, zip: false },
    VdbWriteOptions { half: true, zip: true },
];

fn slanted() -> DAffine3 {
    let m = DMat3::from_cols(DVec3::new(0.5, 0.1, 0.0), DVec3::new(0.0, 0.25, 0.2), DVec3::new(0.3, 0.0, -2.0));
    DAffine3::from_mat3_translation(m, DVec3::new(1.0, -2.0, 3.0))
}

/// 19 × 11 × 27 voxels from (-5, 3, -30), exact as half, zero but for two clumps.
fn clumps() -> Grid {
    let (min, dims) = (IVec3::new(-5, 3, -30), UVec3::new(19, 11, 27));
    let value = |n: u32| {
        let (i, j, k) = (n % dims.x, n / dims.x % dims.y, n / (dims.x * dims.y));
        let on = i < 3 && k < 4 || i == 18 && j == 10 && k == 26;
        if on { (1 + i + 3 * j + 40 * k) as f32 / 16.0 } else { 0.0 }
    };
    let values = (0..dims.element_product()).map(value).collect();
    Grid::new(IndexBox { min, dims }, slanted(), Storage::Dense(values)).unwrap()
}

#[test]
fn a_dense_grid_comes_back_without_its_empty_bricks() {
    let folder = tempfile::tempdir().unwrap();
    let (path, grid) = (folder.path().join("out.vdb"), clumps());
    for options in ALL {
        write_vdb(&path, &[("density", &grid)], options).unwrap();
        let read = volume::read(&path, None).unwrap().grid;
        assert_eq!(read.index_to_world(), grid.index_to_world());
        // The clumps reach every face, so that the active bounds are the grid's own.
        let bounds = IndexBox { min: grid.bounds().min - 1, dims: grid.bounds().dims + 2 };
        assert_eq!(read.bounds(), bounds, "{options:?}");
        for z in 0..bounds.dims.z as i32 {
            for y in 0..bounds.dims.y as i32 {
                for x in 0..bounds.dims.x as i32 {
                    let p = bounds.min + IVec3::new(x, y, z);
                    assert_eq!(at(&read, p.x, p.y, p.z), at(&grid, p.x, p.y, p.z), "{options:?}: {p}");
                }
            }
        }
        // x from -8 on: bricks at -8 for the first clump (2 of y), one for the last voxel.
        let Storage::Sparse { bricks, .. } = read.storage() else { panic!("a .vdb became dense") };
        assert_eq!(bricks.len(), 2 + 1);
        let told = &volume::inspect(&path).unwrap().grids[0];
        assert_eq!(told.class, "fog volume");
        assert_eq!(told.active_voxels, Some(3 * 11 * 4 + 1));
        assert_eq!(told.encoding, if options.zip { "zip + active mask" } else { "raw + active mask" });
    }
}

#[test]
fn straight_maps_come_back_as_they_were() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.vdb");
    for scale in [DVec3::splat(0.125), DVec3::new(0.1, 0.2, -0.3)] {
        let map = DAffine3::from_mat3_translation(DMat3::from_diagonal(scale), DVec3::new(7.0, 8.0, 9.0));
        let grid = Grid::dense(UVec3::new(2, 1, 1), map, vec![1.0, 2.0]).unwrap();
        write_vdb(&path, &[("a", &grid)], ALL[0]).unwrap();
        assert_eq!(volume::read(&path, None).unwrap().grid.index_to_world(), map);
    }
}

#[test]
fn tiles_and_what_lies_over_them_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.vdb");
    let mut values = Box::new([0.0f32; 512]);
    values[1 + 8 * 2 + 64 * 3] = 9.0;
    let storage = Storage::Sparse {
        background: 0.0,
        bricks: vec![Brick { origin: IVec3::new(4096 + 256, 8, 16), values }],
        tiles: vec![
            Tile { origin: IVec3::new(4096 + 128, 0, 0), side: 8, value: 3.0 },
            Tile { origin: IVec3::new(4096 + 128, 0, 0), side: 128, value: 2.0 },
            Tile { origin: IVec3::new(4096, 0, 0), side: 4096, value: 1.0 },
            Tile { origin: IVec3::new(-4096, 0, 0), side: 4096, value: 0.5 },
        ],
    };
    let bounds = IndexBox { min: IVec3::new(-4096, 0, 0), dims: UVec3::new(3 * 4096, 4096, 4096) };
    let grid = Grid::new(bounds, DAffine3::IDENTITY, storage).unwrap();
    for options in ALL {
        write_vdb(&path, &[("density", &grid)], options).unwrap();
        let read = volume::read(&path, None).unwrap().grid;
        for (p, truth) in [
            ([-1, 5, 6], 0.5),
            ([4096, 0, 0], 1.0),
            ([8191, 4095, 4095], 1.0),
            ([4096 + 128, 0, 0], 3.0),
            ([4096 + 135, 7, 7], 3.0),
            ([4096 + 136, 0, 0], 2.0),
            ([4096 + 255, 127, 127], 2.0),
            ([4096 + 257, 10, 19], 9.0),
            // The rest of the brick is background over the tile, which goes on beside it.
            ([4096 + 256, 10, 19], 0.0),
            ([4096 + 264, 10, 19], 1.0),
            ([4096 + 256, 7, 16], 1.0),
        ] {
            assert_eq!(at(&read, p[0], p[1], p[2]), truth, "{options:?}: {p:?}");
        }
    }
}

#[test]
fn files_of_the_library_survive_a_round() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.vdb");
    for name in ["tiles.vdb", "affine.vdb", "half-blosc.vdb", "empty.vdb"] {
        let grid = volume::read(fixture(name), None).unwrap().grid;
        write_vdb(&path, &[("density", &grid)], ALL[1]).unwrap();
        let again = volume::read(&path, None).unwrap().grid;
        assert_eq!(again.bounds(), grid.bounds(), "{name}");
        assert_eq!(again.index_to_world(), grid.index_to_world(), "{name}");
        match (again.storage(), grid.storage()) {
            (Storage::Sparse { tiles: a, bricks: p, .. }, Storage::Sparse { tiles: b, bricks: q, .. }) => {
                assert_eq!(a.len(), b.len(), "{name}");
                assert!(p.len() == q.len(), "{name}");
                assert!(p == q, "{name}: bricks differ");
            }
            _ => panic!("{name} became dense"),
        }
    }
    let grid = volume::read(reference("density.nrrd"), None).unwrap().grid;
    write_vdb(&path, &[("density", &grid)], ALL[1]).unwrap();
    assert!(dense(&volume::read(&path, None).unwrap().grid) == dense(&grid));
}

#[test]
fn values_outside_the_bounds_stay_outside() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.vdb");
    let bricks = vec![Brick { origin: IVec3::ZERO, values: Box::new([1.0; 512]) }];
    let storage = Storage::Sparse { background: 0.0, bricks, tiles: Vec::new() };
    let bounds = IndexBox { min: IVec3::new(1, 2, 3), dims: UVec3::new(4, 3, 2) };
    write_vdb(&path, &[("a", &Grid::new(bounds, DAffine3::IDENTITY, storage).unwrap())], ALL[0]).unwrap();
    let read = volume::read(&path, None).unwrap().grid;
    assert_eq!(read.bounds(), IndexBox { min: bounds.min - 1, dims: bounds.dims + 2 });
    assert_eq!(dense(&read).iter().sum::<f32>(), 24.0);
}

#[test]
fn several_grids_and_equal_bytes_for_equal_grids() {
    let folder = tempfile::tempdir().unwrap();
    let (path, other) = (folder.path().join("a.vdb"), folder.path().join("b.vdb"));
    let (grid, heat) = (clumps(), Grid::dense(UVec3::ONE, slanted(), vec![300.0]).unwrap());
    let grids = [("density", &grid), ("temperature", &heat)];
    write_vdb(&path, &grids, ALL[0]).unwrap();
    write_vdb(&other, &grids, ALL[0]).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), std::fs::read(&other).unwrap());
    assert_eq!(at(&volume::read(&path, Some("temperature")).unwrap().grid, 0, 0, 0), 300.0);
    assert!(volume::read(&path, None).unwrap().name == "density");
}

#[test]
fn a_file_appears_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.vdb");
    std::fs::write(&path, "before").unwrap();
    let large = Grid::dense(UVec3::new(2, 1, 1), DAffine3::IDENTITY, vec![1.0, 70000.0]).unwrap();
    let error = message(write_vdb(&path, &[("density", &large)], ALL[2]));
    assert!(error.contains("grid 'density'") && error.contains("70000") && error.contains("65504"), "{error}");
    for names in [&["a", "a"][..], &[""], &[]] {
        let grids: Vec<_> = names.iter().map(|name| (*name, &large)).collect();
        message(write_vdb(&path, &grids, ALL[0]));
    }
    let odd = Storage::Sparse {
        background: 0.0,
        bricks: Vec::new(),
        tiles: vec![Tile { origin: IVec3::splat(8), side: 16, value: 1.0 }],
    };
    let bounds = IndexBox { min: IVec3::ZERO, dims: UVec3::splat(64) };
    let odd = Grid::new(bounds, DAffine3::IDENTITY, odd).unwrap();
    let error = message(write_vdb(&path, &[("a", &odd)], ALL[0]));
    assert!(error.contains("16³") && error.contains("128³"), "{error}");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "before");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "something was left behind");
    let nowhere = folder.path().join("no/such/folder.vdb");
    assert!(message(write_vdb(&nowhere, &[("a", &large)], ALL[0])).contains("folder.vdb"));
    // A path that a file cannot replace: the temporary file must go too.
    let blocked = folder.path().join("blocked");
    std::fs::create_dir(&blocked).unwrap();
    message(write_vdb(&blocked, &[("a", &large)], ALL[0]));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "something was left behind");
}
