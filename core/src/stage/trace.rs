//! `trace`: where view rays meet surfaces. Both sides of a triangle count.
//!
//! Per pixel and sub-pixel position, the nearest hit of the ray from the eye through the mesh's boxes and triangles
//! ([`MeshRecord`]). The output is two vectors: the normal that lights the surface, interpolated between the vertices',
//! and the distance along the ray in metres, infinite where there is no hit; the triangle's own normal, and the number of
//! its material. Both normals are of unit length and on the eye's side of the triangle.
//!
//! A triangle is met by the ray where the corners, seen along the ray, wind around it. Seen, they are places on a plane
//! across the ray, the same for all triangles that share a corner, and three edge functions p×q of two corners each say
//! on which side of an edge the ray passes. One that is less than [`MeshRecord::SLACK`] of its two products counts for either
//! side, so that no rounding, contracted products included, lets a ray through between two triangles that share an edge.
//!
//! The work axis is the pixels' sub-pixel positions, those of a pixel in a row. A pass takes some boxes, and keeps what
//! the passes before found where it is nearer.

use crate::device::{Binding, Buf};
use crate::kernel_struct;
use crate::stage::{Kernel, require};

kernel_struct! {
    /// A place of a mesh with a number. A mesh is its boxes in depth-first order, two records each: lower corner and the
    /// number of the box that follows all that are within it; upper corner and, for a box without others, its first triangle
    /// times 2ⁿ plus how many there are, n = [`MeshRecord::COUNT_BITS`], else 0. Then the triangles, six records each:
    /// the corners; the unit normals there with the number of the material.
    pub struct MeshRecord {
        /// Metres from the mesh's origin, or a normal.
        x: F32,
        /// See `x`.
        y: F32,
        /// See `x`.
        z: F32,
        /// A number.
        number: U32,
    }
}

impl MeshRecord {
    /// The most triangles of a box without others.
    pub const LEAF: u32 = 4;
    /// Bits of a box's number that count its triangles.
    pub const COUNT_BITS: u32 = 4;
    /// The same as a mask.
    pub const COUNT_MASK: u32 = (1 << Self::COUNT_BITS) - 1;
    /// An edge function below this part of its terms counts as zero: a few units in the last place.
    pub const SLACK: f32 = 4.8e-7;
    /// Ways between surfaces and lights end this part of the mesh's extent before them, which is what 32-bit floats know
    /// of where a surface is.
    pub const MARGIN: f32 = 4e-6;

    /// A record.
    pub fn new(at: glam::Vec3, number: u32) -> Self {
        Self { x: at.x, y: at.y, z: at.z, number }
    }

    /// Its place.
    pub fn xyz(&self) -> glam::Vec3 {
        glam::Vec3::new(self.x, self.y, self.z)
    }

    /// Turns of the loops of a ray through so many boxes of a mesh of `records` records, `nodes` of them boxes.
    pub(super) fn turns(boxes: u64, nodes: u32, records: u64) -> u64 {
        let triangles = records.saturating_sub(2 * u64::from(nodes)) / 6;
        boxes + triangles.min(boxes * u64::from(Self::LEAF))
    }
}

kernel_struct! {
    /// Parameters of `trace`.
    pub struct TraceParams {
        /// The eye from the mesh's origin, metres; unused.
        eye: F32x4,
        /// Axis f of the camera, as [`March`](super::March)'s.
        forward: F32x4,
        /// Axis r, times the half width of the picture at distance 1.
        right: F32x4,
        /// Axis u, times the half height.
        up: F32x4,
        /// Columns of the picture.
        width: U32,
        /// Rows of the picture.
        height: U32,
        /// Sub-pixel positions.
        samples: U32,
        /// Boxes of the mesh.
        nodes: U32,
        /// First box of this pass.
        node_begin: U32,
        /// One past the last box of this pass.
        node_end: U32,
        /// Unused.
        unused_0: U32,
        /// Unused.
        unused_1: U32,
    }
}

