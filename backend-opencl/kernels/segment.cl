// Light along a short piece of a ray.

// Optical depths below it need no power of two.
#define SHALLOW 0.34f

INLINE F2 decay(F tau);

// exp(-tau), and the mean of exp(-s) over s from 0 to tau: (1 - exp(-tau))/tau, which nears 1 where tau is small. Where no lane is deep
// there is no quotient; other lanes find the same beside deep ones.
INLINE F2 segment(F tau) {
    F2 piece;
    if (WIDTH > 1 && !any_lane(!(tau < SHALLOW))) {
        F bent = curvature(tau);
        piece.x = 1.0f - (tau - tau * tau * bent);
        piece.y = 1.0f - tau * bent;
        return piece;
    }
    F2 parts = decay_parts(lesser(tau, (F)(87.0f)));
    F bent = curvature(parts.y);
    F part = parts.x * (parts.y - parts.y * parts.y * bent);
    piece.x = parts.x - part;
    piece.y = tau < SHALLOW ? 1.0f - parts.y * bent : (1.0f - parts.x + part) / tau;
    return piece;
}

// exp(-tau) and 1 - exp(-tau) for tau >= 0, both to a few units in the last place.
F2 decay(F tau) {
    F2 both;
    // Depths that round to none of ln 2 need no power of two, which is 1: where no lane is deeper the sums are the same.
    if (WIDTH > 1 && !any_lane(!(tau < SHALLOW))) {
        both.y = lost(tau);
        both.x = 1.0f - both.y;
        return both;
    }
    // exp(-tau) is 2^n (1 - q): without the difference of 1 and q nothing of a small tau is lost.
    F2 parts = decay_parts(lesser(tau, (F)(87.0f)));
    F part = parts.x * lost(parts.y);
    both.x = parts.x - part;
    both.y = 1.0f - parts.x + part;
    return both;
}
