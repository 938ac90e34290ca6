// Phase functions. A kernel gives the table: phase_value(i) and phase_size().

const FOUR_PI: f32 = 12.5663706143592;

fn henyey_greenstein(g: f32, c: f32) -> f32 {
    let base = 1.0 + g * g - 2.0 * g * c;
    return (1.0 - g * g) / FOUR_PI / (base * sqrt(base));
}

fn phase_lookup(c: f32) -> f32 {
    let last = phase_size() - 1u;
    let at = angle_of_cosine(c) / PI * f32(last);
    let i = min(u32(at), last - 1u);
    let a = phase_value(i);
    return a + (phase_value(i + 1u) - a) * (at - f32(i));
}

// Value at cosine `c`, per steradian.
fn phase(c: f32) -> f32 {
    switch params.phase_kind {
        case PHASE_HENYEY_GREENSTEIN: {
            let lobes = params.phase;
            let first = henyey_greenstein(lobes.x, c);
            if lobes.z == 1.0 {
                return first;
            }
            return first * lobes.z + henyey_greenstein(lobes.y, c) * (1.0 - lobes.z);
        }
        case PHASE_RAYLEIGH: {
            return (c * c + 1.0) * (3.0 / (4.0 * FOUR_PI));
        }
        case PHASE_TABLE: {
            return phase_lookup(c);
        }
        default: {
            return 1.0 / FOUR_PI;
        }
    }
}
