// `coarsen`: what a medium does to light, as means over the cells of a coarse grid. One work-item a cell, a packet a run
// of texels along x where no color varies.

int zeros(const Bound *bound, int3 at, int3 size);
float share(float begin, float end, uint i);
F shares(float begin, float end, uint i);

void run_coarsen(const Bound *bound) {
    size_t n = get_global_id(0);
    if (n >= bound->launch->count) {
        return;
    }
    uint index = bound->launch->start + (uint)n;
    uint3 cells = bound->params->cells.xyz;
    uint3 cell = (uint3)(index % cells.x, index / cells.x % cells.y, index / cells.x / cells.y);
    float3 side = bound->params->cell.xyz;
    float3 begin = convert_float3(cell) * side;
    float3 end = convert_float3(cell + 1u) * side;
    uint3 size = bound->params->dims.xyz;
    uint3 lo = min(convert_uint3(floor(begin)), size - 1u);
    uint3 hi = clamp(convert_uint3(ceil(end)), (uint3)(1u), size) - 1u;
    float density = 0.0f;
    float3 scatters = (float3)(0.0f);
    float3 shines = (float3)(0.0f);
    bool colored = has_scattering || has_emission_color;
    F thick = (F)(0.0f);
    F bright = (F)(0.0f);
    uint i = lo.x;
    while (!colored && i <= hi.x) {
        // Runs end where blocks of bricks do, so that sums are those of every layout.
        uint count = min(hi.x - i + 1u, WIDTH - i % WIDTH);
        F along = shares(begin.x, end.x, i);
        for (uint k = lo.z; k <= hi.z; k++) {
            float share_of_slice = share(begin.z, end.z, k);
            for (uint j = lo.y; j <= hi.y; j++) {
                int3 at = convert_int3((uint3)(i, j, k));
                if (zeros(bound, at, convert_int3(size)) > 0) {
                    continue;
                }
                F w = along * (share(begin.y, end.y, j) * share_of_slice);
                thick += w * run_density(bound, at, (int)count, convert_int3(size));
                if (has_emission_density) {
                    bright += w * run_emission_density(bound, at, (int)count, convert_int3(size));
                }
            }
        }
        i += count;
    }
    for (uint k = lo.z; colored && k <= hi.z; k++) {
        for (uint j = lo.y; j <= hi.y; j++) {
            float weight = share(begin.y, end.y, j) * share(begin.z, end.z, k);
            for (i = lo.x; i <= hi.x; i++) {
                int3 at = convert_int3((uint3)(i, j, k));
                int none = zeros(bound, at, convert_int3(size));
                if (none > 0) {
                    i += (uint)none - 1u;
                    continue;
                }
                float w = share(begin.x, end.x, i) * weight;
                float rho = texel_density(bound, at, convert_int3(size), 0);
                float3 own = (float3)(rho);
                float3 glow = (float3)(rho);
                if (has_scattering) {
                    own = texel_scattering(bound, at, convert_int3(size), 0).xyz;
                }
                if (has_emission_color) {
                    glow = texel_emission_color(bound, at, convert_int3(size), 0).xyz;
                } else if (has_emission_density) {
                    glow = (float3)(texel_emission_density(bound, at, convert_int3(size), 0));
                }
                density += w * rho;
                scatters += w * own;
                shines += w * glow;
            }
        }
    }
    if (!colored) {
        density = total(thick);
        scatters = (float3)(density);
        shines = (float3)(has_emission_density ? total(bright) : density);
    }
    float3 within = max(min(end, convert_float3(size)) - begin, (float3)(0.0f));
    // A cell holds a part of a voxel at the least, but its sides are rounded.
    float volume = max(within.x * within.y * within.z, 1e-30f);
    float on = bound->params->emission.w;
    float3 albedo = bound->params->albedo.xyz;
    float3 scattering = scatters / volume * bound->params->extinction.xyz * albedo;
    float3 extinction = max(density / volume * bound->params->extinction.xyz - on * scattering, (float3)(0.0f));
    float3 thin = (1.0f - on) * albedo / (1.0f - on * albedo);
    float3 similar = extinction > (float3)(0.0f) ? (1.0f - on) * scattering / extinction : thin;
    float3 glow = shines / volume * bound->params->emission.xyz;
    size_t count = (size_t)cells.x * cells.y * cells.z;
    float extinctions[3] = {extinction.x, extinction.y, extinction.z};
    float albedos[3] = {similar.x, similar.y, similar.z};
    float glows[3] = {glow.x, glow.y, glow.z};
    for (uint c = 0u; c < 3u; c++) {
        bound->optics[c * count + index] = extinctions[c];
        bound->optics[(3u + c) * count + index] = albedos[c];
        bound->optics[(6u + c) * count + index] = glows[c];
    }
}

// How many voxels from one on add nothing, because what they hold is zero; only what shines by itself may be where there is no
// density.
int zeros(const Bound *bound, int3 at, int3 size) {
    int found = empty_density(bound, at, size);
    if (has_emission_density) {
        found = min(found, empty_emission_density(bound, at, size));
    }
    return found;
}

// The part of voxel `i` that lies between two places; voxel i fills i to i + 1.
float share(float begin, float end, uint i) {
    return max(min(end, (float)i + 1.0f) - max(begin, (float)i), 0.0f);
}

// The same of voxels from `i` on.
F shares(float begin, float end, uint i) {
    F from = to_float(i + LANE);
    return greater(lesser(from + 1.0f, (F)(end)) - greater(from, (F)(begin)), (F)(0.0f));
}
