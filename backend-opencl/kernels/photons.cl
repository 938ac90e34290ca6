// `photons`: light that the medium scatters, left on the cells of a coarse grid. One work-item a photon.

// A photon on its way.
typedef struct {
    Walk on;
    float3 way;
    float weight;
    // Scatterings before this flight.
    uint depth;
    uint turns;
    bool over;
} Photon;

// A flight that leaves light: in index space from where, and voxels per metre; on its way through the world; metres of it, and
// light per metre or all of it.
typedef struct {
    float3 origin;
    float3 direction;
    float3 way;
    float length;
    float light;
    uint depth;
} Event;

// What the cells get of a flight alike.
typedef struct {
    float moments[HARMONICS_MAX];
    Draws rounding;
    // The weights of its direction: where they begin, and how many.
    uint weights;
    uint count;
} Cargo;

Photon enter(const Bound *bound, const PhotonDirection *source, Draws *numbers);
uint trace(const Bound *bound, Photon *photon, Draws *numbers, Event *events, int *tally);
float albedo(const Bound *bound, float3 at, float density);
void deposit(const Bound *bound, const PhotonDirection *source, uint name, const Event *event, int *tally);
bool along(const Bound *bound, const Cargo *cargo, int3 cells, const Event *flight, float light, int *tally);
bool spread(const Bound *bound, const Cargo *cargo, int3 cells, float3 place, float light, int *tally);
float share(const Bound *bound, int3 cells, int3 cell, float3 place);
bool land(const Bound *bound, const Cargo *cargo, uint cell, float light, int *tally);
void add(const Bound *bound, uint place, float value, int *tally);

F phase_value(const Bound *bound, I i) {
    return bound->tables[bound->params->phase_at + i];
}

uint phase_size(const Bound *bound) {
    return bound->params->phase_size;
}

float harmonics_value(const Bound *bound, uint i) {
    return bound->tables[i];
}

// The photon of a unit.
void run_photons(const Bound *bound) {
    size_t n = number();
    if (n >= bound->launch->count) {
        return;
    }
    uint unit = bound->launch->start + (uint)n;
    uint listed = bound->params->listed;
    PhotonDirection source = bound->directions[unit % listed];
    uint name = (bound->params->round + unit / listed) * bound->params->directions + source.number;
    Draws numbers = draws(name, 0u, bound->params->seed, 0u);
    Photon photon = enter(bound, &source, &numbers);
    int tally[PHOTON_COUNTERS];
    for (uint i = 0u; i < PHOTON_COUNTERS; i++) {
        tally[i] = 0;
    }
    if (bound->params->begin == 1u) {
        tally[PHOTON_PHOTONS] = 1;
    }
    Event events[PHOTON_EVENTS];
    while (!photon.over) {
        uint count = trace(bound, &photon, &numbers, events, tally);
        for (uint i = 0u; i < count; i++) {
            deposit(bound, &source, name, &events[i], tally);
        }
    }
    for (uint i = 0u; i < PHOTON_COUNTERS; i++) {
        if (tally[i] > 0) {
            atomic_add(&bound->counters[i], tally[i]);
        }
    }
}

// A photon where it enters the box.
Photon enter(const Bound *bound, const PhotonDirection *source, Draws *numbers) {
    Photon photon;
    photon.way = -source->toward.xyz;
    float3 along_way = carried(bound, photon.way);
    float wall = draw(numbers);
    float a = draw(numbers);
    float b = draw(numbers);
    // The wall at the lower end lets in what goes up.
    float3 side = along_way > (float3)(0.0f) ? (float3)(0.0f) : (float3)(1.0f);
    float3 at = (float3)(a, b, side.z);
    if (wall < source->first) {
        at = (float3)(side.x, a, b);
    } else if (wall < source->second) {
        at = (float3)(a, side.y, b);
    }
    float3 origin = at * convert_float3(bound->params->dims.xyz) - 0.5f;
    photon.on = walk(bound, origin, along_way, FAR);
    photon.weight = 1.0f;
    photon.depth = 0u;
    photon.turns = 0u;
    photon.over = false;
    return photon;
}

