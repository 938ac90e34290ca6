// Spherical harmonics of a direction. A kernel gives the constants: harmonics_value(i).

// Y_k(d) for all k below bands², by the recurrences of the constants.
fn harmonics(d: vec3<f32>, bands: u32, out: ptr<function, array<f32, HARMONICS_MAX>>) {
    // Real and imaginary part of (z + i x)^m.
    var re = 1.0;
    var im = 0.0;
    for (var m = 0u; m < bands; m++) {
        var below = 0.0;
        var this_one = 0.0;
        // Loops of as many turns as drivers know are unrolled by them; few bands are worth turns that do nothing.
        for (var l = select(m, 0u, bands <= 4u); l < bands; l++) {
            if l < m {
                continue;
            }
            let at = 2u * (l * (l + 1u) / 2u + m);
            let a = harmonics_value(at);
            let next = select(d.y * this_one * a - below * harmonics_value(at + 1u), a, l == m);
            below = this_one;
            this_one = next;
            let center = l * (l + 1u);
            (*out)[center + m] = this_one * re;
            if m > 0u {
                (*out)[center - m] = this_one * im;
            }
        }
        let turned = re * d.z - im * d.x;
        im = re * d.x + im * d.z;
        re = turned;
    }
}
