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
    float3 last = convert_float3(size - 1);
    int3 lo = convert_int3(clamp(floor(begin), (float3)(0.0f), last));
    int3 hi = convert_int3(clamp(floor(end) + 1.0f, (float3)(0.0f), last));
    uint across = (uint)(hi.y - lo.y + 1);
    uint rows = across * (uint)(hi.z - lo.z + 1);
    if (uniform_FIELD(bound, lo, hi, size)) {
        return fmax(0.0f, texel_FIELD(bound, lo, size, 0));
    }
    F most = (F)(0.0f);
    for (uint row = bound->params->row_begin; row < min(bound->params->row_end, rows); row++) {
        int j = lo.y + (int)(row % across);
        int k = lo.z + (int)(row / across);
        int i = lo.x;
        while (i <= hi.x) {
            int zeros = empty_FIELD(bound, (int3)(i, j, k), size);
            if (zeros > 0) {
                i += zeros;
                continue;
            }
            int count = min(hi.x - i + 1, (int)WIDTH - i % (int)WIDTH);
            most = greater(run_FIELD(bound, (int3)(i, j, k), count, size), most);
            i += count;
        }
    }
    return largest_lane(most);
}

// The maximum of n^3 lookups, evenly spread over the cell: over the rows of this pass.
float probe_FIELD(const Bound *bound, uint3 cell) {
    uint n = bound->params->coarse.w;
    int3 size = convert_int3(bound->params->dims.xyz);
    float3 side = bound->params->cell.xyz;
    F most = (F)(0.0f);
    for (uint row = bound->params->row_begin; row < min(bound->params->row_end, n * n); row++) {
        float y = (convert_float(cell.y) + (convert_float(row % n) + 0.5f) / convert_float(n)) * side.y - 0.5f;
        float z = (convert_float(cell.z) + (convert_float(row / n) + 0.5f) / convert_float(n)) * side.z - 0.5f;
        for (uint i = 0u; i < n; i += WIDTH) {
            // Lanes past the last repeat it.
            U probe = elements(i, n);
            F x = (convert_float(cell.x) + (to_float(probe) + 0.5f) / convert_float(n)) * side.x - 0.5f;
            most = greater(sample_FIELD(bound, f3(x, (F)(y), (F)(z)), size, 0), most);
        }
    }
    return largest_lane(most);
}
