//! Pictures that are marched coarsely, jittered, small, and accumulated over a sequence: what they cost in error.

use std::sync::Arc;

use airlight::Renderer;
use airlight::exec::Rendered;
use airlight::glam::{DVec3, Vec3};
use airlight::light::Light;
use airlight::media::{Gaussian, Gaussians, Lattice, Optics, Phase};
use airlight::metric::flip;
use airlight::scene::{
    Background, Camera, Direct, Estimate, Film, Jitter, LightsEstimate, Opacity, Quality, Scene, Shadow,
};
use airlight_formats::image::ToneMap;
use libtest_mimic::Failed;

use crate::fixtures::{noise, sky};
use crate::frames::by_the_processor;
use crate::{Axis, Case, Record, Subject, check, compare, rgb, tolerance};

/// Pictures of a sequence that has come to rest.
const LONG: u32 = 256;
/// How wide the bands along rims of depth are, in pixels.
const BAND: i64 = 3;

pub(crate) fn cases() -> Vec<Case> {
    vec![
        Case::new(
            "sequence::a_still_mean_settles",
            "The mean of 64 jittered pictures of 32 steps of a still scene is that of 256, to a hundredth.",
            settles,
        ),
        Case::new(
            "sequence::small_marches",
            "A picture marched at a quarter of the size is that of full size, to 3 % away from rims of depth; along them its \
             error is at most four times that at half the size.",
            small_marches,
        ),
        Case::new(
            "sequence::as_the_processor",
            "A device renders a sequence as the processor does: still, then with eye, light and medium moving, and still \
             again.",
            follow,
        )
        .within(&tolerance::FRAME)
        .permutes(&kinds()),
        Case::new(
            "sequence::what_moved_is_not_smeared",
            "After a jump of the light, the mean is nearer to the new picture than to the old one at once, and closes in on \
             it.",
            jumps,
        ),
    ]
}

/// Smooth clouds in a box of 1.6 × 1 × 1.3 m, seen whole by a picture of `width` × `height` pixels, under a sun. Black
/// surfaces stand before, within and behind them.
///
/// # Errors
/// None, but for a bug.
pub fn scene(width: u32, height: u32) -> Result<Scene, Failed> {
    let (min, max) = (DVec3::new(-0.8, -0.5, -0.65), DVec3::new(0.8, 0.5, 0.65));
    let values = noise(91, 5 * 14);
    let blob = |v: &[f32]| Gaussian {
        center: min + (max - min) * (0.15 + 0.7 * DVec3::new(v[0].into(), v[1].into(), v[2].into())),
        a: 2.5 + 3.0 * f64::from(v[3]),
        c: 0.4 + 0.6 * f64::from(v[4]),
    };
    // Clouds in a haze.
    let haze = Gaussian { center: DVec3::ZERO, a: 1.5, c: 0.2 };
    let blobs = values.chunks_exact(5).map(blob).chain([haze]).collect();
    let lattice = Lattice::of_cells(48, min, max)?;
    let camera = Camera {
        origin: DVec3::new(1.3, 0.9, 2.4),
        target: DVec3::new(0.0, -0.02, 0.0),
        up: DVec3::Y,
        fov: 32.0,
        width,
        height,
        samples: 1,
    };
    // A slanted plane with a hole, and a ball before it.
    let depth = (0..width * height).map(|i| {
        let (x, y) =
            ((f64::from(i % width) + 0.5) / f64::from(width), (f64::from(i / width) + 0.5) / f64::from(height));
        let wall = 2.6 + 0.5 * x - 0.3 * y;
        let hole = (x - 0.68).abs() < 0.11 && (y - 0.42 - 0.3 * (x - 0.6)).abs() < 0.17;
        let round = ((x - 0.36) * 1.33).hypot(y - 0.52) / 0.16;
        if round < 1.0 {
            2.4 - 0.15 * (1.0 - round * round).sqrt()
        } else if hole {
            f64::INFINITY
        } else {
            wall
        }
    });
    let background = Background::new(width, height, None, Some(depth.map(|d| d as f32).collect()))?;
    Ok(Scene {
        camera,
        medium: Arc::new(Gaussians::new(blobs, lattice)?),
        optics: Optics { phase: Phase::HenyeyGreenstein { g: 0.4 }, ..Optics::grey(2.0, 0.9) },
        environment: None,
        background: Some(background),
        surfaces: None,
        frame: 0,
        lights: vec![Light::directional(DVec3::new(0.3, 0.9, -0.35), Vec3::new(40.0, 36.0, 30.0))?],
        estimate: Estimate {
            environment: None,
            lights: Some(LightsEstimate::Opacity(Opacity { cells: 32, ..Opacity::default() })),
            all: None,
        },
        quality: Quality { step: 0.5, ..Quality::default() },
    })
}

