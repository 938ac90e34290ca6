//! The suite proves itself: a device with one broken stage must fail. Each stage of each device is broken in turn, on
//! the devices that `AIRLIGHT_DEVICES` lists (`cpu` without it); one that `AIRLIGHT_REQUIRE` names and that cannot be
//! had is a failure, the others are skipped aloud.

use airlight::device::{Fault, Faulty};
use airlight::stage::Stage;
use airlight_conformance::{Case, Failed, Lender, Subject, arguments, cases, listed};
use libtest_mimic::{Completion, Trial};

/// A multiple that no rounding makes: a tenth of a per cent.
const SLIGHTLY: f32 = 1.001;

fn broken(devices: &Lender, stage: &'static str, fault: Fault) -> Subject {
    let devices = devices.clone();
    Subject::new(format!("{stage} {fault:?}"), move || Ok(Box::new(Faulty::new(devices.lend()?, stage, fault))))
}

/// Cases of a name. Those of devices that have settled do what others do, which are here, and forty runs more.
fn group(prefix: &str) -> Vec<Case> {
    let chosen = |case: &Case| case.name().starts_with(prefix) && !case.name().ends_with("_settled");
    let found: Vec<_> = cases().into_iter().filter(chosen).collect();
    assert!(!found.is_empty(), "no case is named {prefix}");
    found
}

/// Every one of `cases` must fail on `subject`; those that mean nothing on it are left out.
fn noticed(subject: &Subject, cases: Vec<Case>) -> Result<(), Failed> {
    for case in cases {
        let result = case.run(subject);
        if result.outcome.passed() {
            return Err(format!("{} passes with {}", case.name(), subject.name()).into());
        }
    }
    Ok(())
}

/// What a device must fail as soon as one of its stages is broken, and pass where none is.
fn proof(choice: &str) -> Vec<Trial> {
    // Pictures that all stages but one take part in, and those of that one.
    const PICTURES: &str = "closed::thin_uniform_radiance";
    const SHADOWS: &str = "closed::directional";
    const GAUSSIANS: &str = "pictures::gaussians_point";
    const FLOOR: &str = "surfaces::floor_under_a_lamp_in_fog";
    const FRAMES: &str = "frames::as_the_processor";
    const SCATTERING: &str = "scattering::energy_balance";
    const SWEPT: &str = "scattering::swept_records";
    const SEQUENCES: &str = "sequence::as_the_processor";
    const PATHS: &str = "paths::what_leaves_and_what_is_absorbed";
    const CLASSIFIED: &str = "closed::classified";
    const CREASES: &str = "rooms::creases";
    // Without a transfer made before, which the broken stage has no part in.
    const MATRICES: &str = "stage::reconstruct::of_evaluated_light";
    const FLOWN: &str = "transfer::solvers";
    let mut trials = Vec::new();
    let wanted = choice.to_owned();
    let devices = &Lender::new(move || airlight::open(&wanted).map_err(|e| e.to_string()));
    for stage in Stage::NAMES {
        for fault in [Fault::Skip, Fault::Scale(SLIGHTLY), Fault::Fail] {
            let subject = broken(devices, stage, fault);
            let name = format!("{choice}::every_case_of_a_stage_notices::{}", subject.name());
            // What is zero stays zero, however it is multiplied.
            let zero = move |case: &Case| {
                stage == "inject" && matches!(fault, Fault::Scale(_)) && case.name().ends_with("gaussians_none")
            };
            trials.push(Trial::test(name, move || {
                let cases = group(&format!("stage::{stage}::"));
                noticed(&subject, cases.into_iter().filter(|case| !zero(case)).collect())
            }));
        }
        let pictures = match stage {
            "propagate" => SHADOWS,
            "inject" => GAUSSIANS,
            "trace" | "shade" => FLOOR,
            "shadow" | "illuminate" | "obstruct" => FRAMES,
            "sweep" => SCATTERING,
            // Where nothing is extinct, a furnace is white too.
            "coarsen" => SWEPT,
            "accumulate" | "upsample" => SEQUENCES,
            "path" => PATHS,
            "evaluate" | "reconstruct" => MATRICES,
            "photons" => FLOWN,
            "classify" => CLASSIFIED,
            _ => PICTURES,
        };
        for fault in [Fault::Skip, Fault::Scale(1.05), Fault::Fail] {
            // Only whether a maximum is zero matters to a picture.
            if stage == "reduce" && matches!(fault, Fault::Scale(_)) {
                continue;
            }
            let subject = broken(devices, stage, fault);
            let name = format!("{choice}::whole_pictures_notice::{}", subject.name());
            trials.push(Trial::test(name, move || noticed(&subject, group(pictures))));
        }
    }
    let subject = broken(devices, "upsample", Fault::Blind("normals"));
    let name = format!("{choice}::whole_pictures_notice::{}", subject.name());
    trials.push(Trial::test(name, move || noticed(&subject, group(CREASES))));
    let whole = devices.clone();
    let whole = Subject::new(choice, move || whole.lend());
    trials.push(Trial::test(format!("{choice}::a_whole_device_passes_what_broken_ones_fail"), move || {
        let pictures = [
            PICTURES, SHADOWS, GAUSSIANS, FLOOR, FRAMES, SCATTERING, SWEPT, SEQUENCES, PATHS, CLASSIFIED, CREASES,
            MATRICES, FLOWN,
        ];
        for case in group("stage::").into_iter().chain(pictures.into_iter().flat_map(group)) {
            case.run(&whole).verdict()?;
        }
        Ok(())
    }));
    trials
}

fn main() {
    let (mut choices, required) = (listed("AIRLIGHT_DEVICES"), listed("AIRLIGHT_REQUIRE"));
    if choices.is_empty() {
        choices.push("cpu".to_owned());
    }
    choices.extend(required.iter().filter(|r| !choices.contains(r)).cloned().collect::<Vec<_>>());
    let trials = choices.iter().flat_map(|choice| match airlight::open(choice) {
        Ok(_) => proof(choice),
        Err(reason) => {
            let needed = required.contains(choice);
            eprintln!("{} {choice}: {reason}", if needed { "MISSING" } else { "SKIPPED" });
            let absent = move || if needed { Err(reason.into()) } else { Ok(Completion::ignored_with(reason)) };
            vec![Trial::ignorable_test(format!("{choice}::available"), absent)]
        }
    });
    libtest_mimic::run(&arguments(), trials.collect()).exit();
}
