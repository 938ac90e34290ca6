//! NRRD, NIfTI-1, MetaImage and VOL.

use std::path::Path;

use airlight_formats::error::FormatError;
use airlight_formats::volume::{self, Format, Volume};
use glam::{DAffine3, DVec3, UVec3};

use crate::build::{Nifti, TYPES, counted, gzip, values, vol, zlib};
use crate::common::{dense, message, parse};

const DIMS: [u32; 3] = [4, 2, 3];

/// Reads `bytes`, of the format that they are of, with `data` as the one file that they may point to.
fn with_data(bytes: &[u8], data: &[u8]) -> Result<Volume, FormatError> {
    let path = Path::new("header");
    let format = volume::detect(path, bytes)?;
    volume::parse(format, path, bytes, None, &|name| {
        assert_eq!(name, "data.raw");
        Ok(data.to_vec())
    })
}

fn check(volume: &Volume) {
    assert_eq!(volume.name, "density");
    assert_eq!(volume.grid.bounds().dims, UVec3::from_array(DIMS));
    let truth: Vec<f32> = counted(DIMS).iter().map(|n| *n as f32).collect();
    assert_eq!(dense(&volume.grid), truth);
}

/// Where the map of `volume` takes an asymmetric index.
fn taken(volume: &Volume) -> DVec3 {
    volume.grid.index_to_world().transform_point3(DVec3::new(1.0, 2.0, 3.0))
}

fn close(a: DVec3, b: DVec3) {
    // NIfTI's numbers are f32.
    assert!(a.distance(b) < 1e-6 * (1.0 + b.length()), "{a} against {b}");
}

fn nrrd(fields: &str) -> String {
    format!("NRRD0004\n# a comment\ndimension: 3\nsizes: 4 2 3\n{fields}\nword:=another: word\n")
}

fn mhd(fields: &str, file: &str) -> String {
    format!("ObjectType = Image\nNDims = 3\nDimSize = 4 2 3\n{fields}\nElementDataFile = {file}\n")
}

#[test]
fn every_type_in_both_byte_orders() {
    for (kind, (in_nrrd, code, in_mhd)) in TYPES.into_iter().enumerate() {
        for big in [false, true] {
            let data = values(&counted(DIMS), kind, big);
            let order = if big { "big" } else { "little" };
            for (encoding, packed) in [("raw", data.clone()), ("gzip", gzip(&data)), ("gz", gzip(&data))] {
                let header = nrrd(&format!("type: {in_nrrd}\nendian: {order}\nencoding: {encoding}"));
                check(&parse("a.nrrd", &[header.as_bytes(), b"\n", &packed].concat()).unwrap());
                let detached = format!("{header}datafile: data.raw\n");
                check(&with_data(detached.as_bytes(), &packed).unwrap());
            }
            let file = Nifti::new(big, DIMS.map(|n| n as i16), code).file(&data);
            check(&parse("a.nii", &file).unwrap());
            check(&parse("a.nii.gz", &gzip(&file)).unwrap());
            let header =
                format!("ElementType = {in_mhd}\nElementByteOrderMSB = {}", if big { "True" } else { "False" });
            check(&with_data(mhd(&header, "data.raw").as_bytes(), &data).unwrap());
            check(&parse("a.mha", &[mhd(&header, "LOCAL").as_bytes(), &data].concat()).unwrap());
            let header = format!("{header}\nCompressedData = True");
            check(&with_data(mhd(&header, "data.raw").as_bytes(), &zlib(&data)).unwrap());
        }
    }
    check(&parse("a.vol", &vol(DIMS.map(|n| n as i32), &values(&counted(DIMS), 8, false))).unwrap());
}

#[test]
fn text_values() {
    let words: Vec<String> = counted(DIMS).iter().map(|n| format!("{n}.0")).collect();
    let data = words.join(" \n");
    check(&parse("a.nrrd", format!("{}\n{data}", nrrd("type: float\nencoding: ascii")).as_bytes()).unwrap());
    let header = mhd("ElementType = MET_FLOAT\nBinaryData = False", "data.raw");
    check(&with_data(header.as_bytes(), data.as_bytes()).unwrap());
    let wrong = data.replacen("2.0", "two", 1);
    let error = message(parse("a.nrrd", format!("{}\n{wrong}", nrrd("type: float\nencoding: text")).as_bytes()));
    assert!(error.contains("value 3") && error.contains("'two'"), "{error}");
    let few = &data[..60];
    let error = message(parse("a.nrrd", format!("{}\n{few}", nrrd("type: float\nencoding: text")).as_bytes()));
    assert!(error.contains("24 numbers"), "{error}");
}

