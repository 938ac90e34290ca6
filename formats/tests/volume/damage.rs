//! Files that are cut, flipped in a bit, or that claim what they do not hold: an error or a volume, never a panic,
//! never memory on the word of a header.

use airlight_core::media::{Grid, Storage};
use airlight_formats::error::FormatError;
use airlight_formats::volume::{VdbWriteOptions, encode_vdb};

use crate::build::{Nifti, counted, gzip, values, vol, zlib};
use crate::common::{at, fixture, message, parse, reference};
use std::io::ErrorKind;
use std::path::Path;

/// No file of these tests has a right to more than this: they are at most 0.6 MB, and what is read of them is at most
/// the reference grid's 0.8 MB, with bricks at 16 times a leaf's masks.
const MOST: u64 = 64 << 20;

/// Reads; panics where a file asked for more memory than there is or got more than it may.
fn survive(name: &str, bytes: &[u8]) {
    match parse(name, bytes) {
        Ok(volume) => assert!(volume.grid.bytes() < MOST, "{name}: {} bytes", volume.grid.bytes()),
        Err(FormatError::Io { source, .. }) if source.kind() == ErrorKind::OutOfMemory => panic!("{name}: {source}"),
        Err(error) => assert!(error.to_string().len() < 2000, "{name}: {error}"),
    }
}

