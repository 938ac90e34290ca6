//! A scene: everything a picture depends on, in memory.

mod background;
mod camera;
mod estimate;
mod film;
mod hierarchy;
mod mesh;
mod placement;
mod shapes;

use std::sync::Arc;

use glam::DVec3;

pub use background::{Background, BackgroundError};
pub use camera::{Camera, CameraError};
pub use estimate::{
    Content, Direct, Elimination, EnvironmentEstimate, Estimate, EstimateError, Interpolation, LightsEstimate, Opacity,
    Records, Scheme, Shadow, SurfaceShadow,
};
pub use film::Film;
pub use hierarchy::Hierarchy;
pub use mesh::{Material, Mesh, MeshError, Triangle};
pub use placement::{Placement, normal_map};
pub use shapes::Shape;

use crate::light::{Environment, EnvironmentError, Light};
use crate::media::{Medium, MediumError, Optics, OpticsError};

/// A scene.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The eye.
    pub camera: Camera,
    /// Where the density is.
    pub medium: Arc<dyn Medium>,
    /// What the medium does to light.
    pub optics: Optics,
    /// Distant light from all around.
    pub environment: Option<Environment>,
    /// What stands behind the medium, of as many pixels as the camera's picture.
    pub background: Option<Background>,
    /// Surfaces that end view rays, throw shadows and are lit through the medium.
    pub surfaces: Option<Arc<Mesh>>,
    /// Number of the picture within a sequence. What varies from picture to picture without anything moving depends on
    /// it alone.
    pub frame: u32,
    /// Analytic lights.
    pub lights: Vec<Light>,
    /// How in-scattered light is estimated.
    pub estimate: Estimate,
    /// How the view ray is marched.
    pub quality: Quality,
}

/// How the view ray is marched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// Length of a step, in units of [`Medium::voxel`]. A ray of length ℓ takes ceil(ℓ / step) equal steps.
    pub step: f64,
}

impl Default for Quality {
    fn default() -> Self {
        Self { step: 1.0 }
    }
}

/// Why a scene cannot be rendered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SceneError {
    /// The camera.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The medium.
    #[error(transparent)]
    Medium(#[from] MediumError),
    /// The optics.
    #[error(transparent)]
    Optics(#[from] OpticsError),
    /// The environment.
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
    /// The background.
    #[error("a background of {width} × {height} pixels behind a picture of {} × {}; both must be equal", camera.0, camera.1)]
    Background {
        /// Columns of the background.
        width: u32,
        /// Rows of the background.
        height: u32,
        /// Columns and rows of the picture.
        camera: (u32, u32),
    },
    /// An estimator's options.
    #[error(transparent)]
    Estimate(#[from] EstimateError),
    /// The eye.
    #[error("camera origin {0} is too far from the medium for 32-bit floats")]
    Eye(DVec3),
    /// The march.
    #[error("{0}")]
    Quality(String),
}

impl Scene {
    /// The most view steps along the diagonal of the medium's bounds. Kernels count steps in f32, which ends at 2²⁴;
    /// some bits are left for the place within a step.
    pub const MAX_STEPS: f64 = (1u32 << 20) as f64;

    /// Checks everything that can be checked without a device. Lights and media check themselves when made.
    ///
    /// # Errors
    /// The first thing that is out of range.
    pub fn validate(&self) -> Result<(), SceneError> {
        self.camera.validate()?;
        self.optics.validate()?;
        if let Some(environment) = &self.environment {
            environment.validate()?;
        }
        if let Some(background) = &self.background {
            let (width, height) = (background.width(), background.height());
            let camera = (self.camera.width, self.camera.height);
            if (width, height) != camera {
                return Err(SceneError::Background { width, height, camera });
            }
        }
        let lattice = self.medium.lattice();
        if !lattice.world_to_index().transform_point3(self.camera.origin).as_vec3().is_finite() {
            return Err(SceneError::Eye(self.camera.origin));
        }
        self.validate_step(self.quality.step)?;
        Ok(self.estimate.validate(&self.optics.phase)?)
    }

    fn validate_step(&self, step: f64) -> Result<(), SceneError> {
        // Below a thousandth of a voxel a ray through one voxel would take more steps than f32 can tell apart.
        if !(step.is_finite() && step >= 1e-3) {
            return Err(SceneError::Quality(format!("step {step} is not a finite number of at least 0.001 voxels")));
        }
        let metres = step * self.medium.voxel();
        if !(metres as f32).is_normal() {
            let what = format!("step {step:?} makes steps of {metres:e} m, which is out of range for 32-bit floats");
            return Err(SceneError::Quality(what));
        }
        let (min, max) = self.medium.lattice().world_bounds();
        let steps = (max - min).length() / metres;
        if steps > Self::MAX_STEPS {
            // Rounded up, so that it does as it is printed.
            let least = (step * steps / Self::MAX_STEPS * 1000.0).ceil() / 1000.0;
            return Err(SceneError::Quality(format!(
                "step {step} makes up to {steps:.0} steps on a ray through the medium; at most {} are marched, which \
                 a step of {least:.3} keeps to",
                Self::MAX_STEPS
            )));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::media::Homogeneous;

    fn fog(max: DVec3) -> Scene {
        Scene {
            camera: Camera {
                origin: DVec3::new(3.0, 2.0, 4.0),
                target: DVec3::ZERO,
                up: DVec3::Y,
                fov: 30.0,
                width: 8,
                height: 6,
                samples: 1,
            },
            medium: Arc::new(Homogeneous::new(1.0, DVec3::ZERO, max).unwrap()),
            optics: Optics::grey(1.0, 0.5),
            environment: None,
            background: None,
            surfaces: None,
            frame: 0,
            lights: Vec::new(),
            estimate: Estimate::default(),
            quality: Quality::default(),
        }
    }

    #[test]
    fn rays_of_more_steps_than_f32_counts_are_refused_and_the_least_step_is_said() {
        let mut scene = fog(DVec3::new(1e6, 1.0, 2.0));
        let Err(SceneError::Quality(text)) = scene.validate() else { panic!("64 million steps") };
        let least = text.rsplit("a step of ").next().and_then(|t| t.split(' ').next()).unwrap();
        scene.quality.step = least.parse().unwrap();
        assert_eq!(scene.validate(), Ok(()));
        scene.quality.step *= 0.99;
        assert!(scene.validate().is_err());
    }

    #[test]
    fn what_leaves_f32_is_refused() {
        let mut scene = fog(DVec3::new(1.0, 2.0, 3.0));
        assert_eq!(scene.validate(), Ok(()));
        scene.quality.step = 1e300;
        assert!(matches!(scene.validate(), Err(SceneError::Quality(_))));
        scene.quality.step = 1.0;
        scene.camera.origin.x = 1e39;
        assert_eq!(scene.validate(), Err(SceneError::Eye(scene.camera.origin)));
    }
}
