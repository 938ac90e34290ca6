// Lookups of the field FIELD, whose texels are VALUEs; instantiated for each field of a stage. `size` is the number of
// texels of a layer along x, y and z.

VALUE row_FIELD(const Bound *bound, int x0, int x1, int y, int z, float f, int3 size, int layer);

// `p` within [0, last], also where it is not a number: what is looked up is always there.
float3 within_FIELD(float3 p, int3 size) {
    return p > (float3)(0.0f) ? min(p, convert_float3(size - 1)) : (float3)(0.0f);
}

// The nearest texel of a layer to `p`.
VALUE nearest_FIELD(const Bound *bound, float3 p, int3 size, int layer) {
    return texel_FIELD(bound, convert_int3(within_FIELD(floor(p + 0.5f), size)), size, layer);
}

// Trilinear lookup of a layer at `p`, where texel i lies at i; x then y then z, indices clamped at the edge.
VALUE sample_FIELD(const Bound *bound, float3 p, int3 size, int layer) {
    // Clamping the point is clamping both indices: beyond the outermost centres both are the same texel.
    float3 q = within_FIELD(p, size);
    int3 lo = convert_int3(q);
    int3 hi = min(lo + 1, size - 1);
    float3 f = q - convert_float3(lo);
    VALUE a = row_FIELD(bound, lo.x, hi.x, lo.y, lo.z, f.x, size, layer);
    VALUE b = row_FIELD(bound, lo.x, hi.x, hi.y, lo.z, f.x, size, layer);
    VALUE c = row_FIELD(bound, lo.x, hi.x, lo.y, hi.z, f.x, size, layer);
    VALUE d = row_FIELD(bound, lo.x, hi.x, hi.y, hi.z, f.x, size, layer);
    VALUE near = a + (b - a) * f.y;
    VALUE far = c + (d - c) * f.y;
    return near + (far - near) * f.z;
}

VALUE row_FIELD(const Bound *bound, int x0, int x1, int y, int z, float f, int3 size, int layer) {
    VALUE a = texel_FIELD(bound, (int3)(x0, y, z), size, layer);
    VALUE b = texel_FIELD(bound, (int3)(x1, y, z), size, layer);
    return a + (b - a) * f;
}