/// The stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// Parameters.
    pub params: TraceParams,
    /// Sub-pixel positions, two values each.
    pub tables: Buf<f32>,
    /// Boxes and triangles.
    pub mesh: Buf<MeshRecord>,
    /// Two vectors a sub-pixel position.
    pub hits: Buf<[f32; 4]>,
}

/// The sub-pixel positions of a picture, where their number fits the work axis.
pub(super) fn positions(width: u32, height: u32, samples: u32) -> Option<u32> {
    width.checked_mul(height)?.checked_mul(samples)
}

impl Kernel for Trace {
    const NAME: &'static str = "trace";

    fn params(&self) -> &[u8] {
        bytemuck::bytes_of(&self.params)
    }

    fn bindings(&self) -> Vec<Binding> {
        vec![
            Binding::read("tables", Some(self.tables)),
            Binding::read("mesh", Some(self.mesh)),
            Binding::write("hits", Some(self.hits)).in_parts::<[f32; 4]>(2),
        ]
    }

    fn axis(&self) -> u32 {
        let p = &self.params;
        positions(p.width, p.height, p.samples).unwrap_or(0)
    }

    fn validate(&self) -> Result<(), String> {
        let p = &self.params;
        let axis = positions(p.width, p.height, p.samples).unwrap_or(0);
        require!(axis > 0, "{} × {} pixels of {} positions, none or too many", p.width, p.height, p.samples);
        require!(self.tables.len >= 2 * u64::from(p.samples), "tables of {} values", self.tables.len);
        require!(self.hits.len >= 2 * u64::from(axis), "hits of {} vectors for {axis} rays", self.hits.len);
        let nodes = p.node_begin..p.node_end;
        require!(!nodes.is_empty() && nodes.end <= p.nodes, "boxes {nodes:?} of {}", p.nodes);
        holds(self.mesh, p.nodes)
    }

    fn passes(&self, turns: u64) -> Result<Vec<Self>, String> {
        let nodes = self.params.nodes;
        let pass = |begin: u32, end: u32| {
            let mut pass = self.clone();
            (pass.params.node_begin, pass.params.node_end) = (begin, end);
            pass
        };
        Ok(node_ranges(nodes, self.mesh.len, turns)?.into_iter().map(|(begin, end)| pass(begin, end)).collect())
    }
}

/// Whether a mesh of `nodes` boxes fits its buffer. What the records say of each other is not seen here: they come from
/// [`Hierarchy`](crate::scene::Hierarchy).
pub(super) fn holds(mesh: Buf<MeshRecord>, nodes: u32) -> Result<(), String> {
    require!(nodes > 0, "a mesh without boxes");
    let boxes = 2 * u64::from(nodes);
    require!(mesh.len > boxes, "a mesh of {} records for {nodes} boxes and triangles", mesh.len);
    Ok(())
}

/// The boxes of a mesh in ranges, each of at most so many turns of loops.
pub(super) fn node_ranges(nodes: u32, records: u64, turns: u64) -> Result<Vec<(u32, u32)>, String> {
    if MeshRecord::turns(nodes.into(), nodes, records) <= turns {
        return Ok(vec![(0, nodes)]);
    }
    let each = turns / (1 + u64::from(MeshRecord::LEAF));
    require!(each > 0, "a box of a mesh takes up to {} turns, and {turns} are allowed", 1 + MeshRecord::LEAF);
    let each = each.min(nodes.into()) as u32;
    Ok((0..nodes).step_by(each as usize).map(|begin| (begin, nodes.min(begin.saturating_add(each)))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_take_every_box_once_and_keep_to_their_turns() {
        for turns in [5, 9, 100, 700, 10_000] {
            let ranges = node_ranges(300, 600 + 6 * 250, turns).unwrap();
            let mut next = 0;
            for (begin, end) in ranges {
                assert_eq!(begin, next);
                assert!(MeshRecord::turns((end - begin).into(), 300, 600 + 6 * 250) <= turns);
                next = end;
            }
            assert_eq!(next, 300);
        }
        assert!(node_ranges(300, 1000, 4).is_err());
    }
}
