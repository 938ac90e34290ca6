//! Windows against ringing: factors of the bands of a truncated expansion, which fall from one to nearly zero.
//!
//! An expansion that ends abruptly swings around what it stands for, and below zero beside a small bright light. Fading
//! its last bands trades that for blur: a product in each band is a convolution with a rotationally symmetric kernel.
//! The forms are the usual two of signal processing as P.-P. Sloan gives them for spherical harmonics ("Stupid
//! Spherical Harmonics (SH) Tricks", 2008), as wide as there are bands: the first band left out is where the window is
//! zero. Band 0 and with it the mean stay.

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

/// n of the 12·n² directions in which [`ringing`] looks: 3.7° apart, where the highest band that devices know swings
/// every 18°.
const NSIDE: u32 = 16;

/// How many directions [`ringing`] looks in.
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

/// How far a function falls below zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ringing {
    /// Of [`DIRECTIONS`] directions, spread evenly over the sphere, those where a channel is below zero by more than
    /// rounding.
    pub negative: usize,
    /// The lowest value below zero as a share of the largest of its channel, the worst channel's; 0 where there is
    /// none.
    pub depth: f64,
}

/// How far the function with these coefficients (RGB, bands² of them) falls below zero.
pub fn ringing(basis: &SphericalHarmonics, coefficients: &[[f64; 3]]) -> Ringing {
    let mut values = vec![0.0; basis.count()];
    let rounding = -1e-12 * coefficients.as_flattened().iter().fold(0.0, |m: f64, c| m.max(c.abs()));
    let (mut negative, mut least, mut most) = (0, [0.0f64; 3], [0.0f64; 3]);
    for d in healpix::directions(NSIDE) {
        basis.eval(d, &mut values);
        let rgb = [0, 1, 2].map(|c| coefficients.iter().zip(&values).map(|(f, y)| f[c] * y).sum::<f64>());
        negative += usize::from(rgb.iter().any(|&v| v < rounding));
        for c in 0..3 {
            (least[c], most[c]) = (least[c].min(rgb[c]), most[c].max(rgb[c]));
        }
    }
    let depth = |c: usize| if least[c] < rounding { -least[c] / most[c] } else { 0.0 };
    Ringing { negative, depth: (0..3).map(depth).fold(0.0, f64::max) }
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
        let ringing = |window: Window| {
            let light: Vec<_> =
                values.iter().zip(window.factors(bands)).map(|(v, f)| [v * f, 0.0, 2.0 * v * f]).collect();
            super::ringing(&basis, &light)
        };
        let [plain, hanning, lanczos] = [Window::None, Window::Hanning, Window::Lanczos].map(ringing);
        // Σ (2l+1) f_l P_l(c), l < 4, for each window's factors: its share below zero, and how deep it goes.
        for (found, factors) in [
            (plain, [1.0; 4]),
            (hanning, [1.0, 0.853_553_390_593_273_8, 0.5, 0.146_446_609_406_726_2]),
            (lanczos, [1.0, 0.900_316_316_157_106, std::f64::consts::FRAC_2_PI, 0.300_105_438_719_035_3]),
        ] {
            let steps = 200_000;
            let series = |i: u32| {
                let c = -1.0 + 2.0 * (f64::from(i) + 0.5) / f64::from(steps);
                let terms = crate::media::legendre(c).zip(factors).enumerate();
                terms.map(|(l, (p, f))| (2.0 * l as f64 + 1.0) * f * p).sum::<f64>()
            };
            let share = (0..steps).filter(|&i| series(i) < 0.0).count() as f64 / f64::from(steps);
            let extremes = (0..steps).map(series).fold((0.0f64, 0.0f64), |(a, b), v| (a.min(v), b.max(v)));
            // Pixels along the two or three circles where it changes its sign: some hundred of 3072, half of them
            // either way.
            assert!((found.negative as f64 / DIRECTIONS as f64 - share).abs() < 0.02, "{found:?} {share}");
            // The extremes lie up to half of 3.7° from a pixel's centre, where the highest band swings every 90°.
            assert!((found.depth / (-extremes.0 / extremes.1) - 1.0).abs() < 0.05, "{found:?} {extremes:?}");
        }
        assert!(hanning.depth < lanczos.depth && lanczos.depth < 0.5 * plain.depth);
        assert_eq!(super::ringing(&basis, &[[1.0; 3]]), Ringing { negative: 0, depth: 0.0 });
    }
}
