// `propagate`: columns or mean densities from every cell to each light. Of short characteristics a dispatch integrates in the cells of
// some lights, a work-item a packet of them. After that one a dispatch is one step, a work-item a packet of its items; or some steps, of
// which a workgroup of a single work-item takes the items of a light in order. The last one lays out what packets of cells hold.

// Cells, and how many they are; lanes past the last repeat the first.
typedef struct {
    I x;
    I y;
    I z;
    uint count;
} Cells;

// Ways from cells to a light.
typedef struct {
    // In cell units.
    F3 u;
    // Their longest components.
    F longest;
    // Where the light is nearer than one cell.
    M near;
    // Metres of them within the box.
    F extent;
    // What is integrated of them.
    Ray piece;
} Way;

uint integrated(const Bound *bound);
uint items(const Bound *bound, uint light, uint step);
void integrate(const Bound *bound, uint light, uint first);
void finish(const Bound *bound, uint light, uint step, uint first);
void lay_out(const Bound *bound, uint first);
Cells cells_of(const int *x, const int *y, const int *z, uint count);
Cells on_face(const Bound *bound, __global const LightFace *face, uint first);
Cells in_shell(const Bound *bound, uint light, uint step, uint first);
Way way_to(const Bound *bound, uint light, const Cells *cells);
F piece(const Bound *bound, const Way *way);
F mean(const Bound *bound, __global const float *known, uint light, uint axis, const Cells *cells);
INLINE F interpolated(__global const float *known, const Bound *bound, const Way *way, uint axis, bool far, const Cells *cells);
INLINE F4 nodes(I x, I hop, int cells, F u, F longest, bool far);
F gathered(const Bound *bound, __global const float *known, uint light, const Cells *cells);
INLINE M within(I x, int cells);
uint counted(const Bound *bound);
INLINE I index(const Bound *bound, const Cells *cells);
F metres(const Bound *bound, F3 u);

void run_propagate(const Bound *bound) {
    uint n = (uint)(number() / WIDTH);
    uint start = bound->launch->start;
    uint packets = (counted(bound) + WIDTH - 1u) / WIDTH;
    if (start < integrated(bound)) {
        if (n < bound->launch->count) {
            integrate(bound, start + n / packets, n % packets * WIDTH);
        }
        return;
    }
    uint step = start - integrated(bound);
    if (step == bound->params->steps) {
        if (n < packets) {
            lay_out(bound, n * WIDTH);
        }
        return;
    }
    if (bound->launch->count > 0u) {
        uint of_light = (bound->params->items / bound->params->lights + WIDTH - 1u) / WIDTH;
        if (n < bound->launch->count) {
            finish(bound, n / of_light, step, n % of_light * WIDTH);
        }
        return;
    }
    uint light = (uint)get_group_id(0);
    for (uint k = 0u; k < bound->launch->units; k++) {
        uint count = items(bound, light, step + k);
        for (uint first = 0u; first < count; first += WIDTH) {
            finish(bound, light, step + k, first);
        }
    }
}

// Units before the first step.
uint integrated(const Bound *bound) {
    return bound->params->scheme == SCHEME_SHORT_CHARACTERISTICS ? bound->params->lights : 0u;
}

// Items of a step of a light, of which some may be no cells.
uint items(const Bound *bound, uint light, uint step) {
    if (bound->params->scheme == SCHEME_SHORT_CHARACTERISTICS) {
        __global const LightFace *face = bound->faces + (size_t)step * bound->params->lights + light;
        return face->count_0 * face->count_1;
    }
    return bound->params->items / bound->params->lights;
}

// Integrates in cells from the one of a number on.
void integrate(const Bound *bound, uint light, uint first) {
    uint count = min((uint)WIDTH, counted(bound) - first);
    uint across = bound->params->cells.x;
    uint down = bound->params->cells.y;
    int x[WIDTH];
    int y[WIDTH];
    int z[WIDTH];
    for (uint i = 0u; i < count; i++) {
        uint row = (first + i) / across;
        x[i] = (int)(first + i - row * across);
        y[i] = (int)(row % down);
        z[i] = (int)(row / down);
    }
    Cells cells = cells_of(x, y, z, count);
    Way way = way_to(bound, light, &cells);
    put_row(piece(bound, &way), bound->values + (size_t)light * counted(bound) + first, count);
}

