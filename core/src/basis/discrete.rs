//! Discrete spherical functions: weights of interpolation between evenly spread directions (Zhang, Dong and Ma 2013,
//! section 5, equations 7 and 8).
//!
//! The directions ω_k are the vertices of a subdivided icosahedron, h is the least angle between two of them, and
//!
//! ```text
//! W(θ) = (h² - θ²)³   for θ < h, else 0,        w̄_k(ω) = W(∠(ω, ω_k)) / Σ_i W(∠(ω, ω_i)).
//! ```
//!
//! The functions are at least 0, sum to 1 everywhere, and w̄_k(ω_j) = δ_jk; so Σ s_k w̄_k takes the value s_k at ω_k and
//! stays between the least and the largest s. (The paper's W(0) = 1 holds once it is normalised.) Every direction is
//! nearer than h to a vertex: the triangles' circumradii are at most 0.78 h. So there is no place where all weights
//! vanish. What is nearer than h to a direction are corners of the triangle that holds it or lies right beyond one of
//! its edges: six candidates, of which 3.1 count in the mean. Tests hold both for every triangle.
//!
//! A_k = ∫ w̄_k dω and the Gram matrix ∫ w̄_j w̄_k dω come from Gauss–Legendre quadrature within every triangle.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::fmt;
use std::sync::{Arc, OnceLock};

use glam::DVec3;

use super::icosphere::{self, Icosphere, Place};
use super::quadrature::gauss_legendre;
use super::{Basis, BasisError};

/// Nodes along each of the two axes of a triangle. W's third derivative jumps at h, which leaves 10⁻⁶ of an area.
const NODES: usize = 32;

/// Discrete spherical functions of a number of directions. Copies share their tables, which are made once.
#[derive(Clone)]
pub struct DiscreteSpherical {
    tables: Arc<Tables>,
}

struct Tables {
    sphere: Icosphere,
    /// Vertices that may be nearer than the radius to a direction in each triangle.
    near: Vec<[u32; 6]>,
    /// h, radians.
    radius: f64,
    /// Of (θ/h)² by powers of q = |ω - ω_k|² = 4 sin²(θ/2), from the first: 2/(n² C(2n, n)) h⁻², as far as f64 sees them
    /// below h.
    series: Vec<f64>,
    /// A_k, sr.
    areas: Vec<f64>,
    /// ∫ w̄_j w̄_k dω between the candidates of each triangle of the first face of the icosahedron. Rotations take them
    /// to those of the other faces, in their order.
    gram: Vec<[[f64; 6]; 6]>,
}

impl fmt::Debug for DiscreteSpherical {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("DiscreteSpherical").field("functions", &self.count()).finish()
    }
}

impl DiscreteSpherical {
    /// Numbers of functions that there are: vertices of an icosahedron and its subdivisions.
    pub const FUNCTIONS: [u32; 5] = [12, 42, 162, 642, 2562];

    /// The basis of so many functions.
    ///
    /// # Errors
    /// [`BasisError::Functions`] unless it is one of [`FUNCTIONS`](Self::FUNCTIONS).
    pub fn new(functions: u32) -> Result<Self, BasisError> {
        static MADE: [OnceLock<Arc<Tables>>; DiscreteSpherical::FUNCTIONS.len()] =
            [const { OnceLock::new() }; DiscreteSpherical::FUNCTIONS.len()];
        let level = Self::FUNCTIONS
            .iter()
            .position(|&n| n == functions)
            .ok_or(BasisError::Functions { functions, known: &Self::FUNCTIONS })?;
        Ok(Self { tables: MADE[level].get_or_init(|| Arc::new(Tables::new(level as u32, NODES))).clone() })
    }

    /// The directions ω_k, unit vectors.
    pub fn directions(&self) -> &[DVec3] {
        &self.tables.sphere.vertices
    }

    /// h: the least angle between two directions, and how far a function reaches, radians.
    pub fn radius(&self) -> f64 {
        self.tables.radius
    }

