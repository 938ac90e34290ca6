// Where a workgroup stands on the stage's work axis. A dispatch is a part of the axis; a large one fills a plane of
// workgroups, whose last row may reach past its end.

// Number of this workgroup within the dispatch.
fn number(id: vec3<u32>) -> u32 {
    return id.y * launch.across + id.x;
}
