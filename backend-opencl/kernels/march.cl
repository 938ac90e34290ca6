// `march`: view rays through the medium. One work-item a packet of pixels, ACROSS by DOWN; those of a block of BLOCK x BLOCK
// pixels are in a row.

#define ACROSS (WIDTH == 1 ? 1u : 4u)
#define DOWN (WIDTH / ACROSS)

// One view ray of each lane.
typedef struct {
    F3 direction;
    Ray ray;
    F3 radiance;
    F3 transmittance;
    // Light stopped so far, of all channels or of the one that serves all, and the same weighed with the number of its step.
    F stopped;
    F stopped_in;
} Path;

// What the medium does to light at a point, per channel: extinction and scattering in 1/m, emission in W m^-3 sr^-1.
typedef struct {
    F3 extinction;
    F3 scattering;
    F3 emission;
} Optics;

M rim(const Bound *bound, U x, U y);
F jitter(const Bound *bound, U x, U y, uint s);
Path enter(const Bound *bound, F3 direction, F limit, F place);
void resume(const Bound *bound, Path *path, U pixel);
void keep(const Bound *bound, const Path *path, U pixel, M kept);
void walk(const Bound *bound, Path *path);
uint4 blocks(const Bound *bound);
F3 gathered(const Bound *bound, F3 at, const F *basis, M dense);
F3 in_scatter_at(const Bound *bound, F3 place, const F *basis, M dense);
F3 scattered_light(const Bound *bound, F3 at, const F *basis, M dense);
F3 direct(const Bound *bound, F3 at, F3 direction, F t, M dense);
F visibility(const Bound *bound, uint i, const Incident *light, F3 d, F t, M lit);
F mapped(const Bound *bound, const LightRecord *record, const Incident *light, F3 at);
void light_depths(const Bound *bound, F3 at, uint layer, M dense, F *depths);
INLINE Optics optics(const Bound *bound, F3 at, int3 size, M active);

// Columns or rows of the full picture.
U full(U n, uint scale, uint size) {
    U at = n * scale + scale / 2u;
    return at < size ? at : (U)(size - 1u);
}

// Three values of each lane, `pitch` floats a pixel, from the `first` on.
F3 load(__global const float4 *from, U pixel, uint pitch, uint first) {
    __global const float *in = (__global const float *)from + first;
    return f3(fetch(in, pitch * pixel), fetch(in, pitch * pixel + 1u), fetch(in, pitch * pixel + 2u));
}

F phase_value(const Bound *bound, I i) {
    return fetch(bound->tables + bound->params->phase_at, i);
}

uint phase_size(const Bound *bound) {
    return bound->params->phase_size;
}

float harmonics_value(const Bound *bound, uint i) {
    return bound->tables[bound->params->harmonics_at + i];
}

