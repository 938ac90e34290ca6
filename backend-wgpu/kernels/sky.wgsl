// The environment as it is seen behind the medium.

// The environment's radiance from `d`.
fn sky(d: vec3<f32>) -> vec3<f32> {
    let width = i32(params.environment_width);
    let height = i32(params.environment_height);
    let u = angle(d.x, -d.z) / (2.0 * PI) + params.environment.w;
    let x = (u - floor(u)) * f32(width) - 0.5;
    let y = angle_of_cosine(d.y) / PI * f32(height) - 0.5;
    let i = i32(floor(x));
    let j = i32(floor(y));
    let above = sky_row(i, j, x - floor(x));
    let below = sky_row(i, j + 1, x - floor(x));
    return (above + (below - above) * (y - floor(y))) * params.environment.xyz;
}

fn sky_row(i: i32, j: i32, f: f32) -> vec3<f32> {
    let width = i32(params.environment_width);
    let row = clamp(j, 0, i32(params.environment_height) - 1) * width;
    let a = sky_texel(row + (i + width) % width);
    let b = sky_texel(row + (i + 1) % width);
    return a + (b - a) * f;
}

// Texel `n` of the environment, counted row by row, which are folded into a field.
fn sky_texel(n: i32) -> vec3<f32> {
    let size = vec3<i32>(params.environment_dims.xyz);
    let row = n / size.x;
    let at = vec3<i32>(n % size.x, row % size.y, row / size.y);
    return texel_environment(at, size, 0).xyz;
}
