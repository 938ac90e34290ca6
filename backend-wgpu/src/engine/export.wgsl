// The film of `march` becomes textures. One invocation a pixel.

@group(1) @binding(0) var<storage, read> film: array<vec4<f32>>;

@compute @workgroup_size(64)
fn export_film(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id) * 64u + lane;
    if n >= launch.count {
        return;
    }
    let pixel = launch.start + n;
    let at = vec2<u32>(pixel % params.width, pixel / params.width);
    let place = 2u * (pixel - launch.first);
    store_beauty(at, film[place]);
    store_transmittance(at, film[place + 1u]);
}

// What a texel of 16-bit floats can hold of it; infinity stays.
fn held(value: vec4<f32>) -> vec4<f32> {
    return select(min(value, vec4<f32>(65504.0)), value, value > vec4<f32>(3.0e38));
}
