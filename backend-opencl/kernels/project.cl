// `project`: records of directional light at the cells of a coarse grid. One work-item a cell: it marches along one
// direction after the other, and adds each to the cell's record.

void gather(const Bound *bound, float3 origin, float3 direction, float3 *transmittance, float3 *glow);
float3 extinction(const Bound *bound);
void sum_record(const Bound *bound, __global float *record, uint i, float3 transmittance);
void sum_glow(const Bound *bound, __global float *record, uint i, float3 glow);
float3 view_direction(const Bound *bound, float3 at);
float3 emission_along(const Bound *bound, const Ray *ray, float3 *glow);

float phase_value(const Bound *bound, uint i) {
    return bound->phase_table[i];
}

uint phase_size(const Bound *bound) {
    return bound->phase_table_words;
}

void run_project(const Bound *bound) {
    size_t n = number();
    if (n >= bound->launch->count) {
        return;
    }
    uint cell = bound->launch->start + (uint)n;
    uint values = bound->params->coefficients * max(bound->params->channels, bound->params->weight_channels);
    uint glow_values = bound->params->emission_coefficients * 3u;
    __global float *record = bound->records + (size_t)cell * values;
    __global float *emission_record = bound->emission_records + (size_t)cell * glow_values;
    if (bound->params->direction_begin == 0u) {
        for (uint v = 0u; v < values; v++) {
            record[v] = 0.0f;
        }
        for (uint v = 0u; v < glow_values; v++) {
            emission_record[v] = 0.0f;
        }
    }
    if (has_occupancy) {
        if (bound->occupancy[cell].y <= 0.0f) {
            return;
        }
    }
    uint3 cells = bound->params->cells.xyz;
    float3 place = convert_float3((uint3)(cell % cells.x, cell / cells.x % cells.y, cell / cells.x / cells.y));
    float3 side = bound->params->cell.xyz;
    float3 origin = place * side + (0.5f * side - 0.5f);
    for (uint i = bound->params->direction_begin; i < bound->params->direction_end; i++) {
        float3 transmittance;
        float3 glow;
        gather(bound, origin, bound->directions[i].xyz, &transmittance, &glow);
        sum_record(bound, record, i, transmittance);
        if (glow_values > 0u) {
            sum_glow(bound, emission_record, i, glow);
        }
    }
}

// Marches along a direction: transmittance, and light that the medium sends.
void gather(const Bound *bound, float3 origin, float3 direction, float3 *transmittance, float3 *glow) {
    float3 x = bound->params->index_x.xyz;
    float3 y = bound->params->index_y.xyz;
    float3 z = bound->params->index_z.xyz;
    float3 index = (float3)(dot(x, direction), dot(y, direction), dot(z, direction));
    Ray ray = through(origin, index, convert_float3(bound->params->dims.xyz), FAR, bound->params->cell.w);
    *glow = (float3)(0.0f);
    if (bound->params->emission_coefficients > 0u) {
        *transmittance = emission_along(bound, &ray, glow);
    } else {
        *transmittance = exp(-column(bound, &ray, (uint4)(0u)) * extinction(bound));
    }
    if (bound->params->toward_eye == 1u) {
        float p = phase(bound, dot(direction, view_direction(bound, origin)));
        *transmittance *= p;
        *glow *= p;
    }
}

// Extinction of the three channels; where one channel serves, the first counts.
float3 extinction(const Bound *bound) {
    return bound->params->channels == 3u ? bound->params->extinction.xyz : bound->params->extinction.xxx;
}

// Adds direction `i` to every value of the record.
void sum_record(const Bound *bound, __global float *record, uint i, float3 transmittance) {
    uint coefficients = bound->params->coefficients;
    __global const float *weights = bound->weights + (size_t)i * coefficients * bound->params->weight_channels;
    if (bound->params->weight_channels == 3u) {
        for (uint k = 0u; k < coefficients; k++) {
            vstore3(vload3(k, record) + transmittance * vload3(k, weights), k, record);
        }
    } else if (bound->params->channels == 3u) {
        for (uint k = 0u; k < coefficients; k++) {
            vstore3(vload3(k, record) + transmittance * weights[k], k, record);
        }
    } else {
        for (uint k = 0u; k < coefficients; k++) {
            record[k] += transmittance.x * weights[k];
        }
    }
}

// Adds direction `i` to every value of the emission's moments.
void sum_glow(const Bound *bound, __global float *record, uint i, float3 glow) {
    uint coefficients = bound->params->emission_coefficients;
    __global const float *weights = bound->emission_weights + (size_t)i * coefficients;
    for (uint k = 0u; k < coefficients; k++) {
        vstore3(vload3(k, record) + glow * weights[k], k, record);
    }
}

// Unit direction in the world from the eye to a point of index space.
float3 view_direction(const Bound *bound, float3 at) {
    float3 v = at - bound->params->eye.xyz;
    float3 x = bound->params->world_x.xyz;
    float3 y = bound->params->world_y.xyz;
    float3 z = bound->params->world_z.xyz;
    float3 w = (float3)(dot(x, v), dot(y, v), dot(z, v));
    // A cell at the eye has no direction; any will do.
    return w / max(length(w), 1.2e-38f);
}

// Radiance that the medium sends along the ray to its origin, and the ray's transmittance.
float3 emission_along(const Bound *bound, const Ray *ray, float3 *glow) {
    int3 size = convert_int3(bound->params->dims.xyz);
    float3 sigma = extinction(bound);
    float3 transmittance = (float3)(1.0f);
    float3 sent = (float3)(0.0f);
    for (float k = 0.0f; k < ray->steps; k += 1.0f) {
        float3 at = along(ray, middle(ray, k));
        float density = sample_density(bound, at, size, 0);
        float3 source = (float3)(density);
        if (has_emission_color) {
            source = sample_emission_color(bound, at, size, 0).xyz;
        } else if (has_emission_density) {
            source = (float3)(sample_emission_density(bound, at, size, 0));
        }
        float3 tau = density * ray->step * sigma;
        float2 x = segment(tau.x);
        float2 y = segment(tau.y);
        float2 z = segment(tau.z);
        sent += transmittance * ray->step * (float3)(x.y, y.y, z.y) * (source * bound->params->emission.xyz);
        transmittance *= (float3)(x.x, y.x, z.x);
    }
    *glow = sent;
    return transmittance;
}
