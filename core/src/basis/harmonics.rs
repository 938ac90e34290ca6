//! Spherical harmonics: real, orthonormal, without Condon–Shortley phase, polar axis +Y.
//!
//! cos θ = dy, φ = atan2(dx, dz), function (l, m) at index l(l+1)+m, and
//!
//! ```text
//! Y_l0  =    K_l0 P_l(cos θ)
//! Y_lm  = √2 K_lm P_l^m(cos θ) cos mφ        m > 0
//! Y_l-m = √2 K_lm P_l^m(cos θ) sin mφ        m > 0
//! K_lm  = √((2l+1)/4π · (l-m)!/(l+m)!),      P_1^1 = +sin θ
//! ```
//!
//! as in eq. 3 of Delalandre, Gautron and Marvie 2013, except that its √2 on m = 0 is a misprint: the functions would
//! not be orthonormal. A zonal kernel with Legendre moments β_l multiplies the coefficient (l, m) of what it is
//! convolved with by β_l (Funk–Hecke), which is how phase functions enter.
//!
//! No trigonometric function is evaluated: with P_l^m = sin^m θ · Q_l^m the factor Q is a polynomial in y, and
//! sin^m θ (cos mφ + i sin mφ) = (z + i x)^m. The recurrences run upward in l, where they are stable.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};

use super::quadrature::gauss_legendre;
use super::{Basis, BasisError};

/// The first `bands` bands of spherical harmonics: l < bands, bands² functions.
#[derive(Clone, Debug, PartialEq)]
pub struct SphericalHarmonics {
    bands: u32,
    recurrence: Vec<(f64, f64)>,
}

impl SphericalHarmonics {
    /// Most bands that [`new`](Self::new) accepts; f64 stays accurate to 10⁻¹¹ there.
    pub const MAX_BANDS: u32 = 32;
    /// Most bands that devices evaluate: kernels size their private arrays by it, f32 stays accurate to 10⁻⁵.
    pub const DEVICE_BANDS: u32 = 10;

    /// The basis of `bands` bands.
    ///
    /// # Errors
    /// [`BasisError::Bands`] outside 1 to [`MAX_BANDS`](Self::MAX_BANDS).
    pub fn new(bands: u32) -> Result<Self, BasisError> {
        if !(1..=Self::MAX_BANDS).contains(&bands) {
            return Err(BasisError::Bands { bands });
        }
        Ok(Self { bands, recurrence: recurrence(bands) })
    }

    /// Number of bands.
    pub fn bands(&self) -> u32 {
        self.bands
    }

    /// Index of function (l, m), -l ≤ m ≤ l.
    pub const fn index(l: u32, m: i32) -> usize {
        ((l * (l + 1)) as i64 + m as i64) as usize
    }

    /// Coefficients of the function turned by `rotation`: where f is described by `coefficients` (N channels each),
    /// the result describes d ↦ f(rotation⁻¹ d). `rotation` is orthogonal; reflections are possible.
    ///
    /// By projection on a product of Gauss–Legendre and equidistant azimuths that integrates the products of two
    /// functions of the basis exactly.
    ///
    /// # Errors
    /// [`BasisError::Length`] where there are not as many coefficients as functions.
    pub fn rotate<const N: usize>(
        &self,
        coefficients: &[[f64; N]],
        rotation: DMat3,
    ) -> Result<Vec<[f64; N]>, BasisError> {
        self.check(coefficients.len())?;
        let back = rotation.transpose();
        let (mut here, mut there) = (vec![0.0; self.count()], vec![0.0; self.count()]);
        let mut turned = vec![[0.0; N]; self.count()];
        let azimuths = 2 * self.bands;
        for (y, weight) in gauss_legendre(self.bands as usize) {
            let planar = (1.0 - y * y).max(0.0).sqrt();
            for k in 0..azimuths {
                let (sin, cos) = (2.0 * PI * f64::from(k) / f64::from(azimuths)).sin_cos();
                let d = DVec3::new(planar * sin, y, planar * cos);
                self.eval(d, &mut here);
                self.eval(back * d, &mut there);
                let weight = weight * 2.0 * PI / f64::from(azimuths);
                // Bands do not mix: leaving the others out keeps their rounding out too.
                for l in 0..self.bands {
                    let band = Self::index(l, -(l as i32))..Self::index(l, l as i32) + 1;
                    let mut value = [0.0; N];
                    for (c, y) in coefficients[band.clone()].iter().zip(&there[band.clone()]) {
                        (0..N).for_each(|i| value[i] += c[i] * y);
                    }
                    for (sum, y) in turned[band.clone()].iter_mut().zip(&here[band]) {
                        (0..N).for_each(|i| sum[i] += weight * value[i] * y);
                    }
                }
            }
        }
        Ok(turned)
    }

