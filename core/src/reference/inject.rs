//! Twin of the stage [`Inject`].

use glam::{DVec3, UVec3};

use crate::media::{FractalNoise, LARGEST};
use crate::stage::{BlobRecord, Inject, InjectParams, inject_kind};

/// What the bindings of [`Inject`] hold.
#[derive(Clone, Copy, Debug, Default)]
pub struct InjectInputs<'a> {
    /// The field that noise multiplies, x fastest.
    pub base: Option<&'a [f32]>,
    /// The Gaussians.
    pub blobs: &'a [BlobRecord],
    /// Where each bin's list begins, and the end of the last.
    pub starts: &'a [u32],
    /// Numbers of Gaussians.
    pub list: &'a [u32],
}

/// The density, x fastest: what all passes together leave.
pub fn inject(params: &InjectParams, inputs: &InjectInputs<'_>) -> Vec<f64> {
    let [nx, ny, nz, kind] = params.dims;
    let noise = |p: DVec3| {
        // The place is in cells already.
        FractalNoise::new(1.0, params.octaves, params.seed, params.contrast.into()).map_or(f64::NAN, |n| n.factor(p))
    };
    let mut out = Vec::new();
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                let p = place(params, UVec3::new(i, j, k));
                let density = f64::from(params.density);
                let value = match kind {
                    inject_kind::GAUSSIANS => gaussians(params, inputs, UVec3::new(i, j, k), p),
                    inject_kind::HEIGHT_FOG => density * (-p.y.max(0.0)).exp(),
                    inject_kind::NOISE => density * noise(p),
                    _ => inputs.base.map_or(f64::NAN, |base| f64::from(base[out.len()]) * noise(p)),
                };
                out.push(value.min(LARGEST.into()));
            }
        }
    }
    out
}

fn place(params: &InjectParams, index: UVec3) -> DVec3 {
    let row = |r: [f32; 4]| {
        let [x, y, z, w] = r.map(f64::from);
        DVec3::new(x, y, z).dot(index.as_dvec3()) + w
    };
    DVec3::new(row(params.place_x), row(params.place_y), row(params.place_z))
}

/// The sum over the list of the sample's bin.
fn gaussians(params: &InjectParams, inputs: &InjectInputs<'_>, index: UVec3, p: DVec3) -> f64 {
    let bin = index.map(|n| (n / Inject::BRICK) >> params.bricks[3]);
    let bin = ((bin.z * params.bins[1] + bin.y) * params.bins[0] + bin.x) as usize;
    let list = &inputs.list[inputs.starts[bin] as usize..inputs.starts[bin + 1] as usize];
    list.iter()
        .map(|&number| {
            let [x, y, z, a2] = inputs.blobs[number as usize].center.map(f64::from);
            let c = f64::from(inputs.blobs[number as usize].amplitude[0]);
            c * (-a2 * (p - DVec3::new(x, y, z)).length_squared()).exp()
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    use crate::media::{Detailed, Gaussian, Gaussians, Grid, GridMedium, HeightFog, Lattice, Medium, Noise};

    fn lattice() -> Lattice {
        let (min, max) = (DVec3::new(-1.0, 3.0, 20.0), DVec3::new(0.1, 4.0, 21.7));
        Lattice::in_box(UVec3::new(11, 10, 17), min, max).unwrap()
    }

    /// Places and parameters are rounded to f32: a few 10⁻⁷ of some lengths.
    const PLAIN: f64 = 3e-6;
    /// Places are up to 256 cells, rounded by 1.5·10⁻⁵; five octaves change by up to 2 · 0.7 · 3 a cell each.
    const NOISY: f64 = 1.5e-5 * 5.0 * 4.2;

    /// The twin against what the medium itself says, which knows nothing of the stage.
    fn agree(medium: &dyn Medium, found: &[f64], tolerance: f64) {
        let dims = medium.lattice().dims();
        let mut slice = vec![0.0; (dims.x * dims.y) as usize];
        for k in 0..dims.z {
            medium.density_slice(k, &mut slice);
            for (n, &expected) in slice.iter().enumerate() {
                let found = found[k as usize * slice.len() + n];
                assert!((found - f64::from(expected)).abs() < tolerance, "{n} of {k}: {found} {expected}");
            }
        }
    }

    #[test]
    fn gaussians_are_the_media_s() {
        let lattice = lattice();
        let blob = |i: u32| {
            let at = |a| f64::from(crate::random::unit(crate::random::hash([i, a])));
            let center = DVec3::new(-1.0, 3.0, 20.0) + DVec3::new(at(0), at(1), at(2)) * 1.5;
            Gaussian { center, a: 2.0 + 9.0 * at(3), c: 0.1 }
        };
        let medium = Gaussians::new((0..30).map(blob).collect(), lattice.clone()).unwrap();
        let records = BlobRecord::of(&medium);
        let bins = medium.bins();
        let params = InjectParams::new(inject_kind::GAUSSIANS, &lattice, InjectParams::centered(&lattice));
        let inputs = InjectInputs { base: None, blobs: &records, starts: &bins.starts, list: &bins.list };
        agree(&medium, &inject(&params.with_bins(bins), &inputs), PLAIN);
    }

    #[test]
    fn fog_and_noise_are_the_media_s() {
        let lattice = lattice();
        let fog = HeightFog::new(0.7, 2.5, 3.4, lattice.clone()).unwrap();
        let mut params = InjectParams::new(inject_kind::HEIGHT_FOG, &lattice, InjectParams::above(&lattice, 3.4, 2.5));
        params.density = 0.7;
        agree(&fog, &inject(&params, &InjectInputs::default()), PLAIN);

        let fractal = FractalNoise::new(0.3, 5, 9, 3.0).unwrap();
        let noise = Noise::new(0.7, fractal, lattice.clone()).unwrap();
        let place = InjectParams::in_cells(&lattice, &fractal);
        let mut params = InjectParams::new(inject_kind::NOISE, &lattice, place).with_noise(&fractal);
        params.density = 0.7;
        agree(&noise, &inject(&params, &InjectInputs::default()), NOISY);

        let values: Vec<f32> = (0..11 * 10 * 17).map(|i| (i % 5) as f32 * 0.2).collect();
        let grid = Grid::dense(lattice.dims(), lattice.index_to_world(), values.clone()).unwrap();
        let detailed = Detailed::new(Arc::new(GridMedium::new(Arc::new(grid), None).unwrap()), fractal);
        params.dims[3] = inject_kind::DETAIL;
        agree(&detailed, &inject(&params, &InjectInputs { base: Some(&values), ..Default::default() }), NOISY);
    }
}
