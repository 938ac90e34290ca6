//! Twin of the stage [`Coarsen`].

use glam::DVec3;

use super::lookup::xyz;
use crate::stage::{Coarsen, CoarsenParams};

/// What the bindings of [`Coarsen`] hold.
#[derive(Clone, Copy, Debug)]
pub struct CoarsenInputs<'a> {
    /// Density, x fastest.
    pub density: &'a [f32],
    /// The density that scatters, where it is not the density.
    pub scattering: Option<&'a [[f32; 4]]>,
    /// Emission density, where it is not the density.
    pub emission: Option<&'a [f32]>,
    /// Emission density with a colour, in its place.
    pub emission_color: Option<&'a [[f32; 4]]>,
}

/// What [`Coarsen`] writes, laid out \[extinction, albedo, emission\]\[RGB\]\[cell\].
pub fn coarsen(params: &CoarsenParams, inputs: &CoarsenInputs<'_>) -> Vec<f64> {
    let [nx, ny, nz, _] = params.cells;
    let count = (nx * ny * nz) as usize;
    let mut out = vec![0.0; Coarsen::PLANES as usize * count];
    for cell in 0..count {
        let n = cell as u32;
        let values = means(params, inputs, [n % nx, n / nx % ny, n / nx / ny].map(f64::from));
        for (plane, value) in values.into_iter().enumerate() {
            out[plane * count + cell] = value;
        }
    }
    out
}

/// Extinction, albedo and emission of a cell.
fn means(p: &CoarsenParams, inputs: &CoarsenInputs<'_>, cell: [f64; 3]) -> [f64; 9] {
    let (mut density, mut scatters, mut shines, mut volume) = (0.0, DVec3::ZERO, DVec3::ZERO, 0.0);
    let [nx, ny, _, _] = p.dims.map(|n| n as usize);
    for (n, &rho) in inputs.density.iter().enumerate() {
        let voxel = [n % nx, n / nx % ny, n / nx / ny].map(|i| i as f64);
        let common: f64 = (0..3)
            .map(|a| {
                let side = f64::from(p.cell[a]);
                let (from, to) = (cell[a] * side, (cell[a] + 1.0) * side);
                (to.min(voxel[a] + 1.0) - from.max(voxel[a])).max(0.0)
            })
            .product();
        let rho = f64::from(rho);
        volume += common;
        density += common * rho;
        scatters += common * inputs.scattering.map_or(DVec3::splat(rho), |all| xyz(all[n]));
        shines += common
            * match (inputs.emission_color, inputs.emission) {
                (Some(all), _) => xyz(all[n]),
                (None, Some(all)) => DVec3::splat(all[n].into()),
                (None, None) => DVec3::splat(rho),
            };
    }
    let (extinction, albedo) = (xyz(p.extinction), xyz(p.albedo));
    let on = f64::from(p.emission[3]);
    let scattering = scatters / volume * extinction * albedo;
    let similar = density / volume * extinction - on * scattering;
    let shining = shines / volume * xyz(p.emission);
    let mut out = [0.0; 9];
    for c in 0..3 {
        let thin = (1.0 - on) * albedo[c] / (1.0 - on * albedo[c]);
        out[c] = similar[c].max(0.0);
        out[3 + c] = if similar[c] > 0.0 { (1.0 - on) * scattering[c] / similar[c] } else { thin };
        out[6 + c] = shining[c];
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn similar_media_absorb_alike() {
        let density: Vec<f32> = (0..60).map(|i| 0.1 + (0.7 * i as f32).sin().abs()).collect();
        let params = |on: f32| CoarsenParams {
            dims: [5, 4, 3, 0],
            cells: [2, 2, 2, 0],
            cell: [2.5, 2.0, 1.5, 0.0],
            extinction: [3.0, 2.0, 1.0, 0.0],
            albedo: [0.9, 0.5, 1.0, 0.0],
            emission: [0.0, 0.0, 0.0, on],
        };
        let inputs = CoarsenInputs { density: &density, scattering: None, emission: None, emission_color: None };
        let [own, similar] = [0.0, 0.6].map(|on| coarsen(&params(on), &inputs));
        for at in 0..24 {
            let absorbed = |v: &[f64]| v[at] * (1.0 - v[24 + at]);
            assert!((absorbed(&own) - absorbed(&similar)).abs() < 1e-7 * own[at], "{at}");
            assert!((similar[at] / own[at] - (1.0 - 0.6 * own[24 + at])).abs() < 1e-7);
        }
        let mass: f64 = own[..8].iter().sum::<f64>() * 7.5;
        let voxels: f64 = density.iter().map(|&v| f64::from(v) * 3.0).sum();
        assert!((mass / voxels - 1.0).abs() < 1e-6, "mass is kept: {mass} {voxels}");
    }
}
