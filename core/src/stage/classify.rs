//! `classify`: what the values of a grid mean (Zhang, Dong and Ma 2013, section 9; the classification of volume rendering).
//!
//! A value v is placed among `points` in ascending order: of those at or below it the last, a, and the one behind that,
//! b. With f = (v - a.value)/(b.value - a.value), or 0 where v lies beyond the first or the last point, every number of the
//! points is a + (b - a) f. By [`classify_kind`] a voxel's are then
//!
//! - its density,
//! - the largest channel of its first colour,
//! - its first colour,
//! - density times first colour,
//! - density times first colour times second colour.
//!
//! Voxels are classified, and what came of them is interpolated (pre-classification).
//!
//! The output is one value a voxel, or four, RGB and zero; x fastest. The work axis is packs of [`Classify::PACK`] voxels in the
//! order of a slice, the last of each slice reaching past it; a group is a slice.

use crate::device::{Binding, Buf, Field, FieldFormat};
use crate::kernel_struct;
use crate::media::{ControlPoint, TransferFunction};
use crate::stage::grid::is_plain;
use crate::stage::{Kernel, require};

kernel_struct! {
    /// Parameters of `classify`.
    pub struct ClassifyParams {
        /// Voxels along x, y, z; a constant of [`classify_kind`].
        dims: U32x4,
        /// Control points.
        count: U32,
        /// Unused.
        unused_0: U32,
        /// Unused.
        unused_1: U32,
        /// Unused.
        unused_2: U32,
    }
}

/// What `classify` makes of a voxel.
pub mod classify_kind {
    /// Density.
    pub const DENSITY: u32 = 0;
    /// The largest channel of the first colour.
    pub const REACH: u32 = 1;
    /// The first colour.
    pub const COLOR: u32 = 2;
    /// Density times first colour.
    pub const SCATTERING: u32 = 3;
    /// Density times first colour times second colour.
    pub const SEEN: u32 = 4;
}

kernel_struct! {
    /// A control point as kernels see it.
    pub struct ControlRecord {
        /// Value of the grid; density; unused.
        place: F32x4,
        /// First colour, RGB; unused.
        first: F32x4,
        /// Second colour, RGB; unused.
        second: F32x4,
    }
}

impl ControlRecord {
    /// The points of a transfer function, with the numbers that a kind takes and zeros for all others, so that tables that mean the
    /// same are the same.
    pub fn of(function: &TransferFunction, kind: u32) -> Vec<Self> {
        let rgb0 = |v: glam::Vec3| v.extend(0.0).to_array();
        let record = |p: &ControlPoint| {
            let (density, first, second) = match kind {
                classify_kind::DENSITY => (p.density, [0.0; 4], [0.0; 4]),
                classify_kind::SCATTERING => (p.density, rgb0(p.albedo), [0.0; 4]),
                classify_kind::SEEN => (p.density, rgb0(p.albedo), rgb0(p.tint)),
                _ => (0.0, rgb0(p.emission), [0.0; 4]),
            };
            Self { place: [p.value, density, 0.0, 0.0], first, second }
        };
        function.points().iter().map(record).collect()
    }
}

/// The stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Classify {
    /// Parameters.
    pub params: ClassifyParams,
    /// The grid's values.
    pub values: Field,
    /// Control points in ascending order of their values.
    pub points: Buf<ControlRecord>,
    /// One value a voxel, or four.
    pub out: Buf<f32>,
}

impl ClassifyParams {
    /// Of so many voxels along x, y and z and so many points.
    pub fn new(dims: [u32; 3], kind: u32, count: u32) -> Self {
        Self { dims: [dims[0], dims[1], dims[2], kind], count, unused_0: 0, unused_1: 0, unused_2: 0 }
    }

    /// Values that are written for a voxel.
    pub fn channels(&self) -> u32 {
        if self.dims[3] < classify_kind::COLOR { 1 } else { 4 }
    }
}

impl Classify {
    /// Voxels of a unit of the work axis.
    pub const PACK: u32 = 64;

    /// Voxels of a slice.
    fn slice(&self) -> u64 {
        u64::from(self.params.dims[0]) * u64::from(self.params.dims[1])
    }
}

impl Kernel for Classify {
    const NAME: &'static str = "classify";

    fn params(&self) -> &[u8] {
        bytemuck::bytes_of(&self.params)
    }

    fn bindings(&self) -> Vec<Binding> {
        let part = self.slice() * u64::from(self.params.channels());
        vec![
            Binding::sample("values", FieldFormat::Scalar, Some(self.values)),
            Binding::read("points", Some(self.points)),
            Binding::write("classified", Some(self.out)).in_parts::<f32>(part),
        ]
    }

    fn axis(&self) -> u32 {
        self.group() * self.params.dims[2]
    }

    fn group(&self) -> u32 {
        self.slice().div_ceil(Self::PACK.into()) as u32
    }

    fn validate(&self) -> Result<(), String> {
        let p = &self.params;
        require!(p.dims[3] <= classify_kind::SEEN, "kind {}", p.dims[3]);
        require!(is_plain(&self.values, p.dims), "values are {:?}, not a scalar field of {:?}", self.values, p.dims);
        // Kernels index what they write of a slice with 32 bits.
        let (slice, depth) = (self.slice(), u64::from(p.dims[2]));
        let fits = slice * 4 <= u32::MAX.into() && slice.div_ceil(Self::PACK.into()) * depth <= u32::MAX.into();
        require!(slice * depth > 0 && fits, "{:?} voxels", &p.dims[..3]);
        require!(p.count > 0 && self.points.len >= p.count.into(), "{} of {} points", p.count, self.points.len);
        let values = (slice * depth).saturating_mul(p.channels().into());
        require!(self.out.len >= values, "{} places for {values} values", self.out.len);
        Ok(())
    }

    fn passes(&self, turns: u64) -> Result<Vec<Self>, String> {
        let own = u64::from(self.params.count);
        require!(own <= turns, "{own} points take as many turns of loops, and {turns} are allowed");
        Ok(vec![self.clone()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::{FieldSpec, ResourceId};

    #[test]
    fn what_kernels_would_index_out_of_bounds_is_refused() {
        let spec = FieldSpec::dense([7, 5, 9], 1, FieldFormat::Scalar);
        let stage = Classify {
            params: ClassifyParams::new([7, 5, 9], classify_kind::SEEN, 3),
            values: Field { id: ResourceId(0), spec },
            points: Buf::new(ResourceId(1), 3),
            out: Buf::new(ResourceId(2), 4 * 7 * 5 * 9),
        };
        assert_eq!(stage.validate(), Ok(()));
        assert_eq!((stage.axis(), stage.group()), (9, 1));
        assert!(stage.passes(2).is_err() && stage.passes(3).is_ok());
        let wrong: [fn(&mut Classify); 6] = [
            |s| s.params.dims[0] = 8,
            |s| s.params.dims[3] = 5,
            |s| s.params.count = 4,
            |s| s.params.count = 0,
            |s| s.out.len -= 1,
            |s| s.values.spec.format = FieldFormat::Rgba,
        ];
        for (n, wrong) in wrong.iter().enumerate() {
            let mut stage = stage.clone();
            wrong(&mut stage);
            assert!(stage.validate().is_err(), "{n}");
        }
        let wide = ClassifyParams::new([1 << 16, 1 << 15, 1], classify_kind::DENSITY, 3);
        assert!(Classify { params: wide, ..stage }.validate().is_err());
    }
}
