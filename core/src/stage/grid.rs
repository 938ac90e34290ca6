//! What several stages say alike: the lattice of the density and the phase function.

use glam::{DMat3, DVec3};

use crate::device::{Buf, Field, FieldFormat, FieldSpec};
use crate::media::{Lattice, Phase};
use crate::stage::require;

/// Beyond every distance in a scene, and finite: not every language of kernels promises infinities.
pub const FAR: f32 = 3.0e38;

/// The lattice of the density as kernels see it. Rays are carried into index space, where sample (i, j, k) lies at
/// (i, j, k) and the box from -½ to dims - ½; their parameter stays metres of world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridParams {
    /// Samples along x, y and z.
    pub dims: [u32; 4],
    /// Rows of the linear map from metres of world to voxels.
    pub index: [[f32; 4]; 3],
    /// Rows of its inverse.
    pub world: [[f32; 4]; 3],
}

impl GridParams {
    /// Of a lattice.
    pub fn new(lattice: &Lattice) -> Self {
        let rows = |m: glam::DMat3| [0, 1, 2].map(|i| m.row(i).as_vec3().extend(0.0).to_array());
        let d = lattice.dims();
        Self {
            dims: [d.x, d.y, d.z, 0],
            index: rows(lattice.world_to_index().matrix3),
            world: rows(lattice.index_to_world().matrix3),
        }
    }
}

/// The most steps of a ray through the box of `dims` voxels, whose rows of the map from metres to voxels are `index`.
pub(super) fn most_steps(dims: [u32; 4], index: [[f32; 4]; 3], longest: f32) -> u64 {
    let row = |r: [f32; 4]| DVec3::new(r[0].into(), r[1].into(), r[2].into());
    // Metres of a voxel's edges: the inverse of the map from metres to voxels.
    let world = DMat3::from_cols(row(index[0]), row(index[1]), row(index[2])).transpose().inverse();
    let edges = [0, 1, 2].map(|a| world.col(a) * f64::from(dims[a]));
    let diagonals = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
    let across = diagonals.iter().map(|(y, z)| (edges[0] + y * edges[1] + z * edges[2]).length()).fold(0.0, f64::max);
    // Casting saturates, and rounding may add a step.
    ((across / f64::from(longest)).ceil() as u64).saturating_add(2)
}

/// Whether `field` is a dense scalar field of one layer of `dims` in 32-bit floats.
pub(super) fn is_plain(field: &Field, dims: [u32; 4]) -> bool {
    field.spec == FieldSpec::dense([dims[0], dims[1], dims[2]], 1, FieldFormat::Scalar)
}

/// Whether `field` is a scalar field of one layer of `dims`, in whatever format and layout.
pub(super) fn is_scalar(field: &Field, dims: [u32; 4]) -> bool {
    field.spec.format != FieldFormat::Rgba && field.spec.layers == 1 && field.spec.dims[..] == dims[..3]
}

/// Whether `field` is a field of colours in one layer of `dims`.
pub(super) fn is_color(field: &Field, dims: [u32; 4]) -> bool {
    field.spec.format == FieldFormat::Rgba && field.spec.layers == 1 && field.spec.dims[..] == dims[..3]
}

/// Whether `density` is a scalar field of one layer of `dims`.
///
/// # Errors
/// A text that says what it is.
pub(super) fn is_density(density: &Field, dims: [u32; 4]) -> Result<(), String> {
    require!(is_scalar(density, dims), "density is {:?}, not a scalar field of {dims:?}", density.spec);
    Ok(())
}

/// Whether all that a stage takes of the medium is of the density's `dims`: the density that scatters, that of emission,
/// and emission with a colour.
///
/// # Errors
/// A text that says which is not.
pub(super) fn is_medium(
    density: &Field,
    scattering: Option<Field>,
    emission: Option<Field>,
    emission_color: Option<Field>,
    dims: [u32; 4],
) -> Result<(), String> {
    is_density(density, dims)?;
    require!(scattering.is_none_or(|f| is_color(&f, dims)), "what scatters differs from the density");
    require!(emission.is_none_or(|f| is_scalar(&f, dims)), "the emission density differs from the density");
    require!(emission_color.is_none_or(|f| is_color(&f, dims)), "the emission differs from the density");
    Ok(())
}

/// Whether `of` holds a value for each of `cells`, x, y, z and voxels of a side, and those are what covers `dims` voxels.
/// `name` is of what they hold.
///
/// # Errors
/// A text that says what is wrong.
pub(super) fn covers(name: &str, of: Buf<[f32; 2]>, cells: [u32; 4], dims: [u32; 4]) -> Result<(), String> {
    let [x, y, z, side] = cells;
    require!(side > 0, "cells of the {name} without size");
    let fits = (0..3).all(|a| cells[a] == dims[a].div_ceil(side));
    require!(fits, "{cells:?} cells of the {name} over {dims:?} voxels");
    let count = u64::from(x).saturating_mul(y.into()).saturating_mul(z.into());
    require!(of.len >= count, "{name} of too few cells");
    Ok(())
}

/// A phase function as kernels see it.
#[derive(Clone, Debug, PartialEq)]
pub struct PhaseParams {
    /// One of the constants of this type.
    pub kind: u32,
    /// Forward g, backward g, share of the first lobe, unused.
    pub lobes: [f32; 4],
    /// Values at angles spread evenly from 0 to π, where the kind is [`PhaseParams::TABLE`].
    pub table: Vec<f32>,
}

impl PhaseParams {
    /// 1/4π.
    pub const ISOTROPIC: u32 = 0;
    /// One or two Henyey–Greenstein lobes.
    pub const HENYEY_GREENSTEIN: u32 = 1;
    /// 3/16π (1 + c²).
    pub const RAYLEIGH: u32 = 2;
    /// Linear in the angle between the values of a table.
    pub const TABLE: u32 = 3;

    /// Of a phase function.
    pub fn new(phase: &Phase) -> Self {
        let plain = |kind, lobes| Self { kind, lobes, table: Vec::new() };
        match phase {
            Phase::Isotropic => plain(Self::ISOTROPIC, [0.0; 4]),
            Phase::HenyeyGreenstein { g } => plain(Self::HENYEY_GREENSTEIN, [*g as f32, 0.0, 1.0, 0.0]),
            Phase::DoubleHenyeyGreenstein { forward, backward, weight } => {
                plain(Self::HENYEY_GREENSTEIN, [*forward as f32, *backward as f32, *weight as f32, 0.0])
            }
            Phase::Rayleigh => plain(Self::RAYLEIGH, [0.0; 4]),
            Phase::Table(table) => {
                Self { kind: Self::TABLE, lobes: [0.0; 4], table: table.values().iter().map(|&v| v as f32).collect() }
            }
        }
    }
}
