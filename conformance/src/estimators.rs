//! Estimators: options that must not change the picture, and those that must bring it nearer to brute force.

use std::sync::Arc;

use airlight::basis::{Basis, DiscreteSpherical, SphericalHarmonics};
use airlight::glam::{DVec3, UVec3, Vec3};
use airlight::light::Light;
use airlight::media::Phase;
use airlight::reference::{BruteForce, BruteSettings};
use airlight::scene::{
    Content, Direct, Elimination, EnvironmentEstimate, ExtractSun, Film, Interpolation, LightsEstimate, Opacity,
    RecordBasis, Records, Scene, Shadow, Solver,
};
use libtest_mimic::Failed;

use crate::compare::compare;
use crate::fixtures::{Map, chromatic, cloud, grey, sky, varied};
use crate::{Axis, Case, Record, Subject, check, rgb, tolerance};

/// A cloud large enough to have empty cells, small enough for brute force.
pub(crate) const DIMS: UVec3 = UVec3::new(14, 10, 12);

/// Cells of half a voxel.
pub(crate) const HALF_VOXEL: u32 = 28;

/// Cells of less than a quarter of a voxel.
const FINEST: u32 = 60;

/// A quadrature of the sphere as fine as two parts of a texel of the sky.
pub(crate) const SETTINGS: BruteSettings = BruteSettings { rows: 16, nodes: 2 };

pub(crate) fn cases() -> Vec<Case> {
    let mut cases = vec![
        Case::new(
            "estimators::direct_against_brute_force",
            "Directional, point and spot light, each with the medium's own shadow, are brute force's.",
            direct,
        )
        .within(&tolerance::BRUTE_DIRECT),
        Case::new(
            "estimators::opacity_against_brute_force",
            "Propagated shadows of five lights come nearer to brute force with every finer grid of cells.",
            opacity_converges,
        )
        .within(&tolerance::BRUTE_OPACITY)
        .permutes(&light_cells()),
        Case::new(
            "estimators::direct_without_shadow",
            "Without a shadow a light scatters albedo · alpha, nowhere less than with one.",
            unshadowed,
        )
        .within(&tolerance::CLOSED),
        Case::new(
            "estimators::records_against_brute_force",
            "Records come nearer to brute force with every finer grid of cells.",
            records_converge,
        )
        .within(&tolerance::BRUTE_QUARTER_VOXEL)
        .permutes(&fineness()),
        Case::new(
            "estimators::phase_records_against_brute_force",
            "Records with the phase function in them are brute force's under the same truncated light.",
            phase_records,
        )
        .within(&tolerance::BRUTE_HALF_VOXEL),
        Case::new(
            "estimators::discrete_records_against_brute_force",
            "Records of transmittance in discrete functions, swept, and of the phase function, marched, are brute force's \
             under the same blurred light.",
            discrete_records,
        )
        .within(&tolerance::BRUTE_HALF_VOXEL)
        .permutes(&discrete()),
        Case::new(
            "estimators::emission_is_scattered",
            "Light of the medium's own, scattered once by the medium, is brute force's.",
            emission,
        )
        .within(&tolerance::BRUTE_HALF_VOXEL)
        .permutes(&contents()),
        Case::new(
            "estimators::varying_albedo_in_lights",
            "Lights on a cloud whose albedo and absorption vary from voxel to voxel are brute force's.",
            varying_lights,
        )
        .within(&tolerance::BRUTE_DIRECT),
        Case::new(
            "estimators::varying_optics_in_records",
            "A sky on a cloud whose albedo, absorption and heat vary from voxel to voxel, and the cloud's own light, seen \
             and scattered once, are brute force's.",
            varying_records,
        )
        .within(&tolerance::BRUTE_HALF_VOXEL)
        .permutes(&forms()),
        Case::new(
            "estimators::contents_agree",
            "In a sky of one band and an isotropic medium all contents of records are one.",
            contents_agree,
        )
        .within(&tolerance::CONTENT)
        .varies(&equal_contents()),
        Case::new(
            "estimators::one_probe_loses_light",
            "One probe a cell misses density and loses light; ten along a side lose none here.",
            probes,
        ),
    ];
    for (name, interpolation) in [("trilinear", Interpolation::Trilinear), ("nearest", Interpolation::Nearest)] {
        for content in [Content::Radiance, Content::Transmittance, Content::Phase] {
            let content_name = format!("{content:?}").to_lowercase();
            let case = Case::new(
                format!("estimators::exact_elimination_{name}_{content_name}"),
                format!("Leaving out the empty cells changes no bit of a picture ({name}, records of {content_name})."),
                move |subject, record| exact(subject, record, interpolation, content),
            );
            let case = case.permutes(&cell_counts()).varies(&eliminations());
            cases.push(case.at("interpolation", name).at("content", content_name));
        }
    }
    cases
}

