// Lookups of the field FIELD, whose texels are VALUEs; instantiated for each field of a stage. `size` is the number of
// texels of a layer along x, y and z.

// `p` within [0, last].
fn within_FIELD(p: vec3<f32>, size: vec3<i32>) -> vec3<f32> {
    return clamp(p, vec3<f32>(0.0), vec3<f32>(size - 1));
}

// The nearest texel of a layer to `p`.
fn nearest_FIELD(p: vec3<f32>, size: vec3<i32>, layer: i32) -> VALUE {
    return texel_FIELD(vec3<i32>(within_FIELD(floor(p + 0.5), size)), size, layer);
}

// Trilinear lookup of a layer at `p`, where texel i lies at i; x then y then z, indices clamped at the edge.
fn sample_FIELD(p: vec3<f32>, size: vec3<i32>, layer: i32) -> VALUE {
    // Clamping the point is clamping both indices: beyond the outermost centres both are the same texel.
    let q = within_FIELD(p, size);
    if filters_FIELD {
        return filter_FIELD(q, size, layer);
    }
    let low = floor(q);
    let lo = vec3<i32>(whole(low));
    let hi = min(lo + 1, size - 1);
    let f = q - low;
    let a = row_FIELD(lo.x, hi.x, lo.y, lo.z, f.x, size, layer);
    let b = row_FIELD(lo.x, hi.x, hi.y, lo.z, f.x, size, layer);
    let c = row_FIELD(lo.x, hi.x, lo.y, hi.z, f.x, size, layer);
    let d = row_FIELD(lo.x, hi.x, hi.y, hi.z, f.x, size, layer);
    let near = a + (b - a) * f.y;
    let far = c + (d - c) * f.y;
    return near + (far - near) * f.z;
}

fn row_FIELD(x0: i32, x1: i32, y: i32, z: i32, f: f32, size: vec3<i32>, layer: i32) -> VALUE {
    let a = texel_FIELD(vec3<i32>(x0, y, z), size, layer);
    let b = texel_FIELD(vec3<i32>(x1, y, z), size, layer);
    return a + (b - a) * f;
}
