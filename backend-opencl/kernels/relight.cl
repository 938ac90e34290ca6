// `relight`: in-scattered radiance from records and light. One work-item a cell.

float3 record(const Bound *bound, uint cell, uint k);
float3 glow(const Bound *bound, uint cell, uint k);

void run_relight(const Bound *bound) {
    size_t n = number();
    if (n >= bound->launch->count) {
        return;
    }
    uint cell = bound->launch->start + (uint)n;
    uint layers = bound->params->layers;
    for (uint layer = 0u; layer < layers; layer++) {
        float3 sum = (float3)(0.0f);
        if (layers == 1u) {
            for (uint k = 0u; k < bound->params->coefficients; k++) {
                sum += bound->light[k].xyz * record(bound, cell, k);
            }
            sum += bound->params->emission_weight * glow(bound, cell, 0u);
        } else {
            sum = bound->light[layer].xyz * (record(bound, cell, layer) + glow(bound, cell, layer));
        }
        bound->in_scatter[(size_t)cell * layers + layer] = (float4)(sum, 0.0f);
    }
}

// Coefficient `k` of a cell's record; a record of one channel serves all three.
float3 record(const Bound *bound, uint cell, uint k) {
    uint channels = bound->params->channels;
    size_t first = ((size_t)cell * bound->params->coefficients + k) * channels;
    size_t pitch = 1u;
    if (bound->params->planar == 1u) {
        pitch = bound->params->cells;
        first = (size_t)k * channels * pitch + cell;
    }
    if (channels == 1u) {
        return (float3)(bound->records[first]);
    }
    return (float3)(bound->records[first], bound->records[first + pitch], bound->records[first + 2u * pitch]);
}

// Coefficient `k` of the emission's moments.
float3 glow(const Bound *bound, uint cell, uint k) {
    if (bound->params->emission_coefficients == 0u) {
        return (float3)(0.0f);
    }
    return vload3((size_t)cell * bound->params->emission_coefficients + k, bound->emission_records);
}
