// The source functions of the cells toward each direction of a batch of `sweep`, whose planes ask for each of them five
// times. One invocation four cells of four directions, which share what they load.

@compute @workgroup_size(UNITS)
fn sweep_toward(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let item = number(id) * UNITS + lane;
    if item >= launch.count {
        return;
    }
    let cells = params.cells.x * params.cells.y * params.cells.z;
    let at = divide(item, (cells + 3u) / 4u);
    // The last four may be fewer: then the last of them is summed again.
    let taken = min(params.batch, params.directions - launch.first);
    let n = min(4u * at.x + vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(taken - 1u));
    let cell = min(4u * at.y + vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(cells - 1u));
    let first = (launch.first + n) * params.source_coefficients;
    for (var channel = 0u; channel < params.channels; channel++) {
        var a = vec4<f32>(0.0);
        var b = vec4<f32>(0.0);
        var c = vec4<f32>(0.0);
        var d = vec4<f32>(0.0);
        for (var k = 0u; k < params.source_coefficients; k++) {
            let place = (k * params.channels + channel) * cells + cell;
            let moment = vec4<f32>(read_sources(place.x), read_sources(place.y), read_sources(place.z), read_sources(place.w));
            a += read_source_weights(first.x + k) * moment;
            b += read_source_weights(first.y + k) * moment;
            c += read_source_weights(first.z + k) * moment;
            d += read_source_weights(first.w + k) * moment;
        }
        let place = (3u + channel) * cells + cell;
        let albedo = vec4<f32>(read_optics(place.x), read_optics(place.y), read_optics(place.z), read_optics(place.w));
        keep((n.x * params.channels + channel) * cells + cell, a * albedo);
        keep((n.y * params.channels + channel) * cells + cell, b * albedo);
        keep((n.z * params.channels + channel) * cells + cell, c * albedo);
        keep((n.w * params.channels + channel) * cells + cell, d * albedo);
    }
}

fn keep(place: vec4<u32>, value: vec4<f32>) {
    toward[place.x] = value.x;
    toward[place.y] = value.y;
    toward[place.z] = value.z;
    toward[place.w] = value.w;
}
