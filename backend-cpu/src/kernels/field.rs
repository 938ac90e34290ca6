//! Lookups of fields.

use airlight_core::device::{BrickLayout, FieldSpec, Layout};

use crate::held::{Bricks, Held, Pairs};
use crate::packet::{F, I, LANES, M, apart, each, lerp, triple};
use crate::simd::Simd;

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
    pub(crate) fn packet<S: Simd>(&self, p: [F<S>; 3], active: M<S>) -> [F<S>; 3] {
        self.sums(&self.places(p, true), 0, &[F::ONE], active)
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

/// Where the lookups of a packet fall in [`Colors`].
pub(crate) struct Places<S> {
    /// The lower texel's first layer.
    near: I<S>,
    /// From there to the upper texel along each axis: nothing at the edge.
    hop: [I<S>; 3],
    /// The place between them.
    f: [F<S>; 3],
}

/// Lanes whose lookups fall between the same texels.
struct Group<'a, S> {
    lanes: M<S>,
    /// Whether they are so few that one by one is faster.
    few: bool,
    place: Place<'a>,
}

impl<'a> Colors<'a> {
    /// The texels around each lane's `p`, or the nearest one.
    #[inline(always)]
    pub(crate) fn places<S: Simd>(&self, p: [F<S>; 3], trilinear: bool) -> Places<S> {
        let last = triple!(a => (self.dims[a] - 1) as f32);
        let by = if trilinear { 0.0 } else { 0.5 };
        let q = triple!(a => (p[a] + by).max(F::ZERO).min(F::splat(last[a])));
        let lo = triple!(a => q[a].to_int());
        let row = (self.layers * self.dims[0]) as i32;
        let pitch = [self.layers as i32, row, row * self.dims[1] as i32];
        let reach = triple!(a => if trilinear { self.dims[a] as i32 - 1 } else { 0 });
        let weight = if trilinear { 1.0 } else { 0.0 };
        Places {
            near: lo[0].times(pitch[0]).plus(lo[1].times(pitch[1])).plus(lo[2].times(pitch[2])),
            hop: triple!(a => lo[a].below(reach[a]).choose(pitch[a])),
            f: triple!(a => (q[a] - lo[a].to_float()) * weight),
        }
    }

    /// Layers from `first` on, times a weight each, added up: the first channels of them in `lanes`, zero elsewhere.
    #[inline(always)]
    pub(crate) fn sums<S: Simd, const CHANNELS: usize>(
        &self,
        places: &Places<S>,
        first: usize,
        weights: &[F<S>],
        lanes: M<S>,
    ) -> [F<S>; CHANNELS] {
        let (mut sums, mut left) = ([F::ZERO; CHANNELS], lanes);
        // Vectors of lanes that are looked up one by one, which become packets all at once.
        let (mut alone, mut vectors) = (M::NONE, [[0.0; 4]; LANES]);
        while left.any() {
            let group = self.group(places, left);
            left = left.and(group.lanes.not());
            if group.few {
                alone = alone.or(group.lanes);
                let mut bits = group.lanes.bits();
                while bits != 0 {
                    let i = bits.trailing_zeros() as usize;
                    bits &= bits - 1;
                    vectors[i] = group.single(places, first, weights, i);
                }
            } else {
                let mut k = 0;
                while k < weights.len() {
                    group.add(places, first + k, weights[k], &mut sums);
                    k += 1;
                }
            }
        }
        if alone.any() {
            let vectors = apart(vectors);
            sums = each!(c in CHANNELS, F::ZERO => alone.select(vectors[c], sums[c]));
        }
        sums
    }

