// How kernels of `sweep` keep what cells hold: by texels of four cells that follow each other in a row. Rows lead along x, or along y
// for directions along x, so that they lie in the planes of cells. Behind the end of a row its last cell stands again.

// Cells of a row, rows of a slice, and texels of a row.
fn rows(turned: bool) -> vec3<u32> {
    let cells = select(params.cells.xy, params.cells.yx, turned);
    return vec3<u32>(cells, (cells.x + 3u) / 4u);
}

// Texels of a value of all cells, whichever way their rows lead.
fn texels() -> u32 {
    let a = rows(false);
    let b = rows(true);
    return max(a.y * a.z, b.y * b.z) * params.cells.z;
}

// What the cells do to light is so many values: extinctions, albedos and emissions, of as many channels as differ.
fn extinctions() -> u32 {
    return select(params.channels, 1u, params.grey == 1u);
}

fn albedos() -> u32 {
    return select(params.channels, 0u, params.source_coefficients == 0u);
}

fn values() -> u32 {
    return extinctions() + albedos() + select(0u, params.channels, params.emits == 1u);
}

// Four cells of a row of which so many are left, with the last of them again behind it.
fn ended(v: vec4<f32>, left: u32) -> vec4<f32> {
    let y = select(v.x, v.y, left > 1u);
    let z = select(y, v.z, left > 2u);
    return vec4<f32>(v.x, y, z, select(z, v.w, left > 3u));
}

// Four by four cells of a slice: the first of them, and how many cells are left from there on along x and y.
struct Tile {
    first: vec3<u32>,
    left: vec2<u32>,
}

// Tile number `n` of all.
fn tile(n: u32) -> Tile {
    let fours = (params.cells.xy + 3u) / 4u;
    let row = divide(n, fours.x);
    let slice = divide(row.x, fours.y);
    let first = vec3<u32>(4u * row.y, 4u * slice.y, slice.x);
    return Tile(first, params.cells.xy - first.xy);
}

// Tiles.
fn tiles() -> u32 {
    return ((params.cells.x + 3u) / 4u) * ((params.cells.y + 3u) / 4u) * params.cells.z;
}

// Where the texels of a tile lie: the first one, how many texels on the others, or the last one again, and how many there are.
struct Laid {
    first: u32,
    on: vec3<u32>,
    count: u32,
}

fn laid(at: Tile, turned: bool) -> Laid {
    let row = rows(turned);
    let begin = select(at.first.xy, at.first.yx, turned);
    let count = min(select(at.left.y, at.left.x, turned), 4u);
    let first = (at.first.z * row.y + begin.y) * row.z + begin.x / 4u;
    return Laid(first, min(vec3<u32>(1u, 2u, 3u), vec3<u32>(count - 1u)) * row.z, count);
}

// Rows of a tile, or its columns.
fn turned_if(tile: mat4x4<f32>, turned: bool) -> mat4x4<f32> {
    let other = transpose(tile);
    return mat4x4<f32>(
        select(tile[0], other[0], turned), select(tile[1], other[1], turned), select(tile[2], other[2], turned),
        select(tile[3], other[3], turned),
    );
}
