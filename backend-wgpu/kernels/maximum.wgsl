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
    var at = vec2<i32>(lo.y + i32(params.row_begin % across), lo.z + i32(params.row_begin / across));
    let last = min(params.row_end, rows);
    // Two voxels of four rows a turn: what each row begins with is asked for before the rest, for that is what is far away.
    for (var row = params.row_begin; row < last; row += 4u) {
        // After the last row it is that one again, and weighs nothing.
        let there = row + vec4<u32>(0u, 1u, 2u, 3u) < vec4<u32>(last);
        let b = select(at, following_FIELD(at, lo.y, hi.y), there.y);
        let c = select(b, following_FIELD(b, lo.y, hi.y), there.z);
        let d = select(c, following_FIELD(c, lo.y, hi.y), there.w);
        let weights = vec4<f32>(
            share(begin.y, end.y, at.x) * share(begin.z, end.z, at.y), share(begin.y, end.y, b.x) * share(begin.z, end.z, b.y),
            share(begin.y, end.y, c.x) * share(begin.z, end.z, c.y), share(begin.y, end.y, d.x) * share(begin.z, end.z, d.y),
        );
        let weighed = select(vec4<f32>(0.0), weights, there);
        let y = vec4<i32>(at.x, b.x, c.x, d.x);
        let z = vec4<i32>(at.y, b.y, c.y, d.y);
        var of_rows = vec4<f32>(0.0);
        for (var i = lo.x; i <= hi.x; i += 2) {
            let zeros = min(
                min(empty_FIELD(vec3<i32>(i, at)), empty_FIELD(vec3<i32>(i, b))),
                min(empty_FIELD(vec3<i32>(i, c)), empty_FIELD(vec3<i32>(i, d))),
            );
            if zeros > 0 {
                i += zeros - 2;
                continue;
            }
            let here = four_FIELD(i, y, z, size);
            let next = select(vec4<f32>(0.0), four_FIELD(i + 1, y, z, size), i < hi.x);
            // One after the other, so that sums are those of every layout, whatever is passed over.
            of_rows += share(begin.x, end.x, i) * here;
            of_rows += share(begin.x, end.x, i + 1) * next;
            most = larger(most, larger(largest_FIELD(here), largest_FIELD(next)));
        }
        // One after the other, so that sums do not depend on where a pass ends.
        sum += weighed.x * of_rows.x;
        sum += weighed.y * of_rows.y;
        sum += weighed.z * of_rows.z;
        sum += weighed.w * of_rows.w;
        at = following_FIELD(d, lo.y, hi.y);
    }
    return vec2<f32>(sum, most);
}

// The row of a cell after one, along y and then z.
fn following_FIELD(at: vec2<i32>, first: i32, last: i32) -> vec2<i32> {
    return select(vec2<i32>(at.x + 1, at.y), vec2<i32>(first, at.y + 1), at.x == last);
}

// A voxel of each of four rows.
fn four_FIELD(i: i32, y: vec4<i32>, z: vec4<i32>, size: vec3<i32>) -> vec4<f32> {
    return vec4<f32>(
        texel_FIELD(vec3<i32>(i, y.x, z.x), size, 0), texel_FIELD(vec3<i32>(i, y.y, z.y), size, 0),
        texel_FIELD(vec3<i32>(i, y.z, z.z), size, 0), texel_FIELD(vec3<i32>(i, y.w, z.w), size, 0),
    );
}

fn largest_FIELD(a: vec4<f32>) -> f32 {
    return larger(larger(a.x, a.y), larger(a.z, a.w));
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
