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
    let found = together(a, b, c, d, limits);
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

// No triangle.
const NOTHING: u32 = 0xffffffffu;

// The nearest triangles of four rays from one place, which walk from box to box together: each box is loaded once for all. NOTHING
// where there is none.
fn together(a: Line, b: Line, c: Line, d: Line, limits: vec4<f32>) -> vec4<u32> {
    let x = vec4<f32>(a.inverse.x, b.inverse.x, c.inverse.x, d.inverse.x);
    let y = vec4<f32>(a.inverse.y, b.inverse.y, c.inverse.y, d.inverse.y);
    let z = vec4<f32>(a.inverse.z, b.inverse.z, c.inverse.z, d.inverse.z);
    var found = vec4<u32>(NOTHING);
    var far = limits;
    var node = params.node_begin;
    while node < params.node_end {
        var leaf = 0u;
        loop {
            let low = read_mesh(2u * node);
            let high = read_mesh(2u * node + 1u);
            let lower = vec3<f32>(low.x, low.y, low.z) - a.origin;
            let upper = vec3<f32>(high.x, high.y, high.z) - a.origin;
            let met = vec4<bool>(
                meet(lower, upper, x.x, y.x, z.x, far.x),
                meet(lower, upper, x.y, y.y, z.y, far.y),
                meet(lower, upper, x.z, y.z, z.z, far.z),
                meet(lower, upper, x.w, y.w, z.w, far.w),
            );
            leaf = select(0u, high.number, any(met));
            node = select(low.number, node + 1u, any(met));
            continuing {
                break if node >= params.node_end || (leaf & MESH_COUNT_MASK) != 0u;
            }
        }
        let first = leaf >> MESH_COUNT_BITS;
        for (var k = 0u; k < (leaf & MESH_COUNT_MASK); k++) {
            let at = 2u * params.nodes + 6u * (first + k);
            let p = place(at);
            let q = place(at + 1u);
            let r = place(at + 2u);
            let reached = vec4<f32>(
                crosses(a, p, q, r).x,
                crosses(b, p, q, r).x,
                crosses(c, p, q, r).x,
                crosses(d, p, q, r).x,
            );
            let nearer = (reached >= vec4<f32>(0.0)) & (reached < far);
            far = select(far, reached, nearer);
            found = select(found, vec4<u32>(first + k), nearer);
        }
    }
    return found;
}

// Whether a ray meets a box within `limit` metres, whose corners are counted from where the ray begins.
fn meet(lower: vec3<f32>, upper: vec3<f32>, x: f32, y: f32, z: f32, limit: f32) -> bool {
    let first = lower * vec3<f32>(x, y, z);
    let last = upper * vec3<f32>(x, y, z);
    let near_x = smaller(first.x, last.x);
    let near_y = smaller(first.y, last.y);
    let near_z = smaller(first.z, last.z);
    let far_x = larger(first.x, last.x);
    let far_y = larger(first.y, last.y);
    let far_z = larger(first.z, last.z);
    let near = larger(larger(near_x, near_y), larger(near_z, 0.0));
    let far = smaller(smaller(far_x, far_y), smaller(far_z, limit));
    // Distances are good to a few units in the last place.
    return near <= far * 1.000002;
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
