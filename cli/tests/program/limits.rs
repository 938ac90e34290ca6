//! What the machine does not have: memory, room on the disk, a reader.

#![cfg(unix)]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::process::{Command, Stdio};

use crate::workbench::{FOG, Workbench, fixture, names, wait};

#[cfg(target_os = "linux")]
#[test]
fn more_memory_than_there_is_is_refused_before_it_is_taken() {
    let bench = Workbench::new();
    let scene = bench.path("fog.toml");
    let scene = scene.to_str().unwrap();
    for (arguments, largest) in [
        (&["--size", "16384x16384"][..], "film 8.0 GiB"),
        (&["--set", "estimate.environment.cells=1024"], "relit 16.0 GiB"),
        (&["--set", "estimate.environment.cells=300", "--set", "medium.anisotropy=0.5"], "relit 1.6 GiB"),
    ] {
        let mut arguments = arguments.to_vec();
        arguments.splice(0..0, ["render", scene]);
        bench.refused(&arguments, 2, &["this needs", "GiB of memory", "may be used", largest, "fewer"]);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_limit_of_memory_is_kept_to_down_to_the_film() {
    let bench = Workbench::new();
    // The film takes 32 bytes a pixel on the device and as many on the host: 2048² needs 256 MiB (and the light's shadow 9), more than nine tenths of the limit.
    let render = |limit: u64, side: u32| {
        let (limit, size) = (format!("ulimit -v {}", limit << 10), format!("{side}x{side}"));
        let scene = bench.path("fog.toml");
        // The libraries of other devices would take room of their own.
        let arguments = ["render", scene.to_str().unwrap(), "--device", "cpu", "--size", &size, "-o", "a.exr"];
        let arguments = [&arguments[..], &["--set", "estimate.scattering=none"]].concat();
        bench.end(bench.shell(&limit, "", arguments))
    };
    render(270, 2048).failed(2, &["this needs 265.", "MiB may be used"]);
    assert!(bench.outputs().is_empty());
    render(270, 512).well();
}

#[test]
fn a_full_disk_is_an_error_and_leaves_nothing() {
    let bench = Workbench::new();
    let scene = bench.path("fog.toml");
    let scene = scene.to_str().unwrap();
    // A file that may not grow past some blocks fails as one on a full disk does, and needs no privileges. The signal
    // that would end the program is ignored, which a program inherits.
    let small = "trap '' XFSZ && ulimit -f 4";
    for ending in ["exr", "png"] {
        let output = format!("a.{ending}");
        let ended = bench.end(bench.shell(small, "", ["render", scene, "--size", "200x150", "-o", &output]));
        ended.failed(1, &[&output]);
        assert!(bench.outputs().is_empty(), "{:?}", bench.outputs());
        // What stood there stays.
        fs::write(bench.out().join(&output), "old").unwrap();
        bench.end(bench.shell(small, "", ["render", scene, "--size", "200x150", "-o", &output])).failed(1, &[&output]);
        assert_eq!(fs::read(bench.out().join(&output)).unwrap(), b"old");
        assert_eq!(bench.outputs(), std::slice::from_ref(&output));
        fs::remove_file(bench.out().join(&output)).unwrap();
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_standard_output_is_an_error() {
    let bench = Workbench::new();
    for arguments in [&["devices"][..], &["devices", "--json"]] {
        let ended = bench.end(bench.shell("true", ">/dev/full", arguments));
        ended.failed(1, &["standard output"]);
    }
}

#[test]
fn a_folder_that_may_not_be_written_to_is_an_error() {
    let bench = Workbench::new();
    let locked = bench.path("locked");
    fs::create_dir(&locked).unwrap();
    fs::set_permissions(&locked, fs::Permissions::from_mode(0o555)).unwrap();
    let privileged = fs::write(locked.join("probe"), "").is_ok();
    if privileged {
        // Permissions do not bind this user; nothing can be created among the processes by anyone.
        fs::remove_file(locked.join("probe")).unwrap();
        #[cfg(target_os = "linux")]
        {
            let scene = bench.path("fog.toml");
            bench.refused(["render", scene.to_str().unwrap(), "-o", "/proc/a.exr"], 1, &["/proc/a.exr"]);
        }
        return;
    }
    let output = locked.join("a.exr");
    let (scene, output) = (bench.path("fog.toml"), output.to_str().unwrap());
    bench.refused(["render", scene.to_str().unwrap(), "-o", output], 1, &[output, "ermission"]);
    assert!(names(&locked).is_empty());
}

/// Every command that prints, with its arguments.
fn printing(bench: &Workbench) -> Vec<Vec<String>> {
    let fog = bench.path("fog.toml").into_os_string().into_string().unwrap();
    let tiles = fixture("several.vdb").into_os_string().into_string().unwrap();
    let sky = fixture("small-b44a.exr").into_os_string().into_string().unwrap();
    let owned = |list: &[&str]| list.iter().map(|s| (*s).to_owned()).collect();
    vec![
        owned(&["--help"]),
        owned(&["--version"]),
        owned(&["render", "--help"]),
        owned(&["devices"]),
        owned(&["devices", "--json"]),
        owned(&["info", &tiles]),
        owned(&["info", &fog, "--json"]),
        owned(&["compare", &sky, &sky]),
        owned(&["compare", &sky, &sky, "--json"]),
        owned(&["render", &fog, "-o", "a.exr"]),
        owned(&["render", &fog, "-o", "a.exr", "--json"]),
    ]
}

/// A pipe whose reader has gone.
fn broken() -> Stdio {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    writer.into()
}

#[test]
fn a_reader_that_has_gone_is_no_error() {
    let bench = Workbench::new();
    for arguments in printing(&bench) {
        let mut command: Command = bench.command(&arguments);
        let log = bench.path("stderr");
        command.stdin(Stdio::null()).stdout(broken()).stderr(fs::File::create(&log).unwrap());
        let code = wait(command.spawn().unwrap(), &arguments.join(" "));
        let text = fs::read_to_string(&log).unwrap();
        assert_eq!((code, text.as_str()), (Some(0), ""), "{arguments:?}");
        // Closed from the start is the same.
        let ended = bench.end(bench.shell("true", ">&-", &arguments));
        assert_eq!((ended.code, ended.stderr.as_str()), (Some(0), ""), "{arguments:?}");
    }
    assert_eq!(bench.outputs(), ["a.exr"]);
}

#[test]
fn nobody_who_reads_warnings_and_errors_is_no_reason_to_stop() {
    let bench = Workbench::new();
    // This sky has negative texels, which are warned of.
    let sky = format!("file = '{}'", fixture("city-negative.exr").display());
    let scene = bench.write("sky.toml", FOG.replace("radiance = 0.5", &sky));
    let run = |path: &str, code: i32| {
        let mut command = bench.command(["render", path, "-o", "a.exr"]);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(broken());
        assert_eq!(wait(command.spawn().unwrap(), path), Some(code), "{path}");
    };
    run(scene.to_str().unwrap(), 0);
    run("none.toml", 2);
    assert_eq!(bench.outputs(), ["a.exr"]);
}
