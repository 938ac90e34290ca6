//! Twin of the stage [`Shade`](crate::stage::Shade).

use std::f64::consts::PI;

use glam::DVec3;

use super::closed::transmittance;
use super::lookup::{Samples, Steps, apply, xyz};
use super::march::incident;
use super::mesh::nearest;
use super::trace::view;
use crate::stage::{LightRecord, MaterialRecord, MeshRecord, ShadeParams};

/// What the bindings of [`Shade`](crate::stage::Shade) hold.
#[derive(Clone, Copy, Debug)]
pub struct ShadeInputs<'a> {
    /// Density, x fastest.
    pub density: &'a [f32],
    /// Lights.
    pub lights: &'a [LightRecord],
    /// Sub-pixel positions.
    pub tables: &'a [f32],
    /// Boxes, which are not read, and triangles.
    pub mesh: &'a [MeshRecord],
    /// Materials.
    pub materials: &'a [MaterialRecord],
    /// What `trace` found.
    pub hits: &'a [[f32; 4]],
    /// What stands behind the pixels.
    pub background: Option<&'a [[f32; 4]]>,
}

/// What [`Shade`](crate::stage::Shade) writes: radiance and distance of each sub-pixel position.
pub fn shade(params: &ShadeParams, inputs: &ShadeInputs<'_>) -> Vec<f64> {
    let samples = params.samples as usize;
    let mut surface = Vec::new();
    for (n, hit) in inputs.hits.chunks_exact(2).enumerate() {
        let pixel = n / samples;
        let back = inputs.background.map_or([0.0, 0.0, 0.0, f32::INFINITY], |all| all[pixel]);
        if hit[0][3] >= back[3] {
            surface.extend(back.map(f64::from));
            continue;
        }
        let (x, y) = (pixel as u32 % params.width, pixel as u32 / params.width);
        let shift = &inputs.tables[2 * (n % samples)..];
        let at = [f64::from(x) + f64::from(shift[0]), f64::from(y) + f64::from(shift[1])];
        let d = view([params.forward, params.right, params.up], [params.width, params.height], at);
        let light = |light| reflected(params, inputs, light, d, hit);
        let sum: DVec3 = inputs.lights.iter().take(params.lights as usize).map(light).sum();
        surface.extend([sum.x, sum.y, sum.z, hit[0][3].into()]);
    }
    surface
}

/// What a surface sends back along `d` of a light.
fn reflected(params: &ShadeParams, inputs: &ShadeInputs<'_>, light: &LightRecord, d: DVec3, hit: &[[f32; 4]]) -> DVec3 {
    let t = f64::from(hit[0][3]);
    let (normal, facet) = (xyz(hit[0]), xyz(hit[1]));
    let (toward, distance, falloff) = incident(light, params.light_floor, t, d);
    let facing = normal.dot(toward);
    if facing <= 0.0 || facet.dot(toward) <= 0.0 {
        return DVec3::ZERO;
    }
    let margin = f64::from(MeshRecord::MARGIN * params.mesh_eye[3]);
    let at = xyz(params.mesh_eye) + t * d + margin * facet;
    if params.visibility == 1 && nearest(inputs.mesh, params.nodes, at, toward, [0.0, distance - margin]).is_some() {
        return DVec3::ZERO;
    }
    let rows = [params.index_x, params.index_y, params.index_z];
    let at = xyz(params.eye) + t * apply(rows, d);
    let density = Samples::new(inputs.density, params.dims);
    let column = Steps::new(at, apply(rows, toward), params.dims, distance, params.step.into()).column(density);
    let through = DVec3::from((xyz(params.extinction) * column).to_array().map(transmittance));

    let material = &inputs.materials[hit[1][3] as usize];
    let mirrored = 2.0 * facing * normal - toward;
    let exponent = f64::from(material.diffuse[3]);
    let cosine = -mirrored.dot(d);
    let lobe = if cosine > 0.0 { (exponent + 2.0) / (2.0 * PI) * cosine.powf(exponent) } else { 0.0 };
    let share = xyz(material.diffuse) / PI + lobe * xyz(material.specular);
    xyz(light.power) * falloff * facing * through * share
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use glam::Vec3;

    use super::*;
    use crate::scene::Material;

    /// Lambert under a lamp, at a slant, through a homogeneous medium that fills everything.
    #[test]
    fn a_floor_is_lit_by_lambert_distance_and_depth() {
        let mut params = ShadeParams::zeroed();
        params.dims = [1, 1, 1, 0];
        // One voxel of 8 m around the eye.
        let row = |a: usize| [0, 1, 2, 3].map(|i| if i == a { 0.125 } else { 0.0 });
        [params.index_x, params.index_y, params.index_z] = [row(0), row(1), row(2)];
        (params.forward, params.extinction) = ([0.0, -1.0, 0.0, 0.0], [0.3, 0.2, 0.1, 0.0]);
        (params.width, params.height, params.samples, params.lights) = (1, 1, 1, 1);
        (params.step, params.light_floor, params.light_end) = (0.5, 1e-6, 1);
        let mut light = LightRecord::zeroed();
        // The floor lies 2 m below the eye, the lamp 1 m above it and 1.5 m aside.
        (light.position, light.power) = ([1.5, -1.0, 0.0, 1.0], [2.0, 2.0, 2.0, 0.0]);
        let material = MaterialRecord::new(&Material { diffuse: Vec3::splat(0.5), ..Material::default() });
        let inputs = ShadeInputs {
            density: &[2.0],
            lights: &[light],
            tables: &[0.5, 0.5],
            mesh: &[],
            materials: &[material],
            hits: &[[0.0, 1.0, 0.0, 2.0], [0.0, 1.0, 0.0, 0.0]],
            background: None,
        };
        let found = shade(&params, &inputs);
        let r2 = 1.0 + 1.5f64.powi(2);
        for (c, extinction) in [0.6, 0.4, 0.2].into_iter().enumerate() {
            let expected = 2.0 / r2 / r2.sqrt() * 0.5 / PI * (-extinction * r2.sqrt()).exp();
            // Extinction is rounded to f32.
            assert!((found[c] / expected - 1.0).abs() < 1e-6, "{} {expected}", found[c]);
        }
        assert_eq!(found[3], 2.0);
    }
}
