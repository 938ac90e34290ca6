//! Twin of the stage [`Shadow`](crate::stage::Shadow).

use glam::DVec3;

use super::lookup::xyz;
use super::mesh::nearest;
use crate::stage::{FAR, LightRecord, MeshRecord, ShadowParams};

/// What the bindings of [`Shadow`](crate::stage::Shadow) hold.
#[derive(Clone, Copy, Debug)]
pub struct ShadowInputs<'a> {
    /// Lights.
    pub lights: &'a [LightRecord],
    /// Boxes, which are not read, and triangles.
    pub mesh: &'a [MeshRecord],
}

/// What [`Shadow`](crate::stage::Shadow) writes: how far each texel's ray goes.
pub fn shadow(params: &ShadowParams, inputs: &ShadowInputs<'_>) -> Vec<f64> {
    let mut map = Vec::new();
    for light in &inputs.lights[..params.lights as usize] {
        for number in 0..if face_count(light) == 6 { 6 } else { 1 } {
            let face = face(light, number, params.extent.into());
            for row in 0..params.side {
                for column in 0..params.side {
                    let at = [column, row].map(|k| (f64::from(k) + 0.5) / f64::from(params.side) * 2.0 - 1.0);
                    map.push(reach(params, inputs.mesh, light, &face, at));
                }
            }
        }
    }
    map
}

/// How far the ray through the place `at` of a face goes, from -1 to 1 either way.
fn reach(params: &ShadowParams, mesh: &[MeshRecord], light: &LightRecord, face: &Face, at: [f64; 2]) -> f64 {
    let across = face.half_width * (at[0] * face.right + at[1] * face.up);
    let (origin, toward, least) = if light.position[3] == 0.0 {
        (across - f64::from(params.extent) * face.forward, face.forward, 0.0)
    } else {
        (xyz(light.position), face.forward + across, f64::from(MeshRecord::MARGIN * params.extent))
    };
    let direction = toward.normalize();
    let hit = nearest(mesh, params.nodes, origin, direction, [least, f64::INFINITY]);
    hit.map_or(FAR.into(), |hit| hit.distance * direction.dot(face.forward))
}

/// A face of a light's map.
pub(super) struct Face {
    pub(super) forward: DVec3,
    pub(super) right: DVec3,
    pub(super) up: DVec3,
    pub(super) half_width: f64,
}

/// Faces of a light's map.
pub(super) fn face_count(light: &LightRecord) -> u32 {
    if light.position[3] == 0.0 || light.cone[3] > 0.0 { 1 } else { 6 }
}

/// Face `number` of a light's map.
pub(super) fn face(light: &LightRecord, number: u32, extent: f64) -> Face {
    if face_count(light) == 1 {
        let parallel = light.position[3] == 0.0;
        let forward = if parallel { -xyz(light.position) } else { xyz(light.axis) };
        let (right, up) = across(forward);
        return Face { forward, right, up, half_width: if parallel { extent } else { light.cone[3].into() } };
    }
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let axis = number as usize / 2;
    Face {
        forward: if number.is_multiple_of(2) { axes[axis] } else { -axes[axis] },
        right: axes[(axis + 1) % 3],
        up: axes[(axis + 2) % 3],
        half_width: 1.0,
    }
}

/// Unit vectors across a unit vector and each other (Duff et al. 2017).
fn across(n: DVec3) -> (DVec3, DVec3) {
    let sign = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), DVec3::new(b, sign + n.y * n.y * a, -n.y))
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::light::Light;
    use crate::scene::{Material, Mesh, Triangle};
    use crate::stage::Shadow;

    /// A wall that faces a light has one distance in all of the texels that see it.
    #[test]
    fn a_wall_that_faces_the_light_has_one_distance() {
        let positions = [(-4.0, -4.0), (4.0, -4.0), (-4.0, 4.0), (4.0, 4.0)].map(|(x, z)| DVec3::new(x, 0.5, z));
        let triangles = [[0, 1, 2], [1, 3, 2]].map(|vertices| Triangle { vertices, material: 0 }).to_vec();
        let mesh = Mesh::new(positions.to_vec(), vec![], triangles, vec![Material::default()]).unwrap();
        let hierarchy = mesh.hierarchy().unwrap();
        let (at, down) = (DVec3::new(0.3, 3.5, -0.2), DVec3::new(0.3, 0.0, -0.2));
        let lights = [
            Light::point(at, Vec3::ONE).unwrap(),
            Light::spot(at, down, Vec3::ONE, 20.0, 30.0).unwrap(),
            Light::directional(DVec3::Y, Vec3::ONE).unwrap(),
        ];
        let faces = lights.iter().map(Shadow::faces).sum();
        assert_eq!(faces, 8);
        let params = ShadowParams {
            lights: 3,
            faces,
            side: 4,
            nodes: hierarchy.nodes(),
            node_begin: 0,
            node_end: hierarchy.nodes(),
            extent: hierarchy.extent(),
            unused: 0,
        };
        let lights = LightRecord::of(&lights, hierarchy.origin());
        let map = shadow(&params, &ShadowInputs { lights: &lights, mesh: hierarchy.records() });
        let far = f64::from(FAR);
        for (n, held) in map.iter().enumerate() {
            let expected = match n / 16 {
                // Down, and the spot.
                3 | 6 => 3.0,
                // From the plane before the mesh's sphere, beyond whose square corners nothing is.
                7 if *held < far => hierarchy.extent().into(),
                // To the sides the lower rays meet it, at distances of their own.
                0 | 1 | 4 | 5 if *held < far => continue,
                _ => far,
            };
            assert!((held - expected).abs() < 1e-6 * expected, "texel {n}: {held}");
        }
    }
}