void run_march(const Bound *bound) {
    size_t n = number() / (BLOCK * BLOCK);
    uint first = (uint)(number() % (BLOCK * BLOCK)) / WIDTH;
    if (n >= bound->launch->count) {
        return;
    }
    uint block = bound->launch->start + (uint)n;
    uint width = bound->params->width;
    uint height = bound->params->height;
    uint across = (width + BLOCK - 1u) / BLOCK;
    U x = block % across * BLOCK + first % (BLOCK / ACROSS) * ACROSS + LANE % ACROSS;
    U y = block / across * BLOCK + first / (BLOCK / ACROSS) * DOWN + LANE / ACROSS;
    M kept = (x < width) & (y < height);
    if (!any_lane(kept)) {
        return;
    }
    // Lanes past the edge repeat the last pixels, and keep nothing.
    x = x < width ? x : (U)(width - 1u);
    y = y < height ? y : (U)(height - 1u);
    U pixel = y * width + x;
    M marched = kept;
    if (bound->params->alone == ALONE_RIMS) {
        marched &= rim(bound, x, y);
        F3 one = all3((float3)(1.0f));
        put_eight(bound->film, pixel, kept & !marched, all3((float3)(0.0f)), (F)(UNMARCHED), one, (F)(INFINITY));
        if (!any_lane(marched)) {
            return;
        }
    }
    // The same pixels of the full picture.
    uint scale = bound->params->scale;
    uint full_width = bound->params->full_width;
    uint full_height = bound->params->full_height;
    U fx = full(x, scale, full_width);
    U fy = full(y, scale, full_height);
    uint each = bound->params->surface_samples;
    U surface = (fy * full_width + fx) * each;
    F3 color = all3((float3)(0.0f));
    F3 transmitted = all3((float3)(0.0f));
    F stopped = (F)(0.0f);
    F stopped_at = (F)(0.0f);
    if (bound->params->sample_begin > 0u) {
        // The sums of the passes before.
        __global const float *film = (__global const float *)bound->film;
        color = load(bound->film, pixel, 8u, 0u);
        stopped = fetch(film, 8u * pixel + 3u);
        transmitted = load(bound->film, pixel, 8u, 4u);
        stopped_at = fetch(film, 8u * pixel + 7u);
    }
    bool ends = bound->params->step_end == ALL_STEPS;
    for (uint s = bound->params->sample_begin; s < bound->params->sample_end; s++) {
        F a = (to_float(fx) + bound->tables[2u * s]) * (2.0f / convert_float(full_width)) - 1.0f;
        F b = 1.0f - (to_float(fy) + bound->tables[2u * s + 1u]) * (2.0f / convert_float(full_height));
        F3 toward = add3(add3(scale3(all3(bound->params->right.xyz), a), scale3(all3(bound->params->up.xyz), b)),
                         all3(bound->params->forward.xyz));
        F size = sqrt(dot3(toward, toward));
        F3 direction = f3(toward.x / size, toward.y / size, toward.z / size);
        F limit = (F)(FAR);
        if (has_surface) {
            limit = lesser(fetch((__global const float *)bound->surface, 4u * (surface + s % each) + 3u), limit);
        }
        Path path = enter(bound, direction, marched ? limit : (F)(0.0f), jitter(bound, x, y, s));
        if (has_paths && bound->params->step_begin > 0u) {
            resume(bound, &path, pixel);
        }
        walk(bound, &path);
        if (has_paths && !ends) {
            keep(bound, &path, pixel, marched);
            return;
        }
        F3 behind = all3((float3)(0.0f));
        if (bound->params->alone == ALONE_NO) {
            if (has_environment) {
                behind = sky(bound, direction);
            }
            if (has_surface) {
                behind = pick3(limit < FAR, load(bound->surface, surface + s % each, 4u, 0u), behind);
            }
        }
        color = add3(color, add3(path.radiance, mul3(path.transmittance, behind)));
        transmitted = add3(transmitted, path.transmittance);
        stopped += path.stopped;
        stopped_at += path.stopped * middle(&path.ray, 0.0f) + path.stopped_in * path.ray.step;
    }
    if (bound->params->sample_end < bound->params->samples) {
        put_eight(bound->film, pixel, marched, color, stopped, transmitted, stopped_at);
        return;
    }
    float share = 1.0f / convert_float(bound->params->samples);
    F depth = stopped > 0.0f ? stopped_at / stopped : (F)(INFINITY);
    // Exactly nothing where all came through, also where a product and a sum are rounded as one.
    float all = 3.0f * convert_float(bound->params->samples);
    F last = (all - (transmitted.x + transmitted.y + transmitted.z)) * (share / 3.0f);
    if (bound->params->alone != ALONE_NO) {
        last = (F)(FAR);
        if (has_surface) {
            last = lesser(fetch((__global const float *)bound->surface, 4u * surface + 3u), last);
        }
    }
    put_eight(bound->film, pixel, marched, scale3(color, (F)(share)), last, scale3(transmitted, (F)(share)), depth);
}

