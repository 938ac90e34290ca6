//! Walks along rays from one tentative collision to the next, through cells of constant rate.

use airlight_core::device::DeviceError;
use airlight_core::glam::Vec3;

use super::random::{Series, optical_depth};
use crate::packet::{F, I, M, triple};
use crate::simd::Simd;

/// What is walked through.
#[derive(Clone, Copy)]
pub(crate) struct Ground<'a> {
    /// Voxels along x, y, z.
    pub(crate) dims: [u32; 4],
    /// Rows of the linear map from metres to voxels.
    pub(crate) index: [[f32; 4]; 3],
    /// Cells of the majorant along x, y, z; voxels of a cell's side.
    pub(crate) cells: [u32; 4],
    /// At least one, and no more than [`Ground::MOST`].
    majorant: &'a [[f32; 2]],
    /// The largest extinction per unit of density.
    pub(crate) densest: f32,
    /// The least majorant where anything is.
    pub(crate) least: f32,
}

impl<'a> Ground<'a> {
    /// Cells of a majorant whose floats packets can count.
    const MOST: usize = i32::MAX as usize / 2;

    /// What is walked through with the largest extinction per unit of density and the least majorant where anything is; more
    /// cells than can be counted are refused.
    pub(crate) fn new(
        dims: [u32; 4],
        index: [[f32; 4]; 3],
        cells: [u32; 4],
        majorant: &'a [[f32; 2]],
        [densest, least]: [f32; 2],
    ) -> Result<Self, DeviceError> {
        if majorant.is_empty() || majorant.len() > Self::MOST {
            let (requested, limit) = (majorant.len() as u64, Self::MOST as u64);
            return Err(DeviceError::Limit { what: "cells of a majorant", requested, limit });
        }
        Ok(Self { dims, index, cells, majorant, densest, least })
    }
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
    let carried = triple!(a => d.x * on.index[a][0] + d.y * on.index[a][1] + d.z * on.index[a][2]);
    Vec3::from(triple!(a => if carried[a].abs() < 1e-20 { 1e-20 } else { carried[a] }))
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
    let at = (origin + near * direction + 0.5) / side;
    // A conversion rounds down what is not negative.
    let cell = triple!(a => at[a].max(0.0).min((on.cells[a] - 1) as f32) as i32);
    Walk { origin, direction, t: near, far, cell, over: near >= far }
}

/// The walks of the lanes of a packet.
#[derive(Clone, Copy)]
pub(crate) struct Walks<S> {
    origin: [F<S>; 3],
    direction: [F<S>; 3],
    pub(crate) t: F<S>,
    far: F<S>,
    cell: [I<S>; 3],
    /// Where each leaves its cell along each axis.
    leave: [F<S>; 3],
    pub(crate) over: M<S>,
}

impl<S: Simd> Walks<S> {
    /// Walks that have ended.
    #[inline(always)]
    pub(crate) fn idle() -> Self {
        let none = [F::ZERO; 3];
        let cell = [I::ZERO; 3];
        Self { origin: none, direction: none, t: F::ZERO, far: F::ZERO, cell, leave: none, over: M::ALL }
    }

    /// That of a lane.
    #[inline(always)]
    pub(crate) fn get(&self, i: usize) -> Walk {
        Walk {
            origin: Vec3::from(triple!(a => self.origin[a].0[i])),
            direction: Vec3::from(triple!(a => self.direction[a].0[i])),
            t: self.t.0[i],
            far: self.far.0[i],
            cell: triple!(a => self.cell[a].0[i]),
            over: self.over.lane(i),
        }
    }

    /// Gives a lane another.
    #[inline(always)]
    pub(crate) fn set(&mut self, on: &Ground<'_>, i: usize, of: &Walk) {
        let side = on.cells[3] as f32;
        for a in 0..3 {
            let ahead = of.cell[a] + i32::from(of.direction[a] > 0.0);
            self.origin[a].0[i] = of.origin[a];
            self.direction[a].0[i] = of.direction[a];
            self.cell[a].0[i] = of.cell[a];
            self.leave[a].0[i] = (ahead as f32 * side - 0.5 - of.origin[a]) / of.direction[a];
        }
        (self.t.0[i], self.far.0[i]) = (of.t, of.far);
        self.over.set(i, of.over);
    }

    /// Where they stand, in index space.
    #[inline(always)]
    pub(crate) fn stands(&self) -> [F<S>; 3] {
        triple!(a => self.origin[a] + self.t * self.direction[a])
    }

    /// Those that are `walking` on to the next tentative collision within the cell, whose rate it gives; else to the next cell,
    /// and 0.
    #[inline(always)]
    pub(crate) fn advance(&mut self, on: &Ground<'_>, draws: &mut Series<S>, walking: M<S>) -> F<S> {
        let [x, y, z] = self.leave;
        let first = y.ge(x).and(z.ge(x));
        let second = first.not().and(z.ge(y));
        let along = [first, second, first.or(second).not()];
        let of = |v: [F<S>; 3]| first.select(v[0], second.select(v[1], v[2]));
        let exit = of(self.leave).min(self.far);
        let [columns, rows, _, _] = on.cells.map(|n| n as i32);
        let number = self.cell[2].times(rows).plus(self.cell[1]).times(columns).plus(self.cell[0]);
        // What a lane holds that does not walk is no cell.
        let count = on.majorant.len() as i32;
        let known = walking.and(number.below(count)).and(number.below(0).not());
        let place = known.either(number.times(2).plus(I::splat(1)), I::splat(1));
        // SAFETY: of every number below their count, twice that and one more lies within the majorant's floats.
        #[allow(unsafe_code)]
        let most = F::of(unsafe { S::one(bytemuck::cast_slice(on.majorant), place.0) });
        let rate = (most * on.densest).max(F::splat(on.least));
        let draws_one = walking.and(most.gt(F::ZERO)).and(rate.gt(F::ZERO));
        let next = self.t + optical_depth(draws.draw(draws_one)) / rate;
        let met = draws_one.and(next.lt(exit));
        let leaves = walking.and(met.not());
        self.t = met.select(next, leaves.select(self.t.max(exit), self.t));
        let mut over = exit.ge(self.far);
        let mut ahead = I::ZERO;
        for a in 0..3 {
            let upward = self.direction[a].gt(F::ZERO);
            let step = along[a].and(leaves).either(upward.either(I::splat(1), I::splat(-1)), I::ZERO);
            self.cell[a] = self.cell[a].plus(step);
            over = over.or(self.cell[a].below(0)).or(self.cell[a].below(on.cells[a] as i32).not());
            ahead = along[a].either(self.cell[a].plus(upward.choose(1)), ahead);
        }
        self.over = leaves.and(over).or(leaves.not().and(self.over));
        let leave = (ahead.to_float() * on.cells[3] as f32 - 0.5 - of(self.origin)) / of(self.direction);
        self.leave = triple!(a => along[a].and(leaves).select(leave, self.leave[a]));
        met.select(rate, F::ZERO)
    }
}
