//! What can be said of kernels without a device, by wgpu's own reader of WGSL.

use airlight_core::device::{Binding, Buf, KernelField, ResourceId};
use airlight_core::stage::{
    BlobRecord, InjectParams, LightRecord, MarchParams, ProjectParams, ReduceParams, RelightParams, SweepDirection,
    examples,
};
use naga::AddressSpace;

use super::sweep::Kernel;
use super::*;

fn shapes(stage: &Stage, slabs: u32) -> Vec<Shape> {
    stage.bindings().iter().map(|binding| Shape::new(binding, slabs)).collect()
}

/// The same with scalars in halves and in bricks.
fn packed(stage: &Stage, half: bool) -> Vec<Shape> {
    let mut shapes = shapes(stage, 1);
    for shape in &mut shapes {
        if let ShapeKind::Field { format, bricks, .. } = &mut shape.kind
            && *format == FieldFormat::Scalar
        {
            (*format, *bricks) = (if half { FieldFormat::Half { exponent: -8 } } else { *format }, true);
        }
    }
    shapes
}

/// The text of a kernel that reads memory and sampled textures.
fn text(stage: &Stage, slabs: u32) -> Text {
    of(stage).text(&shapes(stage, slabs), Variant::default())
}

/// Reads and validates a kernel; faults name their file and line.
pub(crate) fn module(text: &Text) -> Result<naga::Module, String> {
    module_of(text, Default::default())
}

/// The same of a kernel that needs more than every device has.
fn module_of(text: &Text, capabilities: naga::valid::Capabilities) -> Result<naga::Module, String> {
    let module = naga::front::wgsl::parse_str(&text.whole).map_err(|error| {
        let line = error.location(&text.whole).map_or(0, |at| at.line_number as usize);
        format!("{:?}: {}", text.place(line), error.message())
    })?;
    let mut validator = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), capabilities);
    match validator.validate(&module) {
        Ok(_) => Ok(module),
        Err(error) => {
            let line = error.location(&text.whole).map_or(0, |at| at.line_number as usize);
            Err(format!("{:?}: {}", text.place(line), error.emit_to_string(&text.whole)))
        }
    }
}

#[test]
fn every_kernel_is_valid_with_and_without_what_is_optional_and_in_slabs() {
    for full in [true, false] {
        for stage in &examples(full) {
            for slabs in [1, 2, MAX_SLABS] {
                let shapes = shapes(stage, slabs);
                let all = (0..shapes.len()).fold(Fetched::default(), Fetched::with);
                let fours = (0..shapes.len()).fold(Fetched::default(), Fetched::with_fours);
                let plain = Variant::default();
                let places = of(stage).places();
                let [nothing, zeros, ones] = [None, Some(0), Some(1)]
                    .map(|word| -> Numbers { places.iter().map(|place| Some(place.fact(&[word?; 256]))).collect() });
                let variants = [
                    plain,
                    Variant { filtered: true, ..plain },
                    Variant { filtered: true, fetched: all, known: Some(&nothing), ..plain },
                    Variant { gathers: true, ..plain },
                    Variant { fetched: all, known: Some(&nothing), ..plain },
                    Variant { fetched: fours, known: Some(&nothing), ..plain },
                    Variant { fetched: all, known: Some(&zeros), ..plain },
                    Variant { fetched: all, known: Some(&ones), ..plain },
                ];
                for variant in variants {
                    if let Err(error) = module(&of(stage).text(&shapes, variant)) {
                        panic!("{} {full} {slabs} {variant:?}: {error}", stage.name());
                    }
                }
                let source = of(stage);
                let pairs = (0..shapes.len()).filter(|&index| source.pairs().contains(&shapes[index].name));
                let variant =
                    Variant { fetched: pairs.fold(fours, Fetched::with_pairs), known: Some(&nothing), ..plain };
                let text = source.text(&shapes, variant);
                if let Err(error) = module_of(&text, naga::valid::Capabilities::SHADER_INT64) {
                    panic!("{} {full} {slabs} in pairs: {error}", stage.name());
                }
            }
        }
    }
    for stage in &examples(true) {
        let all = (0..stage.bindings().len()).fold(Fetched::default(), Fetched::with);
        for (half, fetched, filtered) in
            [(false, all, false), (false, Fetched::default(), false), (true, Fetched::default(), true)]
        {
            if let Err(error) =
                module(&of(stage).text(&packed(stage, half), Variant { fetched, filtered, ..Variant::default() }))
            {
                panic!("{} in bricks {half} {fetched:?} {filtered}: {error}", stage.name());
            }
        }
    }
    for format in [FieldFormat::Scalar, FieldFormat::Rgba] {
        for few in [false, true] {
            assert_eq!(module(&publish_text(format, UNITS, few)).err(), None);
        }
    }
}

