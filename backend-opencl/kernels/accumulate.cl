// `accumulate`: the mean of the medium over the pictures of a sequence. One work-item a packet of pixels, ACROSS by
// DOWN; those of a block of BLOCK x BLOCK pixels are in a row.

#define ACROSS (WIDTH == 1 ? 1u : BLOCK)
#define DOWN (WIDTH / ACROSS)

// What is kept of each lane's pixel.
typedef struct {
    F3 radiance;
    // Pictures that it is the mean of.
    F count;
    F3 transmittance;
    F depth;
    F surface;
} Past;

INLINE Past recalled(const Bound *bound, U at);
INLINE Past followed(const Bound *bound, U x, U y, F distance, F depth);
INLINE Past clamped(const Bound *bound, Past past, uint x, uint y);
INLINE M finite(F v);
INLINE F fit(F a, F b);
INLINE F stopped(F3 transmittance, F depth);

void run_accumulate(const Bound *bound) {
    size_t n = number() / (BLOCK * BLOCK);
    uint first = (uint)(number() % (BLOCK * BLOCK)) / WIDTH;
    if (n >= bound->launch->count) {
        return;
    }
    uint block = bound->launch->start + (uint)n;
    uint width = bound->params->width;
    uint height = bound->params->height;
    uint across = (width + BLOCK - 1u) / BLOCK;
    uint left = block % across * BLOCK + first % (BLOCK / ACROSS) * ACROSS;
    uint top = block / across * BLOCK + first / (BLOCK / ACROSS) * DOWN;
    U x = left + LANE % ACROSS;
    U y = top + LANE / ACROSS;
    M kept = (x < width) & (y < height);
    if (!any_lane(kept)) {
        return;
    }
    // Lanes past the edge repeat the last pixels, and keep nothing.
    x = x < width ? x : (U)(width - 1u);
    y = y < height ? y : (U)(height - 1u);
    U at = y * width + x;
    F4 light = fetch_four(bound->medium, 2u * at);
    F4 through = fetch_four(bound->medium, 2u * at + 1u);
    Past past;
    if (bound->params->mode == ACCUMULATE_MOVED) {
        past = clamped(bound, followed(bound, x, y, light.w, through.w), left, top);
    } else {
        past = recalled(bound, at);
    }
    F3 shines = f3(light.x, light.y, light.z);
    F3 passes = f3(through.x, through.y, through.z);
    F count = lesser(past.count, (F)(bound->params->most));
    F share = 1.0f / (count + 1.0f);
    F before = count * stopped(past.transmittance, past.depth);
    F added = stopped(passes, through.w);
    F both = past.depth + (through.w - past.depth) * (added / (before + added));
    F either = added > 0.0f ? through.w : (before > 0.0f ? past.depth : (F)(INFINITY));
    Past now;
    now.radiance = add3(past.radiance, scale3(sub3(shines, past.radiance), share));
    now.transmittance = add3(past.transmittance, scale3(sub3(passes, past.transmittance), share));
    now.depth = ((before > 0.0f) & (added > 0.0f)) ? both : either;
    now.count = count + 1.0f;
    if (bound->params->mode == ACCUMULATE_AGAIN) {
        M again = past.count > 0.0f;
        now.radiance = pick3(again, past.radiance, now.radiance);
        now.transmittance = pick3(again, past.transmittance, now.transmittance);
        now.depth = again ? past.depth : now.depth;
        now.count = again ? past.count : now.count;
    }
    // It was not marched.
    M bare = light.w < 0.0f;
    now.radiance = pick3(bare, shines, now.radiance);
    now.count = bare ? (F)(0.0f) : now.count;
    now.transmittance = pick3(bare, passes, now.transmittance);
    now.depth = bare ? through.w : now.depth;
    put_four(bound->next, 3u * at, kept, f4(now.radiance, now.count));
    put_four(bound->next, 3u * at + 1u, kept, f4(now.transmittance, now.depth));
    put_four(bound->next, 3u * at + 2u, kept, f4(f3(light.w, (F)(0.0f), (F)(0.0f)), (F)(0.0f)));
    put_eight(bound->mean, at, kept, now.radiance, light.w, now.transmittance, now.depth);
}

