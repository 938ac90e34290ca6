// `sweep`: light along many directions at the cells of a coarse grid, each from its neighbours upwind. A dispatch is some
// steps of a batch, a workgroup a direction of it; or the moments of a batch, a work-item some coefficients of a cell, or all of
// a packet of cells; or, of packets before all others, what cells hold with x and y exchanged, a work-item a slice of a value.

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

// What the cells hold, of each value a grid, and how far it is from a cell to the next in its row, in the next row, and in the next plane.
typedef struct {
    __global const float *optics;
    __global const float *sources;
    uint hop;
    uint row;
    uint plane;
} Cells;

Planes planes(const Bound *bound, uint n, uint first);
Cells cells_of(const Bound *bound, const Planes *of);
void turned(const Bound *bound, uint item);
size_t part(const Bound *bound, const Planes *of, uint step, uint kind, uint channel);
size_t corner(const Planes *of, uint step, uint plane);
INLINE F load(__global const float *from, size_t start, size_t end, uint hop, uint left);
void enter(const Bound *bound, const Planes *of, uint step, bool lit);
INLINE void lay(const Planes *of, __global float *values, uint row, uint column, bool repeats, float value, F v);
void advance(const Bound *bound, const Planes *of, uint step);
INLINE F between(__global const float *values, const int *around, const float *weights, const M *closed, F own);
INLINE F leaning(F tau, F2 piece);
INLINE M obstructs(U word, const SweepDirection *way, uint first, uint second);
INLINE F source(const Bound *bound, const Cells *held, uint direction, uint channel, size_t cell, uint left);
void gather(const Bound *bound, uint item, uint first, uint taken);
INLINE void summed(const Bound *bound, size_t cell, uint first, uint taken, uint channel, uint k, const uint many);

