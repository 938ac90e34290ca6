//! Twin of the stage [`Illuminate`](crate::stage::Illuminate).

use glam::DVec3;

use super::closed::transmittance;
use super::lookup::{Samples, Steps, apply, xyz};
use super::march::incident;
use super::mesh::nearest;
use crate::basis::{Basis, SphericalHarmonics};
use crate::stage::{IlluminateParams, LightRecord, MeshRecord};

/// What the bindings of [`Illuminate`](crate::stage::Illuminate) hold.
#[derive(Clone, Copy, Debug)]
pub struct IlluminateInputs<'a> {
    /// Density, x fastest.
    pub density: &'a [f32],
    /// Lights, from the box's centre.
    pub lights: &'a [LightRecord],
    /// Boxes, which are not read, and triangles.
    pub mesh: &'a [MeshRecord],
}

/// What [`Illuminate`](crate::stage::Illuminate) writes, laid out \[coefficient\]\[channel\]\[cell\].
///
/// # Panics
/// Where the bands are none that [`SphericalHarmonics`] has.
pub fn illuminate(params: &IlluminateParams, inputs: &IlluminateInputs<'_>) -> Vec<f64> {
    let basis = SphericalHarmonics::new(params.bands).expect("validated with the stage");
    let [nx, ny, nz, _] = params.cells;
    let (count, channels) = ((nx * ny * nz) as usize, params.channels as usize);
    let mut out = vec![0.0; basis.count() * channels * count];
    let mut values = vec![0.0; basis.count()];
    for cell in 0..count {
        let n = cell as u32;
        let index =
            (DVec3::new((n % nx).into(), (n / nx % ny).into(), (n / nx / ny).into()) + 0.5) * xyz(params.cell) - 0.5;
        for light in inputs.lights.iter().take(params.lights as usize) {
            let (toward, arriving) = arriving(params, inputs, light, index);
            basis.eval(toward, &mut values);
            for (k, value) in values.iter().enumerate() {
                for c in 0..channels {
                    out[(k * channels + c) * count + cell] += arriving[c] * value;
                }
            }
        }
    }
    out
}

/// Direction of a light at a place of index space, and what it brings there.
fn arriving(
    params: &IlluminateParams,
    inputs: &IlluminateInputs<'_>,
    light: &LightRecord,
    index: DVec3,
) -> (DVec3, DVec3) {
    let middle = (DVec3::from([0, 1, 2].map(|a| f64::from(params.dims[a]))) - 1.0) / 2.0;
    let place = apply([params.world_x, params.world_y, params.world_z], index - middle);
    let (toward, distance, falloff) = incident(light, params.light_floor, place.length(), place.normalize_or_zero());
    if params.visibility == 1 {
        let margin = f64::from(MeshRecord::MARGIN) * f64::from(params.mesh_eye[3]);
        let range = [0.0, distance - margin];
        if nearest(inputs.mesh, params.nodes, place + xyz(params.mesh_eye), toward, range).is_some() {
            return (toward, DVec3::ZERO);
        }
    }
    let direction = apply([params.index_x, params.index_y, params.index_z], toward);
    let way = Steps::new(index, direction, params.dims, distance, params.cell[3].into());
    let column = way.column(Samples::new(inputs.density, params.dims));
    let through = DVec3::from((xyz(params.extinction) * column).to_array().map(transmittance));
    (toward, falloff * xyz(light.power) * through)
}
