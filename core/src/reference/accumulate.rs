//! Twin of the stage [`Accumulate`](crate::stage::Accumulate).

use glam::DVec3;

use super::lookup::xyz;
use crate::stage::{Accumulate, AccumulateParams, FAR, accumulate_mode};

/// What the bindings of [`Accumulate`] hold.
#[derive(Clone, Copy, Debug)]
pub struct AccumulateInputs<'a> {
    /// The film of the medium, two vectors a pixel.
    pub medium: &'a [[f32; 4]],
    /// The history, three vectors a pixel.
    pub last: &'a [[f32; 4]],
}

/// What is kept of a pixel.
#[derive(Clone, Copy)]
struct Past {
    radiance: DVec3,
    count: f64,
    transmittance: DVec3,
    depth: f64,
    surface: f64,
}

/// What [`Accumulate`] writes: twelve values a pixel of the history, and eight of the mean.
pub fn accumulate(params: &AccumulateParams, inputs: &AccumulateInputs<'_>) -> (Vec<f64>, Vec<f64>) {
    let (mut next, mut mean) = (Vec::new(), Vec::new());
    for y in 0..params.height {
        for x in 0..params.width {
            let pixel = (y * params.width + x) as usize;
            let (light, through) = (inputs.medium[2 * pixel], inputs.medium[2 * pixel + 1]);
            let found = match params.mode {
                accumulate_mode::MOVED => {
                    followed(params, inputs, [x, y]).map(|past| clamped(params, inputs, [x, y], past))
                }
                _ => recalled(inputs, pixel),
            };
            let added = Past {
                radiance: xyz(light),
                count: 1.0,
                transmittance: xyz(through),
                depth: through[3].into(),
                surface: light[3].into(),
            };
            let now = match found {
                _ if added.surface < 0.0 => Past { count: 0.0, ..added },
                None => added,
                Some(past) if params.mode == accumulate_mode::AGAIN => past,
                Some(past) => mix(&[(past, past.count.min(params.most.into())), (added, 1.0)]),
            };
            let (l, t) = (now.radiance, now.transmittance);
            next.extend([l.x, l.y, l.z, now.count, t.x, t.y, t.z, now.depth, added.surface, 0.0, 0.0, 0.0]);
            mean.extend([l.x, l.y, l.z, added.surface, t.x, t.y, t.z, now.depth]);
        }
    }
    (next, mean)
}

/// The weighted mean; depths are weighed with what is stopped as well. Its count is the sum of the weights.
fn mix(parts: &[(Past, f64)]) -> Past {
    let count: f64 = parts.iter().map(|(_, w)| w).sum();
    let sum = |of: fn(&Past) -> DVec3| parts.iter().map(|(p, w)| of(p) * *w).sum::<DVec3>() / count;
    let stops =
        |p: &Past| if p.depth.is_finite() { (1.0 - p.transmittance.element_sum() / 3.0).max(1e-9) } else { 0.0 };
    let stopped: f64 = parts.iter().map(|(p, w)| w * stops(p)).sum();
    let at = parts.iter().filter(|(p, _)| p.depth.is_finite()).map(|(p, w)| w * stops(p) * p.depth).sum::<f64>();
    Past {
        radiance: sum(|p| p.radiance),
        count,
        transmittance: sum(|p| p.transmittance),
        depth: if stopped > 0.0 { at / stopped } else { f64::INFINITY },
        surface: parts[0].0.surface,
    }
}

/// The history of a pixel, where it has one that is finite.
fn recalled(inputs: &AccumulateInputs<'_>, pixel: usize) -> Option<Past> {
    let [a, b, c] = [0, 1, 2].map(|i| inputs.last[3 * pixel + i]);
    let past =
        Past { radiance: xyz(a), count: a[3].into(), transmittance: xyz(b), depth: b[3].into(), surface: c[0].into() };
    let finite = past.radiance.is_finite() && past.count.is_finite() && past.transmittance.is_finite();
    (finite && past.count > 0.0).then_some(past)
}