#[test]
fn bytes_and_lines_before_the_data_are_skipped() {
    let data = values(&counted(DIMS), 2, false);
    let kind = "type: short\nendian: little";
    let file = [b"one line\nand another\nxyz", &data[..]].concat();
    let header = nrrd(&format!("{kind}\nencoding: raw\nline skip: 2\nbyte skip: 3\ndata file: data.raw"));
    check(&with_data(header.as_bytes(), &file).unwrap());
    let header = nrrd(&format!("{kind}\nencoding: raw\nbyteskip: -1\ndata file: data.raw"));
    check(&with_data(header.as_bytes(), &file).unwrap());
    let header = nrrd(&format!("{kind}\nencoding: gzip\nline skip: 1\nbyte skip: 5\ndata file: data.raw"));
    let packed = [b"a line\n", &gzip(&[b"12345", &data[..]].concat())[..]].concat();
    check(&with_data(header.as_bytes(), &packed).unwrap());
    let header = mhd("ElementType = MET_SHORT\nHeaderSize = 24", "data.raw");
    check(&with_data(header.as_bytes(), &file).unwrap());
    let header = mhd("ElementType = MET_SHORT\nHeaderSize = -1", "data.raw");
    check(&with_data(header.as_bytes(), &file).unwrap());
    let mut header = Nifti::new(false, [4, 2, 3], 4);
    header.f32(108, 400.0);
    check(&parse("a.nii", &header.file(&[&[9; 48], &data[..]].concat())).unwrap());
}

#[test]
fn line_ends_of_windows() {
    let data = values(&counted(DIMS), 1, false);
    let header = nrrd("type: uchar\nencoding: raw").replace('\n', "\r\n");
    check(&parse("a.nrrd", &[header.as_bytes(), b"\r\n", &data].concat()).unwrap());
    let header = mhd("ElementType = MET_UCHAR", "LOCAL").replace('\n', "\r\n");
    check(&parse("a.mha", &[header.as_bytes(), &data].concat()).unwrap());
}

fn placed_nrrd(fields: &str) -> Volume {
    let data = values(&counted(DIMS), 1, false);
    let header = nrrd(&format!("type: uchar\nencoding: raw\n{fields}"));
    let volume = parse("a.nrrd", &[header.as_bytes(), b"\n", &data].concat()).unwrap_or_else(|e| panic!("{e}"));
    check(&volume);
    volume
}

#[test]
fn places_of_nrrd() {
    let directions = "space: left-posterior-superior\nspace directions: (2,0,0) (0,0,-3) (0.5, 4, 0)";
    // 1 (2,0,0) + 2 (0,0,-3) + 3 (0.5,4,0) + (7,8,9)
    let truth = DVec3::new(2.0 + 1.5, 12.0, -6.0);
    close(taken(&placed_nrrd(&format!("{directions}\nspace origin: (7,8,9)"))), truth + DVec3::new(7.0, 8.0, 9.0));
    close(taken(&placed_nrrd(directions)), truth);
    let units = format!("{directions}\nspace origin: (7,8,9)\nspace units: \"mm\" \"mm\" \"cm\"");
    close(taken(&placed_nrrd(&units)), DVec3::new(0.0105, 0.020, 0.03));
    close(taken(&placed_nrrd("spacings: 2 3 0.5")), DVec3::new(2.0, 6.0, 1.5));
    close(taken(&placed_nrrd("spacings: 2 3 0.5\nunits: \"mm\" \"\" \"um\"")), DVec3::new(2e-3, 6.0, 1.5e-6));
    // Samples in cells begin half a step after the minimum, samples at nodes at it.
    let mins = "spacings: 2 3 0.5\naxis mins: 10 20 30\ncenters: cell node ???";
    close(taken(&placed_nrrd(mins)), DVec3::new(13.0, 26.0, 31.75));
    let ends = "axis mins: 10 20 30\naxis maxs: 18 23 33\ncenters: cell node cell";
    close(taken(&placed_nrrd(ends)), DVec3::new(13.0, 26.0, 33.5));
    for none in ["#", "spacings: nan nan NaN"] {
        let volume = placed_nrrd(none);
        assert!(!volume.placed);
        assert_eq!(volume.grid.index_to_world(), DAffine3::from_translation(DVec3::splat(0.5)));
    }
}

