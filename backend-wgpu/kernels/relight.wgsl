// `relight`: in-scattered radiance from records and light. One invocation a cell, or four cells that share the light.

@compute @workgroup_size(UNITS)
fn relight(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id) * UNITS + lane;
    if fours_records {
        // The first is a multiple of four, whose records begin with a whole texel.
        let four = launch.start / 4u + n;
        let range = vec2<u32>(launch.start, launch.start + launch.count);
        if 4u * four < range.y {
            relight_four(four, range);
        }
        return;
    }
    if n >= launch.count {
        return;
    }
    let cell = launch.start + n - launch.first;
    for (var layer = 0u; layer < params.layers; layer++) {
        var sum = vec3<f32>(0.0);
        if params.layers == 1u {
            for (var k = 0u; k < params.coefficients; k++) {
                sum += read_light(k).xyz * record(cell, k);
            }
            sum += params.emission_weight * glow(cell, 0u);
        } else {
            sum = read_light(layer).xyz * (record(cell, layer) + glow(cell, layer));
        }
        put_in_scatter(cell * params.layers + layer, vec4<f32>(sum, 0.0));
    }
}

// Coefficient `k` of a cell's record; a record of one channel serves all three.
fn record(cell: u32, k: u32) -> vec3<f32> {
    var first = (cell * params.coefficients + k) * params.channels;
    var pitch = 1u;
    if params.planar == 1u {
        // Bound whole, while the output may be bound from a cell on.
        first = k * params.channels * params.cells + cell + launch.first;
        pitch = params.cells;
    }
    if params.channels == 1u {
        return vec3<f32>(read_records(first));
    }
    return vec3<f32>(read_records(first), read_records(first + pitch), read_records(first + 2u * pitch));
}

// Coefficient `k` of the emission's moments.
fn glow(cell: u32, k: u32) -> vec3<f32> {
    if params.emission_coefficients == 0u {
        return vec3<f32>(0.0);
    }
    let at = (cell * params.emission_coefficients + k) * 3u;
    return vec3<f32>(read_emission_records(at), read_emission_records(at + 1u), read_emission_records(at + 2u));
}

// The one layer of cells 4 `four` to 4 `four` + 3, of those of a range.
fn relight_four(four: u32, range: vec2<u32>) {
    let cell = 4u * four;
    var sums = mat4x3<f32>();
    for (var k = 0u; k < params.coefficients; k += 4u) {
        // After the last coefficient it is that one again, and nothing of a record.
        let places = min(k + vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(params.coefficients - 1u));
        let there = k + vec4<u32>(0u, 1u, 2u, 3u) < vec4<u32>(params.coefficients);
        let light = mat4x3<f32>(
            read_light(places.x).xyz, read_light(places.y).xyz, read_light(places.z).xyz, read_light(places.w).xyz,
        );
        let red = records_of_four(four, k, 0u);
        var green = red;
        var blue = red;
        if params.channels == 3u {
            green = records_of_four(four, k, 1u);
            blue = records_of_four(four, k, 2u);
        }
        sums[0] = lit(sums[0], light, there, red[0], green[0], blue[0]);
        sums[1] = lit(sums[1], light, there, red[1], green[1], blue[1]);
        sums[2] = lit(sums[2], light, there, red[2], green[2], blue[2]);
        sums[3] = lit(sums[3], light, there, red[3], green[3], blue[3]);
    }
    let weight = params.emission_weight;
    keep(range, cell, sums[0] + weight * glow(cell, 0u));
    keep(range, cell + 1u, sums[1] + weight * glow(cell + 1u, 0u));
    keep(range, cell + 2u, sums[2] + weight * glow(cell + 2u, 0u));
    keep(range, cell + 3u, sums[3] + weight * glow(cell + 3u, 0u));
}

// A sum with what four coefficients of a record, of which some are there, make of their light, one after the other.
fn lit(sum: vec3<f32>, light: mat4x3<f32>, there: vec4<bool>, red: vec4<f32>, green: vec4<f32>, blue: vec4<f32>) -> vec3<f32> {
    let zero = vec4<f32>(0.0);
    let records = transpose(mat3x4<f32>(select(zero, red, there), select(zero, green, there), select(zero, blue, there)));
    return sum + light[0] * records[0] + light[1] * records[1] + light[2] * records[2] + light[3] * records[3];
}

// Coefficients `k` to `k` + 3 of a channel of the records of four cells.
fn records_of_four(four: u32, k: u32, channel: u32) -> mat4x4<f32> {
    if params.planar == 1u {
        let pitch = params.channels * params.cells;
        let first = k * pitch + channel * params.cells;
        return transpose(mat4x4<f32>(
            read_along_records(four, first), read_along_records(four, first + pitch),
            read_along_records(four, first + 2u * pitch), read_along_records(four, first + 3u * pitch),
        ));
    }
    let values = params.coefficients * params.channels;
    let first = k * params.channels + channel;
    return mat4x4<f32>(
        of_cell(four * values, first), of_cell(four * values, first + values),
        of_cell(four * values, first + 2u * values), of_cell(four * values, first + 3u * values),
    );
}

// Four coefficients of a channel from word `n` after a texel on.
fn of_cell(texel: u32, n: u32) -> vec4<f32> {
    let a = read_along_records(texel, n);
    if params.channels == 1u {
        return a;
    }
    let b = read_along_records(texel, n + 4u);
    return vec4<f32>(a.x, a.w, b.z, read_along_records(texel, n + 8u).y);
}

// Writes a cell of a range.
fn keep(range: vec2<u32>, cell: u32, color: vec3<f32>) {
    if cell >= range.x && cell < range.y {
        put_in_scatter(cell, vec4<f32>(color, 0.0));
    }
}
