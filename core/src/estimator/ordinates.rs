//! Sweeps over a coarse grid, as several estimators plan them.

use std::hash::Hash;

use bytemuck::Zeroable;
use glam::DVec3;

use super::{MediumFields, MeshBuffers};
use crate::device::Buf;
use crate::exec::Plan;
use crate::scene::Scene;
use crate::stage::{Coarsen, CoarsenParams, Obstruct, ObstructParams, Stage, Sweep, SweepDirection, SweepParams};

/// A coarse grid over the medium, along whose cells light is swept.
pub(super) struct Ordinates<'a> {
    pub(super) scene: &'a Scene,
    pub(super) medium: MediumFields,
    pub(super) cells: [u32; 3],
    /// Which neighbours lie behind surfaces.
    pub(super) obstructed: Option<Buf<u32>>,
}

/// What a sweep carries, and what becomes of it.
#[derive(Clone, Copy)]
pub(super) struct Carried {
    /// From [`Ordinates::coarsen`].
    pub(super) optics: Buf<f32>,
    pub(super) directions: Buf<SweepDirection>,
    /// Channels of the radiance.
    pub(super) channels: u32,
    /// Whether the extinction of one channel serves all.
    pub(super) grey: bool,
    /// Radiance that enters the box.
    pub(super) boundary: f32,
    /// Whether the medium's own light is carried.
    pub(super) emits: bool,
    /// Moments that are scattered with their weights, and their coefficients.
    pub(super) sources: Option<(Buf<f32>, Buf<f32>, u32)>,
    /// W with its channels.
    pub(super) weights: (Buf<f32>, u32),
    pub(super) coefficients: u32,
    /// Whether moments are planes of a value a cell.
    pub(super) planar: bool,
}

/// Bytes of the radiance of a batch, which sets how many directions are swept at a time: enough to keep a device busy.
const BATCH: u64 = 32 << 20;

impl<'a> Ordinates<'a> {
    pub(super) fn count(&self) -> u64 {
        self.cells.iter().map(|&n| u64::from(n)).product()
    }

    /// Voxels of a cell along x, y and z, and a fourth value.
    pub(super) fn cell(&self, w: f32) -> [f32; 4] {
        let side = |a: usize| self.medium.grid.dims[a] as f32 / self.cells[a] as f32;
        [side(0), side(1), side(2), w]
    }

    /// Finds out which neighbours lie behind the surfaces of `mesh`.
    pub(super) fn obstruct(&mut self, slot: &str, mesh: Option<MeshBuffers>, plan: &mut Plan<'a>) {
        let Some(mesh) = mesh else { return };
        let (lattice, grid) = (self.scene.medium.lattice(), &self.medium.grid);
        let [x, y, z] = self.cells;
        let mut params = ObstructParams::zeroed();
        params.dims = grid.dims;
        [params.world_x, params.world_y, params.world_z] = grid.world;
        (params.cells, params.cell) = ([x, y, z, 0], self.cell(0.0));
        params.mesh_eye = mesh.from_origin(lattice.center());
        (params.nodes, params.neighbor_end) = (mesh.nodes, Obstruct::NEIGHBORS);
        let out = plan.work(slot, self.count());
        plan.stage(Stage::Obstruct(Obstruct { params, mesh: mesh.records, out }));
        self.obstructed = Some(out);
    }

    /// What the cells do to light, where the share `forward` of scattered light goes on.
    pub(super) fn coarsen(&self, slot: &str, forward: f32, plan: &mut Plan<'a>) -> Buf<f32> {
        let (optics, medium) = (&self.scene.optics, &self.medium);
        let [x, y, z] = self.cells;
        let params = CoarsenParams {
            dims: medium.grid.dims,
            cells: [x, y, z, 0],
            cell: self.cell(0.0),
            extinction: optics.extinction.extend(0.0).to_array(),
            albedo: optics.albedo.extend(0.0).to_array(),
            emission: optics.emission.extend(forward).to_array(),
        };
        let out = plan.work(slot, self.count().saturating_mul(Coarsen::PLANES.into()));
        plan.stage(Stage::Coarsen(Coarsen {
            params,
            density: medium.density,
            scattering: medium.scattering,
            emission: medium.emission.density(),
            emission_color: medium.emission.color(),
            out,
        }));
        out
    }

    /// The ways along `count` directions that depend on `content` alone.
    pub(super) fn directions(
        &self,
        slot: &str,
        count: u32,
        content: &impl Hash,
        make: impl FnOnce() -> Vec<DVec3> + 'a,
        plan: &mut Plan<'a>,
    ) -> Buf<SweepDirection> {
        let (lattice, cells) = (self.scene.medium.lattice(), self.cells);
        let GridKey(grid) = GridKey::of(&self.medium);
        plan.upload(slot, count.into(), &(content, cells, grid), move || {
            make().into_iter().map(|d| SweepDirection::new(d, lattice, cells)).collect()
        })
    }

    /// The stage that sweeps and leaves `moments`.
    pub(super) fn sweep(&self, slot: &str, of: Carried, moments: Buf<f32>, plan: &mut Plan<'a>) -> Sweep {
        let [x, y, z] = self.cells;
        let each = self.count().saturating_mul(u64::from(of.channels) * 4).max(1);
        let directions = of.directions.len as u32;
        let batch = (BATCH.min(plan.binding_bytes()) / each).clamp(1, directions.into()) as u32;
        let mut params = SweepParams::zeroed();
        params.cells = [x, y, z, x.max(y).max(z)];
        (params.directions, params.batch) = (directions, batch);
        // Too many are refused with the stage.
        params.plane = y.saturating_mul(z).max(x.saturating_mul(z)).max(x.saturating_mul(y));
        (params.channels, params.grey, params.emits) = (of.channels, of.grey.into(), of.emits.into());
        params.source_coefficients = of.sources.map_or(0, |(_, _, coefficients)| coefficients);
        (params.coefficients, params.weight_channels) = (of.coefficients, of.weights.1);
        (params.planar, params.boundary) = (of.planar.into(), of.boundary);
        let room = self.count().saturating_mul(u64::from(batch) * u64::from(of.channels));
        Sweep {
            params,
            optics: of.optics,
            directions: of.directions,
            sources: of.sources.map(|(sources, ..)| sources),
            source_weights: of.sources.map(|(_, weights, _)| weights),
            weights: of.weights.0,
            obstructed: self.obstructed,
            radiance: plan.work(&format!("{slot} radiance"), room),
            moments,
        }
    }
}

/// What ways through a lattice depend on.
struct GridKey(([u32; 4], [[u32; 4]; 3]));

impl GridKey {
    fn of(medium: &MediumFields) -> Self {
        Self((medium.grid.dims, medium.grid.index.map(|row| row.map(f32::to_bits))))
    }
}