#[test]
fn a_dimension_of_one_is_no_hindrance() {
    let data = values(&counted(DIMS), 1, false);
    for fields in [
        "dimension: 4\nsizes: 4 2 3 1",
        "dimension: 4\nsizes: 1 4 2 3",
        "dimension: 5\nsizes: 1 4 2 3 1\nspace directions: none (1,0,0) (0,1,0) (0,0,1) none",
        "dimension: 4\nsizes: 1 4 2 3\nspacings: nan 1 1 1",
    ] {
        let header = format!("NRRD0005\ntype: uchar\nencoding: raw\n{fields}\n\n");
        check(&parse("a.nrrd", &[header.as_bytes(), &data].concat()).unwrap_or_else(|e| panic!("{fields}: {e}")));
    }
    let mut header = Nifti::new(false, [4, 2, 3], 2);
    header.i16(40, 4);
    check(&parse("a.nii", &header.file(&data)).unwrap());
    header.i16(48, 2);
    assert!(message(parse("a.nii", &header.file(&data))).contains("2 values along dimension 4"));
    let header =
        "NDims = 4\nDimSize = 4 2 3 1\nElementType = MET_UCHAR\nElementSpacing = 1 2 3 4\nElementDataFile = LOCAL\n";
    let volume = parse("a.mha", &[header.as_bytes(), &data].concat()).unwrap();
    check(&volume);
    close(taken(&volume), DVec3::new(1.0, 4.0, 9.0));
    let header = header.replace("3 1\n", "3 2\n");
    assert!(message(parse("a.mha", &[header.as_bytes(), &data].concat())).contains("2 values along dimension 4"));
}

#[test]
fn places_of_nifti() {
    let data = values(&counted(DIMS), 1, false);
    let header = Nifti::new(true, [4, 2, 3], 2);
    let read = |header: &Nifti| taken(&parse("a.nii", &header.file(&data)).unwrap());
    // Millimetres, and no more than spacings.
    let mut plain = header.clone();
    plain.f32(80, 2.0);
    close(read(&plain), DVec3::new(2e-3, 2e-3, 3e-3));
    for (unit, metre) in [(0, 1e-3), (1, 1.0), (3, 1e-6)] {
        plain.bytes[123] = unit | 8;
        close(read(&plain), DVec3::new(2.0, 2.0, 3.0) * metre);
    }
    // A quarter turn about z: x to y, y to -x. Negative qfac mirrors the third axis.
    let mut turned = plain.clone();
    turned.bytes[123] = 1;
    turned.i16(252, 1);
    turned.f32(264, 0.5f32.sqrt());
    [10.0, 20.0, 30.0].iter().enumerate().for_each(|(n, x)| turned.f32(268 + 4 * n, *x));
    close(read(&turned), DVec3::new(10.0 - 2.0, 20.0 + 2.0, 33.0));
    turned.f32(76, -1.0);
    close(read(&turned), DVec3::new(8.0, 22.0, 27.0));
    // sform goes before qform.
    let mut rows = turned.clone();
    rows.i16(254, 2);
    let numbers = [2.0, 0.0, 0.5, 7.0, 0.0, 0.0, 4.0, 8.0, 0.0, -3.0, 0.0, 9.0];
    numbers.iter().enumerate().for_each(|(n, x)| rows.f32(280 + 4 * n, *x));
    close(read(&rows), DVec3::new(2.0 + 1.5 + 7.0, 20.0, 3.0));
    // Nothing at all.
    let mut none = header.clone();
    (0..4).for_each(|n| none.f32(76 + 4 * n, 0.0));
    let volume = parse("a.nii", &none.file(&data)).unwrap();
    assert!(!volume.placed);
    assert_eq!(volume.grid.index_to_world(), DAffine3::from_translation(DVec3::splat(0.5)));
}

#[test]
fn nifti_values_are_scaled() {
    let data = values(&counted(DIMS), 2, false);
    let mut header = Nifti::new(false, [4, 2, 3], 4);
    for (slope, intercept, factor, offset) in
        [(0.5, -3.0, 0.5, -3.0), (0.0, 7.0, 1.0, 0.0), (f32::NAN, 1.0, 1.0, 0.0), (1.0, 2.0, 1.0, 2.0)]
    {
        header.f32(112, slope);
        header.f32(116, intercept);
        let truth: Vec<f32> = counted(DIMS).iter().map(|n| *n as f32 * factor + offset).collect();
        assert_eq!(dense(&parse("a.nii", &header.file(&data)).unwrap().grid), truth, "{slope} {intercept}");
    }
}

