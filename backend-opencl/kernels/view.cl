// View rays.

// Direction of the view ray of a sub-pixel position.
float3 view(const Bound *bound, uint unit) {
    uint pixel = unit / bound->params->samples;
    uint s = unit % bound->params->samples;
    uint width = bound->params->width;
    float2 shift = vload2(s, bound->tables);
    float a = (convert_float(pixel % width) + shift.x) * (2.0f / convert_float(width)) - 1.0f;
    float b = 1.0f - (convert_float(pixel / width) + shift.y) * (2.0f / convert_float(bound->params->height));
    float3 toward = a * bound->params->right.xyz + b * bound->params->up.xyz + bound->params->forward.xyz;
    return toward / sqrt(dot(toward, toward));
}
