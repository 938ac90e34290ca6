//! `coarsen`: what a medium does to light, as means over the cells of a coarse grid.
//!
//! Cells are those of [`Reduce`](super::Reduce), and every voxel counts with the part of it that lies in the cell. With
//! the means ρ̄ of the density, s̄ of what scatters and ē of what shines, per channel, and with `forward` = f,
//!
//! - extinction σt = ρ̄ · `extinction` - f · s̄ · `extinction` · `albedo`, 1/m,
//! - albedo = (1 - f) · s̄ · `extinction` · `albedo` / σt, and (1 - f) `albedo` / (1 - f `albedo`) where σt is zero,
//! - emission j = ē · `emission`, W m⁻³ sr⁻¹.
//!
//! With f = 0 these are the medium's own. With the share f of light that is scattered so little that it may as well go on
//! they are those of the similar medium in which it does (Joseph, Wiscombe and Weinman 1976).
//!
//! The output is planes of a value a cell, x fastest: [`Coarsen::PLANES`] of them, three channels of extinction, of albedo, of
//! emission. The work axis is the cells.

use crate::device::{Binding, Buf, Field, FieldFormat};
use crate::kernel_struct;
use crate::stage::grid::is_medium;
use crate::stage::{Kernel, require};

kernel_struct! {
    /// Parameters of `coarsen`.
    pub struct CoarsenParams {
        /// Samples of the density along x, y, z; unused.
        dims: U32x4,
        /// Cells along x, y, z; unused.
        cells: U32x4,
        /// Voxels of a cell along x, y, z; unused.
        cell: F32x4,
        /// Extinction per unit of density, 1/m, RGB; unused.
        extinction: F32x4,
        /// Albedo, RGB; unused.
        albedo: F32x4,
        /// Emission per unit of emission density, W m⁻³ sr⁻¹, RGB; the share of scattered light that goes on.
        emission: F32x4,
    }
}

/// The stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Coarsen {
    /// Parameters.
    pub params: CoarsenParams,
    /// Density ρ.
    pub density: Field,
    /// The density that scatters, ρs, RGB; unused; where it is not ρ.
    pub scattering: Option<Field>,
    /// Emission density ρe, where it is not ρ.
    pub emission: Option<Field>,
    /// Emission density with a colour, RGB; unused; in place of ρe.
    pub emission_color: Option<Field>,
    /// Laid out \[extinction, albedo, emission\]\[RGB\]\[cell\].
    pub out: Buf<f32>,
}

impl Coarsen {
    /// Values of a cell.
    pub const PLANES: u32 = 9;

    /// The most turns of all loops of a cell: its voxels, in rows.
    fn turns(&self) -> u64 {
        let p = &self.params;
        // A wall may cut a voxel on either side. Casting saturates.
        let most = |a: usize| (f64::from(p.cell[a]).ceil() as u64).saturating_add(2).min(p.dims[a].into());
        most(1).saturating_mul(most(2)).saturating_mul(1 + most(0))
    }
}

impl Kernel for Coarsen {
    const NAME: &'static str = "coarsen";

    fn params(&self) -> &[u8] {
        bytemuck::bytes_of(&self.params)
    }

    fn bindings(&self) -> Vec<Binding> {
        vec![
            Binding::sample("density", FieldFormat::Scalar, Some(self.density)),
            Binding::sample("scattering", FieldFormat::Rgba, self.scattering),
            Binding::sample("emission_density", FieldFormat::Scalar, self.emission),
            Binding::sample("emission_color", FieldFormat::Rgba, self.emission_color),
            Binding::write("optics", Some(self.out)),
        ]
    }

    fn axis(&self) -> u32 {
        self.params.cells[..3].iter().product()
    }

    fn validate(&self) -> Result<(), String> {
        let p = &self.params;
        is_medium(&self.density, self.scattering, self.emission, self.emission_color, p.dims)?;
        let cells = p.cells[..3].iter().try_fold(Self::PLANES, |n, &c| n.checked_mul(c));
        require!(cells.is_some_and(|n| n > 0), "{:?} cells", p.cells);
        require!(p.cell[..3].iter().all(|c| c.is_finite() && *c > 0.0), "cells of {:?} voxels", p.cell);
        let values = u64::from(self.axis()) * u64::from(Self::PLANES);
        require!(self.out.len >= values, "{} places for {values} values", self.out.len);
        Ok(())
    }

    fn passes(&self, turns: u64) -> Result<Vec<Self>, String> {
        let own = self.turns();
        require!(
            own <= turns,
            "a cell holds up to {own} voxels and rows, and {turns} are allowed: more cells need less"
        );
        Ok(vec![self.clone()])
    }
}
