// `reconstruct`: in-scattered radiance from what clusters of transfer matrices make of light. One invocation a cell, or four.

@compute @workgroup_size(UNITS)
fn reconstruct(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id) * UNITS + lane;
    if fours_rows {
        // Four cells, whose rows are a texel.
        let four = launch.start / 4u + n;
        let range = vec2<u32>(launch.start, launch.start + launch.count);
        if 4u * four < range.y {
            reconstruct_four(four, range);
        }
        return;
    }
    if n >= launch.count {
        return;
    }
    let cell = launch.start + n;
    let place = cell - launch.first;
    let row = min(read_rows(place), params.rows);
    let moments = params.bands * params.bands;
    if params.view == 0u {
        for (var j = 0u; j < moments; j++) {
            var light = vec3<f32>(0.0);
            if row > 0u {
                light = read_tables(j) * arriving(row - 1u, cluster(0u, row - 1u), j);
            }
            put_in_scatter(place * moments + j, vec4<f32>(light, 0.0));
        }
        return;
    }
    var sum = vec3<f32>(0.0);
    if row > 0u {
        var basis: array<f32, HARMONICS_MAX>;
        harmonics(view_direction(cell), params.bands, &basis);
        for (var j = 0u; j < moments; j++) {
            sum += read_tables(j) * basis[j] * arriving(row - 1u, cluster(0u, row - 1u), j);
        }
    }
    put_in_scatter(place, vec4<f32>(sum, 0.0));
}

// The moments of cells 4 `four` to 4 `four` + 3, of those of a range. What each waits for is asked for before the rest.
fn reconstruct_four(four: u32, range: vec2<u32>) {
    let moments = params.bands * params.bands;
    let rows = min(read_four_rows(four), vec4<u32>(params.rows));
    let places = max(rows, vec4<u32>(1u)) - 1u;
    let clusters = vec4<u32>(cluster(0u, places.x), cluster(0u, places.y), cluster(0u, places.z), cluster(0u, places.w));
    for (var j = 0u; j < moments; j++) {
        let weight = read_tables(j);
        keep(range, 4u * four, j, rows.x, weight * arriving(places.x, clusters.x, j));
        keep(range, 4u * four + 1u, j, rows.y, weight * arriving(places.y, clusters.y, j));
        keep(range, 4u * four + 2u, j, rows.z, weight * arriving(places.z, clusters.z, j));
        keep(range, 4u * four + 3u, j, rows.w, weight * arriving(places.w, clusters.w, j));
    }
}

// Writes moment `j` of a cell of a range; nothing arrives in row 0.
fn keep(range: vec2<u32>, cell: u32, j: u32, row: u32, light: vec3<f32>) {
    if cell >= range.x && cell < range.y {
        put_in_scatter(cell * params.bands * params.bands + j, vec4<f32>(select(vec3<f32>(0.0), light, row > 0u), 0.0));
    }
}

// A row's cluster in a channel.
fn cluster(channel: u32, row: u32) -> u32 {
    return min(read_clusters(channel * params.rows + row), params.clusters - 1u);
}

// Moment `j` of a row, of which the cluster in the first channel is given; a channel serves all of RGB, or each its own component.
fn arriving(row: u32, first_cluster: u32, j: u32) -> vec3<f32> {
    let first = restored(0u, row, first_cluster, j);
    if params.channels == 1u {
        return first;
    }
    return vec3<f32>(first.x, restored(1u, row, cluster(1u, row), j).y, restored(2u, row, cluster(2u, row), j).z);
}

// Moment `j` of a row in a channel: its cluster's mean, and what it weighs the components.
fn restored(channel: u32, row: u32, cluster: u32, j: u32) -> vec3<f32> {
    let moments = params.bands * params.bands;
    let place = channel * params.rows + row;
    var at = (channel * params.clusters + cluster) * (1u + params.components) * moments + j;
    var sum = read_radiance(at).xyz;
    for (var i = 0u; i < params.components; i += 4u) {
        let weights = four_of(place, i);
        sum += weights.x * read_radiance(at + moments).xyz;
        if i + 1u < params.components {
            sum += weights.y * read_radiance(at + 2u * moments).xyz;
        }
        if i + 2u < params.components {
            sum += weights.z * read_radiance(at + 3u * moments).xyz;
        }
        if i + 3u < params.components {
            sum += weights.w * read_radiance(at + 4u * moments).xyz;
        }
        at += 4u * moments;
    }
    return sum;
}

// What a row weighs four components.
fn four_of(place: u32, i: u32) -> vec4<f32> {
    let first = place * params.components + i;
    if params.components % 4u == 0u {
        return read_four_weights(first / 4u);
    }
    let last = place * params.components + params.components - 1u;
    return vec4<f32>(
        read_weights(first), read_weights(min(first + 1u, last)), read_weights(min(first + 2u, last)),
        read_weights(min(first + 3u, last)),
    );
}

// Unit direction in the world from the eye to a cell's center; +Z where the cell is at the eye.
fn view_direction(cell: u32) -> vec3<f32> {
    let cells = params.cells.xyz;
    let place = vec3<f32>(vec3<u32>(cell % cells.x, cell / cells.x % cells.y, cell / cells.x / cells.y));
    let v = (place + 0.5) * params.cell.xyz - 0.5 - params.eye.xyz;
    let w = vec3<f32>(dot(params.world_x.xyz, v), dot(params.world_y.xyz, v), dot(params.world_z.xyz, v));
    let distance = length(w);
    if distance > 0.0 {
        return w / distance;
    }
    return vec3<f32>(0.0, 0.0, 1.0);
}

// Constant `i` of the spherical harmonics.
fn harmonics_value(i: u32) -> f32 {
    return read_tables(params.bands * params.bands + i);
}
