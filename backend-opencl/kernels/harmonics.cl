// Spherical harmonics of a direction. A kernel gives the constants: harmonics_value(bound, i).

float harmonics_value(const Bound *bound, uint i);

// Y_k(d) for all k below the square of `bands`, by the recurrences of the constants.
void harmonics(const Bound *bound, float3 d, uint bands, float *out) {
    // Real and imaginary part of (z + i x)^m.
    float re = 1.0f;
    float im = 0.0f;
    for (uint m = 0u; m < bands; m++) {
        float below = 0.0f;
        float this_one = 0.0f;
        for (uint l = m; l < bands; l++) {
            uint at = 2u * (l * (l + 1u) / 2u + m);
            float a = harmonics_value(bound, at);
            float next = l == m ? a : d.y * this_one * a - below * harmonics_value(bound, at + 1u);
            below = this_one;
            this_one = next;
            uint center = l * (l + 1u);
            out[center + m] = this_one * re;
            if (m > 0u) {
                out[center - m] = this_one * im;
            }
        }
        float turned = re * d.z - im * d.x;
        im = re * d.x + im * d.z;
        re = turned;
    }
}
