//! The colour of what glows by its heat.

use std::sync::OnceLock;

use glam::{DMat3, DVec3};

/// A black body's radiance in linear RGB, relative to its luminance at a reference temperature.
///
/// B(T) = RGB(T) / Y(`reference`): Planck's law is weighed with the colour-matching functions of the CIE's 1931
/// observer. What is out of the gamut of Rec. 709 is clipped: components below zero become zero, and the others are
/// scaled so that luminance stays. Luminance therefore keeps its true ratio between temperatures: from 1000 to 1500 K it
/// grows by the factor 2900.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlackBody {
    scale: f64,
}

/// Planck's second radiation constant, hc/k, in nm K.
const C2: f64 = 1.438_776_877e7;

/// XYZ to linear RGB with the primaries and the white (D65) of Rec. 709, by columns.
const TO_RGB: DMat3 = DMat3::from_cols(
    DVec3::new(3.240_454_2, -0.969_266_0, 0.055_643_4),
    DVec3::new(-1.537_138_5, 1.876_010_8, -0.204_025_9),
    DVec3::new(-0.498_531_4, 0.041_556_0, 1.057_225_2),
);

/// The colour-matching functions x, y and z from 380 to 780 nm, every 10 nm (CIE 1931, as in Wyszecki and Stiles, Color
/// Science, 1982). Sums over them give the Planckian chromaticities of finer tables to 10⁻⁴.
const OBSERVER: [[f64; 3]; 41] = [
    [0.001368, 0.000039, 0.00645],
    [0.004243, 0.00012, 0.02005],
    [0.01431, 0.000396, 0.06785],
    [0.04351, 0.00121, 0.2074],
    [0.13438, 0.004, 0.6456],
    [0.2839, 0.0116, 1.3856],
    [0.34828, 0.023, 1.74706],
    [0.3362, 0.038, 1.77211],
    [0.2908, 0.06, 1.6692],
    [0.19536, 0.09098, 1.28764],
    [0.09564, 0.13902, 0.81295],
    [0.03201, 0.20802, 0.46518],
    [0.0049, 0.323, 0.272],
    [0.0093, 0.503, 0.1582],
    [0.06327, 0.71, 0.07825],
    [0.1655, 0.862, 0.04216],
    [0.2904, 0.954, 0.0203],
    [0.43345, 0.99495, 0.00875],
    [0.5945, 0.995, 0.0039],
    [0.7621, 0.952, 0.0021],
    [0.9163, 0.87, 0.00165],
    [1.0263, 0.757, 0.0011],
    [1.0622, 0.631, 0.0008],
    [1.0026, 0.503, 0.00034],
    [0.85445, 0.381, 0.00019],
    [0.6424, 0.265, 0.00005],
    [0.4479, 0.175, 0.00002],
    [0.2835, 0.107, 0.0],
    [0.1649, 0.061, 0.0],
    [0.0874, 0.032, 0.0],
    [0.04677, 0.017, 0.0],
    [0.0227, 0.00821, 0.0],
    [0.011359, 0.004102, 0.0],
    [0.00579, 0.002091, 0.0],
    [0.002899, 0.001047, 0.0],
    [0.00144, 0.00052, 0.0],
    [0.00069, 0.000249, 0.0],
    [0.000332, 0.00012, 0.0],
    [0.000166, 0.00006, 0.0],
    [0.000083, 0.00003, 0.0],
    [0.000042, 0.000015, 0.0],
];

/// Luminance of linear RGB.
const LUMINANCE: DVec3 = DVec3::new(0.212_672_9, 0.715_152_2, 0.072_175_0);

/// Entries of the table, evenly spread in the logarithm of the temperature: linear between them, radiance is good to
/// 10⁻⁴ from 800 K on.
const ENTRIES: usize = 8192;

impl BlackBody {
    /// Below this many kelvin nothing is seen.
    pub const COLDEST: f64 = 400.0;
    /// The highest temperature, K.
    pub const HOTTEST: f64 = 1e5;

    /// Relative to the luminance at `reference` kelvin, which is clamped to [`Self::COLDEST`] and [`Self::HOTTEST`].
    pub fn new(reference: f64) -> Self {
        Self { scale: xyz(reference.clamp(Self::COLDEST, Self::HOTTEST)).y.recip() }
    }

    /// Linear RGB at `kelvin`: zero below [`Self::COLDEST`], at [`Self::HOTTEST`] what is above it.
    pub fn color(&self, kelvin: f64) -> DVec3 {
        if kelvin.is_nan() || kelvin < Self::COLDEST {
            return DVec3::ZERO;
        }
        let table = table();
        let place = (kelvin.min(Self::HOTTEST) / Self::COLDEST).ln() / span() * (ENTRIES - 1) as f64;
        let below = (place as usize).min(ENTRIES - 2);
        table[below].lerp(table[below + 1], place - below as f64) * self.scale
    }
}

