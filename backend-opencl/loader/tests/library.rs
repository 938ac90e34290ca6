//! What a program or a library that stands on this crate shows of itself, and what calls answer without OpenCL.

#![allow(unsafe_code, reason = "the functions are C's")]

use std::ffi::c_void;
use std::process::Command;
use std::ptr::null_mut;
use std::time::{Duration, Instant};

/// Set in the process that must find no library.
const ALONE: &str = "AIRLIGHT_TEST_WITHOUT_LIBRARY";

#[test]
fn calls_without_the_library_fail_with_a_status_and_at_once() {
    const MISSING: &str = "/nonexistent/libOpenCL.so.1";
    if cfg!(target_os = "macos") {
        return;
    }
    if std::env::var_os(ALONE).is_none() {
        let child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "calls_without_the_library_fail_with_a_status_and_at_once"])
            .env(ALONE, "1")
            .env(airlight_opencl_loader::LIBRARY_VARIABLE, MISSING)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&child.stdout);
        assert!(child.status.success() && said.contains("1 passed"), "{said}");
        return;
    }
    let begin = Instant::now();
    let said = airlight_opencl_loader::load().unwrap_err();
    assert_eq!(said, format!("{MISSING} not found (named by AIRLIGHT_OPENCL_LIBRARY)"));
    let (mut found, mut status) = (7, 7);
    // SAFETY: places are given where the functions write, and nothing is behind the null pointers.
    unsafe {
        assert_eq!((cl_sys::clGetPlatformIDs(0, null_mut(), &mut found), found), (0, 0));
        let none: *mut c_void = null_mut();
        assert_eq!(cl_sys::clGetDeviceIDs(none, 1, 0, null_mut(), &mut found), -1001);
        assert!(cl_sys::clCreateContext(null_mut(), 0, null_mut(), None, null_mut(), &mut status).is_null());
        assert_eq!(status, -1001);
        assert!(cl_sys::clCreateContext(null_mut(), 0, null_mut(), None, null_mut(), null_mut()).is_null());
        assert_eq!((cl_sys::clFinish(none), cl_sys::clReleaseContext(none)), (-1001, 0));
    }
    // It takes tens of microseconds; ocl would wait ten seconds for a platform.
    assert!(begin.elapsed() < Duration::from_secs(1));
}

/// A library that exported these functions would come before the one that it loads, whose calls among its own
/// functions would then end here again.
#[cfg(all(unix, not(target_vendor = "apple")))]
#[test]
fn a_library_that_stands_on_this_one_exports_none_of_the_functions() {
    use libloading::os::unix::{Library, RTLD_GLOBAL, RTLD_NOW};

    let folder = std::env::current_exe().unwrap().parent().unwrap().with_file_name("examples");
    let file = folder.join("libplugin.so");
    // SAFETY: it is our own.
    let plugin = unsafe { Library::open(Some(&file), RTLD_NOW | RTLD_GLOBAL) }
        .unwrap_or_else(|e| panic!("{e}; `cargo test` builds it among the examples, a choice of tests alone does not"));
    // SAFETY: the functions are of these types, and the second is not called.
    unsafe {
        let platforms = plugin.get::<extern "C" fn() -> i32>(b"airlight_platforms\0").unwrap();
        assert!(platforms() >= 0);
        for name in ["clGetPlatformIDs\0", "clReleaseEvent\0", "clEnqueueNDRangeKernel\0"] {
            assert!(plugin.get::<*const c_void>(name.as_bytes()).is_err(), "{name} is exported");
        }
    }
}
