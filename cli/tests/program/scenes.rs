//! Scenes: what is not in range, not known or not there is told with its place.

use std::path::Path;

use airlight_formats::image::{Exr, read_exr_channels, write_exr_channels};

use crate::workbench::{FOG, Workbench};

/// The fog with `from` replaced by `to` must be refused with `words`.
#[track_caller]
fn scene(from: &str, to: &str, words: &[&str]) {
    assert!(FOG.contains(from), "{from}");
    let bench = Workbench::new();
    let path = bench.write("bad.toml", FOG.replacen(from, to, 1));
    for command in ["render", "info"] {
        bench.refused([command.as_ref(), path.as_os_str()], 2, words);
    }
}

#[test]
fn optics_out_of_range() {
    scene("albedo = 0.9", "albedo = 1.1", &["bad.toml:12:", "medium.albedo", "1"]);
    scene("albedo = 0.9", "albedo = [0.9, -0.1, 0.5]", &["bad.toml:12:", "medium.albedo"]);
    scene("albedo = 0.9", "albedo = nan", &["bad.toml:12:", "medium.albedo"]);
    scene("extinction = 3", "extinction = -3", &["bad.toml:11:", "medium.extinction"]);
    scene("extinction = 3", "extinction = inf", &["bad.toml:11:", "medium.extinction"]);
    scene("extinction = 3", "extinction = 1e30", &["bad.toml:11:", "medium.extinction", "1e15"]);
    for g in ["1", "-1", "1.5", "nan", "-inf"] {
        scene("albedo = 0.9", &format!("albedo = 0.9\nanisotropy = {g}"), &["bad.toml:13:", "medium.anisotropy"]);
    }
    scene("albedo = 0.9", "emission = -1", &["bad.toml:12:", "medium.emission"]);
    scene("albedo = 0.9", "density = -1", &["bad.toml:12:", "medium.density"]);
    scene("albedo = 0.9", "density = nan", &["bad.toml:12:", "medium.density"]);
}

#[test]
fn boxes_that_hold_nothing_or_too_much() {
    let bounds = "bounds = [[0, 0, 0], [1, 1, 1]]";
    scene(bounds, "bounds = [[0, 0, 0], [1, 0, 1]]", &["medium.bounds"]);
    scene(bounds, "bounds = [[0, 0, 0], [1, -1, 1]]", &["medium.bounds"]);
    scene(bounds, "bounds = [[0, 0, 0], [1, inf, 1]]", &["medium.bounds"]);
    scene(bounds, "bounds = [[0, 0, 0], [1e-60, 1e-60, 1e-60]]", &["bad.toml:10:"]);
    // A ray along such a box would take a trillion steps.
    scene(bounds, "bounds = [[0, 0, 0], [1e10, 1, 1]]", &["quality.step", "at most 1048576"]);
}

#[test]
fn steps_out_of_range() {
    for step in ["0", "-1", "nan", "inf", "1e-9", "1e300"] {
        scene("[estimate]", &format!("[quality]\nstep = {step}\n[estimate]"), &["quality.step"]);
    }
}

#[test]
fn unknown_keys_come_with_line_and_suggestion() {
    scene("albedo = 0.9", "albdo = 0.9", &["bad.toml:12:1", "unknown key `albdo`", "did you mean `albedo`"]);
    scene("[medium]", "[mediums]", &["bad.toml:8:", "`mediums`", "did you mean `medium`"]);
    scene("bands = 2", "band = 2", &["bad.toml:23:", "`band`", "did you mean `bands`"]);
    scene("kind = \"directional\"", "kind = \"directonal\"", &["bad.toml:18:", "directonal", "directional"]);
    scene("kind = \"records\"", "kind = \"record\"", &["bad.toml:23:", "records"]);
}

#[test]
fn wrong_types_and_broken_text() {
    scene("extinction = 3", "extinction = \"thick\"", &["bad.toml:11:", "medium.extinction", "number"]);
    scene("extinction = 3", "extinction = [1, 2]", &["bad.toml:11:", "medium.extinction"]);
    scene("origin = [1.9, 1.3, 2.2]", "origin = 3", &["bad.toml:3:", "camera.origin"]);
    scene("radiance = 0.5", "radiance = true", &["bad.toml:15:", "environment.radiance"]);
    scene("radiance = 0.5", "radiance = -0.5", &["bad.toml:15:", "environment.radiance"]);
    scene("radiance = 0.5", "", &["environment"]);
    scene("to_light = [0.3, 1.0, 0.2]", "to_light = [0, 0, 0]", &["bad.toml:19:", "to_light"]);
    scene("irradiance = 2", "irradiance = -2", &["bad.toml:20:", "irradiance"]);
    scene("cells = 6", "cells = 0", &["bad.toml:23:", "cells"]);
    scene("directions = 48", "directions = 50", &["bad.toml:23:", "directions"]);
    scene("[camera]", "[camera", &["bad.toml:2:"]);
    scene("[camera]", "[[camera]]", &["bad.toml:2:", "camera"]);
    scene("fov = 40", "fov = 40\nfov = 41", &["bad.toml:6:"]);
    let bench = Workbench::new();
    for (name, content) in [("empty", &b""[..]), ("bytes", b"[camera]\norigin = \"\xff\xfe\""), ("zeros", &[0; 4096])] {
        let path = bench.write(&format!("{name}.toml"), content);
        bench.refused(["render".as_ref(), path.as_os_str()], 2, &[&format!("{name}.toml")]);
    }
    // Deep nesting must not exhaust the stack.
    let deep = bench.write("deep.toml", format!("a = {}", "[".repeat(200_000)));
    bench.refused(["render".as_ref(), deep.as_os_str()], 2, &["deep.toml"]);
    let deep = bench.write("deep.toml", format!("{FOG}\n[{}x]\n", "a.".repeat(20_000)));
    bench.refused(["render".as_ref(), deep.as_os_str()], 2, &["deep.toml"]);
}

