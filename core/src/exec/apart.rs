//! From a film of the medium alone to the picture: finer along rims, the mean over a sequence, and the full size.

use glam::DVec3;

use super::key::Key;
use super::plan::Plan;
use crate::device::Buf;
use crate::scene::Scene;
use crate::stage::{
    Accumulate, AccumulateParams, LightRecord, March, MarchParams, Stage, Upsample, UpsampleParams, accumulate_mode,
    alone,
};

/// What the last picture of a sequence leaves to the next, beside its history.
#[derive(Clone, Copy)]
struct Last {
    /// Number of the picture.
    frame: u32,
    /// Of the march.
    picture: Key,
    /// Of the march, but for what the number of the picture changes.
    still: Key,
    /// Of what the march shows, wherever it is seen from.
    shown: Key,
    /// Origin and axes of the camera.
    eye: DVec3,
    axes: [DVec3; 3],
}

/// A film of the medium alone and, where it was marched near rims at half the scale too, that one.
#[derive(Clone, Copy)]
pub(super) struct Medium {
    pub(super) whole: Buf<[f32; 4]>,
    pub(super) rims: Option<Buf<[f32; 4]>>,
}

/// Plans the march near rims of what stands behind `march`, where its scale is more than 2.
pub(super) fn plan_rims(march: &March, plan: &mut Plan<'_>) -> Option<March> {
    march.surface.filter(|_| march.params.scale > 2)?;
    let mut rims = march.clone();
    let p = &mut rims.params;
    (p.scale, p.alone) = (p.scale / 2, alone::RIMS);
    (p.width, p.height) = (p.full_width.div_ceil(p.scale), p.full_height.div_ceil(p.scale));
    let vectors = 2 * u64::from(p.width) * u64::from(p.height);
    rims.film = plan.work("rims", vectors);
    let keeps = plan.loop_turns().is_some_and(|turns| rims.keeps_paths(turns.into()));
    rims.paths = keeps.then(|| plan.work("rims' paths", vectors));
    plan.stage(Stage::March(rims.clone()));
    Some(rims)
}

/// Plans the mean of what `march` shows over the pictures of a sequence. What happened since the last picture follows from
/// the march's own keys.
pub(super) fn plan_accumulate<'a>(
    scene: &'a Scene,
    march: &March,
    rims: Option<&March>,
    plan: &mut Plan<'a>,
) -> Medium {
    let p = &march.params;
    let still = March { params: MarchParams { jitter_offset: 0.0, ..*p }, ..march.clone() };
    let key = |march: &March, plan: &Plan<'a>| plan.key(&Stage::March(march.clone()));
    let mut shown = March { lights: None, surface: None, ..still.clone() };
    (shown.params.eye, shown.params.forward) = ([0.0; 4], [0.0; 4]);
    (shown.params.right, shown.params.up, shown.params.mesh_eye) = ([0.0; 4], [0.0; 4], [0.0; 4]);
    // The lights' table holds them as the eye sees them.
    let lights: Vec<u8> = bytemuck::cast_slice(&LightRecord::of(&scene.lights, DVec3::ZERO)).to_vec();
    let now = Last {
        frame: scene.frame,
        picture: key(march, plan),
        still: key(&still, plan),
        shown: Key::of("shown", &(key(&shown, plan), lights)),
        eye: scene.camera.origin,
        axes: scene.camera.axes(),
    };
    let last = plan.hand_on("view", now).unwrap_or(now);
    let rgb0 = |v: DVec3| v.as_vec3().extend(0.0).to_array();
    let mut params: AccumulateParams = bytemuck::Zeroable::zeroed();
    (params.forward, params.right, params.up) = (p.forward, p.right, p.up);
    params.moved = rgb0(now.eye - last.eye);
    let [forward, right, up] = last.axes;
    (params.last_forward, params.last_right) = (rgb0(forward), rgb0(right / right.length_squared()));
    params.last_up = rgb0(up / up.length_squared());
    (params.full_width, params.full_height) = (p.full_width, p.full_height);
    (params.mode, params.most) = if (now.picture, now.frame) == (last.picture, last.frame) {
        (accumulate_mode::AGAIN, Accumulate::STILL)
    } else if now.still == last.still {
        (accumulate_mode::STILL, Accumulate::STILL)
    } else if now.shown == last.shown {
        (accumulate_mode::MOVED, Accumulate::MOVED)
    } else {
        (accumulate_mode::MOVED, Accumulate::CHANGED)
    };
    let mut mean = |march: &March, [history, mean]: [&str; 2]| {
        let p = &march.params;
        let pixels = u64::from(p.width) * u64::from(p.height);
        (params.width, params.height, params.scale) = (p.width, p.height, p.scale);
        let history = plan.state(history, 3 * pixels, &[p.full_width, p.full_height, p.scale]);
        let mean = plan.work(mean, 2 * pixels);
        let (last, next) = (history.previous, history.next);
        plan.stage(Stage::Accumulate(Accumulate { params, medium: march.film, last, next, mean }));
        mean
    };
    Medium {
        whole: mean(march, ["history", "medium's mean"]),
        rims: rims.map(|rims| mean(rims, ["rims' history", "rims' mean"])),
    }
}

/// Plans the picture from the medium alone, as `march` was planned to show it; `normals` as the stage `trace` leaves them.
pub(super) fn plan_upsample<'a>(
    scene: &'a Scene,
    march: &March,
    medium: Medium,
    normals: Option<Buf<[f32; 4]>>,
    plan: &mut Plan<'a>,
) -> Buf<[f32; 4]> {
    let p = &march.params;
    let mut params: UpsampleParams = bytemuck::Zeroable::zeroed();
    (params.forward, params.right, params.up) = (p.forward, p.right, p.up);
    (params.environment, params.environment_dims) = (p.environment, p.environment_dims);
    (params.environment_width, params.environment_height) = (p.environment_width, p.environment_height);
    (params.width, params.height, params.scale) = (p.width, p.height, p.scale);
    (params.full_width, params.full_height, params.samples) = (p.full_width, p.full_height, p.samples);
    // Two vectors for each sub-pixel position, the normal first.
    (params.surface_samples, params.normals_each) = (p.surface_samples, 2 * p.samples);
    let positions: Vec<f32> = scene.camera.subpixels().iter().flat_map(|p| p.as_vec2().to_array()).collect();
    let subpixels = plan.table("sub-pixel positions", positions);
    let film = plan.output("film", 2 * u64::from(p.full_width) * u64::from(p.full_height));
    plan.stage(Stage::Upsample(Upsample {
        params,
        medium: medium.whole,
        rims: medium.rims,
        surface: march.surface,
        normals,
        environment: march.environment,
        subpixels,
        film,
    }));
    film
}
