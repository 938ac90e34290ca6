// `shadow`: maps of how far lights reach. One invocation a texel.

@compute @workgroup_size(UNITS)
fn shadow(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id) * UNITS + lane;
    if n >= launch.count {
        return;
    }
    let texel = launch.start + n;
    let out = texel - launch.first;
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
    let least = select(MESH_MARGIN * params.extent, 0.0, parallel);
    let hit = nearest(way, least, FAR, params.node_begin, params.node_end);
    var reach = select(FAR, hit.distance / size, hit.distance < FAR);
    if params.node_begin > 0u {
        reach = min(reach, shadow_map[out]);
    }
    shadow_map[out] = reach;
}
