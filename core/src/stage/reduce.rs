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
//!
//! Voxels and probes of a cell are gone through in rows along x, and rows along y, then z. A pass takes some of the rows:
//! the first writes sum and maximum, each other adds to what the ones before left, and the last divides the sum. A device whose loops
//! may turn as often as they need to may leave all rows to the last pass.
//!
//! Loops turn at the most once for each of a pass's rows and each of a row's voxels or probes, for the mean and for the
//! maximum of each field, where a device does not find both at once.

use crate::device::{Binding, BrickLayout, Buf, Field, FieldFormat, Layout};
use crate::kernel_struct;
use crate::stage::grid::{is_density, is_scalar};
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
        /// First row of a cell in this pass.
        row_begin: U32,
        /// One past the last row of a cell in this pass; [`Reduce::ALL_ROWS`] in the last one.
        row_end: U32,
        /// Unused.
        unused_0: U32,
        /// Unused.
        unused_1: U32,
    }
}

impl ReduceParams {
    /// Of the whole stage; see the fields.
    pub fn new(dims: [u32; 4], coarse: [u32; 4], cell: [f32; 4]) -> Self {
        Self { dims, coarse, cell, row_begin: 0, row_end: Reduce::ALL_ROWS, unused_0: 0, unused_1: 0 }
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
    /// How many voxels beyond a cell of whole voxels whose exact maximum is zero all lookups are zero as well. The nearest
    /// voxel that the maximum does not cover lies one and a half beyond the wall, and shows in lookups less than one
    /// away: that leaves half a voxel, of which the last sixteenth is for rounding.
    pub const BEYOND: f32 = 7.0 / 16.0;
    /// `row_end` of the last pass.
    pub const ALL_ROWS: u32 = u32::MAX;

    /// The most voxels or probes of a cell along an axis.
    fn most(&self, axis: usize) -> u64 {
        let p = &self.params;
        match p.coarse[3] {
            // One more on each side where a cell's wall cuts a voxel, and one more that a lookup touches. Casting
            // saturates.
            0 => {
                let side = p.cell[axis] * (1.0 + 2.0 * p.cell[3]) + 2.0 * Self::SLACK;
                (f64::from(side).ceil() as u64).saturating_add(4).min(p.dims[axis].into())
            }
            probes => {
                let voxels = (f64::from(p.cell[axis]).ceil() as u64).saturating_add(2).min(p.dims[axis].into());
                voxels.max(probes.into())
            }
        }
    }

    /// The most rows of a cell.
    fn rows(&self) -> u64 {
        self.most(1).saturating_mul(self.most(2))
    }

    /// How often loops turn for a row, at the most: the row and its voxels or probes, for the mean and each maximum.
    fn turns(&self) -> u64 {
        let fields = if self.other.is_some() { 3 } else { 2 };
        fields * (1 + self.most(0))
    }

    /// How often loops turn at the most in every pass, to find out whether blocks are the same: along three axes, for the
    /// mean and each maximum.
    fn same(&self) -> u64 {
        let bricks = |field: &Field| field.spec.layout != Layout::Dense;
        let asked = bricks(&self.density) || self.other.as_ref().is_some_and(bricks);
        if asked { 3 * 3 * u64::from(BrickLayout::SAME) } else { 0 }
    }
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
        is_density(&self.density, p.dims)?;
        require!(self.other.is_none_or(|f| is_scalar(&f, p.dims)), "the second field differs from the first");
        let cells = p.coarse[..3].iter().try_fold(1u32, |n, &c| n.checked_mul(c));
        require!(cells.is_some_and(|n| n > 0), "{:?} coarse cells", p.coarse);
        require!(u64::from(self.axis()) <= self.out.len, "{} cells into {} places", self.axis(), self.out.len);
        require!(p.cell[..3].iter().all(|c| c.is_finite() && *c > 0.0), "coarse cells of {:?} voxels", p.cell);
        require!(p.cell[3].is_finite() && p.cell[3] >= 0.0, "a margin of {} cells", p.cell[3]);
        require!(p.row_begin < p.row_end, "rows {} to {}", p.row_begin, p.row_end);
        // Kernels count rows and probes with 32 bits.
        require!(self.rows() < Self::ALL_ROWS.into(), "cells of {} rows", self.rows());
        Ok(())
    }

    fn passes(&self, turns: u64) -> Result<Vec<Self>, String> {
        let (each, rows) = (self.turns(), self.rows());
        let turns = turns.saturating_sub(self.same());
        let most = turns / each;
        require!(
            most > 0,
            "one row of a coarse cell takes up to {each} turns of loops, and {turns} are allowed: smaller cells or \
             fewer probes need less"
        );
        let begins = (0..rows).step_by(usize::try_from(most).unwrap_or(usize::MAX));
        let pass = |begin: u64| {
            let end = begin.saturating_add(most);
            let mut pass = self.clone();
            // `validate` keeps rows below `ALL_ROWS`.
            (pass.params.row_begin, pass.params.row_end) =
                (begin as u32, if end >= rows { Self::ALL_ROWS } else { end as u32 });
            pass
        };
        Ok(begins.map(pass).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::{FieldSpec, ResourceId};

    fn reduce(probes: u32) -> Reduce {
        let spec = FieldSpec::dense([30, 20, 40], 1, FieldFormat::Scalar);
        Reduce {
            params: ReduceParams::new([30, 20, 40, 0], [3, 2, 4, probes], [10.0, 10.0, 10.0, 0.5]),
            density: Field { id: ResourceId(0), spec },
            other: None,
            out: Buf::new(ResourceId(1), 24),
        }
    }

    #[test]
    fn passes_take_every_row_once_and_keep_to_their_turns() {
        for probes in [0, 1, 15] {
            let reduce = reduce(probes);
            for turns in [reduce.turns(), 1000, 3001, u64::MAX] {
                let passes = reduce.passes(turns).unwrap();
                let mut next = 0;
                for pass in &passes {
                    assert_eq!(pass.validate(), Ok(()));
                    let (begin, end) = (pass.params.row_begin, pass.params.row_end);
                    assert_eq!(begin, next);
                    let rows = reduce.rows().min(end.into()) - u64::from(begin);
                    assert!(rows * reduce.turns() <= turns, "{turns} turns: {rows} rows");
                    next = end;
                }
                assert_eq!(next, Reduce::ALL_ROWS, "{turns} turns");
            }
            let error = reduce.passes(reduce.turns() - 1).unwrap_err();
            assert!(error.contains("one row"), "{error}");
        }
    }

    #[test]
    fn rows_hold_every_voxel_that_a_cell_touches() {
        // Ten voxels, five on each side, and those that the slack and the lookups between voxels add.
        assert_eq!(reduce(0).most(0), 25);
        // Never more than there are.
        assert_eq!(reduce(0).most(1), 20);
        assert_eq!((reduce(15).most(0), reduce(1).most(0)), (15, 12));
    }
}
