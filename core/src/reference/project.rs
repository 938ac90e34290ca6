//! Twin of the stage [`Project`](crate::stage::Project).

use glam::DVec3;

use super::closed::{emission_absorption, transmittance};
use super::lookup::{Samples, Steps, Tints, apply, phase, xyz};
use crate::stage::ProjectParams;

/// What the bindings of [`Project`](crate::stage::Project) hold.
#[derive(Clone, Copy, Debug)]
pub struct ProjectInputs<'a> {
    /// Density, x fastest.
    pub density: &'a [f32],
    /// Emission density, where it is not the density.
    pub emission: Option<&'a [f32]>,
    /// Emission density with a colour, in its place.
    pub emission_color: Option<&'a [[f32; 4]]>,
    /// Mean and maximum of each cell; none where every cell is projected.
    pub occupancy: Option<&'a [[f32; 2]]>,
    /// Unit directions.
    pub directions: &'a [[f32; 4]],
    /// W, laid out \[direction\]\[coefficient\]\[channel\].
    pub weights: &'a [f32],
    /// V, laid out \[direction\]\[coefficient\]; empty for none.
    pub emission_weights: &'a [f32],
    /// The phase function's table; empty for none.
    pub phase_table: &'a [f32],
}

/// What [`Project`](crate::stage::Project) writes: D, laid out \[cell\]\[coefficient\]\[channel\], and E, laid out
/// \[cell\]\[coefficient\]\[RGB\].
pub fn project(params: &ProjectParams, inputs: &ProjectInputs<'_>) -> (Vec<f64>, Vec<f64>) {
    let [nx, ny, nz, _] = params.cells;
    let (mut records, mut emission_records) = (Vec::new(), Vec::new());
    for cell in 0..nx * ny * nz {
        let at = [cell % nx, cell / nx % ny, cell / nx / ny];
        let center = DVec3::from([0, 1, 2].map(|a| (f64::from(at[a]) + 0.5) * f64::from(params.cell[a]) - 0.5));
        let (record, emission) = one(params, inputs, center);
        let empty = inputs.occupancy.is_some_and(|o| o[cell as usize][1] == 0.0);
        let keep = |v: f64| if empty { 0.0 } else { v };
        records.extend(record.into_iter().map(keep));
        emission_records.extend(emission.into_iter().map(keep));
    }
    (records, emission_records)
}

/// The record at a point of index space.
fn one(params: &ProjectParams, inputs: &ProjectInputs<'_>, center: DVec3) -> (Vec<f64>, Vec<f64>) {
    let channels = params.record_channels() as usize;
    let (coefficients, moments) = (params.coefficients as usize, params.emission_coefficients as usize);
    let weight_channels = params.weight_channels as usize;
    let extinction = |c: usize| f64::from(params.extinction[if params.channels == 3 { c } else { 0 }]);
    let density = Samples::new(inputs.density, params.dims);
    let emission = Tints::new(inputs.emission_color, inputs.emission.unwrap_or(inputs.density), params.dims);
    let view = apply([params.world_x, params.world_y, params.world_z], center - xyz(params.eye)).normalize_or_zero();
    let mut record = vec![0.0; coefficients * channels];
    let mut emitted = vec![0.0; moments * 3];
    for (i, &direction) in inputs.directions.iter().enumerate().take(params.direction_end as usize) {
        let direction = xyz(direction);
        let along = apply([params.index_x, params.index_y, params.index_z], direction);
        let steps = Steps::new(center, along, params.dims, f64::INFINITY, params.cell[3].into());
        let p = match params.toward_eye {
            1 => phase(params.phase_kind, params.phase, inputs.phase_table, direction.dot(view)),
            _ => 1.0,
        };
        let column = steps.column(density);
        for k in 0..coefficients {
            for c in 0..channels {
                let weight = inputs.weights[(i * coefficients + k) * weight_channels + c.min(weight_channels - 1)];
                record[k * channels + c] += transmittance(extinction(c) * column) * f64::from(weight) * p;
            }
        }
        if moments == 0 {
            continue;
        }
        for c in 0..3 {
            let (mut glow, mut column) = (0.0, 0.0);
            for step in 0..steps.count {
                let at = steps.middle(step).1;
                let here = density.trilinear(at);
                let source = emission.trilinear(at)[c] * f64::from(params.emission[c]);
                glow += transmittance(extinction(c) * column)
                    * emission_absorption(source, extinction(c) * here, steps.length);
                column += here * steps.length;
            }
            for k in 0..moments {
                emitted[k * 3 + c] += glow * f64::from(inputs.emission_weights[i * moments + k]) * p;
            }
        }
    }
    (record, emitted)
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;
    use crate::basis::healpix;

    /// In a homogeneous box each direction's transmittance and glow are closed forms of the way out.
    #[test]
    fn a_record_of_a_homogeneous_box_is_closed() {
        let (density, dims) = (1.5f32, [3u32, 2, 4, 0]);
        let edge = [0.2f64, 0.3, 0.1];
        let mut params = ProjectParams::zeroed();
        params.dims = dims;
        let row = |a: usize, v: f64| {
            let mut row = [0.0f32; 4];
            row[a] = v as f32;
            row
        };
        [params.index_x, params.index_y, params.index_z] = [0, 1, 2].map(|a| row(a, 1.0 / edge[a]));
        [params.world_x, params.world_y, params.world_z] = [0, 1, 2].map(|a| row(a, edge[a]));
        (params.cells, params.cell) = ([2, 1, 2, 0], [1.5, 2.0, 2.0, 0.01]);
        params.extinction = [2.0, 1.0, 0.5, 0.0];
        params.emission = [0.3, 0.2, 0.1, 0.0];
        (params.direction_end, params.coefficients, params.channels, params.weight_channels) = (48, 1, 3, 1);
        params.emission_coefficients = 1;
        let directions = healpix::directions(2);
        let inputs = ProjectInputs {
            density: &[density; 24],
            emission: None,
            emission_color: None,
            occupancy: None,
            directions: &directions.iter().map(|d| d.as_vec3().extend(0.0).to_array()).collect::<Vec<_>>(),
            weights: &[1.0; 48],
            emission_weights: &[1.0; 48],
            phase_table: &[],
        };
        let (records, glow) = project(&params, &inputs);
        for cell in 0..4usize {
            let center = DVec3::new(0.15 + 0.3 * (cell % 2) as f64, 0.3, 0.1 + 0.2 * (cell / 2) as f64);
            let size = DVec3::new(0.6, 0.6, 0.4);
            for c in 0..3 {
                let sigma = f64::from(density * params.extinction[c]);
                let (mut expected, mut expected_glow) = (0.0, 0.0);
                for d in &directions {
                    let out = (0..3).map(|a| if d[a] > 0.0 { (size[a] - center[a]) / d[a] } else { -center[a] / d[a] });
                    let way = out.filter(|t| t.is_finite()).fold(f64::INFINITY, f64::min);
                    expected += transmittance(sigma * way);
                    expected_glow += emission_absorption(f64::from(density * params.emission[c]), sigma, way);
                }
                // Parameters are rounded to f32.
                assert!((records[cell * 3 + c] / expected - 1.0).abs() < 1e-6, "{} {expected}", records[cell * 3 + c]);
                assert!((glow[cell * 3 + c] / expected_glow - 1.0).abs() < 1e-6, "{}", glow[cell * 3 + c]);
            }
        }
    }
}
