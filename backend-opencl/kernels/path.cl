// `path`: unbiased paths of light through everything. One work-item a pixel.

// A path on its way, as PathRecord keeps it.
typedef struct {
    uint mode;
    float3 place;
    float3 direction;
    float3 next;
    float density;
    float3 weight;
    float total;
    float3 light;
    float chosen;
    float3 pending;
    float stopped;
    float3 ratio;
    float stopped_at;
    float3 through;
    float surface;
    uint depth;
    uint triangle;
} Way;

float3 placed(const Bound *bound, float3 x);
Walk kept(const Bound *bound, const PathRecord *record);
Way resume(const PathRecord *record);
PathRecord keep(const Way *way, const Walk *on, const Draws *numbers);
Way begin(const Bound *bound, uint pixel, Draws *numbers);
void meet(const Bound *bound, Way *way);
float3 from_mesh(const Bound *bound, float3 place);
float4 behind(const Bound *bound, uint pixel);
float limit(const Bound *bound, const Way *way, uint pixel);
INLINE bool turn(const Bound *bound, uint pixel, Way *way, Walk *on, Draws *numbers);
INLINE float3 extinction(const Bound *bound, float3 at, float rate);
INLINE float3 scattering(const Bound *bound, float3 at, float3 stops, float rate);
INLINE float3 tinted(const Bound *bound, float3 at, float3 scatters, float rate);
INLINE float3 emission(const Bound *bound, float3 at, float rate);
INLINE float3 faint(float3 ratio, Draws *numbers);
INLINE void offer(Way *way, float3 weights, float t, Draws *numbers);
bool arrive(const Bound *bound, uint pixel, Way *way, Draws *numbers);
float3 surroundings(const Bound *bound, float3 d);
float share_of_scattering(const Bound *bound, float3 d, float density);
float sky_density(const Bound *bound, float3 d);
float chance(const Bound *bound, uint item);
float3 toward_sky(const Bound *bound, Draws *numbers);
bool scatter(const Bound *bound, Way *way, Draws *numbers);
bool look(const Bound *bound, Way *way, const Spot *at, Draws *numbers);
void onward(const Bound *bound, Way *way, const Spot *at, float3 origin, Draws *numbers);

F phase_value(const Bound *bound, I i) {
    return bound->tables[bound->params->phase_at + i];
}

uint phase_size(const Bound *bound) {
    return bound->params->phase_size;
}

// The turns of a pixel.
void run_path(const Bound *bound) {
    size_t n = number();
    if (n >= bound->launch->count) {
        return;
    }
    uint pixel = bound->launch->start + (uint)n;
    __global float4 *sums = bound->sums + 3u * (size_t)pixel;
    float4 light = (float4)(0.0f);
    float4 seen = (float4)(0.0f);
    float4 stop = (float4)(0.0f);
    PathRecord record;
    record.place = record.way = record.next = record.weight = (float4)(0.0f);
    record.light = record.pending = record.ratio = record.through = (float4)(0.0f);
    record.cell = record.count = (uint4)(0u);
    if (bound->params->fresh != 1u) {
        light = sums[0];
        seen = sums[1];
        stop = sums[2];
        record = bound->paths[pixel];
    }
    uint frame = bound->params->frame;
    Way way = resume(&record);
    Walk on = kept(bound, &record);
    Draws numbers = draws(pixel, convert_uint(light.w), frame, record.count.y);
    for (uint turns = 0u; turns < bound->params->turns; turns++) {
        bool sets_out = true;
        if (way.mode == PATH_IDLE || way.mode == PATH_DEPART) {
            if (way.mode == PATH_DEPART) {
                way.direction = way.next;
                way.mode = PATH_FLIGHT;
            } else {
                if (light.w >= convert_float(bound->params->samples)) {
                    break;
                }
                numbers = draws(pixel, convert_uint(light.w), frame, 0u);
                way = begin(bound, pixel, &numbers);
            }
            meet(bound, &way);
        } else {
            sets_out = turn(bound, pixel, &way, &on, &numbers) && scatter(bound, &way, &numbers);
        }
        if (sets_out) {
            float3 origin = placed(bound, way.place);
            on = walk(bound, origin, carried(bound, way.direction), limit(bound, &way, pixel));
        }
        if (way.mode == PATH_IDLE) {
            float mean = (way.light.x + way.light.y + way.light.z) * (1.0f / 3.0f);
            light += (float4)(way.light, 1.0f);
            seen += (float4)(way.through, mean * mean);
            stop += (float4)(way.stopped, way.stopped_at, 0.0f, 0.0f);
        }
    }
    sums[0] = light;
    sums[1] = seen;
    sums[2] = stop;
    bound->paths[pixel] = keep(&way, &on, &numbers);
    float share = 1.0f / max(light.w, 1.0f);
    float3 transmitted = seen.xyz * share;
    // Exactly nothing where all came through, also where a product and a sum are rounded as one.
    float stops = (3.0f * light.w - (seen.x + seen.y + seen.z)) * (share / 3.0f);
    float depth = stop.x > 0.0f ? stop.y / stop.x : INFINITY;
    bound->film[2u * (size_t)pixel] = (float4)(light.xyz * share, stops);
    bound->film[2u * (size_t)pixel + 1u] = (float4)(transmitted, depth);
}

