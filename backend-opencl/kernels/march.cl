// `march`: view rays through the medium. One work-item a pixel; those of a block of BLOCK x BLOCK pixels are in a row.

// One view ray.
typedef struct {
    float3 direction;
    Ray ray;
    float3 radiance;
    float3 transmittance;
    // Light stopped so far, and the same weighed with its distance.
    float stopped;
    float stopped_at;
} Path;

// What the medium does to light at a point, per channel: extinction and scattering in 1/m, emission in W m^-3 sr^-1.
typedef struct {
    float3 extinction;
    float3 scattering;
    float3 emission;
} Optics;

bool rim(const Bound *bound, uint x, uint y);
float jitter(const Bound *bound, uint x, uint y, uint s);
Path enter(const Bound *bound, float3 direction, float limit, float place);
void resume(const Bound *bound, Path *path, size_t pixel);
void keep(const Bound *bound, const Path *path, size_t pixel);
void walk(const Bound *bound, Path *path);
uint4 blocks(const Bound *bound);
float3 gathered(const Bound *bound, float3 at, const float *basis);
float3 in_scatter_at(const Bound *bound, float3 place, uint layer);
float3 scattered_light(const Bound *bound, float3 at, const float *basis);
float3 direct(const Bound *bound, float3 at, float3 direction, float t);
float visibility(const Bound *bound, uint i, const Incident *light, float3 d, float t);
float mapped(const Bound *bound, const LightRecord *record, const Incident *light, float3 at);
float4 light_depths(const Bound *bound, float3 at, uint layer);
Optics optics(const Bound *bound, float3 at, int3 size);

float phase_value(const Bound *bound, uint i) {
    return bound->tables[bound->params->phase_at + i];
}

uint phase_size(const Bound *bound) {
    return bound->params->phase_size;
}

float harmonics_value(const Bound *bound, uint i) {
    return bound->tables[bound->params->harmonics_at + i];
}

void run_march(const Bound *bound) {
    size_t n = number() / (BLOCK * BLOCK);
    uint lane = (uint)(number() % (BLOCK * BLOCK));
    if (n >= bound->launch->count) {
        return;
    }
    uint block = bound->launch->start + (uint)n;
    uint width = bound->params->width;
    uint height = bound->params->height;
    uint across = (width + BLOCK - 1u) / BLOCK;
    uint x = block % across * BLOCK + lane % BLOCK;
    uint y = block / across * BLOCK + lane / BLOCK;
    if (x >= width || y >= height) {
        return;
    }
    size_t pixel = (size_t)y * width + x;
    if (bound->params->alone == ALONE_RIMS && !rim(bound, x, y)) {
        bound->film[2u * pixel] = (float4)(0.0f, 0.0f, 0.0f, UNMARCHED);
        bound->film[2u * pixel + 1u] = (float4)(1.0f, 1.0f, 1.0f, INFINITY);
        return;
    }
    // The same pixel of the full picture.
    uint scale = bound->params->scale;
    uint full_width = bound->params->full_width;
    uint full_height = bound->params->full_height;
    uint fx = min(x * scale + scale / 2u, full_width - 1u);
    uint fy = min(y * scale + scale / 2u, full_height - 1u);
    size_t full = (size_t)fy * full_width + fx;
    float3 color = (float3)(0.0f);
    float3 transmitted = (float3)(0.0f);
    float stopped = 0.0f;
    float stopped_at = 0.0f;
    if (bound->params->sample_begin > 0u) {
        // The sums of the passes before.
        float4 sums = bound->film[2u * pixel];
        float4 more = bound->film[2u * pixel + 1u];
        color = sums.xyz;
        stopped = sums.w;
        transmitted = more.xyz;
        stopped_at = more.w;
    }
    bool ends = bound->params->step_end == ALL_STEPS;
    for (uint s = bound->params->sample_begin; s < bound->params->sample_end; s++) {
        float a = (convert_float(fx) + bound->tables[2u * s]) * (2.0f / convert_float(full_width)) - 1.0f;
        float b = 1.0f - (convert_float(fy) + bound->tables[2u * s + 1u]) * (2.0f / convert_float(full_height));
        float3 toward = a * bound->params->right.xyz + b * bound->params->up.xyz + bound->params->forward.xyz;
        float3 direction = toward / sqrt(dot(toward, toward));
        float4 seen = (float4)(0.0f, 0.0f, 0.0f, FAR);
        if (has_surface) {
            uint each = bound->params->surface_samples;
            seen = bound->surface[full * each + s % each];
        }
        float limit = fmin(seen.w, FAR);
        Path path = enter(bound, direction, limit, jitter(bound, x, y, s));
        if (has_paths && bound->params->step_begin > 0u) {
            resume(bound, &path, pixel);
        }
        walk(bound, &path);
        if (has_paths && !ends) {
            keep(bound, &path, pixel);
            return;
        }
        float3 behind = (float3)(0.0f);
        if (bound->params->alone != ALONE_NO) {
            behind = (float3)(0.0f);
        } else if (limit < FAR) {
            behind = seen.xyz;
        } else if (has_environment) {
            behind = sky(bound, direction);
        }
        color += path.radiance + path.transmittance * behind;
        transmitted += path.transmittance;
        stopped += path.stopped;
        stopped_at += path.stopped_at;
    }
    if (bound->params->sample_end < bound->params->samples) {
        bound->film[2u * pixel] = (float4)(color, stopped);
        bound->film[2u * pixel + 1u] = (float4)(transmitted, stopped_at);
        return;
    }
    float share = 1.0f / convert_float(bound->params->samples);
    float mean = (transmitted.x + transmitted.y + transmitted.z) * (share / 3.0f);
    float depth = stopped > 0.0f ? stopped_at / stopped : INFINITY;
    float last = 1.0f - mean;
    if (bound->params->alone != ALONE_NO) {
        last = FAR;
        if (has_surface) {
            last = fmin(bound->surface[full * bound->params->surface_samples].w, FAR);
        }
    }
    bound->film[2u * pixel] = (float4)(color * share, last);
    bound->film[2u * pixel + 1u] = (float4)(transmitted * share, depth);
}

