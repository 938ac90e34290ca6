// The maximum of the field FIELD over a coarse cell; instantiated for each field of `reduce`.

// The maximum over every voxel that a lookup in the widened cell can touch, or over probes.
fn maximum_FIELD(cell: vec3<u32>) -> f32 {
    if params.coarse.w > 0u {
        return probe_FIELD(cell);
    }
    let margin = params.cell.w * params.cell.xyz + REDUCE_SLACK;
    let size = vec3<i32>(params.dims.xyz);
    let last = vec3<f32>(size - 1);
    let begin = vec3<f32>(cell) * params.cell.xyz - 0.5 - margin;
    let end = vec3<f32>(cell + 1u) * params.cell.xyz - 0.5 + margin;
    let lo = vec3<i32>(clamp(floor(begin), vec3<f32>(0.0), last));
    let hi = vec3<i32>(clamp(floor(end) + 1.0, vec3<f32>(0.0), last));
    var most = 0.0;
    for (var k = lo.z; k <= hi.z; k++) {
        for (var j = lo.y; j <= hi.y; j++) {
            for (var i = lo.x; i <= hi.x; i++) {
                most = max(most, texel_FIELD(vec3<i32>(i, j, k), size, 0));
            }
        }
    }
    return most;
}

// The maximum of n³ lookups, evenly spread over the cell.
fn probe_FIELD(cell: vec3<u32>) -> f32 {
    let n = params.coarse.w;
    let size = vec3<i32>(params.dims.xyz);
    var most = 0.0;
    for (var k = 0u; k < n; k++) {
        for (var j = 0u; j < n; j++) {
            for (var i = 0u; i < n; i++) {
                let place = vec3<f32>(cell) + (vec3<f32>(vec3<u32>(i, j, k)) + 0.5) / f32(n);
                most = max(most, sample_FIELD(place * params.cell.xyz - 0.5, size, 0));
            }
        }
    }
    return most;
}
