// `classify`: what the values of a grid mean. One work-item a packet of voxels.

// Control points up to which packets go through all of them, in place of looking up each lane's own: what that asks for does not fit
// into sixteen registers.
#define FEW (WIDTH == 1 || REGISTERS == 16 ? 0u : 16u)

// A control point of each lane, or what is between two.
typedef struct {
    F value;
    F density;
    F3 first;
    F3 second;
} Control;

Control point(const Bound *bound, F value);
INLINE Control held(const Bound *bound, I n);
INLINE Control chosen(const Bound *bound, M chosen, uint n, Control other);
INLINE F3 mixed(F3 from, F3 to, F f);
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
    uint count = min((uint)WIDTH, slice - first);
    F value = run_values(bound, (int3)((int)first, 0, (int)z), (int)count, convert_int3(dims.xyz));
    Control p = point(bound, value);
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
    Control from;
    from.value = from.density = (F)(0.0f);
    from.first = from.second = all3((float3)(0.0f));
    Control to;
    if (count <= FEW) {
        from = to = chosen(bound, (M)(-1), 0u, from);
        for (uint i = 0u; i < count; i++) {
            M past = bound->points[i].place.x <= value;
            from = chosen(bound, past, i, from);
            to = chosen(bound, past, min(i + 1u, count - 1u), to);
        }
    } else {
        I below = (I)(0);
        for (uint i = 0u; i < count; i++) {
            below = bound->points[i].place.x <= value ? below + 1 : below;
        }
        from = held(bound, max(below, (I)(1)) - 1);
        to = held(bound, min(below, (I)((int)count - 1)));
    }
    F width = to.value - from.value;
    // Beyond the ends both are one point, and between them never.
    F f = width > 0.0f ? (value - from.value) / width : (F)(0.0f);
    Control p;
    p.value = value;
    p.density = from.density + (to.density - from.density) * f;
    p.first = mixed(from.first, to.first, f);
    p.second = mixed(from.second, to.second, f);
    return p;
}

// The points of these numbers.
INLINE Control held(const Bound *bound, I n) {
    // A value, a density, a first colour from the fourth float on and a second from the eighth.
    __global const float *points = (__global const float *)bound->points;
    Control p;
    I at = 12 * n;
    PAIR_float place = fetch_pair(points, at);
    PAIR_float first = fetch_pair(points + 4, at);
    p.value = place.near;
    p.density = place.far;
    p.first = f3(first.near, first.far, fetch(points + 6, at));
    p.second = all3((float3)(0.0f));
    if (bound->params->dims.w == CLASSIFY_SEEN) {
        PAIR_float second = fetch_pair(points + 8, at);
        p.second = f3(second.near, second.far, fetch(points + 10, at));
    }
    return p;
}

// One point in lanes that choose it, and another in the rest.
INLINE Control chosen(const Bound *bound, M chosen, uint n, Control other) {
    Control p;
    p.value = chosen ? bound->points[n].place.x : other.value;
    p.density = chosen ? bound->points[n].place.y : other.density;
    p.first = pick3(chosen, all3(bound->points[n].first.xyz), other.first);
    p.second = all3((float3)(0.0f));
    if (bound->params->dims.w == CLASSIFY_SEEN) {
        p.second = pick3(chosen, all3(bound->points[n].second.xyz), other.second);
    }
    return p;
}

// Between two colours.
INLINE F3 mixed(F3 from, F3 to, F f) {
    return add3(from, scale3(sub3(to, from), f));
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
