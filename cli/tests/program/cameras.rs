//! Cameras, and pictures of every size.

use airlight_formats::image::read_exr_channels;

use crate::workbench::Workbench;

/// `--set` of a camera key.
fn set(bench: &Workbench, assignment: &str, words: &[&str]) {
    let scene = bench.path("fog.toml");
    bench.refused(["render".as_ref(), scene.as_os_str(), "--set".as_ref(), assignment.as_ref()], 2, words);
}

#[test]
fn degenerate_cameras_are_refused_by_their_key() {
    let bench = Workbench::new();
    set(&bench, "camera.target=[1.9, 1.3, 2.2]", &["camera.target", "apart"]);
    set(&bench, "camera.up=[-1.4, -0.8, -1.7]", &["camera.up", "along the direction of view"]);
    set(&bench, "camera.up=[0, 0, 0]", &["camera.up", "zero"]);
    set(&bench, "camera.up=[0, nan, 0]", &["camera.up[1]", "finite"]);
    set(&bench, "camera.origin=[inf, 0, 0]", &["camera.origin[0]", "finite"]);
    set(&bench, "camera.origin=[1e60, 0, 0]", &["camera.origin", "too far"]);
    for fov in ["0", "180", "-40", "nan", "inf", "\"wide\""] {
        set(&bench, &format!("camera.fov={fov}"), &["camera.fov"]);
    }
    for size in ["[0, 16]", "[24, 0]", "[24]", "[24, 16, 1]", "[-1, 16]", "[16385, 16]", "[1.5, 16]", "24"] {
        set(&bench, &format!("camera.size={size}"), &["camera.size"]);
    }
    for samples in ["0", "-1", "4097", "1.5"] {
        set(&bench, &format!("camera.samples={samples}"), &["camera.samples"]);
    }
}

#[test]
fn bad_options_of_size_and_samples_are_refused() {
    let bench = Workbench::new();
    let scene = bench.path("fog.toml").into_os_string().into_string().unwrap();
    for (option, value, word) in [
        ("--size", "24", "640x480"),
        ("--size", "24x", "not a number of pixels"),
        ("--size", "x", "not a number of pixels"),
        ("--size", "-3x4", "not a number of pixels"),
        ("--size", "0x4", "from 1 to 16384"),
        ("--size", "24x1000000", "from 1 to 16384"),
        ("--size", "99999999999x2", "not a number of pixels"),
        ("--samples", "0", "camera.samples"),
        ("--samples", "many", "--samples"),
        ("--exposure", "nan", "from -128 to 128"),
        ("--exposure", "1e30", "from -128 to 128"),
    ] {
        bench.refused(["render", &scene, &format!("{option}={value}")], 2, &[word]);
    }
}

#[test]
fn any_camera_that_can_be_makes_a_sane_picture() {
    let bench = Workbench::new();
    let scene = bench.path("fog.toml").into_os_string().into_string().unwrap();
    for sets in [
        // Inside the medium, at its middle, on its wall and at its corner.
        vec!["camera.origin=[0.5, 0.4, 0.3]"],
        vec!["camera.origin=[0.5, 0.5, 0.5]", "camera.target=[0.5, 0.5, 0]"],
        vec!["camera.origin=[0.5, 1, 0.4]"],
        vec!["camera.origin=[0, 0, 0]"],
        // Along an axis, and with everything behind the eye.
        vec!["camera.origin=[0.5, 0.5, 3]"],
        vec!["camera.target=[5, 5, 5]"],
        // Far away, nearly flat and nearly a half sphere.
        vec!["camera.origin=[1e9, 1e9, 2e9]", "camera.fov=1e-7"],
        vec!["camera.fov=1e-200"],
        vec!["camera.fov=179.999999"],
        vec!["camera.up=[0, 1e-150, 0]"],
        vec!["camera.size=[1, 1]"],
        vec!["camera.size=[3, 97]", "camera.samples=7"],
    ] {
        let mut arguments = vec!["render", &scene, "-o", "a.exr"];
        sets.iter().for_each(|set| arguments.extend(["--set", set]));
        bench.run(&arguments).well();
        let exr = read_exr_channels(&bench.out().join("a.exr")).unwrap();
        let brightest = 0.5f32.max(2.0); // the sky alone, and what the sun can add to it
        for name in ["R", "G", "B", "A", "transmittance.R", "transmittance.G", "transmittance.B"] {
            let values = exr.channel(name).unwrap();
            assert!(values.iter().all(|v| (0.0..=brightest).contains(v)), "{sets:?}: {name}: {values:?}");
        }
        assert!(exr.channel("depth.Z").unwrap().iter().all(|v| *v >= 0.0), "{sets:?}");
    }
}

#[test]
fn an_eye_inside_the_medium_sees_half_of_what_one_across_it_sees() {
    let bench = Workbench::new();
    let scene = bench.path("fog.toml").into_os_string().into_string().unwrap();
    let through = |origin: &str| {
        let origin = format!("camera.origin={origin}");
        let sets = ["--set", &origin, "--set", "camera.target=[0.5, 0.5, -9]", "--set", "camera.fov=0.01"];
        let mut arguments = vec!["render", &scene, "-o", "a.exr"];
        arguments.extend(sets);
        bench.run(&arguments).well();
        read_exr_channels(&bench.out().join("a.exr")).unwrap().channel("transmittance.G").unwrap()[100]
    };
    // Beer and Lambert over one metre and over half of it; the rounding of 64 f32 products of about 1 stays below.
    let (outside, inside) = (through("[0.5, 0.5, 3]"), through("[0.5, 0.5, 0.5]"));
    assert!((outside - (-3.0f32).exp()).abs() < 1e-5, "{outside}");
    assert!((inside - (-1.5f32).exp()).abs() < 1e-5, "{inside}");
}
