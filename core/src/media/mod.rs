//! Participating media: where density lives ([`Medium`], [`Lattice`]), what it does to light ([`Optics`], [`Phase`]).
//!
//! A medium is a scalar density ρ on a lattice, and optics that multiply it: extinction σt(x) = ρ(x) · `extinction`,
//! scattering σs(x) = ρs(x) · `extinction` · `albedo`, emission j(x) = ρe(x) · `emission`. ρs and ρe are ρ, unless the
//! medium has fields of their own for them ([`OpticsFields`]). Columns of ρ are scalars; colour enters at the exponential.

mod bins;
mod bricks;
mod classified;
mod coarse;
mod fields;
mod fog;
mod gaussians;
mod grid;
mod grid_medium;
mod lattice;
mod noise;
mod optics;
mod phase;
mod presets;
mod transfer_function;

use std::fmt::Debug;

pub use bins::Bins;
pub use bricks::Bricks;
pub use classified::Classified;
pub use fields::{OpticsField, OpticsFields};
pub use fog::HeightFog;
pub use gaussians::{Gaussian, Gaussians};
pub use grid::{BRICK, Brick, Grid, Homogeneous, IndexBox, Storage, Tile};
pub use grid_medium::GridMedium;
pub use lattice::Lattice;
pub use noise::{Detailed, FractalNoise, Noise};
pub use optics::{Optics, OpticsError};
#[cfg(test)]
pub(crate) use phase::legendre;
pub use phase::{Phase, PhaseError, PhaseTable};
pub use presets::Preset;
pub use transfer_function::{ControlPoint, TransferFunction, TransferFunctionError};

use crate::Version;

/// Why a medium cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MediumError {
    /// An extent is zero or does not fit.
    #[error("a grid of {x} × {y} × {z} voxels has no volume or is too large; each side must be from 1 to 2^31 - 1")]
    Dims {
        /// Voxels along x, y and z, as claimed.
        x: u64,
        /// See `x`.
        y: u64,
        /// See `x`.
        z: u64,
    },
    /// The transform has no inverse or holds non-finite numbers.
    #[error("the transform from index to world is singular or not finite: {0}")]
    Transform(String),
    /// The number of values is not the number of voxels.
    #[error("{found} values for {expected} voxels")]
    Length {
        /// Voxels of the grid.
        expected: u64,
        /// Values that were given.
        found: u64,
    },
    /// A density that no medium can have.
    #[error("density {value} at voxel ({x}, {y}, {z}); densities must be from 0 to {max:e}", max = LARGEST)]
    Density {
        /// The offending value.
        value: f32,
        /// Index of the voxel.
        x: i32,
        /// See `x`.
        y: i32,
        /// See `x`.
        z: i32,
    },
    /// What cannot be made coarser.
    #[error("{0}")]
    Coarse(String),
    /// A value to be classified that is none.
    #[error("the value {value} at voxel ({x}, {y}, {z}) is not a finite number")]
    NotFinite {
        /// The offending value.
        value: f32,
        /// Index of the voxel.
        x: i32,
        /// See `x`.
        y: i32,
        /// See `x`.
        z: i32,
    },
    /// A value of a grid beside the density's that is out of range.
    #[error("{what} {value} at voxel ({x}, {y}, {z}); it must be from 0 to {most}")]
    Value {
        /// What the grid says.
        what: &'static str,
        /// The offending value, in the unit of `most`.
        value: f64,
        /// The largest that would do.
        most: f64,
        /// Index of the voxel.
        x: i32,
        /// See `x`.
        y: i32,
        /// See `x`.
        z: i32,
    },
    /// A number of a medium that is described and not sampled.
    #[error("{what} {value}: it must be {right}")]
    Parameter {
        /// Which number.
        what: &'static str,
        /// Its value.
        value: f64,
        /// What would be right.
        right: &'static str,
    },
    /// One of a sum of Gaussians.
    #[error("Gaussian {number}: {error}")]
    Gaussian {
        /// Its number, from 0.
        number: usize,
        /// What is wrong with it.
        error: Box<MediumError>,
    },
    /// Two grids of one medium do not share a lattice.
    #[error("{0}")]
    Mismatch(String),
    /// The box of a medium without a grid.
    #[error("the bounds {min:?} to {max:?} enclose no volume; each maximum must be above its minimum and finite")]
    Bounds {
        /// Lower corner in metres.
        min: [f64; 3],
        /// Upper corner in metres.
        max: [f64; 3],
    },
}

