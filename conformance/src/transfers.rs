//! Precomputed transfer: the white furnace, balance of energy, pictures that an independent path tracer made, and what
//! compression, solvers and views must agree on.

use std::sync::Arc;

use airlight::Renderer;
use airlight::exec::Hooks;
use airlight::glam::{DVec3, UVec3, Vec3};
use airlight::light::{Light, Prefilter};
use airlight::media::{Grid, GridMedium, Optics, Phase};
use airlight::scene::{
    AllEstimate, Deposit, Estimate, LightBasis, Orders, Precompute, Scene, TransferEstimate, TransferSolver,
    TransferSource, ViewDependence,
};
use airlight::stage::Photons;
use airlight::transfer::{Channel, Transfer};
use libtest_mimic::Failed;

use crate::fixtures::{DIMS, Map, camera, chromatic, cloud, grey, sky};
use crate::scattering::{albedos, depths, furnace_phases, hold_white, scattering, uniform};
use crate::{Case, Record, Subject, check, compare, pictures, tolerance};

pub(crate) fn cases() -> Vec<Case> {
    vec![
        Case::new(
            "transfer::white_furnace",
            "A transfer without absorption sends the radiance of a uniform environment on.",
            furnace,
        )
        .within(&tolerance::FURNACE)
        .permutes(&furnace_phases())
        .permutes(&depths()),
        Case::new(
            "transfer::energy_balance",
            "What a medium absorbs, by its matrices, is what enters a picture's rays in a uniform environment less what leaves \
             them, over many directions.",
            balance,
        )
        .within(&tolerance::FURNACE)
        .permutes(&albedos()),
        Case::new(
            "transfer::right_side",
            "Light from one side lights that side of a thick medium, and goes on through a thin one whose phase function leans \
             forward.",
            right_side,
        )
        .within(&tolerance::EXACT),
        Case::new(
            "transfer::direct",
            "Light that comes in once, on four bands of spherical harmonics, gives env_single_sh4.exr.",
            |subject, record| {
                let options = direct(LightBasis::Harmonics { bands: 4 });
                hold_blocks(subject, record, "env_single_sh4.exr", options)
            },
        )
        .within(&tolerance::TRANSFER_DIRECT),
        Case::new(
            "transfer::environment",
            "All orders, on six bands of spherical harmonics, give env_multi.exr, over blocks of 8 × 8 pixels; with direct light \
             counted twice they do not.",
            environment,
        )
        .within(&tolerance::TRANSFER_SKY),
        Case::new(
            "transfer::solvers",
            "Photons give the pictures that ordinates give.",
            solvers,
        )
        .within(&tolerance::TRANSFER_PHOTONS),
        Case::new(
            "transfer::compressed",
            "A few clusters and components give the picture of all matrices, in colour and with a phase function that leans forward.",
            compressed,
        )
        .within(&tolerance::TRANSFER_COMPRESSED),
        Case::new(
            "transfer::views",
            "Radiance toward the eye from each cell is that along each ray, and nearly that toward the eye from each cluster.",
            views,
        )
        .within(&tolerance::TRANSFER_VIEWS),
        Case::new(
            "transfer::relit",
            "Another light, another eye and another frame run the stages that depend on them and carry no light.",
            relit,
        )
        .within(&tolerance::EXACT),
        Case::new("transfer::stale", "A transfer of another medium is refused, and what changed is said.", stale)
            .within(&tolerance::EXACT),
    ]
}

const HARMONICS: LightBasis = LightBasis::Harmonics { bands: 6 };
const FEW: LightBasis = LightBasis::Discrete { functions: 42 };
const FEWEST: LightBasis = LightBasis::Discrete { functions: 12 };

/// All orders by ordinates, of which nothing is compressed.
fn ordinates(cells: u32, basis: LightBasis, bands: u32) -> Precompute {
    Precompute {
        cells,
        basis,
        bands,
        solver: TransferSolver::Ordinates { directions: None },
        clusters: None,
        components: 0,
        ..Precompute::default()
    }
}

fn direct(basis: LightBasis) -> Precompute {
    Precompute { orders: Orders::Count(1), ..ordinates(60, basis, 1) }
}

