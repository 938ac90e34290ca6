// `shadow`: maps of how far lights reach. One work-item a packet of texels.

void run_shadow(const Bound *bound) {
    size_t n = number();
    if (n >= bound->launch->count) {
        return;
    }
    uint count = bound->launch->count;
    uint start = bound->launch->start;
    size_t first = start + n;
    U texel = start + elements(n, count);
    uint side = bound->params->side;
    float extent = bound->params->extent;
    F x = (to_float(texel % side) + 0.5f) * (2.0f / convert_float(side)) - 1.0f;
    F y = (to_float(texel / side % side) + 0.5f) * (2.0f / convert_float(side)) - 1.0f;
    U face_number = texel / (side * side);
    uint begin = bound->params->node_begin;
    uint end = bound->params->node_end;
    F reach = (F)(FAR);
    uint last = (uint)(min(first + WIDTH, (size_t)start + count) - 1u) / (side * side);
    // Most packets are of one face.
    for (uint number = (uint)first / (side * side); number <= last; number++) {
        // The light whose face it is.
        uint i = 0u;
        while (i + 1u < bound->params->lights && convert_uint(bound->lights[i + 1u].power.w) <= number) {
            i++;
        }
        LightRecord light = bound->lights[i];
        Face of = face(&light, (I)((int)(number - convert_uint(light.power.w))), extent);
        F3 across = scale3(add3(scale3(of.right, x), scale3(of.up, y)), (F)(of.half_width));
        F found;
        if (light.position.w == 0.0f) {
            Line way = line(sub3(across, scale3(of.forward, (F)(extent))), of.forward);
            found = nearest(bound, &way, 0.0f, (F)(FAR), begin, end).distance;
        } else {
            F3 toward = add3(of.forward, across);
            F size = sqrt(dot3(toward, toward));
            Line way = line(all3(light.position.xyz), f3(toward.x / size, toward.y / size, toward.z / size));
            F far = nearest(bound, &way, MESH_MARGIN * extent, (F)(FAR), begin, end).distance;
            found = far < FAR ? far / size : (F)(FAR);
        }
        reach = face_number == number ? found : reach;
    }
    if (begin > 0u) {
        reach = lesser(reach, fetch(bound->shadow_map, texel));
    }
    int marked[WIDTH];
    unpack(filled(n, count), marked);
    put(reach, bound->shadow_map + first, LANE, marked);
}
