//! `path` as a benchmark.

use airlight::device::{Buf, DeviceError, Usage};
use airlight::glam::Vec3;
use airlight::light::Light;
use airlight::media::Phase;
use airlight::stage::{GridParams, LightRecord, Path, PathParams, PathTables, Reduce, ReduceParams, Stage};
use bytemuck::Zeroable;

use super::{EXTINCTION, Rig, View, count, four};
use crate::{DIMS, lattice};

/// Samples of a pixel.
const SAMPLES: u32 = 4;

impl Rig {
    /// `path` of all orders under a sun, Henyey–Greenstein. Its elements are the paths.
    pub(super) fn path(&mut self, view: &View) -> Result<(Stage, u64), DeviceError> {
        let (camera, grid) = (&view.camera, GridParams::new(&lattice()));
        let mut params = PathParams::zeroed();
        params.dims = grid.dims;
        [params.index_x, params.index_y, params.index_z] = grid.index;
        params.eye = four(lattice().world_to_index().transform_point3(camera.origin));
        [params.forward, params.right, params.up] = camera.axes().map(four);
        // Dense enough to scatter a few times.
        (params.extinction, params.densest) = ([16.0 * EXTINCTION; 4], 16.0 * EXTINCTION);
        params.albedo = [0.9; 4];
        let cells = DIMS.to_array().map(|d| d.div_ceil(8));
        params.majorant_cells = [cells[0], cells[1], cells[2], 8];
        (params.width, params.height, params.samples) = (camera.width, camera.height, SAMPLES);
        // Enough for every path to end.
        (params.turns, params.max_depth, params.fresh, params.light_floor) = (1 << 16, u32::MAX, 1, 1e-6);
        let sun = Light::directional(camera.up, Vec3::ONE).map_err(|e| DeviceError::Invalid(e.to_string()))?;
        let phase = Phase::HenyeyGreenstein { g: 0.5 };
        let tables = PathTables { phase: &phase, chances: vec![1.0], materials: Vec::new(), environment: None };
        tables.place(&mut params);
        params.lights = 1;
        let majorant: Buf<[f32; 2]> = self.make(count(cells), Usage::Work)?;
        let reduce = ReduceParams::new(grid.dims, [cells[0], cells[1], cells[2], 0], [8.0, 8.0, 8.0, 0.0]);
        self.run(&Stage::Reduce(Reduce { params: reduce, density: self.density, other: None, out: majorant }))?;
        let pixels = view.rays.len() as u64;
        let stage = Path {
            params,
            density: self.density,
            scattering: None,
            seen: None,
            emission: None,
            emission_color: None,
            environment: None,
            majorant,
            lights: Some(self.fill(&LightRecord::of(&[sun], camera.origin))?),
            tables: self.fill(&tables.values())?,
            mesh: None,
            background: None,
            sums: self.make(3 * pixels, Usage::Output)?,
            paths: self.make(pixels, Usage::Work)?,
            film: self.make(2 * pixels, Usage::Output)?,
        };
        Ok((Stage::Path(stage), u64::from(SAMPLES) * pixels))
    }
}
