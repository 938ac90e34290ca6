// `classify`: what the values of a grid mean. One workgroup four packs of voxels, one invocation a voxel of each.

@compute @workgroup_size(PACK)
fn classify(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let units = PACKS * number(id) + vec4<u32>(0u, 1u, 2u, 3u);
    let dims = params.dims;
    let slice = dims.x * dims.y;
    let packs = (slice + PACK - 1u) / PACK;
    let z = (launch.start + units) / packs;
    let place = (launch.start + units) % packs * PACK + lane;
    let there = (units < vec4<u32>(launch.count)) & (place < vec4<u32>(slice));
    let x = place % dims.x;
    let y = place / dims.x;
    let size = vec3<i32>(dims.xyz);
    let values = vec4<f32>(
        texel_values(vec3<i32>(vec3<u32>(x.x, y.x, z.x)), size, 0),
        texel_values(vec3<i32>(vec3<u32>(x.y, y.y, z.y)), size, 0),
        texel_values(vec3<i32>(vec3<u32>(x.z, y.z, z.z)), size, 0),
        texel_values(vec3<i32>(vec3<u32>(x.w, y.w, z.w)), size, 0),
    );
    var below = vec4<u32>(0u);
    for (var i = 0u; i < params.count; i++) {
        below += vec4<u32>(vec4<f32>(read_points(i).place.x) <= values);
    }
    // What is written is bound from a slice on.
    let out = (z - launch.first) * slice + place;
    write(there.x, out.x, point(values.x, below.x));
    write(there.y, out.y, point(values.y, below.y));
    write(there.z, out.z, point(values.z, below.z));
    write(there.w, out.w, point(values.w, below.w));
}

// What a voxel is, if it is there.
fn write(there: bool, out: u32, p: ControlRecord) {
    if !there {
        return;
    }
    if params.dims.w < CLASSIFY_COLOR {
        let reach = max(max(p.first.x, p.first.y), p.first.z);
        write_classified(out, select(p.place.y, reach, params.dims.w == CLASSIFY_REACH));
        return;
    }
    put_classified(out, vec4<f32>(color(p), 0.0));
}

// What the control points say of a value with so many of them at or below it: linear between two, constant beyond the first and
// the last.
fn point(value: f32, below: u32) -> ControlRecord {
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
