//! `photons` as a benchmark.

use airlight::basis::healpix;
use airlight::device::{Buf, DeviceError, Usage};
use airlight::glam::UVec3;
use airlight::media::Phase;
use airlight::stage::{
    PhotonParams, PhotonTable, Photons, Reduce, ReduceParams, Stage, photon_counter, photon_deposit, photon_tables,
};

use super::{BANDS, EXTINCTION, Rig, count};
use crate::{DIMS, lattice};

/// HEALPix' n of the set of directions.
const NSIDE: u32 = 16;
/// Photons of a direction.
const ROUNDS: u32 = 4;

impl Rig {
    /// `photons` of all orders for sixteen lights, each of which some directions come from, three lights a direction; light is left
    /// along flights. Its elements are the photons.
    pub(super) fn photons(&mut self) -> Result<(Stage, u64), DeviceError> {
        const LIGHTS: u32 = 16;
        let cells = UVec3::new(24, 20, 32);
        let mut params = PhotonParams::new(&lattice(), cells, 1000);
        let table = PhotonTable::new(&lattice(), &healpix::directions(NSIDE), LIGHTS, |i, _, out| {
            // Bands of directions, as lights of compact support have.
            let near = (i as u32 / 64) % LIGHTS;
            out.extend((0..3).map(|k| ((near + k) % LIGHTS, 0.5)));
        });
        table.place(&mut params);
        let tables = photon_tables(BANDS, &Phase::HenyeyGreenstein { g: 0.5 }, &mut params);
        let majorant_cells = DIMS.to_array().map(|d| d.div_ceil(8));
        params.majorant_cells = [majorant_cells[0], majorant_cells[1], majorant_cells[2], 8];
        (params.rounds, params.lights, params.rows) = (ROUNDS, LIGHTS, cells.element_product());
        // Dense enough to scatter a few times.
        (params.densest, params.albedo, params.deposit) = (16.0 * EXTINCTION, 0.9, photon_deposit::TRACK);
        params.scale = Photons::scale(1.0, u64::from(ROUNDS * params.directions));
        let majorant: Buf<[f32; 2]> = self.make(count(majorant_cells), Usage::Work)?;
        let of = [majorant_cells[0], majorant_cells[1], majorant_cells[2], 0];
        let reduce = ReduceParams::new(params.dims, of, [8.0, 8.0, 8.0, 0.0]);
        self.run(&Stage::Reduce(Reduce { params: reduce, density: self.density, other: None, out: majorant }))?;
        let stage = Photons {
            params,
            density: self.density,
            scattering: None,
            majorant,
            tables: self.fill(&tables)?,
            directions: self.fill(&table.directions)?,
            weights: self.fill(&table.weights)?,
            rows: self.fill(&(1..=params.rows).collect::<Vec<u32>>())?,
            deposits: self.make(params.deposits(), Usage::Output)?,
            counters: self.make(photon_counter::COUNT.into(), Usage::Output)?,
        };
        Ok((Stage::Photons(stage), u64::from(ROUNDS * params.directions)))
    }
}
