// `inject`: the density of a medium that is described instead of sampled. One work-item a column of a brick's samples
// along z, or a brick where packets are wide.

// Packets of a work-item, and samples of the brick from each to the next; the brick's samples are x fastest, then y.
#define PACKETS (WIDTH == 1 ? BRICK : BRICK * BRICK * BRICK / WIDTH)
#define STRIDE (WIDTH == 1 ? BRICK * BRICK : WIDTH)

F3 place(const Bound *bound, U x, U y, U z);
void gaussians(const Bound *bound, uint3 at, uint3 brick, F *sums);

void run_inject(const Bound *bound) {
    size_t n = number() / WIDTH;
    uint lane = 0u;
    if (WIDTH == 1) {
        lane = (uint)(n % (BRICK * BRICK));
        n /= BRICK * BRICK;
    }
    if (n >= bound->launch->count) {
        return;
    }
    uint unit = bound->launch->start + (uint)n;
    uint4 bricks = bound->params->bricks;
    uint3 brick = (uint3)(unit % bricks.x, unit / bricks.x % bricks.y, unit / bricks.x / bricks.y);
    uint3 at = brick * BRICK + (uint3)(lane % BRICK, lane / BRICK, 0u);
    uint4 dims = bound->params->dims;
    if (at.x >= dims.x || at.y >= dims.y) {
        return;
    }
    F sums[PACKETS];
    for (uint k = 0u; k < PACKETS; k++) {
        sums[k] = (F)(0.0f);
        if (dims.w == INJECT_GAUSSIANS && bound->params->list_begin > 0u) {
            // What the passes before left.
            U sample = k * STRIDE + LANE;
            U x = min(at.x + sample % BRICK, (U)(dims.x - 1u));
            U y = min(at.y + sample / BRICK % BRICK, (U)(dims.y - 1u));
            U z = min(at.z + sample / BRICK / BRICK, (U)(dims.z - 1u));
            sums[k] = fetch(bound->injected, (z * dims.y + y) * dims.x + x);
        }
    }
    if (dims.w == INJECT_GAUSSIANS) {
        gaussians(bound, at, brick, sums);
    }
    for (uint k = 0u; k < PACKETS; k++) {
        U sample = k * STRIDE + LANE;
        U x = at.x + sample % BRICK;
        U y = at.y + sample / BRICK % BRICK;
        U z = at.z + sample / BRICK / BRICK;
        M kept = (x < dims.x) & (y < dims.y) & (z < dims.z);
        x = min(x, (U)(dims.x - 1u));
        y = min(y, (U)(dims.y - 1u));
        z = min(z, (U)(dims.z - 1u));
        F value = sums[k];
        if (dims.w != INJECT_GAUSSIANS) {
            F3 p = place(bound, x, y, z);
            value = (F)(bound->params->density);
            if (dims.w == INJECT_HEIGHT_FOG) {
                value *= exp_negative(-greater(p.y, (F)(0.0f)));
            } else {
                if (has_base) {
                    value = texels_base(bound, place_base(bound, as_signed(x), as_signed(y), as_signed(z), convert_int3(dims.xyz), 0));
                }
                value *= noise_factor(p, bound->params->octaves, bound->params->seed, bound->params->contrast);
            }
        }
        int marked[WIDTH];
        unpack(kept, marked);
        put(lesser(value, (F)(DENSITY_MAX)), bound->injected, (z * dims.y + y) * dims.x + x, marked);
    }
}

// The places of samples.
F3 place(const Bound *bound, U x, U y, U z) {
    F3 i = f3(to_float(x), to_float(y), to_float(z));
    float4 along_x = bound->params->place_x;
    float4 along_y = bound->params->place_y;
    float4 along_z = bound->params->place_z;
    return f3(dot3(all3(along_x.xyz), i) + along_x.w, dot3(all3(along_y.xyz), i) + along_y.w,
              dot3(all3(along_z.xyz), i) + along_z.w);
}

// e^-q, or 0 from INJECT_FAR on.
F bell(F q) {
    return q < INJECT_FAR ? exp_negative(-q) : (F)(0.0f);
}

#if WIDTH > 1

// Eight lanes, again in all of a packet's eights; and one value in each of its eights.
#if WIDTH == 8
#define EIGHTS(v) (v)
#define EACH_EIGHT(of, n) ((F)((of)[n]))
#else
#define EIGHTS(v) ((F)(v, v))
#define EACH_EIGHT(of, n) ((F)((float8)((of)[2u * (n)]), (float8)((of)[2u * (n) + 1u])))
#endif

