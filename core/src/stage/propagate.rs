//! `propagate`: the way's density from every cell of a coarse grid to each light (Giroud and Biri 2011, section 4.3).
//!
//! Cell units count cells of the grid: cell (i, j, k) has its centre X at (i, j, k), and the box runs from -½ to
//! cells - ½. S is the light, u = S - X the way to it; for a directional light u is the direction, scaled so that its
//! longest component is 1. A *column* is ∫ ρ along that way within the box, in units of density times metres.
//!
//! Each step of the work axis finishes some cells of every light from those that earlier steps finished, so that the
//! steps run in order. For short characteristics a unit of each light, which integrates in all cells, comes before them; a last unit
//! lays the output out. Schemes ([`scheme`]):
//!
//! - `PUBLISHED`, equation 6. S is the centre of the light's cell, which may lie outside the grid. A cell gathers from
//!   its neighbours toward the light, one along each axis, weighed with w_b = |u_b|:
//!   T(X) = h K(X) + Σ w_b T(X + sgn(u_b) e_b) / Σ w_b, where K is the cell's mean density and h the length of a cell's
//!   edge, itself weighed with w where edges differ. T(S) = h K(S) with the mean of the edges. Outside the grid T is
//!   zero. Shells of equal Manhattan distance from the light's cell follow each other. The output is T, a column.
//! - `METRIC`: the same, with h the way's length in metres over Σ |u_b|, its length in hops; zero at the light.
//! - `SHORT_CHARACTERISTICS`. S is where the light is. The output is the *mean density* m along the way: the column
//!   over ℓ, the way's length within the box. Unlike the column, it is smooth at the light and at the walls, and
//!   constant where the density is. Where ‖u‖∞ < 1 the way is integrated to its end. Else it is integrated to Y, where
//!   it meets the plane of centres one cell nearer along its longest component (the first among equals), and
//!   m(X) = (column to Y + ℓ(Y) m(Y)) / ℓ(X). m(Y) is interpolated along each of the two other axes, by the cubic
//!   through the cells at -1, 0, 1 and 2 toward the light from X's, without those at -1 and 2 that are not nearer to
//!   the light than X in the maximum norm or lie outside the grid, and by X's own where 1 lies outside; negative values
//!   become zero. Columns are integrated on the density's own grid by the midpoint rule, in steps as the march's.
//!   Cells follow in order of ‖u‖∞, face by face ([`faces`]); for a directional light plane by plane. What is integrated of a
//!   way, the mean density where that is all of it and else the column to Y, needs no other cell: it comes first.
//!
//! The output is laid out \[cell\]\[layer\] as RGBA, four lights a vector, ready to be published as a field; values
//! beyond the last light are zero. It is written when the last step is done.

use glam::DVec3;

use super::grid::is_density;
use super::{Kernel, require};
use crate::device::{Binding, Buf, Field, FieldFormat};
use crate::kernel_struct;
use crate::light::Light;
use crate::media::Lattice;

/// How the density of the way spreads from cell to cell.
pub mod scheme {
    /// Interpolated one plane nearer, with exact ways between.
    pub const SHORT_CHARACTERISTICS: u32 = 0;
    /// Gathered from neighbours; a hop is as long as the way's share.
    pub const METRIC: u32 = 1;
    /// Gathered from neighbours; a hop is a whole cell.
    pub const PUBLISHED: u32 = 2;
}

kernel_struct! {
    /// Parameters of `propagate`.
    pub struct PropagateParams {
        /// Samples of the density along x, y, z; unused.
        dims: U32x4,
        /// Row of the linear map from voxels to metres.
        world_x: F32x4,
        /// See `world_x`.
        world_y: F32x4,
        /// See `world_x`.
        world_z: F32x4,
        /// Cells along x, y, z; layers, each of four lights.
        cells: U32x4,
        /// Voxels of a cell along x, y, z; the longest step in metres.
        cell: F32x4,
        /// Lights.
        lights: U32,
        /// Steps. The work axis is by one longer, and for short characteristics by the lights as well.
        steps: U32,
        /// A constant of [`scheme`].
        scheme: U32,
        /// Items of a step.
        items: U32,
    }
}

kernel_struct! {
    /// Where a light is, in cell units.
    pub struct LightPlace {
        /// S (`place.w` = 1), or the direction toward the light, its longest component 1 (`place.w` = 0).
        place: F32x4,
        /// The cell whose shell comes first; unused.
        first: U32x4,
    }
}

