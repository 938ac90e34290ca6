//! `reduce` against its twin.

use airlight::device::Usage;
use airlight::reference::{self, ReduceInputs};
use airlight::stage::{Reduce, ReduceParams, Stage};
use libtest_mimic::Failed;

use super::case;
use crate::bench::{Bench, cuts};
use crate::fixtures::{DIMS, density, noise};
use crate::{Case, Record, Subject, tolerance};

const GIVES: &str = "means and maxima";

pub(crate) fn cases() -> Vec<Case> {
    // Cells along each axis, probes, margin, and whether a second field counts.
    let sets: [(&str, [u32; 3], u32, f32, bool); 8] = [
        ("one_cell", [1, 1, 1], 0, 0.0, false),
        ("fractions_of_voxels", [3, 2, 4], 0, 0.0, false),
        ("margin", [3, 2, 4], 0, 0.5, false),
        ("wide_margin", [4, 3, 5], 0, 1.5, false),
        ("two_fields", [3, 4, 2], 0, 0.0, true),
        ("finer_than_voxels", [15, 11, 16], 0, 0.5, false),
        ("one_probe", [3, 2, 4], 1, 0.0, false),
        ("probes", [5, 2, 3], 4, 0.0, false),
    ];
    let mut cases: Vec<_> = sets
        .into_iter()
        .map(|(name, cells, probes, margin, second)| {
            let side = |a: usize| DIMS[a] as f32 / cells[a] as f32;
            let params = ReduceParams::new(
                [DIMS.x, DIMS.y, DIMS.z, 0],
                [cells[0], cells[1], cells[2], probes],
                [side(0), side(1), side(2), margin],
            );
            case("reduce", name, GIVES, &tolerance::MEAN, move |subject, record| one(subject, record, params, second))
        })
        .collect();
    // Cells that reach past the box, as the march's occupancy has them.
    let params = ReduceParams::new([DIMS.x, DIMS.y, DIMS.z, 0], [4, 3, 5, 0], [2.0, 2.0, 2.0, 0.0]);
    let past = move |subject: &Subject, record: &mut Record| one(subject, record, params, true);
    cases.push(case("reduce", "blocks_past_the_box", GIVES, &tolerance::MEAN, past));
    cases
}

fn one(subject: &Subject, record: &mut Record, params: ReduceParams, second: bool) -> Result<(), Failed> {
    let field = density(DIMS, 11);
    // A second field that is dense where the first is empty.
    let other: Vec<f32> =
        noise(12, field.len()).iter().zip(&field).map(|(n, d)| if *d > 0.0 { 0.0 } else { *n }).collect();
    let mut bench = Bench::new(subject)?;
    let density = bench.scalars(DIMS.to_array(), &field)?;
    let second = second.then(|| bench.scalars(DIMS.to_array(), &other)).transpose()?;
    let cells = params.coarse[..3].iter().product::<u32>() as usize;
    let out = bench.room::<[f32; 2]>(cells, Usage::Work)?;
    let expected = reference::reduce(&params, &ReduceInputs { density: &field, other: second.map(|_| &other[..]) });
    let expected = |i: usize| expected.iter().skip(i).step_by(2).copied();
    record.each(&cuts(), |record, &cut| {
        bench.run(record, &Stage::Reduce(Reduce { params, density, other: second, out }), cut)?;
        let found = bench.read(out)?;
        let found = |i: usize| found.iter().map(move |v| v[i]);
        record.hold("means", found(0), expected(0));
        if params.coarse[3] > 0 {
            record.hold("probed maxima", found(1), expected(1));
        } else {
            // Nothing is computed, only picked.
            record.within(tolerance::EXACT, |record| record.hold("maxima", found(1), expected(1)));
        }
        Ok(())
    })
}
