//! Whole pictures as the processor renders them: every estimator and option, on a device's own limits and on smaller
//! ones, where everything is cut.

use std::sync::Arc;

use airlight::Renderer;
use airlight::device::Limits;
use airlight::glam::{DVec3, UVec3, Vec3};
use airlight::light::Light;
use airlight::media::{Grid, GridMedium, Homogeneous, Optics, Phase};
use airlight::scene::{
    Content, Direct, Elimination, EnvironmentEstimate, Film, Interpolation, LightsEstimate, Orders, Records,
    ScatteringEstimate, Scene, Shadow, Solver, SurfaceShadow, Sweeps,
};
use libtest_mimic::Failed;

use crate::fixtures::{Map, camera, chromatic, classified, cloud, grey, noise, phases, room, sky, varied};
use crate::limits::sizes;
use crate::{Axis, Case, Record, Subject, rgb, tolerance};

const DIMS: UVec3 = UVec3::new(21, 13, 17);

/// Limits at which the scenes are cut: density in slabs of one to some slices, records and film in bands.
pub(crate) const NARROW: Limits =
    Limits { buffer_bytes: u64::MAX, binding_bytes: 33 << 10, field_side: 23, loop_turns: None };

pub(crate) fn cases() -> Vec<Case> {
    vec![
        Case::new(
            "frames::as_the_processor_renders_them",
            "A device renders every kind of scene as the processor does, and again without running a stage.",
            |subject, record| follow(subject, record, None),
        )
        .within(&tolerance::FRAME)
        .permutes(&scenes()),
        Case::new(
            "frames::cut_at_small_limits",
            "A device whose limits are small, so that fields, records and film are cut, renders every kind of scene as \
             the processor does. One that cuts nothing is tried as it is.",
            |subject, record| follow(subject, record, Some(&NARROW)),
        )
        .within(&tolerance::FRAME)
        .permutes(&scenes()),
        Case::new(
            "frames::cut_sky",
            "A device renders a sky behind the medium as the processor does, also where the sky is cut.",
            cut_sky,
        )
        .within(&tolerance::FRAME)
        .permutes(&sizes()),
        Case::new(
            "frames::ten_bands",
            "A device renders records of ten bands as the processor does, also where they are cut.",
            ten_bands,
        )
        .within(&tolerance::FRAME)
        .permutes(&sizes()),
    ]
}

fn cut_sky(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = cloud(Map::Plain, UVec3::new(1, 1, 1), grey(Phase::Isotropic));
    scene.medium = Arc::new(Homogeneous::new(0.1, DVec3::ZERO, DVec3::new(0.9, 0.7, 1.1))?);
    scene.camera = camera(3, 9, 4);
    let mut sky = sky();
    (sky.visible, sky.rotation) = (true, 35.0);
    scene.environment = Some(sky);
    scene.estimate.environment = None;
    let expected = by_the_processor(&scene)?;
    record.within(record.tolerance().filtered(record.info()), |record| {
        record.each(&sizes(), |record, &narrow| {
            let mut device = subject.device()?;
            if narrow {
                // Some of the sky's 128 texels at a time.
                device.narrow(&Limits { binding_bytes: 2048, field_side: 3, ..NARROW });
            }
            hold(record, &Renderer::new(device).render(&scene)?.film, &expected);
            Ok(())
        })
    })
}

fn ten_bands(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let records = Records { directions: 300, ..records(Content::Radiance, 10) };
    let scene = lit(grey(Phase::HenyeyGreenstein { g: 0.6 }), records);
    let expected = by_the_processor(&scene)?;
    record.within(record.tolerance().filtered(record.info()), |record| {
        record.each(&sizes(), |record, &narrow| {
            let mut device = subject.device()?;
            if narrow {
                // Some records at a time, of 1200 bytes, and some slices of cells, of a hundred layers. The weights of
                // 300 directions are bound as a whole.
                device.narrow(&Limits { binding_bytes: 400_000, field_side: 150, ..NARROW });
            }
            hold(record, &Renderer::new(device).render(&scene)?.film, &expected);
            Ok(())
        })
    })
}

