// `evaluate`: what clusters of transfer matrices make of light. One invocation a moment, or a unit where folded.

// What each invocation of a workgroup makes of its rows, where they share rows: the first row's red, green and blue of all, then the
// second's.
var<workgroup> shared_sums: array<f32, SHARED_SUMS>;

@compute @workgroup_size(UNITS)
fn evaluate(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    if SHARES && params.folded == 0u {
        // Four invocations take eight moments, each every fourth texel of their rows: a packet loads what follows each other.
        let n = number(id) * 2u * UNITS + 8u * (lane / 4u);
        let row = launch.start + n - launch.first * params.coefficients;
        leave(lane, moments(row, lane % 4u));
        workgroupBarrier();
        let slot = 2u * (lane % 4u);
        for (var i = 0u; i < 2u; i++) {
            if n + slot + i < launch.count {
                evaluated[row + slot + i] = vec4<f32>(joined(lane, slot + i), 0.0);
            }
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
    let fours = params.functions / 4u;
    var sum = vec3<f32>(0.0);
    for (var t = 0u; t < fours; t++) {
        let m = read_four_matrices(row * fours + t);
        sum += vec3<f32>(
            dot(m, read_four_light(t)), dot(m, read_four_light(fours + t)), dot(m, read_four_light(2u * fours + t)),
        );
    }
    return sum;
}

// What every fourth texel of eight rows, from the one of this number on, makes of light: red, green and blue of four and four.
fn moments(row: u32, begin: u32) -> array<mat3x4<f32>, 2> {
    let fours = params.functions / 4u;
    let first = (row + vec4<u32>(0u, 1u, 2u, 3u)) * fours;
    let second = (row + vec4<u32>(4u, 5u, 6u, 7u)) * fours;
    var sums = array<mat3x4<f32>, 2>();
    for (var t = begin; t < fours; t += 4u) {
        let red = read_four_light(t);
        let green = read_four_light(fours + t);
        let blue = read_four_light(2u * fours + t);
        sums[0] += arriving(first + t, red, green, blue);
        sums[1] += arriving(second + t, red, green, blue);
    }
    return sums;
}

// What a texel of each of four rows makes of light.
fn arriving(at: vec4<u32>, red: vec4<f32>, green: vec4<f32>, blue: vec4<f32>) -> mat3x4<f32> {
    let a = read_four_matrices(at.x);
    let b = read_four_matrices(at.y);
    let c = read_four_matrices(at.z);
    let d = read_four_matrices(at.w);
    return mat3x4<f32>(
        vec4<f32>(dot(a, red), dot(b, red), dot(c, red), dot(d, red)),
        vec4<f32>(dot(a, green), dot(b, green), dot(c, green), dot(d, green)),
        vec4<f32>(dot(a, blue), dot(b, blue), dot(c, blue), dot(d, blue)),
    );
}

// Leaves what an invocation makes of eight rows.
fn leave(lane: u32, sums: array<mat3x4<f32>, 2>) {
    for (var c = 0u; c < 3u; c++) {
        for (var i = 0u; i < 4u; i++) {
            shared_sums[(3u * i + c) * UNITS + lane] = sums[0][c][i];
            shared_sums[(3u * (i + 4u) + c) * UNITS + lane] = sums[1][c][i];
        }
    }
}

// What the four invocations that this one is of make of a row.
fn joined(lane: u32, slot: u32) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    for (var i = 0u; i < 4u; i++) {
        let at = 3u * slot * UNITS + lane / 4u * 4u + i;
        sum += vec3<f32>(shared_sums[at], shared_sums[at + UNITS], shared_sums[at + 2u * UNITS]);
    }
    return sum;
}
