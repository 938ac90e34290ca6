//! What loops of nothing but lookups take: a straightforward one, and one in packets.

use airlight_cpu::{BareRay, bare_lookups};
use rayon::prelude::*;

use crate::{DIMS, View, density};

/// The sum of the density over every sample of the view: trilinear lookups, one after the other, in plain safe Rust
/// on all cores. The samples lie where `march` takes them.
pub fn trilinear_sum(density: &[f32], view: &View) -> f32 {
    view.rays.par_iter().map(|ray| (0..ray.steps).map(|k| trilinear(density, ray.at(k))).sum::<f32>()).sum()
}

/// The same lookups in packets of sixteen rays, by the instructions and in the order of rays of the device `cpu`: what
/// memory allows a march that does nothing else.
#[derive(Debug)]
pub struct Lookups {
    texels: Vec<f32>,
    rays: Vec<BareRay>,
}

impl Lookups {
    /// Of a view, whose sides are multiples of eight.
    pub fn new(view: &View) -> Self {
        let width = view.camera.width as usize;
        // Blocks of eight by eight pixels, each as four packets of four by four.
        let bits = |n: usize, at: [usize; 3]| at.iter().enumerate().map(|(i, b)| (n >> b & 1) << i).sum::<usize>();
        let pixel = |n: usize| {
            let (block, within) = (n / 64, n % 64);
            let x = block % (width / 8) * 8 + bits(within, [0, 1, 4]);
            let y = block / (width / 8) * 8 + bits(within, [2, 3, 5]);
            y * width + x
        };
        let ray = |n: usize| {
            let ray = &view.rays[pixel(n)];
            BareRay { origin: ray.at(0), step: ray.step(), samples: ray.steps }
        };
        let mut texels = density();
        // Lookups fetch two texels at a time, also at the edge.
        texels.push(0.0);
        Self { texels, rays: (0..view.rays.len()).map(ray).collect() }
    }

    /// The sum of all lookups.
    pub fn sum(&self) -> f32 {
        bare_lookups(&self.texels, DIMS.to_array(), &self.rays)
    }
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
    fn packets_look_up_what_single_loops_do() {
        let view = View::new(64, 48);
        let (packets, single) = (Lookups::new(&view).sum(), trilinear_sum(&density(), &view));
        assert!(single > 1000.0);
        // Hundreds of thousands of values up to 1, in f32 and in another order; a pixel lost or taken twice is 1e-3.
        assert!((packets / single - 1.0).abs() < 1e-4, "{packets} and {single}");
    }

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
