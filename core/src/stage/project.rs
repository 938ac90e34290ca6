//! `project`: records of directional light at the cells of a coarse grid (Delalandre, Gautron and Marvie 2013,
//! section 4.2).
//!
//! A record sits at the centre of its cell. From there a ray goes along each direction ω_i to the end of the box,
//! in n = ceil(length / step) equal steps sampled at their middles; its column of density gives the transmittance
//! T_c(ω_i) = exp(-σ_c · column) of each distinct extinction channel c. With a table W of the host's making,
//!
//! D\[k\]\[c\] = Σ_i T_c(ω_i) · W\[i\]\[k\]\[c\] · p_i,
//!
//! where p_i is 1, or, with `toward_eye`, the phase function between ω_i and the direction from the eye to the cell.
//! The table decides what a record holds: ∫ b_k dω over each direction's pixel makes it moments of transmittance
//! (the paper's isotropic form; with `toward_eye` its dynamic anisotropic form), ∫ L Y_k dω makes it moments of
//! attenuated radiance (its static anisotropic form).
//!
//! With emission, the light that the medium itself sends along each ray, ∫ T j dt, is gathered in the same pass into
//! moments of its own (section 4.5): E\[k\]\[c\] = Σ_i (∫ T j dt)_c · V\[i\]\[k\] · p_i.
//!
//! Cells whose `occupancy` maximum is zero are written as zeros. The work axis is the cells, x fastest.
//!
//! A pass takes some of the directions: the first writes its sums, and each other adds to what the ones before left.
//!
//! The loops of a pass of n directions turn at the most n (1 + s + K + E + P) + ⌈n / 64⌉ P + 3 (K + E) + 2 P times: s is
//! the steps of the longest ray, K and E the coefficients of the record and of the emission's moments, and P, the parts
//! of 64 values of the largest record, counts where [`Project::LANES`] = 64 invocations share a cell. Where one takes a
//! cell alone, loops turn no more often.

use crate::basis::SphericalHarmonics;
use crate::device::{Binding, Buf, Field, FieldFormat};
use crate::kernel_struct;
use crate::stage::grid::{is_medium, most_steps};
use crate::stage::{Kernel, PhaseParams, require};

kernel_struct! {
    /// Parameters of `project`.
    pub struct ProjectParams {
        /// Samples of the density along x, y, z; unused.
        dims: U32x4,
        /// Row of the linear map from metres to voxels.
        index_x: F32x4,
        /// See `index_x`.
        index_y: F32x4,
        /// See `index_x`.
        index_z: F32x4,
        /// Row of the linear map from voxels to metres.
        world_x: F32x4,
        /// See `world_x`.
        world_y: F32x4,
        /// See `world_x`.
        world_z: F32x4,
        /// Cells along x, y, z; unused.
        cells: U32x4,
        /// Voxels of a cell along x, y, z; the longest step in metres.
        cell: F32x4,
        /// The eye in index space; unused.
        eye: F32x4,
        /// Extinction per unit of density, 1/m, RGB; where one channel serves, the first counts.
        extinction: F32x4,
        /// Emission per unit of emission density, W m⁻³ sr⁻¹, RGB; unused.
        emission: F32x4,
        /// Parameters of the phase function.
        phase: F32x4,
        /// Kind of the phase function.
        phase_kind: U32,
        /// First direction of this pass.
        direction_begin: U32,
        /// One past the last direction of this pass.
        direction_end: U32,
        /// Coefficients of a record.
        coefficients: U32,
        /// Distinct extinction channels: 1 or 3.
        channels: U32,
        /// Channels of the table of weights: 1 or 3.
        weight_channels: U32,
        /// Coefficients of the emission's moments; 0 for none.
        emission_coefficients: U32,
        /// 1 to weigh each direction by the phase function toward the eye.
        toward_eye: U32,
    }
}

/// The stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Project {
    /// Parameters.
    pub params: ProjectParams,
    /// Density ρ.
    pub density: Field,
    /// Emission density ρe, where it is not ρ.
    pub emission: Option<Field>,
    /// Emission density with a colour, RGB; unused; in place of ρe.
    pub emission_color: Option<Field>,
    /// Mean and maximum of each cell, from `reduce`; without it every cell is projected.
    pub occupancy: Option<Buf<[f32; 2]>>,
    /// Unit directions in the world; unused.
    pub directions: Buf<[f32; 4]>,
    /// W, laid out \[direction\]\[coefficient\]\[channel\].
    pub weights: Buf<f32>,
    /// V, laid out \[direction\]\[coefficient\].
    pub emission_weights: Option<Buf<f32>>,
    /// The phase function's table, where its kind has one.
    pub phase_table: Option<Buf<f32>>,
    /// D, laid out \[cell\]\[coefficient\]\[channel\].
    pub records: Buf<f32>,
    /// E, laid out \[cell\]\[coefficient\]\[RGB\].
    pub emission_records: Option<Buf<f32>>,
}