// A place of the world, from the eye, in index space.
float3 placed(const Bound *bound, float3 x) {
    return bound->params->eye.xyz + to_index(bound, x);
}

// The walk that a record keeps.
Walk kept(const Bound *bound, const PathRecord *record) {
    Walk on;
    on.origin = placed(bound, record->place.xyz);
    on.direction = carried(bound, record->way.xyz);
    on.t = record->place.w;
    on.far = record->way.w;
    on.cell = as_int3(record->cell.xyz);
    on.over = record->cell.w == 1u;
    return on;
}

// The path that a record keeps.
Way resume(const PathRecord *record) {
    Way way;
    way.mode = record->count.x;
    way.place = record->place.xyz;
    way.direction = record->way.xyz;
    way.next = record->next.xyz;
    way.density = record->next.w;
    way.weight = record->weight.xyz;
    way.total = record->weight.w;
    way.light = record->light.xyz;
    way.chosen = record->light.w;
    way.pending = record->pending.xyz;
    way.stopped = record->pending.w;
    way.ratio = record->ratio.xyz;
    way.stopped_at = record->ratio.w;
    way.through = record->through.xyz;
    way.surface = record->through.w;
    way.depth = record->count.z;
    way.triangle = record->count.w;
    return way;
}

// What a record keeps of a path.
PathRecord keep(const Way *way, const Walk *on, const Draws *numbers) {
    PathRecord record;
    record.place = (float4)(way->place, on->t);
    record.way = (float4)(way->direction, on->far);
    record.next = (float4)(way->next, way->density);
    record.weight = (float4)(way->weight, way->total);
    record.light = (float4)(way->light, way->chosen);
    record.pending = (float4)(way->pending, way->stopped);
    record.ratio = (float4)(way->ratio, way->stopped_at);
    record.through = (float4)(way->through, way->surface);
    record.cell = (uint4)(as_uint3(on->cell), on->over ? 1u : 0u);
    record.count = (uint4)(way->mode, numbers->next, way->depth, way->triangle);
    return record;
}

// A path at the eye.
Way begin(const Bound *bound, uint pixel, Draws *numbers) {
    uint width = bound->params->width;
    float x = convert_float(pixel % width) + draw(numbers);
    float y = convert_float(pixel / width) + draw(numbers);
    float a = x * (2.0f / convert_float(width)) - 1.0f;
    float b = 1.0f - y * (2.0f / convert_float(bound->params->height));
    float3 toward = a * bound->params->right.xyz + b * bound->params->up.xyz + bound->params->forward.xyz;
    Way way;
    way.mode = PATH_VIEW;
    way.place = way.next = way.weight = way.light = way.pending = (float3)(0.0f);
    way.direction = toward / sqrt(dot(toward, toward));
    way.ratio = way.through = (float3)(1.0f);
    way.surface = FAR;
    way.density = way.total = way.chosen = way.stopped = way.stopped_at = 0.0f;
    way.depth = way.triangle = 0u;
    return way;
}

