//! `reconstruct` against its twin, and behind `evaluate`.

use airlight::basis::recurrence_table;
use airlight::device::{Buf, Limits, Usage};
use airlight::exec::{ExecError, Executor, Hooks, Plan};
use airlight::glam::{UVec3, Vec3};
use airlight::reference::{self, EvaluateInputs, ReconstructInputs};
use airlight::stage::{Evaluate, EvaluateParams, GridParams, Reconstruct, ReconstructParams, Stage};
use bytemuck::Zeroable;
use libtest_mimic::Failed;

use super::case;
use crate::bench::{Bench, cuts};
use crate::fixtures::{Map, noise};
use crate::frames::NARROW;
use crate::limits::sizes;
use crate::{Case, Record, Subject, check, tolerance};

const CELLS: [u32; 3] = [13, 11, 17];
const ROWS: u32 = 301;

/// One set of parameters.
#[derive(Clone, Copy)]
struct Set {
    name: &'static str,
    map: Map,
    dims: UVec3,
    /// In index space.
    eye: Vec3,
    channels: u32,
    clusters: u32,
    components: u32,
    bands: u32,
    view: bool,
    /// How many rows and clusters some indices are past the last.
    past: u32,
}

pub(crate) fn cases() -> Vec<Case> {
    let set = |name: &'static str| Set {
        name,
        map: Map::Plain,
        dims: UVec3::new(20, 23, 31),
        eye: Vec3::new(31.5, 29.25, 44.75),
        channels: 1,
        clusters: 7,
        components: 4,
        bands: 1,
        view: false,
        past: 0,
    };
    let seen = |name: &'static str| Set { bands: 3, view: true, ..set(name) };
    let colored = |set: Set| Set { channels: 3, ..set };
    let mut sets = vec![
        set("one_moment"),
        colored(set("one_moment_of_channels")),
        Set { components: 0, ..set("means_alone") },
        colored(Set { components: 0, bands: 2, ..set("means_of_channels") }),
        Set { bands: 4, ..set("layers") },
        colored(Set { bands: 3, ..set("layers_of_channels") }),
        Set { bands: 10, components: 1, clusters: 3, ..set("layers_of_ten_bands") },
        Set { past: 5, ..set("indices_past_the_last") },
        colored(Set { past: 5, bands: 2, ..set("indices_past_the_last_of_channels") }),
        seen("a_view"),
        colored(seen("a_view_of_channels")),
        Set { components: 0, bands: 4, ..seen("a_view_of_means") },
        Set { bands: 1, ..seen("a_view_of_one_moment") },
        Set { bands: 10, clusters: 3, ..seen("a_view_of_ten_bands") },
        // The centre of a cell, to the last digit.
        Set { dims: UVec3::new(26, 22, 17), eye: Vec3::new(6.5, 12.5, 4.0), ..seen("a_view_from_a_cell") },
    ];
    for (name, map) in [("rotated", Map::Rotated), ("sheared", Map::Sheared), ("mirrored", Map::Mirrored)] {
        sets.push(Set { map, ..seen(name) });
    }
    let made = |set: Set| {
        case("reconstruct", set.name, "in-scattered radiance", &tolerance::MATRICES, move |subject, record| {
            one(subject, record, set)
        })
        .varies(&sizes())
    };
    let chain = Case::new(
        "stage::reconstruct::of_evaluated_light",
        "A plan of evaluate and reconstruct gives the radiance of both twins in f64.",
        of_evaluated_light,
    )
    .within(&tolerance::MATRICES);
    sets.into_iter().map(made).chain([chain]).collect()
}

/// Rows of cells, clusters of rows, weights and the phase function's moments.
struct Tables {
    rows: Vec<u32>,
    clusters: Vec<u32>,
    weights: Vec<f32>,
    tables: Vec<f32>,
}

