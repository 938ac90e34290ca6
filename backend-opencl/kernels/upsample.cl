// `upsample`: the picture from a film of the medium alone. One work-item a pixel, those of a block of BLOCK x BLOCK pixels in a
// row; or, where packets are vectors, a block, of which a packet is ACROSS by DOWN pixels.

#define ACROSS (WIDTH == 1 ? 1u : BLOCK)
#define DOWN (WIDTH / ACROSS)
// Packets of a work-item.
#define TAKEN (WIDTH == 1 ? 1u : BLOCK / DOWN)

// Sums over pixels of a small film, of each lane.
typedef struct {
    F3 radiance;
    F3 transmittance;
    // Light stopped, and the same weighed with its distance.
    F stopped;
    F stopped_at;
    F weight;
    // How much of the nearest pixels, by their bilinear weights, was marched.
    F marched;
} Medium;

// A film smaller than the picture: the one near rims, or the one of everything.
typedef struct {
    uint scale;
    uint width;
    uint height;
    bool rims;
} Small;

// What is summed, of pixels of a small film: radiance, transmittance, light stopped, and the same weighed with its distance; and how
// far their surfaces are.
#define SUMS 8
#define HELD 9

#if WIDTH > 1

// The columns of a block, one behind the other.
typedef float8 Line;

// Where the pixels of a block fall among those of a small film, along one side.
typedef struct {
    // The pixel of the small film at or before each, or the first one, and the one behind it.
    uint before[BLOCK];
    uint behind[BLOCK];
    // How far each is on its way between them.
    float parts[BLOCK];
} Side;

// The pixels of a small film that a block looks at.
typedef struct {
    Small small;
    Side across;
    Side down;
    // By rows from the first on that is looked at: the pixels at or before the columns of the block, and those behind them.
    Line rows[BLOCK + 2][2][HELD];
    // One over the distances of the surfaces four by four around, once they were asked for: of rows from the one before the first on,
    // the four columns from the one before each of the block; infinite where nothing was marched.
    bool asked;
    Line inverses[BLOCK + 4][4];
} Patch;

// What packets hold of a row, and of the next one where they take two.
#if WIDTH == 8
#define OF_ROWS_OF(kind, a, b) (a)
#else
#define OF_ROWS_OF(kind, a, b) ((kind)(a, b))
#endif
#define OF_ROWS(a, b) OF_ROWS_OF(F, a, b)

INLINE Side side(Small small, uint count, uint begin, uint size);
void level(Patch *patch);
Medium between(const Patch *patch, uint row);
void nearest(const Bound *bound, Patch *patch, uint row, F distance, F *sums);
void inverses(const Bound *bound, Patch *patch);
INLINE U neighbor(U at, uint n, uint size);

#else

typedef Small Patch;

#endif

Small small(const Bound *bound, uint scale, bool rims);
void patch(const Bound *bound, Patch *patch, Small small, uint left, uint top);
Medium mixed(Medium fine, Medium whole);
Medium around(const Bound *bound, U x, U y, uint row, Patch *patch, F distance);
INLINE void sums_of(F4 light, F4 through, F *sums);
INLINE U first(Small small, U n);
INLINE U stands(Small small, U n, uint size);
INLINE F part(U n, U a, U b);
INLINE F fit(F a, F b);
INLINE F alike(const Bound *bound, U x, U y, Small small, U sx, U sy);
INLINE F4 held(const Bound *bound, Small small, U sx, U sy, uint half_of_it);
INLINE void add(Medium *sum, const F *sums, F weight);
F3 behind(const Bound *bound, U x, U y, U pixel);
INLINE F4 seen(const Bound *bound, U pixel, uint s);

