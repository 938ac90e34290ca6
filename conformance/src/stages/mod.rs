//! Each stage against its twin.

mod accumulate;
mod classify;
mod coarsen;
mod evaluate;
mod illuminate;
mod inject;
mod march;
mod march_cases;
mod obstruct;
mod path;
mod photon_cases;
mod photons;
mod project;
mod propagate;
pub(crate) mod reconstruct;
mod reduce;
mod relight;
mod shade;
mod shadow;
mod sweep;
mod trace;
mod upsample;

use libtest_mimic::Failed;

use crate::bench::cuts;
use crate::{Case, Record, Subject, Tolerance};

pub(crate) fn cases() -> Vec<Case> {
    let all = [
        inject::cases(),
        reduce::cases(),
        project::cases(),
        propagate::cases(),
        relight::cases(),
        march_cases::cases(),
        trace::cases(),
        shade::cases(),
        shadow::cases(),
        upsample::cases(),
        accumulate::cases(),
        coarsen::cases(),
        illuminate::cases(),
        sweep::cases(),
        obstruct::cases(),
        path::cases(),
        evaluate::cases(),
        reconstruct::cases(),
        classify::cases(),
        photons::cases(),
    ];
    all.into_iter().flatten().collect()
}

/// A case of a stage, whose work is cut in every way, and whose tolerance is that of the device's filter.
fn case(
    stage: &str,
    name: &str,
    gives: &str,
    tolerance: &'static Tolerance,
    run: impl Fn(&Subject, &mut Record) -> Result<(), Failed> + Send + Sync + 'static,
) -> Case {
    let checks = format!("{stage} gives the {gives} of its twin in f64 ({}).", name.replace('_', " "));
    let filtered = move |subject: &Subject, record: &mut Record| {
        record.within(tolerance.filtered(record.info()), |record| run(subject, record))
    };
    Case::new(format!("stage::{stage}::{name}"), checks, filtered).within(tolerance).varies(&cuts())
}
