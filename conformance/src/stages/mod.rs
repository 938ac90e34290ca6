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
    let mut all: Vec<_> = all.into_iter().flatten().collect();
    let settled: Vec<_> = all.iter().filter(|case| SETTLED.contains(&case.name())).map(Case::settled).collect();
    all.extend(settled);
    all
}

/// Cases that are tried of devices that have settled as well: of each stage those that have most to do.
const SETTLED: [&str; 29] = [
    "stage::inject::gaussians_rotated",
    "stage::inject::noise_sheared",
    "stage::reduce::two_fields",
    "stage::project::emission",
    "stage::project::toward_eye_hg",
    "stage::propagate::short_characteristics_four_lights",
    "stage::propagate::published_nine_lights",
    "stage::relight::planes",
    "stage::relight::layers_with_emission",
    "stage::march::everything",
    "stage::march::several_by_maps",
    "stage::march::local_gloss",
    "stage::trace::room",
    "stage::shade::several",
    "stage::shadow::several",
    "stage::upsample::half_size_rims",
    "stage::accumulate::rims_moved",
    "stage::coarsen::colored_emission",
    "stage::illuminate::four_lights",
    "stage::sweep::everything",
    "stage::obstruct::few_cells",
    "stage::path::surfaces",
    "stage::path::table_and_fields",
    "stage::evaluate::nine_moments",
    "stage::evaluate::folded",
    "stage::reconstruct::a_view",
    "stage::reconstruct::layers",
    "stage::classify::color",
    "stage::photons::collision_and_field",
];

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_tried_of_devices_that_have_settled_is_there() {
        let all = cases();
        let mut found: Vec<_> = all.iter().filter_map(|case| case.name().strip_suffix("_settled")).collect();
        let mut expected = SETTLED.to_vec();
        found.sort_unstable();
        expected.sort_unstable();
        assert_eq!(found, expected);
    }
}