/// The history of what a pixel shows, where the last view saw it.
fn followed(params: &AccumulateParams, inputs: &AccumulateInputs<'_>, at: [u32; 2]) -> Option<Past> {
    let far = f64::from(FAR);
    let pixel = (at[1] * params.width + at[0]) as usize;
    let (surface, depth) = (f64::from(inputs.medium[2 * pixel][3]), f64::from(inputs.medium[2 * pixel + 1][3]));
    let full = [params.full_width, params.full_height];
    let stands = |a: usize| f64::from((at[a] * params.scale + params.scale / 2).min(full[a] - 1)) + 0.5;
    let a = 2.0 * stands(0) / f64::from(full[0]) - 1.0;
    let b = 1.0 - 2.0 * stands(1) / f64::from(full[1]);
    let d = (xyz(params.forward) + a * xyz(params.right) + b * xyz(params.up)).normalize();
    let point = match (depth < far, surface < far) {
        (true, _) => xyz(params.moved) + depth * d,
        (false, true) => xyz(params.moved) + surface * d,
        (false, false) => d,
    };
    let ahead = point.dot(xyz(params.last_forward));
    if ahead <= 0.0 {
        return None;
    }
    let (a, b) = (point.dot(xyz(params.last_right)) / ahead, point.dot(xyz(params.last_up)) / ahead);
    let place = [(a + 1.0) / 2.0 * f64::from(full[0]) - 0.5, (1.0 - b) / 2.0 * f64::from(full[1]) - 0.5];
    let place = place.map(|p| (p - f64::from(params.scale / 2)) / f64::from(params.scale));
    let last = [params.width, params.height].map(|n| f64::from(n) - 1.0);
    if (0..2).any(|a| place[a] < -0.5 || place[a] > last[a] + 0.5) {
        return None;
    }
    let expected = if surface < far { (xyz(params.moved) + surface * d).length() } else { far };
    let mut parts = Vec::new();
    for (right, below) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
        let corner = [place[0].floor() + right, place[1].floor() + below];
        let share: f64 = (0..2).map(|a| 1.0 - (place[a] - corner[a]).abs()).product();
        let [x, y] = [0, 1].map(|a| corner[a].clamp(0.0, last[a]) as usize);
        if let Some(past) = recalled(inputs, y * params.width as usize + x) {
            let (near, distant) = (past.surface.min(expected), past.surface.max(expected));
            let fit = (2.0 - (1.0 - near / distant.max(1e-30)) / f64::from(Accumulate::NEAR)).clamp(0.0, 1.0);
            parts.push((past, share * fit));
        }
    }
    let weights: f64 = parts.iter().map(|(_, w)| w).sum();
    let count = parts.iter().map(|(p, w)| p.count * w).sum::<f64>() / weights;
    (weights >= Accumulate::FIT.into()).then(|| Past { count, ..mix(&parts) })
}

/// A history within the range of the pixels around.
fn clamped(params: &AccumulateParams, inputs: &AccumulateInputs<'_>, at: [u32; 2], past: Past) -> Past {
    let within = |v: DVec3, half: usize| {
        let (mut least, mut most) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for y in at[1].saturating_sub(1)..=(at[1] + 1).min(params.height - 1) {
            for x in at[0].saturating_sub(1)..=(at[0] + 1).min(params.width - 1) {
                let pixel = 2 * (y * params.width + x) as usize;
                if inputs.medium[pixel][3] >= 0.0 {
                    let value = xyz(inputs.medium[pixel + half]);
                    (least, most) = (least.min(value), most.max(value));
                }
            }
        }
        v.max(least).min(most)
    };
    Past { radiance: within(past.radiance, 0), transmittance: within(past.transmittance, 1), ..past }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;
    use crate::stage::March;

    fn still(values: &[f32]) -> Vec<f64> {
        let mut params = AccumulateParams::zeroed();
        (params.width, params.height, params.full_width, params.full_height) = (1, 1, 1, 1);
        (params.scale, params.most) = (1, Accumulate::STILL);
        let mut last = vec![[0.0; 4]; 3];
        let mut mean = Vec::new();
        for &value in values {
            let medium = [[value, 2.0 * value, 0.0, FAR], [0.5, 0.5, 0.5, value]];
            let (next, film) = accumulate(&params, &AccumulateInputs { medium: &medium, last: &last });
            last = next.chunks_exact(4).map(|v| [0, 1, 2, 3].map(|i| v[i] as f32)).collect();
            mean = film;
        }
        mean
    }

    #[test]
    fn a_still_picture_is_a_plain_mean() {
        let mean = still(&[1.0, 2.0, 6.0, 7.0]);
        assert_eq!(mean, [4.0, 8.0, 0.0, f64::from(FAR), 0.5, 0.5, 0.5, 4.0]);
    }

    #[test]
    fn what_was_not_marched_has_no_history_and_bounds_none() {
        let mut params = AccumulateParams::zeroed();
        (params.width, params.height, params.full_width, params.full_height) = (2, 1, 2, 1);
        (params.scale, params.most, params.mode) = (1, Accumulate::MOVED, accumulate_mode::MOVED);
        let axis = |a: usize| [0, 1, 2, 3].map(|i| if i == a { 1.0 } else { 0.0 });
        [params.right, params.up, params.forward] = [0, 1, 2].map(axis);
        [params.last_right, params.last_up, params.last_forward] = [0, 1, 2].map(axis);
        let unmarched = [[0.0, 0.0, 0.0, March::UNMARCHED], [1.0, 1.0, 1.0, f32::INFINITY]];
        let medium = [[[2.0, 2.0, 2.0, FAR], [0.5, 0.5, 0.5, f32::INFINITY]], unmarched].concat();
        let kept = [[1.0, 1.0, 1.0, 1.0], [0.7, 0.7, 0.7, f32::INFINITY], [FAR, 0.0, 0.0, 0.0]];
        let (next, mean) = accumulate(&params, &AccumulateInputs { medium: &medium, last: &[kept, kept].concat() });
        // The history is held to the one pixel that was marched.
        assert_eq!((mean[0], mean[4], next[3]), (2.0, 0.5, 2.0));
        assert_eq!((mean[8], mean[11], next[15], next[20]), (0.0, -1.0, 0.0, -1.0));
    }

    #[test]
    fn what_is_not_finite_is_forgotten() {
        let mean = still(&[1.0, f32::NAN, 6.0, 8.0]);
        assert_eq!((mean[0], mean[7]), (7.0, 7.0));
    }
}
