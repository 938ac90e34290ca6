// Phase functions. A kernel gives the table: phase_value(bound, i) and phase_size(bound).

#define FOUR_PI 12.5663706143592f

F phase_value(const Bound *bound, I i);
uint phase_size(const Bound *bound);

F henyey_greenstein(float g, F c) {
    F base = 1.0f + g * g - 2.0f * g * c;
    return (1.0f - g * g) / FOUR_PI / (base * sqrt(base));
}

F phase_lookup(const Bound *bound, F c) {
    int last = (int)phase_size(bound) - 1;
    F at = angle_of_cosine(c) / PI * convert_float(last);
    // What is not a number is the first entry.
    I i = to_int(at > (F)(0.0f) ? lesser(at, (F)(convert_float(last - 1))) : (F)(0.0f));
    F a = phase_value(bound, i);
    return a + (phase_value(bound, i + 1) - a) * (at - to_float(i));
}

// Value at cosine `c`, per steradian.
F phase(const Bound *bound, F c) {
    switch (bound->params->phase_kind) {
        case PHASE_HENYEY_GREENSTEIN: {
            float4 lobes = bound->params->phase;
            F first = henyey_greenstein(lobes.x, c);
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
            return (F)(1.0f / FOUR_PI);
    }
}
