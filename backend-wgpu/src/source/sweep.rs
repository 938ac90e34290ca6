//! Kernels that `sweep` is put together from where it keeps light in textures, in place of its own.

use airlight_core::device::{Helper, KernelFile, KernelStruct};
use airlight_core::stage::{SweepDirection, SweepParams};

use super::{Place, Shape, ShapeKind, Text, Variant, WGSL, buffer, helper, kept, places, reads, specialised, uniforms};

/// One of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kernel {
    /// What cells scatter toward each direction of a batch, in memory.
    Toward,
    /// What they do to light, by texels of four.
    Turn,
    /// What they scatter toward each direction of a batch, by texels of four.
    Scatter,
    /// Planes, by rows of four cells.
    Rows,
    /// Moments of a batch, four coefficients of four by four cells at a time.
    Moments,
}

impl Kernel {
    /// Name of the entry point.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Toward => "sweep_toward",
            Self::Turn => "sweep_turn",
            Self::Scatter => "sweep_scatter",
            Self::Rows => "sweep_rows",
            Self::Moments => "sweep_moments",
        }
    }

    fn file(self) -> KernelFile {
        match self {
            Self::Toward => KernelFile { name: "src/sweep/toward.wgsl", text: include_str!("../sweep/toward.wgsl") },
            Self::Turn => KernelFile { name: "src/sweep/turn.wgsl", text: include_str!("../sweep/turn.wgsl") },
            Self::Scatter => KernelFile { name: "src/sweep/scatter.wgsl", text: include_str!("../sweep/scatter.wgsl") },
            Self::Rows => KernelFile { name: "src/sweep/rows.wgsl", text: include_str!("../sweep/rows.wgsl") },
            Self::Moments => KernelFile { name: "src/sweep/moments.wgsl", text: include_str!("../sweep/moments.wgsl") },
        }
    }

    /// What it may know of its parameters.
    pub(crate) fn places(self) -> Vec<Place> {
        places(&SweepParams::text(WGSL), SweepParams::NAME)
    }

    /// The text for bindings of these shapes.
    pub(crate) fn text(self, shapes: &[Shape], variant: Variant<'_>) -> Text {
        let structs = SweepParams::text(WGSL) + &SweepDirection::text(WGSL);
        let mut prelude = structs.clone()
            + &uniforms(SweepParams::NAME, false)
            + &kept(SweepParams::NAME, variant.known)
            + &WGSL.integer("UNITS", variant.units);
        for (index, shape) in shapes.iter().enumerate() {
            prelude += &WGSL.truth(&format!("has_{}", shape.name), shape.present);
            prelude += &match shape.kind {
                ShapeKind::Write if variant.fetched.has(index) => reads::held(shape, index),
                ShapeKind::Write => buffer(shape, index),
                _ if variant.fetched.has(index) => reads::texels(shape, index, variant.fetched, &structs),
                _ => reads::memory(shape, index),
            };
        }
        let mut text = Text::default();
        text.push("generated", &prelude);
        if self == Self::Rows {
            let segment = helper(Helper::Segment);
            text.push(segment.name, segment.text);
        }
        if self != Self::Toward {
            text.push("src/sweep/fours.wgsl", include_str!("../sweep/fours.wgsl"));
        }
        let file = self.file();
        text.push(file.name, file.text);
        specialised(text, &structs, SweepParams::NAME, variant.known)
    }
}
