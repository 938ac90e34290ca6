//! Twin of the stage [`Trace`](crate::stage::Trace).

use glam::DVec3;

use super::lookup::xyz;
use super::mesh::nearest;
use crate::stage::{MeshRecord, TraceParams};

/// What the bindings of [`Trace`](crate::stage::Trace) hold.
#[derive(Clone, Copy, Debug)]
pub struct TraceInputs<'a> {
    /// Sub-pixel positions.
    pub tables: &'a [f32],
    /// Boxes, which are not read, and triangles.
    pub mesh: &'a [MeshRecord],
}

/// What [`Trace`](crate::stage::Trace) writes: eight values a sub-pixel position, which are normal and distance, the
/// triangle's normal and the material.
pub fn trace(params: &TraceParams, inputs: &TraceInputs<'_>) -> Vec<f64> {
    let mut hits = Vec::new();
    for y in 0..params.height {
        for x in 0..params.width {
            for position in inputs.tables.chunks_exact(2).take(params.samples as usize) {
                let at = [f64::from(x) + f64::from(position[0]), f64::from(y) + f64::from(position[1])];
                let d = view([params.forward, params.right, params.up], [params.width, params.height], at);
                match nearest(inputs.mesh, params.nodes, xyz(params.eye), d, [0.0, f64::INFINITY]) {
                    None => hits.extend([0.0, 0.0, 0.0, f64::INFINITY, 0.0, 0.0, 0.0, 0.0]),
                    Some(hit) => {
                        let facet = hit.facet * -hit.facet.dot(d).signum();
                        let normal = if hit.normal.dot(facet) < 0.0 { -hit.normal } else { hit.normal };
                        hits.extend([normal.x, normal.y, normal.z, hit.distance]);
                        hits.extend([facet.x, facet.y, facet.z, hit.material.into()]);
                    }
                }
            }
        }
    }
    hits
}

/// Direction of the view ray through the place `at` of a picture, in pixels.
pub(super) fn view([forward, right, up]: [[f32; 4]; 3], size: [u32; 2], at: [f64; 2]) -> DVec3 {
    let [a, b] = [0, 1].map(|i| 2.0 * at[i] / f64::from(size[i]) - 1.0);
    (xyz(forward) + a * xyz(right) - b * xyz(up)).normalize()
}
