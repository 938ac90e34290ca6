//! Light that arrives at a point of a view ray.

use airlight_core::stage::LightRecord;

use super::angle::angle_of_cosine;
use crate::packet::{F, dot, triple};
use crate::simd::Simd;

/// A light as points of view rays see it.
#[derive(Clone, Copy)]
pub(crate) struct Incident<S> {
    /// Unit direction toward the light.
    pub(crate) toward: [F<S>; 3],
    /// Distance to it, metres.
    pub(crate) distance: F<S>,
    /// What falloff and cone leave of its power.
    pub(crate) falloff: F<S>,
}

/// A direction of the world in voxels per metre, by the rows of the map.
#[inline(always)]
pub(crate) fn to_index<S: Simd>(rows: [[f32; 4]; 3], d: [F<S>; 3]) -> [F<S>; 3] {
    triple!(a => d[0] * rows[a][0] + d[1] * rows[a][1] + d[2] * rows[a][2])
}

/// The light `t` metres along the view ray; r² is floored at `floor`.
#[inline(always)]
pub(crate) fn incident<S: Simd>(light: &LightRecord, floor: f32, d: [F<S>; 3], t: F<S>) -> Incident<S> {
    if light.position[3] == 0.0 {
        let toward = triple!(a => F::splat(light.position[a]));
        return Incident { toward, distance: F::splat(f32::INFINITY), falloff: F::ONE };
    }
    let v = triple!(a => F::splat(light.position[a]) - t * d[a]);
    let square = dot(v, v);
    let distance = square.sqrt();
    let far = distance.max(F::splat(f32::MIN_POSITIVE));
    let toward = triple!(a => v[a] / far);
    let mut falloff = F::ONE / square.max(F::splat(floor));
    if light.cone[2] == 1.0 {
        let [beam, cutoff, ..] = light.cone;
        let axis = triple!(a => F::splat(-light.axis[a]));
        // A cone without a rim is a step at the cutoff.
        let rim = (cutoff - beam).max(1e-6);
        let inside = (F::splat(cutoff) - angle_of_cosine(dot(axis, toward))) / rim;
        falloff = falloff * inside.max(F::ZERO).min(F::ONE);
    }
    Incident { toward, distance, falloff }
}
