// Where a path scatters, and how.

// Where a path scatters: within the medium, or on a surface with its normals and material.
typedef struct {
    bool surface;
    float3 normal;
    float3 facet;
    float3 diffuse;
    float3 specular;
    float exponent;
} Spot;

// What a path along `direction` scatters at, `p` from the mesh's origin: a triangle, or the medium.
Spot spot(const Bound *bound, bool surface, float3 p, float3 direction, uint triangle) {
    Spot at;
    at.surface = false;
    at.normal = at.facet = at.diffuse = at.specular = (float3)(0.0f);
    at.exponent = 0.0f;
    if (!has_mesh || !surface) {
        return at;
    }
    uint first = 2u * bound->params->nodes + 6u * triangle;
    float3 a = place(bound, first);
    float3 b = place(bound, first + 1u);
    float3 c = place(bound, first + 2u);
    float3 across = cross(b - a, c - a);
    float3 own = across / max(sqrt(dot(across, across)), 1.2e-38f);
    at.facet = dot(own, direction) > 0.0f ? -own : own;
    // Shares of the corners: twice the areas across from them.
    float x = dot(cross(b - p, c - p), own);
    float y = dot(cross(c - p, a - p), own);
    float z = dot(cross(a - p, b - p), own);
    float3 normal = x * place(bound, first + 3u) + y * place(bound, first + 4u) + z * place(bound, first + 5u);
    float size = sqrt(dot(normal, normal));
    normal = size > 0.0f ? normal / size : at.facet;
    at.normal = dot(normal, at.facet) < 0.0f ? -normal : normal;
    uint material = bound->params->materials_at + 8u * bound->mesh[first + 3u].number;
    __global const float *of = bound->tables + material;
    at.surface = true;
    at.diffuse = (float3)(of[0], of[1], of[2]);
    at.specular = (float3)(of[4], of[5], of[6]);
    at.exponent = of[3];
    return at;
}

// The share of light from `toward` that is scattered back along `origin`, per steradian: on a surface times the cosine.
float3 scattered(const Bound *bound, const Spot *at, float3 origin, float3 toward) {
    if (!at->surface) {
        return (float3)(phase(bound, dot(toward, origin)));
    }
    float facing = dot(at->normal, toward);
    if (facing <= 0.0f || dot(at->facet, toward) <= 0.0f) {
        return (float3)(0.0f);
    }
    float cosine = dot(origin, toward - 2.0f * facing * at->normal);
    float gloss = 0.0f;
    if (cosine > 0.0f) {
        gloss = (at->exponent + 2.0f) / (2.0f * PI) * pow(min(cosine, 1.0f), at->exponent);
    }
    return facing * (at->diffuse / PI + gloss * at->specular);
}

// The part of a surface's directions that are drawn from its diffuse term.
float dull(const Spot *at) {
    float diffuse = at->diffuse.x + at->diffuse.y + at->diffuse.z;
    float specular = at->specular.x + at->specular.y + at->specular.z;
    return specular > 0.0f ? diffuse / (diffuse + specular) : 1.0f;
}

// The probability that a path from `origin` goes on toward `toward`, per steradian.
float scattered_density(const Bound *bound, const Spot *at, float3 origin, float3 toward) {
    if (!at->surface) {
        return bend_density(bound, dot(toward, origin));
    }
    float facing = dot(at->normal, toward);
    float cosine = dot(origin, toward - 2.0f * facing * at->normal);
    float gloss = 0.0f;
    if (cosine > 0.0f) {
        gloss = (at->exponent + 1.0f) / (2.0f * PI) * pow(min(cosine, 1.0f), at->exponent);
    }
    float part = dull(at);
    return part * max(facing, 0.0f) / PI + (1.0f - part) * gloss;
}
