//! What is written, and where it is not.

use std::fs;

use airlight_formats::image::read_exr_channels;

use crate::workbench::{FOG, Workbench};

#[test]
fn the_default_is_an_exr_and_a_png_of_the_scenes_name_in_the_current_folder() {
    let bench = Workbench::new();
    let scene = bench.write("my.fog.toml", FOG);
    bench.run(["render".as_ref(), scene.as_os_str()]).well();
    assert_eq!(bench.outputs(), ["my.fog.exr", "my.fog.png"]);
    let png = fs::read(bench.out().join("my.fog.png")).unwrap();
    assert_eq!(&png[..8], b"\x89PNG\r\n\x1a\n");
    // Width and height of its header, of the same picture.
    assert_eq!(&png[16..24], [0, 0, 0, 24, 0, 0, 0, 16]);
}

#[test]
fn every_output_that_is_asked_for_is_written() {
    let bench = Workbench::new();
    let scene = bench.path("fog.toml");
    fs::create_dir(bench.path("other")).unwrap();
    bench
        .run([
            "render",
            scene.to_str().unwrap(),
            "-o",
            "a.exr",
            "-o",
            "b.PNG",
            "--output",
            "../other/c.exr",
            "-o",
            "d.png",
        ])
        .well();
    assert_eq!(bench.outputs(), ["a.exr", "b.PNG", "d.png"]);
    // The order of attributes in the file is not fixed.
    let [a, c] = [bench.out().join("a.exr"), bench.path("other/c.exr")].map(|p| read_exr_channels(&p).unwrap());
    assert_eq!(a.channels, c.channels);
    let [b, d] = ["b.PNG", "d.png"].map(|p| fs::read(bench.out().join(p)).unwrap());
    assert_eq!(b, d);
}

#[test]
fn where_nothing_can_be_written_is_said_before_the_work() {
    let bench = Workbench::new();
    let scene = bench.path("fog.toml");
    let scene = scene.to_str().unwrap();
    let folder = bench.path("folder.exr");
    fs::create_dir(&folder).unwrap();
    for (output, words) in [
        (folder.to_str().unwrap(), &["folder.exr", "is a folder"][..]),
        ("none/a.exr", &["none/a.exr", "the folder none does not exist"]),
        ("a.gif", &["a.gif", ".exr or .png"]),
        ("a", &["a", ".exr or .png"]),
        (".exr", &[".exr or .png"]),
    ] {
        bench.refused(["render", scene, "-o", output], 2, words);
        // One that could be written is not, when another cannot.
        bench.refused(["render", scene, "-o", "good.exr", "-o", output], 2, words);
    }
    assert!(fs::read_dir(&folder).unwrap().next().is_none());
    // Something that is there but no file.
    #[cfg(unix)]
    {
        let pipe = bench.path("pipe.exr");
        std::os::unix::fs::symlink("/dev/null", &pipe).unwrap();
        bench.refused(["render", scene, "-o", pipe.to_str().unwrap()], 1, &["pipe.exr", "not a regular file"]);
    }
}

/// Names and pixel types of the channels of an OpenEXR file, by its header: 2 is a 32-bit float.
fn channel_types(bytes: &[u8]) -> Vec<(String, u32)> {
    let mark = b"channels\0chlist\0";
    let at = bytes.windows(mark.len()).position(|w| w == mark).unwrap() + mark.len() + 4;
    let mut rest = &bytes[at..];
    let mut channels = Vec::new();
    while rest[0] != 0 {
        let end = rest.iter().position(|b| *b == 0).unwrap();
        let name = String::from_utf8(rest[..end].to_vec()).unwrap();
        channels.push((name, u32::from_le_bytes(rest[end + 1..end + 5].try_into().unwrap())));
        // Name, its end, then type, linearity and sampling in 16 bytes.
        rest = &rest[end + 17..];
    }
    channels
}

#[test]
fn an_exr_holds_the_documented_channels_and_says_how_it_was_made() {
    let bench = Workbench::new();
    let scene = bench.path("fog.toml");
    let set = "medium.anisotropy=0.25";
    bench.run(["render", scene.to_str().unwrap(), "-o", "a.exr", "--set", set, "--samples", "3"]).well();
    let path = bench.out().join("a.exr");
    let mut types = channel_types(&fs::read(&path).unwrap());
    types.sort();
    let names = ["A", "B", "G", "R", "depth.Z", "transmittance.B", "transmittance.G", "transmittance.R"];
    assert_eq!(types, names.map(|name| (name.to_owned(), 2)));

    let exr = read_exr_channels(&path).unwrap();
    assert_eq!((exr.width, exr.height), (24, 16));
    let says = |key: &str| {
        let found = exr.metadata.iter().find(|(k, _)| k == key);
        found.unwrap_or_else(|| panic!("{key} is not among {:?}", exr.metadata)).1.as_str()
    };
    assert_eq!(says("airlight.version"), env!("CARGO_PKG_VERSION"));
    assert!(says("airlight.device").starts_with("cpu:0 "));
    assert!(says("airlight.scene").ends_with("fog.toml"));
    assert!(says("airlight.estimators").contains("records") && says("airlight.estimators").contains("direct"));
    assert_eq!(says("airlight.settings"), set);
    assert_eq!((says("airlight.samples"), says("airlight.step")), ("3", "1"));
    assert!(says("airlight.seconds").parse::<f64>().unwrap() >= 0.0);
    assert!(says("airlight.stages").contains("march"));

    // Alpha is what the medium stops, and what it lets through is beside it.
    let [a, r, g, b] =
        ["A", "transmittance.R", "transmittance.G", "transmittance.B"].map(|name| exr.channel(name).unwrap());
    for i in 0..a.len() {
        // Three f32 operations on values up to 1.
        assert!((a[i] - (1.0 - (r[i] + g[i] + b[i]) / 3.0)).abs() < 1e-6);
    }
    assert!(a.iter().any(|v| *v > 0.5) && a.contains(&0.0));
    let depth = exr.channel("depth.Z").unwrap();
    assert!(depth.iter().zip(a).all(|(z, a)| if *a > 0.0 { (1.0..4.0).contains(z) } else { z.is_infinite() }));
}
