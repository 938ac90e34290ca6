//! The estimator `path`, by statistics: against pictures of other programs, and where the truth is one.

use std::sync::Arc;

use airlight::Renderer;
use airlight::glam::{DVec3, Vec3};
use airlight::light::{Environment, Light};
use airlight::media::{Homogeneous, Medium, Optics, Phase};
use airlight::reference::{BruteForce, BruteSettings};
use airlight::scene::{
    AllEstimate, Camera, Direct, Estimate, Film, LightsEstimate, Material, Path, Quality, Scene, Shadow, SurfaceShadow,
};
use libtest_mimic::Failed;

use crate::fixtures::{DIMS, Map, chromatic, classified, cloud, room, sky, varied, wall};
use crate::pictures::{self, parts, spot, sun};
use crate::{Axis, Case, Need, Record, Subject, check};

/// Pixels along each side of a block whose mean is tested.
const BLOCK: u32 = 8;
/// Independent pictures, from which the noise of their mean is known.
const PICTURES: u32 = 16;
/// The least difference that counts, as a part of the truth: as much is undecided in the reference pictures.
const FLOOR: f64 = 1e-3;

pub(crate) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for picture in reference() {
        let checks = format!("Paths in the reference scene give {} (z of the means of blocks).", picture.file);
        let name = format!("paths::{}", picture.name);
        cases.push(Case::new(name, checks, move |s, r| picture.run(s, r)).needs(Need::FieldSide(72)));
    }
    cases.push(
        Case::new(
            "paths::furnace",
            "With an albedo of one in a uniform environment the radiance is one, however thick the medium.",
            furnace,
        )
        .permutes(&depths())
        .permutes(&phases()),
    );
    cases.push(
        Case::new(
            "paths::what_leaves_and_what_is_absorbed",
            "What leaves a medium and what it absorbs are what came in: with the emission of what absorbs, the radiance is one.",
            balance,
        )
        .permutes(&albedos()),
    );
    cases.push(Case::new(
        "paths::reciprocity",
        "A cloud sends as much from one direction to another as back, all orders included.",
        reciprocity,
    ));
    cases.push(Case::new(
        "paths::varying_optics",
        "A cloud whose albedo, absorption and heat vary from voxel to voxel, scattering once, is brute force's.",
        |s, r| varying(s, r, Arc::new(varied(Map::Rotated, DIMS))),
    ));
    cases.push(Case::new(
        "paths::classified",
        "A cloud of values that are classified, with a tint, scattering once, is brute force's.",
        |s, r| varying(s, r, Arc::new(classified(Map::Rotated, DIMS))),
    ));
    cases.push(Case::new(
        "paths::white_walls",
        "Between white walls in a uniform environment the radiance is one, with fog and without.",
        walls,
    ));
    cases.push(Case::new(
        "paths::surfaces_once",
        "Surfaces in a cloud, lit once, are what the march shows of them with rays to the lights.",
        once,
    ));
    cases.push(Case::new(
        "paths::more_samples_go_on",
        "More samples of the same scene go on from what is there, to the same bits as all at once.",
        resumed,
    ));
    cases
}

fn traced(mut scene: Scene, samples: u32, max_depth: Option<u32>) -> Scene {
    let path = Path { samples, max_depth, ..Path::default() };
    scene.estimate = Estimate { all: Some(AllEstimate::Path(path)), ..Estimate::none() };
    scene
}

/// Means of blocks of a picture's RGB, row by row.
fn blocks(pixels: &[[f32; 4]], width: u32, height: u32) -> Vec<[f64; 3]> {
    let (across, down) = (width / BLOCK, height / BLOCK);
    let mut means = vec![[0.0; 3]; (across * down) as usize];
    for (i, pixel) in pixels.iter().enumerate() {
        let (x, y) = (i as u32 % width / BLOCK, i as u32 / width / BLOCK);
        if x < across && y < down {
            (0..3).for_each(|c| means[(y * across + x) as usize][c] += f64::from(pixel[c]) / f64::from(BLOCK.pow(2)));
        }
    }
    means
}

/// How far values are from a truth in standard deviations.
struct Scores {
    /// Root mean square.
    rms: f64,
    mean: f64,
    /// Σ found / Σ expected.
    ratio: f64,
}

