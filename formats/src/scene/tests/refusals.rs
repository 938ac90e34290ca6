//! What is wrong is told with its line and what would be right.

use super::*;

#[test]
fn lights_are_told_what_they_lack() {
    assert_eq!(told("[light]\nkind = \"point\""), "7:1: light is a list of tables: write [[light]]");
    assert_eq!(
        told("[[light]]\n[[light]]"),
        "7:1: light[0].kind is missing; it must be \"directional\", \"point\" or \"spot\""
    );
    assert_eq!(
        told("[[light]]\nkind = \"sun\""),
        "8:8: light[0].kind = \"sun\"; it must be \"directional\", \"point\" or \"spot\""
    );
    let point = "[[light]]\nkind = \"point\"\nposition = [0, 1, 0]\n";
    assert_eq!(told(point), "7:1: light[0].intensity is missing, as in intensity = 10");
    assert_eq!(
        told(&format!("{point}intensity = [1, 2]")),
        "10:13: light[0].intensity must be a number or [r, g, b]; it is a list of 2"
    );
    assert_eq!(told(&format!("{point}intensity = nan")), "10:13: light[0].intensity = nan; it must be finite");
    assert_eq!(
        told(&format!("{point}intensity = 1e300")),
        "10:13: light[0].intensity = 1e300; it must be at most 3.4e38"
    );
    assert_eq!(
        told("[[light]]\nkind = \"directional\"\nirradiance = 1\nto_light = [0, 0, 0]"),
        "10:12: light[0].to_light: direction [0, 0, 0] has no length or is not finite"
    );
    let spot = "[[light]]\nkind = \"spot\"\nposition = [0, 1, 0]\ntarget = [0, 0, 0]\nintensity = 1\ncutoff = 20\n";
    assert_eq!(
        told(&format!("{spot}beam = 30")),
        "13:8: light[0].beam: spot angles: beam 30° and cutoff 20°; they must satisfy 0 ≤ beam ≤ cutoff ≤ 180, cutoff above 0"
    );
}

#[test]
fn keys_and_types_are_strict() {
    assert_eq!(told("extintion = 2"), "7:1: unknown key `extintion` in medium; did you mean `extinction`?");
    assert_eq!(
        told("[quality]\nzoom = 2"),
        "8:1: unknown key `zoom` in quality; the keys are `step`, `steps`, `jitter`, `scale`, `temporal` and `density`"
    );
    assert_eq!(told("[qualty]"), "7:2: unknown key `qualty`; did you mean `quality`?");
    assert_eq!(told("albedo = 1.2"), "7:10: medium.albedo = 1.2; it must be from 0 to 1");
    assert_eq!(told("albedo = [0.5, \"a\", 1]"), "7:16: medium.albedo[1] must be a number; it is a string, \"a\"");
    assert_eq!(
        told("extinction = true"),
        "7:14: medium.extinction must be a number or [r, g, b]; it is a truth value, true"
    );
    assert_eq!(told("[quality]\nstep = 0"), "8:8: quality.step = 0; it must be at least 0.001 voxels");
    assert_eq!(told("[[camera]]").split(": ").nth(1), Some("not TOML"));
    assert_eq!(
        told("[environment]\nradiance = 1\nvisible = 1"),
        "9:11: environment.visible must be true or false; it is a whole number, 1"
    );
    assert_eq!(
        told("quality = 1"),
        "7:1: unknown key `quality` in medium; the keys are `kind`, `extinction`, `albedo`, `anisotropy`, `phase`, `emission`, `density` and `bounds`"
    );
    let without = |part: &str| load(&format!("{BASE}{BOX}").replace(part, ""), &[]).unwrap_err().to_string();
    assert_eq!(
        without("origin = [0, 0, 3]\n"),
        "scenes/a.toml:1:1: camera.origin is missing, as in origin = [0, 0, 3]"
    );
    assert_eq!(without(BOX), "scenes/a.toml:4:1: medium.bounds is missing, as in bounds = [[0, 0, 0], [1, 1, 1]]");
    assert_eq!(
        without("kind = \"homogeneous\"\n"),
        "scenes/a.toml:4:1: medium.kind is missing; it must be \"grid\", \"gaussians\", \"homogeneous\", \"height-fog\" \
         or \"noise\""
    );
    assert_eq!(
        load("", &[]).unwrap_err().to_string(),
        "scenes/a.toml: camera is missing, as in [camera] with origin = [0, 0, 3] and target = [0, 0, 0]"
    );
}

