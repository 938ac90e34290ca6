// `illuminate`: moments of the unscattered light of analytic lights at the cells of a coarse grid. One work-item a cell.

float3 arriving(const Bound *bound, uint i, const Incident *light, float3 at, float3 index);
uint4 blocks(const Bound *bound);

void run_illuminate(const Bound *bound) {
    size_t n = number();
    if (n >= bound->launch->count) {
        return;
    }
    uint cell = bound->launch->start + (uint)n;
    uint3 cells = bound->params->cells.xyz;
    float3 place = convert_float3((uint3)(cell % cells.x, cell / cells.x % cells.y, cell / cells.x / cells.y));
    float3 index = (place + 0.5f) * bound->params->cell.xyz - 0.5f;
    float3 v = index - (convert_float3(bound->params->dims.xyz) - 1.0f) * 0.5f;
    float3 x = bound->params->world_x.xyz;
    float3 y = bound->params->world_y.xyz;
    float3 z = bound->params->world_z.xyz;
    float3 at = (float3)(dot(x, v), dot(y, v), dot(z, v));
    float t = sqrt(dot(at, at));
    float3 d = at / max(t, 1.2e-38f);
    size_t count = (size_t)cells.x * cells.y * cells.z;
    uint channels = bound->params->channels;
    uint values = bound->params->bands * bound->params->bands * channels;
    if (bound->params->light_begin == 0u) {
        for (uint value = 0u; value < values; value++) {
            bound->moments[value * count + cell] = 0.0f;
        }
    }
    float basis[HARMONICS_MAX];
    for (uint i = bound->params->light_begin; i < bound->params->light_end; i++) {
        Incident light = incident(bound, i, d, t);
        float3 power = arriving(bound, i, &light, at, index);
        if (max(power.x, max(power.y, power.z)) <= 0.0f) {
            continue;
        }
        harmonics(bound, light.toward, bound->params->bands, basis);
        float powers[3] = {power.x, power.y, power.z};
        for (uint value = 0u; value < values; value++) {
            bound->moments[value * count + cell] += powers[value % channels] * basis[value / channels];
        }
    }
}

// What a light brings to a place, `at` in metres from the box's centre.
float3 arriving(const Bound *bound, uint i, const Incident *light, float3 at, float3 index) {
    if (light->falloff <= 0.0f) {
        return (float3)(0.0f);
    }
    if (bound->params->visibility == 1u) {
        float margin = MESH_MARGIN * bound->params->mesh_eye.w;
        Line free = line(at + bound->params->mesh_eye.xyz, light->toward);
        if (blocked(bound, &free, light->distance - margin)) {
            return (float3)(0.0f);
        }
    }
    float3 size = convert_float3(bound->params->dims.xyz);
    float longest = bound->params->cell.w;
    Ray way = through(index, to_index(bound, light->toward), size, light->distance, longest);
    float3 transmittance = exp(-column(bound, &way, blocks(bound)) * bound->params->extinction.xyz);
    return light->falloff * bound->lights[i].power.xyz * transmittance;
}

// Blocks of the occupancy along x, y, z and their side; side 0 where there is none.
uint4 blocks(const Bound *bound) {
    return has_occupancy ? bound->params->occupancy_cells : (uint4)(0u);
}

// Constant `i` of the spherical harmonics.
float harmonics_value(const Bound *bound, uint i) {
    return bound->tables[i];
}
