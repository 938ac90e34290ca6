//! `obstruct` against its twin.

use airlight::device::Usage;
use airlight::glam::DVec3;
use airlight::reference;
use airlight::scene::{Material, Mesh};
use airlight::stage::{GridParams, Obstruct, ObstructParams, Stage};
use bytemuck::Zeroable;
use libtest_mimic::Failed;

use super::case;
use crate::bench::{Bench, cuts};
use crate::fixtures::{DIMS, Map, ball, room};
use crate::{Case, Record, Subject, check, tolerance};

pub(crate) fn cases() -> Vec<Case> {
    let sets = [
        ("few_cells", Map::Plain, [4, 3, 5], room as fn() -> Mesh),
        ("many_cells", Map::Plain, [13, 9, 17], room),
        ("a_row_of_cells", Map::Plain, [1, 1, 7], room),
        ("small_triangles", Map::Plain, [5, 4, 6], crowd),
        ("rotated", Map::Rotated, [7, 5, 6], room),
        ("sheared", Map::Sheared, [7, 5, 6], room),
        ("mirrored", Map::Mirrored, [7, 5, 6], room),
    ];
    let made = |(name, map, cells, surfaces): (&str, Map, [u32; 3], fn() -> Mesh)| {
        case("obstruct", name, "obstructed neighbours", &tolerance::EXACT, move |subject, record| {
            one(subject, record, map, cells, &surfaces())
        })
    };
    sets.into_iter().map(made).collect()
}

/// A ball of 1800 triangles, of which a cell has more than devices keep in lists.
fn crowd() -> Mesh {
    ball(DVec3::new(0.25, -0.15, 0.6), 0.22, 15, Material::default())
}

fn one(subject: &Subject, record: &mut Record, map: Map, cells: [u32; 3], surfaces: &Mesh) -> Result<(), Failed> {
    let lattice = map.lattice(DIMS);
    let grid = GridParams::new(&lattice);
    let hierarchy = surfaces.hierarchy().expect("there are triangles");
    let side = |a: usize| grid.dims[a] as f32 / cells[a] as f32;
    let mut params = ObstructParams::zeroed();
    params.dims = grid.dims;
    [params.world_x, params.world_y, params.world_z] = grid.world;
    params.cells = [cells[0], cells[1], cells[2], 0];
    params.cell = [side(0), side(1), side(2), 0.0];
    params.mesh_eye = (lattice.center() - hierarchy.origin()).as_vec3().extend(hierarchy.extent()).to_array();
    (params.nodes, params.neighbor_end) = (hierarchy.nodes(), Obstruct::NEIGHBORS);
    let mut bench = Bench::new(subject)?;
    let count = cells.iter().product::<u32>() as usize;
    let stage = Obstruct { params, mesh: bench.buf(hierarchy.records())?, out: bench.room(count, Usage::Output)? };
    let out = stage.out;
    let expected = reference::obstruct(&params, hierarchy.records());
    let walls = expected.iter().filter(|word| **word != 0).count();
    check!(walls > 1, "surfaces beside {walls} of {count} cells: the case tries nothing");
    // A flag each, so that one that differs counts as one.
    let flags = |words: Vec<u32>| words.into_iter().flat_map(|w| (0..27).map(move |bit| (w >> bit & 1) as f32));
    let expected: Vec<f64> = flags(expected).map(f64::from).collect();
    let stage = Stage::Obstruct(stage);
    record.each(&cuts(), |record, &cut| {
        bench.run(record, &stage, cut)?;
        record.hold("neighbours", flags(bench.read(out)?), expected.iter().copied());
        Ok(())
    })
}
