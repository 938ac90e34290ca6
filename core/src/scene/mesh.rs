//! Surfaces in a scene: triangles with materials.

use std::sync::{Arc, OnceLock};

use glam::{DVec3, Vec3};

use super::Hierarchy;
use crate::Version;

/// How a surface reflects light: f = `diffuse`/π + `specular` (n + 2)/(2π) cosⁿα, with n = `shininess` and α the angle
/// between the mirrored direction of the light and the direction to the eye. Both sides of a triangle reflect alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Diffuse reflectance kd, RGB, 0 to 1.
    pub diffuse: Vec3,
    /// Specular reflectance ks, RGB, 0 to 1.
    pub specular: Vec3,
    /// Exponent n, 0 to [`Material::MAX_SHININESS`].
    pub shininess: f32,
}

impl Default for Material {
    /// Grey, without gloss.
    fn default() -> Self {
        Self { diffuse: Vec3::splat(0.7), specular: Vec3::ZERO, shininess: 32.0 }
    }
}

impl Material {
    /// Beyond this a lobe is narrower than 32-bit floats tell directions apart.
    pub const MAX_SHININESS: f32 = 1e5;

    fn is_valid(&self) -> bool {
        let share = |v: Vec3| v.is_finite() && v.min_element() >= 0.0 && v.max_element() <= 1.0;
        share(self.diffuse) && share(self.specular) && (0.0..=Self::MAX_SHININESS).contains(&self.shininess)
    }
}

/// Triangles that do not make a surface.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// A vertex that is nowhere.
    #[error("vertex {index} at {position}: each coordinate must be finite and within 1e15 m")]
    Position {
        /// Its number, from 0.
        index: usize,
        /// Where it would be.
        position: DVec3,
    },
    /// A normal that points nowhere.
    #[error("normal {index} is {normal}; it must be finite and not zero")]
    Normal {
        /// Number of its vertex, from 0.
        index: usize,
        /// What was given.
        normal: Vec3,
    },
    /// Not as many of one as of the other.
    #[error("{found} {what} for {expected}")]
    Count {
        /// What there are too many or too few of.
        what: &'static str,
        /// How many.
        found: usize,
        /// How many there must be.
        expected: usize,
    },
    /// An index past the end.
    #[error("triangle {triangle} names {what} {index} of {count}")]
    Index {
        /// Number of the triangle, from 0.
        triangle: usize,
        /// What it names.
        what: &'static str,
        /// The index.
        index: u32,
        /// How many there are.
        count: usize,
    },
    /// A material out of range.
    #[error(
        "material {index}: diffuse {} and specular {} must be from 0 to 1, shininess {} from 0 to {max}",
        material.diffuse, material.specular, material.shininess, max = Material::MAX_SHININESS
    )]
    Material {
        /// Its number, from 0.
        index: usize,
        /// What was given.
        material: Material,
    },
    /// More triangles than indices hold.
    #[error("{0} triangles; at most {max} are taken", max = Mesh::MAX_TRIANGLES)]
    Size(usize),
}

/// A triangle of a [`Mesh`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Triangle {
    /// Its vertices.
    pub vertices: [u32; 3],
    /// Its material.
    pub material: u32,
}

/// Triangles in the world, all surfaces of a scene in one. Immutable: what changes is another mesh with another
/// [`Version`].
#[derive(Clone, Debug)]
pub struct Mesh {
    positions: Vec<DVec3>,
    normals: Vec<Vec3>,
    triangles: Vec<Triangle>,
    materials: Vec<Material>,
    degenerate: usize,
    version: Version,
    hierarchy: OnceLock<Arc<Hierarchy>>,
}

impl Mesh {
    /// The most triangles of a mesh.
    pub const MAX_TRIANGLES: usize = 1 << 26;
    /// The largest coordinate of a vertex, metres.
    pub const LARGEST: f64 = 1e15;

