// `inject`: the density of a medium that is described instead of sampled. One workgroup a brick, one invocation ROWS columns of
// its samples along z, which stand beside each other along y.

@compute @workgroup_size(BRICK, BRICK / ROWS)
fn inject(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id);
    if n >= launch.count {
        return;
    }
    let unit = launch.start + n;
    let bricks = params.bricks;
    let brick = vec3<u32>(unit % bricks.x, unit / bricks.x % bricks.y, unit / bricks.x / bricks.y);
    let at = brick * BRICK + vec3<u32>(lane % BRICK, lane / BRICK * ROWS, 0u);
    let dims = params.dims;
    if at.x >= dims.x || at.y >= dims.y {
        return;
    }
    let rows = min(ROWS, dims.y - at.y);
    let high = min(BRICK, dims.z - at.z);
    let slice = dims.x * dims.y;
    // The density is bound from a layer of bricks on.
    let first = (at.z - launch.first * BRICK) * slice + at.y * dims.x + at.x;
    if dims.w == INJECT_GAUSSIANS {
        // Each column in two halves.
        var sums: array<vec4<f32>, 2 * ROWS>;
        if params.list_begin > 0u {
            // What the passes before left; of what lies beyond the lattice anything, for it is not kept.
            let up = min(vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(high - 1u)) * slice;
            let on = min(vec4<u32>(4u, 5u, 6u, 7u), vec4<u32>(high - 1u)) * slice;
            for (var j = 0u; j < ROWS; j++) {
                let begin = first + min(j, rows - 1u) * dims.x;
                let low = vec4<u32>(begin) + up;
                let top = vec4<u32>(begin) + on;
                sums[2u * j] = vec4<f32>(injected[low.x], injected[low.y], injected[low.z], injected[low.w]);
                sums[2u * j + 1u] = vec4<f32>(injected[top.x], injected[top.y], injected[top.z], injected[top.w]);
            }
        }
        gaussians(at, brick, &sums);
        for (var j = 0u; j < ROWS; j++) {
            let to = first + j * dims.x;
            let low = min(sums[2u * j], vec4<f32>(DENSITY_MAX));
            let top = min(sums[2u * j + 1u], vec4<f32>(DENSITY_MAX));
            if j < rows {
                injected[to] = low.x;
                if high > 1u { injected[to + slice] = low.y; }
                if high > 2u { injected[to + 2u * slice] = low.z; }
                if high > 3u { injected[to + 3u * slice] = low.w; }
                if high > 4u { injected[to + 4u * slice] = top.x; }
                if high > 5u { injected[to + 5u * slice] = top.y; }
                if high > 6u { injected[to + 6u * slice] = top.z; }
                if high > 7u { injected[to + 7u * slice] = top.w; }
            }
        }
        return;
    }
    for (var j = 0u; j < rows; j++) {
        for (var k = 0u; k < high; k++) {
            let p = place(at + vec3<u32>(0u, j, k));
            var value = params.density;
            if dims.w == INJECT_HEIGHT_FOG {
                value *= exp(-max(p.y, 0.0));
            } else {
                if has_base {
                    value = texel_base(vec3<i32>(at + vec3<u32>(0u, j, k)), vec3<i32>(dims.xyz), 0);
                }
                value *= noise_factor(p, params.octaves, params.seed, params.contrast);
            }
            injected[first + j * dims.x + k * slice] = min(value, DENSITY_MAX);
        }
    }
}

// The place of a sample.
fn place(at: vec3<u32>) -> vec3<f32> {
    let i = vec4<f32>(vec3<f32>(at), 1.0);
    return vec3<f32>(dot(params.place_x, i), dot(params.place_y, i), dot(params.place_z, i));
}

// e^-q, or 0 from INJECT_FAR on.
fn bell(q: vec4<f32>) -> vec4<f32> {
    return select(vec4<f32>(0.0), exp(-q), q < vec4<f32>(INJECT_FAR));
}

// Adds the Gaussians of a brick's list to columns of samples.
fn gaussians(at: vec3<u32>, brick: vec3<u32>, sums: ptr<function, array<vec4<f32>, 2 * ROWS>>) {
    let bin = brick >> vec3<u32>(params.bricks.w);
    let number = (bin.z * params.bins.y + bin.y) * params.bins.x + bin.x;
    let start = read_starts(number);
    let entries = read_starts(number + 1u) - start;
    let end = min(params.list_end, entries);
    let first = place(at);
    let along = vec3<f32>(params.place_x.y, params.place_y.y, params.place_z.y);
    let up = vec3<f32>(params.place_x.z, params.place_y.z, params.place_z.z);
    // Samples of the halves of a column, from its first.
    let low = vec4<f32>(0.0, 1.0, 2.0, 3.0);
    let top = low + 4.0;
    if ROWS > 1u && params.bins.w > 0u {
        // Where the lattice's edges stand at right angles, the exponential of a sum of three squares along them is a product of
        // three, which columns beside each other share.
        let across = vec3<f32>(params.place_x.x, params.place_y.x, params.place_z.x);
        let edge = sqrt(vec3<f32>(dot(across, across), dot(along, along), dot(up, up)));
        for (var i = params.list_begin; i < end; i++) {
            let blob = read_blobs(read_list(start + i));
            let d = first - blob.center.xyz;
            let t = vec3<f32>(dot(d, across), dot(d, along), dot(d, up)) / edge;
            let over = bell(vec4<f32>(t.x * t.x * blob.center.w)).x * blob.amplitude.x;
            let z_low = t.z + low * edge.z;
            let z_top = t.z + top * edge.z;
            let down_low = over * bell(z_low * z_low * blob.center.w);
            let down_top = over * bell(z_top * z_top * blob.center.w);
            for (var j = 0u; j < ROWS; j++) {
                let y = t.y + f32(j) * edge.y;
                let row = bell(vec4<f32>(y * y * blob.center.w)).x;
                (*sums)[2u * j] += row * down_low;
                (*sums)[2u * j + 1u] += row * down_top;
            }
        }
        return;
    }
    for (var i = params.list_begin; i < end; i++) {
        let blob = read_blobs(read_list(start + i));
        for (var j = 0u; j < ROWS; j++) {
            let d = first - blob.center.xyz + f32(j) * along;
            let x_low = d.x + low * up.x;
            let y_low = d.y + low * up.y;
            let z_low = d.z + low * up.z;
            let x_top = d.x + top * up.x;
            let y_top = d.y + top * up.y;
            let z_top = d.z + top * up.z;
            let q_low = (x_low * x_low + y_low * y_low + z_low * z_low) * blob.center.w;
            let q_top = (x_top * x_top + y_top * y_top + z_top * z_top) * blob.center.w;
            (*sums)[2u * j] += bell(q_low) * blob.amplitude.x;
            (*sums)[2u * j + 1u] += bell(q_top) * blob.amplitude.x;
        }
    }
}
