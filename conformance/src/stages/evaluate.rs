//! `evaluate` against its twin.

use airlight::device::{Limits, Usage};
use airlight::reference::{self, EvaluateInputs};
use airlight::stage::{Evaluate, EvaluateParams, Stage};
use libtest_mimic::Failed;

use super::case;
use crate::bench::{Bench, cuts};
use crate::fixtures::noise;
use crate::frames::NARROW;
use crate::limits::sizes;
use crate::{Case, Record, Subject, check, tolerance};

pub(crate) fn cases() -> Vec<Case> {
    // Clusters, components, moments, functions, and whether moments are summed.
    let sets = [
        ("means_alone", 71, 0, 1, 48, false),
        ("one_pack", 70, 0, 4, 16, false),
        ("one_moment", 16, 4, 1, 176, false),
        ("two_packs", 37, 1, 4, 32, false),
        ("nine_moments", 15, 4, 9, 48, false),
        ("many_functions", 18, 3, 1, 2576, false),
        ("ten_bands", 24, 2, 100, 16, false),
        ("folded", 15, 4, 16, 48, true),
        ("folded_means", 71, 0, 9, 16, true),
        ("folded_many_functions", 15, 4, 4, 656, true),
        ("folded_ten_bands", 24, 2, 100, 16, true),
    ];
    let made = |(name, clusters, components, moments, functions, folded): (&str, u32, u32, u32, u32, bool)| {
        let params = EvaluateParams::new(clusters, components, moments, functions, folded);
        case("evaluate", name, "transformed light", &tolerance::MATRICES, move |subject, record| {
            one(subject, record, params)
        })
        .varies(&sizes())
    };
    sets.into_iter().map(made).collect()
}

fn one(subject: &Subject, record: &mut Record, params: EvaluateParams) -> Result<(), Failed> {
    let signed = |seed: u64, n: u32| -> Vec<f32> { noise(seed, n as usize).iter().map(|v| v - 0.3).collect() };
    let matrix = params.coefficients * params.functions;
    let matrices = signed(31, params.units * matrix);
    let light = signed(32, 3 * params.functions);
    let clusters = params.units / params.per_cluster;
    let views = if params.folded == 1 { signed(33, clusters * params.coefficients) } else { Vec::new() };
    let expected = reference::evaluate(&params, &EvaluateInputs { matrices: &matrices, light: &light, views: &views });
    // The fewest units that begin where every device can bind, in words of 4 bytes.
    let limit = 64 * 4 * u64::from(matrix.max(4 * params.outputs()));
    let bytes = 4 * matrices.len() as u64;
    check!(bytes > limit || 4 * expected.len() as u64 > limit, "{bytes} bytes need not be cut to {limit}");
    record.each(&sizes(), |record, &narrow| {
        let mut bench = Bench::new(subject)?;
        if narrow {
            bench.device.narrow(&Limits { binding_bytes: limit, ..NARROW });
        }
        let stage = Evaluate {
            params,
            matrices: bench.buf(&matrices)?,
            light: bench.buf(&light)?,
            views: (!views.is_empty()).then(|| bench.buf(&views)).transpose()?,
            out: bench.room((params.units * params.outputs()) as usize, Usage::Work)?,
        };
        let out = stage.out;
        let stage = Stage::Evaluate(stage);
        record.each(&cuts(), |record, &cut| {
            bench.run(record, &stage, cut)?;
            record.hold("light", bench.read(out)?.into_iter().flatten(), expected.iter().copied());
            Ok(())
        })
    })
}
