// Walks along rays from one tentative collision to the next, through cells of constant rate.

// A walk in index space.
typedef struct {
    float3 origin;
    // Voxels per metre.
    float3 direction;
    // Metres along.
    float t;
    // Where it ends.
    float far;
    int3 cell;
    // Whether it has ended.
    bool over;
} Walk;

// A direction of the world in voxels per metre, far enough from parallel to the walls to divide by.
float3 carried(const Bound *bound, float3 d) {
    float3 c = (float3)(
        dot(d, bound->params->index_x.xyz),
        dot(d, bound->params->index_y.xyz),
        dot(d, bound->params->index_z.xyz)
    );
    return fabs(c) < (float3)(1e-20f) ? (float3)(1e-20f) : c;
}

// The walk from a place along a direction of index space within the box, to `limit` metres at the most.
Walk walk(const Bound *bound, float3 origin, float3 direction, float limit) {
    Walk on;
    on.origin = origin;
    on.direction = direction;
    float3 lower = (-0.5f - on.origin) / on.direction;
    float3 upper = (convert_float3(bound->params->dims.xyz) - 0.5f - on.origin) / on.direction;
    float3 first = min(lower, upper);
    float3 last = max(lower, upper);
    on.t = max(max(first.x, first.y), max(first.z, 0.0f));
    on.far = min(min(last.x, last.y), min(last.z, limit));
    float side = convert_float(bound->params->majorant_cells.w);
    float3 at = floor((on.origin + on.t * on.direction + 0.5f) / side);
    float3 most = convert_float3(bound->params->majorant_cells.xyz - 1u);
    on.cell = convert_int3(at > (float3)(0.0f) ? min(at, most) : (float3)(0.0f));
    on.over = on.t >= on.far;
    return on;
}

// Where it stands, in index space.
INLINE float3 stands(const Walk *on) {
    return on->origin + on->t * on->direction;
}

// On to the next tentative collision within the cell, whose rate it gives; else to the next cell, and 0.
INLINE float advance(const Bound *bound, Walk *on, Draws *numbers) {
    uint4 cells = bound->params->majorant_cells;
    float side = convert_float(cells.w);
    int3 onward = on->direction > (float3)(0.0f) ? (int3)(1) : (int3)(0);
    float3 leave = (convert_float3(on->cell + onward) * side - 0.5f - on->origin) / on->direction;
    float exit = min(min(min(leave.x, leave.y), leave.z), on->far);
    size_t number = ((size_t)on->cell.z * cells.y + on->cell.y) * cells.x + on->cell.x;
    float most = bound->majorant[number].y;
    if (most > 0.0f) {
        float rate = max(most * bound->params->densest, bound->params->least);
        if (rate > 0.0f) {
            float next = on->t + optical_depth(draw(numbers)) / rate;
            if (next < exit) {
                on->t = next;
                return rate;
            }
        }
    }
    on->t = max(on->t, exit);
    // Through the nearest wall, without branches that nothing foretells.
    int x = (leave.x <= leave.y) & (leave.x <= leave.z);
    int y = (leave.y <= leave.z) & (1 - x);
    on->cell += (2 * onward - 1) * (int3)(x, y, 1 - x - y);
    bool outside = any(on->cell < (int3)(0)) || any(on->cell >= convert_int3(cells.xyz));
    on->over = exit >= on->far || outside;
    return 0.0f;
}