/// The mean of a few pictures, and the standard deviation of that, value by value, against a truth with noise of its own.
fn scores(pictures: &[Vec<f64>], expected: &[f64], noise: f64) -> Scores {
    let n = pictures.len() as f64;
    let largest = expected.iter().copied().fold(0.0, f64::max);
    let (mut count, mut squares, mut sum, mut found, mut truth) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (i, &e) in expected.iter().enumerate() {
        let mean = pictures.iter().map(|p| p[i]).sum::<f64>() / n;
        let variance = pictures.iter().map(|p| (p[i] - mean).powi(2)).sum::<f64>() / (n - 1.0) / n;
        (found, truth) = (found + mean, truth + e);
        // Blocks at the medium's rim hold a few lit paths, whose spread says little.
        if e > 0.02 * largest {
            let z = (mean - e) / (variance + (noise * e).powi(2) + (FLOOR * e).powi(2)).sqrt();
            (count, squares, sum) = (count + 1.0, squares + z * z, sum + z);
        }
    }
    Scores { rms: (squares / count).sqrt(), mean: sum / count, ratio: found / truth }
}

impl Scores {
    /// The variance is known from sixteen pictures, which makes z² a seventh larger on average: the root mean square is 1.07. Where
    /// few paths carry much light it is known less well: 1.0 to 1.25 for 32 paths a pixel, 1.0 to 1.08 for 512. The mean over some
    /// hundred blocks, which three channels share, is within 0.2.
    fn book(&self, record: &mut Record, name: &str) {
        record.score(name, "root mean square of z", self.rms, 1.3);
        record.score(name, "mean of z", self.mean.abs(), 0.3);
        record.score(name, "difference of the whole", (self.ratio - 1.0).abs(), 5e-3);
    }
}

/// Pictures of the same scene with other random numbers each.
fn several(renderer: &mut Renderer, scene: &Scene, record: &mut Record) -> Result<Vec<Film>, Failed> {
    let mut films = Vec::new();
    for frame in 0..PICTURES {
        let scene = Scene { frame, ..scene.clone() };
        films.push(renderer.render(&scene)?.film);
    }
    check!(films[0] != films[1], "{}: pictures with other random numbers are the same", record.info().name);
    Ok(films)
}

/// A picture of the reference set.
struct Reference {
    name: &'static str,
    file: &'static str,
    /// Its noise, as part of a pixel's value.
    noise: f64,
    /// Of each of several pictures.
    samples: u32,
    max_depth: Option<u32>,
    scene: fn() -> Result<Scene, Failed>,
}

fn reference() -> Vec<Reference> {
    fn lit(light: Light) -> Result<Scene, Failed> {
        Ok(Scene { lights: vec![light], ..pictures::scene()? })
    }
    fn under_sky(g: f64) -> Result<Scene, Failed> {
        let mut scene = Scene { environment: Some(parts()?.environment), ..pictures::scene()? };
        scene.optics.phase = Phase::HenyeyGreenstein { g };
        Ok(scene)
    }
    let multi = |name, file, noise, scene| Reference { name, file, noise, samples: 2, max_depth: None, scene };
    let single = |name, file, noise, scene| Reference { name, file, noise, samples: 2, max_depth: Some(1), scene };
    vec![
        single("directional_single_chromatic", "dir_single_chromatic.exr", 0.0, || {
            let mut scene = lit(sun())?;
            pictures::chromatic(&mut scene);
            Ok(scene)
        }),
        single("directional_single_hg", "dir_hg0.7_single.exr", 0.0, || {
            let mut scene = lit(sun())?;
            scene.optics.phase = Phase::HenyeyGreenstein { g: 0.7 };
            Ok(scene)
        }),
        single("spot_single", "spot_single.exr", 0.0, || lit(spot())),
        single("environment_single_hg", "env_hg0.5_single.exr", 4.7e-3, || under_sky(0.5)),
        multi("directional", "dir_multi.exr", 8.7e-3, || lit(sun())),
        multi("environment", "env_multi.exr", 9.1e-3, || under_sky(0.0)),
        multi("environment_hg", "env_hg0.5_multi.exr", 1.19e-2, || under_sky(0.5)),
        single("emission", "emission_only.exr", 0.0, || {
            let mut scene = pictures::scene()?;
            (scene.optics.albedo, scene.optics.extinction) = (Vec3::ZERO, Vec3::splat(4.0));
            scene.optics.emission = 2.0 * Vec3::new(1.0, 0.45, 0.12);
            Ok(scene)
        }),
    ]
}