#[test]
fn files_that_are_not_there_or_are_no_files() {
    let bench = Workbench::new();
    let render = |path: &Path, words: &[&str]| bench.refused(["render".as_ref(), path.as_os_str()], 2, words);
    render(&bench.path("none.toml"), &["none.toml", "No such file"]);
    render(&bench.out(), &["is a folder", ".toml"]);
    render(Path::new("."), &["is a folder", ".toml"]);
    render(&bench.grid_scene("a", &bench.path("none.vdb")), &["a.toml:10:8", "none.vdb", "No such file"]);
    render(&bench.grid_scene("b", &bench.out()), &["b.toml:10:8", "folder"]);
    render(&bench.grid_scene("c", &bench.path("fog.toml")), &["c.toml:10:8", "not a volume", ".vdb"]);
    let sky = |name: &str, file: &Path| {
        let file = format!("file = '{}'", file.display());
        bench.write(&format!("{name}.toml"), FOG.replace("radiance = 0.5", &file))
    };
    render(&sky("d", &bench.path("none.exr")), &["d.toml:15:8", "none.exr", "No such file"]);
    render(&sky("e", &bench.out()), &["e.toml:15:8", "folder"]);
    render(&sky("f", &bench.path("fog.toml")), &["f.toml:15:8", "neither an OpenEXR"]);
    for path in [bench.path("none.vdb"), bench.path("none.exr"), bench.path("none.toml")] {
        bench.refused(["info".as_ref(), path.as_os_str()], 2, &["none.", "No such file"]);
    }
    bench.refused(["info".as_ref(), bench.out().as_os_str()], 2, &["folder"]);
    bench.refused(["info".as_ref(), bench.write("x.gif", "GIF89a").as_os_str()], 2, &["x.gif", ".vdb"]);
}

#[test]
fn overrides_are_told_by_their_own_words() {
    let bench = Workbench::new();
    let path = bench.path("fog.toml").into_os_string().into_string().unwrap();
    for (set, word) in [
        ("medium.albdo=1", "did you mean `albedo`"),
        ("medum.albedo=1", "did you mean `medium`"),
        ("medium.albedo=2", "medium.albedo"),
        ("medium.albedo=[1", "--set medium.albedo=[1"),
        ("light.1.irradiance=2", "light"),
        ("light.0.irradiance.7=2", "irradiance"),
        ("light.x.irradiance=2", "light"),
        ("camera.origin.3=2", "camera.origin"),
        ("=3", "--set"),
        ("medium=3", "medium"),
        ("medium.file=cloud.vdb", "medium"),
        ("nonsense", "key=value"),
    ] {
        bench.refused(["render", &path, "--set", set], 2, &[word]);
    }
}

#[test]
fn devices_that_are_not_there_are_told_with_those_that_are() {
    let bench = Workbench::new();
    let path = bench.path("fog.toml").into_os_string().into_string().unwrap();
    for device in ["cpu:7", "abacus", "", "cpu:"] {
        bench.refused(["render", &path, "--device", device], 2, &["no device", "cpu:0"]);
    }
}

#[test]
fn bad_usage_is_told() {
    let bench = Workbench::new();
    for arguments in [&["rendr", "x.toml"][..], &["render"], &["render", "a", "b"], &["compare", "a"], &["info"]] {
        bench.refused(arguments, 2, &["Usage"]);
    }
    bench.refused(["render", "x.toml", "--frobnicate"], 2, &["--frobnicate"]);
}

#[test]
fn a_background_stands_behind_the_medium_and_must_be_of_its_size() {
    let bench = Workbench::new();
    let scene = bench.path("fog.toml");
    let depth = |name: &str, value: f32, width: u32| {
        let channels = vec![("Z".to_owned(), vec![value; width as usize * 16])];
        let exr = Exr { width, height: 16, channels, metadata: Vec::new() };
        write_exr_channels(&bench.path(name), exr).unwrap();
    };
    // Surfaces at the eye hide the medium, and those behind it do not.
    for (name, value, hidden) in [("near.exr", 0.0, true), ("far.exr", 9.0, false)] {
        depth(name, value, 24);
        let text = FOG.to_owned() + &format!("\n[background]\ndepth = \"{name}\"\n");
        let path = bench.write("behind.toml", text);
        bench.run(["render".as_ref(), path.as_os_str(), "-o".as_ref(), "out.exr".as_ref()]).well();
        let film = read_exr_channels(&bench.out().join("out.exr")).unwrap();
        assert_eq!(film.channel("A").unwrap().iter().all(|a| *a == 0.0), hidden, "{name}");
        std::fs::remove_file(bench.out().join("out.exr")).unwrap();
    }
    depth("wide.exr", 1.0, 25);
    let set = "background.depth=wide.exr";
    let words = &["background.depth", "25 × 16", "24 × 16"];
    bench.refused(["render".as_ref(), scene.as_os_str(), "--set".as_ref(), set.as_ref()], 2, words);
}
