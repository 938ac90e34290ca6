// `propagate`: columns or mean densities from every cell to each light. A dispatch is one step; one work-item an item.

int3 on_face(__global const LightFace *face, uint n);
int3 in_shell(const Bound *bound, uint4 first, uint step, uint n);
float mean(const Bound *bound, __global const LightFace *face, uint light, int3 at);
float interpolated(const Bound *bound, uint light, int3 at, float3 u, float longest, uint axis);
float4 nodes(int x, int cells, float u, float longest, bool far);
float gathered(const Bound *bound, uint light, int3 at);
bool within(int x, int cells);
bool inside(const Bound *bound, int3 at);
uint index(const Bound *bound, int3 at, uint light);
float metres(const Bound *bound, float3 u);

void run_propagate(const Bound *bound) {
    size_t item = number();
    if (item >= bound->launch->count) {
        return;
    }
    uint lights = bound->params->lights;
    uint each = bound->params->items / lights;
    uint light = (uint)item / each;
    uint n = (uint)item % each;
    uint step = bound->launch->start;
    int3 at;
    float value;
    if (bound->params->scheme == SCHEME_SHORT_CHARACTERISTICS) {
        __global const LightFace *face = bound->faces + (size_t)step * lights + light;
        at = on_face(face, n);
        if (!inside(bound, at)) {
            return;
        }
        value = mean(bound, face, light, at);
    } else {
        at = in_shell(bound, bound->lights[light].first, step, n);
        if (!inside(bound, at)) {
            return;
        }
        value = gathered(bound, light, at);
    }
    uint place = index(bound, at, light);
    bound->light_depth[place] = value;
    if (light + 1u == lights) {
        // The last light's items also write what lies beyond it in its layer.
        for (uint k = 1u; k < 4u * bound->params->cells.w - light; k++) {
            bound->light_depth[place + k] = 0.0f;
        }
    }
}

// Cell `n` of a face; negative where there is none.
int3 on_face(__global const LightFace *face, uint n) {
    if (face->axis == NO_FACE || n >= face->count_0 * face->count_1) {
        return (int3)(-1);
    }
    uint first = face->first_0 + n % face->count_0;
    uint second = face->first_1 + n / face->count_0;
    if (face->axis == 0u) {
        return (int3)((int)face->plane, (int)first, (int)second);
    }
    if (face->axis == 1u) {
        return (int3)((int)first, (int)face->plane, (int)second);
    }
    return (int3)((int)first, (int)second, (int)face->plane);
}

// Item `n` of the shell `step` hops from the light's first cell: of a row along x, the cell on one side or the other.
// Negative where there is none.
int3 in_shell(const Bound *bound, uint4 first, uint step, uint n) {
    int y = (int)(n / 2u % bound->params->cells.y);
    int z = (int)(n / 2u / bound->params->cells.y);
    int left = (int)step - (int)abs(y - (int)first.y) - (int)abs(z - (int)first.z);
    // Where no hop is left, both sides are one cell.
    if (left < 0 || (left == 0 && n % 2u == 1u)) {
        return (int3)(-1);
    }
    return (int3)((int)first.x + (n % 2u == 1u ? -left : left), y, z);
}

// Mean density along the way within the box.
float mean(const Bound *bound, __global const LightFace *face, uint light, int3 at) {
    float4 place = bound->lights[light].place;
    float3 size = convert_float3(bound->params->dims.xyz);
    float3 side = bound->params->cell.xyz;
    float longest_step = bound->params->cell.w;
    bool has_place = place.w == 1.0f;
    float3 u = place.xyz;
    if (has_place) {
        u = place.xyz - convert_float3(at);
    }
    float3 origin = (convert_float3(at) + 0.5f) * side - 0.5f;
    // At a light a way so short that nothing changes along it, and so long that its column is a normal number: devices
    // may take others for 0.
    float far = max(metres(bound, u), 1e-30f);
    float3 toward = u * side / far;
    Ray way = through(origin, toward, size, has_place ? far : FAR, longest_step);
    float extent = way.step * way.steps;
    if (face->near == 1u) {
        if (way.steps > 0.0f) {
            return column(bound, &way, (uint4)(0u), true) / max(extent, 1e-30f);
        }
        return sample_density(bound, origin, convert_int3(bound->params->dims.xyz), 0);
    }
    float longest = fabs(face->axis == 0u ? u.x : face->axis == 1u ? u.y : u.z);
    Ray piece = through(origin, toward, size, far / longest, longest_step);
    float rest = extent - piece.step * piece.steps;
    float beyond = 0.0f;
    if (rest > 0.0f) {
        beyond = interpolated(bound, light, at, u, longest, face->axis);
    }
    return (column(bound, &piece, (uint4)(0u), true) + beyond * rest) / extent;
}

