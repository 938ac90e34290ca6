//! Rays through a mesh: every triangle, no boxes.

use glam::DVec3;

use crate::stage::MeshRecord;

/// Where a ray meets a triangle.
pub(super) struct Hit {
    /// Metres along.
    pub(super) distance: f64,
    /// The triangle's unit normal, on whichever side.
    pub(super) facet: DVec3,
    /// The vertices' normal, interpolated and of unit length; the triangle's where that is none.
    pub(super) normal: DVec3,
    /// Number of the material.
    pub(super) material: u32,
}

/// More than what rounding moves an edge by, as a part of a triangle.
const EDGE: f64 = 1e-12;

fn place(record: MeshRecord) -> DVec3 {
    record.xyz().as_dvec3()
}

/// The nearest triangle of a mesh of `nodes` boxes along a unit `direction`, from `least` to `limit` metres.
pub(super) fn nearest(
    mesh: &[MeshRecord],
    nodes: u32,
    origin: DVec3,
    direction: DVec3,
    [least, limit]: [f64; 2],
) -> Option<Hit> {
    let mut found: Option<Hit> = None;
    for triangle in mesh[2 * nodes as usize..].chunks_exact(6) {
        let [a, b, c] = [0, 1, 2].map(|i| place(triangle[i]));
        // Cramer's rule for origin + t direction = a + v (b - a) + w (c - a).
        let (p, q, s) = (b - a, c - a, origin - a);
        let determinant = direction.cross(q).dot(p);
        if determinant == 0.0 {
            continue;
        }
        let v = direction.cross(q).dot(s) / determinant;
        let w = s.cross(p).dot(direction) / determinant;
        let distance = s.cross(p).dot(q) / determinant;
        // An edge belongs to both of its sides.
        let inside = v >= -EDGE && w >= -EDGE && v + w <= 1.0 + EDGE;
        if !inside || distance < least || distance >= found.as_ref().map_or(limit, |hit| hit.distance) {
            continue;
        }
        let facet = p.cross(q).normalize();
        let [x, y, z] = [3, 4, 5].map(|i| place(triangle[i]));
        let normal = ((1.0 - v - w) * x + v * y + w * z).try_normalize().unwrap_or(facet);
        found = Some(Hit { distance, facet, normal, material: triangle[3].number });
    }
    found
}
