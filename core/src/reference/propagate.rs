//! Twin of the stage [`Propagate`](crate::stage::Propagate): each scheme by recursion from its definition, without any
//! order of cells.

use glam::DVec3;

use super::lookup::{Samples, Steps, apply, xyz};
use crate::stage::propagate::scheme;
use crate::stage::{LightPlace, PropagateParams};

/// What the bindings of [`Propagate`](crate::stage::Propagate) hold, without the order of cells.
#[derive(Clone, Copy, Debug)]
pub struct PropagateInputs<'a> {
    /// Density, x fastest.
    pub density: &'a [f32],
    /// Mean and maximum of each cell; empty where the scheme does not gather.
    pub occupancy: &'a [[f32; 2]],
    /// Where the lights are.
    pub lights: &'a [LightPlace],
}

/// What [`Propagate`](crate::stage::Propagate) writes, laid out \[cell\]\[layer\]\[RGBA\].
pub fn propagate(params: &PropagateParams, inputs: &PropagateInputs<'_>) -> Vec<f64> {
    let [nx, ny, nz, layers] = params.cells.map(i64::from);
    let lanes = 4 * layers as usize;
    let mut out = vec![0.0; (nx * ny * nz) as usize * lanes];
    for (lane, light) in inputs.lights.iter().take(params.lights as usize).enumerate() {
        let mut way = Way { params, inputs, light, known: vec![None; (nx * ny * nz) as usize] };
        for cell in 0..nx * ny * nz {
            let at = [cell % nx, cell / nx % ny, cell / nx / ny];
            out[cell as usize * lanes + lane] = way.value(at);
        }
    }
    out
}

/// The way to one light.
struct Way<'a> {
    params: &'a PropagateParams,
    inputs: &'a PropagateInputs<'a>,
    light: &'a LightPlace,
    /// Values that are known already.
    known: Vec<Option<f64>>,
}

