//! Structs shared with kernels, defined once in Rust; their WGSL and OpenCL C text is generated from that.

use bytemuck::Pod;

use super::text::KernelLanguage;

/// Type of a field of a [`KernelStruct`]: scalars and 4-vectors only, because every language lays those out alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum KernelScalar {
    /// 32-bit float.
    F32,
    /// 32-bit unsigned integer.
    U32,
    /// Four floats, aligned to 16 bytes.
    F32x4,
    /// Four unsigned integers, aligned to 16 bytes.
    U32x4,
}

impl KernelScalar {
    /// Alignment, which is also the size, in bytes.
    pub const fn bytes(self) -> usize {
        match self {
            Self::F32 | Self::U32 => 4,
            Self::F32x4 | Self::U32x4 => 16,
        }
    }

    /// Its name in a language.
    pub const fn name(self, language: KernelLanguage) -> &'static str {
        match (language, self) {
            (KernelLanguage::Wgsl, Self::F32) => "f32",
            (KernelLanguage::Wgsl, Self::U32) => "u32",
            (KernelLanguage::Wgsl, Self::F32x4) => "vec4<f32>",
            (KernelLanguage::Wgsl, Self::U32x4) => "vec4<u32>",
            (KernelLanguage::Opencl, Self::F32) => "float",
            (KernelLanguage::Opencl, Self::U32) => "uint",
            (KernelLanguage::Opencl, Self::F32x4) => "float4",
            (KernelLanguage::Opencl, Self::U32x4) => "uint4",
        }
    }
}

/// What the elements of a buffer, or the texels of a field, are in kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum KernelElement {
    /// A scalar or a 4-vector.
    Scalar(KernelScalar),
    /// Two floats.
    F32x2,
    /// A signed integer that is added to atomically.
    Atomic,
    /// A [`KernelStruct`] of this name.
    Struct(&'static str),
}

impl KernelElement {
    /// Its name in a language.
    pub const fn name(self, language: KernelLanguage) -> &'static str {
        match (language, self) {
            (_, Self::Scalar(scalar)) => scalar.name(language),
            (KernelLanguage::Wgsl, Self::F32x2) => "vec2<f32>",
            (KernelLanguage::Opencl, Self::F32x2) => "float2",
            (KernelLanguage::Wgsl, Self::Atomic) => "atomic<i32>",
            (KernelLanguage::Opencl, Self::Atomic) => "int",
            (_, Self::Struct(name)) => name,
        }
    }
}

/// What a buffer that stages bind may hold.
pub trait BufferElement: Pod {
    /// What it is in kernels.
    const ELEMENT: KernelElement;
}

impl BufferElement for f32 {
    const ELEMENT: KernelElement = KernelElement::Scalar(KernelScalar::F32);
}

impl BufferElement for u32 {
    const ELEMENT: KernelElement = KernelElement::Scalar(KernelScalar::U32);
}

impl BufferElement for i32 {
    const ELEMENT: KernelElement = KernelElement::Atomic;
}

impl BufferElement for [f32; 2] {
    const ELEMENT: KernelElement = KernelElement::F32x2;
}

impl BufferElement for [f32; 4] {
    const ELEMENT: KernelElement = KernelElement::Scalar(KernelScalar::F32x4);
}

impl<T: KernelStruct> BufferElement for T {
    const ELEMENT: KernelElement = KernelElement::Struct(T::NAME);
}

/// One field of a [`KernelStruct`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KernelField {
    /// Name, the same in every language.
    pub name: &'static str,
    /// Type.
    pub scalar: KernelScalar,
    /// Bytes from the struct's start.
    pub offset: usize,
}

/// A struct that host and kernels share. Made by [`kernel_struct!`](crate::kernel_struct).
pub trait KernelStruct: Pod {
    /// Name, the same in every language.
    const NAME: &'static str;
    /// The fields in order.
    const FIELDS: &'static [KernelField];

    /// The struct's text in a language.
    fn text(language: KernelLanguage) -> String {
        let field = |f: &KernelField| match language {
            KernelLanguage::Wgsl => format!("    {}: {},\n", f.name, f.scalar.name(language)),
            KernelLanguage::Opencl => format!("    {} {};\n", f.scalar.name(language), f.name),
        };
        let fields: String = Self::FIELDS.iter().map(field).collect();
        match language {
            KernelLanguage::Wgsl => format!("struct {} {{\n{fields}}}\n", Self::NAME),
            KernelLanguage::Opencl => format!("typedef struct {{\n{fields}}} {};\n", Self::NAME),
        }
    }
}

/// Checks at compile time that every language lays the fields out as Rust does.
pub const fn check_layout(fields: &[KernelField], size: usize) {
    let (mut i, mut end) = (0, 0);
    while i < fields.len() {
        let f = &fields[i];
        assert!(f.offset == end, "a kernel struct may not have padding between fields");
        assert!(f.offset.is_multiple_of(f.scalar.bytes()), "a 4-vector must lie at a multiple of 16 bytes");
        end += f.scalar.bytes();
        i += 1;
    }
    assert!(end == size && size.is_multiple_of(16), "the size of a kernel struct must be a multiple of 16 bytes");
}

/// Defines a [`KernelStruct`] of fields of type `F32`, `U32`, `F32x4` and `U32x4`. Layouts that WGSL, OpenCL C and
/// Rust would not share do not compile.
#[macro_export]
macro_rules! kernel_struct {
    (@rust F32) => { f32 };
    (@rust U32) => { u32 };
    (@rust F32x4) => { [f32; 4] };
    (@rust U32x4) => { [u32; 4] };
    ($(#[$meta:meta])* pub struct $name:ident { $($(#[$field_meta:meta])* $field:ident: $kind:ident,)+ }) => {
        $(#[$meta])*
        #[repr(C, align(16))]
        #[derive(Clone, Copy, Debug, PartialEq, ::bytemuck::Pod, ::bytemuck::Zeroable)]
        pub struct $name {
            $($(#[$field_meta])* pub $field: $crate::kernel_struct!(@rust $kind),)+
        }

        impl $crate::device::KernelStruct for $name {
            const NAME: &'static str = stringify!($name);
            const FIELDS: &'static [$crate::device::KernelField] = &[
                $($crate::device::KernelField {
                    name: stringify!($field),
                    scalar: $crate::device::KernelScalar::$kind,
                    offset: ::std::mem::offset_of!($name, $field),
                },)+
            ];
        }

        const _: () = $crate::device::kernel_check_layout(
            <$name as $crate::device::KernelStruct>::FIELDS,
            ::std::mem::size_of::<$name>(),
        );
    };
}
