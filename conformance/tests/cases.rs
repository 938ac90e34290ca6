//! Cases, and what they book.

use airlight_conformance::{
    Axis, Case, Need, Outcome, Record, Score, Sidecar, Subject, cases, tolerance, trials, try_all,
};
use libtest_mimic::{Arguments, Failed};

fn cpu() -> Subject {
    Subject::of_choice("cpu")
}

/// The result of a case that is held to a hundredth (relative L2) and a tenth (of the peak).
fn tried(run: impl Fn(&Subject, &mut Record) -> Result<(), Failed> + Send + Sync + 'static) -> Sidecar {
    static TOLERANCE: airlight_conformance::Tolerance =
        airlight_conformance::Tolerance { name: "MINE", relative_l2: 0.01, peak: 0.1, reason: "A trial." };
    Case::new("mine::case", "A trial.", run).within(&TOLERANCE).run(&cpu())
}

/// The same of a case that only books.
fn booked(book: impl Fn(&mut Record) + Send + Sync + 'static) -> Sidecar {
    tried(move |_, record| {
        book(record);
        Ok(())
    })
}

fn reason(result: &Sidecar) -> &str {
    assert!(result.outcome.failed(), "{result:?}");
    result.outcome.reason().unwrap_or_default()
}

#[test]
fn a_score_above_its_threshold_fails_the_case_and_ends_nothing() {
    let result = tried(|_, record| {
        record.score("first", "metres", 3.0, 2.0);
        record.score("second", "metres", 1.0, 2.0);
        record.score("third", "metres", f64::NAN, 2.0);
        Ok(())
    });
    assert_eq!(result.scores.iter().map(Score::holds).collect::<Vec<_>>(), [false, true, false]);
    for word in ["first", "metres", "3.000e0", "2.0e0", "1 more"] {
        assert!(reason(&result).contains(word), "{word}: {}", reason(&result));
    }
}

#[test]
fn values_are_held_to_both_bounds() {
    let far = [1.0f32; 100];
    let near: Vec<f64> = far.iter().map(|v| f64::from(*v) * 1.009).collect();
    assert_eq!(booked(move |record| record.hold("near", far, near.clone())).outcome, Outcome::Passed);

    // One value is off by more than a tenth of the largest, all together by less than a hundredth.
    let mut one = [1.0f32; 1000];
    one[417] = 1.2;
    let result = booked(move |record| record.hold("one", one, [1.0; 1000]));
    assert_eq!(result.scores.iter().map(Score::holds).collect::<Vec<_>>(), [true, false]);
    let [found] = &result.mismatches[0].values[..] else { panic!("{result:?}") };
    assert_eq!((found.index, found.found, found.expected), (417, f64::from(1.2f32), 1.0));
    assert!(reason(&result).contains("value 417 is 1.20000005 and should be 1"));

    // All are off by two hundredths: the first eight are kept.
    let result = booked(move |record| record.hold("all", [1.02f32; 50], [1.0; 50]));
    assert_eq!(result.scores.iter().map(Score::holds).collect::<Vec<_>>(), [false, true]);
    let indices: Vec<_> = result.mismatches[0].values.iter().map(|m| m.index).collect();
    assert_eq!(indices, [0, 1, 2, 3, 4, 5, 6, 7]);

    for bad in [f32::NAN, f32::INFINITY] {
        let result = booked(move |record| record.hold("bad", [1.0, bad], [1.0, 1.0]));
        assert_eq!(result.mismatches[0].values[0].index, 1, "{result:?}");
        reason(&result);
    }
    reason(&booked(|record| record.hold("too few", [1.0f32], [1.0, 1.0])));
    reason(&booked(|record| record.hold("not zero", [1e-30f32], [0.0])));
    let infinite = |record: &mut Record| record.hold("same", [f32::INFINITY, 0.0], [f64::INFINITY, 0.0]);
    assert_eq!(booked(infinite).outcome, Outcome::Passed);
}

#[test]
fn bits_are_held_to_bits() {
    let result = booked(|record| record.same("zeros", &[0.0, -0.0, 1.0], &[0.0, 0.0, 1.0]));
    assert_eq!(result.mismatches[0].values[0].index, 1);
    assert_eq!(result.scores[0].value, 1.0);
    reason(&booked(|record| record.same("short", &[0.0], &[0.0, 0.0])));
    assert!(booked(|record| record.same("not numbers", &[f32::NAN], &[f32::NAN])).outcome.passed());
}

#[test]
fn variants_are_held_to_the_first_of_their_permutation() {
    let (sizes, ways) = (Axis::of("size", [1u8, 2]), Axis::new("way", [("plain", 0u8), ("odd", 1), ("last", 2)]));
    let with = |wrong: [u8; 2]| {
        let (s, w) = (sizes.clone(), ways.clone());
        Case::new("mine::case", "A trial.", move |_, record| {
            record.each(&s, |record, &size| {
                record.each(&w, |record, &way| {
                    let value = if [size, way] == wrong { 9.0 } else { f32::from(size) };
                    record.steady("value", &[value]);
                    Ok(())
                })
            })
        })
        .permutes(&sizes)
        .varies(&ways)
        .run(&cpu())
    };
    assert!(with([7, 7]).outcome.passed());
    let result = with([2, 1]);
    let wrong: Vec<_> = result.scores.iter().filter(|s| !s.holds()).collect();
    assert_eq!(wrong.len(), 1, "{result:?}");
    assert_eq!(wrong[0].at, [("size".into(), "2".into()), ("way".into(), "odd".into())]);
    for word in ["size 2", "way odd"] {
        assert!(reason(&result).contains(word), "{result:?}");
    }
}

