// The order in which `project` takes the cells of a dispatch where eight of them march together: first those whose maximum is not
// zero, so that no packet waits for a few of its cells; and of both, one after the other those that lie close. One workgroup, of
// which an invocation takes cells that follow each other.

var<workgroup> occupied: array<u32, LANES>;

@compute @workgroup_size(LANES)
fn project_order(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let each = (launch.count + LANES - 1u) / LANES;
    let begin = min(lane * each, launch.count);
    let end = min(begin + each, launch.count);
    var own = 0u;
    for (var n = begin; n < end; n++) {
        own += select(0u, 1u, holds(near(launch.start + n)));
    }
    occupied[lane] = own;
    workgroupBarrier();
    var before = 0u;
    var all = 0u;
    for (var i = 0u; i < LANES; i++) {
        before += select(0u, occupied[i], i < lane);
        all += occupied[i];
    }
    var next = before;
    var next_empty = all + begin - before;
    for (var n = begin; n < end; n++) {
        let cell = near(launch.start + n);
        let medium = holds(cell);
        order[select(next_empty, next, medium)] = cell;
        next += select(0u, 1u, medium);
        next_empty += select(1u, 0u, medium);
    }
}

fn holds(cell: u32) -> bool {
    return !has_occupancy || read_occupancy(cell).y > 0.0;
}

// The cell that a unit of the work takes: eight units are two cells along each axis, whose rays lie closer than those of a row, in
// two layers that are all there and of even sides.
fn near(unit: u32) -> u32 {
    let across = params.cells.x;
    let layer = across * params.cells.y;
    let first = unit - unit % (2u * layer);
    let there = first >= launch.start && launch.start + launch.count - first >= 2u * layer;
    if !there || ((across | params.cells.y) & 1u) > 0u {
        return unit;
    }
    let rows = divide(unit - first, 4u * across);
    let n = rows.y;
    return first + rows.x * 2u * across + n / 8u * 2u + n % 2u + n / 2u % 2u * across + n / 4u % 2u * layer;
}
