//! Distant light from all around, as a latitude–longitude picture of radiance.
//!
//! Row 0 is +Y. u = fract(atan2(dx, -dz)/2π), v = acos(dy)/π; texels are centred at (col+½)/width, (row+½)/height,
//! looked up bilinearly, wrapping in u and clamping in v. Integrals are of that bilinear function.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::sun::Content;
use crate::Version;

/// A picture of linear RGB, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width · height` values, columns fastest.
    pub texels: Vec<[f32; 3]>,
}

/// Clamps what no radiance can be: negative, infinite and not-a-number components become zero. Returns how many
/// texels had any.
pub fn clamp_texels(texels: &mut [[f32; 3]]) -> usize {
    let mut clamped = 0;
    for texel in texels {
        let before = *texel;
        for c in texel.iter_mut() {
            if !(c.is_finite() && *c >= 0.0) {
                *c = 0.0;
            }
        }
        // NaN differs from itself, so it counts too.
        clamped += usize::from(before != *texel);
    }
    clamped
}

/// An environment.
#[derive(Clone, Debug)]
pub struct Environment {
    /// The picture, and what is known about it once it was asked for. Copies share it.
    pub(super) content: Arc<Content>,
    /// Multiplies the picture, per channel.
    pub scale: Vec3,
    /// Degrees by which the environment is turned about +Y, from +Z toward +X.
    pub rotation: f64,
    /// Whether it is seen behind the medium.
    pub visible: bool,
}

/// An environment out of range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EnvironmentError {
    /// No texels, or not as many as width times height.
    #[error("an environment of {width} × {height} texels with {found} values")]
    Size {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Values given.
        found: usize,
    },
    /// A texel that is negative or not finite.
    #[error("radiance {value:?} at column {x}, row {y} is not finite and at least 0")]
    Texel {
        /// Column.
        x: u32,
        /// Row.
        y: u32,
        /// The value.
        value: [f32; 3],
    },
    /// Scale or rotation.
    #[error("{0}")]
    Parameter(String),
}

impl Environment {
    /// An environment of the picture, visible, neither scaled nor turned.
    ///
    /// # Errors
    /// A picture without texels or of another size than it says; texels that [`clamp_texels`] would clamp.
    pub fn new(image: Image) -> Result<Self, EnvironmentError> {
        let Image { width, height, ref texels } = image;
        if texels.is_empty() || u64::from(width) * u64::from(height) != texels.len() as u64 {
            return Err(EnvironmentError::Size { width, height, found: texels.len() });
        }
        if let Some(i) = texels.iter().position(|t| t.iter().any(|c| !(c.is_finite() && *c >= 0.0))) {
            let (x, y) = (i as u32 % width, i as u32 / width);
            return Err(EnvironmentError::Texel { x, y, value: texels[i] });
        }
        Ok(Self { content: Arc::new(Content::new(image)), scale: Vec3::ONE, rotation: 0.0, visible: true })
    }

    /// The same radiance from everywhere.
    ///
    /// # Errors
    /// Radiance that is negative or not finite.
    pub fn uniform(radiance: Vec3) -> Result<Self, EnvironmentError> {
        Self::new(Image { width: 1, height: 1, texels: vec![radiance.to_array()] })
    }

    /// Checks the public fields.
    ///
    /// # Errors
    /// A scale that is negative or not finite; a rotation that is not finite.
    pub fn validate(&self) -> Result<(), EnvironmentError> {
        if !(self.scale.is_finite() && self.scale.min_element() >= 0.0) {
            return Err(EnvironmentError::Parameter(format!(
                "environment scale {} is not a finite number of at least 0",
                self.scale
            )));
        }
        if !self.rotation.is_finite() {
            return Err(EnvironmentError::Parameter(format!("environment rotation {} is not finite", self.rotation)));
        }
        Ok(())
    }

    /// The picture, before scale and rotation.
    pub fn image(&self) -> &Image {
        &self.content.image
    }

    /// Identity of the picture; scale and rotation are not part of it.
    pub fn version(&self) -> Version {
        self.content.version
    }

    /// Radiance from the unit direction `d` (pointing away from the scene), W m⁻² sr⁻¹.
    pub fn radiance(&self, d: DVec3) -> DVec3 {
        let image = self.image();
        let (w, h) = (i64::from(image.width), i64::from(image.height));
        let u = (d.x.atan2(-d.z) / (2.0 * PI) + self.rotation / 360.0).rem_euclid(1.0);
        let v = d.y.clamp(-1.0, 1.0).acos() / PI;
        let (x, y) = (u * w as f64 - 0.5, v * h as f64 - 0.5);
        let (x0, y0) = (x.floor(), y.floor());
        let texel = |i: i64, j: i64| {
            let t = image.texels[(j.clamp(0, h - 1) * w + i.rem_euclid(w)) as usize];
            Vec3::from_array(t).as_dvec3()
        };
        let (i, j) = (x0 as i64, y0 as i64);
        let top = texel(i, j).lerp(texel(i + 1, j), x - x0);
        let bottom = texel(i, j + 1).lerp(texel(i + 1, j + 1), x - x0);
        top.lerp(bottom, y - y0) * self.scale.as_dvec3()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn four_columns() -> Environment {
        let texels = (0..8).map(|i| [i as f32, 0.0, 1.0]).collect();
        Environment::new(Image { width: 4, height: 2, texels }).unwrap()
    }

    #[test]
    fn axes_fall_where_the_convention_says() {
        let env = four_columns();
        // u = 1/4 is +X: between columns 0 and 1 (centres 1/8 and 3/8); v = 1/2 is between rows 0 and 1.
        for (d, expected) in [(DVec3::X, 2.5), (DVec3::Z, 3.5), (DVec3::NEG_X, 4.5), (DVec3::NEG_Z, 3.5)] {
            assert!((env.radiance(d).x - expected).abs() < 1e-9, "{d}: {}", env.radiance(d).x);
        }
        assert!(env.radiance(DVec3::new(0.1, 1.0, 0.0).normalize()).x < 4.0, "+Y is row 0");
    }

    #[test]
    fn rotation_takes_plus_z_to_plus_x() {
        let (plain, mut turned) = (four_columns(), four_columns());
        turned.rotation = 90.0;
        assert!((turned.radiance(DVec3::X) - plain.radiance(DVec3::Z)).length() < 1e-9);
        assert!((turned.radiance(DVec3::NEG_Z) - plain.radiance(DVec3::X)).length() < 1e-9);
    }

    #[test]
    fn impossible_texels_are_counted_and_clamped() {
        let mut texels = vec![[1.0, 2.0, 3.0], [-1.0, f32::NAN, 3.0], [0.0, f32::INFINITY, 0.0]];
        assert_eq!(clamp_texels(&mut texels), 2);
        assert_eq!(texels, [[1.0, 2.0, 3.0], [0.0, 0.0, 3.0], [0.0, 0.0, 0.0]]);
    }
}
