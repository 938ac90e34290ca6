// Where a path scatters, and how.

// Where a path scatters: within the medium, or on a surface with its normals and material.
struct Spot {
    surface: bool,
    normal: vec3<f32>,
    facet: vec3<f32>,
    diffuse: vec3<f32>,
    specular: vec3<f32>,
    exponent: f32,
}

// What a path along `direction` scatters at, `p` from the mesh's origin: a triangle, or the medium.
fn spot(surface: bool, p: vec3<f32>, direction: vec3<f32>, triangle: u32) -> Spot {
    let none = vec3<f32>(0.0);
    if !has_mesh || !surface {
        return Spot(false, none, none, none, none, 0.0);
    }
    let first = 2u * params.nodes + 6u * triangle;
    let a = place(first);
    let b = place(first + 1u);
    let c = place(first + 2u);
    let across = cross(b - a, c - a);
    let own = across / max(sqrt(dot(across, across)), 1.2e-38);
    let facet = select(own, -own, dot(own, direction) > 0.0);
    // Shares of the corners: twice the areas across from them.
    let x = dot(cross(b - p, c - p), own);
    let y = dot(cross(c - p, a - p), own);
    let z = dot(cross(a - p, b - p), own);
    var normal = x * place(first + 3u) + y * place(first + 4u) + z * place(first + 5u);
    let size = sqrt(dot(normal, normal));
    if size > 0.0 {
        normal = normal / size;
    } else {
        normal = facet;
    }
    normal = select(normal, -normal, dot(normal, facet) < 0.0);
    let m = params.materials_at + 8u * read_mesh(first + 3u).number;
    let diffuse = vec3<f32>(read_tables(m), read_tables(m + 1u), read_tables(m + 2u));
    let specular = vec3<f32>(read_tables(m + 4u), read_tables(m + 5u), read_tables(m + 6u));
    return Spot(true, normal, facet, diffuse, specular, read_tables(m + 3u));
}

// The share of light from `toward` that is scattered back along `origin`, per steradian: on a surface times the cosine.
fn scattered(at: Spot, origin: vec3<f32>, toward: vec3<f32>) -> vec3<f32> {
    if !at.surface {
        return vec3<f32>(phase(dot(toward, origin)));
    }
    let facing = dot(at.normal, toward);
    if facing <= 0.0 || dot(at.facet, toward) <= 0.0 {
        return vec3<f32>(0.0);
    }
    let cosine = dot(origin, toward - 2.0 * facing * at.normal);
    var gloss = 0.0;
    if cosine > 0.0 {
        gloss = (at.exponent + 2.0) / (2.0 * PI) * pow(min(cosine, 1.0), at.exponent);
    }
    return facing * (at.diffuse / PI + gloss * at.specular);
}

// The part of a surface's directions that are drawn from its diffuse term.
fn dull(at: Spot) -> f32 {
    let diffuse = at.diffuse.x + at.diffuse.y + at.diffuse.z;
    let specular = at.specular.x + at.specular.y + at.specular.z;
    if specular > 0.0 {
        return diffuse / (diffuse + specular);
    }
    return 1.0;
}

// The probability that a path from `origin` goes on toward `toward`, per steradian.
fn scattered_density(at: Spot, origin: vec3<f32>, toward: vec3<f32>) -> f32 {
    if !at.surface {
        return bend_density(dot(toward, origin));
    }
    let facing = dot(at.normal, toward);
    let cosine = dot(origin, toward - 2.0 * facing * at.normal);
    var gloss = 0.0;
    if cosine > 0.0 {
        gloss = (at.exponent + 1.0) / (2.0 * PI) * pow(min(cosine, 1.0), at.exponent);
    }
    let part = dull(at);
    return part * max(facing, 0.0) / PI + (1.0 - part) * gloss;
}
