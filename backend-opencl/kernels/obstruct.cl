// `obstruct`: which of a cell's neighbours lie behind surfaces. One work-item a packet of cells.

F3 center(const Bound *bound, F3 cell);

void run_obstruct(const Bound *bound) {
    size_t n = number();
    if (n >= bound->launch->count) {
        return;
    }
    size_t first = bound->launch->start + n;
    U index = bound->launch->start + elements(n, bound->launch->count);
    M kept = filled(n, bound->launch->count);
    uint3 cells = bound->params->cells.xyz;
    F3 cell = f3(to_float(index % cells.x), to_float(index / cells.x % cells.y), to_float(index / cells.x / cells.y));
    F3 origin = center(bound, cell);
    I word = (I)(0);
    if (bound->params->neighbor_begin > 0u) {
        // What the passes before left.
        word = as_signed(fetch_uint(bound->obstructed, index));
    }
    // Most cells have no triangle near. More than what rounding makes of the neighbours' places.
    float3 side = bound->params->cell.xyz;
    float3 reach = 1.001f * (float3)(dot(fabs(bound->params->world_x.xyz), side), dot(fabs(bound->params->world_y.xyz), side),
                                     dot(fabs(bound->params->world_z.xyz), side));
    F3 near = f3(1e-6f * fabs(origin.x) + reach.x, 1e-6f * fabs(origin.y) + reach.y, 1e-6f * fabs(origin.z) + reach.z);
    uint begin = first_within(bound, sub3(origin, near), add3(origin, near));
    uint end = begin < bound->params->nodes ? bound->params->neighbor_end : bound->params->neighbor_begin;
    for (uint bit = bound->params->neighbor_begin; bit < end; bit++) {
        if (bit == NEIGHBORS / 2u) {
            continue;
        }
        float3 hop = convert_float3((uint3)(bit % 3u, bit / 3u % 3u, bit / 9u)) - 1.0f;
        F3 way = sub3(center(bound, add3(cell, all3(hop))), origin);
        F far = sqrt(dot3(way, way));
        Line free = line(origin, f3(way.x / far, way.y / far, way.z / far));
        free.begin = begin;
        word = blocked(bound, &free, far, kept) ? word | (int)(1u << bit) : word;
    }
    int marked[WIDTH];
    int words[WIDTH];
    unpack(kept, marked);
    unpack(word, words);
    for (uint i = 0u; i < WIDTH; i++) {
        if (marked[i]) {
            bound->obstructed[first + i] = (uint)words[i];
        }
    }
}

// Where the centres of cells are, from the mesh's origin.
F3 center(const Bound *bound, F3 cell) {
    float3 side = bound->params->cell.xyz;
    float3 size = convert_float3(bound->params->dims.xyz);
    F3 v = f3((cell.x + 0.5f) * side.x - 0.5f - (size.x - 1.0f) * 0.5f, (cell.y + 0.5f) * side.y - 0.5f - (size.y - 1.0f) * 0.5f,
              (cell.z + 0.5f) * side.z - 0.5f - (size.z - 1.0f) * 0.5f);
    F3 at = f3(dot3(all3(bound->params->world_x.xyz), v), dot3(all3(bound->params->world_y.xyz), v),
               dot3(all3(bound->params->world_z.xyz), v));
    return add3(at, all3(bound->params->mesh_eye.xyz));
}
