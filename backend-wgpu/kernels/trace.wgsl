// `trace`: where view rays meet surfaces. One invocation RAYS sub-pixel positions that follow each other.

@compute @workgroup_size(UNITS)
fn trace(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = RAYS * (number(id) * UNITS + lane);
    if n >= launch.count {
        return;
    }
    let unit = launch.start + n;
    if RAYS == 1u {
        let way = line(params.eye.xyz, view(unit));
        let hit = nearest(way, 0.0, limit(unit), params.node_begin, params.node_end);
        keep(unit, way, hit);
        return;
    }
    // Beyond the last it stands again.
    let units = min(vec4<u32>(unit) + vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(launch.start + launch.count - 1u));
    let a = line(params.eye.xyz, view(units.x));
    let b = line(params.eye.xyz, view(units.y));
    let c = line(params.eye.xyz, view(units.z));
    let d = line(params.eye.xyz, view(units.w));
    let limits = vec4<f32>(limit(units.x), limit(units.y), limit(units.z), limit(units.w));
    let found = together(a, b, c, d, vec4<f32>(0.0), limits, params.node_begin, params.node_end).triangles;
    keep(units.x, a, again(a, found.x));
    keep(units.y, b, again(b, found.y));
    keep(units.z, c, again(c, found.z));
    keep(units.w, d, again(d, found.w));
}

// Where a ray ends: at what the passes before found.
fn limit(unit: u32) -> f32 {
    if params.node_begin == 0u {
        return FAR;
    }
    return min(hits[2u * (unit - launch.first)].w, FAR);
}

// Stores what a ray meets.
fn keep(unit: u32, way: Line, hit: Hit) {
    let out = 2u * (unit - launch.first);
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

// What a ray meets of a triangle that it is known to meet, or nothing.
fn again(way: Line, triangle: u32) -> Hit {
    if triangle == NOTHING {
        return Hit(FAR, 0u, vec3<f32>(0.0));
    }
    let at = crossed(way, triangle);
    return Hit(at.x, triangle, at.yzw);
}

// The normal of the triangle whose records begin at `at`, on the side that the ray comes from.
fn facet(way: Line, at: u32) -> vec3<f32> {
    let a = place(at);
    let across = cross(place(at + 1u) - a, place(at + 2u) - a);
    let own = across / max(length(across), 1.2e-38);
    return select(own, -own, dot(own, way.direction) > 0.0);
}
