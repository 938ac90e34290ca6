// Lookups of the field FIELD, whose texels are VALUEs; instantiated for each field of a stage. `size` is the number of
// texels of a layer along x, y and z.

INLINE FOUND_VALUE row_FIELD(const Bound *bound, TEXEL_VALUE at, INDEX_VALUE beside, PLACE_VALUE f);

// `p` within [0, size - 1], also where it is not a number: what is looked up is always there.
INLINE PLACE_VALUE within_FIELD(PLACE_VALUE p, int size) {
    PLACE_VALUE first = (PLACE_VALUE)(0.0f);
    PLACE_VALUE last = (PLACE_VALUE)(convert_float(size - 1));
    p = p > first ? p : first;
    return p < last ? p : last;
}

// Trilinear lookup of a layer at `p`, where texel i lies at i; x then y then z, indices clamped at the edge.
INLINE FOUND_VALUE sample_FIELD(const Bound *bound, POINT_VALUE p, int3 size, int layer) {
    // Clamping the point is clamping both indices: beyond the outermost centres both are the same texel.
    PLACE_VALUE x = within_FIELD(p.x, size.x);
    PLACE_VALUE y = within_FIELD(p.y, size.y);
    PLACE_VALUE z = within_FIELD(p.z, size.z);
    INDEX_VALUE x0 = INT_VALUE(x);
    INDEX_VALUE y0 = INT_VALUE(y);
    INDEX_VALUE z0 = INT_VALUE(z);
    TEXEL_VALUE upper = place_FIELD(bound, x0, y0, z0, size, layer);
    TEXEL_VALUE behind = behind_FIELD(bound, upper, x0, y0, z0, size, layer);
    INDEX_VALUE beside = beside_FIELD(bound, x0, size);
    INDEX_VALUE below = below_FIELD(bound, y0, size);
    TEXEL_VALUE lower = upper;
    TEXEL_VALUE last = behind;
    lower.place += below;
    last.place += below;
    PLACE_VALUE fx = x - FLOAT_VALUE(x0);
    PLACE_VALUE fy = y - FLOAT_VALUE(y0);
    PLACE_VALUE fz = z - FLOAT_VALUE(z0);
    FOUND_VALUE a = row_FIELD(bound, upper, beside, fx);
    FOUND_VALUE b = row_FIELD(bound, lower, beside, fx);
    FOUND_VALUE c = row_FIELD(bound, behind, beside, fx);
    FOUND_VALUE d = row_FIELD(bound, last, beside, fx);
    FOUND_VALUE near = a + (b - a) * fy;
    FOUND_VALUE far = c + (d - c) * fy;
    return near + (far - near) * fz;
}

// Between a texel and the next along x.
FOUND_VALUE row_FIELD(const Bound *bound, TEXEL_VALUE at, INDEX_VALUE beside, PLACE_VALUE f) {
    PAIR_VALUE pair = pair_FIELD(bound, at, beside);
    return pair.near + (pair.far - pair.near) * f;
}

#if COLORED_VALUE

// Between eight texels' numbers, each of a row of two, by the sums of a lookup.
INLINE F between_FIELD(F3 f, float2 a, float2 b, float2 c, float2 d) {
    F upper = f.x * (a.y - a.x) + a.x;
    F lower = f.x * (b.y - b.x) + b.x;
    F behind = f.x * (c.y - c.x) + c.x;
    F last = f.x * (d.y - d.x) + d.x;
    F near = upper + (lower - upper) * f.y;
    F far = behind + (last - behind) * f.y;
    return near + (far - near) * f.z;
}

#define CHANNEL(c)                                                                                                    \
    between_FIELD(f, (float2)(upper.near.c, upper.far.c), (float2)(lower.near.c, lower.far.c),                        \
                  (float2)(behind.near.c, behind.far.c), (float2)(last.near.c, last.far.c))

// Adds to the first `channels` of `sums` what layers hold around each lane's point, or at the texel that is nearest to it, each times
// a weight, one where there are none; nothing to lanes that are not active. Lanes whose lookups fall between the same
// texels are looked up together.
INLINE void grouped_FIELD(const Bound *bound, F3 p, int3 size, uint first, uint layers, const F *weights, bool trilinear,
                          M active, uint channels, F *sums) {
    F zero = (F)(0.0f);
    float by = trilinear ? 0.0f : 0.5f;
    F3 top = all3(convert_float3(size - 1));
    F3 at = f3(lesser(greater(p.x + by, zero), top.x), lesser(greater(p.y + by, zero), top.y),
               lesser(greater(p.z + by, zero), top.z));
    I x = to_int(at.x);
    I y = to_int(at.y);
    I z = to_int(at.z);
    F3 f = trilinear ? sub3(at, f3(to_float(x), to_float(y), to_float(z))) : f3(zero, zero, zero);
    I cell = (z * size.y + y) * size.x + x;
    M left = active;
    while (any_lane(left)) {
        int number = largest_index(left ? cell : (I)(-1));
        M lanes = left & (cell == number);
        left &= !lanes;
        int i = number % size.x;
        int j = number / size.x % size.y;
        int k = number / size.x / size.y;
        int beside = beside_FIELD(bound, i, size);
        int below = below_FIELD(bound, j, size);
        for (uint layer = 0u; layer < layers; layer++) {
            TEXEL_VALUE here = place_FIELD(bound, i, j, k, size, (int)(first + layer));
            TEXEL_VALUE there = behind_FIELD(bound, here, i, j, k, size, (int)(first + layer));
            PAIR_VALUE upper = pair_FIELD(bound, here, beside);
            PAIR_VALUE behind = pair_FIELD(bound, there, beside);
            here.place += below;
            there.place += below;
            PAIR_VALUE lower = pair_FIELD(bound, here, beside);
            PAIR_VALUE last = pair_FIELD(bound, there, beside);
            F weight = weights ? weights[layer] : (F)(1.0f);
            sums[0] = lanes ? sums[0] + weight * CHANNEL(x) : sums[0];
            sums[1] = lanes ? sums[1] + weight * CHANNEL(y) : sums[1];
            sums[2] = lanes ? sums[2] + weight * CHANNEL(z) : sums[2];
            if (channels > 3u) {
                sums[3] = lanes ? sums[3] + weight * CHANNEL(w) : sums[3];
            }
        }
    }
}

#undef CHANNEL

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