// Whether a rim is near a pixel: of the surfaces of five by five pixels around, the nearest and the farthest.
bool rim(const Bound *bound, uint x, uint y) {
    uint scale = bound->params->scale;
    uint full_width = bound->params->full_width;
    float nearest = FAR;
    float farthest = 0.0f;
    for (uint i = 0u; i < 25u; i++) {
        uint column = min(max(x + i % 5u, 2u) - 2u, bound->params->width - 1u);
        uint row = min(max(y + i / 5u, 2u) - 2u, bound->params->height - 1u);
        uint fx = min(column * scale + scale / 2u, full_width - 1u);
        uint fy = min(row * scale + scale / 2u, bound->params->full_height - 1u);
        float distance = FAR;
        if (has_surface) {
            distance = fmin(bound->surface[(size_t)fy * full_width + fx].w, FAR);
        }
        nearest = fmin(nearest, distance);
        farthest = fmax(farthest, distance);
    }
    return nearest < MARCH_RIM * farthest;
}

// Where the samples of a sub-pixel position of a pixel lie within their steps.
float jitter(const Bound *bound, uint x, uint y, uint s) {
    if (bound->params->jittered == 0u) {
        return 0.5f;
    }
    uint at = bound->params->jitter_at;
    uint pixel = y % JITTER_SIDE * JITTER_SIDE + x % JITTER_SIDE;
    float place = bound->tables[at + bound->params->samples + pixel] + bound->tables[at + s] + bound->params->jitter_offset;
    return place - floor(place);
}

// The path along `direction` before its first step.
Path enter(const Bound *bound, float3 direction, float limit, float place) {
    float3 index = to_index(bound, direction);
    Path path;
    path.direction = direction;
    path.ray = through(bound->params->eye.xyz, index, convert_float3(bound->params->dims.xyz), limit, bound->params->step);
    if (bound->params->steps > 0u) {
        path.ray = in_steps(path.ray, convert_float(bound->params->steps));
    }
    path.ray.place = place;
    path.radiance = (float3)(0.0f);
    path.transmittance = (float3)(1.0f);
    path.stopped = 0.0f;
    path.stopped_at = 0.0f;
    return path;
}

// The path as an earlier pass left it.
void resume(const Bound *bound, Path *path, size_t pixel) {
    float4 light = bound->paths[2u * pixel];
    float4 through = bound->paths[2u * pixel + 1u];
    path->radiance = light.xyz;
    path->stopped = light.w;
    path->transmittance = through.xyz;
    path->stopped_at = through.w;
}

// Leaves the path to the next pass.
void keep(const Bound *bound, const Path *path, size_t pixel) {
    bound->paths[2u * pixel] = (float4)(path->radiance, path->stopped);
    bound->paths[2u * pixel + 1u] = (float4)(path->transmittance, path->stopped_at);
}

