// Directions in which scattering bends, and choices by weights.

// One of `count` items of the choice that begins at `at` in the tables, in proportion to their weights.
fn choose(at: u32, count: u32, numbers: ptr<function, Draws>) -> u32 {
    let place = min(u32(draw(numbers) * f32(count)), count - 1u);
    let item = at + CHOICE * place;
    if draw(numbers) < read_tables(item) {
        return place;
    }
    return u32(read_tables(item + 1u));
}

// The direction at cosine `c` to a unit `d`, so many turns around it (frame of Duff et al. 2017).
fn around(d: vec3<f32>, c: f32, turn: f32) -> vec3<f32> {
    let s = select(-1.0, 1.0, d.z >= 0.0);
    let a = -1.0 / (s + d.z);
    let b = d.x * d.y * a;
    let u = vec3<f32>(1.0 + s * d.x * d.x * a, s * b, -s * d.x);
    let v = vec3<f32>(b, s + d.y * d.y * a, -d.y);
    let planar = sqrt(max(1.0 - c * c, 0.0));
    let p = circle(turn);
    let found = planar * p.x * u + planar * p.y * v + c * d;
    return found / sqrt(dot(found, found));
}

// The cosine of a Henyey-Greenstein lobe below which a part `u` of it lies.
fn lobe(g: f32, u: f32) -> f32 {
    // The inverse of the distribution, without the quotient that vanishes with g.
    let x = 2.0 * u - 1.0;
    let square = x * x;
    let base = 1.0 + g * x;
    return (x + 0.5 * g * (square + 3.0) + g * g * x + 0.5 * g * g * g * (square - 1.0)) / (base * base);
}

// The same of Rayleigh's function: the root of c³ + 3c = 8u - 4.
fn rayleigh(u: f32) -> f32 {
    let q = 4.0 * u - 2.0;
    let cube = abs(q) + sqrt(q * q + 1.0);
    let first = pow(cube, 1.0 / 3.0);
    // One step of Newton's makes up for powers of few digits.
    let root = first - (first - cube / (first * first)) / 3.0;
    let c = root - 1.0 / root;
    return select(c, -c, q < 0.0);
}

// A cosine of scattering.
fn bend(numbers: ptr<function, Draws>) -> f32 {
    var c = 0.0;
    switch params.phase_kind {
        case PHASE_HENYEY_GREENSTEIN: {
            let lobes = params.phase;
            var g = lobes.x;
            if lobes.z != 1.0 {
                g = select(lobes.y, lobes.x, draw(numbers) < lobes.z);
            }
            c = lobe(g, draw(numbers));
        }
        case PHASE_RAYLEIGH: {
            c = rayleigh(draw(numbers));
        }
        case PHASE_TABLE: {
            let last = phase_size() - 1u;
            let piece = choose(params.bends_at, last, numbers);
            let edge = circle(0.5 * f32(piece) / f32(last)).x;
            let next = circle(0.5 * f32(piece + 1u) / f32(last)).x;
            c = edge + (next - edge) * draw(numbers);
        }
        default: {
            c = 2.0 * draw(numbers) - 1.0;
        }
    }
    return clamp(c, -1.0, 1.0);
}

// The probability that scattering bends by cosine `c`, per steradian.
fn bend_density(c: f32) -> f32 {
    if params.phase_kind == PHASE_TABLE {
        let last = phase_size() - 1u;
        let piece = min(u32(angle_of_cosine(c) / PI * f32(last)), last - 1u);
        return read_tables(params.bends_at + CHOICE * piece + 2u);
    }
    return phase(c);
}