// Follows a photon until it has made so many flights that leave light as are kept, or is no more. How many it made.
uint trace(const Bound *bound, Photon *photon, Draws *numbers, Event *events, int *tally) {
    const PhotonParams *params = bound->params;
    int3 size = convert_int3(params->dims.xyz);
    uint count = 0u;
    while (!photon->over && count < PHOTON_EVENTS) {
        bool leaves = photon->depth >= params->begin;
        if (photon->turns >= params->turns) {
            photon->over = true;
            if (leaves || params->begin == 1u) {
                tally[PHOTON_TRUNCATED] += 1;
            }
            break;
        }
        photon->turns += 1u;
        float light = 0.0f;
        float3 at = photon->on.origin;
        if (photon->on.over) {
            photon->over = true;
            if (params->deposit == DEPOSIT_TRACK) {
                light = photon->weight;
            }
        } else {
            float rate = advance(bound, &photon->on, numbers);
            if (rate == 0.0f) {
                continue;
            }
            at = stands(&photon->on);
            float density = sample_density(bound, at, size, 0);
            float extinction = min(density * params->densest, rate);
            if (draw(numbers) * rate >= extinction) {
                continue;
            }
            float scatters = albedo(bound, at, density);
            if (params->deposit == DEPOSIT_TRACK) {
                light = photon->weight;
            } else if (params->deposit == DEPOSIT_COLLISION) {
                light = photon->weight / extinction;
            } else if (draw(numbers) >= scatters) {
                light = photon->weight / (extinction * (1.0f - scatters));
                photon->over = true;
            }
            if (params->deposit != DEPOSIT_ABSORPTION) {
                photon->weight *= scatters;
            }
        }
        if (leaves && light > 0.0f) {
            Event event;
            event.origin = params->deposit == DEPOSIT_TRACK ? photon->on.origin : at;
            event.direction = photon->on.direction;
            event.way = photon->way;
            event.length = photon->on.t;
            event.light = light;
            event.depth = photon->depth;
            events[count] = event;
            count += 1u;
        }
        if (photon->weight < PHOTON_WEAK && !photon->over) {
            photon->over = draw(numbers) * PHOTON_WEAK >= photon->weight;
            photon->weight = PHOTON_WEAK;
        }
        if (photon->over) {
            break;
        }
        photon->depth += 1u;
        if (photon->depth >= params->end) {
            photon->over = true;
            if (params->end > params->max_depth) {
                tally[PHOTON_TRUNCATED] += 1;
            }
            break;
        }
        float c = bend(bound, numbers);
        if (params->phase_kind == PHASE_TABLE) {
            photon->weight *= phase(bound, c) / bend_density(bound, c);
        }
        photon->way = around(photon->way, c, draw(numbers));
        photon->on = walk(bound, at, carried(bound, photon->way), FAR);
    }
    return count;
}

// The albedo at a place of index space, where there is some density.
float albedo(const Bound *bound, float3 at, float density) {
    float scatters = bound->params->albedo;
    if (has_scattering) {
        float4 of = sample_scattering(bound, at, convert_int3(bound->params->dims.xyz), 0);
        uint channel = bound->params->channel;
        scatters *= (channel == 0u ? of.x : channel == 1u ? of.y : of.z) / density;
    }
    return scatters;
}

// Leaves the light of a flight of a photon of that number.
void deposit(const Bound *bound, const PhotonDirection *source, uint name, const Event *event, int *tally) {
    const PhotonParams *params = bound->params;
    tally[PHOTON_DEPOSITS] += 1;
    int3 cells = convert_int3(params->cells.xyz);
    float3 ratio = convert_float3(cells) / convert_float3(params->dims.xyz);
    Event flight = *event;
    flight.origin = (event->origin + 0.5f) * ratio;
    flight.direction = event->direction * ratio;
    float light = event->light * source->toward.w / params->volume * params->scale;
    Cargo cargo;
    // Toward where the light comes from.
    harmonics(bound, -event->way, params->bands, cargo.moments);
    cargo.rounding = draws(name, event->depth, params->seed, 0u);
    cargo.weights = source->weights;
    cargo.count = source->count;
    bool received;
    if (params->deposit == DEPOSIT_TRACK) {
        received = along(bound, &cargo, cells, &flight, light, tally);
    } else {
        received = spread(bound, &cargo, cells, flight.origin, light, tally);
    }
    if (!received) {
        tally[PHOTON_LOST] += 1;
    }
}

