//! Values that are classified, and the local shading that goes with them.

use std::f64::consts::PI;
use std::sync::Arc;

use airlight::glam::{DVec3, Vec3};
use airlight::light::Light;
use airlight::media::{ControlPoint, Grid, GridMedium, Optics, Phase, TransferFunction};
use airlight::scene::{
    EnvironmentEstimate, Estimate, LightsEstimate, Local, Orders, Records, ScatteringEstimate, Solver, Sweeps,
};
use libtest_mimic::Failed;

use crate::fixtures::{DIMS, Map, chromatic, classified, cloud, grey, sky};
use crate::{Axis, Case, Record, Subject, check, tolerance};

pub(crate) fn cases() -> Vec<Case> {
    vec![
        Case::new(
            "keys::classified",
            "Of another transfer function just the fields are made that it changes, and what depends on them; values are \
             uploaded once, and a tint costs a field and the march.",
            redone,
        )
        .permutes(&functions()),
        Case::new(
            "closed::local_ramp",
            "A density that rises along one axis of its lattice sends on what a surface across it would, everywhere alike.",
            ramp,
        )
        .within(&tolerance::CLOSED)
        .permutes(&maps()),
    ]
}

/// A change of the second and third control point, and the stages that it costs.
type Change = (fn(&mut ControlPoint), &'static [&'static str]);

fn functions() -> Axis<Change> {
    type Ran = &'static [&'static str];
    // All further orders, of the environment and of what shines.
    const TINT: Ran = &["classify", "march"];
    const ALBEDO: Ran = &["classify", "classify", "coarsen", "sweep", "sweep", "sweep", "relight", "march"];
    const EMISSION: Ran = &[
        "classify", "classify", "project", "relight", "reduce", "coarsen", "sweep", "sweep", "sweep", "relight",
        "march",
    ];
    const DENSITY: Ran = &[
        "classify", "classify", "classify", "reduce", "project", "relight", "reduce", "coarsen", "sweep", "sweep",
        "sweep", "relight", "march",
    ];
    let change = |change: fn(&mut ControlPoint), ran: Ran| (change, ran);
    Axis::new(
        "change",
        [
            ("nothing", change(|_| (), &[])),
            ("the tint", change(|p| p.tint *= Vec3::new(0.5, 1.0, 0.7), TINT)),
            ("the albedo", change(|p| p.albedo *= 0.6, ALBEDO)),
            ("the emission", change(|p| p.emission *= 2.0, EMISSION)),
            ("the density", change(|p| p.density *= 1.5, DENSITY)),
        ],
    )
}

fn redone(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = cloud(Map::Plain, DIMS, Optics { emission: Vec3::ONE, ..grey(Phase::Isotropic) });
    scene.environment = Some(sky());
    let records = Records { cells: 4, bands: 2, solver: Solver::March, ..Records::default() };
    let sweeps = Sweeps { cells: 4, bands: 1, orders: Orders::Count(3), ..Sweeps::default() };
    scene.estimate = Estimate {
        environment: Some(EnvironmentEstimate::Records(records)),
        scattering: Some(ScatteringEstimate::Sweeps(sweeps)),
        ..Estimate::none()
    };
    let medium = classified(Map::Plain, DIMS);
    scene.medium = Arc::new(medium.clone());
    let mut renderer = subject.renderer()?;
    renderer.render(&scene)?;
    let mut points = medium.function().points().to_vec();
    record.each(&functions(), |record, (change, expected)| {
        points[1..3].iter_mut().for_each(change);
        let changed = medium.with_function(TransferFunction::new(points.clone())?);
        scene.medium = Arc::new(changed);
        let rendered = renderer.render(&scene)?;
        let ran = rendered.report.ran();
        check!(ran == *expected, "{ran:?} ran, and {expected:?} should have");
        check!(!rendered.report.uploads.iter().any(|u| u == "values"), "the values were uploaded again");
        let fresh = subject.renderer()?.render(&scene)?.film;
        record.same("film", rendered.film.beauty.as_flattened(), fresh.beauty.as_flattened());
        Ok(())
    })
}

fn maps() -> Axis<Map> {
    Axis::of("map", Map::ALL)
}

/// J is the same everywhere, so that what a ray brings is albedo · J · (1 - T).
fn ramp(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut renderer = subject.renderer()?;
    record.each(&maps(), |record, &map| {
        let mut scene = cloud(map, DIMS, chromatic(Phase::HenyeyGreenstein { g: 0.6 }));
        let values = (0..DIMS.element_product()).map(|n| 0.2 + 0.3 * (n / DIMS.x % DIMS.y) as f32).collect();
        let lattice = map.lattice(DIMS);
        let grid = Grid::dense(DIMS, lattice.index_to_world(), values)?;
        scene.medium = Arc::new(GridMedium::new(Arc::new(grid), None)?);
        // Less dense along the second axis of the lattice: across the planes that the two others span.
        let normal = -lattice.world_to_index().matrix3.row(1).normalize();
        let beside = normal.any_orthonormal_vector();
        let before = (normal + 0.4 * beside + 0.2 * normal.cross(beside)).normalize();
        let lights = [(before, Vec3::new(3.0, 2.0, 1.0)), (-before, Vec3::new(0.5, 1.0, 2.0))];
        scene.lights = lights.iter().map(|&(to, power)| Light::directional(to, power)).collect::<Result<_, _>>()?;
        let k = Local { ambient: 0.6, diffuse: 0.8, specular: 0.3, shininess: 5.0 };
        scene.estimate.lights = Some(LightsEstimate::Local(k));
        let film = renderer.render(&scene)?.film;
        let [ka, kd, ks, m] = [k.ambient, k.diffuse, k.specular, k.shininess].map(f64::from);
        let camera = &scene.camera;
        let pixel = |i: u32| camera.direction(f64::from(i % camera.width) + 0.5, f64::from(i / camera.width) + 0.5);
        let expected = (0..camera.width * camera.height).map(|i| {
            let d = pixel(i);
            let sent = |&(to, power): &(DVec3, Vec3)| {
                let facing = normal.dot(to).max(0.0);
                let mirrored = 2.0 * normal.dot(to) * normal - to;
                let gloss = (m + 2.0) / (2.0 * PI) * mirrored.dot(-d).max(0.0).powf(m);
                power.as_dvec3() * (ka / (4.0 * PI) + facing * (kd / PI + ks * gloss))
            };
            let light: DVec3 = lights.iter().map(sent).sum();
            let through = film.transmittance[i as usize];
            [0, 1, 2].map(|c| f64::from(scene.optics.albedo[c] * (1.0 - through[c])) * light[c])
        });
        let expected: Vec<[f64; 3]> = expected.collect();
        record.film("radiance", &film, expected);
        Ok(())
    })
}
