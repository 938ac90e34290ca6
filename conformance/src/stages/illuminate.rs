//! `illuminate` against its twin.

use airlight::basis::recurrence_table;
use airlight::device::Usage;
use airlight::glam::{DVec3, Vec3};
use airlight::light::Light;
use airlight::reference::{self, IlluminateInputs};
use airlight::stage::{GridParams, Illuminate, IlluminateParams, LightRecord, Reduce, ReduceParams, Stage};
use bytemuck::Zeroable;
use libtest_mimic::Failed;

use super::case;
use super::march::occupancies;
use crate::bench::{Bench, cuts};
use crate::fixtures::{DIMS, Map, density, room};
use crate::{Case, Record, Subject, check, tolerance};

/// One set of parameters.
#[derive(Clone)]
struct Set {
    name: String,
    map: Map,
    cells: [u32; 3],
    bands: u32,
    channels: u32,
    extinction: Vec3,
    lights: Vec<Light>,
    surfaces: bool,
}

fn lights() -> Result<Vec<Light>, Failed> {
    Ok(vec![
        Light::directional(DVec3::new(0.5, 0.8, -0.35), Vec3::new(3.0, 2.6, 2.0))?,
        Light::point(DVec3::new(0.2, 0.1, 0.15), Vec3::new(0.6, 0.7, 1.0))?,
        Light::spot(DVec3::new(-0.9, 1.1, 0.6), DVec3::new(0.1, 0.0, 0.2), Vec3::splat(4.0), 15.0, 30.0)?,
        Light::point(DVec3::new(1.5, -1.2, 2.0), Vec3::new(0.1, 2.0, 0.3))?,
    ])
}

pub(crate) fn cases() -> Vec<Case> {
    let all = lights().expect("lights in range");
    let set = |name: &str| Set {
        name: name.to_owned(),
        map: Map::Plain,
        cells: [4, 3, 5],
        bands: 3,
        channels: 3,
        extinction: Vec3::splat(4.0),
        lights: all.clone(),
        surfaces: false,
    };
    let one = |light: usize| vec![all[light]];
    let mut sets = vec![
        set("four_lights"),
        Set { lights: one(0), ..set("directional") },
        Set { lights: one(1), bands: 6, ..set("point_inside") },
        Set { lights: one(2), bands: 1, ..set("spot") },
        Set { channels: 1, ..set("one_channel") },
        Set { extinction: Vec3::new(6.0, 4.0, 2.5), ..set("chromatic") },
        Set { surfaces: true, ..set("surfaces") },
        Set { cells: [11, 9, 13], ..set("fine_cells") },
        Set { cells: [1, 1, 7], bands: 10, ..set("a_row_of_cells") },
    ];
    sets.extend([Map::Rotated, Map::Sheared, Map::Mirrored].map(|map| {
        let name = format!("{map:?}").to_lowercase();
        Set { map, surfaces: true, extinction: Vec3::new(6.0, 4.0, 2.5), ..set(&name) }
    }));
    let made = |set: Set| {
        let name = set.name.clone();
        case("illuminate", &name, "moments of lights", &tolerance::STAGE, move |subject, record| {
            run(subject, record, &set)
        })
        .varies(&occupancies())
    };
    sets.into_iter().map(made).collect()
}

fn run(subject: &Subject, record: &mut Record, set: &Set) -> Result<(), Failed> {
    let lattice = set.map.lattice(DIMS);
    let grid = GridParams::new(&lattice);
    let center = lattice.index_to_world().transform_point3((DIMS.as_dvec3() - 1.0) / 2.0);
    let side = |a: usize| grid.dims[a] as f32 / set.cells[a] as f32;
    let block = 2;
    let mut params = IlluminateParams::zeroed();
    params.dims = grid.dims;
    [params.index_x, params.index_y, params.index_z] = grid.index;
    [params.world_x, params.world_y, params.world_z] = grid.world;
    params.cells = [set.cells[0], set.cells[1], set.cells[2], 0];
    params.cell = [side(0), side(1), side(2), 0.06];
    params.extinction = set.extinction.extend(0.0).to_array();
    params.occupancy_cells = [0, 1, 2, 3].map(|a| if a < 3 { grid.dims[a].div_ceil(block) } else { block });
    let count = set.lights.len() as u32;
    (params.lights, params.light_end, params.spots) = (count, count, LightRecord::spots(&set.lights));
    (params.bands, params.channels, params.light_floor) = (set.bands, set.channels, 2e-3);
    let room = room();
    let hierarchy = room.hierarchy().expect("the room has triangles");
    if set.surfaces {
        params.mesh_eye = (center - hierarchy.origin()).as_vec3().extend(hierarchy.extent()).to_array();
        (params.nodes, params.visibility) = (hierarchy.nodes(), 1);
    }
    let rho = density(DIMS, 61);
    let records = LightRecord::of(&set.lights, center);
    let cells = set.cells.iter().product::<u32>() as usize;
    let mut bench = Bench::new(subject)?;
    let [x, y, z, _] = params.occupancy_cells;
    let occupancy = bench.room::<[f32; 2]>((x * y * z) as usize, Usage::Work)?;
    let stage = Illuminate {
        params,
        density: bench.scalars(DIMS.to_array(), &rho)?,
        occupancy: None,
        lights: bench.buf(&records)?,
        tables: bench.buf(&recurrence_table(set.bands))?,
        mesh: set.surfaces.then(|| bench.buf(hierarchy.records())).transpose()?,
        out: bench.room((set.bands * set.bands * set.channels) as usize * cells, Usage::Output)?,
    };
    let reduce = Stage::Reduce(Reduce {
        params: ReduceParams::new(grid.dims, [x, y, z, 0], [block as f32, block as f32, block as f32, 0.0]),
        density: stage.density,
        other: None,
        out: occupancy,
    });
    let out = stage.out;
    let inputs = IlluminateInputs { density: &rho, lights: &records, mesh: hierarchy.records() };
    let expected = reference::illuminate(&params, &inputs);
    let lit = expected[..cells].iter().filter(|v| **v > 0.0).count();
    check!(lit * 4 > cells, "only {lit} cells are lit: the case tries nothing");
    record.each(&occupancies(), |record, &skips| {
        record.each(&cuts(), |record, &cut| {
            let mut stage = stage.clone();
            if skips {
                bench.run(record, &reduce, cut)?;
                stage.occupancy = Some(occupancy);
            }
            bench.run(record, &Stage::Illuminate(stage), cut)?;
            record.hold("moments", bench.read(out)?, expected.iter().copied());
            Ok(())
        })
    })
}
