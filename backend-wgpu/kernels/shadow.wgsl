// `shadow`: maps of how far lights reach. One invocation RAYS texels that follow each other.

@compute @workgroup_size(UNITS)
fn shadow(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = RAYS * (number(id) * UNITS + lane);
    if n >= launch.count {
        return;
    }
    let texel = launch.start + n;
    if RAYS == 1u {
        let ray = sent(texel);
        keep(texel, ray, nearest(ray.way, ray.least, FAR, params.node_begin, params.node_end).distance);
        return;
    }
    // Beyond the last it stands again.
    let texels = min(vec4<u32>(texel) + vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(launch.start + launch.count - 1u));
    let a = sent(texels.x);
    let b = sent(texels.y);
    let c = sent(texels.z);
    let d = sent(texels.w);
    let least = vec4<f32>(a.least, b.least, c.least, d.least);
    let found = together(a.way, b.way, c.way, d.way, least, vec4<f32>(FAR), params.node_begin, params.node_end);
    keep(texels.x, a, found.distances.x);
    keep(texels.y, b, found.distances.y);
    keep(texels.z, c, found.distances.z);
    keep(texels.w, d, found.distances.w);
}

// A ray of a light.
struct Sent {
    way: Line,
    // Metres before the first triangle that counts.
    least: f32,
    // Metres along for one of what the map holds.
    size: f32,
}

// The ray of a texel.
fn sent(texel: u32) -> Sent {
    let found = divide(texel, params.side * params.side);
    let number = found.x;
    let row = divide(found.y, params.side);
    // The light whose face it is.
    var i = 0u;
    while i + 1u < params.lights && u32(read_lights(i + 1u).power.w) <= number {
        i++;
    }
    let light = read_lights(i);
    let plane = face(light, number - u32(light.power.w), params.extent);
    let x = (f32(row.y) + 0.5) * (2.0 / f32(params.side)) - 1.0;
    let y = (f32(row.x) + 0.5) * (2.0 / f32(params.side)) - 1.0;
    let across = plane.half_width * (x * plane.right + y * plane.up);
    // One way for both, for drivers that run both sides of a condition.
    let parallel = light.position.w == 0.0;
    let toward = plane.forward + across;
    let size = select(length(toward), 1.0, parallel);
    let origin = select(light.position.xyz, across - params.extent * plane.forward, parallel);
    let way = line(origin, select(toward / size, plane.forward, parallel));
    return Sent(way, select(MESH_MARGIN * params.extent, 0.0, parallel), size);
}

// Stores how far a ray reaches.
fn keep(texel: u32, ray: Sent, distance: f32) {
    let out = texel - launch.first;
    var reach = select(FAR, distance / ray.size, distance < FAR);
    if params.node_begin > 0u {
        reach = min(reach, shadow_map[out]);
    }
    shadow_map[out] = reach;
}
