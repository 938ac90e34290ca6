//! The kernel that orders the cells of `project` where several of them march together.

use airlight_core::device::KernelStruct;
use airlight_core::stage::{Project, ProjectParams};

use super::{Place, Shape, ShapeKind, Text, Variant, WGSL, buffer, kept, places, reads, specialised, uniforms};

/// Name of the entry point.
pub(crate) const NAME: &str = "project_order";
/// The binding by which `project` reads the order.
pub(crate) const ORDER: &str = "order";

/// What it may know of its parameters.
pub(crate) fn known_places() -> Vec<Place> {
    places(&ProjectParams::text(WGSL), ProjectParams::NAME)
}

/// How often its loops turn for so many cells.
pub(crate) fn turns(cells: u32) -> u32 {
    2 * (cells.div_ceil(Project::LANES) + 1) + Project::LANES + 1
}

/// The text for bindings of these shapes.
pub(crate) fn text(shapes: &[Shape], variant: Variant<'_>) -> Text {
    let structs = ProjectParams::text(WGSL);
    let mut prelude = structs.clone()
        + &uniforms(ProjectParams::NAME, false)
        + &kept(ProjectParams::NAME, variant.known)
        + &WGSL.integer("LANES", Project::LANES);
    for (index, shape) in shapes.iter().enumerate() {
        prelude += &WGSL.truth(&format!("has_{}", shape.name), shape.present);
        prelude += &match shape.kind {
            ShapeKind::Write => buffer(shape, index),
            _ if variant.fetched.has(index) => reads::texels(shape, index, variant.fetched, &structs),
            _ => reads::memory(shape, index),
        };
    }
    let mut text = Text::default();
    text.push("generated", &prelude);
    text.push("src/project/order.wgsl", include_str!("../project/order.wgsl"));
    specialised(text, &structs, ProjectParams::NAME, variant.known)
}

/// What stands in `project` in place of the order where it takes cells as they come.
pub(crate) fn none() -> String {
    WGSL.truth(&format!("has_{ORDER}"), false) + &format!("fn read_{ORDER}(n: u32) -> u32 {{\n    return n;\n}}\n")
}