impl ProjectParams {
    /// Channels of a record: RGB where either transmittance or weights have colour.
    pub fn record_channels(&self) -> u32 {
        self.channels.max(self.weight_channels)
    }
}

impl Project {
    /// Invocations that share a cell on a device where several do.
    pub const LANES: u32 = 64;
    /// Parts of as many values as there are lanes, of the largest record with its emission's moments.
    const PARTS: u64 = (6 * SphericalHarmonics::DEVICE_BANDS.pow(2)).div_ceil(Self::LANES) as u64;

    /// How often loops turn, at the most.
    fn turns(&self) -> Turns {
        let p = &self.params;
        let (record, emission) = (u64::from(p.coefficients), u64::from(p.emission_coefficients));
        let steps = most_steps(p.dims, [p.index_x, p.index_y, p.index_z], p.cell[3]);
        Turns {
            direction: steps.saturating_add(1 + record + emission + Self::PARTS),
            batch: Self::PARTS,
            cell: 3 * (record + emission) + 2 * Self::PARTS,
        }
    }
}

/// How often loops turn, at the most.
#[derive(Clone, Copy, Debug)]
struct Turns {
    /// For each direction.
    direction: u64,
    /// For each batch of as many directions as there are lanes, and for a rest of fewer.
    batch: u64,
    /// For a cell beside its directions.
    cell: u64,
}

impl Turns {
    /// The most directions that keep to `turns`: whole batches, or a part of one.
    fn directions(self, turns: u64) -> u64 {
        let (lanes, left) = (u64::from(Project::LANES), turns.saturating_sub(self.cell));
        match left / self.direction.saturating_mul(lanes).saturating_add(self.batch) {
            0 => left.saturating_sub(self.batch) / self.direction,
            batches => batches.saturating_mul(lanes),
        }
    }
}

impl Kernel for Project {
    const NAME: &'static str = "project";

    fn params(&self) -> &[u8] {
        bytemuck::bytes_of(&self.params)
    }

    fn bindings(&self) -> Vec<Binding> {
        let p = &self.params;
        let record = u64::from(p.coefficients) * u64::from(p.record_channels());
        let emission = u64::from(p.emission_coefficients) * 3;
        vec![
            Binding::sample("density", FieldFormat::Scalar, Some(self.density)),
            Binding::sample("emission_density", FieldFormat::Scalar, self.emission),
            Binding::sample("emission_color", FieldFormat::Rgba, self.emission_color),
            Binding::read("occupancy", self.occupancy).in_parts::<[f32; 2]>(1),
            Binding::read("directions", Some(self.directions)),
            Binding::read("weights", Some(self.weights)),
            Binding::read("emission_weights", self.emission_weights),
            Binding::read("phase_table", self.phase_table),
            Binding::write("records", Some(self.records)).in_parts::<f32>(record),
            Binding::write("emission_records", self.emission_records).in_parts::<f32>(emission),
        ]
    }

    fn axis(&self) -> u32 {
        self.params.cells[..3].iter().product()
    }

    fn validate(&self) -> Result<(), String> {
        let p = &self.params;
        is_medium(&self.density, None, self.emission, self.emission_color, p.dims)?;
        let cells = p.cells[..3].iter().try_fold(1u32, |n, &c| n.checked_mul(c));
        require!(cells.is_some_and(|n| n > 0), "{:?} cells", p.cells);
        let cells = u64::from(self.axis());
        require!(p.cell.iter().all(|c| c.is_finite() && *c > 0.0), "cells and step {:?}", p.cell);
        require!(self.occupancy.is_none_or(|b| b.len >= cells), "occupancy of fewer than {cells} cells");
        require!([1, 3].contains(&p.channels) && [1, 3].contains(&p.weight_channels), "channels must be 1 or 3");
        let (n, k) = (u64::from(p.direction_end), u64::from(p.coefficients));
        require!(p.direction_begin < p.direction_end, "directions {} to {n}", p.direction_begin);
        let most = SphericalHarmonics::DEVICE_BANDS.pow(2);
        require!((1..=most).contains(&p.coefficients), "records of {k} coefficients; kernels hold 1 to {most}");
        let moments = p.emission_coefficients;
        require!(moments <= most, "emission moments of {moments} coefficients; kernels hold {most}");
        require!(self.directions.len >= n, "{} directions for {n}", self.directions.len);
        require!(self.weights.len >= n * k * u64::from(p.weight_channels), "{} weights", self.weights.len);
        require!(self.records.len >= cells * k * u64::from(p.record_channels()), "{} record values", self.records.len);
        if p.emission_coefficients > 0 {
            let e = u64::from(p.emission_coefficients);
            require!(self.emission_weights.is_some_and(|b| b.len >= n * e), "emission weights are missing or too few");
            require!(
                self.emission_records.is_some_and(|b| b.len >= cells * e * 3),
                "emission records are missing or too few"
            );
        }
        let table = p.toward_eye == 1 && p.phase_kind == PhaseParams::TABLE;
        require!(!table || self.phase_table.is_some_and(|b| b.len >= 2), "the phase table is missing");
        Ok(())
    }

