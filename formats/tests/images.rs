//! Pictures from real files, and back.

use std::fs;
use std::path::{Path, PathBuf};

use airlight_core::scene::Film;
use airlight_formats::image::{
    Exr, ImageFormat, ToneMap, load_environment, read_exr_channels, read_image, write_exr, write_exr_channels,
    write_film,
};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

fn statistics(values: &[f32]) -> (f64, f32, f32) {
    let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64;
    let least = values.iter().copied().fold(f32::INFINITY, f32::min);
    (mean, least, values.iter().copied().fold(f32::NEG_INFINITY, f32::max))
}

fn film() -> Film {
    let (width, height) = (19u32, 11u32);
    let n = (width * height) as usize;
    let value = |i: usize, k: usize| ((i * 7 + k * 13) % 101) as f32 / 50.0;
    Film {
        width,
        height,
        beauty: (0..n).map(|i| [value(i, 0), value(i, 1), value(i, 2), 0.5]).collect(),
        transmittance: (0..n).map(|i| [value(i, 4), value(i, 5), value(i, 6)]).collect(),
        depth: (0..n).map(|i| if i % 5 == 0 { f32::INFINITY } else { i as f32 }).collect(),
    }
}

#[test]
fn decoded_values_are_those_of_the_openexr_library() {
    // Mean, least and largest by OpenEXR 3.4's own decoder; the decoders agree to the last bit, the mean to rounding.
    let cases = [
        ("city-negative.exr", (512, 256), "B", (0.788_127_050_407_638_3_f64, -0.076_599_12_f32, 8.335_937_5_f32)),
        ("sunset.exr", (1024, 512), "R", (0.404_052_853_660_232_36, 1.668_93e-6, 6520.0)),
        ("sunset.exr", (1024, 512), "B", (0.573_105_945_124_893_9, -0.000_338_077_55, 2.476_562_5)),
        ("comp_dwab_v2.exr", (587, 675), "G", (7.525_458_354_813_661, -0.002_441_406_3, 427.75)),
        ("lineOrder_decreasing.exr", (237, 119), "R", (4_347.609_883_677_7, -0.010_002_136, 10_000.0)),
    ];
    for (name, size, channel, expected) in cases {
        let exr = read_exr_channels(&data(name)).unwrap();
        assert_eq!((exr.width, exr.height), size, "{name}");
        let got = statistics(exr.channel(channel).unwrap());
        assert!((got.0 - expected.0).abs() < 1e-12 * expected.0.abs(), "{name} {channel}: {got:?}");
        assert_eq!((got.1, got.2), (expected.1, expected.2), "{name} {channel}");
    }
    let exr = read_exr_channels(&data("sunset.exr")).unwrap();
    assert!(exr.metadata.iter().any(|(k, v)| k == "Software" && v.starts_with("OpenImageIO 1.7.17")));
    assert!(read_exr_channels(&data("comp_dwab_v2.exr")).unwrap().channel("A").unwrap().iter().all(|&a| a == 1.0));
}

#[test]
fn environments_are_clamped_with_a_count() {
    let (environment, warnings) = load_environment(&data("city-negative.exr")).unwrap();
    assert_eq!((environment.image().width, environment.image().height), (512, 256));
    assert_eq!(warnings.len(), 1);
    assert!(
        warnings[0]
            .ends_with("city-negative.exr: 158 of 131072 texels hold negative or non-finite values, which count as 0"),
        "{}",
        warnings[0]
    );
    // The sun stands above the horizon: the upper half is brighter.
    let (sunset, _) = load_environment(&data("sunset.exr")).unwrap();
    let texels = &sunset.image().texels;
    let sum = |t: &[[f32; 3]]| t.iter().map(|t| f64::from(t[1])).sum::<f64>();
    assert!(sum(&texels[..texels.len() / 2]) > 2.0 * sum(&texels[texels.len() / 2..]));
    // Not twice as wide as high, and with the clamping of its own.
    let (_, warnings) = load_environment(&data("lineOrder_decreasing.exr")).unwrap();
    assert!(warnings[1].ends_with("237 × 119 texels; a latitude–longitude picture is twice as wide as high"));
}