// Whether a rim is near a pixel: of the surfaces of five by five pixels around, the nearest and the farthest.
M rim(const Bound *bound, U x, U y) {
    uint scale = bound->params->scale;
    uint full_width = bound->params->full_width;
    F nearest = (F)(FAR);
    F farthest = (F)(0.0f);
    for (uint i = 0u; i < 25u; i++) {
        U column = min(max(x + i % 5u, (U)(2u)) - 2u, (U)(bound->params->width - 1u));
        U row = min(max(y + i / 5u, (U)(2u)) - 2u, (U)(bound->params->height - 1u));
        F distance = (F)(FAR);
        if (has_surface) {
            U pixel = full(row, scale, bound->params->full_height) * full_width + full(column, scale, full_width);
            distance = lesser(fetch((__global const float *)bound->surface, 4u * pixel + 3u), distance);
        }
        nearest = lesser(nearest, distance);
        farthest = greater(farthest, distance);
    }
    return nearest < MARCH_RIM * farthest;
}

// Where the samples of a sub-pixel position of a pixel lie within their steps.
F jitter(const Bound *bound, U x, U y, uint s) {
    if (bound->params->jittered == 0u) {
        return (F)(0.5f);
    }
    uint at = bound->params->jitter_at;
    U pixel = y % JITTER_SIDE * JITTER_SIDE + x % JITTER_SIDE;
    F place = fetch(bound->tables + at + bound->params->samples, pixel) + bound->tables[at + s] + bound->params->jitter_offset;
    return place - floored(place);
}

// The paths along `direction` before their first step.
Path enter(const Bound *bound, F3 direction, F limit, F place) {
    F3 index = to_index(bound, direction);
    float3 size = convert_float3(bound->params->dims.xyz);
    Path path;
    path.direction = direction;
    path.ray = through(all3(bound->params->eye.xyz), index, size, limit, bound->params->step);
    if (bound->params->steps > 0u) {
        path.ray = in_steps(path.ray, convert_float(bound->params->steps));
    }
    path.ray.place = place;
    path.radiance = all3((float3)(0.0f));
    path.transmittance = all3((float3)(1.0f));
    path.stopped = (F)(0.0f);
    path.stopped_in = (F)(0.0f);
    return path;
}

// The paths as an earlier pass left them.
void resume(const Bound *bound, Path *path, U pixel) {
    __global const float *paths = (__global const float *)bound->paths;
    path->radiance = load(bound->paths, pixel, 8u, 0u);
    path->stopped = fetch(paths, 8u * pixel + 3u);
    path->transmittance = load(bound->paths, pixel, 8u, 4u);
    path->stopped_in = fetch(paths, 8u * pixel + 7u);
}

// Leaves the paths to the next pass.
void keep(const Bound *bound, const Path *path, U pixel, M kept) {
    put_eight(bound->paths, pixel, kept, path->radiance, path->stopped, path->transmittance, path->stopped_in);
}

