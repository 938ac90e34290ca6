//! What `path` reads, and paths on their way, as its kernel holds them.

use airlight_core::device::DeviceError;
use airlight_core::glam::Vec3;
use airlight_core::stage::{LightRecord, Path, PathParams, PathRecord};

use crate::device::Readable;
use crate::kernels::field::{Colors, Scalars};
use crate::kernels::mesh::Mesh;
use crate::kernels::phase::Phase;
use crate::kernels::random::Draws;
use crate::kernels::sky::Sky;
use crate::kernels::walk::{Ground, Walk};

/// What `path` reads.
pub(crate) struct PathInputs<'a> {
    pub(crate) p: &'a PathParams,
    pub(crate) ground: Ground<'a>,
    pub(crate) density: Scalars<'a>,
    pub(crate) scattering: Option<Colors<'a>>,
    pub(crate) seen: Option<Colors<'a>>,
    pub(crate) emission: Option<Scalars<'a>>,
    pub(crate) emission_color: Option<Colors<'a>>,
    pub(crate) environment: Option<Sky<'a>>,
    pub(crate) lights: &'a [LightRecord],
    pub(crate) tables: &'a [f32],
    pub(crate) bends: &'a [f32],
    pub(crate) materials: &'a [f32],
    pub(crate) phase: Phase<'a>,
    pub(crate) mesh: Option<Mesh<'a>>,
    pub(crate) background: &'a [[f32; 4]],
}

impl<'a> PathInputs<'a> {
    /// What a stage binds.
    pub(crate) fn new(stage: &'a Path, read: Readable<'a>) -> Result<Self, DeviceError> {
        let p = &stage.params;
        let [x, y, z, _] = p.dims;
        let colors = |field| match field {
            Some(field) => Ok(Some(Colors::new(bytemuck::cast_slice(read.field(field)?), [x, y, z, 1]))),
            None => Ok::<_, DeviceError>(None),
        };
        let tables = read.buf(stage.tables)?;
        Ok(Self {
            p,
            ground: Ground::new(
                p.dims,
                [p.index_x, p.index_y, p.index_z],
                p.majorant_cells,
                read.buf(stage.majorant)?,
                [p.densest, p.least],
            )?,
            density: read.scalars(stage.density)?,
            scattering: colors(stage.scattering)?,
            seen: colors(stage.seen)?,
            emission: match stage.emission {
                Some(field) => Some(read.scalars(field)?),
                None => None,
            },
            emission_color: colors(stage.emission_color)?,
            environment: Sky::of(read, stage.environment, [p.environment_width, p.environment_height], p.environment)?,
            lights: &read.opt(stage.lights)?[..p.lights as usize],
            tables,
            bends: tables.get(p.bends_at as usize..).unwrap_or_default(),
            materials: tables.get(p.materials_at as usize..).unwrap_or_default(),
            phase: Phase {
                kind: p.phase_kind,
                lobes: p.phase,
                table: &tables[p.phase_at as usize..][..p.phase_size as usize],
            },
            mesh: match stage.mesh {
                Some(mesh) => Some(Mesh::new(read.buf(mesh)?, p.nodes)),
                None => None,
            },
            background: read.opt(stage.background)?,
        })
    }
}

/// A path on its way, as [`PathRecord`] keeps it.
#[derive(Clone, Copy)]
pub(crate) struct Way {
    pub(crate) mode: u32,
    pub(crate) place: Vec3,
    pub(crate) direction: Vec3,
    pub(crate) next: Vec3,
    pub(crate) density: f32,
    pub(crate) weight: Vec3,
    pub(crate) total: f32,
    pub(crate) light: Vec3,
    pub(crate) chosen: f32,
    pub(crate) pending: Vec3,
    pub(crate) stopped: f32,
    pub(crate) ratio: Vec3,
    pub(crate) stopped_at: f32,
    pub(crate) through: Vec3,
    pub(crate) surface: f32,
    pub(crate) depth: u32,
    pub(crate) triangle: u32,
}

/// The path that a record keeps.
pub(crate) fn resume(of: &PathRecord) -> Way {
    let xyz = |v: [f32; 4]| Vec3::new(v[0], v[1], v[2]);
    Way {
        mode: of.count[0],
        place: xyz(of.place),
        direction: xyz(of.way),
        next: xyz(of.next),
        density: of.next[3],
        weight: xyz(of.weight),
        total: of.weight[3],
        light: xyz(of.light),
        chosen: of.light[3],
        pending: xyz(of.pending),
        stopped: of.pending[3],
        ratio: xyz(of.ratio),
        stopped_at: of.ratio[3],
        through: xyz(of.through),
        surface: of.through[3],
        depth: of.count[2],
        triangle: of.count[3],
    }
}

/// What a record keeps of a path.
pub(crate) fn keep(of: &Way, on: &Walk, numbers: &Draws) -> PathRecord {
    PathRecord {
        place: of.place.extend(on.t).to_array(),
        way: of.direction.extend(on.far).to_array(),
        next: of.next.extend(of.density).to_array(),
        weight: of.weight.extend(of.total).to_array(),
        light: of.light.extend(of.chosen).to_array(),
        pending: of.pending.extend(of.stopped).to_array(),
        ratio: of.ratio.extend(of.stopped_at).to_array(),
        through: of.through.extend(of.surface).to_array(),
        cell: [on.cell[0] as u32, on.cell[1] as u32, on.cell[2] as u32, on.over.into()],
        count: [of.mode, numbers.next, of.depth, of.triangle],
    }
}
