// Faces of the maps of lights, as core/src/stage/shadow.rs lays them out.

typedef struct {
    // Unit, away from the light.
    F3 forward;
    F3 right;
    F3 up;
    // At distance 1; of a directional light's at every distance, metres.
    float half_width;
} Face;

// Face `n` of a light's map.
Face face(const LightRecord *light, I n, float extent) {
    Face of;
    if (light->position.w == 0.0f || light->cone.w > 0.0f) {
        bool parallel = light->position.w == 0.0f;
        Line along = line(all3((float3)(0.0f)), all3(parallel ? -light->position.xyz : light->axis.xyz));
        of.forward = along.direction;
        of.right = along.u;
        of.up = along.v;
        of.half_width = parallel ? extent : light->cone.w;
        return of;
    }
    F zero = (F)(0.0f);
    F one = (F)(1.0f);
    I a = n / 2;
    F s = n % 2 == 1 ? -one : one;
    of.forward = f3(a == 0 ? s : zero, a == 1 ? s : zero, a == 2 ? s : zero);
    of.right = f3(a == 2 ? one : zero, a == 0 ? one : zero, a == 1 ? one : zero);
    of.up = f3(a == 1 ? one : zero, a == 2 ? one : zero, a == 0 ? one : zero);
    of.half_width = 1.0f;
    return of;
}

// The face of six that a direction falls on.
I side_of(F3 v) {
    F x = fabs(v.x);
    F y = fabs(v.y);
    F z = fabs(v.z);
    M first = (x >= y) & (x >= z);
    M second = !first & (y >= z);
    F along = first ? v.x : second ? v.y : v.z;
    I face = first ? (I)(0) : second ? (I)(2) : (I)(4);
    return along < 0.0f ? face + 1 : face;
}
