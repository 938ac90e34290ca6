//! Finding and opening adapters.

use airlight_core::device::{DeviceInfo, DeviceKind, Limits, Unavailable};
use airlight_core::host;
use wgpu::{Adapter, Backends, DeviceType, Features, Instance, InstanceDescriptor, InstanceFlags};

use crate::gpu::Gpu;
use crate::source::{MAX_SLABS, UNITS};
use crate::vulkan::{self, Stated};
use crate::{WgpuDevice, loader};

/// The most texels of a side that the index of a slab's slice is meant for; real limits are far below.
const SIDE: u32 = 1 << 15;
/// The most invocations of a workgroup that are worth their registers.
const MOST_UNITS: u32 = 256;
/// Memory that the invocations of a workgroup share in `project`.
const WORKGROUP_BYTES: u32 = 2048;

pub(crate) fn adapters() -> Result<Vec<Adapter>, Unavailable> {
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
    let found = pollster::block_on(instance.enumerate_adapters(Backends::all()));
    if found.is_empty() {
        return Err(loader::reason());
    }
    Ok(found)
}

/// The adapters, or why there are none.
pub(crate) fn enumerate() -> Result<Vec<DeviceInfo>, Unavailable> {
    Ok(adapters()?.iter().enumerate().map(|(index, adapter)| of_adapter(index, adapter)).collect())
}

/// Opens an adapter as a device.
pub(crate) fn open(index: usize) -> Result<WgpuDevice, Unavailable> {
    let adapters = adapters()?;
    let Some(adapter) = adapters.get(index) else {
        let last = adapters.len() - 1;
        return Err(Unavailable(format!("there is no wgpu:{index}; the last one is wgpu:{last}")));
    };
    let info = of_adapter(index, adapter);
    if let Some(reason) = info.unusable {
        return Err(Unavailable(format!("{} cannot be opened: {reason}", info.name)));
    }
    let mut wanted = Features::TIMESTAMP_QUERY | Features::FLOAT32_FILTERABLE;
    if fetches(&adapter.get_info()) {
        // Kernels write two words at once, and read what they wrote as texels of four.
        wanted |= Features::SHADER_INT64 | Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES;
    }
    let request = wgpu::DeviceDescriptor {
        label: Some("airlight"),
        required_features: adapter.features() & wanted,
        // All that there is: the defaults of WebGPU are far below what most adapters hold.
        required_limits: adapter.limits(),
        memory_hints: wgpu::MemoryHints::Performance,
        ..Default::default()
    };
    let (device, queue) = pollster::block_on(adapter.request_device(&request))
        .map_err(|error| Unavailable(format!("{} cannot be opened: {error}", info.name)))?;
    let name = info.name.clone();
    WgpuDevice::new(info, Gpu::own(device, queue))
        .map_err(|error| Unavailable(format!("{name} cannot be opened: {error}")))
}

/// The least limits that the kernels run with. Fields in several slabs or in bricks take more textures.
pub(crate) fn required_limits() -> wgpu::Limits {
    wgpu::Limits {
        max_bind_groups: 3,
        max_bindings_per_bind_group: 11 * MAX_SLABS,
        max_uniform_buffers_per_shader_stage: 2,
        max_storage_buffers_per_shader_stage: 8,
        max_sampled_textures_per_shader_stage: 8,
        max_storage_textures_per_shader_stage: 2,
        max_compute_invocations_per_workgroup: 64,
        max_compute_workgroup_size_x: 64,
        max_compute_workgroup_size_y: 8,
        max_compute_workgroup_size_z: 1,
        max_compute_workgroup_storage_size: WORKGROUP_BYTES,
        max_compute_workgroups_per_dimension: 1 << 14,
        max_texture_dimension_3d: 256,
        max_storage_buffer_binding_size: 1 << 24,
        max_buffer_size: 1 << 24,
        max_uniform_buffer_binding_size: 1 << 10,
        ..wgpu::Limits::downlevel_webgl2_defaults()
    }
}

/// Why an adapter or device of these limits cannot run the kernels.
pub(crate) fn shortfall(limits: &wgpu::Limits) -> Option<String> {
    let needed = required_limits();
    let mut short = Vec::new();
    needed.check_limits_with_fail_fn(limits, false, |name, needed, found| {
        short.push(format!("{name} is {found} and must be at least {needed}"));
    });
    (!short.is_empty()).then(|| short.join("; "))
}

/// Whether kernels had better read fields and buffers as storage textures than as sampled textures and from memory.
///
/// Mesa's software driver loads from a storage buffer by a loop over invocations with two branches a value, and from a sampled
/// texture with the sizes and strides of a mip level looked up for each invocation; from a storage texture, which has one
/// level, by a gather. Graphics processors have caches for sampled textures and for buffers that storage textures may bypass.
pub(crate) fn fetches(info: &wgpu::AdapterInfo) -> bool {
    info.driver == "llvmpipe"
}

/// Bits of the weights of texture units that are known to be better than what the driver states, and worth their while.
///
/// Mesa's software driver states 8, and filters floats by weights that are floats. From version 23.3 on every load of a texel is
/// a call there: a lookup between texels is one in place of eight, and waits for its eight lines at once.
pub(crate) fn weight_bits(info: &wgpu::AdapterInfo) -> Option<u32> {
    (info.driver == "llvmpipe" && mesa(&info.driver_info)? >= (23, 3)).then_some(FILTER_BITS)
}

