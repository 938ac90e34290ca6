//! Pictures of the reference scene against those that an independent integrator made and Mitsuba 3 checked.
//!
//! The truth is box-filtered over each pixel; `samples` says how many sub-pixel positions stand for that here. What
//! the scene is, and how good each file, says `data/reference/README.md`.

use std::sync::{Arc, OnceLock};
use std::time::Instant;

use airlight::basis::{SphericalHarmonics, Window};
use airlight::glam::{DVec3, Vec3};
use airlight::light::{Environment, Light};
use airlight::media::{Gaussian, Gaussians, GridMedium, Lattice, Optics, Phase};
use airlight::scene::{
    Camera, Content, Direct, Elimination, EnvironmentEstimate, Estimate, ExtractSun, Film, Interpolation,
    LightsEstimate, Opacity, Quality, RecordBasis, Records, Scene, Shadow, Solver,
};
use airlight_formats::{FormatError, volume};
use libtest_mimic::Failed;

use crate::compare::compare;
use crate::truth::{self, File};
use crate::{Case, Difference, Need, Record, Subject, Tolerance, check, tolerance};

/// The longest side of the reference density, voxels.
const SIDE: u32 = 72;

/// What the reference scene is made of.
#[derive(Clone)]
pub(crate) struct Parts {
    medium: Arc<GridMedium>,
    pub(crate) environment: Environment,
}

/// Read once: its media and environments then keep their versions.
pub(crate) fn parts() -> Result<Parts, Failed> {
    static PARTS: OnceLock<Result<Parts, String>> = OnceLock::new();
    let load = || -> Result<Parts, Failed> {
        let File { path, bytes } = truth::file("density.nrrd")?;
        let beside = |name: &str| Err(FormatError::unsupported(name, "the reference density stands in one file"));
        let grid = volume::parse(volume::Format::Nrrd, &path, &bytes, None, &beside)?.grid;
        let mut environment = Environment::new(truth::picture("env.exr")?.0)?;
        environment.visible = false;
        Ok(Parts { medium: Arc::new(GridMedium::new(Arc::new(grid), None)?), environment })
    };
    Ok(PARTS.get_or_init(|| load().map_err(|e| crate::case::message(&e))).clone()?)
}

/// Cells along the longest side for the reference's Gaussians, whose narrowest are then six cells wide.
const BLOB_CELLS: u32 = 144;

/// The reference's Gaussians in the scene's box.
fn blobs() -> Result<Arc<Gaussians>, Failed> {
    let File { path, bytes } = truth::file("blobs.json")?;
    let all: serde_json::Value = serde_json::from_slice(&bytes)?;
    let medium = &all["medium"];
    let bad = || Failed::from(format!("{} does not hold the reference's Gaussians", path.display()));
    let list = |key: &str| medium[key].as_array().ok_or_else(bad);
    let number = |value: &serde_json::Value| value.as_f64().ok_or_else(bad);
    let mut blobs = Vec::new();
    for ((a, b), c) in list("a")?.iter().zip(list("b")?).zip(list("c")?) {
        let center = DVec3::new(number(&b[0])?, number(&b[1])?, number(&b[2])?);
        blobs.push(Gaussian { center, a: number(a)?, c: number(c)? });
    }
    let (min, max) = (DVec3::new(-0.6, 0.0, -0.5), DVec3::new(0.6, 0.8, 0.5));
    Ok(Arc::new(Gaussians::new(blobs, Lattice::of_cells(BLOB_CELLS, min, max)?)?))
}

/// The reference scene: grey, isotropic, unlit.
///
/// # Errors
/// A missing file.
pub fn scene() -> Result<Scene, Failed> {
    Ok(Scene {
        camera: Camera {
            origin: DVec3::new(1.7, 1.25, 1.9),
            target: DVec3::new(0.05, 0.35, 0.0),
            up: DVec3::Y,
            fov: 30.0,
            width: 160,
            height: 120,
            samples: 16,
        },
        medium: parts()?.medium,
        optics: Optics { albedo: Vec3::new(0.98, 0.9, 0.75), ..Optics::grey(16.0, 1.0) },
        environment: None,
        background: None,
        surfaces: None,
        frame: 0,
        lights: Vec::new(),
        estimate: Estimate::single(),
        quality: Quality { step: 0.5, ..Quality::default() },
    })
}

/// The reference scene in its environment, which is hidden, with records of `records`.
///
/// # Errors
/// A missing file.
pub fn in_environment(records: Records) -> Result<Scene, Failed> {
    let mut scene = scene()?;
    scene.environment = Some(parts()?.environment);
    scene.estimate.environment = Some(EnvironmentEstimate::Records(records));
    Ok(scene)
}

