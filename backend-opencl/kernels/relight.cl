// `relight`: in-scattered radiance from records and light. One work-item a packet of cells.

INLINE F3 record(const Bound *bound, size_t first, I place, uint k);
INLINE F3 glow(const Bound *bound, size_t first, I place, uint k);

void run_relight(const Bound *bound) {
    size_t n = number();
    uint count = bound->launch->count;
    if (n >= count) {
        return;
    }
    // The first cell of the packet, and how many places behind it the others are.
    size_t first = bound->launch->start + n;
    uint cells = min(count - (uint)n, (uint)WIDTH);
    I place = as_signed(elements(0u, cells));
    uint layers = bound->params->layers;
    for (uint layer = 0u; layer < layers; layer++) {
        F3 sum = all3((float3)(0.0f));
        if (layers == 1u) {
            for (uint k = 0u; k < bound->params->coefficients; k++) {
                sum = add3(sum, mul3(all3(bound->light[k].xyz), record(bound, first, place, k)));
            }
            sum = add3(sum, scale3(glow(bound, first, place, 0u), (F)(bound->params->emission_weight)));
        } else {
            sum = add3(record(bound, first, place, layer), glow(bound, first, place, layer));
            sum = mul3(all3(bound->light[layer].xyz), sum);
        }
        __global float4 *to = bound->in_scatter + first * layers + layer;
        if (layers == 1u) {
            put_colors(sum, (__global float *)to, cells);
        } else {
            put_four(to, layers * as_index(place), LANE < cells, f4(sum, (F)(0.0f)));
        }
    }
}

// Coefficient `k` of cells' records; a record of one channel serves all three.
INLINE F3 record(const Bound *bound, size_t first, I place, uint k) {
    uint channels = bound->params->channels;
    uint values = bound->params->coefficients * channels;
    __global const float *from = bound->records + first * values + k * channels;
    I at = place * (int)values;
    size_t pitch = 1u;
    if (bound->params->planar == 1u) {
        pitch = bound->params->cells;
        from = bound->records + (size_t)k * channels * pitch + first;
        at = place;
    }
    F red = fetch(from, at);
    if (channels == 1u) {
        return f3(red, red, red);
    }
    return f3(red, fetch(from + pitch, at), fetch(from + 2u * pitch, at));
}

// Coefficient `k` of the emission's moments.
INLINE F3 glow(const Bound *bound, size_t first, I place, uint k) {
    uint values = bound->params->emission_coefficients * 3u;
    if (values == 0u) {
        return all3((float3)(0.0f));
    }
    __global const float *from = bound->emission_records + first * values + 3u * k;
    I at = place * (int)values;
    return f3(fetch(from, at), fetch(from + 1u, at), fetch(from + 2u, at));
}
