//! `classify` against its twin.

use airlight::device::Usage;
use airlight::glam::{UVec3, Vec3};
use airlight::media::{ControlPoint, TransferFunction};
use airlight::reference::{self, ClassifyInputs};
use airlight::stage::{Classify, ClassifyParams, ControlRecord, Stage, classify_kind};
use libtest_mimic::Failed;

use super::case;
use crate::bench::{Bench, cuts};
use crate::fixtures::noise;
use crate::{Case, Record, Subject, tolerance};

/// Slices of two packs, the second of which reaches past them.
const VOXELS: UVec3 = UVec3::new(13, 7, 6);

pub(crate) fn cases() -> Vec<Case> {
    let kinds = [
        ("density", classify_kind::DENSITY),
        ("reach", classify_kind::REACH),
        ("color", classify_kind::COLOR),
        ("scattering", classify_kind::SCATTERING),
        ("seen", classify_kind::SEEN),
    ];
    let of_kind = |(name, kind)| made(name, kind, || function(9));
    let mut cases: Vec<_> = kinds.into_iter().map(of_kind).collect();
    cases.push(made("one_point", classify_kind::SEEN, || function(1)));
    cases.push(made("256_points", classify_kind::SCATTERING, || function(256)));
    cases
}

/// Points from below the values' range to above it, of which two share a value.
fn function(count: usize) -> TransferFunction {
    let random = noise(61, 7 * count);
    let point = |(n, r): (usize, &[f32])| {
        let step = if n == 4 { 3 } else { n };
        ControlPoint {
            value: 4200.0 * (step as f32 + 0.7 * r[0] * f32::from(step == n && n != 3)) / count as f32 - 1100.0,
            density: 3.0 * r[1],
            albedo: Vec3::new(r[2], r[3], 1.0),
            emission: Vec3::new(0.0, 5.0 * r[4], r[5]),
            tint: Vec3::new(1.0, r[6], r[0]),
        }
    };
    TransferFunction::new(random.chunks_exact(7).enumerate().map(point).collect()).expect("ascending")
}

fn made(name: &'static str, kind: u32, function: fn() -> TransferFunction) -> Case {
    case("classify", name, "fields", &tolerance::CLASSIFY, move |subject, record| {
        one(subject, record, kind, &function())
    })
}

fn one(subject: &Subject, record: &mut Record, kind: u32, function: &TransferFunction) -> Result<(), Failed> {
    let dims = VOXELS.to_array();
    let mut values: Vec<f32> =
        noise(62, VOXELS.element_product() as usize).into_iter().map(|v| 5000.0 * v - 1500.0).collect();
    // Some on the points themselves.
    values.iter_mut().step_by(5).zip(function.points()).for_each(|(value, point)| *value = point.value);
    // Colours of their own in both places, whatever the kind takes.
    let mut points = ControlRecord::of(function, classify_kind::SEEN);
    if kind == classify_kind::REACH {
        points = ControlRecord::of(function, kind);
    }
    let params = ClassifyParams::new(dims, kind, points.len() as u32);
    let mut bench = Bench::new(subject)?;
    let stage = Classify {
        params,
        values: bench.scalars(dims, &values)?,
        points: bench.buf(&points)?,
        out: bench.room(values.len() * params.channels() as usize, Usage::Work)?,
    };
    let out = stage.out;
    let expected = reference::classify(&params, &ClassifyInputs { values: &values, points: &points });
    let stage = Stage::Classify(stage);
    record.each(&cuts(), |record, &cut| {
        bench.run(record, &stage, cut)?;
        let found: Vec<f32> = bench.read(out)?;
        record.hold("fields", found.iter().map(|&v| f64::from(v)), expected.iter().copied());
        Ok(())
    })
}