// The history of pixels; none where it is not finite.
INLINE Past recalled(const Bound *bound, U at) {
    F4 a = fetch_four(bound->last, 3u * at);
    F4 b = fetch_four(bound->last, 3u * at + 1u);
    F surface = fetch((__global const float *)bound->last, 12u * at + 8u);
    M have = finite(a.x) & finite(a.y) & finite(a.z) & finite(a.w) & finite(b.x) & finite(b.y) & finite(b.z);
    F3 none = all3((float3)(0.0f));
    Past past;
    past.radiance = pick3(have, f3(a.x, a.y, a.z), none);
    past.count = have ? a.w : none.x;
    past.transmittance = pick3(have, f3(b.x, b.y, b.z), none);
    past.depth = have ? b.w : (F)(INFINITY);
    past.surface = have ? surface : (F)(FAR);
    return past;
}

// The history of what pixels show, where the last view saw it.
INLINE Past followed(const Bound *bound, U x, U y, F distance, F depth) {
    F zero = (F)(0.0f);
    Past none;
    none.radiance = f3(zero, zero, zero);
    none.count = zero;
    none.transmittance = none.radiance;
    none.depth = (F)(INFINITY);
    none.surface = (F)(FAR);
    uint scale = bound->params->scale;
    uint full_width = bound->params->full_width;
    uint full_height = bound->params->full_height;
    float width = convert_float(full_width);
    float height = convert_float(full_height);
    U fx = x * scale + scale / 2u;
    U fy = y * scale + scale / 2u;
    fx = fx < full_width ? fx : (U)(full_width - 1u);
    fy = fy < full_height ? fy : (U)(full_height - 1u);
    F a = (to_float(fx) + 0.5f) * (2.0f / width) - 1.0f;
    F b = 1.0f - (to_float(fy) + 0.5f) * (2.0f / height);
    F3 toward = add3(add3(scale3(all3(bound->params->right.xyz), a), scale3(all3(bound->params->up.xyz), b)),
                     all3(bound->params->forward.xyz));
    F size = sqrt(dot3(toward, toward));
    F3 direction = f3(toward.x / size, toward.y / size, toward.z / size);
    F3 moved = all3(bound->params->moved.xyz);
    M deep = depth < FAR;
    M near = distance < FAR;
    F3 seen = add3(moved, scale3(direction, deep ? depth : distance));
    F3 point = pick3(deep | near, seen, direction);
    F ahead = dot3(point, all3(bound->params->last_forward.xyz));
    F px = (dot3(point, all3(bound->params->last_right.xyz)) / ahead + 1.0f) * (0.5f * width) - 0.5f;
    F py = (1.0f - dot3(point, all3(bound->params->last_up.xyz)) / ahead) * (0.5f * height) - 0.5f;
    F u = (px - convert_float(scale / 2u)) / convert_float(scale);
    F v = (py - convert_float(scale / 2u)) / convert_float(scale);
    float right = convert_float(bound->params->width) - 1.0f;
    float bottom = convert_float(bound->params->height) - 1.0f;
    M within = (ahead > 0.0f) & (u >= -0.5f) & (u <= right + 0.5f) & (v >= -0.5f) & (v <= bottom + 0.5f);
    if (!any_lane(within)) {
        return none;
    }
    F3 there = add3(moved, scale3(direction, distance));
    F surface = near ? sqrt(dot3(there, there)) : (F)(FAR);
    Past sum = none;
    sum.depth = zero;
    F weights = zero;
    F stops = zero;
    for (uint i = 0u; i < 4u; i++) {
        F column = floored(u) + convert_float(i % 2u);
        F row = floored(v) + convert_float(i / 2u);
        F share = (1.0f - fabs(u - column)) * (1.0f - fabs(v - row));
        column = lesser(greater(column, zero), (F)(right));
        row = lesser(greater(row, zero), (F)(bottom));
        Past past = recalled(bound, to_uint(row) * bound->params->width + to_uint(column));
        F weight = past.count > 0.0f ? share * fit(past.surface, surface) : zero;
        sum.radiance = add3(sum.radiance, scale3(past.radiance, weight));
        sum.transmittance = add3(sum.transmittance, scale3(past.transmittance, weight));
        sum.count += weight * past.count;
        weights += weight;
        F stop = weight * stopped(past.transmittance, past.depth);
        M stands = stop > 0.0f;
        stops = stands ? stops + stop : stops;
        sum.depth = stands ? sum.depth + stop * past.depth : sum.depth;
    }
    M found = within & (weights >= ACCUMULATE_FIT);
    F3 radiance = f3(sum.radiance.x / weights, sum.radiance.y / weights, sum.radiance.z / weights);
    F3 through = f3(sum.transmittance.x / weights, sum.transmittance.y / weights, sum.transmittance.z / weights);
    Past mean;
    mean.radiance = pick3(found, radiance, none.radiance);
    mean.transmittance = pick3(found, through, none.transmittance);
    mean.count = found ? sum.count / weights : zero;
    mean.depth = (found & (stops > 0.0f)) ? sum.depth / stops : none.depth;
    mean.surface = found ? surface : none.surface;
    return mean;
}

