// `trace`: where view rays meet surfaces. One work-item a sub-pixel position.

float3 facet(const Bound *bound, const Line *of, uint at);

void run_trace(const Bound *bound) {
    size_t n = number();
    if (n >= bound->launch->count) {
        return;
    }
    uint unit = bound->launch->start + (uint)n;
    size_t out = 2u * (size_t)unit;
    uint begin = bound->params->node_begin;
    Line of = line(bound->params->eye.xyz, view(bound, unit));
    float limit = FAR;
    if (begin > 0u) {
        limit = fmin(bound->hits[out].w, FAR);
    }
    Hit hit = nearest(bound, &of, 0.0f, limit, begin, bound->params->node_end);
    if (hit.distance < FAR) {
        uint at = 2u * bound->params->nodes + 6u * hit.triangle;
        float3 own = facet(bound, &of, at);
        float3 normal = hit.weights.x * place(bound, at + 3u) + hit.weights.y * place(bound, at + 4u);
        normal += hit.weights.z * place(bound, at + 5u);
        float size = sqrt(dot(normal, normal));
        normal = size > 0.0f ? normal / size : own;
        normal = dot(normal, own) < 0.0f ? -normal : normal;
        bound->hits[out] = (float4)(normal, hit.distance);
        bound->hits[out + 1u] = (float4)(own, convert_float(bound->mesh[at + 3u].number));
    } else if (begin == 0u) {
        bound->hits[out] = (float4)(0.0f, 0.0f, 0.0f, INFINITY);
        bound->hits[out + 1u] = (float4)(0.0f);
    }
}

// The normal of the triangle whose records begin at `at`, on the side that the ray comes from.
float3 facet(const Bound *bound, const Line *of, uint at) {
    float3 a = place(bound, at);
    float3 across = cross(place(bound, at + 1u) - a, place(bound, at + 2u) - a);
    float3 own = across / max(sqrt(dot(across, across)), 1.2e-38f);
    return dot(own, of->direction) > 0.0f ? -own : own;
}
