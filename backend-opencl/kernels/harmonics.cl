// Spherical harmonics of a direction. A kernel gives the constants: harmonics_value(bound, i).

float harmonics_value(const Bound *bound, uint i);

// Y_k(d) for all k below the square of `bands`, by the recurrences of the constants.
void harmonics(const Bound *bound, F3 d, uint bands, F *out) {
    // Real and imaginary part of (z + i x)^m.
    F re = (F)(1.0f);
    F im = (F)(0.0f);
    for (uint m = 0u; m < bands; m++) {
        F below = (F)(0.0f);
        F this_one = (F)(0.0f);
        for (uint l = m; l < bands; l++) {
            uint at = 2u * (l * (l + 1u) / 2u + m);
            float a = harmonics_value(bound, at);
            F next = (F)(a);
            if (l > m) {
                next = d.y * this_one * a - below * harmonics_value(bound, at + 1u);
            }
            below = this_one;
            this_one = next;
            uint center = l * (l + 1u);
            out[center + m] = this_one * re;
            if (m > 0u) {
                out[center - m] = this_one * im;
            }
        }
        F turned = re * d.z - im * d.x;
        im = re * d.x + im * d.z;
        re = turned;
    }
}
