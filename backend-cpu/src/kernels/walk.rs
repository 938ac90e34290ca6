//! Walks along rays from one tentative collision to the next, through cells of constant rate.

use airlight_core::glam::Vec3;

use super::random::{Draws, draw, optical_depth};

/// What is walked through.
#[derive(Clone, Copy)]
pub(crate) struct Ground<'a> {
    /// Voxels along x, y, z.
    pub(crate) dims: [u32; 4],
    /// Rows of the linear map from metres to voxels.
    pub(crate) index: [[f32; 4]; 3],
    /// Cells of the majorant along x, y, z; voxels of a cell's side.
    pub(crate) cells: [u32; 4],
    pub(crate) majorant: &'a [[f32; 2]],
    /// The largest extinction per unit of density.
    pub(crate) densest: f32,
    /// The least majorant where anything is.
    pub(crate) least: f32,
}

/// A walk in index space.
#[derive(Clone, Copy)]
pub(crate) struct Walk {
    pub(crate) origin: Vec3,
    /// Voxels per metre.
    pub(crate) direction: Vec3,
    /// Metres along.
    pub(crate) t: f32,
    /// Where it ends.
    pub(crate) far: f32,
    pub(crate) cell: [i32; 3],
    /// Whether it has ended.
    pub(crate) over: bool,
}

/// A direction of the world in voxels per metre, far enough from parallel to the walls to divide by.
#[inline]
pub(crate) fn carried(on: &Ground<'_>, d: Vec3) -> Vec3 {
    let carried = on.index.map(|r| d.x * r[0] + d.y * r[1] + d.z * r[2]);
    Vec3::from(carried.map(|c| if c.abs() < 1e-20 { 1e-20 } else { c }))
}

/// The walk from a place along a direction of index space within the box, to `limit` metres at the most.
#[inline]
pub(crate) fn walk(on: &Ground<'_>, origin: Vec3, direction: Vec3, limit: f32) -> Walk {
    let size = Vec3::new(on.dims[0] as f32, on.dims[1] as f32, on.dims[2] as f32);
    let lower = (Vec3::splat(-0.5) - origin) / direction;
    let upper = (size - 0.5 - origin) / direction;
    let near = lower.min(upper).max_element().max(0.0);
    let far = lower.max(upper).min_element().min(limit);
    let side = on.cells[3] as f32;
    let at = ((origin + near * direction + 0.5) / side).floor();
    let cell = [0, 1, 2].map(|a| at[a].max(0.0).min((on.cells[a] - 1) as f32) as i32);
    Walk { origin, direction, t: near, far, cell, over: near >= far }
}

/// Where it stands, in index space.
#[inline]
pub(crate) fn stands(of: &Walk) -> Vec3 {
    of.origin + of.t * of.direction
}

/// On to the next tentative collision within the cell, whose rate it gives; else to the next cell, and 0.
#[inline]
pub(crate) fn advance(on: &Ground<'_>, of: &mut Walk, draws: &mut Draws) -> f32 {
    let side = on.cells[3] as f32;
    let leave = |a: usize| {
        let ahead = of.cell[a] + i32::from(of.direction[a] > 0.0);
        (ahead as f32 * side - 0.5 - of.origin[a]) / of.direction[a]
    };
    let leave = [leave(0), leave(1), leave(2)];
    let axis = if leave[0] <= leave[1] && leave[0] <= leave[2] {
        0
    } else if leave[1] <= leave[2] {
        1
    } else {
        2
    };
    let exit = leave[axis].min(of.far);
    let [x, y, _, _] = on.cells;
    let number = (of.cell[2] as usize * y as usize + of.cell[1] as usize) * x as usize + of.cell[0] as usize;
    let most = on.majorant[number][1];
    if most > 0.0 {
        let rate = (most * on.densest).max(on.least);
        if rate > 0.0 {
            let next = of.t + optical_depth(draw(draws)) / rate;
            if next < exit {
                of.t = next;
                return rate;
            }
        }
    }
    of.t = of.t.max(exit);
    of.cell[axis] += if of.direction[axis] > 0.0 { 1 } else { -1 };
    of.over = exit >= of.far || of.cell[axis] < 0 || of.cell[axis] as u32 >= on.cells[axis];
    0.0
}
