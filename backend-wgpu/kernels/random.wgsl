// Random numbers, and what is made of them.

// The draws of a path: keys, and the number of the next.
struct Draws {
    first: u32,
    second: u32,
    next: u32,
}

// Scatters bits.
fn scattered_bits(x: u32) -> u32 {
    var y = (x ^ (x >> 16u)) * 0x7feb352du;
    y = (y ^ (y >> 15u)) * 0x846ca68bu;
    return y ^ (y >> 16u);
}

// The draws of a sample of a pixel in a picture from number `next` on.
fn draws(pixel: u32, sample: u32, frame: u32, next: u32) -> Draws {
    let first = scattered_bits(sample + scattered_bits(pixel + scattered_bits(2u * frame)));
    let second = scattered_bits(sample + scattered_bits(pixel + scattered_bits(2u * frame + 1u)));
    return Draws(first, second, next);
}

// A number in [0, 1).
fn draw(numbers: ptr<function, Draws>) -> f32 {
    let number = (*numbers).next;
    (*numbers).next = number + 1u;
    let h = scattered_bits((*numbers).second + scattered_bits((*numbers).first + number));
    return f32(h >> 8u) / 16777216.0;
}

// The optical depth at which a draw ends a free flight: -ln(1 - u).
fn optical_depth(u: f32) -> f32 {
    // x = m 2ⁿ with m from 1 to 2, and halved where it is above √2.
    let bits = bitcast<u32>(1.0 - u);
    var m = bitcast<f32>((bits & 0x007fffffu) | 0x3f800000u);
    var n = i32(bits >> 23u) - 127;
    if m > 1.4142135 {
        m = 0.5 * m;
        n += 1;
    }
    // The series of 2 artanh(s) to s⁹, |s| ≤ 0.172, ends below 1e-9.
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let series = (((2.0 / 9.0 * z + 2.0 / 7.0) * z + 2.0 / 5.0) * z + 2.0 / 3.0) * z + 2.0;
    return -(f32(n) * 0.6931472 + s * series);
}

// Cosine and sine of `u` turns, `u` from 0 to 1.
fn circle(u: f32) -> vec2<f32> {
    let quarter = floor(4.0 * u);
    let a = (4.0 * u - quarter - 0.5) * (0.5 * PI);
    let z = a * a;
    // Taylor's series to a⁸ and a⁹ within an eighth of a turn end below 1e-8.
    let c = (((z / 40320.0 - 1.0 / 720.0) * z + 1.0 / 24.0) * z - 0.5) * z + 1.0;
    let s = ((((z / 362880.0 - 1.0 / 5040.0) * z + 1.0 / 120.0) * z - 1.0 / 6.0) * z + 1.0) * a;
    // From an eighth of a turn on, then by quarters.
    let p = vec2<f32>(c - s, c + s) * 0.70710677;
    switch u32(quarter) & 3u {
        case 0u: {
            return p;
        }
        case 1u: {
            return vec2<f32>(-p.y, p.x);
        }
        case 2u: {
            return -p;
        }
        default: {
            return vec2<f32>(p.y, -p.x);
        }
    }
}
