//! Twin of the stage [`March`](crate::stage::March).

use glam::DVec3;

use super::closed::{emission_absorption, transmittance};
use super::lookup::{Samples, Steps, Tints, apply, phase, xyz};
use super::mesh::nearest;
use super::phong::{normal, phong};
use super::shadow::{Face, face, face_count};
use super::sky::sky;
use crate::basis::{Basis, SphericalHarmonics};
use crate::blue_noise;
use crate::stage::{FAR, LightRecord, March, MarchParams, MeshRecord, alone, shadow_kind, surface_shadow};

/// What the bindings of [`March`](crate::stage::March) hold.
#[derive(Clone, Copy, Debug)]
pub struct MarchInputs<'a> {
    /// Density, x fastest.
    pub density: &'a [f32],
    /// Density that scatters, where it is not the density.
    pub scattering: Option<&'a [[f32; 4]]>,
    /// Emission density, where it is not the density.
    pub emission: Option<&'a [f32]>,
    /// Emission density with a colour, in its place.
    pub emission_color: Option<&'a [[f32; 4]]>,
    /// In-scattered radiance, laid out \[cell\]\[layer\].
    pub in_scatter: Option<&'a [[f32; 4]]>,
    /// In-scattered radiance of light that was scattered before, laid out \[cell\]\[layer\].
    pub scattered: Option<&'a [[f32; 4]]>,
    /// Columns or mean densities toward the lights, laid out \[cell\]\[layer\].
    pub light_depth: Option<&'a [[f32; 4]]>,
    /// Lights.
    pub lights: &'a [LightRecord],
    /// Sub-pixel positions and the phase function's table; the constants of spherical harmonics are not read.
    pub tables: &'a [f32],
    /// Texels of the environment.
    pub environment: Option<&'a [[f32; 4]]>,
    /// Surfaces behind the pixels, or behind their sub-pixel positions.
    pub surface: Option<&'a [[f32; 4]]>,
    /// Boxes, which are not read, and triangles that shadow lights.
    pub mesh: &'a [MeshRecord],
    /// How far lights reach.
    pub shadow_map: &'a [f32],
}

/// What [`March`](crate::stage::March) writes: eight values a pixel, which are premultiplied RGB and alpha (of the medium
/// alone, the surface's distance), transmittance RGB and depth.
///
/// # Panics
/// More bands than [`SphericalHarmonics`] has.
pub fn march(params: &MarchParams, inputs: &MarchInputs<'_>) -> Vec<f64> {
    let bands = if params.cells[3].max(params.scattered_cells[3]) > 1 { params.bands } else { 1 };
    let harmonics = SphericalHarmonics::new(bands).expect("bands that spherical harmonics have");
    let mut film = Vec::new();
    for y in 0..params.height {
        for x in 0..params.width {
            if params.alone == alone::RIMS && !inputs.surface.is_some_and(|surface| near_rim(params, surface, x, y)) {
                film.extend([0.0, 0.0, 0.0, March::UNMARCHED.into(), 1.0, 1.0, 1.0, f64::INFINITY]);
                continue;
            }
            let full = |n: u32, size: u32| (n * params.scale + params.scale / 2).min(size - 1);
            let (fx, fy) = (full(x, params.full_width), full(y, params.full_height));
            // The surface of a sub-pixel position.
            let each = params.surface_samples as usize;
            let pixel = (fy * params.full_width + fx) as usize;
            let surface = |s: usize| inputs.surface.map(|surface| surface[pixel * each + s % each]);
            let limit = |s: usize| surface(s).map_or(f64::INFINITY, |s| s[3].into());
            let mut color = DVec3::ZERO;
            let mut through = DVec3::ZERO;
            let (mut stopped, mut stopped_at) = (0.0, 0.0);
            for s in 0..params.samples as usize {
                let px = f64::from(fx) + f64::from(inputs.tables[2 * s]);
                let py = f64::from(fy) + f64::from(inputs.tables[2 * s + 1]);
                let a = 2.0 * px / f64::from(params.full_width) - 1.0;
                let b = 1.0 - 2.0 * py / f64::from(params.full_height);
                let d = (xyz(params.forward) + a * xyz(params.right) + b * xyz(params.up)).normalize();
                let place = jitter(params, inputs.tables, x, y, s);
                let path = Path::walk(params, inputs, &harmonics, d, limit(s), place);
                let behind = match (surface(s), inputs.environment) {
                    _ if params.alone != alone::NO => DVec3::ZERO,
                    (Some(surface), _) if surface[3].is_finite() => xyz(surface),
                    (_, Some(texels)) => {
                        sky([params.environment_width, params.environment_height], params.environment, texels, d)
                    }
                    _ => DVec3::ZERO,
                };
                color += path.radiance + path.transmittance * behind;
                through += path.transmittance;
                stopped += path.stopped;
                stopped_at += path.stopped_at;
            }
            let samples = f64::from(params.samples);
            let (color, through) = (color / samples, through / samples);
            let alpha = 1.0 - (through.x + through.y + through.z) / 3.0;
            film.extend([color.x, color.y, color.z]);
            film.push(if params.alone != alone::NO { limit(0).min(FAR.into()) } else { alpha });
            let depth = if stopped > 0.0 { stopped_at / stopped } else { f64::INFINITY };
            film.extend([through.x, through.y, through.z, depth]);
        }
    }
    film
}

