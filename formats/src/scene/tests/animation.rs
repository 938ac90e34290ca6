//! Values at frames, what frames have in common, sequences, and what is wrong with tracks.

use std::fmt::Write as _;
use std::fs;

use super::*;

/// A point light on lines 7 to 10 after the least scene.
const LIGHT: &str = "[[light]]\nkind = \"point\"\nposition = [0, 1, 0]\nintensity = 1\n";

fn file(text: &str, sets: &[(&str, &str)]) -> Result<SceneFile, SceneFileError> {
    let sets: Vec<_> = sets.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
    SceneFile::parse(text, Path::new("scenes/a.toml"), &sets)
}

fn animated(tracks: &str) -> SceneFile {
    let base = BASE.replace("[medium]", "samples = 1\n[medium]");
    file(&format!("{base}{BOX}{LIGHT}[animation]\nframes = [1, 60]\n{tracks}"), &[]).unwrap()
}

fn track(key: &str, frames: &str, values: &str, curve: &str) -> String {
    format!("[[animation.track]]\nkey = \"{key}\"\nframes = {frames}\nvalues = {values}\ninterpolation = \"{curve}\"\n")
}

fn at(file: &mut SceneFile, frame: u32) -> Scene {
    file.frame_with(frame, &volumes).unwrap().scene
}

fn position(scene: &Scene) -> DVec3 {
    match scene.lights[0] {
        Light::Point { position, .. } => position,
        _ => panic!("a point light"),
    }
}

#[test]
fn numbers_vectors_colors_and_components_follow_their_tracks() {
    let mut file = animated(
        &[
            track("light.0.position", "[10, 20]", "[[0, 1, 0], [4, 1, -2]]", "linear"),
            track("light.0.intensity", "[10, 20]", "[[1, 2, 3], [3, 2, 1]]", "step"),
            track("medium.bounds.1.2", "[10, 20]", "[3, 4]", "linear"),
            track("camera.samples", "[0, 15]", "[1, 4]", "step"),
        ]
        .concat(),
    );
    assert_eq!((file.first_frame(), at(&mut file, 7).frame), (1, 7));
    let animation = file.animation().unwrap();
    assert_eq!((animation.frames.clone(), animation.fps, animation.tracks.len()), (1..=60, 24.0, 4));
    assert_eq!((animation.tracks[1].curve, animation.tracks[1].frames.as_slice()), (Curve::Step, &[10, 20][..]));
    for (frame, expected, color, end, samples) in [
        (0, DVec3::new(0.0, 1.0, 0.0), Vec3::new(1.0, 2.0, 3.0), 3.0, 1),
        (10, DVec3::new(0.0, 1.0, 0.0), Vec3::new(1.0, 2.0, 3.0), 3.0, 1),
        (15, DVec3::new(2.0, 1.0, -1.0), Vec3::new(1.0, 2.0, 3.0), 3.5, 4),
        (20, DVec3::new(4.0, 1.0, -2.0), Vec3::new(3.0, 2.0, 1.0), 4.0, 4),
        (u32::MAX, DVec3::new(4.0, 1.0, -2.0), Vec3::new(3.0, 2.0, 1.0), 4.0, 4),
    ] {
        let scene = at(&mut file, frame);
        assert_eq!(position(&scene), expected);
        assert!(matches!(scene.lights[0], Light::Point { intensity, .. } if intensity == color));
        assert_eq!(scene.medium.lattice().world_bounds().1.z, end);
        assert_eq!(scene.camera.samples, samples);
    }
}

#[test]
fn a_scene_without_frames_is_its_first() {
    let text = format!("{BASE}{BOX}{LIGHT}[animation]\nframes = [3, 60]\n")
        + &track("light.0.intensity", "[1, 5]", "[1, 9]", "linear");
    let scene = load(&text, &[]).unwrap().scene;
    assert_eq!((scene.frame, &scene.lights[0]), (3, &Light::point(DVec3::Y, Vec3::splat(5.0)).unwrap()));
    assert_eq!(super::scene("[animation]\n").frame, 0);
}

