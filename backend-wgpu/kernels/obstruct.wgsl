// `obstruct`: which of a cell's neighbours lie behind surfaces. One invocation a cell.

@compute @workgroup_size(UNITS)
fn obstruct(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id) * UNITS + lane;
    if n >= launch.count {
        return;
    }
    let index = launch.start + n;
    let cells = params.cells.xyz;
    let cell = vec3<f32>(vec3<u32>(index % cells.x, index / cells.x % cells.y, index / cells.x / cells.y));
    let origin = center(cell);
    var word = 0u;
    if params.neighbor_begin > 0u {
        // What the passes before left.
        word = obstructed[index - launch.first];
    }
    // Most cells have no triangle near. Where all neighbours are asked for at once, one of them is the cell itself, whose loops this
    // takes.
    var boxes = vec2<u32>(0u, params.nodes);
    if params.neighbor_end - params.neighbor_begin == NEIGHBORS {
        let reach = vec3<f32>(
            dot(abs(params.world_x.xyz), params.cell.xyz),
            dot(abs(params.world_y.xyz), params.cell.xyz),
            dot(abs(params.world_z.xyz), params.cell.xyz),
        );
        // More than what rounding makes of the neighbours' places.
        let slack = 1e-3 * reach + 1e-6 * abs(origin);
        boxes = first_within(origin - reach - slack, origin + reach + slack);
    }
    // Opposite neighbours lie on one line through the cell, which is walked once. The first of those that this pass takes, and the
    // one past the last.
    let half = NEIGHBORS / 2u;
    var begin = params.neighbor_begin;
    var end = params.neighbor_end;
    if begin > half {
        begin = NEIGHBORS - params.neighbor_end;
        end = NEIGHBORS - params.neighbor_begin;
    } else if end > half {
        begin = min(begin, NEIGHBORS - end);
        end = half;
    }
    end = select(end, begin, boxes.x >= params.nodes);
    let asked = ((1u << (params.neighbor_end - params.neighbor_begin)) - 1u) << params.neighbor_begin;
    for (var bit = begin; bit < end; bit++) {
        let way = center(cell + vec3<f32>(vec3<u32>(bit % 3u, bit / 3u % 3u, bit / 9u)) - 1.0) - origin;
        let far = length(way);
        let sides = either(line(origin, way / far), far, boxes.x, boxes.y);
        let bits = select(vec2<u32>(0u), vec2<u32>(1u << bit, 1u << (NEIGHBORS - 1u - bit)), sides);
        word |= (bits.x | bits.y) & asked;
    }
    obstructed[index - launch.first] = word;
}

// Where the centre of a cell is, from the mesh's origin.
fn center(cell: vec3<f32>) -> vec3<f32> {
    let v = (cell + 0.5) * params.cell.xyz - 0.5 - (vec3<f32>(params.dims.xyz) - 1.0) * 0.5;
    let at = vec3<f32>(dot(params.world_x.xyz, v), dot(params.world_y.xyz, v), dot(params.world_z.xyz, v));
    return at + params.mesh_eye.xyz;
}

// Whether a triangle of boxes `begin` to `end` stands within `limit` metres along the line, and whether one does the other way.
fn either(way: Line, limit: f32, begin: u32, end: u32) -> vec2<bool> {
    var stands = vec2<bool>(false);
    var node = begin;
    while node < end {
        var leaf = 0u;
        loop {
            let low = read_mesh(2u * node);
            let high = read_mesh(2u * node + 1u);
            let met = beside(way, low, high, limit);
            leaf = select(0u, high.number, met);
            node = select(low.number, node + 1u, met);
            continuing {
                break if node >= end || (leaf & MESH_COUNT_MASK) != 0u;
            }
        }
        let first = leaf >> MESH_COUNT_BITS;
        for (var k = 0u; k < (leaf & MESH_COUNT_MASK); k++) {
            let at = crossed(way, first + k);
            // What is not crossed has no weights.
            let near = at.y + at.z + at.w > 0.0 && abs(at.x) < limit;
            stands |= vec2<bool>(near) & vec2<bool>(at.x >= 0.0, at.x <= 0.0);
        }
        if all(stands) {
            node = end;
        }
    }
    return stands;
}

// Whether the line meets a box within `limit` metres either way.
fn beside(way: Line, low: MeshRecord, high: MeshRecord, limit: f32) -> bool {
    let lower = vec3<f32>(low.x, low.y, low.z);
    let upper = vec3<f32>(high.x, high.y, high.z);
    let back = way.inverse < vec3<f32>(0.0);
    let first = (select(lower, upper, back) - way.origin) * way.inverse;
    let last = (select(upper, lower, back) - way.origin) * way.inverse;
    let near = larger(larger(first.x, first.y), larger(first.z, -limit));
    let far = smaller(smaller(last.x, last.y), smaller(last.z, limit));
    // Distances are good to a few units in the last place.
    return near <= far + 4e-6 * limit;
}