// The steps of this pass.
void walk(const Bound *bound, Path *path) {
    int3 size = convert_int3(bound->params->dims.xyz);
    F3 direction = path->direction;
    const Ray ray = path->ray;
    // Y_k of the direction, where the in-scatter has layers.
    F basis[HARMONICS_MAX];
    if (max(bound->params->cells.w, bound->params->scattered_cells.w) > 1u) {
        harmonics(bound, direction, bound->params->bands, basis);
    }
    float3 albedo = bound->params->albedo.xyz;
    float3 sigma = bound->params->extinction.xyz;
    bool scatters = albedo.x + albedo.y + albedo.z > 0.0f;
    bool grey = sigma.x == sigma.y && sigma.x == sigma.z;
    bool shone_on = has_in_scatter || has_scattered || bound->params->lights > 0u;
    bool lit = scatters && shone_on;
    bool emits = any(bound->params->emission.xyz != 0.0f);
    // Whether one channel serves all, and what scatters is a part of what stops.
    bool plain = !has_scattering && grey && !emits;
    uint4 grid = blocks(bound);
    float last = fmin(largest_lane(ray.steps), convert_float(bound->params->step_end));
    float k = convert_float(bound->params->step_begin);
    float ask = 0.0f;
    F3 radiance = path->radiance;
    F3 transmittance = path->transmittance;
    F stopped = path->stopped;
    F stopped_in = path->stopped_in;
    Samples way = samples(&ray, grid);
    while (k < last) {
        F brightest = transmittance.x;
        if (!grey) {
            brightest = greater(greater(brightest, transmittance.y), transmittance.z);
        }
        // What is looked up waits for no transmittance: only what comes of it does.
        M within = k < ray.steps;
        M open = brightest >= bound->params->cut;
        M active = within & open;
        if (!any_lane(active)) {
            break;
        }
        if (has_occupancy && k >= ask) {
            Ahead ahead = skip(bound, &way, k, active);
            if (ahead.empty) {
                k = ahead.until;
                continue;
            }
            ask = ahead.until;
        }
        F3 at = sampled(&way, k);
        Optics here = optics(bound, at, size, within);
        F3 sent = here.emission;
        M dense = open & (greater(greater(here.scattering.x, here.scattering.y), here.scattering.z) > 0.0f);
        if (lit && any_lane(dense)) {
            F3 light = add3(add3(gathered(bound, at, basis, dense), scattered_light(bound, at, basis, dense)),
                            direct(bound, at, direction, middle(&ray, k), dense));
            sent = plain ? mul3(light, all3(albedo)) : add3(mul3(here.scattering, light), here.emission);
        }
        F share;
        if (plain) {
            // What is scattered is a part of what is stopped.
            F2 piece = decay(here.extinction.x * ray.step);
            F stops = open ? transmittance.x * piece.y : (F)(0.0f);
            if (lit) {
                radiance = add3(radiance, scale3(sent, stops));
            }
            transmittance.x = open ? transmittance.x * piece.x : transmittance.x;
            share = stops;
        } else if (grey) {
            // One channel serves all; the others are made from it at the end.
            F2 piece = segment(here.extinction.x * ray.step);
            F reach = open ? transmittance.x * ray.step * piece.y : (F)(0.0f);
            radiance = add3(radiance, scale3(sent, reach));
            transmittance.x = open ? transmittance.x * piece.x : transmittance.x;
            share = here.extinction.x * reach;
        } else {
            F2 red = segment(here.extinction.x * ray.step);
            F2 green = segment(here.extinction.y * ray.step);
            F2 blue = segment(here.extinction.z * ray.step);
            F3 reach = mul3(scale3(transmittance, ray.step), f3(red.y, green.y, blue.y));
            F3 none = all3((float3)(0.0f));
            reach = pick3(open, reach, none);
            radiance = add3(radiance, mul3(reach, sent));
            transmittance = pick3(open, mul3(transmittance, f3(red.x, green.x, blue.x)), transmittance);
            share = dot3(here.extinction, reach);
        }
        stopped += share;
        stopped_in += share * k;
        k += 1.0f;
    }
    if (grey) {
        transmittance = f3(transmittance.x, transmittance.x, transmittance.x);
    }
    path->radiance = radiance;
    path->transmittance = transmittance;
    path->stopped = stopped;
    path->stopped_in = stopped_in;
}

// Blocks of the occupancy along x, y, z and their side; side 0 where there is none.
uint4 blocks(const Bound *bound) {
    if (has_occupancy) {
        return bound->params->occupancy_cells;
    }
    return (uint4)(0u);
}

// Places among the cells of a field, of which a voxel is so many.
INLINE F3 cells_at(F3 at, float3 per_voxel) {
    return f3((at.x + 0.5f) * per_voxel.x - 0.5f, (at.y + 0.5f) * per_voxel.y - 0.5f, (at.z + 0.5f) * per_voxel.z - 0.5f);
}

// J from the field of in-scattered radiance.
F3 gathered(const Bound *bound, F3 at, const F *basis, M dense) {
    F3 place = cells_at(at, bound->params->cells_per_voxel.xyz);
    return in_scatter_at(bound, place, basis, dense);
}

