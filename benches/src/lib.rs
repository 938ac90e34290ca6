//! What the benchmarks run: a density made in code, stages over it on any device, whole scenes, and a bare loop to
//! hold them to. `docs/benchmarks.md` says how to run and read them.

mod baseline;
pub mod curves;
mod frames;
mod ordinates;
pub mod papers;
pub mod quick;
mod stages;
pub mod steady;
mod transfers;
mod volume;

pub use baseline::{Lookups, trilinear_sum};
use frames::scene_of;
pub use frames::{Frame, scene};
pub use stages::{Rig, STAGES, View, gaussians};

use std::sync::Arc;
use std::time::Duration;

use airlight::glam::{DVec3, UVec3, Vec3};
use airlight::media::{Grid, GridMedium, Lattice, Medium};
use rayon::prelude::*;

/// Whether a stage or frame that ran so many times after the first, which took so long together, has settled: backends build
/// kernels for what stays the same.
pub(crate) fn settled(runs: usize, took: Duration) -> bool {
    const RUNS: usize = 40;
    const LONG: Duration = Duration::from_millis(600);
    runs >= RUNS || (runs >= 2 && took >= LONG)
}

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
    let slice = (DIMS.x * DIMS.y) as usize;
    let mut values = vec![0.0; slice * DIMS.z as usize];
    values.chunks_exact_mut(slice).zip(0..).for_each(|(out, k)| fill_slice(DIMS, k, out));
    values
}

/// The bound of [`density`].
const MOST: f32 = 1.0;

/// Slice `k` of [`density`] on as many voxels as one likes.
fn fill_slice(dims: UVec3, k: u32, out: &mut [f32]) {
    let size = dims.as_vec3();
    out.par_chunks_exact_mut(dims.x as usize).zip(0..dims.y).for_each(|(row, j)| {
        let across = (j as f32 * 0.29).sin() * (k as f32 * 0.23).sin();
        for (value, i) in row.iter_mut().zip(0u32..) {
            let p = Vec3::new(i as f32, j as f32, k as f32) / size - 0.5;
            let big = 0.40 - (p - Vec3::new(-0.1, -0.05, 0.0)).length();
            let small = 0.22 - (p - Vec3::new(0.3, 0.2, 0.15)).length();
            *value = (8.0 * big.max(small) + 0.5 * (i as f32 * 0.37).sin() * across).clamp(0.0, MOST);
        }
    });
}

/// The density as a medium with a version of its own.
pub fn medium() -> Arc<dyn Medium> {
    let grid = Grid::dense(DIMS, lattice().index_to_world(), density()).expect("the values fill the lattice");
    Arc::new(GridMedium::new(Arc::new(grid), None).expect("the values are densities"))
}
