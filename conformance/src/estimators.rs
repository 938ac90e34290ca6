//! Estimators: options that must not change the picture, and those that must bring it nearer to brute force.

use airlight::basis::{Basis, SphericalHarmonics};
use airlight::glam::{DVec3, UVec3, Vec3};
use airlight::light::Light;
use airlight::media::Phase;
use airlight::reference::{BruteForce, BruteSettings};
use airlight::scene::{
    Content, Direct, Elimination, EnvironmentEstimate, Film, Interpolation, LightsEstimate, Records, Scene, Shadow,
};
use libtest_mimic::Failed;

use crate::compare::{Difference, compare, same_bits};
use crate::fixtures::{Map, chromatic, cloud, grey, sky};
use crate::{Case, Subject, check, tolerance};

/// A cloud large enough to have empty cells, small enough for brute force.
const DIMS: UVec3 = UVec3::new(14, 10, 12);

/// Cells of half a voxel.
const HALF_VOXEL: u32 = 28;

/// Cells of less than a quarter of a voxel.
const FINEST: u32 = 60;

/// A quadrature of the sphere as fine as two parts of a texel of the sky.
const SETTINGS: BruteSettings = BruteSettings { rows: 16, nodes: 2 };

pub(crate) fn cases() -> Vec<Case> {
    let mut cases = vec![
        Case::new("estimators::direct_against_brute_force", direct),
        Case::new("estimators::direct_without_shadow", unshadowed),
        Case::new("estimators::records_against_brute_force", records_converge),
        Case::new("estimators::phase_records_against_brute_force", phase_records),
        Case::new("estimators::emission_is_scattered", emission),
        Case::new("estimators::contents_agree", contents_agree),
        Case::new("estimators::one_probe_loses_light", probes),
    ];
    for (name, interpolation) in [("trilinear", Interpolation::Trilinear), ("nearest", Interpolation::Nearest)] {
        for content in [Content::Radiance, Content::Transmittance, Content::Phase] {
            let name = format!("estimators::exact_elimination_{name}_{content:?}").to_lowercase();
            cases.push(Case::new(name, move |subject| exact(subject, interpolation, content)));
        }
    }
    cases
}

fn with(mut scene: Scene, records: Records) -> Scene {
    scene.estimate.environment = Some(EnvironmentEstimate::Records(records));
    scene
}

fn lit(map: Map, phase: Phase) -> Scene {
    let mut scene = cloud(map, DIMS, grey(phase));
    scene.environment = Some(sky());
    scene
}

fn options(cells: u32, bands: u32, directions: u32, content: Content) -> Records {
    Records { cells, bands, directions, content, ..Records::default() }
}

fn rgb(film: &Film) -> impl Iterator<Item = f64> + use<'_> {
    film.beauty.iter().flat_map(|p| [p[0], p[1], p[2]]).map(f64::from)
}

/// Every fifth pixel of a film against brute force, over RGB.
fn against(truth: &BruteForce<'_>, film: &Film) -> Difference {
    use rayon::prelude::*;
    let places: Vec<u32> = (0..film.width * film.height).step_by(5).collect();
    let expected: Vec<[f64; 4]> = places.par_iter().map(|i| truth.pixel(i % film.width, i / film.width)).collect();
    let found = places.iter().flat_map(|&i| [0, 1, 2].map(|c| f64::from(film.beauty[i as usize][c])));
    compare(found, expected.iter().flat_map(|p| [p[0], p[1], p[2]]))
}

fn direct(subject: &Subject) -> Result<(), Failed> {
    let mut scene = cloud(Map::Sheared, DIMS, chromatic(Phase::HenyeyGreenstein { g: 0.4 }));
    scene.lights = vec![
        Light::directional(DVec3::new(0.5, 0.8, -0.35), Vec3::new(3.0, 2.6, 2.0))?,
        Light::point(DVec3::new(-0.5, 0.9, 0.6), Vec3::new(0.6, 0.7, 1.0))?,
        Light::spot(DVec3::new(0.9, 0.8, -0.9), DVec3::ZERO, Vec3::splat(3.0), 15.0, 30.0)?,
    ];
    scene.quality.step = 0.25;
    let film = subject.renderer()?.render(&scene)?.film;
    let truth = BruteForce::new(&scene, &SETTINGS);
    against(&truth, &film).within("three lights", tolerance::BRUTE_DIRECT_L2, f64::INFINITY)
}

