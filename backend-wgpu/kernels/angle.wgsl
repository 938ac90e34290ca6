// Angles. WGSL asks little of atan2 and acos (drivers are off by 4e-5), and a sky of many texels shows it.

const PI: f32 = 3.14159265358979;

// The angle of (x, y) from +x toward +y, in (-π, π], to three units in the last place.
fn angle(y: f32, x: f32) -> f32 {
    let ax = abs(x);
    let ay = abs(y);
    let long = max(ax, ay);
    if long == 0.0 {
        return 0.0;
    }
    var t = min(ax, ay) / long;
    var turned = 0.0;
    // Above tan π/8 the angle is taken from the diagonal.
    if t > 0.41421356 {
        t = (t - 1.0) / (t + 1.0);
        turned = 0.25 * PI;
    }
    let z = t * t;
    // Chebyshev's interpolation of atan t / t in t² up to tan² π/8 ends below 1e-9.
    let series = ((((-0.06023963 * z + 0.10568921) * z - 0.14239411) * z + 0.19998176) * z - 0.33333307) * z + 1.0;
    var a = turned + t * series;
    a = select(a, 0.5 * PI - a, ay > ax);
    a = select(a, PI - a, x < 0.0);
    return select(a, -a, y < 0.0);
}

// The angle of a cosine.
fn angle_of_cosine(c: f32) -> f32 {
    let x = clamp(c, -1.0, 1.0);
    return angle(sqrt((1.0 - x) * (1.0 + x)), x);
}
