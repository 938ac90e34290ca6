// Rays through the box of the medium.

// A ray in index space, cut into equal steps.
struct Ray {
    // Origin in index space.
    origin: vec3<f32>,
    // Direction in voxels per metre.
    direction: vec3<f32>,
    // Metres per voxel, of its sign.
    inverse: vec3<f32>,
    // Metres along the ray where the first step begins.
    start: f32,
    // Length of a step, metres; zero where there is none.
    step: f32,
    // Number of steps.
    steps: f32,
    // Where a step is sampled, as a part of it.
    place: f32,
}

// Where a ray is sampled, and its way through the blocks of an occupancy: what does not change along it, of which drivers take
// nothing out of loops.
struct Samples {
    // Where the first sample lies, and from there to the next one, in index space.
    origin: vec3<f32>,
    stride: vec3<f32>,
    // Blocks along x, y, z and their side in voxels; side 0 for none.
    blocks: vec4<u32>,
    // The first sample beyond what block n along an axis shows is n `wide` behind `leave`.
    wide: vec3<f32>,
    leave: vec3<f32>,
}

// Where sample `k` lies.
fn sampled(way: Samples, k: f32) -> vec3<f32> {
    return way.origin + k * way.stride;
}

// Number of the next sample to look at where sample `k`, which lies at `at`, stands in an empty block: the first beyond what is
// known to be empty. Else -1.
fn skip(way: Samples, at: vec3<f32>, k: f32) -> f32 {
    let blocks = way.blocks;
    let place = floor((at + 0.5) * (1.0 / f32(blocks.w)));
    let block = clamp(place, vec3<f32>(0.0), vec3<f32>(blocks.xyz - 1u));
    let cell = whole(block);
    if read_occupancy((cell.z * blocks.y + cell.y) * blocks.x + cell.x).y > 0.0 {
        return -1.0;
    }
    let leave = block * way.wide + way.leave;
    let beyond = floor(smaller(smaller(leave.x, leave.y), leave.z));
    return larger(beyond, k + 1.0);
}

// The ray from `origin` clipped to the box of `size` voxels and to [0, limit] metres, in ceil(length / longest) equal
// steps.
fn through(origin: vec3<f32>, direction: vec3<f32>, size: vec3<f32>, limit: f32, longest: f32) -> Ray {
    // A ray along a wall: far enough from parallel that what is below are numbers.
    let d = select(direction, vec3<f32>(1e-20), abs(direction) < vec3<f32>(1e-20));
    let inverse = 1.0 / d;
    let lower = (vec3<f32>(-0.5) - origin) * inverse;
    let upper = (size - 0.5 - origin) * inverse;
    let first = min(lower, upper);
    let last = max(lower, upper);
    let near = max(max(first.x, first.y), max(first.z, 0.0));
    let far = min(min(last.x, last.y), min(last.z, limit));
    let length = max(far - near, 0.0);
    let steps = ceil(length / longest);
    let step = select(0.0, length / max(steps, 1.0), steps > 0.0);
    return Ray(origin, d, inverse, near, step, steps, 0.5);
}

// Metres of a ray within the box and to `limit`, from a point in the box.
fn reach(origin: vec3<f32>, direction: vec3<f32>, size: vec3<f32>, limit: f32) -> f32 {
    let d = select(direction, vec3<f32>(1e-20), abs(direction) < vec3<f32>(1e-20));
    let wall = select(vec3<f32>(-0.5), size - 0.5, d > vec3<f32>(0.0));
    let last = (wall - origin) / d;
    return max(min(min(last.x, last.y), min(last.z, limit)), 0.0);
}

// The same part of the ray in `count` steps.
fn in_steps(ray: Ray, count: f32) -> Ray {
    let steps = select(0.0, count, ray.steps > 0.0);
    return Ray(ray.origin, ray.direction, ray.inverse, ray.start, ray.step * ray.steps / count, steps, ray.place);
}

// The point `t` metres along.
fn along(ray: Ray, t: f32) -> vec3<f32> {
    return ray.origin + t * ray.direction;
}

// Where step `k` is sampled, in metres along.
fn middle(ray: Ray, k: f32) -> f32 {
    return ray.start + ray.step * (k + ray.place);
}

// Where the ray is sampled. `blocks` as in `Samples`.
fn samples(ray: Ray, blocks: vec4<u32>) -> Samples {
    let side = f32(blocks.w);
    let per = ray.inverse * (1.0 / ray.step);
    let origin = along(ray, middle(ray, 0.0));
    let before = vec3<f32>(-0.5 - REDUCE_BEYOND);
    let wall = select(before, vec3<f32>(side - 0.5 + REDUCE_BEYOND), ray.direction > vec3<f32>(0.0));
    return Samples(origin, ray.step * ray.direction, blocks, side * per, (wall - origin) * per + 1.0);
}

// The column of density along the ray, in units of density times metres. What `blocks`, as in `Samples`, show empty adds
// nothing, so that one look at them does for two samples.
fn column(ray: Ray, blocks: vec4<u32>) -> f32 {
    let size = vec3<i32>(params.dims.xyz);
    let way = samples(ray, blocks);
    var sum = 0.0;
    var k = 0.0;
    while k < ray.steps {
        let at = sampled(way, k);
        var onward = k + 2.0;
        var empty = false;
        if blocks.w > 0u {
            let next = skip(way, at, k);
            empty = next >= 0.0;
            onward = select(onward, next, empty);
        }
        if !empty {
            let here = sample_density(at, size, 0);
            let next = sample_density(sampled(way, k + 1.0), size, 0);
            sum += here;
            sum += select(0.0, next, k + 1.0 < ray.steps);
        }
        k = onward;
    }
    return sum * ray.step;
}
