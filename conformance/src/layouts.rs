//! Fields in halves and in bricks, which are the same densities in other memory.

use std::sync::Arc;

use airlight::device::{BrickLayout, FieldFormat, FieldKinds, FieldSpec, ResourceSpec};
use airlight::glam::{DAffine3, DVec3, IVec3, UVec3, Vec3};
use airlight::light::Light;
use airlight::media::{Brick, Grid, GridMedium, IndexBox, Medium, Phase, Storage, Tile};
use airlight::scene::{
    AllEstimate, EnvironmentEstimate, Estimate, LightsEstimate, Local, Opacity, Path, Precision, Quality, Records,
    ScatteringEstimate, Scene, Solver, Sweeps,
};
use libtest_mimic::Failed;

use crate::bench::Bench;
use crate::fixtures::{Map, camera, chromatic, cloud, noise, room, sky};
use crate::{Axis, Case, Record, Subject, check, tolerance};

/// Voxels of the sparse cloud, whose bricks begin elsewhere than its box.
const BOX: IndexBox = IndexBox { min: IVec3::new(-5, 3, -1), dims: UVec3::new(90, 40, 77) };

pub(crate) fn cases() -> Vec<Case> {
    vec![
        Case::new(
            "layouts::pictures",
            "Pictures of a sparse cloud, by all stages that look up densities but photons, have the same bits whether it is held in \
             32-bit floats or in halves that are as exact, dense or in bricks; to a rounding where compilers may round a \
             product and a sum as one. What a device does not hold it refuses.",
            pictures,
        )
        .within(&tolerance::CONTRACTED)
        .permutes(&scenes())
        .varies(&holdings()),
        Case::new(
            "layouts::writes",
            "An index that names no brick, parts of bricks, and kinds of fields that a device does not hold are refused.",
            writes,
        ),
    ]
}

/// How the cloud is held.
#[derive(Clone, Copy, Debug)]
struct Holding {
    bricks: bool,
    density: Precision,
}

fn holdings() -> Axis<Holding> {
    Axis::new(
        "held",
        [
            ("dense", Holding { bricks: false, density: Precision::F32 }),
            ("in halves in bricks", Holding { bricks: true, density: Precision::F16 }),
            ("in halves", Holding { bricks: false, density: Precision::F16 }),
            ("in bricks", Holding { bricks: true, density: Precision::F32 }),
        ],
    )
}

/// Values that halves hold exactly.
fn values(seed: u64) -> Box<[f32; 512]> {
    let mut values = Box::new([0.0; 512]);
    values.iter_mut().zip(noise(seed, 512)).for_each(|(v, n)| *v = ((n * 3.0 - 1.0).max(0.0) * 512.0).floor() / 512.0);
    values
}

/// A few bricks and tiles in an empty box, as they are or laid out.
fn grid(bricks: bool, seed: u64) -> Result<Grid, Failed> {
    let origins = [[0, 8, 8], [8, 8, 8], [16, 16, 24], [48, 24, 32], [56, 24, 40], [80, 40, 72], [-8, 0, 0]];
    let stored = (seed..).zip(origins).map(|(seed, at)| Brick { origin: IVec3::from(at), values: values(seed) });
    let tile = |at: [i32; 3], side, value| Tile { origin: IVec3::from(at), side, value };
    let tiles = vec![tile([24, 3, 16], 17, 0.25), tile([32, 8, 16], 8, 0.0)];
    let storage = Storage::Sparse { background: 0.0, bricks: stored.collect(), tiles };
    // As wide as other clouds, so that their camera sees it.
    let lattice = Map::Sheared.lattice(BOX.dims);
    let to_box = DAffine3::from_translation(-BOX.min.as_dvec3());
    let grid = Grid::new(BOX, lattice.index_to_world() * to_box, storage)?;
    if bricks {
        return Ok(grid);
    }
    let mut dense = vec![0.0; BOX.volume() as usize];
    let slice = (BOX.dims.x * BOX.dims.y) as usize;
    for (k, out) in (0..).zip(dense.chunks_exact_mut(slice)) {
        grid.write_slice(BOX, BOX.min.z + k, out);
    }
    Ok(Grid::new(BOX, grid.index_to_world(), Storage::Dense(dense))?)
}

/// Stages of pictures with all grids.
const GRIDS: &[&str] = &["reduce", "project", "propagate", "coarsen", "illuminate", "march"];

/// A picture, and stages that it takes.
#[derive(Clone)]
struct Shown {
    scene: Scene,
    glows: bool,
    stages: &'static [&'static str],
}