    /// The first of the lanes `left` and those that fall between the same texels.
    #[inline(always)]
    fn group<S: Simd>(&self, places: &Places<S>, left: M<S>) -> Group<'a, S> {
        /// Up to so many lanes one by one take less than a packet.
        const FEW: u32 = 2;
        let first = left.bits().trailing_zeros() as usize % LANES;
        let near = places.near.0[first];
        let lanes = left.and(places.near.is(near));
        let hop = triple!(a => places.hop[a].0[first] as usize);
        let place = Place {
            texels: self.texels,
            x: [near as usize, near as usize + hop[0]],
            y: [0, hop[1]],
            z: [0, hop[2]],
            f: triple!(a => places.f[a].0[first]),
        };
        Group { lanes, few: lanes.bits().count_ones() <= FEW, place }
    }
}

impl<S: Simd> Group<'_, S> {
    /// The sum of layers from `first` on, times a weight each, in lane `i`.
    #[inline(always)]
    fn single(&self, places: &Places<S>, first: usize, weights: &[F<S>], i: usize) -> [f32; 4] {
        let place = Place { f: triple!(a => places.f[a].0[i]), ..self.place };
        let (mut sum, mut k) = ([0.0; 4], 0);
        while k < weights.len() {
            let (texel, weight) = (place.layer(first + k), weights[k].0[i]);
            sum = [
                sum[0] + weight * texel[0],
                sum[1] + weight * texel[1],
                sum[2] + weight * texel[2],
                sum[3] + weight * texel[3],
            ];
            k += 1;
        }
        sum
    }

    /// Adds a layer times a weight to the group's lanes of `out`.
    #[inline(always)]
    fn add<const CHANNELS: usize>(&self, places: &Places<S>, layer: usize, weight: F<S>, out: &mut [F<S>; CHANNELS]) {
        let corner = |j: usize, k: usize| self.place.z[k] + self.place.y[j] + layer;
        let at = |start: usize, i: usize| self.place.texels[start + self.place.x[i]];
        let corners = [
            [at(corner(0, 0), 0), at(corner(0, 0), 1)],
            [at(corner(1, 0), 0), at(corner(1, 0), 1)],
            [at(corner(0, 1), 0), at(corner(0, 1), 1)],
            [at(corner(1, 1), 0), at(corner(1, 1), 1)],
        ];
        out[0] = self.channel(&corners, places, 0, weight, out[0]);
        out[1] = self.channel(&corners, places, 1, weight, out[1]);
        out[2] = self.channel(&corners, places, 2, weight, out[2]);
        if CHANNELS > 3 {
            out[3] = self.channel(&corners, places, 3, weight, out[3]);
        }
    }

    /// `before`, and in the group's lanes more by a weight times what lies between a channel of eight texels: by the same
    /// sums as one by one, a + (b - a) f.
    #[inline(always)]
    fn channel(&self, corners: &[[[f32; 4]; 2]; 4], places: &Places<S>, c: usize, weight: F<S>, before: F<S>) -> F<S> {
        let [x, y, z] = places.f;
        let near = lerp(between(&corners[0], c, x), between(&corners[1], c, x), y);
        let far = lerp(between(&corners[2], c, x), between(&corners[3], c, x), y);
        self.lanes.select(before + weight * lerp(near, far, z), before)
    }
}

/// Between a channel of two texels.
#[inline(always)]
fn between<S: Simd>(texels: &[[f32; 4]; 2], c: usize, f: F<S>) -> F<S> {
    f * (texels[1][c] - texels[0][c]) + texels[0][c]
}

/// One layer of scalars that packets look up, however it is held: the only place that reads memory without a check.
#[derive(Clone, Copy)]
pub(crate) struct Scalars<'a> {
    texels: Held<'a>,
    dims: [i32; 3],
    /// Where blocks find their texels, where those are not dense.
    bricks: Option<Bricks<'a>>,
}