impl Tables {
    /// A third of the cells are empty. Some indices are up to `past` beyond the last.
    fn new(params: &ReconstructParams, past: u32) -> Self {
        let count = params.cells[..3].iter().product::<u32>() as usize;
        let below = |v: f32, n: u32| (v * n as f32) as u32;
        let row = |v: f32| below((1.5 * v - 0.5).max(0.0), params.rows + past + 1);
        let rows_of_all = (params.channels * params.rows) as usize;
        let weights: Vec<f32> =
            noise(43, rows_of_all * params.components as usize).into_iter().map(|v| 2.0 * v - 1.0).collect();
        let beta = (0..params.bands).flat_map(|l| vec![0.6f32.powi(l as i32); 2 * l as usize + 1]);
        Self {
            rows: noise(41, count).into_iter().map(row).collect(),
            clusters: noise(42, rows_of_all).into_iter().map(|v| below(v, params.clusters + past)).collect(),
            weights,
            tables: beta.chain(recurrence_table(params.bands)).collect(),
        }
    }

    fn inputs<'a>(&'a self, radiance: &'a [[f32; 4]]) -> ReconstructInputs<'a> {
        let Self { rows, clusters, weights, tables } = self;
        ReconstructInputs { rows, clusters, weights, radiance, tables }
    }
}

impl Set {
    fn params(&self) -> ReconstructParams {
        let grid = GridParams::new(&self.map.lattice(self.dims));
        let [x, y, z] = CELLS;
        let mut params = ReconstructParams::zeroed();
        [params.world_x, params.world_y, params.world_z] = grid.world;
        params.cells = [x, y, z, 0];
        params.cell = (self.dims.as_vec3() / UVec3::from(CELLS).as_vec3()).extend(0.0).to_array();
        params.eye = self.eye.extend(0.0).to_array();
        (params.rows, params.clusters, params.components) = (ROWS, self.clusters, self.components);
        (params.channels, params.bands, params.view) = (self.channels, self.bands, self.view.into());
        params
    }
}

/// Light of `n` units, of either sign.
fn light(n: u32) -> Vec<[f32; 4]> {
    let values: Vec<f32> = noise(44, 4 * n as usize).into_iter().map(|v| v - 0.3).collect();
    values.as_chunks().0.to_vec()
}

fn one(subject: &Subject, record: &mut Record, set: Set) -> Result<(), Failed> {
    let params = set.params();
    let tables = Tables::new(&params, set.past);
    let radiance = light(params.channels * params.clusters * (1 + params.components) * params.coefficients());
    let expected = reference::reconstruct(&params, &tables.inputs(&radiance));
    let past = tables.rows.iter().any(|r| *r > params.rows) && tables.clusters.iter().any(|c| *c >= params.clusters);
    check!(past == (set.past > 0), "indices past the last: {past}");
    check!(tables.rows.contains(&0), "no cell is empty: the case tries less");
    let at = (set.eye + 0.5) / Vec3::from_slice(&params.cell) - 0.5;
    let [x, y, z] = at.to_array().map(|v| v as usize);
    let dark = at.cmplt(UVec3::from(CELLS).as_vec3()).all() && tables.rows[(z * 11 + y) * 13 + x] == 0;
    check!(!dark, "the cell at the eye is empty: the case tries less");
    let bytes = |len: usize| 4 * len as u64;
    // The fewest cells that begin where every device can bind; and all that is bound whole.
    let whole = [tables.clusters.len(), tables.weights.len(), 4 * radiance.len(), tables.tables.len()].map(bytes);
    let limit = whole.into_iter().max().unwrap_or(0).max(64 * 16 * u64::from(params.layers()));
    check!(bytes(expected.len()) > limit, "{} values need not be cut to {limit} bytes", expected.len());
    record.each(&sizes(), |record, &narrow| {
        let mut bench = Bench::new(subject)?;
        if narrow {
            bench.device.narrow(&Limits { binding_bytes: limit, ..NARROW });
        }
        let stage = Reconstruct {
            params,
            rows: bench.buf(&tables.rows)?,
            clusters: bench.buf(&tables.clusters)?,
            weights: (params.components > 0).then(|| bench.buf(&tables.weights)).transpose()?,
            radiance: bench.buf(&radiance)?,
            tables: bench.buf(&tables.tables)?,
            out: bench.room(expected.len() / 4, Usage::Work)?,
        };
        let out = stage.out;
        let stage = Stage::Reconstruct(stage);
        record.each(&cuts(), |record, &cut| {
            bench.run(record, &stage, cut)?;
            record.hold("J", bench.read(out)?.into_iter().flatten(), expected.iter().copied());
            Ok(())
        })
    })
}

