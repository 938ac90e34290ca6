//! Light that is scattered as by a surface across the density's gradient.

use std::f64::consts::PI;

use glam::DVec3;

use super::lookup::{Samples, xyz};
use crate::stage::{March, MarchParams};

/// The unit normal away from what is denser, at the point `at` of index space; zero where the density is level.
pub(super) fn normal(params: &MarchParams, density: Samples<'_, f32>, at: DVec3) -> DVec3 {
    let [mut rise, mut sum] = [DVec3::ZERO; 2];
    for (a, axis) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
        let (high, low) = (density.trilinear(at + axis), density.trilinear(at - axis));
        (rise[a], sum[a]) = (high - low, high + low);
    }
    if rise.abs().max_element() <= f64::from(March::FLAT) * sum.max_element() {
        return DVec3::ZERO;
    }
    // The gradient of the world: that of index space by the transpose of the map from metres.
    let rows = [params.index_x, params.index_y, params.index_z].map(xyz);
    -(rise.x * rows[0] + rise.y * rows[1] + rise.z * rows[2]).normalize()
}

/// The share of light from `toward` that goes on along -d, per steradian and unit of irradiance.
pub(super) fn phong(params: &MarchParams, away: DVec3, toward: DVec3, d: DVec3) -> f64 {
    let [ambient, diffuse, specular, shininess] = params.phong.map(f64::from);
    let facing = away.dot(toward).max(0.0);
    let mirrored = 2.0 * away.dot(toward) * away - toward;
    let cosine = mirrored.dot(-d).max(0.0);
    let gloss = (shininess + 2.0) / (2.0 * PI) * cosine.powf(shininess);
    ambient / (4.0 * PI) + facing * (diffuse / PI + specular * gloss)
}
