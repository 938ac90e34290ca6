// `sweep`: light along many directions at the cells of a coarse grid, each from its neighbours upwind. A dispatch is some
// steps of a batch, a workgroup a direction of it; or the moments of a batch, a work-item some coefficients of a packet of
// cells.

// Coefficients of a work-item's moments.
#define TAKEN 4u

// A direction's planes of cells, in rows along the first of the axes that they span. Around a plane lies a border of one cell
// of what stands beyond, and before and behind each row a packet's room, so that packets load without asking.
typedef struct {
    uint direction;
    // Number of the direction within its batch.
    uint n;
    SweepDirection way;
    // Cells of a row, rows, and planes.
    uint across;
    uint down;
    uint deep;
    // Cells from a cell to the next in its row, in the next row, and in the next plane.
    uint hop;
    uint row;
    uint plane;
    // Packets of a row; floats of a row and of a channel of a plane.
    uint packets;
    uint pitch;
    uint size;
} Planes;

Planes planes(const Bound *bound, uint n, uint first);
size_t part(const Bound *bound, const Planes *of, uint step, uint kind, uint channel);
size_t corner(const Planes *of, uint step);
F load(__global const float *from, size_t start, uint hop, uint left);
void enter(const Bound *bound, const Planes *of, uint step, bool lit);
void border(const Planes *of, __global float *values, bool repeats, float value);
void advance(const Bound *bound, const Planes *of, uint step);
F between(__global const float *values, const int *around, const float *weights, const M *closed, F own);
F leaning(F tau, F2 piece);
M obstructs(U word, const SweepDirection *way, uint first, uint second);
F source(const Bound *bound, uint direction, uint channel, size_t cell, uint hop, uint left);
void gather(const Bound *bound, uint item, uint first, uint taken);

void run_sweep(const Bound *bound) {
    uint steps = bound->params->cells.w;
    uint begin = bound->launch->start % (steps + 1u);
    uint first = bound->launch->start / (steps + 1u) * bound->params->batch;
    uint count = min(bound->params->batch, bound->params->directions - first);
    if (begin == steps) {
        if (number() / WIDTH < bound->launch->count) {
            gather(bound, (uint)(number() / WIDTH), first, count);
        }
        return;
    }
    Planes of = planes(bound, (uint)get_group_id(0), first);
    uint end = min(begin + bound->launch->units, of.deep);
    for (uint step = begin; step < end; step++) {
        if (step == begin) {
            // The plane before, or what lies beyond the box.
            enter(bound, &of, step - 1u, step > 0u);
        }
        enter(bound, &of, step, false);
        TEAM_MEETS;
        advance(bound, &of, step);
        TEAM_MEETS;
        for (uint channel = 0u; channel < bound->params->channels; channel++) {
            border(&of, bound->scratch + part(bound, &of, step, 0u, channel), false, bound->params->boundary);
        }
    }
}

// The planes of direction `n` of the batch that begins with `first`.
Planes planes(const Bound *bound, uint n, uint first) {
    uint3 cells = bound->params->cells.xyz;
    Planes of;
    of.direction = first + n;
    of.n = n;
    of.way = bound->directions[first + n];
    uint axis = of.way.axis;
    of.across = axis == 0u ? cells.y : cells.x;
    of.down = axis == 2u ? cells.y : cells.z;
    of.deep = axis == 0u ? cells.x : axis == 1u ? cells.y : cells.z;
    of.hop = axis == 0u ? cells.x : 1u;
    of.row = axis == 2u ? cells.x : cells.x * cells.y;
    of.plane = axis == 0u ? 1u : axis == 1u ? cells.x : cells.x * cells.y;
    of.packets = (of.across + WIDTH - 1u) / WIDTH;
    of.pitch = (of.packets + 2u) * WIDTH;
    of.size = of.pitch * (of.down + 2u);
    return of;
}

