//! Lookups of fields.

use crate::packet::{F, I, LANES, M, lanes, lerp, triple};

/// Texels of four values in layers, which are fastest; looked up one point at a time.
#[derive(Clone, Copy)]
pub(crate) struct Colors<'a> {
    texels: &'a [[f32; 4]],
    dims: [usize; 3],
    layers: usize,
}

/// Where a lookup falls: offsets of the lower and the upper texel's first layer along each axis, and the place between
/// them.
#[derive(Clone, Copy)]
pub(crate) struct Place<'a> {
    texels: &'a [[f32; 4]],
    x: [usize; 2],
    y: [usize; 2],
    z: [usize; 2],
    f: [f32; 3],
}

impl<'a> Colors<'a> {
    /// The texels of a field of so many along x, y, z and layers.
    pub(crate) fn new(texels: &'a [[f32; 4]], [x, y, z, layers]: [u32; 4]) -> Self {
        Self { texels, dims: [x, y, z].map(|n| n as usize), layers: layers as usize }
    }

    /// Coordinate `p` within the texels' along axis `a`, also where it is not a number.
    #[inline(always)]
    fn within(&self, p: f32, a: usize) -> f32 {
        p.max(0.0).min((self.dims[a] - 1) as f32)
    }

    /// The nearest texels to `p`.
    #[inline(always)]
    pub(crate) fn nearest(&self, p: [f32; 3]) -> Place<'a> {
        // Half a texel on and rounded down.
        let at = triple!(a => self.within(p[a] + 0.5, a) as usize);
        self.place(at, at, [0.0; 3])
    }

    /// The texels around `p`, where texel i lies at i; indices clamped at the edge.
    #[inline(always)]
    pub(crate) fn sample(&self, p: [f32; 3]) -> Place<'a> {
        let q = triple!(a => self.within(p[a], a));
        let lo = triple!(a => q[a] as usize);
        let hi = triple!(a => (lo[a] + 1).min(self.dims[a] - 1));
        self.place(lo, hi, triple!(a => q[a] - lo[a] as f32))
    }

    /// RGB of the first layer around each lane's point; zero in lanes that are not active.
    #[inline(always)]
    pub(crate) fn packet(&self, p: [F; 3], active: M) -> [F; 3] {
        let mut found = [F::ZERO; 3];
        for i in 0..LANES {
            if active.lane(i) {
                let texel = self.sample(triple!(a => p[a].0[i])).layer(0);
                (0..3).for_each(|c| found[c].0[i] = texel[c]);
            }
        }
        found
    }

    #[inline(always)]
    fn place(&self, lo: [usize; 3], hi: [usize; 3], f: [f32; 3]) -> Place<'a> {
        let row = self.layers * self.dims[0];
        let pitch = [self.layers, row, row * self.dims[1]];
        let [x, y, z] = triple!(a => [lo[a] * pitch[a], hi[a] * pitch[a]]);
        Place { texels: self.texels, x, y, z, f }
    }
}

impl Place<'_> {
    /// The value of a layer: trilinear, x then y then z.
    #[inline(always)]
    pub(crate) fn layer(&self, layer: usize) -> [f32; 4] {
        let Self { y, z, f, .. } = *self;
        let near = mix(self.row(z[0] + y[0] + layer), self.row(z[0] + y[1] + layer), f[1]);
        let far = mix(self.row(z[1] + y[0] + layer), self.row(z[1] + y[1] + layer), f[1]);
        mix(near, far, f[2])
    }

    /// Between two texels of the row that starts at `start`.
    #[inline(always)]
    fn row(&self, start: usize) -> [f32; 4] {
        mix(self.texels[start + self.x[0]], self.texels[start + self.x[1]], self.f[0])
    }
}

/// a + (b - a) f of texels.
#[inline(always)]
fn mix(a: [f32; 4], b: [f32; 4], f: f32) -> [f32; 4] {
    [a[0] + (b[0] - a[0]) * f, a[1] + (b[1] - a[1]) * f, a[2] + (b[2] - a[2]) * f, a[3] + (b[3] - a[3]) * f]
}

/// One layer of scalars that packets look up: the only place that reads memory without a check.
#[derive(Clone, Copy)]
pub(crate) struct Scalars<'a> {
    texels: &'a [f32],
    dims: [i32; 3],
}