    fn passes(&self, turns: u64) -> Result<Vec<Self>, String> {
        let each = self.turns();
        let most = each.directions(turns).min(u32::MAX.into()) as u32;
        require!(
            most > 0,
            "one direction of a record takes up to {} turns of loops, and {turns} are allowed: a longer step or a \
             smaller medium need less",
            each.direction.saturating_add(each.batch).saturating_add(each.cell)
        );
        let (begin, end) = (self.params.direction_begin, self.params.direction_end);
        let pass = |from: u32| {
            let mut pass = self.clone();
            (pass.params.direction_begin, pass.params.direction_end) = (from, from.saturating_add(most).min(end));
            pass
        };
        Ok((begin..end).step_by(most as usize).map(pass).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::{FieldSpec, ResourceId};
    use bytemuck::Zeroable;

    /// 200 directions of up to 5 steps: the box's diagonal is 1.5 m.
    fn project() -> Project {
        let mut params = ProjectParams::zeroed();
        params.dims = [10, 10, 5, 0];
        (params.index_x, params.index_y) = ([10.0, 0.0, 0.0, 0.0], [0.0, 10.0, 0.0, 0.0]);
        params.index_z = [0.0, 0.0, 10.0, 0.0];
        (params.cells, params.cell) = ([2, 3, 1, 0], [5.0, 3.4, 5.0, 0.5]);
        (params.direction_end, params.coefficients, params.channels, params.weight_channels) = (200, 4, 1, 1);
        let spec = FieldSpec::dense([10, 10, 5], 1, FieldFormat::Scalar);
        Project {
            params,
            density: Field { id: ResourceId(0), spec },
            emission: None,
            emission_color: None,
            occupancy: None,
            directions: Buf::new(ResourceId(1), 200),
            weights: Buf::new(ResourceId(2), 800),
            emission_weights: None,
            phase_table: None,
            records: Buf::new(ResourceId(3), 24),
            emission_records: None,
        }
    }

    #[test]
    fn passes_take_every_direction_once_and_keep_to_their_turns() {
        let project = project();
        let Turns { direction, batch, cell } = project.turns();
        assert_eq!(direction, 5 + 1 + 4 + Project::PARTS);
        for turns in [cell + batch + direction, 500, 2000, 10_000, u64::MAX] {
            let mut next = 0;
            for pass in project.passes(turns).unwrap() {
                assert_eq!(pass.validate(), Ok(()));
                let (begin, end) = (pass.params.direction_begin, pass.params.direction_end);
                assert_eq!(begin, next);
                let n = end - begin;
                let taken = u64::from(n) * direction + u64::from(n.div_ceil(Project::LANES)) * batch + cell;
                assert!(taken <= turns, "{turns} turns: {n} directions take {taken}");
                next = end;
            }
            assert_eq!(next, 200, "{turns} turns");
        }
        assert_eq!(project.passes(u64::MAX).unwrap().len(), 1);
        let error = project.passes(cell + batch + direction - 1).unwrap_err();
        assert!(error.contains("one direction"), "{error}");
    }

    #[test]
    fn records_hold_no_more_than_kernels_do() {
        for (coefficients, emission_coefficients) in [(0, 0), (101, 0), (4, 101)] {
            let mut project = project();
            (project.params.coefficients, project.params.emission_coefficients) = (coefficients, emission_coefficients);
            project.weights.len = 200 * 101;
            project.records.len = 6 * 101;
            project.emission_weights = Some(Buf::new(ResourceId(4), 200 * 101));
            project.emission_records = Some(Buf::new(ResourceId(5), 6 * 101 * 3));
            let error = project.validate().unwrap_err();
            assert!(error.contains("kernels hold"), "{error}");
        }
    }
}