// Mean density where the way meets the next plane of centres along `axis`.
float interpolated(const Bound *bound, uint light, int3 at, float3 u, float longest, uint axis) {
    bool far = bound->lights[light].place.w == 0.0f;
    int3 hop = (int3)(u.x < 0.0f ? -1 : 1, u.y < 0.0f ? -1 : 1, u.z < 0.0f ? -1 : 1);
    int3 cells = convert_int3(bound->params->cells.xyz);
    float4 along_x = nodes(at.x, cells.x, u.x, longest, far);
    float4 along_y = nodes(at.y, cells.y, u.y, longest, far);
    float4 along_z = nodes(at.z, cells.z, u.z, longest, far);
    float4 along_b = axis == 0u ? along_y : along_x;
    float4 along_c = axis == 2u ? along_y : along_z;
    float weights_b[4] = {along_b.x, along_b.y, along_b.z, along_b.w};
    float weights_c[4] = {along_c.x, along_c.y, along_c.z, along_c.w};
    float sum = 0.0f;
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < 4; i++) {
            float weight = weights_b[i] * weights_c[j];
            int3 way = axis == 0u ? (int3)(1, i - 1, j - 1) : axis == 1u ? (int3)(i - 1, 1, j - 1) : (int3)(i - 1, j - 1, 1);
            int3 cell = at + hop * way;
            // Cells without weight may not be known yet.
            if (weight != 0.0f && inside(bound, cell)) {
                sum += weight * bound->light_depth[index(bound, cell, light)];
            }
        }
    }
    return max(sum, 0.0f);
}

// Weights of the cells at -1, 0, 1 and 2 hops toward the light from cell `x` of `cells` along an axis.
float4 nodes(int x, int cells, float u, float longest, bool far) {
    int hop = u < 0.0f ? -1 : 1;
    if (!within(x + hop, cells)) {
        return (float4)(0.0f, 1.0f, 0.0f, 0.0f);
    }
    float way = fabs(u);
    // A division may be off by more than rounding, and at 1 the cell itself must have no weight.
    float f = way >= longest ? 1.0f : way / longest;
    float g = 1.0f - f;
    bool before = within(x - hop, cells) && (far || way + 1.0f < longest);
    bool after = within(x + 2 * hop, cells) && (far || fabs(way - 2.0f) < longest);
    if (before && after) {
        return (float4)(
            -f * g * (1.0f + g) / 6.0f,
            (1.0f + f) * g * (1.0f + g) / 2.0f,
            (1.0f + f) * f * (1.0f + g) / 2.0f,
            -f * g * (1.0f + f) / 6.0f
        );
    }
    if (after) {
        return (float4)(0.0f, g * (1.0f + g) / 2.0f, f * (1.0f + g), -f * g / 2.0f);
    }
    if (before) {
        return (float4)(-f * g / 2.0f, g * (1.0f + f), f * (1.0f + f) / 2.0f, 0.0f);
    }
    return (float4)(0.0f, g, f, 0.0f);
}

// Column gathered from the neighbours toward the light.
float gathered(const Bound *bound, uint light, int3 at) {
    float4 place = bound->lights[light].place;
    float3 u = place.xyz;
    if (place.w == 1.0f) {
        u = place.xyz - convert_float3(at);
    }
    float local_mean = bound->occupancy[index(bound, at, 0u) / (4u * bound->params->cells.w)].x;
    float x = metres(bound, (float3)(1.0f, 0.0f, 0.0f));
    float y = metres(bound, (float3)(0.0f, 1.0f, 0.0f));
    float z = metres(bound, (float3)(0.0f, 0.0f, 1.0f));
    bool published = bound->params->scheme == SCHEME_PUBLISHED;
    float3 way = fabs(u);
    float hops = way.x + way.y + way.z;
    if (hops == 0.0f) {
        return published ? local_mean * (x + y + z) / 3.0f : 0.0f;
    }
    float extent = published ? way.x * x + way.y * y + way.z * z : metres(bound, u);
    float sum = 0.0f;
    for (int a = 0; a < 3; a++) {
        float share = a == 0 ? u.x : a == 1 ? u.y : u.z;
        int hop = share < 0.0f ? -1 : 1;
        int3 next = at + (int3)(a == 0 ? hop : 0, a == 1 ? hop : 0, a == 2 ? hop : 0);
        if (share != 0.0f && inside(bound, next)) {
            sum += fabs(share) * bound->light_depth[index(bound, next, light)];
        }
    }
    return (local_mean * extent + sum) / hops;
}

// Whether cell `x` is one of `cells` along an axis.
bool within(int x, int cells) {
    return x >= 0 && x < cells;
}

// Whether a cell lies in the grid.
bool inside(const Bound *bound, int3 at) {
    int3 cells = convert_int3(bound->params->cells.xyz);
    return within(at.x, cells.x) && within(at.y, cells.y) && within(at.z, cells.z);
}

// Where a cell's value for a light lies in the output.
uint index(const Bound *bound, int3 at, uint light) {
    uint4 cells = bound->params->cells;
    return (((uint)at.z * cells.y + (uint)at.y) * cells.x + (uint)at.x) * 4u * cells.w + light;
}

// Metres of a way in cell units.
float metres(const Bound *bound, float3 u) {
    float3 v = u * bound->params->cell.xyz;
    float3 x = bound->params->world_x.xyz;
    float3 y = bound->params->world_y.xyz;
    float3 z = bound->params->world_z.xyz;
    float3 w = (float3)(dot(x, v), dot(y, v), dot(z, v));
    return sqrt(dot(w, w));
}
