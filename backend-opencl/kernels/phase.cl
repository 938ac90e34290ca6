// Phase functions. A kernel gives the table: phase_value(bound, i) and phase_size(bound).

#define FOUR_PI 12.5663706143592f

float phase_value(const Bound *bound, uint i);
uint phase_size(const Bound *bound);

float henyey_greenstein(float g, float c) {
    float base = 1.0f + g * g - 2.0f * g * c;
    return (1.0f - g * g) / FOUR_PI / (base * sqrt(base));
}

float phase_lookup(const Bound *bound, float c) {
    uint last = phase_size(bound) - 1u;
    float at = angle_of_cosine(c) / PI * convert_float(last);
    // What is not a number is the first entry.
    uint i = at > 0.0f ? min(convert_uint(at), last - 1u) : 0u;
    float a = phase_value(bound, i);
    return a + (phase_value(bound, i + 1u) - a) * (at - convert_float(i));
}

// Value at cosine `c`, per steradian.
float phase(const Bound *bound, float c) {
    switch (bound->params->phase_kind) {
        case PHASE_HENYEY_GREENSTEIN: {
            float4 lobes = bound->params->phase;
            float first = henyey_greenstein(lobes.x, c);
            if (lobes.z == 1.0f) {
                return first;
            }
            return first * lobes.z + henyey_greenstein(lobes.y, c) * (1.0f - lobes.z);
        }
        case PHASE_RAYLEIGH:
            return (c * c + 1.0f) * (3.0f / (4.0f * FOUR_PI));
        case PHASE_TABLE:
            return phase_lookup(bound, c);
        default:
            return 1.0f / FOUR_PI;
    }
}
