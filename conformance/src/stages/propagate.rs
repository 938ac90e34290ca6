//! `propagate` against its twin.

use airlight::device::Usage;
use airlight::glam::{DVec3, Vec3};
use airlight::light::Light;
use airlight::media::Lattice;
use airlight::reference::{self, PropagateInputs};
use airlight::stage::propagate::{faces, scheme, steps};
use airlight::stage::{GridParams, LightPlace, Propagate, PropagateParams, Stage};
use libtest_mimic::Failed;

use super::case;
use crate::bench::{Bench, cuts};
use crate::fixtures::{DIMS, Map, density, noise};
use crate::{Case, Record, Subject, check, tolerance};

/// One set of parameters.
#[derive(Clone)]
struct Set {
    name: String,
    map: Map,
    cells: [u32; 3],
    scheme: u32,
    lights: Vec<Place>,
    /// Longest step, metres.
    step: f32,
}

/// Where a light is.
#[derive(Clone, Copy)]
enum Place {
    /// In cell units.
    At([f64; 3]),
    /// Far away in this direction of the world.
    Toward([f64; 3]),
}
use Place::{At, Toward};

const CELLS: [u32; 3] = [6, 4, 8];

fn plain(name: &str, scheme: u32, lights: Vec<Place>) -> Set {
    Set { name: name.to_owned(), map: Map::Plain, cells: CELLS, scheme, lights, step: 0.07 }
}

/// Lights within the box, in general position.
fn inside(n: usize) -> Vec<Place> {
    let at = |c: &[f32]| At([0, 1, 2].map(|a| f64::from(c[a]) * f64::from(CELLS[a]) - 0.5));
    noise(91, 3 * n).chunks_exact(3).map(at).collect()
}

/// Centres, faces, edges and corners of cells, and walls, edges and corners of the box.
fn special() -> Vec<Place> {
    let places = [
        [2.0, 1.0, 4.0],
        [2.5, 1.0, 4.0],
        [2.5, 1.5, 4.0],
        [2.5, 1.5, 4.5],
        [-0.5, 1.3, 2.6],
        [5.5, 3.5, 3.0],
        [5.5, -0.5, 7.5],
        [5.2, 0.3, -0.3],
        // As far along two axes from many cells.
        [1.7, 2.3, 3.7],
    ];
    places.map(At).to_vec()
}

/// Beside a wall, an edge and a corner of the box, at the distance of a cell, and far away.
fn outside() -> Vec<Place> {
    vec![At([-0.9, 1.2, 3.3]), At([6.5, -2.0, 4.0]), At([-7.0, 9.0, -8.0]), At([3.1, 1.0, 8e3]), At([1e8, 2e8, -3e8])]
}

fn directional() -> Vec<Place> {
    let directions = [
        [1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, -1.0, 0.0],
        [-1.0, 1.0, 1.0],
        [0.5, 0.8, -0.35],
        [-0.9, 0.1, 0.2],
        [0.01, -0.02, -1.0],
    ];
    directions.map(Toward).to_vec()
}

pub(crate) fn cases() -> Vec<Case> {
    let schemes = [
        ("short_characteristics", scheme::SHORT_CHARACTERISTICS),
        ("metric", scheme::METRIC),
        ("published", scheme::PUBLISHED),
    ];
    let mut sets = Vec::new();
    for (name, scheme) in schemes {
        let set = |what: &str, lights: Vec<Place>| plain(&format!("{name}_{what}"), scheme, lights);
        sets.extend([
            set("one_light", inside(1)),
            set("four_lights", inside(4)),
            set("nine_lights", inside(9)),
            set("special_places", special()),
            set("outside", outside()),
            set("directional", directional()),
            set("two_at_one_place", vec![At([1.3, 2.2, 5.1]), Toward([0.3, 0.2, 1.0]), At([1.3, 2.2, 5.1])]),
            Set { cells: [3, 2, 3], step: 0.02, ..set("coarse_cells", inside(5)) },
            Set { cells: [13, 9, 17], ..set("fine_cells", inside(2)) },
            // Steps that devices share among cores, where they take small ones in order.
            Set { cells: [128, 2, 96], ..set("wide_faces", vec![At([41.3, 0.4, -60.7])]) },
            Set { cells: [1, 1, 7], ..set("a_row_of_cells", vec![At([0.2, -0.3, 3.4]), Toward([0.0, 0.0, -1.0])]) },
        ]);
        for map in [Map::Rotated, Map::Sheared, Map::Mirrored] {
            let lights = [inside(3), outside(), directional()].concat();
            sets.push(Set { map, ..set(&format!("{map:?}").to_lowercase(), lights) });
        }
    }
    let made = |set: Set| {
        let name = set.name.clone();
        let what = "columns and mean densities";
        case("propagate", &name, what, &tolerance::STAGE, move |subject, record| one(subject, record, &set))
    };
    sets.into_iter().map(made).collect()
}

