// Colour and depth of another renderer become the surfaces that `march` takes. One invocation a pixel.

@group(1) @binding(0) var<storage, read_write> surface: array<vec4<f32>>;

@compute @workgroup_size(64)
fn import_surface(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id) * 64u + lane;
    if n >= launch.count {
        return;
    }
    let pixel = launch.start + n;
    let x = pixel % params.width;
    let y = pixel / params.width;
    let distance = distance_of(depth_at(vec2<u32>(x, y)), x, y);
    let there = distance >= 0.0 && distance < FAR;
    // A colour is seen at any distance; without one, the environment is where there is no surface.
    let none = select(launch.infinity, FAR, has_color);
    let radiance = possible(color_at(vec2<u32>(x, y)));
    surface[pixel - launch.first] = vec4<f32>(radiance, select(none, distance, there));
}

// Metres along the ray through the middle of the pixel; negative for none.
fn distance_of(depth: f32, x: u32, y: u32) -> f32 {
    if params.kind == DEPTH_DISTANCE {
        return depth;
    }
    let a = (f32(x) + 0.5) * (2.0 / f32(params.width)) - 1.0;
    let b = 1.0 - (f32(y) + 0.5) * (2.0 / f32(params.height));
    if params.kind == DEPTH_AXIS {
        return depth * length(a * params.right.xyz + b * params.up.xyz + params.forward.xyz);
    }
    let place = a * params.inverse_x + b * params.inverse_y + depth * params.inverse_z + params.inverse_w;
    if depth == params.empty || place.w == 0.0 {
        return -1.0;
    }
    return length(place.xyz / place.w);
}

// Zero for what no radiance can be.
fn possible(color: vec3<f32>) -> vec3<f32> {
    return select(vec3<f32>(0.0), color, color >= vec3<f32>(0.0) & color < vec3<f32>(3.0e38));
}
