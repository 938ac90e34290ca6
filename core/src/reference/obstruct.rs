//! Twin of the stage [`Obstruct`].

use glam::DVec3;

use super::lookup::{apply, xyz};
use super::mesh::nearest;
use crate::stage::{MeshRecord, Obstruct, ObstructParams};

/// What [`Obstruct`] writes for boxes, which are not read, and triangles of a mesh: a word a cell.
pub fn obstruct(params: &ObstructParams, mesh: &[MeshRecord]) -> Vec<u32> {
    let [nx, ny, nz, _] = params.cells;
    let middle = (DVec3::from([0, 1, 2].map(|a| f64::from(params.dims[a]))) - 1.0) / 2.0;
    let place = |cell: DVec3| {
        let index = (cell + 0.5) * xyz(params.cell) - 0.5;
        apply([params.world_x, params.world_y, params.world_z], index - middle) + xyz(params.mesh_eye)
    };
    let cells = (0..nx * ny * nz).map(|n| DVec3::from([n % nx, n / nx % ny, n / nx / ny].map(f64::from)));
    cells
        .map(|cell| {
            let from = place(cell);
            let stands = |bit: u32| {
                let to = place(cell + DVec3::from([bit % 3, bit / 3 % 3, bit / 9].map(f64::from)) - 1.0);
                let way = to - from;
                let toward = way.normalize_or_zero();
                bit != Obstruct::NEIGHBORS / 2
                    && nearest(mesh, params.nodes, from, toward, [0.0, way.length()]).is_some()
            };
            (0..Obstruct::NEIGHBORS).map(|bit| u32::from(stands(bit)) << bit).sum()
        })
        .collect()
}