F3 in_scatter_at(const Bound *bound, F3 place, const F *basis, M dense) {
    F sums[4] = {(F)(0.0f), (F)(0.0f), (F)(0.0f), (F)(0.0f)};
    if (has_in_scatter) {
        int3 size = convert_int3(bound->params->cells.xyz);
        uint layers = bound->params->cells.w;
        bool trilinear = bound->params->trilinear == 1u;
        grouped_in_scatter(bound, place, size, 0u, layers, layers == 1u ? 0 : basis, trilinear, dense, 3u, sums);
    }
    return f3(sums[0], sums[1], sums[2]);
}

// J of light that was scattered before.
F3 scattered_light(const Bound *bound, F3 at, const F *basis, M dense) {
    F sums[4] = {(F)(0.0f), (F)(0.0f), (F)(0.0f), (F)(0.0f)};
    if (has_scattered) {
        F3 place = cells_at(at, bound->params->scattered_cells_per_voxel.xyz);
        int3 size = convert_int3(bound->params->scattered_cells.xyz);
        uint layers = bound->params->scattered_cells.w;
        grouped_scattered(bound, place, size, 0u, layers, layers == 1u ? 0 : basis, true, dense, 3u, sums);
    }
    return f3(sums[0], sums[1], sums[2]);
}

// J from each light.
F3 direct(const Bound *bound, F3 at, F3 direction, F t, M dense) {
    F3 sum = all3((float3)(0.0f));
    F depths[4];
    bool surface = bound->params->phong.w > 0.0f;
    F3 away = all3((float3)(0.0f));
    if (surface) {
        away = normal(bound, at);
    }
    float3 sigma = bound->params->light_extinction.xyz;
    bool grey = sigma.x == sigma.y && sigma.x == sigma.z;
    for (uint i = 0u; i < bound->params->lights; i++) {
        if (i % 4u == 0u) {
            light_depths(bound, at, i / 4u, dense, depths);
        }
        Incident light = incident(bound, i, direction, t);
        M lit = dense & (light.falloff > 0.0f);
        if (!any_lane(lit)) {
            continue;
        }
        F seen = visibility(bound, i, &light, direction, t, lit);
        lit &= seen > 0.0f;
        if (!any_lane(lit)) {
            continue;
        }
        F scatters;
        if (surface) {
            scatters = phong(bound, away, light.toward, direction);
        } else {
            scatters = phase(bound, dot3(light.toward, direction));
        }
        F scale = lit ? scatters * light.falloff * seen : (F)(0.0f);
        F optical = depths[i % 4u];
        uint shadow = bound->params->shadow;
        float3 size = convert_float3(bound->params->dims.xyz);
        if (shadow == SHADOW_MARCH) {
            Ray ray = through(at, to_index(bound, light.toward), size, light.distance, bound->params->step);
            optical = column(bound, &ray, blocks(bound), lit);
        } else if (shadow == SHADOW_MEAN) {
            optical *= reach(at, to_index(bound, light.toward), size, light.distance);
        }
        F red = exp_negative(-optical * sigma.x);
        F3 transmittance = f3(red, red, red);
        if (!grey) {
            transmittance.y = exp_negative(-optical * sigma.y);
            transmittance.z = exp_negative(-optical * sigma.z);
        }
        sum = add3(sum, mul3(scale3(transmittance, scale), all3(bound->lights[i].power.xyz)));
    }
    return sum;
}

// How much of light `i` passes by the surfaces, `t` metres along the view ray.
F visibility(const Bound *bound, uint i, const Incident *light, F3 d, F t, M lit) {
    float extent = bound->params->mesh_eye.w;
    F3 at = add3(all3(bound->params->mesh_eye.xyz), scale3(d, t));
    if (has_mesh && bound->params->surface_shadow == SURFACE_SHADOW_RAY) {
        Line way = line(at, light->toward);
        return blocked(bound, &way, light->distance - MESH_MARGIN * extent, lit) ? (F)(0.0f) : (F)(1.0f);
    }
    if (has_shadow_map && bound->params->surface_shadow == SURFACE_SHADOW_MAP) {
        LightRecord record = bound->lights[i];
        return mapped(bound, &record, light, at);
    }
    return (F)(1.0f);
}

