// Angles, by the same series on every device: OpenCL lets atan2 be off by 6 units in the last place, and drivers differ.

#define PI 3.14159265358979f

// The angle of (x, y) from +x toward +y, in (-pi, pi], to three units in the last place.
F angle(F y, F x) {
    F zero = (F)(0.0f);
    F ax = fabs(x);
    F ay = fabs(y);
    F largest = greater(ax, ay);
    F t = largest > zero ? lesser(ax, ay) / largest : zero;
    // Above tan pi/8 the angle is taken from the diagonal.
    M steep = t > 0.41421356f;
    t = steep ? (t - 1.0f) / (t + 1.0f) : t;
    F z = t * t;
    // Chebyshev's interpolation of atan t / t in t^2 up to tan^2 pi/8 ends below 1e-9.
    F series =
        ((((-0.06023963f * z + 0.10568921f) * z - 0.14239411f) * z + 0.19998176f) * z - 0.33333307f) * z + 1.0f;
    F a = (steep ? (F)(0.25f * PI) : zero) + t * series;
    a = ay > ax ? 0.5f * PI - a : a;
    a = x < zero ? PI - a : a;
    return y < zero ? -a : a;
}

// The angle of a cosine.
F angle_of_cosine(F c) {
    F x = lesser(greater(c, (F)(-1.0f)), (F)(1.0f));
    return angle(sqrt((1.0f - x) * (1.0f + x)), x);
}