/// Between the logarithms of the lowest and the highest temperature.
fn span() -> f64 {
    (BlackBody::HOTTEST / BlackBody::COLDEST).ln()
}

fn table() -> &'static [DVec3] {
    static TABLE: OnceLock<Vec<DVec3>> = OnceLock::new();
    TABLE.get_or_init(|| {
        let kelvin = |n: usize| BlackBody::COLDEST * (span() * n as f64 / (ENTRIES - 1) as f64).exp();
        (0..ENTRIES).map(|n| within_gamut(xyz(kelvin(n)))).collect()
    })
}

/// Linear RGB without negative components, of the same luminance.
fn within_gamut(xyz: DVec3) -> DVec3 {
    let rgb = (TO_RGB * xyz).max(DVec3::ZERO);
    rgb * (xyz.y / rgb.dot(LUMINANCE))
}

/// Tristimulus values at `kelvin`, in a unit that is the same at every temperature.
fn xyz(kelvin: f64) -> DVec3 {
    let wavelengths = (0..).map(|n| 380.0 + 10.0 * f64::from(n));
    wavelengths.zip(OBSERVER).map(|(nm, matching)| planck(nm, kelvin) * DVec3::from(matching)).sum()
}

/// Spectral radiance at a wavelength, relative to its constant factor at 560 nm.
fn planck(nm: f64, kelvin: f64) -> f64 {
    (560.0 / nm).powi(5) / (C2 / (nm * kelvin)).exp_m1()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Planckian chromaticities of the 1931 observer (Wyszecki and Stiles, Color Science, 1982), and illuminant A.
    #[test]
    fn chromaticities_are_those_of_the_tables() {
        for (kelvin, x, y) in [
            (1000.0, 0.6528, 0.3444),
            (2000.0, 0.5267, 0.4133),
            (2856.0, 0.4476, 0.4074),
            (4000.0, 0.3805, 0.3768),
            (6500.0, 0.3135, 0.3237),
            (10000.0, 0.2807, 0.2884),
        ] {
            let found = xyz(kelvin);
            let sum = found.x + found.y + found.z;
            // A unit of the tables' last digit.
            assert!((found.x / sum - x).abs() < 1.5e-4, "{kelvin} K: x = {} {x}", found.x / sum);
            assert!((found.y / sum - y).abs() < 1.5e-4, "{kelvin} K: y = {} {y}", found.y / sum);
        }
    }

    #[test]
    fn luminance_is_one_at_the_reference_and_keeps_its_ratio() {
        for reference in [900.0, 1500.0, 6500.0] {
            let body = BlackBody::new(reference);
            let luminance = |kelvin: f64| body.color(kelvin).dot(LUMINANCE);
            assert!((luminance(reference) - 1.0).abs() < 1e-4, "{}", luminance(reference));
            for kelvin in [800.0, 1234.0, 5000.0, 99_000.0] {
                let expected = xyz(kelvin).y / xyz(reference).y;
                assert!((luminance(kelvin) / expected - 1.0).abs() < 1e-4, "{kelvin} K: {}", luminance(kelvin));
            }
        }
        let ratio = xyz(1500.0).y / xyz(1000.0).y;
        assert!((ratio / 2900.0 - 1.0).abs() < 0.02, "{ratio}");
    }

    #[test]
    fn colors_go_from_red_over_white_to_blue() {
        let body = BlackBody::new(1500.0);
        let shares = |kelvin: f64| body.color(kelvin) / body.color(kelvin).max_element();
        let [red, ember, lamp, day, hot] = [700.0, 1500.0, 2856.0, 6500.0, 20_000.0].map(shares);
        assert!(red == DVec3::X, "{red}");
        assert!(ember.y > 0.1 && ember.y < lamp.y && ember.z == 0.0, "{ember}");
        assert!(lamp.y > 0.4 && lamp.z > 0.1 && lamp.z < lamp.y, "{lamp}");
        assert!(day.min_element() > 0.9, "{day}");
        assert!(hot.z == 1.0 && hot.x < 0.6, "{hot}");
    }

    #[test]
    fn the_range_has_ends() {
        let body = BlackBody::new(2000.0);
        for dark in [0.0, -3.0, 399.9, f64::NAN] {
            assert_eq!(body.color(dark), DVec3::ZERO);
        }
        assert!(body.color(400.0).x > 0.0);
        assert_eq!(body.color(2e5), body.color(1e5));
        assert_eq!(BlackBody::new(1.0), BlackBody::new(BlackBody::COLDEST));
    }
}