// Where in the memory that planes share lies what one holds of a channel: radiance, extinction, source and emission, kinds 0 to 3. Two planes take turns.
size_t part(const Bound *bound, const Planes *of, uint step, uint kind, uint channel) {
    uint channels = bound->params->channels;
    size_t floats = bound->launch->room;
    return (2u * of->n + step % 2u) * floats + (kind * channels + channel) * of->size;
}

// Number of a plane's cell (0, 0) within the grid.
size_t corner(const Planes *of, uint step) {
    bool down = (of->way.down >> of->way.axis & 1u) == 1u;
    return (size_t)(down ? step : of->deep - 1u - step) * of->plane;
}

// A packet of values `hop` apart, of which `left` are left.
F load(__global const float *from, size_t start, uint hop, uint left) {
    from += start;
    if (hop == 1u && left >= WIDTH) {
        return pack(from);
    }
    U lane = min((U)(LANE), (U)(left - 1u));
    return fetch(from, lane * hop);
}

// Takes the plane of a step: what its cells hold, and their radiance where it is known. Before the first step lies what is
// beyond the box.
void enter(const Bound *bound, const Planes *of, uint step, bool lit) {
    uint channels = bound->params->channels;
    uint3 cells = bound->params->cells.xyz;
    size_t count = (size_t)cells.x * cells.y * cells.z;
    bool beyond = step == 0xffffffffu;
    size_t from = beyond ? 0u : corner(of, step);
    bool scatters = bound->params->source_coefficients > 0u;
    bool shines = bound->params->emits == 1u;
    for (uint channel = 0u; channel < channels; channel++) {
        __global float *radiance = bound->scratch + part(bound, of, step, 0u, channel);
        __global float *extinction = bound->scratch + part(bound, of, step, 1u, channel);
        __global float *sent = bound->scratch + part(bound, of, step, 2u, channel);
        __global float *emission = bound->scratch + part(bound, of, step, 3u, channel);
        if (beyond) {
            for (uint i = MEMBER * WIDTH; i < of->size; i += MEMBERS * WIDTH) {
                unpack((F)(bound->params->boundary), radiance + i);
                unpack((F)(0.0f), extinction + i);
                unpack((F)(0.0f), emission + i);
            }
            continue;
        }
        for (uint i = MEMBER; i < of->down * of->packets; i += MEMBERS) {
            uint column = i % of->packets * WIDTH;
            uint row = i / of->packets;
            uint left = of->across - column;
            size_t cell = from + (size_t)row * of->row + (size_t)column * of->hop;
            uint to = (row + 1u) * of->pitch + WIDTH + column;
            unpack(load(bound->optics, channel * count + cell, of->hop, left), extinction + to);
            if (scatters) {
                unpack(source(bound, of->direction, channel, cell, of->hop, left), sent + to);
            }
            if (shines) {
                unpack(load(bound->optics, (6u + channel) * count + cell, of->hop, left), emission + to);
            }
            if (lit) {
                unpack(load(bound->radiance, (of->n * channels + channel) * count + cell, of->hop, left), radiance + to);
            }
        }
        TEAM_MEETS;
        border(of, extinction, false, 0.0f);
        if (scatters) {
            border(of, sent, true, 0.0f);
        }
        if (shines) {
            border(of, emission, false, 0.0f);
        }
        if (lit) {
            border(of, radiance, false, bound->params->boundary);
        }
    }
}

// Fills the border of a plane: with the cells beside it, or with a value.
void border(const Planes *of, __global float *values, bool repeats, float value) {
    for (uint i = MEMBER; i < 2u * of->packets; i += MEMBERS) {
        uint column = WIDTH + i / 2u * WIDTH;
        uint to = i % 2u == 0u ? 0u : of->down + 1u;
        uint from = i % 2u == 0u ? 1u : of->down;
        F beside = (F)(value);
        if (repeats) {
            beside = pack(values + from * of->pitch + column);
        }
        unpack(beside, values + to * of->pitch + column);
    }
    TEAM_MEETS;
    // Beside the rows, where packets past their ends have written.
    for (uint i = MEMBER; i < of->down + 2u; i += MEMBERS) {
        uint from = min(max(i, 1u), of->down) * of->pitch + WIDTH;
        uint to = i * of->pitch + WIDTH;
        float left = values[from];
        float right = values[from + of->across - 1u];
        values[to - 1u] = repeats ? left : value;
        values[to + of->across] = repeats ? right : value;
    }
}