void run_upsample(const Bound *bound) {
    size_t begin = get_global_id(0) * (TAKEN * WIDTH);
    size_t n = begin / (BLOCK * BLOCK);
    if (n >= bound->launch->count) {
        return;
    }
    uint block = bound->launch->start + (uint)n;
    uint full_width = bound->params->full_width;
    uint full_height = bound->params->full_height;
    uint across = (full_width + BLOCK - 1u) / BLOCK;
    uint left = block % across * BLOCK;
    uint top = block / across * BLOCK;
    Patch rims;
    Patch all;
    if (has_rims) {
        patch(bound, &rims, small(bound, bound->params->scale / 2u, true), left, top);
    }
    patch(bound, &all, small(bound, bound->params->scale, false), left, top);
#if WIDTH > 1
    // Where nothing is in front of anything, all pixels fit.
    bool fits = !has_rims & !has_surface;
    if (fits) {
        level(&all);
    }
#endif
    for (uint taken = 0u; taken < TAKEN; taken++) {
        uint first = (uint)(begin % (BLOCK * BLOCK)) / WIDTH + taken;
        uint row = first / (BLOCK / ACROSS) * DOWN;
        U x = left + first % (BLOCK / ACROSS) * ACROSS + LANE % ACROSS;
        U y = top + row + LANE / ACROSS;
        M kept = (x < full_width) & (y < full_height);
        if (!any_lane(kept)) {
            return;
        }
        // Lanes past the edge repeat the last pixels, and keep nothing.
        x = x < full_width ? x : (U)(full_width - 1u);
        y = y < full_height ? y : (U)(full_height - 1u);
        U pixel = y * full_width + x;
        Medium found;
#if WIDTH > 1
        if (fits) {
            found = between(&all, row);
        } else
#endif
        {
            F distance = lesser(seen(bound, pixel, 0u).w, (F)(FAR));
            if (has_rims) {
                found = around(bound, x, y, row, &rims, distance);
                if (any_lane(found.marched < 1.0f)) {
                    found = mixed(found, around(bound, x, y, row, &all, distance));
                }
            } else {
                found = around(bound, x, y, row, &all, distance);
            }
        }
        F3 radiance = f3(found.radiance.x / found.weight, found.radiance.y / found.weight, found.radiance.z / found.weight);
        F3 through = f3(found.transmittance.x / found.weight, found.transmittance.y / found.weight,
                        found.transmittance.z / found.weight);
        F depth = found.stopped > 0.0f ? found.stopped_at / found.stopped : (F)(INFINITY);
        F3 color = add3(radiance, mul3(through, behind(bound, x, y, pixel)));
        // Exactly nothing where all came through, also where a product and a sum are rounded as one.
        F whole = 3.0f * found.weight;
        F alpha = (whole - (found.transmittance.x + found.transmittance.y + found.transmittance.z)) / whole;
        put_eight(bound->film, pixel, kept, color, alpha, through, depth);
    }
}

// A film of so many pixels of the picture along each side of one of its own.
Small small(const Bound *bound, uint scale, bool rims) {
    Small found;
    found.scale = scale;
    found.width = (bound->params->full_width + scale - 1u) / scale;
    found.height = (bound->params->full_height + scale - 1u) / scale;
    found.rims = rims;
    return found;
}

#if WIDTH > 1

// The pixels of a small film that the block looks at which begins at `left`, `top`.
void patch(const Bound *bound, Patch *patch, Small small, uint left, uint top) {
    patch->small = small;
    patch->across = side(small, small.width, left, bound->params->full_width);
    patch->down = side(small, small.height, top, bound->params->full_height);
    patch->asked = false;
    uint8 before = vload8(0, patch->across.before);
    uint8 behind = vload8(0, patch->across.behind);
    uint top_row = patch->down.before[0];
    uint count = patch->down.behind[BLOCK - 1u] - top_row + 1u;
    for (uint j = 0u; j < count; j++) {
        U row = (U)(top_row + j);
        F sums[HELD];
#if WIDTH == 8
        for (uint i = 0u; i < 2u; i++) {
            U column = i == 0u ? before : behind;
            F4 light = held(bound, small, column, row, 0u);
            sums_of(light, held(bound, small, column, row, 1u), sums);
#pragma unroll
            for (uint c = 0u; c < HELD; c++) {
                patch->rows[j][i][c] = sums[c];
            }
        }
#else
        U column = (U)(before, behind);
        F4 light = held(bound, small, column, row, 0u);
        sums_of(light, held(bound, small, column, row, 1u), sums);
#pragma unroll
        for (uint c = 0u; c < HELD; c++) {
            patch->rows[j][0][c] = sums[c].lo;
            patch->rows[j][1][c] = sums[c].hi;
        }
#endif
    }
}

