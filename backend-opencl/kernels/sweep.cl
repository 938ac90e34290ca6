// `sweep`: light along many directions at the cells of a coarse grid, each from its neighbours upwind. A dispatch is one
// step; one work-item a cell of a plane of one direction, or a coefficient of a cell's moments.

void advance(const Bound *bound, uint n, uint first, uint step, uint item);
float leaning(float tau, float2 piece);
bool obstructs(const Bound *bound, size_t cell, int x, int y, int z);
float source(const Bound *bound, uint direction, uint channel, uint cell);
void gather(const Bound *bound, uint item, uint first, uint taken);

void run_sweep(const Bound *bound) {
    size_t item = number();
    if (item >= bound->launch->count) {
        return;
    }
    uint planes = bound->params->cells.w;
    uint step = bound->launch->start % (planes + 1u);
    uint first = bound->launch->start / (planes + 1u) * bound->params->batch;
    uint count = min(bound->params->batch, bound->params->directions - first);
    uint plane = bound->params->plane;
    if (step == planes) {
        gather(bound, (uint)item, first, count);
    } else if ((uint)item / plane < count) {
        advance(bound, (uint)item / plane, first, step, (uint)item % plane);
    }
}

// Radiance of cell `item` of the plane that a step finishes, of direction `n` of the batch that begins with `first`.
void advance(const Bound *bound, uint n, uint first, uint step, uint item) {
    uint direction = first + n;
    SweepDirection way = bound->directions[direction];
    uint axis = way.axis;
    uint b = axis == 0u ? 1u : 0u;
    uint c = axis == 2u ? 1u : 2u;
    int cells[3] = {(int)bound->params->cells.x, (int)bound->params->cells.y, (int)bound->params->cells.z};
    if ((int)step >= cells[axis] || item >= (uint)(cells[b] * cells[c])) {
        return;
    }
    int hop[3];
    for (uint a = 0u; a < 3u; a++) {
        hop[a] = (way.down >> a) % 2u == 1u ? -1 : 1;
    }
    int at[3];
    at[axis] = hop[axis] < 0 ? (int)step : cells[axis] - 1 - (int)step;
    at[b] = (int)item % cells[b];
    at[c] = (int)item / cells[b];
    uint channels = bound->params->channels;
    size_t count = (size_t)cells[0] * cells[1] * cells[2];
    size_t cell = ((size_t)at[2] * cells[1] + at[1]) * cells[0] + at[0];
    float tau = 0.0f;
    float2 piece = (float2)(0.0f);
    for (uint channel = 0u; channel < channels; channel++) {
        float extinction = 0.0f;
        float emission = 0.0f;
        float arriving = 0.0f;
        float upwind = 0.0f;
        for (int i = 0; i < 4; i++) {
            int to[3] = {at[0], at[1], at[2]};
            to[axis] += hop[axis];
            to[b] += hop[b] * (i % 2);
            to[c] += hop[c] * (i / 2);
            float weight = (i % 2 == 1 ? way.first : 1.0f - way.first) * (i / 2 == 1 ? way.second : 1.0f - way.second);
            if (has_obstructed && obstructs(bound, cell, to[0] - at[0], to[1] - at[1], to[2] - at[2])) {
                extinction += weight * bound->optics[channel * count + cell];
                emission += weight * bound->optics[(6u + channel) * count + cell];
                if (bound->params->source_coefficients > 0u) {
                    upwind += weight * source(bound, direction, channel, (uint)cell);
                }
                continue;
            }
            // The cell of that plane that is nearest, or this one where the plane lies beyond the box.
            int near[3];
            bool within = true;
            for (uint a = 0u; a < 3u; a++) {
                near[a] = clamp(to[a], 0, cells[a] - 1);
                within = within && near[a] == to[a];
            }
            size_t near_cell = step == 0u ? cell : ((size_t)near[2] * cells[1] + near[1]) * cells[0] + near[0];
            if (within) {
                extinction += weight * bound->optics[channel * count + near_cell];
                emission += weight * bound->optics[(6u + channel) * count + near_cell];
                arriving += weight * bound->radiance[(n * channels + channel) * count + near_cell];
            } else {
                arriving += weight * bound->params->boundary;
            }
            if (bound->params->source_coefficients > 0u) {
                upwind += weight * source(bound, direction, channel, (uint)near_cell);
            }
        }
        if (channel == 0u || bound->params->grey == 0u) {
            tau = (bound->optics[channel * count + cell] + extinction) * (0.5f * way.length);
            piece = segment(tau);
        }
        float light = piece.x * arriving;
        if (bound->params->source_coefficients > 0u) {
            float own = source(bound, direction, channel, (uint)cell);
            light += own * (tau * piece.y) + (upwind - own) * leaning(tau, piece);
        }
        if (bound->params->emits == 1u) {
            light += piece.y * (0.5f * way.length) * (bound->optics[(6u + channel) * count + cell] + emission);
        }
        bound->radiance[(n * channels + channel) * count + cell] = light;
    }
}

// The integral of s exp(-s) from 0 to tau over tau, what of a source at Y arrives where that at X is zero: by its series
// where tau is small.
float leaning(float tau, float2 piece) {
    if (tau < 0.05f) {
        return (((tau * (-1.0f / 30.0f) + 1.0f / 8.0f) * tau - 1.0f / 3.0f) * tau + 0.5f) * tau;
    }
    return piece.y - piece.x;
}

// Whether a surface stands between a cell and its neighbour so many cells on.
bool obstructs(const Bound *bound, size_t cell, int x, int y, int z) {
    return ((bound->obstructed[cell] >> (uint)((z + 1) * 9 + (y + 1) * 3 + x + 1)) & 1u) == 1u;
}

// The source function of a cell.
float source(const Bound *bound, uint direction, uint channel, uint cell) {
    uint4 cells = bound->params->cells;
    size_t count = (size_t)cells.x * cells.y * cells.z;
    float sum = 0.0f;
    uint coefficients = bound->params->source_coefficients;
    for (uint k = 0u; k < coefficients; k++) {
        float moment = bound->sources[(k * bound->params->channels + channel) * count + cell];
        sum += bound->source_weights[direction * coefficients + k] * moment;
    }
    return sum * bound->optics[(3u + channel) * count + cell];
}

// A coefficient of a cell's moments: what the batches before left, and the `taken` directions of this one from `first` on.
void gather(const Bound *bound, uint item, uint first, uint taken) {
    uint4 cells = bound->params->cells;
    uint count = cells.x * cells.y * cells.z;
    uint cell = item % count;
    uint k = item / count;
    uint coefficients = bound->params->coefficients;
    if (k >= coefficients) {
        return;
    }
    uint own = bound->params->channels;
    uint of = bound->params->weight_channels;
    uint channels = max(own, of);
    for (uint c = 0u; c < channels; c++) {
        size_t place = bound->params->planar == 1u ? (size_t)(k * channels + c) * count + cell
                                                   : ((size_t)cell * coefficients + k) * channels + c;
        float sum = first > 0u ? bound->moments[place] : 0.0f;
        for (uint n = 0u; n < taken; n++) {
            float weight = bound->weights[((first + n) * coefficients + k) * of + min(c, of - 1u)];
            sum += weight * bound->radiance[(size_t)(n * own + min(c, own - 1u)) * count + cell];
        }
        bound->moments[place] = sum;
    }
}
