// `upsample`: the picture from a film of the medium alone. One work-item a packet of pixels, ACROSS by DOWN; those of
// a block of BLOCK x BLOCK pixels are in a row.

#define ACROSS (WIDTH == 1 ? 1u : BLOCK)
#define DOWN (WIDTH / ACROSS)

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

Small small(const Bound *bound, uint scale, bool rims);
Medium mixed(Medium fine, Medium whole);
Medium around(const Bound *bound, U x, U y, Small small, F distance);
INLINE U first(Small small, U n);
INLINE U stands(Small small, U n, uint size);
INLINE F part(U n, U a, U b);
INLINE F fit(F a, F b);
INLINE F alike(const Bound *bound, U x, U y, Small small, U sx, U sy);
INLINE F4 held(const Bound *bound, Small small, U sx, U sy, uint half_of_it);
INLINE void add(const Bound *bound, Medium *sum, Small small, U sx, U sy, F weight, M marched);
F3 behind(const Bound *bound, U x, U y, U pixel);
INLINE F4 seen(const Bound *bound, U pixel, uint s);

void run_upsample(const Bound *bound) {
    size_t n = number() / (BLOCK * BLOCK);
    uint first = (uint)(number() % (BLOCK * BLOCK)) / WIDTH;
    if (n >= bound->launch->count) {
        return;
    }
    uint block = bound->launch->start + (uint)n;
    uint full_width = bound->params->full_width;
    uint full_height = bound->params->full_height;
    uint across = (full_width + BLOCK - 1u) / BLOCK;
    U x = block % across * BLOCK + first % (BLOCK / ACROSS) * ACROSS + LANE % ACROSS;
    U y = block / across * BLOCK + first / (BLOCK / ACROSS) * DOWN + LANE / ACROSS;
    M kept = (x < full_width) & (y < full_height);
    if (!any_lane(kept)) {
        return;
    }
    // Lanes past the edge repeat the last pixels, and keep nothing.
    x = x < full_width ? x : (U)(full_width - 1u);
    y = y < full_height ? y : (U)(full_height - 1u);
    U pixel = y * full_width + x;
    F distance = lesser(seen(bound, pixel, 0u).w, (F)(FAR));
    Medium found;
    if (has_rims) {
        found = around(bound, x, y, small(bound, bound->params->scale / 2u, true), distance);
        if (any_lane(found.marched < 1.0f)) {
            found = mixed(found, around(bound, x, y, small(bound, bound->params->scale, false), distance));
        }
    } else {
        found = around(bound, x, y, small(bound, bound->params->scale, false), distance);
    }
    F3 radiance = f3(found.radiance.x / found.weight, found.radiance.y / found.weight, found.radiance.z / found.weight);
    F3 through = f3(found.transmittance.x / found.weight, found.transmittance.y / found.weight,
                    found.transmittance.z / found.weight);
    F depth = found.stopped > 0.0f ? found.stopped_at / found.stopped : (F)(INFINITY);
    F3 color = add3(radiance, mul3(through, behind(bound, x, y, pixel)));
    // Exactly nothing where all came through, also where a product and a sum are rounded as one.
    F all = 3.0f * found.weight;
    F alpha = (all - (found.transmittance.x + found.transmittance.y + found.transmittance.z)) / all;
    put_eight(bound->film, pixel, kept, color, alpha, through, depth);
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
Medium around(const Bound *bound, U x, U y, Small small, F distance) {
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
        add(bound, &sum, small, sx, sy, share * fits, marched);
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
    add(bound, &single, small, at_x, at_y, (F)(1.0f), lone);
    sum.radiance = pick3(lone, single.radiance, sum.radiance);
    sum.transmittance = pick3(lone, single.transmittance, sum.transmittance);
    sum.stopped = lone ? single.stopped : sum.stopped;
    sum.stopped_at = lone ? single.stopped_at : sum.stopped_at;
    sum.weight = lone ? single.weight : sum.weight;
    return sum;
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

// Adds pixels of a small film, in lanes where they were marched.
INLINE void add(const Bound *bound, Medium *sum, Small small, U sx, U sy, F weight, M marched) {
    F4 light = held(bound, small, sx, sy, 0u);
    F4 through = held(bound, small, sx, sy, 1u);
    F3 radiance = add3(sum->radiance, scale3(f3(light.x, light.y, light.z), weight));
    F3 transmittance = add3(sum->transmittance, scale3(f3(through.x, through.y, through.z), weight));
    sum->radiance = pick3(marched, radiance, sum->radiance);
    sum->transmittance = pick3(marched, transmittance, sum->transmittance);
    sum->weight = marched ? sum->weight + weight : sum->weight;
    M deep = marched & (through.w < FAR);
    F stops = (3.0f - (through.x + through.y + through.z)) * (1.0f / 3.0f);
    F stopped = weight * greater(stops, (F)(1e-9f));
    sum->stopped = deep ? sum->stopped + stopped : sum->stopped;
    sum->stopped_at = deep ? sum->stopped_at + stopped * through.w : sum->stopped_at;
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
