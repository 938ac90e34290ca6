//! Surfaces as brute force sees them: every triangle, no boxes and no maps.

use std::f64::consts::PI;

use glam::DVec3;

use super::mesh::{self, Hit};
use crate::light::Light;
use crate::scene::{Hierarchy, Mesh};

/// The surfaces of a scene.
pub(super) struct Facets<'s>(Option<(&'s Mesh, &'s Hierarchy)>);

/// Nearer than this part of the mesh's extent a surface is the one that a way begins or ends at.
const MARGIN: f64 = 1e-9;

impl<'s> Facets<'s> {
    pub(super) fn new(mesh: Option<&'s Mesh>) -> Self {
        Self(mesh.and_then(|mesh| Some((mesh, mesh.hierarchy()?))))
    }

    /// The nearest one from `x` along the unit direction `d`, with its normals on the side of `x`.
    pub(super) fn nearest(&self, x: DVec3, d: DVec3) -> Option<Hit> {
        let hit = self.between(x, d, f64::INFINITY)?;
        let side = -hit.facet.dot(d).signum();
        let facet = side * hit.facet;
        Some(Hit { facet, normal: hit.normal.dot(facet).signum() * hit.normal, ..hit })
    }

    /// Whether one stands between `x` and what is `distance` metres away along `toward`.
    pub(super) fn hide(&self, x: DVec3, toward: DVec3, distance: f64) -> bool {
        self.between(x, toward, distance).is_some()
    }

    fn between(&self, x: DVec3, d: DVec3, distance: f64) -> Option<Hit> {
        let (_, all) = self.0?;
        let margin = MARGIN * f64::from(all.extent());
        mesh::nearest(all.records(), all.nodes(), x - all.origin(), d, [margin, distance - margin])
    }

    /// What of the irradiance from `toward` a surface sends back along -`d`, 1/sr.
    pub(super) fn reflect(&self, hit: &Hit, d: DVec3, toward: DVec3) -> DVec3 {
        let facing = hit.normal.dot(toward);
        let Some((mesh, _)) = self.0.filter(|_| facing > 0.0 && hit.facet.dot(toward) > 0.0) else {
            return DVec3::ZERO;
        };
        let material = &mesh.materials()[hit.material as usize];
        let exponent = f64::from(material.shininess);
        let mirrored = (toward - 2.0 * facing * hit.normal).dot(d).max(0.0);
        let lobe = (exponent + 2.0) / (2.0 * PI) * mirrored.powf(exponent);
        facing * (material.diffuse.as_dvec3() / PI + lobe * material.specular.as_dvec3())
    }

    /// Where the ray from `x` along `d` may pass into the shadow of a light or out of it: where it crosses the plane of
    /// a triangle's edge and the light.
    pub(super) fn edges(&self, x: DVec3, d: DVec3, light: &Light) -> Vec<f64> {
        let Some((_, all)) = self.0 else { return Vec::new() };
        let triangles = all.records()[2 * all.nodes() as usize..].chunks_exact(6);
        let corners = triangles.map(|t| [0, 1, 2].map(|i| all.origin() + t[i].xyz().as_dvec3()));
        let edges = corners.flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]]);
        let crossed = edges.map(|[a, b]| {
            let toward = match *light {
                Light::Directional { to_light, .. } => to_light,
                Light::Point { position, .. } | Light::Spot { position, .. } => position - a,
            };
            let normal = (b - a).cross(toward);
            (a - x).dot(normal) / d.dot(normal)
        });
        crossed.filter(|t| t.is_finite()).collect()
    }
}