/// Whether a rim of the surfaces, a vector a pixel of the full picture, is near a pixel of the film.
pub fn near_rim(params: &MarchParams, surface: &[[f32; 4]], x: u32, y: u32) -> bool {
    let (mut nearest, mut farthest) = (FAR, 0.0f32);
    for y in y.saturating_sub(2)..=(y + 2).min(params.height - 1) {
        for x in x.saturating_sub(2)..=(x + 2).min(params.width - 1) {
            let full = |n: u32, size: u32| (n * params.scale + params.scale / 2).min(size - 1);
            let (x, y) = (full(x, params.full_width), full(y, params.full_height));
            let distance = surface[(y * params.full_width + x) as usize][3].min(FAR);
            (nearest, farthest) = (nearest.min(distance), farthest.max(distance));
        }
    }
    nearest < March::RIM * farthest
}

/// Where the samples of sub-pixel position `s` of a pixel lie within their steps.
fn jitter(params: &MarchParams, tables: &[f32], x: u32, y: u32, s: usize) -> f64 {
    if params.jittered == 0 {
        return 0.5;
    }
    let (at, side) = (params.jitter_at as usize, blue_noise::SIDE);
    let tile = tables[at + params.samples as usize + (y % side * side + x % side) as usize];
    (f64::from(tile) + f64::from(tables[at + s]) + f64::from(params.jitter_offset)).fract()
}

/// One view ray.
struct Path {
    radiance: DVec3,
    transmittance: DVec3,
    stopped: f64,
    stopped_at: f64,
}