fn with(scene: Scene, source: TransferSource, view: ViewDependence) -> Scene {
    let transfer = TransferEstimate { source, view, prefilter: Prefilter::Energy };
    Scene { estimate: Estimate { all: Some(AllEstimate::Transfer(transfer)), ..Estimate::none() }, ..scene }
}

fn making(scene: Scene, options: Precompute) -> Scene {
    with(scene, TransferSource::Making(options), ViewDependence::Cell)
}

/// A small picture whose transfer is made by photons.
pub(crate) fn made_of_photons() -> Scene {
    let mut scene = cloud(Map::Plain, DIMS, grey(Phase::Isotropic));
    scene.environment = Some(sky());
    let solver = TransferSolver::Photons { count: 1.0, deposit: Deposit::Track, radius: Photons::RADIUS };
    making(scene, Precompute { solver, ..ordinates(4, LightBasis::Harmonics { bands: 1 }, 1) })
}

fn made(renderer: &mut Renderer, scene: &Scene, options: Precompute) -> Result<Arc<Transfer>, Failed> {
    Ok(Arc::new(renderer.precompute(scene, &options, &mut Hooks::default())?.transfer))
}

fn rgb(film: &[[f32; 4]]) -> Vec<f32> {
    film.iter().flat_map(|p| [p[0], p[1], p[2]]).collect()
}

fn furnace(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    record.each(&furnace_phases(), |record, phase| {
        record.each(&depths(), |record, &extinction| {
            let optics = Optics { phase: phase.clone(), ..Optics::grey(extinction, 1.0) };
            let scene = scattering(optics, Some(uniform(1.0)?));
            hold_white(subject, record, &making(scene, ordinates(17, FEWEST, 3)))
        })
    })
}

/// Of a uniform environment of radiance 1, rays of the direction d bring in their area, and take out all but what the film
/// lacks behind: alpha less radiance. Over all d the difference is ∫ σa · 4π · (mean radiance) dV.
fn balance(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    record.each(&albedos(), |record, &albedo| {
        let extinction = 3.0;
        let mut renderer = subject.renderer()?;
        let mut scene = scattering(Optics::grey(extinction, albedo), Some(uniform(1.0)?));
        // Cells of half a voxel: both sides differ by what interpolation between cells costs, which falls with their size.
        let transfer = made(&mut renderer, &scene, ordinates(34, FEWEST, 1))?;
        let absorbed = absorbed(&scene, &transfer) * f64::from(extinction * (1.0 - albedo));
        scene = with(scene, TransferSource::Made(transfer), ViewDependence::Cell);
        scene.quality.step = 0.25;
        let center = scene.medium.lattice().center();
        let (far, side) = (200.0, 40);
        let mut lacking = 0.0;
        let directions = airlight::basis::healpix::directions(1);
        for d in &directions {
            // As good as parallel. The picture is 2 m high.
            let fov = 2.0 * (1.0f64 / far).atan().to_degrees();
            let up = if d.y.abs() < 0.5 { DVec3::Y } else { DVec3::Z };
            scene.camera =
                airlight::scene::Camera { origin: center + far * *d, target: center, up, fov, ..camera(side, side, 1) };
            let film = renderer.render(&scene)?.film;
            let pixel = (2.0 / f64::from(side)).powi(2);
            lacking += film.beauty.iter().map(|p| f64::from(p[3] - p[0])).sum::<f64>() * pixel;
        }
        lacking /= directions.len() as f64;
        check!(absorbed > 0.01, "nothing is absorbed");
        record.hold("absorbed power / 4π", [absorbed as f32], [lacking]);
        Ok(())
    })
}

