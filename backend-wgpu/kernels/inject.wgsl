// `inject`: the density of a medium that is described instead of sampled. One workgroup a brick, one invocation WIDE by ROWS columns
// of TALL samples along z.

// Vectors of four samples of an invocation's column, and of all.
const FOURS: u32 = TALL / 4u;
const ALL_FOURS: u32 = WIDE * ROWS * FOURS;

// Invocations of a brick along x and y.
const ACROSS: u32 = BRICK / WIDE;
const ALONG: u32 = BRICK / ROWS;

// Drivers that run on processors put invocations together along x alone.
@compute @workgroup_size(ACROSS * ALONG * (BRICK / TALL))
fn inject(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id);
    if n >= launch.count {
        return;
    }
    let unit = launch.start + n;
    let bricks = params.bricks;
    let brick = vec3<u32>(unit % bricks.x, unit / bricks.x % bricks.y, unit / bricks.x / bricks.y);
    let part = vec3<u32>(lane % ACROSS, lane / ACROSS % ALONG, lane / (ACROSS * ALONG));
    let at = brick * BRICK + part * vec3<u32>(WIDE, ROWS, TALL);
    let dims = params.dims;
    if any(at >= dims.xyz) {
        return;
    }
    let wide = min(WIDE, dims.x - at.x);
    let rows = min(ROWS, dims.y - at.y);
    let high = min(TALL, dims.z - at.z);
    let slice = dims.x * dims.y;
    // The density is bound from a layer of bricks on.
    let first = (at.z - launch.first * BRICK) * slice + at.y * dims.x + at.x;
    if dims.w == INJECT_GAUSSIANS {
        var sums: array<vec4<f32>, ALL_FOURS>;
        if params.list_begin > 0u {
            // What the passes before left; of what lies beyond the lattice anything, for it is not kept.
            for (var n = 0u; n < ALL_FOURS; n++) {
                let column = n / FOURS;
                let begin = first + min(column / WIDE, rows - 1u) * dims.x + min(column % WIDE, wide - 1u);
                let up = min(n % FOURS * 4u + vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(high - 1u)) * slice;
                let begins = vec4<u32>(begin) + up;
                sums[n] = vec4<f32>(injected[begins.x], injected[begins.y], injected[begins.z], injected[begins.w]);
            }
        }
        gaussians(at, brick, &sums);
        for (var n = 0u; n < ALL_FOURS; n++) {
            let column = n / FOURS;
            let up = n % FOURS * 4u;
            let to = first + column / WIDE * dims.x + column % WIDE + up * slice;
            let four = min(sums[n], vec4<f32>(DENSITY_MAX));
            if column / WIDE < rows && column % WIDE < wide {
                if high > up { injected[to] = four.x; }
                if high > up + 1u { injected[to + slice] = four.y; }
                if high > up + 2u { injected[to + 2u * slice] = four.z; }
                if high > up + 3u { injected[to + 3u * slice] = four.w; }
            }
        }
        return;
    }
    for (var column = 0u; column < wide * rows; column++) {
        for (var k = 0u; k < high; k++) {
            let on = vec3<u32>(column % wide, column / wide, k);
            let p = place(at + on);
            var value = params.density;
            if dims.w == INJECT_HEIGHT_FOG {
                value *= exp(-max(p.y, 0.0));
            } else {
                if has_base {
                    value = texel_base(vec3<i32>(at + on), vec3<i32>(dims.xyz), 0);
                }
                value *= noise_factor(p, params.octaves, params.seed, params.contrast);
            }
            injected[first + on.y * dims.x + on.x + on.z * slice] = min(value, DENSITY_MAX);
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
fn gaussians(at: vec3<u32>, brick: vec3<u32>, sums: ptr<function, array<vec4<f32>, ALL_FOURS>>) {
    let bin = brick >> vec3<u32>(params.bricks.w);
    let number = (bin.z * params.bins.y + bin.y) * params.bins.x + bin.x;
    let start = read_starts(number);
    let entries = read_starts(number + 1u) - start;
    let end = min(params.list_end, entries);
    let first = place(at);
    let across = vec3<f32>(params.place_x.x, params.place_y.x, params.place_z.x);
    let along = vec3<f32>(params.place_x.y, params.place_y.y, params.place_z.y);
    let up = vec3<f32>(params.place_x.z, params.place_y.z, params.place_z.z);
    let steps = vec4<f32>(0.0, 1.0, 2.0, 3.0);
    if CUBES && params.bins.w > 0u {
        // Where the lattice's edges stand at right angles, the exponential of a sum of three squares along them is a product of
        // three: twelve of them make those of a cube of 4³ samples.
        let edge = sqrt(vec3<f32>(dot(across, across), dot(along, along), dot(up, up)));
        for (var i = params.list_begin; i < end; i++) {
            let blob = read_blobs(read_list(start + i));
            let d = first - blob.center.xyz;
            let t = vec3<f32>(dot(d, across), dot(d, along), dot(d, up)) / edge;
            let x = t.x + steps * edge.x;
            let y = t.y + steps * edge.y;
            let z = t.z + steps * edge.z;
            let columns = bell(x * x * blob.center.w) * blob.amplitude.x;
            let rows = bell(y * y * blob.center.w);
            let upward = bell(z * z * blob.center.w);
            for (var j = 0u; j < ROWS; j++) {
                (*sums)[4u * j] += columns.x * upward * rows[j];
                (*sums)[4u * j + 1u] += columns.y * upward * rows[j];
                (*sums)[4u * j + 2u] += columns.z * upward * rows[j];
                (*sums)[4u * j + 3u] += columns.w * upward * rows[j];
            }
        }
        return;
    }
    for (var i = params.list_begin; i < end; i++) {
        let blob = read_blobs(read_list(start + i));
        for (var n = 0u; n < ALL_FOURS; n++) {
            let column = n / FOURS;
            let d = first - blob.center.xyz + f32(column / WIDE) * along + f32(column % WIDE) * across;
            let k = f32(n % FOURS * 4u) + steps;
            let x = d.x + k * up.x;
            let y = d.y + k * up.y;
            let z = d.z + k * up.z;
            (*sums)[n] += bell((x * x + y * y + z * z) * blob.center.w) * blob.amplitude.x;
        }
    }
}