void run_sweep(const Bound *bound) {
#if WIDTH > 1
    if (bound->launch->units == 0u) {
        if (number() / WIDTH < bound->launch->count) {
            turned(bound, (uint)(number() / WIDTH));
        }
        return;
    }
#endif
    uint steps = bound->params->cells.w;
    uint begin = bound->launch->start % (steps + 1u);
    uint first = bound->launch->start / (steps + 1u) * bound->params->batch;
    uint count = min(bound->params->batch, bound->params->directions - first);
    bool gathers = begin == steps;
    Planes of = planes(bound, gathers ? 0u : (uint)get_group_id(0), first);
    uint end = gathers ? begin : min(begin + bound->launch->units, of.deep);
    // A team meets here and nowhere else: every work-item of it turns as often.
    for (uint step = begin; step < end; step++) {
        if (step == begin) {
            // The plane before, or what lies beyond the box.
            enter(bound, &of, step - 1u, step > 0u);
        }
        enter(bound, &of, step, false);
        TEAM_MEETS;
        advance(bound, &of, step);
        TEAM_MEETS;
    }
    if (gathers && number() / WIDTH < bound->launch->count) {
        gather(bound, (uint)(number() / WIDTH), first, count);
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

// What the planes of a direction are taken from. Planes normal to x have no rows side by side in memory, and packets would gather each
// of them for every direction: they take the copies that were turned before, which lie behind the planes.
Cells cells_of(const Bound *bound, const Planes *of) {
    Cells held = {bound->optics, bound->sources, of->hop, of->row, of->plane};
#if WIDTH > 1
    if (of->way.axis == 0u) {
        uint3 cells = bound->params->cells.xyz;
        held.optics = bound->scratch + 2u * (size_t)bound->params->batch * bound->launch->room;
        held.sources = held.optics + COARSEN_PLANES * (size_t)cells.x * cells.y * cells.z;
        held.hop = 1u;
        held.plane = cells.y;
    }
#endif
    return held;
}

#if WIDTH > 1

// A slice of a value of the cells, with x and y exchanged: those of optics, then those of sources.
void turned(const Bound *bound, uint item) {
    uint3 cells = bound->params->cells.xyz;
    size_t slice = (size_t)cells.x * cells.y;
    size_t count = slice * cells.z;
    uint value = item / cells.z;
    bool sent = value >= COARSEN_PLANES;
    if (!sent && value % 3u >= bound->params->channels) {
        // No channel of the radiance asks for it.
        return;
    }
    __global const float *from = sent ? bound->sources + (value - COARSEN_PLANES) * count : bound->optics + value * count;
    __global float *to = bound->scratch + 2u * (size_t)bound->params->batch * bound->launch->room + value * count;
    from += item % cells.z * slice;
    to += item % cells.z * slice;
    for (uint x = 0u; x < cells.x; x++) {
        for (uint y = 0u; y < cells.y; y += WIDTH) {
            uint left = cells.y - y;
            put_row(load(from + x, (size_t)y * cells.x, 0u, cells.x, left), to + x * cells.y + y, min(left, (uint)WIDTH));
        }
    }
}

#endif

// Where in the memory that planes share lies what one holds of a channel: radiance, extinction, source and emission, kinds 0 to 3. Two planes take turns.
size_t part(const Bound *bound, const Planes *of, uint step, uint kind, uint channel) {
    uint channels = bound->params->channels;
    size_t floats = bound->launch->room;
    return (2u * of->n + step % 2u) * floats + (kind * channels + channel) * of->size;
}

// Number of a plane's cell (0, 0) within a grid whose planes lie so many cells apart.
size_t corner(const Planes *of, uint step, uint plane) {
    bool down = (of->way.down >> of->way.axis & 1u) == 1u;
    return (size_t)(down ? step : of->deep - 1u - step) * plane;
}

// A packet of values `hop` apart, of which `left` are left, out of memory that ends at `end`. Lanes past the last hold what lies
// there, which nobody keeps, or the last.
INLINE F load(__global const float *from, size_t start, size_t end, uint hop, uint left) {
    if (hop == 1u && (left >= WIDTH || start + WIDTH <= end)) {
        return pack(from + start);
    }
    U lane = min((U)(LANE), (U)(left - 1u));
    return fetch(from + start, lane * hop);
}

// Takes the plane of a step: what its cells hold, and their radiance where it is known. Before the first step lies what is
// beyond the box.
void enter(const Bound *bound, const Planes *of, uint step, bool lit) {
    uint channels = bound->params->channels;
    uint3 cells = bound->params->cells.xyz;
    size_t count = (size_t)cells.x * cells.y * cells.z;
    bool beyond = step == 0xffffffffu;
    Cells held = cells_of(bound, of);
    size_t from = beyond ? 0u : corner(of, step, held.plane);
    size_t from_lit = beyond ? 0u : corner(of, step, of->plane);
    size_t words = bound->optics_words;
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
            size_t cell = from + (size_t)row * held.row + (size_t)column * held.hop;
            F v = load(held.optics, channel * count + cell, words, held.hop, left);
            lay(of, extinction, row, column, false, 0.0f, v);
            if (scatters) {
                lay(of, sent, row, column, true, 0.0f, source(bound, &held, of->direction, channel, cell, left));
            }
            if (shines) {
                v = load(held.optics, (6u + channel) * count + cell, words, held.hop, left);
                lay(of, emission, row, column, false, 0.0f, v);
            }
            if (lit) {
                cell = from_lit + (size_t)row * of->row + (size_t)column * of->hop;
                v = load(bound->radiance, (of->n * channels + channel) * count + cell, 0u, of->hop, left);
                lay(of, radiance, row, column, false, bound->params->boundary, v);
            }
        }
    }
}

// Stores a packet of a plane, and the border beside it: the cells at the edge once more, or a value. What lies past the end of a
// row is the row's last cell where they are repeated.
INLINE void lay(const Planes *of, __global float *values, uint row, uint column, bool repeats, float value, F v) {
    bool ends = of->across - column <= WIDTH;
    uint from = row == 0u ? 0u : row + 1u;
    uint to = row + 1u == of->down ? row + 2u : row + 1u;
    for (uint i = from; i <= to; i++) {
        __global float *line = values + i * of->pitch + WIDTH;
        unpack(repeats || i == row + 1u ? v : (F)(value), line + column);
        if (column == 0u) {
            line[-1] = repeats ? line[0] : value;
        }
        if (ends) {
            line[of->across] = repeats ? line[of->across - 1u] : value;
        }
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
    size_t from = corner(of, step, of->plane);
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
            lay(of, out, row, column, false, bound->params->boundary, light);
            __global float *to = bound->radiance + (of->n * channels + channel) * count + cell;
            if (of->hop == 1u) {
                put_row(light, to, min(left, (uint)WIDTH));
            } else {
                put_apart(light, to, of->hop, min(left, (uint)WIDTH));
            }
        }
    }
}

