//! Kernels in OpenCL C that work on packets agree with their twins in f64 whatever number of lanes they are built with: scalars and
//! vectors of eight here, and what suits the device in the suite, on the first OpenCL device. Without one the test says that it was skipped, or fails where
//! `AIRLIGHT_REQUIRE` names `opencl`.

use airlight::device::Device;
use airlight_conformance::{Subject, cases, listed};
use airlight_opencl::{Lanes, OpenclDevice};

/// Between them they take the branches that packets and scalars write differently.
const CASES: [&str; 23] = [
    "stage::reduce::two_fields",
    "stage::reduce::probes",
    "stage::coarsen::own_emission",
    "stage::coarsen::own_scattering",
    "stage::inject::gaussians_rotated",
    "stage::project::toward_eye_with_emission",
    "stage::propagate::short_characteristics_special_places",
    "stage::propagate::short_characteristics_wide_faces",
    "stage::propagate::metric_sheared",
    "stage::relight::layers_with_emission",
    "stage::trace::room",
    "stage::sweep::everything_between_surfaces",
    "stage::sweep::colored_scattering",
    "stage::evaluate::nine_moments",
    "stage::reconstruct::one_moment",
    "stage::reconstruct::layers_of_channels",
    "stage::classify::seen",
    "stage::march::everything",
    "stage::accumulate::eye_aside",
    "stage::accumulate::rims_moved",
    "stage::upsample::half_size_rims",
    "stage::upsample::quarter_size",
    "stage::upsample::quarter_size_normals",
];

#[test]
fn packets_of_few_lanes_agree_with_their_twins() {
    if let Err(reason) = OpenclDevice::with_lanes(0, Lanes::One) {
        assert!(!listed("AIRLIGHT_REQUIRE").iter().any(|id| id == "opencl"), "opencl is required: {reason}");
        eprintln!("SKIPPED, because opencl has no device: {reason}");
        return;
    }
    for lanes in [Lanes::One, Lanes::Eight] {
        let subject = Subject::new(format!("opencl with {lanes:?}"), move || {
            let device = OpenclDevice::with_lanes(0, lanes).map_err(|reason| reason.to_string())?;
            Ok(Box::new(device) as Box<dyn Device>)
        });
        let chosen: Vec<_> = cases().into_iter().filter(|case| CASES.contains(&case.name())).collect();
        assert_eq!(chosen.len(), CASES.len(), "a case has another name now");
        for case in &chosen {
            if let Err(failed) = case.run(&subject).verdict() {
                panic!("{}, {}: {}", subject.name(), case.name(), failed.message().unwrap_or("failed"));
            }
        }
    }
}
