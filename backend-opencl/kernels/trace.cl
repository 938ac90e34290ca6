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
    __global float *out = (__global float *)(bound->hits + 2u * (bound->launch->start + n));
    uint begin = bound->params->node_begin;
    Line of = line(all3(bound->params->eye.xyz), view(bound, unit));
    F limit = (F)(FAR);
    if (begin > 0u) {
        limit = lesser(fetch((__global const float *)bound->hits, 8u * unit + 3u), limit);
    }
    Hit hit = nearest(bound, &of, 0.0f, limit, begin, bound->params->node_end);
    M met = hit.distance < FAR;
    int marked[WIDTH];
    if (begin == 0u) {
        unpack(kept & !met, marked);
        for (uint c = 0u; c < 8u; c++) {
            put((F)(c == 3u ? INFINITY : 0.0f), out + c, 8u * LANE, marked);
        }
    }
    if (!any_lane(met)) {
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
    unpack(kept & met, marked);
    put(normal.x, out, 8u * LANE, marked);
    put(normal.y, out + 1, 8u * LANE, marked);
    put(normal.z, out + 2, 8u * LANE, marked);
    put(hit.distance, out + 3, 8u * LANE, marked);
    put(own.x, out + 4, 8u * LANE, marked);
    put(own.y, out + 5, 8u * LANE, marked);
    put(own.z, out + 6, 8u * LANE, marked);
    put(number, out + 7, 8u * LANE, marked);
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
