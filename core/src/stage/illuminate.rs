//! `illuminate`: moments of the unscattered light of analytic lights at the cells of a coarse grid.
//!
//! At a cell's centre each light brings E from the direction ω: falloff and cone, times 0 where `visibility` is 1 and a
//! triangle of the mesh stands between, times e^(-`extinction` · column), the column marched to the light. The output is
//!
//! M\[k\]\[c\] = Σ E\[c\] · Y_k(ω).
//!
//! 1/r² is floored at `light_floor`, for which a part of the cells' size is right: the mean of 1/r² over a ball is 3/R².
//! Places of lights are from the box's centre.
//!
//! The output is planes of a value a cell, x fastest. The work axis is the cells. A pass takes some lights and adds to what
//! the ones before left.

use crate::basis::SphericalHarmonics;
use crate::device::{Binding, Buf, Field, FieldFormat};
use crate::kernel_struct;
use crate::stage::grid::{covers, is_density, most_steps};
use crate::stage::trace::holds;
use crate::stage::{Kernel, LightRecord, MeshRecord, require};

kernel_struct! {
    /// Parameters of `illuminate`.
    pub struct IlluminateParams {
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
        /// The box's centre from the mesh's origin; the mesh's extent: metres.
        mesh_eye: F32x4,
        /// Extinction per unit of density, 1/m, RGB; unused.
        extinction: F32x4,
        /// Occupancy cells along x, y, z; voxels of a cell's side.
        occupancy_cells: U32x4,
        /// Lights.
        lights: U32,
        /// First light of this pass.
        light_begin: U32,
        /// One past the last light of this pass.
        light_end: U32,
        /// Boxes of the mesh.
        nodes: U32,
        /// 1 where triangles stand in the way of light.
        visibility: U32,
        /// Bands of the moments.
        bands: U32,
        /// Channels of the moments: 1 or 3.
        channels: U32,
        /// Floor of r² in 1/r², m².
        light_floor: F32,
        /// Lights that are spots: kernels that run both sides of conditions leave cones out where there is none.
        spots: U32,
        /// Unused.
        unused_0: U32,
        /// Unused.
        unused_1: U32,
        /// Unused.
        unused_2: U32,
    }
}

/// The stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Illuminate {
    /// Parameters.
    pub params: IlluminateParams,
    /// Density ρ.
    pub density: Field,
    /// Mean and maximum of each occupancy cell, from `reduce`.
    pub occupancy: Option<Buf<[f32; 2]>>,
    /// Lights, from the box's centre.
    pub lights: Buf<LightRecord>,
    /// Constants of spherical harmonics.
    pub tables: Buf<f32>,
    /// Boxes and triangles.
    pub mesh: Option<Buf<MeshRecord>>,
    /// M, laid out \[coefficient\]\[channel\]\[cell\].
    pub out: Buf<f32>,
}

impl Illuminate {
    /// The most turns of all loops for a light.
    fn turns(&self) -> u64 {
        let p = &self.params;
        let column = most_steps(p.dims, [p.index_x, p.index_y, p.index_z], p.cell[3]);
        let way = match self.mesh {
            Some(mesh) if p.visibility == 1 => MeshRecord::turns(p.nodes.into(), p.nodes, mesh.len),
            _ => 0,
        };
        let bands = u64::from(p.bands);
        column.saturating_add(way).saturating_add(1 + 4 * bands * bands + 2 * bands)
    }
}

impl Kernel for Illuminate {
    const NAME: &'static str = "illuminate";

    fn params(&self) -> &[u8] {
        bytemuck::bytes_of(&self.params)
    }

    fn bindings(&self) -> Vec<Binding> {
        vec![
            Binding::sample("density", FieldFormat::Scalar, Some(self.density)),
            Binding::read("occupancy", self.occupancy),
            Binding::read("lights", Some(self.lights)),
            Binding::read("tables", Some(self.tables)),
            Binding::read("mesh", self.mesh),
            Binding::write("moments", Some(self.out)),
        ]
    }

    fn axis(&self) -> u32 {
        self.params.cells[..3].iter().product()
    }

    fn validate(&self) -> Result<(), String> {
        let p = &self.params;
        is_density(&self.density, p.dims)?;
        let cells = p.cells[..3].iter().try_fold(1u32, |n, &c| n.checked_mul(c));
        require!(cells.is_some_and(|n| n > 0), "{:?} cells", p.cells);
        require!(p.cell.iter().all(|c| c.is_finite() && *c > 0.0), "cells and step {:?}", p.cell);
        require!((1..=SphericalHarmonics::DEVICE_BANDS).contains(&p.bands), "{} bands", p.bands);
        require!([1, 3].contains(&p.channels), "moments of {} channels", p.channels);
        // Kernels count the output's values in 32 bits.
        let values = u64::from(self.axis()) * u64::from(p.bands * p.bands * p.channels);
        require!(u32::try_from(values).is_ok() && self.out.len >= values, "{} places for {values}", self.out.len);
        require!(self.tables.len >= u64::from(p.bands * (p.bands + 1)), "tables of {} values", self.tables.len);
        if let Some(occupancy) = self.occupancy {
            covers("occupancy", occupancy, p.occupancy_cells, p.dims)?;
        }
        let lights = p.light_begin..p.light_end;
        require!(lights.start <= lights.end && lights.end <= p.lights, "lights {lights:?} of {}", p.lights);
        require!(self.lights.len >= p.lights.into(), "fewer than {} lights", p.lights);
        require!(p.visibility == 0 || self.mesh.is_some(), "surfaces shadow lights, and there is no mesh");
        self.mesh.map_or(Ok(()), |mesh| holds(mesh, p.nodes))
    }

    fn passes(&self, turns: u64) -> Result<Vec<Self>, String> {
        let (each, lights) = (self.turns(), self.params.lights);
        if u64::from(lights).saturating_mul(each) <= turns {
            return Ok(vec![self.clone()]);
        }
        let some = turns / each;
        require!(
            some > 0,
            "a light at a cell takes up to {each} turns of loops, and {turns} are allowed: fewer triangles, a longer step or \
             a smaller medium need less"
        );
        let pass = |begin: u32| {
            let mut pass = self.clone();
            let end = u64::from(begin).saturating_add(some).min(lights.into());
            (pass.params.light_begin, pass.params.light_end) = (begin, end as u32);
            pass
        };
        Ok((0..lights).step_by(some.min(lights.into()) as usize).map(pass).collect())
    }
}