impl<'a> Scalars<'a> {
    /// The texels of a field, with at least one float behind them.
    pub(crate) fn new(memory: &'a [f32], spec: &FieldSpec) -> Self {
        let dims = spec.dims.map(|d| d as i32);
        assert!(dims.iter().all(|&d| d > 0));
        let bricks =
            if let Layout::Bricks(layout) = spec.layout { Some(Bricks::new(memory, spec, layout)) } else { None };
        let memory = bricks.as_ref().map_or(memory, |bricks| bricks.behind(memory));
        let count = bricks.as_ref().map_or(dims.iter().map(|&d| d as usize).product(), |bricks| bricks.texels());
        Self { texels: Held::new(memory, spec.format, count), dims, bricks }
    }

    /// Texels along x, y, z as floats.
    #[inline(always)]
    pub(crate) fn size(&self) -> [f32; 3] {
        self.dims.map(|d| d as f32)
    }

    /// A single texel.
    #[inline(always)]
    pub(crate) fn texel(&self, at: [u32; 3]) -> f32 {
        self.texels.one(self.at(at))
    }

    /// Where a texel lies.
    #[inline(always)]
    pub(crate) fn at(&self, [i, j, k]: [u32; 3]) -> usize {
        match &self.bricks {
            None => (k as usize * self.dims[1] as usize + j as usize) * self.dims[0] as usize + i as usize,
            Some(bricks) => bricks.single([i, j, k]),
        }
    }

    /// From a texel of a block to the next one along y and z.
    #[inline(always)]
    pub(crate) fn pitch(&self) -> [usize; 2] {
        let row = if self.bricks.is_some() { BrickLayout::SIDE as usize } else { self.dims[0] as usize };
        [row, row * if self.bricks.is_some() { BrickLayout::SIDE as usize } else { self.dims[1] as usize }]
    }

    /// How many texels along x, from one on to `last`, lie one after the other, at most as many as lanes.
    #[inline(always)]
    pub(crate) fn stretch(&self, from: u32, last: u32) -> u32 {
        let held = if self.bricks.is_some() { BrickLayout::BLOCK - from % BrickLayout::BLOCK } else { LANES as u32 };
        held.min(last - from + 1)
    }

    /// Texels one after the other, from where one lies, and zeros behind them.
    #[inline(always)]
    pub(crate) fn run<S: Simd>(&self, at: usize, count: u32) -> F<S> {
        self.texels.run(at, count as usize)
    }

    /// How many texels along x, from one on, lie in a block that holds zero.
    #[inline(always)]
    pub(crate) fn empty(&self, at: [u32; 3]) -> u32 {
        self.bricks.as_ref().map_or(0, |bricks| bricks.empty(at, &self.texels))
    }

    /// Coordinates `p` within the texels' along axis `a`, also where they are not numbers.
    #[inline(always)]
    fn within<S: Simd>(&self, p: F<S>, a: usize) -> F<S> {
        p.max(F::ZERO).min(F::splat((self.dims[a] - 1) as f32))
    }

    /// The value at each lane's point, where texel i lies at i: trilinear, x then y then z, indices clamped at the edge.
    #[inline(always)]
    pub(crate) fn sample<S: Simd>(&self, p: [F<S>; 3]) -> F<S> {
        let [value] = self.several([p]);
        value
    }

    /// The values at several points of each lane. A processor that waits for one of them looks up the next.
    #[inline(always)]
    pub(crate) fn several<S: Simd, const N: usize>(&self, p: [[F<S>; 3]; N]) -> [F<S>; N] {
        let q = each!(n in N, [F::ZERO; 3] => triple!(a => self.within(p[n][a], a)));
        let lo = each!(n in N, [I::ZERO; 3] => triple!(a => q[n][a].to_int()));
        let f = each!(n in N, [F::ZERO; 3] => triple!(a => q[n][a] - lo[n][a].to_float()));
        let (near, hop) = match &self.bricks {
            None => {
                let (row, slice) = (self.dims[0], self.dims[0] * self.dims[1]);
                let near = each!(n in N, I::ZERO => {
                    lo[n][0].plus(lo[n][1].times(row)).plus(lo[n][2].times(slice))
                });
                // To the next texel: none at the edge. Along x the one behind has no weight there.
                let hop = each!(n in N, [I::ZERO; 2] => {
                    [
                        lo[n][1].below(self.dims[1] - 1).choose(row),
                        lo[n][2].below(self.dims[2] - 1).choose(slice),
                    ]
                });
                (near, hop)
            }
            Some(bricks) => {
                let side = BrickLayout::SIDE as i32;
                let near = each!(n in N, I::ZERO => bricks.places(lo[n]));
                (near, [[I::splat(side), I::splat(side * side)]; N])
            }
        };
        match self.texels {
            Held::Floats(texels) => self.between::<S, _, N>(texels, near, hop, f),
            Held::Halves(texels) => self.between::<S, _, N>(texels, near, hop, f),
        }
    }

