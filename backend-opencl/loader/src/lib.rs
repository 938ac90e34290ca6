//! OpenCL's functions under their own names, found in the system's library when they are first called.
//!
//! The crate `ocl` stands on `cl-sys`, which links the library OpenCL into every program. Such a program is not built
//! where the library is missing, and does not start there. This crate defines the functions that cl-sys declares, and
//! its build script puts an empty library OpenCL first into the linker's search, so that a program depends on none.
//! A call without the library fails with a status; [`load`] says why.
//!
//! The definitions also keep ocl from what it would panic or wait at: no platform is an empty list, releasing an
//! object succeeds, and a status that ocl does not know is kept aside ([`take_unknown`]).
//!
//! On macOS the framework OpenCL always exists, is linked, and nothing of this is there.

// The functions are C's.
#![allow(unsafe_code)]

#[cfg(not(target_os = "macos"))]
#[macro_use]
mod names;

#[cfg(not(target_os = "macos"))]
mod forward;
#[cfg(all(unix, not(target_vendor = "apple")))]
mod hidden;
#[cfg(not(target_os = "macos"))]
mod library;
mod status;

pub use status::{STAND_IN, take_unknown};

/// Environment variable that names another file than the system's library, such as a driver itself.
pub const LIBRARY_VARIABLE: &str = "AIRLIGHT_OPENCL_LIBRARY";

/// Loads the library, the first time that it is called.
///
/// # Errors
/// The library's name and why it cannot be loaded, such as `libOpenCL.so.1 not found`.
pub fn load() -> Result<(), &'static str> {
    #[cfg(not(target_os = "macos"))]
    {
        std::hint::black_box(forward::ALL);
        #[cfg(all(unix, not(target_vendor = "apple")))]
        std::hint::black_box(&hidden::airlight_opencl_hidden);
        library::library()?;
    }
    Ok(())
}
