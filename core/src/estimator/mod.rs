//! Estimators: ways to know the in-scattered radiance J(x, d) at a point.
//!
//! An estimator plans the stages that prepare its J and adds what the march shall read to [`Sources`].

mod basis_lights;
mod direct;
mod local;
mod opacity;
mod ordinates;
mod records;
mod scatter;
mod sweeps;
mod transfer;

use glam::{DVec3, Vec3};

pub(crate) use basis_lights::{BasisLights, Batch, TOGETHER};
pub(crate) use transfer::Relit;

use crate::device::{Buf, Field};
use crate::exec::{Plan, RenderError};
use crate::scene::{Local, Scene};
use crate::stage::{GridParams, LightRecord, MaterialRecord, MeshRecord};

/// Y_0 of the spherical harmonics, 1/√4π.
const Y0: f64 = 0.282_094_791_773_878_14;

/// The medium on the device, as every estimator and the march see it.
#[derive(Clone, Copy, Debug)]
pub struct MediumFields {
    /// Density ρ.
    pub density: Field,
    /// The density that scatters, ρs, of each channel, where it is not ρ.
    pub scattering: Option<Field>,
    /// The density that the eye sees scatter, where that is not what scatters.
    pub seen: Option<Field>,
    /// Emission.
    pub emission: EmissionSource,
    /// The lattice of all.
    pub grid: GridParams,
    /// The longest step of a march, metres.
    pub step: f32,
}

/// Whether the medium emits, and along which field.
#[derive(Clone, Copy, Debug)]
pub enum EmissionSource {
    /// It does not.
    Off,
    /// It does, in proportion to the density, unless it has fields of its own.
    On {
        /// Where it shines, ρe, where that is not ρ.
        density: Option<Field>,
        /// The same with a colour, RGB; unused. It is what kernels sample then, and zero wherever ρe is.
        color: Option<Field>,
    },
}

impl EmissionSource {
    /// Where it shines besides the density, so that nothing that shines is stepped over.
    pub fn reach(self) -> Option<Field> {
        match self {
            Self::On { density, .. } => density,
            Self::Off => None,
        }
    }

    /// ρe, where kernels sample it.
    pub fn density(self) -> Option<Field> {
        self.reach().filter(|_| self.color().is_none())
    }

    /// ρe with its colour, where kernels sample that.
    pub fn color(self) -> Option<Field> {
        match self {
            Self::On { color, .. } => color,
            Self::Off => None,
        }
    }

    /// Whether the medium emits.
    pub fn is_on(self) -> bool {
        matches!(self, Self::On { .. })
    }
}

/// In-scattered radiance over the record cells, for the march to sample.
#[derive(Clone, Copy, Debug)]
pub struct InScatter {
    /// RGBA, one layer, or bands² layers that are weighed with the spherical harmonics of the ray's direction.
    pub field: Field,
    /// Cells along x, y, z over the box of the medium.
    pub cells: [u32; 3],
    /// Bands of the layers.
    pub bands: u32,
    /// Whether the march interpolates between cells.
    pub trilinear: bool,
}

/// What the way to the lights holds, over a grid of cells, for the march to sample.
#[derive(Clone, Copy, Debug)]
pub struct LightDepth {
    /// RGBA, four lights to a layer.
    pub field: Field,
    /// Whether it holds mean densities along the way within the box, or columns.
    pub mean: bool,
}

/// The medium's occupancy.
#[derive(Clone, Copy, Debug)]
pub struct Occupancy {
    /// Cells along x, y, z; voxels of a cell's side.
    pub cells: [u32; 4],
    /// Mean and maximum of each cell.
    pub buffer: Buf<[f32; 2]>,
}

/// The scene's surfaces on the device.
#[derive(Clone, Copy, Debug)]
pub struct MeshBuffers {
    /// Boxes and triangles.
    pub records: Buf<MeshRecord>,
    /// Materials.
    pub materials: Buf<MaterialRecord>,
    /// Number of boxes.
    pub nodes: u32,
    /// Where places of the mesh are from.
    pub origin: DVec3,
    /// The mesh's extent, metres.
    pub extent: f32,
}

impl MeshBuffers {
    /// A place from the mesh's origin; the mesh's extent: metres.
    pub fn from_origin(&self, place: DVec3) -> [f32; 4] {
        (place - self.origin).as_vec3().extend(self.extent).to_array()
    }
}

/// What the march adds up, and what is there before the estimators plan it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sources {
    /// The scene's lights, relative to the eye, where an estimator takes them: they are there before the estimators plan.
    pub records: Option<Buf<LightRecord>>,
    /// Surfaces, before the estimators plan.
    pub mesh: Option<MeshBuffers>,
    /// Where the medium is empty, before those plan that add orders of scattering.
    pub occupancy: Option<Occupancy>,
    /// A field of in-scattered radiance of the first order.
    pub field: Option<InScatter>,
    /// The same of further orders.
    pub scattered: Option<InScatter>,
    /// Extinction per unit of density on the way to the lights, 1/m, where it is that of a similar medium.
    pub light_extinction: Option<Vec3>,
    /// Lights that are evaluated at every view sample.
    pub lights: Option<Lights>,
    /// What takes the place of the phase function in light from them.
    pub phong: Option<Local>,
}

/// Lights that are evaluated at every view sample.
#[derive(Clone, Copy, Debug)]
pub struct Lights {
    /// The lights.
    pub records: Buf<LightRecord>,
    /// The medium's own shadow.
    pub shadow: LightShadow,
}

/// How the medium shadows lights.
#[derive(Clone, Copy, Debug)]
pub enum LightShadow {
    /// Not at all.
    Off,
    /// By a march toward the light.
    March,
    /// By a field.
    Field(LightDepth),
}

/// Cells along each axis of a box of `lengths` (metres): `cells` along the longest, the others in proportion.
pub(crate) fn grid(cells: u32, lengths: DVec3) -> [u32; 3] {
    let share = lengths / lengths.max_element() * f64::from(cells);
    share.to_array().map(|n| n.round().max(1.0) as u32)
}

/// A way to know J(x, d).
pub trait Estimator {
    /// Name, as scenes give it.
    fn name(&self) -> &'static str;

    /// Plans the stages that prepare J, and adds it to `sources`.
    ///
    /// # Errors
    /// Options that do not fit the scene.
    fn plan<'a>(
        &'a self,
        scene: &'a Scene,
        medium: &MediumFields,
        plan: &mut Plan<'a>,
        sources: &mut Sources,
    ) -> Result<(), RenderError>;
}
