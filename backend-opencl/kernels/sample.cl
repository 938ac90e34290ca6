// Rays through the box of the medium.

// A ray in index space, cut into equal steps.
typedef struct {
    // Origin in index space.
    float3 origin;
    // Direction in voxels per metre.
    float3 direction;
    // Metres along the ray where the first step begins.
    float start;
    // Length of a step, metres; zero where there is none.
    float step;
    // Number of steps.
    float steps;
    // Where a step is sampled, as a part of it.
    float place;
} Ray;

// Number of the next sample to look at where the ray stands in an empty block, else -1. Samples lie at t0 + (k +
// place) steps. `blocks`: blocks along x, y, z and their side in voxels.
float skip(const Bound *bound, const Ray *ray, float t, float k, uint4 blocks) {
    float side = convert_float(blocks.w);
    float3 place = floor((ray->origin + t * ray->direction + 0.5f) / side);
    float3 block = place > (float3)(0.0f) ? min(place, convert_float3(blocks.xyz - 1u)) : (float3)(0.0f);
    uint3 cell = convert_uint3(block);
    if (bound->occupancy[((size_t)cell.z * blocks.y + cell.y) * blocks.x + cell.x].y > 0.0f) {
        return -1.0f;
    }
    float3 wall = ray->direction > (float3)(0.0f) ? (block + 1.0f) * side - 0.5f : block * side - 0.5f;
    float3 leave = (wall - ray->origin) / ray->direction;
    float exit = min(min(leave.x, leave.y), leave.z);
    // The sample before the wall is looked at again, so that rounding cannot pass over one behind it.
    float beyond = floor((exit - ray->start) / ray->step - ray->place);
    return max(beyond, k + 1.0f);
}

// The ray from `origin` clipped to the box of `size` voxels and to [0, limit] metres, in ceil(length / longest) equal
// steps.
Ray through(float3 origin, float3 direction, float3 size, float limit, float longest) {
    // A ray along a wall: far enough from parallel that the quotients below are numbers.
    float3 d = fabs(direction) < (float3)(1e-20f) ? (float3)(1e-20f) : direction;
    float3 lower = (-0.5f - origin) / d;
    float3 upper = (size - 0.5f - origin) / d;
    float3 first = min(lower, upper);
    float3 last = max(lower, upper);
    float near = max(max(first.x, first.y), max(first.z, 0.0f));
    float far = min(min(last.x, last.y), min(last.z, limit));
    float extent = max(far - near, 0.0f);
    Ray ray;
    ray.origin = origin;
    ray.direction = d;
    ray.start = near;
    ray.steps = ceil(extent / longest);
    ray.step = ray.steps > 0.0f ? extent / max(ray.steps, 1.0f) : 0.0f;
    ray.place = 0.5f;
    return ray;
}

// The same part of the ray in `count` steps.
Ray in_steps(Ray ray, float count) {
    ray.step = ray.step * ray.steps / count;
    ray.steps = ray.steps > 0.0f ? count : 0.0f;
    return ray;
}

// The point `t` metres along.
float3 along(const Ray *ray, float t) {
    return ray->origin + t * ray->direction;
}

// Where step `k` is sampled, in metres along.
float middle(const Ray *ray, float k) {
    return ray->start + ray->step * (k + ray->place);
}

// The column of density along the ray, in units of density times metres. `blocks` as in `skip`, of side 0 for none.
float column(const Bound *bound, const Ray *ray, uint4 blocks) {
    int3 size = convert_int3(bound->params->dims.xyz);
    float sum = 0.0f;
    float k = 0.0f;
    while (k < ray->steps) {
        float t = middle(ray, k);
        if (blocks.w > 0u) {
            float next = skip(bound, ray, t, k, blocks);
            if (next >= 0.0f) {
                k = next;
                continue;
            }
        }
        sum += sample_density(bound, along(ray, t), size, 0);
        k += 1.0f;
    }
    return sum * ray->step;
}