// The steps of this pass.
void walk(const Bound *bound, Path *path) {
    int3 size = convert_int3(bound->params->dims.xyz);
    float3 direction = path->direction;
    const Ray ray = path->ray;
    // Y_k of the direction, where the in-scatter has layers.
    float basis[HARMONICS_MAX];
    if (max(bound->params->cells.w, bound->params->scattered_cells.w) > 1u) {
        harmonics(bound, direction, bound->params->bands, basis);
    }
    float3 albedo = bound->params->albedo.xyz;
    float3 sigma = bound->params->extinction.xyz;
    bool scatters = albedo.x + albedo.y + albedo.z > 0.0f;
    bool grey = sigma.x == sigma.y && sigma.x == sigma.z;
    uint4 grid = blocks(bound);
    float last = fmin(ray.steps, convert_float(bound->params->step_end));
    float k = convert_float(bound->params->step_begin);
    while (k < last) {
        float3 transmittance = path->transmittance;
        if (max(max(transmittance.x, transmittance.y), transmittance.z) < bound->params->cut) {
            break;
        }
        float t = middle(&ray, k);
        if (has_occupancy) {
            float next = skip(bound, &ray, t, k, grid);
            if (next >= 0.0f) {
                k = next;
                continue;
            }
        }
        float3 at = along(&ray, t);
        Optics here = optics(bound, at, size);
        float3 extinction = here.extinction;
        float3 light = (float3)(0.0f);
        if (scatters && max(max(here.scattering.x, here.scattering.y), here.scattering.z) > 0.0f) {
            light = gathered(bound, at, basis) + scattered_light(bound, at, basis) + direct(bound, at, direction, t);
        }
        // Grey extinction takes one exponential.
        float2 red = segment(extinction.x * ray.step);
        float2 green = grey ? red : segment(extinction.y * ray.step);
        float2 blue = grey ? red : segment(extinction.z * ray.step);
        float3 mean = (float3)(red.y, green.y, blue.y);
        float3 sent = here.scattering * light + here.emission;
        path->radiance += transmittance * ray.step * mean * sent;
        float3 stopped = transmittance * (extinction * ray.step * mean);
        path->transmittance = transmittance * (float3)(red.x, green.x, blue.x);
        float share = stopped.x + stopped.y + stopped.z;
        path->stopped += share;
        path->stopped_at += share * t;
        k += 1.0f;
    }
}

// Blocks of the occupancy along x, y, z and their side; side 0 where there is none.
uint4 blocks(const Bound *bound) {
    if (has_occupancy) {
        return bound->params->occupancy_cells;
    }
    return (uint4)(0u);
}

// J from the field of in-scattered radiance.
float3 gathered(const Bound *bound, float3 at, const float *basis) {
    if (!has_in_scatter) {
        return (float3)(0.0f);
    }
    float3 place = (at + 0.5f) * bound->params->cells_per_voxel.xyz - 0.5f;
    if (bound->params->cells.w == 1u) {
        return in_scatter_at(bound, place, 0u);
    }
    float3 sum = (float3)(0.0f);
    for (uint k = 0u; k < bound->params->cells.w; k++) {
        sum += basis[k] * in_scatter_at(bound, place, k);
    }
    return sum;
}

float3 in_scatter_at(const Bound *bound, float3 place, uint layer) {
    int3 size = convert_int3(bound->params->cells.xyz);
    if (bound->params->trilinear == 1u) {
        return sample_in_scatter(bound, place, size, (int)layer).xyz;
    }
    return nearest_in_scatter(bound, place, size, (int)layer).xyz;
}

// J of light that was scattered before.
float3 scattered_light(const Bound *bound, float3 at, const float *basis) {
    if (!has_scattered) {
        return (float3)(0.0f);
    }
    int3 size = convert_int3(bound->params->scattered_cells.xyz);
    float3 place = (at + 0.5f) * bound->params->scattered_cells_per_voxel.xyz - 0.5f;
    uint layers = bound->params->scattered_cells.w;
    if (layers == 1u) {
        return sample_scattered(bound, place, size, 0).xyz;
    }
    float3 sum = (float3)(0.0f);
    for (uint k = 0u; k < layers; k++) {
        sum += basis[k] * sample_scattered(bound, place, size, (int)k).xyz;
    }
    return sum;
}

