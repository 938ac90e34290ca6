//! Bind groups, kept by what they bind, so that a dispatch like an earlier one makes none.

use std::collections::HashMap;

use airlight_core::device::DeviceError;
use wgpu::{
    BindGroup, BindGroupDescriptor, BindGroupEntry, BindGroupLayout, BindingResource, Buffer, BufferBinding,
    BufferSize, Sampler, TextureView,
};

use crate::gpu::Gpu;
use crate::memory::Resource;

/// What stands at a number of a bind group.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Entry {
    /// Bytes of a buffer, from an offset on.
    Buffer(u32, Buffer, u64, u64),
    Texture(u32, TextureView),
    Sampler(u32, Sampler),
}

impl Entry {
    fn bound(&self) -> BindGroupEntry<'_> {
        let (&binding, resource) = match self {
            Self::Buffer(number, buffer, offset, bytes) => {
                let part = BufferBinding { buffer, offset: *offset, size: BufferSize::new(*bytes) };
                (number, BindingResource::Buffer(part))
            }
            Self::Texture(number, view) => (number, BindingResource::TextureView(view)),
            Self::Sampler(number, sampler) => (number, BindingResource::Sampler(sampler)),
        };
        BindGroupEntry { binding, resource }
    }
}

/// The bind groups that there are. They hold what they bind, and must go before its memory is free.
#[derive(Debug, Default)]
pub(crate) struct Groups(HashMap<(BindGroupLayout, Vec<Entry>), BindGroup>);

impl Groups {
    /// The most that are kept: those of some hundred dispatches. When there are as many, all are made anew.
    const MOST: usize = 1024;

    /// The group of a layout that binds `entries`.
    pub(crate) fn of(
        &mut self,
        gpu: &Gpu,
        layout: &BindGroupLayout,
        entries: Vec<Entry>,
    ) -> Result<BindGroup, DeviceError> {
        let key = (layout.clone(), entries);
        if let Some(group) = self.0.get(&key) {
            return Ok(group.clone());
        }
        let entries: Vec<_> = key.1.iter().map(Entry::bound).collect();
        let group = gpu.group(&BindGroupDescriptor { label: None, layout, entries: &entries })?;
        if self.0.len() >= Self::MOST {
            self.0.clear();
        }
        self.0.insert(key, group.clone());
        Ok(group)
    }

    /// Drops the groups that bind a buffer.
    pub(crate) fn forget_buffer(&mut self, gone: &Buffer) {
        self.retain(|entry| !matches!(entry, Entry::Buffer(_, buffer, ..) if buffer == gone));
    }

    /// Drops the groups that bind a texture.
    pub(crate) fn forget_texture(&mut self, gone: &TextureView) {
        self.retain(|entry| !matches!(entry, Entry::Texture(_, view) if view == gone));
    }

    /// Drops the groups that bind anything of a resource.
    pub(crate) fn forget(&mut self, gone: &Resource) {
        match gone {
            Resource::Buffer(memory) => {
                self.forget_buffer(&memory.buffer);
                memory.texels.iter().for_each(|texels| self.forget_texture(&texels.view));
            }
            Resource::Field(volume) => {
                let index = volume.atlas.as_ref().map(|atlas| &atlas.index_view);
                let views = volume.textures.iter().map(|(_, view)| view).chain(index);
                views.for_each(|view| self.forget_texture(view));
            }
            Resource::Texels(texels) => self.forget_texture(&texels.view),
        }
    }

    /// Drops all groups.
    pub(crate) fn clear(&mut self) {
        self.0.clear();
    }

    fn retain(&mut self, stays: impl Fn(&Entry) -> bool) {
        self.0.retain(|(_, entries), _| entries.iter().all(&stays));
    }
}
