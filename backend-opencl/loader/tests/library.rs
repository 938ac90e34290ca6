//! What a program or a library that stands on this crate shows of itself, and what calls answer without OpenCL.

#![allow(unsafe_code, reason = "the functions are C's")]

use std::ffi::{OsStr, c_void};
use std::path::PathBuf;
use std::process::Command;
use std::ptr::null_mut;
use std::time::{Duration, Instant};

/// Set in the process that must find no library.
const ALONE: &str = "AIRLIGHT_TEST_WITHOUT_LIBRARY";

/// A library among the examples, which `cargo test` builds, but not for a choice of tests alone.
fn example(name: &str) -> PathBuf {
    let folder = std::env::current_exe().unwrap().parent().unwrap().with_file_name("examples");
    let file = folder.join(format!("{}{name}{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX));
    assert!(file.exists(), "{} is missing; `cargo test` without a choice of tests builds it", file.display());
    file
}

/// Whether this process is the one that a test runs in with that library; else it runs it. Never on macOS, where
/// nothing is there to test.
fn alone(test: &str, library: impl AsRef<OsStr>) -> bool {
    if cfg!(target_os = "macos") || std::env::var_os(ALONE).is_some() {
        return !cfg!(target_os = "macos");
    }
    let child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", test])
        .env(ALONE, "1")
        .env(airlight_opencl_loader::LIBRARY_VARIABLE, library)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&child.stdout);
    assert!(child.status.success() && said.contains("1 passed"), "{said}");
    false
}

#[test]
fn what_ocl_would_wait_or_panic_at_is_kept_from_it() {
    if !alone("what_ocl_would_wait_or_panic_at_is_kept_from_it", example("faulty")) {
        return;
    }
    airlight_opencl_loader::load().unwrap();
    let none: *mut c_void = null_mut();
    let (mut found, mut places) = (7, [none; 3]);
    // SAFETY: places are given where the functions write, and nothing is behind the null pointers.
    unsafe {
        assert_eq!((cl_sys::clGetPlatformIDs(0, null_mut(), &mut found), found), (0, 0));
        assert_eq!((cl_sys::clGetDeviceIDs(none, 1, 3, places.as_mut_ptr(), &mut found), found), (0, 3));
        assert_eq!(airlight_opencl_loader::take_unknown(), None);
        assert_eq!(cl_sys::clFinish(none), airlight_opencl_loader::STAND_IN);
        assert_eq!(airlight_opencl_loader::take_unknown(), Some(-1093));
        assert_eq!(cl_sys::clReleaseMemObject(none), 0);
        // A function that the library lacks.
        assert_eq!(cl_sys::clFlush(none), -1001);
    }
}

#[test]
fn calls_without_the_library_fail_with_a_status_and_at_once() {
    const MISSING: &str = "/nonexistent/libOpenCL.so.1";
    const NAME: &str = "calls_without_the_library_fail_with_a_status_and_at_once";
    if !alone(NAME, MISSING) {
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

    // SAFETY: it is our own.
    let plugin = unsafe { Library::open(Some(example("plugin")), RTLD_NOW | RTLD_GLOBAL) }.unwrap();
    // SAFETY: the functions are of these types, and the second is not called.
    unsafe {
        let platforms = plugin.get::<extern "C" fn() -> i32>(b"airlight_platforms").unwrap();
        assert!(platforms() >= 0);
        for name in ["clGetPlatformIDs", "clReleaseEvent", "clEnqueueNDRangeKernel"] {
            assert!(plugin.get::<*const c_void>(name.as_bytes()).is_err(), "{name} is exported");
        }
    }
}
