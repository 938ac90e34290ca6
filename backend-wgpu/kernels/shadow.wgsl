// `shadow`: maps of how far lights reach. One invocation a texel.

@compute @workgroup_size(UNITS)
fn shadow(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id) * UNITS + lane;
    if n >= launch.count {
        return;
    }
    let texel = launch.start + n;
    let out = texel - launch.first;
    let number = texel / (params.side * params.side);
    // The light whose face it is.
    var i = 0u;
    while i + 1u < params.lights && u32(read_lights(i + 1u).power.w) <= number {
        i++;
    }
    let light = read_lights(i);
    let plane = face(light, number - u32(light.power.w), params.extent);
    let x = (f32(texel % params.side) + 0.5) * (2.0 / f32(params.side)) - 1.0;
    let y = (f32(texel / params.side % params.side) + 0.5) * (2.0 / f32(params.side)) - 1.0;
    let across = plane.half_width * (x * plane.right + y * plane.up);
    var reach = FAR;
    if light.position.w == 0.0 {
        let origin = across - params.extent * plane.forward;
        reach = nearest(line(origin, plane.forward), 0.0, FAR, params.node_begin, params.node_end).distance;
    } else {
        let toward = plane.forward + across;
        let size = length(toward);
        let way = line(light.position.xyz, toward / size);
        let least = MESH_MARGIN * params.extent;
        let hit = nearest(way, least, FAR, params.node_begin, params.node_end);
        reach = select(FAR, hit.distance / size, hit.distance < FAR);
    }
    if params.node_begin > 0u {
        reach = min(reach, shadow_map[out]);
    }
    shadow_map[out] = reach;
}
