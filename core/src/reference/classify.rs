//! Twin of the stage [`Classify`](crate::stage::Classify).

use glam::DVec3;

use super::lookup::xyz;
use crate::stage::{ClassifyParams, ControlRecord, classify_kind};

/// What the bindings of [`Classify`](crate::stage::Classify) hold.
#[derive(Clone, Copy, Debug)]
pub struct ClassifyInputs<'a> {
    /// Values, x fastest.
    pub values: &'a [f32],
    /// Control points.
    pub points: &'a [ControlRecord],
}

/// What [`Classify`](crate::stage::Classify) writes.
pub fn classify(params: &ClassifyParams, inputs: &ClassifyInputs<'_>) -> Vec<f64> {
    let points = &inputs.points[..params.count as usize];
    inputs.values.iter().flat_map(|&value| voxel(params.dims[3], points, value.into())).collect()
}

fn voxel(kind: u32, points: &[ControlRecord], value: f64) -> Vec<f64> {
    let at = |p: &ControlRecord| f64::from(p.place[0]);
    let (first, last) = (&points[0], &points[points.len() - 1]);
    // Behind the last of those that share the value.
    let between = points.windows(2).rfind(|pair| at(&pair[0]) <= value && value < at(&pair[1]));
    let (a, b, f) = match between {
        Some(pair) => (&pair[0], &pair[1], (value - at(&pair[0])) / (at(&pair[1]) - at(&pair[0]))),
        None if value < at(first) => (first, first, 0.0),
        None => (last, last, 0.0),
    };
    let color = |of: fn(&ControlRecord) -> [f32; 4]| xyz(of(a)).lerp(xyz(of(b)), f);
    let density = f64::from(a.place[1]) * (1.0 - f) + f64::from(b.place[1]) * f;
    let (first, second) = (color(|p| p.first), color(|p| p.second));
    let found = match kind {
        classify_kind::DENSITY => return vec![density],
        classify_kind::REACH => return vec![first.max_element()],
        classify_kind::COLOR => first,
        classify_kind::SCATTERING => density * first,
        _ => density * first * second,
    };
    let DVec3 { x, y, z } = found;
    vec![x, y, z, 0.0]
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, UVec3, Vec3};

    use super::*;
    use crate::media::{Classified, ControlPoint, Grid, Medium, OpticsField, TransferFunction};

    /// The twin against what the medium itself says, which knows nothing of the stage.
    #[test]
    fn a_medium_s_fields_are_the_twin_s() {
        let dims = UVec3::new(5, 4, 3);
        let values: Vec<f32> = (0..60).map(|n| 37.0 * n as f32 - 1100.0).collect();
        let point = |value, density, c| ControlPoint {
            value,
            density,
            albedo: Vec3::new(c, 0.5, 1.0),
            emission: Vec3::new(0.0, c, 2.0 * c),
            tint: Vec3::new(1.0, c, 1.0 - c),
        };
        let points =
            vec![point(-900.0, 0.1, 0.3), point(-101.0, 2.0, 0.9), point(-101.0, 0.0, 0.0), point(800.0, 3.0, 1.0)];
        let function = TransferFunction::new(points).unwrap();
        let grid = Grid::dense(dims, DAffine3::IDENTITY, values.clone()).unwrap();
        let medium = Classified::new(grid.into(), function.clone()).unwrap();
        let twin = |kind| {
            let points = ControlRecord::of(&function, kind);
            let params = ClassifyParams::new(dims.to_array(), kind, points.len() as u32);
            classify(&params, &ClassifyInputs { values: &values, points: &points })
        };
        let agree = |kind, size: usize, slice: &dyn Fn(u32, &mut [f32])| {
            let found = twin(kind);
            assert_eq!(found.len(), 60 * size);
            for k in 0..3 {
                let mut expected = vec![9.0; 20 * size];
                slice(k, &mut expected);
                for (n, (found, expected)) in found[k as usize * 20 * size..].iter().zip(expected).enumerate() {
                    assert!((found - f64::from(expected)).abs() < 1e-5, "{n} of {k}: {found} {expected}");
                }
            }
        };
        let fields = medium.optics_fields();
        let field = |kind, size, field: Option<OpticsField<'_>>| {
            let field = field.unwrap();
            agree(kind, size, &|k, out: &mut [f32]| field.slice(k, out));
        };
        agree(classify_kind::DENSITY, 1, &|k, out: &mut [f32]| medium.density_slice(k, out));
        field(classify_kind::REACH, 1, fields.emission);
        field(classify_kind::COLOR, 4, fields.emission_color);
        field(classify_kind::SCATTERING, 4, fields.scattering);
        field(classify_kind::SEEN, 4, fields.seen);
    }
}
