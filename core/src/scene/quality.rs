//! How the view ray is marched.

use super::SceneError;
use crate::media::Medium;

/// How the view ray is marched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// Length of a step, in units of [`Medium::voxel`]. A ray of length ℓ takes ceil(ℓ / step) equal steps.
    pub step: f64,
    /// Steps of every view ray that meets the box, in place of `step`, which other rays still keep to.
    pub steps: Option<u32>,
    /// Where the samples of a view ray lie within its steps.
    pub jitter: Jitter,
    /// Pixels of the picture along each side of a pixel that is marched: 1, 2 or 4. The picture is made from the smaller
    /// one along the edges of what stands behind the medium.
    pub scale: u32,
    /// Whether pictures of a sequence are accumulated. One that shows what the last one showed, under another
    /// [`Scene::frame`](super::Scene::frame), adds to a plain mean; where something moved, the last ones are followed to
    /// where they are now, and forgotten the faster, the more changed.
    pub temporal: bool,
    /// What the densities of grids are held in on the device.
    pub density: Precision,
}

/// What numbers are held in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// 32-bit floats.
    #[default]
    F32,
    /// 16-bit floats ([`FieldFormat::Half`](crate::device::FieldFormat::Half)), rounded to 11 bits: half the memory. Only of
    /// densities that the host writes and whose bound it knows ([`Medium::density_bound`]); what devices make themselves, and
    /// colours, stay as they are.
    F16,
}

/// Where the samples of a view ray lie within its steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Jitter {
    /// In their middles.
    #[default]
    None,
    /// At a place that differs from pixel to pixel by blue noise, and from picture to picture by the golden ratio
    /// ([`blue_noise`](crate::blue_noise)).
    BlueNoise,
}

impl Default for Quality {
    fn default() -> Self {
        Self { step: 1.0, steps: None, jitter: Jitter::None, scale: 1, temporal: false, density: Precision::F32 }
    }
}

impl Quality {
    /// The most view steps along the diagonal of the medium's bounds. Kernels count steps in f32, which ends at 2²⁴;
    /// some bits are left for the place within a step.
    pub const MAX_STEPS: u32 = 1 << 20;

    /// Whether the march makes a picture of the medium alone, from which another stage makes the film.
    pub fn marches_apart(&self) -> bool {
        self.scale > 1 || self.temporal
    }

    /// Checks every range, for pictures of so many samples a pixel.
    pub(super) fn validate(&self, medium: &dyn Medium, samples: u32) -> Result<(), SceneError> {
        let wrong = |key, what: String| Err(SceneError::Quality { key, what });
        if let Some(steps) = self.steps
            && !(1..=Self::MAX_STEPS).contains(&steps)
        {
            return wrong("steps", format!("{steps} steps a ray; from 1 to {}", Self::MAX_STEPS));
        }
        if ![1, 2, 4].contains(&self.scale) {
            return wrong("scale", format!("a scale of {}; 1, 2 or 4", self.scale));
        }
        if self.scale > 1 && samples > 1 {
            let what = format!(
                "a scale of {} marches one ray for several pixels, and {samples} samples per pixel are wanted; take 1 \
                 sample, or a scale of 1",
                self.scale
            );
            return wrong("scale", what);
        }
        self.validate_step(medium)
    }

    fn validate_step(&self, medium: &dyn Medium) -> Result<(), SceneError> {
        let wrong = |what: String| Err(SceneError::Quality { key: "step", what });
        let step = self.step;
        // Below a thousandth of a voxel a ray through one voxel would take more steps than f32 can tell apart.
        if !(step.is_finite() && step >= 1e-3) {
            return wrong(format!("step {step} is not a finite number of at least 0.001 voxels"));
        }
        let metres = step * medium.voxel();
        if !(metres as f32).is_normal() {
            return wrong(format!(
                "step {step:?} makes steps of {metres:e} m, which is out of range for 32-bit floats"
            ));
        }
        let (min, max) = medium.lattice().world_bounds();
        let (steps, most) = ((max - min).length() / metres, f64::from(Self::MAX_STEPS));
        if steps > most {
            // Rounded up, so that it does as it is printed.
            let least = (step * steps / most * 1000.0).ceil() / 1000.0;
            return wrong(format!(
                "step {step} makes up to {steps:.0} steps on a ray through the medium; at most {most} are marched, which \
                 a step of {least:.3} keeps to"
            ));
        }
        Ok(())
    }
}
