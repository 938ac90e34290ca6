// `evaluate`: what clusters of transfer matrices make of light. One work-item ROWS moments, or a unit where folded.

// Rows of the matrices that a work-item goes through together, so that light is read once for them.
#define ROWS EVALUATE_ROWS

void moment(const Bound *bound, size_t row, uint count, float3 *found);

void run_evaluate(const Bound *bound) {
    float3 found[ROWS];
    if (bound->params->folded == 0u) {
        size_t n = get_global_id(0) * ROWS;
        if (n >= bound->launch->count) {
            return;
        }
        uint count = min(ROWS, bound->launch->count - (uint)n);
        size_t index = bound->launch->start + n;
        moment(bound, index, count, found);
        for (uint i = 0u; i < count; i++) {
            bound->evaluated[index + i] = (float4)(found[i], 0.0f);
        }
        return;
    }
    if (get_global_id(0) >= bound->launch->count) {
        return;
    }
    uint index = bound->launch->start + (uint)get_global_id(0);
    uint coefficients = bound->params->coefficients;
    uint cluster = index / bound->params->per_cluster;
    float3 sum = (float3)(0.0f);
    if (bound->params->coefficient_begin > 0u) {
        // What the passes before left.
        sum = bound->evaluated[index].xyz;
    }
    for (uint j = bound->params->coefficient_begin; j < bound->params->coefficient_end; j += ROWS) {
        uint count = min(ROWS, bound->params->coefficient_end - j);
        moment(bound, (size_t)index * coefficients + j, count, found);
        for (uint i = 0u; i < count; i++) {
            sum += bound->views[(size_t)cluster * coefficients + j + i] * found[i];
        }
    }
    bound->evaluated[index] = (float4)(sum, 0.0f);
}

// What `count` rows of the matrices make of light, sixteen functions at a time.
void moment(const Bound *bound, size_t row, uint count, float3 *found) {
    uint functions = bound->params->functions;
    uint packets = functions / 16u;
    __global const float *matrices[ROWS];
    float16 r[ROWS];
    float16 g[ROWS];
    float16 b[ROWS];
    // Sums stay in registers where loops over rows are written out.
#pragma unroll
    for (uint i = 0u; i < ROWS; i++) {
        // Rows past the last repeat it, and are kept by nobody.
        matrices[i] = bound->matrices + (row + min(i, count - 1u)) * functions;
        r[i] = g[i] = b[i] = (float16)(0.0f);
    }
    __global const float *red = bound->light;
    __global const float *green = bound->light + functions;
    __global const float *blue = bound->light + 2u * functions;
    for (uint k = 0u; k < packets; k++) {
        float16 from_red = vload16(k, red);
        float16 from_green = vload16(k, green);
        float16 from_blue = vload16(k, blue);
#pragma unroll
        for (uint i = 0u; i < ROWS; i++) {
            float16 m = vload16(k, matrices[i]);
            r[i] += m * from_red;
            g[i] += m * from_green;
            b[i] += m * from_blue;
        }
    }
#pragma unroll
    for (uint i = 0u; i < ROWS; i++) {
        float8 r8 = r[i].lo + r[i].hi;
        float8 g8 = g[i].lo + g[i].hi;
        float8 b8 = b[i].lo + b[i].hi;
        float4 r4 = r8.lo + r8.hi;
        float4 g4 = g8.lo + g8.hi;
        float4 b4 = b8.lo + b8.hi;
        found[i] = (float3)(r4.x + r4.y + r4.z + r4.w, g4.x + g4.y + g4.z + g4.w, b4.x + b4.y + b4.z + b4.w);
    }
}
