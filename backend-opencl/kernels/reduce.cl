// `reduce`: coarse mean and maximum of a field. One work-item a coarse cell, a packet a run of texels along x.

float mean(const Bound *bound, uint3 cell, float sum);

void run_reduce(const Bound *bound) {
    size_t n = get_global_id(0);
    // Loops may turn as often as they need to: the last pass does all.
    if (n >= bound->launch->count || bound->params->row_end < ALL_ROWS) {
        return;
    }
    uint index = bound->launch->start + (uint)n;
    uint4 coarse = bound->params->coarse;
    uint3 cell = (uint3)(index % coarse.x, index / coarse.x % coarse.y, index / coarse.x / coarse.y);
    float2 found = gathered_density(bound, cell);
    if (coarse.w > 0u) {
        found.y = probe_density(bound, cell);
        if (has_other) {
            found.y = fmax(found.y, probe_other(bound, cell));
        }
    } else if (has_other) {
        found.y = fmax(found.y, gathered_other(bound, cell).y);
    }
    bound->reduced[index] = (float2)(mean(bound, cell, found.x), found.y);
}

// The part of voxel `i` that lies between two places; voxel i fills i to i + 1.
float share(float begin, float end, int i) {
    return max(min(end, convert_float(i) + 1.0f) - max(begin, convert_float(i)), 0.0f);
}

// The same of voxels from `i` on.
F shares(float begin, float end, int i) {
    F from = to_float(i + as_signed(LANE));
    return greater(lesser(from + 1.0f, (F)(end)) - greater(from, (F)(begin)), (F)(0.0f));
}

// The mean over a cell with this sum.
float mean(const Bound *bound, uint3 cell, float sum) {
    float3 begin = convert_float3(cell) * bound->params->cell.xyz;
    float3 end = convert_float3(cell + 1u) * bound->params->cell.xyz;
    float3 within = max(min(end, convert_float3(bound->params->dims.xyz)) - begin, (float3)(0.0f));
    float weight = within.x * within.y * within.z;
    return weight > 0.0f ? sum / max(weight, 1e-30f) : 0.0f;
}
