//! The pinhole camera.

use glam::{DVec2, DVec3};

/// A pinhole camera. With f = norm(target - origin), r = norm(f × up), u = r × f and t = tan(fov/2), the ray through
/// (px, py) pixels from the top left corner is norm(f + r (2 px/W - 1) t W/H + u (1 - 2 py/H) t).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// The eye, metres.
    pub origin: DVec3,
    /// What the middle of the picture shows, metres.
    pub target: DVec3,
    /// The direction that is up in the picture.
    pub up: DVec3,
    /// Vertical field of view, degrees.
    pub fov: f64,
    /// Columns of the picture.
    pub width: u32,
    /// Rows of the picture.
    pub height: u32,
    /// Sub-pixel positions per pixel; a pixel is their mean.
    pub samples: u32,
}

/// A camera that makes no picture.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CameraError {
    /// No direction of view.
    #[error("camera origin {0} and target {1} do not give a direction; they must be finite and apart")]
    Direction(DVec3, DVec3),
    /// Up is along the view, or nothing.
    #[error("camera up {0} is zero, not finite or along the direction of view")]
    Up(DVec3),
    /// Field of view.
    #[error("camera fov {0}° is not above 0 and below 180")]
    Fov(f64),
    /// Size of the picture.
    #[error("picture of {width} × {height} pixels; each side must be from 1 to {max}", max = Camera::MAX_SIDE)]
    Size {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// Samples per pixel.
    #[error("{0} samples per pixel; from 1 to {max}", max = Camera::MAX_SAMPLES)]
    Samples(u32),
}

impl Camera {
    /// The longest side of a picture, in pixels.
    pub const MAX_SIDE: u32 = 16384;
    /// The most sub-pixel positions per pixel.
    pub const MAX_SAMPLES: u32 = 4096;

    /// Checks every range.
    ///
    /// # Errors
    /// The first value that makes no picture.
    pub fn validate(&self) -> Result<(), CameraError> {
        let forward = (self.target - self.origin).try_normalize();
        let Some(forward) = forward.filter(|_| self.origin.is_finite()) else {
            return Err(CameraError::Direction(self.origin, self.target));
        };
        let side = self.up.try_normalize().map(|up| forward.cross(up).length());
        if side.is_none_or(|s| s < 1e-9) {
            return Err(CameraError::Up(self.up));
        }
        if !(self.fov > 0.0 && self.fov < 180.0) {
            return Err(CameraError::Fov(self.fov));
        }
        let sides = 1..=Self::MAX_SIDE;
        if !(sides.contains(&self.width) && sides.contains(&self.height)) {
            return Err(CameraError::Size { width: self.width, height: self.height });
        }
        if !(1..=Self::MAX_SAMPLES).contains(&self.samples) {
            return Err(CameraError::Samples(self.samples));
        }
        Ok(())
    }

    /// The axes f, r·t·W/H and u·t, so that the ray through picture coordinates (a, b) ∈ [-1, 1]² is
    /// norm(f + a r + b u), b upward.
    pub fn axes(&self) -> [DVec3; 3] {
        let f = (self.target - self.origin).normalize();
        let r = f.cross(self.up.normalize()).normalize();
        let u = r.cross(f);
        let t = (0.5 * self.fov.to_radians()).tan();
        [f, r * (t * f64::from(self.width) / f64::from(self.height)), u * t]
    }

    /// Unit direction of the ray through (px, py) pixels from the top left corner.
    pub fn direction(&self, px: f64, py: f64) -> DVec3 {
        let [f, r, u] = self.axes();
        let a = 2.0 * px / f64::from(self.width) - 1.0;
        let b = 1.0 - 2.0 * py / f64::from(self.height);
        (f + a * r + b * u).normalize()
    }

    /// The sub-pixel positions in [0, 1)²: for n samples the lattice ((k+½)/n, (ka mod n + ½)/n), with a coprime to n
    /// nearest to n divided by the golden ratio. Its mean is the pixel's centre exactly; n = 1 is the centre.
    pub fn subpixels(&self) -> Vec<DVec2> {
        let n = self.samples;
        let ideal = f64::from(n) / 1.618_033_988_749_895;
        let coprime = |a: u32| {
            let (mut x, mut y) = (a, n);
            while y != 0 {
                (x, y) = (y, x % y);
            }
            x == 1
        };
        let a = (1..=n)
            .filter(|&a| coprime(a))
            .min_by(|&p, &q| (f64::from(p) - ideal).abs().total_cmp(&(f64::from(q) - ideal).abs()));
        let a = u64::from(a.unwrap_or(1));
        (0..u64::from(n)).map(|k| (DVec2::new(k as f64, (k * a % u64::from(n)) as f64) + 0.5) / f64::from(n)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera {
            origin: DVec3::new(1.7, 1.25, 1.9),
            target: DVec3::new(0.05, 0.35, 0.0),
            up: DVec3::Y,
            fov: 30.0,
            width: 160,
            height: 120,
            samples: 1,
        }
    }

    #[test]
    fn the_middle_looks_at_the_target_and_up_is_up() {
        let c = camera();
        let f = (c.target - c.origin).normalize();
        assert!((c.direction(80.0, 60.0) - f).length() < 1e-12);
        assert!(c.direction(80.0, 0.0).y > c.direction(80.0, 120.0).y);
        let cos = c.direction(80.0, 0.0).dot(c.direction(80.0, 120.0));
        assert!((cos.acos().to_degrees() - 30.0).abs() < 1e-9, "fov is vertical");
    }

    #[test]
    fn subpixels_are_centred_and_distinct() {
        for samples in 1..70 {
            let positions = Camera { samples, ..camera() }.subpixels();
            let mean = positions.iter().copied().sum::<DVec2>() / f64::from(samples);
            assert!((mean - 0.5).length() < 1e-12, "{samples}");
            for (i, p) in positions.iter().enumerate() {
                assert!(p.min_element() > 0.0 && p.max_element() < 1.0);
                assert!(positions[..i].iter().all(|q| p.distance(*q) > 1e-6));
            }
        }
    }

    #[test]
    fn degenerate_cameras_are_refused() {
        let c = camera();
        assert!(c.validate().is_ok());
        assert!(Camera { target: c.origin, ..c }.validate().is_err());
        assert!(Camera { up: c.target - c.origin, ..c }.validate().is_err());
        assert!(Camera { up: DVec3::ZERO, ..c }.validate().is_err());
        assert!(Camera { origin: DVec3::NAN, ..c }.validate().is_err());
        assert!(Camera { fov: 180.0, ..c }.validate().is_err());
        assert!(Camera { width: 0, ..c }.validate().is_err());
        assert!(Camera { samples: 0, ..c }.validate().is_err());
    }
}
