//! What Vulkan tells and wgpu does not: memory, and the precision of texture units.

/// What the driver states.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Stated {
    /// Bytes of all memory that is the device's own; the machine's, for one on processor cores.
    pub(crate) memory: Option<u64>,
    /// Bits of the weights between texels of the texture units.
    pub(crate) weight_bits: Option<u32>,
}

#[cfg(any(windows, target_os = "linux", target_os = "android", target_os = "freebsd"))]
mod query {
    #![expect(unsafe_code, reason = "Vulkan itself is asked, with handles that wgpu keeps alive meanwhile")]

    use ash::vk;
    use wgpu::hal::api::Vulkan;

    use super::Stated;

    fn own(heap: &vk::MemoryHeap) -> bool {
        heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL)
    }

    fn stated(instance: &ash::Instance, device: vk::PhysicalDevice) -> Stated {
        // SAFETY: both handles are wgpu's and live as long as the guard that the caller holds; these calls only read.
        let (memory, properties) = unsafe {
            (instance.get_physical_device_memory_properties(device), instance.get_physical_device_properties(device))
        };
        let heaps = memory.memory_heaps_as_slice().iter().filter(|heap| own(heap)).map(|heap| heap.size);
        let bytes = heaps.fold(0, u64::saturating_add);
        let bits = properties.limits.sub_texel_precision_bits;
        Stated { memory: Some(bytes).filter(|bytes| *bytes > 0), weight_bits: Some(bits) }
    }

    pub(crate) fn of_adapter(adapter: &wgpu::Adapter) -> Stated {
        // SAFETY: nothing is destroyed or changed through the handle.
        let Some(hal) = (unsafe { adapter.as_hal::<Vulkan>() }) else { return Stated::default() };
        stated(hal.shared_instance().raw_instance(), hal.raw_physical_device())
    }

    pub(crate) fn of_device(device: &wgpu::Device) -> Stated {
        // SAFETY: as in `of_adapter`.
        let Some(hal) = (unsafe { device.as_hal::<Vulkan>() }) else { return Stated::default() };
        stated(hal.shared_instance().raw_instance(), hal.raw_physical_device())
    }

    pub(crate) fn free(device: &wgpu::Device) -> Option<u64> {
        // SAFETY: as in `of_adapter`.
        let hal = unsafe { device.as_hal::<Vulkan>() }?;
        let instance = hal.shared_instance();
        let budgets = hal.enabled_device_extensions().contains(&ash::ext::memory_budget::NAME);
        // The call itself is of Vulkan 1.1.
        if !budgets || instance.instance_api_version() < vk::API_VERSION_1_1 {
            return None;
        }
        let mut budget = vk::PhysicalDeviceMemoryBudgetPropertiesEXT::default();
        let mut memory = vk::PhysicalDeviceMemoryProperties2::default().push_next(&mut budget);
        // SAFETY: as in `stated`; the structures are of the types that the extension, which is enabled, asks for.
        unsafe {
            let device = hal.raw_physical_device();
            instance.raw_instance().get_physical_device_memory_properties2(device, &mut memory);
        }
        let memory = memory.memory_properties;
        let heaps = memory.memory_heaps_as_slice().iter().zip(budget.heap_budget.iter().zip(&budget.heap_usage));
        let free = heaps.filter(|(heap, _)| own(heap)).map(|(_, (budget, usage))| budget.saturating_sub(*usage));
        Some(free.fold(0, u64::saturating_add))
    }
}

#[cfg(not(any(windows, target_os = "linux", target_os = "android", target_os = "freebsd")))]
mod query {
    use super::Stated;

    pub(crate) fn of_adapter(_: &wgpu::Adapter) -> Stated {
        Stated::default()
    }

    pub(crate) fn of_device(_: &wgpu::Device) -> Stated {
        Stated::default()
    }

    pub(crate) fn free(_: &wgpu::Device) -> Option<u64> {
        None
    }
}

pub(crate) use query::{free, of_adapter, of_device};
