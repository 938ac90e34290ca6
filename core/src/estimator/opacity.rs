//! `opacity`: every analytic light at every view sample, shadowed by a field that spreads from cell to cell (Giroud and
//! Biri 2011), with what [`stage::propagate`](crate::stage::propagate) says.

use glam::DVec3;

use super::direct::scattered;
use super::{Estimator, LightDepth, LightShadow, MediumFields, Sources, grid};
use crate::device::{FieldFormat, FieldSpec};
use crate::exec::{Plan, RenderError};
use crate::scene::{Opacity, Scene, Scheme};
use crate::stage::propagate::{faces, scheme, steps};
use crate::stage::{LightPlace, Propagate, PropagateParams, Reduce, ReduceParams, Stage};

impl Estimator for Opacity {
    fn name(&self) -> &'static str {
        "opacity"
    }

    fn plan<'a>(
        &'a self,
        scene: &'a Scene,
        medium: &MediumFields,
        plan: &mut Plan<'a>,
        sources: &mut Sources,
    ) -> Result<(), RenderError> {
        sources.lights =
            scattered(scene, sources, plan, |plan| LightShadow::Field(propagate(*self, scene, medium, plan)));
        Ok(())
    }
}

impl Opacity {
    /// Cells along each axis of a box of `lengths` (metres): `cells` along the longest.
    pub fn grid(&self, lengths: DVec3) -> [u32; 3] {
        grid(self.cells, lengths)
    }
}

impl Scheme {
    /// Its number in kernels: a constant of [`scheme`].
    pub fn number(self) -> u32 {
        match self {
            Self::ShortCharacteristics => scheme::SHORT_CHARACTERISTICS,
            Self::Metric => scheme::METRIC,
            Self::Published => scheme::PUBLISHED,
        }
    }
}

/// Plans the field of the scene's lights.
pub(super) fn propagate<'a>(
    options: Opacity,
    scene: &'a Scene,
    medium: &MediumFields,
    plan: &mut Plan<'a>,
) -> LightDepth {
    let lattice = scene.medium.lattice();
    let cells = options.grid(lattice.edges() * lattice.dims().as_dvec3());
    let count = cells.iter().fold(1u64, |n, &c| n.saturating_mul(c.into()));
    let side = |a: usize| medium.grid.dims[a] as f32 / cells[a] as f32;
    let number = options.scheme.number();
    let mean = options.scheme == Scheme::ShortCharacteristics;
    let occupancy = (!mean).then(|| {
        let out = plan.work("light means", count);
        plan.stage(Stage::Reduce(Reduce {
            params: ReduceParams::new(
                medium.grid.dims,
                [cells[0], cells[1], cells[2], 0],
                [side(0), side(1), side(2), 0.0],
            ),
            density: medium.density,
            other: None,
            out,
        }));
        out
    });
    let places: Vec<_> = scene.lights.iter().map(|light| LightPlace::new(light, lattice, cells, number)).collect();
    let lights = places.len() as u32;
    let layers = lights.div_ceil(PropagateParams::LANES);
    let steps = steps(&places, cells, number);
    let mut params: PropagateParams = bytemuck::Zeroable::zeroed();
    params.dims = medium.grid.dims;
    [params.world_x, params.world_y, params.world_z] = medium.grid.world;
    params.cells = [cells[0], cells[1], cells[2], layers];
    params.cell = [side(0), side(1), side(2), medium.step];
    (params.lights, params.steps, params.scheme) = (lights, steps, number);
    // Too many are refused with the stage.
    params.items = PropagateParams::most_items(cells, lights, number).unwrap_or(0);
    let faces = mean.then(|| {
        let content: Vec<u8> = bytemuck::cast_slice(&places).to_vec();
        let (places, len) = (places.clone(), u64::from(steps) * u64::from(lights));
        plan.upload("light faces", len, &(content, cells), move || faces(&places, cells))
    });
    let values = plan.work("depths of lights", count.saturating_mul(lights.into()));
    let out = plan.work("light depths", count.saturating_mul((layers * PropagateParams::LANES).into()));
    let lights = plan.table("light places", places);
    let density = medium.density;
    plan.stage(Stage::Propagate(Propagate { params, density, occupancy, lights, faces, values, out }));
    let spec = FieldSpec::dense(cells, layers, FieldFormat::Rgba);
    LightDepth { field: plan.publish("light depth", out, spec), mean }
}
