//! Bases of functions on the sphere, direction sets and quadrature.
//!
//! Directions are unit vectors that point toward the source of light. Integrals over the sphere are in steradians.

use std::fmt::Debug;

use glam::DVec3;

mod discrete;
mod harmonics;
pub mod healpix;
mod icosphere;
pub mod quadrature;
mod radial;
pub mod window;

pub use discrete::DiscreteSpherical;
pub use harmonics::{SphericalHarmonics, eval_f32, recurrence_table};
pub use healpix::pixel_integrals;
pub use radial::RadialFunctions;
pub use window::Window;

/// Above this [`gram_error`] a direction set is too coarse for a basis: products of its functions alias.
pub const GRAM_TOLERANCE: f64 = 0.1;

/// A finite set of functions b_k on the sphere.
///
/// Light is described in it in two ways. Its *moments* are ∫ L b_k dω; its *coefficients* F_k make
/// L ≈ Σ F_k b_k. They are the same where the basis is orthonormal. Kernels such as transmittance are always given by
/// moments D_k = ∫ T b_k dω, so that ∫ L T dω ≈ F · D.
pub trait Basis: Debug + Send + Sync {
    /// What it is, for messages and reports: "spherical harmonics, 3 bands".
    fn name(&self) -> String;

    /// Number of functions.
    fn count(&self) -> usize;

    /// Writes b_k(d) for every k into the first [`count`](Self::count) values of `out`; `d` is a unit vector.
    ///
    /// # Panics
    /// Where `out` is shorter.
    fn eval(&self, d: DVec3, out: &mut [f64]);

    /// Calls `visit` with k and b_k(d) for every function that is not zero at the unit vector `d`; it may be called for
    /// others too.
    fn each(&self, d: DVec3, visit: &mut dyn FnMut(usize, f64)) {
        let mut values = vec![0.0; self.count()];
        self.eval(d, &mut values);
        values.into_iter().enumerate().for_each(|(k, v)| visit(k, v));
    }

    /// ∫ b_k dω over the sphere for every k.
    fn integrals(&self) -> Vec<f64>;

    /// The coefficients F of light whose moments are given, both RGB and one per function.
    ///
    /// # Errors
    /// [`BasisError::Length`] where there are not as many moments as functions.
    fn coefficients(&self, moments: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, BasisError>;

    /// The coefficients F of light from the one direction `d`, a unit vector, for each unit of irradiance: those of the
    /// moments b_k(d).
    fn directional(&self, d: DVec3) -> Vec<f64> {
        let mut moments = vec![[0.0; 3]; self.count()];
        self.each(d, &mut |k, v| moments[k][0] = v);
        let coefficients = self.coefficients(&moments).expect("a moment a function");
        coefficients.into_iter().map(|[f, _, _]| f).collect()
    }
}

/// A basis or a direction set out of range.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BasisError {
    /// A number of bands that no basis has.
    #[error("{bands} bands of spherical harmonics; 1 to {} can be had", SphericalHarmonics::MAX_BANDS)]
    Bands {
        /// What was asked for.
        bands: u32,
    },
    /// A number of functions that no basis of directions has.
    #[error("{functions} functions; {known:?} can be had")]
    Functions {
        /// What was asked for.
        functions: u32,
        /// Numbers that there are.
        known: &'static [u32],
    },
    /// Not as many values as functions.
    #[error("{found} coefficients for {expected} functions")]
    Length {
        /// Functions of the basis.
        expected: usize,
        /// Values given.
        found: usize,
    },
}

/// The matrix Σ_i w_i b_j(d_i) b_k(d_i), row-major, [`count`](Basis::count) squared. A direction set that resolves an
/// orthonormal basis gives the identity. Pairs beyond the shorter of the two slices are left out.
pub fn gram(basis: &dyn Basis, directions: &[DVec3], weights: &[f64]) -> Vec<f64> {
    let n = basis.count();
    let mut matrix = vec![0.0; n * n];
    let mut values = vec![0.0; n];
    for (&d, &w) in directions.iter().zip(weights) {
        basis.eval(d, &mut values);
        for (row, &value) in matrix.chunks_exact_mut(n.max(1)).zip(&values) {
            for (sum, other) in row.iter_mut().zip(&values) {
                *sum += w * value * other;
            }
        }
    }
    matrix
}

/// Largest deviation of [`gram`] from the identity. Meaningful for orthonormal bases.
pub fn gram_error(basis: &dyn Basis, directions: &[DVec3], weights: &[f64]) -> f64 {
    let n = basis.count();
    let matrix = gram(basis, directions, weights);
    let deviation = |(i, g): (usize, &f64)| (g - if i / n == i % n { 1.0 } else { 0.0 }).abs();
    matrix.iter().enumerate().map(deviation).fold(0.0, f64::max)
}
