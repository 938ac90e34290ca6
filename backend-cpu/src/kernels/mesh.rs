//! Rays through a mesh, as `airlight_core::stage::trace` lays it out.

use airlight_core::stage::MeshRecord;

use crate::packet::{F, LANES, M, apart, dot, lanes, triple};
use crate::simd::Simd;

/// So many boxes of triangles are kept of one place: more than places have, unless triangles are small beside cells.
const NEAR: usize = 32;

/// Rays, and directions across them.
pub(crate) struct Line<S> {
    origin: [F<S>; 3],
    /// Unit.
    pub(crate) direction: [F<S>; 3],
    /// One over the direction.
    inverse: [F<S>; 3],
    u: [F<S>; 3],
    v: [F<S>; 3],
}

/// The nearest triangles.
pub(crate) struct Hit<S> {
    /// Metres along, infinite for none.
    pub(crate) distance: F<S>,
    pub(crate) triangle: [u32; LANES],
    /// Of the corners.
    pub(crate) weights: [F<S>; 3],
}

/// Boxes and triangles.
#[derive(Clone, Copy)]
pub(crate) struct Mesh<'a> {
    records: &'a [MeshRecord],
    nodes: u32,
    /// The first box that `blocked` asks for.
    begin: usize,
}

/// Boxes of triangles that rays of one place may reach, which are found once for all of them.
pub(crate) struct Near<'a> {
    boxes: [u32; NEAR],
    count: usize,
    /// The mesh behind the last of them; nothing unless there were more than fit.
    rest: Mesh<'a>,
}

/// The rays along unit `direction`s, with a frame across each (Duff et al. 2017).
#[inline(always)]
pub(crate) fn line<S: Simd>(origin: [F<S>; 3], direction: [F<S>; 3]) -> Line<S> {
    let [x, y, z] = direction;
    let s = z.ge(F::ZERO).select(F::ONE, F::splat(-1.0));
    let a = F::splat(-1.0) / (s + z);
    let b = x * y * a;
    let u = [F::ONE + s * x * x * a, s * b, -(s * x)];
    let v = [b, s + y * y * a, -y];
    // Along a wall of a box: far enough from parallel to divide by.
    let inverse = triple!(c => F::ONE / direction[c].away_from_zero());
    Line { origin, direction, inverse, u, v }
}

impl<'a> Mesh<'a> {
    /// A mesh of so many boxes.
    pub(crate) fn new(records: &'a [MeshRecord], nodes: u32) -> Self {
        Self { records, nodes, begin: 0 }
    }

    /// The nearest triangles within boxes `begin` to `end`, between `least` and `limit` metres along.
    #[inline(always)]
    pub(crate) fn nearest<S: Simd>(&self, of: &Line<S>, least: f32, limit: F<S>, [begin, end]: [u32; 2]) -> Hit<S> {
        let mut found = Hit { distance: F::splat(f32::INFINITY), triangle: [0; LANES], weights: [F::ZERO; 3] };
        let mut far = limit;
        let mut node = begin as usize;
        while node < end as usize {
            if !self.meets(of, node, far).any() {
                node = self.records[2 * node].number as usize;
                continue;
            }
            for triangle in self.leaf(node) {
                let [at, weights @ ..] = self.crossed(of, triangle);
                let nearer = at.ge(F::splat(least)).and(at.lt(far));
                if nearer.any() {
                    far = nearer.select(at, far);
                    found.distance = nearer.select(at, found.distance);
                    found.weights = triple!(c => nearer.select(weights[c], found.weights[c]));
                    found.triangle = lanes!(i => if nearer.lane(i) { triangle } else { found.triangle[i] });
                }
            }
            node += 1;
        }
        found
    }

    /// Where a triangle stands within `limit` metres; lanes that are not `active` are not asked for.
    #[inline(always)]
    pub(crate) fn blocked<S: Simd>(&self, of: &Line<S>, limit: F<S>, active: M<S>) -> M<S> {
        let mut open = active;
        let mut node = self.begin;
        while node < self.nodes as usize && open.any() {
            if !self.meets(of, node, limit).and(open).any() {
                node = self.records[2 * node].number as usize;
                continue;
            }
            open = self.passed(of, node, limit, open);
            node += 1;
        }
        active.and(open.not())
    }

    /// The rays that no triangle of a box stands in the way of, of those that are `open`.
    #[inline(always)]
    fn passed<S: Simd>(&self, of: &Line<S>, node: usize, limit: F<S>, mut open: M<S>) -> M<S> {
        for triangle in self.leaf(node) {
            let at = self.crossed(of, triangle)[0];
            let stands = at.ge(F::ZERO).and(at.lt(limit));
            open = open.and(stands.not());
        }
        open
    }

