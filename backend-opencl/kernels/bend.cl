// Directions in which scattering bends, and choices by weights.

// One of `count` items of the choice that begins at `at` in the tables, in proportion to their weights.
uint choose(const Bound *bound, uint at, uint count, Draws *numbers) {
    uint place = min(convert_uint(draw(numbers) * convert_float(count)), count - 1u);
    uint item = at + CHOICE * place;
    if (draw(numbers) < bound->tables[item]) {
        return place;
    }
    return convert_uint(bound->tables[item + 1u]);
}

// The direction at cosine `c` to a unit `d`, so many turns around it (frame of Duff et al. 2017).
float3 around(float3 d, float c, float turn) {
    float s = d.z >= 0.0f ? 1.0f : -1.0f;
    float a = -1.0f / (s + d.z);
    float b = d.x * d.y * a;
    float3 u = (float3)(1.0f + s * d.x * d.x * a, s * b, -s * d.x);
    float3 v = (float3)(b, s + d.y * d.y * a, -d.y);
    float planar = sqrt(max(1.0f - c * c, 0.0f));
    float2 p = circle(turn);
    float3 found = planar * p.x * u + planar * p.y * v + c * d;
    return found / sqrt(dot(found, found));
}

// The cosine of a Henyey-Greenstein lobe below which a part `u` of it lies.
float lobe(float g, float u) {
    // The inverse of the distribution, without the quotient that vanishes with g.
    float x = 2.0f * u - 1.0f;
    float square = x * x;
    float base = 1.0f + g * x;
    return (x + 0.5f * g * (square + 3.0f) + g * g * x + 0.5f * g * g * g * (square - 1.0f)) / (base * base);
}

// The same of Rayleigh's function: the root of c^3 + 3c = 8u - 4.
float rayleigh(float u) {
    float q = 4.0f * u - 2.0f;
    float cube = fabs(q) + sqrt(q * q + 1.0f);
    float root = pow(cube, 1.0f / 3.0f);
    // One step of Newton's makes up for powers of few digits.
    root = root - (root - cube / (root * root)) / 3.0f;
    float c = root - 1.0f / root;
    return q < 0.0f ? -c : c;
}

// A cosine of scattering.
float bend(const Bound *bound, Draws *numbers) {
    float c;
    switch (bound->params->phase_kind) {
        case PHASE_HENYEY_GREENSTEIN: {
            float4 lobes = bound->params->phase;
            float g = lobes.x;
            if (lobes.z != 1.0f) {
                g = draw(numbers) < lobes.z ? lobes.x : lobes.y;
            }
            c = lobe(g, draw(numbers));
            break;
        }
        case PHASE_RAYLEIGH:
            c = rayleigh(draw(numbers));
            break;
        case PHASE_TABLE: {
            uint last = phase_size(bound) - 1u;
            uint piece = choose(bound, bound->params->bends_at, last, numbers);
            float edge = circle(0.5f * convert_float(piece) / convert_float(last)).x;
            float next = circle(0.5f * convert_float(piece + 1u) / convert_float(last)).x;
            c = edge + (next - edge) * draw(numbers);
            break;
        }
        default:
            c = 2.0f * draw(numbers) - 1.0f;
    }
    return clamp(c, -1.0f, 1.0f);
}

// The probability that scattering bends by cosine `c`, per steradian.
float bend_density(const Bound *bound, float c) {
    if (bound->params->phase_kind == PHASE_TABLE) {
        uint last = phase_size(bound) - 1u;
        uint piece = min(convert_uint(angle_of_cosine(c) / PI * convert_float(last)), last - 1u);
        return bound->tables[bound->params->bends_at + CHOICE * piece + 2u];
    }
    return phase(bound, c);
}
