//! Sweeps that keep their light in textures, beside those that keep it in memory.

use airlight_core::device::{Device, ResourceId};
use airlight_core::glam::{DAffine3, DVec3, UVec3};
use airlight_core::media::Lattice;
use airlight_core::stage::{Stage, Sweep, SweepDirection, SweepParams};

use super::{content, device, empty, filled};
use crate::WgpuDevice;

/// Cells along x, y and z, of which no row is whole fours.
const CELLS: [u32; 3] = [7, 5, 6];
/// Directions, in two batches of which the second is smaller.
const DIRECTIONS: u32 = 8;
const BATCH: u32 = 5;
const COEFFICIENTS: u32 = 6;

/// A sweep of three channels among surfaces.
fn sweep(device: &mut dyn Device, cells: [u32; 3]) -> Sweep {
    let [x, y, z] = cells;
    let placed = DAffine3::from_scale(DVec3::splat(0.1));
    let lattice = Lattice::new(UVec3::from(cells), placed).unwrap();
    let params = SweepParams {
        cells: [x, y, z, x.max(y).max(z)],
        directions: DIRECTIONS,
        batch: BATCH,
        plane: (x * y).max(y * z).max(x * z),
        channels: 3,
        grey: 0,
        emits: 1,
        source_coefficients: COEFFICIENTS,
        coefficients: COEFFICIENTS,
        weight_channels: 1,
        planar: 1,
        boundary: 0.3,
        unused: 0,
    };
    let toward = |n: u32| {
        let angle = 1.1 * f64::from(n);
        DVec3::new(angle.cos(), 1.4 * (2.3 * angle).sin(), angle.sin()).normalize()
    };
    let ways: Vec<_> = (0..DIRECTIONS).map(|n| SweepDirection::new(toward(n), &lattice, cells)).collect();
    let cells = x * y * z;
    let rough = |n: u32, of: u32| -> Vec<f32> { (0..n).map(|i| (i * 7 % of) as f32 / of as f32).collect() };
    let surfaces: Vec<u32> = (0..cells).map(|i| if i % 3 == 0 { i.wrapping_mul(2_654_435_761) } else { 0 }).collect();
    Sweep {
        params,
        optics: filled(device, 0, &rough(9 * cells, 31)),
        directions: filled(device, 1, &ways),
        sources: Some(filled(device, 2, &rough(3 * COEFFICIENTS * cells, 17))),
        source_weights: Some(filled(device, 3, &rough(DIRECTIONS * COEFFICIENTS, 13))),
        weights: filled(device, 4, &rough(DIRECTIONS * COEFFICIENTS, 11)),
        obstructed: Some(filled(device, 5, &surfaces)),
        radiance: empty(device, 6, (3 * BATCH * cells) as usize),
        moments: empty(device, 7, (3 * COEFFICIENTS * cells) as usize),
    }
}

/// The moments of a sweep that is run in `pieces`.
fn light(device: &mut WgpuDevice, cells: [u32; 3], pieces: u32) -> Vec<f32> {
    let sweep = sweep(device, cells);
    let moments = sweep.moments;
    let stage = Stage::Sweep(sweep);
    let axis = stage.axis();
    for n in 0..pieces {
        device.dispatch(&stage, axis * n / pieces..axis * (n + 1) / pieces).unwrap();
    }
    let light = content(device, moments);
    (0..8).for_each(|id| device.destroy(ResourceId(id)));
    light
}

/// Both sum the same products in the same order, but for what drivers make of sums and products.
const TOLERANCE: f32 = 1e-5;

/// Holds what is kept in textures to what is kept in memory.
#[track_caller]
fn holds(found: &[f32], expected: &[f32], what: &str) {
    let most = expected.iter().copied().fold(0.0, f32::max);
    assert!(most > 0.1, "{most}");
    let apart = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(apart <= TOLERANCE * most, "{apart} of {most}: {what}");
}

#[test]
fn light_kept_in_textures_is_that_kept_in_memory() {
    let Some(mut device) = device() else { return };
    let run = |device: &mut WgpuDevice, texels, pieces| {
        device.rewrites = texels;
        light(device, CELLS, pieces)
    };
    let expected = run(&mut device, false, 1);
    assert!(expected.iter().all(|value| *value >= 0.0));
    let turns = device.info.limits.loop_turns;
    // Whole, in pieces of the work axis, in as few planes at a time as loops may turn, and in memory where not one may.
    for (pieces, turns) in [(1, turns), (4, turns), (1, Some(40)), (1, Some(16))] {
        device.info.limits.loop_turns = turns;
        holds(&run(&mut device, true, pieces), &expected, &format!("{pieces} pieces, {turns:?}"));
    }
    device.info.limits.loop_turns = turns;
    holds(&run(&mut device, false, 4), &expected, "4 pieces in memory");
}

#[test]
fn a_batch_finds_its_sources_once() {
    let Some(mut device) = device() else { return };
    let sweep = sweep(&mut device, CELLS);
    let stage = Stage::Sweep(sweep.clone());
    let steps = sweep.params.batch_steps();
    // By texels, where kernels read them, and in memory.
    for texels in [device.rewrites, false] {
        device.rewrites = texels;
        let mut found = |range| {
            let parts = device.sweep_parts(&stage, &sweep, range).unwrap();
            parts.iter().filter(|part| ["sweep_turn", "sweep_scatter", "sweep_toward"].contains(&part.name)).count()
        };
        // By texels it turns the optics as well.
        let turns = usize::from(texels);
        assert_eq!(found(0..2), 1 + turns, "the begin");
        assert_eq!(found(2..4), 0, "the rest of a batch");
        assert_eq!(found(4..steps + 1), 1, "the next batch");
        assert_eq!(found(2..4), 1 + turns, "what does not go on");
        assert_eq!(found(0..2), 1 + turns, "from the begin");
        assert_eq!(found(0..2), 1 + turns, "another time");
    }
}

#[test]
fn planes_of_many_cells_keep_to_the_turns_of_loops() {
    let Some(mut device) = device() else { return };
    // A plane takes so many turns that all of them are more than software drivers do.
    let cells = [96, 95, 94];
    device.rewrites = false;
    let expected = light(&mut device, cells, 1);
    device.rewrites = true;
    holds(&light(&mut device, cells, 1), &expected, "96 × 95 × 94 cells");
}
