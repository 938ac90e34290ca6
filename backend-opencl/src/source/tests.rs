//! What can be said of kernels without a device: a small reader of the generated text, beside the stages.

use airlight_core::device::{Buf, Field, FieldSpec, KernelScalar, ResourceId};
use airlight_core::stage::{Project, Relight};
use bytemuck::Zeroable;

use super::*;

/// Every stage, with all that it may be given or with as little as it runs with.
pub(crate) fn stages(full: bool) -> [Stage; 4] {
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
            occupancy: full.then(|| buf(2)),
            directions: buf(3),
            weights: buf(4),
            emission_weights: full.then(|| buf(5)),
            phase_table: full.then(|| buf(6)),
            records: buf(7),
            emission_records: full.then(|| buf(8)),
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
            emission: full.then(|| scalar(1)),
            in_scatter: full.then(|| field(2, FieldFormat::Rgba)),
            occupancy: full.then(|| buf(3)),
            lights: full.then(|| buf(4)),
            tables: buf(5),
            environment: full.then(|| buf(6)),
            surface: full.then(|| buf(7)),
            paths: full.then(|| buf(8)),
            film: buf(9),
        }),
    ]
}

/// Their shapes, with fields in so many slabs.
pub(crate) fn shapes(stage: &Stage, slabs: u32, layered: bool) -> Vec<Shape> {
    stage.bindings().iter().map(|binding| Shape::new(binding, slabs, layered)).collect()
}

/// The kernel's arguments, as the text declares them.
fn arguments<'t>(text: &'t str, name: &str) -> Vec<&'t str> {
    let (_, after) = text.split_once(&format!("__kernel void {name}(")).unwrap();
    let (arguments, _) = after.split_once(')').unwrap();
    arguments.split(',').map(str::trim).collect()
}

#[test]
fn every_stage_has_a_kernel_of_its_name() {
    for (stage, name) in stages(true).iter().zip(Stage::NAMES) {
        let source = of(stage);
        assert_eq!((stage.name(), source.name), (name, name));
        let text = source.text(&shapes(stage, 1, false));
        assert_eq!(text.matches("__kernel").count(), 1, "{name}");
        assert!(text.contains(&format!("void run_{name}(const Bound *bound) {{")), "{name}");
        assert!(source.files.iter().any(|file| file.name == format!("kernels/{name}.cl")), "{name}");
    }
}

#[test]
fn kernels_take_what_their_stages_list_under_the_same_names() {
    for full in [true, false] {
        for stage in &stages(full) {
            let (source, shapes) = (of(stage), shapes(stage, 2, true));
            let text = source.text(&shapes);
            let mut taken = arguments(&text, source.name).into_iter();
            assert_eq!(taken.next(), Some("__constant const Constants *constants"));
            for shape in shapes.iter().filter(|shape| shape.present) {
                let name = shape.name;
                let expected = match shape.kind {
                    ShapeKind::Read => vec![format!("*restrict {name}"), format!("uint {name}_words")],
                    ShapeKind::Write => vec![format!("*restrict {name}")],
                    ShapeKind::Field { .. } => vec![
                        format!("*restrict {name}_0"),
                        format!("*restrict {name}_1"),
                        format!("int {name}_layers"),
                        format!("int {name}_per_slab"),
                    ],
                };
                for expected in expected {
                    let got = taken.next().unwrap_or_default();
                    assert!(got.ends_with(&expected), "{}: {got} is not {expected}", source.name);
                    let writes = got.contains('*') && !got.contains("const");
                    assert_eq!(writes, shape.kind == ShapeKind::Write, "{}: {got}", source.name);
                }
            }
            assert_eq!(taken.next(), None, "{}", source.name);
        }
    }
}

#[test]
fn every_buffer_of_a_stage_has_elements_and_the_other_way_round() {
    for stage in &stages(true) {
        let bindings = stage.bindings();
        let buffers = bindings.iter().filter(|binding| !matches!(binding.access, BindingAccess::Sample(_)));
        let names: Vec<_> = buffers.map(|binding| binding.name).collect();
        let elements: Vec<_> = of(stage).elements.iter().map(|(name, _)| *name).collect();
        assert_eq!(elements, names, "{}", stage.name());
    }
}

#[test]
fn structs_lie_in_opencl_as_in_rust() {
    // OpenCL C aligns scalars to 4 bytes, 4-vectors and a struct that holds one to 16, and pads as C does.
    fn check<T: KernelStruct>() {
        let text = T::opencl();
        let (mut end, mut align) = (0usize, 4usize);
        let mut fields = T::FIELDS.iter();
        for line in text.lines().filter(|line| line.ends_with(';') && line.starts_with(' ')) {
            let (kind, name) = line.trim().trim_end_matches(';').split_once(' ').unwrap();
            let (scalar, bytes): (KernelScalar, usize) = match kind {
                "float" => (KernelScalar::F32, 4),
                "uint" => (KernelScalar::U32, 4),
                "float4" => (KernelScalar::F32x4, 16),
                "uint4" => (KernelScalar::U32x4, 16),
                _ => panic!("{line}"),
            };
            align = align.max(bytes);
            let offset = end.next_multiple_of(bytes);
            let field = fields.next().unwrap();
            assert_eq!((field.name, field.scalar, field.offset), (name, scalar, offset), "{}", T::NAME);
            end = offset + bytes;
        }
        assert!(fields.next().is_none(), "{}", T::NAME);
        assert_eq!(end.next_multiple_of(align), size_of::<T>(), "{}", T::NAME);
        // `Constants` sets one struct behind the other.
        assert!(size_of::<T>().is_multiple_of(16), "{}", T::NAME);
    }
    check::<ReduceParams>();
    check::<ProjectParams>();
    check::<RelightParams>();
    check::<MarchParams>();
    check::<LightRecord>();
    check::<Launch>();
}

#[test]
fn lines_are_counted_from_the_start_of_each_file() {
    let stage = &stages(true)[3];
    let text = of(stage).text(&shapes(stage, 1, false));
    let (mut file, mut number) = ("", 0);
    for line in text.lines() {
        number += 1;
        if let Some(name) = line.strip_prefix("#line 1 ") {
            (file, number) = (name, 0);
        }
        if line.contains("float e = exp(-tau)") {
            let there = SEGMENT.text.lines().position(|line| line.contains("exp(-tau);")).unwrap() + 1;
            assert_eq!((file, number), ("\"kernels/segment.cl\"", there));
            return;
        }
    }
    panic!("segment.cl is not in march");
}
