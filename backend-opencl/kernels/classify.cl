// `classify`: what the values of a grid mean. One work-item a packet of voxels.

// What control points say of a value.
typedef struct {
    F density;
    F3 first;
    F3 second;
} Control;

// Control points up to which packets go through all of them for each number, in place of looking up each lane's own.
#define FEW (WIDTH == 1 ? 0u : 16u)

// Two neighbouring points of each lane.
typedef struct {
    F value;
    // How many points there are, and where the two begin among their floats.
    uint count;
    I a;
    I b;
    // How far the value is on its way between them.
    F part;
} Between;

Control point(const Bound *bound, F value);
INLINE F2 both(__global const float *numbers, const Between *at, uint n);
INLINE F mixed(__global const float *numbers, const Between *at, uint n);
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
    Between at;
    at.value = value;
    at.count = count;
    at.a = 12 * (max(below, (I)(1)) - 1);
    at.b = 12 * min(below, (I)((int)count - 1));
    F2 ends = both(points, &at, 0u);
    F width = ends.y - ends.x;
    // Beyond the ends both are one point, and between them never.
    at.part = width > 0.0f ? (value - ends.x) / width : (F)(0.0f);
    Control p;
    p.density = mixed(points, &at, 1u);
    p.first = f3(mixed(points, &at, 4u), mixed(points, &at, 5u), mixed(points, &at, 6u));
    p.second = all3((float3)(0.0f));
    if (bound->params->dims.w == CLASSIFY_SEEN) {
        p.second = f3(mixed(points, &at, 8u), mixed(points, &at, 9u), mixed(points, &at, 10u));
    }
    return p;
}

// Number `n` of the two points.
INLINE F2 both(__global const float *numbers, const Between *at, uint n) {
    F2 found;
    if (at->count > FEW) {
        found.x = fetch(numbers + n, at->a);
        found.y = fetch(numbers + n, at->b);
        return found;
    }
    found.x = found.y = (F)(numbers[n]);
    for (uint i = 0u; i < at->count; i++) {
        M past = numbers[12u * i] <= at->value;
        found.x = past ? numbers[12u * i + n] : found.x;
        found.y = past ? numbers[12u * min(i + 1u, at->count - 1u) + n] : found.y;
    }
    return found;
}

// Number `n` between the two points.
INLINE F mixed(__global const float *numbers, const Between *at, uint n) {
    F2 ends = both(numbers, at, n);
    return ends.x + (ends.y - ends.x) * at->part;
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