/// Renders all scenes with one renderer: what a scene does not need any more is dropped, what another needs is made.
fn follow(subject: &Subject, record: &mut Record, limits: Option<&Limits>) -> Result<(), Failed> {
    let mut device = subject.device()?;
    if let Some(limits) = limits {
        device.narrow(limits);
    }
    let mut renderer = Renderer::new(device);
    record.each(&scenes(), |record, scene| {
        let nearest = |records: &Records| records.interpolation == Interpolation::Nearest;
        let tolerance = match &scene.estimate.environment {
            Some(EnvironmentEstimate::Records(records)) if nearest(records) => tolerance::FRAME_NEAREST,
            _ => record.tolerance(),
        };
        record.within(tolerance.filtered(record.info()), |record| {
            hold(record, &renderer.render(scene)?.film, &by_the_processor(scene)?);
            let again = renderer.render(scene)?.report.ran();
            record.score("again", "stages that ran", again.len() as f64, 0.0);
            Ok(())
        })
    })
}

/// A scene's film by the processor.
pub(crate) fn by_the_processor(scene: &Scene) -> Result<Film, Failed> {
    Ok(Renderer::new(airlight::open("cpu")?).render(scene)?.film)
}

/// Holds a film to another.
pub(crate) fn hold(record: &mut Record, found: &Film, expected: &Film) {
    let alpha = |film: &Film| film.beauty.iter().map(|p| p[3]).collect::<Vec<_>>();
    // Depths are infinite where there is nothing; their inverses are not.
    let near = |film: &Film| film.depth.iter().map(|d| 1.0 / d).collect::<Vec<_>>();
    record.film("radiance", found, rgb(expected).map(|p| p.map(f64::from)));
    record.hold("alpha", alpha(found), alpha(expected));
    let through = |film: &Film| film.transmittance.as_flattened().to_vec();
    record.hold("transmittance", through(found), through(expected));
    record.hold("inverse depth", near(found), near(expected));
}

