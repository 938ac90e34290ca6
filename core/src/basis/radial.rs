//! Spherical radial basis functions: Gaussians around evenly spread directions, fitted by least squares (Tsai and Shih
//! 2006, "All-Frequency Precomputed Radiance Transfer Using Spherical Radial Basis Functions and Clustered Tensor
//! Approximation").
//!
//! ```text
//! b_k(ω) = exp(λ (ω·ω_k - 1)),      ∫ b_k dω = 2π (1 - e^-2λ)/λ,
//! ∫ b_j b_k dω = 4π e^-2λ sinh(λr)/(λr),  r = |ω_j + ω_k|.
//! ```
//!
//! The directions ω_k are those of [`DiscreteSpherical`](super::DiscreteSpherical) of as many functions. Of the two
//! kernels of the paper the Gaussian falls faster than the Abel–Poisson kernel, whose tails reach around the sphere:
//! beyond some spacings it is nothing in f64 and is left out. Its Gram matrix is known in closed form, so that a fit
//! needs the moments of the light and nothing else.

use std::f64::consts::PI;
use std::fmt;
use std::sync::{Arc, OnceLock};

use glam::DVec3;
use nalgebra::{Cholesky, DMatrix, Dyn};

use super::icosphere::Icosphere;
use super::{Basis, BasisError};

/// Value of a function at the direction nearest to its own. Narrower functions leave dips between them; wider ones make the
/// Gram matrix worse conditioned by a power of their width.
const OVERLAP: f64 = 0.5;

/// What is added to the diagonal of the Gram matrix, as a share of it. The smallest eigenvalues are less than that: without
/// it a directional light would be fitted by coefficients of alternating sign that are far larger than it.
const REGULARISATION: f64 = 1e-3;

/// Below e to the minus this a function is taken as zero: it is less than the rounding of its peak.
const REACH: f64 = 36.0;

/// Gaussians around a number of directions. Copies share their tables, which are made once.
#[derive(Clone)]
pub struct RadialFunctions {
    tables: Arc<Tables>,
}

struct Tables {
    centers: Vec<DVec3>,
    sharpness: f64,
    factor: Cholesky<f64, Dyn>,
}

impl fmt::Debug for RadialFunctions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RadialFunctions").field("functions", &self.count()).finish()
    }
}

impl RadialFunctions {
    /// Numbers of functions that there are: the factor of a larger matrix takes long.
    pub const FUNCTIONS: [u32; 4] = [12, 42, 162, 642];

    /// The basis of so many functions.
    ///
    /// # Errors
    /// [`BasisError::Functions`] unless it is one of [`FUNCTIONS`](Self::FUNCTIONS).
    pub fn new(functions: u32) -> Result<Self, BasisError> {
        static MADE: [OnceLock<Arc<Tables>>; RadialFunctions::FUNCTIONS.len()] =
            [const { OnceLock::new() }; RadialFunctions::FUNCTIONS.len()];
        let level = Self::FUNCTIONS
            .iter()
            .position(|&n| n == functions)
            .ok_or(BasisError::Functions { functions, known: &Self::FUNCTIONS })?;
        Ok(Self { tables: MADE[level].get_or_init(|| Arc::new(Tables::new(level as u32))).clone() })
    }

    /// The directions ω_k, unit vectors.
    pub fn directions(&self) -> &[DVec3] {
        &self.tables.centers
    }

    /// λ.
    pub fn sharpness(&self) -> f64 {
        self.tables.sharpness
    }

    fn check(&self, found: usize) -> Result<(), BasisError> {
        let expected = self.count();
        if found == expected { Ok(()) } else { Err(BasisError::Length { expected, found }) }
    }
}

impl Tables {
    fn new(level: u32) -> Self {
        let sphere = Icosphere::new(level);
        let centers = &sphere.vertices;
        let cosines =
            |[a, b, c]: [u32; 3]| [(a, b), (b, c), (c, a)].map(|(i, j)| centers[i as usize].dot(centers[j as usize]));
        let nearest = sphere.triangles().flat_map(cosines).fold(-1.0, f64::max);
        let sharpness = -OVERLAP.ln() / (1.0 - nearest);
        let gram = DMatrix::from_fn(centers.len(), centers.len(), |j, k| {
            let regularised = if j == k { 1.0 + REGULARISATION } else { 1.0 };
            regularised * overlap(sharpness, (centers[j] + centers[k]).length())
        });
        let factor = gram.cholesky().expect("a Gram matrix with a raised diagonal is positive definite");
        Self { centers: sphere.vertices, sharpness, factor }
    }
}

/// ∫ b_j b_k dω where |ω_j + ω_k| is `r`.
fn overlap(sharpness: f64, r: f64) -> f64 {
    let x = sharpness * r;
    // e^-2λ sinh(x)/x without overflow; opposite directions have r = 0.
    let sinh = if x < 1e-6 {
        (-2.0 * sharpness).exp()
    } else {
        ((x - 2.0 * sharpness).exp() - (-x - 2.0 * sharpness).exp()) / (2.0 * x)
    };
    4.0 * PI * sinh
}

impl Basis for RadialFunctions {
    fn name(&self) -> String {
        format!("{} spherical radial functions", self.count())
    }