// J from each light.
float3 direct(const Bound *bound, float3 at, float3 direction, float t) {
    float3 sum = (float3)(0.0f);
    float4 depths = (float4)(0.0f);
    bool surface = bound->params->phong.w > 0.0f;
    float3 away = surface ? normal(bound, at) : (float3)(0.0f);
    for (uint i = 0u; i < bound->params->lights; i++) {
        if (i % 4u == 0u) {
            depths = light_depths(bound, at, i / 4u);
        } else {
            // The next light's comes first.
            depths = depths.yzwx;
        }
        Incident light = incident(bound, i, direction, t);
        if (light.falloff <= 0.0f) {
            continue;
        }
        float seen = visibility(bound, i, &light, direction, t);
        if (seen <= 0.0f) {
            continue;
        }
        float scatters = 0.0f;
        if (surface) {
            scatters = phong(bound, away, light.toward, direction);
        } else {
            scatters = phase(bound, dot(light.toward, direction));
        }
        float scale = scatters * light.falloff * seen;
        float optical = depths.x;
        uint shadow = bound->params->shadow;
        if (shadow == SHADOW_MARCH || shadow == SHADOW_MEAN) {
            float3 size = convert_float3(bound->params->dims.xyz);
            Ray ray = through(at, to_index(bound, light.toward), size, light.distance, bound->params->step);
            optical = shadow == SHADOW_MARCH ? column(bound, &ray, blocks(bound)) : optical * (ray.step * ray.steps);
        }
        float3 transmittance = exp(-optical * bound->params->light_extinction.xyz);
        sum += scale * transmittance * bound->lights[i].power.xyz;
    }
    return sum;
}

// How much of light `i` passes by the surfaces, `t` metres along the view ray.
float visibility(const Bound *bound, uint i, const Incident *light, float3 d, float t) {
    float extent = bound->params->mesh_eye.w;
    float3 at = bound->params->mesh_eye.xyz + t * d;
    if (has_mesh && bound->params->surface_shadow == SURFACE_SHADOW_RAY) {
        Line way = line(at, light->toward);
        return blocked(bound, &way, light->distance - MESH_MARGIN * extent) ? 0.0f : 1.0f;
    }
    if (has_shadow_map && bound->params->surface_shadow == SURFACE_SHADOW_MAP) {
        LightRecord record = bound->lights[i];
        return mapped(bound, &record, light, at);
    }
    return 1.0f;
}

// The same by the light's map, at a point from the mesh's origin: four comparisons, interpolated.
float mapped(const Bound *bound, const LightRecord *record, const Incident *light, float3 at) {
    float3 v = at;
    uint n = 0u;
    if (record->position.w != 0.0f) {
        v = -light->distance * light->toward;
        if (record->cone.w == 0.0f) {
            n = side_of(v);
        }
    }
    float extent = bound->params->mesh_eye.w;
    Face of = face(record, n, extent);
    float depth = dot(v, of.forward);
    float2 place = (float2)(dot(v, of.right), dot(v, of.up)) / of.half_width;
    if (record->position.w != 0.0f) {
        place /= max(depth, 1e-30f);
    } else {
        depth += extent;
        if (max(fabs(place.x), fabs(place.y)) > 1.0f) {
            return 1.0f;
        }
    }
    uint side = bound->params->map_side;
    float2 p = (place * 0.5f + 0.5f) * convert_float(side) - 0.5f;
    p = fmin(fmax(p, (float2)(0.0f)), (float2)(convert_float(side) - 1.0f));
    uint2 low = convert_uint2(p);
    float2 f = p - convert_float2(low);
    uint first = (convert_uint(record->power.w) + n) * side;
    float sum = 0.0f;
    for (uint k = 0u; k < 4u; k++) {
        uint2 high = (uint2)(k & 1u, k >> 1u);
        float across = high.x == 1u ? f.x : 1.0f - f.x;
        float down = high.y == 1u ? f.y : 1.0f - f.y;
        uint2 texel = min(low + high, (uint2)(side - 1u));
        float held = bound->shadow_map[(size_t)(first + texel.y) * side + texel.x];
        sum += depth <= held ? across * down : 0.0f;
    }
    return sum;
}

// The field toward four lights; zero without one.
float4 light_depths(const Bound *bound, float3 at, uint layer) {
    if (!has_light_depth || bound->params->shadow < SHADOW_COLUMN) {
        return (float4)(0.0f);
    }
    float3 place = (at + 0.5f) * bound->params->light_cells_per_voxel.xyz - 0.5f;
    return sample_light_depth(bound, place, convert_int3(bound->params->light_cells.xyz), (int)layer);
}

// The optics at `at` in index space.
Optics optics(const Bound *bound, float3 at, int3 size) {
    float density = sample_density(bound, at, size, 0);
    float3 scatters = (float3)(density);
    if (has_scattering) {
        scatters = sample_scattering(bound, at, size, 0).xyz;
    }
    float3 source = (float3)(density);
    if (has_emission_color) {
        source = sample_emission_color(bound, at, size, 0).xyz;
    } else if (has_emission_density) {
        source = (float3)(sample_emission_density(bound, at, size, 0));
    }
    Optics here;
    here.extinction = density * bound->params->extinction.xyz;
    here.scattering = scatters * bound->params->extinction.xyz * bound->params->albedo.xyz;
    here.emission = source * bound->params->emission.xyz;
    return here;
}