/// A scene of every estimator and option.
fn scenes() -> Axis<Scene> {
    let hg = || Phase::HenyeyGreenstein { g: 0.6 };
    let of = |name: &str| phases().into_iter().find(|(n, _)| *n == name).map_or(Phase::Isotropic, |(_, phase)| phase);
    let glowing = |optics: Optics| Optics { emission: Vec3::new(1.5, 0.4, 0.1), ..optics };
    let (radiance, phase) = (Content::Radiance, Content::Phase);
    let mut scenes = vec![
        ("radiance", lit(grey(Phase::Isotropic), records(radiance, 3))),
        ("radiance in layers", lit(chromatic(hg()), records(radiance, 5))),
        ("transmittance", lit(grey(Phase::Isotropic), records(Content::Transmittance, 4))),
        ("phase by a table, and lights", with_lights(lit(chromatic(of("table")), records(phase, 3)))),
        ("phase of Rayleigh", lit(grey(Phase::Rayleigh), records(phase, 4))),
        ("emission in layers", lit(glowing(chromatic(hg())), records(radiance, 3))),
        ("emission in one layer", lit(glowing(grey(Phase::Isotropic)), records(Content::Transmittance, 3))),
        ("lights", with_lights(lit(chromatic(of("double_hg")), records(radiance, 2)))),
    ];
    // 11, 7 and 9 cells: with an even number, a border would lie in the middle of the box, and on it the middle sample of every
    // ray from one wall to the one across.
    let nearest = Records {
        cells: 11,
        interpolation: Interpolation::Nearest,
        elimination: Elimination::Probes(3),
        directions: 192,
        ..records(radiance, 3)
    };
    scenes.push(("nearest, with probes", lit(grey(Phase::Rayleigh), nearest)));
    let mut seen = lit(grey(Phase::Isotropic), records(radiance, 1));
    if let Some(sky) = &mut seen.environment {
        (sky.visible, sky.rotation, sky.scale) = (true, 35.0, Vec3::new(0.1, 0.08, 0.13));
    }
    scenes.push(("a sky that is seen", seen));
    let mut varying = with_lights(lit(glowing(chromatic(hg())), records(radiance, 2)));
    varying.medium = Arc::new(varied(Map::Rotated, DIMS));
    scenes.push(("albedo, absorption and heat that vary", varying));
    let mut unshadowed = with_lights(lit(grey(Phase::Rayleigh), records(radiance, 1)));
    (unshadowed.environment, unshadowed.estimate.environment) = (None, None);
    unshadowed.estimate.lights = Some(LightsEstimate::Direct(Direct { shadow: Shadow::None, ..Direct::default() }));
    scenes.push(("lights alone, without shadow", unshadowed));
    let mut surfaces = with_lights(lit(chromatic(hg()), records(radiance, 2)));
    surfaces.surfaces = Some(Arc::new(room()));
    let by = |surface_shadow| Some(LightsEstimate::Direct(Direct { shadow: Shadow::March, surface_shadow }));
    surfaces.estimate.lights = by(SurfaceShadow::Ray);
    scenes.push(("surfaces", surfaces.clone()));
    surfaces.estimate.lights = by(SurfaceShadow::Map(24));
    scenes.push(("surfaces with maps", surfaces));
    // So many orders: the iteration toward convergence takes what it combines from rounded sums.
    let orders = |mut scene: Scene, bands: u32| {
        let sweeps = Sweeps { cells: 6, bands, orders: Orders::Count(5), ..Sweeps::default() };
        scene.estimate.scattering = Some(ScatteringEstimate::Sweeps(sweeps));
        scene
    };
    // Moments and radiance are bound whole: few enough cells for the smallest limits.
    let swept = |content| Records { cells: 6, solver: Solver::Sweep, ..records(content, 3) };
    scenes.push(("swept records", lit(glowing(chromatic(hg())), swept(radiance))));
    scenes.push(("swept transmittance", lit(grey(Phase::Isotropic), swept(Content::Transmittance))));
    scenes.push(("five orders", orders(with_lights(lit(grey(Phase::Isotropic), swept(radiance))), 3)));
    let mut forward = orders(with_lights(lit(glowing(chromatic(hg())), swept(radiance))), 3);
    (forward.surfaces, forward.estimate.lights) = (Some(Arc::new(room())), by(SurfaceShadow::Ray));
    scenes.push(("five orders, forward", forward));
    let mut varying = orders(with_lights(lit(glowing(chromatic(Phase::Rayleigh)), swept(radiance))), 2);
    varying.medium = Arc::new(varied(Map::Rotated, DIMS));
    scenes.push(("five orders of what varies", varying));
    let mut values = orders(with_lights(lit(glowing(chromatic(hg())), swept(radiance))), 2);
    values.medium = Arc::new(classified(Map::Rotated, DIMS));
    scenes.push(("values that are classified", values));
    Axis::new("scene", scenes)
}

fn records(content: Content, bands: u32) -> Records {
    Records { cells: 9, bands, directions: 108, content, solver: Solver::March, ..Records::default() }
}

/// A cloud under a sky, with an emission density of its own where it glows.
pub(crate) fn lit(optics: Optics, records: Records) -> Scene {
    let glows = optics.emits();
    let mut scene = cloud(Map::Rotated, DIMS, optics);
    if glows {
        let map = scene.medium.lattice().index_to_world();
        let grid = |values: Vec<f32>| Arc::new(Grid::dense(DIMS, map, values).expect("as many values as voxels"));
        let density = crate::fixtures::density(DIMS, 5);
        let glow = noise(6, density.len()).iter().map(|v| (v - 0.5).max(0.0)).collect();
        scene.medium = Arc::new(GridMedium::new(grid(density), Some(grid(glow))).expect("densities"));
    }
    scene.camera = camera(45, 31, 2);
    scene.environment = Some(sky());
    scene.estimate.environment = Some(EnvironmentEstimate::Records(records));
    scene
}

fn with_lights(mut scene: Scene) -> Scene {
    scene.lights = vec![
        Light::directional(DVec3::new(0.4, 1.0, -0.2), Vec3::new(2.0, 1.5, 1.0)).expect("a light"),
        Light::point(DVec3::new(0.7, 0.9, 1.1), Vec3::new(0.2, 0.4, 0.3)).expect("a light"),
        Light::spot(DVec3::new(-0.5, 1.2, 0.6), DVec3::new(0.1, 0.0, 0.2), Vec3::splat(1.5), 10.0, 30.0)
            .expect("a light"),
    ];
    scene.estimate.lights = Some(LightsEstimate::Direct(Direct { shadow: Shadow::March, ..Direct::default() }));
    scene
}