// Where the ray meets a surface.
void meet(const Bound *bound, Way *way) {
    way->surface = FAR;
    if (!has_mesh) {
        return;
    }
    Line of = line(from_mesh(bound, way->place), way->direction);
    Hit hit = nearest(bound, &of, 0.0f, FAR, 0u, bound->params->nodes);
    if (hit.distance < FAR) {
        way->surface = hit.distance;
        way->triangle = hit.triangle;
    }
}

// A place from the mesh's origin.
float3 from_mesh(const Bound *bound, float3 place) {
    return bound->params->mesh_eye.xyz + place;
}

// What stands behind a pixel; nothing without a background.
float4 behind(const Bound *bound, uint pixel) {
    if (has_background) {
        return bound->background[pixel];
    }
    return (float4)(0.0f, 0.0f, 0.0f, FAR);
}

// Where the ray ends; that from the eye also at what stands behind everything.
float limit(const Bound *bound, const Way *way, uint pixel) {
    return way->mode == PATH_VIEW ? fmin(way->surface, behind(bound, pixel).w) : way->surface;
}

// A turn of a walk. Whether the path scatters where it now is.
INLINE bool turn(const Bound *bound, uint pixel, Way *way, Walk *on, Draws *numbers) {
    if (on->over) {
        return arrive(bound, pixel, way, numbers);
    }
    float rate = advance(bound, on, numbers);
    if (rate == 0.0f) {
        return false;
    }
    float3 at = stands(on);
    float3 stops = extinction(bound, at, rate);
    if (way->mode == PATH_SHADOW) {
        way->ratio = faint(way->ratio * (1.0f - stops), numbers);
        on->over = all(way->ratio == (float3)(0.0f));
        return false;
    }
    float3 scatters = scattering(bound, at, stops, rate);
    float3 shines = emission(bound, at, rate);
    if (way->mode == PATH_VIEW) {
        way->light += way->ratio * shines;
        float stopped = dot(way->ratio, stops);
        way->stopped += stopped;
        way->stopped_at += stopped * on->t;
        offer(way, way->ratio * tinted(bound, at, scatters, rate), on->t, numbers);
        way->ratio = faint(way->ratio * (1.0f - stops), numbers);
        on->over = all(way->ratio == (float3)(0.0f));
        return false;
    }
    way->light += way->weight * shines;
    float whole = way->weight.x + way->weight.y + way->weight.z;
    float real = dot(way->weight, stops) / whole;
    if (draw(numbers) >= real) {
        way->weight = way->weight * (1.0f - stops) / (1.0f - real);
        return false;
    }
    way->weight = way->weight * scatters / real;
    way->place += on->t * way->direction;
    if (all(way->weight == (float3)(0.0f)) || way->depth >= bound->params->max_depth) {
        way->mode = PATH_IDLE;
        return false;
    }
    way->surface = FAR;
    return true;
}

// Extinction over the rate, at most 1: lookups are good to a rounding.
INLINE float3 extinction(const Bound *bound, float3 at, float rate) {
    float density = sample_density(bound, at, convert_int3(bound->params->dims.xyz), 0);
    return min(density / rate * bound->params->extinction.xyz, (float3)(1.0f));
}

// Scattering over the rate.
INLINE float3 scattering(const Bound *bound, float3 at, float3 stops, float rate) {
    float3 albedo = bound->params->albedo.xyz;
    if (has_scattering) {
        float3 density = sample_scattering(bound, at, convert_int3(bound->params->dims.xyz), 0).xyz;
        return density / rate * bound->params->extinction.xyz * albedo;
    }
    return stops * albedo;
}

// Scattering over the rate as the eye sees it.
INLINE float3 tinted(const Bound *bound, float3 at, float3 scatters, float rate) {
    if (has_seen_scattering) {
        float3 density = sample_seen_scattering(bound, at, convert_int3(bound->params->dims.xyz), 0).xyz;
        return density / rate * bound->params->extinction.xyz * bound->params->albedo.xyz;
    }
    return scatters;
}

// Emission over the rate.
INLINE float3 emission(const Bound *bound, float3 at, float rate) {
    float3 e = bound->params->emission.xyz;
    if (e.x + e.y + e.z == 0.0f) {
        return (float3)(0.0f);
    }
    int3 size = convert_int3(bound->params->dims.xyz);
    float3 source;
    if (has_emission_color) {
        source = sample_emission_color(bound, at, size, 0).xyz;
    } else if (has_emission_density) {
        source = (float3)(sample_emission_density(bound, at, size, 0));
    } else {
        source = (float3)(sample_density(bound, at, size, 0));
    }
    return source / rate * e;
}

