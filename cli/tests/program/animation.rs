//! Frames of animated scenes: what is written and redone, and what is refused.

use std::fs;

use airlight_formats::image::read_exr_channels;
use serde_json::Value;

use crate::workbench::{FOG, Workbench, nrrd, ramp};

/// The sun goes from the zenith to the horizon.
const SUNSET: &str = "
[animation]
frames = [3, 7]
fps = 2

[[animation.track]]
key = \"light.0.to_light\"
frames = [3, 7]
values = [[0, 1, 0], [4, 0, 0]]
";

/// The fog in blobs.
fn blobs() -> String {
    let two = "kind = \"gaussians\"\ncells = 8\nblobs = [{ center = [0.3, 0.5, 0.5], a = 4, c = 2 }, { center = [0.7, \
               0.5, 0.4], a = 5, c = 3 }]";
    FOG.replace("kind = \"homogeneous\"", two)
}

/// Names of the stages of a frame that ran.
fn ran(frame: &Value) -> Vec<&str> {
    let stages = frame["stages"].as_array().unwrap().iter().filter(|s| s["ran"] == true);
    stages.map(|s| s["stage"].as_str().unwrap()).collect()
}

/// Whether a frame wrote a medium to the device.
fn uploads_density(frame: &Value) -> bool {
    frame["uploads"].as_array().unwrap().iter().any(|name| name == "density")
}

#[test]
fn a_light_that_moves_over_a_still_grid_leaves_the_grid_alone() {
    let bench = Workbench::new();
    let dims = [5, 3, 4];
    let volume = bench.write("a.nrrd", nrrd(dims, &ramp(dims)));
    let scene = bench.grid_scene("moving", &volume);
    let text = fs::read_to_string(&scene).unwrap() + SUNSET;
    fs::write(&scene, text).unwrap();
    let told = bench.json(["render", scene.to_str().unwrap(), "--frames", "3-5", "-o", "a.#.exr", "--json"]);
    let frames = told["frames"].as_array().unwrap();
    let numbers: Vec<_> = frames.iter().map(|f| f["frame"].as_u64().unwrap()).collect();
    assert_eq!(numbers, [3, 4, 5]);
    assert!(uploads_density(&frames[0]) && ran(&frames[0]).contains(&"coarsen"), "{told:#}");
    for frame in &frames[1..] {
        assert!(!uploads_density(frame), "{frame:#}");
        // The sky's light rests as the grid does; only what the sun lights is made anew.
        let again = ran(frame);
        assert!(again.ends_with(&["sweep", "relight", "march"]), "{again:?}");
        assert!(!again.contains(&"coarsen") && !again.contains(&"reduce"), "{again:?}");
        assert_eq!(frame["device_bytes"], frames[0]["device_bytes"]);
    }
    assert_eq!(frames[2]["outputs"], serde_json::json!(["a.5.exr"]));
    for part in ["load", "render", "write"] {
        assert!(frames[1]["seconds"][part].as_f64().unwrap() >= 0.0);
    }
    assert!(told.get("stages").is_none() && told["size"] == serde_json::json!([24, 16]));
    assert_eq!(bench.outputs(), ["a.3.exr", "a.4.exr", "a.5.exr"]);
}

#[test]
fn blobs_that_move_are_injected_anew_and_those_that_rest_are_not() {
    let bench = Workbench::new();
    let track = "[animation]\nframes = [0, 3]\n[[animation.track]]\nkey = \"medium.blobs.1.center\"\nframes = [1, 3]\n\
                 values = [[0.7, 0.5, 0.4], [0.5, 0.6, 0.4]]\n";
    let scene = bench.write("blobs.toml", blobs() + track);
    let told = bench.json(["render", scene.to_str().unwrap(), "--frames", "0-3", "--json"]);
    let injects: Vec<_> = told["frames"].as_array().unwrap().iter().map(|f| ran(f).contains(&"inject")).collect();
    assert_eq!(injects, [true, false, true, true]);
    let idle = &told["frames"][1];
    assert_eq!((ran(idle), &idle["uploads"]), (Vec::new(), &serde_json::json!([])));
    let names: Vec<_> = (0..4).flat_map(|n| ["exr", "png"].map(|e| format!("blobs.000{n}.{e}"))).collect();
    assert_eq!(bench.outputs(), names);
}

#[test]
fn a_frame_is_the_still_of_its_values() {
    let bench = Workbench::new();
    let still = bench.write("still.toml", FOG.replace("[0.3, 1.0, 0.2]", "[2, 0.5, 0]"));
    let moving = bench.write("moving.toml", FOG.to_owned() + SUNSET);
    let (still, moving) = (still.to_str().unwrap(), moving.to_str().unwrap());
    bench.run(["render", still, "-o", "still.exr"]).well();
    // Within a sequence and by itself.
    bench.run(["render", moving, "--frames", "4-6", "-o", "many.##.exr"]).well();
    bench.run(["render", moving, "--frames", "5", "-o", "one.#.exr"]).well();
    let read = |name: &str| read_exr_channels(&bench.out().join(name)).unwrap();
    let still = read("still.exr").channels;
    assert!(read("many.05.exr").channels == still && read("one.5.exr").channels == still);
    assert!(read("many.04.exr").channels != still);
    let frame = read("many.05.exr").metadata.into_iter().find(|(key, _)| key == "airlight.frame").unwrap();
    assert_eq!(frame.1, "5");
}

