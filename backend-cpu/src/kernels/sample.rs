//! Lookups of fields, and rays through their box.

use crate::packet::{F, I, LANES, M, lanes, lerp, triple};

/// One layer of texels that packets look up: the only place that reads memory without a check.
#[derive(Clone, Copy)]
pub(crate) struct Texels<'a> {
    data: &'a [f32],
    dims: [i32; 3],
}

/// A cell of eight texels around a point: offsets of the texels, and where the point lies between them.
struct Corners {
    /// Offset of (x0, y0, z0) and the steps to x1, y1, z1, which are zero at the edge.
    base: I,
    step: [I; 3],
    f: [F; 3],
}

impl<'a> Texels<'a> {
    /// The scalars of a field of `dims`.
    pub(crate) fn new(data: &'a [f32], dims: [u32; 4]) -> Self {
        let dims = [dims[0] as i32, dims[1] as i32, dims[2] as i32];
        assert!(dims.iter().all(|&d| d > 0));
        let texels = dims.iter().map(|&d| d as usize).product::<usize>();
        assert!(data.len() == texels && texels <= i32::MAX as usize);
        Self { data, dims }
    }

    /// Texels along x, y, z as floats.
    #[inline(always)]
    pub(crate) fn size(&self) -> [f32; 3] {
        self.dims.map(|d| d as f32)
    }

    /// Along axis `a`: the lower of the two texels around `p`, the step in offset to the upper one, and the place
    /// between them. Indices are clamped at the edge.
    #[inline(always)]
    fn between(&self, p: F, a: usize, pitch: i32) -> (I, I, F) {
        // Clamping the point is clamping both indices: beyond the outermost centres both are the same texel.
        let last = self.dims[a] - 1;
        let q = p.max(F::ZERO).min(F::splat(last as f32));
        let at = q.to_int();
        let f = q - F(lanes!(i => at.0[i] as f32));
        let step = I(lanes!(i => if at.0[i] < last { pitch } else { 0 }));
        (at, step, f)
    }

    /// The texels around `p`.
    #[inline(always)]
    fn corners(&self, p: [F; 3]) -> Corners {
        let (row, slice) = (self.dims[0], self.dims[0] * self.dims[1]);
        let (x, dx, fx) = self.between(p[0], 0, 1);
        let (y, dy, fy) = self.between(p[1], 1, row);
        let (z, dz, fz) = self.between(p[2], 2, slice);
        let base = I(lanes!(i => x.0[i] + y.0[i] * row + z.0[i] * slice));
        Corners { base, step: [dx, dy, dz], f: [fx, fy, fz] }
    }

    #[inline(always)]
    fn gather(&self, offset: I) -> F {
        // SAFETY: offsets come from `corners` alone: each index is clamped to [0, dims - 1], also where the point is
        // not a number, steps stay within, and `new` checked that the texels are as many as dims say.
        #[allow(unsafe_code)]
        F(lanes!(i => unsafe { *self.data.get_unchecked(offset.0[i] as usize) }))
    }

    /// Interpolates along x between the texels at `at` and `dx` further.
    #[inline(always)]
    fn row(&self, at: I, dx: I, f: F) -> F {
        lerp(self.gather(at), self.gather(at.plus(dx)), f)
    }

    /// Trilinear lookup at `p` in index space, x then y then z.
    #[inline(always)]
    pub(crate) fn sample(&self, p: [F; 3]) -> F {
        let Corners { base, step: [dx, dy, dz], f } = self.corners(p);
        let near = lerp(self.row(base, dx, f[0]), self.row(base.plus(dy), dx, f[0]), f[1]);
        let base = base.plus(dz);
        let far = lerp(self.row(base, dx, f[0]), self.row(base.plus(dy), dx, f[0]), f[1]);
        lerp(near, far, f[2])
    }

