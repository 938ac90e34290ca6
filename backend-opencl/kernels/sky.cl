// The environment as it is seen behind the medium.

float3 sky_row(const Bound *bound, int i, int j, float f);
float3 sky_texel(const Bound *bound, int n);

// The environment's radiance from `d`.
F3 sky(const Bound *bound, F3 d) {
    uint width = bound->params->environment_width;
    uint height = bound->params->environment_height;
    F u = angle(d.x, -d.z) / (2.0f * PI) + bound->params->environment.w;
    F x = (u - floor(u)) * convert_float(width) - 0.5f;
    F y = angle_of_cosine(d.y) / PI * convert_float(height) - 0.5f;
    float column[WIDTH];
    float row[WIDTH];
    float blue[WIDTH];
    unpack(x, column);
    unpack(y, row);
    for (uint n = 0u; n < WIDTH; n++) {
        float across = column[n] - floor(column[n]);
        float down = row[n] - floor(row[n]);
        int i = convert_int_sat(floor(column[n]));
        int j = convert_int_sat(floor(row[n]));
        float3 above = sky_row(bound, i, j, across);
        float3 below = sky_row(bound, i, j + 1, across);
        float3 color = (above + (below - above) * down) * bound->params->environment.xyz;
        column[n] = color.x;
        row[n] = color.y;
        blue[n] = color.z;
    }
    return f3(pack(column), pack(row), pack(blue));
}

float3 sky_row(const Bound *bound, int i, int j, float f) {
    int width = (int)bound->params->environment_width;
    int row = clamp(j, 0, (int)bound->params->environment_height - 1) * width;
    float3 a = sky_texel(bound, row + (i + width) % width);
    float3 b = sky_texel(bound, row + (i + 1) % width);
    return a + (b - a) * f;
}

// Texel `n` of the environment, counted row by row, which are folded into a field.
float3 sky_texel(const Bound *bound, int n) {
    int3 size = convert_int3(bound->params->environment_dims.xyz);
    int row = n / size.x;
    int3 at = (int3)(n % size.x, row % size.y, row / size.y);
    return texel_environment(bound, at, size, 0).xyz;
}