/// Cells along the longest side, ever finer.
fn fineness() -> Axis<u32> {
    Axis::of("cells", [4, 14, FINEST])
}

/// Cells of the lights' field, ever finer.
fn light_cells() -> Axis<u32> {
    Axis::of("cells", [5, 14, HALF_VOXEL])
}

/// Content, discrete functions and solver.
fn discrete() -> Axis<(Content, u32, Solver)> {
    Axis::new(
        "records",
        [
            ("phase, 42, marched", (Content::Phase, 42, Solver::March)),
            ("transmittance, 162, swept", (Content::Transmittance, 162, Solver::Sweep)),
        ],
    )
}

/// Contents of records with a phase function that they take.
fn contents() -> Axis<(Content, Phase)> {
    let hg = Phase::HenyeyGreenstein { g: 0.3 };
    Axis::new(
        "content",
        [
            ("radiance", (Content::Radiance, hg.clone())),
            ("transmittance", (Content::Transmittance, Phase::Isotropic)),
            ("phase", (Content::Phase, hg)),
        ],
    )
}

/// Contents of records of a coloured emission.
fn forms() -> Axis<Content> {
    Axis::new("content", [("radiance", Content::Radiance), ("phase", Content::Phase)])
}

/// Contents and bands that make one picture in a sky of one band.
fn equal_contents() -> Axis<(Content, u32)> {
    Axis::new(
        "content",
        [
            ("transmittance with 3 bands", (Content::Transmittance, 3)),
            ("phase with 3 bands", (Content::Phase, 3)),
            ("radiance with 1 band", (Content::Radiance, 1)),
            ("transmittance with 6 bands", (Content::Transmittance, 6)),
        ],
    )
}

/// Fewer and more cells than voxels.
fn cell_counts() -> Axis<u32> {
    Axis::of("cells", [5, 13, 31])
}

fn eliminations() -> Axis<Elimination> {
    Axis::of("elimination", [Elimination::None, Elimination::Exact])
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
    Records {
        cells,
        bands,
        directions,
        content,
        solver: Solver::March,
        extract_sun: ExtractSun::Never,
        ..Records::default()
    }
}

/// The colours of every fifth pixel.
pub(crate) struct Sparse {
    pub(crate) found: Vec<f32>,
    pub(crate) expected: Vec<f64>,
}

/// Every fifth pixel of a film, and of brute force.
pub(crate) fn against(truth: &BruteForce<'_>, film: &Film) -> Sparse {
    use rayon::prelude::*;
    let places: Vec<u32> = (0..film.width * film.height).step_by(5).collect();
    let expected: Vec<[f64; 4]> = places.par_iter().map(|i| truth.pixel(i % film.width, i / film.width)).collect();
    Sparse {
        found: places.iter().flat_map(|&i| [0, 1, 2].map(|c| film.beauty[i as usize][c])).collect(),
        expected: expected.iter().flat_map(|p| [p[0], p[1], p[2]]).collect(),
    }
}

/// A slanted cloud under a light of each kind.
fn three_lights() -> Result<Scene, Failed> {
    let mut scene = cloud(Map::Sheared, DIMS, chromatic(Phase::HenyeyGreenstein { g: 0.4 }));
    scene.lights = vec![
        Light::directional(DVec3::new(0.5, 0.8, -0.35), Vec3::new(3.0, 2.6, 2.0))?,
        Light::point(DVec3::new(-0.5, 0.9, 0.6), Vec3::new(0.6, 0.7, 1.0))?,
        Light::spot(DVec3::new(0.9, 0.8, -0.9), DVec3::ZERO, Vec3::splat(3.0), 15.0, 30.0)?,
    ];
    scene.quality.step = 0.25;
    Ok(scene)
}

fn direct(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = three_lights()?;
    scene.estimate.lights = Some(LightsEstimate::Direct(Direct { shadow: Shadow::March, ..Direct::default() }));
    let film = subject.renderer()?.render(&scene)?.film;
    let truth = BruteForce::new(&scene, &SETTINGS);
    let Sparse { found, expected } = against(&truth, &film);
    record.hold("three lights", found, expected);
    Ok(())
}