#[test]
fn a_smooth_course_rests_at_its_ends_and_turns_without_leaving_its_values() {
    let track = track("light.0.position.0", "[0, 100, 300, 400]", "[0, 4, 6, -2]", "smooth");
    let mut file = animated(&track);
    let x: Vec<_> = (0..=400).map(|frame| position(&at(&mut file, frame)).x).collect();
    assert_eq!([x[0], x[100], x[300], x[400]], [0.0, 4.0, 6.0, -2.0]);
    let speed = |n: usize| x[n + 1] - x[n];
    // At rest at the ends and where it turns: the first step of a cubic from rest is of second order, about 3 (b - a) t².
    for (n, span, rise) in [(0, 100.0, 4.0), (299, 200.0, 2.0), (300, 100.0, -8.0), (399, 100.0, -8.0)] {
        let bound: f64 = 3.0 * rise / span / span;
        assert!(speed(n).abs() <= bound.abs(), "{n}: {}", speed(n));
    }
    assert!((0..300).all(|n| speed(n) >= 0.0) && (300..400).all(|n| speed(n) <= 0.0));
    // At a key it is the weighted harmonic mean of 0.04 over 100 frames and 0.01 over 200.
    let through = (500.0 + 400.0) / (500.0 / 0.04 + 400.0 / 0.01);
    for n in [99, 100] {
        assert!((speed(n) - through).abs() < 0.05 * through, "{} for {through}", speed(n));
    }
}

#[test]
fn what_counts_frames_stays_whole() {
    let mut file = animated(&track("camera.samples", "[1, 401]", "[1, 401]", "linear"));
    file.check(0..=402).unwrap();
    for frame in 1..=401 {
        assert_eq!(at(&mut file, frame).camera.samples, frame);
    }
}

#[test]
fn what_does_not_move_stays_the_same() {
    let grid = BASE.replace("homogeneous", "grid") + "file = \"cloud.vdb\"\nextinction = 2\nemission = 1\n";
    let sky = "[environment]\nradiance = [1, 2, 3]\nrotation = 0\n";
    let text = format!("{grid}{LIGHT}{sky}[animation]\nframes = [0, 9]\n")
        + &track("light.0.position", "[0, 9]", "[[0, 1, 0], [4, 1, -2]]", "linear")
        + &track("medium.extinction", "[0, 9]", "[2, 4]", "linear")
        + &track("environment.rotation", "[0, 9]", "[0, 90]", "linear");
    let mut file = file(&text, &[]).unwrap();
    let reads = std::cell::Cell::new(0);
    let read = |path: &Path, grid: Option<&str>| {
        reads.set(reads.get() + 1);
        volumes(path, grid)
    };
    let mut frame = |n| file.frame_with(n, &read).unwrap();
    let (a, b) = (frame(0), frame(5));
    assert_eq!((reads.get(), &a.files, &b.files), (1, &vec![PathBuf::from("scenes/cloud.vdb")], &a.files));
    let versions = |s: &Scene| (s.medium.version(), s.environment.as_ref().map(|e| e.version()));
    assert_eq!(versions(&a.scene), versions(&b.scene));
    assert_eq!((a.scene.optics.extinction.x, b.scene.optics.extinction.x), (2.0, 2.0 + 10.0f32 / 9.0));
    let turned = b.scene.environment.unwrap();
    assert_eq!((turned.rotation, turned.scale), (50.0, Vec3::ONE));
}

#[test]
fn moving_blobs_are_another_medium_and_resting_ones_are_not() {
    let text = format!(
        "{}{BOX}cells = 4\nblobs = [{{ center = [0, 0, 0], a = 1, c = 1 }}, {{ center = [1, 0, 0], a = 2, c = 1 }}]\n\
         [animation]\nframes = [0, 9]\n",
        BASE.replace("homogeneous", "gaussians")
    ) + &track("medium.blobs.1.center", "[2, 4, 6]", "[[1, 0, 0], [1, 0, 0], [1, 2, 3]]", "linear");
    let mut file = file(&text, &[]).unwrap();
    let versions: Vec<_> = (0..=8).map(|n| at(&mut file, n).medium.version()).collect();
    let same: Vec<_> = versions.windows(2).map(|v| v[0] == v[1]).collect();
    assert_eq!(same, [true, true, true, true, false, false, true, true]);
}

#[test]
fn sequences_are_read_at_the_number_of_the_frame() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let base = BASE.replace("homogeneous", "gaussians");
    fs::write(&path, format!("{base}{BOX}file = \"blobs.###.json\"\n{LIGHT}")).unwrap();
    for (frame, c) in [(7, 1.5), (8, 2.5)] {
        let blob = format!("[{{ \"center\": [0, 0, 0], \"a\": 1, \"c\": {c} }}]");
        fs::write(folder.path().join(format!("blobs.{frame:03}.json")), blob).unwrap();
    }
    let mut file = SceneFile::open(&path, &[]).unwrap();
    assert_eq!(file.first_frame(), 0);
    file.check(7..=8).unwrap();
    let density = |file: &mut SceneFile, frame| {
        let loaded = file.frame(frame).unwrap();
        assert_eq!(loaded.files, [path.clone(), folder.path().join(format!("blobs.{frame:03}.json"))]);
        let d = loaded.scene.medium.lattice().dims();
        let mut slice = vec![0.0; (d.x * d.y) as usize];
        loaded.scene.medium.density_slice(0, &mut slice);
        slice[0]
    };
    let (a, b) = (density(&mut file, 7), density(&mut file, 8));
    assert!((b / a - 2.5 / 1.5).abs() < 1e-6, "{a} {b}");
    for told in [file.check(7..=9).unwrap_err(), file.frame(9).map(drop).unwrap_err()] {
        let words = "7:8: frame 9: medium.file: ";
        assert!(told.to_string().contains(words) && told.message.contains("blobs.009.json: No such file"), "{told}");
    }
    // A folder's name is its own.
    let told = load(&format!("{base}{BOX}file = \"a#/b.json\"\n"), &[]).unwrap_err().to_string();
    assert!(told.contains("7:8: medium.file: scenes/a#/b.json: No such"), "{told}");
}

