//! `accumulate` against its twin.

use airlight::device::{Buf, Usage};
use airlight::glam::DVec3;
use airlight::reference::{self, AccumulateInputs};
use airlight::scene::Camera;
use airlight::stage::{Accumulate, AccumulateParams, March, Stage, accumulate_mode};
use bytemuck::Zeroable;
use libtest_mimic::Failed;

use super::case;
use super::upsample::{distance, hold, medium};
use crate::bench::{Bench, cuts};
use crate::fixtures::camera;
use crate::{Case, Record, Subject, check, tolerance};

/// One set of parameters.
#[derive(Clone, Copy)]
struct Set {
    name: &'static str,
    mode: u32,
    most: f32,
    scale: u32,
    /// How the eye and what it looks at moved since the last picture.
    moved: [DVec3; 2],
    /// Whether the history holds values that are none.
    broken: bool,
    /// Whether some pixels were not marched, now and then.
    unmarched: bool,
}

pub(crate) fn cases() -> Vec<Case> {
    let still = Set {
        name: "still",
        mode: accumulate_mode::STILL,
        most: Accumulate::STILL,
        scale: 1,
        moved: [DVec3::ZERO; 2],
        broken: false,
        unmarched: false,
    };
    let moved = Set { name: "moved", mode: accumulate_mode::MOVED, most: Accumulate::MOVED, ..still };
    let (aside, turned) = (DVec3::new(0.11, -0.05, 0.07), DVec3::new(0.04, 0.09, -0.12));
    let sets = [
        still,
        Set { name: "still_broken", broken: true, ..still },
        Set { name: "again", mode: accumulate_mode::AGAIN, broken: true, ..still },
        Set { name: "changed_in_place", most: Accumulate::CHANGED, ..moved },
        Set { name: "eye_aside", moved: [aside; 2], ..moved },
        Set { name: "eye_turned", moved: [DVec3::ZERO, turned], scale: 2, ..moved },
        Set { name: "eye_onward", moved: [4.0 * aside, turned], scale: 4, broken: true, ..moved },
        Set { name: "rims", unmarched: true, ..still },
        Set { name: "rims_moved", unmarched: true, moved: [aside, turned], scale: 2, ..moved },
        // Most of what is seen was not.
        Set { name: "eye_far_away", moved: [DVec3::ZERO, 8.0 * turned], ..moved },
    ];
    let made = |set: Set| {
        case("accumulate", set.name, "history", &tolerance::STAGE, move |subject, record| one(subject, record, &set))
    };
    sets.into_iter().map(made).collect()
}

fn one(subject: &Subject, record: &mut Record, set: &Set) -> Result<(), Failed> {
    let (width, height) = (21, 13);
    let now = camera(width * set.scale - set.scale / 2, height * set.scale, 1);
    let before = Camera { origin: now.origin - set.moved[0], target: now.target - set.moved[1], ..now };
    let rgb0 = |v: DVec3| v.as_vec3().extend(0.0).to_array();
    let mut params = AccumulateParams::zeroed();
    [params.forward, params.right, params.up] = now.axes().map(rgb0);
    let [forward, right, up] = before.axes();
    (params.last_forward, params.last_right) = (rgb0(forward), rgb0(right / right.length_squared()));
    (params.last_up, params.moved) = (rgb0(up / up.length_squared()), rgb0(now.origin - before.origin));
    (params.width, params.height, params.scale) = (width, height, set.scale);
    (params.full_width, params.full_height) = (now.width, now.height);
    (params.mode, params.most) = (set.mode, set.most);
    let passed = |x: u32, y: u32| set.unmarched && ((x + 2 * y) / 5).is_multiple_of(3);
    let medium_now = medium(width, height, 61, |x, y| if passed(x, y) { March::UNMARCHED } else { distance(x, y) });
    // The same surfaces a little off, so that some fit, some in part and some not.
    let last: Vec<[f32; 4]> =
        medium(width, height, 62, |x, y| if passed(x, y + 1) { March::UNMARCHED } else { 1.06 * distance(x, y) })
            .chunks_exact(2)
            .enumerate()
            .flat_map(|(i, pixel)| {
                let ([r, g, b, surface], through) = (pixel[0], pixel[1]);
                // Some have no history.
                let mut kept = [[r, g, b, [0.0, 3.0, 7.0, 40.0][i % 4]], through, [surface, 0.0, 0.0, 0.0]];
                if set.broken && i % 5 == 0 {
                    kept[i / 5 % 2][i / 10 % 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][i / 7 % 3];
                }
                kept
            })
            .collect();
    let (expected_next, expected_mean) =
        reference::accumulate(&params, &AccumulateInputs { medium: &medium_now, last: &last });
    let counts = || expected_next.chunks_exact(12).map(|p| p[3]);
    let mixed = counts().filter(|&n| n > 1.0).count();
    check!(mixed > 20 || set.name == "eye_far_away", "only {mixed} pixels have a history: the case tries nothing");
    check!(set.name == "again" || counts().any(|n| n == 1.0), "every pixel has a history: the case tries too little");

    let mut bench = Bench::new(subject)?;
    let pixels = (width * height) as usize;
    let next: Buf<[f32; 4]> = bench.room(3 * pixels, Usage::Work)?;
    let mean: Buf<[f32; 4]> = bench.room(2 * pixels, Usage::Output)?;
    let stage =
        Stage::Accumulate(Accumulate { params, medium: bench.buf(&medium_now)?, last: bench.buf(&last)?, next, mean });
    record.each(&cuts(), |record, &cut| {
        bench.run(record, &stage, cut)?;
        let found: Vec<[f32; 4]> = bench.read(mean)?;
        hold(record, [width, height], found.as_flattened(), &expected_mean);
        let found: Vec<[f32; 4]> = bench.read(next)?;
        let (found, expected) = (found.as_flattened().as_chunks::<12>().0, expected_next.as_chunks::<12>().0);
        let (whole, twin) = (
            |p: &[f32; 12]| [p[0], p[1], p[2], p[4], p[5], p[6]],
            |p: &[f64; 12]| [p[0], p[1], p[2], p[4], p[5], p[6]],
        );
        record.hold("history", found.iter().flat_map(whole), expected.iter().flat_map(twin));
        record.hold("pictures", found.iter().map(|p| p[3]), expected.iter().map(|p| p[3]));
        record.hold("surface", found.iter().map(|p| 1.0 / p[8]), expected.iter().map(|p| 1.0 / p[8]));
        Ok(())
    })
}