/// The same with a spot whose beam has a hard rim, which coarse steps make bands of.
///
/// # Errors
/// As [`scene`].
pub fn beam(width: u32, height: u32) -> Result<Scene, Failed> {
    let mut scene = scene(width, height)?;
    let (from, to) = (DVec3::new(1.2, 0.9, 0.9), DVec3::new(-0.5, -0.35, 0.3));
    scene.lights.push(Light::spot(from, to, Vec3::splat(150.0), 7.0, 8.0)?);
    scene.estimate.lights = Some(LightsEstimate::Direct(Direct { shadow: Shadow::Propagated, ..Direct::default() }));
    Ok(scene)
}

/// The scene with a fixed number of steps a ray.
#[must_use]
pub fn in_steps(scene: &Scene, steps: u32, jitter: Jitter, temporal: bool) -> Scene {
    let quality = Quality { steps: Some(steps), jitter, temporal, ..scene.quality };
    Scene { quality, ..scene.clone() }
}

/// The pictures of a still sequence after so many of them.
///
/// # Errors
/// What the device says.
pub fn sequence(renderer: &mut Renderer, scene: &Scene, after: &[u32]) -> Result<Vec<Film>, Failed> {
    let mut scene = scene.clone();
    let mut films = Vec::new();
    for frame in 0..after.iter().copied().max().unwrap_or(0) {
        scene.frame = frame;
        let film = renderer.render(&scene)?.film;
        films.extend((0..after.iter().filter(|n| **n == frame + 1).count()).map(|_| film.clone()));
    }
    Ok(films)
}

/// Relative L2 error over RGB of the pixels that `counts` names.
pub fn error(film: &Film, truth: &Film, counts: impl Fn(usize) -> bool) -> f64 {
    let values = |film: &Film| -> Vec<f64> {
        rgb(film).enumerate().filter(|(i, _)| counts(*i)).flat_map(|(_, p)| p).map(f64::from).collect()
    };
    compare(values(film), values(truth)).relative_l2
}

/// The mean FLIP of two films, exposed as they are, without a curve.
pub fn mean_flip(film: &Film, truth: &Film) -> f64 {
    let shown = [film, truth].map(|film| rgb(film).map(|p| ToneMap::LINEAR.encode(p)).collect::<Vec<_>>());
    let flips = flip(&shown[0], &shown[1], film.width as usize, film.height as usize);
    flips.iter().map(|&v| f64::from(v)).sum::<f64>() / flips.len() as f64
}

/// What marching small costs.
#[derive(Clone, Copy, Debug)]
pub struct Small {
    /// Relative L2 error of the pixels more than three away from rims of depth.
    pub away: f64,
    /// The same of all others.
    pub along: f64,
    /// Seconds of all stages.
    pub seconds: f64,
}

/// The error of marches at full, half and quarter size, against `truth`, or else that of full size.
///
/// # Errors
/// What the device says.
pub fn small(subject: &Subject, scene: &Scene, truth: Option<&Film>) -> Result<[Small; 3], Failed> {
    let along = rims(scene);
    let render = |scale: u32| -> Result<Rendered, Failed> {
        let quality = Quality { scale, ..scene.quality };
        Ok(subject.renderer()?.render(&Scene { quality, ..scene.clone() })?)
    };
    let rendered = [render(1)?, render(2)?, render(4)?];
    let truth = truth.unwrap_or(&rendered[0].film);
    Ok(rendered.each_ref().map(|rendered| Small {
        away: error(&rendered.film, truth, |i| !along[i]),
        along: error(&rendered.film, truth, |i| along[i]),
        seconds: rendered.report.stages.iter().map(|s| s.time.as_secs_f64()).sum(),
    }))
}

/// Which pixels lie within [`BAND`] of a rim, where the nearer of two neighbours is nearer by more than a twentieth.
fn rims(scene: &Scene) -> Vec<bool> {
    let (width, height) = (i64::from(scene.camera.width), i64::from(scene.camera.height));
    let depth = scene.background.as_ref().and_then(Background::depth).unwrap_or_default();
    let at = |x: i64, y: i64| depth.get((y * width + x) as usize).map_or(f32::MAX, |d| d.min(f32::MAX));
    let apart = |a: f32, b: f32| a.min(b) < 0.95 * a.max(b);
    let rim = |x: i64, y: i64| (x > 0 && apart(at(x, y), at(x - 1, y))) || (y > 0 && apart(at(x, y), at(x, y - 1)));
    let near = |x: i64, y: i64| {
        let (left, right) = ((x - BAND + 1).max(0), (x + BAND).min(width - 1));
        let (top, bottom) = ((y - BAND + 1).max(0), (y + BAND).min(height - 1));
        (top..=bottom).any(|y| (left..=right).any(|x| rim(x, y)))
    };
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| near(x, y)).collect()
}