#[test]
fn values_out_of_range_are_told_with_their_frame_and_place() {
    let mut file = animated(&track("light.0.intensity", "[10, 20]", "[1, -1]", "linear"));
    let told = |r: Result<(), SceneFileError>| r.unwrap_err().to_string();
    file.frame_with(15, &volumes).unwrap();
    let at_key = "scenes/a.toml:17:14: frame 20: light[0].intensity = -1; it must be at least 0";
    assert_eq!(told(file.frame_with(20, &volumes).map(drop)), at_key);
    assert_eq!(
        told(file.check(1..=60)),
        "scenes/a.toml:17:11: frame 16: light[0].intensity = -0.19999999999999996; it must be at least 0"
    );
    file.check(1..=15).unwrap();
    let file = animated(&track("camera.samples", "[10, 12]", "[1, 2]", "linear"));
    assert!(
        told(file.check(1..=60)).ends_with("frame 11: camera.samples = 1.5; it must be a whole number from 1 to 4096")
    );
    // What the scene refuses as a whole is found before the frames are rendered, too.
    let file = animated(&track("camera.origin", "[10, 20]", "[[0, 0, 3], [0, 0, 0]]", "linear"));
    assert!(told(file.check(1..=60)).contains("frame 20: camera.target: camera origin"));
}

#[test]
fn tracks_that_cannot_be_followed_are_told_at_their_place() {
    let base = format!("{BASE}{BOX}{LIGHT}[animation]\nframes = [1, 60]\n");
    let told = |track: &str| {
        let text = format!("{base}[[animation.track]]\n{track}");
        let error = file(&text, &[]).map(drop).expect_err(track).to_string();
        error.strip_prefix("scenes/a.toml:").unwrap().to_owned()
    };
    let wrong = |key: &str, frames: &str, values: &str| {
        told(&format!("key = \"{key}\"\nframes = {frames}\nvalues = {values}\n"))
    };
    assert_eq!(told(""), "13:1: animation.track[0].key is missing, as in key = \"light.0.position\"");
    assert_eq!(
        wrong("light.0.positon", "[1]", "[1]"),
        "14:7: animation.track[0].key = \"light.0.positon\"; light.0 has no `positon`; did you mean `position`?"
    );
    assert_eq!(
        wrong("light.1.position", "[1]", "[1]"),
        "14:7: animation.track[0].key = \"light.1.position\"; light has 1 entries, counted from 0"
    );
    assert_eq!(
        wrong("environment.rotation", "[1]", "[1]"),
        "14:7: animation.track[0].key = \"environment.rotation\"; the scene has no `environment`; give it a value \
         there, which the track then changes"
    );
    assert_eq!(
        wrong("light.0.kind", "[1]", "[1]"),
        "14:7: animation.track[0].key = \"light.0.kind\"; it is a string; numbers are animated"
    );
    assert_eq!(
        wrong("light.0", "[1]", "[1]"),
        "14:7: animation.track[0].key = \"light.0\"; it is a table; numbers are animated"
    );
    assert_eq!(
        wrong("animation.frames", "[1]", "[1]"),
        "14:7: animation.track[0].key = \"animation.frames\"; what is animated is the rest of the scene"
    );
    let key = "light.0.position";
    assert_eq!(
        wrong(key, "[1, 5, 5]", "[1]"),
        "15:17: animation.track[0].frames[2] = 5; it must be above 5, the frame before it"
    );
    assert_eq!(
        wrong(key, "[-1]", "[1]"),
        "15:11: animation.track[0].frames[0] = -1; it must be a whole number from 0 to 4294967295"
    );
    assert_eq!(wrong(key, "[]", "[]"), "15:10: animation.track[0].frames = []; at least one frame must have a value");
    assert_eq!(
        wrong(key, "[1, 5]", "[[0, 0, 0]]"),
        "16:10: animation.track[0].values: has 1 values for 2 frames; each frame takes one"
    );
    assert_eq!(
        wrong(key, "[1, 5]", "[[0, 0, 0], 3]"),
        "16:22: animation.track[0].values[1] = 3; it must be of the form of the first value, [0, 0, 0]"
    );
    assert_eq!(
        wrong(key, "[1, 5]", "[[0, 0, 0], [1, \"a\", 2]]"),
        "16:26: animation.track[0].values[1][1] must be a number; it is a string, \"a\""
    );
    assert_eq!(
        wrong(key, "[1, 5]", "[[0, 0, 0], [1, nan, 2]]"),
        "16:26: animation.track[0].values[1][1] = nan; it must be finite"
    );
    assert_eq!(
        told("key = \"light.0.position\"\nframes = [1]\nvalues = [[0, 0, 0]]\ninterpolation = \"cubic\"\n"),
        "17:17: animation.track[0].interpolation = \"cubic\"; it must be \"linear\", \"smooth\" or \"step\""
    );
    for second in ["light.0.position", "light.0.position.2"] {
        let mut text = "key = \"light.0.position\"\nframes = [1]\nvalues = [[0, 0, 0]]\n".to_owned();
        write!(text, "[[animation.track]]\nkey = \"{second}\"\nframes = [1]\nvalues = [1]\n").unwrap();
        assert_eq!(
            told(&text),
            format!(
                "18:7: animation.track[1].key = \"{second}\"; animation.track[0] gives values to light.0.position \
                     already; one track each"
            )
        );
    }
    let animation = |text: &str| super::told(&format!("[animation]\n{text}"));
    assert_eq!(animation("fps = 25"), "7:1: animation.frames is missing, as in frames = [1, 120]");
    assert_eq!(animation("frames = 3"), "8:10: animation.frames must be a list; it is a whole number, 3");
    assert_eq!(animation("frames = [3]"), "8:10: animation.frames = [3]; it must be [first, last], two frames");
    assert_eq!(
        animation("frames = [3, 2]"),
        "8:10: animation.frames = [3, 2]; the last frame must not be before the first"
    );
    assert_eq!(animation("frames = [1, 2]\nfps = 0"), "9:7: animation.fps = 0; it must be above 0");
    assert_eq!(
        animation("frames = [1, 2]\ntracks = []"),
        "9:1: unknown key `tracks` in animation; did you mean `track`?"
    );
}

