// `shade`: light that surfaces send to the eye. One work-item a packet of sub-pixel positions.

F3 reflected(const Bound *bound, uint i, F3 d, F3 normal, F distance, F3 facet, U number, M active);
F3 material(const Bound *bound, U number, F3 d, F3 toward, F3 normal);
uint4 blocks(const Bound *bound);

void run_shade(const Bound *bound) {
    size_t n = number();
    if (n >= bound->launch->count) {
        return;
    }
    U unit = bound->launch->start + elements(n, bound->launch->count);
    int marked[WIDTH];
    unpack(filled(n, bound->launch->count), marked);
    __global float *out = (__global float *)(bound->surface + (bound->launch->start + n));
    // A normal, a distance, a facet's normal and a material.
    __global const float *hits = (__global const float *)bound->hits;
    F3 normal = f3(fetch(hits, 8u * unit), fetch(hits, 8u * unit + 1u), fetch(hits, 8u * unit + 2u));
    F distance = fetch(hits, 8u * unit + 3u);
    F3 facet = f3(fetch(hits, 8u * unit + 4u), fetch(hits, 8u * unit + 5u), fetch(hits, 8u * unit + 6u));
    U number = to_uint(fetch(hits, 8u * unit + 7u));
    F3 back = all3((float3)(0.0f));
    F back_distance = (F)(INFINITY);
    if (has_background) {
        __global const float *background = (__global const float *)bound->background;
        U pixel = unit / bound->params->samples;
        back = f3(fetch(background, 4u * pixel), fetch(background, 4u * pixel + 1u), fetch(background, 4u * pixel + 2u));
        back_distance = fetch(background, 4u * pixel + 3u);
    }
    M hit = lesser(distance, (F)(FAR)) < lesser(back_distance, (F)(FAR));
    F3 sum = all3((float3)(0.0f));
    if (bound->params->light_begin > 0u) {
        // What the passes before left.
        __global const float *before = (__global const float *)bound->surface;
        sum = f3(fetch(before, 4u * unit), fetch(before, 4u * unit + 1u), fetch(before, 4u * unit + 2u));
    }
    if (any_lane(hit)) {
        F3 d = view(bound, unit);
        for (uint i = bound->params->light_begin; i < bound->params->light_end; i++) {
            sum = add3(sum, reflected(bound, i, d, normal, distance, facet, number, hit));
        }
    }
    put(hit ? sum.x : back.x, out, 4u * LANE, marked);
    put(hit ? sum.y : back.y, out + 1, 4u * LANE, marked);
    put(hit ? sum.z : back.z, out + 2, 4u * LANE, marked);
    put(hit ? distance : back_distance, out + 3, 4u * LANE, marked);
}

// What surfaces send back along `d` of light `i`, in lanes that are active: of their normal, distance, the triangle's normal
// and material.
F3 reflected(const Bound *bound, uint i, F3 d, F3 normal, F distance, F3 facet, U number, M active) {
    F3 none = all3((float3)(0.0f));
    Incident light = incident(bound, i, d, distance);
    F facing = dot3(normal, light.toward);
    M lit = active & (light.falloff > 0.0f) & (facing > 0.0f) & (dot3(facet, light.toward) > 0.0f);
    if (bound->params->visibility == 1u && any_lane(lit)) {
        float margin = MESH_MARGIN * bound->params->mesh_eye.w;
        F3 from = add3(add3(all3(bound->params->mesh_eye.xyz), scale3(d, distance)), scale3(facet, (F)(margin)));
        Line free = line(from, light.toward);
        lit &= !blocked(bound, &free, light.distance - margin, lit);
    }
    if (!any_lane(lit)) {
        return none;
    }
    float3 size = convert_float3(bound->params->dims.xyz);
    F3 at = add3(all3(bound->params->eye.xyz), scale3(to_index(bound, d), distance));
    Ray way = through(at, to_index(bound, light.toward), size, light.distance, bound->params->step);
    F optical = column(bound, &way, blocks(bound), lit);
    float3 sigma = bound->params->extinction.xyz;
    F3 transmittance = f3(exp_negative(-optical * sigma.x), exp_negative(-optical * sigma.y),
                          exp_negative(-optical * sigma.z));
    F3 arriving = mul3(scale3(all3(bound->lights[i].power.xyz), light.falloff * facing), transmittance);
    return pick3(lit, mul3(arriving, material(bound, number, d, light.toward, normal)), none);
}

// The share of light from `toward` that materials of these normals send back along `d`, per steradian.
F3 material(const Bound *bound, U number, F3 d, F3 toward, F3 normal) {
    // Diffuse, shininess, and specular.
    __global const float *of = (__global const float *)bound->materials;
    F shininess = fetch(of, 8u * number + 3u);
    F3 mirrored = sub3(scale3(normal, 2.0f * dot3(normal, toward)), toward);
    F cosine = -dot3(mirrored, d);
    M seen = cosine > 0.0f;
    F lobe = (shininess + 2.0f) / (2.0f * PI) * pow(lesser(greater(cosine, (F)(0.0f)), (F)(1.0f)), shininess);
    lobe = seen ? lobe : (F)(0.0f);
    return f3(fetch(of, 8u * number) / PI + lobe * fetch(of, 8u * number + 4u),
              fetch(of, 8u * number + 1u) / PI + lobe * fetch(of, 8u * number + 5u),
              fetch(of, 8u * number + 2u) / PI + lobe * fetch(of, 8u * number + 6u));
}

// Blocks of the occupancy along x, y, z and their side; side 0 where there is none.
uint4 blocks(const Bound *bound) {
    return has_occupancy ? bound->params->occupancy_cells : (uint4)(0u);
}