#[test]
fn places_of_metaimage_and_vol() {
    let data = values(&counted(DIMS), 1, false);
    let read = |fields: &str| {
        let header = mhd(&format!("ElementType = MET_UCHAR\n{fields}"), "LOCAL");
        let volume = parse("a.mha", &[header.as_bytes(), &data].concat()).unwrap();
        check(&volume);
        volume
    };
    close(taken(&read("ElementSpacing = 2 3 0.5\nOffset = 7 8 9")), DVec3::new(9.0, 14.0, 10.5));
    close(taken(&read("ElementSize = 2 3 0.5")), DVec3::new(2.0, 6.0, 1.5));
    // The rows are the directions of the index axes: x to y, y to -x.
    let turned = "TransformMatrix = 0 1 0 -1 0 0 0 0 1\nElementSpacing = 2 3 0.5\nPosition = 7 8 9";
    close(taken(&read(turned)), DVec3::new(7.0 - 6.0, 8.0 + 2.0, 10.5));
    assert!(!read("").placed);
    let volume = parse("a.vol", &vol([4, 2, 3], &values(&counted(DIMS), 8, false))).unwrap();
    // Half a voxel of (0.5, 1.5, 2/3) into the box from (-1, 0, 2).
    close(taken(&volume), DVec3::new(-0.75 + 0.5, 0.75 + 3.0, 2.0 + 1.0 / 3.0 + 2.0));
}

#[test]
fn faults_say_where_they_are_and_what_would_be_right() {
    let data = values(&counted(DIMS), 1, false);
    let nrrd_error = |from: &str, to: &str| {
        let header = nrrd("type: uchar\nencoding: raw").replace(from, to);
        message(parse("a.nrrd", &[header.as_bytes(), b"\n", &data].concat()))
    };
    for (from, to, parts) in [
        ("uchar", "quark", &["a.nrrd: line 5, 'type'", "quark"][..]),
        ("type: uchar\n", "", &["header field 'type'", "missing"]),
        ("sizes: 4 2 3", "sizes: 4 2", &["'sizes'", "2 sizes for 3"]),
        ("sizes: 4 2 3", "sizes: 4 -2 3", &["'sizes'", "4 × -2 × 3", "from 1 to 2147483647"]),
        ("sizes: 4 2 3", "sizes: 4 2 x", &["line 4, 'sizes'", "'x'"]),
        ("dimension: 3", "dimension: 2", &["'sizes'"]),
        ("encoding: raw", "encoding: bzip2", &["bzip2", "raw, gzip and text"]),
        ("uchar", "short", &["'endian'", "missing"]),
        ("NRRD0004", "NRRD0006", &["NRRD0006", "NRRD0001 to NRRD0005"]),
        ("encoding: raw", "encoding: raw\ndata file: LIST", &["several files"]),
        ("encoding: raw", "encoding: raw\nencoding: raw", &["line 7", "twice"]),
        ("encoding: raw", "encoding: raw\nspace directions: (1,0,0) (0,1,0) (1,1,0)", &["singular"]),
        ("encoding: raw", "encoding: raw\nspace directions: (1,0,0) (0,1,0)", &["2 directions for 3"]),
        ("encoding: raw", "encoding: raw\nbyte skip: 1", &["24 bytes", "cut short"]),
        ("sizes: 4 2 3", "sizes: 1000000 1000000 1000000", &["1000000000000000000 bytes"]),
        ("sizes: 4 2 3", "sizes: 2147483647 2147483647 2147483647", &["more than memory can address"]),
    ] {
        let error = nrrd_error(from, to);
        assert!(parts.iter().all(|part| error.contains(part)), "{to}: {error}");
    }
    let header = mhd("ElementType = MET_UCHAR", "LOCAL");
    for (from, to, parts) in [
        ("MET_UCHAR", "MET_FLOAT_MATRIX", &["MET_FLOAT_MATRIX", "MET_DOUBLE"][..]),
        ("DimSize = 4 2 3", "DimSize = 0 2 3", &["'DimSize'", "0 × 2 × 3"]),
        ("Image", "Tube", &["Tube", "Image"]),
        ("= LOCAL", "= slice%03d.raw 1 3 1", &["several files"]),
        ("= LOCAL", "=", &["ElementDataFile", "empty"]),
        ("ElementDataFile = LOCAL\n", "", &["ElementDataFile"]),
        ("NDims = 3", "NDims = 2", &["2 dimensions"]),
        ("ElementType", "ElementNumberOfChannels = 3\nElementType", &["3 channels"]),
    ] {
        let error = message(parse("a.mha", &[header.replace(from, to).as_bytes(), &data].concat()));
        assert!(parts.iter().all(|part| error.contains(part)), "{to}: {error}");
    }
    let mut nifti = Nifti::new(false, [4, 2, 3], 128);
    assert!(message(parse("a.nii", &nifti.file(&data))).contains("datatype 128 (colours)"));
    nifti.i16(70, 2);
    nifti.f32(108, 17.0);
    assert!(message(parse("a.nii", &nifti.file(&data))).contains("'vox_offset'"));
    nifti.bytes[344..348].copy_from_slice(b"ni1\0");
    assert!(message(parse("a.nii", &nifti.file(&data))).contains(".img"));
    let mut file = vol([4, 2, 3], &data);
    assert!(message(parse("a.vol", &file)).contains("cut short"));
    file[20] = 3;
    assert!(message(parse("a.vol", &file)).contains("3 channels"));
    file[4] = 2;
    assert!(message(parse("a.vol", &file)).contains("half float"));
    file[3] = 4;
    assert!(message(parse("a.vol", &file)).contains("version 4"));
}

