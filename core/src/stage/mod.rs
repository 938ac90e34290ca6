//! The stages: all that a device must be able to run.
//!
//! A stage is parameters and handles. It reads fields and buffers, writes buffers, and its work axis may be cut into
//! ranges, which do not depend on each other unless the stage is sequential. Each file here says what its stage computes and where that comes from;
//! kernels of the same name in every backend compute it, and `crate::reference` has a slow twin in f64.

mod accumulate;
mod classify;
mod coarsen;
mod evaluate;
mod examples;
mod grid;
mod illuminate;
mod inject;
mod march;
mod obstruct;
mod path;
mod path_tables;
mod photon_tables;
mod photons;
mod project;
pub mod propagate;
mod reconstruct;
mod reduce;
mod relight;
mod shade;
mod shadow;
mod sweep;
mod trace;
mod upsample;

pub use accumulate::{Accumulate, AccumulateParams, mode as accumulate_mode};
pub use classify::{Classify, ClassifyParams, ControlRecord, classify_kind};
pub use coarsen::{Coarsen, CoarsenParams};
pub use evaluate::{Evaluate, EvaluateParams};
pub use examples::examples;
pub use grid::{FAR, GridParams, PhaseParams};
pub use illuminate::{Illuminate, IlluminateParams};
pub use inject::{BlobRecord, Inject, InjectParams, inject_kind};
pub use march::{LightRecord, March, MarchParams, alone, shadow_kind};
pub use obstruct::{Obstruct, ObstructParams};
pub use path::{Path, PathParams, PathRecord, path_mode};
pub use path_tables::PathTables;
pub use photon_tables::{PhotonTable, photon_tables};
pub use photons::{PhotonDirection, PhotonParams, Photons, photon_counter, photon_deposit};
pub use project::{Project, ProjectParams};
pub use propagate::{LightFace, LightPlace, Propagate, PropagateParams};
pub use reconstruct::{Reconstruct, ReconstructParams};
pub use reduce::{Reduce, ReduceParams};
pub use relight::{Relight, RelightParams};
pub use shade::{MaterialRecord, Shade, ShadeParams};
pub use shadow::{Shadow, ShadowParams, surface_shadow};
pub use sweep::{Sweep, SweepDirection, SweepParams};
pub use trace::{MeshRecord, Trace, TraceParams};
pub use upsample::{Upsample, UpsampleParams};

use crate::device::{Binding, BindingAccess};

/// What a stage says of itself.
pub trait Kernel {
    /// Name of the stage and of its kernel files.
    const NAME: &'static str;

    /// The parameters' bytes, as kernels see them.
    fn params(&self) -> &[u8];

    /// The resources, in the kernels' order.
    fn bindings(&self) -> Vec<Binding>;

    /// Length of the work axis.
    fn axis(&self) -> u32;

    /// Units of the work axis that touch the same part of the buffers that are bound in parts
    /// ([`Binding::part`]).
    fn group(&self) -> u32 {
        1
    }

    /// Where units of the work axis run in order, each seeing what the ones before wrote: the items of a unit, which do
    /// not depend on each other. None where no unit depends on another.
    fn sequential(&self) -> Option<u32> {
        None
    }

    /// Whether parameters and resources fit each other.
    ///
    /// # Errors
    /// What does not fit. Kernels index without checks behind this one.
    fn validate(&self) -> Result<(), String>;

    /// The stage cut into passes, so that all loops of an invocation together turn at most `turns` times. Passes run in
    /// order, each over the whole work axis, and each goes on from what the ones before left in the outputs.
    ///
    /// # Errors
    /// What turns more often and cannot be cut.
    fn passes(&self, turns: u64) -> Result<Vec<Self>, String>
    where
        Self: Sized;
}

