// Light along a short piece of a ray.

// e^-τ, and the mean of e^-s over s from 0 to τ: (1 - e^-τ)/τ, by its series where τ is small.
fn segment(tau: f32) -> vec2<f32> {
    let series = 1.0 - (((tau * (-1.0 / 120.0) + 1.0 / 24.0) * tau - 1.0 / 6.0) * tau + 0.5) * tau;
    let e = exp(-tau);
    // Both are cheaper than a branch.
    return select(vec2<f32>(e, (1.0 - e) / tau), vec2<f32>(1.0 - tau * series, series), tau < 0.05);
}
