//! `project` against its twin.

use airlight::basis::healpix;
use airlight::device::Usage;
use airlight::glam::DVec3;
use airlight::media::Phase;
use airlight::reference::{self, ProjectInputs};
use airlight::stage::{GridParams, PhaseParams, Project, ProjectParams, Stage};
use bytemuck::Zeroable;
use libtest_mimic::Failed;

use super::case;
use crate::bench::{Bench, cuts};
use crate::fixtures::{DIMS, Map, density, noise, phases};
use crate::{Case, Record, Subject, check, tolerance};

const CELLS: [u32; 3] = [4, 3, 5];

/// One set of parameters.
#[derive(Clone)]
struct Set {
    name: String,
    map: Map,
    nside: u32,
    coefficients: u32,
    chromatic: bool,
    colored_weights: bool,
    emission: Emission,
    phase: Option<Phase>,
    eliminated: bool,
    step: f32,
}

#[derive(Clone, Copy, PartialEq)]
enum Emission {
    None,
    Density,
    Own,
    Colored,
}

fn plain(name: &str) -> Set {
    Set {
        name: name.to_owned(),
        map: Map::Plain,
        nside: 2,
        coefficients: 9,
        chromatic: false,
        colored_weights: false,
        emission: Emission::None,
        phase: None,
        eliminated: false,
        step: 0.08,
    }
}

pub(crate) fn cases() -> Vec<Case> {
    let mut sets = vec![
        plain("grey"),
        Set { chromatic: true, ..plain("chromatic") },
        Set { colored_weights: true, ..plain("colored_weights") },
        Set { chromatic: true, colored_weights: true, ..plain("chromatic_and_colored_weights") },
        Set { coefficients: 1, nside: 1, ..plain("one_coefficient") },
        Set { coefficients: 100, nside: 4, colored_weights: true, ..plain("ten_bands") },
        Set { eliminated: true, ..plain("empty_cells") },
        Set { step: 10.0, ..plain("one_step") },
        Set { step: 0.011, ..plain("many_steps") },
        Set { emission: Emission::Density, ..plain("emission") },
        Set { emission: Emission::Own, chromatic: true, colored_weights: true, ..plain("emission_of_its_own") },
        Set { emission: Emission::Own, eliminated: true, coefficients: 4, ..plain("emission_and_empty_cells") },
        Set { emission: Emission::Colored, chromatic: true, map: Map::Sheared, ..plain("emission_color") },
        Set { emission: Emission::Colored, coefficients: 1, step: 0.037, ..plain("emission_color_of_one_coefficient") },
    ];
    sets.extend(Map::ALL.map(|map| Set { map, chromatic: true, ..plain(&format!("{map:?}").to_lowercase()) }));
    for (name, phase) in phases() {
        sets.push(Set { phase: Some(phase), map: Map::Rotated, ..plain(&format!("toward_eye_{name}")) });
    }
    let hg = Phase::HenyeyGreenstein { g: 0.5 };
    sets.push(Set {
        emission: Emission::Own,
        chromatic: true,
        map: Map::Sheared,
        ..Set { phase: Some(hg), ..plain("toward_eye_with_emission") }
    });
    let made = |set: Set| {
        let (name, map) = (set.name.clone(), format!("{:?}", set.map).to_lowercase());
        let run = move |subject: &Subject, record: &mut Record| one(subject, record, &set);
        case("project", &name, "records", &tolerance::STAGE, run).at("map", map)
    };
    sets.into_iter().map(made).collect()
}