    /// Trilinear lookup of a single point.
    pub(crate) fn sample_one(&self, p: [f32; 3]) -> f32 {
        self.sample(p.map(F::splat)).0[0]
    }
}

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
    /// at. Else none. Samples lie at `t0 + (k + ½) Δ` along `origin + t · direction` (index space).
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
            let beyond = ((exit - ray.start.0[i]) / ray.step.0[i] - 0.5).floor();
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
        Self { origin, direction, start: near, step, steps }
    }

    /// The point `t` metres along.
    #[inline(always)]
    pub(crate) fn at(&self, t: F) -> [F; 3] {
        triple!(a => self.origin[a] + t * self.direction[a])
    }

    /// The middle of step `k`, in metres along.
    #[inline(always)]
    pub(crate) fn middle(&self, k: f32) -> F {
        self.start + self.step * (k + 0.5)
    }

    /// The column of density along the ray, in units of density times metres.
    #[inline(always)]
    pub(crate) fn column(&self, density: Texels<'_>, occupancy: Option<Occupancy<'_>>, lanes: M) -> F {
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
            sum = active.select(sum + density.sample(self.at(t)), sum);
            k += 1.0;
        }
        sum * self.step
    }
}

/// a + (b - a) f of texels.
#[inline(always)]
fn mix(a: [f32; 4], b: [f32; 4], f: f32) -> [f32; 4] {
    [a[0] + (b[0] - a[0]) * f, a[1] + (b[1] - a[1]) * f, a[2] + (b[2] - a[2]) * f, a[3] + (b[3] - a[3]) * f]
}

/// Where a lookup falls in a field over the record cells: offsets of the lower and the upper texel's first layer along
/// each axis, and the place between them.
#[derive(Clone, Copy)]
pub(crate) struct Place {
    x: [usize; 2],
    y: [usize; 2],
    z: [usize; 2],
    f: [f32; 3],
}

impl Place {
    /// Of the point `p`, where texel i lies at i; both texels are the nearest one unless `trilinear`.
    #[inline(always)]
    pub(crate) fn new(dims: [usize; 3], layers: usize, p: [f32; 3], trilinear: bool) -> Self {
        let [x, y, z] = triple!(a => between(dims[a], p[a], trilinear));
        let (row, slice) = (layers * dims[0], layers * dims[0] * dims[1]);
        Self {
            x: [x.0 * layers, x.1 * layers],
            y: [y.0 * row, y.1 * row],
            z: [z.0 * slice, z.1 * slice],
            f: [x.2, y.2, z.2],
        }
    }
}

/// The two texels around `p` of `n`, clamped at the edge, and the place between them.
#[inline(always)]
fn between(n: usize, p: f32, trilinear: bool) -> (usize, usize, f32) {
    let last = (n - 1) as f32;
    if trilinear {
        let q = p.max(0.0).min(last);
        let at = q as usize;
        (at, (at + 1).min(n - 1), q - at as f32)
    } else {
        // Half a texel on and rounded down.
        let at = (p + 0.5).max(0.0).min(last) as usize;
        (at, at, 0.0)
    }
}

/// Trilinear lookup of one layer of an RGBA field whose layers are fastest, x then y then z.
#[inline(always)]
pub(crate) fn sample_rgba(texels: &[[f32; 4]], place: Place, layer: usize) -> [f32; 4] {
    let Place { x, y, z, f } = place;
    let near = mix_row(texels, z[0] + y[0] + layer, x, f[0]);
    let near = mix(near, mix_row(texels, z[0] + y[1] + layer, x, f[0]), f[1]);
    let far = mix_row(texels, z[1] + y[0] + layer, x, f[0]);
    let far = mix(far, mix_row(texels, z[1] + y[1] + layer, x, f[0]), f[1]);
    mix(near, far, f[2])
}

/// Interpolates along x between two texels of the row that starts at `row`.
#[inline(always)]
fn mix_row(texels: &[[f32; 4]], row: usize, x: [usize; 2], f: f32) -> [f32; 4] {
    mix(texels[row + x[0]], texels[row + x[1]], f)
}
