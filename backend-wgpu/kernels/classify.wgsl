// `classify`: what the values of a grid mean. One workgroup a pack of voxels, one invocation a voxel.

@compute @workgroup_size(PACK)
fn classify(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id);
    if n >= launch.count {
        return;
    }
    let unit = launch.start + n;
    let dims = params.dims;
    let slice = dims.x * dims.y;
    let packs = (slice + PACK - 1u) / PACK;
    let z = unit / packs;
    let place = unit % packs * PACK + lane;
    if place >= slice {
        return;
    }
    let at = vec3<u32>(place % dims.x, place / dims.x, z);
    let p = point(texel_values(vec3<i32>(at), vec3<i32>(dims.xyz), 0));
    // What is written is bound from a slice on.
    let out = (z - launch.first) * slice + place;
    if dims.w < CLASSIFY_COLOR {
        let reach = max(max(p.first.x, p.first.y), p.first.z);
        classified[out] = select(p.place.y, reach, dims.w == CLASSIFY_REACH);
        return;
    }
    let found = color(p);
    classified[4u * out] = found.x;
    classified[4u * out + 1u] = found.y;
    classified[4u * out + 2u] = found.z;
    classified[4u * out + 3u] = 0.0;
}

// What the control points say of a value: linear between two, constant beyond the first and the last.
fn point(value: f32) -> ControlRecord {
    var below = 0u;
    for (var i = 0u; i < params.count; i++) {
        below += u32(read_points(i).place.x <= value);
    }
    let a = read_points(max(below, 1u) - 1u);
    let b = read_points(min(below, params.count - 1u));
    let width = b.place.x - a.place.x;
    // Beyond the ends both are one point, and between them never.
    let f = select(0.0, (value - a.place.x) / width, width > 0.0);
    return ControlRecord(
        a.place + (b.place - a.place) * f,
        a.first + (b.first - a.first) * f,
        a.second + (b.second - a.second) * f,
    );
}

// The colour of a kind that has one.
fn color(p: ControlRecord) -> vec3<f32> {
    if params.dims.w == CLASSIFY_COLOR {
        return p.first.xyz;
    }
    let scatters = p.place.y * p.first.xyz;
    if params.dims.w == CLASSIFY_SCATTERING {
        return scatters;
    }
    return scatters * p.second.xyz;
}