fn scenes() -> Axis<Shown> {
    let mut of = cloud(Map::Sheared, UVec3::ONE, chromatic(Phase::HenyeyGreenstein { g: 0.4 }));
    (of.camera, of.environment) = (camera(12, 9, 1), Some(sky()));
    of.lights = vec![
        Light::directional(DVec3::new(0.4, 0.9, 0.2), Vec3::new(2.0, 1.5, 1.0)).expect("a light"),
        Light::point(DVec3::new(0.6, 0.9, -0.4), Vec3::ONE).expect("a light"),
    ];
    of.optics.emission = Vec3::new(0.3, 0.2, 0.1);
    let grids = |cells| {
        let estimate = Estimate {
            environment: Some(EnvironmentEstimate::Records(Records {
                cells,
                solver: Solver::March,
                ..Records::default()
            })),
            lights: Some(LightsEstimate::Opacity(Opacity { cells, ..Opacity::default() })),
            scattering: Some(ScatteringEstimate::Sweeps(Sweeps { cells, ..Sweeps::default() })),
            all: None,
        };
        Scene { estimate, ..of.clone() }
    };
    let mut walls = of.clone();
    walls.optics.emission = Vec3::ZERO;
    (walls.surfaces, walls.environment) = (Some(Arc::new(room())), None);
    let local = Local { ambient: 0.6, diffuse: 0.8, specular: 0.3, shininess: 5.0 };
    walls.estimate = Estimate { lights: Some(LightsEstimate::Local(local)), ..Estimate::none() };
    let mut paths = of.clone();
    let path = Path { samples: 2, ..Path::default() };
    paths.estimate = Estimate { all: Some(AllEstimate::Path(path)), ..Estimate::none() };
    let shown = |scene, glows, stages| Shown { scene, glows, stages };
    Axis::new(
        "scene",
        [
            ("walls", shown(walls, false, &["reduce", "shade", "march"][..])),
            // Of two sizes, whose walls cut voxels elsewhere: sums round, and drivers that put them in another order show.
            ("grids", shown(grids(5), true, GRIDS)),
            ("finer grids", shown(grids(6), true, GRIDS)),
            ("paths", shown(paths, true, &["path"])),
        ],
    )
}

fn pictures(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let kinds: FieldKinds = subject.device()?.field_kinds();
    let mut first = true;
    record.each(&scenes(), |record, shown| {
        let whole = std::mem::take(&mut first);
        let mut dense = 0;
        record.each(&holdings(), |record, &Holding { bricks, density }| {
            // Kernels are built for each way: for all of them once, and elsewhere for both at once.
            if !whole && bricks != (density == Precision::F16) {
                return Ok(());
            }
            let glow = if shown.glows { Some(Arc::new(grid(bricks, 40)?)) } else { None };
            let medium = GridMedium::new(Arc::new(grid(bricks, 7)?), glow)?;
            check!(medium.density_bricks().is_some() == bricks, "the cloud is held otherwise than it should be");
            let quality = Quality { density, ..shown.scene.quality };
            let scene = Scene { medium: Arc::new(medium), quality, ..shown.scene.clone() };
            let rendered = subject.renderer()?.render(&scene);
            if density == Precision::F16 && !kinds.halves {
                check!(rendered.is_err(), "the device holds no halves, and does not say so");
                return Ok(());
            }
            let rendered = rendered?;
            let ran = rendered.report.ran();
            for stage in shown.stages {
                check!(ran.contains(stage), "{stage} is not tried by {ran:?}");
            }
            if bricks && kinds.bricks {
                check!(rendered.report.bytes < dense, "bricks take {} bytes, and {dense} do", rendered.report.bytes);
            } else {
                dense = rendered.report.bytes.max(dense);
            }
            let film = rendered.film;
            check!(film.beauty.iter().any(|p| p[3] > 0.02), "the cloud is not seen");
            record.within(tolerance::CONTRACTED.filtered(record.info()), |record| {
                record.steady_but_contracted("beauty", film.beauty.as_flattened());
                record.steady_but_contracted("transmittance", film.transmittance.as_flattened());
            });
            Ok(())
        })
    })
}

fn writes(subject: &Subject, _: &mut Record) -> Result<(), Failed> {
    let mut bench = Bench::new(subject)?;
    let kinds = bench.device.field_kinds();
    let dims = [17, 8, 9];
    let layout = BrickLayout { bricks: 3, constants: 1 };
    for (format, held) in [(FieldFormat::Scalar, true), (FieldFormat::half(2.0), kinds.halves)] {
        let plain = FieldSpec::dense(dims, 1, format);
        for (spec, held) in [(plain, held), (plain.in_bricks(layout), held && kinds.bricks)] {
            let id = bench.id();
            let made = bench.device.create(id, &ResourceSpec::Field(spec));
            check!(made.is_ok() == held, "{spec:?}: {made:?}");
            if !held || spec == plain {
                continue;
            }
            let brick = BrickLayout::brick_bytes(format) as usize;
            let index = |words: [u32; 6]| bytemuck::cast_slice(&words).to_vec();
            for (offset, data, fits) in [
                (0, index([0, 1, 2, 2, 1, 0]), true),
                (24, vec![0; 3 * brick], true),
                (24 + brick as u64, vec![0; 2 * brick], true),
                (0, index([0, 1, 3, 0, 0, 0]), false),
                (0, index([u32::MAX; 6]), false),
                (28, vec![0; brick], false),
                (24, vec![0; brick - 4], false),
                (20, vec![0; 8], false),
                (24 + 3 * brick as u64, vec![0; brick], false),
            ] {
                let done = bench.device.write(id, offset, &data);
                check!(done.is_ok() == fits, "{} bytes at {offset} of {spec:?}: {done:?}", data.len());
            }
        }
    }
    Ok(())
}