    /// The coefficients F whose Σ F_k w̄_k has the least mean square error among all: the solution of
    /// Σ_k ∫ w̄_j w̄_k dω F_k = moment j. By conjugate gradients, to rounding. They may be negative, and overshoot.
    ///
    /// # Errors
    /// [`BasisError::Length`] where there are not as many moments as functions.
    pub fn least_squares(&self, moments: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, BasisError> {
        self.check(moments.len())?;
        let mut coefficients = vec![[0.0; 3]; moments.len()];
        for channel in 0..3 {
            let right: Vec<f64> = moments.iter().map(|m| m[channel]).collect();
            let solved = self.tables.solve(&right);
            coefficients.iter_mut().zip(solved).for_each(|(c, v)| c[channel] = v);
        }
        Ok(coefficients)
    }

    /// Largest deviation of Σ_i w_i w̄_j(d_i) w̄_k(d_i) from ∫ w̄_j w̄_k dω, as a share of the largest of those integrals: how
    /// badly a direction set resolves the functions. Pairs beyond the shorter of the two slices are left out.
    pub fn gram_error(&self, directions: &[DVec3], weights: &[f64]) -> f64 {
        let t = &*self.tables;
        let mut off: HashMap<[u32; 2], f64> = HashMap::new();
        let mut add = |near: [u32; 6], values: [[f64; 6]; 6], sign: f64| {
            for (&j, row) in near.iter().zip(values) {
                near.iter().zip(row).for_each(|(&k, v)| *off.entry([j, k]).or_default() += sign * v);
            }
        };
        for (&d, &w) in directions.iter().zip(weights) {
            let Place { triangle, .. } = t.sphere.locate(d);
            let values = t.weights(triangle, d);
            add(t.near[triangle], values.map(|a| values.map(|b| w * a * b)), 1.0);
        }
        for (&near, &gram) in t.near.iter().zip(t.gram.iter().cycle()) {
            add(near, gram, -1.0);
        }
        let mut squares = vec![0.0; self.count()];
        for (near, gram) in t.near.iter().zip(t.gram.iter().cycle()) {
            (0..6).for_each(|j| squares[near[j] as usize] += gram[j][j]);
        }
        let largest = squares.into_iter().fold(0.0, f64::max);
        off.into_values().fold(0.0, |m: f64, v| m.max(v.abs())) / largest
    }

    fn check(&self, found: usize) -> Result<(), BasisError> {
        let expected = self.count();
        if found == expected { Ok(()) } else { Err(BasisError::Length { expected, found }) }
    }
}

impl Basis for DiscreteSpherical {
    fn name(&self) -> String {
        format!("{} discrete spherical functions", self.count())
    }

    fn count(&self) -> usize {
        self.directions().len()
    }

    fn eval(&self, d: DVec3, out: &mut [f64]) {
        out[..self.count()].fill(0.0);
        self.each(d, &mut |k, v| out[k] = v);
    }

    fn each(&self, d: DVec3, visit: &mut dyn FnMut(usize, f64)) {
        let t = &*self.tables;
        let Place { triangle, .. } = t.sphere.locate(d);
        let weights = t.weights(triangle, d);
        for (k, w) in t.near[triangle].into_iter().zip(weights) {
            if w > 0.0 {
                visit(k as usize, w);
            }
        }
    }

    fn integrals(&self) -> Vec<f64> {
        self.tables.areas.clone()
    }

