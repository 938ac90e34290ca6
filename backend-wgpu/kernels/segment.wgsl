// Light along a short piece of a ray.

// e^-τ, and the mean of e^-s over s from 0 to τ: (1 - e^-τ)/τ, by its series where τ is small.
fn segment(tau: f32) -> vec2<f32> {
    if tau < 0.05 {
        let series = 1.0 - (((tau * (-1.0 / 120.0) + 1.0 / 24.0) * tau - 1.0 / 6.0) * tau + 0.5) * tau;
        return vec2<f32>(1.0 - tau * series, series);
    }
    let e = exp(-tau);
    return vec2<f32>(e, (1.0 - e) / tau);
}
