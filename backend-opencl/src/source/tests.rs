//! What can be said of kernels without a device: a small reader of the generated text, beside the stages.

use airlight_core::device::KernelScalar;
use airlight_core::stage::{
    BlobRecord, InjectParams, LightRecord, MarchParams, ProjectParams, ReduceParams, RelightParams, examples,
};

use super::*;

/// The shapes of a stage's bindings, with fields in so many slabs.
pub(crate) fn shapes(stage: &Stage, slabs: u32, layered: bool) -> Vec<Shape> {
    let mut shapes: Vec<_> = stage.bindings().iter().map(|binding| Shape::new(binding, slabs)).collect();
    for shape in &mut shapes {
        if let ShapeKind::Field { layered: of, .. } = &mut shape.kind {
            *of = layered;
        }
    }
    shapes
}

/// The same with scalars in halves, and in bricks or dense.
pub(crate) fn packed(stage: &Stage, slabs: u32, in_bricks: bool) -> Vec<Shape> {
    let mut shapes = shapes(stage, slabs, false);
    for shape in &mut shapes {
        if let ShapeKind::Field { format, bricks, .. } = &mut shape.kind
            && *format == FieldFormat::Scalar
        {
            (*format, *bricks) = (FieldFormat::Half { exponent: -8 }, in_bricks);
        }
    }
    shapes
}

/// The kernel's arguments, as the text declares them.
fn arguments<'t>(text: &'t str, name: &str) -> Vec<&'t str> {
    let (_, after) = text.split_once(&format!("__kernel void {}(", entry_point(name))).unwrap();
    let (arguments, _) = after.split_once(')').unwrap();
    arguments.split(',').map(str::trim).collect()
}

#[test]
fn every_stage_has_a_kernel_of_its_name() {
    for (stage, name) in examples(true).iter().zip(Stage::NAMES) {
        let source = of(stage, Lanes::Sixteen);
        assert_eq!((stage.name(), source.name), (name, name));
        let text = source.text(&shapes(stage, 1, false));
        assert_eq!(text.matches("__kernel").count(), 1, "{name}");
        assert!(text.contains(&format!("void run_{name}(const Bound *bound) {{")), "{name}");
        assert!(text.contains(&format!("#line 1 \"kernels/{name}.cl\"")), "{name}");
    }
}

#[test]
fn kernels_take_what_their_stages_list_under_the_same_names() {
    for full in [true, false] {
        for stage in &examples(full) {
            let (source, shapes) = (of(stage, Lanes::One), shapes(stage, 2, true));
            let text = source.text(&shapes);
            let mut taken = arguments(&text, source.name).into_iter();
            assert_eq!(taken.next(), Some("const Constants constants"));
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
            let scratch = source.shares().then_some("__global float *restrict scratch");
            assert_eq!((taken.next(), taken.next()), (scratch, None), "{}", source.name);
        }
    }
}

#[test]
fn arguments_take_no_more_than_every_device_passes() {
    // What OpenCL 1.2 promises of CL_DEVICE_MAX_PARAMETER_SIZE.
    const MOST: usize = 1024;
    for stage in &examples(true) {
        let source = of(stage, Lanes::One);
        let text = source.text(&shapes(stage, 1, true));
        let sizes = arguments(&text, source.name).into_iter().skip(1).map(|a| if a.contains('*') { 8 } else { 4 });
        let bytes = stage.params().len() + size_of::<Launch>() + sizes.sum::<usize>();
        assert!(bytes <= MOST, "{}: {bytes} bytes", source.name);
    }
}

#[test]
fn fields_in_bricks_take_an_index_and_the_number_of_constants() {
    let stage = &examples(true)[0];
    let text = of(stage, Lanes::One).text(&packed(stage, 2, true));
    let taken = arguments(&text, "reduce");
    let expected = ["density_index", "density_0", "density_1", "int density_constants", "int density_per_slab"];
    for (got, expected) in taken[1..].iter().zip(expected) {
        assert!(got.ends_with(expected), "{got} is not {expected}");
    }
    assert!(text.contains("vload_half(place, bound->density_1) * 0x1p-8f"), "{text}");
}

#[test]
fn structs_lie_in_opencl_as_in_rust() {
    // OpenCL C aligns scalars to 4 bytes, 4-vectors and a struct that holds one to 16, and pads as C does.
    fn check<T: KernelStruct>() {
        let text = T::text(OPENCL);
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
    check::<InjectParams>();
    check::<BlobRecord>();
    check::<Launch>();
}

#[test]
fn a_compiler_is_told_the_file_of_every_line() {
    let stages = examples(true);
    let stage = stages.iter().find(|stage| stage.name() == "march").unwrap();
    let text = of(stage, Lanes::Eight).text(&shapes(stage, 1, false));
    let (mut file, mut number) = ("", 0);
    for line in text.lines() {
        number += 1;
        if let Some(name) = line.strip_prefix("#line 1 ") {
            (file, number) = (name, 0);
        }
        if line.contains("INLINE F2 segment(F tau) {") {
            let segment = helper(Helper::Segment).text;
            let there = segment.lines().position(|line| line.contains("INLINE F2 segment(F tau) {")).unwrap() + 1;
            assert_eq!((file, number), ("\"kernels/segment.cl\"", there));
            return;
        }
    }
    panic!("segment.cl is not in march");
}
