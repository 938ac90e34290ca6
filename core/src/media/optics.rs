//! What a medium does to light.

use glam::Vec3;

use super::{LARGEST, Phase, PhaseError, in_range};

/// Optical properties that hold everywhere in a medium, per channel of linear RGB.
#[derive(Clone, Debug, PartialEq)]
pub struct Optics {
    /// Extinction coefficient per unit of density, in 1/m; not negative.
    pub extinction: Vec3,
    /// Scattering coefficient per unit of the density that scatters, relative to `extinction`: the single-scattering albedo
    /// where all of the density scatters; 0 to 1.
    pub albedo: Vec3,
    /// Emission coefficient per unit of emission density, in W m⁻³ sr⁻¹; not negative.
    pub emission: Vec3,
    /// Phase function.
    pub phase: Phase,
}

/// Optics that no medium can have.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OpticsError {
    /// Extinction is negative or not finite.
    #[error("extinction {0} is not a finite number of at least 0 and at most {max:e}", max = LARGEST)]
    Extinction(Vec3),
    /// Albedo leaves [0, 1].
    #[error("albedo {0} is not within 0 to 1")]
    Albedo(Vec3),
    /// Emission is negative or not finite.
    #[error("emission {0} is not a finite number of at least 0 and at most {max:e}", max = LARGEST)]
    Emission(Vec3),
    /// The phase function is out of range.
    #[error(transparent)]
    Phase(#[from] PhaseError),
}

impl Optics {
    /// Grey, isotropic, without emission.
    pub fn grey(extinction: f32, albedo: f32) -> Self {
        Self {
            extinction: Vec3::splat(extinction),
            albedo: Vec3::splat(albedo),
            emission: Vec3::ZERO,
            phase: Phase::Isotropic,
        }
    }

    /// Checks every range.
    ///
    /// # Errors
    /// The first property that is out of range.
    pub fn validate(&self) -> Result<(), OpticsError> {
        let not_negative = |v: Vec3| v.to_array().into_iter().all(in_range);
        if !not_negative(self.extinction) {
            return Err(OpticsError::Extinction(self.extinction));
        }
        if !(not_negative(self.albedo) && self.albedo.max_element() <= 1.0) {
            return Err(OpticsError::Albedo(self.albedo));
        }
        if !not_negative(self.emission) {
            return Err(OpticsError::Emission(self.emission));
        }
        Ok(self.phase.validate()?)
    }

    /// Whether one transmittance serves all three channels.
    pub fn is_grey(&self) -> bool {
        self.extinction.x == self.extinction.y && self.extinction.y == self.extinction.z
    }

    /// Whether the medium shines by itself.
    pub fn emits(&self) -> bool {
        self.emission != Vec3::ZERO
    }
}