fn light(place: Place, lattice: &Lattice, cells: [u32; 3]) -> Result<Light, Failed> {
    Ok(match place {
        Toward(direction) => Light::directional(DVec3::from(direction), Vec3::ONE)?,
        At(s) => {
            let index = (DVec3::from(s) + 0.5) * lattice.dims().as_dvec3() / DVec3::from(cells.map(f64::from)) - 0.5;
            Light::point(lattice.index_to_world().transform_point3(index), Vec3::ONE)?
        }
    })
}

fn one(subject: &Subject, record: &mut Record, set: &Set) -> Result<(), Failed> {
    let lattice = set.map.lattice(DIMS);
    let grid = GridParams::new(&lattice);
    let lights = set.lights.iter().map(|&place| light(place, &lattice, set.cells)).collect::<Result<Vec<_>, _>>()?;
    let places: Vec<_> = lights.iter().map(|l| LightPlace::new(l, &lattice, set.cells, set.scheme)).collect();
    let [x, y, z] = set.cells;
    let side = |a: usize| grid.dims[a] as f32 / set.cells[a] as f32;
    let n = places.len() as u32;
    let params = PropagateParams {
        dims: grid.dims,
        world_x: grid.world[0],
        world_y: grid.world[1],
        world_z: grid.world[2],
        cells: [x, y, z, n.div_ceil(PropagateParams::LANES)],
        cell: [side(0), side(1), side(2), set.step],
        lights: n,
        steps: steps(&places, set.cells, set.scheme),
        scheme: set.scheme,
        items: PropagateParams::most_items(set.cells, n, set.scheme).ok_or("too many items")?,
    };
    let rho = density(DIMS, 93);
    let cells = (x * y * z) as usize;
    let means: Vec<[f32; 2]> = noise(94, cells).into_iter().map(|v| [v, 1.0]).collect();
    let gathers = set.scheme != scheme::SHORT_CHARACTERISTICS;
    let mut bench = Bench::new(subject)?;
    let stage = Propagate {
        params,
        density: bench.scalars(DIMS.to_array(), &rho)?,
        occupancy: gathers.then(|| bench.buf(&means)).transpose()?,
        lights: bench.buf(&places)?,
        // Those that gather have no use for them.
        faces: Some(bench.buf(&faces(&places, set.cells))?),
        values: bench.room(cells * places.len(), Usage::Work)?,
        out: bench.room(cells * 4 * params.cells[3] as usize, Usage::Work)?,
    };
    let out = stage.out;
    let inputs = PropagateInputs { density: &rho, occupancy: &means, lights: &places };
    let expected = reference::propagate(&params, &inputs);
    let lit = expected.iter().filter(|v| **v > 0.0).count();
    check!(lit * 4 > cells * n as usize, "only {lit} ways hold density: the case tries nothing");
    let stage = Stage::Propagate(stage);
    record.each(&cuts(), |record, &cut| {
        bench.run(record, &stage, cut)?;
        record.hold("depths", bench.read(out)?, expected.iter().copied());
        Ok(())
    })
}
