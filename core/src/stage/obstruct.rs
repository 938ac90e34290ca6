//! `obstruct`: which of a cell's neighbours lie behind surfaces.
//!
//! From the centre of each cell of a coarse grid a ray goes to the centre of each of its 26 neighbours, those beyond the box
//! included. Bit (z + 1) · 9 + (y + 1) · 3 + (x + 1) of the cell's word is set where a triangle of the mesh stands between it
//! and the neighbour x, y, z cells on. [`Sweep`](super::Sweep) lets no light through there.
//!
//! The work axis is the cells, x fastest. A pass takes some neighbours and adds to the bits that the ones before left.

use crate::device::{Binding, Buf};
use crate::kernel_struct;
use crate::stage::trace::holds;
use crate::stage::{Kernel, MeshRecord, require};

kernel_struct! {
    /// Parameters of `obstruct`.
    pub struct ObstructParams {
        /// Voxels along x, y, z; unused.
        dims: U32x4,
        /// Row of the linear map from voxels to metres.
        world_x: F32x4,
        /// See `world_x`.
        world_y: F32x4,
        /// See `world_x`.
        world_z: F32x4,
        /// Cells along x, y, z; unused.
        cells: U32x4,
        /// Voxels of a cell along x, y, z; unused.
        cell: F32x4,
        /// The box's centre from the mesh's origin; the mesh's extent: metres.
        mesh_eye: F32x4,
        /// Boxes of the mesh.
        nodes: U32,
        /// First neighbour of this pass.
        neighbor_begin: U32,
        /// One past the last neighbour of this pass.
        neighbor_end: U32,
        /// Unused.
        unused: U32,
    }
}

/// The stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstruct {
    /// Parameters.
    pub params: ObstructParams,
    /// Boxes and triangles.
    pub mesh: Buf<MeshRecord>,
    /// A word a cell.
    pub out: Buf<u32>,
}

impl Obstruct {
    /// A cell and its neighbours.
    pub const NEIGHBORS: u32 = 27;

    /// The most turns of all loops for a neighbour.
    fn turns(&self) -> u64 {
        MeshRecord::turns(self.params.nodes.into(), self.params.nodes, self.mesh.len).saturating_add(1)
    }
}

impl Kernel for Obstruct {
    const NAME: &'static str = "obstruct";

    fn params(&self) -> &[u8] {
        bytemuck::bytes_of(&self.params)
    }

    fn bindings(&self) -> Vec<Binding> {
        vec![Binding::read("mesh", Some(self.mesh)), Binding::write("obstructed", Some(self.out)).in_parts::<u32>(1)]
    }

    fn axis(&self) -> u32 {
        self.params.cells[..3].iter().product()
    }

    fn validate(&self) -> Result<(), String> {
        let p = &self.params;
        let cells = p.cells[..3].iter().try_fold(1u32, |n, &c| n.checked_mul(c));
        require!(cells.is_some_and(|n| n > 0), "{:?} cells", p.cells);
        require!(p.cell[..3].iter().all(|c| c.is_finite() && *c > 0.0), "cells of {:?} voxels", p.cell);
        require!(self.out.len >= self.axis().into(), "{} places for {} cells", self.out.len, self.axis());
        let neighbors = p.neighbor_begin..p.neighbor_end;
        require!(!neighbors.is_empty() && neighbors.end <= Self::NEIGHBORS, "neighbours {neighbors:?}");
        holds(self.mesh, p.nodes)
    }

    fn passes(&self, turns: u64) -> Result<Vec<Self>, String> {
        let (each, all) = (self.turns(), Self::NEIGHBORS);
        let some = (turns / each).min(all.into()) as usize;
        require!(
            some > 0,
            "a way to a neighbour takes up to {each} turns of loops, and {turns} are allowed: fewer triangles need less"
        );
        let pass = |begin: u32| {
            let mut pass = self.clone();
            (pass.params.neighbor_begin, pass.params.neighbor_end) = (begin, all.min(begin + some as u32));
            pass
        };
        Ok((0..all).step_by(some).map(pass).collect())
    }
}