/// ∫ ρ · (mean incident radiance) dV in a uniform environment of radiance 1.
fn absorbed(scene: &Scene, transfer: &Transfer) -> f64 {
    let (shape, channel) = (transfer.shape(), &transfer.channels()[0]);
    let functions = shape.basis.count() as usize;
    // Discrete functions sum to 1; ∫ L Y_0 dω · Y_0 is the mean.
    let y0 = 0.5 / std::f64::consts::PI.sqrt();
    let mut mean = vec![0.0; shape.cells.iter().map(|&n| n as usize).product()];
    for (&cell, &cluster) in shape.rows.iter().zip(&channel.clusters) {
        let matrix = &channel.matrices[cluster as usize * functions..][..functions];
        mean[cell as usize] = matrix.iter().map(|&m| f64::from(m)).sum::<f64>() * y0;
    }
    let lattice = scene.medium.lattice();
    let dims = lattice.dims();
    let volume = lattice.index_to_world().matrix3.determinant().abs();
    let mut density = Vec::new();
    for k in 0..dims.z {
        let mut slice = vec![0.0; (dims.x * dims.y) as usize];
        scene.medium.density_slice(k, &mut slice);
        density.extend(slice.into_iter().map(f64::from));
    }
    let density = |p: DVec3| trilinear(&density, dims, p);
    let cells = UVec3::from(shape.cells);
    let per_voxel = cells.as_dvec3() / dims.as_dvec3();
    let mean = |p: DVec3| trilinear(&mean, cells, (p + 0.5) * per_voxel - 0.5);
    // The product of two trilinear functions, at four points along each side of a voxel.
    let points = 4 * dims;
    let mut sum = 0.0;
    for at in 0..points.element_product() {
        let point = UVec3::new(at % points.x, at / points.x % points.y, at / points.x / points.y);
        let p = (point.as_dvec3() + 0.5) / 4.0 - 0.5;
        sum += density(p) * mean(p);
    }
    sum * volume / 64.0
}

/// Between samples that lie at whole numbers, clamped at the edge.
fn trilinear(values: &[f64], dims: UVec3, p: DVec3) -> f64 {
    let p = p.clamp(DVec3::ZERO, dims.as_dvec3() - 1.0);
    let (base, f) = (p.floor(), p.fract());
    let corner = |n: u32| {
        let at = (base.as_uvec3() + UVec3::new(n & 1, n >> 1 & 1, n >> 2)).min(dims - 1);
        let weight = |a: usize| if n >> a & 1 == 1 { f[a] } else { 1.0 - f[a] };
        weight(0) * weight(1) * weight(2) * values[((at.z * dims.y + at.y) * dims.x + at.x) as usize]
    };
    (0..8).map(corner).sum()
}

fn right_side(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let center = DVec3::new(0.1, -0.05, 0.2);
    let mut renderer = subject.renderer()?;
    let mut seen = |optics: Optics, toward: DVec3, eye: DVec3| -> Result<f64, Failed> {
        let mut scene = cloud(Map::Sheared, UVec3::new(14, 11, 17), optics);
        scene.lights = vec![Light::directional(toward, Vec3::ONE)?];
        scene.camera =
            airlight::scene::Camera { origin: center + 3.0 * eye.normalize(), target: center, ..camera(20, 15, 1) };
        let film = renderer.render(&making(scene, ordinates(10, FEW, 3)))?.film;
        Ok(film.beauty.iter().map(|p| f64::from(p[0])).sum())
    };
    let (sun, eye) = (DVec3::new(0.9, 0.3, 0.2), DVec3::new(0.8, 0.2, 0.5));
    let thick = Optics::grey(40.0, 0.9);
    let (lit, dark) = (seen(thick.clone(), sun, eye)?, seen(thick, sun, -eye)?);
    check!(dark > 0.0, "a thick medium is black from the far side");
    record.score("a thick medium", "the far side over the lit one", dark / lit, 0.5);
    let thin = |g: f64| Optics { phase: Phase::HenyeyGreenstein { g }, ..Optics::grey(0.3, 0.9) };
    // Through the medium toward the light, and with the light behind the eye.
    let (toward, away) = (seen(thin(0.5), sun, -eye)?, seen(thin(0.5), sun, eye)?);
    record.score("a thin medium, g = 0.5", "away from the light over toward it", away / toward, 0.3);
    let (toward, away) = (seen(thin(-0.5), sun, -eye)?, seen(thin(-0.5), sun, eye)?);
    record.score("a thin medium, g = -0.5", "toward the light over away from it", toward / away, 0.3);
    Ok(())
}

/// Block means of the reference scene under `options` and of its truth, RGB.
fn blocks(renderer: &mut Renderer, scene: &Scene, file: &str) -> Result<(Vec<f32>, Vec<f64>), Failed> {
    let film = renderer.render(scene)?.film;
    let means = |film: &[[f32; 4]]| airlight::metric::block_means(film, 160, 8);
    let truth = means(&pictures::truth(file)?);
    Ok((rgb(&means(&film.beauty)), rgb(&truth).into_iter().map(f64::from).collect()))
}

