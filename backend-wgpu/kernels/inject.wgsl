// `inject`: the density of a medium that is described instead of sampled. One workgroup a brick, one invocation a
// column of its samples along z.

@compute @workgroup_size(64)
fn inject(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id);
    if n >= launch.count {
        return;
    }
    let unit = launch.start + n;
    let bricks = params.bricks;
    let brick = vec3<u32>(unit % bricks.x, unit / bricks.x % bricks.y, unit / bricks.x / bricks.y);
    let at = brick * BRICK + vec3<u32>(lane % BRICK, lane / BRICK, 0u);
    let dims = params.dims;
    if at.x >= dims.x || at.y >= dims.y {
        return;
    }
    let high = min(BRICK, dims.z - at.z);
    let slice = dims.x * dims.y;
    // The density is bound from a layer of bricks on.
    let first = (at.z - launch.first * BRICK) * slice + at.y * dims.x + at.x;
    if dims.w == INJECT_GAUSSIANS {
        var sums: array<f32, BRICK>;
        if params.list_begin > 0u {
            // What the passes before left.
            for (var k = 0u; k < high; k++) {
                sums[k] = injected[first + k * slice];
            }
        }
        gaussians(at, brick, &sums);
        for (var k = 0u; k < high; k++) {
            injected[first + k * slice] = min(sums[k], DENSITY_MAX);
        }
        return;
    }
    for (var k = 0u; k < high; k++) {
        let p = place(at + vec3<u32>(0u, 0u, k));
        var value = params.density;
        if dims.w == INJECT_HEIGHT_FOG {
            value *= exp(-max(p.y, 0.0));
        } else {
            if has_base {
                value = texel_base(vec3<i32>(at) + vec3<i32>(0, 0, i32(k)), vec3<i32>(dims.xyz), 0);
            }
            value *= noise_factor(p, params.octaves, params.seed, params.contrast);
        }
        injected[first + k * slice] = min(value, DENSITY_MAX);
    }
}

// The place of a sample.
fn place(at: vec3<u32>) -> vec3<f32> {
    let i = vec4<f32>(vec3<f32>(at), 1.0);
    return vec3<f32>(dot(params.place_x, i), dot(params.place_y, i), dot(params.place_z, i));
}

// e^-q, or 0 from INJECT_FAR on.
fn bell(q: f32) -> f32 {
    return select(0.0, exp(-q), q < INJECT_FAR);
}

// Adds the Gaussians of a brick's list to a column of samples.
fn gaussians(at: vec3<u32>, brick: vec3<u32>, sums: ptr<function, array<f32, BRICK>>) {
    let bin = brick >> vec3<u32>(params.bricks.w);
    let number = (bin.z * params.bins.y + bin.y) * params.bins.x + bin.x;
    let start = read_starts(number);
    let entries = read_starts(number + 1u) - start;
    let first = place(at);
    let up = vec3<f32>(params.place_x.z, params.place_y.z, params.place_z.z);
    for (var i = params.list_begin; i < min(params.list_end, entries); i++) {
        let blob = read_blobs(read_list(start + i));
        let from_center = first - blob.center.xyz;
        for (var k = 0u; k < BRICK; k++) {
            let d = from_center + f32(k) * up;
            (*sums)[k] += bell(dot(d, d) * blob.center.w) * blob.amplitude.x;
        }
    }
}
