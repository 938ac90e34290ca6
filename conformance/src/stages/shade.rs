//! `shade` against its twin.

use airlight::device::Usage;
use airlight::glam::{DVec3, Vec3};
use airlight::light::Light;
use airlight::reference::{self, ShadeInputs, TraceInputs};
use airlight::scene::Camera;
use airlight::stage::{GridParams, LightRecord, MaterialRecord, Reduce, ReduceParams, Shade, ShadeParams, Stage};
use bytemuck::Zeroable;
use libtest_mimic::Failed;

use super::case;
use super::trace::params as trace_params;
use crate::bench::{Bench, cuts};
use crate::fixtures::{DIMS, Map, camera, chromatic, density, noise, room};
use crate::{Axis, Case, Record, Subject, check, tolerance};

/// One set of parameters.
#[derive(Clone)]
struct Set {
    name: &'static str,
    map: Map,
    camera: Camera,
    lights: Vec<Light>,
    /// Whether triangles stand in the way of light.
    visibility: bool,
    /// Whether something stands behind the surfaces, or before.
    background: bool,
}

pub(crate) fn cases() -> Vec<Case> {
    let sun = Light::directional(DVec3::new(0.5, 0.8, -0.35), Vec3::new(3.0, 2.6, 2.0)).expect("a light");
    let lamp = Light::point(DVec3::new(-0.2, 0.9, 0.6), Vec3::new(0.6, 0.7, 1.0)).expect("a light");
    let spot = Light::spot(DVec3::new(-0.9, 1.1, 0.6), DVec3::new(0.2, -0.1, 0.1), Vec3::ONE, 8.0, 17.0);
    let spot = spot.expect("a light");
    let plain = |name: &'static str, lights: Vec<Light>| Set {
        name,
        map: Map::Plain,
        camera: camera(21, 13, 1),
        lights,
        visibility: true,
        background: false,
    };
    let sets = [
        plain("directional", vec![sun]),
        plain("point", vec![lamp]),
        plain("spot", vec![spot]),
        Set { visibility: false, map: Map::Sheared, ..plain("unshadowed", vec![sun, lamp]) },
        Set { background: true, map: Map::Rotated, ..plain("background", vec![lamp, sun]) },
        Set { camera: camera(9, 8, 4), background: true, ..plain("several", vec![spot, lamp, sun, lamp, lamp]) },
        plain("no_light", vec![]),
    ];
    let made = |set: Set| {
        let name = set.name;
        let run = move |subject: &Subject, record: &mut Record| one(subject, record, &set);
        case("shade", name, "radiance", &tolerance::STAGE, run).varies(&occupancies())
    };
    sets.into_iter().map(made).collect()
}

/// Whether rays may pass over empty blocks, which must change nothing.
fn occupancies() -> Axis<bool> {
    Axis::new("occupancy", [("without", false), ("with", true)])
}

/// Voxels of an occupancy cell's side.
const BLOCK: u32 = 2;

