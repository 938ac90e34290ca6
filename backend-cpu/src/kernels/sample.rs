//! Rays through the box of the medium.

use airlight_core::stage::Reduce;

use super::field::Scalars;
use crate::packet::{F, I, M, each, triple};
use crate::simd::Simd;

/// Coarse maxima over blocks of voxels, for stepping over empty space.
#[derive(Clone, Copy)]
pub(crate) struct Occupancy<'a> {
    cells: &'a [[f32; 2]],
    dims: [i32; 3],
    side: f32,
    /// Blocks per voxel.
    per_voxel: f32,
}

/// What lies before a packet of rays.
pub(crate) enum Ahead {
    /// Nothing, up to the sample of this number.
    Empty(f32),
    /// Something, and until the sample of this number it is of no use to ask again.
    Dense(f32),
}

/// Where a packet of rays is sampled, and its way through the blocks of an occupancy: what does not change along it.
pub(crate) struct Samples<S> {
    /// Where the first sample lies, and from there to the next one, in index space.
    origin: [F<S>; 3],
    stride: [F<S>; 3],
    /// The first sample beyond what block n along an axis shows is n `wide` behind `leave`.
    wide: [F<S>; 3],
    leave: [F<S>; 3],
}

impl<S: Simd> Samples<S> {
    /// Where sample `k` lies.
    #[inline(always)]
    pub(crate) fn sampled(&self, k: f32) -> [F<S>; 3] {
        triple!(a => self.origin[a] + self.stride[a] * k)
    }
}

impl<'a> Occupancy<'a> {
    /// Blocks along x, y, z and their side in voxels.
    pub(crate) fn new(cells: &'a [[f32; 2]], dims: [u32; 4]) -> Self {
        let [x, y, z, side] = dims;
        assert!(x > 0 && y > 0 && z > 0 && cells.len() >= x as usize * y as usize * z as usize);
        let (dims, side) = ([x as i32, y as i32, z as i32], side as f32);
        Self { cells, dims, side, per_voxel: 1.0 / side }
    }

    /// Where every active lane stands in an empty block at sample `k`: the number of the next sample that any of them must
    /// look at, the first beyond what is known to be empty. Else until when one of them stands in a block that is not empty.
    #[inline(always)]
    pub(crate) fn skip<S: Simd>(&self, samples: &Samples<S>, k: f32, active: M<S>) -> Ahead {
        let at = samples.sampled(k);
        let last = triple!(a => (self.dims[a] - 1) as f32);
        // Rounded toward zero in place of down is what lies before the first block, and clamped to it.
        let block = triple!(a => ((at[a] + 0.5) * self.per_voxel).max(F::ZERO).min(F::splat(last[a])).to_int());
        // The maximum is the second float of a block.
        let [nx, ny, _] = self.dims;
        let place = block[2].times(ny).plus(block[1]).times(nx).plus(block[0]);
        let place = place.plus(place).plus(I::splat(1));
        // SAFETY: indices are clamped to the blocks, which `new` checked to be as many as dims say.
        #[allow(unsafe_code)]
        let most = F::of(unsafe { S::one(bytemuck::cast_slice(self.cells), place.0) });
        let leave = triple!(a => block[a].to_float() * samples.wide[a] + samples.leave[a]);
        let beyond = leave[0].min(leave[1]).min(leave[2]).floor();
        let dense = active.and(most.gt(F::ZERO));
        if dense.any() {
            return Ahead::Dense(dense.select(beyond, F::ZERO).max_lane().max(k + 1.0));
        }
        Ahead::Empty(active.select(beyond, F::splat(f32::INFINITY)).min_lane().max(k + 1.0))
    }
}

/// A packet of rays in index space, cut into equal steps.
pub(crate) struct Ray<S> {
    /// Origin in index space.
    pub(crate) origin: [F<S>; 3],
    /// Direction in voxels per metre.
    pub(crate) direction: [F<S>; 3],
    /// Metres per voxel, of its sign.
    pub(crate) inverse: [F<S>; 3],
    /// Metres along the ray where the first step begins.
    pub(crate) start: F<S>,
    /// Length of a step, metres; zero where there is none.
    pub(crate) step: F<S>,
    /// Number of steps.
    pub(crate) steps: F<S>,
    /// Where a step is sampled, as a part of it.
    pub(crate) place: F<S>,
}

