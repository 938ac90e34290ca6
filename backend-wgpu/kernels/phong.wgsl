// Light that is scattered as by a surface across the density's gradient.

// The unit normal away from what is denser, at a point of index space: central differences over a voxel either way. Zero where
// the density is level.
fn normal(at: vec3<f32>) -> vec3<f32> {
    let size = vec3<i32>(params.dims.xyz);
    let x = vec3<f32>(1.0, 0.0, 0.0);
    let y = vec3<f32>(0.0, 1.0, 0.0);
    let z = vec3<f32>(0.0, 0.0, 1.0);
    let high = vec3<f32>(sample_density(at + x, size, 0), sample_density(at + y, size, 0), sample_density(at + z, size, 0));
    let low = vec3<f32>(sample_density(at - x, size, 0), sample_density(at - y, size, 0), sample_density(at - z, size, 0));
    let rise = high - low;
    let sum = high + low;
    let steepest = max(max(abs(rise.x), abs(rise.y)), abs(rise.z));
    if steepest <= PHONG_FLAT * max(max(sum.x, sum.y), sum.z) {
        return vec3<f32>(0.0);
    }
    let g = rise / steepest;
    let away = -(g.x * params.index_x.xyz + g.y * params.index_y.xyz + g.z * params.index_z.xyz);
    return away / sqrt(dot(away, away));
}

// The share of light from `toward` that goes on along -d, per steradian and unit of irradiance.
fn phong(away: vec3<f32>, toward: vec3<f32>, d: vec3<f32>) -> f32 {
    let ambient = params.phong.x / (4.0 * PI);
    let facing = dot(away, toward);
    if facing <= 0.0 {
        return ambient;
    }
    let cosine = dot(d, toward - 2.0 * facing * away);
    var gloss = 0.0;
    if cosine > 0.0 {
        gloss = (params.phong.w + 2.0) / (2.0 * PI) * pow(min(cosine, 1.0), params.phong.w);
    }
    return ambient + facing * (params.phong.y / PI + gloss * params.phong.z);
}
