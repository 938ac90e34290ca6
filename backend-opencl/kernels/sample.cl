// Rays through the box of the medium.

// Rays in index space, each cut into equal steps.
typedef struct {
    // Origin in index space.
    F3 origin;
    // Direction in voxels per metre.
    F3 direction;
    // Metres per voxel, of its sign.
    F3 inverse;
    // Metres along the ray where the first step begins.
    F start;
    // Length of a step, metres; zero where there is none.
    F step;
    // Number of steps.
    F steps;
    // Where a step is sampled, as a part of it.
    F place;
} Ray;

// Where a packet of rays is sampled, and its way through the blocks of an occupancy: what does not change along it.
typedef struct {
    // Where the first sample lies, and from there to the next one, in index space.
    F3 origin;
    F3 stride;
    // Blocks along x, y, z and their side in voxels; side 0 for none.
    uint4 blocks;
    // The first sample beyond what block n along an axis shows is n `wide` behind `leave`.
    F3 wide;
    F3 leave;
} Samples;

// What lies before a packet of rays.
typedef struct {
    // Nothing, up to the sample of a number; else something, and until that sample it is of no use to ask again.
    bool empty;
    float until;
} Ahead;

// Where sample `k` lies.
INLINE F3 sampled(const Samples *way, float k) {
    return add3(way->origin, scale3(way->stride, (F)(k)));
}

// Where each lane that is active stands in an empty block at sample `k`: the number of the next sample that any of them must look
// at, the first beyond what is known to be empty. Else until when one of them stands in a block that is not empty.
INLINE Ahead skip(const Bound *bound, const Samples *way, float k, M active) {
    uint4 blocks = way->blocks;
    float per_voxel = 1.0f / convert_float(blocks.w);
    F3 last = all3(convert_float3(blocks.xyz - 1u));
    F3 at = sampled(way, k);
    F zero = (F)(0.0f);
    // What is rounded toward zero in place of down is below zero, and so in the first block.
    I x = to_int(lesser(greater((at.x + 0.5f) * per_voxel, zero), last.x));
    I y = to_int(lesser(greater((at.y + 0.5f) * per_voxel, zero), last.y));
    I z = to_int(lesser(greater((at.z + 0.5f) * per_voxel, zero), last.z));
    I cell = (z * (int)blocks.y + y) * (int)blocks.x + x;
    F3 leave = add3(mul3(f3(to_float(x), to_float(y), to_float(z)), way->wide), way->leave);
    F beyond = floored(lesser(lesser(leave.x, leave.y), leave.z));
    // Means and maxima, in turn.
    M dense = active & (fetch((__global const float *)bound->occupancy, 2 * cell + 1) > zero);
    Ahead ahead;
    ahead.empty = !any_lane(dense);
    float edge = ahead.empty ? smallest_lane(active ? beyond : (F)(INFINITY)) : largest_lane(dense ? beyond : zero);
    ahead.until = fmax(edge, k + 1.0f);
    return ahead;
}

// The rays from `origin` clipped to the box of `size` voxels and to [0, limit] metres, in ceil(length / longest) equal
// steps.
Ray through(F3 origin, F3 direction, float3 size, F limit, float longest) {
    // A ray along a wall: far enough from parallel that what is below are numbers.
    F little = (F)(1e-20f);
    F3 d = f3(fabs(direction.x) < little ? little : direction.x, fabs(direction.y) < little ? little : direction.y,
              fabs(direction.z) < little ? little : direction.z);
    F3 inverse = f3(1.0f / d.x, 1.0f / d.y, 1.0f / d.z);
    F3 lower = mul3(f3(-0.5f - origin.x, -0.5f - origin.y, -0.5f - origin.z), inverse);
    F3 upper = mul3(f3(size.x - 0.5f - origin.x, size.y - 0.5f - origin.y, size.z - 0.5f - origin.z), inverse);
    F zero = (F)(0.0f);
    F near = greater(greater(lesser(lower.x, upper.x), lesser(lower.y, upper.y)), greater(lesser(lower.z, upper.z), zero));
    F far = lesser(lesser(greater(lower.x, upper.x), greater(lower.y, upper.y)), lesser(greater(lower.z, upper.z), limit));
    F extent = greater(far - near, zero);
    Ray ray;
    ray.origin = origin;
    ray.direction = d;
    ray.inverse = inverse;
    ray.start = near;
    ray.steps = ceil(extent / longest);
    ray.step = ray.steps > zero ? extent / greater(ray.steps, (F)(1.0f)) : zero;
    ray.place = (F)(0.5f);
    return ray;
}