    fn check(&self, found: usize) -> Result<(), BasisError> {
        let expected = self.count();
        if found == expected { Ok(()) } else { Err(BasisError::Length { expected, found }) }
    }
}

impl Basis for SphericalHarmonics {
    fn name(&self) -> String {
        format!("spherical harmonics, {} band{}", self.bands, if self.bands == 1 { "" } else { "s" })
    }

    fn count(&self) -> usize {
        (self.bands * self.bands) as usize
    }

    fn eval(&self, d: DVec3, out: &mut [f64]) {
        let bands = self.bands as usize;
        let (mut cos, mut sin) = (1.0, 0.0);
        for m in 0..bands {
            let (mut below, mut this) = (0.0, 0.0);
            for l in m..bands {
                let (a, b) = self.recurrence[l * (l + 1) / 2 + m];
                (below, this) = (this, if l == m { a } else { a * d.y * this - b * below });
                out[l * (l + 1) + m] = this * cos;
                if m > 0 {
                    out[l * (l + 1) - m] = this * sin;
                }
            }
            (cos, sin) = (cos * d.z - sin * d.x, cos * d.x + sin * d.z);
        }
    }

    fn integrals(&self) -> Vec<f64> {
        let mut integrals = vec![0.0; self.count()];
        integrals[0] = (4.0 * PI).sqrt();
        integrals
    }

    fn coefficients(&self, moments: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, BasisError> {
        self.check(moments.len())?;
        Ok(moments.to_vec())
    }
}

/// The recurrence of Q_l^m with its normalisation, at index l(l+1)/2+m: (Q_m^m, 0) where l = m, else the (a, b) of
/// Q_l^m = a y Q_{l-1}^m - b Q_{l-2}^m.
fn recurrence(bands: u32) -> Vec<(f64, f64)> {
    let mut table = Vec::with_capacity((bands * (bands + 1) / 2) as usize);
    let mut sectoral = (1.0 / (4.0 * PI)).sqrt();
    for l in 0..bands {
        let l = f64::from(l);
        if l > 0.0 {
            // √2 comes in once, with the first m > 0.
            sectoral *= ((2.0 * l + 1.0) / (2.0 * l)).sqrt() * if l == 1.0 { 2f64.sqrt() } else { 1.0 };
        }
        for m in 0..l as u32 {
            let m = f64::from(m);
            let span = l * l - m * m;
            let a = ((4.0 * l * l - 1.0) / span).sqrt();
            // Zero where l = m + 1; without the first band 2l - 3 would be negative.
            let b = (2.0 * l + 1.0) * ((l - 1.0) * (l - 1.0) - m * m) / ((2.0 * l - 3.0) * span);
            table.push((a, b.max(0.0).sqrt()));
        }
        table.push((sectoral, 0.0));
    }
    table
}

/// The constants from which devices evaluate the first `bands` bands in f32: `bands·(bands+1)` values, a pair (a, b)
/// for each (l, m ≥ 0) at index 2·(l(l+1)/2+m).
///
/// Where l = m, a is the value of Q_m^m (with √2 for m > 0) and b is 0; else Q_l^m = a·y·Q_{l-1}^m - b·Q_{l-2}^m, with
/// b = 0 where l = m+1. [`eval_f32`] is the loop over them.
pub fn recurrence_table(bands: u32) -> Vec<f32> {
    recurrence(bands).into_iter().flat_map(|(a, b)| [a as f32, b as f32]).collect()
}

/// Evaluates all functions of `bands` bands at the unit direction `d` in f32, as kernels do, from the table of
/// [`recurrence_table`]. Writes bands² values.
///
/// # Panics
/// Where `table` or `out` is shorter than `bands` asks for.
pub fn eval_f32(table: &[f32], bands: u32, d: [f32; 3], out: &mut [f32]) {
    let [x, y, z] = d;
    let bands = bands as usize;
    let (mut cos, mut sin) = (1.0, 0.0);
    for m in 0..bands {
        let (mut below, mut this) = (0.0, 0.0);
        for l in m..bands {
            let pair = 2 * (l * (l + 1) / 2 + m);
            let next = if l == m { table[pair] } else { table[pair] * y * this - table[pair + 1] * below };
            below = this;
            this = next;
            out[l * (l + 1) + m] = this * cos;
            if m > 0 {
                out[l * (l + 1) - m] = this * sin;
            }
        }
        let cos_before = cos;
        cos = cos * z - sin * x;
        sin = cos_before * x + sin * z;
    }
}

#[cfg(test)]
mod tests {
    use super::super::{gram_error, healpix};
    use super::*;