// Radiance of the plane of a step from the one before.
void advance(const Bound *bound, const Planes *of, uint step) {
    const SweepDirection *way = &of->way;
    uint axis = way->axis;
    uint b = axis == 0u ? 1u : 0u;
    uint c = axis == 2u ? 1u : 2u;
    int across = (way->down >> b & 1u) == 1u ? -1 : 1;
    int down = (way->down >> c & 1u) == 1u ? -(int)of->pitch : (int)of->pitch;
    int around[4] = {0, across, down, across + down};
    float f = way->first;
    float g = way->second;
    float weights[4] = {(1.0f - f) * (1.0f - g), f * (1.0f - g), (1.0f - f) * g, f * g};
    uint channels = bound->params->channels;
    uint3 cells = bound->params->cells.xyz;
    size_t count = (size_t)cells.x * cells.y * cells.z;
    size_t from = corner(of, step);
    for (uint i = MEMBER; i < of->down * of->packets; i += MEMBERS) {
        uint column = i % of->packets * WIDTH;
        uint row = i / of->packets;
        size_t cell = from + (size_t)row * of->row + (size_t)column * of->hop;
        uint at = (row + 1u) * of->pitch + WIDTH + column;
        uint left = of->across - column;
        M closed[4];
        for (uint k = 0u; k < 4u; k++) {
            closed[k] = (M)(0);
        }
        if (has_obstructed) {
            U lane = min((U)(LANE), (U)(left - 1u));
            U word = fetch_uint(bound->obstructed + cell, lane * of->hop);
            for (uint k = 0u; k < 4u; k++) {
                closed[k] = obstructs(word, way, k % 2u, k / 2u);
            }
        }
        F tau = (F)(0.0f);
        F2 piece;
        for (uint channel = 0u; channel < channels; channel++) {
            __global float *out = bound->scratch + part(bound, of, step, 0u, channel);
            if (channel == 0u || bound->params->grey == 0u) {
                F own = pack(bound->scratch + part(bound, of, step, 1u, channel) + at);
                F beside = between(bound->scratch + part(bound, of, step + 1u, 1u, channel) + at, around, weights, closed, own);
                tau = (own + beside) * (0.5f * way->length);
                piece = segment(tau);
            }
            F light = piece.x * between(bound->scratch + part(bound, of, step + 1u, 0u, channel) + at, around, weights, closed, (F)(0.0f));
            if (bound->params->source_coefficients > 0u) {
                F own = pack(bound->scratch + part(bound, of, step, 2u, channel) + at);
                F upwind = own;
                if (step > 0u) {
                    upwind = between(bound->scratch + part(bound, of, step + 1u, 2u, channel) + at, around, weights, closed, own);
                }
                light += own * (tau * piece.y) + (upwind - own) * leaning(tau, piece);
            }
            if (bound->params->emits == 1u) {
                F own = pack(bound->scratch + part(bound, of, step, 3u, channel) + at);
                F beside = between(bound->scratch + part(bound, of, step + 1u, 3u, channel) + at, around, weights, closed, own);
                light += piece.y * (0.5f * way->length) * (own + beside);
            }
            unpack(light, out + at);
            __global float *to = bound->radiance + (of->n * channels + channel) * count + cell;
            if (of->hop == 1u && left >= WIDTH) {
                unpack(light, to);
            } else {
                int marked[WIDTH];
                unpack(LANE < left, marked);
                put(light, to, LANE * of->hop, marked);
            }
        }
    }
}

// Between the four cells around Y; `own` stands for those behind surfaces.
F between(__global const float *values, const int *around, const float *weights, const M *closed, F own) {
    F sum = (F)(0.0f);
    for (uint i = 0u; i < 4u; i++) {
        F value = pack(values + around[i]);
        if (has_obstructed) {
            value = closed[i] ? own : value;
        }
        sum += value * weights[i];
    }
    return sum;
}