fn settles(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = in_steps(&beam(48, 36)?, 32, Jitter::BlueNoise, true);
    // Thick enough for a step to matter.
    scene.optics.extinction = Vec3::splat(8.0);
    let films = sequence(&mut subject.renderer()?, &scene, &[1, 64, LONG])?;
    let [first, early, late] = &films[..] else { return Err("three pictures".into()) };
    record.score("64 pictures", "relative L2 error", error(early, late, |_| true), 0.01);
    let one = error(first, late, |_| true);
    check!(one > 3e-3, "one picture alone is off by {one:e}: the case tries nothing");
    record.score("64 pictures over one", "ratio of errors", error(early, late, |_| true) / one, 0.2);
    Ok(())
}

fn small_marches(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let scene = scene(192, 144)?;
    let [_, half, quarter] = small(subject, &scene, None)?;
    record.score("away from rims, quarter size", "relative L2 error", quarter.away, 0.03);
    check!(half.along > 1e-4, "half the size is off by {:e} along rims: the case tries nothing", half.along);
    // Beside a rim the way to the nearest pixel that fits doubles; where all fit, interpolation errs by its square.
    record.score("along rims, quarter over half size", "ratio of errors", quarter.along / half.along, 4.0);
    Ok(())
}

/// Qualities that a sequence is rendered with.
fn kinds() -> Axis<Quality> {
    let of = Quality { steps: Some(24), jitter: Jitter::BlueNoise, temporal: true, ..Quality::default() };
    Axis::new(
        "quality",
        [
            ("full size", of),
            ("half size", Quality { scale: 2, ..of }),
            ("quarter size, by steps of a voxel", Quality { scale: 4, steps: None, ..of }),
            (
                "half size, unjittered, not accumulated",
                Quality { jitter: Jitter::None, temporal: false, scale: 2, ..of },
            ),
        ],
    )
}

fn follow(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    record.within(record.tolerance().filtered(record.info()), |record| {
        record.each(&kinds(), |record, quality| {
            let mut scene = beam(45, 35)?;
            scene.quality = *quality;
            // Seen through the hole, and beside the box.
            scene.environment = Some(sky());
            if let Some(sky) = &mut scene.environment {
                sky.visible = true;
            }
            let mut renderers = [subject.renderer()?, Renderer::new(airlight::open("cpu")?)];
            for frame in 0..9 {
                scene.frame = frame;
                match frame {
                    2 | 3 => scene.camera.origin += DVec3::new(0.05, 0.02, -0.03),
                    4 => scene.lights[0] = Light::directional(DVec3::new(-0.3, 0.9, 0.3), Vec3::ONE)?,
                    5 => scene.optics.albedo = Vec3::new(0.5, 0.7, 0.9),
                    6 => scene.camera.target += DVec3::new(0.0, 0.05, 0.1),
                    _ => {}
                }
                let [found, expected] = &mut renderers;
                let (found, expected) = (found.render(&scene)?.film, expected.render(&scene)?.film);
                alike(record, &found, &expected);
            }
            // The same picture again is not added again.
            let [found, _] = &mut renderers;
            let films = [found.render(&scene)?.film, found.render(&scene)?.film];
            record.same("again", films[0].beauty.as_flattened(), films[1].beauty.as_flattened());
            Ok(())
        })
    })
}

/// Holds a film to another. Depth only where more than a thousandth is stopped: the clouds have no rim, and where next to
/// nothing is stopped the roundings of their density decide.
fn alike(record: &mut Record, found: &Film, expected: &Film) {
    record.film("radiance", found, rgb(expected).map(|p| p.map(f64::from)));
    let through = |film: &Film| film.transmittance.as_flattened().to_vec();
    record.hold("transmittance", through(found), through(expected));
    let solid = |film: &Film| -> Vec<f32> {
        let depths = film.depth.iter().zip(&expected.beauty);
        depths.filter(|(_, pixel)| pixel[3] > 1e-3).map(|(depth, _)| *depth).collect()
    };
    record.hold("depth", solid(found), solid(expected));
}

fn jumps(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = in_steps(&scene(48, 36)?, 48, Jitter::BlueNoise, true);
    let mut renderer = subject.renderer()?;
    let old = sequence(&mut renderer, &scene, &[12])?.remove(0);
    scene.lights = vec![Light::directional(DVec3::new(-0.6, 0.3, 0.5), Vec3::new(5.0, 8.0, 15.0))?];
    let new = by_the_processor(&in_steps(&scene, 512, Jitter::None, false))?;
    let mut errors = Vec::new();
    for frame in 12..20 {
        scene.frame = frame;
        let film = renderer.render(&scene)?.film;
        errors.push(error(&film, &new, |_| true));
        if frame == 12 {
            let (to_old, to_new) = (error(&film, &old, |_| true), errors[0]);
            check!(error(&old, &new, |_| true) > 0.3, "the light's jump changes little: the case tries nothing");
            record.score("nearness at once", "distance to the new over that to the old picture", to_new / to_old, 0.5);
        }
    }
    record.score("eight pictures later", "relative L2 error over the first one's", errors[7] / errors[0], 0.5);
    Ok(())
}