    /// Both poles, the axes, and directions off every symmetry.
    fn directions() -> Vec<DVec3> {
        let mut set = healpix::directions(3);
        set.extend([DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_Y, DVec3::new(1e-7, 1.0, -2e-7).normalize()]);
        set.extend((0..50).map(|i| {
            let i = f64::from(i);
            DVec3::new((1.3 * i).sin(), (2.1 * i + 0.4).sin(), (0.7 * i - 1.0).cos()).normalize()
        }));
        set
    }

    fn harmonics(bands: u32) -> SphericalHarmonics {
        SphericalHarmonics::new(bands).unwrap()
    }

    /// Exact for products of two functions below `bands`.
    fn product_rule(bands: usize) -> (Vec<DVec3>, Vec<f64>) {
        let azimuths = 2 * bands;
        let mut rule = (Vec::new(), Vec::new());
        for (y, w) in gauss_legendre(bands) {
            for k in 0..azimuths {
                let phi = 2.0 * PI * (k as f64 + 0.3) / azimuths as f64;
                let planar = (1.0 - y * y).sqrt();
                rule.0.push(DVec3::new(planar * phi.sin(), y, planar * phi.cos()));
                rule.1.push(w * 2.0 * PI / azimuths as f64);
            }
        }
        rule
    }

    /// The definition, by factorials and the unnormalised associated Legendre functions.
    fn by_definition(l: u32, m: i32, d: DVec3) -> f64 {
        let order = m.unsigned_abs();
        let (cos_theta, sin_theta) = (d.y, d.x.hypot(d.z));
        let mut this = (0..order).fold(1.0, |p, k| p * f64::from(2 * k + 1) * sin_theta);
        let mut below = 0.0;
        for k in order + 1..=l {
            let next =
                (f64::from(2 * k - 1) * cos_theta * this - f64::from(k + order - 1) * below) / f64::from(k - order);
            (below, this) = (this, next);
        }
        let ratio: f64 = (l - order + 1..=l + order).map(f64::from).product();
        let k = (f64::from(2 * l + 1) / (4.0 * PI) / ratio).sqrt();
        let phi = d.x.atan2(d.z) * f64::from(order);
        match m {
            0 => k * this,
            1.. => 2f64.sqrt() * k * this * phi.cos(),
            _ => 2f64.sqrt() * k * this * phi.sin(),
        }
    }

    #[test]
    fn first_bands_are_the_known_polynomials() {
        let mut values = vec![0.0; 9];
        for d in directions() {
            harmonics(3).eval(d, &mut values);
            let (one, two) = ((3.0 / (4.0 * PI)).sqrt(), (15.0 / (4.0 * PI)).sqrt());
            let expected = [
                (1.0 / (4.0 * PI)).sqrt(),
                one * d.x,
                one * d.y,
                one * d.z,
                two * d.x * d.z,
                two * d.x * d.y,
                (5.0 / (16.0 * PI)).sqrt() * (3.0 * d.y * d.y - 1.0),
                two * d.y * d.z,
                0.5 * two * (d.z * d.z - d.x * d.x),
            ];
            for k in 0..9 {
                // A few roundings of numbers near 1.
                assert!((values[k] - expected[k]).abs() < 1e-14, "{k} at {d}: {} {}", values[k], expected[k]);
            }
        }
    }

