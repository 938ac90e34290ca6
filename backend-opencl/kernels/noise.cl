// Fractal gradient noise.

// Scatters bits.
uint scatter(uint x) {
    x = (x ^ x >> 16) * 0x7feb352du;
    x = (x ^ x >> 15) * 0x846ca68bu;
    return x ^ x >> 16;
}

// The hash of a corner's index along one more axis.
uint along(uint index, uint h) {
    return scatter(index + h);
}

// The scalar product of the gradient that a hash chooses with `t`.
float slope(uint h, float3 t) {
    uint kind = h & 15u;
    float u = kind < 8u ? t.x : t.y;
    float v = kind < 4u ? t.y : (kind & 13u) == 12u ? t.x : t.z;
    return ((kind & 1u) != 0u ? -u : u) + ((kind & 2u) != 0u ? -v : v);
}

// The noise on an edge along x: between its corners of index `x.x` and `x.y`, at `t` from the first.
float edge(uint h, uint2 x, float3 t, float fade) {
    float left = slope(along(x.x, h), t);
    float right = slope(along(x.y, h), t - (float3)(1.0f, 0.0f, 0.0f));
    return left + (right - left) * fade;
}

// One octave at `p`, whose components are not negative and repeat after `mask` + 1.
float octave(float3 p, uint mask, uint seed) {
    float3 low = floor(p);
    float3 t = p - low;
    float3 fade = t * t * t * (t * (t * 6.0f - 15.0f) + 10.0f);
    uint3 first = convert_uint3_sat(low) & mask;
    uint3 second = (convert_uint3_sat(low) + 1u) & mask;
    uint2 x = (uint2)(first.x, second.x);
    uint z0 = along(first.z, scatter(seed));
    uint z1 = along(second.z, scatter(seed));
    float a = edge(along(first.y, z0), x, t, fade.x);
    float b = edge(along(second.y, z0), x, t - (float3)(0.0f, 1.0f, 0.0f), fade.x);
    float c = edge(along(first.y, z1), x, t - (float3)(0.0f, 0.0f, 1.0f), fade.x);
    float d = edge(along(second.y, z1), x, t - (float3)(0.0f, 1.0f, 1.0f), fade.x);
    float near = a + (b - a) * fade.y;
    float far = c + (d - c) * fade.y;
    return near + (far - near) * fade.z;
}

// max(0, 1 + contrast · n) at `p` in cells of the first octave.
float noise_factor(float3 p, uint octaves, uint seed, float contrast) {
    float period = convert_float(NOISE_PERIOD);
    float3 within = p - floor(p / period) * period;
    float sum = 0.0f;
    float fineness = 1.0f;
    for (uint o = 0; o < octaves; o++) {
        uint mask = (NOISE_PERIOD << o) - 1u;
        sum += octave(within * fineness, mask, scatter(seed + (o + 1u) * 0x9e3779b9u)) / fineness;
        fineness *= 2.0f;
    }
    return fmax(1.0f + sum * contrast, 0.0f);
}
