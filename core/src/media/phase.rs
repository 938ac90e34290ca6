//! Phase functions: how light is spread in angle when it scatters.
//!
//! p(c) is normalised to ∫ p dω = 1, with c the cosine between the direction toward the light and the view ray's
//! direction; forward scattering is c = 1. Expanded in Legendre polynomials, p(c) = Σ (2l+1)/4π β_l P_l(c), so that
//! β_0 = 1 and convolution with p multiplies band l of a spherical function by β_l (Funk–Hecke).

use std::f64::consts::PI;
use std::sync::Arc;

use crate::basis::quadrature::gauss_legendre;

/// A phase function.
#[derive(Clone, Debug, PartialEq, Default)]
pub enum Phase {
    /// The same in every direction: 1/4π.
    #[default]
    Isotropic,
    /// Henyey–Greenstein with mean cosine g, |g| < 1: (1-g²) / (4π (1+g²-2gc)^{3/2}); β_l = gˡ.
    HenyeyGreenstein {
        /// Mean cosine.
        g: f64,
    },
    /// Small particles: 3/16π (1+c²); β_0 = 1, β_2 = 1/10.
    Rayleigh,
    /// `weight` of Henyey–Greenstein with `forward`, the rest with `backward`.
    DoubleHenyeyGreenstein {
        /// Mean cosine of the first lobe.
        forward: f64,
        /// Mean cosine of the second lobe.
        backward: f64,
        /// Share of the first lobe, 0 to 1.
        weight: f64,
    },
    /// Tabulated over the scattering angle.
    Table(Arc<PhaseTable>),
}

/// A phase function out of range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PhaseError {
    /// |g| reaches 1.
    #[error("anisotropy {0} is not within -1 to 1 (both excluded)")]
    Anisotropy(f64),
    /// The weight of a double lobe.
    #[error("weight {0} is not within 0 to 1")]
    Weight(f64),
    /// A table that is no phase function.
    #[error("phase table: {0}")]
    Table(String),
}

/// Phase values at [`PhaseTable::SIZE`] scattering angles spread evenly from 0 to π, linear in the angle between
/// them, normalised to ∫ p dω = 1.
#[derive(Clone, Debug, PartialEq)]
pub struct PhaseTable {
    values: Vec<f64>,
}

impl PhaseTable {
    /// Entries of a table, 0 and π included: about a tenth of a degree.
    pub const SIZE: usize = 2049;

    /// Resamples and normalises `values` given at `degrees` (strictly rising from 0 to 180).
    ///
    /// # Errors
    /// Fewer than two entries, lengths that differ, angles that do not rise from 0 to 180, values that are negative,
    /// not finite or zero everywhere.
    pub fn new(degrees: &[f64], values: &[f64]) -> Result<Self, PhaseError> {
        let bad = |text: String| Err(PhaseError::Table(text));
        if degrees.len() != values.len() || degrees.len() < 2 {
            return bad(format!("{} angles for {} values; at least two of each", degrees.len(), values.len()));
        }
        if degrees[0] != 0.0 || degrees[degrees.len() - 1] != 180.0 {
            return bad("angles must run from 0 (forward) to 180 degrees (backward)".into());
        }
        if !degrees.windows(2).all(|w| w[0] < w[1]) {
            return bad("angles must rise".into());
        }
        if let Some(v) = values.iter().find(|v| !(v.is_finite() && **v >= 0.0)) {
            return bad(format!("value {v} is not a finite number of at least 0"));
        }
        let mut segment = 0;
        let resampled = (0..Self::SIZE).map(|i| {
            let angle = 180.0 * i as f64 / (Self::SIZE - 1) as f64;
            while segment + 2 < degrees.len() && degrees[segment + 1] < angle {
                segment += 1;
            }
            let f = (angle - degrees[segment]) / (degrees[segment + 1] - degrees[segment]);
            values[segment] + (values[segment + 1] - values[segment]) * f.clamp(0.0, 1.0)
        });
        let mut table = Self { values: resampled.collect() };
        let total = table.moments(1)[0];
        if !(total.is_finite() && total > 0.0) {
            return bad("all values are zero".into());
        }
        table.values.iter_mut().for_each(|v| *v /= total);
        Ok(table)
    }

    /// The table itself, per steradian.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    fn eval(&self, c: f64) -> f64 {
        let at = c.clamp(-1.0, 1.0).acos() / PI * (Self::SIZE - 1) as f64;
        let i = (at as usize).min(Self::SIZE - 2);
        self.values[i] + (self.values[i + 1] - self.values[i]) * (at - i as f64)
    }

    /// 2π ∫ p(c) P_l(c) dc for l < `bands`, segment by segment.
    fn moments(&self, bands: u32) -> Vec<f64> {
        let h = PI / (Self::SIZE - 1) as f64;
        let rule = gauss_legendre(4);
        let mut sums = vec![0.0; bands as usize];
        for i in 0..Self::SIZE - 1 {
            for &(x, w) in &rule {
                let t = 0.5 * (x + 1.0);
                let theta = (i as f64 + t) * h;
                let p = self.values[i] + (self.values[i + 1] - self.values[i]) * t;
                let weight = 2.0 * PI * p * theta.sin() * 0.5 * w * h;
                sums.iter_mut().zip(legendre(theta.cos())).for_each(|(sum, value)| *sum += weight * value);
            }
        }
        sums
    }
}

fn henyey_greenstein(g: f64, c: f64) -> f64 {
    (1.0 - g * g) / (4.0 * PI * (1.0 + g * g - 2.0 * g * c).powf(1.5))
}