kernel_struct! {
    /// A rectangle of cells in a plane, which depend on cells of earlier faces alone.
    pub struct LightFace {
        /// Axis that the plane is normal to, the longest of the way; [`LightFace::NONE`] where there is no cell.
        axis: U32,
        /// Index of the cells along that axis.
        plane: U32,
        /// First cell along the first of the other two axes.
        first_0: U32,
        /// Cells along it.
        count_0: U32,
        /// First cell along the second of the other two axes.
        first_1: U32,
        /// Cells along it.
        count_1: U32,
        /// 1 where the light is nearer than one cell.
        near: U32,
        /// Unused.
        unused: U32,
    }
}

/// The stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Propagate {
    /// Parameters.
    pub params: PropagateParams,
    /// Density ρ.
    pub density: Field,
    /// Mean and maximum of each cell, from `reduce`; read by the schemes that gather.
    pub occupancy: Option<Buf<[f32; 2]>>,
    /// Where the lights are.
    pub lights: Buf<LightPlace>,
    /// [`faces`]; read by short characteristics.
    pub faces: Option<Buf<LightFace>>,
    /// Columns or mean densities that are known so far, of short characteristics what is integrated of the others, laid out
    /// \[light\]\[cell\].
    pub values: Buf<f32>,
    /// Columns or mean densities, laid out \[cell\]\[layer\]\[RGBA\].
    pub out: Buf<f32>,
}

/// Lights farther than this many cells from the box's first corner are as good as directional ones, and nearer places
/// are multiples of a power of two of at most 1, so that kernels subtract without rounding.
const FAR: f64 = 4_194_304.0;
/// Places are multiples of this part of a cell, or of more where they are far.
const FINEST: f64 = 1.0 / 4096.0;

impl LightPlace {
    /// Of a light, over `cells` cells of the box of `lattice`.
    pub fn new(light: &Light, lattice: &Lattice, cells: [u32; 3], scheme: u32) -> Self {
        let n = DVec3::from(cells.map(f64::from));
        let scale = n / lattice.dims().as_dvec3();
        let to_index = lattice.world_to_index();
        let place = |p: DVec3| (to_index.transform_point3(p) + 0.5) * scale - 0.5;
        let snap = |s: DVec3| {
            // Kernels subtract whole numbers up to the side of the grid and add a few.
            let quantum = ((s.abs().max_element() + n.max_element()).log2().ceil().exp2() / FAR).max(FINEST);
            if scheme == self::scheme::SHORT_CHARACTERISTICS { (s / quantum).round() * quantum } else { s.round() }
        };
        match *light {
            Light::Directional { to_light, .. } => {
                Self::directional(to_index.transform_vector3(to_light) * scale, cells)
            }
            Light::Point { position, .. } | Light::Spot { position, .. } => {
                let s = place(position);
                if s.abs().max_element() + n.max_element() < FAR {
                    let s = snap(s);
                    let first = s.clamp(DVec3::ZERO, n - 1.0).as_uvec3();
                    Self { place: s.as_vec3().extend(1.0).to_array(), first: first.extend(0).to_array() }
                } else {
                    Self::directional(s - 0.5 * (n - 1.0), cells)
                }
            }
        }
    }

    fn directional(toward: DVec3, cells: [u32; 3]) -> Self {
        let u = toward / toward.abs().max_element();
        let first = |a: usize| if u[a] > 0.0 { cells[a] - 1 } else { 0 };
        Self { place: u.as_vec3().extend(0.0).to_array(), first: [first(0), first(1), first(2), 0] }
    }

    fn xyz(&self) -> DVec3 {
        DVec3::from([0, 1, 2].map(|a| f64::from(self.place[a])))
    }

    /// The cells in order: rectangles that hold each cell once, each after all cells that it depends on.
    fn faces(&self, cells: [u32; 3]) -> Vec<LightFace> {
        let s = self.xyz();
        let mut faces = Vec::new();
        if self.place[3] == 0.0 {
            let axis = longest(s);
            let [b, c] = others(axis);
            let planes = (0..cells[axis]).map(|k| if s[axis] > 0.0 { cells[axis] - 1 - k } else { k });
            return planes.map(|plane| LightFace::new(axis, plane, [0..cells[b], 0..cells[c]], false)).collect();
        }
        for axis in 0..3 {
            let [b, c] = others(axis);
            for plane in 0..cells[axis] {
                let d = (f64::from(plane) - s[axis]).abs();
                // Cells that are as far along two axes belong to the first of them.
                let within = |other: usize| {
                    let (low, high) = (s[other] - d, s[other] + d);
                    let (low, high) = match axis < other {
                        true => (low.ceil(), high.floor() + 1.0),
                        false => (low.floor() + 1.0, high.ceil()),
                    };
                    // Casting saturates: what lies below the grid begins with it.
                    low as u32..(high as u32).min(cells[other])
                };
                let sides = [within(b), within(c)];
                if sides.iter().all(|side| !side.is_empty()) {
                    faces.push((d, LightFace::new(axis, plane, sides, d < 1.0)));
                }
            }
        }
        faces.sort_by(|a, b| a.0.total_cmp(&b.0));
        faces.into_iter().map(|(_, face)| face).collect()
    }