fn one(subject: &Subject, record: &mut Record, set: &Set) -> Result<(), Failed> {
    let (mesh, lattice) = (room(), set.map.lattice(DIMS));
    let hierarchy = mesh.hierarchy().ok_or("a mesh without triangles")?;
    let (trace, tables) = trace_params(&mesh, &set.camera)?;
    let hits = reference::trace(&trace, &TraceInputs { tables: &tables, mesh: hierarchy.records() });
    let hits: Vec<[f32; 4]> = hits.chunks_exact(4).map(|v| [0, 1, 2, 3].map(|k| v[k] as f32)).collect();
    let grid = GridParams::new(&lattice);
    let mut p = ShadeParams::zeroed();
    p.dims = grid.dims;
    [p.index_x, p.index_y, p.index_z] = grid.index;
    let eye = set.camera.origin;
    p.eye = lattice.world_to_index().transform_point3(eye).as_vec3().extend(0.0).to_array();
    p.mesh_eye = (eye - hierarchy.origin()).as_vec3().extend(hierarchy.extent()).to_array();
    (p.forward, p.right, p.up) = (trace.forward, trace.right, trace.up);
    p.extinction = chromatic(airlight::media::Phase::Isotropic).extinction.extend(0.0).to_array();
    p.occupancy_cells = [0, 1, 2, 3].map(|a| if a < 3 { DIMS[a].div_ceil(BLOCK) } else { BLOCK });
    (p.width, p.height, p.samples) = (trace.width, trace.height, trace.samples);
    (p.lights, p.light_end) = (set.lights.len() as u32, set.lights.len() as u32);
    p.spots = LightRecord::spots(&set.lights);
    (p.nodes, p.materials) = (trace.nodes, mesh.materials().len() as u32);
    (p.visibility, p.step, p.light_floor) = (set.visibility.into(), 0.05, 1e-4);
    let lights = LightRecord::of(&set.lights, eye);
    let materials: Vec<_> = mesh.materials().iter().map(MaterialRecord::new).collect();
    let pixels = (p.width * p.height) as usize;
    // Before, between and behind the surfaces, and nowhere.
    let far = |i: usize| [0.4, 2.1, 2.4, 9.0, f32::INFINITY][i % 5];
    let behind = noise(47, 3 * pixels).chunks_exact(3).enumerate().map(|(i, c)| [c[0], c[1], c[2], far(i)]).collect();
    let behind: Vec<[f32; 4]> = if set.background { behind } else { Vec::new() };
    let rho = density(DIMS, 48);
    let expected = reference::shade(
        &p,
        &ShadeInputs {
            density: &rho,
            lights: &lights,
            tables: &tables,
            mesh: hierarchy.records(),
            materials: &materials,
            hits: &hits,
            background: set.background.then_some(&behind[..]),
        },
    );
    let lit = expected.chunks_exact(4).filter(|v| v[0] > 0.0).count();
    check!(lit > 20 || set.lights.is_empty(), "only {lit} positions are lit: the case tries nothing");

    let mut bench = Bench::new(subject)?;
    let [x, y, z, _] = p.occupancy_cells;
    let occupancy = bench.room::<[f32; 2]>((x * y * z) as usize, Usage::Work)?;
    let stage = Shade {
        params: p,
        density: bench.scalars(DIMS.to_array(), &rho)?,
        occupancy: None,
        lights: if lights.is_empty() { None } else { Some(bench.buf(&lights)?) },
        tables: bench.buf(&tables)?,
        mesh: bench.buf(hierarchy.records())?,
        materials: bench.buf(&materials)?,
        hits: bench.buf(&hits)?,
        background: if behind.is_empty() { None } else { Some(bench.buf(&behind)?) },
        out: bench.room(expected.len() / 4, Usage::Output)?,
    };
    let side = BLOCK as f32;
    let reduce = Stage::Reduce(Reduce {
        params: ReduceParams::new(p.dims, [x, y, z, 0], [side, side, side, 0.0]),
        density: stage.density,
        other: None,
        out: occupancy,
    });
    record.each(&occupancies(), |record, &skips| {
        record.each(&cuts(), |record, &cut| {
            let mut stage = stage.clone();
            if skips {
                bench.run(record, &reduce, cut)?;
                stage.occupancy = Some(occupancy);
            }
            let out = stage.out;
            bench.run(record, &Stage::Shade(stage), cut)?;
            let found = bench.read(out)?;
            let radiance = |v: &[f32; 4]| [v[0], v[1], v[2]];
            record.hold(
                "radiance",
                found.iter().flat_map(radiance),
                expected.chunks_exact(4).flat_map(|v| [v[0], v[1], v[2]]),
            );
            record.hold("distance", found.iter().map(|v| v[3]), expected.chunks_exact(4).map(|v| v[3]));
            Ok(())
        })
    })
}
