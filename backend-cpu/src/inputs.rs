//! What a march reads, as its kernel holds it.

use airlight_core::device::DeviceError;
use airlight_core::stage::{LightRecord, March, MarchParams};

use crate::device::Readable;
use crate::kernels::field::{Colors, Scalars};
use crate::kernels::mesh::Mesh;
use crate::kernels::phase::Phase;
use crate::kernels::sample::Occupancy;
use crate::kernels::sky::Sky;

/// What a march reads.
pub(crate) struct Inputs<'a> {
    pub(crate) p: &'a MarchParams,
    pub(crate) density: Scalars<'a>,
    pub(crate) scattering: Option<Colors<'a>>,
    pub(crate) emission: Option<Scalars<'a>>,
    pub(crate) emission_color: Option<Colors<'a>>,
    pub(crate) occupancy: Option<Occupancy<'a>>,
    pub(crate) in_scatter: Option<Colors<'a>>,
    pub(crate) scattered: Option<Colors<'a>>,
    pub(crate) light_depth: Option<Colors<'a>>,
    pub(crate) lights: &'a [LightRecord],
    pub(crate) phase: Phase<'a>,
    pub(crate) tables: &'a [f32],
    pub(crate) environment: Option<Sky<'a>>,
    pub(crate) surface: &'a [[f32; 4]],
    pub(crate) mesh: Mesh<'a>,
    pub(crate) shadow_map: &'a [f32],
    pub(crate) grey: bool,
    /// Whether there is something that scatters, and light that it may scatter.
    pub(crate) lit: bool,
    pub(crate) emits: bool,
    /// Whether one channel serves all, and what scatters is a part of what stops.
    pub(crate) plain: bool,
}

impl<'a> Inputs<'a> {
    /// What a stage binds.
    pub(crate) fn new(stage: &'a March, read: Readable<'a>) -> Result<Self, DeviceError> {
        let p = &stage.params;
        let density = read.scalars(stage.density)?;
        let tables = read.buf(stage.tables)?;
        let [x, y, z, _] = p.dims;
        let colors = |field| match field {
            Some(field) => Ok(Some(Colors::new(bytemuck::cast_slice(read.field(field)?), [x, y, z, 1]))),
            None => Ok::<_, DeviceError>(None),
        };
        let grey = [p.extinction, p.light_extinction].iter().all(|e| e[0] == e[1] && e[1] == e[2]);
        let emits = p.emission[..3].iter().any(|&e| e != 0.0);
        Ok(Self {
            p,
            density,
            scattering: colors(stage.scattering)?,
            emission: match stage.emission {
                Some(field) => Some(read.scalars(field)?),
                None => None,
            },
            emission_color: colors(stage.emission_color)?,
            occupancy: match stage.occupancy {
                Some(buf) => Some(Occupancy::new(read.buf(buf)?, p.occupancy_cells)),
                None => None,
            },
            in_scatter: match stage.in_scatter {
                Some(field) => Some(Colors::new(bytemuck::cast_slice(read.field(field)?), p.cells)),
                None => None,
            },
            scattered: match stage.scattered {
                Some(field) => Some(Colors::new(bytemuck::cast_slice(read.field(field)?), p.scattered_cells)),
                None => None,
            },
            light_depth: match stage.light_depth {
                Some(field) => Some(Colors::new(bytemuck::cast_slice(read.field(field)?), p.light_cells)),
                None => None,
            },
            lights: &read.opt(stage.lights)?[..p.lights as usize],
            phase: Phase {
                kind: p.phase_kind,
                lobes: p.phase,
                table: &tables[p.phase_at as usize..][..p.phase_size as usize],
            },
            tables,
            environment: Sky::of(read, stage.environment, [p.environment_width, p.environment_height], p.environment)?,
            surface: read.opt(stage.surface)?,
            mesh: Mesh::new(read.opt(stage.mesh)?, p.nodes),
            shadow_map: read.opt(stage.shadow_map)?,
            lit: p.albedo[0] + p.albedo[1] + p.albedo[2] > 0.0
                && (stage.in_scatter.is_some() || stage.scattered.is_some() || p.lights > 0),
            emits,
            grey,
            plain: grey && !emits && stage.scattering.is_none(),
        })
    }
}
