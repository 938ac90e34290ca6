//! `project` where eight cells march together: in an order, or as they come.

use airlight_core::device::{Buf, Device, Field, FieldFormat, FieldSpec, ResourceId, ResourceSpec};
use airlight_core::stage::{PhaseParams, Project, ProjectParams, Stage};

use super::{content, device, filled};
use crate::WgpuDevice;

/// Cells, of two layers that lie in squares and one that is left over.
const CELLS: [u32; 3] = [6, 4, 3];
const VOXELS: [u32; 3] = [12, 8, 6];
const DIRECTIONS: u32 = 11;
const COEFFICIENTS: u32 = 4;

/// Records where of each three cells that lie beside each other one holds nothing.
fn project(device: &mut dyn Device) -> Project {
    let density = Field { id: ResourceId(0), spec: FieldSpec::dense(VOXELS, 1, FieldFormat::Scalar) };
    device.create(density.id, &ResourceSpec::Field(density.spec)).unwrap();
    let rough = |n: u32, of: u32| -> Vec<f32> { (0..n).map(|i| (i * 7 % of) as f32 / of as f32).collect() };
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
        coefficients: COEFFICIENTS,
        channels: 3,
        weight_channels: 1,
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
        weights: filled(device, 3, &rough(DIRECTIONS * COEFFICIENTS, 13)),
        emission_weights: None,
        phase_table: None,
        // What is not written stays as it is.
        records: filled(device, 4, &vec![-1.0f32; (count * COEFFICIENTS * 3) as usize]),
        emission_records: None,
    }
}

/// The records of the units of the work axis from the first of `cuts` on, dispatched from each to the next.
fn records(device: &mut WgpuDevice, cuts: &[u32]) -> Vec<f32> {
    let project = project(device);
    let records: Buf<f32> = project.records;
    let stage = Stage::Project(project);
    for range in cuts.windows(2) {
        device.dispatch(&stage, range[0]..range[1]).unwrap();
    }
    let found = content(device, records);
    (0..5).for_each(|id| device.destroy(ResourceId(id)));
    found
}

#[test]
fn records_are_the_same_in_whatever_order_cells_are_taken() {
    let Some(mut device) = device() else { return };
    let all: u32 = CELLS.iter().product();
    let turns = device.info.limits.loop_turns;
    // No loop may turn often enough to find an order.
    device.info.limits.loop_turns = Some(1);
    let expected = records(&mut device, &[0, all]);
    device.info.limits.loop_turns = turns;
    let cell = (COEFFICIENTS * 3) as usize;
    for (n, record) in expected.chunks_exact(cell).enumerate() {
        assert_eq!(record.iter().all(|value| *value == 0.0), n % 3 == 1, "cell {n}");
    }
    assert_eq!(records(&mut device, &[0, all]), expected);
    assert_eq!(records(&mut device, &[0, 5, 61, all]), expected, "in pieces");
    // And nothing beside what was asked for.
    let some = records(&mut device, &[7, 50]);
    for (n, (found, whole)) in some.iter().zip(&expected).enumerate() {
        let asked = (7..50).contains(&(n / cell));
        assert_eq!(*found, if asked { *whole } else { -1.0 }, "value {n}");
    }
}