    #[test]
    fn many_bands_follow_the_definition_and_are_orthonormal() {
        let basis = harmonics(26);
        let mut values = vec![0.0; basis.count()];
        for d in directions() {
            basis.eval(d, &mut values);
            for l in 0..26 {
                for m in -(l as i32)..=l as i32 {
                    let (found, expected) = (values[SphericalHarmonics::index(l, m)], by_definition(l, m, d));
                    // Rounding grows with l in both recurrences; the functions reach about 2.
                    assert!((found - expected).abs() < 1e-11, "({l}, {m}) at {d}: {found} {expected}");
                }
            }
        }
        let (directions, weights) = product_rule(26);
        let error = gram_error(&basis, &directions, &weights);
        assert!(error < 1e-12, "{error}");
    }

    #[test]
    fn integrals_are_those_of_the_functions() {
        let basis = harmonics(5);
        let mut sums = vec![0.0; basis.count()];
        let mut values = vec![0.0; basis.count()];
        let (directions, weights) = product_rule(5);
        for (&d, w) in directions.iter().zip(weights) {
            basis.eval(d, &mut values);
            sums.iter_mut().zip(&values).for_each(|(s, v)| *s += w * v);
        }
        for (sum, integral) in sums.iter().zip(basis.integrals()) {
            assert!((sum - integral).abs() < 1e-13, "{sum} {integral}");
        }
    }

    #[test]
    fn f32_twin_agrees() {
        let bands = SphericalHarmonics::DEVICE_BANDS;
        let basis = harmonics(bands);
        let table = recurrence_table(bands);
        assert_eq!(table.len(), (bands * (bands + 1)) as usize);
        let (mut exact, mut found) = (vec![0.0; basis.count()], vec![0f32; basis.count()]);
        let (mut error, mut largest) = (0f64, 0f64);
        for d in directions() {
            basis.eval(d, &mut exact);
            eval_f32(&table, bands, d.as_vec3().to_array(), &mut found);
            for k in 0..basis.count() {
                largest = largest.max(exact[k].abs());
                error = error.max((exact[k] - f64::from(found[k])).abs());
            }
        }
        // Ten steps of rounding at 6e-8 and a direction rounded to f32, times slopes of up to l.
        assert!(error < 1e-5 * largest, "{error} of {largest}");
    }

    #[test]
    fn rotation_turns_the_function() {
        let basis = harmonics(10);
        let coefficients: Vec<[f64; 2]> =
            (0..basis.count()).map(|k| [(1.7 * k as f64).sin(), (0.9 * k as f64).cos()]).collect();
        let turn = DMat3::from_axis_angle(DVec3::new(0.3, -0.8, 0.5).normalize(), 1.1);
        let mirror = DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0));
        let mut values = vec![0.0; basis.count()];
        let mut at = |coefficients: &[[f64; 2]], d| {
            basis.eval(d, &mut values);
            let channel = |i: usize| coefficients.iter().zip(&values).map(|(c, y)| c[i] * y).sum::<f64>();
            [channel(0), channel(1)]
        };
        for rotation in [DMat3::IDENTITY, turn, DMat3::from_rotation_y(0.4), turn * mirror] {
            let turned = basis.rotate(&coefficients, rotation).unwrap();
            for d in directions() {
                let (found, expected) = (at(&turned, d), at(&coefficients, rotation.transpose() * d));
                for i in 0..2 {
                    // A hundred terms of order 1, each good to a few 1e-15.
                    assert!((found[i] - expected[i]).abs() < 1e-12, "{d}: {found:?} {expected:?}");
                }
            }
        }
    }

    #[test]
    fn what_cannot_be_is_refused() {
        assert_eq!(SphericalHarmonics::new(0), Err(BasisError::Bands { bands: 0 }));
        assert!(SphericalHarmonics::new(SphericalHarmonics::MAX_BANDS).is_ok());
        assert!(SphericalHarmonics::new(SphericalHarmonics::MAX_BANDS + 1).is_err());
        let error = BasisError::Length { expected: 4, found: 3 };
        assert_eq!(harmonics(2).coefficients(&[[0.0; 3]; 3]), Err(error.clone()));
        assert_eq!(harmonics(2).rotate(&[[0.0]; 3], DMat3::IDENTITY), Err(error));
    }
}
