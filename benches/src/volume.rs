//! The benchmarks' density on as many voxels as one likes.

use std::sync::{Arc, OnceLock};

use airlight::Version;
use airlight::glam::{DVec3, UVec3};
use airlight::media::{Grid, GridMedium, Lattice, Medium};

use crate::{MOST, fill_slice};

/// The density in a box whose longest side is one metre, around the origin.
#[derive(Clone, Debug)]
pub(crate) struct Volume {
    lattice: Lattice,
    version: Version,
    /// All values, once they were read, where they are kept.
    values: Option<Arc<OnceLock<Vec<f32>>>>,
}

impl Volume {
    /// Made slice by slice whenever it is read: it is held by the device alone.
    pub(crate) fn new(dims: UVec3) -> Self {
        let size = dims.as_dvec3() / f64::from(dims.max_element());
        let lattice = Lattice::in_box(dims, -0.5 * size, 0.5 * size).expect("the box has volume");
        Self { lattice, version: Version::fresh(), values: None }
    }

    /// Made once, so that uploading it again and again takes no more than that.
    pub(crate) fn kept(dims: UVec3) -> Self {
        Self { values: Some(Arc::default()), ..Self::new(dims) }
    }

    fn all(&self) -> Vec<f32> {
        let dims = self.lattice.dims();
        let slice = dims.x as usize * dims.y as usize;
        let mut values = vec![0.0; slice * dims.z as usize];
        values.chunks_exact_mut(slice).zip(0..).for_each(|(out, k)| fill_slice(dims, k, out));
        values
    }

    /// The same density, of which `side` voxels along each axis are one.
    pub(crate) fn coarsened(&self, side: u32) -> GridMedium {
        let (dims, map) = (self.lattice.dims(), self.lattice.index_to_world());
        let grid = Grid::dense(dims, map, self.all()).and_then(|grid| grid.coarsened(side));
        GridMedium::new(Arc::new(grid.expect("a side that divides")), None).expect("the values are densities")
    }

    /// The same density as one that nothing knows yet.
    pub(crate) fn again(&self) -> Self {
        Self { version: Version::fresh(), ..self.clone() }
    }
}

impl Medium for Volume {
    fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    fn version(&self) -> Version {
        self.version
    }

    fn density_bound(&self) -> Option<f32> {
        Some(MOST)
    }

    fn density_slice(&self, k: u32, out: &mut [f32]) {
        match &self.values {
            Some(values) => {
                out.copy_from_slice(&values.get_or_init(|| self.all())[k as usize * out.len()..][..out.len()])
            }
            None => fill_slice(self.lattice.dims(), k, out),
        }
    }
}

/// Half a diagonal and more from the origin, so that a picture of 30° holds all of a unit cube.
pub(crate) const EYE: DVec3 = DVec3::new(1.9, 1.1, 2.1);