// T, or nothing by the chance that makes up for it where T is faint.
INLINE float3 faint(float3 ratio, Draws *numbers) {
    float most = max(max(ratio.x, ratio.y), ratio.z);
    if (most >= PATH_FAINT) {
        return ratio;
    }
    if (draw(numbers) * PATH_FAINT < most) {
        return ratio * (PATH_FAINT / most);
    }
    return (float3)(0.0f);
}

// A place on the eye's ray to scatter at, `t` metres along, with its weights.
INLINE void offer(Way *way, float3 weights, float t, Draws *numbers) {
    float weight = weights.x + weights.y + weights.z;
    if (weight > 0.0f) {
        way->total += weight;
        if (draw(numbers) * way->total < weight) {
            way->weight = weights / weight;
            way->chosen = t;
        }
    }
}

// The end of a walk. Whether the path scatters where it now is.
bool arrive(const Bound *bound, uint pixel, Way *way, Draws *numbers) {
    if (way->mode == PATH_SHADOW) {
        way->light += way->pending * way->ratio;
        way->mode = all(way->weight == (float3)(0.0f)) ? PATH_IDLE : PATH_DEPART;
        return false;
    }
    float3 d = way->direction;
    float t = way->surface;
    bool goes_on = false;
    // What of the environment is seen.
    float3 share = (float3)(0.0f);
    if (way->mode == PATH_VIEW) {
        way->through = way->ratio;
        float4 back = behind(bound, pixel);
        if (way->surface < fmin(back.w, FAR)) {
            offer(way, way->ratio, -1.0f, numbers);
        } else if (back.w < FAR) {
            way->light += way->ratio * back.xyz;
        } else if (bound->params->visible == 1u) {
            share = way->ratio;
        }
        goes_on = way->total > 0.0f;
        way->weight *= way->total;
        if (way->chosen >= 0.0f) {
            t = way->chosen;
            way->surface = FAR;
        }
    } else if (way->surface < FAR) {
        goes_on = way->depth < bound->params->max_depth;
    } else {
        share = way->weight * share_of_scattering(bound, d, way->density);
    }
    if (any(share != (float3)(0.0f))) {
        way->light += share * surroundings(bound, d);
    }
    if (goes_on) {
        way->place += t * d;
    } else {
        way->mode = PATH_IDLE;
    }
    return goes_on;
}

// The environment's radiance; none without one.
float3 surroundings(const Bound *bound, float3 d) {
    if (has_environment) {
        return sky(bound, d);
    }
    return (float3)(0.0f);
}

// The share of scattering, of that density, in what is seen of the environment along `d` (balance heuristic).
float share_of_scattering(const Bound *bound, float3 d, float density) {
    if (!has_environment) {
        return 1.0f;
    }
    return density / (density + sky_density(bound, d));
}

// The probability that the environment is chosen and drawn along `d`, per steradian.
float sky_density(const Bound *bound, float3 d) {
    uint columns = bound->params->sky_columns;
    uint rows = bound->params->sky_rows;
    float u = angle(d.x, -d.z) / (2.0f * PI) + bound->params->environment.w;
    uint column = convert_uint((u - floor(u)) * convert_float(columns));
    uint row = convert_uint(angle_of_cosine(d.y) / PI * convert_float(rows));
    uint cell = min(row, rows - 1u) * columns + min(column, columns - 1u);
    return bound->tables[bound->params->sky_at + CHOICE * cell + 2u] * chance(bound, bound->params->lights);
}

// The probability that a light, or behind them all the environment, is chosen.
float chance(const Bound *bound, uint item) {
    return bound->tables[bound->params->choices_at + CHOICE * item + 2u];
}

