// `project`: records of directional light at the cells of a coarse grid. One work-item CHUNK cells: it marches from
// packets of those that are not empty along one direction after the other, and adds each to the cells' records.

// Cells that a work-item takes: enough to fill packets between empty ones.
#define CHUNK (WIDTH == 1 ? 1u : PROJECT_PACKETS * WIDTH)

void project(const Bound *bound, size_t first, const uint *places, uint count);
void gather(const Bound *bound, F3 origin, float3 direction, M lit, F3 *transmittance, F3 *glow);
float3 extinction(const Bound *bound);
void sum_record(const Bound *bound, size_t first, U place, const int *marked, uint i, F3 transmittance);
void sum_glow(const Bound *bound, size_t first, U place, const int *marked, uint i, F3 glow);
F3 view_direction(const Bound *bound, F3 at);
F3 emission_along(const Bound *bound, const Ray *ray, M lit, F3 *glow);

F phase_value(const Bound *bound, I i) {
    return fetch(bound->phase_table, i);
}

uint phase_size(const Bound *bound) {
    return bound->phase_table_words;
}

void run_project(const Bound *bound) {
    size_t n = get_global_id(0) * CHUNK;
    if (n >= bound->launch->count) {
        return;
    }
    size_t first = bound->launch->start + n;
    uint cells = min(CHUNK, bound->launch->count - (uint)n);
    if (bound->params->direction_begin == 0u) {
        size_t values = bound->params->coefficients * max(bound->params->channels, bound->params->weight_channels);
        for (size_t v = 0u; v < cells * values; v++) {
            bound->records[first * values + v] = 0.0f;
        }
        size_t glow_values = bound->params->emission_coefficients * 3u;
        for (size_t v = 0u; v < cells * glow_values; v++) {
            bound->emission_records[first * glow_values + v] = 0.0f;
        }
    }
    uint places[CHUNK];
    uint count = 0u;
    for (uint i = 0u; i < cells; i++) {
        // Means and maxima, in turn.
        if (!has_occupancy || bound->occupancy[first + i].y > 0.0f) {
            places[count++] = i;
        }
    }
    for (uint done = 0u; done < count; done += WIDTH) {
        project(bound, first, places + done, min(count - done, (uint)WIDTH));
    }
}

// A packet of cells, so many places behind the first: adds the directions of this pass to their records.
void project(const Bound *bound, size_t first, const uint *places, uint count) {
    uint at[WIDTH];
    int marked[WIDTH];
    for (uint i = 0u; i < WIDTH; i++) {
        // Lanes past the last repeat it.
        at[i] = places[min(i, count - 1u)];
        marked[i] = i < count;
    }
    U place = pack(at);
    M lit = LANE < count;
    U cell = (uint)first + place;
    uint3 cells = bound->params->cells.xyz;
    float3 side = bound->params->cell.xyz;
    F3 origin = f3(to_float(cell % cells.x) * side.x + (0.5f * side.x - 0.5f),
                   to_float(cell / cells.x % cells.y) * side.y + (0.5f * side.y - 0.5f),
                   to_float(cell / cells.x / cells.y) * side.z + (0.5f * side.z - 0.5f));
    for (uint i = bound->params->direction_begin; i < bound->params->direction_end; i++) {
        F3 transmittance;
        F3 glow;
        gather(bound, origin, bound->directions[i].xyz, lit, &transmittance, &glow);
        sum_record(bound, first, place, marked, i, transmittance);
        if (bound->params->emission_coefficients > 0u) {
            sum_glow(bound, first, place, marked, i, glow);
        }
    }
}

// Marches along a direction: transmittance, and light that the medium sends.
void gather(const Bound *bound, F3 origin, float3 direction, M lit, F3 *transmittance, F3 *glow) {
    float3 x = bound->params->index_x.xyz;
    float3 y = bound->params->index_y.xyz;
    float3 z = bound->params->index_z.xyz;
    F3 index = all3((float3)(dot(x, direction), dot(y, direction), dot(z, direction)));
    float3 size = convert_float3(bound->params->dims.xyz);
    Ray ray = through(origin, index, size, (F)(FAR), bound->params->cell.w);
    *glow = all3((float3)(0.0f));
    if (bound->params->emission_coefficients > 0u) {
        *transmittance = emission_along(bound, &ray, lit, glow);
    } else {
        F optical = column(bound, &ray, (uint4)(0u), lit);
        float3 sigma = extinction(bound);
        F red = exp_negative(-optical * sigma.x);
        bool one = bound->params->channels == 1u;
        *transmittance =
            f3(red, one ? red : exp_negative(-optical * sigma.y), one ? red : exp_negative(-optical * sigma.z));
    }
    if (bound->params->toward_eye == 1u) {
        F p = phase(bound, dot3(all3(direction), view_direction(bound, origin)));
        *transmittance = scale3(*transmittance, p);
        *glow = scale3(*glow, p);
    }
}

