//! Scenes that are right, and scenes that are not, with what they are told.

use std::path::PathBuf;

use airlight_core::basis::Window;
use airlight_core::light::Light;
use airlight_core::media::{Grid, Phase};
use airlight_core::scene::{
    AllEstimate, Content, Direct, Elimination, EnvironmentEstimate, Estimate, ExtractSun, Interpolation, Jitter,
    LightsEstimate, Opacity, Orders, Path as Paths, Precision, Quality, RecordBasis, Records, ScatteringEstimate,
    Scheme, Shadow, Solver, SurfaceShadow, Sweeps,
};
use glam::{DAffine3, DQuat, DVec3, UVec3, Vec3};
use proptest::prelude::*;

use super::*;
use crate::FormatError;
use crate::volume::Volume;

mod animation;
mod classify;
mod described;
mod grids;
mod refusals;
mod surfaces;

/// The least scene: five lines, so that what follows begins on line 6.
const BASE: &str = "[camera]\norigin = [0, 0, 3]\ntarget = [0, 0, 0]\n[medium]\nkind = \"homogeneous\"\n";
const BOX: &str = "bounds = [[0, 0, 0], [1, 2, 3]]\n";

/// Volumes of 2 × 3 × 4 voxels that no file holds: "cloud.vdb" is placed, "cloud.raw" is not.
fn volumes(path: &Path, grid: Option<&str>) -> Result<Volume, FormatError> {
    let name = grid.unwrap_or("density").to_owned();
    let placed = match path.to_str() {
        Some("scenes/cloud.vdb") => true,
        Some("scenes/cloud.raw") => false,
        _ => return Err(FormatError::unsupported(path, "not one of the test's volumes")),
    };
    let value = match name.as_str() {
        "density" => 0.5,
        "flames" => 2.0,
        "share" | "elsewhere" => 0.5,
        "heat" => 900.0,
        "broken" => -1.0,
        "undefined" => f32::NAN,
        _ => return Err(FormatError::content(path, None, format!("no grid {name:?}; it has density and flames"))),
    };
    let place = if name == "elsewhere" { DVec3::Y } else { DVec3::X };
    let map = DAffine3::from_scale_rotation_translation(DVec3::new(0.5, 1.0, 2.0), DQuat::IDENTITY, place);
    let grid = Grid::dense(UVec3::new(2, 3, 4), map, vec![value; 24]);
    Ok(Volume { name, grid: grid.map_err(|e| FormatError::content(path, None, e.to_string()))?, placed })
}

fn load(text: &str, sets: &[(&str, &str)]) -> Result<LoadedScene, SceneFileError> {
    let sets: Vec<_> = sets.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
    let mut file = SceneFile::parse(text, Path::new("scenes/a.toml"), &sets)?;
    file.frame_with(file.first_frame(), &volumes)
}

fn scene(rest: &str) -> Scene {
    load(&format!("{BASE}{BOX}{rest}"), &[]).unwrap().scene
}

/// The error of a scene whose line 7 and later are `rest`, without the path.
fn told(rest: &str) -> String {
    let error = load(&format!("{BASE}{BOX}{rest}"), &[]).map(|_| ()).expect_err(rest).to_string();
    error.strip_prefix("scenes/a.toml:").map(|e| e.trim_start().to_owned()).unwrap_or(error)
}