    /// Moments divided by A_k: the mean of the light as each function weighs it, so that Σ F_k A_k = ∫ L dω and nothing
    /// goes below zero or above the light.
    fn coefficients(&self, moments: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, BasisError> {
        self.check(moments.len())?;
        Ok(moments.iter().zip(&self.tables.areas).map(|(m, a)| m.map(|v| v / a)).collect())
    }

    /// Barycentric weights of the triangle that holds `d`, divided by A_k (the paper's section 8.2, with the irradiance
    /// kept).
    fn directional(&self, d: DVec3) -> Vec<f64> {
        let t = &*self.tables;
        let Place { triangle, weights } = t.sphere.locate(d);
        let mut coefficients = vec![0.0; self.count()];
        for (&k, w) in t.near[triangle].iter().zip(weights) {
            coefficients[k as usize] = w / t.areas[k as usize];
        }
        coefficients
    }
}

impl Tables {
    fn new(level: u32, nodes: usize) -> Self {
        let sphere = Icosphere::new(level);
        let near = sphere.neighbourhoods();
        let angle = |i: u32, j: u32| sphere.vertices[i as usize].angle_between(sphere.vertices[j as usize]);
        let sides = |[a, b, c]: [u32; 3]| [angle(a, b), angle(b, c), angle(c, a)];
        let radius = sphere.triangles().flat_map(sides).fold(f64::INFINITY, f64::min);
        let count = icosphere::count(level);
        let mut tables =
            Self { sphere, near, radius, series: series(radius), areas: vec![0.0; count], gram: Vec::new() };
        tables.integrate(nodes);
        tables
    }

    /// w̄ of a triangle's candidates at `d`, which it holds.
    fn weights(&self, triangle: usize, d: DVec3) -> [f64; 6] {
        let q = self.near[triangle].map(|k| self.sphere.vertices[k as usize].distance_squared(d));
        let mut squares = [0.0; 6];
        for term in self.series.iter().rev() {
            (0..6).for_each(|i| squares[i] = (squares[i] + term) * q[i]);
        }
        let weights = squares.map(kernel);
        let sum: f64 = weights.iter().sum();
        weights.map(|w| w / sum)
    }

    /// Over each triangle, on the plane through its corners: a direction p/|p| takes det(a, b, c)/|p|³ of solid angle
    /// for each unit of the coordinates.
    fn integrate(&mut self, nodes: usize) {
        let rule: Vec<_> = gauss_legendre(nodes).into_iter().map(|(x, w)| (0.5 + 0.5 * x, 0.5 * w)).collect();
        let mut grams = vec![[[0.0; 6]; 6]; self.near.len() / 20];
        for (triangle, gram) in grams.iter_mut().enumerate() {
            let near = self.near[triangle];
            let [a, b, c] = [near[0], near[1], near[2]].map(|v| self.sphere.vertices[v as usize]);
            let det = a.cross(b).dot(c);
            for &(x, u) in &rule {
                for &(y, v) in &rule {
                    let p = a * (1.0 - x) + (b * (1.0 - y) + c * y) * x;
                    let length = p.length();
                    let weight = u * v * x * det / length.powi(3);
                    let values = self.weights(triangle, p / length);
                    for j in 0..6 {
                        (0..6).for_each(|k| gram[j][k] += weight * values[j] * values[k]);
                    }
                }
            }
        }
        // What the rule leaves of the sphere's area is some roundings.
        let whole = 4.0 * PI / (20.0 * grams.as_flattened().as_flattened().iter().sum::<f64>());
        grams.as_flattened_mut().as_flattened_mut().iter_mut().for_each(|g| *g *= whole);
        self.gram = grams;
        // The functions sum to 1.
        self.areas = self.product(&vec![1.0; self.areas.len()]);
    }

    /// The Gram matrix times `x`.
    fn product(&self, x: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; x.len()];
        for (near, gram) in self.near.iter().zip(self.gram.iter().cycle()) {
            let local = near.map(|k| x[k as usize]);
            for (&j, row) in near.iter().zip(gram) {
                out[j as usize] += row.iter().zip(local).map(|(g, v)| g * v).sum::<f64>();
            }
        }
        out
    }

