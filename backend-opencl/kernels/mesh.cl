// Rays through a mesh, as core/src/stage/trace.rs lays it out.

// A ray, and directions across it.
typedef struct {
    float3 origin;
    // Unit.
    float3 direction;
    // One over the direction.
    float3 inverse;
    float3 u;
    float3 v;
} Line;

typedef struct {
    // Metres along, FAR for none.
    float distance;
    uint triangle;
    // Of the corners.
    float3 weights;
} Hit;

bool meets(const Bound *bound, const Line *of, uint node, float limit);
float4 crossed(const Bound *bound, const Line *of, uint triangle);
float3 seen(const Line *of, float3 point);
float3 place(const Bound *bound, uint record);

// The ray along a unit `direction`, with a frame across it (Duff et al. 2017).
Line line(float3 origin, float3 direction) {
    float s = direction.z >= 0.0f ? 1.0f : -1.0f;
    float a = -1.0f / (s + direction.z);
    float b = direction.x * direction.y * a;
    Line of;
    of.origin = origin;
    of.direction = direction;
    of.u = (float3)(1.0f + s * direction.x * direction.x * a, s * b, -s * direction.x);
    of.v = (float3)(b, s + direction.y * direction.y * a, -direction.y);
    // Along a wall of a box: far enough from parallel to divide by.
    of.inverse = 1.0f / (fabs(direction) < (float3)(1e-20f) ? (float3)(1e-20f) : direction);
    return of;
}

// The nearest triangle within boxes `begin` to `end`, between `least` and `limit` metres along.
Hit nearest(const Bound *bound, const Line *of, float least, float limit, uint begin, uint end) {
    Hit found;
    found.distance = FAR;
    found.triangle = 0u;
    found.weights = (float3)(0.0f);
    float far = limit;
    uint node = begin;
    while (node < end) {
        if (!meets(bound, of, node, far)) {
            node = bound->mesh[2u * node].number;
            continue;
        }
        uint leaf = bound->mesh[2u * node + 1u].number;
        uint first = leaf >> MESH_COUNT_BITS;
        for (uint k = 0u; k < (leaf & MESH_COUNT_MASK); k++) {
            float4 at = crossed(bound, of, first + k);
            if (at.x >= least && at.x < far) {
                far = at.x;
                found.distance = far;
                found.triangle = first + k;
                found.weights = at.yzw;
            }
        }
        node++;
    }
    return found;
}

// Whether a triangle stands within `limit` metres.
bool blocked(const Bound *bound, const Line *of, float limit) {
    uint node = 0u;
    while (node < bound->params->nodes) {
        if (!meets(bound, of, node, limit)) {
            node = bound->mesh[2u * node].number;
            continue;
        }
        uint leaf = bound->mesh[2u * node + 1u].number;
        uint first = leaf >> MESH_COUNT_BITS;
        for (uint k = 0u; k < (leaf & MESH_COUNT_MASK); k++) {
            float4 at = crossed(bound, of, first + k);
            if (at.x >= 0.0f && at.x < limit) {
                return true;
            }
        }
        node++;
    }
    return false;
}

// Whether the ray meets a box within `limit` metres.
bool meets(const Bound *bound, const Line *of, uint node, float limit) {
    float3 lower = (place(bound, 2u * node) - of->origin) * of->inverse;
    float3 upper = (place(bound, 2u * node + 1u) - of->origin) * of->inverse;
    float3 first = min(lower, upper);
    float3 last = max(lower, upper);
    float near = max(max(first.x, first.y), max(first.z, 0.0f));
    float far = min(min(last.x, last.y), min(last.z, limit));
    // Distances are good to a few units in the last place.
    return near <= far * 1.000002f;
}

// Where the ray crosses a triangle: metres along, -1 where it does not; weights of the corners.
float4 crossed(const Bound *bound, const Line *of, uint triangle) {
    uint at = 2u * bound->params->nodes + 6u * triangle;
    float3 a = seen(of, place(bound, at));
    float3 b = seen(of, place(bound, at + 1u));
    float3 c = seen(of, place(bound, at + 2u));
    float3 first = (float3)(b.x * c.y, c.x * a.y, a.x * b.y);
    float3 second = (float3)(b.y * c.x, c.y * a.x, a.y * b.x);
    float3 edges = first - second;
    float3 slack = MESH_SLACK * (fabs(first) + fabs(second));
    if (!all(edges >= -slack) && !all(edges <= slack)) {
        return (float4)(-1.0f);
    }
    float s = edges.x + edges.y + edges.z >= 0.0f ? 1.0f : -1.0f;
    float3 inside = max(s * edges, (float3)(0.0f));
    float sum = inside.x + inside.y + inside.z;
    if (sum <= 0.0f) {
        return (float4)(-1.0f);
    }
    float3 weights = inside / sum;
    return (float4)(weights.x * a.z + weights.y * b.z + weights.z * c.z, weights);
}

// The place of a record.
float3 place(const Bound *bound, uint record) {
    MeshRecord at = bound->mesh[record];
    return (float3)(at.x, at.y, at.z);
}

// A point across and along the ray.
float3 seen(const Line *of, float3 point) {
    float3 p = point - of->origin;
    return (float3)(dot(p, of->u), dot(p, of->v), dot(p, of->direction));
}
