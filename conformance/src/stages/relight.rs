//! `relight` against its twin.

use airlight::device::Usage;
use airlight::reference::{self, RelightInputs};
use airlight::stage::{Relight, RelightParams, Stage};
use libtest_mimic::Failed;

use super::case;
use crate::bench::{Bench, cuts};
use crate::fixtures::noise;
use crate::{Case, Record, Subject, tolerance};

pub(crate) fn cases() -> Vec<Case> {
    // Coefficients, channels of a record, layers, and whether the medium emits.
    let sets = [
        ("one_coefficient", 1, 1, 1, false),
        ("planes", 9, 3, 9, false),
        ("grey_planes", 4, 1, 1, false),
        ("nine_coefficients", 9, 1, 1, false),
        ("colored_records", 16, 3, 1, false),
        ("emission", 9, 1, 1, true),
        ("layers", 9, 3, 9, false),
        ("grey_layers", 4, 1, 4, false),
        ("layers_with_emission", 36, 3, 36, true),
        ("ten_bands", 100, 3, 100, true),
    ];
    let made = |(name, coefficients, channels, layers, emits): (&str, u32, u32, u32, bool)| {
        let params = RelightParams {
            cells: 301,
            coefficients,
            channels,
            layers,
            emission_coefficients: if emits { layers } else { 0 },
            emission_weight: 0.28,
            planar: name.contains("planes").into(),
            unused: 0,
        };
        case("relight", name, "radiance J", &tolerance::STAGE, move |subject, record| one(subject, record, params))
    };
    sets.into_iter().map(made).collect()
}

fn one(subject: &Subject, record: &mut Record, params: RelightParams) -> Result<(), Failed> {
    let cells = params.cells as usize;
    let signed = |seed: u64, n: u32| -> Vec<f32> { noise(seed, n as usize).iter().map(|v| v - 0.3).collect() };
    let records = signed(21, params.cells * params.coefficients * params.channels);
    let emission = signed(22, params.cells * params.emission_coefficients * 3);
    let light: Vec<[f32; 4]> =
        signed(23, params.coefficients * 3).chunks_exact(3).map(|c| [c[0], c[1], c[2], 0.0]).collect();
    let mut bench = Bench::new(subject)?;
    let stage = Relight {
        params,
        records: bench.buf(&records)?,
        emission_records: (!emission.is_empty()).then(|| bench.buf(&emission)).transpose()?,
        light: bench.buf(&light)?,
        out: bench.room(cells * params.layers as usize, Usage::Work)?,
    };
    let out = stage.out;
    let inputs = RelightInputs { records: &records, emission_records: &emission, light: &light };
    let expected = reference::relight(&params, &inputs);
    // The fourth value of a texel is unused.
    let expected: Vec<f64> = expected.chunks_exact(4).flat_map(|v| [v[0], v[1], v[2]]).collect();
    let stage = Stage::Relight(stage);
    record.each(&cuts(), |record, &cut| {
        bench.run(record, &stage, cut)?;
        let found: Vec<[f32; 4]> = bench.read(out)?;
        record.hold("J", found.iter().flat_map(|v| [v[0], v[1], v[2]]), expected.iter().copied());
        Ok(())
    })
}
