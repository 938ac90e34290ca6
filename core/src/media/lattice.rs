//! Where the samples of a field lie in the world.

use glam::{DAffine3, DMat3, DVec3, UVec3};

use super::MediumError;

/// A regular lattice of samples: `dims` samples along each axis and the affine map that takes the index of a sample
/// to its place in the world, in metres. Sample (i, j, k) sits at its voxel's centre, so the box of the lattice runs
/// from -½ to dims - ½ in index space. The map may scale, rotate, shear and mirror.
#[derive(Clone, Debug, PartialEq)]
pub struct Lattice {
    dims: UVec3,
    index_to_world: DAffine3,
    world_to_index: DAffine3,
}

impl Lattice {
    /// A lattice of `dims` samples placed by `index_to_world`.
    ///
    /// # Errors
    /// A side of zero, or of more than 2³¹ - 1 samples; a map that is singular or not finite, or whose scale f32 does
    /// not hold.
    pub fn new(dims: UVec3, index_to_world: DAffine3) -> Result<Self, MediumError> {
        if dims.min_element() == 0 || dims.max_element() > i32::MAX as u32 {
            return Err(MediumError::Dims { x: dims.x.into(), y: dims.y.into(), z: dims.z.into() });
        }
        let m = index_to_world.matrix3;
        let world_to_index = index_to_world.inverse();
        // Relative to the edges: a box of nanometres is as good as one of light years, a flat one is not.
        let flatness = m.determinant().abs() / (m.x_axis.length() * m.y_axis.length() * m.z_axis.length());
        // Kernels see both linear maps as f32.
        let scale = |m: DMat3| [m.x_axis, m.y_axis, m.z_axis].map(|a| (a.length() as f32).is_normal()) == [true; 3];
        let sound = index_to_world.is_finite()
            && world_to_index.is_finite()
            && flatness > 1e-9
            && scale(m)
            && scale(world_to_index.matrix3);
        if !sound {
            return Err(MediumError::Transform(format!(
                "axes {:?} {:?} {:?}, origin {:?}",
                m.x_axis.to_array(),
                m.y_axis.to_array(),
                m.z_axis.to_array(),
                index_to_world.translation.to_array()
            )));
        }
        Ok(Self { dims, index_to_world, world_to_index })
    }

    /// A lattice that fills the axis-aligned box from `min` to `max` (metres) with `dims` voxels.
    ///
    /// # Errors
    /// As [`Lattice::new`]; a box without volume.
    pub fn in_box(dims: UVec3, min: DVec3, max: DVec3) -> Result<Self, MediumError> {
        let size = max - min;
        if !(size.is_finite() && min.is_finite() && size.min_element() > 0.0) {
            return Err(MediumError::Bounds { min: min.to_array(), max: max.to_array() });
        }
        let edge = size / dims.as_dvec3().max(DVec3::ONE);
        let map = DAffine3::from_scale_rotation_translation(edge, glam::DQuat::IDENTITY, min + 0.5 * edge);
        Self::new(dims, map)
    }

    /// A lattice of nearly cubic voxels that fills the axis-aligned box from `min` to `max` (metres): `cells` along the
    /// longest side and max(1, round(cells · length / longest)) along each other, halves away from zero. The box is
    /// kept as it is, so voxels are stretched by what rounding leaves, and cubic where the sides have that ratio.
    ///
    /// # Errors
    /// As [`Lattice::in_box`].
    pub fn of_cells(cells: u32, min: DVec3, max: DVec3) -> Result<Self, MediumError> {
        let size = max - min;
        let share = size / size.max_element() * f64::from(cells);
        // Casting saturates; what is no box is refused below.
        let dims = share.to_array().map(|n| (n.round() as u32).max(1));
        Self::in_box(UVec3::from_array(dims), min, max)
    }

    /// Whether the three edges stand at right angles.
    pub(crate) fn is_orthogonal(&self) -> bool {
        let m = self.index_to_world.matrix3;
        let square = |a: DVec3, b: DVec3| a.dot(b).abs() <= 1e-9 * a.length() * b.length();
        square(m.x_axis, m.y_axis) && square(m.y_axis, m.z_axis) && square(m.z_axis, m.x_axis)
    }

    /// Samples along x, y and z.
    pub fn dims(&self) -> UVec3 {
        self.dims
    }

    /// The number of samples; `u64::MAX` where there are more.
    pub fn voxels(&self) -> u64 {
        (u64::from(self.dims.x) * u64::from(self.dims.y)).saturating_mul(self.dims.z.into())
    }

    /// Takes the index of a sample to the world, in metres.
    pub fn index_to_world(&self) -> DAffine3 {
        self.index_to_world
    }

