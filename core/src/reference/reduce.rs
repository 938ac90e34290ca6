//! Twin of the stage [`Reduce`].

use glam::DVec3;

use super::lookup::Samples;
use crate::stage::{Reduce, ReduceParams};

/// What the bindings of [`Reduce`] hold.
#[derive(Clone, Copy, Debug)]
pub struct ReduceInputs<'a> {
    /// The field, x fastest.
    pub density: &'a [f32],
    /// The second field that counts toward the maximum.
    pub other: Option<&'a [f32]>,
}

/// What [`Reduce`] writes: mean and maximum of each coarse cell.
pub fn reduce(params: &ReduceParams, inputs: &ReduceInputs<'_>) -> Vec<f64> {
    let [nx, ny, nz, _] = params.coarse;
    let mut out = Vec::new();
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                let cell = [x, y, z].map(f64::from);
                out.push(mean(params, inputs.density, cell));
                let fields = [Some(inputs.density), inputs.other];
                out.push(fields.into_iter().flatten().map(|f| maximum(params, f, cell)).fold(0.0, f64::max));
            }
        }
    }
    out
}

/// Every voxel with its value.
fn voxels<'a>(params: &ReduceParams, field: &'a [f32]) -> impl Iterator<Item = ([f64; 3], f64)> + use<'a> {
    let [nx, ny, _, _] = params.dims.map(|n| n as usize);
    field.iter().enumerate().map(move |(n, &v)| ([n % nx, n / nx % ny, n / nx / ny].map(|i| i as f64), v.into()))
}

fn mean(params: &ReduceParams, field: &[f32], cell: [f64; 3]) -> f64 {
    let (mut sum, mut volume) = (0.0, 0.0);
    for (voxel, value) in voxels(params, field) {
        let common: f64 = (0..3)
            .map(|a| {
                let side = f64::from(params.cell[a]);
                let (from, to) = (cell[a] * side - 0.5, (cell[a] + 1.0) * side - 0.5);
                (to.min(voxel[a] + 0.5) - from.max(voxel[a] - 0.5)).max(0.0)
            })
            .product();
        sum += common * value;
        volume += common;
    }
    if volume > 0.0 { sum / volume } else { 0.0 }
}

fn maximum(params: &ReduceParams, field: &[f32], cell: [f64; 3]) -> f64 {
    if params.coarse[3] > 0 {
        return probes(params, field, cell);
    }
    let reached = |voxel: [f64; 3]| {
        (0..3).all(|a| {
            let side = f64::from(params.cell[a]);
            let margin = f64::from(params.cell[3]) * side + f64::from(Reduce::SLACK);
            let last = f64::from(params.dims[a] - 1);
            // A lookup beyond the outermost voxels is one at them.
            let from = (cell[a] * side - 0.5 - margin).clamp(0.0, last);
            let to = ((cell[a] + 1.0) * side - 0.5 + margin).clamp(0.0, last);
            voxel[a] > from - 1.0 && voxel[a] < to + 1.0
        })
    };
    voxels(params, field).filter(|(voxel, _)| reached(*voxel)).map(|(_, v)| v).fold(0.0, f64::max)
}

fn probes(params: &ReduceParams, field: &[f32], cell: [f64; 3]) -> f64 {
    let samples = Samples::new(field, params.dims);
    let n = params.coarse[3];
    let place = |a: usize, i: u32| (cell[a] + (f64::from(i) + 0.5) / f64::from(n)) * f64::from(params.cell[a]) - 0.5;
    let mut max = 0.0f64;
    for k in 0..n {
        for j in 0..n {
            for i in 0..n {
                max = max.max(samples.trilinear(DVec3::new(place(0, i), place(1, j), place(2, k))));
            }
        }
    }
    max
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field() -> (ReduceParams, Vec<f32>) {
        let dims = [7, 5, 9, 0];
        let values = (0..315).map(|i| if i % 11 == 3 { 0.0 } else { (0.3 * f64::from(i)).sin().abs() as f32 });
        let side = |a: usize, cells: u32| dims[a] as f32 / cells as f32;
        let params = ReduceParams::new(dims, [3, 2, 4, 0], [side(0, 3), side(1, 2), side(2, 4), 0.0]);
        (params, values.collect())
    }

    #[test]
    fn mass_is_kept() {
        let (params, field) = field();
        let reduced = reduce(&params, &ReduceInputs { density: &field, other: None });
        let volume: f64 = params.cell[..3].iter().map(|&s| f64::from(s)).product();
        let mass: f64 = reduced.iter().step_by(2).map(|mean| mean * volume).sum();
        let expected: f64 = field.iter().map(|&v| f64::from(v)).sum();
        // The cells' sides are rounded to f32.
        assert!((mass / expected - 1.0).abs() < 1e-6, "{mass} {expected}");
    }

    #[test]
    fn no_lookup_in_a_cell_exceeds_its_maximum() {
        let (params, field) = field();
        let reduced = reduce(&params, &ReduceInputs { density: &field, other: None });
        let probed = ReduceParams { coarse: [3, 2, 4, 5], ..params };
        let probed = reduce(&probed, &ReduceInputs { density: &field, other: None });
        for (exact, probe) in reduced.chunks(2).zip(probed.chunks(2)) {
            assert!(exact[1] >= probe[1] && probe[1] > 0.0, "{exact:?} {probe:?}");
        }
        let mut lone = vec![0.0; 315];
        lone[0] = 1.0;
        let reduced = reduce(&params, &ReduceInputs { density: &lone, other: None });
        let touched: Vec<_> = (0..24).filter(|&c| reduced[2 * c + 1] > 0.0).collect();
        assert_eq!(touched, [0], "the first voxel is seen from no other cell");
        let wide = ReduceParams { cell: [params.cell[0], params.cell[1], params.cell[2], 1.0], ..params };
        let reduced = reduce(&wide, &ReduceInputs { density: &lone, other: None });
        let touched: Vec<_> = (0..24).filter(|&c| reduced[2 * c + 1] > 0.0).collect();
        assert_eq!(touched, [0, 1, 3, 4, 6, 7, 9, 10], "a margin of one cell reaches the neighbours");
    }
}