/// The reference scene in its environment.
fn reference() -> Result<Scene, Failed> {
    let mut scene = pictures::in_environment(airlight::scene::Records::default())?;
    (scene.camera.samples, scene.quality.step) = (4, 1.0);
    Ok(scene)
}

fn hold_blocks(subject: &Subject, record: &mut Record, file: &str, options: Precompute) -> Result<(), Failed> {
    let (found, expected) = blocks(&mut subject.renderer()?, &making(reference()?, options), file)?;
    record.hold("blocks", found, expected);
    Ok(())
}

fn environment(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let (scene, mut renderer) = (reference()?, subject.renderer()?);
    let options = ordinates(24, HARMONICS, 1);
    let whole = made(&mut renderer, &scene, options)?;
    let once = made(&mut renderer, &scene, Precompute { orders: Orders::Count(1), ..options })?;
    let lit = |transfer| with(scene.clone(), TransferSource::Made(transfer), ViewDependence::Cell);
    let (found, expected) = blocks(&mut renderer, &lit(whole.clone()), "env_multi.exr")?;
    record.hold("blocks", found, expected);
    let twice: Vec<Channel> = whole
        .channels()
        .iter()
        .zip(once.channels())
        .map(|(whole, once)| {
            let matrices = whole.matrices.iter().zip(&once.matrices).map(|(a, b)| a + b).collect();
            Channel { matrices, ..whole.clone() }
        })
        .collect();
    let twice = Arc::new(Transfer::new(whole.shape().clone(), *whole.origin(), twice)?);
    let (found, expected) = blocks(&mut renderer, &lit(twice), "env_multi.exr")?;
    let off = compare(found.into_iter().map(f64::from), expected).relative_l2;
    check!(off > 10.0 * tolerance::TRANSFER_SKY.relative_l2, "direct light that counts twice is off by {off} only");
    Ok(())
}

fn solvers(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let optics = Optics { phase: Phase::HenyeyGreenstein { g: 0.4 }, ..grey(Phase::Isotropic) };
    let mut scene = scattering(optics, Some(sky()));
    scene.optics.extinction = Vec3::splat(4.0);
    let mut renderer = subject.renderer()?;
    let options = ordinates(17, LightBasis::Harmonics { bands: 3 }, 3);
    let expected = renderer.render(&making(scene.clone(), options))?.film.beauty;
    // Along tracks there is the least noise; that the other deposits agree is tried with the stage.
    let solver = TransferSolver::Photons { count: 60.0, deposit: Deposit::Track, radius: Photons::RADIUS };
    let found = renderer.render(&making(scene, Precompute { solver, ..options }))?.film.beauty;
    record.hold("radiance", rgb(&found), rgb(&expected).into_iter().map(f64::from));
    Ok(())
}

fn compressed(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = scattering(chromatic(Phase::HenyeyGreenstein { g: 0.5 }), Some(sky()));
    scene.optics.extinction *= 3.0;
    let mut renderer = subject.renderer()?;
    let options = ordinates(12, FEWEST, 3);
    let expected = renderer.render(&making(scene.clone(), options))?.film.beauty;
    let few = Precompute { clusters: Some(48), components: 4, ..options };
    let transfer = made(&mut renderer, &scene, few)?;
    check!(transfer.shape().rows.len() > 500, "{} rows: the case tries nothing", transfer.shape().rows.len());
    for channel in transfer.channels() {
        check!(channel.loss > 1e-4, "nothing is lost: the case tries nothing");
    }
    let lit = with(scene, TransferSource::Made(transfer), ViewDependence::Cell);
    let found = renderer.render(&lit)?.film.beauty;
    record.hold("radiance", rgb(&found), rgb(&expected).into_iter().map(f64::from));
    Ok(())
}

