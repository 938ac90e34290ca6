// `trace`: where view rays meet surfaces. One work-item a packet of sub-pixel positions.

F3 facet(const Bound *bound, const Line *of, U at);

// The places of records.
F3 places(const Bound *bound, U record) {
    __global const float *mesh = (__global const float *)bound->mesh;
    return f3(fetch(mesh, 4u * record), fetch(mesh, 4u * record + 1u), fetch(mesh, 4u * record + 2u));
}

void run_trace(const Bound *bound) {
    size_t n = number();
    if (n >= bound->launch->count) {
        return;
    }
    U unit = bound->launch->start + elements(n, bound->launch->count);
    M kept = filled(n, bound->launch->count);
    uint begin = bound->params->node_begin;
    Line of = line(all3(bound->params->eye.xyz), view(bound, unit));
    F limit = (F)(FAR);
    if (begin > 0u) {
        limit = lesser(fetch((__global const float *)bound->hits, 8u * unit + 3u), limit);
    }
    Hit hit = nearest(bound, &of, 0.0f, limit, begin, bound->params->node_end);
    M met = hit.distance < FAR;
    M stored = begin == 0u ? kept : kept & met;
    if (!any_lane(stored)) {
        return;
    }
    F3 none = all3((float3)(0.0f));
    if (!any_lane(met)) {
        put_eight(bound->hits, unit, stored, none, (F)(INFINITY), none, (F)(0.0f));
        return;
    }
    U at = 2u * bound->params->nodes + 6u * as_index(hit.triangle);
    F3 own = facet(bound, &of, at);
    F3 normal = add3(scale3(places(bound, at + 3u), hit.weights.x), scale3(places(bound, at + 4u), hit.weights.y));
    normal = add3(normal, scale3(places(bound, at + 5u), hit.weights.z));
    F size = sqrt(dot3(normal, normal));
    normal = pick3(size > 0.0f, f3(normal.x / size, normal.y / size, normal.z / size), own);
    normal = pick3(dot3(normal, own) < 0.0f, f3(-normal.x, -normal.y, -normal.z), normal);
    F number = to_float(fetch_uint(&bound->mesh->number, 4u * (at + 3u)));
    put_eight(bound->hits, unit, stored, pick3(met, normal, none), met ? hit.distance : (F)(INFINITY), pick3(met, own, none),
              met ? number : (F)(0.0f));
}

// The normals of the triangles whose records begin at `at`, on the side that the rays come from.
F3 facet(const Bound *bound, const Line *of, U at) {
    F3 a = places(bound, at);
    F3 b = sub3(places(bound, at + 1u), a);
    F3 c = sub3(places(bound, at + 2u), a);
    F3 across = f3(b.y * c.z - b.z * c.y, b.z * c.x - b.x * c.z, b.x * c.y - b.y * c.x);
    F size = greater(sqrt(dot3(across, across)), (F)(1.2e-38f));
    F3 own = f3(across.x / size, across.y / size, across.z / size);
    return pick3(dot3(own, of->direction) > 0.0f, f3(-own.x, -own.y, -own.z), own);
}
