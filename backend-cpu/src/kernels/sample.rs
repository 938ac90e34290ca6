//! Rays through the box of the medium.

use super::field::Scalars;
use crate::packet::{F, LANES, M, triple};

/// Coarse maxima over blocks of voxels, for stepping over empty space.
#[derive(Clone, Copy)]
pub(crate) struct Occupancy<'a> {
    cells: &'a [[f32; 2]],
    dims: [u32; 3],
    side: f32,
}

impl<'a> Occupancy<'a> {
    /// Blocks along x, y, z and their side in voxels.
    pub(crate) fn new(cells: &'a [[f32; 2]], dims: [u32; 4]) -> Self {
        let [x, y, z, side] = dims;
        assert!(x > 0 && y > 0 && z > 0 && cells.len() >= x as usize * y as usize * z as usize);
        Self { cells, dims: [x, y, z], side: side as f32 }
    }

    /// Where every active lane stands in an empty block: the number of the next sample that any of them must look
    /// at. Else none. Samples lie at `t0 + (k + place) Δ` along `origin + t · direction` (index space).
    #[inline(always)]
    pub(crate) fn skip(&self, ray: &Ray, t: F, k: f32, active: M) -> Option<f32> {
        let mut next = f32::INFINITY;
        for i in 0..LANES {
            if !active.lane(i) {
                continue;
            }
            let mut exit = f32::INFINITY;
            let mut at = [0usize; 3];
            for a in 0..3 {
                let d = ray.direction[a].0[i];
                let block = ((ray.origin[a].0[i] + t.0[i] * d + 0.5) / self.side).floor();
                let block = block.clamp(0.0, (self.dims[a] - 1) as f32);
                at[a] = block as usize;
                let wall = if d > 0.0 { (block + 1.0) * self.side - 0.5 } else { block * self.side - 0.5 };
                let leave = (wall - ray.origin[a].0[i]) / d;
                exit = if leave < exit { leave } else { exit };
            }
            let cell = (at[2] * self.dims[1] as usize + at[1]) * self.dims[0] as usize + at[0];
            if self.cells[cell][1] > 0.0 {
                return None;
            }
            // The sample before the wall is looked at again, so that rounding cannot pass over one behind it.
            let beyond = ((exit - ray.start.0[i]) / ray.step.0[i] - ray.place.0[i]).floor();
            next = next.min(beyond);
        }
        Some(next.max(k + 1.0))
    }
}

/// A packet of rays in index space, cut into equal steps.
pub(crate) struct Ray {
    /// Origin in index space.
    pub(crate) origin: [F; 3],
    /// Direction in voxels per metre.
    pub(crate) direction: [F; 3],
    /// Metres along the ray where the first step begins.
    pub(crate) start: F,
    /// Length of a step, metres; zero where there is none.
    pub(crate) step: F,
    /// Number of steps.
    pub(crate) steps: F,
    /// Where a step is sampled, as a part of it.
    pub(crate) place: F,
}

impl Ray {
    /// The ray from `origin` clipped to the box of `size` voxels and to `[0, limit]` metres, in
    /// ceil(length / longest) equal steps.
    #[inline(always)]
    pub(crate) fn through(origin: [F; 3], direction: [F; 3], size: [f32; 3], limit: F, longest: f32) -> Self {
        // A ray along a wall: far enough from parallel that the quotients below are numbers.
        let direction = triple!(a => direction[a].away_from_zero());
        let lower = triple!(a => (F::splat(-0.5) - origin[a]) / direction[a]);
        let upper = triple!(a => (F::splat(size[a] - 0.5) - origin[a]) / direction[a]);
        let [x, y, z] = triple!(a => (lower[a].min(upper[a]), lower[a].max(upper[a])));
        let near = F::ZERO.max(x.0).max(y.0).max(z.0);
        let far = limit.min(x.1).min(y.1).min(z.1);
        let length = (far - near).max(F::ZERO);
        let steps = (length / longest).ceil();
        let step = steps.gt(F::ZERO).select(length / steps.max(F::ONE), F::ZERO);
        Self { origin, direction, start: near, step, steps, place: F::splat(0.5) }
    }

    /// The same part of the ray in `count` steps.
    #[inline(always)]
    pub(crate) fn in_steps(self, count: f32) -> Self {
        let steps = self.steps.gt(F::ZERO).select(F::splat(count), F::ZERO);
        Self { step: self.step * self.steps / count, steps, ..self }
    }

    /// The point `t` metres along.
    #[inline(always)]
    pub(crate) fn along(&self, t: F) -> [F; 3] {
        triple!(a => self.origin[a] + t * self.direction[a])
    }

    /// Where step `k` is sampled, in metres along.
    #[inline(always)]
    pub(crate) fn middle(&self, k: f32) -> F {
        self.start + self.step * (self.place + k)
    }

    /// The column of density along the ray, in units of density times metres.
    #[inline(always)]
    pub(crate) fn column(&self, density: Scalars<'_>, occupancy: Option<Occupancy<'_>>, lanes: M) -> F {
        let steps = lanes.select(self.steps, F::ZERO);
        let last = steps.max_lane();
        let mut sum = F::ZERO;
        let mut k = 0.0;
        while k < last {
            let active = F::splat(k).lt(steps);
            let t = self.middle(k);
            if let Some(next) = occupancy.and_then(|o| o.skip(self, t, k, active)) {
                k = next;
                continue;
            }
            sum = active.select(sum + density.sample(self.along(t)), sum);
            k += 1.0;
        }
        sum * self.step
    }
}