/// Without a shadow the light is the same at every depth: more of it everywhere.
fn unshadowed(subject: &Subject) -> Result<(), Failed> {
    let mut scene = cloud(Map::Plain, DIMS, grey(Phase::Isotropic));
    scene.lights = vec![Light::directional(DVec3::new(0.5, 0.8, -0.35), Vec3::splat(4.0 * std::f32::consts::PI))?];
    let mut renderer = subject.renderer()?;
    let shadowed = renderer.render(&scene)?.film;
    scene.estimate.lights = Some(LightsEstimate::Direct(Direct { shadow: Shadow::None }));
    let film = renderer.render(&scene)?.film;
    let pairs = film.beauty.iter().zip(&shadowed.beauty).filter(|(a, _)| a[3] > 1e-3);
    let darker = pairs.clone().filter(|(a, b)| (0..3).any(|c| a[c] < b[c])).count();
    check!(pairs.count() > 50 && darker == 0, "{darker} pixels are darker without a shadow");
    // p E = 1, so what is scattered is albedo · alpha.
    let expected = film.beauty.iter().flat_map(|p| [0, 1, 2].map(|c| f64::from(scene.optics.albedo[c] * p[3])));
    compare(rgb(&film), expected).within("albedo times alpha", tolerance::CLOSED_L2, tolerance::CLOSED_L2)
}

fn records_converge(subject: &Subject) -> Result<(), Failed> {
    let mut scene = lit(Map::Rotated, Phase::Isotropic);
    scene.quality.step = 0.5;
    let truth_scene = scene.clone();
    let truth = BruteForce::new(&truth_scene, &SETTINGS);
    let mut renderer = subject.renderer()?;
    let mut last = f64::INFINITY;
    for cells in [4, 14, FINEST] {
        scene = with(scene, options(cells, 1, 192, Content::Radiance));
        let error = against(&truth, &renderer.render(&scene)?.film);
        check!(error.relative_l2 < last, "{cells} cells: {:.2e}, after {last:.2e} with fewer", error.relative_l2);
        last = error.relative_l2;
        if cells == FINEST {
            error.within("the finest cells", tolerance::BRUTE_QUARTER_VOXEL_L2, f64::INFINITY)?;
        }
    }
    Ok(())
}

/// With the phase function in the records the light is truncated, and so is the truth's.
fn phase_records(subject: &Subject) -> Result<(), Failed> {
    let mut scene = lit(Map::Mirrored, Phase::HenyeyGreenstein { g: 0.5 });
    scene.quality.step = 0.5;
    let harmonics = SphericalHarmonics::new(4)?;
    let light = scene.environment.as_ref().map(|e| e.project_sh(&harmonics)).unwrap_or_default();
    let truncated = |d: DVec3| {
        let mut values = vec![0.0; harmonics.count()];
        harmonics.eval(d, &mut values);
        light.iter().zip(&values).map(|(c, y)| DVec3::from(*c) * *y).sum()
    };
    let scene = with(scene, options(HALF_VOXEL, 4, 192, Content::Phase));
    let truth = BruteForce::under(&scene, &SETTINGS, truncated);
    let film = subject.renderer()?.render(&scene)?.film;
    against(&truth, &film).within("phase", tolerance::BRUTE_HALF_VOXEL_L2, f64::INFINITY)
}

