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
    var found = gathered_density(cell, before);
    if coarse.w > 0u {
        found.y = max(before.y, probe_density(cell));
        if has_other {
            found.y = max(found.y, probe_other(cell));
        }
    } else if has_other {
        found.y = gathered_other(cell, found).y;
    }
    if params.row_end == ALL_ROWS {
        found.x = mean(cell, found.x);
    }
    reduced[index - launch.first] = found;
}

// The part of voxel `i` that lies between two places; voxel i fills i to i + 1.
fn share(begin: f32, end: f32, i: i32) -> f32 {
    return max(min(end, f32(i) + 1.0) - max(begin, f32(i)), 0.0);
}

// The mean over a cell with this sum.
fn mean(cell: vec3<u32>, sum: f32) -> f32 {
    let begin = vec3<f32>(cell) * params.cell.xyz;
    let end = vec3<f32>(cell + 1u) * params.cell.xyz;
    let within = max(min(end, vec3<f32>(params.dims.xyz)) - begin, vec3<f32>(0.0));
    let weight = within.x * within.y * within.z;
    return select(0.0, sum / max(weight, 1e-30), weight > 0.0);
}
