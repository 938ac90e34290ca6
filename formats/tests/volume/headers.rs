//! Headers of random content, written and read back.

use proptest::prelude::*;

use glam::{DVec3, UVec3};

use crate::build::{Nifti, TYPES, counted, gzip, values, vol};
use crate::common::{dense, parse};

fn dims() -> impl Strategy<Value = [u32; 3]> {
    [1u32..7, 1u32..6, 1u32..5]
}

/// Three steps that span a volume, and an origin; exact as f32.
fn placement() -> impl Strategy<Value = ([DVec3; 3], DVec3)> {
    let part = || (-64i32..64).prop_map(|n| f64::from(n) / 16.0);
    let vector = move || [part(), part(), part()].prop_map(DVec3::from_array);
    ([vector(), vector(), vector()], vector()).prop_filter("flat", |(m, _)| m[0].cross(m[1]).dot(m[2]).abs() > 1e-2)
}

fn show(v: DVec3) -> String {
    format!("({},{},{})", v.x, v.y, v.z)
}

proptest! {
    #[test]
    fn nrrd(dims in dims(), kind in 0usize..10, big: bool, packed: bool, place in placement(), comment in "[ -~]{0,30}") {
        let (steps, origin) = place;
        let header = format!(
            "NRRD0005\n#{comment}\nsizes: {} {} {}\ntype: {}\nencoding: {}\nendian: {}\ndimension: 3\n\
             space dimension: 3\nspace directions: {} {} {}\nspace origin: {}\nkey:={comment}\n\n",
            dims[0], dims[1], dims[2], TYPES[kind].0,
            if packed { "gzip" } else { "raw" }, if big { "big" } else { "little" },
            show(steps[0]), show(steps[1]), show(steps[2]), show(origin),
        );
        let data = values(&counted(dims), kind, big);
        let data = if packed { gzip(&data) } else { data };
        let volume = parse("a.nrrd", &[header.as_bytes(), &data].concat()).unwrap();
        check(&volume.grid, dims, steps, origin);
    }

    #[test]
    fn nifti(dims in dims(), kind in 0usize..10, big: bool, packed: bool, place in placement()) {
        let (steps, origin) = place;
        let mut header = Nifti::new(big, dims.map(|n| n as i16), TYPES[kind].1);
        header.bytes[123] = 1;
        header.i16(254, 1);
        for row in 0..3 {
            let numbers = [steps[0][row], steps[1][row], steps[2][row], origin[row]];
            numbers.iter().enumerate().for_each(|(n, x)| header.f32(280 + 16 * row + 4 * n, *x as f32));
        }
        let file = header.file(&values(&counted(dims), kind, big));
        let volume = parse("a.nii", &if packed { gzip(&file) } else { file }).unwrap();
        check(&volume.grid, dims, steps, origin);
    }

    #[test]
    fn metaimage(dims in dims(), kind in 0usize..10, big: bool, place in placement()) {
        let (steps, origin) = place;
        let plain = |v: DVec3| format!("{} {} {}", v.x, v.y, v.z);
        let header = format!(
            "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = {}\nTransformMatrix = {} {} {}\n\
             Offset = {}\nDimSize = {} {} {}\nElementType = {}\nElementDataFile = LOCAL\n",
            if big { "True" } else { "False" }, plain(steps[0]), plain(steps[1]), plain(steps[2]), plain(origin),
            dims[0], dims[1], dims[2], TYPES[kind].2,
        );
        let data = values(&counted(dims), kind, big);
        let volume = parse("a.mha", &[header.as_bytes(), &data].concat()).unwrap();
        check(&volume.grid, dims, steps, origin);
    }

    #[test]
    fn vol_files(dims in dims()) {
        let file = vol(dims.map(|n| n as i32), &values(&counted(dims), 8, false));
        let edge = DVec3::new(2.0, 3.0, 2.0) / UVec3::from_array(dims).as_dvec3();
        let steps = [DVec3::X * edge.x, DVec3::Y * edge.y, DVec3::Z * edge.z];
        check(&parse("a.vol", &file).unwrap().grid, dims, steps, DVec3::new(-1.0, 0.0, 2.0) + 0.5 * edge);
    }

    /// Lines of anything after the tag: an error or a volume, never a panic.
    #[test]
    fn lines_of_anything(text in "(dimension|sizes|type|encoding|space directions|[ -~]{1,9})(: |=|:=)[ -~]{0,20}(\n[ -~]{0,30}){0,6}") {
        for tag in ["NRRD0004\n", "NDims = 3\n"] {
            parse("a.nrrd", format!("{tag}{text}").as_bytes()).ok();
        }
    }
}

fn check(grid: &airlight_core::media::Grid, dims: [u32; 3], steps: [DVec3; 3], origin: DVec3) {
    assert_eq!(grid.bounds().dims, UVec3::from_array(dims));
    let map = grid.index_to_world();
    assert_eq!([map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis], steps);
    assert_eq!(map.translation, origin);
    let truth: Vec<f32> = counted(dims).iter().map(|n| *n as f32).collect();
    assert_eq!(dense(grid), truth);
}
