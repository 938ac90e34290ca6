//! `project` where eight cells march together: in an order, or as they come.

use std::ops::Range;

use airlight_core::device::{Buf, Device, Field, FieldFormat, FieldSpec, ResourceId, ResourceSpec};
use airlight_core::stage::{PhaseParams, Project, ProjectParams, Stage};

use super::{content, device, filled};
use crate::WgpuDevice;

/// Cells, of two layers that lie in squares and one that is left over.
const CELLS: [u32; 3] = [6, 4, 3];
const VOXELS: [u32; 3] = [12, 8, 6];
const DIRECTIONS: u32 = 11;

/// What a record holds.
#[derive(Clone, Copy, Debug)]
struct Of {
    coefficients: u32,
    channels: u32,
    weight_channels: u32,
}

const CHROMATIC: Of = Of { coefficients: 4, channels: 3, weight_channels: 1 };

impl Of {
    /// Weights of so many directions.
    fn weights(self) -> u32 {
        DIRECTIONS * self.coefficients * self.weight_channels
    }

    fn values(self) -> usize {
        (self.coefficients * self.channels.max(self.weight_channels)) as usize
    }
}

fn rough(n: u32, of: u32) -> Vec<f32> {
    (0..n).map(|i| (i * 7 % of) as f32 / of as f32).collect()
}

/// Records where of each three cells that lie beside each other one holds nothing.
fn project(device: &mut dyn Device, of: Of, weights: &[f32]) -> Project {
    let density = Field { id: ResourceId(0), spec: FieldSpec::dense(VOXELS, 1, FieldFormat::Scalar) };
    device.create(density.id, &ResourceSpec::Field(density.spec)).unwrap();
    let count: u32 = CELLS.iter().product();
    device.write(density.id, 0, bytemuck::cast_slice(&rough(VOXELS.iter().product(), 31))).unwrap();
    let occupancy: Vec<[f32; 2]> = (0..count).map(|n| if n % 3 == 1 { [0.0; 2] } else { [0.5, 1.0] }).collect();
    let toward = |n: u32| {
        let angle = 1.1 * n as f32;
        let (x, y, z) = (angle.cos(), (2.3 * angle).sin(), angle.sin());
        let length = (x * x + y * y + z * z).sqrt();
        [x / length, y / length, z / length, 0.0]
    };
    let directions: Vec<[f32; 4]> = (0..DIRECTIONS).map(toward).collect();
    let [x, y, z] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let params = ProjectParams {
        dims: [VOXELS[0], VOXELS[1], VOXELS[2], 0],
        index_x: x,
        index_y: y,
        index_z: z,
        world_x: x,
        world_y: y,
        world_z: z,
        cells: [CELLS[0], CELLS[1], CELLS[2], 0],
        cell: [2.0, 2.0, 2.0, 0.7],
        extinction: [0.4, 0.3, 0.2, 0.0],
        direction_begin: 0,
        direction_end: DIRECTIONS,
        coefficients: of.coefficients,
        channels: of.channels,
        weight_channels: of.weight_channels,
        phase_kind: PhaseParams::HENYEY_GREENSTEIN,
        ..bytemuck::Zeroable::zeroed()
    };
    Project {
        params,
        density,
        emission: None,
        emission_color: None,
        occupancy: Some(filled(device, 1, &occupancy)),
        directions: filled(device, 2, &directions),
        weights: filled(device, 3, weights),
        emission_weights: None,
        phase_table: None,
        // What is not written stays as it is.
        records: filled(device, 4, &vec![-1.0f32; count as usize * of.values()]),
        emission_records: None,
    }
}

/// The records of the stages that `cut` makes of one, each of a range of the work axis.
fn records(
    device: &mut WgpuDevice,
    of: Of,
    weights: &[f32],
    cut: impl Fn(Project) -> Vec<(Project, Range<u32>)>,
) -> Vec<f32> {
    let project = project(device, of, weights);
    let records: Buf<f32> = project.records;
    for (project, range) in cut(project) {
        device.dispatch(&Stage::Project(project), range).unwrap();
    }
    let found = content(device, records);
    (0..5).for_each(|id| device.destroy(ResourceId(id)));
    found
}