    /// A mesh of vertices (metres), a unit normal for each (or none at all, for facets), triangles, and materials.
    /// Triangles without area are left out and counted; normals are brought to unit length.
    ///
    /// # Errors
    /// The first vertex, normal, index or material that is out of range.
    pub fn new(
        positions: Vec<DVec3>,
        mut normals: Vec<Vec3>,
        mut triangles: Vec<Triangle>,
        materials: Vec<Material>,
    ) -> Result<Self, MeshError> {
        if triangles.len() > Self::MAX_TRIANGLES {
            return Err(MeshError::Size(triangles.len()));
        }
        let placed = |p: &DVec3| p.abs().max_element() <= Self::LARGEST && p.is_finite();
        if let Some(index) = positions.iter().position(|p| !placed(p)) {
            return Err(MeshError::Position { index, position: positions[index] });
        }
        if !normals.is_empty() && normals.len() != positions.len() {
            return Err(MeshError::Count { what: "normals", found: normals.len(), expected: positions.len() });
        }
        for (index, normal) in normals.iter_mut().enumerate() {
            *normal = normal.try_normalize().ok_or(MeshError::Normal { index, normal: *normal })?;
        }
        if let Some(index) = materials.iter().position(|m| !m.is_valid()) {
            return Err(MeshError::Material { index, material: materials[index] });
        }
        let outside = |index: u32, count: usize| usize::try_from(index).is_ok_and(|i| i >= count);
        for (triangle, t) in triangles.iter().enumerate() {
            if let Some(&index) = t.vertices.iter().find(|&&v| outside(v, positions.len())) {
                return Err(MeshError::Index { triangle, what: "vertex", index, count: positions.len() });
            }
            if outside(t.material, materials.len()) {
                return Err(MeshError::Index { triangle, what: "material", index: t.material, count: materials.len() });
            }
        }
        let all = triangles.len();
        triangles.retain(|t| {
            let [a, b, c] = t.vertices.map(|v| positions[v as usize]);
            let area = (b - a).cross(c - a);
            // As thin as rounding to f32 makes any triangle vanish.
            area.length() > 1e-12 * (b - a).length().max((c - a).length()).powi(2)
        });
        let degenerate = all - triangles.len();
        let (version, hierarchy) = (Version::fresh(), OnceLock::new());
        Ok(Self { positions, normals, triangles, materials, degenerate, version, hierarchy })
    }

    /// Several meshes as one; facets keep the flat look beside smooth ones.
    ///
    /// # Errors
    /// More triangles than a mesh holds.
    pub fn joined(meshes: &[Self]) -> Result<Self, MeshError> {
        let smooth = meshes.iter().any(|m| !m.normals.is_empty());
        let (mut positions, mut normals) = (Vec::new(), Vec::new());
        let (mut triangles, mut materials) = (Vec::new(), Vec::new());
        for mesh in meshes {
            let first = materials.len() as u32;
            materials.extend_from_slice(&mesh.materials);
            let flat = smooth && mesh.normals.is_empty();
            let start = positions.len() as u32;
            if !flat {
                positions.extend_from_slice(&mesh.positions);
                normals.extend_from_slice(&mesh.normals);
            }
            for t in &mesh.triangles {
                let mut vertices = t.vertices.map(|v| v.saturating_add(start));
                if flat {
                    // Vertices of its own, each with the facet's normal.
                    let corners = t.vertices.map(|v| mesh.positions[v as usize]);
                    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or(DVec3::Y);
                    let next = positions.len() as u32;
                    vertices = [next, next + 1, next + 2];
                    positions.extend(corners);
                    normals.extend([normal.as_vec3(); 3]);
                }
                triangles.push(Triangle { vertices, material: t.material + first });
            }
        }
        let mut joined = Self::new(positions, normals, triangles, materials)?;
        joined.degenerate += meshes.iter().map(|m| m.degenerate).sum::<usize>();
        Ok(joined)
    }

    /// Vertices, metres.
    pub fn positions(&self) -> &[DVec3] {
        &self.positions
    }

