// Fractal gradient noise.

// Scatters bits.
fn scatter(x: u32) -> u32 {
    var y = (x ^ (x >> 16u)) * 0x7feb352du;
    y = (y ^ (y >> 15u)) * 0x846ca68bu;
    return y ^ (y >> 16u);
}

// The hash of a corner's index along one more axis.
fn along(index: u32, h: u32) -> u32 {
    return scatter(index + h);
}

// The scalar product of the gradient that a hash chooses with `t`.
fn slope(h: u32, t: vec3<f32>) -> f32 {
    let kind = h & 15u;
    let u = select(t.y, t.x, kind < 8u);
    let v = select(select(t.z, t.x, (kind & 13u) == 12u), t.y, kind < 4u);
    return select(u, -u, (kind & 1u) != 0u) + select(v, -v, (kind & 2u) != 0u);
}

// The noise on an edge along x: between its corners of index `x.x` and `x.y`, at `t` from the first.
fn edge(h: u32, x: vec2<u32>, t: vec3<f32>, fade: f32) -> f32 {
    let left = slope(along(x.x, h), t);
    let right = slope(along(x.y, h), t - vec3<f32>(1.0, 0.0, 0.0));
    return left + (right - left) * fade;
}

// One octave at `p`, whose components are not negative and repeat after `mask` + 1.
fn octave(p: vec3<f32>, mask: u32, seed: u32) -> f32 {
    let low = floor(p);
    let t = p - low;
    let fade = t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let first = vec3<u32>(low) & vec3<u32>(mask);
    let second = (vec3<u32>(low) + 1u) & vec3<u32>(mask);
    let x = vec2<u32>(first.x, second.x);
    let z0 = along(first.z, scatter(seed));
    let z1 = along(second.z, scatter(seed));
    let a = edge(along(first.y, z0), x, t, fade.x);
    let b = edge(along(second.y, z0), x, t - vec3<f32>(0.0, 1.0, 0.0), fade.x);
    let c = edge(along(first.y, z1), x, t - vec3<f32>(0.0, 0.0, 1.0), fade.x);
    let d = edge(along(second.y, z1), x, t - vec3<f32>(0.0, 1.0, 1.0), fade.x);
    let near = a + (b - a) * fade.y;
    let far = c + (d - c) * fade.y;
    return near + (far - near) * fade.z;
}

// max(0, 1 + contrast · n) at `p` in cells of the first octave.
fn noise_factor(p: vec3<f32>, octaves: u32, seed: u32, contrast: f32) -> f32 {
    let period = f32(NOISE_PERIOD);
    let within = p - floor(p / period) * period;
    var sum = 0.0;
    var fineness = 1.0;
    for (var o = 0u; o < octaves; o++) {
        let mask = (NOISE_PERIOD << o) - 1u;
        sum += octave(within * fineness, mask, scatter(seed + (o + 1u) * 0x9e3779b9u)) / fineness;
        fineness *= 2.0;
    }
    return max(1.0 + sum * contrast, 0.0);
}
