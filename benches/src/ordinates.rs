//! The stages of sweeps.

use airlight::basis::{SphericalHarmonics, healpix, pixel_integrals, recurrence_table};
use airlight::device::{Buf, DeviceError, Usage};
use airlight::glam::{DVec3, Vec3};
use airlight::light::Light;
use airlight::stage::{
    Coarsen, CoarsenParams, GridParams, Illuminate, IlluminateParams, LightRecord, Obstruct, ObstructParams, Stage,
    Sweep, SweepDirection, SweepParams,
};
use bytemuck::Zeroable;

use crate::stages::{BANDS, CELLS, EXTINCTION, NSIDE, Rig, count, waves};
use crate::{DIMS, lattice};

impl Rig {
    /// `coarsen` to the cells. Its elements are the voxels.
    pub(crate) fn coarsen(&mut self) -> Result<(Stage, u64), DeviceError> {
        self.cells().map(|stage| (Stage::Coarsen(stage), lattice().voxels()))
    }

    fn cells(&mut self) -> Result<Coarsen, DeviceError> {
        let side = |a: usize| DIMS[a] as f32 / CELLS[a] as f32;
        let params = CoarsenParams {
            dims: GridParams::new(&lattice()).dims,
            cells: [CELLS[0], CELLS[1], CELLS[2], 0],
            cell: [side(0), side(1), side(2), 0.0],
            extinction: [EXTINCTION; 4],
            albedo: [0.9; 4],
            emission: [0.0; 4],
        };
        let out = self.make(count(CELLS) * u64::from(Coarsen::PLANES), Usage::Work)?;
        Ok(Coarsen { params, density: self.density, scattering: None, emission: None, emission_color: None, out })
    }

    /// `illuminate` by one light on 3 bands. Its elements are the cells.
    pub(crate) fn illuminate(&mut self) -> Result<(Stage, u64), DeviceError> {
        let (lattice, grid) = (lattice(), GridParams::new(&lattice()));
        let side = |a: usize| DIMS[a] as f32 / CELLS[a] as f32;
        let mut params = IlluminateParams::zeroed();
        params.dims = grid.dims;
        [params.index_x, params.index_y, params.index_z] = grid.index;
        [params.world_x, params.world_y, params.world_z] = grid.world;
        params.cells = [CELLS[0], CELLS[1], CELLS[2], 0];
        params.cell = [side(0), side(1), side(2), lattice.shortest_edge() as f32];
        params.extinction = [EXTINCTION; 4];
        (params.lights, params.light_end, params.bands, params.channels) = (1, 1, BANDS, 1);
        params.light_floor = 1e-4;
        let sun = Light::Directional { to_light: DVec3::new(0.4, 0.8, -0.3).normalize(), irradiance: Vec3::ONE };
        let stage = Illuminate {
            params,
            density: self.density,
            occupancy: None,
            lights: self.fill(&LightRecord::of(&[sun], lattice.center()))?,
            tables: self.fill(&recurrence_table(BANDS))?,
            mesh: None,
            out: self.make(count(CELLS) * u64::from(BANDS * BANDS), Usage::Work)?,
        };
        Ok((Stage::Illuminate(stage), count(CELLS)))
    }

    /// `obstruct` by a floor of some thousand triangles. Its elements are the cells.
    pub(crate) fn obstruct(&mut self) -> Result<(Stage, u64), DeviceError> {
        let (lattice, grid, mesh) = (lattice(), GridParams::new(&lattice()), waves(64));
        let hierarchy = mesh.hierarchy().expect("the floor has triangles");
        let side = |a: usize| DIMS[a] as f32 / CELLS[a] as f32;
        let mut params = ObstructParams::zeroed();
        params.dims = grid.dims;
        [params.world_x, params.world_y, params.world_z] = grid.world;
        params.cells = [CELLS[0], CELLS[1], CELLS[2], 0];
        params.cell = [side(0), side(1), side(2), 0.0];
        params.mesh_eye = (lattice.center() - hierarchy.origin()).as_vec3().extend(hierarchy.extent()).to_array();
        (params.nodes, params.neighbor_end) = (hierarchy.nodes(), Obstruct::NEIGHBORS);
        let out = self.make(count(CELLS), Usage::Work)?;
        let stage = Obstruct { params, mesh: self.fill(hierarchy.records())?, out };
        Ok((Stage::Obstruct(stage), count(CELLS)))
    }

    /// `sweep` of light of one channel that is scattered on 3 bands, along 48 directions. Its elements are the cells times
    /// the directions.
    pub(crate) fn sweep(&mut self) -> Result<(Stage, u64), DeviceError> {
        let (cells, directions, coefficients) = (count(CELLS), 12 * NSIDE * NSIDE, BANDS * BANDS);
        let coarsen = self.cells()?;
        let optics: Buf<f32> = coarsen.out;
        self.run(&Stage::Coarsen(coarsen))?;
        let lattice = lattice();
        let ways: Vec<_> =
            healpix::directions(NSIDE).into_iter().map(|d| SweepDirection::new(d, &lattice, CELLS)).collect();
        let [x, y, z] = CELLS;
        let mut params = SweepParams::zeroed();
        params.cells = [x, y, z, x.max(y).max(z)];
        (params.directions, params.batch) = (directions, directions);
        params.plane = (y * z).max(x * z).max(x * y);
        (params.channels, params.grey, params.planar) = (1, 1, 1);
        (params.source_coefficients, params.coefficients, params.weight_channels) = (coefficients, coefficients, 1);
        let harmonics = SphericalHarmonics::new(BANDS).expect("bands that devices have");
        let weights: Vec<f32> = pixel_integrals(NSIDE, &harmonics).iter().map(|&v| v as f32).collect();
        let values = cells * u64::from(coefficients);
        let sources: Vec<f32> = (0..values).map(|n| (n % 17) as f32 / 17.0).collect();
        let stage = Sweep {
            params,
            optics,
            directions: self.fill(&ways)?,
            sources: Some(self.fill(&sources)?),
            source_weights: Some(self.fill(&weights)?),
            weights: self.fill(&weights)?,
            obstructed: None,
            radiance: self.make(cells * u64::from(directions), Usage::Work)?,
            moments: self.make(values, Usage::Work)?,
        };
        Ok((Stage::Sweep(stage), cells * u64::from(directions)))
    }
}
