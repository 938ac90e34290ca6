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
    let last = min(params.row_end, rows);
    // Five voxels of two rows a turn, whose lookups do not wait for each other: rows are ten where cells share a side with blocks.
    for (var row = params.row_begin; row < last; row += 2u) {
        let next = select(vec2<i32>(j + 1, k), vec2<i32>(lo.y, k + 1), j == hi.y);
        // Nothing of the second row where there is none.
        let end_of_next = select(lo.x - 1, hi.x, row + 1u < last);
        var of_row = 0.0;
        var of_next = 0.0;
        for (var i = lo.x; i <= hi.x; i += 5) {
            let zeros = min(empty_FIELD(vec3<i32>(i, j, k)), empty_FIELD(vec3<i32>(i, next)));
            if zeros > 0 {
                i += zeros - 5;
                continue;
            }
            let a = five_FIELD(vec3<i32>(i, j, k), hi.x, size);
            let b = five_FIELD(vec3<i32>(i, next), end_of_next, size);
            let first = share(begin.x, end.x, i);
            let rest = vec4<f32>(
                share(begin.x, end.x, i + 1), share(begin.x, end.x, i + 2),
                share(begin.x, end.x, i + 3), share(begin.x, end.x, i + 4),
            );
            of_row += first * a.first + dot(rest, a.rest);
            of_next += first * b.first + dot(rest, b.rest);
            most = larger(most, larger(a.most, b.most));
        }
        sum += share(begin.y, end.y, j) * share(begin.z, end.z, k) * of_row;
        sum += share(begin.y, end.y, next.x) * share(begin.z, end.z, next.y) * of_next;
        j = select(next.x + 1, lo.y, next.x == hi.y);
        k = select(next.y, next.y + 1, next.x == hi.y);
    }
    return vec2<f32>(sum, most);
}

// Five voxels of a row.
struct Five_FIELD {
    first: f32,
    rest: vec4<f32>,
    most: f32,
}

// Five voxels of a row from `at` on; zero beyond `last`.
fn five_FIELD(at: vec3<i32>, last: i32, size: vec3<i32>) -> Five_FIELD {
    let i = at.x + vec4<i32>(1, 2, 3, 4);
    let next = vec4<f32>(
        texel_FIELD(vec3<i32>(i.x, at.yz), size, 0), texel_FIELD(vec3<i32>(i.y, at.yz), size, 0),
        texel_FIELD(vec3<i32>(i.z, at.yz), size, 0), texel_FIELD(vec3<i32>(i.w, at.yz), size, 0),
    );
    let first = select(0.0, texel_FIELD(at, size, 0), at.x <= last);
    let rest = select(vec4<f32>(0.0), next, i <= vec4<i32>(last));
    return Five_FIELD(first, rest, larger(first, larger(larger(rest.x, rest.y), larger(rest.z, rest.w))));
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