    /// Steps that the light's cells take.
    fn steps(&self, cells: [u32; 3], scheme: u32) -> usize {
        if scheme == self::scheme::SHORT_CHARACTERISTICS {
            return self.faces(cells).len();
        }
        // From the first cell to the corner that is the farthest from it.
        let farthest = |a: usize| self.first[a].max(cells[a] - 1 - self.first[a]) as usize;
        farthest(0) + farthest(1) + farthest(2) + 1
    }
}

/// The axis of the longest component, the first among equals.
fn longest(u: DVec3) -> usize {
    let u = u.abs();
    if u.x >= u.y && u.x >= u.z {
        0
    } else if u.y >= u.z {
        1
    } else {
        2
    }
}

/// The other two axes, in order.
fn others(axis: usize) -> [usize; 2] {
    [[1, 2], [0, 2], [0, 1]][axis]
}

impl LightFace {
    /// `axis` where there is no cell.
    pub const NONE: u32 = 3;

    fn new(axis: usize, plane: u32, [b, c]: [std::ops::Range<u32>; 2], near: bool) -> Self {
        Self {
            axis: axis as u32,
            plane,
            first_0: b.start,
            count_0: b.len() as u32,
            first_1: c.start,
            count_1: c.len() as u32,
            near: near.into(),
            unused: 0,
        }
    }

    fn none() -> Self {
        Self { axis: Self::NONE, ..Self::new(0, 0, [0..0, 0..0], false) }
    }
}

/// How many steps the cells of all lights take.
pub fn steps(lights: &[LightPlace], cells: [u32; 3], scheme: u32) -> u32 {
    lights.iter().map(|light| light.steps(cells, scheme)).max().unwrap_or(0) as u32
}

/// The faces of all lights, laid out \[step\]\[light\]. Cells of one ‖u‖∞ on one side of one axis form a face: of the
/// plane i of axis a, those with |x_b - s_b| ≤ |i - s_a| along the other axes. Lights with fewer faces rest at the end.
pub fn faces(lights: &[LightPlace], cells: [u32; 3]) -> Vec<LightFace> {
    let all: Vec<_> = lights.iter().map(|light| light.faces(cells)).collect();
    let steps = all.iter().map(Vec::len).max().unwrap_or(0);
    let at = |step: usize| all.iter().map(move |faces| faces.get(step).copied().unwrap_or(LightFace::none()));
    (0..steps).flat_map(at).collect()
}

impl PropagateParams {
    /// Lights of a layer.
    pub const LANES: u32 = 4;

    /// Units of the work axis that integrate in all cells, one a light; after them come the steps.
    pub fn integrated(&self) -> u32 {
        if self.scheme == scheme::SHORT_CHARACTERISTICS { self.lights } else { 0 }
    }

    /// Units of the work axis before the last, which lays the output out.
    pub fn finished(&self) -> u32 {
        self.integrated().saturating_add(self.steps)
    }

    /// Cells of the grid.
    pub fn count(&self) -> u32 {
        self.cells[..3].iter().product()
    }

    /// Items of a step: for short characteristics the cells of the largest face; else two cells of each row along x,
    /// one on either side of the light; of every light. None where that is too many.
    pub fn most_items(cells: [u32; 3], lights: u32, scheme: u32) -> Option<u32> {
        let [x, y, z] = cells;
        let side = |a: u32, b: u32| a.checked_mul(b);
        let each = if scheme == self::scheme::SHORT_CHARACTERISTICS {
            side(y, z)?.max(side(x, z)?).max(side(x, y)?)
        } else {
            side(y, z)?.checked_mul(2)?
        };
        each.checked_mul(lights)
    }
}

impl Propagate {
    /// Turns of the loops of an item beside those along its segment: over the cells that it interpolates or gathers.
    const TURNS: u64 = 32;