    /// Conjugate gradients.
    fn solve(&self, right: &[f64]) -> Vec<f64> {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut x = vec![0.0; right.len()];
        let mut rest = right.to_vec();
        let mut along = rest.clone();
        let mut square = dot(&rest, &rest);
        let enough = 1e-28 * square;
        // The matrix is well-conditioned; about thirty steps do.
        for _ in 0..right.len() {
            if square <= enough {
                break;
            }
            let turned = self.product(&along);
            let step = square / dot(&along, &turned);
            x.iter_mut().zip(&along).for_each(|(x, a)| *x += step * a);
            rest.iter_mut().zip(&turned).for_each(|(r, t)| *r -= step * t);
            let next = dot(&rest, &rest);
            let keep = next / square;
            along.iter_mut().zip(&rest).for_each(|(a, r)| *a = r + keep * *a);
            square = next;
        }
        x
    }
}

/// The terms of (θ/h)²; beyond h they are too few, and their sum is larger than 1 all the same.
fn series(radius: f64) -> Vec<f64> {
    let farthest = 4.0 * (0.5 * radius).sin().powi(2);
    let next = |&(n, term): &(f64, f64)| Some((n + 1.0, term * n * n / ((2.0 * n + 1.0) * (2.0 * n + 2.0))));
    let terms = std::iter::successors(Some((1.0, 1.0 / radius.powi(2))), next);
    terms
        .map(|(_, term)| term)
        .scan(1.0, |power, term| {
            *power *= farthest;
            (term * *power > 1e-17).then_some(term)
        })
        .collect()
}

/// W by (θ/h)², divided by its value at 0.
fn kernel(square: f64) -> f64 {
    (1.0 - square).max(0.0).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn basis(functions: u32) -> DiscreteSpherical {
        DiscreteSpherical::new(functions).unwrap()
    }

    /// Off every symmetry.
    fn directions(count: u32) -> impl Iterator<Item = DVec3> {
        (0..count)
            .map(f64::from)
            .map(|i| DVec3::new((1.3 * i).sin(), (2.1 * i + 0.4).sin(), (0.7 * i - 1.0).cos()).normalize())
    }

    /// The paper's equations 7 and 8 as they stand.
    fn by_definition(basis: &DiscreteSpherical, d: DVec3) -> Vec<f64> {
        let set = basis.directions();
        let h = basis.radius();
        let kernel = |v: &DVec3| {
            let angle = v.angle_between(d);
            if angle < h { (h * h - angle * angle).powi(3) } else { 0.0 }
        };
        let sum: f64 = set.iter().map(kernel).sum();
        set.iter().map(|v| kernel(v) / sum).collect()
    }

    #[test]
    fn neighbours_are_all_that_counts() {
        for functions in DiscreteSpherical::FUNCTIONS {
            let basis = basis(functions);
            let mut found = vec![f64::NAN; basis.count()];
            for d in directions(400).chain(basis.directions().iter().copied().take(50)) {
                basis.eval(d, &mut found);
                for (k, expected) in by_definition(&basis, d).into_iter().enumerate() {
                    // Near a vertex the angle is known to 1e-8, and its square is what counts.
                    assert!((found[k] - expected).abs() < 1e-9, "{functions}, {k} at {d}: {} {expected}", found[k]);
                }
                assert!((found.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            }
        }
    }

    /// The least angle from `v` to the triangle, 0 within.
    fn angle_to(v: DVec3, corners: [DVec3; 3]) -> f64 {
        let edges = [0, 1, 2].map(|i| (corners[i], corners[(i + 1) % 3]));
        if edges.iter().all(|(a, b)| a.cross(*b).dot(v) >= 0.0) {
            return 0.0;
        }
        let to_edge = |(a, b): (DVec3, DVec3)| {
            let normal = a.cross(b).normalize();
            let foot = v - normal * normal.dot(v);
            let between = a.cross(foot).dot(normal) >= 0.0 && foot.cross(b).dot(normal) >= 0.0;
            let ends = v.angle_between(a).min(v.angle_between(b));
            if between { ends.min(normal.dot(v).abs().asin()) } else { ends }
        };
        edges.map(to_edge).into_iter().fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn no_other_vertex_comes_near_a_triangle_and_no_direction_is_far_from_all() {
        for functions in DiscreteSpherical::FUNCTIONS {
            let basis = basis(functions);
            let set = basis.directions();
            let h = basis.radius();
            let mut worst = 0f64;
            // By symmetry the triangles within the first of the icosahedron stand for all.
            for near in &basis.tables.near[..basis.tables.near.len() / 20] {
                let corners = [0, 1, 2].map(|i| set[near[i] as usize]);
                for (k, &v) in set.iter().enumerate() {
                    let outside = !near.contains(&(k as u32)) && angle_to(v, corners) < h * (1.0 - 1e-9);
                    assert!(!outside, "{functions}: vertex {k} reaches into {near:?}");
                }
                let [a, b, c] = corners;
                let middle = (b - a).cross(c - a).normalize();
                worst = worst.max(middle.angle_between(a) / h);
            }
            assert!(worst < 0.78, "{functions}: a circumradius of {worst} h");
        }
    }

    #[test]
    fn directions_are_interpolated() {
        for functions in DiscreteSpherical::FUNCTIONS {
            let basis = basis(functions);
            let mut values = vec![0.0; basis.count()];
            for (j, &d) in basis.directions().iter().enumerate() {
                basis.eval(d, &mut values);
                for (k, v) in values.iter().enumerate() {
                    let expected = if j == k { 1.0 } else { 0.0 };
                    // Neighbours at h itself, a rounding inside: its third power.
                    assert!((v - expected).abs() < 1e-14, "{functions}: function {k} is {v} at direction {j}");
                }
            }
        }
    }

    #[test]
    fn kernel_falls_from_one_to_zero() {
        let values: Vec<f64> = (0..=120).map(|i| kernel((f64::from(i) / 100.0).powi(2))).collect();
        assert_eq!(values[0], 1.0);
        assert!(values.windows(2).all(|w| w[1] <= w[0]) && values[99] > 0.0);
        assert!(values[100..].iter().all(|&v| v == 0.0));
    }

    #[test]
    fn areas_are_those_of_the_sphere() {
        // The largest over the smallest: around the middles of the icosahedron's faces vertices lie farther apart.
        for (functions, spread) in DiscreteSpherical::FUNCTIONS.into_iter().zip([1.000, 1.102, 1.160, 1.281, 1.319]) {
            let areas = basis(functions).integrals();
            let sum: f64 = areas.iter().sum();
            // Rounding of as many terms.
            assert!((sum - 4.0 * PI).abs() < 1e-12, "{functions}: {sum}");
            let least = areas.iter().copied().fold(f64::INFINITY, f64::min);
            let most = areas.iter().copied().fold(0.0, f64::max);
            // The last digit.
            assert!((most / least - spread).abs() < 6e-4, "{functions}: {least} to {most}");
        }
    }

    #[test]
    fn areas_are_the_integrals_of_their_functions() {
        // Every triangle by itself and by other nodes.
        let level = 2;
        let (used, other) = (Tables::new(level, NODES), Tables::new(level, 45));
        let mean = 4.0 * PI / used.areas.len() as f64;
        let rule: Vec<_> = gauss_legendre(24).into_iter().map(|(x, w)| (0.5 + 0.5 * x, 0.5 * w)).collect();
        let mut areas = vec![0.0; used.areas.len()];
        for (triangle, near) in used.near.iter().enumerate() {
            let [a, b, c] = [near[0], near[1], near[2]].map(|v| used.sphere.vertices[v as usize]);
            for &(x, u) in &rule {
                for &(y, v) in &rule {
                    let p = a + (b - a) * x + (c - b) * (x * y);
                    let weight = u * v * x * a.cross(b).dot(c) / p.length().powi(3);
                    let values = used.weights(triangle, p.normalize());
                    (0..6).for_each(|j| areas[near[j] as usize] += weight * values[j]);
                }
            }
        }
        for ((a, b), c) in used.areas.iter().zip(&other.areas).zip(&areas) {
            assert!((a - b).abs() < 1e-6 * mean, "{a} {b}");
            // 24 nodes leave a little more than 32.
            assert!((a - c).abs() < 3e-6 * mean, "{a} {c}");
        }
    }

    #[test]
    fn coefficients_keep_the_light_and_its_bounds() {
        let basis = basis(162);
        // Light of 2.5 + sin: its moments by a fine sum over directions of equal area.
        let light = |d: DVec3| 2.5 + (9.0 * d.x).sin() * d.y;
        let set = super::super::healpix::directions(64);
        let weight = super::super::healpix::weight(64);
        let mut moments = vec![[0.0; 3]; basis.count()];
        for &d in &set {
            basis.each(d, &mut |k, v| moments[k][1] += v * weight * light(d));
        }
        let energy = basis.coefficients(&moments).unwrap();
        let areas = basis.integrals();
        let total: f64 = energy.iter().zip(&areas).map(|(c, a)| c[1] * a).sum();
        let expected: f64 = set.iter().map(|&d| light(d) * weight).sum();
        assert!((total - expected).abs() < 1e-11, "{total} {expected}");
        // Means, but for what the sum leaves of A_k.
        assert!(energy.iter().all(|c| c[0] == 0.0 && c[1] > 1.499 && c[1] < 3.501));
        let best = basis.least_squares(&moments).unwrap();
        let error = |coefficients: &[[f64; 3]]| {
            let square = |&d: &DVec3| {
                let mut value = -light(d);
                basis.each(d, &mut |k, v| value += v * coefficients[k][1]);
                value * value
            };
            (set.iter().map(square).sum::<f64>() / set.len() as f64).sqrt()
        };
        assert!(error(&best) < 0.9 * error(&energy), "{} {}", error(&best), error(&energy));
        // The optimum's residual is orthogonal to every function: no step along any of them lowers it.
        let residual = basis.tables.product(&best.iter().map(|c| c[1]).collect::<Vec<_>>());
        assert!(residual.iter().zip(&moments).all(|(r, m)| (r - m[1]).abs() < 1e-12));
        for value in [1e-6, -1e-6] {
            let mut moved = best.clone();
            moved[77][1] += value * 1e3;
            assert!(error(&moved) > error(&best));
        }
    }

    #[test]
    fn what_lies_in_the_span_is_found() {
        let basis = basis(42);
        let chosen: Vec<f64> = (0..42).map(|k| f64::from(k * k % 7) - 2.0).collect();
        let moments: Vec<_> = basis.tables.product(&chosen).into_iter().map(|m| [m, 0.0, -m]).collect();
        for (found, expected) in basis.least_squares(&moments).unwrap().iter().zip(&chosen) {
            assert!((found[0] - expected).abs() < 1e-11 && (found[2] + expected).abs() < 1e-11);
        }
    }

    #[test]
    fn a_directional_light_keeps_its_irradiance_and_its_direction() {
        for functions in DiscreteSpherical::FUNCTIONS {
            let basis = basis(functions);
            let areas = basis.integrals();
            for d in directions(100) {
                let coefficients = basis.directional(d);
                let weights: Vec<f64> = coefficients.iter().zip(&areas).map(|(c, a)| c * a).collect();
                assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-13);
                let mean: DVec3 = basis.directions().iter().zip(&weights).map(|(&v, &w)| v * w).sum();
                assert!(mean.normalize().distance(d) < 1e-12);
                assert!(weights.iter().filter(|&&w| w > 0.0).count() <= 3 && weights.iter().all(|&w| w >= 0.0));
            }
        }
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let error = DiscreteSpherical::new(100).unwrap_err();
        assert_eq!(error.to_string(), "100 functions; [12, 42, 162, 642, 2562] can be had");
        assert_eq!(basis(12).coefficients(&[[0.0; 3]; 11]), Err(BasisError::Length { expected: 12, found: 11 }));
    }
}