impl Path {
    fn walk(
        params: &MarchParams,
        inputs: &MarchInputs<'_>,
        harmonics: &SphericalHarmonics,
        d: DVec3,
        limit: f64,
        place: f64,
    ) -> Self {
        let density = Samples::new(inputs.density, params.dims);
        let scattering = Tints::new(inputs.scattering, inputs.density, params.dims);
        let emission = Tints::new(inputs.emission_color, inputs.emission.unwrap_or(inputs.density), params.dims);
        let rows = [params.index_x, params.index_y, params.index_z];
        let mut steps = Steps::new(xyz(params.eye), apply(rows, d), params.dims, limit, params.step.into());
        if params.steps > 0 {
            steps = steps.in_steps(params.steps.into());
        }
        let mut path = Self { radiance: DVec3::ZERO, transmittance: DVec3::ONE, stopped: 0.0, stopped_at: 0.0 };
        for k in 0..steps.count {
            if path.transmittance.max_element() < f64::from(params.cut) {
                break;
            }
            let (t, at) = steps.within(k, place);
            let extinction = density.trilinear(at) * xyz(params.extinction);
            let mut light = direct(params, inputs, at, t, d);
            light += gathered(
                inputs.in_scatter,
                params.cells,
                params.cells_per_voxel,
                params.trilinear == 1,
                harmonics,
                at,
                d,
            );
            light += gathered(
                inputs.scattered,
                params.scattered_cells,
                params.scattered_cells_per_voxel,
                true,
                harmonics,
                at,
                d,
            );
            let scattering = scattering.trilinear(at) * xyz(params.extinction) * xyz(params.albedo);
            let source = scattering * light + emission.trilinear(at) * xyz(params.emission);
            for c in 0..3 {
                let sent = emission_absorption(source[c], extinction[c], steps.length);
                path.radiance[c] += path.transmittance[c] * sent;
                let left = path.transmittance[c] * transmittance(extinction[c] * steps.length);
                path.stopped += path.transmittance[c] - left;
                path.stopped_at += (path.transmittance[c] - left) * t;
                path.transmittance[c] = left;
            }
        }
        path
    }
}

/// J from a field of in-scattered radiance.
fn gathered(
    field: Option<&[[f32; 4]]>,
    cells: [u32; 4],
    per_voxel: [f32; 4],
    trilinear: bool,
    harmonics: &SphericalHarmonics,
    at: DVec3,
    d: DVec3,
) -> DVec3 {
    let Some(field) = field else { return DVec3::ZERO };
    let place = (at + 0.5) * xyz(per_voxel) - 0.5;
    let layers = cells[3] as usize;
    let layer = |k: usize| {
        let values: Vec<_> = field.iter().skip(k).step_by(layers).copied().collect();
        let layer = Samples::new(&values, cells);
        if trilinear { layer.trilinear(place) } else { xyz(layer.nearest(place)) }
    };
    if layers == 1 {
        return layer(0);
    }
    let mut values = vec![0.0; harmonics.count()];
    harmonics.eval(d, &mut values);
    values.iter().take(layers).enumerate().map(|(k, y)| layer(k) * *y).sum()
}

/// J from the lights, at the point `at` of index space, `t` metres along the view ray.
fn direct(params: &MarchParams, inputs: &MarchInputs<'_>, at: DVec3, t: f64, d: DVec3) -> DVec3 {
    let density = Samples::new(inputs.density, params.dims);
    let rows = [params.index_x, params.index_y, params.index_z];
    let table = &inputs.tables[params.phase_at as usize..][..params.phase_size as usize];
    let mut sum = DVec3::ZERO;
    for (number, light) in inputs.lights.iter().take(params.lights as usize).enumerate() {
        let (toward, distance, falloff) = incident(light, params.light_floor, t, d);
        let way = || Steps::new(at, apply(rows, toward), params.dims, distance, params.step.into());
        let column = match params.shadow {
            shadow_kind::MARCH => way().column(density),
            shadow_kind::COLUMN => depth(params, inputs, at, number),
            shadow_kind::MEAN => depth(params, inputs, at, number) * way().length * way().count as f64,
            _ => 0.0,
        };
        let seen = visibility(params, inputs, light, xyz(params.mesh_eye) + t * d, toward, distance);
        let scatters = if params.phong[3] > 0.0 {
            phong(params, normal(params, density, at), toward, d)
        } else {
            phase(params.phase_kind, params.phase, table, toward.dot(d))
        };
        let arriving = xyz(light.power) * falloff * seen * scatters;
        sum += arriving * DVec3::from((xyz(params.light_extinction) * column).to_array().map(transmittance));
    }
    sum
}

/// Unit direction toward a light `t` metres along the view ray, distance to it, and what falloff and cone leave of its
/// power.
pub(super) fn incident(light: &LightRecord, floor: f32, t: f64, d: DVec3) -> (DVec3, f64, f64) {
    if light.position[3] == 0.0 {
        return (xyz(light.position), f64::INFINITY, 1.0);
    }
    let way = xyz(light.position) - t * d;
    let toward = way.normalize_or_zero();
    (toward, way.length(), cone(light, toward) / way.length_squared().max(floor.into()))
}

