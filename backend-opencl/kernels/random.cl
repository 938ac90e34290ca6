// Random numbers, and what is made of them.

// The draws of a path: keys, and the number of the next.
typedef struct {
    uint first;
    uint second;
    uint next;
} Draws;

// Scatters bits.
uint scattered_bits(uint x) {
    x = (x ^ x >> 16) * 0x7feb352du;
    x = (x ^ x >> 15) * 0x846ca68bu;
    return x ^ x >> 16;
}

// The draws of a sample of a pixel in a picture from number `next` on.
Draws draws(uint pixel, uint sample, uint frame, uint next) {
    Draws of;
    of.first = scattered_bits(sample + scattered_bits(pixel + scattered_bits(2u * frame)));
    of.second = scattered_bits(sample + scattered_bits(pixel + scattered_bits(2u * frame + 1u)));
    of.next = next;
    return of;
}

// A number in [0, 1).
float draw(Draws *numbers) {
    uint h = scattered_bits(numbers->second + scattered_bits(numbers->first + numbers->next));
    numbers->next += 1u;
    return convert_float(h >> 8) / 16777216.0f;
}

// The optical depth at which a draw ends a free flight: -ln(1 - u).
float optical_depth(float u) {
    // x = m 2^n with m from 1 to 2, and halved where it is above the root of 2. By integers: of a choice between floats compilers
    // make a branch, which nothing foretells.
    uint bits = as_uint(1.0f - u);
    uint mantissa = (bits & 0x007fffffu) | 0x3f800000u;
    uint above = mantissa > as_uint(1.4142135f) ? 1u : 0u;
    float m = as_float(mantissa - (above << 23));
    int n = (int)((bits >> 23) + above) - 127;
    // The series of 2 artanh(s) to s^9, |s| <= 0.172, ends below 1e-9.
    float s = (m - 1.0f) / (m + 1.0f);
    float z = s * s;
    float series = (((2.0f / 9.0f * z + 2.0f / 7.0f) * z + 2.0f / 5.0f) * z + 2.0f / 3.0f) * z + 2.0f;
    return -(convert_float(n) * 0.6931472f + s * series);
}

// Cosine and sine of `u` turns, `u` from 0 to 1.
float2 circle(float u) {
    float quarter = floor(4.0f * u);
    float a = (4.0f * u - quarter - 0.5f) * (0.5f * PI);
    float z = a * a;
    // Taylor's series to a^8 and a^9 within an eighth of a turn end below 1e-8.
    float c = (((z / 40320.0f - 1.0f / 720.0f) * z + 1.0f / 24.0f) * z - 0.5f) * z + 1.0f;
    float s = ((((z / 362880.0f - 1.0f / 5040.0f) * z + 1.0f / 120.0f) * z - 1.0f / 6.0f) * z + 1.0f) * a;
    // From an eighth of a turn on, then by quarters.
    float2 p = (float2)(c - s, c + s) * 0.70710677f;
    switch (convert_uint(quarter) & 3u) {
        case 0u:
            return p;
        case 1u:
            return (float2)(-p.y, p.x);
        case 2u:
            return -p;
        default:
            return (float2)(p.y, -p.x);
    }
}
