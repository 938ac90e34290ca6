//! Stages on handles that no device holds.

use bytemuck::Zeroable;

use super::{
    Accumulate, Classify, Coarsen, Illuminate, Inject, March, Obstruct, Path, Project, Propagate, Reduce, Relight,
    Shade, Shadow, Stage, Sweep, Trace, Upsample,
};
use crate::device::{Buf, Field, FieldFormat, FieldSpec, ResourceId};

/// One stage of every kind in the order of [`Stage::NAMES`], with all that it may be given or with as little as it
/// runs with. No device holds its handles and its parameters are zeros: it shows what kernels bind, so that a backend
/// can check that its kernels build.
pub fn examples(full: bool) -> [Stage; Stage::NAMES.len()] {
    let field = |id, format| Field { id: ResourceId(id), spec: FieldSpec { dims: [3, 4, 5], layers: 1, format } };
    let scalar = |id| field(id, FieldFormat::Scalar);
    fn buf<T>(id: u32) -> Buf<T> {
        Buf::new(ResourceId(id), 1)
    }
    [
        Stage::Reduce(Reduce {
            params: Zeroable::zeroed(),
            density: scalar(0),
            other: full.then(|| scalar(1)),
            out: buf(2),
        }),
        Stage::Project(Project {
            params: Zeroable::zeroed(),
            density: scalar(0),
            emission: full.then(|| scalar(1)),
            emission_color: full.then(|| field(9, FieldFormat::Rgba)),
            occupancy: full.then(|| buf(2)),
            directions: buf(3),
            weights: buf(4),
            emission_weights: full.then(|| buf(5)),
            phase_table: full.then(|| buf(6)),
            records: buf(7),
            emission_records: full.then(|| buf(8)),
        }),
        Stage::Propagate(Propagate {
            params: Zeroable::zeroed(),
            density: scalar(0),
            occupancy: full.then(|| buf(1)),
            lights: buf(2),
            faces: full.then(|| buf(3)),
            out: buf(4),
        }),
        Stage::Relight(Relight {
            params: Zeroable::zeroed(),
            records: buf(0),
            emission_records: full.then(|| buf(1)),
            light: buf(2),
            out: buf(3),
        }),
        Stage::March(March {
            params: Zeroable::zeroed(),
            density: scalar(0),
            scattering: full.then(|| field(11, FieldFormat::Rgba)),
            emission: full.then(|| scalar(1)),
            emission_color: full.then(|| field(12, FieldFormat::Rgba)),
            in_scatter: full.then(|| field(2, FieldFormat::Rgba)),
            scattered: full.then(|| field(13, FieldFormat::Rgba)),
            light_depth: full.then(|| field(3, FieldFormat::Rgba)),
            occupancy: full.then(|| buf(4)),
            lights: full.then(|| buf(5)),
            tables: buf(6),
            environment: full.then(|| field(7, FieldFormat::Rgba)),
            surface: full.then(|| buf(8)),
            mesh: full.then(|| buf(11)),
            shadow_map: full.then(|| buf(12)),
            paths: full.then(|| buf(9)),
            film: buf(10),
        }),
        Stage::Inject(Inject {
            params: Zeroable::zeroed(),
            base: full.then(|| scalar(0)),
            blobs: full.then(|| buf(1)),
            starts: full.then(|| buf(2)),
            list: full.then(|| buf(3)),
            out: buf(4),
        }),
        Stage::Trace(Trace { params: Zeroable::zeroed(), tables: buf(0), mesh: buf(1), hits: buf(2) }),
        Stage::Shade(Shade {
            params: Zeroable::zeroed(),
            density: scalar(0),
            occupancy: full.then(|| buf(1)),
            lights: full.then(|| buf(2)),
            tables: buf(3),
            mesh: buf(4),
            materials: buf(5),
            hits: buf(6),
            background: full.then(|| buf(7)),
            out: buf(8),
        }),
        Stage::Shadow(Shadow { params: Zeroable::zeroed(), lights: buf(0), mesh: buf(1), out: buf(2) }),
        Stage::Upsample(Upsample {
            params: Zeroable::zeroed(),
            medium: buf(0),
            rims: full.then(|| buf(6)),
            surface: full.then(|| buf(1)),
            normals: full.then(|| buf(2)),
            environment: full.then(|| field(3, FieldFormat::Rgba)),
            subpixels: buf(4),
            film: buf(5),
        }),
        Stage::Accumulate(Accumulate {
            params: Zeroable::zeroed(),
            medium: buf(0),
            last: buf(1),
            next: buf(2),
            mean: buf(3),
        }),
        Stage::Coarsen(Coarsen {
            params: Zeroable::zeroed(),
            density: scalar(0),
            scattering: full.then(|| field(1, FieldFormat::Rgba)),
            emission: full.then(|| scalar(2)),
            emission_color: full.then(|| field(3, FieldFormat::Rgba)),
            out: buf(4),
        }),
        Stage::Illuminate(Illuminate {
            params: Zeroable::zeroed(),
            density: scalar(0),
            occupancy: full.then(|| buf(1)),
            lights: buf(2),
            tables: buf(3),
            mesh: full.then(|| buf(4)),
            out: buf(5),
        }),
        Stage::Sweep(Sweep {
            params: Zeroable::zeroed(),
            optics: buf(0),
            directions: buf(1),
            sources: full.then(|| buf(2)),
            source_weights: full.then(|| buf(3)),
            weights: buf(4),
            obstructed: full.then(|| buf(7)),
            radiance: buf(5),
            moments: buf(6),
        }),
        Stage::Obstruct(Obstruct { params: Zeroable::zeroed(), mesh: buf(0), out: buf(1) }),
        Stage::Path(Path {
            params: Zeroable::zeroed(),
            density: scalar(0),
            scattering: full.then(|| field(1, FieldFormat::Rgba)),
            seen: full.then(|| field(13, FieldFormat::Rgba)),
            emission: full.then(|| scalar(2)),
            emission_color: full.then(|| field(3, FieldFormat::Rgba)),
            environment: full.then(|| field(4, FieldFormat::Rgba)),
            majorant: buf(5),
            lights: full.then(|| buf(6)),
            tables: buf(7),
            mesh: full.then(|| buf(8)),
            background: full.then(|| buf(9)),
            sums: buf(10),
            paths: buf(11),
            film: buf(12),
        }),
        Stage::Classify(Classify { params: Zeroable::zeroed(), values: scalar(0), points: buf(1), out: buf(2) }),
    ]
}
