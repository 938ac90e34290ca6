//! Hides the functions from other libraries.
//!
//! Rust exports functions of fixed names from every cdylib that holds them. A program that links such a cdylib would
//! then find them before OpenCL's own: the library that is loaded here calls some of its functions by name, and would
//! call these, which call it again, without end. A symbol that any object of a link calls hidden is hidden in what
//! comes of it, and calls to it from within are bound at once.

unsafe extern "C" {
    /// A byte of the object that hides them, by which a linker takes it.
    pub(crate) safe static airlight_opencl_hidden: u8;
}

macro_rules! hide {
    ($($name:ident)*) => {
        core::arch::global_asm!(
            ".pushsection .rodata.airlight_opencl_hidden,\"a\"",
            ".globl airlight_opencl_hidden",
            ".hidden airlight_opencl_hidden",
            "airlight_opencl_hidden:",
            ".byte 0",
            ".popsection",
            $(
                concat!(".globl ", stringify!($name)),
                concat!(".hidden ", stringify!($name)),
            )*
        );
    };
}
names!(hide);