/// Trilinear records of 40 cells.
pub fn records(content: Content, bands: u32, directions: u32) -> Records {
    Records {
        cells: 40,
        bands,
        basis: RecordBasis::Harmonics,
        directions,
        content,
        interpolation: Interpolation::Trilinear,
        elimination: Elimination::Exact,
        solver: Solver::March,
        // The pictures are of the environment as it is truncated, and of the whole.
        extract_sun: ExtractSun::Never,
        window: Window::None,
    }
}

/// What of a film is compared.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Channels {
    Radiance,
    Transmittance,
}

/// One picture that has a truth.
pub struct Picture {
    /// Name of the case.
    pub name: &'static str,
    /// The truth, in `data/reference/images`.
    pub file: &'static str,
    /// How it is rendered, in words.
    pub settings: String,
    /// What RGB is held to.
    pub tolerance: &'static Tolerance,
    channels: Channels,
    /// Whether the 5 × 5 pixels around the point light inside the medium are left out.
    without_lamp: bool,
    scene: Box<dyn Fn() -> Result<Scene, Failed> + Send + Sync>,
}

/// A picture's figures.
#[derive(Clone, Copy, Debug)]
pub struct Measured {
    /// Over RGB.
    pub radiance: Difference,
    /// Of alpha.
    pub alpha: Difference,
    /// Time of the first render, upload and records included.
    pub seconds: f64,
}

/// A picture, its truth, and which of its pixels count.
struct Rendered {
    found: Vec<[f32; 4]>,
    expected: Vec<[f32; 4]>,
    kept: Vec<usize>,
    seconds: f64,
}

impl Rendered {
    fn rgb<'a>(&'a self, pixels: &'a [[f32; 4]]) -> impl Iterator<Item = f64> + use<'a> {
        self.kept.iter().flat_map(|&i| [0, 1, 2].map(|c| f64::from(pixels[i][c])))
    }

    fn alpha<'a>(&'a self, pixels: &'a [[f32; 4]]) -> impl Iterator<Item = f64> + use<'a> {
        self.kept.iter().map(|&i| f64::from(pixels[i][3]))
    }
}

impl Picture {
    fn render(&self, subject: &Subject) -> Result<Rendered, Failed> {
        let expected = truth(self.file)?;
        let scene = (self.scene)()?;
        let mut renderer = subject.renderer()?;
        let begin = Instant::now();
        let film = renderer.render(&scene)?.film;
        let seconds = begin.elapsed().as_secs_f64();
        let keep = |i: &usize| !(self.without_lamp && beside_lamp(*i));
        let found = match self.channels {
            Channels::Radiance => film.beauty,
            Channels::Transmittance => {
                film.transmittance.iter().zip(&film.beauty).map(|(t, b)| [t[0], t[1], t[2], b[3]]).collect()
            }
        };
        check!(found.len() == expected.len(), "a film of {} pixels", found.len());
        Ok(Rendered { kept: (0..found.len()).filter(keep).collect(), found, expected, seconds })
    }

    /// Renders it and compares.
    ///
    /// # Errors
    /// A missing truth; a fault while rendering.
    pub fn measure(&self, subject: &Subject) -> Result<Measured, Failed> {
        let all = self.render(subject)?;
        Ok(Measured {
            radiance: compare(all.rgb(&all.found), all.rgb(&all.expected)),
            alpha: compare(all.alpha(&all.found), all.alpha(&all.expected)),
            seconds: all.seconds,
        })
    }

    fn run(&self, subject: &Subject, record: &mut Record) -> Result<(), Failed> {
        let all = self.render(subject)?;
        record.hold("RGB", all.rgb(&all.found), all.rgb(&all.expected));
        // Alpha is the same line integrals in all of them.
        record.within(tolerance::PICTURE_TRANSMITTANCE, |record| {
            record.hold("alpha", all.alpha(&all.found), all.alpha(&all.expected));
        });
        let rgb = |pixels: &[[f32; 4]]| pixels.iter().map(|p| [p[0], p[1], p[2]]).collect();
        record.show("RGB", [160, 120], rgb(&all.found), rgb(&all.expected));
        Ok(())
    }
}

/// Whether a pixel is one of the 5 × 5 around the point light inside the medium.
fn beside_lamp(i: usize) -> bool {
    (i % 160).abs_diff(91) <= 2 && (i / 160).abs_diff(49) <= 2
}