// A direction toward the environment.
float3 toward_sky(const Bound *bound, Draws *numbers) {
    uint columns = bound->params->sky_columns;
    uint cell = choose(bound, bound->params->sky_at, columns * bound->params->sky_rows, numbers);
    float u = (convert_float(cell % columns) + draw(numbers)) / convert_float(columns) - bound->params->environment.w;
    __global const float *edges = bound->tables + bound->params->edges_at + cell / columns;
    float y = edges[0] + (edges[1] - edges[0]) * draw(numbers);
    float2 p = circle(u - floor(u));
    float planar = sqrt(max(1.0f - y * y, 0.0f));
    return (float3)(planar * p.y, y, -planar * p.x);
}

// Draws where the path goes on, and looks at a light before; whether there is one to look at.
bool scatter(const Bound *bound, Way *way, Draws *numbers) {
    way->depth += 1u;
    Spot at = spot(bound, way->surface < FAR, from_mesh(bound, way->place), way->direction, way->triangle);
    float3 origin = way->direction;
    float margin = MESH_MARGIN * bound->params->mesh_eye.w;
    way->place += margin * at.facet;
    bool looks = look(bound, way, &at, numbers);
    onward(bound, way, &at, origin, numbers);
    if (looks) {
        way->mode = PATH_SHADOW;
    }
    return looks;
}

// Chooses a light and what comes from it but for the medium; whether anything does. The ray is then toward the light.
bool look(const Bound *bound, Way *way, const Spot *at, Draws *numbers) {
    if (bound->params->choices == 0u) {
        return false;
    }
    uint item = choose(bound, bound->params->choices_at, bound->params->choices, numbers);
    float3 origin = way->direction;
    float3 toward;
    float3 arriving = (float3)(0.0f);
    float reach = FAR;
    if (item < bound->params->lights) {
        Incident light = incident(bound, item, way->place, 1.0f);
        toward = light.toward;
        reach = min(light.distance, FAR);
        arriving = light.falloff / chance(bound, item) * bound->lights[item].power.xyz;
    } else {
        toward = toward_sky(bound, numbers);
        float density = sky_density(bound, toward) + scattered_density(bound, at, origin, toward);
        if (density > 0.0f) {
            arriving = surroundings(bound, toward) / density;
        }
    }
    way->pending = way->weight * scattered(bound, at, origin, toward) * arriving;
    if (all(way->pending == (float3)(0.0f))) {
        return false;
    }
    if (has_mesh) {
        float free = reach - MESH_MARGIN * bound->params->mesh_eye.w;
        Line of = line(from_mesh(bound, way->place), toward);
        if (blocked(bound, &of, free, true)) {
            return false;
        }
    }
    way->direction = toward;
    way->surface = reach;
    way->ratio = (float3)(1.0f);
    return true;
}

// Draws where the path goes on, or that it ends.
void onward(const Bound *bound, Way *way, const Spot *at, float3 origin, Draws *numbers) {
    way->mode = PATH_DEPART;
    float3 e = bound->params->emission.xyz;
    // Whether anything is seen behind the last scattering.
    bool seen = has_environment ? true : e.x + e.y + e.z > 0.0f;
    if (way->depth >= bound->params->max_depth && !seen) {
        way->weight = (float3)(0.0f);
    } else {
        if (!at->surface) {
            float c = bend(bound, numbers);
            way->next = around(origin, c, draw(numbers));
        } else if (draw(numbers) < dull(at)) {
            float c = sqrt(draw(numbers));
            way->next = around(at->normal, c, draw(numbers));
        } else {
            float3 mirrored = origin - 2.0f * dot(origin, at->normal) * at->normal;
            float c = pow(1.0f - draw(numbers), 1.0f / (at->exponent + 1.0f));
            way->next = around(mirrored, c, draw(numbers));
        }
        way->density = scattered_density(bound, at, origin, way->next);
        float3 share = scattered(bound, at, origin, way->next);
        way->weight = way->density > 0.0f ? way->weight * share / way->density : (float3)(0.0f);
        float most = max(max(way->weight.x, way->weight.y), way->weight.z);
        float stays = min(most / PATH_WEAK, 1.0f);
        if (way->depth >= PATH_LONG) {
            stays = min(stays, 1.0f - 1.0f / convert_float(PATH_LONG));
        }
        if (stays < 1.0f) {
            way->weight = draw(numbers) < stays ? way->weight / stays : (float3)(0.0f);
        }
    }
    if (all(way->weight == (float3)(0.0f))) {
        way->mode = PATH_IDLE;
    }
}
