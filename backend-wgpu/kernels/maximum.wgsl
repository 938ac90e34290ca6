// Sum and maximum of the field FIELD over a coarse cell; instantiated for each field of `reduce`.

// The sum of the voxels, each weighed by the part of it that lies in the cell, and the maximum over every voxel that a lookup
// in the widened cell can touch: those so far, with the rows of this pass. A maximum over probes touches no more than the cell.
fn gathered_FIELD(cell: vec3<u32>, before: vec2<f32>) -> vec2<f32> {
    let margin = params.cell.w * params.cell.xyz + REDUCE_SLACK;
    let size = vec3<i32>(params.dims.xyz);
    let begin = vec3<f32>(cell) * params.cell.xyz;
    let end = vec3<f32>(cell + 1u) * params.cell.xyz;
    var lo = vec3<i32>(within_FIELD(floor(begin - 0.5 - margin), size));
    var hi = vec3<i32>(within_FIELD(floor(end - 0.5 + margin) + 1.0, size));
    if params.coarse.w > 0u {
        lo = min(vec3<i32>(floor(begin)), size - 1);
        hi = clamp(vec3<i32>(ceil(end)), vec3<i32>(1), size) - 1;
    }
    let across = u32(hi.y - lo.y + 1);
    var rows = across * u32(hi.z - lo.z + 1);
    // What holds zero alone adds nothing.
    if uniform_FIELD(lo, hi) && texel_FIELD(lo, size, 0) == 0.0 {
        rows = 0u;
    }
    var sum = before.x;
    var most = before.y;
    var j = lo.y + i32(params.row_begin % across);
    var k = lo.z + i32(params.row_begin / across);
    for (var row = params.row_begin; row < min(params.row_end, rows); row++) {
        var of_row = 0.0;
        // Five voxels a turn, whose lookups do not wait for each other: rows are ten where cells share a side with blocks.
        for (var i = lo.x; i <= hi.x; i += 5) {
            let zeros = empty_FIELD(vec3<i32>(i, j, k));
            if zeros > 0 {
                i += zeros - 5;
                continue;
            }
            let at = i + vec4<i32>(1, 2, 3, 4);
            let first = texel_FIELD(vec3<i32>(i, j, k), size, 0);
            var next = vec4<f32>(
                texel_FIELD(vec3<i32>(at.x, j, k), size, 0), texel_FIELD(vec3<i32>(at.y, j, k), size, 0),
                texel_FIELD(vec3<i32>(at.z, j, k), size, 0), texel_FIELD(vec3<i32>(at.w, j, k), size, 0),
            );
            next = select(vec4<f32>(0.0), next, at <= vec4<i32>(hi.x));
            of_row += share(begin.x, end.x, i) * first + share(begin.x, end.x, at.x) * next.x
                + share(begin.x, end.x, at.y) * next.y + share(begin.x, end.x, at.z) * next.z
                + share(begin.x, end.x, at.w) * next.w;
            most = larger(larger(most, first), larger(larger(next.x, next.y), larger(next.z, next.w)));
        }
        sum += share(begin.y, end.y, j) * share(begin.z, end.z, k) * of_row;
        j += 1;
        if j > hi.y {
            j = lo.y;
            k += 1;
        }
    }
    return vec2<f32>(sum, most);
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
