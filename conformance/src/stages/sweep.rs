//! `sweep` against its twin.

use airlight::basis::healpix;
use airlight::device::Usage;
use airlight::glam::DVec3;
use airlight::reference::{self, SweepInputs};
use airlight::stage::{Coarsen, Stage, Sweep, SweepDirection, SweepParams};
use bytemuck::Zeroable;
use libtest_mimic::Failed;

use super::case;
use crate::bench::{Bench, cuts};
use crate::fixtures::{DIMS, Map, noise};
use crate::{Case, Record, Subject, check, tolerance};

/// One set of parameters.
#[derive(Clone)]
struct Set {
    name: String,
    map: Map,
    cells: [u32; 3],
    directions: Vec<DVec3>,
    /// Directions of a batch.
    batch: u32,
    channels: u32,
    grey: bool,
    emits: bool,
    /// Coefficients of what is scattered.
    sources: u32,
    coefficients: u32,
    weight_channels: u32,
    planar: bool,
    boundary: f32,
    /// Whether surfaces stand between cells.
    surfaces: bool,
    /// The largest extinction, 1/m.
    thick: f32,
}

pub(crate) fn cases() -> Vec<Case> {
    let set = |name: &str| Set {
        name: name.to_owned(),
        map: Map::Plain,
        cells: [6, 4, 8],
        directions: healpix::directions(2),
        batch: 48,
        channels: 1,
        grey: true,
        emits: false,
        sources: 0,
        coefficients: 4,
        weight_channels: 1,
        planar: true,
        boundary: 1.0,
        surfaces: false,
        thick: 12.0,
    };
    let scattering = |name: &str| Set { sources: 4, boundary: 0.0, ..set(name) };
    let colored = |name: &str| Set { channels: 3, ..scattering(name) };
    let axes = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z];
    // As far along two axes, and along all three.
    let diagonals = [DVec3::new(1.0, 1.0, 0.0), DVec3::new(-1.0, 0.0, 1.0), DVec3::new(1.0, -1.0, -1.0)];
    let special = axes.into_iter().chain(diagonals.map(DVec3::normalize)).collect();
    let mut sets = vec![
        set("transmittance"),
        Set { channels: 3, grey: false, ..set("chromatic_transmittance") },
        Set { weight_channels: 3, planar: false, coefficients: 9, ..set("records") },
        Set { channels: 3, grey: false, planar: false, ..set("colored_records") },
        Set { batch: 5, ..set("batches") },
        Set { batch: 1, planar: false, ..set("one_at_a_time") },
        Set { directions: special, batch: 4, ..set("axes_and_diagonals") },
        Set { emits: true, boundary: 0.0, channels: 3, ..set("emission") },
        scattering("scattering"),
        Set { sources: 1, coefficients: 1, ..scattering("isotropic_scattering") },
        colored("colored_scattering"),
        Set { grey: false, emits: true, boundary: 0.5, batch: 7, ..colored("everything") },
        Set { surfaces: true, ..set("surfaces") },
        Set { surfaces: true, grey: false, emits: true, batch: 7, ..colored("everything_between_surfaces") },
        Set { thick: 4000.0, ..colored("thick") },
        Set { thick: 1e-3, ..colored("thin") },
        Set { thick: 0.0, emits: true, ..colored("vacuum") },
        Set { cells: [1, 1, 7], ..colored("a_row_of_cells") },
        Set { cells: [19, 1, 3], ..colored("a_sheet_of_cells") },
        Set { cells: [1; 3], ..colored("one_cell") },
        Set { cells: [33, 18, 17], directions: healpix::directions(1), batch: 12, ..colored("many_cells") },
    ];
    for map in [Map::Rotated, Map::Sheared, Map::Mirrored] {
        sets.push(Set { map, grey: false, ..colored(&format!("{map:?}").to_lowercase()) });
    }
    let made = |set: Set| {
        let name = set.name.clone();
        case("sweep", &name, "moments", &tolerance::STAGE, move |subject, record| one(subject, record, &set))
    };
    sets.into_iter().map(made).collect()
}

fn one(subject: &Subject, record: &mut Record, set: &Set) -> Result<(), Failed> {
    let lattice = set.map.lattice(DIMS);
    let [x, y, z] = set.cells;
    let cells = (x * y * z) as usize;
    let ways: Vec<_> = set.directions.iter().map(|&d| SweepDirection::new(d, &lattice, set.cells)).collect();
    let count = ways.len() as u32;
    let mut params = SweepParams::zeroed();
    params.cells = [x, y, z, x.max(y).max(z)];
    (params.directions, params.batch) = (count, set.batch.min(count));
    params.plane = (y * z).max(x * z).max(x * y);
    (params.channels, params.grey, params.emits) = (set.channels, set.grey.into(), set.emits.into());
    (params.source_coefficients, params.coefficients) = (set.sources, set.coefficients);
    (params.weight_channels, params.planar, params.boundary) = (set.weight_channels, set.planar.into(), set.boundary);
    let signed = |seed: u64, n: u32| -> Vec<f32> { noise(seed, n as usize).iter().map(|v| v - 0.3).collect() };
    // Extinction with empty parts, albedo, emission.
    let rough = noise(71, Coarsen::PLANES as usize * cells);
    let optics: Vec<f32> = rough
        .iter()
        .enumerate()
        .map(|(n, v)| if n < 3 * cells { set.thick * (v - 0.4).max(0.0) } else { *v })
        .collect();
    let sources = signed(72, set.sources * set.channels * cells as u32);
    let source_weights = signed(73, count * set.sources);
    let weights: Vec<f32> =
        signed(74, count * set.coefficients * set.weight_channels).iter().map(|v| v / count as f32).collect();
    // A third of all ways.
    let obstructed: Vec<u32> = noise(75, 27 * cells)
        .chunks_exact(27)
        .map(|v| (0..27).map(|bit| u32::from(v[bit] < 0.33) << bit).sum())
        .collect();
    let mut bench = Bench::new(subject)?;
    let room = cells * (params.batch * set.channels) as usize;
    let moments = cells * (set.coefficients * params.moment_channels()) as usize;
    let stage = Sweep {
        params,
        optics: bench.buf(&optics)?,
        directions: bench.buf(&ways)?,
        sources: (set.sources > 0).then(|| bench.buf(&sources)).transpose()?,
        source_weights: (set.sources > 0).then(|| bench.buf(&source_weights)).transpose()?,
        weights: bench.buf(&weights)?,
        obstructed: set.surfaces.then(|| bench.buf(&obstructed)).transpose()?,
        radiance: bench.room(room, Usage::Work)?,
        moments: bench.room(moments, Usage::Output)?,
    };
    let out = stage.moments;
    let inputs = SweepInputs {
        optics: &optics,
        directions: &ways,
        sources: &sources,
        source_weights: &source_weights,
        weights: &weights,
        obstructed: if set.surfaces { &obstructed } else { &[] },
    };
    let expected = reference::sweep(&params, &inputs);
    let lit = expected.iter().filter(|v| **v != 0.0).count();
    check!(lit * 2 > moments, "only {lit} moments of {moments}: the case tries nothing");
    let stage = Stage::Sweep(stage);
    record.each(&cuts(), |record, &cut| {
        bench.run(record, &stage, cut)?;
        record.hold("moments", bench.read(out)?, expected.iter().copied());
        Ok(())
    })
}
