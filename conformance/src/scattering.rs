//! Sweeps and all orders of scattering: the white furnace, balance of energy, reciprocity, and pictures that an independent
//! path tracer made.

use airlight::glam::{DVec3, UVec3, Vec3};
use airlight::light::{Environment, Image, Light};
use airlight::media::{Optics, Phase};
use airlight::scene::{
    Camera, Content, Direct, EnvironmentEstimate, Estimate, LightsEstimate, Orders, Records, ScatteringEstimate, Scene,
    Shadow, Solver, Sweeps,
};
use libtest_mimic::Failed;

use crate::fixtures::{Map, camera, cloud};
use crate::{Axis, Case, Difference, Record, Subject, check, compare, pictures, tolerance};

pub(crate) fn cases() -> Vec<Case> {
    let mut all = vec![
        Case::new(
            "scattering::white_furnace",
            "All orders of scattering without absorption, in a uniform environment, send the environment's radiance on.",
            furnace,
        )
        .within(&tolerance::FURNACE)
        .permutes(&furnace_phases())
        .permutes(&depths()),
        Case::new(
            "scattering::energy_balance",
            "A medium that shines as much as it absorbs sends the radiance of its environment on: what leaves and what is \
             absorbed is what entered.",
            balance,
        )
        .within(&tolerance::FURNACE)
        .permutes(&albedos()),
        Case::new(
            "scattering::reciprocity",
            "What comes back one way of light that came the other is the same the other way round.",
            reciprocity,
        )
        .within(&tolerance::RECIPROCITY)
        .permutes(&furnace_phases()),
        Case::new(
            "scattering::orders",
            "So many orders are what one more sweep makes of one less, and converge to what is asked to converge.",
            orders,
        )
        .within(&tolerance::CONVERGED),
        Case::new(
            "scattering::swept_records",
            "Records by sweeps make the pictures of records by marches.",
            swept,
        )
        .within(&tolerance::SWEPT)
        .permutes(&contents()),
    ];
    all.extend(multiple().into_iter().map(|picture| {
        let settings = picture.settings.clone();
        let (name, file, tolerance) = (format!("scattering::{}", picture.name), picture.file, picture.tolerance);
        let checks = format!("All orders ({settings}) give {file}, over blocks of 8 × 8 pixels.");
        Case::new(name, checks, move |subject, record| {
            let (found, expected) = picture.blocks(subject)?;
            record.hold("blocks", found, expected);
            Ok(())
        })
        .within(tolerance)
    }));
    all
}

pub(crate) fn furnace_phases() -> Axis<Phase> {
    Axis::new("phase", [("isotropic", Phase::Isotropic), ("hg", Phase::HenyeyGreenstein { g: 0.5 })])
}

/// Extinction per unit of density, 1/m, over a cloud of about 0.7 m.
pub(crate) fn depths() -> Axis<f32> {
    Axis::new("depth", [("thin", 0.4), ("thick", 30.0)])
}

pub(crate) fn albedos() -> Axis<f32> {
    Axis::new("albedo", [("half", 0.5), ("high", 0.9)])
}

/// Forms of records that do not look at the eye.
fn contents() -> Axis<Content> {
    Axis::of("content", [Content::Radiance, Content::Transmittance])
}

/// A uniform environment, hidden.
pub(crate) fn uniform(radiance: f32) -> Result<Environment, Failed> {
    let mut sky = Environment::new(Image { width: 2, height: 1, texels: vec![[radiance; 3]; 2] })?;
    sky.visible = false;
    Ok(sky)
}

/// A rough cloud with all orders by grids of as many cells in every estimator.
pub(crate) fn scattering(optics: Optics, environment: Option<Environment>) -> Scene {
    let mut scene = cloud(Map::Sheared, UVec3::new(14, 11, 17), optics);
    scene.environment = environment;
    scene.estimate = Estimate {
        environment: Some(EnvironmentEstimate::Records(Records { cells: 17, ..Records::default() })),
        lights: Some(LightsEstimate::Direct(Direct { shadow: Shadow::March, ..Direct::default() })),
        scattering: Some(ScatteringEstimate::Sweeps(Sweeps { cells: 17, ..Sweeps::default() })),
        all: None,
    };
    scene
}

/// Pixels through which something of the medium is seen.
pub(crate) const SEEN: f32 = 0.01;

