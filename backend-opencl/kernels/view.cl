// View rays.

// Directions of the view rays of sub-pixel positions.
F3 view(const Bound *bound, U unit) {
    uint samples = bound->params->samples;
    uint width = bound->params->width;
    U pixel = unit / samples;
    U s = unit % samples;
    F x = to_float(pixel % width) + fetch(bound->tables, 2u * s);
    F y = to_float(pixel / width) + fetch(bound->tables, 2u * s + 1u);
    F a = x * (2.0f / convert_float(width)) - 1.0f;
    F b = 1.0f - y * (2.0f / convert_float(bound->params->height));
    F3 toward = add3(add3(scale3(all3(bound->params->right.xyz), a), scale3(all3(bound->params->up.xyz), b)),
                     all3(bound->params->forward.xyz));
    F size = sqrt(dot3(toward, toward));
    return f3(toward.x / size, toward.y / size, toward.z / size);
}