#[test]
fn the_least_scene_takes_every_default() {
    let loaded = load(&format!("{BASE}{BOX}"), &[]).unwrap();
    let scene = loaded.scene;
    assert_eq!((scene.camera.up, scene.camera.fov, scene.camera.samples), (DVec3::Y, 40.0, 1));
    assert_eq!((scene.camera.width, scene.camera.height), (512, 512));
    assert_eq!(
        (scene.optics.extinction, scene.optics.albedo, scene.optics.emission),
        (Vec3::ONE, Vec3::ONE, Vec3::ZERO)
    );
    assert_eq!(scene.optics.phase, Phase::Isotropic);
    assert_eq!((scene.estimate, scene.quality), (Estimate::default(), Quality::default()));
    assert!(scene.environment.is_none() && scene.lights.is_empty());
    let (low, high) = scene.medium.lattice().world_bounds();
    assert!((low - DVec3::ZERO).length() < 1e-12 && (high - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-12);
    assert_eq!(loaded.warnings, ["nothing shines: the scene has no [environment], no [[light]] and no emission"]);
    assert!(loaded.files.is_empty());
}

#[test]
fn every_key_that_is_built_arrives() {
    let text = "
        [camera]
        origin = [1.9, 1.3, 2.2]
        target = [0.5, 0.5, 0.5]
        up = [0.1, 1, 0]
        fov = 28
        size = [64, 48.0]
        samples = 4
        [medium]
        kind = \"homogeneous\"
        density = 2.5
        bounds = [[-1, 0, 0], [1, 1, 1.5]]
        extinction = [24, 16.5, 9]
        albedo = 0.9
        anisotropy = 0.5
        emission = [1, 0, 0]
        [environment]
        radiance = [1, 2, 3]
        scale = 0.5
        rotation = -90
        visible = false
        [[light]]
        kind = \"directional\"
        to_light = [0, 2, 0]
        irradiance = [3, 2.6, 2]
        [[light]]
        kind = \"point\"
        position = [1, 2, 3]
        intensity = 4
        [[light]]
        kind = \"spot\"
        position = [0, 5, 0]
        target = [0, 0, 0]
        intensity = 10
        cutoff = 20
        [estimate]
        environment = { kind = \"records\", cells = 20, bands = 4, basis = \"sh\", directions = 192, content = \"phase\", \
            interpolation = \"nearest\", elimination = { kind = \"probes\", n = 5 }, solver = \"march\", \
            extract_sun = false, window = \"lanczos\" }
        lights = { kind = \"direct\", shadow = \"none\", surface_shadow = \"none\" }
        scattering = \"none\"
        [quality]
        step = 0.25
        jitter = \"none\"
        scale = 1
        temporal = false
    ";
    let loaded = load(text, &[]).unwrap();
    let scene = loaded.scene;
    assert!(loaded.warnings.is_empty());
    assert_eq!((scene.camera.width, scene.camera.height, scene.camera.samples), (64, 48, 4));
    assert_eq!((scene.camera.fov, scene.camera.up), (28.0, DVec3::new(0.1, 1.0, 0.0)));
    assert_eq!(scene.optics.extinction, Vec3::new(24.0, 16.5, 9.0));
    assert_eq!((scene.optics.albedo, scene.optics.emission), (Vec3::splat(0.9), Vec3::X));
    assert_eq!(scene.optics.phase, Phase::HenyeyGreenstein { g: 0.5 });
    let mut density = [0.0];
    scene.medium.density_slice(0, &mut density);
    assert_eq!(density, [2.5]);
    let environment = scene.environment.unwrap();
    assert_eq!(environment.image().texels, [[1.0, 2.0, 3.0]]);
    assert_eq!((environment.scale, environment.rotation, environment.visible), (Vec3::splat(0.5), -90.0, false));
    let up = Light::directional(DVec3::Y, Vec3::new(3.0, 2.6, 2.0)).unwrap();
    let point = Light::point(DVec3::new(1.0, 2.0, 3.0), Vec3::splat(4.0)).unwrap();
    let spot = Light::spot(5.0 * DVec3::Y, DVec3::ZERO, Vec3::splat(10.0), 15.0, 20.0).unwrap();
    assert_eq!(scene.lights, [up, point, spot]);
    let records = Records {
        cells: 20,
        bands: 4,
        basis: RecordBasis::Harmonics,
        directions: 192,
        content: Content::Phase,
        interpolation: Interpolation::Nearest,
        elimination: Elimination::Probes(5),
        solver: Solver::March,
        extract_sun: ExtractSun::Never,
        window: Window::Lanczos,
    };
    assert_eq!(scene.estimate.environment, Some(EnvironmentEstimate::Records(records)));
    assert_eq!(
        scene.estimate.lights,
        Some(LightsEstimate::Direct(Direct { shadow: Shadow::None, surface_shadow: SurfaceShadow::None }))
    );
    assert_eq!(scene.quality, Quality { step: 0.25, ..Quality::default() });
}

#[test]
fn qualities_are_taken() {
    let quality = |text: &str| scene(&format!("[quality]\n{text}\n")).quality;
    let all = Quality { steps: Some(32), jitter: Jitter::BlueNoise, scale: 4, temporal: true, ..Quality::default() };
    assert_eq!(quality("steps = 32\njitter = \"blue-noise\"\nscale = 4\ntemporal = true"), all);
    assert_eq!(quality("density = \"f16\"").density, Precision::F16);
    assert_eq!(quality("density = \"f32\""), Quality::default());
    assert_eq!(quality("jitter = false\nscale = 2"), Quality { scale: 2, ..Quality::default() });
}

#[test]
fn phases_take_their_parameters() {
    let phase = |text: &str| scene(&format!("phase = {text}\n")).optics.phase;
    assert_eq!(phase("\"rayleigh\""), Phase::Rayleigh);
    assert_eq!(phase("{ kind = \"isotropic\" }"), Phase::Isotropic);
    assert_eq!(phase("{ kind = \"henyey-greenstein\", g = -0.2 }"), Phase::HenyeyGreenstein { g: -0.2 });
    assert_eq!(
        phase("{ kind = \"double-hg\", forward = 0.8, backward = -0.3, weight = 0.9 }"),
        Phase::DoubleHenyeyGreenstein { forward: 0.8, backward: -0.3, weight: 0.9 }
    );
    let Phase::Table(_) = phase("{ kind = \"table\", angles = [0, 90, 180], values = [3, 1, 1.5] }") else {
        panic!("not a table")
    };
    assert_eq!(
        told("phase = { kind = \"table\", angles = [0, 90], values = [3, 1] }"),
        "7:9: medium.phase: phase table: angles must run from 0 (forward) to 180 degrees (backward)"
    );
    assert_eq!(told("phase = \"double-hg\""), "7:9: medium.phase.forward is missing, as in forward = 0.8");
    assert_eq!(
        told("phase = { kind = \"rayleigh\", g = 1 }"),
        "7:30: unknown key `g` in medium.phase; it belongs to kind \"henyey-greenstein\", not to \"rayleigh\""
    );
    assert_eq!(told("anisotropy = 1"), "7:14: medium.anisotropy = 1; it must be above -1 and below 1");
    assert_eq!(
        told("anisotropy = 0\nphase = \"rayleigh\""),
        "8:9: medium.anisotropy and medium.phase exclude each other; give one"
    );
}

fn grid(rest: &str) -> Result<LoadedScene, String> {
    let base = BASE.replace("homogeneous", "grid");
    load(&format!("{base}{rest}"), &[]).map_err(|e| e.to_string())
}

#[test]
fn grids_are_placed_by_their_file_or_by_bounds() {
    let bounds = |loaded: &LoadedScene| loaded.scene.medium.lattice().world_bounds();
    let near = |a: (DVec3, DVec3), b: (DVec3, DVec3)| (a.0 - b.0).length() < 1e-12 && (a.1 - b.1).length() < 1e-12;
    let own = (DVec3::new(0.75, -0.5, -1.0), DVec3::new(1.75, 2.5, 7.0));
    let loaded = grid("file = \"cloud.vdb\"").unwrap();
    assert!(near(bounds(&loaded), own), "{:?}", bounds(&loaded));
    assert_eq!(loaded.files, [PathBuf::from("scenes/cloud.vdb")]);
    let given = (DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0));
    for file in ["cloud.vdb", "cloud.raw"] {
        let loaded = grid(&format!("file = \"{file}\"\n{BOX}")).unwrap();
        assert!(near(bounds(&loaded), given), "{:?}", bounds(&loaded));
        assert_eq!(loaded.scene.medium.lattice().dims(), UVec3::new(2, 3, 4));
    }
    assert_eq!(
        grid("file = \"cloud.raw\"").unwrap_err(),
        "scenes/a.toml:6:8: medium.file: scenes/cloud.raw does not say where its box lies; \
         give bounds = [[x, y, z], [x, y, z]] in metres"
    );
    let loaded = grid(&format!("file = \"cloud.vdb\"\nemission = 1\nemission_grid = \"flames\"\n{BOX}")).unwrap();
    assert!(near(bounds(&loaded), given));
    let mut slice = [0.0; 6];
    loaded.scene.medium.optics_fields().emission.unwrap().slice(3, &mut slice);
    assert_eq!(slice, [2.0; 6]);
}

#[test]
fn grids_that_cannot_be_used_are_told_at_their_key() {
    let told = |rest: &str| grid(rest).unwrap_err().strip_prefix("scenes/a.toml:").unwrap().to_owned();
    assert_eq!(told("file = \"b.vdb\""), "6:8: medium.file: scenes/b.vdb: not one of the test's volumes");
    assert_eq!(
        told("file = \"cloud.vdb\"\ngrid = \"smoke\""),
        "6:8: medium.file: scenes/cloud.vdb: no grid \"smoke\"; it has density and flames"
    );
    assert_eq!(
        told("file = \"cloud.vdb\"\nemission = 1\nemission_grid = \"smoke\""),
        "8:17: medium.emission_grid: scenes/cloud.vdb: no grid \"smoke\"; it has density and flames"
    );
    assert_eq!(
        told("file = \"cloud.vdb\"\nemission_grid = \"flames\""),
        "7:17: medium.emission_grid: says where the medium shines; give emission, as in emission = 1"
    );
    assert_eq!(
        told("file = \"cloud.vdb\"\ngrid = \"broken\""),
        "6:8: medium.file: scenes/cloud.vdb: density -1 at voxel (0, 0, 0); densities must be from 0 to 1e15"
    );
    assert_eq!(told("grid = \"density\""), "4:1: medium.file is missing, as in file = \"cloud.vdb\"");
    assert_eq!(
        told("file = \"cloud.####.vdb\""),
        "6:8: frame 0: medium.file: scenes/cloud.0000.vdb: not one of the test's volumes"
    );
    assert_eq!(
        told("file = \"cloud.vdb\"\ndensity = 2"),
        "7:1: unknown key `density` in medium; it belongs to kind \"homogeneous\", \"height-fog\" and \"noise\", \
         not to \"grid\""
    );
}

#[test]
fn environments_come_from_a_picture_or_a_number() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let picture = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/city-negative.exr");
    std::fs::copy(&picture, folder.path().join("sky.exr")).unwrap();
    std::fs::write(&path, format!("{BASE}{BOX}[environment]\nfile = \"sky.exr\"\nscale = [1, 2, 3]\n")).unwrap();
    let loaded = load_scene(&path, &[]).unwrap();
    assert_eq!(loaded.files, [path.clone(), folder.path().join("sky.exr")]);
    assert!(loaded.warnings[0].contains("sky.exr: 158 of 131072 texels hold negative"), "{:?}", loaded.warnings);
    assert_eq!(loaded.scene.environment.unwrap().image().width, 512);

    let set = [("environment.file".to_owned(), "none.exr".to_owned())];
    let error = load_scene(&path, &set).unwrap_err();
    assert!(error.to_string().starts_with("--set environment.file=none.exr: environment.file: "), "{error}");
    assert!(told("[environment]\nfile = \"none.exr\"").starts_with("8:8: environment.file: scenes/none.exr: "));
    assert_eq!(told("[environment]"), "7:1: environment needs file = \"sky.exr\" or radiance = 1");
    assert_eq!(
        told("[environment]\nradiance = 1\nfile = \"a.exr\""),
        "8:12: environment.file and environment.radiance exclude each other; give one"
    );
    assert_eq!(told("[environment]\nradiance = -1"), "8:12: environment.radiance = -1; it must be at least 0");

    assert!(load_scene(folder.path(), &[]).is_err());
    let error = load_scene(&folder.path().join("none.toml"), &[]).unwrap_err();
    assert_eq!((error.place, error.path.ends_with("none.toml")), (None, true));
    std::fs::write(&path, b"[camera]\n\n\xff").unwrap();
    let error = load_scene(&path, &[]).unwrap_err().to_string();
    assert!(error.ends_with("a.toml: is not a scene: line 3 holds bytes that are not UTF-8 text"), "{error}");
}

#[test]
fn estimators_default_can_be_left_out_and_do_not_meet_twice() {
    let estimate = |text: &str| scene(&format!("[estimate]\n{text}\n")).estimate;
    assert_eq!(estimate(""), Estimate::default());
    assert_eq!(estimate("lights = \"none\""), Estimate { lights: None, ..Estimate::default() });
    assert_eq!(estimate("environment = false"), Estimate { environment: None, ..Estimate::default() });
    assert_eq!(estimate("environment = { kind = \"none\" }\nscattering = \"none\"").environment, None);
    assert_eq!(estimate("environment = \"records\"\nlights = { }\nall = \"none\""), Estimate::default());
    let sweeps = |text: &str| estimate(&format!("scattering = {text}")).scattering;
    let of = |sweeps: Sweeps| Some(ScatteringEstimate::Sweeps(sweeps));
    assert_eq!(sweeps("\"none\""), None);
    assert_eq!(sweeps("\"sweeps\""), of(Sweeps::default()));
    assert_eq!(
        sweeps("{ orders = 7, cells = 20 }"),
        of(Sweeps { orders: Orders::Count(7), cells: 20, ..Sweeps::default() })
    );
    let (bands, orders) = (4, Orders::Converged { tolerance: 0.01 });
    let text = "{ kind = \"sweeps\", bands = 4, directions = 108, orders = \"converged\", tolerance = 0.01 }";
    assert_eq!(sweeps(text), of(Sweeps { bands, directions: 108, orders, ..Sweeps::default() }));
    let solver = |text: &str| match estimate(&format!("environment = {{ {text} }}")).environment {
        Some(EnvironmentEstimate::Records(records)) => records.solver,
        None => panic!("no records"),
    };
    assert_eq!([solver(""), solver("solver = \"march\"")], [Solver::Sweep, Solver::March]);
    // What sweeps do not know.
    assert_eq!(solver("content = \"phase\""), Solver::March);
    assert_eq!(solver("elimination = { kind = \"probes\", n = 3 }"), Solver::March);
    let all = |text: &str| estimate(&format!("all = {text}")).all;
    let path = |path| Some(AllEstimate::Path(path));
    assert_eq!(all("\"path\""), path(Paths::default()));
    let options = "samples = 8, max_depth = 3, time_limit = 1.5, noise = 0.25";
    let some = Paths { samples: 8, max_depth: Some(3), time_limit: Some(1.5), noise: Some(0.25) };
    assert_eq!(all(&format!("{{ kind = \"path\", {options} }}")), path(some));
    let alone = estimate("all = \"path\"");
    assert_eq!((alone.environment, alone.lights, alone.scattering), (None, None, None));
    let lights = |text: &str| estimate(&format!("lights = {text}")).lights;
    let opacity = |cells, scheme| Some(LightsEstimate::Opacity(Opacity { cells, scheme, ..Opacity::default() }));
    assert_eq!(lights("\"opacity\""), opacity(64, Scheme::ShortCharacteristics));
    assert_eq!(lights("{ cells = 96, scheme = \"metric\" }"), opacity(96, Scheme::Metric));
    assert_eq!(lights("{ kind = \"opacity\", scheme = \"published\" }"), opacity(64, Scheme::Published));
    let direct = |shadow| Some(LightsEstimate::Direct(Direct { shadow, ..Direct::default() }));
    assert_eq!(lights("{ kind = \"direct\", shadow = \"propagated\" }"), direct(Shadow::Propagated));
    assert_eq!(lights("\"direct\""), direct(Shadow::March));
    let surfaces = |text: &str| lights(&format!("{{ kind = {text} }}")).map(|lights| lights.surface_shadow());
    assert_eq!(surfaces("\"direct\""), Some(SurfaceShadow::Map(512)));
    assert_eq!(surfaces("\"opacity\", surface_shadow = \"ray\""), Some(SurfaceShadow::Ray));
    assert_eq!(surfaces("\"direct\", surface_shadow = { kind = \"map\", texels = 96 }"), Some(SurfaceShadow::Map(96)));
    let records = |text: &str| match estimate(&format!("environment = {{ {text} }}")).environment {
        Some(EnvironmentEstimate::Records(r)) => (r.extract_sun, r.window),
        None => panic!("no records"),
    };
    assert_eq!(records(""), (ExtractSun::Auto, Window::None));
    assert_eq!(records("extract_sun = \"auto\", window = \"hanning\""), (ExtractSun::Auto, Window::Hanning));
    assert_eq!(records("extract_sun = true, window = false"), (ExtractSun::Always, Window::None));
    assert_eq!(records("extract_sun = \"none\", window = \"none\""), (ExtractSun::Never, Window::None));
    let elimination = |text: &str| match estimate(&format!("environment.elimination = {text}")).environment {
        Some(EnvironmentEstimate::Records(r)) => r.elimination,
        None => panic!("no records"),
    };
    assert_eq!(elimination("\"none\""), Elimination::None);
    assert_eq!(elimination("\"exact\""), Elimination::Exact);
    assert_eq!(elimination("\"probes\""), Elimination::Probes(3));
    assert_eq!(
        told("[estimate]\nenvironment = \"records\"\nall = { kind = \"path\", samples = 8 }"),
        "8:15: estimate.all brings all light; estimate.environment would bring a part of it twice; give one of them"
    );
    assert_eq!(
        told("[estimate]\nenvironment = { kind = \"opacity\" }"),
        "8:24: estimate.environment.kind = \"opacity\"; it must be \"records\" or \"none\""
    );
    assert_eq!(
        told("[estimate]\nenvironment = { cells = 0 }"),
        "8:25: estimate.environment.cells = 0; it must be a whole number from 1 to 1024"
    );
    assert_eq!(
        told("[estimate]\nenvironment = { bands = 2.5 }"),
        "8:25: estimate.environment.bands = 2.5; it must be a whole number from 1 to 10"
    );
}

#[test]
fn bases_of_light_are_taken() {
    let basis = |text: &str| match scene(&format!("[estimate]\nenvironment = {{ {text} }}\n")).estimate.environment {
        Some(EnvironmentEstimate::Records(records)) => (records.basis, records.bands),
        None => panic!("no records"),
    };
    let isotropic = "content = \"transmittance\", directions = 768";
    assert_eq!(basis("bands = 4, basis = \"sh\", directions = 192"), (RecordBasis::Harmonics, 4));
    assert_eq!(basis(&format!("basis = \"dsf\", {isotropic}")), (RecordBasis::Discrete(42), 3));
    let many = "basis = { kind = \"dsf\", functions = 162 }";
    assert_eq!(basis(&format!("{many}, {isotropic}")), (RecordBasis::Discrete(162), 3));
    assert_eq!(
        told("[estimate]\nenvironment = { basis = { kind = \"dsf\", functions = 100 } }"),
        "8:53: estimate.environment.basis.functions = 100; it must be 12, 42, 162 or 642"
    );
    assert_eq!(
        told("[estimate]\nenvironment = { basis = \"dsf\", bands = 3 }"),
        "8:40: estimate.environment.bands are of spherical harmonics; basis = \"dsf\" has functions in their place"
    );
    assert!(
        told("[estimate]\nenvironment = { basis = \"dsf\" }").starts_with(
            "8:15: estimate.environment.content: content = \"radiance\" is moments of spherical harmonics"
        )
    );
}

#[test]
fn overrides_reach_the_scene_and_are_named_in_errors() {
    let text = format!("{BASE}{BOX}[[light]]\nkind = \"point\"\nposition = [0, 1, 0]\nintensity = 1\n");
    let sets = [
        ("light.0.intensity", "[1, 2, 3]"),
        ("quality.step", "0.5"),
        ("estimate.environment.bands", "4"),
        ("medium.phase", "rayleigh"),
        ("camera.size", "[16, 9]"),
    ];
    let scene = load(&text, &sets).unwrap().scene;
    assert_eq!(scene.lights, [Light::point(DVec3::Y, Vec3::new(1.0, 2.0, 3.0)).unwrap()]);
    assert_eq!((scene.quality.step, scene.camera.width, scene.camera.height), (0.5, 16, 9));
    assert_eq!(scene.optics.phase, Phase::Rayleigh);
    let records = Records { bands: 4, ..Records::default() };
    assert_eq!(scene.estimate.environment, Some(EnvironmentEstimate::Records(records)));

    let told = |key: &str, value: &str| load(&text, &[(key, value)]).unwrap_err().to_string();
    assert_eq!(told("light.3.intensity", "2"), "--set light.3.intensity=2: there is 1 light, light.0");
    assert_eq!(
        told("light.0.intensity", "-2"),
        "--set light.0.intensity=-2: light[0].intensity = -2; it must be at least 0"
    );
    assert_eq!(told("qualty.step", "1"), "--set qualty.step=1: unknown key `qualty`; did you mean `quality`?");
    assert_eq!(
        told("camera.fov", "wide"),
        "--set camera.fov=wide: camera.fov must be a number; it is a string, \"wide\""
    );
    assert_eq!(
        told("camera.up", "[0, 0, 1]"),
        "--set camera.up=[0, 0, 1]: camera.up: camera up [0, 0, 1] is zero, not finite or along the direction of view"
    );
}

/// Pieces that scenes are made of, so that random ones get past the first line.
fn piece() -> impl Strategy<Value = String> {
    prop_oneof![
        prop::sample::select(vec![
            "[camera]\n",
            "[medium]\n",
            "[[light]]\n",
            "[estimate]\n",
            "[quality]\n",
            "[environment]\n",
            "[[surface]]\n",
            "[animation]\nframes = [0, 9]\n[[animation.track]]\nkey = \"medium.bounds\"\n",
            "frames",
            "values",
            "origin",
            "target",
            "kind",
            "bounds",
            "albedo",
            "phase",
            "environment",
            "lights",
            "step",
            "radiance",
            " = ",
            "\"grid\"",
            "\"homogeneous\"",
            "\"records\"",
            "\"point\"",
            "[0, 0, 0]",
            "[[0, 0, 0], [1, 1, 1]]",
            "1",
            "-1.5",
            "inf",
            "nan",
            "1e400",
            "99999999999999999999",
            "true",
            "{ kind = \"table\" }",
            "{",
            "}",
            "[",
            "]",
            ",",
            "\n",
            ".",
            "1979-05-27",
            "# ",
            "\"\"\"",
            "'",
            "\u{fffd}",
            "\u{301}",
            "\t",
            "\r",
        ])
        .prop_map(str::to_owned),
        "\\PC{0,12}",
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn random_text_is_an_error_with_a_place_in_it(
        pieces in prop::collection::vec(piece(), 0..40),
        whole in any::<bool>(),
        set in (piece(), piece()),
    ) {
        let start = if whole { format!("{BASE}{BOX}") } else { String::new() };
        let text = format!("{start}{}", pieces.concat());
        let sets = [(set.0.as_str(), set.1.as_str())];
        for sets in [&sets[..], &[]] {
            if let Err(error) = load(&text, sets) {
                prop_assert!(!error.message.is_empty());
                let (line, column) = error.place.unwrap_or((1, 1));
                prop_assert!(line <= text.matches('\n').count() + 1);
                prop_assert!(column <= text.chars().count() + 1);
                prop_assert!(error.report().starts_with(&error.to_string()));
            }
        }
    }

    #[test]
    fn cut_scenes_never_panic(cut in 0usize..400) {
        let text = format!("{BASE}{BOX}[environment]\nradiance = [1, 2, 3]\n[[light]]\nkind = \"point\"\nposition = [0, 1, 0]\n\
                            intensity = 4.5e1\n[estimate]\nenvironment = {{ bands = 2, elimination = \"none\" }}\n");
        let _ = load(&text[..cut.min(text.len())], &[]);
    }

    #[test]
    fn a_number_set_is_the_number_read(step in 1e-3f64..1e6, fov in 0.001f64..179.0, samples in 1u32..4096) {
        let values = [step.to_string(), fov.to_string(), samples.to_string()];
        let sets = [("quality.step", &*values[0]), ("camera.fov", &*values[1]), ("camera.samples", &*values[2])];
        let scene = load(&format!("{BASE}{BOX}"), &sets).unwrap().scene;
        prop_assert_eq!((scene.quality.step, scene.camera.fov, scene.camera.samples), (step, fov, samples));
    }
}
