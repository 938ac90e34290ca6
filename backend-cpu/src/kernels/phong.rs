//! Light that is scattered as by a surface across the density's gradient.

use std::f32::consts::PI;

use airlight_core::stage::March;

use super::field::Scalars;
use crate::packet::{F, LANES, dot, lanes, triple};
use crate::simd::Simd;

/// The unit normal away from what is denser, at points of index space whose map from metres has these rows: central
/// differences over a voxel either way. Zero where the density is level.
#[inline(always)]
pub(crate) fn normal<S: Simd>(density: Scalars<'_>, rows: [[f32; 4]; 3], at: [F<S>; 3]) -> [F<S>; 3] {
    let high = triple!(a => beside::<S>(density, at, a, 1.0));
    let low = triple!(a => beside::<S>(density, at, a, -1.0));
    let rise = triple!(a => high[a] - low[a]);
    let sum = triple!(a => high[a] + low[a]);
    let steepest = rise[0].abs().max(rise[1].abs()).max(rise[2].abs());
    let slopes = steepest.gt(sum[0].max(sum[1]).max(sum[2]) * March::FLAT);
    let g = triple!(a => rise[a] / steepest);
    let away = triple!(c => -(g[0] * rows[0][c] + g[1] * rows[1][c] + g[2] * rows[2][c]));
    let length = dot(away, away).sqrt();
    triple!(c => slopes.select(away[c] / length, F::ZERO))
}

/// The density `by` voxels along an axis from `at`.
#[inline(always)]
fn beside<S: Simd>(density: Scalars<'_>, at: [F<S>; 3], axis: usize, by: f32) -> F<S> {
    density.sample::<S>(triple!(a => at[a] + if a == axis { by } else { 0.0 }))
}

/// The share of light from `toward` that goes on along -d, per steradian and unit of irradiance, by ambient, diffuse and
/// specular reflectance and shininess.
#[inline(always)]
pub(crate) fn phong<S: Simd>(k: [f32; 4], away: [F<S>; 3], toward: [F<S>; 3], d: [F<S>; 3]) -> F<S> {
    let facing = dot(away, toward);
    let mirrored = triple!(c => toward[c] - facing * away[c] * 2.0);
    let cosine = dot(d, mirrored);
    let gloss = F::of(lanes!(i => {
        if cosine.0[i] > 0.0 { (k[3] + 2.0) / (2.0 * PI) * cosine.0[i].min(1.0).powf(k[3]) } else { 0.0 }
    }));
    facing.max(F::ZERO) * (gloss * k[2] + k[1] / PI) + k[0] / (4.0 * PI)
}
