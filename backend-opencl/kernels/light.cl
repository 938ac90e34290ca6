// Light that arrives at a point of a view ray.

typedef struct {
    // Unit direction toward the light.
    float3 toward;
    // Distance to it, metres.
    float distance;
    // What falloff and cone leave of its power.
    float falloff;
} Incident;

// A direction of the world in voxels per metre.
float3 to_index(const Bound *bound, float3 d) {
    float3 x = bound->params->index_x.xyz;
    float3 y = bound->params->index_y.xyz;
    float3 z = bound->params->index_z.xyz;
    return (float3)(dot(d, x), dot(d, y), dot(d, z));
}

// Light `i` at `t` metres along the view ray.
Incident incident(const Bound *bound, uint i, float3 d, float t) {
    LightRecord light = bound->lights[i];
    Incident found;
    if (light.position.w == 0.0f) {
        found.toward = light.position.xyz;
        found.distance = FAR;
        found.falloff = 1.0f;
        return found;
    }
    float3 v = light.position.xyz - t * d;
    float square = dot(v, v);
    found.distance = sqrt(square);
    found.toward = v / max(found.distance, 1.2e-38f);
    found.falloff = 1.0f / max(square, bound->params->light_floor);
    if (light.cone.z == 1.0f) {
        // A cone without a rim is a step at the cutoff.
        float rim = max(light.cone.y - light.cone.x, 1e-6f);
        float off_axis = angle_of_cosine(dot(-light.axis.xyz, found.toward));
        found.falloff *= clamp((light.cone.y - off_axis) / rim, 0.0f, 1.0f);
    }
    return found;
}
