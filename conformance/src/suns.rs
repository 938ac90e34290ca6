//! Suns that are taken out of the environment, and windows on its bands.

use std::sync::Arc;

use airlight::basis::{SphericalHarmonics, Window, healpix, pixel_integrals};
use airlight::glam::{DVec3, UVec3, Vec3};
use airlight::light::{Environment, Image, Light, Split};
use airlight::media::Phase;
use airlight::reference::BruteForce;
use airlight::scene::{Content, EnvironmentEstimate, ExtractSun, Records, Scene, Solver};
use libtest_mimic::Failed;

use crate::compare::compare;
use crate::estimators::{DIMS, HALF_VOXEL, SETTINGS, Sparse, against};
use crate::fixtures::{Map, cloud, grey, room};
use crate::{Axis, Case, Record, Subject, check, tolerance};

pub(crate) fn cases() -> Vec<Case> {
    vec![
        Case::new(
            "suns::extracted_against_brute_force",
            "Under a sun of 6° in a dim sky, records of three bands with the sun taken out are brute force's; with it they \
             are off by more than twice as much.",
            extracted,
        )
        .within(&tolerance::BRUTE_HALF_VOXEL)
        .permutes(&forms()),
        Case::new(
            "suns::a_light_like_any_other",
            "A sun that is taken out is the directional light, and its sky the environment, that a scene could give.",
            by_hand,
        )
        .permutes(&forms()),
        Case::new(
            "suns::the_sky_is_seen_as_it_is",
            "A sun that is taken out stands in the sky behind the medium all the same.",
            seen,
        ),
        Case::new(
            "suns::a_turning_sky",
            "Where the sky turns, the sun's shadow and the light of the records are made again, and no records.",
            turning,
        ),
        Case::new(
            "suns::windows_against_brute_force",
            "Records with a window on their bands are brute force's under the same faded light.",
            windowed,
        )
        .within(&tolerance::BRUTE_HALF_VOXEL)
        .permutes(&windows()),
        Case::new(
            "suns::windows_on_the_phase_function",
            "Two bands of radiance under Hanning's window are those of half the anisotropy without one.",
            halved,
        ),
    ]
}

/// Forms of records that cut something off: contents with a phase function, at three bands.
fn forms() -> Axis<(Content, Phase)> {
    let hg = Phase::HenyeyGreenstein { g: 0.5 };
    Axis::new(
        "content",
        [
            ("transmittance", (Content::Transmittance, Phase::Isotropic)),
            ("phase", (Content::Phase, hg.clone())),
            ("radiance", (Content::Radiance, hg)),
        ],
    )
}

fn windows() -> Axis<Window> {
    Axis::of("window", [Window::None, Window::Hanning, Window::Lanczos])
}

/// Radiance of the sky around the sun.
const DIM: [f32; 3] = [0.15, 0.2, 0.3];

/// An even, dim sky of texels of 3° with a sun of 2 × 2 of them, which is not seen.
fn sky() -> Environment {
    let (width, height) = (120u32, 60u32);
    let mut texels = vec![DIM; (width * height) as usize];
    for (x, y) in [(93, 17), (94, 17), (93, 18), (94, 18)] {
        texels[(y * width + x) as usize] = [260.0, 230.0, 180.0];
    }
    let mut sky = Environment::new(Image { width, height, texels }).expect("texels are radiance");
    (sky.scale, sky.rotation, sky.visible) = (Vec3::new(1.0, 0.9, 1.1), 25.0, false);
    sky
}

/// The light of [`sky`] from a few directions: the even part from as many as make a smooth integrand exact, the rest
/// from where the picture is brighter.
fn parts(sky: &Environment) -> Vec<(DVec3, DVec3)> {
    const EVEN: u32 = 6;
    const ROWS: u32 = 240;
    let dim = Vec3::from(DIM).as_dvec3() * sky.scale.as_dvec3();
    let mut parts: Vec<_> = healpix::directions(EVEN).into_iter().map(|d| (d, dim * healpix::weight(EVEN))).collect();
    let side = std::f64::consts::PI / f64::from(ROWS);
    for (j, i) in (0..ROWS).flat_map(|j| (0..2 * ROWS).map(move |i| (j, i))) {
        let ((sin, cos), (planar, y)) =
            ((side * (f64::from(i) + 0.5)).sin_cos(), (side * (f64::from(j) + 0.5)).sin_cos());
        let d = DVec3::new(planar * sin, y, planar * cos);
        let more = sky.radiance(d) - dim;
        if more.max_element() > 1e-3 {
            parts.push((d, more * side * side * planar));
        }
    }
    parts
}

fn scene(content: Content, phase: Phase, extract_sun: ExtractSun) -> Scene {
    let mut scene = cloud(Map::Rotated, DIMS, grey(phase));
    scene.environment = Some(sky());
    scene.quality.step = 0.5;
    // Marches, whose shadows are exact.
    let (solver, directions) = (Solver::March, 192);
    let records =
        Records { cells: HALF_VOXEL, bands: 3, directions, content, solver, extract_sun, ..Records::default() };
    scene.estimate.environment = Some(EnvironmentEstimate::Records(records));
    scene
}

fn extracted(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut renderer = subject.renderer()?;
    record.each(&forms(), |record, (content, phase)| {
        let [kept, taken] = [ExtractSun::Never, ExtractSun::Auto].map(|e| scene(*content, phase.clone(), e));
        check!(taken.sun().is_some_and(|sun| sun.taken), "auto leaves the sun where it is");
        let truth = BruteForce::among(&taken, &SETTINGS, &parts(&sky()));
        let Sparse { found, expected } = against(&truth, &renderer.render(&kept)?.film);
        let error = |found: &[f32]| compare(found.iter().copied().map(f64::from), expected.iter().copied()).relative_l2;
        let alone = error(&found);
        let Sparse { found, .. } = against(&truth, &renderer.render(&taken)?.film);
        record.score("radiance", "error with the sun taken out over that without", error(&found) / alone, 0.5);
        record.hold("radiance", found, expected.iter().copied());
        Ok(())
    })
}