/// Records of the cells from the first of `cuts` on, dispatched from each to the next.
fn pieces(device: &mut WgpuDevice, cuts: &[u32]) -> Vec<f32> {
    let cut = |project: Project| cuts.windows(2).map(|range| (project.clone(), range[0]..range[1])).collect();
    records(device, CHROMATIC, &rough(CHROMATIC.weights(), 13), cut)
}

/// Records of all cells, by passes that take the directions from each of `begins` to the next.
fn passes(device: &mut WgpuDevice, of: Of, weights: &[f32], begins: &[u32]) -> Vec<f32> {
    let cut = |project: Project| {
        let pass = |range: &[u32]| {
            let mut pass = project.clone();
            (pass.params.direction_begin, pass.params.direction_end) = (range[0], range[1]);
            (pass, 0..CELLS.iter().product())
        };
        begins.windows(2).map(pass).collect()
    };
    records(device, of, weights, cut)
}

#[test]
fn records_are_the_same_in_whatever_order_cells_are_taken() {
    let Some(mut device) = device() else { return };
    let all: u32 = CELLS.iter().product();
    let turns = device.info.limits.loop_turns;
    // No loop may turn often enough to find an order.
    device.info.limits.loop_turns = Some(1);
    let expected = pieces(&mut device, &[0, all]);
    device.info.limits.loop_turns = turns;
    let cell = CHROMATIC.values();
    for (n, record) in expected.chunks_exact(cell).enumerate() {
        assert_eq!(record.iter().all(|value| *value == 0.0), n % 3 == 1, "cell {n}");
    }
    assert_eq!(pieces(&mut device, &[0, all]), expected);
    assert_eq!(pieces(&mut device, &[0, 5, 61, all]), expected, "in pieces");
    // And nothing beside what was asked for.
    let some = pieces(&mut device, &[7, 50]);
    for (n, (found, whole)) in some.iter().zip(&expected).enumerate() {
        let asked = (7..50).contains(&(n / cell));
        assert_eq!(*found, if asked { *whole } else { -1.0 }, "value {n}");
    }
}

#[test]
fn records_of_every_size_are_the_sums_of_what_directions_bring() {
    let Some(mut device) = device() else { return };
    let whole = [0, DIRECTIONS];
    for channels in [1, 3] {
        // A coefficient for each direction, which has no weight in the others.
        let each = Of { coefficients: DIRECTIONS, channels, weight_channels: 1 };
        let one = (0..DIRECTIONS * DIRECTIONS).map(|n| if n / DIRECTIONS == n % DIRECTIONS { 1.0 } else { 0.0 });
        let reached = passes(&mut device, each, &one.collect::<Vec<_>>(), &whole);
        for (coefficients, weight_channels) in
            [(1, 1), (2, 3), (5, 3), (9, 1), (12, 3), (13, 3), (36, 1), (37, 3), (100, 1), (100, 3)]
        {
            let of = Of { coefficients, channels, weight_channels };
            let weights = rough(of.weights(), 101);
            let found = passes(&mut device, of, &weights, &whole);
            let all = channels.max(weight_channels);
            for (n, value) in found.iter().enumerate() {
                let (cell, v) = (n / of.values(), (n % of.values()) as u32);
                let (k, c) = (v / all, v % all);
                let term = |i: u32| {
                    let from = (i * channels + c % channels) as usize;
                    let weight = ((i * coefficients + k) * weight_channels + c % weight_channels) as usize;
                    reached[cell * each.values() + from] * weights[weight]
                };
                let expected: f32 = (0..DIRECTIONS).map(term).sum();
                // Eleven terms of one sign, and as many roundings of sums as of products: at most 12 · 2⁻²⁴ of the whole.
                assert!(
                    (value - expected).abs() <= 1e-6 * expected,
                    "{of:?}, cell {cell}, value {v}: {value}, {expected}"
                );
            }
            assert_eq!(passes(&mut device, of, &weights, &[0, 1, 8, DIRECTIONS]), found, "{of:?} in passes");
        }
    }
}