// Finishes items of a step of a light.
void finish(const Bound *bound, uint light, uint step, uint first) {
    __global float *known = bound->values + (size_t)light * counted(bound);
    Cells cells;
    F found;
    if (bound->params->scheme == SCHEME_SHORT_CHARACTERISTICS) {
        __global const LightFace *face = bound->faces + (size_t)step * bound->params->lights + light;
        cells = on_face(bound, face, first);
        if (cells.count == 0u) {
            return;
        }
        found = mean(bound, known, light, face->axis, &cells);
    } else {
        cells = in_shell(bound, light, step, first);
        if (cells.count == 0u) {
            return;
        }
        found = gathered(bound, known, light, &cells);
    }
    float values[WIDTH];
    uint places[WIDTH];
    unpack(found, values);
    unpack(as_index(index(bound, &cells)), places);
    for (uint i = 0u; i < cells.count; i++) {
        known[places[i]] = values[i];
    }
}

// Lays out what cells from the one of a number on hold, with zeros beyond the last light.
void lay_out(const Bound *bound, uint first) {
    uint lights = bound->params->lights;
    uint lanes = 4u * bound->params->cells.w;
    uint end = min(first + WIDTH, counted(bound));
    for (uint n = first; n < end; n++) {
        __global float *out = bound->light_depth + (size_t)n * lanes;
        for (uint light = 0u; light < lanes; light++) {
            out[light] = light < lights ? bound->values[(size_t)light * counted(bound) + n] : 0.0f;
        }
    }
}

Cells cells_of(const int *x, const int *y, const int *z, uint count) {
    int all[3][WIDTH];
    for (uint i = 0u; i < WIDTH; i++) {
        uint n = i < count ? i : 0u;
        all[0][i] = x[n];
        all[1][i] = y[n];
        all[2][i] = z[n];
    }
    Cells cells = {pack(all[0]), pack(all[1]), pack(all[2]), count};
    return cells;
}

// Cells of a face from item `first` on.
Cells on_face(const Bound *bound, __global const LightFace *face, uint first) {
    uint across = face->count_0;
    uint all = face->axis == NO_FACE ? 0u : across * face->count_1;
    uint end = min(first + WIDTH, all);
    int plane[WIDTH] = {0};
    int b[WIDTH] = {0};
    int c[WIDTH] = {0};
    uint4 cells = bound->params->cells;
    uint deep = face->axis == 0u ? cells.x : face->axis == 1u ? cells.y : cells.z;
    uint along_b = face->axis == 0u ? cells.y : cells.x;
    uint along_c = face->axis == 2u ? cells.y : cells.z;
    uint count = 0u;
    for (uint n = first; n < end; n++) {
        uint row = n / across;
        uint at_b = face->first_0 + n - row * across;
        uint at_c = face->first_1 + row;
        if (face->plane < deep && at_b < along_b && at_c < along_c) {
            plane[count] = (int)face->plane;
            b[count] = (int)at_b;
            c[count] = (int)at_c;
            count++;
        }
    }
    if (face->axis == 0u) {
        return cells_of(plane, b, c, count);
    }
    return face->axis == 1u ? cells_of(b, plane, c, count) : cells_of(b, c, plane, count);
}

// Cells of the shell `step` hops from the light's first cell, of items from `first` on: of a row along x, the cell on one side and the
// one on the other.
Cells in_shell(const Bound *bound, uint light, uint step, uint first) {
    uint4 from = bound->lights[light].first;
    uint4 cells = bound->params->cells;
    uint end = min(first + WIDTH, bound->params->items / bound->params->lights);
    int x[WIDTH] = {0};
    int y[WIDTH] = {0};
    int z[WIDTH] = {0};
    uint count = 0u;
    for (uint n = first; n < end; n++) {
        int down = (int)(n / 2u % cells.y);
        int slice = (int)(n / 2u / cells.y);
        int left = (int)step - (int)abs(down - (int)from.y) - (int)abs(slice - (int)from.z);
        int along = (int)from.x + (n % 2u == 1u ? -left : left);
        // Where no hop is left, both sides are one cell.
        if (left > 0 || (left == 0 && n % 2u == 0u)) {
            if (along >= 0 && along < (int)cells.x) {
                x[count] = along;
                y[count] = down;
                z[count] = slice;
                count++;
            }
        }
    }
    return cells_of(x, y, z, count);
}