#[test]
fn formats_are_known_by_content_first() {
    let data = values(&counted(DIMS), 1, false);
    let header = nrrd("type: uchar\nencoding: raw");
    check(&parse("a.vdb", &[header.as_bytes(), b"\n", &data].concat()).unwrap());
    let detect = |name: &str, bytes: &[u8]| volume::detect(Path::new(name), bytes);
    assert_eq!(detect("a", &gzip(&Nifti::new(true, [4, 2, 3], 2).bytes)).unwrap(), Format::Nifti);
    assert_eq!(detect("scan", b"NDims = 3\n").unwrap(), Format::MetaImage);
    assert!(message(detect("a.vdb", b"hello")).contains("not an OpenVDB file"));
    assert!(message(detect("a.png", b"hello")).contains(".nii.gz"));
    assert!(message(detect("a.vdb", b"")).contains("empty"));
    assert!(message(detect("a.vdb", b"version https://git-lfs.github.com/spec/v1\n")).contains("git lfs pull"));
    let raw = message(detect("smoke.raw", &[1, 2, 3]));
    assert!(raw.contains("smoke.mhd") && raw.contains("ElementDataFile = smoke.raw"), "{raw}");
    // The example in the message is a header that is read.
    let example = &raw[raw.find("ObjectType").unwrap()..];
    let format = detect("smoke.mhd", example.as_bytes()).unwrap();
    let data = vec![0; 256 * 128 * 64 * 4];
    let read = volume::parse(format, Path::new("smoke.mhd"), example.as_bytes(), None, &|name| {
        assert_eq!(name, "smoke.raw");
        Ok(data.clone())
    });
    assert_eq!(read.unwrap().grid.bounds().dims, UVec3::new(256, 128, 64));
}

#[test]
fn files_that_are_no_files() {
    let folder = tempfile::tempdir().unwrap();
    let here = |name: &str| folder.path().join(name);
    std::fs::write(here("empty.vdb"), "").unwrap();
    std::fs::write(here("a.mhd"), mhd("ElementType = MET_UCHAR", "gone.raw")).unwrap();
    std::fs::write(here("b.mhd"), mhd("ElementType = MET_UCHAR", "b.raw")).unwrap();
    std::fs::write(here("b.raw"), values(&counted(DIMS), 1, false)).unwrap();
    for look in [|p: &Path| volume::read(p, None).map(drop), |p: &Path| volume::inspect(p).map(drop)] {
        assert!(message(look(&here("missing.vdb"))).contains("missing.vdb"));
        assert!(message(look(folder.path())).contains("folder"));
        assert!(message(look(&here("empty.vdb"))).contains("empty"));
        look(&here("b.mhd")).unwrap();
    }
    assert!(message(volume::read(here("a.mhd"), None)).contains("gone.raw"));
    check(&volume::read(here("b.mhd"), None).unwrap());
    assert!(message(volume::read(here("b.mhd"), Some("heat"))).contains("no grid 'heat'"));
    #[cfg(unix)]
    assert!(message(volume::read("/dev/zero", None)).contains("not a regular file"));
}
