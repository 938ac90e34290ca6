// Light that is scattered as by a surface across the density's gradient.

// The unit normal away from what is denser, at a point of index space: central differences over a voxel either way. Zero where
// the density is level.
F3 normal(const Bound *bound, F3 at) {
    int3 size = convert_int3(bound->params->dims.xyz);
    F3 high = f3(sample_density(bound, f3(at.x + 1.0f, at.y, at.z), size, 0),
                 sample_density(bound, f3(at.x, at.y + 1.0f, at.z), size, 0),
                 sample_density(bound, f3(at.x, at.y, at.z + 1.0f), size, 0));
    F3 low = f3(sample_density(bound, f3(at.x - 1.0f, at.y, at.z), size, 0),
                sample_density(bound, f3(at.x, at.y - 1.0f, at.z), size, 0),
                sample_density(bound, f3(at.x, at.y, at.z - 1.0f), size, 0));
    F3 rise = sub3(high, low);
    F3 sum = add3(high, low);
    F steepest = greater(greater(fabs(rise.x), fabs(rise.y)), fabs(rise.z));
    M level = steepest <= PHONG_FLAT * greater(greater(sum.x, sum.y), sum.z);
    F3 g = f3(rise.x / steepest, rise.y / steepest, rise.z / steepest);
    F3 away = add3(add3(scale3(all3(bound->params->index_x.xyz), -g.x), scale3(all3(bound->params->index_y.xyz), -g.y)),
                   scale3(all3(bound->params->index_z.xyz), -g.z));
    F size_of = sqrt(dot3(away, away));
    return pick3(level, all3((float3)(0.0f)), f3(away.x / size_of, away.y / size_of, away.z / size_of));
}

// The share of light from `toward` that goes on along -d, per steradian and unit of irradiance.
F phong(const Bound *bound, F3 away, F3 toward, F3 d) {
    float4 k = bound->params->phong;
    F zero = (F)(0.0f);
    F facing = dot3(away, toward);
    F cosine = dot3(d, sub3(toward, scale3(away, 2.0f * facing)));
    F gloss = (k.w + 2.0f) / (2.0f * PI) * pow(lesser(greater(cosine, zero), (F)(1.0f)), (F)(k.w));
    F surface = facing * (k.y / PI + (cosine > zero ? gloss : zero) * k.z);
    return k.x / (4.0f * PI) + (facing > zero ? surface : zero);
}
