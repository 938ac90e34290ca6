// `evaluate`: what clusters of transfer matrices make of light. One invocation a moment, or a unit where folded.

@compute @workgroup_size(UNITS)
fn evaluate(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    if SHARES && params.folded == 0u {
        // Half of the invocations take eight moments each, which share the light: every fourth, so that the rows of a packet begin
        // at the same place of a texel.
        let n = number(id) * 4u * UNITS + lane / (UNITS / 8u) + 32u * (lane % (UNITS / 8u));
        if lane < UNITS / 2u && n < launch.count {
            let row = launch.start + n - launch.first * params.coefficients;
            let sums = moments(row);
            keep(row, (launch.count - n + 3u) / 4u, sums[0]);
            keep(row + 16u, max((launch.count - n + 3u) / 4u, 4u) - 4u, sums[1]);
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

// What every fourth of 32 rows makes of light: red, green and blue of four and four.
fn moments(row: u32) -> array<mat3x4<f32>, 2> {
    let functions = params.functions;
    let first = (row + vec4<u32>(0u, 4u, 8u, 12u)) * functions;
    let second = (row + vec4<u32>(16u, 20u, 24u, 28u)) * functions;
    var sums = array<mat3x4<f32>, 2>();
    // What comes before the first whole texel and after the last.
    let head = min((4u - first.x % 4u) % 4u, functions);
    let fours = (functions - head) / 4u;
    let rest = functions - 4u * fours;
    for (var i = 0u; i < rest; i++) {
        let k = select(i + 4u * fours, i, i < head);
        let light = vec3<f32>(read_light(k), read_light(functions + k), read_light(2u * functions + k));
        let a = vec4<f32>(
            read_matrices(first.x + k), read_matrices(first.y + k), read_matrices(first.z + k), read_matrices(first.w + k),
        );
        let b = vec4<f32>(
            read_matrices(second.x + k), read_matrices(second.y + k), read_matrices(second.z + k), read_matrices(second.w + k),
        );
        sums[0] += mat3x4<f32>(a * light.x, a * light.y, a * light.z);
        sums[1] += mat3x4<f32>(b * light.x, b * light.y, b * light.z);
    }
    // The light of each channel begins somewhere within a texel.
    let begin = head + vec3<u32>(0u, functions, 2u * functions);
    let at = begin / 4u;
    let off = begin % 4u;
    var red = read_four_light(at.x);
    var green = read_four_light(at.y);
    var blue = read_four_light(at.z);
    let near = (first + head) / 4u;
    let far = (second + head) / 4u;
    for (var t = 0u; t < fours; t++) {
        let next_red = read_four_light(at.x + t + 1u);
        let next_green = read_four_light(at.y + t + 1u);
        let next_blue = read_four_light(at.z + t + 1u);
        let r = from_two(red, next_red, off.x);
        let g = from_two(green, next_green, off.y);
        let b = from_two(blue, next_blue, off.z);
        sums[0] += arriving(near + t, r, g, b);
        sums[1] += arriving(far + t, r, g, b);
        red = next_red;
        green = next_green;
        blue = next_blue;
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

// Writes up to four moments.
fn keep(row: u32, left: u32, sums: mat3x4<f32>) {
    let s = transpose(sums);
    if left > 0u { evaluated[row] = vec4<f32>(s[0], 0.0); }
    if left > 1u { evaluated[row + 4u] = vec4<f32>(s[1], 0.0); }
    if left > 2u { evaluated[row + 8u] = vec4<f32>(s[2], 0.0); }
    if left > 3u { evaluated[row + 12u] = vec4<f32>(s[3], 0.0); }
}