// Metres of rays within the box and to `limit`, from points in the box.
F reach(F3 origin, F3 direction, float3 size, F limit) {
    F little = (F)(1e-20f);
    F3 d = f3(fabs(direction.x) < little ? little : direction.x, fabs(direction.y) < little ? little : direction.y,
              fabs(direction.z) < little ? little : direction.z);
    F zero = (F)(0.0f);
    F x = ((d.x > zero ? (F)(size.x - 0.5f) : (F)(-0.5f)) - origin.x) / d.x;
    F y = ((d.y > zero ? (F)(size.y - 0.5f) : (F)(-0.5f)) - origin.y) / d.y;
    F z = ((d.z > zero ? (F)(size.z - 0.5f) : (F)(-0.5f)) - origin.z) / d.z;
    return greater(lesser(lesser(x, y), lesser(z, limit)), zero);
}

// The same part of the rays in `count` steps.
Ray in_steps(Ray ray, float count) {
    ray.step = ray.step * ray.steps / count;
    ray.steps = ray.steps > (F)(0.0f) ? (F)(count) : (F)(0.0f);
    return ray;
}

// The points `t` metres along.
INLINE F3 along(const Ray *ray, F t) {
    return add3(ray->origin, scale3(ray->direction, t));
}

// Where step `k` is sampled, in metres along.
INLINE F middle(const Ray *ray, float k) {
    return ray->start + ray->step * (k + ray->place);
}

// Where the rays are sampled. `blocks` as in `Samples`.
INLINE Samples samples(const Ray *ray, uint4 blocks) {
    Samples way;
    way.origin = along(ray, middle(ray, 0.0f));
    way.stride = scale3(ray->direction, ray->step);
    way.blocks = blocks;
    way.wide = way.leave = all3((float3)(0.0f));
    if (blocks.w > 0u) {
        F side = (F)(convert_float(blocks.w));
        F before = (F)(-0.5f - REDUCE_BEYOND);
        F behind = side - 0.5f + REDUCE_BEYOND;
        F zero = (F)(0.0f);
        F3 d = ray->direction;
        F3 wall = f3(d.x > zero ? behind : before, d.y > zero ? behind : before, d.z > zero ? behind : before);
        F3 per = scale3(ray->inverse, 1.0f / ray->step);
        way.wide = scale3(per, side);
        way.leave = add3(mul3(sub3(wall, way.origin), per), all3((float3)(1.0f)));
    }
    return way;
}

// The column of density along each ray whose lane is active, in units of density times metres. `blocks` as in `Samples`.
F column(const Bound *bound, const Ray *ray, uint4 blocks, M lanes) {
    int3 size = convert_int3(bound->params->dims.xyz);
    F steps = lanes ? ray->steps : (F)(0.0f);
    float last = largest_lane(steps);
    Samples way = samples(ray, blocks);
    F sum = (F)(0.0f);
    float k = 0.0f;
    float ask = 0.0f;
    while (k < last) {
        M active = k < steps;
        if (blocks.w > 0u && k >= ask) {
            Ahead ahead = skip(bound, &way, k, active);
            if (ahead.empty) {
                k = ahead.until;
                continue;
            }
            ask = ahead.until;
        }
        F density = sample_density(bound, sampled(&way, k), size, 0);
        sum += active ? density : (F)(0.0f);
        k += 1.0f;
    }
    return sum * ray->step;
}
