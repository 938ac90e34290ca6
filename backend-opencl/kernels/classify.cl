// `classify`: what the values of a grid mean. One work-item a voxel.

ControlRecord point(const Bound *bound, float value);
float3 color(const Bound *bound, ControlRecord p);

void run_classify(const Bound *bound) {
    size_t n = number();
    if (n / PACK >= bound->launch->count) {
        return;
    }
    uint unit = bound->launch->start + (uint)(n / PACK);
    uint4 dims = bound->params->dims;
    uint slice = dims.x * dims.y;
    uint packs = (slice + PACK - 1u) / PACK;
    uint z = unit / packs;
    uint place = unit % packs * PACK + (uint)(n % PACK);
    if (place >= slice) {
        return;
    }
    uint3 at = (uint3)(place % dims.x, place / dims.x, z);
    ControlRecord p = point(bound, texel_values(bound, convert_int3(at), convert_int3(dims.xyz), 0));
    size_t out = (size_t)z * slice + place;
    if (dims.w < CLASSIFY_COLOR) {
        float reach = fmax(fmax(p.first.x, p.first.y), p.first.z);
        bound->classified[out] = dims.w == CLASSIFY_REACH ? reach : p.place.y;
        return;
    }
    float3 found = color(bound, p);
    bound->classified[4u * out] = found.x;
    bound->classified[4u * out + 1u] = found.y;
    bound->classified[4u * out + 2u] = found.z;
    bound->classified[4u * out + 3u] = 0.0f;
}

// What the control points say of a value: linear between two, constant beyond the first and the last.
ControlRecord point(const Bound *bound, float value) {
    uint count = bound->params->count;
    uint below = 0u;
    for (uint i = 0u; i < count; i++) {
        below += bound->points[i].place.x <= value ? 1u : 0u;
    }
    ControlRecord a = bound->points[max(below, 1u) - 1u];
    ControlRecord b = bound->points[min(below, count - 1u)];
    float width = b.place.x - a.place.x;
    // Beyond the ends both are one point, and between them never.
    float f = width > 0.0f ? (value - a.place.x) / width : 0.0f;
    ControlRecord p;
    p.place = a.place + (b.place - a.place) * f;
    p.first = a.first + (b.first - a.first) * f;
    p.second = a.second + (b.second - a.second) * f;
    return p;
}

// The colour of a kind that has one.
float3 color(const Bound *bound, ControlRecord p) {
    if (bound->params->dims.w == CLASSIFY_COLOR) {
        return p.first.xyz;
    }
    float3 scatters = p.place.y * p.first.xyz;
    if (bound->params->dims.w == CLASSIFY_SCATTERING) {
        return scatters;
    }
    return scatters * p.second.xyz;
}
