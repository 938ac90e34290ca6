// `obstruct`: which of a cell's neighbours lie behind surfaces. One work-item a cell.

float3 center(const Bound *bound, float3 cell);

void run_obstruct(const Bound *bound) {
    size_t n = number();
    if (n >= bound->launch->count) {
        return;
    }
    uint index = bound->launch->start + (uint)n;
    uint3 cells = bound->params->cells.xyz;
    float3 cell = convert_float3((uint3)(index % cells.x, index / cells.x % cells.y, index / cells.x / cells.y));
    float3 origin = center(bound, cell);
    uint word = 0u;
    if (bound->params->neighbor_begin > 0u) {
        // What the passes before left.
        word = bound->obstructed[index];
    }
    for (uint bit = bound->params->neighbor_begin; bit < bound->params->neighbor_end; bit++) {
        if (bit == NEIGHBORS / 2u) {
            continue;
        }
        float3 way = center(bound, cell + convert_float3((uint3)(bit % 3u, bit / 3u % 3u, bit / 9u)) - 1.0f) - origin;
        float far = sqrt(dot(way, way));
        Line free = line(origin, way / far);
        if (blocked(bound, &free, far)) {
            word |= 1u << bit;
        }
    }
    bound->obstructed[index] = word;
}

// Where the centre of a cell is, from the mesh's origin.
float3 center(const Bound *bound, float3 cell) {
    float3 v = (cell + 0.5f) * bound->params->cell.xyz - 0.5f - (convert_float3(bound->params->dims.xyz) - 1.0f) * 0.5f;
    float3 x = bound->params->world_x.xyz;
    float3 y = bound->params->world_y.xyz;
    float3 z = bound->params->world_z.xyz;
    return (float3)(dot(x, v), dot(y, v), dot(z, v)) + bound->params->mesh_eye.xyz;
}