// The same by the light's map, at points from the mesh's origin: four comparisons, interpolated.
F mapped(const Bound *bound, const LightRecord *record, const Incident *light, F3 at) {
    bool parallel = record->position.w == 0.0f;
    F3 v = at;
    I n = (I)(0);
    if (!parallel) {
        v = scale3(light->toward, -light->distance);
        if (record->cone.w == 0.0f) {
            n = side_of(v);
        }
    }
    float extent = bound->params->mesh_eye.w;
    Face of = face(record, n, extent);
    F depth = dot3(v, of.forward);
    F x = dot3(v, of.right) / of.half_width;
    F y = dot3(v, of.up) / of.half_width;
    M beyond = (fabs(x) > 1.0f) | (fabs(y) > 1.0f);
    if (parallel) {
        depth += extent;
    } else {
        x /= greater(depth, (F)(1e-30f));
        y /= greater(depth, (F)(1e-30f));
    }
    int side = (int)bound->params->map_side;
    F zero = (F)(0.0f);
    F top = (F)(convert_float(side) - 1.0f);
    x = lesser(greater((x * 0.5f + 0.5f) * convert_float(side) - 0.5f, zero), top);
    y = lesser(greater((y * 0.5f + 0.5f) * convert_float(side) - 0.5f, zero), top);
    I column = to_int(x);
    I row = to_int(y);
    F fx = x - to_float(column);
    F fy = y - to_float(row);
    I first = ((int)convert_uint(record->power.w) + n) * side;
    F sum = zero;
    for (int k = 0; k < 4; k++) {
        F across = (k & 1) == 1 ? fx : 1.0f - fx;
        F down = k >> 1 == 1 ? fy : 1.0f - fy;
        I i = min(column + (k & 1), (I)(side - 1));
        I j = min(row + (k >> 1), (I)(side - 1));
        F held = fetch(bound->shadow_map, (first + j) * side + i);
        sum += depth <= held ? across * down : zero;
    }
    return parallel ? (beyond ? (F)(1.0f) : sum) : sum;
}

// The field toward four lights; zero without one.
void light_depths(const Bound *bound, F3 at, uint layer, M dense, F *depths) {
    for (uint n = 0u; n < 4u; n++) {
        depths[n] = (F)(0.0f);
    }
    if (has_light_depth && bound->params->shadow >= SHADOW_COLUMN) {
        F3 place = cells_at(at, bound->params->light_cells_per_voxel.xyz);
        int3 size = convert_int3(bound->params->light_cells.xyz);
        grouped_light_depth(bound, place, size, layer, 1u, 0, true, dense, 4u, depths);
    }
}

// The optics at `at` in index space; lanes that are not active see nothing there.
Optics optics(const Bound *bound, F3 at, int3 size, M active) {
    F density = sample_density(bound, at, size, 0);
    density = active ? density : (F)(0.0f);
    F3 scatters = f3(density, density, density);
    if (has_scattering) {
        scatters = colors_scattering(bound, at, size, active);
    }
    F3 source = f3(density, density, density);
    if (has_emission_color) {
        source = colors_emission_color(bound, at, size, active);
    } else if (has_emission_density) {
        F value = sample_emission_density(bound, at, size, 0);
        value = active ? value : (F)(0.0f);
        source = f3(value, value, value);
    }
    Optics here;
    here.extinction = scale3(all3(bound->params->extinction.xyz), density);
    here.scattering = mul3(scatters, all3(bound->params->extinction.xyz * bound->params->albedo.xyz));
    here.emission = mul3(source, all3(bound->params->emission.xyz));
    return here;
}