#[test]
fn sweeps_are_put_together_from_kernels_that_read_memory_and_textures() {
    let buffer = |id| Some(Buf::<f32>::new(ResourceId(id), 8));
    let directions = Some(Buf::<SweepDirection>::new(ResourceId(9), 8));
    let read = |name, id| Binding::read(name, buffer(id));
    let fours = |id| Some(Buf::<[f32; 4]>::new(ResourceId(id), 8));
    let directions = Binding::read("directions", directions);
    let [sources, source_weights, weights] = [read("sources", 2), read("source_weights", 3), read("weights", 1)];
    let surfaces = Binding::read("obstructed", Some(Buf::<u32>::new(ResourceId(6), 8)));
    let (read_fours, write_fours) =
        (|name, id| Binding::read(name, fours(id)), |name, id| Binding::write(name, fours(id)));
    let [optics, turned, toward] = [read("optics", 0), read_fours("optics", 8), read_fours("toward", 4)];
    for (kernel, bindings) in [
        (Kernel::Toward, vec![optics, sources, source_weights, Binding::write("toward", buffer(4))]),
        (Kernel::Turn, vec![optics, write_fours("turned", 8)]),
        (Kernel::Scatter, vec![turned, directions, sources, source_weights, write_fours("toward", 4)]),
        (Kernel::Rows, vec![turned, directions, toward, surfaces, write_fours("radiance", 5)]),
        (Kernel::Moments, vec![directions, weights, read_fours("radiance", 5), Binding::write("moments", buffer(7))]),
    ] {
        let shapes: Vec<_> = bindings.iter().map(|binding| Shape::new(binding, 1)).collect();
        let reads = (0..shapes.len() - 1).fold(Fetched::default(), Fetched::with);
        let all = reads.with(shapes.len() - 1);
        let choices = match kernel {
            // Of drivers that have no use for textures too.
            Kernel::Toward => vec![Fetched::default(), reads],
            Kernel::Scatter => vec![all, all.with_fours(2)],
            Kernel::Turn | Kernel::Rows => vec![all],
            Kernel::Moments => vec![reads],
        };
        for fetched in choices {
            let module = module(&kernel.text(&shapes, Variant { fetched, ..Variant::default() })).unwrap();
            assert_eq!(module.entry_points[0].name, kernel.name(), "{fetched:?}");
        }
    }
}

#[test]
fn every_stage_has_a_kernel_of_its_name() {
    for (stage, name) in examples(true).iter().zip(Stage::NAMES) {
        assert_eq!((stage.name(), of(stage).name), (name, name));
        let module = module(&text(stage, 1)).unwrap();
        assert_eq!(module.entry_points[0].name, name);
        let size: u32 = module.entry_points[0].workgroup_size.iter().product();
        assert_eq!(size, UNITS);
        // Where invocations do not work together, there may be any number of them.
        let other = of(stage).text(&shapes(stage, 1), Variant { units: 32, ..Variant::default() });
        let size = self::module(&other).unwrap().entry_points[0].workgroup_size;
        assert_eq!(size.iter().product::<u32>(), if of(stage).alone { 32 } else { UNITS });
    }
}

#[test]
fn kernels_bind_what_their_stages_list_under_the_same_names() {
    for stage in &examples(true) {
        let shapes = shapes(stage, 2);
        let module = module(&text(stage, 2)).unwrap();
        let global = |group, binding| {
            let at = Some(naga::ResourceBinding { group, binding });
            module.global_variables.iter().map(|(_, global)| global).find(|global| global.binding == at)
        };
        let mut bound = 2;
        for (index, shape) in shapes.iter().enumerate() {
            match shape.kind {
                ShapeKind::Field { slabs, .. } => {
                    for slab in 0..slabs {
                        let texture = global(2, slab_binding(index, slab)).unwrap();
                        assert_eq!(texture.name, Some(format!("{}_{slab}", shape.name)));
                        bound += 1;
                    }
                }
                ShapeKind::Read | ShapeKind::Write => {
                    let buffer = global(1, index as u32).unwrap_or_else(|| panic!("{}: {shape:?}", stage.name()));
                    assert_eq!(buffer.name.as_deref(), Some(shape.name), "{}", stage.name());
                    let AddressSpace::Storage { access } = buffer.space else { panic!("{shape:?}") };
                    let writes = access.contains(naga::StorageAccess::STORE);
                    assert_eq!(writes, shape.kind == ShapeKind::Write, "{}: {shape:?}", stage.name());
                    bound += 1;
                }
            }
        }
        let all = module.global_variables.iter().filter(|(_, global)| global.binding.is_some()).count();
        assert_eq!(all, bound, "{} binds more than its stage lists", stage.name());
    }
}

