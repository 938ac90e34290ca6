// `trace`: where view rays meet surfaces. One invocation a sub-pixel position.

@compute @workgroup_size(UNITS)
fn trace(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id) * UNITS + lane;
    if n >= launch.count {
        return;
    }
    let unit = launch.start + n;
    let out = 2u * (unit - launch.first);
    let way = line(params.eye.xyz, view(unit));
    var limit = FAR;
    if params.node_begin > 0u {
        limit = min(hits[out].w, FAR);
    }
    let hit = nearest(way, 0.0, limit, params.node_begin, params.node_end);
    if hit.distance < FAR {
        let at = 2u * params.nodes + 6u * hit.triangle;
        let own = facet(way, at);
        var normal = hit.weights.x * place(at + 3u) + hit.weights.y * place(at + 4u) + hit.weights.z * place(at + 5u);
        let size = length(normal);
        normal = select(own, normal / max(size, 1.2e-38), size > 0.0);
        normal = select(normal, -normal, dot(normal, own) < 0.0);
        hits[out] = vec4<f32>(normal, hit.distance);
        hits[out + 1u] = vec4<f32>(own, f32(read_mesh(at + 3u).number));
    } else if params.node_begin == 0u {
        hits[out] = vec4<f32>(0.0, 0.0, 0.0, launch.infinity);
        hits[out + 1u] = vec4<f32>(0.0);
    }
}

// The normal of the triangle whose records begin at `at`, on the side that the ray comes from.
fn facet(way: Line, at: u32) -> vec3<f32> {
    let a = place(at);
    let across = cross(place(at + 1u) - a, place(at + 2u) - a);
    let own = across / max(length(across), 1.2e-38);
    return select(own, -own, dot(own, way.direction) > 0.0);
}
