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
    let end = select(params.neighbor_end, params.neighbor_begin, boxes.x >= params.nodes);
    for (var bit = params.neighbor_begin; bit < end; bit++) {
        if bit == NEIGHBORS / 2u {
            continue;
        }
        let way = center(cell + vec3<f32>(vec3<u32>(bit % 3u, bit / 3u % 3u, bit / 9u)) - 1.0) - origin;
        let far = length(way);
        if blocked(line(origin, way / far), far, boxes.x, boxes.y) {
            word |= 1u << bit;
        }
    }
    obstructed[index - launch.first] = word;
}

// Where the centre of a cell is, from the mesh's origin.
fn center(cell: vec3<f32>) -> vec3<f32> {
    let v = (cell + 0.5) * params.cell.xyz - 0.5 - (vec3<f32>(params.dims.xyz) - 1.0) * 0.5;
    let at = vec3<f32>(dot(params.world_x.xyz, v), dot(params.world_y.xyz, v), dot(params.world_z.xyz, v));
    return at + params.mesh_eye.xyz;
}