impl<'a> Scalars<'a> {
    /// The texels of a field of `dims`.
    pub(crate) fn new(texels: &'a [f32], dims: [u32; 4]) -> Self {
        let dims = [dims[0] as i32, dims[1] as i32, dims[2] as i32];
        assert!(dims.iter().all(|&d| d > 0));
        let count = dims.iter().map(|&d| d as usize).product::<usize>();
        assert!(texels.len() == count && count <= i32::MAX as usize);
        Self { texels, dims }
    }

    /// Texels along x, y, z as floats.
    #[inline(always)]
    pub(crate) fn size(&self) -> [f32; 3] {
        self.dims.map(|d| d as f32)
    }

    /// A single texel.
    #[inline(always)]
    pub(crate) fn texel(&self, [i, j, k]: [u32; 3]) -> f32 {
        self.texels[(k as usize * self.dims[1] as usize + j as usize) * self.dims[0] as usize + i as usize]
    }

    /// Coordinates `p` within the texels' along axis `a`, also where they are not numbers.
    #[inline(always)]
    fn within(&self, p: F, a: usize) -> F {
        p.max(F::ZERO).min(F::splat((self.dims[a] - 1) as f32))
    }

    /// Trilinear lookup at `p`, where texel i lies at i; x then y then z, indices clamped at the edge.
    #[inline(always)]
    pub(crate) fn sample(&self, p: [F; 3]) -> F {
        // Clamping the point is clamping both indices: beyond the outermost centres both are the same texel.
        let q = triple!(a => self.within(p[a], a));
        let lo = triple!(a => q[a].to_int());
        let f = triple!(a => q[a] - F(lanes!(i => lo[a].0[i] as f32)));
        let (row, slice) = (self.dims[0], self.dims[0] * self.dims[1]);
        let pitch = [1, row, slice];
        // Steps in offset to the upper texel: none at the edge.
        let [dx, dy, dz] = triple!(a => I(lanes!(i => if lo[a].0[i] < self.dims[a] - 1 { pitch[a] } else { 0 })));
        let near = I(lanes!(i => lo[0].0[i] + lo[1].0[i] * row + lo[2].0[i] * slice));
        let far = near.plus(dz);
        let near = lerp(self.row(near, dx, f[0]), self.row(near.plus(dy), dx, f[0]), f[1]);
        let far = lerp(self.row(far, dx, f[0]), self.row(far.plus(dy), dx, f[0]), f[1]);
        lerp(near, far, f[2])
    }

    /// The same at a single point.
    #[inline(always)]
    pub(crate) fn single(&self, p: [f32; 3]) -> f32 {
        let q = triple!(a => p[a].max(0.0).min((self.dims[a] - 1) as f32));
        let lo = triple!(a => q[a] as usize);
        let f = triple!(a => q[a] - lo[a] as f32);
        let pitch = [1, self.dims[0] as usize, self.dims[0] as usize * self.dims[1] as usize];
        let [dx, dy, dz] = triple!(a => if lo[a] + 1 < self.dims[a] as usize { pitch[a] } else { 0 });
        let near = lo[0] + lo[1] * pitch[1] + lo[2] * pitch[2];
        let mix = |a: f32, b: f32, f: f32| a + (b - a) * f;
        let row = |at: usize| mix(self.texels[at], self.texels[at + dx], f[0]);
        let plane = |at: usize| mix(row(at), row(at + dy), f[1]);
        mix(plane(near), plane(near + dz), f[2])
    }

    /// Between the texels at `at` and `dx` further.
    #[inline(always)]
    fn row(&self, at: I, dx: I, f: F) -> F {
        lerp(self.gather(at), self.gather(at.plus(dx)), f)
    }

    #[inline(always)]
    fn gather(&self, offset: I) -> F {
        // SAFETY: offsets come from `sample` alone: each index is clamped to [0, dims - 1], also where the point is
        // not a number, steps stay within, and `new` checked that the texels are as many as dims say.
        #[allow(unsafe_code)]
        F(lanes!(i => unsafe { *self.texels.get_unchecked(offset.0[i] as usize) }))
    }
}