#[test]
fn a_film_goes_through_a_file_unchanged() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.exr");
    let film = film();
    let metadata = vec![("device".to_owned(), "cpu:0".to_owned()), ("scene".to_owned(), "Wölkchen.toml".to_owned())];
    write_film(&path, &film, &metadata, ToneMap::default()).unwrap();
    let exr = read_exr_channels(&path).unwrap();
    let names: Vec<_> = exr.channels.iter().map(|(n, _)| n.as_str()).collect();
    assert_eq!(names, ["A", "B", "G", "R", "depth.Z", "transmittance.B", "transmittance.G", "transmittance.R"]);
    assert_eq!(exr.metadata, metadata);
    assert_eq!((exr.width, exr.height), (19, 11));
    for (i, name) in ["R", "G", "B", "A"].into_iter().enumerate() {
        assert!(exr.channel(name).unwrap().iter().zip(&film.beauty).all(|(v, p)| *v == p[i]), "{name}");
    }
    assert!(exr.channel("transmittance.G").unwrap().iter().zip(&film.transmittance).all(|(v, p)| *v == p[1]));
    assert_eq!(exr.channel("depth.Z").unwrap(), film.depth);
    let loaded = read_image(&path).unwrap();
    assert_eq!((loaded.format, loaded.alpha.as_deref()), (ImageFormat::Exr, exr.channel("A")));
    assert_eq!(loaded.image.texels[20], [film.beauty[20][0], film.beauty[20][1], film.beauty[20][2]]);

    let png = folder.path().join("OUT.PNG");
    write_film(&png, &film, &[], ToneMap::default()).unwrap();
    let bytes = fs::read(&png).unwrap();
    assert_eq!(&bytes[..8], b"\x89PNG\r\n\x1a\n");
    assert_eq!(bytes[16..24], [0, 0, 0, 19, 0, 0, 0, 11]);

    let error = write_film(&folder.path().join("out.jpg"), &film, &[], ToneMap::default()).unwrap_err().to_string();
    assert!(error.ends_with("the ending says the format of a picture; write .exr or .png"), "{error}");
    let error = write_exr(&path, &Film { depth: vec![], ..film }, &[]).unwrap_err().to_string();
    assert!(error.ends_with("209 transmittances and 0 depths cannot be written"), "{error}");
    let left: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left.len(), 2, "{left:?}");
}

#[test]
fn what_cannot_be_written_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.exr");
    let exr = |channels: &[(&str, usize)], key: &str| Exr {
        width: 3,
        height: 2,
        channels: channels.iter().map(|&(n, len)| (n.to_owned(), vec![0.25; len])).collect(),
        metadata: vec![(key.to_owned(), String::new())],
    };
    let told = |exr| write_exr_channels(&path, exr).unwrap_err().to_string();
    assert!(told(exr(&[("Y", 6), ("Y", 6)], "k")).ends_with("two channels are named Y"));
    assert!(told(exr(&[("Y", 5)], "k")).ends_with("channel Y holds 5 values for 6 pixels"));
    assert!(
        told(exr(&[("Y", 6)], "dataWindow")).ends_with("the attribute dataWindow is one that OpenEXR keeps for itself")
    );
    assert!(told(exr(&[("Y", 6)], "")).ends_with("\"\" is no name of an attribute; from 1 to 255 bytes are"));
    assert!(!path.exists());

    write_exr_channels(&path, exr(&[("Y", 6)], "k")).unwrap();
    assert_eq!(read_image(&path).unwrap().image.texels, [[0.25; 3]; 6]);
    write_exr_channels(&path, exr(&[("depth.Z", 6), ("A", 6)], "k")).unwrap();
    let error = read_image(&path).unwrap_err().to_string();
    assert!(error.ends_with("has no channels R, G and B, nor Y; it has A, depth.Z"), "{error}");
}

#[test]
fn other_files_are_refused_by_their_content() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    fs::write(&path, b"PK").unwrap();
    let error = read_image(&path).unwrap_err().to_string();
    assert!(error.ends_with("a.exr: is neither an OpenEXR (.exr) nor a Radiance (.hdr) picture"), "{error}");
    assert!(read_image(&folder.path().join("none.exr")).unwrap_err().to_string().contains("none.exr: "));
    assert!(read_image(folder.path()).is_err());
    let hdr =
        [b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n".as_slice(), &[128, 0, 64, 129, 0, 0, 0, 0]].concat();
    fs::write(&path, hdr).unwrap();
    let loaded = read_image(&path).unwrap();
    assert_eq!(loaded.format, ImageFormat::Radiance);
    assert_eq!(loaded.image.texels, [[1.0, 0.0, 0.5], [0.0; 3]]);
}

/// Sets the four little-endian integers of the data window, and of the display window.
fn claim(bytes: &mut [u8], window: &[u8], max: [i32; 2]) {
    let at = bytes.windows(window.len()).position(|w| w == window).unwrap() + window.len() + 1 + 6 + 4;
    bytes[at + 8..at + 12].copy_from_slice(&max[0].to_le_bytes());
    bytes[at + 12..at + 16].copy_from_slice(&max[1].to_le_bytes());
}