    /// The boxes of triangles that reach into those from `lower` to `upper`.
    #[inline(always)]
    pub(crate) fn within<S: Simd>(&self, lower: [F<S>; 3], upper: [F<S>; 3]) -> Near<'a> {
        let mut near = Near { boxes: [0; NEAR], count: 0, rest: *self };
        let mut node = 0;
        while node < self.nodes as usize && near.count < NEAR {
            let (low, high) = (self.place(2 * node), self.place(2 * node + 1));
            let [x, y, z] = triple!(a => F::splat(high[a]).ge(lower[a]).and(upper[a].ge(F::splat(low[a]))));
            if !x.and(y).and(z).any() {
                node = self.records[2 * node].number as usize;
                continue;
            }
            if !self.leaf(node).is_empty() {
                near.boxes[near.count] = node as u32;
                near.count += 1;
            }
            node += 1;
        }
        near.rest.begin = node;
        near
    }

    /// The triangles of a box.
    #[inline(always)]
    fn leaf(&self, node: usize) -> std::ops::Range<u32> {
        let leaf = self.records[2 * node + 1].number;
        let first = leaf >> MeshRecord::COUNT_BITS;
        first..first + (leaf & MeshRecord::COUNT_MASK)
    }

    /// Which rays meet a box within `limit` metres.
    #[inline(always)]
    fn meets<S: Simd>(&self, of: &Line<S>, node: usize, limit: F<S>) -> M<S> {
        let (low, high) = (self.place(2 * node), self.place(2 * node + 1));
        let lower = triple!(a => (F::splat(low[a]) - of.origin[a]) * of.inverse[a]);
        let upper = triple!(a => (F::splat(high[a]) - of.origin[a]) * of.inverse[a]);
        let [x, y, z] = triple!(a => (lower[a].min(upper[a]), lower[a].max(upper[a])));
        let near = F::ZERO.max(x.0).max(y.0).max(z.0);
        let far = limit.min(x.1).min(y.1).min(z.1);
        // Distances are good to a few units in the last place.
        (far * 1.000_002).ge(near)
    }

    /// Where the rays cross a triangle: metres along, -1 where they do not; weights of the corners.
    #[inline(always)]
    fn crossed<S: Simd>(&self, of: &Line<S>, triangle: u32) -> [F<S>; 4] {
        let at = 2 * self.nodes as usize + 6 * triangle as usize;
        let a = seen(of, self.place(at));
        let b = seen(of, self.place(at + 1));
        let c = seen(of, self.place(at + 2));
        let first = [b[0] * c[1], c[0] * a[1], a[0] * b[1]];
        let second = [b[1] * c[0], c[1] * a[0], a[1] * b[0]];
        let edges = triple!(i => first[i] - second[i]);
        let slack = triple!(i => (first[i].abs() + second[i].abs()) * MeshRecord::SLACK);
        let [x, y, z] = triple!(i => (edges[i].ge(-slack[i]), slack[i].ge(edges[i])));
        let within = x.0.and(y.0).and(z.0).or(x.1.and(y.1).and(z.1));
        let s = (edges[0] + edges[1] + edges[2]).ge(F::ZERO).select(F::ONE, F::splat(-1.0));
        let inside = triple!(i => (s * edges[i]).max(F::ZERO));
        let sum = inside[0] + inside[1] + inside[2];
        let within = within.and(sum.gt(F::ZERO));
        let weights = triple!(i => inside[i] / sum);
        let along = weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2];
        [within.select(along, F::splat(-1.0)), weights[0], weights[1], weights[2]]
    }

    /// The place of a record.
    #[inline(always)]
    pub(crate) fn place(&self, record: usize) -> [f32; 3] {
        let MeshRecord { x, y, z, .. } = self.records[record];
        [x, y, z]
    }

    /// Where the records of a triangle begin, and the number of its material.
    #[inline(always)]
    pub(crate) fn triangle(&self, triangle: u32) -> (usize, u32) {
        let at = 2 * self.nodes as usize + 6 * triangle as usize;
        (at, self.records[at + 3].number)
    }

    /// Where the records of triangles begin.
    #[inline(always)]
    pub(crate) fn triangles(&self, numbers: [u32; LANES]) -> [usize; LANES] {
        lanes!(i => 2 * self.nodes as usize + 6 * numbers[i] as usize)
    }

    /// The places of the records `n` behind others, and the bits of their numbers.
    #[inline(always)]
    pub(crate) fn places<S: Simd>(&self, at: [usize; LANES], n: usize) -> [F<S>; 4] {
        let records: &[[f32; 4]] = bytemuck::cast_slice(self.records);
        apart(lanes!(i => records[at[i] + n]))
    }
}

impl Near<'_> {
    /// Whether there are none.
    pub(crate) fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Where a triangle stands within `limit` metres.
    #[inline(always)]
    pub(crate) fn blocked<S: Simd>(&self, of: &Line<S>, limit: F<S>) -> M<S> {
        let mut open = M::ALL;
        for &node in &self.boxes[..self.count] {
            if self.rest.meets(of, node as usize, limit).and(open).any() {
                open = self.rest.passed(of, node as usize, limit, open);
            }
        }
        open.not().or(self.rest.blocked(of, limit, open))
    }
}

/// A point across and along the rays.
#[inline(always)]
fn seen<S: Simd>(of: &Line<S>, point: [f32; 3]) -> [F<S>; 3] {
    let p = triple!(a => F::splat(point[a]) - of.origin[a]);
    [dot(p, of.u), dot(p, of.v), dot(p, of.direction)]
}