/// With more lights than a layer holds.
fn opacity_converges(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = three_lights()?;
    scene.lights.push(Light::point(DVec3::new(0.05, 0.02, 0.1), Vec3::new(0.02, 0.01, 0.03))?);
    scene.lights.push(Light::directional(DVec3::new(-0.2, -0.9, 0.1), Vec3::new(0.3, 0.6, 0.2))?);
    let truth = BruteForce::new(&scene, &SETTINGS);
    let mut renderer = subject.renderer()?;
    let mut last = f64::INFINITY;
    record.each(&light_cells(), |record, &cells| {
        let mut scene = scene.clone();
        scene.estimate.lights = Some(LightsEstimate::Opacity(Opacity { cells, ..Opacity::default() }));
        let film = renderer.render(&scene)?.film;
        let Sparse { found, expected } = against(&truth, &film);
        let error = compare(found.iter().copied().map(f64::from), expected.iter().copied()).relative_l2;
        check!(error < last, "{cells} cells: {error:.2e}, after {last:.2e} with fewer");
        last = error;
        if cells == HALF_VOXEL {
            record.hold("five lights", found, expected);
        }
        Ok(())
    })
}

/// Without a shadow the light is the same at every depth: more of it everywhere.
fn unshadowed(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = cloud(Map::Plain, DIMS, grey(Phase::Isotropic));
    scene.lights = vec![Light::directional(DVec3::new(0.5, 0.8, -0.35), Vec3::splat(4.0 * std::f32::consts::PI))?];
    let mut renderer = subject.renderer()?;
    let shadowed = renderer.render(&scene)?.film;
    scene.estimate.lights = Some(LightsEstimate::Direct(Direct { shadow: Shadow::None, ..Direct::default() }));
    let film = renderer.render(&scene)?.film;
    let pairs = film.beauty.iter().zip(&shadowed.beauty).filter(|(a, _)| a[3] > 1e-3);
    let darker = pairs.clone().filter(|(a, b)| (0..3).any(|c| a[c] < b[c])).count();
    check!(pairs.count() > 50 && darker == 0, "{darker} pixels are darker without a shadow");
    // p E = 1, so what is scattered is albedo · alpha.
    let expected = film.beauty.iter().map(|p| [0, 1, 2].map(|c| f64::from(scene.optics.albedo[c] * p[3])));
    record.film("albedo times alpha", &film, expected);
    Ok(())
}

fn records_converge(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = lit(Map::Rotated, Phase::Isotropic);
    scene.quality.step = 0.5;
    let truth = BruteForce::new(&scene, &SETTINGS);
    let mut renderer = subject.renderer()?;
    let mut last = f64::INFINITY;
    record.each(&fineness(), |record, &cells| {
        let film = renderer.render(&with(scene.clone(), options(cells, 1, 192, Content::Radiance)))?.film;
        let Sparse { found, expected } = against(&truth, &film);
        let error = compare(found.iter().copied().map(f64::from), expected.iter().copied()).relative_l2;
        check!(error < last, "{cells} cells: {error:.2e}, after {last:.2e} with fewer");
        last = error;
        if cells == FINEST {
            record.hold("radiance", found, expected);
        }
        Ok(())
    })
}

/// With the phase function in the records the light is truncated, and so is the truth's.
fn phase_records(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
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
    let Sparse { found, expected } = against(&truth, &film);
    record.hold("radiance", found, expected);
    Ok(())
}

/// The light is blurred, and so is the truth's.
fn discrete_records(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut renderer = subject.renderer()?;
    record.each(&discrete(), |record, &(content, functions, solver)| {
        let phase = if content == Content::Phase { Phase::HenyeyGreenstein { g: 0.5 } } else { Phase::Isotropic };
        let mut scene = lit(Map::Mirrored, phase);
        scene.quality.step = 0.5;
        let directions = if functions > 100 { 768 } else { 192 };
        let records =
            Records { basis: RecordBasis::Discrete(functions), solver, ..options(HALF_VOXEL, 3, directions, content) };
        let basis = DiscreteSpherical::new(functions)?;
        let light = scene.environment.as_ref().map(|e| e.coefficients(&basis)).unwrap_or_default();
        let blurred = |d: DVec3| {
            let mut sum = DVec3::ZERO;
            basis.each(d, &mut |k, v| sum += DVec3::from(light[k]) * v);
            sum
        };
        let scene = with(scene, records);
        let truth = BruteForce::under(&scene, &SETTINGS, blurred);
        let film = renderer.render(&scene)?.film;
        let Sparse { found, expected } = against(&truth, &film);
        record.hold("radiance", found, expected);
        Ok(())
    })
}

