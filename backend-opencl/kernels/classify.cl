// `classify`: what the values of a grid mean. One work-item a packet of voxels.

// What control points say of a value.
typedef struct {
    F density;
    F3 first;
    F3 second;
} Control;

Control point(const Bound *bound, F value);
INLINE F mixed(__global const float *numbers, I a, I b, F f);
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
    // A slice's rows lie one behind the other.
    I place = as_signed(elements(first, slice));
    F value = texels_values(bound, place_values(bound, place, (I)(0), (I)((int)z), convert_int3(dims.xyz), 0));
    Control p = point(bound, value);
    uint count = min((uint)WIDTH, slice - first);
    size_t out = (size_t)z * slice + first;
    if (dims.w < CLASSIFY_COLOR) {
        F reach = greater(greater(p.first.x, p.first.y), p.first.z);
        put_row(dims.w == CLASSIFY_REACH ? reach : p.density, bound->classified + out, count);
        return;
    }
    put_colors(color(bound, &p), bound->classified + 4u * out, count);
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
    Control p;
    p.density = mixed(points + 1, a, b, f);
    p.first = f3(mixed(points + 4, a, b, f), mixed(points + 5, a, b, f), mixed(points + 6, a, b, f));
    p.second = all3((float3)(0.0f));
    if (bound->params->dims.w == CLASSIFY_SEEN) {
        p.second = f3(mixed(points + 8, a, b, f), mixed(points + 9, a, b, f), mixed(points + 10, a, b, f));
    }
    return p;
}

// Between a number of two points.
F mixed(__global const float *numbers, I a, I b, F f) {
    F from = fetch(numbers, a);
    return from + (fetch(numbers, b) - from) * f;
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