/// What texture units that filter in floats leave of a weight: they are told places as shares of the texture, good to 2⁻²⁴, which
/// is 2⁻¹⁶ of a texel where 256 stand along a side. Places among more texels are as coarse before a kernel looks there.
const FILTER_BITS: u32 = 16;

/// Version of Mesa in the words of its drivers, "Mesa 25.0.7-2 (LLVM 15.0.6)".
fn mesa(driver_info: &str) -> Option<(u32, u32)> {
    let mut numbers = driver_info.strip_prefix("Mesa ")?.split(|c: char| !c.is_ascii_digit());
    Some((numbers.next()?.parse().ok()?, numbers.next()?.parse().ok()?))
}

/// Invocations of a workgroup, where they do not work together: 64, or 128 on discrete graphics processors, whose
/// multiprocessors hold too few workgroups to be full of smaller ones; at least a subgroup, and what the limits allow (decision
/// 0264).
pub(crate) fn units_for(info: &wgpu::AdapterInfo, limits: &wgpu::Limits) -> u32 {
    let wanted = if info.device_type == DeviceType::DiscreteGpu { 2 * UNITS } else { UNITS };
    let most = limits.max_compute_invocations_per_workgroup.min(limits.max_compute_workgroup_size_x);
    // `shortfall` has seen to it that limits allow 64.
    wanted.max(info.subgroup_max_size.next_power_of_two().min(MOST_UNITS)).min(most.max(1))
}

fn of_adapter(index: usize, adapter: &Adapter) -> DeviceInfo {
    let limits = adapter.limits();
    let unusable = shortfall(&limits);
    DeviceInfo {
        unusable,
        ..describe(index, adapter.get_info(), &limits, adapter.features(), vulkan::of_adapter(adapter))
    }
}

/// A device of these limits and features on an adapter.
pub(crate) fn describe(
    index: usize,
    info: wgpu::AdapterInfo,
    limits: &wgpu::Limits,
    available: Features,
    stated: Stated,
) -> DeviceInfo {
    let mut features = vec![info.backend.to_string()];
    let driver = format!("{} {}", info.driver, info.driver_info);
    features.extend(Some(driver.trim().to_owned()).filter(|driver| !driver.is_empty()));
    if available.contains(Features::TIMESTAMP_QUERY) {
        features.push("timestamps".into());
    }
    let known = weight_bits(&info).filter(|_| available.contains(Features::FLOAT32_FILTERABLE));
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
        // Mesa's software driver states a constant.
        memory_bytes: if info.device_type == DeviceType::Cpu { host::memory() } else { stated.memory },
        limits: Limits {
            buffer_bytes: limits.max_buffer_size,
            binding_bytes: limits.max_storage_buffer_binding_size,
            field_side: limits.max_texture_dimension_3d.min(SIDE),
            // Mesa's software driver leaves all loops of an invocation after so many turns, without a word.
            loop_turns: (info.driver == "llvmpipe").then_some(65_535),
        },
        features,
        // Of kernels that interpolate themselves; the device that is made tells whether texture units do that state their bits.
        filter_bits: known.unwrap_or(24),
        // WGSL has no word against it. Mesa's software driver keeps the two apart.
        contracts: info.driver != "llvmpipe",
        unusable: None,
    }
}

#[cfg(test)]
mod tests {
    use wgpu::Backend;

    use super::*;

    #[test]
    fn texture_units_are_known_where_a_lookup_is_a_call() {
        for (driver, words, expected) in [
            ("llvmpipe", "Mesa 25.0.7-2~bpo12+1 (LLVM 15.0.6)", Some(FILTER_BITS)),
            ("llvmpipe", "Mesa 23.3.0 (LLVM 17.0.1)", Some(FILTER_BITS)),
            ("llvmpipe", "Mesa 23.2.1 (LLVM 15.0.7)", None),
            ("llvmpipe", "Mesa 22.3.6 (LLVM 15.0.6)", None),
            ("llvmpipe", "25.0.7", None),
            ("radv", "Mesa 25.0.7", None),
        ] {
            let (driver, driver_info) = (driver.to_owned(), words.to_owned());
            let info =
                wgpu::AdapterInfo { driver, driver_info, ..wgpu::AdapterInfo::new(DeviceType::Cpu, Backend::Vulkan) };
            assert_eq!(weight_bits(&info), expected, "{info:?}");
        }
    }

    #[test]
    fn workgroups_hold_a_subgroup_and_keep_to_the_limits() {
        let limits = |most| wgpu::Limits { max_compute_invocations_per_workgroup: most, ..wgpu::Limits::default() };
        for (kind, subgroup, most, expected) in [
            (DeviceType::Cpu, 8, 1024, 64),
            (DeviceType::IntegratedGpu, 32, 1024, 64),
            (DeviceType::IntegratedGpu, 128, 1024, 128),
            (DeviceType::DiscreteGpu, 32, 1024, 128),
            (DeviceType::DiscreteGpu, 64, 64, 64),
        ] {
            let info = wgpu::AdapterInfo { subgroup_max_size: subgroup, ..wgpu::AdapterInfo::new(kind, Backend::Noop) };
            assert_eq!(units_for(&info, &limits(most)), expected, "{kind:?} {subgroup} {most}");
        }
    }
}
