//! A plan that does not fit is refused before anything of it is allocated.

use std::ops::Range;
use std::sync::{Arc, Mutex};

use airlight_core::device::{
    Device, DeviceError, DeviceInfo, DeviceKind, FieldFormat, FieldSpec, Limits, ResourceId, ResourceSpec, StageTime,
};
use airlight_core::exec::{ExecError, Executor, Hooks};
use airlight_core::stage::Stage;

/// A device that holds nothing but sizes.
struct Ledger {
    info: DeviceInfo,
    total: u64,
    taken: Arc<Mutex<u64>>,
    sizes: Vec<(ResourceId, u64)>,
}

impl Ledger {
    /// A device of which `total` bytes are free at first; and what is taken of it.
    fn open(kind: DeviceKind, memory_bytes: Option<u64>, total: u64) -> (Box<dyn Device>, Arc<Mutex<u64>>) {
        let limits = Limits { buffer_bytes: u64::MAX, binding_bytes: u64::MAX, field_side: u32::MAX, loop_turns: None };
        let (name, features) = ("ledger".to_owned(), Vec::new());
        let info = DeviceInfo {
            backend: "ledger",
            index: 0,
            name,
            kind,
            memory_bytes,
            limits,
            features,
            filter_bits: 24,
            contracts: false,
            unusable: None,
        };
        let taken = Arc::new(Mutex::new(0));
        (Box::new(Self { info, total, taken: taken.clone(), sizes: Vec::new() }), taken)
    }
}

impl Device for Ledger {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn free_memory(&self) -> Option<u64> {
        Some(self.total - *self.taken.lock().unwrap())
    }

    fn create(&mut self, id: ResourceId, spec: &ResourceSpec) -> Result<(), DeviceError> {
        *self.taken.lock().unwrap() += spec.bytes();
        self.sizes.push((id, spec.bytes()));
        Ok(())
    }

    fn destroy(&mut self, id: ResourceId) {
        self.sizes.retain(|(of, bytes)| {
            let gone = *of == id;
            *self.taken.lock().unwrap() -= if gone { *bytes } else { 0 };
            !gone
        });
    }

    fn write(&mut self, _: ResourceId, _: u64, _: &[u8]) -> Result<(), DeviceError> {
        Ok(())
    }

    fn read(&mut self, _: ResourceId, _: u64, _: &mut [u8]) -> Result<(), DeviceError> {
        Ok(())
    }

    fn publish(&mut self, _: ResourceId, _: ResourceId) -> Result<(), DeviceError> {
        Ok(())
    }

    fn dispatch(&mut self, _: &Stage, _: Range<u32>) -> Result<(), DeviceError> {
        Ok(())
    }

    fn finish(&mut self) -> Result<Vec<StageTime>, DeviceError> {
        Ok(Vec::new())
    }
}

/// Runs a plan of one buffer of `bytes`, and `host` bytes beside it.
fn run(executor: &mut Executor, bytes: u64, host: u64) -> Result<(), ExecError> {
    let built = executor.run(&mut Hooks::default(), |plan| {
        plan.work::<u8>("cells", bytes);
        plan.host(host);
        Ok::<_, ExecError>(())
    });
    built.map(drop)
}

/// The bytes needed and the bytes there.
#[track_caller]
fn refused(result: Result<(), ExecError>) -> (u64, u64) {
    match result {
        Err(ExecError::Memory { needed, budget, .. }) => (needed, budget),
        other => panic!("{other:?}"),
    }
}

#[test]
fn what_is_free_bounds_a_plan_and_what_is_held_counts_as_free() {
    let (device, taken) = Ledger::open(DeviceKind::DiscreteGpu, Some(1000), 500);
    let mut executor = Executor::new(device);
    // A tenth is left.
    assert_eq!(refused(run(&mut executor, 451, 0)), (451, 450));
    assert_eq!(*taken.lock().unwrap(), 0, "nothing was allocated");
    run(&mut executor, 450, 0).unwrap();
    // The same again takes nothing new, however little is free; a larger one takes the first one's place.
    run(&mut executor, 450, 0).unwrap();
    assert_eq!(refused(run(&mut executor, 500, 0)), (500, 450 + 45));
    run(&mut executor, 480, 0).unwrap();
    assert_eq!(*taken.lock().unwrap(), 480);
}

#[test]
fn the_host_counts_where_it_shares_the_memory() {
    for (kind, shares) in [
        (DeviceKind::Cpu, true),
        (DeviceKind::IntegratedGpu, true),
        (DeviceKind::SoftwareGpu, true),
        (DeviceKind::DiscreteGpu, false),
    ] {
        let (device, _) = Ledger::open(kind, Some(1000), 1000);
        let result = run(&mut Executor::new(device), 800, 101);
        if shares { assert_eq!(refused(result), (901, 900)) } else { result.unwrap() }
    }
}

#[test]
fn a_budget_of_ones_own_holds_and_sizes_past_all_numbers_are_refused() {
    let (device, _) = Ledger::open(DeviceKind::DiscreteGpu, None, u64::MAX);
    let mut executor = Executor::new(device);
    executor.set_budget(100);
    assert_eq!(refused(run(&mut executor, 101, 0)), (101, 100));
    let huge = executor.run(&mut Hooks::default(), |plan| {
        let spec = FieldSpec::dense([i32::MAX as u32; 3], 1, FieldFormat::Rgba);
        plan.upload_field("density", spec, &0, |_, _| panic!("nothing of it is made"));
        plan.work::<[f32; 4]>("film", u64::MAX / 2);
        Ok::<_, ExecError>(())
    });
    let text = huge.map(drop).unwrap_err().to_string();
    assert!(text.contains("16.0 EiB") && text.contains("100 B"), "{text}");
    assert!(text.contains("density of 2147483647 × 2147483647 × 2147483647"), "{text}");
}
