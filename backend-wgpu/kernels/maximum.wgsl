// The maximum of the field FIELD over a coarse cell; instantiated for each field of `reduce`.

// The maximum over every voxel that a lookup in the widened cell can touch, or over probes: over the rows of this pass.
fn maximum_FIELD(cell: vec3<u32>) -> f32 {
    if params.coarse.w > 0u {
        return probe_FIELD(cell);
    }
    let margin = params.cell.w * params.cell.xyz + REDUCE_SLACK;
    let size = vec3<i32>(params.dims.xyz);
    let begin = vec3<f32>(cell) * params.cell.xyz - 0.5 - margin;
    let end = vec3<f32>(cell + 1u) * params.cell.xyz - 0.5 + margin;
    let lo = vec3<i32>(within_FIELD(floor(begin), size));
    let hi = vec3<i32>(within_FIELD(floor(end) + 1.0, size));
    let across = u32(hi.y - lo.y + 1);
    let rows = across * u32(hi.z - lo.z + 1);
    if uniform_FIELD(lo, hi) {
        return max(0.0, texel_FIELD(lo, size, 0));
    }
    var most = 0.0;
    for (var row = params.row_begin; row < min(params.row_end, rows); row++) {
        let j = lo.y + i32(row % across);
        let k = lo.z + i32(row / across);
        for (var i = lo.x; i <= hi.x; i++) {
            let zeros = empty_FIELD(vec3<i32>(i, j, k));
            if zeros > 0 {
                i += zeros - 1;
                continue;
            }
            most = max(most, texel_FIELD(vec3<i32>(i, j, k), size, 0));
        }
    }
    return most;
}

// The maximum of n³ lookups, evenly spread over the cell: over the rows of this pass.
fn probe_FIELD(cell: vec3<u32>) -> f32 {
    let n = params.coarse.w;
    let size = vec3<i32>(params.dims.xyz);
    var most = 0.0;
    for (var row = params.row_begin; row < min(params.row_end, n * n); row++) {
        for (var i = 0u; i < n; i++) {
            let place = vec3<f32>(cell) + (vec3<f32>(vec3<u32>(i, row % n, row / n)) + 0.5) / f32(n);
            most = max(most, sample_FIELD(place * params.cell.xyz - 0.5, size, 0));
        }
    }
    return most;
}