    /// The most turns of all loops of an item.
    fn turns(&self) -> u64 {
        let p = &self.params;
        let row = |r: [f32; 4]| DVec3::from([0, 1, 2].map(|a| f64::from(r[a]) * f64::from(p.cell[a])));
        let [x, y, z] = [p.world_x, p.world_y, p.world_z].map(row);
        // A segment crosses at most one cell along each axis.
        let across = |sign: DVec3| DVec3::new(x.dot(sign), y.dot(sign), z.dot(sign)).length();
        let signs = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
        let longest = signs.map(|(j, k)| across(DVec3::new(1.0, j, k))).into_iter().fold(0.0, f64::max);
        // Casting saturates, and rounding may add a step.
        ((longest / f64::from(p.cell[3])).ceil() as u64).saturating_add(2 + Self::TURNS)
    }
}

impl Kernel for Propagate {
    const NAME: &'static str = "propagate";

    fn params(&self) -> &[u8] {
        bytemuck::bytes_of(&self.params)
    }

    fn bindings(&self) -> Vec<Binding> {
        vec![
            Binding::sample("density", FieldFormat::Scalar, Some(self.density)),
            Binding::read("occupancy", self.occupancy),
            Binding::read("lights", Some(self.lights)),
            Binding::read("faces", self.faces),
            Binding::write("values", Some(self.values)),
            Binding::write("light_depth", Some(self.out)),
        ]
    }

    fn axis(&self) -> u32 {
        self.params.finished().saturating_add(1)
    }

    fn sequential(&self) -> Option<u32> {
        Some(self.params.items)
    }

    fn validate(&self) -> Result<(), String> {
        let p = &self.params;
        is_density(&self.density, p.dims)?;
        let [cells @ .., layers] = p.cells;
        let count = cells.iter().try_fold(1u32, |n, &c| n.checked_mul(c));
        require!(count.is_some_and(|n| n > 0), "{cells:?} cells");
        let count = u64::from(cells.iter().product::<u32>());
        require!(p.cell.iter().all(|c| c.is_finite() && *c > 0.0), "cells and step {:?}", p.cell);
        require!(p.scheme <= scheme::PUBLISHED, "scheme {}", p.scheme);
        require!(p.lights > 0 && p.steps > 0, "{} lights in {} steps", p.lights, p.steps);
        require!(p.finished() < u32::MAX, "{} steps of {} lights", p.steps, p.lights);
        require!(layers == p.lights.div_ceil(PropagateParams::LANES), "{layers} layers for {} lights", p.lights);
        require!(self.lights.len >= p.lights.into(), "{} places for {} lights", self.lights.len, p.lights);
        let items = PropagateParams::most_items(cells, p.lights, p.scheme);
        require!(items == Some(p.items), "{} items a step for {items:?}", p.items);
        // Kernels count the output's values in 32 bits.
        let values = count * u64::from(layers) * u64::from(PropagateParams::LANES);
        require!(u32::try_from(values).is_ok(), "{layers} layers of {count} cells");
        require!(self.out.len >= values, "{} places for {layers} layers of {count} cells", self.out.len);
        let values = count * u64::from(p.lights);
        require!(self.values.len >= values, "{} values of {values}", self.values.len);
        if p.scheme == scheme::SHORT_CHARACTERISTICS {
            let needed = u64::from(p.steps) * u64::from(p.lights);
            require!(self.faces.is_some_and(|b| b.len >= needed), "fewer than {needed} faces");
        } else {
            require!(self.occupancy.is_some_and(|b| b.len >= count), "means of fewer than {count} cells");
        }
        Ok(())
    }