// A history within the range of the pixels around; the packet's first is at `x`, `y`.
INLINE Past clamped(const Bound *bound, Past past, uint x, uint y) {
    uint width = bound->params->width;
    uint height = bound->params->height;
    float8 lows[WIDTH];
    float8 highs[WIDTH];
    // The range of each column around each row of the packet, of which two share the pixels of two rows.
    float8 lowest[DOWN][ACROSS + 2u];
    float8 highest[DOWN][ACROSS + 2u];
    for (uint i = 0u; i < ACROSS + 2u; i++) {
        uint column = min(max(x + i, 1u) - 1u, width - 1u);
        float8 low[DOWN];
        float8 high[DOWN];
#pragma unroll
        for (uint j = 0u; j < DOWN; j++) {
            low[j] = (float8)(FAR);
            high[j] = (float8)(-FAR);
        }
#pragma unroll
        for (uint k = 0u; k < DOWN + 2u; k++) {
            uint row = min(max(y + k, 1u) - 1u, height - 1u);
            size_t at = 2u * ((size_t)row * width + column);
            float8 pixel = (float8)(bound->medium[at], bound->medium[at + 1u]);
            if (pixel.s3 < 0.0f) {
                continue;
            }
#pragma unroll
            for (uint j = 0u; j < DOWN; j++) {
                if (k >= j && k < j + 3u) {
                    low[j] = pixel < low[j] ? pixel : low[j];
                    high[j] = pixel > high[j] ? pixel : high[j];
                }
            }
        }
#pragma unroll
        for (uint j = 0u; j < DOWN; j++) {
            lowest[j][i] = low[j];
            highest[j][i] = high[j];
        }
    }
    for (uint j = 0u; j < DOWN; j++) {
        for (uint i = 0u; i < ACROSS; i++) {
            float8 low = lowest[j][i] < lowest[j][i + 1u] ? lowest[j][i] : lowest[j][i + 1u];
            float8 high = highest[j][i] > highest[j][i + 1u] ? highest[j][i] : highest[j][i + 1u];
            lows[j * ACROSS + i] = low < lowest[j][i + 2u] ? low : lowest[j][i + 2u];
            highs[j * ACROSS + i] = high > highest[j][i + 2u] ? high : highest[j][i + 2u];
        }
    }
    F4 least = fetch_four((const float4 *)lows, 2u * LANE);
    F4 most = fetch_four((const float4 *)highs, 2u * LANE);
    F4 thinnest = fetch_four((const float4 *)lows, 2u * LANE + 1u);
    F4 thickest = fetch_four((const float4 *)highs, 2u * LANE + 1u);
    past.radiance.x = lesser(greater(past.radiance.x, least.x), most.x);
    past.radiance.y = lesser(greater(past.radiance.y, least.y), most.y);
    past.radiance.z = lesser(greater(past.radiance.z, least.z), most.z);
    past.transmittance.x = lesser(greater(past.transmittance.x, thinnest.x), thickest.x);
    past.transmittance.y = lesser(greater(past.transmittance.y, thinnest.y), thickest.y);
    past.transmittance.z = lesser(greater(past.transmittance.z, thinnest.z), thickest.z);
    return past;
}

// Whether values are neither infinite nor no numbers.
INLINE M finite(F v) {
    return (as_int_lanes(v) & 0x7f800000) != 0x7f800000;
}

// How well surfaces of two distances fit.
INLINE F fit(F a, F b) {
    // Distances count up to 1e30: what comes of larger ones is subnormal, which processors are slow at.
    F far = (F)(1e30f);
    F nearer = 1.0f - lesser(lesser(a, b), far) / lesser(greater(greater(a, b), (F)(1e-30f)), far);
    return lesser(greater(2.0f - nearer / ACCUMULATE_NEAR, (F)(0.0f)), (F)(1.0f));
}

// What is stopped, with which a depth is weighed; nothing where there is no depth.
INLINE F stopped(F3 transmittance, F depth) {
    F stops = (3.0f - (transmittance.x + transmittance.y + transmittance.z)) * (1.0f / 3.0f);
    return finite(depth) ? greater(stops, (F)(1e-9f)) : (F)(0.0f);
}