// Of the pixels from `begin` on among `size`, in a film of `count`.
INLINE Side side(Small small, uint count, uint begin, uint size) {
    Side found;
    uint before = small.scale / 2u;
    for (uint n = 0u; n < BLOCK; n++) {
        uint full = min(begin + n, size - 1u);
        uint a = (max(full, before) - before) / small.scale;
        uint b = min(a + 1u, count - 1u);
        uint from = min(a * small.scale + before, size - 1u);
        uint to = min(b * small.scale + before, size - 1u);
        found.before[n] = a;
        found.behind[n] = b;
        found.parts[n] = full > from && to > from ? convert_float(full - from) / convert_float(to - from) : 0.0f;
    }
    return found;
}

// Leaves what is summed at the columns of the block in place of what is before them. Where all pixels fit, weights are those along x
// times those along y.
void level(Patch *patch) {
    Line parts = vload8(0, patch->across.parts);
    uint count = patch->down.behind[BLOCK - 1u] - patch->down.before[0] + 1u;
    for (uint j = 0u; j < count; j++) {
#pragma unroll
        for (uint c = 0u; c < SUMS; c++) {
            Line from = patch->rows[j][0][c];
            patch->rows[j][0][c] = from + (patch->rows[j][1][c] - from) * parts;
        }
    }
}

// What stands in two rows of the patch side by side, of the pixels of a packet from `row` of the block on: at or before them or
// behind them, above them or below.
#define ROWS_AT(below, right, c)                                                                                      \
    OF_ROWS(patch->rows[(below ? side->behind : side->before)[row] - side->before[0]][right][c],                      \
            patch->rows[(below ? side->behind : side->before)[row + DOWN - 1u] - side->before[0]][right][c])

// The medium in the pixels of a packet, from `row` of the block on, between the rows of a level.
Medium between(const Patch *patch, uint row) {
    const Side *side = &patch->down;
    F part = OF_ROWS((Line)(side->parts[row]), (Line)(side->parts[row + DOWN - 1u]));
    F sums[SUMS];
#pragma unroll
    for (uint c = 0u; c < SUMS; c++) {
        F above = ROWS_AT(false, 0, c);
        sums[c] = above + (ROWS_AT(true, 0, c) - above) * part;
    }
    Medium found;
    found.radiance = f3(sums[0], sums[1], sums[2]);
    found.transmittance = f3(sums[3], sums[4], sums[5]);
    found.stopped = sums[6];
    found.stopped_at = sums[7];
    found.weight = found.marched = (F)(1.0f);
    return found;
}

#else

// A pixel looks at its own.
void patch(const Bound *bound, Patch *patch, Small small, uint left, uint top) {
    *patch = small;
}

#endif

// As much of one film as was marched of it, and the rest of another.
Medium mixed(Medium fine, Medium whole) {
    // Of lanes that have nothing of one of them the other is taken as it is.
    M none = fine.marched == 0.0f;
    M all = fine.marched >= 1.0f;
    F one = (F)(1.0f);
    F zero = (F)(0.0f);
    F a = none ? zero : (all ? one : fine.marched / fine.weight);
    F b = none ? one : (all ? zero : (1.0f - fine.marched) / whole.weight);
    Medium sum;
    sum.radiance = add3(scale3(fine.radiance, a), scale3(whole.radiance, b));
    sum.transmittance = add3(scale3(fine.transmittance, a), scale3(whole.transmittance, b));
    sum.stopped = a * fine.stopped + b * whole.stopped;
    sum.stopped_at = a * fine.stopped_at + b * whole.stopped_at;
    sum.weight = none ? whole.weight : (all ? fine.weight : one);
    sum.marched = one;
    return sum;
}

// The medium in pixels whose surfaces are so far away; nothing where none of the nearest pixels was marched.
#if WIDTH > 1