#[test]
fn overrides_and_tracks_of_one_key_exclude_each_other() {
    let text = format!("{BASE}{BOX}{LIGHT}[animation]\nframes = [1, 60]\n")
        + &track("light.0.position", "[1]", "[[0, 1, 0]]", "linear");
    for (key, value) in [
        ("light.0.position", "[1, 2, 3]"),
        ("light.0.position.1", "2"),
        ("light.0", "{ kind = \"point\", position = [0, 0, 0], intensity = 1 }"),
    ] {
        let told = file(&text, &[("camera.fov", "30"), (key, value)]).map(drop).unwrap_err().to_string();
        let what = "animation.track[0] gives light.0.position its values; take one of both out";
        assert_eq!(told, format!("--set {key}={value}: {what}"));
    }
    file(&text, &[("light.0.intensity", "3"), ("animation.track.0.values", "[[1, 2, 3]]")]).unwrap();
    file(&text, &[("light.0.position", "[1, 2, 3]"), ("animation.track", "[]")]).unwrap();
    let told = file(&text, &[("animation.track.0.frames", "[1, 2]")]).map(drop).unwrap_err().to_string();
    assert!(told.starts_with("scenes/a.toml:16:10: animation.track[0].values: has 1 values for 2"), "{told}");
}

proptest! {
    #[test]
    fn values_at_keys_are_the_keys_and_between_them_lie_between(
        keys in prop::collection::btree_map(0u32..500, prop::array::uniform3(-1e6f64..1e6), 1..9),
        curve in prop::sample::select(vec!["linear", "smooth", "step"]),
        frame in 0u32..600,
    ) {
        let frames: Vec<_> = keys.keys().copied().collect();
        let values: Vec<_> = keys.values().collect();
        let mut file = animated(&track("light.0.position", &format!("{frames:?}"), &format!("{values:?}"), curve));
        for (frame, value) in &keys {
            prop_assert_eq!(position(&at(&mut file, *frame)), DVec3::from_array(*value));
        }
        let after = frames.partition_point(|f| *f <= frame);
        let [a, b] = [after.max(1) - 1, after.min(frames.len() - 1)].map(|n| DVec3::from_array(*values[n]));
        let between = position(&at(&mut file, frame));
        prop_assert!(between.cmpge(a.min(b)).all() && between.cmple(a.max(b)).all(), "{} {} {}", a, between, b);
    }
}
