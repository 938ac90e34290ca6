// `shade`: light that surfaces send to the eye. One invocation a sub-pixel position.

@compute @workgroup_size(UNITS)
fn shade(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id) * UNITS + lane;
    if n >= launch.count {
        return;
    }
    let unit = launch.start + n;
    // What is bound in parts is bound from a pixel on.
    let here = unit - launch.first * params.samples;
    let hit = read_hits(2u * here);
    let facet = read_hits(2u * here + 1u);
    var back = vec4<f32>(0.0, 0.0, 0.0, launch.infinity);
    if has_background {
        back = read_background(here / params.samples);
    }
    if min(hit.w, FAR) >= min(back.w, FAR) {
        surface[here] = back;
        return;
    }
    var sum = vec3<f32>(0.0);
    if params.light_begin > 0u {
        // What the passes before left.
        sum = surface[here].xyz;
    }
    let d = view(unit);
    for (var i = params.light_begin; i < params.light_end; i++) {
        sum += reflected(i, d, hit, facet);
    }
    surface[here] = vec4<f32>(sum, hit.w);
}

// What a surface sends back along `d` of light `i`. `hit`: its normal and distance; `facet`: the triangle's normal and
// material.
fn reflected(i: u32, d: vec3<f32>, hit: vec4<f32>, facet: vec4<f32>) -> vec3<f32> {
    let record = read_lights(i);
    let light = incident(record, d, hit.w);
    let facing = dot(hit.xyz, light.toward);
    if light.falloff <= 0.0 || facing <= 0.0 || dot(facet.xyz, light.toward) <= 0.0 {
        return vec3<f32>(0.0);
    }
    if params.visibility == 1u {
        let margin = MESH_MARGIN * params.mesh_eye.w;
        let at = params.mesh_eye.xyz + hit.w * d + margin * facet.xyz;
        if blocked(line(at, light.toward), light.distance - margin, 0u, params.nodes) {
            return vec3<f32>(0.0);
        }
    }
    let size = vec3<f32>(params.dims.xyz);
    let at = params.eye.xyz + hit.w * to_index(d);
    let way = through(at, to_index(light.toward), size, light.distance, params.step);
    let transmittance = exp(-column(way, blocks()) * params.extinction.xyz);
    return light.falloff * facing * record.power.xyz * transmittance * material(u32(facet.w), d, light.toward, hit.xyz);
}

// The share of light from `toward` that a material of this normal sends back along `d`, per steradian.
fn material(number: u32, d: vec3<f32>, toward: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    let record = read_materials(number);
    let mirrored = 2.0 * dot(normal, toward) * normal - toward;
    let cosine = -dot(mirrored, d);
    var lobe = 0.0;
    if cosine > 0.0 {
        lobe = (record.diffuse.w + 2.0) / (2.0 * PI) * pow(min(cosine, 1.0), record.diffuse.w);
    }
    return record.diffuse.xyz / PI + lobe * record.specular.xyz;
}

// Blocks of the occupancy along x, y, z and their side; side 0 where there is none.
fn blocks() -> vec4<u32> {
    if has_occupancy {
        return params.occupancy_cells;
    }
    return vec4<u32>(0u);
}
