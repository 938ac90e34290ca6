// `classify`: what the values of a grid mean. One work-item a packet of voxels.

// What control points say of a value.
typedef struct {
    F density;
    F3 first;
    F3 second;
} Control;

Control point(const Bound *bound, F value);
F3 color(const Bound *bound, const Control *p);

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
    uint first = unit % packs * PACK + (uint)(n % PACK);
    if (first >= slice) {
        return;
    }
    U place = elements(first, slice);
    int marked[WIDTH];
    unpack(filled(first, slice), marked);
    int3 size = convert_int3(dims.xyz);
    F value = texels_values(bound, place_values(bound, as_signed(place % dims.x), as_signed(place / dims.x), (I)((int)z), size, 0));
    Control p = point(bound, value);
    size_t out = (size_t)z * slice + first;
    if (dims.w < CLASSIFY_COLOR) {
        F reach = greater(greater(p.first.x, p.first.y), p.first.z);
        put(dims.w == CLASSIFY_REACH ? reach : p.density, bound->classified + out, LANE, marked);
        return;
    }
    F3 found = color(bound, &p);
    put(found.x, bound->classified + 4u * out, 4u * LANE, marked);
    put(found.y, bound->classified + 4u * out, 4u * LANE + 1u, marked);
    put(found.z, bound->classified + 4u * out, 4u * LANE + 2u, marked);
    put((F)(0.0f), bound->classified + 4u * out, 4u * LANE + 3u, marked);
}

// What the control points say of values: linear between two, constant beyond the first and the last.
Control point(const Bound *bound, F value) {
    uint count = bound->params->count;
    I below = (I)(0);
    for (uint i = 0u; i < count; i++) {
        below = bound->points[i].place.x <= value ? below + 1 : below;
    }
    // A value, a density, a first colour from the fourth float on and a second from the eighth.
    __global const float *points = (__global const float *)bound->points;
    I a = 12 * (max(below, (I)(1)) - 1);
    I b = 12 * min(below, (I)((int)count - 1));
    F start = fetch(points, a);
    F width = fetch(points, b) - start;
    // Beyond the ends both are one point, and between them never.
    F f = width > 0.0f ? (value - start) / width : (F)(0.0f);
    F found[12];
    for (uint i = 1u; i < 11u; i++) {
        F from = fetch(points + i, a);
        found[i] = from + (fetch(points + i, b) - from) * f;
    }
    Control p;
    p.density = found[1];
    p.first = f3(found[4], found[5], found[6]);
    p.second = f3(found[8], found[9], found[10]);
    return p;
}

// The colour of a kind that has one.
F3 color(const Bound *bound, const Control *p) {
    if (bound->params->dims.w == CLASSIFY_COLOR) {
        return p->first;
    }
    F3 scatters = scale3(p->first, p->density);
    if (bound->params->dims.w == CLASSIFY_SCATTERING) {
        return scatters;
    }
    return mul3(scatters, p->second);
}
