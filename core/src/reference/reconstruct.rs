//! Twin of the stage [`Reconstruct`](crate::stage::Reconstruct).

use glam::DVec3;

use crate::basis::{Basis, SphericalHarmonics};
use crate::stage::ReconstructParams;

/// What the bindings of [`Reconstruct`](crate::stage::Reconstruct) hold.
#[derive(Clone, Copy, Debug)]
pub struct ReconstructInputs<'a> {
    /// Row of each cell, counted from 1; 0 for none.
    pub rows: &'a [u32],
    /// Cluster of each row, laid out \[channel\]\[row\].
    pub clusters: &'a [u32],
    /// What a row weighs each component, laid out \[channel\]\[row\]\[component\]; empty for none.
    pub weights: &'a [f32],
    /// I, laid out \[channel\]\[cluster\]\[mean, components\]\[moment\].
    pub radiance: &'a [[f32; 4]],
    /// β_j of each moment; the constants of spherical harmonics are not read.
    pub tables: &'a [f32],
}

/// What [`Reconstruct`](crate::stage::Reconstruct) writes: J, laid out \[cell\]\[layer\]\[RGBA\], A zero.
pub fn reconstruct(params: &ReconstructParams, inputs: &ReconstructInputs<'_>) -> Vec<f64> {
    let cells = params.cells[..3].iter().product::<u32>();
    let beta = |j: usize| f64::from(inputs.tables[j]);
    let mut out = Vec::new();
    for cell in 0..cells {
        let arriving = match inputs.rows[cell as usize].min(params.rows) {
            0 => vec![[0.0; 3]; params.coefficients() as usize],
            row => arriving(params, inputs, row as usize - 1),
        };
        if params.view == 1 {
            let harmonics = SphericalHarmonics::new(params.bands).expect("bands that spherical harmonics have");
            let mut values = vec![0.0; harmonics.count()];
            harmonics.eval(view_direction(params, cell), &mut values);
            let seen = |c: usize| -> f64 { (0..values.len()).map(|j| beta(j) * values[j] * arriving[j][c]).sum() };
            out.extend([0, 1, 2].map(seen));
            out.push(0.0);
        } else {
            for (j, i) in arriving.iter().enumerate() {
                out.extend(i.map(|v| beta(j) * v));
                out.push(0.0);
            }
        }
    }
    out
}

/// I_j of a row, RGB.
fn arriving(params: &ReconstructParams, inputs: &ReconstructInputs<'_>, row: usize) -> Vec<[f64; 3]> {
    let (moments, components) = (params.coefficients() as usize, params.components as usize);
    let one = |j: usize, c: usize| {
        let channel = if params.channels == 3 { c } else { 0 };
        let place = channel * params.rows as usize + row;
        let cluster = inputs.clusters[place].min(params.clusters - 1);
        let first = (channel as u32 * params.clusters + cluster) as usize * (1 + components);
        let radiance = |i: usize| f64::from(inputs.radiance[(first + i) * moments + j][c]);
        let weight = |i: usize| f64::from(inputs.weights[place * components + i]);
        radiance(0) + (0..components).map(|i| weight(i) * radiance(1 + i)).sum::<f64>()
    };
    (0..moments).map(|j| [0, 1, 2].map(|c| one(j, c))).collect()
}

/// Unit direction in the world from the eye to a cell's centre; +Z where the cell is at the eye.
fn view_direction(params: &ReconstructParams, cell: u32) -> DVec3 {
    let [x, y, ..] = params.cells;
    let place = [cell % x, cell / x % y, cell / x / y];
    let from = [0, 1, 2].map(|a| {
        let center = (f64::from(place[a]) + 0.5) * f64::from(params.cell[a]) - 0.5;
        center - f64::from(params.eye[a])
    });
    let row = |r: [f32; 4]| (0..3).map(|a| f64::from(r[a]) * from[a]).sum();
    DVec3::new(row(params.world_x), row(params.world_y), row(params.world_z)).try_normalize().unwrap_or(DVec3::Z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    /// Three cells along y, two metres apart, seen from the middle one.
    fn params() -> ReconstructParams {
        let mut params = ReconstructParams::zeroed();
        (params.world_x, params.world_y) = ([1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]);
        params.world_z = [0.0, 0.0, 1.0, 0.0];
        (params.cells, params.cell, params.eye) = ([1, 3, 1, 0], [2.0, 2.0, 2.0, 0.0], [0.5, 2.5, 0.5, 0.0]);
        (params.rows, params.clusters, params.components) = (2, 2, 1);
        (params.channels, params.bands) = (1, 2);
        params
    }

    #[test]
    fn components_are_weighed_and_what_points_too_far_is_the_last() {
        let radiance: Vec<[f32; 4]> = (0..16u8).map(|n| [f32::from(n), 100.0 + f32::from(n), 0.0, 9.0]).collect();
        let inputs = ReconstructInputs {
            rows: &[2, 0, 7],
            clusters: &[0, 9],
            weights: &[0.0, 0.5],
            radiance: &radiance,
            tables: &[1.0, 0.5, 0.25, 0.125],
        };
        let found = reconstruct(&params(), &inputs);
        // Row 2 is of cluster 1, whose mean begins at 8 and whose component begins at 12.
        assert_eq!(found[..8], [8.0 + 6.0, 108.0 + 56.0, 0.0, 0.0, 0.5 * (9.0 + 6.5), 0.5 * (109.0 + 56.5), 0.0, 0.0]);
        assert!(found[16..32].iter().all(|v| *v == 0.0));
        assert_eq!(found[32..], found[..16]);
    }

    #[test]
    fn channels_are_of_their_own() {
        let mut params = params();
        (params.channels, params.bands, params.components, params.rows) = (3, 1, 0, 1);
        let radiance: Vec<[f32; 4]> = (0..6u8).map(|n| [0, 10, 20, 30].map(|c| f32::from(n + c))).collect();
        let inputs = ReconstructInputs {
            rows: &[1, 1, 1],
            clusters: &[1, 0, 1],
            weights: &[],
            radiance: &radiance,
            tables: &[2.0],
        };
        assert_eq!(reconstruct(&params, &inputs)[..4], [2.0, 24.0, 50.0, 0.0]);
    }

    #[test]
    fn a_view_is_a_sum_over_the_basis() {
        let mut params = params();
        (params.view, params.components) = (1, 0);
        // Light that comes from above alone: Y_1,0 is √(3/4π) cos θ.
        let radiance = [[0.0; 4], [0.0; 4], [1.0, 2.0, 3.0, 0.0], [0.0; 4]];
        let inputs = ReconstructInputs {
            rows: &[1, 1, 1],
            clusters: &[0, 0],
            weights: &[],
            radiance: &radiance,
            tables: &[1.0, 0.5, 0.5, 0.5],
        };
        let found = reconstruct(&params, &inputs);
        let y = 0.5 * (3.0 / (4.0 * std::f64::consts::PI)).sqrt();
        let expected = [-y, -2.0 * y, -3.0 * y, 0.0, 0.0, 0.0, 0.0, 0.0, y, 2.0 * y, 3.0 * y, 0.0];
        assert!(found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 1e-12), "{found:?}");
    }
}
