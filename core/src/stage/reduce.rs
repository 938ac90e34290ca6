//! `reduce`: coarse mean and maximum of a field.
//!
//! Coarse cell c covers the index-space box from c·s - ½ to (c+1)·s - ½, with s = `cell` voxels along each axis.
//!
//! - The mean weighs each voxel by the part of it that lies in the cell, so that mass is kept: Σ mean · s³ = Σ ρ.
//! - The maximum is over every voxel that a trilinear lookup inside the cell, widened on each side by `cell.w` cells
//!   and [`Reduce::SLACK`] voxels, can touch. It is zero only where every such lookup is zero, in any device's
//!   rounding. With `other`, the maximum is over both fields.
//! - With `coarse.w` = n > 0 the maximum is instead over n³ lookups evenly spread over the cell, as published by
//!   Delalandre, Gautron and Marvie (2013, section 4.2), which may miss density.
//!
//! The work axis is the coarse cells, x fastest.

use crate::device::{Binding, Buf, Field, FieldFormat};
use crate::kernel_struct;
use crate::stage::grid::is_scalar;
use crate::stage::{Kernel, require};

kernel_struct! {
    /// Parameters of `reduce`.
    pub struct ReduceParams {
        /// Samples of the field along x, y, z; unused.
        dims: U32x4,
        /// Coarse cells along x, y, z; probes along a side of a cell, or 0 for the exact maximum.
        coarse: U32x4,
        /// Voxels of a coarse cell along x, y, z; margin of the maximum in cells.
        cell: F32x4,
    }
}

/// The stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Reduce {
    /// Parameters.
    pub params: ReduceParams,
    /// The field.
    pub density: Field,
    /// A second field of the same size that counts toward the maximum.
    pub other: Option<Field>,
    /// Mean and maximum of each coarse cell.
    pub out: Buf<[f32; 2]>,
}

impl Reduce {
    /// Voxels by which the maximum looks further than exact arithmetic would need to.
    pub const SLACK: f32 = 1.0 / 64.0;
}

impl Kernel for Reduce {
    const NAME: &'static str = "reduce";

    fn params(&self) -> &[u8] {
        bytemuck::bytes_of(&self.params)
    }

    fn bindings(&self) -> Vec<Binding> {
        vec![
            Binding::sample("density", FieldFormat::Scalar, Some(self.density)),
            Binding::sample("other", FieldFormat::Scalar, self.other),
            Binding::write("reduced", Some(self.out)).in_parts::<[f32; 2]>(1),
        ]
    }

    fn axis(&self) -> u32 {
        self.params.coarse[..3].iter().product()
    }

    fn validate(&self) -> Result<(), String> {
        let p = &self.params;
        require!(
            is_scalar(&self.density, p.dims),
            "density is {:?}, not a scalar field of {:?}",
            self.density.spec,
            p.dims
        );
        require!(self.other.is_none_or(|f| is_scalar(&f, p.dims)), "the second field differs from the first");
        let cells = p.coarse[..3].iter().try_fold(1u32, |n, &c| n.checked_mul(c));
        require!(cells.is_some_and(|n| n > 0), "{:?} coarse cells", p.coarse);
        require!(u64::from(self.axis()) <= self.out.len, "{} cells into {} places", self.axis(), self.out.len);
        require!(p.cell[..3].iter().all(|c| c.is_finite() && *c > 0.0), "coarse cells of {:?} voxels", p.cell);
        require!(p.cell[3].is_finite() && p.cell[3] >= 0.0, "a margin of {} cells", p.cell[3]);
        Ok(())
    }

    fn passes(&self, _: u64) -> Result<Vec<Self>, String> {
        Ok(vec![self.clone()])
    }
}
