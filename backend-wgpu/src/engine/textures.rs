//! Textures of others, checked before wgpu sees them, so that errors speak of their part in the picture.

use airlight_core::device::DeviceError;
use wgpu::{
    BindingType, StorageTextureAccess, Texture, TextureAspect, TextureDimension, TextureFormat, TextureSampleType,
    TextureUsages, TextureView, TextureViewDescriptor, TextureViewDimension,
};

/// What a texture is read for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Color,
    Depth,
}

/// How a texture is declared in a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Kind {
    Floats,
    Depth,
}

impl Kind {
    pub(super) fn wgsl(self) -> &'static str {
        match self {
            Self::Floats => "texture_2d<f32>",
            Self::Depth => "texture_depth_2d",
        }
    }

    pub(super) fn binding(self) -> BindingType {
        let sample_type = match self {
            Self::Floats => TextureSampleType::Float { filterable: false },
            Self::Depth => TextureSampleType::Depth,
        };
        BindingType::Texture { sample_type, view_dimension: TextureViewDimension::D2, multisampled: false }
    }
}

/// A texture that kernels write.
pub(super) fn storage(format: TextureFormat) -> BindingType {
    let (access, view_dimension) = (StorageTextureAccess::WriteOnly, TextureViewDimension::D2);
    BindingType::StorageTexture { access, format, view_dimension }
}

/// The name of a format in WGSL; of those that [`stored`] takes.
pub(super) fn format_name(format: TextureFormat) -> &'static str {
    if format == TextureFormat::Rgba16Float { "rgba16float" } else { "rgba32float" }
}

fn fits(texture: &Texture, role: &str, size: [u32; 2], usage: TextureUsages) -> Result<(), DeviceError> {
    let refuse = |what: String| Err(DeviceError::Invalid(format!("the texture of {role} {what}")));
    let found = [texture.width(), texture.height()];
    if texture.dimension() != TextureDimension::D2 || texture.sample_count() != 1 {
        let (dimension, samples) = (texture.dimension(), texture.sample_count());
        return refuse(format!(
            "is {dimension:?} of {samples} samples; it must be D2 of one sample: resolve it before"
        ));
    }
    if found != size {
        let ([w, h], [x, y]) = (size, found);
        return refuse(format!("has {x} × {y} texels for a picture of {w} × {h}; both must be equal"));
    }
    if !texture.usage().contains(usage) {
        return refuse(format!("was made for {:?}; it must be made for {usage:?} too", texture.usage()));
    }
    Ok(())
}

/// Whether a texture may be read as `role` of a picture of that size, and how.
pub(super) fn sampled(texture: &Texture, role: Role, size: [u32; 2]) -> Result<Kind, DeviceError> {
    let name = if role == Role::Color { "colour" } else { "depth" };
    fits(texture, name, size, TextureUsages::TEXTURE_BINDING)?;
    let format = texture.format();
    let kind = match format.sample_type(Some(aspect(format)), None) {
        Some(TextureSampleType::Float { .. }) => Some(Kind::Floats),
        Some(TextureSampleType::Depth) if role == Role::Depth => Some(Kind::Depth),
        _ => None,
    };
    kind.ok_or_else(|| {
        let also =
            if role == Role::Depth { "depth, floats or normalised numbers" } else { "floats or normalised numbers" };
        DeviceError::Invalid(format!("the texture of {name} is of the format {format:?}; it must be one of {also}"))
    })
}

/// Whether a texture may be written as `role` of a picture of that size, and its format.
pub(super) fn stored(texture: &Texture, role: &str, size: [u32; 2]) -> Result<TextureFormat, DeviceError> {
    fits(texture, role, size, TextureUsages::STORAGE_BINDING)?;
    match texture.format() {
        format @ (TextureFormat::Rgba16Float | TextureFormat::Rgba32Float) => Ok(format),
        format => {
            let text = format!("the texture of {role} is of the format {format:?}; Rgba16Float and Rgba32Float do");
            Err(DeviceError::Invalid(text))
        }
    }
}

fn aspect(format: TextureFormat) -> TextureAspect {
    if format.has_depth_aspect() { TextureAspect::DepthOnly } else { TextureAspect::All }
}

/// The first layer and level, of its depth alone where it has stencils too.
pub(super) fn view(texture: &Texture) -> TextureView {
    texture.create_view(&TextureViewDescriptor {
        dimension: Some(TextureViewDimension::D2),
        aspect: aspect(texture.format()),
        base_mip_level: 0,
        mip_level_count: Some(1),
        base_array_layer: 0,
        array_layer_count: Some(1),
        ..Default::default()
    })
}
