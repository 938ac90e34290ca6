//! Triangles as parsers find them.

use airlight_core::scene::{Material, Mesh, MeshError, Triangle};
use glam::{DVec3, Vec3};

/// Vertices and triangles.
#[derive(Default)]
pub(super) struct Soup {
    pub(super) positions: Vec<DVec3>,
    /// One a vertex; zero where the file gives none.
    pub(super) normals: Vec<Vec3>,
    pub(super) triangles: Vec<Triangle>,
}

impl Soup {
    /// Adds a vertex and returns its number.
    pub(super) fn vertex(&mut self, position: DVec3, normal: Vec3) -> u32 {
        self.positions.push(position);
        self.normals.push(normal);
        // A file of 2³² vertices would have had to be read before.
        self.positions.len() as u32 - 1
    }

    /// The mesh. Where some vertices have normals, triangles that lack one get vertices of their own with the facet's.
    pub(super) fn mesh(mut self, materials: Vec<Material>) -> Result<Mesh, MeshError> {
        if self.normals.iter().all(|n| *n == Vec3::ZERO) {
            self.normals.clear();
        } else {
            for i in 0..self.triangles.len() {
                let corners = self.triangles[i].vertices;
                if corners.iter().any(|v| self.normals[*v as usize] == Vec3::ZERO) {
                    let [a, b, c] = corners.map(|v| self.positions[v as usize]);
                    // A facet without area is left out, whatever its normal.
                    let facet = (b - a).cross(c - a).normalize_or(DVec3::Y).as_vec3();
                    self.triangles[i].vertices = [a, b, c].map(|p| self.vertex(p, facet));
                }
            }
            // What is left without a normal belongs to no triangle.
            self.normals.iter_mut().filter(|n| **n == Vec3::ZERO).for_each(|n| *n = Vec3::Y);
        }
        Mesh::new(self.positions, self.normals, self.triangles, materials)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn facets_beside_smooth_triangles_get_vertices_of_their_own() {
        let mut soup = Soup::default();
        let smooth = Vec3::new(0.0, 1.0, 1.0).normalize();
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y].map(|p| soup.vertex(p, smooth));
        let bare = soup.vertex(DVec3::NEG_Z, Vec3::ZERO);
        let triangle = |vertices| Triangle { vertices, material: 0 };
        soup.triangles = vec![triangle(corners), triangle([corners[0], corners[1], bare])];
        let mesh = soup.mesh(vec![Material::default()]).unwrap();
        assert_eq!(mesh.positions().len(), 7);
        let normals = |t: usize| mesh.triangles()[t].vertices.map(|v| mesh.normals()[v as usize]);
        assert!(normals(0).iter().all(|n| (*n - smooth).length() < 1e-6));
        assert_eq!(normals(1), [Vec3::Y; 3]);
    }
}
