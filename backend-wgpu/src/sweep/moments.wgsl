// The moments of a batch of `sweep`. One invocation four coefficients of eight cells, which share what they load.

@compute @workgroup_size(UNITS)
fn sweep_moments(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    // Workgroups of the same cells follow each other, while the radiance is in caches.
    let group = number(id);
    let groups = (params.coefficients + 3u) / 4u;
    let at = vec2<u32>(group % groups, group / groups * UNITS + lane);
    let count = params.cells.x * params.cells.y * params.cells.z;
    if 8u * at.y >= count {
        return;
    }
    let first = launch.start / (params.cells.w + 1u) * params.batch;
    let taken = min(params.batch, params.directions - first);
    // The last four may be fewer: then the last of them is summed again.
    let k = min(4u * at.x + vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(params.coefficients - 1u));
    let cell = min(8u * at.y + vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(count - 1u));
    let beside = min(8u * at.y + vec4<u32>(4u, 5u, 6u, 7u), vec4<u32>(count - 1u));
    let channels = max(params.channels, params.weight_channels);
    for (var c = 0u; c < channels; c++) {
        var a = before(first, k.x, c, cell, beside);
        var b = before(first, k.y, c, cell, beside);
        var d = before(first, k.z, c, cell, beside);
        var e = before(first, k.w, c, cell, beside);
        let weight = (first * params.coefficients + k) * params.weight_channels + min(c, params.weight_channels - 1u);
        let plane = min(c, params.channels - 1u) * count;
        let to_next = params.coefficients * params.weight_channels;
        // Two directions a turn, whose lookups do not wait for each other.
        for (var n = 0u; n < taken; n += 2u) {
            let last = min(n + 1u, taken - 1u);
            let here = plane + n * params.channels * count;
            let there = plane + last * params.channels * count;
            // What each direction begins with is asked for before the rest, for that is what is far away.
            let begin = vec2<f32>(read_radiance(here + cell.x), read_radiance(there + cell.x));
            let near = eight_radiance(begin.x, here + cell, here + beside);
            let of_last = eight_radiance(begin.y, there + cell, there + beside);
            let two = n + 1u < taken;
            let far = mat2x4<f32>(select(vec4<f32>(0.0), of_last[0], two), select(vec4<f32>(0.0), of_last[1], two));
            let at = weight + n * to_next;
            let next = weight + last * to_next;
            a = a + read_weights(at.x) * near + read_weights(next.x) * far;
            b = b + read_weights(at.y) * near + read_weights(next.y) * far;
            d = d + read_weights(at.z) * near + read_weights(next.z) * far;
            e = e + read_weights(at.w) * near + read_weights(next.w) * far;
        }
        keep(k.x, c, cell, beside, a);
        if 4u * at.x + 1u < params.coefficients {
            keep(k.y, c, cell, beside, b);
        }
        if 4u * at.x + 2u < params.coefficients {
            keep(k.z, c, cell, beside, d);
        }
        if 4u * at.x + 3u < params.coefficients {
            keep(k.w, c, cell, beside, e);
        }
    }
}

// Of eight cells, of which the first is known.
fn eight_radiance(first: f32, i: vec4<u32>, beside: vec4<u32>) -> mat2x4<f32> {
    return mat2x4<f32>(
        vec4<f32>(first, read_radiance(i.y), read_radiance(i.z), read_radiance(i.w)),
        vec4<f32>(read_radiance(beside.x), read_radiance(beside.y), read_radiance(beside.z), read_radiance(beside.w)),
    );
}

// Where coefficient `k` of four cells stands.
fn places(k: u32, c: u32, cell: vec4<u32>) -> vec4<u32> {
    let channels = max(params.channels, params.weight_channels);
    let count = params.cells.x * params.cells.y * params.cells.z;
    return select((cell * params.coefficients + k) * channels + c, (k * channels + c) * count + cell, vec4<bool>(params.planar == 1u));
}

// What the batches before left.
fn before(first: u32, k: u32, c: u32, cell: vec4<u32>, beside: vec4<u32>) -> mat2x4<f32> {
    if first == 0u {
        return mat2x4<f32>();
    }
    let at = places(k, c, cell);
    let on = places(k, c, beside);
    return mat2x4<f32>(
        moments[at.x], moments[at.y], moments[at.z], moments[at.w], moments[on.x], moments[on.y], moments[on.z], moments[on.w],
    );
}

fn keep(k: u32, c: u32, cell: vec4<u32>, beside: vec4<u32>, value: mat2x4<f32>) {
    keep_four(places(k, c, cell), value[0]);
    keep_four(places(k, c, beside), value[1]);
}

fn keep_four(at: vec4<u32>, value: vec4<f32>) {
    moments[at.x] = value.x;
    moments[at.y] = value.y;
    moments[at.z] = value.z;
    moments[at.w] = value.w;
}