// Extinction of the three channels; where one channel serves, the first counts.
float3 extinction(const Bound *bound) {
    return bound->params->channels == 3u ? bound->params->extinction.xyz : bound->params->extinction.xxx;
}

// Adds direction `i` to every value of the records of the lanes that are marked, each at its place behind cell `first`.
void sum_record(const Bound *bound, size_t first, U place, const int *marked, uint i, F3 transmittance) {
    uint coefficients = bound->params->coefficients;
    uint of = bound->params->weight_channels;
    __global const float *weights = bound->weights + (size_t)i * coefficients * of;
    if (max(bound->params->channels, of) == 1u) {
        for (uint k = 0u; k < coefficients; k++) {
            add_to(transmittance.x * weights[k], bound->records + first * coefficients + k, coefficients * place, marked);
        }
        return;
    }
    for (uint k = 0u; k < coefficients; k++) {
        __global float *to = bound->records + 3u * (first * coefficients + k);
        add_to(transmittance.x * weights[k * of], to, 3u * coefficients * place, marked);
        add_to(transmittance.y * weights[k * of + (of - 1u) / 2u], to + 1u, 3u * coefficients * place, marked);
        add_to(transmittance.z * weights[k * of + of - 1u], to + 2u, 3u * coefficients * place, marked);
    }
}

// Adds direction `i` to every value of the emission's moments.
void sum_glow(const Bound *bound, size_t first, U place, const int *marked, uint i, F3 glow) {
    uint coefficients = bound->params->emission_coefficients;
    __global const float *weights = bound->emission_weights + (size_t)i * coefficients;
    for (uint k = 0u; k < coefficients; k++) {
        __global float *to = bound->emission_records + 3u * (first * coefficients + k);
        add_to(glow.x * weights[k], to, 3u * coefficients * place, marked);
        add_to(glow.y * weights[k], to + 1u, 3u * coefficients * place, marked);
        add_to(glow.z * weights[k], to + 2u, 3u * coefficients * place, marked);
    }
}

// Unit directions in the world from the eye to points of index space.
F3 view_direction(const Bound *bound, F3 at) {
    F3 v = sub3(at, all3(bound->params->eye.xyz));
    F3 w = f3(dot3(all3(bound->params->world_x.xyz), v), dot3(all3(bound->params->world_y.xyz), v),
              dot3(all3(bound->params->world_z.xyz), v));
    // A cell at the eye has no direction; any will do.
    F size = greater(sqrt(dot3(w, w)), (F)(1.2e-38f));
    return f3(w.x / size, w.y / size, w.z / size);
}

// Radiance that the medium sends along the rays to their origin, and the rays' transmittance.
F3 emission_along(const Bound *bound, const Ray *ray, M lit, F3 *glow) {
    int3 size = convert_int3(bound->params->dims.xyz);
    float3 sigma = extinction(bound);
    F3 transmittance = all3((float3)(1.0f));
    F3 sent = all3((float3)(0.0f));
    F steps = lit ? ray->steps : (F)(0.0f);
    float last = largest_lane(steps);
    for (float k = 0.0f; k < last; k += 1.0f) {
        M active = k < steps;
        F3 at = along(ray, middle(ray, k));
        F density = sample_density(bound, at, size, 0);
        density = active ? density : (F)(0.0f);
        F3 source = f3(density, density, density);
        if (has_emission_color) {
            source = colors_emission_color(bound, at, size, active);
        } else if (has_emission_density) {
            F value = sample_emission_density(bound, at, size, 0);
            value = active ? value : (F)(0.0f);
            source = f3(value, value, value);
        }
        F tau = density * ray->step;
        F2 x = segment(tau * sigma.x);
        F2 y = segment(tau * sigma.y);
        F2 z = segment(tau * sigma.z);
        F3 reach = mul3(transmittance, scale3(f3(x.y, y.y, z.y), ray->step));
        sent = add3(sent, mul3(reach, mul3(source, all3(bound->params->emission.xyz))));
        transmittance = mul3(transmittance, f3(x.x, y.x, z.x));
    }
    *glow = sent;
    return transmittance;
}
