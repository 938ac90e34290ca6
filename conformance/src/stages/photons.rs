//! `photons` against its twin, photon by photon.

use airlight::basis::healpix;
use airlight::device::{Buf, Usage};
use airlight::glam::{DVec3, UVec3};
use airlight::media::{Phase, PhaseTable};
use airlight::reference::{self, PhotonInputs};
use airlight::stage::{
    PhotonParams, PhotonTable, Photons, Reduce, ReduceParams, Stage, photon_counter, photon_deposit, photon_tables,
};
use libtest_mimic::Failed;

use super::case;
use crate::bench::{Bench, cuts};
use crate::fixtures::{DIMS, Map, density, noise};
use crate::{Case, Record, Subject, check, tolerance};

/// A medium in which photons fly, and what they leave.
#[derive(Clone)]
pub(super) struct Flown {
    pub(super) map: Map,
    /// Cells that light is left on.
    pub(super) cells: UVec3,
    pub(super) density: Vec<f32>,
    pub(super) scattering: Option<Vec<[f32; 4]>>,
    pub(super) extinction: f32,
    pub(super) albedo: f32,
    pub(super) phase: Phase,
    pub(super) bands: u32,
    pub(super) deposit: u32,
    pub(super) radius: f32,
    pub(super) turns: u32,
    pub(super) max_depth: u32,
    pub(super) rounds: u32,
    pub(super) scale: f32,
    /// HEALPix' n of the set of directions.
    pub(super) nside: u32,
    pub(super) lights: u32,
}

/// Voxels of a side of the majorant's cells.
const CELL: u32 = 2;

impl Flown {
    /// Leaves light along the flights of a cloud of [`DIMS`], for as many lights as directions.
    pub(super) fn plain() -> Self {
        Self {
            map: Map::Plain,
            cells: UVec3::new(4, 3, 5),
            density: density(DIMS, 48),
            scattering: None,
            extinction: 24.0,
            albedo: 0.9,
            phase: Phase::Isotropic,
            bands: 3,
            deposit: photon_deposit::TRACK,
            radius: 1.5,
            turns: 500,
            max_depth: 4,
            rounds: 1,
            scale: 1e4,
            nside: 4,
            lights: 192,
        }
    }

    /// Directions of the set.
    pub(super) fn set(&self) -> Vec<DVec3> {
        healpix::directions(self.nside)
    }

    /// The table of what each direction does for the lights.
    pub(super) fn table(&self, weights: impl FnMut(usize, DVec3, &mut Vec<(u32, f64)>)) -> PhotonTable {
        PhotonTable::new(&self.map.lattice(DIMS), &self.set(), self.lights, weights)
    }

    /// The stage, and what else its twin takes: the tables and the majorant.
    pub(super) fn stage(
        &self,
        bench: &mut Bench,
        table: &PhotonTable,
        rows: &[u32],
    ) -> Result<(Photons, Vec<f32>, Vec<[f32; 2]>), Failed> {
        let mut p = PhotonParams::new(&self.map.lattice(DIMS), self.cells, self.max_depth);
        table.place(&mut p);
        let tables = photon_tables(self.bands, &self.phase, &mut p);
        p.majorant_cells = [0, 1, 2, 3].map(|a| if a < 3 { DIMS[a].div_ceil(CELL) } else { CELL });
        (p.turns, p.rounds, p.seed, p.lights) = (self.turns, self.rounds, 3, self.lights);
        (p.rows, p.deposit, p.channel, p.radius) =
            (rows.iter().copied().max().unwrap_or(0), self.deposit, 1, self.radius);
        (p.densest, p.albedo, p.scale) = (self.extinction, self.albedo, self.scale);
        let [x, y, z, side] = p.majorant_cells;
        let dims = DIMS.to_array();
        let majorant: Buf<[f32; 2]> = bench.room((x * y * z) as usize, Usage::Work)?;
        let field = bench.scalars(dims, &self.density)?;
        let params = ReduceParams::new(p.dims, [x, y, z, 0], [side as f32, side as f32, side as f32, 0.0]);
        let reduce = Reduce { params, density: field, other: None, out: majorant };
        bench.device.dispatch(&Stage::Reduce(reduce), 0..x * y * z)?;
        bench.device.finish()?;
        let stage = Photons {
            params: p,
            density: field,
            scattering: match &self.scattering {
                Some(colors) => Some(bench.colors(dims, 1, colors)?),
                None => None,
            },
            majorant,
            tables: bench.buf(&tables)?,
            directions: bench.buf(&table.directions)?,
            weights: bench.buf(&table.weights)?,
            rows: bench.buf(rows)?,
            deposits: bench.room(p.deposits() as usize, Usage::Output)?,
            counters: bench.room(photon_counter::COUNT as usize, Usage::Output)?,
        };
        let majorant = bench.read(majorant)?;
        Ok((stage, tables, majorant))
    }

    /// A row for every cell.
    pub(super) fn rows(&self) -> Vec<u32> {
        (1..=self.cells.element_product()).collect()
    }
}

