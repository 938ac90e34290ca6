// `evaluate`: what clusters of transfer matrices make of light. One invocation a moment, or a unit where folded.

@compute @workgroup_size(UNITS)
fn evaluate(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
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
