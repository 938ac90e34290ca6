//! Fields of a medium's optics beside its density.

use std::fmt;

use super::Bricks;
use crate::Version;

/// Fills slice k of a field, x fastest.
type Write<'a> = dyn Fn(u32, &mut [f32]) + 'a;

/// A field on the lattice of a medium's density, written slice by slice.
pub struct OpticsField<'a> {
    version: Version,
    write: Box<Write<'a>>,
    bound: Option<f32>,
    bricks: Box<dyn Fn() -> Option<&'a Bricks> + 'a>,
}

impl<'a> OpticsField<'a> {
    /// A field of so many values a voxel as [`OpticsFields`] says. Equal versions mean equal values; `write` fills slice
    /// `k`, x fastest.
    pub fn new(version: Version, write: impl Fn(u32, &mut [f32]) + 'a) -> Self {
        Self { version, write: Box::new(write), bound: None, bricks: Box::new(|| None) }
    }

    /// The same, of one value a voxel that does not exceed `bound`, and that `bricks` finds in bricks where it is held
    /// sparse.
    pub fn held_as(self, bound: f32, bricks: impl Fn() -> Option<&'a Bricks> + 'a) -> Self {
        Self { bound: Some(bound), bricks: Box::new(bricks), ..self }
    }

    /// A bound that no value exceeds, where one is known.
    pub fn bound(&self) -> Option<f32> {
        self.bound
    }

    /// The same values in bricks, where they are held sparse.
    pub fn bricks(&self) -> Option<&'a Bricks> {
        (self.bricks)()
    }

    /// Identity of the values.
    pub fn version(&self) -> Version {
        self.version
    }

    /// Writes slice `k`, x fastest.
    pub fn slice(&self, k: u32, out: &mut [f32]) {
        (self.write)(k, out);
    }
}

impl fmt::Debug for OpticsField<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("OpticsField").field("version", &self.version).finish_non_exhaustive()
    }
}

/// What of a medium's optics does not follow its density ρ. All values are from 0 to [`LARGEST`](super::LARGEST), and
/// between voxels they are interpolated as densities are.
#[derive(Debug, Default)]
pub struct OpticsFields<'a> {
    /// The density that scatters, ρs, no more than ρ: σs = ρs · `extinction` · `albedo`. Four values a voxel: RGB and an
    /// unused one. Without it ρs is ρ.
    pub scattering: Option<OpticsField<'a>>,
    /// The density that shines, ρe: j = ρe · `emission`. One value a voxel. Without it ρe is ρ.
    pub emission: Option<OpticsField<'a>>,
    /// The same with a colour of its own: it stands for ρe in j, and is zero where ρe is. Four values a voxel: RGB and an
    /// unused one.
    pub emission_color: Option<OpticsField<'a>>,
    /// The density that the eye sees scatter, no more than ρs: it stands for ρs where a ray of the eye's gathers what is
    /// scattered toward it, and nowhere else. Four values a voxel: RGB and an unused one. Without it that is ρs.
    pub seen: Option<OpticsField<'a>>,
}
