// `reduce`: coarse mean and maximum of a field. One work-item a coarse cell.

float mean(const Bound *bound, uint3 cell, float before);

void run_reduce(const Bound *bound) {
    size_t n = number();
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
        for (uint i = lo.x; i <= hi.x; i++) {
            int zeros = empty_density(bound, convert_int3((uint3)(i, j, k)), convert_int3(size));
            if (zeros > 0) {
                i += (uint)zeros - 1u;
                continue;
            }
            float w = share(begin.x, end.x, i) * share(begin.y, end.y, j) * share(begin.z, end.z, k);
            sum += w * texel_density(bound, convert_int3((uint3)(i, j, k)), convert_int3(size), 0);
        }
    }
    if (bound->params->row_end < ALL_ROWS) {
        return sum;
    }
    float3 within = max(min(end, convert_float3(size)) - begin, (float3)(0.0f));
    float weight = within.x * within.y * within.z;
    return weight > 0.0f ? sum / max(weight, 1e-30f) : 0.0f;
}
