//! A library in the manner of C that stands on this crate, for the tests: what it exports, and that it works where
//! its symbols come before those of OpenCL.

#![allow(unsafe_code, reason = "the functions are C's")]

/// The number of platforms, or -1.
#[unsafe(no_mangle)]
pub extern "C" fn airlight_platforms() -> i32 {
    // Without the library there are none.
    let _ = airlight_opencl_loader::load();
    let mut found = 0;
    // SAFETY: there is a place for the number, and none for platforms.
    let status = unsafe { cl_sys::clGetPlatformIDs(0, std::ptr::null_mut(), &mut found) };
    if status == 0 { found as i32 } else { -1 }
}
