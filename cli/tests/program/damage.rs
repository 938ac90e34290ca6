//! Files that were cut short or of which a bit was turned.

use std::path::{Path, PathBuf};

use crate::workbench::{FOG, Workbench, fixture, nifti, nrrd, ramp, reference};

/// Files of each format with the ending that they keep.
fn volumes(bench: &Workbench) -> Vec<(PathBuf, &'static str)> {
    let dims = [9, 7, 5];
    vec![
        (fixture("inactive-zip-mask.vdb"), "vdb"),
        (fixture("half-blosc.vdb"), "vdb"),
        (fixture("several.vdb"), "vdb"),
        (reference("density_half_zip.vdb"), "vdb"),
        (bench.write("whole.nrrd", nrrd(dims, &ramp(dims))), "nrrd"),
        (bench.write("whole.nii", nifti([9, 7, 5], &ramp(dims))), "nii"),
    ]
}

/// A scene with `file` as its medium or as its environment. Without records, so that a run is loading and one march.
fn scene(bench: &Workbench, file: &Path, environment: bool) -> PathBuf {
    let file = file.display();
    let (from, to) = if environment {
        ("radiance = 0.5", format!("file = '{file}'"))
    } else {
        ("kind = \"homogeneous\"\nbounds = [[0, 0, 0], [1, 1, 1]]", format!("kind = \"grid\"\nfile = '{file}'"))
    };
    let estimate = FOG.find("[estimate]").unwrap();
    let text = format!("{}[estimate]\nenvironment = \"none\"\nlights = \"none\"\n", &FOG[..estimate]);
    bench.write("damaged.toml", text.replace(from, &to).replace("[24, 16]", "[8, 8]"))
}

fn attempt(bench: &Workbench, bytes: &[u8], ending: &str, environment: bool, must_fail: bool) {
    let file = bench.write(&format!("damaged.{ending}"), bytes);
    let scene = scene(bench, &file, environment);
    // A limit of memory stands over every run, and `run` itself notices panics, signals and hangs.
    for arguments in [
        &["render".as_ref(), scene.as_os_str(), "-o".as_ref(), "a.exr".as_ref()][..],
        &["info".as_ref(), file.as_os_str()],
    ] {
        let ended = bench.run(arguments);
        match ended.code {
            Some(0) => {
                assert!(!must_fail || arguments[0] == "info", "{ended:?}");
                let _ = std::fs::remove_file(bench.out().join("a.exr"));
            }
            _ => ended.failed(2, &["damaged."]),
        }
        assert_eq!(bench.outputs(), Vec::<String>::new());
    }
}

/// Places spread over a file, its first bytes denser.
fn places(len: usize) -> impl Iterator<Item = usize> {
    let head = (0..12).map(move |i| i * i * i * 2 % len);
    let rest = (1..=8).map(move |i| (len * i / 9 + 13 * i) % len);
    head.chain(rest)
}

#[test]
fn volumes_cut_short_are_refused() {
    let bench = Workbench::new();
    for (path, ending) in volumes(&bench) {
        let bytes = std::fs::read(&path).unwrap();
        for at in [0, 1, 7, 40, 340, bytes.len() / 3, bytes.len() / 2] {
            attempt(&bench, &bytes[..at], ending, false, true);
        }
    }
}

#[test]
fn volumes_with_a_turned_bit_are_refused_or_rendered() {
    let bench = Workbench::new();
    for (path, ending) in volumes(&bench) {
        let bytes = std::fs::read(&path).unwrap();
        for (n, at) in places(bytes.len()).enumerate() {
            let mut bytes = bytes.clone();
            bytes[at] ^= 1 << (n % 8);
            attempt(&bench, &bytes, ending, false, false);
        }
    }
}

#[test]
fn environments_cut_short_or_turned_are_refused_or_rendered() {
    let bench = Workbench::new();
    for path in [reference("env.exr"), fixture("small-b44a.exr"), fixture("city-negative.exr")] {
        let bytes = std::fs::read(&path).unwrap();
        for at in [0, 3, 9, 100, bytes.len() / 2, bytes.len() - 9] {
            attempt(&bench, &bytes[..at], "exr", true, true);
        }
        for (n, at) in places(bytes.len()).enumerate() {
            let mut bytes = bytes.clone();
            bytes[at] ^= 1 << (7 - n % 8);
            attempt(&bench, &bytes, "exr", true, false);
        }
    }
}