/// How much of a light passes by the surfaces to the point `at`, from the mesh's origin.
fn visibility(
    params: &MarchParams,
    inputs: &MarchInputs<'_>,
    light: &LightRecord,
    at: DVec3,
    toward: DVec3,
    distance: f64,
) -> f64 {
    let extent = f64::from(params.mesh_eye[3]);
    match params.surface_shadow {
        surface_shadow::RAY => {
            let free = distance - f64::from(MeshRecord::MARGIN) * extent;
            let stands = nearest(inputs.mesh, params.nodes, at, toward, [0.0, free]);
            if stands.is_some() { 0.0 } else { 1.0 }
        }
        surface_shadow::MAP => {
            let parallel = light.position[3] == 0.0;
            let way = if parallel { at } else { -distance * toward };
            // The face whose axis the way is nearest to.
            let faces = (0..face_count(light)).map(|n| (n, face(light, n, extent)));
            let nearer = |a: &(u32, Face), b: &(u32, Face)| way.dot(a.1.forward).total_cmp(&way.dot(b.1.forward));
            let Some((number, face)) = faces.max_by(nearer) else { return 1.0 };
            let depth = if parallel { at.dot(face.forward) + extent } else { way.dot(face.forward) };
            let scale = if parallel { extent } else { face.half_width * depth };
            let place = [face.right, face.up].map(|axis| if scale > 0.0 { way.dot(axis) / scale } else { 0.0 });
            if parallel && place.iter().any(|x| x.abs() > 1.0) {
                return 1.0;
            }
            let side = params.map_side as usize;
            let first = (light.power[3] as usize + number as usize) * side * side;
            let lit = |held: &f32| if depth <= f64::from(*held) { 1.0 } else { 0.0 };
            let lit: Vec<f32> = inputs.shadow_map[first..][..side * side].iter().map(lit).collect();
            let q = place.map(|x| (0.5 * x + 0.5) * side as f64 - 0.5);
            Samples::new(&lit, [params.map_side, params.map_side, 1, 0]).trilinear(DVec3::new(q[0], q[1], 0.0))
        }
        _ => 1.0,
    }
}

/// The field toward light `number`, at the point `at` of index space.
fn depth(params: &MarchParams, inputs: &MarchInputs<'_>, at: DVec3, number: usize) -> f64 {
    let layers = params.light_cells[3] as usize;
    let texels = inputs.light_depth.unwrap_or_default();
    let values: Vec<f32> = texels.iter().skip(number / 4).step_by(layers).map(|texel| texel[number % 4]).collect();
    let place = (at + 0.5) * xyz(params.light_cells_per_voxel) - 0.5;
    Samples::new(&values, params.light_cells).trilinear(place)
}