/// Holds radiance to alpha, as in a furnace of radiance 1.
pub(crate) fn hold_white(subject: &Subject, record: &mut Record, scene: &Scene) -> Result<(), Failed> {
    let film = subject.renderer()?.render(scene)?.film;
    let seen = || film.beauty.iter().filter(|p| p[3] > SEEN);
    check!(seen().count() > 40, "only {} pixels show the medium: the case tries nothing", seen().count());
    let rgb = |p: &[f32; 4]| [0, 1, 2].map(|c| f64::from(p[c] / p[3]));
    record.hold("radiance over alpha", seen().flat_map(|p| rgb(p).map(|v| v as f32)), seen().flat_map(|_| [1.0; 3]));
    let worst = seen().flat_map(rgb).map(|v| (v - 1.0).abs()).fold(0.0, f64::max);
    record.score("radiance over alpha", "largest error", worst, tolerance::FURNACE.relative_l2);
    Ok(())
}

fn furnace(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    record.each(&furnace_phases(), |record, phase| {
        record.each(&depths(), |record, &extinction| {
            let optics = Optics { phase: phase.clone(), ..Optics::grey(extinction, 1.0) };
            hold_white(subject, record, &scattering(optics, Some(uniform(1.0)?)))
        })
    })
}

/// By Kirchhoff's law a medium at the temperature of its surroundings cannot be told from them.
fn balance(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    record.each(&albedos(), |record, &albedo| {
        let extinction = 12.0;
        let emission = Vec3::splat((1.0 - albedo) * extinction);
        let optics = Optics { emission, ..Optics::grey(extinction, albedo) };
        hold_white(subject, record, &scattering(optics, Some(uniform(1.0)?)))
    })
}

/// Light scattered from one direction into another: radiance summed over a picture from far away.
fn scattered(subject: &Subject, phase: &Phase, from: DVec3, into: DVec3) -> Result<f64, Failed> {
    let optics = Optics { phase: phase.clone(), ..Optics::grey(10.0, 0.95) };
    let mut scene = scattering(optics, None);
    scene.quality.step = 0.25;
    scene.lights = vec![Light::directional(from, Vec3::ONE)?];
    let center = DVec3::new(0.1, -0.05, 0.2);
    // As good as parallel: the box is a hundredth of a radian wide.
    scene.camera = Camera { origin: center + 200.0 * into.normalize(), target: center, fov: 0.55, ..camera(40, 40, 1) };
    let film = subject.renderer()?.render(&scene)?.film;
    let border = (0..1600).filter(|i| i % 40 == 0 || i % 40 == 39 || i / 40 == 0 || i / 40 == 39);
    check!(border.clone().all(|i| film.beauty[i][3] == 0.0), "the picture cuts the medium off");
    Ok(film.beauty.iter().map(|p| f64::from(p[0])).sum())
}

fn reciprocity(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    record.each(&furnace_phases(), |record, phase| {
        let (a, b) = (DVec3::new(0.5, 0.8, -0.35), DVec3::new(-0.9, 0.1, 0.5));
        let there = scattered(subject, phase, a, b)?;
        let back = scattered(subject, phase, b, a)?;
        check!(there > 1.0, "nothing is scattered");
        record.hold("scattered light", [there as f32], [back]);
        Ok(())
    })
}

fn orders(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let optics = Optics { phase: Phase::HenyeyGreenstein { g: 0.4 }, ..Optics::grey(10.0, 0.8) };
    let mut renderer = subject.renderer()?;
    let mut render = |orders: Orders| -> Result<(Vec<f32>, u32), Failed> {
        let mut scene = scattering(optics.clone(), Some(crate::fixtures::sky()));
        scene.estimate.scattering = Some(ScatteringEstimate::Sweeps(Sweeps { cells: 17, orders, ..Sweeps::default() }));
        let rendered = renderer.render(&scene)?;
        let solved = rendered.report.solved.first().map_or(0, |solved| solved.sweeps);
        Ok((rendered.film.beauty.iter().flat_map(|p| [p[0], p[1], p[2]]).collect(), solved))
    };
    let (single, none) = render(Orders::Count(1))?;
    let (double, one) = render(Orders::Count(2))?;
    let (many, plain) = render(Orders::Count(60))?;
    let (all, fast) = render(Orders::Converged { tolerance: 1e-4 })?;
    check!([none, one, plain] == [0, 1, 59], "sweeps: {none}, {one}, {plain}");
    check!(fast < 20, "{fast} sweeps until convergence");
    let sum = |film: &[f32]| film.iter().map(|&v| f64::from(v)).sum::<f64>();
    let [single, double, more] = [&single, &double, &many].map(|film| sum(film));
    check!(1.1 * single < double && 1.1 * double < more, "orders add light: {single}, {double}, {more}");
    record.hold("radiance", all, many.into_iter().map(f64::from));
    Ok(())
}

