// The maximum of the field FIELD over a coarse cell; instantiated for each field of `reduce`.

float probe_FIELD(const Bound *bound, uint3 cell);

// The maximum over every voxel that a lookup in the widened cell can touch, or over probes: over the rows of this pass.
float maximum_FIELD(const Bound *bound, uint3 cell) {
    if (bound->params->coarse.w > 0u) {
        return probe_FIELD(bound, cell);
    }
    float3 side = bound->params->cell.xyz;
    float3 margin = bound->params->cell.w * side + REDUCE_SLACK;
    int3 size = convert_int3(bound->params->dims.xyz);
    float3 begin = convert_float3(cell) * side - 0.5f - margin;
    float3 end = convert_float3(cell + 1u) * side - 0.5f + margin;
    float3 lower = floor(begin);
    float3 upper = floor(end) + 1.0f;
    int3 lo = (int3)(within_FIELD(lower.x, size.x), within_FIELD(lower.y, size.y), within_FIELD(lower.z, size.z));
    int3 hi = (int3)(within_FIELD(upper.x, size.x), within_FIELD(upper.y, size.y), within_FIELD(upper.z, size.z));
    uint across = (uint)(hi.y - lo.y + 1);
    uint rows = across * (uint)(hi.z - lo.z + 1);
    if (uniform_FIELD(bound, lo, hi, size)) {
        return fmax(0.0f, texel_FIELD(bound, lo, size, 0));
    }
    float most = 0.0f;
    for (uint row = bound->params->row_begin; row < min(bound->params->row_end, rows); row++) {
        int j = lo.y + (int)(row % across);
        int k = lo.z + (int)(row / across);
        for (int i = lo.x; i <= hi.x; i++) {
            int zeros = empty_FIELD(bound, (int3)(i, j, k), size);
            if (zeros > 0) {
                i += zeros - 1;
                continue;
            }
            most = fmax(most, texel_FIELD(bound, (int3)(i, j, k), size, 0));
        }
    }
    return most;
}

// The maximum of n^3 lookups, evenly spread over the cell: over the rows of this pass.
float probe_FIELD(const Bound *bound, uint3 cell) {
    uint n = bound->params->coarse.w;
    int3 size = convert_int3(bound->params->dims.xyz);
    float most = 0.0f;
    for (uint row = bound->params->row_begin; row < min(bound->params->row_end, n * n); row++) {
        for (uint i = 0u; i < n; i++) {
            float3 probe = (convert_float3((uint3)(i, row % n, row / n)) + 0.5f) / convert_float(n);
            float3 place = (convert_float3(cell) + probe) * bound->params->cell.xyz - 0.5f;
            most = fmax(most, sample_FIELD(bound, place, size, 0));
        }
    }
    return most;
}
