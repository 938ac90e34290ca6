// `shadow`: maps of how far lights reach. One work-item a texel.

void run_shadow(const Bound *bound) {
    size_t n = number();
    if (n >= bound->launch->count) {
        return;
    }
    uint texel = bound->launch->start + (uint)n;
    uint side = bound->params->side;
    uint face_number = texel / (side * side);
    // The light whose face it is.
    uint i = 0u;
    while (i + 1u < bound->params->lights && convert_uint(bound->lights[i + 1u].power.w) <= face_number) {
        i++;
    }
    LightRecord light = bound->lights[i];
    float extent = bound->params->extent;
    Face of = face(&light, face_number - convert_uint(light.power.w), extent);
    float x = (convert_float(texel % side) + 0.5f) * (2.0f / convert_float(side)) - 1.0f;
    float y = (convert_float(texel / side % side) + 0.5f) * (2.0f / convert_float(side)) - 1.0f;
    float3 across = of.half_width * (x * of.right + y * of.up);
    uint begin = bound->params->node_begin;
    uint end = bound->params->node_end;
    float reach;
    if (light.position.w == 0.0f) {
        Line way = line(across - extent * of.forward, of.forward);
        reach = nearest(bound, &way, 0.0f, FAR, begin, end).distance;
    } else {
        float3 toward = of.forward + across;
        float size = sqrt(dot(toward, toward));
        Line way = line(light.position.xyz, toward / size);
        Hit hit = nearest(bound, &way, MESH_MARGIN * extent, FAR, begin, end);
        reach = hit.distance < FAR ? hit.distance / size : FAR;
    }
    if (begin > 0u) {
        reach = min(reach, bound->shadow_map[texel]);
    }
    bound->shadow_map[texel] = reach;
}