Medium around(const Bound *bound, U x, U y, uint row, Patch *patch, F distance) {
    const Side *side = &patch->down;
    Line along = vload8(0, patch->across.parts);
    F fx = OF_ROWS(along, along);
    F fy = OF_ROWS((Line)(side->parts[row]), (Line)(side->parts[row + DOWN - 1u]));
    F zero = (F)(0.0f);
    Medium sum;
    sum.radiance = sum.transmittance = f3(zero, zero, zero);
    sum.stopped = sum.stopped_at = sum.weight = sum.marched = zero;
#pragma unroll
    for (uint i = 0u; i < 4u; i++) {
        uint right = i % 2u;
        bool below = i / 2u == 1u;
        F sums[HELD];
#pragma unroll
        for (uint c = 0u; c < HELD; c++) {
            sums[c] = ROWS_AT(below, right, c);
        }
        F other = sums[SUMS];
        F share = (right == 1u ? fx : 1.0f - fx) * (below ? fy : 1.0f - fy);
        share = other >= 0.0f ? share : zero;
        sum.marched += share;
        if (has_surface) {
            share = share * fit(distance, other);
        }
        if (has_normals) {
            uint8 column = vload8(0, right == 1u ? patch->across.behind : patch->across.before);
            const uint *lines = below ? side->behind : side->before;
            U sx = OF_ROWS_OF(U, column, column);
            U sy = OF_ROWS_OF(U, (uint8)(lines[row]), (uint8)(lines[row + DOWN - 1u]));
            share = share * alike(bound, x, y, patch->small, sx, sy);
        }
        add(&sum, sums, share);
    }
    M lone = (sum.marched > 0.0f) & (sum.weight < UPSAMPLE_FIT);
    if (any_lane(lone)) {
        F sums[HELD];
        nearest(bound, patch, row, distance, sums);
        sum.radiance = pick3(lone, f3(sums[0], sums[1], sums[2]), sum.radiance);
        sum.transmittance = pick3(lone, f3(sums[3], sums[4], sums[5]), sum.transmittance);
        sum.stopped = lone ? sums[6] : sum.stopped;
        sum.stopped_at = lone ? sums[7] : sum.stopped_at;
        sum.weight = lone ? (F)(1.0f) : sum.weight;
    }
    return sum;
}

// Of the sixteen pixels around, the one whose surface is nearest to that of a pixel.
void nearest(const Bound *bound, Patch *patch, uint row, F distance, F *sums) {
    const Side *side = &patch->down;
    if (!patch->asked) {
        inverses(bound, patch);
        patch->asked = true;
    }
    uint a = side->before[row] - side->before[0];
    uint b = side->before[row + DOWN - 1u] - side->before[0];
    F here = 1.0f / lesser(greater(distance, (F)(1e-6f)), (F)(1e30f));
    F least = (F)(FAR);
    I at = (I)(5);
    for (uint n = 0u; n < 16u; n++) {
        F apart = fabs(here - OF_ROWS(patch->inverses[a + n / 4u][n % 4u], patch->inverses[b + n / 4u][n % 4u]));
        M nearer = apart < least;
        least = nearer ? apart : least;
        at = nearer ? (I)((int)n) : at;
    }
    U n = as_index(at);
    uint8 column = vload8(0, patch->across.before);
    U sx = OF_ROWS_OF(U, column, column) + n % 4u;
    U sy = OF_ROWS_OF(U, (uint8)(side->before[row]), (uint8)(side->before[row + DOWN - 1u])) + n / 4u;
    sx = neighbor(sx, 0u, patch->small.width);
    sy = neighbor(sy, 0u, patch->small.height);
    F4 light = held(bound, patch->small, sx, sy, 0u);
    sums_of(light, held(bound, patch->small, sx, sy, 1u), sums);
}

// One over the distances of the surfaces four by four around the pixels of a block, as a patch keeps them.
void inverses(const Bound *bound, Patch *patch) {
    uint8 column = vload8(0, patch->across.before);
    uint first = patch->down.before[0];
    uint count = patch->down.behind[BLOCK - 1u] - first + 3u;
    for (uint j = 0u; j < count; j++) {
        U row = neighbor((U)(first), j, patch->small.height);
        for (uint n = 0u; n < 4u; n += DOWN) {
#if WIDTH == 8
            U columns = neighbor(column, n, patch->small.width);
#else
            U columns = neighbor((U)(column, column + 1u), n, patch->small.width);
#endif
            F other = held(bound, patch->small, columns, row, 0u).w;
            F inverse = 1.0f / lesser(greater(other, (F)(1e-6f)), (F)(1e30f));
            inverse = other >= 0.0f ? inverse : (F)(INFINITY);
#if WIDTH == 8
            patch->inverses[j][n] = inverse;
#else
            patch->inverses[j][n] = inverse.lo;
            patch->inverses[j][n + 1u] = inverse.hi;
#endif
        }
    }
}

// Of the four pixels around one along a side, from the one before it on, number `n`; not past the first and the last.
INLINE U neighbor(U at, uint n, uint size) {
    return min(max(at + n, (U)(1u)) - 1u, (U)(size - 1u));
}

#else