impl Way<'_> {
    fn inside(&self, at: [i64; 3]) -> bool {
        (0..3).all(|a| (0..i64::from(self.params.cells[a])).contains(&at[a]))
    }

    fn index(&self, [x, y, z]: [i64; 3]) -> usize {
        let [nx, ny, _, _] = self.params.cells.map(i64::from);
        ((z * ny + y) * nx + x) as usize
    }

    /// The value of a cell of the grid.
    fn value(&mut self, at: [i64; 3]) -> f64 {
        let index = self.index(at);
        if let Some(value) = self.known[index] {
            return value;
        }
        let toward = if self.is_far() { xyz(self.light.place) } else { self.way(at) };
        let value = match self.params.scheme {
            scheme::SHORT_CHARACTERISTICS => self.mean(at, toward),
            _ => self.column(at, toward),
        };
        self.known[index] = Some(value);
        value
    }

    /// Whether the light is directional.
    fn is_far(&self) -> bool {
        self.light.place[3] == 0.0
    }

    /// u of a cell, for a light that has a place.
    fn way(&self, at: [i64; 3]) -> DVec3 {
        xyz(self.light.place) - DVec3::from(at.map(|x| x as f64))
    }

    /// Metres of a way in cell units.
    fn metres(&self, u: DVec3) -> f64 {
        let p = self.params;
        apply([p.world_x, p.world_y, p.world_z], u * xyz(p.cell)).length()
    }

    /// The schemes that gather.
    fn column(&mut self, at: [i64; 3], u: DVec3) -> f64 {
        let local = f64::from(self.inputs.occupancy[self.index(at)][0]);
        let edges = [DVec3::X, DVec3::Y, DVec3::Z].map(|e| self.metres(e));
        let hops = u.abs().element_sum();
        let published = self.params.scheme == scheme::PUBLISHED;
        if hops == 0.0 {
            return if published { local * edges.iter().sum::<f64>() / 3.0 } else { 0.0 };
        }
        let length = if published { (0..3).map(|a| u[a].abs() * edges[a]).sum::<f64>() } else { self.metres(u) } / hops;
        let mut gathered = 0.0;
        for a in 0..3 {
            let mut next = at;
            next[a] += u[a].signum() as i64;
            if u[a] != 0.0 && self.inside(next) {
                gathered += u[a].abs() * self.value(next);
            }
        }
        local * length + gathered / hops
    }

    /// Short characteristics.
    fn mean(&mut self, at: [i64; 3], u: DVec3) -> f64 {
        let p = self.params;
        let side = xyz(p.cell);
        let center = (DVec3::from(at.map(|x| x as f64)) + 0.5) * side - 0.5;
        let density = Samples::new(self.inputs.density, p.dims);
        let metres = self.metres(u);
        if metres == 0.0 {
            return density.trilinear(center);
        }
        let toward = u * side / metres;
        let steps = |limit: f64| Steps::new(center, toward, p.dims, limit, p.cell[3].into());
        let all = steps(if self.is_far() { f64::INFINITY } else { metres });
        let length = all.length * all.count as f64;
        let longest = u.abs().max_element();
        if !self.is_far() && longest < 1.0 {
            return all.column(density) / length;
        }
        let axis = (0..3).find(|&a| u[a].abs() == longest).unwrap_or(0);
        let piece = steps(metres / longest);
        let rest = length - piece.length * piece.count as f64;
        let beyond = if rest > 0.0 { self.interpolated(at, axis, u) } else { 0.0 };
        (piece.column(density) + beyond * rest) / length
    }

    /// Where the way meets the next plane of centres along `axis`, interpolated.
    fn interpolated(&mut self, at: [i64; 3], axis: usize, u: DVec3) -> f64 {
        let longest = u[axis].abs();
        let nodes = [0, 1, 2].map(|a| if a == axis { vec![(1, 1.0)] } else { self.nodes(at, a, u, longest) });
        let mut sum = 0.0;
        for &(x, wx) in &nodes[0] {
            for &(y, wy) in &nodes[1] {
                for &(z, wz) in &nodes[2] {
                    let hops = [x, y, z];
                    let cell = [0, 1, 2].map(|a| at[a] + if u[a] < 0.0 { -hops[a] } else { hops[a] });
                    let weight = wx * wy * wz;
                    if weight != 0.0 && self.inside(cell) {
                        sum += weight * self.value(cell);
                    }
                }
            }
        }
        sum.max(0.0)
    }

    /// Along an axis: the cells that are interpolated between, in hops toward the light, with their weights.
    fn nodes(&self, at: [i64; 3], a: usize, u: DVec3, longest: f64) -> Vec<(i64, f64)> {
        let f = u[a].abs() / longest;
        let inside = |hops: i64| {
            let mut cell = at;
            cell[a] += if u[a] < 0.0 { -hops } else { hops };
            self.inside(cell)
        };
        if !inside(1) {
            return vec![(0, 1.0)];
        }
        let nearer = |hops: i64| self.is_far() || (u[a].abs() - hops as f64).abs() < longest;
        let hops: Vec<i64> =
            [-1, 0, 1, 2].into_iter().filter(|&k| [0, 1].contains(&k) || inside(k) && nearer(k)).collect();
        // Lagrange's polynomials.
        let weight = |k: i64| {
            let others = hops.iter().filter(|&&j| j != k);
            others.map(|&j| (f - j as f64) / (k - j) as f64).product()
        };
        hops.iter().map(|&k| (k, weight(k))).collect()
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DMat3, UVec3, Vec3};

    use super::*;
    use crate::light::Light;
    use crate::media::Lattice;
    use crate::reference::closed::gaussian_column;
    use crate::stage::GridParams;
    use crate::stage::propagate::{faces, scheme};

    const DIMS: UVec3 = UVec3::new(10, 6, 13);

    /// Voxels of 0.1, 0.12 and 0.08 m.
    fn lattice(sheared: bool) -> Lattice {
        let edges = DMat3::from_diagonal(DVec3::new(0.1, 0.12, 0.08));
        let shear = DMat3::from_cols(DVec3::X, DVec3::new(0.35, 1.0, 0.1), DVec3::new(-0.2, 0.25, 1.0));
        let linear = if sheared { shear * edges } else { edges };
        Lattice::new(DIMS, DAffine3::from_mat3_translation(linear, DVec3::new(0.4, -1.0, 2.0))).unwrap()
    }

    fn params(lattice: &Lattice, cells: [u32; 3], lights: u32, scheme: u32) -> PropagateParams {
        let grid = GridParams::new(lattice);
        let side = |a: usize| grid.dims[a] as f32 / cells[a] as f32;
        PropagateParams {
            dims: grid.dims,
            world_x: grid.world[0],
            world_y: grid.world[1],
            world_z: grid.world[2],
            cells: [cells[0], cells[1], cells[2], lights.div_ceil(4)],
            cell: [side(0), side(1), side(2), 0.04],
            lights,
            steps: 0,
            scheme,
            items: 0,
        }
    }

    fn lights() -> Vec<Light> {
        let point = |x, y, z| Light::point(DVec3::new(x, y, z), Vec3::ONE).unwrap();
        let sun = |x, y, z| Light::directional(DVec3::new(x, y, z), Vec3::ONE).unwrap();
        vec![
            point(0.813, -0.7, 2.41),
            point(-3.0, 0.2, 2.2),
            point(0.36, -1.05, 1.97),
            sun(0.3, -0.8, 0.5),
            sun(0.0, 1.0, 0.0),
        ]
    }

    #[test]
    fn a_homogeneous_box_has_its_density_everywhere() {
        for sheared in [false, true] {
            let lattice = lattice(sheared);
            let cells = [7, 5, 9];
            let places: Vec<_> = lights().iter().map(|l| LightPlace::new(l, &lattice, cells, 0)).collect();
            let params = params(&lattice, cells, 5, scheme::SHORT_CHARACTERISTICS);
            let density = vec![1.5; DIMS.element_product() as usize];
            let found = propagate(&params, &PropagateInputs { density: &density, occupancy: &[], lights: &places });
            for value in found.chunks_exact(8).flat_map(|cell| &cell[..5]) {
                // Sums of products with weights that add up to 1.
                assert!((value - 1.5).abs() < 1e-12, "{value}");
            }
            assert!(!faces(&places, cells).is_empty());
        }
    }

    /// Along an axis the schemes that gather are sums over the cells passed.
    #[test]
    fn gathering_along_an_axis_adds_up_cells() {
        let lattice = lattice(false);
        let cells = [5, 3, 4];
        let light = [Light::directional(DVec3::NEG_Y, Vec3::ONE).unwrap()];
        let reduced: Vec<[f32; 2]> = (0..60).map(|i| [1.0 + i as f32, 0.0]).collect();
        for number in [scheme::METRIC, scheme::PUBLISHED] {
            let places = light.map(|l| LightPlace::new(&l, &lattice, cells, number));
            let params = params(&lattice, cells, 1, number);
            let inputs = PropagateInputs { density: &[], occupancy: &reduced, lights: &places };
            let found = propagate(&params, &inputs);
            for cell in 0..60 {
                let (x, y, z) = (cell % 5, cell / 5 % 3, cell / 15);
                let sum: f64 = (0..=y).map(|j| f64::from(reduced[(z * 3 + j) * 5 + x][0])).sum();
                // Cells of 0.24 m; parameters are rounded to f32.
                assert!((found[4 * cell] / (0.24 * sum) - 1.0).abs() < 1e-6, "{number} {cell}");
            }
        }
    }

    /// Against the closed form of a sum of Gaussians: the errors that each scheme is known for.
    #[test]
    fn schemes_err_as_they_are_known_to() {
        let dims = UVec3::new(30, 24, 36);
        let (min, max) = (DVec3::ZERO, DVec3::new(1.0, 0.8, 1.2));
        let lattice = Lattice::in_box(dims, min, max).unwrap();
        let blobs: Vec<(f64, f64, DVec3)> = (0..12)
            .map(|i| {
                let i = f64::from(i);
                let wave = |f: f64| 0.5 + 0.3 * (f * (i + 1.0)).sin();
                (0.5 + wave(3.7), 5.0 + 4.0 * wave(5.1), max * DVec3::new(wave(0.9), wave(1.7), wave(2.3)))
            })
            .collect();
        let beta =
            |x: DVec3| -> f64 { blobs.iter().map(|&(c, a, b)| c * (-(a * a) * x.distance_squared(b)).exp()).sum() };
        let to_world = lattice.index_to_world();
        let density: Vec<f32> = (0..dims.element_product())
            .map(|n| UVec3::new(n % dims.x, n / dims.x % dims.y, n / dims.x / dims.y))
            .map(|at| beta(to_world.transform_point3(at.as_dvec3())) as f32)
            .collect();
        let reduced: Vec<[f32; 2]> = density.iter().map(|&v| [v, v]).collect();
        // Within the medium, at a cell's centre, where all schemes have the same light.
        let s = to_world.transform_point3(DVec3::new(11.0, 13.0, 9.0));
        let light = Light::point(s, Vec3::ONE).unwrap();
        let error = |number: u32| {
            let places = [LightPlace::new(&light, &lattice, dims.to_array(), number)];
            let mut params = params(&lattice, dims.to_array(), 1, number);
            params.cell[3] = 1.0 / 30.0;
            let found =
                propagate(&params, &PropagateInputs { density: &density, occupancy: &reduced, lights: &places });
            let (mut off, mut all, mut sum) = (0.0, 0.0, 0.0);
            for (n, value) in (0..).zip(found.chunks_exact(4)) {
                let at = UVec3::new(n % dims.x, n / dims.x % dims.y, n / dims.x / dims.y);
                let x = to_world.transform_point3(at.as_dvec3());
                let exact: f64 = blobs.iter().map(|&(c, a, b)| gaussian_column(c, a, b, x, s)).sum();
                let column = if number == scheme::SHORT_CHARACTERISTICS { value[0] * x.distance(s) } else { value[0] };
                off += (column - exact).powi(2);
                all += exact * exact;
                sum += column / exact.max(1e-9) * exact * exact;
            }
            ((off / all).sqrt(), sum / all)
        };
        let [(short, _), (metric, _), (published, ratio)] =
            [scheme::SHORT_CHARACTERISTICS, scheme::METRIC, scheme::PUBLISHED].map(error);
        eprintln!("{short} {metric} {published} {ratio}");
        assert!(short < 0.01, "{short}");
        assert!((0.03..0.15).contains(&metric), "{metric}");
        assert!((0.4..0.7).contains(&published) && ratio > 1.3, "{published} {ratio}");
    }
}
