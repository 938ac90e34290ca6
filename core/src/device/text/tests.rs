use super::*;
use crate::stage::examples;

fn file(helper: Helper) -> KernelFile {
    let text = if helper == Helper::Field { "VALUE of_FIELD;\nsecond\n" } else { "helper" };
    KernelFile { name: helper.name(), text }
}

const KERNEL: KernelFile = KernelFile { name: "kernel", text: "first\nlast\n" };

fn text(language: KernelLanguage, stage: &Stage) -> KernelText {
    let shapes: Vec<_> = stage.bindings().iter().map(|binding| Shape::new(binding, 1)).collect();
    let recipe = Recipe::of(stage);
    KernelText::new(language, &recipe.prelude(language, &shapes), &recipe, &shapes, file, KERNEL)
}

#[test]
fn helpers_stand_once_or_once_for_each_field() {
    for (language, scalar, color) in
        [(KernelLanguage::Wgsl, "f32", "vec4<f32>"), (KernelLanguage::Opencl, "float", "float4")]
    {
        let text = text(language, &examples(true)[4]);
        for line in [
            format!("{scalar} of_density;"),
            format!("{scalar} of_emission_density;"),
            format!("{color} of_in_scatter;"),
            format!("{color} of_light_depth;"),
        ] {
            assert_eq!(text.whole.lines().filter(|at| **at == line).count(), 1, "{line}\n{}", text.whole);
        }
        assert_eq!(text.whole.lines().filter(|line| *line == "helper").count(), 10);
        assert!(text.whole.ends_with("first\nlast\n"));
    }
}

#[test]
fn lines_are_counted_from_the_start_of_each_file() {
    for language in [KernelLanguage::Wgsl, KernelLanguage::Opencl] {
        let text = text(language, &examples(true)[1]);
        let line = |what: &str| text.whole.lines().position(|line| line == what).unwrap() + 1;
        assert_eq!(text.place(line("first")), ("kernel", 1));
        assert_eq!(text.place(line("last")), ("kernel", 2));
        assert_eq!(text.place(line("second")), ("field", 2));
        // The prelude begins with the first struct.
        let start = line(ProjectParams::text(language).lines().next().unwrap());
        assert_eq!(text.place(start), ("generated", 1));
        assert_eq!(text.place(start + 5), ("generated", 6));
    }
}

#[test]
fn constants_are_written_as_each_language_reads_them() {
    let shapes = [Shape::new(&examples(false)[0].bindings()[1], 1)];
    let wgsl = Recipe::of(&examples(false)[0]).prelude(KernelLanguage::Wgsl, &shapes);
    for line in ["const BLOCK: u32 = 8u;", "const REDUCE_SLACK: f32 = 0.015625;", "const has_other: bool = false;"] {
        assert!(wgsl.lines().any(|at| at == line), "{line}\n{wgsl}");
    }
    let opencl = Recipe::of(&examples(false)[0]).prelude(KernelLanguage::Opencl, &shapes);
    for line in ["#define BLOCK 8u", "#define REDUCE_SLACK 0.015625f", "#define has_other 0"] {
        assert!(opencl.lines().any(|at| at == line), "{line}\n{opencl}");
    }
}
