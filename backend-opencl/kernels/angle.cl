// Angles, by the same series on every device: OpenCL lets atan2 be off by 6 units in the last place, and drivers differ.

#define PI 3.14159265358979f

// The angle of (x, y) from +x toward +y, in (-pi, pi], to three units in the last place.
float angle(float y, float x) {
    float ax = fabs(x);
    float ay = fabs(y);
    float largest = max(ax, ay);
    if (largest == 0.0f) {
        return 0.0f;
    }
    float t = min(ax, ay) / largest;
    float turned = 0.0f;
    // Above tan pi/8 the angle is taken from the diagonal.
    if (t > 0.41421356f) {
        t = (t - 1.0f) / (t + 1.0f);
        turned = 0.25f * PI;
    }
    float z = t * t;
    // Chebyshev's interpolation of atan t / t in t^2 up to tan^2 pi/8 ends below 1e-9.
    float series =
        ((((-0.06023963f * z + 0.10568921f) * z - 0.14239411f) * z + 0.19998176f) * z - 0.33333307f) * z + 1.0f;
    float a = turned + t * series;
    a = ay > ax ? 0.5f * PI - a : a;
    a = x < 0.0f ? PI - a : a;
    return y < 0.0f ? -a : a;
}

// The angle of a cosine.
float angle_of_cosine(float c) {
    float x = clamp(c, -1.0f, 1.0f);
    return angle(sqrt((1.0f - x) * (1.0f + x)), x);
}
