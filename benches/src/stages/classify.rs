//! Values that are classified.

use airlight::device::{DeviceError, Usage};
use airlight::glam::Vec3;
use airlight::media::{ControlPoint, TransferFunction};
use airlight::stage::{Classify, ClassifyParams, ControlRecord, Stage, classify_kind};

use super::Rig;
use crate::{DIMS, lattice};

/// Control points.
const POINTS: u32 = 8;

impl Rig {
    /// `classify` of the density into what scatters. Its elements are the voxels.
    pub(super) fn classify(&mut self) -> Result<(Stage, u64), DeviceError> {
        let point = |n: u32| {
            let place = n as f32 / POINTS as f32;
            ControlPoint { albedo: Vec3::new(1.0, place, 0.5), ..ControlPoint::new(place, 2.0 * place) }
        };
        let function = TransferFunction::new((0..POINTS).map(point).collect()).expect("ascending");
        let stage = Classify {
            params: ClassifyParams::new(DIMS.to_array(), classify_kind::SCATTERING, POINTS),
            values: self.density,
            points: self.fill(&ControlRecord::of(&function, classify_kind::SCATTERING))?,
            out: self.make(4 * lattice().voxels(), Usage::Work)?,
        };
        Ok((Stage::Classify(stage), lattice().voxels()))
    }
}