/// Light through matrices of 4 moments and 16 functions, seen from an eye.
struct Chain {
    evaluate: EvaluateParams,
    reconstruct: ReconstructParams,
    matrices: Vec<f32>,
    light: Vec<f32>,
    tables: Tables,
}

impl Chain {
    fn new() -> Self {
        let eye = Vec3::new(31.5, 29.25, 44.75);
        let set = Set {
            name: "of_evaluated_light",
            map: Map::Sheared,
            dims: UVec3::new(20, 23, 31),
            eye,
            channels: 1,
            clusters: 7,
            components: 2,
            bands: 2,
            view: true,
            past: 0,
        };
        let reconstruct = set.params();
        let evaluate = EvaluateParams::new(set.clusters, set.components, reconstruct.coefficients(), 16, false);
        let values = |seed: u64, n: u32| noise(seed, n as usize);
        Self {
            evaluate,
            reconstruct,
            matrices: values(45, evaluate.units * evaluate.coefficients * evaluate.functions),
            light: values(46, 3 * evaluate.functions),
            tables: Tables::new(&reconstruct, 0),
        }
    }

    fn expected(&self) -> Vec<f64> {
        let inputs = EvaluateInputs { matrices: &self.matrices, light: &self.light, views: &[] };
        let radiance: Vec<f32> = reference::evaluate(&self.evaluate, &inputs).into_iter().map(|v| v as f32).collect();
        reference::reconstruct(&self.reconstruct, &self.tables.inputs(radiance.as_chunks().0))
    }

    /// Plans both stages.
    fn plan(self, plan: &mut Plan<'_>) -> Buf<[f32; 4]> {
        let Tables { rows, clusters, weights, tables } = self.tables;
        let radiance = plan.work("evaluated light", (self.evaluate.units * self.evaluate.coefficients).into());
        let evaluate = Evaluate {
            params: self.evaluate,
            matrices: plan.table("matrices", self.matrices),
            light: plan.table("light of functions", self.light),
            views: None,
            out: radiance,
        };
        let out = plan.output("radiance", rows.len() as u64);
        let reconstruct = Reconstruct {
            params: self.reconstruct,
            rows: plan.table("rows of cells", rows),
            clusters: plan.table("clusters of rows", clusters),
            weights: Some(plan.table("weights of rows", weights)),
            radiance,
            tables: plan.table("phase moments", tables),
            out,
        };
        plan.stage(Stage::Evaluate(evaluate));
        plan.stage(Stage::Reconstruct(reconstruct));
        out
    }
}

/// Runs `evaluate` and `reconstruct` in a plan of their own, and gives where the radiance lies.
pub(crate) fn chain(executor: &mut Executor) -> Result<Buf<[f32; 4]>, ExecError> {
    let planned = executor.run(&mut Hooks::default(), |plan| Ok::<_, ExecError>(Chain::new().plan(plan)));
    planned.map(|(out, _)| out)
}

fn of_evaluated_light(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let mut executor = Executor::new(subject.device()?);
    let out = chain(&mut executor)?;
    let found = executor.read(out)?;
    record.hold("J", found.into_iter().flatten(), Chain::new().expected());
    Ok(())
}
