// `accumulate`: the mean of the medium over the pictures of a sequence. One work-item a pixel; those of a block of BLOCK x
// BLOCK pixels are in a row.

// What is kept of a pixel.
typedef struct {
    float3 radiance;
    // Pictures that it is the mean of.
    float count;
    float3 transmittance;
    float depth;
    float surface;
} Past;

Past recalled(const Bound *bound, size_t at);
Past followed(const Bound *bound, uint x, uint y, float4 light, float4 through);
Past clamped(const Bound *bound, Past past, uint x, uint y);
bool finite(float v);
float fit(float a, float b);
float stopped(float3 transmittance, float depth);

void run_accumulate(const Bound *bound) {
    size_t n = number() / (BLOCK * BLOCK);
    uint lane = (uint)(number() % (BLOCK * BLOCK));
    if (n >= bound->launch->count) {
        return;
    }
    uint block = bound->launch->start + (uint)n;
    uint width = bound->params->width;
    uint across = (width + BLOCK - 1u) / BLOCK;
    uint x = block % across * BLOCK + lane % BLOCK;
    uint y = block / across * BLOCK + lane / BLOCK;
    if (x >= width || y >= bound->params->height) {
        return;
    }
    size_t at = (size_t)y * width + x;
    float4 light = bound->medium[2u * at];
    float4 through = bound->medium[2u * at + 1u];
    Past past;
    if (bound->params->mode == ACCUMULATE_MOVED) {
        past = clamped(bound, followed(bound, x, y, light, through), x, y);
    } else {
        past = recalled(bound, at);
    }
    float count = fmin(past.count, bound->params->most);
    Past now = past;
    if (bound->params->mode != ACCUMULATE_AGAIN || past.count == 0.0f) {
        float share = 1.0f / (count + 1.0f);
        now.radiance = past.radiance + (light.xyz - past.radiance) * share;
        now.transmittance = past.transmittance + (through.xyz - past.transmittance) * share;
        float before = count * stopped(past.transmittance, past.depth);
        float added = stopped(through.xyz, through.w);
        now.depth = INFINITY;
        if (before > 0.0f && added > 0.0f) {
            now.depth = past.depth + (through.w - past.depth) * (added / (before + added));
        } else if (added > 0.0f) {
            now.depth = through.w;
        } else if (before > 0.0f) {
            now.depth = past.depth;
        }
        now.count = count + 1.0f;
    }
    if (light.w < 0.0f) {
        // It was not marched.
        now.radiance = light.xyz;
        now.count = 0.0f;
        now.transmittance = through.xyz;
        now.depth = through.w;
    }
    bound->next[3u * at] = (float4)(now.radiance, now.count);
    bound->next[3u * at + 1u] = (float4)(now.transmittance, now.depth);
    bound->next[3u * at + 2u] = (float4)(light.w, 0.0f, 0.0f, 0.0f);
    bound->mean[2u * at] = (float4)(now.radiance, light.w);
    bound->mean[2u * at + 1u] = (float4)(now.transmittance, now.depth);
}

// The history of a pixel; none where it is not finite.
Past recalled(const Bound *bound, size_t at) {
    float4 a = bound->last[3u * at];
    float4 b = bound->last[3u * at + 1u];
    Past past;
    past.radiance = a.xyz;
    past.count = a.w;
    past.transmittance = b.xyz;
    past.depth = b.w;
    past.surface = bound->last[3u * at + 2u].x;
    if (!(finite(a.x) && finite(a.y) && finite(a.z) && finite(a.w) && finite(b.x) && finite(b.y) && finite(b.z))) {
        past.radiance = (float3)(0.0f);
        past.count = 0.0f;
        past.transmittance = (float3)(0.0f);
        past.depth = INFINITY;
        past.surface = FAR;
    }
    return past;
}