    fn count(&self) -> usize {
        self.directions().len()
    }

    fn eval(&self, d: DVec3, out: &mut [f64]) {
        out[..self.count()].fill(0.0);
        self.each(d, &mut |k, v| out[k] = v);
    }

    fn each(&self, d: DVec3, visit: &mut dyn FnMut(usize, f64)) {
        for (k, center) in self.directions().iter().enumerate() {
            let exponent = self.sharpness() * (center.dot(d) - 1.0);
            if exponent > -REACH {
                visit(k, exponent.exp());
            }
        }
    }

    fn integrals(&self) -> Vec<f64> {
        let sharpness = self.sharpness();
        vec![2.0 * PI * (-(-2.0 * sharpness).exp_m1()) / sharpness; self.count()]
    }

    /// The least squares, with the squares of the coefficients as a penalty (Tikhonov): (G + 10⁻³ diag G) F = moments.
    /// They may be negative, and their integral is not quite the light's.
    fn coefficients(&self, moments: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, BasisError> {
        self.check(moments.len())?;
        let right = DMatrix::from_fn(moments.len(), 3, |k, c| moments[k][c]);
        let solved = self.tables.factor.solve(&right);
        Ok((0..moments.len()).map(|k| [0, 1, 2].map(|c| solved[(k, c)])).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::super::quadrature::gauss_legendre;
    use super::super::{gram, healpix};
    use super::*;

    fn basis(functions: u32) -> RadialFunctions {
        RadialFunctions::new(functions).unwrap()
    }

    #[test]
    fn integrals_are_those_of_the_functions() {
        let basis = basis(42);
        let (mut set, mut weights) = (Vec::new(), Vec::new());
        for (y, w) in gauss_legendre(40) {
            for i in 0..80 {
                let (sin, cos) = (2.0 * PI * f64::from(i) / 80.0).sin_cos();
                let planar = (1.0 - y * y).sqrt();
                set.push(DVec3::new(planar * sin, y, planar * cos));
                weights.push(w * 2.0 * PI / 80.0);
            }
        }
        let matrix = gram(&basis, &set, &weights);
        let centers = basis.directions();
        for j in 0..42 {
            for k in 0..42 {
                let expected = overlap(basis.sharpness(), (centers[j] + centers[k]).length());
                // Rounding: the rule is exact far beyond where these functions have anything.
                assert!((matrix[42 * j + k] - expected).abs() < 1e-12, "{j} {k}: {} {expected}", matrix[42 * j + k]);
            }
        }
        let mut sums = vec![0.0; 42];
        for (&d, w) in set.iter().zip(weights) {
            basis.each(d, &mut |k, v| sums[k] += v * w);
        }
        for (sum, integral) in sums.iter().zip(basis.integrals()) {
            assert!((sum / integral - 1.0).abs() < 1e-12, "{sum} {integral}");
        }
    }

    #[test]
    fn neighbours_overlap_by_half() {
        for functions in RadialFunctions::FUNCTIONS {
            let basis = basis(functions);
            let mut values = vec![0.0; basis.count()];
            basis.eval(basis.directions()[0], &mut values);
            values.sort_by(f64::total_cmp);
            assert_eq!(values.pop(), Some(1.0));
            assert!(values.pop().is_some_and(|v| v < OVERLAP + 1e-12 && v > 0.5 * OVERLAP), "{functions}");
        }
    }

    #[test]
    fn what_lies_in_the_span_is_found() {
        for functions in [12, 162] {
            let basis = basis(functions);
            let centers = basis.directions();
            let n = basis.count();
            let chosen: Vec<f64> = centers.iter().map(|c| 2.0 + c.x - c.y * c.z).collect();
            let moment = |j: usize| -> f64 {
                (0..n).map(|k| chosen[k] * overlap(basis.sharpness(), (centers[j] + centers[k]).length())).sum()
            };
            let moments: Vec<_> = (0..n).map(|j| [moment(j), 0.0, -2.0 * moment(j)]).collect();
            for (found, expected) in basis.coefficients(&moments).unwrap().iter().zip(&chosen) {
                // The penalty's share: 10⁻³ over the matrix' eigenvalue for what varies so slowly, which is more than a
                // tenth of its diagonal.
                assert!((found[0] / expected - 1.0).abs() < 1e-2, "{found:?} {expected}");
                assert!((found[2] + 2.0 * found[0]).abs() < 1e-12 && found[1] == 0.0);
            }
        }
    }

    #[test]
    fn a_directional_light_keeps_its_irradiance_nearly() {
        let basis = basis(162);
        for d in healpix::directions(3) {
            let total: f64 = basis.directional(d).iter().zip(basis.integrals()).map(|(f, i)| f * i).sum();
            // Not held by the fit: what a residual that is orthogonal to the functions may have of their mean.
            assert!((total - 1.0).abs() < 1e-3, "{d}: {total}");
        }
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let error = RadialFunctions::new(2562).unwrap_err();
        assert_eq!(error.to_string(), "2562 functions; [12, 42, 162, 642] can be had");
        assert_eq!(basis(12).coefficients(&[[0.0; 3]]), Err(BasisError::Length { expected: 12, found: 1 }));
    }
}
