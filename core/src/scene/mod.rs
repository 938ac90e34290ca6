//! A scene: everything a picture depends on, in memory.

mod background;
mod camera;
mod estimate;
mod film;
mod hierarchy;
mod mesh;
mod placement;
mod quality;
mod records;
mod shapes;
mod sun;
mod transfer;

use std::sync::Arc;

use glam::DVec3;

pub use background::{Background, BackgroundError};
pub use camera::{Camera, CameraError};
pub use estimate::{
    AllEstimate, Direct, EnvironmentEstimate, Estimate, EstimateError, LightsEstimate, Local, Opacity, Orders, Path,
    ScatteringEstimate, Scheme, Shadow, SurfaceShadow, Sweeps,
};
pub use film::Film;
pub use hierarchy::Hierarchy;
pub use mesh::{Material, Mesh, MeshError, Triangle};
pub use placement::{Placement, normal_map};
pub use quality::{Jitter, Precision, Quality};
pub use records::{Content, Elimination, ExtractSun, Interpolation, RecordBasis, Records, Solver};
pub use shapes::Shape;
pub use sun::{Extraction, Negative, Reason};
pub use transfer::{Deposit, LightBasis, Precompute, TransferEstimate, TransferSolver, TransferSource, ViewDependence};

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
    #[error("{what}")]
    Quality {
        /// The value of [`Quality`] that is out of range.
        key: &'static str,
        /// What is wrong with it, and what would be right.
        what: String,
    },
}

impl Scene {
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
        self.quality.validate(self.medium.as_ref(), self.camera.samples)?;
        if matches!(self.estimate.all, Some(AllEstimate::Path(_))) && self.quality.marches_apart() {
            let (key, what) = match self.quality.temporal {
                true => ("temporal", "pictures of a sequence are accumulated by the march, which `path` does without"),
                false => {
                    ("scale", "a small picture is made full by the march, which `path` does without; take a scale of 1")
                }
            };
            return Err(SceneError::Quality { key, what: what.into() });
        }
        self.estimate.validate(&self.optics.phase)?;
        if let Some(AllEstimate::Transfer(_)) = &self.estimate.all {
            self.transferable()?;
        }
        if let (Some(EnvironmentEstimate::Records(records)), Some(environment)) =
            (&self.estimate.environment, &self.environment)
            && records.extract_sun == ExtractSun::Always
            && environment.scale != glam::Vec3::ZERO
            && environment.split().is_none()
        {
            return Err(EstimateError::Sun(
                "asks for a sun, and no part of the environment within 10° stands out; leave extract_sun out",
            )
            .into());
        }
        Ok(())
    }
}

impl Scene {
    /// An error where a transfer does not bring all light.
    fn transferable(&self) -> Result<(), EstimateError> {
        let refuse = |text: &str| Err(EstimateError::Conflict(format!("`transfer` {text}")));
        if self.lights.iter().any(|light| !matches!(light, Light::Directional { .. })) {
            return refuse(
                "carries light from far away, and a point or spot light is near; take `records`, `opacity` and `sweeps`",
            );
        }
        if self.surfaces.is_some() {
            return refuse("does not know surfaces; take `records`, `opacity` and `sweeps`, or leave the surfaces out");
        }
        if self.optics.emits() {
            return refuse(
                "carries light from far away, and this medium shines; take `records` and `sweeps`, or set emission = 0",
            );
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::media::Homogeneous;

    pub(super) fn fog(max: DVec3) -> Scene {
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
        let Err(SceneError::Quality { key: "step", what: text }) = scene.validate() else { panic!("64 million steps") };
        let least = text.rsplit("a step of ").next().and_then(|t| t.split(' ').next()).unwrap();
        scene.quality.step = least.parse().unwrap();
        assert_eq!(scene.validate(), Ok(()));
        scene.quality.step *= 0.99;
        assert!(scene.validate().is_err());
    }

    #[test]
    fn qualities_out_of_range_are_refused_and_named() {
        let refused = |quality: Quality, samples: u32| {
            let mut scene = fog(DVec3::new(1.0, 2.0, 3.0));
            (scene.quality, scene.camera.samples) = (quality, samples);
            match scene.validate() {
                Err(SceneError::Quality { key, .. }) => Some(key),
                other => {
                    assert_eq!(other, Ok(()));
                    None
                }
            }
        };
        let of = Quality::default();
        for steps in [0, Quality::MAX_STEPS + 1, u32::MAX] {
            assert_eq!(refused(Quality { steps: Some(steps), ..of }, 1), Some("steps"));
        }
        assert_eq!(refused(Quality { steps: Some(1), ..of }, 1), None);
        for scale in [0, 3, 8] {
            assert_eq!(refused(Quality { scale, ..of }, 1), Some("scale"));
        }
        assert_eq!(refused(Quality { scale: 4, temporal: true, ..of }, 1), None);
        assert_eq!(refused(Quality { scale: 2, ..of }, 2), Some("scale"));
        assert_eq!(refused(Quality { temporal: true, ..of }, 2), None);
    }

    #[test]
    fn what_leaves_f32_is_refused() {
        let mut scene = fog(DVec3::new(1.0, 2.0, 3.0));
        assert_eq!(scene.validate(), Ok(()));
        scene.quality.step = 1e300;
        assert!(matches!(scene.validate(), Err(SceneError::Quality { key: "step", .. })));
        scene.quality.step = 1.0;
        scene.camera.origin.x = 1e39;
        assert_eq!(scene.validate(), Err(SceneError::Eye(scene.camera.origin)));
    }
}