// Leaves light along a flight, whose places are in cells. Whether any cell has a row.
bool along(const Bound *bound, const Cargo *cargo, int3 cells, const Event *flight, float light, int *tally) {
    float3 origin = flight->origin;
    float3 direction = flight->direction;
    float3 lower = floor(origin);
    float3 most = convert_float3(cells - 1);
    int3 cell = convert_int3(lower > (float3)(0.0f) ? min(lower, most) : (float3)(0.0f));
    float t = 0.0f;
    bool received = false;
    int3 onward = direction > (float3)(0.0f) ? (int3)(1) : (int3)(0);
    for (int turns = 0; turns < cells.x + cells.y + cells.z + 3; turns++) {
        float3 leave = (convert_float3(cell + onward) - origin) / direction;
        float exit = leave.z;
        int3 across = (int3)(0, 0, 2 * onward.z - 1);
        if (leave.x <= leave.y && leave.x <= leave.z) {
            exit = leave.x;
            across = (int3)(2 * onward.x - 1, 0, 0);
        } else if (leave.y <= leave.z) {
            exit = leave.y;
            across = (int3)(0, 2 * onward.y - 1, 0);
        }
        exit = min(exit, flight->length);
        if (exit > t) {
            uint number_of = (uint)((cell.z * cells.y + cell.y) * cells.x + cell.x);
            if (land(bound, cargo, number_of, light * (exit - t), tally)) {
                received = true;
            }
            t = exit;
        }
        cell += across;
        if (exit >= flight->length || any(cell < (int3)(0)) || any(cell >= cells)) {
            break;
        }
    }
    return received;
}

// Leaves light on the cells around a place in cells. Whether any has a row.
bool spread(const Bound *bound, const Cargo *cargo, int3 cells, float3 place, float light, int *tally) {
    int reach = convert_int(ceil(bound->params->radius));
    int side = 2 * reach + 1;
    int3 first = convert_int3(floor(place)) - reach;
    float sum = 0.0f;
    for (int i = 0; i < side * side * side; i++) {
        sum += share(bound, cells, first + (int3)(i % side, i / side % side, i / (side * side)), place);
    }
    if (sum <= 0.0f) {
        return false;
    }
    for (int i = 0; i < side * side * side; i++) {
        int3 cell = first + (int3)(i % side, i / side % side, i / (side * side));
        float part = share(bound, cells, cell, place);
        if (part > 0.0f) {
            uint number_of = (uint)((cell.z * cells.y + cell.y) * cells.x + cell.x);
            land(bound, cargo, number_of, light * (part / sum), tally);
        }
    }
    return true;
}

// The part of a cell in what is left around a place in cells, but for a factor; 0 where it has no row.
float share(const Bound *bound, int3 cells, int3 cell, float3 place) {
    if (any(cell < (int3)(0)) || any(cell >= cells)) {
        return 0.0f;
    }
    if (bound->rows[(cell.z * cells.y + cell.y) * cells.x + cell.x] == 0u) {
        return 0.0f;
    }
    float3 way = convert_float3(cell) + 0.5f - place;
    float radius = bound->params->radius;
    float base = max(radius * radius - dot(way, way), 0.0f);
    return base * base * base;
}

// Adds light to the moments of a cell. Whether it has a row.
bool land(const Bound *bound, const Cargo *cargo, uint cell, float light, int *tally) {
    uint row = bound->rows[cell];
    if (row == 0u || row > bound->params->rows) {
        return false;
    }
    Draws rounding = cargo->rounding;
    rounding.next = cell;
    float up = draw(&rounding);
    uint lights = bound->params->lights;
    uint count = bound->params->bands * bound->params->bands;
    for (uint i = 0u; i < cargo->count; i++) {
        float2 weight = bound->weights[cargo->weights + i];
        uint light_number = convert_uint(weight.x);
        if (light_number < lights) {
            uint at = ((row - 1u) * lights + light_number) * count;
            float value = light * weight.y;
            for (uint j = 0u; j < count; j++) {
                add(bound, at + j, floor(value * cargo->moments[j] + up), tally);
            }
        }
    }
    return true;
}

// Adds to an integer, and counts what it does not hold.
void add(const Bound *bound, uint place, float value, int *tally) {
    bool held = false;
    // What is not a number is not held either.
    if (fabs(value) < 2147483648.0f) {
        int more = convert_int(value);
        int before = 0;
        if (more != 0) {
            before = atomic_add(&bound->deposits[place], more);
        }
        int after = as_int(as_uint(before) + as_uint(more));
        held = ((before ^ after) & (more ^ after)) >= 0;
    }
    if (!held) {
        tally[PHOTON_OVERFLOWS] += 1;
    }
}
