// `evaluate`: what clusters of transfer matrices make of light. One work-item a moment, or a unit where folded.

float3 moment(const Bound *bound, size_t row);

void run_evaluate(const Bound *bound) {
    size_t n = number();
    if (n >= bound->launch->count) {
        return;
    }
    uint index = bound->launch->start + (uint)n;
    if (bound->params->folded == 0u) {
        bound->evaluated[index] = (float4)(moment(bound, index), 0.0f);
        return;
    }
    uint coefficients = bound->params->coefficients;
    uint cluster = index / bound->params->per_cluster;
    float3 sum = (float3)(0.0f);
    if (bound->params->coefficient_begin > 0u) {
        // What the passes before left.
        sum = bound->evaluated[index].xyz;
    }
    for (uint j = bound->params->coefficient_begin; j < bound->params->coefficient_end; j++) {
        sum += bound->views[(size_t)cluster * coefficients + j] * moment(bound, (size_t)index * coefficients + j);
    }
    bound->evaluated[index] = (float4)(sum, 0.0f);
}

// What a row of the matrices makes of light, sixteen functions at a time.
float3 moment(const Bound *bound, size_t row) {
    uint functions = bound->params->functions;
    uint packets = functions / 16u;
    __global const float *matrix = bound->matrices + row * functions;
    __global const float *red = bound->light;
    __global const float *green = bound->light + functions;
    __global const float *blue = bound->light + 2u * functions;
    float16 r = (float16)(0.0f);
    float16 g = (float16)(0.0f);
    float16 b = (float16)(0.0f);
    for (uint k = 0u; k < packets; k++) {
        float16 m = vload16(k, matrix);
        r += m * vload16(k, red);
        g += m * vload16(k, green);
        b += m * vload16(k, blue);
    }
    float8 r8 = r.lo + r.hi;
    float8 g8 = g.lo + g.hi;
    float8 b8 = b.lo + b.hi;
    float4 r4 = r8.lo + r8.hi;
    float4 g4 = g8.lo + g8.hi;
    float4 b4 = b8.lo + b8.hi;
    float3 sum = (float3)(r4.x + r4.y + r4.z + r4.w, g4.x + g4.y + g4.z + g4.w, b4.x + b4.y + b4.z + b4.w);
    for (uint k = 16u * packets; k < functions; k++) {
        sum += matrix[k] * (float3)(red[k], green[k], blue[k]);
    }
    return sum;
}
