//! A library in the place of OpenCL's that does everything wrong, for the tests.

#![allow(unsafe_code, clippy::missing_safety_doc, reason = "the functions are C's")]

use std::ffi::c_void;

/// No platform, in the words of the ICD loader.
#[unsafe(no_mangle)]
pub extern "C" fn clGetPlatformIDs(_: u32, _: *mut *mut c_void, _: *mut u32) -> i32 {
    -1001
}

/// More devices than there are places.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn clGetDeviceIDs(_: *mut c_void, _: u64, _: u32, _: *mut *mut c_void, found: *mut u32) -> i32 {
    // SAFETY: the test gives a place.
    unsafe { *found = 1000 };
    0
}

/// A status of a vendor's own.
#[unsafe(no_mangle)]
pub extern "C" fn clFinish(_: *mut c_void) -> i32 {
    -1093
}

/// Cannot be released.
#[unsafe(no_mangle)]
pub extern "C" fn clReleaseMemObject(_: *mut c_void) -> i32 {
    -38
}
