// The moments of a batch of `sweep`. One invocation four coefficients of four cells, which share what they load.

@compute @workgroup_size(UNITS)
fn sweep_moments(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    // Workgroups of the same cells follow each other, while the radiance is in caches.
    let group = number(id);
    let groups = (params.coefficients + 3u) / 4u;
    let at = vec2<u32>(group % groups, group / groups * UNITS + lane);
    let count = params.cells.x * params.cells.y * params.cells.z;
    if 4u * at.y >= count {
        return;
    }
    let first = launch.start / (params.cells.w + 1u) * params.batch;
    let taken = min(params.batch, params.directions - first);
    // The last four may be fewer: then the last of them is summed again.
    let k = min(4u * at.x + vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(params.coefficients - 1u));
    let cell = min(4u * at.y + vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(count - 1u));
    let channels = max(params.channels, params.weight_channels);
    for (var c = 0u; c < channels; c++) {
        var a = before(first, k.x, c, cell);
        var b = before(first, k.y, c, cell);
        var d = before(first, k.z, c, cell);
        var e = before(first, k.w, c, cell);
        let weight = (first * params.coefficients + k) * params.weight_channels + min(c, params.weight_channels - 1u);
        let light = min(c, params.channels - 1u) * count + cell;
        let to_next = params.coefficients * params.weight_channels;
        // Two directions a turn, whose lookups do not wait for each other.
        for (var n = 0u; n < taken; n += 2u) {
            let last = min(n + 1u, taken - 1u);
            let near = four_radiance(light + n * params.channels * count);
            let far = select(vec4<f32>(0.0), four_radiance(light + last * params.channels * count), n + 1u < taken);
            let at = weight + n * to_next;
            let next = weight + last * to_next;
            a = a + read_weights(at.x) * near + read_weights(next.x) * far;
            b = b + read_weights(at.y) * near + read_weights(next.y) * far;
            d = d + read_weights(at.z) * near + read_weights(next.z) * far;
            e = e + read_weights(at.w) * near + read_weights(next.w) * far;
        }
        keep(k.x, c, cell, a);
        if 4u * at.x + 1u < params.coefficients {
            keep(k.y, c, cell, b);
        }
        if 4u * at.x + 2u < params.coefficients {
            keep(k.z, c, cell, d);
        }
        if 4u * at.x + 3u < params.coefficients {
            keep(k.w, c, cell, e);
        }
    }
}

fn four_radiance(i: vec4<u32>) -> vec4<f32> {
    return vec4<f32>(read_radiance(i.x), read_radiance(i.y), read_radiance(i.z), read_radiance(i.w));
}

// Where coefficient `k` of four cells stands.
fn places(k: u32, c: u32, cell: vec4<u32>) -> vec4<u32> {
    let channels = max(params.channels, params.weight_channels);
    let count = params.cells.x * params.cells.y * params.cells.z;
    return select((cell * params.coefficients + k) * channels + c, (k * channels + c) * count + cell, vec4<bool>(params.planar == 1u));
}

// What the batches before left.
fn before(first: u32, k: u32, c: u32, cell: vec4<u32>) -> vec4<f32> {
    if first == 0u {
        return vec4<f32>(0.0);
    }
    let at = places(k, c, cell);
    return vec4<f32>(moments[at.x], moments[at.y], moments[at.z], moments[at.w]);
}

fn keep(k: u32, c: u32, cell: vec4<u32>, value: vec4<f32>) {
    let at = places(k, c, cell);
    moments[at.x] = value.x;
    moments[at.y] = value.y;
    moments[at.z] = value.z;
    moments[at.w] = value.w;
}
