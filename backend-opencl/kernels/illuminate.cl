// `illuminate`: moments of the unscattered light of analytic lights at the cells of a coarse grid. One work-item a packet of
// cells.

F3 arriving(const Bound *bound, uint i, const Incident *light, F3 at, F3 index);
uint4 blocks(const Bound *bound);

void run_illuminate(const Bound *bound) {
    size_t n = number();
    if (n >= bound->launch->count) {
        return;
    }
    size_t first = bound->launch->start + n;
    U cell = bound->launch->start + elements(n, bound->launch->count);
    uint kept = min((uint)WIDTH, bound->launch->count - (uint)n);
    uint3 cells = bound->params->cells.xyz;
    float3 side = bound->params->cell.xyz;
    F3 index = f3((to_float(cell % cells.x) + 0.5f) * side.x - 0.5f,
                  (to_float(cell / cells.x % cells.y) + 0.5f) * side.y - 0.5f,
                  (to_float(cell / cells.x / cells.y) + 0.5f) * side.z - 0.5f);
    F3 v = sub3(index, all3((convert_float3(bound->params->dims.xyz) - 1.0f) * 0.5f));
    F3 at = f3(dot3(all3(bound->params->world_x.xyz), v), dot3(all3(bound->params->world_y.xyz), v),
               dot3(all3(bound->params->world_z.xyz), v));
    F t = sqrt(dot3(at, at));
    F away = greater(t, (F)(1.2e-38f));
    F3 d = f3(at.x / away, at.y / away, at.z / away);
    size_t count = (size_t)cells.x * cells.y * cells.z;
    uint channels = bound->params->channels;
    uint values = bound->params->bands * bound->params->bands * channels;
    if (bound->params->light_begin == 0u) {
        for (uint value = 0u; value < values; value++) {
            put_row((F)(0.0f), bound->moments + value * count + first, kept);
        }
    }
    F basis[HARMONICS_MAX];
    for (uint i = bound->params->light_begin; i < bound->params->light_end; i++) {
        Incident light = incident(bound, i, d, t);
        F3 power = arriving(bound, i, &light, at, index);
        if (!any_lane(greater(power.x, greater(power.y, power.z)) > 0.0f)) {
            continue;
        }
        harmonics(bound, light.toward, bound->params->bands, basis);
        F powers[3] = {power.x, power.y, power.z};
        for (uint value = 0u; value < values; value++) {
            F sent = powers[value % channels] * basis[value / channels];
            add_row(sent, bound->moments + value * count + first, kept);
        }
    }
}

// What a light brings to places, `at` in metres from the box's centre.
F3 arriving(const Bound *bound, uint i, const Incident *light, F3 at, F3 index) {
    M lit = light->falloff > 0.0f;
    if (bound->params->visibility == 1u && any_lane(lit)) {
        float margin = MESH_MARGIN * bound->params->mesh_eye.w;
        Line free = line(add3(at, all3(bound->params->mesh_eye.xyz)), light->toward);
        lit &= !blocked(bound, &free, light->distance - margin, lit);
    }
    if (!any_lane(lit)) {
        return all3((float3)(0.0f));
    }
    float3 size = convert_float3(bound->params->dims.xyz);
    Ray way = through(index, to_index(bound, light->toward), size, light->distance, bound->params->cell.w);
    F optical = column(bound, &way, blocks(bound), lit);
    float3 sigma = bound->params->extinction.xyz;
    F3 transmittance = f3(exp_negative(-optical * sigma.x), exp_negative(-optical * sigma.y),
                          exp_negative(-optical * sigma.z));
    F3 power = mul3(scale3(all3(bound->lights[i].power.xyz), light->falloff), transmittance);
    return pick3(lit, power, all3((float3)(0.0f)));
}

// Blocks of the occupancy along x, y, z and their side; side 0 where there is none.
uint4 blocks(const Bound *bound) {
    return has_occupancy ? bound->params->occupancy_cells : (uint4)(0u);
}

// Constant `i` of the spherical harmonics.
float harmonics_value(const Bound *bound, uint i) {
    return bound->tables[i];
}