impl Reference {
    fn run(&self, subject: &Subject, record: &mut Record) -> Result<(), Failed> {
        let expected = pictures::truth(self.file)?;
        let scene = traced((self.scene)()?, self.samples, self.max_depth);
        let (width, height) = (scene.camera.width, scene.camera.height);
        let films = several(&mut subject.renderer()?, &scene, record)?;
        let flat = |pixels: &[[f32; 4]]| blocks(pixels, width, height).as_flattened().to_vec();
        let found: Vec<_> = films.iter().map(|film| flat(&film.beauty)).collect();
        // Pixels of the reference are independent: a block's mean has an eighth of their noise.
        scores(&found, &flat(&expected), self.noise / f64::from(BLOCK)).book(record, "radiance");
        // Alpha, in all channels of a block.
        let alpha = |pixels: &[[f32; 4]]| flat(&pixels.iter().map(|p| [p[3]; 4]).collect::<Vec<_>>());
        let found: Vec<_> = films.iter().map(|film| alpha(&film.beauty)).collect();
        scores(&found, &alpha(&expected), 0.0).book(record, "alpha");
        Ok(())
    }
}

/// Optical depths of the box's longest side, and the samples that each needs.
fn depths() -> Axis<(f32, u32)> {
    Axis::new("depth", [("thin", (0.4f32, 4)), ("thick", (14.0, 20))])
}

fn phases() -> Axis<Phase> {
    let table = || {
        let degrees: Vec<f64> = (0..=36).map(|i| 5.0 * f64::from(i)).collect();
        let values: Vec<f64> = degrees.iter().map(|d| 0.2 + (-d / 25.0).exp()).collect();
        airlight::media::PhaseTable::new(&degrees, &values).expect("a table")
    };
    Axis::new(
        "phase",
        [
            ("isotropic", Phase::Isotropic),
            ("henyey-greenstein", Phase::HenyeyGreenstein { g: 0.5 }),
            ("two lobes", Phase::DoubleHenyeyGreenstein { forward: 0.6, backward: -0.4, weight: 0.7 }),
            ("rayleigh", Phase::Rayleigh),
            ("table", Phase::Table(Arc::new(table()))),
        ],
    )
}

fn albedos() -> Axis<f32> {
    Axis::of("albedo", [0.5f32, 0.9])
}

/// A box of fog in an environment of radiance 1, filling most of the picture.
fn fog(optics: Optics) -> Result<Scene, Failed> {
    Ok(Scene {
        camera: Camera {
            origin: DVec3::new(1.2, 0.9, 1.7),
            target: DVec3::new(0.05, 0.35, 0.25),
            up: DVec3::Y,
            fov: 26.0,
            width: 24,
            height: 16,
            samples: 1,
        },
        medium: Arc::new(Homogeneous::new(1.0, DVec3::new(-0.3, 0.1, -0.2), DVec3::new(0.4, 0.6, 0.7))?),
        optics,
        environment: Some(Environment::uniform(Vec3::ONE)?),
        background: None,
        surfaces: None,
        frame: 0,
        lights: Vec::new(),
        estimate: Estimate::default(),
        quality: Quality::default(),
    })
}

