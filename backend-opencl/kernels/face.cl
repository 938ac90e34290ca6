// Faces of the maps of lights, as core/src/stage/shadow.rs lays them out.

typedef struct {
    // Unit, away from the light.
    float3 forward;
    float3 right;
    float3 up;
    // At distance 1; of a directional light's at every distance, metres.
    float half_width;
} Face;

// Face `n` of a light's map.
Face face(const LightRecord *light, uint n, float extent) {
    Face of;
    if (light->position.w == 0.0f || light->cone.w > 0.0f) {
        bool parallel = light->position.w == 0.0f;
        Line along = line((float3)(0.0f), parallel ? -light->position.xyz : light->axis.xyz);
        of.forward = along.direction;
        of.right = along.u;
        of.up = along.v;
        of.half_width = parallel ? extent : light->cone.w;
        return of;
    }
    uint a = n / 2u;
    float s = n % 2u == 1u ? -1.0f : 1.0f;
    of.forward = (float3)(a == 0u ? s : 0.0f, a == 1u ? s : 0.0f, a == 2u ? s : 0.0f);
    of.right = (float3)(a == 2u ? 1.0f : 0.0f, a == 0u ? 1.0f : 0.0f, a == 1u ? 1.0f : 0.0f);
    of.up = (float3)(a == 1u ? 1.0f : 0.0f, a == 2u ? 1.0f : 0.0f, a == 0u ? 1.0f : 0.0f);
    of.half_width = 1.0f;
    return of;
}

// The face of six that a direction falls on.
uint side_of(float3 v) {
    float3 w = fabs(v);
    uint a = w.x >= w.y && w.x >= w.z ? 0u : w.y >= w.z ? 1u : 2u;
    float along = a == 0u ? v.x : a == 1u ? v.y : v.z;
    return 2u * a + (along < 0.0f ? 1u : 0u);
}
