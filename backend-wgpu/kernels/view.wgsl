// View rays.

// Direction of the view ray of a sub-pixel position.
fn view(unit: u32) -> vec3<f32> {
    let pixel = unit / params.samples;
    let s = unit % params.samples;
    let a = (f32(pixel % params.width) + read_tables(2u * s)) * (2.0 / f32(params.width)) - 1.0;
    let b = 1.0 - (f32(pixel / params.width) + read_tables(2u * s + 1u)) * (2.0 / f32(params.height));
    let toward = a * params.right.xyz + b * params.up.xyz + params.forward.xyz;
    return toward / length(toward);
}