    /// Unit normals of the vertices; empty where triangles are flat facets.
    pub fn normals(&self) -> &[Vec3] {
        &self.normals
    }

    /// Triangles, all with an area.
    pub fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }

    /// Materials.
    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// How many triangles without area were left out.
    pub fn degenerate(&self) -> usize {
        self.degenerate
    }

    /// Lower and upper corner of the box around all vertices of triangles, metres; none without triangles.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let mut corners = self.triangles.iter().flat_map(|t| t.vertices).map(|v| self.positions[v as usize]);
        let first = corners.next()?;
        Some(corners.fold((first, first), |(low, high), p| (low.min(p), high.max(p))))
    }

    /// The mesh as devices trace rays through it; made when it is first asked for. None without triangles.
    pub fn hierarchy(&self) -> Option<&Hierarchy> {
        let bounds = self.bounds()?;
        Some(self.hierarchy.get_or_init(|| Arc::new(Hierarchy::new(self, bounds))))
    }

    /// Identity of the content.
    pub fn version(&self) -> Version {
        self.version
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(vertices: [u32; 3]) -> Triangle {
        Triangle { vertices, material: 0 }
    }

    fn corners() -> Vec<DVec3> {
        vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(2.0, 0.0, 0.0)]
    }

    fn mesh(triangles: Vec<Triangle>) -> Result<Mesh, MeshError> {
        Mesh::new(corners(), Vec::new(), triangles, vec![Material::default()])
    }

    #[test]
    fn what_is_out_of_range_is_refused() {
        assert!(mesh(vec![triangle([0, 1, 2])]).is_ok());
        assert!(matches!(mesh(vec![triangle([0, 1, 4])]), Err(MeshError::Index { what: "vertex", index: 4, .. })));
        let t = Triangle { material: 1, ..triangle([0, 1, 2]) };
        assert!(matches!(mesh(vec![t]), Err(MeshError::Index { what: "material", index: 1, .. })));
        let nan = vec![DVec3::NAN];
        assert!(matches!(Mesh::new(nan, vec![], vec![], vec![]), Err(MeshError::Position { index: 0, .. })));
        let one = vec![Vec3::Y];
        assert!(matches!(Mesh::new(corners(), one, vec![], vec![]), Err(MeshError::Count { .. })));
        let zero = vec![Vec3::Y, Vec3::ZERO, Vec3::Y, Vec3::Y];
        assert!(matches!(Mesh::new(corners(), zero, vec![], vec![]), Err(MeshError::Normal { index: 1, .. })));
        let bright = Material { diffuse: Vec3::splat(1.5), ..Material::default() };
        assert!(matches!(Mesh::new(vec![], vec![], vec![], vec![bright]), Err(MeshError::Material { .. })));
    }

    #[test]
    fn triangles_without_area_are_left_out_and_counted() {
        let mesh = mesh(vec![triangle([0, 1, 3]), triangle([0, 1, 2]), triangle([2, 2, 1])]).unwrap();
        assert_eq!((mesh.triangles().len(), mesh.degenerate()), (1, 2));
        assert_eq!(mesh.bounds(), Some((DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0))));
    }

    #[test]
    fn joined_facets_stay_flat_beside_smooth_ones() {
        let flat = mesh(vec![triangle([0, 1, 2])]).unwrap();
        let smooth = Mesh::new(
            corners(),
            vec![Vec3::new(1.0, 0.0, 1.0); 4],
            vec![triangle([0, 3, 2])],
            vec![Material::default()],
        )
        .unwrap();
        let joined = Mesh::joined(&[smooth, flat]).unwrap();
        let normal = |t: usize| joined.normals()[joined.triangles()[t].vertices[0] as usize];
        assert!((normal(0) - Vec3::new(1.0, 0.0, 1.0).normalize()).length() < 1e-6);
        assert_eq!((normal(1), joined.triangles()[1].material), (Vec3::Z, 1));
    }
}
