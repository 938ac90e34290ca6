//! Structs shared with kernels, defined once in Rust; their WGSL and OpenCL C text is generated from that.

use bytemuck::Pod;

/// Type of a field of a [`KernelStruct`]: scalars and 4-vectors only, because every language lays those out alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

    fn wgsl(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::U32 => "u32",
            Self::F32x4 => "vec4<f32>",
            Self::U32x4 => "vec4<u32>",
        }
    }

    fn opencl(self) -> &'static str {
        match self {
            Self::F32 => "float",
            Self::U32 => "uint",
            Self::F32x4 => "float4",
            Self::U32x4 => "uint4",
        }
    }
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

    /// The struct's text in WGSL.
    fn wgsl() -> String {
        let fields: String = Self::FIELDS.iter().map(|f| format!("    {}: {},\n", f.name, f.scalar.wgsl())).collect();
        format!("struct {} {{\n{fields}}}\n", Self::NAME)
    }

    /// The struct's text in OpenCL C.
    fn opencl() -> String {
        let fields: String = Self::FIELDS.iter().map(|f| format!("    {} {};\n", f.scalar.opencl(), f.name)).collect();
        format!("typedef struct {{\n{fields}}} {};\n", Self::NAME)
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