Medium around(const Bound *bound, U x, U y, uint row, Patch *patch, F distance) {
    Small small = *patch;
    uint full_width = bound->params->full_width;
    uint full_height = bound->params->full_height;
    U x0 = first(small, x);
    U y0 = first(small, y);
    U x1 = x0 + 1u < small.width ? x0 + 1u : (U)(small.width - 1u);
    U y1 = y0 + 1u < small.height ? y0 + 1u : (U)(small.height - 1u);
    F fx = part(x, stands(small, x0, full_width), stands(small, x1, full_width));
    F fy = part(y, stands(small, y0, full_height), stands(small, y1, full_height));
    F zero = (F)(0.0f);
    Medium none;
    none.radiance = f3(zero, zero, zero);
    none.transmittance = none.radiance;
    none.stopped = zero;
    none.stopped_at = zero;
    none.weight = zero;
    none.marched = zero;
    Medium sum = none;
    for (uint i = 0u; i < 4u; i++) {
        bool right = i % 2u == 1u;
        bool below = i / 2u == 1u;
        U sx = right ? x1 : x0;
        U sy = below ? y1 : y0;
        F share = (right ? fx : 1.0f - fx) * (below ? fy : 1.0f - fy);
        F other = held(bound, small, sx, sy, 0u).w;
        M marched = other >= 0.0f;
        sum.marched += marched ? share : zero;
        F fits = has_surface ? fit(distance, other) * alike(bound, x, y, small, sx, sy) : (F)(1.0f);
        F sums[HELD];
        sums_of(held(bound, small, sx, sy, 0u), held(bound, small, sx, sy, 1u), sums);
        add(&sum, sums, marched ? share * fits : zero);
    }
    M lone = (sum.marched > 0.0f) & (sum.weight < UPSAMPLE_FIT);
    if (!any_lane(lone)) {
        return sum;
    }
    F least = (F)(FAR);
    U at_x = x0;
    U at_y = y0;
    for (uint i = 0u; i < 16u; i++) {
        U sx = x0 + i % 4u;
        U sy = y0 + i / 4u;
        sx = sx > 1u ? sx - 1u : (U)(0u);
        sy = sy > 1u ? sy - 1u : (U)(0u);
        sx = sx < small.width ? sx : (U)(small.width - 1u);
        sy = sy < small.height ? sy : (U)(small.height - 1u);
        F other = held(bound, small, sx, sy, 0u).w;
        F nearest = (F)(1e-6f);
        F farthest = (F)(1e30f);
        F here = lesser(greater(distance, nearest), farthest);
        F apart = fabs(1.0f / here - 1.0f / lesser(greater(other, nearest), farthest));
        M nearer = (other >= 0.0f) & (apart < least);
        least = nearer ? apart : least;
        at_x = nearer ? sx : at_x;
        at_y = nearer ? sy : at_y;
    }
    Medium single = none;
    F sums[HELD];
    sums_of(held(bound, small, at_x, at_y, 0u), held(bound, small, at_x, at_y, 1u), sums);
    add(&single, sums, (F)(1.0f));
    sum.radiance = pick3(lone, single.radiance, sum.radiance);
    sum.transmittance = pick3(lone, single.transmittance, sum.transmittance);
    sum.stopped = lone ? single.stopped : sum.stopped;
    sum.stopped_at = lone ? single.stopped_at : sum.stopped_at;
    sum.weight = lone ? single.weight : sum.weight;
    return sum;
}

#endif

// What pixels of a small film add to sums, and how far their surfaces are.
INLINE void sums_of(F4 light, F4 through, F *sums) {
    F stops = (3.0f - (through.x + through.y + through.z)) * (1.0f / 3.0f);
    M deep = through.w < FAR;
    F stopped = deep ? greater(stops, (F)(1e-9f)) : (F)(0.0f);
    sums[0] = light.x;
    sums[1] = light.y;
    sums[2] = light.z;
    sums[3] = through.x;
    sums[4] = through.y;
    sums[5] = through.z;
    sums[6] = stopped;
    sums[7] = deep ? stopped * through.w : (F)(0.0f);
    sums[8] = light.w;
}

// The pixels of a small film at or before pixels `n` of the full picture, along one side; the first one before it.
INLINE U first(Small small, U n) {
    uint before = small.scale / 2u;
    return (n > before ? n - before : (U)(0u)) / small.scale;
}