// Between the four cells around Y; `own` stands for those behind surfaces.
INLINE F between(__global const float *values, const int *around, const float *weights, const M *closed, F own) {
    F sum = (F)(0.0f);
#pragma unroll
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
INLINE F leaning(F tau, F2 piece) {
    F series = (((tau * (-1.0f / 30.0f) + 1.0f / 8.0f) * tau - 1.0f / 3.0f) * tau + 0.5f) * tau;
    return tau < 0.05f ? series : piece.y - piece.x;
}

// Whether a surface stands between cells and their neighbours in the plane before, so many cells on along the first and the
// second of the axes that it spans.
INLINE M obstructs(U word, const SweepDirection *way, uint first, uint second) {
    uint axis = way->axis;
    uint3 on = axis == 0u ? (uint3)(1u, first, second) : axis == 1u ? (uint3)(first, 1u, second) : (uint3)(first, second, 1u);
    uint x = (way->down & 1u) == 1u ? 1u - on.x : 1u + on.x;
    uint y = (way->down >> 1 & 1u) == 1u ? 1u - on.y : 1u + on.y;
    uint z = (way->down >> 2 & 1u) == 1u ? 1u - on.z : 1u + on.z;
    return (word >> (z * 9u + y * 3u + x) & 1u) == 1u;
}

// The source function of a packet of cells of a row, of which `left` are left.
INLINE F source(const Bound *bound, const Cells *held, uint direction, uint channel, size_t cell, uint left) {
    uint3 cells = bound->params->cells.xyz;
    size_t count = (size_t)cells.x * cells.y * cells.z;
    F sum = (F)(0.0f);
    uint coefficients = bound->params->source_coefficients;
    for (uint k = 0u; k < coefficients; k++) {
        size_t at = (k * bound->params->channels + channel) * count + cell;
        sum += bound->source_weights[direction * coefficients + k] * load(held->sources, at, bound->sources_words, held->hop, left);
    }
    return sum * load(held->optics, (3u + channel) * count + cell, bound->optics_words, held->hop, left);
}

// Moments of a packet of cells, where it is one of vectors all of them: what the batches before left, and the `taken` directions
// of this one from `first` on.
void gather(const Bound *bound, uint item, uint first, uint taken) {
    uint3 cells = bound->params->cells.xyz;
    size_t count = (size_t)cells.x * cells.y * cells.z;
    uint packets = (uint)((count + WIDTH - 1u) / WIDTH);
    size_t cell = (size_t)(item % packets) * WIDTH;
    uint coefficients = bound->params->coefficients;
    uint channels = max(bound->params->channels, bound->params->weight_channels);
    uint begin = item / packets * SWEEP_TAKEN;
    uint end = WIDTH == 1 ? min(begin + SWEEP_TAKEN, coefficients) : coefficients;
    for (uint c = 0u; c < channels; c++) {
        uint k = begin;
        for (; k + SWEEP_TAKEN <= end; k += SWEEP_TAKEN) {
            summed(bound, cell, first, taken, c, k, SWEEP_TAKEN);
        }
        for (; k < end; k++) {
            summed(bound, cell, first, taken, c, k, 1u);
        }
    }
}

// So many coefficients of the moments of a packet in a channel, from `k` on.
INLINE void summed(const Bound *bound, size_t cell, uint first, uint taken, uint channel, uint k, const uint many) {
    uint3 cells = bound->params->cells.xyz;
    size_t count = (size_t)cells.x * cells.y * cells.z;
    uint left = (uint)min(count - cell, (size_t)WIDTH);
    uint coefficients = bound->params->coefficients;
    uint own = bound->params->channels;
    uint of = bound->params->weight_channels;
    uint channels = max(own, of);
    __global const float *light = bound->radiance + min(channel, own - 1u) * count + cell;
    __global const float *weights = bound->weights + ((size_t)first * coefficients + k) * of + min(channel, of - 1u);
    F sums[SWEEP_TAKEN];
#pragma unroll
    for (uint i = 0u; i < many; i++) {
        sums[i] = (F)(0.0f);
    }
    for (uint n = 0u; n < taken; n++) {
        F value = load(light, 0u, 0u, 1u, left);
#pragma unroll
        for (uint i = 0u; i < many; i++) {
            sums[i] += weights[i * of] * value;
        }
        light += own * count;
        weights += coefficients * of;
    }
    bool planar = bound->params->planar == 1u;
    uint hop = planar ? 1u : coefficients * channels;
#pragma unroll
    for (uint i = 0u; i < many; i++) {
        size_t place = planar ? (size_t)((k + i) * channels + channel) * count + cell : (cell * coefficients + k + i) * channels + channel;
        __global float *to = bound->moments + place;
        F sum = first > 0u ? load(to, 0u, 0u, hop, left) + sums[i] : sums[i];
        if (planar) {
            put_row(sum, to, left);
        } else {
            put_apart(sum, to, hop, left);
        }
    }
}
