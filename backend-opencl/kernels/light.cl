// Light that arrives at a point of a view ray.

typedef struct {
    // Unit direction toward the light.
    F3 toward;
    // Distance to it, metres.
    F distance;
    // What falloff and cone leave of its power.
    F falloff;
} Incident;

// A direction of the world in voxels per metre.
F3 to_index(const Bound *bound, F3 d) {
    float3 x = bound->params->index_x.xyz;
    float3 y = bound->params->index_y.xyz;
    float3 z = bound->params->index_z.xyz;
    return f3(dot3(d, all3(x)), dot3(d, all3(y)), dot3(d, all3(z)));
}

// Light `i` at `t` metres along the view ray.
Incident incident(const Bound *bound, uint i, F3 d, F t) {
    LightRecord light = bound->lights[i];
    Incident found;
    if (light.position.w == 0.0f) {
        found.toward = all3(light.position.xyz);
        found.distance = (F)(FAR);
        found.falloff = (F)(1.0f);
        return found;
    }
    F3 v = sub3(all3(light.position.xyz), scale3(d, t));
    F square = dot3(v, v);
    found.distance = sqrt(square);
    F far = greater(found.distance, (F)(1.2e-38f));
    found.toward = f3(v.x / far, v.y / far, v.z / far);
    found.falloff = 1.0f / greater(square, (F)(bound->params->light_floor));
    if (light.cone.z == 1.0f) {
        // A cone without a rim is a step at the cutoff.
        float rim = max(light.cone.y - light.cone.x, 1e-6f);
        F off_axis = angle_of_cosine(dot3(all3(-light.axis.xyz), found.toward));
        F inside = (light.cone.y - off_axis) / rim;
        found.falloff *= lesser(greater(inside, (F)(0.0f)), (F)(1.0f));
    }
    return found;
}
