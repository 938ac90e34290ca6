// `reduce`: coarse mean and maximum of a field. One invocation a coarse cell.

@compute @workgroup_size(UNITS)
fn reduce(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id) * UNITS + lane;
    if n >= launch.count {
        return;
    }
    let index = launch.start + n;
    let coarse = params.coarse;
    let cell = vec3<u32>(index % coarse.x, index / coarse.x % coarse.y, index / coarse.x / coarse.y);
    // Sum and maximum of the passes before.
    var before = vec2<f32>(0.0);
    if params.row_begin > 0u {
        before = reduced[index - launch.first];
    }
    var most = max(before.y, maximum_density(cell));
    if has_other {
        most = max(most, maximum_other(cell));
    }
    reduced[index - launch.first] = vec2<f32>(mean(cell, before.x), most);
}

// The part of voxel `i` that lies between two places; voxel i fills i to i + 1.
fn share(begin: f32, end: f32, i: u32) -> f32 {
    return max(min(end, f32(i) + 1.0) - max(begin, f32(i)), 0.0);
}

// The mean of the voxels, each weighed by the part of it that lies in the cell: the sum so far with the rows of this
// pass, and in the last pass divided.
fn mean(cell: vec3<u32>, before: f32) -> f32 {
    let begin = vec3<f32>(cell) * params.cell.xyz;
    let end = vec3<f32>(cell + 1u) * params.cell.xyz;
    let size = params.dims.xyz;
    let lo = min(vec3<u32>(floor(begin)), size - 1u);
    let hi = clamp(vec3<u32>(ceil(end)), vec3<u32>(1u), size) - 1u;
    let across = hi.y - lo.y + 1u;
    var rows = across * (hi.z - lo.z + 1u);
    let first = vec3<i32>(lo);
    // What holds zero alone adds nothing.
    if uniform_density(first, vec3<i32>(hi)) && texel_density(first, vec3<i32>(size), 0) == 0.0 {
        rows = 0u;
    }
    var sum = before;
    for (var row = params.row_begin; row < min(params.row_end, rows); row++) {
        let j = lo.y + row % across;
        let k = lo.z + row / across;
        for (var i = lo.x; i <= hi.x; i++) {
            let zeros = empty_density(vec3<i32>(vec3<u32>(i, j, k)));
            if zeros > 0 {
                i += u32(zeros) - 1u;
                continue;
            }
            let w = share(begin.x, end.x, i) * share(begin.y, end.y, j) * share(begin.z, end.z, k);
            sum += w * texel_density(vec3<i32>(vec3<u32>(i, j, k)), vec3<i32>(size), 0);
        }
    }
    if params.row_end < ALL_ROWS {
        return sum;
    }
    let within = max(min(end, vec3<f32>(size)) - begin, vec3<f32>(0.0));
    let weight = within.x * within.y * within.z;
    return select(0.0, sum / max(weight, 1e-30), weight > 0.0);
}