/// A stage with its parameters and resources. Devices match it without a catch-all arm, so that a new stage does not
/// compile until every device has it.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "a frame has a handful of stages, and plans hold them boxed")]
pub enum Stage {
    /// Coarse mean and maximum of a field.
    Reduce(Reduce),
    /// Moments of transmittance or radiance at the cells of a record grid.
    Project(Project),
    /// Columns or mean densities from every cell to each light.
    Propagate(Propagate),
    /// In-scattered radiance from records and light.
    Relight(Relight),
    /// View rays through the medium.
    March(March),
    /// Density of a medium that is described instead of sampled.
    Inject(Inject),
    /// Where view rays meet surfaces.
    Trace(Trace),
    /// Light that surfaces send to the eye.
    Shade(Shade),
    /// How far lights reach before they meet surfaces.
    Shadow(Shadow),
    /// The picture from a film of the medium alone, which may be smaller.
    Upsample(Upsample),
    /// The mean of the medium over the pictures of a sequence.
    Accumulate(Accumulate),
    /// What a medium does to light, over the cells of a coarse grid.
    Coarsen(Coarsen),
    /// Moments of the unscattered light of analytic lights.
    Illuminate(Illuminate),
    /// Light along many directions, each cell's from its neighbours upwind.
    Sweep(Sweep),
    /// Which neighbours of a cell lie behind surfaces.
    Obstruct(Obstruct),
    /// Unbiased paths of light through everything.
    Path(Path),
    /// What clusters of transfer matrices make of light.
    Evaluate(Evaluate),
    /// In-scattered radiance from clusters of transfer matrices.
    Reconstruct(Reconstruct),
    /// Light that the medium scatters, on the cells of a coarse grid, for many lights at once.
    Photons(Photons),
    /// What the values of a grid mean.
    Classify(Classify),
}

macro_rules! each {
    ($self:ident, $stage:ident => $value:expr) => {
        match $self {
            Stage::Reduce($stage) => $value,
            Stage::Project($stage) => $value,
            Stage::Propagate($stage) => $value,
            Stage::Relight($stage) => $value,
            Stage::March($stage) => $value,
            Stage::Inject($stage) => $value,
            Stage::Trace($stage) => $value,
            Stage::Shade($stage) => $value,
            Stage::Shadow($stage) => $value,
            Stage::Upsample($stage) => $value,
            Stage::Accumulate($stage) => $value,
            Stage::Coarsen($stage) => $value,
            Stage::Illuminate($stage) => $value,
            Stage::Sweep($stage) => $value,
            Stage::Obstruct($stage) => $value,
            Stage::Path($stage) => $value,
            Stage::Evaluate($stage) => $value,
            Stage::Reconstruct($stage) => $value,
            Stage::Photons($stage) => $value,
            Stage::Classify($stage) => $value,
        }
    };
}

fn name_of<K: Kernel>(_: &K) -> &'static str {
    K::NAME
}

impl Stage {
    /// The names of all stages.
    pub const NAMES: [&'static str; 20] = [
        Reduce::NAME,
        Project::NAME,
        Propagate::NAME,
        Relight::NAME,
        March::NAME,
        Inject::NAME,
        Trace::NAME,
        Shade::NAME,
        Shadow::NAME,
        Upsample::NAME,
        Accumulate::NAME,
        Coarsen::NAME,
        Illuminate::NAME,
        Sweep::NAME,
        Obstruct::NAME,
        Path::NAME,
        Evaluate::NAME,
        Reconstruct::NAME,
        Photons::NAME,
        Classify::NAME,
    ];