/// Light of the medium's own, scattered once by the medium.
fn emission(subject: &Subject) -> Result<(), Failed> {
    for (content, phase) in [
        (Content::Radiance, Phase::HenyeyGreenstein { g: 0.3 }),
        (Content::Transmittance, Phase::Isotropic),
        (Content::Phase, Phase::HenyeyGreenstein { g: 0.3 }),
    ] {
        let mut scene = cloud(Map::Plain, DIMS, chromatic(phase));
        scene.optics.emission = Vec3::new(1.0, 0.5, 0.2);
        scene.quality.step = 0.25;
        let scene = with(scene, options(HALF_VOXEL, 4, 192, content));
        let truth = BruteForce::new(&scene, &SETTINGS);
        let film = subject.renderer()?.render(&scene)?.film;
        let what = format!("{content:?}");
        against(&truth, &film).within(&what, tolerance::BRUTE_HALF_VOXEL_L2, f64::INFINITY)?;
    }
    Ok(())
}

/// In a sky of one band and an isotropic medium the three contents are one.
fn contents_agree(subject: &Subject) -> Result<(), Failed> {
    let mut scene = lit(Map::Sheared, Phase::Isotropic);
    let mut sky = airlight::light::Environment::uniform(Vec3::new(0.5, 1.0, 2.0))?;
    sky.visible = false;
    scene.environment = Some(sky);
    let mut renderer = subject.renderer()?;
    let mut film = |content, bands| -> Result<Film, Failed> {
        let scene = with(scene.clone(), options(9, bands, 192, content));
        Ok(renderer.render(&scene)?.film)
    };
    let first = film(Content::Transmittance, 3)?;
    for (content, bands) in [(Content::Phase, 3), (Content::Radiance, 1), (Content::Transmittance, 6)] {
        let other = film(content, bands)?;
        let what = format!("{content:?} with {bands} bands");
        compare(rgb(&other), rgb(&first)).within(&what, tolerance::CONTENT_L2, tolerance::CONTENT_L2)?;
    }
    Ok(())
}

fn exact(subject: &Subject, interpolation: Interpolation, content: Content) -> Result<(), Failed> {
    let phase = if content == Content::Transmittance { Phase::Isotropic } else { Phase::HenyeyGreenstein { g: 0.5 } };
    let scene = lit(Map::Rotated, phase);
    let mut renderer = subject.renderer()?;
    for cells in [5, 13, 31] {
        let records = Records { interpolation, ..options(cells, 2, 48, content) };
        let film = |renderer: &mut airlight::Renderer, elimination| -> Result<Vec<f32>, Failed> {
            let scene = with(scene.clone(), Records { elimination, ..records.clone() });
            let film = renderer.render(&scene)?.film;
            Ok(film.beauty.iter().flatten().copied().collect())
        };
        let none = film(&mut renderer, Elimination::None)?;
        let exact = film(&mut renderer, Elimination::Exact)?;
        same_bits(&format!("{cells} cells"), &exact, &none)?;
    }
    Ok(())
}

/// Probes may miss density, and then lose light; ten along a side miss none here.
fn probes(subject: &Subject) -> Result<(), Failed> {
    let scene = lit(Map::Plain, Phase::Isotropic);
    let mut renderer = subject.renderer()?;
    let mut film = |elimination| -> Result<Film, Failed> {
        let records = Records { elimination, ..options(5, 1, 48, Content::Radiance) };
        Ok(renderer.render(&with(scene.clone(), Records { interpolation: Interpolation::Nearest, ..records }))?.film)
    };
    let none = film(Elimination::None)?;
    let total = |film: &Film| rgb(film).sum::<f64>();
    let (whole, one, ten) =
        (total(&none), total(&film(Elimination::Probes(1))?), total(&film(Elimination::Probes(10))?));
    check!(one < whole, "one probe a cell loses no light: {one} of {whole}");
    check!(ten >= one && ten <= whole, "ten probes keep {ten} of {whole}, one keeps {one}");
    check!((ten / whole - 1.0).abs() < 1e-6, "ten probes keep {ten} of {whole}");
    Ok(())
}