/// Light of the medium's own, scattered once by the medium.
fn emission(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    record.each(&contents(), |record, (content, phase)| {
        let mut scene = cloud(Map::Plain, DIMS, chromatic(phase.clone()));
        scene.optics.emission = Vec3::new(1.0, 0.5, 0.2);
        scene.quality.step = 0.25;
        let scene = with(scene, options(HALF_VOXEL, 4, 192, *content));
        let truth = BruteForce::new(&scene, &SETTINGS);
        let film = subject.renderer()?.render(&scene)?.film;
        let Sparse { found, expected } = against(&truth, &film);
        record.hold("radiance", found, expected);
        Ok(())
    })
}

fn varying_lights(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = three_lights()?;
    scene.medium = Arc::new(varied(Map::Sheared, DIMS));
    scene.estimate.lights = Some(LightsEstimate::Direct(Direct { shadow: Shadow::March, ..Direct::default() }));
    let film = subject.renderer()?.render(&scene)?.film;
    let truth = BruteForce::new(&scene, &SETTINGS);
    let Sparse { found, expected } = against(&truth, &film);
    record.hold("three lights", found, expected);
    Ok(())
}

/// Under a sky of few bands, which records of the phase function hold whole.
fn varying_records(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = cloud(Map::Rotated, DIMS, chromatic(Phase::HenyeyGreenstein { g: 0.3 }));
    scene.medium = Arc::new(varied(Map::Rotated, DIMS));
    let mut sky = airlight::light::Environment::uniform(Vec3::new(0.5, 1.0, 2.0))?;
    sky.visible = false;
    scene.environment = Some(sky);
    scene.optics.emission = Vec3::new(0.5, 0.8, 2.0);
    scene.quality.step = 0.25;
    let truth = BruteForce::new(&scene, &SETTINGS);
    let mut renderer = subject.renderer()?;
    record.each(&forms(), |record, &content| {
        let film = renderer.render(&with(scene.clone(), options(HALF_VOXEL, 4, 192, content)))?.film;
        let Sparse { found, expected } = against(&truth, &film);
        record.hold("radiance", found, expected);
        Ok(())
    })
}

/// The first content is the others' truth.
fn contents_agree(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = lit(Map::Sheared, Phase::Isotropic);
    let mut sky = airlight::light::Environment::uniform(Vec3::new(0.5, 1.0, 2.0))?;
    sky.visible = false;
    scene.environment = Some(sky);
    let mut renderer = subject.renderer()?;
    let mut first: Option<Film> = None;
    record.each(&equal_contents(), |record, &(content, bands)| {
        let film = renderer.render(&with(scene.clone(), options(9, bands, 192, content)))?.film;
        let truth = first.get_or_insert_with(|| film.clone());
        record.film("radiance", &film, rgb(truth).map(|p| p.map(f64::from)));
        Ok(())
    })
}

fn exact(subject: &Subject, record: &mut Record, interpolation: Interpolation, content: Content) -> Result<(), Failed> {
    let phase = if content == Content::Transmittance { Phase::Isotropic } else { Phase::HenyeyGreenstein { g: 0.5 } };
    let scene = lit(Map::Rotated, phase);
    let mut renderer = subject.renderer()?;
    record.each(&cell_counts(), |record, &cells| {
        record.each(&eliminations(), |record, &elimination| {
            let records = Records { interpolation, elimination, ..options(cells, 2, 48, content) };
            let film = renderer.render(&with(scene.clone(), records))?.film;
            let tolerance = tolerance::WEIGHTLESS.filtered(record.info());
            record.within(tolerance, |record| record.steady_but_filtered("film", film.beauty.as_flattened()));
            Ok(())
        })
    })
}

/// Probes may miss density, and then lose light; ten along a side miss none here.
fn probes(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let scene = lit(Map::Plain, Phase::Isotropic);
    let mut renderer = subject.renderer()?;
    let mut film = |elimination| -> Result<Film, Failed> {
        let records = Records { elimination, ..options(5, 1, 48, Content::Radiance) };
        Ok(renderer.render(&with(scene.clone(), Records { interpolation: Interpolation::Nearest, ..records }))?.film)
    };
    let none = film(Elimination::None)?;
    let total = |film: &Film| rgb(film).flatten().map(f64::from).sum::<f64>();
    let (whole, one, ten) =
        (total(&none), total(&film(Elimination::Probes(1))?), total(&film(Elimination::Probes(10))?));
    check!(one < whole, "one probe a cell loses no light: {one} of {whole}");
    check!(ten >= one && ten <= whole, "ten probes keep {ten} of {whole}, one keeps {one}");
    record.score("ten probes", "share of the light lost", 1.0 - ten / whole, 1e-6);
    Ok(())
}
