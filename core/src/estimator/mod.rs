//! Estimators: ways to know the in-scattered radiance J(x, d) at a point.
//!
//! An estimator plans the stages that prepare its J and adds what the march shall read to [`Sources`].

mod direct;
mod opacity;
mod records;

pub(crate) use direct::light_records;
use glam::DVec3;

use crate::device::{Buf, Field};
use crate::exec::{Plan, RenderError};
use crate::scene::Scene;
use crate::stage::{GridParams, LightRecord};

/// The medium on the device, as every estimator and the march see it.
#[derive(Clone, Copy, Debug)]
pub struct MediumFields {
    /// Density ρ.
    pub density: Field,
    /// Emission.
    pub emission: EmissionSource,
    /// The lattice of both.
    pub grid: GridParams,
    /// The longest step of a march, metres.
    pub step: f32,
}

/// Whether the medium emits, and along which field.
#[derive(Clone, Copy, Debug)]
pub enum EmissionSource {
    /// It does not.
    Off,
    /// It does, in proportion to a field of its own, or to the density.
    On(Option<Field>),
}

impl EmissionSource {
    /// The field of its own.
    pub fn field(self) -> Option<Field> {
        match self {
            Self::On(field) => field,
            Self::Off => None,
        }
    }

    /// Whether the medium emits.
    pub fn is_on(self) -> bool {
        matches!(self, Self::On(_))
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

/// What the march adds up.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sources {
    /// A field of in-scattered radiance.
    pub field: Option<InScatter>,
    /// Lights that are evaluated at every view sample.
    pub lights: Option<Lights>,
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
fn grid(cells: u32, lengths: DVec3) -> [u32; 3] {
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