// Where pixels `n` of a small film stand among `size` pixels.
INLINE U stands(Small small, U n, uint size) {
    U at = n * small.scale + small.scale / 2u;
    return at < size ? at : (U)(size - 1u);
}

// How far `n` is on its way from `a` to `b`.
INLINE F part(U n, U a, U b) {
    return ((n > a) & (b > a)) ? to_float(n - a) / to_float(b - a) : (F)(0.0f);
}

// How well surfaces of two distances fit.
INLINE F fit(F a, F b) {
    // Distances count up to 1e30: what comes of larger ones is subnormal, which processors are slow at.
    F far = (F)(1e30f);
    F nearer = 1.0f - lesser(lesser(a, b), far) / lesser(greater(greater(a, b), (F)(1e-30f)), far);
    return lesser(greater(2.0f - nearer / UPSAMPLE_NEAR, (F)(0.0f)), (F)(1.0f));
}

// How well the normals in pixels and in those of a small film fit.
INLINE F alike(const Bound *bound, U x, U y, Small small, U sx, U sy) {
    if (!has_normals) {
        return (F)(1.0f);
    }
    uint width = bound->params->full_width;
    uint each = bound->params->normals_each;
    U other = stands(small, sy, bound->params->full_height) * width + stands(small, sx, width);
    F4 h = fetch_four(bound->normals, (y * width + x) * each);
    F4 t = fetch_four(bound->normals, other * each);
    F3 here = f3(h.x, h.y, h.z);
    F3 there = f3(t.x, t.y, t.z);
    M bare = (dot3(here, here) == 0.0f) | (dot3(there, there) == 0.0f);
    F cosine = (dot3(here, there) - UPSAMPLE_COSINE) / (1.0f - UPSAMPLE_COSINE);
    return bare ? (F)(1.0f) : lesser(greater(cosine, (F)(0.0f)), (F)(1.0f));
}

// One of the two vectors of pixels of a small film.
INLINE F4 held(const Bound *bound, Small small, U sx, U sy, uint half_of_it) {
    U at = 2u * (sy * small.width + sx) + half_of_it;
    if (has_rims && small.rims) {
        return fetch_four(bound->rims, at);
    }
    return fetch_four(bound->medium, at);
}

// Adds pixels of a small film.
INLINE void add(Medium *sum, const F *sums, F weight) {
    sum->radiance = add3(sum->radiance, scale3(f3(sums[0], sums[1], sums[2]), weight));
    sum->transmittance = add3(sum->transmittance, scale3(f3(sums[3], sums[4], sums[5]), weight));
    sum->stopped += weight * sums[6];
    sum->stopped_at += weight * sums[7];
    sum->weight += weight;
}

// The mean radiance behind the medium over the sub-pixel positions of pixels.
F3 behind(const Bound *bound, U x, U y, U pixel) {
    F3 sum = all3((float3)(0.0f));
    uint samples = bound->params->samples;
    for (uint s = 0u; s < samples; s++) {
        F4 before = seen(bound, pixel, s);
        F3 color = f3(before.x, before.y, before.z);
        M open = before.w >= FAR;
        if (any_lane(open)) {
            F3 sky_color = all3((float3)(0.0f));
            if (has_environment) {
                float width = convert_float(bound->params->full_width);
                float height = convert_float(bound->params->full_height);
                F a = (to_float(x) + bound->subpixels[2u * s]) * (2.0f / width) - 1.0f;
                F b = 1.0f - (to_float(y) + bound->subpixels[2u * s + 1u]) * (2.0f / height);
                F3 aside = scale3(all3(bound->params->right.xyz), a);
                F3 toward = add3(add3(aside, scale3(all3(bound->params->up.xyz), b)), all3(bound->params->forward.xyz));
                F size = sqrt(dot3(toward, toward));
                sky_color = sky(bound, f3(toward.x / size, toward.y / size, toward.z / size));
            }
            color = pick3(open, sky_color, color);
        }
        sum = add3(sum, color);
    }
    return scale3(sum, (F)(1.0f / convert_float(samples)));
}

// The surfaces behind a sub-pixel position of pixels; as far as can be without any.
INLINE F4 seen(const Bound *bound, U pixel, uint s) {
    if (!has_surface) {
        return f4(all3((float3)(0.0f)), (F)(FAR));
    }
    uint each = bound->params->surface_samples;
    return fetch_four(bound->surface, pixel * each + s % each);
}