#[test]
fn what_the_scene_itself_refuses_has_a_line_too() {
    let camera = |line: &str, new: &str| load(&format!("{BASE}{BOX}").replace(line, new), &[]).unwrap_err().to_string();
    assert_eq!(
        camera("target = [0, 0, 0]", "target = [0, 0, 3]"),
        "scenes/a.toml:3:10: camera.target: camera origin [0, 0, 3] and target [0, 0, 3] do not give a direction; \
         they must be finite and apart"
    );
    assert_eq!(
        camera("target = [0, 0, 0]", "target = [0, 0, 0]\nup = [0, 0, 1]"),
        "scenes/a.toml:4:6: camera.up: camera up [0, 0, 1] is zero, not finite or along the direction of view"
    );
    assert_eq!(
        told("[estimate]\nenvironment = { directions = 50 }"),
        "8:30: estimate.environment.directions: directions = 50; \
         HEALPix takes 12·n² directions with n from 1 to 64; the next is 108"
    );
    assert_eq!(
        told("anisotropy = 0.5\n[estimate]\nscattering = { bands = 4 }"),
        "9:14: estimate.scattering.directions: directions = 48; 4 bands of spherical harmonics need at least 108 directions"
    );
    assert_eq!(
        told("anisotropy = 0.5\n[estimate]\nenvironment = { content = \"transmittance\" }"),
        "9:27: estimate.environment.content: content = \"transmittance\" holds for an isotropic phase function only; \
         take \"radiance\" or \"phase\", or set anisotropy = 0"
    );
}

#[test]
fn suns_that_cannot_be_taken_out_are_told() {
    assert_eq!(
        told("[estimate]\nenvironment = { extract_sun = true }\nlights = \"none\""),
        "8:31: estimate.environment.extract_sun: extract_sun = true lights the sun by estimate.lights, which is \"none\"; \
         give it \"opacity\" or \"direct\", or leave extract_sun out"
    );
    assert_eq!(
        told("[environment]\nradiance = 1\n[estimate]\nenvironment = { extract_sun = true }"),
        "10:31: estimate.environment.extract_sun: extract_sun = true asks for a sun, and no part of the environment within \
         10° stands out; leave extract_sun out"
    );
}

