//! The fields of a medium whose values a device classifies. The values are uploaded once; each field has a table of its own, so
//! that what another transfer function leaves as it was is not made again.

use super::plan::Plan;
use crate::device::{Field, FieldFormat, FieldSpec};
use crate::media::{Classified, Medium, OpticsFields};
use crate::stage::{Classify, ClassifyParams, ControlRecord, Stage, classify_kind};

/// A medium's fields, where there are any.
pub(super) struct Fields {
    pub(super) density: Field,
    pub(super) scattering: Option<Field>,
    pub(super) emission: Option<Field>,
    pub(super) emission_color: Option<Field>,
    pub(super) seen: Option<Field>,
}

/// Plans them: what scatters and what shines where that is asked for.
pub(super) fn plan_classified<'a>(medium: &'a Classified, [scatters, emits]: [bool; 2], plan: &mut Plan<'a>) -> Fields {
    let (dims, voxels) = (medium.lattice().dims().to_array(), medium.lattice().voxels());
    let spec = |format| FieldSpec::dense(dims, 1, format);
    let version = medium.values_version();
    let values =
        plan.upload_field("values", spec(FieldFormat::Scalar), &version, move |k, out| medium.values_slice(k, out));
    let mut field = |slot: &str, kind| {
        let points = ControlRecord::of(medium.function(), kind);
        let params = ClassifyParams::new(dims, kind, points.len() as u32);
        let format = if params.channels() == 1 { FieldFormat::Scalar } else { FieldFormat::Rgba };
        let points = plan.table(&format!("{slot} points"), points);
        let out = plan.work(&format!("classified {slot}"), voxels.saturating_mul(params.channels().into()));
        plan.stage(Stage::Classify(Classify { params, values, points, out }));
        plan.publish(slot, out, spec(format))
    };
    let OpticsFields { scattering, emission, emission_color, seen } = medium.optics_fields();
    Fields {
        density: field("density", classify_kind::DENSITY),
        scattering: scattering.filter(|_| scatters).map(|_| field("scattering", classify_kind::SCATTERING)),
        emission: emission.filter(|_| emits).map(|_| field("emission density", classify_kind::REACH)),
        emission_color: emission_color.filter(|_| emits).map(|_| field("emission color", classify_kind::COLOR)),
        seen: seen.filter(|_| scatters).map(|_| field("seen", classify_kind::SEEN)),
    }
}
