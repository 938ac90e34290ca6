// `evaluate`: what clusters of transfer matrices make of light. One invocation a moment, or a unit where folded.

@compute @workgroup_size(UNITS)
fn evaluate(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    if SHARES && params.folded == 0u {
        // A quarter of the invocations take four moments each, which share the light.
        let n = number(id) * UNITS + 4u * lane;
        if lane < UNITS / 4u && n < launch.count {
            let left = launch.count - n;
            let row = launch.start + n - launch.first * params.coefficients;
            let sums = moments(row + min(vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(left - 1u)));
            evaluated[row] = vec4<f32>(sums[0].x, sums[1].x, sums[2].x, 0.0);
            if left > 1u { evaluated[row + 1u] = vec4<f32>(sums[0].y, sums[1].y, sums[2].y, 0.0); }
            if left > 2u { evaluated[row + 2u] = vec4<f32>(sums[0].z, sums[1].z, sums[2].z, 0.0); }
            if left > 3u { evaluated[row + 3u] = vec4<f32>(sums[0].w, sums[1].w, sums[2].w, 0.0); }
        }
        return;
    }
    let n = number(id) * UNITS + lane;
    if n >= launch.count {
        return;
    }
    let index = launch.start + n;
    if params.folded == 0u {
        let row = index - launch.first * params.coefficients;
        evaluated[row] = vec4<f32>(moment(row), 0.0);
        return;
    }
    let unit = index - launch.first;
    let cluster = index / params.per_cluster;
    var sum = vec3<f32>(0.0);
    if params.coefficient_begin > 0u {
        // What the passes before left.
        sum = evaluated[unit].xyz;
    }
    for (var j = params.coefficient_begin; j < params.coefficient_end; j++) {
        sum += read_views(cluster * params.coefficients + j) * moment(unit * params.coefficients + j);
    }
    evaluated[unit] = vec4<f32>(sum, 0.0);
}

// What a row of the matrices makes of light.
fn moment(row: u32) -> vec3<f32> {
    let first = row * params.functions;
    var sum = vec3<f32>(0.0);
    for (var k = 0u; k < params.functions; k++) {
        sum += read_matrices(first + k) * vec3<f32>(read_light(k), read_light(params.functions + k), read_light(2u * params.functions + k));
    }
    return sum;
}

// What four rows make of light: red, green and blue.
fn moments(rows: vec4<u32>) -> mat3x4<f32> {
    let first = rows * params.functions;
    var red = vec4<f32>(0.0);
    var green = vec4<f32>(0.0);
    var blue = vec4<f32>(0.0);
    for (var k = 0u; k < params.functions; k++) {
        let at = first + k;
        let row = vec4<f32>(read_matrices(at.x), read_matrices(at.y), read_matrices(at.z), read_matrices(at.w));
        red += row * read_light(k);
        green += row * read_light(params.functions + k);
        blue += row * read_light(2u * params.functions + k);
    }
    return mat3x4<f32>(red, green, blue);
}
