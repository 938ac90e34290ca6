// The maximum of the field FIELD over a coarse cell; instantiated for each field of `reduce`.

float probe_FIELD(const Bound *bound, uint3 cell);

// The maximum over every voxel that a lookup in the widened cell can touch, or over probes.
float maximum_FIELD(const Bound *bound, uint3 cell) {
    if (bound->params->coarse.w > 0u) {
        return probe_FIELD(bound, cell);
    }
    float3 side = bound->params->cell.xyz;
    float3 margin = bound->params->cell.w * side + REDUCE_SLACK;
    int3 size = convert_int3(bound->params->dims.xyz);
    float3 begin = convert_float3(cell) * side - 0.5f - margin;
    float3 end = convert_float3(cell + 1u) * side - 0.5f + margin;
    int3 lo = convert_int3(within_FIELD(floor(begin), size));
    int3 hi = convert_int3(within_FIELD(floor(end) + 1.0f, size));
    float most = 0.0f;
    for (int k = lo.z; k <= hi.z; k++) {
        for (int j = lo.y; j <= hi.y; j++) {
            for (int i = lo.x; i <= hi.x; i++) {
                most = fmax(most, texel_FIELD(bound, (int3)(i, j, k), size, 0));
            }
        }
    }
    return most;
}

// The maximum of n^3 lookups, evenly spread over the cell.
float probe_FIELD(const Bound *bound, uint3 cell) {
    uint n = bound->params->coarse.w;
    int3 size = convert_int3(bound->params->dims.xyz);
    float most = 0.0f;
    for (uint k = 0u; k < n; k++) {
        for (uint j = 0u; j < n; j++) {
            for (uint i = 0u; i < n; i++) {
                float3 place = convert_float3(cell) + (convert_float3((uint3)(i, j, k)) + 0.5f) / convert_float(n);
                most = fmax(most, sample_FIELD(bound, place * bound->params->cell.xyz - 0.5f, size, 0));
            }
        }
    }
    return most;
}