    /// Between the texel at `near`, the one behind it, and those a hop further along y and z.
    #[inline(always)]
    fn between<S: Simd, T: Pairs, const N: usize>(
        &self,
        texels: T,
        near: [I<S>; N],
        hop: [[I<S>; 2]; N],
        f: [[F<S>; 3]; N],
    ) -> [F<S>; N] {
        let x = each!(n in N, F::ZERO => f[n][0]);
        let beside = each!(n in N, I::ZERO => near[n].plus(hop[n][0]));
        let (a, b) = (self.row(texels, near, x), self.row(texels, beside, x));
        let front = each!(n in N, F::ZERO => lerp(a[n], b[n], f[n][1]));
        let behind = each!(n in N, I::ZERO => near[n].plus(hop[n][1]));
        let a = self.row(texels, behind, x);
        let b = self.row(texels, each!(n in N, I::ZERO => behind[n].plus(hop[n][0])), x);
        let back = each!(n in N, F::ZERO => lerp(a[n], b[n], f[n][1]));
        each!(n in N, F::ZERO => lerp(front[n], back[n], f[n][2]))
    }

    /// The same at a single point.
    #[inline(always)]
    pub(crate) fn single(&self, p: [f32; 3]) -> f32 {
        let q = triple!(a => p[a].max(0.0).min((self.dims[a] - 1) as f32));
        let lo = triple!(a => q[a] as usize);
        let f = triple!(a => q[a] - lo[a] as f32);
        let (near, [dx, dy, dz]) = match &self.bricks {
            None => {
                let pitch = [1, self.dims[0] as usize, self.dims[0] as usize * self.dims[1] as usize];
                let hop = triple!(a => if lo[a] + 1 < self.dims[a] as usize { pitch[a] } else { 0 });
                (lo[0] + lo[1] * pitch[1] + lo[2] * pitch[2], hop)
            }
            Some(bricks) => {
                let side = BrickLayout::SIDE as usize;
                (bricks.single(triple!(a => lo[a] as u32)), [1, side, side * side])
            }
        };
        let mix = |a: f32, b: f32, f: f32| a + (b - a) * f;
        let row = |at: usize| mix(self.texels.one(at), self.texels.one(at + dx), f[0]);
        let plane = |at: usize| mix(row(at), row(at + dy), f[1]);
        mix(plane(near), plane(near + dz), f[2])
    }

    /// Between the texels at `at` and those behind them.
    #[inline(always)]
    fn row<S: Simd, T: Pairs, const N: usize>(&self, texels: T, at: [I<S>; N], f: [F<S>; N]) -> [F<S>; N] {
        // SAFETY: offsets come from `several` alone: each index is clamped to [0, dims - 1], also where the point is
        // not a number, steps stay within the texels or a brick that the index names, and `new` checked that there is one
        // more than there are texels.
        #[allow(unsafe_code)]
        let pairs = each!(n in N, [F::ZERO; 2] => unsafe { texels.two(at[n]) });
        each!(n in N, F::ZERO => lerp(pairs[n][0], pairs[n][1], f[n]))
    }
}