Way way_to(const Bound *bound, uint light, const Cells *cells) {
    float4 place = bound->lights[light].place;
    float3 size = convert_float3(bound->params->dims.xyz);
    float3 side = bound->params->cell.xyz;
    float longest_step = bound->params->cell.w;
    bool has_place = place.w == 1.0f;
    F3 at = f3(to_float(cells->x), to_float(cells->y), to_float(cells->z));
    F3 u = all3(place.xyz);
    if (has_place) {
        u = sub3(u, at);
    }
    F3 origin = f3((at.x + 0.5f) * side.x - 0.5f, (at.y + 0.5f) * side.y - 0.5f, (at.z + 0.5f) * side.z - 0.5f);
    // At a light a way so short that nothing changes along it, and so long that its column is a normal number: devices
    // may take others for 0.
    F far = greater(metres(bound, u), (F)(1e-30f));
    F3 toward = f3(u.x * side.x / far, u.y * side.y / far, u.z * side.z / far);
    Ray all = through(origin, toward, size, has_place ? far : (F)(FAR), longest_step);
    Way way;
    way.u = u;
    way.longest = greater(greater(fabs(u.x), fabs(u.y)), fabs(u.z));
    way.near = has_place ? way.longest < 1.0f : way.longest < 0.0f;
    Ray next = through(origin, toward, size, far / way.longest, longest_step);
    way.extent = all.step * all.steps;
    way.piece = all;
    way.piece.step = way.near ? all.step : next.step;
    way.piece.steps = way.near ? all.steps : next.steps;
    return way;
}

// What is integrated of ways: the mean density of all of it, or the column of a piece.
F piece(const Bound *bound, const Way *way) {
    F found = column(bound, &way->piece, (uint4)(0u), way->longest >= 0.0f);
    if (any_lane(way->near)) {
        F here = sample_density(bound, way->piece.origin, convert_int3(bound->params->dims.xyz), 0);
        F whole = way->piece.steps > 0.0f ? found / greater(way->extent, (F)(1e-30f)) : here;
        found = way->near ? whole : found;
    }
    return found;
}

// Mean density along ways within the box, of cells of a face that is normal to `axis`.
F mean(const Bound *bound, __global const float *known, uint light, uint axis, const Cells *cells) {
    Way way = way_to(bound, light, cells);
    F own = fetch(known, index(bound, cells));
    F rest = way.extent - way.piece.step * way.piece.steps;
    F next = interpolated(known, bound, &way, axis, bound->lights[light].place.w == 0.0f, cells);
    F beyond = rest > 0.0f ? next : (F)(0.0f);
    return way.near ? own : (own + beyond * rest) / way.extent;
}

// Mean density where ways meet the next plane of centres along `axis`.
INLINE F interpolated(__global const float *known, const Bound *bound, const Way *way, uint axis, bool far, const Cells *cells) {
    int3 size = convert_int3(bound->params->cells.xyz);
    I one = (I)(1);
    I hop_x = way->u.x < 0.0f ? -one : one;
    I hop_y = way->u.y < 0.0f ? -one : one;
    I hop_z = way->u.z < 0.0f ? -one : one;
    int slice = size.x * size.y;
    // Cells, hops toward the light, cells along the axis and how far they lie apart: along `axis` and along the others.
    I at = axis == 0u ? cells->x : axis == 1u ? cells->y : cells->z;
    I at_b = axis == 0u ? cells->y : cells->x;
    I at_c = axis == 2u ? cells->y : cells->z;
    I hop = axis == 0u ? hop_x : axis == 1u ? hop_y : hop_z;
    I hop_b = axis == 0u ? hop_y : hop_x;
    I hop_c = axis == 2u ? hop_y : hop_z;
    int all = axis == 0u ? size.x : axis == 1u ? size.y : size.z;
    int all_b = axis == 0u ? size.y : size.x;
    int all_c = axis == 2u ? size.y : size.z;
    int pitch = axis == 0u ? 1 : axis == 1u ? size.x : slice;
    I on = hop_b * (axis == 0u ? size.x : 1);
    I up = hop_c * (axis == 2u ? size.x : slice);
    F4 along_b = nodes(at_b, hop_b, all_b, axis == 0u ? way->u.y : way->u.x, way->longest, far);
    F4 along_c = nodes(at_c, hop_c, all_c, axis == 2u ? way->u.y : way->u.z, way->longest, far);
    F weights_b[4] = {along_b.x, along_b.y, along_b.z, along_b.w};
    F weights_c[4] = {along_c.x, along_c.y, along_c.z, along_c.w};
    M onward = within(at + hop, all);
    I next = index(bound, cells) + hop * pitch;
    F sum = (F)(0.0f);
    for (int j = 0; j < 4; j++) {
        M there = onward & within(at_c + hop_c * (j - 1), all_c);
        for (int i = 0; i < 4; i++) {
            F weight = weights_b[i] * weights_c[j];
            // Cells without weight may not be known yet.
            M weighs = (weight != 0.0f) & there & within(at_b + hop_b * (i - 1), all_b);
            F value = fetch(known, weighs ? next + on * (i - 1) + up * (j - 1) : (I)(0));
            sum = weighs ? sum + weight * value : sum;
        }
    }
    return greater(sum, (F)(0.0f));
}