impl Phase {
    /// Value at cosine `c`, per steradian.
    pub fn eval(&self, c: f64) -> f64 {
        match self {
            Self::Isotropic => 1.0 / (4.0 * PI),
            Self::HenyeyGreenstein { g } => henyey_greenstein(*g, c),
            Self::Rayleigh => 3.0 / (16.0 * PI) * (1.0 + c * c),
            Self::DoubleHenyeyGreenstein { forward, backward, weight } => {
                weight * henyey_greenstein(*forward, c) + (1.0 - weight) * henyey_greenstein(*backward, c)
            }
            Self::Table(table) => table.eval(c),
        }
    }

    /// Legendre moments β_0 to β_{bands-1}.
    pub fn moments(&self, bands: u32) -> Vec<f64> {
        let each = |moment: &dyn Fn(i32) -> f64| (0..bands as i32).map(moment).collect();
        match self {
            Self::Isotropic => each(&|l| f64::from(u8::from(l == 0))),
            Self::HenyeyGreenstein { g } => each(&|l| g.powi(l)),
            Self::Rayleigh => each(&|l| [1.0, 0.0, 0.1].get(l as usize).copied().unwrap_or(0.0)),
            Self::DoubleHenyeyGreenstein { forward, backward, weight } => {
                each(&|l| weight * forward.powi(l) + (1.0 - weight) * backward.powi(l))
            }
            Self::Table(table) => table.moments(bands),
        }
    }

    /// How many bands (l = 0 .. n) the moments reach, where that is finite.
    pub fn reach(&self) -> Option<u32> {
        match self {
            Self::Isotropic => Some(1),
            Self::HenyeyGreenstein { g } if *g == 0.0 => Some(1),
            Self::Rayleigh => Some(3),
            _ => None,
        }
    }

    /// Whether light is scattered alike in every direction.
    pub fn is_isotropic(&self) -> bool {
        self.reach() == Some(1)
    }

    /// Checks every range.
    ///
    /// # Errors
    /// |g| of 1 or more, a weight outside 0 to 1.
    pub fn validate(&self) -> Result<(), PhaseError> {
        let lobe = |g: f64| if g.abs() < 1.0 { Ok(()) } else { Err(PhaseError::Anisotropy(g)) };
        match self {
            Self::HenyeyGreenstein { g } => lobe(*g),
            Self::DoubleHenyeyGreenstein { forward, backward, weight } => {
                lobe(*forward)?;
                lobe(*backward)?;
                if (0.0..=1.0).contains(weight) { Ok(()) } else { Err(PhaseError::Weight(*weight)) }
            }
            Self::Isotropic | Self::Rayleigh | Self::Table(_) => Ok(()),
        }
    }
}

/// Legendre polynomials P_0(x), P_1(x) and so on, by Bonnet's recursion.
pub(crate) fn legendre(x: f64) -> impl Iterator<Item = f64> {
    let (mut below, mut this) = (0.0, 1.0);
    (1..).map(move |n| {
        let (value, n) = (this, f64::from(n));
        (below, this) = (this, ((2.0 * n - 1.0) * x * this - (n - 1.0) * below) / n);
        value
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> Vec<Phase> {
        let degrees: Vec<f64> = (0..=180).map(f64::from).collect();
        let hg: Vec<f64> = degrees.iter().map(|d| 7.0 * henyey_greenstein(0.6, d.to_radians().cos())).collect();
        vec![
            Phase::Isotropic,
            Phase::HenyeyGreenstein { g: 0.8 },
            Phase::HenyeyGreenstein { g: -0.4 },
            Phase::Rayleigh,
            Phase::DoubleHenyeyGreenstein { forward: 0.7, backward: -0.3, weight: 0.8 },
            Phase::Table(Arc::new(PhaseTable::new(&degrees, &hg).unwrap())),
        ]
    }

    #[test]
    fn moments_are_the_legendre_projections() {
        // 400 Gauss points integrate the sharpest lobe here (g = 0.8) to 1e-12; the table is piecewise linear, so
        // its corners leave 1e-6.
        let rule = gauss_legendre(400);
        for phase in all() {
            let tolerance = if matches!(phase, Phase::Table(_)) { 2e-6 } else { 1e-11 };
            for (l, beta) in phase.moments(6).into_iter().enumerate() {
                let integral: f64 =
                    rule.iter().map(|&(c, w)| 2.0 * PI * w * phase.eval(c) * legendre(c).nth(l).unwrap()).sum();
                assert!((integral - beta).abs() < tolerance, "{phase:?} l={l}: {integral} against {beta}");
            }
            assert!((phase.moments(1)[0] - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_table_of_hg_is_hg() {
        let Some(table) = all().pop() else { unreachable!() };
        for i in 0..=100 {
            let c = -1.0 + 0.02 * f64::from(i);
            let exact = henyey_greenstein(0.6, c);
            // One-degree entries interpolated linearly across the lobe's curvature.
            assert!((table.eval(c) / exact - 1.0).abs() < 2e-3, "c = {c}");
        }
    }

    #[test]
    fn ranges_are_checked() {
        assert!(Phase::HenyeyGreenstein { g: 1.0 }.validate().is_err());
        assert!(Phase::HenyeyGreenstein { g: f64::NAN }.validate().is_err());
        assert!(PhaseTable::new(&[0.0, 90.0], &[1.0, 1.0]).is_err());
        assert!(PhaseTable::new(&[0.0, 180.0], &[0.0, 0.0]).is_err());
        assert!(PhaseTable::new(&[0.0, 180.0], &[1.0, -1.0]).is_err());
    }
}
