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

use crate::device::{Binding, Buf, Field, FieldFormat};
use crate::kernel_struct;
use crate::stage::grid::is_scalar;
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
        /// Directions.
        directions: U32,
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
        /// Unused.
        unused: U32,
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
        require!(
            is_scalar(&self.density, p.dims),
            "density is {:?}, not a scalar field of {:?}",
            self.density.spec,
            p.dims
        );
        require!(self.emission.is_none_or(|f| is_scalar(&f, p.dims)), "the emission density differs from the density");
        let cells = p.cells[..3].iter().try_fold(1u32, |n, &c| n.checked_mul(c));
        require!(cells.is_some_and(|n| n > 0), "{:?} cells", p.cells);
        let cells = u64::from(self.axis());
        require!(p.cell.iter().all(|c| c.is_finite() && *c > 0.0), "cells and step {:?}", p.cell);
        require!(self.occupancy.is_none_or(|b| b.len >= cells), "occupancy of fewer than {cells} cells");
        require!([1, 3].contains(&p.channels) && [1, 3].contains(&p.weight_channels), "channels must be 1 or 3");
        let (n, k) = (u64::from(p.directions), u64::from(p.coefficients));
        require!(n > 0 && k > 0, "{n} directions and {k} coefficients");
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

    fn passes(&self, _: u64) -> Result<Vec<Self>, String> {
        Ok(vec![self.clone()])
    }
}
