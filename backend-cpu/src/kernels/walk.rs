//! Walks along rays from one tentative collision to the next, through cells of constant rate.

use airlight_core::glam::Vec3;
use airlight_core::stage::{PathParams, PathRecord};

use super::random::{Draws, draw, optical_depth};

/// A walk in index space.
#[derive(Clone, Copy)]
pub(crate) struct Walk {
    origin: Vec3,
    /// Voxels per metre.
    direction: Vec3,
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
fn carried(p: &PathParams, d: Vec3) -> Vec3 {
    let row = |r: [f32; 4]| d.x * r[0] + d.y * r[1] + d.z * r[2];
    let carried = [row(p.index_x), row(p.index_y), row(p.index_z)];
    Vec3::from(carried.map(|c| if c.abs() < 1e-20 { 1e-20 } else { c }))
}

/// A place of the world, from the eye, in index space.
#[inline]
fn placed(p: &PathParams, x: Vec3) -> Vec3 {
    let row = |r: [f32; 4]| x.x * r[0] + x.y * r[1] + x.z * r[2];
    Vec3::new(p.eye[0] + row(p.index_x), p.eye[1] + row(p.index_y), p.eye[2] + row(p.index_z))
}

/// The walk from `x` along `d` within the box, to `limit` metres at the most.
#[inline]
pub(crate) fn walk(p: &PathParams, x: Vec3, d: Vec3, limit: f32) -> Walk {
    let (origin, direction) = (placed(p, x), carried(p, d));
    let size = Vec3::new(p.dims[0] as f32, p.dims[1] as f32, p.dims[2] as f32);
    let lower = (Vec3::splat(-0.5) - origin) / direction;
    let upper = (size - 0.5 - origin) / direction;
    let near = lower.min(upper).max_element().max(0.0);
    let far = lower.max(upper).min_element().min(limit);
    let side = p.majorant_cells[3] as f32;
    let at = ((origin + near * direction + 0.5) / side).floor();
    let cell = [0, 1, 2].map(|a| at[a].max(0.0).min((p.majorant_cells[a] - 1) as f32) as i32);
    Walk { origin, direction, t: near, far, cell, over: near >= far }
}

/// The walk that a record holds.
#[inline]
pub(crate) fn kept(p: &PathParams, of: &PathRecord) -> Walk {
    let ([x, y, z, t], [dx, dy, dz, far]) = (of.place, of.way);
    let [i, j, k, over] = of.cell;
    let cell = [i as i32, j as i32, k as i32];
    let (origin, direction) = (placed(p, Vec3::new(x, y, z)), carried(p, Vec3::new(dx, dy, dz)));
    Walk { origin, direction, t, far, cell, over: over == 1 }
}

/// Where it stands, in index space.
#[inline]
pub(crate) fn stands(of: &Walk) -> Vec3 {
    of.origin + of.t * of.direction
}

/// On to the next tentative collision within the cell, whose rate it gives; else to the next cell, and 0.
#[inline]
pub(crate) fn advance(p: &PathParams, majorant: &[[f32; 2]], of: &mut Walk, draws: &mut Draws) -> f32 {
    let side = p.majorant_cells[3] as f32;
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
    let [x, y, _, _] = p.majorant_cells;
    let number = (of.cell[2] as usize * y as usize + of.cell[1] as usize) * x as usize + of.cell[0] as usize;
    let most = majorant[number][1];
    if most > 0.0 {
        let rate = (most * p.densest).max(p.least);
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
    of.over = exit >= of.far || of.cell[axis] < 0 || of.cell[axis] as u32 >= p.majorant_cells[axis];
    0.0
}