#[test]
fn without_frames_it_is_the_first() {
    let bench = Workbench::new();
    let moving = bench.write("moving.toml", FOG.to_owned() + SUNSET);
    let moving = moving.to_str().unwrap();
    bench.run(["render", moving, "-o", "a.exr", "-o", "b.##.exr"]).well();
    bench.run(["render", moving, "--frames", "3", "-o", "c.#.exr"]).well();
    assert_eq!(bench.outputs(), ["a.exr", "b.03.exr", "c.3.exr"]);
    let [a, b, c] = ["a.exr", "b.03.exr", "c.3.exr"].map(|n| read_exr_channels(&bench.out().join(n)).unwrap().channels);
    assert!(a == b && b == c);
    let told = bench.json(["info", moving, "--json"]);
    assert_eq!(told["frame"], 3);
    let track = serde_json::json!({ "key": "light.0.to_light", "frames": [3, 7], "interpolation": "linear" });
    let expected = serde_json::json!({ "frames": [3, 7], "fps": 2.0, "seconds": 2.5, "track": [track] });
    assert_eq!(told["animation"], expected);
    assert_eq!(bench.json(["info", bench.path("fog.toml").to_str().unwrap(), "--json"])["animation"], Value::Null);
}

#[test]
fn volumes_of_a_sequence_are_read_at_their_frames() {
    let bench = Workbench::new();
    let dims = [5, 3, 4];
    for (frame, scale) in [(1, 1.0), (2, 2.0)] {
        let values: Vec<_> = ramp(dims).iter().map(|v| v * scale).collect();
        bench.write(&format!("cloud.{frame:04}.nrrd"), nrrd(dims, &values));
    }
    let scene = bench.grid_scene("cloud", &bench.path("cloud.####.nrrd"));
    let scene = scene.to_str().unwrap();
    // What is missing is found before the first frame.
    let words = &["cloud.toml:10:8: frame 3: medium.file: ", "cloud.0003.nrrd: No such file"];
    bench.refused(["render", scene, "--frames", "1-3"], 2, words);
    bench.refused(["render", scene], 2, &["frame 0: medium.file: ", "cloud.0000.nrrd: No such file"]);
    let told = bench.json(["render", scene, "--frames", "1-2", "-o", "a.#.exr", "--json"]);
    assert!(told["frames"].as_array().unwrap().iter().all(uploads_density));
    let thick = |name: &str| {
        let film = read_exr_channels(&bench.out().join(name)).unwrap();
        film.channel("A").unwrap().iter().sum::<f32>()
    };
    assert!(thick("a.2.exr") > 1.01 * thick("a.1.exr"));
}

#[test]
fn frames_and_names_that_do_not_fit_are_refused_before_the_work() {
    let bench = Workbench::new();
    let scene = bench.write("moving.toml", FOG.to_owned() + SUNSET);
    let scene = scene.to_str().unwrap();
    let refused = |arguments: &[&str], words: &[&str]| {
        bench.refused(["render", scene].iter().chain(arguments), 2, words);
    };
    refused(&["--frames", "1-3", "-o", "a.exr"], &["a.exr", "####"]);
    refused(&["--frames", "1-3", "-o", "a.#.exr", "-o", "b.png"], &["b.png", "####"]);
    refused(&["--frames", "1-11", "-o", "a1#.exr", "-o", "a#.exr"], &["a11.exr", "frame 1 and for frame 11"]);
    refused(&["--frames", "5-3"], &["--frames", "the last frame is before the first"]);
    refused(&["--frames", "0-4294967295"], &["--frames", "100000"]);
    refused(&["--frames", "x"], &["--frames", "is no frame"]);
    refused(
        &["--frames", "1-3", "--set", "light.0.to_light=[1, 0, 0]"],
        &["--set light.0.to_light", "animation.track[0]"],
    );
    // A fault of a late frame is found before the first is rendered.
    let text = FOG.to_owned()
        + &SUNSET.replace("light.0.to_light", "medium.albedo").replace("[[0, 1, 0], [4, 0, 0]]", "[0, 2]");
    let scene = bench.write("late.toml", text);
    let words = &["frame 6: medium.albedo = 1.5; it must be from 0 to 1"];
    bench.refused(["render", scene.to_str().unwrap(), "--frames", "1-100"], 2, words);
}

#[cfg(unix)]
#[test]
fn what_is_complete_stays_when_a_later_frame_fails() {
    let bench = Workbench::new();
    let scene = bench.write("moving.toml", FOG.to_owned() + SUNSET);
    std::os::unix::fs::symlink("/dev/null", bench.out().join("a.4.exr")).unwrap();
    let ended = bench.run(["render", scene.to_str().unwrap(), "--frames", "3-5", "-o", "a.#.exr", "--json"]);
    ended.failed(1, &["error: frame 4: ", "a.4.exr", "not a regular file"]);
    assert_eq!(bench.outputs(), ["a.3.exr", "a.4.exr"]);
    read_exr_channels(&bench.out().join("a.3.exr")).unwrap();
}