/// Cuts and flips at every offset below `dense`, and at every `stride`th after it; files below a kilobyte lose every
/// bit once, larger ones one bit of each byte.
fn damage(name: &str, bytes: &[u8], dense: usize, stride: usize) {
    parse(name, bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
    let offsets = || (0..bytes.len()).filter(|n| *n < dense || n % stride == 0);
    for cut in offsets() {
        survive(name, &bytes[..cut]);
    }
    let mut flipped = bytes.to_vec();
    for at in offsets() {
        for bit in if bytes.len() < 1024 { 0..8 } else { at % 8..at % 8 + 1 } {
            flipped[at] ^= 1 << bit;
            survive(name, &flipped);
            flipped[at] ^= 1 << bit;
        }
        // All bits: the largest and the negative numbers.
        let before = std::mem::replace(&mut flipped[at], 0xff);
        survive(name, &flipped);
        flipped[at] = before;
    }
}

#[test]
fn small_dense_files_at_every_bit() {
    let dims = [4, 2, 3];
    let data = values(&counted(dims), 2, false);
    let nrrd = "NRRD0004\ntype: short\ndimension: 3\nsizes: 4 2 3\nendian: little\nspacings: 1 2 3\n";
    damage("a.nrrd", &[nrrd.as_bytes(), b"encoding: raw\n\n", &data].concat(), usize::MAX, 1);
    damage("b.nrrd", &[nrrd.as_bytes(), b"encoding: gzip\n\n", &gzip(&data)].concat(), usize::MAX, 1);
    damage("c.nrrd", &[nrrd.as_bytes(), b"encoding: text\n\n", "12 ".repeat(24).as_bytes()].concat(), usize::MAX, 1);
    let nifti = Nifti::new(false, [4, 2, 3], 4).file(&data);
    damage("a.nii", &nifti, usize::MAX, 1);
    damage("a.nii.gz", &gzip(&nifti), usize::MAX, 1);
    let meta = "ObjectType = Image\nNDims = 3\nDimSize = 4 2 3\nElementType = MET_SHORT\nOffset = 1 2 3\n";
    damage("a.mha", &[meta.as_bytes(), b"ElementDataFile = LOCAL\n", &data].concat(), usize::MAX, 1);
    let packed = [meta.as_bytes(), b"CompressedData = True\nElementDataFile = LOCAL\n", &zlib(&data)].concat();
    damage("b.mha", &packed, usize::MAX, 1);
    damage("a.vol", &vol([4, 2, 3], &values(&counted(dims), 8, false)), usize::MAX, 1);
}

#[test]
fn every_fixture_sampled() {
    // Headers densely; then the masks and values at a prime stride, so that all kinds of bytes are met.
    for name in [
        "affine.vdb",
        "tiles.vdb",
        "half-blosc.vdb",
        "empty.vdb",
        "several.vdb",
        "stream.vdb",
        "inactive-zip-mask.vdb",
        "inactive-blosc-half.vdb",
        "inactive-mask-half.vdb",
    ] {
        let bytes = std::fs::read(fixture(name)).unwrap();
        let bytes = if name == "stream.vdb" { only_grid(&bytes) } else { bytes };
        damage(name, &bytes, 700, 61);
    }
}

/// A stream of several grids, none of them "density": renames its second.
fn only_grid(bytes: &[u8]) -> Vec<u8> {
    let text = |from: &str| bytes.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
    let at = text("second") - 4;
    [&bytes[..at], &[7, 0, 0, 0], b"density", &bytes[at + 10..]].concat()
}

#[test]
fn reference_files_sampled() {
    for name in [
        "density.vdb",
        "density_zip.vdb",
        "density_blosc.vdb",
        "density_half.vdb",
        "density_half_zip.vdb",
        "density_half_none.vdb",
        "density.nrrd",
        "density.vol",
    ] {
        let bytes = std::fs::read(reference(name)).unwrap();
        damage(name, &bytes, 0, bytes.len() / 40);
    }
}

/// A small fog volume of ours without a 10 kB of masks between its parts cannot be had; this one has few bytes else.
#[test]
fn a_written_file_at_every_byte() {
    let numbers: Vec<f32> = counted([4, 2, 3]).iter().map(|n| *n as f32).collect();
    let grid = Grid::dense(glam::UVec3::new(4, 2, 3), glam::DAffine3::IDENTITY, numbers).unwrap();
    for zip in [false, true] {
        let bytes = encode_vdb(Path::new("a"), &[("density", &grid)], VdbWriteOptions { half: false, zip }).unwrap();
        damage("a.vdb", &bytes, 800, 7);
        let tail = bytes.len() - 800;
        for at in tail..bytes.len() {
            survive("a.vdb", &bytes[..at]);
        }
    }
}

#[test]
fn claims_of_a_million_voxels_a_side() {
    let side = 1_000_000;
    let small = [7u8; 64];
    for encoding in ["raw", "gzip", "text"] {
        let data = if encoding == "gzip" { gzip(&small) } else { small.to_vec() };
        let header = format!(
            "NRRD0004\ntype: double\nendian: big\ndimension: 3\nsizes: {side} {side} {side}\nencoding: {encoding}\n\n"
        );
        message(parse("a.nrrd", &[header.as_bytes(), &data].concat()));
        survive("a.nrrd", &[header.as_bytes(), &data].concat());
    }
    let nifti = Nifti::new(false, [i16::MAX; 3], 64).file(&small);
    for file in [nifti.clone(), gzip(&nifti)] {
        message(parse("a.nii", &file));
        survive("a.nii", &file);
    }
    for compressed in ["False", "True"] {
        let header = format!(
            "NDims = 3\nDimSize = {side} {side} {side}\nElementType = MET_FLOAT\nCompressedData = {compressed}\n\
             ElementDataFile = LOCAL\n"
        );
        let file = [header.as_bytes(), &zlib(&small)].concat();
        message(parse("a.mha", &file));
        survive("a.mha", &file);
    }
    message(parse("a.vol", &vol([side; 3], &small)));
    survive("a.vol", &vol([side; 3], &small));
}

#[test]
fn two_voxels_at_the_ends_of_the_index_space_cost_two_bricks() {
    let bytes = std::fs::read(fixture("tiles.vdb")).unwrap();
    // The root's tile at 0: moved as far as indices go, less the room for a border.
    let key = bytes.windows(17).position(|w| w[..12] == [0; 12] && w[12..16] == 0.5f32.to_le_bytes() && w[16] == 1);
    let key = key.unwrap();
    let mut far = bytes.clone();
    far[key..key + 4].copy_from_slice(&(i32::MAX - 2 * 4096 + 1).to_le_bytes());
    let grid = parse("far.vdb", &far).unwrap().grid;
    assert!(grid.bytes() < 4096 && matches!(grid.storage(), Storage::Sparse { .. }));
    assert_eq!(at(&grid, i32::MAX - 4096, 0, 0), 0.5);
    far[key..key + 4].copy_from_slice(&(i32::MAX - 4095).to_le_bytes());
    assert!(message(parse("far.vdb", &far)).contains("no room for a border"));
    far[key..key + 4].copy_from_slice(&17i32.to_le_bytes());
    assert!(message(parse("far.vdb", &far)).contains("multiple of 4096"));
    far[key..key + 4].copy_from_slice(&(-8192i32).to_le_bytes());
    far[key + 4..key + 12].copy_from_slice(&[0; 8]);
    survive("far.vdb", &far);
}
