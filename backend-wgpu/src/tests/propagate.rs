//! Light that is propagated by steps in order, beside a dispatch a step.

use airlight_core::device::{Device, Field, FieldFormat, FieldSpec, ResourceId, ResourceSpec};
use airlight_core::glam::{DAffine3, DVec3, UVec3, Vec3};
use airlight_core::light::Light;
use airlight_core::media::Lattice;
use airlight_core::stage::propagate::{faces, scheme, steps};
use airlight_core::stage::{GridParams, LightPlace, Propagate, PropagateParams, Stage};

use super::{content, device, empty, filled};
use crate::WgpuDevice;
use crate::propagate::IN_ORDER;

const VOXELS: UVec3 = UVec3::new(12, 14, 10);
const CELLS: [u32; 3] = [6, 7, 5];

fn propagate(device: &mut dyn Device, scheme: u32) -> Propagate {
    let lattice = Lattice::new(VOXELS, DAffine3::from_scale(DVec3::splat(0.1))).unwrap();
    let point = |x, y, z| Light::point(DVec3::new(x, y, z), Vec3::ONE).unwrap();
    let lights = [
        point(0.31, 0.77, 0.42),
        Light::directional(DVec3::new(0.4, -0.3, 0.8), Vec3::ONE).unwrap(),
        point(-0.5, 0.2, 1.6),
    ];
    let places: Vec<_> = lights.iter().map(|light| LightPlace::new(light, &lattice, CELLS, scheme)).collect();
    let grid = GridParams::new(&lattice);
    let count = CELLS.iter().product::<u32>() as usize;
    let spec = FieldSpec::dense(VOXELS.to_array(), 1, FieldFormat::Scalar);
    let density = Field { id: ResourceId(0), spec };
    device.create(density.id, &ResourceSpec::Field(spec)).unwrap();
    let rough: Vec<f32> = (0..spec.texels()).map(|i| (i * 7 % 31) as f32 / 31.0).collect();
    device.write(density.id, 0, bytemuck::cast_slice(&rough)).unwrap();
    let means: Vec<[f32; 2]> = (0..count).map(|i| [(i * 5 % 13) as f32 / 13.0, 1.0]).collect();
    Propagate {
        params: PropagateParams {
            dims: grid.dims,
            world_x: grid.world[0],
            world_y: grid.world[1],
            world_z: grid.world[2],
            cells: [CELLS[0], CELLS[1], CELLS[2], 1],
            cell: [2.0, 2.0, 2.0, 0.07],
            lights: lights.len() as u32,
            steps: steps(&places, CELLS, scheme),
            scheme,
            items: PropagateParams::most_items(CELLS, lights.len() as u32, scheme).unwrap(),
        },
        density,
        occupancy: Some(filled(device, 1, &means)),
        lights: filled(device, 2, &places),
        faces: Some(filled(device, 3, &faces(&places, CELLS))),
        values: empty(device, 4, count * lights.len()),
        out: empty(device, 5, 4 * count),
    }
}

/// The depths of a range that is run in `pieces`, and how many parts it takes in order.
fn depths(device: &mut WgpuDevice, scheme: u32, pieces: u32) -> (Vec<f32>, usize) {
    let propagate = propagate(device, scheme);
    let out = propagate.out;
    let params = propagate.params;
    let stage = Stage::Propagate(propagate);
    let axis = stage.axis();
    let mut in_order = 0;
    for n in 0..pieces {
        let range = axis * n / pieces..axis * (n + 1) / pieces;
        let parts = device.propagate_parts(&stage, &params, range.clone());
        in_order += parts.iter().filter(|part| part.name == IN_ORDER).count();
        device.dispatch(&stage, range).unwrap();
    }
    let depths = content(device, out);
    (0..6).for_each(|id| device.destroy(ResourceId(id)));
    (depths, in_order)
}

#[test]
fn steps_in_order_are_those_of_a_dispatch_each() {
    let Some(mut device) = device() else { return };
    let (turns, has) = (device.info.limits.loop_turns, device.rewrites);
    for scheme in [scheme::SHORT_CHARACTERISTICS, scheme::METRIC, scheme::PUBLISHED] {
        device.info.limits.loop_turns = Some(1);
        let (expected, in_order) = depths(&mut device, scheme, 1);
        assert_eq!(in_order, 0, "no loop may turn");
        assert!(expected.iter().any(|depth| *depth > 0.1) && expected.iter().all(|depth| *depth >= 0.0));
        // Whole, in pieces of the work axis, and in a few steps at a time as loops may turn; in copies of the values or in memory.
        for (pieces, turns) in [(1, turns), (3, turns), (1, Some(200)), (3, Some(200))] {
            for rewrites in [true, false] {
                device.info.limits.loop_turns = turns;
                device.rewrites = has && rewrites;
                let (found, in_order) = depths(&mut device, scheme, pieces);
                assert_eq!(in_order > 0, device.texels, "{scheme} {pieces} {turns:?}");
                assert!(found == expected, "{scheme} {pieces} {turns:?} {rewrites}");
            }
        }
    }
}
