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

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;
    use crate::scene::{Material, Mesh, Triangle};

    /// A wall at z = -2 behind one at z = -1 that hides its left half.
    #[test]
    fn the_nearest_wall_is_seen_from_the_eyes_side() {
        let corner = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
        let positions = vec![
            corner(-9.0, -9.0, -2.0),
            corner(9.0, -9.0, -2.0),
            corner(0.0, 18.0, -2.0),
            corner(0.0, -9.0, -1.0),
            corner(0.0, 9.0, -1.0),
            corner(-9.0, 0.0, -1.0),
        ];
        let triangles = [[0, 1, 2], [3, 4, 5]];
        let triangles = (0..).zip(triangles).map(|(material, vertices)| Triangle { vertices, material }).collect();
        let mesh = Mesh::new(positions, vec![], triangles, vec![Material::default(); 2]).unwrap();
        let hierarchy = mesh.hierarchy().unwrap();
        let mut params = TraceParams::zeroed();
        params.eye = (-hierarchy.origin()).as_vec3().extend(0.0).to_array();
        (params.forward, params.right, params.up) = ([0.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]);
        (params.width, params.height, params.samples, params.nodes) = (2, 1, 1, hierarchy.nodes());
        let hits = trace(&params, &TraceInputs { tables: &[0.5, 0.5], mesh: hierarchy.records() });
        // The rays go through (±½, 0, -1).
        let slant = 1.25f64.sqrt();
        for (hit, distance, material) in [(&hits[..8], slant, 1.0), (&hits[8..], 2.0 * slant, 0.0)] {
            assert!((hit[3] - distance).abs() < 1e-6, "{hit:?}");
            assert!((hit[2] - 1.0).abs() < 1e-12 && (hit[6] - 1.0).abs() < 1e-12, "normals {hit:?}");
            assert_eq!(hit[7], material);
        }
    }
}
