// `evaluate`: what clusters of transfer matrices make of light. One invocation a moment, or a unit where folded.

@compute @workgroup_size(UNITS)
fn evaluate(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    if SHARES && params.folded == 0u {
        // An eighth of the invocations take eight moments each, which share the light.
        let n = number(id) * UNITS + 8u * lane;
        if lane < UNITS / 8u && n < launch.count {
            let left = launch.count - n;
            let row = launch.start + n - launch.first * params.coefficients;
            let last = vec4<u32>(left - 1u);
            let sums = moments(row + min(vec4<u32>(0u, 1u, 2u, 3u), last), row + min(vec4<u32>(4u, 5u, 6u, 7u), last));
            keep(row, left, sums[0]);
            keep(row + 4u, max(left, 4u) - 4u, sums[1]);
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

// What eight rows make of light: red, green and blue of four and four.
fn moments(rows: vec4<u32>, others: vec4<u32>) -> array<mat3x4<f32>, 2> {
    let first = rows * params.functions;
    let second = others * params.functions;
    var sums = array<mat3x4<f32>, 2>();
    for (var k = 0u; k < params.functions; k++) {
        let red = read_light(k);
        let green = read_light(params.functions + k);
        let blue = read_light(2u * params.functions + k);
        let a = four(first + k);
        let b = four(second + k);
        sums[0] += mat3x4<f32>(a * red, a * green, a * blue);
        sums[1] += mat3x4<f32>(b * red, b * green, b * blue);
    }
    return sums;
}

// Four of the matrices' numbers.
fn four(at: vec4<u32>) -> vec4<f32> {
    return vec4<f32>(read_matrices(at.x), read_matrices(at.y), read_matrices(at.z), read_matrices(at.w));
}

// Writes up to four moments.
fn keep(row: u32, left: u32, sums: mat3x4<f32>) {
    let s = transpose(sums);
    if left > 0u { evaluated[row] = vec4<f32>(s[0], 0.0); }
    if left > 1u { evaluated[row + 1u] = vec4<f32>(s[1], 0.0); }
    if left > 2u { evaluated[row + 2u] = vec4<f32>(s[2], 0.0); }
    if left > 3u { evaluated[row + 3u] = vec4<f32>(s[3], 0.0); }
}