// The integral of s exp(-s) from 0 to tau over tau, what of a source at Y arrives where that at X is zero: by its series
// where tau is small.
F leaning(F tau, F2 piece) {
    F series = (((tau * (-1.0f / 30.0f) + 1.0f / 8.0f) * tau - 1.0f / 3.0f) * tau + 0.5f) * tau;
    return tau < 0.05f ? series : piece.y - piece.x;
}

// Whether a surface stands between cells and their neighbours in the plane before, so many cells on along the first and the
// second of the axes that it spans.
M obstructs(U word, const SweepDirection *way, uint first, uint second) {
    uint axis = way->axis;
    uint3 on = axis == 0u ? (uint3)(1u, first, second) : axis == 1u ? (uint3)(first, 1u, second) : (uint3)(first, second, 1u);
    uint x = (way->down & 1u) == 1u ? 1u - on.x : 1u + on.x;
    uint y = (way->down >> 1 & 1u) == 1u ? 1u - on.y : 1u + on.y;
    uint z = (way->down >> 2 & 1u) == 1u ? 1u - on.z : 1u + on.z;
    return (word >> (z * 9u + y * 3u + x) & 1u) == 1u;
}

// The source function of a packet of cells `hop` apart, of which `left` are left.
F source(const Bound *bound, uint direction, uint channel, size_t cell, uint hop, uint left) {
    uint3 cells = bound->params->cells.xyz;
    size_t count = (size_t)cells.x * cells.y * cells.z;
    F sum = (F)(0.0f);
    uint coefficients = bound->params->source_coefficients;
    for (uint k = 0u; k < coefficients; k++) {
        F moment = load(bound->sources, (k * bound->params->channels + channel) * count + cell, hop, left);
        sum += bound->source_weights[direction * coefficients + k] * moment;
    }
    return sum * load(bound->optics, (3u + channel) * count + cell, hop, left);
}

// Some coefficients of the moments of a packet of cells: what the batches before left, and the `taken` directions of this one
// from `first` on.
void gather(const Bound *bound, uint item, uint first, uint taken) {
    uint3 cells = bound->params->cells.xyz;
    size_t count = (size_t)cells.x * cells.y * cells.z;
    uint packets = (uint)((count + WIDTH - 1u) / WIDTH);
    size_t cell = (size_t)(item % packets) * WIDTH;
    uint left = (uint)min(count - cell, (size_t)WIDTH);
    uint coefficients = bound->params->coefficients;
    uint begin = item / packets * TAKEN;
    uint own = bound->params->channels;
    uint of = bound->params->weight_channels;
    uint channels = max(own, of);
    int marked[WIDTH];
    unpack(LANE < left, marked);
    for (uint c = 0u; c < channels; c++) {
        __global const float *light = bound->radiance + min(c, own - 1u) * count + cell;
        __global const float *weights = bound->weights + (size_t)first * coefficients * of + min(c, of - 1u);
        // Coefficients past the last repeat it.
        uint k[TAKEN];
        F sums[TAKEN];
        for (uint i = 0u; i < TAKEN; i++) {
            k[i] = min(begin + i, coefficients - 1u);
            sums[i] = (F)(0.0f);
        }
        for (uint n = 0u; n < taken; n++) {
            F value = load(light, (size_t)n * own * count, 1u, left);
            for (uint i = 0u; i < TAKEN; i++) {
                sums[i] += weights[((size_t)n * coefficients + k[i]) * of] * value;
            }
        }
        for (uint i = 0u; i < min(TAKEN, coefficients - begin); i++) {
            bool planar = bound->params->planar == 1u;
            size_t place = planar ? (size_t)(k[i] * channels + c) * count + cell : (cell * coefficients + k[i]) * channels + c;
            U index = LANE * (planar ? 1u : coefficients * channels);
            if (first > 0u) {
                add_to(sums[i], bound->moments + place, index, marked);
            } else {
                put(sums[i], bound->moments + place, index, marked);
            }
        }
    }
}