// Packets of a slice of a brick, and of its 24 places along x, y and z.
#define SLICE (BRICK * BRICK / WIDTH)
#define SIDES ((3u * BRICK + WIDTH - 1u) / WIDTH)
// Gaussians whose sums over a slice of the brick stay in registers.
#define TOGETHER 8u

// Where the lattice's edges stand at right angles, the exponential of a sum of three squares along them is a product of
// three, and a brick takes 24 exponentials for a Gaussian in place of 512.
void separate(const Bound *bound, uint3 at, uint begin, uint end, F *sums) {
    float3 x = (float3)(bound->params->place_x.x, bound->params->place_y.x, bound->params->place_z.x);
    float3 y = (float3)(bound->params->place_x.y, bound->params->place_y.y, bound->params->place_z.y);
    float3 z = (float3)(bound->params->place_x.z, bound->params->place_y.z, bound->params->place_z.z);
    float3 edge = (float3)(sqrt(dot(x, x)), sqrt(dot(y, y)), sqrt(dot(z, z)));
    float4 i = (float4)(convert_float3(at), 1.0f);
    float3 corner =
        (float3)(dot(bound->params->place_x, i), dot(bound->params->place_y, i), dot(bound->params->place_z, i));
    // Metres from the brick's first sample, along x, then y, then z.
    F metres[SIDES];
    M first[SIDES];
    M second[SIDES];
    for (uint n = 0u; n < SIDES; n++) {
        U side = n * WIDTH + LANE;
        first[n] = side < BRICK;
        second[n] = side < 2u * BRICK;
        metres[n] = to_float(side % BRICK) * (first[n] ? (F)(edge.x) : second[n] ? (F)(edge.y) : (F)(edge.z));
    }
    F across[TOGETHER];
    F down[TOGETHER][SLICE];
    float up[TOGETHER][BRICK];
    for (uint from = begin; from < end; from += TOGETHER) {
        uint some = min(end - from, TOGETHER);
        for (uint g = 0u; g < some; g++) {
            BlobRecord blob = bound->blobs[bound->list[from + g]];
            float3 d = corner - blob.center.xyz;
            float3 t = (float3)(dot(d, x), dot(d, y), dot(d, z)) / edge;
            float bells[SIDES * WIDTH];
            for (uint n = 0u; n < SIDES; n++) {
                F q = metres[n] + (first[n] ? (F)(t.x) : second[n] ? (F)(t.y) : (F)(t.z));
                unpack(bell(q * q * blob.center.w), bells + n * WIDTH);
            }
            across[g] = EIGHTS(vload8(0, bells)) * blob.amplitude.x;
            for (uint n = 0u; n < SLICE; n++) {
                down[g][n] = EACH_EIGHT(bells + BRICK, n);
            }
            vstore8(vload8(0, bells + 2u * BRICK), 0, up[g]);
        }
        for (uint k = 0u; k < BRICK; k++) {
            F slice[SLICE];
#pragma unroll
            for (uint n = 0u; n < SLICE; n++) {
                slice[n] = sums[k * SLICE + n];
            }
            for (uint g = 0u; g < some; g++) {
                if (up[g][k] == 0.0f) {
                    continue;
                }
                F level = across[g] * up[g][k];
#pragma unroll
                for (uint n = 0u; n < SLICE; n++) {
                    slice[n] += level * down[g][n];
                }
            }
#pragma unroll
            for (uint n = 0u; n < SLICE; n++) {
                sums[k * SLICE + n] = slice[n];
            }
        }
    }
}

#endif

// Adds the Gaussians of a brick's list to the samples of a work-item.
void gaussians(const Bound *bound, uint3 at, uint3 brick, F *sums) {
    uint3 bin = brick >> bound->params->bricks.w;
    uint number = (bin.z * bound->params->bins.y + bin.y) * bound->params->bins.x + bin.x;
    uint start = bound->starts[number];
    uint entries = bound->starts[number + 1u] - start;
    uint begin = start + min(bound->params->list_begin, entries);
    uint end = start + min(bound->params->list_end, entries);
#if WIDTH > 1
    if (bound->params->bins.w > 0u) {
        separate(bound, at, begin, end, sums);
        return;
    }
#endif
    for (uint k = 0u; k < PACKETS; k++) {
        U sample = k * STRIDE + LANE;
        F3 p = place(bound, at.x + sample % BRICK, at.y + sample / BRICK % BRICK, at.z + sample / BRICK / BRICK);
        F sum = sums[k];
        for (uint entry = begin; entry < end; entry++) {
            BlobRecord blob = bound->blobs[bound->list[entry]];
            F3 d = sub3(p, all3(blob.center.xyz));
            sum += bell(dot3(d, d) * blob.center.w) * blob.amplitude.x;
        }
        sums[k] = sum;
    }
}
