// Light along a short piece of a ray.

// exp(-tau), and the mean of exp(-s) over s from 0 to tau: (1 - exp(-tau))/tau, by its series where tau is small.
F2 segment(F tau) {
    F series = 1.0f - (((tau * (-1.0f / 120.0f) + 1.0f / 24.0f) * tau - 1.0f / 6.0f) * tau + 0.5f) * tau;
    F e = exp_negative(-tau);
    M small = tau < 0.05f;
    F2 piece;
    piece.x = small ? 1.0f - tau * series : e;
    piece.y = small ? series : (1.0f - e) / tau;
    return piece;
}
