// `upsample`: the picture from a film of the medium alone. One work-item a pixel; those of a block of BLOCK x BLOCK pixels
// are in a row.

// Sums over pixels of a small film.
typedef struct {
    float3 radiance;
    float3 transmittance;
    // Light stopped, and the same weighed with its distance.
    float stopped;
    float stopped_at;
    float weight;
    // How much of the nearest pixels, by their bilinear weights, was marched.
    float marched;
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
Medium around(const Bound *bound, uint x, uint y, Small small, float distance);
uint first(Small small, uint n);
uint stands(Small small, uint n, uint size);
float part(uint n, uint a, uint b);
float fit(float a, float b);
float alike(const Bound *bound, uint x, uint y, Small small, uint sx, uint sy);
float4 held(const Bound *bound, Small small, uint sx, uint sy, uint half_of_it);
void add(const Bound *bound, Medium *sum, Small small, uint sx, uint sy, float weight);
float3 behind(const Bound *bound, uint x, uint y, size_t pixel);
float4 seen(const Bound *bound, size_t pixel, uint s);

void run_upsample(const Bound *bound) {
    size_t n = number() / (BLOCK * BLOCK);
    uint lane = (uint)(number() % (BLOCK * BLOCK));
    if (n >= bound->launch->count) {
        return;
    }
    uint block = bound->launch->start + (uint)n;
    uint full_width = bound->params->full_width;
    uint across = (full_width + BLOCK - 1u) / BLOCK;
    uint x = block % across * BLOCK + lane % BLOCK;
    uint y = block / across * BLOCK + lane / BLOCK;
    if (x >= full_width || y >= bound->params->full_height) {
        return;
    }
    size_t pixel = (size_t)y * full_width + x;
    float distance = fmin(seen(bound, pixel, 0u).w, FAR);
    Medium found;
    found.marched = 0.0f;
    if (has_rims) {
        found = around(bound, x, y, small(bound, bound->params->scale / 2u, true), distance);
    }
    if (found.marched < 1.0f) {
        found = mixed(found, around(bound, x, y, small(bound, bound->params->scale, false), distance));
    }
    float3 radiance = found.radiance / found.weight;
    float3 transmittance = found.transmittance / found.weight;
    float depth = found.stopped > 0.0f ? found.stopped_at / found.stopped : INFINITY;
    float3 color = radiance + transmittance * behind(bound, x, y, pixel);
    // Exactly nothing where all came through, also where a product and a sum are rounded as one.
    float all = 3.0f * found.weight;
    float alpha = (all - (found.transmittance.x + found.transmittance.y + found.transmittance.z)) / all;
    bound->film[2u * pixel] = (float4)(color, alpha);
    bound->film[2u * pixel + 1u] = (float4)(transmittance, depth);
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
    if (fine.marched == 0.0f) {
        return whole;
    }
    float a = fine.marched / fine.weight;
    float b = (1.0f - fine.marched) / whole.weight;
    Medium sum;
    sum.radiance = a * fine.radiance + b * whole.radiance;
    sum.transmittance = a * fine.transmittance + b * whole.transmittance;
    sum.stopped = a * fine.stopped + b * whole.stopped;
    sum.stopped_at = a * fine.stopped_at + b * whole.stopped_at;
    sum.weight = 1.0f;
    sum.marched = 1.0f;
    return sum;
}

// The medium in a pixel whose surface is so far away; nothing where none of the nearest pixels was marched.
Medium around(const Bound *bound, uint x, uint y, Small small, float distance) {
    uint full_width = bound->params->full_width;
    uint full_height = bound->params->full_height;
    uint x0 = first(small, x);
    uint y0 = first(small, y);
    uint x1 = min(x0 + 1u, small.width - 1u);
    uint y1 = min(y0 + 1u, small.height - 1u);
    float fx = part(x, stands(small, x0, full_width), stands(small, x1, full_width));
    float fy = part(y, stands(small, y0, full_height), stands(small, y1, full_height));
    Medium none;
    none.radiance = (float3)(0.0f);
    none.transmittance = (float3)(0.0f);
    none.stopped = 0.0f;
    none.stopped_at = 0.0f;
    none.weight = 0.0f;
    none.marched = 0.0f;
    Medium sum = none;
    for (uint i = 0u; i < 4u; i++) {
        bool right = i % 2u == 1u;
        bool below = i / 2u == 1u;
        uint sx = right ? x1 : x0;
        uint sy = below ? y1 : y0;
        float share = (right ? fx : 1.0f - fx) * (below ? fy : 1.0f - fy);
        float other = held(bound, small, sx, sy, 0u).w;
        if (other < 0.0f) {
            continue;
        }
        sum.marched += share;
        add(bound, &sum, small, sx, sy, share * fit(distance, other) * alike(bound, x, y, small, sx, sy));
    }
    float marched = sum.marched;
    if (marched == 0.0f || sum.weight >= UPSAMPLE_FIT) {
        return sum;
    }
    float least = FAR;
    uint2 at = (uint2)(x0, y0);
    for (uint i = 0u; i < 16u; i++) {
        uint sx = min(max(x0 + i % 4u, 1u) - 1u, small.width - 1u);
        uint sy = min(max(y0 + i / 4u, 1u) - 1u, small.height - 1u);
        float other = held(bound, small, sx, sy, 0u).w;
        float apart = fabs(1.0f / clamp(distance, 1e-6f, 1e30f) - 1.0f / clamp(other, 1e-6f, 1e30f));
        if (other >= 0.0f && apart < least) {
            least = apart;
            at = (uint2)(sx, sy);
        }
    }
    sum = none;
    sum.marched = marched;
    add(bound, &sum, small, at.x, at.y, 1.0f);
    return sum;
}

// The pixel of a small film at or before pixel `n` of the full picture, along one side; the first one before it.
uint first(Small small, uint n) {
    return (max(n, small.scale / 2u) - small.scale / 2u) / small.scale;
}

// Where pixel `n` of a small film stands among `size` pixels.
uint stands(Small small, uint n, uint size) {
    return min(n * small.scale + small.scale / 2u, size - 1u);
}

// How far `n` is on its way from `a` to `b`.
float part(uint n, uint a, uint b) {
    if (n <= a || b <= a) {
        return 0.0f;
    }
    return convert_float(n - a) / convert_float(b - a);
}

// How well surfaces of two distances fit.
float fit(float a, float b) {
    // Distances count up to 1e30: what comes of larger ones is subnormal, which processors are slow at.
    float nearer = 1.0f - fmin(fmin(a, b), 1e30f) / clamp(fmax(a, b), 1e-30f, 1e30f);
    return clamp(2.0f - nearer / UPSAMPLE_NEAR, 0.0f, 1.0f);
}

// How well the normals in a pixel and in one of a small film fit.
float alike(const Bound *bound, uint x, uint y, Small small, uint sx, uint sy) {
    if (!has_normals) {
        return 1.0f;
    }
    size_t width = bound->params->full_width;
    uint each = bound->params->normals_each;
    size_t other = stands(small, sy, bound->params->full_height) * width + stands(small, sx, (uint)width);
    float3 here = bound->normals[(y * width + x) * each].xyz;
    float3 there = bound->normals[other * each].xyz;
    if (dot(here, here) == 0.0f || dot(there, there) == 0.0f) {
        return 1.0f;
    }
    return clamp((dot(here, there) - UPSAMPLE_COSINE) / (1.0f - UPSAMPLE_COSINE), 0.0f, 1.0f);
}

// One of the two vectors of a pixel of a small film.
float4 held(const Bound *bound, Small small, uint sx, uint sy, uint half_of_it) {
    size_t at = 2u * ((size_t)sy * small.width + sx) + half_of_it;
    if (has_rims && small.rims) {
        return bound->rims[at];
    }
    return bound->medium[at];
}

// Adds a pixel of a small film.
void add(const Bound *bound, Medium *sum, Small small, uint sx, uint sy, float weight) {
    float4 light = held(bound, small, sx, sy, 0u);
    float4 through = held(bound, small, sx, sy, 1u);
    sum->radiance += weight * light.xyz;
    sum->transmittance += weight * through.xyz;
    sum->weight += weight;
    if (through.w < FAR) {
        float stopped = weight * fmax((3.0f - (through.x + through.y + through.z)) * (1.0f / 3.0f), 1e-9f);
        sum->stopped += stopped;
        sum->stopped_at += stopped * through.w;
    }
}

// The mean radiance behind the medium over the sub-pixel positions of a pixel.
float3 behind(const Bound *bound, uint x, uint y, size_t pixel) {
    float3 sum = (float3)(0.0f);
    uint samples = bound->params->samples;
    for (uint s = 0u; s < samples; s++) {
        float4 before = seen(bound, pixel, s);
        if (before.w < FAR) {
            sum += before.xyz;
        } else if (has_environment) {
            float a =
                (convert_float(x) + bound->subpixels[2u * s]) * (2.0f / convert_float(bound->params->full_width)) - 1.0f;
            float b = 1.0f
                - (convert_float(y) + bound->subpixels[2u * s + 1u]) * (2.0f / convert_float(bound->params->full_height));
            float3 toward = a * bound->params->right.xyz + b * bound->params->up.xyz + bound->params->forward.xyz;
            sum += sky(bound, toward / sqrt(dot(toward, toward)));
        }
    }
    return sum * (1.0f / convert_float(samples));
}

// The surface behind a sub-pixel position of a pixel; as far as can be without any.
float4 seen(const Bound *bound, size_t pixel, uint s) {
    if (!has_surface) {
        return (float4)(0.0f, 0.0f, 0.0f, FAR);
    }
    uint each = bound->params->surface_samples;
    return bound->surface[pixel * each + s % each];
}