    fn passes(&self, turns: u64) -> Result<Vec<Self>, String> {
        let own = self.turns();
        require!(
            own <= turns,
            "the way through one cell takes up to {own} turns of loops, and {turns} are allowed: more cells or a longer \
             step need less"
        );
        Ok(vec![self.clone()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, DMat3, UVec3, Vec3};

    const CELLS: [u32; 3] = [6, 4, 9];

    fn lattice() -> Lattice {
        let linear = DMat3::from_cols(DVec3::X, DVec3::new(0.35, 1.0, 0.1), DVec3::new(-0.2, 0.25, 1.0)) * 0.1;
        Lattice::new(UVec3::new(7, 5, 11), DAffine3::from_mat3_translation(linear, DVec3::new(3.0, -1.0, 2.0))).unwrap()
    }

    /// A light at `s` in cell units.
    fn point(s: DVec3, scheme: u32) -> LightPlace {
        let lattice = lattice();
        let index = (s + 0.5) * lattice.dims().as_dvec3() / DVec3::from(CELLS.map(f64::from)) - 0.5;
        let light = Light::point(lattice.index_to_world().transform_point3(index), Vec3::ONE).unwrap();
        LightPlace::new(&light, &lattice, CELLS, scheme)
    }

    fn places() -> Vec<DVec3> {
        let wave =
            |i: f64| DVec3::new(2.5 + 5.0 * (0.9 * i).sin(), 1.5 + 4.0 * (1.7 * i).cos(), 4.0 + 8.0 * (2.3 * i).sin());
        let mut all: Vec<_> = (0..60).map(|i| wave(f64::from(i))).collect();
        // At a centre, a face, an edge, a corner of cells, at walls, and far out.
        for s in [[2.0, 1.0, 4.0], [2.5, 1.0, 4.0], [2.5, 1.5, 4.0], [2.5, 1.5, 4.5], [-0.5, 3.5, 8.5], [0.3, 1.7, 4.3]]
        {
            all.push(DVec3::from(s));
        }
        all.extend([DVec3::new(-1e5, 3e4, 7.0), DVec3::new(1e9, 2e9, -1e9), DVec3::new(2.0, -3.0, 1.0)]);
        all
    }

    #[test]
    fn every_cell_is_on_one_face_and_behind_those_that_are_nearer() {
        for s in places() {
            let light = point(s, scheme::SHORT_CHARACTERISTICS);
            let mut seen = vec![false; CELLS.iter().product::<u32>() as usize];
            let mut last = 0.0;
            for face in faces(&[light], CELLS) {
                let axis = face.axis as usize;
                let [b, c] = others(axis);
                let mut at = [face.plane; 3];
                for i in face.first_0..face.first_0 + face.count_0 {
                    for j in face.first_1..face.first_1 + face.count_1 {
                        (at[b], at[c]) = (i, j);
                        let cell = ((at[2] * CELLS[1] + at[1]) * CELLS[0] + at[0]) as usize;
                        assert!(!std::mem::replace(&mut seen[cell], true), "{s}: {at:?} twice");
                        if light.place[3] == 0.0 {
                            continue;
                        }
                        let u = light.xyz() - DVec3::from(at.map(f64::from));
                        assert_eq!(longest(u), axis, "{s}: {at:?}");
                        let d = u.abs().max_element();
                        assert!(d >= last, "{s}: {at:?}");
                        assert_eq!(d < 1.0, face.near == 1);
                        last = d;
                    }
                }
            }
            assert!(seen.iter().all(|seen| *seen), "{s}");
        }
    }

    #[test]
    fn places_are_near_and_differences_are_exact() {
        for s in places().into_iter().take(66) {
            let light = point(s, scheme::SHORT_CHARACTERISTICS);
            assert!((light.xyz() - s).abs().max_element() <= 0.51 * FINEST, "{s}");
            for x in 0..9u8 {
                let exact = f64::from(light.place[1]) - f64::from(x);
                assert_eq!(f64::from(light.place[1] - f32::from(x)), exact);
            }
            let snapped = point(s, scheme::PUBLISHED);
            assert_eq!(snapped.xyz(), snapped.xyz().round());
        }
        assert_eq!(point(DVec3::new(1e9, 2e9, -1e9), scheme::METRIC).place[3], 0.0, "as good as directional");
    }

    #[test]
    fn shells_reach_every_cell() {
        for scheme in [scheme::METRIC, scheme::PUBLISHED] {
            let lights: Vec<_> = places().into_iter().map(|s| point(s, scheme)).collect();
            for light in &lights {
                let n = steps(std::slice::from_ref(light), CELLS, scheme);
                let farthest = |a: usize| (0..CELLS[a]).map(|x| x.abs_diff(light.first[a])).max().unwrap_or(0);
                assert_eq!(n, farthest(0) + farthest(1) + farthest(2) + 1);
            }
        }
    }

    #[test]
    fn lights_with_fewer_faces_rest() {
        let lights = [DVec3::new(2.5, 1.5, 4.5), DVec3::new(-9.0, 1.0, 2.0)].map(|s| point(s, 0));
        let all = faces(&lights, CELLS);
        let own = lights.map(|light| faces(&[light], CELLS).len());
        assert_eq!(all.len(), 2 * own[0].max(own[1]));
        for (light, own) in own.into_iter().enumerate() {
            assert!(
                all.iter()
                    .skip(light)
                    .step_by(2)
                    .enumerate()
                    .all(|(step, f)| (step < own) == (f.axis != LightFace::NONE))
            );
        }
        assert!(own[1] == 6, "planes alone where the light is far to one side: {own:?}");
    }
}
