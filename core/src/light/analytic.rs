//! Directional, point and spot lights.

use glam::{DVec3, Vec3};

/// An analytic light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Parallel light.
    Directional {
        /// Unit vector from the scene toward the light.
        to_light: DVec3,
        /// Irradiance on a plane that faces the light, W m⁻².
        irradiance: Vec3,
    },
    /// Light from one point, alike in all directions, falling with 1/r².
    Point {
        /// Place in metres.
        position: DVec3,
        /// Radiant intensity, W sr⁻¹.
        intensity: Vec3,
    },
    /// A point light whose intensity falls linearly in the angle from the axis, from full at `beam` to none at `cutoff`.
    Spot {
        /// Place in metres.
        position: DVec3,
        /// Unit vector along which the light shines.
        axis: DVec3,
        /// Radiant intensity on the axis, W sr⁻¹.
        intensity: Vec3,
        /// Half angle of full intensity, radians.
        beam: f64,
        /// Half angle beyond which there is none, radians.
        cutoff: f64,
    },
}

/// A light out of range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LightError {
    /// No direction can be made of it.
    #[error("direction {0} has no length or is not finite")]
    Direction(DVec3),
    /// A place that is nowhere.
    #[error("position {0} is not finite")]
    Position(DVec3),
    /// Irradiance or intensity is negative or not finite.
    #[error("{what} {value} is not a finite number of at least 0")]
    Power {
        /// `irradiance` or `intensity`.
        what: &'static str,
        /// The value given.
        value: Vec3,
    },
    /// A cone that does not narrow from cutoff to beam.
    #[error(
        "spot angles: beam {beam}° and cutoff {cutoff}°; they must satisfy 0 ≤ beam ≤ cutoff ≤ 180, cutoff above 0"
    )]
    Cone {
        /// Half angle in degrees.
        beam: f64,
        /// Half angle in degrees.
        cutoff: f64,
    },
}

fn unit(v: DVec3) -> Result<DVec3, LightError> {
    v.try_normalize().ok_or(LightError::Direction(v))
}

fn power(what: &'static str, value: Vec3) -> Result<Vec3, LightError> {
    if value.is_finite() && value.min_element() >= 0.0 { Ok(value) } else { Err(LightError::Power { what, value }) }
}

fn place(p: DVec3) -> Result<DVec3, LightError> {
    if p.is_finite() { Ok(p) } else { Err(LightError::Position(p)) }
}

impl Light {
    /// Parallel light from the direction `to_light`, of any length.
    ///
    /// # Errors
    /// No direction; irradiance that is negative or not finite.
    pub fn directional(to_light: DVec3, irradiance: Vec3) -> Result<Self, LightError> {
        Ok(Self::Directional { to_light: unit(to_light)?, irradiance: power("irradiance", irradiance)? })
    }

    /// A point light.
    ///
    /// # Errors
    /// A position that is not finite; intensity that is negative or not finite.
    pub fn point(position: DVec3, intensity: Vec3) -> Result<Self, LightError> {
        Ok(Self::Point { position: place(position)?, intensity: power("intensity", intensity)? })
    }

    /// A spot light that shines from `position` toward `target`, with half angles in degrees.
    ///
    /// # Errors
    /// As [`Light::point`]; a target at the position; angles that do not satisfy 0 ≤ beam ≤ cutoff ≤ 180, cutoff > 0.
    pub fn spot(position: DVec3, target: DVec3, intensity: Vec3, beam: f64, cutoff: f64) -> Result<Self, LightError> {
        if !(0.0 <= beam && beam <= cutoff && cutoff <= 180.0 && cutoff > 0.0) {
            return Err(LightError::Cone { beam, cutoff });
        }
        Ok(Self::Spot {
            position: place(position)?,
            axis: unit(target - position)?,
            intensity: power("intensity", intensity)?,
            beam: beam.to_radians(),
            cutoff: cutoff.to_radians(),
        })
    }

    /// Irradiance or intensity.
    pub fn power(&self) -> Vec3 {
        match *self {
            Self::Directional { irradiance, .. } => irradiance,
            Self::Point { intensity, .. } | Self::Spot { intensity, .. } => intensity,
        }
    }

    /// Direction toward the light, distance to it (infinite for a directional light) and what arrives at `x` without
    /// a medium: irradiance in W m⁻² on a plane that faces the light, with 1/r² floored at 1/`floor`² (metres).
    pub fn at(&self, x: DVec3, floor: f64) -> (DVec3, f64, DVec3) {
        let from = |position: DVec3, intensity: DVec3| {
            let v = position - x;
            let r2 = v.length_squared();
            (v.try_normalize().unwrap_or(DVec3::Y), r2.sqrt(), intensity / r2.max(floor * floor))
        };
        match *self {
            Self::Directional { to_light, irradiance } => (to_light, f64::INFINITY, irradiance.as_dvec3()),
            Self::Point { position, intensity } => from(position, intensity.as_dvec3()),
            Self::Spot { position, axis, intensity, beam, cutoff } => {
                let (l, r, e) = from(position, intensity.as_dvec3());
                let angle = axis.dot(-l).clamp(-1.0, 1.0).acos();
                (l, r, e * spot_falloff(angle, beam, cutoff))
            }
        }
    }
}

/// 1 within `beam`, 0 beyond `cutoff`, linear in the angle between (radians).
fn spot_falloff(angle: f64, beam: f64, cutoff: f64) -> f64 {
    if angle <= beam {
        1.0
    } else if angle >= cutoff {
        0.0
    } else {
        (cutoff - angle) / (cutoff - beam)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spot_falls_linearly_in_the_angle() {
        let spot = Light::spot(DVec3::ZERO, DVec3::NEG_Y, Vec3::splat(4.0), 15.0, 20.0).unwrap();
        for (degrees, expected) in [(0.0f64, 4.0), (15.0, 4.0), (17.5, 2.0), (19.0, 0.8), (20.5, 0.0)] {
            let a = degrees.to_radians();
            let (l, r, e) = spot.at(2.0 * DVec3::new(a.sin(), -a.cos(), 0.0), 0.0);
            assert!((r - 2.0).abs() < 1e-12 && (l.length() - 1.0).abs() < 1e-12);
            assert!((e.x - expected / 4.0).abs() < 1e-9, "{degrees}°: {}", e.x);
        }
    }

    #[test]
    fn nonsense_is_refused() {
        assert!(Light::directional(DVec3::ZERO, Vec3::ONE).is_err());
        assert!(Light::point(DVec3::NAN, Vec3::ONE).is_err());
        assert!(Light::point(DVec3::ZERO, Vec3::new(1.0, -1.0, 1.0)).is_err());
        assert!(Light::spot(DVec3::ZERO, DVec3::ZERO, Vec3::ONE, 10.0, 20.0).is_err());
        assert!(Light::spot(DVec3::ZERO, DVec3::X, Vec3::ONE, 30.0, 20.0).is_err());
    }
}
