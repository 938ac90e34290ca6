// `sweep`: light along many directions at the cells of a coarse grid, each from its neighbours upwind. A dispatch is one
// step; one invocation a cell of a plane of one direction, or a coefficient of a cell's moments.

@compute @workgroup_size(UNITS)
fn sweep(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let item = number(id) * UNITS + lane;
    if item >= launch.count {
        return;
    }
    let steps = params.cells.w + 1u;
    let step = launch.start % steps;
    let first = launch.start / steps * params.batch;
    let count = min(params.batch, params.directions - first);
    if GATHERS {
        gather(item, first, count);
    } else {
        let at = divide(item, params.plane);
        if at.x < count {
            advance(at.x, first, step, at.y);
        }
    }
}

// Radiance of cell `item` of the plane that a step finishes, of direction `n` of the batch that begins with `first`.
fn advance(n: u32, first: u32, step: u32, item: u32) {
    let direction = first + n;
    let way = read_directions(direction);
    let axis = way.axis;
    let b = select(0u, 1u, axis == 0u);
    let c = select(2u, 1u, axis == 2u);
    let cells = params.cells;
    if step >= cells[axis] || item >= cells[b] * cells[c] {
        return;
    }
    let falls = vec3<u32>(way.down, way.down >> 1u, way.down >> 2u) % 2u == vec3<u32>(1u);
    let hop = select(vec3<i32>(1), vec3<i32>(-1), falls);
    var at = vec3<i32>(0);
    at[axis] = i32(select(cells[axis] - 1u - step, step, falls[axis]));
    let within = divide(item, cells[b]);
    at[b] = i32(within.y);
    at[c] = i32(within.x);
    let count = cells.x * cells.y * cells.z;
    let cell = (u32(at.z) * cells.y + u32(at.y)) * cells.x + u32(at.x);
    var tau = 0.0;
    var piece = vec2<f32>(0.0);
    for (var channel = 0u; channel < params.channels; channel++) {
        var extinction = 0.0;
        var emission = 0.0;
        var arriving = 0.0;
        var upwind = 0.0;
        for (var i = 0; i < 4; i++) {
            var to = at;
            to[axis] += hop[axis];
            to[b] += hop[b] * (i % 2);
            to[c] += hop[c] * (i / 2);
            let weight = select(1.0 - way.first, way.first, i % 2 == 1) * select(1.0 - way.second, way.second, i / 2 == 1);
            if has_obstructed && obstructs(cell, to - at) {
                extinction += weight * read_optics(channel * count + cell);
                emission += weight * read_optics((6u + channel) * count + cell);
                if has_sources {
                    upwind += weight * source(n, channel, cell);
                }
                continue;
            }
            // The cell of that plane that is nearest, or this one where the plane lies beyond the box.
            let near = clamp(to, vec3<i32>(0), vec3<i32>(cells.xyz) - 1);
            let near_cell = select((u32(near.z) * cells.y + u32(near.y)) * cells.x + u32(near.x), cell, step == 0u);
            if all(near == to) {
                extinction += weight * read_optics(channel * count + near_cell);
                emission += weight * read_optics((6u + channel) * count + near_cell);
                arriving += weight * radiance[(n * params.channels + channel) * count + near_cell];
            } else {
                arriving += weight * params.boundary;
            }
            if has_sources {
                upwind += weight * source(n, channel, near_cell);
            }
        }
        if channel == 0u || params.grey == 0u {
            tau = (read_optics(channel * count + cell) + extinction) * (0.5 * way.length);
            piece = segment(tau);
        }
        var light = piece.x * arriving;
        if has_sources {
            let own = source(n, channel, cell);
            light += own * (tau * piece.y) + (upwind - own) * leaning(tau, piece);
        }
        if params.emits == 1u {
            light += piece.y * (0.5 * way.length) * (read_optics((6u + channel) * count + cell) + emission);
        }
        radiance[(n * params.channels + channel) * count + cell] = light;
    }
}

// ∫ s e^-s ds / τ over 0 to τ, what of a source at Y arrives where that at X is zero: by its series where τ is small.
fn leaning(tau: f32, piece: vec2<f32>) -> f32 {
    if tau < 0.05 {
        return (((tau * (-1.0 / 30.0) + 1.0 / 8.0) * tau - 1.0 / 3.0) * tau + 0.5) * tau;
    }
    return piece.y - piece.x;
}

// Whether a surface stands between a cell and its neighbour so many cells on.
fn obstructs(cell: u32, hop: vec3<i32>) -> bool {
    let bit = vec3<u32>(hop + 1);
    return ((read_obstructed(cell) >> (bit.z * 9u + bit.y * 3u + bit.x)) & 1u) == 1u;
}

// The source function of a cell toward direction `n` of the batch, which `sweep_toward` summed.
fn source(n: u32, channel: u32, cell: u32) -> f32 {
    let count = params.cells.x * params.cells.y * params.cells.z;
    return read_sources((n * params.channels + channel) * count + cell);
}

// Four coefficients of a cell's moments: what the batches before left, and the `taken` directions of this one from `first` on.
fn gather(item: u32, first: u32, taken: u32) {
    let count = params.cells.x * params.cells.y * params.cells.z;
    let cell = item % count;
    let k = 4u * (item / count);
    let channels = max(params.channels, params.weight_channels);
    let last = vec4<u32>(params.coefficients - 1u);
    for (var c = 0u; c < channels; c++) {
        // The last four may be fewer: then the last of them is summed again.
        let each = min(vec4<u32>(k, k + 1u, k + 2u, k + 3u), last);
        var place = (each * channels + c) * count + cell;
        if params.planar == 0u {
            place = (cell * params.coefficients + each) * channels + c;
        }
        var sum = vec4<f32>(0.0);
        if first > 0u {
            sum = vec4<f32>(moments[place.x], moments[place.y], moments[place.z], moments[place.w]);
        }
        let weight = each * params.weight_channels + min(c, params.weight_channels - 1u);
        let light = min(c, params.channels - 1u) * count + cell;
        for (var n = 0u; n < taken; n++) {
            let at = weight + (first + n) * params.coefficients * params.weight_channels;
            let toward = vec4<f32>(read_weights(at.x), read_weights(at.y), read_weights(at.z), read_weights(at.w));
            sum += toward * radiance[light + n * params.channels * count];
        }
        moments[place.x] = sum.x;
        moments[place.y] = sum.y;
        moments[place.z] = sum.z;
        moments[place.w] = sum.w;
    }
}