// The history of what a pixel shows, where the last view saw it.
Past followed(const Bound *bound, uint x, uint y, float4 light, float4 through) {
    Past none;
    none.radiance = (float3)(0.0f);
    none.count = 0.0f;
    none.transmittance = (float3)(0.0f);
    none.depth = INFINITY;
    none.surface = FAR;
    uint scale = bound->params->scale;
    float width = convert_float(bound->params->full_width);
    float height = convert_float(bound->params->full_height);
    uint fx = min(x * scale + scale / 2u, bound->params->full_width - 1u);
    uint fy = min(y * scale + scale / 2u, bound->params->full_height - 1u);
    float a = (convert_float(fx) + 0.5f) * (2.0f / width) - 1.0f;
    float b = 1.0f - (convert_float(fy) + 0.5f) * (2.0f / height);
    float3 toward = a * bound->params->right.xyz + b * bound->params->up.xyz + bound->params->forward.xyz;
    float3 direction = toward / sqrt(dot(toward, toward));
    float3 moved = bound->params->moved.xyz;
    float3 point = direction;
    if (through.w < FAR) {
        point = moved + through.w * direction;
    } else if (light.w < FAR) {
        point = moved + light.w * direction;
    }
    float ahead = dot(point, bound->params->last_forward.xyz);
    if (ahead <= 0.0f) {
        return none;
    }
    float px = (dot(point, bound->params->last_right.xyz) / ahead + 1.0f) * (0.5f * width) - 0.5f;
    float py = (1.0f - dot(point, bound->params->last_up.xyz) / ahead) * (0.5f * height) - 0.5f;
    float u = (px - convert_float(scale / 2u)) / convert_float(scale);
    float v = (py - convert_float(scale / 2u)) / convert_float(scale);
    float right = convert_float(bound->params->width) - 1.0f;
    float bottom = convert_float(bound->params->height) - 1.0f;
    if (!(u >= -0.5f && u <= right + 0.5f && v >= -0.5f && v <= bottom + 0.5f)) {
        return none;
    }
    float surface = FAR;
    if (light.w < FAR) {
        float3 seen = moved + light.w * direction;
        surface = sqrt(dot(seen, seen));
    }
    Past sum = none;
    sum.depth = 0.0f;
    float weights = 0.0f;
    float stops = 0.0f;
    for (uint i = 0u; i < 4u; i++) {
        float column = floor(u) + convert_float(i % 2u);
        float row = floor(v) + convert_float(i / 2u);
        float share = (1.0f - fabs(u - column)) * (1.0f - fabs(v - row));
        uint place = convert_uint(clamp(column, 0.0f, right));
        Past past = recalled(bound, (size_t)convert_uint(clamp(row, 0.0f, bottom)) * bound->params->width + place);
        float weight = past.count > 0.0f ? share * fit(past.surface, surface) : 0.0f;
        sum.radiance += weight * past.radiance;
        sum.transmittance += weight * past.transmittance;
        sum.count += weight * past.count;
        weights += weight;
        float stop = weight * stopped(past.transmittance, past.depth);
        if (stop > 0.0f) {
            stops += stop;
            sum.depth += stop * past.depth;
        }
    }
    if (weights < ACCUMULATE_FIT) {
        return none;
    }
    sum.radiance = sum.radiance / weights;
    sum.transmittance = sum.transmittance / weights;
    sum.count = sum.count / weights;
    sum.depth = stops > 0.0f ? sum.depth / stops : INFINITY;
    sum.surface = surface;
    return sum;
}

// A history within the range of the pixels around.
Past clamped(const Bound *bound, Past past, uint x, uint y) {
    float3 least = (float3)(FAR);
    float3 most = (float3)(-FAR);
    float3 thinnest = (float3)(FAR);
    float3 thickest = (float3)(-FAR);
    for (uint i = 0u; i < 9u; i++) {
        uint column = min(max(x + i % 3u, 1u) - 1u, bound->params->width - 1u);
        uint row = min(max(y + i / 3u, 1u) - 1u, bound->params->height - 1u);
        size_t at = 2u * ((size_t)row * bound->params->width + column);
        if (bound->medium[at].w < 0.0f) {
            continue;
        }
        least = fmin(least, bound->medium[at].xyz);
        most = fmax(most, bound->medium[at].xyz);
        thinnest = fmin(thinnest, bound->medium[at + 1u].xyz);
        thickest = fmax(thickest, bound->medium[at + 1u].xyz);
    }
    past.radiance = fmin(fmax(past.radiance, least), most);
    past.transmittance = fmin(fmax(past.transmittance, thinnest), thickest);
    return past;
}

// Whether a value is neither infinite nor no number.
bool finite(float v) {
    return (as_uint(v) & 0x7f800000u) != 0x7f800000u;
}

// How well surfaces of two distances fit.
float fit(float a, float b) {
    // Distances count up to 1e30: what comes of larger ones is subnormal, which processors are slow at.
    float nearer = 1.0f - fmin(fmin(a, b), 1e30f) / clamp(fmax(a, b), 1e-30f, 1e30f);
    return clamp(2.0f - nearer / ACCUMULATE_NEAR, 0.0f, 1.0f);
}

// What is stopped, with which a depth is weighed; nothing where there is no depth.
float stopped(float3 transmittance, float depth) {
    if (!finite(depth)) {
        return 0.0f;
    }
    return fmax((3.0f - (transmittance.x + transmittance.y + transmittance.z)) * (1.0f / 3.0f), 1e-9f);
}
