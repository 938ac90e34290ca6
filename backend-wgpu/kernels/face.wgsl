// Faces of the maps of lights, as core/src/stage/shadow.rs lays them out.

struct Face {
    // Unit, away from the light.
    forward: vec3<f32>,
    right: vec3<f32>,
    up: vec3<f32>,
    // At distance 1; of a directional light's at every distance, metres.
    half_width: f32,
}

// Face `n` of a light's map.
fn face(light: LightRecord, n: u32, extent: f32) -> Face {
    if light.position.w == 0.0 || light.cone.w > 0.0 {
        let parallel = light.position.w == 0.0;
        let way = line(vec3<f32>(0.0), select(light.axis.xyz, -light.position.xyz, parallel));
        return Face(way.direction, way.u, way.v, select(light.cone.w, extent, parallel));
    }
    // Along one axis each, selected, for drivers to which an index is a place in memory.
    let along = vec3<f32>(vec3<u32>(n / 2u) == vec3<u32>(0u, 1u, 2u));
    return Face(select(along, -along, n % 2u == 1u), along.zxy, along.yzx, 1.0);
}

// The face of six that a direction falls on.
fn side_of(v: vec3<f32>) -> u32 {
    let w = abs(v);
    let a = select(select(2u, 1u, w.y >= w.z), 0u, w.x >= w.y && w.x >= w.z);
    return 2u * a + select(0u, 1u, dot(v, vec3<f32>(vec3<u32>(a) == vec3<u32>(0u, 1u, 2u))) < 0.0);
}
