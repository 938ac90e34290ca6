// Light that is scattered as by a surface across the density's gradient.

// The unit normal away from what is denser, at a point of index space: central differences over a voxel either way. Zero where
// the density is level.
float3 normal(const Bound *bound, float3 at) {
    int3 size = convert_int3(bound->params->dims.xyz);
    float3 x = (float3)(1.0f, 0.0f, 0.0f);
    float3 y = (float3)(0.0f, 1.0f, 0.0f);
    float3 z = (float3)(0.0f, 0.0f, 1.0f);
    float3 high = (float3)(sample_density(bound, at + x, size, 0), sample_density(bound, at + y, size, 0),
                           sample_density(bound, at + z, size, 0));
    float3 low = (float3)(sample_density(bound, at - x, size, 0), sample_density(bound, at - y, size, 0),
                          sample_density(bound, at - z, size, 0));
    float3 rise = high - low;
    float3 sum = high + low;
    float steepest = fmax(fmax(fabs(rise.x), fabs(rise.y)), fabs(rise.z));
    if (steepest <= PHONG_FLAT * fmax(fmax(sum.x, sum.y), sum.z)) {
        return (float3)(0.0f);
    }
    float3 g = rise / steepest;
    float3 away = -(g.x * bound->params->index_x.xyz + g.y * bound->params->index_y.xyz +
                    g.z * bound->params->index_z.xyz);
    return away / sqrt(dot(away, away));
}

// The share of light from `toward` that goes on along -d, per steradian and unit of irradiance.
float phong(const Bound *bound, float3 away, float3 toward, float3 d) {
    float4 k = bound->params->phong;
    float ambient = k.x / (4.0f * PI);
    float facing = dot(away, toward);
    if (facing <= 0.0f) {
        return ambient;
    }
    float cosine = dot(d, toward - 2.0f * facing * away);
    float gloss = 0.0f;
    if (cosine > 0.0f) {
        gloss = (k.w + 2.0f) / (2.0f * PI) * pow(min(cosine, 1.0f), k.w);
    }
    return ambient + facing * (k.y / PI + gloss * k.z);
}
