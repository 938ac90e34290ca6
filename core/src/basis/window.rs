//! Windows against ringing: factors of the bands of a truncated expansion, which fall from one to nearly zero.
//!
//! An expansion that ends abruptly swings around what it stands for, and below zero beside a small bright light. Fading
//! its last bands trades that for blur: a product in each band is a convolution with a rotationally symmetric kernel. The
//! forms are the usual two of signal processing as P.-P. Sloan gives them for spherical harmonics ("Stupid Spherical
//! Harmonics (SH) Tricks", 2008), as wide as there are bands: the first band left out is where the window is zero. Band 0
//! and with it the mean stay.

use std::f64::consts::PI;

use super::{Basis, SphericalHarmonics, healpix};

/// A window over bands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Window {
    /// None: every band counts whole.
    #[default]
    None,
    /// (1 + cos(π l/n))/2 in band l of n.
    Hanning,
    /// sin(π l/n)/(π l/n) in band l of n.
    Lanczos,
}

/// n of the 12·n² directions in which [`negative`] looks: 3.7° apart, where the highest band that devices know swings every 18°.
const NSIDE: u32 = 16;

/// How many directions [`negative`] looks in.
pub const DIRECTIONS: usize = healpix::count(NSIDE);

impl Window {
    /// The factor of band `l` of `bands`.
    pub fn factor(self, l: u32, bands: u32) -> f64 {
        let x = PI * f64::from(l) / f64::from(bands);
        match self {
            Self::Hanning => 0.5 * (1.0 + x.cos()),
            Self::Lanczos if l > 0 => x.sin() / x,
            Self::None | Self::Lanczos => 1.0,
        }
    }

    /// The factors of all functions of the first `bands` bands.
    pub fn factors(self, bands: u32) -> impl Iterator<Item = f64> {
        (0..bands).flat_map(move |l| (0..2 * l + 1).map(move |_| self.factor(l, bands)))
    }
}

/// In how many of [`DIRECTIONS`] directions, spread evenly over the sphere, any channel of the function with these
/// coefficients (RGB, bands² of them) is below zero by more than rounding.
pub fn negative(basis: &SphericalHarmonics, coefficients: &[[f64; 3]]) -> usize {
    let mut values = vec![0.0; basis.count()];
    let least = -1e-12 * coefficients.as_flattened().iter().fold(0.0, |m: f64, c| m.max(c.abs()));
    let below = |d| {
        basis.eval(d, &mut values);
        let sum = |c: usize| coefficients.iter().zip(&values).map(|(f, y)| f[c] * y).sum::<f64>();
        (0..3).any(|c| sum(c) < least)
    };
    healpix::directions(NSIDE).into_iter().map(below).filter(|&below| below).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn windows_fall_from_one_to_zero_at_the_first_band_left_out() {
        let factors = |window: Window| -> Vec<f64> { (0..=3).map(|l| window.factor(l, 3)).collect() };
        let close = |found: Vec<f64>, expected: [f64; 4]| {
            assert!(found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 1e-15), "{found:?}");
        };
        close(factors(Window::None), [1.0; 4]);
        close(factors(Window::Hanning), [1.0, 0.75, 0.25, 0.0]);
        // sin 60° / (π/3), sin 120° / (2π/3).
        let half_root = 0.75f64.sqrt();
        close(factors(Window::Lanczos), [1.0, half_root * 3.0 / PI, half_root * 1.5 / PI, 0.0]);
        let all: Vec<f64> = Window::Hanning.factors(3).collect();
        assert_eq!(all.len(), 9);
        assert!(all[1..4].iter().all(|&f| f == all[1]) && all[4..].iter().all(|&f| f == all[4]));
    }

    /// A light from one direction, by its addition theorem.
    #[test]
    fn a_point_of_light_rings_below_zero_and_windows_lessen_it() {
        let (bands, toward) = (4, DVec3::new(0.3, -0.5, 0.8).normalize());
        let basis = SphericalHarmonics::new(bands).unwrap();
        let mut values = vec![0.0; basis.count()];
        basis.eval(toward, &mut values);
        let count = |window: Window| {
            let light: Vec<_> =
                values.iter().zip(window.factors(bands)).map(|(v, f)| [v * f, 0.0, 2.0 * v * f]).collect();
            negative(&basis, &light)
        };
        // Σ (2l+1) P_l(c), l < 4, is 35c³/2 + 15c²/2 - 15c/2 - 3/2: negative between two of its roots and below the third,
        // so for a share of the sphere that is half their distances.
        let polynomial = |c: f64| ((17.5 * c + 7.5) * c - 7.5) * c - 1.5;
        let steps = 200_000;
        let share =
            (0..steps).filter(|i| polynomial(-1.0 + 2.0 * (f64::from(*i) + 0.5) / f64::from(steps)) < 0.0).count();
        let expected = share as f64 / f64::from(steps) * DIRECTIONS as f64;
        // Pixels along the two or three circles where it changes its sign: some hundred of 3072, half of them either way.
        assert!((count(Window::None) as f64 - expected).abs() < 0.01 * DIRECTIONS as f64, "{expected}");
        assert!(count(Window::Lanczos) < count(Window::None));
        assert!(count(Window::Hanning) < count(Window::Lanczos));
        assert_eq!(negative(&basis, &[[1.0; 3]]), 0);
    }
}
