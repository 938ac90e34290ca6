//! What the benchmarks run: a density made in code, stages over it on any device, whole scenes, and a bare loop to
//! hold them to. `docs/benchmarks.md` says how to run and read them.

mod baseline;
mod frames;
pub mod quick;
mod stages;

pub use baseline::trilinear_sum;
pub use frames::{Frame, scene};
pub use stages::{Rig, STAGES, View, gaussians};

use std::sync::Arc;

use airlight::glam::{DVec3, UVec3};
use airlight::media::{Grid, GridMedium, Lattice, Medium};

/// Voxels along x, y and z: 1.5 million, more than the caches of a core hold.
pub const DIMS: UVec3 = UVec3::new(144, 96, 112);

/// The box of the medium, metres: cubic voxels.
pub const BOUNDS: (DVec3, DVec3) = (DVec3::new(-0.9, 0.0, -0.7), DVec3::new(0.9, 1.2, 0.7));

/// The lattice of the density.
pub fn lattice() -> Lattice {
    Lattice::in_box(DIMS, BOUNDS.0, BOUNDS.1).expect("the box has volume")
}

/// Two lumps in empty space, with ripples: about a third of the voxels are not zero.
pub fn density() -> Vec<f32> {
    let size = DIMS.as_vec3();
    let mut values = Vec::with_capacity(DIMS.element_product() as usize);
    for k in 0..DIMS.z {
        for j in 0..DIMS.y {
            for i in 0..DIMS.x {
                let p = airlight::glam::Vec3::new(i as f32, j as f32, k as f32) / size - 0.5;
                let big = 0.40 - (p - airlight::glam::Vec3::new(-0.1, -0.05, 0.0)).length();
                let small = 0.22 - (p - airlight::glam::Vec3::new(0.3, 0.2, 0.15)).length();
                let ripples = (i as f32 * 0.37).sin() * (j as f32 * 0.29).sin() * (k as f32 * 0.23).sin();
                values.push((8.0 * big.max(small) + 0.5 * ripples).clamp(0.0, 1.0));
            }
        }
    }
    values
}

/// The density as a medium with a version of its own.
pub fn medium() -> Arc<dyn Medium> {
    let grid = Grid::dense(DIMS, lattice().index_to_world(), density()).expect("the values fill the lattice");
    Arc::new(GridMedium::new(Arc::new(grid), None).expect("the values are densities"))
}