/// The largest density and the largest coefficient of optics, so that the optical depth of any step stays within f32.
pub const LARGEST: f32 = 1e15;

/// Whether `v` is from 0 to [`LARGEST`].
fn in_range(v: f32) -> bool {
    (0.0..=LARGEST).contains(&v)
}

/// Refuses a parameter that is not `right`.
fn demand(what: &'static str, value: f64, right: &'static str, is: bool) -> Result<(), MediumError> {
    if is { Ok(()) } else { Err(MediumError::Parameter { what, value, right }) }
}

/// Refuses a density or amplitude that is not from 0 to [`LARGEST`].
fn demand_density(what: &'static str, value: f64) -> Result<(), MediumError> {
    demand(what, value, "from 0 to 1e15", in_range(value as f32))
}

/// How a device comes by a medium's density.
#[derive(Clone, Copy, Debug)]
pub enum DensitySource<'a> {
    /// The host makes it, slice by slice ([`Medium::density_slice`]).
    Slices,
    /// The device sums Gaussians.
    Gaussians(&'a Gaussians),
    /// The device computes fog over a plane.
    HeightFog(&'a HeightFog),
    /// The device computes noise.
    Noise(&'a Noise),
    /// The device multiplies a grid by noise.
    Detailed(&'a Detailed),
    /// The device classifies values; it makes [`Medium::optics_fields`] in the same way.
    Classified(&'a Classified),
}

/// A participating medium's density on its lattice.
///
/// Object-safe, so that a scene may hold any medium. Implementations are immutable: what changes takes a new
/// [`Version`], and everything derived from the old one is redone.
pub trait Medium: Debug + Send + Sync {
    /// The lattice the density is sampled on; the medium ends where the lattice's box ends.
    fn lattice(&self) -> &Lattice;

    /// Identity of the density; equal versions mean equal values.
    fn version(&self) -> Version;

    /// Writes the densities of slice `k` (0 ≤ k < dims.z), x fastest; `out` holds dims.x · dims.y values.
    fn density_slice(&self, k: u32, out: &mut [f32]);

    /// A bound that no density exceeds, where one is known without a walk over all voxels.
    fn density_bound(&self) -> Option<f32> {
        None
    }

    /// The density in bricks, the same values as [`Medium::density_slice`] writes, where the medium holds them sparse. They
    /// are made when they are first asked for, and kept.
    fn density_bricks(&self) -> Option<&Bricks> {
        None
    }

    /// How a device makes the density. What it makes agrees with [`Medium::density_slice`] to the rounding of f32 and
    /// what the source itself states.
    fn source(&self) -> DensitySource<'_> {
        DensitySource::Slices
    }

    /// What scatters and shines otherwise than the density does. By default nothing.
    fn optics_fields(&self) -> OpticsFields<'_> {
        OpticsFields::default()
    }

    /// The length in metres that a view `step` counts in: the shortest voxel edge, or what a medium without voxels states.
    fn voxel(&self) -> f64 {
        self.lattice().shortest_edge()
    }
}

/// The mean of `Medium::density_slice` over all voxels and its largest value, both in units of density.
pub fn density_statistics(medium: &dyn Medium) -> (f64, f32) {
    let dims = medium.lattice().dims();
    let mut slice = vec![0.0f32; dims.x as usize * dims.y as usize];
    let (mut sum, mut max) = (0.0f64, 0.0f32);
    for k in 0..dims.z {
        medium.density_slice(k, &mut slice);
        for &v in &slice {
            sum += f64::from(v);
            max = max.max(v);
        }
    }
    (sum / medium.lattice().voxels() as f64, max)
}
