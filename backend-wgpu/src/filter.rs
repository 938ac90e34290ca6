//! Who interpolates between the texels of fields.

use airlight_core::device::{DeviceInfo, Unavailable};
use wgpu::{FilterMode, Sampler, SamplerDescriptor};

use crate::gpu::Gpu;
use crate::{WgpuDevice, adapter, vulkan};

/// Who interpolates between the texels of fields.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// The kernels, in 32-bit floats; texture units only where the driver states weights of at least
    /// [`Filter::EXACT_BITS`] bits, or is known to have them: Mesa's software driver, from version 23.3 on.
    #[default]
    Exact,
    /// Texture units, where they can filter 32-bit floats, whatever the precision of their weights: most have 8 bits,
    /// which shows as steps of 1/256 between voxels. Fields that are held in several textures are still interpolated by
    /// the kernels. Only `Features::FLOAT32_FILTERABLE` is needed.
    Hardware,
}

impl Filter {
    /// Bits of weights that count as exact: half a step of them, 2⁻¹⁷, is what single precision loses over a march
    /// (10⁻⁵) too.
    pub const EXACT_BITS: u32 = 16;
    /// Bits of a weight in 32-bit floats.
    const FLOAT_BITS: u32 = 24;
    /// Bits where nothing is stated: what Vulkan asks for at the least.
    const LEAST_BITS: u32 = 4;
}

/// Whether texture units filter, of a driver whose weights have `bits` and that can or cannot filter 32-bit floats.
fn hardware(filter: Filter, filterable: bool, bits: u32) -> bool {
    filterable && (filter == Filter::Hardware || bits >= Filter::EXACT_BITS)
}

/// The sampler of a device whose texture units filter; `info` tells of it.
pub(crate) fn sampler(gpu: &Gpu, info: &mut DeviceInfo, filter: Filter) -> Option<Sampler> {
    let filterable = gpu.device.features().contains(wgpu::Features::FLOAT32_FILTERABLE);
    let stated = || vulkan::of_device(&gpu.device).weight_bits.unwrap_or(Filter::LEAST_BITS).min(Filter::FLOAT_BITS);
    let bits = adapter::weight_bits(&gpu.device.adapter_info()).unwrap_or_else(stated);
    let used = hardware(filter, filterable, bits);
    info.filter_bits = if used { bits } else { Filter::FLOAT_BITS };
    used.then(|| {
        gpu.device.create_sampler(&SamplerDescriptor {
            label: Some("fields"),
            mag_filter: FilterMode::Linear,
            min_filter: FilterMode::Linear,
            ..Default::default()
        })
    })
}

impl WgpuDevice {
    /// This device with `filter` in place of [`Filter::Exact`]; [`DeviceInfo::filter_bits`] tells what became of it. To
    /// be chosen before the first stage runs, because what has been computed is not computed again.
    ///
    /// # Errors
    /// [`Filter::Hardware`] on a device that was made without the feature.
    pub fn with_filter(mut self, filter: Filter) -> Result<Self, Unavailable> {
        self.set_filter(filter);
        if filter == Filter::Hardware && self.sampler.is_none() {
            let name = &self.info.name;
            let text = format!("{name} does not filter 32-bit floats (Features::FLOAT32_FILTERABLE)");
            return Err(Unavailable(text));
        }
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texture_units_filter_where_they_are_exact_or_asked_for() {
        for (filter, filterable, bits, expected) in [
            (Filter::Exact, true, 8, false),
            (Filter::Exact, true, 16, true),
            (Filter::Exact, false, 24, false),
            (Filter::Hardware, true, 4, true),
            (Filter::Hardware, false, 24, false),
        ] {
            assert_eq!(hardware(filter, filterable, bits), expected, "{filter:?} {filterable} {bits}");
        }
        assert_eq!(Filter::default(), Filter::Exact);
    }
}