fn swept(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    record.each(&contents(), |record, &content| {
        let mut renderer = subject.renderer()?;
        let mut render = |solver: Solver| -> Result<Vec<[f32; 4]>, Failed> {
            let directions = 48;
            let records = Records { cells: 36, solver, ..pictures::records(content, 3, directions) };
            let mut scene = pictures::in_environment(records)?;
            (scene.camera.width, scene.camera.height, scene.camera.samples) = (80, 60, 1);
            Ok(renderer.render(&scene)?.film.beauty)
        };
        let (swept, marched) = (render(Solver::Sweep)?, render(Solver::March)?);
        let rgb = |film: &[[f32; 4]]| film.iter().flat_map(|p| [p[0], p[1], p[2]]).collect::<Vec<_>>();
        record.hold("radiance", rgb(&swept), rgb(&marched).into_iter().map(f64::from));
        Ok(())
    })
}

/// One picture of all orders that has a truth.
pub struct Multiple {
    /// Name of the case.
    pub name: &'static str,
    /// The truth, in `data/reference/images`.
    pub file: &'static str,
    /// How it is rendered, in words.
    pub settings: String,
    /// What block means are held to.
    pub tolerance: &'static crate::Tolerance,
    scene: fn() -> Result<Scene, Failed>,
}

/// With the default sweeps: 40 cells, 48 directions, three bands.
fn all_orders(mut scene: Scene) -> Scene {
    scene.estimate.scattering = Some(ScatteringEstimate::Sweeps(Sweeps::default()));
    scene
}

/// Every picture of all orders.
pub fn multiple() -> [Multiple; 3] {
    [
        Multiple {
            name: "directional_light",
            file: "dir_multi.exr",
            settings: "opacity, sweeps of 40 cells and 48 directions".into(),
            tolerance: &tolerance::MULTIPLE_LIGHT,
            scene: || {
                let mut scene = pictures::scene()?;
                scene.lights = vec![pictures::lights()[0].2];
                Ok(all_orders(scene))
            },
        },
        Multiple {
            name: "environment",
            file: "env_multi.exr",
            settings: "records of 50 cells and 48 directions, sweeps of 40 and 48".into(),
            tolerance: &tolerance::MULTIPLE_SKY,
            scene: || Ok(all_orders(pictures::in_environment(Records::default())?)),
        },
        Multiple {
            name: "environment_hg",
            file: "env_hg0.5_multi.exr",
            settings: "records of 50 cells, 6 bands and 192 directions, sweeps of 40, 3 and 48".into(),
            tolerance: &tolerance::MULTIPLE_FORWARD,
            scene: || {
                let mut scene = pictures::in_environment(Records { bands: 6, directions: 192, ..Records::default() })?;
                scene.optics.phase = Phase::HenyeyGreenstein { g: 0.5 };
                Ok(all_orders(scene))
            },
        },
    ]
}

impl Multiple {
    /// Means over blocks of 8 × 8 pixels, RGB, as rendered and as they should be.
    fn blocks(&self, subject: &Subject) -> Result<(Vec<f32>, Vec<f64>), Failed> {
        let (found, expected) = (self.render(subject)?, pictures::truth(self.file)?);
        let means = |film: &[[f32; 4]]| -> Vec<f64> {
            let block = |b: usize, c: usize| {
                let (x, y) = (b % 20 * 8, b / 20 * 8);
                let pixels = (0..64).map(|i| f64::from(film[(y + i / 8) * 160 + x + i % 8][c]));
                pixels.sum::<f64>() / 64.0
            };
            (0..300).flat_map(|b| (0..3).map(move |c| (b, c))).map(|(b, c)| block(b, c)).collect()
        };
        Ok((means(&found).into_iter().map(|v| v as f32).collect(), means(&expected)))
    }

    fn render(&self, subject: &Subject) -> Result<Vec<[f32; 4]>, Failed> {
        let mut scene = (self.scene)()?;
        scene.camera.samples = 4;
        Ok(subject.renderer()?.render(&scene)?.film.beauty)
    }

    /// How far block means are from the truth's.
    ///
    /// # Errors
    /// A missing truth; a fault while rendering.
    pub fn measure(&self, subject: &Subject) -> Result<Difference, Failed> {
        let (found, expected) = self.blocks(subject)?;
        Ok(compare(found.into_iter().map(f64::from), expected))
    }
}
