// `inject`: the density of a medium that is described instead of sampled. One work-item a column of a brick's samples
// along z.

float3 place(const Bound *bound, uint3 at);
void gaussians(const Bound *bound, uint3 at, uint3 brick, float *sums);

void run_inject(const Bound *bound) {
    size_t n = number();
    uint lane = (uint)(n % (BRICK * BRICK));
    if (n / (BRICK * BRICK) >= bound->launch->count) {
        return;
    }
    uint unit = bound->launch->start + (uint)(n / (BRICK * BRICK));
    uint4 bricks = bound->params->bricks;
    uint3 brick = (uint3)(unit % bricks.x, unit / bricks.x % bricks.y, unit / bricks.x / bricks.y);
    uint3 at = brick * BRICK + (uint3)(lane % BRICK, lane / BRICK, 0u);
    uint4 dims = bound->params->dims;
    if (at.x >= dims.x || at.y >= dims.y) {
        return;
    }
    uint high = min(BRICK, dims.z - at.z);
    size_t slice = (size_t)dims.x * dims.y;
    size_t first = at.z * slice + (size_t)at.y * dims.x + at.x;
    if (dims.w == INJECT_GAUSSIANS) {
        float sums[BRICK];
        for (uint k = 0; k < BRICK; k++) {
            // What the passes before left.
            sums[k] = bound->params->list_begin > 0u && k < high ? bound->injected[first + k * slice] : 0.0f;
        }
        gaussians(bound, at, brick, sums);
        for (uint k = 0; k < high; k++) {
            bound->injected[first + k * slice] = fmin(sums[k], DENSITY_MAX);
        }
        return;
    }
    for (uint k = 0; k < high; k++) {
        float3 p = place(bound, at + (uint3)(0u, 0u, k));
        float value = bound->params->density;
        if (dims.w == INJECT_HEIGHT_FOG) {
            value *= exp(-fmax(p.y, 0.0f));
        } else {
            if (has_base) {
                value = texel_base(bound, convert_int3(at + (uint3)(0u, 0u, k)), convert_int3(dims.xyz), 0);
            }
            value *= noise_factor(p, bound->params->octaves, bound->params->seed, bound->params->contrast);
        }
        bound->injected[first + k * slice] = fmin(value, DENSITY_MAX);
    }
}

// The place of a sample.
float3 place(const Bound *bound, uint3 at) {
    float4 i = (float4)(convert_float3(at), 1.0f);
    return (float3)(dot(bound->params->place_x, i), dot(bound->params->place_y, i), dot(bound->params->place_z, i));
}

// e^-q, or 0 from INJECT_FAR on.
float bell(float q) {
    return q < INJECT_FAR ? exp(-q) : 0.0f;
}

// Adds the Gaussians of a brick's list to a column of samples.
void gaussians(const Bound *bound, uint3 at, uint3 brick, float *sums) {
    uint3 bin = brick >> bound->params->bricks.w;
    uint number = (bin.z * bound->params->bins.y + bin.y) * bound->params->bins.x + bin.x;
    uint start = bound->starts[number];
    uint entries = bound->starts[number + 1u] - start;
    float3 first = place(bound, at);
    float3 up = (float3)(bound->params->place_x.z, bound->params->place_y.z, bound->params->place_z.z);
    for (uint i = bound->params->list_begin; i < min(bound->params->list_end, entries); i++) {
        BlobRecord blob = bound->blobs[bound->list[start + i]];
        float3 from_center = first - blob.center.xyz;
        for (uint k = 0; k < BRICK; k++) {
            float3 d = from_center + convert_float(k) * up;
            sums[k] += bell(dot(d, d) * blob.center.w) * blob.amplitude.x;
        }
    }
}
