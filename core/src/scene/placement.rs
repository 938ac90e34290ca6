//! Where a surface stands in the world.

use glam::{DAffine3, DMat3, DQuat, DVec3, EulerRot};

use super::{Material, Mesh, MeshError, Triangle};

/// A point p of the surface stands at `position` + Rz · Ry · Rx · (`scale` · p): it is scaled, then turned about the
/// world's x, y and z axes in that order, then moved. Positive angles turn y toward z, z toward x and x toward y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Where the surface's origin goes, metres.
    pub position: DVec3,
    /// Angles about x, y and z, degrees.
    pub rotation: DVec3,
    /// Factors along x, y and z; a negative one mirrors.
    pub scale: DVec3,
}

impl Default for Placement {
    /// As it is.
    fn default() -> Self {
        Self { position: DVec3::ZERO, rotation: DVec3::ZERO, scale: DVec3::ONE }
    }
}

impl Placement {
    /// The map from the surface to the world.
    pub fn map(&self) -> DAffine3 {
        let [x, y, z] = self.rotation.to_array().map(f64::to_radians);
        let turn = DQuat::from_euler(EulerRot::ZYX, z, y, x);
        DAffine3::from_scale_rotation_translation(self.scale, turn, self.position)
    }
}

/// Takes normals to where `map` takes their surface: the cofactors of its linear part, which need no inverse and are
/// the inverse transpose up to a positive factor once their sign is that of the determinant.
pub fn normal_map(map: &DAffine3) -> DMat3 {
    let m = map.matrix3;
    let cofactors = DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    if m.determinant() < 0.0 { -1.0 * cofactors } else { cofactors }
}

impl Mesh {
    /// The mesh under a map, with `materials` in place of its own. Triangles keep their outer side where the map mirrors.
    ///
    /// # Errors
    /// Vertices that would lie beyond [`Mesh::LARGEST`], normals that the map takes to nothing, a material out of range,
    /// too few materials.
    pub fn placed(&self, map: &DAffine3, materials: Vec<Material>) -> Result<Self, MeshError> {
        let positions = self.positions().iter().map(|p| map.transform_point3(*p)).collect();
        let turn = normal_map(map);
        let normals = self.normals().iter().map(|n| (turn * n.as_dvec3()).normalize_or_zero().as_vec3()).collect();
        let mirrored = map.matrix3.determinant() < 0.0;
        let outward = |t: &Triangle| {
            let [a, b, c] = t.vertices;
            Triangle { vertices: if mirrored { [a, c, b] } else { [a, b, c] }, ..*t }
        };
        Self::new(positions, normals, self.triangles().iter().map(outward).collect(), materials)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Shape;

    #[test]
    fn angles_turn_about_x_then_y_then_z() {
        let map = |rotation| Placement { rotation, ..Placement::default() }.map();
        let near = |a: DVec3, b: DVec3| assert!((a - b).length() < 1e-14, "{a} {b}");
        near(map(DVec3::X * 90.0).transform_point3(DVec3::Y), DVec3::Z);
        near(map(DVec3::Y * 90.0).transform_point3(DVec3::Z), DVec3::X);
        near(map(DVec3::Z * 90.0).transform_point3(DVec3::X), DVec3::Y);
        // Y to Z about x, Z to X about y, X to Y about z.
        near(map(DVec3::splat(90.0)).transform_point3(DVec3::Y), DVec3::Y);
        near(map(DVec3::new(90.0, 90.0, 0.0)).transform_point3(DVec3::Y), DVec3::X);
        let placement = Placement {
            position: DVec3::new(1.0, 2.0, 3.0),
            scale: DVec3::new(2.0, 3.0, 4.0),
            rotation: DVec3::Z * 90.0,
        };
        near(placement.map().transform_point3(DVec3::ONE), DVec3::new(-2.0, 4.0, 7.0));
    }

    #[test]
    fn normals_stay_across_their_surface_and_outside() {
        let ball = Shape::Sphere.mesh(Material::default()).unwrap();
        for scale in [DVec3::new(1.0, 2.0, 0.5), DVec3::new(-1.0, 2.0, 0.5), DVec3::new(-3.0, -1.0, -0.25)] {
            let placement = Placement { scale, rotation: DVec3::new(20.0, -30.0, 50.0), ..Placement::default() };
            let placed = ball.placed(&placement.map(), ball.materials().to_vec()).unwrap();
            for t in placed.triangles() {
                let [a, b, c] = t.vertices.map(|v| placed.positions()[v as usize]);
                assert!((b - a).cross(c - a).dot(a + b + c) > 0.0, "{scale}");
            }
            // The gradient of the ellipsoid that the ball becomes.
            let turn = Placement { scale: DVec3::ONE, ..placement }.map();
            for (p, n) in ball.positions().iter().zip(placed.normals()) {
                let across = turn.transform_vector3(*p / scale).normalize();
                assert!((across - n.as_dvec3()).length() < 1e-6, "{scale}");
            }
        }
    }

    #[test]
    fn what_leaves_the_world_is_refused() {
        let plane = Shape::Plane.mesh(Material::default()).unwrap();
        let far = Placement { position: DVec3::X * 2e15, ..Placement::default() }.map();
        assert!(matches!(plane.placed(&far, plane.materials().to_vec()), Err(MeshError::Position { index: 0, .. })));
        let there = Placement::default().map();
        assert!(matches!(plane.placed(&there, Vec::new()), Err(MeshError::Index { what: "material", .. })));
    }
}
