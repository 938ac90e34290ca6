// `coarsen`: what a medium does to light, as means over the cells of a coarse grid. One invocation a cell.

@compute @workgroup_size(UNITS)
fn coarsen(@builtin(workgroup_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = number(id) * UNITS + lane;
    if n >= launch.count {
        return;
    }
    let index = launch.start + n;
    let cells = params.cells.xyz;
    let cell = vec3<u32>(index % cells.x, index / cells.x % cells.y, index / cells.x / cells.y);
    let begin = vec3<f32>(cell) * params.cell.xyz;
    let end = vec3<f32>(cell + 1u) * params.cell.xyz;
    let size = params.dims.xyz;
    let lo = min(vec3<u32>(floor(begin)), size - 1u);
    let hi = clamp(vec3<u32>(ceil(end)), vec3<u32>(1u), size) - 1u;
    var density = 0.0;
    var scatters = vec3<f32>(0.0);
    var shines = vec3<f32>(0.0);
    // Two voxels of two slices a turn: what the rows begin with is asked for before the rest, for that is what is far away. The
    // first is even, as blocks of bricks begin, so that sums are those of every layout; what lies before the cell weighs nothing.
    for (var k = lo.z; k <= hi.z; k += 2u) {
        let behind = min(k + 1u, hi.z);
        let weigh_k = share(begin.z, end.z, k);
        let weigh_behind = select(0.0, share(begin.z, end.z, behind), k < hi.z);
        for (var j = lo.y; j <= hi.y; j++) {
            let rows = share(begin.y, end.y, j) * vec2<f32>(weigh_k, weigh_behind);
            for (var i = lo.x - lo.x % 2u; i <= hi.x; i += 2u) {
                let beside = min(i + 1u, hi.x);
                let a = vec3<i32>(vec3<u32>(i, j, k));
                let b = vec3<i32>(vec3<u32>(i, j, behind));
                let c = vec3<i32>(vec3<u32>(beside, j, k));
                let d = vec3<i32>(vec3<u32>(beside, j, behind));
                // What holds zero alone adds nothing; only what shines by itself may be where there is no density.
                var zeros = min(empty_density(a), empty_density(b));
                if has_emission_density {
                    zeros = min(zeros, min(empty_emission_density(a), empty_emission_density(b)));
                }
                if zeros > 0 {
                    i += u32(zeros) - 2u;
                    continue;
                }
                let here = share(begin.x, end.x, i);
                let next = select(0.0, share(begin.x, end.x, beside), i < hi.x);
                let w = vec4<f32>(here * rows, next * rows);
                let all = vec3<i32>(size);
                let rho = vec4<f32>(
                    texel_density(a, all, 0), texel_density(b, all, 0), texel_density(c, all, 0), texel_density(d, all, 0),
                );
                let mass = dot(w, rho);
                var own = vec3<f32>(mass);
                var glow = vec3<f32>(mass);
                if has_scattering {
                    own = mat4x3<f32>(
                        texel_scattering(a, all, 0).xyz, texel_scattering(b, all, 0).xyz,
                        texel_scattering(c, all, 0).xyz, texel_scattering(d, all, 0).xyz,
                    ) * w;
                }
                if has_emission_color {
                    glow = mat4x3<f32>(
                        texel_emission_color(a, all, 0).xyz, texel_emission_color(b, all, 0).xyz,
                        texel_emission_color(c, all, 0).xyz, texel_emission_color(d, all, 0).xyz,
                    ) * w;
                } else if has_emission_density {
                    glow = vec3<f32>(dot(w, vec4<f32>(
                        texel_emission_density(a, all, 0), texel_emission_density(b, all, 0),
                        texel_emission_density(c, all, 0), texel_emission_density(d, all, 0),
                    )));
                }
                density += mass;
                scatters += own;
                shines += glow;
            }
        }
    }
    let within = max(min(end, vec3<f32>(size)) - begin, vec3<f32>(0.0));
    // A cell holds a part of a voxel at the least, but its sides are rounded.
    let volume = max(within.x * within.y * within.z, 1e-30);
    let go_on = params.emission.w;
    let scattering = scatters / volume * params.extinction.xyz * params.albedo.xyz;
    let extinction = max(density / volume * params.extinction.xyz - go_on * scattering, vec3<f32>(0.0));
    let thin = (1.0 - go_on) * params.albedo.xyz / (1.0 - go_on * params.albedo.xyz);
    let glow = shines / volume * params.emission.xyz;
    let count = cells.x * cells.y * cells.z;
    for (var c = 0u; c < 3u; c++) {
        var albedo = thin[c];
        if extinction[c] > 0.0 {
            albedo = (1.0 - go_on) * scattering[c] / extinction[c];
        }
        optics[c * count + index] = extinction[c];
        optics[(3u + c) * count + index] = albedo;
        optics[(6u + c) * count + index] = glow[c];
    }
}

// The part of voxel `i` that lies between two places; voxel i fills i to i + 1.
fn share(begin: f32, end: f32, i: u32) -> f32 {
    return max(min(end, f32(i) + 1.0) - max(begin, f32(i)), 0.0);
}
