//! The suite proves itself: a device with one broken stage must fail.

use airlight::device::{Fault, Faulty};
use airlight::stage::Stage;
use airlight_conformance::{Case, Subject, cases};

/// A multiple that no rounding makes: a tenth of a per cent.
const SLIGHTLY: f32 = 1.001;

fn broken(stage: &'static str, fault: Fault) -> Subject {
    Subject::new(format!("{stage} {fault:?}"), move || {
        let device = airlight::open("cpu").map_err(|e| e.to_string())?;
        Ok(Box::new(Faulty::new(device, stage, fault)))
    })
}

fn group(prefix: &str) -> Vec<Case> {
    let found: Vec<_> = cases().into_iter().filter(|case| case.name().starts_with(prefix)).collect();
    assert!(!found.is_empty(), "no case is named {prefix}");
    found
}

#[test]
fn every_case_of_a_stage_notices_every_fault_of_it() {
    for stage in Stage::NAMES {
        for fault in [Fault::Skip, Fault::Scale(SLIGHTLY), Fault::Fail] {
            let subject = broken(stage, fault);
            for case in group(&format!("stage::{stage}::")) {
                assert!(case.run(&subject).is_err(), "{} passes with {stage} broken by {fault:?}", case.name());
            }
        }
    }
}

#[test]
fn whole_pictures_notice_too() {
    for stage in Stage::NAMES {
        for fault in [Fault::Skip, Fault::Fail, Fault::Scale(1.05)] {
            // Only whether a maximum is zero matters to a picture.
            if stage == "reduce" && matches!(fault, Fault::Scale(_)) {
                continue;
            }
            let subject = broken(stage, fault);
            let noticed = group("closed::thin_uniform_radiance").iter().all(|case| case.run(&subject).is_err());
            assert!(noticed, "closed forms pass with {stage} broken by {fault:?}");
        }
    }
}

#[test]
fn a_whole_device_passes_what_broken_ones_fail() {
    let whole = Subject::of_choice("cpu");
    for case in group("stage::").into_iter().chain(group("closed::thin_uniform_radiance")) {
        assert!(case.run(&whole).is_ok(), "{} fails", case.name());
    }
}