impl<S: Simd> Ray<S> {
    /// The ray from `origin` clipped to the box of `size` voxels and to `[0, limit]` metres, in
    /// ceil(length / longest) equal steps.
    #[inline(always)]
    pub(crate) fn through(origin: [F<S>; 3], direction: [F<S>; 3], size: [f32; 3], limit: F<S>, longest: f32) -> Self {
        // A ray along a wall: far enough from parallel that what is below are numbers.
        let direction = triple!(a => direction[a].away_from_zero());
        let inverse = triple!(a => F::ONE / direction[a]);
        let lower = triple!(a => (F::splat(-0.5) - origin[a]) * inverse[a]);
        let upper = triple!(a => (F::splat(size[a] - 0.5) - origin[a]) * inverse[a]);
        let [x, y, z] = triple!(a => (lower[a].min(upper[a]), lower[a].max(upper[a])));
        let near = F::ZERO.max(x.0).max(y.0).max(z.0);
        let far = limit.min(x.1).min(y.1).min(z.1);
        let length = (far - near).max(F::ZERO);
        let steps = (length / longest).ceil();
        let step = steps.gt(F::ZERO).select(length / steps.max(F::ONE), F::ZERO);
        Self { origin, direction, inverse, start: near, step, steps, place: F::splat(0.5) }
    }

    /// Metres of a ray within the box and to `limit`, from a point in the box.
    #[inline(always)]
    pub(crate) fn reach(origin: [F<S>; 3], direction: [F<S>; 3], size: [f32; 3], limit: F<S>) -> F<S> {
        let direction = triple!(a => direction[a].away_from_zero());
        let wall = triple!(a => direction[a].gt(F::ZERO).select(F::splat(size[a] - 0.5), F::splat(-0.5)));
        let [x, y, z] = triple!(a => (wall[a] - origin[a]) / direction[a]);
        limit.min(x).min(y).min(z).max(F::ZERO)
    }

    /// The same part of the ray in `count` steps.
    #[inline(always)]
    pub(crate) fn in_steps(self, count: f32) -> Self {
        let steps = self.steps.gt(F::ZERO).select(F::splat(count), F::ZERO);
        Self { step: self.step * self.steps / count, steps, ..self }
    }

    /// The point `t` metres along.
    #[inline(always)]
    pub(crate) fn along(&self, t: F<S>) -> [F<S>; 3] {
        triple!(a => self.origin[a] + t * self.direction[a])
    }

    /// Where step `k` is sampled, in metres along.
    #[inline(always)]
    pub(crate) fn middle(&self, k: f32) -> F<S> {
        self.start + self.step * (self.place + k)
    }

    /// Where the ray is sampled, once `place` is known.
    #[inline(always)]
    pub(crate) fn samples(&self, occupancy: Option<Occupancy<'_>>) -> Samples<S> {
        let origin = self.along(self.middle(0.0));
        let stride = triple!(a => self.direction[a] * self.step);
        let (mut wide, mut leave) = ([F::ZERO; 3], [F::ZERO; 3]);
        if let Some(occupancy) = occupancy {
            let (before, behind) = (-0.5 - Reduce::BEYOND, occupancy.side - 0.5 + Reduce::BEYOND);
            let per_metre = F::ONE / self.step;
            let per = triple!(a => self.inverse[a] * per_metre);
            wide = triple!(a => per[a] * occupancy.side);
            leave = triple!(a => {
                let wall = self.direction[a].gt(F::ZERO).select(F::splat(behind), F::splat(before));
                (wall - origin[a]) * per[a] + 1.0
            });
        }
        Samples { origin, stride, wide, leave }
    }

    /// The column of density along the ray, in units of density times metres.
    #[inline(always)]
    pub(crate) fn column(&self, density: Scalars<'_>, occupancy: Option<Occupancy<'_>>, lanes: M<S>) -> F<S> {
        /// Lookups that wait less for each other.
        const TOGETHER: usize = 2;
        let steps = lanes.select(self.steps, F::ZERO);
        let (last, samples) = (steps.max_lane(), self.samples(occupancy));
        let mut sum = F::ZERO;
        let mut k = 0.0;
        while k < last {
            let mut until = last;
            if let Some(occupancy) = occupancy {
                match occupancy.skip(&samples, k, F::splat(k).lt(steps)) {
                    Ahead::Empty(next) => {
                        k = next;
                        continue;
                    }
                    Ahead::Dense(next) => until = next.min(last),
                }
            }
            // The last one of them may lie behind what was asked of.
            while k < until {
                let at = each!(n in TOGETHER, [F::ZERO; 3] => samples.sampled(k + n as f32));
                let density = density.several::<S, TOGETHER>(at);
                for n in 0..TOGETHER {
                    sum = F::splat(k + n as f32).lt(steps).select(sum + density[n], sum);
                }
                k += TOGETHER as f32;
            }
        }
        sum * self.step
    }
}
