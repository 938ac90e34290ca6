// Fractal gradient noise.

// Scatters bits.
U scatter(U x) {
    x = (x ^ x >> 16) * 0x7feb352du;
    x = (x ^ x >> 15) * 0x846ca68bu;
    return x ^ x >> 16;
}

// The hash of a corner's index along one more axis.
U along(U index, U h) {
    return scatter(index + h);
}

// The scalar product of the gradient that a hash chooses with `t`.
F slope(U h, F3 t) {
    U kind = h & 15u;
    F u = kind < 8u ? t.x : t.y;
    F v = kind < 4u ? t.y : (kind & 13u) == 12u ? t.x : t.z;
    return ((kind & 1u) != 0u ? -u : u) + ((kind & 2u) != 0u ? -v : v);
}

// The noise on an edge along x: between its corners of index `x` and `next`, at `t` from the first.
F edge(U h, U x, U next, F3 t, F fade) {
    F left = slope(along(x, h), t);
    F right = slope(along(next, h), f3(t.x - 1.0f, t.y, t.z));
    return left + (right - left) * fade;
}

// One octave at `p`, whose components are not negative and repeat after `mask` + 1.
F octave(F3 p, uint mask, U seed) {
    F3 low = f3(floor(p.x), floor(p.y), floor(p.z));
    F3 t = sub3(p, low);
    F3 fade = f3(t.x * t.x * t.x * (t.x * (t.x * 6.0f - 15.0f) + 10.0f), t.y * t.y * t.y * (t.y * (t.y * 6.0f - 15.0f) + 10.0f),
                 t.z * t.z * t.z * (t.z * (t.z * 6.0f - 15.0f) + 10.0f));
    U x = to_uint(low.x);
    U y = to_uint(low.y);
    U z = to_uint(low.z);
    U next = (x + 1u) & mask;
    U z0 = along(z & mask, scatter(seed));
    U z1 = along((z + 1u) & mask, scatter(seed));
    x &= mask;
    F a = edge(along(y & mask, z0), x, next, t, fade.x);
    F b = edge(along((y + 1u) & mask, z0), x, next, f3(t.x, t.y - 1.0f, t.z), fade.x);
    F c = edge(along(y & mask, z1), x, next, f3(t.x, t.y, t.z - 1.0f), fade.x);
    F d = edge(along((y + 1u) & mask, z1), x, next, f3(t.x, t.y - 1.0f, t.z - 1.0f), fade.x);
    F near = a + (b - a) * fade.y;
    F far = c + (d - c) * fade.y;
    return near + (far - near) * fade.z;
}

// max(0, 1 + contrast * n) at `p` in cells of the first octave.
F noise_factor(F3 p, uint octaves, uint seed, float contrast) {
    float period = convert_float(NOISE_PERIOD);
    F3 within = f3(p.x - floor(p.x / period) * period, p.y - floor(p.y / period) * period, p.z - floor(p.z / period) * period);
    F sum = (F)(0.0f);
    float fineness = 1.0f;
    for (uint o = 0u; o < octaves; o++) {
        uint mask = (NOISE_PERIOD << o) - 1u;
        U key = scatter((U)(seed + (o + 1u) * 0x9e3779b9u));
        sum += octave(scale3(within, (F)(fineness)), mask, key) / fineness;
        fineness *= 2.0f;
    }
    return greater(1.0f + sum * contrast, (F)(0.0f));
}