/// The mean of pictures whose every pixel should be one, and its standard deviation.
fn ones(record: &mut Record, name: &str, renderer: &mut Renderer, scene: &Scene) -> Result<(), Failed> {
    let films = several(renderer, scene, record)?;
    let mean = |film: &Film| {
        film.beauty.iter().map(|p| f64::from(p[0] + p[1] + p[2]) / 3.0).sum::<f64>() / film.beauty.len() as f64
    };
    let means: Vec<f64> = films.iter().map(mean).collect();
    let n = means.len() as f64;
    let whole = means.iter().sum::<f64>() / n;
    let deviation = (means.iter().map(|m| (m - whole).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt();
    record.score(name, "difference from one", (whole - 1.0).abs(), 5e-3);
    // A value of Student's distribution of 15 that one of 10⁵ pictures exceeds.
    record.score(name, "the same in standard deviations", (whole - 1.0).abs() / deviation.max(2e-5), 6.0);
    Ok(())
}

fn furnace(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut renderer = subject.renderer()?;
    record.each(&depths(), |record, &(depth, samples)| {
        record.each(&phases(), |record, phase| {
            let optics = Optics { phase: phase.clone(), ..Optics::grey(depth / 0.9, 1.0) };
            ones(record, "radiance", &mut renderer, &traced(fog(optics)?, samples, None))
        })
    })
}

/// In equilibrium: what absorbs shines as brightly as what surrounds it.
fn balance(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut renderer = subject.renderer()?;
    record.each(&albedos(), |record, &albedo| {
        let extinction = Vec3::new(9.0, 5.0, 2.0);
        let albedo = Vec3::new(albedo, 0.8 * albedo, albedo);
        let phase = Phase::HenyeyGreenstein { g: 0.4 };
        let optics = Optics { extinction, albedo, emission: extinction * (Vec3::ONE - albedo), phase };
        ones(record, "radiance", &mut renderer, &traced(fog(optics)?, 8, None))
    })
}

/// From so far away that rays are parallel, with a light where the other picture is seen from.
fn reciprocity(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    const FAR: f64 = 60.0;
    let (a, b) = (DVec3::new(0.6, 0.5, 0.9).normalize(), DVec3::new(-0.3, 0.2, 1.0).normalize());
    let mut renderer = subject.renderer()?;
    let mut sent = |to: DVec3, from: DVec3| -> Result<[f64; 2], Failed> {
        let mut scene =
            cloud(Map::Sheared, DIMS, Optics { albedo: Vec3::ONE, ..chromatic(Phase::HenyeyGreenstein { g: 0.5 }) });
        let center = scene.medium.lattice().center();
        scene.camera =
            Camera { origin: center + FAR * to, target: center, fov: 1.5, width: 24, height: 24, ..scene.camera };
        scene.lights = vec![Light::directional(from, Vec3::ONE)?];
        let films = several(&mut renderer, &traced(scene, 24, None), record)?;
        let rim = |film: &Film| (0..24).any(|i| film.beauty[i][3] > 0.0 || film.beauty[24 * i][3] > 0.0);
        check!(!films.iter().any(rim), "the picture cuts off a part of the cloud");
        let sums: Vec<f64> =
            films.iter().map(|f| f.beauty.iter().map(|p| f64::from(p[0] + p[1] + p[2])).sum()).collect();
        let (n, whole) = (sums.len() as f64, sums.iter().sum::<f64>() / sums.len() as f64);
        Ok([whole, sums.iter().map(|s| (s - whole).powi(2)).sum::<f64>() / (n - 1.0) / n])
    };
    let ([there, u], [back, v]) = (sent(a, b)?, sent(b, a)?);
    check!(there > 0.0, "nothing is sent");
    let difference = (there - back).abs();
    // So that noise does not hide what the next line looks for: 0.3 % as measured.
    record.score("light sent", "difference of the two", difference / there, 2e-2);
    record.score("light sent", "the same in standard deviations", difference / (u + v).sqrt(), 5.0);
    Ok(())
}

/// Brute force's blocks of the picture.
fn brute(scene: &Scene) -> Vec<[f32; 4]> {
    use rayon::prelude::*;
    let mut fine = scene.clone();
    fine.camera.samples = 4;
    let truth = BruteForce::new(&fine, &BruteSettings { rows: 12, nodes: 2 });
    let (width, pixels) = (scene.camera.width, scene.camera.width * scene.camera.height);
    (0..pixels).into_par_iter().map(|i| truth.pixel(i % width, i / width).map(|v| v as f32)).collect()
}

fn varying(subject: &Subject, record: &mut Record, medium: Arc<dyn Medium>) -> Result<(), Failed> {
    let mut scene = cloud(Map::Rotated, DIMS, chromatic(Phase::HenyeyGreenstein { g: 0.3 }));
    scene.medium = medium;
    scene.optics.emission = Vec3::new(0.5, 0.8, 2.0);
    let mut visible = sky();
    visible.visible = true;
    scene.environment = Some(visible);
    scene.lights = vec![Light::spot(DVec3::new(0.9, 0.8, -0.9), DVec3::ZERO, Vec3::splat(3.0), 15.0, 30.0)?];
    (scene.camera.width, scene.camera.height) = (16, 16);
    let flat = |pixels: &[[f32; 4]]| blocks(pixels, 16, 16).as_flattened().to_vec();
    let expected = flat(&brute(&scene));
    let films = several(&mut subject.renderer()?, &traced(scene, 24, Some(1)), record)?;
    let found: Vec<_> = films.iter().map(|film| flat(&film.beauty)).collect();
    let scores = scores(&found, &expected, 2e-3);
    // Four blocks of three channels.
    record.score("radiance", "root mean square of z", scores.rms, 2.0);
    record.score("radiance", "difference of the whole", (scores.ratio - 1.0).abs(), 1e-2);
    Ok(())
}

fn walls(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut renderer = subject.renderer()?;
    let white = Material { diffuse: Vec3::ONE, specular: Vec3::ZERO, shininess: 1.0 };
    let v = DVec3::new;
    let mesh = airlight::scene::Mesh::joined(&[
        wall(v(-0.8, 0.0, -0.8), v(0.1, 0.03, 1.9), v(1.9, -0.05, 0.2), white),
        wall(v(-0.5, 0.0, -0.5), v(1.3, 0.1, 0.0), v(0.1, 0.9, -0.2), white),
    ])?;
    for (name, density) in [("without fog", 0.0), ("with fog", 3.0)] {
        let mut scene = fog(Optics::grey(density, 1.0))?;
        scene.surfaces = Some(Arc::new(mesh.clone()));
        ones(record, name, &mut renderer, &traced(scene, 4, None))?;
    }
    Ok(())
}

/// A block and a ball within a cloud, with gloss and smooth normals.
fn once(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = cloud(Map::Plain, DIMS, chromatic(Phase::HenyeyGreenstein { g: 0.3 }));
    scene.surfaces = Some(Arc::new(room()));
    scene.lights = vec![
        Light::directional(DVec3::new(0.5, 0.8, 0.35), Vec3::new(3.0, 2.6, 2.0))?,
        Light::point(DVec3::new(-0.9, 1.4, 1.6), Vec3::new(6.0, 7.0, 9.0))?,
    ];
    (scene.camera.width, scene.camera.height) = (32, 24);
    let mut renderer = subject.renderer()?;
    let mut marched = scene.clone();
    (marched.camera.samples, marched.quality.step) = (64, 0.25);
    let direct = Direct { shadow: Shadow::March, surface_shadow: SurfaceShadow::Ray };
    marched.estimate = Estimate { lights: Some(LightsEstimate::Direct(direct)), ..Estimate::none() };
    let flat = |film: &Film| blocks(&film.beauty, 32, 24).as_flattened().to_vec();
    let expected = flat(&renderer.render(&marched)?.film);
    let films = several(&mut renderer, &traced(scene, 24, Some(1)), record)?;
    let scores = scores(&films.iter().map(flat).collect::<Vec<_>>(), &expected, 3e-3);
    // Twelve blocks of three channels; the march takes 64 places of each pixel and a quarter of a voxel a step.
    record.score("radiance", "root mean square of z", scores.rms, 2.0);
    record.score("radiance", "difference of the whole", (scores.ratio - 1.0).abs(), 1e-2);
    Ok(())
}

fn resumed(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = cloud(Map::Sheared, DIMS, chromatic(Phase::HenyeyGreenstein { g: 0.5 }));
    scene.environment = Some(sky());
    let mut renderer = subject.renderer()?;
    let some = renderer.render(&traced(scene.clone(), 3, None))?;
    let more = renderer.render(&traced(scene.clone(), 9, None))?;
    let all = subject.renderer()?.render(&traced(scene.clone(), 9, None))?;
    check!(some.film != more.film, "six more samples change nothing");
    record.same("nine samples", more.film.beauty.as_flattened(), all.film.beauty.as_flattened());
    let told = |rendered: &airlight::exec::Rendered| rendered.report.paths.map_or(0, |paths| paths.samples);
    check!([told(&some), told(&more), told(&all)] == [3, 9, 9], "{} and {} samples are told", told(&some), told(&more));
    // Much noise is allowed, so that few of many samples are taken.
    let mut quiet = traced(scene, 1 << 20, None);
    let path = Path { samples: 1 << 20, noise: Some(0.5), ..Path::default() };
    quiet.estimate.all = Some(AllEstimate::Path(path));
    let found = subject.renderer()?.render(&quiet)?.report.paths.ok_or("nothing is told of paths")?;
    check!(found.noise <= 0.5 && found.samples < 10_000, "{found:?} for a noise of 0.5");
    Ok(())
}
