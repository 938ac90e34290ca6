// A buffer becomes a slab of a field: texels of WORDS words, layer fastest, then x, y and z. The layers of the field
// lie one behind the other along the slabs' z. One invocation a texel of all layers.

@group(1) @binding(0) var<storage, read> buffer: array<f32>;
@group(2) @binding(0) var slab: texture_storage_3d<FORMAT, write>;

@compute @workgroup_size(UNITS)
fn publish(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id) * UNITS + lane;
    if n >= launch.count {
        return;
    }
    let texel = launch.start + n;
    let size = params.dims.xyz;
    let row = parted(texel, size.x);
    let column = parted(row.x, size.y);
    let layers = params.dims.w;
    for (var layer = 0u; layer < layers; layer++) {
        let slice = layer * size.z + column.x;
        if slice >= params.slices.x && slice < params.slices.y {
            let at = ((texel - launch.first) * layers + layer) * WORDS;
            let place = vec3<i32>(vec3<u32>(row.y, column.y, slice - params.slices.x));
            textureStore(slab, place, load(at));
        }
    }
}

// Quotient and rest.
fn parted(a: u32, b: u32) -> vec2<u32> {
    if FEW {
        return divide(a, b);
    }
    return vec2<u32>(a / b, a % b);
}

fn load(at: u32) -> vec4<f32> {
    if WORDS == 1u {
        return vec4<f32>(buffer[at], 0.0, 0.0, 1.0);
    }
    return vec4<f32>(buffer[at], buffer[at + 1u], buffer[at + 2u], buffer[at + 3u]);
}
