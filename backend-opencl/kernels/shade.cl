// `shade`: light that surfaces send to the eye. One work-item a sub-pixel position.

float3 reflected(const Bound *bound, uint i, float3 d, float4 hit, float4 facet);
float3 material(const Bound *bound, uint number, float3 d, float3 toward, float3 normal);
uint4 blocks(const Bound *bound);

void run_shade(const Bound *bound) {
    size_t n = number();
    if (n >= bound->launch->count) {
        return;
    }
    uint unit = bound->launch->start + (uint)n;
    float4 hit = bound->hits[2u * (size_t)unit];
    float4 facet = bound->hits[2u * (size_t)unit + 1u];
    float4 back = (float4)(0.0f, 0.0f, 0.0f, INFINITY);
    if (has_background) {
        back = bound->background[unit / bound->params->samples];
    }
    if (fmin(hit.w, FAR) >= fmin(back.w, FAR)) {
        bound->surface[unit] = back;
        return;
    }
    float3 sum = (float3)(0.0f);
    if (bound->params->light_begin > 0u) {
        // What the passes before left.
        sum = bound->surface[unit].xyz;
    }
    float3 d = view(bound, unit);
    for (uint i = bound->params->light_begin; i < bound->params->light_end; i++) {
        sum += reflected(bound, i, d, hit, facet);
    }
    bound->surface[unit] = (float4)(sum, hit.w);
}

// What a surface sends back along `d` of light `i`. `hit`: its normal and distance; `facet`: the triangle's normal and
// material.
float3 reflected(const Bound *bound, uint i, float3 d, float4 hit, float4 facet) {
    Incident light = incident(bound, i, d, hit.w);
    float facing = dot(hit.xyz, light.toward);
    if (light.falloff <= 0.0f || facing <= 0.0f || dot(facet.xyz, light.toward) <= 0.0f) {
        return (float3)(0.0f);
    }
    if (bound->params->visibility == 1u) {
        float margin = MESH_MARGIN * bound->params->mesh_eye.w;
        Line free = line(bound->params->mesh_eye.xyz + hit.w * d + margin * facet.xyz, light.toward);
        if (blocked(bound, &free, light.distance - margin)) {
            return (float3)(0.0f);
        }
    }
    float3 size = convert_float3(bound->params->dims.xyz);
    float3 at = bound->params->eye.xyz + hit.w * to_index(bound, d);
    Ray way = through(at, to_index(bound, light.toward), size, light.distance, bound->params->step);
    float3 transmittance = exp(-column(bound, &way, blocks(bound)) * bound->params->extinction.xyz);
    float3 arriving = light.falloff * facing * bound->lights[i].power.xyz * transmittance;
    return arriving * material(bound, convert_uint(facet.w), d, light.toward, hit.xyz);
}

// The share of light from `toward` that a material of this normal sends back along `d`, per steradian.
float3 material(const Bound *bound, uint number, float3 d, float3 toward, float3 normal) {
    MaterialRecord of = bound->materials[number];
    float3 mirrored = 2.0f * dot(normal, toward) * normal - toward;
    float cosine = -dot(mirrored, d);
    float lobe = 0.0f;
    if (cosine > 0.0f) {
        lobe = (of.diffuse.w + 2.0f) / (2.0f * PI) * pow(min(cosine, 1.0f), of.diffuse.w);
    }
    return of.diffuse.xyz / PI + lobe * of.specular.xyz;
}

// Blocks of the occupancy along x, y, z and their side; side 0 where there is none.
uint4 blocks(const Bound *bound) {
    return has_occupancy ? bound->params->occupancy_cells : (uint4)(0u);
}