/// RGB and alpha of a picture of the reference set.
pub(crate) fn truth(name: &str) -> Result<Vec<[f32; 4]>, Failed> {
    let (image, alpha) = truth::picture(&format!("images/{name}"))?;
    check!((image.width, image.height) == (160, 120), "{name} has {} × {} pixels", image.width, image.height);
    let alpha = alpha.ok_or_else(|| Failed::from(format!("{name} has no channel A")))?;
    Ok(image.texels.iter().zip(alpha).map(|(&[r, g, b], a)| [r, g, b, a]).collect())
}

/// Every picture that has a truth.
pub fn pictures() -> Vec<Picture> {
    let mut all = unlit();
    all.extend(lit());
    all.extend(environment());
    all
}

pub(crate) fn chromatic(scene: &mut Scene) {
    scene.optics.extinction = Vec3::new(24.0, 16.0, 9.0);
}

fn unlit() -> Vec<Picture> {
    let transmittance = |name, file, change: fn(&mut Scene)| Picture {
        name,
        file,
        settings: "step ½ voxel".into(),
        tolerance: &tolerance::PICTURE_TRANSMITTANCE,
        channels: Channels::Transmittance,
        without_lamp: false,
        scene: Box::new(move || {
            let mut scene = scene()?;
            scene.optics.albedo = Vec3::ZERO;
            change(&mut scene);
            Ok(scene)
        }),
    };
    vec![
        transmittance("transmittance", "transmittance.exr", |_| ()),
        transmittance("transmittance_chromatic", "transmittance_chromatic.exr", chromatic),
        Picture {
            tolerance: &tolerance::PICTURE_DIRECT,
            channels: Channels::Radiance,
            ..transmittance("emission", "emission_only.exr", |scene| {
                scene.optics.extinction = Vec3::splat(4.0);
                scene.optics.emission = 2.0 * Vec3::new(1.0, 0.45, 0.12);
            })
        },
    ]
}

pub(crate) fn sun() -> Light {
    Light::directional(DVec3::new(0.5, 0.8, -0.35), Vec3::new(3.0, 2.6, 2.0)).expect("the reference's sun")
}

fn lamp() -> Light {
    Light::point(DVec3::new(0.3, 0.55, 0.1), Vec3::new(0.6, 0.7, 1.0)).expect("the reference's lamp")
}

pub(crate) fn spot() -> Light {
    let (from, to) = (DVec3::new(-0.9, 1.1, 0.6), DVec3::new(0.1, 0.3, 0.0));
    Light::spot(from, to, Vec3::splat(4.0), 15.0, 20.0).expect("the reference's spot")
}

/// The reference's Gaussians under its lamp, with the medium's shadow marched.
///
/// # Errors
/// A missing or damaged file.
pub fn gaussians() -> Result<Scene, Failed> {
    let mut scene = scene()?;
    (scene.medium, scene.optics) = (blobs()?, Optics::grey(8.0, 0.9));
    (scene.lights, scene.quality.step) = (vec![lamp()], 1.0);
    scene.estimate.lights = Some(LightsEstimate::Direct(Direct { shadow: Shadow::March, ..Direct::default() }));
    Ok(scene)
}

/// The lights of the reference, each with its name and the picture of the grey, isotropic scene under it.
pub fn lights() -> [(&'static str, &'static str, Light); 3] {
    [
        ("directional", "dir_single.exr", sun()),
        ("point", "point_single.exr", lamp()),
        ("spot", "spot_single.exr", spot()),
    ]
}

