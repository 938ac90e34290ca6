//! `coarsen` against its twin.

use airlight::device::Usage;
use airlight::reference::{self, CoarsenInputs};
use airlight::stage::{Coarsen, CoarsenParams, Stage};
use libtest_mimic::Failed;

use super::case;
use crate::bench::{Bench, cuts};
use crate::fixtures::{DIMS, density, noise};
use crate::{Case, Record, Subject, tolerance};

/// One set of parameters.
#[derive(Clone, Copy)]
struct Set {
    name: &'static str,
    cells: [u32; 3],
    /// Share of scattered light that goes on.
    forward: f32,
    own_scattering: bool,
    own_emission: bool,
    colored_emission: bool,
}

pub(crate) fn cases() -> Vec<Case> {
    let plain = Set {
        name: "plain",
        cells: [3, 2, 4],
        forward: 0.0,
        own_scattering: false,
        own_emission: false,
        colored_emission: false,
    };
    let sets = [
        plain,
        Set { name: "similar", forward: 0.6, ..plain },
        Set { name: "as_many_cells_as_voxels", cells: DIMS.to_array(), ..plain },
        Set { name: "more_cells_than_voxels", cells: [16, 9, 11], ..plain },
        Set { name: "one_cell", cells: [1; 3], forward: 0.3, ..plain },
        Set { name: "own_scattering", own_scattering: true, ..plain },
        Set { name: "own_scattering_similar", own_scattering: true, forward: 0.4, ..plain },
        Set { name: "own_emission", own_emission: true, ..plain },
        Set { name: "colored_emission", colored_emission: true, own_scattering: true, ..plain },
    ];
    let made = |set: Set| {
        case("coarsen", set.name, "extinction, albedo and emission", &tolerance::MEAN, move |subject, record| {
            one(subject, record, &set)
        })
    };
    sets.into_iter().map(made).collect()
}

fn one(subject: &Subject, record: &mut Record, set: &Set) -> Result<(), Failed> {
    let [x, y, z] = set.cells;
    let dims = DIMS.to_array();
    let side = |a: usize| dims[a] as f32 / set.cells[a] as f32;
    let params = CoarsenParams {
        dims: [dims[0], dims[1], dims[2], 0],
        cells: [x, y, z, 0],
        cell: [side(0), side(1), side(2), 0.0],
        extinction: [6.0, 4.0, 2.5, 0.0],
        albedo: [0.95, 0.8, 1.0, 0.0],
        emission: [0.3, 2.0, 1.0, set.forward],
    };
    let rho = density(DIMS, 51);
    let shares = noise(52, 3 * rho.len());
    let scattering: Vec<[f32; 4]> =
        rho.iter().zip(shares.chunks_exact(3)).map(|(v, s)| [v * s[0], v * s[1], v * s[2], 7.0]).collect();
    let emission: Vec<f32> = noise(53, rho.len()).iter().map(|v| (v - 0.5).max(0.0)).collect();
    let glow: Vec<[f32; 4]> = emission.iter().map(|v| [*v, 0.5 * v, 0.1 * v, 7.0]).collect();
    let cells = (x * y * z) as usize;
    let mut bench = Bench::new(subject)?;
    let stage = Coarsen {
        params,
        density: bench.scalars(dims, &rho)?,
        scattering: set.own_scattering.then(|| bench.colors(dims, 1, &scattering)).transpose()?,
        emission: (set.own_emission || set.colored_emission).then(|| bench.scalars(dims, &emission)).transpose()?,
        emission_color: set.colored_emission.then(|| bench.colors(dims, 1, &glow)).transpose()?,
        out: bench.room(Coarsen::PLANES as usize * cells, Usage::Output)?,
    };
    let out = stage.out;
    let inputs = CoarsenInputs {
        density: &rho,
        scattering: set.own_scattering.then_some(&scattering[..]),
        emission: set.own_emission.then_some(&emission[..]),
        emission_color: set.colored_emission.then_some(&glow[..]),
    };
    let expected = reference::coarsen(&params, &inputs);
    let stage = Stage::Coarsen(stage);
    record.each(&cuts(), |record, &cut| {
        bench.run(record, &stage, cut)?;
        let found: Vec<f32> = bench.read(out)?;
        for (what, part) in ["extinction", "albedo", "emission"].into_iter().zip(0..3) {
            let part = 3 * part * cells..3 * (part + 1) * cells;
            record.hold(what, found[part.clone()].iter().copied(), expected[part].iter().copied());
        }
        Ok(())
    })
}