#[test]
fn a_case_keeps_to_the_axes_that_it_declares() {
    let axis = Axis::of("size", [1u8, 2]);
    let declared = |run: fn(&Subject, &mut Record) -> Result<(), Failed>| {
        Case::new("mine::case", "A trial.", run).permutes(&Axis::of("size", [1u8, 2])).run(&cpu())
    };
    assert!(reason(&declared(|_, _| Ok(()))).contains("size 1"));
    let half = |_: &Subject, record: &mut Record| record.each(&Axis::of("size", [1u8]), |_, _| Ok(()));
    assert!(reason(&declared(half)).contains("size 2"));
    let fails = |_: &Subject, record: &mut Record| {
        record.each(&Axis::of("size", [1u8, 2]), |_, n| if *n == 2 { Err("no".into()) } else { Ok(()) })
    };
    assert!(reason(&declared(fails)).contains("size 2: no"));
    let undeclared = tried(move |_, record| record.each(&axis, |_, _| Ok(())));
    assert!(reason(&undeclared).contains("\"size\""), "{undeclared:?}");
}

#[test]
fn errors_and_panics_are_failures_with_their_words() {
    assert_eq!(reason(&tried(|_, _| Err("it broke".into()))), "it broke");
    let result = tried(|_, record| {
        record.score("before", "metres", 1.0, 2.0);
        panic!("it fell")
    });
    assert!(reason(&result).contains("it fell"));
    assert_eq!(result.scores.len(), 1, "what was booked before stays");
    let absent = Subject::new("mine", || Err("no driver".into()));
    let result = Case::new("mine::case", "A trial.", |_, _| Ok(())).run(&absent);
    assert_eq!((reason(&result), &result.device.id[..]), ("no driver", "mine"));
}

#[test]
fn a_device_that_lacks_what_a_case_needs_skips_it() {
    let needs = [
        (Need::FieldSide(u32::MAX), "4294967295"),
        (Need::BufferBytes(u64::MAX), "buffers"),
        (Need::FilterBits(25), "25 bits"),
        (Need::Feature("teleportation"), "teleportation"),
    ];
    for (need, word) in needs {
        let case = Case::new("mine::case", "A trial.", |_, _| Err("was tried".into())).needs(need);
        let result = case.run(&cpu());
        let Outcome::Skipped(reason) = &result.outcome else { panic!("{result:?}") };
        assert!(reason.contains(word), "{reason}");
        assert!(result.verdict().is_ok());
        let quiet = Arguments { test_threads: Some(1), ..Arguments::default() };
        let conclusion = libtest_mimic::run(&quiet, trials(&cpu(), vec![case], None));
        assert_eq!((conclusion.num_passed, conclusion.num_failed, conclusion.num_ignored), (0, 0, 1));
    }
    let had = Case::new("mine::case", "A trial.", |_, _| Ok(())).needs(Need::FieldSide(64)).needs(Need::FilterBits(24));
    assert!(had.run(&cpu()).outcome.passed());
}

#[test]
fn results_come_in_the_order_of_the_work_and_an_error_ends_it() {
    let case = |i: usize| Case::new(format!("mine::{i}"), "A trial.", |_, _| Ok(()));
    let work: Vec<_> = (0..40).map(|i| (cpu(), case(i))).collect();
    let mut told = 0;
    let all = try_all(&work, |_| {
        told += 1;
        Ok::<_, ()>(())
    });
    let names: Vec<_> = all.unwrap_or_default().into_iter().map(|r| r.case).collect();
    assert_eq!(names, work.iter().map(|(_, case)| case.name()).collect::<Vec<_>>());
    assert_eq!(told, 40);
    let mut told = 0;
    let all = try_all(&work, |_| {
        told += 1;
        if told == 3 { Err("the disk is full") } else { Ok(()) }
    });
    assert_eq!((all.err(), told), (Some("the disk is full"), 3));
}

#[test]
fn every_case_of_the_suite_says_what_it_checks() {
    let cases = airlight_conformance::cases();
    for (i, case) in cases.iter().enumerate() {
        let name = case.name();
        assert!(name.contains("::") && name.bytes().all(|b| b"abcdefghijklmnopqrstuvwxyz0123456789_:".contains(&b)));
        assert!(cases[..i].iter().all(|other| other.name() != name), "{name} stands twice");
        assert!(case.checks().ends_with('.') && case.checks().len() > 20, "{name}: {}", case.checks());
        assert!(tolerance::ALL.contains(&case.tolerance()), "{name} is held to {:?}", case.tolerance());
        for axis in case.permutations().iter().chain(case.variants()) {
            assert!(!axis.values.is_empty(), "{name}: {axis:?}");
        }
    }
}

#[test]
fn every_stage_is_tried_of_devices_that_have_settled() {
    let names: Vec<String> = cases().iter().map(|case| case.name().to_owned()).collect();
    let of_stages: Vec<_> = names.iter().filter_map(|name| name.strip_prefix("stage::")?.split_once("::")).collect();
    let settled = |stage: &str| of_stages.iter().any(|(s, case)| *s == stage && case.ends_with("_settled"));
    let lacking: Vec<_> = of_stages.iter().filter(|(stage, _)| !settled(stage)).collect();
    assert!(!of_stages.is_empty() && lacking.is_empty(), "{lacking:?}");
}
