//! What a straightforward loop takes for the same lookups.

use rayon::prelude::*;

use crate::{DIMS, View};

/// The sum of the density over every sample of the view: trilinear lookups, one after the other, in plain safe Rust
/// on all cores. The samples lie where `march` takes them.
pub fn trilinear_sum(density: &[f32], view: &View) -> f32 {
    view.rays.par_iter().map(|ray| (0..ray.steps).map(|k| trilinear(density, ray.at(k))).sum::<f32>()).sum()
}

/// The density at `p` in index space, indices clamped at the edge, x then y then z.
fn trilinear(density: &[f32], p: [f32; 3]) -> f32 {
    let dims = [DIMS.x as usize, DIMS.y as usize, DIMS.z as usize];
    let (mut low, mut high, mut f) = ([0; 3], [0; 3], [0.0; 3]);
    for a in 0..3 {
        let q = p[a].clamp(0.0, (dims[a] - 1) as f32);
        low[a] = q as usize;
        high[a] = (low[a] + 1).min(dims[a] - 1);
        f[a] = q - low[a] as f32;
    }
    let lerp = |a: f32, b: f32, f: f32| a + (b - a) * f;
    let row = |y: usize, z: usize| {
        let start = (z * dims[1] + y) * dims[0];
        lerp(density[start + low[0]], density[start + high[0]], f[0])
    };
    let slice = |z: usize| lerp(row(low[1], z), row(high[1], z), f[1]);
    lerp(slice(low[2]), slice(high[2]), f[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lookups_interpolate_and_clamp() {
        // Linear along each axis, which trilinear interpolation gives back.
        let linear = |x: f32, y: f32, z: f32| x + 2.0 * y - 0.5 * z;
        let (w, h) = (DIMS.x as usize, DIMS.y as usize);
        let values: Vec<f32> = (0..w * h * DIMS.z as usize)
            .map(|n| linear((n % w) as f32, (n / w % h) as f32, (n / w / h) as f32))
            .collect();
        // Values up to 400 in f32, three interpolations.
        let close = |a: f32, b: f32| assert!((a - b).abs() < 1e-3, "{a} and {b}");
        close(trilinear(&values, [3.25, 7.5, 11.75]), linear(3.25, 7.5, 11.75));
        close(trilinear(&values, [-9.0, 7.5, 1e6]), linear(0.0, 7.5, DIMS.z as f32 - 1.0));
    }
}
