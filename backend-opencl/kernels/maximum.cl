// Sum and maximum of the field FIELD over a coarse cell; instantiated for each field of `reduce`.

// Columns of voxels whose sums are held at once.
#define COLUMNS 64

float share(float begin, float end, int i);
F shares(float begin, float end, int i);
float probe_FIELD(const Bound *bound, uint3 cell);

// The sum of the voxels, each weighed by the part of it that lies in the cell, and the maximum over every voxel that a lookup
// in the widened cell can touch; a maximum over probes touches no more than the cell. Packets add up columns
// of texels side by side, up the rows of a block, then block by block, so that sums are those of every layout.
float2 gathered_FIELD(const Bound *bound, uint3 cell) {
    float3 side = bound->params->cell.xyz;
    float3 margin = bound->params->cell.w * side + REDUCE_SLACK;
    uint3 dims = bound->params->dims.xyz;
    int3 size = convert_int3(dims);
    float3 begin = convert_float3(cell) * side;
    float3 end = convert_float3(cell + 1u) * side;
    float3 last = convert_float3(size - 1);
    int3 lo = convert_int3(clamp(floor(begin - 0.5f - margin), (float3)(0.0f), last));
    int3 hi = convert_int3(clamp(floor(end - 0.5f + margin) + 1.0f, (float3)(0.0f), last));
    if (bound->params->coarse.w > 0u) {
        lo = convert_int3(min(convert_uint3_sat(floor(begin)), dims - 1u));
        hi = convert_int3(clamp(convert_uint3_sat(ceil(end)), (uint3)(1u), dims) - 1u);
    }
    float sum = 0.0f;
    F most = (F)(0.0f);
    // What holds zero alone adds nothing.
    if (uniform_FIELD(bound, lo, hi, size) && texel_FIELD(bound, lo, size, 0) == 0.0f) {
        return (float2)(0.0f);
    }
#if WIDTH == 1
    // As memory lies.
    for (int k = lo.z; k <= hi.z; k++) {
        for (int j = lo.y; j <= hi.y; j++) {
            float share_of_row = share(begin.y, end.y, j) * share(begin.z, end.z, k);
            for (int i = lo.x; i <= hi.x; i++) {
                int zeros = empty_FIELD(bound, (int3)(i, j, k), size);
                if (zeros > 0) {
                    i += zeros - 1;
                    continue;
                }
                float texel = texel_FIELD(bound, (int3)(i, j, k), size, 0);
                sum += share(begin.x, end.x, i) * share_of_row * texel;
                most = greater(texel, most);
            }
        }
    }
#else
    int block = (int)TEXEL_BLOCK;
    float columns[COLUMNS + WIDTH];
    int first = lo.x;
    while (first <= hi.x) {
        int to = min(hi.x, first + (int)COLUMNS - 1);
        int i = first;
        while (i <= to) {
            int count = min(to - i + 1, stretch_FIELD(i));
            F sums = (F)(0.0f);
            int below = lo.z;
            while (below <= hi.z) {
                int above = min(hi.z, below | (block - 1));
                int near = lo.y;
                while (near <= hi.y) {
                    int far = min(hi.y, near | (block - 1));
                    bool empty = empty_FIELD(bound, (int3)(i, near, below), size) > 0;
                    float shares_of_rows[TEXEL_BLOCK];
                    for (int j = near; j <= far; j++) {
                        shares_of_rows[j - near] = share(begin.y, end.y, j);
                    }
                    for (int k = below; k <= above && !empty; k++) {
                        float share_of_slice = share(begin.z, end.z, k);
                        for (int j = near; j <= far; j++) {
                            F texels = run_FIELD(bound, (int3)(i, j, k), count, size);
                            most = greater(texels, most);
                            sums += texels * (shares_of_rows[j - near] * share_of_slice);
                        }
                    }
                    near = far + 1;
                }
                below = above + 1;
            }
            unpack(sums, columns + (i - first));
            i += count;
        }
        for (i = first; i <= to; i += (int)WIDTH) {
            // Nothing is held past the last.
            F weights = shares(begin.x, min(end.x, convert_float(to + 1)), i);
            sum += total(weights > 0.0f ? pack(columns + (i - first)) * weights : (F)(0.0f));
        }
        first = to + 1;
    }
#endif
    return (float2)(sum, largest_lane(most));
}

// The maximum of n^3 lookups, evenly spread over the cell.
float probe_FIELD(const Bound *bound, uint3 cell) {
    uint n = bound->params->coarse.w;
    int3 size = convert_int3(bound->params->dims.xyz);
    float3 side = bound->params->cell.xyz;
    F most = (F)(0.0f);
    for (uint row = 0u; row < n * n; row++) {
        float y = (convert_float(cell.y) + (convert_float(row % n) + 0.5f) / convert_float(n)) * side.y - 0.5f;
        float z = (convert_float(cell.z) + (convert_float(row / n) + 0.5f) / convert_float(n)) * side.z - 0.5f;
        for (uint i = 0u; i < n; i += WIDTH) {
            // Lanes past the last repeat it.
            U probe = elements(i, n);
            F x = (convert_float(cell.x) + (to_float(probe) + 0.5f) / convert_float(n)) * side.x - 0.5f;
            most = greater(sample_FIELD(bound, f3(x, (F)(y), (F)(z)), size, 0), most);
        }
    }
    return largest_lane(most);
}