fn one(subject: &Subject, record: &mut Record, set: &Set) -> Result<(), Failed> {
    let lattice = set.map.lattice(DIMS);
    let grid = GridParams::new(&lattice);
    let mut params = ProjectParams::zeroed();
    params.dims = grid.dims;
    [params.index_x, params.index_y, params.index_z] = grid.index;
    [params.world_x, params.world_y, params.world_z] = grid.world;
    params.cells = [CELLS[0], CELLS[1], CELLS[2], 0];
    let side = |a: usize| DIMS[a] as f32 / CELLS[a] as f32;
    params.cell = [side(0), side(1), side(2), set.step];
    params.extinction = if set.chromatic { [6.0, 4.0, 2.5, 0.0] } else { [4.0, 4.0, 4.0, 0.0] };
    params.emission = [0.4, 0.9, 0.2, 0.0];
    params.direction_end = healpix::count(set.nside) as u32;
    params.coefficients = set.coefficients;
    params.channels = if set.chromatic { 3 } else { 1 };
    params.weight_channels = if set.colored_weights { 3 } else { 1 };
    params.emission_coefficients = if set.emission == Emission::None { 0 } else { set.coefficients };
    let mut table = Vec::new();
    if let Some(phase) = &set.phase {
        let phase = PhaseParams::new(phase);
        (params.toward_eye, params.phase_kind, params.phase) = (1, phase.kind, phase.lobes);
        table = phase.table;
        let eye = lattice.world_to_index().transform_point3(DVec3::new(1.3, 0.9, 1.7));
        params.eye = eye.as_vec3().extend(0.0).to_array();
    }
    let rho = density(DIMS, 31);
    let glow: Vec<f32> = noise(32, rho.len()).iter().map(|v| (v - 0.4).max(0.0)).collect();
    let own = (set.emission == Emission::Own).then_some(&glow[..]);
    let tints = noise(35, 3 * rho.len());
    let colors: Vec<[f32; 4]> =
        glow.iter().zip(tints.chunks_exact(3)).map(|(v, s)| [v * s[0], v * s[1], v * s[2], 7.0]).collect();
    let colors = (set.emission == Emission::Colored).then_some(&colors[..]);
    let directions: Vec<[f32; 4]> =
        healpix::directions(set.nside).iter().map(|d| d.as_vec3().extend(0.0).to_array()).collect();
    let signed = |seed: u64, n: u32| -> Vec<f32> { noise(seed, n as usize).iter().map(|v| v - 0.25).collect() };
    let weights = signed(33, params.direction_end * params.coefficients * params.weight_channels);
    let emission_weights = signed(34, params.direction_end * params.emission_coefficients);
    let cells = CELLS.iter().product::<u32>() as usize;
    // Every third cell is said to be empty, whatever it holds.
    let occupancy: Vec<[f32; 2]> = (0..cells).map(|i| [1.0, if i % 3 == 1 { 0.0 } else { 0.5 }]).collect();

    let mut bench = Bench::new(subject)?;
    let stage = Project {
        params,
        density: bench.scalars(DIMS.to_array(), &rho)?,
        emission: own.map(|glow| bench.scalars(DIMS.to_array(), glow)).transpose()?,
        emission_color: colors.map(|colors| bench.colors(DIMS.to_array(), 1, colors)).transpose()?,
        occupancy: set.eliminated.then(|| bench.buf(&occupancy)).transpose()?,
        directions: bench.buf(&directions)?,
        weights: bench.buf(&weights)?,
        emission_weights: (!emission_weights.is_empty()).then(|| bench.buf(&emission_weights)).transpose()?,
        phase_table: (!table.is_empty()).then(|| bench.buf(&table)).transpose()?,
        records: bench.room(cells * (params.coefficients * params.record_channels()) as usize, Usage::Work)?,
        emission_records: (params.emission_coefficients > 0)
            .then(|| bench.room(cells * params.emission_coefficients as usize * 3, Usage::Work))
            .transpose()?,
    };
    let (records, emission_records) = (stage.records, stage.emission_records);
    let inputs = ProjectInputs {
        density: &rho,
        emission: own,
        emission_color: colors,
        occupancy: set.eliminated.then_some(&occupancy[..]),
        directions: &directions,
        weights: &weights,
        emission_weights: &emission_weights,
        phase_table: &table,
    };
    let (expected, expected_emission) = reference::project(&params, &inputs);
    let stage = Stage::Project(stage);
    record.each(&cuts(), |record, &cut| {
        bench.run(record, &stage, cut)?;
        let found = bench.read(records)?;
        record.hold("records", found.iter().copied(), expected.iter().copied());
        if set.eliminated {
            let stride = found.len() / cells;
            let zero = found[stride..2 * stride].iter().all(|v| *v == 0.0);
            check!(zero, "the record of an empty cell is not zero");
        }
        let found = emission_records.map(|buf| bench.read(buf)).transpose()?.unwrap_or_default();
        record.hold("emission records", found, expected_emission.iter().copied());
        Ok(())
    })
}
