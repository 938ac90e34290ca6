//! Hides the libraries of Vulkan and OpenCL from a program, for the tests: with this library in `LD_AUDIT`, glibc's
//! loader asks it about every file that it looks for, and finds none of those (rtld-audit(7)).

#![cfg(all(target_os = "linux", target_env = "gnu"))]
#![allow(unsafe_code, reason = "the functions are C's")]

use std::ffi::{CStr, c_char, c_uint};

/// The name that the program gave (`LA_SER_ORIG`), and not a place where the loader looks for it.
const GIVEN: c_uint = 1;

/// Agrees to the loader's version of the interface.
#[unsafe(no_mangle)]
pub extern "C" fn la_version(offered: c_uint) -> c_uint {
    offered
}

/// The name under which a file is to be looked for; none where it shall not be found.
///
/// # Safety
/// `name` is a C string, as the loader gives it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn la_objsearch(name: *const c_char, _asks: *mut usize, from: c_uint) -> *const c_char {
    // SAFETY: as the loader promises.
    let path = unsafe { CStr::from_ptr(name) }.to_bytes();
    let file = path.rsplit(|&byte| byte == b'/').next().unwrap_or_default();
    let hidden = [&b"libvulkan"[..], b"libOpenCL"].iter().any(|start| file.starts_with(start));
    // A bare name passes, so that the loader's message bears it, and is then found nowhere.
    let looked_for = from != GIVEN || path.contains(&b'/');
    if hidden && looked_for { std::ptr::null() } else { name }
}
