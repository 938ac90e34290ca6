// Rays through a mesh, as core/src/stage/trace.rs lays it out.

// A ray, and directions across it.
struct Line {
    origin: vec3<f32>,
    // Unit.
    direction: vec3<f32>,
    // One over the direction.
    inverse: vec3<f32>,
    u: vec3<f32>,
    v: vec3<f32>,
}

struct Hit {
    // Metres along, FAR for none.
    distance: f32,
    triangle: u32,
    // Of the corners.
    weights: vec3<f32>,
}

// The ray along a unit `direction`, with a frame across it (Duff et al. 2017).
fn line(origin: vec3<f32>, direction: vec3<f32>) -> Line {
    let s = select(-1.0, 1.0, direction.z >= 0.0);
    let a = -1.0 / (s + direction.z);
    let b = direction.x * direction.y * a;
    let u = vec3<f32>(1.0 + s * direction.x * direction.x * a, s * b, -s * direction.x);
    let v = vec3<f32>(b, s + direction.y * direction.y * a, -direction.y);
    // Along a wall of a box: far enough from parallel to divide by.
    let d = select(direction, vec3<f32>(1e-20), abs(direction) < vec3<f32>(1e-20));
    return Line(origin, direction, 1.0 / d, u, v);
}

// The nearest triangle within boxes `begin` to `end`, between `least` and `limit` metres along. Rays that walk together
// look for their next boxes with triangles first, and at those together.
fn nearest(way: Line, least: f32, limit: f32, begin: u32, end: u32) -> Hit {
    var found = Hit(FAR, 0u, vec3<f32>(0.0));
    var far = limit;
    var node = begin;
    while node < end {
        var leaf = 0u;
        loop {
            leaf = visited(way, &node, far);
            continuing {
                break if node >= end || (leaf & MESH_COUNT_MASK) != 0u;
            }
        }
        let first = leaf >> MESH_COUNT_BITS;
        for (var k = 0u; k < (leaf & MESH_COUNT_MASK); k++) {
            let at = crossed(way, first + k);
            if at.x >= least && at.x < far {
                far = at.x;
                found = Hit(far, first + k, at.yzw);
            }
        }
    }
    return found;
}

// No triangle.
const NOTHING: u32 = 0xffffffffu;

// What four rays meet: metres along, and triangles, NOTHING where there is none.
struct Hits {
    distances: vec4<f32>,
    triangles: vec4<u32>,
}

