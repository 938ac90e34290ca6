// `reduce`: coarse mean and maximum of a field. One work-item a coarse cell.

float mean(const Bound *bound, uint3 cell);

void run_reduce(const Bound *bound) {
    size_t n = number();
    if (n >= bound->launch->count) {
        return;
    }
    uint index = bound->launch->start + (uint)n;
    uint4 coarse = bound->params->coarse;
    uint3 cell = (uint3)(index % coarse.x, index / coarse.x % coarse.y, index / coarse.x / coarse.y);
    float most = maximum_density(bound, cell);
    if (has_other) {
        most = fmax(most, maximum_other(bound, cell));
    }
    bound->reduced[index] = (float2)(mean(bound, cell), most);
}

// The part of voxel `i` that lies between two places; voxel i fills i to i + 1.
float share(float begin, float end, uint i) {
    return max(min(end, convert_float(i) + 1.0f) - max(begin, convert_float(i)), 0.0f);
}

// The mean of the voxels, each weighed by the part of it that lies in the cell.
float mean(const Bound *bound, uint3 cell) {
    float3 begin = convert_float3(cell) * bound->params->cell.xyz;
    float3 end = convert_float3(cell + 1u) * bound->params->cell.xyz;
    uint3 size = bound->params->dims.xyz;
    uint3 lo = min(convert_uint3_sat(floor(begin)), size - 1u);
    uint3 hi = clamp(convert_uint3_sat(ceil(end)), (uint3)(1u), size) - 1u;
    float sum = 0.0f;
    float weight = 0.0f;
    for (uint k = lo.z; k <= hi.z; k++) {
        for (uint j = lo.y; j <= hi.y; j++) {
            for (uint i = lo.x; i <= hi.x; i++) {
                float w = share(begin.x, end.x, i) * share(begin.y, end.y, j) * share(begin.z, end.z, k);
                sum += w * texel_density(bound, convert_int3((uint3)(i, j, k)), convert_int3(size), 0);
                weight += w;
            }
        }
    }
    return weight > 0.0f ? sum / max(weight, 1e-30f) : 0.0f;
}
