// Light that arrives at a point of a view ray.

struct Incident {
    // Unit direction toward the light.
    toward: vec3<f32>,
    // Distance to it, metres.
    distance: f32,
    // What falloff and cone leave of its power.
    falloff: f32,
}

// A direction of the world in voxels per metre.
fn to_index(d: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot(d, params.index_x.xyz), dot(d, params.index_y.xyz), dot(d, params.index_z.xyz));
}

// The light `t` metres along the view ray.
fn incident(light: LightRecord, d: vec3<f32>, t: f32) -> Incident {
    if light.position.w == 0.0 {
        return Incident(light.position.xyz, FAR, 1.0);
    }
    let v = light.position.xyz - t * d;
    let square = dot(v, v);
    let distance = sqrt(square);
    // Not by the distance: where software drivers have both sides at once that is FAR, and what is as small as that is slow.
    let toward = v / sqrt(max(square, 1.2e-38));
    var falloff = 1.0 / max(square, params.light_floor);
    if params.spots > 0u && light.cone.z == 1.0 {
        // A cone without a rim is a step at the cutoff.
        let rim = max(light.cone.y - light.cone.x, 1e-6);
        let angle = angle_of_cosine(dot(-light.axis.xyz, toward));
        falloff *= clamp((light.cone.y - angle) / rim, 0.0, 1.0);
    }
    return Incident(toward, distance, falloff);
}
