//! Finding and opening adapters.

use airlight_core::device::{DeviceInfo, DeviceKind, Limits, Unavailable};
use wgpu::{Adapter, Backends, DeviceType, Features, Instance, InstanceDescriptor, InstanceFlags};

use crate::{WgpuDevice, loader};

/// The most texels of a side that the index of a slab's slice is meant for; real limits are far below.
const SIDE: u32 = 1 << 15;

fn adapters() -> Result<Vec<Adapter>, Unavailable> {
    // wgpu panics where it was compiled without any backend for the platform.
    let backends = Instance::enabled_backend_features();
    if backends.is_empty() {
        return Err(Unavailable("this program was built without a graphics interface for this platform".into()));
    }
    let instance = Instance::new(InstanceDescriptor {
        backends,
        flags: InstanceFlags::empty(),
        ..InstanceDescriptor::new_without_display_handle()
    });
    let usable = |adapter: &Adapter| adapter.limits().max_compute_invocations_per_workgroup >= 64;
    let found: Vec<_> =
        pollster::block_on(instance.enumerate_adapters(Backends::all())).into_iter().filter(usable).collect();
    if found.is_empty() {
        return Err(loader::reason());
    }
    Ok(found)
}

/// The adapters, or why there are none.
pub(crate) fn enumerate() -> Result<Vec<DeviceInfo>, Unavailable> {
    Ok(adapters()?.iter().enumerate().map(|(index, adapter)| describe(index, adapter)).collect())
}

/// Opens an adapter as a device.
pub(crate) fn open(index: usize) -> Result<WgpuDevice, Unavailable> {
    let adapters = adapters()?;
    let Some(adapter) = adapters.get(index) else {
        let last = adapters.len() - 1;
        return Err(Unavailable(format!("there is no wgpu:{index}; the last one is wgpu:{last}")));
    };
    let info = describe(index, adapter);
    let request = wgpu::DeviceDescriptor {
        label: Some("airlight"),
        required_features: adapter.features() & Features::TIMESTAMP_QUERY,
        // All that there is: the defaults of WebGPU are far below what most adapters hold.
        required_limits: adapter.limits(),
        memory_hints: wgpu::MemoryHints::Performance,
        ..Default::default()
    };
    let (device, queue) = pollster::block_on(adapter.request_device(&request))
        .map_err(|error| Unavailable(format!("{} cannot be opened: {error}", info.name)))?;
    let name = info.name.clone();
    WgpuDevice::new(info, device, queue).map_err(|error| Unavailable(format!("{name} cannot be opened: {error}")))
}

fn describe(index: usize, adapter: &Adapter) -> DeviceInfo {
    let (info, limits) = (adapter.get_info(), adapter.limits());
    let mut features = vec![info.backend.to_string()];
    let driver = format!("{} {}", info.driver, info.driver_info);
    features.extend(Some(driver.trim().to_owned()).filter(|driver| !driver.is_empty()));
    if adapter.features().contains(Features::TIMESTAMP_QUERY) {
        features.push("timestamps".into());
    }
    DeviceInfo {
        backend: "wgpu",
        index,
        name: info.name,
        kind: match info.device_type {
            DeviceType::DiscreteGpu => DeviceKind::DiscreteGpu,
            DeviceType::IntegratedGpu => DeviceKind::IntegratedGpu,
            DeviceType::Cpu => DeviceKind::SoftwareGpu,
            DeviceType::VirtualGpu | DeviceType::Other => DeviceKind::Other,
        },
        memory_bytes: None,
        limits: Limits {
            buffer_bytes: limits.max_buffer_size,
            binding_bytes: limits.max_storage_buffer_binding_size,
            field_side: limits.max_texture_dimension_3d.min(SIDE),
            // Mesa's software driver leaves all loops of an invocation after so many turns, without a word.
            loop_turns: (info.driver == "llvmpipe").then_some(65_535),
        },
        features,
        // Kernels interpolate themselves: a texture unit's weights have 8 bits.
        filter_bits: 24,
    }
}
