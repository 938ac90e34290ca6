// Rays through a mesh, as core/src/stage/trace.rs lays it out.

// Rays, and directions across them.
typedef struct {
    F3 origin;
    // Unit.
    F3 direction;
    // One over the direction.
    F3 inverse;
    F3 u;
    F3 v;
    // The first box that `blocked` asks for.
    uint begin;
} Line;

typedef struct {
    // Metres along, FAR for none.
    F distance;
    I triangle;
    // Of the corners.
    F3 weights;
} Hit;

// Where rays cross a triangle: metres along, -1 where they do not; weights of the corners.
typedef struct {
    F distance;
    F3 weights;
} Crossing;

M meets(const Bound *bound, const Line *of, uint node, F limit);
Crossing crossed(const Bound *bound, const Line *of, uint triangle);
F3 seen(const Line *of, float3 point);
float3 place(const Bound *bound, uint record);

// The rays along unit `direction`s, with a frame across each (Duff et al. 2017).
Line line(F3 origin, F3 direction) {
    F one = (F)(1.0f);
    F little = (F)(1e-20f);
    F s = direction.z >= (F)(0.0f) ? one : -one;
    F a = -1.0f / (s + direction.z);
    F b = direction.x * direction.y * a;
    Line of;
    of.origin = origin;
    of.direction = direction;
    of.begin = 0u;
    of.u = f3(1.0f + s * direction.x * direction.x * a, s * b, -s * direction.x);
    of.v = f3(b, s + direction.y * direction.y * a, -direction.y);
    // Along a wall of a box: far enough from parallel to divide by.
    of.inverse = f3(1.0f / (fabs(direction.x) < little ? little : direction.x),
                    1.0f / (fabs(direction.y) < little ? little : direction.y),
                    1.0f / (fabs(direction.z) < little ? little : direction.z));
    return of;
}

// The nearest triangles within boxes `begin` to `end`, between `least` and `limit` metres along.
Hit nearest(const Bound *bound, const Line *of, float least, F limit, uint begin, uint end) {
    Hit found;
    found.distance = (F)(FAR);
    found.triangle = (I)(0);
    found.weights = all3((float3)(0.0f));
    F far = limit;
    uint node = begin;
    while (node < end) {
        if (!any_lane(meets(bound, of, node, far))) {
            node = bound->mesh[2u * node].number;
            continue;
        }
        uint leaf = bound->mesh[2u * node + 1u].number;
        uint first = leaf >> MESH_COUNT_BITS;
        for (uint k = 0u; k < (leaf & MESH_COUNT_MASK); k++) {
            Crossing at = crossed(bound, of, first + k);
            M nearer = (at.distance >= least) & (at.distance < far);
            if (any_lane(nearer)) {
                far = nearer ? at.distance : far;
                found.distance = nearer ? at.distance : found.distance;
                found.triangle = nearer ? (I)((int)(first + k)) : found.triangle;
                found.weights = pick3(nearer, at.weights, found.weights);
            }
        }
        node++;
    }
    return found;
}

// Where a triangle stands within `limit` metres; lanes that are not active are not asked for.
M blocked(const Bound *bound, const Line *of, F limit, M active) {
    M open = active;
    uint node = of->begin;
    while (node < bound->params->nodes && any_lane(open)) {
        if (!any_lane(open & meets(bound, of, node, limit))) {
            node = bound->mesh[2u * node].number;
            continue;
        }
        uint leaf = bound->mesh[2u * node + 1u].number;
        uint first = leaf >> MESH_COUNT_BITS;
        for (uint k = 0u; k < (leaf & MESH_COUNT_MASK); k++) {
            F at = crossed(bound, of, first + k).distance;
            open &= !((at >= 0.0f) & (at < limit));
        }
        node++;
    }
    return active & !open;
}

// The first box of triangles that reaches into those from `lower` to `upper`; the number of boxes where none does.
uint first_within(const Bound *bound, F3 lower, F3 upper) {
    uint node = 0u;
    while (node < bound->params->nodes) {
        F3 low = all3(place(bound, 2u * node));
        F3 high = all3(place(bound, 2u * node + 1u));
        M below = (lower.x <= high.x) & (lower.y <= high.y) & (lower.z <= high.z);
        M above = (upper.x >= low.x) & (upper.y >= low.y) & (upper.z >= low.z);
        if (!any_lane(below & above)) {
            node = bound->mesh[2u * node].number;
        } else if ((bound->mesh[2u * node + 1u].number & MESH_COUNT_MASK) == 0u) {
            node++;
        } else {
            break;
        }
    }
    return node;
}

// Which rays meet a box within `limit` metres.
M meets(const Bound *bound, const Line *of, uint node, F limit) {
    F3 lower = mul3(sub3(all3(place(bound, 2u * node)), of->origin), of->inverse);
    F3 upper = mul3(sub3(all3(place(bound, 2u * node + 1u)), of->origin), of->inverse);
    F near = greater(greater(lesser(lower.x, upper.x), lesser(lower.y, upper.y)),
                     greater(lesser(lower.z, upper.z), (F)(0.0f)));
    F far = lesser(lesser(greater(lower.x, upper.x), greater(lower.y, upper.y)),
                   lesser(greater(lower.z, upper.z), limit));
    // Distances are good to a few units in the last place.
    return near <= far * 1.000002f;
}

// Where the rays cross a triangle.
Crossing crossed(const Bound *bound, const Line *of, uint triangle) {
    uint at = 2u * bound->params->nodes + 6u * triangle;
    F3 a = seen(of, place(bound, at));
    F3 b = seen(of, place(bound, at + 1u));
    F3 c = seen(of, place(bound, at + 2u));
    F3 first = f3(b.x * c.y, c.x * a.y, a.x * b.y);
    F3 second = f3(b.y * c.x, c.y * a.x, a.y * b.x);
    F3 edges = sub3(first, second);
    F3 slack = f3(MESH_SLACK * (fabs(first.x) + fabs(second.x)), MESH_SLACK * (fabs(first.y) + fabs(second.y)),
                  MESH_SLACK * (fabs(first.z) + fabs(second.z)));
    M left = (edges.x >= -slack.x) & (edges.y >= -slack.y) & (edges.z >= -slack.z);
    M right = (edges.x <= slack.x) & (edges.y <= slack.y) & (edges.z <= slack.z);
    F zero = (F)(0.0f);
    F s = edges.x + edges.y + edges.z >= zero ? (F)(1.0f) : (F)(-1.0f);
    F3 inside = f3(greater(s * edges.x, zero), greater(s * edges.y, zero), greater(s * edges.z, zero));
    F sum = inside.x + inside.y + inside.z;
    M within = (left | right) & (sum > zero);
    Crossing found;
    found.weights = f3(inside.x / sum, inside.y / sum, inside.z / sum);
    F along = found.weights.x * a.z + found.weights.y * b.z + found.weights.z * c.z;
    found.distance = within ? along : (F)(-1.0f);
    return found;
}

// The place of a record.
float3 place(const Bound *bound, uint record) {
    MeshRecord at = bound->mesh[record];
    return (float3)(at.x, at.y, at.z);
}

// A point across and along the rays.
F3 seen(const Line *of, float3 point) {
    F3 p = sub3(all3(point), of->origin);
    return f3(dot3(p, of->u), dot3(p, of->v), dot3(p, of->direction));
}