    /// Takes a point of the world to index space.
    pub fn world_to_index(&self) -> DAffine3 {
        self.world_to_index
    }

    /// Fills slice `k`, x fastest, from the place of each sample in the world and what stands there already.
    pub(crate) fn fill_slice(&self, k: u32, out: &mut [f32], value: impl Fn(DVec3, f32) -> f64) {
        assert_eq!(out.len() as u64, u64::from(self.dims.x) * u64::from(self.dims.y), "a slice holds x · y values");
        for (row, j) in out.chunks_exact_mut(self.dims.x as usize).zip(0u32..) {
            for (place, i) in row.iter_mut().zip(0u32..) {
                let p = self.index_to_world.transform_point3(UVec3::new(i, j, k).as_dvec3());
                *place = value(p, *place) as f32;
            }
        }
    }

    /// Lengths of a voxel's three edges in metres.
    pub fn edges(&self) -> DVec3 {
        let m = self.index_to_world.matrix3;
        DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length())
    }

    /// The shortest of the three edges, in metres.
    pub fn shortest_edge(&self) -> f64 {
        self.edges().min_element()
    }

    /// The centre of the box, in metres.
    pub fn center(&self) -> DVec3 {
        self.index_to_world.transform_point3(0.5 * (self.dims.as_dvec3() - 1.0))
    }

    /// The axis-aligned bounds in the world of the (possibly slanted) box, in metres.
    pub fn world_bounds(&self) -> (DVec3, DVec3) {
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for corner in 0..8u32 {
            let far = DVec3::new((corner & 1).into(), (corner >> 1 & 1).into(), (corner >> 2).into());
            let p = self.index_to_world.transform_point3(far * self.dims.as_dvec3() - 0.5);
            min = min.min(p);
            max = max.max(p);
        }
        (min, max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn box_and_index_agree() {
        let l =
            Lattice::in_box(UVec3::new(72, 48, 60), DVec3::new(-0.6, 0.0, -0.5), DVec3::new(0.6, 0.8, 0.5)).unwrap();
        let first = l.index_to_world().transform_point3(DVec3::ZERO);
        assert!((first - DVec3::new(-0.6 + 1.0 / 120.0, 1.0 / 120.0, -0.5 + 1.0 / 120.0)).length() < 1e-12);
        let (min, max) = l.world_bounds();
        assert!((min - DVec3::new(-0.6, 0.0, -0.5)).length() < 1e-12);
        assert!((max - DVec3::new(0.6, 0.8, 0.5)).length() < 1e-12);
        assert!((l.center() - DVec3::new(0.0, 0.4, 0.0)).length() < 1e-12);
    }

    #[test]
    fn cells_are_counted_along_the_longest_side() {
        let of = |cells, max| Lattice::of_cells(cells, DVec3::ZERO, max).unwrap();
        let lattice = of(60, DVec3::new(1.2, 0.8, 1.0));
        assert_eq!(lattice.dims(), UVec3::new(60, 40, 50));
        assert!((lattice.edges() - DVec3::splat(0.02)).length() < 1e-12);
        // Rounding stretches voxels, not the box.
        let lattice = of(7, DVec3::new(0.5, 2.0, 0.01));
        assert_eq!(lattice.dims(), UVec3::new(2, 7, 1));
        assert!((lattice.world_bounds().1 - DVec3::new(0.5, 2.0, 0.01)).length() < 1e-12);
        for bad in [DVec3::ZERO, DVec3::new(1.0, -1.0, 1.0), DVec3::new(1.0, f64::NAN, 1.0)] {
            assert!(matches!(Lattice::of_cells(7, DVec3::ZERO, bad), Err(MediumError::Bounds { .. })));
        }
    }

    #[test]
    fn flat_and_empty_lattices_are_refused() {
        let flat = DAffine3::from_cols(DVec3::X, DVec3::X, DVec3::Z, DVec3::ZERO);
        assert!(matches!(Lattice::new(UVec3::ONE, flat), Err(MediumError::Transform(_))));
        assert!(matches!(Lattice::new(UVec3::ZERO, DAffine3::IDENTITY), Err(MediumError::Dims { .. })));
        assert!(matches!(
            Lattice::in_box(UVec3::ONE, DVec3::ZERO, DVec3::new(1.0, f64::NAN, 1.0)),
            Err(MediumError::Bounds { .. })
        ));
        for side in [1e-42, 1e42] {
            let lattice = Lattice::in_box(UVec3::ONE, DVec3::ZERO, DVec3::splat(side));
            assert!(matches!(lattice, Err(MediumError::Transform(_))), "{side}");
        }
    }
}