    /// Name of the stage and of its kernel files.
    pub fn name(&self) -> &'static str {
        each!(self, stage => name_of(stage))
    }

    /// The parameters' bytes, as kernels see them.
    pub fn params(&self) -> &[u8] {
        each!(self, stage => stage.params())
    }

    /// The resources, in the kernels' order.
    pub fn bindings(&self) -> Vec<Binding> {
        each!(self, stage => stage.bindings())
    }

    /// Length of the work axis.
    pub fn axis(&self) -> u32 {
        each!(self, stage => stage.axis())
    }

    /// Units of the work axis that touch the same part of the buffers that are bound in parts
    /// ([`Binding::part`]).
    pub fn group(&self) -> u32 {
        each!(self, stage => stage.group())
    }

    /// Where units of the work axis run in order, each seeing what the ones before wrote: the items of a unit, which do
    /// not depend on each other. None where no unit depends on another.
    pub fn sequential(&self) -> Option<u32> {
        each!(self, stage => stage.sequential())
    }

    /// The stage cut into passes, so that all loops of an invocation together turn at most `turns` times. Passes run in
    /// order, each over the whole work axis, and each goes on from what the ones before left in the outputs.
    ///
    /// # Errors
    /// What turns more often and cannot be cut.
    pub fn passes(&self, turns: u64) -> Result<Vec<Self>, String> {
        Ok(match self {
            Self::Reduce(stage) => stage.passes(turns)?.into_iter().map(Self::Reduce).collect(),
            Self::Project(stage) => stage.passes(turns)?.into_iter().map(Self::Project).collect(),
            Self::Propagate(stage) => stage.passes(turns)?.into_iter().map(Self::Propagate).collect(),
            Self::Relight(stage) => stage.passes(turns)?.into_iter().map(Self::Relight).collect(),
            Self::March(stage) => stage.passes(turns)?.into_iter().map(Self::March).collect(),
            Self::Inject(stage) => stage.passes(turns)?.into_iter().map(Self::Inject).collect(),
            Self::Trace(stage) => stage.passes(turns)?.into_iter().map(Self::Trace).collect(),
            Self::Shade(stage) => stage.passes(turns)?.into_iter().map(Self::Shade).collect(),
            Self::Shadow(stage) => stage.passes(turns)?.into_iter().map(Self::Shadow).collect(),
            Self::Upsample(stage) => stage.passes(turns)?.into_iter().map(Self::Upsample).collect(),
            Self::Accumulate(stage) => stage.passes(turns)?.into_iter().map(Self::Accumulate).collect(),
            Self::Coarsen(stage) => stage.passes(turns)?.into_iter().map(Self::Coarsen).collect(),
            Self::Illuminate(stage) => stage.passes(turns)?.into_iter().map(Self::Illuminate).collect(),
            Self::Sweep(stage) => stage.passes(turns)?.into_iter().map(Self::Sweep).collect(),
            Self::Obstruct(stage) => stage.passes(turns)?.into_iter().map(Self::Obstruct).collect(),
            Self::Path(stage) => stage.passes(turns)?.into_iter().map(Self::Path).collect(),
            Self::Evaluate(stage) => stage.passes(turns)?.into_iter().map(Self::Evaluate).collect(),
            Self::Reconstruct(stage) => stage.passes(turns)?.into_iter().map(Self::Reconstruct).collect(),
            Self::Photons(stage) => stage.passes(turns)?.into_iter().map(Self::Photons).collect(),
            Self::Classify(stage) => stage.passes(turns)?.into_iter().map(Self::Classify).collect(),
        })
    }

    /// Whether parameters and resources fit each other.
    ///
    /// # Errors
    /// What does not fit.
    pub fn validate(&self) -> Result<(), String> {
        each!(self, stage => stage.validate())?;
        let bindings = self.bindings();
        for (i, a) in bindings.iter().enumerate() {
            let writes = matches!(a.access, BindingAccess::Write(_));
            if writes && a.id.is_some() && bindings.iter().enumerate().any(|(j, b)| i != j && a.id == b.id) {
                return Err(format!("{} is written and bound a second time", a.name));
            }
        }
        Ok(())
    }
}

/// `Err` with the formatted text unless the condition holds.
macro_rules! require {
    ($condition:expr, $($text:tt)+) => {
        if !$condition {
            return Err(format!($($text)+));
        }
    };
}
pub(crate) use require;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::{Buf, Field, FieldFormat, FieldSpec};
    use crate::device::{KernelLanguage, KernelStruct, ResourceId};

    #[test]
    fn shared_structs_have_the_same_text_in_both_languages() {
        use KernelLanguage::{Opencl, Wgsl};
        assert_eq!(RelightParams::text(Wgsl).lines().nth(1), Some("    cells: u32,"));
        assert_eq!(RelightParams::text(Opencl).lines().nth(1), Some("    uint cells;"));
        let params = [InjectParams::text, ReduceParams::text, ProjectParams::text, MarchParams::text];
        for text in params.into_iter().chain([BlobRecord::text, LightRecord::text]) {
            assert_eq!(text(Wgsl).lines().count(), text(Opencl).lines().count());
        }
    }

    #[test]
    fn a_resource_may_not_be_read_and_written() {
        let spec = FieldSpec::dense([1; 3], 1, FieldFormat::Scalar);
        let density = Field { id: ResourceId(1), spec };
        let params = ReduceParams::new([1, 1, 1, 0], [1, 1, 1, 0], [1.0, 1.0, 1.0, 0.0]);
        let stage = |out| Stage::Reduce(Reduce { params, density, other: None, out: Buf::new(ResourceId(out), 1) });
        assert!(stage(2).validate().is_ok());
        assert!(stage(1).validate().is_err());
    }
}