/// What a spot's cone leaves of its intensity: linear in the angle from `beam` to `cutoff`. 1 for other lights.
fn cone(light: &LightRecord, toward: DVec3) -> f64 {
    let [beam, cutoff, spot, _] = light.cone.map(f64::from);
    let angle = xyz(light.axis).dot(-toward).clamp(-1.0, 1.0).acos();
    if spot == 0.0 || angle <= beam {
        1.0
    } else if angle >= cutoff {
        0.0
    } else {
        (cutoff - angle) / (cutoff - beam)
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;
    use crate::reference::closed::LitBox;
    use crate::stage::PhaseParams;

    /// A homogeneous box of 0.6 × 0.6 × 0.4 m before an eye at (1.1, 0.9, 1.3), with a directional light.
    fn lit() -> (MarchParams, LightRecord, LitBox) {
        let eye = DVec3::new(1.1, 0.9, 1.3);
        let edge = [0.2f64, 0.3, 0.1];
        let mut params = MarchParams::zeroed();
        params.dims = [3, 2, 4, 0];
        let row = |a: usize| [0, 1, 2, 3].map(|i| if i == a { (1.0 / edge[a]) as f32 } else { 0.0 });
        [params.index_x, params.index_y, params.index_z] = [row(0), row(1), row(2)];
        params.eye = [0, 1, 2, 3].map(|a| if a < 3 { (eye[a] / edge[a] - 0.5) as f32 } else { 0.0 });
        let forward = (DVec3::new(0.3, 0.3, 0.2) - eye).normalize();
        let right = forward.cross(DVec3::Y).normalize();
        let axes = [forward, right * 0.3, right.cross(forward) * 0.2];
        [params.forward, params.right, params.up] = axes.map(|a| a.as_vec3().extend(0.0).to_array());
        (params.width, params.height, params.samples) = (9, 6, 1);
        (params.scale, params.full_width, params.full_height) = (1, 9, 6);
        (params.extinction, params.albedo) = ([3.0, 2.0, 1.0, 0.0], [0.9, 0.5, 1.0, 0.0]);
        params.light_extinction = params.extinction;
        (params.step, params.cut, params.lights, params.shadow) = (1e-3, 0.0, 1, shadow_kind::MARCH);
        (params.phase_kind, params.phase) = (PhaseParams::HENYEY_GREENSTEIN, [0.5, 0.0, 1.0, 0.0]);
        params.phase_at = 2;
        let to_light = DVec3::new(0.5, 0.8, -0.35).normalize();
        let mut light = LightRecord::zeroed();
        (light.position, light.power) = (to_light.as_vec3().extend(0.0).to_array(), [2.0, 2.0, 2.0, 0.0]);
        let closed = LitBox {
            min: DVec3::ZERO,
            max: DVec3::new(0.6, 0.6, 0.4),
            scattering: 0.0,
            extinction: 0.0,
            to_light,
            irradiance: 2.0,
        };
        (params, light, closed)
    }

    #[test]
    fn a_lit_box_is_closed() {
        let (params, light, closed) = lit();
        let density = 1.5f32;
        let inputs = MarchInputs {
            density: &[density; 24],
            scattering: None,
            emission: None,
            emission_color: None,
            in_scatter: None,
            scattered: None,
            light_depth: None,
            lights: &[light],
            tables: &[0.5, 0.5],
            environment: None,
            surface: None,
            mesh: &[],
            shadow_map: &[],
        };
        let film = march(&params, &inputs);
        let mut seen = 0;
        for (pixel, found) in film.chunks_exact(8).enumerate() {
            let (x, y) = ((pixel % 9) as f64 + 0.5, (pixel / 9) as f64 + 0.5);
            let ray =
                xyz(params.forward) + (2.0 * x / 9.0 - 1.0) * xyz(params.right) + (1.0 - y / 3.0) * xyz(params.up);
            let (eye, d) = (DVec3::new(1.1, 0.9, 1.3), ray.normalize());
            let way = closed.clip(eye, d).map_or(0.0, |(near, far)| far - near);
            let phase = crate::media::Phase::HenyeyGreenstein { g: 0.5 }.eval(closed.to_light.dot(d));
            for c in 0..3 {
                let extinction = f64::from(density * params.extinction[c]);
                let scattering = extinction * f64::from(params.albedo[c]);
                let expected = LitBox { extinction, scattering, ..closed }.single_scattering(phase, eye, d);
                // Steps of 1 mm, of which the last toward the light ends up to a whole one off the wall; the
                // parameters are rounded to f32.
                assert!((found[c] - expected).abs() < 3e-3 * expected + 1e-7, "{pixel}: {} {expected}", found[c]);
                let through = transmittance(extinction * way);
                assert!((found[4 + c] - through).abs() < 1e-6, "{pixel}: {} {through}", found[4 + c]);
            }
            seen += usize::from(way > 0.1);
            assert_eq!(found[7].is_finite(), way > 0.0, "a depth where something is stopped");
        }
        assert!(seen > 20, "{seen} pixels see the box");
    }
}
