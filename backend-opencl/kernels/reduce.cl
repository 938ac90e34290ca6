// `reduce`: coarse mean and maximum of a field. One work-item a coarse cell, a packet a run of texels along x.

F shares(float begin, float end, uint i);
float mean(const Bound *bound, uint3 cell, float before);

void run_reduce(const Bound *bound) {
    size_t n = get_global_id(0);
    if (n >= bound->launch->count) {
        return;
    }
    uint index = bound->launch->start + (uint)n;
    uint4 coarse = bound->params->coarse;
    uint3 cell = (uint3)(index % coarse.x, index / coarse.x % coarse.y, index / coarse.x / coarse.y);
    // Sum and maximum of the passes before.
    float2 before = (float2)(0.0f);
    if (bound->params->row_begin > 0u) {
        before = bound->reduced[index];
    }
    float most = fmax(before.y, maximum_density(bound, cell));
    if (has_other) {
        most = fmax(most, maximum_other(bound, cell));
    }
    bound->reduced[index] = (float2)(mean(bound, cell, before.x), most);
}

// The part of voxel `i` that lies between two places; voxel i fills i to i + 1.
float share(float begin, float end, uint i) {
    return max(min(end, convert_float(i) + 1.0f) - max(begin, convert_float(i)), 0.0f);
}

// The same of voxels from `i` on.
F shares(float begin, float end, uint i) {
    F from = to_float(i + LANE);
    return greater(lesser(from + 1.0f, (F)(end)) - greater(from, (F)(begin)), (F)(0.0f));
}

// The mean of the voxels, each weighed by the part of it that lies in the cell: the sum so far with the rows of this
// pass, and in the last pass divided.
float mean(const Bound *bound, uint3 cell, float before) {
    float3 begin = convert_float3(cell) * bound->params->cell.xyz;
    float3 end = convert_float3(cell + 1u) * bound->params->cell.xyz;
    uint3 size = bound->params->dims.xyz;
    uint3 lo = min(convert_uint3_sat(floor(begin)), size - 1u);
    uint3 hi = clamp(convert_uint3_sat(ceil(end)), (uint3)(1u), size) - 1u;
    uint across = hi.y - lo.y + 1u;
    uint rows = across * (hi.z - lo.z + 1u);
    int3 first = convert_int3(lo);
    // What holds zero alone adds nothing.
    if (uniform_density(bound, first, convert_int3(hi), convert_int3(size)) &&
        texel_density(bound, first, convert_int3(size), 0) == 0.0f) {
        rows = 0u;
    }
    float sum = before;
    for (uint row = bound->params->row_begin; row < min(bound->params->row_end, rows); row++) {
        uint j = lo.y + row % across;
        uint k = lo.z + row / across;
        F sums = (F)(0.0f);
        uint i = lo.x;
        while (i <= hi.x) {
            int3 at = convert_int3((uint3)(i, j, k));
            // Runs end where blocks of bricks do, so that sums are those of every layout.
            uint count = min(hi.x - i + 1u, WIDTH - i % WIDTH);
            int zeros = empty_density(bound, at, convert_int3(size));
            if (zeros > 0) {
                i += (uint)zeros;
                continue;
            }
            sums += run_density(bound, at, (int)count, convert_int3(size)) * shares(begin.x, end.x, i);
            i += count;
        }
        // Row by row, so that passes of some rows each add up to the same.
        sum += total(sums) * (share(begin.y, end.y, j) * share(begin.z, end.z, k));
    }
    if (bound->params->row_end < ALL_ROWS) {
        return sum;
    }
    float3 within = max(min(end, convert_float3(size)) - begin, (float3)(0.0f));
    float weight = within.x * within.y * within.z;
    return weight > 0.0f ? sum / max(weight, 1e-30f) : 0.0f;
}
