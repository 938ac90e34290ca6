//! Kernels in the device's own compiler.

use std::fmt::Write as _;

use airlight_core::device::{Device, DeviceError, KernelLanguage, KernelStruct};
use airlight_core::stage::{LightRecord, MarchParams, ProjectParams, ReduceParams, RelightParams, examples};

use super::{content, device, empty};
use crate::cl::Arg;
use crate::source::tests::{packed, shapes};
use crate::source::{self, Launch, MAX_SLABS};

#[test]
fn every_kernel_builds_with_and_without_what_is_optional_and_in_slabs() {
    let Some(mut device) = device() else { return };
    for full in [true, false] {
        for stage in &examples(full) {
            for (slabs, layered) in [(1, false), (1, true), (2, false), (MAX_SLABS, true)] {
                let source = source::of(stage, device.lanes);
                let text = source.text(&shapes(stage, slabs, layered));
                if let Err(error) = device.cl.build(source.name, &text, device.options, source.width) {
                    panic!("{} {full} {slabs} {layered}: {error}", source.name);
                }
            }
        }
    }
}

#[test]
fn kernels_build_for_halves_and_bricks() {
    let Some(mut device) = device() else { return };
    for stage in &examples(true) {
        for (slabs, bricks) in [(1, false), (1, true), (2, true)] {
            let source = source::of(stage, device.lanes);
            let text = source.text(&packed(stage, slabs, bricks));
            if let Err(error) = device.cl.build(source.name, &text, device.options, source.width) {
                panic!("{} {slabs} {bricks}: {error}", source.name);
            }
        }
    }
}

#[test]
fn the_compiler_lays_structs_out_as_rust_does() {
    let Some(mut device) = device() else { return };
    fn check<T: KernelStruct>(device: &mut crate::OpenclDevice, id: u32) {
        let mut text =
            T::text(KernelLanguage::Opencl) + "__kernel void stage_layout(const uint4 none, __global uint *out) {\n";
        let _ = writeln!(text, "    {} value;\n    out[0] = sizeof(value);", T::NAME);
        for (at, field) in (1..).zip(T::FIELDS) {
            let (name, pointer) = (field.name, "(__private char *)&value");
            let _ = writeln!(text, "    out[{at}] = (uint)({pointer}.{name} - {pointer});");
        }
        let built = device.cl.build("layout", &(text + "}\n"), device.options, 1).unwrap();
        let out = empty::<u32>(device, id, 1 + T::FIELDS.len());
        device.run_alone(&built, out.id).unwrap();
        let offsets = T::FIELDS.iter().map(|field| field.offset as u32);
        let expected: Vec<u32> = std::iter::once(size_of::<T>() as u32).chain(offsets).collect();
        assert_eq!(content(device, out), expected, "{}", T::NAME);
    }
    check::<ReduceParams>(&mut device, 0);
    check::<ProjectParams>(&mut device, 1);
    check::<RelightParams>(&mut device, 2);
    check::<MarchParams>(&mut device, 3);
    check::<LightRecord>(&mut device, 4);
    check::<Launch>(&mut device, 5);
}

impl crate::OpenclDevice {
    /// Runs a kernel of one buffer.
    fn run_alone(
        &mut self,
        built: &crate::cl::Built,
        out: airlight_core::device::ResourceId,
    ) -> Result<(), DeviceError> {
        let memory = self.store.buffer(out)?;
        self.cl.run(built, &[0; 16], &[Arg::Mem(&memory.mem)], 1, None).map(|_| ())?;
        self.finish().map(|_| ())
    }
}
