// `relight`: in-scattered radiance from records and light. One invocation a cell.

@compute @workgroup_size(UNITS)
fn relight(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id) * UNITS + lane;
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
        in_scatter[cell * params.layers + layer] = vec4<f32>(sum, 0.0);
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