#[test]
fn no_kernel_needs_more_than_the_limits_that_are_asked_for() {
    let limits = crate::adapter::required_limits();
    let mut texts: Vec<_> = examples(true).iter().map(|stage| text(stage, 1)).collect();
    texts.extend([FieldFormat::Scalar, FieldFormat::Rgba].map(|format| publish_text(format, UNITS, false)));
    texts.extend(crate::engine::kernels());
    let mut most = [0; 6];
    for text in texts {
        let module = module(&text).unwrap_or_else(|error| panic!("{error}"));
        let mut needs = [0; 6];
        for (_, global) in module.global_variables.iter() {
            let kind = match (global.space, &module.types[global.ty].inner) {
                (AddressSpace::Uniform, _) => 0,
                (AddressSpace::Storage { .. }, _) => 1,
                (_, naga::TypeInner::Image { class: naga::ImageClass::Storage { .. }, .. }) => 3,
                (_, naga::TypeInner::Image { .. }) => 2,
                (AddressSpace::WorkGroup, _) => {
                    let mut layouter = naga::proc::Layouter::default();
                    layouter.update(module.to_ctx()).unwrap();
                    needs[4] += layouter[global.ty].size.next_multiple_of(16);
                    continue;
                }
                _ => continue,
            };
            needs[kind] += 1;
            let binding = global.binding.expect("a resource");
            assert!(binding.group < limits.max_bind_groups);
            needs[5] = needs[5].max(binding.binding + 1);
        }
        for (most, need) in most.iter_mut().zip(needs) {
            *most = need.max(*most);
        }
        let [x, y, z] = module.entry_points[0].workgroup_size;
        assert!(x <= limits.max_compute_workgroup_size_x && y <= limits.max_compute_workgroup_size_y);
        assert!(z == 1 && x * y <= limits.max_compute_invocations_per_workgroup);
    }
    let asked = [
        limits.max_uniform_buffers_per_shader_stage,
        limits.max_storage_buffers_per_shader_stage,
        limits.max_sampled_textures_per_shader_stage,
        limits.max_storage_textures_per_shader_stage,
        limits.max_compute_workgroup_storage_size,
    ];
    assert_eq!(most[..5], asked, "what is asked for is what is needed");
    assert!(most[5] <= limits.max_bindings_per_bind_group, "{most:?}");
}

#[test]
fn structs_lie_in_wgsl_as_in_rust() {
    fn check<T: KernelStruct>() {
        let text = format!("{}@group(0) @binding(0) var<uniform> value: {};\n", T::text(WGSL), T::NAME);
        let module = naga::front::wgsl::parse_str(&text).unwrap();
        let (_, found) = module.types.iter().find(|(_, t)| t.name.as_deref() == Some(T::NAME)).unwrap();
        let naga::TypeInner::Struct { members, span } = &found.inner else { panic!("{found:?}") };
        assert_eq!(*span as usize, size_of::<T>(), "{}", T::NAME);
        assert_eq!(members.len(), T::FIELDS.len());
        for (member, KernelField { name, offset, .. }) in members.iter().zip(T::FIELDS) {
            assert_eq!((member.name.as_deref(), member.offset as usize), (Some(*name), *offset), "{}", T::NAME);
        }
    }
    check::<ReduceParams>();
    check::<ProjectParams>();
    check::<RelightParams>();
    check::<MarchParams>();
    check::<LightRecord>();
    check::<InjectParams>();
    check::<BlobRecord>();
    check::<Launch>();
    check::<PublishParams>();
    check::<crate::engine::ImportParams>();
    check::<crate::engine::ExportParams>();
}

#[test]
fn faults_name_the_file_and_line_they_stand_in() {
    let stages = examples(true);
    let stage = stages.iter().find(|stage| stage.name() == "march").expect("a stage that uses the helper");
    let mut text = text(stage, 1);
    let lines = helper(Helper::Segment).text.lines().take_while(|line| !line.contains("exp(-tau)")).count();
    text.whole = text.whole.replace("exp(-tau)", "no_such_function(-tau)");
    let error = module(&text).unwrap_err();
    assert!(error.contains(&format!("(\"kernels/segment.wgsl\", {})", lines + 1)), "{error}");
}

#[test]
fn fields_are_sampled_where_kernels_look_between_texels() {
    for stage in &examples(true) {
        let source = of(stage);
        let helpers = source.recipe.helpers.iter().map(|&each| helper(each).text);
        let kernels: Vec<_> = helpers.chain([source.file.text]).collect();
        for shape in shapes(stage, 1).iter().filter(|shape| matches!(shape.kind, ShapeKind::Field { .. })) {
            let call = format!("sample_{}(", shape.name);
            let sampled = kernels.iter().any(|text| text.contains(&call));
            assert_eq!(source.interpolates(shape.name), sampled, "{} of {}", shape.name, source.name);
        }
    }
}
