// Walks along rays from one tentative collision to the next, through cells of constant rate.

// A walk in index space.
struct Walk {
    origin: vec3<f32>,
    // Voxels per metre.
    direction: vec3<f32>,
    // Metres along.
    t: f32,
    // Where it ends.
    far: f32,
    cell: vec3<i32>,
    // Whether it has ended.
    over: bool,
}

// A direction of the world in voxels per metre, far enough from parallel to the walls to divide by.
fn carried(d: vec3<f32>) -> vec3<f32> {
    let c = vec3<f32>(dot(d, params.index_x.xyz), dot(d, params.index_y.xyz), dot(d, params.index_z.xyz));
    return select(c, vec3<f32>(1e-20), abs(c) < vec3<f32>(1e-20));
}

// The walk from a place along a direction of index space within the box, to `limit` metres at the most.
fn walk(origin: vec3<f32>, direction: vec3<f32>, limit: f32) -> Walk {
    let lower = (vec3<f32>(-0.5) - origin) / direction;
    let upper = (vec3<f32>(params.dims.xyz) - 0.5 - origin) / direction;
    let first = min(lower, upper);
    let last = max(lower, upper);
    let near = max(max(first.x, first.y), max(first.z, 0.0));
    let far = min(min(last.x, last.y), min(last.z, limit));
    let side = f32(params.majorant_cells.w);
    let at = floor((origin + near * direction + 0.5) / side);
    let cell = vec3<i32>(clamp(at, vec3<f32>(0.0), vec3<f32>(params.majorant_cells.xyz - 1u)));
    return Walk(origin, direction, near, far, cell, near >= far);
}

// Where it stands, in index space.
fn stands(on: Walk) -> vec3<f32> {
    return on.origin + on.t * on.direction;
}

// On to the next tentative collision within the cell, whose rate it gives; else to the next cell, and 0.
fn advance(on: ptr<function, Walk>, numbers: ptr<function, Draws>) -> f32 {
    let side = f32(params.majorant_cells.w);
    let onward = vec3<i32>(select(vec3<i32>(0), vec3<i32>(1), (*on).direction > vec3<f32>(0.0)));
    let leave = (vec3<f32>((*on).cell + onward) * side - 0.5 - (*on).origin) / (*on).direction;
    var axis = 2u;
    if leave.x <= leave.y && leave.x <= leave.z {
        axis = 0u;
    } else if leave.y <= leave.z {
        axis = 1u;
    }
    let exit = min(leave[axis], (*on).far);
    let cell = vec3<u32>((*on).cell);
    let most = read_majorant((cell.z * params.majorant_cells.y + cell.y) * params.majorant_cells.x + cell.x).y;
    if most > 0.0 {
        let rate = max(most * params.densest, params.least);
        if rate > 0.0 {
            let next = (*on).t + optical_depth(draw(numbers)) / rate;
            if next < exit {
                (*on).t = next;
                return rate;
            }
        }
    }
    (*on).t = max((*on).t, exit);
    let beyond = (*on).cell[axis] + 2 * onward[axis] - 1;
    (*on).cell[axis] = beyond;
    (*on).over = exit >= (*on).far || beyond < 0 || beyond >= i32(params.majorant_cells[axis]);
    return 0.0;
}