fn lit() -> Vec<Picture> {
    type Make = fn() -> Light;
    let shadowed =
        |name, file, settings: String, lights: LightsEstimate, light: Make, change: fn(&mut Scene)| Picture {
            name,
            file,
            settings,
            tolerance: &tolerance::PICTURE_DIRECT,
            channels: Channels::Radiance,
            without_lamp: false,
            scene: Box::new(move || {
                let mut scene = scene()?;
                scene.lights = vec![light()];
                scene.estimate.lights = Some(lights.clone());
                change(&mut scene);
                Ok(scene)
            }),
        };
    let direct = |name, file, light: Make, change: fn(&mut Scene)| {
        let lights = LightsEstimate::Direct(Direct { shadow: Shadow::March, ..Direct::default() });
        shadowed(name, file, "direct, shadow march, step ½ voxel".into(), lights, light, change)
    };
    let opacity = |name, file, cells: u32, light: Make, change: fn(&mut Scene)| Picture {
        tolerance: &tolerance::PICTURE_OPACITY,
        ..shadowed(
            name,
            file,
            format!("opacity, short characteristics, {cells} cells, step ½ voxel"),
            LightsEstimate::Opacity(Opacity { cells, ..Opacity::default() }),
            light,
            change,
        )
    };
    vec![
        direct("directional", "dir_single.exr", sun, |_| ()),
        direct("directional_chromatic", "dir_single_chromatic.exr", sun, chromatic),
        direct("directional_hg", "dir_hg0.7_single.exr", sun, |s| s.optics.phase = Phase::HenyeyGreenstein { g: 0.7 }),
        Picture { without_lamp: true, ..direct("point", "point_single.exr", lamp, |_| ()) },
        direct("spot", "spot_single.exr", spot, |_| ()),
        opacity("opacity_directional", "dir_single.exr", 96, sun, |_| ()),
        opacity("opacity_directional_chromatic", "dir_single_chromatic.exr", 64, sun, chromatic),
        opacity("opacity_directional_hg", "dir_hg0.7_single.exr", 64, sun, |s| {
            s.optics.phase = Phase::HenyeyGreenstein { g: 0.7 };
        }),
        Picture { without_lamp: true, ..opacity("opacity_point", "point_single.exr", 64, lamp, |_| ()) },
        Picture {
            tolerance: &tolerance::PICTURE_OPACITY,
            ..shadowed(
                "propagated_spot",
                "spot_single.exr",
                "direct, shadow propagated (64 cells), step ½ voxel".into(),
                LightsEstimate::Direct(Direct { shadow: Shadow::Propagated, ..Direct::default() }),
                spot,
                |_| (),
            )
        },
        Picture {
            settings: format!("{BLOB_CELLS} cells, direct, shadow march, step 1 voxel"),
            without_lamp: true,
            scene: Box::new(gaussians),
            ..direct("gaussians_point", "blobs_point_single.exr", lamp, |_| ())
        },
        Picture {
            settings: format!("{BLOB_CELLS} cells, opacity, short characteristics, 64 cells, step 1 voxel"),
            without_lamp: true,
            scene: Box::new(|| {
                let mut scene = gaussians()?;
                scene.estimate.lights = Some(LightsEstimate::Opacity(Opacity::default()));
                // Their limit leaves room for it, and a step of half a reference voxel is slow.
                scene.camera.samples = 4;
                Ok(scene)
            }),
            ..opacity("gaussians_opacity", "blobs_point_single.exr", 64, lamp, |_| ())
        },
    ]
}

fn environment() -> Vec<Picture> {
    let gathered = |name, file, content, bands: u32, directions: u32, g: f64| Picture {
        name,
        file,
        settings: format!(
            "records, {}, 40 cells, trilinear, {bands} bands, {directions} directions, step 1 voxel",
            match content {
                Content::Radiance => "radiance",
                Content::Transmittance => "transmittance",
                Content::Phase => "phase",
            }
        ),
        tolerance: if g == 0.0 { &tolerance::PICTURE_RECORDS } else { &tolerance::PICTURE_PHASE },
        channels: Channels::Radiance,
        without_lamp: false,
        scene: Box::new(move || {
            let mut scene = in_environment(records(content, bands, directions))?;
            scene.quality.step = 1.0;
            if g != 0.0 {
                scene.optics.phase = Phase::HenyeyGreenstein { g };
                // Records of many layers are slow to sample; four positions a pixel are enough for their limit.
                scene.camera.samples = 4;
            }
            Ok(scene)
        }),
    };
    use Content::{Phase as TowardEye, Radiance, Transmittance};
    vec![
        gathered("records_transmittance_2_bands", "env_single_sh2.exr", Transmittance, 2, 192, 0.0),
        gathered("records_transmittance_3_bands", "env_single_sh3.exr", Transmittance, 3, 192, 0.0),
        gathered("records_transmittance_4_bands", "env_single_sh4.exr", Transmittance, 4, 192, 0.0),
        gathered("records_transmittance_6_bands", "env_single_sh6.exr", Transmittance, 6, 768, 0.0),
        gathered("records_radiance", "env_single.exr", Radiance, 1, 192, 0.0),
        gathered("records_radiance_hg", "env_hg0.5_single.exr", Radiance, 6, 768, 0.5),
        // With 768 directions six bands are off by 3.2 %, which only more bands lessen: docs/decisions/0041-truth.md.
        gathered("records_phase_hg", "env_hg0.5_single.exr", TowardEye, 6, 192, 0.5),
        gathered("records_phase_hg_8_bands", "env_hg0.5_single.exr", TowardEye, 8, 768, 0.5),
    ]
}

