//! Fog that thins out with height.

use glam::DVec3;

use super::{DensitySource, Lattice, Medium, MediumError, demand, demand_density};
use crate::Version;

/// Fog over a level plane: ρ = `density` · exp(-`falloff` · (y - `base`)) above y = `base`, and `density` below it, so
/// that it does not grow without bound where the ground lies deeper.
#[derive(Clone, Debug)]
pub struct HeightFog {
    lattice: Lattice,
    density: f64,
    falloff: f64,
    base: f64,
    version: Version,
}

impl HeightFog {
    /// Fog on `lattice`, with `falloff` in 1/m and `base` in metres.
    ///
    /// # Errors
    /// A density that is negative or above [`LARGEST`](super::LARGEST); a falloff that is negative or not finite; a
    /// base that is not finite.
    pub fn new(density: f64, falloff: f64, base: f64, lattice: Lattice) -> Result<Self, MediumError> {
        demand_density("density", density)?;
        demand("falloff", falloff, "a finite number of at least 0", falloff.is_finite() && falloff >= 0.0)?;
        demand("base", base, "finite", base.is_finite())?;
        Ok(Self { lattice, density, falloff, base, version: Version::fresh() })
    }

    /// Density at and below the base.
    pub fn density(&self) -> f64 {
        self.density
    }

    /// Falloff with height, 1/m.
    pub fn falloff(&self) -> f64 {
        self.falloff
    }

    /// Height of the base, metres.
    pub fn base(&self) -> f64 {
        self.base
    }

    /// The density at a point of the world.
    pub fn at(&self, p: DVec3) -> f64 {
        self.density * (-self.falloff * (p.y - self.base).max(0.0)).exp()
    }
}

impl Medium for HeightFog {
    fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    fn version(&self) -> Version {
        self.version
    }

    fn density_slice(&self, k: u32, out: &mut [f32]) {
        self.lattice.fill_slice(k, out, |p, _| self.at(p));
    }

    fn source(&self) -> DensitySource<'_> {
        DensitySource::HeightFog(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fog_thins_above_its_base_alone() {
        let lattice = Lattice::of_cells(8, DVec3::new(-1.0, 0.0, -2.0), DVec3::new(1.0, 4.0, 1.0)).unwrap();
        let fog = HeightFog::new(0.5, 2.0, 1.0, lattice).unwrap();
        let mut slice = vec![0.0; 32];
        fog.density_slice(3, &mut slice);
        for (n, &found) in slice.iter().enumerate() {
            let y = 0.25 + 0.5 * (n / 4) as f64;
            let expected = if y < 1.0 { 0.5 } else { 0.5 * (-2.0 * (y - 1.0)).exp() };
            assert!((f64::from(found) - expected).abs() < 1e-7, "{n}: {found} {expected}");
        }
    }

    #[test]
    fn numbers_out_of_range_are_named() {
        let lattice = || Lattice::of_cells(8, DVec3::ZERO, DVec3::ONE).unwrap();
        for (density, falloff, base, what) in [
            (-1.0, 1.0, 0.0, "density"),
            (1e16, 1.0, 0.0, "density"),
            (1.0, -1.0, 0.0, "falloff"),
            (1.0, f64::INFINITY, 0.0, "falloff"),
            (1.0, 1.0, f64::NAN, "base"),
        ] {
            let error = HeightFog::new(density, falloff, base, lattice()).unwrap_err();
            assert!(error.to_string().starts_with(what), "{error}");
        }
    }
}