#[test]
fn claims_of_size_are_held_against_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge.exr");
    let whole = fs::read(data("small-b44a.exr")).unwrap();
    for (max, expected) in [
        ([999_999, 999_999], "header: claims 1000000 × 1000000 pixels; from 1 to 268435456 are read"),
        ([16_383, 16_383], "header: claims 16384 × 16384 pixels of 3 channels, more than 5381 bytes can hold"),
    ] {
        let mut bytes = whole.clone();
        claim(&mut bytes, b"dataWindow", max);
        fs::write(&path, &bytes).unwrap();
        let error = read_image(&path).unwrap_err().to_string();
        assert!(error.ends_with(expected), "{error}");
    }
    // The display window alone.
    let mut bytes = whole;
    claim(&mut bytes, b"displayWindow", [999_999, 999_999]);
    fs::write(&path, &bytes).unwrap();
    assert!(read_image(&path).unwrap_err().to_string().contains("claims 1000000 × 1000000 pixels"));
}

#[test]
fn the_picture_is_the_display_window() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("window.exr");
    let values: Vec<f32> = (1..=12u8).map(f32::from).collect();
    let channels = vec![("Y".to_owned(), values)];
    write_exr_channels(&path, Exr { width: 4, height: 3, channels, metadata: vec![] }).unwrap();
    let mut bytes = fs::read(&path).unwrap();
    // One column and one row less than the data.
    claim(&mut bytes, b"displayWindow", [2, 1]);
    fs::write(&path, &bytes).unwrap();
    let exr = read_exr_channels(&path).unwrap();
    assert_eq!((exr.width, exr.height), (3, 2));
    assert_eq!(exr.channel("Y").unwrap(), [1.0, 2.0, 3.0, 5.0, 6.0, 7.0]);
    // And more.
    claim(&mut bytes, b"displayWindow", [4, 3]);
    fs::write(&path, &bytes).unwrap();
    let exr = read_exr_channels(&path).unwrap();
    assert_eq!((exr.width, exr.height), (5, 4));
    assert_eq!(exr.channel("Y").unwrap()[..6], [1.0, 2.0, 3.0, 4.0, 0.0, 5.0]);
    assert_eq!(exr.channel("Y").unwrap()[15..], [0.0; 5]);
}

#[test]
fn subsampled_channels_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sub.exr");
    let channels = vec![("Y".to_owned(), vec![0.5; 12])];
    write_exr_channels(&path, Exr { width: 4, height: 3, channels, metadata: vec![] }).unwrap();
    let mut bytes = fs::read(&path).unwrap();
    // In the channel list: the name, its type (float is 2), four bytes, the sampling in x and y.
    let entry = [b"Y\0".as_slice(), &2u32.to_le_bytes()].concat();
    let at = bytes.windows(entry.len()).position(|w| w == entry).unwrap() + entry.len() + 4;
    assert_eq!(bytes[at..at + 4], 1u32.to_le_bytes());
    bytes[at] = 2;
    fs::write(&path, &bytes).unwrap();
    let error = read_image(&path).unwrap_err().to_string();
    assert!(error.contains("channel Y is subsampled"), "{error}");
}

/// A repeatable stream of numbers.
struct Stream(u64);

impl Stream {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % n as u64) as usize
    }
}

#[test]
fn damaged_pictures_are_errors_or_pictures_and_never_more() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged");
    let ours = folder.path().join("ours.exr");
    write_exr(&ours, &film(), &[("device".to_owned(), "cpu".to_owned())]).unwrap();
    let mut hdr = b"#?RADIANCE\nEXPOSURE=2\nFORMAT=32-bit_rle_rgbe\n\n-Y 16 +X 40\n".to_vec();
    for _ in 0..16 {
        hdr.extend([2, 2, 0, 40]);
        (0..4).for_each(|c| hdr.extend([128 + 30, c * 40, 5, 1, 2, 3, 4, 5, 5, 9, 9, 9, 9, 9]));
    }
    fs::write(folder.path().join("whole.hdr"), &hdr).unwrap();
    read_image(&folder.path().join("whole.hdr")).unwrap();
    let files = [fs::read(&ours).unwrap(), fs::read(data("small-b44a.exr")).unwrap(), hdr];
    let mut random = Stream(0x9e37_79b9_7f4a_7c15);
    for (f, whole) in files.iter().enumerate() {
        for round in 0..300 {
            let mut bytes = whole.clone();
            // Half of the flips in the header, where they matter most.
            let span = if round % 2 == 0 { bytes.len().min(500) } else { bytes.len() };
            for _ in 0..=random.below(3) {
                let at = random.below(span);
                bytes[at] ^= 1 << random.below(8);
            }
            if round % 5 == 0 {
                bytes.truncate(random.below(whole.len()));
            }
            fs::write(&path, &bytes).unwrap();
            if let Ok(loaded) = read_image(&path) {
                let image = loaded.image;
                assert_eq!(image.texels.len(), image.width as usize * image.height as usize, "file {f}, round {round}");
            }
        }
        // Every way to lose the end, at a stride: no prefix is a picture but of all bytes.
        for length in (0..whole.len() - 1).step_by(whole.len() / 60) {
            fs::write(&path, &whole[..length]).unwrap();
            assert!(read_image(&path).is_err(), "file {f} cut to {length} bytes");
        }
    }
}
