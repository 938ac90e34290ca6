// Light along a short piece of a ray.

// exp(-tau), and the mean of exp(-s) over s from 0 to tau: (1 - exp(-tau))/tau, by its series where tau is small.
float2 segment(float tau) {
    if (tau < 0.05f) {
        float series = 1.0f - (((tau * (-1.0f / 120.0f) + 1.0f / 24.0f) * tau - 1.0f / 6.0f) * tau + 0.5f) * tau;
        return (float2)(1.0f - tau * series, series);
    }
    float e = exp(-tau);
    return (float2)(e, (1.0f - e) / tau);
}