// The nearest triangles of four rays, which walk from box to box together: each box is loaded once for all. Drivers see where rays
// begin at one place or run parallel.
fn together(a: Line, b: Line, c: Line, d: Line, least: vec4<f32>, limits: vec4<f32>, begin: u32, end: u32) -> Hits {
    var found = vec4<u32>(NOTHING);
    var far = limits;
    var node = begin;
    while node < end {
        var leaf = 0u;
        loop {
            let low = read_mesh(2u * node);
            let high = read_mesh(2u * node + 1u);
            let lower = vec3<f32>(low.x, low.y, low.z);
            let upper = vec3<f32>(high.x, high.y, high.z);
            let met = vec4<bool>(
                reaches(a, lower, upper, far.x),
                reaches(b, lower, upper, far.y),
                reaches(c, lower, upper, far.z),
                reaches(d, lower, upper, far.w),
            );
            leaf = select(0u, high.number, any(met));
            node = select(low.number, node + 1u, any(met));
            continuing {
                break if node >= end || (leaf & MESH_COUNT_MASK) != 0u;
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
            let nearer = (reached >= least) & (reached < far);
            far = select(far, reached, nearer);
            found = select(found, vec4<u32>(first + k), nearer);
        }
    }
    return Hits(far, found);
}

// Whether one of four rays reaches a box within `limit` metres.
fn reaches(way: Line, lower: vec3<f32>, upper: vec3<f32>, limit: f32) -> bool {
    let first = (lower - way.origin) * way.inverse;
    let last = (upper - way.origin) * way.inverse;
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

// Whether a triangle of boxes `begin` to `end` stands within `limit` metres.
fn blocked(way: Line, limit: f32, begin: u32, end: u32) -> bool {
    var stands = false;
    var node = begin;
    while node < end {
        var leaf = 0u;
        loop {
            leaf = visited(way, &node, limit);
            continuing {
                break if node >= end || (leaf & MESH_COUNT_MASK) != 0u;
            }
        }
        let first = leaf >> MESH_COUNT_BITS;
        for (var k = 0u; k < (leaf & MESH_COUNT_MASK); k++) {
            let at = crossed(way, first + k);
            stands = stands || (at.x >= 0.0 && at.x < limit);
        }
        if stands {
            node = end;
        }
    }
    return stands;
}

// The first box of triangles that reaches into that from `lower` to `upper`, and the one past the last; the number of boxes and
// none where none does.
fn first_within(lower: vec3<f32>, upper: vec3<f32>) -> vec2<u32> {
    var node = 0u;
    var found = vec2<u32>(params.nodes, 0u);
    while node < params.nodes {
        let low = read_mesh(2u * node);
        let high = read_mesh(2u * node + 1u);
        let meets = all(lower <= vec3<f32>(high.x, high.y, high.z)) && all(upper >= vec3<f32>(low.x, low.y, low.z));
        let triangles = meets && (high.number & MESH_COUNT_MASK) != 0u;
        found = select(found, vec2<u32>(min(found.x, node), node + 1u), triangles);
        node = select(low.number, node + 1u, meets);
    }
    return found;
}

// Steps on from a box: what stands for its triangles where the ray meets it, else none.
fn visited(way: Line, node: ptr<function, u32>, limit: f32) -> u32 {
    let low = read_mesh(2u * *node);
    let high = read_mesh(2u * *node + 1u);
    let met = meets(way, low, high, limit);
    *node = select(low.number, *node + 1u, met);
    return select(0u, high.number, met);
}

// Whether the ray meets a box within `limit` metres.
fn meets(way: Line, low: MeshRecord, high: MeshRecord, limit: f32) -> bool {
    let lower = vec3<f32>(low.x, low.y, low.z);
    let upper = vec3<f32>(high.x, high.y, high.z);
    let back = way.inverse < vec3<f32>(0.0);
    let first = (select(lower, upper, back) - way.origin) * way.inverse;
    // Distances are good to a few units in the last place.
    let last = (select(upper, lower, back) - way.origin) * (way.inverse * 1.000002);
    let near = larger(larger(first.x, first.y), larger(first.z, 0.0));
    let far = smaller(smaller(last.x, last.y), smaller(last.z, limit * 1.000002));
    return near <= far;
}

// Where the ray crosses a triangle: metres along, -1 where it does not; weights of the corners.
fn crossed(way: Line, triangle: u32) -> vec4<f32> {
    let at = 2u * params.nodes + 6u * triangle;
    return crosses(way, place(at), place(at + 1u), place(at + 2u));
}

// The same of a triangle's corners.
fn crosses(way: Line, first_corner: vec3<f32>, second_corner: vec3<f32>, third_corner: vec3<f32>) -> vec4<f32> {
    let a = seen(way, first_corner);
    let b = seen(way, second_corner);
    let c = seen(way, third_corner);
    let first = vec3<f32>(b.x * c.y, c.x * a.y, a.x * b.y);
    let second = vec3<f32>(b.y * c.x, c.y * a.x, a.y * b.x);
    let edges = first - second;
    let slack = MESH_SLACK * (abs(first) + abs(second));
    if !all(edges >= -slack) && !all(edges <= slack) {
        return vec4<f32>(-1.0);
    }
    let s = select(-1.0, 1.0, edges.x + edges.y + edges.z >= 0.0);
    let inside = max(s * edges, vec3<f32>(0.0));
    let sum = inside.x + inside.y + inside.z;
    if sum <= 0.0 {
        return vec4<f32>(-1.0);
    }
    let weights = inside / sum;
    return vec4<f32>(weights.x * a.z + weights.y * b.z + weights.z * c.z, weights);
}

// The place of a record.
fn place(record: u32) -> vec3<f32> {
    let at = read_mesh(record);
    return vec3<f32>(at.x, at.y, at.z);
}

// A point across and along the ray.
fn seen(way: Line, point: vec3<f32>) -> vec3<f32> {
    let p = point - way.origin;
    return vec3<f32>(dot(p, way.u), dot(p, way.v), dot(p, way.direction));
}
