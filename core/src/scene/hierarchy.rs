//! A mesh as devices trace rays through it: a hierarchy of boxes that needs no stack.

use std::time::Duration;

use glam::{DVec3, Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::{Boundable, BvhBuildParams};

use super::{Mesh, Triangle};
use crate::stage::MeshRecord;

/// The boxes around a mesh's triangles, and the triangles, as [`MeshRecord`] lays them out. Places are in metres from
/// [`Hierarchy::origin`].
#[derive(Debug)]
pub struct Hierarchy {
    origin: DVec3,
    extent: f32,
    nodes: u32,
    records: Vec<MeshRecord>,
}

/// A triangle's corners from the origin, and the box around it.
struct Corners([Vec3; 3]);

impl Boundable for Corners {
    fn aabb(&self) -> Aabb {
        let [a, b, c] = self.0.map(Vec3A::from);
        Aabb { min: a.min(b).min(c), max: a.max(b).max(c) }
    }
}

/// Boxes are wider than what they hold by this part of the mesh's extent, so that rounding hides nothing.
const MARGIN: f32 = 1e-6;

/// Of up to so many triangles every box is moved to where rays meet the fewest others; of more as many, those that cost rays the
/// most, so that a mesh of a million takes two seconds in place of seven.
const REINSERTED: f32 = 131_072.0;

impl Hierarchy {
    /// Of a mesh with triangles, within `bounds`.
    pub(super) fn new(mesh: &Mesh, (low, high): (DVec3, DVec3)) -> Self {
        let origin = 0.5 * (low + high);
        // A little more, so that rounding leaves nothing outside.
        let extent = (0.5 * (high - low).length() * 1.0001) as f32;
        let place = |v: u32| (mesh.positions()[v as usize] - origin).as_vec3();
        let corners: Vec<_> = mesh.triangles().iter().map(|t| Corners(t.vertices.map(place))).collect();
        let options = BvhBuildParams {
            max_prims_per_leaf: MeshRecord::LEAF,
            reinsertion_batch_ratio: (REINSERTED / corners.len() as f32).clamp(0.05, 1.0),
            post_collapse_reinsertion_batch_ratio_multiplier: 0.0,
            ..BvhBuildParams::medium_build()
        };
        let tree = build_bvh2(&corners, options, &mut Duration::default());

        let mut boxes = Vec::new();
        let mut order: Vec<u32> = Vec::new();
        // Depth first: a node, its first child with all below it, its second child. Nodes whose end is not known yet.
        let mut open: Vec<(usize, u32)> = Vec::new();
        let mut waiting = vec![(0usize, 0u32)];
        while let Some((at, depth)) = waiting.pop() {
            while let Some((done, _)) = open.pop_if(|(_, of)| *of >= depth) {
                close(&mut boxes, done);
            }
            let node = &tree.nodes[at];
            let first = node.first_index as usize;
            let mut leaf = 0;
            if node.prim_count == 0 {
                waiting.extend([(first + 1, depth + 1), (first, depth + 1)]);
            } else {
                leaf = (order.len() as u32) << MeshRecord::COUNT_BITS | node.prim_count;
                order.extend(&tree.primitive_indices[first..first + node.prim_count as usize]);
            }
            open.push((boxes.len() / 2, depth));
            let margin = Vec3::splat(MARGIN * extent);
            boxes.push(MeshRecord::new(Vec3::from(node.aabb().min) - margin, 0));
            boxes.push(MeshRecord::new(Vec3::from(node.aabb().max) + margin, leaf));
        }
        while let Some((done, _)) = open.pop() {
            close(&mut boxes, done);
        }
        let nodes = (boxes.len() / 2) as u32;
        let mut records = boxes;
        for &index in &order {
            let Triangle { vertices, material } = mesh.triangles()[index as usize];
            let corners = corners[index as usize].0;
            records.extend(corners.map(|at| MeshRecord::new(at, 0)));
            let [a, b, c] = vertices.map(|v| mesh.positions()[v as usize]);
            let facet = (b - a).cross(c - a).normalize_or_zero().as_vec3();
            let normal = |v: u32| mesh.normals().get(v as usize).copied().unwrap_or(facet);
            records.extend(vertices.map(|v| MeshRecord::new(normal(v), material)));
        }
        Self { origin, extent, nodes, records }
    }

    /// Where places are counted from: the middle of the mesh's box, metres.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// No point of the mesh is farther from the origin, metres.
    pub fn extent(&self) -> f32 {
        self.extent
    }

    /// Number of boxes.
    pub fn nodes(&self) -> u32 {
        self.nodes
    }

    /// Boxes and triangles.
    pub fn records(&self) -> &[MeshRecord] {
        &self.records
    }
}

/// All nodes below `node` stand: what misses its box goes on with the next.
fn close(boxes: &mut [MeshRecord], node: usize) {
    boxes[2 * node].number = (boxes.len() / 2) as u32;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Material;

    /// A wavy sheet of 2 n² triangles.
    fn sheet(n: u32) -> Mesh {
        let at = |i: u32, j: u32| {
            let (x, z) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
            DVec3::new(1e3 + 2.0 * x, 0.2 * (7.0 * x + 3.0 * z).sin(), 3.0 * z)
        };
        let positions = (0..=n).flat_map(|j| (0..=n).map(move |i| at(i, j))).collect();
        let corner = |i: u32, j: u32| j * (n + 1) + i;
        let triangles = (0..n * n).flat_map(|k| {
            let (i, j) = (k % n, k / n);
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i, j + 1), corner(i + 1, j + 1)];
            [[a, b, c], [b, d, c]].map(|vertices| Triangle { vertices, material: 0 })
        });
        Mesh::new(positions, vec![], triangles.collect(), vec![Material::default()]).unwrap()
    }

    #[test]
    fn boxes_hold_what_is_below_them_and_every_triangle_stands_once() {
        for n in [1, 2, 9] {
            let mesh = sheet(n);
            let hierarchy = mesh.hierarchy().unwrap();
            let (nodes, records) = (hierarchy.nodes() as usize, hierarchy.records());
            assert_eq!(records.len(), 2 * nodes + 6 * mesh.triangles().len());
            let mut seen = vec![0; mesh.triangles().len()];
            for node in 0..nodes {
                let (low, high) = (records[2 * node], records[2 * node + 1]);
                let next = low.number as usize;
                assert!(next > node && next <= nodes, "node {node} goes on at {next} of {nodes}");
                for below in node..next {
                    let leaf = records[2 * below + 1].number;
                    let first = (leaf >> MeshRecord::COUNT_BITS) as usize;
                    for triangle in first..first + (leaf & MeshRecord::COUNT_MASK) as usize {
                        seen[triangle] += usize::from(below == node);
                        for corner in &records[2 * nodes + 6 * triangle..][..3] {
                            let at = corner.xyz();
                            assert!(at.cmpge(low.xyz()).all() && at.cmple(high.xyz()).all(), "{below} in {node}");
                        }
                    }
                }
            }
            assert!(seen.iter().all(|&times| times == 1), "{seen:?}");
            assert_eq!(records[0].number as usize, nodes);
            let farthest = records[2 * nodes..].chunks(6).flat_map(|t| &t[..3]).map(|r| r.xyz().length());
            assert!(farthest.fold(0.0, f32::max) <= hierarchy.extent());
        }
    }

    #[test]
    fn without_triangles_there_is_none() {
        let mesh = Mesh::new(vec![DVec3::X], vec![], vec![], vec![]).unwrap();
        assert!(mesh.hierarchy().is_none());
    }
}