// Weights of the cells at -1, 0, 1 and 2 hops toward the light from cells `x` of `cells` along an axis.
INLINE F4 nodes(I x, I hop, int cells, F u, F longest, bool far) {
    F way = fabs(u);
    // A division may be off by more than rounding, and at 1 the cell itself must have no weight.
    F f = way >= longest ? (F)(1.0f) : way / longest;
    F g = 1.0f - f;
    F zero = (F)(0.0f);
    M here = within(x + hop, cells);
    M before = within(x - hop, cells);
    M after = within(x + 2 * hop, cells);
    if (!far) {
        before &= way + 1.0f < longest;
        after &= fabs(way - 2.0f) < longest;
    }
    F first = after ? -f * g * (1.0f + g) / 6.0f : -f * g / 2.0f;
    F second = after ? (1.0f + f) * g * (1.0f + g) / 2.0f : g * (1.0f + f);
    F third = after ? (1.0f + f) * f * (1.0f + g) / 2.0f : f * (1.0f + f) / 2.0f;
    F second_alone = after ? g * (1.0f + g) / 2.0f : g;
    F third_alone = after ? f * (1.0f + g) : f;
    F fourth = before ? -f * g * (1.0f + f) / 6.0f : -f * g / 2.0f;
    first = here & before ? first : zero;
    second = here ? (before ? second : second_alone) : (F)(1.0f);
    third = here ? (before ? third : third_alone) : zero;
    fourth = here & after ? fourth : zero;
    return f4(f3(first, second, third), fourth);
}

// Columns gathered from the neighbours toward the light.
F gathered(const Bound *bound, __global const float *known, uint light, const Cells *cells) {
    float4 place = bound->lights[light].place;
    int3 size = convert_int3(bound->params->cells.xyz);
    F3 u = all3(place.xyz);
    if (place.w == 1.0f) {
        u = sub3(u, f3(to_float(cells->x), to_float(cells->y), to_float(cells->z)));
    }
    I own = index(bound, cells);
    F local_mean = fetch((__global const float *)bound->occupancy, 2 * own);
    F x = metres(bound, all3((float3)(1.0f, 0.0f, 0.0f)));
    F y = metres(bound, all3((float3)(0.0f, 1.0f, 0.0f)));
    F z = metres(bound, all3((float3)(0.0f, 0.0f, 1.0f)));
    bool published = bound->params->scheme == SCHEME_PUBLISHED;
    F zero = (F)(0.0f);
    F shares[3] = {u.x, u.y, u.z};
    I at[3] = {cells->x, cells->y, cells->z};
    int all[3] = {size.x, size.y, size.z};
    int pitch[3] = {1, size.x, size.x * size.y};
    F hops = fabs(u.x) + fabs(u.y) + fabs(u.z);
    F extent = published ? fabs(u.x) * x + fabs(u.y) * y + fabs(u.z) * z : metres(bound, u);
    F sum = zero;
    for (int a = 0; a < 3; a++) {
        I hop = shares[a] < 0.0f ? (I)(-1) : (I)(1);
        M weighs = (shares[a] != 0.0f) & within(at[a] + hop, all[a]);
        F value = fetch(known, weighs ? own + hop * pitch[a] : (I)(0));
        sum = weighs ? sum + fabs(shares[a]) * value : sum;
    }
    F here = published ? local_mean * (x + y + z) / 3.0f : zero;
    return hops == 0.0f ? here : (local_mean * extent + sum) / hops;
}

// Where cells `x` are among `cells` along an axis.
INLINE M within(I x, int cells) {
    return (x >= 0) & (x < cells);
}

// Cells of the grid.
uint counted(const Bound *bound) {
    return bound->params->cells.x * bound->params->cells.y * bound->params->cells.z;
}

// Numbers of cells.
INLINE I index(const Bound *bound, const Cells *cells) {
    return (cells->z * (int)bound->params->cells.y + cells->y) * (int)bound->params->cells.x + cells->x;
}

// Metres of ways in cell units.
F metres(const Bound *bound, F3 u) {
    float3 side = bound->params->cell.xyz;
    F3 v = f3(u.x * side.x, u.y * side.y, u.z * side.z);
    F3 w = f3(dot3(all3(bound->params->world_x.xyz), v), dot3(all3(bound->params->world_y.xyz), v),
              dot3(all3(bound->params->world_z.xyz), v));
    return sqrt(dot3(w, w));
}