#[test]
fn what_is_not_built_says_so_and_its_options_are_checked_all_the_same() {
    for (text, expected) in [
        ("[background]\ncolour = \"a.exr\"", "8:1: unknown key `colour` in background; did you mean `color`?"),
        ("[quality]\nsteps = 0", "8:9: quality.steps = 0; it must be a whole number from 1 to 1048576"),
        ("[quality]\nstep = 1\nsteps = 9", "9:9: quality.step and quality.steps exclude each other; give one"),
        ("[quality]\njitter = \"white\"", "8:10: quality.jitter = \"white\"; it must be \"none\" or \"blue-noise\""),
        ("[quality]\nscale = 3", "8:9: quality.scale = 3; it must be 1, 2 or 4"),
        ("[quality]\ntemporal = 1", "8:12: quality.temporal must be true or false; it is a whole number, 1"),
        (
            "[estimate]\nlights = { kind = \"opacity\", cells = 1025 }",
            "8:38: estimate.lights.cells = 1025; it must be a whole number from 1 to 1024",
        ),
        (
            "[estimate]\nlights = { kind = \"opacity\", scheme = \"fast\" }",
            "8:39: estimate.lights.scheme = \"fast\"; it must be \"short-characteristics\", \"metric\" or \"published\"",
        ),
        (
            "[estimate]\nlights = { kind = \"direct\", surface_shadow = { kind = \"map\", texels = 0 } }",
            "8:71: estimate.lights.surface_shadow.texels = 0; it must be a whole number from 1 to 8192",
        ),
        (
            "[estimate]\nscattering = { orders = 4, tolerance = 0.1 }",
            "8:25: estimate.scattering: a number of orders needs no tolerance; give one of them",
        ),
        (
            "[estimate]\nscattering = { tolerance = 1 }",
            "8:28: estimate.scattering.tolerance = 1; it must be above 0 and below 1",
        ),
        (
            "[estimate]\nscattering = { cells = 0 }",
            "8:24: estimate.scattering.cells = 0; it must be a whole number from 1 to 1024",
        ),
        (
            "[estimate]\nscattering = { orders = \"many\" }",
            "8:25: estimate.scattering.orders = \"many\"; it must be \"converged\" or a whole number from 1 to 10000",
        ),
        (
            "[estimate]\nall = { kind = \"path\", samples = 0 }",
            "8:34: estimate.all.samples = 0; it must be a whole number from 1 to 1048576",
        ),
        (
            "[estimate]\nall = { kind = \"path\", noise = 2 }",
            "8:32: estimate.all.noise = 2; it must be above 0 and at most 1",
        ),
        (
            "[estimate]\nall = { kind = \"transfer\", functions = 640 }",
            "8:40: estimate.all.functions = 640; directions are those of a subdivided icosahedron: one of [12, 42, 162, 642, 2562]",
        ),
        (
            "[estimate]\nall = { kind = \"transfer\", basis = \"sh\", functions = 30 }",
            "8:54: estimate.all.functions = 30; spherical harmonics come in squares of bands; 25 or 36 would do",
        ),
        (
            "[estimate]\nall = { kind = \"transfer\", directions = 48 }",
            "8:41: estimate.all.directions is an option of solver = \"ordinates\"",
        ),
        (
            "[estimate]\nall = { kind = \"transfer\", solver = \"ordinates\", photons = 4 }",
            "8:60: estimate.all.photons is an option of solver = \"photons\"",
        ),
        (
            "[estimate]\nall = { kind = \"transfer\", clusters = \"none\", components = 4 }",
            "8:60: estimate.all.components are those of clusters, and clusters = \"none\"; give one of them",
        ),
        (
            "[estimate]\nall = { kind = \"transfer\", prefilter = { kind = \"gaussian\", width = 0 } }",
            "8:69: estimate.all.prefilter.width = 0; it must be from 0.1 to 10 times the least angle between directions",
        ),
        (
            "[estimate]\nall = { kind = \"transfer\", solver = \"ordinates\", directions = 50 }",
            "8:63: estimate.all.directions: directions = 50; HEALPix takes 12·n² directions with n from 1 to 64; the next is 108",
        ),
        (
            "[[light]]\nkind = \"point\"\nposition = [2, 2, 2]\nintensity = 1\n[estimate]\nall = \"transfer\"",
            "12:7: estimate.all: `transfer` carries light from far away, and a point or spot light is near; take `records`, \
             `opacity` and `sweeps`",
        ),
        (
            "[estimate]\nenvironment = { solver = \"guess\" }",
            "8:26: estimate.environment.solver = \"guess\"; it must be \"sweep\" or \"march\"",
        ),
        (
            "[estimate]\nenvironment = { extract_sun = 3 }",
            "8:31: estimate.environment.extract_sun = 3; it must be \"auto\", true or false",
        ),
        (
            "[estimate]\nenvironment = { basis = \"srbf\" }",
            "8:25: estimate.environment.basis = \"srbf\" is not built yet; take \"sh\" or \"dsf\"",
        ),
        (
            "[estimate]\nenvironment = { window = \"hann\" }",
            "8:26: estimate.environment.window = \"hann\"; it must be \"none\", \"hanning\" or \"lanczos\"",
        ),
    ] {
        assert_eq!(told(text), expected);
    }
    for (kind, rest, expected) in [
        (
            "gaussians",
            "blobs = [{ center = [0, 0, 0], a = 9.0, d = 2.0 }]",
            "7:41: unknown key `d` in medium.blobs[0]; did you mean `a`?",
        ),
        (
            "gaussians",
            "blobs = [{ center = [0, 0, 0], a = 0, c = 2.0 }]",
            "7:36: medium.blobs[0].a = 0; it must be from 1e-15 to 1e15",
        ),
        ("gaussians", "blobs = [{ center = [0, 0, 0], a = 1 }]", "7:10: medium.blobs[0].c is missing, as in c = 2.0"),
        (
            "gaussians",
            "blobs = [{ center = [0, 0, 0], a = 1, c = 9e14 }, { center = [0, 0, 0], a = 1, c = 9e14 }]",
            "7:9: medium.blobs: the sum of all c, 1800000000000000: it must be from 0 to 1e15",
        ),
        (
            "gaussians",
            "file = \"a.json\"\nblobs = []",
            "8:9: medium.file and medium.blobs exclude each other; give one",
        ),
        (
            "gaussians",
            "cells = 8",
            "4:1: medium.blobs is missing, as in blobs = [{ center = [0, 0, 0], a = 9.0, c = 2.0 }], or file = \"blobs.json\"",
        ),
        ("gaussians", "file = \"no.json\"", "7:8: medium.file: scenes/no.json: No such file or directory (os error 2)"),
        ("height-fog", "falloff = -2", "7:11: medium.falloff = -2; it must be at least 0"),
        ("height-fog", "cells = 5000", "7:9: medium.cells = 5000; it must be a whole number from 1 to 4096"),
        ("height-fog", "density = 1e16", "7:11: medium.density = 1e16; it must be from 0 to 1e15"),
        ("noise", "octaves = 0", "4:1: medium.scale is missing, as in scale = 0.5, in metres"),
        ("noise", "scale = 1\noctaves = 0", "8:11: medium.octaves = 0; it must be a whole number from 1 to 16"),
        ("noise", "scale = 1\ncontrast = -1", "8:12: medium.contrast = -1; it must be from 0 to 1000"),
        ("noise", "scale = 0", "7:9: medium.scale = 0; it must be above 0"),
        (
            "grid",
            "file = \"cloud.vdb\"\nnoise = { scale = 1, density = 2 }",
            "8:22: unknown key `density` in medium.noise; the keys are `scale`, `octaves`, `seed` and `contrast`",
        ),
    ] {
        let base = BASE.replace("homogeneous", kind);
        let error = load(&format!("{base}{BOX}{rest}"), &[]).unwrap_err().to_string();
        assert_eq!(error, format!("scenes/a.toml:{expected}"));
    }
    let plain = "surface = []\nanimation = { }\nbackground = false\n";
    let plain = format!("{plain}{BASE}{BOX}[quality]\njitter = false\ntemporal = false\n");
    assert!(load(&plain, &[]).is_ok());
}

#[test]
fn the_report_marks_the_place() {
    let error = load(&format!("{BASE}{BOX}albedo = [0.5, 1.5, 0.5]  # grey\n"), &[]).unwrap_err();
    assert_eq!(error.place, Some((7, 10)));
    assert_eq!(
        error.report(),
        "scenes/a.toml:7:10: medium.albedo = [0.5, 1.5, 0.5]; it must be from 0 to 1\n\
         \u{20} |\n7 | albedo = [0.5, 1.5, 0.5]  # grey\n\u{20} |          ^^^^^^^^^^^^^^^"
    );
    let error = load("[camera]\norigin = [0, 0\n", &[]).unwrap_err();
    assert!(error.message.starts_with("not TOML: "), "{error}");
    assert!(error.place.is_some());
}

#[test]
fn depth_and_size_have_limits() {
    for text in [
        format!("{} = 1", vec!["a"; 200_000].join(".")),
        format!("[{}]", vec!["a"; 200_000].join(".")),
        format!("a = {}", "[".repeat(200_000)),
        format!("a = {}1{}", "{ a = ".repeat(200_000), "}".repeat(200_000)),
    ] {
        assert!(load(&text, &[]).is_err());
    }
}