impl Picture {
    /// Sub-pixel positions.
    ///
    /// # Errors
    /// A missing file.
    pub fn samples(&self) -> Result<u32, Failed> {
        Ok((self.scene)()?.camera.samples)
    }
}

pub(crate) fn cases() -> Vec<Case> {
    let case = |picture: Picture| {
        let checks =
            format!("The reference scene is {}, which another renderer checked ({}).", picture.file, picture.settings);
        let tolerance = picture.tolerance;
        let name = format!("pictures::{}", picture.name);
        Case::new(name, checks, move |s, r| picture.run(s, r)).within(tolerance).needs(Need::FieldSide(SIDE))
    };
    let mut cases: Vec<_> = pictures().into_iter().map(case).collect();
    for (name, file, light) in lights() {
        let checks = format!("Propagated shadows of the reference's {name} light are the marched ones.");
        let run = move |subject: &Subject, record: &mut Record| {
            let Shadows { propagated, marched } = shadows(subject, file, light)?;
            record.hold("RGB", propagated, marched);
            Ok(())
        };
        let case = Case::new(format!("pictures::propagated_against_march_{name}"), checks, run);
        cases.push(case.within(&tolerance::PROPAGATED).needs(Need::FieldSide(SIDE)));
    }
    let checks =
        "The environment's coefficients are those of the reference; no device takes part, but all stand on it.";
    cases.push(
        Case::new("pictures::environment_coefficients", checks, |_, record| {
            let (found, expected) = coefficients()?;
            record.hold("coefficients", found, expected);
            Ok(())
        })
        .within(&tolerance::ENVIRONMENT_COEFFICIENTS),
    );
    cases
}

/// The largest error of the environment's coefficients.
///
/// # Errors
/// A missing or damaged file.
pub fn coefficient_error() -> Result<f64, Failed> {
    let (found, expected) = coefficients()?;
    Ok(compare(found, expected).max_abs)
}

/// The environment's coefficients, and the reference's.
fn coefficients() -> Result<(Vec<f64>, Vec<f64>), Failed> {
    #[derive(serde::Deserialize)]
    struct Projection {
        bands: u32,
        coefficients: Vec<[f64; 3]>,
    }
    let File { path, bytes } = truth::file("sh_env.json")?;
    let truth: Projection = serde_json::from_slice(&bytes).map_err(|e| format!("{}: {e}", path.display()))?;
    let found = parts()?.environment.project_sh(&SphericalHarmonics::new(truth.bands)?);
    Ok((found.as_flattened().to_vec(), truth.coefficients.as_flattened().to_vec()))
}

/// The difference of a film of [`scene`]'s camera from a picture of the reference set, over RGB; without the pixels
/// around the point light where it shows one.
///
/// # Errors
/// A missing truth; a film of another size.
pub fn against(name: &str, film: &Film) -> Result<Difference, Failed> {
    let expected = truth(name)?;
    check!(film.pixels() == expected.len(), "a film of {} pixels", film.pixels());
    Ok(compare(shown(name, &film.beauty), shown(name, &expected)))
}

/// RGB of the pixels that count in a picture of the reference set.
fn shown(name: &str, pixels: &[[f32; 4]]) -> Vec<f64> {
    let lamp = ["point_single.exr", "blobs_point_single.exr"].contains(&name);
    let kept = pixels.iter().enumerate().filter(|(i, _)| !(lamp && beside_lamp(*i)));
    kept.flat_map(|(_, p)| [p[0], p[1], p[2]]).map(f64::from).collect()
}

/// Shadows of one of [`lights`]: RGB with propagated ones, and with marched ones.
pub struct Shadows {
    /// `direct` with `propagated`.
    pub propagated: Vec<f64>,
    /// `direct` with `march`.
    pub marched: Vec<f64>,
}

/// Renders the reference scene under a light with either shadow, in steps of a voxel with 4 samples a pixel; without the
/// pixels around the point light where the picture `name` shows it.
///
/// # Errors
/// A missing file; a fault while rendering.
pub fn shadows(subject: &Subject, name: &str, light: Light) -> Result<Shadows, Failed> {
    let mut scene = scene()?;
    (scene.camera.samples, scene.quality.step, scene.lights) = (4, 1.0, vec![light]);
    let mut renderer = subject.renderer()?;
    let mut with = |shadow| -> Result<Vec<f64>, Failed> {
        scene.estimate.lights = Some(LightsEstimate::Direct(Direct { shadow, ..Direct::default() }));
        Ok(shown(name, &renderer.render(&scene)?.film.beauty))
    };
    Ok(Shadows { propagated: with(Shadow::Propagated)?, marched: with(Shadow::March)? })
}