pub(crate) fn cases() -> Vec<Case> {
    let plain = Flown::plain();
    let degrees: Vec<f64> = (0..=36).map(|i| 5.0 * f64::from(i)).collect();
    let values: Vec<f64> = degrees.iter().map(|d| 0.2 + (-d / 25.0).exp()).collect();
    let table = Phase::Table(PhaseTable::new(&degrees, &values).expect("a table").into());
    let lobes = Phase::DoubleHenyeyGreenstein { forward: 0.6, backward: -0.4, weight: 0.7 };
    let voxels = DIMS.element_product() as usize;
    let scattering = noise(49, 3 * voxels)
        .chunks_exact(3)
        .zip(&plain.density)
        .map(|(v, rho)| [v[0] * rho, v[1] * rho, v[2] * rho, 0.0])
        .collect();
    let sets = [
        ("track", Flown { phase: lobes, map: Map::Sheared, ..plain.clone() }),
        (
            "collision_and_field",
            Flown {
                map: Map::Rotated,
                phase: table,
                scattering: Some(scattering),
                deposit: photon_deposit::COLLISION,
                ..plain.clone()
            },
        ),
        (
            "absorption",
            Flown {
                map: Map::Mirrored,
                phase: Phase::Rayleigh,
                deposit: photon_deposit::ABSORPTION,
                albedo: 0.6,
                radius: 2.0,
                bands: 2,
                rounds: 3,
                ..plain.clone()
            },
        ),
        // What is faint goes on by chance, and turns run out.
        ("faint_and_short", Flown { albedo: 0.3, turns: 30, max_depth: 40, rounds: 2, bands: 1, ..plain }),
    ];
    let made = |(name, flown): (&'static str, Flown)| {
        case("photons", name, "light", &tolerance::PHOTONS, move |subject, record| one(subject, record, &flown))
    };
    sets.into_iter().map(made).chain(super::photon_cases::cases()).collect()
}

fn one(subject: &Subject, record: &mut Record, flown: &Flown) -> Result<(), Failed> {
    // Each direction has a light of its own, so that every photon's can be told apart, some have none, and some cells no row.
    let alone = |i: usize, _: DVec3, out: &mut Vec<(u32, f64)>| {
        if i % 5 != 2 {
            out.push((i as u32, if i % 3 == 0 { -0.4 } else { 1.0 }));
        }
    };
    let table = flown.table(alone);
    let mut next = 0;
    let mut row = |i: u32| {
        next += u32::from(i % 7 != 3);
        if i % 7 != 3 { next } else { 0 }
    };
    let rows: Vec<u32> = (0..flown.cells.element_product()).map(&mut row).collect();
    let mut bench = Bench::new(subject)?;
    let (stage, tables, majorant) = flown.stage(&mut bench, &table, &rows)?;
    let inputs = PhotonInputs {
        density: &flown.density,
        scattering: flown.scattering.as_deref(),
        majorant: &majorant,
        tables: &tables,
        directions: &table.directions,
        weights: &table.weights,
        rows: &rows,
    };
    let p = stage.params;
    let (expected, counts) = reference::photons(&p, &inputs, 0..p.listed * p.rounds);
    let per = p.coefficients() as usize;
    let of = |light: usize, values: &[f64]| -> Vec<f64> {
        let rows = values.chunks_exact(p.lights as usize * per);
        rows.flat_map(|row| row[light * per..][..per].to_vec()).collect()
    };
    let expected: Vec<f64> = expected.into_iter().map(|v| v as f64).collect();
    let lit: Vec<usize> = (0..p.lights as usize).filter(|&l| of(l, &expected).iter().any(|v| *v != 0.0)).collect();
    check!(lit.len() > 40, "photons of {} directions leave light: the case tries little", lit.len());
    record.each(&cuts(), |record, &cut| {
        bench.run(record, &Stage::Photons(stage.clone()), cut)?;
        let found: Vec<f64> = bench.read(stage.deposits)?.into_iter().map(f64::from).collect();
        // A photon that parts from its twin at a decision within a rounding is another one, as good as the twin's. All integers
        // are rounded by the same draws, so that of those that differ most differ by one.
        let same = |f: &[f64], e: &[f64]| {
            let off: f64 = f.iter().zip(e).map(|(f, e)| ((f - e).abs() - 1.0).max(0.0)).sum();
            off <= 1e-3 * e.iter().map(|e| e.abs()).sum::<f64>()
        };
        let (kept, parted): (Vec<_>, Vec<_>) = (0..p.lights as usize)
            .map(|light| (of(light, &found), of(light, &expected)))
            .partition(|(f, e)| same(f, e));
        record.score("photons", "part of the lights whose photons part", parted.len() as f64 / lit.len() as f64, 0.03);
        let values =
            |which: fn(&(Vec<f64>, Vec<f64>)) -> &Vec<f64>| kept.iter().flat_map(which).copied().collect::<Vec<f64>>();
        record.hold("moments", values(|pair| &pair.0), values(|pair| &pair.1));
        let counted = bench.read(stage.counters)?;
        for (i, (&found, &expected)) in counted.iter().zip(&counts).enumerate() {
            // Photons that part count differently.
            let room = parted.len() as f64 * f64::from(p.rounds * p.max_depth);
            let off = (f64::from(found) - f64::from(expected)).abs();
            record.score("counters", &format!("counter {i}"), off, if i == 0 { 0.0 } else { room });
        }
        Ok(())
    })
}
