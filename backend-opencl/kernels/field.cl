// Lookups of the field FIELD, whose texels are VALUEs; instantiated for each field of a stage. `size` is the number of
// texels of a layer along x, y and z.

FOUND_VALUE row_FIELD(const Bound *, INDEX_VALUE, INDEX_VALUE, INDEX_VALUE, INDEX_VALUE, PLACE_VALUE, int3, int);

// `p` within [0, size - 1], also where it is not a number: what is looked up is always there.
PLACE_VALUE within_FIELD(PLACE_VALUE p, int size) {
    PLACE_VALUE first = (PLACE_VALUE)(0.0f);
    PLACE_VALUE last = (PLACE_VALUE)(convert_float(size - 1));
    p = p > first ? p : first;
    return p < last ? p : last;
}

// The nearest texel of a layer to `p`.
FOUND_VALUE nearest_FIELD(const Bound *bound, POINT_VALUE p, int3 size, int layer) {
    // Half a texel on and rounded down.
    INDEX_VALUE x = INT_VALUE(within_FIELD(p.x + 0.5f, size.x));
    INDEX_VALUE y = INT_VALUE(within_FIELD(p.y + 0.5f, size.y));
    INDEX_VALUE z = INT_VALUE(within_FIELD(p.z + 0.5f, size.z));
    return texels_FIELD(bound, x, y, z, size, layer);
}

// Trilinear lookup of a layer at `p`, where texel i lies at i; x then y then z, indices clamped at the edge.
FOUND_VALUE sample_FIELD(const Bound *bound, POINT_VALUE p, int3 size, int layer) {
    // Clamping the point is clamping both indices: beyond the outermost centres both are the same texel.
    PLACE_VALUE x = within_FIELD(p.x, size.x);
    PLACE_VALUE y = within_FIELD(p.y, size.y);
    PLACE_VALUE z = within_FIELD(p.z, size.z);
    INDEX_VALUE x0 = INT_VALUE(x);
    INDEX_VALUE y0 = INT_VALUE(y);
    INDEX_VALUE z0 = INT_VALUE(z);
    INDEX_VALUE x1 = x0 < size.x - 1 ? x0 + 1 : x0;
    INDEX_VALUE y1 = y0 < size.y - 1 ? y0 + 1 : y0;
    INDEX_VALUE z1 = z0 < size.z - 1 ? z0 + 1 : z0;
    PLACE_VALUE fx = x - FLOAT_VALUE(x0);
    PLACE_VALUE fy = y - FLOAT_VALUE(y0);
    PLACE_VALUE fz = z - FLOAT_VALUE(z0);
    FOUND_VALUE a = row_FIELD(bound, x0, x1, y0, z0, fx, size, layer);
    FOUND_VALUE b = row_FIELD(bound, x0, x1, y1, z0, fx, size, layer);
    FOUND_VALUE c = row_FIELD(bound, x0, x1, y0, z1, fx, size, layer);
    FOUND_VALUE d = row_FIELD(bound, x0, x1, y1, z1, fx, size, layer);
    FOUND_VALUE near = a + (b - a) * fy;
    FOUND_VALUE far = c + (d - c) * fy;
    return near + (far - near) * fz;
}

FOUND_VALUE row_FIELD(const Bound *bound, INDEX_VALUE x0, INDEX_VALUE x1, INDEX_VALUE y, INDEX_VALUE z, PLACE_VALUE f,
                      int3 size, int layer) {
    FOUND_VALUE a = texels_FIELD(bound, x0, y, z, size, layer);
    FOUND_VALUE b = texels_FIELD(bound, x1, y, z, size, layer);
    return a + (b - a) * f;
}

#if COLORED_VALUE

// RGB of the first layer around each lane's point; zero in lanes that are not active.
F3 colors_FIELD(const Bound *bound, F3 p, int3 size, M active) {
    int marked[WIDTH];
    float x[WIDTH];
    float y[WIDTH];
    float z[WIDTH];
    unpack(active, marked);
    unpack(p.x, x);
    unpack(p.y, y);
    unpack(p.z, z);
    for (uint i = 0u; i < WIDTH; i++) {
        float4 found = (float4)(0.0f);
        if (marked[i]) {
            found = sample_FIELD(bound, (float3)(x[i], y[i], z[i]), size, 0);
        }
        x[i] = found.x;
        y[i] = found.y;
        z[i] = found.z;
    }
    return f3(pack(x), pack(y), pack(z));
}

#endif