fn views(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = scattering(chromatic(Phase::HenyeyGreenstein { g: 0.5 }), Some(sky()));
    scene.optics.extinction *= 3.0;
    let mut renderer = subject.renderer()?;
    let options = Precompute { clusters: Some(48), components: 4, ..ordinates(12, FEWEST, 3) };
    let transfer = made(&mut renderer, &scene, options)?;
    let mut seen = |view| -> Result<Vec<f32>, Failed> {
        let lit = with(scene.clone(), TransferSource::Made(transfer.clone()), view);
        Ok(rgb(&renderer.render(&lit)?.film.beauty))
    };
    let rays: Vec<f64> = seen(ViewDependence::Sample)?.into_iter().map(f64::from).collect();
    record.hold("toward the eye from each cell", seen(ViewDependence::Cell)?, rays.clone());
    let clusters = seen(ViewDependence::Cluster)?;
    let off = compare(clusters.into_iter().map(f64::from), rays).relative_l2;
    record.score("toward the eye from each cluster", "relative L2", off, 0.1);
    check!(off > 0.0, "clusters see what rays see: the case tries nothing");
    Ok(())
}

fn relit(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = cloud(Map::Plain, DIMS, grey(Phase::HenyeyGreenstein { g: 0.3 }));
    scene.environment = Some(sky());
    let options = Precompute { clusters: Some(8), components: 2, ..ordinates(5, FEWEST, 2) };
    let mut scene = making(scene, options);
    let mut renderer = subject.renderer()?;
    let mut before = renderer.render(&scene)?.film;
    let mut step = |scene: &Scene, what: &str, expected: &[&str]| -> Result<(), Failed> {
        let rendered = renderer.render(scene)?;
        let ran = rendered.report.ran();
        check!(ran == expected, "{what}: ran {ran:?}, not {expected:?}");
        check!((rendered.film == before) == expected.is_empty(), "{what}: the film and what ran do not agree");
        let fresh = subject.renderer()?.render(scene)?.film;
        record.same(what, &rgb(&rendered.film.beauty), &rgb(&fresh.beauty));
        before = rendered.film;
        Ok(())
    };
    step(&scene, "nothing changed", &[])?;
    if let Some(sky) = &mut scene.environment {
        sky.rotation = 40.0;
    }
    let light = ["evaluate", "reconstruct", "march"];
    step(&scene, "the environment turned", &light)?;
    scene.lights = vec![Light::directional(DVec3::new(0.3, 0.8, -0.2), Vec3::new(2.0, 1.0, 0.5))?];
    step(&scene, "a sun rose", &light)?;
    scene.camera.origin.x += 0.3;
    step(&scene, "the eye moved", &["reconstruct", "march"])?;
    scene.environment = None;
    step(&scene, "the sky went out", &light)
}

fn stale(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut scene = cloud(Map::Plain, DIMS, grey(Phase::Isotropic));
    scene.environment = Some(sky());
    let mut renderer = subject.renderer()?;
    let transfer = made(&mut renderer, &scene, ordinates(4, FEWEST, 1))?;
    let lit = with(scene, TransferSource::Made(transfer), ViewDependence::Cell);
    renderer.render(&lit)?;
    let mut refused = |scene: Scene, what: &'static str| -> Result<(), Failed> {
        let error = renderer.render(&scene).map(|_| ()).err().map(|e| e.to_string()).unwrap_or_default();
        let said = error.contains(&format!("made of another {what}"));
        record.score(what, "refusals that do not say so", f64::from(!said), 0.0);
        Ok(())
    };
    let mut other = lit.clone();
    other.optics.albedo.y *= 0.9;
    refused(other, "extinction, albedo")?;
    let medium = |density: fn(usize) -> f32, map: Map| -> Result<Scene, Failed> {
        let values = (0..DIMS.element_product() as usize).map(density).collect();
        let grid = Grid::dense(DIMS, map.lattice(DIMS).index_to_world(), values)?;
        Ok(Scene { medium: Arc::new(GridMedium::new(Arc::new(grid), None)?), ..lit.clone() })
    };
    refused(medium(|at| (at % 7) as f32, Map::Plain)?, "density")?;
    refused(medium(|_| 1.0, Map::Rotated)?, "lattice")?;
    renderer.render(&lit)?;
    let solver = TransferSolver::Photons { count: 1.0, deposit: Deposit::Absorption, radius: Photons::RADIUS };
    let mut white = making(lit, Precompute { solver, ..ordinates(4, FEWEST, 1) });
    white.optics.albedo = Vec3::ONE;
    let error = renderer.render(&white).map(|_| ()).err().map(|e| e.to_string()).unwrap_or_default();
    check!(error.contains("an albedo of 1 absorbs none"), "absorption where there is none says: {error:?}");
    Ok(())
}