fn by_hand(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    record.each(&forms(), |record, (content, phase)| {
        let mut taken = scene(*content, phase.clone(), ExtractSun::Always);
        taken.surfaces = Some(Arc::new(room()));
        let mut given = Scene { lights: taken.lights.clone(), ..scene(*content, phase.clone(), ExtractSun::Never) };
        given.surfaces = taken.surfaces.clone();
        let Some(Split { sun, rest }) = sky().split() else { return Err("the sky has no sun".into()) };
        given.environment = Some(rest);
        given.lights.push(Light::directional(sun.to_light, sun.irradiance.as_vec3())?);
        let [taken, given] = [taken, given].map(|scene| subject.renderer()?.render(&scene).map_err(Failed::from));
        record.same("film", taken?.film.beauty.as_flattened(), given?.film.beauty.as_flattened());
        Ok(())
    })
}

fn seen(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let film = |extract_sun| -> Result<_, Failed> {
        let mut scene = scene(Content::Transmittance, Phase::Isotropic, extract_sun);
        let Some(sky) = &mut scene.environment else { return Err("no sky".into()) };
        sky.visible = true;
        // The eye looks by the cloud toward the sun.
        let Some(Split { sun, .. }) = sky.split() else { return Err("the sky has no sun".into()) };
        let camera = &mut scene.camera;
        camera.target = camera.origin + sun.to_light + 0.2 * sun.to_light.any_orthonormal_vector();
        Ok(subject.renderer()?.render(&scene)?.film)
    };
    let [taken, kept] = [film(ExtractSun::Always)?, film(ExtractSun::Never)?];
    let most = taken.beauty.iter().map(|p| p[0]).fold(0.0, f32::max);
    check!(most > 100.0, "the sun is not in the picture, whose largest red is {most}");
    let clear = |film: &airlight::scene::Film| -> Vec<f32> {
        film.beauty.iter().filter(|p| p[3] == 0.0).flat_map(|p| [p[0], p[1], p[2]]).collect()
    };
    let (taken, kept) = (clear(&taken), clear(&kept));
    check!(taken.len() > 300, "only {} values of clear sky", taken.len());
    record.same("sky", &taken, &kept);
    Ok(())
}

fn turning(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = scene(Content::Transmittance, Phase::Isotropic, ExtractSun::Auto);
    let mut renderer = subject.renderer()?;
    let mut ran = |scene: &Scene| -> Result<_, Failed> { Ok(renderer.render(scene)?.report.ran()) };
    ran(&scene)?;
    check!(ran(&scene)?.is_empty(), "a still sky costs something");
    if let Some(sky) = &mut scene.environment {
        sky.rotation += 40.0;
    }
    let found = ran(&scene)?;
    check!(found == ["relight", "propagate", "march"], "{found:?} ran");
    let fresh = subject.renderer()?.render(&scene)?.film;
    record.same("film", renderer.render(&scene)?.film.beauty.as_flattened(), fresh.beauty.as_flattened());
    Ok(())
}

fn windowed(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let harmonics = SphericalHarmonics::new(3)?;
    let (light, integrals) = (sky().project_sh(&harmonics), pixel_integrals(4, &harmonics));
    record.each(&windows(), |record, &window| {
        let mut scene = scene(Content::Phase, Phase::HenyeyGreenstein { g: 0.3 }, ExtractSun::Never);
        if let Some(EnvironmentEstimate::Records(records)) = &mut scene.estimate.environment {
            // Light that is negative on one side makes more of what interpolation between cells leaves.
            (records.window, records.cells) = (window, HALF_VOXEL / 2 * 3);
        }
        // Factors of three bands, from the window's definition.
        let factors = match window {
            Window::None => [1.0, 1.0, 1.0],
            Window::Hanning => [1.0, 0.75, 0.25],
            Window::Lanczos => [1.0, 0.826_993_343_132_688, 0.413_496_671_566_344],
        };
        let faded = |integrals: &[f64]| -> DVec3 {
            let terms = light.iter().zip(integrals).enumerate();
            terms.map(|(k, (c, integral))| DVec3::from(*c) * (integral * factors[k.isqrt()])).sum()
        };
        // The records' own directions, so that those are no part of the difference.
        let parts: Vec<_> =
            healpix::directions(4).into_iter().zip(integrals.chunks_exact(light.len()).map(faded)).collect();
        let truth = BruteForce::among(&scene, &SETTINGS, &parts);
        let Sparse { found, expected } = against(&truth, &subject.renderer()?.render(&scene)?.film);
        record.hold("radiance", found, expected);
        Ok(())
    })
}

fn halved(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let film = |g: f64, window: Window| -> Result<_, Failed> {
        let mut scene = cloud(Map::Sheared, UVec3::new(7, 5, 9), grey(Phase::HenyeyGreenstein { g }));
        scene.environment = Some(sky());
        let records = Records { cells: 9, bands: 2, extract_sun: ExtractSun::Never, window, ..Records::default() };
        scene.estimate.environment = Some(EnvironmentEstimate::Records(records));
        Ok(subject.renderer()?.render(&scene)?.film)
    };
    let (faded, plain) = (film(0.5, Window::Hanning)?, film(0.25, Window::None)?);
    record.same("film", faded.beauty.as_flattened(), plain.beauty.as_flattened());
    Ok(())
}
